//! The history of one trial: its attempts.

use crate::outcome::event::{Moment, Playback, TrackLevel};
use crate::outcome::fidelity::Fidelity;
use crate::outcome::media::{Onset, Onsets};
use crate::outcome::sent::{SentFault, SentNumber};
use study_base::text::ModelId;
use study_plan::protocol::{Answer, Medium};

/// What the events say of one trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct TrialHistory {
    pub(super) attempts: Vec<Attempt>,
    /// Failures that count towards `max_attempts`.
    pub(super) failures: u32,
    /// Closed as failed after its last attempt.
    pub(super) given_up: bool,
    pub(super) remarks: Vec<String>,
    /// The last pause after which it was felt again, s.
    pub(super) again_after_s: Option<f64>,
}

impl TrialHistory {
    /// The attempt whose answers count.
    pub(super) fn counted(&self) -> Option<&Attempt> {
        self.attempts.last().filter(|a| !a.void)
    }

    pub(super) fn is_closed(&self) -> bool {
        self.given_up || self.counted().is_some_and(|a| a.done.is_some())
    }

    /// The block is restarted: nothing of it counts until it is felt again.
    pub(super) fn send_back(&mut self) {
        self.failures = 0;
        self.given_up = false;
        if let Some(attempt) = self.attempts.last_mut() {
            attempt.void = true;
        }
    }
}

/// Operator, program, device and front from one start of the program to its end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sitting {
    /// Operator's initials or code.
    pub operator: String,
    /// Version of this program.
    pub tool_version: String,
    /// Device.
    pub device_id: String,
    /// Front of the participant, if it is a program of somebody else.
    pub front: Option<String>,
}

/// One attempt at a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// From 1.
    pub number: u32,
    /// In which sitting it was made.
    pub sitting: Sitting,
    /// Its start; `None` if that line of the journal is damaged.
    pub start: Option<AttemptStart>,
    /// The realization of each interval; empty if the line of its start is damaged, but for an adjustment, which begins as planned.
    pub models: Vec<ModelId>,
    /// What its track presents.
    pub level: Option<TrackLevel>,
    /// Of a trial of adjustment: the intervals with the standard.
    pub(super) standards: Option<Vec<u32>>,
    /// What the device failed at in steps that were repeated, one for each failure.
    pub(super) failed_steps: Vec<ModelId>,
    /// Its presentations so far, in order. Each begins with its confirmed start.
    pub presentations: Vec<Presentation>,
    /// How often its intervals were felt again.
    pub replays: u32,
    /// The confirmed end of its playback; of several intervals that of the last one,
    /// with the sums over all.
    pub ended: Option<Ended>,
    /// Whether the force was that of the table, for each playback that was judged.
    pub rendering: Vec<Fidelity>,
    /// Numbers that a controller program sent in its playbacks, and in which presentation, counted from 1.
    pub(in crate::outcome) numbers: Vec<(usize, SentNumber)>,
    /// The answer that the track was told, as it was when the trial was completed.
    pub told: Option<Answer>,
    /// Rating time until the program was last resumed, s.
    pub rated_earlier_s: f64,
    /// First and last moment of the rating in this sitting.
    pub(super) rating: Option<(Moment, Moment)>,
    /// Its completion.
    pub done: Option<Completion>,
    /// The pauses before the answers to the questionnaires after it, if there were any.
    pub delay: Option<FormDelay>,
    /// Failed or sent back: its answers do not count.
    pub void: bool,
}

/// A presentation of one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Presentation {
    /// Interval, from 1.
    pub interval: u32,
    /// Number of earlier rounds through all intervals.
    pub replays: u32,
    /// When the device confirmed its start; `None` if that line is damaged.
    pub started: Option<Moment>,
    /// When the device confirmed its end, and its report.
    pub ended: Option<(Moment, Ended)>,
    /// From the end of the presentation before it in the attempt, s.
    pub gap_s: Option<f64>,
    /// Which entry of [`Attempt::rendering`] judges it, if one does.
    pub judged: Option<usize>,
    /// When the participant's page showed and played its media.
    pub media: Onsets,
}

impl Presentation {
    /// From its confirmed start to its confirmed end, by the clock of the host, s.
    pub fn felt_s(&self) -> Option<f64> {
        let (at, ended) = self.ended?;
        let reported = ended.playback.exploration_s;
        Some(
            self.started
                .map_or(reported, |from| at.seconds_since(&from)),
        )
    }
}

/// The start of an attempt.
#[derive(Debug, Clone, PartialEq)]
pub struct AttemptStart {
    /// When the playback was requested.
    pub at: Moment,
    /// Place in the order as felt, from 1.
    pub position: u32,
    /// Realization felt before it; `None` at the start of the session.
    pub previous: Option<ModelId>,
    /// Duration of the reference prompt, s.
    pub reference_s: f64,
}

/// The confirmed end of a playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ended {
    /// The device's report.
    pub playback: Playback,
    /// Whether it was stopped by Esc, Space or a pause.
    pub stopped: bool,
}

/// The completion of a trial: every question answered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Completion {
    /// When.
    pub at: Moment,
    /// From the opening of the rating to its confirmation, s.
    pub response_s: f64,
    /// Pauses between the end of the playback and the answer, s.
    pub paused_s: Option<f64>,
    /// Number of the trial on the screen, from 1.
    pub number: u32,
}

/// Pauses between the answer to a trial and those to the questionnaires after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FormDelay {
    /// Their sum, s; `None` if one of them has no known length.
    pub paused_s: Option<f64>,
    /// Whether it is more than the protocol allows between feeling and answering.
    pub late: bool,
}

