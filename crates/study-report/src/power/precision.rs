//! How precisely the thresholds of tracks are found.

use super::Report;
use crate::apa;
use crate::text::layout::{Paint, pad};
use serde_json::{Value, json};
use study_analysis::power::{Cell, Estimates, PartWorld, Precision, Quality};

/// What an interval is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum About {
    /// A participant's threshold in a condition.
    Participant,
    /// The mean threshold in the first condition.
    Mean,
    /// The last condition against the first.
    Contrast,
}

impl About {
    /// With their names, as in flags and documents.
    pub const ALL: [(Self, &'static str); 3] = [
        (Self::Participant, "participant"),
        (Self::Mean, "mean"),
        (Self::Contrast, "contrast"),
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Participant => "participant",
            Self::Mean => "mean",
            Self::Contrast => "contrast",
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Participant => "a participant's threshold",
            Self::Mean => "the mean threshold",
            Self::Contrast => "last against first",
        }
    }

    fn of(self, estimates: &Estimates) -> &Quality {
        match self {
            Self::Participant => &estimates.participant,
            Self::Mean => &estimates.mean,
            Self::Contrast => &estimates.contrast,
        }
    }
}

/// A precision that is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Of what.
    pub about: About,
    /// Half the 95 % interval: a factor above 1 where levels have ratios, else levels.
    pub within: f64,
}

/// Whether the levels of the tracks have ratios; `None` without tracks.
pub(super) fn has_ratios(report: &Report) -> Option<bool> {
    match &report.plan.settings.part {
        Some(PartWorld::Tracks(tracks)) => Some(tracks.ratios),
        _ => None,
    }
}

/// `× 1.62`, or `± 0.12` where levels have no ratios.
pub(super) fn half_width(half: f64, ratios: bool) -> String {
    if ratios {
        format!("× {}", apa::number(libm::exp(half), 2))
    } else {
        format!("± {}", apa::number(half, 3))
    }
}

/// The typical error, the root of the mean square, with its Monte Carlo error.
pub(super) fn typical(quality: &Quality, ratios: bool) -> String {
    let (Some(rms), error) = (quality.rms(), quality.rms_error()) else {
        return "–".to_owned();
    };
    let (shown, unit, decimals) = match ratios {
        true => (libm::exp(rms), libm::exp(rms), 2),
        false => (rms, 1.0, 3),
    };
    let sign = if ratios { "× " } else { "" };
    let error = error.map_or(String::new(), |error| {
        format!(" ± {}", apa::number(error * unit, decimals))
    });
    format!("{sign}{}{error}", apa::number(shown, decimals))
}

/// The designs with their precision, in the order in which they are shown.
pub(super) fn known(report: &Report) -> Vec<(Cell, &Precision)> {
    let of = |cell: Cell| Some((cell, report.result(&cell)?.precision.as_ref()?));
    report.shown().into_iter().filter_map(of).collect()
}

/// The table of the page; empty without thresholds.
pub(super) fn table(report: &Report, paint: Paint) -> String {
    let (Some(ratios), known) = (has_ratios(report), known(report)) else {
        return String::new();
    };
    if known.is_empty() {
        return String::new();
    }
    let mut out = paint.dim(&format!(
        "\n{:<26}{:>7}{:>7}  {:<9}{:<15}  {:<10}{}\n",
        "precision", "partic.", "trials", "alone", "error", "together", "error"
    ));
    for (about, _) in About::ALL {
        for (cell, precision) in &known {
            let [alone, together] = [&precision.alone, &precision.together].map(|e| about.of(e));
            let Some(half) = alone.half.mean() else {
                continue;
            };
            let trials = precision.trials.mean().unwrap_or_default();
            let mark = if *cell == report.plan.own { "*" } else { " " };
            let mut line = format!(
                "{:<26}{:>6}{mark}{:>7}  {}{}",
                about.in_words(),
                cell.participants,
                apa::number(trials, 1),
                pad(&half_width(half, ratios), 9),
                pad(&typical(alone, ratios), 15),
            );
            if let Some(half) = together.half.mean() {
                line += &format!(
                    "  {}{}",
                    pad(&half_width(half, ratios), 10),
                    typical(together, ratios)
                );
            }
            out += &(line.trim_end().to_owned() + "\n");
        }
    }
    out
}

/// What the columns of the table are.
pub(super) fn legend(report: &Report) -> Option<String> {
    let ratios = has_ratios(report)?;
    let precision = report.result(&report.plan.own)?.precision.as_ref()?;
    let pooled = precision.together.participant.square.studies;
    let shown = if ratios {
        "× 1.5 is a 95 % interval from two thirds to one and a half times the estimate"
    } else {
        "± is half the 95 % interval, in levels"
    };
    let together = if pooled > 0 {
        format!(
            " together: the pooled model, in the first {pooled} studies of a design{}.",
            match precision.not_converged {
                0 => String::new(),
                n => format!(" ({n} more did not converge)"),
            }
        )
    } else {
        String::new()
    };
    Some(format!(
        "{shown}; error is the typical distance of the estimate from the truth (root mean square) ± its Monte \
         Carlo error. alone: each function by itself, which is what decides.{together}"
    ))
}

