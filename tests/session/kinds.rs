//! Every kind of question on every channel: asked, answered, refused, and answered again after
//! a step back. A kind that a channel cannot ask or answer fails here.

use crate::views::{TRIAL, comment, form, realism, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::collections::BTreeMap;
use std::sync::Arc;
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_base::text::QuestionId;
use study_plan::protocol::kinds::{Draws, KINDS};
use study_plan::protocol::phrases::{Words, languages};
use study_plan::protocol::{Answer, Control, Given, Question};
use study_session::page::reply::{self, Reply};
use study_session::page::{Does, participant};
use study_session::session::view::Correctable;
use study_session::session::{Input, View};

/// A question of each kind in each of its forms, with a name.
pub(crate) fn questions(required: bool) -> Vec<(String, Question)> {
    let mut all = Vec::new();
    for known in KINDS {
        let examples = (known.examples)();
        assert!(!examples.is_empty(), "{} has no example", known.word);
        for (n, kind) in examples.into_iter().enumerate() {
            let question = Question {
                id: QuestionId::new("asked").unwrap(),
                prompt: "?".to_owned(),
                kind,
                required,
            };
            all.push((format!("{} {n}", known.word), question));
        }
    }
    all
}

/// Draws of a simulated participant, at a position from 0 to 1.
struct At(f64);

impl Draws for At {
    fn position(&mut self) -> f64 {
        self.0
    }

    fn unit(&mut self) -> f64 {
        self.0
    }

    fn pick(&mut self, count: usize) -> usize {
        ((count as f64 * self.0) as usize).min(count - 1)
    }

    fn comment(&mut self) -> String {
        format!("ü {}", self.0)
    }
}

/// Different answers to a question.
fn answers(question: &Question) -> Vec<Answer> {
    let mut answers: Vec<Answer> = Vec::new();
    for at in [0.0, 0.15, 0.5, 1.0] {
        let answer = question.kind.simulate(&mut At(at));
        assert_eq!(question.accepts(&answer), Ok(()), "{answer:?}");
        if !answers.contains(&answer) {
            answers.push(answer);
        }
    }
    assert!(answers.len() > 1, "{question:?} has one answer");
    answers
}

fn given(question: &Question, answer: &Answer) -> Given {
    let given = question.kind.control().given(answer);
    given.unwrap_or_else(|| panic!("{answer:?} cannot be given to {question:?}"))
}

/// What is sent, or what is said instead.
type Sent = Result<Option<Answer>, String>;

fn sent(inputs: Vec<Input>, said: impl FnOnce() -> String) -> Sent {
    match inputs.as_slice() {
        [Input::Answer(answers)] => Ok(answers.first().map(|(_, answer)| answer.clone())),
        [] => Err(said()),
        other => panic!("{other:?}"),
    }
}

/// Gives an answer on the terminal; without one, confirms the page as it is.
fn by_keys(view: &View, given: Option<&Given>) -> Sent {
    let mut surface = Surface::new(ColorDepth::None);
    let mut press = |code| {
        let event = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
        crate::views::drawn(&mut surface, view, 80, 24);
        surface.event(&event, view)
    };
    let keys: Vec<KeyCode> = match given {
        None => Vec::new(),
        Some(Given::Typed(text)) => text.chars().map(KeyCode::Char).collect(),
        Some(Given::Chosen(chosen)) => {
            let digit = |at: &usize| char::from_digit(*at as u32 + 1, 10).unwrap();
            chosen.iter().map(|at| KeyCode::Char(digit(at))).collect()
        }
    };
    for key in keys {
        assert_eq!(press(key), []);
    }
    let inputs = press(KeyCode::Enter);
    sent(inputs, || {
        crate::views::picture(&crate::views::drawn(&mut surface, view, 80, 24))
    })
}

/// Gives an answer as a typed line.
fn in_lines(view: &View, given: Option<&Given>) -> Sent {
    let mut dialogue = Dialogue::new(true, false);
    dialogue.follow(view);
    let line = match given {
        None => String::new(),
        Some(Given::Typed(text)) => text.clone(),
        Some(Given::Chosen(chosen)) => {
            let numbers = chosen.iter().map(|at| (at + 1).to_string());
            numbers.collect::<Vec<_>>().join(" ")
        }
    };
    let (inputs, said) = dialogue.line(&line, view);
    sent(inputs, || said.join("\n"))
}

/// Gives an answer on the participant's page.
fn on_the_page(view: &View, given: Option<&Given>) -> Sent {
    let answers: BTreeMap<String, Given> = (given.iter())
        .map(|given| ("asked".to_owned(), (*given).clone()))
        .collect();
    let reply = Reply {
        page: String::new(),
        key: String::new(),
        shown_ms: 1000,
        does: Does::Answer,
        answers,
        reason: String::new(),
    };
    let input = reply::input(&reply, &participant(view).unwrap(), view);
    input.and_then(|input| sent(vec![input], String::new))
}

type Channel = (&'static str, fn(&View, Option<&Given>) -> Sent);
const CHANNELS: [Channel; 3] = [
    ("terminal", by_keys),
    ("lines", in_lines),
    ("page", on_the_page),
];

#[test]
fn every_kind_can_be_answered_on_every_channel() {
    for (name, question) in questions(true) {
        let view = view(form(vec![question.clone()]));
        for answer in answers(&question) {
            for (channel, give) in CHANNELS {
                let sent = give(&view, Some(&given(&question, &answer)));
                assert_eq!(sent, Ok(Some(answer.clone())), "{name} on {channel}");
            }
        }
    }
}

#[test]
fn every_channel_refuses_in_the_same_words_in_every_language() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        for (name, question) in questions(true) {
            let mut view = view(form(vec![question.clone()]));
            view.words = words.clone();
            let typed = |text: &str| Some(Given::Typed(text.to_owned()));
            // On the terminal what is not on the scale or in the list cannot be entered.
            let (bad, can_be_entered) = match question.kind.control() {
                Control::List { options, .. } => (Some(Given::Chosen(vec![options.len()])), false),
                Control::Boxes { .. } | Control::Track { .. } => (typed("999"), false),
                Control::Digits { max: Some(_), .. } => (typed("1e9"), true),
                Control::Digits { .. } => (typed("-1e"), true),
                Control::Text => (None, true),
            };
            for given in [None, bad.as_ref()] {
                let refused = question.read(given).unwrap_err().words(&words);
                for (channel, give) in CHANNELS {
                    if channel == "terminal" && given.is_some() && !can_be_entered {
                        continue;
                    }
                    let said = give(&view, given).unwrap_err();
                    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
                    assert!(
                        said.contains(&refused),
                        "{lang} {name} on {channel}: {said}"
                    );
                }
            }
        }
    }
}

