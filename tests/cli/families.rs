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
    let clipped = "the family `friction` needs up to 8.3 N at rest, and the device clips at 2.5 N";
    assert!(warnings.contains(clipped), "{warnings}");
}
