//! The cells of a row, and the header of each table of a study.

use super::rows::{AttemptEvent, AttemptRow, IntervalRow, ParticipantRow, RatingRow};
use super::{Author, Channel, Failure, Sample, State, Status, Verdict};
use chrono::{DateTime, FixedOffset};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use study_base::text::{ModelId, PartId, ParticipantId, QuestionId};
use study_plan::protocol::columns::{
    AttemptColumn, Column, IntervalColumn, ParticipantColumn, RatingColumn, Repeats, SampleColumn,
};
use study_plan::protocol::{Answer, DeviceKind, Medium, Protocol, Role};

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

impl<'a> Cell<'a> {
    fn text(text: &'a str) -> Self {
        match text {
            "" => Self::Empty,
            _ => Self::Text(text.into()),
        }
    }
}

/// A field of a row.
trait Field {
    /// Its cell; `name` says which one where the column repeats.
    fn cell(&self, name: &str) -> Cell<'_>;
}

impl<T: Field> Field for Option<T> {
    fn cell(&self, name: &str) -> Cell<'_> {
        self.as_ref().map_or(Cell::Empty, |value| value.cell(name))
    }
}

macro_rules! fields {
    ($($field:ty: |$value:ident, $name:pat_param| $cell:expr;)*) => {
        $(impl Field for $field {
            fn cell(&self, $name: &str) -> Cell<'_> {
                let $value = self;
                $cell
            }
        })*
    };
}

fields! {
    u32: |n, _| Cell::Whole((*n).into());
    u64: |n, _| Cell::Whole((*n).into());
    f64: |x, _| if x.is_finite() { Cell::Number(*x) } else { Cell::Empty };
    bool: |flag, _| Cell::Flag(*flag);
    DateTime<FixedOffset>: |at, _| Cell::Time(*at);
    String: |text, _| Cell::text(text);
    AttemptEvent: |what, _| Cell::text(what.as_str());
    ParticipantId: |id, _| Cell::text(id.as_str());
    ModelId: |id, _| Cell::text(id.as_str());
    QuestionId: |id, _| Cell::text(id.as_str());
    PartId: |id, _| Cell::text(id.as_str());
    Role: |role, _| Cell::text(role.as_str());
    DeviceKind: |kind, _| Cell::text(kind.as_str());
    Status: |status, _| Cell::text(status.as_str());
    State: |state, _| Cell::text(state.as_str());
    Failure: |failure, _| Cell::text(failure.as_str());
    Verdict: |verdict, _| Cell::text(verdict.as_str());
    Author: |author, _| Cell::text(author.as_str());
    Channel: |channel, _| Cell::text(channel.as_str());
    Medium: |medium, _| Cell::text(medium.as_str());
    Answer: |answer, _| match answer {
        Answer::Rating(n) => Cell::Whole((*n).into()),
        Answer::Number(x) => Cell::Number(*x),
        Answer::Text(text) => Cell::text(text),
        Answer::Choice(_) => Cell::Text(answer.cell().into()),
        Answer::Declined { .. } => Cell::Empty,
    };
    BTreeMap<QuestionId, Answer>: |answers, name| {
        let mut found = answers.iter().filter(|(id, _)| id.as_str() == name);
        found.next().map_or(Cell::Empty, |(_, answer)| Field::cell(answer, name))
    };
    BTreeMap<String, String>: |texts, name| texts.get(name).map_or(Cell::Empty, |text| Cell::text(text));
    BTreeMap<String, f64>: |numbers, name| numbers.get(name).map_or(Cell::Empty, |x| x.cell(name));
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
        Repeats::Factor => repeated.factors.clone(),
        Repeats::Sent => repeated.sent.clone(),
    };
    (all.iter())
        .filter(|c| declaration(**c).is_in(repeated.has_parts, repeated.has_replays))
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
    factors: Vec<&'a str>,
    /// Outcomes that the device sends.
    sent: Vec<&'a str>,
    /// Whether the study has parts.
    has_parts: bool,
    /// Whether its trials can be felt again.
    has_replays: bool,
}

