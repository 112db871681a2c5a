//! Factorial designs: `factorial/*`, `factorial_mean/*`, `factorial_contrast/*`. Over the
//! participants who rated every realization ([`complete`]); where these are too few, over all,
//! within participants ([`incomplete`]). The latter can be repeated with means that are moved ([`moved`]).

mod complete;
mod incomplete;
mod moved;

pub(super) use moved::{Movable, movable};

use super::Rules;
use super::adjusted::Adjusted;
use super::cells::Cells;
use super::record::{ContrastName, EffectName, Interval, LevelsName, Stat, Why, statistics};
use complete::Table;
use incomplete::Incomplete;
use std::collections::BTreeMap;
use study_plan::protocol::Crossing;
use study_stats::factorial::{Pair, product};
use study_stats::level::rejects;
use study_stats::paired::{Equivalence, equivalence_of, holm};

statistics! {
    /// An effect in the analysis of variance of the participants' means in each combination of levels: each effect within participants against its own interaction with participants. With groups sums of squares are of type III.
    pub struct FactorialEffect {
        /// sum of squares of the effect
        ss: Stat,
        /// of its error
        ss_error: Stat,
        /// of the effect
        df1: Stat,
        /// of its error
        df2: Stat,
        /// the statistic
        f: Stat as "F",
        /// without correction
        p: Stat,
        /// Greenhouse and Geisser's; 1 with one degree of freedom
        eps_gg: Stat,
        /// with their correction
        p_gg: Stat,
        /// Huynh and Feldt's
        eps_hf: Stat,
        /// with their correction
        p_hf: Stat,
        /// generalized η² (Olejnik & Algina 2003), all factors but the groups manipulated
        ges: Stat,
        /// partial η², SS/(SS + SS of the error)
        pes: Stat,
        /// the p that decides, corrected by Holm (1979) over the effects that are tested; only these have it. It is `p_gg`, or that of `clustered`
        p_holm: Option<Stat>,
        /// of the aligned rank transform (Wobbrock et al. 2011)
        art_f: Stat as "art_F",
        /// of `art_F`, with Greenhouse and Geisser's correction
        art_p: Stat,
        /// decides instead where more than one participant in ten did not rate everything
        clustered: Option<ClusteredEffect>,
    }

    /// An effect within participants, over all who rated two realizations or more: cell mean ~ realization + participant by least squares, with standard errors clustered by participant (CR2, Bell & McCaffrey 2002). The contrasts of the effect are the products of differences of two levels of each of its factors.
    pub struct ClusteredEffect {
        /// of the contrast with the smallest p
        t: Stat,
        /// Satterthwaite's, of `t`
        df: Stat,
        /// contrasts of the effect
        n_contrasts: Stat,
        /// decides: the smallest p of the contrasts times their number
        p: Stat,
        /// the approximate Hotelling T² of all of them (HTZ, Pustejovsky & Tipton 2018), which is too generous with very few degrees of freedom and decides nothing
        htz_f: Stat as "htz_F",
        /// independent contrasts
        htz_df1: Stat,
        /// approximate
        htz_df2: Stat,
        /// of `htz_F`
        htz_p: Stat,
    }

    /// The participants' means at some levels; over all levels of the factors that are not named.
    pub struct FactorialMean {
        /// participants
        n: Stat,
        /// mean over participants; what a mean participant would rate where the effects are tested within participants
        mean: Stat,
        /// standard deviation over participants
        sd: Option<Stat>,
        /// of the mean, by t over participants
        ci95: Option<Interval>,
    }

    /// Whether a difference between two levels is smaller than the `equivalence_margin`, of ratings.
    pub struct ContrastEquivalence {
        /// the larger p of the two one-sided t tests (Schuirmann 1987) that the difference lies within ± the margin
        p_tost: Stat,
        /// the same corrected by Holm (1979), as `p_holm` is
        p_tost_holm: Stat,
        /// lies within the margin where `p_tost` is below .05
        ci90: Interval,
        /// 1 if `p_tost_holm` is significant
        equivalent: Stat,
    }

    /// A difference between two levels of a factor, over all levels of the others or at one level of another (a simple effect), by t over participants.
    pub struct FactorialContrast {
        /// first minus second level
        difference: Stat,
        /// its interval
        difference_ci95: Interval,
        /// the statistic
        t: Stat,
        /// participants less groups; within participants Satterthwaite's
        df: Stat,
        /// two-sided
        p: Stat,
        /// by Holm (1979): over the pairs of levels of a factor; of simple effects over all of one interaction and factor
        p_holm: Stat,
        /// difference over the standard deviation of the participants' differences
        dz: Option<Stat>,
        /// with a margin
        equivalence: Option<ContrastEquivalence> as "",
    }

    /// A factorial design.
    pub struct FactorialTests {
        /// by effect
        effects: BTreeMap<EffectName, FactorialEffect> as "factorial",
        /// by levels
        means: BTreeMap<LevelsName, FactorialMean> as "factorial_mean",
        /// by levels of a factor
        contrasts: BTreeMap<ContrastName, FactorialContrast> as "factorial_contrast",
    }
}

