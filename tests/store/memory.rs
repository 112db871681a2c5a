//! A file system in memory that tells what is on the medium from what is not, and
//! fails, cuts or dies at any call.
//!
//! The rules are the strict ones that POSIX allows: the bytes of a file are on the
//! medium after a sync of the file, its name after a sync of the folder, and after
//! a failed sync the bytes in doubt are lost although a later sync says "ok".
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};
use study_core::store::disk::{Appender, Disk, Item, Lock};

/// What happens at the chosen call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The process dies before it.
    Kill,
    /// The process dies half way through a write.
    KillInWrite,
    /// The call fails once.
    Error(io::ErrorKind),
    /// A write takes half of the bytes, then the next one fails.
    Short(io::ErrorKind),
}

/// What is found after the machine starts again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crash {
    /// The process died, the machine went on.
    Process,
    /// The power went: only what was synced is there.
    OnlySynced,
    /// All names are there, of unsynced bytes none.
    NamesOnly,
    /// All names, and half of the unsynced bytes.
    Half,
    /// All names, and zeros in place of the unsynced bytes.
    Zeros,
    /// All bytes, of unsynced names none.
    BytesOnly,
}

pub const CRASHES: [Crash; 6] = [
    Crash::Process,
    Crash::OnlySynced,
    Crash::NamesOnly,
    Crash::Half,
    Crash::Zeros,
    Crash::BytesOnly,
];

#[derive(Debug, Clone)]
enum Node {
    File {
        bytes: Vec<u8>,
        synced: Vec<u8>,
        /// A sync failed: what is in doubt never reaches the medium.
        poisoned: bool,
    },
    Folder {
        names: BTreeMap<String, usize>,
        synced: BTreeMap<String, usize>,
    },
}

#[derive(Debug)]
struct State {
    nodes: Vec<Node>,
    calls: usize,
    plan: Option<(usize, Fault)>,
    dead: bool,
    fail_next_write: Option<io::ErrorKind>,
    /// Planted bugs: a sync that does nothing.
    no_file_sync: bool,
    no_folder_sync: bool,
}

/// The disk; clones are the same disk.
#[derive(Debug, Clone)]
pub struct MemoryDisk {
    state: Arc<Mutex<State>>,
    locks: Arc<Mutex<BTreeSet<PathBuf>>>,
}

struct Guard(Arc<Mutex<BTreeSet<PathBuf>>>, PathBuf);

impl Drop for Guard {
    fn drop(&mut self) {
        self.0.lock().unwrap().remove(&self.1);
    }
}

struct File {
    disk: MemoryDisk,
    node: usize,
}

impl MemoryDisk {
    pub fn new() -> Self {
        Self::of(vec![Node::Folder {
            names: BTreeMap::new(),
            synced: BTreeMap::new(),
        }])
    }

    fn of(nodes: Vec<Node>) -> Self {
        Self {
            state: Arc::new(Mutex::new(State {
                nodes,
                calls: 0,
                plan: None,
                dead: false,
                fail_next_write: None,
                no_file_sync: false,
                no_folder_sync: false,
            })),
            locks: Arc::default(),
        }
    }

    /// The fault at the call with this number, from 0.
    pub fn plan(&self, call: usize, fault: Fault) {
        self.state.lock().unwrap().plan = Some((call, fault));
    }

    pub fn plant_no_file_sync(&self) {
        self.state.lock().unwrap().no_file_sync = true;
    }

    pub fn plant_no_folder_sync(&self) {
        self.state.lock().unwrap().no_folder_sync = true;
    }

    pub fn calls(&self) -> usize {
        self.state.lock().unwrap().calls
    }

    pub fn is_dead(&self) -> bool {
        self.state.lock().unwrap().dead
    }

