//! What a study has come to, in lines of text.

use crate::cli::overview::{Coming, Copied, Overview, Person, Reality};
use crate::tui::desk::size;
use crate::tui::wrap::{one_line, width};
use std::cmp::Reverse;
use study_base::sort::SmallSort as _;
use study_base::text::counted;
use study_session::outcome::State;
use study_session::store::{Due, when};

/// Participants that a line names before it only counts.
const NAMED: usize = 4;
/// Names of a table's columns. Of those with a number the largest is left out first where there is no
/// room, and each if it is empty.
const COLUMNS: [(&str, Option<u8>); 8] = [
    ("participant", None),
    ("row", Some(2)),
    ("group", Some(1)),
    ("sessions", None),
    ("trials", Some(0)),
    ("state", None),
    ("last activity", Some(3)),
    ("next", None),
];

/// Everything about a study. `columns` is the width of the terminal; without one, nothing is left out.
pub(super) fn all(study: &Overview, columns: Option<usize>) -> Vec<String> {
    let people: Vec<&Person> = study.participants.iter().collect();
    let mut lines = summary(study, usize::MAX);
    if !people.is_empty() {
        lines.push(String::new());
        lines.extend(table(&people, columns));
    }
    lines
}

/// As much about a study as has room: first what asks for somebody, then the participants, those who
/// ask for somebody first.
pub(super) fn within(study: &Overview, columns: usize, rows: usize) -> Vec<String> {
    let mut lines: Vec<String> = (summary(study, NAMED).iter())
        .map(|line| one_line(line, columns))
        .collect();
    lines.truncate(rows);
    let mut people: Vec<&Person> = study.participants.iter().collect();
    people.small_sort_by_key(|person| (urgency(person), Reverse(person.last_activity)));
    let table = table(&people, Some(columns));
    let room = rows.saturating_sub(lines.len() + 1);
    // A head and one participant, and a line that counts the others.
    if people.is_empty() || room < 3 {
        return lines;
    }
    lines.push(String::new());
    match table.len() <= room {
        true => lines.extend(table),
        false => {
            lines.extend(table.into_iter().take(room - 1));
            let more = people.len() - (room - 2);
            let more = counted(more, "more participant", "more participants");
            lines.push(format!("… and {more}"));
        }
    }
    lines
}

/// Who is shown first.
fn urgency(person: &Person) -> u8 {
    match (person.running, &person.next, person.state) {
        (true, ..) => 0,
        (_, Some(next), _) if next.due == Due::Overdue => 1,
        (_, _, State::Unfinished) => 2,
        (_, Some(next), _) if next.due == Due::Now => 3,
        _ => 4,
    }
}

/// What a study has come to, a line for each subject. A line names at most so many participants.
fn summary(study: &Overview, named: usize) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{} · protocol version {} · {}",
            safe(&study.study),
            study.protocol_version,
            safe(&study.folder)
        ),
        format!(
            "Read {} · {}",
            when(study.read_at),
            match study.last_activity {
                Some(at) => format!("last activity {}", when(at)),
                None => "nobody has taken part yet".to_owned(),
            }
        ),
    ];
    if !study.warnings.is_empty() {
        lines.push(format!(
            "DAMAGE: {}; `study verify {}` lists all findings",
            counted(study.warnings.len(), "problem", "problems"),
            safe(&study.folder)
        ));
    }
    lines.push(format!("Participants: {}", counts(study)));
    lines.extend(not_real(study));
    lines.push(format!("Rows: {}", rows(study, named)));
    if !study.groups.is_empty() {
        let groups = study.groups.iter();
        let groups = groups.map(|g| format!("{} {}", safe(g.group.as_str()), g.participants));
        lines.push(format!("Groups: {}", groups.collect::<Vec<_>>().join(", ")));
    }
    lines.push(format!("Disk: {}", storage(study, named)));
    for (due, title) in [
        (Due::Overdue, "OVERDUE"),
        (Due::Now, "Due now"),
        (Due::Later, "Later"),
    ] {
        let comes = |person: &&Person| person.next.as_ref().is_some_and(|next| next.due == due);
        let mut who: Vec<&Person> = study.participants.iter().filter(comes).collect();
        who.small_sort_by_key(|person| {
            person
                .next
                .as_ref()
                .map(|next| next.until.unwrap_or(next.from))
        });
        let words = who.iter().filter_map(|person| {
            let next = person.next.as_ref()?;
            Some(format!(
                "{} {}{}",
                safe(person.participant.as_str()),
                window(next),
                mark(person)
            ))
        });
        if let Some(words) = listed(words.collect(), named) {
            lines.push(format!("{title}: {words}"));
        }
    }
    let left = |person: &&Person| !person.state.keeps_row();
    let left = study.participants.iter().filter(left).map(|person| {
        let reason = match person.reason.is_empty() {
            true => String::new(),
            false => format!(" ({})", safe(&person.reason)),
        };
        let who = safe(person.participant.as_str());
        format!("{who} {}{}{reason}", state(person), mark(person))
    });
    if let Some(words) = listed(left.collect(), named) {
        lines.push(format!("Left out: {words}"));
    }
    lines
}

