//! Tracks on a ladder in equal steps above a standard.

use crate::tracks::{levels, simulate};
use rayon::prelude::*;
use study_base::rng::Stream;
use study_plan::procedure::{
    Constant, Function, Ladder, Parameter, QuestPlus, Rule, Scale, Staircase, Stop,
};
use study_stats::distribution::normal_cdf;
use study_stats::psychometric::{
    Core, Experiment, Level, Priors, Spacing, Support, WidthPrior, posterior,
};

/// A participant: the share of correct answers without guesses and lapses at a multiple of the
/// threshold, at which it is ½; at 0 there is nothing to feel.
type Observer = (&'static str, fn(f64) -> f64);

fn weibull(x: f64) -> f64 {
    -(-std::f64::consts::LN_2 * x.powf(2.5)).exp_m1()
}

fn proportional(x: f64) -> f64 {
    2.0 * normal_cdf(0.674_489_750_196_082 * x) - 1.0
}

/// A cumulative normal from 5 % at half the threshold to 95 % at one and a half: next to nothing at 0.
fn normal(x: f64) -> f64 {
    normal_cdf((x - 1.0) * 3.289_707_253_902_944)
}

/// 100 levels from 0.02 to 2 above the standard.
fn ladder() -> Ladder {
    let levels = (1..=100).map(|i| f64::from(i) / 50.0);
    Ladder::new(levels.collect()).expect("levels rise")
}

fn rules(trials: u32) -> Vec<(&'static str, Rule)> {
    let ladder = ladder();
    let staircase = Staircase {
        up: 1,
        down: 3,
        start: 1.2,
        steps: vec![0.2, 0.1, 0.04],
        scale: Scale::Lin,
        step_up_factor: 1.0,
        min_level: None,
        max_level: None,
        initial_one_up_one_down: true,
        stop: Stop {
            reversals: trials,
            min_trials: trials,
            max_trials: trials,
        },
        estimate_last: 6,
    };
    let thresholds = (0..60).map(|i| ladder.level((i * 99 + 29) / 59)).collect();
    let parameters = vec![
        Parameter::new("threshold", thresholds),
        Parameter::new("slope", vec![0.8, 1.3, 2.0, 3.0, 5.0, 8.0]),
        Parameter::new("gamma", vec![0.5]),
        Parameter::new("lambda", vec![0.01, 0.03, 0.06]),
    ];
    let constant = Constant {
        levels: [4, 12, 20, 28, 36, 52, 68, 84]
            .map(|i| ladder.level(i))
            .to_vec(),
        repetitions: trials / 8,
    };
    vec![
        ("1-up-3-down", Rule::Staircase(staircase)),
        (
            "QUEST+",
            Rule::QuestPlus(QuestPlus::new(Function::Weibull, parameters, trials)),
        ),
        ("constant", Rule::Constant(constant)),
    ]
}

/// How levels are fitted.
struct Fit {
    name: &'static str,
    spacing: Spacing,
    core: Core,
}

const FITS: [Fit; 2] = [
    Fit {
        name: "level, normal",
        spacing: Spacing::Lin,
        core: Core::Norm,
    },
    Fit {
        name: "logarithm, Weibull",
        spacing: Spacing::Log,
        core: Core::Gumbel,
    },
];

impl Fit {
    /// Error of the logarithm of the threshold, length of its interval, and whether it holds the truth.
    fn of(&self, answers: &[Level], truth: f64) -> Option<(f64, f64, f64)> {
        let ladder = ladder();
        let places = ladder
            .levels()
            .iter()
            .filter_map(|x| self.spacing.place(*x));
        let width = match self.spacing {
            Spacing::Log => WidthPrior::OfRatios,
            _ => WidthPrior::FromOrigin(0.0),
        };
        let priors = Priors::track(Support::of(places), width);
        let placed = self.spacing.places(answers);
        let experiment = Experiment::ForcedChoice(0.5);
        let found = posterior(self.core, &placed, experiment, &priors).ok()?;
        let found = found.threshold_level(self.spacing);
        let (low, high) = found.ci95;
        let holds = low <= truth && truth <= high;
        Some((
            (found.median / truth).ln(),
            (high / low).ln(),
            f64::from(u8::from(holds)),
        ))
    }
}

pub(crate) fn print(tracks: u64) {
    println!(
        "| participant | rule | trials | threshold | fitted | estimate / threshold | RMS of ln | holds | interval, factor |\n|---|---|---|---|---|---|---|---|---|"
    );
    let observers: [Observer; 3] = [
        ("Weibull, slope 2.5", weibull),
        ("d′ in proportion", proportional),
        ("normal", normal),
    ];
    for (participant, core) in observers {
        for trials in [40, 80] {
            for (name, rule) in rules(trials) {
                for threshold in [0.1, 0.3, 0.8] {
                    let label = format!("{participant} {name} {trials} {threshold}");
                    let correct = |level: f64| 0.5 + 0.48 * core(level / threshold);
                    let found: Vec<Vec<Level>> = (0..tracks)
                        .into_par_iter()
                        .map(|i| {
                            let mut stream = Stream::new(i, &["linear", &label]);
                            levels(&simulate(&rule, &ladder(), correct, &mut stream).0)
                        })
                        .collect();
                    for fit in &FITS {
                        let one = |answers: &Vec<Level>| fit.of(answers, threshold);
                        let fits: Vec<(f64, f64, f64)> = found.par_iter().filter_map(one).collect();
                        let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
                            fits.iter().map(of).sum::<f64>() / fits.len() as f64
                        };
                        let (bias, square) = (mean(&|f| f.0), mean(&|f| f.0 * f.0));
                        let error = ((square - bias * bias) / fits.len() as f64).sqrt();
                        println!(
                            "| {participant} | {name} | {trials} | {threshold} | {} | {:.3} ± {:.3} | {:.3} | {:.3} | {:.2} |",
                            fit.name,
                            bias.exp(),
                            bias.exp() * error,
                            square.sqrt(),
                            mean(&|f| f.2),
                            mean(&|f| f.1).exp(),
                        );
                    }
                }
            }
        }
    }
}