impl RatingRow {
    /// The header of `ratings.csv`: questions in the protocol's order, those of questionnaires
    /// between the trials last, covariates sorted by name, factors and
    /// numbers of the device in the protocol's order.
    pub fn header(protocol: &Protocol) -> Header<RatingColumn> {
        let models = protocol.models.iter();
        let covariates: BTreeSet<&str> = models
            .flat_map(|m| m.covariates.keys().map(String::as_str))
            .collect();
        let repeated = Repeated {
            questions: (protocol.questions.iter().chain(protocol.between()))
                .map(|q| q.id.as_str())
                .collect(),
            covariates: covariates.into_iter().collect(),
            factors: protocol.factors.iter().map(|f| f.id.as_str()).collect(),
            sent: (protocol.numbers_of_device())
                .map(|(id, _)| id.as_str())
                .collect(),
            has_parts: !protocol.parts.is_empty(),
            has_replays: protocol.trial.exposure.replays > 0,
        };
        header(RatingColumn::ALL, RatingColumn::column, &repeated)
    }

    /// The header of a table of these rows: without optional columns that all leave
    /// empty.
    pub fn header_of(protocol: &Protocol, rows: &[RatingRow]) -> Header<RatingColumn> {
        used(Self::header(protocol), RatingColumn::column, rows)
    }
}

impl AttemptRow {
    /// The header of `attempts.csv`.
    pub fn header() -> Header<AttemptColumn> {
        header(
            AttemptColumn::ALL,
            AttemptColumn::column,
            &Repeated::default(),
        )
    }

    /// That of a table of these rows: without optional columns that all leave empty.
    pub fn header_of(rows: &[AttemptRow]) -> Header<AttemptColumn> {
        used(Self::header(), AttemptColumn::column, rows)
    }
}

/// A header without optional columns that are empty in every row.
fn used<R: Row>(
    mut header: Header<R::Column>,
    declaration: fn(R::Column) -> Column,
    rows: &[R],
) -> Header<R::Column> {
    header.retain(|(column, name)| {
        let used = |row: &R| row.cell(*column, name) != Cell::Empty;
        !declaration(*column).optional || rows.iter().any(used)
    });
    header
}

impl IntervalRow {
    /// The header of `intervals.csv`.
    pub fn header() -> Header<IntervalColumn> {
        header(
            IntervalColumn::ALL,
            IntervalColumn::column,
            &Repeated::default(),
        )
    }
}

impl ParticipantRow {
    /// The header of `participants.csv`: questions of setup, intake and outro.
    pub fn header(protocol: &Protocol) -> Header<ParticipantColumn> {
        let forms = [&protocol.setup, &protocol.intake, &protocol.outro];
        let repeated = Repeated {
            questions: forms.into_iter().flatten().map(|q| q.id.as_str()).collect(),
            has_parts: !protocol.parts.is_empty(),
            ..Repeated::default()
        };
        header(ParticipantColumn::ALL, ParticipantColumn::column, &repeated)
    }

    /// That of a table of these rows: without optional columns that all leave empty.
    pub fn header_of(protocol: &Protocol, rows: &[ParticipantRow]) -> Header<ParticipantColumn> {
        used(Self::header(protocol), ParticipantColumn::column, rows)
    }
}

/// Which field of a row is in which column, and which part of an optional field. A column
/// without a field does not compile, and a field without a column is an unused variable.
macro_rules! row {
    ($row:ident: $columns:ident {
        $($column:ident: $field:ident,)*
        $(..$whole:ident { $($part_column:ident: $part:ident,)* })?
    }) => {
        impl Row for $row {
            type Column = $columns;

            fn cell(&self, column: $columns, name: &str) -> Cell<'_> {
                let Self { $($field,)* $($whole)? } = self;
                match column {
                    $($columns::$column => Field::cell($field, name),)*
                    $($($columns::$part_column => {
                        $whole.as_ref().map_or(Cell::Empty, |all| Field::cell(&all.$part, name))
                    })*)?
                }
            }
        }
    };
}

