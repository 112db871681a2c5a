//! `study status`, `verify`, `participant` and `amend`, as commands.

#![allow(clippy::unwrap_used)]

use crate::support::{copy_folder, study};
use crate::world::{at, real, session, telemetry};
use std::fs;
use std::path::{Path, PathBuf};
use study_session::outcome::Event;
use study_session::store::{Frozen, StudyFolder};
use tempfile::TempDir;

/// A study of the repository's protocol with a finished and an unfinished session.
pub(crate) fn turn_signal(results: &Path) -> PathBuf {
    let loaded = study_analysis::load::load(Path::new("protocols/turn-signal")).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let folder = StudyFolder::open_or_create(results, &frozen, at(0)).unwrap();
    for (id, count) in [("P01", 99), ("P02", 14)] {
        let mut claimed = folder.claim(&real(id)).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let mut events = session(id, 1, claimed.seat);
        if let Event::SessionStarted(start) = &mut events[0] {
            start.fingerprints = loaded.fingerprints.clone();
        }
        for (event, n) in events.iter().zip(0..).take(count) {
            journal.append(at(n), event).unwrap();
        }
        let taken = events.len().min(count);
        telemetry(claimed.folder.path(), &events[..taken]);
    }
    folder.refresh(&loaded.protocol).unwrap();
    folder.path().to_owned()
}

/// A results folder with that study, and a transcript of what commands say of it.
struct Desk {
    results: TempDir,
    folder: PathBuf,
    said: String,
}

impl Desk {
    fn new() -> Self {
        let results = tempfile::tempdir().unwrap();
        Self {
            folder: turn_signal(results.path()),
            results,
            said: String::new(),
        }
    }

    /// Runs `study` with these words, in the results folder: its exit code. The page of an
    /// analysis is not in the transcript, only that there is one.
    fn study(&mut self, line: &str) -> i32 {
        let words: Vec<&str> = line.split(' ').collect();
        let (code, out, err) = study(&words, self.results.path());
        let home = self.results.path().display().to_string();
        let page = line.starts_with("analyze") && out.contains("by subject");
        let out = if page { "(page)\n" } else { &out };
        let said = format!("{out}{err}").replace(&home, "HOME");
        self.said += &format!("$ study {line}\n{said}[{code}]\n\n");
        code
    }

    /// The same, of several lines.
    fn studies(&mut self, lines: &[&str]) {
        for line in lines {
            self.study(line);
        }
    }

    /// Says in the transcript what is done by hand.
    fn note(&mut self, what: &str) {
        self.said += &format!("# {what}\n");
    }

    /// The warnings of `analyze --json`, which go with this exit code.
    fn warnings(&self, code: i32) -> Vec<serde_json::Value> {
        let (got, out, err) = study(&["analyze", ".", "--json"], self.results.path());
        assert_eq!(got, code, "{err}");
        let json: serde_json::Value = serde_json::from_str(&out).unwrap();
        json["warnings"].as_array().unwrap().clone()
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.folder.join(name)).unwrap()
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.folder.join(name), text).unwrap();
    }

    /// Changes an answer in the journal of P01.
    fn falsify(&mut self) {
        self.note("an answer of P01 is changed in the journal");
        let text = self.read(JOURNAL);
        let other = text.replacen("{\"rating\":", "{\"rating\":1", 1);
        assert_ne!(text, other);
        self.write(JOURNAL, other);
    }
}

const JOURNAL: &str = "sessions/P01/1/journal.jsonl";

#[test]
fn status_tells_who_is_done_and_no_order() {
    let mut desk = Desk::new();
    desk.study("status .");
    insta::assert_snapshot!(desk.said);
}

