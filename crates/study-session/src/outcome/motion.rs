//! What a hand did in a playback, from its telemetry: the outcomes of docs/outcomes.md.
//!
//! Each is a pure function of the samples. Forces and ways do not depend on the rate of the samples, as
//! long as that is fast enough for the motion.

use super::Sample;
use study_plan::protocol::Telemetry;

/// Time over which a force is averaged, s.
const FORCE_S: f64 = 0.02;
/// The way back that makes a turn, mm: a smaller one is noise.
const TURN_MM: f64 = 0.1;
/// Slower than this the handle rests, mm/s.
const REST_MM_S: f64 = 5.0;
/// The shortest rest, s.
const REST_S: f64 = 0.1;
/// Time at both ends of a playback over which a position is averaged, s.
const ENDS_S: f64 = 0.1;
/// A way from begin to end that is shorter is none, mm.
const WAY_MM: f64 = 1.0;
/// A longer time without samples leaves it open what happened, s.
const LONGEST_GAP_S: f64 = 0.1;
/// What times may differ by that are the same, s.
const SAME_S: f64 = 1e-9;

/// An outcome of the playbacks of a trial, in its unit: the largest peak force, the sum of ways, energies and
/// rests, the overshoot of the last one. `None` where it cannot be told: too few samples, samples that are
/// missing for longer than 0.1 s or, of the overshoot, a playback that ends where it began. Strokes are
/// counted by the device.
pub fn outcome(playbacks: &[Vec<Sample>], what: Telemetry) -> Option<f64> {
    let all: Option<Vec<Vec<Sample>>> = playbacks.iter().map(|p| whole(p)).collect();
    let all = all.filter(|all| !all.is_empty())?;
    let sum = |of: fn(&[Sample]) -> f64| Some(all.iter().map(|p| of(p)).sum());
    match what {
        Telemetry::PeakForce => {
            let peaks: Option<Vec<f64>> = all.iter().map(|p| peak_force_n(p)).collect();
            peaks?.into_iter().reduce(f64::max)
        }
        Telemetry::Path => sum(path_mm),
        Telemetry::Energy => sum(energy_j),
        Telemetry::Dwell => sum(dwell_s),
        Telemetry::Overshoot => overshoot_mm(all.last()?),
        Telemetry::Strokes => None,
    }
}

/// The finite samples in the order of time; `None` for fewer than two, or if they have a gap.
fn whole(samples: &[Sample]) -> Option<Vec<Sample>> {
    let finite = |s: &Sample| {
        let numbers = [s.t_s, s.x_mm, s.v_mm_s, s.force_command_n];
        numbers.iter().all(|x| x.is_finite()) && s.force_measured_n.is_none_or(f64::is_finite)
    };
    let mut kept: Vec<Sample> = Vec::with_capacity(samples.len());
    for sample in samples.iter().filter(|s| finite(s)) {
        match kept.last() {
            Some(last) if sample.t_s <= last.t_s => {}
            Some(last) if sample.t_s - last.t_s > LONGEST_GAP_S => return None,
            _ => kept.push(*sample),
        }
    }
    (kept.len() >= 2).then_some(kept)
}

/// The force at each sample: the measured one if the whole playback has it, else the commanded one.
fn forces_n(samples: &[Sample]) -> Vec<f64> {
    let measured: Option<Vec<f64>> = samples.iter().map(|s| s.force_measured_n).collect();
    measured.unwrap_or_else(|| samples.iter().map(|s| s.force_command_n).collect())
}

/// The largest size of the mean force over 20 ms; `None` for a shorter playback.
fn peak_force_n(samples: &[Sample]) -> Option<f64> {
    let forces = forces_n(samples);
    let last_s = samples.last()?.t_s;
    let (mut sum, mut end, mut peak) = (0.0, 0, None);
    for (first, sample) in samples.iter().enumerate() {
        let until_s = sample.t_s + FORCE_S - SAME_S;
        while end < samples.len() && samples[end].t_s < until_s {
            sum += forces[end];
            end += 1;
        }
        // The window has to be over before the playback is; the last sample stands for its own interval.
        let interval_s = (first.checked_sub(1)).map_or(0.0, |i| sample.t_s - samples[i].t_s);
        if last_s + interval_s >= until_s {
            let mean: f64 = sum / (end - first) as f64;
            peak = Some(mean.abs().max(peak.unwrap_or(0.0)));
        }
        sum -= forces[first];
    }
    peak
}