/// The precision of a design, for the document.
pub(super) fn value(precision: &Precision) -> Value {
    let quality = |q: &Quality| {
        json!({
            "studies": q.square.studies,
            "half_width": q.half.mean(),
            "half_width_mcse": q.half.error(),
            "rms": q.rms(),
            "rms_mcse": q.rms_error(),
            "bias": q.error.mean(),
            "bias_mcse": q.error.error(),
            "coverage": q.holds.mean(),
            "coverage_mcse": q.holds.error(),
        })
    };
    let estimates = |e: &Estimates| {
        let all = About::ALL.into_iter();
        let known = all.filter(|(about, _)| about.of(e).square.studies > 0);
        known
            .map(|(about, name)| (name.to_owned(), quality(about.of(e))))
            .collect::<serde_json::Map<_, _>>()
    };
    json!({
        "trials": precision.trials.mean(),
        "alone": estimates(&precision.alone),
        "together": estimates(&precision.together),
        "not_converged": precision.not_converged,
    })
}

/// A design that can be chosen for a precision.
pub(super) struct Candidate<'a> {
    /// The design.
    pub(super) cell: Cell,
    /// Its precision.
    pub(super) precision: &'a Precision,
    /// What each participant spends, in minutes or in trials.
    pub(super) cost: f64,
    /// In words.
    pub(super) name: String,
}

/// The design that reaches a precision with the least time of all participants together.
pub(super) struct Cheapest {
    /// Its name.
    pub(super) name: String,
    /// Its participants.
    pub(super) participants: usize,
    /// Half its interval.
    pub(super) half: f64,
}

/// The cheapest of some designs, of the estimates of this kind.
pub(super) fn cheapest(
    wanted: &Wanted,
    ratios: bool,
    of: fn(&Precision) -> &Estimates,
    candidates: &[Candidate<'_>],
) -> Option<Cheapest> {
    let most = if ratios {
        libm::log(wanted.within)
    } else {
        wanted.within
    };
    let reached = candidates.iter().filter_map(|one| {
        let half = wanted.about.of(of(one.precision)).half.mean()?;
        let cost = one.cost * one.cell.participants as f64;
        (half <= most).then_some((cost, one, half))
    });
    let (_, best, half) = reached.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Cheapest {
        name: best.name.clone(),
        participants: best.cell.participants,
        half,
    })
}

/// Sentences on what reaches the precisions that are wanted.
pub(super) fn sentences(
    wanted: &[Wanted],
    ratios: bool,
    candidates: &[Candidate<'_>],
) -> Vec<String> {
    let mut found = Vec::new();
    for one in wanted {
        let goal = if ratios {
            format!("× {}", apa::number(one.within, 2))
        } else {
            format!("± {}", apa::number(one.within, 3))
        };
        for (name, of) in KINDS {
            let known = |c: &Candidate<'_>| one.about.of(of(c.precision)).half.studies > 0;
            if !candidates.iter().any(known) {
                continue;
            }
            let about = one.about.in_words();
            found.push(match cheapest(one, ratios, of, candidates) {
                Some(best) => format!(
                    "{about} within {goal}, {name}: {} participants, {} ({})",
                    best.participants,
                    best.name,
                    half_width(best.half, ratios)
                ),
                None => {
                    format!("{about} within {goal}, {name}: not reached by the designs compared")
                }
            });
        }
    }
    found
}

type Kind = (&'static str, fn(&Precision) -> &Estimates);

/// Both analyses.
pub(super) const KINDS: [Kind; 2] = [
    ("alone", |precision| &precision.alone),
    ("together", |precision| &precision.together),
];

/// What reaches the precisions that are wanted, for the document.
pub(super) fn wanted_values(
    wanted: &[Wanted],
    ratios: bool,
    candidates: &[Candidate<'_>],
) -> Vec<Value> {
    let one = |wanted: &Wanted, (name, of): Kind| {
        let best = cheapest(wanted, ratios, of, candidates);
        json!({
            "about": wanted.about.as_str(),
            "within": wanted.within,
            "analysis": name,
            "design": best.as_ref().map(|b| b.name.clone()),
            "participants": best.as_ref().map(|b| b.participants),
            "half_width": best.as_ref().map(|b| b.half),
        })
    };
    (wanted.iter())
        .flat_map(|w| KINDS.into_iter().map(move |kind| (w, kind)))
        .map(|(w, kind)| one(w, kind))
        .collect()
}

/// The designs of a report as candidates; what they cost is trials.
pub(super) fn candidates(report: &Report) -> Vec<Candidate<'_>> {
    let mut found = Vec::new();
    for (cell, precision) in known(report) {
        let trials = precision.trials.mean().unwrap_or_default();
        found.push(Candidate {
            cell,
            precision,
            cost: trials,
            name: format!("{} trials each", apa::number(trials, 1)),
        });
    }
    found
}
