//! `[analysis]`: what was decided before the data.

use super::reader::{Reader, finite, question_id};
use crate::protocol::{AnalysisRules, ExclusionRule, Unfinished};
use std::collections::BTreeMap;
use study_base::diagnostic::table::Table;
use study_base::diagnostic::{Fault, did_you_mean};
use study_base::text::Untrusted;

/// The exclusion rules and the parameter that each has to have, if any:
///
/// * `constant-rater`: the primary rating never changes.
/// * `hidden-reference-below`: mean primary rating of the hidden references under
///   `rating`.
/// * `strokes-below`: a trial with fewer full strokes than `strokes`.
/// * `inconsistent`: mean distance between a realization and its hidden duplicate
///   above `difference`, in points of the primary scale.
pub const EXCLUSIONS: [(&str, &[&str]); 4] = [
    ("constant-rater", &[]),
    ("hidden-reference-below", &["rating"]),
    ("strokes-below", &["strokes"]),
    ("inconsistent", &["difference"]),
];

/// The section; `None` if a part of it is faulty.
pub(super) fn read<'d, 't>(
    reader: &Reader<'d, 't>,
    root: &mut Table<'d, 't>,
) -> Option<AnalysisRules> {
    let mut table = reader.section(root, "analysis", "it needs the id of the primary question")?;
    let primary = reader
        .need(
            &mut table,
            "primary",
            "the id of the question that the analysis is about",
        )
        .and_then(|v| question_id(&v));
    let vaf = reader.text(&mut table, "vaf");
    let realistic_from = reader.number(&mut table, "realistic_from");
    let equivalence_margin = table.value("equivalence_margin").and_then(|v| {
        let margin = finite(&v)?;
        if margin <= 0.0 {
            v.fault(
                Fault::error("an equivalence margin has to be above 0")
                    .hint("differences from a hidden reference below it count as none"),
            );
            return None;
        }
        Some(margin)
    });
    let unfinished = table
        .word(
            "unfinished",
            &[
                ("include", Unfinished::Include),
                ("exclude", Unfinished::Exclude),
            ],
        )
        .unwrap_or(Unfinished::Include);
    let exclude = table
        .tables("exclude")
        .into_iter()
        .filter_map(|table| exclusion(reader, table))
        .collect();
    table.finish();
    Some(AnalysisRules {
        primary: primary?,
        vaf,
        realistic_from,
        equivalence_margin,
        unfinished,
        exclude,
    })
}

fn exclusion<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> Option<ExclusionRule> {
    let names = EXCLUSIONS.map(|(name, _)| name);
    let value = reader.need(
        &mut table,
        "rule",
        "one of `constant-rater`, `hidden-reference-below`, `strokes-below`, `inconsistent`",
    )?;
    let rule = value.text()?;
    let Some((_, parameters)) = EXCLUSIONS.iter().find(|(name, _)| *name == rule) else {
        let fault = Fault::error(format!("`{}` is no exclusion rule", Untrusted(&rule)));
        value.fault(match did_you_mean(&rule, names) {
            Some(near) => fault.label(format!("did you mean `{near}`?")),
            None => fault.hint(format!("there are {}", names.join(", "))),
        });
        return None;
    };
    let mut given = BTreeMap::new();
    for parameter in *parameters {
        let value = reader.need(&mut table, parameter, "a number");
        if let Some(number) = value.and_then(|v| finite(&v)) {
            given.insert((*parameter).to_owned(), number);
        }
    }
    table.finish();
    Some(ExclusionRule {
        rule,
        parameters: given,
    })
}
