//! Pictures as SVG, one element per line.

use super::{Anchor, BOLD, Color, FONT_FAMILY, Item, POINTS, Path, Picture, RIM, Step, Text};
use std::fmt::Write as _;

/// Size of text that has none of its own, px.
const SIZE: f64 = 12.0;

pub(super) fn svg(picture: &Picture) -> String {
    let p = picture;
    let mut out = String::with_capacity(200 * p.items.len() + 400);
    let (w, h) = (px(p.width), px(p.height));
    let mm = |x: f64| px(x * POINTS * 25.4 / 72.0);
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}mm\" height=\"{}mm\" \
         viewBox=\"0 0 {w} {h}\" role=\"img\" aria-labelledby=\"{id}-title\" \
         font-family=\"{FONT_FAMILY}\" font-size=\"{}\" fill=\"{}\">\n\
         <title id=\"{id}-title\">{}</title>",
        mm(p.width),
        mm(p.height),
        px(SIZE),
        Color::INK.hex(),
        escape(&p.title),
        id = p.id,
    );
    if let Some(note) = &p.note {
        let _ = writeln!(out, "<desc>{}</desc>", escape(note));
    }
    let white = Color::WHITE.hex();
    let _ = writeln!(out, "<path d=\"M0 0H{w}V{h}H0z\" fill=\"{white}\"/>");
    let mut clips = 0;
    for item in &p.items {
        match item {
            Item::Path(path) => self::path(&mut out, path),
            Item::Text(t) => text(&mut out, t),
            Item::Clip([left, top, right, bottom]) => {
                clips += 1;
                let id = format!("{}-{clips}", p.id);
                let _ = writeln!(
                    out,
                    "<clipPath id=\"{id}\"><path d=\"M{} {}H{}V{}H{}z\"/></clipPath>\n\
                     <g clip-path=\"url(#{id})\">",
                    px(*left),
                    px(*top),
                    px(*right),
                    px(*bottom),
                    px(*left),
                );
            }
            Item::Unclip => out.push_str("</g>\n"),
        }
    }
    out.push_str("</svg>\n");
    out
}

fn path(out: &mut String, path: &Path) {
    out.push_str("<path d=\"");
    steps(out, &path.steps);
    match path.fill {
        Some(color) => _ = write!(out, "\" fill=\"{}\"", color.hex()),
        None => out.push_str("\" fill=\"none\""),
    }
    if let Some(pen) = &path.pen {
        let _ = write!(out, " stroke=\"{}\"", pen.color.hex());
        if pen.width != 1.0 {
            let _ = write!(out, " stroke-width=\"{}\"", px(pen.width));
        }
        if pen.round {
            out.push_str(" stroke-linecap=\"round\" stroke-linejoin=\"round\"");
        }
        if !pen.dash.is_empty() {
            let dash: Vec<String> = pen.dash.iter().map(|d| px(f64::from(*d))).collect();
            let _ = write!(out, " stroke-dasharray=\"{}\"", dash.join(" "));
        }
    }
    if path.opacity < 1.0 {
        let share = format!("{:.2}", path.opacity);
        let part = if path.pen.is_some() {
            "stroke-"
        } else {
            "fill-"
        };
        let _ = write!(out, " {part}opacity=\"{share}\"");
        if path.pen.is_some() && path.fill.is_some() {
            let _ = write!(out, " fill-opacity=\"{share}\"");
        }
    }
    out.push_str("/>\n");
}

/// The shortest commands: `h` and `v` along an axis, `h0` for a dot.
fn steps(out: &mut String, steps: &[Step]) {
    let mut last = (0, 0);
    let mut moved = false;
    for step in steps {
        match *step {
            Step::Move((x, y)) => {
                last = (tenths(x), tenths(y));
                out.push('M');
                tenth(out, last.0);
                out.push(' ');
                tenth(out, last.1);
                moved = true;
            }
            Step::Line((x, y)) => {
                let to = (tenths(x), tenths(y));
                if to == last && moved {
                    out.push_str("h0");
                } else if to.1 == last.1 {
                    out.push('H');
                    tenth(out, to.0);
                } else if to.0 == last.0 {
                    out.push('V');
                    tenth(out, to.1);
                } else {
                    out.push('L');
                    tenth(out, to.0);
                    out.push(' ');
                    tenth(out, to.1);
                }
                last = to;
                moved = false;
            }
            Step::Close => out.push('z'),
        }
    }
}

fn text(out: &mut String, t: &Text) {
    let (x, y) = (px(t.at.0), px(t.at.1));
    let _ = write!(out, "<text x=\"{x}\" y=\"{y}\"");
    if t.size != SIZE {
        let _ = write!(out, " font-size=\"{}\"", px(t.size));
    }
    match t.anchor {
        Anchor::Start => {}
        Anchor::Middle => out.push_str(" text-anchor=\"middle\""),
        Anchor::End => out.push_str(" text-anchor=\"end\""),
    }
    if t.color != Color::INK {
        let _ = write!(out, " fill=\"{}\"", t.color.hex());
    }
    if t.bold {
        // The outline that PNG and PDF have, too: a bold font would be wider.
        let width = format!("{:.2}", t.size * BOLD);
        let _ = write!(
            out,
            " stroke=\"{}\" stroke-width=\"{width}\"",
            t.color.hex()
        );
    }
    if t.angle > 0 {
        let _ = write!(out, " transform=\"rotate(-{} {x} {y})\"", t.angle);
    }
    if t.rim {
        let (white, width) = (Color::WHITE.hex(), px(RIM));
        let _ = write!(
            out,
            " stroke=\"{white}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" paint-order=\"stroke\""
        );
    }
    let _ = writeln!(out, ">{}</text>", escape(&t.text));
}

/// Escapes a text for an element. Unsafe characters are codes already.
fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
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

/// A length in tenths of a px. Charts keep coordinates small, so the cast is exact.
fn tenths(x: f64) -> i64 {
    (x * 10.0).round() as i64
}

fn tenth(out: &mut String, x: i64) {
    let sign = if x < 0 { "-" } else { "" };
    let (whole, part) = (x.abs() / 10, x.abs() % 10);
    let _ = match part {
        0 => write!(out, "{sign}{whole}"),
        _ => write!(out, "{sign}{whole}.{part}"),
    };
}

/// A length in px with at most one decimal.
fn px(x: f64) -> String {
    let mut text = String::new();
    tenth(&mut text, tenths(x));
    text
}
