//! In which order the strokes of a force curve are, and whether its columns are what they are called.
//!
//! A probe needs more force for the press than a passive target gives back on the release, ∮ F dx ≥ 0. Where a file says otherwise,
//! it is the file that is wrong in one of three ways:
//!
//! * there is less force at the bottom than at rest: it has the **wrong sign**;
//! * the columns are **swapped**, because ∮ x dF = −∮ F dx. A tester moves evenly, and the force does not rise evenly: the column that is
//!   called force advances more evenly than the other one, by [`EVENER`]. On 42 measured curves of keyboard switches the displacement did so by a factor of 3.7 to 9.4;
//! * otherwise the rows are in the **reverse order** of time.

use super::ForceCurveFault as Fault;
use crate::recording::range;

/// Bins of displacement in which press and release are compared.
const BINS: usize = 50;
/// A release with more force than the press, by this share of the range of the force in the mean, is no noise: that of 42 measured curves is 0.026 to 0.2 less.
const LEAST_WIDTH: f64 = 0.01;
/// The share of the travel that is its end.
const END: f64 = 0.05;
/// Parts of a stroke of which the advance is compared.
const PARTS: usize = 20;
/// A displacement advances so many times more evenly than a force.
const EVENER: f64 = 2.0;
/// A way from row to row is no stroke beside strokes of so many rows.
const STROKE_ROWS: usize = 10;

/// The first row, every row at which the values turn, and the last one. A way of less than half of the range is no stroke.
pub(super) fn turns(values: &[f64]) -> Vec<usize> {
    let [low, high] = range(values);
    let least = 0.5 * (high - low);
    let (mut turns, mut upwards) = (vec![0], None);
    // the lowest and the highest row since the last turn
    let (mut lowest, mut highest) = (0, 0);
    for (i, value) in values.iter().enumerate() {
        if upwards != Some(false) {
            if *value > values[highest] {
                highest = i;
            }
            if values[highest] - value >= least {
                turns.extend(upwards.map(|_| highest));
                (upwards, lowest) = (Some(false), i);
                continue;
            }
        }
        if upwards != Some(true) {
            if *value < values[lowest] {
                lowest = i;
            }
            if value - values[lowest] >= least {
                turns.extend(upwards.map(|_| lowest));
                (upwards, highest) = (Some(true), i);
            }
        }
    }
    turns.push(values.len() - 1);
    turns
}

/// How the strokes of a curve follow one another.
#[derive(Debug, PartialEq)]
pub(super) enum Order {
    /// A press, a release, and perhaps more of them.
    PressFirst,
    /// From the bottom to rest, and back to the bottom. The last row at rest.
    ReleaseFirst(usize),
}

/// The order of the strokes. A fault comes with its row, if it is not the last one.
pub(super) fn order(x_mm: &[f64], f_n: &[f64]) -> Result<Order, (Option<usize>, Fault)> {
    let turns = turns(x_mm);
    let strokes = || turns.windows(2).map(|turn| (turn[0], turn[1]));
    let is_press = |(from, to): &(usize, usize)| x_mm[*to] > x_mm[*from];
    let (presses, releases): (Vec<_>, Vec<_>) = strokes().partition(is_press);
    for [many, few] in [[&presses, &releases], [&releases, &presses]] {
        let long = many.len() > 1 && many.iter().all(|(from, to)| to - from >= STROKE_ROWS);
        if let Some((from, to)) = few.first().filter(|(from, to)| long && to - from == 1) {
            let [from_mm, to_mm] = [x_mm[*from], x_mm[*to]];
            return Err((Some(*to), Fault::SameWay { from_mm, to_mm }));
        }
    }
    if presses.is_empty() || releases.is_empty() {
        return Err((None, Fault::OneDirection));
    }
    let ends = [strokes().next(), strokes().next_back()];
    if !ends.iter().flatten().map(is_press).eq([false, true]) {
        return Ok(Order::PressFirst);
    }
    // down and up: a release and a press, or a displacement that a press decreases
    let [least_n, most_n] = range(f_n);
    match rises(x_mm, f_n) {
        false => Err((None, Fault::Downwards)),
        true if -least_n > most_n => Err((None, Fault::BothDownwards)),
        true => {
            let lower = |rest: usize, i: usize| if x_mm[i] <= x_mm[rest] { i } else { rest };
            Ok(Order::ReleaseFirst((0..x_mm.len()).fold(0, lower)))
        }
    }
}

