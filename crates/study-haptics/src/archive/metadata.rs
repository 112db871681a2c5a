//! What other programs read of a bundle: RO-Crate 1.1 and Data Package 2.0.
//!
//! Both are made of the facts and of nothing else, so that they cannot say anything different.

use super::{Kept, MANIFEST, MODEL, Stated, path};
use crate::model::Realization;
use serde_json::{Value as Json, json};
use study_base::license::{spdx, spdx_address};

/// File name of the RO-Crate.
pub(super) const RO_CRATE: &str = "ro-crate-metadata.json";
/// File name of the Data Package.
pub(super) const DATA_PACKAGE: &str = "datapackage.json";

const CRATE_1_1: &str = "https://w3id.org/ro/crate/1.1";

fn name(realization: &Realization) -> String {
    format!("Haptic stimulus {}", realization.id)
}

fn description(realization: &Realization, stated: &Stated) -> String {
    format!(
        "A haptic model with the recordings that it was identified from, its passivity certificate \
         and its coverage. Method: {}. Credit: {}.",
        realization.provenance.method, stated.credit
    )
}

/// The text of `ro-crate-metadata.json`.
pub(super) fn ro_crate(realization: &Realization, stated: &Stated, recordings: &[Kept]) -> String {
    let paths: Vec<String> = (0..recordings.len()).map(path).collect();
    let id = |id: &str| json!({"@id": id});
    // a list of one is written as its value
    let ids = |of: &[&str]| match of {
        [one] => id(one),
        more => more.iter().map(|i| id(i)).collect::<Json>(),
    };
    let recorded: Vec<&str> = paths.iter().map(String::as_str).collect();
    let all = [&[MODEL, MANIFEST, DATA_PACKAGE][..], &recorded].concat();
    let license = spdx(&stated.license).map_or("#license".to_owned(), spdx_address);
    let license_name = spdx(&stated.license).unwrap_or("Terms of use");
    let file = |path: &str, name: &str, format: &str| json!({"@id": path, "@type": "File", "name": name, "encodingFormat": format});
    let mut graph = vec![
        json!({
            "@id": RO_CRATE,
            "@type": "CreativeWork",
            "about": id("./"),
            "conformsTo": id(CRATE_1_1),
        }),
        json!({
            "@id": "./",
            "@type": "Dataset",
            "name": name(realization),
            "description": description(realization, stated),
            "datePublished": stated.published,
            "license": id(&license),
            "author": id("#credit"),
            "hasPart": ids(&all),
            "mentions": ids(&["#measurement", "#identification"]),
        }),
        json!({
            "@id": license,
            "@type": "CreativeWork",
            "name": license_name,
            "description": stated.license,
        }),
        json!({"@id": "#credit", "@type": "Organization", "name": stated.credit}),
        json!({"@id": "#instrument", "@type": "IndividualProduct", "name": stated.instrument}),
        json!({
            "@id": "#measurement",
            "@type": "CreateAction",
            "name": "Measurement",
            "instrument": id("#instrument"),
            "result": ids(&recorded),
        }),
        json!({
            "@id": "#identification",
            "@type": "CreateAction",
            "name": "Identification",
            "description": realization.provenance.method,
            "object": ids(&recorded),
            "result": id(MODEL),
        }),
        file(MODEL, "Model file (study-model)", "application/toml"),
        file(MANIFEST, "Facts (study-stimulus)", "application/toml"),
        file(DATA_PACKAGE, "Data Package", "application/json"),
    ];
    for (path, kept) in paths.iter().zip(recordings) {
        let name = format!(
            "Recording {} ({})",
            kept.recording.name,
            kept.purpose.as_str()
        );
        graph.push(file(path, &name, "text/csv"));
    }
    let context = format!("{CRATE_1_1}/context");
    format!("{:#}\n", json!({"@context": context, "@graph": graph}))
}

/// What the columns of a recording are.
const COLUMNS: [(&str, &str); 5] = [
    ("t_s", "Time, s"),
    ("x_mm", "Position, mm"),
    ("v_mm_s", "Velocity, mm/s"),
    ("a_m_s2", "Acceleration, m/s²"),
    (
        "f_n",
        "Force of the probe on the target, N, positive with +x",
    ),
];

/// The text of `datapackage.json`.
pub(super) fn data_package(
    realization: &Realization,
    stated: &Stated,
    recordings: &[Kept],
) -> String {
    let license = match spdx(&stated.license) {
        Some(id) => json!({"name": id, "path": spdx_address(id), "title": id}),
        None => json!({"name": "custom", "title": stated.license}),
    };
    let resources: Vec<Json> = (recordings.iter().enumerate())
        .map(|(i, kept)| {
            json!({
                "name": format!("recording-{}", i + 1),
                "title": kept.recording.name,
                "description": format!("Used for {}", kept.purpose.as_str()),
                "type": "table",
                "path": path(i),
                "format": "csv",
                "mediatype": "text/csv",
                "encoding": "utf-8",
                "bytes": kept.bytes.len(),
                "hash": format!("sha256:{}", kept.recording.sha256),
                "dialect": {"commentChar": "#", "delimiter": kept.layout().0.to_string()},
                "schema": {"fields": fields(kept)},
            })
        })
        .collect();
    let package = json!({
        "$schema": "https://datapackage.org/profiles/2.0/datapackage.json",
        "name": realization.id.to_ascii_lowercase(),
        "title": name(realization),
        "description": description(realization, stated),
        "created": format!("{}T00:00:00Z", stated.published),
        "licenses": [license],
        "contributors": [{"title": stated.credit, "roles": ["creator"]}],
        "resources": resources,
    });
    format!("{package:#}\n")
}

fn fields(kept: &Kept) -> Vec<Json> {
    let (separator, columns) = kept.layout();
    let field = |name: &str| {
        let known = COLUMNS.iter().find(|(column, _)| *column == name);
        let mut field = match known {
            Some((_, what)) => json!({"name": name, "type": "number", "description": what}),
            None => json!({"name": name, "type": "any"}),
        };
        if known.is_some() && separator != ',' {
            field["decimalChar"] = json!(kept.decimal());
        }
        field
    };
    columns.iter().map(|name| field(name)).collect()
}
