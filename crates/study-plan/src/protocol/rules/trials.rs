//! What a rule sees of ratings and of the trials of a part.

use crate::protocol::Answer;
use study_stats::describe::mean;

/// The trials that the rules judge. Participants and realizations are indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Trials<'a> {
    /// What the answers are.
    pub answers: Answers,
    /// Whether they are those of one part, not of a whole design.
    pub of_a_part: bool,
    /// Number of participants.
    pub participants: usize,
    /// Realizations.
    pub realizations: Vec<Realization>,
    /// In any order.
    pub trials: Vec<Trial<'a>>,
}

/// What the answers to a question are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answers {
    /// Points of a scale.
    Points,
    /// Something chosen.
    Choices,
    /// Answers to another question than the primary one, which no rule judges.
    Secondary,
}

/// A realization of the trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Realization {
    /// Whether it is a hidden reference.
    pub hidden_reference: bool,
    /// The realization of which it is a hidden duplicate.
    pub duplicate_of: Option<usize>,
}

/// A trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial<'a> {
    /// Who answered.
    pub participant: usize,
    /// The realization, if it is one.
    pub realization: Option<usize>,
    /// The answer, if there is one.
    pub answer: Option<Given<'a>>,
    /// Full strokes, where they were counted; the fewest of several intervals.
    pub strokes: Option<u32>,
    /// Whether the force was that of the table, if it was judged.
    pub force: Option<Force>,
}

const SECONDARY: &str = "it applies to the primary question, which this is not";

/// An answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Given<'a> {
    /// A number.
    Number(f64),
    /// Something else.
    Other(&'a Answer),
}

/// Whether the force of a trial was that of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Force {
    /// It was.
    Right,
    /// This could not be shown.
    Unverified,
    /// It was not.
    Wrong,
}

/// Which trials a rule excludes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Judgement {
    /// Whether each trial is excluded.
    pub excluded: Vec<bool>,
    /// Why it could not judge all trials.
    pub problem: Option<&'static str>,
}

impl<'a> Given<'a> {
    /// A number if the answer is one.
    pub fn of(answer: &'a Answer) -> Self {
        answer.number().map_or(Self::Other(answer), Self::Number)
    }
}

impl Trial<'_> {
    /// The answer, if it is a number.
    pub(super) fn number(&self) -> Option<f64> {
        match self.answer? {
            Given::Number(number) => Some(number),
            Given::Other(_) => None,
        }
    }
}

impl<'a> Trials<'a> {
    /// The trials of each participant.
    pub(super) fn by_participant(&self) -> impl Iterator<Item = Vec<&Trial<'a>>> {
        let mut each = vec![Vec::new(); self.participants];
        for trial in &self.trials {
            each[trial.participant].push(trial);
        }
        each.into_iter()
    }

    /// The trials of participants of whom something is true of their trials.
    ///
    /// # Errors
    /// If the answers are not those that the rules are about.
    pub(super) fn of_participants(
        &self,
        excluded: impl Fn(&[&Trial<'a>]) -> bool,
    ) -> Result<Judgement, &'static str> {
        if self.answers == Answers::Secondary {
            return Err(SECONDARY);
        }
        let gone: Vec<bool> = self.by_participant().map(|own| excluded(&own)).collect();
        Ok(Judgement {
            excluded: self.trials.iter().map(|t| gone[t.participant]).collect(),
            problem: None,
        })
    }

    /// The trials of which something is true, where that is known; `problem` says that of
    /// some it is not.
    pub(super) fn one_by_one(
        &self,
        excluded: impl Fn(&Trial<'a>) -> Option<bool>,
        problem: &'static str,
    ) -> Judgement {
        let known: Vec<Option<bool>> = self.trials.iter().map(excluded).collect();
        Judgement {
            problem: known.contains(&None).then_some(problem),
            excluded: known.iter().map(|known| known == &Some(true)).collect(),
        }
    }

    /// The trials whose force is one of those that are excluded.
    pub(super) fn by_force(&self, excluded: impl Fn(Force) -> bool) -> Judgement {
        self.one_by_one(
            |trial| trial.force.map(&excluded),
            "the force of some trials was not judged; these trials stay",
        )
    }

    /// Refuses answers that are not points of the primary scale.
    pub(super) fn need_points(&self) -> Result<(), &'static str> {
        match self.answers {
            Answers::Points => Ok(()),
            Answers::Choices => Err("the answers of this part are choices, not points of a scale"),
            Answers::Secondary => Err(SECONDARY),
        }
    }
}

/// The mean of the numbers, whatever their order; `None` of none.
pub(super) fn mean_of_set(numbers: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = numbers.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    mean(&sorted)
}
