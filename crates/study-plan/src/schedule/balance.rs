//! Balance of the orders of a range of rows: how often each realization occurs at
//! each place, and how often each follows each other.
//!
//! *Place* is the position within a block, *position* that within the session;
//! both are indexed from 0. *Carry-over* is of the first order: pairs of successive
//! trials within a block. Pairs across blocks are counted separately. Practice does
//! not count.

use super::Trial;
use super::orders::williams_lines;
use crate::protocol::Order;
use std::collections::HashMap;
use study_base::text::ModelId;

/// Counts over a range of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Balance {
    /// The realizations, in the order of the indices below.
    pub models: Vec<ModelId>,
    /// Number of rows.
    pub rows: u32,
    /// Blocks of a session.
    pub blocks: u32,
    /// `[realization][place in the block]`
    pub by_place: Vec<Vec<u32>>,
    /// `[realization][position in the session]`
    pub by_position: Vec<Vec<u32>>,
    /// `[before][after]`, within blocks.
    pub carry_over: Vec<Vec<u32>>,
    /// `[before][after]`, from the last trial of a block to the first of the next.
    pub between_blocks: Vec<Vec<u32>>,
}

/// The range of counts that are equal in a balanced design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Smallest count.
    pub least: u32,
    /// Largest.
    pub most: u32,
    /// Their mean.
    pub even: f64,
}

impl Spread {
    /// Whether all counts are equal.
    pub fn is_even(self) -> bool {
        self.least == self.most
    }

    fn of(counts: impl Iterator<Item = u32> + Clone) -> Option<Self> {
        let number = counts.clone().count();
        Some(Self {
            least: counts.clone().min()?,
            most: counts.clone().max()?,
            even: counts.map(f64::from).sum::<f64>() / number as f64,
        })
    }
}

impl Balance {
    /// Counts the orders of some rows, each a plan of a [`super::Planner`] with these
    /// realizations.
    pub fn of<'a>(models: &[ModelId], plans: impl IntoIterator<Item = &'a [Trial]>) -> Self {
        let n = models.len();
        let index: HashMap<&ModelId, usize> = models.iter().zip(0..).collect();
        let mut balance = Self {
            models: models.to_vec(),
            rows: 0,
            blocks: 0,
            by_place: vec![Vec::new(); n],
            by_position: vec![Vec::new(); n],
            carry_over: vec![vec![0; n]; n],
            between_blocks: vec![vec![0; n]; n],
        };
        for plan in plans {
            balance.rows += 1;
            let mut before: Option<(usize, u32)> = None;
            let mut place = 0;
            let counted = plan.iter().filter(|t| !t.practice);
            for (position, trial) in counted.enumerate() {
                let Some(&model) = trial.model().and_then(|id| index.get(id)) else {
                    continue;
                };
                balance.blocks = balance.blocks.max(trial.block);
                match before {
                    Some((last, block)) if block == trial.block => {
                        place += 1;
                        balance.carry_over[last][model] += 1;
                    }
                    Some((last, _)) => {
                        place = 0;
                        balance.between_blocks[last][model] += 1;
                    }
                    None => place = 0,
                }
                add(&mut balance.by_place, model, place);
                add(&mut balance.by_position, model, position);
                before = Some((model, trial.block));
            }
        }
        balance
    }

    /// Range of the counts by place; `None` without a row.
    pub fn places(&self) -> Option<Spread> {
        Spread::of(self.by_place.iter().flatten().copied())
    }

    /// Range of the carry-over counts between different realizations, within blocks;
    /// `None` with fewer than two realizations.
    pub fn carry_overs(&self) -> Option<Spread> {
        Spread::of(self.carry_over.iter().enumerate().flat_map(|(before, to)| {
            let others = to
                .iter()
                .enumerate()
                .filter(move |(after, _)| *after != before);
            others.map(|(_, count)| *count)
        }))
    }
}

/// Adds one; all lines of the table keep the same length.
fn add(table: &mut [Vec<u32>], line: usize, column: usize) {
    if table[line].len() <= column {
        for counts in table.iter_mut() {
            counts.resize(column + 1, 0);
        }
    }
    table[line][column] += 1;
}

/// What a design balances exactly at each multiple of a number of participants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Balances {
    /// The smallest such number of participants.
    pub participants: u64,
    /// Whether carry-over is balanced as well, not only places.
    pub carry_over: bool,
}

/// At how many participants a design is exactly balanced; `None` for orders that are
/// not designed to be.
///
/// Participants take `repetitions` lines each, one after the other, so that all
/// lines are used equally often after lines / gcd(lines, repetitions) of them.
pub fn balances(order: &Order, realizations: usize, repetitions: u32) -> Option<Balances> {
    let (lines, carry_over) = match order {
        Order::Williams => (williams_lines(realizations), true),
        Order::LatinSquare => (realizations, false),
        Order::Blocked | Order::Shuffled | Order::Fixed | Order::File(_) => return None,
    };
    let lines = lines as u64;
    Some(Balances {
        participants: lines / gcd(lines, u64::from(repetitions)).max(1),
        carry_over,
    })
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}
