//! Replaying the adjustments of a session from its journal.

use super::Finding;
use crate::outcome::fold::{History, OpenAttempt};
use crate::outcome::{Event, FormId};
use crate::store::sessions::SessionData;
use study_plan::protocol::{Adjustment, Answer, Part, Protocol};

/// Compares each change of a level with the ladder: none was larger than a step, the standard is that of the part, and the
/// answer is the level that was felt last. The first difference of a part is a problem.
pub(super) fn verify_adjustments(
    session: &SessionData,
    protocol: &Protocol,
    place: &str,
    found: &mut Vec<Finding>,
) {
    let Some(start) = session.history.start() else {
        return;
    };
    let protocol = &protocol.of(&start.assigned);
    for part in &protocol.parts {
        if let Some(own) = part.task.adjustment()
            && let Some(what) = difference(session, protocol, (part, own))
        {
            let what = format!("adjustment `{}`: {what}", part.id);
            found.push(Finding::problem(place, what));
        }
    }
}

fn difference(
    session: &SessionData,
    protocol: &Protocol,
    (part, own): (&Part, &Adjustment),
) -> Option<String> {
    let mut history = History::default();
    for entry in &session.entries {
        let open = history.open();
        let open = open.filter(|open| open.trial.part.as_ref() == Some(&part.id));
        match (&entry.event, open) {
            (
                Event::Adjusted {
                    trial,
                    to,
                    standard,
                    ..
                },
                Some(OpenAttempt { attempt, .. }),
            ) => {
                // A damaged journal lacks what came before.
                let before = attempt.set_to();
                let steps = before.and_then(|before| own.steps(before, to));
                let good = match standard {
                    true => own.standard.as_ref() == Some(to),
                    false => before.is_none() || steps.is_some_and(|steps| steps <= 1),
                };
                if !good {
                    return Some(format!(
                        "trial {trial} changes to `{to}`, which is not a step"
                    ));
                }
            }
            (
                Event::Answered {
                    form: FormId::Trial { trial, .. },
                    question,
                    answer: Answer::Number(level),
                    ..
                },
                Some(OpenAttempt { attempt, .. }),
            ) if part.asks.first() == Some(question) => {
                let set = attempt.set_to().and_then(|set| protocol.level_of(set));
                if set.is_some_and(|set| set != *level) {
                    return Some(format!(
                        "trial {trial} has the answer {level}, and another level was felt last"
                    ));
                }
            }
            _ => {}
        }
        history.apply(&entry.event, entry.at);
    }
    None
}
