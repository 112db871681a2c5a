//! The CSV tables of `analysis/` (RFC 4180). Text is stored as typed.

mod parts;
mod test_table;

pub use parts::part_tables;

use super::Source;
use study_core::analyze::{Analysis, MAX_PAIRED, Value, group_id, pair_id};

/// A file of `analysis/`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableFile {
    /// File name.
    pub name: &'static str,
    /// Content.
    pub content: String,
}

/// The CSV tables and `values.json`.
pub fn tables(source: &Source, analysis: &Analysis) -> Vec<TableFile> {
    let mut tables = vec![
        table("descriptives.csv", descriptives(analysis)),
        table("tests.csv", test_table::rows(analysis)),
        table("correlation.csv", identified(analysis, &CORRELATION)),
        table("pairs.csv", pairs(analysis)),
        table("variance.csv", identified(analysis, &VARIANCE)),
        table("agreement.csv", identified(analysis, &AGREEMENT)),
        table("subjects.csv", subjects(analysis)),
        table("exclusions.csv", exclusions(analysis)),
        table("with_and_without.csv", with_and_without(analysis)),
        table("comments.csv", comments(analysis)),
        table("excluded.csv", excluded(analysis)),
        TableFile {
            name: "ratings_used.csv",
            content: ratings_used(analysis),
        },
        TableFile {
            name: "values.json",
            content: super::json::document(source, analysis),
        },
    ];
    if !analysis.parts.is_empty() {
        tables.extend(part_tables(&analysis.parts));
    }
    tables
}

pub(super) fn table(name: &'static str, rows: Vec<Vec<String>>) -> TableFile {
    TableFile {
        name,
        content: text(&rows),
    }
}

/// Rows of equal length as CSV.
pub(super) fn text(rows: &[Vec<String>]) -> String {
    written(|to| {
        for row in rows {
            to.row(row);
        }
    })
}

/// A table that is written row by row, because it can have millions of rows.
fn written(write: impl FnOnce(&mut Rows)) -> String {
    let mut rows = Rows(
        csv::WriterBuilder::new()
            .terminator(csv::Terminator::CRLF)
            .from_writer(Vec::new()),
    );
    write(&mut rows);
    let bytes = rows
        .0
        .into_inner()
        .expect("writing to memory does not fail");
    String::from_utf8(bytes).expect("all fields are UTF-8")
}

struct Rows(csv::Writer<Vec<u8>>);

impl Rows {
    fn row<T: AsRef<[u8]>>(&mut self, row: impl IntoIterator<Item = T>) {
        self.0
            .write_record(row)
            .expect("all rows have the same length");
    }
}

fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

pub(super) fn number(x: Option<f64>) -> String {
    x.map_or_else(String::new, digits)
}

fn whole(x: Option<u32>) -> String {
    x.map_or_else(String::new, |x| x.to_string())
}

/// All digits of a number; an exponent instead of many zeros.
pub(super) fn digits(x: f64) -> String {
    if x == 0.0 || (1e-5..1e16).contains(&x.abs()) {
        x.to_string()
    } else {
        format!("{x:e}")
    }
}

fn descriptives(a: &Analysis) -> Vec<Vec<String>> {
    const STATISTICS: [&str; 8] = ["n", "mean", "sd", "median", "q1", "q3", "min", "max"];
    const OVER_SUBJECTS: [&str; 6] = ["n", "mean", "sd", "sem", "ci95_lo", "ci95_hi"];
    let v = &a.values;
    let from = v.number("desc_all/hist_from");
    let bins = v.list("desc_all/hist").map_or(0, <[f64]>::len);
    let mut head = cells(["model", "role", "duplicate_of", "vaf"]);
    head.extend(STATISTICS.iter().map(|s| (*s).to_owned()));
    head.extend(OVER_SUBJECTS.iter().map(|s| format!("subject_mean_{s}")));
    head.extend(cells(["cousineau_morey_ci95_half", "share_realistic"]));
    head.extend((0..bins).map(|b| format!("count_{}", digits(from.unwrap_or(0.0) + b as f64))));
    let mut rows = vec![head];
    for m in &a.realizations {
        let desc = group_id("desc", &[&m.id]);
        let get = |name: &str| number(v.number(&format!("{desc}/{name}")));
        let mut row = vec![
            m.id.clone(),
            m.role.as_str().to_owned(),
            m.duplicate_of.clone().unwrap_or_default(),
            number(m.vaf),
        ];
        row.extend(STATISTICS.iter().map(|s| get(s)));
        row.extend(
            OVER_SUBJECTS
                .iter()
                .map(|s| get(&format!("subject_mean/{s}"))),
        );
        row.push(get("cousineau_morey/ci95_half"));
        row.push(number(a.about("realistic", &[&m.id], "share")));
        let hist = v.list(&format!("{desc}/hist")).unwrap_or(&[]);
        row.extend((0..bins).map(|b| number(hist.get(b).copied())));
        rows.push(row);
    }
    rows
}

const CORRELATION: [&str; 7] = [
    "corr",
    "subject_corr",
    "subject_slope",
    "rmcorr_cells",
    "rmcorr_trials",
    "bootstrap",
    "page",
];

const VARIANCE: [&str; 2] = ["variance", "lmm_variance"];

const AGREEMENT: [&str; 4] = [
    "icc_subjects",
    "icc_repetitions",
    "krippendorff_subjects",
    "krippendorff_repetitions",
];

