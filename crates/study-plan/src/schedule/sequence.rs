//! The order of the realizations, or pairs, of one part.

use super::completions::Completions;
use super::constraints::{self, Rule};
use super::inclusion::Inclusion;
use super::{MAX_TRIALS, ScheduleError, balance, orders};
use crate::protocol::{Design, FileOrders, Order, Seat};
use std::collections::HashMap;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// Makes the orders of the realizations, or pairs, of a part.
#[derive(Debug)]
pub(super) struct Sequence {
    seed: u64,
    /// The part, for the names of its random streams; `None` in a study without parts.
    part: Option<PartId>,
    max_run: Option<u32>,
    min_distance: Option<u32>,
    repetitions: u32,
    /// Number of realizations or pairs.
    n: usize,
    /// The realizations; pairs have no constraints and no file, which need names.
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

impl Sequence {
    /// Checks the design and prepares drawing the orders of these realizations.
    ///
    /// # Errors
    /// [`ScheduleError`] if no seat can have an order.
    pub(super) fn of_models(
        seed: u64,
        part: Option<&PartId>,
        design: &Design,
        models: Vec<ModelId>,
        orders: Option<&FileOrders>,
    ) -> Result<Self, ScheduleError> {
        let mut sequence = Self::new(seed, part, design, models.len(), orders)?;
        sequence.models = models;
        Ok(sequence)
    }

    /// The same for `n` pairs, without constraints.
    ///
    /// # Errors
    /// [`ScheduleError`] if no seat can have an order.
    pub(super) fn new(
        seed: u64,
        part: Option<&PartId>,
        design: &Design,
        n: usize,
        orders: Option<&FileOrders>,
    ) -> Result<Self, ScheduleError> {
        let rule = feasible(design, n)?;
        let symbols = || orders::symbols(seed, part, n);
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
                rule => Source::ShuffledWithin(counted(n, repetitions, rule).ok_or_else(|| {
                    ScheduleError::TooManyStates {
                        realizations: n,
                        repetitions: design.repetitions,
                        constraint: rule.to_string(),
                    }
                })?),
            },
            Order::Williams => Source::Lines {
                of: Lines::Williams,
                symbols: symbols(),
            },
            Order::LatinSquare => Source::Lines {
                of: Lines::Latin,
                symbols: symbols(),
            },
            Order::Fixed => Source::Fixed,
            Order::File(_) => Source::File(orders.ok_or(ScheduleError::NoOrders)?.clone()),
        };
        Ok(Self {
            seed,
            part: part.cloned(),
            max_run: design.max_run,
            min_distance: design.min_distance,
            repetitions: design.repetitions,
            n,
            models: Vec::new(),
            source,
        })
    }

    /// The realizations, in the order of the protocol.
    pub(super) fn models(&self) -> &[ModelId] {
        &self.models
    }

    /// Checks the orders of the planned rows, and all orders that are given: the whole
    /// cycle of a Williams design or Latin square, and every row of the file. Pilots,
    /// simulated participants and replacements can take any of them.
    ///
    /// # Errors
    /// [`ScheduleError`] for the first order that is missing, incomplete or breaks a
    /// constraint.
    pub(super) fn verify(&self, participants: u32) -> Result<(), ScheduleError> {
        let check = |row| self.valid_order(Seat::Row(row)).map(drop);
        match &self.source {
            // Random orders are valid.
            Source::Blocked { .. } | Source::Shuffled | Source::ShuffledWithin(_) => Ok(()),
            Source::Fixed => check(1),
            Source::Lines { of, .. } => {
                (1..=of.cycle(self.n, self.repetitions)).try_for_each(check)
            }
            Source::File(file) => {
                let missing = (1..=participants).find(|row| !file.contains_key(row));
                let rows = file.keys().copied();
                rows.chain(missing).try_for_each(check)
            }
        }
    }

    /// The order of a seat; verified if it is given.
    ///
    /// # Errors
    /// [`ScheduleError`] if the given order of this seat is incomplete or breaks a
    /// constraint.
    pub(super) fn valid_order(&self, seat: Seat) -> Result<Vec<usize>, ScheduleError> {
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
        let n = self.n;
        let repetitions = self.repetitions as usize;
        let stream = || {
            let number = seat.number().to_string();
            match &self.part {
                None => Stream::new(self.seed, &["schedule", seat.stream(), &number]),
                Some(part) => {
                    let path = ["schedule", "part", part.as_str(), seat.stream(), &number];
                    Stream::new(self.seed, &path)
                }
            }
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

    /// Whether each block contains each realization once.
    pub(super) fn has_blocks(&self) -> bool {
        !matches!(
            self.source,
            Source::Shuffled | Source::ShuffledWithin(_) | Source::File(_)
        )
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
