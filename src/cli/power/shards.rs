//! The parts of a simulation that several machines share.
//!
//! Part I of N does the units (design and chunk) whose number modulo N is I. Its file has
//! the program's version and a digest of everything that the numbers depend on.

use super::super::{Console, Failure};
use super::{Args, on_threads, replace, shown};
use clap::Parser;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::power::{Chunk, Plan, Progress, Unit};
use study_base::sort::SmallSort as _;
use study_base::text::counted;

/// The format of a part.
const FORMAT: &str = "study-power-shard/1";

/// The file of a part.
#[derive(Debug, Serialize, Deserialize)]
struct Shard {
    format: String,
    version: String,
    digest: String,
    shards: u64,
    shard: u64,
    /// The command line without what differs between parts.
    arguments: Vec<String>,
    units: Vec<Done>,
}

/// A unit that is done.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Done {
    cell: String,
    chunk: u64,
    result: Chunk,
}

/// Arguments of a command that was run before.
#[derive(Debug, Parser)]
struct Again {
    #[command(flatten)]
    args: Args,
}

fn file_name(shard: u64, of: u64) -> String {
    format!("shard-{shard:04}-of-{of:04}.json")
}

fn digest(plan: &Plan) -> String {
    plan.digest(env!("CARGO_PKG_VERSION"))
}

/// Does a part, unless it is there already.
pub(super) fn run(
    plan: &Plan,
    units: &[Unit],
    (shard, of): (u64, u64),
    out: &Path,
    threads: Option<u16>,
    console: &mut Console,
) -> Result<(), Failure> {
    if shard >= of {
        return Err(Failure::usage(format!(
            "--shard {shard}: parts are numbered from 0 to {}",
            of - 1
        )));
    }
    if of > units.len() as u64 {
        let units = counted(units.len(), "unit", "units");
        return Err(Failure::usage(format!(
            "--shards {of}: the work has only {units}"
        )));
    }
    fs::create_dir_all(out).map_err(|e| Failure::file(out, &e))?;
    let path = out.join(file_name(shard, of));
    if path.exists() {
        let there = open(&path)?;
        same(&there, plan, &path)?;
        console.say(format!("{}: already done", shown(&path)));
        return Ok(());
    }
    let own: Vec<Unit> = (units.iter().enumerate())
        .filter(|(i, _)| *i as u64 % of == shard)
        .map(|(_, unit)| *unit)
        .collect();
    let work = |progress: Progress<'_>| plan.simulate(&own, progress);
    let results = on_threads(plan, own.len(), threads, work)?;
    let done = Shard {
        format: FORMAT.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        digest: digest(plan),
        shards: of,
        shard,
        arguments: common_arguments(),
        units: (own.iter().zip(results))
            .map(|((cell, chunk), result)| Done {
                cell: cell.canonical(),
                chunk: *chunk,
                result,
            })
            .collect(),
    };
    let text = serde_json::to_string(&done)
        .map_err(|e| Failure::new(super::super::Kind::Bug, format!("the part: {e}")))?;
    replace(&path, (text + "\n").as_bytes())?;
    console.say(format!(
        "{}: {}",
        shown(&path),
        counted(own.len(), "unit", "units")
    ));
    Ok(())
}

/// The arguments of this process after `power`, without those that differ between parts.
pub(super) fn common_arguments() -> Vec<String> {
    const OWN: [&str; 7] = [
        "--shards",
        "--shard",
        "--out",
        "--threads",
        "--merge",
        "--slurm",
        "--tasks",
    ];
    let mut found = Vec::new();
    let mut given = std::env::args().skip_while(|a| a != "power").skip(1);
    while let Some(argument) = given.next() {
        let name = argument.split('=').next().unwrap_or_default();
        if !OWN.contains(&name) {
            found.push(argument);
        } else if !argument.contains('=') {
            given.next();
        }
    }
    found.retain(|a| a != "--json" && a != "--partial");
    found
}

fn open(path: &Path) -> Result<Shard, Failure> {
    let text = fs::read_to_string(path).map_err(|e| Failure::file(path, &e))?;
    let damaged = |why: &dyn std::fmt::Display| {
        Failure::input(format!("{}: no part of a simulation: {why}", shown(path)))
            .hint("delete the file and do this part again")
    };
    let shard: Shard = serde_json::from_str(&text).map_err(|e| damaged(&e))?;
    if shard.format != FORMAT {
        return Err(damaged(&format!("its format is not {FORMAT}")));
    }
    Ok(shard)
}

