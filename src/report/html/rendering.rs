//! Was the force that was felt the force of the realization's table?

use super::tables::HtmlTable;
use super::{safe, typeset};
use crate::report::apa;
use maud::{Markup, html};
use study_base::text::counted;
use study_core::analyze::{Analysis, Question, group_id};

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
            @if is_judged(a) { (realizations(a).render()) }
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
            @if is_judged(a) { (participants(a).render()) }
        }
    }
}

/// Whether there is a verdict or a failed attempt to list.
fn is_judged(a: &Analysis) -> bool {
    let n = |what: &str| number(a, "rendering", what).unwrap_or(0.0);
    ["n_ok", "n_flag", "n_fault", "n_failed_attempts"].map(n) != [0.0; 4]
}

fn number(a: &Analysis, id: &str, what: &str) -> Option<f64> {
    a.values.number(&format!("{id}/{what}"))
}

/// "Of 150 trials …: the force was right in 148 …".
fn summary(a: &Analysis) -> Option<String> {
    let get = |what: &str| number(a, "rendering", what);
    let count = |n: f64, one: &str, many: &str| counted(n as usize, one, many);
    let wrong = get("n_flag")? + get("n_fault")?;
    let judged = get("n_ok")? + wrong;
    let mut text = format!(
        "The force was judged in {} that count: right in {}, marked in {wrong}",
        count(judged, "trial", "trials"),
        get("n_ok")?
    );
    if let Some(share) = get("share_wrong") {
        text.push_str(&format!(" ({})", apa::percent(share)));
    }
    text.push('.');
    for (n, why) in [
        (
            get("n_too_little")?,
            "too little was felt or reported for a verdict",
        ),
        (get("n_unverified")?, "it could not be verified"),
    ] {
        if n > 0.0 {
            text.push_str(&format!(" In {}, {why}.", count(n, "trial", "trials")));
        }
    }
    let failed = get("n_failed_attempts")?;
    if failed > 0.0 {
        text.push_str(&format!(
            " {} failed because of a wrong force and came again.",
            count(failed, "attempt", "attempts")
        ));
    }
    Some(text)
}

/// Verdicts of one realization or participant.
fn verdicts(a: &Analysis, id: &str) -> Option<Vec<String>> {
    let get = |what: &str| number(a, id, what);
    let wrong = get("n_flag")? + get("n_fault")?;
    let counts = [
        get("n_ok")?,
        wrong,
        get("n_too_little")?,
        get("n_unverified")?,
        get("n_failed_attempts")?,
    ];
    Some(counts.iter().map(ToString::to_string).collect())
}

const VERDICTS: [&str; 5] = [
    "right",
    "marked",
    "too little",
    "unverified",
    "failed attempts",
];

fn realizations(a: &Analysis) -> HtmlTable {
    let numbers = [
        "VAF, mean",
        "least",
        "gain, mean",
        "delivered VAF",
        "identified VAF",
    ];
    let head = [&["realization"][..], &VERDICTS, &numbers].concat();
    let mut table = HtmlTable::new("Force of the playbacks, by realization", &head);
    for m in &a.realizations {
        let id = group_id("rendering", &[&m.id]);
        let Some(counts) = verdicts(a, &id) else {
            continue;
        };
        let vaf = |what: &str| apa::or_dash(number(a, &id, what), |x| apa::number(x, 4));
        let mut row = vec![m.id.clone()];
        row.extend(counts);
        row.extend([
            vaf("rendered_vaf/mean"),
            vaf("rendered_vaf/min"),
            apa::or_dash(number(a, &id, "gain/mean"), |x| apa::number(x, 3)),
            vaf("delivered_vaf/mean"),
            apa::or_dash(m.vaf, |x| apa::number(x, 4)),
        ]);
        table.row(row);
    }
    table
}

fn participants(a: &Analysis) -> HtmlTable {
    let head = [&["participant"][..], &VERDICTS].concat();
    let mut table = HtmlTable::new("Force of the playbacks, by participant", &head);
    let mut names: Vec<&str> = (a.rows.iter())
        .filter(|row| row.excluded.is_none())
        .map(|row| a.subject(row))
        .collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        if let Some(counts) = verdicts(a, &group_id("rendering_subject", &[name])) {
            let mut row = vec![name.to_owned()];
            row.extend(counts);
            table.row(row);
        }
    }
    table
}
