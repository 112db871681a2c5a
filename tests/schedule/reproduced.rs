//! The specification is complete: two implementations written from `docs/schedule.md`
//! alone, [`second`](crate::second) and a script, make the same orders.

use crate::designs::constrained;
use crate::second;
use proptest::prelude::*;
use std::process::Command;
use study_plan::protocol::Order::{Blocked, Fixed, LatinSquare, Shuffled, Williams};
use study_plan::protocol::{Order, Seat, Trial};
use study_plan::schedule::{Felt, Planner, requeue};

/// Models, repetitions, order, `max_run`, `min_distance`, numbers up to.
type Case = (usize, u32, Order, Option<u32>, Option<u32>, u32);

/// Makes a seat of a number.
type Kind = fn(u32) -> Seat;

const DESIGNS: [Case; 19] = [
    (5, 3, Blocked, None, None, 5),
    (5, 3, Blocked, Some(1), None, 5),
    (5, 3, Blocked, Some(2), None, 5),
    (12, 3, Blocked, Some(1), None, 5),
    (6, 4, Blocked, None, Some(4), 5),
    (4, 3, Blocked, None, Some(4), 5),
    (5, 3, Shuffled, None, None, 5),
    (5, 3, Shuffled, Some(3), Some(1), 5),
    (10, 5, Shuffled, Some(1), None, 1),
    (5, 4, Shuffled, Some(2), None, 5),
    (2, 7, Shuffled, Some(3), None, 5),
    (6, 3, Shuffled, None, Some(3), 5),
    (6, 3, Shuffled, Some(2), Some(4), 5),
    (3, 3, Shuffled, None, Some(3), 5),
    (4, 3, Williams, None, None, 5),
    (5, 3, Williams, Some(1), None, 5),
    (1, 2, Williams, None, None, 3),
    (7, 2, LatinSquare, None, None, 5),
    (3, 2, Fixed, None, None, 2),
];

/// The same design for the second implementation.
fn second((n, repetitions, order, max_run, min_distance, _): &Case) -> second::Design {
    second::Design {
        seed: 2007,
        n: *n,
        repetitions: *repetitions as usize,
        order: word(order),
        max_run: max_run.map(|k| k as usize),
        min_distance: min_distance.map(|d| d as usize),
    }
}

/// Kinds of seats and the last number of each.
fn seats(last: u32) -> [(Kind, u32); 3] {
    [(Seat::Row, last), (Seat::Pilot, 2), (Seat::Simulated, 2)]
}

/// Numbers of realizations, as the document counts them.
fn numbers(planner: &Planner, trials: &[Trial]) -> Vec<usize> {
    let number = |t: &Trial| planner.models().iter().position(|m| Some(m) == t.model());
    trials
        .iter()
        .map(|t| number(t).expect("it is scheduled"))
        .collect()
}

#[test]
fn a_second_implementation_makes_the_same_orders() {
    for case in DESIGNS {
        // Its counts have 128 bits.
        if case.0 * case.1 as usize == 50 {
            continue;
        }
        let (models, repetitions, order, max_run, min_distance, last) = case.clone();
        let protocol = constrained(models, repetitions, order, max_run, min_distance);
        let planner = Planner::new(&protocol, None).unwrap();
        for (kind, last) in seats(last) {
            for number in 1..=last {
                let ours = numbers(&planner, &planner.plan(kind(number)).unwrap());
                let theirs = second(&case).order(kind(1).stream(), number);
                assert_eq!(ours, theirs, "{case:?} {number}");
            }
        }
    }
}

/// Both sides of the limit, with and without the exception.
#[test]
fn the_document_says_which_designs_are_refused() {
    for (models, repetitions, max_run, min_distance, accepted) in [
        (20, 5, Some(1), None, true),
        (30, 10, Some(1), None, true),
        (20, 20, Some(2), None, true),
        (21, 20, Some(2), None, false),
        (10, 21, Some(1), None, false),
        (2, 60, Some(3), None, true),
        (9, 4, None, Some(3), true),
        // 67,232,498 of 67,108,864
        (26, 4, None, Some(3), false),
        (25, 4, None, Some(3), true),
    ] {
        let case = (models, repetitions, Shuffled, max_run, min_distance, 1);
        assert_eq!(second(&case).is_accepted(), accepted, "{case:?}");
        let protocol = constrained(models, repetitions, Shuffled, max_run, min_distance);
        assert_eq!(Planner::new(&protocol, None).is_ok(), accepted, "{case:?}");
    }
}

