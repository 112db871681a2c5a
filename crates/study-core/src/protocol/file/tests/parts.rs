//! Parts, families and tracks.

use crate::procedure::Rule;
use crate::protocol::file::parse;
use crate::protocol::{Compared, Protocol, Task};

/// A study with a part of each kind.
const PARTS: &str = r#"
format = "study-protocol/2"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "pairs" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }, { id = "c", file = "c.toml" }]

[[questions]]
id = "realism"
kind = "rating"
prompt = "?"
from = 1
to = 7

[[questions]]
id = "sure"
kind = "rating"
prompt = "?"
from = 1
to = 3

[[parts]]
id = "ratings"
kind = "rating"
models = ["a", "b"]
repetitions = 2
practice = ["c"]

[[parts]]
id = "pairs"
kind = "pairs"
prompt = "Which?"
questions = ["sure"]
repetitions = 2

[[parts]]
id = "more"
kind = "discrimination"
prompt = "Which?"
tracks = ["up", "quest"]

[[families]]
id = "damping"
from = "a.toml"
vary = "b"
range = [1.0, 3.0]
steps = 41

[[tracks]]
id = "up"
method = "2ifc"
family = "damping"
standard = 1.0
procedure = { rule = "staircase", up = 1, down = 3, start = 2.0, steps = [0.2], stop = { reversals = 8, max_trials = 80 } }

[[tracks]]
id = "quest"
method = "2ifc"
family = "damping"
standard = 1.0
procedure = { rule = "quest+", trials = 40 }
"#;

fn good(text: &str) -> Protocol {
    let parsed = parse("protocol.toml", text);
    let shown = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
}

/// The messages for [`PARTS`] with one thing changed.
fn changed(from: &str, to: &str) -> Vec<String> {
    assert!(PARTS.contains(from), "{from}");
    let parsed = parse("protocol.toml", &PARTS.replacen(from, to, 1));
    let faults = parsed.findings.faults;
    assert!(faults.iter().all(|f| f.span.is_some()), "{faults:?}");
    faults.into_iter().map(|f| f.message).collect()
}

#[test]
fn a_part_asks_its_own_questions_and_the_rating_part_the_others() {
    let p = good(PARTS);
    let asks = |at: usize| -> Vec<&str> { p.parts[at].asks.iter().map(|q| q.as_str()).collect() };
    assert_eq!(asks(0), ["realism"]);
    assert_eq!(asks(1), ["pairs", "sure"]);
    assert_eq!(asks(2), ["more"]);
}

#[test]
fn defaults_follow_from_family_and_method() {
    let p = good(PARTS);
    let Task::Pairs(pairs) = &p.parts[1].task else {
        panic!()
    };
    assert_eq!(pairs.pairs.len(), 3);
    assert_eq!(p.families[0].ladder.levels().len(), 41);
    assert_eq!(p.families[0].ladder.levels()[17], 1.85, "as it is written");
    assert_eq!(p.families[0].realization(17).as_str(), "damping.18");
    let Rule::QuestPlus(quest) = &p.tracks[1].rule else {
        panic!()
    };
    let of = |name: &str| quest.parameters.iter().find(|p| p.name == name).unwrap();
    assert_eq!(of("gamma").values, [0.5]);
    assert_eq!(of("threshold").values.len(), 41);
    let same = PARTS.replace("\"2ifc\"", "\"same-different\"");
    let p = good(&same);
    assert_eq!(p.tracks[0].catch, 0.5);
}

#[test]
fn a_staircase_does_not_go_below_its_standard() {
    let both = PARTS.replace("range = [1.0, 3.0]", "range = [0.5, 3.0]");
    let Rule::Staircase(rule) = &good(&both).tracks[0].rule else {
        panic!()
    };
    assert_eq!(rule.min_level, Some(1.0));
    let Rule::Staircase(rule) = &good(PARTS).tracks[0].rule else {
        panic!()
    };
    assert_eq!(rule.min_level, None);
}

#[test]
fn two_realizations_are_a_track_without_a_family() {
    let abx = PARTS.replacen(
        "family = \"damping\"\nstandard = 1.0\nprocedure = { rule = \"quest+\", trials = 40 }",
        "models = [\"a\", \"b\"]\nprocedure = { rule = \"constant\", repetitions = 20 }",
        1,
    );
    let p = good(&abx);
    let track = &p.tracks[1];
    assert!(matches!(&track.compared, Compared::Models { .. }));
    assert_eq!(track.standard().as_str(), "a");
    assert_eq!(p.comparison(track, 0).unwrap().as_str(), "b");
    assert_eq!(track.rule.most_trials(), 20);
}