/// Refuses a part of another simulation.
fn same(shard: &Shard, plan: &Plan, path: &Path) -> Result<(), Failure> {
    let refused = |what: &str| {
        Err(Failure::input(format!("{}: {what}", shown(path)))
            .hint("use a new folder, or the same protocol, flags and version for all parts"))
    };
    if shard.version != env!("CARGO_PKG_VERSION") {
        return refused("it was made by another version of study");
    }
    if shard.digest != digest(plan) {
        return refused("it belongs to other settings");
    }
    Ok(())
}

/// The files of parts in a folder.
fn files(dir: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = fs::read_dir(dir).map_err(|e| Failure::file(dir, &e))?;
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Failure::file(dir, &e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("shard-") && name.ends_with(".json") {
            found.push(path);
        }
    }
    found.small_sort();
    if found.is_empty() {
        return Err(
            Failure::input(format!("{}: no parts of a simulation", shown(dir)))
                .hint("study power PROTOCOL --shards N --shard I --out DIR makes them"),
        );
    }
    Ok(found)
}

/// The arguments of the command that made the parts in a folder, for its merge.
pub(super) fn arguments(dir: &Path, given: &Args) -> Result<Args, Failure> {
    let files = files(dir)?;
    let shard = open(&files[0])?;
    let words = std::iter::once("power".to_owned()).chain(shard.arguments);
    let again = Again::try_parse_from(words).map_err(|_| {
        Failure::input(format!("{}: its command line is unknown", shown(&files[0])))
            .hint("name the protocol and repeat the flags")
    })?;
    let mut args = again.args;
    if args.protocol.is_none() {
        return Err(Failure::usage("name the protocol and repeat the flags"));
    }
    args.merge = Some(dir.to_owned());
    args.partial = given.partial;
    args.json = given.json;
    args.out.clone_from(&given.out);
    Ok(args)
}

/// The chunks of all units; `None` for those that are missing, which is refused unless
/// `partial`.
pub(super) fn read(
    plan: &Plan,
    units: &[Unit],
    dir: &Path,
    partial: bool,
) -> Result<Vec<Option<Chunk>>, Failure> {
    let place: BTreeMap<(String, u64), usize> = (units.iter().enumerate())
        .map(|(i, (cell, chunk))| ((cell.canonical(), *chunk), i))
        .collect();
    let mut chunks: Vec<Option<Chunk>> = vec![None; units.len()];
    let mut number = None;
    for path in files(dir)? {
        let shard = open(&path)?;
        same(&shard, plan, &path)?;
        let refused = |what: String| Err(Failure::input(format!("{}: {what}", shown(&path))));
        let of = *number.get_or_insert(shard.shards);
        if of != shard.shards {
            return refused(format!(
                "it is one of {} parts, others of {of}",
                shard.shards
            ));
        }
        for done in shard.units {
            let Some(&at) = place.get(&(done.cell.clone(), done.chunk)) else {
                return refused(format!(
                    "it has a unit that is not part of this work: {}",
                    done.cell
                ));
            };
            match &chunks[at] {
                Some(there) if *there != done.result => {
                    return refused(format!("`{}` occurs twice, with other results", done.cell));
                }
                _ => chunks[at] = Some(done.result),
            }
        }
    }
    let of = number.unwrap_or(1).max(1);
    let mut missing: Vec<u64> = (chunks.iter().enumerate())
        .filter(|(_, c)| c.is_none())
        .map(|(i, _)| i as u64 % of)
        .collect();
    missing.sort_unstable();
    missing.dedup();
    if missing.is_empty() || partial {
        return Ok(chunks);
    }
    Err(Failure::input(format!(
        "{}: parts are missing: --array={}",
        shown(dir),
        ranges(&missing)
    ))
    .hint("do these parts, or merge what is there with --partial"))
}

/// `3,17-19`.
fn ranges(numbers: &[u64]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let shown: Vec<String> = runs
        .map(|run| match run {
            [one] => one.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => String::new(),
        })
        .collect();
    shown.join(",")
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn missing_parts_can_be_pasted() {
        assert_eq!(ranges(&[3, 17, 18, 19, 21, 22]), "3,17-19,21-22");
    }
}
