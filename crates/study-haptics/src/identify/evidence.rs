//! Which terms a recording carries: mass and damping with their errors, and with a bound where they are left out.
//!
//! The question is asked of a reference model with one mass and one damping,
//!
//! ```text
//! F = Σ_j h_j(x) (C_j + z D_j) + b v + m a + (s z + r sign(a)) exp(−(5 v / v_rms)²) + Σ_k e_k z_k
//! ```
//!
//! with the hat functions h_j, the direction state z that fits best (the sign of v, or play or Dahl of several lengths),
//! and a ridge on the second differences of C and D. Friction that sticks over several lengths at once is a sum of plays (Prandtl–Ishlinskii; Brokate &
//! Sprekels, Hysteresis and Phase Transitions, 1996, section 2.4), of which one length leaves what looks like damping and mass at every reversal: the
//! z_k are plays of six lengths from 0.5 to 16 % of the travel, whose force is the same everywhere. Two different things are asked.
//!
//! **Does a table take the term up?** A table is identified by least squares, from velocity and acceleration as they are, and is there to predict. It takes up
//! what least squares finds and what predicts data left out (`carried`), unless the answer to the second question contradicts (`reference`).
//!
//! **Is it the mass, or the damping?** What predicts may be friction at reversals, or an encoder's steps; and where velocity and
//! acceleration are differences of encoder counts, least squares finds too little of a term (`reference`):
//!
//! * *Estimate.* m and b are estimated with instruments w (`instruments`): derivatives of the position over a scale of time that do not share
//!   the noise of the differences. With the instrument free of everything that the rest of the model explains, and scaled to Σ w a = 1,
//!   the estimate is θ = Σ w F. It is consistent at every scale; that of largest (Σ w a)²/Σ w² is used.
//! * *Error.* θ − m = Σ w (F − m a − …), and the residual in the bracket, its noise, its drift and what the model does not have, are
//!   correlated in time in an unknown way. What such a residual does to a sum with w is seen by shifting the two against one
//!   another in time (`spread`): V(m) is the mean square of the sum over a hundred cyclic shifts, with both scaled by the
//!   residual's local size. V(m) is a parabola, because the residual has −m times the noise of a. What friction does at low speed and at a reversal
//!   is not known, and would be taken for damping and mass: the columns of s and r take it. The largest difference of the estimates without s,
//!   without the z_k where that fits nearly as well, and with rules of z that fit nearly as well, counts as an error, too.
//! * *Found.* The recordings show a term if blocks of samples that are left out are predicted better with it, and θ exceeds four errors (a search over two
//!   terms and many recordings meets three by chance). Where twice the bound would be found, it is enough that θ exceeds four errors without that
//!   of the model, and is above 0 in all models that fit nearly as well; or that it exceeds 2.326 errors (99 %), and the squared
//!   error on the blocks is a fifth larger without it.
//! * *Bound.* The upper bound is the largest m that a test does not reject, (m − θ)² ≤ 2.576² V(m) (Fieller's limit), or half the mass that
//!   exceeds (4 + 1.881) √V(m), and is therefore found with a probability of 97 %, if that is larger; the error of the model counts
//!   twice there, because a term changes it. Fieller's limit does not exist if Σ w a is not 2.7 times what the noise of a makes of
//!   it; the recording then shows no acceleration.
//!
//! **One press and release.** With fewer than [`ENOUGH_STROKES`] strokes, hardly a place is passed twice in the same direction. Then v and a are
//! functions of position and direction, and so is F − m a − b v for *every* m and b: whatever was measured, a force that depends on position and
//! direction alone explains it with any mass. Nothing tells a mass from the shape of the force within the few counts in which the
//! speed turns, so that it has **no bound**. Damping has one, because friction does not push: it cannot exceed what it would be if all
//! hysteresis were damping (`dissipation`). The same bound serves where Fieller's limit of a damping does not exist. Strokes that are `alike` bound no mass either.
//!
//! References for the instruments: Fuller, Measurement Error Models, 1987, section 1.4; for the bound: Fieller 1954, J. R. Stat. Soc. B
//! 16:175; for the shifts: Chatfield, The Analysis of Time Series, 2004, section 8.1 (cross-correlations of shifted series); for errors of blocks:
//! Liang & Zeger 1986, Biometrika 73:13.
//!
//! **Beside a known force.** Where the force by position is known from other, slow recordings, what a dynamic recording has beside it is a constant
//! (the zero of a sensor), a friction, its changes at low speed and at reversals, m a and b v (`beside`). The same estimates, errors and bounds hold, and a
//! single fast press says something of the mass, because nothing else depends on the position. Where the dynamic recordings have strokes enough to show a term by themselves,
//! the known force is not used: what it lacks is the same in each stroke, and would be taken for a damping. Only a mass that strokes at one speed cannot show is that beside
//! the known force. Damping is bounded by all of its hysteresis, because
//! friction may be less than in slow motion.

