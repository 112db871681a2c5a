//! What `study identify` says of force curves: how much repetitions differ, and how well the
//! realization plays their force.

use super::printed::{Printed, align};
use serde_json::{Value, json};
use std::fmt::Write as _;
use study_haptics::identify::identification::Identification;
use study_haptics::identify::repetition::{BINS, Curve, Loops, WITHIN};
use study_haptics::recording::Recording;

/// Parts of the travel for which differences are printed.
const PARTS: usize = 10;

/// The numbers, all between the shares [`WITHIN`] of the travel.
struct Found {
    loops: Loops,
    measured: Curve,
    /// Between two repetitions.
    difference: Option<Curve>,
    /// Of the best realization.
    played: Option<Curve>,
}

fn find(results: &Identification) -> Option<Found> {
    let training: Vec<&Recording> = results.training.iter().map(|s| &s.recording).collect();
    let loops = Loops::of(&training)?;
    let (measured, difference) = loops.mean(loops.within_mm)?;
    let best = results.best.map(|best| &results.cells[best].realization);
    Some(Found {
        played: best.and_then(|best| loops.played(best, loops.within_mm)),
        loops,
        measured,
        difference,
    })
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// The rms of both directions.
fn whole(difference: &Curve) -> f64 {
    rms(&difference.0.concat())
}

/// The highest VAF of a model of one loop on another one.
fn ceiling(measured: &Curve, difference: &Curve) -> f64 {
    1.0 - 0.5 * (whole(difference) / measured.deviation_n()).powi(2)
}

/// As text; empty if no training recording is a force curve.
pub(super) fn text(results: &Identification) -> String {
    let Some(found) = find(results) else {
        return String::new();
    };
    let p = Printed::of(results);
    let (x, f) = (p.x(), p.f());
    let shown = |n: f64| format!("{:.4}", p.force(n));
    let [from, to] = WITHIN.map(|share| 100.0 * share);
    let mut out = String::new();
    if let Some(played) = &found.played {
        let _ = writeln!(
            out,
            "played slowly between {from} and {to} % of the travel: SD {} {f} (measured {}), rms difference from the measured curve {} {f}",
            shown(played.deviation_n()),
            shown(found.measured.deviation_n()),
            shown(played.difference_n(&found.measured)),
        );
    }
    let Some(difference) = &found.difference else {
        return out;
    };
    if let Some(rate) = found.loops.rate_dependence() {
        let change = shown(rate.per_decade_n);
        let _ = match (rate.error_n.map(shown), rate.depends()) {
            (Some(error), Some(true)) => writeln!(
                out,
                "the loop is wider by {change} ± {error} {f} at ten times the speed (95 %): the force depends on the speed, and this model, of slow loops, does not",
            ),
            (Some(error), _) => writeln!(
                out,
                "the loop is wider by {change} ± {error} {f} at ten times the speed (95 %): no dependence on the speed is seen",
            ),
            (None, _) => writeln!(
                out,
                "the loop is wider by {change} {f} at ten times the speed; two loops do not say with what error",
            ),
        };
    }
    let _ = writeln!(
        out,
        "{} loops differ by {} {f} rms there, so that the highest VAF on another loop is about {:.4}; by position:",
        found.loops.count(),
        shown(whole(difference)),
        ceiling(&found.measured, difference),
    );
    let mut rows = vec![["x", "press", "release"].map(String::from).to_vec()];
    rows[0][0] = x.to_owned();
    let positions = Loops::positions(found.loops.within_mm);
    let bins = BINS / PARTS;
    for first in (0..BINS).step_by(bins) {
        let part = first..first + bins;
        let [low, high] = [positions[first], positions[part.end - 1]].map(|mm| p.length(mm));
        let mut row = vec![format!("{low:.2} to {high:.2}")];
        row.extend(
            difference
                .0
                .iter()
                .map(|side| shown(rms(&side[part.clone()]))),
        );
        rows.push(row);
    }
    out + &align(&rows)
}

/// The same for `--json`; null if no training recording is a force curve.
pub(super) fn json(results: &Identification) -> Value {
    let Some(found) = find(results) else {
        return Value::Null;
    };
    json!({
        "loops": found.loops.count(),
        "within_mm": found.loops.within_mm,
        "sd_n": found.measured.deviation_n(),
        "played_sd_n": found.played.as_ref().map(Curve::deviation_n),
        "played_difference_n": found.played.as_ref().map(|p| p.difference_n(&found.measured)),
        "repetition_difference_n": found.difference.as_ref().map(whole),
        "ceiling_vaf": found.difference.as_ref().map(|d| ceiling(&found.measured, d)),
        "rate_dependence": found.loops.rate_dependence().map(|rate| json!({
            "speeds_mm_s": rate.loops.iter().map(|of| of[0]).collect::<Vec<_>>(),
            "widths_n": rate.loops.iter().map(|of| of[1]).collect::<Vec<_>>(),
            "per_decade_n": rate.per_decade_n,
            "error_n": rate.error_n,
            "depends": rate.depends(),
        })),
        "by_position": found.difference.as_ref().map(|d| json!({
            "x_mm": Loops::positions(found.loops.within_mm),
            "press_n": d.0[0],
            "release_n": d.0[1],
        })),
    })
}
