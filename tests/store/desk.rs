//! `study desk`: who has done what and who comes when, beside sessions, without a realization or an
//! answer.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::json_schema::check;
use crate::support::{Terminal, changed_protocol, copy_folder, repository, study};
use crate::world::{at, request, session};
use chrono::{DateTime, FixedOffset, TimeDelta};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::load::{Loaded, load};
use study_base::text::{PartId, ParticipantId};
use study_session::outcome::{Event, State};
use study_session::store::{
    ClaimRequest, Claimed, Frozen, Plan, SeatKind, StateRequest, StudyFolder,
};

/// The protocol of the turn signal in two sessions: the second one 24 to 72 h after the first.
fn two_sessions(folder: &Path) -> Loaded {
    let more = r#"
[[parts]]
id = "real"
kind = "rating"
repetitions = 2

[[sessions]]
id = "one"
[[sessions]]
id = "two"
min_gap_h = 24
max_gap_h = 72

# Asked after"#;
    let changes = [
        ("study-protocol/1", "study-protocol/2"),
        ("repetitions = 3\n", ""),
        ("order = \"blocked\"\n", ""),
        ("# Asked after", more),
    ];
    changed_protocol("turn-signal", folder, &changes);
    load(folder).unwrap()
}

/// The same protocol in two groups, of which one rates fewer realizations.
fn in_groups(folder: &Path, assign: &str) -> Loaded {
    let more = format!(
        r#"
[[parts]]
id = "real"
kind = "rating"
repetitions = 2

[groups]
assign = "{assign}"
[[groups.list]]
id = "everything"
[[groups.list]]
id = "fewer"
models = ["lambda-0.9991", "lambda-0.9995"]

# Asked after"#
    );
    let changes = [
        ("study-protocol/1", "study-protocol/2"),
        ("repetitions = 3\n", ""),
        ("order = \"blocked\"\n", ""),
        ("# Asked after", more.as_str()),
    ];
    changed_protocol("turn-signal", folder, &changes);
    load(folder).unwrap()
}

/// A study whose sessions took place in March 2007.
struct Old {
    home: tempfile::TempDir,
    study: StudyFolder,
    loaded: Loaded,
}

impl Old {
    fn new() -> Self {
        Self::of(two_sessions)
    }

    fn of(protocol: impl FnOnce(&Path) -> Loaded) -> Self {
        let home = tempfile::tempdir().unwrap();
        let loaded = protocol(&home.path().join("protocol"));
        let results = home.path().join("results");
        let study = StudyFolder::open_or_create(&results, &frozen(&loaded), at(0)).unwrap();
        Self {
            home,
            study,
            loaded,
        }
    }

    fn claim(&self, id: &str, kind: SeatKind) -> Claimed {
        let plan = Plan::of(&self.loaded.protocol, None, at(0).wall);
        let claim = ClaimRequest {
            plan,
            ..request(id, kind)
        };
        self.study.claim(&claim).unwrap()
    }

    /// A session with its first `count` events, each of which `change` may change.
    fn run(&self, id: &str, kind: SeatKind, count: usize, change: impl Fn(Event) -> Event) {
        let mut claimed = self.claim(id, kind);
        let mut journal = claimed.folder.journal().unwrap();
        let events = session(id, claimed.session, claimed.seat);
        for (event, n) in events.into_iter().zip(0..).take(count) {
            let mut event = change(event);
            if let Event::SessionStarted(start) = &mut event {
                start.fingerprints = self.loaded.fingerprints.clone();
            }
            journal.append(at(n), &event).unwrap();
        }
    }

    fn set(&self, id: &str, state: State, reason: &str) {
        let request = StateRequest {
            participant: ParticipantId::new(id).unwrap(),
            state,
            reason: reason.to_owned(),
            erase: false,
        };
        self.study.set_state(&request, at(9_000)).unwrap();
    }

    /// What the command prints with these options: exit code, both streams.
    fn desk(&self, options: &[&str]) -> (i32, String, String) {
        let words = [&["desk", "results"][..], options].concat();
        study(&words, self.home.path())
    }

