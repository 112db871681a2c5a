//! BIDS 1.10, behavioral data.

use super::delimited::{self, MISSING};
use super::table::{Field, Table, Type};
use super::{ExportError, Format, Job, author, readme, telemetry};
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;
use study_base::text::ParticipantId;
use study_session::outcome::RatingRow;
use study_session::outcome::cell::Cell;

/// Columns that the path of a file says, or that are the same in all.
const IN_PATH: [&str; 3] = ["study", "participant", "session"];

/// Letters and digits of a text.
fn label(text: &str) -> String {
    text.chars().filter(char::is_ascii_alphanumeric).collect()
}

/// The label of each participant.
fn labels(
    ids: impl Iterator<Item = ParticipantId>,
) -> Result<BTreeMap<ParticipantId, String>, ExportError> {
    let mut of: BTreeMap<String, ParticipantId> = BTreeMap::new();
    let mut labels = BTreeMap::new();
    for id in ids {
        let short = label(id.as_str());
        if short.is_empty() {
            return Err(ExportError::NoLabel(id));
        }
        // A file system may not tell case.
        if let Some(other) = of.insert(short.to_ascii_lowercase(), id.clone()) {
            return Err(ExportError::SameLabel {
                ids: [other, id],
                label: short,
            });
        }
        labels.insert(id, short);
    }
    Ok(labels)
}

/// What a sidecar says of a column.
fn described(field: &Field) -> Json {
    let mut about = Map::new();
    let mut put = |key: &str, value: Json| {
        about.insert(key.to_owned(), value);
    };
    if let Some(title) = &field.title {
        put("LongName", json!(title));
    }
    let empty = field
        .empty
        .as_ref()
        .map(|when| format!(". {MISSING}: {when}"));
    put(
        "Description",
        json!(format!("{}{}", field.meaning, empty.unwrap_or_default())),
    );
    if let Some(unit) = &field.unit {
        put("Units", json!(unit));
    }
    // Either all values or a range: a value outside the list would be an error.
    if !field.levels.is_empty() {
        let levels =
            (field.levels.iter()).map(|(value, label)| (delimited::bids_cell(value), json!(label)));
        put("Levels", Json::Object(levels.collect()));
    } else if field.kind == Type::Flag {
        put("Levels", json!({"true": "yes", "false": "no"}));
    } else {
        let format = match field.kind {
            Type::Whole => Some("integer"),
            Type::Number => Some("number"),
            _ => None,
        };
        if let Some(format) = format {
            put("Format", json!(format));
        }
        if let Some(min) = field.min {
            put("Minimum", json!(min));
        }
        if let Some(max) = field.max {
            put("Maximum", json!(max));
        }
    }
    Json::Object(about)
}

/// The name of a column in BIDS.
fn name(field: &Field) -> &str {
    match field.name.as_str() {
        "response_s" => "response_time",
        other => other,
    }
}

fn sidecar(table: &Table<'_>) -> Map<String, Json> {
    let fields = table
        .fields
        .iter()
        .filter(|f| !IN_PATH.contains(&f.name.as_str()));
    fields.map(|f| (name(f).to_owned(), described(f))).collect()
}

/// Brain Imaging Data Structure.
pub(super) struct Bids;

impl Format for Bids {
    const NAME: &'static str = "bids";
    const ABOUT: &'static str = "Brain Imaging Data Structure 1.10, behavioral data";
    const MISSING: &'static str = "`n/a`";

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let study = &job.source.protocol.study;
        let labels = labels(job.selected.ids.values().cloned())?;
        let task = match label(&study.id) {
            empty if empty.is_empty() => "study".to_owned(),
            label => label,
        };
        let description = dataset_description(job);
        job.json("dataset_description.json", &description)?;
        let mut changed = participants(job, &labels)?;
        let both = job.tables.intervals.is_some();
        let tables = [
            Some((&job.tables.ratings, "trials")),
            job.tables.intervals.as_ref().map(|t| (t, "intervals")),
        ];
        for (table, which) in tables.into_iter().flatten() {
            let which = if both {
                format!("_acq-{which}")
            } else {
                String::new()
            };
            let mut about = Map::new();
            about.insert("TaskName".to_owned(), json!(task));
            about.insert("TaskDescription".to_owned(), json!(readme::methods(job)));
            if let Some(text) = &job.source.protocol.text.instructions {
                about.insert("Instructions".to_owned(), json!(text));
            }
            about.extend(sidecar(table));
            job.json(
                &format!("task-{task}{which}_beh.json"),
                &Json::Object(about),
            )?;
            changed += trials(job, table, &labels, &format!("task-{task}{which}_beh.tsv"))?;
        }
        if job.options.telemetry {
            playbacks(job, &labels, &task)?;
        }
        job.protocol("sourcedata/protocol")?;
        let mut files = vec![
            (
                "participants.tsv".to_owned(),
                "one row for each participant",
            ),
            (
                format!("sub-ID/beh/sub-ID_task-{task}_beh.tsv"),
                "one row for each trial",
            ),
            ("*.json".to_owned(), "what the columns mean"),
            (
                "sourcedata/protocol/".to_owned(),
                "the protocol and its realizations",
            ),
        ];
        if both {
            files[1].0 = format!("sub-ID/beh/sub-ID_task-{task}_acq-trials_beh.tsv");
            let path = format!("sub-ID/beh/sub-ID_task-{task}_acq-intervals_beh.tsv");
            files.insert(2, (path, "one row for each presentation"));
        }
        if job.options.telemetry {
            let path = format!("sub-ID/beh/sub-ID_task-{task}_recording-trial…_stim.tsv.gz");
            files.insert(
                2,
                (
                    path,
                    "position and force of the attempt that counts, without a header",
                ),
            );
        }
        let mut notes =
            vec!["Participants are named by the letters and digits of their id.".to_owned()];
        if changed > 0 {
            notes.push(format!(
                "Tabs and line breaks are spaces, in {changed} texts."
            ));
        }
        let text = readme::readme(job, &files, &notes);
        job.file("README.md", text.as_bytes())?;
        let changes = readme::changes(job);
        job.file("CHANGES", changes.as_bytes())
    }
}

