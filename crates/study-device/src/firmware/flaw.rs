//! Planted defects of the simulated device, to show that the commissioning finds them.
//!
//! A flaw changes messages between the link and the handler. The handler itself is not
//! changed, so the force stays within its limit.

use super::replies;
use std::collections::VecDeque;
use std::time::Duration;
use study_wire::frame::{Decoder, FRAME_CRC_LEN, Frame};
use study_wire::message::{
    Ack, DeviceState, Fault, FixedVec, Header, Heartbeat, Refusal, Reply, Request, Telemetry,
    TelemetrySample, kind,
};

/// A planted defect, with the clause of `docs/wire.md` that it violates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flaw {
    /// 2.3: executes damaged frames.
    TakesDamaged,
    /// 3.3: supports only version 2. This is not a defect but an incompatible device.
    OtherVersion,
    /// 3.4: acknowledges LIMP without executing it.
    DeafToLimp,
    /// 4.3: executes repeated requests again.
    Repeats,
    /// 5.2: reports after a while that it is idle, without REARM.
    Unlatched,
    /// 6.1: accepts expired heartbeats.
    TakesStale,
    /// 6.3: goes limp only 300 ms after the last heartbeat.
    LateWatchdog,
    /// 5.5: reports no force from FADE on.
    AbruptFade,
    /// 7.5: reports 1.5 times the commanded force.
    NoClamp,
    /// 8.3: accepts invalid tables and limits.
    TakesBadTables,
    /// 8.4: accepts uncertified tables without permission.
    TakesUncertified,
    /// 9.1: loses every tenth telemetry message.
    LosesTelemetry,
    /// 11.1: answers after 50 ms.
    SlowReplies,
    /// 11.1: answers after 20 ms.
    LateReplies,
    /// 11.3: stops 200 ms after STOP.
    SlowStop,
}

impl Flaw {
    /// Every flaw with its name on the command line and its clause.
    pub const ALL: [(Self, &'static str, &'static str); 15] = [
        (Self::TakesDamaged, "takes-damaged", "2.3"),
        (Self::OtherVersion, "other-version", "3.3"),
        (Self::DeafToLimp, "deaf-to-limp", "3.4"),
        (Self::Repeats, "repeats", "4.3"),
        (Self::Unlatched, "unlatched", "5.2"),
        (Self::TakesStale, "takes-stale", "6.1"),
        (Self::LateWatchdog, "late-watchdog", "6.3"),
        (Self::AbruptFade, "abrupt-fade", "5.5"),
        (Self::NoClamp, "no-clamp", "7.5"),
        (Self::TakesBadTables, "takes-bad-tables", "8.3"),
        (Self::TakesUncertified, "takes-uncertified", "8.4"),
        (Self::LosesTelemetry, "loses-telemetry", "9.1"),
        (Self::SlowReplies, "slow-replies", "11.1"),
        (Self::LateReplies, "late-replies", "11.1"),
        (Self::SlowStop, "slow-stop", "11.3"),
    ];

    /// The flaw with this name on the command line.
    pub fn named(name: &str) -> Option<Self> {
        let (flaw, ..) = Self::ALL.into_iter().find(|(_, own, _)| *own == name)?;
        Some(flaw)
    }
}

/// Actual watchdog time with [`Flaw::LateWatchdog`], ms.
pub(super) const LATE_MS: u16 = 300;
const SLOW_REPLY: Duration = Duration::from_millis(50);
const LATE_REPLY: Duration = Duration::from_millis(20);
const SLOW_STOP: Duration = Duration::from_millis(200);

/// Changes messages according to a flaw.
#[derive(Debug)]
pub(super) struct FlawInjector {
    flaw: Flaw,
    /// Watchdog time that the device states, ms.
    stated_ms: u16,
    /// Bytes since the last zero.
    raw: Vec<u8>,
    /// Received frames to be handled later.
    held_in: VecDeque<(Duration, Vec<u8>)>,
    /// Frames to be sent later.
    held_out: VecDeque<(Duration, Vec<u8>)>,
    /// Substituted sequence number.
    sequence: u16,
    /// Original sequence number.
    stands_for: u16,
    telemetry: u32,
    /// Whether FADE came after the last PLAY.
    fades: bool,
}

impl FlawInjector {
    pub(super) fn new(flaw: Flaw, stated_ms: u16) -> Self {
        Self {
            flaw,
            stated_ms,
            raw: Vec::new(),
            held_in: VecDeque::new(),
            held_out: VecDeque::new(),
            sequence: 0,
            stands_for: 0,
            telemetry: 0,
            fades: false,
        }
    }

