//! How often each test rejects at 5 % under its null hypothesis.
//!
//! `cargo bench --bench calibration -- --studies 10000` analyses this many simulated
//! studies of 10 participants × 5 realizations × 3 repetitions, with ratings of 1 to 7,
//! in each of three scenarios. In *level* participants differ only in their level. In
//! *taste* each prefers some realizations, but there is no preference on average. In
//! *differ* the realizations differ as well, at random with standard deviation 0.5 and
//! independently of VAF: the null hypothesis of "VAF predicts the rating". The seed is
//! fixed: the same number of studies prints the same table for any number of threads.
//!
//! An exact test can attain only some values of p. Its attainable level is the share of
//! all equally likely arrangements of a study's own data (orders of the realizations,
//! signs of the differences) with p ≤ .05, averaged over the studies.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use study_analysis::analyze::{Rules, Values, analyze};
use study_base::rng::Stream;
use study_session::outcome::ratings::Ratings;
use study_stats::correlation::{kendall, pearson, spearman};
use study_stats::rank::doubled_ranks;

const SUBJECTS: u32 = 10;
const MODELS: u32 = 5;
const REPETITIONS: u32 = 3;

/// How the simulated ratings vary.
#[derive(Clone, Copy, PartialEq)]
enum Scenario {
    Level,
    Taste,
    Differ,
}

/// Tests of differences between realizations and of order effects: their null hypothesis
/// holds in *level* and *taste*.
const DIFFERENCE_TESTS: [&str; 21] = [
    "rmanova/p",
    "rmanova/p_gg",
    "rmanova/p_hf",
    "rmanova/mauchly_p",
    "rmanova2/model/p_gg",
    "rmanova2/rep/p_gg",
    "rmanova2/inter/p_gg",
    "friedman/p",
    "friedman/iman_davenport_p",
    "posthoc/m0|m1/p_t",
    "posthoc/m0|m1/p_wilcoxon_exact",
    "posthoc/m0|m1/p_wilcoxon_normal",
    "order_trial/p",
    "order_previous_rating/p",
    "icc_subjects/p_3",
    "lmm_model/satterthwaite_p",
    "lmm_model/kenward_roger_p",
    "lmm_model/lrt_p",
    "clm_model/beta/m1",
    "clmm_model_laplace/beta/m1",
    "clmm_model_quad/beta/m1",
];

/// Tests of VAF: their null hypothesis holds in every scenario.
const VAF_TESTS: [&str; 24] = [
    "corr/pearson/p_t",
    "corr/pearson/p_exact_two_sided",
    "corr/pearson/p_exact_greater",
    "corr/spearman/p_exact_two_sided",
    "corr/spearman/p_exact_greater",
    "corr/kendall/p_exact_two_sided",
    "corr/kendall/p_exact_greater",
    "covariate/lambda/p",
    "covariate/log10_memory/p",
    "covariate/log10_memory/quadratic/p",
    "lmm_vaf_crossed/slope_satterthwaite_p",
    "lmm_vaf/slope_satterthwaite_p",
    "lmm_vaf/lrt_p",
    "lmm_vaf_slope/slope_satterthwaite_p",
    "clm_vaf/beta/vaf",
    "clmm_vaf_laplace/beta/vaf",
    "clmm_vaf_quad/beta/vaf",
    "page/p_greater",
    "subject_corr/p",
    "subject_slope/p",
    "rmcorr_cells/p",
    "rmcorr_trials/p",
    "bootstrap/percentile",
    "bootstrap/bca",
];

/// Families of pairwise tests: any of the ten rejects after Holm's correction.
const FAMILIES: [&str; 2] = ["p_t_holm", "p_wilcoxon_exact_holm"];

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let at = args.iter().position(|a| a == "--studies");
    let studies = at
        .and_then(|at| args.get(at + 1)?.parse().ok())
        .unwrap_or(10_000u32);
    println!("{studies} studies of {SUBJECTS} × {MODELS} × {REPETITIONS} in each scenario.");
    println!("`*`: further than three binomial standard deviations from the attainable level.");
    for scenario in [Scenario::Level, Scenario::Taste, Scenario::Differ] {
        let name = scenario.name();
        println!("\n| scenario `{name}` | rejected | attainable | ± | | undefined in |");
        println!("|---|---|---|---|---|---|");
        for (id, found) in &count(scenario, studies) {
            let n = f64::from(studies);
            let rate = f64::from(found.rejected) / n;
            let level = found.attainable as f64 / (n * UNIT);
            let three = 3.0 * (level * (1.0 - level) / n).sqrt();
            let mark = if (rate - level).abs() <= three {
                ""
            } else {
                "*"
            };
            let undefined = studies - found.defined;
            let id = id.replace('|', "\\|");
            println!("| `{id}` | {rate:.4} | {level:.4} | {three:.4} | {mark} | {undefined} |");
        }
    }
}