fn dataset_description(job: &Job<'_>) -> Json {
    let study = &job.source.protocol.study;
    let authors: Vec<&str> = study.authors.iter().map(|a| author::author(a).0).collect();
    let mut about = json!({
        "Name": job.title(),
        "BIDSVersion": "1.10.0",
        "DatasetType": "raw",
        "GeneratedBy": [{
            "Name": "study",
            "Version": job.source.tool_version,
            "Description": readme::command(job),
        }],
    });
    let doi = author::doi(study).map(|doi| format!("doi:{doi}"));
    for (key, value) in [
        ("License", study.license.as_ref().map(|l| json!(l))),
        (
            "Authors",
            Some(json!(authors)).filter(|_| !authors.is_empty()),
        ),
        ("Funding", study.funding.as_ref().map(|f| json!([f]))),
        ("EthicsApprovals", study.ethics.as_ref().map(|e| json!([e]))),
        ("DatasetDOI", doi.map(|d| json!(d))),
    ] {
        if let Some(value) = value {
            about[key] = value;
        }
    }
    about
}

/// `participants.tsv` and its sidecar; returns the number of changed texts.
fn participants(
    job: &mut Job<'_>,
    labels: &BTreeMap<ParticipantId, String>,
) -> Result<usize, ExportError> {
    let mut table = job.tables.participants.clone();
    let Some(at) = table.place("participant") else {
        return Ok(0);
    };
    for (row, of) in table.rows.iter_mut().zip(&job.selected.participants) {
        let label = labels.get(&of.participant).map_or("", String::as_str);
        row[at] = Cell::Text(format!("sub-{label}").into());
    }
    // These names have a fixed meaning and fixed values in BIDS.
    for field in &mut table.fields {
        match field.name.to_ascii_lowercase().as_str() {
            "participant" => field.name = "participant_id".to_owned(),
            "age" => {
                field.name = "age".to_owned();
                field.unit = Some("year".to_owned());
            }
            other @ ("sex" | "handedness" | "species" | "strain" | "strain_rrid" | "hed") => {
                field.name = format!("{other}_answer");
            }
            _ => {}
        }
    }
    recoded(&mut table, "sex", &SEX);
    recoded(&mut table, "handedness", &HANDEDNESS);
    let names: Vec<&str> = table.fields.iter().map(|f| f.name.as_str()).collect();
    let (bytes, changed) = delimited::tsv(&names, table.rows.iter().map(Vec::as_slice));
    job.file("participants.tsv", &bytes)?;
    let about = table.fields.iter().map(|f| (f.name.clone(), described(f)));
    job.json("participants.json", &Json::Object(about.collect()))?;
    Ok(changed)
}

/// Value, label and the answers that mean it.
type Code = (&'static str, &'static str, &'static [&'static str]);

const SEX: [Code; 3] = [
    (
        "F",
        "female",
        &["f", "female", "woman", "weiblich", "frau", "女性", "女"],
    ),
    (
        "M",
        "male",
        &["m", "male", "man", "männlich", "mann", "男性", "男"],
    ),
    ("O", "other", &["o", "other", "another", "divers", "その他"]),
];

const HANDEDNESS: [Code; 3] = [
    ("left", "left", &["l", "left", "links", "左"]),
    ("right", "right", &["r", "right", "rechts", "右"]),
    (
        "ambidextrous",
        "ambidextrous",
        &["a", "ambidextrous", "both", "both alike", "beide", "両手"],
    ),
];

