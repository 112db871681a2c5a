//! The declarations of the keys and what the reader does are the same.
//!
//! Protocols are built from the examples of the declarations, with one table at a
//! time holding every key that it can have, and are then changed key by key.

use crate::protocol::Protocol;
use crate::protocol::file::{ROOT, parse};
use crate::protocol::keys::{Absent, Key, Kind, Shape, Variants};
use std::ops::Bound;
use toml::{Table, Value};

/// A step to a table: into a key, or to the last table of an array.
type Path = Vec<&'static str>;

/// A protocol in which one table has every key.
struct Case {
    document: Table,
    /// Where the table is.
    path: Path,
    keys: Vec<&'static Key>,
}

fn example(key: &Key) -> Value {
    let text = format!("v = {}", key.example);
    let table: Table = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
    table["v"].clone()
}

/// Without parts their order is refused, without a choice the share of an answer, and without
/// factors levels and the effects that are tested; `factors` tests those. The media of a duplicate are
/// those of its original, and without media their bound is refused; `media` tests those.
const LEFT_OUT: [&str; 10] = [
    "parts_order",
    "share_of",
    "levels",
    "model",
    "picture",
    "video",
    "sound",
    "alt",
    "caption",
    "media_within_ms",
];

fn with_examples<'a>(keys: impl IntoIterator<Item = &'a Key>) -> Table {
    (keys.into_iter())
        .filter(|key| !key.example.is_empty() && !LEFT_OUT.contains(&key.name))
        .map(|key| (key.name.to_owned(), example(key)))
        .collect()
}

fn required(keys: &[Key]) -> impl Iterator<Item = &Key> {
    keys.iter().filter(|key| key.absent == Absent::Error)
}

fn shaped(variants: &'static Variants, shape: &'static Shape) -> (Table, Vec<&'static Key>) {
    let keys: Vec<&Key> = variants.common.iter().chain(shape.keys).collect();
    let mut table = with_examples(keys.iter().copied());
    table.insert(variants.tag.to_owned(), shape.word.word.into());
    if table.contains_key("id") {
        table.insert("id".to_owned(), "probe".into());
    }
    if shape.word.word == "text" {
        // The example of the others is the default here.
        table.insert("required".to_owned(), true.into());
    }
    (table, keys)
}

/// A protocol with the keys that cannot be left out.
fn least() -> Table {
    let mut document = Table::new();
    for key in ROOT {
        let value: Value = match key.kind {
            // The newest format has every key.
            Kind::Word(words) => words[words.len() - 1].word.into(),
            Kind::Table(keys) => with_examples(required(keys)).into(),
            Kind::Tables(keys) => vec![Value::from(with_examples(&keys[..2]))].into(),
            Kind::Variants(variants) if key.name == "questions" => {
                let (mut table, _) = shaped(variants, &variants.shapes[0]);
                table.insert("id".to_owned(), "realism".into());
                vec![Value::from(table)].into()
            }
            _ => continue,
        };
        let needed = key.absent == Absent::Error || matches!(key.name, "models" | "questions");
        if value.as_table().is_some_and(Table::is_empty) || !needed {
            continue;
        }
        document.insert(key.name.to_owned(), value);
    }
    let limits = "force_n = 12.0\nvelocity_mm_s = 1000.0"
        .parse::<Table>()
        .unwrap();
    table_at(&mut document, &["device"]).insert("limits".to_owned(), limits.into());
    let design = table_at(&mut document, &["design"]);
    design.insert("repetitions".to_owned(), 3.into());
    design.insert("order".to_owned(), "blocked".into());
    let spring = "id = \"spring\"\nrole = \"practice\"\nfile = \"s.toml\"".parse::<Table>();
    array_at(&mut document, "models").push(spring.unwrap().into());
    document
}

fn array_at<'t>(document: &'t mut Table, name: &str) -> &'t mut Vec<Value> {
    let entry = document
        .entry(name)
        .or_insert_with(|| Vec::<Value>::new().into());
    entry.as_array_mut().unwrap()
}

fn table_at<'t>(document: &'t mut Table, path: &[&str]) -> &'t mut Table {
    let mut table = document;
    for name in path {
        table = match &mut table[*name] {
            Value::Array(tables) => tables.last_mut().unwrap().as_table_mut().unwrap(),
            value => value.as_table_mut().unwrap(),
        };
    }
    table
}

