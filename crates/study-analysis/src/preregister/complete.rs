//! A complete study of a protocol, with drawn numbers in the place of answers. It shows which
//! tests the analysis chooses; nothing else is read from it.

use crate::analyze::psychophysics::{PartAnalysis, StudyData, parts};
use crate::analyze::{Include, Rules};
use study_base::rng::Stream;
use study_base::sort::SmallSort as _;
use study_base::text::{ModelId, PartId, ParticipantId, QuestionId};
use study_plan::protocol::pairs::Pairs;
use study_plan::protocol::parts::{Part, Task, TrackRules};
use study_plan::protocol::presentations::Presentations;
use study_plan::protocol::{
    Adjustment, Answer, GroupRules, ModelEntry, Protocol, Ranking, Role, Scale, Similarity,
};
use study_session::outcome::ratings::{Ratings, Realization, Row, Subject};
use study_session::outcome::{IntervalRow, RatingRow};

/// More participants choose no other test.
const ENOUGH: u32 = 1000;

/// More participants choose no other test of tracks, each of which takes a fit.
const ENOUGH_WITH_LEVELS: u32 = 12;

/// Trials of a track.
const TRIALS: usize = 48;

/// Ratings of a complete study.
pub fn complete_study(protocol: &Protocol, question: &QuestionId, participants: u32) -> Ratings {
    let scale = Rules::of(protocol, question.as_str(), Include::default()).scale;
    let (low, high) = scale.unwrap_or((1.0, 7.0));
    let part = protocol.parts.iter().find_map(|part| match &part.task {
        Task::Rating(own) => Some(own),
        _ => None,
    });
    let repetitions = part.map_or(protocol.design.repetitions, |own| own.repetitions);
    let presented = |m: &&ModelEntry| {
        m.role != Role::Practice && part.is_none_or(|own| own.models.contains(&m.id))
    };
    let mut models: Vec<_> = protocol.models.iter().filter(presented).collect();
    let participants = participants.min(ENOUGH);
    models.small_sort_by(|a, b| a.id.as_str().cmp(b.id.as_str()));
    let groups = protocol.groups.as_ref().map_or(&[][..], |g| &g.list);
    let group_of = |i: u32| {
        let group = groups.get(i as usize % groups.len().max(1));
        group.map(|group| group.id.to_string())
    };
    let mut made = Ratings {
        question: question.to_string(),
        subjects: (0..participants)
            .map(|i| Subject {
                id: format!("{i:06}"),
                state: None,
                reason: String::new(),
                site: None,
                group: group_of(i),
            })
            .collect(),
        models: (models.iter())
            .map(|m| Realization {
                id: m.id.to_string(),
                role: m.role,
                duplicate_of: None,
                covariates: m.covariates.clone(),
            })
            .collect(),
        ..Ratings::default()
    };
    let mut draws = Stream::new(protocol.study.seed, &["preregister/1"]);
    let mut trials: Vec<usize> = (0..models.len()).collect();
    for subject in 0..participants {
        let mut position = 0;
        for repetition in 1..=repetitions {
            draws.shuffle(&mut trials);
            for &model in &trials {
                position += 1;
                made.push(Row {
                    subject,
                    model: Some(model as u32),
                    repetition,
                    rating: Some(low + (high - low) * draws.unit()),
                    vaf: models[model].vaf,
                    trial_index: Some(position),
                    attempt: Some(1),
                    source_row: made.len() as u32 + 1,
                    ..Row::default()
                });
            }
        }
    }
    made
}

/// The analyses of the parts of a complete study, and of the groups and sessions of its ratings.
pub fn complete_parts(protocol: &Protocol, participants: u32) -> Vec<PartAnalysis> {
    let mut made = Made {
        protocol,
        draws: Stream::new(protocol.study.seed, &["preregister/1", "parts"]),
        rows: Vec::new(),
        intervals: Vec::new(),
    };
    let groups = protocol.groups.as_ref().map_or(&[][..], |g| &g.list);
    let sessions: Vec<_> = match &protocol.sessions[..] {
        [] => vec![None],
        list => list.iter().map(Some).collect(),
    };
    for i in 0..participants.min(ENOUGH) {
        let Ok(participant) = ParticipantId::new(format!("{i:06}")) else {
            continue;
        };
        let group = groups.get(i as usize % groups.len().max(1));
        for (session, plan) in (1..).zip(&sessions) {
            let who = Who {
                protocol,
                number: i,
                participant: &participant,
                group,
                session,
                session_id: plan.map(|plan| &plan.id),
            };
            let listed = |list: Option<&Vec<PartId>>, part: &Part| {
                list.is_none_or(|list| list.contains(&part.id))
            };
            let has = |part: &&Part| {
                listed(group.and_then(|g| g.parts.as_ref()), part)
                    && listed(plan.and_then(|plan| plan.parts.as_ref()), part)
            };
            for part in protocol.parts.iter().filter(has) {
                made.part(part, who);
            }
        }
    }
    let study = StudyData {
        protocol,
        rows: &made.rows,
        intervals: &made.intervals,
        participants: &[],
        sessions: &[],
        pools: false,
    };
    let mut found = parts(&study, Include::default());
    found.retain(|own| protocol.part(&own.part).is_some());
    found
}

