//! The columns of the tables in a results folder, each declared once.
//!
//! The writers, the readers, the list of reserved names and the data dictionary in
//! docs/results.md use these declarations. `outcome::cell` gives the cell of a row in
//! each column; a column without a cell does not compile, and a field of a row without
//! a column is an unused variable.

mod reserved;

pub use reserved::{
    are_of_parts, is_participants_column, is_participants_column_of_parts, is_parts_column,
    is_ratings_column,
};

/// What the cells of a column hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Text, as it was typed.
    Text,
    /// A whole number, not negative.
    Whole,
    /// A number.
    Number,
    /// `true` or `false`.
    Flag,
    /// Date and time with the offset from UTC, RFC 3339.
    Time,
    /// One of these words; each with its meaning.
    Level(&'static [(&'static str, &'static str)]),
    /// An answer: a number for a rating, slider or number, else text.
    Answer,
}

/// Whether a declaration stands for one column or several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeats {
    /// One column of this name.
    Once,
    /// One for each question, named by its id.
    Question,
    /// One for each covariate of the realizations, by name.
    Covariate,
    /// One for each factor, named by its id.
    Factor,
    /// One for each outcome that the device sends, named by its id.
    Sent,
}

/// The declaration of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// As in the header; a description if the column repeats.
    pub name: &'static str,
    /// What its cells hold.
    pub kind: Kind,
    /// Unit of its numbers; `None` if they have none.
    pub unit: Option<&'static str>,
    /// What a cell means.
    pub meaning: &'static str,
    /// When a cell is empty; `None`: never.
    pub empty: Option<&'static str>,
    /// Whether there are several.
    pub repeats: Repeats,
    /// Whether a table in which all its cells are empty does not have it.
    pub optional: bool,
    /// Which studies have it.
    pub study: Studies,
    /// Whether somebody typed its cells, so that they may tell who it was.
    pub typed: Typed,
    /// Whether its cells tell when a session took place: `--redact times` leaves it out.
    pub tells_when: bool,
}

/// Whether somebody typed the cells of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Typed {
    /// Nobody.
    No,
    /// Once for a session; it stands in every row.
    Once,
    /// For each row.
    EachRow,
}

/// Which studies have a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Studies {
    /// All.
    All,
    /// Those with parts.
    WithParts,
    /// Those with parts, or whose trials can be felt again.
    WithReplays,
}

impl Column {
    const fn new(kind: Kind, name: &'static str, meaning: &'static str) -> Self {
        Self {
            name,
            kind,
            unit: None,
            meaning,
            empty: None,
            repeats: Repeats::Once,
            optional: false,
            study: Studies::All,
            typed: Typed::No,
            tells_when: matches!(kind, Kind::Time),
        }
    }

    const fn typed(mut self, typed: Typed) -> Self {
        self.typed = typed;
        self
    }

    /// Tells when a session took place, though its cells are no times.
    const fn tells_when(mut self) -> Self {
        self.tells_when = true;
        self
    }

    const fn optional(mut self) -> Self {
        self.optional = true;
        self
    }

    const fn unit(mut self, unit: &'static str) -> Self {
        self.unit = Some(unit);
        self
    }

    const fn empty(mut self, when: &'static str) -> Self {
        self.empty = Some(when);
        self
    }

    const fn repeats(mut self, repeats: Repeats) -> Self {
        self.repeats = repeats;
        self
    }

    const fn with_parts(mut self) -> Self {
        self.study = Studies::WithParts;
        self
    }

    const fn with_replays(mut self) -> Self {
        self.study = Studies::WithReplays;
        self
    }

    /// Whether a study has it: one with parts, or one whose trials can be felt again.
    pub fn is_in(&self, has_parts: bool, has_replays: bool) -> bool {
        match self.study {
            Studies::All => true,
            Studies::WithParts => has_parts,
            Studies::WithReplays => has_parts || has_replays,
        }
    }

    /// Whether another column of its table may not have this name, in any case.
    fn reserves(&self, name: &str) -> bool {
        self.repeats == Repeats::Once && self.name.eq_ignore_ascii_case(name)
    }
}

const fn text(name: &'static str, meaning: &'static str) -> Column {
    Column::new(Kind::Text, name, meaning)
}

const fn whole(name: &'static str, meaning: &'static str) -> Column {
    Column::new(Kind::Whole, name, meaning)
}