/// The way from turn to turn, where the handle turns once it has come back by more than 0.1 mm.
fn path_mm(samples: &[Sample]) -> f64 {
    let Some(first) = samples.first() else {
        return 0.0;
    };
    // The last turn, the furthest place since then, and the direction: 0 before the first way of 0.1 mm.
    let (mut turn, mut furthest, mut direction) = (first.x_mm, first.x_mm, 0.0);
    let mut way = 0.0;
    for x in samples.iter().map(|s| s.x_mm) {
        if direction == 0.0 {
            if (x - turn).abs() > TURN_MM {
                (direction, furthest) = ((x - turn).signum(), x);
            }
        } else if direction * (x - furthest) >= 0.0 {
            furthest = x;
        } else if (x - furthest).abs() > TURN_MM {
            way += (furthest - turn).abs();
            (turn, furthest, direction) = (furthest, x, -direction);
        }
    }
    way + if direction == 0.0 {
        0.0
    } else {
        (furthest - turn).abs()
    }
}

/// ∫ F dx by trapezoids: what the hand has put in and not got back.
fn energy_j(samples: &[Sample]) -> f64 {
    let forces = forces_n(samples);
    let steps = samples.windows(2).zip(forces.windows(2));
    let work_mj: f64 = steps
        .map(|(s, f)| 0.5 * (f[0] + f[1]) * (s[1].x_mm - s[0].x_mm))
        .sum();
    1e-3 * work_mj
}

/// Time at less than 5 mm/s, in rests of at least 0.1 s.
fn dwell_s(samples: &[Sample]) -> f64 {
    let stretches = samples.chunk_by(|a, b| rests(a) == rests(b));
    stretches
        .filter(|stretch| stretch.first().is_some_and(rests))
        .filter_map(|rest| Some(rest.last()?.t_s - rest.first()?.t_s))
        .filter(|s| *s >= REST_S - SAME_S)
        .sum()
}

/// How far the handle was beyond the place where it ended, seen from where it began; `None` if both are the
/// same place.
fn overshoot_mm(samples: &[Sample]) -> Option<f64> {
    let (from_s, to_s) = (samples.first()?.t_s + ENDS_S, samples.last()?.t_s - ENDS_S);
    let mean = |inside: &dyn Fn(f64) -> bool| {
        let own = samples.iter().filter(|s| inside(s.t_s)).map(|s| s.x_mm);
        let (n, sum) = own.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
        (n > 0.0 && from_s <= to_s).then_some(sum / n)
    };
    let begin = mean(&|t_s| t_s <= from_s)?;
    let end = mean(&|t_s| t_s >= to_s)?;
    if (end - begin).abs() < WAY_MM {
        return None;
    }
    let direction = (end - begin).signum();
    let beyond = samples.iter().map(|s| direction * (s.x_mm - end));
    Some(beyond.fold(0.0, f64::max))
}

