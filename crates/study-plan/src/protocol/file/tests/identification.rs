//! Parts of identification.

use crate::protocol::file::parse;
use crate::protocol::{Answer, Feedback, Protocol, Seat, Stimuli, Task};
use study_base::text::ModelId;

const NAMED: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 8 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "which" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }, { id = "c", file = "c.toml" }]

[[parts]]
id = "which"
kind = "identification"
prompt = "Which?"
answers = [{ label = "weak", models = ["c"] }, { label = "first", models = ["a", "b"] }]
repetitions = 3
practice = ["a", "c"]
"#;

fn read(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let faults = parsed.findings.render(false);
    assert!(parsed.findings.faults.is_empty(), "{faults}");
    parsed.protocol.unwrap()
}

fn messages(text: &str) -> Vec<String> {
    let faults = parse("p", text).findings.faults;
    faults.into_iter().map(|f| f.message).collect()
}

#[test]
fn the_realizations_of_all_labels_are_felt_and_the_labels_are_the_answers() {
    let protocol = read(NAMED);
    let Task::Identification(own) = &protocol.parts[0].task else {
        panic!()
    };
    assert_eq!(own.feedback, Feedback::Practice);
    assert!(own.tells(true) && !own.tells(false));
    let id = |name: &str| ModelId::new(name).unwrap();
    assert_eq!(own.label_of(&id("b")), Some("first"));
    let answer = |label: &str| Answer::Choice(vec![label.to_owned()]);
    assert_eq!(own.is_correct(&id("b"), &answer("first")), Some(true));
    assert_eq!(own.is_correct(&id("b"), &answer("weak")), Some(false));
    let declined = Answer::Declined {
        reason: "x".to_owned(),
    };
    assert_eq!(own.is_correct(&id("b"), &declined), None);
    let asked = &protocol.questions[0];
    assert!(asked.accepts(&answer("weak")).is_ok() && asked.accepts(&answer("a")).is_err());
    let trials = crate::schedule::plan(&protocol, None, Seat::Row(1)).unwrap();
    assert_eq!(trials.len(), 2 + 3 * 3);
    let felt = |name: &str| {
        let of = |t: &&crate::schedule::Trial| t.stimuli == Stimuli::One { model: id(name) };
        trials.iter().filter(of).count()
    };
    assert_eq!([felt("a"), felt("b"), felt("c")], [4, 3, 4]);
    // A planned trial is the same after it was written to a journal.
    let text = serde_json::to_string(&trials).unwrap();
    let read: Vec<crate::schedule::Trial> = serde_json::from_str(&text).unwrap();
    assert_eq!(read, trials);
}

#[test]
fn what_is_wrong_with_labels_is_said() {
    for (from, to, says) in [
        (
            "{ label = \"weak\", models = [\"c\"] }, ",
            "",
            "`parts[0].answers` has fewer than two labels",
        ),
        (
            "answers = [{ label = \"weak\", models = [\"c\"] }, { label = \"first\", models = [\"a\", \"b\"] }]\n",
            "",
            "[parts[0]] has no `answers`",
        ),
        ("\"weak\"", "\"first \"", "the label `first` is there twice"),
        (
            "[\"a\", \"b\"]",
            "[]",
            "no realization has the label `first`",
        ),
        ("[\"a\", \"b\"]", "[\"a\", \"c\"]", "`c` is there twice"),
        ("[\"a\", \"b\"]", "[\"a\", \"d\"]", "there is no model `d`"),
        ("[\"a\", \"b\"]", "[\"b\"]", "`a` has no label"),
        (
            "label = \"weak\"",
            "labels = \"weak\"",
            "unknown key `labels` in [parts[0].answers[0]]",
        ),
        ("\"weak\"", "\" \"", "`parts[0].answers[0].label` is empty"),
        (
            "practice = [\"a\", \"c\"]",
            "criterion = { correct = 2, of = 3, rounds = 2 }",
            "`parts[0]` has a criterion without practice trials",
        ),
        (
            "practice =",
            "criterion = { correct = 4, of = 3, rounds = 2 }\npractice =",
            "`parts[0].criterion` is never reached: 4 of 3",
        ),
        (
            "practice =",
            "criterion = { correct = 4, of = 5, rounds = 2 }\npractice =",
            "`parts[0].criterion` is never reached: practice has 4 trials at most",
        ),
        (
            "study-protocol/3",
            "study-protocol/2",
            "`parts[0].answers` needs the format `study-protocol/3`",
        ),
    ] {
        let text = NAMED.replace(from, to);
        assert_ne!(text, NAMED, "{from}");
        let found = messages(&text);
        assert_eq!(found[0], says, "{from} → {to}");
        // Without the label of `a` its practice trial has no right answer either.
        let more = if to == "[]" { 2 } else { 1 };
        assert_eq!(found.len(), more, "{found:?}");
        // Those without a suggestion beside the caret say what to do next.
        let faults = parse("p", &text).findings.faults;
        let asked = ["there twice", "has no label", "never reached"];
        for fault in faults
            .iter()
            .filter(|f| asked.iter().any(|a| f.message.contains(a)))
        {
            assert!(fault.hint.is_some(), "{fault:?}");
        }
    }
}

