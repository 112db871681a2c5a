//! Amplitude spectra between 0 and 10 Hz, or half the sampling rate.
//!
//! A discrete Fourier transform at the few frequencies of interest, by definition: an
//! FFT would need equidistant samples and compute thousands of other frequencies.
//! Signals are averaged over blocks of 1/200 s, which lowers the amplitude at 10 Hz by
//! 0.4 %; then their mean is subtracted and a Hann window applied. The amplitude is
//! that of a sine: sin(2π f t) N gives 1 N at f.

/// The highest frequency, Hz.
pub(super) const TOP_HZ: f64 = 10.0;
/// Length of the blocks, s; slightly below 1/200, so that rounding of time does not
/// move samples between blocks.
const BLOCK_S: f64 = (1.0 - 1e-6) / 200.0;
/// Largest number of frequencies.
const MOST: usize = 1000;

/// Frequencies in Hz and the amplitudes of each signal, in the signal's unit. `t_s`
/// must ascend.
pub(super) fn amplitudes<const N: usize>(
    t_s: &[f64],
    signals: [&[f64]; N],
) -> Vec<(f64, [f64; N])> {
    let blocks = blocks(t_s, signals);
    let (Some(first), Some(last)) = (blocks.first(), blocks.last()) else {
        return Vec::new();
    };
    let (start, span) = (first.0, last.0 - first.0);
    if span <= 0.0 {
        return Vec::new();
    }
    let window = |t: f64| 0.5 - 0.5 * (std::f64::consts::TAU * (t - start) / span).cos();
    let weight: f64 = blocks.iter().map(|(t, _)| window(*t)).sum();
    // Weighted by the window, so that the amplitude at 0 Hz is 0.
    let means: [f64; N] = std::array::from_fn(|k| {
        let weighted = blocks.iter().map(|(t, y)| window(*t) * y[k]);
        weighted.sum::<f64>() / weight
    });
    let gain = 0.5 * weight;
    // Half the frequency resolution, so that no peak is missed.
    let step = (0.5 / span).max(TOP_HZ / MOST as f64);
    let half_the_rate = 0.5 * (blocks.len() - 1) as f64 / span;
    let count = (TOP_HZ.min(half_the_rate) / step) as usize;
    (0..=count)
        .map(|i| {
            let hz = i as f64 * step;
            let mut sums = [(0.0, 0.0); N];
            for (t, y) in &blocks {
                let (sin, cos) = (std::f64::consts::TAU * hz * (t - start)).sin_cos();
                let w = window(*t);
                for k in 0..N {
                    let y = w * (y[k] - means[k]);
                    sums[k].0 += y * cos;
                    sums[k].1 += y * sin;
                }
            }
            (hz, sums.map(|(re, im)| re.hypot(im) / gain))
        })
        .collect()
}

/// Means over blocks of time.
fn blocks<const N: usize>(t_s: &[f64], signals: [&[f64]; N]) -> Vec<(f64, [f64; N])> {
    let mut blocks = Vec::new();
    let mut from = 0;
    while from < t_s.len() {
        let to = from + t_s[from..].partition_point(|t| t - t_s[from] < BLOCK_S);
        // A block contains at least its first sample.
        let to = to.max(from + 1);
        let mean = |y: &[f64]| y[from..to].iter().sum::<f64>() / (to - from) as f64;
        blocks.push((mean(t_s), std::array::from_fn(|k| mean(signals[k]))));
        from = to;
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_amplitude_at_its_frequency_and_nothing_elsewhere() {
        let t: Vec<f64> = (0..20_000).map(|i| f64::from(i) * 0.001).collect();
        let w = std::f64::consts::TAU;
        let y: Vec<f64> = t
            .iter()
            .map(|t| 5.0 + 3.0 * (w * 1.5 * t).sin() + 0.5 * (w * 7.3 * t).cos())
            .collect();
        let found = amplitudes(&t, [&y]);
        let near = |hz: f64| {
            let nearest = found
                .iter()
                .min_by(|a, b| (a.0 - hz).abs().total_cmp(&(b.0 - hz).abs()));
            nearest.unwrap().1[0]
        };
        assert!((near(1.5) - 3.0).abs() < 0.01, "{}", near(1.5));
        assert!((near(7.3) - 0.5).abs() < 0.01, "{}", near(7.3));
        for quiet in [0.0, 0.8, 4.0, 6.8, 10.0] {
            assert!(near(quiet) < 0.005, "{quiet} {}", near(quiet));
        }
        assert!(found.last().unwrap().0 <= TOP_HZ);
    }

    /// Ten samples a second of 1 Hz: what lies above 5 Hz would be its mirror image.
    #[test]
    fn a_spectrum_ends_at_half_the_sampling_rate() {
        let t: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.1).collect();
        let y: Vec<f64> = t
            .iter()
            .map(|t| (std::f64::consts::TAU * t).sin())
            .collect();
        let found = amplitudes(&t, [&y]);
        let last = found.last().unwrap().0;
        assert!((4.9..=5.0).contains(&last), "{last}");
        let above = found.iter().filter(|(hz, _)| *hz > 1.5).map(|(_, n)| n[0]);
        assert!(above.fold(0.0, f64::max) < 0.01);
    }

    #[test]
    fn nothing_recorded_has_no_spectrum() {
        assert!(amplitudes(&[0.0], [&[1.0]]).is_empty());
        assert!(amplitudes::<1>(&[], [&[]]).is_empty());
    }
}
