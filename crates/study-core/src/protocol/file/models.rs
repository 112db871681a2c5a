//! `[[models]]`.

use super::reader::{Reader, finite, inner_path, model_id};
use crate::protocol::{DeviceKind, ModelEntry, Role};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Table;
use study_base::text::{ModelId, QuestionId};

/// A model entry with its place; `id` is `None` if it is faulty.
#[derive(Debug)]
pub(super) struct Draft {
    /// Such as `models[0]`.
    pub(super) path: String,
    pub(super) id: Option<ModelId>,
    pub(super) file: Option<String>,
    /// Whether the file has a `file` key, good or not.
    pub(super) has_file: bool,
    pub(super) vaf: Option<f64>,
    pub(super) role: Role,
    pub(super) duplicate_of: Option<ModelId>,
    pub(super) device: Option<DeviceKind>,
    pub(super) covariates: BTreeMap<String, f64>,
}

impl Draft {
    /// The entry, if its id could be read.
    pub(super) fn finish(self) -> Option<ModelEntry> {
        Some(ModelEntry {
            id: self.id?,
            file: self.file,
            vaf: self.vaf,
            role: self.role,
            duplicate_of: self.duplicate_of,
            device: self.device,
            covariates: self.covariates,
        })
    }
}

const ROLES: [(&str, Role); 5] = [
    ("test", Role::Test),
    ("practice", Role::Practice),
    ("hidden-reference", Role::HiddenReference),
    ("low-anchor", Role::LowAnchor),
    ("physical", Role::Physical),
];

/// The kinds of device, as words.
pub(super) const DEVICES: [(&str, DeviceKind); 4] = [
    ("simulated", DeviceKind::Simulated),
    ("serial", DeviceKind::Serial),
    ("process", DeviceKind::Process),
    ("manual", DeviceKind::Manual),
];

/// All models.
pub(super) fn read<'d, 't>(reader: &Reader<'d, 't>, root: &mut Table<'d, 't>) -> Vec<Draft> {
    root.tables("models")
        .into_iter()
        .map(|table| model(reader, table))
        .collect()
}

fn model<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> Draft {
    let path = table.path().to_owned();
    let id = reader
        .need(&mut table, "id", "it names the realization in every file")
        .and_then(|v| model_id(&v));
    let file = table.value("file");
    let has_file = file.is_some();
    let file = file.and_then(|v| inner_path(&v));
    let vaf = table.value("vaf").and_then(|v| {
        let vaf = v.f64()?;
        if vaf.is_nan() || vaf > 1.0 || vaf == f64::NEG_INFINITY {
            v.fault(
                Fault::error(format!(
                    "`{}` has to be a number up to 1, not {vaf}",
                    v.path()
                ))
                .hint("VAF = 1 − var(F − F̂) / var(F)"),
            );
            return None;
        }
        Some(vaf)
    });
    let role = table.word("role", &ROLES).unwrap_or(Role::Test);
    let duplicate_of = table.value("duplicate_of").and_then(|v| model_id(&v));
    let device = table.word("device", &DEVICES);
    let covariates = covariates(&mut table);
    table.finish();
    Draft {
        path,
        id,
        file,
        has_file,
        vaf,
        role,
        duplicate_of,
        device,
        covariates,
    }
}

fn covariates(table: &mut Table<'_, '_>) -> BTreeMap<String, f64> {
    let mut covariates = BTreeMap::new();
    let Some(mut table) = table.table("covariates") else {
        return covariates;
    };
    for (key, _) in table.keys() {
        let Some(value) = table.value(&key) else {
            continue;
        };
        if QuestionId::new(key.as_str()).is_err() {
            value.fault(Fault::error(
                "a covariate names a column: use 1 to 32 of A-Z a-z 0-9 _ -",
            ));
        }
        if let Some(number) = finite(&value) {
            covariates.insert(key, number);
        }
    }
    covariates
}
