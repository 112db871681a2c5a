//! Writing of SVG elements, one per line.

use super::look::Colour;
use super::{Anchor, FONT_FAMILY};
use study_base::text::Untrusted;

/// An SVG document under construction.
#[derive(Debug)]
pub(super) struct Out {
    id: String,
    ids: usize,
    text: String,
}

/// Escapes a text for an element or a quoted attribute.
pub(super) fn escape(text: &str) -> String {
    let shown = Untrusted(text).to_string();
    let mut safe = String::with_capacity(shown.len() + 16);
    for c in shown.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Not characters of XML 1.0.
            '\u{fffe}' | '\u{ffff}' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// A length in px with at most two decimals.
pub(super) fn px(x: f64) -> String {
    let shown = format!("{x:.2}");
    let shown = shown.trim_end_matches('0').trim_end_matches('.');
    if shown == "-0" {
        "0".to_owned()
    } else {
        shown.to_owned()
    }
}

impl Out {
    /// An empty document. `id` is the prefix of all ids; characters other than letters,
    /// digits and `-` are removed.
    pub(super) fn new(id: &str) -> Self {
        let id = id
            .chars()
            .filter(|c| c.is_ascii_alphanumeric() || *c == '-');
        Self {
            id: id.collect(),
            ids: 0,
            text: String::new(),
        }
    }

    /// Writes the root element, title and background.
    pub(super) fn open(&mut self, title: &str, width: f64, height: f64) {
        let (w, h) = (px(width), px(height));
        let id = format!("{}-title", self.id);
        self.line(&format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" \
             viewBox=\"0 0 {w} {h}\" role=\"img\" aria-labelledby=\"{id}\" \
             font-family=\"{FONT_FAMILY}\">"
        ));
        self.line(&format!("<title id=\"{id}\">{}</title>", escape(title)));
        self.line(&format!(
            "<rect width=\"{w}\" height=\"{h}\" fill=\"{}\"/>",
            Colour::WHITE.hex()
        ));
    }

    /// The finished document.
    pub(super) fn close(mut self) -> String {
        self.line("</svg>");
        self.text
    }

    /// Adds a line, which must be escaped.
    pub(super) fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// A new unique id.
    pub(super) fn fresh_id(&mut self) -> String {
        self.ids += 1;
        format!("{}-{}", self.id, self.ids)
    }

    /// Adds a straight line.
    pub(super) fn segment(&mut self, a: (f64, f64), b: (f64, f64), colour: Colour, width: f64) {
        self.line(&format!(
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"{}\" stroke-width=\"{}\"/>",
            px(a.0),
            px(a.1),
            px(b.0),
            px(b.1),
            colour.hex(),
            px(width)
        ));
    }

    /// Adds a text on a base line.
    pub(super) fn text(
        &mut self,
        at: (f64, f64),
        text: &str,
        size: f64,
        style: (Anchor, Colour),
        how: Setting,
    ) {
        let anchor = match style.0 {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y) = (px(at.0), px(at.1));
        let more = match how {
            Setting::Plain => String::new(),
            Setting::Bold => " font-weight=\"bold\"".to_owned(),
            Setting::Turned => format!(" transform=\"rotate(-90 {x} {y})\""),
            Setting::Slanted(by) => format!(" transform=\"rotate(-{by} {x} {y})\""),
            // A white outline keeps it readable over lines.
            Setting::Rimmed => {
                " stroke=\"#ffffff\" stroke-width=\"3\" paint-order=\"stroke\"".to_owned()
            }
        };
        self.line(&format!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" fill=\"{}\"{more}>{}</text>",
            px(size),
            style.1.hex(),
            escape(text)
        ));
    }
}

/// Typesetting of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Setting {
    Plain,
    Bold,
    /// Rotated to read upwards.
    Turned,
    /// Rotated upwards, degrees.
    Slanted(u8),
    Rimmed,
}