mod alike;
mod carried;
mod dissipation;
mod equations;
mod instruments;
pub mod lag;
mod noise;
mod reference;
mod spread;

use super::folds::strokes;
use crate::model::coverage::Origin;
use crate::recording::{Recording, range};
use carried::LEAST_RELIABILITY;
use equations::{BLOCKS, PER_NODE};
pub(in crate::identify) use noise::white_noise_n;
use reference::{Force, Found, Reference};
use std::borrow::Cow;
use std::fmt;

/// With fewer strokes, nothing tells a mass or a damping from a force that depends on position and direction.
pub const ENOUGH_STROKES: usize = 4;
/// Fewest samples of which something is said.
pub(super) const LEAST_SAMPLES: usize = BLOCKS * (PER_NODE + 2);

study_base::named! {
    /// A term of a realization that a recording may not carry.
    Term {
        /// The mass, kg.
        Mass = "mass",
        /// The damping, N·s/mm.
        Damping = "damping",
    }
}

impl Term {
    /// Mass and damping, in the order of the unknowns.
    pub const BOTH: [Self; 2] = [Self::Mass, Self::Damping];

    /// The unit of its values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Mass => "kg",
            Self::Damping => "N·s/mm",
        }
    }

    /// What it is multiplied by.
    pub fn regressor(self) -> &'static str {
        match self {
            Self::Mass => "acceleration",
            Self::Damping => "velocity",
        }
    }

    /// `value` in kg or N·s/mm, as a person would write it.
    pub fn shown(self, value: f64) -> String {
        match self {
            Self::Mass if value < 1.0 => format!("{:.2} g", 1e3 * value),
            Self::Mass => format!("{value:.2} kg"),
            Self::Damping => format!("{value:.2e} N·s/mm"),
        }
    }
}

/// What recordings say about one term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// The term.
    pub term: Term,
    /// Its estimate in the reference model, kg or N·s/mm.
    pub value: f64,
    /// The standard error of the estimate, with that of the model.
    pub standard_error: f64,
    /// Whether the recordings show the term.
    pub found: bool,
    /// What the term is at most, with a confidence of 99 %; `None` if the recordings do not bound it.
    pub upper_bound: Option<f64>,
    /// What would be found in 97 % of repetitions, kg or N·s/mm; `None` if nothing would.
    pub shown_from: Option<f64>,
    /// Whether that is twice the bound. It is more where friction alone bounds a damping better than what tells the two apart.
    pub shows: bool,
    /// Whether there are [`ENOUGH_STROKES`].
    pub enough_strokes: bool,
    /// Whether a table takes the term up.
    pub carried: bool,
    /// The share of the variance of its regressor, beside the other terms, that is not noise: 0 to 1.
    pub reliability: f64,
    /// Which recordings say so.
    pub origin: Origin,
}

impl Evidence {
    /// The recordings that say so, in words.
    pub fn by(&self) -> &'static str {
        match self.origin {
            Origin::Dynamic => "dynamic recordings",
            Origin::Training | Origin::Stated => "recordings",
        }
    }

    /// What recording would show the term.
    fn advice(&self) -> &'static str {
        match self.term {
            Term::Mass => "many strokes at several speeds, some of them fast, would show one",
            Term::Damping => "several strokes at different speeds would show one",
        }
    }
}