const fn number(name: &'static str, meaning: &'static str) -> Column {
    Column::new(Kind::Number, name, meaning)
}

const fn flag(name: &'static str, meaning: &'static str) -> Column {
    Column::new(Kind::Flag, name, meaning)
}

const fn time(name: &'static str, meaning: &'static str) -> Column {
    Column::new(Kind::Time, name, meaning)
}

const fn level(
    name: &'static str,
    levels: &'static [(&'static str, &'static str)],
    meaning: &'static str,
) -> Column {
    Column::new(Kind::Level(levels), name, meaning)
}

const PARTICIPANT: Column = text("participant", "pseudonym");
const PILOT: Column = flag("pilot", "whether the participant was a pilot");
const SIMULATED: Column = flag("simulated", "whether the participant was simulated");
const PROTOCOL_VERSION: Column = whole(
    "protocol_version",
    "version of the protocol that the session started with",
);
const INPUT_CHANNEL: Column = level(
    "input_channel",
    &[
        ("terminal", "the keys of the terminal"),
        ("plain", "typed lines"),
        ("page", "the participant's page"),
    ],
    "how the answer was entered",
)
.optional();
const NEVER_PRESENTED: &str = "the trial was never presented";
const NO_TELEMETRY: &str = "no playback ended, or the device sent no telemetry";
const NO_MEDIA: &str = "the page showed and played nothing, or did not confirm it";

/// Declares the columns of a table, in the order of its header.
macro_rules! table {
    ($(#[$doc:meta])* $table:ident { $($column:ident: $declaration:expr,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the declaration has the meaning")]
        pub enum $table { $($column),* }

        impl $table {
            /// All columns, in the order of the header.
            pub const ALL: &[Self] = &[$(Self::$column),*];

            /// The declaration of this column.
            pub const fn column(self) -> Column {
                match self { $(Self::$column => $declaration),* }
            }

            /// Its name in the header.
            pub const fn name(self) -> &'static str {
                self.column().name
            }
        }
    };
}

