//! How long the next pair of a search takes, and how much better than the best point the one it finds is not.
//!
//! `cargo bench --bench search` prints the time of the next pair over points and answers, one thread.
//! `cargo bench --bench search -- --regret 60` simulates so many perceivers of each kind and prints the regret: the
//! utility of the best point of the lattice minus that of the point that a method recommends, in units of the noise of one
//! impression, mean ± standard error, after 20, 40 and 60 answers. The seed is fixed: the same number of perceivers
//! prints the same tables for any number of threads.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::time::Instant;
use study_base::rng::Stream;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Lattice, Preferred, Search, SearchRule};
use study_stats::describe;

/// Answers after which the recommended point is asked for.
const AFTER: [usize; 3] = [20, 40, 60];
/// Steps of each axis.
const STEPS: usize = 9;

fn main() {
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--regret" {
            let given = arguments.next().and_then(|n| n.parse().ok());
            return regret(given.expect("--regret takes a number"));
        }
    }
    time();
}

fn time() {
    println!("| points | answers | next pair, median of 9 (ms) |\n|---|---|---|");
    for (steps, answers) in [
        (vec![9, 9], 40),
        (vec![9, 9], 100),
        (vec![9, 9, 9], 40),
        (vec![9, 9, 9], 100),
    ] {
        let lattice = Lattice::new(steps, |_| true).expect("a lattice");
        let rule = SearchRule {
            choose: Choose::PreferenceGp {
                start: 100,
                acquire: Acquire::Eubo,
            },
            trials: 200,
        };
        let person = Person::new(Kind::Peaked, lattice.steps().len(), 1);
        let mut stream = Stream::new(1, &["search", "time"]);
        let mut search = Search::new(&rule, &lattice, &mut stream).expect("a rule");
        let mut answered = Search::new(
            &SearchRule {
                choose: Choose::PreferenceGp {
                    start: 0,
                    acquire: Acquire::Eubo,
                },
                ..rule
            },
            &lattice,
            &mut Stream::new(1, &["search", "time"]),
        )
        .expect("a rule");
        for _ in 0..answers {
            let pair = search.next().expect("a pair");
            let answer = person.answer(&lattice, pair, &mut stream);
            search.answer(&answer);
            answered.answer(&answer);
        }
        let mut times: Vec<f64> = (0..9)
            .map(|_| {
                let start = Instant::now();
                std::hint::black_box(answered.next());
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("| {} | {answers} | {:.1} |", lattice.len(), times[4]);
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Peaked,
    Ridge,
    Camps,
}

impl Kind {
    const ALL: [(Self, &'static str); 3] = [
        (Self::Peaked, "peaked"),
        (Self::Ridge, "ridge"),
        (Self::Camps, "two camps"),
    ];
}

/// A simulated perceiver. The best utility is about 4, the worst 0.
struct Person {
    kind: Kind,
    /// The place that is liked best.
    place: Vec<f64>,
    /// The place that the other camp likes best.
    other: Vec<f64>,
    /// Of a ridge: the unit vector across it.
    across: Vec<f64>,
}

impl Person {
    fn new(kind: Kind, dimensions: usize, number: u64) -> Self {
        let mut stream = Stream::new(number, &["search", "person"]);
        let mut uniform = || -> Vec<f64> { (0..dimensions).map(|_| stream.unit()).collect() };
        let (mut place, drawn) = (uniform(), uniform());
        let mut other = place.clone();
        if let Kind::Camps = kind {
            let (own, others) = if number.is_multiple_of(2) {
                (0.2, 0.8)
            } else {
                (0.8, 0.2)
            };
            let near = |center: f64, u: &f64| center + 0.2 * (u - 0.5);
            place = drawn.iter().map(|u| near(own, u)).collect();
            other = drawn.iter().map(|u| near(others, u)).collect();
        }
        let across: Vec<f64> = (0..dimensions).map(|_| stream.normal()).collect();
        let length = across.iter().map(|x| x * x).sum::<f64>().sqrt();
        Self {
            kind,
            place,
            other,
            across: across.iter().map(|x| x / length).collect(),
        }
    }

    fn utility(&self, at: &[f64]) -> f64 {
        let near = |place: &[f64]| {
            let squares: f64 = at.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum();
            let width = 0.35 * (at.len() as f64 / 2.0).sqrt();
            (-squares / (2.0 * width * width)).exp()
        };
        match self.kind {
            Kind::Peaked => 4.0 * near(&self.place),
            Kind::Ridge => {
                let away = at.iter().zip(&self.place).zip(&self.across);
                let distance: f64 = away.map(|((a, b), across)| (a - b) * across).sum();
                4.0 * (-distance * distance / (2.0 * 0.2 * 0.2)).exp()
            }
            Kind::Camps => 4.0 * near(&self.place) + 2.5 * near(&self.other),
        }
    }

    fn of_point(&self, lattice: &Lattice, point: usize) -> f64 {
        self.utility(&lattice.coordinates(point))
    }

    fn answer(&self, lattice: &Lattice, [a, b]: [usize; 2], stream: &mut Stream) -> Preferred {
        let mut felt = |point| self.of_point(lattice, point) + stream.normal();
        let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
        Preferred { preferred, other }
    }

    fn regret(&self, lattice: &Lattice, point: usize) -> f64 {
        let all = lattice
            .certified()
            .iter()
            .map(|p| self.of_point(lattice, *p));
        all.fold(f64::NEG_INFINITY, f64::max) - self.of_point(lattice, point)
    }
}

/// How a point is found.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// Five points on the diagonal, every pair equally often; the one with the most wins.
    FivePoints,
    Model(Choose),
}

const WAYS: [(Way, &str); 5] = [
    (Way::FivePoints, "five fixed points"),
    (Way::Model(Choose::Random), "random pairs"),
    (Way::Model(Choose::Sobol), "Sobol pairs"),
    (model(Acquire::Eubo), "EUBO"),
    (model(Acquire::Challenger), "challenger"),
];

const fn model(acquire: Acquire) -> Way {
    Way::Model(Choose::PreferenceGp { start: 8, acquire })
}

/// The regret after each number of answers.
fn found(way: Way, lattice: &Lattice, person: &Person, number: u64) -> [f64; 3] {
    let mut noise = Stream::new(number, &["search", "noise"]);
    let choose = match way {
        Way::FivePoints => return five_points(lattice, person, &mut noise),
        Way::Model(choose) => choose,
    };
    let rule = SearchRule {
        choose,
        trials: AFTER[2] as u32,
    };
    let mut stream = Stream::new(number, &["search", "pairs"]);
    let mut search = Search::new(&rule, lattice, &mut stream).expect("a rule");
    AFTER.map(|after| {
        while search.answered() < after {
            let pair = search.next().expect("a pair");
            search.answer(&person.answer(lattice, pair, &mut noise));
        }
        person.regret(lattice, search.best_point().expect("a posterior"))
    })
}

fn five_points(lattice: &Lattice, person: &Person, noise: &mut Stream) -> [f64; 3] {
    let dimensions = lattice.steps().len();
    let points: Vec<usize> = (0..5)
        .map(|i| lattice.point(&vec![i * (STEPS - 1) / 4; dimensions]))
        .collect();
    let pairs: Vec<(usize, usize)> = (0..5).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
    let mut wins = [0u32; 5];
    let mut answered = 0;
    AFTER.map(|after| {
        while answered < after {
            let (a, b) = pairs[answered % pairs.len()];
            let answer = person.answer(lattice, [points[a], points[b]], noise);
            wins[if answer.preferred == points[a] { a } else { b }] += 1;
            answered += 1;
        }
        let most = wins.iter().max().copied().unwrap_or_default();
        let best = wins.iter().position(|n| *n == most).unwrap_or_default();
        person.regret(lattice, points[best])
    })
}

fn regret(people: u64) {
    println!("{people} perceivers of each kind\n");
    println!(
        "| axes | perceiver | method | 20 answers | 40 answers | 60 answers |\n|---|---|---|---|---|---|"
    );
    for dimensions in [2, 3] {
        let lattice = Lattice::new(vec![STEPS; dimensions], |_| true).expect("a lattice");
        for (kind, name) in Kind::ALL {
            for (way, method) in WAYS {
                let regrets: Vec<[f64; 3]> = (0..people)
                    .into_par_iter()
                    .map(|number| {
                        let person = Person::new(kind, dimensions, number);
                        found(way, &lattice, &person, number)
                    })
                    .collect();
                let cells = [0, 1, 2].map(|at| {
                    let own: Vec<f64> = regrets.iter().map(|r| r[at]).collect();
                    let mean = describe::mean(&own).unwrap_or_default();
                    let se = describe::sd(&own).unwrap_or_default() / (people as f64).sqrt();
                    format!("{mean:.2} ± {se:.2}")
                });
                println!(
                    "| {dimensions} | {name} | {method} | {} |",
                    cells.join(" | ")
                );
            }
        }
    }
}
