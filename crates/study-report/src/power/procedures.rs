//! Procedures beside each other: page and document.

use super::precision::{
    Candidate, KINDS, Wanted, half_width, has_ratios, known, sentences, typical, value,
    wanted_values,
};
use super::{Report, document as of_report};
use crate::apa;
use crate::text::Page;
use crate::text::layout::{Paint, pad, wrap};
use serde_json::{Value, json};
use study_analysis::power::{Alternative, Cell, Precision};
use study_base::text::Untrusted;

/// A procedure with what was simulated of it.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The procedure.
    pub alternative: Alternative,
    /// Its results; its plan is that of the alternative.
    pub report: Report,
}

/// A design of a procedure.
struct Row<'a> {
    of: &'a Compared,
    cell: Cell,
    precision: &'a Precision,
    minutes: f64,
}

impl Row<'_> {
    fn trials(&self) -> f64 {
        self.precision.trials.mean().unwrap_or_default()
    }

    fn name(&self) -> String {
        let procedure = self.of.alternative.procedure.as_str();
        format!(
            "{procedure}, {} trials ({} min) each",
            apa::number(self.trials(), 1),
            apa::number(self.minutes, 1)
        )
    }

    /// What is learned of a participant's threshold in a minute, 1/(mean square error · minutes), for each
    /// analysis, with its relative Monte Carlo error.
    fn per_minute(&self) -> [Option<(f64, f64)>; 2] {
        KINDS.map(|(_, of)| {
            let square = &of(self.precision).participant.square;
            let (mean, error) = (square.mean()?, square.error()?);
            (mean > 0.0 && self.minutes > 0.0).then(|| (1.0 / (mean * self.minutes), error / mean))
        })
    }
}

fn rows(all: &[Compared]) -> Vec<Row<'_>> {
    let mut found = Vec::new();
    for one in all {
        for (cell, precision) in known(&one.report) {
            let minutes = one
                .alternative
                .minutes(precision.trials.mean().unwrap_or_default());
            found.push(Row {
                of: one,
                cell,
                precision,
                minutes,
            });
        }
    }
    found
}

/// What is learned in a minute, against the first row, with Monte Carlo errors that leave out that both rows
/// have the same participants, so that they are too large rather than too small.
fn relative(row: &Row<'_>, first: &Row<'_>) -> [Option<(f64, f64)>; 2] {
    let (own, of_first) = (row.per_minute(), first.per_minute());
    let one = |k: usize| {
        let ((a, ea), (b, eb)) = (own[k]?, of_first[k]?);
        let is_first = row.of.alternative.procedure == first.of.alternative.procedure
            && row.of.alternative.asked == first.of.alternative.asked
            && row.cell == first.cell;
        let error = if is_first {
            0.0
        } else {
            (ea * ea + eb * eb).sqrt()
        };
        Some((a / b, a / b * error))
    };
    [one(0), one(1)]
}

fn candidates<'a>(rows: &[Row<'a>]) -> Vec<Candidate<'a>> {
    (rows.iter())
        .map(|row| Candidate {
            cell: row.cell,
            precision: row.precision,
            cost: row.minutes,
            name: row.name(),
        })
        .collect()
}

