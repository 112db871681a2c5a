//! What may be seen of a session. Nothing here identifies a realization.

use crate::outcome::FormId;
use crate::protocol::{Answer, DeviceKind, Entry, Question};
use study_base::text::QuestionId;

/// Everything that a screen shows.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The one thing to do now.
    pub screen: Screen,
    /// "trial 7 of 15", "practice 1 of 2"; `None` outside trials.
    pub progress: Option<Progress>,
    /// The experimenter's line.
    pub line: StatusLine,
    /// What gives the force: of the trial under way, or else of the study. Where it
    /// is [`DeviceKind::Manual`] nothing can be stopped, limp or counted.
    pub device: DeviceKind,
    /// Shown above everything: pilot, simulated.
    pub banner: Option<Banner>,
    /// One sentence for the operator, until the next input.
    pub notice: Option<String>,
    /// Who types.
    pub entry: Entry,
    /// Earlier answers that can be corrected, newest first.
    pub correctable: Vec<Correctable>,
    /// Whether a trial could be marked bad now, and which: "trial 7".
    pub can_mark_bad: Option<String>,
    /// Whether a table is loaded or playing, so that Space stops it.
    pub armed: bool,
    /// Whether Enter does anything now.
    pub can_advance: bool,
}

/// How far the participant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Whether these are practice trials.
    pub practice: bool,
    /// From 1: trials closed, and one. A trial that came back looks like any other.
    pub current: u32,
    /// How many there are.
    pub total: u32,
}

/// Why what is shown is no real data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Banner {
    /// A person tries the study out.
    Pilot,
    /// Nobody is there.
    Simulated,
}

/// The experimenter's line.
#[derive(Debug, Clone, PartialEq)]
pub struct StatusLine {
    /// Pseudonym; empty before it is known.
    pub participant: String,
    /// Operator; may be empty.
    pub operator: String,
    /// The device.
    pub device: DeviceState,
    /// Since the session was opened by this process, s.
    pub elapsed_s: f64,
    /// Trials that count and are on disk.
    pub trials_saved: u32,
    /// Trials that count and are answered.
    pub trials_answered: u32,
    /// Whether every event so far is on disk.
    pub all_saved: bool,
}

/// What the device does, as far as the session knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceState {
    /// Nothing is claimed yet.
    Unknown,
    /// No force, nothing loaded or loaded and not started.
    Limp,
    /// A table is on its way.
    Loading,
    /// Loaded, about to start.
    Ready,
    /// Playing: strokes and clamps so far, where somebody counts them.
    Running(Option<Counts>),
    /// Stop is asked and not confirmed.
    Stopping,
    /// It reported a fault.
    Fault,
    /// It does not answer.
    Lost,
    /// There is none: samples are mounted by hand.
    ByHand,
    /// A sample that was mounted by hand is felt.
    Felt,
}

/// What a device has counted in a playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Full strokes.
    pub strokes: u32,
    /// Clamps.
    pub clamps: u64,
}

/// The one thing to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Screen {
    /// Who is it: two text fields.
    Who {
        /// Preset participant id.
        participant: String,
        /// Preset operator.
        operator: String,
        /// Whether a claim is under way.
        claiming: bool,
    },
    /// An old unfinished session: choose.
    ResumeChoice {
        /// Since the last event, hours.
        gap_h: f64,
        /// Trials that count and are done.
        done: u32,
        /// Trials that count.
        total: u32,
    },
    /// The consent document.
    Consent {
        /// Title.
        document: String,
        /// Version.
        version: String,
    },
    /// Text to read; Enter goes on.
    Message {
        /// Which.
        kind: MessageKind,
        /// What.
        text: String,
    },
    /// Questions on one page: the first in full, an optional text below it.
    Form {
        /// Where the answers belong.
        form: FormId,
        /// One or two; the second is an optional text.
        questions: Vec<Question>,
        /// Page from 1.
        page: u32,
        /// Pages.
        pages: u32,
        /// Whether the experimenter is asked (setup).
        to_experimenter: bool,
    },
    /// The reference prompt before a trial.
    Reference {
        /// What to do.
        prompt: String,
        /// Seconds until Enter works; 0 when it does.
        wait_s: f64,
    },
    /// The table is on its way.
    Loading,
    /// The experimenter mounts a sample; Enter says that it is there.
    Mount {
        /// What stands on the sample: says nothing about what it is.
        code: String,
    },
    /// The device plays.
    Playing {
        /// Since the confirmed start, s.
        since_s: f64,
        /// Full strokes still needed before Enter works.
        strokes_missing: u32,
    },
    /// Stop is asked, the confirmation on its way.
    Stopping,
    /// Stopped by Esc, Space or a pause, or with too few strokes:
    /// [`PlayAgain`](super::Input::PlayAgain) or, where it can be rated,
    /// [`RateStopped`](super::Input::RateStopped).
    Stopped {
        /// Whether what was felt can be rated: the device confirmed its end and
        /// the strokes suffice.
        can_rate: bool,
    },
    /// Fault or loss: what the operator should do.
    DeviceTrouble {
        /// The device's words.
        what: String,
        /// Whether Enter goes on (the device is back, or nothing can be done).
        can_go_on: bool,
    },
    /// An answer is on its way to the disk.
    Saving,
    /// It could not be saved.
    SaveTrouble {
        /// Why.
        what: String,
    },
    /// A break of the design.
    Break {
        /// What to read.
        text: String,
        /// Seconds until Enter works.
        wait_s: f64,
    },
    /// Paused.
    Paused {
        /// For how long, s.
        since_s: f64,
    },
    /// Over.
    End {
        /// What to read.
        text: String,
    },
}

/// Which text is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind {
    /// First.
    Welcome,
    /// Before the trials.
    Instructions,
    /// Before the practice trials.
    Practice,
    /// Between practice and the trials that count.
    PracticeOver,
}

/// An earlier answer that can be corrected.
#[derive(Debug, Clone, PartialEq)]
pub struct Correctable {
    /// Where it was asked.
    pub form: FormId,
    /// "trial 6", "practice 1", "set-up", "intake", "closing questions". The number
    /// is the one that was on the screen.
    pub title: String,
    /// The question.
    pub question: Question,
    /// The answer now.
    pub answer: Answer,
}

impl Correctable {
    /// The question's id.
    pub fn id(&self) -> &QuestionId {
        &self.question.id
    }
}
