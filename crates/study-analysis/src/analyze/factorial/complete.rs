//! The analysis of variance over the participants who rated every realization, from the mean of
//! each in each combination of levels.

use super::{Compared, FactorialEffect, FactorialMean, FactorialTests, Layout, Margin};
use crate::analyze::cells::Cells;
use crate::analyze::effects::NO_ERROR;
use crate::analyze::record::{EffectName, Interval, Stat, Why};
use std::collections::BTreeMap;
use study_plan::protocol::Crossing;
use study_stats::describe::{mean, sd};
use study_stats::factorial::{self, Effect, Term};
use study_stats::paired::{holm, one_sample};

/// The participants' means in each combination, less the offset of the cells.
pub(super) struct Table<'a> {
    layout: Layout<'a>,
    offset: f64,
    /// Participants × combinations, the last factor fastest.
    rows: Vec<Vec<f64>>,
    /// The group of each row, by its place among those of the layout; empty if it is no factor.
    groups: Vec<usize>,
}

impl<'a> Table<'a> {
    pub(super) fn of(
        cells: &Cells<'_>,
        crossing: &'a Crossing,
        margin: Option<Margin>,
    ) -> Result<Self, Why> {
        let table = cells.table(&cells.tested());
        let mut layout = Layout::of(cells, crossing, margin, &table.models)?;
        let has_groups = !crossing.groups.is_empty();
        let of_group = |s: usize| {
            let own = cells.ratings.subjects[s].group.as_ref()?;
            crossing.groups.iter().position(|group| group == own)
        };
        let (mut rows, mut of_rows) = (Vec::new(), Vec::new());
        for (&s, row) in table.subjects.iter().zip(&table.rows) {
            let group = of_group(s);
            if has_groups && group.is_none() {
                continue;
            }
            let of = |own: &Vec<usize>| own.iter().map(|j| row[*j]).sum::<f64>() / own.len() as f64;
            rows.push(layout.columns.iter().map(of).collect::<Vec<f64>>());
            of_rows.push(group.unwrap_or(0));
        }
        if rows.len() < 2 {
            return Err("fewer than two participants rated every realization".into());
        }
        let mut groups = Vec::new();
        if has_groups {
            let mut present = of_rows.clone();
            present.sort_unstable();
            present.dedup();
            if present.len() < 2 {
                return Err("the participants who rated every realization are of one group".into());
            }
            let place = |g: &usize| present.binary_search(g).unwrap_or(0);
            groups = of_rows.iter().map(place).collect();
            let name = |g: &usize| crossing.groups[*g].clone();
            layout.groups = present.iter().map(name).collect();
        }
        Ok(Self {
            layout,
            offset: cells.offset,
            rows,
            groups,
        })
    }

    pub(super) fn tests(&self) -> FactorialTests {
        let compared = |weights: &[f64]| {
            let found = factorial::contrast(&self.rows, &self.groups, weights)?;
            Some(Compared {
                estimate: found.estimate,
                se: found.se,
                ci95: Some(found.ci95),
                t: found.t,
                df: Some(found.df),
                p: found.p,
                dz: Some(found.dz),
            })
        };
        FactorialTests {
            effects: self.effects(),
            means: (self.layout.shown().into_iter())
                .map(|levels| (self.layout.named(&levels), self.mean(&levels)))
                .collect(),
            contrasts: self.layout.contrasts(&compared),
        }
    }

    fn effects(&self) -> BTreeMap<EffectName, FactorialEffect> {
        let crossing = self.layout.crossing;
        let sizes = crossing.sizes();
        let found = match factorial::analysis(&self.rows, &sizes, &self.groups) {
            Ok(found) => found,
            Err(why) => return super::undefined(crossing, &why.to_string().into()).effects,
        };
        let ranked = factorial::aligned_ranks(&self.rows, &sizes, &self.groups).ok();
        let places = |term: &Term| -> Vec<usize> {
            let group = term.group.then_some(self.layout.group());
            term.factors.iter().copied().chain(group).collect()
        };
        let tested = |effect: &Effect| crossing.effects.contains(&places(&effect.term));
        let family: Vec<Option<f64>> = (found.effects.iter())
            .map(|effect| effect.p_corrected().filter(|_| tested(effect)))
            .collect();
        let corrected = holm(&family);
        let of = |(effect, p_holm): (&Effect, &Option<f64>)| {
            let name = crossing.effect_name(&places(&effect.term));
            let art = ranked.as_ref().and_then(|r| r.effect(&effect.term));
            let or = |x: Option<f64>| Stat::or(x, NO_ERROR);
            let few = "too few participants for it";
            let equal = "all ratings are equal";
            let no_ranks = "the aligned ranks leave no variance of error";
            let numbers = FactorialEffect {
                ss: Stat::of(effect.ss),
                ss_error: Stat::of(effect.ss_error),
                df1: Stat::of(effect.df1),
                df2: Stat::of(effect.df2),
                f: or(effect.f),
                p: or(effect.p),
                eps_gg: or(effect.eps_gg),
                p_gg: or(effect.p_corrected()),
                eps_hf: Stat::or(effect.eps_hf, few),
                p_hf: Stat::or(effect.p_hf, few),
                ges: Stat::or(effect.ges, equal),
                pes: Stat::or(effect.pes, equal),
                p_holm: tested(effect).then(|| or(*p_holm)),
                art_f: Stat::or(art.and_then(|e| e.f), no_ranks),
                art_p: Stat::or(art.and_then(Effect::p_corrected), no_ranks),
                clustered: None,
            };
            (name.as_str().into(), numbers)
        };
        found.effects.iter().zip(&corrected).map(of).collect()
    }

    /// The mean over participants, those of a group if it is among the levels.
    fn mean(&self, levels: &[(usize, usize)]) -> FactorialMean {
        let group = self.layout.group();
        let is_group = |level: &&(usize, usize)| level.0 == group;
        let within: Vec<(usize, usize)> = levels.iter().filter(|l| !is_group(l)).copied().collect();
        let of_group = levels.iter().find(is_group).map(|(_, g)| *g);
        let chosen = self.layout.at(&within);
        let people = self.rows.iter().enumerate();
        let own: Vec<f64> = people
            .filter(|(i, _)| of_group.is_none_or(|g| self.groups[*i] == g))
            .filter_map(|(_, row)| mean(&chosen.iter().map(|j| row[*j]).collect::<Vec<_>>()))
            .collect();
        let few = "fewer than two participants";
        let back = |x: f64| x + self.offset;
        let ci = one_sample(&own).map(|t| (back(t.ci95.0), back(t.ci95.1)));
        FactorialMean {
            n: Stat::count(own.len()),
            mean: Stat::or(mean(&own).map(back), few),
            sd: Some(Stat::or(sd(&own), few)),
            ci95: Some(Interval::or(ci, few)),
        }
    }
}
