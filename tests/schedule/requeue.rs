//! A failed trial is inserted again: no trial is lost, no other is moved, and a
//! constraint is violated only if no place in the block satisfies it.

use crate::designs::constrained;
use proptest::prelude::*;
use study_core::protocol::Order::{Blocked, Shuffled};
use study_core::protocol::{Seat, Trial};
use study_core::schedule::constraints::first_violation;
use study_core::schedule::{plan, requeue};

proptest! {
    #[test]
    fn a_failed_trial_comes_back_at_the_latest_good_place_of_its_block(
        n in 2usize..7,
        repetitions in 1u32..4,
        shuffled in any::<bool>(),
        max_run in proptest::option::of(1u32..3),
        min_distance in proptest::option::of(1u32..3),
        row in 1u32..1000,
        at in any::<prop::sample::Index>(),
    ) {
        let order = if shuffled { Shuffled } else { Blocked };
        let protocol = constrained(n, repetitions, order, max_run, min_distance);
        let planned = plan(&protocol, None, Seat::Row(row)).expect("the design is feasible");
        let at = at.index(planned.len());
        let failed = &planned[at];
        let felt: Vec<&Trial> = planned[..=at].iter().collect();
        let rest = &planned[at + 1..];
        let got = requeue(&felt, rest, failed, &protocol.design);

        let place = got.queue.iter().position(|t| t == failed).expect("it is there");
        let mut others = got.queue.clone();
        others.remove(place);
        prop_assert_eq!(&others, rest);

        let end = rest.iter().filter(|t| t.block == failed.block).count();
        let good = |place: usize| {
            let mut queue: Vec<&Trial> = rest.iter().collect();
            queue.insert(place, failed);
            let all: Vec<_> = felt.iter().chain(&queue).map(|t| &t.model).collect();
            first_violation(&all, max_run, min_distance).is_none()
        };
        let expected = (0..=end).rev().find(|&p| good(p));
        prop_assert_eq!(got.constraint_broken, expected.is_none());
        prop_assert_eq!(place, expected.unwrap_or(end));
    }
}
