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

pub mod balance;
mod completions;
pub mod constraints;
mod inclusion;
pub mod orders;
mod requeue;

pub use crate::protocol::{Seat, Trial};
pub use requeue::{Felt, Requeued, breaks_constraint, requeue};

use crate::protocol::{Design, FileOrders, Order, Protocol};
use completions::Completions;
use constraints::{Rule, Violation};
use inclusion::Inclusion;
use std::collections::HashMap;
use study_base::rng::Stream;
use study_base::text::ModelId;

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
            Self::NoRealizations
            | Self::NoRepetitions
            | Self::SeatZero(_)
            | Self::NoOrders
            | Self::WrongLength { .. }
            | Self::WrongCount { .. } => None,
        }
    }
}

/// The order of one seat: practice first, then every trial that counts.
///
/// For several seats, make a [`Planner`] once.
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
    seed: u64,
    max_run: Option<u32>,
    min_distance: Option<u32>,
    repetitions: u32,
    practice: Vec<ModelId>,
    models: Vec<ModelId>,
    source: Source,
}

/// How orders are made.
#[derive(Debug)]
enum Source {
    Blocked { distance: usize },
    Shuffled,
    ShuffledWithin(Counted),
    Lines { of: Lines, symbols: Vec<usize> },
    Fixed,
    File(FileOrders),
}

/// The valid orders of a shuffled design under a rule, counted by either method. Both
/// have the same order at each place.
#[derive(Debug)]
enum Counted {
    States(Completions),
    Terms(Inclusion),
}

#[derive(Debug, Clone, Copy)]
enum Lines {
    Williams,
    Latin,
}

impl Lines {
    /// Number of rows after which the orders repeat.
    fn cycle(self, realizations: usize, repetitions: u32) -> u32 {
        let order = match self {
            Self::Williams => Order::Williams,
            Self::Latin => Order::LatinSquare,
        };
        let rows = balance::balances(&order, realizations, repetitions).map(|b| b.participants);
        rows.and_then(|rows| u32::try_from(rows).ok()).unwrap_or(1)
    }
}

impl Planner {
    /// Checks the design and prepares drawing.
    ///
    /// `orders` is the content of the file of `order = { file = … }`.
    ///
    /// # Errors
    /// [`ScheduleError`] if no seat can have an order.
    pub fn new(protocol: &Protocol, orders: Option<&FileOrders>) -> Result<Self, ScheduleError> {
        let design = &protocol.design;
        let models: Vec<ModelId> = protocol.scheduled_models().map(|m| m.id.clone()).collect();
        let rule = feasible(design, models.len())?;
        let seed = protocol.study.seed;
        let repetitions = design.repetitions as usize;
        let source = match &design.order {
            Order::Blocked => Source::Blocked {
                // Each realization occurs once in a block: no run is longer than two.
                distance: match rule {
                    Rule::Distance(d) => d as usize,
                    Rule::Run(_) | Rule::None => 1,
                },
            },
            Order::Shuffled => match rule {
                Rule::None => Source::Shuffled,
                rule => {
                    Source::ShuffledWithin(counted(models.len(), repetitions, rule).ok_or_else(
                        || ScheduleError::TooManyStates {
                            realizations: models.len(),
                            repetitions: design.repetitions,
                            constraint: rule.to_string(),
                        },
                    )?)
                }
            },
            Order::Williams => Source::Lines {
                of: Lines::Williams,
                symbols: orders::symbols(seed, models.len()),
            },
            Order::LatinSquare => Source::Lines {
                of: Lines::Latin,
                symbols: orders::symbols(seed, models.len()),
            },
            Order::Fixed => Source::Fixed,
            Order::File(_) => Source::File(orders.ok_or(ScheduleError::NoOrders)?.clone()),
        };
        Ok(Self {
            seed,
            max_run: design.max_run,
            min_distance: design.min_distance,
            repetitions: design.repetitions,
            practice: design.practice.clone(),
            models,
            source,
        })
    }

    /// The realizations that are scheduled, in the order of the protocol.
    pub fn models(&self) -> &[ModelId] {
        &self.models
    }

