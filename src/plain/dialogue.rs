//! What is said when, and what a typed line means. No terminal, no clock.

use super::answers;
use super::pages::{self, Page};
use crate::tui::keys;
use study_base::text::{QuestionId, Untrusted, sentence};
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Answer, Given, Question, Turn};
use study_session::outcome::{Author, Choice};
use study_session::page::{self, Does, NOT_BEGUN};
use study_session::session::view::{Correctable, DeviceState, Mirror, Telemetry};
use study_session::session::{Input, Roster, Screen, View};

/// What the lines that begin with a slash do, in the order of the help.
const COMMANDS: [(&str, Phrase); 11] = [
    ("/stop", Phrase::CommandStop),
    ("/back", Phrase::CommandBack),
    ("/replay", Phrase::CommandReplay),
    ("/again", Phrase::CommandAgain),
    ("/decline …", Phrase::CommandDecline),
    ("/says …", Phrase::CommandSays),
    ("/pause", Phrase::CommandPause),
    ("/quit", Phrase::CommandQuit),
    ("/remark …", Phrase::CommandRemark),
    ("/correct", Phrase::CommandCorrect),
    ("/bad …", Phrase::CommandBad),
];

/// Inputs, or what to say instead.
type Reply = Result<Vec<Input>, Vec<String>>;

/// Something that is asked before the page goes on.
#[derive(Debug, Clone, PartialEq)]
enum Asking {
    /// Whether to do what the inputs say.
    Sure(Vec<Input>),
    /// Whether the participant does not agree: n again.
    Refuse,
    /// Which of the earlier answers to correct.
    Which(Vec<Correctable>),
    /// The new answer.
    NewAnswer(Box<Correctable>),
    /// Why; `None`: declined, with the same reason.
    Why(Box<Correctable>, Option<Answer>),
}

/// What to say.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Said {
    /// The lines.
    pub lines: Vec<String>,
    /// Whether a new page begins with them.
    pub new_page: bool,
}

/// The state of a session in lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dialogue {
    keys: bool,
    live: bool,
    page: Option<Page>,
    /// Whether the page is said again.
    repeated: bool,
    /// Where in the session the last page was.
    top: Vec<String>,
    /// Answers to the first questions of the form on the page.
    entered: Vec<(QuestionId, Answer)>,
    /// Number of the form's question that is asked.
    at: usize,
    /// The participant's id, typed on the first page.
    participant: Option<String>,
    asking: Option<Asking>,
    notice: Option<String>,
    begun: bool,
    banner: bool,
    saved: u32,
    mirror: Option<Mirror>,
    silent: bool,
}

impl Dialogue {
    /// A dialogue that has said nothing. `keys` says whether single keys can be read,
    /// `live` whether arriving telemetry is mentioned.
    pub fn new(keys: bool, live: bool) -> Self {
        Self {
            keys,
            live,
            ..Self::default()
        }
    }

    /// Says the page again.
    pub fn repeat(&mut self) {
        self.page = None;
        self.top.clear();
        self.repeated = true;
    }

    /// What has changed since the last call, in words.
    pub fn follow(&mut self, view: &View) -> Said {
        let mut lines = self.news(view);
        if view.screen == Screen::Saving {
            // Too short to be a page; what is saved is news.
            return Said {
                lines,
                new_page: false,
            };
        }
        let mut page = pages::page(view, self.at, self.keys);
        let other = self.page.as_ref().is_none_or(|old| !old.is_like(&page));
        if other && self.at > 0 && !self.is_next_question(view) {
            self.restart();
            page = pages::page(view, 0, self.keys);
        }
        if let Screen::Who {
            participant,
            operator,
            claiming: false,
            roster,
        } = &view.screen
        {
            self.who(&mut page, participant, operator, roster.as_deref());
        }
        let old = self.page.as_ref();
        let new_page = old.is_none_or(|old| !old.is_like(&page));
        if new_page {
            self.asking = None;
            if self.top != page.top {
                self.top.clone_from(&page.top);
                lines.extend(page.top.iter().cloned());
            }
            lines.extend(page.lines.iter().cloned());
            lines.extend(page.wait.clone());
        }
        if new_page || old.is_none_or(|old| old.prompt != page.prompt) {
            lines.extend(Some(page.prompt.clone()).filter(|p| !p.is_empty()));
        }
        page.wait = None;
        self.page = Some(page);
        let repeated = std::mem::take(&mut self.repeated);
        Said {
            lines,
            new_page: new_page && !repeated,
        }
    }

