//! A rater's impression of a realization, relative to the target.
//!
//! All impressions of a study use one exploration: x = c + A·sin 2πφ(t) mm with
//! φ' = 1 − 0.5·cos(2πt/6) Hz for 6 s, from 0.5 to 1.5 Hz and back. The target's force is
//! computed once, and the realization's force is predicted for the same motion. Both are
//! smoothed over 21 ms, similar to the filter of recordings, because the target's impacts
//! last a millisecond and no table contains them. The target is switch B, or another one
//! that the study's own best realization stands for.

use std::f64::consts::TAU;
use study_base::perception::{FORCE_JND_N, force_jnd_n};
use study_haptics::model::Realization;
use study_haptics::plant::{DT_S, HandParameters, Parameters, Target};
use study_wire::elements;
use study_wire::mechanism::State;
use study_wire::predict::{DirectionState, Motion, force_n};

/// Comparison of a realization with the target. Deterministic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impression {
    /// Root mean square difference from the target's force, N; of a target that is weaker than
    /// 1 N it is larger in proportion, as it is felt.
    pub force_error_n: f64,
    /// The same at the ends of the exploration, N.
    pub end_error_n: f64,
    /// Mean over nodes and directions of the negative part of m relative to the slider's
    /// mass plus that of b relative to the hand's damping. 0 for no negative parameters,
    /// 1 if all of the mass or the damping is compensated.
    pub activeness: f64,
    /// Largest force relative to the target's.
    pub detent: f64,
    /// Root mean square of the rate of force relative to the target's.
    pub crispness: f64,
}

/// Nothing below is felt, however weak the target, N.
const LEAST_JND_N: f64 = 0.001;

const SECONDS: f64 = 6.0;
/// Center and amplitude of the exploration of switch B, mm.
const OF_B_MM: [f64; 2] = [17.5, 15.0];
/// Amplitude of another exploration, as a share of the trained range.
const SHARE: f64 = 0.45;
/// Share of an exploration's amplitude that is its end.
const END: f64 = 0.2;
/// Interval of the samples, s.
const SAMPLE_S: f64 = 1e-3;
/// Simulation steps per sample, for 1 kHz.
const STEPS_PER_SAMPLE: usize = 40;
/// Number of samples on either side in the moving average.
const SMOOTHING: usize = 10;

/// The exploration and the target's force in it.
#[derive(Debug)]
pub struct Reference {
    center_mm: f64,
    amplitude_mm: f64,
    motion: Vec<Motion>,
    force_n: Vec<f64>,
    largest_n: f64,
    rate: f64,
}

impl Reference {
    /// The simulated switch B.
    pub fn switch_b() -> Self {
        let [center_mm, amplitude_mm] = OF_B_MM;
        let mut target = Target::new(Parameters::b(), center_mm)
            .expect("a unit test checks the built-in parameters");
        let steps = (SECONDS / DT_S) as usize;
        let mut sampled = Vec::with_capacity(steps / STEPS_PER_SAMPLE + 1);
        let mut felt = Vec::with_capacity(steps / STEPS_PER_SAMPLE + 1);
        for i in 0..steps {
            let motion = exploration(i as f64 * DT_S, OF_B_MM);
            let force_n = target.step(motion);
            if i % STEPS_PER_SAMPLE == 0 {
                sampled.push(motion);
                felt.push(force_n);
            }
        }
        Self::new([center_mm, amplitude_mm], sampled, smoothed(&felt))
    }

    /// A realization that stands for the target.
    pub fn of(best: &Realization) -> Self {
        let [low, high] = best.trained.x_mm;
        let around = [0.5 * (low + high), SHARE * (high - low)];
        let samples = (SECONDS / SAMPLE_S) as usize;
        let motion: Vec<Motion> = (0..samples)
            .map(|i| exploration(i as f64 * SAMPLE_S, around))
            .collect();
        let force_n = predicted(best, &motion);
        Self::new(around, motion, force_n)
    }

    /// A difference of force in the units of one that is felt at 1 N or more.
    fn felt_n(&self, difference_n: f64) -> f64 {
        let least_n = force_jnd_n(self.largest_n).max(LEAST_JND_N);
        difference_n * (FORCE_JND_N / least_n)
    }

    fn new([center_mm, amplitude_mm]: [f64; 2], motion: Vec<Motion>, force_n: Vec<f64>) -> Self {
        Self {
            center_mm,
            amplitude_mm,
            largest_n: largest(&force_n),
            rate: rate(&force_n),
            motion,
            force_n,
        }
    }
}

