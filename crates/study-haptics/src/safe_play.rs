//! Safe play: what an adversary makes of a realization on a device, beside its certificate.
//!
//! The certificate is about energy and takes the parameters as they are. This search plays a
//! realization through the servo of a device ([`study_wire::servo`]: ramp, slew limit, clamp,
//! period) behind an encoder with steps, over the whole range and up to twice the trained
//! speed, and looks for dangers:
//!
//! * **Force**: at rest after a fast stroke, at an edge or elsewhere, a force that the
//!   realization has in no slow motion: the stroke took it where no data were.
//! * **Latching**: on the way back from there, another force than after a slow stroke.
//! * **Reversals**: friction by the sign of the speed draws energy at every reversal. It is refused
//!   where the damping of the device does not confine that to speeds below its velocity limit.
//! * **Energy**: chatter around one position, and strokes back and forth, that draw energy
//!   without end, beyond what the device's own damping takes.
//!
//! All thresholds are in proportion to the forces of the realization, with floors that are
//! those of the device. The search is deterministic.

mod danger;

use crate::model::Realization;
pub use danger::Danger;
use std::f64::consts::TAU;
use study_wire::certificate::reversal::{Renderer, Reversal};
use study_wire::certificate::{Certificate, spring_damping_n_s_per_m};
use study_wire::elements::Spring;
use study_wire::mechanism::FASTER_THAN_TRAINED;
use study_wire::predict::{Direction, Motion};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings};

/// Speeds of the strokes, as shares of the highest.
const SPEEDS: [f64; 5] = [0.3, 0.5, 0.65, 0.8, 1.0];
/// Speed of a slow stroke as a share of the trained one.
const SLOW: f64 = 0.15;
/// The longest slow stroke over the range, s: a force curve is trained at a thousandth of the
/// speed of a hand.
const SLOWEST_S: f64 = 4.0;
/// The speed of a hand, mm/s, which a realization that was trained more slowly meets as well.
const HAND_MM_S: f64 = 200.0;
/// Rest after a fast stroke, s.
const REST_S: f64 = 0.25;
/// The same in times in which a force relaxes.
const RELAXATIONS: f64 = 5.0;
/// A force at rest above that of slow motion by this share of it is none of the realization.
const EXCESS: f64 = 0.25;
/// A force on the way back that differs by this share of the range of forces is another one.
const APART: f64 = 0.25;
/// It stays so over this share of the range.
const STAYS: f64 = 0.02;
/// Positions at which a hand chatters, over the range.
const PLACES: usize = 5;
/// Reversals of a chatter per second: a hand and a handle together.
const REVERSALS_HZ: [f64; 3] = [130.0, 200.0, 320.0];
/// Strokes of a chatter, in steps of the encoder.
const STEPS: [f64; 3] = [0.7, 2.0, 10.0];
/// The power that a chatter may draw: what a hand with 20 N·s/m takes at 2 mm/s, W.
pub const MOST_W: f64 = 1e-4;
/// Energy that strokes back and forth may draw in a cycle, as a share of the range of forces
/// times the range of positions.
const MOST_CYCLE: f64 = 0.01;

/// The device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Device {
    /// Its servo, with the force limit.
    pub servo: ServoSettings,
    /// Step of its encoder, mm.
    pub encoder_mm: f64,
    /// Largest stiffness that it renders, N/mm: its own damping is that which this takes.
    pub stiffness_n_per_mm: f64,
    /// Coulomb friction of its own, N.
    pub friction_n: f64,
}

impl Default for Device {
    /// 4 kHz, 12 N, 5 µm and 100 N/mm without friction, as the simulated device.
    fn default() -> Self {
        Self {
            servo: ServoSettings::new(),
            encoder_mm: 0.005,
            stiffness_n_per_mm: 100.0,
            friction_n: 0.0,
        }
    }
}

/// A hand that moves as it likes on a device that plays.
#[derive(Clone)]
struct Play<'a> {
    what: &'a Rendering<'a>,
    device: Device,
    servo: Servo,
    /// The device's own damping, N·s/mm.
    damping_n_s_per_mm: f64,
    x_mm: f64,
    /// What the device measures.
    measured: Motion,
    force_n: f64,
    /// Energy that the hand and the damping of the device have put in, mJ.
    energy_mj: f64,
}

