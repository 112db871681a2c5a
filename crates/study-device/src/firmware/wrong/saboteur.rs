//! What a wrong device changes.

use super::super::motor::{Motor, Pending};
use super::super::replies;
use super::felt::{Felt, hum_n, tick_n};
use super::{Wrong, WrongLoads};
use std::collections::VecDeque;
use study_wire::frame::{Decoder, crc32};
use study_wire::handler::Drive;
use study_wire::message::{
    Commit, FixedVec, Node, Play, Reply, Request, TableBegin, TableChunk, Telemetry,
    TelemetrySample, UploadCrc,
};
use study_wire::predict::{Direction, Lookup, Motion};
use study_wire::servo::ServoSettings;

/// Changes what a wrong device receives, measures and sends.
#[derive(Debug)]
pub(in crate::firmware) struct Saboteur {
    how: WrongLoads,
    told: ServoSettings,
    loads: u32,
    /// Bytes since the last zero.
    raw: Vec<u8>,
    begin: Option<TableBegin>,
    /// The nodes of the table as received, of the first table, and of the one before.
    nodes: Vec<Node>,
    first: Vec<Node>,
    before: Vec<Node>,
    crc: UploadCrc,
    /// CRC of the table as received, and as changed.
    crcs: (u32, u32),
    /// Motions of the last periods, and the number of periods since the start.
    motions: VecDeque<Motion>,
    periods: usize,
    /// Commanded forces of the last samples, µN, with their periods.
    forces: VecDeque<(u32, i32)>,
    held: Option<TelemetrySample>,
    /// A motor that is late.
    late: Pending,
    /// What its sensor measures.
    felt: Felt,
    /// Since when the handle rests, s.
    rests_s: Option<f64>,
    /// Direction of the motion, and the place farthest in it, mm.
    side: f64,
    turned_mm: Option<f64>,
}

/// Largest force of a motor that saturates, N.
const SATURATED_N: f64 = 9.0;
/// A motor that is late.
const LATE_MOTOR: Motor = Motor {
    gain: 1.0,
    lag_s: 0.02,
};
/// Servo periods of the late position and speed: 30 ms at 4 kHz.
const LATE_PERIODS: usize = 120;
/// Sum of a position and its mirror image, mm: the handle rests in the middle.
const MIRROR_MM: f64 = 35.0;
/// Periods whose motion is kept: longer than a sample waits.
const KEPT_PERIODS: usize = 800;

impl Saboteur {
    pub(in crate::firmware) fn new(how: WrongLoads, told: ServoSettings) -> Self {
        Self {
            how,
            told,
            loads: 0,
            raw: Vec::new(),
            begin: None,
            nodes: Vec::new(),
            first: Vec::new(),
            before: Vec::new(),
            crc: UploadCrc::default(),
            crcs: (0, 0),
            motions: VecDeque::new(),
            periods: 0,
            forces: VecDeque::new(),
            held: None,
            late: Pending::new(LATE_MOTOR, told.servo_hz),
            felt: Felt::default(),
            rests_s: None,
            side: 1.0,
            turned_mm: None,
        }
    }

    /// How it is wrong now.
    fn wrong(&self) -> Option<Wrong> {
        let [from, to] = self.how.loads;
        (from..=to).contains(&self.loads).then_some(self.how.wrong)
    }

    /// The bytes for the handler.
    pub(in crate::firmware) fn inbound(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut changed = Vec::new();
        for byte in bytes {
            if *byte != 0 {
                self.raw.push(*byte);
                continue;
            }
            let raw = std::mem::take(&mut self.raw);
            let body = decoded(&raw);
            match body.and_then(|body| Request::decode(&body).ok()) {
                Some((header, request)) => {
                    let request = self.request(request);
                    changed.extend_from_slice(request.frame(header.sequence).as_bytes());
                }
                None => {
                    changed.push(0);
                    changed.extend_from_slice(&raw);
                    changed.push(0);
                }
            }
        }
        changed
    }

