//! `study replay`: what was on the screen, answered and felt.

#![allow(clippy::unwrap_used)]

use crate::support::{repository, study};
use crate::world::{HOSTILE, participant, real};
use std::fs;
use std::path::Path;
use study_analysis::load;
use study_base::text::ModelId;
use study_session::outcome::{Author, Event};
use study_session::store::{Frozen, StudyFolder};

const EXAMPLE: &str = "results/turn-signal-example";

/// A study in which the real participant P01 did what SIM001 of the example did, with
/// another realization in each trial, if given, and another force.
fn with_p01(results: &Path, model: Option<&str>, force: fn(f64) -> f64) {
    as_p01(repository(EXAMPLE).as_ref(), results, model, force);
}

/// The same of another study.
fn as_p01(study: &Path, results: &Path, model: Option<&str>, force: fn(f64) -> f64) {
    let example = StudyFolder::open(study).unwrap();
    let loaded = load::frozen(&example).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let simulated = example.sessions().unwrap().remove(0);
    let began = simulated.entries[0].at;
    let study = StudyFolder::open_or_create(results, &frozen, began).unwrap();
    let mut claimed = study.claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    for entry in &simulated.entries {
        let mut event = entry.event.clone();
        match &mut event {
            Event::SessionStarted(start) => {
                start.participant = participant("P01");
                start.seat = claimed.seat;
            }
            Event::AttemptStarted { model: played, .. } => {
                let other = model.map(|id| ModelId::new(id).unwrap());
                *played = other.or(played.take());
            }
            _ => {}
        }
        journal.append(entry.at, &event).unwrap();
    }
    let remark = Event::Remark {
        by: Author::Participant,
        trial: Some(3),
        text: HOSTILE.to_owned(),
    };
    journal
        .append(simulated.entries.last().unwrap().at, &remark)
        .unwrap();
    let folder = claimed.folder.path().join("telemetry");
    fs::create_dir_all(&folder).unwrap();
    for file in fs::read_dir(simulated.path.join("telemetry")).unwrap() {
        let file = file.unwrap();
        let text = fs::read_to_string(file.path()).unwrap();
        let mut lines = text.lines();
        let mut scaled = format!("{}\r\n", lines.next().unwrap());
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let force = force(cells[3].parse().unwrap());
            let [t, x, v] = [cells[0], cells[1], cells[2]];
            scaled.push_str(&format!("{t},{x},{v},{force},\r\n"));
        }
        fs::write(folder.join(file.file_name()), scaled).unwrap();
    }
}

#[test]
fn a_trial_of_a_simulated_participant_is_shown_with_its_force_beside_the_table() {
    let home = tempfile::tempdir().unwrap();
    let example = repository(EXAMPLE);
    let (code, out, err) = study(&["replay", &example, "SIM001", "3"], home.path());
    assert_eq!((code, err.as_str()), (0, ""));
    for text in [
        "turn-signal · SIM001 · session 1 · done",
        "rial 3 of 15",
        "Operate the real switch.",
        "attempt 1, after a prompt of 2.0 s: lambda-0.9991",
        "it ends after 7.7 s, 8 full strokes",
        "realism = 7",
        "answered in 3.5 s",
        "Position, mm",
        "Force of the device, N",
        "Force of the table, N",
        "rms difference from the table not known",
    ] {
        assert!(out.contains(text), "{text}\n{out}");
    }
    assert!(!out.contains("rial 4 of 15") && !out.contains("lambda-0.9993"));
    assert!(!Path::new(&example).join("reveals.jsonl").exists());
}

