//! Tables of the ordinal hierarchical model.

use crate::answers::share;
use crate::apa::two;
use crate::table::{Builder, Table, report};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{Number as _, Stat};

fn shown(p: &Stat) -> String {
    p.number().map_or_else(|| "–".to_owned(), share)
}

/// Realizations: latent mean, and the probability to be the best.
pub(crate) fn posterior(a: &Analysis) -> Table {
    let model = a.results.posterior.as_ref();
    let rows = model.into_iter().flat_map(|m| &m.realization);
    Builder::new(
        "Posterior of the ordinal model, which decides nothing",
        rows,
    )
    .text(report("realization"), &|(name, _)| name.as_str().to_owned())
    .field(report("latent mean"), two, |(_, of)| &of.level)
    .ends(report("95 % interval"), two, &|(_, of)| {
        of.level_ci95.ends()
    })
    .text(report("is the best, with probability"), &|(_, of)| {
        shown(&of.best.p)
    })
    .text(report("effects half as large before"), &|(_, of)| {
        shown(&of.best.p_narrow)
    })
    .text(report("twice as large"), &|(_, of)| shown(&of.best.p_wide))
    .done()
}
