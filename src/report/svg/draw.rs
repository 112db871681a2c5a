//! Drawing of a panel: axes, marks, notes, legend.

use super::frame::{Frame, MAX_LABEL, SAMPLE, TITLE_BASE};
use super::look::{Colour, Fill, Look, Shape, ramp};
use super::out::{Out, Setting, escape, px};
use super::{
    Anchor, ColourBar, Mark, NORMAL, Note, Panel, SMALL, Span, Whisker, fitted, shortened,
};
use std::collections::BTreeSet;

/// Half the width of an error bar's cap, px.
const CAP: f64 = 4.0;

/// A note with a larger vertical offset has a leader line, px.
const LEADER: f64 = 10.0;

/// Largest width of a note, in columns.
const MAX_NOTE: usize = 80;

pub(super) fn panel(out: &mut Out, panel: &Panel, frame: &Frame) {
    grid(out, panel, frame);
    // Clipping is slow to render.
    if panel.series.iter().all(|s| fits(panel, &s.mark)) {
        out.line("<g>");
    } else {
        let clip = out.fresh_id();
        out.line(&format!(
            "<clipPath id=\"{clip}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>",
            px(frame.left - 5.0),
            px(frame.top - 5.0),
            px(frame.right - frame.left + 10.0),
            px(frame.bottom - frame.top + 10.0)
        ));
        out.line(&format!("<g clip-path=\"url(#{clip})\">"));
    }
    for series in &panel.series {
        mark(out, panel, frame, &series.mark, series.look);
    }
    out.line("</g>");
    axes(out, panel, frame);
    for n in &panel.notes {
        note(out, panel, frame, n);
    }
    for (i, at) in &frame.legend {
        let series = &panel.series[*i];
        sample(out, &series.mark, series.look, *at);
        let name = shortened(series.name.as_deref().unwrap_or_default(), MAX_LABEL);
        let place = (at.0 + SAMPLE, at.1 + 4.0);
        let style = (Anchor::Start, Colour::INK);
        out.text(place, &name, SMALL, style, Setting::Plain);
    }
    if let Some(bar) = &panel.colour_bar {
        colour_bar(out, bar, frame);
    }
}

/// Whether a mark stays within the axes.
fn fits(panel: &Panel, mark: &Mark) -> bool {
    let within = |axis: &super::Axis, v: f64| {
        let share = axis.share(v);
        share.is_none_or(|s| (-1e-9..=1.0 + 1e-9).contains(&s))
    };
    let (x, y) = (&panel.x, &panel.y);
    let spans =
        |s: &Span| within(x, s.x.0) && within(x, s.x.1) && within(y, s.y.0) && within(y, s.y.1);
    match mark {
        Mark::Line(points) | Mark::Dots(points) | Mark::Points(points) => {
            points.iter().all(|p| within(x, p.0) && within(y, p.1))
        }
        Mark::ErrorBars(bars) => {
            (bars.iter()).all(|b| within(x, b.at) && within(y, b.low) && within(y, b.high))
        }
        Mark::ErrorBarsAcross(bars) => {
            (bars.iter()).all(|b| within(y, b.at) && within(x, b.low) && within(x, b.high))
        }
        Mark::Bars(all) => all.iter().all(spans),
        Mark::Heat { cells, .. } => cells.iter().all(|c| spans(&c.0)),
    }
}

fn grid(out: &mut Out, panel: &Panel, f: &Frame) {
    if panel.y.grid {
        for (at, _) in &f.y_ticks {
            if let Some(y) = f.y(&panel.y, *at) {
                out.segment((f.left, y), (f.right, y), Colour::FAINT, 1.0);
            }
        }
    }
    if panel.x.grid {
        for (at, _) in &f.x_ticks {
            if let Some(x) = f.x(&panel.x, *at) {
                out.segment((x, f.top), (x, f.bottom), Colour::FAINT, 1.0);
            }
        }
    }
}

