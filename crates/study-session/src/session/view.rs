//! What a session shows. Nothing here identifies a realization.

use super::cue::Cue;
use super::roster::Roster;
use crate::outcome::FormId;
use std::sync::Arc;
use study_base::text::QuestionId;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{AdjustmentWords, Answer, DeviceKind, Entry, Exposure, Question};

/// The content of the screen.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The main content: what to do now.
    pub screen: Screen,
    /// "trial 7 of 15", "practice 1 of 2"; `None` outside trials.
    pub progress: Option<Progress>,
    /// The experimenter's status line.
    pub line: StatusLine,
    /// How far the session is, for the experimenter's desk.
    pub course: Course,
    /// Kind of the device of the trial under way, or else of the study. A
    /// [`DeviceKind::Manual`] one cannot be stopped, made limp or report counts.
    pub device: DeviceKind,
    /// Banner above everything else.
    pub banner: Option<Banner>,
    /// Message to the operator until the next input.
    pub notice: Option<String>,
    /// Who enters the participant's answers.
    pub entry: Entry,
    /// Earlier answers that can be corrected: the newest form first, in each the questions
    /// in their order.
    pub correctable: Vec<Correctable>,
    /// The trial that can be marked as bad now, such as "trial 7".
    pub can_mark_bad: Option<String>,
    /// Whether a table is loaded or playing, so that Space stops it.
    pub armed: bool,
    /// What is in memory only because saving has failed, such as "trial 3: realism = 5";
    /// empty otherwise.
    pub unsaved: Vec<String>,
    /// Whether all intervals of the trial can be felt again:
    /// [`PlayAgain`](super::Input::PlayAgain).
    pub can_replay: bool,
    /// Whether that is possible at some trial of the study.
    pub has_replays: bool,
    /// Whether there is an earlier page of questions: [`Back`](super::Input::Back).
    pub can_go_back: bool,
    /// Whether what is presented is a force; else a program of the laboratory presents
    /// something else.
    pub force: bool,
    /// Whether the first interval of the trial is a reference, and the second one is
    /// rated.
    pub has_reference: bool,
    /// Whether the intervals of the trial have numbers for names.
    pub numbered: bool,
    /// The adjustment under way, until its level is confirmed.
    pub adjusting: Option<Adjusting>,
    /// What the participant's page shows and plays now. Its names are of contents and tell nothing of what is felt.
    pub cue: Option<Cue>,
    /// Whether a trial waits until the participant's page has its media and is in sight.
    pub awaits_page: bool,
    /// The experimenter's last remarks in this sitting, newest first.
    pub remarks: Vec<String>,
    /// Whether Enter has an effect now.
    pub can_advance: bool,
    /// The fixed sentences that a participant reads.
    pub words: Arc<Words>,
}

impl View {
    /// The present answer to a question of a form, if it was answered.
    pub fn given(&self, form: FormId, question: &QuestionId) -> Option<&Answer> {
        let mut earlier = self.correctable.iter();
        let found = earlier.find(|c| c.form == form && c.question.id == *question);
        found.map(|c| &c.answer)
    }

    /// The name of an interval, from 1. No trial whose intervals are not numbered has more than three.
    pub fn interval_name(&self, interval: u32) -> String {
        if self.numbered {
            let number = &[("n", &interval as &dyn std::fmt::Display)];
            return self.words.fill(Phrase::NumberedInterval, number);
        }
        let name = match (self.has_reference, interval) {
            (true, 1) => Phrase::ReferenceInterval,
            (true, _) => Phrase::ToRate,
            (false, 1) => Phrase::First,
            (false, 2) => Phrase::Second,
            (false, _) => Phrase::Third,
        };
        self.words.get(name).to_owned()
    }
}

/// A level that the participant sets. Only the ends of its ladder can be told from it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adjusting {
    /// What the participant is to do.
    pub prompt: String,
    /// What the steps and the confirmation are called.
    pub words: AdjustmentWords,
    /// Whether a step down is possible.
    pub can_lower: bool,
    /// Whether a step up is possible.
    pub can_higher: bool,
    /// Whether there is a standard, which can be felt again.
    pub has_standard: bool,
    /// Whether the standard is felt; then the level follows.
    pub at_standard: bool,
}

/// The participant's progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Whether these are practice trials.
    pub practice: bool,
    /// Number of closed trials plus 1. A repeated trial looks like any other.
    pub current: u32,
    /// Number of trials; `None` if it depends on the answers.
    pub total: Option<u32>,
    /// Trials of a block, if there are several blocks and all are as long.
    pub block: Option<u32>,
}

/// Why the data are not those of a real participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Banner {
    /// Pilot.
    Pilot,
    /// Simulated participant.
    Simulated,
}

/// The experimenter's line.
#[derive(Debug, Clone, PartialEq)]
pub struct StatusLine {
    /// Pseudonym; empty before it is typed.
    pub participant: String,
    /// Operator code; may be empty.
    pub operator: String,
    /// State of the device.
    pub device: DeviceState,
    /// Time since this process opened the session, s.
    pub elapsed_s: f64,
    /// Number of completed trials on disk, without practice.
    pub trials_saved: u32,
    /// Number of completed trials, without practice.
    pub trials_answered: u32,
    /// Whether every event is on disk.
    pub all_saved: bool,
    /// The state of the mirror; `None` without one.
    pub mirror: Option<Mirror>,
}

