//! The tables of `docs/estimators.md`: every method's VAF on switch A as recorded in
//! tests/data, and on 12 random simulated switches: `cargo bench --bench estimators`. How
//! the residuals compare at 1 kHz and at 10 kHz: `cargo bench --bench estimators -- --rates`.

#![allow(
    clippy::print_stdout,
    reason = "a table on the terminal is what it is for"
)]
#![allow(clippy::unwrap_used, reason = "a table that cannot be made says where")]

#[path = "../tests/support/switches.rs"]
mod switches;

use std::fs::File;
use std::io::BufReader;
use study_base::rng::Stream;
use study_haptics::identify::method::{Delta, Sort, Start, State, Terms, Window};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{
    Ewls, Hat, Method, Passive, Segments, Spring, Static, Training, TwoSided, Width, vaf,
};
use study_haptics::plant::Parameters;
use study_haptics::recording::{self, Recording};
use study_wire::predict::{Direction, Lookup};

const DX_MM: f64 = 0.5;
const SWITCHES: u64 = 12;

fn methods() -> Vec<(&'static str, Method)> {
    let ewls = |lambda, bounded| {
        Method::Ewls(Ewls {
            bounded,
            ..Ewls::paper(lambda, Resample::Hat)
        })
    };
    let paper = Ewls::paper(0.999, Resample::Point);
    let two_sided = |window, mm, bounded| {
        Method::TwoSided(TwoSided {
            window,
            width: Width::Mm(mm),
            bounded,
            terms: Terms::default(),
        })
    };
    let hat = |state, bounded| {
        Method::Hat(Hat {
            state,
            bounded,
            ..Hat::default()
        })
    };
    let ridges = |ridge_force, ridge_dynamics| {
        Method::Hat(Hat {
            ridge_force,
            ridge_dynamics,
            ..Hat::default()
        })
    };
    let play = State::Play(Delta::Scan);
    vec![
        ("paper, lambda .999", Method::Ewls(paper)),
        (
            "paper, warm",
            Method::Ewls(Ewls {
                start: Start::Warm,
                ..paper
            }),
        ),
        (
            "paper, travel",
            Method::Ewls(Ewls {
                sort: Sort::Travel,
                ..paper
            }),
        ),
        ("EWLS .999 m,b>=0", ewls(0.999, true)),
        ("EWLS .985", ewls(0.985, false)),
        ("EWLS .985 m,b>=0", ewls(0.985, true)),
        (
            "two-sided exp L .1",
            two_sided(Window::Exponential, 0.1, false),
        ),
        (
            "two-sided exp L .2",
            two_sided(Window::Exponential, 0.2, false),
        ),
        (
            "two-sided exp L .2 m,b>=0",
            two_sided(Window::Exponential, 0.2, true),
        ),
        (
            "two-sided exp L .4",
            two_sided(Window::Exponential, 0.4, false),
        ),
        (
            "two-sided tricube L .1",
            two_sided(Window::Tricube, 0.1, false),
        ),
        (
            "two-sided tricube L .2",
            two_sided(Window::Tricube, 0.2, false),
        ),
        (
            "two-sided tricube L .4",
            two_sided(Window::Tricube, 0.4, false),
        ),
        ("static", Static.into()),
        ("segments 12", Method::Segments(Segments::default())),
        ("spring", Spring.into()),
        ("hat sign, free", hat(State::Sign, false)),
        ("hat sign", hat(State::Sign, true)),
        ("hat play, free", hat(play, false)),
        ("hat play", hat(play, true)),
        ("hat dahl, free", hat(State::Dahl(Delta::Scan), false)),
        ("hat dahl", hat(State::Dahl(Delta::Scan), true)),
        ("hat play, ridges 1e-3 1e-2", ridges(1e-3, 1e-2)),
        ("hat play, ridges 3e-3 3e-2", ridges(3e-3, 3e-2)),
        ("hat play, ridges 1e-2 3e-1", ridges(1e-2, 3e-1)),
    ]
}

fn score(training: &Training<'_>, validation: &Recording, method: Method) -> (f64, Direction) {
    let found = training.identify(method, DX_MM, Lookup::Linear).unwrap();
    let score = vaf::score(&found.realization, validation);
    (score.vaf, found.realization.direction)
}

fn shipped(name: &str) -> Recording {
    let path = format!("tests/data/recordings/{name}.csv");
    recording::read(name, BufReader::new(File::open(path).unwrap())).unwrap()
}

