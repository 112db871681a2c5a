//! Parts of similarity, as they are read.

use super::pairs::{RawPairs, which};
use crate::protocol::Order;
use crate::protocol::keys::{Id, Key, Kind, Words as _, keys};
use crate::protocol::section::Section;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId};

/// Keys of a part of similarity.
pub(super) const SIMILARITY: &[Key] = keys! {
    /// What is asked, in any language.
    "prompt": Kind::Text, r#""How different were the two?""#, required;
    /// The text at 0, the left end of the scale.
    "same": Kind::Text, r#""no difference""#, required;
    /// The text at 100, the right end of the scale.
    "different": Kind::Text, r#""as different as can be""#, required;
    /// The realizations, by id, in a part without a family.
    "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995", "passive"]"#, derived("all whose role is not `practice`, without duplicates");
    /// Which are compared: all with all, or a list, which has to connect all realizations. Pairs that nobody rates have no
    /// weight in the map.
    "pairs": Kind::Pairs, r#"[["lambda-0.9991", "passive"], ["lambda-0.9995", "passive"]]"#, default(r#""all""#);
    /// One of `[[families]]`, whose levels are compared, all with all.
    "family": Kind::Id(Id::Part), r#""detent""#;
    /// Levels of the ladder.
    "levels": Kind::NumberList, "[0.5, 1.0, 2.0]", derived("all levels of the ladder");
    /// How often each pair is rated. With an even number everybody has both orders of each pair equally often; with an odd one
    /// two rows have them.
    "repetitions": Kind::Whole(1, 10_000), "2", required;
    /// How the order of the pairs is made.
    "order": Kind::Word(Order::WORDS), r#""shuffled""#, default(r#""blocked""#);
    /// Whether each realization is also compared with itself, as often as with each other one: ratings of such pairs say how the scale is used.
    "identical": Kind::Flag, "true", default("false");
    /// Practice trials before, with pairs of different realizations that are drawn for each participant, so that the largest
    /// differences are known before one is rated.
    "practice": Kind::Whole(0, 1000), "6", default("0");
    /// From the end of the first interval to the start of the second. Both are loaded
    /// anew in this time, whether they differ or not.
    "gap_s": Kind::positive("s"), "1.5", default("1");
};

/// A part of similarity; its ids are not looked up yet.
#[derive(Debug)]
pub(super) struct RawSimilarity {
    pub(super) prompt: String,
    /// The texts at both ends of the scale.
    pub(super) ends: [String; 2],
    pub(super) models: Option<Vec<ModelId>>,
    pub(super) pairs: RawPairs,
    /// With its levels, if they are named.
    pub(super) family: Option<(PartId, Option<Vec<f64>>)>,
    pub(super) repetitions: u32,
    pub(super) order: Order,
    pub(super) identical: bool,
    pub(super) practice: u32,
    pub(super) gap_s: f64,
}

pub(super) fn similarity(section: &mut Section<'_, '_>) -> Option<RawSimilarity> {
    let (prompt, same, different) = (
        section.text("prompt"),
        section.text("same"),
        section.text("different"),
    );
    let models = section.ids("models");
    let (family, levels) = (section.part_id("family"), section.numbers("levels"));
    let path = section.path();
    if family.is_some() && models.is_some() {
        let what = format!("`{path}` has `models` and a family");
        section.fault_at("models", Fault::error(what).hint("leave one of them out"));
    }
    let pairs = which(section)?;
    let path = section.path();
    match pairs {
        RawPairs::List(_) if family.is_some() => {
            let what = format!("`{path}` has a family and a list of pairs");
            let hint = "leave `pairs` out, and name some `levels` if all are too many";
            section.fault_at("pairs", Fault::error(what).hint(hint));
        }
        RawPairs::All | RawPairs::List(_) => {}
        RawPairs::Adjacent | RawPairs::Versus(_) => {
            let what = format!("`{path}.pairs` has too few pairs for a map");
            let hint = "take \"all\", or a list of pairs";
            section.fault_at("pairs", Fault::error(what).hint(hint));
        }
    }
    if family.is_none() && levels.is_some() {
        let what = format!("`{path}` has `levels` without a family");
        section.fault_at("levels", Fault::error(what).hint("add family = \"…\""));
    }
    let (repetitions, order) = (section.whole("repetitions"), section.word("order"));
    let (identical, practice) = (section.flag("identical"), section.whole("practice"));
    let gap_s = section.number("gap_s");
    Some(RawSimilarity {
        prompt: prompt?,
        ends: [same?, different?],
        models,
        pairs,
        family: family.map(|family| (family, levels)),
        repetitions: repetitions?,
        order: order?,
        identical: identical?,
        practice: practice?,
        gap_s: gap_s?,
    })
}
