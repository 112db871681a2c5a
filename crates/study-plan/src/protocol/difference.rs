//! What differs between two versions of a protocol, key by key.

use super::fingerprint::Parts;
use serde_json::{Map, Value};
use std::ops::Range;

/// Longest value that is shown whole, in characters.
const LONGEST: usize = 60;

/// A key whose value differs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// The key, such as `design.repetitions` or `models[smooth].vaf`.
    pub key: String,
    /// The same with positions instead of ids, as [`super::file::Parsed::spans`] has it for the new
    /// version.
    place: String,
    /// The old value; `None` if there was none.
    pub old: Option<String>,
    /// The new value; `None` if there is none.
    pub new: Option<String>,
    /// Whether it is fixed once the study runs.
    pub fixed: bool,
}

impl Change {
    /// The bytes of the new version that it concerns: the value, or else the nearest
    /// table around it.
    pub fn span<'s>(
        &self,
        find: impl Fn(&str) -> Option<&'s Range<usize>>,
    ) -> Option<Range<usize>> {
        let mut place = self.place.as_str();
        loop {
            if let Some(span) = find(place) {
                return Some(span.clone());
            }
            place = &place[..place.rfind(['.', '['])?];
        }
    }
}

/// Everything that differs, first what is fixed while a study runs.
pub fn changes(old: &Parts, new: &Parts) -> Vec<Change> {
    let mut found = Vec::new();
    for (old, new, fixed) in [
        (&old.stimulus, &new.stimulus, true),
        (&old.wording, &new.wording, false),
        (&old.analysis, &new.analysis, false),
    ] {
        let at = At {
            key: String::new(),
            place: String::new(),
            fixed,
        };
        at.compare(Some(old), Some(new), &mut found);
    }
    found
}

/// The path of a value.
struct At {
    key: String,
    place: String,
    fixed: bool,
}

impl At {
    fn field(&self, name: &str) -> Self {
        let join = |path: &str| match (path, name) {
            // where the file has them
            ("", "reference") => "trial.reference".to_owned(),
            ("", "participants") => "design.participants".to_owned(),
            ("", "rendering") => "device.rendering".to_owned(),
            ("", "orders") => "design.order".to_owned(),
            ("", "media") => "models".to_owned(),
            ("", name) => name.to_owned(),
            (path, "sha256") => format!("{path}.file"),
            (path, name) => format!("{path}.{name}"),
        };
        Self {
            key: join(&self.key),
            place: join(&self.place),
            fixed: self.fixed,
        }
    }

    fn item(&self, id: &str, position: Option<usize>) -> Self {
        Self {
            key: format!("{}[{id}]", self.key),
            place: match position {
                Some(position) => format!("{}[{position}]", self.place),
                None => self.place.clone(),
            },
            fixed: self.fixed,
        }
    }

    fn compare(&self, old: Option<&Value>, new: Option<&Value>, found: &mut Vec<Change>) {
        match (old, new) {
            (old, new) if old == new => {}
            (Some(Value::Object(old)), Some(Value::Object(new))) => {
                let added = new.keys().filter(|name| !old.contains_key(*name));
                for name in old.keys().chain(added) {
                    self.field(name)
                        .compare(old.get(name), new.get(name), found);
                }
            }
            (Some(Value::Array(before)), Some(Value::Array(after)))
                if ids(before).is_some() && ids(after).is_some() =>
            {
                self.compare_by_id(before, after, found);
            }
            (old, new) => {
                let contents = [".file", ".picture", ".video", ".sound"];
                let is_file = contents.iter().any(|end| self.key.ends_with(*end));
                found.push(Change {
                    key: self.key.clone(),
                    place: self.place.clone(),
                    old: old.and_then(|v| shown(v, is_file)),
                    new: new.and_then(|v| shown(v, is_file)),
                    fixed: self.fixed,
                });
            }
        }
    }

    fn compare_by_id(&self, before: &[Value], after: &[Value], found: &mut Vec<Change>) {
        let (old, new) = (
            ids(before).unwrap_or_default(),
            ids(after).unwrap_or_default(),
        );
        let kept = |from: &[&str], other: &[&str]| -> Vec<String> {
            let kept = from.iter().filter(|id| other.contains(id));
            kept.map(|id| (*id).to_owned()).collect()
        };
        if kept(&old, &new) != kept(&new, &old) {
            let names = |ids: &[&str]| Some(shortened(&ids.join(", ")));
            found.push(Change {
                key: format!("order of {}", self.key),
                place: self.place.clone(),
                old: names(&old),
                new: names(&new),
                fixed: self.fixed,
            });
        }
        let find = |ids: &[&str], items, id| {
            let at = ids.iter().position(|other| *other == id)?;
            <[Value]>::get(items, at).map(|item| (at, item))
        };
        let added = new.iter().filter(|id| !old.contains(id));
        for id in old.iter().chain(added) {
            let (was, is) = (find(&old, before, *id), find(&new, after, *id));
            let at = self.item(id, is.map(|(at, _)| at));
            at.compare(was.map(|(_, v)| v), is.map(|(_, v)| v), found);
        }
    }
}

/// The ids of a list of tables; `None` if an item has none.
fn ids(items: &[Value]) -> Option<Vec<&str>> {
    items.iter().map(|item| item.get("id")?.as_str()).collect()
}

