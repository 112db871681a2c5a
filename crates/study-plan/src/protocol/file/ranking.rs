//! Parts of ranking, as they are read.

use super::questions::PartialQuestion;
use crate::protocol::keys::{Id, Key, Kind, Words as _, keys};
use crate::protocol::ranking::question;
use crate::protocol::section::Section;
use crate::protocol::{Order, QuestionKind, kinds};
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId};

/// Where the number of an interval stands in a prompt.
const NUMBER: &str = "{n}";

/// Keys of a part of ranking.
pub(super) const RANKING: &[Key] = keys! {
    /// What is asked of each realization in turn, in any language. `{n}` stands for its number in the trial.
    "prompt": Kind::Text, r#""Which rank has number {n}?""#, required;
    /// The text at rank 1.
    "first": Kind::Text, r#""most realistic""#, required;
    /// The text at the last rank.
    "last": Kind::Text, r#""least realistic""#, required;
    /// The realizations, by id, in a part without a family: 2 to 9. All of them are felt in each trial, one after another, and then each
    /// has its rank. The rank of the first is in the column with the name of the part, those of the others in `NAME-2`, `NAME-3`, ….
    "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995", "passive"]"#;
    /// One of `[[families]]`, of which `levels` are ranked.
    "family": Kind::Id(Id::Part), r#""detent""#;
    /// Levels of the ladder: 2 to 9.
    "levels": Kind::NumberList, "[0.5, 1.0, 2.0]";
    /// Whether several can have the same rank. Otherwise a rank that was given on a page before is refused.
    "ties": Kind::Flag, "true", default("false");
    /// How often all of them are ranked.
    "repetitions": Kind::Whole(1, 10_000), "2", required;
    /// How their order in a trial is made: each comes once in it, so that it is not `shuffled`.
    "order": Kind::Word(Order::WORDS), r#""williams""#, default(r#""blocked""#);
    /// Practice trials before, in orders that are drawn for each participant.
    "practice": Kind::Whole(0, 1000), "1", default("0");
    /// From the end of an interval to the start of the next. Each is loaded anew in this time.
    "gap_s": Kind::positive("s"), "1.5", default("1");
};

/// A part of ranking; its ids are not looked up yet.
#[derive(Debug)]
pub(super) struct RawRanking {
    pub(super) prompt: String,
    /// The texts at the first and the last rank.
    pub(super) ends: [String; 2],
    pub(super) felt: RawSet,
    pub(super) order: Order,
    pub(super) repetitions: u32,
    pub(super) ties: bool,
    pub(super) practice: u32,
    pub(super) gap_s: f64,
}

/// What is ranked.
#[derive(Debug)]
pub(super) enum RawSet {
    Models(Vec<ModelId>),
    Levels(PartId, Vec<f64>),
}

impl RawSet {
    /// How many there are.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Models(models) => models.len(),
            Self::Levels(_, levels) => levels.len(),
        }
    }

    /// Whether they are levels of a family.
    pub(super) fn is_of(&self, family: &PartId) -> bool {
        matches!(self, Self::Levels(own, _) if own == family)
    }
}

pub(super) fn ranking(section: &mut Section<'_, '_>) -> Option<RawRanking> {
    let prompt = section.text("prompt");
    let (first, last) = (section.text("first"), section.text("last"));
    let felt = set(section);
    let (ties, repetitions) = (section.flag("ties"), section.whole("repetitions"));
    let order: Option<Order> = section.word("order");
    let practice = section.whole("practice");
    let gap_s = section.number("gap_s");
    if order == Some(Order::Shuffled) {
        let what = "a trial of a ranking has each realization once";
        let hint = "take \"blocked\", \"williams\", \"latin-square\" or \"fixed\"";
        section.fault_at("order", Fault::error(what).hint(hint));
    }
    if prompt.as_ref().is_some_and(|text| !text.contains(NUMBER)) {
        let what = format!(
            "`{}.prompt` does not say which realization it asks about",
            section.path()
        );
        let hint = "write {n} where its number in the trial stands";
        section.fault_at("prompt", Fault::error(what).hint(hint));
    }
    Some(RawRanking {
        prompt: prompt?,
        ends: [first?, last?],
        felt: felt?,
        order: order?,
        repetitions: repetitions?,
        ties: ties?,
        practice: practice?,
        gap_s: gap_s?,
    })
}

/// Reads `models`, or a family with its levels.
fn set(section: &mut Section<'_, '_>) -> Option<RawSet> {
    let models = section.ids("models");
    let (family, levels) = (section.part_id("family"), section.numbers("levels"));
    let path = section.path();
    let (key, what, hint) = match (models, family, levels) {
        (Some(models), None, None) => return Some(RawSet::Models(models)),
        (None, Some(family), Some(levels)) => return Some(RawSet::Levels(family, levels)),
        (None, None, None) => (
            "id",
            format!("`{path}` has neither `models` nor a family"),
            "name the realizations: models = [\"…\", \"…\"]",
        ),
        (None, Some(_), None) => (
            "family",
            format!("`{path}` has a family without `levels`"),
            "name 2 to 9 levels of its ladder: levels = […]",
        ),
        (_, None, Some(_)) => (
            "levels",
            format!("`{path}` has `levels` without a family"),
            "add family = \"…\"",
        ),
        (Some(_), Some(_), _) => (
            "models",
            format!("`{path}` has `models` and a family"),
            "leave one of them out",
        ),
    };
    section.fault_at(key, Fault::error(what).hint(hint));
    None
}

impl RawRanking {
    /// The questions of a trial: the rank of each interval.
    pub(super) fn questions(&self, path: &str, part: &PartId) -> Vec<PartialQuestion> {
        let intervals = self.felt.len();
        let to = i64::try_from(intervals).unwrap_or(i64::MAX);
        let [first, last] = self.ends.clone();
        let scale = kinds::Rating {
            from: 1,
            to,
            labels: [(1, first), (to, last)].into(),
        };
        let of_interval = |interval: usize| {
            let prompt = self.prompt.replace(NUMBER, &interval.to_string());
            let kind = QuestionKind::Rating(scale.clone());
            PartialQuestion::made(path, question(part, interval).as_str(), &prompt, kind)
        };
        (1..=intervals).map(of_interval).collect()
    }
}
