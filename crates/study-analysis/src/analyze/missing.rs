//! Missing ratings: how many there are, where, whether they depend on the realization, on what it is rated and on
//! who rates it, and whether they could turn an answer: `missing/*`.
//!
//! Verdicts take what is missing as missing at random: given the participant and the realization, it does not
//! depend on what the rating would have been. No rating that is there can show that. So the answers are also
//! given with every missing rating moved by one standard deviation, always against the answer: a pattern-mixture
//! model with a shift that is stated (Little 1993, J. Am. Stat. Assoc. 88, 125–134; National Research Council 2010, The
//! Prevention and Treatment of Missing Data in Clinical Trials, ch. 5). A realization of whose ratings a share π is missing
//! then has its mean moved by π times the shift, and the precision that it has.

use super::Rules;
use super::adjusted::Adjusted;
use super::cells::{Cell, Cells};
use super::factorial::{Movable, movable};
use super::record::{EffectName, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_stats::correlation::{p_of_r, pearson};
use study_stats::describe::mean;
use study_stats::level::rejects;
use study_stats::lmm::CellSummary;
use study_stats::paired::holm;
use study_stats::within::{Clustered, Within};

/// Above this share of missing ratings the answers are tried with them moved (Schafer 1999, Stat. Methods Med.
/// Res. 8, 3–15: below it they hardly matter).
const MOST_NEGLECTED: f64 = 0.05;

/// Halvings of the interval in which an answer turns.
const HALVINGS: usize = 10;

statistics! {
    /// Missing ratings of a realization.
    pub struct MissingOf {
        /// its presentations that count
        n: Stat,
        /// those without a rating
        missing: Stat,
        /// `missing`/`n`
        share: Stat,
    }

    /// An answer with missing ratings moved against it; see `missing/sd`. A mean moves by the shift times the share of its ratings that is missing and has the standard error that it has.
    pub struct Moved {
        /// p with missing ratings as expected, by the test that is repeated
        p: Stat,
        /// p with each of them moved by one standard deviation
        p_moved: Stat,
        /// the shift from which on the answer turns, in standard deviations
        turns_at: Stat,
    }

    /// The answers with missing ratings moved, if more than 5 % of them are missing.
    pub struct AllMoved {
        /// "VAF predicts the rating": `corr_adjusted/trend`, or the same in complete tables; yes: means move towards no relation, no: along with it
        vaf: Moved,
        /// "the realizations differ", clustered by participant; yes: means move towards their mean, no: away from it
        differ: Moved,
        /// "the best is better than the second", clustered by participant
        best: Moved,
        /// "the effect of a factor, or an interaction, is there", by the contrasts within participants clustered by participant (`factorial/EFFECT/clustered`), corrected by Holm (1979) over the effects that are tested; yes: means move towards no effect, no: away from it. Absent where the group is a factor
        effects: BTreeMap<EffectName, Moved> as "effect",
    }

    /// Missing ratings of the test realizations, of participants with a rating of one of them. Presentations that were not reached, failed or were declined count; what a rule excludes has a rating and does not.
    pub struct MissingRatings {
        /// presentations that count
        n: Stat,
        /// those without a rating
        missing: Stat,
        /// `missing`/`n`
        share: Stat,
        /// participants with such a presentation
        participants: Stat,
        /// by realization
        realization: BTreeMap<RealizationName, MissingOf>,
        /// F of the differences between realizations in the share that is missing, as in `within_clustered`
        realizations_f: Stat as "realizations_F",
        /// its p, corrected by ε as where ratings are compared
        realizations_p: Stat,
        /// change of the share that is missing with the adjusted mean of the realization, per rating point, as `corr_adjusted/trend`
        level_slope: Stat,
        /// its p
        level_p: Stat,
        /// correlation over participants of the share that they miss with the level of their ratings
        severity_r: Stat,
        /// its p, by t
        severity_p: Stat,
        /// standard deviation of a rating about participant + realization, the shift of a missing one
        sd: Stat,
        /// answers with missing ratings moved
        moved: Option<AllMoved>,
    }
}

/// The presentations of a realization to a participant.
struct Planned {
    subject: usize,
    /// Position of the realization.
    at: usize,
    n: usize,
    missing: usize,
}

impl Planned {
    fn share(&self) -> f64 {
        self.missing as f64 / self.n as f64
    }
}

/// `None` if no rating is missing.
pub(super) fn missing(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    rules: &Rules,
) -> Option<MissingRatings> {
    let planned = planned(cells, &adjusted.models);
    let [n, missing] = totals(&planned);
    if missing == 0 {
        return None;
    }
    let share = missing as f64 / n as f64;
    let incomplete = (planned.chunk_by(|a, b| a.subject == b.subject))
        .filter(|own| own.iter().any(|p| p.missing > 0));
    let realization = (adjusted.models.iter().enumerate()).map(|(at, &m)| {
        let [n, missing] = totals(planned.iter().filter(|p| p.at == at));
        let of = MissingOf {
            n: Stat::count(n),
            missing: Stat::count(missing),
            share: Stat::of(missing as f64 / n as f64),
        };
        (cells.model_name(m).into(), of)
    });
    let (f, p) = between_realizations(&planned, adjusted).unzip();
    let why = "the shares do not vary, or there are too few participants or too many realizations";
    let level = level(&planned, adjusted);
    let no_level = "there are fewer than three realizations, or their means cannot be compared";
    let severity = severity(cells, adjusted, &planned);
    let no_severity = "there are fewer than three participants, or all miss the same share";
    let sd = sd(cells, adjusted);
    let moved = (sd.filter(|_| share > MOST_NEGLECTED)).and_then(|sd| {
        let own = summaries(cells, adjusted);
        let moves = Moves::of(cells, adjusted, &planned, &own, sd, rules)?;
        Some(AllMoved {
            vaf: moves.vaf(cells),
            differ: moves.differ(),
            best: moves.best(),
            effects: moves.effects(cells),
        })
    });
    Some(MissingRatings {
        n: Stat::count(n),
        missing: Stat::count(missing),
        share: Stat::of(share),
        participants: Stat::count(incomplete.count()),
        realization: realization.collect(),
        realizations_f: Stat::or(f, why),
        realizations_p: Stat::or(p.flatten(), why),
        level_slope: Stat::or(level.map(|l| l.0), no_level),
        level_p: Stat::or(level.and_then(|l| l.1), no_level),
        severity_r: Stat::or(severity.map(|s| s.0), no_severity),
        severity_p: Stat::or(severity.and_then(|s| s.1), no_severity),
        sd: Stat::or(sd, "there are too few ratings"),
        moved,
    })
}

fn totals<'p>(planned: impl IntoIterator<Item = &'p Planned>) -> [usize; 2] {
    let add = |[n, missing]: [usize; 2], p: &Planned| [n + p.n, missing + p.missing];
    planned.into_iter().fold([0, 0], add)
}

