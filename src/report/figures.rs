//! The figures of an analysis: for each a picture, and the numbers in it.
//!
//! Means of subject × realization cells and of repetitions are formed here from
//! the rows that count, because they are drawn one by one; everything that is
//! inferred stands in the analysis and is only looked up. A figure that the data
//! do not allow is left out. Two widths: one for paper and screens, one for phones.

mod counts;
mod means;
mod subjects;
mod traces;

use super::svg::{Axis, Figure, Look};
use std::collections::BTreeMap;
use study_core::analyze::{Analysis, Listed};
use study_core::outcome::Role;

/// Most realizations, and most subjects, that are drawn one by one.
pub const MAX_DRAWN: usize = 60;

/// File names, without ending, that a figure can have.
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
    /// Whose and which trial. Untrusted.
    pub label: String,
    /// Whether the force was measured; else it is the commanded one.
    pub measured: bool,
    /// Position mm, force N.
    pub points: Vec<(f64, f64)>,
}

/// A figure, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// File name without ending.
    pub name: &'static str,
    /// What it shows, in a sentence or two. Untrusted.
    pub caption: String,
    /// For paper and screens.
    pub wide: Figure,
    /// For phones.
    pub narrow: Figure,
    /// The numbers in it, as CSV.
    pub data: String,
}

/// Width of the page that a figure is for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Canvas {
    width: f64,
    /// Of ids and widths alike.
    narrow: bool,
}

const WIDE: Canvas = Canvas {
    width: 680.0,
    narrow: false,
};
const NARROW: Canvas = Canvas {
    width: 344.0,
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

    /// The one or the other.
    fn pick<T>(self, wide: T, narrow: T) -> T {
        if self.narrow { narrow } else { wide }
    }
}

/// Everything that can be drawn, in the order of the report.
pub fn all(a: &Analysis, traces: &[Trace]) -> Vec<Drawn> {
    let scene = Scene::of(a);
    [
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
    .flatten()
    .collect()
}

/// What the figures share.
struct Scene<'a> {
    a: &'a Analysis,
    /// Those that the study asks about, then the others.
    models: Vec<&'a Listed>,
    /// The question as a noun.
    asked: String,
    /// Ratings by subject and realization.
    cells: BTreeMap<(&'a str, &'a str), Vec<f64>>,
    subjects: Vec<&'a str>,
}

impl<'a> Scene<'a> {
    fn of(a: &'a Analysis) -> Self {
        let (mut models, others): (Vec<&Listed>, Vec<&Listed>) = a
            .realizations
            .iter()
            .partition(|m| m.role == Role::Test && m.duplicate_of.is_none());
        models.extend(others);
        let mut cells: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
        // Of more subjects none is drawn.
        let few = a.counts.participants <= MAX_DRAWN;
        let rows = a.rows.iter().filter(|r| few && r.excluded.is_none());
        for row in rows {
            let (subject, model) = (a.subject(row), a.model(row));
            if let (Some(rating), false) = (row.rating, model.is_empty()) {
                let cell = (subject, model);
                cells.entry(cell).or_default().push(rating);
            }
        }
        let mut subjects: Vec<&str> = cells.keys().map(|(s, _)| *s).collect();
        subjects.dedup();
        Self {
            a,
            models,
            asked: super::asked(a).trim_start_matches("the ").to_owned(),
            cells,
            subjects,
        }
    }

    /// Whether the realizations can be drawn one by one.
    fn drawable(&self) -> bool {
        (1..=MAX_DRAWN).contains(&self.models.len())
    }

    /// Whether the subjects can, too.
    fn with_subjects(&self) -> bool {
        self.drawable() && (1..=MAX_DRAWN).contains(&self.subjects.len())
    }

    fn names(&self) -> Vec<String> {
        self.models.iter().map(|m| name(m)).collect()
    }

    fn number(&self, model: &str, what: &str) -> Option<f64> {
        self.a.values.number(&format!("desc/{model}/{what}"))
    }

    /// The scale of the ratings, and what has to be seen beyond it.
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

    /// How the n-th realization looks in every figure.
    fn look(&self, n: usize) -> Look {
        Look::nth(n)
    }
}

fn name(m: &Listed) -> String {
    match (&m.duplicate_of, m.role) {
        (Some(_), _) => format!("{} (repeat)", m.id),
        (None, Role::Test) => m.id.clone(),
        (None, role) => format!("{} ({})", m.id, role.as_str()),
    }
}

/// A figure in both widths; `None` if it cannot be drawn.
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
