//! Pictures, videos and sounds on the participant's page, in step with the playback.
//!
//! The page has everything before a trial begins. It shows and plays the media of an interval once the device has confirmed
//! that it plays, and says when each came. Nothing is answered about media that did not come in time, that nobody is known
//! to have seen, or that went out of sight: the attempt fails, and its trial comes again.
//!
//! A session whose media nobody presents, such as a rehearsal, goes on without them.

use super::cue::{Cue, Loss, MediaReport, Shown, Shows};
use super::phase::Phase;
use super::{Effect, Session};
use crate::outcome::{Event, Failure, Moment};
use std::sync::Arc;
use study_plan::protocol::Medium;

/// The page is there if it said so within this time, s. It says so four times as often.
const HERE_WITHIN_S: f64 = 2.0;
/// Time for the report of an onset to arrive, in addition to that for the onset, s.
const REPORT_WITHIN_S: f64 = 1.0;
/// Longest time between an onset and its report, s: an older one is of no presentation that goes on.
const MOST_AGO_S: f64 = 3600.0;

/// What the experimenter reads after an attempt that failed: the same whatever was presented.
const NOT_IN_STEP: &str =
    "the participant's page was not in step: the trial comes again; attempts.csv has the reason";
/// The same where a step of an adjustment failed.
const STEP_NOT_IN_STEP: &str = "the participant's page was not in step: the level before is felt again; attempts.csv has the reason";
/// Why an attempt failed that ended, or went on, without a report.
const NOT_CONFIRMED: &str =
    "the participant's page did not confirm in time what it showed and played";

/// The media of a session.
#[derive(Debug, Default)]
pub(super) struct MediaState {
    /// What the page presents; `None` if nobody presents media.
    shows: Option<Arc<Shows>>,
    /// When the page last said that it is ready, unless it said since that it is not.
    ready: Option<Moment>,
    /// Presentations so far.
    cues: u64,
    presented: Option<Presented>,
}

/// The media of the present or last presentation.
#[derive(Debug)]
struct Presented {
    /// Trial and attempt.
    of: (u32, u32),
    /// The first presentation of the attempt.
    first: u64,
    cue: u64,
    since: Moment,
    media: Vec<Shown>,
    /// Those that have not come.
    awaited: Vec<Medium>,
}

impl MediaState {
    pub(super) fn new(shows: Option<Arc<Shows>>) -> Self {
        Self {
            shows: shows.filter(|shows| !shows.is_empty()),
            ..Self::default()
        }
    }

    /// Whether the page can show and play everything at this moment.
    fn is_ready(&self, at: Moment) -> bool {
        let said = self.ready;
        said.is_some_and(|last| at.seconds_since(&last) <= HERE_WITHIN_S)
    }
}

impl Session {
    /// Whether a trial cannot begin because the page is not ready.
    pub(super) fn waits_for_media(&self, at: Moment) -> bool {
        self.media.shows.is_some() && !self.media.is_ready(at)
    }

    /// Whether the interval that is loaded has media that the page could not present now: its attempt then fails, or its step
    /// alone where a level is set.
    pub(super) fn lacks_page(&mut self, at: Moment) -> bool {
        let lacks = !self.media_of_interval().is_empty() && !self.media.is_ready(at);
        if lacks {
            let what = "the participant's page was not ready when the playback was to start";
            if self.step_failed(Failure::Media, what, at) {
                self.out.push(Effect::Limp);
                self.notify(STEP_NOT_IN_STEP);
            } else {
                self.lose_media(what, at);
            }
        }
        lacks
    }

    /// The media of the interval under way.
    fn media_of_interval(&self) -> &[Shown] {
        let shows = self.media.shows.as_ref();
        let of = shows.zip(self.playing_model());
        of.and_then(|(shows, model)| shows.get(model))
            .map_or(&[], Vec::as_slice)
    }

    /// The device plays: so do the media of the interval.
    pub(super) fn present_media(&mut self, at: Moment) {
        if self.media.shows.is_none() {
            return;
        }
        let media = self.media_of_interval().to_vec();
        let Some(open) = self.history.open() else {
            return;
        };
        let of = (open.trial.trial, open.attempt.number);
        self.media.cues += 1;
        let cue = self.media.cues;
        let earlier = self.media.presented.as_ref().filter(|p| p.of == of);
        self.media.presented = Some(Presented {
            of,
            first: earlier.map_or(cue, |p| p.first),
            cue,
            since: at,
            awaited: media.iter().map(|shown| shown.medium).collect(),
            media,
        });
    }

    /// What the page is to show and play now.
    pub(super) fn cue(&self) -> Option<Cue> {
        let plays = matches!(self.phase, Phase::Playing { .. });
        let presented = self.media.presented.as_ref().filter(|_| plays)?;
        (!presented.media.is_empty()).then(|| Cue {
            cue: presented.cue,
            media: presented.media.clone(),
        })
    }

    /// Whether something that plays has not come yet.
    pub(super) fn awaits_media(&self) -> bool {
        let presented = self.media.presented.as_ref();
        presented.is_some_and(|presented| !presented.awaited.is_empty())
    }

