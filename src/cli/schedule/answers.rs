//! `study schedule --answers`: what a track presents if it is answered as a file says.

use crate::cli::{Console, Failure, Kind};
use serde_json::{Value as Json, json};
use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::Path;
use study_base::diagnostic::did_you_mean;
use study_base::text::{PartId, Untrusted};
use study_plan::procedure::{Answer, Ladder, Proposal, Summary, Track};
use study_plan::protocol::{Protocol, Seat};
use thiserror::Error;

/// Name and version of the document.
const FORMAT: &str = "study-tracks/1";

/// What is wrong with a file of answers.
#[derive(Debug, Error)]
enum AnswersError {
    #[error("{0}")]
    Csv(#[from] csv::Error),
    #[error("there is no column `{0}`")]
    Column(&'static str),
    #[error("there are no answers")]
    Empty,
    #[error("line {line}: {column} is `{}`, expected {expected}", Untrusted(.cell))]
    Cell {
        line: u64,
        column: &'static str,
        cell: String,
        expected: String,
    },
    #[error("line {line}: the track `{track}` has ended after {trials} trials")]
    Ended {
        line: u64,
        track: PartId,
        trials: usize,
    },
}

/// A row of the file.
struct Row {
    line: u64,
    track: usize,
    positive: bool,
    /// The level that was presented, if it is given.
    presented: Option<f64>,
    easy: bool,
}

/// One answered trial of a track.
struct Replayed {
    /// The rule's level; `None` for an easy trial.
    proposed: Option<f64>,
    answer: Answer,
    /// The track after the answer.
    after: Summary,
}

/// A track of the protocol that is replayed.
struct Running<'p> {
    id: &'p PartId,
    ladder: Ladder,
    track: Track,
    trials: Vec<Replayed>,
}

/// Replays the tracks of a protocol for one row.
pub(super) fn run(
    protocol: &Protocol,
    row: u32,
    file: &Path,
    as_json: bool,
    console: &mut Console,
) -> Result<(), Failure> {
    if protocol.tracks.is_empty() {
        return Err(Failure::input("--answers needs a protocol with [[tracks]]")
            .hint("`study new DIR --kind staircase` writes one"));
    }
    let text = std::fs::read(file).map_err(|e| Failure::file(file, &e))?;
    let shown = file.display().to_string();
    let found = replayed(protocol, row, &text)
        .map_err(|why| Failure::input(format!("{shown}: {why}")).hint(COLUMNS))?;
    if as_json {
        return console.json(&document(protocol, row, &found));
    }
    console.out(text_of(protocol, row, &found))
}

const COLUMNS: &str = "the columns are [track,]answer[,presented][,easy], with answers 1 (correct, or \"yes\" in yes-no) and 0; \
     docs/schedule.md describes them";

fn replayed<'p>(
    protocol: &'p Protocol,
    row: u32,
    text: &[u8],
) -> Result<Vec<Running<'p>>, AnswersError> {
    let mut tracks = Vec::new();
    for rules in &protocol.tracks {
        // A protocol that was read has rules that fit their ladders.
        if let Ok(track) = protocol.start(rules, Seat::Row(row)) {
            tracks.push(Running {
                id: &rules.id,
                ladder: protocol.ladder(rules),
                track,
                trials: Vec::new(),
            });
        }
    }
    for row in rows(text, &tracks)? {
        let at = &mut tracks[row.track];
        at.answer(&row)?;
    }
    Ok(tracks)
}

/// Reads the rows; levels become those of the ladder.
fn rows(text: &[u8], tracks: &[Running<'_>]) -> Result<Vec<Row>, AnswersError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text);
    let header = reader.headers()?.clone();
    let column = |name: &str| {
        let mut names = header.iter().map(|h| h.trim_start_matches('\u{feff}'));
        names.position(|h| h == name)
    };
    let answer = column("answer").ok_or(AnswersError::Column("answer"))?;
    let (track, presented, easy) = (column("track"), column("presented"), column("easy"));
    if track.is_none() && tracks.len() > 1 {
        return Err(AnswersError::Column("track"));
    }
    let mut found = Vec::new();
    for record in reader.records() {
        let record = record?;
        let line = record.position().map_or(0, csv::Position::line);
        let fault = |column: &'static str, at: usize, expected: String| AnswersError::Cell {
            line,
            column,
            cell: record[at].to_owned(),
            expected,
        };
        let truth = |column: &'static str, at: usize| match &record[at] {
            "1" | "true" => Ok(true),
            "0" | "false" => Ok(false),
            _ => Err(fault(column, at, "1 or 0".to_owned())),
        };
        let of = match track {
            None => 0,
            Some(at) => {
                let known = || tracks.iter().map(|t| t.id.as_str());
                known().position(|id| id == &record[at]).ok_or_else(|| {
                    let near = did_you_mean(&record[at], known());
                    let all = || known().collect::<Vec<_>>().join(", ");
                    fault("track", at, near.map_or_else(all, str::to_owned))
                })?
            }
        };
        let given = presented.filter(|at| !record[*at].is_empty());
        let level = match given {
            None => None,
            Some(at) => {
                let number = record[at].parse().ok().filter(|x: &f64| x.is_finite());
                let on_ladder = number.and_then(|x| on_ladder(&tracks[of].ladder, x));
                let ladder = &tracks[of].ladder;
                let range = || {
                    format!(
                        "a level of the ladder, {} to {}",
                        ladder.first(),
                        ladder.last()
                    )
                };
                Some(on_ladder.ok_or_else(|| fault("presented", at, range()))?)
            }
        };
        found.push(Row {
            line,
            track: of,
            positive: truth("answer", answer)?,
            presented: level,
            easy: match easy.filter(|at| !record[*at].is_empty()) {
                Some(at) => truth("easy", at)?,
                None => false,
            },
        });
    }
    match found.is_empty() {
        true => Err(AnswersError::Empty),
        false => Ok(found),
    }
}

