//! What only a person can check of a device: the numbers of a commissioning, and the safe motions
//! in which they are found.
//!
//! Each motion is a [`VirtualSpring`] whose rest is where the handle is: nothing moves before
//! somebody pulls, a handle that is let go comes back to its rest and not beyond the place where
//! it was let go, and force, speed and travel are bounded by the device itself. The
//! force is weighed against what pulls: weights, a spring scale or a force gauge.
//!
//! [`Numbers`] are the record. No input or output happens here.

mod quantity;
mod spring;
mod swing;

pub use quantity::{Instrument, Measured, QuantityError, instrument, measured};
pub use spring::{NoRoom, Stage, VirtualSpring, force_free, stages};
pub use swing::{
    LONGEST_LAG_S, NoSelfWeighing, SWINGS, SelfWeighing, SwingNumbers, SwingPlan, SwingSpring,
};

use serde::{Deserialize, Serialize};

/// Version of [`Numbers`].
pub const NUMBERS: &str = "study-commissioning/2";
/// Largest error of a force, as a share.
pub const GAIN_ERROR: f64 = 0.1;
/// Largest force at no command, beyond friction and the tolerance of the instrument, N.
pub const OFFSET_N: f64 = 0.2;
/// Largest error of the scale of the position, as a share, and of its origin, mm.
pub const SCALE_ERROR: f64 = 0.02;
/// See [`SCALE_ERROR`].
pub const ORIGIN_MM: f64 = 1.0;
/// A force below this share of what the smaller ones let expect is a saturated one.
const SATURATED: f64 = 0.9;

/// Where a device pushes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Towards +x: the force of the wire format is negative.
    #[serde(rename = "+x")]
    Plus,
    /// Towards −x.
    #[serde(rename = "-x")]
    Minus,
}

impl Side {
    /// Both, in the order in which they are weighed.
    pub const BOTH: [Self; 2] = [Self::Minus, Self::Plus];

    /// For people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Plus => "+x",
            Self::Minus => "−x",
        }
    }

    /// The other one: where somebody pulls against it.
    pub fn against(self) -> Self {
        match self {
            Self::Plus => Self::Minus,
            Self::Minus => Self::Plus,
        }
    }

    /// Sign of a force of the wire format that pushes there.
    pub fn sign(self) -> f64 {
        match self {
            Self::Plus => -1.0,
            Self::Minus => 1.0,
        }
    }
}

/// A force that was weighed. All are sizes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Weighing {
    /// Where the device pushed.
    pub pushes: Side,
    /// The force that was asked for, N.
    pub target_n: f64,
    /// The mean of what the device commanded, N.
    pub commanded_n: f64,
    /// What was read, N.
    pub measured_n: f64,
    /// By how much the instrument may be off, N.
    pub tolerance_n: f64,
    /// As it was typed. Untrusted.
    pub typed: String,
}

impl Weighing {
    /// Whether it shows more force than was commanded, beyond what is tolerated and the friction of
    /// the handle, N.
    pub fn is_too_strong(&self, friction_n: Option<f64>) -> bool {
        let most_n = (1.0 + GAIN_ERROR) * self.commanded_n
            + OFFSET_N
            + friction_n.unwrap_or(0.0)
            + self.tolerance_n;
        self.measured_n > most_n
    }
}

/// The forces of one direction as a line: measured = offset + gain · commanded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DirectionFit {
    /// Where the device pushed.
    pub pushes: Side,
    /// Number of forces that were weighed.
    pub forces: usize,
    /// Slope; without a second force the quotient.
    pub gain: f64,
    /// By how much the tolerance of the instrument changes the gain at most.
    pub gain_tolerance: f64,
    /// Force at no command, N; `None` without a second force.
    pub offset_n: Option<f64>,
    /// The force that it does not pass, N, if the largest one fell behind the line of the others.
    pub saturation_n: Option<f64>,
    /// The largest force that was weighed, N.
    pub largest_n: f64,
}