fn main() {
    // `cargo test --all-targets` runs benches too, without this argument
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    if std::env::args().any(|argument| argument == "--rates") {
        return rates();
    }
    let mut pairs = vec![(shipped("training_a"), shipped("validation_a"))];
    let ensemble = (0..SWITCHES).map(switches::random_switch);
    for (i, parameters) in [Parameters::a(), Parameters::b()]
        .into_iter()
        .chain(ensemble)
        .enumerate()
    {
        let mut noise = Stream::new(i as u64, &["bench"]);
        pairs.push((
            switches::record("t", &parameters, switches::training, 60.0, &mut noise),
            switches::record("v", &parameters, switches::validation, 20.0, &mut noise),
        ));
    }
    println!(
        "{:28} A file |  A     B     | random: median, then each",
        "VAF at dx = .5 mm"
    );
    for (name, method) in methods() {
        let mut found = Vec::new();
        for (training, validation) in &pairs {
            let training = Training::new(training).unwrap();
            found.push(score(&training, validation, method));
        }
        let mut random: Vec<f64> = found[3..].iter().map(|(vaf, _)| *vaf).collect();
        let each: Vec<String> = random.iter().map(|vaf| format!("{vaf:.4}")).collect();
        random.sort_by(f64::total_cmp);
        let median = match random.len() {
            0 => f64::NAN,
            n => 0.5 * (random[(n - 1) / 2] + random[n / 2]),
        };
        println!(
            "{name:28} {:.4} | {:.4} {:.4} | {median:.4}: {} {}",
            found[0].0,
            found[1].0,
            found[2].0,
            each.join(" "),
            rule(found[0].1),
        );
    }
}

fn rule(direction: Direction) -> String {
    match direction {
        Direction::Sign => String::new(),
        Direction::Play { delta_mm } | Direction::Dahl { delta_mm } => format!("δ {delta_mm}"),
    }
}

/// Memory lengths of EWLS, as forgetting factors at 1 kHz.
const TUNED: [f64; 8] = [0.95, 0.97, 0.98, 0.985, 0.99, 0.995, 0.998, 0.999];

/// The unexplained variance of the paper's cell and of EWLS with the best memory, divided by
/// that of the tables with a direction state, at two rates.
fn rates() {
    let switches: Vec<Parameters> = [Parameters::a(), Parameters::b()]
        .into_iter()
        .chain((0..SWITCHES).map(switches::random_switch))
        .collect();
    for hz in [1e3, 1e4] {
        let mut ratios: [Vec<f64>; 4] = Default::default();
        for (i, parameters) in switches.iter().enumerate() {
            let slips = [(0.0, 0.0); 4];
            let switch = switches::Switch {
                parameters,
                slips: &slips,
                hz,
            };
            let mut noise = Stream::new(i as u64, &["rates"]);
            let training = switch.record("t", switches::training, 60.0, &mut noise);
            let validation = switch.record("v", switches::validation, 20.0, &mut noise);
            let training = Training::new(&training).unwrap();
            let left = |method| 1.0 - score(&training, &validation, method).0;
            let paper = left(Method::Ewls(Ewls::paper(0.999, Resample::Point)));
            // the same memory at every rate
            let tuned = TUNED.map(|at_1_khz| {
                let lambda = at_1_khz.powf(1e3 / hz);
                left(Method::Ewls(Ewls::paper(lambda, Resample::Hat)))
            });
            let tuned = tuned.into_iter().fold(f64::INFINITY, f64::min);
            let hat = left(Method::Hat(Hat::default()));
            let passive = left(Method::Passive(Passive::default()));
            let of_switch = [paper / hat, paper / passive, tuned / hat, tuned / passive];
            for (all, ratio) in ratios.iter_mut().zip(of_switch) {
                all.push(ratio);
            }
        }
        let names = [
            "paper's cell / hat",
            "paper's cell / passive",
            "tuned EWLS / hat",
            "tuned EWLS / passive",
        ];
        println!(
            "{hz} Hz: geometric mean, least, greatest of {} switches",
            switches.len()
        );
        for (name, all) in names.iter().zip(ratios) {
            let mean = (all.iter().map(|r| r.ln()).sum::<f64>() / all.len() as f64).exp();
            let least = all.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = all.iter().copied().fold(0.0, f64::max);
            println!("    {name:24} {mean:.2} {least:.2} {greatest:.2}");
        }
    }
}
