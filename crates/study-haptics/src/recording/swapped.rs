//! Whether the columns of position and force are swapped.
//!
//! Checked only without velocity and acceleration, whose scale would tell otherwise.
//! Three criteria have to agree, because each alone has other possible causes (a
//! force-driven switch that snaps meets the first two):
//!
//! * the force is smoother than the position, although mass, detents and sensor noise
//!   add high frequencies to a force;
//! * the position is a function of the force and its direction, but the force is not a
//!   function of the position, although the same detent force occurs at several
//!   positions;
//! * the force is one-sided, like a position counted from the end of the stroke, and
//!   the position is centered on zero, like the force of a back-and-forth motion.

use super::{Warning, mean_and_variance, range};

/// Time between compared samples, s: the motion of hands and probes is slower, detents
/// are faster.
const SPAN_S: f64 = 0.01;
/// Least number of samples.
const MIN_SAMPLES: usize = 500;
/// Bins of the range of a column, in each direction.
const BINS: usize = 40;
/// Least ratio of the roughness of the position to that of the force.
const MIN_SMOOTHER: f64 = 4.0;
/// Least share of the force's variance that the position does not explain …
const MIN_UNEXPLAINED: f64 = 0.3;
/// … and its least ratio to the share of the position's variance that the force does
/// not explain.
const MIN_RATIO: f64 = 4.0;
/// Distance of the center of a range from zero, in half ranges: a column above the first
/// is one-sided, a column below the second is centered.
const ONE_SIDED: f64 = 0.9;
const CENTERED: f64 = 0.4;

/// A warning with its evidence.
pub(super) fn swapped(t_s: &[f64], x_mm: &[f64], f_n: &[f64]) -> Option<Warning> {
    if t_s.len() < MIN_SAMPLES || offset(f_n) < ONE_SIDED || offset(x_mm) > CENTERED {
        return None;
    }
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1) as f64;
    // at most a tenth of the recording, so that there is something to compare
    let span = ((SPAN_S / step_s).round() as usize).clamp(1, t_s.len() / 10);
    let smoother = roughness(x_mm, span) / roughness(f_n, span);
    let of_force = unexplained(x_mm, f_n, span);
    let of_position = unexplained(f_n, x_mm, span);
    let found = smoother >= MIN_SMOOTHER
        && of_force >= MIN_UNEXPLAINED
        && of_position * MIN_RATIO <= of_force;
    found.then_some(Warning::Swapped {
        smoother,
        of_force,
        of_position,
    })
}

/// Distance of the center of the range from zero, in half ranges.
fn offset(values: &[f64]) -> f64 {
    let [low, high] = range(values);
    ((low + high) / (high - low)).abs()
}

/// The rms second difference over the standard deviation.
fn roughness(y: &[f64], span: usize) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for i in span..y.len() - span {
        square += (y[i + span] - 2.0 * y[i] + y[i - span]).powi(2);
        count += 1.0;
    }
    (square / count / mean_and_variance(y).1).sqrt()
}

/// The share of the variance of `y` that `x` and its direction do not explain: the
/// variance within bins of x, separately for each direction.
fn unexplained(x: &[f64], y: &[f64], span: usize) -> f64 {
    let [low, high] = range(x);
    // count, sum and sum of squares of each bin
    let mut bins = [[0.0; 3]; 2 * BINS];
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let mut total = 0.0;
    for i in span..x.len() - span {
        let step = x[i + span] - x[i - span];
        if step == 0.0 {
            continue;
        }
        let bin = ((x[i] - low) / (high - low) * BINS as f64) as usize;
        let direction = usize::from(step > 0.0) * BINS;
        let [count, sum, square] = &mut bins[direction + bin.min(BINS - 1)];
        let value = y[i] - mean;
        *count += 1.0;
        *sum += value;
        *square += value * value;
        total += value * value;
    }
    let filled = bins.iter().filter(|[count, ..]| *count > 0.0);
    let within: f64 = filled
        .map(|[count, sum, square]| square - sum * sum / count)
        .sum();
    within / total
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five seconds at 1 kHz.
    fn times() -> Vec<f64> {
        (0..5000).map(|i| f64::from(i) * 1e-3).collect()
    }

    /// One period per second.
    fn sine(t: f64) -> f64 {
        (std::f64::consts::TAU * t).sin()
    }

    /// A switch with detents, moved by a probe.
    fn probed() -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = times().iter().map(|t| 17.5 - 15.0 * sine(*t)).collect();
        let f = x.iter().map(|x| 5.0 * (x / 2.0).sin()).collect();
        (x, f)
    }

    #[test]
    fn swapped_columns_are_recognized_and_correct_ones_are_not_suspected() {
        let (x, f) = probed();
        assert_eq!(swapped(&times(), &x, &f), None);
        let Some(Warning::Swapped {
            smoother,
            of_force,
            of_position,
        }) = swapped(&times(), &f, &x)
        else {
            panic!("not recognized");
        };
        assert!(smoother > 5.0, "{smoother}");
        assert!(
            of_position < 0.1 && of_force > 0.5,
            "{of_position} {of_force}"
        );
    }

    #[test]
    fn a_spring_a_mass_and_a_damper_give_no_warning() {
        let t = times();
        let x: Vec<f64> = t.iter().map(|t| 17.5 - 15.0 * sine(*t)).collect();
        let around: Vec<f64> = t.iter().map(|t| -15.0 * sine(*t)).collect();
        for y in [
            around.clone(),
            around.iter().map(|x| -x).collect(),
            t.iter().map(|t| sine(t + 0.25)).collect(),
        ] {
            assert_eq!(swapped(&t, &x, &y), None);
            assert_eq!(swapped(&t, &around, &y), None);
            // nor if they are swapped: it cannot be recognized
            assert_eq!(swapped(&t, &y, &x), None);
        }
    }

    /// A bistable switch that snaps under a smooth force.
    #[test]
    fn a_switch_that_snaps_under_a_smooth_force_gives_no_warning() {
        let t = times();
        let f: Vec<f64> = t.iter().map(|t| 6.0 * sine(*t)).collect();
        let mut side = 5.0;
        let x: Vec<f64> = f
            .iter()
            .map(|f| {
                if f.abs() > 4.0 {
                    side = if *f > 0.0 { 30.0 } else { 5.0 };
                }
                side + 0.1 * f
            })
            .collect();
        assert_eq!(swapped(&t, &x, &f), None);
        // a push button: both columns one-sided
        let f: Vec<f64> = f.iter().map(|f| 6.5 + f).collect();
        assert_eq!(swapped(&t, &x, &f), None);
    }
}