table! {
    /// The columns of `ratings.csv`: one row for each planned trial.
    RatingColumn {
        Study: text("study", "study id"),
        Participant: PARTICIPANT,
        Session: whole("session", "session of the participant, from 1"),
        Row: whole("row", "row of the schedule")
            .empty("the participant is a pilot or simulated"),
        Trial: whole("trial", "trial of the session, from 1, practice included"),
        Block: whole("block", "block, from 1; 0 for practice"),
        Position: whole("position", "position among the trials that count, in the order of presentation")
            .empty(NEVER_PRESENTED),
        PlannedPosition: whole("planned_position", "position in the planned order"),
        Model: text("model", "realization").empty("the trial has several intervals"),
        Role: level("role", &[
            ("test", "what the study asks about"),
            ("practice", "for practice trials only"),
            ("hidden-reference", "the target itself, unannounced among the others"),
            ("mid-anchor", "a realization that is known to be mediocre"),
            ("low-anchor", "known to be poor"),
            ("physical", "a physical sample"),
        ], "role of the realization; `test` for a level and where there are several"),
        Repetition: whole("repetition", "repetition of the realization, from 1; 0 for practice"),
        PreviousModel: text("previous_model", "realization presented just before this attempt, failed attempts and practice included")
            .empty("nothing was presented before, or the trial was never presented"),
        Practice: flag("practice", "whether the trial is practice, which is not analyzed"),
        Pilot: PILOT,
        Simulated: SIMULATED,
        DeviceKind: level("device_kind", &[
            ("simulated", "the virtual device of this program"),
            ("serial", "a device on a serial port"),
            ("process", "a program of the laboratory"),
            ("manual", "a sample mounted by hand"),
        ], "kind of the device"),
        DeviceId: text("device_id", "device that presented the attempt").typed(Typed::Once),
        Operator: text("operator", "who ran the session").typed(Typed::Once).tells_when(),
        ToolVersion: text("tool_version", "version of this program"),
        ProtocolVersion: PROTOCOL_VERSION,
        Questions: Column::new(
            Kind::Answer,
            "one for each question",
            "last answer of the attempt that counts; several choices are joined by `; `",
        ).empty("declined or not answered").repeats(Repeats::Question),
        Corrected: flag("corrected", "whether an answer was corrected"),
        Declined: flag("declined", "whether an answer was declined; attempts.csv has the reason"),
        Remarks: text("remarks", "remarks made during the trial, in all attempts, joined by ` | `")
            .empty("no remarks").typed(Typed::EachRow),
        ReferenceS: number("reference_s", "duration of the reference prompt").unit("s")
            .empty(NEVER_PRESENTED),
        ExplorationS: number(
            "exploration_s",
            "duration of the playback, from its confirmed start to its confirmed stop",
        ).unit("s").empty("no playback ended, or the device reported no duration"),
        ResponseS: number("response_s", "time from the opening of the rating to its confirmation, also while the program was left, but not while it was paused")
            .unit("s").empty("the rating was not confirmed"),
        Strokes: whole("strokes", "full strokes").empty(NO_TELEMETRY),
        LeastEnergyJ: number(
            "least_energy_j",
            "smallest value of the energy put in by the hand since the start of the playback; \
             negative: the device was active",
        ).unit("J").empty(NO_TELEMETRY),
        SwitchesPerS: number("switches_per_s", "changes of the direction state per second")
            .unit("1/s").empty(NO_TELEMETRY),
        ClampCount: whole("clamp_count", "how often the force was clamped to its limit")
            .empty(NO_TELEMETRY),
        StartedAt: time("started_at", "when the playback was requested").empty(NEVER_PRESENTED),
        RatedAt: time(
            "rated_at",
            "when the primary question was first answered or declined; if it was not, when the trial ended",
        ).empty("the trial has not ended, or failed"),
        Attempt: whole("attempt", "attempt that counts, from 1; of a failed trial the last")
            .empty(NEVER_PRESENTED),
        Status: level("status", &[
            ("ok", "the primary question is answered"),
            ("declined", "the primary question was declined"),
            ("failed", "abandoned after the last permitted attempt"),
            ("missing", "not reached, or the primary question was left empty"),
        ], "outcome of the trial"),
        Sent: number("one for each outcome from the device", "number that the controller program sent; outcomes in the order of the protocol").empty("none that counts").repeats(Repeats::Sent),
        Vaf: number(
            "vaf",
            "variance accounted for (VAF) of the realization, from the protocol or its model file",
        ).empty("neither states it"),
        Covariates: number("one for each covariate", "covariate of the realization, sorted by name")
            .empty("the realization does not have it").repeats(Repeats::Covariate),
        Part: text("part", "part of the session").with_parts(),
        Track: text("track", "track").empty("the trial belongs to none").with_parts(),
        Level: number("level", "level of the comparison, in units of its family; of a track with `relative`, its distance from the standard as the track counts it")
            .empty("the trial has no family, or was never presented").with_parts(),
        Correct: flag("correct", "whether the answer is correct, after corrections; of `answer_before_feedback`, if there is one")
            .empty("no answer is correct or wrong, or it was not answered").with_parts(),
        Replays: whole("replays", "how often the trial was felt again before the answer")
            .empty(NEVER_PRESENTED).with_replays(),
        Rendering: level("rendering", &[
            ("ok", "the force was that of the table"),
            ("unverified", "the device reports no samples or plays no table, or does not tell the constants that its force depends on"),
            ("too-little", "too little was felt or reported to judge it"),
            ("flag", "the force was not that of the table, and the protocol marks it"),
            ("fault", "the force was not that of the table, and the attempt failed, or in an adjustment the step"),
        ], "whether the force was that of the table; of several playbacks the worst")
            .empty("no playback ended, or it was not judged").optional(),
        RenderedVaf: number("rendered_vaf", "share of the variance of the table's force for the reported motion that the device commanded")
            .empty("not known, or the force did not vary").optional(),
        DeliveredVaf: number("delivered_vaf", "VAF of what was delivered: of the table's force on the validation recording, with the gain and the delay of the playback")
            .empty("not judged, or there is no validation recording with the protocol").optional(),
        RenderedGain: number("rendered_gain", "slope of the commanded on the table's force")
            .empty("not known, or the force did not vary").optional(),
        RenderedBiasN: number("rendered_bias_n", "mean of the commanded minus the table's force")
            .unit("N").empty("not known").optional(),
        RenderedDelayMs: number("rendered_delay_ms", "how much later than the table's force the commanded force was")
            .unit("ms").empty("not known, or the two hardly correlate").optional(),
        RenderedErrorN: number("rendered_error_n", "largest difference of commanded and table's force that lasted 20 ms")
            .unit("N").empty("not known").optional(),
        HostLateMs: number("host_late_ms", "how late this computer's thread for the device was at most during the playback")
            .unit("ms").empty("not measured").optional(),
        InputChannel: INPUT_CHANNEL.empty("not answered, or not by a person"),
        FrontName: text("front_name", "program of `--front` that asked the participant, as it says")
            .empty("none: the program's own screen").optional().typed(Typed::Once),
        Group: text("group", "group of the participant").empty("the study has no groups").optional().with_parts(),
        SessionId: text("session_id", "planned session, of `[[sessions]]`").empty("a participant comes once").optional().with_parts(),
        JudgedShare: number("judged_share", "share of the time in which the force was judged").empty("not judged").optional(),
        ErrorJnd: number("error_jnd", "largest difference from the right force that lasted 20 ms, in just noticeable differences")
            .empty("not known").optional(),
        Levels: text("one for each factor", "level of the realization in the factor; factors in the order of the protocol")
            .empty("the realization is not part of the factorial design").repeats(Repeats::Factor),
        PausedS: number("paused_s", "pauses between the end of the playback and the answer").unit("s").empty("less than 1 s, or not answered").optional(),
        FeltAgainAfterS: number("felt_again_after_s", "pause after which an earlier attempt was felt again instead of answered, as it was longer than the protocol allows")
            .unit("s").empty("there was none, or its length is not known").optional(),
        AnswerBeforeFeedback: text("answer_before_feedback", "answer of an identification before the right label was told, which is the one that is analyzed")
            .empty("the answer was not corrected after that").optional().with_parts(),
        QuestionnairePausedS: number("questionnaire_paused_s", "pauses between the answer to the trial and those to the questionnaires after it")
            .unit("s").empty("less than 1 s, of unknown length, or none was asked").optional(),
        QuestionnaireLate: flag("questionnaire_late", "whether these pauses were longer than the protocol allows between feeling and answering (`longest_pause_s`): the questionnaires were answered from memory")
            .empty("they were not, or none was asked").optional(),
        MediaOffsetMs: number("media_offset_ms", "onset of a picture, video or sound on the participant's page after the confirmed start; of several the one that is farthest from it")
            .unit("ms").empty(NO_MEDIA).optional(),
        MediaUncertaintyMs: number("media_uncertainty_ms", "by how much the clocks of page and program may make that offset wrong: half a round trip between them")
            .unit("ms").empty(NO_MEDIA).optional(),
        MediaJitterMs: number("media_jitter_ms", "standard deviation of the offsets of the session up to this attempt, pooled within pictures, videos and sounds")
            .unit("ms").empty("fewer than two media of a kind were presented by then").optional(),
    }
}

