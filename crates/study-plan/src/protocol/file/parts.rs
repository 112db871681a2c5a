//! `[[parts]]`: trials of one kind each.

use super::adjustment::{ADJUSTMENT, RawAdjustment};
use super::pairs::{RawPairs, which};
use super::ranking::{RANKING, RawRanking};
use super::similarity::{RawSimilarity, SIMILARITY};
use super::spaces::RULES;
use super::standard::{RawStandard, standard};
use crate::procedure::SearchRule;
use crate::protocol::keys::{Id, Key, Kind, Shape, Variants, Words as _, keys};
use crate::protocol::ranking::question;
use crate::protocol::section::{Section, Variant, shapes};
use crate::protocol::{Criterion, Drawn, Exposure, Feedback, IntervalOrder, Order, Presentations};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId, QuestionId, Untrusted};

pub(super) static PARTS: Variants = Variants {
    tag: "kind",
    effect: "The kind of trial",
    common: keys! {
        /// The name of the part. The answers of pairs and of discrimination are in a column of
        /// this name.
        "id": Kind::Id(Id::Part), r#""which-is-more-real""#, required;
        /// Shown before the first trial of the part.
        "text": Kind::Text, r#""You will feel two switches in each trial.""#;
        /// The `[[questions]]` of a trial, by id; after the answer, where the kind of trial has
        /// one.
        "questions": Kind::Ids(Id::Question), r#"["realism"]"#, derived("in a rating part all questions that no other part names, else none");
        /// How long each interval is felt.
        "exposure": Kind::Table(EXPOSURE), "{ min_s = 2, max_s = 8 }", derived("that of `[trial]`");
    },
    shapes: &SHAPES,
};

pub(super) const EXPOSURE: &[Key] = keys! {
    /// The least time that a realization, or an interval of several, is felt.
    "min_s": Kind::not_negative("s"), "2", default("0");
    /// The device stops by itself after this time. The time left is shown.
    "max_s": Kind::positive("s"), "8";
    /// How often a trial can be felt again before it is answered.
    "replays": Kind::Whole(0, 100), "1", default("0");
};

const ANSWERS: &[Key] = keys! {
    /// What the participant reads and chooses, in any language. No two are alike.
    "label": Kind::Text, r#""one pulse""#, required;
    /// The realizations of which it is the right answer, by id. Each has one label.
    "models": Kind::ModelIds, r#"["lambda-0.9991"]"#;
    /// The levels of the part's family of which it is the right answer.
    "levels": Kind::NumberList, "[0.5]";
};

const CRITERION: &[Key] = keys! {
    /// Practice ends once so many of the last answers are correct.
    "correct": Kind::COUNT, "7", required;
    /// How many of the last answers are counted; not fewer than `correct`.
    "of": Kind::COUNT, "8", required;
    /// How often the practice trials come at most. If each is drawn on its own, there are as many trials in all.
    "rounds": Kind::Whole(1, 1000), "10", required;
    /// How the practice trials are drawn.
    "draw": Kind::Word(Drawn::WORDS), r#""independent""#, default(r#""rounds""#);
};

static SHAPES: [Shape; KINDS.len()] = shapes(&KINDS);

/// The words of `order`: a part has no file of orders.
const ORDER: Kind = Kind::Word(Order::WORDS);

/// Keys of the kinds with one realization a trial.
macro_rules! presentation_keys {
    ($($own:tt)*) => {
        keys! {
            $($own)*
            /// How often each is presented.
            "repetitions": Kind::Whole(1, 10_000), "3", required;
            /// How the order of the trials is made.
            "order": ORDER, r#""williams""#, default(r#""blocked""#);
            /// The largest number of consecutive trials with the same realization.
            "max_run": Kind::COUNT, "1";
            /// The least distance between two positions of the same realization.
            "min_distance": Kind::COUNT, "2";
        }
    };
}

/// Keys of a part that searches.
const SEARCH: &[Key] = keys! {
    /// What is asked, in any language.
    "prompt": Kind::Text, r#""Which one felt more real?""#, required;
    /// One of `[[spaces]]`. It needs the format `study-protocol/3`.
    "space": Kind::Id(Id::Part), r#""switch""#, required;
    /// Which pairs are presented, and how many.
    "rule": Kind::Variant(&super::spaces::RULE), "", required;
    /// From the end of the first interval to the start of the second. Both are loaded
    /// anew in this time.
    "gap_s": Kind::positive("s"), "1.5", default("1");
};

