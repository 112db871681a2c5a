//! The tests of a simulated study: by closed forms where the table is complete, else by
//! the analysis.

use super::draw::{Drawn, Draws};
use super::precision::Precision;
use super::{Cell, Settings, Test, Vaf};
use crate::analyze::psychophysics::PartFinding;
use crate::analyze::results::{Number as _, Permuted};
use crate::analyze::{self, Deciding, Rules};
use std::collections::{BTreeMap, HashMap};
use study_base::rng::Stream;
use study_plan::protocol::Role;
use study_session::outcome::ratings::{Ratings, Realization, Row, Subject};
use study_session::outcome::rows::Status;
use study_stats::clm::{CategoryCount, CategoryCounts, Predictor};
use study_stats::clmm::clmm_crossed;
use study_stats::describe::{is_constant, rounded};
use study_stats::distribution::t_quantile;
use study_stats::friedman::friedman;
use study_stats::level;
use study_stats::lmm::balanced_slope;
use study_stats::paired::{equivalence, equivalence_of};
use study_stats::permutation::Decision;

/// What one study shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outcome {
    /// For each test whether it rejects, or why it is undefined.
    pub(super) tests: Vec<Result<bool, &'static str>>,
    /// Slope per standard deviation of VAF.
    pub(super) slope: Option<f64>,
    /// Half-width of the interval of the slope over realizations, likewise.
    pub(super) half_width: Option<f64>,
    /// Whether the crossed model has no scatter of the realizations about the line.
    pub(super) boundary: bool,
    /// Of tracks with levels, how far the thresholds are from the truth.
    pub(super) precision: Option<Box<Precision>>,
}

impl Outcome {
    /// What the tests of a part say: yes, no, or nothing.
    pub(super) fn of_tests(tests: impl Iterator<Item = Option<bool>>) -> Self {
        Self {
            tests: tests.map(|t| t.ok_or(UNDEFINED)).collect(),
            slope: None,
            half_width: None,
            boundary: false,
            precision: None,
        }
    }
}

/// Whether a participant is lost.
pub(super) fn is_lost(settings: &Settings, draws: &mut Stream) -> bool {
    let dropout = settings.assumptions.dropout;
    dropout > 0.0 && draws.unit() < dropout
}

/// Yes or no, if the answer is defined.
pub(super) fn verdict(finding: Option<&PartFinding>) -> Option<bool> {
    let finding = finding.filter(|f| f.reason().is_none())?;
    Some(finding.is_yes())
}

/// Decides the studies of one cell.
#[derive(Debug)]
pub(super) struct Judge<'a> {
    settings: &'a Settings,
    cell: Cell,
    /// The permutation test, prepared for the VAF that all studies share.
    permutation: Option<Decision>,
    /// Critical t by degrees of freedom, which are whole numbers in closed forms.
    critical: HashMap<u64, f64>,
    /// Cell means of the study.
    means: Vec<f64>,
}

pub(super) const UNDEFINED: &str = "no variation, or too few participants or realizations";
const NOT_FITTED: &str = "the model has no fit";

impl<'a> Judge<'a> {
    pub(super) fn new(settings: &'a Settings, cell: Cell) -> Self {
        let vaf = settings.vaf(cell.realizations);
        Self {
            settings,
            cell,
            permutation: Decision::new(&vaf, settings.alpha),
            critical: HashMap::new(),
            means: Vec::new(),
        }
    }

    /// Decides a study. `draws` starts the stream of its permutations.
    pub(super) fn decide(&mut self, study: &Drawn, draws: &dyn Fn() -> Draws) -> Outcome {
        if study.is_complete() {
            self.complete(study, draws)
        } else {
            self.analyzed(study, draws)
        }
    }

    fn critical(&mut self, df: f64) -> f64 {
        let alpha = self.settings.alpha;
        let compute = || t_quantile(1.0 - alpha / 2.0, df).unwrap_or(f64::INFINITY);
        *self.critical.entry(df.to_bits()).or_insert_with(compute)
    }

