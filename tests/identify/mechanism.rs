//! The virtual mechanism: accuracy on switch A, file, and what `study identify` says.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]
#![allow(clippy::print_stdout, reason = "measurements with --nocapture")]

use assert_cmd::Command;
use std::fs::File;
use std::io::BufReader;
use study_base::rng::Stream;
use study_haptics::identify::mechanism::Options;
use study_haptics::identify::{Hat, Method, Passive, Training, vaf};
use study_haptics::model::file;
use study_haptics::plant::Parameters;
use study_haptics::recording::{self, Recording};
use study_wire::predict::{Lookup, Motion};

use crate::switches::{
    Slips, random_slips, random_switch, record_with, slow, training, two_sines, validation,
};

const TRAINING: &str = "tests/data/recordings/training_a.csv";
const VALIDATION: &str = "tests/data/recordings/validation_a.csv";

fn recording(path: &str) -> Recording {
    recording::read("r", BufReader::new(File::open(path).unwrap())).unwrap()
}

/// Ten seconds of training are enough to leave a tenth of the hat table's residual, and
/// to find the backlash; the file is read back as it was.
#[test]
fn a_mechanism_of_ten_seconds_predicts_better_than_a_table_of_sixty() {
    let (train, validation) = (recording(TRAINING), recording(VALIDATION));
    let short: Vec<usize> = (0..10_000).collect();
    let ten_s = train.select(&short);
    let validation = validation.select(&(0..4_000).collect::<Vec<_>>());
    let left = |training: &Recording, method, dx_mm| {
        let training = Training::new(training).unwrap();
        let found = training.identify(method, dx_mm, Lookup::Linear).unwrap();
        (1.0 - vaf::score(&found.realization, &validation).vaf, found)
    };
    let (table, _) = left(&train, Method::Hat(Hat::default()), 0.5);
    let (mechanism, found) = left(&ten_s, Method::Mechanism(Options::default()), 1.0);
    assert!(10.0 * mechanism < table, "{mechanism} {table}");
    let fitted = found.fitted.unwrap();
    assert_eq!(fitted.mechanism.recorded_hz, Some(30.0));
    // the plant of the recording: 0.8 mm, 0.10 and 0.14 kg
    let p = fitted.mechanism.scalars;
    assert!((p.gap_mm - 0.8).abs() < 0.05, "{p:?}");
    assert!((p.handle_kg - 0.10).abs() < 0.02, "{p:?}");
    assert!((p.follower_kg - 0.14).abs() < 0.02, "{p:?}");
    assert_eq!(fitted.attempts.len(), 4);
    assert!(found.realization.certificate().passes());

    let mut realization = found.realization;
    realization.id = "mechanism".into();
    let text = file::write(&realization);
    assert!(text.starts_with("format = \"study-model/2\"\nkind = \"mechanism\"\n"));
    let (read, findings) = file::parse("m.toml", &text);
    assert!(findings.faults.is_empty(), "{:?}", findings.faults);
    assert_eq!(read.unwrap(), realization);
    // a mechanism that would not be passive is refused
    let negative = text.replacen("gap_mm = ", "gap_mm = -", 1);
    assert!(file::parse("m.toml", &negative).0.is_none());
}

/// `cargo test --release --test identify mechanism -- --ignored`
#[test]
#[ignore = "ten seconds in release, minutes without"]
fn the_mechanism_of_switch_a_explains_all_but_a_twenty_thousandth() {
    let began = std::time::Instant::now();
    let out = Command::cargo_bin("study")
        .unwrap()
        .args(["identify", TRAINING, "--validate", VALIDATION])
        .args(["--method", "mechanism", "--json"])
        .assert()
        .success();
    let document: serde_json::Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    let cell = &document["cells"][0];
    let vaf = cell["vaf"]["validation_a"].as_f64().unwrap();
    assert!(vaf >= 0.9995, "{vaf}");
    // measured: 0.99998
    assert!(vaf >= 0.99995, "{vaf}");
    assert_eq!(cell["certificate"]["pass"], true);
    assert_eq!(cell["mechanism"]["parameters"][4]["name"], "backlash");
    assert_eq!(cell["mechanism"]["starts"].as_array().unwrap().len(), 4);
    println!("{vaf} after {:?}", began.elapsed());
}

