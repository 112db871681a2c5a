//! Warnings about a valid protocol whose design is doubtful.
//!
//! No finding here prevents a study from running. Warnings that need the models'
//! tables or the orders are given where these are loaded.

mod adjustments;
mod counted_out;
mod debriefing;
mod exposure;
mod ladders;
mod maps;
mod parts;
mod questionnaires;

pub use ladders::coarse;
pub use parts::is_about_realizations;

use super::phrases::{self, Phrase};
use super::{Design, DeviceKind, Inventory, ModelEntry, Protocol, Question, Questionnaire, Role};
use std::collections::BTreeMap;
use std::ops::Range;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, Untrusted, counted};
use study_stats::distribution::t_quantile;
use study_stats::within::linked_sets;

/// Number of test realizations from which a correlation over them is informative.
const ENOUGH_REALIZATIONS: usize = 8;

/// Number of trials without a break that needs no warning.
const TRIALS_WITHOUT_BREAK: u32 = 15;

/// Duration of a session, min, that needs no warning.
const LONG_SESSION_MIN: f64 = 60.0;

/// Path of a value → its bytes in the file, as in `file::Parsed`.
pub type Spans = BTreeMap<String, Range<usize>>;

/// All warnings. VAFs should have been filled in from the model files; those of
/// `unread` could not be, which is reported as an error elsewhere.
pub fn warnings(protocol: &Protocol, spans: &Spans, unread: &[&ModelId]) -> Vec<Fault> {
    let mut faults = Vec::new();
    language(protocol, spans, &mut faults);
    untranslated(protocol, spans, &mut faults);
    questionnaires::warnings(protocol, spans, &mut faults);
    debriefing::warnings(protocol, spans, &mut faults);
    birth_dates(protocol, spans, &mut faults);
    if is_about_realizations(protocol) {
        realizations(protocol, spans, &mut faults);
        vaf(protocol, spans, unread, &mut faults);
    }
    if protocol.parts.is_empty() {
        practice(protocol, spans, &mut faults);
    } else {
        parts::warnings(protocol, spans, &mut faults);
    }
    exposure::warnings(protocol, spans, &mut faults);
    duration(protocol, spans, &mut faults);
    roles(protocol, spans, &mut faults);
    apart(protocol, spans, &mut faults);
    faults
}

/// Groups that share no realization, directly or by way of other groups.
fn apart(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    let Some(groups) = &protocol.groups else {
        return;
    };
    let tested = |id: &&ModelId| {
        let of = protocol.models.iter().find(|model| model.id == **id);
        of.is_some_and(|model| model.role == Role::Test)
    };
    let own: Option<Vec<Vec<&ModelId>>> = (groups.list.iter())
        .map(|group| Some(group.models.as_ref()?.iter().filter(tested).collect()))
        .collect();
    // A group without a list has all of them.
    let Some(own) = own.filter(|own| own.iter().all(|models| !models.is_empty())) else {
        return;
    };
    let place = |id: &&ModelId| protocol.models.iter().position(|model| model.id == **id);
    let places: Vec<Vec<usize>> = (own.iter())
        .map(|models| models.iter().filter_map(place).collect())
        .collect();
    let sets = linked_sets(&places, protocol.models.len());
    let set = |group: &Vec<usize>| group.first().map(|at| sets[*at]);
    if let Some(i) = (places.iter()).position(|group| set(group) != set(&places[0])) {
        faults.push(
            Fault::warning(format!(
                "the groups `{}` and `{}` share no realization: whether realizations of different groups differ cannot be told from whether their participants do",
                groups.list[0].id, groups.list[i].id
            ))
            .at(spans.get(&format!("groups.list[{i}].models")).cloned())
            .hint("let both rate at least one of them, better two"),
        );
    }
}

/// Fixed sentences that the language of the study lacks.
fn language(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    let Some(lang) = &protocol.text.lang else {
        return;
    };
    if phrases::is_right_to_left(lang) && protocol.text.scale_direction.is_none() {
        let what = "scales begin on the right, in the terminal and on the participant's page";
        faults.push(
            Fault::warning(what)
                .at(spans.get("text.lang").cloned())
                .hint("say so, scale_direction = \"rtl\" in [text], or let them begin on the left: \"ltr\""),
        );
    }
    if phrases::is_shipped(lang) {
        return;
    }
    let own = &protocol.text.words;
    let all = Phrase::ALL.iter().map(|phrase| phrase.key());
    let missing: Vec<&str> = all.filter(|key| !own.contains_key(*key)).collect();
    let Some(first) = missing.first() else {
        return;
    };
    let count = counted(missing.len(), "fixed sentence", "fixed sentences");
    let shipped: Vec<&str> = phrases::languages().collect();
    faults.push(
        Fault::warning(format!(
            "{count} that participants read would be in English: `{}` is not one of {}",
            Untrusted(lang),
            shipped.join(", ")
        ))
        .at(spans.get("text.lang").cloned())
        .hint(format!(
            "write them in [text.words], beginning with `{first}`: {}",
            missing.join(", ")
        )),
    );
}

