//! Studies with parts, and an observer who answers in them.

use super::rig::Rig;
use study_base::text::QuestionId;
use study_plan::procedure::Recorded;
use study_plan::protocol::file::parse;
use study_plan::protocol::{Answer, Interval, Protocol, Stimuli};
use study_session::outcome::{Author, Event, FormId};
use study_session::session::{Ending, Input, Screen};

const HEAD: &str = r#"
format = "study-protocol/2"
study = { id = "s", title = "t", seed = 3 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
models = [{ id = "XQZ-7", file = "a.toml" }, { id = "KJW-3", file = "b.toml" }, { id = "VVB-9", file = "c.toml" }]

[[families]]
id = "damping"
from = "a.toml"
vary = "b"
range = [1.0, 3.0]
steps = 41
"#;

pub(super) const STAIRCASE: &str = r#"{ rule = "staircase", up = 1, down = 3, start = 2.0, steps = [0.2, 0.1], stop = { reversals = 4, max_trials = 60 } }"#;
pub(super) const QUEST: &str =
    r#"{ rule = "quest+", trials = 16, lapse = [0.02], slope = [2, 4] }"#;

pub(super) fn read(text: &str) -> Protocol {
    whole(&format!("{HEAD}{text}"))
}

/// The same with keys that only the newest format has.
fn read_newest(text: &str) -> Protocol {
    let head = HEAD.replace("study-protocol/2", "study-protocol/3");
    whole(&format!("{head}{text}"))
}

fn whole(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let shown = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
}

/// One track of a method; `more` is added to the track.
pub(super) fn track(method: &str, procedure: &str, more: &str) -> Protocol {
    read(&format!(
        r#"
[analysis]
primary = "which"
[[parts]]
id = "which"
kind = "discrimination"
prompt = "Which?"
tracks = ["up"]
[[tracks]]
id = "up"
method = "{method}"
family = "damping"
standard = 1.0
procedure = {procedure}
{more}
"#
    ))
}

pub(super) fn pairs(more: &str) -> Protocol {
    read(&format!(
        r#"
[analysis]
primary = "real"
[[parts]]
id = "real"
kind = "pairs"
prompt = "Which?"
repetitions = 2
{more}
"#
    ))
}

pub(super) fn beside_a_reference() -> Protocol {
    let head = HEAD.replace(
        "file = \"a.toml\" }",
        "file = \"a.toml\", role = \"hidden-reference\" }",
    );
    let text = r#"
[analysis]
primary = "close"
[[parts]]
id = "close"
kind = "mushra"
prompt = "How close?"
reference = "XQZ-7"
repetitions = 2
"#;
    parse("p", &format!("{head}{text}")).protocol.unwrap()
}

pub(super) fn magnitudes() -> Protocol {
    read(
        r#"
[analysis]
primary = "strong"
[[parts]]
id = "strong"
kind = "magnitude"
prompt = "How strong?"
family = "damping"
repetitions = 1
"#,
    )
}

/// Two realizations with labels that are words of the program elsewhere; `more` is added to the part.
pub(super) fn identification(more: &str) -> Protocol {
    let text = format!(
        r#"
[analysis]
primary = "which"
[[parts]]
id = "which"
kind = "identification"
prompt = "Which?"
answers = [{{ label = "first", models = ["XQZ-7"] }}, {{ label = "no", models = ["KJW-3", "VVB-9"] }}]
repetitions = 2
{more}
"#
    );
    read_newest(&text)
}

/// Three realizations whose differences are rated; `more` is added to the part.
pub(super) fn similarity(more: &str) -> Protocol {
    let text = format!(
        r#"
[analysis]
primary = "apart"
[[parts]]
id = "apart"
kind = "similarity"
prompt = "How different?"
same = "alike"
different = "very different"
repetitions = 2
{more}
"#
    );
    read_newest(&text)
}

/// Three realizations that are ranked; `more` is added to the part.
pub(super) fn ranking(more: &str) -> Protocol {
    let text = format!(
        r#"
[analysis]
primary = "order"
[[parts]]
id = "order"
kind = "ranking"
prompt = "Which rank has number {{n}}?"
first = "best"
last = "worst"
models = ["XQZ-7", "KJW-3", "VVB-9"]
{more}
"#
    );
    read_newest(&text)
}

/// A level of damping that is set, from 1.5 and 2.5; `more` is added to the part.
pub(super) fn adjustment(more: &str) -> Protocol {
    let text = format!(
        r#"
[analysis]
primary = "equal"
[[parts]]
id = "equal"
kind = "adjustment"
prompt = "Until both feel equal."
lower = "less"
higher = "more"
confirm = "equal now"
family = "damping"
start_below = [1.5]
start_above = [2.5]
repetitions = 2
{more}
"#
    );
    read_newest(&text)
}

/// The answer of an observer who hears a level of 1.55 and above, and else says the other.
pub(super) fn observed(rig: &Rig) -> Vec<(QuestionId, Answer)> {
    let open = rig.session.history().open().unwrap();
    let mut answers = rig.good_answers();
    if let (Stimuli::Track { intervals, .. }, Some(level)) =
        (&open.trial.stimuli, open.attempt.level)
    {
        let comparison = intervals.iter().position(|i| *i == Interval::Comparison);
        let heard = level.presented >= 1.55;
        let first = comparison == Some(0) && intervals.len() == 2;
        let word = if first == heard { "first" } else { "second" };
        let Screen::Form { questions, .. } = rig.view().screen else {
            return answers;
        };
        let word = Answer::Choice(vec![word.to_owned()]);
        // Other methods have other answers: the first of them.
        if questions[0].accepts(&word).is_ok() {
            answers[0].1 = word;
        }
    }
    answers
}

/// One step; the observer answers.
pub(super) fn step(rig: &mut Rig) {
    match rig.view().screen {
        Screen::Form { .. } => {
            rig.wait(1.0);
            let answers = observed(rig);
            rig.send(Input::Answer(answers));
        }
        _ => {
            rig.step();
        }
    }
}

pub(super) fn finish(rig: &mut Rig) {
    finish_by(rig, step);
}

/// To the end, with the steps of a kind of part.
pub(super) fn finish_by(rig: &mut Rig, step: fn(&mut Rig)) {
    while rig.ending.is_none() {
        step(rig);
    }
    assert_eq!(rig.ending, Some(Ending::Finished));
}

pub(super) fn done(rig: &Rig) -> usize {
    rig.count(|e| matches!(e, Event::TrialDone { .. }))
}

/// Steps until a screen after so many trials.
pub(super) fn until(rig: &mut Rig, trials: usize, screen: fn(&Screen) -> bool) {
    until_by(rig, step, trials, screen);
}

/// The same with the steps of a kind of part. A gap passes by itself: a step would also end the interval after it.
fn until_by(rig: &mut Rig, step: fn(&mut Rig), trials: usize, screen: fn(&Screen) -> bool) {
    let there = |rig: &Rig| done(rig) >= trials && screen(&rig.view().screen);
    while !there(rig) {
        assert_eq!(rig.ending, None);
        if matches!(rig.view().screen, Screen::Loading { .. }) {
            rig.wait(1.0);
            continue;
        }
        step(rig);
    }
}

/// A kind of part in a session in which everything goes wrong once.
pub(super) struct Course {
    /// One step, with the answers of the part.
    pub(super) step: fn(&mut Rig),
    /// Trials before the fault, the mark, the correction and the interruption.
    pub(super) after: [usize; 4],
    /// The screen at which the fault and the interruption come.
    pub(super) playing: fn(&Screen) -> bool,
    /// What is corrected in the form of the newest trial.
    pub(super) corrected: fn(FormId) -> (QuestionId, Answer),
}

/// A session with a fault in a later interval, a trial that is repeated, a correction and an interruption.
pub(super) fn eventful(protocol: &Protocol, course: &Course) -> Rig {
    let [fault, mark, correction, interruption] = course.after;
    let mut rig = Rig::new(protocol.clone());
    until_by(&mut rig, course.step, fault, course.playing);
    rig.send(Input::DeviceFault("no bus".to_owned()));
    until_by(&mut rig, course.step, mark, reference);
    rig.send(Input::MarkBad {
        reason: "noise".to_owned(),
    });
    until_by(&mut rig, course.step, correction, reference);
    let form = rig.view().correctable[0].form;
    let (question, answer) = (course.corrected)(form);
    rig.send(Input::Correct {
        form,
        question,
        answer,
        reason: "a slip".to_owned(),
        by: Author::Participant,
    });
    until_by(&mut rig, course.step, interruption, course.playing);
    rig.send(Input::Quit);
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 30.0);
    finish_by(&mut rig, course.step);
    rig
}

pub(super) fn recorded(rig: &Rig, protocol: &Protocol) -> Vec<Recorded> {
    rig.session.history().recorded(&protocol.tracks[0])
}

pub(super) fn second(screen: &Screen) -> bool {
    matches!(
        screen,
        Screen::Playing {
            interval: Some((2, 2)),
            ..
        }
    )
}

pub(super) fn answering(screen: &Screen) -> bool {
    matches!(screen, Screen::Form { .. })
}

pub(super) fn reference(screen: &Screen) -> bool {
    matches!(screen, Screen::Reference { .. })
}
