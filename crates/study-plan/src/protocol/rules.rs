//! The exclusion rules that a protocol can state before the data, one file each.
//!
//! The reader of `[[analysis.exclude]]`, the JSON Schema and `docs/protocol.md` follow
//! from the declaration in the file of a rule. Ratings and the trials of parts are judged
//! by the same function, over the same view of them, [`Trials`].

mod constant_rater;
mod hidden_reference;
mod inconsistent;
mod strokes;
mod trials;
mod unverified_force;
mod wrong_force;

pub use trials::{Answers, Force, Given, Judgement, Realization, Trial, Trials};

use super::Protocol;
use super::keys::{Key, Shape, Word};
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// What the file of a rule declares.
pub(super) struct Declaration {
    shape: Shape,
    /// What the design has to have, or the rule excludes nobody.
    needs: Option<Need>,
}

/// Whether a design has something, and a sentence if not.
type Need = (fn(&Protocol) -> bool, &'static str);

impl Declaration {
    /// The name in a protocol file, what the rule excludes, and its parameters, which are
    /// numbers. The names are part of fingerprints and never change.
    const fn new(name: &'static str, meaning: &'static str, keys: &'static [Key]) -> Self {
        let word = Word::new(name, meaning);
        let shape = Shape { word, keys };
        Self { shape, needs: None }
    }

    /// The same; the rule excludes nobody unless `has` is true of the design, and
    /// `otherwise` says what is missing.
    const fn needs(mut self, has: fn(&Protocol) -> bool, otherwise: &'static str) -> Self {
        self.needs = Some((has, otherwise));
        self
    }
}

/// A rule as the reader of protocol files sees it.
pub(super) struct Readable {
    shape: &'static Shape,
    /// Reads the rule, given a reader of its parameters by name.
    pub(super) read: fn(Parameters<'_>) -> Option<Exclusion>,
}

/// Reads a parameter by its name.
type Parameters<'a> = &'a mut dyn FnMut(&'static str) -> Option<f64>;

impl AsRef<Shape> for Readable {
    fn as_ref(&self) -> &Shape {
        self.shape
    }
}

/// Declares [`Exclusion`]: each rule with its parameters and its module, which has its
/// `RULE`, `words` and `judge`.
macro_rules! rules {
    ($(
        $(#[doc = $doc:literal])+
        $rule:ident $(($($parameter:ident),+))? = $module:ident;
    )+) => {
        /// One of `[[analysis.exclude]]`: a rule with its parameters. CONTRIBUTING.md has
        /// the recipe of a new one.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Exclusion {
            $($(#[doc = $doc])+ $rule $(($(rules!(@type $parameter)),+))?,)+
        }

        /// All rules, in the order of `docs/protocol.md`.
        pub(super) static RULES: &[Readable] = &[$(Readable {
            shape: &$module::RULE.shape,
            read: |_parameter| Some(Exclusion::$rule $(($(_parameter(stringify!($parameter))?),+))?),
        }),+];

        /// Their declarations.
        pub(super) static SHAPES: &[Shape] = &[$($module::RULE.shape),+];

        impl Exclusion {
            fn declaration(self) -> &'static Declaration {
                match self {
                    $(Self::$rule { .. } => &$module::RULE,)+
                }
            }

            /// The names and values of its parameters.
            pub fn parameters(self) -> BTreeMap<&'static str, f64> {
                match self {
                    $(Self::$rule $(($($parameter),+))? => {
                        BTreeMap::from([$($((stringify!($parameter), $parameter)),+)?])
                    })+
                }
            }

            /// What it excludes, as a noun phrase.
            ///
            /// ```
            /// use study_plan::protocol::Exclusion;
            ///
            /// let rule = Exclusion::StrokesBelow(2.0);
            /// assert_eq!(rule.words(), "trials with fewer than 2 full strokes");
            /// assert_eq!(rule.to_string(), "strokes-below 2");
            /// ```
            pub fn words(self) -> String {
                match self {
                    $(Self::$rule $(($($parameter),+))? => $module::words($($($parameter),+)?),)+
                }
            }

            /// Which of the trials it excludes.
            ///
            /// # Errors
            /// Why it can judge none of them: then it excludes nothing.
            pub fn judge(self, trials: &Trials<'_>) -> Result<Judgement, &'static str> {
                match self {
                    $(Self::$rule $(($($parameter),+))? => {
                        $module::judge(trials, $($($parameter),+)?)
                    })+
                }
            }
        }
    };
    (@type $parameter:ident) => { f64 };
}

rules! {
    /// Participants with two or more primary ratings that are all equal.
    ConstantRater = constant_rater;
    /// Participants whose mean primary rating of the hidden references is below
    /// this.
    HiddenReferenceBelow(rating) = hidden_reference;
    /// Trials with fewer full strokes than this.
    StrokesBelow(strokes) = strokes;
    /// Participants whose mean distance between a realization and its hidden
    /// duplicate exceeds this, in points of the primary scale.
    Inconsistent(difference) = inconsistent;
    /// Trials whose force was not that of the table (`flag` or `fault`).
    WrongForce = wrong_force;
    /// Trials whose force was not shown to be that of the table (all but `ok`).
    UnverifiedForce = unverified_force;
}

impl Exclusion {
    /// The rule's name in a protocol file.
    pub fn name(self) -> &'static str {
        self.declaration().shape.word.word
    }

    /// Why it excludes nobody of a design, if that is so.
    pub(super) fn idle(self, protocol: &Protocol) -> Option<&'static str> {
        let (has, otherwise) = self.declaration().needs?;
        (!has(protocol)).then_some(otherwise)
    }
}

/// The rule and the values of its parameters, such as `strokes-below 2`.
impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        (self.parameters().values()).try_for_each(|value| write!(f, " {value}"))
    }
}

/// As `{"rule": …, "parameters": {…}}`; part of the analysis fingerprint.
impl Serialize for Exclusion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Exclusion", 2)?;
        out.serialize_field("rule", self.name())?;
        out.serialize_field("parameters", &self.parameters())?;
        out.end()
    }
}

#[cfg(test)]
mod tests;
