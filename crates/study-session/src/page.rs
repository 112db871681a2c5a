//! What a session shows, in words: the one interpretation of a [`View`].
//!
//! The terminal, the lines, the browser and the program of somebody else draw a [`Page`].
//! What only one of them has, such as the names of keys, is theirs; everything that a
//! participant or an experimenter reads is here. [`page`] is what the experimenter's
//! terminal shows; [`participant`] is what may leave it for a screen of the participant's
//! own, with the experimenter's pages replaced by a request to wait. Nothing here depends
//! on more than the view, which identifies no realization.
//!
//! docs/page.md specifies the JSON of a participant's page.

pub mod front;
mod of_view;
mod question;
pub mod reply;

pub use of_view::{ago, attending, page};
pub use question::{Asked, Field};

use crate::session::cue::Cue;
use crate::session::{Screen, View};
use serde::{Deserialize, Serialize};
use study_base::text::{Untrusted, capital, cut_end};
use study_plan::protocol::Turn;
use study_plan::protocol::phrases::{Phrase, Words};

/// A page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// What kind of page it is.
    pub kind: Kind,
    /// What the experimenter does with it, such as "Read out"; never on a participant's page.
    #[serde(skip)]
    pub instruction: Option<&'static str>,
    /// The number of the trial; on a participant's break, the trials that are done.
    pub progress: Option<Progress>,
    /// The page of a form with several pages.
    pub sheet: Option<Progress>,
    /// The trials that are done, during a break.
    #[serde(skip)]
    pub done: Option<Progress>,
    /// The interval that is felt or comes next, if the trial has several.
    pub interval: Option<Interval>,
    /// Whose data these are, if not those of a real participant.
    pub banner: Option<String>,
    /// The heading; empty if the first question is it.
    pub title: String,
    /// The text below the heading.
    pub text: String,
    /// What the experimenter can do about a fault; never on a participant's page.
    #[serde(skip)]
    pub advice: Option<String>,
    /// What has to be waited for, with the time left.
    pub wait: Option<String>,
    /// The same time alone, such as "0:30".
    #[serde(skip)]
    pub wait_clock: Option<String>,
    /// The time since the page opened, or the time left, where it is shown.
    pub clock: Option<String>,
    /// The course of a playback.
    #[serde(skip)]
    pub playback: Option<PlaybackWords>,
    /// What the participant's page shows and plays beside what is felt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub media: Option<Cue>,
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

/// The kinds of pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The experimenter acts; the participant waits.
    Wait,
    /// Who takes part. For the experimenter, as are the next two.
    Who,
    /// How to resume.
    Resume,
    /// A sample is mounted.
    Mount,
    /// A fault of the device. For the experimenter, as is the next one.
    DeviceTrouble,
    /// Something is not saved.
    SaveTrouble,
    /// Whether to take part.
    Consent,
    /// A text to read.
    Message,
    /// Questions, of the participant or of the experimenter.
    Questions,
    /// Before a trial.
    Reference,
    /// A presentation is prepared.
    Loading,
    /// Something is presented.
    Playing,
    /// It is being stopped.
    Stopping,
    /// It was stopped.
    Stopped,
    /// An answer is being saved; too short to be read.
    Saving,
    /// A scheduled break.
    Break,
    /// A pause, which the experimenter ends.
    Paused,
    /// The end.
    End,
}

/// Progress, as words and as numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Progress {
    /// Such as "trial 7 of 15".
    pub words: String,
    /// The number that is reached.
    pub at: u32,
    /// The largest number, if it is known.
    pub of: Option<u32>,
}

/// One of the intervals of a trial.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Interval {
    /// Its name, such as "first".
    pub name: String,
    /// Its number, from 1.
    pub at: u32,
    /// The number of intervals.
    pub of: u32,
}

/// The words for a playback that changes from moment to moment.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaybackWords {
    /// What happens: "playing".
    pub state: String,
    /// The time since the start, or the time left, as a clock.
    pub time: String,
    /// The time left, in words; `None` if nothing ends it.
    pub left: Option<String>,
    /// The whole time that it may take, in words.
    pub whole: Option<String>,
    /// The part that is over, until it can be ended or until it ends by itself.
    pub part: Option<f64>,
}

