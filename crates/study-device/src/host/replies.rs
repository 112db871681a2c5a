//! Processing of the replies.

use super::{
    HEARTBEAT_INTERVAL, Host, RECONNECT_INTERVAL, RETRY_INTERVAL, RearmRetry, Stage, upload,
};
use crate::Report;
use crate::host::DeviceClock;
use std::time::Duration;
use study_session::outcome::{Playback, Sample};
use study_wire::message::{
    self, DeviceState, Event, EventKind, Fault, Outcome, Pulse, Refusal, Reply, Request, Telemetry,
};

/// Whether this is a HELLO with a minor version.
fn says_minor(request: &Request) -> bool {
    matches!(request, Request::Hello(hello) if hello.minor > 0)
}

impl Host {
    pub(super) fn take(&mut self, sequence: u16, reply: Reply, at: Duration) {
        self.silent_since = None;
        match reply {
            Reply::Identity(identity) => self.identified(sequence, identity, at),
            Reply::Ack(ack)
                if self.stage == Stage::Connecting && ack.refusal == Refusal::Version =>
            {
                // The answer to HELLO of a device with another version.
                let version = u8::try_from(ack.detail).unwrap_or(u8::MAX);
                self.other_version(version, at);
            }
            // A device of minor version 0 does not know a HELLO with a minor version.
            Reply::Ack(ack)
                if self.stage == Stage::Connecting
                    && ack.refusal == Refusal::Malformed
                    && self.pending.is_some_and(|pending| {
                        pending.sequence == sequence && says_minor(&pending.request)
                    }) =>
            {
                self.say_hello(0, at);
            }
            _ if !self.stage.known() => {}
            Reply::Ack(ack) => {
                let Some(pending) = self.pending else { return };
                if pending.sequence != sequence || pending.request.kind() != ack.request {
                    return;
                }
                self.pending = None;
                if pending.tries == 1 {
                    self.health.clock.add(pending.sent, at, ack.clock_ms);
                }
                match ack.refusal {
                    Refusal::None => self.request_done(pending.request, ack.state, at),
                    refusal => self.request_refused(pending.request, refusal, &ack, at),
                }
            }
            Reply::Outcome(outcome) => {
                if self.pending.is_some_and(|f| f.sequence == sequence) {
                    self.pending = None;
                    self.take_outcome(outcome, at);
                }
            }
            Reply::Pulse(pulse) => self.pulse(pulse, at),
            Reply::Telemetry(telemetry) => self.telemetry(&telemetry, at),
            Reply::Event(event) if self.concerns(&event) => match event.kind {
                EventKind::Started => {}
                EventKind::Stopped => self.ask_outcome(at),
                EventKind::Latched => self.latched(event.fault, at),
            },
            Reply::Event(_) | Reply::Recorded(_) => {}
        }
    }

    /// Whether an event is about the present playback, or about the table that was loaded
    /// for it: no playback of that has a number before PLAY is executed.
    fn concerns(&self, event: &Event) -> bool {
        let waiting = matches!(self.stage, Stage::Loaded { .. } | Stage::Starting);
        event.playback == self.playback || (waiting && event.playback == 0)
    }

    fn identified(&mut self, sequence: u16, identity: message::Identity, at: Duration) {
        let asked = self
            .pending
            .filter(|f| self.stage == Stage::Connecting && f.sequence == sequence);
        let Some(pending) = asked.filter(|_| identity.nonce == self.nonce) else {
            return;
        };
        self.pending = None;
        let [oldest, newest] = identity.versions;
        if !(oldest..=newest).contains(&message::VERSION) {
            return self.other_version(newest, at);
        }
        let before = self.identity.map(|before| before.serial);
        if before.is_some_and(|serial| serial != identity.serial) {
            self.stage = Stage::Silent {
                retry: at + RECONNECT_INTERVAL,
            };
            return;
        }
        self.identity = Some(identity);
        self.health.clock = DeviceClock::default();
        self.health.clock.add(pending.sent, at, identity.clock_ms);
        self.next_heartbeat = Some(at);
        self.stage = Stage::Idle;
        self.reports.push(Report::Ready);
    }

