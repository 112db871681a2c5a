//! The analysis as one JSON document, `study-analysis/1`, with unrounded numbers.

mod object;

use super::{Site, SiteDevice, Source};
use object::{
    Answer, Answered, Decisive, Device, Document, End, Estimated, Format, IfAny, Member, Note,
    Numbers, Part, PartsDocument, PartsFormat, Place, Preregistered, Realization, RoleWord, Rule,
    Statistics, Study, Way,
};
use serde_json::{Map, Value as Json, json};
use study_analysis::analyze::findings::Estimate;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::results::PartResults;
use study_analysis::analyze::results::Field as _;
use study_analysis::analyze::{
    Analysis, Applied, Finding, RealizationSummary, Value, Values, Warning,
};
use study_analysis::preregister::Comparison;

/// Name and version of the format.
pub const FORMAT: &str = "study-analysis/1";
/// That of [`parts`].
const PARTS_FORMAT: &str = "study-parts/1";

fn estimate(e: &Estimate) -> Estimated {
    Estimated {
        name: e.name.to_owned(),
        value: e.value,
        ci95: e.ci95.map(|(low, high)| vec![low, high]),
    }
}

fn finding<Q>(f: &Finding<Q>, question: String) -> Answered {
    let test = f.test.as_ref().map(|t| {
        let statistic = t.statistic.as_ref();
        Decisive {
            name: t.kind.as_str().to_owned(),
            symbol: statistic.map(|s| s.symbol.to_owned()),
            statistic: statistic.map(|s| s.value),
            df: statistic.map(|s| s.df.clone()),
            p: t.p,
            level: t.level,
            comparisons: t.comparisons,
        }
    });
    Answered {
        question,
        verdict: Answer(f.verdict.as_str()),
        undefined_because: f.reason().map(str::to_owned),
        direction: f.direction.map(|d| Way(d.as_str())),
        realizations: f.names.clone(),
        test,
        n_participants: f.participants,
        n_realizations: f.realizations,
        estimate: f.estimate.as_ref().map(estimate),
        effect: f.effect.as_ref().map(estimate),
        caveats: notes(&f.caveats),
    }
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
pub fn trials(path: &str, task: &str, rows: usize, of: &PartResults) -> String {
    let (values, undefined) = statistics(&of.values());
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

fn notes(all: &[Warning]) -> Vec<Note> {
    let one = |w: &Warning| Note {
        code: w.code.to_owned(),
        text: w.text.clone(),
    };
    all.iter().map(one).collect()
}

fn exclusions(all: &[Applied]) -> Vec<Rule> {
    let one = |e: &Applied| Rule {
        rule: e.rule.to_string(),
        rows: e.rows,
        participants: e.participants,
        problem: e.problem.map(str::to_owned),
    };
    all.iter().map(one).collect()
}

fn part(part: &PartAnalysis) -> Part {
    let (values, undefined) = statistics(&part.values());
    Part {
        part: part.part.to_string(),
        task: part.task.to_owned(),
        trials: part.trials,
        simulated: part.simulated,
        pilot: part.pilot,
        values: Statistics(values),
        undefined,
        participants: part.participants,
        alpha: part.alpha,
        findings: (part.findings.iter())
            .map(|f| finding(f, f.question.id()))
            .collect(),
        warnings: notes(&part.warnings),
        exclusions: exclusions(&part.exclusions),
    }
}

/// The statistics of the parts of a study that are not ratings, `study-parts/1`.
pub fn parts(source: &Source, parts: &[PartAnalysis]) -> String {
    let document = PartsDocument {
        format: PartsFormat(PARTS_FORMAT),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        path: source.path.clone(),
        study: source.study.clone().unwrap_or_default(),
        parts: parts.iter().map(part).collect(),
        preregistration: IfAny(source.preregistration.as_ref().map(preregistered)),
    };
    printed(document)
}

fn printed(document: impl Member) -> String {
    format!("{:#}\n", document.json().unwrap_or_default())
}

fn preregistered(c: &Comparison) -> Preregistered {
    Preregistered {
        date: c.date.to_string(),
        sha256: c.sha256.clone(),
        first_session: c.first_session.map(|at| at.to_rfc3339()),
        matches: c.deviations.is_empty(),
        deviations: c.deviations.clone(),
    }
}

fn place(site: &Site) -> Place {
    let device = |d: &SiteDevice| Device {
        kind: d.kind.clone(),
        id: d.id.clone(),
        sessions: d.sessions,
        check: d.check.as_ref().map(|c| c.0.clone()),
        check_age_days: d.check.as_ref().and_then(|c| c.1),
    };
    Place {
        name: site.name.clone(),
        path: site.path.clone(),
        participants: site.participants,
        days: (site.days.as_ref()).map(|(first, last)| vec![first.clone(), last.clone()]),
        devices: site.devices.iter().map(device).collect(),
    }
}

/// The JSON Schema of [`document`]; it says of statistics only that they are an object.
pub fn schema() -> Json {
    described::<Document>(
        FORMAT,
        "An analysis of ratings, as `study analyze --json` prints it. docs/statistics.md defines the statistics.",
    )
}

/// The same of [`parts`].
pub fn parts_schema() -> Json {
    described::<PartsDocument>(
        PARTS_FORMAT,
        "An analysis of parts that are not ratings, as `study analyze --json` prints it. docs/statistics-psychophysics.md defines the statistics.",
    )
}

fn described<T: Member>(format: &str, description: &str) -> Json {
    let mut schema = T::schema();
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!(format);
    schema["description"] = json!(description);
    schema
}

/// The document, with a final line feed.
pub fn document(source: &Source, a: &Analysis) -> String {
    let (values, undefined) = statistics(&a.values);
    let c = &a.counts;
    let realization = |m: &RealizationSummary| Realization {
        id: m.id.clone(),
        role: RoleWord(m.role.as_str()),
        duplicate_of: m.duplicate_of.clone(),
        vaf: m.vaf,
    };
    let parts: Vec<Part> = a.parts.iter().map(part).collect();
    let sites: Vec<Place> = source.sites.iter().map(place).collect();
    let document = Document {
        format: Format(FORMAT),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        study: Study {
            id: source.study.clone(),
            title: source.title.clone(),
            protocol_version: source.protocol_version,
            path: source.path.clone(),
        },
        question: a.question.clone(),
        realistic_from: a.realistic_from,
        alpha: a.alpha,
        better: End(a.better.as_str()),
        values: Statistics(values),
        undefined,
        warnings: notes(&a.warnings),
        realizations: a.realizations.iter().map(realization).collect(),
        findings: (a.findings.iter())
            .map(|f| finding(f, f.question.id()))
            .collect(),
        exclusions: exclusions(&a.exclusions),
        deviations: a.deviations.iter().map(|d| d.text.clone()).collect(),
        counts: Numbers {
            rows: c.rows,
            rated: c.rated,
            without_rating: c.without_rating,
            failed: c.failed,
            declined: c.declined,
            missing: c.missing,
            corrected: c.corrected,
            repeated: c.repeated,
            practice: c.practice,
            excluded: c.excluded.clone(),
            participants: c.participants,
            finished: c.finished,
            excluded_participants: c.excluded_participants,
            planned: c.planned,
            pilots: c.pilots,
            simulated: c.simulated,
            interim: c.interim(),
        },
        parts: IfAny(Some(parts).filter(|all| !all.is_empty())),
        sites: IfAny(Some(sites).filter(|all| !all.is_empty())),
        preregistration: IfAny(source.preregistration.as_ref().map(preregistered)),
    };
    printed(document)
}
