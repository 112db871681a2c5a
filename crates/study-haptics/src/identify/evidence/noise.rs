//! The noise of single samples, and means of samples.

use crate::recording::Recording;
use std::borrow::Cow;

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
pub(super) fn averaged<'r>(recordings: &[&'r Recording]) -> Vec<Cow<'r, Recording>> {
    let counts = recordings.iter().filter_map(|r| r.resolution_mm());
    let count_mm = counts.fold(0.0, f64::max);
    let mut averages: Vec<Cow<'r, Recording>> =
        recordings.iter().map(|r| Cow::Borrowed(*r)).collect();
    loop {
        let samples: usize = averages.iter().map(|r| r.len()).sum();
        let slow = || {
            let moved = averages.iter().filter_map(|r| per_sample_mm(r, count_mm));
            moved.fold(0.0, f64::max) < COUNTS_PER_SAMPLE * count_mm
        };
        if samples <= FEW || samples <= ENOUGH && !slow() {
            return averages;
        }
        for average in &mut averages {
            *average = Cow::Owned(pairs_averaged(average));
        }
    }
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
