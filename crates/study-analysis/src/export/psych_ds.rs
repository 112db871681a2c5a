//! Psych-DS 1.5.

use super::table::{Field, Type};
use super::{Dialect, ExportError, Format, Job, author, delimited, readme, telemetry};
use serde_json::{Map, Value as Json, json};

/// Psychology Data Structure.
pub(super) struct PsychDs;

impl Format for PsychDs {
    const NAME: &'static str = "psych-ds";
    const ABOUT: &'static str = "Psych-DS 1.5";

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let dialect = Dialect::default();
        let letters =
            |text: &str| -> String { text.chars().filter(char::is_ascii_alphanumeric).collect() };
        let id = letters(&job.source.protocol.study.id);
        let id = if id.is_empty() {
            "study".to_owned()
        } else {
            id
        };
        let tables = job.tables;
        let mut files = Vec::new();
        let mut variables: Vec<(String, Json)> = Vec::new();
        for table in tables.all() {
            let path = match table.name {
                "ratings" => format!("data/study-{id}_data.csv"),
                name => format!("data/study-{id}_description-{name}_data.csv"),
            };
            job.file(&path, &delimited::csv(table, &dialect))?;
            files.push((path, table.meaning));
            add(&mut variables, &table.fields);
        }
        let mut any = false;
        telemetry::by_session(job, |job, session| {
            let who = letters(session.participant.as_str());
            let number = session.session;
            any = true;
            let path = format!(
                "data/study-{id}_subject-{who}_session-{number}_description-telemetry_data.csv"
            );
            job.file(&path, &session.bytes)
        })?;
        if any {
            add(&mut variables, &telemetry::fields());
            let path =
                format!("data/study-{id}_subject-…_session-…_description-telemetry_data.csv");
            files.push((path, "position and force of the attempts that count"));
        }
        let variables: Vec<Json> = variables.into_iter().map(|(_, v)| v).collect();
        let description = dataset_description(job, variables);
        job.json("dataset_description.json", &description)?;
        job.protocol("materials")?;
        files.push(("materials/".to_owned(), "the protocol and its realizations"));
        let text = readme::readme(job, &files, &[]);
        job.file("README.md", text.as_bytes())?;
        let changes = readme::changes(job);
        job.file("CHANGES.md", changes.as_bytes())
    }
}

/// One description for each name, whatever the number of tables that have it.
fn add(variables: &mut Vec<(String, Json)>, fields: &[Field]) {
    for field in fields {
        let meaning = description(field);
        match variables.iter_mut().find(|(name, _)| *name == field.name) {
            None => variables.push((field.name.clone(), variable(field))),
            Some((_, known)) => {
                let text = known["description"].as_str().unwrap_or_default();
                if !text.contains(&meaning) {
                    known["description"] = json!(format!("{text}; or {meaning}"));
                }
            }
        }
    }
}

fn description(field: &Field) -> String {
    let title = field
        .title
        .as_ref()
        .map(|t| format!("{t} – "))
        .unwrap_or_default();
    let empty = field.empty.as_ref().map(|when| format!(". Empty: {when}"));
    format!("{title}{}{}", field.meaning, empty.unwrap_or_default())
}

fn variable(field: &Field) -> Json {
    let mut about = Map::new();
    let mut put = |key: &str, value: Option<Json>| {
        if let Some(value) = value {
            about.insert(key.to_owned(), value);
        }
    };
    put("@type", Some(json!("PropertyValue")));
    put("name", Some(json!(field.name)));
    put("description", Some(json!(description(field))));
    put("unitText", field.unit.as_ref().map(|u| json!(u)));
    put("minValue", field.min.map(|x| json!(x)));
    put("maxValue", field.max.map(|x| json!(x)));
    let value = |text: &String| match field.kind {
        Type::Whole => text.parse::<i64>().map_or(json!(text), |n| json!(n)),
        _ => json!(text),
    };
    let levels = (field.levels.iter())
        .map(|(v, label)| json!({"@type": "PropertyValue", "value": value(v), "name": label}));
    let levels: Vec<Json> = levels.collect();
    put(
        "valueReference",
        (!levels.is_empty()).then_some(json!(levels)),
    );
    Json::Object(about)
}

fn dataset_description(job: &Job<'_>, variables: Vec<Json>) -> Json {
    let study = &job.source.protocol.study;
    let person = |text: &String| {
        let (name, id) = author::author(text);
        let mut person = json!({"@type": "Person", "name": name});
        if let Some(id) = id {
            person["@id"] = json!(author::orcid(id));
        }
        person
    };
    let authors: Vec<Json> = study.authors.iter().map(person).collect();
    let mut about = json!({
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": job.title(),
        "description": readme::methods(job),
        "schemaVersion": "Psych-DS 1.5.0",
        "version": readme::VERSION,
        "dateCreated": readme::date(job),
        "variableMeasured": variables,
    });
    let address = author::doi(study).map(|doi| json!(format!("https://doi.org/{doi}")));
    let license = match author::spdx(study) {
        Some(id) => Some(json!(study_base::license::spdx_address(id))),
        None => study.license.as_ref().map(|l| json!(l)),
    };
    for (key, value) in [
        (
            "author",
            Some(json!(authors)).filter(|_| !authors.is_empty()),
        ),
        ("license", license),
        ("identifier", address.clone()),
        ("citation", address),
        (
            "funder",
            study
                .funding
                .as_ref()
                .map(|f| json!({"@type": "Organization", "name": f})),
        ),
    ] {
        if let Some(value) = value {
            about[key] = value;
        }
    }
    about
}
