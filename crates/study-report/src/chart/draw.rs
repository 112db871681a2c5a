//! Drawing of a panel: axes, marks, notes, legend.

use super::MAX_LABEL;
use super::frame::{Frame, SAMPLE, TITLE_BASE};
use super::labels;
use super::look::{Look, Shape};
use super::{Anchor, Color, ColorBar, Mark, NORMAL, Note, Panel, SMALL, fitted, shortened};
use super::{Span, Whisker, text_width};
use crate::picture::{Path, Pen, Picture, Point, Text};
use std::collections::BTreeSet;

/// Half the width of an error bar's cap, px.
const CAP: f64 = 4.0;

/// Largest width of a note, in columns.
const MAX_NOTE: usize = 80;

pub(super) fn panel(out: &mut Picture, panel: &Panel, frame: &Frame) {
    grid(out, panel, frame);
    // Clipping is slow to render.
    let clipped = !panel.series.iter().all(|s| fits(panel, &s.mark));
    if clipped {
        let f = frame;
        out.clip([f.left - 5.0, f.top - 5.0, f.right + 5.0, f.bottom + 5.0]);
    }
    for series in &panel.series {
        mark(out, panel, frame, &series.mark, series.look);
    }
    if clipped {
        out.unclip();
    }
    axes(out, panel, frame);
    for n in &panel.notes {
        note(out, panel, frame, n);
    }
    labels::draw(out, panel, frame);
    for (i, at) in &frame.legend {
        let series = &panel.series[*i];
        sample(out, &series.mark, series.look, *at);
        let name = shortened(series.name.as_deref().unwrap_or_default(), MAX_LABEL);
        let place = (at.0 + SAMPLE, at.1 + 4.0);
        out.text(Text::new(place, &name, SMALL, Anchor::Start));
    }
    if let Some(bar) = &panel.color_bar {
        color_bar(out, bar, frame);
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
        Mark::Area(edges) => (edges.iter())
            .all(|(at, low, high)| within(x, *at) && within(y, *low) && within(y, *high)),
        Mark::Bars(all) => all.iter().all(spans),
        Mark::Heat { cells, .. } => cells.iter().all(|c| spans(&c.0)),
    }
}

fn grid(out: &mut Picture, panel: &Panel, f: &Frame) {
    let mut lines = Path::drawn(Pen::new(Color::FAINT, 1.0));
    if panel.y.grid {
        for y in f.y_ticks.iter().filter_map(|t| f.y(&panel.y, t.0)) {
            lines.segment((f.left, y), (f.right, y));
        }
    }
    if panel.x.grid {
        for x in f.x_ticks.iter().filter_map(|t| f.x(&panel.x, t.0)) {
            lines.segment((x, f.top), (x, f.bottom));
        }
    }
    out.path(lines);
}

fn axes(out: &mut Picture, panel: &Panel, f: &Frame) {
    let mut lines = Path::drawn(Pen::new(Color::INK, 1.0));
    lines.line(&[(f.left, f.top), (f.left, f.bottom), (f.right, f.bottom)]);
    for (at, label) in &f.x_ticks {
        let Some(x) = f.x(&panel.x, *at) else {
            continue;
        };
        lines.segment((x, f.bottom), (x, f.bottom + 4.0));
        out.text(if f.turned {
            Text {
                angle: 90,
                ..Text::new((x + 4.0, f.bottom + 7.0), label, SMALL, Anchor::End)
            }
        } else {
            Text::new((x, f.bottom + 18.0), label, SMALL, Anchor::Middle)
        });
    }
    for (at, label) in &f.y_ticks {
        let Some(y) = f.y(&panel.y, *at) else {
            continue;
        };
        lines.segment((f.left - 4.0, y), (f.left, y));
        out.text(Text::new(
            (f.left - 7.0, y + 4.0),
            label,
            SMALL,
            Anchor::End,
        ));
    }
    out.path(lines);
    if !panel.x.label.is_empty() {
        let text = fitted(&panel.x.label, NORMAL, f.outer_right - f.outer_left - 4.0);
        let x = middle((f.left, f.right), (f.outer_left, f.outer_right), &text);
        let at = (x, f.outer_bottom - 8.0);
        out.text(Text::new(at, &text, NORMAL, Anchor::Middle));
    }
    if !panel.y.label.is_empty() {
        let text = fitted(&panel.y.label, NORMAL, f.outer_bottom - f.outer_top - 4.0);
        let y = middle((f.top, f.bottom), (f.outer_top, f.outer_bottom), &text);
        let at = (f.outer_left + 16.0, y);
        out.text(Text {
            angle: 90,
            ..Text::new(at, &text, NORMAL, Anchor::Middle)
        });
    }
    if !panel.title.is_empty() {
        let (left, room) = f.title;
        let at = (left, f.outer_top + TITLE_BASE);
        let text = fitted(&panel.title, NORMAL, room);
        out.text(Text {
            bold: true,
            ..Text::new(at, &text, NORMAL, Anchor::Start)
        });
    }
}

