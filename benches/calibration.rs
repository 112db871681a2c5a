//! How often each test rejects at 5 % where there is nothing to find.
//!
//! `cargo bench --bench calibration -- --studies 10000`: so many simulated studies
//! of 10 × 5 × 3 ratings of 1 to 7 through the analysis as it ships, in each of two
//! worlds. In *alike* no realization differs from another. In *differ* realizations
//! differ by chance, standard deviation 0.5, and VAF has nothing to do with it: the
//! world in which "VAF predicts the rating" has to be rejected 5 % of the time. The
//! seed is fixed: the same number of studies prints the same table, whatever the
//! number of threads.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use study::analyze::{Rules, analyze};
use study::outcome::ratings::Ratings;
use study::rng::Stream;

const SUBJECTS: u32 = 10;
const MODELS: u32 = 5;
const REPETITIONS: u32 = 3;

#[derive(Clone, Copy, PartialEq)]
enum World {
    Alike,
    Differ,
}

/// Tests of "do realizations differ" and of the order, null in *alike*.
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
    "friedman/exact_p",
    "posthoc/m0|m1/p_t",
    "posthoc/m0|m1/p_wilcoxon_exact",
    "posthoc/m0|m1/p_wilcoxon_normal",
    "order_trial/p",
    "order_previous_rating/p",
    "icc_subjects/p_3",
    "lmm_model/p_satterthwaite",
    "lmm_model/satterthwaite_p",
    "lmm_model/kr_p",
    "lmm_model/lrt_p",
    "clmm_model_laplace/lrt_p",
];

/// Tests of VAF, null in both worlds.
const VAF: [&str; 16] = [
    "corr/pearson/p_t",
    "corr/pearson/p_exact_two_sided",
    "corr/pearson/p_exact_greater",
    "corr/spearman/p_exact_two_sided",
    "corr/kendall/p_exact_two_sided",
    "covariate/lambda/p",
    "covariate/log10_memory/p",
    "covariate/log10_memory/quadratic/p",
    "lmm_vaf_crossed/slope_satterthwaite_p",
    "lmm_vaf/slope_satterthwaite_p",
    "lmm_vaf_slope/slope_satterthwaite_p",
    "page/p_greater",
    "subject_corr/p",
    "subject_slope/p",
    "rmcorr_cells/p",
    "rmcorr_trials/p",
];

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let at = args.iter().position(|a| a == "--studies");
    let studies = at
        .and_then(|at| args.get(at + 1)?.parse().ok())
        .unwrap_or(10_000u32);
    let sd = (0.05 * 0.95 / f64::from(studies)).sqrt();
    println!("{studies} studies of {SUBJECTS} × {MODELS} × {REPETITIONS} in each world");
    println!(
        "5 % ± three binomial standard deviations: {:.4} to {:.4}",
        0.05 - 3.0 * sd,
        0.05 + 3.0 * sd
    );
    for (world, name) in [(World::Alike, "alike"), (World::Differ, "differ")] {
        println!("\nworld `{name}`");
        let counted = count(world, studies);
        for (id, (rejected, defined)) in &counted {
            let rate = f64::from(*rejected) / f64::from(studies);
            let within = if (rate - 0.05).abs() <= 3.0 * sd {
                ""
            } else {
                "  *"
            };
            let undefined = studies - defined;
            println!("{id:45} {rate:.4}{within}  undefined in {undefined}");
        }
    }
}

/// Rejections and definitions of each test. Sums of whole numbers: the order in
/// which studies end changes nothing.
fn count(world: World, studies: u32) -> BTreeMap<String, (u32, u32)> {
    let tests: Vec<&str> = match world {
        World::Alike => ALIKE.iter().chain(&VAF).copied().collect(),
        World::Differ => VAF.to_vec(),
    };
    (0..studies)
        .into_par_iter()
        .map(|number| {
            let a = analyze(&study(world, number), &Rules::default());
            let mut counts = BTreeMap::new();
            for id in &tests {
                if let Some(p) = a.values.number(id) {
                    counts.insert((*id).to_owned(), (u32::from(p <= 0.05), 1));
                }
            }
            let pairs = || a.values.iter().filter(|(id, _)| id.starts_with("posthoc/"));
            for name in ["p_t_holm", "p_wilcoxon_exact_holm"] {
                let smallest = pairs()
                    .filter(|(id, _)| id.ends_with(name))
                    .filter_map(|(id, _)| a.values.number(id))
                    .fold(f64::INFINITY, f64::min);
                if world == World::Alike && smallest.is_finite() {
                    let id = format!("posthoc, any of the ten, {name}");
                    counts.insert(id, (u32::from(smallest <= 0.05), 1));
                }
            }
            counts
        })
        .reduce(BTreeMap::new, |mut all, one| {
            for (id, (rejected, defined)) in one {
                let sum = all.entry(id).or_insert((0, 0));
                *sum = (sum.0 + rejected, sum.1 + defined);
            }
            all
        })
}

/// One study without an effect. Subjects differ in level (0.7) and in taste (0.5).
fn study(world: World, number: u32) -> Ratings {
    let name = if world == World::Alike {
        "alike"
    } else {
        "differ"
    };
    let mut noise = Stream::new(2007, &["calibration", name, &number.to_string()]);
    let of_model: Vec<f64> = (0..MODELS)
        .map(|_| match world {
            World::Alike => 0.0,
            World::Differ => 0.5 * noise.normal(),
        })
        .collect();
    let vaf = [0.701, 0.742, 0.778, 0.785, 0.793];
    let lambda = [0.9991, 0.9993, 0.9995, 0.9997, 0.9999];
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index,lambda\n");
    for s in 0..SUBJECTS {
        let level = 4.0 + 0.7 * noise.normal();
        let taste: Vec<f64> = (0..MODELS).map(|_| 0.5 * noise.normal()).collect();
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
                    vaf[m],
                    lambda[m]
                );
            }
        }
    }
    Ratings::read_csv("calibration", csv.as_bytes(), None).expect("the table is a good one")
}
