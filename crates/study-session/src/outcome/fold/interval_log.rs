//! The rows of `intervals.csv`: every presentation, of failed attempts, too.

use super::{Attempt, History, Presentation};
use crate::outcome::event::Start;
use crate::outcome::rows::IntervalRow;
use study_plan::protocol::{Interval, Protocol, Stimuli, Trial};

/// One row for each presentation, by trial and attempt.
pub fn interval_rows(history: &History, protocol: &Protocol) -> Vec<IntervalRow> {
    let Some(start) = history.start() else {
        return Vec::new();
    };
    let mut rows = Vec::new();
    for (number, attempt) in history.all_attempts() {
        let Some(trial) = history.planned(number) else {
            continue;
        };
        for presentation in &attempt.presentations {
            rows.push(row(start, trial, attempt, presentation, protocol));
        }
    }
    rows
}

fn row(
    start: &Start,
    trial: &Trial,
    attempt: &Attempt,
    presentation: &Presentation,
    protocol: &Protocol,
) -> IntervalRow {
    let at = presentation.interval.saturating_sub(1) as usize;
    let model = attempt.models.get(at);
    let track = trial.track().and_then(|id| protocol.track(id));
    let intervals: Option<&[Interval]> = match &trial.stimuli {
        Stimuli::Track { intervals, .. } => Some(intervals),
        Stimuli::One { .. }
        | Stimuli::Rated { .. }
        | Stimuli::Pair { .. }
        | Stimuli::Search { .. }
        | Stimuli::Set { .. }
        | Stimuli::Adjusted { .. } => None,
    };
    let playback = presentation.ended.map(|(_, ended)| ended.playback);
    IntervalRow {
        study: start.study.clone(),
        participant: start.participant.clone(),
        session: start.session,
        part: trial.part.clone(),
        trial: trial.trial,
        attempt: attempt.number,
        interval: presentation.interval,
        model: model.cloned(),
        level: model.and_then(|id| protocol.level_of(id)),
        level_proposed: attempt.level.and_then(|level| level.proposed),
        track: trial.track().cloned(),
        track_trial: trial.track().map(|_| trial.repetition),
        target: intervals
            .and_then(|i| i.get(at))
            .map(|i| *i == Interval::Comparison)
            .or_else(|| {
                let level = !attempt.is_standard(presentation.interval);
                attempt.is_adjusted().then_some(level)
            }),
        catch: track.and_then(|t| Some(t.method.is_catch(intervals?))),
        gap_s: presentation.gap_s,
        replays: presentation.replays,
        exploration_s: playback.map(|p| p.exploration_s).filter(|s| s.is_finite()),
        strokes: playback.filter(|p| p.samples > 0).map(|p| p.strokes),
        fidelity: presentation
            .judged
            .and_then(|i| attempt.rendering.get(i).cloned()),
        host_late_ms: playback.and_then(|p| Some(p.host_late_ms?[1])),
    }
}
