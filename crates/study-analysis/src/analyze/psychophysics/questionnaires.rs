//! Questionnaires of a study: `questionnaire/…`.

use super::again::again;
use super::findings::{PartFacts, of_groups_and_sessions};
use super::over_participants::Measured;
use super::part_data::{PartAnalysis, PartData, StudyData};
use super::results::{
    ConditionName, ItemAnswers, ItemName, PartResults, QuestionnaireResult, ScoresAfter,
    SubscaleScores,
};
use crate::analyze::record::{Interval, Stat};
use crate::analyze::select::{Include, Whose, state_counts};
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{PartId, ParticipantId, QuestionId, counted};
use study_plan::protocol::questionnaires::{Occasion, Questionnaire};
use study_plan::protocol::{Answer, Scoring, Subscale};
use study_session::outcome::fold::History;
use study_session::outcome::ratings::Origin;
use study_session::outcome::{ParticipantRow, RatingRow};
use study_stats::describe::{mean, quantile, sd, sorted};
use study_stats::paired::one_sample;

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
    all.map(|own| one(study, own, &rows)).collect()
}

/// A questionnaire that somebody began to fill in.
struct Filled<'a> {
    participant: &'a ParticipantId,
    group: Option<&'a PartId>,
    /// In a study of several sessions.
    session: Option<&'a PartId>,
    /// The condition, block or part that it is about, if it was asked between the trials.
    about: Option<String>,
    answers: Vec<Option<f64>>,
    /// `None` if an item has no answer.
    score: Option<f64>,
    /// Whether it was answered after longer pauses than the protocol allows.
    late: bool,
    /// Pauses before it, s, if their length is known.
    paused_s: Option<f64>,
    pilot: bool,
    simulated: bool,
}

/// The questionnaires of the sessions that count, in the order of participants, sessions and trials.
fn filled<'a>(
    study: &StudyData<'a>,
    own: &Questionnaire,
    sessions: &'a [ParticipantRow],
) -> Vec<Filled<'a>> {
    let scored = own.scored();
    let questions: Vec<QuestionId> = scored.questions();
    let number = |answers: &BTreeMap<QuestionId, Answer>, id: &QuestionId| {
        answers.get(id).and_then(Answer::number)
    };
    let given = |answers: &BTreeMap<QuestionId, Answer>| -> Option<Vec<Option<f64>>> {
        let asked = questions.iter().any(|id| answers.contains_key(id));
        asked.then(|| questions.iter().map(|id| number(answers, id)).collect())
    };
    let score = |answers: &[Option<f64>]| scored.score(answers);
    let several = study.protocol.sessions.len() > 1;
    let of_session = |row: &'a ParticipantRow| -> Option<Filled<'a>> {
        let answers = given(&row.answers)?;
        Some(Filled {
            participant: &row.participant,
            group: row.group.as_ref(),
            session: row.session_id.as_ref().filter(|_| several),
            about: None,
            score: score(&answers),
            answers,
            late: false,
            paused_s: None,
            pilot: row.pilot,
            simulated: row.simulated,
        })
    };
    let counts = |row: &RatingRow| {
        let same = |session: &ParticipantRow| {
            session.participant == row.participant && (!several || session.session == row.session)
        };
        sessions.iter().any(same)
    };
    let of_trial = |row: &'a RatingRow| -> Option<Filled<'a>> {
        let answers = given(&row.answers).filter(|_| counts(row))?;
        let about = match own.after {
            Occasion::Condition => row.model.as_ref().map(ToString::to_string),
            Occasion::Block => Some(row.block.to_string()),
            Occasion::Part => row.part.as_ref().map(ToString::to_string),
            Occasion::Session => None,
        };
        Some(Filled {
            participant: &row.participant,
            group: row.group.as_ref(),
            session: row.session_id.as_ref().filter(|_| several),
            about,
            score: score(&answers),
            answers,
            late: row.questionnaire_late == Some(true),
            paused_s: row.questionnaire_paused_s,
            pilot: row.pilot,
            simulated: row.simulated,
        })
    };
    match own.after {
        Occasion::Session => sessions.iter().filter_map(of_session).collect(),
        Occasion::Condition | Occasion::Block | Occasion::Part => {
            study.rows.iter().filter_map(of_trial).collect()
        }
    }
}

