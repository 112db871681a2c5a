//! The vectorized loops of the grid agree with the plain recursion, and do not depend on
//! processor, other λ or number of threads.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use study_haptics::identify::grid::{self, Cell, Plan};
use study_haptics::identify::lanes::Processor;
use study_haptics::identify::method::{Sort, Start};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{Ewls, IdentifyError, Method, Spring, Static, Training, vaf};
use study_haptics::model::{Branch, Realization};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

fn recording(name: &str) -> Recording {
    let path = Path::new("tests/data/recordings").join(name);
    recording::read(name, BufReader::new(File::open(path).unwrap())).unwrap()
}

/// Every `n`th row: short enough for many recursions in a test.
fn thinned(name: &str, n: usize) -> Recording {
    let whole = recording(name);
    whole.select(&(0..whole.len()).step_by(n).collect::<Vec<_>>())
}

const LAMBDAS: [f64; 15] = [
    0.9, 0.95, 0.99, 0.995, 0.998, 0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997,
    0.9999, 1.0,
];

fn plan(resample: Resample, start: Start, sort: Sort) -> Plan {
    let of = |lambda| {
        Method::Ewls(Ewls {
            start,
            sort,
            ..Ewls::paper(lambda, resample)
        })
    };
    Plan {
        methods: LAMBDAS.map(of).to_vec(),
        dx_mm: vec![0.05, 0.3, 0.5, 1.0, 1.7],
    }
}

fn all_plans() -> Vec<Plan> {
    let mut plans = Vec::new();
    for resample in [Resample::Point, Resample::Bin, Resample::Hat] {
        for start in [Start::Cold, Start::Warm] {
            for sort in [Sort::Ascending, Sort::Travel] {
                plans.push(plan(resample, start, sort));
            }
        }
    }
    plans
}

fn parameters(branch: &Branch) -> impl Iterator<Item = f64> {
    let columns = [
        &branch.m_kg,
        &branch.b_n_s_per_mm,
        &branch.k_n_per_mm,
        &branch.f0_n,
    ];
    columns.into_iter().flatten().copied()
}

#[test]
fn the_grid_agrees_with_cells_identified_alone() {
    let train = thinned("training_a.csv", 10);
    let validation = thinned("validation_a.csv", 10);
    let training = Training::new(&train).unwrap();
    for plan in all_plans() {
        let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap();
        assert_eq!(cells.len(), LAMBDAS.len() * 5);
        for cell in &cells {
            let dx = cell.realization.provenance.dx_mm.unwrap();
            let alone = training.identify(cell.method, dx, Lookup::Linear).unwrap();
            assert_eq!(cell.warnings, alone.warnings, "{} {dx}", cell.method);
            let (found, expected) = (&cell.realization, &alone.realization);
            assert_eq!(found.x_mm, expected.x_mm);
            for (found, expected) in [
                (&found.positive, &expected.positive),
                (&found.negative, &expected.negative),
            ] {
                // the scale of a table; k and F0 balance each other
                let scale = parameters(expected).fold(1.0_f64, |top, p| top.max(p.abs()));
                let nodes = &cell.realization.x_mm;
                let inside = nodes[0] + 1.0..nodes[nodes.len() - 1] - 1.0;
                let all = parameters(found).zip(parameters(expected));
                for ((found, expected), x) in all.zip(nodes.iter().cycle()) {
                    // where the recursion has just begun, or has a short memory, the
                    // estimates are ill-conditioned
                    let well_known = inside.contains(x) && cell.method.lambda() >= Some(0.998);
                    let tolerance = if well_known { 1e-8 } else { 1e-6 };
                    assert!(
                        (found - expected).abs() <= tolerance * scale,
                        "{} λ {:?} dx {dx}: {found} {expected}",
                        cell.method,
                        cell.method.lambda()
                    );
                }
            }
            let score = vaf::score(&alone.realization, &validation);
            let found = cell.scores[0];
            assert!((found.vaf - score.vaf).abs() <= 1e-7, "{found:?} {score:?}");
            assert!((found.bias_n - score.bias_n).abs() <= 1e-7);
            assert!((found.residual_n - score.residual_n).abs() <= 1e-7);
        }
    }
}

