//! Reads a section of a protocol file by the declarations of its keys.
//!
//! Faults are collected and reading goes on. A value that is absent or faulty is
//! its default, or `None`; a document with a fault becomes no protocol, whatever
//! its values.

use crate::protocol::keys::{Absent, Key, Kind, Shape, Variants, Word, Words, one_of};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::{Document, Table, Value};
use study_base::limits::Limit;
use study_base::text::{BadId, ModelId, PartId, QuestionId, Untrusted};

/// Longest text of one key, bytes.
const MAX_FIELD_BYTES: usize = 64 * 1024;

/// A section that is being read.
#[derive(Debug)]
pub(super) struct Section<'d, 't> {
    document: &'d Document<'t>,
    /// Whether the syntax of the file is broken: keys may have been lost then,
    /// and missing ones are not reported.
    broken: bool,
    /// Absent, every key has its default.
    table: Option<Table<'d, 't>>,
    keys: Vec<&'static Key>,
    /// Keys that are there, but misspelt.
    misspelt: Vec<String>,
}

/// An alternative of a section whose keys depend on one of them, and its reader.
pub(super) struct Variant<T> {
    pub(super) shape: Shape,
    pub(super) read: for<'s, 'd, 't> fn(&'s mut Section<'d, 't>) -> Option<T>,
}

impl<T> Variant<T> {
    pub(super) const fn new(
        word: &'static str,
        meaning: &'static str,
        keys: &'static [Key],
        read: for<'s, 'd, 't> fn(&'s mut Section<'d, 't>) -> Option<T>,
    ) -> Self {
        let word = Word::new(word, meaning);
        let shape = Shape { word, keys };
        Self { shape, read }
    }
}

impl<T> AsRef<Shape> for Variant<T> {
    fn as_ref(&self) -> &Shape {
        &self.shape
    }
}

/// The declarations of all alternatives.
pub(super) const fn shapes<T, const N: usize>(variants: &[Variant<T>; N]) -> [Shape; N] {
    let mut shapes = [variants[0].shape; N];
    let mut i = 0;
    while i < N {
        shapes[i] = variants[i].shape;
        i += 1;
    }
    shapes
}

impl<'d, 't> Section<'d, 't> {
    /// The whole file.
    pub(super) fn root(document: &'d Document<'t>, broken: bool, keys: &'static [Key]) -> Self {
        Self::open(document, broken, Some(document.root()), keys)
    }

    /// Reports unknown keys.
    fn open(
        document: &'d Document<'t>,
        broken: bool,
        table: Option<Table<'d, 't>>,
        keys: &'static [Key],
    ) -> Self {
        let names: Vec<&str> = keys.iter().map(|key| key.name).collect();
        let misspelt = table.as_ref().map(|table| table.refuse_unknown(&names));
        Self {
            document,
            broken,
            table,
            keys: keys.iter().collect(),
            misspelt: misspelt.unwrap_or_default(),
        }
    }

    /// Whether the file has it. One that is absent is read as an empty one.
    pub(super) fn is_there(&self) -> bool {
        self.table.is_some()
    }

    /// Its path, such as `questions[0]`.
    pub(super) fn path(&self) -> &str {
        self.table.as_ref().map_or("", Table::path)
    }

    /// Adds a fault about the value of a key, or about the section without it.
    pub(super) fn fault_at(&self, name: &str, fault: Fault) {
        match &self.table {
            Some(table) => table.fault_at(name, fault),
            None => self.document.fault(fault),
        }
    }

    /// Adds a fault about the value at a path from the top of the file.
    pub(super) fn fault_at_path(&self, path: &str, fault: Fault) {
        self.document.fault(fault.at(self.document.span_of(path)));
    }

