//! What the host does with each reply.

use super::{GREET_AGAIN, Host, RETRY, Stage, upload};
use crate::device::Report;
use crate::device::host::DeviceClock;
use std::time::Duration;
use study_core::outcome::{Playback, Sample};
use study_wire::message::{
    self, Fault, Happening, Outcome, Pulse, Refusal, Reply, Request, State, Telemetry,
};

impl Host {
    pub(super) fn take(&mut self, sequence: u16, reply: Reply, at: Duration) {
        self.unheard = None;
        match reply {
            Reply::Identity(identity) => self.greeted(sequence, identity, at),
            Reply::Ack(ack) if self.stage == Stage::Greeting && ack.refusal == Refusal::Version => {
                // all that a device of another time says to HELLO
                let version = u8::try_from(ack.detail).unwrap_or(u8::MAX);
                self.other_version(version, at);
            }
            _ if !self.stage.known() => {}
            Reply::Ack(ack) => {
                let Some(flight) = self.flight else { return };
                if flight.sequence != sequence || flight.request.kind() != ack.request {
                    return;
                }
                self.flight = None;
                if flight.tries == 1 {
                    self.health.clock.note(flight.sent, at, ack.clock_ms);
                }
                match ack.refusal {
                    Refusal::None => self.done(flight.request, ack.state, at),
                    refusal => self.refused(flight.request, refusal, &ack, at),
                }
            }
            Reply::Outcome(outcome) => {
                if self.flight.is_some_and(|f| f.sequence == sequence) {
                    self.flight = None;
                    self.ended(outcome, at);
                }
            }
            Reply::Pulse(pulse) => self.pulse(pulse, at),
            Reply::Telemetry(telemetry) => self.telemetry(&telemetry),
            Reply::Event(event) if event.playback == self.playback => match event.what {
                Happening::Started => {}
                Happening::Stopped => self.over(at),
                Happening::Latched => self.latched(event.fault, at),
            },
            Reply::Event(_) | Reply::Recorded(_) => {}
        }
    }

    fn greeted(&mut self, sequence: u16, identity: message::Identity, at: Duration) {
        let asked = self
            .flight
            .filter(|f| self.stage == Stage::Greeting && f.sequence == sequence);
        let Some(flight) = asked.filter(|_| identity.nonce == self.nonce) else {
            return;
        };
        self.flight = None;
        let [oldest, newest] = identity.versions;
        if !(oldest..=newest).contains(&message::VERSION) {
            return self.other_version(newest, at);
        }
        let before = self.identity.map(|before| before.serial);
        if before.is_some_and(|serial| serial != identity.serial) {
            self.stage = Stage::Mute {
                again: at + GREET_AGAIN,
            };
            return;
        }
        self.identity = Some(identity);
        self.health.clock = DeviceClock::default();
        self.health.clock.note(flight.sent, at, identity.clock_ms);
        self.next_beat = at;
        self.stage = Stage::Idle;
        self.reports.push(Report::Ready);
    }

    /// A request was done.
    fn done(&mut self, request: Request, state: State, at: Duration) {
        match (request, self.stage) {
            (Request::Rearm, _) => self.rest = None,
            (Request::TableCommit(_), Stage::Loading { .. }) => {
                self.stage = Stage::Loaded { since: at };
                self.reports.push(Report::Loaded);
            }
            (Request::Play(_), Stage::Starting) => {
                self.reports.push(Report::Started);
                self.stage = Stage::Playing { since: at };
                if self.todo.pop_front().is_some() {
                    return self.ask_to_stop(at);
                }
            }
            (Request::Stop(_), Stage::Stopping { .. }) if state == State::Loaded => {
                return self.over(at);
            }
            _ => {}
        }
        if self.flight.is_none() {
            self.next_request(at);
        }
    }

    fn refused(&mut self, request: Request, why: Refusal, ack: &message::Ack, at: Duration) {
        match (request, why) {
            (Request::Rearm, Refusal::Moving) => {
                if let Some((again, until)) = &mut self.rest
                    && at < *until
                {
                    *again = at + RETRY;
                    self.todo.push_front(request);
                    return;
                }
            }
            (_, Refusal::NoHello) => return self.lose("it has started anew", at),
            (Request::Limp, _) => return,
            _ => {}
        }
        let detail = match ack.detail {
            0 => String::new(),
            detail => format!(" ({detail})"),
        };
        let what = upload::word(&request);
        let words = why.as_str();
        self.reports
            .push(Report::Fault(format!("it refuses {what}: {words}{detail}")));
        self.settle(at);
    }

