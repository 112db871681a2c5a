//! The shipped model files equal the output of `protocols/identify.sh` byte for byte, and
//! files of format version 1 are read unchanged.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use study_haptics::model::{Branch, Provenance, Realization, Trained, file};
use study_haptics::recording;
use study_wire::predict::{Direction, Lookup, Motion};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings};

const FOLDERS: [&str; 3] = ["turn-signal", "turn-signal-extended", "turn-signal-passive"];
const VALIDATION: &str = "validation-1.5hz";

/// File name → text of one protocol's models.
fn files(protocols: &Path, protocol: &str) -> BTreeMap<String, String> {
    fs::read_dir(protocols.join(protocol).join("models"))
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            (stem, fs::read_to_string(path).unwrap())
        })
        .collect()
}

fn shipped(protocol: &str) -> BTreeMap<String, Realization> {
    files(Path::new("protocols"), protocol)
        .iter()
        .map(|(stem, text)| {
            let (realization, findings) = file::parse(stem, text);
            assert_eq!(findings.faults, []);
            let realization = realization.unwrap();
            assert_eq!(realization.id, *stem);
            (stem.clone(), realization)
        })
        .collect()
}

/// Starts from the trajectories. Takes a minute without optimization:
/// `cargo test --release --test identify shipped -- --ignored`
#[test]
#[ignore = "a minute unoptimized"]
fn the_script_reproduces_every_file_byte_for_byte() {
    let dir = tempfile::tempdir().unwrap();
    Command::new("sh")
        .arg("protocols/identify.sh")
        .env("STUDY", assert_cmd::cargo::cargo_bin!("study"))
        .env("PROTOCOLS", dir.path())
        .assert()
        .success();
    for protocol in FOLDERS.into_iter().chain(["knob", "realism-search"]) {
        let made = files(dir.path(), protocol);
        let shipped = files(Path::new("protocols"), protocol);
        assert_eq!(
            shipped.keys().collect::<Vec<_>>(),
            made.keys().collect::<Vec<_>>()
        );
        for (stem, text) in shipped {
            assert!(text == made[&stem], "{protocol}/{stem}.toml");
        }
    }
}

/// The simulated probe, its filter and the file format have not changed since the
/// realizations were identified. If they change for a good reason, increment
/// `plant::SIMULATION` and run `protocols/identify.sh`.
#[test]
fn the_recordings_of_the_shipped_realizations_are_reproduced_byte_for_byte() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("again.csv");
    Command::cargo_bin("study")
        .unwrap()
        .args(["record", "protocols/turn-signal/validation-1.5hz.toml"])
        .args(["--plant", "b", "--rate", "10000", "--seed", "2", "--out"])
        .arg(&path)
        .assert()
        .success();
    let made = recording::read("again", BufReader::new(File::open(path).unwrap())).unwrap();
    for protocol in FOLDERS {
        for (stem, realization) in shipped(protocol) {
            let recordings = &realization.provenance.recordings;
            assert_eq!(recordings[VALIDATION], made.sha256, "{protocol}/{stem}");
        }
    }
}

#[test]
fn the_shipped_realizations_name_their_recordings() {
    let mut trainings = BTreeSet::new();
    for (stem, realization) in FOLDERS.into_iter().flat_map(shipped) {
        let provenance = realization.provenance;
        assert!(realization.vaf.contains_key(VALIDATION), "{stem}");
        let note = provenance.note.unwrap();
        assert!(note.starts_with("simulated, not measured"), "{note}");
        assert!(
            note.contains("study record training.toml --plant b --rate 10000 --seed 1"),
            "{note}"
        );
        assert!(provenance.filter.unwrap().ends_with("at 30 Hz"), "{stem}");
        trainings.insert(provenance.recordings["training"].clone());
    }
    assert_eq!(trainings.len(), 1);
}

/// Colton & Hollerbach 2007, Fig. 11: of the five realizations of the study λ = 0.9995
/// has the highest VAF, and it falls to both sides.
#[test]
fn the_papers_five_realizations_have_the_papers_order() {
    let vafs: Vec<f64> = [0.9991, 0.9993, 0.9995, 0.9997, 0.9999]
        .iter()
        .map(|lambda| shipped("turn-signal")[&format!("lambda-{lambda}")].vaf[VALIDATION])
        .collect();
    let [a, b, peak, d, e] = vafs[..] else {
        unreachable!()
    };
    assert!(a < b && b < peak && peak > d && d > e, "{vafs:?}");
}

