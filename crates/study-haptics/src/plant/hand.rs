//! A hand on the slider of the playback device.
//!
//! The hand has a voluntary trajectory and pulls the slider after it through a spring
//! and a damper (Hogan's equilibrium point; Flash & Hogan 1985 for the minimum-jerk
//! strokes):
//!
//! M·a = k·(x* − x) + b·(v* − v) − c·v − F, with M the mass of hand and slider, x* the
//! voluntary trajectory, c the damping of the slider and F the rendered force, which
//! the hand has to apply.
//!
//! The slider's mass is felt in addition to the rendered force, as on a device without
//! compensation. The hand does not react to what it feels.

use crate::trajectory::minimum_jerk;
use study_base::rng::Stream;
use study_wire::predict::Motion;

/// The parameters of a hand and of the slider.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandParameters {
    /// Effective mass of hand and finger, kg.
    pub hand_kg: f64,
    /// Mass of the slider with its grip, kg.
    pub slider_kg: f64,
    /// Stiffness of the grip and arm, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Damping of the grip and arm, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Damping of the slider's bearing, N·s/mm.
    pub bearing_n_s_per_mm: f64,
    /// Range of the peak speed of voluntary strokes, mm/s.
    pub speed_mm_s: [f64; 2],
    /// Range of the rest between strokes, s.
    pub rest_s: [f64; 2],
    /// Largest deviation of the end of a stroke, mm.
    pub end_spread_mm: f64,
}

impl Default for HandParameters {
    fn default() -> Self {
        Self {
            hand_kg: 0.15,
            slider_kg: 0.6,
            stiffness_n_per_mm: 1.0,
            damping_n_s_per_mm: 0.02,
            bearing_n_s_per_mm: 0.002,
            speed_mm_s: [40.0, 200.0],
            rest_s: [0.1, 0.6],
            end_spread_mm: 0.7,
        }
    }
}

/// A hand that moves back and forth between two ends.
#[derive(Debug)]
pub struct Hand {
    parameters: HandParameters,
    ends_mm: [f64; 2],
    variation: Stream,
    motion: Motion,
    stroke: Stroke,
    /// Time since the stroke began, s.
    stroke_s: f64,
    upwards: bool,
}

/// One voluntary movement with the rest after it.
#[derive(Debug, Clone, Copy)]
struct Stroke {
    from_mm: f64,
    by_mm: f64,
    moving_s: f64,
    resting_s: f64,
}

impl Hand {
    /// A hand at rest at the lower one of `ends_mm`; speed, rest and end of each stroke
    /// are drawn from `variation`.
    pub fn new(parameters: HandParameters, ends_mm: [f64; 2], variation: Stream) -> Self {
        let [low_mm, _] = ends_mm;
        Self {
            parameters,
            ends_mm,
            variation,
            motion: Motion::at_rest(low_mm),
            stroke: Stroke {
                from_mm: low_mm,
                by_mm: 0.0,
                moving_s: 0.0,
                resting_s: 0.3,
            },
            stroke_s: 0.0,
            upwards: false,
        }
    }

    /// The present motion of hand and slider.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Simulates `dt_s` seconds with the constant rendered force `force_n`.
    pub fn step(&mut self, force_n: f64, dt_s: f64) -> Motion {
        self.stroke_s += dt_s;
        if self.stroke_s >= self.stroke.moving_s + self.stroke.resting_s {
            self.stroke = self.next_stroke();
            self.stroke_s = 0.0;
        }
        let (wanted_mm, wanted_mm_s) = self.stroke.at(self.stroke_s);
        let p = &self.parameters;
        let pull_n = p.stiffness_n_per_mm * (wanted_mm - self.motion.x_mm)
            + p.damping_n_s_per_mm * (wanted_mm_s - self.motion.v_mm_s)
            - p.bearing_n_s_per_mm * self.motion.v_mm_s
            - force_n;
        let a_m_s2 = pull_n / (p.hand_kg + p.slider_kg);
        // semi-implicit Euler: the new speed moves the position
        let v_mm_s = self.motion.v_mm_s + dt_s * 1e3 * a_m_s2;
        self.motion = Motion {
            x_mm: self.motion.x_mm + dt_s * v_mm_s,
            v_mm_s,
            a_m_s2,
        };
        self.motion
    }

    fn next_stroke(&mut self) -> Stroke {
        let p = self.parameters;
        self.upwards = !self.upwards;
        let end_mm = self.ends_mm[usize::from(self.upwards)];
        let between = |[low, high]: [f64; 2], share: f64| low + share * (high - low);
        let spread = p.end_spread_mm;
        let to_mm = end_mm + between([-spread, spread], self.variation.unit());
        let log_speed = between(p.speed_mm_s.map(libm::log), self.variation.unit());
        let from_mm = self.stroke.from_mm + self.stroke.by_mm;
        let by_mm = to_mm - from_mm;
        Stroke {
            from_mm,
            by_mm,
            // the peak speed of a minimum-jerk movement is 15/8 of its mean
            moving_s: 1.875 * by_mm.abs() / libm::exp(log_speed),
            resting_s: between(p.rest_s, self.variation.unit()),
        }
    }
}

impl Stroke {
    /// Position, mm, and velocity, mm/s, of the voluntary trajectory.
    fn at(&self, t_s: f64) -> (f64, f64) {
        if t_s >= self.moving_s {
            return (self.from_mm + self.by_mm, 0.0);
        }
        let [share, rate, _] = minimum_jerk(t_s, self.moving_s);
        (self.from_mm + self.by_mm * share, self.by_mm * rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hand(seed: u64) -> Hand {
        Hand::new(
            HandParameters::default(),
            [3.0, 32.0],
            Stream::new(seed, &["hand"]),
        )
    }

    #[test]
    fn without_a_device_the_hand_covers_the_stroke_at_its_speeds() {
        let mut hand = hand(1);
        let (mut low, mut high, mut fastest) = (f64::MAX, f64::MIN, 0.0f64);
        for _ in 0..80_000 {
            let motion = hand.step(0.0, 250e-6);
            low = low.min(motion.x_mm);
            high = high.max(motion.x_mm);
            fastest = fastest.max(motion.v_mm_s.abs());
        }
        assert!(low < 5.0 && high > 30.0, "{low} {high}");
        assert!(low > 0.0 && high < 35.0, "{low} {high}");
        assert!((100.0..250.0).contains(&fastest), "{fastest}");
    }

    #[test]
    fn the_movement_depends_on_the_seed_alone() {
        let end = |seed| {
            let mut hand = hand(seed);
            for _ in 0..20_000 {
                hand.step(1.0, 250e-6);
            }
            hand.motion().x_mm
        };
        assert_eq!(end(1), end(1));
        assert_ne!(end(1), end(2));
    }

    #[test]
    fn a_constant_force_moves_the_resting_hand_by_force_over_stiffness() {
        let still = HandParameters {
            rest_s: [1e9, 1e9],
            ..HandParameters::default()
        };
        let mut hand = Hand::new(still, [10.0, 10.0], Stream::new(1, &[]));
        hand.stroke.resting_s = 1e9;
        for _ in 0..40_000 {
            hand.step(2.0, 250e-6);
        }
        assert!((hand.motion().x_mm - 8.0).abs() < 1e-3);
    }
}
