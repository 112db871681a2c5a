//! The tables with an R script and a Quarto document, which give the numbers of
//! `study analyze`.

mod headline;

use super::table::{Field, Type, clean};
use super::{Dialect, ExportError, Format, Job, delimited, readme, telemetry};
use crate::analyze::psychophysics::{
    PartAnalysis, StudyData, asked, have_ratios, parts, sessions_of,
};
use crate::analyze::{Analysis, Include, RowDecision, Rules, analyze};
use headline::{of_part, of_ratings};
use std::borrow::Cow;
use std::collections::BTreeSet;
use study_base::hex::sha256;
use study_base::text::{PartId, QuestionId};
use study_plan::protocol::columns::UsedColumn;
use study_plan::protocol::parts::{Task, TrackRules};
use study_plan::protocol::{Measure, OutcomeFamily, OutcomeRules, Protocol, Telemetry};
use study_session::outcome::RatingRow;
use study_session::outcome::cell::Cell;
use study_session::outcome::ratings::{Motions, Ratings};

/// The script. Lines that begin with `#'` are the text of the document. No text of a
/// study is in it: it reads all of them from the tables.
const SCRIPT: &str = include_str!("analysis.R");

/// Tables with an R script and a Quarto document.
pub(super) struct R;

impl Format for R {
    const NAME: &'static str = "r";
    const ABOUT: &'static str =
        "Tables with an R script and a Quarto document that give the numbers of `analyze`";

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let dialect = Dialect::default();
        let mut tables = job.tables.clone();
        let analysis = analysis(job);
        let parts = parts_of(job, analysis.as_ref());
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
        for (path, estimate, what) in [
            (
                "thresholds.csv",
                "threshold",
                "the threshold of each participant on each track, or on the tracks of a condition, a posterior median of `study analyze`; \
                 its distance from the standard where tracks with different standards are compared",
            ),
            (
                "sensitivities.csv",
                "d",
                "the d' of each participant on each track of two realizations, of `study analyze`",
            ),
        ] {
            let found = estimates(job.source.protocol, &parts, estimate == "threshold");
            if found.is_empty() {
                continue;
            }
            let head = ["part", "participant", "track", estimate, "session"].map(str::to_owned);
            let lines = std::iter::once(head).chain(found);
            let lines = lines.map(|line| line.map(Cow::Owned).to_vec());
            let bytes = delimited::lines(lines, &dialect);
            job.file(path, &bytes)?;
            sums.push((path.to_owned(), sha256(&bytes)));
            files.push((path.to_owned(), what));
        }
        let question = analysis.as_ref().map_or("", |a| a.question.as_str());
        let settings = settings(job, question, &parts, &sums);
        job.file("settings.csv", &settings)?;
        let mut headline = analysis.as_ref().map_or_else(Vec::new, of_ratings);
        headline.extend(parts.iter().flat_map(of_part));
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
}

/// The analysis of the exported rows; `None` if the primary question has no numbers or other ones than
/// ratings of a realization, or nothing was rated.
fn analysis(job: &Job<'_>) -> Option<Analysis> {
    let protocol = job.source.protocol;
    let question = protocol.primary()?;
    let share_of = protocol.analysis.share_of(&question.id);
    let other = protocol.has_other_numbers(&question.id);
    if other || !(question.kind.scale().is_number() || share_of.is_some()) {
        return None;
    }
    let mut ratings = Ratings::from_rows(&job.selected.rows, &question.id, share_of);
    ratings.set_states(&job.selected.participants);
    ratings.set_duplicates(protocol.models.iter().filter_map(|m| {
        let original = m.duplicate_of.as_ref()?;
        Some((m.id.as_str(), original.as_str()))
    }));
    let outcomes: Vec<OutcomeRules> = (modeled(protocol).into_iter())
        .map(|(outcome, _)| outcome.clone())
        .collect();
    ratings.set_measured(&job.selected.rows, &outcomes, &Motions::new());
    // All rows are of one kind, whichever it is.
    let include = Include {
        pilot: true,
        simulated: true,
    };
    let rules = Rules::of(protocol, question.id.as_str(), include);
    (!ratings.is_empty()).then(|| analyze(&ratings, &rules))
}

