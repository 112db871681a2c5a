//! Design and seat to a whole, frozen order of trials.
//!
//! Stand-in until the real module is merged: blocked orders only.

use crate::protocol::{Design, FileOrders, Protocol, Seat, Trial};
use crate::rng::Stream;
use crate::text::ModelId;
use std::collections::BTreeMap;

/// Why there is no order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the design has nothing to play")]
pub struct ScheduleError;

/// The order of a seat.
///
/// # Errors
/// [`ScheduleError`] if there is nothing to play.
pub fn plan(
    protocol: &Protocol,
    _orders: Option<&FileOrders>,
    seat: Seat,
) -> Result<Vec<Trial>, ScheduleError> {
    let mut trials: Vec<Trial> = Vec::new();
    for (i, model) in protocol.design.practice.iter().enumerate() {
        let number = i as u32 + 1;
        trials.push(Trial {
            trial: number,
            block: 0,
            position: number,
            model: model.clone(),
            repetition: 0,
            practice: true,
        });
    }
    let number = seat.number().to_string();
    let mut stream = Stream::new(protocol.study.seed, &["order", seat.stream(), &number]);
    let mut models: Vec<ModelId> = protocol.scheduled_models().map(|m| m.id.clone()).collect();
    if models.is_empty() {
        return Err(ScheduleError);
    }
    let mut times: BTreeMap<ModelId, u32> = BTreeMap::new();
    let mut position = 0;
    for block in 1..=protocol.design.repetitions {
        stream.shuffle(&mut models);
        for model in &models {
            position += 1;
            let times = times.entry(model.clone()).or_default();
            *times += 1;
            trials.push(Trial {
                trial: trials.len() as u32 + 1,
                block,
                position,
                model: model.clone(),
                repetition: *times,
                practice: false,
            });
        }
    }
    Ok(trials)
}

/// What is still to come after a failed attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requeued {
    /// First the next.
    pub queue: Vec<Trial>,
    /// Whether `max_run` or `min_distance` is broken by it.
    pub constraint_broken: bool,
}

/// Puts a failed trial back, at the end of its block.
pub fn requeue(felt: &[&Trial], rest: &[Trial], failed: &Trial, design: &Design) -> Requeued {
    let place = rest
        .iter()
        .rposition(|t| t.block == failed.block)
        .map_or(0, |last| last + 1);
    let mut queue = rest.to_vec();
    queue.insert(place, failed.clone());
    let run = design.max_run.is_some_and(|max| {
        let all: Vec<_> = felt
            .iter()
            .copied()
            .chain(&queue)
            .map(|t| &t.model)
            .collect();
        let index = felt.len() + place;
        let before = all[..index]
            .iter()
            .rev()
            .take_while(|m| **m == &failed.model);
        let after = all[index + 1..].iter().take_while(|m| **m == &failed.model);
        before.count() + after.count() + 1 > max as usize
    });
    Requeued {
        queue,
        constraint_broken: run,
    }
}
