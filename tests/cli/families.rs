//! What `study check` says of a family of levels.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use std::fs;

/// What the family needs, then what the device gives.
#[test]
fn a_family_that_the_device_clips_is_warned_about() {
    let dir = tempfile::tempdir().unwrap();
    let study = |args: &[&str]| -> String {
        let mut command = Command::cargo_bin("study").unwrap();
        let done = command
            .current_dir(dir.path())
            .args(args)
            .assert()
            .success();
        String::from_utf8(done.get_output().stdout.clone()).unwrap()
    };
    study(&["new", "s", "--kind", "staircase"]);
    let path = dir.path().join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("force_n = 12.0"));
    fs::write(&path, text.replace("force_n = 12.0", "force_n = 2.5")).unwrap();
    let warnings = study(&["check", "s", "--json"]);
    let clipped = "the family `friction` needs up to 8.3 N up to its trained speed, and the device clips at 2.5 N";
    assert!(warnings.contains(clipped), "{warnings}");
}

/// Strong friction by the sign of the speed passes its certificate, and is refused as it is of a realization.
#[test]
fn levels_that_are_not_safe_to_play_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let study = |args: &[&str]| crate::support::study(args, dir.path());
    assert_eq!(study(&["new", "s", "--kind", "staircase"]).0, 0);
    let path = dir.path().join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let range = "range = [0.02, 0.6]";
    assert!(text.contains(range));
    fs::write(&path, text.replace(range, "range = [0.02, 6.0]")).unwrap();
    let (code, out, err) = study(&["check", "s"]);
    let said = out + &err;
    assert_eq!(code, 1, "{said}");
    let words = "levels of the family `friction` are not safe to play";
    assert!(said.contains(words), "{said}");
    assert!(said.contains("take a range without level"), "{said}");
}