    fn request(&mut self, request: Request) -> Request {
        match request {
            Request::TableBegin(begin) => {
                if self.first.is_empty() {
                    self.first.clone_from(&self.nodes);
                }
                self.loads += 1;
                self.before = std::mem::take(&mut self.nodes);
                let begin = self.begin(begin);
                self.begin = Some(begin);
                self.crc = UploadCrc::of_table(&begin);
                Request::TableBegin(begin)
            }
            Request::MechanismBegin(_) => {
                self.loads += 1;
                request
            }
            Request::TableChunk(chunk) => {
                // A repeated chunk is answered without being executed.
                let again = usize::from(chunk.first) < self.nodes.len();
                let mut nodes = FixedVec::new();
                for (i, node) in chunk.nodes.as_slice().iter().enumerate() {
                    let at = usize::from(chunk.first) + i;
                    if !again {
                        self.nodes.push(*node);
                    }
                    let node = self.node(at, *node);
                    if !again {
                        self.crc.node(&node);
                    }
                    nodes.push(node);
                }
                Request::TableChunk(TableChunk { nodes, ..chunk })
            }
            Request::TableCommit(commit) if self.wrong().is_some() => {
                self.crcs = (commit.crc, self.crc.clone().value());
                Request::TableCommit(Commit { crc: self.crcs.1 })
            }
            Request::Play(play) if play.crc == self.crcs.0 && self.wrong().is_some() => {
                self.motions.clear();
                self.periods = 0;
                self.forces.clear();
                self.held = None;
                (self.felt, self.rests_s) = (Felt::default(), None);
                self.turned_mm = None;
                Request::Play(Play {
                    crc: self.crcs.1,
                    ..play
                })
            }
            other => other,
        }
    }

    fn begin(&self, begin: TableBegin) -> TableBegin {
        let Some(wrong) = self.wrong() else {
            return begin;
        };
        // It does not look at what it plays.
        let mut begin = TableBegin {
            uncertified_n: Some(begin.force_n),
            ..begin
        };
        match wrong {
            Wrong::Floor => begin.lookup = Lookup::Floor,
            Wrong::Nearest => begin.lookup = Lookup::Nearest,
            Wrong::PlayRule => begin.direction = Direction::Play { delta_mm: 8.0 },
            Wrong::DahlRule => begin.direction = Direction::Dahl { delta_mm: 8.0 },
            Wrong::LowLimit => {
                begin.force_n /= 3.0;
                begin.uncertified_n = Some(begin.force_n);
            }
            _ => {}
        }
        begin
    }

    fn node(&self, at: usize, node: Node) -> Node {
        let Some(wrong) = self.wrong() else {
            return node;
        };
        let count = self.begin.map_or(0, |b| usize::from(b.nodes));
        let scaled = |by: [f64; 4]| {
            let scale = |p: [f64; 4]| std::array::from_fn(|i| by[i] * p[i]);
            Node {
                positive: scale(node.positive),
                negative: scale(node.negative),
                ..node
            }
        };
        let raised = |by: f64| {
            let mut raised = node;
            raised.positive[3] += by;
            raised.negative[3] += by;
            raised
        };
        // Parameters of the node at another place, as far as it has been received.
        let from = |other: Option<&Node>| {
            other.map_or(node, |other| Node {
                x_mm: node.x_mm,
                ..*other
            })
        };
        match wrong {
            Wrong::HalfForce => scaled([0.5; 4]),
            Wrong::DoubleForce => scaled([2.0; 4]),
            Wrong::Weak => scaled([0.85; 4]),
            Wrong::Strong => scaled([1.15; 4]),
            Wrong::SlightlyWeak => scaled([0.89; 4]),
            Wrong::Reversed => scaled([-1.0; 4]),
            Wrong::Limp => scaled([0.0; 4]),
            Wrong::NoMass => scaled([0.0, 1.0, 1.0, 1.0]),
            Wrong::NoDamping => scaled([1.0, 0.0, 1.0, 1.0]),
            Wrong::NoStiffness => scaled([1.0, 1.0, 0.0, 1.0]),
            Wrong::NoOffset => scaled([1.0, 1.0, 1.0, 0.0]),
            Wrong::MassSign => scaled([-1.0, 1.0, 1.0, 1.0]),
            Wrong::DampingSign => scaled([1.0, -1.0, 1.0, 1.0]),
            Wrong::DampingTimesTen => scaled([1.0, 10.0, 1.0, 1.0]),
            Wrong::StiffnessFromStart => {
                let start_mm = self.nodes.first().map_or(0.0, |n| n.x_mm);
                let mut moved = node;
                moved.positive[3] -= node.positive[2] * start_mm;
                moved.negative[3] -= node.negative[2] * start_mm;
                moved
            }
            Wrong::WeakForwards => Node {
                positive: node.positive.map(|p| 0.85 * p),
                ..node
            },
            Wrong::OneDirection => Node {
                negative: node.positive,
                ..node
            },
            Wrong::OtherDirection => Node {
                positive: node.negative,
                negative: node.positive,
                ..node
            },
            Wrong::OnlyForwards => Node {
                negative: [0.0; 4],
                ..node
            },
            Wrong::Biased => raised(0.6),
            Wrong::OneBadNode if at == count / 2 => raised(6.0),
            Wrong::HalfTable if at >= count / 2 => scaled([0.0; 4]),
            Wrong::FirstTable => from(self.first.get(at)),
            Wrong::PreviousTable => from(self.before.get(at)),
            Wrong::TornTable if at >= count / 2 => from(self.before.get(at)),
            // Only the second half can be known while the table arrives.
            Wrong::NodesBackwards if at >= count / 2 => from(self.nodes.get(count - 1 - at)),
            Wrong::NodesShifted => from(self.nodes.get(at.saturating_sub(1))),
            Wrong::Stretched => Node {
                x_mm: 1.1 * node.x_mm,
                ..node
            },
            _ => node,
        }
    }

