//! Force by position in both directions: measured, that of the model, and how much repetitions differ.

use super::MAX_POINTS;
use study_haptics::identify::repetition::{BINS, Curve, Loops, WITHIN};
use study_haptics::identify::vaf;
use study_haptics::model::Realization;
use study_haptics::recording::Recording;

/// What lies in a bin of positions where the position increases, or where it decreases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Mean of the measured force, N.
    pub measured_n: f64,
    /// Mean of the force that the model predicts for the same motion, N.
    pub model_n: f64,
    /// Standard deviation of the residuals of single samples, N; `None` between mean curves.
    pub deviation_n: Option<f64>,
    /// rms difference of two repetitions, N, where there are some.
    pub difference_n: Option<f64>,
}

impl Bin {
    /// Measured minus predicted, N.
    pub fn residual_n(&self) -> f64 {
        self.measured_n - self.model_n
    }
}

/// A recording and a model by position.
#[derive(Debug, Clone, PartialEq)]
pub struct ByPosition {
    /// Middles of the bins, mm.
    pub x_mm: Vec<f64>,
    /// The bins of increasing and of decreasing position; `None` where there is no sample.
    pub sides: [Vec<Option<Bin>>; 2],
    /// Single samples, x in mm and F in N; none of a slow press and release, whose curves have no others.
    pub samples: Vec<(f64, f64)>,
    /// Whether it is a slow press and release.
    pub is_press: bool,
}

impl ByPosition {
    /// The force curves among the training recordings, with the model in slow motion, or else `recording`
    /// with the model in its motion. `noise_n` is the standard deviation of what its repetition does not repeat.
    pub fn of(
        realization: &Realization,
        training: &[&Recording],
        recording: &Recording,
        noise_n: Option<f64>,
    ) -> Self {
        Self::of_presses(realization, training)
            .unwrap_or_else(|| Self::of_motion(realization, recording, noise_n))
    }

    fn of_presses(realization: &Realization, recordings: &[&Recording]) -> Option<Self> {
        let loops = Loops::of(recordings)?;
        let (measured, difference) = loops.mean(loops.range_mm)?;
        let model = loops.played(realization, loops.range_mm)?;
        let bin = |side: usize, i: usize| {
            let at = |curve: &Curve| curve.0[side][i];
            Some(Bin {
                measured_n: at(&measured),
                model_n: at(&model),
                deviation_n: None,
                difference_n: difference.as_ref().map(at),
            })
        };
        Some(Self {
            x_mm: Loops::positions(loops.range_mm),
            sides: [0, 1].map(|side| (0..BINS).map(|i| bin(side, i)).collect()),
            samples: Vec::new(),
            is_press: true,
        })
    }

    fn of_motion(realization: &Realization, recording: &Recording, noise_n: Option<f64>) -> Self {
        let [low, high] = recording.range_mm();
        let mut sums = [(); 2].map(|()| vec![Sums::default(); BINS]);
        let mut side = 0;
        for (i, model_n) in vaf::predict(realization, recording).enumerate() {
            let (x, v) = (recording.x_mm[i], recording.v_mm_s[i]);
            side = match v {
                0.0 => side,
                _ => usize::from(v < 0.0),
            };
            let share = (x - low) / (high - low) * BINS as f64;
            // between 0 and the number of bins, which is the last one's upper edge
            let bin = (share as usize).min(BINS - 1);
            sums[side][bin].add(recording.f_n[i], model_n);
        }
        let difference_n = noise_n.map(|noise| std::f64::consts::SQRT_2 * noise);
        let stride = recording.len().div_ceil(MAX_POINTS).max(1);
        let samples = (recording.x_mm.iter().copied()).zip(recording.f_n.iter().copied());
        Self {
            x_mm: Loops::positions([low, high]),
            sides: sums.map(|side| side.iter().map(|s| s.bin(difference_n)).collect()),
            samples: samples.step_by(stride).collect(),
            is_press: false,
        }
    }

    /// The bins of both directions; of a press those on the travel between first touch and stop.
    pub(super) fn inner(&self) -> impl Iterator<Item = &Bin> {
        let [from, to] = match self.is_press {
            true => WITHIN.map(|share| (share * BINS as f64) as usize),
            false => [0, BINS],
        };
        (self.sides.iter()).flat_map(move |side| side[from..to].iter().flatten())
    }

    /// What the directions are called.
    pub(super) fn directions(&self) -> [&'static str; 2] {
        match self.is_press {
            true => ["press", "release"],
            false => ["increasing", "decreasing"],
        }
    }

    /// A number of each bin of a direction.
    pub(super) fn column(&self, side: usize, of: impl Fn(&Bin) -> f64) -> Vec<Option<f64>> {
        let bins = self.sides[side].iter();
        bins.map(|bin| bin.as_ref().map(&of)).collect()
    }
}

/// Sums over the samples of a bin. Residuals are small beside the forces, so their sums are exact enough.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    measured: f64,
    residual: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, measured_n: f64, model_n: f64) {
        let residual_n = measured_n - model_n;
        self.count += 1.0;
        self.measured += measured_n;
        self.residual += residual_n;
        self.squares += residual_n * residual_n;
    }

    fn bin(&self, difference_n: Option<f64>) -> Option<Bin> {
        let (measured_n, residual_n) = (self.measured / self.count, self.residual / self.count);
        let variance = self.squares / self.count - residual_n * residual_n;
        (self.count > 0.0).then(|| Bin {
            measured_n,
            model_n: measured_n - residual_n,
            deviation_n: Some(variance.max(0.0).sqrt()),
            difference_n,
        })
    }
}
