//! Partial pooling: how close the thresholds of participants and groups come to the truth, and
//! whether the intervals hold it; simulation-based calibration; and the power for Weber fractions of .10 and .14.
//!
//! ```text
//! cargo bench --bench pooling -- --groups 500 --file pooling.csv     # groups of simulated participants
//! cargo bench --bench pooling -- --ranks 2000 --file ranks.csv       # populations drawn from the prior
//! cargo bench --bench pooling -- --picture ranks.svg --file ranks.csv
//! cargo bench --bench pooling -- --weber 500 --file weber.csv        # studies of Weber fractions
//! cargo bench --bench pooling -- --table --file pooling.csv          # what is in a file
//! ```
//!
//! A file has one line for each group. What is there is not simulated again, so that a run can be
//! interrupted; `--shard 2/4` simulates every fourth group, `--only TEXT` the scenarios whose name has the text.
//! Seeds are fixed. Tables have Monte Carlo errors.
#![allow(clippy::print_stdout)]

#[path = "common/draws.rs"]
mod draws;
#[path = "common/ranks.rs"]
mod pictured;
#[path = "common/resumed.rs"]
mod resumed;
#[path = "common/tracks.rs"]
mod tracks;
#[path = "common/weber.rs"]
mod weber;

use draws::Random;
use resumed::{Shard, rows};
use std::collections::BTreeMap;
use std::time::Instant;
use study_base::rng::Stream;
use study_stats::describe;
use study_stats::distribution::normal_cdf;
use study_stats::paired::one_sample;
use study_stats::psychometric::hierarchy::{
    Cell, Condition, Effort, PopulationPriors, partial_pooling,
};
use study_stats::psychometric::{Core, Experiment, Level, Priors, Support, WidthPrior, posterior};
use tracks::{grid_rules, levels, ratio_ladder, simulate};

/// Of natural logarithms of thresholds, between participants.
const BETWEEN: f64 = 0.35;
/// Of what a condition does to a participant.
const INTERACTION: f64 = 0.1;
/// The logarithm of the ratio of the thresholds of two conditions.
const CONTRAST: f64 = 0.25;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let number = |name: &str| -> Option<u64> { value(name)?.parse().ok() };
    let file = value("--file").unwrap_or_else(|| "pooling.csv".to_owned());
    let only = value("--only").unwrap_or_default();
    let shard = Shard::of(value("--shard").as_deref());
    let mine = |i: &u64| shard.has(*i);
    if arguments.iter().any(|a| a == "--table") {
        return table(&file);
    }
    if let Some(picture) = value("--picture") {
        let ranks: Vec<Vec<f64>> = (rows(&file).into_iter())
            .filter(|row| row.0 == "ranks")
            .map(|row| row.2)
            .collect();
        let svg = pictured::picture(&RANKED, &ranks);
        return std::fs::write(picture, svg).expect("the picture can be written");
    }
    if let Some(n) = number("--ranks") {
        let jobs = (0..n).filter(mine).map(|i| ("ranks".to_owned(), i));
        return run(&file, jobs.collect(), |_, i| ranks(i));
    }
    if let Some(n) = number("--weber") {
        let all = weber::all(&only);
        let studies = (0..n).filter(mine);
        let jobs = studies.flat_map(|i| all.iter().map(move |one| (one.name.clone(), i)));
        return run(&file, jobs.collect(), |name, i| {
            let one = all.iter().find(|one| one.name == name);
            one.expect("it is one of them").study(i)
        });
    }
    let scenarios: Vec<Scenario> = scenarios()
        .into_iter()
        .filter(|s| s.name().contains(&only))
        .collect();
    // All scenarios advance together.
    let groups = (0..number("--groups").unwrap_or(20)).filter(mine);
    let jobs = groups.flat_map(|i| scenarios.iter().map(move |s| (s.name(), i)));
    run(&file, jobs.collect(), |name, i| {
        let scenario = scenarios.iter().find(|s| s.name() == name);
        scenario.expect("it is one of them").group(i)
    });
}

