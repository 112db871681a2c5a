//! The figures of an identification on one page, with what the command printed.

use super::Drawing;
use crate::chart::{Figure, Mark};
use crate::html::{CSS, page_head};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use study_base::text::Untrusted;

/// Width of a figure on a phone, px.
const NARROW: f64 = 370.0;

const STYLE: &str = "
pre { overflow-x: auto; font: .8rem/1.35 'Liberation Mono', 'DejaVu Sans Mono', Menlo, monospace; overflow-wrap: normal; }
.scroll svg { min-width: 44rem; }
@media print { pre { white-space: pre-wrap; font-size: 6pt; } .scroll svg { min-width: 0; } }";

/// A self-contained page without scripts. `printed` is the text of the command; all text is untrusted.
pub fn page(title: &str, printed: &str, drawings: &[Drawing]) -> String {
    let title = Untrusted(title).to_string();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&title, "data:", &(CSS.to_owned() + STYLE)))
            body {
                header { h1 { (title) } }
                main {
                    section {
                        h2 { "Figures" }
                        @for drawing in drawings { (figure(drawing)) }
                    }
                    section {
                        h2 { "What study identify printed" }
                        pre tabindex="0" role="region" aria-label="Printed text" { (lines(printed)) }
                    }
                }
                footer { "Written by study " (env!("CARGO_PKG_VERSION")) "." }
            }
        }
    };
    page.into_string() + "\n"
}

/// The text with its line breaks, everything else escaped.
fn lines(text: &str) -> String {
    let lines: Vec<String> = text
        .lines()
        .map(|line| Untrusted(line).to_string())
        .collect();
    lines.join("\n")
}

fn figure(drawing: &Drawing) -> Markup {
    html! {
        figure {
            @match narrow(&drawing.figure) {
                Some(narrow) => {
                    div.wide { (PreEscaped(drawing.figure.picture().to_svg())) }
                    div.narrow { (PreEscaped(narrow.picture().to_svg())) }
                }
                None => {
                    div.scroll tabindex="0" role="region" aria-label=(drawing.figure.title) {
                        (PreEscaped(drawing.figure.picture().to_svg()))
                    }
                }
            }
            figcaption {
                (Untrusted(&drawing.figure.title).to_string()) ". "
                span.file { (drawing.name) ".pdf, .svg, .png, .csv" }
            }
        }
    }
}

/// The figure for a phone, its panels below each other; `None` if numbers in its cells need the width.
fn narrow(figure: &Figure) -> Option<Figure> {
    let has_numbers = |mark: &Mark| matches!(mark, Mark::Heat { .. });
    let crowded = (figure.panels.iter())
        .any(|panel| !panel.notes.is_empty() && panel.series.iter().any(|s| has_numbers(&s.mark)));
    (!crowded).then(|| Figure {
        id: format!("{}-n", figure.id),
        width: NARROW,
        height: figure.height * figure.columns as f64,
        columns: 1,
        ..figure.clone()
    })
}