fn axes(out: &mut Out, panel: &Panel, f: &Frame) {
    let ink = Colour::INK;
    out.segment((f.left, f.top), (f.left, f.bottom), ink, 1.0);
    out.segment((f.left, f.bottom), (f.right, f.bottom), ink, 1.0);
    for (at, label) in &f.x_ticks {
        let Some(x) = f.x(&panel.x, *at) else {
            continue;
        };
        out.segment((x, f.bottom), (x, f.bottom + 4.0), ink, 1.0);
        if f.slant > 0 {
            let style = (Anchor::End, ink);
            out.text(
                (x + 4.0, f.bottom + 15.0),
                label,
                SMALL,
                style,
                Setting::Slanted(f.slant),
            );
        } else {
            let style = (Anchor::Middle, ink);
            out.text((x, f.bottom + 18.0), label, SMALL, style, Setting::Plain);
        }
    }
    for (at, label) in &f.y_ticks {
        let Some(y) = f.y(&panel.y, *at) else {
            continue;
        };
        out.segment((f.left - 4.0, y), (f.left, y), ink, 1.0);
        let style = (Anchor::End, ink);
        out.text((f.left - 7.0, y + 4.0), label, SMALL, style, Setting::Plain);
    }
    let style = (Anchor::Middle, ink);
    if !panel.x.label.is_empty() {
        let at = ((f.left + f.right) / 2.0, f.outer_bottom - 8.0);
        let text = fitted(&panel.x.label, NORMAL, f.right - f.outer_left);
        out.text(at, &text, NORMAL, style, Setting::Plain);
    }
    if !panel.y.label.is_empty() {
        let at = (f.outer_left + 16.0, (f.top + f.bottom) / 2.0);
        let text = fitted(&panel.y.label, NORMAL, f.outer_bottom - f.outer_top);
        out.text(at, &text, NORMAL, style, Setting::Turned);
    }
    if !panel.title.is_empty() {
        let at = (f.left, f.outer_top + TITLE_BASE);
        // Bold letters are a tenth wider.
        let text = fitted(&panel.title, NORMAL * 1.1, f.right - f.left);
        let style = (Anchor::Start, ink);
        out.text(at, &text, NORMAL, style, Setting::Bold);
    }
}

fn mark(out: &mut Out, panel: &Panel, f: &Frame, mark: &Mark, look: Look) {
    let place = |p: &(f64, f64)| Some((f.x(&panel.x, p.0)?, f.y(&panel.y, p.1)?));
    match mark {
        Mark::Line(points) => {
            for run in points.split(|p| !(p.0.is_finite() && p.1.is_finite())) {
                let places: Vec<(f64, f64)> = run.iter().filter_map(place).collect();
                line(out, &places, look);
            }
        }
        Mark::Dots(points) => {
            let places: Vec<(f64, f64)> = points.iter().filter_map(place).collect();
            dots(out, &places, look);
        }
        Mark::Points(points) => {
            for at in points.iter().filter_map(place) {
                point(out, at, look);
            }
        }
        Mark::ErrorBars(bars) => {
            for Whisker { at, low, high } in bars {
                if let (Some(a), Some(b)) = (place(&(*at, *low)), place(&(*at, *high))) {
                    whisker(out, a, b, (CAP, 0.0), look);
                }
            }
        }
        Mark::ErrorBarsAcross(bars) => {
            for Whisker { at, low, high } in bars {
                if let (Some(a), Some(b)) = (place(&(*low, *at)), place(&(*high, *at))) {
                    whisker(out, a, b, (0.0, CAP), look);
                }
            }
        }
        Mark::Bars(spans) => {
            let fill = fill(out, look);
            for span in spans {
                let edge = format!(" stroke=\"{}\" stroke-width=\"1\"", look.colour.hex());
                boxed(out, panel, f, span, &fill, &edge);
            }
        }
        Mark::Heat { cells, low, high } => {
            for (span, value) in cells.iter().filter(|(_, v)| v.is_finite()) {
                let colour = ramp(share(*value, *low, *high)).hex();
                // An outline of the same colour hides the seams between cells.
                let edge = format!(" stroke=\"{colour}\" stroke-width=\"0.5\"");
                boxed(out, panel, f, span, &colour, &edge);
            }
        }
    }
}

/// Position of a value between two others; 0.5 if these are equal.
pub(in crate::report) fn share(value: f64, low: f64, high: f64) -> f64 {
    let share = (value - low) / (high - low);
    if share.is_finite() { share } else { 0.5 }
}