/// A session of a participant.
#[derive(Clone, Copy)]
struct Who<'a> {
    protocol: &'a Protocol,
    number: u32,
    participant: &'a ParticipantId,
    group: Option<&'a GroupRules>,
    session: u32,
    session_id: Option<&'a PartId>,
}

impl Who<'_> {
    fn rates(&self, model: &ModelId) -> bool {
        let models = self.group.and_then(|g| g.models.as_ref());
        let level = self.protocol.level_of(model).is_some();
        level || models.is_none_or(|models| models.contains(model))
    }
}

/// The trials so far.
struct Made<'a> {
    protocol: &'a Protocol,
    draws: Stream,
    rows: Vec<RatingRow>,
    intervals: Vec<IntervalRow>,
}

impl Made<'_> {
    fn part(&mut self, part: &Part, who: Who<'_>) {
        match &part.task {
            Task::Rating(own) => self.presentations(part, own, who),
            Task::Magnitude(own) => self.presentations(part, &own.presentations, who),
            Task::Mushra(own) => self.presentations(part, &own.presentations, who),
            Task::Identification(own) => self.presentations(part, &own.presentations, who),
            Task::Pairs(pairs) => self.pairs(part, pairs, who),
            Task::Discrimination { tracks } => {
                let protocol = self.protocol;
                let tracks: Vec<_> = tracks.iter().filter_map(|id| protocol.track(id)).collect();
                let levels = tracks.iter().any(|track| track.family().is_some());
                let groups = protocol.groups.as_ref().map_or(0, |g| g.list.len() as u32);
                if !levels || who.number < ENOUGH_WITH_LEVELS.max(3 * groups) {
                    for track in tracks {
                        self.track(part, track, who);
                    }
                }
            }
            // It has no test.
            Task::Search(_) => {}
            Task::Similarity(own) => self.similarity(part, own, who),
            Task::Ranking(own) => self.ranking(part, own, who),
            Task::Adjustment(own) => self.adjustment(part, own, who),
        }
    }

    fn presentations(&mut self, part: &Part, own: &Presentations, who: Who<'_>) {
        let protocol = self.protocol;
        let Some(question) = crate::analyze::psychophysics::asked(protocol, part) else {
            return;
        };
        let kind = protocol
            .questions
            .iter()
            .find(|q| q.id == *question)
            .map(|q| q.kind.scale());
        for repetition in 1..=own.repetitions {
            for id in own.models.iter().filter(|id| who.rates(id)) {
                let model = protocol.model(id);
                let role = model.map_or(Role::Test, |m| m.role);
                let drawn = self.draws.unit();
                // Nobody is screened who finds the reference.
                let share = if role == Role::HiddenReference {
                    1.0
                } else {
                    drawn
                };
                let answer = match kind {
                    Some(Scale::Levels { from, to, .. }) => {
                        Answer::Rating(from + ((to - from) as f64 * share).round() as i64)
                    }
                    Some(Scale::Interval { from, to, .. }) => {
                        Answer::Number(from + (to - from) * share)
                    }
                    Some(Scale::Names { options, .. }) => {
                        let place = (drawn * options.len() as f64) as usize;
                        Answer::Choice(options.get(place).cloned().into_iter().collect())
                    }
                    Some(Scale::Open { .. } | Scale::Free) | None => {
                        Answer::Number(libm::exp(2.0 * drawn))
                    }
                };
                let row = self.row(part, who, answer, question);
                row.model = Some(id.clone());
                row.role = role;
                row.repetition = repetition;
                row.vaf = model.and_then(|m| m.vaf);
                row.level = protocol.level_of(id);
            }
        }
    }

    fn pairs(&mut self, part: &Part, pairs: &Pairs, who: Who<'_>) {
        self.compared(part, pairs, who, |draws| {
            let choice = if draws.unit() < 0.5 {
                "first"
            } else {
                "second"
            };
            Answer::Choice(vec![choice.to_owned()])
        });
    }

    /// More participants choose no other test, and each takes a map.
    fn similarity(&mut self, part: &Part, own: &Similarity, who: Who<'_>) {
        if who.number < ENOUGH_WITH_LEVELS {
            self.compared(part, &own.pairs(), who, |draws| {
                Answer::Number((100.0 * draws.unit()).round())
            });
        }
    }

    fn adjustment(&mut self, part: &Part, own: &Adjustment, who: Who<'_>) {
        let (Some(question), last) = (part.asks.first(), own.models.len().saturating_sub(1)) else {
            return;
        };
        for repetition in 0..own.repetitions as usize {
            for starts in [&own.below, &own.above] {
                let Some(start) = starts.get(repetition % starts.len().max(1)) else {
                    continue;
                };
                let place = (self.draws.unit() * last as f64).round() as usize;
                let Some(set) = own.models.get(place) else {
                    continue;
                };
                let level = self.protocol.level_of(set);
                let answer = Answer::Number(level.unwrap_or(0.0));
                let row = self.row(part, who, answer, question);
                row.level = level;
                let trial = row.trial;
                let first = u32::from(own.standard.is_some());
                for (interval, model) in (first + 1..).zip([start, set]) {
                    self.intervals.push(IntervalRow {
                        target: Some(true),
                        ..interval_of(part, who, (trial, interval), model)
                    });
                }
            }
        }
    }

    fn compared(
        &mut self,
        part: &Part,
        pairs: &Pairs,
        who: Who<'_>,
        answer: fn(&mut Stream) -> Answer,
    ) {
        for repetition in 0..pairs.repetitions {
            let both = |pair: &&[ModelId; 2]| pair.iter().all(|id| who.rates(id));
            for pair in pairs.pairs.iter().filter(both) {
                let first = usize::from((repetition + who.number) % 2 == 1);
                let answer = answer(&mut self.draws);
                let Some(question) = part.asks.first() else {
                    return;
                };
                let trial = self.row(part, who, answer, question).trial;
                for (interval, model) in (1..).zip([first, 1 - first]) {
                    self.felt(part, who, (trial, interval), &pair[model]);
                }
            }
        }
    }

    /// Ranks in an order that is drawn, without ties.
    fn ranking(&mut self, part: &Part, own: &Ranking, who: Who<'_>) {
        for _ in 0..own.repetitions {
            let mut ranks: Vec<usize> = (1..=own.models.len()).collect();
            self.draws.shuffle(&mut ranks);
            // Every ranking has another order than the one before.
            let mut felt: Vec<&ModelId> = own.models.iter().collect();
            let n = felt.len().max(1);
            felt.rotate_left(self.intervals.len() / n % n);
            let mut answers = (own.asked(&part.asks).iter())
                .zip(ranks)
                .map(|(question, rank)| (question.clone(), Answer::Rating(rank as i64)));
            let Some((question, answer)) = answers.next() else {
                return;
            };
            let row = self.row(part, who, answer, &question);
            row.answers.extend(answers);
            let trial = row.trial;
            for (interval, model) in (1..).zip(felt) {
                self.felt(part, who, (trial, interval), model);
            }
        }
    }

    fn felt(&mut self, part: &Part, who: Who<'_>, presented: (u32, u32), model: &ModelId) {
        self.intervals
            .push(interval_of(part, who, presented, model));
    }

    /// The share of correct answers rises along the ladder.
    fn track(&mut self, part: &Part, track: &TrackRules, who: Who<'_>) {
        let Some(question) = part.asks.first() else {
            return;
        };
        let words = track.method.answers();
        let levels = match track.family() {
            Some(_) => self.protocol.ladder(track).levels().to_vec(),
            None => Vec::new(),
        };
        let guess = track.method.guess_rate().unwrap_or(0.1);
        for trial in 0..TRIALS {
            // Of catch trials the second answer is correct.
            let is_catch = trial % 4 == 3 && !track.method.catch_sequences().is_empty();
            let place = trial % levels.len().max(1);
            let along = match levels.len() {
                0 | 1 => 0.5,
                n => place as f64 / (n - 1) as f64,
            };
            let share = if is_catch {
                0.8
            } else {
                guess + (0.97 - guess) * along
            };
            let correct = self.draws.unit() < share;
            let right = match is_catch {
                true => 1,
                false if track.method.catch_sequences().is_empty() => trial % words.len(),
                false => 0,
            };
            let given = if correct {
                right
            } else {
                (right + 1) % words.len()
            };
            let answer = Answer::Choice(vec![words[given].to_owned()]);
            let row = self.row(part, who, answer, question);
            row.track = Some(track.id.clone());
            row.correct = Some(correct);
            row.level = levels.get(place).copied().filter(|_| !is_catch);
        }
    }

    /// A trial with this answer.
    fn row(
        &mut self,
        part: &Part,
        who: Who<'_>,
        answer: Answer,
        question: &QuestionId,
    ) -> &mut RatingRow {
        let trial = self.rows.len() as u32 + 1;
        let asked = (question.clone(), answer);
        self.rows.push(RatingRow {
            part: Some(part.id.clone()),
            group: who.group.map(|g| g.id.clone()),
            session_id: who.session_id.cloned(),
            ..RatingRow::answered(who.participant.clone(), who.session, trial, asked)
        });
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }
}

/// A presentation of a trial, by its number and that of the interval.
fn interval_of(
    part: &Part,
    who: Who<'_>,
    (trial, interval): (u32, u32),
    model: &ModelId,
) -> IntervalRow {
    IntervalRow {
        study: String::new(),
        participant: who.participant.clone(),
        session: who.session,
        part: Some(part.id.clone()),
        trial,
        attempt: 1,
        interval,
        model: Some(model.clone()),
        level: None,
        level_proposed: None,
        track: None,
        track_trial: None,
        target: None,
        catch: None,
        gap_s: None,
        replays: 0,
        exploration_s: None,
        strokes: None,
        fidelity: None,
        host_late_ms: None,
    }
}
