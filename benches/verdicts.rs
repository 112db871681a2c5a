//! How often the verdicts of `analyze`, and the tests behind them, say yes.
//!
//! `cargo bench --bench verdicts -- --studies 10000 --power 1000` simulates this many
//! studies without an effect in each design, and so many with one. Ratings are whole
//! numbers from 1 to 7. The seed is fixed: the same numbers of studies print the same
//! tables for any number of threads. `--only "equally good"` simulates only tables with
//! these words in their title, `--world blocks` only this world. docs/calibration.md has
//! the results.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use study_analysis::analyze::{Rules, all_findings};
use study_base::rng::Stream;
use study_session::outcome::ratings::Ratings;
use study_stats::carry_over::{OrderedRating, carry_over};
use study_stats::clm::{CategoryCount, CategoryCounts, Predictor};
use study_stats::clmm::clmm_crossed;
use study_stats::disagreement::disagreement;
use study_stats::level::rejects;
use study_stats::lmm::{
    CellSummary, Criterion, FixedEffects, LmmData, RandomEffects, fit, slope_variance,
};

/// Which cells are missing.
#[derive(Clone, Copy)]
enum Missing {
    /// None.
    None,
    /// Each with probability 0.2.
    Random,
    /// Two of five: each participant rates another triple.
    Blocks,
    /// The first and the last realization but for three participants.
    Extremes,
    /// Of the first half of the participants the last realization, of the others the first.
    Overlap,
    /// Of the first half those above the middle, of the others those below it.
    Bridge,
    /// The same, and the middle one of the others, but for one participant who rates all.
    Thin,
    /// The same without that participant.
    Apart,
}

impl Missing {
    /// Whether a participant rates a realization, but for the random ones.
    fn rates(self, p: u32, participants: u32, m: usize, k: usize) -> bool {
        let (first, middle) = (p < participants / 2, k / 2);
        match self {
            Self::None | Self::Random => true,
            // The ten pairs of five that are missing.
            Self::Blocks => {
                let (a, step) = ((p % 5) as usize, 1 + (p as usize / 5) % 2);
                m != a && m != (a + step) % 5
            }
            Self::Extremes => p < 3 || (m > 0 && m + 1 < k),
            Self::Overlap => m != if first { k - 1 } else { 0 },
            Self::Bridge => m == middle || first == (m < middle),
            Self::Thin => p == 0 || first == (m <= middle),
            Self::Apart => first == (m <= middle),
        }
    }
}

/// A design, and how its participants differ.
#[derive(Clone, Copy)]
struct World {
    name: &'static str,
    participants: u32,
    realizations: usize,
    repetitions: u32,
    missing: Missing,
    /// Standard deviation of participants' preferences.
    taste: f64,
    /// Half of the participants rate higher with VAF, half lower: by this per standard
    /// deviation of VAF.
    camps: f64,
    /// What the camps disagree about.
    about: About,
    /// Participants' own slopes, per standard deviation of VAF.
    slopes: Slopes,
    /// The first half of the participants rates higher by this, the others lower.
    severity: f64,
    /// How often the last realization is rated in a repetition.
    last: u32,
    /// Everybody feels the realizations in the same order, and the rating falls by 0.2 per trial.
    one_order: bool,
}

/// What two camps of participants disagree about.
#[derive(Clone, Copy, PartialEq)]
enum About {
    /// The value of VAF; the camps are of equal size.
    Vaf,
    /// Anything: what is VAF for `Vaf` is the VAF of a random order of the realizations.
    Anything,
    /// The value of VAF; the camp of each participant is left to chance.
    VafByChance,
}

/// Participants' own slopes: normal with this standard deviation.
#[derive(Clone, Copy)]
enum Slopes {
    None,
    Own(f64),
    /// Less their mean, so that they cancel in tables without a missing cell.
    Cancel(f64),
}

