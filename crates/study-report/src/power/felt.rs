//! What is said of the power of ranking, similarity, adjustment and identification.

use super::percent;
use crate::apa;
use serde_json::{Value, json};
use study_analysis::power::{Assumptions, Cell, FeltWorld};
use study_base::text::counted;

/// What is simulated, of the part with this id.
pub(super) fn summary(world: &FeltWorld, id: &str, own: &Cell) -> String {
    let trials = counted(own.repetitions, "trial", "trials");
    match world {
        FeltWorld::Ranking { x, ties, .. } => {
            let ties = if *ties { "with" } else { "without" };
            format!(
                "Part {id}: {} of {} realizations, {ties} ties.",
                counted(own.repetitions, "ranking", "rankings"),
                x.len()
            )
        }
        FeltWorld::Similarity { x, pairs, property } => format!(
            "Part {id}: {} of {} realizations, {trials} each; the map is held against the {property}.",
            counted(pairs.len(), "pair", "pairs"),
            x.len()
        ),
        FeltWorld::Adjustment { standard, .. } => format!(
            "Part {id}: {} from below and as many from above, beside a standard of {}.",
            counted(own.repetitions, "setting", "settings"),
            apa::plain(*standard)
        ),
        FeltWorld::Identification { labels, right, .. } => format!(
            "Part {id}: {} realizations, {trials} each, with {labels} labels.",
            right.len()
        ),
    }
}

/// What is assumed, in words.
pub(super) fn assumed(world: &FeltWorld, a: &Assumptions) -> String {
    let (number, s) = (|x: f64| apa::number(x, 2), &a.spread);
    match world {
        FeltWorld::Ranking { property, .. } => format!(
            "slope {} per SD of the {property}, SD of realizations {}, of participants' tastes {}, of what is felt {}",
            number(a.slope),
            number(s.realization),
            number(s.interaction),
            number(s.residual)
        ),
        FeltWorld::Similarity { property, .. } => format!(
            "{} points per SD of the {property}, SD of a second dimension {}, of participant × pair {}, of a rating {} (points)",
            number(a.slope),
            number(s.realization),
            number(s.interaction),
            number(s.residual)
        ),
        FeltWorld::Adjustment { mean, .. } => format!(
            "a mean of {} that feels equal, SD of participants {}, of settings {} (levels)",
            apa::plain(*mean),
            apa::plain(s.subject),
            apa::plain(s.residual)
        ),
        FeltWorld::Identification { correct, .. } => format!(
            "{} correct answers, SD of participants {}, of labels {} (logits)",
            percent(*correct),
            number(s.subject),
            number(s.realization)
        ),
    }
}

/// What is assumed, for the document.
pub(super) fn assumptions(world: &FeltWorld, a: &Assumptions, value: &mut Value) {
    let s = &a.spread;
    match world {
        FeltWorld::Ranking { property, ties, .. } => {
            value["slope"] = json!(a.slope);
            value["property"] = json!(property);
            value["ties"] = json!(ties);
            value["sd"] = json!({
                "realization": s.realization, "interaction": s.interaction, "residual": s.residual,
            });
        }
        FeltWorld::Similarity {
            property, pairs, ..
        } => {
            value["slope"] = json!(a.slope);
            value["property"] = json!(property);
            value["pairs"] = json!(pairs.len());
            value["sd"] = json!({
                "realization": s.realization, "interaction": s.interaction, "residual": s.residual,
            });
        }
        FeltWorld::Adjustment { standard, mean, .. } => {
            value["standard"] = json!(standard);
            value["mean"] = json!(mean);
            value["sd"] = json!({ "participant": s.subject, "residual": s.residual });
        }
        FeltWorld::Identification {
            labels, correct, ..
        } => {
            value["labels"] = json!(labels);
            value["mean"] = json!(correct);
            value["sd"] = json!({ "participant": s.subject, "realization": s.realization });
        }
    }
}

/// What a reader has to know.
pub(super) fn warnings(world: &FeltWorld, a: &Assumptions) -> Vec<String> {
    let is_nothing = match world {
        FeltWorld::Ranking { .. } => a.slope == 0.0 && a.spread.realization == 0.0,
        FeltWorld::Similarity { .. } => a.slope == 0.0,
        FeltWorld::Adjustment { standard, mean, .. } => standard == mean,
        FeltWorld::Identification {
            labels, correct, ..
        } => *correct * *labels as f64 <= 1.0,
    };
    let starts = matches!(world, FeltWorld::Similarity { .. }).then_some(STARTS);
    let nothing = is_nothing.then_some(NOTHING);
    (starts.into_iter().chain(nothing))
        .map(str::to_owned)
        .collect()
}

const STARTS: &str =
    "the maps of simulated studies come from 10 random starts, those of a study from 100";
const NOTHING: &str = "no effect is assumed: this is how often the tests say yes without one";
