//! A strict reader of TOML that reports every fault rather than the first.
//!
//! ```
//! # use study_base::diagnostic::table::Document;
//! let document = Document::parse("[design]\nrepetitions = \"3\"\nsead = 1\n");
//! let mut root = document.root();
//! let mut design = root.table("design").expect("it is there");
//! assert_eq!(design.u32("repetitions"), None); // not a number
//! design.finish(); // an unknown key
//! assert_eq!(document.finish().faults.len(), 2);
//! ```
//!
//! The span of every value that is read is recorded under its path
//! (`models[2].vaf`), for later checks: see [`Document::span_of`].

use super::{Fault, Findings, did_you_mean};
use crate::text::Untrusted;
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Most syntax faults that are reported.
const MAX_SYNTAX_FAULTS: usize = 20;

/// A parsed TOML document and the faults found in it so far.
#[derive(Debug)]
pub struct Document<'t> {
    root: Spanned<DeTable<'t>>,
    notes: RefCell<Read>,
}

/// The result of reading: the faults and the span of each value.
#[derive(Debug, Default, Clone)]
pub struct Read {
    /// The faults, in the order in which they were found.
    pub faults: Vec<Fault>,
    /// Path of a value (`models[2].vaf`, `design`) → its bytes.
    pub spans: BTreeMap<String, Range<usize>>,
}

/// Reads a whole file; `path` is for messages. `None` if and only if the findings
/// contain an error.
pub fn parse<T>(
    path: &str,
    text: &str,
    read: impl FnOnce(Table<'_, '_>) -> Option<T>,
) -> (Option<T>, Findings) {
    let document = Document::parse(text);
    let value = read(document.root());
    let mut findings = Findings::new(path, text);
    findings.faults = document.finish().faults;
    findings.sort();
    (value.filter(|_| !findings.has_errors()), findings)
}

impl<'t> Document<'t> {
    /// Parses TOML; syntax errors become faults, and the rest is kept.
    pub fn parse(text: &'t str) -> Self {
        let (root, errors) = DeTable::parse_recoverable(text);
        let mut faults: Vec<Fault> = Vec::new();
        for error in &errors {
            let fault = Fault::error(error.message().trim().to_owned()).at(error.span());
            // One error can be reported again for each table that it leaves open.
            if faults
                .last()
                .is_none_or(|last| last.message != fault.message)
            {
                faults.push(fault);
            }
        }
        let more = faults.len().saturating_sub(MAX_SYNTAX_FAULTS);
        if more > 0 {
            faults.truncate(MAX_SYNTAX_FAULTS);
            faults.push(Fault::error(format!("and {more} more syntax errors")));
        }
        Self {
            root,
            notes: RefCell::new(Read {
                faults,
                spans: BTreeMap::new(),
            }),
        }
    }

    /// The document's top level.
    pub fn root(&self) -> Table<'_, 't> {
        Table {
            document: self,
            table: self.root.get_ref(),
            span: 0..0,
            path: String::new(),
            known: Vec::new(),
        }
    }

    /// Number of faults so far; directly after [`Document::parse`], that of syntax errors.
    pub fn fault_count(&self) -> usize {
        self.notes.borrow().faults.len()
    }

    /// Adds a fault.
    pub fn fault(&self, fault: Fault) {
        self.notes.borrow_mut().faults.push(fault);
    }

    /// The span of the value at a path, if it was read.
    pub fn span_of(&self, path: &str) -> Option<Range<usize>> {
        self.notes.borrow().spans.get(path).cloned()
    }

    /// All faults and spans.
    pub fn finish(self) -> Read {
        self.notes.into_inner()
    }
}

/// A table that is being read: read its keys, then [`Table::finish`].
#[derive(Debug)]
pub struct Table<'d, 't> {
    document: &'d Document<'t>,
    table: &'d DeTable<'t>,
    span: Range<usize>,
    path: String,
    known: Vec<Cow<'static, str>>,
}