/// The middle of an axis, or as near to it as a label stays within the panel.
fn middle(axis: (f64, f64), outer: (f64, f64), label: &str) -> f64 {
    let half = text_width(label, NORMAL) / 2.0 + 2.0;
    let middle = (axis.0 + axis.1) / 2.0;
    middle.min(outer.1 - half).max(outer.0 + half)
}

fn mark(out: &mut Picture, panel: &Panel, f: &Frame, mark: &Mark, look: Look) {
    let place = |p: &Point| Some((f.x(&panel.x, p.0)?, f.y(&panel.y, p.1)?));
    match mark {
        Mark::Line(points) => {
            let mut lines = Path::drawn(pen(look).dashed(look.dash.pattern()));
            for run in points.split(|p| !(p.0.is_finite() && p.1.is_finite())) {
                let places: Vec<Point> = run.iter().filter_map(place).collect();
                if places.len() > 1 {
                    lines.line(&places);
                }
            }
            out.path(lines.opacity(look.opacity));
        }
        Mark::Dots(points) => {
            let places: Vec<Point> = points.iter().filter_map(place).collect();
            dots(out, &places, look);
        }
        Mark::Points(all) => {
            let places: Vec<Point> = all.iter().filter_map(place).collect();
            points(out, &places, look);
        }
        Mark::ErrorBars(bars) => {
            let ends = bars.iter().filter_map(|Whisker { at, low, high }| {
                Some((place(&(*at, *low))?, place(&(*at, *high))?))
            });
            whiskers(out, ends, (CAP, 0.0), look);
        }
        Mark::ErrorBarsAcross(bars) => {
            let ends = bars.iter().filter_map(|Whisker { at, low, high }| {
                Some((place(&(*low, *at))?, place(&(*high, *at))?))
            });
            whiskers(out, ends, (0.0, CAP), look);
        }
        Mark::Area(edges) => {
            let above = edges.iter().map(|(at, _, high)| (*at, *high));
            let below = edges.iter().rev().map(|(at, low, _)| (*at, *low));
            let corners: Vec<Point> = above.chain(below).filter_map(|p| place(&p)).collect();
            let mut area = Path::filled(look.color);
            area.polygon(&corners);
            out.path(area.opacity(look.opacity));
        }
        Mark::Bars(spans) => {
            let mut boxes = Path::filled(look.color);
            for (a, b) in spans.iter().filter_map(|s| corners(panel, f, s)) {
                boxes.rectangle(a, b);
            }
            out.path(boxes.opacity(look.opacity));
        }
        Mark::Heat { cells, scale } => {
            for (span, value) in cells.iter().filter(|(_, v)| v.is_finite()) {
                let color = scale.color(*value);
                // An outline of the same color hides the seams between cells.
                let mut cell = Path::filled(color).edged(Pen::new(color, 0.5));
                if let Some((a, b)) = corners(panel, f, span) {
                    cell.rectangle(a, b);
                }
                out.path(cell);
            }
        }
    }
}

fn pen(look: Look) -> Pen {
    Pen::new(look.color, look.stroke)
}

fn dots(out: &mut Picture, places: &[Point], look: Look) {
    // Only the first of dots within a quarter of a px.
    let quarter = |v: f64| (v * 4.0).round() as i64;
    let mut taken = BTreeSet::new();
    let mut all = Path::drawn(pen(look).round());
    for (x, y) in places {
        if taken.insert((quarter(*x), quarter(*y))) {
            all.dot((*x, *y));
        }
    }
    out.path(all.opacity(look.opacity));
}

fn points(out: &mut Picture, places: &[Point], look: Look) {
    let r = look.size / 2.0;
    let color = look.color;
    let discs = |out: &mut Picture, color: Color, size: f64| {
        let mut all = Path::drawn(Pen::new(color, size).round());
        places.iter().for_each(|at| all.dot(*at));
        out.path(all.opacity(look.opacity));
    };
    let polygons = |out: &mut Picture, corners: &[Point]| {
        let mut all = Path::filled(color);
        for (x, y) in places {
            let moved = corners.iter().map(|(dx, dy)| (x + dx * r, y + dy * r));
            all.polygon(&moved.collect::<Vec<_>>());
        }
        out.path(all.opacity(look.opacity));
    };
    let strokes = |out: &mut Picture, ends: [[Point; 2]; 2]| {
        let mut all = Path::drawn(Pen::new(color, 2.0));
        for (x, y) in places {
            for [a, b] in ends {
                all.segment((x + a.0 * r, y + a.1 * r), (x + b.0 * r, y + b.1 * r));
            }
        }
        out.path(all.opacity(look.opacity));
    };
    match look.shape {
        Shape::Disc => discs(out, color, look.size),
        Shape::Ring => {
            discs(out, color, look.size);
            discs(out, Color::WHITE, look.size - 4.0);
        }
        Shape::Square => polygons(out, &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        Shape::Diamond => polygons(out, &[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)]),
        Shape::Up => polygons(out, &[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9)]),
        Shape::Down => polygons(out, &[(0.0, 1.2), (1.1, -0.9), (-1.1, -0.9)]),
        Shape::Cross => strokes(
            out,
            [[(-1.0, -1.0), (1.0, 1.0)], [(-1.0, 1.0), (1.0, -1.0)]],
        ),
        Shape::Plus => strokes(out, [[(-1.0, 0.0), (1.0, 0.0)], [(0.0, -1.0), (0.0, 1.0)]]),
    }
}

