//! Tables with a direction state: of a given length δ, or of the one that a scan finds.

use super::method::{Delta, State};
use super::resample::Resampled;
use super::{Cause, Identified, IdentifyError, Theta, Training, Warning, two_sided, vaf};
use study_wire::predict::{Direction, Lookup};

/// Least and greatest δ of the scan, as shares of the travel.
const SCAN: [f64; 2] = [0.01, 0.25];
/// The scan goes on below its least δ down to this share of the travel, while each step reduces
/// the error by more than this share: for a table, whose friction over δ is a stiffness to the
/// device, and for the friction model.
pub(super) const BELOW_TABLE: [f64; 2] = [0.002, 0.1];
pub(super) const BELOW_FRICTION: [f64; 2] = [0.0005, 0.01];
/// Ratio of one δ of the scan to the one before.
const STEP: f64 = std::f64::consts::SQRT_2;
/// Golden sections of the neighborhood of the best, to 1 % of it.
const GOLDEN_STEPS: usize = 10;
/// A direction state that changes over fewer encoder counts follows their noise.
const LEAST_COUNTS: f64 = 20.0;

/// The rms error of the chosen δ over the least one is at most this. Chosen, together
/// with the ridge on m and b, on simulated switches: see `docs/estimators.md`.
pub(super) const TOLERANCE: f64 = 1.1;

