//! Whether position and force stand in each other's columns.
//!
//! Only asked of a recording without velocity and acceleration: where they are given,
//! their scale tells. Three things have to agree, because each alone has an honest
//! cause (a force-driven switch that snaps has the first two):
//!
//! * the force is smoother than the position, although the mass, the detents and the
//!   noise of a force sensor only ever add to what is fast in it;
//! * the position is a function of the force and its direction, and the force none of
//!   the position: a detented force belongs to several positions;
//! * the force stays on one side of zero, as a position from the end of the stroke
//!   does, and the position has its middle there, as the force to and fro does.

use super::Warning;
use super::motion::range;

/// How far apart samples are compared, s: hands and probes move slower, detents do
/// not.
const SPAN_S: f64 = 0.01;
/// Fewer samples than this tell nothing.
const LEAST_SAMPLES: usize = 500;
/// Of the range of a column, in each direction.
const BINS: usize = 40;
/// How much smoother a force has to be than its position.
const SMOOTHER: f64 = 4.0;
/// How much of the force's variance its position has to leave open …
const LEAST_OPEN: f64 = 0.3;
/// … and how many times less the force has to leave open of the position's.
const LESS_OPEN: f64 = 4.0;
/// Distance of the middle of a range from zero, in half ranges: above, a column is on
/// one side of zero; below, it is about zero.
const ASIDE: f64 = 0.9;
const AROUND: f64 = 0.4;

/// The doubt, with its evidence.
pub(super) fn swapped(t_s: &[f64], x_mm: &[f64], f_n: &[f64]) -> Option<Warning> {
    if t_s.len() < LEAST_SAMPLES || aside(f_n) < ASIDE || aside(x_mm) > AROUND {
        return None;
    }
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1) as f64;
    // a step of time is above zero, and a span of a whole recording compares nothing
    let span = ((SPAN_S / step_s).round() as usize).clamp(1, t_s.len() / 10);
    let smoother = roughness(x_mm, span) / roughness(f_n, span);
    let (of_force, of_position) = (open(x_mm, f_n, span), open(f_n, x_mm, span));
    let found =
        smoother >= SMOOTHER && of_force >= LEAST_OPEN && of_position * LESS_OPEN <= of_force;
    found.then_some(Warning::Swapped {
        smoother,
        of_force,
        of_position,
    })
}

/// How far from zero the middle of the range is, in half ranges.
fn aside(values: &[f64]) -> f64 {
    let [low, high] = range(values);
    ((low + high) / (high - low)).abs()
}

/// Second difference over the standard deviation, both root mean square.
fn roughness(y: &[f64], span: usize) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for i in span..y.len() - span {
        square += (y[i + span] - 2.0 * y[i] + y[i - span]).powi(2);
        count += 1.0;
    }
    (square / count / variance(y)).sqrt()
}

fn variance(y: &[f64]) -> f64 {
    let n = y.len() as f64;
    let mean = y.iter().sum::<f64>() / n;
    y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

/// The share of the variance of `y` that `x` and its direction leave open: within bins
/// of x, each direction apart.
fn open(x: &[f64], y: &[f64], span: usize) -> f64 {
    let [low, high] = range(x);
    // count, sum and sum of squares of what a bin holds
    let mut bins = [[0.0; 3]; 2 * BINS];
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let mut total = 0.0;
    for i in span..x.len() - span {
        let step = x[i + span] - x[i - span];
        if step == 0.0 {
            continue;
        }
        let place = ((x[i] - low) / (high - low) * BINS as f64) as usize;
        let way = usize::from(step > 0.0) * BINS;
        let [count, sum, square] = &mut bins[way + place.min(BINS - 1)];
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

    /// Five seconds at 1 kHz of one to and fro a second.
    fn times() -> Vec<f64> {
        (0..5000).map(|i| f64::from(i) * 1e-3).collect()
    }

    fn turn(t: f64) -> f64 {
        (std::f64::consts::TAU * t).sin()
    }

    /// A switch with detents, worked by a probe.
    fn probed() -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = times().iter().map(|t| 17.5 - 15.0 * turn(*t)).collect();
        let f = x.iter().map(|x| 5.0 * (x / 2.0).sin()).collect();
        (x, f)
    }

    #[test]
    fn columns_that_are_swapped_are_doubted_and_right_ones_are_not() {
        let (x, f) = probed();
        assert_eq!(swapped(&times(), &x, &f), None);
        let Some(Warning::Swapped {
            smoother,
            of_force,
            of_position,
        }) = swapped(&times(), &f, &x)
        else {
            panic!("not doubted");
        };
        assert!(smoother > 5.0, "{smoother}");
        assert!(
            of_position < 0.1 && of_force > 0.5,
            "{of_position} {of_force}"
        );
    }

    #[test]
    fn a_spring_a_mass_and_a_damper_say_nothing() {
        let t = times();
        let x: Vec<f64> = t.iter().map(|t| 17.5 - 15.0 * turn(*t)).collect();
        let around: Vec<f64> = t.iter().map(|t| -15.0 * turn(*t)).collect();
        for y in [
            around.clone(),
            around.iter().map(|x| -x).collect(),
            t.iter().map(|t| turn(t + 0.25)).collect(),
        ] {
            assert_eq!(swapped(&t, &x, &y), None);
            assert_eq!(swapped(&t, &around, &y), None);
            // nor if they are swapped: it cannot be told
            assert_eq!(swapped(&t, &y, &x), None);
        }
    }

    /// A bistable switch that is pushed to and fro by a smooth force and snaps.
    #[test]
    fn a_switch_that_snaps_under_a_smooth_force_is_not_doubted() {
        let t = times();
        let f: Vec<f64> = t.iter().map(|t| 6.0 * turn(*t)).collect();
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
        // a push button: one side of zero, both
        let f: Vec<f64> = f.iter().map(|f| 6.5 + f).collect();
        assert_eq!(swapped(&t, &x, &f), None);
    }
}