    /// A study in which everybody rated everything.
    fn complete(&mut self, study: &Drawn, draws: &dyn Fn() -> Draws) -> Outcome {
        let (q, r) = (self.cell.realizations, self.cell.repetitions);
        let x = &study.x;
        self.means.clear();
        let mut within = 0.0;
        for own in study.ratings.chunks_exact(r) {
            let mean = own.iter().sum::<f64>() / r as f64;
            within += own.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            self.means.push(mean);
        }
        let mut columns = vec![0.0; q];
        for row in self.means.chunks_exact(q) {
            for (sum, mean) in columns.iter_mut().zip(row) {
                *sum += mean / study.participants as f64;
            }
        }
        let line = if study.participants > 0 {
            Line::of(x, &columns)
        } else {
            None
        };
        let critical = self.critical(q as f64 - 2.0);
        let crossed = balanced_slope(&self.means, x, r, within);
        let mut tests = Vec::with_capacity(self.settings.tests.len());
        let settings = self.settings;
        for test in &settings.tests {
            let decided = match test {
                Test::Pearson => line.map(|l| l.slope.abs() > critical * l.se),
                Test::Permutation | Test::Verdict => {
                    let own = (settings.assumptions.vaf == Vaf::Drawn)
                        .then(|| Decision::new(&study.vaf, settings.alpha))
                        .flatten();
                    let shared = self.permutation.as_ref();
                    let decision = own.as_ref().or(shared).filter(|_| line.is_some());
                    decision.and_then(|d| d.rejects(&columns, &mut draws()))
                }
                Test::Crossed => crossed.map(|c| c.estimate.abs() > self.critical(c.df) * c.se),
                Test::Friedman => self.friedman(study),
                Test::Clmm => self.ordinal(study),
                Test::Equivalence => {
                    crossed.and_then(|c| self.is_equivalent(x, c.estimate, c.se, c.df))
                }
                Test::ReferenceEquivalence => self.is_as_the_reference(study),
                Test::Preferred
                | Test::PreferenceVaf
                | Test::Thresholds
                | Test::ToldApart
                | Test::Effect
                | Test::RankedAlike
                | Test::RankedFirst
                | Test::MapFollows
                | Test::Adjusted
                | Test::Identified => None,
            };
            tests.push(decided.ok_or(UNDEFINED));
        }
        Outcome {
            tests,
            slope: line.map(|l| l.slope),
            half_width: line.map(|l| critical * l.se),
            boundary: crossed.is_some_and(|c| c.df > q as f64 - 2.0),
            precision: None,
        }
    }

    /// Whether the change of the rating from the lowest to the highest x lies within the
    /// margin, by the slope on x.
    fn is_equivalent(&self, x: &[f64], slope: f64, se: f64, df: f64) -> Option<bool> {
        let ends = |f: fn(f64, f64) -> f64| x.iter().copied().reduce(f);
        let range = ends(f64::max)? - ends(f64::min)?;
        let tests = equivalence_of(slope * range, se * range, df, self.settings.margin?)?;
        Some(level::rejects(tests.p, self.settings.alpha))
    }

    /// Whether the realization with the highest VAF is equivalent to the hidden reference,
    /// as `reference/*/p_tost` of the analysis.
    fn is_as_the_reference(&self, study: &Drawn) -> Option<bool> {
        let equal: Vec<f64> = study.beside_reference.iter().map(|d| rounded(*d)).collect();
        if is_constant(&equal) {
            return None;
        }
        let tests = equivalence(&study.beside_reference, self.settings.margin?)?;
        Some(level::rejects(tests.p, self.settings.alpha))
    }

