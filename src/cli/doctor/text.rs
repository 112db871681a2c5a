//! Numbers, findings and verdicts for people.

use crate::doctor::{Finding, Fit, Judgement, Measured, Spread, Use};
use crate::tui::wrap::wrap;
use study_base::text::Untrusted;

/// Width of the first column of the table.
const LABEL: usize = 38;

/// Everything, in lines of at most `width` cells; as long as they are without.
pub(super) fn page(measured: &Measured, judgement: &Judgement, width: Option<usize>) -> String {
    let mut out = table(measured);
    out.push('\n');
    for finding in &judgement.findings {
        out.push_str(&found(finding, width));
    }
    out.push('\n');
    for verdict in &judgement.verdicts {
        let mut line = format!("{:<34} {}", verdict.purpose.as_str(), verdict.fit.as_str());
        if !verdict.because.is_empty() {
            line.push_str(&format!(": {}", verdict.because.join(", ")));
        }
        if verdict.purpose == Use::Serial && measured.device.is_none() {
            line.push_str(" (no device was measured: --port PATH names one)");
        }
        out.push_str(&lines(&line, "", width));
    }
    out
}

/// The times, one row each.
fn table(measured: &Measured) -> String {
    let timing = &measured.timing;
    let mut rows: Vec<(String, Option<Spread>)> = Vec::new();
    for (when, lateness) in [("idle", timing.quiet), ("saving", timing.saving)] {
        rows.push((
            format!("wait of 1 ms, late, {when}"),
            lateness.map(|l| l.turn),
        ));
        rows.push((
            format!("heartbeat, late, {when}"),
            lateness.map(|l| l.heartbeat),
        ));
        rows.push((format!("screen, late, {when}"), lateness.map(|l| l.screen)));
    }
    rows.push((
        "record in the journal, synced".to_owned(),
        measured.disk.journal,
    ));
    rows.push(("head.json, replaced".to_owned(), measured.disk.head));
    rows.push(("both: until \"saved\"".to_owned(), measured.disk.record));
    if let Some(device) = &measured.device {
        rows.push(("round trip to the device".to_owned(), device.trips));
    }
    let mut out = format!(
        "{:<LABEL$} {:>10} {:>10} {:>10} {:>7}\n",
        "time, ms", "median", "99 %", "largest", "n"
    );
    for (label, spread) in rows {
        out.push_str(&match spread {
            None => format!("{label:<LABEL$} {:>10}\n", "none"),
            Some(s) => format!(
                "{label:<LABEL$} {:>10.3} {:>10.3} {:>10.3} {:>7}\n",
                s.median_ms, s.p99_ms, s.largest_ms, s.n
            ),
        });
    }
    out
}

fn found(finding: &Finding, width: Option<usize>) -> String {
    let mark = match finding.fit {
        Fit::Fit => "ok",
        Fit::WithLimits => "limit",
        Fit::NotMeasured => "open",
        Fit::NotFit => "UNFIT",
    };
    let head = format!("{mark:<6}{:<9} ", finding.about.as_str());
    let mut out = lines(&format!("{head}{}", finding.says), &" ".repeat(16), width);
    if let Some(advice) = &finding.advice {
        let advice = format!("{}{advice}", " ".repeat(16));
        out.push_str(&lines(&advice, &" ".repeat(16), width));
    }
    out
}

/// A paragraph without unsafe characters, its further lines indented.
fn lines(text: &str, indent: &str, width: Option<usize>) -> String {
    let text = Untrusted(text).to_string();
    let Some(width) = width else {
        return format!("{text}\n");
    };
    // What follows the first line is narrower, because it is indented.
    let mut out = String::new();
    let mut rest = text.as_str();
    let mut before = "";
    loop {
        let room = width.saturating_sub(before.len()).max(20);
        let wrapped = wrap(rest, room);
        let Some(first) = wrapped.first() else {
            return out;
        };
        out.push_str(&format!("{before}{}\n", first.shown.trim_end()));
        let Some(next) = wrapped.get(1) else {
            return out;
        };
        rest = rest.get(next.range.start..).unwrap_or_default();
        before = indent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::About;

    #[test]
    fn a_finding_is_wrapped_below_itself_and_hostile_text_is_escaped() {
        let finding = Finding {
            about: About::Device,
            id: "device",
            fit: Fit::NotFit,
            uses: vec![Use::Serial],
            says: "Device \u{1b}[31mX, firmware of many words that need a second line".to_owned(),
            advice: Some("do something about it".to_owned()),
        };
        let shown = found(&finding, Some(50));
        assert!(!shown.contains('\u{1b}'), "{shown:?}");
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines.len() > 2 && lines.iter().all(|line| line.chars().count() <= 50));
        assert!(lines[0].starts_with("UNFIT device    Device"), "{shown}");
        assert!(lines[1].starts_with("                "), "{shown}");
        let words = |text: &str| {
            text.split_whitespace()
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(words(&shown), words(&found(&finding, None)));
    }
}