fn whiskers(out: &mut Picture, ends: impl Iterator<Item = (Point, Point)>, cap: Point, look: Look) {
    let mut lines = Path::drawn(pen(look));
    for (a, b) in ends {
        lines.segment(a, b);
        for end in [a, b] {
            lines.segment(
                (end.0 - cap.0, end.1 - cap.1),
                (end.0 + cap.0, end.1 + cap.1),
            );
        }
    }
    out.path(lines.opacity(look.opacity));
}

/// Two opposite corners of a box.
fn corners(panel: &Panel, f: &Frame, span: &Span) -> Option<(Point, Point)> {
    let (x, y) = (|v| f.x(&panel.x, v), |v| f.y(&panel.y, v));
    Some(((x(span.x.0)?, y(span.y.0)?), (x(span.x.1)?, y(span.y.1)?)))
}

fn note(out: &mut Picture, panel: &Panel, f: &Frame, n: &Note) {
    let (Some(x), Some(y)) = (f.x(&panel.x, n.at.0), f.y(&panel.y, n.at.1)) else {
        return;
    };
    let at = (x + n.by.0, y + n.by.1 + 4.0);
    out.text(Text {
        color: n.color,
        rim: n.rim,
        ..Text::new(at, &shortened(&n.text, MAX_NOTE), SMALL, n.anchor)
    });
}

/// The sample of a legend entry.
fn sample(out: &mut Picture, mark: &Mark, look: Look, at: Point) {
    let (left, middle, right) = (at.0, at.0 + 10.0, at.0 + 20.0);
    match mark {
        Mark::Line(_) => {
            let mut line = Path::drawn(pen(look).dashed(look.dash.pattern()));
            line.segment((left, at.1), (right, at.1));
            out.path(line.opacity(look.opacity));
        }
        Mark::Dots(_) => dots(out, &[(middle, at.1)], look.stroke(4.0)),
        Mark::Points(_) => points(out, &[(middle, at.1)], look),
        Mark::ErrorBars(_) => {
            let ends = ((middle, at.1 - 6.0), (middle, at.1 + 6.0));
            whiskers(out, [ends].into_iter(), (CAP, 0.0), look);
        }
        Mark::ErrorBarsAcross(_) => {
            let ends = ((left, at.1), (right, at.1));
            whiskers(out, [ends].into_iter(), (0.0, CAP), look);
        }
        Mark::Area(_) | Mark::Bars(_) | Mark::Heat { .. } => {
            let mut sample = Path::filled(look.color);
            sample.rectangle((left + 2.0, at.1 - 5.0), (left + 18.0, at.1 + 5.0));
            out.path(sample.opacity(look.opacity));
        }
    }
}

fn color_bar(out: &mut Picture, bar: &ColorBar, f: &Frame) {
    const STEPS: usize = 40;
    let left = f.right + 12.0;
    let height = f.bottom - f.top;
    for i in 0..STEPS {
        let y = f.bottom - height * (i + 1) as f64 / STEPS as f64;
        let mut step = Path::filled(bar.scale.at((i as f64 + 0.5) / STEPS as f64));
        // An overlap of half a px hides the seams.
        step.rectangle((left, y), (left + 12.0, y + height / STEPS as f64 + 0.5));
        out.path(step);
    }
    let axis = super::Axis::new("", bar.scale.low, bar.scale.high);
    let most = (height / 24.0).floor().clamp(2.0, 6.0) as usize;
    let mut ticks = Path::drawn(Pen::new(Color::INK, 1.0));
    for (at, label) in axis.marks(most) {
        if let Some(share) = axis.share(at) {
            let y = f.bottom - share * height;
            ticks.segment((left + 12.0, y), (left + 16.0, y));
            out.text(Text::new(
                (left + 19.0, y + 4.0),
                &label,
                SMALL,
                Anchor::Start,
            ));
        }
    }
    out.path(ticks);
    let at = (left + 64.0, (f.top + f.bottom) / 2.0);
    out.text(Text {
        angle: 90,
        ..Text::new(at, &shortened(&bar.label, MAX_NOTE), SMALL, Anchor::Middle)
    });
}