/// Opacity of stroke and fill, which renders faster than that of the element.
fn opacity(look: Look) -> String {
    if look.opacity < 1.0 {
        let share = px(look.opacity);
        format!(" stroke-opacity=\"{share}\" fill-opacity=\"{share}\"")
    } else {
        String::new()
    }
}

fn line(out: &mut Out, places: &[(f64, f64)], look: Look) {
    if places.len() < 2 {
        return;
    }
    let points: Vec<String> = places
        .iter()
        .map(|(x, y)| format!("{},{}", px(*x), px(*y)))
        .collect();
    let dash = look
        .dash
        .pattern()
        .map_or_else(String::new, |d| format!(" stroke-dasharray=\"{d}\""));
    out.line(&format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{dash}{}/>",
        points.join(" "),
        look.colour.hex(),
        px(look.stroke),
        opacity(look)
    ));
}

fn dots(out: &mut Out, places: &[(f64, f64)], look: Look) {
    // Only the first of dots within a quarter of a pixel.
    let quarter = |v: f64| (v * 4.0).round() as i64;
    let mut taken = BTreeSet::new();
    let places = (places.iter()).filter(|(x, y)| taken.insert((quarter(*x), quarter(*y))));
    // A line of length 0 with round ends is a dot in a seventh of the bytes.
    let all: Vec<String> = places
        .map(|(x, y)| format!("M{} {}h0", px(*x), px(*y)))
        .collect();
    out.line(&format!(
        "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\"{}/>",
        all.join(""),
        look.colour.hex(),
        px(look.stroke),
        opacity(look)
    ));
}

fn point(out: &mut Out, at: (f64, f64), look: Look) {
    let (x, y) = at;
    let r = look.size / 2.0;
    let colour = look.colour.hex();
    let polygon = |corners: &[(f64, f64)]| {
        let all: Vec<String> = corners
            .iter()
            .map(|(dx, dy)| format!("{},{}", px(x + dx * r), px(y + dy * r)))
            .collect();
        format!("<polygon points=\"{}\" fill=\"{colour}\"", all.join(" "))
    };
    let strokes =
        |d: &str| format!("<path d=\"{d}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"");
    let (left, right, up, down) = (px(x - r), px(x + r), px(y - r), px(y + r));
    let shape = match look.shape {
        Shape::Disc => format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{colour}\"",
            px(x),
            px(y),
            px(r)
        ),
        Shape::Ring => format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"2\"",
            px(x),
            px(y),
            px(r - 1.0)
        ),
        Shape::Square => polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        Shape::Diamond => polygon(&[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)]),
        Shape::Up => polygon(&[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9)]),
        Shape::Down => polygon(&[(0.0, 1.2), (1.1, -0.9), (-1.1, -0.9)]),
        Shape::Cross => strokes(&format!(
            "M{left} {up}L{right} {down}M{left} {down}L{right} {up}"
        )),
        Shape::Plus => strokes(&format!(
            "M{left} {}L{right} {}M{} {up}L{} {down}",
            px(y),
            px(y),
            px(x),
            px(x)
        )),
    };
    out.line(&format!("{shape}{}/>", opacity(look)));
}

fn whisker(out: &mut Out, a: (f64, f64), b: (f64, f64), cap: (f64, f64), look: Look) {
    out.segment(a, b, look.colour, look.stroke);
    for end in [a, b] {
        let from = (end.0 - cap.0, end.1 - cap.1);
        let to = (end.0 + cap.0, end.1 + cap.1);
        out.segment(from, to, look.colour, look.stroke);
    }
}

/// The value of the `fill` attribute; defines the hatching if there is any.
fn fill(out: &mut Out, look: Look) -> String {
    let colour = look.colour.hex();
    let d = match look.fill {
        Fill::Solid => return colour,
        Fill::Rising => "M-1 7L7 -1M-1 1L1 -1M5 7L7 5",
        Fill::Falling => "M-1 -1L7 7M5 -1L7 1M-1 5L1 7",
        Fill::Crossed => "M-1 7L7 -1M-1 -1L7 7",
    };
    let id = out.fresh_id();
    out.line(&format!(
        "<pattern id=\"{id}\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\">\
         <rect width=\"6\" height=\"6\" fill=\"#ffffff\"/>\
         <path d=\"{d}\" stroke=\"{colour}\" stroke-width=\"1.4\"/></pattern>"
    ));
    format!("url(#{id})")
}

