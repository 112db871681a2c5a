use super::balance::{Balance, balances};
use super::*;
use crate::protocol::example::{model, protocol};
use crate::protocol::{Inventory, Questionnaire, Role};
use std::collections::BTreeMap;

fn design(models: usize, repetitions: u32, order: Order) -> Protocol {
    let mut p = protocol(models, repetitions);
    p.design.order = order;
    p
}

fn letters(plan: &[Trial]) -> String {
    plan.iter().map(|t| t.model().unwrap().as_str()).collect()
}

fn file(rows: &[(u32, &str)]) -> FileOrders {
    rows.iter()
        .map(|(row, models)| {
            let ids = models.chars().map(|c| ModelId::new(c.to_string()).unwrap());
            (*row, ids.collect())
        })
        .collect::<BTreeMap<_, _>>()
}

fn message(p: &Protocol, orders: Option<&FileOrders>, seat: Seat) -> String {
    plan(p, orders, seat).unwrap_err().to_string()
}

#[test]
fn practice_comes_first_and_is_numbered_apart() {
    let mut p = design(2, 2, Order::Fixed);
    p.models.push(model("spring"));
    p.models[2].role = Role::Practice;
    p.design.practice = vec![ModelId::new("spring").unwrap()];
    let plan = plan(&p, None, Seat::Row(1)).unwrap();
    let numbers: Vec<_> = plan
        .iter()
        .map(|t| {
            (
                t.trial,
                t.block,
                t.position,
                t.model().unwrap().as_str(),
                t.repetition,
                t.practice,
            )
        })
        .collect();
    assert_eq!(
        numbers,
        [
            (1, 0, 1, "spring", 0, true),
            (2, 1, 1, "A", 1, false),
            (3, 1, 2, "B", 1, false),
            (4, 2, 3, "A", 2, false),
            (5, 2, 4, "B", 2, false),
        ]
    );
}

#[test]
fn the_constraints_ignore_practice() {
    let mut p = design(2, 1, Order::Fixed);
    p.design.max_run = Some(1);
    p.design.practice = vec![p.models[0].id.clone()];
    assert_eq!(letters(&plan(&p, None, Seat::Row(1)).unwrap()), "AAB");
}

#[test]
fn shuffled_and_given_orders_are_one_block() {
    let p = design(3, 2, Order::Shuffled);
    let planned = plan(&p, None, Seat::Row(1)).unwrap();
    assert!(planned.iter().all(|t| t.block == 1));
    for model in ["A", "B", "C"] {
        let times = planned
            .iter()
            .filter(|t| t.model().unwrap().as_str() == model);
        assert_eq!(times.map(|t| t.repetition).collect::<Vec<_>>(), [1, 2]);
    }
}

#[test]
fn rows_pilots_and_simulated_participants_have_orders_of_their_own() {
    for order in [Order::Blocked, Order::Shuffled] {
        let p = design(8, 3, order);
        let seats = [
            Seat::Row(1),
            Seat::Row(2),
            Seat::Pilot(1),
            Seat::Simulated(1),
        ];
        let plans = seats.map(|seat| letters(&plan(&p, None, seat).unwrap()));
        for (i, one) in plans.iter().enumerate() {
            assert!(!plans[i + 1..].contains(one), "{plans:?}");
        }
    }
}

#[test]
fn an_order_depends_on_seed_design_and_row_alone() {
    let mut p = design(6, 3, Order::Blocked);
    let one = plan(&p, None, Seat::Row(7)).unwrap();
    p.study.title.push_str(" (2)");
    p.design.participants = 99;
    assert_eq!(plan(&p, None, Seat::Row(7)).unwrap(), one);
    p.study.seed += 1;
    assert_ne!(plan(&p, None, Seat::Row(7)).unwrap(), one);
}

