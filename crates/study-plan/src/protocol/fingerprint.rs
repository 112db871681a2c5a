//! Fingerprints: which parts of a study may change while it runs.
//!
//! A change of the *stimulus* fingerprint makes a new study; *wording* and
//! *analysis* can be amended, and each session records all three.
//!
//! Each is the SHA-256 of a canonical JSON text: no white space, keys sorted,
//! numbers as serde_json writes them (the shortest text that reads back the same).
//! Every field of a [`Protocol`] is in exactly one of the three, except the paths of
//! files, because moving a file does not change the stimulus, and `[power]`.
//!
//! * stimulus: study id and seed; the design without the planned number of
//!   participants (more of them change no order); device kind, limits,
//!   `uncertified`; each realization's id, role, device, `duplicate_of` and the
//!   SHA-256 of its file and its media; minimum strokes, exposure, duration of the reference; id,
//!   scale and `required` of the questions after a trial and of the questionnaires between trials; the orders file; parts
//!   without their texts, tracks, groups, repeated sessions, and families and spaces with the SHA-256 of their
//!   files; of spaces also which points are certified; the search that is confirmed.
//! * wording: title, authors and the like; all texts, prompts and labels; consent; debriefing;
//!   questions asked once (setup, intake, outro); who types, and when a session
//!   can be resumed.
//! * analysis: `[analysis]`, `[[outcomes]]`, planned participants, VAF and covariates, `[device.rendering]`.

use super::keys::word;
use super::{
    FamilyRules, FileOrders, FitRules, ModelEntry, Occasion, Order, Part, Protocol, Question,
    Questionnaire, SpaceRules, TrackRules,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use study_base::hex::sha256;
use study_base::text::{ModelId, PartId};

/// The fingerprints of a study, SHA-256 in hexadecimal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprints {
    /// Design, models' bytes, limits, rating scales, orders file.
    pub stimulus: String,
    /// Every text that participants and experimenters read.
    pub wording: String,
    /// `[analysis]` and everything else that affects only the analysis.
    pub analysis: String,
}

/// What the three fingerprints are made of, as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    /// What cannot change while a study runs.
    pub stimulus: Value,
    /// What is read.
    pub wording: Value,
    /// What concerns only the analysis.
    pub analysis: Value,
}

impl Parts {
    /// The fingerprints.
    ///
    /// ```
    /// # use study_plan::protocol::{example, fingerprint::parts};
    /// let of = |repetitions| parts(&example::protocol(3, repetitions), &Default::default(), None);
    /// let (once, twice) = (of(1).fingerprints(), of(2).fingerprints());
    /// // Other orders, the same analysis.
    /// assert_ne!(once.stimulus, twice.stimulus);
    /// assert_eq!(once.analysis, twice.analysis);
    /// ```
    pub fn fingerprints(&self) -> Fingerprints {
        Fingerprints {
            stimulus: digest(&self.stimulus),
            wording: digest(&self.wording),
            analysis: digest(&self.analysis),
        }
    }
}