/// A button.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Button {
    /// What it does.
    pub does: Does,
    /// Its words.
    pub label: String,
    /// What follows from it; empty where that is clear.
    #[serde(skip)]
    pub note: &'static str,
    /// Whether it can be used now.
    pub enabled: bool,
}

/// What can be requested on a page.
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
    /// Takes a step down, where a level is set.
    Lower,
    /// Takes a step up.
    Higher,
    /// Feels the standard again, beside which a level is set.
    Compare,
    /// Declines the first question.
    Decline,
    /// Stops the device.
    Stop,
    /// Resumes with the block from its beginning.
    #[serde(skip_deserializing)]
    RestartBlock,
    /// Resumes where the session stopped.
    #[serde(skip_deserializing)]
    Continue,
    /// The participant does not return.
    #[serde(skip_deserializing)]
    DropOut,
    /// Tries to save again.
    #[serde(skip_deserializing)]
    RetrySave,
    /// Leaves the session.
    #[serde(skip_deserializing)]
    Quit,
}

impl Does {
    /// What it changes where a level is set.
    pub fn turn(self) -> Option<Turn> {
        match self {
            Self::Lower => Some(Turn::Lower),
            Self::Higher => Some(Turn::Higher),
            Self::Compare => Some(Turn::Standard),
            _ => None,
        }
    }
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

/// The page of a view for a screen of the participant's own; `None` while the last page
/// stays. Its texts are safe to show.
pub fn participant(view: &View) -> Option<Page> {
    let mut page = page(view);
    match page.kind {
        // Too short to be read.
        Kind::Saving => return None,
        // The experimenter acts.
        Kind::DeviceTrouble | Kind::SaveTrouble => page.waits_for_experimenter(&view.words),
        _ if page.is_of_experimenter(view) => page.waits_for_experimenter(&view.words),
        // The experimenter ends it.
        Kind::Paused | Kind::End => {
            page.clock = None;
            page.buttons.clear();
        }
        _ => {}
    }
    page.progress = page.done.take().or(page.progress);
    // It shows `clock` and `wait`; what it does not show must not make it another page.
    (page.playback, page.wait_clock) = (None, None);
    if let Some(interval) = &page.interval {
        // An interval is the heading.
        if page.title.is_empty() {
            page.title = capital(&interval.name);
        }
    }
    Some(page.finished())
}

impl Page {
    /// Whether the page can request this now.
    pub fn offers(&self, does: Does) -> bool {
        match does {
            Does::Stop => true,
            Does::Refuse => self.refuse.is_some(),
            Does::Decline => self.decline.is_some(),
            does => self.button_of(does).is_some_and(|b| b.enabled),
        }
    }

    /// Whether the page of a view asks the experimenter for something, apart from faults.
    pub fn is_of_experimenter(&self, view: &View) -> bool {
        let asks = matches!(
            view.screen,
            Screen::Form {
                to_experimenter: true,
                ..
            }
        );
        asks || matches!(self.kind, Kind::Who | Kind::Resume | Kind::Mount)
    }

    /// The button that does something.
    pub fn button_of(&self, does: Does) -> Option<&Button> {
        self.buttons.iter().find(|b| b.does == does)
    }

    /// The page without what changes while it is shown.
    pub fn still(&self) -> Self {
        let mut page = self.timeless();
        // The text of a reference prompt appears when the wait is over.
        page.text.clear();
        page
    }

    /// The page without the times on it, as [`retrace`](crate::session::retrace) shows it.
    pub fn timeless(&self) -> Self {
        let mut page = self.clone();
        (page.wait, page.clock) = (None, None);
        for button in &mut page.buttons {
            button.enabled = true;
        }
        page
    }

    /// Replaces a page of the experimenter's.
    fn waits_for_experimenter(&mut self, words: &Words) {
        *self = Self {
            kind: Kind::Wait,
            instruction: None,
            sheet: None,
            title: words.get(Phrase::OneMoment).to_owned(),
            text: String::new(),
            advice: None,
            media: None,
            questions: Vec::new(),
            buttons: Vec::new(),
            decline: None,
            ..self.clone()
        };
    }

