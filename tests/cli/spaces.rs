//! What `study check` says of a space, and a search from its template to its maps.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::study;
use std::fs;
use std::path::Path;

/// The template with one thing changed; what `study check` says of it.
fn checked(from: &str, to: &str) -> (i32, String) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, _, said) = study(&["new", "--seed", "20261123", "s", "--kind", "search"], at);
    assert_eq!(code, 0, "{said}");
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    let (code, out, err) = study(&["check", "s"], at);
    (code, out + &err)
}

const AXES: &str = "detent = [0.4, 1.2], friction = [0.0, 1.6]";

#[test]
fn a_space_of_which_some_points_pass_is_used_and_drawn() {
    let (code, said) = checked("", "");
    assert_eq!(code, 0, "{said}");
    assert!(!said.contains("of the 81 points"), "{said}");
    // 12 N are not enough for the strongest detents.
    let (code, said) = checked(AXES, "detent = [0.4, 2.4], friction = [0.0, 1.6]");
    assert_eq!(code, 0, "{said}");
    assert!(
        said.contains("of the 81 points of the space `switch` are never presented"),
        "{said}"
    );
    assert!(
        said.contains("need more than 12 N, at rest or up to their trained speed"),
        "{said}"
    );
    // Friction by the sign of the speed that no damping confines is refused, as it is of a realization.
    let (code, strong) = checked(AXES, "detent = [0.4, 1.2], friction = [0.0, 5.0]");
    assert_eq!(code, 0, "{strong}");
    assert!(strong.contains("9 can put energy into a hand"), "{strong}");
    assert!(
        said.contains("rows from detent 0.4 to 2.4, friction 0 to 1.6 within a row"),
        "{said}"
    );
    assert!(said.contains("######### #########"), "{said}");
    assert!(said.contains("........."), "{said}");
}

/// The table of the template has no damping.
#[test]
fn an_axis_that_changes_nothing_is_warned_about() {
    let (code, said) = checked(AXES, "detent = [0.4, 1.2], b = [0.5, 2.0]");
    assert_eq!(code, 0, "{said}");
    let words =
        "the axis `b` of the space `switch` changes nothing: all of its levels have the same table";
    assert!(said.contains(words), "{said}");
    assert!(!said.contains("the axis `detent`"), "{said}");
    let (_, said) = checked("", "");
    assert!(!said.contains("changes nothing"), "{said}");
}

#[test]
fn a_space_with_nothing_to_search_is_refused_with_a_map() {
    let (code, said) = checked(AXES, "detent = [4.0, 9.0]");
    assert_ne!(code, 0, "{said}");
    assert!(
        said.contains("none of the 9 points of the space `switch` can be presented: 0"),
        "{said}"
    );
    assert!(
        said.contains("(# all, + some, . none): . . . . . . . . ."),
        "{said}"
    );
    for (from, to, expected) in [
        (AXES, "", "`spaces[0].axes` has no axis"),
        (
            AXES,
            "detent = [1.5, 0.5]",
            "`spaces[0].axes.detent` does not rise: 1.5 to 0.5",
        ),
        (
            AXES,
            "friction = [-0.1, 0.5]",
            "`spaces[0].axes.friction` has to begin at 0 or more, not at -0.1",
        ),
        (
            AXES,
            "detent = [1.0]",
            "`spaces[0].axes.detent` has to be two numbers",
        ),
        (AXES, "detents = [0.5, 1.0]", "did you mean `detent`?"),
        (
            "grid = 9",
            "grid = 40",
            "the space has 1600 points; at most 999 are possible",
        ),
        (
            "space = \"switch\"",
            "space = \"other\"",
            "there is no space `other`",
        ),
        (
            "trials = 40, start = 8",
            "trials = 4, start = 8",
            "`parts[0].rule.start` is above `trials`: 8 > 4",
        ),
        (
            "\"preference-gp\", trials",
            "\"preferencegp\", trials",
            "did you mean `preference-gp`?",
        ),
        (
            "study-protocol/3",
            "study-protocol/2",
            "needs the format `study-protocol/3`",
        ),
        (
            "kind = \"simulated\"",
            "kind = \"manual\"",
            "samples mounted by hand are no points of a space",
        ),
    ] {
        let (code, said) = checked(from, to);
        assert!(code != 0 && said.contains(expected), "{to}: {said}");
    }
}