/// The parts of a protocol (with VAFs filled in from the model files), the bytes of each
/// model file, and the orders file, if any.
pub fn parts(
    protocol: &Protocol,
    model_bytes: &BTreeMap<ModelId, Vec<u8>>,
    orders: Option<&FileOrders>,
) -> Parts {
    // No `..`: a new field has to be assigned to a fingerprint.
    let Protocol {
        study,
        text,
        consent,
        debriefing,
        confirms,
        design,
        session,
        device,
        trial,
        models,
        factors,
        questions,
        setup,
        intake,
        outro,
        questionnaires,
        outcomes,
        analysis,
        parts,
        families,
        spaces,
        tracks,
        groups,
        sessions,
        // It changes no session and no result.
        power: _,
    } = protocol;
    let super::Study {
        id,
        title,
        seed,
        authors,
        license,
        ethics,
        contact,
        funding,
        doi,
    } = study;
    let super::Design {
        participants,
        repetitions,
        order,
        max_run,
        min_distance,
        practice,
        breaks,
        max_attempts,
        parts_order,
        order_version,
    } = design;
    let super::TrialRules {
        reference,
        reference_min_s,
        minimum_strokes,
        exposure,
        media_within_ms,
    } = trial;
    let order = match order {
        Order::File(_) => json!("file"),
        order => json!(order),
    };
    let orders: Option<BTreeMap<String, &Vec<ModelId>>> =
        orders.map(|rows| rows.iter().map(|(n, row)| (n.to_string(), row)).collect());
    let stimuli: Vec<Value> = models
        .iter()
        .map(|m| {
            let mut own = json!({
                "id": m.id,
                "role": m.role,
                "device": m.device,
                "duplicate_of": m.duplicate_of,
                "sha256": model_bytes.get(&m.id).map(sha256),
            });
            m.media.pin(&mut own);
            own
        })
        .collect();
    let mut stimulus = json!({
        "study": { "id": id, "seed": seed },
        "design": {
            "repetitions": repetitions,
            "order": order,
            "max_run": max_run,
            "min_distance": min_distance,
            "practice": practice,
            "breaks": breaks,
            "max_attempts": max_attempts,
        },
        "orders": orders,
        "device": device,
        "trial": { "reference_min_s": reference_min_s, "minimum_strokes": minimum_strokes },
        "models": stimuli,
        "questions": questions.iter().map(scale).collect::<Vec<_>>(),
    });
    // Absent from the fingerprints of protocols without it.
    if protocol.has_media() {
        stimulus["trial"]["media_within_ms"] = json!(media_within_ms);
    }
    if *exposure != super::Exposure::default() {
        stimulus["trial"]["exposure"] = json!(exposure);
    }
    if *order_version != super::OrderVersion::default() {
        stimulus["design"]["order_version"] = json!(order_version.number());
    }
    // A study without parts has the fingerprint that it had before there were any.
    if !parts.is_empty() {
        stimulus["parts_order"] = json!(parts_order);
        stimulus["parts"] = parts.iter().map(trials).collect();
        stimulus["families"] = families.iter().map(|f| levels(f, model_bytes)).collect();
        stimulus["tracks"] = json!(tracks);
    }
    // Absent from the fingerprints of protocols without them.
    if confirms.is_some() {
        stimulus["confirms"] = json!(confirms);
    }
    if !spaces.is_empty() {
        stimulus["spaces"] = spaces.iter().map(|s| points(s, model_bytes)).collect();
    }
    let between = |own: &&Questionnaire| own.after != Occasion::Session;
    let between: Vec<&Questionnaire> = questionnaires.iter().filter(between).collect();
    if !between.is_empty() {
        stimulus["questionnaires"] = between.iter().map(|own| asked(own)).collect();
    }
    if groups.is_some() {
        stimulus["groups"] = json!(groups);
    }
    if !sessions.is_empty() {
        stimulus["sessions"] = json!(sessions);
    }
    let mut wording = json!({
        "study": {
            "title": title,
            "authors": authors,
            "license": license,
            "ethics": ethics,
            "contact": contact,
            "funding": funding,
            "doi": doi,
        },
        "text": text,
        "consent": consent,
        "session": session,
        "reference": reference,
        "questions": questions.iter().map(words).collect::<Vec<_>>(),
        "setup": setup,
        "intake": intake,
        "outro": outro,
    });
    // Absent from the fingerprints of protocols without it.
    if debriefing.is_some() {
        wording["debriefing"] = json!(debriefing);
    }
    if protocol.has_media() {
        wording["media"] = super::media::texts(models);
    }
    if !parts.is_empty() {
        wording["parts"] = parts.iter().map(texts).collect();
    }
    if !between.is_empty() {
        let items = between.iter().flat_map(|own| &own.questions);
        wording["questionnaires"] = items.map(words).collect();
    }
    let known = |m: &ModelEntry| json!({ "id": m.id, "vaf": m.vaf, "covariates": m.covariates });
    let mut analysis = json!({
        "analysis": analysis,
        "participants": participants,
        "models": models.iter().map(known).collect::<Vec<_>>(),
    });
    // Absent from the fingerprints of protocols without them.
    if !factors.is_empty() {
        analysis["factors"] = json!(factors);
        let levels = |m: &ModelEntry| json!({ "id": m.id, "levels": m.levels });
        analysis["levels"] = models.iter().map(levels).collect();
    }
    if device.rendering != super::RenderingRules::default() {
        analysis["rendering"] = json!(device.rendering);
    }
    if tracks.iter().any(|t| t.fit != FitRules::default()) {
        analysis["tracks"] = tracks.iter().map(fit).collect();
    }
    if tracks.iter().any(|t| t.measures.is_some()) {
        let condition = |t: &TrackRules| json!({ "id": t.id, "condition": t.condition() });
        analysis["conditions"] = tracks.iter().map(condition).collect();
    }
    if !questionnaires.is_empty() {
        let scored = |own: &Questionnaire| json!(own.scored());
        analysis["questionnaires"] = questionnaires.iter().map(scored).collect();
    }
    if !outcomes.is_empty() {
        analysis["outcomes"] = json!(outcomes);
    }
    Parts {
        stimulus,
        wording,
        analysis,
    }
}

/// What of a questionnaire between the trials determines its answers.
fn asked(own: &Questionnaire) -> Value {
    let Questionnaire {
        id,
        // They decide how the answers are scored.
        kind: _,
        own: _,
        after,
        questions,
    } = own;
    json!({
        "id": id,
        "after": after,
        "questions": questions.iter().map(scale).collect::<Vec<_>>(),
    })
}