    /// The declaration of a key.
    pub(super) fn key(&self, name: &str) -> &'static Key {
        let declared = self.keys.iter().find(|key| key.name == name);
        declared.unwrap_or_else(|| panic!("[{}] declares no key `{name}`", self.path()))
    }

    /// The value of a key; its absence is a fault if it cannot be left out.
    pub(super) fn value(&mut self, name: &str) -> Option<Value<'d, 't>> {
        let key = self.key(name);
        let value = self.table.as_mut()?.value(name);
        // A study without [[models]] or [[questions]] is reported by `agree`.
        let array = matches!(key.kind, Kind::Tables(_) | Kind::Variants(_));
        if value.is_none() && key.absent == Absent::Error && !array {
            let hint = match key.kind {
                Kind::Table(keys) if keys.iter().any(|key| key.absent == Absent::Error) => {
                    needed(keys)
                }
                Kind::Word(_) | Kind::WordOrTable(..) => key.kind.describe(),
                _ => key.such_as(),
            };
            self.report_missing(name, hint);
        }
        value
    }

    /// Reports that a key is missing.
    pub(super) fn report_missing(&self, name: &str, hint: String) {
        if self.broken || self.misspelt.iter().any(|near| near == name) {
            return;
        }
        let fault = |what: String| Fault::error(what).hint(hint);
        match self.path() {
            "" => (self.document).fault(fault(format!("the file has no [{name}]"))),
            place => self.fault_at(name, fault(format!("[{place}] has no `{name}`"))),
        }
    }

    /// Text.
    pub(super) fn text(&mut self, name: &str) -> Option<String> {
        text(&self.value(name)?)
    }

    /// A list of texts, each with its value.
    pub(super) fn texts(&mut self, name: &str) -> Vec<(Value<'d, 't>, String)> {
        let list = self.value(name);
        let Some((values, list)) = list.and_then(|list| Some((list.array()?, list))) else {
            return Vec::new();
        };
        if let Kind::Texts(least) = self.key(name).kind
            && values.len() < least
        {
            let wrong = match values.len() {
                0 => format!("`{}` is empty", list.path()),
                n => format!(
                    "`{}` has too few entries: {n} of at least {least}",
                    list.path()
                ),
            };
            list.fault(Fault::error(wrong));
        }
        (values.into_iter())
            .filter_map(|value| {
                let text = text(&value)?;
                Some((value, text))
            })
            .collect()
    }

    /// A whole number in the range of its key.
    pub(super) fn whole<T: TryFrom<i64> + FromStr>(&mut self, name: &str) -> Option<T> {
        let given = self.value(name);
        let kind = self.key(name).kind;
        let number = given.and_then(|value| {
            let number = value.i64()?;
            match kind {
                Kind::Whole(least, _) if number < least => {
                    out_of_range(&value, &kind.describe(), number)
                }
                Kind::Whole(_, most) if number > most => {
                    out_of_range(&value, &format!("at most {most}"), number)
                }
                _ => T::try_from(number).ok(),
            }
        });
        number.or_else(|| self.default(name)?.parse().ok())
    }

    /// A finite number in the range of its key.
    pub(super) fn number(&mut self, name: &str) -> Option<f64> {
        let given = self.value(name);
        let kind = self.key(name).kind;
        let number = given.and_then(|value| number(&value, kind));
        number.or_else(|| self.default(name)?.parse().ok())
    }

    /// A list of whole numbers in the range of its key.
    pub(super) fn wholes(&mut self, name: &str) -> Vec<u32> {
        let values = self.value(name).and_then(|value| value.array());
        let Kind::WholeList(least, most) = self.key(name).kind else {
            panic!("`{name}` is not declared as a list of whole numbers");
        };
        let in_range = |value: &Value<'_, '_>| {
            let number = value.i64()?;
            if (least..=most).contains(&number) {
                u32::try_from(number).ok()
            } else {
                let expected = format!("from {least} to {most}");
                out_of_range(value, &expected, number)
            }
        };
        values.iter().flatten().filter_map(in_range).collect()
    }

    /// A finite number above 0.
    pub(super) fn limit(&mut self, name: &str) -> Option<Limit> {
        Limit::new(self.number(name)?).ok()
    }

    /// `true` or `false`.
    pub(super) fn flag(&mut self, name: &str) -> Option<bool> {
        let given = self.value(name).and_then(|value| value.bool());
        given.or_else(|| self.default(name)?.parse().ok())
    }

    /// One of the words of an enumeration.
    pub(super) fn word<T: Words>(&mut self, name: &str) -> Option<T> {
        let given = self.value(name).and_then(|value| value.word(T::VALUES));
        given.or_else(|| {
            let default = self.default(name)?.trim_matches('"');
            let found = T::VALUES.iter().find(|(word, _)| *word == default);
            found.map(|(_, value)| value.clone())
        })
    }

    fn default(&self, name: &str) -> Option<&'static str> {
        match self.key(name).absent {
            Absent::Default(toml) => Some(toml),
            Absent::Error | Absent::Nothing | Absent::Derived(_) => None,
        }
    }

    /// The id of a study.
    pub(super) fn study_id(&mut self, name: &str) -> Option<String> {
        let value = self.value(name)?;
        let id = value.text()?;
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !(1..=64).contains(&id.len()) || !id.chars().all(allowed) {
            value.fault(
                Fault::error(format!("`{}` is not a study id", Untrusted(&id)))
                    .label("use 1 to 64 of a-z 0-9 -"),
            );
            return None;
        }
        Some(id)
    }

    /// The id of a realization.
    pub(super) fn model_id(&mut self, name: &str) -> Option<ModelId> {
        parsed(&self.value(name)?)
    }

    /// A list of ids of realizations.
    pub(super) fn model_ids(&mut self, name: &str) -> Vec<ModelId> {
        let values = self.value(name).and_then(|value| value.array());
        values.iter().flatten().filter_map(parsed).collect()
    }

    /// The id of a part, family or track.
    pub(super) fn part_id(&mut self, name: &str) -> Option<PartId> {
        parsed(&self.value(name)?)
    }

    /// A list of identifiers; `None` if the key is absent.
    pub(super) fn ids<T: FromStr<Err = BadId>>(&mut self, name: &str) -> Option<Vec<T>> {
        let values = self.value(name)?.array()?;
        Some(values.iter().filter_map(parsed).collect())
    }

    /// A list of finite numbers, not empty; `None` if the key is absent.
    pub(super) fn numbers(&mut self, name: &str) -> Option<Vec<f64>> {
        let list = self.value(name)?;
        let values = list.array()?;
        if values.is_empty() {
            list.fault(Fault::error(format!("`{}` is empty", list.path())));
        }
        let each = |value| number(value, Kind::ANY_NUMBER);
        Some(values.iter().filter_map(each).collect())
    }

    /// The id of a question.
    pub(super) fn question_id(&mut self, name: &str) -> Option<QuestionId> {
        parsed(&self.value(name)?)
    }

    /// A path of a file beside or below the protocol, with `/` between folders. It
    /// stays inside the protocol's folder, so that a study can be copied as a
    /// whole.
    pub(super) fn path_of(&mut self, name: &str) -> Option<String> {
        let value = self.value(name)?;
        let path = text(&value)?;
        let outside = path.split('/').any(|part| matches!(part, "" | "." | ".."));
        let foreign = path.contains(['\\', ':']) || path.contains(study_base::text::is_unsafe);
        if outside || foreign {
            value.fault(
                Fault::error(format!("`{}` cannot be `{}`", value.path(), Untrusted(&path)))
                    .label("has to stay inside the protocol's folder")
                    .hint("copy the file into the protocol's folder and write its path with `/`, such as `models/a.toml`"),
            );
            return None;
        }
        Some(path)
    }

    /// The keys and values of a table with arbitrary keys.
    pub(super) fn entries(&mut self, name: &str) -> Vec<(String, Value<'d, 't>)> {
        let Some(mut table) = self.value(name).and_then(|value| value.table()) else {
            return Vec::new();
        };
        let keys = table.keys();
        (keys.into_iter())
            .filter_map(|(key, _)| table.value(&key).map(|value| (key, value)))
            .collect()
    }

    /// The table `labels` of texts at numbers of a scale.
    pub(super) fn number_labels(&mut self, from: f64, to: f64) -> Option<BTreeMap<String, String>> {
        let mut labels = BTreeMap::new();
        for (key, label) in self.entries("labels") {
            match key.parse::<f64>() {
                Ok(at) if (from..=to).contains(&at) => {
                    labels.insert(at.to_string(), text(&label)?);
                }
                _ => label.fault(Fault::error(format!(
                    "a label belongs to a number from {from} to {to}, not to `{}`",
                    Untrusted(&key)
                ))),
            }
        }
        Some(labels)
    }

    /// A section inside this one. If it is absent, it is read as an empty one,
    /// unless it has keys that cannot be left out.
    pub(super) fn section(&mut self, name: &str) -> Option<Self> {
        let (Kind::Table(keys) | Kind::WordOrTable(_, keys)) = self.key(name).kind else {
            panic!("`{name}` is not declared as a table");
        };
        let value = self.value(name);
        if value.is_none() && keys.iter().any(|key| key.absent == Absent::Error) {
            return None;
        }
        let table = match value {
            Some(value) => Some(value.table()?),
            None => None,
        };
        Some(Self::open(self.document, self.broken, table, keys))
    }

    /// The tables of an array.
    pub(super) fn sections(&mut self, name: &str) -> Vec<Self> {
        let Kind::Tables(keys) = self.key(name).kind else {
            panic!("`{name}` is not declared as an array of tables");
        };
        let (document, broken) = (self.document, self.broken);
        let open = |table| Self::open(document, broken, Some(table), keys);
        self.tables(name).into_iter().map(open).collect()
    }

    /// The tables of an array whose keys depend on one of them, each with its
    /// alternative; `None` if that cannot be told.
    pub(super) fn variants<V: AsRef<Shape>>(
        &mut self,
        name: &str,
        variants: &'static [V],
    ) -> Vec<(Self, Option<&'static V>)> {
        let Kind::Variants(declared) = self.key(name).kind else {
            panic!("`{name}` is not declared as an array of alternatives");
        };
        let tables = self.tables(name);
        (tables.into_iter())
            .map(|table| self.alternative(table, declared, variants))
            .collect()
    }

    /// The table whose keys depend on one of them, with its alternative.
    pub(super) fn variant<T>(
        &mut self,
        name: &str,
        variants: &'static [Variant<T>],
    ) -> Option<(Self, Option<&'static Variant<T>>)> {
        let Kind::Variant(declared) = self.key(name).kind else {
            panic!("`{name}` is not declared as a table of alternatives");
        };
        let table = self.value(name)?.table()?;
        Some(self.alternative(table, declared, variants))
    }

    fn alternative<V: AsRef<Shape>>(
        &self,
        mut table: Table<'d, 't>,
        declared: &'static Variants,
        variants: &'static [V],
    ) -> (Self, Option<&'static V>) {
        let words: Vec<(&'static str, &'static V)> = (variants.iter())
            .map(|v| (v.as_ref().word.word, v))
            .collect();
        let tag = table.value(declared.tag);
        let variant = tag.as_ref().and_then(|value| value.word(&words));
        let mut section = Self {
            document: self.document,
            broken: self.broken,
            table: None,
            keys: declared.common.iter().collect(),
            misspelt: Vec::new(),
        };
        section
            .keys
            .extend(variant.iter().flat_map(|v| v.as_ref().keys));
        let mut known: Vec<&str> = section.keys.iter().map(|key| key.name).collect();
        known.push(declared.tag);
        if tag.is_none() {
            // Perhaps it is misspelt: then that is the only fault.
            let all = declared.shapes.iter().flat_map(|shape| shape.keys);
            known.extend(all.map(|key| key.name));
        }
        if variant.is_some() || tag.is_none() {
            section.misspelt = table.refuse_unknown(&known);
        }
        section.table = Some(table);
        if tag.is_none() {
            let words: Vec<Word> = declared.shapes.iter().map(|shape| shape.word).collect();
            section.report_missing(declared.tag, one_of(&words));
        }
        (section, variant)
    }

    fn tables(&mut self, name: &str) -> Vec<Table<'d, 't>> {
        let values = self.value(name).and_then(|value| value.array());
        (values.into_iter().flatten())
            .filter_map(Value::table)
            .collect()
    }
}