/// Simulated participants search; journals are replayed; maps and tables have every point.
#[test]
fn a_search_is_rehearsed_verified_and_explored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, at);
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        out + &err
    };
    run(&["new", "--seed", "20261123", "s", "--kind", "search"]);
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("grid = 9", "grid = 5");
    let text = text.replace("gap_s = 1.0", "gap_s = 0.8");
    let text = text.replace("max_s = 6 }", "max_s = 5.5, replays = 1 }");
    let text = text.replace(
        "Which one felt more like a real switch?",
        "Which one felt more \\\"alive\\\"?",
    );
    fs::write(&path, text.replace("trials = 40", "trials = 20")).unwrap();
    run(&["rehearse", "s", "--participants", "2", "--out", "r"]);
    let said = run(&["verify", "r"]);
    assert!(said.contains("no problems found"), "{said}");
    let said = run(&["explore", "r", "--include", "simulated", "--out", "maps"]);
    for expected in [
        "Part better: the space switch, 25 of 25 points can be presented",
        "2 participants: best at detent ",
        "SD between people",
        "posterior SD",
        "20 pairs: best at detent ",
        "SIMULATED participants are included.",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(!said.contains("p ="), "{said}");
    let rows = |name: &str| fs::read_to_string(at.join("maps").join(name)).unwrap();
    assert_eq!(rows("better-points.csv").lines().count(), 1 + 3 * 25);
    assert_eq!(rows("better-pairs.csv").lines().count(), 1 + 2 * 20);
    let head = "participant,session,point,model,detent,friction,mean,sd,best\n,,1,switch.1,0.4,0,";
    assert!(
        rows("better-points.csv").starts_with(head),
        "{}",
        rows("better-points.csv")
    );
    // Without those who are simulated nobody has searched.
    assert!(run(&["explore", "r"]).contains("posterior SD"));
    let said = run(&["analyze", "r", "--include", "simulated"]);
    assert!(
        said.contains("confirmed with participants who did not take part in it"),
        "{said}"
    );
    let analysis = at.join("r/s/analysis");
    assert!(analysis.join("figures/part-1-search.svg").is_file());
    let page = fs::read_to_string(analysis.join("report.html")).unwrap();
    assert!(page.contains("What a search found") && page.contains("too good on average"));
    confirmed(at, &rows("better-pairs.csv"));
    no_search(at);
}

/// A second study has the best point and the table with which the search began, and names the search.
fn confirmed(at: &Path, pairs: &str) {
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, at);
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        out + &err
    };
    let arguments = [
        "new",
        "c",
        "--from",
        "r",
        "--confirm",
        "--include",
        "simulated",
        "--seed",
        "7",
    ];
    run(&arguments);
    let said = run(&["check", "c"]);
    assert!(said.contains("0 warnings"), "{said}");
    let text = fs::read_to_string(at.join("c/protocol.toml")).unwrap();
    let hash = format!("pairs_sha256 = \"{}\"", study_base::hex::sha256(pairs));
    assert!(text.contains(&hash), "{hash}: {text}");
    for expected in [
        "alive",
        "id = \"s-confirmation\"",
        "seed = 7",
        "study = \"s\"",
        "searchers = []",
        "better-pairs.csv, which study explore --include simulated --out writes",
        "simulated = true",
        "force_n = 12.0",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // Both parts are felt as the search was.
    for expected in [
        "gap_s = 0.8",
        "exposure = { min_s = 1, max_s = 5.5, replays = 1 }",
    ] {
        assert_eq!(text.matches(expected).count(), 2, "{expected}: {text}");
    }
    rated(at);
    // Not without being asked for.
    let (code, _, said) = study(&["new", "d", "--from", "r", "--confirm"], at);
    assert_eq!(code, 1);
    assert!(
        said.contains("only simulated participants have searched in `better`")
            && said.contains("--include simulated"),
        "{said}"
    );
    assert!(!at.join("d").exists());
    let file = |path: &str| fs::read(at.join(path)).unwrap();
    assert_eq!(
        file("c/models/reference.toml"),
        file("s/models/static.toml")
    );
    run(&["rehearse", "c", "--participants", "2", "--out", "k"]);
    let said = run(&["analyze", "k", "--include", "simulated"]);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    let sentence = "confirms, on participants who did not search, what the part better of the study s found to be best: switch.";
    assert!(said.contains(sentence), "{said}");
    let simulated = "SIMULATED participants searched";
    assert!(said.contains(simulated), "{said}");
    let page = fs::read_to_string(at.join("k/s-confirmation/analysis/report.html")).unwrap();
    assert!(page.contains("No answer of the search is in this analysis"));
    assert!(page.contains(simulated));
    run(&["preregister", "c", "--date", "2026-11-27"]);
    let declared = fs::read_to_string(at.join("c/preregistration.md")).unwrap();
    assert!(
        declared.contains("on participants who did not search") && declared.contains(simulated),
        "{declared}"
    );
}