/// By participant, then realization.
fn planned(cells: &Cells<'_>, models: &[usize]) -> Vec<Planned> {
    let (ratings, columns) = (cells.ratings, cells.columns(models));
    let mut has_rating = vec![false; ratings.subjects.len()];
    for cell in &cells.cells {
        has_rating[cell.subject] |= columns[cell.model].is_some();
    }
    let place = |i: usize| (ratings.subject[i], ratings.model[i]);
    (cells.all.chunk_by(|&a, &b| place(a) == place(b)))
        .filter_map(|rows| {
            let (subject, model) = place(rows[0]);
            let at = columns[model? as usize]?;
            let missing = rows.iter().filter(|&&i| cells.centered[i].is_none());
            has_rating[subject as usize].then(|| Planned {
                subject: subject as usize,
                at,
                n: rows.len(),
                missing: missing.count(),
            })
        })
        .collect()
}

/// What mixed models need of the share that is missing in each cell.
fn shares(planned: &[Planned]) -> Vec<CellSummary> {
    let one = |p: &Planned| CellSummary {
        subject: p.subject,
        realization: p.at,
        x: 0.0,
        n: 1,
        mean: p.share(),
        within: 0.0,
    };
    planned.iter().map(one).collect()
}

/// The rated cells of the tested realizations.
fn own<'c>(cells: &'c Cells<'_>, models: &'c [usize]) -> impl Iterator<Item = &'c Cell> {
    (cells.cells.iter()).filter(|c| models.binary_search(&c.model).is_ok())
}

fn summaries(cells: &Cells<'_>, adjusted: &Adjusted) -> Vec<CellSummary> {
    own(cells, &adjusted.models)
        .filter_map(Cell::summary)
        .collect()
}

/// F and p of the differences between realizations in the share that is missing.
fn between_realizations(planned: &[Planned], adjusted: &Adjusted) -> Option<(f64, Option<f64>)> {
    let found = Clustered::of(&shares(planned)).ok()?.differences()?;
    let p = match adjusted.design.corrects_by_greenhouse_geisser() {
        true => found.p_gg,
        false => found.p_hf,
    };
    Some((found.f, p))
}