    /// Whether the form on the screen is still the one whose first questions are answered.
    fn is_next_question(&self, view: &View) -> bool {
        let Screen::Form { questions, .. } = &view.screen else {
            return false;
        };
        let asked = questions.iter().take(self.at).map(|q| &q.id);
        self.entered
            .iter()
            .all(|(id, _)| asked.clone().any(|q| q == id))
            && self.at < questions.len()
    }

    fn restart(&mut self) {
        self.at = 0;
        self.entered.clear();
    }

    fn who(&self, page: &mut Page, participant: &str, operator: &str, roster: Option<&Roster>) {
        page.lines = vec!["Who takes part?".to_owned()];
        if let Some(sentences) = roster.and_then(Roster::unfinished)
            && participant.is_empty()
        {
            page.lines.push(sentences.join(" "));
        }
        let known = |preset: &str, word: &str| match preset {
            "" => format!("Type {word}, then press Enter."),
            preset => format!(
                "Type {word}, then press Enter. Enter alone: {}.",
                Untrusted(preset)
            ),
        };
        page.prompt = match &self.participant {
            None => known(participant, "the participant's pseudonym, such as P01"),
            Some(id) => {
                let who = roster.and_then(|roster| roster.who(id));
                let who = who.map_or_else(String::new, |who| format!(" {}: {who}.", Untrusted(id)));
                known(operator, "the operator's initials or a code") + &who
            }
        };
    }

    /// What changed beside the page.
    fn news(&mut self, view: &View) -> Vec<String> {
        let mut lines = Vec::new();
        if !self.begun {
            self.begun = true;
            lines.push(view.words.get(Phrase::PlainHelp).to_owned());
        }
        if !self.banner
            && let Some(banner) = page::page(view).banner
        {
            self.banner = true;
            lines.push(sentence(&banner));
        }
        if self.notice != view.notice {
            self.notice.clone_from(&view.notice);
            lines.extend(
                view.notice
                    .as_ref()
                    .map(|n| format!("Note: {}", Untrusted(n))),
            );
            // A refused id is typed again.
            self.participant = None;
        }
        let line = &view.line;
        if line.all_saved && line.trials_saved > self.saved {
            self.saved = line.trials_saved;
            let saved = &[("n", &self.saved as &dyn std::fmt::Display)];
            let phrase = match line.mirror {
                Some(Mirror::InStep) => Phrase::PlainSavedBoth,
                _ => Phrase::PlainSaved,
            };
            lines.push(view.words.fill(phrase, saved));
        }
        if self.mirror != line.mirror {
            self.mirror = line.mirror;
            lines.extend(match line.mirror {
                Some(Mirror::OnlyResults) => {
                    Some("NO MIRROR: answers are saved once only.".to_owned())
                }
                Some(Mirror::OnlyMirror) => {
                    Some("ONLY IN THE MIRROR: the results folder is behind.".to_owned())
                }
                Some(Mirror::InStep) | None => None,
            });
        }
        let silent = line.device == DeviceState::Running(Telemetry::Silent);
        if self.live && silent && !self.silent {
            lines.push("NO TELEMETRY arrives.".to_owned());
        }
        self.silent = silent;
        lines
    }

    /// The inputs that a typed line causes, and what to say to it at once.
    pub fn line(&mut self, line: &str, view: &View) -> (Vec<Input>, Vec<String>) {
        let done = match line.trim().split_once(char::is_whitespace) {
            _ if line.starts_with("//") => self.answer(&line[1..], view),
            Some((command, rest)) if command.starts_with('/') => {
                self.command(command, rest.trim(), view)
            }
            None if line.trim().starts_with('/') => self.command(line.trim(), "", view),
            _ => self.answer(line, view),
        };
        match done {
            Ok(inputs) => (inputs, Vec::new()),
            Err(words) => (Vec::new(), words),
        }
    }

