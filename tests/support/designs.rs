//! Protocols for the tests and benches of the schedule, built without a file.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::collections::BTreeMap;
use study_base::limits::{Limit, Limits};
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::*;

/// Realizations `A`, `B`, … `Z`, `a`, … and nothing beside the design.
pub(crate) fn design(models: usize, repetitions: u32, order: Order) -> Protocol {
    let limit = |value| Limit::new(value).expect("a positive number");
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
        debriefing: None,
        confirms: None,
        design: Design {
            participants: 10,
            repetitions,
            order,
            max_run: None,
            min_distance: None,
            practice: Vec::new(),
            breaks: None,
            max_attempts: 3,
            parts_order: PartsOrder::Fixed,
            order_version: OrderVersion::Balanced,
        },
        session: SessionRules {
            entry: Entry::Participant,
            resume_within_h: 4.0,
            longest_pause_s: LONGEST_PAUSE_S,
        },
        device: DeviceRules {
            kind: DeviceKind::Simulated,
            limits: Limits {
                force_n: limit(12.0),
                velocity_mm_s: limit(1000.0),
            },
            lever_mm: None,
            uncertified: None,
            rendering: Default::default(),
            check_within_h: None,
            commissioned_within_days: None,
            self_weigh: false,
        },
        trial: TrialRules {
            reference: None,
            reference_min_s: 0.0,
            minimum_strokes: 0,
            exposure: Default::default(),
            media_within_ms: MEDIA_WITHIN_MS,
        },
        models: (b'A'..=b'Z')
            .chain(b'a'..=b'z')
            .take(models)
            .map(|c| model(&char::from(c).to_string()))
            .collect(),
        factors: Vec::new(),
        questions: Vec::new(),
        setup: Vec::new(),
        parts: Vec::new(),
        families: Vec::new(),
        spaces: Vec::new(),
        tracks: Vec::new(),
        groups: None,
        sessions: Vec::new(),
        intake: Vec::new(),
        outro: Vec::new(),
        questionnaires: Vec::new(),
        outcomes: Vec::new(),
        power: Default::default(),
        analysis: AnalysisRules {
            primary: QuestionId::new("realism").expect("an identifier"),
            vaf: None,
            share_of: None,
            realistic_from: None,
            equivalence_margin: None,
            equivalence_r: None,
            unfinished: Unfinished::Include,
            exclude: Vec::new(),
            alpha: None,
            construct: None,
            model: None,
        },
    }
}

/// The same with constraints.
pub(crate) fn constrained(
    models: usize,
    repetitions: u32,
    order: Order,
    max_run: Option<u32>,
    min_distance: Option<u32>,
) -> Protocol {
    let mut protocol = design(models, repetitions, order);
    protocol.design.max_run = max_run;
    protocol.design.min_distance = min_distance;
    protocol
}

/// An entry without a file.
pub(crate) fn model(id: &str) -> ModelEntry {
    ModelEntry {
        id: ModelId::new(id).expect("an identifier"),
        file: None,
        vaf: None,
        role: Role::Test,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::new(),
        levels: BTreeMap::new(),
        media: Default::default(),
    }
}
