//! Perceptual VAF: what is weighed in the pairs of a study by simulated perceivers.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::study;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::perceptual::{Errors, Perceived, Verdict, Weighing};
use study_analysis::load::ComponentErrors;
use study_analysis::study::Study;
use study_base::rng::Stream;
use study_base::text::QuestionId;
use study_haptics::identify::perceptual::{Component, file};
use study_haptics::identify::vaf;
use study_haptics::model::{self, Realization};
use study_haptics::recording::{self, Recording};
use study_plan::protocol::Answer;
use study_report::explore::weights;

const HEAD: &str = r#"
format = "study-protocol/2"
[study]
id = "weighed"
title = "Which one feels more real?"
seed = 11
[design]
participants = 8
[device]
kind = "simulated"
limits = { force_n = 12.0, velocity_mm_s = 1000.0 }
uncertified = { play = true, force_n = 12.0, reason = "a test" }
[[parts]]
id = "more-real"
kind = "pairs"
text = "Two switches, one after the other."
prompt = "Which one felt more real?"
pairs = "all"
repetitions = 1
order = "blocked"
tie = false
gap_s = 0.5
exposure = { min_s = 0.5, max_s = 1.0 }
[analysis]
primary = "more-real"
"#;

/// The table of a turn-signal switch.
fn base() -> Realization {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/protocols/turn-signal-extended/models/static.toml"
    );
    let text = fs::read_to_string(path).unwrap();
    let mut table = model::file::parse(path, &text).0.unwrap();
    table.vaf.clear();
    table
}

/// The table with other forces where the force falls, elsewhere, and between the directions, by the bits of `i`.
fn realization(i: usize) -> Realization {
    let mut table = base();
    let size = 1.0 + 0.05 * i as f64;
    let on = |bit: usize, force_n: f64| f64::from(u8::from((i >> bit) & 1 == 1)) * size * force_n;
    let both = table.positive.f0_n.iter().zip(&table.negative.f0_n);
    let mean: Vec<f64> = both.map(|(plus, minus)| 0.5 * (plus + minus)).collect();
    for j in 0..mean.len() {
        let inside = j > 0 && j + 1 < mean.len();
        let [before, after] = match inside {
            true => [mean[j] - mean[j - 1], mean[j + 1] - mean[j]],
            false => [0.0; 2],
        };
        let mut level = 0.0;
        if before < 0.0 && after < 0.0 {
            level = on(0, 2.0);
        } else if before > 0.0 && after > 0.0 {
            level = on(1, 1.5);
        }
        table.positive.f0_n[j] += level + on(2, 0.6);
        table.negative.f0_n[j] += level - on(2, 0.6);
    }
    table.id = format!("r{i}");
    table
}

/// Slow and fast strokes with the force of the table.
fn reference() -> String {
    let csv = |force_n: &dyn Fn(usize, f64) -> f64| -> String {
        let mut text = "t_s,x_mm,v_mm_s,a_m_s2,f_n\n".to_owned();
        for i in 0..16_000 {
            let t = i as f64 * 0.001;
            let (w, since) = if i < 8000 {
                (PI, t)
            } else {
                (3.0 * PI, t - 8.0)
            };
            let (x, v) = (
                17.5 - 15.0 * (w * since).cos(),
                15.0 * w * (w * since).sin(),
            );
            let a = 0.015 * w * w * (w * since).cos();
            writeln!(text, "{t},{x},{v},{a},{}", force_n(i, v)).unwrap();
        }
        text
    };
    let moved = read(&csv(&|_, v| v));
    let forces: Vec<f64> = vaf::predict(&base(), &moved).collect();
    csv(&|i, _| forces[i])
}

fn read(text: &str) -> Recording {
    recording::read("r", text.as_bytes()).unwrap()
}

