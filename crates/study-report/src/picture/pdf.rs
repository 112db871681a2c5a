//! Pictures as PDF of one page. Texts can be selected and searched: the letters used are
//! embedded as a font. A text with a character that the font lacks carries its own words.

use super::font::{DATA, FACE, Letter, letters, outline, units};
use super::{BOLD, Color, Item, POINTS, Path, Picture, RIM, Step, Text};
use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, TextRenderingMode, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::{BTreeMap, BTreeSet};
use subsetter::GlyphRemapper;
use ttf_parser::OutlineBuilder;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFO: Ref = Ref::new(5);
const FONT: Ref = Ref::new(6);
const CID_FONT: Ref = Ref::new(7);
const DESCRIPTOR: Ref = Ref::new(8);
const FONT_FILE: Ref = Ref::new(9);
const CMAP: Ref = Ref::new(10);
/// The graphics state of opacity 0; the others follow, by per cent.
const STATES: i32 = 11;

/// Name of the font in the page's resources.
const FONT_NAME: Name<'static> = Name(b"F");

const SYSTEM: SystemInfo<'static> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};

/// Level of compression: higher ones save little.
const LEVEL: u8 = 6;

pub(super) fn pdf(picture: &Picture) -> Vec<u8> {
    let mut page = Page {
        content: Content::new(),
        glyphs: GlyphRemapper::new(),
        used: BTreeMap::new(),
        opacities: BTreeSet::new(),
    };
    let (width, height) = (picture.width * POINTS, picture.height * POINTS);
    let k = POINTS as f32;
    page.content
        .transform([k, 0.0, 0.0, -k, 0.0, height as f32]);
    for item in &picture.items {
        match item {
            Item::Path(p) => page.path(p),
            Item::Text(t) => page.text(t),
            Item::Clip(to) => {
                let [left, top, right, bottom] = to.map(|v| v as f32);
                page.content
                    .save_state()
                    .rect(left, top, right - left, bottom - top)
                    .clip_nonzero()
                    .end_path();
            }
            Item::Unclip => _ = page.content.restore_state(),
        }
    }
    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    let mut sheet = pdf.page(PAGE);
    sheet
        .parent(PAGES)
        .media_box(Rect::new(0.0, 0.0, width as f32, height as f32))
        .contents(CONTENT);
    let mut resources = sheet.resources();
    if !page.used.is_empty() {
        resources.fonts().pair(FONT_NAME, FONT);
    }
    let mut states = resources.ext_g_states();
    for percent in &page.opacities {
        states.pair(Name(state(*percent).as_bytes()), state_id(*percent));
    }
    states.finish();
    resources.finish();
    sheet.finish();
    for percent in &page.opacities {
        let share = f32::from(*percent) / 100.0;
        pdf.ext_graphics(state_id(*percent))
            .stroking_alpha(share)
            .non_stroking_alpha(share);
    }
    let drawn = compress_to_vec_zlib(&page.content.finish(), LEVEL);
    pdf.stream(CONTENT, &drawn).filter(Filter::FlateDecode);
    if !page.used.is_empty() {
        embed(&mut pdf, &page.glyphs, &page.used);
    }
    let mut info = pdf.document_info(INFO);
    info.title(TextStr(&picture.title));
    if let Some(note) = &picture.note {
        info.subject(TextStr(note));
    }
    info.producer(TextStr(concat!("study ", env!("CARGO_PKG_VERSION"))));
    info.finish();
    pdf.finish()
}

/// Name of the graphics state of an opacity.
fn state(percent: u8) -> String {
    format!("A{percent}")
}

fn state_id(percent: u8) -> Ref {
    Ref::new(STATES + i32::from(percent))
}

fn rgb(color: Color) -> [f32; 3] {
    [color.0, color.1, color.2].map(|c| f32::from(c) / 255.0)
}

/// The content of the page and what it needs.
struct Page {
    content: Content,
    glyphs: GlyphRemapper,
    /// Letters by glyph of the embedded font.
    used: BTreeMap<u16, Letter>,
    /// Opacities below 1, per cent.
    opacities: BTreeSet<u8>,
}

