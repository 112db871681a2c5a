//! Objects of a JSON document, declared once: what is written is also described.

use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;

/// A value in a document.
pub(super) trait Member {
    /// Whether every document has its key.
    const REQUIRED: bool = true;

    /// The value; `None` leaves its key out.
    fn json(self) -> Option<Json>;

    /// Its JSON Schema.
    fn schema() -> Json;
}

macro_rules! members {
    ($($type:ty: $schema:tt,)*) => {$(
        impl Member for $type {
            fn json(self) -> Option<Json> {
                Some(json!(self))
            }

            fn schema() -> Json {
                json!($schema)
            }
        }
    )*};
}

members! {
    bool: { "type": "boolean" },
    f64: { "type": "number" },
    i64: { "type": "integer" },
    u32: { "type": "integer", "minimum": 0 },
    usize: { "type": "integer", "minimum": 0 },
    String: { "type": "string" },
    BTreeMap<String, usize>: {
        "type": "object",
        "additionalProperties": { "type": "integer", "minimum": 0 },
    },
    Map<String, Json>: { "type": "object", "additionalProperties": { "type": "string" } },
}

impl<T: Member> Member for Option<T> {
    fn json(self) -> Option<Json> {
        Some(self.and_then(T::json).unwrap_or(Json::Null))
    }

    fn schema() -> Json {
        let mut schema = T::schema();
        if let Some(words) = schema.get_mut("enum").and_then(Json::as_array_mut) {
            words.push(Json::Null);
        } else if schema.get("properties").is_some() {
            return json!({ "anyOf": [{ "type": "null" }, schema] });
        } else {
            schema["type"] = json!([schema["type"], "null"]);
        }
        schema
    }
}

impl<T: Member> Member for Vec<T> {
    fn json(self) -> Option<Json> {
        Some(self.into_iter().filter_map(T::json).collect())
    }

    fn schema() -> Json {
        json!({ "type": "array", "items": T::schema() })
    }
}

/// A value that a document may not have.
pub(super) struct IfAny<T>(pub(super) Option<T>);

impl<T: Member> Member for IfAny<T> {
    const REQUIRED: bool = false;

    fn json(self) -> Option<Json> {
        self.0?.json()
    }

    fn schema() -> Json {
        T::schema()
    }
}