table! {
    /// The columns of `intervals.csv`: one row for each presentation, of failed attempts,
    /// too. Only studies with parts have it.
    IntervalColumn {
        Study: RatingColumn::Study.column(),
        Participant: PARTICIPANT,
        Session: RatingColumn::Session.column(),
        Part: text("part", "part of the session"),
        Trial: RatingColumn::Trial.column(),
        Attempt: whole("attempt", "attempt at the trial, from 1"),
        Interval: whole("interval", "interval of the trial, from 1"),
        Model: text("model", "realization; a level is named after its family and its place on the ladder")
            .empty("the record of the attempt's start is damaged"),
        Level: number("level", "level that was presented, in units of its family")
            .empty("the realization is no level of a family"),
        LevelProposed: number("level_proposed", "level that the rule proposed for the trial, before it was rounded to the ladder; as the track counts levels")
            .empty("the trial belongs to no track, or is an easy or catch trial"),
        Track: text("track", "track").empty("the trial belongs to none"),
        TrackTrial: whole("track_trial", "trial of the track, from 1, in the planned order")
            .empty("the trial belongs to no track"),
        Target: flag("target", "whether the interval has the comparison; of an adjustment, whether it has the level that is set")
            .empty("the trial belongs to no track and sets no level"),
        Catch: flag("catch", "whether the trial has no signal").empty("the trial belongs to no track"),
        GapS: number("gap_s", "from the confirmed end of the interval before to the confirmed start of this one")
            .unit("s").empty("it is the first interval"),
        Replays: whole("replays", "how often the intervals had been felt before in this attempt"),
        ExplorationS: RatingColumn::ExplorationS.column(),
        Strokes: RatingColumn::Strokes.column(),
        Rendering: RatingColumn::Rendering.column(),
        RenderedVaf: RatingColumn::RenderedVaf.column(),
        DeliveredVaf: RatingColumn::DeliveredVaf.column(),
        RenderedGain: RatingColumn::RenderedGain.column(),
        RenderedBiasN: RatingColumn::RenderedBiasN.column(),
        RenderedDelayMs: RatingColumn::RenderedDelayMs.column(),
        RenderedErrorN: RatingColumn::RenderedErrorN.column(),
        MaxForceN: number("max_force_n", "largest commanded or measured force").unit("N")
            .empty("no samples"),
        OverLimitN: number("over_limit_n", "by how much the force passed its limit").unit("N")
            .empty("it did not"),
        MeasuredVaf: number("measured_vaf", "share of the variance of the commanded force that was measured")
            .empty(NO_SENSOR),
        MeasuredGain: number("measured_gain", "slope of the measured on the commanded force")
            .empty(NO_SENSOR),
        MeasuredBiasN: number("measured_bias_n", "mean of the measured minus the commanded force")
            .unit("N").empty(NO_SENSOR),
        MeasuredErrorN: number("measured_error_n", "mean size of the measured minus the commanded force")
            .unit("N").empty(NO_SENSOR),
        NearestModel: text("nearest_model", "realization that explains the commanded force best")
            .empty("not judged"),
        LostShare: number("lost_share", "share of the samples that was lost").empty("no samples"),
        TimeRatio: number("time_ratio", "time of the samples over time of this computer")
            .empty("not known"),
        SpeedGain: number("speed_gain", "slope of the reported speed on the change of the reported position")
            .empty("the handle hardly moved"),
        TravelMm: number("travel_mm", "distance over which the handle was moved").unit("mm")
            .empty("no samples"),
        RangeShare: number("range_share", "share of the identified range that was visited")
            .empty("no samples"),
        TopSpeedMmS: number("top_speed_mm_s", "largest speed").unit("mm/s").empty("no samples"),
        MotionShare: number("motion_share", "share of the time in which the handle moved")
            .empty("no samples"),
        HostLateMs: RatingColumn::HostLateMs.column(),
        SpeedFactor: number("speed_factor", "largest speed over the largest one of the recordings that the realization was identified from")
            .empty("no samples"),
        BeyondShare: number("beyond_share", "share of the time in motion that was faster or further than these recordings")
            .empty("the handle did not move"),
        JudgedShare: RatingColumn::JudgedShare.column(),
        ErrorJnd: RatingColumn::ErrorJnd.column(),
    }
}

