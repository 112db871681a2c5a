//! Factorial designs: `factorial/*`, `factorial_mean/*`, `factorial_contrast/*`. All over the
//! participants who rated every realization, from the mean of each participant in each
//! combination of levels.

use super::Rules;
use super::cells::Cells;
use super::effects::NO_ERROR;
use super::record::{ContrastName, EffectName, Interval, LevelsName, Stat, Why, statistics};
use std::collections::BTreeMap;
use study_plan::protocol::Crossing;
use study_stats::describe::{mean, sd};
use study_stats::factorial::{self, Effect, Term};
use study_stats::paired::{holm, one_sample};

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
        /// `p_gg`, corrected by Holm (1979) over the effects that are tested; only these have it
        p_holm: Option<Stat>,
        /// of the aligned rank transform (Wobbrock et al. 2011)
        art_f: Stat as "art_F",
        /// of `art_F`, with Greenhouse and Geisser's correction
        art_p: Stat,
    }

    /// The participants' means at some levels; over all levels of the factors that are not named.
    pub struct FactorialMean {
        /// participants
        n: Stat,
        /// mean over participants
        mean: Stat,
        /// standard deviation over participants
        sd: Stat,
        /// of the mean, by t over participants
        ci95: Interval,
    }

    /// A difference between two levels of a factor, over all levels of the others or at one level of another (a simple effect), by t over participants.
    pub struct FactorialContrast {
        /// first minus second level
        difference: Stat,
        /// its interval
        difference_ci95: Interval,
        /// the statistic
        t: Stat,
        /// participants less groups
        df: Stat,
        /// two-sided
        p: Stat,
        /// by Holm (1979): over the pairs of levels of a factor; of simple effects over all of one interaction and factor
        p_holm: Stat,
        /// difference over the standard deviation of the participants' differences
        dz: Stat,
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

/// The participants' means in each combination, less the offset of the cells.
struct Table<'a> {
    crossing: &'a Crossing,
    offset: f64,
    /// Participants × combinations, the last factor fastest.
    rows: Vec<Vec<f64>>,
    /// The group of each row, by its place among the groups with participants; empty if it is no factor.
    groups: Vec<usize>,
    /// The names of those groups.
    group_names: Vec<String>,
}

/// Tests of the effects of a factorial design; `None` in a study without factors.
pub(super) fn factorial(cells: &Cells<'_>, rules: &Rules) -> Option<FactorialTests> {
    let crossing = rules.crossing.as_ref()?;
    Some(match Table::of(cells, crossing) {
        Ok(table) => table.tests(),
        Err(why) => FactorialTests {
            effects: (crossing.effects.iter())
                .map(|effect| {
                    let name = crossing.effect_name(effect);
                    let undefined = FactorialEffect {
                        p_holm: Some(Stat::missing(why.clone())),
                        ..FactorialEffect::undefined(why.clone())
                    };
                    (name.as_str().into(), undefined)
                })
                .collect(),
            means: BTreeMap::new(),
            contrasts: BTreeMap::new(),
        },
    })
}

