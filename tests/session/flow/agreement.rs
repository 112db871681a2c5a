//! The running session, the derived rows and a session resumed from the journal
//! agree after every event, whatever happens in whatever order.
//!
//! The expected facts are read from the events by [`Expected`], one question at a
//! time, without the fold of `outcome::fold`.

use super::random::{Act, act, perform};
use super::rig::{Rig, claim};
use super::studies::rich;
use chrono::TimeDelta;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::{Answer, Protocol, Trial};
use study_session::outcome::fold::{History, attempt_rows};
use study_session::outcome::{
    Choice, Entry, Event, FormId, Moment, ParticipantRow, RatingRow, State, Status,
};
use study_session::session::{Config, Effect, Ending, Input, Screen, Session, View};

#[derive(Debug, Clone)]
enum Move {
    Act(Act),
    /// Decline every question of the page on the screen.
    Decline,
    /// Correct one of the answers that can be corrected.
    Correct(usize, Answer),
    /// Refuse consent.
    Refuse,
    /// The device fails, if anything is loaded or playing.
    Fault,
    /// The process dies and the session is resumed after many hours.
    Return(Choice),
}

fn moves() -> impl Strategy<Value = Vec<Move>> {
    let answer = prop_oneof![
        (1..8i64).prop_map(Answer::Rating),
        Just(Answer::Text("other words".to_owned())),
        Just(Answer::Declined {
            reason: "not sure".to_owned()
        }),
    ];
    let one = prop_oneof![
        40 => act().prop_map(Move::Act),
        2 => Just(Move::Decline),
        4 => (0..12usize, answer).prop_map(|(which, answer)| Move::Correct(which, answer)),
        1 => Just(Move::Refuse),
        4 => Just(Move::Fault),
        2 => Just(Move::Return(Choice::RestartBlock)),
        1 => Just(Move::Return(Choice::DropOut)),
    ];
    proptest::collection::vec(one, 0..200)
}

fn make(rig: Rig, next: Move) -> Rig {
    let mut rig = match next {
        Move::Act(act) => return perform(rig, act),
        Move::Return(_) => perform(rig, Act::Crash(40_000.0)),
        _ => rig,
    };
    match next {
        Move::Decline => {
            let reason = "not said".to_owned();
            let declined = |(id, _)| {
                (
                    id,
                    Answer::Declined {
                        reason: reason.clone(),
                    },
                )
            };
            let page = rig.good_answers().into_iter().map(declined).collect();
            rig.send(Input::Answer(page));
        }
        Move::Correct(which, answer) => {
            let view = rig.view();
            if let Some(given) = view.correctable.get(which) {
                rig.send(Input::Correct {
                    form: given.form,
                    question: given.id().clone(),
                    answer,
                    reason: "misheard".to_owned(),
                    by: study_session::outcome::Author::Participant,
                });
            }
        }
        Move::Refuse => drop(rig.send(Input::Consent(false))),
        Move::Fault if rig.view().armed => {
            rig.send(Input::DeviceFault("too hot".to_owned()));
        }
        Move::Return(choice) => drop(rig.step().send(Input::Resume(choice))),
        Move::Act(_) | Move::Fault => {}
    }
    rig
}

/// The facts of a journal, each found by its own search through the events.
struct Expected<'a>(&'a [Entry]);

impl<'a> Expected<'a> {
    fn events(&self) -> impl DoubleEndedIterator<Item = (usize, &'a Event)> {
        self.0.iter().map(|e| &e.event).enumerate()
    }

    /// Whether a later restart of its block sent a trial back.
    fn sent_back(&self, trial: u32, since: usize) -> bool {
        self.events().skip(since).any(|(_, e)| {
            matches!(e, Event::Reopened { choice: Some(Choice::RestartBlock), queue, .. }
                if queue.contains(&trial))
        })
    }

    /// Where the last attempt at a trial started, its number and its position.
    fn last_attempt(&self, of: u32) -> Option<(usize, u32, u32)> {
        self.events().rev().find_map(|(i, e)| match e {
            Event::AttemptStarted {
                trial,
                attempt,
                position,
                ..
            } if *trial == of => Some((i, *attempt, *position)),
            _ => None,
        })
    }

    fn given_up(&self, of: u32) -> bool {
        let closed = |(i, e): (usize, &Event)| {
            matches!(e, Event::TrialClosed { trial, .. } if *trial == of).then_some(i)
        };
        let closed = self.events().rev().find_map(closed);
        closed.is_some_and(|i| !self.sent_back(of, i))
    }