    pub(super) fn media_report(&mut self, report: MediaReport, at: Moment) {
        match report {
            MediaReport::Here { ready } => self.media.ready = ready.then_some(at),
            MediaReport::Onset {
                cue,
                medium,
                ago_s,
                uncertainty_s,
            } => self.onset(cue, medium, (ago_s, uncertainty_s), at),
            MediaReport::Lost { cue, why } => self.lost_media(cue, why, at),
        }
    }

    /// A medium came. A clock that is ahead by more than its uncertainty is none that can be relied on.
    fn onset(&mut self, cue: u64, medium: Medium, (ago_s, uncertainty_s): (f64, f64), at: Moment) {
        let known = uncertainty_s >= 0.0 && (-uncertainty_s..=MOST_AGO_S).contains(&ago_s);
        let plays = matches!(self.phase, Phase::Playing { .. } | Phase::Stopping { .. });
        let Some(presented) = self.media.presented.as_mut().filter(|p| p.cue == cue) else {
            return;
        };
        let awaited = presented.awaited.iter().position(|m| *m == medium);
        let Some(place) = awaited.filter(|_| known && plays && uncertainty_s.is_finite()) else {
            return;
        };
        presented.awaited.remove(place);
        let (trial, attempt) = presented.of;
        let offset_ms = hundredths((at.seconds_since(&presented.since) - ago_s) * 1e3);
        let uncertainty_ms = hundredths(uncertainty_s * 1e3);
        let shown = Event::MediaShown {
            trial,
            attempt,
            interval: self.interval(),
            medium,
            offset_ms,
            uncertainty_ms,
        };
        self.record(shown, at);
        let within_ms = self.protocol.trial.media_within_ms;
        if offset_ms.abs() + uncertainty_ms > within_ms {
            let what = format!(
                "the {} came {offset_ms:.1} ms after the start, ± {uncertainty_ms:.1} ms: the protocol allows {within_ms} ms",
                medium.as_str()
            );
            self.break_off(&what, at);
        }
    }

    /// Something of the attempt under way was not seen or heard to the end. What is answered already stays.
    fn lost_media(&mut self, cue: u64, why: Loss, at: Moment) {
        let (Some(presented), Some(open)) = (&self.media.presented, self.history.open()) else {
            return;
        };
        let of = (open.trial.trial, open.attempt.number);
        let is_of = presented.of == of && (presented.first..=presented.cue).contains(&cue);
        if is_of && self.phase.under_way() && !self.history.any_answer(open.form()) {
            self.break_off(why.as_str(), at);
        }
    }

    /// Fails an attempt whose media do not come, or whose page is gone.
    pub(super) fn watch_media(&mut self, at: Moment) {
        let playing = matches!(self.phase, Phase::Playing { .. });
        let Some(presented) = (self.media.presented.as_ref())
            .filter(|presented| playing && !presented.media.is_empty())
        else {
            return;
        };
        let within_s = self.protocol.trial.media_within_ms * 1e-3 + REPORT_WITHIN_S;
        let late = at.seconds_since(&presented.since) > within_s;
        if late && !presented.awaited.is_empty() {
            self.break_off(NOT_CONFIRMED, at);
        } else if !self.media.is_ready(at) {
            let what = "the participant's page was out of sight, or gave no sign of life";
            self.break_off(what, at);
        }
    }

    /// Whether something of the attempt under way was presented without media that belong to it. Of an adjustment only what was
    /// felt last: what was stopped before its media came is felt again there in the same attempt.
    pub(super) fn lacks_media(&self) -> bool {
        let (Some(shows), Some(open)) = (&self.media.shows, self.history.open()) else {
            return false;
        };
        let attempt = open.attempt;
        let before = match attempt.is_adjusted() {
            true => attempt.presentations.len().saturating_sub(1),
            false => 0,
        };
        attempt.presentations[before..].iter().any(|p| {
            let model = attempt.models.get(p.interval.saturating_sub(1) as usize);
            let media = model.and_then(|model| shows.get(model));
            media.is_some_and(|media| media.iter().any(|m| p.media.of(m.medium).is_none()))
        })
    }

    /// Fails an attempt that has ended without its media; returns whether it did. One that was stopped can only be played
    /// again.
    pub(super) fn ended_without_media(&mut self, at: Moment) -> bool {
        let Some(open) = self.history.open() else {
            return false;
        };
        let last = open.attempt.presentations.last();
        let stopped = last.is_some_and(|p| p.ended.is_some_and(|(_, ended)| ended.stopped));
        let begun = self.history.any_answer(open.form());
        let lacks = !stopped && !begun && self.lacks_media();
        if lacks {
            self.lose_media(NOT_CONFIRMED, at);
        }
        lacks
    }

    /// Fails the attempt under way before its end is confirmed, or while it is asked about. A pause that was to follow does.
    fn break_off(&mut self, what: &str, at: Moment) {
        let pause = matches!(self.phase, Phase::Stopping { pause: true, .. });
        self.lose_media(what, at);
        if pause {
            self.start_pause(at);
        }
    }

    /// The attempt under way fails, and its trial comes again.
    fn lose_media(&mut self, what: &str, at: Moment) {
        self.out.push(Effect::Limp);
        self.fail(Failure::Media, what, at);
        self.media.presented = None;
        self.proceed(at);
        self.notify(NOT_IN_STEP);
    }
}

/// To a hundredth: the page's clock has no more.
fn hundredths(ms: f64) -> f64 {
    (ms * 100.0).round() / 100.0
}
