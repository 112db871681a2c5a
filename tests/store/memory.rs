//! A file system in memory that tells what is on the medium from what is not, and
//! fails, cuts or dies at any call.
//!
//! The rules are the strict ones that POSIX allows: the bytes of a file are on the
//! medium after a sync of the file, its name after a sync of the folder, and after
//! a failed sync the bytes in doubt are lost although a later sync says "ok". What is
//! not on the medium when the power goes may be there or not, each name and each file
//! by itself ([`Crash::Strict`]); a journaling file system keeps the order of names and
//! writes them with every sync ([`Crash::Ext4`]).
#![allow(
    dead_code,
    unused_imports,
    missing_docs,
    unreachable_pub,
    clippy::unwrap_used
)]

#[path = "memory/power.rs"]
mod power;

pub use power::{CRASHES, Crash};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use study_session::store::disk::{Appender, Disk, Item, ItemKind, Lock};

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
    /// This call and every later one fails; on a full disk those that need space.
    From(io::ErrorKind),
    /// Everything on the disk is removed.
    Removed,
    /// This call and every later one takes a while.
    Slow,
}

/// What a call does, for faults that concern only some.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Call {
    Write,
    Create,
    Sync,
    Other,
}

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

/// A name that was set or removed and is not on the medium under the strict rules.
#[derive(Debug, Clone)]
struct Renaming {
    /// Its number, from 1.
    at: usize,
    folder: usize,
    /// Each name with its file, or that it is gone: two for a renaming.
    names: Vec<(String, Option<usize>)>,
}

#[derive(Debug)]
struct State {
    nodes: Vec<Node>,
    calls: usize,
    plan: Option<(usize, Fault)>,
    dead: bool,
    fail_next_write: Option<io::ErrorKind>,
    /// Names that are not on the medium, in order.
    renamings: Vec<Renaming>,
    /// Number of names that were set or removed so far.
    clock: usize,
    /// The same at the last sync of anything.
    last_sync: usize,
    /// A planted bug: a sync of these does nothing.
    no_sync: Option<fn(&Path) -> bool>,
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
    path: PathBuf,
}

