//! The simulated mechanics: a handle with its sensors, and a hand or a probe.

use super::free::{Bearing, Free, Place};
use super::{Drive, Measured, Options, STROKE_MM};
use study_base::rng::Stream;
use study_haptics::plant::{DT_S, Hand, HandParameters, Parameters, Probe, Target};
use study_wire::estimate::Estimator;
use study_wire::predict::Motion;

/// Corner frequency of the one-pole low-pass of the speed, Hz.
const SPEED_HZ: f64 = 200.0;
/// Time from the end of a playback to the release of the handle, s.
const RELEASE_S: f64 = 0.3;
/// Speed of somebody who brings the handle to a place, mm/s.
const GUIDED_MM_S: f64 = 40.0;
/// A shorter range is no realization, mm, and half of the stroke of a hand in it, mm.
const SHORTEST_MM: f64 = 1.5;
const LEAST_STROKE_MM: f64 = 14.0;
/// Initial position of the handle, mm.
const MIDDLE_MM: f64 = 17.5;

#[derive(Debug)]
pub(super) struct Body {
    seed: u64,
    hand: HandParameters,
    target: Parameters,
    /// Resolution and noise of the sensors.
    probe: Probe,
    servo_hz: f64,
    sensor: Sensor,
    /// Force of the motor, N.
    force_n: f64,
    holder: Holder,
    bearing: Bearing,
}

/// What moves the handle.
#[derive(Debug)]
enum Holder {
    /// Nothing; the handle rests.
    Nobody { x_mm: f64 },
    /// A hand; after the end of the playback `left` is the number of servo periods until
    /// it releases the handle.
    Hand { hand: Box<Hand>, left: Option<u32> },
    /// Somebody who brings the handle to a place and holds it there.
    Guided { motion: Motion, to_mm: f64 },
    /// Nobody, and the handle moves as it is pushed, also without a playback.
    Free(Box<Free>),
    /// A probe on its path.
    Probe(Box<ProbeContact>),
}

/// The target under the probe.
#[derive(Debug)]
struct ProbeContact {
    /// `None` if the parameters are invalid.
    target: Option<Target>,
    motion: Motion,
    /// Commanded motion for the next period.
    next: Option<Motion>,
    force_n: f64,
    /// Largest force of the motor, N.
    max_n: f64,
    noise: [Stream; 2],
    /// Simulation steps that are due, including a fraction.
    due: f64,
}

impl Body {
    pub(super) fn new(options: &Options) -> Self {
        let probe = Probe {
            encoder_mm: options.encoder_mm,
            ..Probe::default()
        };
        Self {
            seed: options.seed,
            hand: options.hand,
            target: options.target.clone(),
            servo_hz: options.servo_hz,
            sensor: Sensor::new(MIDDLE_MM, &probe, options.servo_hz),
            probe,
            force_n: 0.0,
            holder: Holder::Nobody { x_mm: MIDDLE_MM },
            bearing: Bearing {
                mass_kg: options.hand.slider_kg,
                damping_n_s_per_mm: options.hand.bearing_n_s_per_mm,
                friction_n: options.friction_n,
                stops_mm: STROKE_MM,
            },
        }
    }

    /// See [`Firmware::let_go`](super::Firmware::let_go).
    pub(super) fn let_go(&mut self) {
        let x_mm = self.motion().x_mm;
        self.holder = Holder::Free(Box::new(Free::new(self.bearing, x_mm)));
    }

    /// See [`Firmware::pull`](super::Firmware::pull).
    pub(super) fn pull(&mut self, force_n: f64) {
        if !matches!(self.holder, Holder::Free(_)) {
            self.let_go();
        }
        if let Holder::Free(free) = &mut self.holder {
            free.pull(force_n);
        }
    }

    /// Where the handle is.
    pub(super) fn place(&self) -> Place {
        match &self.holder {
            Holder::Free(free) => free.place(self.force_n),
            _ => Free::new(self.bearing, self.motion().x_mm).place(self.force_n),
        }
    }

