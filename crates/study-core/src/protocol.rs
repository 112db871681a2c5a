//! What the study file says, checked for itself.
//!
//! A [`Protocol`] is the content of a `protocol.toml`: plain data, complete, and
//! true in itself (ids do not collide, scales go up, limits are limits). It knows
//! nothing of the models' contents; whoever opens files joins the two.
//! Reading is in [`mod@file`], what can be doubted about a readable file in [`check`].

pub mod check;
pub mod columns;
pub mod example;
pub mod file;
pub mod fingerprint;
pub mod plan;
pub mod question;

pub use plan::{Seat, Trial};
pub use question::{Answer, Question, QuestionKind};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::limits::{Limit, Limits};
use study_base::text::{ModelId, QuestionId};

/// The version of the file format that this program writes and reads.
pub const FORMAT: &str = "study-protocol/1";

/// A whole study file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Protocol {
    /// `[study]`
    pub study: Study,
    /// `[text]`
    pub text: Text,
    /// `[consent]`
    pub consent: Option<Consent>,
    /// `[design]`
    pub design: Design,
    /// `[session]`
    pub session: SessionRules,
    /// `[device]`
    pub device: DeviceRules,
    /// `[trial]`
    pub trial: TrialRules,
    /// `[[models]]`, in the order of the file.
    pub models: Vec<ModelEntry>,
    /// `[[questions]]`, asked after each trial.
    pub questions: Vec<Question>,
    /// `[[setup]]`, asked of the experimenter before the first trial.
    pub setup: Vec<Question>,
    /// `[[intake]]`, asked of the participant once.
    pub intake: Vec<Question>,
    /// `[[outro]]`, asked of the participant at the end.
    pub outro: Vec<Question>,
    /// `[analysis]`
    pub analysis: AnalysisRules,
}

/// `[study]`: what the study is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Study {
    /// Names the results folder: `[a-z0-9-]`, 1 to 64 characters.
    pub id: String,
    /// For people.
    pub title: String,
    /// The whole study's randomness.
    pub seed: u64,
    /// Who made it.
    pub authors: Vec<String>,
    /// Of the data.
    pub license: Option<String>,
    /// Approval number or statement.
    pub ethics: Option<String>,
    /// Whom to ask.
    pub contact: Option<String>,
    /// Who paid.
    pub funding: Option<String>,
    /// Of the study or its paper.
    pub doi: Option<String>,
}

/// `[text]`: what participants read, in any language.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Text {
    /// First screen.
    pub welcome: Option<String>,
    /// Before the first trial.
    pub instructions: Option<String>,
    /// Before the practice trials.
    pub practice: Option<String>,
    /// During a break; `break` in the file.
    pub rest: Option<String>,
    /// Last screen.
    pub end: Option<String>,
    /// BCP 47 tag of the texts.
    pub lang: Option<String>,
}

/// `[consent]`: the document that the participant agrees to. No name is stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Consent {
    /// Its title or file name.
    pub document: String,
    /// Its version.
    pub version: String,
}

/// `[design]`: who feels what, how often, in which order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    /// Planned participants; analysis before that many says "interim".
    pub participants: u32,
    /// How often each realization that is no practice is felt.
    pub repetitions: u32,
    /// How orders are made.
    pub order: Order,
    /// At most so many trials in a row with the same realization.
    pub max_run: Option<u32>,
    /// Positions of the same realization differ by at least this.
    pub min_distance: Option<u32>,
    /// Practice trials, in this order, before all others.
    pub practice: Vec<ModelId>,
    /// Rests.
    pub breaks: Option<Breaks>,
    /// Failed attempts after which a trial is closed as failed.
    pub max_attempts: u32,
}

/// How the order of trials is made; `docs/schedule.md` specifies each.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// A fresh random permutation of the realizations in each repetition.
    Blocked,
    /// One random order of all trials.
    Shuffled,
    /// Lines of a Williams design: first-order carry-over balanced.
    Williams,
    /// Lines of a cyclic Latin square: positions balanced.
    LatinSquare,
    /// The order of the file, in each repetition.
    Fixed,
    /// Read from a CSV `row,position,model`, a path relative to the protocol.
    File(String),
}

/// The orders of an `orders.csv`: row → realizations by position.
pub type FileOrders = BTreeMap<u32, Vec<ModelId>>;