#[test]
fn an_answer_that_is_not_required_can_be_left_empty_on_every_channel() {
    for (name, question) in questions(false) {
        let view = view(form(vec![question]));
        for (channel, give) in CHANNELS {
            assert_eq!(give(&view, None), Ok(None), "{name} on {channel}");
        }
    }
}

#[test]
fn after_a_step_back_every_channel_has_the_answer_that_was_given() {
    for (name, question) in questions(true) {
        for answer in answers(&question) {
            let mut view = view(form(vec![question.clone()]));
            view.correctable = vec![Correctable {
                title: "trial 7".to_owned(),
                form: TRIAL,
                question: question.clone(),
                answer: answer.clone(),
            }];
            for (channel, give) in &CHANNELS[..2] {
                let sent = give(&view, None);
                assert_eq!(sent, Ok(Some(answer.clone())), "{name} on {channel}");
            }
            let shown = participant(&view).unwrap().questions[0].given.clone();
            assert_eq!(shown, Some(given(&question, &answer)), "{name} on page");
        }
    }
}

/// `/back` between the questions of a page: the first answer is given anew.
#[test]
fn an_answer_in_lines_replaces_the_one_before_a_step_back() {
    let view = view(form(vec![realism(), comment()]));
    let mut dialogue = Dialogue::new(true, false);
    dialogue.follow(&view);
    for line in ["3", "/back", "5"] {
        assert_eq!(
            dialogue.line(line, &view),
            (Vec::new(), Vec::new()),
            "{line}"
        );
        dialogue.follow(&view);
    }
    let (inputs, _) = dialogue.line("dull", &view);
    let answers = vec![
        (realism().id, Answer::Rating(5)),
        (comment().id, Answer::Text("dull".to_owned())),
    ];
    assert_eq!(inputs, [Input::Answer(answers)]);
}