/// A value with its span and path.
#[derive(Debug, Clone)]
pub struct Value<'d, 't> {
    document: &'d Document<'t>,
    value: &'d DeValue<'t>,
    span: Range<usize>,
    path: String,
}

impl<'d, 't> Table<'d, 't> {
    /// The table's path, as in `[design]`; empty at the top level.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The keys of the table with their spans, in the order of the file.
    pub fn keys(&self) -> Vec<(String, Range<usize>)> {
        let mut keys: Vec<_> = self
            .table
            .iter()
            .map(|(key, _)| (key.get_ref().to_string(), key.span()))
            .collect();
        keys.sort_by_key(|(_, span)| span.start);
        keys
    }

    /// The value of a key, if present. Marks the key as known.
    pub fn value(&mut self, key: &str) -> Option<Value<'d, 't>> {
        self.known.push(Cow::Owned(key.to_owned()));
        let value = self.table.get(key)?;
        let path = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        Some(Value::new(self.document, value, path))
    }

    /// The value of a required key; its absence is a fault.
    pub fn required(&mut self, key: &str) -> Option<Value<'d, 't>> {
        let value = self.value(key);
        if value.is_none() {
            let fault = Fault::error(self.missing_message(key));
            let place = Some(self.span.clone()).filter(|_| !self.path.is_empty());
            self.document.fault(fault.at(place));
        }
        value
    }

    /// Whether the rest of the file, such as `a plant file`, can be read as `format`. A
    /// newer format is refused by its number alone: its unknown keys are not mistakes.
    pub fn has_format(&mut self, format: &str, what: &str) -> bool {
        let value = self.required("format");
        let Some((given, value)) = value.and_then(|value| Some((value.text()?, value))) else {
            // most likely forgotten: report the faults of the rest as well
            return true;
        };
        if given == format {
            return true;
        }
        let newer = match (version(&given), version(format)) {
            (Some((theirs, n)), Some((ours, own))) => theirs == ours && n > own,
            _ => false,
        };
        let fault = Fault::error(format!("this is not a {format} file"));
        value.fault(if newer {
            fault
                .label("a newer format")
                .hint("it was written by a newer version of study, which can read it")
        } else {
            fault.hint(format!("{what} begins with format = \"{format}\""))
        });
        false
    }

    fn missing_message(&self, key: &str) -> String {
        if self.path.is_empty() {
            format!("the file has no `{key}`")
        } else {
            format!("[{}] has no `{key}`", self.path)
        }
    }

    /// A table inside this one.
    pub fn table(&mut self, key: &str) -> Option<Table<'d, 't>> {
        self.value(key)?.table()
    }

    /// Text. Here and below, a value of another type is a fault and `None`.
    pub fn text(&mut self, key: &str) -> Option<String> {
        self.value(key)?.text()
    }

    /// A number, whole or not.
    pub fn f64(&mut self, key: &str) -> Option<f64> {
        self.value(key)?.f64()
    }

    /// A whole number from 0 to 2³² − 1.
    pub fn u32(&mut self, key: &str) -> Option<u32> {
        self.value(key)?.u32()
    }

    /// An array of tables, `[[key]]`; empty if it is absent.
    pub fn tables(&mut self, key: &str) -> Vec<Table<'d, 't>> {
        self.value(key)
            .and_then(|v| v.array())
            .unwrap_or_default()
            .into_iter()
            .filter_map(|v| v.table())
            .collect()
    }

