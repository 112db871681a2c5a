//! The trials of a part that searches: only which of the two points comes first is drawn before the session.

use super::Planned;
use super::pairs::interval_stream;
use crate::protocol::{SearchTask, Seat, Stimuli};
use study_base::text::PartId;

/// Makes the orders of a part that searches.
#[derive(Debug)]
pub(super) struct SearchOrders {
    seed: u64,
    part: PartId,
    task: SearchTask,
}

impl SearchOrders {
    pub(super) fn new(seed: u64, part: &PartId, task: &SearchTask) -> Self {
        Self {
            seed,
            part: part.clone(),
            task: task.clone(),
        }
    }

    /// The trials of a seat. The order of each two intervals is drawn for itself, so that nobody can guess it.
    pub(super) fn plan(&self, seat: Seat) -> Vec<Planned> {
        let mut drawn = interval_stream(self.seed, &self.part, seat);
        (1..=self.task.rule.trials)
            .map(|trial| Planned {
                block: 1,
                stimuli: Stimuli::Search {
                    space: self.task.space.clone(),
                    swapped: drawn.below(2) == 1,
                },
                repetition: trial,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedure::{Choose, SearchRule};

    #[test]
    fn either_point_comes_first_in_half_of_the_trials() {
        let task = SearchTask {
            space: PartId::new("s").unwrap(),
            rule: SearchRule {
                choose: Choose::Sobol,
                trials: 40,
            },
        };
        let orders = SearchOrders::new(7, &PartId::new("p").unwrap(), &task);
        let mut swaps = 0;
        for row in 1..=100 {
            let planned = orders.plan(Seat::Row(row));
            assert_eq!(planned.len(), 40);
            assert_eq!(planned[39].repetition, 40);
            let swapped = |p: &&Planned| matches!(p.stimuli, Stimuli::Search { swapped: true, .. });
            swaps += planned.iter().filter(swapped).count();
        }
        // four standard errors of 4000 draws
        assert!((1874..=2126).contains(&swaps), "{swaps}");
    }
}
