//! Searches of real participants: who counts, who cannot confirm what they found, and what is said of damage.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::study;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use study::rater::{Effect, Percepts, Rater};
use study::runner::Setup;
use study::runner::clock::{Clock as _, VirtualClock};
use study::runner::rehearsal::{first_day, run_one};
use study::runner::saver::Saving;
use study_analysis::load;
use study_base::text::ParticipantId;
use study_device::virtual_device::{Options, VirtualDevice};
use study_plan::protocol::DeviceKind;
use study_session::store::{Frozen, SeatKind, StudyFolder};

/// The sessions of these people, who answer as simulated ones do.
fn took_part(protocol: &Path, results: &Path, kind: SeatKind, people: &[&str]) {
    let loaded = load::load(protocol).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let models = loaded.tables();
    let percepts = Percepts::of(&loaded.protocol, &models);
    let protocol = Arc::new(loaded.protocol.clone());
    for (number, who) in (1..).zip(people) {
        let clock = VirtualClock::starting_at(first_day() + chrono::Days::new(number));
        let folder = StudyFolder::open_or_create(results, &frozen, clock.now()).unwrap();
        let setup = Setup {
            protocol: protocol.clone(),
            orders: None,
            models: models.clone(),
            deliveries: BTreeMap::new(),
            fingerprints: loaded.fingerprints.clone(),
            study: folder,
            kind,
            rows: None,
            group: None,
            device_kind: DeviceKind::Simulated,
            device: Box::new(VirtualDevice::new(Options::seeded(number))),
            device_check: None,
            self_weighed: None,
            clock: Box::new(clock.clone()),
            saving: Saving::Loop,
        };
        let mut rater = Rater::new(7, number as u32, Effect::BuiltIn);
        run_one(setup, who, &clock, &mut rater, &percepts).unwrap();
    }
}

/// A search of six trials in nine points, of which no point is the start; `more` comes at its end.
fn search(at: &Path, more: &str) {
    let (code, _, said) = study(&["new", "s", "--kind", "search", "--seed", "7"], at);
    assert_eq!(code, 0, "{said}");
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("grid = 9", "grid = 3");
    let text = text.replace("trials = 40, start = 8", "trials = 6, start = 4");
    fs::write(&path, text + more).unwrap();
}

fn confirmation(at: &Path, to: &str, more: &[&str]) -> (i32, String) {
    let head = ["new", to, "--from", "r", "--confirm"];
    let (code, out, err) = study(&[&head[..], more].concat(), at);
    (code, out + &err)
}

#[test]
fn searchers_are_named_even_if_their_data_were_erased() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    search(at, "");
    let protocol = at.join("s");
    took_part(&protocol, &at.join("r"), SeatKind::Real, &["P01", "P02"]);
    took_part(&protocol, &at.join("r"), SeatKind::Pilot, &["X1"]);
    let (code, out, err) = study(&["explore", "r"], at);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("\n2 participants: best at detent "), "{out}");
    assert!(!out.contains("included"), "{out}");
    let (code, said) = confirmation(at, "c", &[]);
    assert_eq!(code, 0, "{said}");
    let text = |name: &str| fs::read_to_string(at.join(name).join("protocol.toml")).unwrap();
    let searchers = "searchers = [\"P01\", \"P02\", \"X1\"]";
    assert!(text("c").contains(searchers), "{}", text("c"));
    assert!(!text("c").contains("pilot = true"));
    let withdrawn = ["--state", "withdrawn", "--reason", "x", "--erase", "--yes"];
    let erase = [&["participant", "r", "P02"][..], &withdrawn[..]].concat();
    let (code, _, said) = study(&erase, at);
    assert_eq!(code, 0, "{said}");
    let (code, said) = confirmation(at, "d", &["--include", "pilot"]);
    assert_eq!(code, 0, "{said}");
    assert!(text("d").contains(searchers), "{}", text("d"));
    assert!(text("d").contains("pilot = true"), "{}", text("d"));
    assert_eq!(study(&["check", "d"], at).0, 0);
}

#[test]
fn damage_is_said_and_exclusion_rules_apply() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Nobody makes so many strokes.
    search(
        at,
        "\n[[analysis.exclude]]\nrule = \"strokes-below\"\nstrokes = 1000\n",
    );
    took_part(&at.join("s"), &at.join("r"), SeatKind::Real, &["P01"]);
    let (code, out, err) = study(&["explore", "r"], at);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("excludes 6 answers of 1 participant."),
        "{out}"
    );
    assert!(out.contains("No participant who counts"), "{out}");
    let (code, said) = confirmation(at, "c", &[]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("no answer of a participant who counts"),
        "{said}"
    );
    // A changed line.
    let journal = at.join("r/s/sessions/P01/1/journal.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    let changed = text.replacen("\"playback_started\"", "\"playback_stopped\"", 1);
    assert_ne!(changed, text);
    fs::write(&journal, changed).unwrap();
    let (_, _, err) = study(&["explore", "r"], at);
    assert!(
        err.contains("warning: ") && err.contains("study verify"),
        "{err}"
    );
}

#[test]
fn nobody_becomes_a_searcher_and_ratings_of_one_are_warned_about() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, _, said) = study(&["new", "s", "--kind", "rating", "--seed", "7"], at);
    assert_eq!(code, 0, "{said}");
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let format = text
        .lines()
        .find(|line| line.starts_with("format"))
        .unwrap();
    let confirms = format!(
        "\n[confirms]\nstudy = \"search\"\npart = \"better\"\npairs_sha256 = \"{}\"\nbest = \"switch.7\"\nsearchers = [\"P01\"]\n",
        "0".repeat(64)
    );
    let text = text.replace(format, "format = \"study-protocol/3\"");
    fs::write(&path, text + &confirms).unwrap();
    took_part(
        &at.join("s"),
        &at.join("r"),
        SeatKind::Real,
        &["P02", "P03"],
    );
    let correct = ["correct", "r", "P02", "--id", "P01", "--reason", "mistyped"];
    let (code, _, said) = study(&correct, at);
    assert_eq!(code, 1, "{said}");
    let words =
        "P01 took part in the search `search`, which this study confirms, and cannot be P02";
    assert!(said.contains(words), "{said}");
    let (_, out, _) = study(&["analyze", "r"], at);
    assert!(!out.contains("took part in the search that"), "{out}");
    // As an earlier release did it.
    let results = StudyFolder::open(&at.join("r/s")).unwrap();
    let (from, to) = ["P02", "P01"]
        .map(|id| ParticipantId::new(id).unwrap())
        .into();
    let now = VirtualClock::starting_at(first_day()).now();
    results.correct_id(&from, &to, "mistyped", now).unwrap();
    let (code, out, err) = study(&["analyze", "r"], at);
    assert_eq!(code, 0, "{err}");
    let said = out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("1 participant took part in the search that"),
        "{said}"
    );
}
