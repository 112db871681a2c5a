//! Untrusted text and the identifiers that may stand in a path.
//!
//! Text from protocols, comments, devices and foreign files is data. It is
//! stored as typed; on its way to a terminal or a message it passes through
//! [`Untrusted`], whose `Display` escapes whatever could steer the terminal or
//! disguise what is written. Identifiers are checked once, at the door, and are
//! safe as part of a file name from then on.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Borrowed text whose `Display` is safe to print on one line: control, C1, line
/// separator, bidirectional formatting and zero-width characters come out as `\u{…}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Untrusted<'a>(pub &'a str);

impl fmt::Display for Untrusted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.0.contains(is_unsafe) {
            return f.pad(self.0);
        }
        let mut safe = String::with_capacity(self.0.len() + 16);
        for c in self.0.chars() {
            match c {
                '\n' => safe.push_str("\\n"),
                '\r' => safe.push_str("\\r"),
                '\t' => safe.push_str("\\t"),
                c if is_unsafe(c) => safe.push_str(&format!("\\u{{{:x}}}", u32::from(c))),
                c => safe.push(c),
            }
        }
        f.pad(&safe)
    }
}

/// "1 session", "2 sessions": a number with the word for what is counted.
pub fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Whether a character can steer a terminal or hide the order of what is read:
/// C0, DEL, C1, line and paragraph separators, bidirectional controls, tags, and
/// what has no width but for the joiners, which emoji and Indic scripts need.
pub fn is_unsafe(c: char) -> bool {
    matches!(c,
        '\u{0}'..='\u{1f}'
        | '\u{7f}'..='\u{9f}'
        | '\u{61c}'
        | '\u{200b}'
        | '\u{200e}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2060}'
        | '\u{2066}'..='\u{2069}'
        | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}'
        | '\u{e0000}'..='\u{e007f}')
}

/// Why a string is no identifier.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{}` is no {what}: use 1 to 32 of {allowed}", Untrusted(.given))]
pub struct BadId {
    /// What was given.
    pub given: String,
    what: &'static str,
    allowed: &'static str,
}

fn check_id(
    given: &str,
    what: &'static str,
    allowed: &'static str,
    extra: &[char],
) -> Result<(), BadId> {
    let good = (1..=32).contains(&given.len())
        && given
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || extra.contains(&c));
    if good {
        Ok(())
    } else {
        Err(BadId {
            given: given.to_owned(),
            what,
            allowed,
        })
    }
}

macro_rules! identifier {
    ($(#[$doc:meta])* $name:ident, $what:literal, $allowed:literal, $extra:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(String);

        impl $name {
            /// Checks a string.
            ///
            /// # Errors
            /// [`BadId`] if it is empty, too long or holds another character.
            pub fn new(given: impl Into<String>) -> Result<Self, BadId> {
                let given = given.into();
                check_id(&given, $what, $allowed, $extra)?;
                Ok(Self(given))
            }

            /// The identifier as text.
            pub fn as_str(&self) -> &str {
                &self.0
            }

            /// Whether two identifiers would collide on a file system that
            /// does not tell upper from lower case.
            pub fn collides_with(&self, other: &Self) -> bool {
                self.0.eq_ignore_ascii_case(&other.0)
            }
        }

        impl TryFrom<String> for $name {
            type Error = BadId;
            fn try_from(given: String) -> Result<Self, BadId> {
                Self::new(given)
            }
        }

        impl std::str::FromStr for $name {
            type Err = BadId;
            fn from_str(given: &str) -> Result<Self, BadId> {
                Self::new(given)
            }
        }

        impl From<$name> for String {
            fn from(id: $name) -> String {
                id.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(&self.0)
            }
        }
    };
}

identifier!(
    /// A participant's pseudonym: `[A-Za-z0-9_-]{1,32}`. Names a folder.
    ParticipantId, "participant id", "A-Z a-z 0-9 _ -", &['_', '-']
);
identifier!(
    /// A realization's id: `[A-Za-z0-9._-]{1,32}`. Names a file, with its ending.
    ModelId, "model id", "A-Z a-z 0-9 . _ -", &['.', '_', '-']
);
identifier!(
    /// A question's id: `[A-Za-z0-9_-]{1,32}`. Names a column.
    QuestionId, "question id", "A-Z a-z 0-9 _ -", &['_', '-']
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escape_sequences_never_reach_the_terminal() {
        let hostile = "a\u{1b}[2Jb\u{9b}c\u{202e}d\n=1";
        let shown = Untrusted(hostile).to_string();
        assert_eq!(shown, "a\\u{1b}[2Jb\\u{9b}c\\u{202e}d\\n=1");
    }

    #[test]
    fn ordinary_text_of_any_language_stays() {
        for text in ["leicht ruckelig", "よかった 👍🏽", "جيد جدا", "e\u{301}"] {
            assert_eq!(Untrusted(text).to_string(), text);
        }
    }

    #[test]
    fn names_that_look_alike_are_told_apart_and_joiners_stay() {
        assert_eq!(Untrusted("P\u{200b}1").to_string(), "P\\u{200b}1");
        assert_eq!(
            Untrusted("\u{feff}P\u{2060}1").to_string(),
            "\\u{feff}P\\u{2060}1"
        );
        for joined in ["👩\u{200d}🔬", "क्\u{200d}ष", "می\u{200c}خواهم"] {
            assert_eq!(Untrusted(joined).to_string(), joined);
        }
    }

    #[test]
    fn an_identifier_cannot_leave_its_folder() {
        for bad in [
            "",
            "../../x",
            "a/b",
            "a\\b",
            "ä",
            "a b",
            ".",
            "..",
            &"x".repeat(33),
        ] {
            assert!(ParticipantId::new(bad).is_err(), "{bad}");
        }
        assert!(ParticipantId::new("P01").is_ok());
        assert!(ModelId::new("lambda-0.9995").is_ok());
        assert!(ModelId::new("a/b").is_err());
    }

    #[test]
    fn the_message_says_what_is_allowed() {
        let message = ParticipantId::new("../../x").unwrap_err().to_string();
        assert_eq!(
            message,
            "`../../x` is no participant id: use 1 to 32 of A-Z a-z 0-9 _ -"
        );
    }
}
