//! What [`Training`] makes of hat tables: the one with a direction state, and the
//! segmented baseline, which is a hat table of forces alone.

use super::banded::Bound;
use super::hat::{self, Penalty, Table};
use super::method::{Delta, Hat, Method, Segments, State};
use super::resample::Resampled;
use super::{Identified, IdentifyError, Training, Warning, two_sided, vaf};
use crate::model::Provenance;
use study_wire::predict::{Direction, Lookup};

/// δ that are tried, in twentieths of a mm: 0.3 to 1 mm.
const SCAN: [u32; 2] = [6, 20];

/// How much more than the least a shorter δ may leave, in rms. Chosen, with the ridge
/// on m and b, on simulated switches: `docs/estimators.md` says on which.
const HARDLY_MORE: f64 = 1.1;

impl Training<'_> {
    /// All nodes at once, by penalised least squares, with a direction state.
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
            method: Method::Hat(options).to_string(),
            dx_mm: Some(dx_mm),
            ..self.provenance()
        };
        Ok(identified)
    }

    /// The table of the shortest δ that leaves hardly more of this recording than the
    /// one that leaves least: every second of [`SCAN`], then the neighbours of the
    /// least.
    ///
    /// What a recording leaves is flat in δ, and a longer one also takes what is not
    /// hysteresis but the slow reversals of this motion; on others the shorter
    /// predicts better.
    fn scan(
        &self,
        table: impl Fn(f64) -> Result<Identified, IdentifyError>,
    ) -> Result<Identified, IdentifyError> {
        let [first, last] = SCAN;
        let attempt = |twentieths: u32| -> Result<(u32, f64, Identified), IdentifyError> {
            let identified = table(f64::from(twentieths) / 20.0)?;
            let score = vaf::score(&identified.realization, self.recording);
            let left = score.residual_n.hypot(score.bias_n);
            Ok((twentieths, left, identified))
        };
        let least = |tried: &[(u32, f64, Identified)]| {
            let (at, left, _) = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
            Some((*at, *left))
        };
        let mut tried = (first..=last)
            .step_by(2)
            .map(attempt)
            .collect::<Result<Vec<_>, _>>()?;
        let (at, _) = least(&tried).ok_or(IdentifyError::Undetermined)?;
        for neighbour in [at - 1, at + 1] {
            if (first..=last).contains(&neighbour) {
                tried.push(attempt(neighbour)?);
            }
        }
        tried.sort_by_key(|(twentieths, ..)| *twentieths);
        let (at, left) = least(&tried).ok_or(IdentifyError::Undetermined)?;
        let (_, _, mut identified) = tried
            .into_iter()
            .find(|(_, other, _)| *other <= HARDLY_MORE * left)
            .ok_or(IdentifyError::Undetermined)?;
        if SCAN.contains(&at) {
            identified.warnings.push(Warning::DeltaAtEnd {
                delta_mm: f64::from(at) / 20.0,
            });
        }
        Ok(identified)
    }

    /// Force by direction as straight lines between equally spaced nodes over the
    /// range of both directions (a segmented static model, MacLean 1996).
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
            // only carries a line over segments without samples
            ridge_force: 1e-6,
            ridge_dynamics: 0.0,
            dynamics: Bound::Zero,
        };
        let mut identified = self.hat_with(nodes, lookup, Direction::Sign, penalty)?;
        identified.realization.provenance = Provenance {
            method: Method::Segments(options).to_string(),
            ..self.provenance()
        };
        Ok(identified)
    }

    fn hat_with(
        &self,
        nodes: Vec<f64>,
        lookup: Lookup,
        rule: Direction,
        penalty: Penalty,
    ) -> Result<Identified, IdentifyError> {
        let Table {
            positive,
            negative,
            weight,
        } = hat::table(self.recording, &nodes, lookup, rule, penalty)
            .ok_or(IdentifyError::Undetermined)?;
        let thin = |side: usize| {
            let light = |w: &&[f64; 2]| w[side] < two_sided::LEAST_WEIGHT;
            weight.iter().filter(light).count()
        };
        let (of, thin) = (nodes.len(), [thin(0), thin(1)]);
        let branch = |theta| Resampled { theta, empty: 0 };
        let mut identified = self.table(nodes, branch(positive), branch(negative), lookup);
        identified.realization.direction = rule;
        if thin != [0, 0] {
            identified.warnings.push(Warning::Thin {
                positive: thin[0],
                negative: thin[1],
                of,
            });
        }
        Ok(identified)
    }
}