/// Levels of factors: the place of each factor and of its level.
type Levels = Vec<(usize, usize)>;

/// The margin of equivalence and the level of its tests.
#[derive(Debug, Clone, Copy)]
pub(super) struct Margin {
    margin: f64,
    alpha: f64,
}

impl Margin {
    /// That of the ratings, if one was stated.
    pub(super) fn of_ratings(rules: &Rules) -> Option<Self> {
        rules.equivalence_margin.map(|margin| Self {
            margin,
            alpha: rules.alpha,
        })
    }
}

/// The combinations of a design and what belongs to them.
struct Layout<'a> {
    crossing: &'a Crossing,
    margin: Option<Margin>,
    /// The realizations of each combination, the last factor fastest; by their places in the list
    /// that it was made from.
    columns: Vec<Vec<usize>>,
    /// The groups with participants, if the group is a factor.
    groups: Vec<String>,
}

/// A difference between two levels.
struct Compared {
    estimate: f64,
    se: f64,
    ci95: Option<(f64, f64)>,
    t: Option<f64>,
    df: Option<f64>,
    p: Option<f64>,
    /// `None` if there is none of this kind.
    dz: Option<Option<f64>>,
}

/// Tests of the effects of a factorial design; `None` in a study without factors. With a margin, which has to be
/// in the unit of what is compared, levels are also tested for equivalence.
pub(super) fn factorial(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    rules: &Rules,
    margin: Option<Margin>,
) -> Option<FactorialTests> {
    let crossing = rules.crossing.as_ref()?;
    let complete = Table::of(cells, crossing, margin).map(|table| table.tests());
    let mut found = complete.unwrap_or_else(|why| undefined(crossing, &why));
    // With groups a difference between them cannot be told within participants.
    if !adjusted.design.uses_complete() && crossing.groups.is_empty() {
        match Incomplete::of(cells, adjusted, crossing, margin) {
            Ok(incomplete) => incomplete.decide(&mut found),
            Err(why) => found = undefined(crossing, &why),
        }
    }
    Some(found)
}

/// Nothing but the reason, for each effect that is tested.
fn undefined(crossing: &Crossing, why: &Why) -> FactorialTests {
    let effect = |effect: &Vec<usize>| {
        let name = crossing.effect_name(effect);
        let undefined = FactorialEffect {
            p_holm: Some(Stat::missing(why.clone())),
            ..FactorialEffect::undefined(why.clone())
        };
        (name.as_str().into(), undefined)
    };
    FactorialTests {
        effects: crossing.effects.iter().map(effect).collect(),
        means: BTreeMap::new(),
        contrasts: BTreeMap::new(),
    }
}

