//! Whether the force was that of the table, in the trials that count: `rendering/*`, and
//! whether what was delivered predicts the rating: `corr_delivered/*`.
//!
//! Verdicts were given in the sessions ([`study_session::rendering`]); nothing is judged here.

use super::adjusted::Adjusted;
use super::cells::Cells;
use super::correlation::Correlation;
use super::record::{ParticipantName, RealizationName, Stat, statistics};
use super::subjects::MAX_LISTED;
use super::{Rules, vaf};
use std::collections::BTreeMap;
use study_session::outcome::Verdict;
use study_session::outcome::ratings::{Felt, Ratings};
use study_stats::describe::{mean, sd};

statistics! {
    /// Trials that count, by the verdict of the session about their force ([devices.md](devices.md)).
    pub struct Judged {
        /// the force was that of the table
        n_ok: Stat,
        /// it was doubtful
        n_flag: Stat,
        /// it was another
        n_fault: Stat,
        /// too little was felt to judge
        n_too_little: Stat,
        /// the device did not report
        n_unverified: Stat,
        /// attempts at these trials that failed because of the force
        n_failed_attempts: Stat,
        /// flag and fault over ok, flag and fault
        share_wrong: Stat,
    }

    /// VAF of the commanded force.
    pub struct RenderedVaf {
        /// mean over the playbacks
        mean: Stat,
        /// lowest
        min: Stat,
    }

    /// Slope of the commanded force.
    pub struct Gain {
        /// mean over the playbacks
        mean: Stat,
        /// lowest
        min: Stat,
        /// highest
        max: Stat,
    }

    /// Share of the time of a playback in which its force was judged.
    pub struct JudgedShare {
        /// mean over the playbacks
        mean: Stat,
        /// lowest
        min: Stat,
    }

    /// Largest difference from the right force that lasted 20 ms in a playback, in just noticeable differences of a force.
    pub struct ErrorJnd {
        /// mean over the playbacks
        mean: Stat,
        /// highest
        max: Stat,
    }

    /// 1 − var(F − F̂)/var(F) on the validation recording, with F̂ the force that the table predicts there, times the gain of the playback and later by its delay (gain of the measured force where there is a sensor, else of the commanded one). With gain 1 and no delay it is the identified VAF. It needs `NAME.csv` beside the protocol, with NAME from `[analysis] vaf`, the hash in the model file and the VAF that the model file states.
    pub struct DeliveredVaf {
        /// mean over the playbacks
        mean: Stat,
        /// n − 1
        sd: Stat,
    }

    /// The playbacks of a realization.
    pub struct Playbacks {
        /// by verdict
        judged: Judged as "",
        /// VAF of the commanded force
        rendered_vaf: RenderedVaf,
        /// slope of the commanded force
        gain: Gain,
        /// VAF of what was delivered
        delivered_vaf: DeliveredVaf,
        /// share of the time that was judged
        judged_share: JudgedShare,
        /// largest difference, in just noticeable ones
        error_jnd: ErrorJnd,
    }

    /// Whether the force was that of the table, where trials say what was felt.
    pub struct Rendering {
        /// of all trials
        judged: Judged as "rendering",
        /// of a realization
        realizations: BTreeMap<RealizationName, Playbacks> as "rendering",
        /// of a participant
        participants: BTreeMap<ParticipantName, Judged> as "rendering_subject",
        /// as `corr_adjusted/pearson`, with the mean delivered VAF of each realization in place of the identified one
        correlation: Correlation as "corr_delivered",
    }
}

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

    fn judged(self) -> Judged {
        let judged = self.ok + self.flag + self.fault;
        let wrong = (self.flag + self.fault) as f64;
        let share = (judged > 0).then(|| wrong / judged as f64);
        Judged {
            n_ok: Stat::count(self.ok),
            n_flag: Stat::count(self.flag),
            n_fault: Stat::count(self.fault),
            n_too_little: Stat::count(self.too_little),
            n_unverified: Stat::count(self.unverified),
            n_failed_attempts: Stat::count(self.failed as usize),
            share_wrong: Stat::or(share, NOT_JUDGED),
        }
    }
}