/// Runs what is not in the file, and prints what is in it then.
fn run(file: &str, jobs: Vec<(String, u64)>, one: impl Fn(&str, u64) -> Vec<f64> + Sync) {
    resumed::run(file, jobs, one);
    table(file);
}

/// Participants whose tracks are simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Observer {
    /// Weibull functions with exponents about 2.5; lapses of 0, 2 or 5 %.
    Weibull,
    /// d′ is in proportion to the level: not of the fitted family. Lapses as above.
    Proportional,
    /// Weibull functions, one tenth of lapses.
    Careless,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Scenario {
    rule: usize,
    trials: u32,
    people: usize,
    conditions: usize,
    observer: Observer,
}

fn scenarios() -> Vec<Scenario> {
    let mut all = Vec::new();
    for observer in [
        Observer::Weibull,
        Observer::Proportional,
        Observer::Careless,
    ] {
        for (people, trials) in [(10, 40), (20, 40), (10, 80), (20, 80)] {
            for rule in 0..3 {
                for conditions in [1, 2] {
                    // Two conditions, and other observers, for some only.
                    let few = rule == 1 && (trials == 40 || conditions == 1);
                    if few || (observer == Observer::Weibull && conditions == 1) {
                        all.push(Scenario {
                            rule,
                            trials,
                            people,
                            conditions,
                            observer,
                        });
                    }
                }
            }
        }
    }
    all
}

impl Scenario {
    fn name(&self) -> String {
        let rule = grid_rules(self.trials)[self.rule].0;
        let Self {
            trials,
            people,
            conditions,
            observer,
            ..
        } = self;
        format!("{observer:?} {rule} {people} × {conditions} × {trials}")
    }