/// The statistics of some groups, one per row.
fn identified(a: &Analysis, groups: &[&str]) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["identifier", "value", "undefined_because"])];
    for (id, value) in a.values.iter() {
        if !groups.iter().any(|g| id.split('/').next() == Some(g)) {
            continue;
        }
        rows.push(match value {
            Value::Number(x) => vec![id.to_owned(), digits(*x), String::new()],
            Value::List(x) => {
                let all: Vec<String> = x.iter().map(|x| digits(*x)).collect();
                vec![id.to_owned(), all.join(" "), String::new()]
            }
            Value::Undefined(why) => vec![id.to_owned(), String::new(), why.clone()],
        });
    }
    rows
}

/// Every pair of realizations, a minus b.
fn pairs(a: &Analysis) -> Vec<Vec<String>> {
    const STATISTICS: [&str; 12] = [
        "mean_diff",
        "t",
        "p_t",
        "p_t_holm",
        "dz",
        "d_av",
        "wilcoxon_n",
        "wilcoxon_Wplus",
        "p_wilcoxon_exact",
        "p_wilcoxon_exact_holm",
        "p_wilcoxon_normal",
        "rank_biserial",
    ];
    let mut rows = vec![cells(["pair"])];
    rows[0].extend(STATISTICS.map(str::to_owned));
    rows[0].extend(cells(["first", "second"]));
    let names: Vec<&str> = a.tested().map(|m| m.id.as_str()).collect();
    for (i, first) in names
        .iter()
        .enumerate()
        .filter(|_| names.len() <= MAX_PAIRED)
    {
        for second in &names[i + 1..] {
            let id = pair_id("posthoc", first, second);
            let get = |s: &str| a.values.number(&format!("{id}/{s}"));
            if get("mean_diff").is_some() {
                let mut row = vec![format!("{first}|{second}")];
                row.extend(STATISTICS.map(|s| number(get(s))));
                row.extend([(*first).to_owned(), (*second).to_owned()]);
                rows.push(row);
            }
        }
    }
    rows
}

/// The included participants; empty if there are too many to list.
fn subjects(a: &Analysis) -> Vec<Vec<String>> {
    const STATISTICS: [&str; 10] = [
        "n",
        "mean",
        "sd",
        "distinct",
        "longest_run",
        "within_cell_sd",
        "leave_one_out_r",
        "hidden_reference_mean",
        "low_anchor_mean",
        "repeat_distance",
    ];
    let mut rows = vec![cells(["subject"])];
    rows[0].extend(STATISTICS.map(str::to_owned));
    rows[0].extend(cells(["r_with_vaf", "slope_on_vaf"]));
    for subject in a.listed_subjects() {
        let mut row = vec![subject.to_owned()];
        row.extend(STATISTICS.map(|s| number(a.about("subject", &[subject], s))));
        row.extend(["r", "slope"].map(|s| number(a.about("subject_corr", &[subject], s))));
        rows.push(row);
    }
    rows
}

/// The effect of each exclusion rule.
fn exclusions(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["rule", "rows", "participants", "problem"])];
    rows.extend(a.exclusions.iter().map(|e| {
        vec![
            e.rule.to_string(),
            e.rows.to_string(),
            e.participants.to_string(),
            e.problem.unwrap_or_default().to_owned(),
        ]
    }));
    rows
}

/// The main results with and without the exclusions.
fn with_and_without(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["identifier", "with", "without"])];
    for (id, value) in a.values.iter() {
        if let (Some(own), Value::Number(x)) = (id.strip_prefix("before_exclusion/"), value) {
            let with = number(a.values.number(own));
            rows.push(vec![own.to_owned(), with, digits(*x)]);
        }
    }
    rows
}

fn comments(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells([
        "model",
        "subject",
        "repetition",
        "question",
        "text",
    ])];
    rows.extend(a.comments.iter().map(|c| {
        vec![
            c.model.clone(),
            c.subject.clone(),
            c.repetition.to_string(),
            c.question.clone(),
            c.text.clone(),
        ]
    }));
    rows
}

fn excluded(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells([
        "subject",
        "model",
        "repetition",
        "rating",
        "reason",
    ])];
    for row in &a.rows {
        if let Some(reason) = &row.excluded {
            rows.push(vec![
                a.subject(row).to_owned(),
                a.model(row).to_owned(),
                row.repetition.to_string(),
                number(row.rating),
                reason.to_string(),
            ]);
        }
    }
    rows
}

fn ratings_used(a: &Analysis) -> String {
    written(|to| {
        to.row([
            "subject",
            "model",
            "repetition",
            "trial_index",
            "rating",
            "vaf",
            "included",
            "reason",
        ]);
        for row in &a.rows {
            let excluded = row.excluded.as_ref().map(|r| r.to_string());
            let reason = match (&excluded, row.rating) {
                (Some(reason), _) => reason,
                (None, None) => "no rating",
                (None, Some(_)) => "",
            };
            to.row([
                a.subject(row),
                a.model(row),
                &row.repetition.to_string(),
                &whole(row.trial_index),
                &number(row.rating),
                &number(row.vaf),
                if reason.is_empty() { "true" } else { "false" },
                reason,
            ]);
        }
        for row in a.practice.iter() {
            to.row([
                row.subject,
                row.model,
                &row.repetition.to_string(),
                &whole(row.trial_index),
                &number(row.rating),
                &number(row.vaf),
                "false",
                "practice",
            ]);
        }
    })
}

#[cfg(test)]
mod tests {
    use super::digits;

    #[test]
    fn digits_read_back_as_the_same_number() {
        for (x, shown) in [
            (0.0, "0"),
            (-4.25, "-4.25"),
            (1e15, "1000000000000000"),
            (0.00001, "0.00001"),
            (1.5e308, "1.5e308"),
            (5e-324, "5e-324"),
            (-1.2e-6, "-1.2e-6"),
        ] {
            assert_eq!(digits(x), shown);
            assert_eq!(digits(x).parse(), Ok(x));
        }
    }
}