    /// The attempt whose answers count.
    fn counted(&self, of: u32) -> Option<(u32, u32)> {
        let (at, number, position) = self.last_attempt(of)?;
        let failed = self.events().skip(at).any(|(_, e)| {
            matches!(e, Event::AttemptFailed { trial, attempt, .. }
                if *trial == of && *attempt == number)
        });
        (!failed && !self.sent_back(of, at)).then_some((number, position))
    }

    fn answers(&self, asked: FormId) -> BTreeMap<QuestionId, Answer> {
        let said = self.events().filter_map(|(_, e)| match e {
            Event::Answered {
                form,
                question,
                answer: last,
                ..
            }
            | Event::Corrected {
                form,
                question,
                to: last,
                ..
            } if *form == asked => Some((question.clone(), last.clone())),
            _ => None,
        });
        said.collect()
    }

    fn corrected(&self, asked: FormId) -> bool {
        self.events()
            .any(|(_, e)| matches!(e, Event::Corrected { form, .. } if *form == asked))
    }

    fn remarks(&self, of: u32) -> Vec<&'a str> {
        let of_trial = |(_, e): (usize, &'a Event)| match e {
            Event::Remark {
                trial: Some(trial),
                text,
                ..
            } if *trial == of => Some(text.as_str()),
            _ => None,
        };
        self.events().filter_map(of_trial).collect()
    }

    fn done(&self, of: u32) -> bool {
        let counted = self.counted(of).map(|(number, _)| number);
        self.events().any(|(_, e)| {
            matches!(e, Event::TrialDone { trial, attempt, .. }
                if *trial == of && Some(*attempt) == counted)
        })
    }

    fn state(&self) -> State {
        let state = |(_, e): (usize, &Event)| match e {
            Event::Finished => Some(State::Done),
            Event::Consented {
                accepted: false, ..
            }
            | Event::Reopened {
                choice: Some(Choice::DropOut),
                ..
            } => Some(State::DroppedOut),
            Event::StateSet { state, .. } => Some(*state),
            _ => None,
        };
        self.events()
            .rev()
            .find_map(state)
            .unwrap_or(State::Unfinished)
    }

    fn schedule(&self) -> &'a [Trial] {
        match &self.0[0].event {
            Event::SessionStarted(start) => &start.schedule,
            other => panic!("the journal begins with {other:?}"),
        }
    }
}

fn p01() -> ParticipantId {
    ParticipantId::new("P01").unwrap()
}

/// The rows say what the events say.
fn check_rows(journal: &[Entry], protocol: &Protocol) {
    let expected = Expected(journal);
    let history = History::of(journal);
    let rows = history.rating_rows(protocol);
    assert_eq!(rows.len(), expected.schedule().len());
    let mut closed = 0;
    for row in &rows {
        let trial = row.trial;
        let counted = expected.counted(trial);
        let form = counted.map(|(attempt, _)| FormId::Trial { trial, attempt });
        let answers = form.map(|p| expected.answers(p)).unwrap_or_default();
        let given_up = expected.given_up(trial);
        let last = expected.last_attempt(trial).map(|(_, n, p)| (n, p));
        let shown = counted.or(last.filter(|_| given_up));
        let status = match answers.get(&protocol.analysis.primary) {
            _ if given_up => Status::Failed,
            None => Status::Missing,
            Some(Answer::Declined { .. }) => Status::Declined,
            Some(_) => Status::Ok,
        };
        assert_eq!(row.attempt, shown.map(|(n, _)| n), "attempt of {trial}");
        assert_eq!(row.position, shown.map(|(_, p)| p), "position of {trial}");
        assert_eq!(row.status, status, "status of {trial}");
        assert_eq!(row.declined, answers.values().any(Answer::is_declined));
        assert_eq!(row.answers, answers, "answers of {trial}");
        let corrected = form.is_some_and(|p| expected.corrected(p));
        assert_eq!(row.corrected, corrected, "correction of {trial}");
        assert_eq!(row.remarks, expected.remarks(trial).join(" | "));
        let done = expected.done(trial);
        assert_eq!(row.response_s.is_some(), done, "completion of {trial}");
        closed += u32::from(!row.practice && (done || given_up));
    }
    let row = history.participant_row(&p01(), 1);
    assert_eq!(row.state, expected.state());
    assert_eq!(row.trials_done, closed);
    for form in [FormId::Setup, FormId::Intake, FormId::Outro] {
        for (question, answer) in expected.answers(form) {
            assert_eq!(row.answers[&question], answer);
        }
    }
    let log = attempt_rows(&history, &p01(), 1, journal);
    let logged = |what: &str| log.iter().filter(|r| r.what.as_str() == what).count();
    let count = |which: fn(&Event) -> bool| expected.events().filter(|(_, e)| which(e)).count();
    assert_eq!(
        logged("attempt"),
        count(|e| matches!(e, Event::AttemptStarted { .. }))
    );
    assert_eq!(
        logged("answer"),
        count(|e| matches!(e, Event::Answered { .. }))
    );
    assert_eq!(
        logged("correction"),
        count(|e| matches!(e, Event::Corrected { .. }))
    );
    assert_eq!(
        logged("failure"),
        count(|e| matches!(e, Event::AttemptFailed { .. }))
    );
}

