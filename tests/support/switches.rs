//! Recordings of simulated switches: a motion imposed on the target, an encoder of
//! 5 µm, force and acceleration with 0.05 N and 0.05 m/s² of noise, all sampled at
//! 1 kHz, or another rate, and passed forwards and backwards through a Butterworth filter of second
//! order at 30 Hz. Simulation, not measurement.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the test and the bench use different parts")]
#![allow(unreachable_pub, reason = "a module of a test and a bench")]

use std::f64::consts::TAU;
use study_base::rng::Stream;
use study_haptics::plant::{DT_S, Parameters, Target};
use study_haptics::recording::Recording;
use study_wire::predict::Motion;

/// Ramp at the beginning, not recorded, s.
const RAMP_S: f64 = 0.5;

/// 17.5 + 12 sin(2π 0.5 t) + 4 sin of a sweep 1–4–1 Hz that takes 20 s.
pub fn training(t: f64) -> Motion {
    let tau = t % 20.0;
    let (turns, hz, hz_per_s) = if tau < 10.0 {
        (tau + 0.15 * tau * tau, 1.0 + 0.3 * tau, 0.3)
    } else {
        let rest = tau - 10.0;
        (
            25.0 + 4.0 * rest - 0.15 * rest * rest,
            4.0 - 0.3 * rest,
            -0.3,
        )
    };
    sum(&[(12.0, 0.5 * t, 0.5, 0.0), (4.0, turns, hz, hz_per_s)])
}

/// 17.5 + 15 sin(2π 1.5 t).
pub fn validation(t: f64) -> Motion {
    sum(&[(15.0, 1.5 * t, 1.5, 0.0)])
}

/// Sines given as amplitude (mm), turns, Hz, Hz/s, around the middle.
fn sum(sines: &[(f64, f64, f64, f64)]) -> Motion {
    let mut motion = Motion {
        x_mm: 17.5,
        v_mm_s: 0.0,
        a_m_s2: 0.0,
    };
    for (mm, turns, hz, hz_per_s) in sines {
        let (sin, cos) = (TAU * turns).sin_cos();
        let w = TAU * hz;
        motion.x_mm += mm * sin;
        motion.v_mm_s += mm * w * cos;
        motion.a_m_s2 += mm * (TAU * hz_per_s * cos - w * w * sin) * 1e-3;
    }
    motion
}

/// 17.5 + 14 sin(2π 0.3 t).
pub fn slow(t: f64) -> Motion {
    sum(&[(14.0, 0.3 * t, 0.3, 0.0)])
}

/// 17.5 + 9 sin(2π 0.8 t) + 4 sin(2π 2.7 t).
pub fn two_sines(t: f64) -> Motion {
    sum(&[(9.0, 0.8 * t, 0.8, 0.0), (4.0, 2.7 * t, 2.7, 0.0)])
}

/// Maxwell-slip friction of the handle: springs (N/mm) that slide at a force (N).
pub type Slips = [(f64, f64); 4];

/// Imposes a motion on a switch for `seconds` after the ramp.
pub fn record(
    name: &str,
    parameters: &Parameters,
    motion: impl Fn(f64) -> Motion,
    seconds: f64,
    noise: &mut Stream,
) -> Recording {
    record_with(name, parameters, &[(0.0, 0.0); 4], motion, seconds, noise)
}

/// [`record`] with friction that neither a table nor the mechanism has.
pub fn record_with(
    name: &str,
    parameters: &Parameters,
    slips: &Slips,
    motion: impl Fn(f64) -> Motion,
    seconds: f64,
    noise: &mut Stream,
) -> Recording {
    let switch = Switch {
        parameters,
        slips,
        hz: 1e3,
    };
    switch.record(name, motion, seconds, noise)
}

/// A simulated switch and the rate at which it is recorded, Hz: 40 kHz divided by a whole
/// number.
pub struct Switch<'a> {
    pub parameters: &'a Parameters,
    pub slips: &'a Slips,
    pub hz: f64,
}

