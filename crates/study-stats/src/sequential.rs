//! Whether answers depend on the trial before.
//!
//! A participant who answers one of two words, of which one is right, may tend to say again what they said, or what was
//! right, in the trial before (Verplanck, Collier & Cotton 1952, J. Exp. Psychol. 44, 273–282; Fründ, Wichmann & Macke 2014, J. Vis.
//! 14(7), 9). Thresholds take trials as independent of each other.
//!
//! For the trials of one participant, with aₜ = ±½ for the answer (½: the first word), gₜ = ±½ for the word that is
//! right and zₜ for the strength of the stimulus, less its mean,
//!
//! aₜ = b₀ + b₁gₜ + b₂gₜzₜ + b₃aₜ₋₁ + b₄gₜ₋₁ + e
//!
//! is fitted by least squares: b₃ is by how much more often the first word is said after it than after the other, b₄
//! after trials in which it was right. What is right is drawn at random, so that the strength has only to take away noise. A
//! regression on the answer before that also estimates its mean is biased towards alternation by (1 + 3b₃)/n (Marriott &
//! Pope 1954, Biometrika 41, 390–402; Kendall 1954, ibid. 403–404), which is corrected, and the other
//! coefficients are those beside the corrected one.

use super::describe::mean;
use super::finite;
use super::matrix::{Cholesky, SymmetricMatrix, dot};

/// Fewest trials after another one.
pub const MIN_TRIALS: usize = 15;

/// A trial with two possible answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answered {
    /// Whether the first word was the answer.
    pub first: bool,
    /// Whether the first word was right.
    pub first_is_right: bool,
    /// How strong the stimulus was, on any scale that rises; the same number for all where it is not known.
    pub strength: f64,
}

/// How the answers of a participant depend on the trial before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sequential {
    /// Trials after another one.
    pub trials: usize,
    /// Change of the share of the first word, after it was the answer from after the other was.
    pub after_answer: f64,
    /// The same, after it was right.
    pub after_right: f64,
}

impl Sequential {
    /// The change of the share of a word, after it was a correct answer from after the other was one: to stay with what won.
    pub fn after_correct(&self) -> f64 {
        self.after_answer + self.after_right
    }

    /// The same, after a wrong answer.
    pub fn after_wrong(&self) -> f64 {
        self.after_answer - self.after_right
    }
}

