//! The arguments of `study schedule`.

use assert_cmd::Command;
use predicates::str::contains;

fn rows(given: &str) -> assert_cmd::assert::Assert {
    Command::cargo_bin("study")
        .expect("the binary is built with its tests")
        .args(["schedule", "protocol.toml", &format!("--rows={given}")])
        .assert()
}

#[test]
fn rows_that_are_none_are_explained_with_exit_code_2() {
    rows("0").code(2).stderr(contains("rows count from 1"));
    rows("40-1").code(2).stderr(contains("did you mean 1-40?"));
    rows("-3").code(2).stderr(contains("a range such as 1-40"));
    rows("1-x").code(2).stderr(contains("a range such as 1-40"));
    rows("99999999999")
        .code(2)
        .stderr(contains("at most 4294967295 rows"));
}
