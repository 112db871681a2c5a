use super::*;
use crate::psychometric::Curve;
use crate::random::SplitMix64;

fn ladder() -> Support {
    Support {
        low: (0.02f64).ln(),
        high: (0.6f64).ln(),
        least: 0.1,
    }
}

fn condition() -> Condition {
    Condition {
        core: Core::Gumbel,
        experiment: Experiment::ForcedChoice(0.5),
        support: ladder(),
        width: WidthPrior::OfRatios,
    }
}

/// Counts that are expected of participants with these logarithms of thresholds, at nine levels.
fn expected(thresholds: &[(usize, usize, f64)], trials: f64) -> Vec<Cell> {
    let cell = |&(participant, condition, threshold): &(usize, usize, f64)| {
        let curve = Curve {
            core: Core::Gumbel,
            threshold,
            width: 1.6,
            gamma: 0.5,
            lambda: 0.02,
        };
        let level = |i: i32| {
            let level = ladder().low + 0.4 * f64::from(i);
            Level {
                level,
                positive: (trials * curve.value(level)).round(),
                trials,
            }
        };
        Cell {
            participant,
            condition,
            levels: (0..9).map(level).collect(),
        }
    };
    thresholds.iter().map(cell).collect()
}

fn fit(conditions: usize, cells: &[Cell], effort: Effort) -> Population {
    let conditions = vec![condition(); conditions];
    let priors = PopulationPriors::of(WidthPrior::OfRatios);
    partial_pooling(&conditions, cells, &priors, effort, &mut SplitMix64::new(3)).unwrap()
}

const FOUR: [(usize, usize, f64); 8] = [
    (0, 0, -2.3),
    (0, 1, -2.0),
    (1, 0, -2.0),
    (1, 1, -1.8),
    (2, 0, -1.9),
    (2, 1, -1.5),
    (3, 0, -2.5),
    (3, 1, -2.1),
];

#[test]
fn a_population_and_its_participants_are_found() {
    let found = fit(2, &expected(&FOUR, 30.0), Effort::ANALYSIS);
    assert_eq!(found.diagnostics.problem(), None, "{:?}", found.diagnostics);
    let [a, b] = found.conditions[..] else {
        panic!("two conditions");
    };
    assert!((a.mean + 2.175).abs() < 0.05, "{a:?}");
    assert!((b.mean + 1.85).abs() < 0.05, "{b:?}");
    let contrast = found.contrasts[0];
    assert!((contrast.difference.mean - (a.mean - b.mean)).abs() < 1e-12);
    assert!(contrast.above < 0.05, "{contrast:?}");
    for (cell, (participant, _, threshold)) in found.cells.iter().zip(FOUR) {
        assert!(
            (cell.mean - threshold).abs() < 0.12,
            "{participant}: {cell:?}"
        );
        assert!(cell.ci95.0 < threshold && threshold < cell.ci95.1);
    }
    // Thresholds are drawn towards their mean, and so differ less.
    let spread = |x: &[f64]| crate::describe::sd(x).unwrap();
    let firsts: Vec<f64> = found.cells.iter().step_by(2).map(|c| c.mean).collect();
    assert!(spread(&firsts) < spread(&[-2.3, -2.0, -1.9, -2.5]));
}

/// The error of the quadrature: with tables twice as fine the density is the same up to a constant,
/// at the mode and far from it.
#[test]
fn finer_tables_have_the_same_density() {
    let data = Data::new(&[condition(); 2], &expected(&FOUR, 12.0)).unwrap();
    let priors = PopulationPriors::of(WidthPrior::OfRatios);
    let densities = |fineness: f64| {
        let tables = table::Tables::new(&data, &priors, fineness);
        let model = marginal::Model::new(&data, &priors, tables);
        // μ, μ, τ^⅔, σ^⅔, ν, κ^⅔, λ^⅓
        let places = [
            [-2.1, -1.8, 0.4, 0.25, 0.5, 0.35, 0.2],
            [-2.1, -1.8, 0.05, 0.05, 0.5, 0.05, 0.25],
            [-2.4, -1.9, 0.7, 0.5, 1.0, 0.6, 0.35],
            [-1.9, -2.0, 0.3, 0.4, -0.3, 0.2, 0.15],
        ];
        places.map(|at| model.log_density(&at))
    };
    let (coarse, fine) = (densities(1.0), densities(2.0));
    for i in 1..4 {
        let error = (coarse[i] - coarse[0]) - (fine[i] - fine[0]);
        assert!(error.abs() < 0.01, "{i}: {error}");
    }
}