row! {
    RatingRow: RatingColumn {
        Study: study,
        Participant: participant,
        Session: session,
        Row: row,
        Trial: trial,
        Block: block,
        Position: position,
        PlannedPosition: planned_position,
        Model: model,
        Role: role,
        Repetition: repetition,
        PreviousModel: previous_model,
        Practice: practice,
        Pilot: pilot,
        Simulated: simulated,
        DeviceKind: device_kind,
        DeviceId: device_id,
        Operator: operator,
        ToolVersion: tool_version,
        ProtocolVersion: protocol_version,
        Questions: answers,
        Corrected: corrected,
        Declined: declined,
        Remarks: remarks,
        ReferenceS: reference_s,
        ExplorationS: exploration_s,
        ResponseS: response_s,
        Strokes: strokes,
        LeastEnergyJ: least_energy_j,
        SwitchesPerS: switches_per_s,
        ClampCount: clamp_count,
        StartedAt: started_at,
        RatedAt: rated_at,
        Attempt: attempt,
        Status: status,
        Sent: sent,
        Vaf: vaf,
        Covariates: covariates,
        Levels: levels,
        Part: part,
        Track: track,
        Level: level,
        Correct: correct,
        Replays: replays,
        HostLateMs: host_late_ms,
        InputChannel: input_channel,
        FrontName: front_name,
        Group: group,
        SessionId: session_id,
        PausedS: paused_s,
        FeltAgainAfterS: felt_again_after_s,
        AnswerBeforeFeedback: answer_before_feedback,
        QuestionnairePausedS: questionnaire_paused_s,
        QuestionnaireLate: questionnaire_late,
        MediaOffsetMs: media_offset_ms,
        MediaUncertaintyMs: media_uncertainty_ms,
        MediaJitterMs: media_jitter_ms,
        ..fidelity {
            Rendering: verdict,
            RenderedVaf: rendered_vaf,
            DeliveredVaf: delivered_vaf,
            RenderedGain: rendered_gain,
            RenderedBiasN: rendered_bias_n,
            RenderedDelayMs: rendered_delay_ms,
            RenderedErrorN: rendered_error_n,
            JudgedShare: judged_share,
            ErrorJnd: error_jnd,
        }
    }
}

row! {
    IntervalRow: IntervalColumn {
        Study: study,
        Participant: participant,
        Session: session,
        Part: part,
        Trial: trial,
        Attempt: attempt,
        Interval: interval,
        Model: model,
        Level: level,
        LevelProposed: level_proposed,
        Track: track,
        TrackTrial: track_trial,
        Target: target,
        Catch: catch,
        GapS: gap_s,
        Replays: replays,
        ExplorationS: exploration_s,
        Strokes: strokes,
        HostLateMs: host_late_ms,
        ..fidelity {
            Rendering: verdict,
            RenderedVaf: rendered_vaf,
            DeliveredVaf: delivered_vaf,
            RenderedGain: rendered_gain,
            RenderedBiasN: rendered_bias_n,
            RenderedDelayMs: rendered_delay_ms,
            RenderedErrorN: rendered_error_n,
            MaxForceN: max_force_n,
            OverLimitN: over_limit_n,
            MeasuredVaf: measured_vaf,
            MeasuredGain: measured_gain,
            MeasuredBiasN: measured_bias_n,
            MeasuredErrorN: measured_error_n,
            NearestModel: nearest_model,
            LostShare: lost_share,
            TimeRatio: time_ratio,
            SpeedGain: speed_gain,
            TravelMm: travel_mm,
            RangeShare: range_share,
            TopSpeedMmS: top_speed_mm_s,
            MotionShare: motion_share,
            SpeedFactor: speed_factor,
            BeyondShare: beyond_share,
            JudgedShare: judged_share,
            ErrorJnd: error_jnd,
        }
    }
}

row! {
    AttemptRow: AttemptColumn {
        Participant: participant,
        Session: session,
        Pilot: pilot,
        Simulated: simulated,
        Trial: trial,
        Attempt: attempt,
        Model: model,
        What: what,
        Question: question,
        From: from,
        To: to,
        Failure: failure,
        By: by,
        Text: text,
        At: at,
        InputChannel: input_channel,
        Medium: medium,
        MediaOffsetMs: media_offset_ms,
        MediaUncertaintyMs: media_uncertainty_ms,
    }
}

row! {
    ParticipantRow: ParticipantColumn {
        Participant: participant,
        Session: session,
        State: state,
        Reason: reason,
        Row: row,
        Pilot: pilot,
        Simulated: simulated,
        Erased: erased,
        ConsentVersion: consent_version,
        ProtocolVersion: protocol_version,
        TrialsDone: trials_done,
        TrialsPlanned: trials_planned,
        StartedAt: started_at,
        Questions: answers,
        Group: group,
        SessionId: session_id,
        GapH: gap_h,
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