impl<'a> Table<'a> {
    fn of(cells: &Cells<'_>, crossing: &'a Crossing) -> Result<Self, Why> {
        let table = cells.table(&cells.tested());
        let combinations: usize = crossing.sizes().iter().product();
        let mut columns = vec![Vec::new(); combinations];
        for (j, &model) in table.models.iter().enumerate() {
            let name = cells.model_name(model);
            let Some(levels) = crossing.levels_of.get(name) else {
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
        let subjects = &cells.ratings.subjects;
        let of_group = |s: usize| {
            let own = subjects[s].group.as_ref()?;
            crossing.groups.iter().position(|group| group == own)
        };
        let mut rows = Vec::new();
        let mut of_rows = Vec::new();
        for (&s, row) in table.subjects.iter().zip(&table.rows) {
            let group = of_group(s);
            if !crossing.groups.is_empty() && group.is_none() {
                continue;
            }
            let of = |own: &Vec<usize>| own.iter().map(|j| row[*j]).sum::<f64>() / own.len() as f64;
            rows.push(columns.iter().map(of).collect::<Vec<f64>>());
            of_rows.push(group.unwrap_or(0));
        }
        if rows.len() < 2 {
            return Err("fewer than two participants rated every realization".into());
        }
        let (mut groups, mut group_names) = (Vec::new(), Vec::new());
        if !crossing.groups.is_empty() {
            let mut present = of_rows.clone();
            present.sort_unstable();
            present.dedup();
            if present.len() < 2 {
                return Err("the participants who rated every realization are of one group".into());
            }
            let place = |g: &usize| present.binary_search(g).unwrap_or(0);
            groups = of_rows.iter().map(place).collect();
            group_names = present
                .iter()
                .map(|g| crossing.groups[*g].clone())
                .collect();
        }
        Ok(Self {
            crossing,
            offset: cells.offset,
            rows,
            groups,
            group_names,
        })
    }

    fn tests(&self) -> FactorialTests {
        FactorialTests {
            effects: self.effects(),
            means: self.means(),
            contrasts: self.contrasts(),
        }
    }

    /// The factors of an effect of the library, as places of the crossing.
    fn places(&self, term: &Term) -> Vec<usize> {
        let group = term.group.then_some(self.crossing.factors.len());
        term.factors.iter().copied().chain(group).collect()
    }

    fn effects(&self) -> BTreeMap<EffectName, FactorialEffect> {
        let sizes = self.crossing.sizes();
        let found = factorial::analysis(&self.rows, &sizes, &self.groups);
        let ranked = factorial::aligned_ranks(&self.rows, &sizes, &self.groups);
        let (found, ranked) = match (found, ranked) {
            (Ok(found), ranked) => (found, ranked),
            (Err(why), _) => {
                let undefined = |effect: &Vec<usize>| {
                    let name = self.crossing.effect_name(effect);
                    (
                        name.as_str().into(),
                        FactorialEffect::undefined(why.to_string()),
                    )
                };
                return self.crossing.effects.iter().map(undefined).collect();
            }
        };
        let tested = |effect: &Effect| self.crossing.effects.contains(&self.places(&effect.term));
        let family: Vec<Option<f64>> = (found.effects.iter())
            .map(|effect| deciding_p(effect).filter(|_| tested(effect)))
            .collect();
        let corrected = holm(&family);
        let of = |(effect, p_holm): (&Effect, &Option<f64>)| {
            let name = self.crossing.effect_name(&self.places(&effect.term));
            let art = (ranked.as_ref().ok())
                .and_then(|r| r.effects.iter().find(|other| other.term == effect.term));
            let or = |x: Option<f64>| Stat::or(x, NO_ERROR);
            let no_ranks = "the aligned ranks leave no variance of error";
            let numbers = FactorialEffect {
                ss: Stat::of(effect.ss),
                ss_error: Stat::of(effect.ss_error),
                df1: Stat::of(effect.df1),
                df2: Stat::of(effect.df2),
                f: or(effect.f),
                p: or(effect.p),
                eps_gg: or(effect.eps_gg),
                p_gg: or(deciding_p(effect)),
                eps_hf: Stat::or(effect.eps_hf, "too few participants for it"),
                p_hf: Stat::or(effect.p_hf, "too few participants for it"),
                ges: Stat::or(effect.ges, "all ratings are equal"),
                pes: Stat::or(effect.pes, "all ratings are equal"),
                p_holm: tested(effect).then(|| or(*p_holm)),
                art_f: Stat::or(art.and_then(|e| e.f), no_ranks),
                art_p: Stat::or(art.and_then(deciding_p), no_ranks),
            };
            (name.as_str().into(), numbers)
        };
        found.effects.iter().zip(&corrected).map(of).collect()
    }

    /// The combinations at some levels of factors within participants.
    fn at<'t>(&'t self, levels: &'t [(usize, usize)]) -> impl Iterator<Item = usize> + 't {
        let sizes = self.crossing.sizes();
        let combinations: usize = sizes.iter().product();
        (0..combinations).filter(move |combination| {
            let own = digits(&sizes, *combination);
            levels.iter().all(|(factor, level)| own[*factor] == *level)
        })
    }

    /// Names of levels, by place.
    fn named(&self, levels: &[(usize, usize)]) -> LevelsName {
        let name = |(factor, level): &(usize, usize)| {
            let of = match *factor == self.crossing.factors.len() {
                true => &self.group_names,
                false => self.crossing.levels(*factor),
            };
            (self.crossing.name(*factor).to_owned(), of[*level].clone())
        };
        LevelsName(levels.iter().map(name).collect())
    }

    /// Every combination of the levels of some factors.
    fn combinations(&self, factors: &[usize]) -> Vec<Vec<(usize, usize)>> {
        let mut all = vec![Vec::new()];
        for &factor in factors {
            let levels = match factor == self.crossing.factors.len() {
                true => self.group_names.len(),
                false => self.crossing.levels(factor).len(),
            };
            all = (all.into_iter())
                .flat_map(|start: Vec<(usize, usize)>| {
                    (0..levels).map(move |level| {
                        let mut one = start.clone();
                        one.push((factor, level));
                        one
                    })
                })
                .collect();
        }
        all
    }

    /// The means of the levels of each effect, and of every combination.
    fn means(&self) -> BTreeMap<LevelsName, FactorialMean> {
        let group = self.crossing.factors.len();
        let all: Vec<usize> = (0..group + usize::from(!self.groups.is_empty())).collect();
        let shown = self.crossing.effects.iter().chain([&all]);
        let levels = shown.flat_map(|effect| self.combinations(effect));
        levels
            .map(|levels| {
                let within: Vec<(usize, usize)> = levels
                    .iter()
                    .copied()
                    .filter(|(f, _)| *f != group)
                    .collect();
                let own_group = levels.iter().find(|(f, _)| *f == group);
                let chosen: Vec<usize> = self.at(&within).collect();
                let people = self.rows.iter().enumerate();
                let own: Vec<f64> = people
                    .filter(|(i, _)| own_group.is_none_or(|(_, g)| self.groups[*i] == *g))
                    .filter_map(|(_, row)| {
                        mean(&chosen.iter().map(|j| row[*j]).collect::<Vec<_>>())
                    })
                    .collect();
                (self.named(&levels), self.mean_of(&own))
            })
            .collect()
    }

    fn mean_of(&self, own: &[f64]) -> FactorialMean {
        let few = "fewer than two participants";
        let back = |x: f64| x + self.offset;
        let ci = one_sample(own).map(|t| (back(t.ci95.0), back(t.ci95.1)));
        FactorialMean {
            n: Stat::count(own.len()),
            mean: Stat::or(mean(own).map(back), few),
            sd: Stat::or(sd(own), few),
            ci95: Interval::or(ci, few),
        }
    }

    /// The differences between levels of each factor that is tested, and its simple effects in
    /// each interaction of two that is.
    fn contrasts(&self) -> BTreeMap<ContrastName, FactorialContrast> {
        let group = self.crossing.factors.len();
        let mut all = BTreeMap::new();
        for effect in &self.crossing.effects {
            if effect.contains(&group) {
                continue;
            }
            match effect[..] {
                [factor] => self.family(factor, None, &mut all),
                [a, b] => {
                    self.family(a, Some(b), &mut all);
                    self.family(b, Some(a), &mut all);
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
        all: &mut BTreeMap<ContrastName, FactorialContrast>,
    ) {
        let others = other.map_or_else(|| vec![Vec::new()], |other| self.combinations(&[other]));
        let levels = self.crossing.levels(factor);
        let mut found = Vec::new();
        for at in &others {
            for first in 0..levels.len() {
                for second in first + 1..levels.len() {
                    let weights = self.weights(factor, (first, second), at);
                    let name = ContrastName {
                        factor: self.crossing.name(factor).to_owned(),
                        levels: [first, second].map(|level| levels[level].clone()),
                        at: self.named(at),
                    };
                    found.push((
                        name,
                        factorial::contrast(&self.rows, &self.groups, &weights),
                    ));
                }
            }
        }
        let p: Vec<Option<f64>> = (found.iter())
            .map(|(_, contrast)| contrast.as_ref().and_then(|c| c.p))
            .collect();
        for ((name, contrast), p_holm) in found.into_iter().zip(holm(&p)) {
            let Some(c) = contrast else {
                all.insert(name, FactorialContrast::undefined("too few participants"));
                continue;
            };
            let or = |x: Option<f64>| Stat::or(x, "all differences are equal");
            let contrast = FactorialContrast {
                difference: Stat::of(c.estimate),
                difference_ci95: Interval::or(Some(c.ci95), "too few participants"),
                t: or(c.t),
                df: Stat::of(c.df),
                p: or(c.p),
                p_holm: or(p_holm),
                dz: or(c.dz),
            };
            all.insert(name, contrast);
        }
    }

    /// The mean at the first level less that at the second.
    fn weights(
        &self,
        factor: usize,
        (first, second): (usize, usize),
        at: &[(usize, usize)],
    ) -> Vec<f64> {
        let mut weights = vec![0.0; self.crossing.sizes().iter().product()];
        for (level, sign) in [(first, 1.0), (second, -1.0)] {
            let levels: Vec<(usize, usize)> = at.iter().copied().chain([(factor, level)]).collect();
            let own: Vec<usize> = self.at(&levels).collect();
            for &j in &own {
                weights[j] = sign / own.len() as f64;
            }
        }
        weights
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

/// The p that decides: with Greenhouse and Geisser's correction where there is anything to
/// correct.
fn deciding_p(effect: &Effect) -> Option<f64> {
    effect.p_corrected()
}

#[cfg(test)]
mod tests;