/// The plain recursion and the lanes round differently; on a whole recording and for the
/// λ of the paper's grid the difference is below 1e-9 of a table's scale and of a VAF.
#[test]
fn for_the_papers_lambda_the_grid_is_the_plain_recursion_to_1e9() {
    let (train, validation) = (recording("training_a.csv"), recording("validation_a.csv"));
    let training = Training::new(&train).unwrap();
    let lambdas = [0.999, 0.9995, 0.9999];
    for resample in [Resample::Bin, Resample::Point] {
        let plan = Plan::ewls(&lambdas, &[0.5, 1.0], resample);
        let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap();
        for (lambda, cells) in lambdas.iter().zip(cells.chunks(2)) {
            let estimates = training
                .estimates(Ewls::paper(*lambda, Resample::Point))
                .unwrap();
            for (cell, dx) in cells.iter().zip([0.5, 1.0]) {
                let plain = training
                    .ewls(&estimates, dx, resample, Lookup::Linear)
                    .unwrap()
                    .realization;
                let both = |r: &Realization| -> Vec<f64> {
                    parameters(&r.positive)
                        .chain(parameters(&r.negative))
                        .collect()
                };
                let (found, expected) = (both(&cell.realization), both(&plain));
                let scale = expected.iter().fold(1.0_f64, |top, p| top.max(p.abs()));
                for (found, expected) in found.iter().zip(&expected) {
                    assert!(
                        (found - expected).abs() <= 1e-9 * scale,
                        "λ {lambda} dx {dx}: {found} {expected}"
                    );
                }
                let vaf = vaf::score(&plain, &validation).vaf;
                assert!(
                    (cell.scores[0].vaf - vaf).abs() <= 1e-9,
                    "λ {lambda} dx {dx}"
                );
            }
        }
    }
}

/// With bounds the recursion is the same, so that only the order of summation differs.
#[test]
fn a_bounded_grid_agrees_with_cells_identified_alone() {
    let train = thinned("training_a.csv", 50);
    let validation = thinned("validation_a.csv", 50);
    let training = Training::new(&train).unwrap();
    for mut plan in all_plans() {
        for method in &mut plan.methods {
            if let Method::Ewls(options) = method {
                options.bounded = true;
            }
        }
        let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap();
        for cell in &cells {
            let dx = cell.realization.provenance.dx_mm.unwrap();
            let alone = training.identify(cell.method, dx, Lookup::Linear).unwrap();
            assert_eq!(cell.warnings, alone.warnings, "{} {dx}", cell.method);
            assert_eq!(
                cell.realization.provenance.method,
                alone.realization.provenance.method
            );
            for (found, expected) in [
                (&cell.realization.positive, &alone.realization.positive),
                (&cell.realization.negative, &alone.realization.negative),
            ] {
                assert!(
                    found
                        .m_kg
                        .iter()
                        .chain(&found.b_n_s_per_mm)
                        .all(|p| *p >= 0.0)
                );
                let scale = parameters(expected).fold(1.0_f64, |top, p| top.max(p.abs()));
                for (found, expected) in parameters(found).zip(parameters(expected)) {
                    assert!(
                        (found - expected).abs() <= 1e-11 * scale,
                        "{} dx {dx}: {found} {expected}",
                        cell.method
                    );
                }
            }
        }
    }
}

#[test]
fn results_are_bit_identical_on_all_processors() {
    let train = thinned("training_a.csv", 40);
    let validation = thinned("validation_a.csv", 40);
    let training = Training::new(&train).unwrap();
    let on = |processor, plan: &Plan, lookup| -> Vec<Cell> {
        grid::run_on(processor, &training, plan, lookup, &[&validation], || ()).unwrap()
    };
    for plan in all_plans() {
        for lookup in [Lookup::Linear, Lookup::Floor, Lookup::Nearest] {
            let portable = on(Processor::Portable, &plan, lookup);
            assert!(portable == on(Processor::best(), &plan, lookup), "{plan:?}");
        }
    }
}