/// A level of 1 in [`Rates::attainable`]. Levels are added as whole numbers, so that the
/// order in which studies finish does not affect the sum.
const UNIT: f64 = 1e9;

#[derive(Default, Clone, Copy)]
struct Rates {
    rejected: u32,
    defined: u32,
    attainable: u64,
}

fn count(scenario: Scenario, studies: u32) -> BTreeMap<String, Rates> {
    let tests: Vec<&str> = match scenario {
        Scenario::Level | Scenario::Taste => {
            DIFFERENCE_TESTS.iter().chain(&VAF_TESTS).copied().collect()
        }
        Scenario::Differ => VAF_TESTS.to_vec(),
    };
    (0..studies)
        .into_par_iter()
        .map(|number| {
            let ratings = study(scenario, number);
            let v = analyze(&ratings, &Rules::default()).values;
            let cells = Cells::of(&ratings);
            let mut found = BTreeMap::new();
            for id in &tests {
                let rejected = rejects(&v, id);
                found.insert((*id).to_owned(), one(rejected, cells.attainable(id)));
            }
            for name in FAMILIES.iter().filter(|_| scenario != Scenario::Differ) {
                let pairs = v.iter().map(|(id, _)| id);
                let pairs = pairs.filter(|id| id.starts_with("posthoc/") && id.ends_with(name));
                let rejected = pairs.filter_map(|id| rejects(&v, id)).reduce(|a, b| a | b);
                found.insert(format!("posthoc, any, {name}"), one(rejected, 0.05));
            }
            found
        })
        .reduce(BTreeMap::new, |mut all, one| {
            for (id, one) in one {
                let sum: &mut Rates = all.entry(id).or_default();
                sum.rejected += one.rejected;
                sum.defined += one.defined;
                sum.attainable += one.attainable;
            }
            all
        })
}

/// An undefined test does not reject.
fn one(rejected: Option<bool>, attainable: f64) -> Rates {
    Rates {
        rejected: u32::from(rejected == Some(true)),
        defined: u32::from(rejected.is_some()),
        attainable: (attainable * UNIT).round() as u64,
    }
}

/// Whether a test rejects at 5 %: by its p, by Wald's z, or because its interval excludes 0.
fn rejects(v: &Values, id: &str) -> Option<bool> {
    if let Some((group, name)) = id.split_once("/beta/") {
        let se = v.number(&format!("{group}/se/{name}"))?;
        return Some((v.number(id)? / se).abs() >= 1.959_963_984_540_054);
    }
    if let Some(kind) = id.strip_prefix("bootstrap/") {
        let low = v.number(&format!("bootstrap/{kind}_lo"))?;
        let high = v.number(&format!("bootstrap/{kind}_hi"))?;
        return Some(low > 0.0 || high < 0.0);
    }
    Some(v.number(id)? <= 0.05)
}

const VAFS: [f64; MODELS as usize] = [0.701, 0.742, 0.778, 0.785, 0.793];

/// Sums of the three ratings of each cell, by participant and realization.
struct Cells(Vec<[f64; MODELS as usize]>);

impl Cells {
    fn of(r: &Ratings) -> Self {
        let mut sums = vec![[0.0; MODELS as usize]; SUBJECTS as usize];
        for i in 0..r.len() {
            if let (Some(model), Some(rating)) = (r.model[i], r.rating[i]) {
                sums[r.subject[i] as usize][model as usize] += rating;
            }
        }
        Self(sums)
    }

