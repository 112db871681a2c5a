//! What the page sends, and the input that it means on the page that is shown.

use super::pages::{Does, Given, Page, range};
use crate::tui::editor::Editor;
use crate::tui::ui_state::field;
use serde::Deserialize;
use std::collections::BTreeMap;
use study_base::text::ascii_number;
use study_core::protocol::phrases::{Phrase, Words};
use study_core::protocol::{Answer, AnswerError, Question, QuestionKind};
use study_core::session::{Input, Screen, View};

/// What a page sends.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reply {
    /// The page on which it was chosen.
    pub page: String,
    /// Names this reply: sent again with the same key, it is the same reply.
    pub key: String,
    /// How long the page had been shown, ms, on the page's clock.
    pub shown_ms: u64,
    /// What to do.
    pub does: Does,
    /// Answers by the id of their question.
    #[serde(default)]
    pub answers: BTreeMap<String, Given>,
    /// Why the question is declined.
    #[serde(default)]
    pub reason: String,
}

/// The input that a reply means on the page of a view.
///
/// # Errors
/// What the participant can do instead; empty if the page does not offer it.
pub fn input(reply: &Reply, page: &Page, view: &View) -> Result<Input, String> {
    if !page.offers(reply.does) {
        return Err(String::new());
    }
    Ok(match reply.does {
        Does::Advance => Input::Advance,
        Does::Agree => Input::Consent(true),
        Does::Refuse => Input::Consent(false),
        Does::PlayAgain | Does::Replay => Input::PlayAgain,
        Does::Back => Input::Back,
        Does::RateStopped => Input::RateStopped,
        Does::Stop => Input::Stop,
        Does::Answer | Does::Decline => {
            let Screen::Form { questions, .. } = &view.screen else {
                return Err(String::new());
            };
            answers(reply, questions, &view.words)?
        }
    })
}

fn answers(reply: &Reply, questions: &[Question], words: &Words) -> Result<Input, String> {
    let known = |id: &String| questions.iter().any(|q| q.id.as_str() == id);
    if !reply.answers.keys().all(known) {
        return Err(words.get(Phrase::PlainNoAnswer).to_owned());
    }
    let mut answers = Vec::new();
    for (n, question) in questions.iter().enumerate() {
        let answer = if n == 0 && reply.does == Does::Decline {
            let declined = Answer::Declined {
                reason: typed(&reply.reason),
            };
            let accepted = question.accepts(&declined);
            accepted.map_err(|_| words.get(Phrase::DeclineWhy).to_owned())?;
            Some(declined)
        } else {
            read(question, reply.answers.get(question.id.as_str()), words)?
        };
        answers.extend(answer.map(|answer| (question.id.clone(), answer)));
    }
    Ok(Input::Answer(answers))
}

/// An answer as given; `None` if it is left empty.
fn read(
    question: &Question,
    given: Option<&Given>,
    words: &Words,
) -> Result<Option<Answer>, String> {
    let no_answer = || words.get(Phrase::PlainNoAnswer).to_owned();
    let empty = match given {
        None => true,
        Some(Given::Typed(text)) => text.trim().is_empty(),
        Some(Given::Chosen(chosen)) => chosen.is_empty(),
    };
    let Some(given) = given.filter(|_| !empty) else {
        return match question.required {
            true => Err(words.get(Phrase::PlainNeeded).to_owned()),
            false => Ok(None),
        };
    };
    let answer = match (&question.kind, given) {
        (QuestionKind::Rating { .. }, Given::Typed(text)) => {
            let number: String = text.trim().chars().map(ascii_number).collect();
            Answer::Rating(number.parse().map_err(|_| no_answer())?)
        }
        (QuestionKind::Slider { .. } | QuestionKind::Number { .. }, Given::Typed(text)) => {
            let number = field::parse(text);
            Answer::Number(number.ok_or_else(|| words.get(Phrase::NumberLike).to_owned())?)
        }
        (QuestionKind::Choice { options, .. }, Given::Chosen(chosen)) => {
            let mut chosen = chosen.clone();
            chosen.sort_unstable();
            let option = |n: &usize| options.get(*n).cloned();
            let chosen: Option<Vec<_>> = chosen.iter().map(option).collect();
            Answer::Choice(chosen.ok_or_else(no_answer)?)
        }
        (QuestionKind::Text, Given::Typed(text)) => Answer::Text(typed(text)),
        _ => return Err(no_answer()),
    };
    match question.accepts(&answer) {
        Ok(()) => Ok(Some(answer)),
        Err(AnswerError::OffScale(from, to)) => Err(range(Some(from), Some(to), words)),
        Err(AnswerError::OutOfRange { min, max }) => Err(range(min, max, words)),
        Err(AnswerError::NotAbove(above)) => {
            Err(words.fill(Phrase::RangeAbove, &[("above", &above)]))
        }
        Err(_) => Err(no_answer()),
    }
}

/// Text as the terminal's editor would keep it.
fn typed(text: &str) -> String {
    let mut editor = Editor::new("");
    // What was cut is over the limit that the page has told.
    let _ = editor.insert(text);
    editor.text().to_owned()
}
