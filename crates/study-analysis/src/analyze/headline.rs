//! The main results: `realistic/*`, the share of the variance between realizations
//! that VAF explains (`corr/share/*`), variance components (`variance/*`), and the
//! main results without the exclusions (`before_exclusion/*`).

use super::Rules;
use super::cells::{Cells, within};
use super::correlation::{Correlation, Share};
use super::design::Design;
use super::mixed::{Coefficients, LmmVafCrossed};
use super::record::{Interval, Number as _, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::anova::one_way;
use study_stats::correlation::equivalence;
use study_stats::distribution::t_quantile;
use study_stats::paired::equivalence_of;
use study_stats::power::{detectable_correlation, detectable_difference};
use study_stats::proportion::share;

statistics! {
    /// Ratings at or above `realistic_from`. Participants, not ratings, are the sampling units: the variance of the share p is that of a ratio over participants, v = S/(S−1)·Σ(hᵢ − p·nᵢ)²/N² (Cochran 1977, §6.3).
    pub struct Realistic {
        /// ratings of the realization
        n: Stat,
        /// share of them at or above the threshold
        share: Stat,
        /// p(1−p)/v, at most N (Korn & Graubard 1998), and S where all participants agree, because v = 0 does not mean certainty
        n_effective: Stat,
        /// Wilson's (1927) with `n_effective` trials and t(.975, S−1)
        ci95: Interval,
    }

    /// Whether the rating changes by less than the margin from the lowest to the highest VAF, with an `equivalence_margin`.
    pub struct SmallEffect {
        /// the margin, in rating points
        margin: Stat,
        /// slope of `lmm_vaf_crossed` times the range of VAF: the change of the rating from the lowest to the highest
        effect: Stat,
        /// of the two one-sided tests that it lies within ± the margin
        p: Stat,
        /// 90 % interval of `effect`
        ci90: Interval,
    }

    /// Whether the correlation with VAF is within ± the margin, with an `equivalence_r`.
    pub struct SmallCorrelation {
        /// the margin
        margin: Stat,
        /// the larger one of the two one-sided tests that the correlation of `corr_adjusted/pearson` lies within ± the margin, by Fisher's z with n − 3 for n realizations (Goertzen & Cribbie 2010)
        p: Stat,
        /// 90 % interval of r
        ci90: Interval,
    }

    /// Equivalence of VAF.
    pub struct EquivalenceOfVaf {
        /// of its effect
        vaf: Option<SmallEffect>,
        /// of its correlation
        r: Option<SmallCorrelation>,
    }

    /// The smallest effects that the design finds with a power of 80 % at the level of significance, without a correction for several pairs.
    pub struct Sensitivity {
        /// the smallest true correlation of VAF with the means
        correlation: Stat,
        /// the smallest mean difference of a pair, in standard deviations of the differences
        difference: Stat,
    }

    /// Shares of the variance of a rating.
    pub struct VarianceShares {
        /// of participants
        subject: Stat,
        /// of realizations
        model: Stat,
        /// of participants × realizations and noise together
        interaction_and_noise: Stat,
        /// of participants × realizations
        interaction: Stat,
        /// of repetitions
        noise: Stat,
    }

    /// Variance components from the expected mean squares of the cells of the complete table, with h the mean of 1/(ratings of a cell): E MS_subject = Mσ²ₛ + σ²ₛₘ + hσ², E MS_model = Sσ²ₘ + σ²ₛₘ + hσ², E MS_error = σ²ₛₘ + hσ² (Searle, Casella & McCulloch 1992). Negative estimates are set to 0.
    pub struct Variance {
        /// of participants
        subject: Stat,
        /// of realizations
        model: Stat,
        /// of participants × realizations
        interaction: Stat,
        /// of repetitions
        noise: Stat,
        /// without repetitions interaction and noise cannot be separated
        interaction_and_noise: Option<Stat>,
        /// relative to their sum
        share: Option<VarianceShares>,
    }
}

/// Whether the rating changes by less than the margin from the lowest to the highest VAF,
/// by the slope of the crossed mixed model, and whether the correlation is within ± the margin.
pub(super) fn equivalence_of_vaf(
    cells: &Cells<'_>,
    correlation: &Correlation,
    crossed: &LmmVafCrossed,
    rules: &Rules,
) -> EquivalenceOfVaf {
    let effect = |margin| little_effect_of_vaf(cells, margin, &crossed.coefficients);
    let r = |margin| little_correlation(margin, correlation);
    EquivalenceOfVaf {
        vaf: rules.equivalence_margin.map(effect),
        r: rules.equivalence_r.map(r),
    }
}

fn little_effect_of_vaf(cells: &Cells<'_>, margin: f64, model: &Coefficients) -> SmallEffect {
    let vaf = |&m: &usize| cells.vaf[m];
    let vaf: Vec<f64> = cells.tested().iter().filter_map(vaf).collect();
    let range = vaf.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))
        - vaf.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    let slope = (model.slope.number())
        .zip(model.slope_se.number())
        .zip(model.slope_satterthwaite_df.number());
    let found = slope.and_then(|((slope, se), df)| {
        let tests = equivalence_of(slope * range, se * range, df, margin)?;
        Some((slope * range, tests))
    });
    let why = "there is no slope of the crossed mixed model";
    SmallEffect {
        margin: Stat::of(margin),
        effect: Stat::or(found.map(|(effect, _)| effect), why),
        p: Stat::or(found.map(|(_, tests)| tests.p), why),
        ci90: Interval::or(found.map(|(_, tests)| tests.ci90), why),
    }
}