    /// One of a fixed set of words; another text is a fault that lists them.
    pub fn word<T: Copy>(&mut self, key: &str, words: &[(&'static str, T)]) -> Option<T> {
        self.value(key)?.word(words)
    }

    /// Adds a fault about the value of a key, or about the table if it is absent.
    pub fn fault_at(&self, key: &str, fault: Fault) {
        let span = self
            .table
            .get(key)
            .map_or_else(|| self.span.clone(), Spanned::span);
        self.document.fault(fault.at(span));
    }

    /// Reports every key that was never asked for.
    pub fn finish(self) {
        let known: Vec<&str> = self.known.iter().map(AsRef::as_ref).collect();
        for near in self.refuse_unknown(&known) {
            // The key is not missing but misspelt.
            let missing = self.missing_message(&near);
            let mut notes = self.document.notes.borrow_mut();
            notes.faults.retain(|f| f.message != missing);
        }
    }

    /// Reports every key that is not among the `known` ones; returns the known keys
    /// that the unknown ones are probably misspellings of.
    pub fn refuse_unknown(&self, known: &[&str]) -> Vec<String> {
        let place = if self.path.is_empty() {
            "at the top level".to_owned()
        } else {
            format!("in [{}]", self.path)
        };
        let mut misspelt = Vec::new();
        for (key, span) in self.keys() {
            if known.contains(&key.as_str()) {
                continue;
            }
            let fault = Fault::error(format!("unknown key `{}` {place}", Untrusted(&key))).at(span);
            self.document
                .fault(match did_you_mean(&key, known.iter().copied()) {
                    Some(near) => {
                        misspelt.push(near.to_owned());
                        fault.label(format!("did you mean `{near}`?"))
                    }
                    None => {
                        let mut known = known.to_vec();
                        known.sort_unstable();
                        known.dedup();
                        fault.hint(format!("known keys are {}", known.join(", ")))
                    }
                });
        }
        misspelt
    }
}

/// The name of a format and its version, such as `study-plant/1`.
fn version(format: &str) -> Option<(&str, u32)> {
    let (name, number) = format.split_once('/')?;
    Some((name, number.parse().ok()?))
}

impl<'d, 't> Value<'d, 't> {
    fn new(document: &'d Document<'t>, value: &'d Spanned<DeValue<'t>>, path: String) -> Self {
        document
            .notes
            .borrow_mut()
            .spans
            .insert(path.clone(), value.span());
        Self {
            document,
            value: value.get_ref(),
            span: value.span(),
            path,
        }
    }

    /// Its path, such as `models[2].vaf`.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Adds a fault about this value.
    pub fn fault(&self, fault: Fault) {
        self.document.fault(fault.at(self.span.clone()));
    }

    /// Adds a fault about this value: its path, then the problem. Always `None`, what a
    /// reader then has.
    pub fn refuse<T>(&self, problem: impl Display) -> Option<T> {
        self.fault(Fault::error(format!("`{}` {problem}", self.path)));
        None
    }

    fn mismatch<T>(&self, wanted: &str) -> Option<T> {
        let found = match self.value {
            DeValue::String(_) => "text",
            DeValue::Integer(_) if self.whole().is_none() => "one beyond 64 bits",
            DeValue::Integer(_) => "a whole number",
            // A number in place of a whole one says itself what is wrong with it.
            DeValue::Float(number) if wanted.starts_with("a whole number") => number.as_str(),
            DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.refuse(format_args!("has to be {wanted}, not {found}"))
    }

    /// Whether the value is a table.
    pub fn is_table(&self) -> bool {
        self.value.is_table()
    }

    /// Whether the value is a list.
    pub fn is_array(&self) -> bool {
        self.value.is_array()
    }

    /// The value as text.
    pub fn text(&self) -> Option<String> {
        let text = self.value.as_str().map(str::to_owned);
        text.or_else(|| self.mismatch("text in quotes"))
    }

    /// The value as a number, which can be NaN or infinite: both are legal TOML.
    pub fn f64(&self) -> Option<f64> {
        let number = match self.value {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(_) => self.whole().map(|n| n as f64),
            _ => None,
        };
        number.or_else(|| self.mismatch("a number"))
    }

    fn whole(&self) -> Option<i64> {
        match self.value {
            DeValue::Integer(n) => i64::from_str_radix(n.as_str(), n.radix()).ok(),
            _ => None,
        }
    }

    /// The value as a whole number.
    pub fn i64(&self) -> Option<i64> {
        self.whole().or_else(|| self.mismatch("a whole number"))
    }

    /// The value as a whole number from 0 to 2³² − 1.
    pub fn u32(&self) -> Option<u32> {
        let number = self.i64()?;
        let most = u32::MAX;
        let problem = format!("has to be from 0 to {most}, not {number}");
        u32::try_from(number).ok().or_else(|| self.refuse(problem))
    }

    /// The value as `true` or `false`.
    pub fn bool(&self) -> Option<bool> {
        let flag = self.value.as_bool();
        flag.or_else(|| self.mismatch("true or false"))
    }

    /// The value as a table.
    pub fn table(self) -> Option<Table<'d, 't>> {
        let Some(table) = self.value.as_table() else {
            return self.mismatch("a table");
        };
        Some(Table {
            document: self.document,
            table,
            span: self.span,
            path: self.path,
            known: Vec::new(),
        })
    }

    /// The value as a list.
    pub fn array(&self) -> Option<Vec<Value<'d, 't>>> {
        let Some(array) = self.value.as_array() else {
            return self.mismatch("a list");
        };
        let item = |(i, v)| Value::new(self.document, v, format!("{}[{i}]", self.path));
        Some(array.iter().enumerate().map(item).collect())
    }

    /// The value as one of a fixed set of words.
    pub fn word<T: Clone>(&self, words: &[(&'static str, T)]) -> Option<T> {
        let given = self.text()?;
        if let Some((_, value)) = words.iter().find(|(word, _)| *word == given) {
            return Some(value.clone());
        }
        let list: Vec<String> = words.iter().map(|(word, _)| format!("`{word}`")).collect();
        let mut fault = Fault::error(format!("`{}` cannot be `{}`", self.path, Untrusted(&given)));
        fault = match did_you_mean(&given, words.iter().map(|(word, _)| *word)) {
            Some(near) => fault.label(format!("did you mean `{near}`?")),
            None => fault.hint(format!("it is one of {}", list.join(", "))),
        };
        self.fault(fault);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_reported() {
        let text = "a = 1\nb = \"x\"\n[design]\nrepetition = 3\norder = \"blokked\"\nn = -1\n";
        let document = Document::parse(text);
        let mut root = document.root();
        assert_eq!(root.text("a"), None);
        assert_eq!(root.f64("c"), None);
        let mut design = root.table("design").unwrap();
        assert_eq!(design.u32("repetitions"), None);
        assert_eq!(
            design.word("order", &[("blocked", 1), ("shuffled", 2)]),
            None
        );
        assert_eq!(design.u32("n"), None);
        design.finish();
        root.finish();
        let read = document.finish();
        let messages: Vec<_> = read.faults.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(
            messages,
            [
                "`a` has to be text in quotes, not a whole number",
                "`design.order` cannot be `blokked`",
                "`design.n` has to be from 0 to 4294967295, not -1",
                "unknown key `repetition` in [design]",
                "unknown key `b` at the top level",
            ]
        );
        assert_eq!(
            read.faults[3].label.as_deref(),
            Some("did you mean `repetitions`?")
        );
        assert_eq!(&text[read.spans["design.order"].clone()], "\"blokked\"");
    }

    #[test]
    fn a_misspelt_key_and_a_flood_of_brackets_are_one_fault_each() {
        let document = Document::parse("[design]\nrepetition = 3\n");
        let mut root = document.root();
        let mut design = root.table("design").unwrap();
        assert!(design.required("repetitions").is_none());
        assert!(design.required("order").is_none());
        design.finish();
        root.finish();
        let messages: Vec<_> = document
            .finish()
            .faults
            .into_iter()
            .map(|f| f.message)
            .collect();
        assert_eq!(
            messages,
            [
                "[design] has no `order`",
                "unknown key `repetition` in [design]"
            ]
        );

        let flood = format!("a = {}", "[".repeat(100_000));
        assert!(Document::parse(&flood).finish().faults.len() <= MAX_SYNTAX_FAULTS + 1);
    }

    #[test]
    fn broken_syntax_is_a_fault_with_a_place() {
        let document = Document::parse("a = \nb = 2\n");
        assert_eq!(document.root().f64("b"), Some(2.0));
        let read = document.finish();
        assert!(!read.faults.is_empty());
        assert!(read.faults[0].span.is_some());
    }
}