pub(super) fn rendering(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    rules: &Rules,
) -> Option<Rendering> {
    let ratings = cells.ratings;
    if !is_known(ratings) {
        return None;
    }
    let rows = || (0..ratings.len()).filter_map(|i| Some((i, ratings.felt(i)?)));
    let mut delivered = vec![None; ratings.models.len()];
    let mut realizations = BTreeMap::new();
    for (m, model) in ratings.models.iter().enumerate() {
        let own: Vec<&Felt> = (rows())
            .filter(|(i, _)| ratings.model[*i] == Some(m as u32))
            .map(|(_, felt)| felt)
            .collect();
        realizations.insert(model.id.as_str().into(), playbacks(&own));
        delivered[m] = mean(&all(&own, |f| f.delivered_vaf));
    }
    let listed = ratings.subjects.len() <= MAX_LISTED;
    let participants = ratings.subjects.iter().enumerate().filter(|_| listed);
    let participants = participants.map(|(s, subject)| {
        let own = rows().filter(|(i, _)| ratings.subject[*i] as usize == s);
        let judged = Verdicts::of(own.map(|(_, felt)| felt)).judged();
        (subject.id.as_str().into(), judged)
    });
    Some(Rendering {
        judged: Verdicts::of(rows().map(|(_, felt)| felt)).judged(),
        realizations,
        participants: participants.collect(),
        correlation: vaf::against_delivered(cells, adjusted, &delivered, rules),
    })
}

/// The playbacks of a realization that have a number.
fn all(own: &[&Felt], of: impl Fn(&Felt) -> Option<f64>) -> Vec<f64> {
    own.iter().filter_map(|felt| of(felt)).collect()
}

fn playbacks(own: &[&Felt]) -> Playbacks {
    let (vaf, gain) = (all(own, |f| f.rendered_vaf), all(own, |f| f.gain));
    let (judged, jnd) = (all(own, |f| f.judged_share), all(own, |f| f.error_jnd));
    let most = |x: &[f64]| x.iter().copied().reduce(f64::max);
    let least = |x: &[f64]| x.iter().copied().reduce(f64::min);
    let delivered = all(own, |f| f.delivered_vaf);
    let why = match delivered[..] {
        [] => NO_RECORDING,
        _ => "a single playback",
    };
    Playbacks {
        judged: Verdicts::of(own.iter().copied()).judged(),
        rendered_vaf: RenderedVaf {
            mean: Stat::or(mean(&vaf), NOT_JUDGED),
            min: Stat::or(least(&vaf), NOT_JUDGED),
        },
        gain: Gain {
            mean: Stat::or(mean(&gain), NOT_JUDGED),
            min: Stat::or(least(&gain), NOT_JUDGED),
            max: Stat::or(most(&gain), NOT_JUDGED),
        },
        delivered_vaf: DeliveredVaf {
            mean: Stat::or(mean(&delivered), NO_RECORDING),
            sd: Stat::or(sd(&delivered), why),
        },
        judged_share: JudgedShare {
            mean: Stat::or(mean(&judged), NOT_KNOWN),
            min: Stat::or(least(&judged), NOT_KNOWN),
        },
        error_jnd: ErrorJnd {
            mean: Stat::or(mean(&jnd), NOT_KNOWN),
            max: Stat::or(most(&jnd), NOT_KNOWN),
        },
    }
}

const NOT_JUDGED: &str = "no playback was judged";
const NOT_KNOWN: &str = "no playback was judged by a release that computes it";

/// Why there is no delivered VAF.
pub(super) const NO_RECORDING: &str = "no playback has a delivered VAF: it needs the validation recording in the folder of the protocol";
