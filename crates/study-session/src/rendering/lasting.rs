//! What lasts: windows over the samples of a playback.

use crate::outcome::Sample;

/// Least share of a window whose values are known.
const KNOWN: f64 = 0.5;

/// The largest size of the mean of a series over a window without missing values and samples.
pub(super) fn largest_mean(
    samples: &[Sample],
    window_s: f64,
    value: impl Fn(usize) -> Option<f64>,
) -> Option<f64> {
    let mut largest: Option<f64> = None;
    let (mut sum, mut from) = (0.0, 0);
    for (i, sample) in samples.iter().enumerate() {
        let Some(here) = value(i) else {
            (sum, from) = (0.0, i + 1);
            continue;
        };
        // Half a window of lost samples.
        if i > from && sample.t_s - samples[i - 1].t_s > 0.5 * window_s {
            (sum, from) = (0.0, i);
        }
        sum += here;
        while from < i && sample.t_s - samples[from + 1].t_s >= window_s {
            sum -= value(from).unwrap_or(0.0);
            from += 1;
        }
        if sample.t_s - samples[from].t_s >= window_s {
            let mean = (sum / (i + 1 - from) as f64).abs();
            largest = Some(largest.map_or(mean, |most| most.max(mean)));
        }
    }
    largest
}

/// The largest mean of a series that is not negative over a window; values may be missing in
/// less than half of it.
pub(super) fn largest_level(
    samples: &[Sample],
    interval_s: f64,
    window_s: f64,
    values: &[Option<f64>],
) -> Option<f64> {
    let all = levels(samples, interval_s, window_s, KNOWN, values);
    all.into_iter().flatten().reduce(f64::max)
}

/// The same of the window that ends at each sample, of which a share of at least `known` has to
/// have values.
pub(super) fn levels(
    samples: &[Sample],
    interval_s: f64,
    window_s: f64,
    known: f64,
    values: &[Option<f64>],
) -> Vec<Option<f64>> {
    let least = (known * window_s / interval_s).max(1.0);
    let (mut sum, mut count, mut from) = (0.0, 0.0, 0);
    let level = |i: usize| {
        if let Some(here) = values[i] {
            (sum, count) = (sum + here, count + 1.0);
        }
        while samples[i].t_s - samples[from].t_s > window_s {
            if let Some(gone) = values[from] {
                (sum, count) = (sum - gone, count - 1.0);
            }
            from += 1;
        }
        let whole = samples[i].t_s - samples[0].t_s >= window_s;
        (whole && count >= least).then(|| f64::max(sum / count, 0.0))
    };
    (0..samples.len()).map(level).collect()
}

/// The mean around each sample, over `half_s` on both sides; `None` where a value is missing or
/// the samples are not complete.
pub(super) fn smoothed(
    samples: &[Sample],
    interval_s: f64,
    half_s: f64,
    values: &[Option<f64>],
) -> Vec<Option<f64>> {
    let half = (half_s / interval_s).round().max(1.0) as usize;
    let mut sums = vec![(0.0, 0usize)];
    for value in values {
        let (sum, count) = sums[sums.len() - 1];
        sums.push((
            sum + value.unwrap_or(0.0),
            count + usize::from(value.is_some()),
        ));
    }
    let mean = |i: usize| {
        let (from, to) = (i.checked_sub(half)?, i + half + 1);
        let ((low, before), (high, upto)) = (sums[from], *sums.get(to)?);
        let span_s = samples[to - 1].t_s - samples[from].t_s;
        let complete = upto - before == to - from && span_s < 2.2 * half as f64 * interval_s;
        complete.then(|| (high - low) / (to - from) as f64)
    };
    (0..values.len()).map(mean).collect()
}

/// The mean of the middle half of the values around each sample, over `half_s` on both sides: it
/// follows a step, and neither a tick nor a vibration. `None` where a value is missing or the
/// samples are not complete.
pub(super) fn middles(
    samples: &[Sample],
    interval_s: f64,
    half_s: f64,
    values: &[Option<f64>],
) -> Vec<Option<f64>> {
    let half = (half_s / interval_s).round().max(1.0) as usize;
    let mut around = Vec::with_capacity(2 * half + 1);
    let mut middle = |i: usize| {
        let (from, to) = (i.checked_sub(half)?, i + half);
        let span_s = samples.get(to)?.t_s - samples[from].t_s;
        around.clear();
        around.extend(values[from..=to].iter().flatten());
        if around.len() <= 2 * half || span_s > 2.2 * half as f64 * interval_s {
            return None;
        }
        around.sort_unstable_by(f64::total_cmp);
        let kept = &around[half.div_ceil(2)..=2 * half - half.div_ceil(2)];
        Some(kept.iter().sum::<f64>() / kept.len() as f64)
    };
    (0..values.len()).map(&mut middle).collect()
}