    fn json(&self, options: &[&str]) -> Value {
        let (code, out, err) = self.desk(&[&["--json"][..], options].concat());
        assert_eq!(code, 0, "{err}");
        described(&out)
    }
}

fn frozen(loaded: &Loaded) -> Frozen<'_> {
    Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    }
}

/// All events.
const WHOLE: usize = usize::MAX;

/// Four people of whom one is late, one is under way, one was excluded and one did not come; a pilot
/// and a simulated participant.
fn mixed() -> Old {
    let old = Old::new();
    let same = |event: Event| event;
    old.run("P01", SeatKind::Real, WHOLE, same);
    old.run("P02", SeatKind::Real, 14, same);
    old.run("P03", SeatKind::Real, WHOLE, same);
    old.run("X1", SeatKind::Pilot, WHOLE, same);
    old.run("SIM001", SeatKind::Simulated, 14, same);
    old.set("P03", State::Excluded, "spoke of \u{1b}[2J the device");
    old.set("P04", State::NoShow, "was ill");
    old
}

/// The document, which the schema describes.
fn described(out: &str) -> Value {
    let document: Value = serde_json::from_str(out).unwrap();
    let schema = fs::read_to_string(repository("docs/study-desk-1.schema.json")).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    check(&schema, &schema, &document, "").unwrap();
    document
}

fn person<'a>(document: &'a Value, id: &str) -> &'a Value {
    let people = document["studies"][0]["participants"].as_array().unwrap();
    people.iter().find(|p| p["participant"] == id).unwrap()
}

fn time(value: &Value) -> DateTime<FixedOffset> {
    DateTime::parse_from_rfc3339(value.as_str().unwrap()).unwrap()
}

#[test]
fn who_is_overdue_is_named_with_the_date() {
    let old = mixed();
    let document = old.json(&[]);
    let first = person(&document, "P01");
    assert_eq!(first["next"]["session"], "two");
    assert_eq!(first["next"]["due"], "overdue");
    // The window counts from the last event of the session before.
    let ended = time(&first["last_activity"]);
    assert_eq!(time(&first["next"]["from"]), ended + TimeDelta::hours(24));
    assert_eq!(time(&first["next"]["until"]), ended + TimeDelta::hours(72));
    let (code, out, err) = old.desk(&[]);
    assert_eq!((code, err.as_str()), (0, ""));
    // The session of world::session ends within a minute after ten o'clock.
    assert!(
        out.contains("OVERDUE: P01 session two until 2007-03-25 10:00; X1 session two until 2007-03-25 10:00 [pilot]"),
        "{out}"
    );
    // Whoever is under way, has left or is nobody comes for no other session.
    for id in ["P02", "P03", "P04", "SIM001"] {
        assert_eq!(person(&document, id)["next"], Value::Null, "{id}");
    }
}

#[test]
fn real_participants_pilots_and_simulations_are_told_apart_and_so_are_their_states() {
    let old = mixed();
    let document = old.json(&[]);
    let of = |id: &str, key: &str| person(&document, id)[key].clone();
    for (id, kind, state, row) in [
        ("P01", "real", "done", Value::from(1)),
        ("P02", "real", "unfinished", Value::from(2)),
        ("P03", "real", "excluded", Value::from(3)),
        ("P04", "real", "no-show", Value::Null),
        ("X1", "pilot", "done", Value::Null),
        ("SIM001", "simulated", "unfinished", Value::Null),
    ] {
        assert_eq!(of(id, "kind"), kind, "{id}");
        assert_eq!(of(id, "state"), state, "{id}");
        assert_eq!(of(id, "row"), row, "{id}");
    }
    assert_eq!(of("P01", "sessions_done"), 1);
    let own = &document["studies"][0];
    assert_eq!(own["sessions_each"], 2);
    assert_eq!(own["planned"], 10);
    // The row of P03 is free again, and is the next.
    assert_eq!(own["rows"]["kept"], 2);
    assert_eq!(own["rows"]["next"], 3);
    let (_, out, _) = old.desk(&[]);
    assert!(
        out.contains(
            "Participants: 10 planned, 1 to come again, 1 unfinished, 1 no-show, 1 excluded\n\
             Not real: 1 pilot, 1 simulated\nRows: 2 kept of 10 · next free 3\n"
        ),
        "{out}"
    );
    assert!(out.contains("P04 no-show (was ill)"), "{out}");
    // What somebody typed does not steer the terminal.
    assert!(
        !out.contains('\u{1b}') && out.contains("[2J the device"),
        "{out}"
    );
}

