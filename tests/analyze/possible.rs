//! `study analyze --possible`.
#![allow(clippy::unwrap_used)]

use assert_cmd::Command;

fn possible(args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("study").unwrap();
    command.args(["analyze", "--possible"]).args(args);
    command
}

#[test]
fn the_papers_numbers_have_one_definition_of_the_sd() {
    let args = ["mean=4.800", "sd=0.997", "n=30", "scale=1..7", "each=3"];
    let done = possible(&args).assert().success();
    let text = String::from_utf8(done.get_output().stdout.clone()).unwrap();
    assert!(
        text.contains("mean 4.800 and SD 0.997 of 30 whole ratings"),
        "{text}"
    );
    assert!(text.contains("the ratings sum to 144"), "{text}");
    assert!(text.contains("sum 144, squares 720"), "{text}");
    assert!(text.contains("the squares would sum to 721"), "{text}");
    assert_eq!(text.matches("\npossible ").count(), 1, "{text}");
    assert_eq!(text.matches("\nimpossible ").count(), 3, "{text}");
    let done = possible(&args).arg("--json").assert().success();
    let json: serde_json::Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
    assert_eq!(json["format"], "study-possible/1");
    assert_eq!(json["definitions"][0]["sums"][0]["squares"], "720");
}

/// Counting stops at a hundred sums.
#[test]
fn more_sums_than_are_counted_are_at_least_so_many() {
    for (n, said) in [("n=100", "and at least "), ("n=20", "and ")] {
        let done = possible(&["mean=4", "sd=2.0", n, "scale=1..7"]).assert();
        let text = String::from_utf8(done.get_output().stdout.clone()).unwrap();
        let more = text.lines().find(|line| line.ends_with(" more")).unwrap();
        let (_, number) = more.split_once(said).unwrap_or_else(|| panic!("{text}"));
        assert!(number.starts_with(|c: char| c.is_ascii_digit()), "{more}");
    }
}

#[test]
fn what_is_missing_or_wrong_is_named() {
    for (args, said) in [
        (vec!["mean=4.8", "sd=1", "n=30"], "needs scale="),
        (
            vec!["mean=4,8", "sd=1", "n=30", "scale=1..7"],
            "plain decimal",
        ),
        (vec!["mean=4.8", "sd=1", "n=0", "scale=1..7"], "from 1 to"),
        (
            vec!["mean=4.8", "sd=1", "n=30", "scale=7..1"],
            "lowest first",
        ),
        (
            vec!["mean=4.8", "sd=1", "n=30", "scale=1..7", "each=4"],
            "no multiple of each=4",
        ),
        (
            vec!["mean=nan", "sd=1", "n=30", "scale=1..7"],
            "plain decimal",
        ),
        (vec!["mean"], "not KEY=VALUE"),
    ] {
        let done = possible(&args).assert().code(1);
        let text = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "{args:?}: {text}");
    }
}

#[test]
fn coarse_numbers_are_checked_in_reasonable_time() {
    possible(&["mean=4", "sd=1", "n=1000", "scale=-100..100"])
        .assert()
        .success();
}
