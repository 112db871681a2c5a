//! The words of a page.

use super::answers;
use crate::tui::theme::{Colour, Theme};
use crate::tui::views::prose::{attending, prose};
use crate::tui::views::status::of_banner;
use crate::tui::views::trouble::Trouble;
use crate::tui::widgets::clock;
use std::fmt::Display;
use study_base::text::sentence;
use study_core::outcome::FormId;
use study_core::protocol::phrases::{Phrase, Words};
use study_core::protocol::{Entry, Question};
use study_core::session::{Screen, View};

/// A page in words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Page {
    /// Where in the session it is.
    pub top: Vec<String>,
    /// Its lines.
    pub lines: Vec<String>,
    /// What has to be waited for, with the time left; not part of the comparison of two
    /// pages.
    pub wait: Option<String>,
    /// What can be done now; empty while nothing can.
    pub prompt: String,
}

/// The words of a view, with its form at question number `at`. `keys` says whether single
/// keys can be read.
pub fn page(view: &View, at: usize, keys: bool) -> Page {
    let words = &view.words;
    let mut page = Page {
        top: top(view),
        ..Page::default()
    };
    match &view.screen {
        Screen::Who { claiming: true, .. } => {
            page.lines.push(words.get(Phrase::OneMoment).to_owned())
        }
        Screen::Who { .. } => {}
        Screen::Form {
            form,
            questions,
            to_experimenter,
            ..
        } => page.form(view, (*form, questions, at), *to_experimenter),
        Screen::Playing {
            keep_exploring,
            interval,
            exposure,
            ..
        } => {
            if let Some((at, of)) = interval {
                let which = sentence(view.interval_name(*at));
                page.lines.push(format!("{which} ({at} / {of})"));
            }
            page.lines.push(
                match attending(view).0 {
                    Phrase::FeelDevice => words.get(Phrase::PlainPlays),
                    other => words.get(other),
                }
                .to_owned(),
            );
            // Said once; a countdown would never end to be read.
            let left = exposure.max_s.map(|max_s| clock(max_s.ceil()));
            let left = left.map(|time| words.fill(Phrase::TimeLeft, &[("time", &time)]));
            page.wait = left.map(|left| sentence(&left));
            page.prompt = match (keep_exploring, keys) {
                (true, _) => words.get(attending(view).1),
                (false, true) => words.get(Phrase::PlainRate),
                (false, false) => words.get(Phrase::PlainContinue),
            }
            .to_owned();
        }
        Screen::DeviceTrouble { .. } | Screen::SaveTrouble { .. } => page.trouble(view),
        _ => page.prose(view),
    }
    page
}

/// Progress of the participant, and the page of the form.
fn top(view: &View) -> Vec<String> {
    let mut parts = Vec::new();
    if let Some(progress) = view.progress {
        let number = ("n", &progress.current as &dyn Display);
        let phrase = match (progress.practice, progress.total) {
            (true, _) => Phrase::PracticeOf,
            (false, Some(_)) => Phrase::TrialOf,
            (false, None) => Phrase::TrialNumber,
        };
        let total = progress.total.unwrap_or(progress.current);
        let values = [number, ("total", &total as &dyn Display)];
        parts.push(sentence(&view.words.fill(phrase, &values)));
    }
    if let Screen::Form { page, pages, .. } = &view.screen
        && *pages > 1
    {
        let values = [("n", page as &dyn Display), ("total", pages)];
        parts.push(sentence(&view.words.fill(Phrase::PageOf, &values)));
    }
    match parts.is_empty() {
        true => Vec::new(),
        false => vec![parts.join(" ")],
    }
}

/// Whose data these are, if not those of a real participant.
pub fn banner(view: &View) -> Option<String> {
    let banner = view.words.get(of_banner(view.banner?));
    Some(sentence(banner))
}

impl Page {
    /// Whether the pages differ at most in what is waited for and can be done.
    pub fn is_like(&self, other: &Self) -> bool {
        (&self.top, &self.lines) == (&other.top, &other.lines)
    }

    fn form(
        &mut self,
        view: &View,
        (form, questions, at): (FormId, &[Question], usize),
        to_experimenter: bool,
    ) {
        let Some(question) = questions.get(at) else {
            return;
        };
        if to_experimenter {
            self.lines.push("For the experimenter:".to_owned());
        } else if view.entry == Entry::Experimenter {
            self.lines.push("Ask the participant:".to_owned());
        }
        let (lines, prompt) = answers::ask(question, &view.words);
        self.lines.extend(lines);
        if let Some(given) = view.given(form, &question.id) {
            let answer = answers::in_words(given, &view.words);
            let kept = view.words.fill(Phrase::PlainKept, &[("answer", &answer)]);
            self.lines.push(kept);
        }
        self.prompt = prompt;
        if view.can_go_back || at > 0 {
            let back = view.words.get(Phrase::CommandBack);
            self.prompt.push_str(&format!(" /back: {back}."));
        }
        if view.can_replay {
            let again = view.words.get(Phrase::FeelAgain);
            self.prompt.push_str(&format!(" /replay: {again}."));
        }
    }

    fn trouble(&mut self, view: &View) {
        let Some(trouble) = Trouble::new(view, Theme::new(Colour::None)) else {
            return;
        };
        let (title, what, then) = trouble.words();
        self.lines.push(format!("{title}:"));
        self.lines.extend(answers::text(what));
        self.prompt = then.to_owned();
    }

    fn prose(&mut self, view: &View) {
        let Some(words) = prose(view) else {
            return;
        };
        let waits = matches!(&view.screen, Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } if *wait_s > 0.0);
        let (title, body) = match &view.screen {
            // These two show the time left in the body or the title.
            Screen::Reference { .. } if waits => (words.title, String::new()),
            Screen::Break { .. } => (String::new(), words.body),
            Screen::Paused { .. } => (words.title, String::new()),
            _ => (words.title, words.body),
        };
        if waits
            && let Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } = view.screen
        {
            self.wait = Some(view.words.wait(wait_s));
        }
        for part in [&words.above, &title, &body] {
            // The full screen marks some titles with a symbol.
            self.lines
                .extend(answers::text(part.trim_start_matches(['■', ' '])));
        }
        self.prompt = match &view.screen {
            Screen::ResumeChoice { .. } | Screen::Consent { .. } | Screen::Stopped { .. } => {
                let choices = words.choices.iter().map(|(key, what, more)| match *more {
                    "" => format!("{}: {what}.", typed(key, &view.words)),
                    more => format!("{}: {what}, {more}.", typed(key, &view.words)),
                });
                choices.collect::<Vec<_>>().join(" ")
            }
            Screen::Message { .. } => view.words.get(Phrase::PlainContinue).to_owned(),
            Screen::Paused { .. } => view.words.get(Phrase::PlainUnpause).to_owned(),
            Screen::End { .. } => view.words.get(Phrase::PlainClose).to_owned(),
            Screen::Reference { .. } | Screen::Break { .. } if view.can_advance => {
                view.words.get(Phrase::PlainReady).to_owned()
            }
            _ => String::new(),
        };
    }
}

fn typed(key: &str, words: &Words) -> String {
    match key {
        "Enter" => words.get(Phrase::PlainEnterAlone).to_owned(),
        key => words.fill(Phrase::PlainType, &[("key", &key)]),
    }
}