impl<'a> Layout<'a> {
    /// That of some realizations, by their indices.
    fn of(
        cells: &Cells<'_>,
        crossing: &'a Crossing,
        margin: Option<Margin>,
        models: &[usize],
    ) -> Result<Self, Why> {
        let combinations: usize = crossing.sizes().iter().product();
        let mut columns = vec![Vec::new(); combinations];
        for (j, &model) in models.iter().enumerate() {
            let Some(levels) = crossing.levels_of.get(cells.model_name(model)) else {
                return Err("a realization has no levels of the factors".into());
            };
            columns[crossing.place(levels)].push(j);
        }
        if let Some(empty) = columns.iter().position(Vec::is_empty) {
            let levels = digits(&crossing.sizes(), empty);
            let named: Vec<String> = (crossing.factors.iter().zip(levels))
                .map(|(factor, level)| format!("{} = {}", factor.id, factor.levels[level]))
                .collect();
            return Err(format!("nobody rated {}", named.join(", ")).into());
        }
        Ok(Self {
            crossing,
            margin,
            columns,
            groups: Vec::new(),
        })
    }

    /// The place of the group among the factors.
    fn group(&self) -> usize {
        self.crossing.factors.len()
    }

    /// The levels of a factor that somebody rated.
    fn levels(&self, factor: usize) -> &[String] {
        match factor == self.group() {
            true => &self.groups,
            false => self.crossing.levels(factor),
        }
    }

    /// The combinations at some levels of factors within participants.
    fn at(&self, levels: &[(usize, usize)]) -> Vec<usize> {
        let sizes = self.crossing.sizes();
        let is_at = |combination: &usize| {
            let own = digits(&sizes, *combination);
            levels.iter().all(|(factor, level)| own[*factor] == *level)
        };
        (0..self.columns.len()).filter(is_at).collect()
    }

    /// What is 0 without an effect within participants, by weights of the combinations: products of differences of two
    /// levels of each of its factors, the second less the first, over the levels of the others.
    fn contrasts_of(&self, effect: &[usize]) -> Vec<Vec<f64>> {
        let sizes = self.crossing.sizes();
        let mut all: Vec<Vec<Pair>> = vec![Vec::new()];
        for &factor in effect {
            let size = sizes[factor];
            let pairs = (0..size).flat_map(|second| {
                (second + 1..size).map(move |first| Pair {
                    factor,
                    first,
                    second,
                })
            });
            all = (all.iter())
                .flat_map(|start| pairs.clone().map(|pair| [&start[..], &[pair]].concat()))
                .collect();
        }
        let weights = |pairs: &Vec<Pair>| product(&sizes, pairs, &[]);
        all.iter().map(weights).collect()
    }

    /// Weights of combinations as weights of so many realizations.
    fn over_realizations(&self, weights: &[f64], realizations: usize) -> Vec<f64> {
        let mut all = vec![0.0; realizations];
        for (own, weight) in self.columns.iter().zip(weights) {
            for &j in own {
                all[j] = weight / own.len() as f64;
            }
        }
        all
    }

    /// Names of levels.
    fn named(&self, levels: &[(usize, usize)]) -> LevelsName {
        let name = |(factor, level): &(usize, usize)| {
            let level = self.levels(*factor)[*level].clone();
            (self.crossing.name(*factor).to_owned(), level)
        };
        LevelsName(levels.iter().map(name).collect())
    }

    /// Every combination of the levels of some factors.
    fn combinations(&self, factors: &[usize]) -> Vec<Levels> {
        let mut all: Vec<Levels> = vec![Vec::new()];
        for &factor in factors {
            let levels = 0..self.levels(factor).len();
            all = (all.iter())
                .flat_map(|start| {
                    let one = |level| start.iter().copied().chain([(factor, level)]).collect();
                    levels.clone().map(one).collect::<Vec<Levels>>()
                })
                .collect();
        }
        all
    }

    /// The levels of each effect, and every combination: what has a mean.
    fn shown(&self) -> Vec<Levels> {
        let all: Vec<usize> = (0..self.group() + usize::from(!self.groups.is_empty())).collect();
        let shown = self.crossing.effects.iter().chain([&all]);
        shown.flat_map(|effect| self.combinations(effect)).collect()
    }

    /// The differences between levels of each factor that is tested, and its simple effects in
    /// each interaction of two that is; `of` compares by weights of the combinations.
    fn contrasts(
        &self,
        of: &dyn Fn(&[f64]) -> Option<Compared>,
    ) -> BTreeMap<ContrastName, FactorialContrast> {
        let mut all = BTreeMap::new();
        let within = (self.crossing.effects.iter()).filter(|e| !e.contains(&self.group()));
        for effect in within {
            match effect[..] {
                [factor] => all.extend(self.family(factor, None, of)),
                [a, b] => {
                    all.extend(self.family(a, Some(b), of));
                    all.extend(self.family(b, Some(a), of));
                }
                _ => {}
            }
        }
        all
    }