    /// Nothing plays any more, and nothing shall.
    fn settle(&mut self, at: Duration) {
        self.todo.clear();
        self.rest = None;
        self.stage = Stage::Idle;
        self.send(Request::Limp, at);
    }

    /// The playback has ended by itself or by STOP: how?
    fn over(&mut self, at: Duration) {
        if matches!(self.stage, Stage::Playing { .. } | Stage::Stopping { .. }) {
            self.stage = Stage::Asking;
            self.todo.clear();
            self.send(Request::State, at);
        }
    }

    fn latched(&mut self, fault: Fault, at: Duration) {
        let playing = matches!(
            self.stage,
            Stage::Loaded { .. }
                | Stage::Starting
                | Stage::Playing { .. }
                | Stage::Stopping { .. }
                | Stage::Asking
        );
        if playing {
            self.reports.push(Report::Fault(fault.as_str().to_owned()));
            self.settle(at);
        }
    }

    fn ended(&mut self, outcome: Outcome, at: Duration) {
        self.health.outcome = Some(outcome);
        if self.stage != Stage::Asking {
            return;
        }
        let (Some(device), true) = (self.identity, outcome.playback == self.playback) else {
            return self.lose("it knows nothing of the playback", at);
        };
        if outcome.state.latched() {
            return self.latched(outcome.fault, at);
        }
        let exploration_s = f64::from(outcome.ticks) / device.servo_hz;
        let switches_per_s = match exploration_s {
            s if s > 0.0 => f64::from(outcome.switches) / s,
            _ => 0.0,
        };
        let samples_lost = u64::from(outcome.samples).saturating_sub(self.received);
        self.health.samples_lost += samples_lost.saturating_sub(self.lost);
        self.reports.push(Report::Stopped(Playback {
            exploration_s,
            strokes: outcome.strokes,
            least_energy_j: outcome.least_energy_j,
            switches_per_s,
            clamp_count: u64::from(outcome.clamps),
            samples: self.received,
            samples_lost,
        }));
        self.settle(at);
    }

    fn pulse(&mut self, pulse: Pulse, at: Duration) {
        let Some(place) = self.beats.iter().position(|(n, _)| *n == pulse.count) else {
            return;
        };
        let (_, sent) = self.beats[place];
        self.beats.drain(..=place);
        self.health.clock.note(sent, at, pulse.clock_ms);
        // what was asked before a change says nothing about what came of it
        let since = match self.stage {
            Stage::Loaded { since }
            | Stage::Playing { since }
            | Stage::Stopping { since }
            | Stage::Loading { since } => since,
            _ => Duration::ZERO,
        };
        if sent < since {
            return;
        }
        match (self.stage, pulse.state) {
            (_, State::Boot) => self.lose("it has started anew", at),
            (Stage::Loaded { .. } | Stage::Playing { .. } | Stage::Stopping { .. }, state)
                if state.latched() =>
            {
                self.latched(pulse.fault, at);
            }
            (Stage::Playing { .. } | Stage::Stopping { .. }, State::Loaded) => self.over(at),
            _ => {}
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry) {
        let playing = matches!(
            self.stage,
            Stage::Starting | Stage::Playing { .. } | Stage::Stopping { .. } | Stage::Asking
        );
        let (true, Some(device)) = (playing, &self.identity) else {
            return;
        };
        if telemetry.playback != self.playback {
            return;
        }
        let samples = telemetry.samples.as_slice();
        let first = u64::from(telemetry.first);
        let due = self.received + self.lost;
        // what comes twice or late has been counted
        if first < due {
            return;
        }
        self.lost += first - due;
        self.health.samples_lost += first - due;
        self.received += samples.len() as u64;
        self.health.samples += samples.len() as u64;
        let servo_hz = device.servo_hz;
        let samples = samples
            .iter()
            .map(|sample| Sample {
                t_s: f64::from(sample.tick) / servo_hz,
                x_mm: message::fixed::from_nm(sample.x_nm),
                v_mm_s: message::fixed::from_um_s(sample.v_um_s),
                force_command_n: message::fixed::from_un(sample.command_un),
                force_measured_n: message::fixed::from_maybe_un(sample.measured_un),
            })
            .collect();
        self.reports.push(Report::Telemetry(samples));
        let now = (telemetry.strokes, telemetry.clamps);
        if self.told != now {
            self.told = now;
            self.reports.push(Report::Progress {
                strokes: now.0,
                clamps: u64::from(now.1),
            });
        }
    }
}
