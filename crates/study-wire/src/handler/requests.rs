//! Execution of the requests.

use super::run::{Run, count};
use super::table::{Refused, require};
use super::{Alive, Handler, LastRequest, Out};
use crate::frame::crc32;
use crate::message::{
    Constants, DeviceState, ELEMENTS_MINOR, EventKind, FADE_MINOR, Fault, Features, Header,
    Heartbeat, Hello, Identity, Loaded, MECHANISM_MINOR, MINOR, Outcome, Play, Pulse, Record,
    Refusal, Reply, Request, Stop, VERSION, WireError, kind,
};
use crate::real::Real;
use crate::servo::{Servo, ServoSettings};
use core::num::NonZeroU32;

/// A heartbeat with a deadline further ahead than this is not fresh, ms.
const MAX_DEADLINE_MS: u32 = 1000;
/// Longest time from COMMIT to its reply, ms.
const COMMIT_MS: u16 = 50;

/// Success, or a refusal and its detail.
type Answer = Result<(), Refused>;

impl<const NODES: usize, const POINTS: usize, R: Real> Handler<NODES, POINTS, R> {
    /// Handles the body of a valid frame.
    pub(super) fn handle(&mut self, body: &[u8], now_ms: u32, out: Out<'_>) {
        let Some(header) = Header::read(body) else {
            self.bad_frames = self.bad_frames.wrapping_add(1);
            return;
        };
        // LIMP is executed in every version and with any length.
        if header.kind == kind::LIMP {
            self.latch(DeviceState::Limp, Fault::LimpCommand, now_ms);
            self.answer(header, Ok(()), now_ms, out);
            return self.send_event(out);
        }
        // What a later minor version added is unknown on this connection.
        let known = |(header, request): (Header, Request)| {
            let features = self.profile.features;
            let refused = match request {
                Request::ElementsBegin(_) => !features.elements,
                Request::Fade(_) => !features.fade,
                _ => request.minor() >= MECHANISM_MINOR && !features.mechanism,
            };
            match refused || request.minor() > self.minor {
                true => Err(WireError::UnknownType(header.kind)),
                false => Ok((header, request)),
            }
        };
        match Request::decode(body).and_then(known) {
            Ok((header, request)) if request.sequenced() => {
                self.handle_sequenced(header, &request, crc32(body), now_ms, out);
            }
            Ok((header, request)) => self.handle_unsequenced(header, &request, now_ms, out),
            Err(error) => {
                self.bad_frames = self.bad_frames.wrapping_add(1);
                let refusal = match error {
                    // Replies are addressed to a host.
                    WireError::UnknownType(kind) if kind >= kind::ACK => return,
                    WireError::UnknownType(_) => (Refusal::UnknownType, 0),
                    WireError::Version(_) => (Refusal::Version, u32::from(VERSION)),
                    _ => (Refusal::Malformed, 0),
                };
                self.answer(header, Err(refusal), now_ms, out);
            }
        }
        self.send_event(out);
    }

    fn answer(&self, header: Header, answer: Answer, now_ms: u32, out: Out<'_>) {
        let reply = self.ack(header.kind, answer, now_ms);
        out(reply.frame(header.sequence).as_bytes());
    }

    /// Handles HELLO, HEARTBEAT and STATE, which may be repeated.
    fn handle_unsequenced(&mut self, header: Header, request: &Request, now_ms: u32, out: Out<'_>) {
        let reply = match request {
            Request::Hello(hello) => self.hello(header, *hello, now_ms),
            Request::Heartbeat(beat) => self.heartbeat(*beat, now_ms),
            _ => self.outcome(now_ms),
        };
        out(reply.frame(header.sequence).as_bytes());
    }

    /// Handles the requests that are executed only once per sequence number.
    fn handle_sequenced(
        &mut self,
        header: Header,
        request: &Request,
        crc: u32,
        now_ms: u32,
        out: Out<'_>,
    ) {
        let (Some(_), Some(last)) = (self.connection, self.last_request) else {
            return self.answer(header, Err((Refusal::NoHello, 0)), now_ms, out);
        };
        match header.sequence.wrapping_sub(last.sequence) {
            0 => match last.request {
                Some((same, reply)) if same == crc => out(reply.as_bytes()),
                _ => self.answer(header, Err((Refusal::Reused, 0)), now_ms, out),
            },
            1..0x8000 => {
                let answer = self.perform(request, now_ms);
                let reply = self.ack(header.kind, answer, now_ms).frame(header.sequence);
                self.last_request = Some(LastRequest {
                    sequence: header.sequence,
                    request: Some((crc, reply)),
                });
                out(reply.as_bytes());
            }
            // An older request: its sender no longer waits for a reply.
            _ => {}
        }
    }

