//! What a motion will identify, before it is recorded.
//!
//! The motion is sampled as its sensors would, beside a target without any force: what the recording says of mass
//! and damping ([`super::evidence`]) then is what it can say at best. A target with detents and friction of its own
//! explains a part of the motion, too, so that the bounds of a real recording are hardly ever lower.

use super::evidence;
use crate::recording::{Recording, acceleration, range, velocity};
use study_base::rng::Stream;
use study_wire::predict::Motion;

/// Samples, at most; of longer motions every so many-th is taken, with less noise.
const ENOUGH: usize = 50_000;
/// Parts of the travel that are visited in both directions, or are not.
const PARTS: usize = 50;
/// Encoder counts, and distances between samples, in the width of a detent that is resolved.
const PER_DETENT: f64 = 2.0;
/// Friction that would show, in standard errors.
const SHOWN: f64 = 3.0;

/// What is known of the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Resolution of the encoder, mm.
    pub encoder_mm: f64,
    /// Noise of the force, N rms.
    pub force_noise_n: f64,
    /// Samples a second.
    pub rate_hz: f64,
}

/// What a motion will identify.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// Lowest and highest position, mm.
    pub range_mm: [f64; 2],
    /// What is found from on: the mass, kg, and the damping, N·s/mm; `None` if they cannot be found.
    pub least: [Option<f64>; 2],
    /// Friction that shows at a position, N.
    pub friction_n: f64,
    /// The share of the travel that is passed in both directions, without which there is no friction.
    pub both_directions: f64,
    /// Narrower detents are not resolved by the samples, mm.
    pub detent_mm: f64,
    /// The distance of nodes unless it is given, mm; narrower detents need a smaller one.
    pub scale_mm: f64,
}

/// The forecast of a motion of `total_s`; `None` if it does not go forth and back, or has too few samples.
pub fn of(motion: impl Fn(f64) -> Motion, total_s: f64, sensors: Sensors) -> Option<Forecast> {
    let samples = total_s * sensors.rate_hz;
    let every = (samples / ENOUGH as f64).max(1.0);
    let interval_s = every / sensors.rate_hz;
    let noise_n = sensors.force_noise_n / every.sqrt();
    // bounded by ENOUGH
    let n = (samples / every).floor() as usize;
    if n < 8 {
        return None;
    }
    let mut noise = Stream::new(1, &["forecast"]);
    let t_s: Vec<f64> = (0..n).map(|i| i as f64 * interval_s).collect();
    let count = |x: f64| match sensors.encoder_mm > 0.0 {
        true => (x / sensors.encoder_mm).round() * sensors.encoder_mm,
        false => x,
    };
    let x_mm: Vec<f64> = t_s.iter().map(|t| count(motion(*t).x_mm)).collect();
    let range_mm = range(&x_mm);
    let recording = Recording {
        name: "forecast".into(),
        v_mm_s: (0..n).map(|i| velocity(&t_s, &x_mm, i)).collect(),
        a_m_s2: (0..n).map(|i| acceleration(&t_s, &x_mm, i)).collect(),
        f_n: (0..n).map(|_| noise_n * noise.normal()).collect(),
        t_s,
        x_mm,
        header: Vec::new(),
        sha256: String::new(),
        warnings: Vec::new(),
    };
    let [low, high] = range_mm;
    // false for NaN
    let moves = high > low;
    if !moves {
        return None;
    }
    let part = |x: f64| ((PARTS as f64 * (x - low) / (high - low)) as usize).min(PARTS - 1);
    let mut passed = [[0_usize; PARTS]; 2];
    let mut fastest_mm_s = 0.0_f64;
    for t in &recording.t_s {
        let Motion { x_mm, v_mm_s, .. } = motion(*t);
        if v_mm_s != 0.0 {
            passed[usize::from(v_mm_s > 0.0)][part(x_mm)] += 1;
        }
        fastest_mm_s = fastest_mm_s.max(v_mm_s.abs());
    }
    let both: Vec<usize> = (0..PARTS)
        .map(|k| passed[0][k].min(passed[1][k]))
        .filter(|samples| *samples > 0)
        .collect();
    let fewest = both.iter().min().copied()? as f64 * every;
    let evidence = evidence::of(&[&recording], range_mm)?;
    Some(Forecast {
        range_mm,
        least: evidence.map(|of| of.shown_from),
        friction_n: SHOWN * sensors.force_noise_n / (2.0 * fewest).sqrt(),
        both_directions: both.len() as f64 / PARTS as f64,
        detent_mm: PER_DETENT * sensors.encoder_mm.max(fastest_mm_s / sensors.rate_hz),
        scale_mm: recording.scale_mm(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sines(parts: &'static [(f64, f64)]) -> impl Fn(f64) -> Motion {
        move |t| {
            let mut motion = Motion::at_rest(0.0);
            for (hz, mm) in parts {
                let w = TAU * hz;
                motion.x_mm += mm * (w * t).sin();
                motion.v_mm_s += mm * w * (w * t).cos();
                motion.a_m_s2 -= 1e-3 * mm * w * w * (w * t).sin();
            }
            motion
        }
    }

    const SENSORS: Sensors = Sensors {
        encoder_mm: 0.005,
        force_noise_n: 0.05,
        rate_hz: 1000.0,
    };

    /// Fast motion shows a small mass, slow motion a large one or none.
    #[test]
    fn what_a_motion_shows_depends_on_its_speed_and_on_the_sensors() {
        let fast = of(sines(&[(0.5, 12.0), (3.1, 2.0)]), 20.0, SENSORS).unwrap();
        let [mass, damping] = fast.least.map(Option::unwrap);
        // white noise of 0.05 N beside an acceleration of .5 m/s² rms in 20,000 samples: (4 + 1.881) · 0.05/(0.5 √20,000) = 4.2 g,
        // and more, because position explains most of the slow sine's
        assert!((4e-3..1.5e-2).contains(&mass), "{mass}");
        // (4 + 1.881) · 0.05/(38 mm/s √20,000) = 5.5e-5 N·s/mm, and several times as much, because friction whose dependence on the
        // speed is unknown looks like it
        assert!((5.5e-5..5e-4).contains(&damping), "{damping}");
        assert_eq!(fast.both_directions, 1.0);
        // 2 (2π 0.5 · 12 + 2π 3.1 · 2) mm/s over 1000 a second
        assert!((fast.detent_mm - 0.153).abs() < 0.01, "{}", fast.detent_mm);
        let noisy = Sensors {
            force_noise_n: 0.5,
            ..SENSORS
        };
        let noisy = of(sines(&[(0.5, 12.0), (3.1, 2.0)]), 20.0, noisy).unwrap();
        let ratio = noisy.least[0].unwrap() / mass;
        assert!((9.0..11.0).contains(&ratio), "{ratio}");
        let slow = of(sines(&[(0.01, 2.0)]), 200.0, SENSORS).unwrap();
        assert!(slow.least[0].is_none_or(|kg| kg > 1.0), "{slow:?}");
        assert!(of(Motion::at_rest, 1.0, SENSORS).is_none());
    }
}
