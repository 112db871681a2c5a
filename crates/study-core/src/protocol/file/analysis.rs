//! `[analysis]`: decisions that were made before the data.

use super::section::{Section, Variant, shapes};
use crate::protocol::keys::{Id, Key, Kind, Shape, Variants, Words as _, keys};
use crate::protocol::{AnalysisRules, Exclusion, Unfinished};
use std::ops::Bound;

pub(super) const ANALYSIS: &[Key] = keys! {
    /// The id of the question that the analysis is about: a rating, a slider or a number
    /// of `[[questions]]`, a choice with `share_of`, or a part that has an answer of its own.
    "primary": Kind::Id(Id::Question), r#""realism""#, required;
    /// The recording whose VAF counts, by its name in the model files; the same for all
    /// realizations. Needed if a model file has several.
    "vaf": Kind::Text, r#""validation-1.5hz""#;
    /// The option whose share is analyzed, where the primary question is a choice: this answer
    /// is 1, and every other is 0.
    "share_of": Kind::Text, r#""yes""#;
    /// The least rating that counts as realistic. It has to be on the primary scale.
    "realistic_from": Kind::ANY_NUMBER, "5";
    /// The margin of the tests of equivalence, between realizations, against a hidden
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
};

static EXCLUDE: Variants = Variants {
    tag: "rule",
    effect: "The name of the rule",
    common: &[],
    shapes: &SHAPES,
};

static SHAPES: [Shape; RULES.len()] = shapes(&RULES);

/// The exclusion rules. A new one is declared here and in [`Exclusion`], and judged
/// in `analyze/exclude.rs`; CONTRIBUTING.md lists the other places.
const RULES: [Variant<Exclusion>; 6] = [
    Variant::new(
        "constant-rater",
        "Excludes participants with two or more primary ratings that are all equal.",
        &[],
        |_| Some(Exclusion::ConstantRater),
    ),
    Variant::new(
        "hidden-reference-below",
        "Excludes participants whose mean primary rating of the hidden references is too low.",
        keys! {
            /// The least mean rating.
            "rating": Kind::ANY_NUMBER, "5", required;
        },
        |section| {
            section
                .number("rating")
                .map(Exclusion::HiddenReferenceBelow)
        },
    ),
    Variant::new(
        "strokes-below",
        "Excludes trials with too few full strokes. Trials whose strokes were not counted stay.",
        keys! {
            /// The least number of strokes.
            "strokes": Kind::ANY_NUMBER, "2", required;
        },
        |section| section.number("strokes").map(Exclusion::StrokesBelow),
    ),
    Variant::new(
        "inconsistent",
        "Excludes participants who rate a realization and its hidden duplicate too differently.",
        keys! {
            /// The largest mean distance between the two, in points of the primary scale.
            "difference": Kind::ANY_NUMBER, "1.5", required;
        },
        |section| section.number("difference").map(Exclusion::Inconsistent),
    ),
    Variant::new(
        "wrong-force",
        "Excludes trials in which the force was not that of the table (`rendering` is `flag` or `fault`).",
        &[],
        |_| Some(Exclusion::WrongForce),
    ),
    Variant::new(
        "unverified-force",
        "Excludes trials in which the force was not shown to be that of the table (`rendering` is not `ok`).",
        &[],
        |_| Some(Exclusion::UnverifiedForce),
    ),
];

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
    let exclude = (section.variants("exclude", &RULES).into_iter())
        .filter_map(|(mut section, rule)| (rule?.read)(&mut section))
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
    })
}
