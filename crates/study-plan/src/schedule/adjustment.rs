//! The trials of a part of adjustment: from which side, and at which level, each one starts.

use super::Planned;
use crate::protocol::{Adjustment, Seat, Stimuli};
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// Makes the orders of a part of adjustment.
#[derive(Debug)]
pub(super) struct AdjustmentOrders {
    seed: u64,
    part: PartId,
    task: Adjustment,
}

impl AdjustmentOrders {
    pub(super) fn new(seed: u64, part: &PartId, task: &Adjustment) -> Self {
        Self {
            seed,
            part: part.clone(),
            task: task.clone(),
        }
    }

    /// The trials of a seat: in each two, one from below and one from above, in random order.
    pub(super) fn plan(&self, seat: Seat) -> Vec<Planned> {
        let mut stream = stream(self.seed, &self.part, "starts", seat);
        let n = self.task.repetitions as usize;
        let below = drawn(&mut stream, &self.task.below, n);
        let above = drawn(&mut stream, &self.task.above, n);
        let mut trials = Vec::with_capacity(2 * n);
        for (repetition, (low, high)) in (1..).zip(below.into_iter().zip(above)) {
            let two = match stream.below(2) {
                0 => [low, high],
                _ => [high, low],
            };
            trials.extend(two.map(|start| Planned {
                block: repetition,
                stimuli: from(&self.task, start),
                repetition,
            }));
        }
        trials
    }
}

/// The practice trials: from below and from above in turn, the first one drawn.
pub(super) fn practiced(seed: u64, part: &PartId, own: &Adjustment, seat: Seat) -> Vec<Stimuli> {
    let mut stream = stream(seed, part, "practice", seat);
    let n = own.practice as usize;
    let below = drawn(&mut stream, &own.below, n);
    let above = drawn(&mut stream, &own.above, n);
    let first = stream.below(2) as usize;
    let both = below.into_iter().zip(above).enumerate();
    both.map(|(at, (low, high))| match (at + first) % 2 {
        0 => from(own, low),
        _ => from(own, high),
    })
    .collect()
}

fn from(own: &Adjustment, start: ModelId) -> Stimuli {
    Stimuli::Adjusted {
        start,
        standard: own.standard.clone(),
    }
}

fn stream(seed: u64, part: &PartId, of: &str, seat: Seat) -> Stream {
    let number = seat.number().to_string();
    let path = [
        "schedule",
        "part",
        part.as_str(),
        of,
        seat.stream(),
        &number,
    ];
    Stream::new(seed, &path)
}

/// So many levels, drawn without replacement until all have come.
fn drawn(stream: &mut Stream, levels: &[ModelId], n: usize) -> Vec<ModelId> {
    let mut all = Vec::new();
    while all.len() < n && !levels.is_empty() {
        let mut once = levels.to_vec();
        stream.shuffle(&mut once);
        all.extend(once);
    }
    all.truncate(n);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::AdjustmentWords;
    use std::collections::BTreeMap;

    fn task() -> Adjustment {
        let id = |n: usize| ModelId::new(format!("f.{n}")).unwrap();
        Adjustment {
            family: PartId::new("f").unwrap(),
            models: (1..=9).map(id).collect(),
            standard: Some(id(5)),
            below: vec![id(1), id(2)],
            above: vec![id(8), id(9)],
            repetitions: 4,
            practice: 3,
            jnd: None,
            words: AdjustmentWords::default(),
        }
    }

    fn start(stimuli: &Stimuli) -> &str {
        match stimuli {
            Stimuli::Adjusted { start, standard } => {
                assert_eq!(standard.as_ref().map(ModelId::as_str), Some("f.5"));
                start.as_str()
            }
            other => panic!("{other:?}"),
        }
    }

    /// Each two trials have both sides, each start comes equally often, and neither can be guessed.
    #[test]
    fn starts_are_balanced_and_random() {
        let part = PartId::new("p").unwrap();
        let orders = AdjustmentOrders::new(7, &part, &task());
        let mut first_below = 0;
        for row in 1..=400 {
            let planned = orders.plan(Seat::Row(row));
            assert_eq!(planned.len(), 8);
            let mut times: BTreeMap<&str, u32> = BTreeMap::new();
            for (at, trial) in planned.iter().enumerate() {
                *times.entry(start(&trial.stimuli)).or_default() += 1;
                let place = at as u32 / 2 + 1;
                assert_eq!((trial.block, trial.repetition), (place, place));
            }
            assert!(times.values().all(|n| *n == 2) && times.len() == 4);
            for two in planned.chunks(2) {
                let low = |at: usize| start(&two[at].stimuli) < "f.5";
                assert_ne!(low(0), low(1));
                first_below += u32::from(low(0));
            }
        }
        // four standard errors of 1600 draws
        assert!((720..=880).contains(&first_below), "{first_below}");
    }

    #[test]
    fn practice_alternates() {
        let part = PartId::new("p").unwrap();
        for row in 1..=20 {
            let practice = practiced(7, &part, &task(), Seat::Row(row));
            let low: Vec<bool> = practice.iter().map(|s| start(s) < "f.5").collect();
            assert_eq!(low.len(), 3);
            assert!(low[0] != low[1] && low[1] != low[2]);
        }
    }
}
