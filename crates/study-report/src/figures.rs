//! The figures of an analysis, each with the data it shows.
//!
//! Means of subject × realization cells and of repetitions, and the line through drawn
//! points, are computed here; all other statistics are looked up in the analysis. Figures that the
//! data do not allow are left out. Each figure has two widths, those of two
//! columns and of one column of a journal.

mod adjustment;
mod counts;
mod factors;
mod flow;
mod forest;
mod functions;
mod identification;
mod means;
mod outcomes;
mod pairs;
mod parts;
mod rankings;
mod rendering;
mod searches;
mod similarity;
mod strips;
mod subjects;
mod thresholds;
mod traces;
mod vaf;
mod weber;

pub use parts::{PREFIX as PARTS_PREFIX, of_part};

use super::chart::{Axis, Figure, Look, Mark, Panel, for_names};
use super::picture::{POINTS, Picture};
use std::collections::BTreeMap;
use study_analysis::analyze::results::{Described, Number as _, Stat};
use study_analysis::analyze::{Analysis, RealizationSummary};
pub use study_analysis::study::Trace;
use study_base::sort::SmallSort as _;
use study_session::outcome::Role;
use study_stats::describe::mean;

/// Largest number of realizations, and of subjects, that are drawn individually.
pub const MAX_DRAWN: usize = 60;

/// File names of all figures, without extension.
pub const NAMES: [&str; 14] = [
    "factors",
    "fig10-means",
    // Of earlier versions: now below fig10-means.
    "fig11-rating-and-vaf",
    "rating-against-vaf",
    "pairs",
    "strips",
    "subjects-and-realizations",
    "histograms",
    "subject-lines",
    "order",
    "outcomes",
    "rendering",
    "telemetry",
    "participants",
];

/// A figure, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// File name without extension.
    pub name: String,
    /// Caption. Untrusted.
    pub caption: String,
    /// Version of two columns' width, for paper and screens.
    pub wide: Picture,
    /// Version of one column's width, for paper and phones.
    pub narrow: Picture,
    /// The data of the figure, as CSV.
    pub data: String,
}

impl Drawn {
    /// States in the files what their readers must know about the data.
    fn noted(mut self, note: Option<&str>) -> Self {
        for picture in [&mut self.wide, &mut self.narrow] {
            if let Some(note) = note {
                picture.set_note(note);
            }
        }
        self
    }
}

/// The page that a version of a figure is for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Canvas {
    /// px.
    width: f64,
    narrow: bool,
}

/// Two columns of a journal, 181 mm.
const WIDE: Canvas = Canvas {
    width: 181.0 / 25.4 * 72.0 / POINTS,
    narrow: false,
};
/// One column of a journal, 88.9 mm; also for phones.
const NARROW: Canvas = Canvas {
    width: 88.9 / 25.4 * 72.0 / POINTS,
    narrow: true,
};

impl Canvas {
    fn figure(self, name: &str, title: &str, height: f64) -> Figure {
        let id = if self.narrow {
            format!("{name}-n")
        } else {
            name.to_owned()
        };
        Figure::new(&id, title, self.width, height)
    }

    /// One of two settings.
    fn pick<T>(self, wide: T, narrow: T) -> T {
        if self.narrow { narrow } else { wide }
    }
}

/// All figures that the data allow, in the order of the report.
pub fn all(a: &Analysis, traces: &[Trace]) -> Vec<Drawn> {
    let scene = Scene::of(a);
    let note = note(a);
    let all = [
        factors::interaction(&scene),
        means::fig10(&scene),
        vaf::against_vaf(&scene),
        pairs::forest(&scene),
        subjects::cells(&scene),
        counts::histograms(&scene).or_else(|| strips::strips(&scene)),
        subjects::lines(&scene),
        subjects::order(&scene),
        outcomes::outcomes(&scene),
        rendering::rendering(&scene),
        traces::traces(&scene, traces),
        flow::participants(a),
    ]
    .into_iter()
    .flatten();
    all.map(|drawn| drawn.noted(note)).collect()
}

