//! `[[outcomes]]`.

use super::agree::{Sections, at, collision, unknown};
use super::questions::PartialQuestion;
use crate::protocol::DeviceKind;
use crate::protocol::columns::is_parts_column;
use crate::protocol::factors::GROUP;
use crate::protocol::keys::{Id, Kind, Shape, Variants, Words as _, keys};
use crate::protocol::outcomes::{
    Answers, BetterEnd, Clock, DeviceNumber, MAX_OUTCOMES, Measure, OutcomeFamily, OutcomeRules,
    Telemetry, Transform, suffix,
};
use crate::protocol::questionnaires::Scored;
use crate::protocol::section::{Section, Variant, shapes};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::{QuestionId, Untrusted};

pub(super) static OUTCOMES: Variants = Variants {
    tag: "from",
    effect: "What measures the outcome",
    common: keys! {
        /// The name of the outcome, in the report and in the identifiers of its statistics.
        "id": Kind::Id(Id::Question), r#""time""#, required;
        /// The unit of its numbers. Of clock and telemetry it follows from what is measured, and one that is stated has to
        /// be the same. Of a device it is part of the key of the message.
        "unit": Kind::Text, r#""s""#, derived("that of what is measured; of answers `points`, of a device `1`: none");
        /// Which end is better. With it the report says best and worst, without it highest and lowest.
        "better": Kind::Word(BetterEnd::WORDS), r#""lower""#;
        /// What is analyzed: the numbers, or their logarithms. Times and forces are skewed, and what changes
        /// them does so by a factor; their logarithms are nearer to what the tests assume.
        "transform": Kind::Word(Transform::WORDS), r#""log""#, default(r#""none""#);
        /// A generalized mixed model that is fitted besides, as a second opinion that decides nothing: `"poisson"` of
        /// counts, `"binomial"` of successes in `of` trials, `"gamma"` of numbers above 0, such as times and forces.
        "model": Kind::Word(OutcomeFamily::WORDS), r#""poisson""#;
        /// With `model = "binomial"`: of how many trials the number is the successes, such as the attempts of which
        /// somebody counts the hits.
        "of": Kind::Whole(1, 1_000_000), "10";
    },
    shapes: &SHAPES,
};

static SHAPES: [Shape; KINDS.len()] = shapes(&KINDS);

const KINDS: [Variant<Measure>; 4] = [
    Variant::new(
        "clock",
        "The clock of the session.",
        keys! {
            /// What it measures.
            "measure": Kind::Word(Clock::WORDS), r#""response""#, default(r#""exploration""#);
        },
        |section| section.word("measure").map(Measure::Clock),
    ),
    Variant::new(
        "telemetry",
        "What the device reports of motion and force, by the formulas of [outcomes.md](outcomes.md).",
        keys! {
            /// What is measured from it.
            "measure": Kind::Word(Telemetry::WORDS), r#""peak-force""#, required;
        },
        |section| section.word("measure").map(Measure::Telemetry),
    ),
    Variant::new(
        "answers",
        "Numbers that are asked for in the trial: errors that somebody counts, or the items of a questionnaire after each condition.",
        keys! {
            /// The ids of the questions, of `[[questions]]`, whose answers are numbers. Of several the mean is
            /// taken; a trial in which one is not answered is not measured.
            "questions": Kind::Ids(Id::Question), r#"["mental", "effort"]"#, required;
        },
        |section| {
            Some(Measure::Answers(Answers {
                questions: section.ids("questions")?,
                unit: "points".to_owned(),
            }))
        },
    ),
    Variant::new(
        "device",
        "A number that the controller program sends with the outcome of a playback ([devices.md](devices.md), section 3): of `kind = \"process\"`.",
        keys! {
            /// What it measures. With the unit it is the key of the message: `time_s` of `measure = "time"` with `unit = "s"`.
            "measure": Kind::Id(Id::Question), r#""time""#, required;
        },
        |section| {
            Some(Measure::Device(DeviceNumber {
                name: section.question_id("measure")?,
                unit: "1".to_owned(),
            }))
        },
    ),
];

/// An outcome that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialOutcome {
    /// Such as `outcomes[0]`.
    path: String,
    id: Option<QuestionId>,
    outcome: Option<OutcomeRules>,
}

