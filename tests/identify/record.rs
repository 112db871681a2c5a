//! `study record`: a recording with everything needed to reproduce it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use predicates::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::signal::{Acceleration, Excitation, Settings, prepare};
use study_haptics::identify::{Ewls, Training, vaf};
use study_haptics::plant::{Parameters, Probe};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

fn study() -> Command {
    Command::cargo_bin("study").unwrap()
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("protocols/turn-signal")
        .join(name)
}

fn read(path: &Path) -> Recording {
    let file = fs::File::open(path).unwrap();
    recording::read("r", std::io::BufReader::new(file)).unwrap()
}

/// The file in the header under `name`.
fn block(header: &[String], name: &str) -> String {
    let lines = header.iter().skip_while(|line| *line != name).skip(1);
    lines
        .map_while(|line| line.strip_prefix("  "))
        .map(|line| format!("{line}\n"))
        .collect()
}

#[test]
fn the_header_suffices_to_reproduce_the_recording_byte_for_byte() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    study()
        .arg("record")
        .arg(shipped("validation-1.5hz.toml"))
        .args([
            "--plant", "b", "--seed", "7", "--rate", "500", "--filter", "25", "--out",
        ])
        .arg(path("one.csv"))
        .assert()
        .success()
        .stderr(predicate::str::contains("condition number of [a v x 1]"));
    let header = read(&path("one.csv")).header;
    assert!(
        header[0].starts_with("simulated, not measured"),
        "{header:?}"
    );
    fs::write(path("t.toml"), block(&header, "TRAJECTORY:")).unwrap();
    fs::write(path("p.toml"), block(&header, "PLANT:")).unwrap();
    study()
        .arg("record")
        .arg(path("t.toml"))
        .arg("--plant")
        .arg(path("p.toml"))
        .args(["--seed", "7", "--rate", "500", "--filter", "25", "--out"])
        .arg(path("two.csv"))
        .assert()
        .success();
    // the first line names the source of the parameters
    let rest = |name: &str| {
        let text = fs::read_to_string(path(name)).unwrap();
        text.split_once('\n').unwrap().1.to_owned()
    };
    assert_eq!(rest("one.csv"), rest("two.csv"));
}

#[test]
fn the_columns_are_filtered_unless_raw() {
    let record = |extra: &[&str]| {
        let out = study()
            .arg("record")
            .arg(shipped("validation-1.5hz.toml"))
            .args(["--rate", "500"])
            .args(extra)
            .output()
            .unwrap();
        assert!(out.status.success());
        recording::read("r", out.stdout.as_slice()).unwrap()
    };
    let filtered = record(&[]);
    assert_eq!(filtered.len(), 20 * 500 + 1);
    assert!(filtered.warnings.is_empty(), "{:?}", filtered.warnings);
    let raw = record(&["--raw"]);
    // multiples of 5 µm, the resolution of the encoder
    assert!(
        raw.x_mm
            .iter()
            .all(|x| (x / 0.005 - (x / 0.005).round()).abs() < 1e-6)
    );
    // filtering it afterwards gives the same, away from the ends
    let settings = Settings {
        filter_hz: Some(30.0),
        acceleration: Acceleration::Accelerometer,
    };
    let again = prepare(raw, settings).unwrap();
    for i in 200..filtered.len() - 200 {
        assert!((again.x_mm[i] - filtered.x_mm[i]).abs() < 2e-5, "{i}");
        assert!((again.v_mm_s[i] - filtered.v_mm_s[i]).abs() < 1e-2, "{i}");
        assert!((again.f_n[i] - filtered.f_n[i]).abs() < 2e-5, "{i}");
    }
}

#[test]
fn an_unknown_plant_and_an_impossible_filter_are_refused() {
    for (extra, said) in [
        (["--plant", "c"], "no target or file named c"),
        (["--filter", "500"], "below half the sampling rate"),
        (["--filter", "nan"], "the corner frequency of the filter"),
    ] {
        study()
            .arg("record")
            .arg(shipped("validation-1.5hz.toml"))
            .args(extra)
            .assert()
            .code(1)
            .stderr(predicate::str::contains(said));
    }
}

/// A recording by the simulated probe with the filter of the stored recordings.
fn of(name: &str, target: &Parameters, rate_hz: f64, seed: u64) -> Recording {
    let text = fs::read_to_string(shipped(name)).unwrap();
    let trajectory = study_haptics::trajectory::file::parse(name, &text)
        .0
        .unwrap();
    let measured = Probe::default()
        .record(&trajectory, target, rate_hz, seed)
        .unwrap();
    let raw = Recording {
        name: name.into(),
        v_mm_s: vec![0.0; measured.t_s.len()],
        t_s: measured.t_s,
        x_mm: measured.x_mm,
        a_m_s2: measured.a_m_s2,
        f_n: measured.f_n,
        header: Vec::new(),
        sha256: String::new(),
        warnings: Vec::new(),
    };
    let settings = Settings {
        filter_hz: Some(30.0),
        acceleration: Acceleration::Accelerometer,
    };
    let mut done = prepare(raw, settings).unwrap();
    let [from, to] = trajectory.recorded_s();
    let first = done.t_s.partition_point(|t| *t < from - 1e-9);
    let last = done.t_s.partition_point(|t| *t <= to + 1e-9);
    for column in [
        &mut done.t_s,
        &mut done.x_mm,
        &mut done.v_mm_s,
        &mut done.a_m_s2,
        &mut done.f_n,
    ] {
        column.truncate(last);
        column.drain(..first);
    }
    done
}

fn vafs(training: &Recording, validation: &Recording, cells: &[(f64, f64)]) -> Vec<f64> {
    let training = Training::new(training).unwrap();
    cells
        .iter()
        .map(|(lambda, dx)| {
            let estimates = training
                .estimates(Ewls::paper(*lambda, Resample::Point))
                .unwrap();
            let table = training
                .ewls(&estimates, *dx, Resample::Point, Lookup::Linear)
                .unwrap();
            vaf::score(&table.realization, validation).vaf
        })
        .collect()
}

/// Reference: the same cells on the shipped recordings of switch A by another
/// implementation (`tests/identify/golden.rs`); 0.003, another noise.
#[test]
fn recordings_of_switch_a_give_the_vafs_of_the_stored_recordings() {
    let training = of("training.toml", &Parameters::a(), 1000.0, 1);
    let validation = of("validation-1.5hz.toml", &Parameters::a(), 1000.0, 2);
    assert_eq!((training.len(), validation.len()), (60_001, 20_001));
    let cells = [(0.99, 0.5), (0.999, 0.5), (0.9995, 0.5), (0.9999, 0.5)];
    let found = vafs(&training, &validation, &cells);
    for (found, expected) in found.iter().zip([0.987545, 0.951895, 0.827907, 0.363831]) {
        assert!((found - expected).abs() < 0.003, "{found} {expected}");
    }
    let swept = Excitation::of(&training);
    let sine = Excitation::of(&validation);
    // about 5 and 6500 by the description of the switch
    assert!(
        (3.0..8.0).contains(&swept.median().unwrap()),
        "{:?}",
        swept.median()
    );
    assert!(swept.warning().is_none() && sine.warning().is_some());
    assert!(sine.median().unwrap() > 1000.0, "{:?}", sine.median());
}
