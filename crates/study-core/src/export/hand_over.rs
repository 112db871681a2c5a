//! The tables with an R script and a Quarto document, which come to the numbers of
//! `study analyze`.

use super::table::{Field, Type, clean};
use super::{Dialect, ExportError, Job, delimited, readme, telemetry};
use crate::analyze::psychophysics::{LevelData, PartAnalysis, StudyData, parts};
use crate::analyze::{Analysis, Include, Rules, analyze, group_id};
use crate::outcome::cell::Cell;
use crate::outcome::ratings::Ratings;
use crate::protocol::columns::UsedColumn;
use crate::protocol::parts::Task;
use sha2::{Digest as _, Sha256};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// The script. Lines that begin with `#'` are the text of the document. No text of a
/// study is in it: it reads all of them from the tables.
const SCRIPT: &str = include_str!("analysis.R");

/// Most realizations with a VAF of which R goes through every permutation.
const MAX_PERMUTED: f64 = 8.0;

pub(super) fn write(job: &mut Job<'_>) -> Result<(), ExportError> {
    let dialect = Dialect::default();
    let mut tables = job.tables.clone();
    let analysis = analysis(job);
    let parts = parts_of(job);
    if analysis.is_some() || !parts.is_empty() {
        mark(job, analysis.as_ref(), &parts, &mut tables.ratings);
    }
    let mut files = Vec::new();
    let mut sums = Vec::new();
    for table in tables.all() {
        let path = format!("{}.csv", table.name);
        let bytes = delimited::csv(table, &dialect);
        job.file(&path, &bytes)?;
        sums.push((path, sha256(&bytes)));
        files.push(readme::listed(table));
    }
    let all: Vec<_> = tables.all().collect();
    job.file("dictionary.csv", &delimited::dictionary(&all, &dialect))?;
    job.file("labels.csv", &delimited::labels(&all, &dialect))?;
    let thresholds = thresholds(&parts);
    if !thresholds.is_empty() {
        let head = ["part", "participant", "track", "threshold"].map(str::to_owned);
        let lines = std::iter::once(head).chain(thresholds);
        let lines = lines.map(|line| line.map(Cow::Owned).to_vec());
        let bytes = delimited::lines(lines, &dialect);
        job.file("thresholds.csv", &bytes)?;
        sums.push(("thresholds.csv".to_owned(), sha256(&bytes)));
        files.push((
            "thresholds.csv".to_owned(),
            "the threshold of each participant on each track, a posterior mean of `study analyze`",
        ));
    }
    let question = analysis.as_ref().map_or("", |a| a.question.as_str());
    let settings = settings(job, question, &parts, &sums);
    job.file("settings.csv", &settings)?;
    let mut headline = analysis.as_ref().map_or_else(Vec::new, headline);
    headline.extend(parts.iter().flat_map(headline_of_part));
    let head = ["id", "value", "tolerance"].map(Cow::Borrowed).to_vec();
    let lines = headline.into_iter().map(|(id, value, tolerance)| {
        vec![
            id.into(),
            value.map_or_else(String::new, |v| v.to_string()).into(),
            tolerance.into(),
        ]
    });
    let bytes = delimited::lines(std::iter::once(head).chain(lines), &dialect);
    job.file("headline.csv", &bytes)?;
    job.file("analysis.R", SCRIPT.as_bytes())?;
    job.file("analysis.qmd", document(SCRIPT).as_bytes())?;
    telemetry::by_session(job, |job, session| {
        let path = format!("telemetry/{}-{}.csv", session.participant, session.session);
        job.file(&path, &session.bytes)
    })?;
    job.protocol("protocol")?;
    for (path, what) in [
        ("dictionary.csv", "what the columns mean"),
        ("labels.csv", "the labels of values, in their order"),
        (
            "settings.csv",
            "the question, and the SHA-256 of the tables",
        ),
        (
            "headline.csv",
            "the main numbers of `study analyze`, with the tolerance of the comparison",
        ),
        (
            "analysis.R",
            "reads the tables and compares its numbers: `Rscript analysis.R`",
        ),
        ("analysis.qmd", "the same as a Quarto document"),
        ("protocol/", "the protocol and its realizations"),
    ] {
        files.push((path.to_owned(), what));
    }
    let text = readme::readme(job, &files, &[]);
    job.file("README.md", text.as_bytes())?;
    let changes = readme::changes(job);
    job.file("CHANGES.md", changes.as_bytes())
}