#[test]
fn a_whole_session_is_a_document_with_every_event_and_page() {
    let home = tempfile::tempdir().unwrap();
    let example = repository(EXAMPLE);
    let (code, out, _) = study(&["replay", &example, "SIM001", "--json"], home.path());
    assert_eq!(code, 0);
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["format"], "study-replay/1");
    assert_eq!(document["hidden"], false);
    let steps = document["steps"].as_array().unwrap();
    let events = steps.iter().filter(|step| step["event"].is_string());
    let folder = StudyFolder::open(example.as_ref()).unwrap();
    let session = folder.sessions().unwrap().remove(0);
    assert_eq!(events.count(), session.entries.len());
    // Before each trial a prompt, then the presentation and the question.
    for kind in ["reference", "playing", "questions"] {
        let pages = steps.iter().filter(|step| step["page"]["kind"] == kind);
        let trials: Vec<u64> = pages.map(|p| p["trial"].as_u64().unwrap()).collect();
        assert_eq!(trials, (1..=15).collect::<Vec<u64>>(), "{kind}");
    }
    let is_end = |step: &serde_json::Value| step["event"] == "playback_ended";
    let ended = steps.iter().find(|step| is_end(step)).unwrap();
    assert_eq!(ended["file"], "001-a1.csv");
    assert!(ended["peak_force_n"].as_f64().unwrap() > 1.0, "{ended}");
    assert!(!out.contains("\"schedule\""), "the planned order");
}

#[test]
fn while_a_study_is_not_complete_all_realizations_look_the_same() {
    let homes = [(); 2].map(|()| tempfile::tempdir().unwrap());
    with_p01(homes[0].path(), None, |n| n);
    with_p01(homes[1].path(), Some("lambda-0.9999"), |n| 3.0 - n * n);
    for arguments in [
        &["replay", ".", "P01", "3"][..],
        &["replay", ".", "P01", "3", "--json"],
        &["replay", ".", "P01"],
        &["replay", ".", "P01", "--json"],
    ] {
        let [one, other] = [0, 1].map(|i| study(arguments, homes[i].path()));
        assert_eq!((one.0, one.2.as_str()), (0, ""), "{arguments:?}");
        assert_eq!(one, other, "{arguments:?}");
        assert!(!one.1.contains("lambda-"), "{}", one.1);
    }
    let (_, out, _) = study(&["replay", ".", "P01", "3"], homes[0].path());
    assert!(
        out.contains("hidden: 1 of 10 participants have finished"),
        "{out}"
    );
    // Without a scale, too, the shape of a force tells a detent from a spring.
    assert!(out.contains("Position, without scale") && !out.contains("Force"));
}

/// The level that was set, and whether an answer was right, tell a realization without its name.
#[test]
fn while_a_study_is_not_complete_neither_levels_nor_right_answers_are_told() {
    for (kind, told, instead) in [
        ("adjustment", &["equal = "][..], "the level is confirmed"),
        (
            "identification",
            &["That was correct", "That was not correct"],
            "which = ",
        ),
    ] {
        let home = tempfile::tempdir().unwrap();
        let run = |arguments: &[&str]| {
            let (code, out, err) = study(arguments, home.path());
            assert_eq!(code, 0, "{arguments:?}: {out}{err}");
            out
        };
        run(&["new", "--kind", kind, "--seed", "20261128", "s"]);
        run(&["rehearse", "s", "--participants", "1", "--out", "r"]);
        let open = run(&["replay", "r", "SIM001"]);
        assert!(told.iter().any(|text| open.contains(text)), "{open}");
        let names = ["s", "my-study"].map(|name| home.path().join("r").join(name));
        let rehearsed = names.iter().find(|path| path.is_dir()).unwrap();
        let results = home.path().join("p");
        fs::create_dir(&results).unwrap();
        as_p01(rehearsed, &results, None, |n| n);
        let hidden = run(&["replay", "p", "P01"]);
        assert!(hidden.contains(instead), "{hidden}");
        let document = run(&["replay", "p", "P01", "--json"]);
        for text in told {
            assert!(!hidden.contains(text), "{hidden}");
            assert!(!document.contains(text), "{document}");
        }
        let document: serde_json::Value = serde_json::from_str(&document).unwrap();
        for step in document["steps"].as_array().unwrap() {
            let is_set = step["question"] == "equal";
            assert!(!is_set || step["answer"].is_null(), "{step}");
        }
    }
}

