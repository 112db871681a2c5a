//! What a device does with each message.

use super::run::{Run, count};
use super::{Alive, Done, Handler, Out};
use crate::frame::crc32;
use crate::message::{
    Fault, Happening, Header, Heartbeat, Hello, Identity, Loaded, Outcome, Play, Pulse, Record,
    Refusal, Reply, Request, State, Stop, VERSION, WireError, kind,
};
use crate::servo::{Core, Settings};

/// A deadline further ahead than this is no deadline, ms.
const FURTHEST_MS: u32 = 1000;

type Answer = Result<(), (Refusal, u32)>;

impl<const NODES: usize, const POINTS: usize> Handler<NODES, POINTS> {
    /// A body whose CRC fits.
    pub(super) fn handle(&mut self, body: &[u8], now_ms: u32, out: Out<'_>) {
        let Some(header) = Header::read(body) else {
            self.bad_frames = self.bad_frames.wrapping_add(1);
            return;
        };
        // LIMP is the same in every version and with anything behind it
        if header.kind == kind::LIMP {
            self.latch(State::Limp, Fault::Told, now_ms);
            self.answer(header, Ok(()), now_ms, out);
            return self.tell(out);
        }
        match Request::decode(body) {
            Ok((header, request)) if request.sequenced() => {
                self.once(header, &request, crc32(body), now_ms, out);
            }
            Ok((header, request)) => self.at_any_time(header, &request, now_ms, out),
            Err(error) => {
                self.bad_frames = self.bad_frames.wrapping_add(1);
                let refusal = match error {
                    // what a device sends is not for a device
                    WireError::UnknownType(kind) if kind >= kind::ACK => return,
                    WireError::UnknownType(_) => (Refusal::UnknownType, 0),
                    WireError::Version(_) => (Refusal::Version, u32::from(VERSION)),
                    _ => (Refusal::Malformed, 0),
                };
                self.answer(header, Err(refusal), now_ms, out);
            }
        }
        self.tell(out);
    }

    fn answer(&self, header: Header, answer: Answer, now_ms: u32, out: Out<'_>) {
        let reply = self.ack(header.kind, answer, now_ms);
        out(reply.frame(header.sequence).as_bytes());
    }

    /// HELLO, HEARTBEAT, STATE: nothing is remembered of them.
    fn at_any_time(&mut self, header: Header, request: &Request, now_ms: u32, out: Out<'_>) {
        let reply = match request {
            Request::Hello(hello) => self.hello(header, *hello, now_ms),
            Request::Heartbeat(beat) => self.heartbeat(*beat, now_ms),
            _ => self.outcome(now_ms),
        };
        out(reply.frame(header.sequence).as_bytes());
    }

    /// Everything that must not be done twice.
    fn once(&mut self, header: Header, request: &Request, crc: u32, now_ms: u32, out: Out<'_>) {
        let (Some(_), Some(done)) = (self.connection, self.done) else {
            return self.answer(header, Err((Refusal::NoHello, 0)), now_ms, out);
        };
        match header.sequence.wrapping_sub(done.sequence) {
            0 => match done.request {
                Some((same, reply)) if same == crc => out(reply.as_bytes()),
                _ => self.answer(header, Err((Refusal::Reused, 0)), now_ms, out),
            },
            1..0x8000 => {
                let answer = self.perform(request, now_ms);
                let reply = self.ack(header.kind, answer, now_ms).frame(header.sequence);
                self.done = Some(Done {
                    sequence: header.sequence,
                    request: Some((crc, reply)),
                });
                out(reply.as_bytes());
            }
            // overtaken by a later one: its sender no longer waits
            _ => {}
        }
    }

    fn perform(&mut self, request: &Request, now_ms: u32) -> Answer {
        match request {
            Request::TableBegin(begin) => {
                self.may_load()?;
                self.table.begin(begin)
            }
            Request::TableChunk(chunk) => {
                self.loading()?;
                self.table.chunk(chunk)
            }
            Request::TableCommit(commit) => {
                self.loading()?;
                let judged = self.table.judge(commit.crc, &self.profile.bounds);
                self.arm(judged, Loaded::Table, commit.crc, now_ms)
            }
            Request::PathBegin(begin) => {
                self.may_probe()?;
                self.may_load()?;
                self.path.begin(begin)
            }
            Request::PathChunk(chunk) => {
                self.may_probe()?;
                self.loading()?;
                self.path.chunk(chunk)
            }
            Request::PathCommit(commit) => {
                self.may_probe()?;
                self.loading()?;
                let judged = self.path.judge(
                    commit.crc,
                    &self.profile.bounds,
                    self.profile.servo.servo_hz,
                );
                self.arm(judged, Loaded::Path, commit.crc, now_ms)
            }
            Request::Play(play) => self.play_it(*play, now_ms),
            Request::Record(record) => self.record_it(*record, now_ms),
            Request::Stop(stop) => self.stop(*stop),
            Request::Rearm => self.rearm(),
            // not sequenced
            Request::Hello(_) | Request::Limp | Request::Heartbeat(_) | Request::State => {
                Err((Refusal::Malformed, 0))
            }
        }
    }

    /// An upload takes the place of what is loaded.
    fn may_load(&mut self) -> Answer {
        match self.state {
            State::Idle => Ok(()),
            State::Loaded => {
                self.unload();
                self.state = State::Idle;
                Ok(())
            }
            _ => Err((Refusal::WrongState, 0)),
        }
    }

