//! Names of the data by which statistics are kept.

use super::identifiers::escaped;
use std::borrow::{Borrow, Cow};
use std::cmp::Ordering;

/// A name of the data by which records are kept.
pub trait Key: Ord {
    /// What stands for it in a reference.
    const PLACEHOLDER: &'static str;
    /// Its part of an identifier.
    fn part(&self) -> Cow<'_, str>;
}

/// Names of one kind, as keys.
macro_rules! names {
    ($($(#[doc = $doc:literal])+ $name:ident = $placeholder:literal,)*) => {$(
        $(#[doc = $doc])+
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
        pub struct $name(String);

        impl $name {
            /// The name as the data have it. Untrusted.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl From<&str> for $name {
            fn from(name: &str) -> Self {
                Self(name.to_owned())
            }
        }

        impl Borrow<str> for $name {
            fn borrow(&self) -> &str {
                &self.0
            }
        }

        impl Key for $name {
            const PLACEHOLDER: &'static str = $placeholder;

            fn part(&self) -> Cow<'_, str> {
                escaped(&self.0)
            }
        }
    )*};
}

names! {
    /// The name of a realization.
    RealizationName = "M",
    /// The name of a reference, anchor or physical sample.
    ReferenceName = "R",
    /// The name of a hidden duplicate.
    DuplicateName = "D",
    /// The name of a participant.
    ParticipantName = "S",
    /// The name of a covariate of realizations.
    CovariateName = "NAME",
    /// The name of a site.
    SiteName = "SITE",
    /// The name of a condition: a track or a session.
    ConditionName = "CONDITION",
    /// The name of a group of participants.
    GroupName = "GROUP",
    /// The name of a dimension or a parameter of a QUEST+ track.
    ParameterName = "PARAMETER",
    /// The name of an item of a questionnaire.
    ItemName = "NAME",
    /// A label by which something is identified.
    LabelName = "LABEL",
    /// A number of dimensions of a map.
    DimensionsName = "K",
    /// A set of properties of realizations.
    PropertyName = "PROPERTY",
    /// How many realizations have the same rank.
    TiedName = "N",
    /// The name of a measured outcome.
    OutcomeName = "OUTCOME",
    /// The name of an effect: its factors, joined by `:`.
    EffectName = "EFFECT",
}

/// Levels of some factors.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct LevelsName(pub Vec<(String, String)>);

/// A difference between two levels of a factor, where other factors have these levels.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ContrastName {
    /// The factor.
    pub factor: String,
    /// Its levels: the first minus the second.
    pub levels: [String; 2],
    /// Levels of other factors; over those that are not among them the mean is taken.
    pub at: LevelsName,
}

/// A level or a factor in an identifier: what separates them there is written `%3D` and `%40`, too.
fn separated(name: &str) -> String {
    let name = escaped(name).replace('=', "%3D");
    name.replace('@', "%40").replace(',', "%2C")
}

impl Key for LevelsName {
    const PLACEHOLDER: &'static str = "FACTOR=LEVEL";

    fn part(&self) -> Cow<'_, str> {
        let one = |(factor, level): &(String, String)| {
            format!("{}={}", separated(factor), separated(level))
        };
        let all: Vec<String> = self.0.iter().map(one).collect();
        all.join(",").into()
    }
}

impl Key for ContrastName {
    const PLACEHOLDER: &'static str = "FACTOR=a|b";

    fn part(&self) -> Cow<'_, str> {
        let [a, b] = &self.levels;
        let contrast = format!(
            "{}={}|{}",
            separated(&self.factor),
            separated(a),
            separated(b)
        );
        match self.at.0.is_empty() {
            true => contrast.into(),
            false => format!("{contrast}@{}", self.at.part()).into(),
        }
    }
}

/// Two realizations. The one whose name sorts first comes first.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct PairName {
    first: String,
    second: String,
}

impl PairName {
    /// The pair of two names, in either order.
    pub fn of(a: &str, b: &str) -> Self {
        Self {
            first: a.min(b).to_owned(),
            second: a.max(b).to_owned(),
        }
    }

    /// Both names, sorted.
    pub fn names(&self) -> [&str; 2] {
        [&self.first, &self.second]
    }
}

impl Key for PairName {
    const PLACEHOLDER: &'static str = "a|b";

    fn part(&self) -> Cow<'_, str> {
        format!("{}|{}", escaped(&self.first), escaped(&self.second)).into()
    }
}

/// A label that was right, and the one that was given.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ConfusionName {
    /// The label that was right.
    pub right: LabelName,
    /// The label that was given.
    pub given: LabelName,
}

impl ConfusionName {
    /// The cell of these labels.
    pub fn of(right: &str, given: &str) -> Self {
        Self {
            right: right.into(),
            given: given.into(),
        }
    }
}

impl Key for ConfusionName {
    const PLACEHOLDER: &'static str = "RIGHT/GIVEN";

    fn part(&self) -> Cow<'_, str> {
        format!("{}/{}", self.right.part(), self.given.part()).into()
    }
}

/// The number of a repetition.
impl Key for u32 {
    const PLACEHOLDER: &'static str = "R";

    fn part(&self) -> Cow<'_, str> {
        self.to_string().into()
    }
}

/// A participant in a condition.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct CellName {
    /// The participant.
    pub participant: ParticipantName,
    /// The condition.
    pub condition: ConditionName,
}

impl CellName {
    /// The cell of these names.
    pub fn of(participant: &str, condition: &str) -> Self {
        Self {
            participant: participant.into(),
            condition: condition.into(),
        }
    }
}

impl Key for CellName {
    const PLACEHOLDER: &'static str = "PARTICIPANT/CONDITION";

    fn part(&self) -> Cow<'_, str> {
        format!("{}/{}", self.participant.part(), self.condition.part()).into()
    }
}

/// A level, or a share of answers. In identifiers a level always has a decimal point: 1.0.
#[derive(Debug, Clone, Copy)]
pub struct At(pub f64);

impl PartialEq for At {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for At {}

impl PartialOrd for At {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for At {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Key for At {
    const PLACEHOLDER: &'static str = "X";

    fn part(&self) -> Cow<'_, str> {
        format!("{:?}", self.0).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_sort_by_size_and_have_a_decimal_point() {
        let mut levels = [10.0, 9.0, 0.5].map(At);
        levels.sort();
        let ids = levels.map(|at| at.part().into_owned());
        assert_eq!(ids, ["0.5", "9.0", "10.0"]);
    }
}