/// Nobody's answers say anything, of whom the population says all.
#[test]
fn whoever_answers_by_chance_is_as_the_others() {
    let mut cells = expected(
        &[
            (0, 0, -2.2),
            (1, 0, -2.0),
            (2, 0, -1.9),
            (3, 0, -2.1),
            (4, 0, -2.0),
        ],
        30.0,
    );
    let few = |level: f64, positive| Level {
        level,
        positive,
        trials: 2.0,
    };
    cells.push(Cell {
        participant: 5,
        condition: 0,
        levels: vec![few(-3.0, 1.0), few(-2.9, 1.0)],
    });
    let found = fit(1, &cells, Effort::SIMULATION);
    let last = found.cells[5];
    assert!(
        (last.mean - found.conditions[0].mean).abs() < 0.1,
        "{last:?}"
    );
    assert!(last.sd > found.between.mean, "{last:?} {:?}", found.between);
}

#[test]
fn data_without_a_population_are_refused() {
    let priors = PopulationPriors::of(WidthPrior::OfRatios);
    let reason = |conditions: &[Condition], cells: &[Cell]| {
        let random = &mut SplitMix64::new(3);
        partial_pooling(conditions, cells, &priors, Effort::SIMULATION, random).unwrap_err()
    };
    let cells = expected(&FOUR, 12.0);
    assert_eq!(
        reason(&[condition()], &expected(&FOUR[..1], 12.0)),
        NoPooling::OneParticipant
    );
    let yes_no = Condition {
        experiment: Experiment::YesNo,
        ..condition()
    };
    assert_eq!(reason(&[condition(), yes_no], &cells), NoPooling::YesNo);
    let even = Condition {
        width: WidthPrior::Even,
        ..condition()
    };
    assert_eq!(reason(&[condition(), even], &cells), NoPooling::Scales);
    // A condition that does not exist, one without cells, a cell without trials, the same cell twice.
    assert_eq!(reason(&[condition()], &cells), NoPooling::Invalid);
    assert_eq!(reason(&[condition(); 3], &cells), NoPooling::Invalid);
    let mut empty = cells.clone();
    empty[0].levels.clear();
    assert_eq!(reason(&[condition(); 2], &empty), NoPooling::Invalid);
    let mut twice = cells.clone();
    twice.push(cells[0].clone());
    assert_eq!(reason(&[condition(); 2], &twice), NoPooling::Invalid);
    // A participant who is left out in the numbering.
    let mut gap = cells.clone();
    gap[7].participant = 9;
    assert_eq!(reason(&[condition(); 2], &gap), NoPooling::Invalid);
}

/// Each diagnostic decides by itself.
#[test]
fn a_model_that_has_not_converged_says_so() {
    let good = Diagnostics {
        draws: 4096,
        effective: 2000.0,
        pareto_k: 0.3,
        r_hat: 1.002,
        error: 0.02,
        at_edge: 0.0,
    };
    assert_eq!(good.problem(), None);
    let bad = |change: fn(&mut Diagnostics)| {
        let mut found = good;
        change(&mut found);
        found.problem()
    };
    assert_eq!(bad(|d| d.pareto_k = 0.71), Some(Problem::HeavyWeights));
    assert_eq!(bad(|d| d.pareto_k = f64::NAN), Some(Problem::HeavyWeights));
    assert_eq!(bad(|d| d.effective = 399.0), Some(Problem::FewEffective));
    assert_eq!(bad(|d| d.r_hat = 1.02), Some(Problem::SetsDiffer));
    assert_eq!(bad(|d| d.at_edge = 0.02), Some(Problem::AtEdge));
}

#[test]
fn coordinates_and_places_are_inverse() {
    for coordinate in [Coordinate::Place(2.0), Coordinate::FromOrigin(0.3)] {
        let theta = coordinate.of(0.7).unwrap();
        assert!((coordinate.place(theta) - 0.7).abs() < 1e-15);
        // At the threshold the argument is 0, half a width above it ½.
        assert!(coordinate.argument(0.7, theta, 0.4).abs() < 1e-15);
    }
    assert_eq!(Coordinate::FromOrigin(0.3).of(0.3), None);
    let width = 0.4f64.exp();
    let above = Coordinate::Place(2.0).argument(0.7 + width, 0.35, 0.4);
    assert!((above - 0.5).abs() < 1e-15);
    let above = Coordinate::FromOrigin(0.3).argument(0.7 + 0.2 * width, 0.4f64.ln(), 0.4);
    assert!((above - 0.5).abs() < 1e-15);
}
