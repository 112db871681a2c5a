//! A whole session over a port with a device that turns wrong in the seventh trial.

use crate::support::player::{play_to_end, play_until};
use crate::support::simulator::Simulator;
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Long enough for a hand to go to and fro with the full force.
const FELT: Duration = Duration::from_secs(5);
/// What would tell the experimenter something about the realization.
const TELLING: [&str; 8] = [
    "lambda", "table", "gain", "limit", "force", "newton", " N ", "VAF",
];

type Row = BTreeMap<String, String>;

fn rows(path: &Path) -> Vec<Row> {
    let mut file = csv::Reader::from_path(path).unwrap();
    file.deserialize().map(Result::unwrap).collect()
}

/// The force is not clamped in the seventh trial. The experimenter reads a neutral
/// sentence, the trial comes again, and columns, status and report say what was found.
#[test]
fn a_device_that_turns_wrong_costs_an_attempt_and_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let device = Simulator::start(folder.path(), &["--wrong", "no-clamp@7"]);
    let protocol = folder.path().join("protocol");
    let changes = [("\"simulated\"", "\"serial\""), PATIENT];
    changed_protocol("turn-signal", &protocol, &changes);
    let (path, port) = (
        protocol.to_str().unwrap(),
        device.port.to_str().unwrap().to_owned(),
    );
    let arguments = ["run", path, "--operator", "lw", "--port", &port];
    let mut terminal = Terminal::start(&arguments, folder.path(), 24, 80);
    terminal.wait_for("Who takes part?");
    play_until(&mut terminal, "P01", "trial 7 of 15");
    // On a busy machine a playback may end for want of heartbeats; it comes again.
    let (page, seen) = loop {
        play_until(&mut terminal, "P01", "Enter: rate");
        std::thread::sleep(FELT);
        terminal.keys("\r");
        terminal.wait_until("the playback to end", |s| {
            s.contains("DEVICE TROUBLE") || s.contains("1–7: choose")
        });
        let page = terminal.screen();
        let words: Vec<&str> = (page.split(|c: char| c.is_whitespace() || c == '┃'))
            .filter(|word| !word.is_empty())
            .collect();
        let flowing = words.join(" ");
        if flowing.contains("the device did not do what it was told") {
            break (page, flowing);
        }
    };
    assert!(page.contains("DEVICE TROUBLE"), "{page}");
    // What this page says of every trouble.
    let own = seen.replace("The device produces no force.", "");
    for word in TELLING {
        assert!(!own.contains(word), "{word}:\n{page}");
    }
    // Somebody puts the device in order.
    drop(device);
    let _device = Simulator::start(folder.path(), &[]);
    play_to_end(&mut terminal, "P01");

    let results = folder.path().join("results/turn-signal");
    let ratings = rows(&results.join("ratings.csv"));
    assert_eq!(ratings.len(), 15);
    for row in &ratings {
        assert_eq!(row["status"], "ok");
        assert!(matches!(&*row["rendering"], "ok" | "too-little"), "{row:?}");
    }
    let failed: Vec<Row> = (rows(&results.join("attempts.csv")).into_iter())
        .filter(|row| row["failure"] == "rendering")
        .collect();
    assert!(!failed.is_empty());
    for row in &failed {
        assert!(row["text"].contains("over-limit"), "{row:?}");
    }
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let (_, out, _) = study(&["status", "results"], folder.path());
    let faults = format!(", {} fault\n", failed.len());
    assert!(out.contains(&faults), "{out}");
}
