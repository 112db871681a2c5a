//! `study status`

use super::overview::{Reality, is_running};
use super::{Console, Failure, study_folder};
use std::fmt::Write as _;
use std::path::PathBuf;
use study_analysis::load;
use study_base::text::Untrusted;
use study_session::outcome::{ParticipantRow, State, Verdict};
use study_session::store::{
    self, Plan, SessionData, StudyFolder, next_row, next_session, participants,
};

/// Arguments of `study status`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder, or the folder of one study in it
    results: PathBuf,
}

/// Prints the participants and their states, never an order.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut truncated = Ok(());
    for (n, study) in store::studies(&args.results)?.iter().enumerate() {
        if n > 0 {
            console.out("\n")?;
        }
        let sessions = study.sessions()?;
        study_folder::warn(study, &load::damage(study, &sessions, None)?, console);
        // Bars and colors are for eyes: a pipe and a dumb terminal get words.
        let look = Look {
            bars: console.terminal && !super::run::wants_plain(|name| std::env::var(name).ok()),
            color: console.color,
        };
        console.out(of_study(study, &sessions, look))?;
        truncated = truncated.and(study_folder::whole(study, &sessions));
    }
    truncated
}

/// How the states are shown.
#[derive(Debug, Clone, Copy)]
struct Look {
    bars: bool,
    color: bool,
}

fn of_study(study: &StudyFolder, sessions: &[SessionData], look: Look) -> String {
    let manifest = study.manifest();
    let mut out = format!(
        "{} · {} · protocol version {}\n",
        Untrusted(&manifest.study),
        Untrusted(&study.path().display().to_string()),
        study.version()
    );
    let all = participants(sessions);
    let of = |kind: Reality| -> Vec<&ParticipantRow> {
        let of_kind = |row: &&ParticipantRow| Reality::of(row) == kind;
        all.iter().filter(of_kind).collect()
    };
    let [real, pilots, simulated] = [Reality::Real, Reality::Pilot, Reality::Simulated].map(of);
    for (title, rows) in [
        ("", &real),
        ("Pilots", &pilots),
        ("Simulated participants", &simulated),
    ] {
        if rows.is_empty() {
            continue;
        }
        if !title.is_empty() {
            let _ = writeln!(out, "\n{title}");
        }
        let runs = |row: &ParticipantRow| is_running(study, sessions, row);
        out.push_str(&table(rows, runs, look));
    }
    let _ = writeln!(out, "\n{}", summary(study, &real));
    if let Some(forces) = forces(sessions) {
        let _ = writeln!(out, "Force of the playbacks: {forces}");
    }
    if let Some([p99, most]) = lateness(sessions) {
        let _ = writeln!(
            out,
            "This computer while it played: late by at most {most:.0} ms, 99 % within {p99:.0} ms"
        );
    }
    out.push_str(&again(study, sessions));
    let _ = match next_row(None, sessions) {
        Some(row) => writeln!(out, "Next free row: {row}"),
        None => writeln!(out, "No row is free"),
    };
    out
}

/// Who comes again, and from when on, in a study of repeated sessions; their groups.
fn again(study: &StudyFolder, sessions: &[SessionData]) -> String {
    let mut out = String::new();
    let Ok(loaded) = load::frozen(study) else {
        return out;
    };
    let protocol = &loaded.protocol;
    let now = chrono::Local::now().fixed_offset();
    let plan = Plan::of(protocol, None, now);
    let of_one = sessions.chunk_by(|a, b| a.participant == b.participant);
    for own in of_one.filter(|_| !plan.sessions.is_empty()) {
        let who = &own[0].participant;
        let own: Vec<&SessionData> = own.iter().collect();
        if let Some(words) = next_session(&own, &plan).of_finished(plan.sessions.len()) {
            let _ = writeln!(out, "{who}: {words}");
        }
    }
    for group in protocol.groups.iter().flat_map(|groups| &groups.list) {
        let own = participants(sessions);
        let own = own.iter().filter(|p| p.group.as_ref() == Some(&group.id));
        let _ = writeln!(out, "Group {}: {}", group.id, own.count());
    }
    out
}

/// How often each verdict about the force of a playback was given in all sessions, such as
/// "148 ok, 1 flag"; `None` if none was judged.
fn forces(sessions: &[SessionData]) -> Option<String> {
    let judged: Vec<Verdict> = (sessions.iter())
        .flat_map(|s| s.history.all_attempts())
        .flat_map(|(_, attempt)| attempt.rendering.iter().map(|r| r.verdict))
        .collect();
    let counts: Vec<String> = [
        Verdict::Ok,
        Verdict::Unverified,
        Verdict::TooLittle,
        Verdict::Flag,
        Verdict::Fault,
    ]
    .into_iter()
    .map(|verdict| (verdict, judged.iter().filter(|v| **v == verdict).count()))
    .filter(|(_, n)| *n > 0)
    .map(|(verdict, n)| format!("{n} {}", verdict.as_str()))
    .collect();
    (!counts.is_empty()).then(|| counts.join(", "))
}

