//! Whether the force was that of the table, in the trials that count: `rendering/*`, and
//! whether what was delivered predicts the rating: `corr_delivered/*`.
//!
//! Verdicts were given in the sessions ([`crate::rendering`]); nothing is judged here.

use super::adjusted::Adjusted;
use super::cells::Cells;
use super::identifiers::group_id;
use super::subjects::MAX_LISTED;
use super::values::Values;
use super::{Rules, vaf};
use crate::outcome::Verdict;
use crate::outcome::ratings::{Felt, Ratings};
use study_stats::describe::{mean, sd};

/// Whether any trial says what was felt. Samples, sounds and other presentations without
/// tables have no VAF, and nothing of them can be verified: the question is not asked.
pub(super) fn is_known(ratings: &Ratings) -> bool {
    let mut felt = (0..ratings.len()).filter_map(|i| ratings.felt(i));
    let has_vaf = ratings.vaf.iter().any(Option::is_some);
    felt.any(|felt| has_vaf || felt.verdict != Verdict::Unverified)
}

/// Number of trials with each verdict, and of failed attempts.
#[derive(Debug, Clone, Copy, Default)]
struct Verdicts {
    ok: usize,
    flag: usize,
    fault: usize,
    too_little: usize,
    unverified: usize,
    failed: u32,
}

impl Verdicts {
    fn of<'a>(all: impl Iterator<Item = &'a Felt>) -> Self {
        let mut counts = Self::default();
        for felt in all {
            *match felt.verdict {
                Verdict::Ok => &mut counts.ok,
                Verdict::Flag => &mut counts.flag,
                Verdict::Fault => &mut counts.fault,
                Verdict::TooLittle => &mut counts.too_little,
                Verdict::Unverified => &mut counts.unverified,
            } += 1;
            counts.failed += felt.failed;
        }
        counts
    }

    fn put(self, id: &str, values: &mut Values) {
        let judged = self.ok + self.flag + self.fault;
        let mut g = values.group(id, "no playback was judged");
        for (name, n) in [
            ("n_ok", self.ok),
            ("n_flag", self.flag),
            ("n_fault", self.fault),
            ("n_too_little", self.too_little),
            ("n_unverified", self.unverified),
            ("n_failed_attempts", self.failed as usize),
        ] {
            g.put(name, n as f64);
        }
        let wrong = (self.flag + self.fault) as f64;
        g.maybe("share_wrong", (judged > 0).then(|| wrong / judged as f64));
    }
}

pub(super) fn rendering(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    rules: &Rules,
    values: &mut Values,
) {
    let ratings = cells.ratings;
    if !is_known(ratings) {
        return;
    }
    let rows = || (0..ratings.len()).filter_map(|i| Some((i, ratings.felt(i)?)));
    Verdicts::of(rows().map(|(_, felt)| felt)).put("rendering", values);
    let mut delivered = vec![None; ratings.models.len()];
    for (m, model) in ratings.models.iter().enumerate() {
        let own: Vec<&Felt> = (rows())
            .filter(|(i, _)| ratings.model[*i] == Some(m as u32))
            .map(|(_, felt)| felt)
            .collect();
        let id = group_id("rendering", &[&model.id]);
        Verdicts::of(own.iter().copied()).put(&id, values);
        let all = |of: fn(&Felt) -> Option<f64>| -> Vec<f64> {
            own.iter().filter_map(|felt| of(felt)).collect()
        };
        let (vaf, gain) = (all(|f| f.rendered_vaf), all(|f| f.gain));
        let mut g = values.group(id, "no playback was judged");
        g.maybe("rendered_vaf/mean", mean(&vaf));
        g.maybe("rendered_vaf/min", vaf.iter().copied().reduce(f64::min));
        g.maybe("gain/mean", mean(&gain));
        g.maybe("gain/min", gain.iter().copied().reduce(f64::min));
        g.maybe("gain/max", gain.iter().copied().reduce(f64::max));
        let found = all(|f| f.delivered_vaf);
        delivered[m] = mean(&found);
        g.put_or("delivered_vaf/mean", delivered[m], NO_RECORDING);
        let why = match delivered[m] {
            Some(_) => "a single playback",
            None => NO_RECORDING,
        };
        g.put_or("delivered_vaf/sd", sd(&found), why);
    }
    if ratings.subjects.len() <= MAX_LISTED {
        for (s, subject) in ratings.subjects.iter().enumerate() {
            let own = rows().filter(|(i, _)| ratings.subject[*i] as usize == s);
            let id = group_id("rendering_subject", &[&subject.id]);
            Verdicts::of(own.map(|(_, felt)| felt)).put(&id, values);
        }
    }
    vaf::against_delivered(cells, adjusted, &delivered, rules, values);
}

/// Why there is no delivered VAF.
pub(super) const NO_RECORDING: &str = "no playback has a delivered VAF: it needs the validation recording in the folder of the protocol";
