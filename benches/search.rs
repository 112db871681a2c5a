//! How long the next pair of a search takes, how much better than what it finds the best point is, and what is claimed where
//! nothing is better.
//!
//! ```text
//! cargo bench --bench search                                             # times of the next pair
//! cargo bench --bench search -- --regret 200 --file regret.csv           # perceivers of each kind
//! cargo bench --bench search -- --flat 2000 --file flat.csv              # searches of a flat space
//! cargo bench --bench search -- --confirm 10000                          # confirmations of identical stimuli
//! cargo bench --bench search -- --perceivers 200 --file perceivers.csv   # utilities, for docs/search-compare.py
//! cargo bench --bench search -- --table --file regret.csv                # what is in a file
//! ```
//!
//! Regret is the utility of the best point of the lattice minus that of the point that a method recommends, in units of the
//! noise of one impression, after 20, 40 and 60 answers. A file has one line for each perceiver and method, or for ten searchers of a
//! flat space. What is there is not simulated again, so that a run can be interrupted. `--shard 2/4` simulates every fourth
//! perceiver, into a file of its own; `cat` puts files together. `--only "3 peaked"` simulates the rows whose name has the text.
//! Seeds are fixed. Tables have Monte Carlo errors: mean ± standard error.
#![allow(clippy::print_stdout)]

#[path = "common/confirmations.rs"]
mod confirmations;
#[path = "common/perceivers.rs"]
mod perceivers;
#[path = "common/resumed.rs"]
mod resumed;

use perceivers::{DIMENSIONS, WAYS, found, lattice, person};
use resumed::{Shard, rows};
use std::collections::BTreeMap;
use std::time::Instant;
use study_analysis::power::Likes;
use study_base::rng::Stream;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Lattice, Search, SearchRule};
use study_stats::describe;

/// Answers after which the recommended point is asked for.
const AFTER: [usize; 3] = [20, 40, 60];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let number = |name: &str| {
        let given = arguments.iter().any(|a| a == name);
        given.then(|| {
            let number = value(name).and_then(|n| n.parse::<u64>().ok());
            number.unwrap_or_else(|| panic!("{name} takes a number"))
        })
    };
    let file = value("--file").unwrap_or_else(|| "search.csv".to_owned());
    let shard = Shard::of(value("--shard").as_deref());
    let only = value("--only").unwrap_or_default();
    let jobs = |names: Vec<String>, n: u64| -> Vec<(String, u64)> {
        let names: Vec<String> = names.into_iter().filter(|n| n.contains(&only)).collect();
        let mine = (0..n).filter(|i| shard.has(*i));
        mine.flat_map(|i| names.iter().map(move |name| (name.clone(), i)))
            .collect()
    };
    if arguments.iter().any(|a| a == "--table") {
        return table(&file);
    }
    if let Some(n) = number("--confirm") {
        return confirmations::print(n);
    }
    if let Some(n) = number("--flat") {
        let own = jobs(vec![FLAT.to_owned()], n);
        resumed::run(&file, own, |_, i| confirmations::flat(i));
        return table(&file);
    }
    if let Some(n) = number("--perceivers") {
        let worlds = worlds();
        let names = worlds.iter().map(|world| world.name("perceivers"));
        let own = jobs(names.collect(), n);
        return resumed::run(&file, own, |name, i| {
            let world = worlds.iter().find(|w| w.name("perceivers") == name);
            world.expect("it is one of them").utilities(i)
        });
    }
    if let Some(n) = number("--regret") {
        let worlds = worlds();
        let all: Vec<(String, usize, usize)> = (worlds.iter().enumerate())
            .flat_map(|(w, world)| (0..WAYS.len()).map(move |m| (world.of_method(WAYS[m].1), w, m)))
            .collect();
        let own = jobs(all.iter().map(|one| one.0.clone()).collect(), n);
        resumed::run(&file, own, |name, i| {
            let one = all.iter().find(|one| one.0 == name);
            let (_, w, m) = one.expect("it is one of them");
            let world = &worlds[*w];
            let person = person(world.likes, world.dimensions, i);
            found(WAYS[*m].0, &world.lattice, &person, i, &AFTER)
        });
        return table(&file);
    }
    time();
}

/// The name of the lines of flat searches.
const FLAT: &str = "flat";

/// A space and what its perceivers like.
struct World {
    dimensions: usize,
    lattice: Lattice,
    likes: Likes,
}

impl World {
    fn name(&self, what: &str) -> String {
        format!("{what} {} {}", self.dimensions, self.likes.as_str())
    }

    fn of_method(&self, method: &str) -> String {
        format!("{} {method}", self.name("regret"))
    }

    /// The utility of every point.
    fn utilities(&self, number: u64) -> Vec<f64> {
        let person = person(self.likes, self.dimensions, number);
        let points = 0..self.lattice.len();
        points
            .map(|point| person.of_point(&self.lattice, point))
            .collect()
    }
}