const COMPLETE: World = World {
    name: "complete",
    participants: 10,
    realizations: 5,
    repetitions: 3,
    missing: Missing::None,
    taste: 0.5,
    camps: 0.0,
    about: About::Vaf,
    slopes: Slopes::None,
    severity: 0.0,
    last: 1,
    one_order: false,
};
const EXTREMES: World = World {
    name: "extremes",
    participants: 20,
    missing: Missing::Extremes,
    ..COMPLETE
};
const OVERLAP: World = World {
    name: "overlap",
    missing: Missing::Overlap,
    severity: 0.75,
    ..EXTREMES
};
const BRIDGE: World = World {
    name: "bridge",
    missing: Missing::Bridge,
    ..OVERLAP
};
const THIN: World = World {
    name: "thin bridge",
    missing: Missing::Thin,
    ..OVERLAP
};
const APART: World = World {
    name: "apart",
    missing: Missing::Apart,
    ..OVERLAP
};
const UNEVEN: World = World {
    name: "uneven",
    last: 4,
    ..COMPLETE
};
const ONE_ORDER: World = World {
    name: "one order",
    one_order: true,
    ..COMPLETE
};
const RANDOM: World = World {
    name: "random",
    missing: Missing::Random,
    ..COMPLETE
};
const BLOCKS: World = World {
    name: "blocks",
    missing: Missing::Blocks,
    ..COMPLETE
};
const FEW: World = World {
    name: "few",
    participants: 5,
    realizations: 12,
    repetitions: 1,
    ..COMPLETE
};
const CAMPS: World = World {
    name: "camps",
    camps: 0.7,
    ..COMPLETE
};
const CAMPS_RANDOM: World = World {
    name: "camps, random",
    missing: Missing::Random,
    ..CAMPS
};
const ELSEWHERE_RANDOM: World = World {
    name: "camps about anything, random",
    about: About::Anything,
    ..CAMPS_RANDOM
};
const CAMPS_BY_CHANCE: World = World {
    name: "camps by chance",
    about: About::VafByChance,
    ..CAMPS
};
const OWN_COMPLETE: World = World {
    name: "own slopes, complete",
    slopes: Slopes::Own(0.5),
    ..COMPLETE
};
const OWN_RANDOM: World = World {
    name: "own slopes, random",
    missing: Missing::Random,
    ..OWN_COMPLETE
};
const OWN_THIN: World = World {
    name: "own slopes, thin bridge",
    slopes: Slopes::Own(0.5),
    ..THIN
};
const OWN_EXTREMES: World = World {
    name: "own slopes, extremes",
    slopes: Slopes::Own(0.5),
    ..EXTREMES
};
const CANCEL_COMPLETE: World = World {
    name: "slopes cancel, complete",
    slopes: Slopes::Cancel(0.5),
    ..COMPLETE
};
const CANCEL_RANDOM: World = World {
    name: "slopes cancel, random",
    missing: Missing::Random,
    ..CANCEL_COMPLETE
};
const CANCEL_THIN: World = World {
    name: "slopes cancel, thin bridge",
    slopes: Slopes::Cancel(0.5),
    ..THIN
};
const EIGHT: World = World {
    name: "eight",
    realizations: 8,
    ..COMPLETE
};
const ALIKE: World = World {
    name: "alike",
    taste: 0.0,
    ..COMPLETE
};

/// What the realizations have in common for all participants.
#[derive(Clone, Copy, PartialEq)]
enum Truth {
    /// No realization is better.
    Equal,
    /// They differ at random, standard deviation 0.5, unrelated to VAF.
    Unrelated,
    /// 0.5 per standard deviation of VAF, and at random, standard deviation 0.3.
    Vaf,
    /// No realization is better, but 0.3 of a rating is carried over to the next.
    Carried,
    /// The last two are equally good, the others are lower by 1.5.
    TwoBest,
}

/// A trial: participant, realization, repetition, impression.
type Trial = (u32, usize, u32, f64);

/// VAF of the realizations, unevenly spaced.
fn vafs(k: usize) -> Vec<f64> {
    (0..k)
        .map(|i| 0.7 + 0.25 * ((i as f64 + 0.5) / k as f64).powf(1.3))
        .collect()
}

/// The same with mean 0 and standard deviation 1.
fn standardized(x: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let sd = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    x.iter().map(|x| (x - mean) / sd).collect()
}

