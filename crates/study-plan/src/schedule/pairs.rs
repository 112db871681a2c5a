//! The trials of a part of pairs.

use super::sequence::Sequence;
use super::{Planned, ScheduleError};
use crate::protocol::{Design, IntervalOrder, Pairs, Seat, Stimuli};
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// Makes the orders of pairs, and of the two intervals of each.
#[derive(Debug)]
pub(super) struct PairOrders {
    seed: u64,
    part: PartId,
    sequence: Sequence,
    pairs: Vec<[ModelId; 2]>,
    interval_order: IntervalOrder,
}

impl PairOrders {
    pub(super) fn new(
        seed: u64,
        part: &PartId,
        rules: &Pairs,
        design: &Design,
    ) -> Result<Self, ScheduleError> {
        Ok(Self {
            seed,
            part: part.clone(),
            sequence: Sequence::new(seed, Some(part), design, rules.pairs.len(), None)?,
            pairs: rules.pairs.clone(),
            interval_order: rules.interval_order,
        })
    }

    /// The trials of a seat.
    pub(super) fn plan(&self, seat: Seat) -> Result<Vec<Planned>, ScheduleError> {
        let order = self.sequence.valid_order(seat)?;
        let number = seat.number().to_string();
        let part = self.part.as_str();
        let path = [
            "schedule",
            "part",
            part,
            seat.stream(),
            &number,
            "intervals",
        ];
        let mut drawn = Stream::new(self.seed, &path);
        // Which of each pair comes first in row 1; the same for all seats.
        let mut first = Stream::new(self.seed, &["schedule", "part", part, "intervals"]);
        let first: Vec<u64> = self.pairs.iter().map(|_| first.below(2)).collect();
        let mut repetitions = vec![0u32; self.pairs.len()];
        let trial = |at: usize| {
            repetitions[at] += 1;
            let repetition = repetitions[at];
            // Drawn in any case, so that the stream does not depend on the rule.
            let draw = drawn.below(2);
            let swap = match self.interval_order {
                IntervalOrder::Random => draw,
                IntervalOrder::Balanced => {
                    first[at] + u64::from(seat.number()) + u64::from(repetition)
                }
            };
            let [a, b] = self.pairs[at].clone();
            Planned {
                block: if self.sequence.has_blocks() {
                    repetition
                } else {
                    1
                },
                stimuli: Stimuli::Pair {
                    pair: if swap.is_multiple_of(2) {
                        [a, b]
                    } else {
                        [b, a]
                    },
                },
                repetition,
            }
        };
        Ok(order.into_iter().map(trial).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Order, example};
    use std::collections::BTreeMap;

    fn id(name: &str) -> ModelId {
        ModelId::new(name).unwrap()
    }

    /// How often each order of each pair occurs in some rows.
    fn counts(repetitions: u32, interval_order: IntervalOrder, rows: u32) -> BTreeMap<String, u32> {
        let rules = Pairs {
            pairs: vec![[id("a"), id("b")], [id("a"), id("c")], [id("b"), id("c")]],
            order: Order::Blocked,
            repetitions,
            tie: false,
            interval_order,
        };
        let mut design = example::protocol(3, repetitions).design;
        design.order = Order::Blocked;
        let part = PartId::new("p").unwrap();
        let orders = PairOrders::new(7, &part, &rules, &design).unwrap();
        let mut counts = BTreeMap::new();
        for row in 1..=rows {
            for trial in orders.plan(Seat::Row(row)).unwrap() {
                let Stimuli::Pair { pair: [a, b] } = trial.stimuli else {
                    panic!("{trial:?}")
                };
                *counts.entry(format!("{a}{b}")).or_default() += 1;
            }
        }
        counts
    }

    #[test]
    fn each_pair_comes_in_both_orders_over_its_repetitions_and_over_two_rows() {
        let twice = counts(2, IntervalOrder::Balanced, 1);
        assert_eq!(twice.len(), 6);
        assert!(twice.values().all(|n| *n == 1), "{twice:?}");
        let once = counts(1, IntervalOrder::Balanced, 2);
        assert_eq!(once, twice);
    }

    #[test]
    fn a_random_order_has_both_but_is_not_balanced() {
        let random = counts(1, IntervalOrder::Random, 400);
        assert_eq!(random.len(), 6);
        assert!(
            random.values().all(|n| (150..250).contains(n)),
            "{random:?}"
        );
        assert!(random.values().any(|n| *n != 200));
    }
}
