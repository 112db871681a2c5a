//! The cells of a row, and the header of each table of a study.

use super::rows::{AttemptRow, ParticipantRow, RatingRow};
use super::{Author, Failure, Sample};
use crate::protocol::columns::{
    AttemptColumn, Column, ParticipantColumn, RatingColumn, Repeats, SampleColumn,
};
use crate::protocol::{Answer, Protocol};
use chrono::{DateTime, FixedOffset};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use study_base::text::QuestionId;

/// A cell of a table. Its `Display` is the cell's text in a CSV, not yet quoted.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell<'a> {
    /// Not known or not applicable.
    Empty,
    /// As it was typed; untrusted.
    Text(Cow<'a, str>),
    /// A whole number; only a rating can be negative.
    Whole(i128),
    /// A number.
    Number(f64),
    /// Yes or no.
    Flag(bool),
    /// Date and time.
    Time(DateTime<FixedOffset>),
}

impl fmt::Display for Cell<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => Ok(()),
            Self::Text(text) => f.write_str(text),
            Self::Whole(n) => n.fmt(f),
            Self::Number(x) => x.fmt(f),
            Self::Flag(flag) => flag.fmt(f),
            Self::Time(at) => f.write_str(&at.to_rfc3339()),
        }
    }
}

impl<'a> From<&'a str> for Cell<'a> {
    fn from(text: &'a str) -> Self {
        match text {
            "" => Self::Empty,
            _ => Self::Text(text.into()),
        }
    }
}

impl From<u32> for Cell<'_> {
    fn from(n: u32) -> Self {
        Self::Whole(n.into())
    }
}

impl From<f64> for Cell<'_> {
    fn from(x: f64) -> Self {
        if x.is_finite() {
            Self::Number(x)
        } else {
            Self::Empty
        }
    }
}

impl From<bool> for Cell<'_> {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<DateTime<FixedOffset>> for Cell<'_> {
    fn from(at: DateTime<FixedOffset>) -> Self {
        Self::Time(at)
    }
}

impl<'a> From<&'a Answer> for Cell<'a> {
    fn from(answer: &'a Answer) -> Self {
        match answer {
            Answer::Rating(n) => Self::Whole((*n).into()),
            Answer::Number(x) => Self::Number(*x),
            Answer::Text(text) => text.as_str().into(),
            Answer::Choice(_) => Self::Text(answer.cell().into()),
            Answer::Declined { .. } => Self::Empty,
        }
    }
}

impl<'a, T: Into<Cell<'a>>> From<Option<T>> for Cell<'a> {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

/// A row of a table.
pub trait Row {
    /// The columns of the table.
    type Column: Copy;

    /// The cell in a column; `name` says which one where the column repeats.
    fn cell(&self, column: Self::Column, name: &str) -> Cell<'_>;
}

/// The columns of a table in one study, in the order of the header, each with its
/// name.
pub type Header<C> = Vec<(C, String)>;

/// The header with the repeated columns of these names.
fn header<C: Copy>(all: &[C], declaration: fn(C) -> Column, repeated: &Repeated<'_>) -> Header<C> {
    let names = |column: Column| match column.repeats {
        Repeats::Once => vec![column.name],
        Repeats::Question => repeated.questions.clone(),
        Repeats::Covariate => repeated.covariates.clone(),
    };
    (all.iter())
        .flat_map(|c| {
            names(declaration(*c))
                .into_iter()
                .map(|name| (*c, name.to_owned()))
        })
        .collect()
}

#[derive(Default)]
struct Repeated<'a> {
    questions: Vec<&'a str>,
    covariates: Vec<&'a str>,
}

impl RatingColumn {
    /// The header of `ratings.csv`: questions in the protocol's order, covariates
    /// sorted by name.
    pub fn header(protocol: &Protocol) -> Header<Self> {
        let models = protocol.models.iter();
        let covariates: BTreeSet<&str> = models
            .flat_map(|m| m.covariates.keys().map(String::as_str))
            .collect();
        let repeated = Repeated {
            questions: protocol.questions.iter().map(|q| q.id.as_str()).collect(),
            covariates: covariates.into_iter().collect(),
        };
        header(Self::ALL, Self::column, &repeated)
    }
}

impl AttemptColumn {
    /// The header of `attempts.csv`.
    pub fn header() -> Header<Self> {
        header(Self::ALL, Self::column, &Repeated::default())
    }
}

impl ParticipantColumn {
    /// The header of `participants.csv`: questions of setup, intake and outro.
    pub fn header(protocol: &Protocol) -> Header<Self> {
        let forms = [&protocol.setup, &protocol.intake, &protocol.outro];
        let repeated = Repeated {
            questions: forms.into_iter().flatten().map(|q| q.id.as_str()).collect(),
            covariates: Vec::new(),
        };
        header(Self::ALL, Self::column, &repeated)
    }
}

fn answer<'a>(answers: &'a BTreeMap<QuestionId, Answer>, question: &str) -> Cell<'a> {
    let found = answers.iter().find(|(id, _)| id.as_str() == question);
    found.map(|(_, answer)| answer).into()
}

// In each of these a field without a column is an unused variable.

impl Row for RatingRow {
    type Column = RatingColumn;