/// The page.
pub fn compared(all: &[Compared], wanted: &[Wanted], page: Page) -> String {
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let rows = rows(all);
    let (Some(first), Some(ratios)) = (
        rows.first(),
        all.first().and_then(|a| has_ratios(&a.report)),
    ) else {
        return String::new();
    };
    let mut out = paint.dim(&format!(
        "\n{:<11}{:>7}{:>7}{:>6}  {:<15}{:<14}  {:<15}{}\n",
        "procedure",
        "partic.",
        "trials",
        "min",
        "alone: error",
        "per minute",
        "together: error",
        "per minute"
    ));
    for row in &rows {
        let [alone, together] =
            KINDS.map(|(_, of)| typical(&of(row.precision).participant, ratios));
        let [own, pooled] = relative(row, first).map(|found| {
            found.map_or(String::new(), |(x, error)| match error > 0.0 {
                true => format!("{} ± {}", apa::number(x, 2), apa::number(error, 2)),
                false => apa::number(x, 2),
            })
        });
        out += &start(row);
        out += &format!(
            "  {}{}  {}{pooled}",
            pad(&alone, 15),
            pad(&own, 14),
            pad(&together, 15)
        );
        out = out.trim_end().to_owned() + "\n";
    }
    let test = (first.of.report.plan.settings.tests.first()).map_or("", |t| t.as_str());
    out += &paint.dim(&format!(
        "\n{:<11}{:>7}{:>7}{:>6}  {:<13}{:<10}{:<10}{:<10}{}\n",
        "95 % within",
        "partic.",
        "trials",
        "min",
        "participant",
        "together",
        "mean",
        "contrast",
        test
    ));
    for row in &rows {
        let half = |quality: &study_analysis::power::Quality| {
            let half = quality.half.mean();
            half.map_or("–".to_owned(), |half| half_width(half, ratios))
        };
        let (alone, together) = (&row.precision.alone, &row.precision.together);
        let tests = row.of.report.result(&row.cell).map(|r| r.tests.as_slice());
        let power = tests.and_then(<[_]>::first).map_or(String::new(), |test| {
            format!(
                "{} ± {}",
                apa::share(test.power, 3),
                apa::share(test.mcse, 3)
            )
        });
        out += &start(row);
        out += &format!(
            "  {}{}{}{}{power}",
            pad(&half(&alone.participant), 13),
            pad(&half(&together.participant), 10),
            pad(&half(&alone.mean), 10),
            pad(&half(&alone.contrast), 10),
        );
        out = out.trim_end().to_owned() + "\n";
    }
    let studies = first.of.report.plan.settings.studies;
    let notes = format!(
        "{studies} simulated studies of each, with the same participants. per minute: what a minute of a \
         participant's time tells of their threshold, 1/(mean square error · minutes), against the first line; \
         minutes of the part by the estimate of study check. {}",
        super::precision::legend(&first.of.report).unwrap_or_default()
    );
    out += &paint.dim(&wrap(&notes, width, "", ""));
    for sentence in sentences(wanted, ratios, &candidates(&rows)) {
        out += &wrap(&sentence, width, "  ", "    ");
    }
    out.push('\n');
    for warning in warnings(all) {
        out += &paint.warn(&wrap(&Untrusted(&warning).to_string(), width, "! ", "  "));
    }
    out
}

fn start(row: &Row<'_>) -> String {
    format!(
        "{:<11}{:>7}{:>7}{:>6}",
        row.of.alternative.procedure.as_str(),
        row.cell.participants,
        apa::number(row.trials(), 1),
        apa::number(row.minutes, 1),
    )
}

/// The warnings of all, each once.
fn warnings(all: &[Compared]) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for warning in all.iter().flat_map(|one| one.report.warnings()) {
        if !found.contains(&warning) {
            found.push(warning);
        }
    }
    found
}

/// The document, `study-power-procedures/1`.
pub fn compared_document(all: &[Compared], wanted: &[Wanted]) -> Value {
    let rows = rows(all);
    let ratios = all.first().and_then(|one| has_ratios(&one.report));
    let row = |row: &Row<'_>| {
        let [alone, together] = match rows.first() {
            Some(first) => relative(row, first),
            None => [None, None],
        };
        let of = |found: Option<(f64, f64)>| found.map(|f| json!({ "relative": f.0, "mcse": f.1 }));
        let result = row.of.report.result(&row.cell);
        let power = result.and_then(|r| r.tests.first());
        json!({
            "procedure": row.of.alternative.procedure.as_str(),
            "trials_asked": row.of.alternative.asked,
            "participants": row.cell.participants,
            "minutes": row.minutes,
            "precision": value(row.precision),
            "per_minute": { "alone": of(alone), "together": of(together) },
            "test": power.map(|t| json!({
                "test": t.test.as_str(), "power": t.power, "mcse": t.mcse,
                "low": t.interval.0, "high": t.interval.1, "studies": t.studies,
            })),
        })
    };
    let first = all.first().map(|one| of_report(&one.report));
    let of_first = |key: &str| first.as_ref().map_or(Value::Null, |f| f[key].clone());
    json!({
        "format": "study-power-procedures/1",
        "study": of_first("study"),
        "title": of_first("title"),
        "version": env!("CARGO_PKG_VERSION"),
        "part": of_first("part"),
        "assumptions": of_first("assumptions"),
        "designs": rows.iter().map(row).collect::<Vec<_>>(),
        "wanted": wanted_values(wanted, ratios.unwrap_or(false), &candidates(&rows)),
        "warnings": warnings(all),
    })
}