impl Training<'_> {
    /// The table with the given direction state, or with the δ that the scan finds.
    pub(super) fn with_state(
        &self,
        (state, below): (State, [f64; 2]),
        table: impl Fn(Direction) -> Result<Identified, IdentifyError>,
    ) -> Result<Identified, IdentifyError> {
        match state {
            State::Sign => table(Direction::Sign),
            State::Play(Delta::Mm(mm)) | State::Dahl(Delta::Mm(mm)) => table(state.with(mm)),
            State::Play(Delta::Scan) | State::Dahl(Delta::Scan) => {
                self.scan(below, |delta_mm| table(state.with(delta_mm)))
            }
        }
    }

    /// The lengths that a table may have, ascending, mm.
    pub(super) fn deltas_mm(&self) -> Vec<f64> {
        let least_mm = self.least_delta_mm(BELOW_TABLE[0]);
        let most_mm = SCAN[1] * (self.range_mm[1] - self.range_mm[0]);
        let steps = ((most_mm / least_mm).ln() / STEP.ln()).round() as i32;
        (0..=steps)
            .map(|i| rounded(least_mm * STEP.powi(i)))
            .collect()
    }

    /// A share of the travel, or what the encoder needs.
    fn least_delta_mm(&self, share: f64) -> f64 {
        let travel_mm = self.range_mm[1] - self.range_mm[0];
        let counts = (self.recordings.iter())
            .filter_map(|r| r.resolution_mm())
            .fold(0.0, f64::max);
        (share * travel_mm)
            .max(LEAST_COUNTS * counts)
            .min(0.5 * SCAN[1] * travel_mm)
    }

    /// The table with the shortest δ whose rms error on the recordings is within
    /// [`TOLERANCE`] of the least. Tried are lengths in a geometric series from 1/100 to
    /// 1/4 of the travel, or below it, down to a share `floor` of it, while the error falls, then golden sections around the best.
    ///
    /// The error is flat in δ, and a longer δ also fits the slow reversals of this
    /// motion, which are not hysteresis; on other motions the shorter δ predicts better.
    fn scan(
        &self,
        [floor, share]: [f64; 2],
        table: impl Fn(f64) -> Result<Identified, IdentifyError>,
    ) -> Result<Identified, IdentifyError> {
        let at_least = |share| self.least_delta_mm(share);
        let least_mm = at_least(SCAN[0]);
        let most_mm = SCAN[1] * (self.range_mm[1] - self.range_mm[0]);
        let attempt = |delta_mm: f64| -> Result<(f64, f64, Identified), IdentifyError> {
            let identified = table(delta_mm)?;
            let (mut square, mut samples) = (0.0, 0.0);
            for recording in &self.recordings {
                let score = vaf::score(&identified.realization, recording);
                let n = recording.len() as f64;
                square += n * (score.residual_n.powi(2) + score.bias_n.powi(2));
                samples += n;
            }
            Ok((delta_mm, (square / samples).sqrt(), identified))
        };
        let steps = ((most_mm / least_mm).ln() / STEP.ln()).round() as i32;
        let series = |i: i32| rounded(least_mm * STEP.powi(i));
        let mut tried = (0..=steps)
            .map(|i| attempt(series(i)))
            .collect::<Result<Vec<_>, _>>()?;
        let least = |tried: &[(f64, f64, Identified)]| {
            (0..tried.len()).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))
        };
        let mut below = -1;
        while least(&tried) == Some(0) && series(below) >= at_least(floor) {
            let next = attempt(series(below))?;
            let falls = next.1 < (1.0 - share) * tried[0].1;
            // one that is much worse ends the neighborhood of the best
            if falls || next.1 > TOLERANCE * tried[0].1 {
                tried.insert(0, next);
            }
            if !falls {
                break;
            }
            below -= 1;
        }
        let rms_n = |tried: &[(f64, f64, Identified)], i: usize| tried.get(i).map(|t| t.1);
        let best = least(&tried).ok_or(IdentifyError::Undetermined)?;
        let ends_mm = [tried[0].0, tried[tried.len() - 1].0];
        // the golden section of the neighborhood of the best, in log δ
        let [mut low, mut high] =
            [best.saturating_sub(1), (best + 1).min(tried.len() - 1)].map(|i| tried[i].0.ln());
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..GOLDEN_STEPS {
            let [left, right] = [high - golden * (high - low), low + golden * (high - low)];
            let mut of = [0.0; 2];
            for (of, at) in of.iter_mut().zip([left, right]) {
                let delta_mm = rounded(at.exp());
                let known = tried.iter().position(|t| t.0 == delta_mm);
                let i = match known {
                    Some(i) => i,
                    None => {
                        tried.push(attempt(delta_mm)?);
                        tried.len() - 1
                    }
                };
                *of = rms_n(&tried, i).unwrap_or(f64::INFINITY);
            }
            if of[0] <= of[1] {
                high = right;
            } else {
                low = left;
            }
        }
        let best = least(&tried).ok_or(IdentifyError::Undetermined)?;
        let (best_mm, least_n) = (tried[best].0, tried[best].1);
        let (_, _, mut identified) = tried
            .into_iter()
            .filter(|(_, rms_n, _)| *rms_n <= TOLERANCE * least_n)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .ok_or(IdentifyError::Undetermined)?;
        if ends_mm.contains(&best_mm) {
            identified
                .warnings
                .push(Warning::DeltaAtEnd { delta_mm: best_mm });
        }
        Ok(identified)
    }

    /// A table with a direction state from the parameters at its nodes and the weight of
    /// the samples behind each.
    pub(super) fn hats(
        &self,
        nodes: Vec<f64>,
        [positive, negative]: [Vec<Theta>; 2],
        weight: &[[f64; 2]],
        rule: Direction,
        lookup: Lookup,
    ) -> Identified {
        let branch = |theta, side: usize| {
            let sparse = |w: &&[f64; 2]| w[side] < two_sided::MIN_WEIGHT;
            Resampled {
                theta,
                filled: weight.iter().filter(sparse).count(),
            }
        };
        let (positive, negative) = (branch(positive, 0), branch(negative, 1));
        let mut identified = self.table(nodes, positive, negative, Cause::FewSamples, lookup);
        identified.realization.direction = rule;
        identified
    }
}

/// A length with two significant digits, as a person would write it.
fn rounded(mm: f64) -> f64 {
    format!("{mm:.1e}").parse().unwrap_or(mm)
}
