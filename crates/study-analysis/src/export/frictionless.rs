//! Frictionless Data Package, version 2 or 1.

use super::table::{Field, Type};
use super::{Dialect, ExportError, Format, Job, author, delimited, readme, telemetry};
use serde_json::{Map, Value as Json, json};
use study_base::hex::sha256;

/// Frictionless Data Package.
pub(super) struct Frictionless;

impl Format for Frictionless {
    const NAME: &'static str = "frictionless";
    const ABOUT: &'static str = "Frictionless Data Package";
    const PROFILES: bool = true;

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let old = job.options.profile_1;
        let tables = job.tables;
        let mut resources = Vec::new();
        let mut files = Vec::new();
        for table in tables.all() {
            let path = format!("{}.csv", table.name);
            let bytes = delimited::csv(table, &Dialect::default());
            job.file(&path, &bytes)?;
            let mut schema = schema(&table.fields, old);
            schema["primaryKey"] = json!(table.key);
            let foreign: Vec<Json> = (table.refers.iter()).map(foreign_key).collect();
            if !foreign.is_empty() {
                schema["foreignKeys"] = json!(foreign);
            }
            resources.push(resource(table.name, &path, &bytes, schema, old));
            files.push(readme::listed(table));
        }
        telemetry::by_session(job, |job, session| {
            let who = session.participant.as_str();
            let path = format!("telemetry/{who}-{}.csv", session.session);
            job.file(&path, &session.bytes)?;
            let name = format!("telemetry-{who}-{}", session.session).to_ascii_lowercase();
            let mut schema = schema(&telemetry::fields(), old);
            schema["foreignKeys"] =
                json!([foreign_key(&("participant", "participants", "participant")),]);
            resources.push(resource(&name, &path, &session.bytes, schema, old));
            Ok(())
        })?;
        if job.options.telemetry {
            files.push((
                "telemetry/".to_owned(),
                "position and force of the attempts that count",
            ));
        }
        job.protocol("protocol")?;
        files.push(("protocol/".to_owned(), "the protocol and its realizations"));
        let package = package(job, resources);
        job.json("datapackage.json", &package)?;
        files.push(("datapackage.json".to_owned(), "what the columns mean"));
        let text = readme::readme(job, &files, &[]);
        job.file("README.md", text.as_bytes())?;
        let changes = readme::changes(job);
        job.file("CHANGES.md", changes.as_bytes())
    }
}

fn foreign_key((column, table, other): &(&str, &str, &str)) -> Json {
    json!({"fields": [column], "reference": {"resource": table, "fields": [other]}})
}

fn resource(name: &str, path: &str, bytes: &[u8], schema: Json, old: bool) -> Json {
    let mut about = json!({
        "name": name,
        "path": path,
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "bytes": bytes.len(),
        "hash": format!("sha256:{}", sha256(bytes)),
        "schema": schema,
    });
    match old {
        true => about["profile"] = json!("tabular-data-resource"),
        false => about["type"] = json!("table"),
    }
    about
}

fn schema(fields: &[Field], old: bool) -> Json {
    let fields: Vec<Json> = fields.iter().map(|f| field(f, old)).collect();
    json!({"fields": fields, "missingValues": [""]})
}

fn field(field: &Field, old: bool) -> Json {
    let mut about = Map::new();
    let mut constraints = Map::new();
    let kind = match field.kind {
        Type::Text => "string",
        Type::Whole => "integer",
        Type::Number => "number",
        Type::Flag => "boolean",
        Type::Time => "datetime",
    };
    let mut put = |key: &str, value: Json| {
        about.insert(key.to_owned(), value);
    };
    put("name", json!(field.name));
    put("type", json!(kind));
    if let Some(title) = &field.title {
        put("title", json!(title));
    }
    let unit = field
        .unit
        .as_ref()
        .map(|u| format!(", in {u}"))
        .unwrap_or_default();
    let empty = field.empty.as_ref().map(|when| format!(". Empty: {when}"));
    let description = format!("{}{unit}{}", field.meaning, empty.unwrap_or_default());
    put("description", json!(description));
    if field.kind == Type::Time {
        put("format", json!("any"));
    }
    if field.kind == Type::Flag {
        put("trueValues", json!(["true"]));
        put("falseValues", json!(["false"]));
    }
    if field.empty.is_none() && field.title.is_none() {
        constraints.insert("required".to_owned(), json!(true));
    }
    if let Some(min) = field.min {
        constraints.insert("minimum".to_owned(), number(min, field.kind));
    }
    if let Some(max) = field.max {
        constraints.insert("maximum".to_owned(), number(max, field.kind));
    }
    if !field.levels.is_empty() {
        let value = |text: &String| match field.kind {
            Type::Whole => text.parse::<i64>().map_or(json!(text), |n| json!(n)),
            _ => json!(text),
        };
        // No reader checks the categories: a list of whole numbers has its range, too.
        if field.kind == Type::Text {
            let values: Vec<Json> = field.levels.iter().map(|(v, _)| value(v)).collect();
            constraints.insert("enum".to_owned(), json!(values));
        }
        if !old {
            let all =
                (field.levels.iter()).map(|(v, label)| json!({"value": value(v), "label": label}));
            put("categories", json!(all.collect::<Vec<_>>()));
            put("categoriesOrdered", json!(field.ordered));
        }
    }
    if !constraints.is_empty() {
        put("constraints", Json::Object(constraints));
    }
    Json::Object(about)
}

/// A bound in the type of its column.
fn number(x: f64, kind: Type) -> Json {
    match kind {
        Type::Whole if x.fract() == 0.0 => json!(x as i64),
        _ => json!(x),
    }
}

fn package(job: &Job<'_>, resources: Vec<Json>) -> Json {
    let old = job.options.profile_1;
    let study = &job.source.protocol.study;
    let contributor = |text: &String| {
        let (name, id) = author::author(text);
        let mut person = match old {
            true => json!({"title": name, "role": "author"}),
            false => json!({"title": name, "roles": ["creator"]}),
        };
        if let Some(id) = id {
            person["path"] = json!(author::orcid(id));
        }
        person
    };
    let mut about = json!({
        "name": study.id,
        "title": job.title(),
        "description": readme::methods(job),
        "version": readme::VERSION,
        "created": format!("{}T00:00:00Z", readme::date(job)),
        "resources": resources,
    });
    match old {
        true => about["profile"] = json!("tabular-data-package"),
        false => about["$schema"] = json!("https://datapackage.org/profiles/2.0/datapackage.json"),
    }
    let license = study
        .license
        .as_ref()
        .map(|text| match author::spdx(study) {
            Some(id) => {
                json!([{"name": id, "path": study_base::license::spdx_address(id), "title": id}])
            }
            None => json!([{"name": "custom", "title": text}]),
        });
    let contributors: Vec<Json> = study.authors.iter().map(contributor).collect();
    let doi = author::doi(study).map(|doi| json!(format!("https://doi.org/{doi}")));
    for (key, value) in [
        ("licenses", license),
        (
            "contributors",
            Some(json!(contributors)).filter(|_| !contributors.is_empty()),
        ),
        ("homepage", doi),
    ] {
        if let Some(value) = value {
            about[key] = value;
        }
    }
    about
}
