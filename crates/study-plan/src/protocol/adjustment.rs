//! The method of adjustment: a level of a family is set until it feels equal to a standard, or as it should.

use serde::Serialize;
use study_base::text::{ModelId, PartId};

/// What the trials of a part set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adjustment {
    /// One of `[[families]]`.
    pub family: PartId,
    /// The realizations of all of its levels, the lowest first.
    pub models: Vec<ModelId>,
    /// What is felt first in each trial, and again as often as the participant wants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard: Option<ModelId>,
    /// Levels at which trials start that ascend.
    pub below: Vec<ModelId>,
    /// The same of trials that descend.
    pub above: Vec<ModelId>,
    /// Settings that start below, and as many that start above.
    pub repetitions: u32,
    /// Number of practice trials, whose starts are drawn.
    pub practice: u32,
    /// The just noticeable difference, in levels, if it is known. No step of the ladder is larger.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jnd: Option<f64>,
    /// What participants read.
    #[serde(skip)]
    pub words: AdjustmentWords,
}

/// What participants read while they set a level.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct AdjustmentWords {
    /// What a step down does.
    pub lower: String,
    /// What a step up does.
    pub higher: String,
    /// What confirms a setting.
    pub confirm: String,
}

/// What a participant does to the level that is felt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// A step down.
    Lower,
    /// A step up.
    Higher,
    /// Feels the standard again.
    Standard,
}

impl Adjustment {
    /// What is felt after a turn: never more than a step of the ladder away from the level before. `None` at the end of the
    /// ladder, and without a standard.
    pub fn turned(&self, level: &ModelId, turn: Turn) -> Option<&ModelId> {
        let step = || self.step(level);
        match turn {
            Turn::Lower => self.models.get(step()?.checked_sub(1)?),
            Turn::Higher => self.models.get(step()? + 1),
            Turn::Standard => self.standard.as_ref(),
        }
    }

    /// Whether settings that start at a level ascend.
    pub fn ascends_from(&self, start: &ModelId) -> bool {
        self.below.contains(start)
    }

    /// Number of steps between two levels.
    pub fn steps(&self, from: &ModelId, to: &ModelId) -> Option<usize> {
        Some(self.step(from)?.abs_diff(self.step(to)?))
    }

    /// About as many changes as a trial takes: from a start to the standard or, where that is no level, to the middle.
    pub fn usual_changes(&self) -> usize {
        let middle = self.models.get(self.models.len() / 2);
        let standard = self.standard.as_ref();
        let target = standard.filter(|s| self.step(s).is_some()).or(middle);
        let starts = self.below.iter().chain(&self.above);
        let all = starts.filter_map(|start| self.steps(start, target?));
        let (mut sum, mut n) = (0_usize, 0_usize);
        for steps in all {
            sum += steps;
            n += 1;
        }
        sum.checked_div(n).unwrap_or(0)
    }

    /// The place of a level in the ladder.
    fn step(&self, level: &ModelId) -> Option<usize> {
        self.models.iter().position(|m| m == level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_one_step() {
        let id = |n: usize| ModelId::new(format!("detent.{n}")).unwrap();
        let own = Adjustment {
            family: PartId::new("detent").unwrap(),
            models: (1..=5).map(id).collect(),
            standard: Some(id(3)),
            below: vec![id(1)],
            above: vec![id(4), id(5)],
            repetitions: 2,
            practice: 0,
            jnd: None,
            words: AdjustmentWords::default(),
        };
        assert_eq!(own.turned(&id(2), Turn::Higher), Some(&id(3)));
        assert_eq!(own.turned(&id(2), Turn::Lower), Some(&id(1)));
        assert_eq!(own.turned(&id(1), Turn::Lower), None);
        assert_eq!(own.turned(&id(5), Turn::Higher), None);
        assert_eq!(own.turned(&id(5), Turn::Standard), Some(&id(3)));
        assert_eq!(own.turned(&id(9), Turn::Higher), None);
        assert_eq!(own.steps(&id(5), &id(2)), Some(3));
        assert!(own.ascends_from(&id(1)) && !own.ascends_from(&id(4)));
        // From 1, 4 and 5 to 3: 2, 1 and 2 steps.
        assert_eq!(own.usual_changes(), 1);
    }
}