#[test]
fn who_reveals_a_participant_early_leaves_a_note() {
    let home = tempfile::tempdir().unwrap();
    with_p01(home.path(), None, |n| n);
    let arguments = ["replay", ".", "P01", "3", "--reveal", "a strange force"];
    let (code, out, err) = study(&arguments, home.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        err.contains("the realizations of row 1 were shown"),
        "{err}"
    );
    assert!(out.contains("lambda-0.9991") && out.contains("Force of the table, N"));
    let log = fs::read_to_string(home.path().join("turn-signal/reveals.jsonl")).unwrap();
    assert!(
        log.contains("a strange force") && log.contains("[1,1]"),
        "{log}"
    );
    // Only this once.
    let (_, out, _) = study(&arguments[..4], home.path());
    assert!(!out.contains("lambda-"), "{out}");
}

#[test]
fn typed_text_cannot_control_the_terminal() {
    let home = tempfile::tempdir().unwrap();
    with_p01(home.path(), None, |n| n);
    for arguments in [
        &["replay", ".", "P01", "3"][..],
        &["replay", ".", "P01", "3", "--json"],
    ] {
        let (_, out, _) = study(arguments, home.path());
        assert!(out.contains("quoted"), "{out}");
        assert!(!out.contains(['\u{1b}', '\u{9b}', '\0']), "{out}");
    }
}

#[test]
fn who_did_not_come_has_no_session_and_who_withdrew_is_not_shown() {
    let home = tempfile::tempdir().unwrap();
    with_p01(home.path(), None, |n| n);
    for (id, state, what) in [
        ("P09", "no-show", "P09 has no session that began"),
        ("P01", "withdrawn", "P01 withdrew: nothing of them is shown"),
    ] {
        let set = [
            "participant",
            ".",
            id,
            "--state",
            state,
            "--reason",
            "told us",
        ];
        let (code, _, err) = study(&set, home.path());
        assert_eq!(code, 0, "{err}");
        let (code, out, err) = study(&["replay", ".", id], home.path());
        assert_eq!((code, out.as_str()), (1, ""), "{err}");
        assert!(err.contains(what), "{err}");
    }
}

#[test]
fn what_is_not_there_is_named() {
    let home = tempfile::tempdir().unwrap();
    let example = repository(EXAMPLE);
    for (arguments, what) in [
        (&["SIM1"][..], "there is no participant `SIM1`"),
        (&["SIM001", "99"], "SIM001 has no trial 99"),
        (&["SIM001", "--session", "7"], "there is no such session"),
        (&["SIM 001"], "id"),
    ] {
        let arguments = [&["replay", example.as_str()][..], arguments].concat();
        let (code, out, err) = study(&arguments, home.path());
        assert_eq!((code, out.as_str()), (1, ""), "{err}");
        assert!(err.contains(what), "{err}");
    }
}

/// A level that was set is a realization, and the answer names it.
#[test]
fn a_level_that_was_set_is_hidden_until_it_is_revealed() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, home.path());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    run(&["new", "--seed", "20261123", "set", "--kind", "adjustment"]);
    run(&["rehearse", "set", "--participants", "1", "--out", "out"]);
    let rehearsed = StudyFolder::open(&home.path().join("out/set")).unwrap();
    let loaded = load::frozen(&rehearsed).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let simulated = rehearsed.sessions().unwrap().remove(0);
    let began = simulated.entries[0].at;
    let real_one = StudyFolder::open_or_create(&home.path().join("real"), &frozen, began).unwrap();
    let mut claimed = real_one.claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    for entry in &simulated.entries {
        let mut event = entry.event.clone();
        if let Event::SessionStarted(start) = &mut event {
            start.participant = participant("P01");
            start.seat = claimed.seat;
        }
        journal.append(entry.at, &event).unwrap();
    }
    drop((journal, claimed));
    let level = simulated.entries.iter().find_map(|e| match &e.event {
        Event::Answered { answer, .. } => answer.number(),
        _ => None,
    });
    let answer = format!("equal = {}", level.unwrap());
    let hidden = "the level is confirmed";
    let lines = run(&["replay", "real", "P01"]);
    assert!(
        lines.contains(hidden) && !lines.contains(&answer),
        "{lines}"
    );
    let document = run(&["replay", "real", "P01", "--json"]);
    assert!(!document.contains("\"number\":"), "{document}");
    let lines = run(&["replay", "real", "P01", "--reveal", "a test"]);
    assert!(
        lines.contains(&answer) && !lines.contains(hidden),
        "{lines}"
    );
}
