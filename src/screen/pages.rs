//! What the participant's page shows of a view, and what it offers.
//!
//! The only place that knows which screens the participant sees. A page accepts what it
//! offers and nothing else: see [`Page::offers`]. Nothing here depends on more than the
//! view, which identifies no realization.

use crate::tui::views::prose::{Stopped, attending};
use crate::tui::views::status::of_banner;
use crate::tui::widgets::clock;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use study_base::text::{Untrusted, capital};
use study_core::protocol::phrases::{Phrase, Words};
use study_core::protocol::{Answer, Question, QuestionKind};
use study_core::session::{Screen, View};

/// A rating scale with more points is answered by typing.
const MOST_BOXES: i64 = 21;

/// A page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// Where in the session it is.
    pub progress: Option<Progress>,
    /// Whose data these are, if not those of a real participant.
    pub banner: Option<String>,
    /// The heading; empty if the first question is it.
    pub title: String,
    /// The text below the heading.
    pub text: String,
    /// What has to be waited for, with the time left.
    pub wait: Option<String>,
    /// The time since the page opened, where it is shown.
    pub clock: Option<String>,
    /// The questions.
    pub questions: Vec<Asked>,
    /// What can be done.
    pub buttons: Vec<Button>,
    /// Words of the button that stops the device, while there is something to stop.
    pub stop: Option<String>,
    /// Words of the dialog that declines the first question.
    pub decline: Option<Dialog>,
    /// Words of the dialog that refuses consent.
    pub refuse: Option<Dialog>,
    /// On which side scales begin.
    pub scales: &'static str,
    /// Whether nothing follows.
    pub over: bool,
}

/// Progress, as words and as a bar.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Progress {
    /// Such as "Trial 7 of 15."
    pub words: String,
    /// The number of the trial.
    pub at: u32,
    /// The number of trials, if it is known.
    pub of: Option<u32>,
}

/// A question as the page asks it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Asked {
    /// Its id.
    pub id: String,
    /// Its text.
    pub prompt: String,
    /// The word for a question that may be left empty.
    pub optional: Option<String>,
    /// What can be answered, in words; may be empty.
    pub hint: String,
    /// How it is answered.
    pub field: Field,
    /// The answer that was given before a step back.
    pub given: Option<Given>,
}

/// An answer as a page has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Given {
    /// A number or a text, as typed.
    Typed(String),
    /// Indices of the chosen options.
    Chosen(Vec<usize>),
}

impl Given {
    /// An answer to a question; `None` for one that the page cannot show.
    fn of(question: &Question, answer: &Answer) -> Option<Self> {
        Some(match (&question.kind, answer) {
            (QuestionKind::Choice { options, .. }, Answer::Choice(chosen)) => {
                let at = |option| options.iter().position(|o| o == option);
                Self::Chosen(chosen.iter().filter_map(at).collect())
            }
            (_, Answer::Rating(n)) => Self::Typed(n.to_string()),
            (_, Answer::Number(n)) => Self::Typed(n.to_string()),
            (_, Answer::Text(text)) => Self::Typed(text.clone()),
            _ => return None,
        })
    }
}

/// How a question is answered.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Field {
    /// One box for each number.
    Boxes {
        /// The numbers with their labels, which may be empty.
        boxes: Vec<(i64, String)>,
    },
    /// A slider without a preset.
    Slider {
        /// First end.
        from: f64,
        /// Last end.
        to: f64,
        /// How far a key moves it.
        step: f64,
        /// The two ends in words.
        ends: [String; 2],
        /// Labels of numbers between them.
        labels: Vec<(f64, String)>,
    },
    /// One or several of a list; the answer is their indices.
    Choice {
        /// The options.
        options: Vec<String>,
        /// Whether several can be chosen.
        multiple: bool,
    },
    /// A typed number.
    Number {
        /// Its unit; may be empty.
        unit: String,
    },
    /// A typed text.
    Text,
}