/// Every table that a protocol can have, with every key.
fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut whole = least();
    // Keys of parts exclude each other; `parts` tests them. Factors need levels of all
    // realizations, spaces a part. The unit of an outcome follows from what is measured, and
    // its questions have to be there; `outcomes` tests them.
    let elsewhere = |key: &&Key| {
        crate::protocol::file::OF_FORMAT_2.contains(&key.name)
            || ["factors", "spaces", "outcomes"].contains(&key.name)
    };
    let root = || ROOT.iter().filter(|key| !elsewhere(key));
    for key in root() {
        match key.kind {
            Kind::Table(keys) => tables(vec![key.name], keys, &mut cases),
            // A realization has a file or a bundle.
            Kind::Tables(keys) => cases.extend(["file", "bundle"].map(|other| {
                let mut document = least();
                // The original of the duplicate in the examples.
                let original = "id = \"lambda-0.9991\"\ndevice = \"manual\"".parse::<Table>();
                let models = array_at(&mut document, key.name);
                models[0] = original.unwrap().into();
                let keys: Vec<&Key> = keys.iter().filter(|key| key.name != other).collect();
                models.push(with_examples(keys.iter().copied()).into());
                Case {
                    document,
                    path: vec![key.name],
                    keys,
                }
            })),
            Kind::Variants(variants) => alternatives(&[], key.name, variants, &mut cases),
            _ => {}
        }
        if let Kind::Table(keys) = key.kind {
            whole.insert(key.name.to_owned(), with_examples(keys).into());
        } else if let Kind::Variants(variants) = key.kind
            && key.name != "questions"
        {
            let (mut table, _) = shaped(variants, &variants.shapes[0]);
            table.insert("id".to_owned(), key.name.into());
            whole.insert(key.name.to_owned(), vec![Value::from(table)].into());
        }
    }
    let (path, keys) = (Vec::new(), root().collect());
    let document = whole;
    cases.push(Case {
        document,
        path,
        keys,
    });
    cases
}

/// A section, and the tables in it.
fn tables(path: Path, keys: &'static [Key], cases: &mut Vec<Case>) {
    let mut document = least();
    let parent = path[..path.len() - 1].to_vec();
    let name = path[path.len() - 1];
    document
        .entry(path[0])
        .or_insert_with(|| Table::new().into());
    table_at(&mut document, &parent).insert(name.to_owned(), with_examples(keys).into());
    cases.push(Case {
        document,
        path: path.clone(),
        keys: keys.iter().collect(),
    });
    for key in keys {
        match key.kind {
            Kind::Table(keys) | Kind::WordOrTable(_, keys) => {
                tables([path.clone(), vec![key.name]].concat(), keys, cases);
            }
            Kind::Variants(variants) => alternatives(&path, key.name, variants, cases),
            _ => {}
        }
    }
}

fn alternatives(
    parent: &[&'static str],
    name: &'static str,
    of: &'static Variants,
    cases: &mut Vec<Case>,
) {
    for shape in of.shapes {
        let mut document = least();
        let (table, keys) = shaped(of, shape);
        array_at(table_at(&mut document, parent), name).push(table.into());
        let path = [parent, &[name]].concat();
        cases.push(Case {
            document,
            path,
            keys,
        });
    }
}

/// The messages of the faults, with the labels, and the protocol.
fn read(document: &Table) -> (Vec<String>, Option<Protocol>) {
    let parsed = parse("protocol.toml", &document.to_string());
    let fault = |f: &study_base::diagnostic::Fault| {
        format!("{} [{}]", f.message, f.label.as_deref().unwrap_or_default())
    };
    let faults = parsed.findings.faults.iter().map(fault).collect();
    (faults, parsed.protocol)
}

impl Case {
    fn changed(&self, change: impl FnOnce(&mut Table)) -> (Vec<String>, Option<Protocol>) {
        let mut document = self.document.clone();
        change(table_at(&mut document, &self.path));
        read(&document)
    }

    fn with(&self, key: &Key, value: Value) -> (Vec<String>, Option<Protocol>) {
        self.changed(|table| drop(table.insert(key.name.to_owned(), value)))
    }

    fn without(&self, key: &Key) -> (Vec<String>, Option<Protocol>) {
        self.changed(|table| drop(table.remove(key.name)))
    }

    /// The keys that the table has.
    fn present(&self) -> impl Iterator<Item = &'static Key> {
        let mut document = self.document.clone();
        let table = table_at(&mut document, &self.path).clone();
        let keys = self.keys.clone().into_iter();
        keys.filter(move |key| table.contains_key(key.name))
    }
}

