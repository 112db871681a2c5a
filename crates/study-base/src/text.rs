//! Untrusted text and the identifiers that may stand in a path.
//!
//! Text from protocols, comments, devices and other programs' files is data. It is
//! stored as typed. Where it is printed, it passes through [`Untrusted`], whose
//! `Display` escapes every character that could control the terminal or disguise
//! the text. Identifiers are checked once, when they are read, and are then safe as
//! part of a file name.

use serde::{Deserialize, Serialize};
use std::fmt;
use unicode_segmentation::UnicodeSegmentation as _;
use unicode_width::UnicodeWidthStr as _;

/// Borrowed text whose `Display` is safe to print on one line: characters that
/// [`is_unsafe`] are printed as `\u{…}`, line breaks and tabs as `\n`, `\r`, `\t`.
///
/// ```
/// # use study_base::text::Untrusted;
/// assert_eq!(Untrusted("left\x1b[2J\nright").to_string(), "left\\u{1b}[2J\\nright");
/// ```
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

/// A number and the noun for it: "1 session", "2 sessions".
pub fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// The first `max` characters of a text; `…` marks a missing end.
pub fn beginning(text: &str, max: usize) -> String {
    let mut short: String = text.chars().take(max).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

/// With a capital first letter.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    format!("{}{}", first.unwrap_or_default(), letters.as_str())
}

/// With a capital first letter and a full stop.
pub fn sentence(text: &str) -> String {
    format!("{}.", capital(text))
}

/// The terminal columns of a text, grapheme by grapheme, as terminals count them.
fn columns_of(text: &str) -> usize {
    text.graphemes(true).map(|g| g.width()).sum()
}

/// The leading graphemes that fit into some terminal columns.
fn fitting<'t>(graphemes: impl Iterator<Item = &'t str>, columns: usize) -> Vec<&'t str> {
    let mut used = 0;
    let fits = |g: &&str| {
        used += g.width();
        used <= columns
    };
    graphemes.take_while(fits).collect()
}

/// A text of at most some terminal columns; `…` marks a missing end.
pub fn cut_end(text: &str, columns: usize) -> String {
    if columns_of(text) <= columns {
        return text.to_owned();
    }
    let Some(room) = columns.checked_sub(1) else {
        return String::new();
    };
    let kept = fitting(text.graphemes(true), room).concat();
    format!("{}…", kept.trim_end_matches([' ', '…']))
}

/// A text of at most some terminal columns; `…` after the first third marks a missing
/// middle. Names of realizations often start alike.
///
/// ```
/// # use study_base::text::cut_middle;
/// assert_eq!(cut_middle("turn-signal-play-0.5", 12), "tur…play-0.5");
/// ```
pub fn cut_middle(text: &str, columns: usize) -> String {
    if columns_of(text) <= columns {
        return text.to_owned();
    }
    let room = columns.saturating_sub(1);
    let start = fitting(text.graphemes(true), room / 3);
    let mut end = fitting(text.graphemes(true).rev(), room - room / 3);
    end.reverse();
    format!("{}…{}", start.concat(), end.concat())
}

/// A JSON document with every unsafe character of its strings as an escape: terminals
/// show a document, too. It stays the same document.
pub fn escaped_json(document: &str) -> String {
    let mut out = String::with_capacity(document.len());
    for c in document.chars() {
        // Line feeds are between the strings, where they are written as escapes.
        if c == '\n' || !is_unsafe(c) {
            out.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            out.push_str(&format!("\\u{unit:04x}"));
        }
    }
    out
}

/// A typed number with the digits and signs of ASCII: keyboards of other scripts have their
/// own. `٥` and `５` are 5, `٫` and `．` the decimal point; other characters stay.
pub fn ascii_number(c: char) -> char {
    let digit = |zero: char| (c as u32).checked_sub(zero as u32).filter(|n| *n < 10);
    // Arabic, Persian and full-width digits.
    if let Some(n) = ['٠', '۰', '０'].into_iter().find_map(digit) {
        return char::from_digit(n, 10).unwrap_or(c);
    }
    match c {
        '٫' | '．' => '.',
        '،' | '，' | '、' => ',',
        '−' | '－' => '-',
        c => c,
    }
}