pub(super) fn read(root: &mut Section<'_, '_>) -> Vec<PartialOutcome> {
    (root.variants("outcomes", &KINDS).into_iter())
        .map(|(mut section, kind)| {
            let id = section.question_id("id");
            let mut measure = kind.and_then(|kind| (kind.read)(&mut section));
            let unit = section.text("unit");
            match (&mut measure, &unit) {
                (Some(Measure::Answers(answers)), Some(unit)) => answers.unit.clone_from(unit),
                (Some(Measure::Device(number)), Some(unit)) => {
                    number.unit.clone_from(unit);
                    if unit != "1" && suffix(unit).is_none() {
                        let what = format!(
                            "the unit {} has no letters for the key of the message",
                            Untrusted(unit)
                        );
                        section.fault_at(
                            "unit",
                            Fault::error(what).hint("unit = \"1\" if it has none"),
                        );
                    }
                }
                _ => {}
            }
            if let (Some(measure), Some(unit)) = (&measure, unit)
                && unit != measure.unit()
            {
                let what = format!(
                    "the {} is measured in {}, not in {}",
                    measure.noun(),
                    measure.unit(),
                    Untrusted(&unit)
                );
                let hint = format!("unit = \"{}\", or leave it out", measure.unit());
                section.fault_at("unit", Fault::error(what).hint(hint));
            }
            let better: Option<BetterEnd> = section.word("better");
            let transform: Option<Transform> = section.word("transform");
            let model: Option<OutcomeFamily> = section.word("model");
            let is_given = section.value("of").is_some();
            let of: Option<u32> = section.whole("of");
            if let Some((key, fault)) = faulty_model(model, is_given, measure.as_ref()) {
                section.fault_at(key, fault);
            }
            PartialOutcome {
                path: section.path().to_owned(),
                outcome: (|| {
                    Some(OutcomeRules {
                        id: id.clone()?,
                        measure: measure?,
                        better,
                        transform: transform?,
                        model,
                        of,
                    })
                })(),
                id,
            }
        })
        .collect()
}

impl PartialOutcome {
    /// The score of a questionnaire after each condition, whose section has this path.
    pub(super) fn of_questionnaire(path: &str, scored: Scored, better: Option<BetterEnd>) -> Self {
        let name = QuestionId::new(scored.id.as_str()).ok();
        let rules = |name: QuestionId| OutcomeRules {
            id: name,
            measure: Measure::Questionnaire(scored),
            better,
            transform: Transform::Identity,
            model: None,
            of: None,
        };
        Self {
            path: path.to_owned(),
            outcome: name.clone().map(rules),
            id: name,
        }
    }

    pub(super) fn finish(self) -> Option<OutcomeRules> {
        self.outcome
    }
}

/// What is wrong with a generalized mixed model, and at which key.
fn faulty_model(
    model: Option<OutcomeFamily>,
    has_trials: bool,
    measure: Option<&Measure>,
) -> Option<(&'static str, Fault)> {
    let is_binomial = model == Some(OutcomeFamily::Binomial);
    if has_trials != is_binomial {
        return Some(match is_binomial {
            true => {
                let fault = Fault::error("a binomial model needs the number of trials");
                (
                    "model",
                    fault.hint("of = 10, where the number is the hits of 10 attempts"),
                )
            }
            false => {
                let fault = Fault::error("`of` belongs to a binomial model");
                (
                    "of",
                    fault.hint("add model = \"binomial\", or leave it out"),
                )
            }
        });
    }
    let measure = measure?;
    let counts = matches!(
        model,
        Some(OutcomeFamily::Poisson | OutcomeFamily::Binomial)
    );
    (counts && !measure.can_be_counted()).then(|| {
        let what = format!(
            "a {} model is of counts, and the {} is none",
            if is_binomial { "binomial" } else { "Poisson" },
            measure.noun()
        );
        let hint =
            "name strokes or one question that is answered by a count, or use model = \"gamma\"";
        ("model", Fault::error(what).hint(hint))
    })
}