/// The kinds of trial. A new one is declared here and in [`crate::protocol::Task`].
pub(super) const KINDS: [Variant<RawTask>; 10] = [
    Variant::new(
        "rating",
        "One realization is felt and rated.",
        presentation_keys! {
            /// The realizations, by id.
            "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995"]"#, derived("all whose role is not `practice`");
            /// The realizations of the practice trials of the part, in this order.
            "practice": Kind::ModelIds, r#"["spring"]"#;
        },
        rating,
    ),
    Variant::new(
        "magnitude",
        "Magnitude estimation: one level of a family, or one realization, is felt, and a number above 0 is typed for it.",
        presentation_keys! {
            /// What is asked, in any language.
            "prompt": Kind::Text, r#""How strong did it feel?""#, required;
            /// One of `[[families]]`, whose levels are felt.
            "family": Kind::Id(Id::Part), r#""detent""#;
            /// Levels of the ladder.
            "levels": Kind::NumberList, "[0.5, 1.0, 2.0]", derived("all levels of the ladder");
            /// The level of the ladder that is felt first in each trial, and whose number is `modulus`. Without a standard
            /// participants choose their own scale.
            "standard": Kind::ANY_NUMBER, "1.0";
            /// The same of realizations, in a part without a family.
            "reference": Kind::Id(Id::Model), r#""passive""#;
            /// The number of the standard or reference. The prompt says it. It needs the format `study-protocol/3`.
            "modulus": Kind::positive(""), "100";
            /// From the end of the standard to the start of the level. Both are loaded anew in this time, whether they
            /// differ or not.
            "gap_s": Kind::positive("s"), "1.5", default("1");
            /// The realizations, by id, in a part without a family.
            "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995"]"#, derived("all whose role is not `practice`");
            /// The realizations of the practice trials of the part, in this order.
            "practice": Kind::ModelIds, r#"["spring"]"#;
        },
        magnitude,
    ),
    Variant::new(
        "mushra",
        "One realization is rated from 0 to 100 beside a reference, which is among the realizations, too, unlabeled (after ITU-R BS.1534-3, one at a time).",
        presentation_keys! {
            /// What is asked, in any language.
            "prompt": Kind::Text, r#""How close was it to the reference?""#, required;
            /// Texts at some of the numbers.
            "labels": Kind::NumberLabels, r#"{ 0 = "bad", 100 = "excellent" }"#;
            /// The realizations, by id. One has the role `hidden-reference`; anchors have the roles
            /// `low-anchor` and `mid-anchor`.
            "models": Kind::ModelIds, r#"["target", "spring", "lambda-0.9995"]"#, derived("all whose role is not `practice`");
            /// The realization that is felt as the reference before each one. Without it the
            /// reference is a real one, which `trial.reference` asks to feel.
            "reference": Kind::Id(Id::Model), r#""target""#;
            /// The realizations of the practice trials of the part, in this order.
            "practice": Kind::ModelIds, r#"["spring"]"#;
            /// From the end of the reference to the start of the realization. Both are loaded anew
            /// in this time, whether they differ or not.
            "gap_s": Kind::positive("s"), "1.5", default("1");
        },
        mushra,
    ),
    Variant::new(
        "pairs",
        "Two realizations are felt one after the other, and one is chosen: `first` or `second`.",
        keys! {
            /// What is asked, in any language.
            "prompt": Kind::Text, r#""Which one felt more real?""#, required;
            /// The realizations, by id.
            "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995", "passive"]"#, derived("all whose role is not `practice`, without duplicates");
            /// Which are compared: all with all, neighbors in the order of `models`, all with one,
            /// or a list.
            "pairs": Kind::Pairs, r#""versus:passive""#, default(r#""all""#);
            /// How often each pair is compared.
            "repetitions": Kind::Whole(1, 10_000), "2", required;
            /// How the order of the pairs is made.
            "order": ORDER, r#""shuffled""#, default(r#""blocked""#);
            /// Whether "no difference" is an answer, `tie`.
            "tie": Kind::Flag, "true", default("false");
            /// Which of a pair comes first.
            "interval_order": Kind::Word(IntervalOrder::WORDS), r#""random""#, default(r#""balanced""#);
            /// From the end of the first interval to the start of the second. Both are loaded
            /// anew in this time, whether they differ or not.
            "gap_s": Kind::positive("s"), "1.5", default("1");
        },
        pairs,
    ),
    Variant::new(
        "discrimination",
        "Levels are told from a standard, on one track or several interleaved ones.",
        keys! {
            /// What is asked, in any language.
            "prompt": Kind::Text, r#""Which one had more damping?""#, required;
            /// The `[[tracks]]`, by id; all of the same method. Each pass through the part takes
            /// every unfinished track once, in random order.
            "tracks": Kind::Ids(Id::Part), r#"["damping-up"]"#, required;
            /// From the end of an interval to the start of the next. Every interval is loaded
            /// anew in this time, also an equal one.
            "gap_s": Kind::positive("s"), "1.5", default("1");
        },
        discrimination,
    ),
    Variant::new(
        "identification",
        "One realization is felt, and the participant says which of several labels it has. Needs the format `study-protocol/3`.",
        presentation_keys! {
            /// What is asked, in any language.
            "prompt": Kind::Text, r#""Which one was it?""#, required;
            /// The labels, in their order on the page; at least two. Their realizations are felt.
            "answers": Kind::Tables(ANSWERS), "", required;
            /// One of `[[families]]`, of which labels have `levels`.
            "family": Kind::Id(Id::Part), r#""detent""#;
            /// When the participant is told whether the answer was correct, and which label was.
            "feedback": Kind::Word(Feedback::WORDS), r#""always""#, default(r#""practice""#);
            /// The realizations of the practice trials of the part: in this order without a `criterion`, and in an order that
            /// is drawn with one. Each has a label. The levels of a family are called `FAMILY.STEP`, from 1 for the lowest of
            /// its ladder.
            "practice": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995"]"#;
            /// When practice ends. Without it the practice trials come once, as listed. The label that was given first counts, and
            /// a declined answer does not.
            "criterion": Kind::Table(CRITERION), "{ correct = 7, of = 8, rounds = 10 }";
        },
        identification,
    ),
    Variant::new(
        "search",
        "Two points of a space are felt one after the other, and one is chosen: `first` or `second`. Which two come next follows from the answers.",
        SEARCH,
        search,
    ),
    Variant::new(
        "similarity",
        "Two realizations are felt one after the other, and how different they are is rated from 0 to 100. Needs the format `study-protocol/3`.",
        SIMILARITY,
        similarity,
    ),
    Variant::new(
        "ranking",
        "Several realizations are felt one after another, and each is given a rank. Needs the format `study-protocol/3`.",
        RANKING,
        ranking,
    ),
    Variant::new(
        "adjustment",
        "A level of a family is set, one step of its ladder at a time, until it feels equal to a standard or as it should. Needs the format `study-protocol/3`.",
        ADJUSTMENT,
        adjustment,
    ),
];