/// The outcomes of which R fits the generalized mixed model too, with the columns of their numbers.
fn modeled(protocol: &Protocol) -> Vec<(&OutcomeRules, &str)> {
    fn column(outcome: &OutcomeRules) -> Option<&str> {
        match (&outcome.measure, outcome.model?) {
            // R's glmer does not maximize the likelihood of gamma.
            (_, OutcomeFamily::Gamma) | (Measure::Clock(_) | Measure::Questionnaire(_), _) => None,
            (Measure::Telemetry(what), _) => (*what == Telemetry::Strokes).then_some("strokes"),
            (Measure::Answers(answers), _) => answers.questions.first().map(QuestionId::as_str),
            (Measure::Device(_), _) => Some(outcome.id.as_str()),
        }
    }
    (protocol.outcomes.iter())
        .filter_map(|outcome| Some((outcome, column(outcome)?)))
        .collect()
}

/// The analyses of the parts.
fn parts_of(job: &Job<'_>, analysis: Option<&Analysis>) -> Vec<PartAnalysis> {
    let protocol = job.source.protocol;
    let study = StudyData {
        protocol,
        rows: &job.selected.rows,
        intervals: &job.selected.intervals,
        participants: &job.selected.participants,
        // Only the course of tracks follows from them.
        sessions: &[],
        pools: false,
    };
    let include = Include {
        pilot: true,
        simulated: true,
    };
    let mut found = parts(&study, include);
    found.retain(|own| {
        let part = protocol.part(&own.part);
        own.trials > 0 && part.is_some() && uses_the_same(job, analysis, own)
    });
    found
}

/// Whether the part rests on the rows that the analysis of ratings uses, if both are about one
/// question. They differ if an exclusion rule judges all parts together.
fn uses_the_same(job: &Job<'_>, analysis: Option<&Analysis>, own: &PartAnalysis) -> bool {
    let rows = &job.selected.rows;
    let used: BTreeSet<_> = own.used.iter().collect();
    let decisions = decisions(rows, analysis);
    let mut both = (rows.iter().zip(decisions)).filter(|(row, decision)| {
        decision.is_some() && row.part.as_ref() == Some(&own.part) && is_asked(job, row, analysis)
    });
    both.all(|(row, decision)| {
        let place = (row.participant.clone(), row.session, row.trial);
        let rated = decision.is_some_and(|d| d.rating.is_some());
        let included = decision.is_some_and(|d| d.excluded.is_none());
        !rated || used.contains(&place) == included
    })
}

/// Whether the part of a row asks the question of the analysis.
fn is_asked(job: &Job<'_>, row: &RatingRow, analysis: Option<&Analysis>) -> bool {
    let protocol = job.source.protocol;
    let part = row.part.as_ref().and_then(|id| protocol.part(id));
    let own = part.and_then(|part| asked(protocol, part));
    own.is_none_or(|own| analysis.is_some_and(|a| a.question == own.as_str()))
}

/// What the analysis of ratings decided of each row; it has one for each rating of a realization
/// that is no practice.
fn decisions<'a>(
    rows: &'a [RatingRow],
    analysis: Option<&'a Analysis>,
) -> impl Iterator<Item = Option<&'a RowDecision>> {
    let mut decided = analysis.map_or(&[][..], |a| &a.rows[..]).iter();
    rows.iter().map(move |row| {
        let rated = row.model.is_some() && row.track.is_none() && !row.practice;
        if rated { decided.next() } else { None }
    })
}

