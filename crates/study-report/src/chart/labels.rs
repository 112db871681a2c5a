//! Names of points, each beside its point or at the end of a line to it.

use super::frame::Frame;
use super::{Anchor, Color, MAX_LABEL, Mark, Panel, SMALL, shortened, text_width};
use crate::picture::{Path, Pen, Picture, Point, Text};
use study_base::sort::SmallSort as _;

/// Distances of a name from its point that are tried, px.
const DISTANCES: [f64; 9] = [9.0, 15.0, 22.0, 32.0, 45.0, 62.0, 84.0, 110.0, 145.0];

/// Directions that are tried, of the full circle.
const DIRECTIONS: usize = 16;

/// Names from this distance on have a line to their point, px.
const LEADER: f64 = 14.0;

/// Half the height of a name and half the size of a point, px.
const HALF_LINE: f64 = 7.0;
const HALF_POINT: f64 = 6.0;

/// How often every name may move once all others have a place.
const ROUNDS: usize = 3;

/// A box, px: left, top, right, bottom.
pub(super) type Area = [f64; 4];

/// Where a name stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    text: String,
    anchor: Anchor,
    /// Its point.
    point: Point,
    /// The end of the line from the point, which is the anchor of the text.
    end: Point,
    has_line: bool,
    pub(super) area: Area,
    /// Whether it overlaps no other name and no point, and is within the axes.
    pub(super) is_free: bool,
}

pub(super) fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Whether a line crosses a box (Liang & Barsky 1984).
fn crosses(a: Point, b: Point, area: &Area) -> bool {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for (p, q) in [
        (-dx, a.0 - area[0]),
        (dx, area[2] - a.0),
        (-dy, a.1 - area[1]),
        (dy, area[3] - a.1),
    ] {
        if p == 0.0 {
            if q < 0.0 {
                return false;
            }
        } else if p < 0.0 {
            from = from.max(q / p);
        } else {
            to = to.min(q / p);
        }
    }
    from < to
}

/// The position at a share of the way between two others.
fn along(a: Point, b: Point, share: f64) -> Point {
    (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share)
}

/// Whether two lines cross.
fn meet(a: (Point, Point), b: (Point, Point)) -> bool {
    let side = |(p, q): (Point, Point), at: Point| {
        (q.0 - p.0) * (at.1 - p.1) - (q.1 - p.1) * (at.0 - p.0) > 0.0
    };
    side(a, b.0) != side(a, b.1) && side(b, a.0) != side(b, a.1)
}

/// What names should keep away from.
struct Obstacles {
    /// Points: no name is on one.
    points: Vec<Area>,
    /// Error bars: as few as possible are covered.
    bars: Vec<Area>,
    /// Drawn lines, likewise.
    lines: Vec<(Point, Point)>,
}

