//! The figures of an analysis, each with the data it shows.
//!
//! Means of subject × realization cells and of repetitions are computed here from the
//! included rows; all other statistics are looked up in the analysis. Figures that the
//! data do not allow are left out. Each figure has two widths, those of two
//! columns and of one column of a journal.

mod counts;
mod means;
mod subjects;
mod traces;

use super::chart::{Axis, Figure};
use super::picture::POINTS;
use std::collections::BTreeMap;
use study_core::analyze::{Analysis, RealizationSummary};
use study_core::outcome::Role;

/// Largest number of realizations, and of subjects, that are drawn individually.
pub const MAX_DRAWN: usize = 60;

/// File names of all figures, without extension.
pub const NAMES: [&str; 8] = [
    "fig10-means",
    "fig11-rating-and-vaf",
    "rating-against-vaf",
    "subjects-and-realizations",
    "histograms",
    "subject-lines",
    "order",
    "telemetry",
];

/// Force against position during one playback.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Realization. Untrusted.
    pub model: String,
    /// Participant and trial. Untrusted.
    pub label: String,
    /// Whether the force was measured, not only commanded.
    pub measured: bool,
    /// Position in mm, force in N.
    pub points: Vec<(f64, f64)>,
}

/// A figure, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// File name without extension.
    pub name: &'static str,
    /// Caption. Untrusted.
    pub caption: String,
    /// Version of two columns' width, for paper and screens.
    pub wide: Figure,
    /// Version of one column's width, for paper and phones.
    pub narrow: Figure,
    /// The data of the figure, as CSV.
    pub data: String,
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
        means::fig10(&scene),
        means::fig11(&scene),
        means::against_vaf(&scene),
        subjects::cells(&scene),
        counts::histograms(&scene),
        subjects::lines(&scene),
        subjects::order(&scene),
        traces::traces(&scene, traces),
    ]
    .into_iter()
    .flatten();
    all.map(|mut drawn| {
        drawn.wide.note.clone_from(&note);
        drawn.narrow.note.clone_from(&note);
        drawn
    })
    .collect()
}

/// What the files of the figures say about data that are not all from participants.
fn note(a: &Analysis) -> Option<String> {
    let c = &a.counts;
    let real = c.participants > c.pilots + c.simulated;
    let text = match (real, c.pilots, c.simulated) {
        (_, 0, 0) => return None,
        (true, _, _) => "includes pilot or simulated data",
        (false, 0, _) => "simulated data, no participants",
        (false, _, 0) => "pilot data, no participants",
        (false, _, _) => "pilot and simulated data, no participants",
    };
    Some(text.to_owned())
}

/// Data that several figures use.
struct Scene<'a> {
    a: &'a Analysis,
    /// The tested realizations, then the others.
    models: Vec<&'a RealizationSummary>,
    /// The question as a noun, without article.
    asked: String,
    /// Ratings by subject and realization.
    cells: BTreeMap<(&'a str, &'a str), Vec<f64>>,
    subjects: Vec<&'a str>,
}

impl<'a> Scene<'a> {
    fn of(a: &'a Analysis) -> Self {
        let mut models: Vec<&RealizationSummary> = a.realizations.iter().collect();
        models.sort_by_key(|m| !m.tested);
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
        Self {
            a,
            models,
            asked: asked.trim_start_matches("the ").to_owned(),
            cells,
            subjects,
        }
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

    fn number(&self, model: &str, what: &str) -> Option<f64> {
        self.a.described(model, what)
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
            None => Axis::around(label, [low, high]),
        }
    }
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
    name: &'static str,
    caption: String,
    data: Vec<Vec<String>>,
    draw: impl Fn(Canvas) -> Figure,
) -> Drawn {
    Drawn {
        name,
        caption,
        wide: draw(WIDE),
        narrow: draw(NARROW),
        data: super::csv::text(&data),
    }
}

fn cell(x: Option<f64>) -> String {
    x.map_or_else(String::new, super::csv::digits)
}

fn head<const N: usize>(names: [&str; N]) -> Vec<String> {
    names.iter().map(|n| (*n).to_owned()).collect()
}
