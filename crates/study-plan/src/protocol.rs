//! The study file, checked for itself.
//!
//! A [`Protocol`] is the content of a `protocol.toml` as plain data. It is complete
//! and consistent: ids do not collide, scales go up, limits are finite and
//! positive. It holds the names of model files, not their contents; `study`'s
//! `load` joins the two. [`mod@file`] reads it, [`check`] warns of doubtful designs,
//! [`keys`] declares what a file can hold, and `docs/protocol.md` documents every
//! key.

pub mod adjustment;
pub mod answer;
pub mod check;
pub mod columns;
pub mod conditions;
pub mod confirms;
pub mod control;
pub mod design;
pub mod difference;
pub mod example;
pub mod factors;
pub mod file;
pub mod fingerprint;
pub mod groups;
pub mod identification;
pub mod keys;
pub mod kinds;
pub mod media;
pub mod outcomes;
pub mod pairs;
mod part_design;
pub mod parts;
pub mod phrases;
pub mod plan;
pub mod power;
pub mod presentations;
pub mod procedures;
pub mod question;
pub mod questionnaires;
pub mod ranking;
pub mod relative;
pub mod rules;
pub mod scale;
pub mod schema;
pub mod scoring;
mod section;
pub mod similarity;
pub mod spaces;

pub use adjustment::{Adjustment, AdjustmentWords, Turn};
pub use answer::{Answer, Given, Refusal};
pub use confirms::Confirms;
pub use control::{Control, Pick};
pub use design::{Breaks, Design, FileOrders, Order, OrderVersion, PartsOrder};
pub use factors::{Crossing, Factor};
pub use groups::{Assign, Assigned, GroupRules, Groups, SessionPlan};
pub use identification::{Criterion, Drawn, Feedback, Identification, Label};
pub use kinds::QuestionKind;
pub use media::{MEDIA_WITHIN_MS, Media, MediaFile, MediaFormat, Medium};
pub use outcomes::{
    Answers, BetterEnd, Clock, DeviceNumber, Measure, OutcomeFamily, OutcomeRules, Telemetry,
    Transform,
};
pub use pairs::{IntervalOrder, Pairs};
pub use parts::{
    Compared, Exposure, FamilyRules, FitRules, Interval, Method, Part, Task, TrackRules, Vary,
};
pub use plan::{Seat, Stimuli, Trial};
pub use presentations::{Magnitude, Mushra, Presentations, Standard};
pub use question::Question;
pub use questionnaires::{Inventory, Occasion, Questionnaire, Scored};
pub use ranking::Ranking;
pub use relative::Relative;
pub use rules::Exclusion;
pub use scale::Scale;
pub use scoring::{Scoring, Subscale, Total};
pub use similarity::Similarity;
pub use spaces::{Axis, SearchTask, SpaceRules};

use keys::words;
use serde::Serialize;
use std::collections::BTreeMap;
use study_base::hex::sha256;
use study_base::limits::{Limit, Limits};
use study_base::text::{ModelId, QuestionId};

/// The file format, with its version, of a protocol without parts.
pub const FORMAT: &str = "study-protocol/1";
/// The format that `[[parts]]`, `[[families]]`, `[[tracks]]`, `[groups]` and `[[sessions]]` need.
pub const FORMAT_2: &str = "study-protocol/2";
/// The format that the keys of [`file::OF_FORMAT_3`] need.
pub const FORMAT_3: &str = "study-protocol/3";

/// A whole study file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Protocol {
    /// `[study]`
    pub study: Study,
    /// `[text]`
    pub text: Text,
    /// `[consent]`
    pub consent: Option<Consent>,
    /// `[debriefing]`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub debriefing: Option<Debriefing>,
    /// `[confirms]`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirms: Option<Confirms>,
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
    /// `[[factors]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub factors: Vec<Factor>,
    /// `[[questions]]`, asked after each trial.
    pub questions: Vec<Question>,
    /// `[[setup]]`, asked of the experimenter before the first trial.
    pub setup: Vec<Question>,
    /// `[[intake]]`, asked of the participant once.
    pub intake: Vec<Question>,
    /// `[[outro]]` and the items of the questionnaires after it, asked of the participant at the end.
    pub outro: Vec<Question>,
    /// `[[questionnaires]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub questionnaires: Vec<Questionnaire>,
    /// `[[outcomes]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outcomes: Vec<OutcomeRules>,
    /// `[analysis]`
    pub analysis: AnalysisRules,
    /// `[[parts]]`; without any, the study is one rating part.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Part>,
    /// `[[families]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub families: Vec<FamilyRules>,
    /// `[[spaces]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub spaces: Vec<SpaceRules>,
    /// `[[tracks]]`
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tracks: Vec<TrackRules>,
    /// `[groups]`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub groups: Option<Groups>,
    /// `[[sessions]]`; without any, a participant comes once.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sessions: Vec<SessionPlan>,
    /// `[power]`; in no fingerprint.
    #[serde(skip)]
    pub power: power::PowerPlan,
}