/// Questionnaires that are in English in a study of another language.
fn untranslated(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    let lang = protocol.text.lang.as_deref().unwrap_or("en");
    if lang.split('-').next() == Some("en") {
        return;
    }
    for (i, own) in protocol.questionnaires.iter().enumerate() {
        let has = |key: &str| spans.contains_key(&format!("questionnaires[{i}].{key}"));
        let texts: &[&str] = match own.kind {
            Inventory::Sus | Inventory::NasaTlx => &["items", "labels"],
            Inventory::NasaTlxWeighted => &["items", "labels", "titles", "compare"],
            Inventory::Own => &[],
        };
        if !texts.iter().all(|key| has(key)) {
            faults.push(
                Fault::warning(format!(
                    "the questionnaire `{}` is in English, and the study in `{}`",
                    own.id,
                    Untrusted(lang)
                ))
                .at(spans.get(&format!("questionnaires[{i}].id")).cloned())
                .hint(format!(
                    "write a published translation in {}",
                    texts.join(", ")
                )),
            );
        }
    }
}

/// Questions that ask for a date of birth, which identifies a person.
fn birth_dates(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    const WORDS: [&str; 6] = ["birth", "geburt", "naissance", "nacimiento", "生年", "出生"];
    for (i, question) in protocol.intake.iter().enumerate() {
        let asked = format!("{} {}", question.id, question.prompt).to_lowercase();
        if WORDS.iter().any(|word| asked.contains(word)) {
            faults.push(
                Fault::warning(format!(
                    "the question `{}` seems to ask for a date of birth, which identifies a person",
                    question.id
                ))
                .at(spans.get(&format!("intake[{i}].prompt")).cloned())
                .hint("ask for the age in years"),
            );
        }
    }
}

/// Trials of a session, practice included, unless an orders file has fewer; with staircases
/// the most.
///
/// ```
/// # use study_plan::protocol::{check, example};
/// // Five realizations, three times each.
/// assert_eq!(check::trials(&example::protocol(5, 3)), 15);
/// ```
pub fn trials(protocol: &Protocol) -> u32 {
    if !protocol.parts.is_empty() {
        let parts = protocol.parts.iter();
        return parts.map(|part| parts::trials(protocol, part)).sum();
    }
    let Design {
        repetitions,
        practice,
        ..
    } = &protocol.design;
    let models = u32::try_from(protocol.scheduled_models().count()).unwrap_or(u32::MAX);
    let practice = u32::try_from(practice.len()).unwrap_or(u32::MAX);
    models.saturating_mul(*repetitions).saturating_add(practice)
}

/// Assumed durations, s, for a participant who takes their time.
mod pace {
    /// Arrival: welcome, instructions, hand on the device.
    pub(super) const ARRIVAL_S: f64 = 120.0;
    /// Reading and signing a consent form.
    pub(super) const CONSENT_S: f64 = 120.0;
    /// Operating the reference before a trial.
    pub(super) const REFERENCE_S: f64 = 15.0;
    /// Loading a table, or mounting a sample by hand.
    pub(super) const LOAD_S: f64 = 2.0;
    pub(super) const MOUNT_S: f64 = 30.0;
    /// Exploring a realization without a time limit.
    pub(super) const EXPLORE_S: f64 = 25.0;
    /// The same for an interval that is compared with another.
    pub(super) const COMPARE_S: f64 = 10.0;
    /// The same for each level of an adjustment.
    pub(super) const STEP_S: f64 = 4.0;
}