fn worlds() -> Vec<World> {
    let of = |dimensions: usize| {
        Likes::ALL.map(|likes| World {
            dimensions,
            lattice: lattice(dimensions),
            likes,
        })
    };
    DIMENSIONS.into_iter().flat_map(of).collect()
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
        let person = person(Likes::Peaked, lattice.steps().len(), 1);
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

/// The results of a name, by number.
type Found = BTreeMap<String, BTreeMap<u64, Vec<f64>>>;

/// Prints what is in a file.
fn table(file: &str) {
    let mut all = Found::new();
    for (name, number, numbers) in rows(file) {
        all.entry(name).or_default().insert(number, numbers);
    }
    if let Some(flat) = all.get(FLAT) {
        print_flat(flat);
    }
    let worlds = worlds();
    let any = |world: &World| {
        let name = world.name("regret");
        all.keys().any(|key| key.starts_with(&name))
    };
    if !worlds.iter().any(any) {
        return;
    }
    println!(
        "| axes | perceiver | method | perceivers | 20 answers | 40 answers | 60 answers |\n|---|---|---|---|---|---|---|"
    );
    for world in &worlds {
        for method in methods() {
            let Some(found) = all.get(&world.of_method(method)) else {
                continue;
            };
            let cells = [0, 1, 2].map(|at| {
                let own: Vec<f64> = found.values().map(|r| r[at]).collect();
                with_error(&own, 2)
            });
            println!(
                "| {} | {} | {method} | {} | {} |",
                world.dimensions,
                world.likes.as_str(),
                found.len(),
                cells.join(" | ")
            );
        }
    }
    compare(&all, &worlds);
}

/// The program's own methods, and those of docs/search-compare.py.
fn methods() -> impl Iterator<Item = &'static str> {
    WAYS.into_iter().map(|way| way.1).chain(OTHERS)
}

const OTHERS: [&str; 2] = ["AEPsych", "BoTorch EUBO"];

/// What the challenger is compared with: the same perceivers in both.
fn compare(all: &Found, worlds: &[World]) {
    println!(
        "\n| axes | perceiver | answers | regret of five fixed points over that of the challenger | challenger less EUBO | challenger less AEPsych | challenger less BoTorch EUBO |\n|---|---|---|---|---|---|---|"
    );
    for world in worlds {
        let of = |method: &str| all.get(&world.of_method(method));
        let Some(own) = of("challenger") else {
            continue;
        };
        for (at, answers) in AFTER.iter().enumerate() {
            let both = |method: &str| -> Vec<(f64, f64)> {
                let Some(other) = of(method) else {
                    return Vec::new();
                };
                let same = own
                    .iter()
                    .filter_map(|(i, r)| Some((r[at], other.get(i)?[at])));
                same.collect()
            };
            let less = |method: &str| {
                let differences: Vec<f64> = both(method).iter().map(|(a, b)| a - b).collect();
                with_error(&differences, 2)
            };
            println!(
                "| {} | {} | {answers} | {} | {} | {} | {} |",
                world.dimensions,
                world.likes.as_str(),
                ratio(&both("five fixed points")),
                less("EUBO"),
                less(OTHERS[0]),
                less(OTHERS[1]),
            );
        }
    }
}

/// The mean of the second numbers over that of the first, with its standard error by the delta method.
fn ratio(both: &[(f64, f64)]) -> String {
    let mean = |of: fn(&(f64, f64)) -> f64| {
        let all: Vec<f64> = both.iter().map(of).collect();
        describe::mean(&all).filter(|mean| *mean > 0.0)
    };
    let (Some(own), Some(other)) = (mean(|b| b.0), mean(|b| b.1)) else {
        return "–".to_owned();
    };
    let ratio = other / own;
    let rests: Vec<f64> = both.iter().map(|(a, b)| (b - ratio * a) / own).collect();
    let error = describe::sd(&rests).unwrap_or_default() / (both.len() as f64).sqrt();
    format!("{ratio:.1} ± {error:.1}")
}

/// Mean ± standard error.
fn with_error(x: &[f64], digits: usize) -> String {
    let Some(mean) = describe::mean(x) else {
        return "–".to_owned();
    };
    let error = describe::sd(x).unwrap_or_default() / (x.len() as f64).sqrt();
    format!("{mean:.digits$} ± {error:.digits$}")
}

/// The winner of searches in which every point is as good as every other.
fn print_flat(found: &BTreeMap<u64, Vec<f64>>) {
    println!(
        "{} flat spaces, ten searchers each\n\n| what | mean | true |\n|---|---|---|",
        found.len()
    );
    let column = |at: usize| -> Vec<f64> { found.values().map(|r| r[at]).collect() };
    for (at, name) in confirmations::FLAT.iter().enumerate() {
        let shown = match *name {
            // A share of all comparisons, since some winners have few.
            "of these, won" => {
                let both: Vec<(f64, f64)> = column(2).into_iter().zip(column(3)).collect();
                share(&both)
            }
            _ => with_error(&column(at), 3),
        };
        let truth = match at {
            2 => "–",
            3 | 5 => "0.5",
            _ => "0",
        };
        println!("| {name} | {shown} | {truth} |");
    }
}

/// The second numbers over the first ones, with the standard error by the delta method.
fn share(both: &[(f64, f64)]) -> String {
    let (all, won): (f64, f64) = both
        .iter()
        .fold((0.0, 0.0), |sum, b| (sum.0 + b.0, sum.1 + b.1));
    if all <= 0.0 {
        return "–".to_owned();
    }
    let (share, mean) = (won / all, all / both.len() as f64);
    let rests: Vec<f64> = both.iter().map(|(n, k)| (k - share * n) / mean).collect();
    let error = describe::sd(&rests).unwrap_or_default() / (both.len() as f64).sqrt();
    format!("{share:.3} ± {error:.3}")
}