    /// The motion that the servo sees.
    pub(in crate::firmware) fn motion(&mut self, motion: Motion) -> Motion {
        let Some(wrong) = self.wrong() else {
            return motion;
        };
        self.motions.push_back(motion);
        self.periods += 1;
        if self.motions.len() > KEPT_PERIODS {
            self.motions.pop_front();
        }
        let late = self.motions.len().saturating_sub(LATE_PERIODS);
        let late = self.motions[late];
        let speed = |by: f64| Motion {
            v_mm_s: by * motion.v_mm_s,
            ..motion
        };
        let acceleration = |by: f64| Motion {
            a_m_s2: by * motion.a_m_s2,
            ..motion
        };
        let position = |x_mm: f64| Motion { x_mm, ..motion };
        match wrong {
            Wrong::SpeedHalf | Wrong::SpeedHalfInside => speed(0.5),
            Wrong::SpeedInMetres => speed(1e-3),
            Wrong::SpeedReversed => speed(-1.0),
            Wrong::SpeedZero => speed(0.0),
            Wrong::SpeedLate => Motion {
                v_mm_s: late.v_mm_s,
                ..motion
            },
            Wrong::SpeedClipped => Motion {
                v_mm_s: motion.v_mm_s.clamp(-40.0, 40.0),
                ..motion
            },
            Wrong::DirectionLate => {
                // the first motion is known at once
                let way_mm = motion.x_mm - self.turned_mm.unwrap_or(motion.x_mm);
                if way_mm * self.side >= 0.0 {
                    self.turned_mm = Some(motion.x_mm);
                } else if way_mm.abs() > 3.0 {
                    self.side = way_mm.signum();
                    self.turned_mm = Some(motion.x_mm);
                }
                speed(self.side * motion.v_mm_s.signum())
            }
            Wrong::PositionLate => position(late.x_mm),
            // Steps without a jump that would trip.
            Wrong::PositionCoarse => {
                let step = (motion.x_mm / 3.0).round() * 3.0;
                position(step + (motion.x_mm - step).clamp(-1.5, 1.5).powi(5) / 5.0625)
            }
            Wrong::EncoderScale => {
                let [low, high] = self.begin.map_or([0.0; 2], |begin| begin.range_mm);
                let middle_mm = 0.5 * (low + high);
                position(middle_mm + 1.1 * (motion.x_mm - middle_mm))
            }
            Wrong::AccelerationTimesThree => acceleration(3.0),
            Wrong::AccelerationReversed => acceleration(-1.0),
            Wrong::HalfPosition => Motion {
                x_mm: 0.5 * motion.x_mm,
                v_mm_s: 0.5 * motion.v_mm_s,
                a_m_s2: 0.5 * motion.a_m_s2,
            },
            Wrong::ShiftedPosition => position(motion.x_mm + 3.0),
            Wrong::Mirrored => Motion {
                x_mm: MIRROR_MM - motion.x_mm,
                v_mm_s: -motion.v_mm_s,
                a_m_s2: -motion.a_m_s2,
            },
            _ => motion,
        }
    }