#[test]
fn every_command_warns_of_a_changed_journal_and_an_altered_protocol() {
    let mut desk = Desk::new();
    desk.studies(&["verify .", "analyze . --out tables"]);
    assert!(!desk.said.contains("warning"), "{}", desk.said);
    desk.said.clear();
    desk.falsify();
    desk.note("and so is a word of the protocol that was frozen");
    let frozen = desk.read("protocol/1/protocol.toml");
    desk.write(
        "protocol/1/protocol.toml",
        frozen.replace("realistic", "plausible"),
    );
    desk.studies(&["verify .", "status .", "analyze . --out tables"]);
    insta::assert_snapshot!(desk.said);
    let of_journal = |w: &serde_json::Value| {
        w["code"] == "damaged-results" && w["text"].to_string().contains("sessions/P01/1")
    };
    assert!(desk.warnings(0).iter().any(of_journal));
}

/// The journal of P01 without its last lines.
fn truncate(folder: &Path, lines: usize) {
    let journal = folder.join(JOURNAL);
    let text = fs::read_to_string(&journal).unwrap();
    let all: Vec<&str> = text.split_inclusive('\n').collect();
    fs::write(&journal, all[..all.len() - lines].concat()).unwrap();
}

#[test]
fn a_journal_without_its_last_lines_is_told_by_every_command() {
    for lines in [1, 5] {
        let mut desk = Desk::new();
        truncate(&desk.folder, lines);
        desk.studies(&["verify .", "status .", "analyze . --out tables"]);
        insta::assert_snapshot!(format!("a_journal_without_its_last_{lines}"), desk.said);
        assert_eq!(desk.warnings(4)[0]["code"], "damaged-results");
    }
}

/// It was written before there were heads.
#[test]
fn a_journal_of_an_earlier_release_is_reported_as_not_protected() {
    let mut desk = Desk::new();
    for id in ["P01", "P02"] {
        let head = format!("sessions/{id}/1/head.json");
        fs::remove_file(desk.folder.join(head)).unwrap();
    }
    desk.note("the heads of P01 and P02 are removed");
    desk.study("verify .");
    insta::assert_snapshot!(desk.said);
    let example = crate::support::repository("results/turn-signal-example");
    let (code, out, err) = study(&["verify", &example], desk.results.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("10 journals of an earlier release"), "{out}");
}

#[test]
fn verify_finds_each_difference_from_a_copy() {
    let mut desk = Desk::new();
    let copy = desk.results.path().join("copies/turn-signal");
    fs::create_dir(desk.results.path().join("copies")).unwrap();
    copy_folder(&desk.folder, &copy);
    fs::create_dir(desk.results.path().join("empty")).unwrap();
    for place in ["copies", "copies/turn-signal"] {
        assert_eq!(
            desk.study(&format!("verify turn-signal --against {place}")),
            0
        );
    }
    desk.said.clear();
    desk.study("verify turn-signal --against empty");
    desk.note("the copy has a line less, no telemetry of P02 and notes");
    truncate(&copy, 1);
    fs::remove_dir_all(copy.join("sessions/P02/1/telemetry")).unwrap();
    fs::write(copy.join("sessions/P02/1/notes.txt"), "x").unwrap();
    desk.study("verify turn-signal --against copies/turn-signal");
    insta::assert_snapshot!(desk.said);
}

#[test]
fn participant_sets_a_state_and_refuses_what_is_no_id() {
    let mut desk = Desk::new();
    let set = |desk: &mut Desk, id: &str, state: &str| {
        desk.study(&format!(
            "participant . {id} --state {state} --reason \u{1b}[2J"
        ));
    };
    set(&mut desk, "../../x", "excluded");
    set(&mut desk, "P03", "excluded");
    set(&mut desk, "P02", "dropped-out");
    set(&mut desk, "P01", "withdrawn --erase --yes");
    desk.studies(&["status .", "verify turn-signal"]);
    let said = desk.said.replace("reason \u{1b}", "reason ESC");
    assert!(!said.contains('\u{1b}'), "{said:?}");
    insta::assert_snapshot!(without_times(&said));
    assert!(desk.read("participants.csv").contains("P02,1,dropped-out,"));
}

