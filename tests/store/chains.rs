//! Chains of faults: a process is killed or its disk fails, the next one resumes, the
//! power goes, and so on; in the end everything acknowledged is there.
//!
//! `cargo test --release --test store -- --ignored --nocapture chains` looks at 100,000
//! states; CHAINS=N at those of N chains.

#![allow(clippy::unwrap_used)]

use crate::memory::{Crash, Fault, MemoryDisk};
use crate::process::{Told, finishes, noticed, open, process};
use std::io::ErrorKind;
use std::path::Path;
use study_base::rng::Stream;

const WHO: [&str; 2] = ["P01", "P02"];

/// What may happen to a process.
const FAULTS: [Option<Fault>; 6] = [
    Some(Fault::Kill),
    Some(Fault::KillInWrite),
    Some(Fault::Error(ErrorKind::Other)),
    Some(Fault::Short(ErrorKind::StorageFull)),
    Some(Fault::From(ErrorKind::Other)),
    None,
];

/// Plays one chain and returns the number of states in which the disk was found.
///
/// # Errors
/// What was wrong with one of them.
fn chain(seed: u64, disk: MemoryDisk) -> Result<usize, String> {
    let mut chance = Stream::new(seed, &["chain"]);
    let mut told = [Told::of(WHO[0]), Told::of(WHO[1])];
    let mut disk = disk;
    let steps = 2 + chance.below(4) as usize;
    let mut log = Vec::new();
    for _ in 0..steps {
        let who = chance.below(2) as usize;
        let call = chance.below(320) as usize;
        let fault = FAULTS[chance.below(FAULTS.len() as u64) as usize];
        if let Some(fault) = fault {
            disk.plan(call, fault);
        }
        let ended = process(&disk, &mut told[who]);
        let crash = match chance.below(3) {
            0 => Crash::Process,
            1 => Crash::Strict(chance.next_u64()),
            _ => Crash::Ext4(chance.next_u64()),
        };
        let ended = ended.map_err(|e| e.to_string());
        log.push(format!(
            "{}: {fault:?} at {call}: {ended:?}; {crash:?}",
            WHO[who]
        ));
        disk = disk.after(crash);
        noticed(&disk, &told).map_err(|e| format!("chain {seed}: {e}\n{}", log.join("\n")))?;
    }
    let fail = |e: String| format!("chain {seed}, in the end: {e}\n{}", log.join("\n"));
    for told in &mut told {
        finishes(&disk, told).map_err(fail)?;
    }
    for crash in [Crash::Strict(seed), Crash::OnlySynced] {
        let found = disk.after(crash);
        noticed(&found, &told).map_err(fail)?;
        let study = open(&found).map_err(|e| fail(e.to_string()))?;
        let problems = study.verify(None).map_err(|e| fail(e.to_string()))?;
        if let Some(problem) = problems.iter().find(|f| f.is_problem) {
            return Err(fail(format!("{problem:?}")));
        }
    }
    Ok(steps + 2)
}

fn chains(from: u64, count: u64) -> usize {
    let played = (from..from + count).map(|seed| chain(seed, MemoryDisk::new()).unwrap());
    played.sum()
}

#[test]
fn nothing_acknowledged_is_lost_in_chains_of_faults() {
    let states = chains(1, 150);
    assert!(states >= 500, "{states}");
}

#[test]
#[ignore = "100,000 states"]
fn nothing_acknowledged_is_lost_in_100_000_states() {
    let count = std::env::var("CHAINS").ok().and_then(|n| n.parse().ok());
    let states = chains(1_000_000, count.unwrap_or(20_000));
    println!("{states} states of chains");
    assert!(count.is_some() || states >= 100_000, "{states}");
}

type Which = fn(&Path) -> bool;

/// Files and folders, by the syncs that a planted bug leaves out.
const SYNCS: [(&str, Which); 13] = [
    ("journals", |p| name(p).starts_with("journal")),
    ("head", |p| name(p) == ".head.json.tmp"),
    ("session", |p| {
        p.ends_with("1") && !p.ends_with("protocol/1")
    }),
    ("participant", |p| name(p).starts_with('P')),
    ("sessions", |p| name(p) == "sessions"),
    ("study", |p| name(p) == "small"),
    ("results", |p| name(p) == "results"),
    ("the folder around it", |p| p == Path::new(".")),
    ("study.json", |p| name(p) == ".study.json.tmp"),
    ("protocol", |p| name(p) == ".protocol.toml.tmp"),
    ("frozen folder", |p| p.ends_with("protocol/1")),
    ("telemetry file", |p| {
        name(p).ends_with(".csv") && p.parent().unwrap().ends_with("telemetry")
    }),
    ("telemetry", |p| name(p) == "telemetry"),
];

fn name(path: &Path) -> &str {
    path.file_name().and_then(|n| n.to_str()).unwrap_or("")
}

#[test]
fn a_missing_sync_of_any_file_or_folder_is_noticed() {
    for (what, of) in SYNCS {
        let plays = |seed| {
            let disk = MemoryDisk::new();
            disk.plant_no_sync(of);
            chain(seed, disk)
        };
        let found = (1..400).find_map(|seed| plays(seed).err());
        assert!(found.is_some(), "no chain needs the sync of: {what}");
    }
}
