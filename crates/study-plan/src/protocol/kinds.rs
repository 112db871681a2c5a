//! The kinds of question, one file each.
//!
//! A kind is a struct with its keys in a protocol file, which implements [`Kind`] and
//! `Declared` and is listed in `kinds!`. From its [`Scale`] follows all that analyses,
//! exports and reports do with its answers, from its [`Control`] how terminal, lines and page
//! ask for them.

use super::answer::{Answer, Refusal};
use super::control::Control;
use super::keys::{Key, Shape};
use super::scale::Scale;
use super::section::{Section, Variant, shapes};
use serde::Serialize;
use serde_json::Value;
use std::fmt::{Debug, Display};
use std::ops::{Deref, DerefMut};
use study_base::diagnostic::Fault;

/// What a kind of question does with its answers.
pub trait Kind: Debug {
    /// Checks an answer that is not declined.
    ///
    /// # Errors
    /// [`Refusal`] if the answer is not accepted.
    fn accepts(&self, answer: &Answer, required: bool) -> Result<(), Refusal>;

    /// On which scale its answers lie.
    fn scale(&self) -> Scale<'_>;

    /// How it is answered.
    fn control(&self) -> Control<'_>;

    /// Its texts that a person reads, such as labels, to say them in other words.
    fn texts_mut(&mut self) -> Vec<&mut String>;

    /// What of it determines the answers, for the fingerprint of the stimulus.
    fn stimulus(&self) -> Value;

    /// An answer of a simulated participant, which the question accepts.
    fn simulate(&self, draws: &mut dyn Draws) -> Answer;

    /// Time for an answer, s: choosing or typing.
    fn seconds(&self, required: bool) -> f64 {
        match self.control() {
            Control::Boxes { .. } | Control::Track { .. } | Control::List { .. } => 6.0,
            Control::Digits { .. } | Control::Text if required => 15.0,
            Control::Digits { .. } | Control::Text => 8.0,
        }
    }
}

/// What decides the answers of a simulated participant.
pub trait Draws {
    /// The position of what is judged on a scale, from 0 to 1.
    fn position(&mut self) -> f64;

    /// A number from 0 to 1.
    fn unit(&mut self) -> f64;

    /// An index below `count`, or 0.
    fn pick(&mut self, count: usize) -> usize;

    /// A comment; empty if there is nothing to say and no answer is required.
    fn comment(&mut self) -> String;
}

/// How a kind is written in a protocol file.
pub(super) trait Declared: Kind + Sized + 'static {
    /// The value of `kind`.
    const WORD: &'static str;
    /// What it is, in a sentence.
    const MEANING: &'static str;
    /// Its keys besides those of every question.
    const KEYS: &'static [Key];

    /// Reads these keys.
    fn read(section: &mut Section<'_, '_>) -> Option<Self>;

    /// Questions of this kind that are asked or answered in different ways.
    fn examples() -> Vec<Self>;
}

/// A kind of question in [`KINDS`].
#[derive(Debug)]
pub struct Known {
    /// The value of `kind` in a protocol file.
    pub word: &'static str,
    /// Questions of this kind that are asked or answered in different ways.
    pub examples: fn() -> Vec<QuestionKind>,
}

/// Declares the kinds from their files.
macro_rules! kinds {
    ($($(#[$doc:meta])+ $file:ident::$kind:ident,)+) => {
        $(mod $file;)+
        $(pub use $file::$kind;)+

        /// The kind of a question, which decides what its answers are.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(tag = "kind", rename_all = "kebab-case")]
        pub enum QuestionKind {
            $($(#[$doc])+ $kind($kind),)+
        }

        impl Deref for QuestionKind {
            type Target = dyn Kind;

            fn deref(&self) -> &Self::Target {
                match self { $(Self::$kind(kind) => kind,)+ }
            }
        }

        impl DerefMut for QuestionKind {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self { $(Self::$kind(kind) => kind,)+ }
            }
        }

        $(impl From<$kind> for QuestionKind {
            fn from(kind: $kind) -> Self {
                Self::$kind(kind)
            }
        })+

        /// All kinds of question.
        pub static KINDS: &[Known] = &[$(Known {
            word: $kind::WORD,
            examples: || $kind::examples().into_iter().map(QuestionKind::from).collect(),
        },)+];

        /// The reader of each kind.
        pub(super) const READERS: [Variant<QuestionKind>; [$($kind::WORD),+].len()] = [$(
            Variant::new($kind::WORD, $kind::MEANING, $kind::KEYS, |section| {
                $kind::read(section).map(QuestionKind::from)
            }),
        )+];
    };
}

kinds! {
    /// A whole number on a labeled scale.
    rating::Rating,
    /// A number on a continuous scale.
    slider::Slider,
    /// One or several of a list.
    choice::Choice,
    /// A number that is typed.
    number::Number,
    /// Free text.
    text::Text,
}

/// The keys of each kind.
pub(super) static SHAPES: [Shape; READERS.len()] = shapes(&READERS);

/// `Ok` if a condition holds.
fn accept_if(condition: bool, otherwise: Refusal) -> Result<(), Refusal> {
    condition.then_some(()).ok_or(otherwise)
}

/// Reports a scale that does not ascend.
fn ascending<T: PartialOrd + Display>(section: &Section<'_, '_>, from: T, to: T) -> Option<()> {
    if from < to {
        return Some(());
    }
    let wrong = match from > to {
        true => "reversed",
        false => "a single point",
    };
    section.fault_at(
        "from",
        Fault::error(format!(
            "the scale of `{}` is {wrong}: from {from} to {to}",
            section.path()
        ))
        .label("has to be below `to`"),
    );
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_stored_under_its_word_and_every_key_is_an_entry() {
        for (known, shape) in KINDS.iter().zip(&SHAPES) {
            assert_eq!(shape.word.word, known.word);
            for kind in (known.examples)() {
                let stored = serde_json::to_value(&kind).unwrap();
                assert_eq!(stored["kind"], known.word);
                for entry in stored.as_object().unwrap().keys() {
                    let declared = shape.keys.iter().any(|key| key.name == entry);
                    assert!(declared || entry == "kind", "{}: {entry}", known.word);
                }
            }
        }
    }

    #[test]
    fn words_that_are_read_do_not_change_the_stimulus_of_a_scale() {
        for known in KINDS {
            for mut kind in (known.examples)() {
                let before = kind.stimulus();
                let is_scale = kind.scale().ends().is_some();
                for text in kind.texts_mut() {
                    text.push('!');
                }
                assert!(!is_scale || kind.stimulus() == before, "{}", known.word);
            }
        }
    }
}
