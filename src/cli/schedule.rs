//! `study schedule`: the orders of a protocol and their balance.

mod answers;
mod parts;
mod table;

use super::{Console, Failure, Kind, study_folder};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use study_analysis::load;
use study_base::text::PartId;
use study_plan::protocol::{Assign, Assigned, FileOrders, Groups, Protocol, Seat, Stimuli, Trial};
use study_plan::schedule::{Planner, ScheduleError};
use study_session::store::{StudyFolder, layout};

/// Most rows that are shown at once; more are probably a typing error.
const MAX_ROWS: u32 = 100_000;

/// Rows of the schedule that are written to the CSV at once.
const CHUNK: usize = 1000;

/// Arguments of `study schedule`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Rows to show, such as 7 or 1-40 [default: all planned participants]
    #[arg(long, value_name = "RANGE", value_parser = parse_rows)]
    rows: Option<RangeInclusive<u32>>,
    /// Print CSV: row,trial,block,position,model,repetition,practice; with parts also
    /// part,first,second,track,intervals,easy
    #[arg(long)]
    csv: bool,
    /// Replay the tracks with the answers of a CSV, [track,]answer[,presented][,easy]: the
    /// levels proposed and presented, and the estimate after each trial, for one row
    #[arg(long, value_name = "FILE", conflicts_with = "csv")]
    answers: Option<PathBuf>,
    /// The planned session, of [[sessions]] [default: the first one]
    #[arg(long, value_name = "ID")]
    session: Option<PartId>,
    /// The group, where the experimenter gives it; else it follows from the row
    #[arg(long, value_name = "ID")]
    group: Option<PartId>,
    /// Print the replayed tracks as one JSON document
    #[arg(long, requires = "answers")]
    json: bool,
    /// Folder of the results; the orders of a started study are not shown
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Show the orders of a started study; the reason is logged in its folder
    #[arg(long, value_name = "REASON")]
    reveal: Option<String>,
}

/// Runs `study schedule`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let loaded = load::load(&args.protocol)?;
    let protocol = &loaded.protocol;
    let rows = match &args.answers {
        Some(_) => answers::only_row(args.rows.as_ref())?,
        None => args
            .rows
            .clone()
            .unwrap_or(1..=protocol.design.participants.max(1)),
    };
    let folder = args.results.join(&protocol.study.id);
    if folder.join(layout::MANIFEST).exists() {
        let study = StudyFolder::open(&folder)?;
        reveal(&study, &rows, args.reveal.as_deref(), console)?;
    }
    if let Some(file) = &args.answers {
        return answers::run(protocol, *rows.start(), file, args.json, console);
    }
    let wanted = (args.group.as_ref(), args.session.as_ref());
    let planners = Planners::of(wanted, protocol, loaded.orders.as_ref())?;
    show(protocol, &planners, rows, args.csv, console)
}

/// Makes the orders of each group.
struct Planners {
    of: Vec<(Option<PartId>, Planner)>,
    seed: u64,
    groups: Option<Groups>,
    given: Option<PartId>,
}

