//! Loading a protocol with its model files and its orders file.
//!
//! All files are read, each once, and all their faults are collected. Checks that
//! need several files follow: VAFs that differ, orders that cannot be made.
//!
//! ```
//! # fn main() -> Result<(), study_analysis::load::LoadError> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../protocols/turn-signal");
//! let loaded = study_analysis::load::load(folder.as_ref())?;
//! assert_eq!(loaded.protocol.study.id, "turn-signal");
//! assert_eq!(loaded.models.len(), loaded.protocol.models.len());
//! # Ok(())
//! # }
//! ```

use crate::preregister;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use study_base::diagnostic::{Fault, Findings, Severity};
use study_base::text::ModelId;
use study_haptics::archive::{self, Bundle};
use study_haptics::model::{Realization, Units};
use study_haptics::safe_play::{self, Danger};
use study_plan::protocol::file::{self, Content, Named, Parsed};
use study_plan::protocol::fingerprint::{self, Fingerprints, Parts, family_file};
use study_plan::protocol::{DeviceKind, FileOrders, ModelEntry, Order, Protocol, check};
use study_session::store::disk::read_capped;
use study_session::store::layout;

mod errors;
mod families;
mod frozen;
mod join;
mod media;
mod prose;
mod recordings;
mod spaces;

use spaces::Judged;

pub use errors::ComponentErrors;
pub use frozen::{FrozenError, changes, damage, frozen, frozen_version, frozen_versions};
pub use recordings::{Deliveries, RecordingError, deliveries};

/// Largest model file and orders file that are read, bytes.
const MAX_MODEL_BYTES: usize = 16 * 1024 * 1024;
const MAX_ORDERS_BYTES: usize = 64 * 1024 * 1024;
/// Hint for a table that fails its certificate.
const PERMIT: &str = "identify it with m, b >= 0, or permit it in [device]: uncertified = { play = true, force_n = ..., reason = \"...\" }";

/// Hint for a realization that is not safe to play.
const ANEW: &str = "its file is of an older version, from too little data, or has friction by the sign of the velocity, for which --direction play is safer: identify it anew, or permit it in [device]: uncertified = { play = true, force_n = ..., reason = \"...\" }";

/// File name of a protocol in its folder.
pub const FILE_NAME: &str = "protocol.toml";

/// A protocol that cannot be used, or a file of it.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}", first(.0))]
pub struct LoadError(pub Vec<Findings>);

/// The first error, for those who print a single line.
fn first(findings: &[Findings]) -> String {
    let errors = |f: &Findings| f.only(Severity::Error);
    let found = (findings.iter()).find_map(|f| Some((&f.path, errors(f).faults.pop()?)));
    found.map_or_else(
        || "the protocol cannot be loaded".to_owned(),
        |(path, fault)| format!("{path}: {}", fault.message),
    )
}

/// A realization that a device cannot play or must not play.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unplayable {
    /// It has no table, and the device needs one.
    #[error("realization `{0}` has no table for a {device} device", device = .1.as_str())]
    NoTable(ModelId, DeviceKind),
    /// It fails its certificate, and the protocol does not permit that.
    #[error(
        "the table of `{0}` can put energy into a hand, which the protocol, made for samples mounted by hand, does not permit"
    )]
    NotPermitted(ModelId),
    /// It is not safe to play, and the protocol does not permit that.
    #[error("`{0}` is not safe to play: {1}")]
    NotSafe(ModelId, Danger),
}

impl Unplayable {
    /// What to do next.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoTable(..) => {
                "add its `file`; only a child program or a sample mounted by hand needs none"
            }
            Self::NotPermitted(_) => PERMIT,
            Self::NotSafe(..) => ANEW,
        }
    }
}

