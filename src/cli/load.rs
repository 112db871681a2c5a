//! Opens a protocol and everything it names, and joins them.
//!
//! The protocol is read first, then each model file and the orders file, once
//! each; every fault of every file is collected before anything is refused. What
//! only shows once they stand together is checked here: VAFs that differ, orders
//! that cannot be made.

use super::Failure;
use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use study_base::diagnostic::{Fault, Findings};
use study_base::text::ModelId;
use study_core::protocol::file::{self, Named, Parsed};
use study_core::protocol::fingerprint::{self, Fingerprints};
use study_core::protocol::{FileOrders, Order, Protocol, check};
use study_haptics::model::Realization;

mod join;

/// Largest model file and orders file that are read, bytes.
const MAX_MODEL_BYTES: usize = 16 * 1024 * 1024;
const MAX_ORDERS_BYTES: usize = 64 * 1024 * 1024;

/// What to do about a table that fails its certificate.
pub(super) const PERMIT: &str = "identify it with m, b >= 0, or permit it in [device]: uncertified = { play = true, force_n = ..., reason = \"...\" }";

/// The name of a protocol in its folder.
pub const FILE_NAME: &str = "protocol.toml";

/// A protocol and everything it names.
#[derive(Debug)]
pub struct Loaded {
    /// With the VAFs of the model files filled in.
    pub protocol: Protocol,
    /// Where the protocol and its models are.
    pub folder: PathBuf,
    /// The protocol file itself.
    pub path: PathBuf,
    /// The table of each realization that has a file.
    pub models: BTreeMap<ModelId, Realization>,
    /// The orders file, if the design has one.
    pub orders: Option<FileOrders>,
    /// What has to be copied to keep the study: relative path, with `/`, and
    /// bytes; `protocol.toml` first, then each other file once.
    pub files: Vec<(String, Vec<u8>)>,
    /// Of the whole study.
    pub fingerprints: Fingerprints,
    /// The warnings of all files.
    pub findings: Vec<Findings>,
}

impl Loaded {
    /// Trials of a session, practice included.
    pub fn trials(&self) -> usize {
        match self.orders.as_ref().and_then(|rows| rows.values().next()) {
            Some(row) => row.len() + self.protocol.design.practice.len(),
            None => check::trials(&self.protocol) as usize,
        }
    }
}

/// Opens the protocol at `path`, a `protocol.toml` or the folder that holds one.
///
/// # Errors
/// [`Failure`] with all faults of all files if any is an error.
pub fn load(path: &Path) -> Result<Loaded, Failure> {
    match examine(path) {
        (Some(loaded), _) => Ok(loaded),
        (None, findings) => Err(Failure::faults(findings)),
    }
}

/// Opens the frozen protocol of a study that has begun, to read what was gathered:
/// what would only be refused to be played is not refused.
///
/// # Errors
/// As [`load`].
pub fn load_frozen(path: &Path) -> Result<Loaded, Failure> {
    match open(path, false) {
        (Some(loaded), _) => Ok(loaded),
        (None, findings) => Err(Failure::faults(findings)),
    }
}

/// Opens the protocol at `path` and tells everything that was found, errors and
/// warnings. The protocol is there if there are no errors.
pub fn examine(path: &Path) -> (Option<Loaded>, Vec<Findings>) {
    open(path, true)
}

/// `to_play`: tables that fail their certificate are refused, unless permitted.
fn open(path: &Path, to_play: bool) -> (Option<Loaded>, Vec<Findings>) {
    let path = if path.is_dir() {
        path.join(FILE_NAME)
    } else {
        path.to_owned()
    };
    let shown = path.display().to_string();
    let bytes = match read_capped(&path, file::MAX_FILE_BYTES) {
        Ok(bytes) => bytes,
        Err(problem) => {
            let fault = Fault::error(problem)
                .hint("PROTOCOL is a protocol.toml or the folder that holds one");
            return (None, vec![alone(shown, fault)]);
        }
    };
    let text = match text_of(&bytes) {
        Ok(text) => text,
        Err(fault) => return (None, vec![alone(shown, fault)]),
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
    let mut others = Others::new(&folder);
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
    others.assign(&protocol);
    join::vaf(&mut protocol, &others, &spans, &mut findings);
    if to_play {
        join::certificates(&protocol, &others, &spans, &mut findings);
    }
    let orders = others.orders.take();
    // Without its file an order is not infeasible, only unknown.
    if orders.is_some() || !matches!(protocol.design.order, Order::File(_)) {
        join::orders(&protocol, orders.as_ref(), &spans, &mut findings);
    }
    let unread = others.unread(&protocol);
    findings
        .faults
        .extend(check::warnings(&protocol, &spans, &unread));
    findings.sort();

    let mut files = vec![(FILE_NAME.to_owned(), bytes)];
    let fingerprints = fingerprint::of(&protocol, &others.bytes_by_model(), orders.as_ref());
    let models = others.realizations();
    files.extend(others.take_bytes());
    let all = others.findings(findings);
    if all.iter().any(Findings::has_errors) {
        return (None, all);
    }
    let loaded = Loaded {
        protocol,
        folder,
        path,
        models,
        orders,
        files,
        fingerprints,
        findings: all.clone(),
    };
    (Some(loaded), all)
}

/// The files beside the protocol, each read once.
#[derive(Debug)]
struct Others<'f> {
    folder: &'f Path,
    /// In the order of the protocol.
    opened: Vec<Opened>,
    orders: Option<FileOrders>,
    /// Realization → index in `opened`.
    models: BTreeMap<ModelId, usize>,
}

