//! The analysis as one JSON document, `study-analysis/1`, with unrounded numbers.

use super::Source;
use serde_json::{Map, Value as Json, json};
use study_analysis::analyze::findings::{Direction, Estimate};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::{Analysis, Applied, Finding, Value, Values, Warning};

/// Name and version of the format.
pub const FORMAT: &str = "study-analysis/1";

fn estimate(e: &Estimate) -> Json {
    json!({"name": e.name, "value": e.value, "ci95": e.ci95.map(|(low, high)| [low, high])})
}

fn finding<Q>(f: &Finding<Q>, question: &str) -> Json {
    let test = f.test.as_ref().map(|t| {
        let statistic = t.statistic.as_ref();
        json!({
            "name": t.kind.as_str(),
            "symbol": statistic.map(|s| s.symbol),
            "statistic": statistic.map(|s| s.value),
            "df": statistic.map(|s| &s.df),
            "p": t.p,
            "level": t.level,
            "comparisons": t.comparisons,
        })
    });
    json!({
        "question": question,
        "verdict": f.verdict.as_str(),
        "undefined_because": f.reason(),
        "direction": f.direction.map(Direction::as_str),
        "realizations": f.names,
        "test": test,
        "n_participants": f.participants,
        "n_realizations": f.realizations,
        "estimate": f.estimate.as_ref().map(estimate),
        "effect": f.effect.as_ref().map(estimate),
        "caveats": f.caveats.iter()
            .map(|w| json!({"code": w.code, "text": w.text})).collect::<Vec<_>>(),
    })
}

/// Statistics by identifier, null if undefined, and the reasons of those.
fn statistics(of: &Values) -> (Map<String, Json>, Map<String, Json>) {
    let (mut values, mut undefined) = (Map::new(), Map::new());
    for (id, value) in of.iter() {
        let json = match value {
            Value::Number(x) => json!(x),
            Value::List(x) => json!(x),
            Value::Undefined(why) => {
                undefined.insert(id.to_owned(), json!(why));
                Json::Null
            }
        };
        values.insert(id.to_owned(), json);
    }
    (values, undefined)
}

/// The statistics of a table of trials, `study-trials/1`.
pub fn trials(path: &str, task: &str, rows: usize, of: &Values) -> String {
    let (values, undefined) = statistics(of);
    let document = json!({
        "format": "study-trials/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "path": path,
        "task": task,
        "rows": rows,
        "values": values,
        "undefined": undefined,
    });
    format!("{document:#}\n")
}

fn warnings(all: &[Warning]) -> Vec<Json> {
    let one = |w: &Warning| json!({"code": w.code, "text": w.text});
    all.iter().map(one).collect()
}

fn exclusions(all: &[Applied]) -> Vec<Json> {
    let one = |e: &Applied| {
        json!({
            "rule": e.rule.to_string(),
            "rows": e.rows,
            "participants": e.participants,
            "problem": e.problem,
        })
    };
    all.iter().map(one).collect()
}

fn part(part: &PartAnalysis) -> Json {
    let (values, undefined) = statistics(&part.values);
    json!({
        "part": part.part,
        "task": part.task,
        "trials": part.trials,
        "simulated": part.simulated,
        "pilot": part.pilot,
        "values": values,
        "undefined": undefined,
        "participants": part.participants,
        "alpha": part.alpha,
        "findings": part.findings.iter().map(|f| finding(f, &f.question.id())).collect::<Vec<_>>(),
        "warnings": warnings(&part.warnings),
        "exclusions": exclusions(&part.exclusions),
    })
}

/// The statistics of the parts of a study that are not ratings, `study-parts/1`.
pub fn parts(source: &Source, parts: &[PartAnalysis]) -> String {
    let mut document = json!({
        "format": "study-parts/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "path": source.path,
        "study": source.study.as_deref().unwrap_or_default(),
        "parts": parts.iter().map(part).collect::<Vec<_>>(),
    });
    if let Some(comparison) = &source.preregistration {
        document["preregistration"] = super::comparison::json(comparison);
    }
    format!("{document:#}\n")
}

/// The document, with a final line feed.
pub fn document(source: &Source, analysis: &Analysis) -> String {
    let (values, undefined) = statistics(&analysis.values);
    let c = &analysis.counts;
    let mut document = json!({
        "format": FORMAT,
        "tool_version": env!("CARGO_PKG_VERSION"),
        "study": {
            "id": source.study,
            "title": source.title,
            "protocol_version": source.protocol_version,
            "path": source.path,
        },
        "question": analysis.question,
        "realistic_from": analysis.realistic_from,
        "values": values,
        "undefined": undefined,
        "warnings": warnings(&analysis.warnings),
        "realizations": analysis.realizations.iter()
            .map(|m| json!({
                "id": m.id,
                "role": m.role.as_str(),
                "duplicate_of": m.duplicate_of,
                "vaf": m.vaf,
            })).collect::<Vec<_>>(),
        "alpha": analysis.alpha,
        "better": analysis.better.as_str(),
        "findings": analysis.findings.iter().map(|f| finding(f, &f.question.id())).collect::<Vec<_>>(),
        "exclusions": exclusions(&analysis.exclusions),
        "deviations": analysis.deviations.iter().map(|d| &d.text).collect::<Vec<_>>(),
        "counts": {
            "rows": c.rows,
            "rated": c.rated,
            "without_rating": c.without_rating,
            "failed": c.failed,
            "declined": c.declined,
            "missing": c.missing,
            "corrected": c.corrected,
            "repeated": c.repeated,
            "practice": c.practice,
            "excluded": c.excluded,
            "participants": c.participants,
            "finished": c.finished,
            "excluded_participants": c.excluded_participants,
            "planned": c.planned,
            "pilots": c.pilots,
            "simulated": c.simulated,
            "interim": c.interim(),
        },
    });
    if !analysis.parts.is_empty() {
        document["parts"] = analysis.parts.iter().map(part).collect();
    }
    if let Some(comparison) = &source.preregistration {
        document["preregistration"] = super::comparison::json(comparison);
    }
    if !source.sites.is_empty() {
        document["sites"] = super::sites::json(&source.sites);
    }
    format!("{document:#}\n")
}
