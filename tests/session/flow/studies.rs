//! Protocols that the sessions are run with.

use crate::designs::design;
use std::collections::BTreeMap;
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::*;

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
    let kind = QuestionKind::Rating(kinds::Rating {
        from: 1,
        to: 7,
        labels: BTreeMap::new(),
    });
    question(id, kind, true)
}

pub(crate) fn text(id: &str) -> Question {
    question(id, QuestionKind::Text(kinds::Text), false)
}

/// Three realizations, twice each, one question with a comment.
pub(crate) fn plain() -> Protocol {
    let model = |id: &str, role| ModelEntry {
        id: ModelId::new(id).expect("an identifier"),
        file: Some(format!("models/{id}.toml")),
        vaf: Some(0.918_273),
        role,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::new(),
        levels: BTreeMap::new(),
        media: Default::default(),
    };
    let mut models: Vec<_> = MODELS[..3].iter().map(|id| model(id, Role::Test)).collect();
    models.push(model(PRACTICE, Role::Practice));
    Protocol {
        models,
        questions: vec![rating("realism"), text("comment")],
        ..design(0, 2, Order::Blocked)
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
        words: Default::default(),
        scale_direction: None,
    };
    protocol.consent = Some(Consent {
        document: "Information sheet".to_owned(),
        version: "3".to_owned(),
        file: None,
        text: None,
        initials: false,
    });
    protocol.design.practice = vec![ModelId::new(PRACTICE).expect("an identifier")];
    protocol.design.breaks = Some(Breaks {
        every: 2,
        at_least_s: 60.0,
    });
    protocol.trial.reference_min_s = 2.0;
    protocol.trial.minimum_strokes = 3;
    protocol.questions.push(rating("crispness"));
    let number = QuestionKind::Number(kinds::Number {
        unit: None,
        min: Some(0.0),
        max: None,
        above: None,
    });
    protocol.setup = vec![question("temperature", number, true), text("rig")];
    protocol.intake = vec![rating("experience"), rating("fatigue")];
    protocol.outro = vec![text("strategy"), rating("effort")];
    protocol
}
