//! Questions, and which answers they accept.

use super::answer::{Answer, Given, MAX_TEXT_BYTES, Refusal};
use super::kinds::QuestionKind;
use serde::Serialize;
use study_base::text::QuestionId;

/// A question to a participant or an experimenter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Question {
    /// Its name, also of its column in `ratings.csv` or `participants.csv`.
    pub id: QuestionId,
    /// The text of the question, in any language.
    pub prompt: String,
    /// Which answers are possible.
    pub kind: QuestionKind,
    /// Whether an answer is required; by default for every kind but text.
    /// Declining, with a reason, is always possible.
    pub required: bool,
}

impl Question {
    /// The answer that somebody gives on any channel; `None` if it is left empty.
    ///
    /// ```
    /// use study_plan::protocol::{Answer, Given, example};
    ///
    /// let realism = &example::protocol(2, 1).questions[0];
    /// let given = Given::Typed(" 5 ".to_owned());
    /// assert_eq!(realism.read(Some(&given)), Ok(Some(Answer::Rating(5))));
    /// let refused = realism.read(None).unwrap_err();
    /// assert_eq!(refused.to_string(), "Choose a number from 1 to 7 first.");
    /// ```
    ///
    /// # Errors
    /// [`Refusal`] if it is no answer, or is missing where it is required.
    pub fn read(&self, given: Option<&Given>) -> Result<Option<Answer>, Refusal> {
        let control = self.kind.control();
        let Some(given) = given.filter(|given| !given.is_empty()) else {
            return match self.required {
                true => Err(control.needed()),
                false => Ok(None),
            };
        };
        let answer = control.read(given)?;
        self.accepts(&answer)?;
        Ok(Some(answer))
    }

    /// Checks an answer against the question.
    ///
    /// # Errors
    /// [`Refusal`] if the answer is not accepted.
    pub fn accepts(&self, answer: &Answer) -> Result<(), Refusal> {
        match answer {
            Answer::Declined { reason } if reason.trim().is_empty() => Err(Refusal::NoReason),
            Answer::Declined { reason } if reason.len() > MAX_TEXT_BYTES => Err(Refusal::TooLong),
            Answer::Declined { .. } => Ok(()),
            answer => self.kind.accepts(answer, self.required),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::kinds;
    use std::collections::BTreeMap;

    fn question(kind: QuestionKind, required: bool) -> Question {
        Question {
            id: QuestionId::new("q").unwrap(),
            prompt: "?".to_owned(),
            kind,
            required,
        }
    }

    #[test]
    fn a_rating_is_on_the_scale() {
        let rating = question(
            QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 7,
                labels: BTreeMap::new(),
            }),
            true,
        );
        for (given, good) in [(0, false), (1, true), (7, true), (8, false)] {
            assert_eq!(
                rating.accepts(&Answer::Rating(given)).is_ok(),
                good,
                "{given}"
            );
        }
        assert!(rating.accepts(&Answer::Number(3.0)).is_err());
    }

    #[test]
    fn a_number_that_is_none_is_refused() {
        let slider = question(
            QuestionKind::Slider(kinds::Slider {
                from: 0.0,
                to: 1.0,
                step: 0.1,
                labels: BTreeMap::new(),
            }),
            true,
        );
        let number = question(
            QuestionKind::Number(kinds::Number {
                unit: None,
                min: None,
                max: Some(99.0),
                above: None,
            }),
            true,
        );
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 100.0] {
            assert!(slider.accepts(&Answer::Number(bad)).is_err(), "{bad}");
            assert!(number.accepts(&Answer::Number(bad)).is_err(), "{bad}");
        }
        assert!(slider.accepts(&Answer::Number(0.25)).is_ok());
        let refused = number.accepts(&Answer::Number(100.0)).unwrap_err();
        assert_eq!(refused.to_string(), "Type a number up to 99.");
    }

    #[test]
    fn a_choice_is_from_the_list_and_each_option_once() {
        let choose = |multiple, required, chosen: &[&str]| {
            let options = vec!["a".to_owned(), "b".to_owned()];
            question(
                QuestionKind::Choice(kinds::Choice { options, multiple }),
                required,
            )
            .accepts(&Answer::Choice(
                chosen.iter().map(|c| (*c).to_owned()).collect(),
            ))
            .is_ok()
        };
        assert!(choose(false, true, &["a"]));
        assert!(!choose(false, true, &["a", "b"]));
        assert!(!choose(false, true, &["c"]));
        assert!(!choose(true, true, &[]));
        assert!(choose(true, false, &[]));
        assert!(choose(true, true, &["b", "a"]));
        assert!(!choose(true, true, &["a", "a"]));
    }

    #[test]
    fn any_question_can_be_declined_with_a_reason() {
        let text = question(QuestionKind::Text(kinds::Text), true);
        let declined = |reason: &str| Answer::Declined {
            reason: reason.to_owned(),
        };
        assert!(text.accepts(&declined("too personal")).is_ok());
        assert!(text.accepts(&declined(" ")).is_err());
        assert!(text.accepts(&Answer::Text(" ".to_owned())).is_err());
    }
}