    fn command(&mut self, command: &str, rest: &str, view: &View) -> Reply {
        let begun = !matches!(view.screen, Screen::Who { .. });
        let text = || match (begun, rest.is_empty()) {
            (false, _) => say(NOT_BEGUN),
            (true, true) => say(&view
                .words
                .fill(Phrase::PlainOneLine, &[("command", &command)])),
            (true, false) => Ok(rest.to_owned()),
        };
        let remark = |by| {
            let text = text()?;
            Ok(vec![Input::Remark { by, text }])
        };
        match command {
            "/stop" => Ok(vec![Input::Stop]),
            "/remark" => remark(Author::Experimenter),
            "/says" => remark(Author::Participant),
            "/correct" if view.correctable.is_empty() => {
                say(view.words.get(Phrase::NothingToCorrect))
            }
            "/correct" => {
                let items = view.correctable.clone();
                let mut lines: Vec<String> = (1..)
                    .zip(&items)
                    .map(|(n, item)| listed(n, item, &view.words))
                    .collect();
                lines.push(view.words.get(Phrase::WhichCorrect).to_owned());
                self.asking = Some(Asking::Which(items));
                Err(lines)
            }
            "/decline" => match (self.asking.take(), &view.screen) {
                (Some(Asking::NewAnswer(item)), _) => {
                    self.asking = Some(Asking::Why(item, None));
                    say(view.words.get(Phrase::PlainWhy))
                }
                (
                    _,
                    Screen::Form {
                        form, questions, ..
                    },
                ) if form.can_be_declined() => {
                    let reason = text()?;
                    let answer = Answer::Declined { reason };
                    let Some(question) = questions.get(self.at) else {
                        return Ok(Vec::new());
                    };
                    self.entered.push((question.id.clone(), answer));
                    self.next_question(view)
                }
                _ => say(view.words.get(Phrase::PlainNoQuestion)),
            },
            "/bad" if view.can_mark_bad.is_none() => say("There is no trial to mark as bad."),
            "/bad" => {
                let reason = text()?;
                Ok(vec![Input::MarkBad { reason }])
            }
            "/pause" if begun => Ok(vec![Input::Pause]),
            "/pause" => say(NOT_BEGUN),
            "/replay" if view.can_replay || matches!(view.screen, Screen::Stopped { .. }) => {
                Ok(vec![Input::PlayAgain])
            }
            "/replay" => say(page::why_not_again(view)),
            "/back" if self.at > 0 => {
                self.at -= 1;
                self.entered.truncate(self.at);
                Ok(Vec::new())
            }
            "/back" if view.can_go_back => Ok(vec![Input::Back]),
            "/back" => say(view.words.get(Phrase::PlainNoBack)),
            "/again" => {
                self.repeat();
                Ok(Vec::new())
            }
            "/quit" => match page::before_leaving(view) {
                Some(question) => self.sure(question, vec![Input::Quit], view),
                None => Ok(vec![Input::Quit]),
            },
            "/help" => Err(COMMANDS
                .iter()
                .map(|(c, what)| format!("{c}: {}.", view.words.get(*what)))
                .collect()),
            other => {
                let command = &[("command", &Untrusted(other) as &dyn std::fmt::Display)];
                say(&view.words.fill(Phrase::PlainNoCommand, command))
            }
        }
    }

    fn sure(&mut self, question: &str, inputs: Vec<Input>, view: &View) -> Reply {
        self.asking = Some(Asking::Sure(inputs));
        say(&format!(
            "{question} {}",
            view.words.get(Phrase::PlainYesNo)
        ))
    }