    /// What follows a BEGIN: it replaces nothing.
    fn loading(&self) -> Answer {
        if self.state == State::Idle {
            Ok(())
        } else {
            Err((Refusal::WrongState, 0))
        }
    }

    fn may_probe(&self) -> Answer {
        if POINTS == 0 || !self.profile.flags.probe {
            Err((Refusal::NoProbe, 0))
        } else {
            Ok(())
        }
    }

    fn arm(
        &mut self,
        judged: Result<f64, (Refusal, u32)>,
        loaded: Loaded,
        crc: u32,
        now_ms: u32,
    ) -> Answer {
        let limit_n = match judged {
            Ok(limit_n) if self.alive(now_ms) => limit_n,
            Ok(_) => return Err((Refusal::NoHeartbeat, 0)),
            Err(refused) => {
                // half an upload stays, so that a chunk can be sent again
                if !matches!(refused.0, Refusal::Incomplete | Refusal::WrongState) {
                    self.unload();
                }
                return Err(refused);
            }
        };
        let velocity_mm_s = match loaded {
            Loaded::Path => self.path.velocity_mm_s(),
            _ => self.table.begin.map_or(0.0, |begin| begin.velocity_mm_s),
        };
        self.core = Core::new(Settings {
            force_n: limit_n,
            velocity_mm_s,
            ..self.profile.servo
        });
        self.run = Run::default();
        self.limit_n = limit_n;
        self.loaded = loaded;
        self.crc = crc;
        self.state = State::Loaded;
        self.fault = Fault::None;
        self.uploads = self.uploads.wrapping_add(1);
        Ok(())
    }

    fn may_start(&self, loaded: Loaded, playback: u32, crc: u32, now_ms: u32) -> Answer {
        if self.state != State::Loaded {
            Err((Refusal::WrongState, 0))
        } else if self.loaded != loaded || self.crc != crc {
            Err((Refusal::OtherTable, self.crc))
        } else if playback == 0 {
            Err((Refusal::Malformed, 0))
        } else if !self.alive(now_ms) {
            Err((Refusal::NoHeartbeat, 0))
        } else {
            Ok(())
        }
    }

    fn play_it(&mut self, play: Play, now_ms: u32) -> Answer {
        self.may_start(Loaded::Table, play.playback, play.crc, now_ms)?;
        if !(1..=self.profile.longest_ms).contains(&play.longest_ms) {
            return Err((Refusal::Duration, self.profile.longest_ms));
        }
        let servo_hz = self.profile.servo.servo_hz;
        let least = libm::ceil(servo_hz / self.profile.telemetry_hz) as u32;
        let every = match play.every {
            0 => 0,
            _ if !self.profile.flags.telemetry => 0,
            every => u32::from(every).max(least).max(1),
        };
        self.run = Run::play(play.playback, now_ms, play.longest_ms, every, servo_hz);
        self.start(now_ms);
        Ok(())
    }

    fn record_it(&mut self, record: Record, now_ms: u32) -> Answer {
        self.may_start(Loaded::Path, record.playback, record.crc, now_ms)?;
        self.run = Run::record(record.playback, now_ms);
        self.path.rewind();
        self.start(now_ms);
        Ok(())
    }

    fn start(&mut self, now_ms: u32) {
        self.core.start();
        self.fault = Fault::None;
        self.state = State::Ramp;
        self.happened(Happening::Started, now_ms);
    }

    fn stop(&mut self, stop: Stop) -> Answer {
        if stop.playback == 0 || stop.playback != self.run.playback {
            return Err((Refusal::OtherPlayback, self.run.playback));
        }
        // what has ended by itself in the meantime has ended
        if self.state.forceful() {
            self.end();
        }
        Ok(())
    }

    fn rearm(&mut self) -> Answer {
        if !self.state.latched() {
            return Ok(());
        }
        if !self.at_rest() {
            return Err((Refusal::Moving, 0));
        }
        self.state = State::Idle;
        self.fault = Fault::None;
        Ok(())
    }

    fn hello(&mut self, header: Header, hello: Hello, now_ms: u32) -> Reply {
        if self.connection != Some(hello.nonce) {
            if self.state.armed() {
                self.latch(State::Limp, Fault::NewConnection, now_ms);
            }
            self.unload();
            if self.state == State::Boot {
                self.state = State::Idle;
            }
            self.connection = Some(hello.nonce);
            self.done = Some(Done {
                sequence: header.sequence,
                request: None,
            });
            self.beat = None;
            self.alive = None;
            self.unasked = 0;
        }
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
            most_nodes: NODES.min(usize::from(u16::MAX)) as u16,
            most_points: if flags.probe { POINTS as u32 } else { 0 },
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
        })
    }

    fn heartbeat(&mut self, beat: Heartbeat, now_ms: u32) -> Reply {
        let ahead = beat.deadline_ms.wrapping_sub(now_ms);
        let newer = self
            .beat
            .is_none_or(|last| (1..0x8000_0000).contains(&beat.count.wrapping_sub(last)));
        // a deadline that has passed is far ahead, modulo 2³²
        let fresh = self.connection.is_some() && newer && (1..=FURTHEST_MS).contains(&ahead);
        if fresh {
            self.beat = Some(beat.count);
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
        let tally = self.core.tally();
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
            most_force_n: finite(tally.most_force_n),
            rough_n2: finite(tally.rough_n2()),
            limit_n: self.limit_n,
            bad_frames: self.bad_frames,
            stale_beats: self.stale_beats,
        })
    }
}

/// A quantity of the wire is a number.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}