/// `mass: not identified by the recordings, at most 12.00 g (99 %)`, or why it was left out, or why it was not.
impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (term, of) = (self.term.as_str(), self.term.regressor());
        if self.found {
            let [value, error] = [self.value, self.standard_error].map(|v| self.term.shown(v));
            write!(f, "{term}: {value} ± {error}")?;
            return match (self.carried, self.reliability < LEAST_RELIABILITY) {
                (true, _) => Ok(()),
                (false, true) => write!(
                    f,
                    ", left out, because a table would find too little of it: only {:.0} % of the variance of the {of} is not \
                     noise; a filter or a sensor of the {of} would help",
                    100.0 * self.reliability
                ),
                (false, false) => write!(
                    f,
                    ", left out, because the rest of the recordings is predicted as well without it"
                ),
            };
        }
        write!(f, "{term}: not identified by the {}", self.by())?;
        match self.upper_bound.map(|bound| self.term.shown(bound)) {
            Some(bound) => write!(f, ", at most {bound} (99 %)")?,
            None => write!(f, " and not bounded")?,
        }
        if self.carried {
            return write!(
                f,
                "; a table has it because it predicts, but friction that depends on the speed may look like it"
            );
        }
        match (self.enough_strokes, self.shows, self.upper_bound) {
            (true, true, _) => Ok(()),
            (false, ..) => write!(
                f,
                "; with fewer than {ENOUGH_STROKES} strokes a force that depends on position and direction looks like any {term}; {}",
                self.advice()
            ),
            (true, false, Some(_)) => write!(
                f,
                "; no {term} can be told from friction by this motion; {}",
                self.advice()
            ),
            (true, false, None) => write!(
                f,
                ", because the {of} is explained by {} or stays below its noise; {}",
                match self.origin {
                    Origin::Dynamic => "the direction",
                    Origin::Training | Origin::Stated => "position and direction",
                },
                self.advice()
            ),
        }
    }
}

/// Whether there are samples enough for blocks.
fn enough(recordings: &[&Recording]) -> bool {
    recordings.iter().map(|r| r.len()).sum::<usize>() >= LEAST_SAMPLES
}

/// Means of consecutive samples, without recordings that are too short for differences.
fn averages<'r>(recordings: &[&'r Recording]) -> Vec<Cow<'r, Recording>> {
    let mut averages = noise::averaged(recordings);
    averages.retain(|r| r.len() > 3);
    averages
}

/// What dynamic recordings say about mass and damping beside a force by position that is known: `rest` are the recordings with the force that it leaves,
/// `whole` those with all of it. `range_mm` is where it is known. `None` if there are too few samples for blocks.
pub(super) fn beside(
    whole: &[&Recording],
    rest: &[&Recording],
    range_mm: [f64; 2],
) -> Option<[Evidence; 2]> {
    let [whole, rest] = [whole, rest].map(averages);
    let [whole, rest]: [Vec<&Recording>; 2] =
        [&whole, &rest].map(|of| of.iter().map(|r| &**r).collect());
    if !enough(&rest) {
        return None;
    }
    let held = || found_in(&Reference::new(&rest, Force::Held(&whole), range_mm, true)?);
    let found = match has_enough_strokes(&whole) {
        true => {
            let ends: Vec<f64> = whole.iter().flat_map(|r| r.range_mm()).collect();
            let reference = Reference::new(&whole, Force::Unknown, range(&ends), true)?;
            let [mass, damping] = found_in(&reference)?;
            // What the known force lacks is the same in strokes that are alike, and would be taken for a damping; a mass alone turns twice in each stroke.
            match mass.is_found() || mass.shows {
                true => [mass, damping],
                false => [held()?[0], damping],
            }
        }
        false => held()?,
    };
    Some([0, 1].map(|term| Evidence {
        carried: found[term].is_found(),
        origin: Origin::Dynamic,
        // instruments have no bias
        ..evidence(term, found[term], true, 1.0)
    }))
}

/// Whether places are passed often enough to tell a term from a force that depends on position and direction.
fn has_enough_strokes(recordings: &[&Recording]) -> bool {
    let count = |r: &&Recording| strokes(r).last().map_or(0, |last| last + 1);
    recordings.iter().map(count).sum::<usize>() >= ENOUGH_STROKES
}

/// Mass and damping in a reference model.
fn found_in(reference: &Reference) -> Option<[Found; 2]> {
    each_beside_the_other(
        |kept, term| reference.evidence(kept, term),
        Found::is_found,
        |found| found.value / found.standard_error,
    )
}

/// What is found of a term (0: mass, 1: damping), which no table takes up yet.
fn evidence(term: usize, found: Found, enough_strokes: bool, reliability: f64) -> Evidence {
    Evidence {
        term: Term::BOTH[term],
        value: found.value,
        standard_error: found.standard_error,
        found: found.is_found(),
        upper_bound: found.upper_bound,
        shown_from: found.shown_from,
        shows: found.shows,
        enough_strokes,
        carried: false,
        reliability,
        origin: Origin::Training,
    }
}