/// The session and its window.
fn window(next: &Coming) -> String {
    let session = safe(next.session.as_str());
    match (next.due, next.until) {
        (Due::Later, _) => format!("session {session} from {}", when(next.from)),
        (_, Some(until)) => format!("session {session} until {}", when(until)),
        (_, None) => format!("session {session} since {}", when(next.from)),
    }
}

/// Marks what is of no participant of the study.
fn mark(person: &Person) -> &'static str {
    match person.kind {
        Reality::Real => "",
        Reality::Pilot => " [pilot]",
        Reality::Simulated => " [simulated]",
    }
}

/// The names with `; ` between them, as many as are to be named; `None` if there are none.
fn listed(mut words: Vec<String>, named: usize) -> Option<String> {
    let more = words.len().saturating_sub(named);
    words.truncate(named);
    if more > 0 {
        words.push(format!("{more} more"));
    }
    (!words.is_empty()).then(|| words.join("; "))
}

/// How many real participants are planned, and in which state those are that there are.
fn counts(study: &Overview) -> String {
    let real = || (study.participants.iter()).filter(|p| p.kind == Reality::Real);
    let whole = |p: &&Person| p.state == State::Done && p.next.is_none();
    let mut words = vec![match study.planned {
        Some(planned) => format!("{planned} planned"),
        None => "the protocol cannot be read".to_owned(),
    }];
    let mut count = |n: usize, what: &str| {
        if n > 0 {
            words.push(format!("{n} {what}"));
        }
    };
    count(real().filter(whole).count(), "done");
    count(real().filter(|p| p.next.is_some()).count(), "to come again");
    count(real().filter(|p| p.running).count(), "running now");
    // Whoever comes again is counted once, also if the last session was void or left before it began.
    let left = || real().filter(|p| p.next.is_none() && !p.running);
    let unfinished = |p: &&Person| p.state == State::Unfinished;
    count(left().filter(unfinished).count(), "unfinished");
    for state in [
        State::DroppedOut,
        State::NoShow,
        State::Excluded,
        State::Withdrawn,
        State::Void,
    ] {
        count(left().filter(|p| p.state == state).count(), state.as_str());
    }
    words.join(", ")
}

/// Whoever is no participant of the study.
fn not_real(study: &Overview) -> Option<String> {
    let of = |kind: Reality| study.participants.iter().filter(|p| p.kind == kind).count();
    let (pilots, simulated) = (of(Reality::Pilot), of(Reality::Simulated));
    let words = [
        (pilots > 0).then(|| counted(pilots, "pilot", "pilots")),
        (simulated > 0).then(|| format!("{simulated} simulated")),
    ];
    let words: Vec<String> = words.into_iter().flatten().collect();
    (!words.is_empty()).then(|| format!("Not real: {}", words.join(", ")))
}

fn rows(study: &Overview, named: usize) -> String {
    let rows = &study.rows;
    let of = match study.planned {
        Some(planned) => format!(" of {planned}"),
        None => String::new(),
    };
    let mut words = vec![
        format!("{} kept{of}", rows.kept),
        match rows.next {
            Some(row) => format!("next free {row}"),
            None => "none is free".to_owned(),
        },
    ];
    for (what, rows) in [
        ("free again", &rows.freed),
        ("kept twice", &rows.twice),
        ("beyond the plan", &rows.beyond),
    ] {
        let numbers: Vec<String> = rows.iter().map(u32::to_string).collect();
        let shown = numbers.iter().take(named).cloned().collect::<Vec<_>>();
        let more = if numbers.len() > shown.len() {
            ", …"
        } else {
            ""
        };
        if !shown.is_empty() {
            words.push(format!("{what}: {}{more}", shown.join(", ")));
        }
    }
    words.join(" · ")
}