fn boxed(out: &mut Out, panel: &Panel, f: &Frame, span: &Span, fill: &str, edge: &str) {
    let x = (f.x(&panel.x, span.x.0), f.x(&panel.x, span.x.1));
    let y = (f.y(&panel.y, span.y.0), f.y(&panel.y, span.y.1));
    let ((Some(x0), Some(x1)), (Some(y0), Some(y1))) = (x, y) else {
        return;
    };
    out.line(&format!(
        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"{edge}/>",
        px(x0.min(x1)),
        px(y0.min(y1)),
        px((x1 - x0).abs()),
        px((y1 - y0).abs()),
        escape(fill)
    ));
}

fn note(out: &mut Out, panel: &Panel, f: &Frame, n: &Note) {
    let (Some(x), Some(y)) = (f.x(&panel.x, n.at.0), f.y(&panel.y, n.at.1)) else {
        return;
    };
    let how = if n.rim {
        Setting::Rimmed
    } else {
        Setting::Plain
    };
    let at = (x + n.by.0, y + n.by.1 + 4.0);
    if n.by.1.abs() > LEADER {
        // From the middle of the text to the edge of the marker.
        let (dx, dy) = (n.by.0, n.by.1);
        let length = dx.hypot(dy);
        let edge = (x + dx * 6.0 / length, y + dy * 6.0 / length);
        out.segment(edge, (x + dx, y + dy), Colour::GREY, 1.0);
    }
    let text = shortened(&n.text, MAX_NOTE);
    out.text(at, &text, SMALL, (n.anchor, n.colour), how);
}

/// The sample of a legend entry.
fn sample(out: &mut Out, mark: &Mark, look: Look, at: (f64, f64)) {
    let (left, middle, right) = (at.0, at.0 + 10.0, at.0 + 20.0);
    match mark {
        Mark::Line(_) => line(out, &[(left, at.1), (right, at.1)], look),
        Mark::Dots(_) => dots(out, &[(middle, at.1)], look.stroke(4.0)),
        Mark::Points(_) => point(out, (middle, at.1), look),
        Mark::ErrorBars(_) => {
            whisker(
                out,
                (middle, at.1 - 6.0),
                (middle, at.1 + 6.0),
                (CAP, 0.0),
                look,
            );
        }
        Mark::ErrorBarsAcross(_) => {
            whisker(out, (left, at.1), (right, at.1), (0.0, CAP), look);
        }
        Mark::Bars(_) | Mark::Heat { .. } => {
            let fill = fill(out, look);
            out.line(&format!(
                "<rect x=\"{}\" y=\"{}\" width=\"16\" height=\"10\" fill=\"{fill}\" stroke=\"{}\"/>",
                px(left + 2.0),
                px(at.1 - 5.0),
                look.colour.hex()
            ));
        }
    }
}

fn colour_bar(out: &mut Out, bar: &ColourBar, f: &Frame) {
    const STEPS: usize = 40;
    let left = f.right + 12.0;
    let height = f.bottom - f.top;
    for i in 0..STEPS {
        let colour = ramp((i as f64 + 0.5) / STEPS as f64).hex();
        let y = f.bottom - height * (i + 1) as f64 / STEPS as f64;
        out.line(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"12\" height=\"{}\" fill=\"{colour}\"/>",
            px(left),
            px(y),
            // An overlap of half a pixel hides the seams.
            px(height / STEPS as f64 + 0.5)
        ));
    }
    let axis = super::Axis::new("", bar.low, bar.high);
    let most = (height / 24.0).floor().clamp(2.0, 6.0) as usize;
    for (at, label) in axis.marks(most) {
        if let Some(share) = axis.share(at) {
            let y = f.bottom - share * height;
            out.segment((left + 12.0, y), (left + 16.0, y), Colour::INK, 1.0);
            let style = (Anchor::Start, Colour::INK);
            out.text((left + 19.0, y + 4.0), &label, SMALL, style, Setting::Plain);
        }
    }
    let at = (left + 58.0, (f.top + f.bottom) / 2.0);
    let text = shortened(&bar.label, MAX_NOTE);
    out.text(
        at,
        &text,
        SMALL,
        (Anchor::Middle, Colour::INK),
        Setting::Turned,
    );
}