/// How late the host was in the worst playback of all sessions, ms: 99th percentile and
/// most.
fn lateness(sessions: &[SessionData]) -> Option<[f64; 2]> {
    (sessions.iter())
        .flat_map(|s| s.history.all_attempts())
        .flat_map(|(_, attempt)| &attempt.presentations)
        .filter_map(|p| p.ended?.1.playback.host_late_ms)
        .reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
}

/// Cells of the bar of a participant.
const BAR: usize = 10;

/// The trials done: `━━━━━━────  9/15`.
fn trials((done, planned): (u32, u32), look: Look) -> String {
    let words = format!("{done}/{planned}");
    if !look.bars || planned == 0 {
        return words;
    }
    let full = (BAR * done as usize / planned as usize).min(BAR);
    format!("{}{} {words:>5}", "━".repeat(full), "─".repeat(BAR - full))
}

fn table(rows: &[&ParticipantRow], runs: impl Fn(&ParticipantRow) -> bool, look: Look) -> String {
    let mut lines = vec![
        [
            "participant",
            "row",
            "session",
            "state",
            "trials",
            "started",
            "reason",
        ]
        .map(str::to_owned),
    ];
    for row in rows {
        let state = match row.state.as_str() {
            state if row.erased => format!("{state}, erased"),
            _ if runs(row) => "running now".to_owned(),
            state => state.to_owned(),
        };
        lines.push([
            row.participant.to_string(),
            row.row.map_or_else(String::new, |r| r.to_string()),
            match &row.session_id {
                Some(id) => format!("{} {id}", row.session),
                None => row.session.to_string(),
            },
            state,
            trials((row.trials_done, row.trials_planned), look),
            row.started_at.map_or_else(String::new, |at| {
                at.format("%Y-%m-%d %H:%M %:z").to_string()
            }),
            Untrusted(&row.reason).to_string(),
        ]);
    }
    let mut widths = [0; 7];
    for line in &lines {
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut out = String::new();
    let states = [None]
        .into_iter()
        .chain(rows.iter().map(|row| Some(row.state)));
    for (line, state) in lines.iter().zip(states) {
        let mut text = String::new();
        for (width, cell) in widths.iter().zip(line) {
            let _ = write!(text, "{cell:width$}  ");
        }
        let text = text.trim_end();
        // Green and yellow of the terminal; the words say the same.
        let color = match state {
            Some(State::Done) => "\u{1b}[32m",
            Some(State::Unfinished) => "\u{1b}[33m",
            _ => "",
        };
        let _ = match look.color && !color.is_empty() {
            true => writeln!(out, "{color}{text}\u{1b}[0m"),
            false => writeln!(out, "{text}"),
        };
    }
    out
}

/// "3 participants: 2 done, 1 unfinished; 10 planned".
fn summary(study: &StudyFolder, real: &[&ParticipantRow]) -> String {
    let states = [
        State::Done,
        State::Unfinished,
        State::DroppedOut,
        State::NoShow,
        State::Excluded,
        State::Withdrawn,
        State::Void,
    ];
    let counts: Vec<String> = states
        .into_iter()
        .map(|state| (state, real.iter().filter(|p| p.state == state).count()))
        .filter(|(_, n)| *n > 0)
        .map(|(state, n)| format!("{n} {}", state.as_str()))
        .collect();
    let people = match real.len() {
        0 => "No participants yet".to_owned(),
        1 => format!("1 participant: {}", counts.join(", ")),
        n => format!("{n} participants: {}", counts.join(", ")),
    };
    // A damaged frozen protocol is reported among the warnings.
    match load::frozen(study) {
        Ok(loaded) => format!("{people}; {} planned", loaded.protocol.design.participants),
        Err(_) => people,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_full_at_the_last_trial_only() {
        let look = Look {
            bars: true,
            color: false,
        };
        let bar = |done: u32, planned: u32| trials((done, planned), look);
        assert_eq!(bar(0, 15), "──────────  0/15");
        assert_eq!(bar(14, 15), "━━━━━━━━━─ 14/15");
        assert_eq!(bar(15, 15), "━━━━━━━━━━ 15/15");
        assert_eq!(bar(0, 0), "0/0");
        // more than were planned, after repetitions
        assert_eq!(bar(16, 15), "━━━━━━━━━━ 16/15");
        let plain = Look {
            bars: false,
            color: false,
        };
        assert_eq!(trials((7, 15), plain), "7/15");
    }
}
