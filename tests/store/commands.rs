//! `study status`, `verify`, `participant` and `amend`, as commands.

#![allow(clippy::unwrap_used)]

use crate::world::{at, real, session, telemetry};
use assert_cmd::Command;
use predicates::prelude::*;
use std::path::{Path, PathBuf};
use study_core::outcome::Event;
use study_core::store::{Frozen, StudyFolder};

/// A study of the repository's protocol with a finished and an unfinished session.
pub(crate) fn turn_signal(results: &Path) -> PathBuf {
    let loaded = study::cli::load::load(Path::new("protocols/turn-signal")).unwrap();
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

pub(crate) fn study_command() -> Command {
    Command::cargo_bin("study").unwrap()
}

#[test]
fn status_tells_who_is_done_and_no_order() {
    let results = tempfile::tempdir().unwrap();
    turn_signal(results.path());
    let said = study_command()
        .arg("status")
        .arg(results.path())
        .assert()
        .success();
    let text = String::from_utf8(said.get_output().stdout.clone()).unwrap();
    for part in [
        "P01",
        "done",
        "3/3",
        "P02",
        "unfinished",
        "1/3",
        "10 planned",
        "Next free row: 3",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    assert!(!text.contains("lambda"), "{text}");
}

#[test]
fn verify_is_content_until_a_bit_flips() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    study_command()
        .arg("verify")
        .arg(results.path())
        .assert()
        .success();
    let journal = folder.join("sessions/P01/1/journal.jsonl");
    let mut bytes = std::fs::read(&journal).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&journal, bytes).unwrap();
    study_command()
        .arg("verify")
        .arg(results.path())
        .assert()
        .code(4)
        .stdout(predicate::str::contains(
            "sessions/P01/1: journal.jsonl, line",
        ));
}

#[test]
fn analyze_and_status_warn_of_a_damaged_journal_and_an_altered_protocol() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    for command in ["status", "analyze"] {
        study_command()
            .arg(command)
            .arg(results.path())
            .assert()
            .success()
            .stderr(predicate::str::contains("warning").not());
    }
    let journal = folder.join("sessions/P01/1/journal.jsonl");
    let mut bytes = std::fs::read(&journal).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&journal, bytes).unwrap();
    let frozen = folder.join("protocol/1/protocol.toml");
    let text = std::fs::read_to_string(&frozen).unwrap();
    std::fs::write(&frozen, text.replace("realistic", "plausible")).unwrap();
    let journal = predicate::str::contains("sessions/P01/1: journal.jsonl, line");
    let protocol = predicate::str::contains("protocol/1/protocol.toml: not the file");
    for command in ["status", "analyze"] {
        study_command()
            .arg(command)
            .arg(results.path())
            .assert()
            .success()
            .stderr(journal.clone())
            .stderr(protocol.clone())
            .stderr(predicate::str::contains("hint: `study verify"));
    }
    let said = study_command()
        .args(["analyze", "--json"])
        .arg(results.path())
        .assert()
        .success();
    let json: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).unwrap();
    let told = json["warnings"].as_array().unwrap().iter().any(|w| {
        w["code"] == "damaged-results" && w["text"].as_str().unwrap().contains("sessions/P01/1")
    });
    assert!(told, "{}", json["warnings"]);
}

/// The journal of P01 without its last lines.
fn truncate(folder: &Path, lines: usize) {
    let journal = folder.join("sessions/P01/1/journal.jsonl");
    let text = std::fs::read_to_string(&journal).unwrap();
    let all: Vec<&str> = text.split_inclusive('\n').collect();
    std::fs::write(&journal, all[..all.len() - lines].concat()).unwrap();
}

#[test]
fn a_journal_without_its_last_lines_is_told_by_every_command() {
    for lines in [1, 5] {
        let results = tempfile::tempdir().unwrap();
        let folder = turn_signal(results.path());
        truncate(&folder, lines);
        let said = predicate::str::is_match(
            "sessions/P01/1: journal.jsonl, line [0-9]+: the journal is truncated: record",
        )
        .unwrap();
        for command in ["status", "analyze"] {
            study_command()
                .arg(command)
                .arg(results.path())
                .assert()
                .code(4)
                .stdout(predicate::str::contains("P01").or(predicate::str::contains("ratings")))
                .stderr(said.clone())
                .stderr(predicate::str::contains("the journal of P01 is truncated"));
        }
        let printed = study_command()
            .args(["analyze", "--json"])
            .arg(results.path())
            .assert()
            .code(4);
        let json: serde_json::Value = serde_json::from_slice(&printed.get_output().stdout).unwrap();
        assert_eq!(json["warnings"][0]["code"], "damaged-results");
        study_command()
            .arg("verify")
            .arg(results.path())
            .assert()
            .code(4)
            .stdout(said);
    }
}

