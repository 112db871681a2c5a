//! Simulated perceivers of a space, and how a method finds what they like best.

use study_base::rng::Stream;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Lattice, Preferred, Search, SearchRule};

/// Axes of the spaces.
pub(crate) const DIMENSIONS: [usize; 3] = [2, 3, 4];

/// A lattice with so many axes: 9 × 9, 9 × 9 × 9 or 5 × 5 × 5 × 5 points, of which there can be 1000 at most.
pub(crate) fn lattice(dimensions: usize) -> Lattice {
    let steps = if dimensions < 4 { 9 } else { 5 };
    Lattice::new(vec![steps; dimensions], |_| true).expect("a lattice")
}

/// What somebody likes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind {
    Peaked,
    Ridge,
    Camps,
}

impl Kind {
    pub(crate) const ALL: [(Self, &'static str); 3] = [
        (Self::Peaked, "peaked"),
        (Self::Ridge, "ridge"),
        (Self::Camps, "two camps"),
    ];
}

/// A simulated perceiver. The best utility is about 4, the worst 0.
pub(crate) struct Person {
    kind: Kind,
    /// The place that is liked best.
    place: Vec<f64>,
    /// The place that the other camp likes best.
    other: Vec<f64>,
    /// Of a ridge: the unit vector across it.
    across: Vec<f64>,
}

impl Person {
    pub(crate) fn new(kind: Kind, dimensions: usize, number: u64) -> Self {
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

    /// The utility of a point, in units of the noise of one impression.
    pub(crate) fn of_point(&self, lattice: &Lattice, point: usize) -> f64 {
        self.utility(&lattice.coordinates(point))
    }

    /// Of two points the one that feels better, with noise of each impression.
    pub(crate) fn answer(
        &self,
        lattice: &Lattice,
        [a, b]: [usize; 2],
        stream: &mut Stream,
    ) -> Preferred {
        let mut felt = |point| self.of_point(lattice, point) + stream.normal();
        let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
        Preferred { preferred, other }
    }

    /// The utility of the best point minus that of a point.
    pub(crate) fn regret(&self, lattice: &Lattice, point: usize) -> f64 {
        let all = lattice
            .certified()
            .iter()
            .map(|p| self.of_point(lattice, *p));
        all.fold(f64::NEG_INFINITY, f64::max) - self.of_point(lattice, point)
    }
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
    person: &Person,
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
    person: &Person,
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