    /// See [`Firmware::hold_at`](super::Firmware::hold_at).
    pub(super) fn hold_at(&mut self, x_mm: f64) {
        let motion = match &self.holder {
            Holder::Guided { motion, .. } => *motion,
            _ => Motion::at_rest(self.motion().x_mm),
        };
        self.holder = Holder::Guided {
            motion,
            to_mm: x_mm,
        };
    }

    pub(super) fn force_n(&self) -> f64 {
        self.force_n
    }

    /// Whether a hand or a probe moves the handle.
    pub(super) fn moving(&self) -> bool {
        match &self.holder {
            Holder::Nobody { .. } => false,
            Holder::Free(free) => free.moving(),
            Holder::Guided { motion, to_mm } => motion.x_mm != *to_mm,
            _ => true,
        }
    }

    /// Whether a hand or a probe holds the handle for the current playback.
    pub(super) fn is_held(&self) -> bool {
        match &self.holder {
            Holder::Nobody { .. } => false,
            Holder::Hand { left, .. } => left.is_none(),
            Holder::Guided { .. } | Holder::Free(_) | Holder::Probe(_) => true,
        }
    }

    /// A hand takes the handle for a table with the range `range_mm`, or a probe if it is
    /// `None`. The number of the upload selects the random stream.
    pub(super) fn take(&mut self, range_mm: Option<[f64; 2]>, upload: u32) {
        let upload = upload.to_string();
        let stream = |name| Stream::new(self.seed, &["device", name, &upload]);
        self.holder = match range_mm {
            Some([low, high]) => {
                let hand = Hand::new(self.hand, ends(low, high), stream("hand"));
                Holder::Hand {
                    hand: Box::new(hand),
                    left: None,
                }
            }
            None => {
                let x_mm = self.motion().x_mm;
                Holder::Probe(Box::new(ProbeContact {
                    target: Target::new(self.target.clone(), x_mm).ok(),
                    motion: Motion::at_rest(x_mm),
                    next: None,
                    force_n: 0.0,
                    max_n: 0.0,
                    noise: ["force", "acceleration"].map(stream),
                    due: 0.0,
                }))
            }
        };
        self.sensor = Sensor::new(self.motion().x_mm, &self.probe, self.servo_hz);
    }

    /// Sets the force to zero; the hand releases the handle later.
    pub(super) fn release(&mut self) {
        self.force_n = 0.0;
        match &mut self.holder {
            Holder::Nobody { .. } | Holder::Free(_) | Holder::Guided { .. } => {}
            Holder::Hand { left, .. } => {
                left.get_or_insert((RELEASE_S * self.servo_hz) as u32);
            }
            Holder::Probe(contact) => {
                let x_mm = contact.motion.x_mm;
                self.rest(x_mm);
            }
        }
    }

    fn rest(&mut self, x_mm: f64) {
        self.holder = Holder::Nobody { x_mm };
        self.sensor = Sensor::new(x_mm, &self.probe, self.servo_hz);
    }

    fn motion(&self) -> Motion {
        match &self.holder {
            Holder::Nobody { x_mm } => Motion::at_rest(*x_mm),
            Holder::Hand { hand, .. } => hand.motion(),
            Holder::Guided { motion, .. } => *motion,
            Holder::Free(free) => free.motion,
            Holder::Probe(contact) => contact.motion,
        }
    }

    /// Reads the sensors.
    pub(super) fn measure(&mut self) -> Measured {
        let mut motion = self.sensor.read(self.motion());
        let mut force_n = None;
        if let Holder::Probe(contact) = &mut self.holder {
            let [force, acceleration] = &mut contact.noise;
            force_n = Some(contact.force_n + self.probe.force_noise_n * force.normal());
            motion.a_m_s2 += self.probe.acceleration_noise_m_s2 * acceleration.normal();
        }
        Measured { motion, force_n }
    }