#[test]
fn every_example_is_read_without_a_fault() {
    let cases = cases();
    assert!(cases.len() > 35, "{}", cases.len());
    for case in cases {
        let (faults, protocol) = read(&case.document);
        assert_eq!(
            faults,
            Vec::<String>::new(),
            "{:?}\n{}",
            case.path,
            case.document
        );
        assert!(protocol.is_some(), "{:?}", case.path);
        for key in &case.keys {
            let array = matches!(key.kind, Kind::Variants(_)) || LEFT_OUT.contains(&key.name);
            assert!(
                array || case.present().any(|k| k.name == key.name),
                "{}",
                key.name
            );
        }
    }
}

/// A key that is declared but not read would change nothing.
#[test]
fn every_declared_key_changes_what_is_read_or_cannot_be_left_out() {
    for case in cases() {
        let (_, whole) = read(&case.document);
        for key in case.present() {
            let (faults, protocol) = case.without(key);
            if key.absent == Absent::Error {
                let missing = faults.iter().any(|f| {
                    f.contains(&format!("has no `{}`", key.name))
                        || f.contains(&format!("has no [{}]", key.name))
                        || f.contains(&format!("no [[{}]]", key.name))
                });
                assert!(missing, "{:?} {}: {faults:?}", case.path, key.name);
            } else {
                assert_ne!(protocol, whole, "{:?} {}", case.path, key.name);
            }
        }
    }
}

#[test]
fn every_misspelt_key_is_refused_and_the_right_one_suggested() {
    for case in cases() {
        let mut document = case.document.clone();
        let names: Vec<String> = table_at(&mut document, &case.path)
            .keys()
            .cloned()
            .collect();
        for name in names {
            let (faults, _) = case.changed(|table| {
                let value = table.remove(&name).unwrap();
                table.insert(format!("{name}x"), value);
            });
            let unknown = format!("unknown key `{name}x`");
            let suggested = format!("[did you mean `{name}`?]");
            assert!(
                faults
                    .iter()
                    .any(|f| f.starts_with(&unknown) && f.ends_with(&suggested)),
                "{:?} {name}: {faults:?}",
                case.path
            );
            let missing = format!("has no `{name}`");
            let twice = faults.iter().any(|f| f.contains(&missing));
            assert!(
                !twice || name == "format",
                "{:?} {name}: {faults:?}",
                case.path
            );
        }
    }
}

/// Values of another type or outside the range.
fn bad_values(kind: Kind) -> Vec<Value> {
    let parsed = |texts: &[&str]| -> Vec<Value> {
        let value = |text: &&str| format!("v = {text}").parse::<Table>().unwrap()["v"].clone();
        texts.iter().map(value).collect()
    };
    match kind {
        Kind::Text => parsed(&["1", "\"\"", "\" \"", "[\"x\"]"]),
        Kind::Texts(0) => parsed(&["\"x\"", "[1]", "[\"\"]"]),
        Kind::Texts(_) => parsed(&["\"x\"", "[1]", "[\"\"]", "[]"]),
        Kind::Id(_) => parsed(&["1", "\"\"", "\"a b\"", "\"a/b\"", "\"ä\""]),
        Kind::ModelIds | Kind::Ids(_) => parsed(&["\"a\"", "[1]", "[\"a b\"]"]),
        Kind::Path => parsed(&["1", "\"\"", "\"../a\"", "\"/a\"", "\"a\\\\b\""]),
        Kind::Whole(least, most) => {
            let mut bad = parsed(&["1.5", "\"1\"", "true"]);
            bad.extend(least.checked_sub(1).map(Value::from));
            bad.extend(most.checked_add(1).map(Value::from));
            bad
        }
        Kind::Number((low, high), _) => {
            let mut bad = parsed(&["nan", "inf", "-inf", "\"1\"", "true"]);
            bad.extend(match low {
                Bound::Included(low) => Some(Value::from(low - 0.001)),
                Bound::Excluded(low) => Some(Value::from(low)),
                Bound::Unbounded => None,
            });
            bad.extend(match high {
                Bound::Included(high) => Some(Value::from(high + 0.001)),
                Bound::Excluded(high) => Some(Value::from(high)),
                Bound::Unbounded => None,
            });
            bad
        }
        Kind::WholeList(..) => parsed(&["1", "[\"1\"]", "[1.5]", "[-1]"]),
        Kind::Flag => parsed(&["1", "\"true\""]),
        Kind::NumberList => parsed(&["1", "[]", "[nan]", "[\"1\"]"]),
        Kind::Pairs => parsed(&["1", "\"some\"", "[]", "[[\"a\"]]"]),
        Kind::Word(_) => parsed(&["1", "\"zzzzzzzz\"", "\"\""]),
        Kind::WordOrTable(..) => parsed(&["1", "\"zzzzzzzz\"", "{}"]),
        Kind::WholeLabels => parsed(&["1", "{ x = \"a\" }", "{ 1 = \"\" }", "{ 1 = 2 }"]),
        Kind::NumberLabels => parsed(&["1", "{ x = \"a\" }", "{ 0 = \"\" }", "{ 5000 = \"a\" }"]),
        Kind::Numbers => parsed(&["1", "{ a = \"1\" }", "{ a = nan }", "{ \"a b\" = 1 }"]),
        Kind::TextsByName => parsed(&["1", "{ a = 1 }", "{ a = \"\" }"]),
        Kind::Sentences => parsed(&[
            "1",
            "{ zz = \"a\" }",
            "{ rate = \"\" }",
            "{ trial-of = \"x\" }",
        ]),
        Kind::Table(_) | Kind::Variant(_) => parsed(&["1", "\"x\"", "[1]", "{ zzzzzzzz = 1 }"]),
        Kind::Tables(_) | Kind::Variants(_) => parsed(&["1", "[1]", "[{ zzzzzzzz = 1 }]"]),
    }
}