    fn cell(&self, column: RatingColumn, name: &str) -> Cell<'_> {
        use RatingColumn as C;
        let Self {
            study,
            participant,
            session,
            row,
            trial,
            block,
            position,
            planned_position,
            model,
            role,
            repetition,
            previous_model,
            practice,
            pilot,
            simulated,
            device_kind,
            device_id,
            operator,
            tool_version,
            protocol_version,
            answers,
            corrected,
            declined,
            remarks,
            reference_s,
            exploration_s,
            response_s,
            strokes,
            least_energy_j,
            switches_per_s,
            clamp_count,
            started_at,
            rated_at,
            attempt,
            status,
            vaf,
            covariates,
        } = self;
        match column {
            C::Study => study.as_str().into(),
            C::Participant => participant.as_str().into(),
            C::Session => (*session).into(),
            C::Row => (*row).into(),
            C::Trial => (*trial).into(),
            C::Block => (*block).into(),
            C::Position => (*position).into(),
            C::PlannedPosition => (*planned_position).into(),
            C::Model => model.as_str().into(),
            C::Role => role.as_str().into(),
            C::Repetition => (*repetition).into(),
            C::PreviousModel => previous_model.as_ref().map(|m| m.as_str()).into(),
            C::Practice => (*practice).into(),
            C::Pilot => (*pilot).into(),
            C::Simulated => (*simulated).into(),
            C::DeviceKind => device_kind.as_str().into(),
            C::DeviceId => device_id.as_str().into(),
            C::Operator => operator.as_str().into(),
            C::ToolVersion => tool_version.as_str().into(),
            C::ProtocolVersion => (*protocol_version).into(),
            C::Questions => answer(answers, name),
            C::Corrected => (*corrected).into(),
            C::Declined => (*declined).into(),
            C::Remarks => remarks.as_str().into(),
            C::ReferenceS => (*reference_s).into(),
            C::ExplorationS => (*exploration_s).into(),
            C::ResponseS => (*response_s).into(),
            C::Strokes => (*strokes).into(),
            C::LeastEnergyJ => (*least_energy_j).into(),
            C::SwitchesPerS => (*switches_per_s).into(),
            C::ClampCount => clamp_count.map_or(Cell::Empty, |n| Cell::Whole(n.into())),
            C::StartedAt => (*started_at).into(),
            C::RatedAt => (*rated_at).into(),
            C::Attempt => (*attempt).into(),
            C::Status => status.as_str().into(),
            C::Vaf => (*vaf).into(),
            C::Covariates => covariates.get(name).copied().into(),
        }
    }
}

impl Row for AttemptRow {
    type Column = AttemptColumn;

    fn cell(&self, column: AttemptColumn, _: &str) -> Cell<'_> {
        use AttemptColumn as C;
        let Self {
            participant,
            session,
            simulated,
            pilot,
            trial,
            attempt,
            model,
            what,
            question,
            from,
            to,
            failure,
            by,
            text,
            at,
        } = self;
        match column {
            C::Participant => participant.as_str().into(),
            C::Session => (*session).into(),
            C::Pilot => (*pilot).into(),
            C::Simulated => (*simulated).into(),
            C::Trial => (*trial).into(),
            C::Attempt => (*attempt).into(),
            C::Model => model.as_ref().map(|m| m.as_str()).into(),
            C::What => (*what).into(),
            C::Question => question.as_ref().map(|q| q.as_str()).into(),
            C::From => from.as_ref().into(),
            C::To => to.as_ref().into(),
            C::Failure => failure.map(failure_level).into(),
            C::By => by.map(author_level).into(),
            C::Text => text.as_str().into(),
            C::At => (*at).into(),
        }
    }
}

fn failure_level(failure: Failure) -> &'static str {
    match failure {
        Failure::DeviceFault => "device-fault",
        Failure::PlaybackLost => "playback-lost",
        Failure::MarkedBad => "marked-bad",
        Failure::Stopped => "stopped",
        Failure::Interrupted => "interrupted",
    }
}

fn author_level(author: Author) -> &'static str {
    match author {
        Author::Participant => "participant",
        Author::Experimenter => "experimenter",
    }
}

impl Row for ParticipantRow {
    type Column = ParticipantColumn;

    fn cell(&self, column: ParticipantColumn, name: &str) -> Cell<'_> {
        use ParticipantColumn as C;
        let Self {
            participant,
            session,
            state,
            reason,
            row,
            pilot,
            simulated,
            erased,
            consent_version,
            protocol_version,
            trials_done,
            trials_planned,
            started_at,
            answers,
        } = self;
        match column {
            C::Participant => participant.as_str().into(),
            C::Session => (*session).into(),
            C::State => state.as_str().into(),
            C::Reason => reason.as_str().into(),
            C::Row => (*row).into(),
            C::Pilot => (*pilot).into(),
            C::Simulated => (*simulated).into(),
            C::Erased => (*erased).into(),
            C::ConsentVersion => consent_version.as_deref().into(),
            C::ProtocolVersion => (*protocol_version).into(),
            C::TrialsDone => (*trials_done).into(),
            C::TrialsPlanned => (*trials_planned).into(),
            C::StartedAt => (*started_at).into(),
            C::Questions => answer(answers, name),
        }
    }
}

impl Row for Sample {
    type Column = SampleColumn;

    fn cell(&self, column: SampleColumn, _: &str) -> Cell<'_> {
        use SampleColumn as C;
        let Self {
            t_s,
            x_mm,
            v_mm_s,
            force_command_n,
            force_measured_n,
        } = self;
        // What a device reports is kept, NaN too.
        match column {
            C::TS => Cell::Number(*t_s),
            C::XMm => Cell::Number(*x_mm),
            C::VMmS => Cell::Number(*v_mm_s),
            C::ForceCommandN => Cell::Number(*force_command_n),
            C::ForceMeasuredN => force_measured_n.map_or(Cell::Empty, Cell::Number),
        }
    }
}
