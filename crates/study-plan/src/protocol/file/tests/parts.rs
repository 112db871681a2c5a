//! Parts, families and tracks.

use crate::procedure::Rule;
use crate::protocol::file::parse;
use crate::protocol::{Answer, Compared, Protocol, Seat, Stimuli, Task};

/// A study with a part of each kind.
pub(super) const PARTS: &str = r#"
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

pub(super) fn good(text: &str) -> Protocol {
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

/// A study with a part of magnitude estimation and one of MUSHRA.
pub(super) const SCALES: &str = r#"
format = "study-protocol/2"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "strength" }
models = [
  { id = "target", file = "a.toml", role = "hidden-reference" },
  { id = "bad", file = "b.toml", role = "low-anchor" },
  { id = "c", file = "c.toml" },
]

[[families]]
id = "detent"
from = "a.toml"
vary = "detent"
levels = [0.5, 1.0, 2.0, 4.0]

[[parts]]
id = "strength"
kind = "magnitude"
prompt = "How strong?"
family = "detent"
levels = [4.0, 1.0]
repetitions = 3

[[parts]]
id = "quality"
kind = "mushra"
prompt = "How close?"
labels = { 0 = "bad", 100 = "excellent" }
reference = "target"
repetitions = 2
practice = ["c"]
"#;

#[test]
fn magnitudes_are_asked_of_levels_and_mushra_of_realizations_beside_a_reference() {
    let parsed = parse("p", SCALES);
    assert!(
        parsed.findings.faults.is_empty(),
        "{}",
        parsed.findings.render(false)
    );
    let protocol = parsed.protocol.unwrap();
    let Task::Magnitude(own) = &protocol.parts[0].task else {
        panic!()
    };
    let models = &own.presentations.models;
    let names: Vec<&str> = models.iter().map(|id| id.as_str()).collect();
    assert_eq!(names, ["detent.4", "detent.2"]);
    assert_eq!(protocol.level_of(&models[0]), Some(4.0));
    assert_eq!((&own.standard, protocol.parts[0].gap_s), (&None, 0.0));
    let ask = |id: &str| {
        protocol
            .questions
            .iter()
            .find(|q| q.id.as_str() == id)
            .unwrap()
    };
    let number = |n| ask("strength").accepts(&Answer::Number(n));
    assert!(number(1e-9).is_ok());
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(number(bad).is_err(), "{bad}");
    }
    let rate = |n| ask("quality").accepts(&Answer::Number(n)).is_ok();
    assert!(rate(0.0) && rate(100.0) && !rate(100.5));
    let part = &protocol.parts[1];
    assert_eq!(part.task.reference().unwrap().as_str(), "target");
    assert_eq!(part.gap_s, 1.0);
    let trials = crate::schedule::plan(&protocol, None, Seat::Row(1)).unwrap();
    assert_eq!(trials.len(), 2 * 3 + 1 + 3 * 2);
    let beside = |t: &&crate::schedule::Trial| matches!(&t.stimuli, Stimuli::Rated { reference, .. } if reference.as_str() == "target");
    assert_eq!(trials.iter().filter(beside).count(), 7);
    // A planned trial is the same after it was written to a journal.
    let text = serde_json::to_string(&trials).unwrap();
    let read: Vec<crate::schedule::Trial> = serde_json::from_str(&text).unwrap();
    assert_eq!(read, trials);
}

#[test]
fn faults_of_magnitudes_and_mushra_are_named() {
    for (from, to, says) in [
        (
            "[4.0, 1.0]",
            "[4.0, 3.0]",
            "3 is no level of the family `detent`",
        ),
        ("[4.0, 1.0]", "[4.0, 4.0]", "the level 4 is there twice"),
        (
            "family = \"detent\"",
            "family = \"detail\"",
            "there is no family `detail`",
        ),
        (
            "reference = \"target\"",
            "reference = \"tarqet\"",
            "there is no model `tarqet`",
        ),
        (
            "role = \"hidden-reference\"",
            "role = \"test\"",
            "needs one realization with role = \"hidden-reference\"",
        ),
        (
            "role = \"low-anchor\"",
            "role = \"test\"",
            "no anchor is rated",
        ),
        (
            "{ 0 = \"bad\", 100",
            "{ 150 = \"bad\", 100",
            "a label belongs to a number from 0 to 100",
        ),
        (
            "kind = \"simulated\"",
            "kind = \"manual\"",
            "a sample mounted by hand has no levels",
        ),
    ] {
        let text = SCALES.replacen(from, to, 1);
        assert_ne!(text, SCALES, "{from}");
        let shown = parse("p", &text).findings.render(false);
        assert!(shown.contains(says), "{says}\n{shown}");
    }
}

