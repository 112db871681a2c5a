//! Confirmations of a point that is no better than the reference, and what searches of a space claim in which nothing is.

use crate::perceivers::lattice;
use study_analysis::power::{Overrides, Plan};
use study_base::rng::Stream;
use study_base::text::PartId;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Preferred, Search, SearchRule};
use study_plan::protocol::{Protocol, file};
use study_stats::proportion::clopper_pearson;

/// What `study new --from RESULTS --confirm` writes, and a device.
const CONFIRMATION: &str = include_str!("../../src/cli/new/confirm.toml");
const DEVICE: &str =
    "\n[device]\nkind = \"simulated\"\nlimits = { force_n = 12.0, velocity_mm_s = 1000.0 }\n";

const PEOPLE: u64 = 10;
const ABX_TRIALS: u64 = 30;
const PAIRS: u64 = 8;

fn protocol() -> Protocol {
    let parsed = file::parse("confirmation", &format!("{CONFIRMATION}{DEVICE}"));
    let shown = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
}

/// Confirmations of identical stimuli: how often the verdicts of the analysis are yes, and exact tests of the same answers beside
/// the largest level that they can have.
pub(crate) fn print(studies: u64) {
    println!(
        "{studies} confirmations of identical stimuli, {PEOPLE} participants, {ABX_TRIALS} trials of ABX and {PAIRS} pairs each\n"
    );
    println!("| test | rejected | 95 % interval | attainable level |\n|---|---|---|---|");
    let line = |name: &str, rejected: u64, attainable: Option<f64>| {
        let (low, high) = clopper_pearson(rejected, studies, 0.95).unwrap_or((0.0, 1.0));
        let attainable = attainable.map_or_else(|| "–".to_owned(), |level| format!("{level:.4}"));
        let share = rejected as f64 / studies.max(1) as f64;
        println!("| {name} | {share:.4} | {low:.4} to {high:.4} | {attainable} |");
    };
    let protocol = protocol();
    for (part, name) in [
        ("which", "told apart, verdict of the analysis"),
        ("better", "preferred, verdict of the analysis"),
    ] {
        line(name, rejected(&protocol, part, studies), None);
    }
    let (trials, pairs) = (PEOPLE * ABX_TRIALS, PEOPLE * PAIRS);
    // Of ABX only more right answers than by guessing count; of pairs either of the two can be preferred.
    let (least_right, of_abx) = attainable(trials, 0.05);
    let (least_preferred, of_one_side) = attainable(pairs, 0.025);
    let mut stream = Stream::new(1, &["search", "identical"]);
    let mut heads = |n: u64| (0..n).filter(|_| stream.below(2) == 1).count() as u64;
    let (mut right, mut preferred) = (0, 0);
    for _ in 0..studies {
        right += u64::from(heads(trials) >= least_right);
        let first = heads(pairs);
        preferred += u64::from(first.max(pairs - first) >= least_preferred);
    }
    line("right answers, exact binomial test", right, Some(of_abx));
    line("pairs, exact sign test", preferred, Some(2.0 * of_one_side));
}

/// In how many confirmations the analysis of a part says yes.
fn rejected(protocol: &Protocol, part: &str, studies: u64) -> u64 {
    let mut flags = Overrides {
        part: Some(PartId::new(part).expect("an identifier")),
        seed: Some(1),
        ..Overrides::default()
    };
    flags.plan.studies = Some(studies);
    flags.plan.sd.interaction = Some(0.0);
    match part {
        "which" => {
            flags.plan.track.d = Some(0.0);
            flags.plan.sd.participant = Some(0.0);
        }
        _ => {
            flags.plan.slope = Some(0.0);
            flags.plan.sd.realization = Some(0.0);
        }
    }
    let plan = Plan::of(protocol, &flags).expect("a plan");
    let units = plan.units_of(&[plan.own]);
    let chunks = plan.simulate_designs(&units, &|| ());
    let results = plan.results(&units, &chunks);
    results[0].tests[0].rejected
}

/// The smallest number of successes in `n` tosses of a fair coin that has at most this probability together with all larger ones,
/// and that probability: the level that an exact test of that nominal level has.
fn attainable(n: u64, nominal: f64) -> (u64, f64) {
    let log_factorial = |k: u64| libm::lgamma(k as f64 + 1.0);
    let of = |k: u64| {
        let log = log_factorial(n) - log_factorial(k) - log_factorial(n - k);
        libm::exp(log - n as f64 * std::f64::consts::LN_2)
    };
    let (mut least, mut level) = (n + 1, 0.0);
    while least > 0 && level + of(least - 1) <= nominal {
        least -= 1;
        level += of(least);
    }
    (least, level)
}

/// Answers of each searcher of a flat space.
const ANSWERS: usize = 40;

/// What a line of flat searches has.
pub(crate) const FLAT: [&str; 6] = [
    "utility of the winner, one searcher",
    "the same in posterior standard deviations",
    "comparisons of the winner",
    "of these, won",
    "utility of the winner, mean map of ten searchers",
    "share of fresh pairs that the winner wins",
];

/// Ten searchers of a space in which every point is as good as every other, and fresh participants who compare what the ten found
/// with the middle of the space. Utilities are counted from the mean of a map, as `study explore` prints them.
pub(crate) fn flat(number: u64) -> Vec<f64> {
    let lattice = lattice(2);
    let points = lattice.len();
    let rule = SearchRule {
        choose: Choose::PreferenceGp {
            start: 8,
            acquire: Acquire::Challenger,
        },
        trials: ANSWERS as u32,
    };
    let mut first: Option<[f64; 4]> = None;
    let mut map = vec![0.0; points];
    for person in 0..PEOPLE {
        let person = person.to_string();
        let mut stream = Stream::new(number, &["search", "flat", &person]);
        let mut answers = Stream::new(number, &["search", "flat answers", &person]);
        let mut search = Search::new(&rule, &lattice, &mut stream).expect("a rule");
        let mut told = Vec::new();
        while let Some([a, b]) = search.next() {
            let (preferred, other) = if answers.below(2) == 0 {
                (a, b)
            } else {
                (b, a)
            };
            let answer = Preferred { preferred, other };
            search.answer(&answer);
            told.push(answer);
        }
        let posterior = search.posterior().expect("a posterior");
        let mean = posterior.mean();
        let level = mean.iter().sum::<f64>() / points as f64;
        for (sum, own) in map.iter_mut().zip(mean) {
            *sum += (own - level) / PEOPLE as f64;
        }
        if first.is_none() {
            let best = posterior.best_point(|_| true).expect("a point");
            let share = 1.0 / points as f64;
            let beside = |i: usize| (0..points).map(|j| posterior.covariance(i, j)).sum::<f64>();
            let of_level = (0..points).map(beside).sum::<f64>() * share * share;
            let variance = posterior.covariance(best, best) - 2.0 * share * beside(best) + of_level;
            let own = mean[best] - level;
            let won = told.iter().filter(|t| t.preferred == best).count();
            let lost = told.iter().filter(|t| t.other == best).count();
            first = Some([
                own,
                own / variance.max(1e-12).sqrt(),
                (won + lost) as f64,
                won as f64,
            ]);
        }
    }
    let mut fresh = Stream::new(number, &["search", "flat", "fresh"]);
    let pairs = PEOPLE * PAIRS;
    let won = (0..pairs).filter(|_| fresh.below(2) == 0).count();
    let winner = map.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut results = first.unwrap_or_default().to_vec();
    results.extend([winner, won as f64 / pairs as f64]);
    results
}
