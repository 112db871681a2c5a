//! The parts of a study that are not ratings: answers, figures, tables and paragraphs of
//! each.

use super::tables::table;
use super::{Details, figures_section, safe, statistics, typeset};
use crate::Source;
use crate::figures::Drawn;
use crate::part_answers::{answered, answers, banner, caveats, methods, results};
use crate::tables::parts::tables;
use maud::{Markup, html};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_base::text::counted;

/// What the section of a part has besides its analysis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartReport {
    /// Sentences on its trials, for the methods. Untrusted.
    pub trials: String,
    /// Its figures.
    pub figures: Vec<Drawn>,
}

/// The head of a report without ratings.
pub(super) fn head(
    source: &Source,
    details: &Details,
    parts: &[PartAnalysis],
    lang: Option<&str>,
) -> Markup {
    let people = parts.iter().map(|p| p.participants).max().unwrap_or(0);
    let trials: usize = parts.iter().map(|p| p.trials).sum();
    html! {
        header {
            h1 lang=[lang] dir="auto" { (safe(&source.title)) }
            @if !details.authors.is_empty() {
                p.authors { (safe(&details.authors.join(", "))) }
            }
            p.facts {
                @if let Some(id) = &source.study { span { "study " (safe(id)) } " " }
                @if let Some(version) = source.protocol_version {
                    span { "protocol version " (version) } " "
                }
                span { (counted(people, "participant", "participants")) } " "
                span { (counted(trials, "trial", "trials")) } " "
                span { (counted(parts.len(), "part", "parts")) }
            }
            @if let Some(search) = &source.confirms {
                p { (safe(&crate::confirmation::sentence(search))) }
            }
            @if let Some(comparison) = &source.preregistration {
                p { (safe(&crate::comparison::sentence(comparison))) }
            }
            @if !details.damage.is_empty() {
                ul { @for text in &details.damage { li { (safe(text)) } } }
            }
        }
    }
}

/// A section for each part; its figures follow those before.
pub(super) fn sections(parts: &[PartAnalysis], reports: &[PartReport], before: usize) -> Markup {
    let mut number = before;
    let firsts: Vec<usize> = (reports.iter())
        .map(|part| {
            let first = number;
            number += part.figures.len();
            first
        })
        .collect();
    html! {
        @for ((part, report), first) in parts.iter().zip(reports).zip(firsts) {
            (section(part, report, first))
        }
    }
}

fn section(part: &PartAnalysis, report: &PartReport, first: usize) -> Markup {
    html! {
        section.part {
            h2 { "Part " (safe(part.part.as_str())) }
            p.facts {
                span { (part.task) } " "
                span { (answers(part)) } " "
                span { (counted(part.participants, "participant", "participants")) }
            }
            @if let Some(text) = banner(part) { div.banner role="note" { b { (text) } } }
            @let caveats = caveats(part);
            @if !caveats.is_empty() {
                details open {
                    summary { (counted(caveats.len(), "caveat", "caveats")) }
                    ul { @for text in &caveats { li { (safe(text)) } } }
                }
            }
            @for answer in &answered(part) {
                h3 { (safe(&answer.question)) }
                p.short { (typeset(&answer.short)) }
                @for line in &answer.main { p { (typeset(line)) } }
            }
            (figures_section(&report.figures, first))
            @for own in &tables(&part.results) { (table(own)) }
            h3 { "For the paper" }
            p.note { "Drafts made from the numbers of this analysis. Check every sentence before you use it." }
            p { (typeset(&report.trials)) " " (typeset(&methods(part))) }
            @let results = results(part);
            @if !results.is_empty() { p { (typeset(&results)) } }
            (statistics::listing(&part.values(), "docs/statistics-psychophysics.md", "parts.json"))
        }
    }
}