/// Answers that can be corrected, as the screen has them.
fn correctable(view: &View) -> BTreeSet<(FormId, QuestionId, String)> {
    let shown = view.correctable.iter();
    shown
        .map(|c| (c.form, c.question.id.clone(), format!("{:?}", c.answer)))
        .collect()
}

/// The same, as the rows have them.
fn stored(
    rows: &[RatingRow],
    row: &ParticipantRow,
    protocol: &Protocol,
) -> BTreeSet<(FormId, QuestionId, String)> {
    let mut all = BTreeSet::new();
    for row in rows.iter().filter(|r| r.status != Status::Failed) {
        for (question, answer) in &row.answers {
            let (trial, attempt) = (row.trial, row.attempt.unwrap());
            let form = FormId::Trial { trial, attempt };
            all.insert((form, question.clone(), format!("{answer:?}")));
        }
    }
    for (form, questions) in [
        (FormId::Setup, &protocol.setup),
        (FormId::Intake, &protocol.intake),
        (FormId::Outro, &protocol.outro),
    ] {
        for id in questions.iter().map(|q| &q.id) {
            if let Some(answer) = row.answers.get(id) {
                all.insert((form, id.clone(), format!("{answer:?}")));
            }
        }
    }
    all
}

/// What a session shows is what the rows of its journal say.
fn check_live(session: &Session, now: Moment, journal: &[Entry], protocol: &Protocol) {
    let history = History::of(journal);
    assert_eq!(
        *session.history(),
        history,
        "the journal is the session's memory"
    );
    let rows = history.rating_rows(protocol);
    let row = history.participant_row(&p01(), 1);
    let view = session.view(now);
    assert_eq!(correctable(&view), stored(&rows, &row, protocol));
    let answered = rows
        .iter()
        .filter(|r| !r.practice && r.response_s.is_some());
    assert_eq!(view.line.trials_answered as usize, answered.count());
    if let Some(progress) = view.progress.filter(|p| !p.practice) {
        assert_eq!(progress.total, Some(row.trials_planned));
        assert_eq!(
            progress.current,
            (row.trials_done + 1).min(row.trials_planned)
        );
    }
    if matches!(view.screen, Screen::End { .. }) {
        assert_ne!(row.state, State::Unfinished);
    }
    let open: BTreeSet<u32> = rows
        .iter()
        .filter(|r| r.response_s.is_none() && r.status != Status::Failed)
        .map(|r| r.trial)
        .collect();
    let queue: BTreeSet<u32> = history.queue.iter().copied().collect();
    assert_eq!(queue, open, "what is to come is what is not closed");
}

/// Picks up a session from a journal a minute later, without choosing anything.
fn resumed(journal: &[Entry], protocol: &Arc<Protocol>) -> (Session, Moment, Vec<Entry>) {
    let now = Moment {
        wall: journal.last().unwrap().at.wall + TimeDelta::seconds(60),
        mono_ns: 7_000_000_000,
    };
    let (mut session, _) = Session::new(protocol.clone(), None, Config::default(), now);
    let identify = Input::Identify {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
    };
    session.handle(identify, now);
    let claim = claim(protocol, p01(), journal.to_vec());
    let effects = session.handle(Input::Claimed(Box::new(claim)), now);
    let mut journal = journal.to_vec();
    for effect in effects {
        if let Effect::Record(event) = effect {
            let (seq, at) = (journal.len() as u64, now);
            journal.push(Entry { seq, at, event });
        }
    }
    (session, now, journal)
}

