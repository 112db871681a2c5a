//! Spaces of stimuli, and the parts that search in them: `study-protocol/3`.
//!
//! A *space* varies several things of one realization at once. Each *point* of its finite lattice is a realization of its
//! own, named after the space and the number of the point. A part of kind `search` presents two points in each trial, which
//! follow from the answers before it by [`crate::procedure::search`].

use super::parts::{Part, Task, Vary, named};
use super::{Protocol, Seat};
use crate::procedure::{Ladder, Lattice, ProcedureError, Search, SearchRule};
use serde::Serialize;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// One of `[[spaces]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceRules {
    /// Identifier of the space.
    pub id: PartId,
    /// Model file that is varied, relative to the protocol.
    pub from: String,
    /// What varies.
    pub axes: Vec<Axis>,
    /// Its points. Which of them can be presented is known once the model file has been read; before, all of them are
    /// certified here.
    pub lattice: Lattice,
}

/// An axis of a space.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// What varies.
    pub vary: Vary,
    /// Its levels.
    pub levels: Ladder,
}

/// A part that searches for the best point of a space.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchTask {
    /// One of `[[spaces]]`.
    pub space: PartId,
    /// Which points come next, and for how many trials.
    pub rule: SearchRule,
}

impl SpaceRules {
    /// Leaves only those points certified for which `good` says so, by their steps along the axes.
    ///
    /// # Errors
    /// [`ProcedureError`] if fewer than two are left; the lattice stays as it was.
    pub fn certify(&mut self, good: impl Fn(&[usize]) -> bool) -> Result<(), ProcedureError> {
        self.lattice = Lattice::new(self.lattice.steps().to_vec(), good)?;
        Ok(())
    }

    /// The realization of a point, from 0.
    pub fn realization(&self, point: usize) -> ModelId {
        named(&self.id, &(point + 1).to_string())
    }

    /// The point that a realization is, if it is one.
    pub fn point_of(&self, model: &ModelId) -> Option<usize> {
        let rest = model.as_str().strip_prefix(self.id.as_str())?;
        let number: usize = rest.strip_prefix('.')?.parse().ok()?;
        let point = number.checked_sub(1)?;
        (point < self.lattice.len()).then_some(point)
    }

    /// The level of each axis at a point.
    pub fn levels(&self, point: usize) -> Vec<f64> {
        let steps = self.lattice.at(point).into_iter();
        let pairs = steps.zip(&self.axes);
        pairs.map(|(step, axis)| axis.levels.level(step)).collect()
    }
}

impl Protocol {
    /// A space by its id.
    pub fn space(&self, id: &PartId) -> Option<&SpaceRules> {
        self.spaces.iter().find(|space| space.id == *id)
    }

    /// What a part searches for, and where; `None` of other kinds of parts.
    pub fn searched(&self, part: &Part) -> Option<(&SpaceRules, SearchRule)> {
        let Task::Search(task) = &part.task else {
            return None;
        };
        Some((self.space(&task.space)?, task.rule))
    }

    /// The search of a part before its first trial; `None` of other kinds of parts.
    ///
    /// # Errors
    /// [`ProcedureError`] if its rule is no rule; those of a protocol are.
    pub fn start_search(&self, part: &Part, seat: Seat) -> Option<Result<Search, ProcedureError>> {
        let (space, rule) = self.searched(part)?;
        let number = seat.number().to_string();
        let path = ["search", part.id.as_str(), seat.stream(), &number];
        let mut stream = Stream::new(self.study.seed, &path);
        Some(Search::new(&rule, &space.lattice, &mut stream))
    }
}

#[cfg(test)]
mod tests {
    use crate::protocol::{Seat, file};
    use study_base::text::{ModelId, PartId};

    const SEARCH: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "best" }

[[spaces]]
id = "switch"
from = "a.toml"
axes = { friction = [0.0, 1.5], detent = [0.5, 1.5] }
grid = 3

[[parts]]
id = "best"
kind = "search"
prompt = "Which?"
space = "switch"
rule = { name = "preference-gp", trials = 10, start = 4 }
"#;

    #[test]
    fn a_point_has_a_realization_and_levels() {
        let parsed = file::parse("p", SEARCH);
        let shown = parsed.findings.render(false);
        let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
        let space = protocol.space(&PartId::new("switch").unwrap()).unwrap();
        assert_eq!(space.lattice.steps(), [3, 3]);
        assert_eq!(space.realization(5).as_str(), "switch.6");
        assert_eq!(space.point_of(&space.realization(5)), Some(5));
        // detent 1, friction 1.5: axes do not have the order of the file
        assert_eq!(space.levels(5), [1.0, 1.5]);
        for other in ["switch.0", "switch.10", "switch.x", "other.1"] {
            let id = ModelId::new(other).unwrap();
            assert_eq!(space.point_of(&id), None, "{other}");
        }
    }

    /// Each seat has a shift of its own.
    #[test]
    fn seats_begin_with_other_pairs() {
        let protocol = file::parse("p", SEARCH).protocol.unwrap();
        let first = |seat| {
            let search = protocol.start_search(&protocol.parts[0], seat);
            search.unwrap().unwrap().next().unwrap()
        };
        let pairs = [
            Seat::Row(1),
            Seat::Row(2),
            Seat::Pilot(1),
            Seat::Simulated(1),
        ]
        .map(first);
        assert!(pairs.iter().any(|pair| *pair != pairs[0]), "{pairs:?}");
        assert_eq!(first(Seat::Row(1)), pairs[0]);
    }
}
