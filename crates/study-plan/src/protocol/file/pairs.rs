//! `pairs` of a part, as they are read.

use crate::protocol::keys::Kind;
use crate::protocol::section::{Section, parsed};
use study_base::diagnostic::table::Value;
use study_base::text::{ModelId, Untrusted};

/// Which pairs are compared.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RawPairs {
    All,
    Adjacent,
    Versus(ModelId),
    List(Vec<[ModelId; 2]>),
}

/// Reads `pairs`; all, if the key is absent.
pub(super) fn which(section: &mut Section<'_, '_>) -> Option<RawPairs> {
    match section.value("pairs") {
        None => Some(RawPairs::All),
        Some(value) => read(&value),
    }
}

fn read(value: &Value<'_, '_>) -> Option<RawPairs> {
    let expected = Kind::Pairs.describe();
    let refuse = |given: &str| {
        let given = Untrusted(given);
        value.refuse(format_args!("has to be {expected}, not `{given}`"))
    };
    if value.is_array() {
        let list = value.array()?;
        if list.is_empty() {
            return value.refuse("is empty");
        }
        let mut pairs = Vec::new();
        for pair in list {
            let ids: Vec<ModelId> = (pair.array()?.iter()).filter_map(parsed).collect();
            match <[ModelId; 2]>::try_from(ids) {
                Ok(ids) if ids[0] != ids[1] => pairs.push(ids),
                _ => return pair.refuse("has to be two different ids of realizations"),
            }
        }
        return Some(RawPairs::List(pairs));
    }
    let text = value.text()?;
    match text.as_str() {
        "all" => Some(RawPairs::All),
        "adjacent" => Some(RawPairs::Adjacent),
        other => match other.strip_prefix("versus:").map(ModelId::new) {
            Some(Ok(id)) => Some(RawPairs::Versus(id)),
            _ => refuse(other),
        },
    }
}