/// The same hand, other realizations and other answers: the same desk.
#[test]
fn no_realization_no_answer_and_no_order_is_on_the_desk() {
    let swapped = |from: &str, to: &str| {
        let (from, to) = (format!("\"{from}\""), format!("\"{to}\""));
        move |event: Event| {
            let text = serde_json::to_string(&event).unwrap();
            let text = text.replace(&from, "\"?\"").replace(&to, &from);
            let text = text
                .replace("\"?\"", &to)
                .replace("{\"rating\":6}", "{\"rating\":2}");
            let text = text.replace("{\"rating\":4}", "{\"rating\":7}");
            serde_json::from_str::<Event>(&text).unwrap()
        }
    };
    let looks = |change: &dyn Fn(Event) -> Event| {
        let old = Old::new();
        for (id, count) in [("P01", WHOLE), ("P02", 14), ("P03", 20)] {
            old.run(id, SeatKind::Real, count, change);
        }
        let mut document = old.json(&[]);
        let own = document["studies"][0].as_object_mut().unwrap();
        for key in ["read_at", "folder", "storage"] {
            own.remove(key).unwrap();
        }
        let (_, out, _) = old.desk(&[]);
        let changes = |line: &&str| !line.starts_with("Read ") && !line.starts_with("Disk: ");
        let lines: Vec<&str> = out.lines().filter(changes).collect();
        (document.to_string(), lines.join("\n"))
    };
    let plain = looks(&|event| event);
    // That the change changes something.
    let event = session("P01", 1, study_plan::protocol::Seat::Row(1)).remove(3);
    assert_ne!(swapped("A", "B")(event.clone()), event);
    for (from, to) in [("A", "B"), ("B", "C"), ("A", "C")] {
        assert_eq!(looks(&swapped(from, to)), plain, "{from} and {to}");
    }
    for secret in ["lambda", "realism", "rating", "\"A\"", "felt nothing"] {
        assert!(
            !plain.0.contains(secret) && !plain.1.contains(secret),
            "{secret}"
        );
    }
}

/// A group can have realizations of its own. Who gives it knows it; where the row decides, nobody reads it here.
#[test]
fn a_group_is_named_only_where_the_experimenter_gives_it() {
    for (assign, given) in [("given", true), ("row", false)] {
        let old = Old::of(|folder| in_groups(folder, assign));
        let fewer = PartId::new("fewer").unwrap();
        let group = given.then(|| fewer.clone());
        let claim = ClaimRequest {
            plan: Plan::of(&old.loaded.protocol, group, at(0).wall),
            ..request("P01", SeatKind::Real)
        };
        let mut claimed = old.study.claim(&claim).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let events = session("P01", 1, claimed.seat);
        for (mut event, n) in events.into_iter().zip(0..).take(14) {
            if let Event::SessionStarted(start) = &mut event {
                start.fingerprints = old.loaded.fingerprints.clone();
                start.assigned.group = Some(fewer.clone());
            }
            journal.append(at(n), &event).unwrap();
        }
        drop((journal, claimed));
        let document = old.json(&[]);
        let (_, out, _) = old.desk(&[]);
        let groups = match given {
            true => serde_json::json!([
                {"group": "everything", "participants": 0},
                {"group": "fewer", "participants": 1}
            ]),
            false => serde_json::json!([]),
        };
        assert_eq!(document["studies"][0]["groups"], groups);
        let named = &person(&document, "P01")["group"];
        assert_eq!(named.as_str(), given.then_some("fewer"));
        assert_eq!(out.contains("fewer"), given, "{out}");
    }
}