#[test]
fn version_1_knows_no_parts_and_says_what_to_write() {
    let old = PARTS.replacen("protocol/2", "protocol/1", 1);
    let parsed = parse("protocol.toml", &old);
    assert!(parsed.protocol.is_none());
    let first = &parsed.findings.faults[0];
    assert!(
        first
            .message
            .contains("needs the format `study-protocol/2`")
    );
    assert!(first.hint.as_ref().unwrap().contains("study-protocol/2"));
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    for (from, to, said) in [
        (
            "kind = \"pairs\"",
            "kind = \"pair\"",
            "`parts[1].kind` cannot be `pair`",
        ),
        (
            "prompt = \"Which?\"\nquestions",
            "pormpt = \"Which?\"\nquestions",
            "pormpt",
        ),
        (
            "questions = [\"sure\"]",
            "questions = [\"sture\"]",
            "no question `sture`",
        ),
        (
            "models = [\"a\", \"b\"]",
            "models = [\"a\", \"d\"]",
            "no model `d`",
        ),
        (
            "models = [\"a\", \"b\"]",
            "models = [\"a\", \"a\"]",
            "`a` is there twice",
        ),
        ("practice = [\"c\"]", "practice = [\"d\"]", "no model `d`"),
        (
            "tracks = [\"up\", \"quest\"]",
            "tracks = [\"up\", \"kuest\"]",
            "no track `kuest`",
        ),
        (
            "tracks = [\"up\", \"quest\"]",
            "tracks = [\"up\", \"up\"]",
            "the track `up` is there twice",
        ),
        ("tracks = [\"up\", \"quest\"]", "tracks = []", "is empty"),
        (
            "method = \"2ifc\"",
            "method = \"abx\"",
            "the tracks of a part have one method",
        ),
        (
            "family = \"damping\"",
            "family = \"damp\"",
            "no family `damp`",
        ),
        ("standard = 1.0\n", "", "has no `standard`"),
        ("range = [1.0, 3.0]", "range = [3.0, 1.0]", "does not rise"),
        (
            "range = [1.0, 3.0]",
            "range = [-1.0, 3.0]",
            "0 or more, not -1",
        ),
        (
            "range = [1.0, 3.0]\nsteps = 41",
            "levels = [1.0, 2.0, 2.0]",
            "must rise",
        ),
        (
            "steps = 41",
            "steps = 41\nlevels = [1.0]",
            "has both `levels` and a range",
        ),
        ("vary = \"b\"", "vary = \"blend\"", "has no `to`"),
        (
            "vary = \"b\"",
            "vary = \"b\"\nto = \"b.toml\"",
            "belongs to vary = \"blend\"",
        ),
        (
            "start = 2.0",
            "start = 9.0",
            "within the limits and the ladder",
        ),
        (
            "trials = 40 }",
            "trials = 40, function = \"a + b\" }",
            "needs its `parameters`",
        ),
        ("trials = 40 }", "trials = 40, threshold = [] }", "is empty"),
        ("rule = \"quest+\"", "rule = \"quest\"", "cannot be `quest`"),
        ("id = \"more\"", "id = \"sure\"", "`sure` is there twice"),
        (
            "id = \"more\"",
            "id = \"track\"",
            "is a column of ratings.csv already",
        ),
        (
            "id = \"a\", file",
            "id = \"damping.3\", file",
            "could be a level of `damping`",
        ),
        (
            "participants = 4",
            "participants = 4, order = \"fixed\"",
            "has no effect",
        ),
        (
            "repetitions = 2\n\n",
            "repetitions = 2\npairs = \"versus:d\"\n\n",
            "no model `d`",
        ),
        (
            "repetitions = 2\n\n",
            "repetitions = 2\npairs = \"most\"\n\n",
            "has to be `all`",
        ),
        (
            "primary = \"pairs\"",
            "primary = \"pair\"",
            "no question `pair`",
        ),
        (
            "tracks = [\"up\", \"quest\"]",
            "tracks = [\"up\"]",
            "has the track `quest`",
        ),
        (
            "trials = 40 }",
            "trials = 40 }\ncatch = 0.1",
            "the method `2ifc` has no catch trials",
        ),
    ] {
        let messages = changed(from, to);
        assert!(
            messages.iter().any(|m| m.contains(said)),
            "{said}: {messages:?}"
        );
    }
}

#[test]
fn a_manual_device_has_no_levels() {
    let manual = PARTS.replacen("kind = \"simulated\"", "kind = \"manual\"", 1);
    let parsed = parse("protocol.toml", &manual);
    let said = |f: &study_base::diagnostic::Fault| f.message.contains("has no levels");
    assert!(parsed.findings.faults.iter().any(said));
}
