//! Whole sessions over the bridges to devices that labs own, each on a mock of its device. Whether a
//! bridge plays rightly is judged by `study device check` (`.ci/clients`), on a computer that does
//! nothing else.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::devices::{felt, has_python, protocol, session};
use crate::support::repository;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// A mock, which ends with its standard input.
struct Mock {
    child: Child,
    /// What it prints: a number of a TCP port, or a pseudo-terminal.
    address: String,
}

impl Mock {
    fn start(bridge: &str, arguments: &[&str]) -> Self {
        let mut child = Command::new("python3")
            .arg(repository(&format!("bridges/{bridge}/mock.py")))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut address = String::new();
        let mut printed = BufReader::new(child.stdout.take().unwrap());
        printed.read_line(&mut address).unwrap();
        let address = address.trim().to_owned();
        assert!(!address.is_empty(), "the mock of {bridge} does not begin");
        Self { child, address }
    }
}

impl Drop for Mock {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Every trial is rated and has its playback with telemetry, as a pilot on the device that the bridge
/// names, and no page tells a realization.
fn a_session_over(bridge: &str, mock: &[&str], options: &str) {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"process\"")]);
    let mock = Mock::start(bridge, mock);
    let script = repository(&format!("bridges/{bridge}/bridge.py"));
    // the hand of the mock strokes about 0, the tables from 1.5 to 33.5 mm
    let command = format!(
        "python3 '{script}' --simulated --id lab-1 --port {} --origin=-17.5 --force 15 --velocity 1000 {options}",
        mock.address
    );
    let (pages, rows) = session(folder.path(), &protocol, &["--command", &command]);
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert_eq!(felt(row), ["ok", "process", "lab-1", "true"]);
        let felt_s: f64 = row["exploration_s"].parse().unwrap();
        assert!(felt_s >= 2.0, "{row:?}");
        // on a computer that is late, too little may be known of the force
        assert_ne!(row["rendering"], "fault", "{row:?}");
    }
    let telemetry = folder
        .path()
        .join("results/turn-signal/sessions/P01/1/telemetry");
    // and a trial may take several attempts
    assert!(std::fs::read_dir(telemetry).unwrap().count() >= 5);
    let told = pages.iter().find(|page| page.contains("lambda"));
    assert_eq!(told, None);
}

#[test]
fn a_session_over_the_haply_bridge() {
    a_session_over("haply", &["--port", "0"], "--axis x");
}

#[test]
fn a_session_over_the_moteus_bridge() {
    a_session_over("moteus", &[], "--radius 20");
}

#[test]
fn a_session_over_the_simplefoc_bridge() {
    a_session_over("simplefoc", &[], "--radius 20 --newton 0.8 --current");
}
