//! A small protocol without a file, for tests and examples.

use super::*;
use std::collections::BTreeMap;

/// Realizations `A`, `B`, … of role test, rated 1–7 for `realism` with an
/// optional `comment`; order blocked; nothing else.
pub fn protocol(models: usize, repetitions: u32) -> Protocol {
    let limit = |value| Limit::new(value).expect("a positive number");
    let id = |text: &str| QuestionId::new(text).expect("an identifier");
    Protocol {
        study: Study {
            id: "example".to_owned(),
            title: "An example".to_owned(),
            seed: 2007,
            authors: Vec::new(),
            license: None,
            ethics: None,
            contact: None,
            funding: None,
            doi: None,
        },
        text: Text::default(),
        consent: None,
        design: Design {
            participants: 10,
            repetitions,
            order: Order::Blocked,
            max_run: None,
            min_distance: None,
            practice: Vec::new(),
            breaks: None,
            max_attempts: 3,
        },
        session: SessionRules {
            entry: Entry::Participant,
            resume_within_h: 4.0,
        },
        device: DeviceRules {
            kind: DeviceKind::Simulated,
            limits: Limits {
                force_n: limit(12.0),
                velocity_mm_s: limit(1000.0),
            },
            uncertified: None,
        },
        trial: TrialRules {
            reference: Some("Operate the real switch.".to_owned()),
            reference_min_s: 0.0,
            minimum_strokes: 0,
        },
        models: (0..models).map(|i| model(&letter(i))).collect(),
        questions: vec![
            Question {
                id: id("realism"),
                prompt: "How realistic did it feel?".to_owned(),
                kind: QuestionKind::Rating {
                    from: 1,
                    to: 7,
                    labels: BTreeMap::from([
                        (1, "not at all realistic".to_owned()),
                        (7, "very realistic".to_owned()),
                    ]),
                },
                required: true,
            },
            Question {
                id: id("comment"),
                prompt: "Comment".to_owned(),
                kind: QuestionKind::Text,
                required: false,
            },
        ],
        setup: Vec::new(),
        intake: Vec::new(),
        outro: Vec::new(),
        analysis: AnalysisRules {
            primary: id("realism"),
            vaf: None,
            realistic_from: Some(5.0),
            equivalence_margin: None,
            unfinished: Unfinished::Include,
            exclude: Vec::new(),
        },
    }
}

/// An entry of role test without a file.
pub fn model(id: &str) -> ModelEntry {
    ModelEntry {
        id: ModelId::new(id).expect("an identifier"),
        file: None,
        vaf: None,
        role: Role::Test,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::new(),
    }
}

/// `A` … `Z`, then `A1` … `Z1` and so on.
fn letter(i: usize) -> String {
    let letter = char::from(b'A' + u8::try_from(i % 26).expect("below 26"));
    match i / 26 {
        0 => letter.to_string(),
        round => format!("{letter}{round}"),
    }
}