#[test]
fn a_criterion_is_about_the_last_answers() {
    let text = NAMED.replace(
        "practice =",
        "criterion = { correct = 2, of = 3, rounds = 4 }\npractice =",
    );
    let protocol = read(&text);
    assert!(protocol.practices_to_a_criterion());
    let criterion = protocol.parts[0].task.identification().unwrap().criterion;
    let reached = |answers: &[bool]| criterion.unwrap().is_reached(answers);
    assert!(!reached(&[true, true]) && reached(&[true, false, true]));
    assert!(!reached(&[true, true, false, false]));
    let trials = crate::schedule::plan(&protocol, None, Seat::Row(1)).unwrap();
    assert_eq!(trials.iter().filter(|t| t.practice).count(), 2 * 4);
    // As many trials, each drawn on its own; documents written before the key were drawn in rounds.
    let independent = text.replace("rounds = 4", "rounds = 4, draw = \"independent\"");
    let drawn = |text: &str| {
        let trials = crate::schedule::plan(&read(text), None, Seat::Row(1)).unwrap();
        let practice = trials.into_iter().filter(|t| t.practice);
        practice
            .map(|t| t.model().unwrap().as_str().to_owned())
            .collect::<String>()
    };
    assert_eq!(drawn(&independent).len(), 2 * 4);
    let rounds = drawn(&text).into_bytes();
    assert!(rounds.chunks(2).all(|round| round[0] != round[1]));
    assert_eq!(
        drawn(&text.replace("rounds = 4", "rounds = 4, draw = \"rounds\"")),
        drawn(&text)
    );
    let stated = |text: &str| {
        let protocol = read(text);
        let own = protocol.parts[0].task.identification().unwrap();
        serde_json::to_value(own.criterion).unwrap()
    };
    assert!(stated(&text).get("draw").is_none());
    assert_eq!(stated(&independent)["draw"], "independent");
}

/// Levels of a family are realizations with labels, too.
#[test]
fn levels_of_a_family_have_labels() {
    let family = r#"
[[families]]
id = "detent"
from = "a.toml"
vary = "detent"
levels = [0.5, 1.0, 2.0]
"#;
    let text = NAMED
        .replace("prompt =", "family = \"detent\"\nprompt =")
        .replace(
            "models = [\"c\"] }",
            "models = [\"c\"], levels = [2.0, 0.5] }",
        )
        .replace(
            "practice = [\"a\", \"c\"]",
            "practice = [\"a\", \"detent.1\"]",
        );
    let protocol = read(&format!("{text}{family}"));
    let named = protocol.parts[0].task.identification().unwrap();
    let models: Vec<&str> = named.labels[0].models.iter().map(ModelId::as_str).collect();
    assert_eq!(models, ["c", "detent.3", "detent.1"]);
    assert_eq!(named.presentations.models.len(), 5);
    for (from, to, says) in [
        (
            "[2.0, 0.5]",
            "[3.0]",
            "3 is no level of the family `detent`",
        ),
        (
            "family = \"detent\"",
            "",
            "`parts[0]` has labels of `levels` without a family",
        ),
        (
            ", levels = [2.0, 0.5]",
            "",
            "no label of `parts[0]` has `levels` of its family",
        ),
        (
            "\"detent.1\"",
            "\"detent.2\"",
            "there is no model `detent.2`",
        ),
    ] {
        let found = messages(&format!("{}{family}", text.replace(from, to)));
        assert_eq!(found[0], says, "{found:?}");
    }
}

#[test]
fn a_group_feels_its_own_realizations_and_has_all_labels() {
    let groups = r#"
[groups]
[[groups.list]]
id = "all"
[[groups.list]]
id = "few"
models = ["a", "c"]
"#;
    let protocol = read(&format!("{NAMED}{groups}"));
    let few = protocol.assignments().remove(1);
    let own = protocol.of(&few);
    let named = own.parts[0].task.identification().unwrap();
    assert_eq!(named.presentations.models.len(), 2);
    assert_eq!(named.labels.len(), 2);
    let nothing = groups.replace("[\"a\", \"c\"]", "[\"d\"]");
    let found = messages(&format!("{NAMED}{nothing}"));
    assert!(
        found.contains(&"group `few` has nothing to do in part `which`".to_owned()),
        "{found:?}"
    );
}

#[test]
fn too_few_trials_for_a_confusion_matrix_are_a_warning() {
    let warned = |participants: &str| {
        let text = NAMED.replace("participants = 8", participants);
        let parsed = parse("p", &text);
        let protocol = parsed.protocol.unwrap();
        let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
        let few = |f: &&study_base::diagnostic::Fault| f.message.contains("information transfer");
        faults.iter().find(few).map(|f| f.message.clone())
    };
    // 9 trials of each participant; 5 × 2 × 2 are needed.
    assert_eq!(warned("participants = 3"), None);
    let said = warned("participants = 2").unwrap();
    assert!(
        said.contains("18 answers among 2 labels are fewer than 20, 5 for each cell"),
        "{said}"
    );
}