    /// A study with missing trials.
    fn analyzed(&mut self, study: &Drawn, draws: &dyn Fn() -> Draws) -> Outcome {
        let ratings = self.ratings(study);
        let rules = Rules {
            alpha: self.settings.alpha,
            seed: draws().0.next_u64(),
            ..Rules::default()
        };
        let Deciding {
            finding,
            corr_adjusted,
            crossed,
        } = analyze::deciding(&ratings, &rules);
        let model = &crossed.coefficients;
        let (slope, slope_se) = (model.slope.number(), model.slope_se.number());
        let alpha = self.settings.alpha;
        let rejects = |p: f64| level::rejects(p, alpha);
        let mut tests = Vec::new();
        for test in &self.settings.tests {
            let pearson = &corr_adjusted.pearson;
            let (decided, why) = match test {
                Test::Verdict => {
                    let found = finding.as_ref().filter(|f| f.reason().is_none());
                    (found.map(analyze::Finding::is_yes), UNDEFINED)
                }
                Test::Pearson => (pearson.p_t.number().map(rejects), UNDEFINED),
                Test::Permutation => {
                    let p = pearson.permuted.as_ref().and_then(Permuted::two_sided);
                    (p.map(|(p, _)| rejects(p)), UNDEFINED)
                }
                Test::Crossed => {
                    let p = model.slope_satterthwaite_p.number();
                    (p.map(rejects), NOT_FITTED)
                }
                Test::Friedman => (self.friedman(study), UNDEFINED),
                Test::Clmm => (self.ordinal(study), NOT_FITTED),
                Test::Equivalence => {
                    let df = model.slope_satterthwaite_df.number();
                    let slope = slope.zip(slope_se).zip(df);
                    let decided =
                        slope.and_then(|((b, se), df)| self.is_equivalent(&study.vaf, b, se, df));
                    (decided, NOT_FITTED)
                }
                Test::ReferenceEquivalence => (self.is_as_the_reference(study), UNDEFINED),
                Test::Preferred
                | Test::PreferenceVaf
                | Test::Thresholds
                | Test::ToldApart
                | Test::Effect
                | Test::RankedAlike
                | Test::RankedFirst
                | Test::MapFollows
                | Test::Adjusted
                | Test::Identified => (None, UNDEFINED),
            };
            tests.push(decided.ok_or(why));
        }
        let critical = self.critical(study.vaf.len() as f64 - 2.0);
        Outcome {
            tests,
            slope: slope.map(|b| b * study.unit),
            half_width: slope_se.map(|se| critical * se * study.unit),
            boundary: crossed.var_model.number() == Some(0.0),
            precision: None,
        }
    }

    /// The study as the analysis reads one.
    fn ratings(&self, study: &Drawn) -> Ratings {
        let (q, r) = (self.cell.realizations, self.cell.repetitions);
        let mut made = Ratings {
            question: "rating".to_owned(),
            ..Ratings::default()
        };
        made.subjects = (0..study.participants)
            .map(|i| Subject {
                id: format!("{i:06}"),
                state: None,
                reason: String::new(),
                site: None,
                group: None,
            })
            .collect();
        made.models = (0..q)
            .map(|j| Realization {
                id: format!("{j:06}"),
                role: Role::Test,
                duplicate_of: None,
                covariates: BTreeMap::new(),
            })
            .collect();
        for (at, rating) in study.ratings.iter().enumerate() {
            let missing = study.missing.get(at) == Some(&true);
            let (subject, model, repetition) = (at / (q * r), at / r % q, at % r);
            made.push(Row {
                subject: subject as u32,
                model: Some(model as u32),
                repetition: repetition as u32 + 1,
                rating: Some(*rating).filter(|_| !missing),
                vaf: study.vaf.get(model).copied(),
                status: if missing { Status::Missing } else { Status::Ok },
                source_row: at as u32 + 1,
                ..Row::default()
            });
        }
        made
    }

