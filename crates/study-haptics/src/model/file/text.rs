//! Lines of TOML.

use std::fmt::Write as _;

/// Numbers of a list per line.
const PER_LINE: usize = 6;

/// The lines of a file.
#[derive(Default)]
pub(super) struct Text(String);

impl From<Text> for String {
    fn from(text: Text) -> Self {
        text.0
    }
}

impl Text {
    pub(super) fn raw(&mut self, key: &str, value: &str) {
        // writing to a String cannot fail
        let _ = writeln!(self.0, "{key} = {value}");
    }

    pub(super) fn text(&mut self, key: &str, value: &str) {
        self.raw(key, &quoted(value));
    }

    pub(super) fn number(&mut self, key: &str, value: f64) {
        // {:?} gives the fewest digits that read back, and a point or an exponent
        self.raw(key, &format!("{value:?}"));
    }

    pub(super) fn list(&mut self, key: &str, values: &[f64]) {
        let lines: Vec<String> = values
            .chunks(PER_LINE)
            .map(|line| {
                let numbers: Vec<String> = line.iter().map(|v| format!("{v:?}")).collect();
                format!("  {},\n", numbers.join(", "))
            })
            .collect();
        self.raw(key, &format!("[\n{}]", lines.concat()));
    }

    /// A list of whole numbers in each line.
    pub(super) fn rows(&mut self, key: &str, rows: &[Vec<u32>]) {
        let lines = rows.iter().map(|row| format!("  {row:?},\n"));
        self.raw(key, &format!("[\n{}]", lines.collect::<String>()));
    }

    pub(super) fn table(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n[{name}]");
    }
}

/// A basic TOML string, with invisible and control characters escaped.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            c if study_base::text::is_unsafe(c) => {
                let _ = write!(out, "\\U{:08X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A key, bare if TOML allows it.
pub(super) fn bare(name: &str) -> String {
    let bare = !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if bare { name.to_owned() } else { quoted(name) }
}