/// Estimated duration of a session, min. Assumes 25 s of exploration and 15 s with
/// the reference in a trial, 6 s for an answer that is chosen, 15 s for one that is
/// typed (8 s if optional), 30 s to mount a sample by hand, 2 min for arrival, 2 min
/// for consent, breaks of the least duration, and the questionnaires between the trials.
pub fn minutes(protocol: &Protocol) -> f64 {
    let mut seconds = pace::ARRIVAL_S;
    if protocol.consent.is_some() {
        seconds += pace::CONSENT_S;
    }
    for once in [&protocol.setup, &protocol.intake, &protocol.outro] {
        seconds += answers_s(once);
    }
    let reference = match protocol.trial.reference {
        Some(_) => pace::REFERENCE_S.max(protocol.trial.reference_min_s),
        None => protocol.trial.reference_min_s,
    };
    let trial = reference + pace::EXPLORE_S + answers_s(&protocol.questions);
    let load = |model: &ModelEntry| match protocol.device_of(model) {
        DeviceKind::Manual => pace::MOUNT_S,
        DeviceKind::Simulated | DeviceKind::Serial | DeviceKind::Process => pace::LOAD_S,
    };
    for part in &protocol.parts {
        seconds += parts::seconds(protocol, part, reference);
    }
    let whole = protocol.parts.is_empty();
    let repetitions = f64::from(if whole {
        protocol.design.repetitions
    } else {
        0
    });
    for model in protocol.scheduled_models() {
        seconds += repetitions * (trial + load(model));
    }
    for id in &protocol.design.practice {
        seconds += trial + protocol.model(id).map_or(0.0, load);
    }
    if let Some(breaks) = protocol.design.breaks {
        let counted = trials(protocol).saturating_sub(practice_trials(protocol));
        let rests = counted.saturating_sub(1) / breaks.every.max(1);
        seconds += f64::from(rests) * breaks.at_least_s;
    }
    let items = |own: &Questionnaire| answers_s(&own.questions);
    let between = |own: &Questionnaire| f64::from(own.times(protocol)) * items(own);
    seconds += protocol.questionnaires.iter().map(between).sum::<f64>();
    seconds / 60.0
}

fn answers_s(questions: &[Question]) -> f64 {
    questions.iter().map(|q| q.kind.seconds(q.required)).sum()
}

fn practice_trials(protocol: &Protocol) -> u32 {
    u32::try_from(protocol.design.practice.len()).unwrap_or(u32::MAX)
}

fn tests(protocol: &Protocol) -> impl Iterator<Item = &ModelEntry> {
    protocol
        .models
        .iter()
        .filter(|m| m.role == Role::Test && m.duplicate_of.is_none())
}

fn realizations(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    let n = tests(protocol).count();
    if n >= ENOUGH_REALIZATIONS {
        return;
    }
    // What ratings are correlated with.
    let has_vaf = tests(protocol).any(|m| m.vaf.is_some());
    let has_file = tests(protocol).any(|m| m.file.is_some());
    // A factorial study compares levels, unless it states a VAF.
    let of_forces = has_vaf || (has_file && protocol.factors.is_empty());
    let with = match of_forces {
        true => "VAF",
        false if tests(protocol).any(|m| !m.covariates.is_empty()) => "a covariate",
        false => return,
    };
    let alpha = protocol.analysis.alpha();
    let so = match critical_r(n, alpha) {
        None => format!("no correlation of ratings with {with} can be tested"),
        Some(r) => {
            let level = alpha.to_string();
            let level = level.trim_start_matches('0');
            format!("|r| with {with} has to exceed {r:.3} for p < {level}")
        }
    };
    let count = counted(n, "test realization", "test realizations");
    faults.push(
        Fault::warning(format!("{count}: {so}"))
            .at(spans.get("models").cloned().or(spans.get("models[0]").cloned()).map(first_line))
            .hint(format!(
                "what differs between realizations is tested over realizations, not over ratings; {ENOUGH_REALIZATIONS} or more are better"
            )),
    );
}

/// |r| of n points at a two-sided p of `alpha`: t/√(t² + n − 2).
fn critical_r(n: usize, alpha: f64) -> Option<f64> {
    let df = n.checked_sub(2).filter(|df| *df > 0)? as f64;
    let t = t_quantile(1.0 - alpha / 2.0, df)?;
    Some(t / (t * t + df).sqrt())
}

fn vaf(protocol: &Protocol, spans: &Spans, unread: &[&ModelId], faults: &mut Vec<Fault>) {
    let known: Vec<f64> = tests(protocol).filter_map(|m| m.vaf).collect();
    if known.is_empty() {
        return;
    }
    let without: Vec<&str> = tests(protocol)
        .filter(|m| m.vaf.is_none() && !unread.contains(&&m.id))
        .map(|m| m.id.as_str())
        .collect();
    if !without.is_empty() {
        faults.push(
            Fault::warning(format!(
                "no VAF is known for {}: the correlation excludes them",
                without.join(", ")
            ))
            .at(spans.get("analysis.vaf").cloned()),
        );
    }
}

