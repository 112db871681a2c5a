//! Physical checks by a person, played by the test: it knows where the handle really is.

use crate::support::simulator::Simulator;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Time in which the handle reaches a place, also on a busy machine.
const ON_THE_WAY: Duration = Duration::from_secs(3);

/// Does all steps on a device; exit code, the record and the page.
fn commissioned(folder: &Path, more: &[&str], mass_g: &str) -> (i32, serde_json::Value, String) {
    let mut device = Simulator::start(folder, more);
    device.control("hold 10");
    let mut child = Command::new(env!("CARGO_BIN_EXE_study"))
        .args(["device", "commission", "--operator", "LW", "--port"])
        .arg(&device.port)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut answers = child.stdin.take().unwrap();
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let line = line.unwrap();
        let mut place = |x_mm: &str| {
            device.control(&format!("hold {x_mm}"));
            std::thread::sleep(ON_THE_WAY);
            x_mm.to_owned()
        };
        let answer = if line.contains("Towards which side") {
            "-".to_owned()
        } else if line.contains("Which mass balances it") {
            mass_g.to_owned()
        } else if line.contains("a first place") {
            place("10")
        } else if line.contains("a second place") {
            place("30")
        } else if line.contains("Was the force gone") {
            device.control("trip");
            "yes".to_owned()
        } else if line.contains("Release the switch") {
            "yes".to_owned()
        } else if line.contains("Which force moves it") {
            "0,4".to_owned()
        } else {
            continue;
        };
        writeln!(answers, "{answer}").unwrap();
    }
    let code = child.wait().unwrap().code().unwrap();
    let records = folder.join("results/devices/simulated-1");
    let mut found = (serde_json::Value::Null, String::new());
    for item in std::fs::read_dir(records).unwrap() {
        let path = item.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        match path.extension().and_then(|e| e.to_str()) {
            Some("json") => found.0 = serde_json::from_str(&text).unwrap(),
            _ => found.1 = text,
        }
    }
    (code, found.0, found.1)
}

fn step<'r>(record: &'r serde_json::Value, what: &str) -> &'r serde_json::Value {
    let parts = record["parts"].as_array().unwrap();
    parts.iter().find(|part| part["what"] == what).unwrap()
}

#[test]
fn the_right_device_passes_and_is_marked_as_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let (code, record, page) = commissioned(folder.path(), &[], "203.9");
    assert_eq!(code, 0, "{record:#}");
    assert_eq!(
        (&record["pass"], &record["simulated"]),
        (&true.into(), &true.into())
    );
    assert_eq!(record["kind"], "commission");
    let weight = step(&record, "weight");
    for (key, said) in [
        ("required", "balanced by 204 g within 10 %"),
        ("seen", "gain 1.00"),
    ] {
        assert!(weight[key].as_str().unwrap().contains(said), "{weight}");
    }
    assert_eq!(step(&record, "unpowered friction")["seen"], "0.4 N");
    for text in ["SIMULATED", "All steps passed", "by LW", "emergency stop"] {
        assert!(page.contains(text), "{text}: {page}");
    }
}

/// The devices of docs/wrong-devices.md that no telemetry shows.
#[test]
fn a_ruler_finds_a_wrong_scale_and_a_wrong_origin() {
    for (wrong, seen) in [
        ("half-position", "scale 0.500"),
        ("shifted-position", "off by 3.00 mm"),
        ("mirrored", "scale -1.000"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (code, record, page) = commissioned(folder.path(), &["--wrong", wrong], "203.9");
        assert_eq!(code, 3, "{wrong}: {record:#}");
        assert_eq!(record["pass"], false);
        let ruler = step(&record, "ruler");
        assert_eq!(ruler["outcome"], "failed", "{wrong}: {record:#}");
        assert!(
            ruler["seen"].as_str().unwrap().contains(seen),
            "{wrong}: {ruler}"
        );
        assert!(page.contains("FAILED"));
    }
}

/// A motor that gives half of the force that it is told.
#[test]
fn a_weight_finds_a_weak_motor() {
    let folder = tempfile::tempdir().unwrap();
    let (code, record, _) = commissioned(folder.path(), &[], "102");
    assert_eq!(code, 3, "{record:#}");
    assert_eq!(step(&record, "weight")["outcome"], "failed");
}
