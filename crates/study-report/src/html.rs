//! The report: one self-contained HTML file.
//!
//! It has no scripts and no external references (the content security policy in its
//! head forbids both), and is laid out for screens, phones and A4. All text from the
//! data is escaped by maud, and [`Untrusted`] shows control and bidirectional
//! characters as codes.
//!
//! Every number is looked up in the analysis by its identifier. What is absent is left
//! out; what is undefined is listed with its reason.

mod methods;
mod notes;
mod paragraphs;
mod parts;
mod rendering;
mod statistics;
mod style;
mod tables;

pub use parts::PartReport;
pub(crate) use style::CSS;

use super::answers::{answers, conditional};
use super::figures::Drawn;
use super::{Site, Source};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_base::text::{Untrusted, counted};

/// Facts about a study besides its analysis. All text is untrusted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Details {
    /// BCP 47 language tag of the texts of the study.
    pub lang: Option<String>,
    /// Authors.
    pub authors: Vec<String>,
    /// The question.
    pub prompt: Option<String>,
    /// Labels of ratings on the scale.
    pub labels: Vec<(f64, String)>,
    /// Name and value of further facts, such as funding, for the notes.
    pub facts: Vec<(String, String)>,
    /// Planned repetitions of each realization.
    pub repetitions: Option<u32>,
    /// How the order of the trials was made, as a phrase.
    pub order: Option<String>,
    /// Number of participants by state.
    pub states: Vec<(String, usize)>,
    /// Sentences on the sample from the intake questions, for the methods.
    pub sample: Vec<String>,
    /// The ethics approval.
    pub ethics: Option<String>,
    /// Sentences on the conduct of the sessions, for the methods.
    pub conduct: Vec<String>,
    /// Instruction shown before each trial.
    pub reference: Option<String>,
    /// Kind of the device.
    pub device: Option<String>,
    /// Seed of the study's randomness.
    pub seed: Option<u64>,
    /// Versions of this program that ran the sessions.
    pub tools: Vec<String>,
    /// Name and value of each fingerprint of the newest version.
    pub fingerprints: Vec<(String, String)>,
    /// What the report has of each part that is no rating besides its analysis.
    pub parts: Vec<PartReport>,
    /// Damage of the results. Of a study with ratings, it is among their warnings.
    pub damage: Vec<String>,
    /// What was corrected, one sentence each, with both values and the reason. Untrusted.
    pub corrections: Vec<String>,
    /// Versions of the protocol: number, time, reason.
    pub versions: Vec<(u32, String, String)>,
}

/// The whole document of ratings, with the other parts of the study.
pub fn document(source: &Source, details: &Details, a: &Analysis, figures: &[Drawn]) -> String {
    let lang = details.lang.as_deref().filter(|l| is_tag(l));
    let main = html! {
        (answers_section(a))
        (figures_section(figures, 0))
        (tables::section(a))
        (rendering::section(a))
        (sites(&source.sites))
        (paragraphs::section(details, a))
        (conditional_section(a))
        (parts::sections(&a.parts, &details.parts, figures.len()))
        (notes::comments(a, lang))
        (notes::exclusions(a, source.study.is_some()))
        (statistics::section(&a.values))
        (notes::provenance(source, details, Some(&a.question)))
    };
    page(
        source,
        &head(source, details, a, lang),
        &main,
        "values.json",
    )
}

/// The whole document of a study without ratings.
pub fn parts_document(source: &Source, details: &Details, parts: &[PartAnalysis]) -> String {
    let lang = details.lang.as_deref().filter(|l| is_tag(l));
    let main = html! {
        (parts::sections(parts, &details.parts, 0))
        (notes::provenance(source, details, None))
    };
    let head = parts::head(source, details, parts, lang);
    page(source, &head, &main, "parts.json")
}

/// The head of a page without scripts that shows pictures from `images` only.
pub(crate) fn page_head(title: &str, images: &str, style: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta http-equiv="Content-Security-Policy"
                content={ "default-src 'none'; style-src 'unsafe-inline'; img-src " (images) };
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="generator" content={ "study " (env!("CARGO_PKG_VERSION")) };
            title { (title) }
            style { (PreEscaped(style)) }
        }
    }
}

