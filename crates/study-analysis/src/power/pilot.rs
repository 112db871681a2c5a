//! Assumptions from a pilot, with their uncertainty.
//!
//! The crossed model is fitted to the pilot's ratings. A point estimate is not enough: from
//! small pilots of one world the plugged-in power is anything between nothing and
//! certainty. Therefore each simulated study draws its own parameters. Complete, balanced
//! pilot: λ = SS/χ²(ν) for each mean square, components by differences (below 0 becomes 0),
//! slope = estimate + z·√(λₘ/(nRq)). Otherwise: estimates of studies simulated from the fit.
//!
//! Where thresholds are wanted, the crossed ordinal model is fitted, and worlds are drawn from the
//! normal approximation of its likelihood.

use super::draw::standardized;
use super::expected::LOGISTIC_SD;
use super::{Assumptions, Link, Scale};
use crate::analyze::Analysis;
use study_base::rng::Stream;
use study_base::sort::SmallSort as _;
use study_plan::protocol::power::{PowerPlan, PowerSpread};
use study_stats::clm::{CategoryCount, CategoryCounts, ClmError, Predictor};
use study_stats::clmm::{CrossedClmm, CrossedParameters, clmm_crossed};
use study_stats::lmm::{
    CellSummary, Criterion, FixedEffects, LmmData, LmmError, RandomEffects, fit,
};
use study_stats::power::covariate::Spread;
use thiserror::Error;

/// Fewest participants and realizations of a pilot.
const FEWEST: usize = 4;

/// Studies that are simulated from the fit of an unbalanced pilot.
const REFITS: u64 = 400;

/// Why a pilot gives no assumptions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum PilotError {
    /// Too few participants.
    #[error("{0} participants rated the tested realizations, fewer than {FEWEST}")]
    Participants(usize),
    /// Too few realizations.
    #[error("{0} tested realizations have a VAF, fewer than {FEWEST}")]
    Realizations(usize),
    /// All VAF are equal.
    #[error("all VAF are equal")]
    ConstantVaf,
    /// The crossed model has no fit.
    #[error("the crossed mixed model has no fit: {0}")]
    NotFitted(#[from] LmmError),
    /// The ordinal model has no fit.
    #[error("the crossed ordinal model has no fit: {0}")]
    NoOrdinal(#[from] ClmError),
    /// Ratings of no ordered scale.
    #[error("the ratings are not whole numbers, so that there are no thresholds between them")]
    NotWhole,
    /// Too few simulated pilots have a fit.
    #[error("too few studies simulated from the fit have a fit themselves")]
    Unstable,
}

/// One possible world.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Slope per standard deviation of VAF.
    pub slope: f64,
    /// Mean rating.
    pub mean: f64,
    /// Standard deviations.
    pub spread: Spread,
    /// Thresholds of the ordinal model, if that was fitted.
    pub scale: Option<Scale>,
}

impl Parameters {
    pub(super) fn apply(&self, world: &mut Assumptions) {
        world.slope = self.slope;
        world.mean = self.mean;
        if let Some(scale) = &self.scale {
            world.scale = scale.clone();
        }
        world.spread = Spread {
            // A pilot of this model says nothing about it.
            slope: world.spread.slope,
            ..self.spread
        };
    }

    /// As assumptions. Logits have their own residual.
    pub(super) fn stated(&self, logit: bool) -> PowerPlan {
        PowerPlan {
            slope: Some(self.slope),
            mean: Some(self.mean),
            sd: PowerSpread {
                participant: Some(self.spread.subject),
                realization: Some(self.spread.realization),
                interaction: Some(self.spread.interaction),
                residual: (!logit).then_some(self.spread.residual),
                slope: None,
            },
            ..PowerPlan::default()
        }
    }
}

/// Sum of squares and degrees of freedom.
type Square = (f64, u32);

/// What is known from a pilot.
#[derive(Debug, Clone, PartialEq)]
pub struct Pilot {
    /// The point estimates.
    pub estimate: Parameters,
    /// Participants.
    pub participants: usize,
    /// Realizations.
    pub realizations: usize,
    /// Ratings.
    pub ratings: usize,
    /// Complete pilots: mean squares of the residual (if cells repeat), cells, realizations
    /// about the line and participants; and repetitions.
    squares: Option<([Option<Square>; 4], usize)>,
    /// Otherwise: estimates of studies simulated from the fit.
    refits: Vec<Parameters>,
    /// The ordinal model, if thresholds are wanted.
    ordinal: Option<Ordinal>,
}