/// The trials of one study in the order of presentation.
fn study(world: &World, truth: Truth, number: u32) -> Vec<Trial> {
    let key = [world.name, &format!("{}", truth as u8), &number.to_string()];
    let mut noise = Stream::new(2007, &["verdicts", key[0], key[1], key[2]]);
    let k = world.realizations;
    let x = standardized(&vafs(k));
    let (slope, spread) = match truth {
        Truth::Equal | Truth::TwoBest | Truth::Carried => (0.0, 0.0),
        Truth::Unrelated => (0.0, 0.5),
        Truth::Vaf => (0.5, 0.3),
    };
    let lower = |m: usize| {
        let is_lower = truth == Truth::TwoBest && m + 2 < k;
        if is_lower { 1.5 } else { 0.0 }
    };
    let means: Vec<f64> = (0..k)
        .map(|m| slope * x[m] + spread * noise.normal() - lower(m))
        .collect();
    // Draws of their own, so that the other worlds do not depend on them.
    let mut camps = Stream::new(2007, &["camps", key[0], key[1], key[2]]);
    let mut about = x.clone();
    if world.about == About::Anything {
        camps.shuffle(&mut about);
    }
    let slopes: Vec<f64> = match world.slopes {
        Slopes::None => vec![0.0; world.participants as usize],
        Slopes::Own(sd) | Slopes::Cancel(sd) => {
            let own: Vec<f64> = (0..world.participants)
                .map(|_| sd * camps.normal())
                .collect();
            let cancels = matches!(world.slopes, Slopes::Cancel(_));
            let mean = own.iter().sum::<f64>() / own.len() as f64;
            let less = if cancels { mean } else { 0.0 };
            own.iter().map(|slope| slope - less).collect()
        }
    };
    let mut trials = Vec::new();
    for p in 0..world.participants {
        let severe = if p < world.participants / 2 {
            world.severity
        } else {
            -world.severity
        };
        let level = 4.0 + 0.7 * noise.normal() + severe;
        let rises = match world.about {
            About::Vaf | About::Anything => p % 2 == 0,
            About::VafByChance => camps.below(2) == 0,
        };
        let camp = if rises { world.camps } else { -world.camps };
        let slope = slopes[p as usize];
        let own: Vec<f64> = (0..k)
            .map(|m| {
                level + means[m] + camp * about[m] + slope * x[m] + world.taste * noise.normal()
            })
            .collect();
        let rated: Vec<bool> = (0..k)
            .map(|m| match world.missing {
                Missing::Random => noise.below(5) > 0,
                other => other.rates(p, world.participants, m, k),
            })
            .collect();
        let mut before = 0.0;
        for r in 0..world.repetitions {
            let mut order: Vec<usize> = (0..k).filter(|&m| rated[m]).collect();
            if !world.one_order {
                noise.shuffle(&mut order);
            }
            let again = |m: usize| if m + 1 == k { world.last } else { 1 };
            let order = order
                .into_iter()
                .flat_map(|m| (0..again(m)).map(move |i| (m, i)));
            for (place, (m, again)) in order.enumerate() {
                let carried = if truth == Truth::Carried {
                    0.3 * before
                } else {
                    0.0
                };
                let drift = if world.one_order {
                    -0.2 * place as f64
                } else {
                    0.0
                };
                let rating = (own[m] + carried + drift + 0.8 * noise.normal())
                    .round()
                    .clamp(1.0, 7.0);
                before = rating - level;
                trials.push((p, m, r * world.last + again, rating));
            }
        }
    }
    trials
}

/// Whether each test says yes; `None` if it is undefined.
type Results = BTreeMap<String, Option<bool>>;

/// Statistics of the analysis that are compared with 5 %.
const TESTS: [&str; 16] = [
    "corr_adjusted/trend/p",
    "within_cells/p",
    "within_clustered/p_gg",
    "within_clustered/p_hf",
    "rmanova/p_gg",
    "rmanova/p_hf",
    "rmanova/p",
    "friedman/iman_davenport_p",
    "lmm_cells/p",
    "corr/pearson/p_exact_two_sided",
    "corr_adjusted/pearson/p_exact_two_sided",
    "corr_adjusted/pearson/p_monte_carlo_two_sided",
    "corr_adjusted/pearson/p_t",
    "lmm_vaf_crossed/slope_satterthwaite_p",
    "order_previous_rating/p",
    // Two realizations that are chosen before the ratings.
    "pair/m03|m04/p",
];

/// The findings of `analyze` and the tests behind them.
fn verdicts(world: &World, trials: &[Trial]) -> Results {
    let x = vafs(world.realizations);
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    let (mut index, mut of) = (0, 0);
    for &(p, m, r, rating) in trials {
        index = if p == of { index + 1 } else { 1 };
        of = p;
        csv += &format!("S{p:02},m{m:02},{},{rating},{},{index}\n", r + 1, x[m]);
    }
    let ratings = Ratings::read_csv("verdicts", csv.as_bytes(), None).expect("the table is valid");
    let (findings, evidence) = all_findings(&ratings, &Rules::default());
    let values = evidence.values();
    let mut results = Results::new();
    for finding in &findings {
        let id = format!("verdict: {}", finding.question.id());
        results.insert(id, finding.reason().is_none().then(|| finding.is_yes()));
    }
    for id in TESTS {
        results.insert(id.to_owned(), values.number(id).map(|p| rejects(p, 0.05)));
    }
    results
}

