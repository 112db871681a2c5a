//! Whether dissimilarities have a structure that a map shows better than chance, and how many dimensions it takes to
//! predict those of somebody else.

use super::scaling::{Precision, Scale, smacof};
use super::{Dissimilarities, pairs};
use crate::correlation::spearman;
use crate::describe;
use crate::random::RandomSource;

/// Most dimensions of a map.
pub const MOST: usize = 3;
/// Most objects of a map; more take too long.
pub const MOST_OBJECTS: usize = 30;
/// Number of random orders of the ratings of each participant.
pub const DRAWS: u32 = 999;
/// Random starts beside the classical map, of what is repeated.
const STARTS: usize = 2;

/// The most dimensions of a map of some objects: two objects more than twice as many dimensions, up to [`MOST`]. Fewer fit any order of
/// dissimilarities almost without stress.
pub fn most(objects: usize) -> usize {
    (objects.saturating_sub(2) / 2).min(MOST)
}

/// Whether a map has less stress than by chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Structure {
    /// Dimensions of the map: 2, or 1 of fewer than six objects.
    pub dimensions: usize,
    /// The stress of the mean dissimilarities.
    pub stress: f64,
    /// Its mean if each participant's dissimilarities are dealt to the pairs at random.
    pub by_chance: f64,
    /// (b + 1)/(B + 1), where b of B = [`DRAWS`] such deals have no more stress.
    pub p: f64,
}

/// Compares the stress of ratio scaling of the mean dissimilarities with that after each participant's were dealt to the pairs at random: if
/// nobody perceives a structure, all deals are equally likely, and their means differ little. The order alone fits almost any dissimilarities of
/// few objects. Both come from as many starts. `None` for fewer than four objects, or if
/// there is no map.
pub fn structure(
    participants: &[Dissimilarities],
    random: &mut impl RandomSource,
) -> Option<Structure> {
    let objects = participants.first()?.objects();
    let dimensions = most(objects).min(2);
    let stress = |participants: &[Dissimilarities], random: &mut _| {
        let mean = Dissimilarities::in_common(participants.iter())?;
        let found = smacof(
            &mean,
            dimensions,
            Scale::Ratio,
            STARTS,
            Precision::COARSE,
            random,
        );
        found.map(|found| found.stress)
    };
    let found = stress(participants, random)?;
    let (mut as_small, mut sum) = (1u32, 0.0);
    for _ in 0..DRAWS {
        let dealt: Vec<Dissimilarities> =
            (participants.iter()).map(|own| own.dealt(random)).collect();
        let chance = stress(&dealt, random)?;
        sum += chance;
        as_small += u32::from(chance <= found + 1e-9);
    }
    Some(Structure {
        dimensions,
        stress: found,
        by_chance: sum / f64::from(DRAWS),
        p: f64::from(as_small) / f64::from(DRAWS + 1),
    })
}

impl Dissimilarities {
    /// The same values, dealt at random to the pairs that have one.
    fn dealt(&self, random: &mut impl RandomSource) -> Self {
        let known = self.known();
        let mut order: Vec<usize> = (0..known.len()).collect();
        random.shuffle(&mut order);
        let mut values = order.iter().map(|at| known[*at]);
        let dealt = (self.values.iter()).map(|value| value.and_then(|_| values.next()));
        Self {
            objects: self.objects,
            values: dealt.collect(),
        }
    }
}

/// How well maps of so many dimensions predict the dissimilarities of each participant: Spearman's correlation with the distances in
/// the map of the mean of all others. `None` where there is no map or no correlation; empty for fewer than two
/// participants.
pub fn predicted(
    participants: &[Dissimilarities],
    dimensions: usize,
    random: &mut impl RandomSource,
) -> Vec<Option<f64>> {
    if participants.len() < 2 {
        return Vec::new();
    }
    let mut of = |(own, mine): (usize, &Dissimilarities)| {
        let others = (participants.iter().enumerate()).filter(|(at, _)| *at != own);
        let mean = Dissimilarities::in_common(others.map(|(_, other)| other))?;
        let precision = Precision::COARSE;
        let found = smacof(
            &mean,
            dimensions,
            Scale::Ordinal,
            4 * STARTS,
            precision,
            random,
        )?;
        let both = pairs(mine.objects()).zip(mine.values());
        let (distances, rated): (Vec<f64>, Vec<f64>) = both
            .filter_map(|((a, b), value)| Some((found.map.distance(a, b), (*value)?)))
            .unzip();
        spearman(&distances, &rated)
    };
    participants.iter().enumerate().map(&mut of).collect()
}

/// The number of dimensions, from 1, that predicts best; of those that predict as well, within one standard error of the
/// difference, the smallest. `predictions`: [`predicted`] with 1 dimension and more; participants for whom one is
/// missing do not count. `None` without a participant.
///
/// ```
/// # use study_stats::similarity::dimensions::chosen;
/// let one = vec![Some(0.5), Some(0.6), Some(0.4)];
/// let two = vec![Some(0.8), Some(0.7), Some(0.7)];
/// assert_eq!(chosen(&[one.clone(), two.clone()]), Some(2));
/// assert_eq!(chosen(&[two, one]), Some(1));
/// ```
pub fn chosen(predictions: &[Vec<Option<f64>>]) -> Option<usize> {
    let known = complete(predictions);
    let means: Option<Vec<f64>> = known.iter().map(|own| describe::mean(own)).collect();
    let means = means?;
    let best = (0..means.len()).max_by(|a, b| means[*a].total_cmp(&means[*b]))?;
    let as_good = |k: &usize| {
        let differences: Vec<f64> = (known[best].iter().zip(&known[*k]))
            .map(|(best, own)| best - own)
            .collect();
        let se = describe::sd(&differences).map(|sd| sd / (differences.len() as f64).sqrt());
        means[best] - means[*k] <= se.unwrap_or(0.0)
    };
    (0..means.len()).find(as_good).map(|k| k + 1)
}

/// The predictions of those who have all of them, by number of dimensions.
pub fn complete(predictions: &[Vec<Option<f64>>]) -> Vec<Vec<f64>> {
    let people = predictions.iter().map(Vec::len).min().unwrap_or(0);
    let has = |at: &usize| predictions.iter().all(|own| own[*at].is_some());
    let whole: Vec<usize> = (0..people).filter(has).collect();
    let of = |own: &Vec<Option<f64>>| whole.iter().filter_map(|at| own[*at]).collect();
    predictions.iter().map(of).collect()
}
