//! All valid orders are equally likely.
//!
//! All orders of small designs are enumerated by brute force, the draws are
//! counted, and Pearson's chi-square is compared with the upper and lower 0.1 %
//! points of its distribution. The seed is fixed, so the tests cannot fail by chance.

use crate::designs::constrained;
use proptest::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::ModelId;
use study_plan::protocol::Order::{Blocked, Shuffled};
use study_plan::protocol::{Order, Protocol, Seat, Trial};
use study_plan::schedule::constraints::first_violation;
use study_plan::schedule::{Planner, orders};

/// All orders of the design as texts, by trying every permutation.
fn enumerate(protocol: &Protocol) -> BTreeSet<String> {
    let models: Vec<&ModelId> = protocol.models.iter().map(|m| &m.id).collect();
    let design = &protocol.design;
    let trials = models.len() * design.repetitions as usize;
    let mut found = BTreeSet::new();
    let mut open = vec![Vec::<&ModelId>::new()];
    while let Some(order) = open.pop() {
        if order.len() == trials {
            if first_violation(&order, design.max_run, design.min_distance).is_none() {
                found.insert(order.iter().map(|m| m.as_str()).collect());
            }
            continue;
        }
        let block = match design.order {
            Blocked => &order[order.len() - order.len() % models.len()..],
            _ => &order[..],
        };
        let most = if design.order == Blocked {
            1
        } else {
            design.repetitions as usize
        };
        for model in &models {
            if block.iter().filter(|m| *m == model).count() < most {
                let mut longer = order.clone();
                longer.push(model);
                open.push(longer);
            }
        }
    }
    found
}

fn text(plan: &[Trial]) -> String {
    plan.iter()
        .map(|t| t.model().expect("a realization").as_str())
        .collect()
}

/// The point that chi-square is below with probability `p`.
fn point(df: f64, p: f64) -> f64 {
    ChiSquared::new(df)
        .expect("degrees of freedom are positive")
        .inverse_cdf(p)
}

/// Draws each order 100 times on average; checks their number and chi-square.
fn is_uniform(protocol: &Protocol, orders: usize) {
    let name = format!("{:?}", protocol.design);
    let planner = Planner::new(protocol, None).expect("the design is feasible");
    let mut counts: BTreeMap<String, u32> =
        enumerate(protocol).into_iter().map(|o| (o, 0)).collect();
    assert_eq!(counts.len(), orders, "{name}");
    for row in (1..).take(100 * orders) {
        let order = text(&planner.plan(Seat::Row(row)).expect("rows are feasible"));
        *counts.get_mut(&order).expect("only valid orders are drawn") += 1;
    }
    let squares = counts
        .values()
        .map(|c| (f64::from(*c) - 100.0).powi(2) / 100.0);
    let chi2: f64 = squares.sum();
    let df = orders as f64 - 1.0;
    // Counts that are closer to equal than chance allows would be wrong, too.
    let (low, high) = (point(df, 0.001), point(df, 0.999));
    assert!(
        low < chi2 && chi2 < high,
        "{low:.1} < {chi2:.1} < {high:.1}, {name}"
    );
}

/// NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4: upper 0.1 %
/// points of chi-square with 23, 29 and 89 degrees of freedom.
#[test]
fn the_thresholds_are_those_of_the_tables() {
    for (df, table) in [(23.0, 49.728), (29.0, 58.301), (89.0, 135.978)] {
        let ours = point(df, 0.999);
        assert!((ours - table).abs() < 0.001, "{df}: {ours}");
    }
}

