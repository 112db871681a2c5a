//! How well thresholds are estimated: bias and standard deviation of simulated tracks,
//! and how often the intervals of a fit hold the truth.
//!
//! `cargo bench --bench thresholds -- --tracks 2000` simulates a participant in a
//! two-interval task whose function is a cumulative normal with mean 0.5 and standard
//! deviation 0.2, on a ladder from 0 to 2. The seed is fixed: the same number of tracks
//! prints the same tables for any number of threads. The table after it is of a ladder whose levels
//! are spaced by equal ratios, fitted over the level and over its logarithm (`--ratios`: only that).
//! `--grid` prints bias and coverage over thresholds, lapses, trials and rules, with the priors of
//! Schütt et al. and with those of tracks. `--linear` is of a ladder in equal steps above a standard,
//! fitted over the level and over the logarithm of its distance from the standard.
#![allow(clippy::print_stdout)]

#[path = "common/linear.rs"]
mod linear;
#[path = "common/tracks.rs"]
mod tracks;

use rayon::prelude::*;
use study_base::rng::Stream;
use study_plan::procedure::{Answer, Constant, Ladder, QuestPlus, Rule, Scale, Staircase, Stop};
use study_stats::describe;
use study_stats::distribution::normal_cdf;
use study_stats::psychometric::{
    Core, Curve, Experiment, Posterior, Priors, Spacing, Support, WidthPrior, maximum_likelihood,
    posterior,
};
use tracks::{grid_rules, levels, ratio_ladder, ratio_rules, simulate};

const MEAN: f64 = 0.5;
const SD: f64 = 0.2;
/// Standard deviations in a width.
const WIDTH: f64 = 3.289_707_253_902_944;

fn main() {
    let (mut tracks, mut ratios_only, mut grid_only, mut linear_only) = (200, false, false, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--tracks" {
            let given = arguments.next().and_then(|n| n.parse().ok());
            tracks = given.expect("--tracks takes a number");
        }
        ratios_only |= argument == "--ratios";
        grid_only |= argument == "--grid";
        linear_only |= argument == "--linear";
    }
    println!("{tracks} tracks each\n");
    if grid_only {
        return grid(tracks);
    }
    if linear_only {
        return linear::print(tracks);
    }
    if !ratios_only {
        equal_differences(tracks);
    }
    println!(
        "\n| participant | procedure | trials | fitted | estimate / threshold | SD of ln | below half, above twice | threshold | width |\n|---|---|---|---|---|---|---|---|---|"
    );
    for participant in [Grown::Weibull, Grown::Proportional] {
        for (name, rule) in ratio_rules() {
            print_ratios(participant, name, &rule, tracks);
        }
    }
}

/// The tables of a ladder whose levels are equally far apart.
fn equal_differences(tracks: u64) {
    println!(
        "| procedure | lapses | trials | target | bias | SD | not estimated |\n|---|---|---|---|---|---|---|"
    );
    for lambda in [0.0, 0.02, 0.05] {
        for (name, rule) in procedures() {
            print_bias(name, &rule, lambda, tracks);
        }
    }
    println!(
        "\n| data | lapses | interval | threshold | width | not estimated |\n|---|---|---|---|---|---|"
    );
    for (name, rule, lambda) in fits() {
        print_coverage(name, &rule, lambda, tracks);
    }
}

/// The function of the participant.
fn participant(lambda: f64) -> Curve {
    Curve {
        core: Core::Norm,
        threshold: MEAN,
        width: WIDTH * SD,
        gamma: 0.5,
        lambda,
    }
}

/// 101 levels from 0 to 2.
fn ladder() -> Ladder {
    Ladder::new((0..=100).map(|i| f64::from(i) / 50.0).collect()).expect("levels rise")
}

fn up_down(down: u32, reversals: u32, factor: f64) -> Rule {
    Rule::Staircase(Staircase {
        up: 1,
        down,
        start: 1.2,
        steps: vec![0.2, 0.2, 0.1, 0.1, 0.05],
        scale: Scale::Lin,
        step_up_factor: factor,
        min_level: None,
        max_level: None,
        initial_one_up_one_down: true,
        stop: Stop {
            reversals,
            min_trials: 0,
            max_trials: 200,
        },
        estimate_last: 6,
    })
}