    /// The order of a seat: practice first, then every trial that counts.
    ///
    /// # Errors
    /// [`ScheduleError`] if the number is 0, or the given order of this seat is
    /// incomplete or breaks a constraint.
    pub fn plan(&self, seat: Seat) -> Result<Vec<Trial>, ScheduleError> {
        if seat.number() == 0 {
            return Err(ScheduleError::SeatZero(seat));
        }
        Ok(self.trials(&self.valid_order(seat)?))
    }

    /// Checks the orders of the planned rows, and all orders that are given: the whole
    /// cycle of a Williams design or Latin square, and every row of the file. Pilots,
    /// simulated participants and replacements can take any of them.
    ///
    /// # Errors
    /// [`ScheduleError`] for the first order that is missing, incomplete or breaks a
    /// constraint.
    pub fn verify(&self, participants: u32) -> Result<(), ScheduleError> {
        let check = |row| self.valid_order(Seat::Row(row)).map(drop);
        match &self.source {
            // Random orders are valid.
            Source::Blocked { .. } | Source::Shuffled | Source::ShuffledWithin(_) => Ok(()),
            Source::Fixed => check(1),
            Source::Lines { of, .. } => {
                (1..=of.cycle(self.models.len(), self.repetitions)).try_for_each(check)
            }
            Source::File(file) => {
                let missing = (1..=participants).find(|row| !file.contains_key(row));
                let rows = file.keys().copied();
                rows.chain(missing).try_for_each(check)
            }
        }
    }

    /// The order of a seat; verified if it is given.
    fn valid_order(&self, seat: Seat) -> Result<Vec<usize>, ScheduleError> {
        let order = self.order(seat)?;
        let random = matches!(
            self.source,
            Source::Blocked { .. } | Source::Shuffled | Source::ShuffledWithin(_)
        );
        if !random && (self.max_run.is_some() || self.min_distance.is_some()) {
            let models: Vec<&ModelId> = order.iter().map(|&m| &self.models[m]).collect();
            if let Some(violation) =
                constraints::first_violation(&models, self.max_run, self.min_distance)
            {
                return Err(ScheduleError::Broken { seat, violation });
            }
        }
        Ok(order)
    }

    /// Indices of realizations in the order of a seat.
    fn order(&self, seat: Seat) -> Result<Vec<usize>, ScheduleError> {
        let n = self.models.len();
        let repetitions = self.repetitions as usize;
        let stream = || {
            let number = seat.number().to_string();
            Stream::new(self.seed, &["schedule", seat.stream(), &number])
        };
        Ok(match &self.source {
            Source::Blocked { distance } => {
                orders::blocked(&mut stream(), n, repetitions, *distance)
            }
            Source::Shuffled => orders::shuffled(&mut stream(), n, repetitions),
            Source::ShuffledWithin(Counted::States(states)) => states.draw(&mut stream()),
            Source::ShuffledWithin(Counted::Terms(terms)) => terms.draw(&mut stream()),
            Source::Lines { of, symbols } => {
                let first = u64::from(self.repetitions) * u64::from(seat.number() - 1);
                (0..u64::from(self.repetitions))
                    .flat_map(|block| match of {
                        Lines::Williams => orders::williams_line(n, first + block),
                        Lines::Latin => orders::latin_line(n, first + block),
                    })
                    .map(|symbol| symbols[symbol])
                    .collect()
            }
            Source::Fixed => (0..repetitions).flat_map(|_| 0..n).collect(),
            Source::File(file) => self.row_of(file, seat)?,
        })
    }

