//! Methods compared on data left out.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use study_base::rng::Stream;
use study_haptics::identify::Training;
use study_haptics::identify::compare::{self, Comparison};
use study_haptics::identify::folds::{FOLDS, Folds};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

use crate::evidence::{switch, switch_text};

fn compared(recording: &Recording) -> Comparison {
    let training = Training::new(recording).unwrap();
    compare::run(&training, Lookup::Linear, &[], |_| ()).unwrap()
}

/// Rows t, x, F at 200 Hz of `force(x, v)` with noise of 0.02 N, for 20 s of strokes of different
/// speeds.
pub(crate) fn text_of(seed: u64, travel_mm: f64, force: impl Fn(f64, f64) -> f64) -> String {
    let mut noise = Stream::new(seed, &["compare"]);
    let mut text = String::from("t_s,x_mm,f_n\n");
    for i in 0..4000 {
        let t = f64::from(i) * 0.005;
        let (mut x, mut v) = (0.5 * travel_mm, 0.0);
        for (hz, share) in [(0.21, 0.35), (1.3, 0.12)] {
            let w = hz * std::f64::consts::TAU;
            x += share * travel_mm * (w * t).sin();
            v += share * travel_mm * w * (w * t).cos();
        }
        let f = force(x, v) + 0.02 * noise.normal();
        writeln!(text, "{t:.3},{x:.6},{f:.6}").unwrap();
    }
    text
}

fn recording_of(seed: u64, travel_mm: f64, force: impl Fn(f64, f64) -> f64) -> Recording {
    let text = text_of(seed, travel_mm, force);
    recording::read("r", text.as_bytes()).unwrap()
}

/// Every sample is left out once or never, whole strokes together; a slow fold has no fast stroke.
#[test]
fn strokes_are_left_out_from_the_slowest_to_the_fastest() {
    let recording = recording_of(1, 30.0, |x, v| 0.1 * x + 0.5 * v.signum());
    let recordings = [&recording];
    let folds = Folds::new(&recordings);
    assert!(folds.whole_strokes);
    let left_out: Vec<Vec<usize>> = (0..FOLDS)
        .map(|fold| {
            let weights = folds.without(fold, 1);
            (0..recording.len())
                .filter(|i| weights[0][*i] == 0.0)
                .collect()
        })
        .collect();
    assert_eq!(left_out.iter().map(Vec::len).sum::<usize>(), 4000);
    let top = |of: &[usize]| (of.iter().map(|i| recording.v_mm_s[*i].abs())).fold(0.0, f64::max);
    assert!(left_out.windows(2).all(|w| top(&w[0]) < top(&w[1])));
    // a loop has too few: tenths of the travel, without the ends, never in both directions
    let recording = switch("Akko_Blue_V2");
    let recordings = [&recording];
    let folds = Folds::new(&recordings);
    assert!(!folds.whole_strokes);
    let [low, high] = recording.range_mm();
    let turn = (0..recording.len())
        .max_by(|a, b| recording.x_mm[*a].total_cmp(&recording.x_mm[*b]))
        .unwrap();
    let mut ever = 0;
    for fold in 0..FOLDS {
        let weights = &folds.without(fold, 1)[0];
        let mut tenths = [[false; 2]; 10];
        for i in (0..recording.len()).filter(|i| weights[*i] == 0.0) {
            let share = (recording.x_mm[i] - low) / (high - low);
            assert!((0.08..0.92).contains(&share));
            tenths[((share - 0.08) / 0.084) as usize % 10][usize::from(i > turn)] = true;
            ever += 1;
        }
        assert!(tenths.iter().all(|both| *both != [true; 2]), "{tenths:?}");
    }
    assert!(ever > recording.len() / 2 && ever < recording.len());
}

/// Measured loops: a table without mass and damping predicts tenths of the travel that were left
/// out, and friction alone is named where it predicts worse than a constant.
#[test]
fn a_slow_loop_of_a_real_switch_is_recommended_a_passive_table() {
    for name in ["Cherry_MX_Purple_1", "Akko_Blue_V2", "Clickiez_75g_Tactile"] {
        let comparison = compared(&switch(name));
        let best = comparison.best().unwrap();
        assert_eq!(best.failure(), None);
        assert!(best.left_out.unwrap().vaf > 0.98, "{name}: {best:?}");
        let [plus, minus] = [
            &best.cell.realization.positive,
            &best.cell.realization.negative,
        ];
        for of in [&plus.m_kg, &plus.b_n_s_per_mm, &minus.b_n_s_per_mm] {
            assert!(of.iter().all(|value| *value == 0.0), "{name}");
        }
        assert!(!comparison.not_tried.is_empty(), "{name}");
    }
}