fn storage(study: &Overview, named: usize) -> String {
    let storage = &study.storage;
    let free = match storage.free_bytes {
        Some(bytes) if storage.almost_full => format!("ALMOST FULL, {} free", size(bytes)),
        Some(bytes) => format!("{} free", size(bytes)),
        None => "free space not known".to_owned(),
    };
    let Some(mirror) = &storage.mirror else {
        return format!("{free} · no mirror");
    };
    let folder = safe(&mirror.folder);
    let state = match mirror.state {
        Copied::InStep => "in step".to_owned(),
        Copied::Missing => "NO COPY there".to_owned(),
        Copied::Apart => {
            let which = mirror.differs.iter().map(|place| safe(place)).collect();
            format!("NOT IN STEP: {}", listed(which, named).unwrap_or_default())
        }
        Copied::Unreadable => {
            let why = mirror
                .differs
                .iter()
                .map(|why| safe(why))
                .collect::<Vec<_>>();
            format!("CANNOT BE READ: {}", why.join(" "))
        }
    };
    format!("{free} · mirror {folder}: {state}")
}

/// The state in words.
fn state(person: &Person) -> String {
    let word = match person.running {
        true => "running now",
        false => person.state.as_str(),
    };
    match person.erased {
        true => format!("{word}, erased"),
        false => word.to_owned(),
    }
}

/// The head of the table and a line for each participant, in columns of the terminal.
fn table(people: &[&Person], columns: Option<usize>) -> Vec<String> {
    let mut lines = vec![COLUMNS.map(|(name, _)| name.to_owned())];
    lines.extend(people.iter().map(|person| cells(person)));
    let mut kept = [true; COLUMNS.len()];
    // What is empty in every line says nothing.
    for (n, keeps) in kept.iter_mut().enumerate() {
        let is_empty = lines.iter().skip(1).all(|cells| cells[n].is_empty());
        *keeps = !(is_empty && COLUMNS[n].1.is_some());
    }
    let widest = |n: usize| {
        lines
            .iter()
            .map(|cells| width(&cells[n]))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..COLUMNS.len()).map(widest).collect();
    let total = |kept: &[bool]| {
        let shown = widths.iter().zip(kept).filter(|(_, keeps)| **keeps);
        shown
            .map(|(width, _)| width + 2)
            .sum::<usize>()
            .saturating_sub(2)
    };
    while columns.is_some_and(|columns| total(&kept) > columns) {
        let missed = |n: &usize| COLUMNS[*n].1.filter(|_| kept[*n]);
        let Some(least) = (0..COLUMNS.len())
            .filter(|n| missed(n).is_some())
            .max_by_key(missed)
        else {
            break;
        };
        kept[least] = false;
    }
    (lines.iter())
        .map(|cells| {
            let mut line = String::new();
            for (n, cell) in cells.iter().enumerate().filter(|(n, _)| kept[*n]) {
                line.push_str(cell);
                line.push_str(&" ".repeat(widths[n] + 2 - width(cell)));
            }
            let line = line.trim_end();
            columns.map_or_else(|| line.to_owned(), |columns| one_line(line, columns))
        })
        .collect()
}

fn cells(person: &Person) -> [String; COLUMNS.len()] {
    let text = |shown: Option<String>| shown.unwrap_or_default();
    let trials = match (person.trials_planned, person.trials_done) {
        (Some(planned), done) => format!("{done}/{planned}"),
        (None, 0) => String::new(),
        (None, done) => done.to_string(),
    };
    let next = person.next.as_ref().map(|next| {
        let session = safe(next.session.as_str());
        match next.due {
            Due::Overdue => format!("{session} OVERDUE"),
            Due::Now => format!("{session} due"),
            Due::Later => format!("{session} later"),
        }
    });
    [
        format!("{}{}", safe(person.participant.as_str()), mark(person)),
        text(person.row.map(|row| row.to_string())),
        text(person.group.as_ref().map(|group| safe(group.as_str()))),
        person.sessions_done.to_string(),
        trials,
        state(person),
        text(person.last_activity.map(when)),
        text(next),
    ]
}