/// A rehearsed study of the pairs of eight realizations, and a recording of the real thing, in `out` and `r.csv`.
fn rehearse(folder: &Path) {
    let models = folder.join("p/models");
    fs::create_dir_all(&models).unwrap();
    let mut protocol = HEAD.to_owned();
    for i in 0..8 {
        let table = model::file::write(&realization(i));
        fs::write(models.join(format!("r{i}.toml")), table).unwrap();
        writeln!(
            protocol,
            "[[models]]\nid = \"r{i}\"\nfile = \"models/r{i}.toml\""
        )
        .unwrap();
    }
    fs::write(folder.join("p/protocol.toml"), protocol).unwrap();
    fs::write(folder.join("r.csv"), reference()).unwrap();
    let arguments = ["rehearse", "p", "--participants", "8", "--out", "out"];
    let (code, out, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{out}{err}");
}

/// Answers all pairs anew, as perceivers with this sensitivity to each component, whose impressions have a noise of 1.
fn answer(study: &mut Study, errors: &ComponentErrors, sensitivity: [f64; 5]) {
    let mut noise = Stream::new(5, &["perceiver"]);
    let felt: BTreeMap<_, _> = (study.derived.intervals.iter())
        .map(|row| {
            let trial = (row.participant.clone(), row.session, row.trial);
            ((trial, Some(row.attempt), row.interval), row.model.clone())
        })
        .collect();
    let question = QuestionId::new("more-real").unwrap();
    for row in &mut study.derived.rows {
        let mut utility = |interval: u32| {
            let trial = (row.participant.clone(), row.session, row.trial);
            let model = felt[&(trial, row.attempt, interval)].clone().unwrap();
            let own = errors.1[model.as_str()].iter().zip(sensitivity);
            noise.normal() - own.map(|(error, weight)| error * weight).sum::<f64>()
        };
        let word = if utility(1) > utility(2) {
            "first"
        } else {
            "second"
        };
        let chosen = Answer::Choice(vec![word.to_owned()]);
        row.answers.insert(question.clone(), chosen);
    }
}

fn weighed(study: &Study, errors: &ComponentErrors) -> (Weighing, Perceived) {
    let (components, of) = errors.clone();
    let mut found = study.weigh(Include::default(), &Errors { components, of });
    assert_eq!(found.len(), 1);
    let found = found.remove(0);
    assert!(found.simulated && !found.pilot);
    assert_eq!((found.undecided, found.without_table), (0, 0));
    let own = found.found.clone().unwrap();
    assert_eq!((own.weighed.choices, own.weighed.participants), (224, 8));
    assert_eq!(own.unvaried, ["slow", "fast"]);
    assert_eq!(own.groups, [["level"], ["detent"], ["direction"]]);
    (found, own)
}

#[test]
fn perceivers_get_the_weights_that_they_have() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    rehearse(at);
    let mut found = Study::open(&at.join("out")).unwrap();
    let recording = read(&reference());
    let errors = found.loaded.errors(&recording).unwrap();
    assert_eq!(errors.1.len(), 8);
    // Who feels only detents.
    answer(&mut found, &errors, [0.0, 1600.0, 0.0, 0.0, 0.0]);
    let (weighing, own) = weighed(&found, &errors);
    let shares = own.weighed.shares.clone().unwrap();
    assert!(shares[1] >= 0.9, "{own:?}");
    assert_eq!(own.verdict, Verdict::Unequal, "{own:?}");
    let text = weights::file_text("weighed", &weighing, &recording).unwrap();
    let read = file::parse("w.toml", &text).0.unwrap();
    assert!(read.known(Component::Detent).unwrap() >= 0.9, "{text}");
    assert_eq!(read.known(Component::Slow), None);
    // Who feels nothing.
    answer(&mut found, &errors, [0.0; 5]);
    let (weighing, own) = weighed(&found, &errors);
    assert_ne!(own.verdict, Verdict::Unequal, "{own:?}");
    for (low, high) in &own.weighed.shares_ci95 {
        assert!(*low <= 1.0 / 3.0 && 1.0 / 3.0 <= *high, "{own:?}");
    }
    assert_eq!(weights::file_text("weighed", &weighing, &recording), None);
    // The command, of the answers as they were.
    let arguments = ["explore", "out", "--reference", "r.csv", "--out", "maps"];
    let (code, out, err) = study(&arguments, at);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.starts_with("Part more-real: what is weighed of the errors against r\nSIMULATED "),
        "{out}"
    );
    assert!(out.contains("224 choices of 8 participants."), "{out}");
    let table = fs::read_to_string(at.join("maps/more-real-weights.csv")).unwrap();
    assert!(table.starts_with("components,weight,"), "{table}");
    let (code, _, err) = study(&["explore", "out"], at);
    assert!(
        code == 1 && err.contains("no part of kind \"search\""),
        "{err}"
    );
    fs::write(at.join("short.csv"), "t_s,x_mm,f_n\n0,0,1\n").unwrap();
    let (code, _, err) = study(&["explore", "out", "--reference", "short.csv"], at);
    assert!(code == 1 && err.contains("short.csv: line "), "{err}");
}

/// The levels of an axis `detent` scale the force in detents and elsewhere alike.
#[test]
fn a_search_along_detents_has_one_weight_for_both() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, _, said) = study(&["new", "s", "--kind", "search", "--seed", "7"], at);
    assert_eq!(code, 0, "{said}");
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("grid = 9", "grid = 3");
    let text = text.replace("trials = 40, start = 8", "trials = 8, start = 4");
    fs::write(&path, text).unwrap();
    fs::write(at.join("r.csv"), reference()).unwrap();
    for arguments in [
        &["rehearse", "s", "--participants", "2", "--out", "out"][..],
        &["explore", "out", "--reference", "r.csv"],
    ] {
        let (code, out, err) = study(arguments, at);
        assert_eq!(code, 0, "{out}{err}");
        if arguments[0] == "explore" {
            assert!(out.starts_with("Part better: the space switch"), "{out}");
            let (_, weighed) = out.split_once("\n\nPart better: what is weighed ").unwrap();
            assert!(weighed.contains("16 choices of 2 participants."), "{out}");
            assert!(weighed.contains("\nlevel with detent "), "{out}");
            assert!(weighed.contains("of these participants only"), "{out}");
        }
    }
}
