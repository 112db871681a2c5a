//! Pages and events in the order in which they came, of a session or of one trial.

use crate::plain::pages;
use study_session::outcome::{Entry, Event, FormId};
use study_session::session::retrace::Shown;
use study_session::session::view::MessageKind;
use study_session::session::{Screen, View};

/// What came next.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step<'a> {
    /// A page appeared.
    Page(&'a Shown),
    /// Something happened.
    Event(&'a Entry),
}

impl Step<'_> {
    /// Whether it tells of a realization: a page that says whether the answer was right, and which
    /// one would have been, and media that came, since not all realizations have as many.
    pub(super) fn tells(&self) -> bool {
        match self {
            Self::Page(shown) => matches!(
                shown.view.screen,
                Screen::Message {
                    kind: MessageKind::Feedback,
                    ..
                }
            ),
            Self::Event(entry) => matches!(entry.event, Event::MediaShown { .. }),
        }
    }
}

/// The steps of a session, or those of a trial: its pages and events, and what happened
/// during its attempts.
pub(super) fn steps<'a>(
    entries: &'a [Entry],
    shown: &'a [Shown],
    trial: Option<u32>,
) -> Vec<Step<'a>> {
    let is_wanted = |of: Option<u32>| trial.is_none_or(|trial| of == Some(trial));
    let page = |shown: &&Shown| is_wanted(shown.of.map(|(trial, _)| trial));
    let mut steps = Vec::new();
    let mut pages = shown.iter().peekable();
    let mut open = None;
    for (i, entry) in entries.iter().enumerate() {
        while let Some(shown) = pages.next_if(|shown| shown.after <= i) {
            steps.extend(Some(shown).filter(page).map(Step::Page));
        }
        if let Event::AttemptStarted { trial, .. } = &entry.event {
            open = Some(*trial);
        }
        if is_wanted(trial_of(&entry.event).or(open)) {
            steps.push(Step::Event(entry));
        }
        if ends_attempt(&entry.event) {
            open = None;
        }
    }
    steps.extend(pages.filter(page).map(Step::Page));
    steps
}

fn ends_attempt(event: &Event) -> bool {
    matches!(
        event,
        Event::AttemptFailed { .. } | Event::TrialDone { .. } | Event::TrialClosed { .. }
    )
}

/// The trial to which an event belongs, if it names one.
fn trial_of(event: &Event) -> Option<u32> {
    match event {
        Event::Answered { form, .. } | Event::Corrected { form, .. } => match form {
            FormId::Trial { trial, .. } | FormId::After { trial, .. } => Some(*trial),
            FormId::Setup | FormId::Intake | FormId::Outro | FormId::Consent => None,
        },
        Event::AttemptStarted { trial, .. }
        | Event::PlaybackStarted { trial, .. }
        | Event::PlaybackEnded { trial, .. }
        | Event::Replayed { trial, .. }
        | Event::TelemetryLost { trial, .. }
        | Event::AttemptFailed { trial, .. }
        | Event::TrialDone { trial, .. }
        | Event::FormDelayed { trial, .. }
        | Event::StepFailed { trial, .. }
        | Event::MediaShown { trial, .. }
        | Event::TrialClosed { trial, .. }
        | Event::Adjusted { trial, .. } => Some(*trial),
        Event::Remark { trial, .. } | Event::NumbersSent { trial, .. } => *trial,
        _ => None,
    }
}

/// The lines of a page, as a session in lines prints them, with all questions on it and
/// without what is to be typed.
pub(super) fn lines(view: &View) -> Vec<String> {
    let parts = match &view.screen {
        Screen::Form { questions, .. } => questions.len(),
        _ => 1,
    };
    let mut lines = Vec::new();
    for at in 0..parts {
        let page = pages::page(view, at, true);
        if at == 0 {
            lines.extend(page.top);
        }
        lines.extend(page.lines);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use chrono::DateTime;
    use study_plan::protocol::Medium;
    use study_session::outcome::{Author, Failure, Moment};

    fn entries(events: Vec<Event>) -> Vec<Entry> {
        let at = Moment {
            wall: DateTime::UNIX_EPOCH.fixed_offset(),
            mono_ns: 0,
        };
        (0..)
            .zip(events)
            .map(|(seq, event)| Entry { seq, at, event })
            .collect()
    }

    fn attempt(trial: u32) -> Event {
        Event::AttemptStarted {
            trial,
            attempt: 1,
            position: trial,
            model: None,
            reference_s: 0.0,
            intervals: Vec::new(),
            level: None,
        }
    }

    #[test]
    fn a_trial_has_what_happened_during_its_attempts_and_no_other_trial() {
        let remark = |trial| Event::Remark {
            by: Author::Experimenter,
            trial,
            text: "loud".to_owned(),
        };
        let failed = Event::AttemptFailed {
            trial: 2,
            attempt: 1,
            failure: Failure::MarkedBad,
            detail: String::new(),
            queue: vec![3, 2],
            constraint_broken: false,
            paused_s: None,
        };
        let entries = entries(vec![
            Event::InstructionsRead,
            attempt(2),
            Event::Paused,
            failed,
            remark(None),
            attempt(3),
            remark(Some(2)),
            Event::Paused,
        ]);
        let of = |trial: Option<u32>| {
            let each = steps(&entries, &[], trial)
                .into_iter()
                .map(|step| match step {
                    Step::Event(entry) => entry.seq,
                    Step::Page(_) => u64::MAX,
                });
            each.collect::<Vec<_>>()
        };
        assert_eq!(of(None), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(of(Some(2)), [1, 2, 3, 6]);
        assert_eq!(of(Some(3)), [5, 7]);
    }
    /// With a sound beside its picture a realization has one more of them.
    #[test]
    fn media_tell_which_realization_was_felt() {
        let came = |medium| Event::MediaShown {
            trial: 2,
            attempt: 1,
            interval: None,
            medium,
            offset_ms: 20.0,
            uncertainty_ms: 1.0,
        };
        let entries = entries(vec![
            attempt(2),
            came(Medium::Picture),
            came(Medium::Sound),
            Event::Paused,
        ]);
        let steps = steps(&entries, &[], Some(2));
        let told: Vec<bool> = steps.iter().map(Step::tells).collect();
        assert_eq!(told, [false, true, true, false]);
    }
}