fn one(study: &StudyData<'_>, own: &Questionnaire, sessions: &[ParticipantRow]) -> PartAnalysis {
    let protocol = study.protocol;
    let filled = filled(study, own, sessions);
    let mut score_of = BTreeMap::new();
    let mut scores: Vec<Measured> = Vec::new();
    let same =
        |a: &Filled<'_>, b: &Filled<'_>| a.participant == b.participant && a.session == b.session;
    for forms in filled.chunk_by(same) {
        let known: Vec<f64> = forms.iter().filter_map(|form| form.score).collect();
        let score = mean(&known);
        let form = &forms[0];
        let session = form.session.map(|s| s.as_str().to_owned());
        let participant = form.participant.as_str().to_owned();
        let name = match &session {
            Some(session) => format!("{participant}@{session}"),
            None => participant.clone(),
        };
        let stat = Stat::or(score, "an item has no answer");
        score_of.insert(name.as_str().into(), stat);
        scores.extend(score.map(|value| Measured {
            participant,
            group: form.group.map(|g| g.as_str().to_owned()),
            session,
            condition: own.id.as_str().to_owned(),
            value,
        }));
    }
    let names = own.scored().names();
    let of_item = |(i, name): (usize, &String)| {
        let known: Vec<f64> = filled.iter().filter_map(|form| form.answers[i]).collect();
        let few = "fewer than two have answered it";
        let answers = ItemAnswers {
            n: Stat::count(known.len()),
            mean: Stat::or(mean(&known), few),
            sd: Stat::or(sd(&known), few),
        };
        (name.as_str().into(), answers)
    };
    let scored = filled.iter().filter(|form| form.score.is_some()).count();
    let incomplete = filled.len() - scored;
    let several = protocol.sessions.len() > 1;
    let sessions: Vec<&str> = protocol.sessions.iter().map(|s| s.id.as_str()).collect();
    let sessions = if several { &sessions[..] } else { &[] };
    let mut results = PartResults::undefined("");
    results.over.again = again(&scores, sessions, false);
    results.questionnaire = Some(QuestionnaireResult {
        score: score_of,
        item: names.iter().enumerate().map(of_item).collect(),
        scale: subscales(own, &filled),
        after: by_condition(&filled),
        n_incomplete: Stat::count(incomplete),
        ..over_participants(&scores)
    });
    let who: BTreeSet<_> = filled.iter().map(|form| form.participant).collect();
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
        trials: scored,
        participants: who.len(),
        pilot: filled.iter().any(|form| form.pilot),
        simulated: filled.iter().any(|form| form.simulated),
        findings,
        results,
        pairs: Vec::new(),
        warnings: ((incomplete > 0).then(warning).into_iter())
            .chain(from_memory(&filled, protocol.session.longest_pause_s))
            .collect(),
        exclusions: Vec::new(),
        alpha,
        used: Vec::new(),
        data: PartData {
            between: Some(own.after).filter(|after| *after != Occasion::Session),
            ..PartData::default()
        },
    }
}

/// That some questionnaires were answered after a longer pause than the protocol allows between feeling and answering. What
/// they are about is not felt again for them, so that they count.
fn from_memory(filled: &[Filled<'_>], longest_pause_s: f64) -> Option<Warning> {
    let late: Vec<&Filled<'_>> = filled.iter().filter(|form| form.late).collect();
    let longest = late
        .iter()
        .filter_map(|form| form.paused_s)
        .reduce(f64::max);
    let most = longest.map_or(String::new(), |s| format!(", at most {s:.0} s"));
    let warning = || Warning {
        code: "late-questionnaires",
        text: format!(
            "{} answered from memory, after pauses of more than {longest_pause_s} s{most}; {} counted, and marked in \
             `questionnaire_late`",
            counted(late.len(), "questionnaire was", "questionnaires were"),
            if late.len() == 1 { "it is" } else { "they are" }
        ),
    };
    (!late.is_empty()).then(warning)
}

/// The scores of each subscale of a questionnaire of the study's own, one mean for each participant.
fn subscales(own: &Questionnaire, filled: &[Filled<'_>]) -> BTreeMap<ItemName, SubscaleScores> {
    let one = |scoring: &Scoring, scale: &Subscale| {
        let mut people: BTreeMap<&ParticipantId, Vec<f64>> = BTreeMap::new();
        for form in filled {
            if let Some(score) = scoring.subscale(scale, &form.answers) {
                people.entry(form.participant).or_default().push(score);
            }
        }
        let means: Vec<f64> = people.values().filter_map(|x| mean(x)).collect();
        let found = one_sample(&means);
        let few = "fewer than two participants have a score";
        let scores = SubscaleScores {
            n: Stat::count(means.len()),
            mean: Stat::or(mean(&means), few),
            sd: Stat::or(found.map(|f| f.sd), few),
            ci95: Interval::or(found.map(|f| f.ci95), few),
        };
        (scale.id.as_str().into(), scores)
    };
    let scoring = own.own.iter();
    scoring
        .flat_map(|scoring| scoring.scales.iter().map(move |scale| (scoring, scale)))
        .map(|(scoring, scale)| one(scoring, scale))
        .collect()
}

/// The scores after each condition, block or part, one mean for each participant.
fn by_condition(filled: &[Filled<'_>]) -> BTreeMap<ConditionName, ScoresAfter> {
    let mut conditions: BTreeMap<&str, BTreeMap<&ParticipantId, Vec<f64>>> = BTreeMap::new();
    for form in filled {
        if let (Some(about), Some(score)) = (&form.about, form.score) {
            let own = conditions.entry(about).or_default();
            own.entry(form.participant).or_default().push(score);
        }
    }
    let one = |(name, own): (&str, BTreeMap<&ParticipantId, Vec<f64>>)| {
        let means: Vec<f64> = own.values().filter_map(|x| mean(x)).collect();
        let found = one_sample(&means);
        let few = "fewer than two participants have a score";
        let scores = ScoresAfter {
            n: Stat::count(means.len()),
            mean: Stat::or(mean(&means), few),
            sd: Stat::or(found.map(|f| f.sd), few),
            ci95: Interval::or(found.map(|f| f.ci95), few),
        };
        (name.into(), scores)
    };
    conditions.into_iter().map(one).collect()
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
