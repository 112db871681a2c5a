//! Whose rows are exported, under which ids.

use super::{ExportError, Options, Source};
use chrono::{DateTime, FixedOffset};
use std::collections::{BTreeMap, BTreeSet};
use study_base::hex::Digest;
use study_base::sort::SmallSort as _;
use study_base::text::ParticipantId;
use study_plan::protocol::Answer;
use study_session::outcome::ratings::Origin;
use study_session::outcome::{IntervalRow, ParticipantRow, RatingRow, State};

/// The highest age that is written; higher ones are written as this.
pub(super) const OLDEST: f64 = 89.0;

/// The rows of a data set.
#[derive(Debug, Clone)]
pub(super) struct Selected {
    pub(super) rows: Vec<RatingRow>,
    pub(super) participants: Vec<ParticipantRow>,
    pub(super) intervals: Vec<IntervalRow>,
    /// The id in the data set of each participant.
    pub(super) ids: BTreeMap<ParticipantId, ParticipantId>,
    /// Ages that were above [`OLDEST`].
    pub(super) ages_cut: usize,
    whose: Origin,
}

/// Whether a question asks for the age.
pub(super) fn is_age(question: &str) -> bool {
    question.eq_ignore_ascii_case("age")
}

pub(super) fn select(source: &Source<'_>, options: &Options) -> Result<Selected, ExportError> {
    let of_them = |r: &&RatingRow| Origin::of(r.simulated, r.pilot) == options.whose;
    let theirs: Vec<&RatingRow> = source.rows.iter().filter(of_them).collect();
    // A study that only asks questionnaires has no trials.
    let answered = |p: &&ParticipantRow| {
        let whose = Origin::of(p.simulated, p.pilot);
        source.protocol.only_asks() && whose == options.whose && !p.answers.is_empty()
    };
    let asked: Vec<&ParticipantRow> = source.participants.iter().filter(answered).collect();
    let ids: BTreeSet<&ParticipantId> = (theirs.iter().map(|r| &r.participant))
        .chain(asked.iter().map(|p| &p.participant))
        .collect();
    let ids = renamed(&ids, options, source.secrets);
    let mut rows: Vec<RatingRow> = (theirs.into_iter())
        .filter(|r| options.practice || !r.practice)
        .cloned()
        .collect();
    if rows.is_empty() && asked.is_empty() {
        return Err(ExportError::Nobody(options.whose));
    }
    let place = |p: &ParticipantId, session: u32, trial: u32| (p.clone(), session, trial);
    let kept: BTreeSet<_> = (rows.iter())
        .map(|r| place(&r.participant, r.session, r.trial))
        .collect();
    let mut participants: Vec<ParticipantRow> = (source.participants.iter())
        .filter(|p| ids.contains_key(&p.participant))
        .cloned()
        .collect();
    let mut intervals: Vec<IntervalRow> = (source.intervals.iter())
        .filter(|i| kept.contains(&place(&i.participant, i.session, i.trial)))
        .cloned()
        .collect();
    let named = (rows.iter_mut().map(|r| &mut r.participant))
        .chain(participants.iter_mut().map(|p| &mut p.participant))
        .chain(intervals.iter_mut().map(|i| &mut i.participant));
    for id in named {
        if let Some(new) = ids.get(id) {
            id.clone_from(new);
        }
    }
    rows.small_sort_by(|a, b| {
        (&a.participant, a.session, a.trial).cmp(&(&b.participant, b.session, b.trial))
    });
    participants.small_sort_by(|a, b| a.participant.cmp(&b.participant));
    intervals.small_sort_by(|a, b| a.participant.cmp(&b.participant));
    let mut ages_cut = 0;
    for participant in &mut participants {
        for (question, answer) in &mut participant.answers {
            if let (true, Answer::Number(age)) = (is_age(question.as_str()), answer) {
                ages_cut += usize::from(*age > OLDEST);
                *age = age.floor().min(OLDEST);
            }
        }
    }
    Ok(Selected {
        rows,
        participants,
        intervals,
        ids,
        ages_cut,
        whose: options.whose,
    })
}

/// The ids of the data set. New ones are in the order of a hash of what only the results
/// folder has: the same each time, and unknown to who has the data set.
fn renamed(
    ids: &BTreeSet<&ParticipantId>,
    options: &Options,
    secrets: &BTreeMap<ParticipantId, String>,
) -> BTreeMap<ParticipantId, ParticipantId> {
    let own = |id: &&ParticipantId| ((*id).clone(), (*id).clone());
    if !options.redact_ids {
        return ids.iter().map(own).collect();
    }
    let secret = |id: &ParticipantId| {
        let mut digest = Digest::default();
        digest.update(b"study export\0");
        digest.update(secrets.get(id).map_or("", String::as_str));
        digest.update(id.as_str());
        digest.finish()
    };
    let mut order: Vec<&ParticipantId> = ids.iter().copied().collect();
    order.small_sort_by_key(|id| secret(id));
    (1..)
        .zip(order)
        .map(|(n, id)| (id.clone(), numbered(n)))
        .collect()
}

fn numbered(n: u32) -> ParticipantId {
    let id = ParticipantId::new(format!("P{n:03}"));
    id.expect("letters and digits")
}

impl Selected {
    /// The last moment of the data, or of the study if no trial was presented.
    pub(super) fn last(&self, source: &Source<'_>) -> Option<DateTime<FixedOffset>> {
        let times = self.rows.iter().flat_map(|r| [r.started_at, r.rated_at]);
        let times = times.flatten().max();
        times.or_else(|| source.versions.first().map(|v| v.at))
    }

    /// The first and last row of the schedule, if fewer real participants have finished
    /// than were planned.
    pub(super) fn interim(&self, planned: u32) -> Option<(u32, u32)> {
        let finished = (self.participants.iter()).filter(|p| p.state == State::Done);
        if self.whose != Origin::Real || finished.count() >= planned as usize {
            return None;
        }
        let rows = || self.participants.iter().filter_map(|p| p.row);
        rows().min().zip(rows().max())
    }

    /// Whether anybody has several sessions.
    pub(super) fn several_sessions(&self) -> bool {
        self.rows.iter().any(|r| r.session > 1)
    }
}
