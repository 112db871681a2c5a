//! Instruments for velocity and acceleration: derivatives of the position over a scale of time.
//!
//! The differences of neighboring samples are noisy, and least squares on a noisy regressor finds too
//! little of its parameter. The slope and the curvature of a parabola through *other* samples of the
//! position have noise of their own: they vary with the true derivative and not with the noise of the
//! differences, which makes them instruments. Whatever their scale, the estimate stays consistent; its error
//! depends on the scale.

use crate::recording::Recording;

/// Points of the parabola on either side.
const POINTS: usize = 4;
/// The fewest instruments that a recording has room for at a scale, as a multiple of their reach.
const ROOM: usize = 4;

/// Velocity, mm/s, and acceleration, m/s², at every sample; 0 near the ends, where there is no room.
#[derive(Debug, Clone)]
pub(super) struct Instruments {
    pub(super) v: Vec<f64>,
    pub(super) a: Vec<f64>,
}

/// Widths of the means through which parabolas are laid, in samples: all odd.
pub(super) fn widths(recordings: &[&Recording]) -> Vec<usize> {
    let longest = recordings.iter().map(|r| r.len()).max().unwrap_or(0);
    (1..usize::BITS)
        .map(|power| (1_usize << power) - 1)
        .take_while(|width| *width == 1 || ROOM * 2 * reach(*width) <= longest)
        .collect()
}

/// The nearest point of the parabola, in widths: the differences at a sample have the samples beside it,
/// and the parabola has not.
fn nearest(width: usize) -> usize {
    if width == 1 { 2 } else { 1 }
}

/// Samples on either side that are used.
fn reach(width: usize) -> usize {
    (nearest(width) + POINTS - 1) * width + width / 2
}

impl Instruments {
    /// Of parabolas through means of `width` samples, an odd number.
    pub(super) fn new(recording: &Recording, width: usize) -> Self {
        let x = &recording.x_mm;
        let n = x.len();
        let step_s = width as f64 * recording.duration_s() / (n - 1) as f64;
        // sums from the beginning
        let mut sums = vec![0.0; n + 1];
        for i in 0..n {
            sums[i + 1] = sums[i] + (x[i] - x[0]);
        }
        let half = width / 2;
        let mean = |at: usize| (sums[at + half + 1] - sums[at - half]) / width as f64;
        let times: Vec<f64> = (0..POINTS)
            .map(|k| (nearest(width) + k) as f64 * step_s)
            .collect();
        let squares: Vec<f64> = times.iter().map(|t| t * t).collect();
        let middle = squares.iter().sum::<f64>() / POINTS as f64;
        let of_odd: f64 = squares.iter().sum();
        let of_even: f64 = squares.iter().map(|s| (s - middle).powi(2)).sum();
        let reach = reach(width);
        let (mut v, mut a) = (vec![0.0; n], vec![0.0; n]);
        for i in reach..n.saturating_sub(reach) {
            for (k, (time, square)) in times.iter().zip(&squares).enumerate() {
                let away = (nearest(width) + k) * width;
                let (after, before) = (mean(i + away), mean(i - away));
                v[i] += 0.5 * time * (after - before) / of_odd;
                a[i] += 1e-3 * (square - middle) * (after + before) / of_even;
            }
        }
        Self { v, a }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(x: impl Fn(f64) -> f64) -> Recording {
        let mut text = String::from("t_s,x_mm,f_n\n");
        for i in 0..400 {
            let t = 0.01 * f64::from(i);
            text += &format!("{t},{},{t}\n", x(t));
        }
        crate::recording::read("r", text.as_bytes()).unwrap()
    }

    #[test]
    fn the_derivatives_of_a_parabola_are_exact_at_every_scale() {
        let r = recording(|t| 1.0 + 2.0 * t + 3.0 * t * t);
        let widths = widths(&[&r]);
        assert_eq!(widths, [1, 3, 7]);
        for width in widths {
            let found = Instruments::new(&r, width);
            for i in reach(width)..r.len() - reach(width) {
                let t = r.t_s[i];
                assert!((found.v[i] - 2.0 - 6.0 * t).abs() < 1e-8, "{width} {i}");
                assert!((found.a[i] - 6e-3).abs() < 1e-8, "{width} {i}");
            }
        }
    }

    /// One wrong sample changes the differences beside it, and no instrument there.
    #[test]
    fn an_instrument_does_not_have_the_noise_of_the_differences() {
        let good = recording(|t| (6.0 * t).sin());
        let mut bad = good.clone();
        bad.x_mm[200] += 1.0;
        for width in widths(&[&good]) {
            let [one, other] = [&good, &bad].map(|r| Instruments::new(r, width));
            for i in 199..=201 {
                assert!((one.v[i] - other.v[i]).abs() < 1e-9, "{width}");
                assert!((one.a[i] - other.a[i]).abs() < 1e-9, "{width}");
            }
            assert!((one.v[200 + 2 * width] - other.v[200 + 2 * width]).abs() > 1e-6);
        }
    }
}
