//! Parts of adjustment.

use crate::protocol::file::parse;
use crate::protocol::fingerprint::parts;
use crate::protocol::{Adjustment, Protocol};
use study_base::text::ModelId;

const SET: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 8 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "equal" }

[[families]]
id = "detent"
from = "a.toml"
vary = "detent"
range = [0.5, 1.5]
steps = 21

[[parts]]
id = "equal"
kind = "adjustment"
prompt = "Until they feel equal."
lower = "weaker"
higher = "stronger"
confirm = "equal"
family = "detent"
standard = 1.0
repetitions = 3
"#;

fn read(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let faults = parsed.findings.render(false);
    assert!(parsed.findings.faults.is_empty(), "{faults}");
    parsed.protocol.unwrap()
}

fn set(protocol: &Protocol) -> &Adjustment {
    protocol.parts[0].task.adjustment().unwrap()
}

fn with(old: &str, new: &str) -> String {
    let text = SET.replacen(old, new, 1);
    assert_ne!(text, SET);
    text
}

#[test]
fn a_part_of_adjustment_is_read() {
    let protocol = read(SET);
    let own = set(&protocol);
    assert_eq!(own.models.len(), 21);
    assert_eq!(own.standard.as_ref().unwrap().as_str(), "detent.11");
    assert_eq!((own.repetitions, own.practice, own.jnd), (3, 0, None));
    let names = |models: &[ModelId]| -> Vec<String> {
        models.iter().map(|m| m.as_str().to_owned()).collect()
    };
    // A quarter of the ladder on each side.
    assert_eq!(
        names(&own.below),
        ["detent.1", "detent.2", "detent.3", "detent.4", "detent.5"]
    );
    assert_eq!(names(&own.above)[0], "detent.17");
    assert_eq!(own.above.len(), 5);
    let part = &protocol.parts[0];
    assert_eq!((part.gap_s, part.asks.len()), (1.0, 1));
    assert_eq!(part.task.reference(), own.standard.as_ref());
    let starts = with(
        "standard = 1.0",
        "start_below = [0.6]\nstart_above = [1.4, 1.3]",
    );
    let protocol = read(&starts);
    let own = set(&protocol);
    assert_eq!(names(&own.below), ["detent.3"]);
    assert_eq!(names(&own.above), ["detent.19", "detent.17"]);
    assert_eq!(own.standard, None);
}

#[test]
fn what_cannot_be_set_is_refused() {
    for (old, new, what) in [
        (
            "standard = 1.0",
            "standard = 1.02",
            "1.02 is no level of the family `detent`",
        ),
        (
            "standard = 1.0",
            "standard = 0.5",
            "the standard 0.5 is not between the starts",
        ),
        (
            "standard = 1.0",
            "start_below = [1.4]\nstart_above = [1.3]",
            "nothing lies between them",
        ),
        (
            "standard = 1.0",
            "start_below = [0.51]",
            "0.51 is no level of the family `detent`",
        ),
        (
            "standard = 1.0",
            "standard = 1.0\nreference = \"a\"",
            "has a `standard` and a `reference`",
        ),
        (
            "standard = 1.0",
            "standard = 1.0\njnd = 0.04",
            "a step of the ladder of `detent` is 0.05, more than the just noticeable difference 0.04",
        ),
        ("family = \"detent\"", "family = \"other\"", "other"),
        (
            "study-protocol/3",
            "study-protocol/2",
            "`parts[0].confirm` needs the format",
        ),
    ] {
        let parsed = parse("p", &with(old, new));
        let faults = parsed.findings.render(false);
        assert!(parsed.protocol.is_none(), "{new}");
        assert!(faults.contains(what), "{faults}");
    }
    assert_eq!(
        set(&read(&with("standard = 1.0", "standard = 1.0\njnd = 0.05"))).jnd,
        Some(0.05)
    );
}

/// What is read while a level is set is wording; where it starts, and the ladder, are the stimulus.
#[test]
fn words_can_be_amended() {
    let of = |text: &str| parts(&read(text), &Default::default(), None).fingerprints();
    let (own, other) = (of(SET), of(&with("\"weaker\"", "\"softer\"")));
    assert_eq!(own.stimulus, other.stimulus);
    assert_ne!(own.wording, other.wording);
    let other = of(&with("repetitions = 3", "repetitions = 4"));
    assert_ne!(own.stimulus, other.stimulus);
}

#[test]
fn doubtful_designs_are_warned_of() {
    for (old, new, what) in [
        ("steps = 21", "steps = 5", "a level of 5 is set"),
        (
            "repetitions = 3",
            "repetitions = 1",
            "1 setting of `equal` from each side",
        ),
        (
            "repetitions = 3",
            "repetitions = 3\nexposure = { replays = 1 }",
            "`replays` has no effect in the part `equal`",
        ),
    ] {
        let parsed = parse("p", &with(old, new));
        let protocol = parsed.protocol.unwrap();
        let found = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
        let said = found.iter().any(|fault| fault.message.contains(what));
        assert!(said, "{found:?}");
    }
}
