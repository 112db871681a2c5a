//! Properties of every fit. `tests/analyze/golden.rs` of the repository compares the
//! numbers with other programs.

use super::*;
use crate::correlation::{p_of_r, pearson};
use crate::random::{RandomSource, SplitMix64};

/// Balanced complete cells: subject + model + cell + noise.
fn balanced(seed: u64, subjects: usize, x: &[f64], n: usize, spread: [f64; 4]) -> Vec<CellSummary> {
    let mut noise = SplitMix64::new(seed);
    let of_realization: Vec<f64> = x.iter().map(|x| x + spread[1] * noise.normal()).collect();
    let mut cells = Vec::new();
    for subject in 0..subjects {
        let bias = spread[0] * noise.normal();
        for (realization, level) in of_realization.iter().enumerate() {
            let here = level + bias + spread[2] * noise.normal();
            let rows: Vec<f64> = (0..n).map(|_| here + spread[3] * noise.normal()).collect();
            let mean = rows.iter().sum::<f64>() / n as f64;
            cells.push(CellSummary {
                subject,
                realization,
                x: x[realization],
                n,
                mean,
                within: rows.iter().map(|r| (r - mean).powi(2)).sum(),
            });
        }
    }
    cells
}

const X: [f64; 6] = [0.1, 0.5, 0.55, 0.9, 1.3, 2.0];
const CROSSED: RandomEffects = RandomEffects {
    slope: false,
    realization: true,
    cell: true,
};

fn table(cells: &[CellSummary]) -> LmmData {
    LmmData::new(cells, FixedEffects::Covariate { center: 0.9 }).unwrap()
}

fn close(a: f64, b: f64, relative: f64) {
    assert!(
        (a - b).abs() <= relative * a.abs().max(b.abs()),
        "{a} is not {b}"
    );
}

/// In balanced complete data off the boundary the realizations are the units of
/// inference, and the crossed model agrees with Pearson's correlation.
#[test]
fn the_crossed_models_p_is_pearsons_over_realization_means() {
    let mut off_the_boundary = 0;
    for seed in 0..20 {
        let cells = balanced(seed, 8, &X, 3, [0.7, 0.8, 0.5, 1.0]);
        let table = table(&cells);
        let fit = fit(&table, CROSSED, Criterion::Reml).unwrap();
        if fit.singular {
            continue;
        }
        off_the_boundary += 1;
        let means: Vec<f64> = (0..X.len())
            .map(|m| {
                let own = cells.iter().filter(|c| c.realization == m);
                own.map(|c| c.mean).sum::<f64>() / 8.0
            })
            .collect();
        let p = p_of_r(pearson(&X, &means).unwrap(), X.len() as f64 - 2.0).unwrap();
        let slope = fit.t_test(&[0.0, 1.0]);
        close(slope.df.unwrap(), X.len() as f64 - 2.0, 1e-5);
        close(slope.p.unwrap(), p, 1e-5);
    }
    assert!(off_the_boundary >= 10, "only {off_the_boundary}");
}

/// For balanced data off the boundary REML agrees with the analysis of variance.
#[test]
fn a_balanced_random_intercept_has_its_closed_form() {
    let (subjects, n) = (7usize, 2usize);
    let cells = balanced(3, subjects, &X, n, [1.0, 0.5, 0.0, 1.0]);
    let table = LmmData::new(&cells, FixedEffects::Realizations).unwrap();
    let fit = fit(&table, RandomEffects::default(), Criterion::Reml).unwrap();
    let per_subject = (X.len() * n) as f64;
    let of_subject = |s: usize| {
        let own = cells.iter().filter(|c| c.subject == s);
        own.map(|c| c.mean).sum::<f64>() / X.len() as f64
    };
    let of_realization = |m: usize| {
        let own = cells.iter().filter(|c| c.realization == m);
        own.map(|c| c.mean).sum::<f64>() / subjects as f64
    };
    let grand = (0..subjects).map(of_subject).sum::<f64>() / subjects as f64;
    let ms_subject = (0..subjects)
        .map(|s| per_subject * (of_subject(s) - grand).powi(2))
        .sum::<f64>()
        / (subjects as f64 - 1.0);
    let ss_error: f64 = cells
        .iter()
        .map(|c| {
            let e = c.mean - of_subject(c.subject) - of_realization(c.realization) + grand;
            c.within + n as f64 * e * e
        })
        .sum();
    let total = subjects as f64 * per_subject;
    let df = total - subjects as f64 - X.len() as f64 + 1.0;
    close(fit.variances.error, ss_error / df, 1e-9);
    close(
        fit.variances.intercept,
        (ms_subject - ss_error / df) / per_subject,
        1e-8,
    );
    // Both denominator degrees of freedom are then those of the residual.
    close(fit.f_test().unwrap().df2.unwrap(), df, 1e-5);
    let adjusted = kenward_roger(&fit).unwrap();
    close(adjusted.df2.unwrap(), df, 1e-8);
    close(adjusted.f, fit.f_test().unwrap().f, 1e-8);
}

