//! Methods of [`Training`] that identify hat tables: with a direction state, and the
//! segmented baseline, a hat table of forces alone.

use super::banded::Bound;
use super::hat::{self, HatTable, Penalty};
use super::method::{Delta, Hat, Method, Segments, State};
use super::resample::Resampled;
use super::{Cause, Identified, IdentifyError, Training, Warning, two_sided, vaf};
use crate::model::Provenance;
use study_wire::predict::{Direction, Lookup};

/// First and last δ of the scan, in twentieths of a mm: 0.3 to 1 mm.
const SCAN: [u32; 2] = [6, 20];

/// The rms error of the chosen δ over the least one is at most this. Chosen, together
/// with the ridge on m and b, on simulated switches: see `docs/estimators.md`.
const TOLERANCE: f64 = 1.1;

impl Training<'_> {
    /// All nodes at once, by penalized least squares, with a direction state.
    pub(super) fn hat(
        &self,
        options: Hat,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let penalty = Penalty {
            ridge_force: options.ridge_force,
            ridge_dynamics: options.ridge_dynamics,
            dynamics: if options.bounded {
                Bound::NotNegative
            } else {
                Bound::Free
            },
        };
        let with = |rule| self.hat_with(nodes.clone(), lookup, rule, penalty);
        let mut identified = match options.state {
            State::Sign => with(Direction::Sign)?,
            State::Play(Delta::Mm(mm)) | State::Dahl(Delta::Mm(mm)) => {
                with(options.state.with(mm))?
            }
            State::Play(Delta::Scan) | State::Dahl(Delta::Scan) => {
                self.scan(|delta_mm| with(options.state.with(delta_mm)))?
            }
        };
        identified.realization.provenance = Provenance {
            dx_mm: Some(dx_mm),
            ..self.provenance(Method::Hat(options))
        };
        Ok(identified)
    }

    /// The table with the shortest δ whose rms error on this recording is within
    /// [`TOLERANCE`] of the least. Tried are every second value of [`SCAN`] and then the
    /// neighbours of the best.
    ///
    /// The error is flat in δ, and a longer δ also fits the slow reversals of this
    /// motion, which are not hysteresis; on other motions the shorter δ predicts better.
    fn scan(
        &self,
        table: impl Fn(f64) -> Result<Identified, IdentifyError>,
    ) -> Result<Identified, IdentifyError> {
        let [first, last] = SCAN;
        let attempt = |twentieths: u32| -> Result<(u32, f64, Identified), IdentifyError> {
            let identified = table(f64::from(twentieths) / 20.0)?;
            let score = vaf::score(&identified.realization, self.recording);
            let rms_n = score.residual_n.hypot(score.bias_n);
            Ok((twentieths, rms_n, identified))
        };
        let best = |tried: &[(u32, f64, Identified)]| {
            let (at, rms_n, _) = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
            Some((*at, *rms_n))
        };
        let mut tried = (first..=last)
            .step_by(2)
            .map(attempt)
            .collect::<Result<Vec<_>, _>>()?;
        let (at, _) = best(&tried).ok_or(IdentifyError::Undetermined)?;
        for neighbour in [at - 1, at + 1] {
            if (first..=last).contains(&neighbour) {
                tried.push(attempt(neighbour)?);
            }
        }
        tried.sort_by_key(|(twentieths, ..)| *twentieths);
        let (at, least_n) = best(&tried).ok_or(IdentifyError::Undetermined)?;
        let (_, _, mut identified) = tried
            .into_iter()
            .find(|(_, rms_n, _)| *rms_n <= TOLERANCE * least_n)
            .ok_or(IdentifyError::Undetermined)?;
        if SCAN.contains(&at) {
            identified.warnings.push(Warning::DeltaAtEnd {
                delta_mm: f64::from(at) / 20.0,
            });
        }
        Ok(identified)
    }

    /// Baseline: force by direction, piecewise linear between equally spaced nodes over
    /// the range of both directions (a segmented static model, MacLean 1996).
    pub(super) fn segments(
        &self,
        options: Segments,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let [low, high] = self.range_mm;
        let nodes: Vec<f64> = (0..=options.count)
            .map(|i| low + (high - low) * i as f64 / options.count as f64)
            .collect();
        if nodes.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(IdentifyError::NoOverlap(self.recording.name.clone()));
        }
        let penalty = Penalty {
            // only interpolates over segments without samples
            ridge_force: 1e-6,
            ridge_dynamics: 0.0,
            dynamics: Bound::Zero,
        };
        let mut identified = self.hat_with(nodes, lookup, Direction::Sign, penalty)?;
        identified.realization.provenance = self.provenance(Method::Segments(options));
        Ok(identified)
    }

    fn hat_with(
        &self,
        nodes: Vec<f64>,
        lookup: Lookup,
        rule: Direction,
        penalty: Penalty,
    ) -> Result<Identified, IdentifyError> {
        let HatTable {
            positive,
            negative,
            weight,
        } = hat::table(self.recording, &nodes, lookup, rule, penalty)
            .ok_or(IdentifyError::Undetermined)?;
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
        Ok(identified)
    }
}