/// Slope and p of the share that is missing on the adjusted mean.
fn level(planned: &[Planned], adjusted: &Adjusted) -> Option<(f64, Option<f64>)> {
    let means = adjusted.means.as_ref().ok()?;
    let within = Within::of(&shares(planned)).ok()?;
    let mean: Vec<Option<f64>> = (within.realizations.iter())
        .map(|at| means.get(*at).copied())
        .collect();
    let trend = within.trend(&mean)?;
    Some((trend.slope, trend.p))
}

/// r and p of the share that a participant misses and the level of their ratings.
fn severity(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    planned: &[Planned],
) -> Option<(f64, Option<f64>)> {
    let levels = levels(cells, adjusted)?;
    let (share, level): (Vec<f64>, Vec<f64>) = (planned.chunk_by(|a, b| a.subject == b.subject))
        .filter_map(|of_one| {
            let [n, missing] = totals(of_one);
            let level = levels.get(&of_one[0].subject)?;
            Some((missing as f64 / n as f64, *level))
        })
        .unzip();
    let r = pearson(&share, &level).filter(|_| share.len() >= 3)?;
    Some((r, p_of_r(r, share.len() as f64 - 2.0)))
}

/// What each participant rates above the means of the realizations.
fn levels(cells: &Cells<'_>, adjusted: &Adjusted) -> Option<BTreeMap<usize, f64>> {
    let means = adjusted.means.as_ref().ok()?;
    let rated: Vec<&Cell> = own(cells, &adjusted.models).collect();
    let one = |of_one: &[&Cell]| {
        let above = of_one.iter().filter_map(|c| {
            let at = adjusted.models.binary_search(&c.model).ok()?;
            Some(c.mean - means[at])
        });
        Some((of_one[0].subject, mean(&above.collect::<Vec<_>>())?))
    };
    (rated.chunk_by(|a, b| a.subject == b.subject))
        .map(one)
        .collect()
}

/// The standard deviation of a rating about participant + realization.
fn sd(cells: &Cells<'_>, adjusted: &Adjusted) -> Option<f64> {
    let (means, levels) = (adjusted.means.as_ref().ok()?, levels(cells, adjusted)?);
    let (mut squares, mut n) = (0.0, 0.0);
    for cell in own(cells, &adjusted.models) {
        let at = adjusted.models.binary_search(&cell.model).ok()?;
        let expected = means[at] + levels.get(&cell.subject)?;
        squares += cell.squares + cell.rows.len() as f64 * (cell.mean - expected).powi(2);
        n += cell.rows.len() as f64;
    }
    let df = n - levels.len() as f64 - (means.len() as f64 - 1.0);
    Some((squares / df).sqrt()).filter(|sd| df >= 1.0 && sd.is_finite() && *sd > 0.0)
}

/// Means that can be moved, and the tests of them.
struct Moves<'a> {
    adjusted: &'a Adjusted,
    rules: &'a Rules,
    means: &'a [f64],
    within: &'a Within,
    clustered: Option<Clustered>,
    /// By how much the mean of each realization moves if its missing ratings do by one standard deviation.
    most: Vec<f64>,
}

impl<'a> Moves<'a> {
    /// `None` if no test compares the realizations.
    fn of(
        cells: &Cells<'_>,
        adjusted: &'a Adjusted,
        planned: &[Planned],
        own: &[CellSummary],
        sd: f64,
        rules: &'a Rules,
    ) -> Option<Self> {
        let within = adjusted.within.as_ref().ok()?;
        let means = adjusted.means.as_ref().ok()?;
        let most = (0..means.len()).map(|at| {
            let of_cells: Vec<f64> = (planned.iter().filter(|p| p.at == at))
                .map(Planned::share)
                .collect();
            mean(&of_cells).unwrap_or(0.0) * sd
        });
        (within.is_connected() && cells.cells.len() > 1).then(|| Self {
            adjusted,
            rules,
            means,
            within,
            clustered: match &adjusted.clustered {
                Some(found) => Some(found.clone()),
                None => Clustered::of(own).ok(),
            },
            most: most.collect(),
        })
    }

    fn is_shown(&self, p: f64) -> bool {
        rejects(p, self.rules.alpha)
    }