/// A protocol with all its files.
#[derive(Debug)]
pub struct Loaded {
    /// Protocol, including the VAFs of the model files.
    pub protocol: Protocol,
    /// Folder of the protocol.
    pub folder: PathBuf,
    /// Path of the protocol file.
    pub path: PathBuf,
    /// The table of each realization that has a file.
    pub models: BTreeMap<ModelId, Realization>,
    /// The tables of all levels and standards of families, and of the points of spaces.
    pub levels: BTreeMap<ModelId, Realization>,
    /// The orders file, if the design has one.
    pub orders: Option<FileOrders>,
    /// The files of the study: relative path, separated by `/`, and bytes;
    /// `protocol.toml` first, then each other file once.
    pub files: Vec<(String, Vec<u8>)>,
    /// What the fingerprints are made of.
    pub parts: Parts,
    /// Fingerprints of the study.
    pub fingerprints: Fingerprints,
    /// The warnings of all files.
    pub findings: Vec<Findings>,
}

impl Loaded {
    /// Every table that a session may play.
    pub fn tables(&self) -> BTreeMap<ModelId, Realization> {
        let all = self.models.iter().chain(&self.levels);
        all.map(|(id, table)| (id.clone(), table.clone())).collect()
    }

    /// Refuses realizations that a kind of device cannot play or must not play. Samples
    /// mounted by hand need no table.
    ///
    /// # Errors
    /// [`Unplayable`], for the first of them.
    pub fn check_playable(&self, kind: DeviceKind) -> Result<(), Unplayable> {
        let by_hand = |m: &&ModelEntry| m.device == Some(DeviceKind::Manual);
        if kind == DeviceKind::Manual {
            return Ok(());
        }
        let rules = self.protocol.device.uncertified.as_ref();
        let permitted = rules.is_some_and(|rules| rules.play);
        for model in self.protocol.models.iter().filter(|m| !by_hand(m)) {
            let id = || model.id.clone();
            match self.models.get(&model.id) {
                None if kind != DeviceKind::Process => return Err(Unplayable::NoTable(id(), kind)),
                Some(table) if !permitted && !table.certificate().passes() => {
                    return Err(Unplayable::NotPermitted(id()));
                }
                Some(table) if !permitted => {
                    if let Some(danger) = safe_play::refusal(table, &safe_play::Device::default()) {
                        return Err(Unplayable::NotSafe(id(), danger));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Number of trials of a session, including practice.
    pub fn trials(&self) -> usize {
        match self.orders.as_ref().and_then(|rows| rows.values().next()) {
            Some(row) => row.len() + self.protocol.design.practice.len(),
            None => check::trials(&self.protocol) as usize,
        }
    }
}

/// Loads the protocol at `path`, a `protocol.toml` or the folder that contains one.
///
/// # Errors
/// [`LoadError`] with all faults of all files if any of them is an error.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    let (loaded, findings) = examine(path);
    loaded.ok_or(LoadError(findings))
}

/// The same for a study that may have started in `results`, a results folder or the
/// folder of the study in it. Such a study goes on even if not all its orders can be
/// made.
///
/// # Errors
/// As [`load`].
pub fn load_for(path: &Path, results: &Path) -> Result<Loaded, LoadError> {
    let (loaded, findings) = open(path, Purpose::Sessions(results));
    loaded.ok_or(LoadError(findings))
}

/// Loads the frozen protocol of a running study in order to read its data: tables
/// that must not be played are accepted.
///
/// # Errors
/// As [`load`].
pub fn load_frozen(path: &Path) -> Result<Loaded, LoadError> {
    let (loaded, findings) = open(path, Purpose::Data(Judged::Now));
    loaded.ok_or(LoadError(findings))
}

/// The same of a study whose manifest has these fingerprints: with the points of its spaces that passed when it began.
fn load_begun(path: &Path, prints: &Fingerprints) -> Result<Loaded, LoadError> {
    let now = load_frozen(path)?;
    if now.protocol.spaces.is_empty() || now.fingerprints == *prints {
        return Ok(now);
    }
    let mut earlier = Judged::EARLIER.into_iter();
    let found = earlier.find_map(|judged| {
        let loaded = open(path, Purpose::Data(judged)).0;
        loaded.filter(|loaded| loaded.fingerprints == *prints)
    });
    Ok(found.unwrap_or(now))
}

/// Loads the protocol at `path`; returns all errors and warnings, and the protocol if
/// there are no errors.
pub fn examine(path: &Path) -> (Option<Loaded>, Vec<Findings>) {
    open(path, Purpose::Design)
}

/// What a protocol is loaded for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose<'a> {
    /// Everything it contains must be possible.
    Design,
    /// Sessions of a study that may have started in this folder.
    Sessions(&'a Path),
    /// Reading the data of a study that has started, with the points of its spaces that passed by this rule.
    Data(Judged),
}

impl Purpose<'_> {
    /// The rule by which points passed, if data are read and nothing is to be played.
    fn of_data(self) -> Option<Judged> {
        match self {
            Self::Data(judged) => Some(judged),
            Self::Design | Self::Sessions(_) => None,
        }
    }

    fn has_started(self, study: &str) -> bool {
        match self {
            Self::Design => false,
            Self::Sessions(results) => [results.join(study), results.to_owned()]
                .iter()
                .any(|folder| folder.join(layout::MANIFEST).symlink_metadata().is_ok()),
            Self::Data(_) => true,
        }
    }
}

fn open(path: &Path, purpose: Purpose<'_>) -> (Option<Loaded>, Vec<Findings>) {
    let data = purpose.of_data();
    let path = if path.is_dir() && data.is_none() {
        path.join(FILE_NAME)
    } else {
        path.to_owned()
    };
    let shown = path.display().to_string();
    let bytes = match read_capped(&path, file::MAX_FILE_BYTES) {
        Ok(bytes) => bytes,
        Err(problem) => {
            let fault = Fault::error(problem.to_string())
                .hint("PROTOCOL is a protocol.toml or the folder that contains it");
            return (None, vec![Findings::alone(shown, fault)]);
        }
    };
    let text = match text_of(&bytes) {
        Ok(text) => text,
        Err(fault) => return (None, vec![Findings::alone(shown, fault)]),
    };
    let Parsed {
        protocol,
        mut findings,
        spans,
        named,
    } = file::parse(&shown, text);
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    let mut others = OtherFiles::new(&folder);
    for name in named {
        if let Err(fault) = others.open(&name) {
            let place = spans.get(&name.place).cloned();
            findings.faults.push(fault.at(place));
        }
    }
    let Some(mut protocol) = protocol else {
        findings.sort();
        return (None, others.findings(findings));
    };
    others.texts.fill(&mut protocol);
    others.assign(&protocol);
    others.turn(protocol.device.lever_mm);
    media::pin(&mut protocol, &others, &spans, &mut findings);
    join::vaf(&mut protocol, &others, &spans, &mut findings);
    join::too_close(&protocol, &others, &mut findings);
    if data.is_none() {
        join::certificates(&protocol, &others, &spans, &mut findings);
    }
    let played = data.is_none();
    let mut levels = families::realizations(&protocol, &others, &spans, played, &mut findings);
    let points = spaces::realizations(&mut protocol, &others, &spans, data, &mut findings);
    levels.extend(points);
    let orders = others.orders.take();
    // An order whose file is missing cannot be checked.
    if orders.is_some() || !matches!(protocol.design.order, Order::File(_)) {
        let started = purpose.has_started(&protocol.study.id);
        join::orders(&protocol, orders.as_ref(), started, &spans, &mut findings);
    }
    let unread = others.unread(&protocol);
    findings
        .faults
        .extend(check::warnings(&protocol, &spans, &unread));
    let started = purpose.has_started(&protocol.study.id);
    (findings.faults).extend(check::coarse(&protocol, &spans, started));
    findings.sort();

    let mut files = vec![(FILE_NAME.to_owned(), bytes)];
    let parts = fingerprint::parts(&protocol, &others.bytes_by_model(), orders.as_ref());
    let models = others.realizations();
    files.extend(others.take_bytes());
    // Frozen with the protocol; nothing else depends on it.
    if let Ok(bytes) = read_capped(&folder.join(preregister::FILE), file::MAX_FILE_BYTES) {
        files.push((preregister::FILE.to_owned(), bytes));
    }
    let all = others.findings(findings);
    if all.iter().any(Findings::has_errors) {
        return (None, all);
    }
    let loaded = Loaded {
        protocol,
        folder,
        path,
        models,
        levels,
        orders,
        files,
        fingerprints: parts.fingerprints(),
        parts,
        findings: all.clone(),
    };
    (Some(loaded), all)
}

/// The other files of a protocol, each read once.
#[derive(Debug)]
struct OtherFiles<'f> {
    folder: &'f Path,
    /// In the order of the protocol.
    opened: Vec<Opened>,
    orders: Option<FileOrders>,
    /// What participants read.
    texts: prose::Texts,
    /// Bytes of all media.
    media_bytes: usize,
    /// Realization → index in `opened`.
    models: BTreeMap<ModelId, usize>,
    /// The same for the ends of families and for spaces.
    ends: BTreeMap<ModelId, usize>,
}

#[derive(Debug)]
struct Opened {
    file: String,
    bytes: Vec<u8>,
    /// The model file of a bundle.
    model: Option<Vec<u8>>,
    realization: Option<Realization>,
    findings: Findings,
}

impl<'f> OtherFiles<'f> {
    fn new(folder: &'f Path) -> Self {
        Self {
            folder,
            opened: Vec::new(),
            orders: None,
            texts: prose::Texts::default(),
            media_bytes: 0,
            models: BTreeMap::new(),
            ends: BTreeMap::new(),
        }
    }

    /// Reads a file that the protocol names, once. The returned fault concerns the
    /// protocol; the faults of the file itself are kept with the file.
    fn open(&mut self, name: &Named) -> Result<(), Fault> {
        if let Some(opened) = self.opened.iter().find(|o| o.file == name.file) {
            return match &name.content {
                Content::Media(medium) => media::check(&opened.bytes, *medium),
                // One file may have two texts; its faults are known.
                Content::Text(which) => {
                    if let Ok(text) = text_of(&opened.bytes) {
                        self.texts.read(*which, String::new(), text);
                    }
                    Ok(())
                }
                Content::Model | Content::Orders | Content::Bundle(_) => Ok(()),
            };
        }
        let (most, what) = match name.content {
            Content::Orders => (MAX_ORDERS_BYTES, "orders"),
            Content::Model => (MAX_MODEL_BYTES, "model"),
            Content::Text(which) => (prose::MAX_BYTES, prose::name(which)),
            Content::Bundle(_) => (archive::MAX_BYTES, "bundle"),
            Content::Media(medium) => (media::MAX_BYTES, medium.as_str()),
        };
        let path = self.folder.join(&name.file);
        let bytes = read_capped(&path, most).map_err(|problem| {
            Fault::error(format!("the {what} file cannot be read: {problem}"))
                .hint("paths are relative to the protocol")
        })?;
        let model = match &name.content {
            Content::Media(medium) => return self.keep(&name.file, bytes, *medium),
            Content::Bundle(address) => Some(model_of(&bytes, address.as_deref())?),
            Content::Model | Content::Orders | Content::Text(_) => None,
        };
        let shown = path.display().to_string();
        let mut realization = None;
        let findings = match text_of(model.as_ref().unwrap_or(&bytes)) {
            Err(fault) => Findings::alone(shown, fault),
            Ok(text) => match name.content {
                Content::Orders => {
                    let (orders, findings) = file::parse_orders(&shown, text);
                    if !findings.has_errors() {
                        self.orders = Some(orders);
                    }
                    findings
                }
                Content::Text(which) => self.texts.read(which, shown, text),
                Content::Model | Content::Bundle(_) | Content::Media(_) => {
                    let (read, findings) = study_haptics::model::file::parse(&shown, text);
                    realization = read;
                    findings
                }
            },
        };
        self.opened.push(Opened {
            file: name.file.clone(),
            bytes,
            model,
            realization,
            findings,
        });
        Ok(())
    }

    /// Converts the realizations of a turning handle to mm and N at the lever arm.
    fn turn(&mut self, lever_mm: Option<f64>) {
        for opened in &mut self.opened {
            let rotary = |r: &Realization| r.units != Units::Linear;
            let Some(realization) = opened.realization.take_if(|r| rotary(r)) else {
                continue;
            };
            match lever_mm {
                Some(lever_mm) => opened.realization = Some(realization.at_lever(lever_mm)),
                None => {
                    let [x, f] = realization.units.names();
                    opened.findings.faults.push(
                        Fault::error(format!("the realization is in {x} and {f}"))
                            .hint("`device.lever_mm` of the protocol says where the hand holds"),
                    );
                }
            }
        }
    }

    /// Assigns each realization, each end of a family and each space its file.
    fn assign(&mut self, protocol: &Protocol) {
        let index = |file: Option<&String>| self.opened.iter().position(|o| Some(&o.file) == file);
        for model in &protocol.models {
            if let Some(index) = index(model.file.as_ref()) {
                self.models.insert(model.id.clone(), index);
            }
        }
        for family in &protocol.families {
            for (end, file) in [("from", Some(&family.from)), ("to", family.to.as_ref())] {
                if let (Some(id), Some(index)) = (family_file(&family.id, end), index(file)) {
                    self.ends.insert(id, index);
                }
            }
        }
        for space in &protocol.spaces {
            if let (Some(id), Some(index)) =
                (family_file(&space.id, "from"), index(Some(&space.from)))
            {
                self.ends.insert(id, index);
            }
        }
    }

    /// The realizations whose file is missing or faulty.
    fn unread<'p>(&self, protocol: &'p Protocol) -> Vec<&'p ModelId> {
        let models = protocol.models.iter().filter(|m| m.file.is_some());
        let unread = models.filter(|m| self.realization(&m.id).is_none());
        unread.map(|m| &m.id).collect()
    }