/// The default grids of a QUEST+ track on levels from 1 (or `first`) to 3.
fn default_grids(first: &str, steps: u32, standard: &str) -> Vec<(String, Vec<f64>)> {
    let text = PARTS
        .replace("range = [1.0, 3.0]", &format!("range = [{first}, 3.0]"))
        .replace("steps = 41", &format!("steps = {steps}"))
        .replace("standard = 1.0", &format!("standard = {standard}"));
    let parsed = parse("p", &text);
    let protocol = parsed
        .protocol
        .unwrap_or_else(|| panic!("{}", parsed.findings.render(false)));
    let quest = protocol.tracks.iter().find_map(|t| match &t.rule {
        Rule::QuestPlus(rule) => Some(rule.parameters.clone()),
        _ => None,
    });
    let named = |p: crate::procedure::Parameter| (p.name, p.values);
    quest.unwrap().into_iter().map(named).collect()
}

#[test]
fn default_grids_cover_the_ladder_and_are_steeper_above_a_standard() {
    let grids = default_grids("1.0", 41, "1.0");
    assert_eq!(grids[0].1.len(), 41);
    assert_eq!(grids[1].1, [1.6, 2.6, 4.0, 6.0, 10.0, 16.0]);
    // Over the distance from 0 the slopes are those of the function.
    assert_eq!(
        default_grids("0.1", 41, "0.0")[1].1,
        [0.8, 1.3, 2.0, 3.0, 5.0, 8.0]
    );
    // A fine ladder does not make a fine grid.
    let fine = &default_grids("1.0", 999, "1.0")[0].1;
    assert_eq!((fine.len(), fine[0], fine[59]), (60, 1.0, 3.0));
    assert!(fine.windows(2).all(|w| w[0] < w[1]));
}

/// One mistake is one fault: what follows from it is not reported.
#[test]
fn a_fault_has_no_echo() {
    for (from, to) in [
        ("range = [1.0, 3.0]", "range = \"x\""),
        ("steps = 41", "steps = 1"),
        ("prompt = \"Which?\"\nquestions", "prompt = 3\nquestions"),
    ] {
        let found = changed(from, to);
        assert_eq!(found.len(), 1, "{to}: {found:?}");
    }
}

#[test]
fn a_staircase_begins_above_its_standard() {
    let found = changed("standard = 1.0", "standard = 2.5");
    assert_eq!(found, ["the staircase begins at 2, below its standard 2.5"]);
}

#[test]
fn a_choice_is_the_primary_question_by_the_share_of_an_answer() {
    let choice = "id = \"sure\"\nkind = \"choice\"\noptions = [\"yes\", \"no\"]\nprompt = \"?\"\n";
    let text = PARTS
        .replace(
            "id = \"sure\"\nkind = \"rating\"\nprompt = \"?\"\nfrom = 1\nto = 3\n",
            choice,
        )
        .replace("primary = \"pairs\"", "primary = \"sure\"");
    let messages = |text: &str| -> Vec<String> {
        let faults = parse("p", text).findings.faults;
        faults.into_iter().map(|f| f.message).collect()
    };
    let primary =
        |more: &str| text.replace("primary = \"sure\"", &format!("primary = \"sure\", {more}"));
    assert_eq!(
        messages(&text),
        ["`sure` is a choice: the share of which answer?"]
    );
    assert_eq!(
        messages(&primary("share_of = \"yess\"")),
        ["there is no option `yess`"]
    );
    assert!(messages(&primary("share_of = \"yes\"")).is_empty());
    assert_eq!(
        messages(&primary("share_of = \"yes\", realistic_from = 1")),
        ["`analysis.realistic_from` has no effect: `sure` is a choice"]
    );
    assert_eq!(
        messages(&text.replace(
            "primary = \"sure\"",
            "primary = \"realism\", share_of = \"yes\""
        )),
        ["`analysis.share_of` has no effect: `realism` is no choice of [[questions]]"]
    );
    let found = changed(
        "primary = \"pairs\"",
        "primary = \"pairs\", realistic_from = 1",
    );
    assert_eq!(
        found,
        ["`analysis.realistic_from` has no effect: `pairs` is a choice"]
    );
}

/// Realizations are estimated where there is no family.
#[test]
fn magnitudes_are_asked_of_realizations_without_a_family() {
    let without = SCALES.replace("family = \"detent\"\nlevels = [4.0, 1.0]\n", "");
    assert_ne!(without, SCALES);
    let parsed = parse("p", &without);
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    let Task::Magnitude(own) = &protocol.parts[0].task else {
        panic!()
    };
    let tests: Vec<_> = protocol.models.iter().map(|m| &m.id).collect();
    let models = &own.presentations.models;
    assert!(!models.is_empty() && models.iter().all(|id| tests.contains(&id)));
    assert!(models.iter().all(|id| protocol.level_of(id).is_none()));
    for (to, expected) in [
        (
            "family = \"detent\"\nmodels = [\"c\"]\n",
            "`parts[0]` has `models` and a family",
        ),
        (
            "levels = [4.0]\n",
            "`parts[0]` has `levels` without a family",
        ),
        (
            "family = \"detent\"\nlevels = [1.1]\n",
            "1.1 is no level of the family `detent`",
        ),
        ("models = [\"nobody\"]\n", "there is no model `nobody`"),
    ] {
        let text = SCALES.replace("family = \"detent\"\nlevels = [4.0, 1.0]\n", to);
        let shown = parse("p", &text).findings.render(false);
        assert!(shown.contains(expected), "{to}\n{shown}");
    }
}