const NO_SENSOR: &str = "the device has no force sensor, or the force did not vary";

const OTHER_EVENT: &str = "the event is no onset of a medium";
const OUTSIDE_TRIALS: &str = "the event belongs to no trial";

table! {
    /// The columns of `attempts.csv`: one row for each event that concerns an attempt,
    /// an answer or the participant's state, in the order in which they happened.
    AttemptColumn {
        Participant: PARTICIPANT,
        Session: RatingColumn::Session.column(),
        Pilot: PILOT,
        Simulated: SIMULATED,
        Trial: RatingColumn::Trial.column().empty(OUTSIDE_TRIALS),
        Attempt: whole("attempt", "attempt at the trial, from 1")
            .empty("the event belongs to no attempt"),
        Model: RatingColumn::Model.column().empty(OUTSIDE_TRIALS),
        What: level("what", &[
            ("attempt", "an attempt started"),
            ("answer", "a question was answered"),
            ("correction", "an answer was corrected, or, without a question, the id"),
            ("failure", "an attempt failed"),
            ("closed", "the trial was abandoned"),
            ("remark", "a remark was made"),
            ("resume", "an interrupted session was resumed"),
            ("state", "the participant's state was set"),
            ("reveal", "the order was revealed"),
            ("self-weighed", "the motor weighed itself before the session"),
            ("media", "a picture, video or sound came on the participant's page"),
            ("number-sent", "a number that the controller program sent does not count"),
        ], "what happened"),
        Question: text("question", "question that was answered or corrected")
            .empty("the event is neither an answer nor a correction"),
        From: Column::new(Kind::Answer, "from", "answer before the correction")
            .empty("the event is no correction, or the question was declined"),
        To: Column::new(Kind::Answer, "to", "answer that was given")
            .empty("the event is neither an answer nor a correction, or the question was declined"),
        Failure: level("failure", &[
            ("device-fault", "the device reported a fault or refused"),
            ("playback-lost", "the start or end of the playback was not confirmed"),
            ("marked-bad", "marked as bad by a person"),
            ("stopped", "stopped, and played again instead of rated"),
            ("interrupted", "the program ended or stood still during the attempt, or paused too long before its answer or its next interval"),
            ("rendering", "the force was not that of the table"),
            ("media", "a picture, video or sound was not shown or played in step"),
        ], "why the attempt failed").empty("the event is no failure"),
        By: level("by", &[
            ("participant", "the participant"),
            ("experimenter", "the experimenter"),
        ], "who corrected or remarked").empty("the event is neither a correction nor a remark"),
        Text: text("text", "reason, remark or detail").empty("none was given"),
        At: time("at", "when it happened"),
        InputChannel: INPUT_CHANNEL.empty("no person answered or corrected anything"),
        Medium: level("medium", &[
            ("picture", "a picture"),
            ("video", "a video"),
            ("sound", "a sound"),
        ], "what came on the participant's page").empty(OTHER_EVENT).optional(),
        MediaOffsetMs: number("media_offset_ms", "its onset after the confirmed start").unit("ms")
            .empty(OTHER_EVENT).optional(),
        MediaUncertaintyMs: RatingColumn::MediaUncertaintyMs.column().empty(OTHER_EVENT),
    }
}