impl Planners {
    /// Of a group, where the experimenter gives it, and of a session, the first by default.
    fn of(
        (given, session): (Option<&PartId>, Option<&PartId>),
        protocol: &Protocol,
        orders: Option<&FileOrders>,
    ) -> Result<Self, Failure> {
        let list = protocol.groups.as_ref().map_or(&[][..], |g| &g.list);
        let known: Vec<&PartId> = list.iter().map(|g| &g.id).collect();
        let by_experimenter = protocol
            .groups
            .as_ref()
            .is_some_and(|g| g.assign == Assign::Given);
        match given {
            Some(given) if !by_experimenter || !known.contains(&given) => {
                let what = format!(
                    "--group {given}: there is no such group that is given by the experimenter"
                );
                return Err(Failure::input(what));
            }
            None if by_experimenter => {
                let names: Vec<&str> = known.iter().map(|id| id.as_str()).collect();
                let hint = format!("--group, one of {}", names.join(", "));
                return Err(
                    Failure::input("the experimenter gives the groups of this study").hint(hint),
                );
            }
            _ => {}
        }
        let session = match session {
            None => protocol.sessions.first().map(|s| s.id.clone()),
            Some(id) if protocol.sessions.iter().any(|s| s.id == *id) => Some(id.clone()),
            Some(id) => return Err(Failure::input(format!("there is no session `{id}`"))),
        };
        let groups: Vec<Option<PartId>> = match &known[..] {
            [] => vec![None],
            known => known.iter().map(|id| Some((*id).clone())).collect(),
        };
        let planner = |group: Option<PartId>| {
            let assigned = Assigned {
                group: group.clone(),
                session_id: session.clone(),
                gap_h: None,
            };
            let planner = Planner::new(&protocol.of(&assigned), orders).map_err(infeasible)?;
            Ok((group, planner))
        };
        Ok(Self {
            of: groups
                .into_iter()
                .map(planner)
                .collect::<Result<_, Failure>>()?,
            seed: protocol.study.seed,
            groups: protocol.groups.clone(),
            given: given.cloned(),
        })
    }

    fn group(&self, row: u32) -> Option<PartId> {
        let by_row = || {
            self.groups
                .as_ref()?
                .of_seat(self.seed, Seat::Row(row))
                .cloned()
        };
        self.given.clone().or_else(by_row)
    }

    fn plan(&self, row: u32) -> Result<Vec<Trial>, Failure> {
        let group = self.group(row);
        let planner = self.of.iter().find(|(id, _)| *id == group);
        let (_, planner) = planner.unwrap_or(&self.of[0]);
        planner.plan(Seat::Row(row)).map_err(infeasible)
    }
}

/// Refuses to show the orders of a started study without a reason: an experimenter
/// who knows an order could influence a session. The reason is on disk before the
/// order is on the screen.
fn reveal(
    study: &StudyFolder,
    rows: &RangeInclusive<u32>,
    reason: Option<&str>,
    console: &mut Console,
) -> Result<(), Failure> {
    let folder = study.path().display();
    let Some(reason) = reason else {
        return Err(Failure::results(format!(
            "the study has started in {folder}: an experimenter who knows an order could influence a session"
        ))
        .hint(
            "`study status` shows who is done and which row is next, without any order; \
             --reveal REASON shows the order and logs that",
        ));
    };
    let reason = study_folder::reason(reason)?;
    study.log_reveal(rows, reason, study_folder::now())?;
    console.say(format!(
        "logged in {folder}: orders of rows {}-{} were shown",
        rows.start(),
        rows.end()
    ));
    Ok(())
}

/// Prints the orders of some rows.
fn show(
    protocol: &Protocol,
    planners: &Planners,
    rows: RangeInclusive<u32>,
    as_csv: bool,
    console: &mut Console,
) -> Result<(), Failure> {
    if rows.end() - rows.start() >= MAX_ROWS {
        return Err(Failure::new(
            Kind::Usage,
            format!("at most {MAX_ROWS} rows can be shown at once"),
        ));
    }
    if as_csv {
        let rows: Vec<u32> = rows.collect();
        for (i, chunk) in rows.chunks(CHUNK).enumerate() {
            let plans = chunk
                .iter()
                .map(|&row| Ok((row, planners.plan(row)?)))
                .collect::<Result<Vec<_>, Failure>>()?;
            console.out(csv(i == 0, &plans)?)?;
        }
        Ok(())
    } else {
        if planners.groups.is_some() {
            let of_row = |row| {
                let group = planners.group(row);
                format!(
                    "row {row} {}",
                    group.map_or_else(String::new, |g| g.to_string())
                )
            };
            let all: Vec<String> = rows.clone().map(of_row).collect();
            console.out(format!("Groups: {}\n", all.join(", ")))?;
        }
        let plans = rows
            .map(|row| Ok((row, planners.plan(row)?)))
            .collect::<Result<Vec<_>, Failure>>()?;
        if protocol.only_asks() {
            return console.out("No trials: the study only asks questionnaires.\n");
        }
        if !protocol.parts.is_empty() {
            return console.out(parts::render(protocol, &plans, console.width));
        }
        console.out(table::render(
            protocol,
            planners.of[0].1.models(),
            &plans,
            console.width,
        ))
    }
}