/// Whether VAF predicts ratings can be judged only if it varies.
#[test]
fn the_extended_realizations_are_spread_in_vaf() {
    let mut vafs: Vec<f64> = shipped("turn-signal-extended")
        .into_iter()
        .filter(|(stem, _)| stem.starts_with("lambda-"))
        .map(|(_, realization)| realization.vaf[VALIDATION])
        .collect();
    vafs.sort_by(f64::total_cmp);
    assert_eq!(vafs.len(), 8);
    assert!(vafs[7] - vafs[0] > 0.4, "{vafs:?}");
    // no half of them is clustered
    assert!(vafs[4] < vafs[7] - 0.05, "{vafs:?}");
    let anchor = shipped("turn-signal-extended")["spring"].vaf[VALIDATION];
    assert!(anchor < 0.1, "{anchor}");
}

/// The passive two pass without permission, and predict better than any of the paper's.
#[test]
fn the_passive_realizations_are_certified_and_predict_best() {
    let all = shipped("turn-signal-passive");
    let vaf = |id: &str| all[id].vaf[VALIDATION];
    for id in ["passive", "mechanism"] {
        let certificate = all[id].certificate();
        assert!(certificate.passes(), "{id}: {certificate}");
        // what the simulated device renders
        assert!(certificate.rendered_n_per_mm() < 100.0, "{id}");
    }
    assert!(vaf("passive") > 0.99 && vaf("mechanism") > 0.9994);
}

/// A stroke into an edge that is faster than those of the recordings: through the servo of a
/// device, at rest at the edge and on the way back, the force stays within what the mechanism
/// has in slow motion.
#[test]
fn a_fast_stroke_into_an_edge_meets_no_force_that_no_data_support() {
    let all = shipped("turn-signal-passive");
    let what = &all["mechanism"];
    let mechanism = what.mechanism.as_ref().unwrap();
    let [low, high] = what.trained.x_mm;
    let rendering = Rendering {
        law: Law::Mechanism(mechanism.view()),
        range_mm: [low, high],
        trained_mm_s: what.trained.v_mm_s,
    };
    let settings = ServoSettings::new();
    // the stroke's speed, then, at rest at the edge and 5 mm from it, the force
    let stroke = |from: f64, edge: f64, mm_s: f64| {
        let mut servo = Servo::<f64>::new(settings);
        servo.start();
        let mut x_mm = from;
        let mut forces = Vec::new();
        let legs = [(from, 0.5, 1.0), (edge, 0.3, mm_s), (from, 0.0, 20.0)];
        for (to, rest_s, speed) in legs {
            let moving = ((to - x_mm).abs() / speed * settings.servo_hz) as usize;
            let resting = (rest_s * settings.servo_hz) as usize;
            let by = (to - x_mm) / moving.max(1) as f64;
            for step in 0..moving + resting {
                let moves = step < moving;
                x_mm += if moves { by } else { 0.0 };
                let v_mm_s = if moves { by * settings.servo_hz } else { 0.0 };
                let motion = Motion {
                    v_mm_s,
                    ..Motion::at_rest(x_mm)
                };
                let force_n = servo.step(&rendering, motion);
                // on the way in it has the impact of the follower as well
                let counts = speed == 20.0 || (speed == mm_s && step > moving + resting / 2);
                if counts {
                    forces.push(force_n);
                }
            }
        }
        forces
    };
    for (from, edge) in [(20.0, low), (14.0, high)] {
        let slow = stroke(from, edge, 20.0);
        let most = slow.iter().fold(0.0, |most: f64, n| most.max(n.abs()));
        for mm_s in [180.0, 200.0, 300.0] {
            let fast = stroke(from, edge, mm_s);
            let found = fast.iter().fold(0.0, |most: f64, n| most.max(n.abs()));
            assert!(
                found < 1.1 * most,
                "{mm_s} mm/s to {edge}: {found} N, {most} N"
            );
            let apart = |i: usize| (fast[fast.len() - i] - slow[slow.len() - i]).abs();
            // a few mm from the edge nothing is left of how it was reached
            let back = (7.0 / 20.0 * settings.servo_hz) as usize;
            assert!((1..back).all(|i| apart(i) < 0.3), "{mm_s} mm/s to {edge}");
        }
    }
}

