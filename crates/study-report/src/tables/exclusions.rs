//! Tables of exclusions: the rules, the rows, and what they change.

use crate::apa::{self, bare_p, digits, plain, three, whole};
use crate::table::{Builder, Cell, Format, Table, file, report};
use study_analysis::analyze::results::{BeforeExclusion, Correlation, Differences, Number};
use study_analysis::analyze::{Analysis, PreregisteredRule, Value};

/// The exclusion rules and their effects.
pub(crate) fn rules(a: &Analysis) -> Table {
    let caption = match a.changed(PreregisteredRule::Exclusions) {
        true => "Exclusion rules, changed after the study began: see Deviations",
        false => "Exclusion rules, set in advance",
    };
    Builder::new(caption, &a.exclusions)
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
    Builder::new("Excluded rows", rows)
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

/// The main results with and without the exclusions.
pub(crate) fn with_and_without(a: &Analysis) -> Table {
    let rows = a.results.before_exclusion.as_ref();
    let rows = rows.map_or_else(Vec::new, |before| compared(a, before));
    let defined = rows.iter().filter(|row| row.2.is_some());
    let caption = "Main results with and without the exclusions";
    Builder::new(caption, defined)
        .text(report("statistic"), &|row| row.0.clone())
        .column(report("with the exclusions"), &|row| {
            Cell::Number(row.1, row.3)
        })
        .column(report("without them"), &|row| Cell::Number(row.2, row.3))
        .done()
}

/// What is compared, with and without the exclusions, and its format.
fn compared(
    a: &Analysis,
    before: &BeforeExclusion,
) -> Vec<(String, Option<f64>, Option<f64>, Format)> {
    let (evidence, descriptives) = (&a.results.evidence, &a.results.descriptives);
    let row = |what: &str, with: &dyn Number, without: &dyn Number, format: Format| {
        (what.to_owned(), with.number(), without.number(), format)
    };
    let (corr, was) = (&evidence.corr, &before.corr);
    let permuted = |c: &Correlation| c.pearson.permuted.clone();
    let exact = |c| permuted(c).map(|p| p.p_exact_two_sided);
    let random = |c| permuted(c).map(|p| p.p_monte_carlo_two_sided);
    let rho = |c: &Correlation| c.spearman.as_ref().map(|s| s.rho.clone());
    let Differences {
        rmanova, friedman, ..
    } = &evidence.differences;
    let (n, n_was) = (&descriptives.design.n_subjects, &before.design.n_subjects);
    let (r, r_was) = (&corr.pearson.r, &was.pearson.r);
    let mut rows = vec![
        row("participants", n, n_was, whole),
        row("r of mean rating and VAF", r, r_was, apa::r),
        row("its p, exact", &exact(corr), &exact(was), bare_p),
        row(
            "its p, random permutations",
            &random(corr),
            &random(was),
            bare_p,
        ),
        row("Spearman's ρ", &rho(corr), &rho(was), apa::r),
        row(
            "F of the realizations",
            &rmanova.f,
            &before.rmanova.f,
            three,
        ),
        row(
            "its p, Greenhouse–Geisser",
            &rmanova.p_gg,
            &before.rmanova.p_gg,
            bare_p,
        ),
        row(
            "p of Friedman's test",
            &friedman.p,
            &before.friedman.p,
            bare_p,
        ),
    ];
    rows.extend(a.realizations.iter().map(|m| {
        let mean = a.described(&m.id).map(|d| &d.mean);
        let mean_was = before.desc.get(m.id.as_str()).map(|d| &d.mean);
        row(
            &format!("mean of {}", apa::name(&m.id)),
            &mean,
            &mean_was,
            three,
        )
    }));
    rows
}

/// `with_and_without.csv`: the same of every statistic that is computed without the exclusions.
pub(crate) fn all_with_and_without(a: &Analysis) -> Table {
    let rows = a.values.iter().filter_map(|(id, value)| match value {
        Value::Number(x) => Some((id.strip_prefix("before_exclusion/")?, *x)),
        Value::List(_) | Value::Undefined(_) => None,
    });
    Builder::new("", rows)
        .text(file("identifier"), &|row| row.0.to_owned())
        .number(file("with"), digits, &|row| a.values.number(row.0))
        .number(file("without"), digits, &|row| Some(row.1))
        .done()
}
