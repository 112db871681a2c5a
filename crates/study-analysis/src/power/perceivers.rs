//! Simulated perceivers of a space: what they like, and how they answer.

use study_base::rng::Stream;
use study_plan::procedure::{Lattice, Preferred};

/// Width of a hill in two axes, as a share of an axis; it grows with the square root of their number.
const HILL: f64 = 0.35;
/// Width of a ridge.
const RIDGE: f64 = 0.2;
/// The hill of the other camp, as a share of one's own.
const OTHER_CAMP: f64 = 0.625;

/// What somebody likes about a space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Likes {
    /// A place anywhere in the space, and what is near it: a normal hill.
    Peaked,
    /// What lies on a ridge that runs anywhere: only the distance from it matters.
    Ridge,
    /// A place near one corner, and less so one near the opposite corner. Half of all people are of the other camp.
    Camps,
}

impl Likes {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Peaked, Self::Ridge, Self::Camps];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Peaked => "peaked",
            Self::Ridge => "ridge",
            Self::Camps => "two camps",
        }
    }
}

/// A simulated perceiver. Utilities are in units of the noise of one impression.
#[derive(Debug, Clone, PartialEq)]
pub struct Perceiver {
    likes: Likes,
    /// About the utility of the best point; the worst has one near 0.
    best: f64,
    /// The place that is liked best.
    place: Vec<f64>,
    /// The place that the other camp likes best.
    other: Vec<f64>,
    /// Of a ridge: the unit vector across it.
    across: Vec<f64>,
}

impl Perceiver {
    /// Somebody who likes a place that is drawn; `number` decides the camp. The best utility is about `best`.
    pub fn drawn(
        likes: Likes,
        dimensions: usize,
        (number, best): (u64, f64),
        stream: &mut Stream,
    ) -> Self {
        let mut uniform = || -> Vec<f64> { (0..dimensions).map(|_| stream.unit()).collect() };
        let (mut place, drawn) = (uniform(), uniform());
        let mut other = place.clone();
        if likes == Likes::Camps {
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
            likes,
            best,
            place,
            other,
            across: across.iter().map(|x| x / length).collect(),
        }
    }

    /// The utility of a place with these coordinates, from 0 to 1 along each axis.
    pub fn utility(&self, at: &[f64]) -> f64 {
        let near = |place: &[f64]| {
            let squares: f64 = at.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum();
            let width = HILL * (at.len() as f64 / 2.0).sqrt();
            libm::exp(-squares / (2.0 * width * width))
        };
        let share = match self.likes {
            Likes::Peaked => near(&self.place),
            Likes::Ridge => {
                let away = at.iter().zip(&self.place).zip(&self.across);
                let distance: f64 = away.map(|((a, b), across)| (a - b) * across).sum();
                libm::exp(-distance * distance / (2.0 * RIDGE * RIDGE))
            }
            Likes::Camps => near(&self.place) + OTHER_CAMP * near(&self.other),
        };
        self.best * share
    }

    /// The utility of a point of a lattice.
    pub fn of_point(&self, lattice: &Lattice, point: usize) -> f64 {
        self.utility(&lattice.coordinates(point))
    }

    /// Of two points the one that feels better, with noise of each impression.
    pub fn answer(&self, lattice: &Lattice, [a, b]: [usize; 2], noise: &mut Stream) -> Preferred {
        let mut felt = |point| self.of_point(lattice, point) + noise.normal();
        let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
        Preferred { preferred, other }
    }

    /// The utility of the best point that may be presented minus that of a point.
    pub fn regret(&self, lattice: &Lattice, point: usize) -> f64 {
        let all = lattice.certified().iter();
        let most = all
            .map(|p| self.of_point(lattice, *p))
            .fold(f64::NEG_INFINITY, f64::max);
        most - self.of_point(lattice, point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(likes: Likes, number: u64) -> Perceiver {
        Perceiver::drawn(likes, 2, (number, 4.0), &mut Stream::new(number, &["test"]))
    }

    #[test]
    fn utilities_are_as_described() {
        for number in 0..20 {
            let peaked = drawn(Likes::Peaked, number);
            assert_eq!(peaked.utility(&peaked.place), 4.0);
            let beside = [peaked.place[0] + 0.35, peaked.place[1]];
            assert!((peaked.utility(&beside) - 4.0 * (-0.5_f64).exp()).abs() < 1e-12);
            let ridge = drawn(Likes::Ridge, number);
            // Along the ridge nothing changes.
            let [x, y] = [ridge.across[0], ridge.across[1]];
            let along = [ridge.place[0] - 0.7 * y, ridge.place[1] + 0.7 * x];
            assert!((ridge.utility(&along) - 4.0).abs() < 1e-9);
            let across = [ridge.place[0] + 0.2 * x, ridge.place[1] + 0.2 * y];
            assert!((ridge.utility(&across) - 4.0 * (-0.5_f64).exp()).abs() < 1e-9);
            // Two camps like opposite corners.
            let camp = drawn(Likes::Camps, number);
            let corner = if number % 2 == 0 { 0.2 } else { 0.8 };
            assert!(camp.place.iter().all(|x| (x - corner).abs() <= 0.1 + 1e-12));
            assert!(camp.utility(&camp.place) > camp.utility(&camp.other));
        }
    }

    #[test]
    fn the_best_point_has_no_regret_and_is_preferred_by_thurstones_law() {
        let lattice = Lattice::new(vec![5, 5], |at| at[0] < 4).unwrap();
        let person = drawn(Likes::Peaked, 3);
        let regrets: Vec<f64> = (lattice.certified().iter())
            .map(|point| person.regret(&lattice, *point))
            .collect();
        assert!(regrets.iter().all(|regret| *regret >= 0.0));
        assert_eq!(regrets.iter().filter(|regret| **regret == 0.0).count(), 1);
        let (a, b) = (lattice.certified()[0], lattice.certified()[7]);
        let apart = person.of_point(&lattice, a) - person.of_point(&lattice, b);
        let expected = study_stats::distribution::normal_cdf(apart / 2f64.sqrt());
        let mut noise = Stream::new(1, &["noise"]);
        let first = (0..4000)
            .filter(|_| person.answer(&lattice, [a, b], &mut noise).preferred == a)
            .count();
        // Four standard errors.
        let allowed = 4.0 * (expected * (1.0 - expected) / 4000.0).sqrt();
        assert!(
            (first as f64 / 4000.0 - expected).abs() <= allowed,
            "{first}, {expected}"
        );
    }
}
