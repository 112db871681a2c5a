//! Contrasts with other realizations: `reference/*` compares each tested realization
//! with each reference, anchor and physical sample over subjects; `duplicate/*` is
//! a hidden duplicate minus its original.

use super::Rules;
use super::cells::Cells;
use super::exclude;
use super::record::{DuplicateName, Interval, RealizationName, ReferenceName, Stat, statistics};
use std::collections::BTreeMap;
use study_plan::protocol::Role;
use study_stats::describe::{is_constant, mean, rounded};
use study_stats::level::rejects;
use study_stats::paired::{equivalence, holm, one_sample};

statistics! {
    /// Test realization T minus reference R (roles `hidden-reference`, `low-anchor`, `physical`) over the participants who rated both.
    pub struct ReferenceTest {
        /// participants
        n: Stat,
        /// mean of the differences
        mean_diff: Stat,
        /// its interval
        ci95: Interval,
        /// paired t test
        t: Stat,
        /// two-sided
        p_t: Stat,
        /// corrected over the test realizations
        p_t_holm: Stat,
        /// the larger p of the two one-sided t tests (Schuirmann 1987); without a margin stated in advance there is no equivalence test, and the reason says so
        p_tost: Stat,
        /// what they are held against
        equivalence: Option<ReferenceEquivalence> as "",
    }

    /// With `[analysis] equivalence_margin`: two one-sided t tests (Schuirmann 1987).
    pub struct ReferenceEquivalence {
        /// the margin, in rating points
        margin: Stat,
        /// against −margin
        t_lower: Stat,
        /// against +margin
        t_upper: Stat,
        /// interval of the difference
        ci90: Interval,
        /// 1 if `p_tost` is significant
        equivalent: Stat,
    }

    /// Repeat minus original over participants.
    pub struct DuplicateTest {
        /// participants
        n: Stat,
        /// mean of the differences
        mean_diff: Stat,
        /// its interval
        ci95: Interval,
        /// paired t test
        t: Stat,
        /// two-sided
        p_t: Stat,
        /// mean of the absolute differences
        mean_absolute_diff: Stat,
    }

    /// Contrasts with realizations that are not tested.
    pub struct References {
        /// each reference and test realization
        reference: BTreeMap<ReferenceName, BTreeMap<RealizationName, ReferenceTest>>,
        /// a hidden repeat serves only to measure consistency
        duplicate: BTreeMap<DuplicateName, DuplicateTest>,
    }
}

pub(super) fn reference(cells: &Cells<'_>, rules: &Rules) -> References {
    let tests = cells.tested();
    let models = cells.ratings.models.iter().enumerate();
    let references = models.filter(|(_, model)| match model.role {
        Role::Test | Role::Practice => false,
        Role::HiddenReference | Role::LowAnchor | Role::MidAnchor | Role::Physical => true,
    });
    References {
        reference: references
            .map(|(m, _)| {
                (
                    cells.model_name(m).into(),
                    contrasts(cells, m, &tests, rules),
                )
            })
            .collect(),
        duplicate: duplicates(cells),
    }
}

/// Tested realization minus reference, over the subjects who rated both.
fn contrasts(
    cells: &Cells<'_>,
    r: usize,
    tests: &[usize],
    rules: &Rules,
) -> BTreeMap<RealizationName, ReferenceTest> {
    let found: Vec<(usize, Vec<f64>)> = (tests.iter())
        .map(|&t| {
            let pair = cells.table(&[t, r]);
            (t, differences(&pair.rows))
        })
        .collect();
    let p: Vec<Option<f64>> = (found.iter())
        .map(|(_, d)| one_sample(d).and_then(|t| t.p))
        .collect();
    let all = found.iter().zip(holm(&p));
    all.map(|((t, differences), p_holm)| {
        let name = cells.model_name(*t).into();
        (name, contrast(differences, p_holm, rules))
    })
    .collect()
}

fn contrast(differences: &[f64], p_holm: Option<f64>, rules: &Rules) -> ReferenceTest {
    let test = one_sample(differences);
    let why = if differences.len() < 2 {
        "fewer than two subjects rated both"
    } else {
        "all differences are equal"
    };
    let margin = rules.equivalence_margin;
    let e = margin.and_then(|margin| equivalence(differences, margin));
    let within = |p: f64| f64::from(u8::from(rejects(p, rules.alpha)));
    let no_p = match margin {
        Some(_) => why,
        None => "no equivalence margin was set in advance",
    };
    ReferenceTest {
        n: Stat::count(differences.len()),
        mean_diff: Stat::or(mean(differences), "nobody rated both"),
        ci95: Interval::or(test.map(|t| t.ci95), why),
        t: Stat::or(test.and_then(|t| t.t), why),
        p_t: Stat::or(test.and_then(|t| t.p), why),
        p_t_holm: Stat::or(p_holm, why),
        p_tost: Stat::or(e.map(|e| e.p), no_p),
        equivalence: margin.map(|margin| ReferenceEquivalence {
            margin: Stat::of(margin),
            t_lower: Stat::or(e.map(|e| e.t_lower), why),
            t_upper: Stat::or(e.map(|e| e.t_upper), why),
            ci90: Interval::or(e.map(|e| e.ci90), why),
            equivalent: Stat::or(e.map(|e| within(e.p)), why),
        }),
    }
}

/// First minus second of each row; equal numbers if they differ by rounding only.
fn differences(rows: &[Vec<f64>]) -> Vec<f64> {
    let exact: Vec<f64> = rows.iter().map(|r| r[0] - r[1]).collect();
    let equal: Vec<f64> = exact.iter().map(|d| rounded(*d)).collect();
    if is_constant(&equal) { equal } else { exact }
}

/// Hidden duplicate minus original, over subjects.
fn duplicates(cells: &Cells<'_>) -> BTreeMap<DuplicateName, DuplicateTest> {
    let pairs = exclude::pairs(cells.ratings).into_iter();
    pairs
        .map(|(d, o)| {
            let pair = cells.table(&[d, o]);
            let differences = differences(&pair.rows);
            (cells.model_name(d).into(), duplicate(&differences))
        })
        .collect()
}

fn duplicate(differences: &[f64]) -> DuplicateTest {
    let sizes: Vec<f64> = differences.iter().map(|v| v.abs()).collect();
    let test = one_sample(differences);
    let few = "fewer than two subjects";
    let why = match test {
        Some(_) => "all differences are equal",
        None => few,
    };
    DuplicateTest {
        n: Stat::count(differences.len()),
        mean_diff: Stat::or(test.map(|t| t.mean), few),
        ci95: Interval::or(test.map(|t| t.ci95), few),
        t: Stat::or(test.and_then(|t| t.t), why),
        p_t: Stat::or(test.and_then(|t| t.p), why),
        mean_absolute_diff: Stat::or(mean(&sizes), few),
    }
}