impl Renaming {
    fn apply(&self, names: &mut BTreeMap<String, usize>) {
        for (name, node) in &self.names {
            match node {
                Some(node) => names.insert(name.clone(), *node),
                None => names.remove(name),
            };
        }
    }
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
                renamings: Vec::new(),
                clock: 0,
                last_sync: 0,
                no_sync: None,
            })),
            locks: Arc::default(),
        }
    }

    /// The fault at the call with this number, from 0.
    pub fn plan(&self, call: usize, fault: Fault) {
        self.state.lock().unwrap().plan = Some((call, fault));
    }

    /// Plants a bug, also for the processes that come after: syncs of these files and
    /// folders say "ok" and do nothing.
    pub fn plant_no_sync(&self, of: fn(&Path) -> bool) {
        self.state.lock().unwrap().no_sync = Some(of);
    }

    pub fn calls(&self) -> usize {
        self.state.lock().unwrap().calls
    }

    pub fn is_dead(&self) -> bool {
        self.state.lock().unwrap().dead
    }

    /// The disk that the next process finds.
    pub fn after(&self, crash: Crash) -> Self {
        let disk = Self::of(Vec::new());
        {
            let state = self.state.lock().unwrap();
            let mut next = disk.state.lock().unwrap();
            next.nodes = state.reachable();
            next.renamings.clone_from(&state.renamings);
            (next.clock, next.last_sync) = (state.clock, state.last_sync);
            next.no_sync = state.no_sync;
            if crash != Crash::Process {
                next.lose_power(crash);
            }
        }
        disk
    }

    /// Counts the call and does what the plan says.
    fn call(&self, kind: Call) -> io::Result<Option<Fault>> {
        let is_write = kind == Call::Write;
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
            Some((planned, Fault::From(error))) if planned <= number => {
                let needs_space = matches!(kind, Call::Write | Call::Create);
                match error {
                    io::ErrorKind::StorageFull if !needs_space => Ok(None),
                    _ => Err(error.into()),
                }
            }
            Some((planned, Fault::Slow)) if planned <= number => {
                std::thread::sleep(Duration::from_micros(20));
                Ok(None)
            }
            Some((planned, fault)) if planned == number => match fault {
                Fault::Removed => {
                    let root = Node::Folder {
                        names: BTreeMap::new(),
                        synced: BTreeMap::new(),
                    };
                    state.nodes[0] = root;
                    state.renamings.clear();
                    Ok(None)
                }
                Fault::From(_) | Fault::Slow => Ok(None),
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

    /// Sets or removes names of one folder, as one change.
    fn set(state: &mut State, folder: usize, names: Vec<(String, Option<usize>)>) {
        state.clock += 1;
        let renaming = Renaming {
            at: state.clock,
            folder,
            names,
        };
        if let Node::Folder { names, .. } = &mut state.nodes[folder] {
            renaming.apply(names);
        }
        state.renamings.push(renaming);
    }

    /// The folder of a path, the last part of the path, and what it leads to.
    fn place(state: &State, path: &Path) -> io::Result<(usize, String, Option<usize>)> {
        let folder = Self::find(state, path.parent().unwrap_or(Path::new("")))?;
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let Node::Folder { names, .. } = &state.nodes[folder] else {
            return Err(io::ErrorKind::NotADirectory.into());
        };
        let node = names.get(&name).copied();
        Ok((folder, name, node))
    }

    fn add(&self, path: &Path, node: Node) -> io::Result<usize> {
        let mut state = self.state.lock().unwrap();
        let (folder, name, known) = Self::place(&state, path)?;
        if known.is_some() {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let next = state.nodes.len();
        state.nodes.push(node);
        Self::set(&mut state, folder, vec![(name, Some(next))]);
        Ok(next)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        let mut state = self.state.lock().unwrap();
        let (folder, name, known) = Self::place(&state, path)?;
        known.ok_or(io::ErrorKind::NotFound)?;
        Self::set(&mut state, folder, vec![(name, None)]);
        Ok(())
    }

    /// Every file with its bytes, by path.
    pub fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let state = self.state.lock().unwrap();
        let mut files = BTreeMap::new();
        let mut open = vec![(PathBuf::new(), 0)];
        while let Some((path, node)) = open.pop() {
            match &state.nodes[node] {
                Node::File { bytes, .. } => {
                    files.insert(path, bytes.clone());
                }
                Node::Folder { names, .. } => {
                    open.extend(names.iter().map(|(name, node)| (path.join(name), *node)));
                }
            }
        }
        files
    }

    /// The files of a folder, with their bytes, as a loss of power would leave them now if nothing
    /// that is not synced survived it; only those with certain names.
    pub fn on_medium(&self, folder: &Path, which: fn(&str) -> bool) -> Vec<Vec<u8>> {
        let state = self.state.lock().unwrap();
        let mut at = 0;
        for part in folder.components() {
            let Component::Normal(name) = part else {
                continue;
            };
            let Node::Folder { synced, .. } = &state.nodes[at] else {
                return Vec::new();
            };
            match synced.get(name.to_str().unwrap()) {
                Some(inner) => at = *inner,
                None => return Vec::new(),
            }
        }
        let Node::Folder { synced, .. } = &state.nodes[at] else {
            return Vec::new();
        };
        let bytes = |node: &usize| match &state.nodes[*node] {
            Node::File { synced, .. } => Some(synced.clone()),
            Node::Folder { .. } => None,
        };
        let named = synced.iter().filter(|(name, _)| which(name));
        named.filter_map(|(_, node)| bytes(node)).collect()
    }
}

impl Appender for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let fault = self.disk.call(Call::Write)?;
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
        let called = self.disk.call(Call::Sync);
        let mut state = self.disk.state.lock().unwrap();
        let lazy = state.no_sync.is_some_and(|of| of(&self.path));
        let found = MemoryDisk::find(&state, &self.path);
        if called.is_ok() && !lazy {
            // A file that was removed meanwhile is nowhere.
            if found.is_ok_and(|found| found == self.node) {
                state.last_sync = state.clock;
            } else {
                return Err(io::ErrorKind::NotFound.into());
            }
        }
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
        self.call(Call::Create)?;
        let node = Node::Folder {
            names: BTreeMap::new(),
            synced: BTreeMap::new(),
        };
        self.add(path, node).map(|_| ())
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.call(Call::Sync)?;
        let mut state = self.state.lock().unwrap();
        let at = Self::find(&state, path)?;
        if state.no_sync.is_some_and(|of| of(path)) {
            return Ok(());
        }
        if let Node::Folder { names, synced } = &mut state.nodes[at] {
            synced.clone_from(names);
        }
        state.renamings.retain(|r| r.folder != at);
        state.last_sync = state.clock;
        Ok(())
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        self.call(Call::Create)?;
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
            path: path.to_owned(),
        }))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        self.call(Call::Other)?;
        let node = Self::find(&self.state.lock().unwrap(), path)?;
        Ok(Box::new(File {
            disk: self.clone(),
            node,
            path: path.to_owned(),
        }))
    }

    fn truncate(&self, path: &Path, to: u64) -> io::Result<()> {
        self.call(Call::Other)?;
        let mut state = self.state.lock().unwrap();
        let node = Self::find(&state, path)?;
        if let Node::File { bytes, synced, .. } = &mut state.nodes[node] {
            bytes.truncate(usize::try_from(to).unwrap());
            synced.clone_from(bytes);
        }
        state.last_sync = state.clock;
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.call(Call::Other)?;
        let mut state = self.state.lock().unwrap();
        let (old, from, node) = Self::place(&state, from)?;
        let node = node.ok_or(io::ErrorKind::NotFound)?;
        let (new, to, _) = Self::place(&state, to)?;
        if old == new {
            Self::set(&mut state, old, vec![(from, None), (to, Some(node))]);
        } else {
            Self::set(&mut state, new, vec![(to, Some(node))]);
            Self::set(&mut state, old, vec![(from, None)]);
        }
        Ok(())
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.call(Call::Other)?;
        self.remove(path)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        if !self.list(path)?.is_empty() {
            return Err(io::ErrorKind::DirectoryNotEmpty.into());
        }
        self.call(Call::Other)?;
        self.remove(path)
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.call(Call::Other)?;
        let state = self.state.lock().unwrap();
        match &state.nodes[Self::find(&state, path)?] {
            Node::File { bytes, .. } => Ok(bytes.clone()),
            Node::Folder { .. } => Err(io::ErrorKind::IsADirectory.into()),
        }
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
        self.call(Call::Other)?;
        let state = self.state.lock().unwrap();
        match &state.nodes[Self::find(&state, path)?] {
            Node::File { .. } => Err(io::ErrorKind::NotADirectory.into()),
            Node::Folder { names, .. } => Ok(names
                .iter()
                .map(|(name, node)| Item {
                    name: name.clone(),
                    kind: match state.nodes[*node] {
                        Node::Folder { .. } => ItemKind::Folder,
                        Node::File { .. } => ItemKind::File,
                    },
                })
                .collect()),
        }
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        self.call(Call::Other)?;
        let new = self.locks.lock().unwrap().insert(path.to_owned());
        Ok(new.then(|| -> Lock { Box::new(Guard(Arc::clone(&self.locks), path.to_owned())) }))
    }

    fn free_bytes(&self, _path: &Path) -> io::Result<Option<u64>> {
        self.call(Call::Other)?;
        Ok(Some(1 << 30))
    }
}