#[test]
fn results_do_not_depend_on_other_lambda_or_the_number_of_threads() {
    let train = thinned("training_a.csv", 10);
    let validation = thinned("validation_a.csv", 10);
    let training = Training::new(&train).unwrap();
    let run = |lambdas: &[f64]| {
        let plan = Plan::ewls(lambdas, &[0.5, 1.0], Resample::Bin);
        grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap()
    };
    let together = run(&LAMBDAS);
    for (i, lambda) in LAMBDAS.iter().enumerate() {
        assert!(run(&[*lambda]) == together[2 * i..2 * i + 2], "{lambda}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        assert!(pool.install(|| run(&LAMBDAS)) == together, "{threads}");
    }
}

#[test]
fn a_point_table_does_not_depend_on_other_increments() {
    let train = thinned("training_a.csv", 10);
    let training = Training::new(&train).unwrap();
    let run = |dx: &[f64]| {
        let plan = Plan::ewls(&[0.999], dx, Resample::Point);
        grid::run(&training, &plan, Lookup::Linear, &[], || ()).unwrap()
    };
    let together = run(&[0.05, 0.5, 1.0]);
    assert!(run(&[0.5])[0] == together[1]);
}

#[test]
fn the_grid_reproduces_the_reference_values() {
    // reference as in tests/identify/golden.rs
    let (train, validation) = (recording("training_a.csv"), recording("validation_a.csv"));
    let training = Training::new(&train).unwrap();
    for (resample, dx, expected) in [
        (
            Resample::Point,
            0.5,
            [0.987545, 0.951895, 0.827907, 0.363831],
        ),
        (Resample::Bin, 0.5, [0.988288, 0.951662, 0.827046, 0.363459]),
        (Resample::Bin, 1.0, [0.986332, 0.949471, 0.820778, 0.359412]),
    ] {
        let plan = Plan::ewls(&[0.99, 0.999, 0.9995, 0.9999], &[dx], resample);
        let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap();
        for (cell, expected) in cells.iter().zip(expected) {
            let vaf = cell.scores[0].vaf;
            assert!((vaf - expected).abs() <= 0.51e-6, "{vaf} {expected}");
        }
    }
}

#[test]
fn a_grid_of_several_methods_keeps_their_order_and_counts_its_cells() {
    let train = thinned("training_a.csv", 40);
    let validation = thinned("validation_a.csv", 40);
    let training = Training::new(&train).unwrap();
    let paper = |lambda| Method::Ewls(Ewls::paper(lambda, Resample::Bin));
    let plan = Plan {
        methods: vec![
            Spring.into(),
            paper(0.99),
            Static.into(),
            Method::Ewls(Ewls {
                bounded: true,
                ..Ewls::paper(0.99, Resample::Bin)
            }),
            paper(0.98),
        ],
        dx_mm: vec![1.0, 2.0],
    };
    let told = std::sync::atomic::AtomicUsize::new(0);
    let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || {
        told.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    })
    .unwrap();
    let found: Vec<_> = cells
        .iter()
        .map(|c| {
            (
                c.method.as_str(),
                c.method.lambda(),
                c.realization.provenance.dx_mm,
            )
        })
        .collect();
    let mut expected = vec![("spring", None, None)];
    for (word, lambda) in [
        ("ewls", Some(0.99)),
        ("static", None),
        ("constrained", Some(0.99)),
        ("ewls", Some(0.98)),
    ] {
        expected.push((word, lambda, Some(1.0)));
        expected.push((word, lambda, Some(2.0)));
    }
    assert_eq!(found, expected);
    assert_eq!(plan.cells(), cells.len());
    assert_eq!(told.into_inner(), cells.len());
}

#[test]
fn estimates_that_are_not_finite_are_an_error() {
    // a force whose square overflows
    let mut train = thinned("training_a.csv", 40);
    for f in &mut train.f_n {
        *f *= 1e307;
    }
    let training = Training::new(&train).unwrap();
    let plan = Plan::ewls(&[0.999], &[1.0], Resample::Bin);
    let found = grid::run(&training, &plan, Lookup::Linear, &[], || ());
    assert_eq!(found, Err(IdentifyError::Diverged { lambda: 0.999 }));
}