impl Page {
    fn path(&mut self, path: &Path) {
        // Between 0 and 100, so the cast is exact.
        let percent = (path.opacity.clamp(0.0, 1.0) * 100.0).round() as u8;
        let content = &mut self.content;
        if percent < 100 {
            self.opacities.insert(percent);
            content.save_state();
            content.set_parameters(Name(state(percent).as_bytes()));
        }
        if let Some(color) = path.fill {
            let [r, g, b] = rgb(color);
            content.set_fill_rgb(r, g, b);
        }
        if let Some(pen) = path.pen {
            let [r, g, b] = rgb(pen.color);
            content.set_stroke_rgb(r, g, b);
            content.set_line_width(pen.width as f32);
            content.set_dash_pattern(pen.dash.iter().copied(), 0.0);
            let (cap, join) = match pen.round {
                true => (LineCapStyle::RoundCap, LineJoinStyle::RoundJoin),
                false => (LineCapStyle::ButtCap, LineJoinStyle::MiterJoin),
            };
            content.set_line_cap(cap).set_line_join(join);
        }
        for step in &path.steps {
            match *step {
                Step::Move((x, y)) => content.move_to(x as f32, y as f32),
                Step::Line((x, y)) => content.line_to(x as f32, y as f32),
                Step::Close => content.close_path(),
            };
        }
        match (path.fill, path.pen) {
            (Some(_), Some(_)) => content.fill_nonzero_and_stroke(),
            (Some(_), None) => content.fill_nonzero(),
            (None, Some(_)) => content.stroke(),
            (None, None) => content.end_path(),
        };
        if percent < 100 {
            content.restore_state();
        }
    }

    fn text(&mut self, t: &Text) {
        let (letters, width) = letters(&t.text);
        let (sine, cosine) = f64::from(t.angle).to_radians().sin_cos();
        let unit = t.size / units();
        let before = f64::from(width) * unit * t.anchor.share();
        let (x, y) = (t.at.0 - before * cosine, t.at.1 + before * sine);
        let (s, c) = (sine as f32, cosine as f32);
        // From text with y upwards to the page with y downwards.
        let place = [c, -s, -s, -c, x as f32, y as f32];
        if t.rim {
            self.rim(&letters, place, unit as f32);
        }
        let missing = letters.iter().any(Letter::is_missing);
        let content = &mut self.content;
        if missing {
            let mut span = content.begin_marked_content_with_properties(Name(b"Span"));
            span.properties().actual_text(TextStr(&t.text));
        }
        let [r, g, b] = rgb(t.color);
        content.begin_text().set_fill_rgb(r, g, b);
        content.set_font(FONT_NAME, t.size as f32);
        content.set_text_matrix(place);
        if t.bold {
            content.set_stroke_rgb(r, g, b);
            content.set_dash_pattern([], 0.0);
            content.set_line_width((t.size * BOLD) as f32);
            content.set_text_rendering_mode(TextRenderingMode::FillStroke);
        }
        let mut shown = content.show_positioned();
        let mut items = shown.items();
        let mut run: Vec<u8> = Vec::new();
        let mut at = 0;
        for letter in &letters {
            if letter.at != at {
                items.show(Str(&run));
                run.clear();
                // Thousandths of the size, to the left.
                items.adjust((f64::from(at - letter.at) / units() * 1000.0) as f32);
            }
            let glyph = self.glyphs.remap(letter.glyph.0);
            self.used.entry(glyph).or_insert(*letter);
            run.extend(glyph.to_be_bytes());
            at = letter.at + i32::from(letter.advance);
        }
        items.show(Str(&run));
        items.finish();
        shown.finish();
        if t.bold {
            content.set_text_rendering_mode(TextRenderingMode::Fill);
        }
        content.end_text();
        if missing {
            content.end_marked_content();
        }
    }