#[test]
fn a_row_takes_the_lines_after_those_of_the_row_before() {
    let p = design(4, 3, Order::Williams);
    let planner = Planner::new(&p, None).unwrap();
    let symbols = orders::symbols(p.study.seed, None, 4);
    for row in 1..=9u32 {
        let plan = planner.plan(Seat::Row(row)).unwrap();
        for (r, block) in plan.chunks(4).enumerate() {
            let line = orders::williams_line(4, u64::from(3 * (row - 1)) + r as u64);
            let expected: Vec<_> = line.iter().map(|&s| &p.models[symbols[s]].id).collect();
            assert_eq!(
                block.iter().filter_map(|t| t.model()).collect::<Vec<_>>(),
                expected
            );
        }
    }
}

#[test]
fn infeasible_designs_say_why() {
    let mut p = design(5, 3, Order::Blocked);
    p.design.min_distance = Some(6);
    for order in [
        Order::Blocked,
        Order::Shuffled,
        Order::Fixed,
        Order::Williams,
    ] {
        p.design.order = order;
        assert_eq!(
            message(&p, None, Seat::Row(1)),
            "min_distance = 6 needs at least 6 realizations, there are 5"
        );
    }
    p.design.min_distance = None;
    p.design.max_run = Some(0);
    assert_eq!(
        message(&p, None, Seat::Row(1)),
        "max_run = 0 allows no trial at all"
    );

    let mut p = design(1, 3, Order::Shuffled);
    p.design.max_run = Some(2);
    assert_eq!(
        message(&p, None, Seat::Row(1)),
        "max_run = 2 cannot hold: the only realization has 3 trials in a row"
    );
    assert_eq!(
        message(&design(0, 3, Order::Blocked), None, Seat::Row(1)),
        "no realization to schedule: all models have the role practice"
    );
    assert_eq!(
        message(&design(3, 0, Order::Blocked), None, Seat::Row(1)),
        "repetitions = 0 schedules no trial"
    );
    assert_eq!(
        message(&design(5, u32::MAX, Order::Shuffled), None, Seat::Row(1)),
        "5 realizations × 4294967295 repetitions are 21474836475 trials; at most 10000 are possible"
    );
}

#[test]
fn a_design_that_cannot_be_counted_is_refused_with_advice() {
    let mut p = design(40, 20, Order::Shuffled);
    p.design.min_distance = Some(4);
    let error = Planner::new(&p, None).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the orders of 40 realizations × 20 repetitions, shuffled with min_distance = 4, \
         are too many to count"
    );
    assert!(error.hint().unwrap().contains("blocked"));
}

#[test]
fn a_given_order_that_breaks_a_constraint_names_row_and_position() {
    let mut p = design(3, 2, Order::File("orders.csv".to_owned()));
    p.design.max_run = Some(1);
    let orders = file(&[(1, "ABCABC"), (2, "ABCCBA")]);
    assert!(plan(&p, Some(&orders), Seat::Row(1)).is_ok());
    assert_eq!(
        message(&p, Some(&orders), Seat::Row(2)),
        "row 2, position 4: `C` occurs 2 times in a row (max_run = 1)"
    );
    let mut p = design(2, 2, Order::Williams);
    p.design.max_run = Some(1);
    assert!(message(&p, None, Seat::Row(1)).starts_with("row 1, position 3: "));
}

#[test]
fn faults_of_an_orders_file_are_named() {
    let p = design(3, 2, Order::File("orders.csv".to_owned()));
    let orders = file(&[(1, "ABCAB"), (2, "ABCABX"), (3, "AAACBB")]);
    let said = |row| message(&p, Some(&orders), Seat::Row(row));
    assert_eq!(
        said(1),
        "the file of orders, row 1: 5 positions instead of 6"
    );
    assert_eq!(
        said(2),
        "the file of orders, row 2, position 6: `X` is not a scheduled realization"
    );
    assert_eq!(
        said(3),
        "the file of orders, row 3: `A` occurs 3 times, but repetitions = 2"
    );
    assert_eq!(said(4), "the file of orders has no row 4");
    assert_eq!(
        message(&p, None, Seat::Row(1)),
        "the order comes from a file, which was not read"
    );
    assert_eq!(
        message(&p, Some(&FileOrders::new()), Seat::Pilot(1)),
        "the file of orders has no row 1"
    );
}

