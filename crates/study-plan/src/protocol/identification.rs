//! Identification: which of several labels belongs to what is felt.

use super::keys::words;
use super::{Answer, Presentations, Protocol};
use serde::Serialize;
use study_base::text::ModelId;

/// What the trials of a part present, and the labels by which it is named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// The labels, in their order on the page: at least two, no two alike.
    pub labels: Vec<Label>,
    /// When the participant is told whether the answer was correct, and which label was.
    pub feedback: Feedback,
    /// When practice ends; `None`: after its trials as they are listed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criterion: Option<Criterion>,
    /// The realizations, each of which has one label.
    #[serde(flatten)]
    pub presentations: Presentations,
}

/// An answer, and the realizations of which it is the right one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Label {
    /// What the participant reads, and what is recorded.
    pub text: String,
    /// Its realizations, levels of a family among them; at least one.
    pub models: Vec<ModelId>,
}

/// When a participant has practiced enough: so many of the last answers are correct.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Criterion {
    /// Correct answers.
    pub correct: u32,
    /// The last answers among which they are counted.
    pub of: u32,
    /// How often the practice trials come at most.
    pub rounds: u32,
    /// How they are drawn. Absent from documents and fingerprints if it is in rounds.
    #[serde(skip_serializing_if = "Drawn::is_in_rounds")]
    pub draw: Drawn,
}

words! {
    /// How the practice trials before a criterion are drawn.
    Drawn {
        /// In rounds, in each of which every practice trial comes once, in an order that is drawn. Whoever is told the
        /// right labels can count out which are left.
        Rounds = "rounds",
        /// Each on its own, all of `practice` being as likely whatever came before.
        Independent = "independent",
    }
}

impl Drawn {
    fn is_in_rounds(&self) -> bool {
        *self == Self::Rounds
    }
}

impl Criterion {
    /// Whether it is reached by these answers, of which some are correct.
    pub fn is_reached(self, answers: &[bool]) -> bool {
        let last = answers.len().checked_sub(self.of as usize);
        let correct = last.map(|from| answers[from..].iter().filter(|c| **c).count());
        correct.is_some_and(|correct| correct >= self.correct as usize)
    }
}

words! {
    /// When a participant is told whether the answer was correct.
    Feedback {
        /// After each practice trial, so that the labels can be learned.
        Practice = "practice",
        /// After each trial. Whoever counts then knows which labels are left in a block.
        Always = "always",
        /// Not at all.
        Never = "never",
    }
}

/// Fewest answers for each cell of a confusion matrix that need no warning (Miller 1955).
const ANSWERS_OF_A_CELL: usize = 5;

impl Identification {
    /// What so many answers of all participants are too few for.
    pub fn too_few(&self, answers: usize) -> Option<String> {
        let labels = self.labels.len();
        let needed = ANSWERS_OF_A_CELL * labels * labels;
        (answers < needed).then(|| {
            format!(
                "{answers} answers among {labels} labels are fewer than {needed}, {ANSWERS_OF_A_CELL} for each cell of the \
                 confusion matrix: information transfer is uncertain, although its bias is corrected"
            )
        })
    }

    /// The label of a realization.
    pub fn label_of(&self, model: &ModelId) -> Option<&str> {
        let label = self.labels.iter().find(|l| l.models.contains(model));
        label.map(|l| l.text.as_str())
    }

    /// Whether an answer is the label of a realization; `None` if it was declined, or the
    /// realization has no label.
    pub fn is_correct(&self, model: &ModelId, answer: &Answer) -> Option<bool> {
        let (Answer::Choice(chosen), Some(label)) = (answer, self.label_of(model)) else {
            return None;
        };
        chosen.first().map(|given| given == label)
    }

    /// Whether the answer to a trial is followed by the correct one.
    pub fn tells(&self, practice: bool) -> bool {
        match self.feedback {
            Feedback::Practice => practice,
            Feedback::Always => true,
            Feedback::Never => false,
        }
    }
}

impl Protocol {
    /// Whether the number of practice trials depends on the answers.
    pub fn practices_to_a_criterion(&self) -> bool {
        let mut named = self.parts.iter().filter_map(|p| p.task.identification());
        named.any(|own| own.criterion.is_some())
    }
}