    /// The pairs of levels of a factor, at each level of another if there is one.
    fn family(
        &self,
        factor: usize,
        other: Option<usize>,
        of: &dyn Fn(&[f64]) -> Option<Compared>,
    ) -> Vec<(ContrastName, FactorialContrast)> {
        let others = other.map_or_else(|| vec![Vec::new()], |other| self.combinations(&[other]));
        let (levels, sizes) = (self.levels(factor), self.crossing.sizes());
        let mut found = Vec::new();
        for at in &others {
            for first in 0..levels.len() {
                for second in first + 1..levels.len() {
                    let name = ContrastName {
                        factor: self.crossing.name(factor).to_owned(),
                        levels: [first, second].map(|level| levels[level].clone()),
                        at: self.named(at),
                    };
                    let pair = Pair {
                        factor,
                        first,
                        second,
                    };
                    found.push((name, of(&product(&sizes, &[pair], at))));
                }
            }
        }
        let p: Vec<Option<f64>> = found.iter().map(|(_, c)| c.as_ref()?.p).collect();
        let equivalences = self.equivalences(&found);
        let tested = found.into_iter().zip(holm(&p)).zip(equivalences);
        tested
            .map(|(((name, compared), p_holm), equivalence)| {
                let contrast = FactorialContrast::of(compared, p_holm, equivalence);
                (name, contrast)
            })
            .collect()
    }

    /// Whether each of a family of differences is smaller than the margin; nothing without one.
    fn equivalences(
        &self,
        found: &[(ContrastName, Option<Compared>)],
    ) -> Vec<Option<ContrastEquivalence>> {
        let Some(Margin { margin, alpha }) = self.margin else {
            return found.iter().map(|_| None).collect();
        };
        let tests: Vec<Option<Equivalence>> = (found.iter())
            .map(|(_, compared)| {
                let c = compared.as_ref()?;
                // Without t all differences are equal but for rounding.
                c.t.and(equivalence_of(c.estimate, c.se, c.df?, margin))
            })
            .collect();
        let p: Vec<Option<f64>> = tests.iter().map(|test| Some((*test)?.p)).collect();
        let why = "too few participants, or all differences are equal";
        let one = |(test, p_holm): (&Option<Equivalence>, Option<f64>)| {
            Some(ContrastEquivalence {
                p_tost: Stat::or(test.map(|test| test.p), why),
                p_tost_holm: Stat::or(p_holm, why),
                ci90: Interval::or(test.map(|test| test.ci90), why),
                equivalent: p_holm
                    .map_or_else(|| Stat::missing(why), |p| Stat::flag(rejects(p, alpha))),
            })
        };
        tests.iter().zip(holm(&p)).map(one).collect()
    }
}

impl FactorialContrast {
    fn of(
        compared: Option<Compared>,
        p_holm: Option<f64>,
        equivalence: Option<ContrastEquivalence>,
    ) -> Self {
        let few = "too few participants";
        let Some(c) = compared else {
            return Self {
                equivalence,
                ..Self::undefined(few)
            };
        };
        let or = |x: Option<f64>| Stat::or(x, "all differences are equal");
        Self {
            difference: Stat::of(c.estimate),
            difference_ci95: Interval::or(c.ci95, few),
            t: or(c.t),
            df: Stat::or(c.df, few),
            p: or(c.p),
            p_holm: or(p_holm),
            dz: c.dz.map(or),
            equivalence,
        }
    }
}

/// The levels of a combination by its place, the last factor fastest.
fn digits(sizes: &[usize], combination: usize) -> Vec<usize> {
    let (mut rest, mut found) = (combination, vec![0; sizes.len()]);
    for (digit, size) in found.iter_mut().zip(sizes).rev() {
        (*digit, rest) = (rest % size, rest / size);
    }
    found
}

#[cfg(test)]
mod tests;