/// Tests of `study-stats` that need no analysis.
fn functions(world: &World, trials: &[Trial]) -> Results {
    let x = vafs(world.realizations);
    let mut cells: BTreeMap<(u32, usize), Vec<f64>> = BTreeMap::new();
    for &(p, m, _, rating) in trials {
        cells.entry((p, m)).or_default().push(rating);
    }
    let cells: Vec<CellSummary> = cells
        .iter()
        .map(|(&(p, m), ratings)| {
            let mean = ratings.iter().sum::<f64>() / ratings.len() as f64;
            CellSummary {
                subject: p as usize,
                realization: m,
                x: x[m],
                n: ratings.len(),
                mean,
                within: ratings.iter().map(|r| (r - mean).powi(2)).sum(),
            }
        })
        .collect();
    let center = x.iter().sum::<f64>() / x.len() as f64;
    let slopes = LmmData::new(&cells, FixedEffects::Covariate { center }).and_then(|table| {
        let without = fit(&table, RandomEffects::crossed(&table), Criterion::Reml)?;
        slope_variance(&without)
    });
    let orders: Vec<OrderedRating> = trials
        .iter()
        .map(|&(subject, m, block, rating)| OrderedRating {
            subject,
            realization: m as u32,
            block,
            rating,
        })
        .collect();
    let ordinal = clmm_crossed(&counts(&x, trials));
    let below = |p: Option<f64>| p.map(|p| rejects(p, 0.05));
    let ordinal = ordinal.as_ref();
    let wald = ordinal.map(|f| (f.fit.beta[0] / f.fit.se[0]).abs() >= 1.959_963_984_540_054);
    let list = [
        ("slope variance", below(slopes.ok().and_then(|s| s.p))),
        (
            "disagreement",
            below(disagreement(&cells).and_then(|d| d.p)),
        ),
        ("carry-over", below(carry_over(&orders).map(|c| c.p))),
        ("crossed ordinal, Wald", wald.ok()),
        (
            "crossed ordinal, χ²",
            ordinal.ok().and_then(|f| below(f.p_chi2)),
        ),
        ("crossed ordinal, t", ordinal.ok().and_then(|f| below(f.p))),
    ];
    list.map(|(name, yes)| (name.to_owned(), yes))
        .into_iter()
        .collect()
}

/// Counts for an ordinal model, with VAF from −1 to 1.
fn counts(x: &[f64], trials: &[Trial]) -> CategoryCounts {
    let mut used: Vec<u32> = trials.iter().map(|t| t.3 as u32).collect();
    used.sort_unstable();
    used.dedup();
    let (low, high) = (x[0], x[x.len() - 1]);
    let scaled = |v: f64| (2.0 * v - low - high) / (high - low);
    let predictors = x.iter().map(|&v| Predictor {
        column: 0,
        x: scaled(v),
    });
    let counts: Vec<CategoryCount> = trials
        .iter()
        .map(|&(subject, m, _, rating)| CategoryCount {
            subject,
            predictor: m as u32,
            category: used.partition_point(|u| f64::from(*u) < rating) as u32,
            n: 1,
        })
        .collect();
    CategoryCounts::new(predictors.collect(), 1, used.len(), &counts)
}

/// Studies that say yes, and studies in which the test is defined.
type Rates = BTreeMap<String, (u32, u32)>;

fn rates(studies: u32, of: impl Fn(u32) -> Results + Sync) -> Rates {
    let one = |number: u32| -> Rates {
        let results = of(number).into_iter();
        results
            .map(|(id, yes)| (id, (u32::from(yes == Some(true)), u32::from(yes.is_some()))))
            .collect()
    };
    let add = |mut all: Rates, one: Rates| {
        for (id, (yes, defined)) in one {
            let sum = all.entry(id).or_default();
            *sum = (sum.0 + yes, sum.1 + defined);
        }
        all
    };
    (0..studies)
        .into_par_iter()
        .map(one)
        .reduce(Rates::new, add)
}