fn check_resumed(journal: &[Entry], protocol: &Arc<Protocol>) {
    let (session, now, after) = resumed(journal, protocol);
    check_live(&session, now, &after, protocol);
    let before = History::of(journal);
    let history = session.history();
    assert_eq!(history.standing, before.standing);
    assert_eq!(history.answers, before.answers);
    assert!(history.completed().eq(before.completed()));
    let kept = |h: &History| {
        h.rating_rows(protocol)
            .into_iter()
            .map(|r| r.answers)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        kept(history),
        kept(&before),
        "nothing that was answered is lost"
    );
    if before.over() {
        assert_eq!(
            after.len(),
            journal.len(),
            "nothing is recorded after the end"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 60,
        max_shrink_iters: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn the_session_the_rows_and_a_resumed_session_agree_after_every_event(moves in moves()) {
        let protocol = Arc::new(rich());
        let mut rig = Rig::new(rich());
        let mut checked = 0;
        for next in moves {
            if rig.ending.is_some() {
                break;
            }
            rig = make(rig, next);
            let claimed = rig.session.history().start().is_some();
            if claimed {
                check_live(&rig.session, rig.now, &rig.journal, &protocol);
            }
            checked = checked.min(rig.journal.len());
            for end in checked + 1..=rig.journal.len() {
                check_rows(&rig.journal[..end], &protocol);
                check_resumed(&rig.journal[..end], &protocol);
            }
            checked = rig.journal.len();
        }
        let state = Expected(&rig.journal);
        match rig.ending.clone() {
            Some(Ending::Finished) => prop_assert_eq!(state.state(), State::Done),
            Some(Ending::DroppedOut) => prop_assert_eq!(state.state(), State::DroppedOut),
            Some(Ending::Interrupted) => prop_assert_eq!(state.state(), State::Unfinished),
            Some(Ending::Nothing) | None => {}
        }
    }
}

/// Once a participant has dropped out nothing is recorded: a trial marked as bad for the last time, and a
/// crash before its closing is recorded, would leave a trial that is neither to come nor closed.
#[test]
fn nothing_is_marked_as_bad_after_a_drop_out() {
    let bad = || {
        Move::Act(Act::Send(Input::MarkBad {
            reason: "why".to_owned(),
        }))
    };
    let steps = |n: usize| std::iter::repeat_n(Move::Act(Act::Step), n);
    let mut moves: Vec<Move> = steps(9).collect();
    moves.extend([bad(), Move::Act(Act::Step), Move::Fault]);
    moves.extend(steps(3).chain([Move::Return(Choice::DropOut), bad()]));
    let protocol = Arc::new(rich());
    let rig = moves.into_iter().fold(Rig::new(rich()), make);
    assert_eq!(rig.session.history().failures(1), 2);
    assert_eq!(Expected(&rig.journal).state(), State::DroppedOut);
    for end in 1..=rig.journal.len() {
        check_resumed(&rig.journal[..end], &protocol);
    }
}

/// The strategy reaches what it is there for.
#[test]
fn the_random_sessions_contain_every_kind_of_event() {
    use proptest::strategy::ValueTree as _;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for _ in 0..60 {
        let moves = moves().new_tree(&mut runner).unwrap().current();
        let mut rig = Rig::new(rich());
        for next in moves {
            if rig.ending.is_none() {
                rig = make(rig, next);
            }
        }
        for event in rig.events() {
            let kind = match event {
                Event::Corrected { .. } => "correction",
                Event::Answered {
                    answer: Answer::Declined { .. },
                    ..
                } => "declined",
                Event::Remark { .. } => "remark",
                Event::AttemptFailed { .. } => "failure",
                Event::TrialClosed { .. } => "given up",
                Event::TrialDone { .. } => "done",
                Event::Reopened {
                    choice: Some(Choice::RestartBlock),
                    ..
                } => "restart",
                Event::Reopened {
                    choice: Some(Choice::DropOut),
                    ..
                } => "drop-out",
                Event::Reopened { .. } => "resume",
                Event::Consented {
                    accepted: false, ..
                } => "no consent",
                _ => continue,
            };
            *seen.entry(kind).or_default() += 1;
        }
    }
    for kind in [
        "correction",
        "declined",
        "remark",
        "failure",
        "given up",
        "done",
        "restart",
        "drop-out",
        "resume",
        "no consent",
    ] {
        assert!(seen.contains_key(kind), "no {kind}: {seen:?}");
    }
}