/// The dependence of one participant's answers on the trial before. `sequences` are trials that followed each other, such as those of a session.
///
/// `None` with fewer than [`MIN_TRIALS`] trials after another one, and if the answers or what is right hardly vary, so that effects cannot be told apart.
pub fn sequential(sequences: &[Vec<Answered>]) -> Option<Sequential> {
    let strengths: Vec<f64> = sequences.iter().flatten().map(|t| t.strength).collect();
    let middle = mean(&strengths)?;
    let sign = |yes: bool| if yes { 0.5 } else { -0.5 };
    let rows: Vec<([f64; 5], f64)> = (sequences.iter())
        .flat_map(|own| own.windows(2))
        .map(|two| {
            let (before, now) = (&two[0], &two[1]);
            let right = sign(now.first_is_right);
            let predictors = [
                1.0,
                right,
                right * (now.strength - middle),
                sign(before.first),
                sign(before.first_is_right),
            ];
            (predictors, sign(now.first))
        })
        .collect();
    let n = rows.len();
    if n < MIN_TRIALS {
        return None;
    }
    // What does not vary says nothing, and has no coefficient.
    let size = strengths.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    let varies = strengths.iter().any(|x| (x - middle).abs() > 1e-9 * size);
    let used: &[usize] = if varies {
        &[0, 1, 2, 3, 4]
    } else {
        &[0, 1, 3, 4]
    };
    let column = |j: usize| rows.iter().map(|(x, _)| x[j]).collect::<Vec<f64>>();
    let columns: Vec<Vec<f64>> = used.iter().map(|j| column(*j)).collect();
    let answers: Vec<f64> = rows.iter().map(|(_, a)| *a).collect();
    let normal = SymmetricMatrix::from_fn(used.len(), |i, j| dot(&columns[i], &columns[j]));
    let factor = Cholesky::semidefinite(&normal, |_| 1e-9)?;
    if factor.rank() < used.len() {
        return None;
    }
    let right: Vec<f64> = columns.iter().map(|c| dot(c, &answers)).collect();
    let solved = factor.solve(&right);
    let before = used.len() - 2;
    // b = E[b] + (1 + 3b)/n.
    let n_real = n as f64;
    let after_answer = (n_real * solved[before] + 1.0) / (n_real - 3.0);
    // What the others are with that coefficient.
    let mut unit = vec![0.0; used.len()];
    unit[before] = 1.0;
    let column = factor.solve(&unit);
    let share = column[before + 1] / column[before];
    let after_right = solved[before + 1] + share * (after_answer - solved[before]);
    Some(Sequential {
        trials: n,
        after_answer: finite(after_answer)?,
        after_right: finite(after_right)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paired::one_sample;
    use crate::random::{RandomSource, SplitMix64};

    /// Answer, what is right, strength: trials of two sessions.
    const TRIALS: [&[(u8, u8, f64)]; 2] = [
        &[
            (1, 1, 0.9),
            (0, 0, 0.8),
            (0, 1, 0.5),
            (1, 1, 0.6),
            (1, 0, 0.4),
            (1, 1, 0.7),
            (0, 0, 0.7),
            (1, 0, 0.3),
            (0, 0, 0.6),
            (0, 1, 0.4),
            (1, 1, 0.5),
        ],
        &[
            (0, 0, 0.9),
            (1, 1, 0.6),
            (1, 1, 0.3),
            (0, 1, 0.2),
            (0, 0, 0.5),
            (0, 0, 0.4),
            (1, 0, 0.1),
            (1, 1, 0.4),
            (0, 0, 0.6),
            (1, 1, 0.5),
        ],
    ];

    fn trials(all: &[(u8, u8, f64)]) -> Vec<Answered> {
        let one = |&(answer, right, strength): &(u8, u8, f64)| Answered {
            first: answer == 1,
            first_is_right: right == 1,
            strength,
        };
        all.iter().map(one).collect()
    }

    /// numpy 2.4: `numpy.linalg.lstsq` over the trials after another one of the same session, then
    /// (n·b + 1)/(n − 3) and the others again beside that.
    #[test]
    fn the_coefficients_are_those_of_least_squares() {
        let found = sequential(&TRIALS.map(trials)).unwrap();
        assert_eq!(found.trials, 19);
        assert!(
            (found.after_answer - 0.474_920_493_873_351_4).abs() < 1e-12,
            "{found:?}"
        );
        assert!(
            (found.after_right - 0.249_123_459_904_312_56).abs() < 1e-12,
            "{found:?}"
        );
        let alike: Vec<Vec<Answered>> = TRIALS
            .iter()
            .map(|own| trials(&own.iter().map(|t| (t.0, t.1, 0.5)).collect::<Vec<_>>()))
            .collect();
        let found = sequential(&alike).unwrap();
        assert!(
            (found.after_answer - -0.026_245_551_601_423_43).abs() < 1e-12,
            "{found:?}"
        );
        assert!(
            (found.after_right - -0.091_750_359_293_731_02).abs() < 1e-12,
            "{found:?}"
        );
    }

    #[test]
    fn what_cannot_be_told_apart_has_no_effect() {
        let all: Vec<(u8, u8, f64)> = (0..40u8).map(|t| (1, t % 3 % 2, 0.5)).collect();
        assert_eq!(sequential(&[trials(&all)]), None);
        // Whoever is always right says what is right.
        let all: Vec<(u8, u8, f64)> = (0..40u8).map(|t| (t / 3 % 2, t / 3 % 2, 0.5)).collect();
        assert_eq!(sequential(&[trials(&all)]), None);
        let few: Vec<(u8, u8, f64)> = (0..15u8).map(|t| (t % 2, t / 2 % 2, 0.5)).collect();
        assert_eq!(sequential(&[trials(&few)]), None);
        assert_eq!(sequential(&[]), None);
    }

    /// Participants who say a word again with these probabilities more: after it was the answer, and after it was right.
    fn participant(seed: u64, n: usize, again: f64, right: f64) -> Option<Sequential> {
        let mut random = SplitMix64::new(seed);
        let mut unit = || random.below(1 << 40) as f64 / (1u64 << 40) as f64;
        let sign = |yes: bool| if yes { 0.5 } else { -0.5 };
        let mut all: Vec<Answered> = Vec::new();
        for _ in 0..n {
            let first_is_right = unit() < 0.5;
            let strength = unit();
            let mut share = 0.55 + 0.8 * strength * sign(first_is_right);
            if let Some(before) = all.last() {
                share += again * sign(before.first) + right * sign(before.first_is_right);
            }
            all.push(Answered {
                first: unit() < share,
                first_is_right,
                strength,
            });
        }
        sequential(&[all])
    }

    /// Biases that are planted are found, with the mean over many participants of few trials within four standard errors.
    #[test]
    fn planted_biases_are_found() {
        for (again, right, n) in [
            (0.0, 0.0, 40),
            (0.15, 0.0, 40),
            (-0.1, 0.1, 40),
            (0.1, -0.1, 120),
        ] {
            let found: Vec<Sequential> = (0..4000)
                .filter_map(|seed| participant(seed, n, again, right))
                .collect();
            for (what, expected) in [
                (
                    found.iter().map(|h| h.after_answer).collect::<Vec<_>>(),
                    again,
                ),
                (found.iter().map(|h| h.after_right).collect(), right),
                (
                    found.iter().map(Sequential::after_correct).collect(),
                    again + right,
                ),
            ] {
                let test = one_sample(&what).unwrap();
                let se = test.sd / (test.n as f64).sqrt();
                // The correction leaves what is of the order of 1/n².
                let allowed = 4.0 * se + 2.0 / (n * n) as f64;
                assert!(
                    (test.mean - expected).abs() < allowed,
                    "{} {expected} {se}",
                    test.mean
                );
            }
        }
    }
}
