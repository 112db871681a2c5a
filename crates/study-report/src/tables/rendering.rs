//! Tables of the force of the playbacks.

use crate::apa::{self, plain, three};
use crate::table::{Builder, Table, page, report};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{Judged, Number as _};

/// Whether there is a verdict or a failed attempt to list.
pub(crate) fn is_judged(a: &Analysis) -> bool {
    a.results.evidence.rendering.as_ref().is_some_and(|r| {
        let j = &r.judged;
        let counts = [&j.n_ok, &j.n_flag, &j.n_fault, &j.n_failed_attempts];
        counts.iter().any(|n| n.number().is_some_and(|n| n != 0.0))
    })
}

/// The columns of the verdicts; what is marked includes the faults.
fn with_verdicts<'a, T: Copy>(table: Builder<T>, judged: fn(T) -> &'a Judged) -> Builder<T> {
    let verdict = |name: &str, what: &str| page(name).file(what);
    table
        .field(verdict("right", "n_ok"), plain, |t| &judged(t).n_ok)
        .number(verdict("marked", "n_flag"), plain, &|t| {
            Some(judged(t).n_flag.number()? + judged(t).n_fault.number()?)
        })
        .field(verdict("too little", "n_too_little"), plain, |t| {
            &judged(t).n_too_little
        })
        .field(verdict("unverified", "n_unverified"), plain, |t| {
            &judged(t).n_unverified
        })
        .field(
            verdict("failed attempts", "n_failed_attempts"),
            plain,
            |t| &judged(t).n_failed_attempts,
        )
}

/// Verdicts, VAF and gain of each realization.
pub(crate) fn rendered(a: &Analysis) -> Table {
    let rendering = a.results.evidence.rendering.as_ref();
    let rows = a.realizations.iter().filter_map(|m| {
        let playbacks = rendering?.realizations.get(m.id.as_str())?;
        playbacks.judged.n_ok.number()?;
        Some((m, playbacks))
    });
    let table = Builder::new("Force of the playbacks, by realization", rows)
        .text(report("realization"), &|(m, _)| m.id.clone());
    with_verdicts(table, |(_, p)| &p.judged)
        .field(page("VAF, mean"), four, |(_, p)| &p.rendered_vaf.mean)
        .field(page("least"), four, |(_, p)| &p.rendered_vaf.min)
        .field(page("gain, mean"), three, |(_, p)| &p.gain.mean)
        .field(
            report("time judged").file("judged_share_mean"),
            three,
            |(_, p)| &p.judged_share.mean,
        )
        .field(
            report("largest error, JND").file("error_jnd_max"),
            one,
            |(_, p)| &p.error_jnd.max,
        )
        .field(page("delivered VAF"), four, |(_, p)| &p.delivered_vaf.mean)
        .number(report("identified VAF"), four, &|(m, _)| m.vaf)
        .done()
}

fn four(x: f64) -> String {
    apa::number(x, 4)
}

fn one(x: f64) -> String {
    apa::number(x, 1)
}

/// Verdicts of each participant.
pub(crate) fn rendered_by_participant(a: &Analysis) -> Table {
    let rendering = a.results.evidence.rendering.as_ref();
    let rows = rendering.into_iter().flat_map(|r| &r.participants);
    let rows = rows.filter(|(_, judged)| judged.n_ok.number().is_some());
    let table = Builder::new("Force of the playbacks, by participant", rows)
        .text(report("participant"), &|(name, _)| name.as_str().to_owned());
    with_verdicts(table, |(_, judged)| judged).done()
}
