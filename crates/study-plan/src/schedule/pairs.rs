//! The trials of a part of pairs.

use super::sequence::Sequence;
use super::{Planned, ScheduleError};
use crate::protocol::{Design, IntervalOrder, OrderVersion, Pairs, Seat, Stimuli};
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// Makes the orders of pairs, and of the two intervals of each.
#[derive(Debug)]
pub(super) struct PairOrders {
    seed: u64,
    part: PartId,
    sequence: Sequence,
    pairs: Vec<[ModelId; 2]>,
    repetitions: u32,
    interval_order: IntervalOrder,
    version: OrderVersion,
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
            repetitions: rules.repetitions,
            interval_order: rules.interval_order,
            version: design.order_version,
        })
    }

    /// The trials of a seat.
    pub(super) fn plan(&self, seat: Seat) -> Result<Vec<Planned>, ScheduleError> {
        let order = self.sequence.valid_order(seat)?;
        let mut drawn = interval_stream(self.seed, &self.part, seat);
        let first = self.first(seat);
        let mut repetitions = vec![0u32; self.pairs.len()];
        let trial = |at: usize| {
            repetitions[at] += 1;
            let repetition = repetitions[at];
            // Drawn in any case, so that the stream does not depend on the rule.
            let draw = drawn.below(2);
            let swap = match self.interval_order {
                IntervalOrder::Random => draw,
                IntervalOrder::Balanced => {
                    let two = (repetition as usize - 1) / 2;
                    let first = first[two.min(first.len() - 1)][at];
                    first + u64::from(seat.number()) + u64::from(repetition)
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

    /// Which of each pair comes first, for each two repetitions or once for all of them, when
    /// number of the seat and repetition are both odd or both even.
    fn first(&self, seat: Seat) -> Vec<Vec<u64>> {
        let part = self.part.as_str();
        let drawn = |stream: &mut Stream| self.pairs.iter().map(|_| stream.below(2)).collect();
        match self.version {
            // The same for all seats.
            OrderVersion::Balanced => {
                let path = ["schedule", "part", part, "intervals"];
                vec![drawn(&mut Stream::new(self.seed, &path))]
            }
            // Two seats have it in common, so that they have both orders.
            OrderVersion::Unguessable => {
                let two = seat.number().div_ceil(2).to_string();
                let path = [
                    "schedule",
                    "part",
                    part,
                    seat.stream(),
                    "two",
                    &two,
                    "intervals",
                ];
                let mut stream = Stream::new(self.seed, &path);
                let twos = self.repetitions.div_ceil(2).max(1);
                (0..twos).map(|_| drawn(&mut stream)).collect()
            }
        }
    }
}

/// The stream that draws for each trial of a seat which of the two intervals comes first.
pub(super) fn interval_stream(seed: u64, part: &PartId, seat: Seat) -> Stream {
    let number = seat.number().to_string();
    let part = part.as_str();
    let path = [
        "schedule",
        "part",
        part,
        seat.stream(),
        &number,
        "intervals",
    ];
    Stream::new(seed, &path)
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
    fn counts(
        version: OrderVersion,
        repetitions: u32,
        interval_order: IntervalOrder,
        rows: u32,
    ) -> BTreeMap<String, u32> {
        let rules = Pairs {
            pairs: vec![[id("a"), id("b")], [id("a"), id("c")], [id("b"), id("c")]],
            order: Order::Blocked,
            repetitions,
            tie: false,
            interval_order,
            neighbors: false,
        };
        let mut design = example::protocol(3, repetitions).design;
        design.order = Order::Blocked;
        design.order_version = version;
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
        for version in [OrderVersion::Balanced, OrderVersion::Unguessable] {
            let twice = counts(version, 2, IntervalOrder::Balanced, 1);
            assert_eq!(twice.len(), 6);
            assert!(twice.values().all(|n| *n == 1), "{twice:?}");
            let once = counts(version, 1, IntervalOrder::Balanced, 2);
            assert_eq!(once, twice);
            // An odd number of repetitions, too.
            let thrice = counts(version, 3, IntervalOrder::Balanced, 4);
            assert!(thrice.values().all(|n| *n == 6), "{thrice:?}");
        }
    }

    #[test]
    fn a_random_order_has_both_but_is_not_balanced() {
        let random = counts(OrderVersion::Balanced, 1, IntervalOrder::Random, 400);
        assert_eq!(random.len(), 6);
        assert!(
            random.values().all(|n| (150..250).contains(n)),
            "{random:?}"
        );
        assert!(random.values().any(|n| *n != 200));
    }
}