    /// With capital letters and safe texts.
    fn finished(mut self) -> Self {
        let sentence = |text: &mut String| *text = capital(text);
        for progress in [&mut self.progress, &mut self.sheet].into_iter().flatten() {
            sentence(&mut progress.words);
        }
        for button in &mut self.buttons {
            sentence(&mut button.label);
        }
        for dialog in [&mut self.decline, &mut self.refuse].into_iter().flatten() {
            sentence(&mut dialog.open);
            sentence(&mut dialog.confirm);
            sentence(&mut dialog.back);
        }
        self.stop.iter_mut().for_each(sentence);
        self.title = safe(&self.title);
        self.text = safe(&self.text);
        for shown in self.media.iter_mut().flat_map(|cue| &mut cue.media) {
            for text in [&mut shown.alt, &mut shown.caption].into_iter().flatten() {
                *text = safe(text);
            }
        }
        // In a word: a phone is narrow.
        if let Some((short, _)) = self.banner.as_ref().and_then(|b| b.split_once(" — ")) {
            self.banner = Some(short.to_owned());
        }
        self
    }
}

/// Whether two screens are the same page, apart from numbers on it.
pub fn same_page(a: &Screen, b: &Screen) -> bool {
    match (a, b) {
        (
            Screen::Form {
                form: p1,
                page: n1,
                questions: q1,
                ..
            },
            Screen::Form {
                form: p2,
                page: n2,
                questions: q2,
                ..
            },
        ) => (p1, n1, q1) == (p2, n2, q2),
        (Screen::Message { kind: a, .. }, Screen::Message { kind: b, .. }) => a == b,
        (a, b) => std::mem::discriminant(a) == std::mem::discriminant(b),
    }
}

/// What is said of a request that is possible only in a session.
pub const NOT_BEGUN: &str = "That is possible once the session has begun.";

/// What is asked before the program is left; `None` where nothing is under way any more.
pub fn before_leaving(view: &View) -> Option<&str> {
    match view.screen {
        Screen::Who { .. } => Some("No session has begun. Leave?"),
        Screen::End { .. } => None,
        _ => Some(view.words.get(Phrase::PlainLeave)),
    }
}

/// Why nothing is presented again now, and when it can be.
pub fn why_not_again(view: &View) -> &str {
    view.words.get(match view.has_replays {
        true => Phrase::PlainNoReplay,
        false => Phrase::NeverReplay,
    })
}

/// The names of what is not saved as lines of safe text; the last one counts those for
/// which there is no room.
pub fn unsaved_lines(names: &[String], most: usize, columns: usize) -> Vec<String> {
    let shown = match names.len() > most {
        true => most.saturating_sub(1),
        false => names.len(),
    };
    let line = |name: &String| {
        let name = name.replace("\r\n", "\n").replace(['\n', '\r'], " ⏎ ");
        cut_end(&Untrusted(&name).to_string(), columns)
    };
    let mut lines: Vec<String> = names[..shown].iter().map(line).collect();
    if shown < names.len() {
        lines.push(format!("… and {} more", names.len() - shown));
    }
    lines
}

/// A duration in s as `m:ss` or `h:mm:ss`; `0:00` if it is not finite.
///
/// ```
/// # use study_session::page::clock;
/// assert_eq!((clock(75.0), clock(3675.0)), ("1:15".into(), "1:01:15".into()));
/// ```
pub fn clock(seconds: f64) -> String {
    let s = match seconds.is_finite() {
        true => seconds.clamp(0.0, 1e9) as u64,
        false => 0,
    };
    match s {
        ..3600 => format!("{}:{:02}", s / 60, s % 60),
        _ => format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60),
    }
}

/// Text of a protocol; its line breaks stay.
fn safe(text: &str) -> String {
    let lines = text.trim_end().lines();
    let lines: Vec<String> = lines.map(|line| Untrusted(line).to_string()).collect();
    lines.join("\n")
}

#[cfg(test)]
mod tests;
