//! Mass and damping that are not from the training recordings.

use super::printed::short_name;
use std::fmt::Write as _;
use study_haptics::identify::Estimate;
use study_haptics::identify::evidence::Term;
use study_haptics::identify::identification::Identification;
use study_haptics::model::coverage::Origin;

/// A line for each term that is from elsewhere.
pub(super) fn text(results: &Identification) -> String {
    let mut out = String::new();
    let Some(cell) = results.best.map(|best| &results.cells[best]) else {
        return out;
    };
    let names: Vec<String> = results.dynamic.iter().map(short_name).collect();
    for of in &cell.terms {
        let shown = |value: f64| {
            let term = Term::BOTH.into_iter().find(|term| term.as_str() == of.name);
            term.map_or_else(|| value.to_string(), |term| term.shown(value))
        };
        let Estimate { name, value, .. } = of;
        let _ = match (of.origin, of.identified, of.standard_error) {
            (Origin::Stated, ..) => {
                writeln!(out, "{name} {}, stated and not identified", shown(*value))
            }
            (Origin::Dynamic, true, Some(error)) => writeln!(
                out,
                "{name} {} ± {}, identified from {}",
                shown(*value),
                shown(error),
                names.join(", ")
            ),
            _ => Ok(()),
        };
    }
    out
}