fn quest(trials: u32, lambda: f64) -> Rule {
    let mean = (1..=30).map(|i| f64::from(i) * 0.05).collect();
    let sd = vec![0.05, 0.1, 0.2, 0.4];
    Rule::QuestPlus(QuestPlus::psi(mean, sd, 0.5, lambda, trials))
}

fn procedures() -> Vec<(&'static str, Rule)> {
    vec![
        ("1-up-2-down, 10 reversals", up_down(2, 10, 1.0)),
        ("1-up-3-down, 8 reversals", up_down(3, 8, 1.0)),
        ("1-up-3-down, 16 reversals", up_down(3, 16, 1.0)),
        ("weighted, .75, 10 reversals", up_down(1, 10, 3.0)),
        ("QUEST+, λ .02 in the model", quest(30, 0.02)),
        ("QUEST+, λ .02 in the model", quest(50, 0.02)),
        ("QUEST+, λ .04 in the model", quest(30, 0.04)),
        ("QUEST+, λ .04 in the model", quest(50, 0.04)),
    ]
}

fn simulated(
    name: &str,
    rule: &Rule,
    curve: &Curve,
    tracks: u64,
) -> Vec<(Vec<Answer>, Option<f64>)> {
    (0..tracks)
        .into_par_iter()
        .map(|i| {
            let mut stream = Stream::new(i, &["thresholds", name]);
            simulate(rule, &ladder(), |x| curve.value(x), &mut stream)
        })
        .collect()
}

fn print_bias(name: &str, rule: &Rule, lambda: f64, tracks: u64) {
    let curve = participant(lambda);
    // What the rule settles at: of an up-down rule the level of its target, of QUEST+ the
    // mean of the function.
    let target = match rule {
        Rule::Staircase(rule) => rule.target().and_then(|share| curve.level_at(share)),
        Rule::QuestPlus(_) | Rule::Constant(_) => Some(MEAN),
    };
    let target = target.expect("the function has the target");
    let found = simulated(name, rule, &curve, tracks);
    let trials: Vec<f64> = found.iter().map(|f| f.0.len() as f64).collect();
    let estimates: Vec<f64> = found.iter().filter_map(|f| f.1).collect();
    let mean = describe::mean(&estimates).unwrap_or_default();
    println!(
        "| {name} | {lambda} | {:.1} | {target:.3} | {:+.3} | {:.3} | {} |",
        describe::mean(&trials).unwrap_or_default(),
        mean - target,
        describe::sd(&estimates).unwrap_or_default(),
        found.len() - estimates.len(),
    );
}

fn fits() -> Vec<(&'static str, Rule, f64)> {
    let constant = |repetitions| {
        Rule::Constant(Constant {
            levels: vec![0.1, 0.24, 0.38, 0.5, 0.62, 0.76, 1.0],
            repetitions,
        })
    };
    vec![
        ("constant, 7 × 20", constant(20), 0.02),
        ("constant, 7 × 60", constant(60), 0.02),
        ("1-up-3-down, 16 reversals", up_down(3, 16, 1.0), 0.02),
        ("QUEST+, 50 trials", quest(50, 0.02), 0.02),
        ("QUEST+, 200 trials", quest(200, 0.02), 0.02),
    ]
}

fn print_coverage(name: &str, rule: &Rule, lambda: f64, tracks: u64) {
    let curve = participant(lambda);
    let found = simulated(name, rule, &curve, tracks);
    let ladder = ladder();
    let support = Support::of(ladder.levels().iter().copied());
    let priors = Priors::track(support, WidthPrior::FromOrigin(0.0));
    let within = |(low, high): (f64, f64), truth: f64| low <= truth && truth <= high;
    let bayes: Vec<(bool, bool)> = (found.par_iter())
        .filter_map(|(answers, _)| {
            let experiment = Experiment::ForcedChoice(0.5);
            let p = posterior(Core::Norm, &levels(answers), experiment, &priors).ok()?;
            Some((
                within(p.threshold.ci95, curve.threshold),
                within(p.width.ci95, curve.width),
            ))
        })
        .collect();
    let wald: Vec<(bool, bool)> = (found.par_iter())
        .filter_map(|(answers, _)| {
            let fit = maximum_likelihood(Core::Norm, &levels(answers), 0.5, lambda).ok()?;
            let holds = |estimate: f64, se: f64, truth| {
                within((estimate - 1.96 * se, estimate + 1.96 * se), truth)
            };
            Some((
                holds(fit.curve.threshold, fit.threshold_se?, curve.threshold),
                holds(fit.curve.width, fit.width_se?, curve.width),
            ))
        })
        .collect();
    for (kind, covered) in [("posterior", bayes), ("Wald, λ known", wald)] {
        let share = |part: fn(&(bool, bool)) -> bool| {
            covered.iter().filter(|c| part(c)).count() as f64 / covered.len() as f64
        };
        println!(
            "| {name} | {lambda} | {kind} | {:.3} | {:.3} | {} |",
            share(|c| c.0),
            share(|c| c.1),
            found.len() - covered.len(),
        );
    }
}