/// Reports names that something else has, the same measurement twice, and outcomes of a study without
/// trials that they could be measured in.
pub(super) fn agree(all: &[PartialOutcome], sections: &Sections<'_>, document: &Document<'_>) {
    let fault = |path: &str, key: &str, fault: Fault| {
        document.fault(fault.at(at(document, path, key)));
    };
    let Some(first) = all.first() else {
        return;
    };
    if sections.only_asks() {
        let what = "outcomes are measured in trials, and the study has none";
        fault(&first.path, "from", Fault::error(what));
    }
    if let Some(question) = primary_of_part(sections) {
        let name = question.id.as_ref().map_or("", QuestionId::as_str);
        let what = format!(
            "outcomes are measured in trials that rate a realization, and the primary question, `{name}`, is the answer of a part of another kind"
        );
        let hint =
            "name a question of [[questions]] in `analysis.primary`, or leave [[outcomes]] out";
        fault(&first.path, "from", Fault::error(what).hint(hint));
    }
    if let Some(more) = all.get(MAX_OUTCOMES) {
        let what = format!("there are more than {MAX_OUTCOMES} outcomes");
        let hint = "each is tested, and the tests are corrected for their number: choose those that matter";
        fault(&more.path, "id", Fault::error(what).hint(hint));
    }
    let asked: Vec<&PartialQuestion> = (sections.questions.iter())
        .chain(&sections.between)
        .collect();
    for (i, own) in all.iter().enumerate() {
        let (path, Some(id)) = (own.path.as_str(), &own.id) else {
            continue;
        };
        let name = id.as_str();
        let is = |other: &str| other.eq_ignore_ascii_case(name);
        let question = |id: &Option<QuestionId>| id.as_ref().is_some_and(|id| is(id.as_str()));
        let earlier = all[..i].iter().filter_map(|o| o.id.as_ref());
        if let Some(other) = earlier.clone().find(|other| is(other.as_str())) {
            fault(path, "id", collision(name, other.as_str()));
        } else if asked.iter().any(|q| question(&q.id)) {
            let what = format!("`{name}` is a question and an outcome");
            fault(path, "id", Fault::error(what));
        } else if is(GROUP) || sections.factors.iter().any(|f| is(f.id.as_str())) {
            let what = format!("`{name}` is a factor and an outcome");
            fault(path, "id", Fault::error(what));
        } else if sections
            .models
            .iter()
            .any(|m| m.covariates.keys().any(|c| is(c)))
        {
            let what = format!("`{name}` is a covariate and an outcome");
            fault(path, "id", Fault::error(what));
        } else if is_parts_column(name) {
            let what = format!("`{name}` is a column of ratings.csv already");
            fault(path, "id", Fault::error(what).label("choose another name"));
        }
        let by_hand = sections
            .device
            .is_some_and(|d| d.kind == DeviceKind::Manual);
        if by_hand
            && matches!(
                own.outcome,
                Some(OutcomeRules {
                    measure: Measure::Telemetry(_),
                    ..
                })
            )
        {
            let what = format!("`{name}` needs telemetry, and samples mounted by hand report none");
            fault(path, "from", Fault::error(what));
        }
        let by_program = (sections.device).is_none_or(|d| d.kind == DeviceKind::Process);
        let is_sent = |o: &OutcomeRules| matches!(o.measure, Measure::Device(_));
        if !by_program && own.outcome.as_ref().is_some_and(is_sent) {
            let what = format!("`{name}` is sent by a controller program, and the study has none");
            let hint = "device.kind = \"process\"";
            fault(path, "from", Fault::error(what).hint(hint));
        }
        if let Some(Measure::Answers(answers)) = own.outcome.as_ref().map(|o| &o.measure) {
            for what in faulty_answers(answers, sections) {
                fault(path, "questions", what);
            }
        }
        let measure = |o: &'_ PartialOutcome| o.outcome.as_ref().map(|o| o.measure.clone());
        // A number of a device is known by its key alone: `peak_mn` of mN and of MN.
        let key = |o: &'_ PartialOutcome| match measure(o) {
            Some(Measure::Device(number)) => Some(number.key()),
            _ => None,
        };
        let same = |other: &&PartialOutcome| {
            let is_same = measure(own).is_some() && measure(other) == measure(own);
            is_same || (key(own).is_some() && key(other) == key(own))
        };
        if let Some(other) = all[..i].iter().find(same).and_then(|o| o.id.as_ref()) {
            let what = format!("`{other}` and `{name}` are the same measurement");
            fault(path, "measure", Fault::error(what));
        }
    }
}

/// The primary question, if it is the answer of a part: no rating of a realization.
pub(super) fn primary_of_part<'a>(sections: &'a Sections<'_>) -> Option<&'a PartialQuestion> {
    let primary = sections.analysis.map(|analysis| &analysis.primary);
    let mut questions = sections.questions.iter();
    questions.find(|q| q.id.as_ref() == primary && q.path.starts_with("parts["))
}

/// What is wrong with the questions of an outcome.
fn faulty_answers(answers: &Answers, sections: &Sections<'_>) -> Vec<Fault> {
    let mut found = Vec::new();
    if answers.questions.is_empty() {
        found.push(Fault::error("an outcome of no question").label("name at least one"));
    }
    for (i, id) in answers.questions.iter().enumerate() {
        let known = sections
            .questions
            .iter()
            .find(|q| q.id.as_ref() == Some(id));
        let is_number = |q: &PartialQuestion| q.kind.as_ref().is_none_or(|k| k.scale().is_number());
        match known {
            None => {
                let ids = sections.questions.iter().filter_map(|q| q.id.as_ref());
                found.push(unknown(
                    "question",
                    id.as_str(),
                    ids.map(QuestionId::as_str),
                ));
            }
            Some(question) if !is_number(question) => {
                let what = format!("the answers to `{id}` are no numbers");
                found.push(Fault::error(what));
            }
            Some(_) if answers.questions[..i].contains(id) => {
                found.push(Fault::error(format!("`{id}` is there twice")));
            }
            Some(_) => {}
        }
    }
    found
}
