//! Drift of the force: a change over time at the same positions.

use super::{Warning, range};

/// Bins of the position, for each direction.
const BINS: usize = 50;
/// A drift is larger than this share of the range of the force.
const LEAST_SHARE: f64 = 0.05;
/// The bins' drifts agree if their mean is so many standard errors away from 0.
const LEAST_RATIO: f64 = 8.0;
/// In both directions it is the same, within this factor.
const ALIKE: f64 = 2.0;
/// The times within bins have at least this share of the variance of all times: a single loop
/// comes to each position once and says nothing of a drift.
const REVISITED: f64 = 0.3;

/// The regression of F on t within bins of x, separately by direction of travel.
pub(super) fn warning(t: &[f64], x: &[f64], v: &[f64], f: &[f64]) -> Option<Warning> {
    let [low, high] = range(x);
    let bin = |i: usize| {
        let at = (BINS as f64 * (x[i] - low) / (high - low)) as usize;
        at.min(BINS - 1) + if v[i] > 0.0 { BINS } else { 0 }
    };
    let moving = || (0..t.len()).filter(|i| v[*i] != 0.0);
    // count and sums of t and F
    let mut sums = [[0.0; 3]; 2 * BINS];
    for i in moving() {
        for (sum, value) in sums[bin(i)].iter_mut().zip([1.0, t[i], f[i]]) {
            *sum += value;
        }
    }
    // within bins: sums of t² and of t F
    let mut within = [[0.0; 2]; 2 * BINS];
    let (mut count, mut total, mut square) = (0.0, 0.0, 0.0);
    for i in moving() {
        let [n, of_t, of_f] = sums[bin(i)];
        let (dt, df) = (t[i] - of_t / n, f[i] - of_f / n);
        within[bin(i)][0] += dt * dt;
        within[bin(i)][1] += dt * df;
        count += 1.0;
        total += t[i];
        square += t[i] * t[i];
    }
    let revisited: f64 = within.iter().map(|w| w[0]).sum();
    let mean_t = total / count;
    // false for NaN
    let enough = revisited >= REVISITED * (square - count * mean_t * mean_t);
    if !enough {
        return None;
    }
    let slope = |of: &[[f64; 2]]| {
        let [mut tt, mut tf] = [0.0; 2];
        for [one, other] in of {
            tt += one;
            tf += other;
        }
        tf / tt
    };
    let each = [slope(&within[..BINS]), slope(&within[BINS..])];
    let all = slope(&within);
    // the spread of the bins' own slopes, by their information
    let spread: f64 = within.iter().map(|[tt, tf]| (tf - all * tt).powi(2)).sum();
    let error = spread.sqrt() / revisited;
    let duration = t[t.len() - 1] - t[0];
    let by_n = all * duration;
    let alike = each[0] * each[1] > 0.0
        && each[0].abs().max(each[1].abs()) < ALIKE * each[0].abs().min(each[1].abs());
    let [least, most] = range(f);
    let found =
        alike && by_n.abs() > LEAST_SHARE * (most - least) && all.abs() > LEAST_RATIO * error;
    found.then_some(Warning::Drift { by_n })
}