impl FormDelay {
    /// With another pause.
    pub(super) fn and(self, next: Self) -> Self {
        Self {
            paused_s: self.paused_s.zip(next.paused_s).map(|(a, b)| a + b),
            late: self.late || next.late,
        }
    }
}

impl Ended {
    /// What two playbacks add up to.
    fn and(self, next: Self) -> Self {
        let (a, b) = (self.playback, next.playback);
        let exploration_s = a.exploration_s + b.exploration_s;
        let switches = a.switches_per_s * a.exploration_s + b.switches_per_s * b.exploration_s;
        Self {
            playback: Playback {
                exploration_s,
                strokes: a.strokes.saturating_add(b.strokes),
                least_energy_j: a.least_energy_j.min(b.least_energy_j),
                // Per second of both. A level that is changed at once is not explored.
                switches_per_s: match exploration_s > 0.0 {
                    true => switches / exploration_s,
                    false => a.switches_per_s,
                },
                clamp_count: a.clamp_count + b.clamp_count,
                samples: a.samples + b.samples,
                samples_lost: a.samples_lost + b.samples_lost,
                // That of each is in `intervals.csv`'s verdict; a mean would hide one.
                time_ratio: None,
                host_late_ms: match (a.host_late_ms, b.host_late_ms) {
                    (Some(a), Some(b)) => Some([a[0].max(b[0]), a[1].max(b[1])]),
                    (one, other) => one.or(other),
                },
            },
            stopped: self.stopped || next.stopped,
        }
    }
}

impl Attempt {
    /// Number of intervals of a round.
    pub fn intervals(&self) -> u32 {
        u32::try_from(self.models.len()).unwrap_or(u32::MAX).max(1)
    }

    /// The interval that plays or comes next, from 1; `None` once all have ended.
    pub fn interval(&self) -> Option<u32> {
        let round = self.round();
        let ended = round.filter(|p| p.ended.is_some()).count();
        let next = u32::try_from(ended).unwrap_or(u32::MAX).saturating_add(1);
        (next <= self.intervals()).then_some(next)
    }

    /// The presentations of the present round.
    fn round(&self) -> impl Iterator<Item = &Presentation> {
        let present = self.replays;
        (self.presentations.iter()).filter(move |p| p.replays == present)
    }

    /// Numbers that were sent in the presentation under way; those that came before or after it, or twice, are no
    /// part of it.
    pub(super) fn sent(&mut self, numbers: &[SentNumber]) {
        let presentation = self.presentations.len();
        let of_it = numbers.iter().filter(|number| match number.fault {
            // Without a declaration so far: the outcome may be added later.
            None | Some(SentFault::Undeclared | SentFault::OtherUnit) => true,
            Some(SentFault::NoNumber | SentFault::OutsidePlayback | SentFault::Twice) => false,
        });
        self.numbers
            .extend(of_it.map(|number| (presentation, number.clone())));
    }

    /// Whether a number of this name was sent in the presentation under way.
    pub fn was_sent(&self, key: &str) -> bool {
        let presentation = self.presentations.len();
        let is_it = |(of, sent): &(usize, SentNumber)| *of == presentation && sent.key == key;
        self.numbers.iter().any(is_it)
    }

    /// The confirmed start of an interval.
    pub(super) fn started(&mut self, interval: u32, at: Moment) {
        let before = self.presentations.last().and_then(|p| p.ended);
        self.presentations.push(Presentation {
            interval,
            replays: self.replays,
            started: Some(at),
            ended: None,
            gap_s: before
                .filter(|_| interval > 1)
                .map(|(ended, _)| at.seconds_since(&ended)),
            judged: None,
            media: Onsets::default(),
        });
    }

    /// A medium of an interval came.
    pub(super) fn came(&mut self, interval: u32, medium: Medium, onset: Onset) {
        let mut played = self.presentations.iter_mut();
        if let Some(last) = played.rfind(|p| p.interval == interval) {
            last.media.set(medium, onset);
        }
    }

    /// The confirmed end of an interval. The attempt ends with its last interval.
    pub(super) fn interval_ended(
        &mut self,
        interval: u32,
        ended: Ended,
        judged: Option<&Fidelity>,
        at: Moment,
    ) {
        let replays = self.replays;
        let judged = judged.map(|found| {
            self.rendering.push(found.clone());
            self.rendering.len() - 1
        });
        let open =
            (self.presentations.last_mut()).filter(|p| p.interval == interval && p.ended.is_none());
        match open {
            Some(presentation) => {
                presentation.ended = Some((at, ended));
                presentation.judged = judged;
            }
            None => self.presentations.push(Presentation {
                interval,
                replays,
                started: None,
                ended: Some((at, ended)),
                gap_s: None,
                judged,
                media: Onsets::default(),
            }),
        }
        if interval >= self.intervals() {
            self.end(interval, ended, at);
        }
    }

    /// The last interval has ended: with the sums over all.
    pub(super) fn end(&mut self, interval: u32, ended: Ended, at: Moment) {
        let all = self.presentations.iter().filter_map(|p| p.ended);
        let sum = all.map(|(_, ended)| ended).reduce(Ended::and);
        let several = interval > 1 || self.replays > 0;
        self.ended = sum.filter(|_| several).or(Some(ended));
        self.rating = Some((at, at));
    }

    pub(super) fn new(number: u32, sitting: &Sitting, start: Option<AttemptStart>) -> Self {
        Self {
            number,
            sitting: sitting.clone(),
            start,
            models: Vec::new(),
            level: None,
            standards: None,
            failed_steps: Vec::new(),
            presentations: Vec::new(),
            replays: 0,
            ended: None,
            rendering: Vec::new(),
            numbers: Vec::new(),
            told: None,
            rated_earlier_s: 0.0,
            rating: None,
            done: None,
            delay: None,
            void: false,
        }
    }
}
