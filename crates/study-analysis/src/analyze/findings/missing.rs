//! Whether missing ratings could turn an answer.

use super::{Facts, Finding, Question, Verdict};
use crate::analyze::results::{Moved, Number as _};
use study_base::apa;
use study_stats::level::rejects;

/// Says of each answer that was tried with the missing ratings moved whether it holds.
pub(super) fn with_missing_moved(facts: &Facts<'_>, findings: &mut [Finding]) {
    let Some(missing) = &facts.evidence.missing else {
        return;
    };
    let (Some(moved), Some(share), Some(sd)) =
        (&missing.moved, missing.share.number(), missing.sd.number())
    else {
        return;
    };
    for found in findings {
        let (answer, against) = match &found.question {
            Question::Vaf => (
                &moved.vaf,
                ["against the relation", "along with the relation"],
            ),
            Question::Differ => (
                &moved.differ,
                [
                    "towards the mean of all realizations",
                    "away from the mean of all realizations",
                ],
            ),
            Question::Best => (
                &moved.best,
                ["against the best", "for the best and against the second"],
            ),
            Question::Effect(effect) => match moved.effects.get(effect.as_str()) {
                Some(answer) => (answer, ["towards no effect", "away from no effect"]),
                None => continue,
            },
            _ => continue,
        };
        let yes = match found.verdict {
            Verdict::Yes => true,
            Verdict::NotShown => false,
            Verdict::Undefined(_) => continue,
        };
        let direction = if yes { against[0] } else { against[1] };
        let begin = format!(
            "{} of the ratings are missing; with each of them {} points (one standard deviation) from what is expected, \
             always {direction}, ",
            apa::percent(share),
            apa::number(sd, 2),
        );
        if let Some((code, end)) = outcome(answer, yes, facts.rules.alpha) {
            found.caveat(code, begin + &end);
        }
    }
}

/// What became of an answer; `None` if the test that was repeated does not say the same of the ratings that are there.
fn outcome(answer: &Moved, yes: bool, alpha: f64) -> Option<(&'static str, String)> {
    let (p, p_moved) = (answer.p.number()?, answer.p_moved.number()?);
    if rejects(p, alpha) != yes {
        return None;
    }
    let still = rejects(p_moved, alpha);
    let p_moved = apa::p_beside(p_moved, alpha);
    let Some(shift) = answer.turns_at.number() else {
        let be = if yes { "be" } else { "not be" };
        let text = format!("it would still {be} shown (p {p_moved})");
        return Some(("missing-does-not-turn-it", text));
    };
    let turned = match (yes, still) {
        (true, true) => "the opposite would be shown",
        (true, false) => "it would no longer be shown",
        (false, _) => "it would be shown",
    };
    let text = format!(
        "{turned} (p {p_moved}); the answer turns from {} standard deviations on",
        apa::number(shift, 2)
    );
    Some(("missing-turns-it", text))
}