/// Unequal numbers of ratings and missing cells: the degrees of freedom of F depend on
/// the choice of contrasts. R 4.2.2, lmerTest 3.1.3,
/// `anova(lmer(y ~ m + (1 | s)))`: F 4.5316903505 on 2 and 11.5614721934,
/// p .0352250596.
#[test]
fn f_over_unequal_numbers_takes_the_contrasts_of_lmertest() {
    let ratings: [&[(usize, f64)]; 6] = [
        &[(0, 3.0), (0, 4.0), (1, 5.0), (2, 4.0)],
        &[(0, 2.0), (1, 4.0), (1, 3.0)],
        &[(0, 5.0), (1, 6.0), (2, 6.0), (2, 7.0)],
        &[(1, 5.0), (2, 5.0), (2, 7.0)],
        &[(0, 2.0), (2, 4.0), (2, 3.0)],
        &[(0, 6.0), (1, 6.0)],
    ];
    let mut cells = Vec::new();
    for (subject, own) in ratings.iter().enumerate() {
        for cell in own.chunk_by(|a, b| a.0 == b.0) {
            let mean = cell.iter().map(|c| c.1).sum::<f64>() / cell.len() as f64;
            cells.push(CellSummary {
                subject,
                realization: cell[0].0,
                x: 0.0,
                n: cell.len(),
                mean,
                within: cell.iter().map(|c| (c.1 - mean).powi(2)).sum(),
            });
        }
    }
    let table = LmmData::new(&cells, FixedEffects::Realizations).unwrap();
    let found = fit(&table, RandomEffects::default(), Criterion::Reml)
        .unwrap()
        .f_test()
        .unwrap();
    close(found.f, 4.531_690_350_5, 1e-6);
    close(found.df2.unwrap(), 11.561_472_193_4, 1e-5);
    close(found.p.unwrap(), 0.035_225_059_6, 1e-5);
}

#[test]
fn a_variance_on_the_boundary_is_exactly_zero() {
    // Each subject has the same mean.
    let mut cells = balanced(5, 6, &X, 2, [0.0, 1.0, 0.0, 1.0]);
    for own in cells.chunk_by_mut(|a, b| a.subject == b.subject) {
        let mean = own.iter().map(|c| c.mean).sum::<f64>() / X.len() as f64;
        own.iter_mut().for_each(|c| c.mean -= mean);
    }
    let table = LmmData::new(&cells, FixedEffects::Realizations).unwrap();
    let fit = fit(&table, RandomEffects::default(), Criterion::Reml).unwrap();
    assert_eq!(fit.variances.intercept, 0.0);
    assert!(fit.singular);
}

/// Cells with different n, so that each subject has its own pattern.
fn ragged(seed: u64) -> Vec<CellSummary> {
    let mut noise = SplitMix64::new(seed);
    balanced(seed, 9, &X, 3, [0.8, 0.4, 0.3, 1.0])
        .into_iter()
        .filter_map(|c| {
            let n = (noise.normal().abs() * 2.0) as usize;
            (n > 0).then_some(CellSummary { n, ..c })
        })
        .map(|c| CellSummary {
            within: if c.n == 1 { 0.0 } else { c.within },
            ..c
        })
        .collect()
}