fn infeasible(error: ScheduleError) -> Failure {
    let failure = Failure::input(&error);
    match error.hint() {
        Some(hint) => failure.hint(hint),
        None => failure,
    }
}

/// Orders as CSV, RFC 4180.
fn csv(header: bool, plans: &[(u32, Vec<Trial>)]) -> Result<String, Failure> {
    let broken = |e: &dyn std::fmt::Display| Failure::new(Kind::Bug, format!("CSV: {e}"));
    let mut out = csv::WriterBuilder::new()
        .terminator(csv::Terminator::CRLF)
        .from_writer(Vec::new());
    const NAMES: [&str; 7] = [
        "row",
        "trial",
        "block",
        "position",
        "model",
        "repetition",
        "practice",
    ];
    /// Further columns of a study with parts.
    const OF_PARTS: [&str; 6] = ["part", "first", "second", "track", "intervals", "easy"];
    let has_parts = plans
        .iter()
        .any(|(_, plan)| plan.iter().any(|t| t.part.is_some()));
    let more = if has_parts { &OF_PARTS[..] } else { &[] };
    if header {
        out.write_record(NAMES.iter().chain(more))
            .map_err(|e| broken(&e))?;
    }
    for (row, plan) in plans {
        for t in plan {
            let mut record = vec![
                row.to_string(),
                t.trial.to_string(),
                t.block.to_string(),
                t.position.to_string(),
                t.model().map_or_else(String::new, ToString::to_string),
                t.repetition.to_string(),
                t.practice.to_string(),
            ];
            if has_parts {
                let (first, second) = match &t.stimuli {
                    Stimuli::Pair { pair: [a, b] } => (a.to_string(), b.to_string()),
                    _ => (String::new(), String::new()),
                };
                let (intervals, easy) = match &t.stimuli {
                    Stimuli::Track {
                        intervals, easy, ..
                    } => (parts::intervals(intervals), easy.to_string()),
                    Stimuli::Set { set } => {
                        let ids: Vec<&str> = set.iter().map(|m| m.as_str()).collect();
                        (ids.join(" "), String::new())
                    }
                    _ => (String::new(), String::new()),
                };
                let part = t
                    .part
                    .as_ref()
                    .map_or_else(String::new, ToString::to_string);
                let track = t.track().map_or_else(String::new, ToString::to_string);
                record.extend([part, first, second, track, intervals, easy]);
            }
            out.write_record(record).map_err(|e| broken(&e))?;
        }
    }
    let bytes = out.into_inner().map_err(|e| broken(&e))?;
    String::from_utf8(bytes).map_err(|e| broken(&e))
}

/// Why a text is not a range of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum RowsError {
    #[error("rows count from 1")]
    Zero,
    #[error("there are at most {} rows", u32::MAX)]
    TooLarge,
    #[error("give a row such as 7 or a range such as 1-40")]
    NoNumber,
    #[error("the range is reversed: did you mean {0}-{1}?")]
    Reversed(u32, u32),
}

