//! The order of a participant's trials.
//!
//! A [`Planner`] is made once per protocol and gives the order of any seat. The
//! order depends only on seed, design and seat and is the same on every machine and
//! in every version; `docs/schedule.md` specifies it so that another language can
//! reproduce it, and golden tests protect it.
//!
//! `store` decides which participant gets which row; `session` decides when a trial
//! takes place and calls [`requeue`] for a failed one.
//!
//! Invariant: no order from this module violates `max_run` or `min_distance`. Random
//! orders are drawn exactly uniformly from the valid ones. Orders that are given
//! (Williams, Latin square, fixed, file) are verified; a violation is an error. Both
//! constraints hold over all trials that count, also across blocks; practice is
//! exempt.
//!
//! Positions count from 1.

mod adjustment;
pub mod balance;
mod completions;
pub mod constraints;
mod inclusion;
pub mod orders;
mod pairs;
mod ranking;
mod requeue;
mod search;
mod sequence;
mod similarity;
mod tracks;

pub use crate::protocol::{Seat, Trial};
pub use requeue::{Felt, Requeued, breaks_constraint, requeue};

use crate::protocol::{
    Drawn, FileOrders, Identification, Magnitude, Mushra, Occasion, Order, PartsOrder, Protocol,
    Stimuli, Task,
};
use adjustment::AdjustmentOrders;
use constraints::Violation;
use pairs::PairOrders;
use search::SearchOrders;
use sequence::Sequence;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};
use tracks::TrackOrders;

/// Most trials of a session; more are probably a typing error.
pub const MAX_TRIALS: u64 = 10_000;

/// Why there is no order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ScheduleError {
    /// There is no realization to schedule.
    #[error("no realization to schedule: all models have the role practice")]
    NoRealizations,
    /// There are no repetitions.
    #[error("repetitions = 0 schedules no trial")]
    NoRepetitions,
    /// More than [`MAX_TRIALS`] trials.
    #[error(
        "{realizations} realizations × {repetitions} repetitions are {trials} trials; at most {MAX_TRIALS} are possible"
    )]
    TooLong {
        /// Realizations that are scheduled.
        realizations: usize,
        /// Trials of each.
        repetitions: u32,
        /// All trials.
        trials: u64,
    },
    /// More than [`MAX_TRIALS`] trials of tracks.
    #[error("the tracks of `{part}` have up to {trials} trials; at most {MAX_TRIALS} are possible")]
    LongTracks {
        /// The part.
        part: PartId,
        /// All trials.
        trials: u64,
    },
    /// `max_run = 0`
    #[error("max_run = 0 allows no trial at all")]
    MaxRunZero,
    /// `min_distance` exceeds the number of realizations.
    #[error(
        "min_distance = {min_distance} needs at least {min_distance} realizations, there are {realizations}"
    )]
    MinDistance {
        /// The constraint.
        min_distance: u32,
        /// Realizations that are scheduled.
        realizations: usize,
    },
    /// `max_run` with a single realization.
    #[error(
        "max_run = {max_run} cannot hold: the only realization has {repetitions} trials in a row"
    )]
    MaxRun {
        /// The constraint.
        max_run: u32,
        /// Trials of the only realization.
        repetitions: u32,
    },
    /// Counting the valid orders needs too much memory.
    #[error(
        "the orders of {realizations} realizations × {repetitions} repetitions, shuffled with {constraint}, are too many to count"
    )]
    TooManyStates {
        /// Realizations that are scheduled.
        realizations: usize,
        /// Trials of each.
        repetitions: u32,
        /// Such as `max_run = 2`.
        constraint: String,
    },
    /// Rows, pilots and simulated participants are numbered from 1.
    #[error("there is no {0}: numbers start at 1")]
    SeatZero(Seat),
    /// A given order violates a constraint.
    #[error("{seat}, {violation}")]
    Broken {
        /// The seat of the order.
        seat: Seat,
        /// The violation.
        violation: Violation,
    },
    /// The order comes from a file that was not passed.
    #[error("the order comes from a file, which was not read")]
    NoOrders,
    /// The file of orders lacks the row.
    #[error("the file of orders has no row {row}")]
    NoRow {
        /// The row.
        row: u32,
    },
    /// A row of the file has the wrong length.
    #[error("the file of orders, row {row}: {found} positions instead of {expected}")]
    WrongLength {
        /// Row of the file.
        row: u32,
        /// Positions in the file.
        found: usize,
        /// Realizations × repetitions.
        expected: usize,
    },
    /// A row of the file names an id that is not a scheduled realization.
    #[error(
        "the file of orders, row {row}, position {position}: `{model}` is not a scheduled realization"
    )]
    UnknownModel {
        /// Row of the file.
        row: u32,
        /// Position in it, from 1.
        position: usize,
        /// The id.
        model: ModelId,
    },
    /// A row of the file has the wrong number of trials of a realization.
    #[error(
        "the file of orders, row {row}: `{model}` occurs {found} times, but repetitions = {expected}"
    )]
    WrongCount {
        /// Row of the file.
        row: u32,
        /// The realization.
        model: ModelId,
        /// Its trials in the file.
        found: u32,
        /// `repetitions`
        expected: u32,
    },
    /// A row of the file comes back to a realization after which a questionnaire was to be asked.
    #[error(
        "the file of orders, row {row}, position {position}: `{model}` comes again after others, and a questionnaire is asked after each condition"
    )]
    Interleaved {
        /// Row of the file.
        row: u32,
        /// Position in it, from 1.
        position: usize,
        /// The realization.
        model: ModelId,
    },
}