    /// Simulates and fits a group. The results are listed in [`COLUMNS`].
    fn group(&self, index: u64) -> Vec<f64> {
        let name = self.name();
        let mut stream = Stream::new(index, &["pooling", &name]);
        let ladder = ratio_ladder();
        let (_, rule) = grid_rules(self.trials).swap_remove(self.rule);
        let center = ladder.level(15).ln();
        let (mut cells, mut truths) = (Vec::new(), Vec::new());
        for participant in 0..self.people {
            let own = center + BETWEEN * stream.normal();
            let lapse = match self.observer {
                Observer::Careless => 0.1,
                _ => [0.0, 0.02, 0.05][stream.below(3) as usize],
            };
            for condition in 0..self.conditions {
                let mut truth = own;
                if self.conditions > 1 {
                    truth += CONTRAST * condition as f64 + INTERACTION * stream.normal();
                }
                let exponent = 2.5 * (0.25 * stream.normal()).exp();
                let core = |x: f64| match self.observer {
                    Observer::Proportional => 2.0 * normal_cdf(0.674_489_750_196_082 * x) - 1.0,
                    _ => -(-std::f64::consts::LN_2 * x.powf(exponent)).exp_m1(),
                };
                let correct = |level: f64| 0.5 + (0.5 - lapse) * core(level / truth.exp());
                let (answers, _) = simulate(&rule, &ladder, correct, &mut stream);
                let placed = study_stats::psychometric::Spacing::Log.places(&levels(&answers));
                cells.push(Cell {
                    participant,
                    condition,
                    levels: placed,
                });
                truths.push(truth);
            }
        }
        let support = Support::of(ladder.levels().iter().map(|x| x.ln())).expect("several levels");
        let width = WidthPrior::OfRatios;
        let experiment = Experiment::ForcedChoice(0.5);
        let condition = Condition {
            core: Core::Gumbel,
            experiment,
            support,
            width,
        };
        let began = Instant::now();
        let found = partial_pooling(
            &vec![condition; self.conditions],
            &cells,
            &PopulationPriors::of(width),
            Effort::ANALYSIS,
            &mut Random(Stream::new(index, &["pooling", &name, "draws"])),
        );
        let seconds = began.elapsed().as_secs_f64();
        let Ok(found) = found else {
            return vec![0.0; COLUMNS.len()];
        };
        let alone: Vec<Estimated> = (cells.iter())
            .map(|cell| {
                let priors = Priors::track(Some(support), width);
                let p = posterior(Core::Gumbel, &cell.levels, experiment, &priors);
                p.map_or((center, (center, center)), |p| {
                    (p.threshold.median, p.threshold.ci95)
                })
            })
            .collect();
        let together: Vec<Estimated> = found.cells.iter().map(|c| (c.median, c.ci95)).collect();
        let of_cells = |estimates: &[Estimated]| {
            let mean = |of: &dyn Fn(&Estimated, f64) -> f64| {
                let terms = estimates.iter().zip(&truths).map(|(e, t)| of(e, *t));
                terms.sum::<f64>() / truths.len() as f64
            };
            [
                mean(&|e, t| (e.0 - t).powi(2)),
                mean(&|e, t| e.0 - t),
                mean(&|e, t| holds(e.1, t)),
                mean(&|e, _| e.1.1 - e.1.0),
            ]
        };
        // The first condition; t intervals over participants without pooling.
        let interval = |x: &[f64]| one_sample(x).map_or((0.0, (0.0, 0.0)), |s| (s.mean, s.ci95));
        let of_group = |(mean, ci95): (f64, (f64, f64)), truth: f64| {
            [mean - truth, holds(ci95, truth), ci95.1 - ci95.0]
        };
        let first: Vec<f64> = alone.iter().step_by(self.conditions).map(|a| a.0).collect();
        let group = found.conditions[0];
        let mut results = vec![
            f64::from(u8::from(found.diagnostics.problem().is_none())),
            seconds,
            found.diagnostics.effective,
            found.diagnostics.error,
        ];
        results.extend(of_cells(&together));
        results.extend(of_cells(&alone));
        results.extend(of_group((group.mean, group.ci95), center));
        results.extend(of_group(interval(&first), center));
        let contrasts = found.contrasts.first().map(|c| {
            let differences: Vec<f64> = alone.chunks(2).map(|a| a[0].0 - a[1].0).collect();
            let own = (c.difference.mean, c.difference.ci95);
            [
                of_group(own, -CONTRAST),
                of_group(interval(&differences), -CONTRAST),
            ]
            .concat()
        });
        results.extend(contrasts.unwrap_or_else(|| vec![0.0; 6]));
        results
    }
}

/// An estimate and its interval.
type Estimated = (f64, (f64, f64));

/// What a line of a group has: of participants the mean square, mean error, coverage and length of
/// the interval; of the group's mean and of the contrast the error, coverage and length, each
/// pooled and unpooled.
const COLUMNS: [&str; 24] = [
    "converged",
    "seconds",
    "effective",
    "error",
    "square",
    "bias",
    "holds",
    "length",
    "square alone",
    "bias alone",
    "holds alone",
    "length alone",
    "group",
    "group holds",
    "group length",
    "group alone",
    "group alone holds",
    "group alone length",
    "contrast",
    "contrast holds",
    "contrast length",
    "contrast alone",
    "contrast alone holds",
    "contrast alone length",
];

fn holds((low, high): (f64, f64), truth: f64) -> f64 {
    f64::from(u8::from(low <= truth && truth <= high))
}

/// Parameters of [`ranks`].
const RANKED: [&str; 8] = ["μ first", "μ second", "contrast", "τ", "σ", "ν", "κ", "λ"];