fn practice(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    for (i, id) in protocol.design.practice.iter().enumerate() {
        let role = protocol.model(id).map(|m| m.role);
        if role == Some(Role::Test) {
            faults.push(
                Fault::warning(format!("`{id}` is practiced and then tested"))
                    .at(spans.get(&format!("design.practice[{i}]")).cloned())
                    .hint("practice with realizations of role \"practice\" or an anchor"),
            );
        }
    }
    for (i, model) in protocol.models.iter().enumerate() {
        if model.role == Role::Practice && !protocol.design.practice.contains(&model.id) {
            faults.push(
                Fault::warning(format!("`{}` is never played", model.id))
                    .at(spans.get(&format!("models[{i}].id")).cloned())
                    .label("not in `design.practice`"),
            );
        }
    }
}

fn duration(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    let counted = trials(protocol).saturating_sub(practice_trials(protocol));
    let minutes = minutes(protocol);
    let part = || spans.get("parts[0]").cloned().map(first_line);
    let place = spans.get("design.repetitions").cloned().or_else(part);
    if protocol.design.breaks.is_none() && counted > TRIALS_WITHOUT_BREAK {
        faults.push(
            Fault::warning(format!("{counted} trials without a break"))
                .at(place.clone())
                .hint("such as breaks = { every = 15, at_least_s = 60 }"),
        );
    }
    if let Some(breaks) = protocol.design.breaks
        && breaks.every >= counted
    {
        faults.push(
            Fault::warning(format!(
                "no break occurs: a session has {counted} trials, the first break would be after {}",
                breaks.every
            ))
            .at(spans.get("design.breaks").cloned()),
        );
    }
    if minutes > LONG_SESSION_MIN {
        faults.push(
            Fault::warning(format!("a session takes about {minutes:.0} minutes"))
                .at(place)
                .hint("fewer repetitions or realizations reduce fatigue"),
        );
    }
}

fn roles(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    for (i, model) in protocol.models.iter().enumerate() {
        let by_hand = protocol.device_of(model) == DeviceKind::Manual;
        if model.role == Role::Physical && !by_hand {
            faults.push(
                Fault::warning(format!(
                    "`{}` is a physical sample, but a device plays it",
                    model.id
                ))
                .at(spans.get(&format!("models[{i}].role")).cloned())
                .hint("add device = \"manual\""),
            );
        }
    }
    for (i, rule) in protocol.analysis.exclude.iter().enumerate() {
        let Some(lacks) = rule.idle(protocol) else {
            continue;
        };
        let name = rule.name();
        faults.push(
            Fault::warning(format!("the rule `{name}` excludes nobody: {lacks}"))
                .at(spans.get(&format!("analysis.exclude[{i}].rule")).cloned()),
        );
    }
}