/// The crossed ordinal model of a pilot.
#[derive(Debug, Clone, PartialEq)]
struct Ordinal {
    fit: CrossedClmm,
    /// The ratings that occur, rising.
    used: Vec<i64>,
    /// The lowest and the highest of the scale.
    ends: (i64, i64),
}

impl Ordinal {
    fn of(rows: &[(&str, usize, f64)], x: &[f64], ends: (i64, i64)) -> Result<Self, PilotError> {
        if rows.iter().any(|r| r.2.fract() != 0.0) {
            return Err(PilotError::NotWhole);
        }
        let mut used: Vec<i64> = rows.iter().map(|r| r.2 as i64).collect();
        used.sort_unstable();
        used.dedup();
        let mut subjects: Vec<&str> = rows.iter().map(|r| r.0).collect();
        subjects.dedup();
        let counts: Vec<CategoryCount> = (rows.iter())
            .map(|(subject, realization, rating)| CategoryCount {
                subject: subjects.partition_point(|s| s < subject) as u32,
                predictor: *realization as u32,
                category: used.partition_point(|u| *u < *rating as i64) as u32,
                n: 1,
            })
            .collect();
        let predictors = x.iter().map(|&x| Predictor { column: 0, x }).collect();
        let table = CategoryCounts::new(predictors, 1, used.len(), &counts);
        Ok(Self {
            fit: clmm_crossed(&table)?,
            used,
            ends,
        })
    }

    /// A rating that nobody gave has no threshold of its own: it is never drawn.
    fn scale(&self, of_used: &[f64]) -> Scale {
        let (from, to) = self.ends;
        let between = |below: i64| match self.used.partition_point(|u| *u <= below) {
            0 => f64::NEG_INFINITY,
            n => of_used.get(n - 1).copied().unwrap_or(f64::INFINITY),
        };
        Scale::Ordinal {
            link: Link::Logit,
            thresholds: (from..to).map(between).collect(),
            from,
        }
    }

    fn parameters(&self, of: &CrossedParameters) -> Parameters {
        Parameters {
            slope: of.beta,
            mean: 0.0,
            spread: Spread {
                subject: of.sd_subject,
                realization: of.sd_realization,
                // The model has none.
                interaction: 0.0,
                residual: LOGISTIC_SD,
                slope: 0.0,
            },
            scale: Some(self.scale(&of.thresholds)),
        }
    }

    fn estimate(&self) -> Parameters {
        self.parameters(&self.fit.estimate())
    }

    /// A world of the normal approximation, drawn again if its thresholds do not rise.
    fn draw(&self, noise: &mut Stream) -> Parameters {
        const TRIES: usize = 100;
        let mut found = (0..TRIES).filter_map(|_| self.fit.drawn(|| noise.normal()));
        match found.next() {
            Some(found) => self.parameters(&found),
            None => self.estimate(),
        }
    }
}

