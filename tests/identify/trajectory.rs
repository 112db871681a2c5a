//! The command `study trajectory`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use predicates::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

fn study() -> Command {
    Command::cargo_bin("study").unwrap()
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("protocols/turn-signal")
        .join(name)
}

#[test]
fn the_papers_trajectories_are_drawn_and_pass() {
    for (name, range) in [
        ("training.toml", "position 1.5"),
        ("validation-1.5hz.toml", "position 2.50 to 32.50 mm"),
    ] {
        study()
            .arg("trajectory")
            .arg(shipped(name))
            .assert()
            .success()
            .stdout(
                predicate::str::contains(range)
                    .and(predicate::str::contains("velocity, mm/s"))
                    .and(predicate::str::contains("spectrum")),
            );
    }
}

/// Before anything moves: a better force sensor shows a smaller mass, and the mass in the summary is that of the
/// library.
#[test]
fn what_a_recording_will_identify_is_said_before_it() {
    let least_mass = |noise: &str| -> f64 {
        let output = study()
            .arg("trajectory")
            .arg(shipped("training.toml"))
            .args(["--noise", noise, "--rate", "500"])
            .output()
            .unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(
            text.contains("identifiable, at 500 Hz with an encoder of 0.005 mm"),
            "{text}"
        );
        assert!(text.contains("in 100 % of the travel"), "{text}");
        let words = text
            .split("mass: from ")
            .nth(1)
            .unwrap_or_else(|| panic!("{text}"));
        let mut words = words.split(' ');
        let value: f64 = words.next().unwrap().parse().unwrap();
        value * if words.next() == Some("kg") { 1e3 } else { 1.0 }
    };
    let [fine, coarse] = ["0.01", "1"].map(least_mass);
    assert!(fine > 0.0 && coarse > 50.0 * fine, "{fine} {coarse}");
    study()
        .arg("trajectory")
        .arg(shipped("validation-1.5hz.toml"))
        .args(["--noise=-1"])
        .assert()
        .code(2);
}

#[test]
fn the_csv_has_a_row_for_every_sample_and_is_overwritten_only_with_force() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("t.csv");
    let command = |force: &[&str]| {
        let mut command = study();
        command
            .arg("trajectory")
            .arg(shipped("validation-1.5hz.toml"));
        command
            .args(["--rate", "500", "--out"])
            .arg(&out)
            .args(force);
        command.assert()
    };
    command(&[]).success();
    let text = fs::read_to_string(&out).unwrap();
    assert_eq!(text.lines().next(), Some("t_s,x_mm,v_mm_s,a_m_s2"));
    assert_eq!(text.lines().count(), 1 + 500 * 21 + 1);
    // a quarter of a period after two whole ones: a reversal
    let turn = text.lines().find(|l| l.starts_with("1.500000,")).unwrap();
    let row: Vec<f64> = turn.split(',').map(|f| f.parse().unwrap()).collect();
    assert!(
        (row[1] - 32.5).abs() < 1e-5 || (row[1] - 2.5).abs() < 1e-5,
        "{turn}"
    );
    command(&[])
        .code(1)
        .stderr(predicate::str::contains("already exists"));
    command(&["--force"]).success();
}

#[test]
fn a_trajectory_beyond_a_stop_is_refused_and_nothing_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(shipped("validation-1.5hz.toml")).unwrap();
    let spec = dir.path().join("far.toml");
    fs::write(
        &spec,
        text.replace("amplitude_mm = 15", "amplitude_mm = 18"),
    )
    .unwrap();
    let out = dir.path().join("t.csv");
    for command in ["trajectory", "record"] {
        study()
            .arg(command)
            .arg(&spec)
            .arg("--out")
            .arg(&out)
            .assert()
            .code(1)
            .stderr(
                predicate::str::contains("the limit of the target, from ")
                    .and(predicate::str::contains("hint")),
            );
        assert!(!out.exists());
    }
}

#[test]
fn all_faults_of_a_trajectory_file_are_reported_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let spec = dir.path().join("bad.toml");
    fs::write(
        &spec,
        "format = \"study-trajectory/1\"\noffset_mm = nan\nduration_s = 0\nrampe_s = 1\n\
         [[parts]]\nkind = \"sinus\"\n\
         [[parts]]\nkind = \"prbs\"\namplitude_mm = 1\norder = 40\nbit_s = 0.1\nrise_s = 0.2\n\
         [[parts]]\nkind = \"steps\"\nlevels_mm = [1, 1]\nspeed_mm_s = 10\nacceleration_m_s2 = 1\n",
    )
    .unwrap();
    study()
        .arg("trajectory")
        .arg(&spec)
        .assert()
        .code(1)
        .stderr(
            predicate::str::contains("`offset_mm` has to be from -1000 to 1000, not NaN")
                .and(predicate::str::contains("`duration_s` has to be from"))
                .and(predicate::str::contains("did you mean `ramp_s`?"))
                .and(predicate::str::contains("did you mean `sine`?"))
                .and(predicate::str::contains(
                    "`parts[1].order` has to be from 3 to 16",
                ))
                .and(predicate::str::contains("is longer than a bit"))
                .and(predicate::str::contains(
                    "each different from the one before",
                )),
        );
}

#[test]
fn a_written_trajectory_is_read_back() {
    let text = "format = \"study-trajectory/1\"\ntitle = \"a \\\"b\\\"\"\noffset_mm = 17.5\nduration_s = 3\nramp_s = 0.5\n\
        [limits]\ntravel_mm = [1, 34]\nvelocity_mm_s = 500\n\
        [[parts]]\nkind = \"sine\"\namplitude_mm = 1\nfrequency_hz = 2\nphase_deg = 90\n\
        [[parts]]\nkind = \"sweep\"\nshape = \"linear\"\namplitude_mm = 1\nfrom_hz = 1\nto_hz = 2\nperiod_s = 3\n\
        [[parts]]\nkind = \"prbs\"\namplitude_mm = 1\norder = 7\nbit_s = 0.1\nrise_s = 0.05\n\
        [[parts]]\nkind = \"steps\"\nlevels_mm = [1, -1]\nspeed_mm_s = 10\nacceleration_m_s2 = 1\nhold_s = 0.2\n";
    let (first, findings) = study_haptics::trajectory::file::parse("t.toml", text);
    assert!(findings.faults.is_empty(), "{findings:?}");
    let first = first.unwrap();
    let (second, _) = study_haptics::trajectory::file::parse(
        "t.toml",
        &study_haptics::trajectory::file::write(&first),
    );
    assert_eq!(second, Some(first));
}