/// The start of a long span, so that the caret does not cover the file.
fn first_line(span: Range<usize>) -> Range<usize> {
    span.start..span.end.min(span.start + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::groups::{Assign, GroupRules, Groups};
    use crate::protocol::{Breaks, example};

    fn messages(protocol: &Protocol) -> Vec<String> {
        let mut protocol = protocol.clone();
        protocol.trial.minimum_strokes = 1;
        warnings(&protocol, &Spans::new(), &[])
            .into_iter()
            .map(|f| f.message)
            .collect()
    }

    #[test]
    fn eight_spread_realizations_in_fifteen_trials_give_no_warning() {
        let mut protocol = example::protocol(8, 1);
        for (i, model) in protocol.models.iter_mut().enumerate() {
            model.vaf = Some(0.9 - 0.1 * i as f64);
        }
        assert_eq!(messages(&protocol), Vec::<String>::new());
    }

    #[test]
    fn few_realizations_give_a_warning_with_the_critical_correlation() {
        let mut protocol = example::protocol(5, 3);
        // without numbers that could explain the ratings nothing is correlated
        assert_eq!(messages(&protocol), Vec::<String>::new());
        for (i, model) in (1u8..).zip(&mut protocol.models) {
            model.covariates = [("roughness".to_owned(), f64::from(i))].into();
        }
        assert_eq!(
            messages(&protocol),
            ["5 test realizations: |r| with a covariate has to exceed 0.878 for p < .05"]
        );
        for (i, model) in (1u8..).zip(&mut protocol.models) {
            model.vaf = Some(0.9 - 0.1 * f64::from(i));
        }
        assert_eq!(
            messages(&protocol),
            ["5 test realizations: |r| with VAF has to exceed 0.878 for p < .05"]
        );
        // by the level of the protocol; R: qt(.995, 3) / sqrt(qt(.995, 3)^2 + 3)
        protocol.analysis.alpha = Some(0.01);
        assert_eq!(
            messages(&protocol),
            ["5 test realizations: |r| with VAF has to exceed 0.959 for p < .01"]
        );
    }

    #[test]
    fn minutes_grow_with_trials_and_breaks() {
        let mut protocol = example::protocol(5, 3);
        // 120 s + 15 × (15 + 25 + 2 + 6 + 8) s
        assert!((minutes(&protocol) - (120.0 + 15.0 * 56.0) / 60.0).abs() < 1e-9);
        protocol.design.breaks = Some(Breaks {
            every: 5,
            at_least_s: 60.0,
        });
        // after trials 5 and 10, not after the last
        assert!((minutes(&protocol) - (240.0 + 15.0 * 56.0) / 60.0).abs() < 1e-9);
        assert_eq!(trials(&protocol), 15);
        // practice takes as long as any trial
        let before = minutes(&protocol);
        protocol.design.practice = vec![protocol.models[0].id.clone()];
        assert!((minutes(&protocol) - before - 56.0 / 60.0).abs() < 1e-9);
    }

    #[test]
    fn practice_with_a_test_realization_gives_a_warning() {
        let mut protocol = example::protocol(8, 1);
        let id = protocol.models[0].id.clone();
        protocol.design.practice = vec![id];
        assert_eq!(messages(&protocol), ["`A` is practiced and then tested"]);
        protocol.models[1].role = Role::Practice;
        assert!(messages(&protocol).contains(&"`B` is never played".to_owned()));
    }

    #[test]
    fn a_date_of_birth_gives_a_warning() {
        let about_birth = |prompt: &str| {
            let mut protocol = example::protocol(8, 1);
            let mut question = protocol.questions[0].clone();
            prompt.clone_into(&mut question.prompt);
            protocol.intake.push(question);
            messages(&protocol)
                .iter()
                .any(|m| m.contains("date of birth"))
        };
        assert!(about_birth("Date of birth") && about_birth("生年月日"));
        assert!(!about_birth("How old are you?"));
    }

    #[test]
    fn a_break_that_never_occurs_gives_a_warning() {
        let mut protocol = example::protocol(8, 2);
        for (every, warned) in [(15, false), (16, true), (17, true)] {
            protocol.design.breaks = Some(Breaks {
                every,
                at_least_s: 60.0,
            });
            let found = messages(&protocol);
            assert_eq!(
                found.iter().any(|m| m.starts_with("no break occurs")),
                warned,
                "{every}: {found:?}"
            );
        }
    }

    #[test]
    fn groups_that_share_no_realization_give_a_warning() {
        let mut protocol = example::protocol(8, 2);
        let ids: Vec<ModelId> = protocol.models.iter().map(|m| m.id.clone()).collect();
        let id = |i: usize| ids[i].clone();
        let group = |name: &str, models: Option<Vec<usize>>| GroupRules {
            id: name.parse().unwrap(),
            share: 1,
            parts: None,
            models: models.map(|all| all.into_iter().map(id).collect()),
        };
        let cases = [
            (
                vec![group("a", Some(vec![0, 1])), group("b", Some(vec![2, 3]))],
                true,
            ),
            (
                vec![group("a", Some(vec![0, 1])), group("b", Some(vec![1, 2]))],
                false,
            ),
            (vec![group("a", Some(vec![0, 1])), group("b", None)], false),
            // a and c by way of b
            (
                vec![
                    group("a", Some(vec![0, 1])),
                    group("c", Some(vec![3, 4])),
                    group("b", Some(vec![1, 3])),
                ],
                false,
            ),
        ];
        for (list, warned) in cases {
            protocol.groups = Some(Groups {
                assign: Assign::Given,
                list,
            });
            let found = messages(&protocol);
            let about = |m: &String| m.contains("`a` and `b` share no realization");
            assert_eq!(found.iter().any(about), warned, "{found:?}");
        }
    }
}
