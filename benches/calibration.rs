//! How often each test rejects at 5 % where there is nothing to find.
//!
//! `cargo bench --bench calibration -- --studies 10000`: so many simulated studies
//! of 10 × 5 × 3 ratings of 1 to 7 through the analysis as it ships, in each of three
//! worlds. In *level* participants differ in nothing but their level. In *taste* each
//! likes some realizations more than others, but all together like none more. In
//! *differ* realizations differ as well, by chance, standard deviation 0.5, and VAF
//! has nothing to do with it: the world in which "VAF predicts the rating" has to be
//! rejected 5 % of the time. The seed is fixed: the same number of studies prints the
//! same table, whatever the number of threads.
//!
//! An exact test can reach only some p. Its attainable level is the share of all
//! equally likely arrangements of a study's own data (orders of the realizations,
//! signs of the differences) with p ≤ .05, averaged over the studies.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use study_base::rng::Stream;
use study_core::analyze::{Rules, Values, analyze};
use study_core::outcome::ratings::Ratings;
use study_stats::correlation::{kendall, pearson, spearman};
use study_stats::rank::doubled_ranks;

const SUBJECTS: u32 = 10;
const MODELS: u32 = 5;
const REPETITIONS: u32 = 3;

#[derive(Clone, Copy, PartialEq)]
enum World {
    Level,
    Taste,
    Differ,
}

/// Tests of "do realizations differ" and of the order, null where they do not.
const ALIKE: [&str; 21] = [
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

/// Tests of VAF, null everywhere.
const VAF: [&str; 24] = [
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

/// Families of pairs: any of the ten after Holm's correction.
const FAMILIES: [&str; 2] = ["p_t_holm", "p_wilcoxon_exact_holm"];

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let at = args.iter().position(|a| a == "--studies");
    let studies = at
        .and_then(|at| args.get(at + 1)?.parse().ok())
        .unwrap_or(10_000u32);
    println!("{studies} studies of {SUBJECTS} × {MODELS} × {REPETITIONS} in each world.");
    println!("`*`: further than three binomial standard deviations from the attainable level.");
    for world in [World::Level, World::Taste, World::Differ] {
        let name = world.name();
        println!("\n| world `{name}` | rejected | attainable | ± | | undefined in |");
        println!("|---|---|---|---|---|---|");
        for (id, found) in &count(world, studies) {
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

/// What a level of 1 counts in [`Found::attainable`]. Whole numbers, so that the
/// order in which studies end changes no sum.
const UNIT: f64 = 1e9;

#[derive(Default, Clone, Copy)]
struct Found {
    rejected: u32,
    defined: u32,
    attainable: u64,
}

fn count(world: World, studies: u32) -> BTreeMap<String, Found> {
    let tests: Vec<&str> = match world {
        World::Level | World::Taste => ALIKE.iter().chain(&VAF).copied().collect(),
        World::Differ => VAF.to_vec(),
    };
    (0..studies)
        .into_par_iter()
        .map(|number| {
            let ratings = study(world, number);
            let v = analyze(&ratings, &Rules::default()).values;
            let cells = Cells::of(&ratings);
            let mut found = BTreeMap::new();
            for id in &tests {
                let rejected = rejects(&v, id);
                found.insert((*id).to_owned(), one(rejected, cells.attainable(id)));
            }
            for name in FAMILIES.iter().filter(|_| world != World::Differ) {
                let pairs = v.iter().map(|(id, _)| id);
                let pairs = pairs.filter(|id| id.starts_with("posthoc/") && id.ends_with(name));
                let rejected = pairs.filter_map(|id| rejects(&v, id)).reduce(|a, b| a | b);
                found.insert(format!("posthoc, any, {name}"), one(rejected, 0.05));
            }
            found
        })
        .reduce(BTreeMap::new, |mut all, one| {
            for (id, one) in one {
                let sum: &mut Found = all.entry(id).or_default();
                sum.rejected += one.rejected;
                sum.defined += one.defined;
                sum.attainable += one.attainable;
            }
            all
        })
}

/// A test that is not defined does not reject.
fn one(rejected: Option<bool>, attainable: f64) -> Found {
    Found {
        rejected: u32::from(rejected == Some(true)),
        defined: u32::from(rejected.is_some()),
        attainable: (attainable * UNIT).round() as u64,
    }
}

/// Whether a test rejects at 5 %: by its p, by Wald's z, by an interval without 0.
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

/// Sums of the ratings by subject and realization: all cells hold three.
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

    /// Share of the equally likely arrangements with p ≤ .05; .05 of a test that
    /// is not exact.
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

    /// All signs of the differences of the first two realizations.
    fn signed_ranks(&self) -> f64 {
        let d = self.0.iter().map(|s| (s[0] - s[1]).abs());
        let d: Vec<f64> = d.filter(|d| *d > 0.0).collect();
        let ranks = doubled_ranks(&d);
        // How many of the signs give each sum of positive ranks.
        let mut ways = vec![0u64; ranks.iter().sum::<i64>() as usize + 1];
        ways[0] = 1;
        for &rank in &ranks {
            for at in (rank as usize..ways.len()).rev() {
                ways[at] += ways[at - rank as usize];
            }
        }
        let total: u64 = ways.iter().sum();
        let rejected = (0..ways.len()).filter(|&at| {
            let below: u64 = ways[..=at].iter().sum();
            let above: u64 = ways[at..].iter().sum();
            2.0 * below.min(above) as f64 / total as f64 <= 0.05
        });
        rejected.map(|at| ways[at]).sum::<u64>() as f64 / total as f64
    }
}

/// Every order of the values from `from` on.
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

impl World {
    fn name(self) -> &'static str {
        match self {
            Self::Level => "level",
            Self::Taste => "taste",
            Self::Differ => "differ",
        }
    }

    /// Standard deviations of the realizations and of the tastes.
    fn spread(self) -> (f64, f64) {
        match self {
            Self::Level => (0.0, 0.0),
            Self::Taste => (0.0, 0.5),
            Self::Differ => (0.5, 0.5),
        }
    }
}

/// One study without an effect of VAF. Participants differ in level (0.7).
fn study(world: World, number: u32) -> Ratings {
    let mut noise = Stream::new(2007, &["calibration", world.name(), &number.to_string()]);
    let (of_models, of_tastes) = world.spread();
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
                let felt = level + of_model[m] + taste[m] + 0.8 * noise.normal();
                let rating = felt.round().clamp(1.0, 7.0);
                csv += &format!(
                    "S{s:02},m{m},{},{rating},{},{trial},{}\n",
                    r + 1,
                    VAFS[m],
                    lambda[m]
                );
            }
        }
    }
    Ratings::read_csv("calibration", csv.as_bytes(), None).expect("the table is a good one")
}