    /// The bytes for the handler, and the answers sent in its place.
    pub(super) fn inbound(&mut self, bytes: &[u8], at: Duration, clock_ms: u32) -> [Vec<u8>; 2] {
        let mut received = Vec::new();
        let mut answers = Vec::new();
        for byte in bytes {
            if *byte != 0 {
                self.raw.push(*byte);
                continue;
            }
            let raw = std::mem::take(&mut self.raw);
            if raw.is_empty() {
                continue;
            }
            let Some(body) = self.body(&raw) else {
                // Unchanged, so that the handler counts it.
                received.push(0);
                received.extend_from_slice(&raw);
                received.push(0);
                continue;
            };
            let Some(header) = Header::read(&body) else {
                continue;
            };
            if self.flaw == Flaw::OtherVersion {
                answers.extend(other_version(header, clock_ms));
            } else if self.flaw == Flaw::DeafToLimp && header.kind == kind::LIMP {
                answers.extend(ack(header, Refusal::None, DeviceState::Limp, clock_ms));
            } else if self.flaw == Flaw::SlowStop && header.kind == kind::STOP {
                self.held_in.push_back((at + SLOW_STOP, framed(&body)));
            } else if let Some(body) = self.change_request(header, body, clock_ms) {
                received.extend(framed(&body));
            }
        }
        [received, answers]
    }

    /// The next delayed frame that is due at `at`.
    pub(super) fn overdue(&mut self, at: Duration) -> Option<Vec<u8>> {
        let (due, _) = self.held_in.front()?;
        if *due > at {
            return None;
        }
        self.held_in.pop_front().map(|(_, bytes)| bytes)
    }

    /// The body of a frame; with [`Flaw::TakesDamaged`] also that of a damaged one.
    fn body(&self, raw: &[u8]) -> Option<Vec<u8>> {
        let mut decoder = Decoder::new();
        for byte in raw {
            decoder.push(*byte);
        }
        match decoder.push(0)? {
            Ok(body) => Some(body.to_vec()),
            Err(_) if self.flaw == Flaw::TakesDamaged => {
                let mut body = without_cobs(raw)?;
                body.truncate(body.len().checked_sub(FRAME_CRC_LEN)?);
                Some(body)
            }
            Err(_) => None,
        }
    }

    /// The body of the request for the handler; `None` if it is dropped.
    fn change_request(
        &mut self,
        header: Header,
        mut body: Vec<u8>,
        clock_ms: u32,
    ) -> Option<Vec<u8>> {
        let request = Request::decode(&body).ok().map(|(_, request)| request);
        match (self.flaw, request) {
            (Flaw::Repeats, Some(request)) if request.sequenced() => {
                self.sequence = self.sequence.wrapping_add(1);
                self.stands_for = header.sequence;
                body[2..4].copy_from_slice(&self.sequence.to_le_bytes());
            }
            (Flaw::Repeats, Some(Request::Hello(_))) => self.sequence = header.sequence,
            (Flaw::AbruptFade, Some(Request::Fade(_))) => self.fades = true,
            (Flaw::AbruptFade, Some(Request::Play(_))) => self.fades = false,
            (Flaw::TakesStale | Flaw::LateWatchdog, Some(Request::Heartbeat(beat))) => {
                let ahead_ms = if self.flaw == Flaw::LateWatchdog {
                    900
                } else {
                    20
                };
                let beat = Heartbeat {
                    deadline_ms: clock_ms.wrapping_add(ahead_ms),
                    ..beat
                };
                return body_of(Request::Heartbeat(beat).frame(header.sequence).as_bytes());
            }
            _ => {}
        }
        Some(body)
    }

    /// The bytes to send at `at` for the handler's output.
    pub(super) fn outbound(&mut self, bytes: &[u8], at: Duration) -> Vec<u8> {
        let mut sent = Vec::new();
        for (sequence, reply) in replies(bytes) {
            let Some((sequence, reply)) = self.change_reply(sequence, reply) else {
                continue;
            };
            let frame = reply.frame(sequence).as_bytes().to_vec();
            match self.flaw {
                Flaw::SlowReplies => self.held_out.push_back((at + SLOW_REPLY, frame)),
                Flaw::LateReplies => self.held_out.push_back((at + LATE_REPLY, frame)),
                _ => sent.extend(frame),
            }
        }
        while self.held_out.front().is_some_and(|(due, _)| *due <= at) {
            sent.extend(self.held_out.pop_front().into_iter().flat_map(|(_, f)| f));
        }
        sent
    }