    /// What the motor does.
    pub(in crate::firmware) fn drive(&mut self, drive: Drive) -> Drive {
        match (self.wrong(), drive) {
            // F > 0 pushes towards −x
            (Some(Wrong::WeakMotorBackwards), Drive::Force(force_n)) if force_n < 0.0 => {
                Drive::Force(0.5 * force_n)
            }
            (Some(Wrong::SaturatedMotor), Drive::Force(force_n)) => {
                Drive::Force(force_n.clamp(-SATURATED_N, SATURATED_N))
            }
            (Some(Wrong::LateMotor), Drive::Force(force_n)) => {
                Drive::Force(self.late.give(force_n))
            }
            (Some(Wrong::WeakMotor), Drive::Force(force_n)) => Drive::Force(0.5 * force_n),
            (Some(Wrong::Mirrored), Drive::Force(force_n)) => Drive::Force(-force_n),
            _ => drive,
        }
    }

    /// The bytes to send for the handler's output.
    pub(in crate::firmware) fn outbound(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut sent = Vec::new();
        for (sequence, reply) in replies(bytes) {
            let reply = match reply {
                Reply::Telemetry(telemetry) if self.is_unheard(&telemetry) => continue,
                Reply::Telemetry(telemetry) => Reply::Telemetry(self.telemetry(telemetry)),
                Reply::Identity(mut identity) => {
                    // It tells the constants of a right device.
                    if let Some(constants) = &mut identity.constants
                        && !self.how.wrong.is_frank()
                    {
                        constants.ramp_s = self.told.ramp_s;
                        constants.slew_n_s = self.told.slew_n_s;
                        constants.damping_n_s_per_mm = self.told.damping_n_s_per_mm;
                        constants.acceleration_hz = self.told.acceleration_hz;
                    }
                    Reply::Identity(identity)
                }
                other => other,
            };
            sent.extend_from_slice(reply.frame(sequence).as_bytes());
        }
        sent
    }

    /// Whether a message of telemetry is lost, as the device means it to be.
    fn is_unheard(&self, telemetry: &Telemetry) -> bool {
        let message = telemetry.first / 10;
        match self.wrong() {
            Some(Wrong::HiddenInGaps) => message % 20 == 10,
            Some(Wrong::Unheard20) => message % 20 < 4,
            Some(Wrong::Unheard45) => message % 9 < 4,
            Some(Wrong::Unheard75) => message % 4 < 3,
            _ => false,
        }
    }

    fn telemetry(&mut self, telemetry: Telemetry) -> Telemetry {
        let mut samples = FixedVec::new();
        for sample in telemetry.samples.as_slice() {
            samples.push(self.sample(*sample));
        }
        Telemetry {
            samples,
            ..telemetry
        }
    }