impl ScheduleError {
    /// What to do, if the message does not say it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::MinDistance { .. } => Some("lower min_distance or add realizations"),
            Self::MaxRun { .. } => Some("add a realization or leave max_run out"),
            Self::MaxRunZero => Some("max_run = 1 forbids the same realization twice in a row"),
            Self::TooManyStates { .. } => {
                Some("take order = \"blocked\", fewer repetitions or a smaller min_distance")
            }
            Self::Broken { .. } => {
                Some("leave the constraint out, or take a random order (blocked, shuffled)")
            }
            Self::NoRow { .. } => Some("add the row to the file; rows are numbered from 1"),
            Self::UnknownModel { .. } => {
                Some("use the ids of [[models]] whose role is not practice")
            }
            Self::TooLong { .. } => Some("lower repetitions"),
            Self::Interleaved { .. } => Some(
                "bring the trials of each realization together, or take order = \"blocked\", which asks in each block",
            ),
            Self::NoRealizations
            | Self::NoRepetitions
            | Self::SeatZero(_)
            | Self::NoOrders
            | Self::WrongLength { .. }
            | Self::LongTracks { .. }
            | Self::WrongCount { .. } => None,
        }
    }
}

/// The order of one seat: practice first, then every trial that counts.
///
/// For several seats, make a [`Planner`] once.
///
/// ```
/// # use study_plan::protocol::{Seat, example};
/// # use study_plan::schedule::{ScheduleError, plan};
/// let trials = plan(&example::protocol(4, 2), None, Seat::Row(1))?;
/// // Blocked: each realization once in the first four trials.
/// let mut first: Vec<_> = trials[..4].iter().filter_map(|trial| trial.model()).collect();
/// first.sort();
/// assert_eq!(first.iter().map(|id| id.as_str()).collect::<String>(), "ABCD");
/// # Ok::<(), ScheduleError>(())
/// ```
///
/// # Errors
/// [`ScheduleError`] if the design is infeasible, or the given order of this seat
/// is incomplete or breaks a constraint.
pub fn plan(
    protocol: &Protocol,
    orders: Option<&FileOrders>,
    seat: Seat,
) -> Result<Vec<Trial>, ScheduleError> {
    Planner::new(protocol, orders)?.plan(seat)
}

/// Makes the orders of a study.
#[derive(Debug)]
pub struct Planner {
    parts_order: PartsOrder,
    parts: Vec<PartOrders>,
}

/// Makes the orders of one part, or of a study without parts.
#[derive(Debug)]
struct PartOrders {
    part: Option<PartId>,
    practice: Vec<ModelId>,
    /// How often practice comes at most, and how it is drawn; `None`: once, as listed.
    rounds: Option<(u32, Drawn)>,
    seed: u64,
    /// Felt before each realization.
    reference: Option<ModelId>,
    /// What it is about, if its practice is drawn from that.
    drawn: Option<Task>,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Rating(Sequence),
    Pairs(PairOrders),
    Tracks(TrackOrders),
    Search(SearchOrders),
    Ranking(Sequence),
    Adjustment(AdjustmentOrders),
}

/// A trial of a part before it is numbered.
#[derive(Debug)]
struct Planned {
    /// Block of the part, from 1.
    block: u32,
    stimuli: Stimuli,
    repetition: u32,
}