table! {
    /// The columns of `participants.csv`: one row for each participant, by the last
    /// session.
    ParticipantColumn {
        Participant: PARTICIPANT,
        Session: whole("session", "last session, from 1"),
        State: level("state", &[
            ("unfinished", "started and not finished"),
            ("done", "all trials are done"),
            ("void", "started by mistake; only before the first rating"),
            ("no-show", "did not come"),
            ("dropped-out", "ended the session early"),
            ("excluded", "not analyzed"),
            ("withdrawn", "withdrew consent"),
        ], "state"),
        Reason: text("reason", "why the state was set").empty("no reason was given")
            .typed(Typed::EachRow),
        Row: whole("row", "row of the schedule")
            .empty("the participant is a pilot, simulated or a no-show"),
        Pilot: PILOT,
        Simulated: SIMULATED,
        Erased: flag("erased", "whether the participant's data were erased"),
        ConsentVersion: text("consent_version", "version of the consent document that was accepted")
            .empty("none was accepted, or the data were erased"),
        ProtocolVersion: PROTOCOL_VERSION.empty("no session was started, or the data were erased"),
        TrialsDone: whole("trials_done", "trials that count and have ended"),
        TrialsPlanned: whole("trials_planned", "trials that count"),
        StartedAt: time("started_at", "when the session was started")
            .empty("no session was started, or the data were erased"),
        Questions: Column::new(
            Kind::Answer,
            "one for each question",
            "last answer to a question of setup, intake or outro",
        ).empty("declined, not answered, withdrawn or erased").repeats(Repeats::Question),
        Group: RatingColumn::Group.column(),
        SessionId: RatingColumn::SessionId.column(),
        GapH: number("gap_h", "time since the session before the last one").unit("h")
            .empty("there is none before it").optional().with_parts(),
    }
}

table! {
    /// The columns of a telemetry file: one row for each sample of an attempt.
    SampleColumn {
        TS: number("t_s", "time since the confirmed start, by the device's clock").unit("s"),
        XMm: number("x_mm", "position").unit("mm"),
        VMmS: number("v_mm_s", "velocity").unit("mm/s"),
        ForceCommandN: number("force_command_n", "commanded force, after every limit").unit("N"),
        ForceMeasuredN: number("force_measured_n", "measured force").unit("N")
            .empty("the device has no force sensor"),
    }
}

table! {
    /// The columns of `analysis/ratings_used.csv`: one row for each rating, whether it was
    /// used or not. A foreign table of ratings has the first six, some of them optional.
    UsedColumn {
        Subject: text("subject", "participant"),
        Model: text("model", "realization").empty("the table that was analyzed names none"),
        Repetition: whole("repetition", "repetition of the realization, from 1; 0 for practice"),
        TrialIndex: whole("trial_index", "position in the order of presentation, from 1")
            .empty("not known"),
        Rating: number("rating", "answer to the question that was analyzed").empty("no rating"),
        Vaf: number("vaf", "VAF of the realization").empty("not known"),
        Included: flag("included", "whether the analysis used the rating"),
        Reason: text("reason", "why the rating was not used").empty("it was used"),
    }
}

#[cfg(test)]
mod tests;