impl<'a> Play<'a> {
    fn new(what: &'a Rendering<'a>, device: Device, damping: f64, x_mm: f64) -> Self {
        let mut servo = Servo::new(ServoSettings {
            // the hand may be as fast as it likes
            velocity_mm_s: f64::MAX,
            jump_mm: f64::MAX,
            ..device.servo
        });
        servo.start();
        let mut play = Self {
            what,
            device,
            servo,
            damping_n_s_per_mm: damping,
            x_mm,
            measured: Motion::at_rest(x_mm),
            force_n: 0.0,
            energy_mj: 0.0,
        };
        play.rest(device.servo.ramp_s);
        play
    }

    /// One servo period, in which the handle moves to a position.
    fn to(&mut self, x_mm: f64) {
        let hz = self.device.servo.servo_hz;
        let moved_mm = x_mm - self.x_mm;
        self.energy_mj += (self.force_n + self.damping_n_s_per_mm * moved_mm * hz) * moved_mm
            + self.device.friction_n * moved_mm.abs();
        self.x_mm = x_mm;
        let step = self.device.encoder_mm;
        let counted_mm = (x_mm / step).round() * step;
        // a difference through a low-pass with one pole of 200 Hz, and one of such speeds
        let share = 1.0 - (-TAU * 200.0 / hz).exp();
        let before = self.measured;
        let v_mm_s = before.v_mm_s + share * ((counted_mm - before.x_mm) * hz - before.v_mm_s);
        self.measured = Motion {
            x_mm: counted_mm,
            v_mm_s,
            a_m_s2: 1e-3 * (v_mm_s - before.v_mm_s) * hz,
        };
        self.force_n = self.servo.step(self.what, self.measured);
    }

    fn rest(&mut self, time_s: f64) {
        for _ in 0..(time_s * self.device.servo.servo_hz) as usize {
            self.to(self.x_mm);
        }
    }

    /// A straight stroke; `visit` sees position and force of each period.
    fn stroke(&mut self, to_mm: f64, mm_s: f64, mut visit: impl FnMut(f64, f64)) {
        let (from, hz) = (self.x_mm, self.device.servo.servo_hz);
        let steps = ((to_mm - from).abs() / mm_s * hz).ceil().max(1.0);
        for step in 1..=steps as usize {
            self.to(from + (to_mm - from) * step as f64 / steps);
            visit(self.x_mm, self.force_n);
        }
    }
}

/// Searches for dangers of a realization in mm and N. Empty if it found none.
pub fn search(realization: &Realization, device: &Device) -> Vec<Danger> {
    with(realization, device, |search, slow| {
        search.strokes(slow);
        search.chatter();
        search.cycles(slow);
    })
}

/// The dangers for which a realization is refused: friction by the sign of the speed that the
/// damping of the device does not confine, and a mechanism whose state a stroke takes where no
/// data were. A table has no such state, and that of elements is at most 1. Takes a tenth of the whole search.
pub fn refusal(realization: &Realization, device: &Device) -> Option<Danger> {
    let trips_mm_s = device.servo.velocity_mm_s;
    if let Some(found) = reversal(realization, device).filter(|r| r.up_to_mm_s > trips_mm_s) {
        return Some(Danger::Reversal {
            most_j: 1e-3 * found.most_mj,
            up_to_mm_s: found.up_to_mm_s,
            trips_mm_s,
        });
    }
    realization.mechanism.as_ref()?;
    let found = with(realization, device, |search, slow| search.strokes(slow));
    found.first().copied()
}