/// `[study]`: identity and provenance of the study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Study {
    /// The name of the results folder: `[a-z0-9-]`, 1 to 64 characters.
    pub id: String,
    /// The title for people.
    pub title: String,
    /// The seed of all randomness of the study.
    pub seed: u64,
    /// Authors of the study.
    pub authors: Vec<String>,
    /// License of the data.
    pub license: Option<String>,
    /// Ethics approval: its number or a statement.
    pub ethics: Option<String>,
    /// Whom to contact about the study.
    pub contact: Option<String>,
    /// Who funded the study.
    pub funding: Option<String>,
    /// DOI of the study or its paper.
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
    /// BCP 47 tag of the texts' language.
    pub lang: Option<String>,
    /// The study's own fixed sentences, by the key of a
    /// [`Phrase`](phrases::Phrase); `words` in the file.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub words: BTreeMap<String, String>,
    /// On which side scales begin; by default that of the language.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_direction: Option<ScaleDirection>,
}

words! {
    /// On which side a scale begins.
    ScaleDirection {
        /// Its smallest number is on the left.
        LeftToRight = "ltr",
        /// Its smallest number is on the right.
        RightToLeft = "rtl",
    }
}

impl Text {
    /// The fixed sentences of the study.
    pub fn phrases(&self) -> phrases::Words {
        let words = phrases::Words::new(self.lang.as_deref(), &self.words);
        match self.scale_direction {
            None => words,
            Some(direction) => words.with_scales(direction),
        }
    }
}

/// `[consent]`: the document that the participant agrees to. No name is stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Consent {
    /// Title or file name of the document.
    pub document: String,
    /// Version of the document.
    pub version: String,
    /// The file with its text, relative to the protocol. No fingerprint has the path of a file.
    #[serde(skip)]
    pub file: Option<String>,
    /// The text, once the file was read. Fingerprints have its SHA-256.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "hashed")]
    pub text: Option<String>,
    /// Whether the participant types initials in place of a signature.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub initials: bool,
}

/// `[debriefing]`: what the participant reads at the end of a session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Debriefing {
    /// The file with the text, or with the rest of it, relative to the protocol. No fingerprint has the path of a file.
    #[serde(skip)]
    pub file: Option<String>,
    /// The text: that of the protocol and, once it was read, that of the file below it. Fingerprints have its SHA-256.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "hashed")]
    pub text: Option<String>,
}

impl Debriefing {
    /// Adds the text of the file.
    pub fn add(&mut self, read: &str) {
        self.text = Some(match &self.text {
            Some(text) => format!("{}\n\n{read}", text.trim_end()),
            None => read.to_owned(),
        });
    }
}

fn hashed<S: serde::Serializer>(text: &Option<String>, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&sha256(text.as_deref().unwrap_or_default()))
}

/// `[session]`
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SessionRules {
    /// Who types the answers.
    pub entry: Entry,
    /// Longest interruption, h, after which a session resumes without a question.
    pub resume_within_h: f64,
    /// Longest pause between feeling and answering, or between two intervals, s; after a longer
    /// one the trial is felt again. Absent from the fingerprints of protocols that do not say it.
    #[serde(skip_serializing_if = "is_usual_pause")]
    pub longest_pause_s: f64,
}

/// [`SessionRules::longest_pause_s`] unless the protocol says otherwise.
pub const LONGEST_PAUSE_S: f64 = 60.0;

fn is_usual_pause(seconds: &f64) -> bool {
    *seconds == LONGEST_PAUSE_S
}

words! {
    /// Who types the participant's answers.
    Entry {
        /// The participant, on a screen of their own.
        Participant = "participant",
        /// The experimenter, as the participant says them.
        Experimenter = "experimenter",
    }
}

