//! A failed trial is inserted again: no trial is lost, no other is moved, and a
//! constraint is violated only if no place in the block satisfies all of them.

use crate::designs::constrained;
use proptest::prelude::*;
use study_plan::protocol::Order::{Blocked, Shuffled};
use study_plan::protocol::{Seat, Trial};
use study_plan::schedule::{Felt, breaks_constraint, plan, requeue};

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
        refused in any::<bool>(),
        stopped in any::<bool>(),
    ) {
        let order = if shuffled { Shuffled } else { Blocked };
        let protocol = constrained(n, repetitions, order, max_run, min_distance);
        let planned = plan(&protocol, None, Seat::Row(row)).expect("the design is feasible");
        let at = at.index(planned.len());
        let failed = &planned[at];
        let so_far = if refused { at } else { at + 1 };
        let felt = Felt { trials: planned[..so_far].iter().collect(), goes_on: stopped };
        let rest = &planned[at + 1..];
        let got = requeue(&felt, rest, failed, &protocol.design);

        let place = got.queue.iter().position(|t| t == failed).expect("it is there");
        let mut others = got.queue.clone();
        others.remove(place);
        prop_assert_eq!(&others, rest);

        // All trials to come that violate a constraint, after each place in the block.
        let end = rest.iter().filter(|t| t.block == failed.block).count();
        let violations = |place: usize| {
            let mut queue: Vec<&Trial> = rest.iter().collect();
            queue.insert(place, failed);
            if stopped && felt.trials.last().is_some_and(|t| *t == queue[0]) {
                queue.remove(0);
            }
            let all: Vec<_> = felt.trials.iter().chain(&queue).filter_map(|t| t.model()).collect();
            let violates = |&i: &usize| {
                let back = all[..i].iter().rposition(|m| *m == all[i]).map(|last| i - last);
                let run = all[..=i].iter().rev().take_while(|m| **m == all[i]).count();
                max_run.is_some_and(|k| run > k as usize)
                    || min_distance.is_some_and(|d| back.is_some_and(|back| back < d as usize))
            };
            (so_far..all.len()).filter(violates).count()
        };
        let fewest = (0..=end).map(violations).min().expect("there is a place");
        let expected = (0..=end).rev().find(|&p| violations(p) == fewest);
        prop_assert_eq!(Some(place), expected);
        prop_assert_eq!(got.constraint_broken, fewest > 0);
        prop_assert_eq!(breaks_constraint(&felt, &got.queue, &protocol.design), fewest > 0);
        if refused && !stopped {
            prop_assert!(!got.constraint_broken, "the order as planned is still possible");
        }
    }
}