    /// The disk that the next process finds.
    pub fn after(&self, crash: Crash) -> Self {
        let state = self.state.lock().unwrap();
        let nodes = state
            .nodes
            .iter()
            .map(|node| match node {
                Node::File { bytes, synced, .. } => {
                    let new = bytes.strip_prefix(&synced[..]);
                    let kept = match (crash, new) {
                        (Crash::Process | Crash::BytesOnly, _) => bytes.clone(),
                        (Crash::Half, Some(new)) => [&synced[..], &new[..new.len() / 2]].concat(),
                        (Crash::Zeros, Some(new)) => [synced.clone(), vec![0; new.len()]].concat(),
                        _ => synced.clone(),
                    };
                    Node::File {
                        synced: kept.clone(),
                        bytes: kept,
                        poisoned: false,
                    }
                }
                Node::Folder { names, synced } => {
                    let kept = match crash {
                        Crash::OnlySynced | Crash::BytesOnly => synced.clone(),
                        _ => names.clone(),
                    };
                    Node::Folder {
                        synced: kept.clone(),
                        names: kept,
                    }
                }
            })
            .collect();
        Self::of(nodes)
    }

    /// Counts the call and does what the plan says.
    fn call(&self, is_write: bool) -> io::Result<Option<Fault>> {
        let mut state = self.state.lock().unwrap();
        if state.dead {
            return Err(io::Error::other("the process is dead"));
        }
        let number = state.calls;
        state.calls += 1;
        if is_write && let Some(kind) = state.fail_next_write.take() {
            return Err(kind.into());
        }
        match state.plan {
            Some((planned, fault)) if planned == number => match fault {
                Fault::Kill => {
                    state.dead = true;
                    Err(io::Error::other("killed"))
                }
                Fault::KillInWrite | Fault::Short(_) if is_write => Ok(Some(fault)),
                Fault::KillInWrite => {
                    state.dead = true;
                    Err(io::Error::other("killed"))
                }
                Fault::Error(kind) | Fault::Short(kind) => Err(kind.into()),
            },
            _ => Ok(None),
        }
    }

    fn find(state: &State, path: &Path) -> io::Result<usize> {
        let mut at = 0;
        for part in path.components() {
            let Component::Normal(name) = part else {
                continue;
            };
            let Node::Folder { names, .. } = &state.nodes[at] else {
                return Err(io::ErrorKind::NotADirectory.into());
            };
            at = *names
                .get(name.to_str().unwrap())
                .ok_or(io::ErrorKind::NotFound)?;
        }
        Ok(at)
    }

    fn change<T>(
        &self,
        path: &Path,
        f: impl FnOnce(&mut Vec<Node>, usize, String) -> io::Result<T>,
    ) -> io::Result<T> {
        let mut state = self.state.lock().unwrap();
        let folder = Self::find(&state, path.parent().unwrap_or(Path::new("")))?;
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        f(&mut state.nodes, folder, name)
    }

    fn add(&self, path: &Path, node: Node) -> io::Result<usize> {
        self.change(path, |nodes, folder, name| {
            let next = nodes.len();
            let Node::Folder { names, .. } = &mut nodes[folder] else {
                return Err(io::ErrorKind::NotADirectory.into());
            };
            if names.contains_key(&name) {
                return Err(io::ErrorKind::AlreadyExists.into());
            }
            names.insert(name, next);
            nodes.push(node);
            Ok(next)
        })
    }

    fn take(&self, path: &Path) -> io::Result<usize> {
        self.change(path, |nodes, folder, name| {
            let Node::Folder { names, .. } = &mut nodes[folder] else {
                return Err(io::ErrorKind::NotADirectory.into());
            };
            names.remove(&name).ok_or(io::ErrorKind::NotFound.into())
        })
    }
}