    /// A white outline around letters, as a path: as text it would be found twice.
    fn rim(&mut self, letters: &[Letter], place: [f32; 6], unit: f32) {
        let content = &mut self.content;
        content.save_state().transform(place);
        content.transform([unit, 0.0, 0.0, unit, 0.0, 0.0]);
        content.set_stroke_rgb(1.0, 1.0, 1.0);
        content.set_dash_pattern([], 0.0);
        content.set_line_width(RIM as f32 / unit);
        content.set_line_join(LineJoinStyle::RoundJoin);
        outline(
            letters,
            &mut Outline {
                content,
                at: (0.0, 0.0),
            },
        );
        content.stroke().restore_state();
    }
}

/// Outlines of letters as a path.
struct Outline<'a> {
    content: &'a mut Content,
    at: (f32, f32),
}

impl OutlineBuilder for Outline<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.content.move_to(x, y);
        self.at = (x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.content.line_to(x, y);
        self.at = (x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        // The cubic curve of the same shape.
        let two_thirds = |end: f32, control: f32| end + (control - end) * 2.0 / 3.0;
        let (x0, y0) = self.at;
        self.curve_to(
            two_thirds(x0, x1),
            two_thirds(y0, y1),
            two_thirds(x, x1),
            two_thirds(y, y1),
            x,
            y,
        );
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.content.cubic_to(x1, y1, x2, y2, x, y);
        self.at = (x, y);
    }

    fn close(&mut self) {
        self.content.close_path();
    }
}

/// Embeds the used letters of the font.
fn embed(pdf: &mut Pdf, glyphs: &GlyphRemapper, used: &BTreeMap<u16, Letter>) {
    #[expect(clippy::unwrap_used, reason = "the font is part of the program")]
    let subset = subsetter::subset(&DATA, 0, glyphs).unwrap();
    // A different name for a different set of letters, so that documents with several
    // figures do not confuse them.
    let mut tag = glyphs
        .remapped_gids()
        .fold(7u64, |h, g| h.wrapping_mul(0x100_0000_01b3) ^ u64::from(g));
    let mut name = String::new();
    for _ in 0..6 {
        name.push(char::from(b'A' + (tag % 26) as u8));
        tag /= 26;
    }
    name.push_str("+LiberationSans");
    let name = Name(name.as_bytes());
    pdf.type0_font(FONT)
        .base_font(name)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(CID_FONT)
        .to_unicode(CMAP);
    let per_mille = |units_: f64| (units_ / units() * 1000.0) as f32;
    let mut font = pdf.cid_font(CID_FONT);
    font.subtype(CidFontType::Type2)
        .base_font(name)
        .system_info(SYSTEM)
        .font_descriptor(DESCRIPTOR)
        .default_width(0.0)
        .cid_to_gid_map_predefined(Name(b"Identity"));
    let mut widths = font.widths();
    for (glyph, letter) in used {
        widths.same(*glyph, *glyph, per_mille(f64::from(letter.advance)));
    }
    widths.finish();
    font.finish();
    let face = &*FACE;
    let b = face.global_bounding_box();
    let side = |v: i16| per_mille(f64::from(v));
    pdf.font_descriptor(DESCRIPTOR)
        .name(name)
        .flags(FontFlags::SYMBOLIC)
        .bbox(Rect::new(
            side(b.x_min),
            side(b.y_min),
            side(b.x_max),
            side(b.y_max),
        ))
        .italic_angle(0.0)
        .ascent(side(face.ascender()))
        .descent(side(face.descender()))
        .cap_height(side(face.capital_height().unwrap_or(face.ascender())))
        .stem_v(80.0)
        .font_file2(FONT_FILE);
    let packed = compress_to_vec_zlib(&subset, LEVEL);
    pdf.stream(FONT_FILE, &packed)
        .filter(Filter::FlateDecode)
        // A font in memory is far smaller than 2 GB.
        .pair(Name(b"Length1"), subset.len() as i32);
    let mut cmap = UnicodeCmap::new(Name(b"Letters"), SYSTEM);
    for (glyph, letter) in used.iter().filter(|(_, l)| !l.is_missing()) {
        cmap.pair(*glyph, letter.character);
    }
    pdf.cmap(CMAP, &cmap.finish());
}