/// `[device]`: what plays the realizations. Port and baud rate are never here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceRules {
    /// The kind of device.
    pub kind: DeviceKind,
    /// Limits that no playback exceeds.
    pub limits: Limits,
    /// Permission to play tables that fail their passivity certificate.
    pub uncertified: Option<Uncertified>,
    /// Lever arm at which the hand holds a turning handle, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lever_mm: Option<f64>,
    /// When a playback is right. Not part of the stimulus.
    #[serde(skip)]
    pub rendering: RenderingRules,
    /// Hours within which the device must have passed its check. In no fingerprint: it
    /// concerns the laboratory.
    #[serde(skip)]
    pub check_within_h: Option<f64>,
    /// Days within which the device must have been commissioned. In no fingerprint.
    #[serde(skip)]
    pub commissioned_within_days: Option<f64>,
    /// Whether the motor weighs itself before each session. In no fingerprint.
    #[serde(skip)]
    pub self_weigh: bool,
}

/// `[device.rendering]`: when a playback is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RenderingRules {
    /// Least share of the variance of the table's force that the device commands.
    pub min_vaf: f64,
    /// Least and largest slope of the commanded on the table's force, and of the measured
    /// on the commanded force.
    pub gain: [f64; 2],
    /// Largest mean difference of commanded and table's force, N.
    pub max_bias_n: f64,
    /// Largest delay of the commanded force, ms.
    pub max_delay_ms: f64,
    /// Largest difference of commanded and table's force that lasts 20 ms, N.
    pub max_error_n: f64,
    /// Largest rms difference of commanded and table's force over rms force of the table, in
    /// the whole playback, in each direction and in each stretch of 2 s; also of the mean
    /// difference. Fingerprints of studies with the default are those of earlier releases.
    #[serde(skip_serializing_if = "is_default_share")]
    pub max_error_share: f64,
    /// Largest mean size of the difference over 50 ms, of the commanded force from the table's
    /// and of the measured one from the commanded, over the range of the table's forces.
    #[serde(skip_serializing_if = "is_default_range_share")]
    pub max_range_share: f64,
    /// Largest share of the samples that may be lost, else there is no verdict.
    #[serde(skip_serializing_if = "is_default_lost_share")]
    pub max_lost_share: f64,
    /// Least share of the time in which the force must be known, else there is no verdict.
    #[serde(skip_serializing_if = "is_default_judged_share")]
    pub min_judged_share: f64,
    /// Largest mean size of measured minus commanded force, N.
    pub max_measured_error_n: f64,
    /// What a wrong playback is; `None`: a fault if the force passed its limit, was that
    /// of another table or had the wrong sign, else a flag.
    pub on_fault: Option<OnFault>,
}

/// A rule that earlier releases did not have is absent from fingerprints where it has its default.
macro_rules! later_rules {
    ($($default:ident = $value:literal, $is:ident;)+) => {$(
        const $default: f64 = $value;

        #[allow(
            clippy::trivially_copy_pass_by_ref,
            reason = "serde passes a reference"
        )]
        fn $is(value: &f64) -> bool {
            *value == $default
        }
    )+};
}

later_rules! {
    DEFAULT_ERROR_SHARE = 0.075, is_default_share;
    DEFAULT_RANGE_SHARE = 0.1, is_default_range_share;
    DEFAULT_LOST_SHARE = 0.1, is_default_lost_share;
    DEFAULT_JUDGED_SHARE = 0.5, is_default_judged_share;
}

impl Default for RenderingRules {
    fn default() -> Self {
        Self {
            min_vaf: 0.995,
            gain: [0.93, 1.07],
            max_bias_n: 0.2,
            max_delay_ms: 5.0,
            max_error_n: 0.5,
            max_error_share: DEFAULT_ERROR_SHARE,
            max_range_share: DEFAULT_RANGE_SHARE,
            max_lost_share: DEFAULT_LOST_SHARE,
            min_judged_share: DEFAULT_JUDGED_SHARE,
            max_measured_error_n: 0.5,
            on_fault: None,
        }
    }
}

words! {
    /// What a wrong playback is.
    OnFault {
        /// A failed attempt, which comes again.
        Fail = "fail",
        /// A mark in the results.
        Flag = "flag",
    }
}

words! {
    /// The kind of device that plays a realization.
    DeviceKind {
        /// The simulated device of this program.
        Simulated = "simulated",
        /// A device on a serial port.
        Serial = "serial",
        /// A program of the laboratory, started as a child process.
        Process = "process",
        /// A physical sample that the experimenter mounts by hand.
        Manual = "manual",
    }
}

/// Permission to play tables that fail their certificate, at a lower force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Uncertified {
    /// Whether they are played at all.
    pub play: bool,
    /// Largest force for them, N.
    pub force_n: Limit,
    /// Why; recorded in every session.
    pub reason: String,
}

