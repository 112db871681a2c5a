//! The figures that are looked at first, for the terminal and the files.

use super::position::ByPosition;
use super::printed::Printed;
use super::{Compared, Coverage, Drawing, Shown, terminal};
use study_haptics::identify::identification::{Identification, Source};
use study_haptics::recording::Recording;

fn by_position(results: &Identification) -> Option<ByPosition> {
    let cell = results.cells.get(results.best.unwrap_or(0))?;
    let training: Vec<&Recording> = results.training.iter().map(|s| &s.recording).collect();
    let reported = results.reported();
    let of_reported =
        |(source, _): &(&Source, _)| std::ptr::eq(&raw const source.recording, reported);
    let ceiling = (results.recordings.iter().zip(&results.ceilings)).find(of_reported);
    let noise_n = ceiling.and_then(|(_, ceiling)| ceiling.map(|c| c.noise_n));
    Some(ByPosition::of(
        &cell.realization,
        &training,
        reported,
        noise_n,
    ))
}

fn coverage(results: &Identification) -> Option<Coverage> {
    let training: Vec<&Recording> = results.training.iter().map(|s| &s.recording).collect();
    Coverage::of(&training)
}

fn shown(results: &Identification) -> Shown {
    let Printed { units, lever_mm } = Printed::of(results);
    Shown { units, lever_mm }
}

/// As text for a terminal of this width.
pub(super) fn text(results: &Identification, width: usize) -> String {
    let shown = shown(results);
    let by_position = by_position(results);
    let force = by_position.map(|found| terminal::displacement(&found, width, shown));
    let coverage = coverage(results).map(|found| terminal::coverage(&found, width, shown));
    [force, coverage].into_iter().flatten().collect()
}

/// As figures.
pub(super) fn drawings(results: &Identification) -> Vec<Drawing> {
    let shown = shown(results);
    let by_position = by_position(results);
    let mut drawings: Vec<Drawing> = Vec::new();
    drawings.extend(by_position.map(|found| super::displacement(&found, shown)));
    drawings.extend(coverage(results).map(|found| super::coverage(&found, shown)));
    drawings.extend(results.comparison.as_ref().and_then(|comparison| {
        let candidates = comparison.candidates.iter().enumerate();
        let compared = candidates.map(|(i, candidate)| Compared {
            method: candidate.cell.method.as_str().to_owned(),
            left_out: candidate.left_out.map(|l| [l.vaf, l.rms_n]),
            failed: candidate.failure().map(|failure| failure.to_string()),
            is_recommended: comparison.recommended == Some(i),
        });
        let compared: Vec<Compared> = compared.collect();
        super::methods(&compared, comparison.noise_n, shown)
    }));
    drawings
}