    fn sample(&mut self, sample: TelemetrySample) -> TelemetrySample {
        let Some(wrong) = self.wrong() else {
            return sample;
        };
        let hz = self.told.servo_hz;
        let t_s = f64::from(sample.tick) / hz;
        self.forces.push_back((sample.tick, sample.command_un));
        let ago = |forces: &VecDeque<(u32, i32)>, ms: f64| {
            let then = sample.tick.saturating_sub((ms * 1e-3 * hz) as u32);
            let before = forces.iter().rev().find(|(tick, _)| *tick <= then);
            before.map_or(0, |(_, force)| *force)
        };
        if self.forces.len() > 4096 {
            self.forces.pop_front();
        }
        let mut changed = sample;
        let newtons = f64::from(sample.command_un) * 1e-6;
        let command = |force_n: f64| (force_n * 1e6) as i32;
        match wrong {
            Wrong::Late => changed.command_un = ago(&self.forces, 20.0),
            Wrong::SlightlyLate => changed.command_un = ago(&self.forces, 11.0),
            Wrong::LateForwards if sample.v_um_s > 0 => {
                changed.command_un = ago(&self.forces, 12.0);
            }
            Wrong::LaterLate if t_s > 3.0 => changed.command_un = ago(&self.forces, 12.0),
            Wrong::NoClamp => changed.command_un = command(2.0 * newtons),
            Wrong::CoarseForce => changed.command_un = command((newtons / 2.0).round() * 2.0),
            Wrong::Noisy => {
                let up = ((t_s / 0.03) as u32).is_multiple_of(2);
                changed.command_un = command(newtons + if up { 1.0 } else { -1.0 });
            }
            Wrong::Fading => changed.command_un = command(newtons * (1.0 - t_s / 6.0).max(0.0)),
            Wrong::Hot if t_s > 3.0 => changed.command_un = command(0.7 * newtons),
            Wrong::Warm if t_s > 3.0 => changed.command_un = command(0.85 * newtons),
            Wrong::Friction => {
                let side = f64::from(sample.v_um_s.signum());
                changed.command_un = command(newtons + 0.3 * side);
            }
            Wrong::Overflow if newtons.abs() > 4.0 => {
                changed.command_un = command(newtons - 8.0 * newtons.signum());
            }
            Wrong::Unsigned => changed.command_un = sample.command_un.saturating_abs(),
            Wrong::OneSidedLimit => changed.command_un = command(newtons.min(2.0)),
            Wrong::DeadBand if newtons.abs() < 0.7 => changed.command_un = 0,
            Wrong::Cogging => {
                let turn = f64::from(sample.x_nm) * 1e-6 / 3.0;
                let more_n = 0.8 * (turn * std::f64::consts::TAU).sin();
                changed.command_un = command(newtons + more_n);
            }
            Wrong::Dropouts if t_s.fract() > 0.9 => changed.command_un = 0,
            Wrong::Sticking if (t_s % 0.5) > 0.35 => {
                changed.command_un = self.held.map_or(0, |held| held.command_un);
            }
            Wrong::Stale => {
                if let Some(held) = self.held
                    && !(sample.tick / 4).is_multiple_of(10)
                {
                    changed = TelemetrySample {
                        tick: sample.tick,
                        ..held
                    };
                }
            }
            Wrong::SlowClock => changed.tick = (0.8 * f64::from(sample.tick)) as u32,
            Wrong::FastClock => changed.tick = (1.25 * f64::from(sample.tick)) as u32,
            Wrong::Hums => changed.command_un = command(newtons + hum_n(t_s)),
            Wrong::Ticks => changed.command_un = command(newtons + tick_n(t_s)),
            Wrong::FoldsBack | Wrong::RestsHigh => {
                let rests = sample.v_um_s.abs() < 5000;
                let since_s = *self.rests_s.get_or_insert(t_s);
                self.rests_s = self.rests_s.filter(|_| rests);
                let left = (1.0 - (t_s - since_s) / 0.3 * 0.8).max(0.2);
                changed.command_un = match (rests, wrong) {
                    (false, _) => sample.command_un,
                    (true, Wrong::FoldsBack) => command(left * newtons),
                    (true, _) => command(newtons + 1.5),
                };
            }
            Wrong::Jitters => {
                let ms = f64::from(crc32(&(sample.tick / 20).to_le_bytes()) % 40);
                changed.command_un = ago(&self.forces, ms);
            }
            // After the message that is lost.
            Wrong::HiddenInGaps if (110..170).contains(&(sample.tick / 4 % 200)) => {
                changed.command_un = 0;
            }
            // The reported motion is the true one.
            Wrong::SpeedHalfInside => changed.v_um_s = sample.v_um_s.saturating_mul(2),
            Wrong::SpeedLate
            | Wrong::SpeedClipped
            | Wrong::DirectionLate
            | Wrong::PositionLate
            | Wrong::EncoderScale
            | Wrong::PositionCoarse => {
                let since = self.periods.saturating_sub(sample.tick as usize);
                let at = self.motions.len().checked_sub(since);
                if let Some(then) = at.and_then(|at| self.motions.get(at)) {
                    changed.x_nm = (then.x_mm * 1e6) as i32;
                    changed.v_um_s = (then.v_mm_s * 1e3) as i32;
                }
            }
            _ => {}
        }
        let v_mm_s = f64::from(sample.v_um_s) * 1e-3;
        let measured_n = self.felt.measured_n(wrong, t_s, v_mm_s, newtons);
        changed.measured_un = measured_n.map(command).or(changed.measured_un);
        self.held = Some(changed);
        changed
    }
}

fn decoded(raw: &[u8]) -> Option<Vec<u8>> {
    let mut decoder = Decoder::new();
    for byte in raw {
        decoder.push(*byte);
    }
    decoder.push(0)?.ok().map(<[u8]>::to_vec)
}
