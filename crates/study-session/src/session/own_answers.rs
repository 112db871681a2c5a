//! The answers that a part has of its own, such as "first": files have the word, people
//! read it in their language.

use super::Session;
use study_plan::protocol::phrases::Phrase;
use study_plan::protocol::{Answer, Question, Scale};

impl Session {
    /// Whether a question is the one with which each trial of a part begins, and its answers
    /// are words of this program. Labels are the study's own.
    fn is_of_part(&self, question: &Question) -> bool {
        let mut parts = self.protocol.parts.iter();
        parts.any(|part| {
            part.id.as_str() == question.id.as_str() && part.task.identification().is_none()
        })
    }

    fn in_words(&self, word: &str) -> String {
        let phrase = Phrase::of_answer(word);
        phrase
            .map_or(word, |phrase| self.words.get(phrase))
            .to_owned()
    }

    /// A question as it is shown.
    pub(super) fn shown(&self, question: &Question) -> Question {
        let mut shown = question.clone();
        if self.is_of_part(question) && matches!(shown.kind.scale(), Scale::Names { .. }) {
            for option in shown.kind.texts_mut() {
                *option = self.in_words(option);
            }
        }
        shown
    }

    /// An answer as it is shown.
    pub(super) fn shown_answer(&self, question: &Question, answer: &Answer) -> Answer {
        match answer {
            Answer::Choice(chosen) if self.is_of_part(question) => {
                Answer::Choice(chosen.iter().map(|word| self.in_words(word)).collect())
            }
            other => other.clone(),
        }
    }

    /// The answer that is recorded: the words of the files.
    pub(super) fn meant(&self, question: &Question, answer: Answer) -> Answer {
        let (Answer::Choice(chosen), Scale::Names { options, .. }) =
            (&answer, question.kind.scale())
        else {
            return answer;
        };
        if !self.is_of_part(question) {
            return answer;
        }
        let word = |given: &String| {
            let mut known = options.iter();
            let found = known.find(|option| self.in_words(option) == *given);
            found.unwrap_or(given).clone()
        };
        Answer::Choice(chosen.iter().map(word).collect())
    }
}