/// Gives a column the name and the values of BIDS if every option means one of them.
fn recoded(table: &mut Table<'_>, name: &str, codes: &'static [Code]) {
    let code = |text: &str| {
        let text = text.to_lowercase();
        codes
            .iter()
            .find(|(_, _, words)| words.contains(&text.as_str()))
    };
    let own = format!("{name}_answer");
    let Some(at) = table.place(&own) else { return };
    let field = &mut table.fields[at];
    if field.levels.is_empty() || field.levels.iter().any(|(v, _)| code(v).is_none()) {
        return;
    }
    field.name = name.to_owned();
    field.levels = codes
        .iter()
        .map(|(v, l, _)| ((*v).to_owned(), (*l).to_owned()))
        .collect();
    for row in &mut table.rows {
        if let Cell::Text(text) = &row[at]
            && let Some((value, _, _)) = code(text)
        {
            row[at] = Cell::Text((*value).into());
        }
    }
}

/// The folder and the beginning of the names of a participant's files.
fn prefix(job: &Job<'_>, label: &str, session: u32) -> String {
    match job.selected.several_sessions() {
        true => format!("sub-{label}/ses-{session}/beh/sub-{label}_ses-{session}_"),
        false => format!("sub-{label}/beh/sub-{label}_"),
    }
}

/// A table for each session; returns the number of changed texts.
fn trials(
    job: &mut Job<'_>,
    table: &Table<'_>,
    labels: &BTreeMap<ParticipantId, String>,
    file: &str,
) -> Result<usize, ExportError> {
    let mut own = table.clone();
    own.drop_fields(|f| IN_PATH.contains(&f.name.as_str()));
    let names: Vec<&str> = own.fields.iter().map(name).collect();
    let mut sessions: BTreeMap<(String, String), Vec<&[Cell<'_>]>> = BTreeMap::new();
    for (row, cells) in table.rows.iter().zip(&own.rows) {
        let place = |column| table.text(row, column).unwrap_or_default();
        let session = (place("participant"), place("session"));
        sessions.entry(session).or_default().push(cells);
    }
    let mut changed = 0;
    for ((participant, session), rows) in sessions {
        let label = labels.iter().find(|(id, _)| id.as_str() == participant);
        let label = label.map_or("", |(_, label)| label);
        let path = prefix(job, label, session.parse().unwrap_or(1)) + file;
        let (bytes, here) = delimited::tsv(&names, rows);
        job.file(&path, &bytes)?;
        changed += here;
    }
    Ok(changed)
}

/// Telemetry: a continuous stimulus for each playback.
fn playbacks(
    job: &mut Job<'_>,
    labels: &BTreeMap<ParticipantId, String>,
    task: &str,
) -> Result<(), ExportError> {
    for recorded in telemetry::recorded(job) {
        let Some(id) = job.selected.ids.get(&recorded.participant) else {
            continue;
        };
        let label = labels.get(id).map_or("", String::as_str);
        let samples = telemetry::samples(job, recorded)?;
        let Some((rate, even)) = samples.rate() else {
            continue;
        };
        let interval = recorded
            .interval
            .map_or_else(String::new, |i| format!("i{i}"));
        let path = format!(
            "{}task-{task}_recording-trial{:03}{interval}_stim",
            prefix(job, label, recorded.session),
            recorded.trial
        );
        let of_session = |r: &&RatingRow| r.participant == *id && r.session == recorded.session;
        let mut rows = job.selected.rows.iter().filter(of_session);
        let row = rows.clone().find(|r| r.trial == recorded.trial);
        let first = rows.next();
        let first = first.and_then(|row| row.started_at);
        let start = recorded
            .started_at
            .zip(first)
            .map(|(at, first)| (at - first).as_seconds_f64());
        let mut about = json!({
            "TaskName": task,
            "SamplingFrequency": rate,
            "StartTime": start.unwrap_or(0.0) + samples.first(),
        });
        if let Some(clamps) = row.and_then(|r| r.clamp_count) {
            about["clamp_count"] = json!(clamps);
        }
        // The stamps are told only where they are uneven.
        let skip = usize::from(even);
        let fields = telemetry::fields();
        let own: Vec<&Field> = fields.iter().skip(5 + skip).collect();
        about["Columns"] = json!(own.iter().map(|f| &f.name).collect::<Vec<_>>());
        for field in &own {
            about[&field.name] = json!({"Description": field.meaning, "Units": field.unit});
        }
        let mut text = String::new();
        for row in &samples.rows {
            let cells: Vec<String> = row
                .iter()
                .skip(skip)
                .map(|c| delimited::bids_cell(c))
                .collect();
            text += &(cells.join("\t") + "\n");
        }
        job.file(&format!("{path}.tsv.gz"), &telemetry::gzip(text.as_bytes()))?;
        job.json(&format!("{path}.json"), &about)?;
    }
    Ok(())
}
