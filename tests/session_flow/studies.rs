//! Protocols that the sessions are run with.

use std::collections::BTreeMap;
use study::limits::{Limit, Limits};
use study::protocol::*;
use study::text::{ModelId, QuestionId};

/// Model ids, files and VAFs that no sentence contains by accident.
pub(crate) const MODELS: [&str; 4] = ["XQZ-7", "KJW-3", "VVB-9", "ZZQ-2"];
pub(crate) const PRACTICE: &str = "PRX-5";

pub(crate) fn question(id: &str, kind: QuestionKind, required: bool) -> Question {
    Question {
        id: qid(id),
        prompt: format!("What about {id}?"),
        kind,
        required,
    }
}

pub(crate) fn qid(id: &str) -> QuestionId {
    QuestionId::new(id).expect("an identifier")
}

pub(crate) fn rating(id: &str) -> Question {
    let kind = QuestionKind::Rating {
        from: 1,
        to: 7,
        labels: BTreeMap::new(),
    };
    question(id, kind, true)
}

pub(crate) fn text(id: &str) -> Question {
    question(id, QuestionKind::Text, false)
}

/// Three realizations, twice each, one question with a comment.
pub(crate) fn plain() -> Protocol {
    let limit = |value| Limit::new(value).expect("a positive number");
    let model = |id: &str, role| ModelEntry {
        id: ModelId::new(id).expect("an identifier"),
        file: Some(format!("models/{id}.toml")),
        vaf: Some(0.918_273),
        role,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::new(),
    };
    let mut models: Vec<_> = MODELS[..3].iter().map(|id| model(id, Role::Test)).collect();
    models.push(model(PRACTICE, Role::Practice));
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
            repetitions: 2,
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
            reference: None,
            reference_min_s: 0.0,
            minimum_strokes: 0,
        },
        models,
        questions: vec![rating("realism"), text("comment")],
        setup: Vec::new(),
        intake: Vec::new(),
        outro: Vec::new(),
        analysis: AnalysisRules {
            primary: qid("realism"),
            vaf: None,
            realistic_from: None,
            equivalence_margin: None,
            unfinished: Unfinished::Include,
            exclude: Vec::new(),
        },
    }
}

/// Everything that a protocol can ask for.
pub(crate) fn rich() -> Protocol {
    let some = |text: &str| Some(text.to_owned());
    let mut protocol = plain();
    protocol.text = Text {
        welcome: some("Welcome."),
        instructions: some("Feel, then rate."),
        practice: some("First some practice."),
        rest: some("Rest."),
        end: some("Goodbye."),
        lang: some("en"),
    };
    protocol.consent = Some(Consent {
        document: "Information sheet".to_owned(),
        version: "3".to_owned(),
    });
    protocol.design.practice = vec![ModelId::new(PRACTICE).expect("an identifier")];
    protocol.design.breaks = Some(Breaks {
        every: 2,
        at_least_s: 60.0,
    });
    protocol.trial.reference_min_s = 2.0;
    protocol.trial.minimum_strokes = 3;
    protocol.questions.push(rating("crispness"));
    let number = QuestionKind::Number {
        unit: None,
        min: Some(0.0),
        max: None,
    };
    protocol.setup = vec![question("temperature", number, true), text("rig")];
    protocol.intake = vec![rating("experience"), rating("fatigue")];
    protocol.outro = vec![text("strategy"), rating("effort")];
    protocol
}