/// Participants on a ladder of ratios, with 2 % lapses: the share correct rises with the level
/// as a Weibull function of slope 2, or d′ is in proportion to the level.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Grown {
    Weibull,
    Proportional,
}

/// Where the function without guesses and lapses is ½.
const RATIO_THRESHOLD: f64 = 0.095;

impl Grown {
    fn name(self) -> &'static str {
        match self {
            Self::Weibull => "Weibull",
            Self::Proportional => "d′ in proportion",
        }
    }

    /// The function without guesses and lapses.
    fn core(self, level: f64) -> f64 {
        let x = level / RATIO_THRESHOLD;
        match self {
            Self::Weibull => -(-std::f64::consts::LN_2 * x * x).exp_m1(),
            // 2 Φ(z(.75) x) − 1
            Self::Proportional => 2.0 * normal_cdf(0.674_489_750_196_082 * x) - 1.0,
        }
    }

    /// The logarithm of the ratio of the levels at .95 and .05.
    fn width(self) -> f64 {
        let level_at = |share: f64| {
            let (mut low, mut high) = (1e-6, 1e3);
            for _ in 0..200 {
                let middle = f64::sqrt(low * high);
                match self.core(middle) < share {
                    true => low = middle,
                    false => high = middle,
                }
            }
            low
        };
        (level_at(0.95) / level_at(0.05)).ln()
    }
}

fn print_ratios(participant: Grown, name: &str, rule: &Rule, tracks: u64) {
    let ladder = ratio_ladder();
    let correct = |level: f64| 0.5 + 0.48 * participant.core(level);
    let found: Vec<Vec<Answer>> = (0..tracks)
        .into_par_iter()
        .map(|i| {
            let mut stream = Stream::new(i, &["ratios", participant.name(), name]);
            simulate(rule, &ladder, correct, &mut stream).0
        })
        .collect();
    let trials: Vec<f64> = found.iter().map(|a| a.len() as f64).collect();
    for (fitted, spacing, core) in [
        ("level, normal", Spacing::Lin, Core::Norm),
        ("logarithm, Weibull", Spacing::Log, Core::Gumbel),
    ] {
        let places = ladder.levels().iter().filter_map(|x| spacing.place(*x));
        let priors = Priors::track(Support::of(places), width_prior(spacing));
        let width = (spacing == Spacing::Log).then(|| participant.width());
        let one = |answers: &Vec<Answer>| {
            let placed = spacing.places(&levels(answers));
            posterior(core, &placed, Experiment::ForcedChoice(0.5), &priors).ok()
        };
        let fits: Vec<Posterior> = found.par_iter().filter_map(one).collect();
        let estimates: Vec<f64> = (fits.iter())
            .map(|p| p.threshold_level(spacing).median / RATIO_THRESHOLD)
            .collect();
        // Over the level, an estimate can be 0 or less.
        let positive: Vec<f64> = estimates
            .iter()
            .filter(|e| **e > 0.0)
            .map(|e| e.ln())
            .collect();
        let far = estimates.iter().filter(|e| **e < 0.5 || **e > 2.0).count();
        let share = |n: usize| n as f64 / fits.len() as f64;
        let within = |(low, high): (f64, f64), truth: f64| low <= truth && truth <= high;
        let truth = spacing.place(RATIO_THRESHOLD).unwrap_or_default();
        let covered = fits
            .iter()
            .filter(|p| within(p.threshold.ci95, truth))
            .count();
        let widths = width.map(|w| fits.iter().filter(|p| within(p.width.ci95, w)).count());
        println!(
            "| {} | {name} | {:.1} | {fitted} | {:.3} | {:.3} | {:.3} | {:.3} | {} |",
            participant.name(),
            describe::mean(&trials).unwrap_or_default(),
            describe::mean(&positive).unwrap_or_default().exp(),
            describe::sd(&positive).unwrap_or_default(),
            share(far),
            share(covered),
            widths.map_or_else(|| "–".to_owned(), |n| format!("{:.3}", share(n))),
        );
    }
}