/// Do not change this test or its file: a file that somebody has stays readable.
#[test]
fn a_version_1_file_reads_as_it_always_did() {
    let text = fs::read_to_string("tests/golden/model_v1.toml").unwrap();
    let (realization, findings) = file::parse("model_v1.toml", &text);
    assert_eq!(findings.faults, []);
    let zero = vec![0.0, 0.0, 0.0];
    let expected = Realization {
        id: "golden-1".into(),
        provenance: Provenance {
            method: "ewls".into(),
            lambda: Some(0.9995),
            memory_mm: Some(2.25),
            dx_mm: Some(0.5),
            resample: Some("hat".into()),
            filter: Some("Butterworth 2, 20 Hz, zero phase".into()),
            recordings: [("train \"1\"".to_owned(), "00ff".to_owned())].into(),
            note: Some("made by hand\nfor this test".into()),
            ..Provenance::default()
        },
        vaf: [
            ("validation-1.5hz".to_owned(), 0.79),
            ("other".to_owned(), -11.0),
        ]
        .into(),
        lookup: Lookup::Nearest,
        direction: Direction::Dahl { delta_mm: 0.6 },
        trained: Trained {
            x_mm: [-1.0, 35.25],
            v_mm_s: 140.0,
        },
        x_mm: vec![-0.5, 0.0, 30.0],
        positive: Branch {
            m_kg: vec![0.1, -0.2, 1e-7],
            b_n_s_per_mm: vec![0.01, 0.02, 0.03],
            k_n_per_mm: zero.clone(),
            f0_n: vec![-8.9, 0.0, 8.9],
        },
        negative: Branch {
            m_kg: zero.clone(),
            b_n_s_per_mm: zero.clone(),
            k_n_per_mm: vec![1.5, -1.5, 2.0],
            f0_n: zero,
        },
        mechanism: None,
        elements: None,
        units: study_haptics::model::Units::Linear,
    };
    assert_eq!(realization, Some(expected));
}

/// Do not change this test or its file. A file of any version is written again as it was: those
/// of versions 1 and 2, which have no coverage, keep their version.
#[test]
fn files_of_all_versions_are_written_as_they_were() {
    let golden = fs::read_to_string("tests/golden/model_v3.toml").unwrap();
    let (realization, findings) = file::parse("model_v3.toml", &golden);
    assert_eq!(findings.faults, []);
    let realization = realization.unwrap();
    assert_eq!(file::write(&realization), golden);
    let coverage = realization.provenance.coverage.unwrap();
    assert_eq!(coverage.directions[0].samples[2], [0, 4_000_000_000]);
    assert_eq!(coverage.directions[1].top_mm_s, 200.0);
    assert_eq!((coverage.full_strokes, coverage.partial_strokes), (12, 3));
    assert_eq!(coverage.held_mm, [[-10.0, -8.5], [25.0, 30.0]]);
    let mass = realization.provenance.terms["m_kg"];
    assert_eq!(
        [mass.value, mass.standard_error, mass.upper_bound],
        [Some(4e-5), Some(1e-6), Some(4.5e-5)]
    );
    let bound = realization.provenance.terms["b_n_s_per_mm"];
    assert_eq!((bound.value, bound.upper_bound), (None, Some(0.000_25)));

    let old = "tests/golden/release_0_1/study/models/lambda-0.9995.toml";
    let second = "crates/study-haptics/tests/data/edge.toml";
    let mut seen = BTreeSet::new();
    for path in [old, second] {
        let text = fs::read_to_string(path).unwrap();
        seen.insert(text.lines().next().unwrap().to_owned());
        let realization = file::parse(path, &text).0.unwrap();
        assert!(realization.provenance.coverage.is_none());
        assert_eq!(file::write(&realization), text, "{path}");
    }
    assert_eq!(seen.len(), 2, "{seen:?}");
}