/// A button.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Button {
    /// What it does.
    pub does: Does,
    /// Its words.
    pub label: String,
    /// Whether it can be used now.
    pub enabled: bool,
}

/// What a page can request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Does {
    /// Goes on.
    Advance,
    /// Sends the answers.
    Answer,
    /// Agrees to take part.
    Agree,
    /// Does not agree.
    Refuse,
    /// Plays again after a stop.
    PlayAgain,
    /// Plays again before an answer.
    Replay,
    /// Goes back to the questions before.
    Back,
    /// Rates after a stop.
    RateStopped,
    /// Declines the first question.
    Decline,
    /// Stops the device.
    Stop,
}

/// A question before something that cannot be undone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Dialog {
    /// The button that opens it.
    pub open: String,
    /// Its question.
    pub title: String,
    /// The button that does it.
    pub confirm: String,
    /// The button that leaves it.
    pub back: String,
}

/// The participant's page of a view; `None` while the last page stays.
pub fn page(view: &View) -> Option<Page> {
    let words = &view.words;
    let mut page = Page::new(view);
    match &view.screen {
        // Too short to be read.
        Screen::Saving => return None,
        // The experimenter acts.
        Screen::Who { .. }
        | Screen::ResumeChoice { .. }
        | Screen::Mount { .. }
        | Screen::DeviceTrouble { .. }
        | Screen::SaveTrouble { .. }
        | Screen::Form {
            to_experimenter: true,
            ..
        } => page.title = words.get(Phrase::OneMoment).to_owned(),
        Screen::Consent { document, version } => {
            page.title = words.get(Phrase::AgreeQuestion).to_owned();
            page.text = match version.as_str() {
                "" => safe(document),
                version => words.fill(
                    Phrase::Version,
                    &[
                        ("document", &safe(document)),
                        ("version", &Untrusted(version)),
                    ],
                ),
            };
            page.button(Does::Agree, Phrase::Agree, true, words);
            page.refuse = Some(Dialog {
                open: capital(words.get(Phrase::Refuse)),
                title: words.get(Phrase::RefuseSure).to_owned(),
                confirm: capital(words.get(Phrase::RefuseConfirm)),
                back: capital(words.get(Phrase::Back)),
            });
        }
        Screen::Message { kind: _, text } => {
            page.text = safe(text);
            page.button(Does::Advance, Phrase::Continue, true, words);
        }
        Screen::Form {
            questions,
            page: at,
            pages,
            to_experimenter: false,
            form,
        } => {
            page.form(questions, (*at, *pages), words);
            for (asked, question) in page.questions.iter_mut().zip(questions) {
                let given = view.given(*form, &question.id);
                asked.given = given.and_then(|given| Given::of(question, given));
            }
            if view.can_replay {
                page.button(Does::Replay, Stopped::of(view).again, true, words);
            }
            if view.can_go_back {
                page.button(Does::Back, Phrase::Back, true, words);
            }
        }
        Screen::Reference { prompt, wait_s } => {
            page.title = safe(prompt);
            page.text = match *wait_s > 0.0 {
                true => String::new(),
                false => words.get(Phrase::AtLeisure).to_owned(),
            };
            page.waits(*wait_s, words);
            page.button(Does::Advance, Phrase::Ready, view.can_advance, words);
        }
        Screen::Loading { interval: None } => {
            page.title = words.get(Phrase::OneMoment).to_owned();
            page.text = words.get(Phrase::Preparing).to_owned();
        }
        Screen::Loading {
            interval: Some((at, _)),
        } => {
            page.title = capital(view.interval_name(*at));
            page.text = words.get(Phrase::OneMoment).to_owned();
        }
        Screen::Playing {
            since_s,
            keep_exploring,
            exposure,
            interval,
        } => {
            let (feel, more) = attending(view);
            match interval {
                Some((at, _)) => {
                    page.title = capital(view.interval_name(*at));
                    page.text = words.get(feel).to_owned();
                }
                None => page.title = words.get(feel).to_owned(),
            }
            page.clock = Some(match exposure.left_s(*since_s) {
                None => clock(*since_s),
                Some(left_s) => words.fill(Phrase::TimeLeft, &[("time", &clock(left_s.ceil()))]),
            });
            page.wait = keep_exploring.then(|| words.get(more).to_owned());
            page.button(Does::Advance, Phrase::Rate, view.can_advance, words);
        }
        Screen::Stopping => page.title = words.get(Phrase::Stopping).to_owned(),
        Screen::Stopped { can_rate } => {
            let stopped = Stopped::of(view);
            page.title = words.get(stopped.title).to_owned();
            page.text = words.get(stopped.body).to_owned();
            page.button(Does::PlayAgain, stopped.again, true, words);
            if *can_rate {
                page.button(Does::RateStopped, stopped.rate, true, words);
            }
        }
        Screen::Break {
            text,
            wait_s,
            done,
            total,
        } => {
            page.title = words.get(Phrase::Break).to_owned();
            page.text = safe(text);
            if let Some(total) = total {
                let values = [("n", done as &dyn Display), ("total", total)];
                page.progress = Some(Progress {
                    words: capital(&words.fill(Phrase::DoneOf, &values)),
                    at: *done,
                    of: Some(*total),
                });
            }
            page.waits(*wait_s, words);
            page.button(Does::Advance, Phrase::Ready, view.can_advance, words);
        }
        // The experimenter ends the pause.
        Screen::Paused { since_s: _ } => page.title = words.get(Phrase::Paused).to_owned(),
        Screen::End { text } => {
            page.text = safe(text);
            page.over = true;
        }
    }
    Some(page)
}