    fn perform(&mut self, request: &Request, now_ms: u32) -> Answer {
        match request {
            Request::TableBegin(begin) => {
                self.may_load()?;
                self.mechanism.clear();
                self.table.begin(begin)
            }
            Request::ElementsBegin(begin) => {
                self.may_load()?;
                self.mechanism.clear();
                self.table.begin_elements(begin)
            }
            Request::TableChunk(chunk) => {
                self.may_continue()?;
                self.table.chunk(chunk)
            }
            Request::TableCommit(commit) => {
                self.may_continue()?;
                // With a host of minor version 0 the stiffness is that of version 1.
                let with_state = self.minor > 0;
                let bounds = &self.profile.bounds;
                let validated = self.table.validate(commit.crc, bounds, with_state);
                self.accept_upload(validated, Loaded::Table, commit.crc, now_ms)
            }
            Request::MechanismBegin(begin) => {
                self.may_load()?;
                self.table.clear();
                self.mechanism.begin(begin)
            }
            Request::MechanismChunk(chunk) => {
                self.may_continue()?;
                self.mechanism.chunk(chunk)
            }
            Request::MechanismCommit(commit) => {
                self.may_continue()?;
                let validated = self.mechanism.validate(commit.crc, &self.profile.bounds);
                self.accept_upload(validated, Loaded::Table, commit.crc, now_ms)
            }
            Request::PathBegin(begin) => {
                self.may_probe()?;
                self.may_load()?;
                self.path.begin(begin)
            }
            Request::PathChunk(chunk) => {
                self.may_probe()?;
                self.may_continue()?;
                self.path.chunk(chunk, &self.profile.bounds)
            }
            Request::PathCommit(commit) => {
                self.may_probe()?;
                self.may_continue()?;
                let validated = self.path.validate(
                    commit.crc,
                    &self.profile.bounds,
                    self.profile.servo.servo_hz,
                );
                self.accept_upload(validated, Loaded::Path, commit.crc, now_ms)
            }
            Request::Play(play) => self.start_playback(*play, now_ms),
            Request::Record(record) => self.start_recording(*record, now_ms),
            Request::Stop(stop) => self.stop(*stop),
            Request::Fade(fade) => self.fade(*fade),
            Request::Rearm => self.rearm(),
            // These are handled in `handle` and `handle_unsequenced`.
            Request::Hello(_) | Request::Limp | Request::Heartbeat(_) | Request::State => {
                Err((Refusal::Malformed, 0))
            }
        }
    }

    /// Whether an upload may begin; it replaces what is loaded.
    fn may_load(&mut self) -> Answer {
        match self.state {
            DeviceState::Idle => Ok(()),
            DeviceState::Loaded => {
                self.unload();
                self.state = DeviceState::Idle;
                Ok(())
            }
            _ => Err((Refusal::WrongState, 0)),
        }
    }

    /// Whether an upload may go on.
    fn may_continue(&self) -> Answer {
        require(self.state == DeviceState::Idle, Refusal::WrongState, 0)
    }

    fn may_probe(&self) -> Answer {
        let probe = POINTS > 0 && self.profile.flags.probe;
        require(probe, Refusal::NoProbe, 0)
    }