    /// The reply to send; `None` if it is dropped.
    fn change_reply(&mut self, mut sequence: u16, mut reply: Reply) -> Option<(u16, Reply)> {
        match (self.flaw, &mut reply) {
            (Flaw::Repeats, Reply::Ack(_)) if sequence == self.sequence => {
                sequence = self.stands_for;
            }
            (Flaw::LateWatchdog, Reply::Identity(identity)) => {
                identity.watchdog_ms = self.stated_ms;
            }
            (Flaw::TakesBadTables | Flaw::TakesUncertified, Reply::Ack(ack))
                if matches!(ack.request, kind::TABLE_COMMIT | kind::MECHANISM_COMMIT) =>
            {
                let taken: &[Refusal] = if self.flaw == Flaw::TakesUncertified {
                    &[Refusal::Uncertified]
                } else {
                    &[Refusal::BadTable, Refusal::Limit]
                };
                if taken.contains(&ack.refusal) {
                    ack.refusal = Refusal::None;
                    ack.detail = 0;
                    ack.state = DeviceState::Loaded;
                }
            }
            (Flaw::AbruptFade, Reply::Telemetry(telemetry)) if self.fades => {
                change_forces(telemetry, |_| 0);
            }
            (Flaw::NoClamp, Reply::Telemetry(telemetry)) => {
                change_forces(telemetry, |force_un| force_un.saturating_add(force_un / 2));
            }
            (Flaw::NoClamp, Reply::Outcome(outcome)) => outcome.peak_force_n *= 1.5,
            (Flaw::LosesTelemetry, Reply::Telemetry(_)) => {
                self.telemetry += 1;
                if self.telemetry.is_multiple_of(10) {
                    return None;
                }
            }
            (Flaw::Unlatched, Reply::Pulse(pulse)) => {
                pretend_idle(&mut pulse.state, &mut pulse.fault)
            }
            (Flaw::Unlatched, Reply::Outcome(outcome)) => {
                pretend_idle(&mut outcome.state, &mut outcome.fault);
            }
            _ => {}
        }
        Some((sequence, reply))
    }
}

fn change_forces(telemetry: &mut Telemetry, change: impl Fn(i32) -> i32) {
    let mut samples = FixedVec::new();
    for sample in telemetry.samples.as_slice() {
        samples.push(TelemetrySample {
            command_un: change(sample.command_un),
            ..*sample
        });
    }
    telemetry.samples = samples;
}

fn pretend_idle(state: &mut DeviceState, fault: &mut Fault) {
    if *state == DeviceState::Limp {
        *state = DeviceState::Idle;
        *fault = Fault::None;
    }
}

/// The refusal of a device that supports only version 2.
fn other_version(header: Header, clock_ms: u32) -> Vec<u8> {
    let refusal = if header.kind == kind::LIMP {
        Refusal::None
    } else {
        Refusal::Version
    };
    ack(header, refusal, DeviceState::Boot, clock_ms)
}

fn ack(header: Header, refusal: Refusal, state: DeviceState, clock_ms: u32) -> Vec<u8> {
    let reply = Reply::Ack(Ack {
        request: header.kind,
        refusal,
        state,
        fault: Fault::None,
        clock_ms,
        detail: if refusal == Refusal::Version { 2 } else { 0 },
    });
    reply.frame(header.sequence).as_bytes().to_vec()
}

fn framed(body: &[u8]) -> Vec<u8> {
    Frame::of(body).map_or_else(|_| Vec::new(), |frame| frame.as_bytes().to_vec())
}

fn body_of(frame: &[u8]) -> Option<Vec<u8>> {
    let mut decoder = Decoder::new();
    frame
        .iter()
        .find_map(|byte| decoder.push(*byte).and_then(Result::ok).map(<[u8]>::to_vec))
}

fn without_cobs(raw: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let mut rest = raw;
    while let Some((code, after)) = rest.split_first() {
        let (block, after) = after.split_at_checked(usize::from(*code).checked_sub(1)?)?;
        out.extend_from_slice(block);
        if !after.is_empty() && *code < 0xFF {
            out.push(0);
        }
        rest = after;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_wire::frame::crc32;

    #[test]
    fn every_flaw_has_a_name_and_a_clause_of_the_specification() {
        let document = include_str!("../../../../docs/wire.md");
        for (flaw, name, clause) in Flaw::ALL {
            assert_eq!(Flaw::named(name), Some(flaw));
            let in_list = format!("- **{clause}**");
            let in_table = format!("| {clause} |");
            assert!(
                document.contains(&in_list) || document.contains(&in_table),
                "{clause}"
            );
        }
        assert_eq!(Flaw::named("none"), None);
    }

    #[test]
    fn a_damaged_frame_can_be_decoded_without_its_crc() {
        let frame = Frame::of(&[1, 9, 0, 0]).unwrap();
        let raw = &frame.as_bytes()[1..frame.as_bytes().len() - 1];
        let plain = without_cobs(raw).unwrap();
        assert_eq!(plain[..4], [1, 9, 0, 0]);
        assert_eq!(plain[4..], crc32(&[1, 9, 0, 0]).to_le_bytes());
    }
}