impl DirectionFit {
    /// Of the forces that were weighed in one direction, in ascending order; `None` of none.
    pub fn of(pushes: Side, all: &[Weighing]) -> Option<Self> {
        let own: Vec<&Weighing> = all.iter().filter(|w| w.pushes == pushes).collect();
        let largest = own.last()?;
        let saturated = (own.len() > 2)
            .then(|| {
                let line = line(&own[..own.len() - 1])?;
                let expected_n = line[1] + line[0] * largest.commanded_n;
                (largest.measured_n + largest.tolerance_n < SATURATED * expected_n)
                    .then_some(largest.measured_n)
            })
            .flatten();
        let used = &own[..own.len() - usize::from(saturated.is_some())];
        let (first, last) = (used.first()?, used.last()?);
        let [gain, offset_n] = match line(used) {
            Some([gain, offset_n]) => [gain, offset_n],
            None => [first.measured_n / first.commanded_n, f64::NAN],
        };
        let apart_n = last.commanded_n - first.commanded_n;
        let gain_tolerance = match used.len() {
            1 => first.tolerance_n / first.commanded_n,
            _ => (first.tolerance_n + last.tolerance_n) / apart_n,
        };
        Some(Self {
            pushes,
            forces: own.len(),
            gain,
            gain_tolerance,
            offset_n: offset_n.is_finite().then_some(offset_n),
            saturation_n: saturated,
            largest_n: largest.measured_n,
        })
    }

    /// Whether the forces are right, with the friction of the handle, N, if it is known; `None` if
    /// the instrument is too coarse to tell.
    pub fn is_right(&self, friction_n: Option<f64>) -> Option<bool> {
        let off = (self.gain - 1.0).abs();
        let most_n = OFFSET_N + friction_n.unwrap_or(0.0);
        if self.saturation_n.is_some() || off > GAIN_ERROR {
            return Some(false);
        }
        if self.offset_n.is_some_and(|n| n.abs() > most_n) {
            return Some(false);
        }
        (off + self.gain_tolerance <= GAIN_ERROR).then_some(true)
    }
}

/// Slope and offset of the line of least squares through forces; `None` of one force.
fn line(all: &[&Weighing]) -> Option<[f64; 2]> {
    let n = all.len() as f64;
    let mean = |of: fn(&Weighing) -> f64| all.iter().map(|w| of(w)).sum::<f64>() / n;
    let (x, y) = (mean(|w| w.commanded_n), mean(|w| w.measured_n));
    let sxx: f64 = all.iter().map(|w| (w.commanded_n - x).powi(2)).sum();
    let sxy: f64 = (all.iter())
        .map(|w| (w.commanded_n - x) * (w.measured_n - y))
        .sum();
    let slope = sxy / sxx;
    (all.len() > 1 && slope.is_finite()).then_some([slope, y - slope * x])
}

/// Two places on a ruler and as the device reports them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ruler {
    /// On the ruler, mm.
    pub ruler_mm: [f64; 2],
    /// As reported, mm.
    pub reported_mm: [f64; 2],
    /// Reported over true distance.
    pub scale: f64,
    /// By how much the reported position is off, mm.
    pub origin_mm: f64,
}

impl Ruler {
    /// Of two places that differ.
    pub fn of(ruler_mm: [f64; 2], reported_mm: [f64; 2]) -> Self {
        let [r1, r2] = ruler_mm;
        let [x1, x2] = reported_mm;
        Self {
            ruler_mm,
            reported_mm,
            scale: (x2 - x1) / (r2 - r1),
            origin_mm: 0.5 * ((x1 - r1) + (x2 - r2)),
        }
    }

    /// Whether scale and origin are right.
    pub fn is_right(&self) -> bool {
        (self.scale - 1.0).abs() <= SCALE_ERROR && self.origin_mm.abs() <= ORIGIN_MM
    }
}

/// The emergency switch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EmergencyStop {
    /// Whether the force was gone at once, as the person says.
    pub force_gone: bool,
    /// What the device reported when the switch was pressed; `None`: it did not notice. Untrusted.
    pub noticed: Option<String>,
    /// Whether the playback had ended before the switch was to be released.
    pub limp_before_release: bool,
    /// Whether there was no force after the release, as the person says; `None` if not asked.
    pub limp_after_release: Option<bool>,
}

impl EmergencyStop {
    /// Whether everything was as it has to be; `None` if the release was not asked.
    pub fn is_right(&self) -> Option<bool> {
        let right = self.force_gone && self.noticed.is_some() && self.limp_before_release;
        match (right, self.limp_after_release) {
            (true, None) => None,
            (right, after) => Some(right && after == Some(true)),
        }
    }
}

/// How a motion was limited, and how far the handle went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Travel {
    /// What it was for.
    pub what: String,
    /// Where the handle rested, mm.
    pub rest_mm: f64,
    /// Limits of the playback: travel from the rest, mm; force, N; speed, mm/s.
    pub reach_mm: f64,
    /// See `reach_mm`.
    pub force_n: f64,
    /// See `reach_mm`.
    pub velocity_mm_s: f64,
    /// Farthest from the rest, mm.
    pub farthest_mm: f64,
    /// Fastest, mm/s.
    pub fastest_mm_s: f64,
}

