//! `[[questions]]`, `[[setup]]`, `[[intake]]`, `[[outro]]`: the same kinds in each.

use crate::protocol::control::Control;
use crate::protocol::keys::{Id, Kind, Variants, keys};
use crate::protocol::kinds::{READERS, SHAPES};
use crate::protocol::section::Section;
use crate::protocol::{Question, QuestionKind};
use study_base::text::QuestionId;

pub(super) static QUESTIONS: Variants = Variants {
    tag: "kind",
    effect: "The kind of answer",
    common: keys! {
        /// The name of the question and of its column in the results.
        "id": Kind::Id(Id::Question), r#""realism""#, required;
        /// What is asked, in any language.
        "prompt": Kind::Text, r#""How realistic did it feel?""#, required;
        /// Whether an answer is needed. "Declined", with a reason, is always an answer.
        "required": Kind::Flag, "false", derived("`false` for a text, else `true`");
    },
    shapes: &SHAPES,
};

/// A question that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialQuestion {
    /// Such as `questions[0]`.
    pub(super) path: String,
    pub(super) id: Option<QuestionId>,
    pub(super) kind: Option<QuestionKind>,
    prompt: Option<String>,
    required: Option<bool>,
}

impl PartialQuestion {
    /// A required question that another section states.
    pub(super) fn made(path: &str, id: &str, prompt: &str, kind: QuestionKind) -> Self {
        Self {
            path: path.to_owned(),
            id: QuestionId::new(id).ok(),
            kind: Some(kind),
            prompt: Some(prompt.to_owned()),
            required: Some(true),
        }
    }

    /// The question, if every part could be read.
    pub(super) fn finish(self) -> Option<Question> {
        let kind = self.kind?;
        let required = self.required.unwrap_or(kind.control() != Control::Text);
        Some(Question {
            id: self.id?,
            prompt: self.prompt?,
            kind,
            required,
        })
    }
}

/// All questions of an array.
pub(super) fn read(root: &mut Section<'_, '_>, name: &str) -> Vec<PartialQuestion> {
    (root.variants(name, &READERS).into_iter())
        .map(|(mut section, kind)| PartialQuestion {
            path: section.path().to_owned(),
            id: section.question_id("id"),
            prompt: section.text("prompt"),
            required: section.flag("required"),
            kind: kind.and_then(|kind| (kind.read)(&mut section)),
        })
        .collect()
}