/// What of a part is read.
fn texts(part: &Part) -> Value {
    let mut texts = json!({ "id": part.id, "text": part.text });
    // Absent from the fingerprints of protocols without it.
    if let Some(own) = part.task.adjustment() {
        texts["words"] = json!(own.words);
    }
    texts
}

/// What of a part determines its trials.
fn trials(part: &Part) -> Value {
    let Part {
        id,
        task,
        text: _,
        asks,
        exposure,
        gap_s,
    } = part;
    json!({ "id": id, "task": task, "asks": asks, "exposure": exposure, "gap_s": gap_s })
}

/// What of a family determines its tables.
fn levels(family: &FamilyRules, model_bytes: &BTreeMap<ModelId, Vec<u8>>) -> Value {
    let FamilyRules {
        id,
        from: _,
        vary,
        to: _,
        ladder,
        spacing: _,
        unit,
    } = family;
    let bytes = |end| family_file(id, end).and_then(|id| model_bytes.get(&id));
    json!({
        "id": id,
        "vary": vary,
        "levels": ladder,
        "unit": unit,
        "from": bytes("from").map(sha256),
        "to": bytes("to").map(sha256),
    })
}

/// What of a space determines its points.
fn points(space: &SpaceRules, model_bytes: &BTreeMap<ModelId, Vec<u8>>) -> Value {
    let SpaceRules {
        id,
        from: _,
        axes,
        lattice,
    } = space;
    let bytes = family_file(id, "from").and_then(|id| model_bytes.get(&id));
    json!({
        "id": id,
        "axes": axes,
        "lattice": lattice,
        "from": bytes.map(sha256),
    })
}

/// How the functions of a track are fitted, as far as the protocol says it.
fn fit(track: &TrackRules) -> Value {
    let FitRules { scale, core, lapse } = track.fit;
    json!({
        "id": track.id,
        "fit": { "scale": scale.map(word), "core": core.map(word), "lapse": lapse },
    })
}

/// Under which id the bytes of a file of a family or a space are passed to [`parts`]: `id.from`, `id.to`.
pub fn family_file(family: &PartId, end: &str) -> Option<ModelId> {
    ModelId::new(format!("{family}.{end}")).ok()
}

/// The part of a question that determines its answers.
fn scale(question: &Question) -> Value {
    let Question {
        id,
        prompt: _,
        kind,
        required,
    } = question;
    json!({ "id": id, "required": required, "kind": kind.stimulus() })
}

/// The part of a question that is only read.
fn words(question: &Question) -> Value {
    let labels = question.kind.scale().labels();
    json!({ "id": question.id, "prompt": question.prompt, "labels": labels })
}

/// SHA-256 of the canonical text of a value, in hexadecimal.
pub fn digest(value: &Value) -> String {
    sha256(canonical(value))
}

/// JSON with sorted keys, independent of the order of `serde_json`'s map, which
/// another crate of the build can change.
fn canonical(value: &Value) -> String {
    let mut text = String::new();
    write_canonical(value, &mut text);
    text
}