/// Residual of the hat table over that of passive and mechanism, on three motions, of a
/// switch whose friction neither has: LuGre that depends on the load, with Stribeck, and four
/// Maxwell-slip elements.
fn hard_switch(i: u64) -> [[f64; 2]; 3] {
    let (parameters, slips): (_, Slips) = (random_switch(i), random_slips(i));
    let mut noise = Stream::new(i + 77, &["hard"]);
    let mut record = |name, motion: fn(f64) -> Motion, seconds| {
        record_with(name, &parameters, &slips, motion, seconds, &mut noise)
    };
    let train = record("t", training, 60.0);
    let others = [validation, slow, two_sines].map(|motion| record("v", motion, 20.0));
    let prepared = Training::new(&train).unwrap();
    let identified = [
        Method::Hat(Hat::default()),
        Method::Passive(Passive::default()),
        Method::Mechanism(Options::default()),
    ]
    .map(|method| {
        prepared
            .identify(method, 0.5, Lookup::Linear)
            .unwrap()
            .realization
    });
    for realization in &identified[1..] {
        assert!(realization.certificate().passes(), "switch {i}");
    }
    others.map(|other| {
        let [hat, passive, mechanism] =
            [0, 1, 2].map(|m| 1.0 - vaf::score(&identified[m], &other).vaf);
        println!("switch {i}: {hat:.5} {passive:.5} {mechanism:.6}");
        [hat / passive, hat / mechanism]
    })
}

/// The table is in docs/estimators.md.
///
/// `cargo test --release --test identify mechanism -- --ignored --nocapture`
#[test]
#[ignore = "two minutes in release"]
fn on_ten_switches_with_other_friction_the_mechanism_leaves_a_quarter_of_the_residual() {
    let ratios: Vec<_> = (0..10).map(hard_switch).collect();
    for motion in 0..3 {
        let of = |which: usize| ratios.iter().map(move |r| r[motion][which]);
        let geometric = |which| (of(which).map(f64::ln).sum::<f64>() / 10.0).exp();
        let [least, most] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|fold| [0, 1].map(|which| of(which).reduce(fold).unwrap()));
        let (passive, mechanism) = (geometric(0), geometric(1));
        println!("motion {motion}: {passive:.2} {mechanism:.2}, {least:.2?} to {most:.2?}");
        assert!(passive >= 0.9, "motion {motion}: {passive}");
        assert!(mechanism >= 4.0, "motion {motion}: {mechanism}");
    }
}

/// The stiffness that a device has to state for the passive tables of B and of ten switches
/// with other friction: that of the force over x and over δ together. The simulated device
/// states 100 N/mm. The numbers are in docs/estimators.md.
///
/// `cargo test --test identify ten_other -- --ignored --nocapture`
#[test]
#[ignore = "ten seconds"]
fn the_simulated_device_can_play_the_passive_tables_of_ten_other_switches() {
    let mut asked = Vec::new();
    let others = (0..10).map(|i| (random_switch(i), random_slips(i)));
    let b = (Parameters::b(), [(0.0, 0.0); 4]);
    for (i, (parameters, slips)) in std::iter::once(b).chain(others).enumerate() {
        let mut noise = Stream::new(i as u64, &["stiffness"]);
        let train = record_with("t", &parameters, &slips, training, 60.0, &mut noise);
        let found = (Training::new(&train).unwrap())
            .identify(Method::Passive(Passive::default()), 0.5, Lookup::Linear)
            .unwrap();
        let certificate = found.realization.certificate();
        assert!(certificate.passes(), "{i}");
        let state = certificate.state_n_per_mm.unwrap();
        asked.push(certificate.stiffness_n_per_mm + state);
    }
    println!("N/mm, B first: {asked:.1?}");
    assert!(
        asked.iter().all(|n_per_mm| *n_per_mm < 100.0),
        "{asked:.1?}"
    );
}