fn little_correlation(margin: f64, correlation: &Correlation) -> SmallCorrelation {
    let r = correlation.pearson.r.number();
    let found = r.and_then(|r| equivalence(r, correlation.n() as f64 - 3.0, margin));
    let why = "there is no correlation, it is ±1, or it rests on fewer than four realizations";
    SmallCorrelation {
        margin: Stat::of(margin),
        p: Stat::or(found.map(|e| e.p), why),
        ci90: Interval::or(found.map(|e| e.ci90), why),
    }
}

/// The smallest effects that the design finds with a power of 80 %.
pub(super) fn sensitivity(design: Design, correlation: &Correlation, alpha: f64) -> Sensitivity {
    let r = detectable_correlation(correlation.n(), POWER, alpha);
    let difference = detectable_difference(design.analyzed(), POWER, alpha);
    Sensitivity {
        correlation: Stat::or(r, "fewer than three realizations with a VAF"),
        difference: Stat::or(difference, "fewer than two participants"),
    }
}

/// The power for which the smallest effects are given.
const POWER: f64 = 0.8;

/// Shares of ratings at or above a threshold, with subjects as clusters.
pub(super) fn realistic(cells: &Cells<'_>, from: f64) -> BTreeMap<RealizationName, Realistic> {
    let r = cells.ratings;
    let mut clusters: Vec<Vec<(f64, f64)>> = vec![Vec::new(); r.models.len()];
    for cell in &cells.cells {
        let rows = &cells.order[cell.rows.clone()];
        let hits = rows
            .iter()
            .filter(|&&i| r.rating[i].is_some_and(|v| v >= from))
            .count();
        clusters[cell.model].push((hits as f64, rows.len() as f64));
    }
    let shares = clusters.iter().enumerate().map(|(m, clusters)| {
        let found = share(clusters);
        let realistic = Realistic {
            n: Stat::of(clusters.iter().map(|c| c.1).sum()),
            share: Stat::or(found.map(|s| s.share), "no ratings"),
            n_effective: Stat::or(found.map(|s| s.n_effective), "no ratings"),
            ci95: Interval::or(found.and_then(|s| s.ci95), "fewer than two subjects"),
        };
        (cells.model_name(m).into(), realistic)
    });
    shares.collect()
}

/// The share of the variance between realizations that VAF explains: r² of the means
/// and its adjusted version 1 − (1 − r²)(n − 1)/(n − 2) (Ezekiel 1930); and the
/// critical |r| at the level of significance. The crossed model's share is computed
/// with that model.
pub(super) fn explain(correlation: &mut Correlation, alpha: f64) {
    let Some(n) = correlation.n_models.number() else {
        return;
    };
    let r2 = correlation.pearson.r.number().map(|r| r * r);
    let needed = t_quantile(1.0 - alpha / 2.0, n - 2.0)
        .filter(|_| n >= 3.0)
        .map(|t| t / (n - 2.0 + t * t).sqrt());
    let adjusted = r2.map(|r2| 1.0 - (1.0 - r2) * (n - 1.0) / (n - 2.0));
    let why = "no correlation over realizations";
    correlation.share = Some(Share {
        r2: Stat::or(r2, why),
        r2_adjusted: Stat::or(adjusted, why),
        var_model_crossed: None,
    });
    let few = "fewer than three realizations with a VAF";
    correlation.pearson.critical_r = Some(Stat::or(needed, few));
}

/// Variance components of the complete table, by the expected mean squares of its
/// cells: with h the mean of 1/(ratings of a cell), σ² within cells,
/// E(MS subjects) = M σ²ₛ + σ²ₛₘ + hσ², E(MS realizations) = S σ²ₘ + σ²ₛₘ + hσ²,
/// E(MS error) = σ²ₛₘ + hσ² (Searle, Casella & McCulloch 1992, §5.3; for balanced
/// tables the usual analysis of variance). Negative estimates are set to 0.
pub(super) fn components(cells: &Cells<'_>) -> Variance {
    let table = cells.table(&cells.tested());
    let (s, m) = (table.rows.len() as f64, table.models.len() as f64);
    let found = one_way(&table.rows);
    let own: Vec<_> = (cells.cells.iter())
        .filter(|c| table.subjects.binary_search(&c.subject).is_ok())
        .filter(|c| table.models.binary_search(&c.model).is_ok())
        .collect();
    let (squares, df) = within(own.iter().copied());
    let h = own.iter().map(|c| 1.0 / c.rows.len() as f64).sum::<f64>() / own.len() as f64;
    let noise = (df > 0).then(|| squares / df as f64);
    let Some(a) = found else {
        return Variance::undefined("fewer than two complete subjects or realizations");
    };
    let error = a.effect.ss_error / a.effect.df2;
    let subject = ((a.ss_subject / (s - 1.0) - error) / m).max(0.0);
    let model = ((a.effect.ss / a.effect.df1 - error) / s).max(0.0);
    let interaction = noise.map(|noise| (error - h * noise).max(0.0));
    // Without repetitions interaction and noise are confounded.
    let rest = interaction.zip(noise).map_or(error, |(i, n)| i + n);
    let total = subject + model + rest;
    let why = "no cell has two ratings: it is part of `interaction_and_noise`";
    let of = |x: f64| Stat::or((total > 0.0).then(|| x / total), "all ratings are equal");
    let of_part = |x: Option<f64>| x.map_or(Stat::missing(why), of);
    Variance {
        subject: Stat::of(subject),
        model: Stat::of(model),
        interaction: Stat::or(interaction, why),
        noise: Stat::or(noise, why),
        interaction_and_noise: Some(Stat::of(rest)),
        share: Some(VarianceShares {
            subject: of(subject),
            model: of(model),
            interaction_and_noise: of(rest),
            interaction: of_part(interaction),
            noise: of_part(noise),
        }),
    }
}
