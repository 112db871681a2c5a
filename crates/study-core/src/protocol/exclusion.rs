//! The exclusion rules that a protocol can state before the data.

use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// One of `[[analysis.exclude]]`: a rule with its parameter. CONTRIBUTING.md has the
/// recipe of a new one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exclusion {
    /// Participants with two or more primary ratings that are all equal.
    ConstantRater,
    /// Participants whose mean primary rating of the hidden references is below
    /// this.
    HiddenReferenceBelow(f64),
    /// Trials with fewer full strokes than this.
    StrokesBelow(f64),
    /// Participants whose mean distance between a realization and its hidden
    /// duplicate exceeds this, in points of the primary scale.
    Inconsistent(f64),
    /// Trials whose force was not that of the table (`flag` or `fault`).
    WrongForce,
    /// Trials whose force was not shown to be that of the table (all but `ok`).
    UnverifiedForce,
}

impl Exclusion {
    /// The rule's name in a protocol file, and the name and value of its
    /// parameter. The names are part of the analysis fingerprint and never change.
    pub fn parts(self) -> (&'static str, Option<(&'static str, f64)>) {
        match self {
            Self::ConstantRater => ("constant-rater", None),
            Self::HiddenReferenceBelow(rating) => {
                ("hidden-reference-below", Some(("rating", rating)))
            }
            Self::StrokesBelow(strokes) => ("strokes-below", Some(("strokes", strokes))),
            Self::Inconsistent(difference) => ("inconsistent", Some(("difference", difference))),
            Self::WrongForce => ("wrong-force", None),
            Self::UnverifiedForce => ("unverified-force", None),
        }
    }
}

/// The rule and the value of its parameter, such as `strokes-below 2`.
impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parts() {
            (rule, None) => f.write_str(rule),
            (rule, Some((_, value))) => write!(f, "{rule} {value}"),
        }
    }
}

/// As `{"rule": …, "parameters": {…}}`; part of the analysis fingerprint.
impl Serialize for Exclusion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (rule, parameter) = self.parts();
        let mut out = serializer.serialize_struct("Exclusion", 2)?;
        out.serialize_field("rule", rule)?;
        out.serialize_field("parameters", &BTreeMap::from_iter(parameter))?;
        out.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Part of the fingerprints in results folders: do not change.
    #[test]
    fn the_serialized_form_never_changes() {
        let json = |rule: Exclusion| serde_json::to_string(&rule).unwrap();
        assert_eq!(
            json(Exclusion::ConstantRater),
            r#"{"rule":"constant-rater","parameters":{}}"#
        );
        assert_eq!(
            json(Exclusion::Inconsistent(1.5)),
            r#"{"rule":"inconsistent","parameters":{"difference":1.5}}"#
        );
        assert_eq!(
            json(Exclusion::WrongForce),
            r#"{"rule":"wrong-force","parameters":{}}"#
        );
        assert_eq!(
            json(Exclusion::UnverifiedForce),
            r#"{"rule":"unverified-force","parameters":{}}"#
        );
    }
}
