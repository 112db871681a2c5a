//! How much of "VAF predicts the rating" hangs on one realization or one participant: `influence/*`.

use super::adjusted::Adjusted;
use super::cells::{Cell, Cells};
use super::record::{ParticipantName, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::correlation::{p_of_r, pearson};
use study_stats::describe::mean;
use study_stats::lmm::CellSummary;
use study_stats::within::Within;

/// Most participants who are left out one after the other.
const MAX_LEFT_OUT: usize = 200;

statistics! {
    /// How much of "VAF predicts the rating" hangs on one realization or one participant.
    pub struct Influence {
        /// of each realization with a VAF, 1/n + (x − x̄)²/Σ(x − x̄)²: 1 if the line goes through its mean whatever that is
        leverage: BTreeMap<RealizationName, Stat>,
        /// p of the relation with VAF with everybody: Pearson's t test or, where not all means are equally precise, `corr_adjusted/trend`
        p_with_all: Stat,
        /// the same without each participant (up to 200 of them)
        p_without: BTreeMap<ParticipantName, Stat>,
    }
}

pub(super) fn influence(cells: &Cells<'_>, adjusted: &Adjusted) -> Influence {
    let vaf: Vec<Option<f64>> = adjusted.models.iter().map(|&m| cells.vaf[m]).collect();
    let participants = adjusted.design.participants;
    let own: Vec<&[Cell]> = (cells.cells.chunk_by(|a, b| a.subject == b.subject)).collect();
    let leaves_out = (2..=MAX_LEFT_OUT).contains(&participants);
    let p_without = own.iter().filter(|_| leaves_out).map(|left_out| {
        let subject = left_out[0].subject;
        let p = p_of_vaf(cells, adjusted, &vaf, Some(subject));
        let name = ParticipantName::from(cells.subject_name(subject));
        (
            name,
            Stat::or(p, "without this participant there is no test"),
        )
    });
    Influence {
        leverage: leverage(cells, &adjusted.models, &vaf),
        p_with_all: Stat::or(p_of_vaf(cells, adjusted, &vaf, None), "there is no test"),
        p_without: p_without.collect(),
    }
}

fn leverage(
    cells: &Cells<'_>,
    models: &[usize],
    vaf: &[Option<f64>],
) -> BTreeMap<RealizationName, Stat> {
    let known: Vec<f64> = vaf.iter().copied().flatten().collect();
    let Some(middle) = mean(&known) else {
        return BTreeMap::new();
    };
    let squares: f64 = known.iter().map(|x| (x - middle).powi(2)).sum();
    let of = |x: f64| 1.0 / known.len() as f64 + (x - middle).powi(2) / squares;
    let all = models
        .iter()
        .zip(vaf)
        .filter_map(|(&m, x)| Some((m, (*x)?)));
    all.map(|(m, x)| {
        let found = Some(of(x)).filter(|h| h.is_finite());
        let leverage = Stat::or(found, "all realizations have the same VAF");
        (cells.model_name(m).into(), leverage)
    })
    .collect()
}

/// p of the relation with VAF without a participant.
fn p_of_vaf(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    vaf: &[Option<f64>],
    without: Option<usize>,
) -> Option<f64> {
    let models = &adjusted.models;
    let kept = |c: &&Cell| Some(c.subject) != without && models.binary_search(&c.model).is_ok();
    let kept = cells.cells.iter().filter(kept);
    if adjusted.is_balanced(vaf) && adjusted.design.is_complete() {
        let mut sums = vec![(0.0, 0.0); models.len()];
        for cell in kept {
            let (sum, n) = &mut sums[models.binary_search(&cell.model).ok()?];
            (*sum, *n) = (*sum + cell.mean, *n + 1.0);
        }
        let points = sums.iter().zip(vaf);
        let (x, y): (Vec<f64>, Vec<f64>) = points
            .filter_map(|((sum, n), x)| Some(((*x)?, sum / n)))
            .unzip();
        let r = pearson(&x, &y).filter(|_| x.len() >= 3)?;
        return p_of_r(r, x.len() as f64 - 2.0);
    }
    let kept: Vec<CellSummary> = kept.filter_map(Cell::summary).collect();
    let within = Within::of(&kept).ok()?;
    let place = |m: &usize| models.binary_search(m).ok();
    let vaf: Vec<Option<f64>> = (within.realizations.iter())
        .map(|m| place(m).and_then(|at| vaf[at]))
        .collect();
    within.trend(&vaf)?.p
}
