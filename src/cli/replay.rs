//! `study replay`

mod events;
mod felt;
mod steps;

use super::{Console, Failure, study_folder};
use chrono::{DateTime, FixedOffset};
use felt::Reader;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use steps::{Step, lines, steps};
use study_analysis::load::{self, Loaded};
use study_base::text::{ParticipantId, Untrusted};
use study_plan::protocol::{Protocol, Seat};
use study_report::plot::braille::LABEL;
use study_session::outcome::{Entry, Event, State};
use study_session::page;
use study_session::session::retrace;
use study_session::store::{self, SessionData, StudyFolder, participants};

/// Format of the document.
const FORMAT: &str = "study-replay/1";

/// Arguments of `study replay`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder of one study
    results: PathBuf,
    /// Participant, as in the results
    #[arg(add = super::completions::participants())]
    participant: String,
    /// Trial, as in ratings.csv, with what was felt; without it, the whole session
    trial: Option<u32>,
    /// Session of the participant [default: the last one]
    #[arg(long, value_name = "N")]
    session: Option<u32>,
    /// Name the realizations and forces although the study is not complete; the reason is logged in its folder
    #[arg(long, value_name = "REASON")]
    reveal: Option<String>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Prints what was on the screen, answered and felt. Writes nothing, except the log of --reveal.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let id = ParticipantId::new(args.participant.as_str()).map_err(Failure::input)?;
    let study = store::one_study(&args.results)?;
    let own = study.kept_sessions(&id)?;
    let session = chosen(&own, args.session)?;
    let protocols = Protocols::of(&study, session)?;
    begun(session, args.trial)?;
    let sessions = study.sessions()?;
    study_folder::warn(&study, &load::damage(&study, &sessions, None)?, console);
    let hidden = hidden(&study, &sessions, session)?;
    let revealed = match (&hidden, &args.reveal) {
        (None, _) => true,
        (Some(_), None) => false,
        (Some(_), Some(reason)) => {
            reveal(&study, session, reason, console)?;
            true
        }
    };
    let shown = retrace::pages(&|entry: &Entry| protocols.of_entry(entry), &session.entries);
    let steps = steps(&session.entries, &shown, args.trial);
    let tables = protocols.first.tables();
    let reader = Reader {
        session,
        protocol: &protocols.first.protocol,
        tables: &tables,
        revealed,
    };
    if args.json {
        let hidden = hidden.filter(|_| !revealed);
        console.json(&document(args, session, &steps, &reader, hidden.is_some()))?;
    } else {
        let columns = console.width.clamp(40, 100) - LABEL - 2;
        console.out(heading(&study, session))?;
        if let Some(why) = hidden.filter(|_| !revealed) {
            console.out(format!("{why}\n"))?;
        }
        let charts = args.trial.map(|_| columns);
        console.out(text(&steps, &reader, charts))?;
    }
    study_folder::whole(&study, &own)
}

/// The session that is shown.
fn chosen(own: &[SessionData], number: Option<u32>) -> Result<&SessionData, Failure> {
    let session = match number {
        Some(number) => own.iter().find(|s| s.session == number),
        None => own.last(),
    };
    let session = session.ok_or_else(|| {
        let all: Vec<String> = own.iter().map(|s| s.session.to_string()).collect();
        Failure::input("there is no such session")
            .hint(format!("--session, one of {}", all.join(", ")))
    })?;
    let who = &session.participant;
    if own.iter().any(|s| s.standing().state == State::Withdrawn) {
        return Err(Failure::input(format!(
            "{who} withdrew: nothing of them is shown"
        )));
    }
    Ok(session)
}

/// Refuses a session without trials, and a trial that has not begun.
fn begun(session: &SessionData, trial: Option<u32>) -> Result<(), Failure> {
    let Some(trial) = trial else {
        return Ok(());
    };
    let (who, history) = (&session.participant, &session.history);
    if history.attempts(trial) > 0 {
        return Ok(());
    }
    let last = history.schedule().iter().map(|t| t.trial).max();
    Err(match history.planned(trial) {
        Some(_) => Failure::input(format!("trial {trial} of {who} has not begun"))
            .hint("without a trial the whole session is shown"),
        None => Failure::input(format!("{who} has no trial {trial}")).hint(format!(
            "trials are numbered from 1 to {}, practice included, as in ratings.csv",
            last.unwrap_or_default()
        )),
    })
}

/// The versions of the protocol with which a session was run.
struct Protocols {
    /// The one with which it began.
    first: Loaded,
    /// All that were in force since, with the time from which on.
    later: Vec<(DateTime<FixedOffset>, Arc<Protocol>)>,
    start: Arc<Protocol>,
}