    /// An answer, by estimate and p with the means moved by some numbers: `towards` gives for every realization the direction that
    /// weakens what is found, and the most that it may move.
    fn answer(
        &self,
        towards: &[(f64, f64)],
        test: impl Fn(&[f64]) -> Option<(f64, f64)>,
        why: &'static str,
    ) -> Moved {
        let Some((estimate, p)) = test(&vec![0.0; self.means.len()]) else {
            return Moved::undefined(why);
        };
        let shown = self.is_shown(p);
        let at = |shift: f64| {
            let by: Vec<f64> = (towards.iter().zip(&self.most))
                .map(|((direction, limit), most)| match shown {
                    true => direction * (shift * most).min(*limit),
                    false => -direction * shift * most,
                })
                .collect();
            test(&by)
        };
        let turned = |shift: f64| {
            at(shift).is_some_and(|(now, p)| {
                // A clear relation in the other direction is not the same answer.
                self.is_shown(p) != shown || (shown && now * estimate < 0.0)
            })
        };
        let turns_at = turned(1.0).then(|| {
            let halve = |(low, high): (f64, f64), _| {
                let middle = f64::midpoint(low, high);
                if turned(middle) {
                    (low, middle)
                } else {
                    (middle, high)
                }
            };
            (0..HALVINGS).fold((0.0, 1.0), halve).1
        });
        Moved {
            p: Stat::of(p),
            p_moved: Stat::or(at(1.0).map(|(_, p)| p), why),
            turns_at: Stat::or(turns_at, "no shift up to one standard deviation turns it"),
        }
    }

    fn vaf(&self, cells: &Cells<'_>) -> Moved {
        let vaf: Vec<Option<f64>> = (self.adjusted.models.iter())
            .map(|&m| cells.vaf[m])
            .collect();
        let known: Vec<f64> = vaf.iter().copied().flatten().collect();
        let middle = mean(&known).unwrap_or(0.0);
        let slope = self.within.trend(&vaf).map_or(0.0, |t| t.slope);
        let towards: Vec<(f64, f64)> = (vaf.iter())
            .map(|x| (-slope * (x.unwrap_or(middle) - middle), f64::INFINITY))
            .map(|(direction, limit)| (sign(direction), limit))
            .collect();
        let test = |by: &[f64]| {
            let trend = self.within.moved(by).trend(&vaf)?;
            Some((trend.slope, trend.p?))
        };
        self.answer(&towards, test, "there is no test")
    }

    fn differ(&self) -> Moved {
        let middle = mean(self.means).unwrap_or(0.0);
        let towards: Vec<(f64, f64)> = (self.means.iter())
            .map(|x| (sign(middle - x), (middle - x).abs()))
            .collect();
        let gg = self.adjusted.design.corrects_by_greenhouse_geisser();
        let test = |by: &[f64]| {
            let found = self.clustered.as_ref()?.moved(by).differences()?;
            Some((found.f, if gg { found.p_gg? } else { found.p_hf? }))
        };
        self.answer(&towards, test, "there is no test clustered by participant")
    }

    fn best(&self) -> Moved {
        let mut ranked: Vec<usize> = (0..self.means.len()).collect();
        ranked.small_sort_by(|&a, &b| self.rules.better.best_first(self.means[a], self.means[b]));
        let [first, second, ..] = ranked[..] else {
            return Moved::undefined("there is only one realization");
        };
        let ends = |of_first: f64| {
            let mut all = vec![0.0; self.means.len()];
            (all[first], all[second]) = (of_first, -of_first);
            all
        };
        let weights = ends(1.0);
        let direction = sign(self.means[second] - self.means[first]);
        let towards: Vec<(f64, f64)> = (ends(direction).into_iter())
            .map(|direction| (direction, f64::INFINITY))
            .collect();
        let test = |by: &[f64]| {
            let t = self.clustered.as_ref()?.moved(by).contrast(&weights)?;
            Some((t.estimate, t.p?))
        };
        self.answer(&towards, test, "there is no test clustered by participant")
    }
}

impl Moves<'_> {
    /// Each effect of a factorial design that is tested, with the other effects as they are.
    fn effects(&self, cells: &Cells<'_>) -> BTreeMap<EffectName, Moved> {
        let (Some(clustered), Some(crossing)) = (&self.clustered, &self.rules.crossing) else {
            return BTreeMap::new();
        };
        let all = movable(cells, self.adjusted, crossing, clustered);
        let still = vec![0.0; self.means.len()];
        let family: Vec<Option<f64>> = (all.iter())
            .map(|own| own.tested(&still).map(|(_, p)| p))
            .collect();
        let one = |(at, own): (usize, &Movable)| {
            let towards: Vec<(f64, f64)> = (own.share.iter())
                .map(|share| (sign(-share), share.abs()))
                .collect();
            let test = |by: &[f64]| {
                let (t, p) = own.tested(by)?;
                let mut family = family.clone();
                family[at] = Some(p);
                Some((t, holm(&family)[at]?))
            };
            let moved = self.answer(&towards, test, "there is no test clustered by participant");
            (own.name.clone(), moved)
        };
        all.iter().enumerate().map(one).collect()
    }
}

/// 0 of 0.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}