fn page(source: &Source, head: &Markup, main: &Markup, values: &str) -> String {
    let page = html! {
        (DOCTYPE)
        // The report itself is in English; texts of the study carry their own `lang`.
        html lang="en" {
            (page_head(&format!("{} – results", safe(&source.title)), "data:", CSS))
            body {
                (head)
                main { (main) }
                footer {
                    "Written by study " (env!("CARGO_PKG_VERSION"))
                    ". All numbers are in " (values) " by identifier, figures and their data in figures/."
                }
            }
        }
    };
    let mut text = page.into_string();
    text.push('\n');
    text
}

/// Text from the data.
fn safe(text: &str) -> String {
    Untrusted(text).to_string()
}

/// An escaped sentence that does not break around `=` and `<` or before `%`.
fn typeset(text: &str) -> String {
    safe(text)
        .replace(" = ", "\u{a0}=\u{a0}")
        .replace(" < ", "\u{a0}<\u{a0}")
        .replace(" > ", "\u{a0}>\u{a0}")
        .replace(" %", "\u{a0}%")
        .replace("% CI [", "%\u{a0}CI\u{a0}[")
}

/// Text from the data that may have several lines.
fn lines(text: &str) -> Markup {
    html! {
        @for (i, line) in text.lines().enumerate() {
            @if i > 0 { br; }
            (safe(line))
        }
    }
}

/// Whether a text has the form of a language tag, so that it may go into `lang`.
fn is_tag(tag: &str) -> bool {
    (2..=35).contains(&tag.len()) && tag.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
}

fn head(source: &Source, details: &Details, a: &Analysis, lang: Option<&str>) -> Markup {
    let c = &a.counts;
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
                @match c.planned {
                    Some(planned) => {
                        span {
                            (c.finished) " of "
                            (counted(planned as usize, "planned participant", "planned participants"))
                            " finished"
                        }
                        @if c.participants != c.finished { " " span { (c.participants) " analyzed" } }
                    },
                    None => {
                        span { (counted(c.participants, "participant", "participants")) }
                        @if c.with_ratings < c.participants { " " span { (c.with_ratings) " gave ratings" } }
                    },
                }
                " "
                span { (counted(c.rated, "rating", "ratings")) } " "
                @if !a.realizations.is_empty() {
                    span { (counted(a.realizations.len(), "realization", "realizations")) }
                }
            }
            @if let Some(search) = &source.confirms {
                p { (safe(&crate::confirmation::sentence(search))) }
            }
            (notes::banners(a))
        }
    }
}

fn answers_section(a: &Analysis) -> Markup {
    let all = answers(a);
    html! {
        section {
            h2 { "Answers" }
            @if a.counts.rated == 0 {
                p { "No rating is included: there is nothing to analyze. See “Included and excluded data”." }
            } @else if all.is_empty() {
                p { "The data do not allow an answer to any question of the study; see the tables." }
            }
            @for answer in &all {
                h3 { (safe(&answer.question)) }
                p.short { (typeset(&answer.short)) }
                @for line in answer.main.iter().chain(&answer.more) { p { (typeset(line)) } }
            }
        }
    }
}

/// Results that hold for these realizations only, set apart.
fn conditional_section(a: &Analysis) -> Markup {
    let (rows, _) = conditional(a);
    html! {
        @if !rows.is_empty() {
            section.apart {
                h2 { "For these realizations only" }
                p.warning {
                    "These analyses treat the realizations as fixed and do not generalize to others: \
                     where realizations differ for reasons other than VAF, such tests found an effect \
                     of VAF that did not exist in up to half of simulated studies. None of them answers \
                     whether VAF predicts realism."
                }
                ul { @for row in &rows { li { (typeset(row)) } } }
            }
        }
    }
}

/// The sites of a pooled analysis.
fn sites(all: &[Site]) -> Markup {
    html! {
        @if !all.is_empty() {
            section { h2 { "Sites" } (tables::table(&crate::tables::sites(all))) }
        }
    }
}

/// Figures, numbered from the one after `before`.
fn figures_section(figures: &[Drawn], before: usize) -> Markup {
    html! {
        @if !figures.is_empty() {
            section.figures {
                h2 { "Figures" }
                @for (i, f) in figures.iter().enumerate() { (figure(f, before + i + 1)) }
            }
        }
    }
}

fn figure(f: &Drawn, number: usize) -> Markup {
    html! {
        figure {
            div.wide { (PreEscaped(f.wide.to_svg())) }
            div.narrow { (PreEscaped(f.narrow.to_svg())) }
            figcaption {
                // The space is outside, so that the line may break there.
                b { "Figure " (number) ". " } (typeset(&f.caption)) " "
                span.file { "figures/" (f.name) ".pdf, .svg, .png, .csv" }
            }
        }
    }
}