/// It was written before there were heads.
#[test]
fn a_journal_of_an_earlier_release_is_reported_as_not_protected() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    for id in ["P01", "P02"] {
        let session = folder.join("sessions").join(id).join("1");
        std::fs::remove_file(session.join("head.json")).unwrap();
    }
    let verify = |code| {
        let mut command = study_command();
        command.arg("verify").arg(results.path());
        command.assert().code(code)
    };
    verify(4).stdout(predicate::str::contains("sessions/P01/1: head.json: missing").count(1));
    study_command()
        .args(["verify", "results/turn-signal-example"])
        .assert()
        .success()
        .stdout(predicate::str::contains(
            "note: results/turn-signal-example/sessions: 10 journals of an earlier release",
        ));
}

#[test]
fn verify_finds_each_difference_from_a_copy() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let copies = tempfile::tempdir().unwrap();
    let copy = copies.path().join("turn-signal");
    crate::support::copy_folder(&folder, &copy);
    let against = |dir: &Path| {
        let mut command = study_command();
        command.arg("verify").arg(results.path());
        command.arg("--against").arg(dir).assert()
    };
    against(copies.path()).success();
    against(&copy).success();
    against(results.path().parent().unwrap())
        .code(4)
        .stderr(predicate::str::contains("contains no copy of the study"));
    truncate(&copy, 1);
    std::fs::remove_dir_all(copy.join("sessions/P02/1/telemetry")).unwrap();
    std::fs::write(copy.join("sessions/P02/1/notes.txt"), "x").unwrap();
    against(&copy)
        .code(4)
        .stdout(predicate::str::contains(
            "sessions/P01/1/journal.jsonl: the last ",
        ))
        .stdout(predicate::str::contains(
            "sessions/P02/1/telemetry: missing in the copy",
        ))
        .stdout(predicate::str::contains(
            "sessions/P02/1/notes.txt: only in the copy",
        ))
        .stdout(predicate::str::contains("problem: ").count(3));
}

#[test]
fn participant_sets_a_state_and_refuses_what_is_no_id() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let set = |id: &str, state: &str| {
        let mut command = study_command();
        command.arg("participant").arg(results.path()).arg(id);
        command.args(["--state", state, "--reason", "test \u{1b}[2J"]);
        command
    };
    set("../../x", "excluded")
        .assert()
        .code(1)
        .stderr(predicate::str::contains("is not a participant id"));
    set("P03", "excluded")
        .assert()
        .code(1)
        .stderr(predicate::str::contains("no participant `P03`"));
    set("P02", "dropped-out")
        .assert()
        .success()
        .stdout(predicate::str::contains(
            "Row 2 is assigned to the next participant",
        ));
    set("P01", "withdrawn")
        .args(["--erase", "--yes"])
        .assert()
        .success()
        .stdout(predicate::str::contains("erased"));
    let table = std::fs::read_to_string(folder.join("participants.csv")).unwrap();
    assert!(table.contains("P02,1,dropped-out,"), "{table}");
    study_command()
        .arg("status")
        .arg(results.path())
        .assert()
        .success()
        .stdout(predicate::str::contains("\u{1b}").not());
    study_command()
        .arg("verify")
        .arg(results.path())
        .assert()
        .success();
}

#[test]
fn erasing_leaves_nothing_in_the_analysis_and_says_so_twice() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    study_command()
        .arg("analyze")
        .arg(results.path())
        .assert()
        .success();
    let used = folder.join("analysis/ratings_used.csv");
    assert!(std::fs::read_to_string(&used).unwrap().contains("P01"));
    let erase = |state: &str| {
        let mut command = study_command();
        command.arg("participant").arg(results.path()).arg("P01");
        command.args(["--state", state, "--reason", "asked", "--erase", "--yes"]);
        command.assert()
    };
    erase("excluded")
        .code(1)
        .stderr(predicate::str::contains("exclusion keeps the data"))
        .stderr(predicate::str::contains("--state withdrawn --erase"));
    assert!(folder.join("sessions/P01/1/journal.jsonl").exists());
    erase("withdrawn")
        .success()
        .stdout(predicate::str::contains("cannot be restored"))
        .stdout(predicate::str::contains("analysis/ contained some of them"));
    assert!(!folder.join("analysis").exists());
    erase("withdrawn")
        .success()
        .stdout(predicate::str::contains("were already erased on 20"))
        .stdout(predicate::str::contains("No data were left"));
}

