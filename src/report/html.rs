//! The report: one HTML file that needs nothing else.
//!
//! No script, no reference to anything outside (the content security policy in
//! its head forbids both), dark on white, for screens, phones and A4. Everything
//! from the data is text: maud escapes it, and [`Untrusted`] shows control and
//! bidirectional characters as what they are.
//!
//! Every number is read from the analysis by its identifier. What is absent is
//! left out, what is undefined is listed with its reason.

mod answers;
mod methods;
mod notes;
mod prose;
mod statistics;
mod style;
mod tables;

use super::Source;
use super::figures::Drawn;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use study_base::text::Untrusted;
use study_core::analyze::Analysis;

/// What the report says of a study beyond its analysis. All text is untrusted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Details {
    /// BCP 47 tag of the texts of the study.
    pub lang: Option<String>,
    /// Who made the study.
    pub authors: Vec<String>,
    /// What the participants were asked.
    pub prompt: Option<String>,
    /// Words at places of the scale.
    pub labels: Vec<(f64, String)>,
    /// Name and value: of the design, the device, the ethics; for the notes.
    pub facts: Vec<(String, String)>,
    /// How often each realization was felt, as planned.
    pub repetitions: Option<u32>,
    /// How orders were made, as the protocol calls it.
    pub order: Option<String>,
    /// How many participants are in which state.
    pub states: Vec<(String, usize)>,
    /// Sentences on how the sessions were run, for the methods.
    pub conduct: Vec<String>,
    /// What the participants did before each trial.
    pub reference: Option<String>,
    /// Kind of the device.
    pub device: Option<String>,
    /// Seed of the study's randomness.
    pub seed: Option<u64>,
    /// Versions of this program that the sessions were run with.
    pub tools: Vec<String>,
    /// Name and value of each fingerprint of the newest version.
    pub fingerprints: Vec<(String, String)>,
    /// Versions of the protocol: number, when, why.
    pub versions: Vec<(u32, String, String)>,
}

/// The whole document.
pub fn document(source: &Source, details: &Details, a: &Analysis, figures: &[Drawn]) -> String {
    let lang = details.lang.as_deref().filter(|l| is_tag(l));
    let page = html! {
        (DOCTYPE)
        // The report's own words are English; texts of the study carry `lang`.
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy"
                    content="default-src 'none'; style-src 'unsafe-inline'; img-src data:";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content={ "study " (env!("CARGO_PKG_VERSION")) };
                title { (safe(&source.title)) " – results" }
                style { (PreEscaped(style::CSS)) }
            }
            body {
                (head(source, details, a, lang))
                main {
                    (answers::section(a))
                    (figures_section(figures))
                    (tables::section(a))
                    (prose::section(details, a))
                    (answers::only_these(a))
                    (notes::comments(a, lang))
                    (notes::exclusions(a, source.study.is_some()))
                    (statistics::section(a))
                    (notes::provenance(source, details, a))
                }
                footer {
                    "Written by study " (env!("CARGO_PKG_VERSION"))
                    ". Every number is in values.json by its identifier; figures and their data are in figures/."
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

/// A sentence, whose lines break neither around a sign of equality or comparison nor
/// before a per cent sign.
fn typeset(text: &str) -> String {
    safe(text)
        .replace(" = ", "\u{a0}=\u{a0}")
        .replace(" < ", "\u{a0}<\u{a0}")
        .replace(" %", "\u{a0}%")
        .replace("% CI [", "%\u{a0}CI\u{a0}[")
}

/// Text from the data that may have lines.
fn lines(text: &str) -> Markup {
    html! {
        @for (i, line) in text.lines().enumerate() {
            @if i > 0 { br; }
            (safe(line))
        }
    }
}

/// Whether it looks like a language tag: nothing else goes into `lang`.
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
                            (super::apa::counted(planned as usize, "planned participant", "planned participants"))
                            " finished"
                        }
                        @if c.participants != c.finished { " " span { (c.participants) " analysed" } }
                    },
                    None => span { (super::apa::counted(c.participants, "subject", "subjects")) },
                }
                " "
                span { (super::apa::counted(c.rated, "rating", "ratings")) } " "
                @if !a.realizations.is_empty() {
                    span { (super::apa::counted(a.realizations.len(), "realization", "realizations")) }
                }
            }
            (notes::banners(a))
        }
    }
}

fn figures_section(figures: &[Drawn]) -> Markup {
    html! {
        @if !figures.is_empty() {
            section {
                h2 { "Figures" }
                @for (i, f) in figures.iter().enumerate() {
                    figure {
                        div.wide { (PreEscaped(f.wide.to_svg())) }
                        div.narrow { (PreEscaped(f.narrow.to_svg())) }
                        figcaption {
                            b { "Figure " (i + 1) ". " } (typeset(&f.caption))
                            span.file { " figures/" (f.name) ".svg, .png, .csv" }
                        }
                    }
                }
            }
        }
    }
}