impl Pilot {
    /// From the ratings that an analysis includes.
    ///
    /// # Errors
    /// If they are too few, or the crossed model has no fit. With the ends of the scale it is
    /// the ordinal model, in logits, else the linear one, in rating points.
    pub fn of(
        analysis: &Analysis,
        seed: u64,
        ordinal: Option<(i64, i64)>,
    ) -> Result<Self, PilotError> {
        let realizations: Vec<(&str, f64)> = (analysis.tested())
            .filter_map(|m| Some((m.id.as_str(), m.vaf?)))
            .collect();
        let q = realizations.len();
        let mut rows: Vec<(&str, usize, f64)> = Vec::new();
        for row in analysis.rows.iter().filter(|r| r.excluded.is_none()) {
            let name = analysis.model(row);
            let found = realizations.iter().position(|(id, _)| *id == name);
            if let (Some(j), Some(rating)) = (found, row.rating) {
                rows.push((analysis.subject(row), j, rating));
            }
        }
        rows.small_sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)));
        let (x, sd) = standardized(&realizations.iter().map(|r| r.1).collect::<Vec<_>>());
        let mut cells: Vec<CellSummary> = Vec::new();
        for (subject, own) in rows.chunk_by(|a, b| a.0 == b.0).enumerate() {
            for cell in own.chunk_by(|a, b| a.1 == b.1) {
                let ratings: Vec<f64> = cell.iter().map(|r| r.2).collect();
                cells.push(summary(subject, cell[0].1, x[cell[0].1], &ratings));
            }
        }
        let n = cells.last().map_or(0, |c| c.subject + 1);
        if q < FEWEST {
            return Err(PilotError::Realizations(q));
        }
        if n < FEWEST {
            return Err(PilotError::Participants(n));
        }
        if sd == 0.0 {
            return Err(PilotError::ConstantVaf);
        }
        if let Some(ends) = ordinal {
            let ordinal = Ordinal::of(&rows, &x, ends)?;
            return Ok(Self {
                estimate: ordinal.estimate(),
                participants: n,
                realizations: q,
                ratings: rows.len(),
                squares: None,
                refits: Vec::new(),
                ordinal: Some(ordinal),
            });
        }
        let estimate = fitted(&cells)?;
        let repetitions = cells[0].n;
        let complete = cells.len() == n * q && cells.iter().all(|c| c.n == repetitions);
        let mut pilot = Self {
            estimate: estimate.clone(),
            participants: n,
            realizations: q,
            ratings: rows.len(),
            squares: complete.then(|| (squares(&cells, &x, n, repetitions), repetitions)),
            refits: Vec::new(),
            ordinal: None,
        };
        if !complete {
            let simulated = (0..REFITS).filter_map(|k| {
                let mut noise = Stream::new(seed, &[super::STREAM, "pilot", &k.to_string()]);
                fitted(&again(&cells, &estimate, &mut noise)).ok()
            });
            pilot.refits = simulated.collect();
            if (pilot.refits.len() as u64) < REFITS / 2 {
                return Err(PilotError::Unstable);
            }
        }
        Ok(pilot)
    }

    /// The world of study k: the same in every cell.
    pub fn parameters(&self, seed: u64, k: u64) -> Parameters {
        let mut noise = Stream::new(seed, &[super::STREAM, "pilot", &k.to_string()]);
        if let Some(ordinal) = &self.ordinal {
            return ordinal.draw(&mut noise);
        }
        let Some((squares, r)) = &self.squares else {
            return self.refits[(k % self.refits.len() as u64) as usize].clone();
        };
        let mut lambda = |square: &Option<Square>| {
            square.map(|(sum, df)| {
                let chi2: f64 = (0..df).map(|_| noise.normal().powi(2)).sum();
                sum / chi2
            })
        };
        let [e, c, m, s] = [0, 1, 2, 3].map(|i| lambda(&squares[i]));
        let (n, q, r) = (
            self.participants as f64,
            self.realizations as f64,
            *r as f64,
        );
        let c = c.unwrap_or(0.0);
        let over = |a: Option<f64>, b: f64, by: f64| ((a.unwrap_or(b) - b) / by).max(0.0).sqrt();
        let of_line = m.unwrap_or(c);
        Parameters {
            slope: self.estimate.slope + noise.normal() * (of_line / (n * r * q)).sqrt(),
            mean: self.estimate.mean,
            spread: Spread {
                subject: over(s, c, q * r),
                realization: over(m, c, n * r),
                // Without repetitions the two cannot be told apart.
                interaction: e.map_or(0.0, |e| over(Some(c), e, r)),
                residual: e.unwrap_or(c).sqrt(),
                slope: 0.0,
            },
            scale: None,
        }
    }

    /// Degrees of freedom on which the scatter of the realizations rests.
    pub fn scatter_df(&self) -> usize {
        self.realizations - 2
    }
}

fn summary(subject: usize, realization: usize, x: f64, ratings: &[f64]) -> CellSummary {
    let mean = ratings.iter().sum::<f64>() / ratings.len() as f64;
    CellSummary {
        subject,
        realization,
        x,
        n: ratings.len(),
        mean,
        within: ratings.iter().map(|r| (r - mean).powi(2)).sum(),
    }
}

/// The crossed model by REML.
fn fitted(cells: &[CellSummary]) -> Result<Parameters, LmmError> {
    let table = LmmData::new(cells, FixedEffects::Covariate { center: 0.0 })?;
    let random = RandomEffects {
        slope: false,
        realization: true,
        cell: cells.iter().any(|c| c.n > 1),
    };
    let found = fit(&table, random, Criterion::Reml)?;
    let v = found.variances;
    Ok(Parameters {
        slope: found.estimate(&[0.0, 1.0]),
        mean: found.estimate(&[1.0, 0.0]),
        spread: Spread {
            subject: v.intercept.max(0.0).sqrt(),
            realization: v.realization.max(0.0).sqrt(),
            interaction: v.cell.max(0.0).sqrt(),
            residual: v.error.max(0.0).sqrt(),
            slope: 0.0,
        },
        scale: None,
    })
}