#[test]
fn all_given_orders_are_verified_beyond_the_planned_participants() {
    let mut p = design(3, 2, Order::File("orders.csv".to_owned()));
    p.design.max_run = Some(1);
    let verify = |orders: &FileOrders, participants| {
        let said = Planner::new(&p, Some(orders)).unwrap().verify(participants);
        said.map_err(|e| e.to_string())
    };
    let broken = file(&[(1, "ABCABC"), (2, "ABCABC"), (7, "ABCCBA")]);
    assert_eq!(
        verify(&broken, 1).unwrap_err(),
        "row 7, position 4: `C` occurs 2 times in a row (max_run = 1)"
    );
    let short = file(&[(1, "ABCABC"), (2, "CABCAB"), (9, "ABCAB")]);
    assert!(
        verify(&short, 1)
            .unwrap_err()
            .contains("row 9: 5 positions")
    );
    let good = file(&[(1, "ABCABC"), (2, "CABCAB")]);
    assert_eq!(verify(&good, 2), Ok(()));
    assert_eq!(
        verify(&good, 3).unwrap_err(),
        "the file of orders has no row 3"
    );

    // Lines 012 120 201 and backwards: only rows 1 and 2 keep the constraint.
    let mut p = design(3, 2, Order::Williams);
    p.design.max_run = Some(1);
    let planner = Planner::new(&p, None).unwrap();
    assert!((1..=2).all(|row| planner.plan(Seat::Row(row)).is_ok()));
    let said = planner.verify(2).unwrap_err().to_string();
    assert!(said.starts_with("row 3, position 4: "), "{said}");
    for (n, repetitions, order) in [(5, 3, Order::Williams), (4, 3, Order::LatinSquare)] {
        let mut p = design(n, repetitions, order);
        p.design.max_run = Some(1);
        assert_eq!(Planner::new(&p, None).unwrap().verify(1), Ok(()));
    }
    let mut p = design(2, 3, Order::Fixed);
    p.design.min_distance = Some(2);
    assert_eq!(Planner::new(&p, None).unwrap().verify(1), Ok(()));
}

#[test]
fn pilots_take_the_rows_of_a_file_in_turn() {
    let p = design(3, 1, Order::File("orders.csv".to_owned()));
    let orders = file(&[(5, "ABC"), (7, "CBA")]);
    let planned = |seat| letters(&plan(&p, Some(&orders), seat).unwrap());
    assert_eq!(planned(Seat::Row(7)), "CBA");
    assert_eq!(planned(Seat::Pilot(1)), "ABC");
    assert_eq!(planned(Seat::Simulated(4)), "CBA");
}

#[test]
fn there_is_no_row_zero() {
    let p = design(3, 1, Order::Blocked);
    assert_eq!(
        message(&p, None, Seat::Row(0)),
        "there is no row 0: numbers start at 1"
    );
}

#[test]
fn williams_balances_at_the_stated_number_of_participants_and_not_before() {
    for (n, repetitions, expected) in [(4, 3, 4), (5, 3, 10), (6, 3, 2), (5, 2, 5), (3, 6, 1)] {
        let p = design(n, repetitions, Order::Williams);
        let said = balances(&Order::Williams, n, repetitions).unwrap();
        assert_eq!((said.participants, said.carry_over), (expected, true));
        let planner = Planner::new(&p, None).unwrap();
        let mut plans = Vec::new();
        for row in 1..=u32::try_from(expected).unwrap() {
            plans.push(planner.plan(Seat::Row(row)).unwrap());
            let balance = Balance::of(planner.models(), plans.iter().map(Vec::as_slice));
            let even =
                balance.places().unwrap().is_even() && balance.carry_overs().unwrap().is_even();
            assert_eq!(
                even,
                u64::from(row) == expected,
                "{n} × {repetitions}, {row} rows"
            );
        }
    }
}