#[test]
fn a_session_that_is_gone_is_told_and_not_dropped_unasked() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let verify = |more: &[&str]| {
        let mut command = study_command();
        command.arg("verify").arg(results.path()).args(more);
        command.assert()
    };
    std::fs::remove_dir_all(folder.join("sessions/P02")).unwrap();
    let names = "participants.csv contains P02, whose journal is missing";
    verify(&[]).code(4).stdout(predicate::str::contains(names));
    study_command()
        .arg("analyze")
        .arg(results.path())
        .assert()
        .success()
        .stderr(predicate::str::contains(names));
    let table = || std::fs::read_to_string(folder.join("participants.csv")).unwrap();
    verify(&["--rebuild"])
        .code(4)
        .stderr(predicate::str::contains("the tables contain P02"))
        .stderr(predicate::str::contains("--rebuild --drop-missing"));
    assert!(table().contains("P02"));
    verify(&["--drop-missing"]).code(2);
    verify(&["--rebuild", "--drop-missing"]).success();
    assert!(!table().contains("P02"));
    // A journal that is gone from a folder that stayed is the same.
    std::fs::remove_file(folder.join("sessions/P01/1/journal.jsonl")).unwrap();
    verify(&[]).code(4).stdout(predicate::str::contains(
        "contains P01, whose journal is missing",
    ));
}

#[test]
fn verify_misses_telemetry_that_the_journal_counts_and_says_what_it_does_not_check() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let verify = || {
        let mut command = study_command();
        command.arg("verify").arg(results.path());
        command.assert()
    };
    verify()
        .success()
        .stdout(predicate::str::contains("telemetry").count(1))
        .stdout(predicate::str::contains(
            "Not checked: the numbers in telemetry files",
        ));
    let file = folder.join("sessions/P01/1/telemetry/002-a1.csv");
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 20]).unwrap();
    verify().success().stdout(predicate::str::contains(
        "002-a1.csv: contains 3248 of 3250 samples",
    ));
    std::fs::write(
        &file,
        "somebody's notes, longer than the header of a telemetry file\n",
    )
    .unwrap();
    verify().code(4).stdout(predicate::str::contains(
        "002-a1.csv: not a telemetry file of study",
    ));
    std::fs::remove_file(&file).unwrap();
    verify()
        .code(4)
        .stdout(predicate::str::contains("problem: "))
        .stdout(predicate::str::contains("002-a1.csv: missing"))
        .stderr(predicate::str::contains("error: 1 problem found"))
        .stdout(predicate::str::contains("--rebuild").not());
}

#[test]
fn an_analysis_is_printed_although_its_tables_have_no_place() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    // A file in the place of the folder stops root too, which no permission does.
    std::fs::write(folder.join("analysis"), "in the way").unwrap();
    study_command()
        .arg("analyze")
        .arg(results.path())
        .assert()
        .success()
        .stdout(predicate::str::contains("realization"))
        .stderr(predicate::str::contains(
            "the tables could not be written: ",
        ))
        .stderr(predicate::str::contains("hint: `--out DIR`"));
    study_command()
        .arg("analyze")
        .arg(results.path())
        .arg("--out")
        .arg(folder.join("analysis"))
        .assert()
        .code(1)
        .stdout("")
        .stderr(predicate::str::contains("error: "));
}