/// A value on one line; `None` for null. The content of a file is not shown.
fn shown(value: &Value, is_file: bool) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(_) if is_file => Some("its content".to_owned()),
        Value::Object(map) if map.contains_key("id") => Some(shortened(&of_table(map))),
        value => Some(shortened(&value.to_string())),
    }
}

/// The keys of a table that have a value.
fn of_table(map: &Map<String, Value>) -> String {
    let set: Map<String, Value> = map
        .iter()
        .filter(|(_, value)| !value.is_null())
        .map(|(name, value)| (name.clone(), value.clone()))
        .collect();
    Value::Object(set).to_string()
}

fn shortened(text: &str) -> String {
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::fingerprint::parts;
    use crate::protocol::{Consent, Debriefing, Order, Protocol, example};
    use std::collections::BTreeMap;

    fn changed(change: impl FnOnce(&mut Protocol)) -> Vec<String> {
        let old = example::protocol(3, 2);
        let mut new = old.clone();
        change(&mut new);
        let files = BTreeMap::new();
        let found = changes(&parts(&old, &files, None), &parts(&new, &files, None));
        let word = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
        let lines = found.into_iter().map(|c| {
            let fixed = if c.fixed { "fixed " } else { "" };
            format!(
                "{fixed}{} ({}): {} > {}",
                c.key,
                c.place,
                word(c.old),
                word(c.new)
            )
        });
        lines.collect()
    }

    #[test]
    fn every_change_is_named_with_both_values() {
        let id = |n: usize| example::protocol(3, 2).models[n].id.to_string();
        assert_eq!(changed(|_| {}), [""; 0]);
        assert_eq!(
            changed(|p| p.design.repetitions = 5),
            ["fixed design.repetitions (design.repetitions): 2 > 5"]
        );
        assert_eq!(
            changed(|p| p.design.order = Order::Shuffled),
            ["fixed design.order (design.order): \"blocked\" > \"shuffled\""]
        );
        let vaf = changed(|p| {
            p.models[1].vaf = Some(0.5);
            p.design.participants = 77;
        });
        let line = format!("models[{}].vaf (models[1].vaf): - > 0.5", id(1));
        assert!(vaf.len() == 2 && vaf.contains(&line), "{vaf:?}");
        // a realization that is gone, and two that changed places
        let gone = changed(|p| drop(p.models.remove(0)));
        assert!(
            gone[0].starts_with(&format!("fixed models[{}] (models): {{", id(0))),
            "{gone:?}"
        );
        assert!(gone[0].ends_with(" > -"), "{gone:?}");
        let swapped = changed(|p| p.models.swap(0, 2));
        assert!(
            swapped[0].starts_with("fixed order of models (models): "),
            "{swapped:?}"
        );
    }

    #[test]
    fn the_span_is_that_of_the_value_or_of_what_is_around_it() {
        let change = Change {
            key: "questions[a].kind.rating".to_owned(),
            place: "questions[0].kind.rating".to_owned(),
            old: None,
            new: None,
            fixed: true,
        };
        let (table, kind) = (3..9, 5..6);
        let find = |path: &str| match path {
            "questions[0].kind" => Some(&kind),
            "questions[0]" => Some(&table),
            _ => None,
        };
        assert_eq!(change.span(find), Some(5..6));
        assert_eq!(
            change.span(|p| (p == "questions[0]").then_some(&table)),
            Some(3..9)
        );
        assert_eq!(change.span(|_| None), None);
    }

    /// Moving the file changes nothing.
    #[test]
    fn of_a_consent_document_the_text_counts_and_not_its_place() {
        let document = |file: &str, text: &str| {
            let mut protocol = example::protocol(3, 2);
            protocol.consent = Some(Consent {
                document: "Information".to_owned(),
                version: "2".to_owned(),
                file: Some(file.to_owned()),
                text: Some(text.to_owned()),
                initials: false,
            });
            parts(&protocol, &BTreeMap::new(), None)
        };
        let here = document("consent.txt", "You turn a knob.");
        let moved = document("texts/consent.txt", "You turn a knob.");
        assert!(changes(&here, &moved).is_empty());
        let other = document("consent.txt", "You turn a wheel.");
        let found = changes(&here, &other);
        assert_eq!(found.len(), 1);
        assert!(!found[0].fixed);
        assert_eq!(found[0].key, "consent.text");
    }

    /// Nor does it matter whether the text is in the protocol or in a file.
    #[test]
    fn of_a_debriefing_the_text_counts_and_not_its_place() {
        let shown = |file: Option<&str>, text: &str| {
            let mut protocol = example::protocol(3, 2);
            protocol.debriefing = Some(Debriefing {
                file: file.map(str::to_owned),
                text: Some(text.to_owned()),
            });
            parts(&protocol, &BTreeMap::new(), None)
        };
        let here = shown(None, "It was about friction.");
        let moved = shown(Some("end.txt"), "It was about friction.");
        assert!(changes(&here, &moved).is_empty());
        let found = changes(&here, &shown(None, "It was about detents."));
        assert_eq!(found.len(), 1);
        assert!(!found[0].fixed);
        assert_eq!(found[0].key, "debriefing.text");
    }

    #[test]
    fn the_text_of_the_file_is_below_that_of_the_protocol() {
        let mut own = Debriefing {
            file: Some("end.txt".to_owned()),
            text: None,
        };
        own.add("From the file.");
        assert_eq!(own.text.as_deref(), Some("From the file."));
        own.add("And more.");
        assert_eq!(own.text.as_deref(), Some("From the file.\n\nAnd more."));
    }
}
