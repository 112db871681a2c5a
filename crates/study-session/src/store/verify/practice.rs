//! Replaying the ends of practice from the journal of a session.

use super::Finding;
use crate::outcome::Event;
use crate::outcome::fold::History;
use crate::store::sessions::SessionData;
use study_base::text::counted;
use study_plan::protocol::{Criterion, Part, Protocol};

/// Compares the end of each practice that has a criterion with the answers before it: none came to its end earlier, and no
/// practice trial began after the criterion was reached. The first difference of a part is a problem.
pub(super) fn verify_practice(
    session: &SessionData,
    protocol: &Protocol,
    place: &str,
    found: &mut Vec<Finding>,
) {
    let Some(start) = session.history.start() else {
        return;
    };
    let protocol = &protocol.of(&start.assigned);
    let criterion = |part: &Part| part.task.identification()?.criterion;
    for part in &protocol.parts {
        if let Some(criterion) = criterion(part)
            && let Some(what) = difference(session, part, criterion)
        {
            let what = format!("practice of `{}`: {what}", part.id);
            found.push(Finding::problem(place, what));
        }
    }
}

fn difference(session: &SessionData, part: &Part, criterion: Criterion) -> Option<String> {
    let mut history = History::default();
    for entry in &session.entries {
        match &entry.event {
            Event::PracticeEnded { part: ended } if *ended == part.id => {
                let answers = history.practiced(part);
                if !criterion.is_reached(&answers) {
                    let Criterion { correct, of, .. } = criterion;
                    return Some(format!(
                        "it ended after {}, before {correct} of the last {of} were correct",
                        counted(answers.len(), "answer", "answers")
                    ));
                }
            }
            Event::AttemptStarted { trial, .. } => {
                let planned = history.planned(*trial);
                let practiced = planned.filter(|t| t.practice && t.part.as_ref() == Some(&part.id));
                // In older journals a trial that had failed could come after the end.
                let goes_on = practiced.is_some_and(|trial| !history.has_ended(trial));
                if goes_on && criterion.is_reached(&history.practiced(part)) {
                    return Some(format!(
                        "trial {trial} began although its criterion was reached"
                    ));
                }
            }
            _ => {}
        }
        history.apply(&entry.event, entry.at);
    }
    None
}