/// A population from the prior, six participants in two conditions at eight levels: the posterior
/// probabilities below the true parameters, which are uniform if all is right; and whether the
/// model converged.
fn ranks(index: u64) -> Vec<f64> {
    let mut stream = Stream::new(index, &["pooling", "ranks"]);
    let priors = PopulationPriors::of(WidthPrior::OfRatios);
    let ladder = ratio_ladder();
    let support = Support::of(ladder.levels().iter().map(|x| x.ln())).expect("several levels");
    let length = support.high - support.low;
    let mean = |stream: &mut Stream| loop {
        let x = support.low - length / 2.0 + 2.0 * length * stream.unit();
        let far = (support.low - x).max(x - support.high).max(0.0);
        let height = (1.0 + (std::f64::consts::TAU * far / length).cos()) / 2.0;
        if far < length / 2.0 && stream.unit() < height {
            return x;
        }
    };
    let means = [mean(&mut stream), mean(&mut stream)];
    let half_normal = |scale: f64, stream: &mut Stream| scale * stream.normal().abs();
    let between = half_normal(priors.between, &mut stream);
    let interaction = half_normal(priors.interaction, &mut stream);
    let width = priors.width.0 + priors.width.1 * stream.normal();
    let width_between = half_normal(priors.width_between, &mut stream);
    let lapse = 1.0 - (1.0 - stream.unit()).powf(1.0 / priors.lapse);
    let mut cells = Vec::new();
    for participant in 0..6 {
        let b = between * stream.normal();
        for (condition, mean) in means.iter().enumerate() {
            let theta = mean + b + interaction * stream.normal();
            let omega = (width + width_between * stream.normal()).exp();
            let level = |i: usize| {
                let level = ladder.level(1 + 4 * i).ln();
                // 4.067 is the width of the standard Gumbel function.
                let s = -(-std::f64::consts::LN_2
                    * (4.067_383_949_407_112 * (level - theta) / omega).exp())
                .exp_m1();
                (level, 0.5 + (0.5 - lapse) * s)
            };
            let counts = (0..8).map(level).map(|(level, p)| {
                let positive = (0..10).filter(|_| stream.unit() < p).count();
                Level {
                    level,
                    positive: positive as f64,
                    trials: 10.0,
                }
            });
            let levels = counts.collect();
            cells.push(Cell {
                participant,
                condition,
                levels,
            });
        }
    }
    let condition = Condition {
        core: Core::Gumbel,
        experiment: Experiment::ForcedChoice(0.5),
        support,
        width: WidthPrior::OfRatios,
    };
    let random = &mut Random(Stream::new(index, &["pooling", "ranks", "draws"]));
    let Ok(found) = partial_pooling(&[condition; 2], &cells, &priors, Effort::ANALYSIS, random)
    else {
        return vec![f64::NAN; RANKED.len() + 1];
    };
    let below = |of: &dyn Fn(&study_stats::psychometric::hierarchy::Parameters) -> f64,
                 truth: f64| {
        let draws = found.draws.iter().filter(|(p, _)| of(p) < truth);
        draws.map(|d| d.1).sum::<f64>()
    };
    vec![
        below(&|p| p.means[0], means[0]),
        below(&|p| p.means[1], means[1]),
        below(&|p| p.means[0] - p.means[1], means[0] - means[1]),
        below(&|p| p.between, between),
        below(&|p| p.interaction, interaction),
        below(&|p| p.width, width),
        below(&|p| p.width_between, width_between),
        below(&|p| p.lapse, lapse),
        f64::from(u8::from(found.diagnostics.problem().is_none())),
    ]
}