/// Whether there is more force at the bottom than at rest. Between the two a click may fall more than it rises.
fn rises(x_mm: &[f64], f_n: &[f64]) -> bool {
    let [low, high] = range(x_mm);
    let near = END * (high - low);
    let mean = |is: &dyn Fn(f64) -> bool| {
        let there = x_mm.iter().zip(f_n).filter(|(x, _)| is(**x));
        let (sum, count) = there.fold((0.0, 0.0), |(sum, n), (_, f)| (sum + f, n + 1.0));
        sum / count
    };
    mean(&|x| high - x <= near) > mean(&|x| x - low <= near)
}

/// Why the release has more force than the press.
///
/// # Errors
/// The likeliest cause.
pub(super) fn passive(x_mm: &[f64], f_n: &[f64]) -> Result<(), Fault> {
    let [low, high] = range(x_mm);
    // sums and counts of the force: of releases and of presses
    let mut sums = [[(0.0, 0.0); BINS]; 2];
    for turn in turns(x_mm).windows(2) {
        let side = usize::from(x_mm[turn[1]] > x_mm[turn[0]]);
        for i in turn[0]..=turn[1] {
            let bin = ((x_mm[i] - low) / (high - low) * BINS as f64) as usize;
            let (sum, count) = &mut sums[side][bin.min(BINS - 1)];
            *sum += f_n[i];
            *count += 1.0;
        }
    }
    let mean = |(sum, count): (f64, f64)| (count > 0.0).then(|| sum / count);
    let both: Vec<(usize, f64, f64)> = (0..BINS)
        .filter_map(|bin| Some((bin, mean(sums[1][bin])?, mean(sums[0][bin])?)))
        .collect();
    let width = both.iter().map(|(_, press, release)| press - release);
    let width_n = width.sum::<f64>() / both.len() as f64;
    let [least_n, most_n] = range(f_n);
    let worst = (both.iter()).min_by(|a, b| (a.1 - a.2).total_cmp(&(b.1 - b.2)));
    let Some((bin, press_n, release_n)) =
        worst.filter(|_| width_n < -LEAST_WIDTH * (most_n - least_n))
    else {
        return Ok(());
    };
    Err(if !rises(x_mm, f_n) {
        Fault::Sign
    } else if unevenness(x_mm) > EVENER * unevenness(f_n) {
        Fault::Swapped
    } else {
        Fault::TurnedAround {
            at_mm: low + (high - low) * (*bin as f64 + 0.5) / BINS as f64,
            press_n: *press_n,
            release_n: *release_n,
        }
    })
}

/// The standard deviation of the advance in equal parts of the strokes, in mean advances.
fn unevenness(values: &[f64]) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for turn in turns(values).windows(2) {
        let (from, rows) = (turn[0], turn[1] - turn[0]);
        let whole = values[turn[1]] - values[from];
        let parts = PARTS.min(rows);
        for part in 0..parts {
            let at = |part: usize| values[from + part * rows / parts];
            let advance = (at(part + 1) - at(part)) * parts as f64 / whole;
            squares += (advance - 1.0).powi(2);
            count += 1.0;
        }
    }
    f64::sqrt(squares / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_ways_back_are_no_turns() {
        let values = [0.0, 3.0, 2.0, 9.0, 8.0, 10.0, 4.0, 6.0, 0.0, 1.0];
        assert_eq!(turns(&values), [0, 5, 9]);
        assert_eq!(turns(&[4.0, 0.0, 4.0]), [0, 1, 2]);
        assert_eq!(turns(&[0.0, 1.0, 2.0]), [0, 2]);
    }

    /// A press and a release in 100 rows each, and the same with a stop.
    #[test]
    fn a_constant_speed_is_even_and_a_bottom_is_not() {
        let there = (0..100).map(f64::from);
        let even: Vec<f64> = there.clone().chain(there.rev()).collect();
        assert!(unevenness(&even) < 0.1, "{}", unevenness(&even));
        let steep: Vec<f64> = even
            .iter()
            .map(|x| x + 20.0 * (x - 90.0).max(0.0))
            .collect();
        assert!(unevenness(&steep) > 1.5, "{}", unevenness(&steep));
    }
}