    fn answer(&mut self, line: &str, view: &View) -> Reply {
        if let Some(asking) = self.asking.take() {
            return self.asked(asking, line, view);
        }
        let key = line.trim().to_lowercase();
        match &view.screen {
            Screen::Who {
                participant,
                operator,
                claiming: false,
                ..
            } => self.identify(line.trim(), participant, operator),
            Screen::ResumeChoice { restart, .. } => match key.as_str() {
                "b" if *restart => Ok(vec![Input::Resume(Choice::RestartBlock)]),
                "c" => Ok(vec![Input::Resume(Choice::Continue)]),
                "d" => self.sure(
                    "Does the participant drop out?",
                    vec![Input::Resume(Choice::DropOut)],
                    view,
                ),
                _ if *restart => say("Type b, c or d."),
                _ => say("Type c or d."),
            },
            Screen::Consent { .. } => match yes_or_no(&key, &view.words) {
                Some(true) => Ok(vec![Input::Consent(true)]),
                Some(false) => {
                    self.asking = Some(Asking::Refuse);
                    let (words, n) = (&view.words, &"n");
                    let again = words.fill(Phrase::PlainType, &[("key", n)]);
                    let refuse = words.get(Phrase::RefuseConfirm);
                    say(&format!(
                        "{} {again}: {refuse}.",
                        words.get(Phrase::RefuseSure)
                    ))
                }
                None => say(view.words.get(Phrase::ChooseYesOrNo)),
            },
            Screen::Stopped { can_rate } => match key.as_str() {
                "" => Ok(vec![Input::PlayAgain]),
                "r" if *can_rate => Ok(vec![Input::RateStopped]),
                _ => {
                    let page = page::page(view);
                    let again = page.button_of(Does::PlayAgain).map_or("", |b| &b.label);
                    let enter = view.words.get(Phrase::PlainEnterAlone);
                    say(&format!("{enter}: {again}."))
                }
            },
            Screen::SaveTrouble { .. } => Ok(vec![Input::RetrySave]),
            Screen::Playing { .. } if turn(&key, view).is_some() => {
                Ok(turn(&key, view).map(Input::Adjust).into_iter().collect())
            }
            Screen::Form {
                form, questions, ..
            } => {
                let Some(question) = questions.get(self.at) else {
                    return Ok(Vec::new());
                };
                let given = view.given(*form, &question.id);
                let answer = match given {
                    Some(given) if key.is_empty() => Some(given.clone()),
                    _ => read(question, line, &view.words)?,
                };
                self.entered
                    .extend(answer.map(|answer| (question.id.clone(), answer)));
                self.next_question(view)
            }
            _ if !key.is_empty() => say(view.words.get(Phrase::PlainNotAsked)),
            _ if view.can_advance => Ok(vec![Input::Advance]),
            _ => Ok(Vec::new()),
        }
    }

    /// Asks the next question of the form, or sends the answers.
    fn next_question(&mut self, view: &View) -> Reply {
        let Screen::Form { questions, .. } = &view.screen else {
            return Ok(Vec::new());
        };
        self.at += 1;
        if self.at < questions.len() {
            return Ok(Vec::new());
        }
        self.at = 0;
        Ok(vec![Input::Answer(std::mem::take(&mut self.entered))])
    }

    fn identify(&mut self, line: &str, participant: &str, operator: &str) -> Reply {
        let or = |preset: &str| match line {
            "" => preset.to_owned(),
            typed => typed.to_owned(),
        };
        match self.participant.take() {
            None if or(participant).is_empty() => say("Type the participant's pseudonym first."),
            None => {
                self.participant = Some(or(participant));
                Ok(Vec::new())
            }
            Some(participant) => Ok(vec![Input::Identify {
                participant,
                operator: or(operator),
            }]),
        }
    }