fn rests(sample: &Sample) -> bool {
    sample.v_mm_s.abs() <= REST_MM_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// Samples of a motion at a rate, s⁻¹, over a time, s.
    fn motion(rate: f64, time_s: f64, of: impl Fn(f64) -> (f64, f64, f64)) -> Vec<Sample> {
        let n = (rate * time_s).round() as usize;
        (0..=n)
            .map(|i| {
                let t_s = i as f64 / rate;
                let (x_mm, v_mm_s, force_command_n) = of(t_s);
                Sample {
                    t_s,
                    x_mm,
                    v_mm_s,
                    force_command_n,
                    force_measured_n: None,
                }
            })
            .collect()
    }

    /// x = A sin(ωt), and a force of it.
    fn sine(rate: f64, time_s: f64, force: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
        motion(rate, time_s, |t| {
            let (x, v) = (10.0 * (TAU * t).sin(), 10.0 * TAU * (TAU * t).cos());
            (x, v, force(x, v))
        })
    }

    fn one(samples: Vec<Sample>, what: Telemetry) -> Option<f64> {
        outcome(&[samples], what)
    }

    fn close(found: Option<f64>, expected: f64, tolerance: f64) {
        let found = found.unwrap();
        assert!(
            (found - expected).abs() <= tolerance * expected.abs(),
            "{found} {expected}"
        );
    }

    #[test]
    fn the_path_of_a_sine_is_four_amplitudes_in_a_period_and_noise_adds_nothing() {
        for rate in [100.0, 1000.0] {
            close(
                one(sine(rate, 3.0, |_, _| 0.0), Telemetry::Path),
                120.0,
                1e-3,
            );
        }
        let noisy = motion(1000.0, 3.0, |t| {
            let noise = if (t * 1000.0).round() as i64 % 2 == 0 {
                0.04
            } else {
                -0.04
            };
            (10.0 * (TAU * t).sin() + noise, 0.0, 0.0)
        });
        // By the sum of all steps it would be 3 × 40 + 3000 × 0.08 mm.
        close(one(noisy, Telemetry::Path), 120.0, 1e-2);
        // A handle that trembles goes nowhere.
        let trembling = motion(1000.0, 1.0, |t| (0.04 * (TAU * 50.0 * t).sin(), 0.0, 0.0));
        assert_eq!(one(trembling, Telemetry::Path), Some(0.0));
    }

    /// Over whole periods a spring gives back what was put in, friction μ takes 4 μ A and damping b takes
    /// π b ω A² in each.
    #[test]
    fn the_energy_of_whole_periods_is_what_friction_and_damping_take() {
        let (amplitude_m, omega) = (0.010, TAU);
        let spring = one(sine(1000.0, 2.0, |x, _| 0.5 * x), Telemetry::Energy).unwrap();
        assert!(spring.abs() < 1e-9, "{spring}");
        let friction = one(
            sine(1000.0, 2.0, |_, v| 2.0 * v.signum()),
            Telemetry::Energy,
        );
        close(friction, 2.0 * 4.0 * 2.0 * amplitude_m, 1e-3);
        // 3 N·s/m, of a speed in mm/s.
        let damping = one(sine(1000.0, 2.0, |_, v| 3.0 * 1e-3 * v), Telemetry::Energy);
        close(damping, 2.0 * PI * 3.0 * omega * amplitude_m.powi(2), 1e-4);
    }

    /// A sine of 2 Hz is averaged over 20 ms: sin(0.04π)/(0.04π) of its amplitude; of a peak of 4 ms a fifth is left.
    #[test]
    fn the_peak_force_is_the_mean_over_20_ms() {
        let sine = motion(1000.0, 2.0, |t| (0.0, 0.0, -6.0 * (TAU * 2.0 * t).sin()));
        let share = (0.04 * PI).sin() / (0.04 * PI);
        close(one(sine, Telemetry::PeakForce), 6.0 * share, 1e-4);
        let spike = motion(1000.0, 1.0, |t| {
            (
                0.0,
                0.0,
                if (0.5..0.5039).contains(&t) {
                    10.0
                } else {
                    0.0
                },
            )
        });
        close(one(spike, Telemetry::PeakForce), 2.0, 1e-9);
        let short = motion(1000.0, 0.01, |_| (0.0, 0.0, 5.0));
        assert_eq!(one(short, Telemetry::PeakForce), None);
    }

    #[test]
    fn the_measured_force_counts_where_there_is_a_sensor() {
        let mut samples = motion(1000.0, 1.0, |_| (0.0, 0.0, 5.0));
        for sample in &mut samples {
            sample.force_measured_n = Some(4.0);
        }
        close(one(samples.clone(), Telemetry::PeakForce), 4.0, 1e-12);
        samples[7].force_measured_n = None;
        close(one(samples, Telemetry::PeakForce), 5.0, 1e-12);
    }

    /// The step response of a damped oscillator overshoots by exp(−πζ/√(1 − ζ²)) of the step.
    #[test]
    fn the_overshoot_of_a_damped_step_is_that_of_its_damping() {
        let (zeta, omega, step): (f64, f64, f64) = (0.3, 20.0, 12.0);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let response = |t: f64| {
            let t = t - 0.2;
            if t < 0.0 {
                return 0.0;
            }
            let wave = (damped * t).cos() + zeta * omega / damped * (damped * t).sin();
            step * (1.0 - (-zeta * omega * t).exp() * wave)
        };
        let expected = step * (-PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
        for sign in [1.0, -1.0] {
            let samples = motion(1000.0, 3.0, |t| (sign * response(t), 0.0, 0.0));
            close(one(samples, Telemetry::Overshoot), expected, 1e-3);
        }
        // Without one it is none, and without a way it is not defined.
        let straight = motion(1000.0, 2.0, |t| (10.0 * t.min(1.0), 0.0, 0.0));
        assert_eq!(one(straight, Telemetry::Overshoot), Some(0.0));
        let back = motion(1000.0, 2.0, |t| (5.0 - 5.0 * (TAU * t).cos(), 0.0, 0.0));
        assert_eq!(one(back, Telemetry::Overshoot), None);
    }

    #[test]
    fn the_dwell_is_the_time_in_rests() {
        // 0.5 s of rest, 1 s of motion, 0.05 s of rest, 1 s of motion, 0.3 s of rest.
        let speed = |t: f64| match t {
            t if t < 0.5005 => 1.0,
            t if t < 1.5005 => 50.0,
            t if t < 1.5505 => 0.0,
            t if t < 2.5505 => -50.0,
            _ => -4.9,
        };
        for (rate, tolerance) in [(1000.0, 2e-3), (200.0, 1e-2)] {
            let samples = motion(rate, 2.85, |t| (0.0, speed(t), 0.0));
            close(one(samples, Telemetry::Dwell), 0.8, tolerance);
        }
        assert_eq!(
            one(motion(1000.0, 1.0, |_| (0.0, 5.1, 0.0)), Telemetry::Dwell),
            Some(0.0)
        );
    }

    #[test]
    fn several_playbacks_of_a_trial_are_taken_together() {
        let twice = [
            sine(1000.0, 1.0, |x, _| 0.1 * x),
            sine(1000.0, 2.0, |x, _| 0.3 * x),
        ];
        close(outcome(&twice, Telemetry::Path), 120.0, 1e-3);
        close(outcome(&twice, Telemetry::PeakForce), 3.0, 1e-2);
    }

    #[test]
    fn what_samples_do_not_tell_is_unknown() {
        let all = sine(1000.0, 2.0, |_, _| 1.0);
        let with_gap: Vec<Sample> = (all.iter().copied())
            .filter(|s| !(0.5..0.65).contains(&s.t_s))
            .collect();
        for what in [
            Telemetry::Path,
            Telemetry::Energy,
            Telemetry::PeakForce,
            Telemetry::Dwell,
        ] {
            assert_eq!(one(with_gap.clone(), what), None);
            assert_eq!(one(all[..1].to_vec(), what), None);
            assert_eq!(outcome(&[], what), None);
        }
        // A short gap changes a path by less than its own length, and broken samples nothing.
        let short: Vec<Sample> = (all.iter().copied())
            .filter(|s| !(0.5..0.55).contains(&s.t_s))
            .collect();
        close(one(short, Telemetry::Path), 80.0, 1e-3);
        let mut broken = all;
        broken[100].x_mm = f64::NAN;
        broken[200].t_s = 0.0;
        close(one(broken, Telemetry::Path), 80.0, 1e-3);
    }
}