/// Names, bytes and times of change of all files.
fn files(folder: &Path) -> BTreeMap<PathBuf, (Vec<u8>, std::time::SystemTime)> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let changed = path.metadata().unwrap().modified().unwrap();
                found.insert(path.clone(), (fs::read(&path).unwrap(), changed));
            }
        }
    }
    found
}

#[test]
fn beside_a_running_session_it_says_so_and_only_reads() {
    let old = mixed();
    let mut claimed = old.claim("P05", SeatKind::Real);
    let mut journal = claimed.folder.journal().unwrap();
    let events = session("P05", 1, claimed.seat);
    for (event, n) in events.iter().zip(0..).take(9) {
        let mut event = event.clone();
        if let Event::SessionStarted(start) = &mut event {
            start.fingerprints = old.loaded.fingerprints.clone();
        }
        journal.append(at(n), &event).unwrap();
    }
    let before = files(old.study.path());
    let document = old.json(&[]);
    assert_eq!(person(&document, "P05")["running"], true);
    assert_eq!(person(&document, "P02")["running"], false);
    assert_eq!(
        document["studies"][0]["warnings"].as_array().unwrap().len(),
        0
    );
    assert!(before == files(old.study.path()), "something was written");
    // The session goes on.
    journal.append(at(10), &events[9]).unwrap();
    drop((journal, claimed));
    let document = old.json(&[]);
    assert_eq!(person(&document, "P05")["running"], false);
}

#[test]
fn the_state_of_the_mirror_is_told() {
    let old = Old::new();
    let mirror = old.home.path().join("mirror");
    fs::create_dir(&mirror).unwrap();
    let state = |old: &Old| {
        let document = old.json(&["--mirror", "mirror"]);
        document["studies"][0]["storage"]["mirror"].clone()
    };
    assert_eq!(state(&old)["state"], "missing");
    old.run("P01", SeatKind::Real, 14, |event| event);
    copy_folder(old.study.path(), &mirror.join("turn-signal"));
    assert_eq!(state(&old)["state"], "in-step");
    // Without the mirror.
    old.run("P02", SeatKind::Real, 14, |event| event);
    let told = state(&old);
    assert_eq!(told["state"], "apart");
    assert_eq!(told["differs"], serde_json::json!(["P02/1"]));
    let (_, out, _) = old.desk(&["--mirror", "mirror"]);
    assert!(out.contains("NOT IN STEP: P02/1"), "{out}");
    fs::write(mirror.join("turn-signal/study.json"), "nonsense").unwrap();
    assert_eq!(state(&old)["state"], "unreadable");
    let (_, out, _) = old.desk(&[]);
    assert!(out.contains(" · no mirror\n"), "{out}");
}

#[test]
fn the_example_of_the_repository_is_of_simulated_participants() {
    let example = repository("results/turn-signal-example");
    let (code, out, err) = study(&["desk", &example, "--json"], Path::new("."));
    assert_eq!(code, 0, "{err}");
    let document = described(&out);
    let people = document["studies"][0]["participants"].as_array().unwrap();
    assert!(people.len() >= 10);
    for person in people {
        assert_eq!(person["kind"], "simulated");
        assert_eq!(person["row"], Value::Null);
    }
    assert_eq!(document["studies"][0]["rows"]["kept"], 0);
    let (code, out, err) = study(&["desk", &example], Path::new("."));
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains(&format!("Not real: {} simulated\n", people.len())),
        "{out}"
    );
    assert!(out.contains("SIM001 [simulated]"), "{out}");
}

