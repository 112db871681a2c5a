//! The page about the physical checks of a device, for the file of the laboratory.

use chrono::{DateTime, FixedOffset};
use maud::{DOCTYPE, html};
use serde::Serialize;
use study_base::text::Untrusted;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// As required.
    Passed,
    /// Not as required.
    Failed,
    /// Left out.
    NotDone,
}

impl Outcome {
    /// The word for people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::NotDone => "not done",
        }
    }
}

/// A step and what was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// What was checked.
    pub what: &'static str,
    /// What is required.
    pub required: String,
    /// What was found. Untrusted: the device has a part in it.
    pub seen: String,
    /// How it ended.
    pub outcome: Outcome,
}

/// What the page says.
#[derive(Debug, Clone, Copy)]
pub struct Page<'a> {
    /// Serial number. Untrusted.
    pub serial: &'a str,
    /// Version of the firmware. Untrusted.
    pub firmware: Option<&'a str>,
    /// Whether the device is simulated.
    pub simulated: bool,
    /// Who did it. Untrusted.
    pub operator: &'a str,
    /// When it ended.
    pub at: DateTime<FixedOffset>,
    /// The steps.
    pub steps: &'a [Step],
    /// Whether all were passed.
    pub pass: bool,
}

/// The page, one self-contained file.
pub fn page(p: &Page<'_>) -> String {
    let safe = |text: &str| Untrusted(text).to_string();
    let title = format!("Physical checks of device {}", safe(p.serial));
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy"
                    content="default-src 'none'; style-src 'unsafe-inline'";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style {
                    "body{font:16px/1.5 sans-serif;max-width:50em;margin:2em auto;padding:0 1em;color:#111;background:#fff}"
                    "table{border-collapse:collapse;width:100%}td,th{border:1px solid #666;padding:.4em;text-align:left;vertical-align:top}"
                    ".simulated{border:3px solid #a00;padding:.5em}"
                    "@page{size:A4;margin:20mm}"
                }
            }
            body {
                main {
                    h1 { (title) }
                    @if p.simulated {
                        p.simulated { strong { "SIMULATED." } " No device was there and nothing was measured." }
                    }
                    p {
                        "Firmware " (p.firmware.map_or("not told".to_owned(), safe)) ", "
                        (p.at.format("%Y-%m-%d %H:%M %:z").to_string())
                        @if !p.operator.is_empty() { ", by " (safe(p.operator)) }
                        "."
                    }
                    p { strong { (if p.pass { "All steps passed." } else { "Not all steps passed." }) } }
                    table {
                        thead { tr { th scope="col" { "step" } th scope="col" { "required" } th scope="col" { "found" } th scope="col" { "result" } } }
                        tbody {
                            @for step in p.steps {
                                tr {
                                    th scope="row" { (step.what) }
                                    td { (step.required) }
                                    td { (safe(&step.seen)) }
                                    td { (step.outcome.as_str()) }
                                }
                            }
                        }
                    }
                    p { "Signature: ______________________________" }
                    p { small { "Written by study " (env!("CARGO_PKG_VERSION")) ". Telemetry can show none of this; `study device check` shows the rest." } }
                }
            }
        }
    }
    .into_string()
        + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_what_was_found_and_escapes_it() {
        let steps = [Step {
            what: "ruler",
            required: "scale within 2 %".to_owned(),
            seen: "<b>scale 0.500".to_owned(),
            outcome: Outcome::Failed,
        }];
        let made = page(&Page {
            serial: "A<1",
            firmware: Some("f1"),
            simulated: true,
            operator: "LW",
            at: DateTime::parse_from_rfc3339("2026-01-02T03:04:05+01:00").unwrap(),
            steps: &steps,
            pass: false,
        });
        for text in [
            "A&lt;1",
            "SIMULATED",
            "2026-01-02 03:04",
            "&lt;b&gt;scale 0.500",
            "FAILED",
            "Not all steps",
        ] {
            assert!(made.contains(text), "{text}: {made}");
        }
    }
}