/// Adds whether the analysis used each row, and why not.
fn mark(
    job: &Job<'_>,
    analysis: Option<&Analysis>,
    parts: &[PartAnalysis],
    table: &mut super::table::Table<'_>,
) {
    let in_parts: BTreeSet<_> = parts.iter().flat_map(|part| &part.used).collect();
    let rows = &job.selected.rows;
    let used: Vec<Option<Option<String>>> = (rows.iter().zip(decisions(rows, analysis)))
        .map(|(row, decision)| {
            let place = (row.participant.clone(), row.session, row.trial);
            match decision.filter(|_| is_asked(job, row, analysis)) {
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
    if let Some(option) = protocol
        .primary()
        .and_then(|q| protocol.analysis.share_of(&q.id))
    {
        put("share of", option);
    }
    if let Some(crossing) = protocol.crossing() {
        for factor in &crossing.factors {
            put(&format!("factor {}", factor.id), "true");
        }
        if !crossing.groups.is_empty() {
            put("group is a factor", "true");
        }
        if let Some(margin) = (protocol.analysis.equivalence_margin)
            .filter(|_| protocol.analysis.primary.as_str() == question)
        {
            put("equivalence margin", &margin.to_string());
        }
    }
    for (outcome, column) in modeled(protocol) {
        let id = &outcome.id;
        put(&format!("modeled {id}"), "true");
        put(&format!("column of {id}"), column);
        if let Some(of) = outcome.of {
            put(&format!("trials of {id}"), &of.to_string());
        }
    }
    for part in parts.iter().filter_map(|own| protocol.part(&own.part)) {
        let question = asked(protocol, part).map_or("", |q| q.as_str());
        let kind = match part.task {
            Task::Rating(_) => "rating",
            Task::Magnitude(_) => "magnitude",
            Task::Mushra(_) => "mushra",
            Task::Identification(_) => "identification",
            Task::Pairs(_) => "pairs",
            Task::Discrimination { .. } => "tracks",
            Task::Search(_) => "search",
            Task::Similarity(_) => "similarity",
            Task::Ranking(_) => "ranking",
            Task::Adjustment(_) => "adjustment",
        };
        put(&format!("{kind} {}", part.id), question);
        for session in sessions_of(protocol, part).into_iter().flatten() {
            put(&format!("session {} {session}", part.id), "true");
        }
        match &part.task {
            Task::Pairs(pairs) => {
                let ties = if pairs.tie { "ties" } else { "no ties" };
                put(&format!("ties {}", part.id), ties);
            }
            Task::Magnitude(own) => {
                let levels = own
                    .presentations
                    .models
                    .iter()
                    .any(|m| protocol.level_of(m).is_some());
                let of = if levels { "levels" } else { "realizations" };
                put(&format!("estimates {}", part.id), of);
            }
            Task::Discrimination { .. } => {
                let tracks = tracks(protocol, &part.id);
                for track in &tracks {
                    let method = track.method.as_str();
                    put(&format!("method {} {}", part.id, track.id), method);
                }
                if have_ratios(protocol, &tracks) {
                    put(&format!("ratios {}", part.id), "true");
                }
            }
            Task::Identification(own) => {
                let labels = own.labels.iter().flat_map(|label| {
                    let models = label.models.iter();
                    models.map(|model| (model, label.text.as_str()))
                });
                for (model, label) in labels {
                    put(&format!("label {} {model}", part.id), label);
                }
            }
            Task::Adjustment(own) => {
                let below = own.below.iter().map(|start| (start, "below"));
                let above = own.above.iter().map(|start| (start, "above"));
                for (start, side) in below.chain(above) {
                    put(&format!("start {} {start}", part.id), side);
                }
                if let Some(level) = own.standard.as_ref().and_then(|s| protocol.level_of(s)) {
                    put(&format!("standard {}", part.id), &level.to_string());
                }
            }
            Task::Rating(_)
            | Task::Mushra(_)
            | Task::Search(_)
            | Task::Similarity(_)
            | Task::Ranking(_) => {}
        }
    }
    for (path, sum) in sums {
        put(&format!("sha256 {path}"), sum);
    }
    delimited::lines(records, &Dialect::default())
}

/// The tracks of a part; none of another kind.
fn tracks<'p>(protocol: &'p Protocol, part: &PartId) -> Vec<&'p TrackRules> {
    match protocol.part(part).map(|part| &part.task) {
        Some(Task::Discrimination { tracks }) => {
            tracks.iter().filter_map(|id| protocol.track(id)).collect()
        }
        _ => Vec::new(),
    }
}

/// The thresholds or the sensitivities of tracks: part, participant, track or the condition of
/// several, estimate, session.
fn estimates(protocol: &Protocol, parts: &[PartAnalysis], thresholds: bool) -> Vec<[String; 5]> {
    let of_part = |part: &PartAnalysis| -> Vec<[String; 5]> {
        let has_levels = |track: &&&TrackRules| track.family().is_some() == thresholds;
        let tracks = tracks(protocol, &part.part);
        let tracks: BTreeSet<&str> = (tracks.iter().filter(has_levels))
            .map(|track| track.condition().as_str())
            .collect();
        let own = part.data.measured.iter();
        own.filter(|m| tracks.contains(m.condition.as_str()))
            .map(|m| {
                [
                    part.part.to_string(),
                    m.participant.clone(),
                    m.condition.clone(),
                    m.value.to_string(),
                    m.session.clone().unwrap_or_default(),
                ]
            })
            .collect()
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
