//! All statistics by identifier, and the undefined ones with reasons.

use super::safe;
use crate::apa;
use maud::{Markup, html};
use study_analysis::analyze::{Value, Values};

/// Largest number of statistics that are listed.
const MAX_LISTED: usize = 2000;

/// Largest number of elements that are shown of a list.
const MAX_LIST: usize = 40;

pub(super) fn section(values: &Values) -> Markup {
    html! {
        section {
            h2 { "All statistics" }
            (listing(values, "docs/statistics.md", "values.json"))
        }
    }
}

/// The statistics; `explained` is the document that defines them, `file` has all digits.
pub(super) fn listing(values: &Values, explained: &str, file: &str) -> Markup {
    let (mut defined, mut undefined) = (Vec::new(), Vec::new());
    for (id, value) in values.iter() {
        match value {
            Value::Number(x) => defined.push((id, apa::plain(*x))),
            Value::List(x) => defined.push((id, list(x))),
            Value::Undefined(why) => undefined.push((id, why.as_str())),
        }
    }
    html! {
            p.note { "Identifiers are explained in " (explained) "; " (file) " has unrounded values." }
            @if !undefined.is_empty() {
                details {
                    summary { (undefined.len()) " undefined, with reasons" }
                    div.scroll tabindex="0" role="region" aria-label="Undefined statistics" {
                        table {
                            thead { tr {
                                th scope="col" { "statistic" } th.text scope="col" { "reason" }
                            } }
                            tbody {
                                @for (id, why) in undefined.iter().take(MAX_LISTED) {
                                    tr { td { code { (safe(id)) } } td.text { (safe(why)) } }
                                }
                            }
                        }
                    }
                    (rest(undefined.len(), file))
                }
            }
            details {
                summary { (defined.len()) " values" }
                div.scroll tabindex="0" role="region" aria-label="Statistics" {
                    table {
                        thead { tr { th scope="col" { "statistic" } th scope="col" { "value" } } }
                        tbody {
                            @for (id, value) in defined.iter().take(MAX_LISTED) {
                                tr { td { code { (safe(id)) } } td { (value) } }
                            }
                        }
                    }
                }
                (rest(defined.len(), file))
            }
    }
}

fn list(x: &[f64]) -> String {
    let shown: Vec<String> = x.iter().take(MAX_LIST).map(|x| apa::plain(*x)).collect();
    let more = if x.len() > MAX_LIST { " …" } else { "" };
    format!("{}{more}", shown.join(" "))
}

fn rest(n: usize, file: &str) -> Markup {
    html! {
        @if n > MAX_LISTED {
            p.note { (n - MAX_LISTED) " more are in " (file) "." }
        }
    }
}