    /// Share of the equally likely arrangements with p ≤ .05; .05 for tests that are not
    /// exact.
    fn attainable(&self, id: &str) -> f64 {
        let two_sided = id.ends_with("two_sided");
        let statistic: fn(&[f64], &[f64]) -> Option<f64> = match id.rsplit_once("/p_exact") {
            Some(("corr/pearson", _)) => pearson,
            Some(("corr/spearman", _)) => spearman,
            Some(("corr/kendall", _)) => kendall,
            _ if id.ends_with("|m1/p_wilcoxon_exact") => return self.signed_ranks(),
            _ => return 0.05,
        };
        let means = (0..MODELS as usize).map(|m| self.0.iter().map(|s| s[m]).sum());
        let mut means: Vec<f64> = means.collect();
        let mut all = Vec::with_capacity(120);
        orders(&mut means, 0, &mut |y| {
            let found = statistic(&VAFS, y).unwrap_or(0.0);
            all.push(if two_sided { found.abs() } else { found });
        });
        let p = |at: f64| {
            let as_far = all.iter().filter(|x| **x >= at - 1e-9).count();
            as_far as f64 / all.len() as f64
        };
        let rejected = all.iter().filter(|x| p(**x) <= 0.05).count();
        rejected as f64 / all.len() as f64
    }

    /// The attainable level of Wilcoxon's test of the first two realizations, over all
    /// signs of the differences.
    fn signed_ranks(&self) -> f64 {
        let d = self.0.iter().map(|s| (s[0] - s[1]).abs());
        let d: Vec<f64> = d.filter(|d| *d > 0.0).collect();
        let ranks = doubled_ranks(&d);
        // The number of sign patterns for each sum of positive ranks.
        let mut patterns = vec![0u64; ranks.iter().sum::<i64>() as usize + 1];
        patterns[0] = 1;
        for &rank in &ranks {
            for at in (rank as usize..patterns.len()).rev() {
                patterns[at] += patterns[at - rank as usize];
            }
        }
        let total: u64 = patterns.iter().sum();
        let rejected = (0..patterns.len()).filter(|&at| {
            let below: u64 = patterns[..=at].iter().sum();
            let above: u64 = patterns[at..].iter().sum();
            2.0 * below.min(above) as f64 / total as f64 <= 0.05
        });
        rejected.map(|at| patterns[at]).sum::<u64>() as f64 / total as f64
    }
}

/// Calls `visit` for every order of the values from `from` on.
fn orders(x: &mut [f64], from: usize, visit: &mut impl FnMut(&[f64])) {
    if from == x.len() {
        return visit(x);
    }
    for i in from..x.len() {
        x.swap(from, i);
        orders(x, from + 1, visit);
        x.swap(from, i);
    }
}

impl Scenario {
    fn name(self) -> &'static str {
        match self {
            Self::Level => "level",
            Self::Taste => "taste",
            Self::Differ => "differ",
        }
    }

    /// Standard deviations of the realizations and of the preferences.
    fn spread(self) -> (f64, f64) {
        match self {
            Self::Level => (0.0, 0.0),
            Self::Taste => (0.0, 0.5),
            Self::Differ => (0.5, 0.5),
        }
    }
}

/// One study without an effect of VAF. The levels of participants have the standard
/// deviation 0.7.
fn study(scenario: Scenario, number: u32) -> Ratings {
    let mut noise = Stream::new(2007, &["calibration", scenario.name(), &number.to_string()]);
    let (of_models, of_tastes) = scenario.spread();
    let of_model: Vec<f64> = (0..MODELS).map(|_| of_models * noise.normal()).collect();
    let lambda = [0.9991, 0.9993, 0.9995, 0.9997, 0.9999];
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index,lambda\n");
    for s in 0..SUBJECTS {
        let level = 4.0 + 0.7 * noise.normal();
        let taste: Vec<f64> = (0..MODELS).map(|_| of_tastes * noise.normal()).collect();
        let mut trial = 0;
        for r in 0..REPETITIONS {
            let mut order: Vec<usize> = (0..MODELS as usize).collect();
            noise.shuffle(&mut order);
            for m in order {
                trial += 1;
                let impression = level + of_model[m] + taste[m] + 0.8 * noise.normal();
                let rating = impression.round().clamp(1.0, 7.0);
                csv += &format!(
                    "S{s:02},m{m},{},{rating},{},{trial},{}\n",
                    r + 1,
                    VAFS[m],
                    lambda[m]
                );
            }
        }
    }
    Ratings::read_csv("calibration", csv.as_bytes(), None).expect("the table is valid")
}