/// `[trial]`
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialRules {
    /// Instruction about the reference, shown before each trial.
    pub reference: Option<String>,
    /// Least time that it is shown, s.
    pub reference_min_s: f64,
    /// Full strokes before the questions open.
    pub minimum_strokes: u32,
    /// How long a realization is felt; of a part that does not say it, too.
    pub exposure: Exposure,
    /// Largest time between the device's confirmed start and the onset of a medium, ms; beyond it the
    /// attempt fails. In the fingerprints of protocols with media only.
    pub media_within_ms: f64,
}

/// One of `[[models]]`: a realization.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelEntry {
    /// Its name in every file.
    pub id: ModelId,
    /// Its model file, relative to the protocol, inside the protocol's folder.
    pub file: Option<String>,
    /// Variance accounted for, (−∞, 1]; `None`: the model file's.
    pub vaf: Option<f64>,
    /// Its role in the study.
    pub role: Role,
    /// The realization of which it is a hidden duplicate.
    pub duplicate_of: Option<ModelId>,
    /// Its own kind of device, such as a sample mounted by hand.
    pub device: Option<DeviceKind>,
    /// Numbers that may explain the ratings; each becomes a column.
    pub covariates: BTreeMap<String, f64>,
    /// Its level in each of `[[factors]]`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub levels: BTreeMap<String, String>,
    /// What the participant's page shows and plays of it.
    #[serde(skip_serializing_if = "Media::is_empty")]
    pub media: Media,
}

words! {
    /// The role of a realization in the study.
    Role {
        /// A realization under study.
        Test = "test",
        /// For practice trials only; never analyzed.
        Practice = "practice",
        /// The reference itself, presented unlabeled among the others.
        HiddenReference = "hidden-reference",
        /// A realization that is known to be bad.
        LowAnchor = "low-anchor",
        /// A realization that is known to be mediocre.
        MidAnchor = "mid-anchor",
        /// A physical sample.
        Physical = "physical",
    }
}

/// The level of significance of a study that states none.
pub const ALPHA: f64 = 0.05;

/// `[analysis]`: decisions that were made before the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnalysisRules {
    /// The question that the analysis is about.
    pub primary: QuestionId,
    /// The recording whose VAF counts, by its name in the model files.
    pub vaf: Option<String>,
    /// The option of a primary question of choice whose share is analyzed. Not part of the
    /// fingerprint if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_of: Option<String>,
    /// Least rating that counts as realistic.
    pub realistic_from: Option<f64>,
    /// Margin of the equivalence test against a hidden reference, in points of the
    /// primary scale, above 0. Not part of the fingerprint if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equivalence_margin: Option<f64>,
    /// Margin of the equivalence test of the correlation with VAF, between 0 and 1. Not
    /// part of the fingerprint if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equivalence_r: Option<f64>,
    /// Whether unfinished sessions are analyzed.
    pub unfinished: Unfinished,
    /// Exclusion rules stated before the data.
    pub exclude: Vec<Exclusion>,
    /// Level of significance of every test, between 0 and 1. Not part of the fingerprint
    /// if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// What the primary question measures, as a noun. Not part of the fingerprint if
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub construct: Option<String>,
    /// Which effects of the factors are tested, as a formula ([`factors::effects`]); `None`: all.
    /// Not part of the fingerprint if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
}

impl AnalysisRules {
    /// The option whose share is analyzed, for the primary question only.
    pub fn share_of(&self, question: &QuestionId) -> Option<&str> {
        self.share_of
            .as_deref()
            .filter(|_| *question == self.primary)
    }

    /// The level of significance.
    pub fn alpha(&self) -> f64 {
        self.alpha.unwrap_or(ALPHA)
    }
}

words! {
    /// Whether unfinished sessions are analyzed.
    Unfinished {
        /// Their ratings count.
        Include = "include",
        /// Their ratings do not count.
        Exclude = "exclude",
    }
}

impl Protocol {
    /// The realization with an id.
    pub fn model(&self, id: &ModelId) -> Option<&ModelEntry> {
        self.models.iter().find(|m| m.id == *id)
    }

    /// The realizations of each repetition: all that are not for practice.
    pub fn scheduled_models(&self) -> impl Iterator<Item = &ModelEntry> {
        self.models.iter().filter(|m| m.role != Role::Practice)
    }

    /// The kind of device that plays a realization: its own or that of the study.
    pub fn device_of(&self, model: &ModelEntry) -> DeviceKind {
        model.device.unwrap_or(self.device.kind)
    }

    /// The question that the analysis is about.
    pub fn primary(&self) -> Option<&Question> {
        self.questions
            .iter()
            .find(|q| q.id == self.analysis.primary)
    }
}