/// The level of the ladder that a number with fewer digits stands for.
fn on_ladder(ladder: &Ladder, given: f64) -> Option<f64> {
    let level = ladder.level(ladder.nearest(given));
    let close = 1e-9 * (ladder.last() - ladder.first()).max(level.abs());
    ((level - given).abs() <= close).then_some(level)
}

impl Running<'_> {
    fn answer(&mut self, row: &Row) -> Result<(), AnswersError> {
        let proposal = self.track.next();
        if proposal.is_none() && !row.easy {
            return Err(AnswersError::Ended {
                line: row.line,
                track: self.id.clone(),
                trials: self.trials.len(),
            });
        }
        let level = match (row.easy, proposal) {
            (false, Some(proposal)) => self.ladder.level(proposal.step),
            _ => self.ladder.last(),
        };
        let answer = Answer {
            presented: row.presented.unwrap_or(level),
            positive: row.positive,
            easy: row.easy,
        };
        self.track.answer(&answer);
        self.trials.push(Replayed {
            proposed: proposal.filter(|_| !row.easy).map(|p| p.level),
            answer,
            after: self.track.summary(),
        });
        Ok(())
    }
}

fn document(protocol: &Protocol, row: u32, tracks: &[Running<'_>]) -> Json {
    let next = |of: &Running<'_>, p: Proposal| json!({"proposed": p.level, "presented": of.ladder.level(p.step)});
    let trial = |(number, t): (usize, &Replayed)| {
        json!({
            "trial": number,
            "proposed": t.proposed,
            "presented": t.answer.presented,
            "answer": t.answer.positive,
            "easy": t.answer.easy,
            "estimate": t.after.estimate,
            "spread": t.after.spread,
        })
    };
    let track = |of: &Running<'_>| {
        json!({
            "track": of.id,
            "rule": protocol.track(of.id).map(|t| &t.rule),
            "trials": (1..).zip(&of.trials).map(trial).collect::<Vec<_>>(),
            "next": of.track.next().map(|p| next(of, p)),
            "summary": of.track.summary(),
        })
    };
    json!({
        "format": FORMAT,
        "tool_version": env!("CARGO_PKG_VERSION"),
        "study": protocol.study.id,
        "row": row,
        "tracks": tracks.iter().map(track).collect::<Vec<_>>(),
    })
}

fn text_of(protocol: &Protocol, row: u32, tracks: &[Running<'_>]) -> String {
    let number = |x: f64| format!("{:.4}", x);
    let or_dash = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), number);
    let mut out = format!("{}\nrow {row}\n", Untrusted(&protocol.study.title));
    for of in tracks {
        let _ = writeln!(out, "\ntrack {}", of.id);
        let _ = writeln!(
            out,
            "{:>5} {:>10} {:>10} {:>7} {:>10} {:>10}",
            "trial", "proposed", "presented", "answer", "estimate", "spread"
        );
        for (trial, t) in (1..).zip(&of.trials) {
            let answer = format!(
                "{}{}",
                u8::from(t.answer.positive),
                if t.answer.easy { " easy" } else { "" }
            );
            let _ = writeln!(
                out,
                "{trial:>5} {:>10} {:>10} {answer:>7} {:>10} {:>10}",
                or_dash(t.proposed),
                number(t.answer.presented),
                or_dash(t.after.estimate),
                or_dash(t.after.spread)
            );
        }
        let summary = of.track.summary();
        let _ = match of.track.next() {
            Some(next) => writeln!(
                out,
                "next: {}, presented as {}",
                number(next.level),
                number(of.ladder.level(next.step))
            ),
            None if summary.finished => writeln!(out, "ended"),
            None => writeln!(out, "ended at its largest number of trials"),
        };
    }
    out
}

/// The only row of a replay.
pub(super) fn only_row(rows: Option<&RangeInclusive<u32>>) -> Result<RangeInclusive<u32>, Failure> {
    match rows {
        None => Ok(1..=1),
        Some(rows) if rows.start() == rows.end() => Ok(rows.clone()),
        Some(_) => Err(Failure::new(
            Kind::Usage,
            "--answers is of one row, such as --rows 7",
        )),
    }
}
