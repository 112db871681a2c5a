//! The trials of a part of ranking: each presents all realizations, in an order of its own.

use super::sequence::Sequence;
use super::{Planned, ScheduleError};
use crate::protocol::{Ranking, Seat, Stimuli};
use study_base::rng::Stream;
use study_base::text::PartId;

/// The trials of a seat: the blocks of a sequence in which each block has each realization once.
pub(super) fn ranked(sequence: &Sequence, seat: Seat) -> Result<Vec<Planned>, ScheduleError> {
    let models = sequence.models();
    let order = sequence.valid_order(seat)?;
    let trial = |(repetition, set): (u32, &[usize])| Planned {
        block: repetition,
        stimuli: Stimuli::Set {
            set: set.iter().map(|at| models[*at].clone()).collect(),
        },
        repetition,
    };
    let sets = order.chunks(models.len().max(1));
    Ok((1..).zip(sets).map(trial).collect())
}

/// The practice trials: each an order that is drawn.
pub(super) fn practiced(seed: u64, part: &PartId, own: &Ranking, seat: Seat) -> Vec<Stimuli> {
    let number = seat.number().to_string();
    let path = [
        "schedule",
        "part",
        part.as_str(),
        "practice",
        seat.stream(),
        &number,
    ];
    let mut stream = Stream::new(seed, &path);
    let one = |_| {
        let mut set = own.models.clone();
        stream.shuffle(&mut set);
        Stimuli::Set { set }
    };
    (0..own.practice).map(one).collect()
}