/// Text, not empty and not longer than [`MAX_FIELD_BYTES`].
pub(super) fn text(value: &Value<'_, '_>) -> Option<String> {
    let text = value.text()?;
    let length = text.len();
    if length > MAX_FIELD_BYTES {
        return value.refuse(format_args!(
            "is {length} bytes long, more than {MAX_FIELD_BYTES}"
        ));
    }
    if text.trim().is_empty() {
        value.fault(
            Fault::error(format!("`{}` is empty", value.path()))
                .hint("write something or leave the key out"),
        );
        return None;
    }
    Some(text)
}

/// A finite number in the range of its type.
pub(super) fn number(value: &Value<'_, '_>, kind: Kind) -> Option<f64> {
    let number = value.f64()?;
    if kind.admits(number) {
        return Some(number);
    }
    out_of_range(value, &kind.describe(), number)
}

/// An identifier.
pub(super) fn parsed<T: FromStr<Err = BadId>>(value: &Value<'_, '_>) -> Option<T> {
    let id = value.text()?.parse::<T>();
    if let Err(bad) = &id {
        value.fault(Fault::error(bad.to_string()));
    }
    id.ok()
}

fn out_of_range<T>(value: &Value<'_, '_>, expected: &str, number: impl Display) -> Option<T> {
    value.refuse(format_args!("has to be {expected}, not {number}"))
}

/// Which keys a section needs, as a hint.
fn needed(keys: &[Key]) -> String {
    let needed = keys.iter().filter(|key| key.absent == Absent::Error);
    let names: Vec<String> = needed.map(|key| format!("`{}`", key.name)).collect();
    format!("it needs {}", names.join(", "))
}