impl Planner {
    /// Checks the design and prepares drawing.
    ///
    /// `orders` is the content of the file of `order = { file = … }`.
    ///
    /// # Errors
    /// [`ScheduleError`] if no seat can have an order.
    pub fn new(protocol: &Protocol, orders: Option<&FileOrders>) -> Result<Self, ScheduleError> {
        let seed = protocol.study.seed;
        let parts_order = protocol.design.parts_order;
        if let (Order::File(_), Some(orders)) = (&protocol.design.order, orders)
            && (protocol.questionnaires.iter()).any(|own| own.after == Occasion::Condition)
        {
            orders.iter().try_for_each(together)?;
        }
        if protocol.only_asks() {
            return Ok(Self {
                parts_order,
                parts: Vec::new(),
            });
        }
        if protocol.parts.is_empty() {
            let models = protocol.scheduled_models().map(|m| m.id.clone()).collect();
            let only = PartOrders {
                part: None,
                practice: protocol.design.practice.clone(),
                rounds: None,
                seed,
                reference: None,
                drawn: None,
                kind: Kind::Rating(Sequence::of_models(
                    seed,
                    None,
                    &protocol.design,
                    models,
                    orders,
                )?),
            };
            return Ok(Self {
                parts_order,
                parts: vec![only],
            });
        }
        let part = |part: &crate::protocol::Part| {
            let id = Some(&part.id);
            let design = protocol.design_of(id);
            let kind = match &part.task {
                Task::Rating(own)
                | Task::Magnitude(Magnitude {
                    presentations: own, ..
                })
                | Task::Mushra(Mushra {
                    presentations: own, ..
                })
                | Task::Identification(Identification {
                    presentations: own, ..
                }) => Kind::Rating(Sequence::of_models(
                    seed,
                    id,
                    &design,
                    own.models.clone(),
                    None,
                )?),
                Task::Pairs(own) => Kind::Pairs(PairOrders::new(seed, &part.id, own, &design)?),
                Task::Discrimination { tracks } => {
                    Kind::Tracks(TrackOrders::new(seed, &part.id, protocol, tracks)?)
                }
                Task::Search(own) => Kind::Search(SearchOrders::new(seed, &part.id, own)),
                Task::Similarity(own) => {
                    Kind::Pairs(PairOrders::new(seed, &part.id, &own.pairs(), &design)?)
                }
                Task::Ranking(own) => Kind::Ranking(Sequence::of_models(
                    seed,
                    id,
                    &design,
                    own.models.clone(),
                    None,
                )?),
                Task::Adjustment(own) => {
                    Kind::Adjustment(AdjustmentOrders::new(seed, &part.id, own))
                }
            };
            Ok(PartOrders {
                part: id.cloned(),
                practice: design.practice,
                rounds: (part.task.identification())
                    .and_then(|own| own.criterion)
                    .map(|criterion| (criterion.rounds, criterion.draw)),
                seed,
                reference: part.task.reference().cloned(),
                drawn: Some(part.task.clone()).filter(|task| {
                    matches!(
                        task,
                        Task::Similarity(_) | Task::Ranking(_) | Task::Adjustment(_)
                    )
                }),
                kind,
            })
        };
        let parts: Result<Vec<_>, ScheduleError> = protocol.parts.iter().map(part).collect();
        Ok(Self {
            parts_order,
            parts: parts?,
        })
    }

    /// The realizations that are scheduled, in the order of the protocol; none in a study
    /// with parts.
    pub fn models(&self) -> &[ModelId] {
        match &self.parts[..] {
            [
                PartOrders {
                    part: None,
                    kind: Kind::Rating(sequence),
                    ..
                },
            ] => sequence.models(),
            _ => &[],
        }
    }

    /// The order of a seat: in each part practice first, then every trial that counts.
    ///
    /// # Errors
    /// [`ScheduleError`] if the number is 0, or the given order of this seat is
    /// incomplete or breaks a constraint.
    pub fn plan(&self, seat: Seat) -> Result<Vec<Trial>, ScheduleError> {
        if seat.number() == 0 {
            return Err(ScheduleError::SeatZero(seat));
        }
        let mut trials = Vec::new();
        for part in self.parts_of(seat) {
            part.plan(seat, &mut trials)?;
        }
        Ok(trials)
    }

    /// The parts in their order for a seat.
    fn parts_of(&self, seat: Seat) -> Vec<&PartOrders> {
        let n = self.parts.len();
        match self.parts_order {
            PartsOrder::Williams if n > 0 => {
                let line = orders::williams_line(n, u64::from(seat.number() - 1));
                line.into_iter().map(|i| &self.parts[i]).collect()
            }
            PartsOrder::Fixed | PartsOrder::Williams => self.parts.iter().collect(),
        }
    }

    /// Checks the orders of the planned rows, and all orders that are given: the whole
    /// cycle of a Williams design or Latin square, and every row of the file. Pilots,
    /// simulated participants and replacements can take any of them.
    ///
    /// # Errors
    /// [`ScheduleError`] for the first order that is missing, incomplete or breaks a
    /// constraint.
    pub fn verify(&self, participants: u32) -> Result<(), ScheduleError> {
        self.parts.iter().try_for_each(|part| match &part.kind {
            Kind::Rating(sequence) | Kind::Ranking(sequence) => sequence.verify(participants),
            Kind::Pairs(_) | Kind::Tracks(_) | Kind::Search(_) | Kind::Adjustment(_) => Ok(()),
        })
    }
}