    /// Loads a valid upload if the host is alive.
    fn accept_upload(
        &mut self,
        validated: Result<f64, Refused>,
        loaded: Loaded,
        crc: u32,
        now_ms: u32,
    ) -> Answer {
        let limit_n = match validated {
            Ok(limit_n) if self.alive(now_ms) => limit_n,
            Ok(_) => return Err((Refusal::NoHeartbeat, 0)),
            Err(refused) => {
                // An incomplete upload is kept, so that a chunk can be sent again.
                if !matches!(refused.0, Refusal::Incomplete | Refusal::WrongState) {
                    self.unload();
                }
                return Err(refused);
            }
        };
        let velocity_mm_s = match loaded {
            Loaded::Path => self.path.velocity_mm_s(),
            _ => (self.table.begin.map(|begin| begin.velocity_mm_s))
                .or(self.mechanism.begin.map(|begin| begin.velocity_mm_s))
                .unwrap_or_default(),
        };
        self.servo = Servo::new(ServoSettings {
            force_n: limit_n,
            velocity_mm_s,
            ..self.profile.servo
        });
        self.run = Run::new();
        self.limit_n = limit_n;
        self.loaded = loaded;
        self.crc = crc;
        self.state = DeviceState::Loaded;
        self.fault = Fault::None;
        self.uploads = self.uploads.wrapping_add(1);
        Ok(())
    }

    fn may_start(&self, loaded: Loaded, playback: u32, crc: u32, now_ms: u32) -> Answer {
        require(self.state == DeviceState::Loaded, Refusal::WrongState, 0)?;
        let same = self.loaded == loaded && self.crc == crc;
        require(same, Refusal::OtherTable, self.crc)?;
        require(playback != 0, Refusal::Malformed, 0)?;
        require(self.alive(now_ms), Refusal::NoHeartbeat, 0)
    }

    fn start_playback(&mut self, play: Play, now_ms: u32) -> Answer {
        self.may_start(Loaded::Table, play.playback, play.crc, now_ms)?;
        let longest_ms = self.profile.longest_ms;
        let possible = (1..=longest_ms).contains(&play.longest_ms);
        require(possible, Refusal::Duration, longest_ms)?;
        let servo_hz = self.profile.servo.servo_hz;
        let least = libm::ceil(servo_hz / self.profile.telemetry_hz) as u32;
        let least = NonZeroU32::new(least).unwrap_or(NonZeroU32::MIN);
        let asked = play.every.filter(|_| self.profile.flags.telemetry);
        let every = asked.map(|every| NonZeroU32::from(every).max(least));
        self.run = Run::play(play.playback, now_ms, play.longest_ms, every, servo_hz);
        self.start(now_ms);
        Ok(())
    }

    fn start_recording(&mut self, record: Record, now_ms: u32) -> Answer {
        self.may_start(Loaded::Path, record.playback, record.crc, now_ms)?;
        self.run = Run::record(record.playback, now_ms);
        self.path.rewind();
        self.start(now_ms);
        Ok(())
    }

    fn start(&mut self, now_ms: u32) {
        self.servo.start();
        self.fault = Fault::None;
        self.state = DeviceState::Ramp;
        self.queue_event(EventKind::Started, now_ms);
    }

    fn is_current(&self, stop: Stop) -> Answer {
        let current = stop.playback != 0 && stop.playback == self.run.playback;
        require(current, Refusal::OtherPlayback, self.run.playback)
    }

    fn stop(&mut self, stop: Stop) -> Answer {
        self.is_current(stop)?;
        // The playback may have ended by itself in the meantime.
        if self.state.applies_force() {
            self.end();
        }
        Ok(())
    }

    /// Lets the force of a playback fall. It ends as soon as the force is zero, and at once by
    /// all that ends it otherwise.
    fn fade(&mut self, fade: Stop) -> Answer {
        self.is_current(fade)?;
        // The position of a probe is controlled, and not its force.
        require(self.loaded != Loaded::Path, Refusal::WrongState, 0)?;
        if self.state.applies_force() {
            self.servo.fade();
        }
        Ok(())
    }

    fn rearm(&mut self) -> Answer {
        if !self.state.latched() {
            return Ok(());
        }
        require(self.at_rest(), Refusal::Moving, 0)?;
        self.state = DeviceState::Idle;
        self.fault = Fault::None;
        Ok(())
    }