/// A part as it was read; its ids are not looked up yet.
#[derive(Debug)]
pub(super) struct RawPart {
    /// Such as `parts[0]`.
    pub(super) path: String,
    pub(super) id: Option<PartId>,
    pub(super) text: Option<String>,
    pub(super) questions: Option<Vec<QuestionId>>,
    /// `None` inside: that of `[trial]`.
    pub(super) exposure: Option<Option<Exposure>>,
    pub(super) task: Option<RawTask>,
}

impl RawPart {
    /// Whether a question has the id of one with which the trials of the part begin.
    pub(super) fn begins_with(&self, id: &QuestionId) -> bool {
        let Some(part) = &self.id else {
            return false;
        };
        let intervals = match &self.task {
            Some(RawTask::Ranking(own)) => own.felt.len(),
            _ => 1,
        };
        (1..=intervals).any(|interval| question(part, interval) == *id)
    }
}

#[derive(Debug)]
pub(super) enum RawTask {
    Rating {
        /// Its models are empty if none are named.
        presentations: Presentations,
    },
    Magnitude {
        prompt: String,
        /// With its levels, if they are named.
        family: Option<(PartId, Option<Vec<f64>>)>,
        standard: Option<RawStandard>,
        /// Its models are empty if none are named.
        presentations: Presentations,
        gap_s: f64,
    },
    Mushra {
        prompt: String,
        labels: BTreeMap<String, String>,
        reference: Option<ModelId>,
        /// Its models are empty if none are named.
        presentations: Presentations,
        gap_s: f64,
    },
    Identification {
        prompt: String,
        family: Option<PartId>,
        labels: Vec<RawLabel>,
        feedback: Feedback,
        criterion: Option<Criterion>,
        /// Without models: they are those of the labels.
        presentations: Presentations,
    },
    Pairs {
        prompt: String,
        models: Option<Vec<ModelId>>,
        pairs: RawPairs,
        repetitions: u32,
        order: Order,
        tie: bool,
        interval_order: IntervalOrder,
        gap_s: f64,
    },
    Discrimination {
        prompt: String,
        tracks: Vec<PartId>,
        gap_s: f64,
    },
    Search {
        prompt: String,
        space: PartId,
        rule: SearchRule,
        gap_s: f64,
    },
    Similarity(RawSimilarity),
    Ranking(RawRanking),
    Adjustment(RawAdjustment),
}