/// Prints a table with a column for each world. A star: further from 5 % than three
/// binomial standard deviations. In brackets, if any: the share in which it is undefined.
fn table(
    title: &str,
    studies: u32,
    level: bool,
    worlds: &[(&World, Truth)],
    of: fn(&World, &[Trial]) -> Results,
) {
    let worlds: Vec<(&World, Truth)> = (worlds.iter().copied())
        .filter(|(world, _)| argument("--world").is_none_or(|name| name == world.name))
        .collect();
    if argument("--only").is_some_and(|words| !title.contains(&words)) {
        return;
    }
    println!("\n**{title}** ({studies} studies each)\n");
    let columns: Vec<Rates> = worlds
        .iter()
        .map(|(world, truth)| rates(studies, |number| of(world, &study(world, *truth, number))))
        .collect();
    let names: Vec<&str> = worlds.iter().map(|(world, _)| world.name).collect();
    println!("| test | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(names.len()));
    let mut ids: Vec<&String> = columns.iter().flat_map(BTreeMap::keys).collect();
    ids.sort();
    ids.dedup();
    let n = f64::from(studies);
    let three = 3.0 * (0.05 * 0.95 / n).sqrt();
    for id in ids {
        let cell = |rates: &Rates| match rates.get(id) {
            Some(&(yes, defined)) if defined > 0 => {
                let rate = f64::from(yes) / n;
                let star = if level && (rate - 0.05).abs() > three {
                    "*"
                } else {
                    ""
                };
                let undefined = f64::from(studies - defined) / n;
                let note = if undefined > 0.0 {
                    format!(" ({undefined:.3})")
                } else {
                    String::new()
                };
                format!("{rate:.4}{star}{note}")
            }
            _ => String::new(),
        };
        let cells: Vec<String> = columns.iter().map(cell).collect();
        if cells.iter().any(|c| !c.is_empty()) {
            println!("| {id} | {} |", cells.join(" | "));
        }
    }
}

/// What follows a name on the command line.
fn argument(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|a| a != name);
    arguments.nth(1)
}

fn main() {
    let number = |name: &str, default: u32| -> u32 {
        argument(name)
            .and_then(|n| n.parse().ok())
            .unwrap_or(default)
    };
    let (null, power) = (number("--studies", 10_000), number("--power", 1000));
    let all = [&COMPLETE, &RANDOM, &BLOCKS, &FEW, &CAMPS, &CAMPS_RANDOM];
    let with = |truth: Truth| all.map(|world| (world, truth));
    let unlike = [
        &EXTREMES, &OVERLAP, &BRIDGE, &THIN, &APART, &UNEVEN, &ONE_ORDER,
    ];
    let in_unlike = |truth: Truth| unlike.map(|world| (world, truth));
    table(
        "No realization is better",
        null,
        true,
        &with(Truth::Equal),
        verdicts,
    );
    table(
        "No realization is better: what the camps disagree about",
        null,
        true,
        &[&CAMPS_RANDOM, &ELSEWHERE_RANDOM, &CAMPS_BY_CHANCE].map(|world| (world, Truth::Equal)),
        verdicts,
    );
    table(
        "No realization is better: means of unlike precision",
        null,
        true,
        &in_unlike(Truth::Equal),
        verdicts,
    );
    let own = [
        &OWN_COMPLETE,
        &OWN_RANDOM,
        &OWN_THIN,
        &OWN_EXTREMES,
        &CANCEL_COMPLETE,
        &CANCEL_RANDOM,
        &CANCEL_THIN,
    ];
    let with_own = |truth: Truth| own.map(|world| (world, truth));
    table(
        "No realization is better: slopes of their own",
        null,
        true,
        &with_own(Truth::Equal),
        verdicts,
    );
    table(
        "They differ, unrelated to VAF",
        null,
        true,
        &with(Truth::Unrelated),
        verdicts,
    );
    table(
        "They differ, unrelated to VAF: means of unlike precision",
        null,
        true,
        &in_unlike(Truth::Unrelated),
        verdicts,
    );
    table(
        "They differ, unrelated to VAF: slopes of their own",
        null,
        true,
        &with_own(Truth::Unrelated),
        verdicts,
    );
    table(
        "Two are equally good, the others worse",
        null,
        true,
        &with(Truth::TwoBest),
        verdicts,
    );
    table(
        "Power: 0.5 per standard deviation of VAF",
        power,
        false,
        &with(Truth::Vaf),
        verdicts,
    );
    table(
        "Power: 0.5 per standard deviation of VAF: means of unlike precision",
        power,
        false,
        &in_unlike(Truth::Vaf),
        verdicts,
    );
    table(
        "Power: 0.5 per standard deviation of VAF: slopes of their own",
        power,
        false,
        &with_own(Truth::Vaf),
        verdicts,
    );
    let worlds = |truth: Truth| {
        [&ALIKE, &COMPLETE, &EIGHT, &RANDOM, &FEW, &CAMPS].map(|world| (world, truth))
    };
    table(
        "Functions, unrelated to VAF",
        null,
        true,
        &worlds(Truth::Unrelated),
        functions,
    );
    table(
        "Functions, power: VAF",
        power,
        false,
        &worlds(Truth::Vaf),
        functions,
    );
    table(
        "Functions, power: carry-over",
        power,
        false,
        &worlds(Truth::Carried),
        functions,
    );
}
