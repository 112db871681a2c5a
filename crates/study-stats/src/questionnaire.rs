//! Scores of standard questionnaires.

use super::describe;

/// The score of the System Usability Scale from its ten answers, from 1 to 5, in their order:
/// 0 to 100 (Brooke 1996). Agreement counts for the odd items and against the even ones.
/// `None` if answers are missing or not on the scale.
///
/// ```
/// # use study_stats::questionnaire::sus;
/// assert_eq!(sus(&[5.0, 1.0, 5.0, 1.0, 5.0, 1.0, 5.0, 1.0, 5.0, 1.0]), Some(100.0));
/// assert_eq!(sus(&[3.0; 10]), Some(50.0));
/// ```
pub fn sus(answers: &[f64]) -> Option<f64> {
    if answers.len() != 10 || answers.iter().any(|a| !(1.0..=5.0).contains(a)) {
        return None;
    }
    let item = |(i, answer): (usize, &f64)| match i % 2 {
        0 => answer - 1.0,
        _ => 5.0 - answer,
    };
    Some(2.5 * answers.iter().enumerate().map(item).sum::<f64>())
}

/// The raw score of the NASA Task Load Index, without weights: the mean of its six ratings from
/// 0 to 100 (Hart 2006). `None` if ratings are missing or not on the scale.
pub fn raw_tlx(ratings: &[f64]) -> Option<f64> {
    if ratings.len() != 6 || ratings.iter().any(|r| !(0.0..=100.0).contains(r)) {
        return None;
    }
    describe::mean(ratings)
}

/// The score of the NASA Task Load Index with weights (Hart & Staveland 1988): the mean of its six ratings
/// from 0 to 100, each as often as its subscale was chosen in the comparisons of all 15 pairs. `chosen` has
/// the place of the chosen one, from 0. `None` if ratings or comparisons are missing or not on the scale.
pub fn weighted_tlx(ratings: &[f64], chosen: &[usize]) -> Option<f64> {
    raw_tlx(ratings)?;
    let each = |at: &usize| ratings.get(*at).copied();
    let weighted: Option<Vec<f64>> = chosen.iter().map(each).collect();
    describe::mean(&weighted?).filter(|_| chosen.len() == 15)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of Brooke (1996): a sum of 22, a score of 55.
    #[test]
    fn the_score_is_that_of_the_published_example() {
        let answers = [5.0, 4.0, 2.0, 1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 2.0];
        assert_eq!(sus(&answers), Some(55.0));
    }

    #[test]
    fn agreement_counts_against_every_second_item() {
        let best = [5.0, 1.0, 5.0, 1.0, 5.0, 1.0, 5.0, 1.0, 5.0, 1.0];
        assert_eq!(sus(&best), Some(100.0));
        assert_eq!(sus(&best.map(|a| 6.0 - a)), Some(0.0));
        assert_eq!(sus(&[3.0; 10]), Some(50.0));
        assert_eq!(sus(&[3.0; 9]), None);
        assert_eq!(sus(&[0.0; 10]), None);
    }

    #[test]
    fn the_raw_load_is_the_mean_of_six_ratings() {
        assert_eq!(
            raw_tlx(&[70.0, 20.0, 55.0, 30.0, 65.0, 15.0]),
            Some(255.0 / 6.0)
        );
        assert_eq!(raw_tlx(&[70.0, 20.0, 55.0, 30.0, 65.0]), None);
        assert_eq!(raw_tlx(&[101.0; 6]), None);
    }

    /// Who always prefers the earlier subscale gives the weights 5 to 0.
    #[test]
    fn the_weights_are_how_often_a_subscale_was_chosen() {
        let chosen = [0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 3, 3, 4];
        let ratings = [70.0, 20.0, 55.0, 30.0, 65.0, 15.0];
        let expected = (5.0 * 70.0 + 4.0 * 20.0 + 3.0 * 55.0 + 2.0 * 30.0 + 65.0) / 15.0;
        let found = weighted_tlx(&ratings, &chosen).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        assert_eq!(weighted_tlx(&[40.0; 6], &chosen), Some(40.0));
        assert_eq!(weighted_tlx(&ratings, &chosen[1..]), None);
        assert_eq!(weighted_tlx(&ratings[1..], &chosen), None);
        assert_eq!(weighted_tlx(&ratings, &[6; 15]), None);
    }
}