impl PartOrders {
    /// Adds the trials of this part, numbered on from those before.
    fn plan(&self, seat: Seat, trials: &mut Vec<Trial>) -> Result<(), ScheduleError> {
        let planned = match &self.kind {
            Kind::Rating(sequence) => ratings(sequence, self.reference.as_ref(), seat)?,
            Kind::Pairs(pairs) => pairs.plan(seat)?,
            Kind::Tracks(tracks) => tracks.plan(seat),
            Kind::Search(search) => search.plan(seat),
            Kind::Ranking(sequence) => ranking::ranked(sequence, seat)?,
            Kind::Adjustment(adjustment) => adjustment.plan(seat),
        };
        let last = |of: fn(&Trial) -> u32, practice: bool| {
            let same = trials.iter().filter(|t| t.practice == practice);
            same.map(of).max().unwrap_or(0)
        };
        let mut number = u32::try_from(trials.len()).unwrap_or(u32::MAX);
        let block = last(|t| t.block, false);
        let (practiced, position) = (last(|t| t.position, true), last(|t| t.position, false));
        for (place, stimuli) in (1..).zip(self.practiced(seat)) {
            number += 1;
            trials.push(Trial {
                trial: number,
                block: 0,
                position: practiced + place,
                stimuli,
                repetition: 0,
                practice: true,
                part: self.part.clone(),
            });
        }
        for (place, planned) in (1..).zip(planned) {
            number += 1;
            trials.push(Trial {
                trial: number,
                block: block + planned.block,
                position: position + place,
                stimuli: planned.stimuli,
                repetition: planned.repetition,
                practice: false,
                part: self.part.clone(),
            });
        }
        Ok(())
    }
}

impl PartOrders {
    /// What the practice trials present, in their order for a seat.
    fn practiced(&self, seat: Seat) -> Vec<Stimuli> {
        match (&self.drawn, &self.part) {
            (Some(Task::Similarity(own)), Some(part)) => {
                return similarity::practiced(self.seed, part, own, seat);
            }
            (Some(Task::Ranking(own)), Some(part)) => {
                return ranking::practiced(self.seed, part, own, seat);
            }
            (Some(Task::Adjustment(own)), Some(part)) => {
                return adjustment::practiced(self.seed, part, own, seat);
            }
            _ => {}
        }
        let models = self.practiced_models(seat);
        let rated = models
            .iter()
            .map(|m| Stimuli::rated(self.reference.as_ref(), m));
        rated.collect()
    }

    /// The realizations of the practice trials of a part with one rating a trial.
    fn practiced_models(&self, seat: Seat) -> Vec<ModelId> {
        let (Some((rounds, draw)), Some(part)) = (self.rounds, &self.part) else {
            return self.practice.clone();
        };
        let number = seat.number().to_string();
        let path = [
            "schedule",
            "part",
            part.as_str(),
            "practice",
            seat.stream(),
            &number,
        ];
        let mut stream = Stream::new(self.seed, &path);
        let round = |_| match draw {
            Drawn::Rounds => {
                let mut models = self.practice.clone();
                stream.shuffle(&mut models);
                models
            }
            Drawn::Independent => {
                let n = self.practice.len() as u64;
                let one = |_| self.practice[stream.below(n) as usize].clone();
                (0..n).map(one).collect()
            }
        };
        (0..rounds).flat_map(round).collect()
    }
}

/// Checks that a row of the file of orders has the trials of each realization one after another.
fn together((row, models): (&u32, &Vec<ModelId>)) -> Result<(), ScheduleError> {
    let comes_again = |at: &usize| {
        let (before, model) = (&models[..*at], &models[*at]);
        before.last() != Some(model) && before.contains(model)
    };
    match (0..models.len()).find(comes_again) {
        None => Ok(()),
        Some(at) => Err(ScheduleError::Interleaved {
            row: *row,
            position: at + 1,
            model: models[at].clone(),
        }),
    }
}

/// The trials of a part with one rating a trial.
fn ratings(
    sequence: &Sequence,
    reference: Option<&ModelId>,
    seat: Seat,
) -> Result<Vec<Planned>, ScheduleError> {
    let mut repetitions = vec![0u32; sequence.models().len()];
    let trial = |model: usize| {
        repetitions[model] += 1;
        Planned {
            // Each block contains each realization once.
            block: if sequence.has_blocks() {
                repetitions[model]
            } else {
                1
            },
            stimuli: Stimuli::rated(reference, &sequence.models()[model]),
            repetition: repetitions[model],
        }
    };
    let order = sequence.valid_order(seat)?;
    Ok(order.into_iter().map(trial).collect())
}

#[cfg(test)]
mod tests;
