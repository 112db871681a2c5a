//! Magnitude estimation with a standard.

use super::parts::SCALES;
use crate::protocol::file::parse;
use crate::protocol::{Protocol, Seat, Stimuli, Task};
use study_base::text::ModelId;

fn read(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let faults = parsed.findings.render(false);
    // A family that only another part had is warned of.
    assert!(!parsed.findings.has_errors(), "{faults}");
    parsed.protocol.unwrap()
}

/// The keys of the part of magnitude estimation, replaced.
fn with(old: &str, new: &str) -> String {
    let text = SCALES.replacen(old, new, 1);
    assert_ne!(text, SCALES);
    text.replace("study-protocol/2", "study-protocol/3")
}

/// What each trial that counts presents first, and what then.
fn presented(protocol: &Protocol) -> Vec<(Option<ModelId>, ModelId)> {
    let trials = crate::schedule::plan(protocol, None, Seat::Row(1)).unwrap();
    let of = trials
        .into_iter()
        .filter(|t| t.part.as_ref() == Some(&protocol.parts[0].id));
    of.map(|t| match t.stimuli {
        Stimuli::One { model } => (None, model),
        Stimuli::Rated { reference, model } => (Some(reference), model),
        other => panic!("{other:?}"),
    })
    .collect()
}

#[test]
fn a_standard_is_felt_first_in_each_trial() {
    let alone = read(SCALES);
    let level = "levels = [4.0, 1.0]\nstandard = 1.0\nmodulus = 100\n";
    for (text, first, gap_s) in [
        (with("levels = [4.0, 1.0]\n", level), "detent.2", 1.0),
        (
            with(
                "family = \"detent\"\nlevels = [4.0, 1.0]\n",
                "reference = \"bad\"\nmodulus = 100\ngap_s = 1.5\n",
            ),
            "bad",
            1.5,
        ),
    ] {
        let protocol = read(&text);
        let Task::Magnitude(own) = &protocol.parts[0].task else {
            panic!()
        };
        let standard = own.standard.as_ref().unwrap();
        assert_eq!((standard.model.as_str(), standard.modulus), (first, 100.0));
        assert_eq!(protocol.parts[0].gap_s, gap_s);
        let trials = presented(&protocol);
        assert_eq!(trials.len(), 3 * own.presentations.models.len());
        assert!(
            trials
                .iter()
                .all(|(before, _)| before.as_ref() == Some(&standard.model))
        );
        // The order of what is estimated is the same with and without.
        if first == "detent.2" {
            let second = |trials: Vec<(_, ModelId)>| trials.into_iter().map(|t| t.1);
            assert!(second(trials).eq(second(presented(&alone))));
        }
    }
}

#[test]
fn faults_of_a_standard_are_named() {
    let family = "family = \"detent\"\nlevels = [4.0, 1.0]\n";
    let early = with("levels = [4.0, 1.0]", "standard = 1.0\nmodulus = 100");
    let early = early.replace("study-protocol/3", "study-protocol/2");
    let shown = parse("p", &early).findings.render(false);
    assert!(shown.contains("study-protocol/3"), "{shown}");
    for (keys, says) in [
        (
            "standard = 3.0\nmodulus = 10\n",
            "3 is no level of the family `detent`",
        ),
        (
            "standard = 1.0\n",
            "`parts[0]` has a `standard` without its number",
        ),
        (
            "modulus = 10\n",
            "`parts[0]` does not say what has the number `modulus`",
        ),
        (
            "reference = \"bad\"\nmodulus = 10\n",
            "`parts[0]` has a `reference` and a family",
        ),
        ("standard = 1.0\nmodulus = 0\n", "above 0"),
    ] {
        let text = with(family, &format!("{family}{keys}"));
        let shown = parse("p", &text).findings.render(false);
        assert!(shown.contains(says), "{says}\n{shown}");
    }
    for (keys, says) in [
        (
            "standard = 1.0\nmodulus = 10\n",
            "`parts[0]` has a `standard` without a family",
        ),
        (
            "reference = \"bad\"\n",
            "`parts[0]` has a `reference` without its number",
        ),
        (
            "reference = \"bat\"\nmodulus = 10\n",
            "there is no model `bat`",
        ),
        ("modulus = 10\n", "add the realization"),
    ] {
        let shown = parse("p", &with(family, keys)).findings.render(false);
        assert!(shown.contains(says), "{says}\n{shown}");
    }
}