/// The same two as ratings, of which a margin says when their difference is negligible.
fn rated(at: &Path) {
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, at);
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        out + &err
    };
    let arguments = ["new", "e", "--from", "r", "--confirm", "--ratings"];
    run(&[&arguments[..], &["--include", "simulated"]].concat());
    let said = run(&["check", "e"]);
    assert!(said.contains("0 warnings"), "{said}");
    let text = fs::read_to_string(at.join("e/protocol.toml")).unwrap();
    for expected in [
        "exposure = { min_s = 1, max_s = 5.5, replays = 1 }",
        "equivalence_margin = 0.5",
        "searchers = []",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    run(&["rehearse", "e", "--participants", "4", "--out", "f"]);
    let said = run(&["analyze", "f", "--include", "simulated"]);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    for expected in [
        "best minus reference over participants",
        "Within the margin of ± 0.5",
        "confirms, on participants who did not search",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
}

/// Each of several searches is confirmed by itself.
#[test]
fn one_of_several_searches_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, _, said) = study(&["new", "s", "--kind", "search", "--seed", "7"], at);
    assert_eq!(code, 0, "{said}");
    let path = at.join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("grid = 9", "grid = 3");
    let text = text.replace("trials = 40, start = 8", "trials = 6, start = 4");
    let (from, to) = (
        text.find("[[parts]]").unwrap(),
        text.find("[analysis]").unwrap(),
    );
    let second = text[from..to].replace("\"better\"", "\"softer\"");
    let both = format!("{}{second}{}", &text[..to], &text[to..]);
    fs::write(&path, both).unwrap();
    let rehearsed = ["rehearse", "s", "--participants", "1", "--out", "r"];
    assert_eq!(study(&rehearsed, at).0, 0);
    let confirm = |more: &[&str]| {
        let head = [
            "new",
            "c",
            "--from",
            "r",
            "--confirm",
            "--include",
            "simulated",
        ];
        study(&[&head[..], more].concat(), at)
    };
    let (code, _, said) = confirm(&[]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("has 2 searches"), "{said}");
    assert!(said.contains("--part: better, softer"), "{said}");
    let (code, _, said) = confirm(&["--part", "other"]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("the part `other` of the study `s` is no search"),
        "{said}"
    );
    let (code, _, said) = confirm(&["--part", "softer"]);
    assert_eq!(code, 0, "{said}");
    let text = fs::read_to_string(at.join("c/protocol.toml")).unwrap();
    assert!(text.contains("part = \"softer\""), "{text}");
}

fn no_search(at: &Path) {
    let (code, _, said) = study(&["new", "--seed", "20261123", "o", "--kind", "pairs"], at);
    assert_eq!(code, 0, "{said}");
    let (code, _, said) = study(&["rehearse", "o", "--participants", "1", "--out", "q"], at);
    assert_eq!(code, 0, "{said}");
    let (code, _, said) = study(&["explore", "q", "--include", "simulated"], at);
    assert_eq!(code, 1);
    assert!(
        said.contains("the study `o` has no part of kind \"search\""),
        "{said}"
    );
    let (code, _, said) = study(&["new", "n", "--from", "q", "--confirm"], at);
    assert_eq!(code, 1);
    assert!(
        said.contains("the study `o` has no part of kind \"search\""),
        "{said}"
    );
    assert!(!at.join("n").exists());
}