/// A study with the same cells, drawn from the fit.
fn again(cells: &[CellSummary], world: &Parameters, noise: &mut Stream) -> Vec<CellSummary> {
    let sd = &world.spread;
    let count = |of: fn(&CellSummary) -> usize| cells.iter().map(of).max().map_or(0, |m| m + 1);
    let levels: Vec<f64> = (0..count(|c| c.subject))
        .map(|_| sd.subject * noise.normal())
        .collect();
    let scatter: Vec<f64> = (0..count(|c| c.realization))
        .map(|_| sd.realization * noise.normal())
        .collect();
    let one = |c: &CellSummary| {
        let here = world.mean
            + world.slope * c.x
            + levels[c.subject]
            + scatter[c.realization]
            + sd.interaction * noise.normal();
        let ratings: Vec<f64> = (0..c.n)
            .map(|_| here + sd.residual * noise.normal())
            .collect();
        summary(c.subject, c.realization, c.x, &ratings)
    };
    cells.iter().map(one).collect()
}

/// The mean squares of a complete, balanced table: residual, cells, realizations about the
/// line, participants.
fn squares(cells: &[CellSummary], x: &[f64], n: usize, r: usize) -> [Option<Square>; 4] {
    let q = x.len();
    let (nf, qf, rf) = (n as f64, q as f64, r as f64);
    let mean = |keep: &dyn Fn(&CellSummary) -> bool| {
        let own: Vec<f64> = cells.iter().filter(|c| keep(c)).map(|c| c.mean).collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    let grand = mean(&|_| true);
    let of_subject: Vec<f64> = (0..n).map(|i| mean(&|c| c.subject == i) - grand).collect();
    let of_realization: Vec<f64> = (0..q)
        .map(|j| mean(&|c| c.realization == j) - grand)
        .collect();
    let slope = x
        .iter()
        .zip(&of_realization)
        .map(|(x, m)| x * m)
        .sum::<f64>()
        / qf;
    let about: f64 = (x.iter().zip(&of_realization))
        .map(|(x, m)| (m - slope * x).powi(2))
        .sum();
    let between: f64 = of_subject.iter().map(|u| u * u).sum();
    let rest: f64 = (cells.iter())
        .map(|c| (c.mean - grand - of_subject[c.subject] - of_realization[c.realization]).powi(2))
        .sum();
    let within: f64 = cells.iter().map(|c| c.within).sum();
    [
        (r > 1).then_some((within, (n * q * (r - 1)) as u32)),
        Some((rf * rest, ((n - 1) * (q - 1)) as u32)),
        Some((nf * rf * about, (q - 2) as u32)),
        Some((qf * rf * between, (n - 1) as u32)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::{Rules, analyze};
    use study_session::outcome::ratings::Ratings;

    /// A pilot of `n` participants; with `hole` one rating is missing.
    fn pilot(n: usize, q: usize, hole: bool) -> Result<Pilot, PilotError> {
        let mut noise = Stream::new(3, &["pilot test"]);
        let vaf: Vec<f64> = (0..q).map(|j| 0.7 + 0.03 * j as f64).collect();
        let scatter: Vec<f64> = (0..q).map(|_| 0.5 * noise.normal()).collect();
        let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
        for i in 0..n {
            let level = 0.6 * noise.normal();
            for j in 0..q {
                let here = 4.0 + level + 0.5 * j as f64 + scatter[j] + 0.4 * noise.normal();
                for r in 0..2 {
                    let rating = here + 0.8 * noise.normal();
                    if !(hole && (i, j, r) == (1, 1, 1)) {
                        csv += &format!("P{i:02},m{j},{},{rating},{}\n", r + 1, vaf[j]);
                    }
                }
            }
        }
        let ratings = Ratings::read_csv("pilot.csv", csv.as_bytes(), None).unwrap();
        Pilot::of(&analyze(&ratings, &Rules::default()), 7, None)
    }

    /// The draws of a complete pilot are about its estimates, with the spread that its few
    /// realizations allow; those of an almost complete one are alike.
    #[test]
    fn worlds_are_drawn_about_the_estimates() {
        let of = |hole: bool| {
            let pilot = pilot(8, 6, hole).unwrap();
            assert_eq!(pilot.squares.is_some(), !hole);
            let worlds: Vec<Parameters> = (0..400).map(|k| pilot.parameters(7, k)).collect();
            let mean = |f: fn(&Parameters) -> f64| worlds.iter().map(f).sum::<f64>() / 400.0;
            let slope = mean(|w| w.slope);
            let sd = (worlds
                .iter()
                .map(|w| (w.slope - slope).powi(2))
                .sum::<f64>()
                / 400.0)
                .sqrt();
            (pilot.estimate, slope, sd, mean(|w| w.spread.residual))
        };
        let (complete, hole) = (of(false), of(true));
        for (estimate, slope, sd, residual) in [&complete, &hole] {
            let standard_error = estimate.spread.realization / 6f64.sqrt();
            assert!((slope - estimate.slope).abs() < 0.25 * sd, "{slope}");
            assert!(*sd > 0.8 * standard_error, "{sd}, {standard_error}");
            assert!((residual - estimate.spread.residual).abs() < 0.1);
        }
        assert!((complete.0.slope - hole.0.slope).abs() < 0.1);
        assert!((complete.0.mean - hole.0.mean).abs() < 0.1);
    }

    #[test]
    fn a_small_pilot_is_refused_with_its_number() {
        let refused = |n, q| pilot(n, q, false).unwrap_err();
        assert_eq!(refused(8, 3), PilotError::Realizations(3));
        assert_eq!(refused(3, 6), PilotError::Participants(3));
    }

    /// Thresholds, slope and scatter are drawn about the estimates of the ordinal model, with
    /// their standard errors. Ratings that nobody gave are never drawn.
    #[test]
    fn thresholds_are_drawn_about_the_estimates() {
        let mut noise = Stream::new(5, &["ordinal pilot"]);
        let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
        let scatter: Vec<f64> = (0..8).map(|_| 0.6 * noise.normal()).collect();
        for i in 0..12 {
            let level = 0.8 * noise.normal();
            for (j, scatter) in scatter.iter().enumerate() {
                for r in 1..=2 {
                    let u = noise.unit() + 1e-12;
                    let latent = level + 0.5 * (j as f64 - 3.5) + scatter + (u / (1.0 - u)).ln();
                    // From 2 to 6 of a scale from 1 to 7, without 5.
                    let below = [-2.0, 0.0, 2.0].iter().filter(|t| **t < latent).count();
                    let rating = [2, 3, 4, 6][below];
                    csv += &format!("P{i:02},m{j},{r},{rating},{}\n", 0.7 + 0.03 * j as f64);
                }
            }
        }
        let ratings = Ratings::read_csv("pilot.csv", csv.as_bytes(), None).unwrap();
        let analysis = analyze(&ratings, &Rules::default());
        let pilot = Pilot::of(&analysis, 7, Some((1, 7))).unwrap();
        let thresholds = |p: &Parameters| match &p.scale {
            Some(Scale::Ordinal { thresholds, .. }) => thresholds.clone(),
            other => panic!("{other:?}"),
        };
        let own = thresholds(&pilot.estimate);
        assert_eq!((own[0], own[5]), (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!(own[3], own[4], "5 has no threshold of its own");
        assert!(own[1] < own[2] && own[2] < own[3]);
        // The coefficient is that of the analysis, in standard deviations of VAF.
        let unit = standardized(
            &(0..8)
                .map(|j| 0.7 + 0.03 * f64::from(j))
                .collect::<Vec<_>>(),
        )
        .1;
        let beta = analysis.values.number("clmm_vaf_crossed/beta/vaf").unwrap();
        let se = analysis.values.number("clmm_vaf_crossed/se/vaf").unwrap();
        assert!((pilot.estimate.slope - beta * unit).abs() < 1e-6);
        let worlds: Vec<Parameters> = (0..1000).map(|k| pilot.parameters(7, k)).collect();
        let mean = |f: &dyn Fn(&Parameters) -> f64| worlds.iter().map(f).sum::<f64>() / 1000.0;
        let slope = mean(&|w| w.slope);
        let sd = mean(&|w| (w.slope - slope).powi(2)).sqrt();
        assert!((slope - beta * unit).abs() < 4.0 * sd / 1000f64.sqrt());
        assert!((sd / (se * unit) - 1.0).abs() < 0.1, "{sd} {}", se * unit);
        let second = mean(&|w| thresholds(w)[2]);
        assert!((second - own[2]).abs() < 0.1, "{second} {}", own[2]);
        assert!(worlds.iter().all(|w| thresholds(w).is_sorted()));
        assert_eq!(pilot.parameters(7, 3), pilot.parameters(7, 3));
    }
}