/// What the files of the figures say about data that are not all from participants.
fn note(a: &Analysis) -> Option<&'static str> {
    let c = &a.counts;
    let real = c.participants > c.pilots + c.simulated;
    Some(match (real, c.pilots, c.simulated) {
        (_, 0, 0) => return None,
        (true, _, _) => "includes pilot or simulated data",
        (false, 0, _) => "simulated data, no participants",
        (false, _, 0) => "pilot data, no participants",
        (false, _, _) => "pilot and simulated data, no participants",
    })
}

/// Data that several figures use.
struct Scene<'a> {
    a: &'a Analysis,
    /// The tested realizations, then the others, both in ascending order of VAF or, if
    /// a tested one has no VAF, of the mean.
    models: Vec<&'a RealizationSummary>,
    by_vaf: bool,
    /// The question as a noun, without article.
    asked: String,
    /// Ratings by subject and realization.
    cells: BTreeMap<(&'a str, &'a str), Vec<f64>>,
    subjects: Vec<&'a str>,
}

impl<'a> Scene<'a> {
    fn of(a: &'a Analysis) -> Self {
        let mut cells: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
        // Larger numbers of subjects are not drawn.
        let few = a.counts.participants <= MAX_DRAWN;
        let rows = a.rows.iter().filter(|r| few && r.excluded.is_none());
        for row in rows {
            let (subject, model) = (a.subject(row), a.model(row));
            if let (Some(rating), false) = (row.rating, model.is_empty()) {
                let cell = (subject, model);
                cells.entry(cell).or_default().push(rating);
            }
        }
        let asked = super::sentences::asked(a);
        let mut subjects: Vec<&str> = cells.keys().map(|(s, _)| *s).collect();
        subjects.dedup();
        let mut scene = Self {
            a,
            models: a.realizations.iter().collect(),
            by_vaf: a.realizations.iter().all(|m| m.vaf.is_some() || !m.tested),
            asked: asked.trim_start_matches("the ").to_owned(),
            cells,
            subjects,
        };
        let key = |m: &RealizationSummary| {
            let along = if scene.by_vaf {
                m.vaf
            } else {
                scene.mean(&m.id)
            };
            (!m.tested, along.unwrap_or(f64::INFINITY))
        };
        let mut models = scene.models.clone();
        models.small_sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        scene.models = models;
        scene
    }

    /// Label of the axis of the realizations, with their order.
    fn realizations(&self) -> String {
        let from = if self.by_vaf { "VAF" } else { "mean" };
        format!("realization, from low to high {from}")
    }

    /// What the realizations are in the order of.
    fn order(&self) -> &'static str {
        if self.by_vaf { "VAF" } else { "the means" }
    }

    /// Whether the realizations can be drawn individually.
    fn drawable(&self) -> bool {
        (1..=MAX_DRAWN).contains(&self.models.len())
    }

    /// Whether realizations and subjects can be drawn individually.
    fn with_subjects(&self) -> bool {
        self.drawable() && (1..=MAX_DRAWN).contains(&self.subjects.len())
    }

    fn names(&self) -> Vec<String> {
        self.models.iter().map(|m| name(m)).collect()
    }

    /// A statistic of the ratings of a realization.
    fn number(&self, model: &str, field: fn(&Described) -> &Stat) -> Option<f64> {
        self.a.described(model).map(field).number()
    }

    /// The mean of a realization over participants, adjusted if cells are missing.
    fn mean(&self, model: &str) -> Option<f64> {
        let adjusted = self.a.adjusted(model).map(|m| &m.mean);
        (adjusted.number()).or_else(|| self.number(model, |d| &d.subject_mean.mean))
    }

    /// "adjusted " if means are adjusted for missing cells.
    fn adjusted(&self) -> &'static str {
        if self.a.design.is_complete() {
            ""
        } else {
            "adjusted "
        }
    }

    /// The mean of the ratings of a cell.
    fn cell(&self, subject: &str, model: &str) -> Option<f64> {
        self.cells.get(&(subject, model)).and_then(|x| mean(x))
    }

    /// Whether the names of the realizations are too long or too many to stand side by
    /// side below an axis of this figure. Then they stand at the left.
    fn across(&self, c: Canvas) -> bool {
        for_names(&self.names(), c.width - 60.0) > 0.0
    }

    /// An axis with the rating scale and the values beyond it.
    fn ratings(&self, label: &str, beyond: &[f64]) -> Axis {
        let finite = || beyond.iter().copied().filter(|v| v.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        match self.a.scale {
            Some((from, to)) => {
                let room = (to - from) * 0.04;
                Axis::new(label, low.min(from) - room, high.max(to) + room)
            }
            None => {
                // All ratings, so that all figures have the same axis.
                let ends = |what: fn(&Described) -> &Stat, end: fn(f64, f64) -> f64| {
                    let all = self.models.iter().filter_map(|m| self.number(&m.id, what));
                    all.reduce(end)
                };
                let least = ends(|d| &d.min, f64::min).map_or(low, |v| v.min(low));
                let most = ends(|d| &d.max, f64::max).map_or(high, |v| v.max(high));
                let room = (most - least) * 0.04;
                Axis::new(label, least - room, most + room)
            }
        }
    }
}

