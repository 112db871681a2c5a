//! Banners, warnings, exclusions, comments, provenance.

use super::tables::{grid, table};
use super::{Details, lines, safe};
use crate::table::MAX_ROWS;
use crate::{Source, apa, tables};
use maud::{Markup, html};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Comment, PreregisteredRule, Warning};
use study_base::text::{counted, sentence};

/// Warnings that are banners at the top.
const AT_THE_TOP: [&str; 3] = ["no-participants", "mixed", "interim"];

pub(super) fn banners(a: &Analysis) -> Markup {
    let title = |code: &str| match code {
        "no-participants" if a.counts.simulated > 0 && a.counts.pilots == 0 => {
            "SIMULATED DATA – NO PARTICIPANTS"
        }
        "no-participants" => "NO PARTICIPANTS",
        "mixed" => "INCLUDES PILOT OR SIMULATED DATA",
        _ => "INTERIM ANALYSIS",
    };
    html! {
        @for w in a.warnings.iter().filter(|w| AT_THE_TOP.contains(&w.code)) {
            div.banner role="note" { b { (title(w.code)) } (noted(w)) }
        }
        @let others: Vec<_> = a.warnings.iter().filter(|w| !AT_THE_TOP.contains(&w.code)).collect();
        @if !others.is_empty() {
            details open {
                summary { (counted(others.len(), "caveat", "caveats")) }
                ul { @for w in others { li { (noted(w)) } } }
            }
        }
    }
}

/// With a capital letter, unless it starts with a path, and a full stop.
fn noted(w: &Warning) -> String {
    let text = safe(&w.text);
    match w.code {
        "damaged-results" => format!("{text}."),
        _ => sentence(&text),
    }
}

/// The exclusion rules, their effects, and changes after the study began.
fn rules(a: &Analysis) -> Markup {
    let with = a.results.evidence.corr.pearson.r.number().map(apa::r);
    let before = a.results.before_exclusion.as_ref();
    let without = before.map(|b| &b.corr.pearson.r).number().map(apa::r);
    let changed = a.changed(PreregisteredRule::Exclusions);
    html! {
        @if a.exclusions.is_empty() && changed {
            p { "The exclusion rules were removed after the study began: see Deviations." }
        } @else if a.exclusions.is_empty() {
            p { "No exclusion rule was set in advance." }
        } @else {
            (table(&tables::rules(a)))
            @match (&with, &without) {
                (Some(with), Some(without)) => p {
                    "With the exclusions mean rating and VAF correlate at r = " (with)
                    ", without them at r = " (without)
                    ". A table above compares more results."
                },
                (None, Some(without)) => p {
                    "With the exclusions the correlation of mean rating and VAF is undefined; without them r = " (without) "."
                },
                _ => {},
            }
        }
        @if a.deviations.is_empty() {
            p { "No analysis rule was changed after the study began." }
        } @else {
            h3 {
                @if a.deviations.iter().any(|d| d.registered) { "Deviations from the preregistered analysis" }
                @else { "Changes of the analysis after the study began" }
            }
            ul { @for d in &a.deviations { li { (safe(&d.text)) } } }
        }
    }
}

pub(super) fn exclusions(a: &Analysis, of_study: bool) -> Markup {
    let c = &a.counts;
    let facts: Vec<(&str, usize)> = [
        ("rows (without practice)", c.rows),
        ("ratings analyzed", c.rated),
        ("failed trials", c.failed),
        ("declined answers", c.declined),
        ("missing ratings", c.missing),
        ("corrected answers", c.corrected),
        ("trials repeated after a failed attempt", c.repeated),
        ("practice trials", c.practice),
    ]
    .into_iter()
    .collect();
    html! {
        section {
            h2 { "Included and excluded data" }
            dl { @for (what, n) in facts { dt { (what) } dd { (n) } } }
            @if of_study { (rules(a)) }
            @if c.excluded.is_empty() {
                p { "No row was excluded." }
            } @else {
                p { (counted(c.excluded_participants, "participant has", "participants have")) " excluded rows:" }
                ul {
                    @for (reason, n) in &c.excluded {
                        li { (safe(reason)) ": " (counted(*n, "row", "rows")) }
                    }
                }
                details {
                    summary { "Excluded rows" }
                    (grid(&tables::excluded(a), false))
                }
            }
        }
    }
}

pub(super) fn comments(a: &Analysis, lang: Option<&str>) -> Markup {
    html! {
        @if !a.comments.is_empty() {
            section.comments {
                h2 { "Comments" }
                p.note { "As typed. Control characters and characters that change the direction of text are shown as codes." }
                @for group in a.comments.chunk_by(|x, y| x.model == y.model) {
                    (comments_on_one(a, group, lang))
                }
            }
        }
    }
}

fn comments_on_one(a: &Analysis, group: &[Comment], lang: Option<&str>) -> Markup {
    let mean = a.described(&group[0].model).map(|d| &d.mean).number();
    html! {
        @let model = if group[0].model.is_empty() { "no realization" } else { &group[0].model };
        details open {
            summary {
                (safe(model))
                @if let Some(mean) = mean { ", mean " (apa::two(mean)) }
                " (" (group.len()) ")"
            }
            @for c in group.iter().take(MAX_ROWS) {
                blockquote {
                    span.who {
                        (safe(&c.subject)) ", repetition " (c.repetition)
                        @if c.question != "comment" { ", " (safe(&c.question)) }
                    }
                    span lang=[lang] dir="auto" { (lines(&c.text)) }
                }
            }
            @if group.len() > MAX_ROWS {
                p.note { (group.len() - MAX_ROWS) " more are in comments.csv." }
            }
        }
    }
}

pub(super) fn provenance(source: &Source, d: &Details, question: Option<&str>) -> Markup {
    html! {
        section {
            h2 { "Provenance" }
            dl {
                dt { "analyzed with" } dd { "study " (env!("CARGO_PKG_VERSION")) }
                @if let Some(id) = &source.study { dt { "study" } dd { (safe(id)) } }
                dt { "read from" } dd { code { (safe(&source.path)) } }
                @if let Some(question) = question { dt { "question" } dd { (safe(question)) } }
                @if let Some(seed) = d.seed { dt { "seed" } dd { (seed) } }
                @if !d.tools.is_empty() { dt { "sessions run with" } dd { "study " (safe(&d.tools.join(", "))) } }
                @if !d.states.is_empty() {
                    dt { "states of sessions" }
                    dd { @for (i, (state, n)) in d.states.iter().enumerate() { @if i > 0 { ", " } (n) " " (safe(state)) } }
                }
                @if let Some(kind) = &d.device { dt { "device" } dd { (safe(kind)) } }
                @for (name, value) in &d.facts { dt { (safe(name)) } dd { (safe(value)) } }
                @for (name, value) in &d.fingerprints {
                    dt { "fingerprint: " (safe(name)) } dd { code { (safe(value)) } }
                }
            }
            @if !d.corrections.is_empty() {
                details open {
                    summary { (counted(d.corrections.len(), "correction", "corrections")) }
                    ul { @for one in &d.corrections { li { (safe(one)) } } }
                    p.note { "Both values are in attempts.csv and in the journals." }
                }
            }
            @if !d.versions.is_empty() {
                details open[d.versions.len() > 1] {
                    summary { "Versions of the protocol" }
                    ul {
                        @for (number, at, why) in &d.versions {
                            li { (number) ": " (safe(at)) @if !why.is_empty() { ", " (safe(why)) } }
                        }
                    }
                    @if d.versions.len() > 1 {
                        p.note { "Every version after the first changed the protocol after the study began." }
                    }
                }
            }
        }
    }
}