impl Page {
    fn new(view: &View) -> Self {
        let words = &view.words;
        Self {
            progress: view.progress.map(|p| {
                let phrase = match (p.practice, p.total) {
                    (true, _) => Phrase::PracticeOf,
                    (false, Some(_)) => Phrase::TrialOf,
                    (false, None) => Phrase::TrialNumber,
                };
                let total = p.total.unwrap_or(p.current);
                let values = [("n", &p.current as &dyn Display), ("total", &total)];
                Progress {
                    words: capital(&words.fill(phrase, &values)),
                    at: p.current,
                    of: p.total,
                }
            }),
            // In a word: a phone is narrow.
            banner: view.banner.map(|banner| {
                let words = words.get(of_banner(banner));
                let short = words.split_once(" — ").map_or(words, |(short, _)| short);
                short.to_owned()
            }),
            title: String::new(),
            text: String::new(),
            wait: None,
            clock: None,
            questions: Vec::new(),
            buttons: Vec::new(),
            // A sample felt by hand cannot be stopped, but the attempt can.
            stop: view.armed.then(|| capital(words.get(Phrase::Stop))),
            decline: None,
            refuse: None,
            scales: if words.scales_from_right() {
                "rtl"
            } else {
                "ltr"
            },
            over: false,
        }
    }

    /// Whether the page can request this now.
    pub fn offers(&self, does: Does) -> bool {
        match does {
            Does::Stop => true,
            Does::Refuse => self.refuse.is_some(),
            Does::Decline => self.decline.is_some(),
            does => self.buttons.iter().any(|b| b.does == does && b.enabled),
        }
    }

    /// The page without what changes while it is shown.
    pub fn still(&self) -> Self {
        let mut page = self.clone();
        (page.wait, page.clock) = (None, None);
        // The text of a reference prompt appears when the wait is over.
        page.text.clear();
        for button in &mut page.buttons {
            button.enabled = true;
        }
        page
    }

    fn button(&mut self, does: Does, phrase: Phrase, enabled: bool, words: &Words) {
        self.buttons.push(Button {
            does,
            label: capital(words.get(phrase)),
            enabled,
        });
    }