    fn realization(&self, id: &ModelId) -> Option<&Realization> {
        let index = self.models.get(id).or_else(|| self.ends.get(id))?;
        self.opened[*index].realization.as_ref()
    }

    fn realizations(&self) -> BTreeMap<ModelId, Realization> {
        self.models
            .keys()
            .filter_map(|id| Some((id.clone(), self.realization(id)?.clone())))
            .collect()
    }

    fn bytes_by_model(&self) -> BTreeMap<ModelId, Vec<u8>> {
        (self.models.iter().chain(&self.ends))
            .map(|(id, index)| {
                let Opened { model, bytes, .. } = &self.opened[*index];
                (id.clone(), model.as_ref().unwrap_or(bytes).clone())
            })
            .collect()
    }

    fn take_bytes(&mut self) -> Vec<(String, Vec<u8>)> {
        self.opened
            .iter_mut()
            .map(|o| (o.file.clone(), std::mem::take(&mut o.bytes)))
            .collect()
    }

    /// The findings of all files, the protocol's first; files without findings are
    /// omitted.
    fn findings(self, protocol: Findings) -> Vec<Findings> {
        std::iter::once(protocol)
            .chain(self.opened.into_iter().map(|o| o.findings))
            .filter(|f| !f.faults.is_empty())
            .collect()
    }
}

/// The model file of a bundle, which is verified.
fn model_of(bundle: &[u8], address: Option<&str>) -> Result<Vec<u8>, Fault> {
    let refused = |why: String| Fault::error(format!("the bundle is refused: {why}"));
    let opened = Bundle::open(bundle).map_err(|e| refused(e.to_string()))?;
    match address {
        Some(address) if address != opened.sha256() => Err(refused(format!(
            "its address is sha256:{}, and not the one in the protocol",
            opened.sha256()
        ))),
        _ => Ok(opened.model().to_owned()),
    }
}

fn text_of(bytes: &[u8]) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|e| {
        let before = &bytes[..e.valid_up_to()];
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        Fault::error(format!("line {line} is not UTF-8"))
            .hint("save the file as UTF-8 in your editor")
    })
}

#[cfg(test)]
mod tests;
