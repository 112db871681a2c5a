//! The maximum of a likelihood whose gradient is known, by Newton's method with differences of the
//! gradient.
//!
//! A step is Σ q qᵀg/|λ| over the eigenpairs of the Hessian: it climbs also beside a saddle, such as a
//! standard deviation of 0 where the likelihood is larger at ±θ. It is halved until the value does not
//! decrease. On a saddle itself the search moves along what curves upwards.

use crate::clm::newton::Maximum;
use crate::matrix::{Cholesky, Matrix, SymmetricEigen, SymmetricMatrix, dot};

/// Within this distance in each parameter a search keeps a negative definite Hessian.
const NEAR: f64 = 0.05;

/// The step of differences.
const STEP: f64 = 1e-4;

/// Largest change of a parameter in one step, on the scale of the link.
const LONGEST_STEP: f64 = 2.0;

const MOST_STEPS: usize = 100;

/// The step whose predicted gain of log-likelihood is smaller is the last one.
const SMALLEST_GAIN: f64 = 1e-9;

/// A smaller gain may be lost in the error of quadrature.
const LOST_GAIN: f64 = 1e-6;

/// A kept Hessian has to lower the predicted gain to this share with each step.
const PROGRESS: f64 = 0.1;

/// A curvature below this share of the largest one is taken for as much.
const FLAT: f64 = 1e-9;

/// How far the search moves away from a saddle.
const AWAY: f64 = 0.1;

/// A value and its gradient, if the parameters are admissible.
type Gradient<'a> = dyn FnMut(&[f64]) -> Option<(f64, Vec<f64>)> + 'a;

/// The maximum from a start, with the observed information there; `None` if there is none that the
/// search finds.
pub(super) fn maximum(
    start: Vec<f64>,
    mut gradient: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<Maximum> {
    let mut at = start;
    let (mut value, mut slope) = gradient(&at)?;
    let mut kept: Option<Kept> = None;
    for _ in 0..MOST_STEPS {
        let is_near = |kept: &Kept| {
            let mut moves = kept.from.iter().zip(&at);
            moves.all(|(from, at)| (from - at).abs() < NEAR)
        };
        let reused = kept.take().filter(is_near).and_then(|kept| {
            let direction = Direction::of(&kept.hessian, &slope);
            (direction.gain <= PROGRESS * kept.gain).then_some((kept, direction))
        });
        let (here, direction) = match reused {
            Some(reused) => reused,
            None => {
                let hessian = hessian(&at, &mut gradient)?;
                let direction = Direction::of(&hessian, &slope);
                let (from, gain) = (at.clone(), direction.gain);
                (
                    Kept {
                        from,
                        hessian,
                        gain,
                    },
                    direction,
                )
            }
        };
        if direction.gain < SMALLEST_GAIN {
            match direction.upwards {
                None => return finished(at, &mut gradient),
                Some(upwards) => {
                    at.iter_mut()
                        .zip(&upwards)
                        .for_each(|(x, d)| *x += AWAY * d);
                    (value, slope) = gradient(&at)?;
                    continue;
                }
            }
        }
        if direction.upwards.is_none() {
            kept = Some(Kept {
                gain: direction.gain,
                ..here
            });
        }
        let longest = direction.step.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut share = (LONGEST_STEP / longest).min(1.0);
        let slack = 1e-13 * value.abs();
        loop {
            let steps = at.iter().zip(&direction.step);
            let next: Vec<f64> = steps.map(|(x, d)| x + share * d).collect();
            if let Some(found) = gradient(&next).filter(|found| found.0 >= value - slack) {
                (at, (value, slope)) = (next, found);
                break;
            }
            share *= 0.5;
            if share < 1e-10 {
                let is_there = direction.upwards.is_none() && direction.gain < LOST_GAIN;
                return is_there.then(|| finished(at, &mut gradient)).flatten();
            }
        }
    }
    None
}

/// A negative definite Hessian, where it was taken, and the gain that the last step with it predicted.
struct Kept {
    from: Vec<f64>,
    hessian: SymmetricMatrix,
    gain: f64,
}

/// A step, the gain of it that a parabola predicts, and the direction in which the value curves
/// upwards most, if it does in any.
struct Direction {
    step: Vec<f64>,
    gain: f64,
    upwards: Option<Vec<f64>>,
}

impl Direction {
    fn of(hessian: &SymmetricMatrix, slope: &[f64]) -> Self {
        let n = slope.len();
        let eigen = SymmetricEigen::new(Matrix::from_fn(n, n, |i, j| hessian.get(i, j)));
        let floor = FLAT * eigen.largest();
        let (mut step, mut gain) = (vec![0.0; n], 0.0);
        let (mut most, mut upwards) = (floor, None);
        for (k, &value) in eigen.values.iter().enumerate() {
            let vector = eigen.vectors.row(k);
            let (along, size) = (dot(vector, slope), value.abs().max(floor));
            gain += 0.5 * along * along / size;
            for (s, v) in step.iter_mut().zip(vector) {
                *s += v * along / size;
            }
            if value > most {
                (most, upwards) = (value, Some(vector.to_vec()));
            }
        }
        Self {
            step,
            gain,
            upwards,
        }
    }
}

/// A last step of Newton's method, which squares the remaining error, with the Hessian of the maximum.
fn finished(at: Vec<f64>, gradient: &mut Gradient<'_>) -> Option<Maximum> {
    let information = hessian(&at, gradient)?.negated();
    let (_, slope) = gradient(&at)?;
    let step = Cholesky::definite(&information)?.solve(&slope);
    let at: Vec<f64> = at.iter().zip(step).map(|(x, d)| x + d).collect();
    Some(Maximum {
        value: gradient(&at)?.0,
        at,
        information,
    })
}

/// The Hessian by central differences of the gradient.
fn hessian(at: &[f64], gradient: &mut Gradient<'_>) -> Option<SymmetricMatrix> {
    let mut hessian = SymmetricMatrix::zero(at.len());
    let mut moved = at.to_vec();
    for i in 0..at.len() {
        let mut side = |by: f64| {
            moved[i] = at[i] + by;
            gradient(&moved)
        };
        let (_, above) = side(STEP)?;
        let (_, below) = side(-STEP)?;
        moved[i] = at[i];
        for (j, (above, below)) in above.iter().zip(&below).enumerate() {
            // Each element off the diagonal is added twice.
            let share = if i == j { 1.0 } else { 0.5 };
            hessian.add(i, j, share * (above - below) / (2.0 * STEP));
        }
    }
    Some(hessian)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// −(x² − 1)²/4 − (y − x)²/2: maxima at (1, 1) and (−1, −1), a saddle between them.
    #[test]
    fn a_saddle_is_left() {
        let f = |at: &[f64]| {
            let (x, y) = (at[0], at[1]);
            let value = -0.25 * (x * x - 1.0).powi(2) - 0.5 * (y - x).powi(2);
            Some((value, vec![-x * (x * x - 1.0) + (y - x), x - y]))
        };
        for start in [[0.0, 0.0], [1e-7, 0.0], [0.05, -0.3], [3.0, -2.0]] {
            let found = maximum(start.to_vec(), f).unwrap();
            assert!((found.at[0].abs() - 1.0).abs() < 1e-6, "{:?}", found.at);
            assert!(found.value.abs() < 1e-12);
            assert!((found.information.get(0, 0) - 3.0).abs() < 1e-4);
        }
    }

    #[test]
    fn what_has_no_maximum_gives_none() {
        let rising = |at: &[f64]| Some((at[0].exp(), vec![at[0].exp()]));
        assert!(maximum(vec![0.0], rising).is_none());
    }
}