/// Whether a character can control a terminal or disguise the text around it: C0,
/// DEL, C1, line and paragraph separators, bidirectional controls, interlinear
/// annotations, tags and invisible characters. The zero-width joiner and non-joiner
/// are safe: emoji and several scripts need them.
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

/// A string that is not an identifier.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{}` is not a {what}: use 1 to {most} of {allowed}", Untrusted(.given))]
pub struct BadId {
    /// The string.
    pub given: String,
    what: &'static str,
    most: usize,
    allowed: &'static str,
}

fn check_id(
    given: &str,
    what: &'static str,
    most: usize,
    allowed: &'static str,
    extra: &[char],
) -> Result<(), BadId> {
    let good = (1..=most).contains(&given.len())
        && given
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || extra.contains(&c));
    if good {
        Ok(())
    } else {
        Err(BadId {
            given: given.to_owned(),
            what,
            most,
            allowed,
        })
    }
}

macro_rules! identifier {
    ($(#[$doc:meta])* $name:ident, $what:literal, $most:literal, $allowed:literal, $extra:expr) => {
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
                check_id(&given, $what, $most, $allowed, $extra)?;
                Ok(Self(given))
            }

            /// The identifier as text.
            pub fn as_str(&self) -> &str {
                &self.0
            }

            /// Whether two identifiers are equal on a case-insensitive file
            /// system.
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
    ///
    /// ```
    /// # use study_base::text::ParticipantId;
    /// assert!(ParticipantId::new("P01").is_ok());
    /// assert!(ParticipantId::new("../P01").is_err());
    /// ```
    ParticipantId, "participant id", 32, "A-Z a-z 0-9 _ -", &['_', '-']
);
impl ParticipantId {
    /// Whether a command would take it for an option.
    pub fn is_like_option(&self) -> bool {
        self.0.starts_with('-')
    }

    /// Whether Windows takes it for a device, such as `CON` or `com1`, and not for the name of
    /// a folder.
    pub fn is_windows_device(&self) -> bool {
        let name = self.0.to_ascii_uppercase();
        match name
            .strip_prefix("COM")
            .or_else(|| name.strip_prefix("LPT"))
        {
            Some(number) => number.len() == 1 && number.as_bytes()[0].is_ascii_digit(),
            None => ["CON", "PRN", "AUX", "NUL"].contains(&name.as_str()),
        }
    }
}

identifier!(
    /// A realization's id: `[A-Za-z0-9._-]{1,32}`. Names a file, without its extension.
    ModelId, "model id", 32, "A-Z a-z 0-9 . _ -", &['.', '_', '-']
);
identifier!(
    /// A question's id: `[A-Za-z0-9_-]{1,32}`. Names a column.
    QuestionId, "question id", 32, "A-Z a-z 0-9 _ -", &['_', '-']
);
identifier!(
    /// The id of a part, family or track of a protocol: `[A-Za-z0-9_-]{1,20}`. The
    /// answer of a part is a question of this id, and the realizations of a family or
    /// track have it before a dot, which its length leaves room for.
    PartId, "part id", 20, "A-Z a-z 0-9 _ -", &['_', '-']
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_windows_devices_are_known() {
        let is_device = |id: &str| ParticipantId::new(id).unwrap().is_windows_device();
        for id in ["CON", "con", "nul", "Aux", "PRN", "COM0", "com9", "LPT1"] {
            assert!(is_device(id), "{id}");
        }
        for id in ["P01", "COM", "COM10", "COMX", "CONSENT", "NUL-1", "LPT"] {
            assert!(!is_device(id), "{id}");
        }
    }

    #[test]
    fn numbers_of_other_keyboards_are_read() {
        let read = |text: &str| text.chars().map(ascii_number).collect::<String>();
        assert_eq!(read("٠١٢٣٤٥٦٧٨٩"), "0123456789");
        assert_eq!(read("۰۱۲۳۴۵۶۷۸۹"), "0123456789");
        assert_eq!(read("０１２３４５６７８９"), "0123456789");
        assert_eq!(read("−１２．５ ٣٫٥ 1、2،3"), "-12.5 3.5 1,2,3");
        assert_eq!(read("五 x٪½"), "五 x٪½");
    }

    #[test]
    fn escape_sequences_do_not_reach_the_terminal() {
        let hostile = "a\u{1b}[2Jb\u{9b}c\u{202e}d\n=1";
        let shown = Untrusted(hostile).to_string();
        assert_eq!(shown, "a\\u{1b}[2Jb\\u{9b}c\\u{202e}d\\n=1");
    }

    #[test]
    fn sentences_begin_with_a_capital_letter() {
        assert_eq!(
            ["", "über uns", "χ", "7 a"].map(capital),
            ["", "Über uns", "Χ", "7 a"]
        );
        assert_eq!(sentence("ßa b"), "SSa b.");
    }

    #[test]
    fn shortened_text_fits_and_keeps_what_distinguishes_names() {
        assert_eq!(cut_middle("lambda-0.99995-dx-1", 13), "lamb…995-dx-1");
        assert_eq!(cut_middle("よかったね", 6), "…たね");
        assert_eq!(cut_end("よかった", 5), "よか…");
        assert_eq!(cut_end("two words", 5), "two…");
        for (columns, cut) in [(0, ""), (1, "…"), (3, "ab…"), (4, "abcd")] {
            assert_eq!(cut_end("abcd", columns), cut);
        }
        let begun = [1, 2, 3].map(|most| beginning("日本", most));
        assert_eq!(begun, ["日…", "日本", "日本"]);
    }

    #[test]
    fn every_unsafe_character_is_escaped() {
        // One range a line, with its first and last character.
        for (first, last) in [
            ('\u{0}', '\u{1f}'),
            ('\u{7f}', '\u{9f}'),
            ('\u{61c}', '\u{61c}'), // Arabic letter mark
            ('\u{200b}', '\u{200b}'),
            ('\u{200e}', '\u{200f}'), // left-to-right and right-to-left marks
            ('\u{2028}', '\u{202e}'), // separators, embeddings and overrides
            ('\u{2060}', '\u{2060}'),
            ('\u{2066}', '\u{2069}'), // isolates
            ('\u{feff}', '\u{feff}'),
            ('\u{fff9}', '\u{fffb}'),   // interlinear annotation
            ('\u{e0000}', '\u{e007f}'), // tags
        ] {
            for c in first..=last {
                let code = format!("\\u{{{:x}}}", u32::from(c));
                let shown = Untrusted(&format!("a{c}b")).to_string();
                let short = matches!(c, '\n' | '\r' | '\t').then(|| format!("{c:?}"));
                let expected = short.map_or(code, |quoted| quoted.trim_matches('\'').to_owned());
                assert_eq!(shown, format!("a{expected}b"));
            }
        }
    }

    #[test]
    fn ordinary_text_of_any_language_stays() {
        for text in ["leicht ruckelig", "よかった 👍🏽", "جيد جدا", "e\u{301}"] {
            assert_eq!(Untrusted(text).to_string(), text);
        }
    }

    #[test]
    fn zero_width_characters_are_escaped_and_joiners_are_not() {
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
        assert!(PartId::new("x".repeat(20)).is_ok());
        assert!(PartId::new("x".repeat(21)).is_err());
    }

    #[test]
    fn the_error_says_which_characters_are_allowed() {
        let message = ParticipantId::new("../../x").unwrap_err().to_string();
        assert_eq!(
            message,
            "`../../x` is not a participant id: use 1 to 32 of A-Z a-z 0-9 _ -"
        );
    }
}
