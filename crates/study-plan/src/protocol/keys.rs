//! How the keys of a protocol file are declared.
//!
//! Each section declares its keys once, as constants of [`Key`] beside the code
//! that reads them, in `protocol/file`. From the declarations come the checks of
//! the reader (unknown and missing keys, types, ranges, defaults), the JSON
//! Schema of [`super::schema`] and the reference in `docs/protocol.md`.

use std::ops::{Bound, RangeBounds as _};

/// A key of a section.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Its name in the file.
    pub name: &'static str,
    /// The type of its value, with its range.
    pub kind: Kind,
    /// Whether it can be left out.
    pub absent: Absent,
    /// A value in TOML, different from the default.
    pub example: &'static str,
    /// What the key does, in sentences.
    pub effect: &'static str,
}

/// What a key that is left out means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absent {
    /// It cannot be left out.
    Error,
    /// There is no such thing in the study.
    Nothing,
    /// It has this value, in TOML.
    Default(&'static str),
    /// Its value follows from other keys or files, in words.
    Derived(&'static str),
}

/// The type of a value.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// Text, not empty.
    Text,
    /// A list of texts, of at least so many.
    Texts(usize),
    /// An identifier.
    Id(Id),
    /// A list of ids of realizations.
    ModelIds,
    /// A list of identifiers.
    Ids(Id),
    /// A list of finite numbers, not empty.
    NumberList,
    /// Which pairs are compared: words, or a list of pairs of ids of realizations.
    Pairs,
    /// A file inside the folder of the protocol, with `/` between folders.
    Path,
    /// A whole number, at least and at most so large.
    Whole(i64, i64),
    /// A finite number in a range, and its unit, which may be empty.
    Number(NumberRange, &'static str),
    /// A list of whole numbers, each at least and at most so large.
    WholeList(i64, i64),
    /// `true` or `false`.
    Flag,
    /// One of a list of words.
    Word(&'static [Word]),
    /// One of a list of words, or a table with these keys.
    WordOrTable(&'static [Word], &'static [Key]),
    /// A table of texts by whole number.
    WholeLabels,
    /// A table of texts by number.
    NumberLabels,
    /// A table of numbers by name.
    Numbers,
    /// A table of texts by name.
    TextsByName,
    /// A table of sentences by the key of a [`Phrase`](super::phrases::Phrase).
    Sentences,
    /// A section.
    Table(&'static [Key]),
    /// An array of tables with the same keys.
    Tables(&'static [Key]),
    /// An array of tables whose keys depend on one of them.
    Variants(&'static Variants),
    /// A table whose keys depend on one of them.
    Variant(&'static Variants),
}

/// Tables whose keys depend on the value of one of them.
#[derive(Debug)]
pub struct Variants {
    /// The name of the key that decides. It cannot be left out.
    pub tag: &'static str,
    /// What that key is, in a few words.
    pub effect: &'static str,
    /// Keys that every table has.
    pub common: &'static [Key],
    /// The alternatives.
    pub shapes: &'static [Shape],
}

/// An alternative of [`Variants`].
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// The value of the key that decides, and what it means.
    pub word: Word,
    /// Further keys.
    pub keys: &'static [Key],
}

/// A word that a key can have as its value.
#[derive(Debug, Clone, Copy)]
pub struct Word {
    /// The word.
    pub word: &'static str,
    /// What it means, in a sentence.
    pub meaning: &'static str,
}

/// What an identifier identifies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Id {
    /// A study.
    Study,
    /// A realization.
    Model,
    /// A question.
    Question,
    /// A part, family or track.
    Part,
    /// A participant.
    Participant,
}

/// A range of numbers.
pub type NumberRange = (Bound<f64>, Bound<f64>);

impl Id {
    /// The regular expression of the identifier.
    pub fn pattern(self) -> &'static str {
        match self {
            Self::Study => "^[a-z0-9-]{1,64}$",
            Self::Model => "^[A-Za-z0-9._-]{1,32}$",
            Self::Question | Self::Participant => "^[A-Za-z0-9_-]{1,32}$",
            Self::Part => "^[A-Za-z0-9_-]{1,20}$",
        }
    }
}

impl Kind {
    /// A number of things, at least 1.
    pub const COUNT: Self = Self::Whole(1, u32::MAX as i64);
    /// Any whole number.
    pub const ANY_WHOLE: Self = Self::Whole(i64::MIN, i64::MAX);
    /// Any finite number.
    pub const ANY_NUMBER: Self = Self::Number((Bound::Unbounded, Bound::Unbounded), "");

    /// A number above 0.
    pub const fn positive(unit: &'static str) -> Self {
        Self::Number((Bound::Excluded(0.0), Bound::Unbounded), unit)
    }

    /// A number, 0 or more.
    pub const fn not_negative(unit: &'static str) -> Self {
        Self::Number((Bound::Included(0.0), Bound::Unbounded), unit)
    }

    /// Whether a number is in the range of the type, if it has one.
    pub(super) fn admits(self, number: f64) -> bool {
        match self {
            Self::Number(range, _) => number.is_finite() && range.contains(&number),
            _ => true,
        }
    }

    /// The type and its range in words, such as `a whole number from 1 to 10`.
    pub fn describe(self) -> String {
        let ids = "1 to 32 of `A-Z a-z 0-9";
        match self {
            Self::Text => "text".to_owned(),
            Self::Texts(0) => "a list of texts".to_owned(),
            Self::Texts(_) => "a list of texts, not empty".to_owned(),
            Self::Id(Id::Study) => "text: 1 to 64 of `a-z 0-9 -`".to_owned(),
            Self::Id(Id::Model) => format!("text: {ids} . _ -`"),
            Self::Id(Id::Question | Id::Participant) => format!("text: {ids} _ -`"),
            Self::Id(Id::Part) => "text: 1 to 20 of `A-Z a-z 0-9 _ -`".to_owned(),
            Self::ModelIds | Self::Ids(Id::Model) => "a list of ids of realizations".to_owned(),
            Self::Ids(_) => "a list of ids".to_owned(),
            Self::NumberList => "a list of numbers, not empty".to_owned(),
            Self::Pairs => {
                "`all`, `adjacent`, `versus:ID` or a list of pairs of ids of realizations"
                    .to_owned()
            }
            Self::Path => "a path inside the protocol's folder, with `/`".to_owned(),
            Self::Whole(i64::MIN, _) => "a whole number".to_owned(),
            Self::Whole(least, most) if most >= i64::from(u32::MAX) => {
                format!("a whole number, {least} or more")
            }
            Self::Whole(least, most) => format!("a whole number from {least} to {most}"),
            Self::Number(range, _) => match range {
                (Bound::Excluded(low), Bound::Excluded(high)) => {
                    format!("a number between {low} and {high}")
                }
                (Bound::Included(low), Bound::Excluded(high)) => {
                    format!("a number, at least {low} and below {high}")
                }
                (Bound::Excluded(low), _) => format!("a finite number above {low}"),
                (Bound::Included(low), _) => format!("a finite number, {low} or more"),
                (_, Bound::Included(high)) => format!("a finite number, at most {high}"),
                _ => "a finite number".to_owned(),
            },
            Self::WholeList(least, most) => {
                format!("a list of whole numbers from {least} to {most}")
            }
            Self::Flag => "`true` or `false`".to_owned(),
            Self::Word(words) => one_of(words),
            Self::WordOrTable(words, keys) => {
                let table: Vec<String> = (keys.iter())
                    .map(|key| format!("{} = {}", key.name, key.example))
                    .collect();
                format!("{}, or `{{ {} }}`", one_of(words), table.join(", "))
            }
            Self::WholeLabels => "a table of texts by whole number".to_owned(),
            Self::NumberLabels => "a table of texts by number".to_owned(),
            Self::Numbers => "a table of numbers by name".to_owned(),
            Self::TextsByName => "a table of texts by name".to_owned(),
            Self::Sentences => "a table of texts by the key of a sentence".to_owned(),
            Self::Table(_) | Self::Variant(_) => "a table".to_owned(),
            Self::Tables(_) | Self::Variants(_) => "tables".to_owned(),
        }
    }
}

/// "one of" the words, each in backticks.
pub(super) fn one_of(words: &[Word]) -> String {
    let quoted: Vec<String> = words.iter().map(|w| format!("`{}`", w.word)).collect();
    format!("one of {}", quoted.join(", "))
}

impl Word {
    /// A word and its meaning.
    pub const fn new(word: &'static str, meaning: &'static str) -> Self {
        let meaning = meaning.trim_ascii();
        Self { word, meaning }
    }
}

impl Key {
    /// A key that can be left out, without a default.
    pub const fn new(
        name: &'static str,
        kind: Kind,
        example: &'static str,
        effect: &'static str,
    ) -> Self {
        Self {
            name,
            kind,
            absent: Absent::Nothing,
            example,
            effect: effect.trim_ascii(),
        }
    }

    /// "such as", the key and its example.
    pub(super) fn such_as(&self) -> String {
        format!("such as {} = {}", self.name, self.example)
    }

    /// The same, but it cannot be left out.
    #[must_use]
    pub const fn required(mut self) -> Self {
        self.absent = Absent::Error;
        self
    }

    /// The same, with a default in TOML.
    #[must_use]
    pub const fn default(mut self, toml: &'static str) -> Self {
        self.absent = Absent::Default(toml);
        self
    }

    /// The same, with a value that follows from something else, in words.
    #[must_use]
    pub const fn derived(mut self, from: &'static str) -> Self {
        self.absent = Absent::Derived(from);
        self
    }
}

/// Declares keys, each as its effect, `name: type, example`, and what its absence
/// means, if it can be left out with a default or not at all.
macro_rules! keys {
    ($(
        $(#[doc = $effect:literal])+
        $name:literal: $kind:expr, $example:literal $(, $absent:ident $(($value:literal))?)?;
    )+) => {
        &[$(
            $crate::protocol::keys::Key::new($name, $kind, $example, concat!($($effect),+))
                $(.$absent($($value)?))?
        ),+]
    };
}
pub(super) use keys;

/// An enumeration whose values are words of the protocol file.
pub(super) trait Words: Clone + 'static {
    /// Each value with its word.
    const VALUES: &'static [(&'static str, Self)];
    /// Each word with its meaning.
    const WORDS: &'static [Word];
}

/// The word of a value.
pub(super) fn word<W: Words + PartialEq>(value: W) -> &'static str {
    let found = W::VALUES.iter().find(|v| v.1 == value);
    found.map_or("", |v| v.0)
}

/// Declares an enumeration whose values are words of the protocol file. The doc
/// comment of a value is its meaning in `docs/protocol.md`.
macro_rules! words {
    ($(#[$meta:meta])* $name:ident {
        $($(#[doc = $meaning:literal])+ $value:ident = $word:literal,)+
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $($(#[doc = $meaning])+ #[serde(rename = $word)] $value,)+
        }

        impl $name {
            /// The word in the protocol file.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$value => $word,)+
                }
            }
        }

        impl $crate::protocol::keys::Words for $name {
            const VALUES: &'static [(&'static str, Self)] = &[$(($word, Self::$value)),+];
            const WORDS: &'static [$crate::protocol::keys::Word] = &[$(
                $crate::protocol::keys::Word::new($word, concat!($($meaning),+))
            ),+];
        }
    };
}
pub(super) use words;