/// The ends of a range.
fn extreme_values(kind: Kind) -> Vec<Value> {
    let near = -1_000_000..=1_000_000;
    match kind {
        Kind::Whole(least, most) => [least, most]
            .into_iter()
            .filter(|n| near.contains(n))
            .map(Value::from)
            .collect(),
        Kind::Number((low, high), _) => [low, high]
            .into_iter()
            .filter_map(|bound| match bound {
                Bound::Included(end) => Some(Value::from(end)),
                Bound::Excluded(_) | Bound::Unbounded => None,
            })
            .collect(),
        Kind::Word(words) => words.iter().map(|word| word.word.into()).collect(),
        Kind::WordOrTable(words, _) => words.iter().map(|word| word.word.into()).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn every_value_out_of_range_is_refused_and_the_ends_of_the_range_are_not() {
    for case in cases() {
        for key in &case.keys {
            for bad in bad_values(key.kind) {
                let shown = bad.to_string();
                let (faults, protocol) = case.with(key, bad);
                assert!(!faults.is_empty(), "{:?} {} = {shown}", case.path, key.name);
                assert_eq!(protocol, None, "{:?} {} = {shown}", case.path, key.name);
            }
            for good in extreme_values(key.kind) {
                let shown = good.to_string();
                let (faults, _) = case.with(key, good);
                let refused = |f: &&String| f.contains("has to be") || f.contains("` cannot be `");
                assert_eq!(faults.iter().find(refused), None, "{} = {shown}", key.name);
            }
        }
    }
}

#[test]
fn every_declared_default_is_what_the_reader_gives() {
    let mut defaults = 0;
    for case in cases() {
        for key in case.present() {
            if let Absent::Default(toml) = key.absent {
                defaults += 1;
                let value = format!("v = {toml}").parse::<Table>().unwrap()["v"].clone();
                let (faults, explicit) = case.with(key, value);
                assert_eq!(faults, Vec::<String>::new(), "{}", key.name);
                assert_eq!(
                    explicit,
                    case.without(key).1,
                    "{:?} {}",
                    case.path,
                    key.name
                );
            }
        }
    }
    assert!(defaults >= 8, "{defaults}");
}

#[test]
fn a_slider_moves_by_a_hundredth_of_its_scale_unless_told_otherwise() {
    let slider = cases()
        .into_iter()
        .find(|case| case.keys.iter().any(|k| k.name == "step"));
    let slider = slider.unwrap();
    let step = slider.keys.iter().find(|key| key.name == "step").unwrap();
    let one = slider.with(step, Value::from(1.0));
    assert_eq!(slider.without(step), one);
}

/// What stands in a file is written again by the rule that was read from it.
#[test]
fn every_exclusion_rule_is_read_as_itself() {
    for case in cases()
        .iter()
        .filter(|case| case.path.last() == Some(&"exclude"))
    {
        let mut document = case.document.clone();
        let written = table_at(&mut document, &case.path).clone();
        let (_, protocol) = read(&case.document);
        let rule = *protocol.unwrap().analysis.exclude.last().unwrap();
        let (name, parameters) = (rule.name(), rule.parameters());
        assert_eq!(Some(name), written["rule"].as_str());
        assert_eq!(written.len(), 1 + parameters.len());
        for (parameter, value) in parameters {
            let number = written[parameter].as_float();
            let whole = || written[parameter].as_integer().map(|n| n as f64);
            assert_eq!(number.or_else(whole), Some(value), "{name}");
        }
    }
}
