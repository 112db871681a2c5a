//! Which answers of the parts of a study count, decided as for ratings.

use super::excluded;
use super::part_data::{Intervals, StudyData};
use crate::analyze::exclude::{self, Applied};
use crate::analyze::select::{Include, Whose, state_counts};
use std::collections::BTreeSet;
use study_base::text::ParticipantId;
use study_plan::protocol::{Exclusion, Part};
use study_session::outcome::fold::History;
use study_session::outcome::ratings::Origin;
use study_session::outcome::{RatingRow, Status};

/// Whose answers count, before exclusion rules.
#[derive(Debug)]
pub(super) struct Counting<'a> {
    whose: Whose,
    left_out: BTreeSet<&'a ParticipantId>,
}

/// The trials of a part.
#[derive(Debug)]
pub(super) struct PartRows<'a> {
    /// Those that count before exclusion rules.
    pub(super) all: Vec<&'a RatingRow>,
    /// Those that count after them.
    pub(super) kept: Vec<&'a RatingRow>,
    /// The effect of each rule.
    pub(super) exclusions: Vec<Applied>,
}

fn origin(row: &RatingRow) -> Origin {
    Origin::of(row.simulated, row.pilot)
}

impl<'a> Counting<'a> {
    /// Those of real participants, unless others are included or there are no real ones.
    pub(super) fn of(study: &StudyData<'a>, include: Include) -> Self {
        let origins: Vec<Origin> = study.rows.iter().map(origin).collect();
        let unfinished = study.protocol.analysis.unfinished;
        let left_out = study.participants.iter();
        let left_out = left_out.filter(|p| !state_counts(p.state, unfinished));
        Self {
            whose: Whose::of(&origins, include),
            left_out: left_out.map(|p| &p.participant).collect(),
        }
    }

    /// Whether the answer of a trial counts.
    pub(super) fn row(&self, row: &RatingRow) -> bool {
        let counts = self.whose.counts(origin(row)) && !self.left_out.contains(&row.participant);
        counts && !row.practice && row.status == Status::Ok
    }

    /// Whether a session counts. One that did not start is nobody's.
    pub(super) fn session(&self, history: &History) -> bool {
        history.start().is_some_and(|start| {
            let origin = Origin::of(start.seat.is_simulated(), start.seat.is_pilot());
            self.whose.counts(origin) && !self.left_out.contains(&start.participant)
        })
    }

    /// The trials of a part, without those that exclusion rules exclude.
    pub(super) fn of_part(
        study: &StudyData<'_>,
        part: &Part,
        rows: &[&'a RatingRow],
        intervals: &Intervals<'_>,
        rules: &[Exclusion],
    ) -> PartRows<'a> {
        let of_part = |r: &&&RatingRow| r.part.as_ref() == Some(&part.id);
        let all: Vec<&RatingRow> = rows.iter().filter(of_part).copied().collect();
        let judged = excluded::trials((study.protocol, part), &all, intervals);
        let (excluded_by, exclusions) = exclude::apply(rules, &judged);
        let kept = (all.iter().zip(&excluded_by)).filter(|(_, rule)| rule.is_none());
        PartRows {
            kept: kept.map(|(row, _)| *row).collect(),
            all,
            exclusions,
        }
    }
}