/// A transcript without the times of now.
fn without_times(said: &str) -> String {
    let mut text = String::new();
    let mut rest = said;
    while let Some(at) = rest.find(" 20").filter(|at| rest[*at..].len() > 9) {
        let (before, after) = rest.split_at(at + 1);
        text += before;
        let time = |c: char| c.is_ascii_digit() || "-+:.T ".contains(c);
        let end = after.find(|c| !time(c)).unwrap_or(after.len());
        let told = after[..end].trim_end_matches([' ', '.', ':']);
        text += if told.len() >= 10 { "TIME" } else { told };
        rest = &after[told.len()..];
    }
    text + rest
}

#[test]
fn erasing_leaves_nothing_in_the_analysis_and_says_so_twice() {
    let mut desk = Desk::new();
    assert_eq!(desk.study("analyze ."), 0);
    assert!(desk.read("analysis/ratings_used.csv").contains("P01"));
    desk.said.clear();
    let erase = |desk: &mut Desk, state: &str| {
        desk.study(&format!(
            "participant . P01 --state {state} --reason asked --erase --yes"
        ))
    };
    assert_eq!(erase(&mut desk, "excluded"), 1);
    assert!(desk.folder.join(JOURNAL).exists());
    assert_eq!(erase(&mut desk, "withdrawn"), 0);
    assert!(!desk.folder.join("analysis").exists());
    erase(&mut desk, "withdrawn");
    insta::assert_snapshot!(without_times(&desk.said));
}

#[test]
fn a_session_that_is_gone_is_told_and_not_dropped_unasked() {
    let mut desk = Desk::new();
    desk.note("the folder of P02 is removed");
    fs::remove_dir_all(desk.folder.join("sessions/P02")).unwrap();
    desk.studies(&["verify .", "analyze . --out tables", "verify . --rebuild"]);
    assert!(desk.read("participants.csv").contains("P02"));
    desk.studies(&[
        "verify . --drop-missing",
        "verify . --rebuild --drop-missing",
    ]);
    assert!(!desk.read("participants.csv").contains("P02"));
    // A journal that is gone from a folder that stayed is the same.
    desk.note("the journal of P01 is removed");
    fs::remove_file(desk.folder.join(JOURNAL)).unwrap();
    desk.study("verify .");
    insta::assert_snapshot!(desk.said);
}

#[test]
fn verify_misses_telemetry_that_the_journal_counts_and_says_what_it_does_not_check() {
    let mut desk = Desk::new();
    desk.study("verify .");
    let file = "sessions/P01/1/telemetry/002-a1.csv";
    let whole = desk.read(file);
    desk.note("without its last 20 bytes");
    desk.write(file, &whole[..whole.len() - 20]);
    desk.study("verify .");
    desk.note("another file in its place");
    desk.write(
        file,
        "somebody's notes, longer than the header of a telemetry file\n",
    );
    desk.study("verify .");
    desk.note("removed");
    fs::remove_file(desk.folder.join(file)).unwrap();
    desk.study("verify .");
    insta::assert_snapshot!(desk.said);
}

