//! Questionnaires of a study: `questionnaire/…`.

use super::again::again;
use super::findings::{PartFacts, of_groups_and_sessions};
use super::over_participants::Measured;
use super::part_data::{PartAnalysis, PartData, StudyData};
use super::results::{ItemAnswers, PartResults, QuestionnaireResult};
use crate::analyze::record::{Interval, Stat};
use crate::analyze::select::{Include, Whose, state_counts};
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::counted;
use study_plan::protocol::questionnaires::{Inventory, Item, Questionnaire};
use study_plan::protocol::{Answer, Protocol};
use study_session::outcome::ParticipantRow;
use study_session::outcome::fold::History;
use study_session::outcome::ratings::Origin;
use study_stats::describe::{mean, quantile, sd, sorted};
use study_stats::paired::one_sample;
use study_stats::questionnaire::{raw_tlx, sus};

/// The scores of each questionnaire of a study over the participants who count, as for
/// ratings. Exclusion rules are about trials, and do not apply.
pub(super) fn of_questionnaires(study: &StudyData<'_>, include: Include) -> Vec<PartAnalysis> {
    let (protocol, participants) = (study.protocol, study.participants);
    let origin = |row: &ParticipantRow| Origin::of(row.simulated, row.pilot);
    let origins: Vec<Origin> = participants.iter().map(origin).collect();
    let whose = Whose::of(&origins, include);
    let unfinished = protocol.analysis.unfinished;
    let counts = |row: &&ParticipantRow| {
        whose.counts(origin(row)) && state_counts(row.state, unfinished) && !row.erased
    };
    let counted: Vec<&ParticipantRow> = participants.iter().filter(counts).collect();
    // The table has only the last session of each participant.
    let of_session = |history: &&History| {
        let start = history.start()?;
        let row = history.participant_row(&start.participant, start.session);
        let known = counted.iter().any(|c| c.participant == row.participant);
        (known && state_counts(row.state, unfinished)).then_some(row)
    };
    let rows: Vec<ParticipantRow> = match protocol.sessions.len() {
        0 | 1 => counted.iter().map(|row| (*row).clone()).collect(),
        _ => study.sessions.iter().filter_map(of_session).collect(),
    };
    let all = protocol.questionnaires.iter();
    all.map(|own| one(protocol, own, &rows)).collect()
}

fn one(protocol: &Protocol, own: &Questionnaire, rows: &[ParticipantRow]) -> PartAnalysis {
    let items = own.kind.items();
    let answers = |row: &ParticipantRow| -> Vec<Option<f64>> {
        let answer = |item| {
            row.answers
                .get(&own.question(item))
                .and_then(Answer::number)
        };
        items.iter().map(answer).collect()
    };
    let asked = |row: &&ParticipantRow| {
        let answer = |item| row.answers.contains_key(&own.question(item));
        items.iter().any(answer)
    };
    let rows: Vec<&ParticipantRow> = rows.iter().filter(asked).collect();
    let several = protocol.sessions.len() > 1;
    let mut score_of = BTreeMap::new();
    let mut scores: Vec<Measured> = Vec::new();
    for row in &rows {
        let all: Option<Vec<f64>> = answers(row).into_iter().collect();
        let score = all.and_then(|answers| score(own.kind, &answers));
        let session = row.session_id.as_ref().filter(|_| several);
        let session = session.map(|s| s.as_str().to_owned());
        let participant = row.participant.as_str().to_owned();
        let name = match &session {
            Some(session) => format!("{participant}@{session}"),
            None => participant.clone(),
        };
        let stat = Stat::or(score, "an item has no answer");
        score_of.insert(name.as_str().into(), stat);
        scores.extend(score.map(|value| Measured {
            participant,
            group: row.group.as_ref().map(|g| g.as_str().to_owned()),
            session,
            condition: own.id.as_str().to_owned(),
            value,
        }));
    }
    let of_item = |(i, item): (usize, &Item)| {
        let known: Vec<f64> = rows.iter().filter_map(|row| answers(row)[i]).collect();
        let few = "fewer than two have answered it";
        let answers = ItemAnswers {
            n: Stat::count(known.len()),
            mean: Stat::or(mean(&known), few),
            sd: Stat::or(sd(&known), few),
        };
        (item.name.into(), answers)
    };
    let incomplete = rows.len() - scores.len();
    let sessions: Vec<&str> = protocol.sessions.iter().map(|s| s.id.as_str()).collect();
    let sessions = if several { &sessions[..] } else { &[] };
    let mut results = PartResults::undefined("");
    results.over.again = again(&scores, sessions, false);
    results.questionnaire = Some(QuestionnaireResult {
        score: score_of,
        item: items.iter().enumerate().map(of_item).collect(),
        n_incomplete: Stat::count(incomplete),
        ..over_participants(&scores)
    });
    let who: BTreeSet<_> = rows.iter().map(|r| &r.participant).collect();
    let alpha = protocol.analysis.alpha();
    let facts = PartFacts {
        alpha,
        participants: who.len(),
    };
    let findings = of_groups_and_sessions(&facts, &results.over.again);
    let warning = || Warning {
        code: "incomplete-questionnaires",
        text: format!(
            "{} without an answer to every item {} no score",
            counted(incomplete, "questionnaire", "questionnaires"),
            if incomplete == 1 { "has" } else { "have" }
        ),
    };
    PartAnalysis {
        part: own.id.clone(),
        task: own.kind.as_str(),
        trials: scores.len(),
        participants: who.len(),
        pilot: rows.iter().any(|r| r.pilot),
        simulated: rows.iter().any(|r| r.simulated),
        findings,
        results,
        pairs: Vec::new(),
        warnings: (incomplete > 0).then(warning).into_iter().collect(),
        exclusions: Vec::new(),
        alpha,
        used: Vec::new(),
        data: PartData::default(),
    }
}

/// The mean score of each participant, and what the participants have in common.
fn over_participants(scores: &[Measured]) -> QuestionnaireResult {
    let mut own: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for m in scores {
        own.entry(&m.participant).or_default().push(m.value);
    }
    let means: Vec<f64> = own.values().filter_map(|x| mean(x)).collect();
    let found = one_sample(&means);
    let few = "fewer than two participants have a score";
    QuestionnaireResult {
        n: Stat::count(means.len()),
        mean: Stat::or(mean(&means), few),
        median: Stat::or(quantile(&sorted(&means), 0.5), few),
        sd: Stat::or(found.map(|f| f.sd), few),
        ci95: Interval::or(found.map(|f| f.ci95), few),
        ..QuestionnaireResult::undefined("")
    }
}

fn score(kind: Inventory, answers: &[f64]) -> Option<f64> {
    match kind {
        Inventory::Sus => sus(answers),
        Inventory::NasaTlx => raw_tlx(answers),
    }
}