#[test]
fn a_folder_that_is_none_and_one_that_is_broken_are_refused_in_a_sentence() {
    let home = tempfile::tempdir().unwrap();
    fs::create_dir(home.path().join("empty")).unwrap();
    let broken = home.path().join("broken");
    fs::create_dir(&broken).unwrap();
    fs::write(broken.join("study.json"), "nonsense").unwrap();
    for folder in ["empty", "nowhere", "broken"] {
        for option in ["--json", "--watch"] {
            let (code, out, err) = study(&["desk", folder, option], home.path());
            assert_eq!(code, 4, "{folder}");
            assert_eq!(out, "", "{folder}");
            assert!(
                err.starts_with(&format!("error: {folder}")),
                "{folder}: {err}"
            );
        }
    }
    // A frozen protocol that cannot be read keeps nobody from seeing who has taken part.
    let old = mixed();
    fs::write(
        old.study.path().join("protocol/1/protocol.toml"),
        "nonsense",
    )
    .unwrap();
    let (code, out, err) = old.desk(&[]);
    assert_eq!(code, 0, "{err}");
    assert!(
        err.contains("warning: ") && err.contains("study verify"),
        "{err}"
    );
    assert!(out.contains("DAMAGE: ") && out.contains("P01 "), "{out}");
    assert!(
        out.contains("Participants: the protocol cannot be read, 1 done"),
        "{out}"
    );
}

#[test]
fn without_a_terminal_nothing_is_watched() {
    let old = mixed();
    let (code, _, err) = old.desk(&["--watch"]);
    assert_eq!(code, 2);
    assert!(err.contains("--watch needs a terminal"), "{err}");
    let (code, ..) = old.desk(&["--watch", "--json"]);
    assert_eq!(code, 2);
}

#[test]
fn in_a_terminal_it_is_drawn_again_until_q() {
    let old = mixed();
    for (rows, columns) in [(24, 80), (20, 60)] {
        let words = ["desk", "results", "--watch"];
        let mut terminal = Terminal::start(&words, old.home.path(), rows, columns);
        terminal.wait_for("q: quit");
        let shown = terminal.screen();
        // What asks for somebody is there whatever the size, and so is whoever is late.
        for what in ["OVERDUE: P01", "participant", "Disk: ", "Rows: 2 kept"] {
            assert!(shown.contains(what), "{columns}×{rows}: {what}\n{shown}");
        }
        let late = shown
            .lines()
            .position(|line| line.starts_with("P01 "))
            .unwrap();
        let other = shown.lines().position(|line| line.starts_with("P04 "));
        assert!(other.is_none_or(|other| late < other), "{shown}");
        assert!(terminal.alternate());
        terminal.keys("q");
        assert_eq!(terminal.exit_code(), 0);
        assert!(!terminal.alternate());
    }
    // A terminal that becomes smaller gets a smaller page, with what asks for somebody and the key.
    let mut terminal = Terminal::start(&["desk", "results", "--watch"], old.home.path(), 24, 80);
    terminal.wait_for("q: quit");
    terminal.resize(20, 60);
    terminal.wait_until("a page of 20 rows", |screen| {
        let lines: Vec<&str> = screen.trim_end().lines().collect();
        let fits = lines.len() <= 20 && screen.contains("OVERDUE: P01");
        fits && lines.last().is_some_and(|line| line.starts_with("q: quit"))
    });
    terminal.keys("q");
    assert_eq!(terminal.exit_code(), 0);
    // Somebody who begins meanwhile appears.
    let mut terminal = Terminal::start(&["desk", "results", "--watch"], old.home.path(), 24, 80);
    terminal.wait_for("1 unfinished");
    old.run("P07", SeatKind::Real, 9, |event| event);
    terminal.wait_for("2 unfinished");
    // A folder that is gone is said, and what was read last stays.
    fs::rename(old.study.path(), old.home.path().join("elsewhere")).unwrap();
    terminal.wait_for("CANNOT BE READ NOW: ");
    assert!(terminal.screen().contains("OVERDUE: P01"));
    terminal.keys("\u{3}");
    assert_eq!(terminal.exit_code(), 0);
}