#[test]
fn amend_keeps_the_old_version_and_refuses_other_stimuli() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let copy = tempfile::tempdir().unwrap();
    for (name, bytes) in study::cli::load::load(Path::new("protocols/turn-signal"))
        .unwrap()
        .files
    {
        let path = copy.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let file = copy.path().join("protocol.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let amend = || {
        let mut command = study_command();
        command.arg("amend").arg(results.path()).arg(&file);
        command.args(["--reason", "a clearer prompt"]);
        command
    };
    amend()
        .assert()
        .code(1)
        .stderr(predicate::str::contains("nothing differs"));
    let prompt = "reference = \"";
    assert!(text.contains(prompt));
    std::fs::write(&file, text.replace(prompt, "reference = \"Please: ")).unwrap();
    amend()
        .assert()
        .success()
        .stdout(predicate::str::contains("version 2").and(predicate::str::contains(
            "\n  trial.reference: \"Operate the real switch.\" → \"Please: Operate the real switch.\"\n",
        )));
    assert!(folder.join("protocol/1/protocol.toml").exists());
    assert!(folder.join("protocol/2/protocol.toml").exists());
    let design = "repetitions = 3";
    assert!(text.contains(design));
    std::fs::write(&file, text.replace(design, "repetitions = 4")).unwrap();
    let line = text.lines().position(|l| l.starts_with(design)).unwrap() + 1;
    let refused = predicate::str::contains("stimuli")
        .and(predicate::str::contains(
            "design.repetitions cannot change while the study runs",
        ))
        .and(predicate::str::contains(format!("protocol.toml:{line}:")))
        .and(predicate::str::contains("3 → 4"));
    amend().assert().code(1).stderr(refused);
    // and so does `run`
    study_command()
        .arg("run")
        .arg(&file)
        .arg("--results")
        .arg(results.path())
        .assert()
        .code(1)
        .stderr(predicate::str::contains("design.repetitions cannot change"));
    study_command()
        .arg("verify")
        .arg(results.path())
        .assert()
        .success();
}

#[test]
fn a_folder_that_is_none_or_of_a_newer_version_is_refused() {
    let results = tempfile::tempdir().unwrap();
    for command in ["status", "verify"] {
        study_command()
            .arg(command)
            .arg(results.path())
            .assert()
            .code(4)
            .stderr(predicate::str::contains("contains no results of a study"));
    }
    let folder = turn_signal(results.path());
    let manifest = folder.join("study.json");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(
        &manifest,
        text.replace("study-results/1", "study-results/2"),
    )
    .unwrap();
    for command in ["status", "verify"] {
        study_command()
            .arg(command)
            .arg(results.path())
            .assert()
            .code(4)
            .stderr(predicate::str::contains("newer version of study"));
    }
}

/// An exclusion and a drop-out are taken back by another record; nothing is rewritten.
#[test]
fn a_participant_is_reinstated() {
    let results = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let set = |id: &str, state: &str, code: i32| {
        let mut command = study_command();
        command.arg("participant").arg(&folder).arg(id);
        command.args(["--state", state, "--reason", "a slip"]);
        let done = command.assert().code(code);
        let output = done.get_output().clone();
        String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
    };
    let ratings = || -> usize {
        let mut command = study_command();
        let done = command.args(["analyze", "--json"]).arg(&folder).assert();
        let json: serde_json::Value =
            serde_json::from_slice(&done.success().get_output().stdout).unwrap();
        json["counts"]["rated"].as_u64().unwrap() as usize
    };
    let before = ratings();
    let journal = |id: &str| {
        let session = folder.join("sessions").join(id).join("1");
        let mut text = String::new();
        for name in ["journal.jsonl", "journal-2.jsonl", "journal-3.jsonl"] {
            text += &std::fs::read_to_string(session.join(name)).unwrap_or_default();
        }
        text
    };
    // nothing to take back
    let said = set("P01", "reinstated", 1);
    assert!(said.contains("only an exclusion or a drop-out"), "{said}");
    for (id, away, state) in [
        ("P01", "excluded", "done"),
        ("P02", "dropped-out", "unfinished"),
    ] {
        set(id, away, 0);
        let old = journal(id);
        let said = set(id, "reinstated", 0);
        assert!(
            said.contains(&format!("{id} was {away} and is now {state}.")),
            "{said}"
        );
        assert!(journal(id).starts_with(&old) && journal(id).len() > old.len());
    }
    assert_eq!(ratings(), before);
    study_command()
        .arg("verify")
        .arg(&folder)
        .assert()
        .success();
    // the row went to somebody else in the meantime
    set("P02", "dropped-out", 0);
    let study = StudyFolder::open(&folder).unwrap();
    assert_eq!(study.claim(&real("P03")).unwrap().seat.row(), Some(2));
    let said = set("P02", "reinstated", 0);
    assert!(
        said.contains("row 2 was assigned to P03 in the meantime"),
        "{said}"
    );
    // whoever withdrew stays away
    set("P02", "withdrawn", 0);
    let said = set("P02", "reinstated", 1);
    assert!(said.contains("only an exclusion or a drop-out"), "{said}");
}