fn write_canonical(value: &Value, text: &mut String) {
    match value {
        Value::Object(map) => {
            let sorted: BTreeMap<&String, &Value> = map.iter().collect();
            text.push('{');
            for (i, (key, value)) in sorted.into_iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                text.push_str(&json!(key).to_string());
                text.push(':');
                write_canonical(value, text);
            }
            text.push('}');
        }
        Value::Array(items) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                write_canonical(item, text);
            }
            text.push(']');
        }
        plain => text.push_str(&plain.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Inventory, QuestionKind, Text, example};

    fn bytes(protocol: &Protocol) -> BTreeMap<ModelId, Vec<u8>> {
        protocol
            .models
            .iter()
            .map(|m| (m.id.clone(), m.id.as_str().as_bytes().to_vec()))
            .collect()
    }

    fn of(
        protocol: &Protocol,
        bytes: &BTreeMap<ModelId, Vec<u8>>,
        orders: Option<&FileOrders>,
    ) -> Fingerprints {
        parts(protocol, bytes, orders).fingerprints()
    }

    fn print(protocol: &Protocol) -> Fingerprints {
        of(protocol, &bytes(protocol), None)
    }

    /// Results folders contain these values: do not change the test. If it fails, this
    /// version could not continue a running study. The first value was reproduced from
    /// the description above with Python's `json.dumps(…,
    /// sort_keys=True, separators=(",", ":"))`.
    #[test]
    fn the_fingerprint_of_an_example_never_changes() {
        let prints = print(&example::protocol(3, 2));
        assert_eq!(
            [prints.stimulus, prints.wording, prints.analysis],
            [
                "4fe9ece2c9624508a7387c19f8011b7ec75e9131cf0f505dab048a94ac6793b2",
                "243c3af4477ee521f02286c6fe83c3ed8c74930b0369270843cb20d7ca8a8574",
                "14412c8515c6492234ba6d5a3b5bcea2f4dd17268f4c4f18f1d4979f17edc9c0",
            ]
        );
    }

    #[test]
    fn keys_are_sorted_and_nothing_else_is() {
        let value = json!({ "b": [2, 1], "a": { "d": null, "c": "\u{e9}\n" }, "x": 0.1 });
        assert_eq!(
            canonical(&value),
            "{\"a\":{\"c\":\"é\\n\",\"d\":null},\"b\":[2,1],\"x\":0.1}"
        );
    }

    #[test]
    fn each_change_affects_one_fingerprint() {
        let base = example::protocol(3, 2);
        let first = print(&base);
        let changed = |f: &dyn Fn(&mut Protocol)| {
            let mut changed = base.clone();
            f(&mut changed);
            let prints = of(&changed, &bytes(&base), None);
            [
                prints.stimulus != first.stimulus,
                prints.wording != first.wording,
                prints.analysis != first.analysis,
            ]
        };
        assert_eq!(changed(&|p| p.study.seed += 1), [true, false, false]);
        assert_eq!(
            changed(&|p| p.design.order = Order::Shuffled),
            [true, false, false]
        );
        assert_eq!(
            changed(&|p| p.design.order_version = crate::protocol::OrderVersion::Unguessable),
            [true, false, false]
        );
        assert_eq!(
            changed(&|p| p.device.limits.force_n = study_base::limits::Limit::new(9.0).unwrap()),
            [true, false, false]
        );
        assert_eq!(
            changed(&|p| p.questions[1].required = true),
            [true, false, false]
        );
        assert_eq!(
            changed(&|p| p.text = Text {
                welcome: Some("hello".to_owned()),
                ..Text::default()
            }),
            [false, true, false]
        );
        assert_eq!(
            changed(&|p| p.questions[0].prompt.push('?')),
            [false, true, false]
        );
        assert_eq!(
            changed(&|p| {
                if let QuestionKind::Rating(rating) = &mut p.questions[0].kind {
                    rating.labels.insert(4, "so so".to_owned());
                }
            }),
            [false, true, false]
        );
        assert_eq!(
            changed(&|p| p.models[0].vaf = Some(0.5)),
            [false, false, true]
        );
        assert_eq!(
            changed(&|p| p.device.rendering.min_vaf = 0.9),
            [false, false, true]
        );
        assert_eq!(
            changed(&|p| p.design.participants = 12),
            [false, false, true]
        );
        assert_eq!(
            changed(&|p| p.models[0].file = Some("elsewhere.toml".to_owned())),
            [false, false, false]
        );
    }

    /// What is asked between the trials is stimulus, as what is asked in them is, and its texts are wording.
    #[test]
    fn a_questionnaire_between_the_trials_is_a_question_of_the_trials() {
        let mut protocol = example::protocol(2, 1);
        protocol.questionnaires.push(Questionnaire {
            id: PartId::new("load").unwrap(),
            kind: Inventory::NasaTlx,
            own: None,
            after: Occasion::Condition,
            questions: protocol.questions.clone(),
        });
        let first = print(&protocol);
        let changed = |f: &dyn Fn(&mut Questionnaire)| {
            let mut changed = protocol.clone();
            f(&mut changed.questionnaires[0]);
            let prints = print(&changed);
            [
                prints.stimulus != first.stimulus,
                prints.wording != first.wording,
                prints.analysis != first.analysis,
            ]
        };
        let occasion = changed(&|own| own.after = Occasion::Block);
        assert_eq!(occasion, [true, false, false]);
        let item = changed(&|own| own.questions[0].prompt.push('?'));
        assert_eq!(item, [false, true, false]);
        let kind = changed(&|own| own.kind = Inventory::Sus);
        assert_eq!(kind, [false, false, true]);
    }

    #[test]
    fn the_bytes_of_a_model_and_the_orders_are_stimulus() {
        let protocol = example::protocol(2, 1);
        let mut files = bytes(&protocol);
        let first = of(&protocol, &files, None);
        let orders = FileOrders::from([(1, vec![protocol.models[0].id.clone()])]);
        assert_ne!(
            of(&protocol, &files, Some(&orders)).stimulus,
            first.stimulus
        );
        files.insert(protocol.models[0].id.clone(), b"other".to_vec());
        assert_ne!(of(&protocol, &files, None).stimulus, first.stimulus);
        assert_eq!(of(&protocol, &files, None).wording, first.wording);
    }
}
