//! Tables of exclusions: the rules, the rows, and what they change.

use crate::apa::{self, bare_p, digits, plain, three, whole};
use crate::table::{Builder, Cell, Format, Table, file, none, report};
use study_analysis::analyze::{Analysis, PreregisteredRule, Value, group_id};

/// The exclusion rules and their effects.
pub(crate) fn rules(a: &Analysis) -> Table {
    let caption = match a.changed(PreregisteredRule::Exclusions) {
        true => "Exclusion rules, changed after the study began: see Deviations",
        false => "Preregistered exclusion rules",
    };
    Builder::new(caption, &a.exclusions, &none)
        .column(report("rule").file("rule"), &|e| {
            Cell::Code(e.rule.to_string())
        })
        .text(report("excludes").wrapped(), &|e| e.rule.words())
        .text(report("rows").file("rows"), &|e| e.rows.to_string())
        .text(report("participants").file("participants"), &|e| {
            e.participants.to_string()
        })
        .text(report("remark").file("problem").wrapped(), &|e| {
            e.problem.unwrap_or_default().to_owned()
        })
        .done()
}

/// The rows that are left out.
pub(crate) fn excluded(a: &Analysis) -> Table {
    let rows = a
        .rows
        .iter()
        .filter_map(|r| Some((r, r.excluded.as_ref()?)));
    Builder::new("Excluded rows", rows, &none)
        .text(report("participant").file("subject"), &|(r, _)| {
            a.subject(r).to_owned()
        })
        .text(report("realization").file("model"), &|(r, _)| {
            a.model(r).to_owned()
        })
        .text(report("repetition").file("repetition"), &|(r, _)| {
            r.repetition.to_string()
        })
        .number(report("rating").file("rating"), plain, &|(r, _)| r.rating)
        .text(report("reason").file("reason").wrapped(), &|(_, why)| {
            why.to_string()
        })
        .done()
}

/// The results that the report compares with and without the exclusions, besides the means.
const HEADLINE: [(&str, &str, Format); 8] = [
    ("participants", "design/n_subjects", whole),
    ("r of mean rating and VAF", "corr/pearson/r", apa::r),
    ("its p, exact", "corr/pearson/p_exact_two_sided", bare_p),
    (
        "its p, random permutations",
        "corr/pearson/p_monte_carlo_two_sided",
        bare_p,
    ),
    ("Spearman's ρ", "corr/spearman/rho", apa::r),
    ("F of the realizations", "rmanova/F", three),
    ("its p, Greenhouse–Geisser", "rmanova/p_gg", bare_p),
    ("p of Friedman's test", "friedman/p", bare_p),
];

/// The main results with and without the exclusions.
pub(crate) fn with_and_without(a: &Analysis) -> Table {
    let before = |id: &str| a.values.number(&format!("before_exclusion/{id}"));
    let headline = HEADLINE.map(|(what, id, format)| (what.to_owned(), id.to_owned(), format));
    let means = a.realizations.iter().map(|m| {
        let id = format!("{}/mean", group_id("desc", &[&m.id]));
        (format!("mean of {}", apa::name(&m.id)), id, three as Format)
    });
    let all: Vec<(String, String, Format)> = headline.into_iter().chain(means).collect();
    let defined = all.iter().filter(|row| before(&row.1).is_some());
    let caption = "Main results with and without the exclusions";
    Builder::new(caption, defined, &none)
        .text(report("statistic"), &|row| row.0.clone())
        .column(report("with the exclusions"), &|row| {
            Cell::Number(a.values.number(&row.1), row.2)
        })
        .column(report("without them"), &|row| {
            Cell::Number(before(&row.1), row.2)
        })
        .done()
}

/// `with_and_without.csv`: the same of every statistic that is computed without the exclusions.
pub(crate) fn all_with_and_without(a: &Analysis) -> Table {
    let rows = a.values.iter().filter_map(|(id, value)| match value {
        Value::Number(x) => Some((id.strip_prefix("before_exclusion/")?, *x)),
        Value::List(_) | Value::Undefined(_) => None,
    });
    Builder::new("", rows, &none)
        .text(file("identifier"), &|row| row.0.to_owned())
        .number(file("with"), digits, &|row| a.values.number(row.0))
        .number(file("without"), digits, &|row| Some(row.1))
        .done()
}
