//! Simulations that can be interrupted: a file has one line for each, and what is there is not simulated again.

use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fs::{OpenOptions, read, read_to_string};
use std::io::Write as _;
use std::sync::Mutex;

/// Which of all simulations a process does: `2/4` is every fourth one, from the second.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shard {
    own: u64,
    all: u64,
}

impl Shard {
    /// From `I/N`; without it, all of them.
    pub(crate) fn of(text: Option<&str>) -> Self {
        let read = |text: &str| {
            let (own, all) = text.split_once('/')?;
            let (own, all): (u64, u64) = (own.parse().ok()?, all.parse().ok()?);
            (1..=all).contains(&own).then_some(Self { own, all })
        };
        read(text.unwrap_or("1/1")).expect("--shard takes I/N, such as 2/4")
    }

    /// Whether a number is among them.
    pub(crate) fn has(self, number: u64) -> bool {
        number % self.all == self.own - 1
    }
}

/// Name, number and results of a line.
pub(crate) type Row = (String, u64, Vec<f64>);

/// Runs what is not in the file, and appends the results as they come. One process writes a file: each shard has its own, and
/// `cat` puts them together.
pub(crate) fn run(
    file: &str,
    jobs: Vec<(String, u64)>,
    one: impl Fn(&str, u64) -> Vec<f64> + Sync,
) {
    without_torn_line(file);
    let known: BTreeSet<(String, u64)> = rows(file).into_iter().map(|r| (r.0, r.1)).collect();
    let left: Vec<(String, u64)> = jobs.into_iter().filter(|j| !known.contains(j)).collect();
    let out = OpenOptions::new().create(true).append(true).open(file);
    let out = Mutex::new(out.expect("the file can be written"));
    left.par_iter().for_each(|(name, i)| {
        let numbers: Vec<String> = one(name, *i).iter().map(|x| format!("{x:.6}")).collect();
        let line = format!("{name},{i},{}\n", numbers.join(","));
        let mut out = out.lock().expect("no thread panicked");
        out.write_all(line.as_bytes())
            .expect("the file can be written");
    });
}

/// Takes away what an interruption left of a line.
fn without_torn_line(file: &str) {
    let bytes = read(file).unwrap_or_default();
    let whole = bytes
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |at| at + 1);
    if whole < bytes.len() {
        let out = OpenOptions::new().write(true).open(file);
        let out = out.expect("the file can be written");
        out.set_len(whole as u64).expect("the file can be written");
    }
}

/// The lines of a file.
pub(crate) fn rows(file: &str) -> Vec<Row> {
    let text = read_to_string(file).unwrap_or_default();
    let row = |line: &str| {
        let mut fields = line.split(',');
        let (name, i) = (fields.next()?.to_owned(), fields.next()?.parse().ok()?);
        let numbers = fields
            .map(|f| f.parse().ok())
            .collect::<Option<Vec<f64>>>()?;
        Some((name, i, numbers))
    };
    text.lines().filter_map(row).collect()
}