/// A label, and of what it is the right answer.
#[derive(Debug)]
pub(super) struct RawLabel {
    pub(super) text: String,
    pub(super) models: Vec<ModelId>,
    pub(super) levels: Option<Vec<f64>>,
}

pub(super) fn read(root: &mut Section<'_, '_>) -> Vec<RawPart> {
    (root.variants("parts", &KINDS).into_iter())
        .map(|(mut section, kind)| RawPart {
            path: section.path().to_owned(),
            id: section.part_id("id"),
            text: section.text("text"),
            questions: section.ids("questions"),
            exposure: match section.value("exposure") {
                None => Some(None),
                Some(_) => section.section("exposure").and_then(exposure).map(Some),
            },
            task: kind.and_then(|kind| (kind.read)(&mut section)),
        })
        .collect()
}

pub(super) fn exposure(mut section: Section<'_, '_>) -> Option<Exposure> {
    let (min_s, max_s) = (section.number("min_s"), section.number("max_s"));
    let replays = section.whole("replays");
    if let (Some(min), Some(max)) = (min_s, max_s)
        && min > max
    {
        let what = format!("`{}.min_s` is above `max_s`: {min} > {max}", section.path());
        section.fault_at("min_s", Fault::error(what));
    }
    Some(Exposure {
        min_s: min_s?,
        max_s,
        replays: replays?,
    })
}

fn rating(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (models, practice) = (section.model_ids("models"), section.model_ids("practice"));
    let presentations = presentations(section, models, practice)?;
    Some(RawTask::Rating { presentations })
}

fn presentations(
    section: &mut Section<'_, '_>,
    models: Vec<ModelId>,
    practice: Vec<ModelId>,
) -> Option<Presentations> {
    let (repetitions, order) = (section.whole("repetitions"), section.word("order"));
    let (max_run, min_distance) = (section.whole("max_run"), section.whole("min_distance"));
    Some(Presentations {
        models,
        order: order?,
        repetitions: repetitions?,
        max_run,
        min_distance,
        practice,
    })
}

fn magnitude(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (prompt, family) = (section.text("prompt"), section.part_id("family"));
    let levels = section.numbers("levels");
    let (models, practice) = (section.model_ids("models"), section.model_ids("practice"));
    let path = section.path();
    if family.is_some() && !models.is_empty() {
        let what = format!("`{path}` has `models` and a family");
        section.fault_at("models", Fault::error(what).hint("leave one of them out"));
    }
    if family.is_none() && levels.is_some() {
        let what = format!("`{path}` has `levels` without a family");
        section.fault_at("levels", Fault::error(what).hint("add family = \"…\""));
    }
    let standard = standard(section, family.is_some());
    let presentations = presentations(section, models, practice);
    let gap_s = section.number("gap_s");
    Some(RawTask::Magnitude {
        prompt: prompt?,
        family: family.map(|family| (family, levels)),
        standard: standard?,
        presentations: presentations?,
        gap_s: gap_s?,
    })
}

fn mushra(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (prompt, reference) = (section.text("prompt"), section.model_id("reference"));
    let labels = section.number_labels(0.0, 100.0);
    let (models, practice) = (section.model_ids("models"), section.model_ids("practice"));
    let presentations = presentations(section, models, practice);
    let gap_s = section.number("gap_s");
    Some(RawTask::Mushra {
        prompt: prompt?,
        labels: labels?,
        reference,
        presentations: presentations?,
        gap_s: gap_s?,
    })
}

fn identification(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (prompt, feedback) = (section.text("prompt"), section.word("feedback"));
    let (family, labels) = (section.part_id("family"), labels(section));
    let practice = section.model_ids("practice");
    let criterion = match section.value("criterion") {
        None => Some(None),
        Some(_) => section.section("criterion").and_then(criterion).map(Some),
    };
    let path = section.path();
    if let (Some(Some(_)), true) = (&criterion, practice.is_empty()) {
        let what = format!("`{path}` has a criterion without practice trials");
        let hint = "add practice = [\"a\", \"b\"], or leave the criterion out";
        section.fault_at("criterion", Fault::error(what).hint(hint));
    }
    let has_levels = labels.iter().flatten().any(|l| l.levels.is_some());
    if has_levels && family.is_none() {
        let what = format!("`{path}` has labels of `levels` without a family");
        section.fault_at("answers", Fault::error(what).hint("add family = \"…\""));
    }
    if family.is_some() && labels.is_some() && !has_levels {
        let what = format!("no label of `{path}` has `levels` of its family");
        section.fault_at("family", Fault::error(what).hint("leave the family out"));
    }
    let presentations = presentations(section, Vec::new(), practice);
    Some(RawTask::Identification {
        prompt: prompt?,
        family,
        labels: labels?,
        feedback: feedback?,
        criterion: criterion?,
        presentations: presentations?,
    })
}