fn sha256(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(bytes) {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// The analysis of the exported rows; `None` if the primary question has no numbers or
/// nothing was rated.
fn analysis(job: &Job<'_>) -> Option<Analysis> {
    let protocol = job.source.protocol;
    let question = protocol.primary().filter(|q| q.kind.is_number())?;
    let mut ratings = Ratings::from_rows(&job.selected.rows, &question.id, None);
    ratings.set_states(&job.selected.participants);
    ratings.set_duplicates(protocol.models.iter().filter_map(|m| {
        let original = m.duplicate_of.as_ref()?;
        Some((m.id.as_str(), original.as_str()))
    }));
    // All rows are of one kind, whichever it is.
    let include = Include {
        pilot: true,
        simulated: true,
    };
    let rules = Rules::of(protocol, question.id.as_str(), include);
    (!ratings.is_empty()).then(|| analyze(&ratings, &rules))
}

/// The analyses of the parts of pairs and tracks. Of a part that several sessions have, the
/// tracks of each session are conditions of their own, which R does not repeat.
fn parts_of(job: &Job<'_>) -> Vec<PartAnalysis> {
    let study = StudyData {
        protocol: job.source.protocol,
        rows: &job.selected.rows,
        intervals: &job.selected.intervals,
        participants: &job.selected.participants,
        // Only the course of tracks follows from them.
        sessions: &[],
    };
    let include = Include {
        pilot: true,
        simulated: true,
    };
    let mut found = parts(&study, include);
    let protocol = job.source.protocol;
    found.retain(|own| {
        let task = protocol.part(&own.part).map(|p| &p.task);
        matches!(task, Some(Task::Pairs(_) | Task::Discrimination { .. }))
            && protocol.sessions.len() < 2
            && own.trials > 0
    });
    found
}

/// Adds whether the analysis used each row, and why not.
fn mark(
    job: &Job<'_>,
    analysis: Option<&Analysis>,
    parts: &[PartAnalysis],
    table: &mut super::table::Table<'_>,
) {
    let in_parts: BTreeSet<_> = parts.iter().flat_map(|part| &part.used).collect();
    let mut decisions = analysis.map_or(&[][..], |a| &a.rows[..]).iter();
    // The analysis has a row for each rating of a realization that is no practice.
    let used: Vec<Option<Option<String>>> = (job.selected.rows.iter())
        .map(|row| {
            let rated = row.model.is_some() && row.track.is_none() && !row.practice;
            let decision = if rated { decisions.next() } else { None };
            let place = (row.participant.clone(), row.session, row.trial);
            match decision {
                Some(decision) => Some(decision.excluded.as_ref().map(ToString::to_string)),
                None => in_parts.contains(&&place).then_some(None),
            }
        })
        .collect();
    let declared = UsedColumn::Included.column();
    let included = Field::new(Type::Flag, declared.name, declared.meaning);
    let cells = used.iter().map(|u| Cell::Flag(matches!(u, Some(None))));
    table.add(included, cells);
    let declared = UsedColumn::Reason.column();
    let mut why = Field::new(Type::Text, "not_used_because", declared.meaning);
    why.empty = declared.empty.map(str::to_owned);
    let cells = used.into_iter().map(|u| match u {
        Some(None) => Cell::Empty,
        // A reason that a person typed may identify somebody.
        Some(Some(why)) if job.options.comments => Cell::Text(why.into()),
        Some(Some(why)) => {
            let category = why.split(": ").next().unwrap_or_default();
            Cell::Text(category.to_owned().into())
        }
        None => Cell::Text("not analyzed".into()),
    });
    table.add(why, cells);
}

fn settings(
    job: &Job<'_>,
    question: &str,
    parts: &[PartAnalysis],
    sums: &[(String, String)],
) -> Vec<u8> {
    let mut records = vec![["key", "value"].map(|w| Cow::Owned(w.to_owned())).to_vec()];
    let mut put = |key: &str, value: &str| {
        records.push(vec![
            key.to_owned().into(),
            clean(value).into_owned().into(),
        ]);
    };
    put("title", &job.title());
    put("study", &job.source.protocol.study.id);
    put("question", question);
    put("tool_version", job.source.tool_version);
    let protocol = job.source.protocol;
    for part in parts.iter().filter_map(|own| protocol.part(&own.part)) {
        let asked = part.asks.first().map_or("", |q| q.as_str());
        match &part.task {
            Task::Pairs(pairs) => {
                let ties = if pairs.tie { "ties" } else { "no ties" };
                put(&format!("pairs {}", part.id), asked);
                put(&format!("ties {}", part.id), ties);
            }
            Task::Discrimination { tracks } => {
                put(&format!("tracks {}", part.id), asked);
                for track in tracks.iter().filter_map(|id| protocol.track(id)) {
                    put(
                        &format!("method {} {}", part.id, track.id),
                        track.method.as_str(),
                    );
                }
            }
            Task::Rating(_) | Task::Magnitude(_) | Task::Mushra(_) => {}
        }
    }
    for part in parts {
        let ratios = (part.values.iter())
            .any(|(id, _)| id.starts_with("psy_mixed/") && id.ends_with("/geometric_mean"));
        if ratios {
            put(&format!("ratios {}", part.part), "true");
        }
    }
    for (path, sum) in sums {
        put(&format!("sha256 {path}"), sum);
    }
    delimited::lines(records, &Dialect::default())
}

/// The tolerance, relative to a value above 1, of closed forms, of the linear mixed model,
/// of abilities, and of the ordinal model.
const CLOSED: &str = "1e-9";
const LINEAR: &str = "2e-5";
/// Of a likelihood that both maximize by Newton's method.
const FITTED: &str = "1e-6";
const ORDINAL: &str = "2e-3";

/// The numbers that R has to come to.
fn headline(analysis: &Analysis) -> Vec<(String, Option<f64>, &'static str)> {
    let mut ids: Vec<(String, &'static str)> = Vec::new();
    for realization in &analysis.realizations {
        let group = group_id("desc", &[&realization.id]);
        ids.extend(["n", "mean", "sd"].map(|what| (format!("{group}/{what}"), CLOSED)));
    }
    ids.extend(["n_models", "pearson/r", "pearson/p_t"].map(|w| (format!("corr/{w}"), CLOSED)));
    let models = analysis.values.number("corr/n_models");
    if models.is_some_and(|n| n <= MAX_PERMUTED) {
        ids.push(("corr/pearson/p_exact_two_sided".to_owned(), CLOSED));
    }
    let linear = [
        "slope",
        "slope_se",
        "slope_satterthwaite_df",
        "slope_satterthwaite_p",
    ];
    let variances = ["var_subject", "var_model", "sigma2"];
    ids.extend((linear.iter().chain(&variances)).map(|w| (format!("lmm_vaf_crossed/{w}"), LINEAR)));
    let ordinal = [
        "beta/vaf",
        "se/vaf",
        "sd_subject",
        "sd_model",
        "loglik",
        "lrt_chi2",
    ];
    ids.extend(ordinal.map(|w| (format!("clmm_vaf_crossed/{w}"), ORDINAL)));
    let values = &analysis.values;
    (ids.into_iter())
        .map(|(id, tolerance)| {
            let value = values.number(&id);
            (id, value, tolerance)
        })
        .collect()
}

/// The numbers of a part that R has to come to, with the part's id before theirs.
fn headline_of_part(part: &PartAnalysis) -> Vec<(String, Option<f64>, &'static str)> {
    let tolerance = |id: &str| {
        let (group, what) = id.rsplit_once('/')?;
        let of = |names: &[&str]| names.contains(&what);
        let found = match group {
            "pairs" => of(&["order", "order_se", "tie_log_nu", "tie_log_nu_se"]).then_some(FITTED),
            "pairs/vaf/pearson" => of(&["r", "p_exact_two_sided"]).then_some(FITTED),
            "psy_mixed" => of(&["F", "df1", "df2", "p"]).then_some(LINEAR),
            _ if group == "pairs/ability" || group == "pairs/ability_se" => Some(FITTED),
            _ if group.starts_with("pairs/") && group.contains('|') => {
                of(&["difference", "se"]).then_some(FITTED)
            }
            _ if group.starts_with("sdt_group/") && group.ends_with("/above_chance") => {
                of(&["t", "p"]).then_some(CLOSED)
            }
            _ => None,
        };
        found.filter(|_| {
            what != "p_exact_two_sided"
                || (part.values.number("pairs/vaf/n_models")).is_some_and(|n| n <= MAX_PERMUTED)
        })
    };
    (part.values.iter())
        .filter_map(|(id, _)| Some((id, tolerance(id)?)))
        .map(|(id, tolerance)| {
            let value = part.values.number(id);
            (format!("{}:{id}", part.part), value, tolerance)
        })
        .collect()
}

/// The threshold of each participant on each track: part, participant, track, threshold.
fn thresholds(parts: &[PartAnalysis]) -> Vec<[String; 4]> {
    let of_part = |part: &PartAnalysis| -> Vec<[String; 4]> {
        let one = |level: &LevelData| {
            let group = group_id("psy", &[&level.participant, &level.condition]);
            let value = part
                .values
                .number(&format!("{group}/posterior/threshold/mean"))?;
            Some([
                part.part.to_string(),
                level.participant.clone(),
                level.condition.clone(),
                value.to_string(),
            ])
        };
        part.data.levels.iter().filter_map(one).collect()
    };
    parts.iter().flat_map(of_part).collect()
}

/// The script as a Quarto document: text, and a chunk for the lines between.
fn document(script: &str) -> String {
    let mut out = String::from(
        "---\ntitle: \"Analysis of an exported study\"\nformat:\n  html:\n    embed-resources: true\n---\n",
    );
    let mut chunk = Vec::new();
    let close = |chunk: &mut Vec<&str>, out: &mut String| {
        let code = chunk.join("\n");
        if !code.trim().is_empty() {
            *out += &format!("\n```{{r}}\n{}\n```\n", code.trim_matches('\n'));
        }
        chunk.clear();
    };
    let mut text = false;
    for line in script.lines() {
        match line.strip_prefix("#'") {
            Some(words) => {
                close(&mut chunk, &mut out);
                if !text {
                    out.push('\n');
                }
                out += words.strip_prefix(' ').unwrap_or(words);
                out.push('\n');
                text = true;
            }
            None => {
                chunk.push(line);
                text = false;
            }
        }
    }
    close(&mut chunk, &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::{SCRIPT, document};

    #[test]
    fn the_document_has_every_line_of_the_script_once() {
        let document = document(SCRIPT);
        let mut inside = false;
        let mut code = Vec::new();
        for line in document.lines() {
            match line {
                "```{r}" => inside = true,
                "```" => inside = false,
                line if inside => code.push(line),
                _ => {}
            }
        }
        let blank = |line: &&str| !line.trim().is_empty();
        let of_script = SCRIPT
            .lines()
            .filter(|l| !l.starts_with("#'"))
            .filter(blank);
        assert!(of_script.eq(code.into_iter().filter(blank)));
    }
}