impl Protocols {
    fn of(study: &StudyFolder, session: &SessionData) -> Result<Self, Failure> {
        let who = &session.participant;
        let Some(start) = session.history.start() else {
            let path = study.path().display();
            let only_state = |entry: &Entry| matches!(entry.event, Event::StateSet { .. });
            return Err(match session.entries.iter().all(only_state) {
                true => Failure::input(format!("{who} has no session that began"))
                    .hint(format!("`study status {path}` says who has taken part")),
                false => Failure::results(format!(
                    "{who}: the start of the session is missing from its journal"
                ))
                .hint(format!("`study verify {path}` lists all findings")),
            });
        };
        let first = load::frozen_version(study, start.protocol_version)?;
        let mut later = Vec::new();
        let resumed = |entry: &Entry| matches!(entry.event, Event::Reopened { .. });
        if session.entries.iter().any(resumed) {
            let versions = study.manifest().versions.iter();
            for version in versions.filter(|v| v.version > start.protocol_version) {
                let loaded = load::frozen_version(study, version.version)?;
                later.push((version.at, Arc::new(loaded.protocol)));
            }
        }
        Ok(Self {
            start: Arc::new(first.protocol.clone()),
            first,
            later,
        })
    }

    /// The version in force when a session began or was resumed: the newest one of that time.
    fn of_entry(&self, entry: &Entry) -> Arc<Protocol> {
        let resumed = matches!(entry.event, Event::Reopened { .. });
        let mut later = self.later.iter().rev();
        let newest = later.find(|(from, _)| resumed && *from <= entry.at.wall);
        newest.map_or_else(|| self.start.clone(), |(_, protocol)| protocol.clone())
    }
}

/// Why realizations and forces are hidden, if they are: as long as a study is not complete,
/// an experimenter who knows them could influence a session.
fn hidden(
    study: &StudyFolder,
    sessions: &[SessionData],
    session: &SessionData,
) -> Result<Option<String>, Failure> {
    // Pilots and simulated participants have no row.
    if session.seat.is_some_and(|seat| seat.row().is_none()) {
        return Ok(None);
    }
    let planned = load::frozen(study)?.protocol.design.participants;
    let all = participants(sessions);
    let done = all
        .iter()
        .filter(|p| !p.pilot && !p.simulated && p.state == State::Done)
        .count();
    Ok((done < planned as usize).then(|| {
        format!(
            "Realizations and forces are hidden: {done} of {planned} participants have finished. --reveal REASON shows them and logs that."
        )
    }))
}

/// Logs that the order of a participant is shown.
fn reveal(
    study: &StudyFolder,
    session: &SessionData,
    reason: &str,
    console: &mut Console,
) -> Result<(), Failure> {
    let reason = study_folder::reason(reason)?;
    let Some(row) = session.seat.and_then(Seat::row) else {
        return Err(Failure::results(format!(
            "{}: the row of this session cannot be read",
            session.participant
        ))
        .hint("`study verify` lists all findings"));
    };
    study.log_reveal(&(row..=row), reason, study_folder::now())?;
    console.say(format!(
        "logged in {}: the realizations of row {row} were shown",
        study.path().display()
    ));
    Ok(())
}

fn heading(study: &StudyFolder, session: &SessionData) -> String {
    let row = session.seat.and_then(Seat::row);
    format!(
        "{} · {} · session {}{} · {}\n",
        Untrusted(&study.manifest().study),
        session.participant,
        session.session,
        row.map_or(String::new(), |row| format!(" · row {row}")),
        session.standing().state.as_str()
    )
}

/// The steps one below the other; `charts` is the width of those of each playback.
fn text(steps: &[Step<'_>], reader: &Reader<'_>, charts: Option<usize>) -> String {
    let mut out = String::new();
    for step in steps {
        // Writing to a String cannot fail.
        let _ = match step {
            Step::Page(shown) => {
                let page: Vec<String> = (lines(&shown.view).iter())
                    .map(|line| format!("          │ {line}\n"))
                    .collect();
                writeln!(out, "\n{}", page.concat())
            }
            Step::Event(entry) => {
                let time = entry.at.wall.format("%H:%M:%S");
                let said = events::words(&reader.told(entry).event, reader.revealed);
                writeln!(out, "{time}  {said}")
            }
        };
        if let (Step::Event(entry), Some(columns)) = (step, charts)
            && let Some(felt) = reader.read(&entry.event)
        {
            let _ = writeln!(out, "{}", felt.text(columns));
        }
    }
    out
}

fn document(
    args: &Args,
    session: &SessionData,
    steps: &[Step<'_>],
    reader: &Reader<'_>,
    is_hidden: bool,
) -> serde_json::Value {
    let of_step = |step: &Step<'_>| match step {
        Step::Page(shown) => serde_json::json!({
            "lines": lines(&shown.view),
            "page": page::participant(&shown.view).map(|page| page.timeless()),
            "trial": shown.of.map(|(trial, _)| trial),
            "attempt": shown.of.map(|(_, attempt)| attempt),
        }),
        Step::Event(entry) => {
            let mut fields = events::json(&reader.told(entry), reader.revealed);
            if let Some(felt) = reader.read(&entry.event) {
                felt.json(&mut fields);
            }
            fields.into()
        }
    };
    let steps: Vec<serde_json::Value> = steps.iter().map(of_step).collect();
    serde_json::json!({
        "format": FORMAT,
        "study": reader.protocol.study.id,
        "participant": session.participant.as_str(),
        "session": session.session,
        "trial": args.trial,
        "hidden": is_hidden,
        "steps": steps,
    })
}
