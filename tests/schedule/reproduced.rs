//! The specification is complete: a script written from `docs/schedule.md` alone
//! makes the same orders.

use crate::designs::constrained;
use std::process::Command;
use study_core::protocol::Order::{Blocked, Fixed, LatinSquare, Shuffled, Williams};
use study_core::protocol::{Order, Seat};
use study_core::schedule::Planner;

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
        let kinds: [(Kind, u32); 3] = [(Seat::Row, last), (Seat::Pilot, 1), (Seat::Simulated, 1)];
        for (kind, last) in kinds {
            let mut ours = String::from("kind,number,position,model\n");
            for number in 1..=last {
                for trial in planner.plan(kind(number)).unwrap() {
                    let kind = kind(number).stream();
                    ours += &format!("{kind},{number},{},{}\n", trial.position, trial.model);
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