/// How far a session is. Nothing in it depends on what was felt or answered, except by the time that
/// it took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Course {
    /// Session of the participant, from 1; 0 before it is claimed.
    pub session: u32,
    /// The part of the trial under way or to come: its place in the session, from 1, and the number of
    /// parts. `None` without parts, and where they alternate, since the place would tell something of each trial.
    pub part: Option<(u32, u32)>,
    /// Number of closed trials, without practice.
    pub done: u32,
    /// Number of trials, without practice; `None` before the session has started, and if it depends on
    /// the answers.
    pub total: Option<u32>,
    /// Full strokes that the trial under way requires.
    pub minimum_strokes: u32,
    /// Time until the last trial is closed at the pace so far, s; `None` while it is not known.
    pub left_s: Option<f64>,
}

/// Which of results folder and mirror are up to date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirror {
    /// Both.
    InStep,
    /// Only the results folder.
    OnlyResults,
    /// Only the mirror.
    OnlyMirror,
}

/// The state of the device as far as the session knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceState {
    /// No session is claimed yet.
    Unknown,
    /// No force: nothing is playing.
    Limp,
    /// A table is being loaded.
    Loading,
    /// Loaded and about to start.
    Ready,
    /// Playing.
    Running(Telemetry),
    /// A stop is requested and not confirmed.
    Stopping,
    /// It reported a fault.
    Fault,
    /// It does not respond.
    Lost,
    /// There is no device: samples are mounted by hand.
    ByHand,
    /// A sample mounted by hand is being felt.
    Felt,
}

/// Whether telemetry of a playback arrives. Its content is never shown: strokes, clamps
/// and forces depend on the realization.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Telemetry {
    /// The device reports none.
    None,
    /// It arrives.
    Arrives,
    /// Nothing has arrived for a while.
    Silent,
}

/// The main content of the screen.
#[derive(Debug, Clone, PartialEq)]
pub enum Screen {
    /// Two text fields: participant and operator.
    Who {
        /// Preset participant id.
        participant: String,
        /// Preset operator.
        operator: String,
        /// Tells who a typed id is.
        roster: Option<Arc<Roster>>,
        /// Whether the session is being claimed.
        claiming: bool,
    },
    /// The choice how to resume after a long gap.
    ResumeChoice {
        /// Time since the last activity, h.
        gap_h: f64,
        /// Number of closed trials, without practice.
        done: u32,
        /// Number of trials, without practice; `None` if it depends on the answers.
        total: Option<u32>,
        /// Whether the block under way can be restarted; a search cannot.
        restart: bool,
    },
    /// The consent document.
    Consent {
        /// Title; or title, version and the whole text.
        document: String,
        /// Version; empty if it is in the document.
        version: String,
    },
    /// A text to read; Enter continues.
    Message {
        /// Kind of message.
        kind: MessageKind,
        /// Text.
        text: String,
    },
    /// A page of a form.
    Form {
        /// Form.
        form: FormId,
        /// One question, or two of which the second is an optional text.
        questions: Vec<Question>,
        /// Page, from 1.
        page: u32,
        /// Number of pages.
        pages: u32,
        /// Whether the experimenter is asked (set-up).
        to_experimenter: bool,
    },
    /// The reference prompt before a trial.
    Reference {
        /// Prompt.
        prompt: String,
        /// Time until Enter works, s; 0 when it does.
        wait_s: f64,
    },
    /// The table is being loaded, or the gap before the next interval passes.
    Loading {
        /// The interval that comes, from 1, and their number, if there are several.
        interval: Option<(u32, u32)>,
    },
    /// The experimenter mounts a sample and confirms with Enter.
    Mount {
        /// Opaque code on the sample.
        code: String,
    },
    /// The device plays.
    Playing {
        /// Time since the confirmed start, s.
        since_s: f64,
        /// Whether more exploration is required before Enter works.
        keep_exploring: bool,
        /// How long it is felt.
        exposure: Exposure,
        /// The interval, from 1, and their number, if there are several.
        interval: Option<(u32, u32)>,
    },
    /// A stop is requested and not yet confirmed.
    Stopping,
    /// Stopped by Esc, Space or a pause, or with too few strokes:
    /// [`PlayAgain`](super::Input::PlayAgain) or, where it can be rated,
    /// [`RateStopped`](super::Input::RateStopped).
    Stopped {
        /// Whether the trial can be rated: the end is confirmed and the strokes
        /// suffice.
        can_rate: bool,
    },
    /// A fault or loss of the device.
    DeviceTrouble {
        /// The device's message.
        what: String,
        /// Whether Enter continues: the device is back or not needed.
        can_go_on: bool,
    },
    /// Saving.
    Saving,
    /// Saving failed.
    SaveTrouble {
        /// Cause.
        what: String,
    },
    /// A scheduled break.
    Break {
        /// Text.
        text: String,
        /// Time until Enter works, s.
        wait_s: f64,
        /// Number of closed trials, without practice.
        done: u32,
        /// Number of trials, without practice; `None` if it depends on the answers.
        total: Option<u32>,
    },
    /// A pause.
    Paused {
        /// Its duration so far, s.
        since_s: f64,
    },
    /// The end of the session.
    End {
        /// Text.
        text: String,
    },
}

/// The kind of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind {
    /// Welcome.
    Welcome,
    /// Instructions, before the trials.
    Instructions,
    /// Announcement of the practice trials.
    Practice,
    /// End of the practice trials.
    PracticeOver,
    /// Before the first trial of a part.
    Part,
    /// Whether the answer was correct.
    Feedback,
    /// What the study was about, after all questions.
    Debriefing,
}

/// An earlier answer that can be corrected.
#[derive(Debug, Clone, PartialEq)]
pub struct Correctable {
    /// Form.
    pub form: FormId,
    /// Title such as "trial 6", "practice 1", "set-up", "intake" or "closing
    /// questions"; the number is that on the screen.
    pub title: String,
    /// Question.
    pub question: Question,
    /// Current answer.
    pub answer: Answer,
}

impl Correctable {
    /// The question's id.
    pub fn id(&self) -> &QuestionId {
        &self.question.id
    }
}