/// Words, one of which is a value.
macro_rules! words {
    ($($(#[doc = $about:literal])* $name:ident = [$($word:literal),*],)*) => {$(
        $(#[doc = $about])*
        pub(super) struct $name(pub(super) &'static str);

        impl Member for $name {
            fn json(self) -> Option<Json> {
                Some(json!(self.0))
            }

            fn schema() -> Json {
                json!({ "enum": [$($word),*] })
            }
        }
    )*};
}

/// Objects with their keys, which have all their documents unless they are [`IfAny`].
macro_rules! objects {
    ($(
        $(#[doc = $about:literal])*
        $name:ident { $($(#[doc = $doc:literal])* $key:ident: $type:ty,)* }
    )*) => {$(
        $(#[doc = $about])*
        pub(super) struct $name {
            $($(#[doc = $doc])* pub(super) $key: $type,)*
        }

        impl Member for $name {
            fn json(self) -> Option<Json> {
                let mut object = Map::new();
                $(if let Some(value) = self.$key.json() {
                    object.insert(stringify!($key).to_owned(), value);
                })*
                Some(Json::Object(object))
            }

            fn schema() -> Json {
                let mut properties = Map::new();
                let mut required: Vec<&str> = Vec::new();
                $(
                    let mut schema = <$type as Member>::schema();
                    let doc: &str = concat!($($doc,)*).trim();
                    if !doc.is_empty() {
                        schema["description"] = json!(doc);
                    }
                    properties.insert(stringify!($key).to_owned(), schema);
                    if <$type as Member>::REQUIRED {
                        required.push(stringify!($key));
                    }
                )*
                json!({
                    "type": "object",
                    "properties": properties,
                    "required": required,
                    "additionalProperties": false,
                })
            }
        }
    )*};
}

words! {
    /// The format of the document.
    Format = ["study-analysis/1"],
    /// That of the document of parts.
    PartsFormat = ["study-parts/1"],
    /// The answer of a finding.
    Answer = ["yes", "not shown", "undefined"],
    /// The direction of an effect.
    Way = ["up", "down", "curved"],
    /// Which ratings are better.
    End = ["higher", "lower"],
    /// The role of a realization.
    RoleWord = ["test", "practice", "hidden-reference", "low-anchor", "mid-anchor", "physical"],
}

/// Statistics by identifier.
pub(super) struct Statistics(pub(super) Map<String, Json>);

impl Member for Statistics {
    fn json(self) -> Option<Json> {
        Some(Json::Object(self.0))
    }

    fn schema() -> Json {
        json!({ "type": "object" })
    }
}

objects! {
    /// The document.
    Document {
        format: Format,
        /// version of the program
        tool_version: String,
        study: Study,
        /// the question whose answers were analyzed
        question: String,
        /// lowest rating that counts as realistic; null if none is stated
        realistic_from: Option<f64>,
        /// level of significance of every test
        alpha: f64,
        /// which ratings are better
        better: End,
        /// statistics by identifier; null if undefined
        values: Statistics,
        /// why a statistic is undefined, by identifier
        undefined: Map<String, Json>,
        warnings: Vec<Note>,
        realizations: Vec<Realization>,
        /// the answer to each question of the study
        findings: Vec<Answered>,
        exclusions: Vec<Rule>,
        /// changes of the analysis after the study began
        deviations: Vec<String>,
        counts: Numbers,
        /// parts that are not ratings, as in `study-parts/1`; absent without any (docs/statistics-psychophysics.md)
        parts: IfAny<Vec<Part>>,
        /// the sites of a pooled analysis; only there
        sites: IfAny<Vec<Place>>,
        /// how the study compares with its preregistration; only if it has one
        preregistration: IfAny<Preregistered>,
    }

    /// The document of the parts that are not ratings.
    PartsDocument {
        format: PartsFormat,
        /// version of the program
        tool_version: String,
        /// as it was given
        path: String,
        /// its id
        study: String,
        parts: Vec<Part>,
        /// how the study compares with its preregistration; only if it has one
        preregistration: IfAny<Preregistered>,
    }

    /// A part.
    Part {
        part: String,
        /// the kind of its trials, or the questionnaire
        task: String,
        /// number of trials with an answer that counts, or of questionnaires with a score
        trials: usize,
        /// whether answers of simulated participants are among them
        simulated: bool,
        /// whether answers of pilots are among them
        pilot: bool,
        /// statistics by identifier; null if undefined
        values: Statistics,
        /// why a statistic is undefined, by identifier
        undefined: Map<String, Json>,
        /// number of participants with such a trial
        participants: usize,
        /// level of significance of every test
        alpha: f64,
        findings: Vec<Answered>,
        warnings: Vec<Note>,
        exclusions: Vec<Rule>,
    }

    /// Where the ratings come from.
    Study {
        /// null for a table from elsewhere
        id: Option<String>,
        title: String,
        protocol_version: Option<u32>,
        /// as it was given
        path: String,
    }

    /// A realization.
    Realization {
        id: String,
        role: RoleWord,
        /// the realization of which it is a hidden duplicate
        duplicate_of: Option<String>,
        vaf: Option<f64>,
    }

    /// A warning or caveat.
    Note {
        /// stable identifier
        code: String,
        /// a sentence without capital and full stop; can contain names from the data
        text: String,
    }

    /// An estimate.
    Estimated {
        name: String,
        value: f64,
        ci95: Option<Vec<f64>>,
    }

    /// The test that decided.
    Decisive {
        name: String,
        symbol: Option<String>,
        statistic: Option<f64>,
        df: Option<Vec<f64>>,
        p: f64,
        /// p below it is a yes
        level: f64,
        /// number of tests for which p or the level is corrected
        comparisons: usize,
    }

    /// A finding.
    Answered {
        /// identifier, such as vaf or differ; with a name: reference/NAME
        question: String,
        verdict: Answer,
        undefined_because: Option<String>,
        direction: Option<Way>,
        /// the realizations that the question is about
        realizations: Vec<String>,
        test: Option<Decisive>,
        n_participants: usize,
        n_realizations: usize,
        estimate: Option<Estimated>,
        effect: Option<Estimated>,
        caveats: Vec<Note>,
    }

    /// An exclusion rule.
    Rule {
        rule: String,
        rows: usize,
        participants: usize,
        /// why the rule could not be judged
        problem: Option<String>,
    }

    /// How many rows and participants there are.
    Numbers {
        rows: usize,
        rated: usize,
        without_rating: usize,
        failed: usize,
        declined: usize,
        missing: usize,
        corrected: usize,
        repeated: usize,
        practice: usize,
        /// excluded rows by reason
        excluded: BTreeMap<String, usize>,
        participants: usize,
        finished: usize,
        excluded_participants: usize,
        /// null if no number is planned
        planned: Option<u32>,
        pilots: usize,
        simulated: usize,
        interim: bool,
    }

    /// A site.
    Place {
        /// as in the statistics site/NAME
        name: String,
        path: String,
        participants: usize,
        /// of the first and the last session
        days: Option<Vec<String>>,
        devices: Vec<Device>,
    }

    /// A device of a site.
    Device {
        kind: String,
        /// what the device says it is
        id: String,
        sessions: usize,
        /// the last commissioning test, as the sessions recorded it
        check: Option<String>,
        /// its age at the last session
        check_age_days: Option<i64>,
    }

    /// The comparison with a preregistration.
    Preregistered {
        /// of the document, as its author says
        date: String,
        sha256: String,
        /// when the first session of a real participant began
        first_session: Option<String>,
        matches: bool,
        deviations: Vec<String>,
    }
}
