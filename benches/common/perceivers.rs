//! Lattices, simulated perceivers by number, and how a method finds what they like best.

use study_analysis::power::{Likes, Perceiver};
use study_base::rng::Stream;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Lattice, Search, SearchRule};

/// Axes of the spaces.
pub(crate) const DIMENSIONS: [usize; 3] = [2, 3, 4];

/// A lattice with so many axes: 9 × 9, 9 × 9 × 9 or 5 × 5 × 5 × 5 points, of which there can be 1000 at most.
pub(crate) fn lattice(dimensions: usize) -> Lattice {
    let steps = if dimensions < 4 { 9 } else { 5 };
    Lattice::new(vec![steps; dimensions], |_| true).expect("a lattice")
}

/// A perceiver, by number.
pub(crate) fn person(likes: Likes, dimensions: usize, number: u64) -> Perceiver {
    let mut stream = Stream::new(number, &["search", "person"]);
    Perceiver::drawn(likes, dimensions, (number, 4.0), &mut stream)
}

/// How a point is found.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Way {
    /// Five points on the diagonal, every pair equally often; the one with the most wins.
    FivePoints,
    Model(Choose),
}

/// The methods of this program.
pub(crate) const WAYS: [(Way, &str); 5] = [
    (Way::FivePoints, "five fixed points"),
    (Way::Model(Choose::Random), "random pairs"),
    (Way::Model(Choose::Sobol), "Sobol pairs"),
    (model(Acquire::Eubo), "EUBO"),
    (model(Acquire::Challenger), "challenger"),
];

const fn model(acquire: Acquire) -> Way {
    Way::Model(Choose::PreferenceGp { start: 8, acquire })
}

/// The regret of what is recommended after each number of answers, which rise.
pub(crate) fn found(
    way: Way,
    lattice: &Lattice,
    person: &Perceiver,
    number: u64,
    after: &[usize],
) -> Vec<f64> {
    let mut noise = Stream::new(number, &["search", "noise"]);
    let choose = match way {
        Way::FivePoints => return five_points(lattice, person, &mut noise, after),
        Way::Model(choose) => choose,
    };
    let rule = SearchRule {
        choose,
        trials: after.last().copied().unwrap_or_default() as u32,
    };
    let mut stream = Stream::new(number, &["search", "pairs"]);
    let mut search = Search::new(&rule, lattice, &mut stream).expect("a rule");
    (after.iter())
        .map(|after| {
            while search.answered() < *after {
                let pair = search.next().expect("a pair");
                search.answer(&person.answer(lattice, pair, &mut noise));
            }
            person.regret(lattice, search.best_point().expect("a posterior"))
        })
        .collect()
}

fn five_points(
    lattice: &Lattice,
    person: &Perceiver,
    noise: &mut Stream,
    after: &[usize],
) -> Vec<f64> {
    let points: Vec<usize> = (0..5)
        .map(|i| {
            let places: Vec<usize> = (lattice.steps().iter())
                .map(|steps| i * (steps - 1) / 4)
                .collect();
            lattice.point(&places)
        })
        .collect();
    let pairs: Vec<(usize, usize)> = (0..5).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
    let mut wins = [0u32; 5];
    let mut answered = 0;
    (after.iter())
        .map(|after| {
            while answered < *after {
                let (a, b) = pairs[answered % pairs.len()];
                let answer = person.answer(lattice, [points[a], points[b]], noise);
                wins[if answer.preferred == points[a] { a } else { b }] += 1;
                answered += 1;
            }
            let most = wins.iter().max().copied().unwrap_or_default();
            let best = wins.iter().position(|n| *n == most).unwrap_or_default();
            person.regret(lattice, points[best])
        })
        .collect()
}