/// Prints what is in a file.
fn table(file: &str) {
    let mut all: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
    for (name, _, numbers) in rows(file) {
        all.entry(name).or_default().push(numbers);
    }
    if let Some(found) = all.remove("ranks") {
        print_ranks(&found);
    }
    let (weber, all): (Vec<_>, Vec<_>) =
        (all.into_iter()).partition(|(name, _)| name.starts_with("Weber "));
    if !weber.is_empty() {
        weber::print(&weber);
    }
    if all.is_empty() {
        return;
    }
    println!(
        "| scenario | groups | not converged | seconds | RMS of ln | alone | ratio | alone | holds | alone | interval, factor | alone | group: RMS | alone | holds | alone | contrast: RMS | alone | holds | alone |\n|{}",
        "---|".repeat(20)
    );
    for (name, groups) in all {
        let column = |name: &str| -> Vec<f64> {
            let at = COLUMNS.iter().position(|c| *c == name);
            let at = at.expect("the column exists");
            groups
                .iter()
                .filter(|g| g[0] == 1.0)
                .map(|g| g[at])
                .collect()
        };
        let n = groups.len();
        let mean = |name: &str| describe::mean(&column(name)).unwrap_or_default();
        let error = |name: &str| {
            let x = column(name);
            describe::sd(&x).unwrap_or_default() / (x.len() as f64).sqrt()
        };
        let share = |name: &str| format!("{:.3} ± {:.3}", mean(name), error(name));
        // By the delta method.
        let root = |name: &str| {
            let mean = mean(name).sqrt();
            format!("{mean:.3} ± {:.3}", error(name) / (2.0 * mean))
        };
        let rms = |name: &str| {
            let squares: Vec<f64> = column(name).iter().map(|x| x * x).collect();
            describe::mean(&squares).unwrap_or_default().sqrt()
        };
        let ratio = |name: &str| {
            format!(
                "{:.3} ± {:.3}",
                mean(name).exp(),
                mean(name).exp() * error(name)
            )
        };
        let contrasts = match mean("contrast length") > 0.0 {
            true => format!(
                "{:.3} | {:.3} | {} | {}",
                rms("contrast"),
                rms("contrast alone"),
                share("contrast holds"),
                share("contrast alone holds")
            ),
            false => "– | – | – | –".to_owned(),
        };
        println!(
            "| {name} | {n} | {} | {:.2} | {} | {} | {} | {} | {} | {} | {:.2} | {:.2} | {:.3} | {:.3} | {} | {} | {contrasts} |",
            groups.iter().filter(|g| g[0] != 1.0).count(),
            mean("seconds"),
            root("square"),
            root("square alone"),
            ratio("bias"),
            ratio("bias alone"),
            share("holds"),
            share("holds alone"),
            mean("length").exp(),
            mean("length alone").exp(),
            rms("group"),
            rms("group alone"),
            share("group holds"),
            share("group alone holds"),
        );
    }
}

/// χ² of the ranks over twenty classes, and their numbers. Populations whose fit failed have no ranks. Ranks
/// that are uniform have a mean of ½ and a standard deviation of √(1/12), .2887.
fn print_ranks(found: &[Vec<f64>]) {
    let known: Vec<&Vec<f64>> = found.iter().filter(|r| r[0].is_finite()).collect();
    let converged = known.iter().filter(|r| r[RANKED.len()] == 1.0);
    println!(
        "{} populations, {} fitted, {} converged\n",
        found.len(),
        known.len(),
        converged.count()
    );
    println!(
        "| parameter | χ², 19 df | p | mean rank | sd | below .025 or above .975 | numbers of ranks in 20 classes |\n|---|---|---|---|---|---|---|"
    );
    let n = known.len() as f64;
    for (k, name) in RANKED.iter().enumerate() {
        let ranks: Vec<f64> = known.iter().map(|r| r[k]).collect();
        let mut counts = [0.0; 20];
        for rank in &ranks {
            counts[((rank * 20.0) as usize).min(19)] += 1.0;
        }
        let expected = n / 20.0;
        let chi2: f64 = counts
            .iter()
            .map(|c| (c - expected) * (c - expected) / expected)
            .sum();
        let p = study_stats::distribution::chi2_upper(chi2, 19.0).unwrap_or_default();
        let listed: Vec<String> = counts.iter().map(f64::to_string).collect();
        let (mean, sd) = (describe::mean(&ranks), describe::sd(&ranks));
        let (mean, sd) = (mean.unwrap_or_default(), sd.unwrap_or_default());
        let outside = ranks.iter().filter(|rank| !(0.025..=0.975).contains(*rank));
        let outside = outside.count() as f64 / n;
        println!(
            "| {name} | {chi2:.1} | {p:.3} | {mean:.3} ± {:.3} | {sd:.3} | {outside:.3} ± {:.3} | {} |",
            sd / n.sqrt(),
            (outside * (1.0 - outside) / n).sqrt(),
            listed.join(" ")
        );
    }
}
