//! `[[questionnaires]]` of kind `own`.

use crate::protocol::keys::{Id, Key, Kind, Words as _, keys};
use crate::protocol::outcomes::BetterEnd;
use crate::protocol::scoring::{Scoring, Subscale, Total};
use crate::protocol::section::Section;
use study_base::diagnostic::Fault;

/// Most items of a questionnaire.
const MAX_ITEMS: i64 = 100;
/// Most points of the scale of its answers.
const MAX_POINTS: i64 = 101;

pub(super) const OWN: &[Key] = keys! {
    /// The items, in their order.
    "items": Kind::Texts(1), r#"["I felt it on my finger.", "It felt artificial.", "I forgot the device."]"#, required;
    /// The lowest answer.
    "from": Kind::ANY_WHOLE, "1", required;
    /// The highest answer, above `from`. There are at most 101.
    "to": Kind::ANY_WHOLE, "7", required;
    /// Items that are turned round, counted from 1: in place of an answer, `from + to` less it.
    "reverse": Kind::WholeList(1, MAX_ITEMS), "[2]";
    /// Added to each answer, such as −4 for pairs of words that are scored around 0.
    "plus": Kind::ANY_NUMBER, "-4.0", default("0");
    /// What the answers are taken together by, also those of `scales`.
    "total": Kind::Word(Total::WORDS), r#""sum""#, default(r#""mean""#);
    /// The items of the score, each as often as it counts.
    "counted": Kind::WholeList(1, MAX_ITEMS), "[1, 2, 2]", derived("every item once");
    /// By which the mean or the sum is multiplied.
    "times": Kind::positive(""), "3.74", default("1");
    /// Which end of the score is better, of a questionnaire after each condition.
    "better": Kind::Word(BetterEnd::WORDS), r#""higher""#;
    /// Scores of some of the items, which are described.
    "scales": Kind::Tables(SCALE), r#"[{ id = "touch", items = [1, 3] }]"#;
};

const SCALE: &[Key] = keys! {
    /// The name of the scale.
    "id": Kind::Id(Id::Part), r#""touch""#, required;
    /// Its items, each as often as it counts.
    "items": Kind::WholeList(1, MAX_ITEMS), "[1, 3]", required;
    /// By which the mean or the sum is multiplied.
    "times": Kind::positive(""), "9.54", default("1");
};

/// What a study says of a questionnaire of its own.
#[derive(Debug)]
pub(super) struct RawOwn {
    /// The texts of the items.
    pub(super) items: Vec<String>,
    pub(super) scoring: Scoring,
    pub(super) better: Option<BetterEnd>,
}

/// Reads it; `None` if it is faulty, which has been reported.
pub(super) fn read(section: &mut Section<'_, '_>) -> Option<RawOwn> {
    let items: Vec<String> = section.texts("items").into_iter().map(|(_, t)| t).collect();
    let (from, to) = (section.whole::<i64>("from"), section.whole::<i64>("to"));
    let reverse = section.wholes("reverse");
    let plus = section.number("plus");
    let total: Option<Total> = section.word("total");
    let counted = section.wholes("counted");
    let times = section.number("times");
    let better: Option<BetterEnd> = section.word("better");
    let scales = scales(section);
    let n = u32::try_from(items.len()).ok().filter(|n| *n > 0)?;
    if i64::from(n) > MAX_ITEMS {
        let what = format!("a questionnaire has at most {MAX_ITEMS} items, not {n}");
        section.fault_at("items", Fault::error(what));
        return None;
    }
    let (from, to) = (from?, to?);
    if to
        .checked_sub(from)
        .is_none_or(|points| !(1..MAX_POINTS).contains(&points))
    {
        let what = format!("{from} to {to} is no scale of at most {MAX_POINTS} points");
        section.fault_at("to", Fault::error(what).hint("`to` is above `from`"));
        return None;
    }
    let known = |section: &Section<'_, '_>, key: &str, items: &[u32]| {
        if let Some(item) = items.iter().find(|item| **item > n) {
            let what = format!("there is no item {item}: the questionnaire has {n}");
            section.fault_at(key, Fault::error(what));
        }
    };
    known(section, "reverse", &reverse);
    known(section, "counted", &counted);
    let scales = scales?;
    for scale in &scales {
        known(section, "scales", &scale.items);
    }
    let counted = match counted.is_empty() {
        true => (1..=n).collect(),
        false => counted,
    };
    Some(RawOwn {
        items,
        scoring: Scoring {
            items: n,
            from,
            to,
            reverse,
            plus: plus?,
            total: total?,
            counted,
            times: times?,
            scales,
        },
        better,
    })
}

fn scales(section: &mut Section<'_, '_>) -> Option<Vec<Subscale>> {
    let mut scales: Vec<Subscale> = Vec::new();
    let mut all = true;
    for mut entry in section.sections("scales") {
        let (id, items) = (entry.part_id("id"), entry.wholes("items"));
        let times = entry.number("times");
        let (Some(id), Some(times)) = (id, times) else {
            all = false;
            continue;
        };
        if let Some(other) = scales.iter().find(|other| other.id.collides_with(&id)) {
            let fault = super::agree::collision(id.as_str(), other.id.as_str());
            entry.fault_at("id", fault);
        }
        if items.is_empty() {
            entry.fault_at(
                "items",
                Fault::error(format!("the scale `{id}` has no item")),
            );
        }
        scales.push(Subscale { id, items, times });
    }
    all.then_some(scales)
}