#[test]
fn a_latin_square_balances_places_only() {
    let p = design(4, 3, Order::LatinSquare);
    let said = balances(&Order::LatinSquare, 4, 3).unwrap();
    assert_eq!((said.participants, said.carry_over), (4, false));
    let planner = Planner::new(&p, None).unwrap();
    let plans: Vec<_> = (1..=4)
        .map(|r| planner.plan(Seat::Row(r)).unwrap())
        .collect();
    let balance = Balance::of(planner.models(), plans.iter().map(Vec::as_slice));
    assert!(balance.places().unwrap().is_even());
    assert!(!balance.carry_overs().unwrap().is_even());
    assert_eq!(balance.places().unwrap().even, 3.0);
}

#[test]
fn counts_are_by_place_position_and_predecessor() {
    let p = design(2, 2, Order::File("orders.csv".to_owned()));
    let orders = file(&[(1, "ABBA")]);
    let planned = plan(&p, Some(&orders), Seat::Row(1)).unwrap();
    let balance = Balance::of(
        &[p.models[0].id.clone(), p.models[1].id.clone()],
        [&planned[..]],
    );
    assert_eq!(balance.by_position, [[1, 0, 0, 1], [0, 1, 1, 0]]);
    assert_eq!(balance.carry_over, [[0, 1], [1, 1]]);
    assert_eq!((balance.rows, balance.blocks), (1, 1));

    let planned = plan(&design(2, 2, Order::Fixed), None, Seat::Row(1)).unwrap();
    let balance = Balance::of(&balance.models, [&planned[..]]);
    assert_eq!(balance.by_place, [[2, 0], [0, 2]]);
    assert_eq!(balance.carry_over, [[0, 2], [0, 0]]);
    assert_eq!(balance.between_blocks, [[0, 0], [1, 0]]);
}

/// Trials of a session from letters, `|` between blocks.
fn trials(text: &str) -> Vec<Trial> {
    let mut number = 0;
    let mut out = Vec::new();
    for (block, models) in (1..).zip(text.split('|')) {
        for letter in models.chars() {
            number += 1;
            out.push(Trial {
                trial: number,
                block,
                position: number,
                stimuli: Stimuli::One {
                    model: ModelId::new(letter.to_string()).unwrap(),
                },
                repetition: block,
                practice: false,
                part: None,
            });
        }
    }
    out
}

fn felt(trials: &[Trial]) -> Felt<'_> {
    Felt {
        trials: trials.iter().collect(),
        goes_on: false,
    }
}

/// The queue after the `failed`-th trial (from 1) has failed, and the flag.
fn returned(
    text: &str,
    failed: usize,
    max_run: Option<u32>,
    min_distance: Option<u32>,
) -> (String, bool) {
    let mut design = protocol(3, 2).design;
    design.max_run = max_run;
    design.min_distance = min_distance;
    let all = trials(text);
    let felt = felt(&all[..failed]);
    let got = requeue(&felt, &all[failed..], &all[failed - 1], &design);
    (letters(&got.queue), got.constraint_broken)
}

#[test]
fn a_failed_trial_comes_back_at_the_end_of_its_block() {
    assert_eq!(returned("ABC|ABC", 1, None, None), ("BCAABC".into(), false));
    assert_eq!(
        returned("ABC|BCA", 1, Some(1), None),
        ("BCABCA".into(), false)
    );
}

#[test]
fn it_comes_earlier_where_the_end_would_violate_a_constraint() {
    assert_eq!(
        returned("ABC|ABC", 1, Some(1), None),
        ("BACABC".into(), false)
    );
    assert_eq!(
        returned("BACD|BCDA", 1, None, Some(3)),
        ("ACDBBCDA".into(), true)
    );
    assert_eq!(
        returned("BACDE|CBDEA", 1, None, Some(3)),
        ("ACDBECBDEA".into(), false)
    );
}

#[test]
fn a_failed_attempt_counts_as_presented() {
    assert_eq!(
        returned("ABC|BCA", 2, Some(1), None),
        ("CBBCA".into(), true)
    );
    assert_eq!(
        returned("ABC|CBA", 2, Some(1), None),
        ("CBCBA".into(), false)
    );
}

#[test]
fn the_last_trial_of_a_block_comes_back_right_away_and_is_flagged() {
    assert_eq!(returned("ABC|ABC", 3, Some(1), None), ("CABC".into(), true));
    assert_eq!(returned("ABC|ABC", 3, None, None), ("CABC".into(), false));
    assert_eq!(returned("ABC|ABC", 6, Some(2), None), ("C".into(), false));
}

