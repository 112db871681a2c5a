//! A session with a mirror: the page says which of the two folders has everything.

#![cfg(unix)]

use crate::support::player::{play_to_end, play_until};
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use std::fs;
use std::path::Path;

fn start(folder: &Path, id: &str, more: &[&str]) -> Terminal {
    let arguments = ["run", "protocol", "--operator", "lw", "--participant", id];
    let arguments = [&arguments[..], more].concat();
    Terminal::start(&arguments, folder, 24, 80)
}

#[test]
fn the_page_says_which_folder_has_everything() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let once = ("repetitions = 3", "repetitions = 1");
    changed_protocol("turn-signal", &folder.join("protocol"), &[PATIENT, once]);
    let mirror = folder.join("mirror");
    let refused = study(&["run", "protocol", "--mirror", "mirror"], folder);
    assert_ne!(refused.0, 0);
    fs::create_dir(&mirror).unwrap();

    let mut terminal = start(folder, "P01", &["--mirror", "mirror"]);
    play_until(&mut terminal, "P01", "trial 2 of");
    terminal.wait_for("saved ✓✓ 1 of 1");
    // the second disk is gone
    let aside = folder.join("aside");
    fs::rename(&mirror, &aside).unwrap();
    fs::write(&mirror, "").unwrap();
    play_until(&mut terminal, "P01", "trial 3 of");
    terminal.wait_for("saved ✓ 2 of 2 · NO MIRROR");
    play_to_end(&mut terminal, "P01");
    let said = terminal.screen().replace('\n', "");
    for words in [
        "the mirror was left behind",
        "finished and saved",
        "Receipt: ",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");

    // it comes back, and is brought up to date; device.toml can name it
    fs::remove_file(&mirror).unwrap();
    fs::rename(&aside, &mirror).unwrap();
    let (code, out, _) = study(&["verify", "results", "--against", "mirror"], folder);
    assert_eq!(code, 4, "{out}");
    fs::write(folder.join("device.toml"), "mirror = \"mirror\"\n").unwrap();
    let mut terminal = start(folder, "P02", &[]);
    play_until(&mut terminal, "P02", "trial 2 of");
    terminal.wait_for("saved ✓✓ 1 of 1");
    play_to_end(&mut terminal, "P02");
    let (code, out, err) = study(&["verify", "results", "--against", "mirror"], folder);
    assert_eq!(code, 0, "{out}{err}");
}

#[test]
fn a_results_folder_that_is_lost_costs_nothing() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let once = ("repetitions = 3", "repetitions = 1");
    changed_protocol("turn-signal", &folder.join("protocol"), &[PATIENT, once]);
    let (results, mirror) = (folder.join("results"), folder.join("mirror"));
    fs::create_dir(&mirror).unwrap();
    let mut terminal = start(folder, "P01", &["--mirror", "mirror"]);
    play_until(&mut terminal, "P01", "trial 2 of");
    terminal.wait_for("saved ✓✓ 1 of 1");
    // the first disk is gone
    let aside = folder.join("aside");
    fs::rename(&results, &aside).unwrap();
    fs::write(&results, "").unwrap();
    play_until(&mut terminal, "P01", "trial 3 of");
    terminal.wait_for("saved ✓ 2 of 2 · ONLY IN MIRROR");
    play_to_end(&mut terminal, "P01");
    let said = terminal.screen().replace('\n', "");
    for words in [
        "the results folder was left behind",
        "the mirror has everything that was saved",
        "finished and saved in mirror/turn-signal.",
        "Receipt: ",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let done = |name: &str| {
        let (code, out, err) = study(&["verify", name], folder);
        assert_eq!(code, 0, "{out}{err}");
        let pilots = ["analyze", name, "--include", "pilot", "--json"];
        let (code, out, err) = study(&pilots, folder);
        assert_eq!(code, 0, "{err}");
        let json: serde_json::Value = serde_json::from_str(&out).unwrap();
        json["counts"]["rated"].as_u64()
    };
    assert_eq!(done("mirror"), Some(5));

    // it comes back, and the next start brings it up to date
    fs::remove_file(&results).unwrap();
    fs::rename(&aside, &results).unwrap();
    let (code, out, _) = study(&["verify", "results", "--against", "mirror"], folder);
    assert_eq!(code, 4, "{out}");
    let mut terminal = start(folder, "P02", &["--mirror", "mirror"]);
    play_until(&mut terminal, "P02", "trial 2 of");
    terminal.wait_for("saved ✓✓ 1 of 1");
    play_to_end(&mut terminal, "P02");
    let (code, out, err) = study(&["verify", "results", "--against", "mirror"], folder);
    assert_eq!(code, 0, "{out}{err}");
    assert_eq!(done("results"), Some(10));
}
