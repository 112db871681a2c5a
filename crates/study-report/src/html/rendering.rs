//! Was the force that was felt the force of the realization's table?

use super::tables::table;
use super::{safe, typeset};
use crate::{apa, tables};
use maud::{Markup, html};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Question};
use study_base::text::counted;

/// The section, if any playback says what was felt.
pub(super) fn section(a: &Analysis) -> Markup {
    let Some(summary) = summary(a) else {
        return html! {};
    };
    let about = a.finding(&Question::Delivered).and_then(|f| f.reason());
    html! {
        section {
            h2 { "Was the force that of the realization?" }
            p { (typeset(&summary)) }
            p.note {
                "After each playback the force that the device commanded is compared with the force of the \
                 table for the motion that it reported. Right: within the limits of the protocol. Marked: \
                 not within them. The VAF here is the share of the variance of the table's force that the \
                 device commanded; the gain is the slope of the commanded force."
            }
            @if tables::is_judged(a) { (table(&tables::rendered(a))) }
            @if let Some(why) = about {
                p.note { (safe(&format!("Delivered VAF: {why}."))) }
            } @else {
                p.note {
                    "Delivered VAF: the VAF of the table's force on the validation recording with the gain \
                     and the delay of each playback, of the measured force where there is a sensor; mean over \
                     playbacks. With gain 1 and no delay it is the identified VAF. A wrong shape of the force \
                     is not in it."
                }
            }
            @if tables::is_judged(a) { (table(&tables::rendered_by_participant(a))) }
        }
    }
}

fn summary(a: &Analysis) -> Option<String> {
    let judged = &a.results.evidence.rendering.as_ref()?.judged;
    let count = |n: f64, one: &str, many: &str| counted(n as usize, one, many);
    let wrong = judged.n_flag.number()? + judged.n_fault.number()?;
    let right = judged.n_ok.number()?;
    let mut text = format!(
        "The force was judged in {} that count: right in {}, marked in {wrong}",
        count(right + wrong, "trial", "trials"),
        right
    );
    if let Some(share) = judged.share_wrong.number() {
        text.push_str(&format!(" ({})", apa::percent(share)));
    }
    text.push('.');
    for (n, why) in [
        (
            judged.n_too_little.number()?,
            "too little was felt or reported for a verdict",
        ),
        (judged.n_unverified.number()?, "it could not be verified"),
    ] {
        if n > 0.0 {
            text.push_str(&format!(" In {}, {why}.", count(n, "trial", "trials")));
        }
    }
    let failed = judged.n_failed_attempts.number()?;
    if failed > 0.0 {
        text.push_str(&format!(
            " {} failed because of a wrong force and came again.",
            count(failed, "attempt", "attempts")
        ));
    }
    Some(text)
}
