//! Whether the force stays at the end of the sensor's range.

use super::range;

/// So many samples in a row at the highest or lowest value are saturation; a smooth peak has
/// fewer that are equal.
const FLAT_RUN: usize = 5;
/// Samples of the means in which a plateau under noise is looked for.
const SMOOTH: usize = 9;
/// Fewest samples of a plateau under noise, and fewest plateaus.
const LEAST_RUN: usize = 25;
const LEAST_RUNS: usize = 3;
/// A plateau is within so many standard deviations of the noise below the highest mean …
const WITHIN: f64 = 2.5;
/// … and a quarter of its length before and behind it the force is so many below: five times as far as a
/// rounded peak of the same length.
const STEEP: f64 = 28.0;

/// The number of samples in runs at the highest or lowest value, and that value. Spikes
/// are no part of the range.
pub(super) fn exact(values: &[f64], spikes: &[usize]) -> Option<(usize, f64)> {
    let mut usual = values.to_vec();
    for at in spikes {
        usual[*at] = f64::NAN;
    }
    let [low, high] = range(&usual);
    let tolerance = 1e-9 * (high - low);
    [high, low].into_iter().find_map(|end| {
        let (mut run, mut count) = (0, 0);
        for value in values.iter().chain([&f64::NAN]) {
            if (value - end).abs() <= tolerance {
                run += 1;
            } else {
                count += if run >= FLAT_RUN { run } else { 0 };
                run = 0;
            }
        }
        (count > 0).then_some((count, end))
    })
}

/// A plateau under noise at the highest or lowest force: samples, runs, and the force.
pub(super) fn noisy(values: &[f64]) -> Option<(usize, usize, f64)> {
    if values.len() < 4 * LEAST_RUN {
        return None;
    }
    let mut differences: Vec<f64> = (values.windows(4))
        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs())
        .collect();
    let middle = differences.len() / 2;
    let median = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
    // third differences of white noise have √20 times its deviation, whose median size is 0.6745
    let noise = median / (20.0_f64.sqrt() * 0.6745);
    // false for forces without noise
    let noisy = noise > 0.0;
    if !noisy {
        return None;
    }
    let means: Vec<f64> = (values.windows(SMOOTH))
        .map(|w| w.iter().sum::<f64>() / SMOOTH as f64)
        .collect();
    [1.0, -1.0].into_iter().find_map(|sign| {
        let top = means
            .iter()
            .map(|m| sign * m)
            .fold(f64::NEG_INFINITY, f64::max);
        let below = |i: usize| top - sign * means[i];
        let (mut begin, mut count, mut runs, mut sum) = (None, 0, 0, 0.0);
        for i in 0..=means.len() {
            if i < means.len() && below(i) < WITHIN * noise {
                begin.get_or_insert(i);
                continue;
            }
            let Some(first) = begin.take() else { continue };
            let length = i - first;
            let away = length / 4;
            let inside = first >= away && i + away < means.len();
            if length >= LEAST_RUN
                && inside
                && below(first - away) > STEEP * noise
                && below(i + away) > STEEP * noise
            {
                count += length;
                runs += 1;
                sum += means[first..i].iter().sum::<f64>();
            }
        }
        (runs >= LEAST_RUNS).then(|| (count, runs, sum / count as f64))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::rng::Stream;

    /// A spring of ±`peak` N under noise, limited to 4 N before the noise.
    fn force(peak: f64, noise_n: f64) -> Vec<f64> {
        let mut stream = Stream::new(10, &["saturation"]);
        (0..8000)
            .map(|i| (peak * (6.3e-3 * f64::from(i)).sin()).min(4.0) + noise_n * stream.normal())
            .collect()
    }

    #[test]
    fn saturation_under_noise_is_found_and_a_rounded_peak_is_not() {
        for noise_n in [0.005, 0.02, 0.04] {
            let clipped = force(6.0, noise_n);
            assert_eq!(exact(&clipped, &[]), None);
            let (count, runs, force_n) = noisy(&clipped).unwrap();
            assert_eq!(runs, 8, "{noise_n}");
            assert!((2000..2200).contains(&count), "{count}");
            assert!((force_n - 4.0).abs() < 0.01, "{force_n}");
            assert_eq!(noisy(&force(3.9, noise_n)), None);
        }
    }

    #[test]
    fn equal_samples_at_an_end_are_saturation_whatever_a_spike_says() {
        let mut clipped: Vec<f64> = force(9.0, 0.0);
        let (count, force_n) = exact(&clipped, &[]).unwrap();
        assert_eq!(force_n, 4.0);
        assert!(count > 400, "{count}");
        clipped[700] = 1e8;
        assert_eq!(exact(&clipped, &[700]).unwrap().1, 4.0);
        let mut smooth = force(3.0, 0.0);
        assert_eq!(exact(&smooth, &[]), None);
        smooth[700] = -1e9;
        assert_eq!(exact(&smooth, &[700]), None);
    }
}
