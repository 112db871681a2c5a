//! Whether the recorded force had passed a low-pass: what the headers say, and which of two fits
//! predicts the measured force better where it was left out.
//!
//! A fit without a low-pass is made to low-passed forces on both sides, and always has the smaller
//! error on its own. Both are therefore compared on the same force, the one that was measured.

use super::levenberg;
use super::objective::{Compared, Filter};
use super::{CORNER_HZ, CORNERS_HZ, ITERATIONS, STARTED_HZ};
use crate::identify::signal::{SignalError, filter};
use crate::model::Mechanism;
use crate::recording::Recording;
use rayon::prelude::*;

/// Of every recording the second half of each stretch of this length is left out, s.
const STRETCH_S: f64 = 2.0;

/// How it was decided whether the recorded force had passed a low-pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Whether the headers of the recordings say it; otherwise the errors decide.
    pub by_header: bool,
    /// rms error of the measured force where it was left out, N: of the fit through the low-pass
    /// and of the fit without one. Infinite where there was no fit.
    pub rms_n: [f64; 2],
}

/// The recordings, and how much of each is used.
#[derive(Clone, Copy)]
pub(super) struct Part<'p, 'r> {
    pub(super) recordings: &'p [&'r Recording],
    /// Share of each that is used.
    pub(super) share: f64,
    pub(super) top_mm_s: f64,
}

impl<'r> Part<'_, 'r> {
    fn compared(&self, low_pass: Filter, left_out: bool) -> Result<Vec<Compared<'r>>, SignalError> {
        let one = |recording: &'r Recording| {
            let longest_s = self.share * recording.duration_s() + 1e-9;
            let mut compared = Compared::new(recording, low_pass, longest_s)?;
            let (t_s, first_s) = (&recording.t_s, recording.t_s[0]);
            let second_half = |i: usize| ((t_s[i] - first_s) / STRETCH_S).fract() >= 0.5;
            compared.keep(|i| second_half(i) == left_out);
            Ok(compared)
        };
        self.recordings.iter().copied().map(one).collect()
    }

    /// What the headers say, if all say the same: a corner, Hz, or none.
    fn stated(&self) -> Option<Option<f64>> {
        let of = |r: &&Recording| r.filter().and_then(filter::stated_hz);
        let first = of(self.recordings.first()?)?;
        let same = self.recordings.iter().all(|r| of(r) == Some(first));
        same.then_some(first)
    }

    /// The corner with the least error of a mechanism, Hz.
    fn best_corner_hz(&self, mechanism: &Mechanism) -> Option<f64> {
        let view = mechanism.view();
        let tried = CORNERS_HZ.into_iter().filter_map(|hz| {
            // a corner above half the rate is none
            let part = self.compared(Filter::Recorded(hz), false).ok()?;
            let squares = part.iter().map(|c| c.square_of_measured(&view, STARTED_HZ));
            let (square, n) = squares.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
            Some((hz, square / n as f64))
        });
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(best.0)
    }

    /// rms error where the force was left out of a fit with this low-pass, N.
    fn left_out_n(&self, from: &Mechanism, low_pass: Filter) -> Option<f64> {
        let rest = self.compared(low_pass, false).ok()?;
        let iterations = ITERATIONS[0];
        let fit = levenberg::fit(from, &rest, STARTED_HZ, iterations, self.top_mm_s, &|| ())?;
        let out = self.compared(low_pass, true).ok()?;
        let view = fit.mechanism.view();
        let squares = out.iter().map(|c| c.square_of_measured(&view, STARTED_HZ));
        let (square, n) = squares.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        Some((square / n as f64).sqrt()).filter(|rms_n| rms_n.is_finite())
    }

    /// Decides, with a mechanism that was fitted before. `None` if nothing can be fitted.
    pub(super) fn decide(&self, begun: &Mechanism) -> Option<(Filter, Decision)> {
        let stated = self.stated();
        let corner_hz = match stated {
            Some(Some(hz)) => hz,
            _ => self.best_corner_hz(begun)?,
        };
        let filters = [Filter::Recorded(corner_hz), Filter::Both(CORNER_HZ)];
        let left_out: Vec<f64> = (filters.par_iter())
            .map(|low_pass| self.left_out_n(begun, *low_pass).unwrap_or(f64::INFINITY))
            .collect();
        let rms_n = [left_out[0], left_out[1]];
        let through = match stated {
            Some(stated) => stated.is_some(),
            None => rms_n[0] <= rms_n[1],
        };
        let decision = Decision {
            by_header: stated.is_some(),
            rms_n,
        };
        Some((filters[usize::from(!through)], decision))
    }
}