    /// Ratings that are not missing: participant, realization, rating.
    fn present<'s>(&self, study: &'s Drawn) -> impl Iterator<Item = (usize, usize, f64)> + 's {
        let (q, r) = (self.cell.realizations, self.cell.repetitions);
        (study.ratings.iter().enumerate())
            .filter(|(at, _)| study.missing.get(*at) != Some(&true))
            .map(move |(at, rating)| (at / (q * r), at / r % q, *rating))
    }

    fn friedman(&self, study: &Drawn) -> Option<bool> {
        let q = self.cell.realizations;
        let mut sums = vec![vec![(0.0, 0.0); q]; study.participants];
        for (i, j, rating) in self.present(study) {
            let (sum, n) = &mut sums[i][j];
            (*sum, *n) = (*sum + rating, *n + 1.0);
        }
        sums.retain(|row| row.iter().all(|(_, n)| *n > 0.0));
        let rows: Vec<Vec<f64>> = (sums.iter())
            .map(|row| row.iter().map(|(sum, n)| sum / n).collect())
            .collect();
        let p = friedman(&rows)?.iman_davenport_p?;
        Some(level::rejects(p, self.settings.alpha))
    }

    fn ordinal(&self, study: &Drawn) -> Option<bool> {
        let mut used: Vec<i64> = self.present(study).map(|(_, _, v)| v as i64).collect();
        if self.present(study).any(|(_, _, v)| v.fract() != 0.0) {
            return None;
        }
        used.sort_unstable();
        used.dedup();
        let of = |(i, j, rating): (usize, usize, f64)| CategoryCount {
            subject: i as u32,
            predictor: j as u32,
            category: used.partition_point(|u| *u < rating as i64) as u32,
            n: 1,
        };
        let counts: Vec<CategoryCount> = self.present(study).map(of).collect();
        let predictors = study
            .x
            .iter()
            .map(|&x| Predictor { column: 0, x })
            .collect();
        let table = CategoryCounts::new(predictors, 1, used.len(), &counts);
        let p = clmm_crossed(&table).ok()?.p?;
        Some(level::rejects(p, self.settings.alpha))
    }
}

/// The line through the means of the realizations.
#[derive(Debug, Clone, Copy)]
struct Line {
    slope: f64,
    se: f64,
}

