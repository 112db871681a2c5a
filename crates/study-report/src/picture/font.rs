//! The bundled font: widths, kerning, outlines.

use miniz_oxide::inflate::decompress_to_vec_zlib;
use std::sync::LazyLock;
use study_base::text::Untrusted;
use ttf_parser::{Face, GlyphId, OutlineBuilder};
use unicode_width::UnicodeWidthChar as _;

/// Compressed, which makes the program 200 kB smaller.
const COMPRESSED: &[u8] = include_bytes!("../../assets/LiberationSans-Regular.ttf.zlib");

/// The file of the font.
pub(super) static DATA: LazyLock<Vec<u8>> = LazyLock::new(|| {
    #[expect(clippy::unwrap_used, reason = "the font is part of the program")]
    decompress_to_vec_zlib(COMPRESSED).unwrap()
});

/// The glyph of characters that the font lacks: a box.
const MISSING: GlyphId = GlyphId(0);

pub(super) static FACE: LazyLock<Face<'static>> = LazyLock::new(|| {
    #[expect(clippy::unwrap_used, reason = "the font is part of the program")]
    Face::parse(&DATA, 0).unwrap()
});

/// A letter of a text. Lengths are in units of the font.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Letter {
    pub(super) character: char,
    pub(super) glyph: GlyphId,
    /// Distance from the start of the text.
    pub(super) at: i32,
    pub(super) advance: u16,
}

impl Letter {
    pub(super) fn is_missing(&self) -> bool {
        self.glyph == MISSING
    }
}

/// Units of the font in the size of its letters.
pub(super) fn units() -> f64 {
    f64::from(FACE.units_per_em())
}

/// The letters of a text with kerning, and its width.
pub(super) fn letters(text: &str) -> (Vec<Letter>, i32) {
    let face = &*FACE;
    let mut letters: Vec<Letter> = Vec::with_capacity(text.len());
    let mut at = 0;
    for character in text.chars() {
        let glyph = face.glyph_index(character).unwrap_or(MISSING);
        if glyph == MISSING && character.width().unwrap_or(0) == 0 {
            continue;
        }
        if let Some(before) = letters.last() {
            at += i32::from(kerning(before.glyph, glyph));
        }
        let advance = face.glyph_hor_advance(glyph).unwrap_or(0);
        letters.push(Letter {
            character,
            glyph,
            at,
            advance,
        });
        at += i32::from(advance);
    }
    (letters, at)
}

fn kerning(left: GlyphId, right: GlyphId) -> i16 {
    let tables = FACE.tables().kern.into_iter().flat_map(|k| k.subtables);
    tables
        .filter(|t| t.horizontal && !t.variable)
        .find_map(|t| t.glyphs_kerning(left, right))
        .unwrap_or(0)
}

/// Width of a text, px. Characters that the font lacks count as the reader's fonts may
/// have them.
pub fn text_width(text: &str, size: f64) -> f64 {
    let shown = Untrusted(text).to_string();
    let (letters, width) = letters(&shown);
    let wider = letters.iter().filter(|l| l.is_missing()).map(|l| {
        let cells = l.character.width().unwrap_or(1) as f64;
        (0.55 * cells * units() - f64::from(l.advance)).max(0.0)
    });
    (f64::from(width) + wider.sum::<f64>()) / units() * size
}

/// Draws the outlines of letters, in units of the font with y upwards.
pub(super) fn outline(letters: &[Letter], into: &mut dyn OutlineBuilder) {
    for letter in letters {
        let mut moved = Moved {
            by: letter.at as f32,
            into,
        };
        FACE.outline_glyph(letter.glyph, &mut moved);
    }
}

/// Outlines moved to the right.
struct Moved<'a> {
    by: f32,
    into: &'a mut dyn OutlineBuilder,
}

impl OutlineBuilder for Moved<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.into.move_to(x + self.by, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.into.line_to(x + self.by, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.into.quad_to(x1 + self.by, y1, x + self.by, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.into
            .curve_to(x1 + self.by, y1, x2 + self.by, y2, x + self.by, y);
    }

    fn close(&mut self) {
        self.into.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_letter_of_the_figures() {
        for c in "AZaz09λχ²−±·–“”…→≥≤×µ°éüßØŁЖ".chars() {
            assert!(!letters(&c.to_string()).0[0].is_missing(), "{c}");
        }
    }

    /// Version 2.1.5 as it was released, of 410,712 bytes.
    #[test]
    fn the_font_is_that_of_the_release() {
        let sum = "8d91388f1d3604b3b8ae0e3ee2d140e50cd6122f9214514f4aca772540a4076d";
        assert_eq!(study_base::hex::sha256(&*DATA), sum);
    }

    #[test]
    fn letters_are_kerned() {
        // A V in Liberation Sans: 1366 units each, 152 closer.
        assert_eq!(letters("A").1, 1366);
        assert!(letters("AV").1 < 2 * 1366, "{}", letters("AV").1);
    }

    #[test]
    fn a_character_that_the_font_lacks_is_a_box_as_wide_as_its_own_letter() {
        let (boxes, _) = letters("山田");
        assert!(boxes.iter().all(Letter::is_missing) && boxes.len() == 2);
        assert!(text_width("山田", 10.0) >= 20.0);
        // A combining accent that it lacks takes no room.
        assert_eq!(letters("a\u{1ab0}").0.len(), 1);
    }
}