    fn asked(&mut self, asking: Asking, line: &str, view: &View) -> Reply {
        let typed = line.trim();
        match asking {
            Asking::Refuse => match yes_or_no(&typed.to_lowercase(), &view.words) {
                Some(false) => Ok(vec![Input::Consent(false)]),
                Some(true) | None => {
                    self.repeat();
                    Ok(Vec::new())
                }
            },
            Asking::Sure(inputs) => match yes_or_no(&typed.to_lowercase(), &view.words) {
                Some(true) => Ok(inputs),
                Some(false) => {
                    self.repeat();
                    Ok(Vec::new())
                }
                None => {
                    self.asking = Some(Asking::Sure(inputs));
                    say(view.words.get(Phrase::PlainYesNo))
                }
            },
            _ if typed.is_empty() => {
                self.repeat();
                say(view.words.get(Phrase::NothingCorrected))
            }
            Asking::Which(mut items) => {
                let number = typed.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
                match number.filter(|n| *n < items.len()) {
                    Some(n) => {
                        let item = Box::new(items.swap_remove(n));
                        let (mut lines, prompt) = answers::ask(&item.question, &view.words);
                        lines.insert(0, listed(n + 1, &item, &view.words));
                        let decline = view.words.get(Phrase::PlainDeclineIt);
                        lines.push(format!("{prompt} {decline}"));
                        self.asking = Some(Asking::NewAnswer(item));
                        Err(lines)
                    }
                    None => {
                        self.asking = Some(Asking::Which(items));
                        say(view.words.get(Phrase::WhichOfList))
                    }
                }
            }
            Asking::NewAnswer(item) => match read(&item.question, line, &view.words) {
                Ok(Some(answer)) if answer == item.answer => {
                    self.repeat();
                    say(view.words.get(Phrase::AlreadyAnswer))
                }
                Ok(answer) => {
                    let empty = || Answer::Text(String::new());
                    self.asking = Some(Asking::Why(item, Some(answer.unwrap_or_else(empty))));
                    say(view.words.get(Phrase::PlainWhy))
                }
                Err(what) => {
                    self.asking = Some(Asking::NewAnswer(item));
                    Err(what)
                }
            },
            Asking::Why(item, answer) => {
                let reason = typed.to_owned();
                let declined = Answer::Declined {
                    reason: reason.clone(),
                };
                self.repeat();
                Ok(vec![Input::Correct {
                    form: item.form,
                    question: item.question.id.clone(),
                    answer: answer.unwrap_or(declined),
                    reason,
                    by: Author::Experimenter,
                }])
            }
        }
    }
}

/// What a typed line changes where a level is set.
fn turn(line: &str, view: &View) -> Option<Turn> {
    let own = view.adjusting.as_ref().filter(|own| !own.at_standard)?;
    match line {
        "-" | "−" if own.can_lower => Some(Turn::Lower),
        "+" if own.can_higher => Some(Turn::Higher),
        "s" if own.has_standard => Some(Turn::Standard),
        _ => None,
    }
}

/// What a line in small letters says: the letters and words of every study, or those of its
/// language.
fn yes_or_no(line: &str, words: &Words) -> Option<bool> {
    let own = |phrase| words.get(phrase).to_lowercase();
    let mut letters = line.chars();
    let letter = letters.next().filter(|_| letters.next().is_none());
    match line {
        "y" | "yes" => Some(true),
        "n" | "no" => Some(false),
        _ if line == own(Phrase::Yes) => Some(true),
        _ if line == own(Phrase::Refuse) => Some(false),
        _ => letter
            .is_some_and(|c| keys::is_yes(keys::Key::Char(c), words))
            .then_some(true),
    }
}

fn say<T>(words: &str) -> Result<T, Vec<String>> {
    Err(vec![words.to_owned()])
}

/// A typed line as the answer to a question; `None` if it is left empty.
fn read(question: &Question, line: &str, words: &Words) -> Result<Option<Answer>, Vec<String>> {
    let read = question.read(Some(&Given::Typed(line.to_owned())));
    read.or_else(|why| say(&why.words(words)))
}

fn listed(number: usize, item: &Correctable, words: &Words) -> String {
    let prompt = item.question.prompt.lines().next().unwrap_or_default();
    format!(
        "{number}: {}, {}: {}",
        Untrusted(&item.title),
        Untrusted(prompt),
        answers::in_words(&item.answer, words)
    )
}
