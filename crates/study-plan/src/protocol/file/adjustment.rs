//! Parts of adjustment, as they are read.

use crate::protocol::AdjustmentWords;
use crate::protocol::keys::{Id, Key, Kind, keys};
use crate::protocol::section::Section;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId};

/// Keys of a part of adjustment.
pub(super) const ADJUSTMENT: &[Key] = keys! {
    /// What the participant is to do, in any language. It is shown while a level is felt.
    "prompt": Kind::Text, r#""Set the second switch until both feel equal.""#, required;
    /// What a step down of the ladder does, the text of its button.
    "lower": Kind::Text, r#""weaker""#, required;
    /// The same for a step up.
    "higher": Kind::Text, r#""stronger""#, required;
    /// The text of the button that confirms the level.
    "confirm": Kind::Text, r#""they feel equal""#, required;
    /// One of `[[families]]`, a level of which is set. A change goes to the next level of its ladder.
    "family": Kind::Id(Id::Part), r#""detent""#, required;
    /// The level of the ladder that is felt first in each trial, and again as often as the participant wants.
    "standard": Kind::ANY_NUMBER, "1.0";
    /// The same of a realization, by id. Without either, the level is set to what it should be, as the prompt says.
    "reference": Kind::Id(Id::Model), r#""passive""#;
    /// The levels at which settings start that ascend. Each comes equally often, in random order.
    "start_below": Kind::NumberList, "[0.25, 0.3]", derived("the lowest quarter of the ladder");
    /// The same for settings that descend.
    "start_above": Kind::NumberList, "[1.5, 1.6]", derived("the highest quarter of the ladder");
    /// How often a level is set from below, and as often from above. Each two trials have both, in random order.
    "repetitions": Kind::Whole(1, 1000), "5", required;
    /// Practice trials before, whose starts are drawn for each participant.
    "practice": Kind::Whole(0, 1000), "2", default("0");
    /// The just noticeable difference, in levels of the family, if it is known. A ladder with a larger step is refused.
    "jnd": Kind::positive(""), "0.1";
    /// From the end of a level to the start of the next. Each is loaded anew in this time.
    "gap_s": Kind::positive("s"), "0.5", default("1");
};

/// A part of adjustment; its ids are not looked up yet.
#[derive(Debug)]
pub(super) struct RawAdjustment {
    pub(super) prompt: String,
    pub(super) words: AdjustmentWords,
    pub(super) family: PartId,
    pub(super) standard: Option<f64>,
    pub(super) reference: Option<ModelId>,
    pub(super) below: Option<Vec<f64>>,
    pub(super) above: Option<Vec<f64>>,
    pub(super) repetitions: u32,
    pub(super) practice: u32,
    pub(super) jnd: Option<f64>,
    pub(super) gap_s: f64,
}

pub(super) fn adjustment(section: &mut Section<'_, '_>) -> Option<RawAdjustment> {
    let prompt = section.text("prompt");
    let (lower, higher, confirm) = (
        section.text("lower"),
        section.text("higher"),
        section.text("confirm"),
    );
    let family = section.part_id("family");
    let (standard, reference) = (section.number("standard"), section.model_id("reference"));
    if standard.is_some() && reference.is_some() {
        let what = format!("`{}` has a `standard` and a `reference`", section.path());
        let hint = "leave one of them out: what is felt beside the level is a level itself, or a realization";
        section.fault_at("reference", Fault::error(what).hint(hint));
    }
    let (below, above) = (
        section.numbers("start_below"),
        section.numbers("start_above"),
    );
    let (repetitions, practice) = (section.whole("repetitions"), section.whole("practice"));
    let (jnd, gap_s) = (section.number("jnd"), section.number("gap_s"));
    Some(RawAdjustment {
        prompt: prompt?,
        words: AdjustmentWords {
            lower: lower?,
            higher: higher?,
            confirm: confirm?,
        },
        family: family?,
        standard,
        reference,
        below,
        above,
        repetitions: repetitions?,
        practice: practice?,
        jnd,
        gap_s: gap_s?,
    })
}
