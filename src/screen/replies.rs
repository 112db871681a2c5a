//! What the page sends, and the input that it means on the page that is shown.

use serde::Deserialize;
use std::collections::BTreeMap;
use study_plan::protocol::answer::tidy;
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Answer, Given, Question, Refusal};
use study_session::page::{Does, Page};
use study_session::session::{Input, Screen, View};

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
        // For the experimenter's terminal.
        Does::RestartBlock | Does::Continue | Does::DropOut | Does::RetrySave | Does::Quit => {
            return Err(String::new());
        }
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
        return Err(Refusal::OtherKind.words(words));
    }
    let mut answers = Vec::new();
    for (n, question) in questions.iter().enumerate() {
        let answer = if n == 0 && reply.does == Does::Decline {
            let declined = Answer::Declined {
                reason: tidy(&reply.reason),
            };
            question.accepts(&declined).map(|()| Some(declined))
        } else {
            question.read(reply.answers.get(question.id.as_str()))
        };
        let answer = answer.map_err(|why| why.words(words))?;
        answers.extend(answer.map(|answer| (question.id.clone(), answer)));
    }
    Ok(Input::Answer(answers))
}