#[test]
fn a_trial_that_was_not_felt_comes_right_away_if_its_neighbors_are_alike() {
    let mut design = protocol(3, 2).design;
    design.max_run = Some(1);
    // A was felt, the device refuses B: at any later place A follows A.
    let all = trials("ABACBC");
    let got = requeue(&felt(&all[..1]), &all[2..], &all[1], &design);
    assert_eq!(
        (letters(&got.queue), got.constraint_broken),
        ("BACBC".into(), false)
    );
    assert!(breaks_constraint(&felt(&all[..1]), &all[2..], &design));
    assert!(!breaks_constraint(&felt(&all[..2]), &all[2..], &design));
}

#[test]
fn a_stopped_presentation_goes_on_if_its_trial_comes_next() {
    let mut design = protocol(3, 2).design;
    design.max_run = Some(1);
    let all = trials("ABC|ABC");
    let stopped = Felt {
        goes_on: true,
        ..felt(&all[..3])
    };
    let got = requeue(&stopped, &all[3..], &all[2], &design);
    assert_eq!(
        (letters(&got.queue), got.constraint_broken),
        ("CABC".into(), false)
    );
}

#[test]
fn in_a_session_of_one_block_a_failed_trial_comes_at_the_end() {
    assert_eq!(
        returned("ABCABC", 1, Some(1), None),
        ("BCABCA".into(), false)
    );
}

#[test]
fn practice_comes_back_within_practice_and_violates_nothing() {
    let mut all = trials("AB|AB");
    for t in &mut all[..2] {
        t.practice = true;
        t.block = 0;
    }
    let mut design = protocol(2, 1).design;
    design.max_run = Some(1);
    let got = requeue(&felt(&all[..2]), &all[2..], &all[1], &design);
    assert_eq!(
        (letters(&got.queue), got.constraint_broken),
        ("BAB".into(), false)
    );
    let got = requeue(&felt(&all[..1]), &all[1..], &all[0], &design);
    assert_eq!(
        (letters(&got.queue), got.constraint_broken),
        ("BAAB".into(), false)
    );
    assert!(got.queue[1].practice);
}

#[test]
fn a_practice_trial_before_does_not_enter_a_constraint() {
    let mut all = trials("A|AB");
    all[0].practice = true;
    all[0].block = 0;
    let mut design = protocol(2, 1).design;
    design.max_run = Some(1);
    let got = requeue(&felt(&all[..2]), &all[2..], &all[1], &design);
    assert_eq!(
        (letters(&got.queue), got.constraint_broken),
        ("BA".into(), false)
    );
}

fn load(after: Occasion) -> Questionnaire {
    Questionnaire {
        id: PartId::new("load").unwrap(),
        kind: Inventory::NasaTlx,
        own: None,
        after,
        questions: Vec::new(),
    }
}

#[test]
fn a_study_that_only_asks_has_no_trials() {
    let mut p = design(0, 1, Order::Fixed);
    assert_eq!(
        plan(&p, None, Seat::Row(1)),
        Err(ScheduleError::NoRealizations)
    );
    p.questionnaires.push(load(Occasion::Session));
    assert_eq!(plan(&p, None, Seat::Row(1)), Ok(Vec::new()));
}

#[test]
fn a_file_of_orders_brings_the_trials_together_after_which_something_is_asked() {
    let mut p = design(2, 2, Order::File("orders.csv".to_owned()));
    let mixed = file(&[(1, "BBAA"), (2, "ABBA")]);
    assert!(Planner::new(&p, Some(&mixed)).is_ok());
    p.questionnaires.push(load(Occasion::Condition));
    assert_eq!(
        message(&p, Some(&mixed), Seat::Row(1)),
        "the file of orders, row 2, position 4: `A` comes again after others, and a questionnaire is asked after each condition"
    );
    let together = file(&[(1, "BBAA"), (2, "AABB")]);
    assert!(Planner::new(&p, Some(&together)).is_ok());
}
