//! The figures that are looked at first, for the terminal and the files.

use super::Results;
use super::printed::Printed;
use study_haptics::recording::Recording;
use study_report::identification::{
    self, ByPosition, Compared, Coverage, Drawing, Shown, terminal,
};

fn by_position(results: &Results<'_>) -> Option<ByPosition> {
    let cell = results.cells.get(results.best.unwrap_or(0))?;
    let training: Vec<&Recording> = results.training.iter().map(|(_, r)| r).collect();
    let reported = results.reported();
    let of_reported =
        |((_, recording), _): &(&(_, &Recording), _)| std::ptr::eq(*recording, reported);
    let ceiling = (results.recordings.iter().zip(&results.ceilings)).find(of_reported);
    let noise_n = ceiling.and_then(|(_, ceiling)| ceiling.map(|c| c.noise_n));
    Some(ByPosition::of(
        &cell.realization,
        &training,
        reported,
        noise_n,
    ))
}

fn coverage(results: &Results<'_>) -> Option<Coverage> {
    let training: Vec<&Recording> = results.training.iter().map(|(_, r)| r).collect();
    Coverage::of(&training)
}

fn shown(results: &Results<'_>) -> Shown {
    let Printed { units, lever_mm } = Printed::of(results);
    Shown { units, lever_mm }
}

/// As text for a terminal of this width.
pub(super) fn text(results: &Results<'_>, width: usize) -> String {
    let shown = shown(results);
    let by_position = by_position(results);
    let force = by_position.map(|found| terminal::displacement(&found, width, shown));
    let coverage = coverage(results).map(|found| terminal::coverage(&found, width, shown));
    [force, coverage].into_iter().flatten().collect()
}

/// As figures.
pub(super) fn drawings(results: &Results<'_>) -> Vec<Drawing> {
    let shown = shown(results);
    let by_position = by_position(results);
    let mut drawings: Vec<Drawing> = Vec::new();
    drawings.extend(by_position.map(|found| identification::displacement(&found, shown)));
    drawings.extend(coverage(results).map(|found| identification::coverage(&found, shown)));
    drawings.extend(results.comparison.as_ref().and_then(|comparison| {
        let candidates = comparison.candidates.iter().enumerate();
        let compared = candidates.map(|(i, candidate)| Compared {
            method: candidate.cell.method.as_str().to_owned(),
            left_out: candidate.left_out.map(|l| [l.vaf, l.rms_n]),
            failed: candidate.failure().map(|failure| failure.to_string()),
            is_recommended: comparison.recommended == Some(i),
        });
        let compared: Vec<Compared> = compared.collect();
        identification::methods(&compared, comparison.noise_n, shown)
    }));
    drawings
}
