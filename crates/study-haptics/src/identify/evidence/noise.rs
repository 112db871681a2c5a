//! The noise of single samples, and means of samples.

use crate::recording::Recording;

/// Samples, at most: of more, means of two are taken.
const ENOUGH: usize = 50_000;
/// Slow motion is averaged as long as there are so many samples, at least.
const FEW: usize = 4000;
/// Counts of the encoder from sample to sample: in slower motion its steps are no noise, because samples
/// beside one another have the same error.
const COUNTS_PER_SAMPLE: f64 = 2.0;
/// A difference of the position of so many counts shows the speed.
const COUNTS_OF_SPEED: f64 = 5.0;
/// White noise has at most this ratio of variances over two samples and over one.
const WHITE: f64 = 1.5;

/// Means of consecutive samples, so few and so far apart that noise is independent from sample to sample.
pub(super) fn averaged(recordings: &[&Recording]) -> Vec<Recording> {
    let samples = |of: &[Recording]| of.iter().map(Recording::len).sum::<usize>();
    let counts = recordings.iter().filter_map(|r| r.resolution_mm());
    let count_mm = counts.fold(0.0, f64::max);
    let mut averages: Vec<Recording> = recordings.iter().map(|r| (*r).clone()).collect();
    let slow = |of: &[Recording]| {
        let moved = of.iter().filter_map(|r| per_sample_mm(r, count_mm));
        moved.fold(0.0, f64::max) < COUNTS_PER_SAMPLE * count_mm
    };
    while samples(&averages) > ENOUGH || samples(&averages) > FEW && slow(&averages) {
        averages = averages.iter().map(pairs_averaged).collect();
    }
    averages
}

/// By how much the position changes from sample to sample, rms, mm: from the shortest distance over which
/// it changes by some counts.
fn per_sample_mm(recording: &Recording, count_mm: f64) -> Option<f64> {
    let x = &recording.x_mm;
    (0..usize::BITS)
        .map(|power| 1_usize << power)
        .take_while(|apart| apart * 4 < x.len())
        .find_map(|apart| {
            let squares = x.windows(apart + 1).map(|w| (w[apart] - w[0]).powi(2));
            let rms = (squares.sum::<f64>() / (x.len() - apart) as f64).sqrt();
            (rms >= COUNTS_OF_SPEED * count_mm).then(|| rms / apart as f64)
        })
}

/// The means of every two consecutive samples.
pub(super) fn pairs_averaged(recording: &Recording) -> Recording {
    let means = |column: &[f64]| -> Vec<f64> {
        let pairs = column.chunks_exact(2);
        pairs.map(|pair| 0.5 * (pair[0] + pair[1])).collect()
    };
    Recording {
        t_s: means(&recording.t_s),
        x_mm: means(&recording.x_mm),
        v_mm_s: means(&recording.v_mm_s),
        a_m_s2: means(&recording.a_m_s2),
        f_n: means(&recording.f_n),
        header: Vec::new(),
        warnings: Vec::new(),
        name: recording.name.clone(),
        sha256: String::new(),
    }
}

/// The variance of the noise of a derivative. Where the column is a difference of the position, it
/// follows from the noise of that: `factor` times it over the interval to the power of `order`.
pub(super) fn of_derivative(
    recordings: &[&Recording],
    column: fn(&Recording) -> &[f64],
    difference: fn(&[f64], &[f64], usize) -> f64,
    factor: f64,
    order: i32,
) -> f64 {
    let is_difference = recordings.iter().all(|r| {
        let step = (r.len() / 50).max(1);
        (1..r.len() - 1).step_by(step).all(|i| {
            let (given, derived) = (column(r)[i], difference(&r.t_s, &r.x_mm, i));
            (given - derived).abs() <= 1e-6 * derived.abs() + 1e-9
        })
    });
    if !is_difference {
        return of(recordings, column);
    }
    let seconds: f64 = recordings.iter().map(|r| r.duration_s()).sum();
    let intervals: usize = recordings.iter().map(|r| r.len() - 1).sum();
    let interval_s = seconds / intervals as f64;
    of(recordings, |r| &r.x_mm) * (factor / interval_s.powi(order)).powi(2)
}

/// The standard deviation of the noise of single samples of the force, N. `None` if it is not
/// white, as after a low-pass: noise has the same differences over two samples as over one.
pub(in crate::identify) fn white_noise_n(recordings: &[&Recording]) -> Option<f64> {
    let thinned: Vec<Recording> = (recordings.iter())
        .map(|r| r.select(&(0..r.len()).step_by(2).collect::<Vec<_>>()))
        .collect();
    let single = of(recordings, |r| &r.f_n);
    let double = of(&thinned.iter().collect::<Vec<_>>(), |r| &r.f_n);
    (single > 0.0 && double < WHITE * single).then(|| single.sqrt())
}

/// The variance of the noise of single samples of a column: that of its third differences over
/// 1 + 9 + 9 + 1. The signal hardly contributes where it is sampled several times in its fastest
/// change, and where it is not, its derivatives cannot be trusted either.
pub(super) fn of(recordings: &[&Recording], column: impl Fn(&Recording) -> &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for recording in recordings {
        for w in column(recording).windows(4) {
            let difference = w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0];
            sum += difference * difference;
            count += 1;
        }
    }
    sum / (20.0 * count.max(1) as f64)
}