/// Reads `7` or `1-40`.
pub(super) fn parse_rows(given: &str) -> Result<RangeInclusive<u32>, RowsError> {
    let number = |text: &str| {
        let text = text.trim();
        match text.parse::<u32>() {
            Ok(0) => Err(RowsError::Zero),
            Ok(row) => Ok(row),
            Err(_) if !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit()) => {
                Err(RowsError::TooLarge)
            }
            Err(_) => Err(RowsError::NoNumber),
        }
    };
    let (first, last) = given.split_once('-').unwrap_or((given, given));
    let (first, last) = (number(first)?, number(last)?);
    if first > last {
        return Err(RowsError::Reversed(last, first));
    }
    Ok(first..=last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::io::Write;
    use std::rc::Rc;
    use study_base::text::ModelId;
    use study_plan::protocol::example::protocol;
    use study_plan::protocol::{ModelEntry, Order, Role};

    #[derive(Clone, Default)]
    struct Shared(Rc<RefCell<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.borrow_mut().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn shown(p: &Protocol, rows: RangeInclusive<u32>, csv: bool) -> Result<String, Failure> {
        let out = Shared::default();
        let mut console = Console::to(out.clone(), Vec::new());
        let planners = Planners::of((None, None), p, None)?;
        show(p, &planners, rows, csv, &mut console)?;
        let bytes = out.0.borrow().clone();
        Ok(String::from_utf8(bytes).unwrap())
    }

    /// Two realizations and one for practice.
    fn small() -> Protocol {
        let mut p = protocol(2, 2);
        p.design.order = Order::Fixed;
        let practice = ModelEntry {
            id: ModelId::new("spring").unwrap(),
            role: Role::Practice,
            ..p.models[0].clone()
        };
        p.design.practice = vec![practice.id.clone()];
        p.models.push(practice);
        p
    }

    #[test]
    fn the_csv_has_every_trial_of_every_row() {
        let text = shown(&small(), 3..=4, true).unwrap();
        let expected = "row,trial,block,position,model,repetition,practice\r\n\
            3,1,0,1,spring,0,true\r\n\
            3,2,1,1,A,1,false\r\n\
            3,3,1,2,B,1,false\r\n\
            3,4,2,3,A,2,false\r\n\
            3,5,2,4,B,2,false\r\n\
            4,1,0,1,spring,0,true\r\n";
        assert_eq!(&text[..expected.len()], expected);
        assert_eq!(text.lines().count(), 11);
    }

    #[test]
    fn a_long_csv_has_one_header() {
        let text = shown(&small(), 1..=2500, true).unwrap();
        assert_eq!(text.matches("row,trial").count(), 1);
        assert_eq!(text.lines().count(), 1 + 2500 * 5);
    }

    #[test]
    fn rows_are_a_number_or_a_range() {
        assert_eq!(parse_rows("7"), Ok(7..=7));
        assert_eq!(parse_rows("1-40"), Ok(1..=40));
        assert_eq!(parse_rows(" 1 - 40 "), Ok(1..=40));
        for (bad, says) in [
            ("0", "count from 1"),
            ("0-4", "count from 1"),
            ("40-1", "did you mean 1-40?"),
            ("4294967296", "at most 4294967295"),
            ("", "1-40"),
            ("-", "1-40"),
            ("1-", "1-40"),
            ("-3", "1-40"),
            ("1-2-3", "1-40"),
            ("1..4", "1-40"),
            ("all", "1-40"),
        ] {
            let error = parse_rows(bad).unwrap_err().to_string();
            assert!(error.contains(says), "{bad}: {error}");
        }
    }

    #[test]
    fn too_many_rows_are_refused_before_anything_is_printed() {
        let failure = shown(&small(), 1..=u32::MAX, true).unwrap_err();
        assert_eq!(failure.exit_code(), 2);
    }

    #[test]
    fn an_infeasible_design_says_what_to_do() {
        let mut p = small();
        p.design.min_distance = Some(6);
        let failure = shown(&p, 1..=2, false).unwrap_err();
        assert_eq!(failure.exit_code(), 1);
        assert_eq!(
            failure.message,
            "min_distance = 6 needs at least 6 realizations, there are 2"
        );
        assert!(failure.hint.is_some());
    }
}
