//! `[[models]]`.

use super::Content;
use crate::protocol::keys::{Id, Key, Kind, NumberRange, Words as _, keys};
use crate::protocol::section::{Section, text};
use crate::protocol::{DeviceKind, Media, MediaFile, ModelEntry, Role};
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
    /// Instead of `file`: a bundle of `study stimulus pack`, as a path or as its address
    /// `sha256:…`, which is the file `bundles/….tar`.
    "bundle": Kind::Text, r#""bundles/akko-blue.tar""#;
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
    /// Its level in each of `[[factors]]`. A realization under study has one in each; no other has any.
    "levels": Kind::TextsByName, r#"{ friction = "low", detent = "crisp" }"#;
    /// A picture that the participant's page shows while it is felt: a PNG or JPEG of at most 16 MiB. A study with media
    /// needs `study run --screen`. Needs the format `study-protocol/3`, as do the next four.
    "picture": Kind::Path, r#""media/wood.png""#;
    /// A video that the page plays once, from the device's start on: WebM or MP4.
    "video": Kind::Path, r#""media/drawer.webm""#;
    /// A sound that the page plays once, from the device's start on: WAV, Ogg or MP3.
    "sound": Kind::Path, r#""media/click.wav""#;
    /// What is seen on its picture or video, for screen readers.
    "alt": Kind::Text, r#""A drawer of dark wood.""#, derived("required with `picture` or `video`");
    /// What is heard in its sound or video, as text that the page shows with it.
    "caption": Kind::Text, r#""A click.""#;
};

/// An entry that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialModel {
    /// Such as `models[0]`.
    pub(super) path: String,
    pub(super) id: Option<ModelId>,
    pub(super) file: Option<String>,
    /// Whether there is a `file` or `bundle` key, faulty or not.
    pub(super) has_file: bool,
    /// What the file contains.
    pub(super) content: Content,
    pub(super) vaf: Option<f64>,
    pub(super) role: Role,
    pub(super) duplicate_of: Option<ModelId>,
    pub(super) device: Option<DeviceKind>,
    pub(super) covariates: BTreeMap<String, f64>,
    pub(super) levels: BTreeMap<String, String>,
    pub(super) media: Media,
}

impl PartialModel {
    /// The key that names its file.
    pub(super) fn key(&self) -> &'static str {
        match self.content {
            Content::Bundle(_) => "bundle",
            Content::Model | Content::Orders | Content::Text(_) | Content::Media(_) => "file",
        }
    }

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
            levels: self.levels,
            media: self.media,
        })
    }
}

pub(super) fn read(mut section: Section<'_, '_>) -> PartialModel {
    let (file, content) = file(&mut section);
    let has_file = ["file", "bundle"].map(|key| section.value(key).is_some());
    let has_file = has_file.contains(&true);
    PartialModel {
        path: section.path().to_owned(),
        id: section.model_id("id"),
        file,
        has_file,
        content,
        vaf: section.number("vaf"),
        role: section.word("role").unwrap_or(Role::Test),
        duplicate_of: section.model_id("duplicate_of"),
        device: section.word("device"),
        covariates: covariates(&mut section),
        levels: levels(&mut section),
        media: media(&mut section),
    }
}

/// Its file and what that contains.
fn file(section: &mut Section<'_, '_>) -> (Option<String>, Content) {
    let Some(value) = section.value("bundle") else {
        return (section.path_of("file"), Content::Model);
    };
    if let Some(file) = section.value("file") {
        let fault = Fault::error(format!("`{}` has a `file` and a `bundle`", section.path()));
        file.fault(fault.hint("the bundle has the model file"));
    }
    let text = value.text().unwrap_or_default();
    let Some(hash) = text.strip_prefix("sha256:") else {
        return (section.path_of("bundle"), Content::Bundle(None));
    };
    let digit = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
    if hash.len() != 64 || !hash.chars().all(digit) {
        value.fault(
            Fault::error(format!("`{}` is no address of a bundle", value.path()))
                .hint("sha256: and 64 digits 0-9 a-f, as `study stimulus pack` prints them"),
        );
        return (None, Content::Bundle(None));
    }
    let file = format!("bundles/{hash}.tar");
    (Some(file), Content::Bundle(Some(hash.to_owned())))
}

fn media(section: &mut Section<'_, '_>) -> Media {
    let mut of = |name: &str| {
        let file = section.path_of(name)?;
        Some(MediaFile { file, sha256: None })
    };
    Media {
        picture: of("picture"),
        video: of("video"),
        sound: of("sound"),
        alt: section.text("alt"),
        caption: section.text("caption"),
    }
}

fn levels(section: &mut Section<'_, '_>) -> BTreeMap<String, String> {
    let entries = section.entries("levels").into_iter();
    entries
        .filter_map(|(name, value)| Some((name, text(&value)?)))
        .collect()
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
