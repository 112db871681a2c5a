//! The model files of the protocols are what `protocols/identify.sh` makes of the
//! recordings in tests/data, to the last byte; and a file of this format's first
//! day still reads as it did.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use study::identify::grid::{self, Plan};
use study::identify::resample::Resample;
use study::identify::{Method, Training};
use study::model::predict::{Direction, Lookup};
use study::model::{Branch, Provenance, Realization, Trained, file};
use study::recording::{self, Recording};

fn recording(name: &str, file: &str) -> Recording {
    let path = Path::new("tests/data/recordings").join(file);
    recording::read(name, BufReader::new(File::open(path).unwrap())).unwrap()
}

/// Id → file, made by the library.
fn made(jobs: &[(&str, Plan)]) -> BTreeMap<String, String> {
    let train = recording("training_a", "training_a.csv");
    let validation = recording("validation-1.5hz", "validation_a.csv");
    let training = Training::new(&train).unwrap();
    let mut files = BTreeMap::new();
    for (template, plan) in jobs {
        let cells = grid::run(&training, plan, Lookup::Linear, &[&validation], || ()).unwrap();
        for cell in cells {
            let mut realization = cell.realization;
            let number = |n: Option<f64>| n.map_or(String::new(), |n| n.to_string());
            realization.id = template
                .replace("{lambda}", &number(realization.provenance.lambda))
                .replace("{dx}", &number(realization.provenance.dx_mm));
            files.insert(realization.id.clone(), file::write(&realization));
        }
    }
    files
}

fn shipped(dir: &str) -> BTreeMap<String, String> {
    fs::read_dir(dir)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            (stem, fs::read_to_string(path).unwrap())
        })
        .collect()
}

fn ewls(lambdas: &[f64], dx_mm: &[f64]) -> Plan {
    Plan::ewls(lambdas, dx_mm, Resample::Point)
}

const PAPER: [f64; 5] = [0.9991, 0.9993, 0.9995, 0.9997, 0.9999];

fn assert_same(dir: &str, jobs: &[(&str, Plan)]) {
    let made = made(jobs);
    let shipped = shipped(dir);
    assert_eq!(
        shipped.keys().collect::<Vec<_>>(),
        made.keys().collect::<Vec<_>>()
    );
    for (id, text) in &shipped {
        assert!(
            *text == made[id],
            "{dir}/{id}.toml is not what identify.sh makes"
        );
        let (realization, findings) = file::parse(id, text);
        assert_eq!(findings.faults, []);
        let realization = realization.unwrap();
        assert_eq!(realization.id, *id);
        assert!(realization.vaf.contains_key("validation-1.5hz"));
    }
}

#[test]
fn the_papers_five_realizations_come_from_the_recording() {
    assert_same(
        "protocols/turn-signal/models",
        &[("lambda-{lambda}", ewls(&PAPER, &[1.0]))],
    );
}

#[test]
fn the_extended_realizations_come_from_the_recording() {
    assert_same(
        "protocols/turn-signal-extended/models",
        &[
            ("lambda-{lambda}-dx-{dx}", ewls(&PAPER, &[1.0])),
            ("lambda-{lambda}-dx-{dx}", ewls(&[0.99], &[0.5, 1.0])),
            ("lambda-{lambda}-dx-{dx}", ewls(&[0.999], &[0.5])),
            ("practice-lambda-{lambda}-dx-{dx}", ewls(&[0.998], &[2.0])),
            ("static", Plan::one(Method::Static, &[1.0])),
            ("spring", Plan::one(Method::Spring, &[])),
        ],
    );
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
    };
    assert_eq!(realization, Some(expected));
}
