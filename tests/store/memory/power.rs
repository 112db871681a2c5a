//! What is found on the disk after a kill or a loss of power.

use super::{Node, State};
use std::collections::BTreeSet;
use study_base::rng::Stream;

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
    /// By chance any of the unsynced names, and of each file any part of the unsynced
    /// bytes, or zeros.
    Strict(u64),
    /// By chance as on ext4: names in their order, all of them with every sync.
    Ext4(u64),
}

pub const CRASHES: [Crash; 6] = [
    Crash::Process,
    Crash::OnlySynced,
    Crash::NamesOnly,
    Crash::Half,
    Crash::Zeros,
    Crash::BytesOnly,
];

impl State {
    /// The nodes, but nothing of the files that have no name any more.
    pub(super) fn reachable(&self) -> Vec<Node> {
        let mut named = BTreeSet::from([0]);
        for node in &self.nodes {
            if let Node::Folder { names, synced } = node {
                named.extend(names.values().chain(synced.values()));
            }
        }
        named.extend(
            self.renamings
                .iter()
                .flat_map(|r| r.names.iter().filter_map(|n| n.1)),
        );
        let gone = Node::File {
            bytes: Vec::new(),
            synced: Vec::new(),
            poisoned: false,
        };
        let nodes = self.nodes.iter().enumerate();
        nodes
            .map(|(at, node)| match named.contains(&at) {
                true => node.clone(),
                false => gone.clone(),
            })
            .collect()
    }

    /// Leaves what is on the medium, and of the rest what the crash says.
    pub(super) fn lose_power(&mut self, crash: Crash) {
        let mut chance = match crash {
            Crash::Strict(seed) | Crash::Ext4(seed) => Stream::new(seed, &["crash"]),
            _ => Stream::new(0, &["crash"]),
        };
        for node in &mut self.nodes {
            match node {
                Node::File {
                    bytes,
                    synced,
                    poisoned,
                } => {
                    *bytes = found_bytes(bytes, synced, crash, &mut chance);
                    synced.clone_from(bytes);
                    *poisoned = false;
                }
                Node::Folder { names, synced } => match crash {
                    Crash::NamesOnly | Crash::Half | Crash::Zeros => synced.clone_from(names),
                    _ => names.clone_from(synced),
                },
            }
        }
        let mut renamings = std::mem::take(&mut self.renamings);
        match crash {
            Crash::Strict(_) => renamings.retain(|_| chance.below(2) == 0),
            Crash::Ext4(_) => {
                let done = renamings.partition_point(|r| r.at <= self.last_sync);
                let more = chance.below((renamings.len() - done) as u64 + 1) as usize;
                renamings.truncate(done + more);
            }
            _ => renamings.clear(),
        }
        for renaming in renamings {
            if let Node::Folder { names, synced } = &mut self.nodes[renaming.folder] {
                renaming.apply(names);
                synced.clone_from(names);
            }
        }
    }
}

/// What is found of a file.
fn found_bytes(bytes: &[u8], synced: &[u8], crash: Crash, chance: &mut Stream) -> Vec<u8> {
    let Some(new) = bytes.strip_prefix(synced) else {
        return synced.to_vec();
    };
    let (kept, zeros) = match crash {
        Crash::Process | Crash::BytesOnly => (new.len(), 0),
        Crash::Half => (new.len() / 2, 0),
        Crash::Zeros => (0, new.len()),
        Crash::OnlySynced | Crash::NamesOnly => (0, 0),
        Crash::Strict(_) | Crash::Ext4(_) => {
            let mut to = |n: usize| chance.below(n as u64 + 1) as usize;
            // Often none or all.
            let kept = [0, new.len(), to(new.len())][to(2)];
            (kept, [0, to(new.len() - kept)][to(1)])
        }
    };
    [synced, &new[..kept], &vec![0; zeros]].concat()
}
