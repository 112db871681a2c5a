//! Replaying the adjustments of a session from its journal.

use super::Finding;
use crate::outcome::fold::{Attempt, History};
use crate::outcome::{Event, FormId};
use crate::store::sessions::SessionData;
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::{Adjustment, Answer, Part, Protocol, Stimuli, Trial};

/// Compares each trial with its plan and each change of a level with the ladder: it begins at its start, no change was larger
/// than a step or came before the level was felt, the standard is that of the part, and the answer is the level that was felt
/// last. The first difference of a part is a problem.
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
    let replay = Replay {
        protocol,
        part,
        own,
        whole: session.damage.iter().all(super::is_torn),
    };
    let mut history = History::default();
    for entry in &session.entries {
        let wrong = replay.wrong(&history, &entry.event);
        if wrong.is_some() {
            return wrong;
        }
        history.apply(&entry.event, entry.at);
    }
    None
}

/// A part of adjustment that is replayed.
struct Replay<'a> {
    protocol: &'a Protocol,
    part: &'a Part,
    own: &'a Adjustment,
    /// Whether no event is missing from the journal. A damaged one lacks what came before others.
    whole: bool,
}

impl Replay<'_> {
    /// What is wrong with an event, given those before it.
    fn wrong(&self, history: &History, event: &Event) -> Option<String> {
        match event {
            Event::AttemptStarted {
                trial,
                model,
                intervals,
                ..
            } => {
                let Stimuli::Adjusted { start, standard } = &self.trial(history, *trial)?.stimuli
                else {
                    return None;
                };
                let planned = standard.iter().chain([start]);
                let begun = model.iter().chain(intervals);
                (!planned.eq(begun)).then(|| format!("trial {trial} does not begin as planned"))
            }
            Event::Adjusted {
                trial,
                attempt,
                to,
                standard,
            } => {
                self.trial(history, *trial)?;
                let what = match self.under_way(history, (*trial, *attempt)) {
                    Ok(open) => self.change(open, to, *standard)?,
                    Err(what) => what,
                };
                Some(format!("trial {trial} changes to `{to}`, {what}"))
            }
            Event::Answered {
                form: FormId::Trial { trial, attempt },
                question,
                answer,
                ..
            } if self.is_set(question) => {
                self.trial(history, *trial)?;
                let what = match self.under_way(history, (*trial, *attempt)) {
                    Ok(open) => self.answer(open, answer)?,
                    Err(what) => what,
                };
                let answer = match answer.is_declined() {
                    true => "declined".to_owned(),
                    false => answer.cell(),
                };
                Some(format!("trial {trial} has the answer {answer}, {what}"))
            }
            // It can be left out later.
            Event::Corrected {
                form: FormId::Trial { trial, .. },
                question,
                to,
                ..
            } if self.is_set(question) && !to.is_declined() => {
                self.trial(history, *trial)?;
                let to = to.cell();
                Some(format!(
                    "the level of trial {trial} is corrected to {to}, and it was felt"
                ))
            }
            _ => None,
        }
    }

    /// A trial of the part.
    fn trial<'h>(&self, history: &'h History, trial: u32) -> Option<&'h Trial> {
        let planned = history.planned(trial)?;
        (planned.part.as_ref() == Some(&self.part.id)).then_some(planned)
    }

    /// Whether a question is the one whose answer is the level.
    fn is_set(&self, question: &QuestionId) -> bool {
        self.part.asks.first() == Some(question)
    }

    /// An attempt whose level is not confirmed; `None` if its start is missing from a damaged journal.
    ///
    /// # Errors
    /// That there is none, in words that follow what happened.
    fn under_way<'h>(
        &self,
        history: &'h History,
        (trial, attempt): (u32, u32),
    ) -> Result<Option<&'h Attempt>, &'static str> {
        if !self.whole && attempt > history.attempts(trial) {
            return Ok(None);
        }
        let open = history.open().filter(|open| {
            let same = (open.trial.trial, open.attempt.number) == (trial, attempt);
            same && !history.any_answer(open.form())
        });
        match open {
            Some(open) => Ok(Some(open.attempt)),
            None => Err("and is not under way"),
        }
    }

    /// What is wrong with a change.
    fn change(&self, open: Option<&Attempt>, to: &ModelId, standard: bool) -> Option<&'static str> {
        let good = match (standard, open.and_then(Attempt::set_to)) {
            (true, _) => self.own.standard.as_ref() == Some(to),
            (false, Some(before)) => self.own.steps(before, to).is_some_and(|n| n <= 1),
            (false, None) => self.own.steps(to, to).is_some(),
        };
        if !good {
            return Some("which is not a step");
        }
        // Each level is felt before the next one comes.
        let began = |open: &Attempt| open.presentations.len() == open.intervals() as usize;
        let skips = self.whole && !open.is_some_and(began);
        skips.then_some("and what came before was not felt")
    }

    /// What is wrong with an answer: a level whose force was wrong is felt again before it can be confirmed.
    fn answer(&self, open: Option<&Attempt>, answer: &Answer) -> Option<&'static str> {
        let set = open.and_then(Attempt::set_to);
        let set = set.and_then(|set| self.protocol.level_of(set));
        if set.is_some_and(|set| *answer != Answer::Number(set)) {
            return Some("and another level was felt last");
        }
        if open.is_some_and(|open| !open.is_right()) {
            return Some("and its force was wrong");
        }
        let felt = |open: &Attempt| open.interval().is_none() && !open.is_at_standard();
        let unfelt = self.whole && !open.is_some_and(felt);
        unfelt.then_some("and its level was not felt")
    }
}