/// What friction by the sign of the speed gives a hand at each reversal; `None` if the realization
/// has none, or is too stiff for the device, which then refuses it.
pub fn reversal(realization: &Realization, device: &Device) -> Option<Reversal> {
    if realization.direction != Direction::Sign || realization.mechanism.is_some() {
        return None;
    }
    let certificate = realization.certificate();
    let servo = &device.servo;
    let left = device.stiffness_n_per_mm - certificate.rendered_n_per_mm();
    let renderer = Renderer {
        servo_hz: servo.servo_hz,
        encoder_mm: device.encoder_mm,
        slew_n_s: servo.slew_n_s,
        damping_n_s_per_mm: 1e-3 * spring_damping_n_s_per_m(left, servo.servo_hz, 0.0),
    };
    renderer.reversal(certificate.gap_n)
}

/// Chatter that draws energy: what friction by the sign of the speed does on any device,
/// because the force turns a servo period and the slew limit later than the hand.
pub fn chatter(realization: &Realization, device: &Device) -> Option<Danger> {
    let found = with(realization, device, |search, _| search.chatter());
    found.first().copied()
}

fn with(
    realization: &Realization,
    device: &Device,
    look: impl FnOnce(&mut Search<'_>, &Slow),
) -> Vec<Danger> {
    let what = rendering(realization);
    let damping = own_damping(&realization.certificate(), device);
    let mut search = Search {
        what: &what,
        device: *device,
        damping,
        found: Vec::new(),
    };
    let slow = search.slow();
    look(&mut search, &slow);
    search.found
}

/// A realization as a servo plays it.
fn rendering(realization: &Realization) -> Rendering<'_> {
    Rendering {
        law: match (&realization.mechanism, &realization.elements) {
            (Some(own), _) => Law::Mechanism(own.view()),
            (None, Some(own)) => Law::Elements(own.view()),
            (None, None) => Law::Table {
                table: realization.table(),
                rule: realization.direction,
            },
        },
        range_mm: realization.trained.x_mm,
        trained_mm_s: realization.trained.v_mm_s,
    }
}

/// The damping of a device, N·s/mm: one that renders the realization has what that asks for.
fn own_damping(certificate: &Certificate, device: &Device) -> f64 {
    let of = |n_per_mm: f64| 1e-3 * spring_damping_n_s_per_m(n_per_mm, device.servo.servo_hz, 0.0);
    let asked = of(certificate.rendered_n_per_mm()) + certificate.damping_n_s_per_mm;
    let own = of(device.stiffness_n_per_mm);
    if asked.is_finite() {
        own.max(asked)
    } else {
        own
    }
}

struct Search<'a> {
    what: &'a Rendering<'a>,
    device: Device,
    damping: f64,
    found: Vec<Danger>,
}

/// The forces of slow motion.
struct Slow {
    most_n: f64,
    range_n: f64,
    /// Force by bin of position on the way up and down, N.
    by_place: [Vec<f64>; 2],
}

impl Slow {
    /// Largest force around a bin in either direction, N.
    fn near_n(&self, bin: usize) -> f64 {
        let around = bin.saturating_sub(2)..(bin + 3).min(BINS);
        let all = self.by_place.iter().flat_map(|way| &way[around.clone()]);
        all.fold(0.0, |most, n| most.max(n.abs()))
    }
}

/// Bins of position over the range.
const BINS: usize = 200;
/// As many of the highest and lowest forces are not those of slow motion.
const SNAPS: usize = 6;

