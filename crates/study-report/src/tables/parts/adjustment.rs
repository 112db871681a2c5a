//! The table of adjustment.

use super::{column, count};
use crate::apa::{self, plain};
use crate::table::{Builder, Table};
use study_analysis::analyze::psychophysics::results::{Adjusted, PartResults};
use study_analysis::analyze::results::Number as _;

fn found(results: &PartResults) -> Option<&Adjusted> {
    results.over.adjustment.as_ref()
}

/// Participants, and what they have in common.
pub(super) fn participants(results: &PartResults) -> Table {
    let participants = found(results).into_iter().flat_map(|own| &own.participants);
    let note = "PSE: point of subjective equality, the mean of the mean settings from below and from above. SD: standard deviation within \
                both, a measure of the just noticeable difference.";
    Builder::new("Settings by participant", participants)
        .name("participant", "participant", &|p| p.0.as_str().to_owned())
        .field(column("settings", "n"), count, |p| &p.1.n)
        .field(
            column("PSE", "pse").explained(note.to_owned()),
            plain,
            |p| &p.1.pse,
        )
        .field(column("from below", "ascending"), plain, |p| &p.1.ascending)
        .field(column("from above", "descending"), plain, |p| {
            &p.1.descending
        })
        .field(column("SD", "sd"), plain, |p| &p.1.sd)
        .notes(found(results).into_iter().flat_map(notes))
}

fn notes(found: &Adjusted) -> Vec<String> {
    let interval = |ends: Option<(f64, f64)>| {
        ends.map_or_else(String::new, |(low, high)| {
            format!(", 95 % CI [{}, {}]", plain(low), plain(high))
        })
    };
    let chance = |p: Option<f64>| p.map_or_else(String::new, |p| format!(", p {}", apa::p(p)));
    let pse = found.pse.number().map(|pse| {
        let ci95 = interval(found.pse_ci95.ends());
        format!("Mean point of subjective equality: {}{ci95}.", plain(pse))
    });
    let error = found.error.as_ref().and_then(|error| {
        Some(format!(
            "Less the standard {}: {}{}{}.",
            plain(error.standard.number()?),
            plain(error.mean.number()?),
            interval(error.ci95.ends()),
            chance(error.p.number())
        ))
    });
    let sides = found.start.difference.number().map(|difference| {
        format!(
            "From below less from above: {}{}{}.",
            plain(difference),
            interval(found.start.ci95.ends()),
            chance(found.start.p.number())
        )
    });
    let spread = found.spread.sd.number().map(|sd| {
        format!(
            "Standard deviation within participants and sides: {}{}.",
            plain(sd),
            interval(found.spread.sd_ci95.ends())
        )
    });
    [pse, error, sides, spread].into_iter().flatten().collect()
}