#[test]
fn shift_scale_names_and_order_do_not_matter() {
    for random in [
        RandomEffects::default(),
        RandomEffects {
            slope: true,
            ..RandomEffects::default()
        },
        CROSSED,
    ] {
        let cells = ragged(11);
        let table = table(&cells);
        let a = fit(&table, random, Criterion::Reml).unwrap();
        let mut moved: Vec<CellSummary> = cells
            .iter()
            .map(|c| CellSummary {
                subject: 100 - c.subject,
                realization: 50 - c.realization,
                x: 10.0 * c.x - 3.0,
                n: c.n,
                mean: 4.0 * c.mean + 1000.0,
                within: 16.0 * c.within,
            })
            .collect();
        moved.reverse();
        let moved = LmmData::new(&moved, FixedEffects::Covariate { center: 6.0 }).unwrap();
        let b = fit(&moved, random, Criterion::Reml).unwrap();
        let (v, w) = (a.variances, b.variances);
        close(16.0 * v.error, w.error, 1e-6);
        assert!((16.0 * v.intercept - w.intercept).abs() < 1e-5 * w.error);
        assert!((0.16 * v.slope - w.slope).abs() < 1e-5 * w.error);
        assert!((16.0 * v.realization - w.realization).abs() < 1e-5 * w.error);
        assert!((16.0 * v.cell - w.cell).abs() < 1e-5 * w.error);
        let (s, t) = (a.t_test(&[0.0, 1.0]), b.t_test(&[0.0, 1.0]));
        close(0.4 * s.estimate, t.estimate, 1e-6);
        close(s.df.unwrap(), t.df.unwrap(), 1e-3);
        close(s.p.unwrap(), t.p.unwrap(), 1e-3);
    }
}

/// The sufficient statistics of a shared pattern give the same fit as its subjects.
#[test]
fn subjects_of_one_pattern_are_aggregated_without_loss() {
    let cells = balanced(2, 30, &X, 3, [0.7, 0.6, 0.4, 1.0]);
    let shared = table(&cells);
    assert_eq!(shared.patterns.len(), 1);
    assert!(shared.patterns[0].rows.len() <= X.len());
    let mut apart = shared.clone();
    apart.patterns = cells
        .chunks(6)
        .map(|own| {
            let row: Vec<f64> = own
                .iter()
                .map(|c| (c.mean - shared.y_center) / shared.y_scale)
                .collect();
            data::Pattern {
                subjects: 1.0,
                units: shared.patterns[0].units.clone(),
                sum: row.clone(),
                rows: vec![row],
            }
        })
        .collect();
    let a = fit(&shared, CROSSED, Criterion::Reml).unwrap();
    let b = fit(&apart, CROSSED, Criterion::Reml).unwrap();
    close(a.deviance, b.deviance, 1e-12);
    close(a.variances.realization, b.variances.realization, 1e-7);
}

#[test]
fn undefined_models_have_a_reason() {
    let cells = balanced(1, 4, &X, 1, [1.0, 1.0, 1.0, 1.0]);
    let table = table(&cells);
    let error = |r: Result<LmmFit<'_>, LmmError>| r.unwrap_err();
    assert_eq!(
        error(fit(&table, CROSSED, Criterion::Reml)),
        LmmError::NoRepetition
    );
    let new = |cells: &[CellSummary]| {
        LmmData::new(cells, FixedEffects::Covariate { center: 0.0 }).unwrap_err()
    };
    assert_eq!(new(&[]), LmmError::NoData);
    assert_eq!(new(&cells[..6]), LmmError::OneSubject);
    let change = |f: &dyn Fn(&CellSummary) -> CellSummary| cells.iter().map(f).collect::<Vec<_>>();
    assert_eq!(
        new(&change(&|c| CellSummary { x: 0.7, ..*c })),
        LmmError::ConstantCovariate
    );
    assert_eq!(
        new(&change(&|c| CellSummary { mean: 4.0, ..*c })),
        LmmError::ConstantRatings
    );
    assert_eq!(
        new(&change(&|c| CellSummary {
            mean: f64::INFINITY,
            ..*c
        })),
        LmmError::NoData
    );
    let additive = change(&|c| CellSummary {
        mean: c.x + c.subject as f64,
        ..*c
    });
    let additive = LmmData::new(&additive, FixedEffects::Realizations).unwrap();
    assert_eq!(
        error(fit(&additive, RandomEffects::default(), Criterion::Ml)),
        LmmError::NoError
    );
    let two: Vec<CellSummary> = cells
        .iter()
        .filter(|c| c.realization < 2)
        .copied()
        .collect();
    let two = LmmData::new(&two, FixedEffects::Covariate { center: 0.3 }).unwrap();
    let crossed = RandomEffects {
        cell: false,
        ..CROSSED
    };
    assert_eq!(
        error(fit(&two, crossed, Criterion::Reml)),
        LmmError::FewRealizations
    );
}

