//! `[[models]]`.

use crate::protocol::keys::{Id, Key, Kind, NumberRange, Words as _, keys};
use crate::protocol::section::Section;
use crate::protocol::{DeviceKind, ModelEntry, Role};
use std::collections::BTreeMap;
use std::ops::Bound;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, QuestionId};

pub(super) const AT_MOST_1: NumberRange = (Bound::Unbounded, Bound::Included(1.0));

pub(super) const MODELS: &[Key] = keys! {
    /// The name of the realization in every file.
    "id": Kind::Id(Id::Model), r#""lambda-0.9995""#, required;
    /// Its model file. Simulated and serial devices need one.
    "file": Kind::Path, r#""models/lambda-0.9995.toml""#, derived("the file of `duplicate_of`, if any");
    /// Its variance accounted for, VAF = 1 − var(F − F̂) / var(F). If the model file has
    /// a VAF, too, the two have to agree in the digits given here.
    "vaf": Kind::Number(AT_MOST_1, ""), "0.96", derived("the VAF in the model file, if any");
    /// Its role in the study.
    "role": Kind::Word(Role::WORDS), r#""hidden-reference""#, default(r#""test""#);
    /// The realization of which this one is a hidden duplicate, to measure consistency.
    "duplicate_of": Kind::Id(Id::Model), r#""lambda-0.9991""#;
    /// Its own kind of device. Only `manual`, a sample mounted by hand, can differ from
    /// `[device]`.
    "device": Kind::Word(DeviceKind::WORDS), r#""manual""#, derived("`device.kind`");
    /// Numbers that may explain the ratings. Each becomes a column of the results and is
    /// correlated with the ratings.
    "covariates": Kind::Numbers, "{ lambda = 0.9995, dx_mm = 1.0 }";
};

/// An entry that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialModel {
    /// Such as `models[0]`.
    pub(super) path: String,
    pub(super) id: Option<ModelId>,
    pub(super) file: Option<String>,
    /// Whether there is a `file` key, faulty or not.
    pub(super) has_file: bool,
    pub(super) vaf: Option<f64>,
    pub(super) role: Role,
    pub(super) duplicate_of: Option<ModelId>,
    pub(super) device: Option<DeviceKind>,
    pub(super) covariates: BTreeMap<String, f64>,
}

impl PartialModel {
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

pub(super) fn read(mut section: Section<'_, '_>) -> PartialModel {
    let has_file = section.value("file").is_some();
    PartialModel {
        path: section.path().to_owned(),
        id: section.model_id("id"),
        file: section.path_of("file"),
        has_file,
        vaf: section.number("vaf"),
        role: section.word("role").unwrap_or(Role::Test),
        duplicate_of: section.model_id("duplicate_of"),
        device: section.word("device"),
        covariates: covariates(&mut section),
    }
}

fn covariates(section: &mut Section<'_, '_>) -> BTreeMap<String, f64> {
    let mut covariates = BTreeMap::new();
    for (name, value) in section.entries("covariates") {
        if QuestionId::new(name.as_str()).is_err() {
            value.fault(Fault::error(
                "a covariate names a column: use 1 to 32 of A-Z a-z 0-9 _ -",
            ));
        }
        if let Some(number) = crate::protocol::section::number(&value, Kind::ANY_NUMBER) {
            covariates.insert(name, number);
        }
    }
    covariates
}