    /// Applies a motor command.
    pub(super) fn drive(&mut self, drive: Drive) {
        match drive {
            Drive::Force(force_n) => self.force_n = force_n,
            Drive::Position {
                x_mm,
                v_mm_s,
                force_n,
            } => {
                if let Holder::Probe(contact) = &mut self.holder {
                    self.force_n = contact.force_n;
                    contact.max_n = force_n;
                    contact.next = Some(Motion {
                        x_mm,
                        v_mm_s,
                        a_m_s2: (v_mm_s - contact.motion.v_mm_s) * self.servo_hz * 1e-3,
                    });
                }
            }
        }
    }

    /// Simulates one servo period.
    pub(super) fn pass(&mut self) {
        let period_s = 1.0 / self.servo_hz;
        match &mut self.holder {
            Holder::Nobody { .. } => {}
            Holder::Hand { hand, left } => {
                hand.step(self.force_n, period_s);
                match left {
                    None => {}
                    Some(0) => {
                        let x_mm = hand.motion().x_mm;
                        self.rest(x_mm);
                    }
                    Some(left) => *left -= 1,
                }
            }
            Holder::Guided { motion, to_mm } => {
                let most_mm = GUIDED_MM_S * period_s;
                let step_mm = (*to_mm - motion.x_mm).clamp(-most_mm, most_mm);
                *motion = Motion {
                    x_mm: motion.x_mm + step_mm,
                    v_mm_s: step_mm / period_s,
                    a_m_s2: 0.0,
                };
            }
            Holder::Free(free) => free.step(self.force_n, period_s),
            Holder::Probe(contact) => contact.pass(period_s),
        }
    }
}

/// Between which places a hand moves the handle in this range, mm. It leaves a range that is
/// shorter than a finger moves.
fn ends(low: f64, high: f64) -> [f64; 2] {
    let margin = (0.1 * (high - low)).min(1.5);
    if high - low > SHORTEST_MM {
        return [low + margin, high - margin];
    }
    let middle = 0.5 * (low + high);
    [middle - LEAST_STROKE_MM, middle + LEAST_STROKE_MM]
}

impl ProbeContact {
    /// Moves the ideal probe to the commanded position. At its force limit it stays where
    /// it is, and the handler detects the deviation from the path.
    fn pass(&mut self, period_s: f64) {
        let Some(next) = self.next.take() else {
            return;
        };
        let from = self.motion;
        self.due += period_s / DT_S + 1e-9;
        let steps = self.due as u32;
        self.due -= f64::from(steps);
        for step in 1..=steps {
            let fraction = f64::from(step) / f64::from(steps);
            let between = |from: f64, to: f64| from + fraction * (to - from);
            let at = Motion {
                x_mm: between(from.x_mm, next.x_mm),
                v_mm_s: between(from.v_mm_s, next.v_mm_s),
                a_m_s2: next.a_m_s2,
            };
            if let Some(target) = &mut self.target {
                self.force_n = target.step(at);
            }
        }
        if self.force_n.abs() <= self.max_n {
            self.motion = next;
        } else {
            self.force_n = self.force_n.clamp(-self.max_n, self.max_n);
            self.motion = Motion::at_rest(from.x_mm);
        }
    }
}

/// Encoder, speed from position differences, and accelerometer.
#[derive(Debug)]
struct Sensor {
    encoder_mm: f64,
    estimator: Estimator,
}

impl Sensor {
    fn new(x_mm: f64, probe: &Probe, servo_hz: f64) -> Self {
        let mut sensor = Self {
            encoder_mm: probe.encoder_mm,
            estimator: Estimator::new(SPEED_HZ, servo_hz),
        };
        sensor.read(Motion::at_rest(x_mm));
        sensor
    }

    fn read(&mut self, motion: Motion) -> Motion {
        let x_mm = (motion.x_mm / self.encoder_mm).round() * self.encoder_mm;
        Motion {
            a_m_s2: motion.a_m_s2,
            ..self.estimator.step(x_mm)
        }
    }
}