/// As the analysis of a track whose standard is 0.
fn width_prior(spacing: Spacing) -> WidthPrior {
    match spacing {
        Spacing::Lin => WidthPrior::FromOrigin(0.0),
        Spacing::Log => WidthPrior::OfRatios,
    }
}

/// Bias, root mean square and coverage for thresholds low, in the middle and high in the ladder,
/// of functions inside and outside of the fitted family.
fn grid(tracks: u64) {
    println!(
        "| participant | rule | trials | priors | ratio: least | mean | most | RMS of ln | coverage: least | mean | interval, factor |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let weibull = |slope: f64| move |x: f64| -(-std::f64::consts::LN_2 * x.powf(slope)).exp_m1();
    let observers: [(&str, &(dyn Fn(f64) -> f64 + Sync)); 4] = [
        ("Weibull, slope 2.5", &weibull(2.5)),
        ("Weibull, slope 1.5", &weibull(1.5)),
        ("Weibull, slope 4", &weibull(4.0)),
        ("d′ in proportion", &|x| {
            2.0 * normal_cdf(0.674_489_750_196_082 * x) - 1.0
        }),
    ];
    for (participant, core) in observers {
        for trials in [40, 80, 150] {
            for (name, rule) in grid_rules(trials) {
                print_grid(participant, core, name, &rule, trials, tracks);
            }
        }
    }
}

/// What is found in one cell of the grid.
struct Cell {
    bias: f64,
    square: f64,
    coverage: f64,
    span: f64,
}

fn print_grid(
    participant: &str,
    core: &(dyn Fn(f64) -> f64 + Sync),
    name: &str,
    rule: &Rule,
    trials: u32,
    tracks: u64,
) {
    let ladder = ratio_ladder();
    let support = Support::of(ladder.levels().iter().map(|x| x.ln()));
    let mut cells: [Vec<Cell>; 2] = [Vec::new(), Vec::new()];
    for step in [8, 15, 22] {
        for lapse in [0.0, 0.02, 0.05] {
            let truth = ladder.level(step);
            let correct = |level: f64| 0.5 + (0.5 - lapse) * core(level / truth);
            let label = format!("{participant} {name} {trials} {step} {lapse}");
            let found: Vec<Vec<Answer>> = (0..tracks)
                .into_par_iter()
                .map(|i| {
                    let mut stream = Stream::new(i, &["grid", &label]);
                    simulate(rule, &ladder, correct, &mut stream).0
                })
                .collect();
            let all_priors = [
                Priors::schuett(support),
                Priors::track(support, WidthPrior::OfRatios),
            ];
            for (priors, cells) in all_priors.iter().zip(&mut cells) {
                let fits: Vec<(f64, f64, f64)> = (found.par_iter())
                    .filter_map(|answers| {
                        let placed = Spacing::Log.places(&levels(answers));
                        let experiment = Experiment::ForcedChoice(0.5);
                        let p = posterior(Core::Gumbel, &placed, experiment, priors).ok()?;
                        let (low, high) = p.threshold.ci95;
                        let holds = low <= truth.ln() && truth.ln() <= high;
                        let error = p.threshold.median - truth.ln();
                        Some((error, f64::from(u8::from(holds)), high - low))
                    })
                    .collect();
                let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
                    fits.iter().map(of).sum::<f64>() / fits.len() as f64
                };
                cells.push(Cell {
                    bias: mean(&|f| f.0),
                    square: mean(&|f| f.0 * f.0),
                    coverage: mean(&|f| f.1),
                    span: mean(&|f| f.2),
                });
            }
        }
    }
    for (priors, cells) in ["Schütt et al.", "of tracks"].into_iter().zip(cells) {
        let mean = |of: fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>() / cells.len() as f64;
        let end = |of: fn(f64, f64) -> f64, part: fn(&Cell) -> f64| {
            cells.iter().map(part).reduce(of).unwrap_or_default()
        };
        println!(
            "| {participant} | {name} | {trials} | {priors} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.2} |",
            end(f64::min, |c| c.bias).exp(),
            mean(|c| c.bias).exp(),
            end(f64::max, |c| c.bias).exp(),
            mean(|c| c.square).sqrt(),
            end(f64::min, |c| c.coverage),
            mean(|c| c.coverage),
            mean(|c| c.span).exp(),
        );
    }
}