    fn hello(&mut self, header: Header, hello: Hello, now_ms: u32) -> Reply {
        if self.connection != Some(hello.nonce) {
            if self.state.armed() {
                self.latch(DeviceState::Limp, Fault::NewConnection, now_ms);
            }
            self.unload();
            if self.state == DeviceState::Boot {
                self.state = DeviceState::Idle;
            }
            self.connection = Some(hello.nonce);
            self.last_request = Some(LastRequest {
                sequence: header.sequence,
                request: None,
            });
            self.heartbeat = None;
            self.alive = None;
            self.unsolicited = 0;
        }
        self.minor = hello.minor.min(MINOR);
        let profile = &self.profile;
        let flags = profile.flags;
        Reply::Identity(Identity {
            nonce: hello.nonce,
            versions: [VERSION; 2],
            state: self.state,
            fault: self.fault,
            flags,
            clock_ms: now_ms,
            watchdog_ms: profile.watchdog_ms,
            max_nodes: NODES.min(usize::from(u16::MAX)) as u16,
            max_points: if flags.probe { POINTS as u32 } else { 0 },
            longest_ms: profile.longest_ms,
            servo_hz: profile.servo.servo_hz,
            telemetry_hz: profile.telemetry_hz,
            force_n: profile.bounds.force_n,
            velocity_mm_s: profile.bounds.velocity_mm_s,
            stiffness_n_per_mm: profile.bounds.stiffness_n_per_mm,
            damping_n_s_per_mm: profile.bounds.damping_n_s_per_mm,
            stroke_mm: profile.bounds.stroke_mm,
            firmware: profile.firmware,
            serial: profile.serial,
            constants: (self.minor > 0).then(|| self.constants()),
        })
    }

    fn constants(&self) -> Constants {
        let servo = &self.profile.servo;
        Constants {
            minor: self.minor,
            features: Features {
                mechanism: self.profile.features.mechanism && self.minor >= MECHANISM_MINOR,
                elements: self.profile.features.elements && self.minor >= ELEMENTS_MINOR,
                fade: self.profile.features.fade && self.minor >= FADE_MINOR,
                ..self.profile.features
            },
            commit_ms: COMMIT_MS,
            acceleration_hz: servo.acceleration_hz,
            least_mass_kg: servo.least_mass_kg,
            damping_n_s_per_mm: servo.damping_n_s_per_mm,
            wall_n_per_mm: servo.wall_n_per_mm,
            wall_n_s_per_mm: servo.wall_n_s_per_mm,
            overtravel_mm: servo.overtravel_mm,
            jump_mm: servo.jump_mm,
            slew_n_s: servo.slew_n_s,
            ramp_s: servo.ramp_s,
        }
    }

    fn heartbeat(&mut self, beat: Heartbeat, now_ms: u32) -> Reply {
        let ahead = beat.deadline_ms.wrapping_sub(now_ms);
        let newer = self
            .heartbeat
            .is_none_or(|last| (1..0x8000_0000).contains(&beat.count.wrapping_sub(last)));
        // A deadline in the past is far ahead modulo 2³².
        let fresh = self.connection.is_some() && newer && (1..=MAX_DEADLINE_MS).contains(&ahead);
        if fresh {
            self.heartbeat = Some(beat.count);
            self.alive = Some(Alive {
                since_ms: now_ms,
                for_ms: ahead.min(u32::from(self.profile.watchdog_ms)),
            });
        } else {
            self.stale_beats = self.stale_beats.wrapping_add(1);
        }
        Reply::Pulse(Pulse {
            count: beat.count,
            fresh,
            state: self.state,
            fault: self.fault,
            clock_ms: now_ms,
        })
    }

    fn outcome(&self, now_ms: u32) -> Reply {
        let tally = self.servo.tally();
        Reply::Outcome(Outcome {
            state: self.state,
            fault: self.fault,
            loaded: self.loaded,
            clock_ms: now_ms,
            crc: self.crc,
            playback: self.run.playback,
            ticks: self.run.ticks,
            samples: self.run.samples,
            strokes: tally.strokes,
            switches: count(tally.switches),
            clamps: count(tally.clamps),
            slewed: count(tally.slewed),
            mass_held: count(tally.mass_held),
            energy_j: finite(tally.energy_j),
            least_energy_j: finite(tally.least_energy_j),
            peak_force_n: finite(tally.peak_force_n),
            rough_n2: finite(tally.rough_n2()),
            limit_n: self.limit_n,
            bad_frames: self.bad_frames,
            stale_beats: self.stale_beats,
        })
    }
}

/// Quantities on the wire are finite.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}