/// What the recordings say about mass and damping, each beside the other if that one is found.
/// `range_mm` is where the nodes are. `None` if there are too few samples for blocks.
pub fn of(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<[Evidence; 2]> {
    if !enough(recordings) {
        return None;
    }
    let enough_strokes = has_enough_strokes(recordings);
    let carried = carried::of(recordings, range_mm)?;
    let averages = averages(recordings);
    let averages: Vec<&Recording> = averages.iter().map(|r| &**r).collect();
    if !enough(&averages) {
        return None;
    }
    let reference = Reference::new(&averages, Force::Unknown, range_mm, enough_strokes)?;
    let found = found_in(&reference)?;
    let may_be = |term: usize| carried[term].is_carried() && found[term].may_be_carried();
    Some([0, 1].map(|term| Evidence {
        carried: enough_strokes && may_be(term),
        ..evidence(term, found[term], enough_strokes, carried[term].reliability)
    }))
}

/// Mass and damping, each beside the other if that one stays: a term that does not must not take the place of
/// the other. `with` gives a term (0: mass, 1: damping) in a model with the kept ones. If neither stays, the stronger one is
/// asked for alone.
fn each_beside_the_other<T: Copy>(
    with: impl Fn([bool; 2], usize) -> Option<T>,
    stays: impl Fn(T) -> bool,
    strength: impl Fn(T) -> f64,
) -> Option<[T; 2]> {
    let alone = |term: usize| with([term == 0, term == 1], term);
    let both = [with([true; 2], 0)?, with([true; 2], 1)?];
    match both.map(&stays) {
        [true, true] => Some(both),
        [true, false] => Some([alone(0)?, both[1]]),
        [false, true] => Some([both[0], alone(1)?]),
        [false, false] => {
            let stronger = usize::from(strength(both[1]) > strength(both[0]));
            let mut found = both;
            found[stronger] = alone(stronger)?;
            Some(found)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One that is bounded and would be found.
    fn unknown(term: Term) -> Evidence {
        Evidence {
            term,
            value: 0.001,
            standard_error: 0.002,
            found: false,
            upper_bound: Some(0.012),
            shown_from: Some(0.024),
            shows: true,
            enough_strokes: true,
            carried: false,
            reliability: 0.9,
            origin: Origin::Training,
        }
    }

    #[test]
    fn every_state_has_its_words() {
        let mass = unknown(Term::Mass);
        let none = Evidence {
            upper_bound: None,
            shown_from: None,
            shows: false,
            ..mass
        };
        let found = Evidence {
            value: 0.05,
            found: true,
            ..mass
        };
        let damping = unknown(Term::Damping);
        let few = Evidence {
            enough_strokes: false,
            shows: false,
            ..damping
        };
        for (evidence, words) in [
            (
                mass,
                "mass: not identified by the recordings, at most 12.00 g (99 %)",
            ),
            (
                none,
                "mass: not identified by the recordings and not bounded, because the acceleration is explained by position and direction \
                 or stays below its noise; many strokes at several speeds, some of them fast, would show one",
            ),
            (
                Evidence {
                    shows: false,
                    ..damping
                },
                "damping: not identified by the recordings, at most 1.20e-2 N·s/mm (99 %); no damping can be told from friction by this \
                 motion; several strokes at different speeds would show one",
            ),
            (
                few,
                "damping: not identified by the recordings, at most 1.20e-2 N·s/mm (99 %); with fewer than 4 strokes a force that \
                 depends on position and direction looks like any damping; several strokes at different speeds would show one",
            ),
            (
                Evidence {
                    carried: true,
                    ..damping
                },
                "damping: not identified by the recordings, at most 1.20e-2 N·s/mm (99 %); a table has it because it predicts, but \
                 friction that depends on the speed may look like it",
            ),
            (
                Evidence {
                    reliability: 0.3,
                    ..found
                },
                "mass: 50.00 g ± 2.00 g, left out, because a table would find too little of it: only 30 % of the variance of the \
                 acceleration is not noise; a filter or a sensor of the acceleration would help",
            ),
            (
                found,
                "mass: 50.00 g ± 2.00 g, left out, because the rest of the recordings is predicted as well without it",
            ),
        ] {
            assert_eq!(evidence.to_string(), words);
        }
    }
}
