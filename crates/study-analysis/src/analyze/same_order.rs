//! Whether everybody felt the realizations in the same order.

use super::adjusted::MAX_COMPARED;
use super::cells::Cells;

/// Below this chance the orders were not drawn at random.
pub(super) const LEAST_CHANCE: f64 = 0.01;

/// With orders drawn at random, the chance that every later block of a participant has its realizations in
/// the order in which blocks before it had them. `None` if the orders differ or are not known, if there is one
/// block only, or above [`MAX_COMPARED`] realizations. A block is the trials of one participant in one repetition.
pub(super) fn chance(cells: &Cells<'_>) -> Option<f64> {
    let r = cells.ratings;
    let tested = cells.tested();
    let (k, columns) = (tested.len(), cells.columns(&tested));
    if k > MAX_COMPARED {
        return None;
    }
    // Participant, repetition, position, realization
    let mut trials: Vec<(u32, u32, u32, usize)> = (cells.order.iter())
        .filter_map(|&i| {
            let model = columns[r.model[i]? as usize]?;
            Some((r.subject[i], r.repetition[i], r.trial_index[i]?, model))
        })
        .collect();
    trials.sort_unstable();
    let (mut known, mut before) = (vec![false; k], vec![false; k * k]);
    let mut logarithm = 0.0;
    for block in trials.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let again = block.iter().filter(|trial| known[trial.3]);
        logarithm -= (2..=again.count()).map(|n| (n as f64).ln()).sum::<f64>();
        for (i, first) in block.iter().enumerate() {
            for second in &block[i + 1..] {
                let unclear = first.2 == second.2 || first.3 == second.3;
                if unclear || before[second.3 * k + first.3] {
                    return None;
                }
                before[first.3 * k + second.3] = true;
            }
        }
        block.iter().for_each(|trial| known[trial.3] = true);
    }
    (logarithm < 0.0).then(|| logarithm.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_session::outcome::ratings::Ratings;

    /// The chance of some blocks of a table.
    fn of(blocks: &[(&str, &str)]) -> Option<f64> {
        let mut table = String::from("subject,model,rating,trial_index\n");
        let mut last = "";
        let mut trial = 0;
        for (i, (subject, order)) in blocks.iter().enumerate() {
            trial = if *subject == last { trial } else { 0 };
            last = subject;
            for model in order.chars() {
                trial += 1;
                table += &format!("{subject},{model},{},{trial}\n", 1 + i % 7);
            }
        }
        let ratings = Ratings::read_csv("t.csv", table.as_bytes(), None).unwrap();
        chance(&Cells::of(&ratings))
    }

    #[test]
    fn one_order_of_everybody_has_a_chance_and_two_orders_have_none() {
        // two more blocks of three: 1/6²
        let three = of(&[("P1", "bac"), ("P2", "bac"), ("P3", "bac")]).unwrap();
        assert!((three - 1.0 / 36.0).abs() < 1e-12, "{three}");
        assert_eq!(of(&[("P1", "bac"), ("P2", "bac"), ("P3", "bca")]), None);
        assert_eq!(of(&[("P1", "bac")]), None);
        // one of three was felt before, so that its place says nothing
        assert_eq!(of(&[("P1", "ab"), ("P2", "bcd")]), None);
        // two of three
        let two = of(&[("P1", "abc"), ("P2", "bcd")]).unwrap();
        assert!((two - 0.5).abs() < 1e-12, "{two}");
        // the second block of a participant counts as well
        let again = of(&[("P1", "ab"), ("P1", "ab"), ("P1", "ab")]).unwrap();
        assert!((again - 0.25).abs() < 1e-12, "{again}");
    }
}