impl Appender for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let fault = self.disk.call(true)?;
        let mut state = self.disk.state.lock().unwrap();
        let taken = if fault.is_some() {
            bytes.len() / 2
        } else {
            bytes.len()
        };
        if let Node::File { bytes: all, .. } = &mut state.nodes[self.node] {
            all.extend_from_slice(&bytes[..taken]);
        }
        match fault {
            Some(Fault::KillInWrite) => {
                state.dead = true;
                Err(io::Error::other("killed"))
            }
            Some(Fault::Short(kind)) => {
                state.fail_next_write = Some(kind);
                Ok(taken)
            }
            _ => Ok(taken),
        }
    }

    fn sync(&mut self) -> io::Result<()> {
        let called = self.disk.call(false);
        let mut state = self.disk.state.lock().unwrap();
        let lazy = state.no_file_sync;
        if let Node::File {
            bytes,
            synced,
            poisoned,
        } = &mut state.nodes[self.node]
        {
            if called.is_err() {
                *poisoned = true;
            } else if !*poisoned && !lazy {
                synced.clone_from(bytes);
            }
        }
        called.map(|_| ())
    }
}

impl Disk for MemoryDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.call(false)?;
        let node = Node::Folder {
            names: BTreeMap::new(),
            synced: BTreeMap::new(),
        };
        self.add(path, node).map(|_| ())
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.call(false)?;
        let mut state = self.state.lock().unwrap();
        let at = Self::find(&state, path)?;
        let lazy = state.no_folder_sync;
        if let Node::Folder { names, synced } = &mut state.nodes[at]
            && !lazy
        {
            synced.clone_from(names);
        }
        Ok(())
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        self.call(false)?;
        let node = self.add(
            path,
            Node::File {
                bytes: Vec::new(),
                synced: Vec::new(),
                poisoned: false,
            },
        )?;
        Ok(Box::new(File {
            disk: self.clone(),
            node,
        }))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        self.call(false)?;
        let node = Self::find(&self.state.lock().unwrap(), path)?;
        Ok(Box::new(File {
            disk: self.clone(),
            node,
        }))
    }

    fn truncate(&self, path: &Path, to: u64) -> io::Result<()> {
        self.call(false)?;
        let mut state = self.state.lock().unwrap();
        let node = Self::find(&state, path)?;
        if let Node::File { bytes, synced, .. } = &mut state.nodes[node] {
            bytes.truncate(usize::try_from(to).unwrap());
            synced.clone_from(bytes);
        }
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.call(false)?;
        let node = self.take(from)?;
        self.change(to, |nodes, folder, name| {
            if let Node::Folder { names, .. } = &mut nodes[folder] {
                names.insert(name, node);
            }
            Ok(())
        })
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.call(false)?;
        self.take(path).map(|_| ())
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        if !self.list(path)?.is_empty() {
            return Err(io::ErrorKind::DirectoryNotEmpty.into());
        }
        self.call(false)?;
        self.take(path).map(|_| ())
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.call(false)?;
        let state = self.state.lock().unwrap();
        match &state.nodes[Self::find(&state, path)?] {
            Node::File { bytes, .. } => Ok(bytes.clone()),
            Node::Folder { .. } => Err(io::ErrorKind::IsADirectory.into()),
        }
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
        self.call(false)?;
        let state = self.state.lock().unwrap();
        match &state.nodes[Self::find(&state, path)?] {
            Node::File { .. } => Err(io::ErrorKind::NotADirectory.into()),
            Node::Folder { names, .. } => Ok(names
                .iter()
                .map(|(name, node)| Item {
                    name: name.clone(),
                    is_folder: matches!(state.nodes[*node], Node::Folder { .. }),
                })
                .collect()),
        }
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        self.call(false)?;
        let new = self.locks.lock().unwrap().insert(path.to_owned());
        Ok(new.then(|| -> Lock { Box::new(Guard(Arc::clone(&self.locks), path.to_owned())) }))
    }

    fn free_bytes(&self, _path: &Path) -> io::Result<Option<u64>> {
        self.call(false)?;
        Ok(Some(1 << 30))
    }
}