impl<'a> Search<'a> {
    fn play(&self, x_mm: f64) -> Play<'a> {
        Play::new(self.what, self.device, self.damping, x_mm)
    }

    fn bin(&self, x_mm: f64) -> usize {
        let [low, high] = self.what.range_mm;
        (((x_mm - low) / (high - low) * BINS as f64) as usize).min(BINS - 1)
    }

    fn slow_mm_s(&self) -> f64 {
        let [low, high] = self.what.range_mm;
        (SLOW * self.what.trained_mm_s).max((high - low) / SLOWEST_S)
    }

    fn fast_mm_s(&self) -> f64 {
        (FASTER_THAN_TRAINED * self.what.trained_mm_s).max(HAND_MM_S)
    }

    /// From the middle up, down and up again in slow motion.
    fn slow(&self) -> Slow {
        let [low, high] = self.what.range_mm;
        let mut play = self.play(0.5 * (low + high));
        let mm_s = self.slow_mm_s();
        play.stroke(high, mm_s, |_, _| ());
        let mut by_place = [vec![0.0; BINS], vec![0.0; BINS]];
        for (to_mm, way) in [(low, 1), (high, 0)] {
            play.stroke(to_mm, mm_s, |x_mm, force_n| {
                by_place[way][self.bin(x_mm)] = force_n;
            });
        }
        let mut forces: Vec<f64> = by_place.concat();
        forces.sort_by(f64::total_cmp);
        // a follower that snaps over a crest is felt in a bin or two
        let (least, most) = (forces[SNAPS], forces[2 * BINS - 1 - SNAPS]);
        let floor = 1e-3 * self.device.servo.force_n;
        Slow {
            most_n: most.max(-least).max(floor),
            range_n: (most - least).max(floor),
            by_place,
        }
    }

    /// The motion after which a realization has forgotten how it came there, mm.
    fn memory_mm(&self, slow: &Slow) -> f64 {
        match &self.what.law {
            Law::Table { rule, .. } => 3.0 * rule.delta_mm().unwrap_or(0.0),
            Law::Mechanism(view) => {
                let own = view.scalars;
                // what slow motion deflects the contact, to either side
                let deflected_mm = 2.0 * slow.most_n / own.contact_n_per_mm;
                own.gap_mm + 3.0 * own.slip_mm.max(own.handle_slip_mm) + deflected_mm
            }
            Law::Elements(view) => {
                let memories = view.springs.iter().map(|spring| match *spring {
                    Spring::Stop { slip_mm } | Spring::Maxwell { slip_mm, .. } => 2.0 * slip_mm,
                    Spring::Latch { rearm_mm, break_mm } => break_mm - rearm_mm,
                });
                memories.fold(0.0, f64::max)
            }
        }
    }

    /// The longest time in which a force at rest relaxes, s.
    fn relaxation_s(&self) -> f64 {
        let Law::Elements(view) = &self.what.law else {
            return 0.0;
        };
        let times = view.springs.iter().map(|spring| match *spring {
            Spring::Maxwell { relaxation_s, .. } => relaxation_s,
            Spring::Stop { .. } | Spring::Latch { .. } => 0.0,
        });
        times.fold(0.0, f64::max)
    }

    /// Fast strokes that end at an edge or at a place within, a rest, and slowly back.
    fn strokes(&mut self, slow: &Slow) {
        let [low, high] = self.what.range_mm;
        let at = |share: f64| low + share * (high - low);
        let top = self.fast_mm_s();
        let rest_s = REST_S.max(RELAXATIONS * self.relaxation_s());
        let (mut force, mut latched) = (None, None);
        for (from, to) in [(0.6, 0.0), (0.4, 1.0), (1.0, 0.35), (0.0, 0.65)] {
            let begun = self.play(at(from));
            for share in SPEEDS {
                let (by_mm_s, to_mm) = (share * top, at(to));
                let mut play = begun.clone();
                play.stroke(to_mm, by_mm_s, |_, _| ());
                play.rest(rest_s);
                let found_n = play.force_n;
                // where the stop of a key begins, slow motion has more than elsewhere
                let slow_n = slow.most_n.max(slow.near_n(self.bin(to_mm)));
                let excess = (found_n.abs() - slow_n) / slow_n;
                if excess > EXCESS && force.is_none_or(|(most, _)| excess > most) {
                    let danger = Danger::Force {
                        found_n,
                        slow_n,
                        at_mm: to_mm,
                        by_mm_s,
                    };
                    force = Some((excess, danger));
                }
                // back over half of the way
                let back = at(0.5 * (from + to));
                let way = usize::from(back < to_mm);
                let begin = self.memory_mm(slow);
                let (mut apart_n, mut since_mm, mut stays_mm) = (0.0_f64, to_mm, 0.0_f64);
                play.stroke(back, self.slow_mm_s(), |x_mm, force_n| {
                    let bin = self.bin(x_mm);
                    let around = bin.saturating_sub(2)..(bin + 3).min(BINS);
                    let near = &slow.by_place[way][around];
                    let here = near.iter().map(|n| (n - force_n).abs());
                    let here = here.fold(f64::INFINITY, f64::min);
                    // a snap that comes a little later is none
                    if (x_mm - to_mm).abs() < begin || here < APART * slow.range_n {
                        since_mm = x_mm;
                    } else if (x_mm - since_mm).abs() > stays_mm {
                        stays_mm = (x_mm - since_mm).abs();
                        apart_n = apart_n.max(here);
                    }
                });
                let is_worse = latched.is_none_or(|(most, _)| stays_mm > most);
                if stays_mm > STAYS * (high - low) && is_worse {
                    let danger = Danger::Latched {
                        apart_n,
                        stays_mm,
                        to_mm,
                        by_mm_s,
                    };
                    latched = Some((stays_mm, danger));
                }
            }
        }
        self.found.extend(
            [force, latched]
                .into_iter()
                .flatten()
                .map(|(_, danger)| danger),
        );
    }

    /// Reversals within a few steps of the encoder.
    fn chatter(&mut self) {
        let [low, high] = self.what.range_mm;
        let hz = self.device.servo.servo_hz;
        let step = self.device.encoder_mm;
        let mut worst: Option<(f64, Danger)> = None;
        for place in 0..PLACES {
            let share = (place as f64 + 0.5) / PLACES as f64;
            // around the place where the count changes
            let at_mm = ((low + share * (high - low)) / step).floor() * step + 0.5 * step;
            let mut play = self.play(at_mm);
            for reversals_hz in REVERSALS_HZ {
                for stroke in STEPS {
                    let periods = hz / reversals_hz;
                    let chatter = |play: &mut Play<'_>, reversals: usize| {
                        let begun = play.energy_mj;
                        let all = (periods * reversals as f64) as usize;
                        for i in 0..all {
                            let phase = (i as f64 / periods) % 2.0;
                            let way = 1.0 - (phase - 1.0).abs();
                            play.to(at_mm + (way - 0.5) * stroke * step);
                        }
                        (play.energy_mj - begun, all as f64 / hz)
                    };
                    chatter(&mut play, 10);
                    let (energy_mj, time_s) = chatter(&mut play, 20);
                    let power_w = -1e-3 * energy_mj / time_s;
                    if power_w > MOST_W && worst.is_none_or(|(most, _)| power_w > most) {
                        let danger = Danger::Chatter {
                            power_w,
                            at_mm,
                            reversals_hz,
                        };
                        worst = Some((power_w, danger));
                    }
                }
            }
        }
        self.found.extend(worst.map(|(_, danger)| danger));
    }

    /// Sines over the range and over parts of it, up to twice the trained speed.
    fn cycles(&mut self, slow: &Slow) {
        let [low, high] = self.what.range_mm;
        let hz = self.device.servo.servo_hz;
        let top = self.fast_mm_s();
        let most_mj = MOST_CYCLE * slow.range_n * (high - low);
        let mut worst: Option<(f64, Danger)> = None;
        for (middle, size) in [(0.5, 0.5), (0.25, 0.25), (0.75, 0.25), (0.5, 0.1)] {
            for share in [0.1, 0.5, 1.0] {
                let size_mm = size * (high - low);
                let middle_mm = low + middle * (high - low);
                let cycles_hz = share * top / (TAU * size_mm);
                let periods = (hz / cycles_hz) as usize;
                let mut play = self.play(middle_mm);
                let mut begun = 0.0;
                const CYCLES: usize = 3;
                for i in 0..CYCLES * periods {
                    if i == periods {
                        begun = play.energy_mj;
                    }
                    let phase = TAU * (i + 1) as f64 / periods as f64;
                    play.to(middle_mm + size_mm * phase.sin());
                }
                let energy_mj = (begun - play.energy_mj) / (CYCLES - 1) as f64;
                if energy_mj > most_mj && worst.is_none_or(|(most, _)| energy_mj > most) {
                    let danger = Danger::Cycle {
                        energy_j: 1e-3 * energy_mj,
                        cycles_hz,
                    };
                    worst = Some((energy_mj, danger));
                }
            }
        }
        self.found.extend(worst.map(|(_, danger)| danger));
    }
}

#[cfg(test)]
mod tests;