/// Motion of an exploration with this center and amplitude at `t_s`.
fn exploration(t_s: f64, [center_mm, amplitude_mm]: [f64; 2]) -> Motion {
    let turn = TAU / SECONDS;
    // 2πφ and its two derivatives, rad.
    let phase = TAU * t_s - 0.5 * SECONDS * libm::sin(turn * t_s);
    let rate = TAU * (1.0 - 0.5 * libm::cos(turn * t_s));
    let change = TAU * 0.5 * turn * libm::sin(turn * t_s);
    let (sin, cos) = (libm::sin(phase), libm::cos(phase));
    Motion {
        x_mm: center_mm + amplitude_mm * sin,
        v_mm_s: amplitude_mm * cos * rate,
        a_m_s2: 1e-3 * amplitude_mm * (cos * change - sin * rate * rate),
    }
}

impl Impression {
    /// Computes the impression of a realization. This takes about a millisecond.
    pub fn of(realization: &Realization, reference: &Reference) -> Self {
        let predicted = predicted(realization, &reference.motion);
        let difference = |keep: &dyn Fn(&Motion) -> bool| {
            let squares: Vec<f64> = reference
                .motion
                .iter()
                .zip(reference.force_n.iter().zip(&predicted))
                .filter(|(motion, _)| keep(motion))
                .map(|(_, (target, model))| (target - model).powi(2))
                .collect();
            reference.felt_n((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
        };
        Self {
            force_error_n: difference(&|_| true),
            end_error_n: difference(&|motion| {
                (motion.x_mm - reference.center_mm).abs() > (1.0 - END) * reference.amplitude_mm
            }),
            activeness: activeness(realization),
            detent: largest(&predicted) / reference.largest_n,
            crispness: rate(&predicted) / reference.rate,
        }
    }

    /// Root mean square difference of the forces of two realizations in the exploration, N,
    /// enlarged as [`Impression::force_error_n`].
    pub(super) fn distance_n(a: &Realization, b: &Realization, reference: &Reference) -> f64 {
        let [a, b] = [a, b].map(|of| predicted(of, &reference.motion));
        let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
        reference.felt_n((squares / a.len() as f64).sqrt())
    }

    /// Opinion of a rater without bias and noise, on a scale from 1 to 7.
    ///
    /// A question whose id contains `crisp` or `detent` is about that property, with 5 for
    /// the target's value; all other questions are about the overall impression.
    pub(super) fn opinion(&self, question: &str) -> f64 {
        if question.contains("crisp") {
            1.0 + 4.0 * self.crispness
        } else if question.contains("detent") {
            1.0 + 4.0 * self.detent
        } else {
            BEST - PER_NEWTON * self.force_error_n - PER_ACTIVENESS * self.activeness
        }
    }
}

/// Opinion of the target itself.
const BEST: f64 = 6.0;
/// Decrease of the opinion per newton of force error.
const PER_NEWTON: f64 = 0.7;
/// Decrease of the opinion per unit of activeness.
const PER_ACTIVENESS: f64 = 0.5;

/// The force of a realization in an exploration.
fn predicted(realization: &Realization, exploration: &[Motion]) -> Vec<f64> {
    let table = realization.table();
    let [low, high] = realization.trained.x_mm;
    let trained = realization.trained.v_mm_s;
    let mechanism = realization.mechanism.as_ref().map(|own| own.view());
    let mut own = State::at_rest(exploration.first().map_or(low, |motion| motion.x_mm));
    let elements = realization.elements.as_ref().map(|own| own.view());
    let mut own_elements = (elements.as_ref().zip(exploration.first()))
        .map(|(view, first)| elements::State::at_rest(view, first.x_mm));
    let mut state = DirectionState::default();
    let forces: Vec<f64> = (exploration.iter())
        .map(|motion| {
            if let Some(view) = &mechanism {
                let without_mass_n = own.step(view, *motion, SAMPLE_S);
                return without_mass_n + view.scalars.handle_kg * motion.a_m_s2;
            }
            if let (Some(view), Some(own)) = (&elements, &mut own_elements) {
                return own.step(view, *motion, SAMPLE_S) + view.mass_kg * motion.a_m_s2;
            }
            let z = state.step(realization.direction, *motion);
            // Limited to the trained range, as on the device.
            let limited = Motion {
                x_mm: motion.x_mm.max(low).min(high),
                v_mm_s: motion.v_mm_s.max(-trained).min(trained),
                ..*motion
            };
            force_n(&table, z, limited)
        })
        .collect();
    smoothed(&forces)
}

fn activeness(realization: &Realization) -> f64 {
    let hand = HandParameters::default();
    let negative = |values: &[f64], unit: f64| {
        let missing: f64 = values.iter().filter(|v| **v < 0.0).map(|v| v.abs()).sum();
        missing / (unit * values.len() as f64)
    };
    [&realization.positive, &realization.negative]
        .iter()
        .map(|branch| {
            negative(&branch.m_kg, hand.slider_kg)
                + negative(&branch.b_n_s_per_mm, hand.damping_n_s_per_mm)
        })
        .sum::<f64>()
        / 2.0
}

/// Moving average, over fewer samples at the ends.
fn smoothed(values: &[f64]) -> Vec<f64> {
    (0..values.len())
        .map(|i| {
            let from = i.saturating_sub(SMOOTHING);
            let to = (i + SMOOTHING + 1).min(values.len());
            values[from..to].iter().sum::<f64>() / (to - from) as f64
        })
        .collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// Root mean square of the difference between consecutive samples.
fn rate(values: &[f64]) -> f64 {
    let squares: f64 = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use study_haptics::model::{Branch, Provenance, Trained};
    use study_wire::predict::{Direction, Lookup};

    /// A table with a constant mass and the scaled quasi-static force of the target in
    /// each direction.
    fn table(scale: f64, mass: f64) -> Realization {
        let nodes: Vec<f64> = (4..=66).map(|i| f64::from(i) * 0.5).collect();
        let branch = |direction: f64| {
            let start = if direction > 0.0 { 1.0 } else { 34.0 };
            let mut target = Target::new(Parameters::b(), start).unwrap();
            let mut force = vec![0.0; nodes.len()];
            let speed = 20.0 * direction;
            let steps = (33.0 / 20.0 / DT_S) as usize;
            for i in 0..steps {
                let motion = Motion {
                    x_mm: start + speed * i as f64 * DT_S,
                    v_mm_s: speed,
                    a_m_s2: 0.0,
                };
                let felt = target.step(motion);
                let nearest = ((motion.x_mm - 2.0) / 0.5).round();
                if (0.0..nodes.len() as f64).contains(&nearest) {
                    force[nearest as usize] = felt;
                }
            }
            Branch {
                m_kg: vec![mass; nodes.len()],
                b_n_s_per_mm: vec![0.0; nodes.len()],
                k_n_per_mm: vec![0.0; nodes.len()],
                f0_n: force.iter().map(|f| scale * f).collect(),
            }
        };
        Realization {
            id: "t".to_owned(),
            provenance: Provenance::default(),
            vaf: BTreeMap::new(),
            lookup: Lookup::Linear,
            direction: Direction::Play { delta_mm: 0.8 },
            trained: Trained {
                x_mm: [1.5, 33.5],
                v_mm_s: 140.0,
            },
            x_mm: nodes.clone(),
            positive: branch(1.0),
            negative: branch(-1.0),
            mechanism: None,
            elements: None,
            units: study_haptics::model::Units::Linear,
        }
    }

    #[test]
    fn the_motion_is_the_derivative_of_the_position() {
        let step = 1e-6;
        let at = |t_s| exploration(t_s, OF_B_MM);
        for i in 1..60 {
            let t = f64::from(i) * 0.1;
            let (before, now, after) = (at(t - step), at(t), at(t + step));
            let v = (after.x_mm - before.x_mm) / (2.0 * step);
            let a = (after.v_mm_s - before.v_mm_s) / (2.0 * step) * 1e-3;
            assert!((v - now.v_mm_s).abs() < 1e-5, "{t}");
            assert!((a - now.a_m_s2).abs() < 1e-5, "{t}");
        }
    }

    #[test]
    fn the_targets_profile_has_a_smaller_error_than_half_of_it() {
        let b = Reference::switch_b();
        let own = Impression::of(&table(1.0, 0.0), &b);
        let half = Impression::of(&table(0.5, 0.0), &b);
        assert!(own.force_error_n < 1.6, "{own:?}");
        assert!(half.force_error_n > own.force_error_n + 0.5, "{half:?}");
        assert!((0.8..1.2).contains(&own.detent), "{own:?}");
        assert!((0.4..0.6).contains(&half.detent), "{half:?}");
        assert!(own.opinion("realism") > half.opinion("realism"));
        assert_eq!(own, Impression::of(&table(1.0, 0.0), &b));
    }

    /// A realization that stands for the target is felt as the target.
    #[test]
    fn the_best_realization_of_another_study_is_its_target() {
        let best = table(1.0, 0.0);
        let target = Reference::of(&best);
        let own = Impression::of(&best, &target);
        assert_eq!(
            (own.force_error_n, own.detent, own.crispness),
            (0.0, 1.0, 1.0)
        );
        let half = Impression::of(&table(0.5, 0.0), &target);
        assert!(half.force_error_n > 1.0 && half.detent < 0.6, "{half:?}");
        // Of a target as weak as a key, the same shares of its force are felt: at 1 N and more a
        // difference by its newtons, below by its part of the greatest force.
        let weak = Reference::of(&table(0.05, 0.0));
        assert!(weak.largest_n < 0.5);
        let weak = Impression::of(&table(0.025, 0.0), &weak);
        let expected = half.force_error_n / target.largest_n;
        assert!((weak.force_error_n - expected).abs() < 1e-9, "{weak:?}");
    }

    #[test]
    fn only_negative_mass_is_active() {
        let b = Reference::switch_b();
        assert_eq!(Impression::of(&table(1.0, 0.3), &b).activeness, 0.0);
        let active = Impression::of(&table(1.0, -0.3), &b).activeness;
        assert!((active - 0.5).abs() < 1e-12, "{active}");
    }
}