impl Switch<'_> {
    /// Imposes a motion for `seconds` after the ramp.
    pub fn record(
        &self,
        name: &str,
        motion: impl Fn(f64) -> Motion,
        seconds: f64,
        noise: &mut Stream,
    ) -> Recording {
        let Self {
            parameters,
            slips,
            hz,
        } = *self;
        let steps_per_sample = (1.0 / (DT_S * hz)).round() as u32;
        let dt_s = 1.0 / hz;
        let mut springs_n = [0.0; 4];
        let mut before_mm: Option<f64> = None;
        let mut target = Target::new(parameters.clone(), 17.5).unwrap();
        let samples = ((RAMP_S + seconds) * hz) as u32;
        let [mut x, mut a, mut f] = [const { Vec::new() }; 3];
        for i in 0..samples * steps_per_sample {
            let t = f64::from(i) * DT_S;
            let ramped = ramp(motion(t), t);
            let mut force_n = target.step(ramped);
            let moved_mm = ramped.x_mm - before_mm.unwrap_or(ramped.x_mm);
            before_mm = Some(ramped.x_mm);
            for (spring_n, (n_per_mm, most_n)) in springs_n.iter_mut().zip(slips) {
                *spring_n = (*spring_n + n_per_mm * moved_mm).clamp(-most_n, *most_n);
                force_n += *spring_n;
            }
            if i % steps_per_sample == 0 {
                x.push((ramped.x_mm / 0.005).round() * 0.005);
                a.push(ramped.a_m_s2 + 0.05 * noise.normal());
                f.push(force_n + 0.05 * noise.normal());
            }
        }
        for column in [&mut x, &mut a, &mut f] {
            for _ in 0..2 {
                low_pass(column, hz);
                column.reverse();
            }
        }
        let v: Vec<f64> = (0..x.len())
            .map(|i| {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(x.len() - 1));
                (x[after] - x[before]) / ((after - before) as f64 * dt_s)
            })
            .collect();
        // the ramp and the ends of the filter
        let keep = (RAMP_S * hz) as usize..x.len() - (0.05 * hz) as usize;
        Recording {
            name: name.into(),
            t_s: keep.clone().map(|i| i as f64 * dt_s).collect(),
            x_mm: x[keep.clone()].to_vec(),
            v_mm_s: v[keep.clone()].to_vec(),
            a_m_s2: a[keep.clone()].to_vec(),
            f_n: f[keep].to_vec(),
            header: Vec::new(),
            sha256: name.into(),
            warnings: Vec::new(),
        }
    }
}

/// From rest in the middle, smoothly: s = 10u³ − 15u⁴ + 6u⁵.
fn ramp(motion: Motion, t: f64) -> Motion {
    if t >= RAMP_S {
        return motion;
    }
    let u = t / RAMP_S;
    let s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    let ds = 30.0 * u * u * (1.0 - u) * (1.0 - u) / RAMP_S;
    let dds = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (RAMP_S * RAMP_S);
    let from = motion.x_mm - 17.5;
    Motion {
        x_mm: 17.5 + s * from,
        v_mm_s: s * motion.v_mm_s + ds * from,
        a_m_s2: s * motion.a_m_s2 + (2.0 * ds * motion.v_mm_s + dds * from) * 1e-3,
    }
}

/// One pass of a Butterworth filter of second order, 30 Hz, at a rate in Hz.
fn low_pass(values: &mut [f64], hz: f64) {
    let k = (std::f64::consts::PI * 30.0 / hz).tan();
    let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
    let b = k * k * norm;
    let a1 = 2.0 * (k * k - 1.0) * norm;
    let a2 = (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm;
    // at rest on the first value
    let (mut x1, mut x2, mut y1, mut y2) = (values[0], values[0], values[0], values[0]);
    for value in values {
        let x = *value;
        let y = b * (x + 2.0 * x1 + x2) - a1 * y1 - a2 * y2;
        (x2, x1, y2, y1) = (x1, x, y1, y);
        *value = y;
    }
}

/// Switch `i` of the ensemble: cams from smooth to sharp and rippled, friction,
/// masses and backlash within what such switches have.
pub fn random_switch(i: u64) -> Parameters {
    let mut draw = Stream::new(2007, &["switch", &i.to_string()]);
    let mut within = |low: f64, high: f64| low + (high - low) * draw.unit();
    let sharpness = within(0.3, 1.1);
    let mut p = Parameters::a();
    for well in p.valleys.iter_mut().chain(&mut p.crests) {
        well.width_mm *= sharpness * within(0.9, 1.1);
        well.at_mm += within(-0.5, 0.5);
    }
    p.slope = within(0.36, 0.50);
    p.preload_n = within(11.0, 16.0);
    p.spring_n_per_mm = within(0.4, 0.8);
    p.ripple_n = within(-0.8, 0.8).max(0.0);
    p.ripple_mm = within(0.7, 1.2);
    p.friction = within(0.06, 0.14);
    p.stribeck = within(0.1, 0.5);
    p.presliding_mm = within(0.04, 0.10);
    p.follower_n_s_per_m = within(3.0, 9.0);
    p.pivot_n = within(0.1, 0.4);
    p.handle_kg = within(0.06, 0.14);
    p.follower_kg = within(0.10, 0.18);
    p.backlash_mm = within(0.4, 1.0);
    p
}

/// Four Maxwell-slip elements of switch `i`, which slide after 0.05 to 2 mm, together at 0.3
/// to 0.8 N.
pub fn random_slips(i: u64) -> Slips {
    let mut draw = Stream::new(2007, &["slips", &i.to_string()]);
    let mut within = |low: f64, high: f64| low + (high - low) * draw.unit();
    let total_n = within(0.3, 0.8);
    [(0.05, 0.1), (0.1, 0.3), (0.3, 0.8), (0.8, 2.0)].map(|(low, high)| {
        let (mm, n) = (within(low, high), 0.25 * total_n);
        (n / mm, n)
    })
}