/// A panel with realizations along one axis and values along the other.
struct Along {
    across: bool,
    panel: Panel,
}

impl Along {
    /// Realizations stand at the left, the first at the top, or below the axes.
    fn new(across: bool, realizations: Axis, values: Axis) -> Self {
        let panel = if across {
            // Names explain themselves, and their height may be small.
            let mut names = realizations.reversed();
            names.label.clear();
            Panel::new(values, names)
        } else {
            Panel::new(realizations, values)
        };
        Self { across, panel }
    }

    /// Adds marks at (realization, value), with a legend entry if they have a name.
    fn with(mut self, name: Option<&str>, look: Look, mark: Mark) -> Self {
        let turn = |points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            points.into_iter().map(|(x, y)| (y, x)).collect()
        };
        let mark = match mark {
            mark if !self.across => mark,
            Mark::Line(points) => Mark::Line(turn(points)),
            Mark::Dots(points) => Mark::Dots(turn(points)),
            Mark::Points(points) => Mark::Points(turn(points)),
            Mark::ErrorBars(bars) => Mark::ErrorBarsAcross(bars),
            other => other,
        };
        self.panel = match name {
            Some(name) => self.panel.named(name, look, mark),
            None => self.panel.with(look, mark),
        };
        self
    }
}

/// Height for realizations that stand at the left, px: of many, two figures fit below each
/// other on a page.
fn rows_height(n: usize) -> f64 {
    let each = if n > 16 { 14.5 } else { 17.0 };
    each * n.max(4) as f64
}

/// An offset between −0.5 and 0.5 that spreads marks of the same value: equal for equal
/// numbers, and different for neighbors.
fn jitter(n: usize) -> f64 {
    // The golden ratio spreads any number of them evenly.
    (n as f64 * 0.618_033_988_749_895 + 0.5).fract() - 0.5
}

fn name(m: &RealizationSummary) -> String {
    match (&m.duplicate_of, m.role) {
        (Some(_), _) => format!("{} (duplicate)", m.id),
        (None, Role::Test) => m.id.clone(),
        (None, role) => format!("{} ({})", m.id, role.as_str()),
    }
}

/// A figure in both widths.
fn drawn(
    name: &str,
    caption: String,
    data: Vec<Vec<String>>,
    draw: impl Fn(Canvas) -> Figure,
) -> Drawn {
    Drawn {
        name: name.to_owned(),
        caption,
        wide: draw(WIDE).picture(),
        narrow: draw(NARROW).picture(),
        data: super::csv::text(&data),
    }
}

fn cell(x: Option<f64>) -> String {
    x.map_or_else(String::new, super::apa::digits)
}

fn head<const N: usize>(names: [&str; N]) -> Vec<String> {
    names.iter().map(|n| (*n).to_owned()).collect()
}
