//! Everything that was computed, by identifier, and what was not and why.

use super::safe;
use crate::report::apa;
use maud::{Markup, html};
use study_core::analyze::{Analysis, Value};

/// Most statistics that are listed.
const MAX_LISTED: usize = 2000;

/// Longest list that is shown.
const MAX_LIST: usize = 40;

pub(super) fn section(a: &Analysis) -> Markup {
    let (mut defined, mut undefined) = (Vec::new(), Vec::new());
    for (id, value) in a.values.iter() {
        match value {
            Value::Number(x) => defined.push((id, apa::plain(*x))),
            Value::List(x) => defined.push((id, list(x))),
            Value::Undefined(why) => undefined.push((id, why.as_str())),
        }
    }
    html! {
        section {
            h2 { "All statistics" }
            p.note { "By the identifiers of docs/statistics.md; unrounded in values.json." }
            @if !undefined.is_empty() {
                details {
                    summary { (undefined.len()) " not defined, with reasons" }
                    div.scroll tabindex="0" role="region" aria-label="Statistics that are not defined" {
                        table {
                            thead { tr {
                                th scope="col" { "statistic" } th.text scope="col" { "why it is not defined" }
                            } }
                            tbody {
                                @for (id, why) in undefined.iter().take(MAX_LISTED) {
                                    tr { td { code { (safe(id)) } } td.text { (safe(why)) } }
                                }
                            }
                        }
                    }
                    (rest(undefined.len()))
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
                (rest(defined.len()))
            }
        }
    }
}

fn list(x: &[f64]) -> String {
    let shown: Vec<String> = x.iter().take(MAX_LIST).map(|x| apa::plain(*x)).collect();
    let more = if x.len() > MAX_LIST { " …" } else { "" };
    format!("{}{more}", shown.join(" "))
}

fn rest(n: usize) -> Markup {
    html! {
        @if n > MAX_LISTED {
            p.note { (n - MAX_LISTED) " more are in values.json." }
        }
    }
}