/// Reads `answers`; `None` if one is faulty or they are too few.
fn labels(section: &mut Section<'_, '_>) -> Option<Vec<RawLabel>> {
    const SUCH_AS: &str = r#"such as answers = [{ label = "soft", models = ["a"] }, { label = "hard", models = ["b"] }]"#;
    if section.value("answers").is_none() {
        section.report_missing("answers", SUCH_AS.to_owned());
        return None;
    }
    let mut labels: Vec<RawLabel> = Vec::new();
    let entries = section.sections("answers");
    let count = entries.len();
    for mut entry in entries {
        let (text, levels) = (entry.text("label"), entry.numbers("levels"));
        let models = entry.model_ids("models");
        let Some(text) = text else { continue };
        if labels.iter().any(|l| l.text.trim() == text.trim()) {
            let what = format!("the label `{}` is there twice", Untrusted(&text));
            let hint = "give each label once, with all of its realizations in one list";
            entry.fault_at("label", Fault::error(what).hint(hint));
        }
        if models.is_empty() && levels.is_none() {
            let what = format!("no realization has the label `{}`", Untrusted(&text));
            entry.fault_at("label", Fault::error(what).hint("such as models = [\"a\"]"));
        }
        labels.push(RawLabel {
            text,
            models,
            levels,
        });
    }
    if count < 2 {
        let what = format!("`{}.answers` has fewer than two labels", section.path());
        section.fault_at("answers", Fault::error(what).hint(SUCH_AS));
        return None;
    }
    (labels.len() == count).then_some(labels)
}

fn criterion(mut section: Section<'_, '_>) -> Option<Criterion> {
    let (correct, of) = (section.whole("correct"), section.whole("of"));
    let (rounds, draw) = (section.whole("rounds"), section.word("draw"));
    let criterion = Criterion {
        correct: correct?,
        of: of?,
        rounds: rounds?,
        draw: draw?,
    };
    let Criterion { correct, of, .. } = criterion;
    if correct > of {
        let what = format!("`{}` is never reached: {correct} of {of}", section.path());
        let hint = "lower correct, or raise of: correct of the last of answers";
        section.fault_at("correct", Fault::error(what).hint(hint));
    }
    Some(criterion)
}

fn pairs(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let prompt = section.text("prompt");
    let models = section.ids("models");
    let pairs = which(section);
    let repetitions = section.whole("repetitions");
    let order = section.word("order");
    let (tie, interval_order) = (section.flag("tie"), section.word("interval_order"));
    let gap_s = section.number("gap_s");
    Some(RawTask::Pairs {
        prompt: prompt?,
        models,
        pairs: pairs?,
        repetitions: repetitions?,
        order: order?,
        tie: tie?,
        interval_order: interval_order?,
        gap_s: gap_s?,
    })
}

fn discrimination(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (prompt, tracks) = (section.text("prompt"), section.ids("tracks"));
    let gap_s = section.number("gap_s");
    Some(RawTask::Discrimination {
        prompt: prompt?,
        tracks: tracks?,
        gap_s: gap_s?,
    })
}

fn search(section: &mut Section<'_, '_>) -> Option<RawTask> {
    let (prompt, space) = (section.text("prompt"), section.part_id("space"));
    let rule = section.variant("rule", &RULES);
    if rule.is_none() && section.value("rule").is_none() {
        let hint = "such as rule = { name = \"preference-gp\", trials = 40 }";
        section.report_missing("rule", hint.to_owned());
    }
    let rule = rule.and_then(|(mut section, rule)| (rule?.read)(&mut section));
    let gap_s = section.number("gap_s");
    Some(RawTask::Search {
        prompt: prompt?,
        space: space?,
        rule: rule?,
        gap_s: gap_s?,
    })
}

fn similarity(section: &mut Section<'_, '_>) -> Option<RawTask> {
    super::similarity::similarity(section).map(RawTask::Similarity)
}

fn ranking(section: &mut Section<'_, '_>) -> Option<RawTask> {
    super::ranking::ranking(section).map(RawTask::Ranking)
}

fn adjustment(section: &mut Section<'_, '_>) -> Option<RawTask> {
    super::adjustment::adjustment(section).map(RawTask::Adjustment)
}
