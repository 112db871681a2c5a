//! The lines of a page.

use super::answers;
use crate::tui::keys;
use crate::tui::views::prose::choices;
use crate::tui::wrap;
use study_base::text::sentence;
use study_plan::protocol::Question;
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::outcome::FormId;
use study_session::page::{self, Button, Does, Kind, attending};
use study_session::session::{Screen, View};

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

/// The lines of a view, with its form at question number `at`. `keys` says whether single
/// keys can be read.
pub fn page(view: &View, at: usize, keys: bool) -> Page {
    let content = page::page(view);
    let parts = [&content.progress, &content.sheet, &content.done];
    let top: Vec<String> = (parts.into_iter().flatten())
        .map(|part| sentence(&part.words))
        .collect();
    let mut page = Page {
        top: Some(top.join(" "))
            .filter(|top| !top.is_empty())
            .into_iter()
            .collect(),
        ..Page::default()
    };
    match &view.screen {
        Screen::Who {
            claiming: false, ..
        } => {}
        Screen::Form {
            form, questions, ..
        } => page.form(view, &content, (*form, questions, at)),
        Screen::Playing { .. } => page.playing(view, &content, keys),
        _ => page.prose(view, &content),
    }
    page
}

impl Page {
    /// Whether the pages differ at most in what is waited for and can be done.
    pub fn is_like(&self, other: &Self) -> bool {
        (&self.top, &self.lines) == (&other.top, &other.lines)
    }

    fn form(
        &mut self,
        view: &View,
        content: &page::Page,
        (form, questions, at): (FormId, &[Question], usize),
    ) {
        let Some(question) = questions.get(at) else {
            return;
        };
        let instruction = content.instruction.map(|words| format!("{words}:"));
        self.lines.extend(instruction);
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
        if let Some(again) = content.button_of(Does::Replay) {
            self.prompt.push_str(&format!(" /replay: {}.", again.label));
        }
    }

    fn playing(&mut self, view: &View, content: &page::Page, keys: bool) {
        let words = &view.words;
        if let Some(interval) = &content.interval {
            let which = sentence(&interval.name);
            self.lines
                .push(format!("{which} ({} / {})", interval.at, interval.of));
        }
        // A device cannot be seen to play by those who only hear.
        let attend = match attending(view).0 {
            Phrase::FeelDevice => Phrase::PlainPlays,
            other => other,
        };
        self.lines.push(words.get(attend).to_owned());
        let set = view.adjusting.as_ref().filter(|own| !own.at_standard);
        if let Some(own) = set {
            let mut lines = answers::text(&own.prompt);
            lines.append(&mut self.lines);
            self.lines = lines;
        }
        // Said once; a countdown would never end to be read.
        let whole = content.playback.as_ref().and_then(|p| p.whole.as_ref());
        self.wait = whole.map(|whole| sentence(whole));
        self.prompt = match (&content.wait, keys) {
            (Some(more), _) => more.clone(),
            (None, true) => words.get(Phrase::PlainRate).to_owned(),
            (None, false) => words.get(Phrase::PlainContinue).to_owned(),
        };
        if set.is_some() {
            let choice = |b: &Button| format!("{}: {}.", typed(said(b.does), words), b.label);
            let enabled = content.buttons.iter().filter(|b| b.enabled).map(choice);
            let all = content.wait.iter().cloned().chain(enabled);
            self.prompt = all.collect::<Vec<_>>().join(" ");
        }
    }

    fn prose(&mut self, view: &View, content: &page::Page) {
        let text = match content.kind {
            Kind::Message | Kind::Break | Kind::End | Kind::Consent => &wrap::flow(&content.text),
            _ => &content.text,
        };
        let title = match &content.advice {
            Some(_) => &format!("{}:", content.title),
            None => &content.title,
        };
        for part in [content.instruction.unwrap_or_default(), title, text] {
            self.lines.extend(answers::text(part));
        }
        self.wait.clone_from(&content.wait);
        self.prompt = match content.kind {
            Kind::Resume | Kind::Consent | Kind::Stopped => {
                let choice = |(key, what, note): (&str, String, &str)| match note {
                    "" => format!("{}: {what}.", typed(key, &view.words)),
                    note => format!("{}: {what}, {note}.", typed(key, &view.words)),
                };
                let choices = choices(content).into_iter().map(choice);
                choices.collect::<Vec<_>>().join(" ")
            }
            Kind::Message => view.words.get(Phrase::PlainContinue).to_owned(),
            Kind::Paused => view.words.get(Phrase::PlainUnpause).to_owned(),
            Kind::End => view.words.get(Phrase::PlainClose).to_owned(),
            Kind::Reference | Kind::Break if view.can_advance => {
                view.words.get(Phrase::PlainReady).to_owned()
            }
            _ => content.advice.clone().unwrap_or_default(),
        };
    }
}

/// What is typed for a step, where a key has an arrow.
fn said(does: Does) -> &'static str {
    match does {
        Does::Lower => "-",
        Does::Higher => "+",
        other => keys::of(other),
    }
}

fn typed(key: &str, words: &Words) -> String {
    match key {
        "Enter" => words.get(Phrase::PlainEnterAlone).to_owned(),
        key => words.fill(Phrase::PlainType, &[("key", &key)]),
    }
}