#[test]
fn blocked_orders_are_uniform() {
    // 3!²; 3! · 2 · 2!; 3! · 1 (the same block twice); 4! · 3 · 3!; 4! · 2² · 2!; 2 · 1 · 1
    is_uniform(&constrained(3, 2, Blocked, None, None), 36);
    is_uniform(&constrained(3, 2, Blocked, Some(1), None), 24);
    is_uniform(&constrained(3, 3, Blocked, Some(1), None), 96);
    is_uniform(&constrained(3, 2, Blocked, None, Some(3)), 6);
    is_uniform(&constrained(4, 2, Blocked, None, Some(2)), 432);
    is_uniform(&constrained(4, 2, Blocked, Some(1), Some(3)), 192);
    is_uniform(&constrained(3, 2, Blocked, Some(2), None), 36);
}

#[test]
fn shuffled_orders_are_uniform() {
    // 6!/2!³ = 90; of these 30 without neighbors alike (OEIS A114938).
    is_uniform(&constrained(3, 2, Shuffled, None, None), 90);
    is_uniform(&constrained(3, 2, Shuffled, Some(1), None), 30);
    is_uniform(&constrained(3, 3, Shuffled, Some(1), None), 174);
    is_uniform(&constrained(3, 2, Shuffled, None, Some(3)), 6);
    is_uniform(&constrained(4, 2, Shuffled, Some(2), Some(3)), 240);
    is_uniform(&constrained(2, 4, Shuffled, Some(2), None), 34);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_order_breaks_its_constraints_or_loses_a_trial(
        n in 1usize..8,
        repetitions in 1u32..5,
        shuffled in any::<bool>(),
        max_run in proptest::option::of(1u32..4),
        min_distance in proptest::option::of(0u32..6),
        seed in any::<u64>(),
        row in 1u32..,
    ) {
        let order = if shuffled { Shuffled } else { Blocked };
        let mut protocol = constrained(n, repetitions, order, max_run, min_distance);
        protocol.study.seed = seed;
        let infeasible = repetitions > 1
            && (min_distance.is_some_and(|d| d as usize > n)
                || n == 1 && max_run.is_some_and(|k| k < repetitions));
        let planned = study_plan::schedule::plan(&protocol, None, Seat::Row(row));
        prop_assert_eq!(planned.is_err(), infeasible);
        let Ok(planned) = planned else { return Ok(()) };
        let models: Vec<_> = planned.iter().filter_map(|t| t.model()).collect();
        prop_assert_eq!(first_violation(&models, max_run, min_distance), None);
        for model in &protocol.models {
            let times: Vec<_> =
                planned.iter().filter(|t| t.model() == Some(&model.id)).map(|t| t.repetition).collect();
            prop_assert_eq!(times, (1..=repetitions).collect::<Vec<_>>());
        }
        for (at, trial) in (1..).zip(&planned) {
            prop_assert_eq!((trial.trial, trial.position), (at, at));
            let block = if shuffled { 1 } else { (at - 1) / n as u32 + 1 };
            prop_assert_eq!(trial.block, block);
        }
    }

    #[test]
    fn lines_of_designs_hold_each_symbol_once(n in 1usize..40, line in any::<u64>()) {
        for symbols in [orders::williams_line(n, line), orders::latin_line(n, line)] {
            let mut sorted = symbols.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, (0..n).collect::<Vec<_>>());
        }
    }
}

#[test]
fn an_order_under_constraints_is_made_for_designs_of_every_size() {
    for (n, repetitions, order, max_run, min_distance) in [
        (10, 5, Shuffled, Some(1), None),
        (10, 5, Shuffled, Some(2), None),
        (8, 3, Shuffled, None, Some(4)),
        (12, 3, Blocked, Some(1), None),
        (26, 20, Blocked, None, Some(26)),
        (26, 2, Order::Williams, Some(1), Some(2)),
    ] {
        let protocol = constrained(n, repetitions, order, max_run, min_distance);
        let planner = Planner::new(&protocol, None).unwrap();
        for row in 1..=20 {
            let planned = planner.plan(Seat::Row(row)).unwrap();
            let models: Vec<_> = planned.iter().filter_map(|t| t.model()).collect();
            assert_eq!(first_violation(&models, max_run, min_distance), None);
        }
    }
}