    /// A request was executed.
    fn request_done(&mut self, request: Request, state: DeviceState, at: Duration) {
        match (request, self.stage) {
            (Request::Rearm, _) => self.rearm_retry = None,
            (Request::TableCommit(_) | Request::MechanismCommit(_), Stage::Loading { .. }) => {
                self.stage = Stage::Loaded { since: at };
                self.reports.push(Report::Loaded);
            }
            (Request::Play(_), Stage::Starting) => {
                self.reports.push(Report::Started);
                self.stage = Stage::Playing { since: at };
                if self.queue.pop_front().is_some() {
                    return self.ask_to_stop(at);
                }
            }
            (Request::Stop(_), Stage::Stopping { .. }) if state == DeviceState::Loaded => {
                return self.ask_outcome(at);
            }
            _ => {}
        }
        if self.pending.is_none() {
            self.next_request(at);
        }
    }

    fn request_refused(
        &mut self,
        request: Request,
        reason: Refusal,
        ack: &message::Ack,
        at: Duration,
    ) {
        match (request, reason) {
            (Request::Rearm, Refusal::Moving) => {
                if let Some(RearmRetry { next, until }) = &mut self.rearm_retry
                    && at < *until
                {
                    *next = at + RETRY_INTERVAL;
                    self.queue.push_front(request);
                    return;
                }
            }
            (_, Refusal::NoHello) => return self.lose_device("it has restarted", at),
            (Request::Limp, _) => return,
            _ => {}
        }
        let detail = match ack.detail {
            0 => String::new(),
            detail => format!(" ({detail})"),
        };
        let what = upload::describe(&request);
        let reason = match reason {
            // It went limp before the request arrived.
            Refusal::WrongState if ack.state.latched() => self.in_words(ack.fault),
            Refusal::NoHeartbeat => format!("{}: {}", reason.as_str(), self.without_heartbeat()),
            reason => reason.as_str().to_owned(),
        };
        self.reports.push(Report::Fault(format!(
            "it refuses {what}: {reason}{detail}"
        )));
        self.make_idle(at);
    }

    /// Clears the queue and makes the device limp.
    fn make_idle(&mut self, at: Duration) {
        self.queue.clear();
        self.rearm_retry = None;
        self.stage = Stage::Idle;
        self.send(Request::Limp, at);
    }

    /// Asks for the outcome of a playback that has ended by itself or by STOP.
    fn ask_outcome(&mut self, at: Duration) {
        if matches!(
            self.stage,
            Stage::Playing { .. } | Stage::Fading { .. } | Stage::Stopping { .. }
        ) {
            self.stage = Stage::AwaitingOutcome;
            self.queue.clear();
            self.send(Request::State, at);
        }
    }

    fn latched(&mut self, fault: Fault, at: Duration) {
        let playing = matches!(
            self.stage,
            Stage::Loaded { .. }
                | Stage::Starting
                | Stage::Playing { .. }
                | Stage::Fading { .. }
                | Stage::Stopping { .. }
                | Stage::AwaitingOutcome
        );
        if playing {
            self.reports.push(Report::Fault(self.in_words(fault)));
            self.make_idle(at);
        }
    }

    /// A fault, and whose it is if heartbeats were missing.
    fn in_words(&self, fault: Fault) -> String {
        match fault {
            Fault::Watchdog => format!("{}: {}", fault.as_str(), self.without_heartbeat()),
            fault => fault.as_str().to_owned(),
        }
    }

