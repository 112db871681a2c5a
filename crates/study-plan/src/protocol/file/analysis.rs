//! `[analysis]`: decisions that were made before the data.

use crate::protocol::keys::{Id, Key, Kind, Variants, Words as _, keys};
use crate::protocol::section::Section;
use crate::protocol::{AnalysisRules, Unfinished, rules};
use std::ops::Bound;

pub(super) const ANALYSIS: &[Key] = keys! {
    /// The id of the question that the analysis is about: a rating, a slider or a number
    /// of `[[questions]]`, a choice with `share_of`, or a part that has an answer of its own; in a study
    /// that only asks questionnaires one of them.
    "primary": Kind::Id(Id::Question), r#""realism""#, required;
    /// The recording whose VAF counts, by its name in the model files; the same for all
    /// realizations. Needed if a model file has several.
    "vaf": Kind::Text, r#""validation-1.5hz""#;
    /// The option whose share is analyzed, where the primary question is a choice: this answer
    /// is 1, and every other is 0.
    "share_of": Kind::Text, r#""yes""#;
    /// The least rating that counts as realistic. It has to be on the primary scale.
    "realistic_from": Kind::ANY_NUMBER, "5";
    /// The margin of the tests of equivalence, between realizations or levels of a factor, against a hidden
    /// reference and of the effect of VAF: smaller differences count as none.
    "equivalence_margin": Kind::positive("points of the primary scale"), "0.5";
    /// The margin of the test that the correlation with VAF is none: smaller correlations,
    /// of either sign, count as none.
    "equivalence_r": Kind::Number((Bound::Excluded(0.0), Bound::Excluded(1.0)), ""), "0.5";
    /// Whether the ratings of unfinished sessions and of drop-outs are analyzed.
    "unfinished": Kind::Word(Unfinished::WORDS), r#""exclude""#, default(r#""include""#);
    /// Exclusion rules stated before the data. Every rule judges the rows that count
    /// without any rule, so that the order of the rules does not matter. The report shows
    /// the results with and without them.
    "exclude": Kind::Variants(&EXCLUDE), "";
    /// The level of significance of every test, two-sided. Without it the level is .05.
    "alpha": Kind::Number((Bound::Excluded(0.0), Bound::Excluded(1.0)), ""), "0.01";
    /// What the primary question measures, as a noun: the report uses it in its sentences.
    "construct": Kind::Text, r#""pleasantness""#;
    /// Which effects of `[[factors]]` are tested, as a formula: `a * b` stands for both main
    /// effects and their interaction, `a:b` for the interaction alone, and `+` adds effects.
    /// `group` is the factor between participants. Without it every effect is tested.
    "model": Kind::Text, r#""realism ~ friction * detent""#;
};

static EXCLUDE: Variants = Variants {
    tag: "rule",
    effect: "The name of the rule",
    common: &[],
    shapes: rules::SHAPES,
};

pub(super) fn read(mut section: Section<'_, '_>) -> Option<AnalysisRules> {
    let primary = section.question_id("primary");
    let vaf = section.text("vaf");
    let share_of = section.text("share_of");
    let realistic_from = section.number("realistic_from");
    let equivalence_margin = section.number("equivalence_margin");
    let equivalence_r = section.number("equivalence_r");
    let unfinished = section.word("unfinished");
    let alpha = section.number("alpha");
    let construct = section.text("construct");
    let model = section.text("model");
    let exclude = (section.variants("exclude", rules::RULES).into_iter())
        .filter_map(|(mut section, rule)| (rule?.read)(&mut |name| section.number(name)))
        .collect();
    Some(AnalysisRules {
        primary: primary?,
        vaf,
        share_of,
        realistic_from,
        equivalence_margin,
        equivalence_r,
        unfinished: unfinished?,
        exclude,
        alpha,
        construct,
        model,
    })
}