    fn waits(&mut self, wait_s: f64, words: &Words) {
        self.wait = (wait_s > 0.0).then(|| words.wait(wait_s));
    }

    fn form(&mut self, questions: &[Question], (at, of): (u32, u32), words: &Words) {
        if of > 1 && self.progress.is_none() {
            let values = [("n", &at as &dyn Display), ("total", &of)];
            self.progress = Some(Progress {
                words: capital(&words.fill(Phrase::PageOf, &values)),
                at,
                of: Some(of),
            });
        }
        self.questions = questions.iter().map(|q| asked(q, words)).collect();
        self.button(Does::Answer, Phrase::Save, true, words);
        self.decline = Some(Dialog {
            open: capital(words.get(Phrase::DeclineTitle)),
            title: words.get(Phrase::DeclineWhy).to_owned(),
            confirm: capital(words.get(Phrase::Decline)),
            back: capital(words.get(Phrase::Back)),
        });
    }
}

fn asked(question: &Question, words: &Words) -> Asked {
    let mut hint = String::new();
    let field = match &question.kind {
        QuestionKind::Rating { from, to, labels } => {
            if to.saturating_sub(*from) < MOST_BOXES {
                let label = |n: i64| labels.get(&n).map_or(String::new(), |l| safe(l));
                Field::Boxes {
                    boxes: (*from..=*to).map(|n| (n, label(n))).collect(),
                }
            } else {
                hint = words.fill(Phrase::Range, &[("from", from), ("to", to)]);
                for (n, label) in labels {
                    let label = Untrusted(label);
                    let values = [("value", n as &dyn Display), ("label", &label)];
                    hint = format!("{hint}\n{}", words.fill(Phrase::PlainLabel, &values));
                }
                Field::Number {
                    unit: String::new(),
                }
            }
        }
        QuestionKind::Slider {
            from,
            to,
            step,
            labels,
        } => {
            let end = |end: &f64| match labels.get(&end.to_string()) {
                Some(label) => format!("{end}: {}", Untrusted(label)),
                None => end.to_string(),
            };
            Field::Slider {
                from: *from,
                to: *to,
                step: *step,
                ends: [end(from), end(to)],
                labels: (labels.iter())
                    .filter_map(|(n, label)| Some((n.parse().ok()?, safe(label))))
                    .filter(|(n, _)| n > from && n < to)
                    .collect(),
            }
        }
        QuestionKind::Choice { options, multiple } => Field::Choice {
            options: options.iter().map(|o| safe(o)).collect(),
            multiple: *multiple,
        },
        QuestionKind::Number {
            unit,
            min,
            max,
            above,
        } => {
            hint = match above {
                Some(above) => words.fill(Phrase::RangeAbove, &[("above", above)]),
                None => range(*min, *max, words),
            };
            Field::Number {
                unit: unit.as_deref().map_or(String::new(), safe),
            }
        }
        QuestionKind::Text => Field::Text,
    };
    Asked {
        id: question.id.to_string(),
        prompt: safe(&question.prompt),
        optional: (!question.required).then(|| words.get(Phrase::Optional).to_owned()),
        hint,
        field,
        given: None,
    }
}

/// Which numbers can be typed.
pub(super) fn range(min: Option<f64>, max: Option<f64>, words: &Words) -> String {
    match (min, max) {
        (Some(min), Some(max)) => words.fill(Phrase::Range, &[("from", &min), ("to", &max)]),
        (Some(min), None) => words.fill(Phrase::RangeFrom, &[("from", &min)]),
        (None, Some(max)) => words.fill(Phrase::RangeTo, &[("to", &max)]),
        (None, None) => words.get(Phrase::NumberLike).to_owned(),
    }
}

/// Text of a protocol; its line breaks stay.
fn safe(text: &str) -> String {
    let lines = text.trim_end().lines();
    let lines: Vec<String> = lines.map(|line| Untrusted(line).to_string()).collect();
    lines.join("\n")
}