/// A text of files and people as one line that is safe to print.
fn safe(text: &str) -> String {
    one_line(text, usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::overview::{Mirror, Rows, Storage};
    use chrono::{DateTime, FixedOffset, TimeDelta};
    use study_base::text::{PartId, ParticipantId};

    fn now() -> DateTime<FixedOffset> {
        DateTime::parse_from_rfc3339("2026-03-10T09:00:00+01:00").unwrap()
    }

    /// The `n`th participant, who took part so many hours ago.
    fn person(n: u32, state: State, hours: i64) -> Person {
        Person {
            participant: ParticipantId::new(format!("P{n:02}")).unwrap(),
            kind: Reality::Real,
            row: Some(n),
            group: None,
            state,
            running: false,
            erased: false,
            session: 1,
            sessions_done: usize::from(state == State::Done),
            trials_done: 15,
            trials_planned: Some(15),
            last_activity: Some(now() - TimeDelta::hours(hours)),
            reason: String::new(),
            next: None,
        }
    }

    fn coming(due: Due, hours: i64) -> Option<Coming> {
        Some(Coming {
            session: PartId::new("two").unwrap(),
            due,
            from: now() + TimeDelta::hours(hours - 24),
            until: Some(now() + TimeDelta::hours(hours)),
        })
    }

    /// Forty participants, of whom the last but one is late and the last is running.
    fn many() -> Overview {
        let mut people: Vec<Person> = (1..=40).map(|n| person(n, State::Done, 100)).collect();
        people[38].next = coming(Due::Overdue, -5);
        people[39].state = State::Unfinished;
        people[39].running = true;
        people[3].next = coming(Due::Now, 20);
        people[4].next = coming(Due::Later, 40);
        people[5].state = State::Excluded;
        "did not \u{1b}[2J understand".clone_into(&mut people[5].reason);
        Overview {
            study: "spring".to_owned(),
            folder: "results/spring".to_owned(),
            protocol_version: 2,
            read_at: now(),
            planned: Some(48),
            sessions_each: Some(2),
            participants: people,
            rows: Rows {
                kept: 39,
                next: Some(6),
                freed: vec![6],
                twice: vec![7],
                beyond: Vec::new(),
            },
            groups: Vec::new(),
            last_activity: Some(now()),
            storage: Storage {
                free_bytes: Some(12_300_000_000),
                almost_full: false,
                mirror: Some(Mirror {
                    folder: "/media/usb/spring".to_owned(),
                    state: Copied::InStep,
                    differs: Vec::new(),
                }),
            },
            warnings: Vec::new(),
        }
    }

    #[test]
    fn it_fits_into_a_terminal_and_whoever_asks_for_somebody_comes_first() {
        for (columns, rows) in [(80, 22), (60, 18), (60, 12)] {
            let lines = within(&many(), columns, rows);
            assert!(lines.len() <= rows, "{columns} × {rows}: {}", lines.len());
            let fits = |line: &String| width(line) <= columns && !line.contains('\u{1b}');
            assert!(lines.iter().all(fits), "{lines:#?}");
            let place = |who: &str| lines.iter().position(|line| line.starts_with(who));
            assert!(place("OVERDUE: P39 session two until 2026-03-10 04:00").is_some());
            if rows > 12 {
                assert!(place("P40 ") < place("P39 "), "{lines:#?}");
                assert!(place("P40 ").is_some());
                assert!(
                    lines.last().unwrap().ends_with("more participants"),
                    "{lines:#?}"
                );
            }
        }
    }

    #[test]
    fn everybody_is_counted_once() {
        let mut study = many();
        // A second session that was void, and one that was left before its first page.
        study.participants[0].state = State::Void;
        study.participants[0].next = coming(Due::Now, 20);
        study.participants[1].state = State::Unfinished;
        study.participants[1].next = coming(Due::Now, 20);
        // A first session that was void.
        study.participants[2].state = State::Void;
        assert_eq!(
            counts(&study),
            "48 planned, 32 done, 5 to come again, 1 running now, 1 excluded, 1 void"
        );
        assert_eq!(32 + 5 + 1 + 1 + 1, study.participants.len());
    }

    #[test]
    fn printed_whole_nobody_and_nothing_is_left_out() {
        let lines = all(&many(), None);
        for line in [
            "spring · protocol version 2 · results/spring",
            "Read 2026-03-10 09:00 · last activity 2026-03-10 09:00",
            "Participants: 48 planned, 35 done, 3 to come again, 1 running now, 1 excluded",
            "Rows: 39 kept of 48 · next free 6 · free again: 6 · kept twice: 7",
            "Disk: 12 GB free · mirror /media/usb/spring: in step",
            "OVERDUE: P39 session two until 2026-03-10 04:00",
            "Due now: P04 session two until 2026-03-11 05:00",
            "Later: P05 session two from 2026-03-11 01:00",
            "Left out: P06 excluded (did not \\u{1b}[2J understand)",
        ] {
            assert!(lines.iter().any(|l| l == line), "{line}\n{lines:#?}");
        }
        let table = lines
            .iter()
            .filter(|line| line.starts_with('P') && line.contains("15/15"));
        assert_eq!(table.count(), 40);
    }
}