#[derive(Debug)]
struct Opened {
    file: String,
    bytes: Vec<u8>,
    realization: Option<Realization>,
    findings: Findings,
}

impl<'f> Others<'f> {
    fn new(folder: &'f Path) -> Self {
        Self {
            folder,
            opened: Vec::new(),
            orders: None,
            models: BTreeMap::new(),
        }
    }

    /// Reads a file that the protocol names, if that has not been done. The fault
    /// is about the protocol; those of the file itself are kept with it.
    fn open(&mut self, name: &Named) -> Result<(), Fault> {
        if self.opened.iter().any(|o| o.file == name.file) {
            return Ok(());
        }
        let (most, what) = if name.orders {
            (MAX_ORDERS_BYTES, "orders")
        } else {
            (MAX_MODEL_BYTES, "model")
        };
        let path = self.folder.join(&name.file);
        let bytes = read_capped(&path, most).map_err(|problem| {
            Fault::error(format!("the {what} file cannot be read: {problem}"))
                .hint("paths are relative to the protocol")
        })?;
        let shown = path.display().to_string();
        let mut realization = None;
        let findings = if name.orders {
            let (orders, findings) = file::parse_orders(&shown, bytes.as_slice());
            if !findings.has_errors() {
                self.orders = Some(orders);
            }
            findings
        } else {
            match text_of(&bytes) {
                Ok(text) => {
                    let (read, findings) = study_haptics::model::file::parse(&shown, text);
                    realization = read;
                    findings
                }
                Err(fault) => alone(shown, fault),
            }
        };
        self.opened.push(Opened {
            file: name.file.clone(),
            bytes,
            realization,
            findings,
        });
        Ok(())
    }

    /// Says which realization is in which file.
    fn assign(&mut self, protocol: &Protocol) {
        for model in &protocol.models {
            let index = self
                .opened
                .iter()
                .position(|o| Some(&o.file) == model.file.as_ref());
            if let Some(index) = index {
                self.models.insert(model.id.clone(), index);
            }
        }
    }

    /// Those whose file is missing or wrong.
    fn unread<'p>(&self, protocol: &'p Protocol) -> Vec<&'p ModelId> {
        let models = protocol.models.iter().filter(|m| m.file.is_some());
        let unread = models.filter(|m| self.realization(&m.id).is_none());
        unread.map(|m| &m.id).collect()
    }

    fn realization(&self, id: &ModelId) -> Option<&Realization> {
        self.opened[*self.models.get(id)?].realization.as_ref()
    }

    fn realizations(&self) -> BTreeMap<ModelId, Realization> {
        self.models
            .keys()
            .filter_map(|id| Some((id.clone(), self.realization(id)?.clone())))
            .collect()
    }

    fn bytes_by_model(&self) -> BTreeMap<ModelId, Vec<u8>> {
        self.models
            .iter()
            .map(|(id, index)| (id.clone(), self.opened[*index].bytes.clone()))
            .collect()
    }

    fn take_bytes(&mut self) -> Vec<(String, Vec<u8>)> {
        self.opened
            .iter_mut()
            .map(|o| (o.file.clone(), std::mem::take(&mut o.bytes)))
            .collect()
    }

    /// Those of all files, the protocol's first; files without any are left out.
    fn findings(self, protocol: Findings) -> Vec<Findings> {
        std::iter::once(protocol)
            .chain(self.opened.into_iter().map(|o| o.findings))
            .filter(|f| !f.faults.is_empty())
            .collect()
    }
}

fn alone(path: String, fault: Fault) -> Findings {
    let mut findings = Findings::new(path, "");
    findings.faults.push(fault);
    findings
}

fn text_of(bytes: &[u8]) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|e| {
        let before = &bytes[..e.valid_up_to()];
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        Fault::error(format!("line {line} is not UTF-8"))
            .hint("save the file as UTF-8 in your editor")
    })
}

/// The bytes of an ordinary file of at most `most` bytes; else what is wrong with
/// it. What it is, is asked before it is opened: a pipe would be waited for.
fn read_capped(path: &Path, most: usize) -> Result<Vec<u8>, String> {
    let size = |n: usize| format!("{} KiB", n / 1024);
    let metadata = fs::metadata(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        _ => e.to_string(),
    })?;
    if metadata.is_dir() {
        return Err("it is a folder".to_owned());
    }
    if !metadata.is_file() {
        return Err("it is no ordinary file".to_owned());
    }
    let mut bytes = Vec::new();
    fs::File::open(path)
        .and_then(|file| file.take(most as u64 + 1).read_to_end(&mut bytes))
        .map_err(|e| e.to_string())?;
    if bytes.len() > most {
        return Err(format!("it has more than {}", size(most)));
    }
    Ok(bytes)
}