/// 24 detents over the travel need nodes closer than the default ones.
#[test]
fn dx_is_chosen_where_detents_are_many() {
    let detents =
        |x: f64, v: f64| 1.5 * (24.0 * std::f64::consts::TAU * x / 125.0).sin() + 0.3 * v.signum();
    let comparison = compared(&recording_of(3, 125.0, detents));
    let passive = (comparison.candidates.iter())
        .find(|candidate| candidate.cell.method.as_str() == "passive")
        .unwrap();
    let dx_mm = passive.cell.realization.provenance.dx_mm.unwrap();
    // a detent is 5.2 mm
    assert!(dx_mm < 1.3, "{dx_mm}");
    assert!(passive.left_out.unwrap().vaf > 0.95, "{passive:?}");
}

pub(crate) fn study(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let output = (Command::cargo_bin("study").unwrap())
        .current_dir(dir)
        .arg("identify")
        .args(args)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

/// Without a method: one table, one sentence, one model file. With an option of an estimator that
/// estimator, as ever.
#[test]
fn the_command_compares_recommends_and_writes_the_recommended_model() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("t.csv", &switch_text("Akko_Blue_V2"));
    write("v.csv", &switch_text("Cherry_MX_Purple_1"));
    let args = ["t.csv", "--validate", "v.csv", "--out", "m"];
    let (code, out, err) = study(dir.path(), &args);
    assert_eq!(code, 0, "{out}{err}");
    assert_eq!(out.matches("recommended: passive, because").count(), 1);
    assert!(
        out.contains("mechanism not tried: too few strokes"),
        "{out}"
    );
    assert!(
        out.contains("friction failed: predicts data left out worse"),
        "{out}"
    );
    let files: Vec<_> = fs::read_dir(dir.path().join("m")).unwrap().collect();
    assert_eq!(files.len(), 1);
    // what the recording bounds is in the file, without a value, and in words what it does not bound
    let text = fs::read_to_string(files[0].as_ref().unwrap().path()).unwrap();
    let (model, findings) = study_haptics::model::file::parse("m.toml", &text);
    assert_eq!(findings.faults, []);
    let provenance = model.unwrap().provenance;
    let known = ["m_kg", "b_n_s_per_mm"].map(|name| provenance.terms[name]);
    assert!(known.iter().all(|t| t.value.is_none()), "{known:?}");
    assert!(known[0].upper_bound.is_none(), "{known:?}");
    let note = provenance.note.unwrap();
    assert!(
        note.contains("mass: not identified by the recordings and not bounded"),
        "{note}"
    );
    let (code, out, _) = study(dir.path(), &["t.csv", "--validate", "v.csv", "--json"]);
    assert_eq!(code, 0);
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["cells"].as_array().unwrap().len(), 1);
    assert_eq!(document["best"], 0);
    let terms = &document["cells"][0]["terms"];
    assert_eq!([&terms[0]["name"], &terms[1]["name"]], ["mass", "damping"]);
    assert!(terms[0]["upper_bound"].is_null() && terms[1]["identified"] == false);
    let bounds = [terms[1]["upper_bound"].as_f64(), known[1].upper_bound];
    let [of_document, of_file] = bounds.map(Option::unwrap);
    assert!((of_document / of_file - 1.0).abs() < 1e-9, "{bounds:?}");
    let comparison = &document["comparison"];
    let recommended = comparison["recommended"].as_u64().unwrap() as usize;
    assert_eq!(comparison["candidates"][recommended]["method"], "passive");
    assert!(comparison["candidates"][recommended]["failed"].is_null());
    let (_, out, _) = study(dir.path(), &["t.csv", "--validate", "v.csv", "--dx", "0.1"]);
    assert!(!out.contains("recommended"), "{out}");
}

/// A method that predicts worse than a constant says so, in the model file as well, and the command
/// fails; a baseline that was asked for only says so, and its file stays what it was.
#[test]
fn a_method_that_predicts_worse_than_a_constant_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    let spring = |k: f64| move |x: f64, v: f64| k * (x - 15.0) + 0.3 * v.signum();
    write("t.csv", &text_of(4, 30.0, spring(0.5)));
    write("v.csv", &text_of(5, 30.0, spring(-0.5)));
    let with = |method: &str| {
        let args = [
            "t.csv",
            "--validate",
            "v.csv",
            "--out",
            method,
            "--method",
            method,
        ];
        study(dir.path(), &args)
    };
    let (code, out, err) = with("passive");
    assert_eq!(code, 1, "{out}{err}");
    let said = "passive failed: predicts data left out worse than a constant";
    assert!(out.contains("VAF") && err.contains(said), "{out}{err}");
    let notes = |method: &str| {
        let written = fs::read_dir(dir.path().join(method)).unwrap();
        let named = written.filter(|file| {
            let text = fs::read_to_string(file.as_ref().unwrap().path()).unwrap();
            text.contains("note = \"failed: predicts data left out worse than a constant")
        });
        named.count()
    };
    assert_eq!(notes("passive"), 1);
    let (code, _, err) = with("static");
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("static failed: predicts"), "{err}");
    assert_eq!(notes("static"), 0);
}
