//! How the answers to a questionnaire of the study's own become scores.

use super::keys::words;
use serde::Serialize;
use study_base::text::PartId;

/// The scoring of a questionnaire that the study brings itself. Items are counted from 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scoring {
    /// Number of items.
    pub items: u32,
    /// The lowest answer.
    pub from: i64,
    /// The highest answer, above `from`.
    pub to: i64,
    /// Items that are turned round: in place of an answer, `from + to` less it.
    pub reverse: Vec<u32>,
    /// Added to each answer.
    pub plus: f64,
    /// What the answers are taken together by.
    pub total: Total,
    /// The items of the score, each as often as it counts.
    pub counted: Vec<u32>,
    /// By which the mean or the sum is multiplied.
    pub times: f64,
    /// Scores of some of the items.
    pub scales: Vec<Subscale>,
}

/// A score of some of the items.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Subscale {
    /// Its name.
    pub id: PartId,
    /// Its items, each as often as it counts.
    pub items: Vec<u32>,
    /// By which the mean or the sum is multiplied.
    pub times: f64,
}

words! {
    /// What the answers to the items are taken together by.
    Total {
        /// Their mean.
        Mean = "mean",
        /// Their sum.
        Sum = "sum",
    }
}

impl Scoring {
    /// The score of the answers to all items, in their order; `None` if one that counts is missing or
    /// not on the scale.
    pub fn score(&self, answers: &[Option<f64>]) -> Option<f64> {
        Some(self.times * self.together(&self.counted, answers)?)
    }

    /// That of a subscale.
    pub fn subscale(&self, own: &Subscale, answers: &[Option<f64>]) -> Option<f64> {
        Some(own.times * self.together(&own.items, answers)?)
    }

    fn together(&self, items: &[u32], answers: &[Option<f64>]) -> Option<f64> {
        let all: Option<Vec<f64>> = items.iter().map(|item| self.of(*item, answers)).collect();
        let all = all.filter(|all| !all.is_empty())?;
        let sum: f64 = all.iter().sum();
        Some(match self.total {
            Total::Sum => sum,
            Total::Mean => sum / all.len() as f64,
        })
    }

    /// The number that counts of an item.
    fn of(&self, item: u32, answers: &[Option<f64>]) -> Option<f64> {
        let place = (item as usize).checked_sub(1)?;
        let answer = answers.get(place).copied().flatten()?;
        let (from, to) = (self.from as f64, self.to as f64);
        let turned = match self.reverse.contains(&item) {
            true => from + to - answer,
            false => answer,
        };
        (from..=to).contains(&answer).then_some(turned + self.plus)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(id: &str, items: &[u32], times: f64) -> Subscale {
        Subscale {
            id: PartId::new(id).unwrap(),
            items: items.to_vec(),
            times,
        }
    }

    fn given(answers: &[f64]) -> Vec<Option<f64>> {
        answers.iter().copied().map(Some).collect()
    }

    /// Eight pairs of words from 1 to 7, scored from −3 to 3: the short User Experience Questionnaire
    /// (Schrepp, Hinderks & Thomaschewski 2017).
    #[test]
    fn pairs_of_words_are_scored_around_zero() {
        let own = Scoring {
            items: 8,
            from: 1,
            to: 7,
            reverse: Vec::new(),
            plus: -4.0,
            total: Total::Mean,
            counted: (1..=8).collect(),
            times: 1.0,
            scales: vec![
                scale("pragmatic", &[1, 2, 3, 4], 1.0),
                scale("hedonic", &[5, 6, 7, 8], 1.0),
            ],
        };
        let answers = given(&[7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 4.0]);
        assert_eq!(own.score(&answers), Some(0.0));
        let [pragmatic, hedonic] = [0, 1].map(|i| own.subscale(&own.scales[i], &answers));
        assert_eq!((pragmatic, hedonic), (Some(1.5), Some(-1.5)));
        let mut lacking = answers;
        lacking[6] = None;
        assert_eq!(own.score(&lacking), None);
        assert_eq!(own.subscale(&own.scales[0], &lacking), Some(1.5));
        lacking[6] = Some(8.0);
        assert_eq!(own.score(&lacking), None);
    }

    /// Sixteen symptoms from 0 to 3 of which some count in two subscales, with the weights of the Simulator Sickness
    /// Questionnaire (Kennedy et al. 1993): the largest scores are 200.34, 159.18 and 292.32, and 235.62.
    #[test]
    fn items_can_count_twice_and_scales_have_weights() {
        let nausea = [1, 6, 7, 8, 9, 15, 16];
        let oculomotor = [1, 2, 3, 4, 5, 9, 11];
        let disorientation = [5, 8, 10, 11, 12, 13, 14];
        let own = Scoring {
            items: 16,
            from: 0,
            to: 3,
            reverse: Vec::new(),
            plus: 0.0,
            total: Total::Sum,
            counted: [nausea, oculomotor, disorientation].concat(),
            times: 3.74,
            scales: vec![
                scale("nausea", &nausea, 9.54),
                scale("oculomotor", &oculomotor, 7.58),
                scale("disorientation", &disorientation, 13.92),
            ],
        };
        let worst = given(&[3.0; 16]);
        let near = |found: Option<f64>, expected: f64| {
            assert!(
                found.is_some_and(|x| (x - expected).abs() < 1e-9),
                "{found:?} {expected}"
            );
        };
        near(own.score(&worst), 235.62);
        for (scale, expected) in own.scales.iter().zip([200.34, 159.18, 292.32]) {
            near(own.subscale(scale, &worst), expected);
        }
        near(own.score(&given(&[0.0; 16])), 0.0);
    }

    #[test]
    fn items_are_turned_round() {
        let own = Scoring {
            items: 3,
            from: 0,
            to: 6,
            reverse: vec![2],
            plus: 0.0,
            total: Total::Mean,
            counted: vec![1, 2, 3],
            times: 1.0,
            scales: Vec::new(),
        };
        assert_eq!(own.score(&given(&[6.0, 0.0, 6.0])), Some(6.0));
        assert_eq!(own.score(&given(&[6.0, 6.0, 6.0])), Some(4.0));
    }
}
