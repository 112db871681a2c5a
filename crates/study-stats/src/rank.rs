//! Ranks with ties.

use super::describe::rounded;

/// Mid-ranks, from 1: numbers that agree to 10⁻¹⁰ share the mean of their ranks.
///
/// ```
/// # use study_stats::rank::mid_ranks;
/// assert_eq!(mid_ranks(&[3.0, 1.0, 3.0, 7.0]), [2.5, 1.0, 2.5, 4.0]);
/// ```
pub fn mid_ranks(x: &[f64]) -> Vec<f64> {
    doubled_ranks(x).iter().map(|&r| r as f64 / 2.0).collect()
}

/// Twice the mid-ranks, which are whole numbers, so that sums are exact.
pub fn doubled_ranks(x: &[f64]) -> Vec<i64> {
    let mut order: Vec<(f64, usize)> = x.iter().map(|&v| rounded(v)).zip(0..).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut ranks = vec![0; x.len()];
    let mut start = 0;
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        let end = start + group.len();
        // Ranks start+1 … end have the mean (start + 1 + end)/2.
        for (_, i) in group {
            ranks[*i] = (start + 1 + end) as i64;
        }
        start = end;
    }
    ranks
}

/// Σ(t³ − t) over the groups of t tied numbers; 0 without ties.
pub fn tie_term(x: &[f64]) -> f64 {
    tie_term_of_ranks(&doubled_ranks(x))
}

/// [`tie_term`] from [`doubled_ranks`].
pub fn tie_term_of_ranks(ranks: &[i64]) -> f64 {
    let mut ranks = ranks.to_vec();
    ranks.sort_unstable();
    ranks
        .chunk_by(|a, b| a == b)
        .map(|group| {
            let t = group.len() as f64;
            t * t * t - t
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_numbers_share_their_mean_rank() {
        assert_eq!(mid_ranks(&[3.0, 1.0, 3.0, 2.0]), [3.5, 1.0, 3.5, 2.0]);
        assert_eq!(tie_term(&[3.0, 1.0, 3.0, 2.0]), 6.0);
    }

    #[test]
    fn numbers_that_differ_by_rounding_are_tied() {
        let a = 1.0 / 3.0 + 1.0 / 3.0 + 1.0 / 3.0 + 4.0;
        let b = 0.1 + 0.2 + 4.7;
        assert_eq!(mid_ranks(&[a, b]), [1.5, 1.5]);
    }
}