impl Line {
    /// `None` for fewer than three means or if they do not vary.
    fn of(x: &[f64], y: &[f64]) -> Option<Self> {
        let n = x.len() as f64;
        let mean = y.iter().sum::<f64>() / n;
        let center = x.iter().sum::<f64>() / n;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (x, y) in x.iter().zip(y) {
            xx += (x - center).powi(2);
            xy += (x - center) * (y - mean);
            yy += (y - mean).powi(2);
        }
        let varies = x.len() > 2 && xx > 0.0 && yy > 1e-20 * (1.0 + mean * mean);
        let slope = xy / xx;
        varies.then(|| Self {
            slope,
            se: ((yy - slope * xy).max(0.0) / ((n - 2.0) * xx)).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Assumptions, Scale};
    use super::*;
    use study_base::rng::Stream;
    use study_stats::distribution::t_two_sided;
    use study_stats::power::covariate::Spread;

    fn settings(scale: Scale, vaf: Vaf, alpha: f64) -> Settings {
        Settings {
            assumptions: Assumptions {
                slope: 0.4,
                smallest: None,
                mean: 4.0,
                spread: Spread {
                    subject: 0.6,
                    realization: 0.25,
                    interaction: 0.3,
                    residual: 0.9,
                    slope: 0.1,
                },
                scale,
                vaf,
                dropout: 0.0,
                missing: 0.0,
                reference: 0.0,
            },
            part: None,
            pilot: None,
            listed: vec![0.7672, 0.7851, 0.7904, 0.7798, 0.7425],
            tests: Test::ALL[..4].to_vec(),
            alpha,
            margin: Some(1.5),
            seed: 1,
            studies: 1,
        }
    }

    /// The closed forms of complete tables are the analysis: p to 10⁻⁶, all decisions.
    /// Complete studies that lost participants are among them.
    #[test]
    fn the_closed_forms_decide_as_the_analysis() {
        let (mut yes, mut no, mut on_boundary) = ([0; 4], [0; 4], 0);
        for k in 0..120u32 {
            let scale = if k % 2 == 0 {
                Scale::Continuous
            } else {
                Scale::Rounded(1, 7)
            };
            let vaf = [Vaf::Listed, Vaf::Drawn][k as usize / 2 % 2];
            let mut settings = settings(scale, vaf, [0.05, 0.2][k as usize / 4 % 2]);
            settings.assumptions.dropout = 0.1;
            let cell = Cell {
                realizations: [5, 7, 4][k as usize % 3],
                repetitions: [3, 1][k as usize / 8 % 2],
                participants: 9,
            };
            let mut draws = Draws(Stream::new(u64::from(k), &["test"]));
            let mut study = Drawn::new(&cell, &settings);
            study.draw(&cell, &settings.assumptions, &mut draws);
            let mut judge = Judge::new(&settings, cell);
            let own = || Draws(Stream::new(u64::from(k), &["permutations"]));
            let closed = judge.decide(&study, &own);
            let general = judge.analyzed(&study, &own);
            assert_eq!(closed.tests, general.tests, "{k}");
            for (i, test) in closed.tests.iter().enumerate() {
                yes[i] += u32::from(*test == Ok(true));
                no[i] += u32::from(*test == Ok(false));
            }
            on_boundary += u32::from(closed.boundary);
            assert_eq!(closed.boundary, general.boundary, "{k}");
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{k}: {a}, {b}");
            close(closed.slope.unwrap(), general.slope.unwrap());
            let values = analyze::analyze(&judge.ratings(&study), &Rules::default()).values;
            let line = Line::of(&study.x, &columns(&judge, &study)).unwrap();
            let df = cell.realizations as f64 - 2.0;
            let p = t_two_sided(line.slope / line.se, df).unwrap();
            close(p, values.number("corr_adjusted/pearson/p_t").unwrap());
            let crossed = {
                let within = within(&study, cell.repetitions);
                balanced_slope(&judge.means, &study.x, cell.repetitions, within).unwrap()
            };
            let p = t_two_sided(crossed.estimate / crossed.se, crossed.df).unwrap();
            let of = |what: &str| values.number(&format!("lmm_vaf_crossed/slope_{what}"));
            close(p, of("satterthwaite_p").unwrap());
            close(crossed.df, of("satterthwaite_df").unwrap());
        }
        assert!(yes.iter().chain(&no).all(|n| *n > 10), "{yes:?} {no:?}");
        assert!((10..110).contains(&on_boundary), "{on_boundary}");
    }

    fn columns(judge: &Judge<'_>, study: &Drawn) -> Vec<f64> {
        let q = judge.cell.realizations;
        (0..q)
            .map(|j| judge.means.iter().skip(j).step_by(q).sum::<f64>() / study.participants as f64)
            .collect()
    }

    fn within(study: &Drawn, repetitions: usize) -> f64 {
        let squares = study.ratings.chunks_exact(repetitions).map(|own| {
            let mean = own.iter().sum::<f64>() / repetitions as f64;
            own.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
        });
        squares.sum()
    }

    /// A small design, and the rules of an analysis with the margin of the settings.
    fn equivalence(settings: &Settings) -> (Cell, Rules) {
        let cell = Cell {
            realizations: 5,
            repetitions: 3,
            participants: 12,
        };
        let rules = Rules {
            equivalence_margin: settings.margin,
            ..Rules::default()
        };
        (cell, rules)
    }

    /// Equivalence is that of the analysis, with missing trials and without.
    #[test]
    fn equivalence_is_that_of_the_analysis() {
        let mut settings = settings(Scale::Continuous, Vaf::Listed, 0.05);
        settings.assumptions.slope = 0.0;
        settings.tests = vec![Test::Equivalence];
        let (cell, rules) = equivalence(&settings);
        let (mut yes, mut no) = (0, 0);
        for k in 0..60u32 {
            settings.assumptions.missing = [0.0, 0.1][k as usize % 2];
            let mut draws = Draws(Stream::new(u64::from(k), &["equivalence"]));
            let mut study = Drawn::new(&cell, &settings);
            study.draw(&cell, &settings.assumptions, &mut draws);
            let mut judge = Judge::new(&settings, cell);
            let found = judge.decide(&study, &|| Draws(Stream::new(1, &[])));
            let analysis = analyze::analyze(&judge.ratings(&study), &rules);
            let p = analysis.values.number("equivalence/vaf/p").unwrap();
            assert_eq!(found.tests, [Ok(p <= 0.05)], "{k}: {p}");
            yes += u32::from(p <= 0.05);
            no += u32::from(p > 0.05);
        }
        assert!(yes > 5 && no > 5, "{yes} {no}");
        settings.margin = None;
        let cell_study = Drawn::new(&cell, &settings);
        let mut judge = Judge::new(&settings, cell);
        let found = judge.decide(&cell_study, &|| Draws(Stream::new(1, &[])));
        assert!(found.tests[0].is_err());
    }

    /// Equivalence with the hidden reference is that of the analysis; with missing trials,
    /// too.
    #[test]
    fn equivalence_with_the_reference_is_that_of_the_analysis() {
        let mut settings = settings(Scale::Rounded(1, 7), Vaf::Listed, 0.05);
        settings.tests = vec![Test::ReferenceEquivalence];
        settings.margin = Some(0.6);
        let (cell, rules) = equivalence(&settings);
        let (mut yes, mut no) = (0, 0);
        for k in 0..60u32 {
            settings.assumptions.missing = [0.0, 0.1][k as usize % 2];
            settings.assumptions.reference = [0.0, 0.3][k as usize / 2 % 2];
            let world = &settings.assumptions;
            let mut draws = Draws(Stream::new(u64::from(k), &["reference"]));
            let mut study = Drawn::new(&cell, &settings);
            study.draw(&cell, world, &mut draws);
            let reference = study.compare(&cell, world, &mut draws);
            let mut judge = Judge::new(&settings, cell);
            let found = judge.decide(&study, &|| Draws(Stream::new(1, &[])));
            // The same study as a table: the third realization has the highest VAF.
            let mut csv = "subject,model,role,repetition,rating\n".to_owned();
            for (i, own) in reference.iter().enumerate() {
                for (r, rating) in own.iter().enumerate() {
                    csv += &format!("P{i:02},ref,hidden-reference,{},{rating}\n", r + 1);
                }
                for r in 0..3 {
                    let at = i * 15 + 2 * 3 + r;
                    if study.missing.get(at) != Some(&true) {
                        csv += &format!("P{i:02},best,test,{},{}\n", r + 1, study.ratings[at]);
                    }
                }
            }
            let ratings = Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap();
            let analysis = analyze::analyze(&ratings, &rules);
            let p = analysis.values.number("reference/ref/best/p_tost").unwrap();
            assert_eq!(found.tests, [Ok(p <= 0.05)], "{k}: {p}");
            yes += u32::from(p <= 0.05);
            no += u32::from(p > 0.05);
        }
        assert!(yes > 5 && no > 5, "{yes} {no}");
    }

    /// With missing trials the verdict is that of the whole analysis.
    #[test]
    fn incomplete_studies_are_decided_by_the_analysis() {
        let mut settings = settings(Scale::Rounded(1, 7), Vaf::Listed, 0.05);
        settings.assumptions.missing = 0.3;
        settings.tests = Test::ALL[..7].to_vec();
        let cell = Cell {
            realizations: 5,
            repetitions: 1,
            participants: 8,
        };
        let mut defined = 0;
        for k in 0..20 {
            let mut draws = Draws(Stream::new(k, &["missing"]));
            let mut study = Drawn::new(&cell, &settings);
            study.draw(&cell, &settings.assumptions, &mut draws);
            assert!(!study.is_complete());
            let mut judge = Judge::new(&settings, cell);
            let own = || Draws(Stream::new(k, &["permutations"]));
            let found = judge.decide(&study, &own);
            let analysis = analyze::analyze(&judge.ratings(&study), &Rules::default());
            let verdict = analysis.finding(&analyze::Question::Vaf).unwrap();
            assert_eq!(found.tests[0], Ok(verdict.is_yes()), "{k}");
            defined += found.tests.iter().filter(|t| t.is_ok()).count();
        }
        assert!(defined > 90, "{defined}");
    }
}
