//! Which rules of order apply to the trials of a part.

use super::{Design, OrderVersion, Protocol, Task};
use study_base::text::PartId;

impl Protocol {
    /// The rules of order that apply to the trials of a part: its own, or `[design]`'s
    /// without parts.
    pub fn design_of(&self, part: Option<&PartId>) -> Design {
        let mut design = self.design.clone();
        let task = part.and_then(|id| self.part(id)).map(|part| &part.task);
        match (task, task.and_then(Task::presentations)) {
            (None, _) => {}
            (_, Some(own)) => {
                design.repetitions = own.repetitions;
                design.order = own.order.clone();
                design.max_run = own.max_run;
                design.min_distance = own.min_distance;
                design.practice.clone_from(&own.practice);
            }
            (Some(Task::Pairs(own)), _) => {
                design.repetitions = own.repetitions;
                design.order = own.order.clone();
                (design.max_run, design.min_distance) = (None, None);
                design.practice.clear();
            }
            (Some(Task::Similarity(own)), _) => {
                design.repetitions = own.repetitions;
                design.order = own.order.clone();
                (design.max_run, design.min_distance) = (None, None);
                design.practice.clear();
                // No study has orders of an older version.
                design.order_version = OrderVersion::Unguessable;
            }
            (Some(Task::Ranking(own)), _) => {
                design.repetitions = own.repetitions;
                design.order = own.order.clone();
                (design.max_run, design.min_distance) = (None, None);
                design.practice.clear();
            }
            (Some(_), None) => {
                (design.max_run, design.min_distance) = (None, None);
                design.practice.clear();
            }
        }
        design
    }
}