/// Small tables of small whole numbers, which often lie on boundaries.
#[test]
fn random_small_tables_give_numbers_or_reasons() {
    let mut draws = SplitMix64::new(9);
    let mut fits = 0;
    for _ in 0..60 {
        let mut below = |n: f64| ((draws.normal().abs() * 7.0) % n) as usize;
        let (subjects, realizations) = (1 + below(5.0), 1 + below(5.0));
        let mut cells = Vec::new();
        for subject in 0..subjects {
            for realization in 0..realizations {
                let n = below(4.0);
                if n > 0 {
                    cells.push(CellSummary {
                        subject,
                        realization,
                        x: below(3.0) as f64,
                        n,
                        mean: below(7.0) as f64,
                        within: if n > 1 { below(5.0) as f64 } else { 0.0 },
                    });
                }
            }
        }
        for fixed in [
            FixedEffects::Intercept,
            FixedEffects::Realizations,
            FixedEffects::Covariate { center: 1.0 },
        ] {
            let Ok(table) = LmmData::new(&cells, fixed) else {
                continue;
            };
            for bits in 0..8 {
                let random = RandomEffects {
                    slope: bits & 1 > 0 && matches!(fixed, FixedEffects::Covariate { .. }),
                    realization: bits & 2 > 0 && fixed != FixedEffects::Realizations,
                    cell: bits & 4 > 0,
                };
                let Ok(found) = fit(&table, random, Criterion::Reml) else {
                    continue;
                };
                fits += 1;
                let v = found.variances;
                for x in [
                    found.deviance,
                    v.intercept,
                    v.slope,
                    v.realization,
                    v.cell,
                    v.error,
                ] {
                    assert!(x.is_finite(), "{random:?} {found:?}");
                }
                assert!(
                    v.intercept >= 0.0 && v.slope >= 0.0 && v.realization >= 0.0 && v.cell >= 0.0
                );
                let mut l = vec![0.0; table.columns()];
                l[0] = 1.0;
                let t = found.t_test(&l);
                assert!(t.estimate.is_finite() && t.se.is_finite());
                for p in [t.p, found.f_test().and_then(|f| f.p)]
                    .into_iter()
                    .flatten()
                {
                    assert!((0.0..=1.0).contains(&p));
                }
                kenward_roger(&found);
            }
        }
    }
    assert!(fits > 120, "only {fits} fits");
}

/// Every combination of variances on the boundary occurs.
#[test]
fn the_closed_form_of_balanced_data_is_the_fit() {
    let mut singular = 0;
    for seed in 0..120 {
        let n = [3, 1][seed as usize % 2];
        let spread = [
            [0.6, 0.3, 0.4, 0.8],
            [0.0, 0.0, 0.0, 1.0],
            [0.5, 0.0, 0.3, 1.0],
            [0.0, 0.5, 0.3, 0.6],
            [0.2, 0.2, 0.1, 1.0],
        ][seed as usize % 5];
        let cells = balanced(seed, 10, &X, n, spread);
        let table = table(&cells);
        let random = RandomEffects {
            cell: n > 1,
            ..CROSSED
        };
        let fit = fit(&table, random, Criterion::Reml).unwrap();
        let general = fit.t_tests(&[vec![0.0, 1.0]])[0];
        let means: Vec<f64> = cells.iter().map(|c| c.mean).collect();
        let within = cells.iter().map(|c| c.within).sum();
        let closed = balanced_slope(&means, &X, n, within).unwrap();
        close(closed.estimate, general.estimate, 1e-9);
        close(closed.se, general.se, 1e-6);
        close(closed.df, general.df.unwrap(), 2e-6);
        let p = crate::distribution::t_two_sided(closed.estimate / closed.se, closed.df);
        assert!((p.unwrap() - general.p.unwrap()).abs() < 1e-6, "{seed}");
        assert_eq!(closed.singular, fit.singular, "{seed}");
        singular += u32::from(closed.singular);
    }
    assert!((30..100).contains(&singular), "{singular}");
}

#[test]
fn a_balanced_table_without_error_or_realizations_has_no_closed_form() {
    let means = [1.0, 2.0, 4.0, 2.0, 3.0, 5.0];
    let x = [0.0, 1.0, 2.0];
    assert_eq!(balanced_slope(&means, &x, 2, 0.0), None);
    assert_eq!(balanced_slope(&means[..3], &x, 2, 1.0), None);
    assert_eq!(balanced_slope(&means, &[1.0; 3], 2, 1.0), None);
    assert!(balanced_slope(&means, &x, 2, 1.0).is_some());
}
