//! Tables of the force of the playbacks.

use crate::apa::{self, plain, three};
use crate::table::{Builder, Table, report};
use study_analysis::analyze::{Analysis, RealizationSummary, group_id};

fn number(a: &Analysis, id: &str, what: &str) -> Option<f64> {
    a.values.number(&format!("{id}/{what}"))
}

/// Whether there is a verdict or a failed attempt to list.
pub(crate) fn is_judged(a: &Analysis) -> bool {
    let n = |what: &str| number(a, "rendering", what).unwrap_or(0.0);
    ["n_ok", "n_flag", "n_fault", "n_failed_attempts"].map(n) != [0.0; 4]
}

/// A statistic of something with an identifier; what is marked includes the faults.
fn verdict(a: &Analysis, id: &str, what: &str) -> Option<f64> {
    let faults = match what {
        "n_flag" => number(a, id, "n_fault")?,
        _ => 0.0,
    };
    Some(number(a, id, what)? + faults)
}

/// The columns of the verdicts.
fn with_verdicts<T: Copy>(table: Builder<'_, T>) -> Builder<'_, T> {
    table
        .stat("right", "n_ok", plain)
        .stat("marked", "n_flag", plain)
        .stat("too little", "n_too_little", plain)
        .stat("unverified", "n_unverified", plain)
        .stat("failed attempts", "n_failed_attempts", plain)
}

fn is_listed(a: &Analysis, id: &str) -> bool {
    number(a, id, "n_ok").is_some()
}

/// Verdicts, VAF and gain of each realization.
pub(crate) fn rendered(a: &Analysis) -> Table {
    let id = |m: &RealizationSummary| group_id("rendering", &[&m.id]);
    let get = |m: &RealizationSummary, what: &str| verdict(a, &id(m), what);
    let rows = a.realizations.iter().filter(|m| is_listed(a, &id(m)));
    let table = Builder::new("Force of the playbacks, by realization", rows, &get)
        .text(report("realization"), &|m| m.id.clone());
    with_verdicts(table)
        .stat("VAF, mean", "rendered_vaf/mean", four)
        .stat("least", "rendered_vaf/min", four)
        .stat("gain, mean", "gain/mean", three)
        .stat("delivered VAF", "delivered_vaf/mean", four)
        .number(report("identified VAF"), four, &|m| m.vaf)
        .done()
}

fn four(x: f64) -> String {
    apa::number(x, 4)
}

/// Verdicts of each participant.
pub(crate) fn rendered_by_participant(a: &Analysis) -> Table {
    let id = |name: &str| group_id("rendering_subject", &[name]);
    let mut names: Vec<&str> = (a.rows.iter())
        .filter(|row| row.excluded.is_none())
        .map(|row| a.subject(row))
        .collect();
    names.sort_unstable();
    names.dedup();
    names.retain(|name| is_listed(a, &id(name)));
    let get = |name: &str, what: &str| verdict(a, &id(name), what);
    let table = Builder::new("Force of the playbacks, by participant", names, &get)
        .text(report("participant"), &str::to_owned);
    with_verdicts(table).done()
}