/// Every file of a new study has its checksum: nothing is said to be left out but what is there and
/// is not checked.
#[test]
fn verify_of_a_new_study_says_that_something_is_not_checked_only_where_it_is() {
    let results = tempfile::tempdir().unwrap();
    let folder = results.path();
    let protocol = crate::support::repository("protocols/turn-signal");
    let run = |words: &[&str], code: i32| {
        let (got, out, err) = study(words, folder);
        assert_eq!(got, code, "{out}{err}");
        out
    };
    let verify = |code| {
        let out = run(&["verify", "new"], code);
        let lines = out.lines().filter(|line| line.starts_with("Not checked"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let rehearse = [
        "rehearse",
        protocol.as_str(),
        "--participants",
        "2",
        "--out",
        "new",
    ];
    run(&rehearse, 0);
    assert_eq!(verify(0), [""; 0]);
    run(&["analyze", "new"], 0);
    let analysis = "Not checked: analysis/, which `study analyze` writes again.";
    assert_eq!(verify(0), [analysis]);
    fs::write(folder.join("new/turn-signal/protocol/1/protocol.toml"), "x").unwrap();
    let tables = "Not checked: the derived tables, tracks, searches, ends of practice and steps of adjustments, because the frozen protocol cannot be read.";
    assert_eq!(verify(4), [tables, analysis]);
}

#[test]
fn an_analysis_is_printed_although_its_tables_have_no_place() {
    let mut desk = Desk::new();
    // A file in the place of the folder stops root too, which no permission does.
    desk.write("analysis", "in the way");
    desk.studies(&["analyze .", "analyze . --out turn-signal/analysis"]);
    insta::assert_snapshot!(desk.said);
}

#[test]
fn amend_keeps_the_old_version_and_refuses_other_stimuli() {
    let mut desk = Desk::new();
    let own = desk.results.path().join("own");
    let shipped = crate::support::repository("protocols/turn-signal");
    copy_folder(Path::new(&shipped), &own);
    let file = own.join("protocol.toml");
    let text = fs::read_to_string(&file).unwrap();
    let with = |old: &str, new: &str| {
        assert!(text.contains(old));
        fs::write(&file, text.replace(old, new)).unwrap();
    };
    let amend = "amend turn-signal own/protocol.toml --reason clearer";
    desk.study(amend);
    with("reference = \"", "reference = \"Please: ");
    desk.study(amend);
    assert!(desk.folder.join("protocol/1/protocol.toml").exists());
    assert!(desk.folder.join("protocol/2/protocol.toml").exists());
    with("repetitions = 3", "repetitions = 4");
    desk.studies(&[
        amend,
        // and so does `run`
        "run own/protocol.toml --results .",
        "verify turn-signal",
    ]);
    insta::assert_snapshot!(desk.said);
}

#[test]
fn a_folder_that_is_none_or_of_a_newer_version_is_refused() {
    let mut desk = Desk::new();
    fs::create_dir(desk.results.path().join("empty")).unwrap();
    desk.studies(&["status empty", "verify empty"]);
    let manifest = desk.read("study.json");
    desk.write(
        "study.json",
        manifest.replace("study-results/1", "study-results/2"),
    );
    desk.studies(&["status turn-signal", "verify turn-signal"]);
    insta::assert_snapshot!(desk.said);
}

/// An exclusion and a drop-out are taken back by another record; nothing is rewritten.
#[test]
fn a_participant_is_reinstated() {
    let mut desk = Desk::new();
    let ratings = |desk: &Desk| {
        let (_, out, _) = study(&["analyze", ".", "--json"], desk.results.path());
        let json: serde_json::Value = serde_json::from_str(&out).unwrap();
        json["counts"]["rated"].as_u64().unwrap()
    };
    let before = ratings(&desk);
    let journal = |desk: &Desk, id: &str| {
        let session = desk.folder.join("sessions").join(id).join("1");
        let names = ["journal.jsonl", "journal-2.jsonl", "journal-3.jsonl"];
        names
            .map(|name| fs::read_to_string(session.join(name)).unwrap_or_default())
            .concat()
    };
    let set = |desk: &mut Desk, id: &str, state: &str| {
        desk.study(&format!("participant . {id} --state {state} --reason slip"))
    };
    // nothing to take back
    set(&mut desk, "P01", "reinstated");
    for (id, away) in [("P01", "excluded"), ("P02", "dropped-out")] {
        set(&mut desk, id, away);
        let old = journal(&desk, id);
        set(&mut desk, id, "reinstated");
        let new = journal(&desk, id);
        assert!(new.starts_with(&old) && new.len() > old.len());
    }
    assert_eq!(ratings(&desk), before);
    desk.study("verify .");
    // the row went to somebody else in the meantime
    set(&mut desk, "P02", "dropped-out");
    let folder = StudyFolder::open(&desk.folder).unwrap();
    assert_eq!(folder.claim(&real("P03")).unwrap().seat.row(), Some(2));
    desk.note("P03 takes row 2");
    // whoever withdrew stays away
    for state in ["reinstated", "withdrawn", "reinstated"] {
        set(&mut desk, "P02", state);
    }
    insta::assert_snapshot!(desk.said);
}