    /// Why the device had no fresh heartbeat, as far as this computer knows.
    fn without_heartbeat(&self) -> String {
        let watchdog_ms = self.identity.map_or(0, |device| device.watchdog_ms);
        let [_, late_ms] = self.late.ms().unwrap_or_default();
        // The device can wait as long as its watchdog, less the time between heartbeats.
        let most_ms = f64::from(watchdog_ms) - HEARTBEAT_INTERVAL.as_secs_f64() * 2e3;
        match self.unpolled {
            Some(time) => format!(
                "this program's screen stood still for {} ms",
                time.as_millis()
            ),
            None if late_ms >= most_ms => format!("this computer was late by {late_ms:.0} ms"),
            None if self.identity.is_some_and(|device| device.flags.simulated) => format!(
                "this computer was late by at most {late_ms:.0} ms, but the device is simulated on it"
            ),
            None => format!(
                "this computer was late by at most {late_ms:.0} ms, so look at the line and the device"
            ),
        }
    }

    fn take_outcome(&mut self, outcome: Outcome, at: Duration) {
        if self.stage != Stage::AwaitingOutcome {
            return;
        }
        let (Some(device), true) = (self.identity, outcome.playback == self.playback) else {
            return self.lose_device("it does not know the playback", at);
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
        let faded = self.faded(&outcome);
        self.reports.extend(faded);
        self.reports.push(Report::Stopped(Playback {
            exploration_s,
            strokes: outcome.strokes,
            least_energy_j: outcome.least_energy_j,
            switches_per_s,
            clamp_count: u64::from(outcome.clamps),
            samples: self.received,
            samples_lost,
            time_ratio: self.arrivals.time_ratio(),
            host_late_ms: self.late.ms(),
        }));
        self.make_idle(at);
    }

    fn pulse(&mut self, pulse: Pulse, at: Duration) {
        let counts = &mut self.pending_heartbeats.iter();
        let Some(index) = counts.position(|(count, _)| *count == pulse.count) else {
            return;
        };
        let (_, sent) = self.pending_heartbeats[index];
        self.pending_heartbeats.drain(..=index);
        self.health.clock.add(sent, at, pulse.clock_ms);
        self.health.trips.add(at.saturating_sub(sent));
        // A heartbeat that was sent before a change does not reflect its result.
        let since = match self.stage {
            Stage::Loaded { since }
            | Stage::Playing { since }
            | Stage::Fading { since }
            | Stage::Stopping { since }
            | Stage::Loading { since } => since,
            _ => Duration::ZERO,
        };
        if sent < since {
            return;
        }
        match (self.stage, pulse.state) {
            (_, DeviceState::Boot) => self.lose_device("it has restarted", at),
            (
                Stage::Loaded { .. }
                | Stage::Playing { .. }
                | Stage::Fading { .. }
                | Stage::Stopping { .. },
                state,
            ) if state.latched() => {
                self.latched(pulse.fault, at);
            }
            (
                Stage::Playing { .. } | Stage::Fading { .. } | Stage::Stopping { .. },
                DeviceState::Loaded,
            ) => self.ask_outcome(at),
            _ => {}
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry, at: Duration) {
        let playing = matches!(
            self.stage,
            Stage::Starting
                | Stage::Playing { .. }
                | Stage::Fading { .. }
                | Stage::Stopping { .. }
                | Stage::AwaitingOutcome
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
        // Repeated and late samples have been counted already.
        if first < due {
            return;
        }
        self.lost += first - due;
        self.health.samples_lost += first - due;
        self.received += samples.len() as u64;
        self.health.samples += samples.len() as u64;
        let servo_hz = device.servo_hz;
        if let Some(last) = samples.last() {
            self.arrivals.add(at, f64::from(last.tick) / servo_hz);
        }
        let samples = samples
            .iter()
            .map(|sample| Sample {
                t_s: f64::from(sample.tick) / servo_hz,
                x_mm: message::fixed::from_nm(sample.x_nm),
                v_mm_s: message::fixed::from_um_s(sample.v_um_s),
                force_command_n: message::fixed::from_un(sample.command_un),
                force_measured_n: sample.measured_un.map(message::fixed::from_un),
            })
            .collect();
        self.reports.push(Report::Telemetry(samples));
        let now = (telemetry.strokes, telemetry.clamps);
        if self.reported != now {
            self.reported = now;
            self.reports.push(Report::Progress {
                strokes: now.0,
                clamps: u64::from(now.1),
            });
        }
    }
}