impl Obstacles {
    fn of(panel: &Panel, f: &Frame) -> Self {
        let place = |x: f64, y: f64| Some((f.x(&panel.x, x)?, f.y(&panel.y, y)?));
        let (mut points, mut bars, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        for mark in panel.series.iter().map(|s| &s.mark) {
            match mark {
                Mark::Points(all) => points.extend(
                    (all.iter().filter_map(|p| place(p.0, p.1))).map(|(x, y)| around(x, y)),
                ),
                Mark::ErrorBars(all) => bars.extend(all.iter().filter_map(|b| {
                    let ((x, low), (_, high)) = (place(b.at, b.low)?, place(b.at, b.high)?);
                    Some([x - 3.0, high, x + 3.0, low])
                })),
                Mark::ErrorBarsAcross(all) => bars.extend(all.iter().filter_map(|b| {
                    let ((low, y), (high, _)) = (place(b.low, b.at)?, place(b.high, b.at)?);
                    Some([low, y - 3.0, high, y + 3.0])
                })),
                Mark::Line(all) => lines.extend(
                    (all.windows(2))
                        .filter_map(|w| Some((place(w[0].0, w[0].1)?, place(w[1].0, w[1].1)?))),
                ),
                _ => {}
            }
        }
        Self {
            points,
            bars,
            lines,
        }
    }
}

fn around(x: f64, y: f64) -> Area {
    [
        x - HALF_POINT,
        y - HALF_POINT,
        x + HALF_POINT,
        y + HALF_POINT,
    ]
}

/// Places for the names of a panel: first those of the lowest points, then each again,
/// given all others. Nothing here is random.
pub(super) fn places(panel: &Panel, f: &Frame) -> Vec<Place> {
    let obstacles = Obstacles::of(panel, f);
    let mut named: Vec<(Point, String, f64)> = (panel.labels.iter())
        .filter_map(|l| {
            let point = (f.x(&panel.x, l.at.0)?, f.y(&panel.y, l.at.1)?);
            let text = shortened(&l.text, MAX_LABEL);
            let width = text_width(&text, SMALL);
            Some((point, text, width))
        })
        .collect();
    named.small_sort_by(|a, b| b.0.1.total_cmp(&a.0.1));
    let mut found: Vec<Place> = Vec::new();
    for (point, text, width) in &named {
        let place = best(*point, text, *width, &found, &obstacles, f);
        found.push(place);
    }
    for _ in 0..ROUNDS {
        let before = found.clone();
        for i in 0..found.len() {
            let (point, text, width) = &named[i];
            let mut others = found.clone();
            others.remove(i);
            found[i] = best(*point, text, *width, &others, &obstacles, f);
        }
        if found == before {
            break;
        }
    }
    found
}

/// The cheapest place of a name.
fn best(
    point: Point,
    text: &str,
    width: f64,
    others: &[Place],
    obstacles: &Obstacles,
    f: &Frame,
) -> Place {
    let mut best = Place {
        text: text.to_owned(),
        anchor: Anchor::Start,
        point,
        end: point,
        has_line: false,
        area: around(point.0, point.1),
        is_free: false,
    };
    let mut least = f64::INFINITY;
    for distance in DISTANCES {
        for direction in 0..DIRECTIONS {
            // First to the right and to the left, last upwards and downwards.
            let turn = f64::from((direction / 4) as u32) / DIRECTIONS as f64;
            let turn = match direction % 4 {
                0 => turn,
                1 => 0.5 - turn,
                2 => -turn - 1.0 / 64.0,
                _ => 0.5 + turn + 1.0 / 64.0,
            };
            let (sine, cosine) = libm::sincos(turn * std::f64::consts::TAU);
            let end = (point.0 + distance * cosine, point.1 - distance * sine);
            let (anchor, left) = if cosine >= 0.0 {
                (Anchor::Start, end.0)
            } else {
                (Anchor::End, end.0 - width)
            };
            let area = [left, end.1 - HALF_LINE, left + width, end.1 + HALF_LINE];
            let has_line = distance > LEADER;
            let mut cost = distance * 0.08;
            let outside = area[0] < f.left + 2.0
                || area[2] > f.right + 8.0
                || area[1] < f.top
                || area[3] > f.bottom - 2.0;
            let covered = |all: &[Area]| all.iter().filter(|b| overlap(b, &area)).count() as f64;
            let names = others.iter().filter(|o| overlap(&o.area, &area)).count() as f64;
            let points = covered(&obstacles.points);
            let is_free = !outside && names + points == 0.0;
            cost += 1000.0 * names + 1000.0 * points + 4.0 * covered(&obstacles.bars);
            cost += if outside { 2000.0 } else { 0.0 };
            let lines = obstacles.lines.iter();
            cost += 3.0 * lines.filter(|(a, b)| crosses(*a, *b, &area)).count() as f64;
            if has_line {
                // Other points than its own.
                let start = along(point, end, 1.5 * HALF_POINT / distance);
                let points = obstacles.points.iter();
                cost += 40.0 * points.filter(|p| crosses(start, end, p)).count() as f64;
            }
            for other in others {
                let crossed = (has_line && crosses(point, end, &other.area))
                    || (other.has_line && crosses(other.point, other.end, &area));
                cost += if crossed { 60.0 } else { 0.0 };
                if has_line && other.has_line && meet((point, end), (other.point, other.end)) {
                    cost += 20.0;
                }
            }
            if cost < least {
                least = cost;
                (best.anchor, best.end, best.area) = (anchor, end, area);
                (best.has_line, best.is_free) = (has_line, is_free);
            }
        }
    }
    best
}

/// Draws the names that have a place of their own.
pub(super) fn draw(out: &mut Picture, panel: &Panel, f: &Frame) {
    let places = places(panel, f);
    let mut lines = Path::drawn(Pen::new(Color::GREY, 1.0));
    for p in places.iter().filter(|p| p.is_free && p.has_line) {
        let length = (p.end.0 - p.point.0).hypot(p.end.1 - p.point.1);
        lines.segment(along(p.point, p.end, HALF_POINT / length), p.end);
    }
    out.path(lines);
    for p in places.into_iter().filter(|p| p.is_free) {
        let gap = match (p.has_line, p.anchor) {
            (false, _) => 0.0,
            (true, Anchor::End) => -2.0,
            (true, _) => 2.0,
        };
        let at = (p.end.0 + gap, p.end.1 + 4.0);
        out.text(Text {
            rim: true,
            ..Text::new(at, &p.text, SMALL, p.anchor)
        });
    }
}