/// What was found in a commissioning.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Numbers {
    /// [`NUMBERS`].
    pub version: String,
    /// What was weighed with.
    pub instrument: Option<Instrument>,
    /// Where the stops are, as the device tells or as it was moved between them, mm.
    pub stroke_mm: Option<[f64; 2]>,
    /// The position.
    pub ruler: Option<Ruler>,
    /// Friction without power, N.
    pub friction_n: Option<f64>,
    /// The emergency switch.
    pub emergency_stop: Option<EmergencyStop>,
    /// Each force.
    pub weighings: Vec<Weighing>,
    /// Both directions.
    pub directions: Vec<DirectionFit>,
    /// Each motion.
    pub travels: Vec<Travel>,
    /// What the motor told when it weighed itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swing: Option<SwingNumbers>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weighed(pairs: &[[f64; 2]]) -> Vec<Weighing> {
        let one = |[commanded_n, measured_n]: &[f64; 2]| Weighing {
            pushes: Side::Minus,
            target_n: *commanded_n,
            commanded_n: *commanded_n,
            measured_n: *measured_n,
            tolerance_n: 0.01 * measured_n,
            typed: String::new(),
        };
        pairs.iter().map(one).collect()
    }

    fn fit(pairs: &[[f64; 2]]) -> DirectionFit {
        DirectionFit::of(Side::Minus, &weighed(pairs)).unwrap()
    }

    /// By hand: the points lie on lines.
    #[test]
    fn gain_offset_and_saturation_are_those_of_the_forces() {
        let right = fit(&[[1.5, 1.5], [6.0, 6.0], [12.0, 12.0]]);
        assert!((right.gain - 1.0).abs() < 1e-12 && right.offset_n.unwrap().abs() < 1e-12);
        assert_eq!(
            (right.saturation_n, right.is_right(None)),
            (None, Some(true))
        );
        let weak = fit(&[[3.0, 1.6], [12.0, 6.1]]);
        assert!((weak.gain - 0.5).abs() < 1e-12);
        assert!((weak.offset_n.unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(weak.is_right(None), Some(false));
        let biased = fit(&[[1.5, 1.8], [6.0, 6.3], [12.0, 12.3]]);
        assert!((biased.offset_n.unwrap() - 0.3).abs() < 1e-9);
        assert_eq!(biased.is_right(None), Some(false));
        assert_eq!(biased.is_right(Some(0.2)), Some(true));
        let saturated = fit(&[[1.5, 1.5], [6.0, 6.0], [12.0, 9.0]]);
        assert_eq!(saturated.saturation_n, Some(9.0));
        assert!((saturated.gain - 1.0).abs() < 1e-12);
        assert_eq!(saturated.is_right(None), Some(false));
        assert_eq!(fit(&[[3.0, 1.5]]).gain, 0.5);
        assert_eq!(DirectionFit::of(Side::Plus, &weighed(&[[1.0, 1.0]])), None);
    }

    #[test]
    fn a_force_is_too_strong_beyond_gain_offset_friction_and_tolerance() {
        let [one] = &weighed(&[[10.0, 11.4]])[..] else {
            unreachable!()
        };
        // 11 + 0.2 + 0.114
        assert!(one.is_too_strong(None) && !one.is_too_strong(Some(0.1)));
        let [weak] = &weighed(&[[10.0, 5.0]])[..] else {
            unreachable!()
        };
        assert!(!weak.is_too_strong(None));
    }

    #[test]
    fn a_coarse_scale_tells_nothing_about_a_gain_near_its_limit() {
        let mut coarse = weighed(&[[1.5, 1.5], [6.0, 6.0], [12.0, 12.0]]);
        coarse.iter_mut().for_each(|w| w.tolerance_n = 0.6);
        let fit = DirectionFit::of(Side::Minus, &coarse).unwrap();
        assert_eq!(fit.is_right(None), None);
    }

    #[test]
    fn a_switch_that_the_device_does_not_notice_fails() {
        let right = EmergencyStop {
            force_gone: true,
            noticed: Some("external".to_owned()),
            limp_before_release: true,
            limp_after_release: Some(true),
        };
        assert_eq!(right.is_right(), Some(true));
        let unnoticed = EmergencyStop {
            noticed: None,
            ..right.clone()
        };
        assert_eq!(unnoticed.is_right(), Some(false));
        let again = EmergencyStop {
            limp_after_release: Some(false),
            ..right.clone()
        };
        assert_eq!(again.is_right(), Some(false));
        let unasked = EmergencyStop {
            limp_after_release: None,
            ..right
        };
        assert_eq!(unasked.is_right(), None);
    }
}
