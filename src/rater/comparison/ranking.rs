//! Raters who rank several realizations.

use super::{Comparing, Percepts, TIE};
use crate::rater::{Effect, Rater};
use study_base::sort::SmallSort as _;
use study_base::text::ModelId;
use study_plan::protocol::{Answer, Part, Protocol, Ranking, Task, Trial};

impl Comparing {
    /// Ranks the intervals of a trial by these strengths, the largest first. `ties`: those that are near each other have the same rank.
    fn rank(&mut self, strengths: &[f64], ties: bool) {
        let mut felt: Vec<f64> = (strengths.iter())
            .map(|strength| strength + self.noise * self.stream.normal())
            .collect();
        let lapses = self.stream.unit() < self.lapse_rate;
        let mut anywhere: Vec<usize> = (0..felt.len()).collect();
        self.stream.shuffle(&mut anywhere);
        if lapses {
            felt = anywhere.iter().map(|place| *place as f64).collect();
        }
        let mut order: Vec<usize> = (0..felt.len()).collect();
        order.small_sort_by(|a, b| felt[*b].total_cmp(&felt[*a]));
        self.ranks = vec![1; felt.len()];
        for (place, two) in (2..).zip(order.windows(2)) {
            let near = ties && felt[two[0]] - felt[two[1]] < TIE * self.noise;
            self.ranks[two[1]] = if near { self.ranks[two[0]] } else { place };
        }
    }
}

impl Rater {
    /// The rank of an interval, from 0. All are ranked when that of the first is asked.
    pub(super) fn ranked(
        &mut self,
        interval: usize,
        (part, own): (&Part, &Ranking),
        models: &[ModelId],
        percepts: &Percepts,
    ) -> Option<Answer> {
        if interval == 0 {
            let known = self.effect == Effect::BuiltIn;
            let opinion = |model: &ModelId| {
                let felt = percepts.impression(model).filter(|_| known);
                felt.map_or(0.0, |felt| felt.opinion(part.id.as_str()))
            };
            let strengths: Vec<f64> = models.iter().map(opinion).collect();
            self.comparing.rank(&strengths, own.ties);
        }
        let rank = self.comparing.ranks.get(interval)?;
        Some(Answer::Rating(*rank))
    }
}

/// The part of a trial of ranking.
pub(super) fn ranked<'p>(protocol: &'p Protocol, trial: &Trial) -> Option<(&'p Part, &'p Ranking)> {
    let part = protocol.part(trial.part.as_ref()?)?;
    match &part.task {
        Task::Ranking(own) => Some((part, own)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is felt more strongly is above; of what is alike each is above equally often, or tied where ties are answers.
    #[test]
    fn realizations_are_ranked_as_strongly_as_they_are_felt() {
        let of = |strengths: &[f64], ties: bool, number: u32| {
            let mut comparing = Comparing::new(3, number);
            comparing.rank(strengths, ties);
            comparing.ranks
        };
        let share = |strengths: &[f64], ties: bool, expected: &[i64]| {
            let same = |number: &u32| of(strengths, ties, *number) == expected;
            (1..=400).filter(same).count() as f64 / 400.0
        };
        // One in fifty lapses.
        assert!(share(&[9.0, 40.0, 20.0], false, &[3, 1, 2]) > 0.95);
        assert!(share(&[9.0, 40.0, 20.0], true, &[3, 1, 2]) > 0.95);
        let first = share(&[5.0, 5.0], false, &[1, 2]);
        assert!((first - 0.5).abs() < 0.1, "{first}");
        let tied = share(&[5.0, 5.0], true, &[1, 1]);
        assert!((0.15..0.45).contains(&tied), "{tied}");
        for number in 1..=50 {
            let mut ranks = of(&[1.0, 1.1, 1.2, 1.3], false, number);
            ranks.sort_unstable();
            assert_eq!(ranks, [1, 2, 3, 4]);
        }
    }
}