proptest! {
    /// Shuffled orders of the second implementation, one block: a trial in the middle
    /// fails, felt or not, after another one was stopped or not.
    #[test]
    fn a_second_implementation_inserts_a_failed_trial_at_the_same_place(
        n in 2usize..6,
        repetitions in 1u32..5,
        blocked in any::<bool>(),
        constraint in 0usize..5,
        number in 1u32..500,
        at in any::<prop::sample::Index>(),
        was_felt in any::<bool>(),
        goes_on in any::<bool>(),
    ) {
        let (max_run, min_distance) =
            [(None, None), (Some(1), None), (Some(2), None), (None, Some(2)), (Some(2), Some(3))]
                [constraint];
        prop_assume!(min_distance.is_none_or(|d| d as usize <= n));
        let order = if blocked { Blocked } else { Shuffled };
        let case = (n, repetitions, order.clone(), max_run, min_distance, 1);
        let protocol = constrained(n, repetitions, order, max_run, min_distance);
        let planner = Planner::new(&protocol, None).unwrap();
        let planned = planner.plan(Seat::Row(number)).unwrap();
        let at = at.index(planned.len());
        let (before, rest) = (&planned[..at + usize::from(was_felt)], &planned[at + 1..]);
        let felt = Felt { trials: before.iter().collect(), goes_on };
        let got = requeue(&felt, rest, &planned[at], &protocol.design);

        let places = rest.iter().filter(|t| t.block == planned[at].block).count();
        let all = numbers(&planner, &planned);
        let (place, flagged) = second(&case).place(
            &all[..before.len()],
            &all[at + 1..],
            all[at],
            places,
            // Right away, the failed trial is the one that was felt last.
            |place| goes_on && was_felt && place == 0,
        );
        prop_assert_eq!(got.queue.iter().position(|t| t == &planned[at]), Some(place));
        prop_assert_eq!(got.constraint_broken, flagged);
    }
}

#[test]
fn a_script_written_from_the_document_makes_the_same_orders() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/schedule.py");
    if Command::new("python3").arg("--version").output().is_err() {
        println!("not compared: there is no python3");
        return;
    }
    for (models, repetitions, order, max_run, min_distance, last) in DESIGNS {
        let protocol = constrained(models, repetitions, order.clone(), max_run, min_distance);
        let planner = Planner::new(&protocol, None).unwrap();
        let ids: Vec<_> = planner.models().iter().map(ToString::to_string).collect();
        for (kind, last) in seats(last) {
            let mut ours = String::from("kind,number,position,model\n");
            for number in 1..=last {
                for trial in planner.plan(kind(number)).unwrap() {
                    let kind = kind(number).stream();
                    ours += &format!(
                        "{kind},{number},{},{}\n",
                        trial.position,
                        trial.model().unwrap()
                    );
                }
            }
            let mut python = Command::new("python3");
            python
                .arg(script)
                .args(["--seed", &protocol.study.seed.to_string()])
                .args(["--models", &ids.join(",")])
                .args(["--repetitions", &repetitions.to_string()])
                .args(["--order", word(&order)])
                .args(["--kind", kind(1).stream()])
                .args(["--numbers", &format!("1-{last}")]);
            for (flag, value) in [("--max-run", max_run), ("--min-distance", min_distance)] {
                if let Some(value) = value {
                    python.args([flag, &value.to_string()]);
                }
            }
            let said = python.output().unwrap();
            assert!(
                said.status.success(),
                "{}",
                String::from_utf8_lossy(&said.stderr)
            );
            let theirs = String::from_utf8(said.stdout)
                .unwrap()
                .replace("\r\n", "\n");
            assert_eq!(
                ours, theirs,
                "{models} × {repetitions} {order:?} {max_run:?} {min_distance:?}"
            );
        }
    }
}

fn word(order: &Order) -> &'static str {
    match order {
        Blocked => "blocked",
        Shuffled => "shuffled",
        Williams => "williams",
        LatinSquare => "latin-square",
        Fixed => "fixed",
        Order::File(_) => unreachable!("no design above takes its orders from a file"),
    }
}