    /// A row of the file of orders, checked to be complete.
    ///
    /// Pilots and simulated participants take the rows of the file in turn, starting
    /// again after the last.
    fn row_of(&self, file: &FileOrders, seat: Seat) -> Result<Vec<usize>, ScheduleError> {
        let row = match seat {
            Seat::Row(row) => row,
            Seat::Pilot(number) | Seat::Simulated(number) => {
                let turn = (number as usize - 1) % file.len().max(1);
                *file
                    .keys()
                    .nth(turn)
                    .ok_or(ScheduleError::NoRow { row: number })?
            }
        };
        let named = file.get(&row).ok_or(ScheduleError::NoRow { row })?;
        let place: HashMap<&ModelId, usize> = self
            .models
            .iter()
            .enumerate()
            .map(|(i, m)| (m, i))
            .collect();
        let mut counts = vec![0u32; self.models.len()];
        let mut order = Vec::with_capacity(named.len());
        for (i, model) in named.iter().enumerate() {
            let Some(&index) = place.get(model) else {
                return Err(ScheduleError::UnknownModel {
                    row,
                    position: i + 1,
                    model: model.clone(),
                });
            };
            counts[index] += 1;
            order.push(index);
        }
        let expected = self.models.len() * self.repetitions as usize;
        if order.len() != expected {
            return Err(ScheduleError::WrongLength {
                row,
                found: order.len(),
                expected,
            });
        }
        match counts.iter().position(|&c| c != self.repetitions) {
            Some(wrong) => Err(ScheduleError::WrongCount {
                row,
                model: self.models[wrong].clone(),
                found: counts[wrong],
                expected: self.repetitions,
            }),
            None => Ok(order),
        }
    }

    /// Numbers the trials.
    fn trials(&self, order: &[usize]) -> Vec<Trial> {
        let blocks = !matches!(
            self.source,
            Source::Shuffled | Source::ShuffledWithin(_) | Source::File(_)
        );
        let mut trials = Vec::with_capacity(self.practice.len() + order.len());
        let mut number = 0;
        for (position, model) in (1..).zip(&self.practice) {
            number += 1;
            trials.push(Trial {
                trial: number,
                block: 0,
                position,
                model: model.clone(),
                repetition: 0,
                practice: true,
            });
        }
        let mut repetitions = vec![0u32; self.models.len()];
        for (position, &model) in (1..).zip(order) {
            number += 1;
            repetitions[model] += 1;
            trials.push(Trial {
                trial: number,
                // Each block contains each realization once.
                block: if blocks { repetitions[model] } else { 1 },
                position,
                model: self.models[model].clone(),
                repetition: repetitions[model],
                practice: false,
            });
        }
        trials
    }
}

/// Counts the valid orders; `None` if the design is too large for both methods.
fn counted(n: usize, repetitions: usize, rule: Rule) -> Option<Counted> {
    let states = || Completions::count(n, repetitions, rule).map(Counted::States);
    let terms = || Inclusion::count(n, repetitions, rule).map(Counted::Terms);
    states().or_else(terms)
}

/// The rule that the constraints of the design reduce to, if there is a valid order.
fn feasible(design: &Design, realizations: usize) -> Result<Rule, ScheduleError> {
    let repetitions = design.repetitions;
    if realizations == 0 {
        return Err(ScheduleError::NoRealizations);
    }
    if repetitions == 0 {
        return Err(ScheduleError::NoRepetitions);
    }
    let trials = (realizations as u64).saturating_mul(u64::from(repetitions));
    if trials > MAX_TRIALS {
        return Err(ScheduleError::TooLong {
            realizations,
            repetitions,
            trials,
        });
    }
    if design.max_run == Some(0) {
        return Err(ScheduleError::MaxRunZero);
    }
    if let Some(max_run) = design.max_run
        && realizations == 1
        && max_run < repetitions
    {
        return Err(ScheduleError::MaxRun {
            max_run,
            repetitions,
        });
    }
    // The first positions of the n realizations are at least 0 … n−1 and the last ones
    // at most the last n of all n R. First and last are thus at most n (R − 1) apart on
    // average, which is R − 1 distances each: the mean distance is at most n.
    if let Some(min_distance) = design.min_distance
        && repetitions > 1
        && min_distance as usize > realizations
    {
        return Err(ScheduleError::MinDistance {
            min_distance,
            realizations,
        });
    }
    Ok(Rule::of(design.max_run, design.min_distance, repetitions))
}

#[cfg(test)]
mod tests;