/// A rest after every so many trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Breaks {
    /// After every so many trials (practice not counted).
    pub every: u32,
    /// Seconds before the session can go on.
    pub at_least_s: f64,
}

/// `[session]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SessionRules {
    /// Who types the answers.
    pub entry: Entry,
    /// Hours after which an unfinished session does not simply go on.
    pub resume_within_h: f64,
}

/// Who types the participant's answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Entry {
    /// The participant, on a screen of their own.
    Participant,
    /// The experimenter, who hears them.
    Experimenter,
}

/// `[device]`: what plays the realizations. Port and baud are never here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceRules {
    /// Which kind.
    pub kind: DeviceKind,
    /// What a playback may never exceed.
    pub limits: Limits,
    /// Permission to play tables that fail their passivity certificate.
    pub uncertified: Option<Uncertified>,
}

/// What kind of device plays a realization.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// The one in this program.
    Simulated,
    /// A device on a serial port.
    Serial,
    /// A child program of the lab's.
    Process,
    /// A sample mounted by hand.
    Manual,
}

impl DeviceKind {
    /// As in the protocol file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Serial => "serial",
            Self::Process => "process",
            Self::Manual => "manual",
        }
    }
}

/// Permission to play tables that fail their certificate, under a lower force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Uncertified {
    /// Whether they are played at all.
    pub play: bool,
    /// Largest force for them, N.
    pub force_n: Limit,
    /// Why; stands in every session.
    pub reason: String,
}

/// `[trial]`
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialRules {
    /// Shown before each trial.
    pub reference: Option<String>,
    /// Seconds that it stays at least.
    pub reference_min_s: f64,
    /// Full strokes before the rating opens.
    pub minimum_strokes: u32,
}

/// One of `[[models]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelEntry {
    /// Its name in every file.
    pub id: ModelId,
    /// Its table, relative to the protocol, inside the protocol's folder.
    pub file: Option<String>,
    /// Variance accounted for, (−∞, 1]; absent: the model file's.
    pub vaf: Option<f64>,
    /// What it is in the study.
    pub role: Role,
    /// The id that this one repeats in secret.
    pub duplicate_of: Option<ModelId>,
    /// A device of its own, such as a sample mounted by hand.
    pub device: Option<DeviceKind>,
    /// Numbers that may explain the ratings; each becomes a column.
    pub covariates: BTreeMap<String, f64>,
}

/// What a realization is in the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// What the study asks about.
    Test,
    /// Only for practice trials.
    Practice,
    /// The target itself, among the others.
    HiddenReference,
    /// Known to be bad.
    LowAnchor,
    /// A physical sample.
    Physical,
}

impl Role {
    /// As in the protocol file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Test => "test",
            Self::Practice => "practice",
            Self::HiddenReference => "hidden-reference",
            Self::LowAnchor => "low-anchor",
            Self::Physical => "physical",
        }
    }
}

/// `[analysis]`: what was decided before the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnalysisRules {
    /// The question that the analysis is about.
    pub primary: QuestionId,
    /// The recording whose VAF counts, by its name in the model files.
    pub vaf: Option<String>,
    /// Ratings from here up count as realistic.
    pub realistic_from: Option<f64>,
    /// Differences from a hidden reference below this, in points of the primary
    /// scale, count as none; above 0. Left out of the fingerprint where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equivalence_margin: Option<f64>,
    /// Whether unfinished sessions are analysed.
    pub unfinished: Unfinished,
    /// Pre-stated exclusions.
    pub exclude: Vec<ExclusionRule>,
}

/// Whether unfinished sessions enter the analysis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unfinished {
    /// They do.
    Include,
    /// They do not.
    Exclude,
}

/// One of `[[analysis.exclude]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExclusionRule {
    /// Its name, such as `constant-rater`.
    pub rule: String,
    /// Its parameters.
    pub parameters: BTreeMap<String, f64>,
}

impl Protocol {
    /// The entry with an id.
    pub fn model(&self, id: &ModelId) -> Option<&ModelEntry> {
        self.models.iter().find(|m| m.id == *id)
    }

    /// The realizations that each repetition contains: all but practice ones.
    pub fn scheduled_models(&self) -> impl Iterator<Item = &ModelEntry> {
        self.models.iter().filter(|m| m.role != Role::Practice)
    }

    /// The question that the analysis is about.
    pub fn primary(&self) -> Option<&Question> {
        self.questions
            .iter()
            .find(|q| q.id == self.analysis.primary)
    }
}
