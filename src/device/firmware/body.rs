//! What a simulated device is mounted to: a handle, its sensors, a hand or a probe.

use super::{Drive, Measured, Options};
use study_base::rng::Stream;
use study_haptics::plant::{DT_S, Hand, HandParameters, Parameters, Probe, Target};
use study_wire::predict::Motion;

/// Corner of the one-pole low-pass that the speed is taken through, Hz.
const SPEED_HZ: f64 = 200.0;
/// A hand lets go so long after the end of a playback, s.
const LETS_GO_S: f64 = 0.3;
/// Where the handle is before anybody has moved it, mm.
const MIDDLE_MM: f64 = 17.5;

#[derive(Debug)]
pub(super) struct Body {
    seed: u64,
    hand: HandParameters,
    target: Parameters,
    /// Encoder, noise of the probe's sensors.
    probe: Probe,
    servo_hz: f64,
    sensor: Sensor,
    /// On the motor, N.
    force_n: f64,
    holder: Holder,
}

/// What moves the handle.
#[derive(Debug)]
enum Holder {
    /// It rests there.
    Nobody { x_mm: f64 },
    /// A hand; after the end of the playback for so many servo periods more.
    Hand { hand: Box<Hand>, left: Option<u32> },
    /// A probe on its path.
    Probe(Box<Moved>),
}

/// The target under the probe.
#[derive(Debug)]
struct Moved {
    /// No target if the parameters describe none.
    target: Option<Target>,
    motion: Motion,
    /// Where it is told to be next.
    next: Option<Motion>,
    force_n: f64,
    /// The most that the motor may give, N.
    most_n: f64,
    noise: [Stream; 2],
    /// Steps of the simulation that are due, with the fraction left over.
    due: f64,
}

impl Body {
    pub(super) fn new(options: &Options) -> Self {
        let probe = Probe::default();
        Self {
            seed: options.seed,
            hand: options.hand,
            target: options.target.clone(),
            servo_hz: options.servo_hz,
            sensor: Sensor::new(MIDDLE_MM, &probe, options.servo_hz),
            probe,
            force_n: 0.0,
            holder: Holder::Nobody { x_mm: MIDDLE_MM },
        }
    }

    pub(super) fn force_n(&self) -> f64 {
        self.force_n
    }

    /// Whether somebody moves the handle.
    pub(super) fn moving(&self) -> bool {
        !matches!(self.holder, Holder::Nobody { .. })
    }

    /// Whether somebody does for what is played now.
    pub(super) fn taken(&self) -> bool {
        match &self.holder {
            Holder::Nobody { .. } => false,
            Holder::Hand { left, .. } => left.is_none(),
            Holder::Probe(_) => true,
        }
    }

    /// A hand takes the handle to play over `range_mm`, or a probe without one.
    /// `upload` gives each table a hand of its own.
    pub(super) fn take(&mut self, range_mm: Option<[f64; 2]>, upload: u32) {
        let upload = upload.to_string();
        let stream = |name| Stream::new(self.seed, &["device", name, &upload]);
        self.holder = match range_mm {
            Some([low, high]) => {
                let margin = (0.1 * (high - low)).min(1.5);
                let hand = Hand::new(self.hand, [low + margin, high - margin], stream("hand"));
                Holder::Hand {
                    hand: Box::new(hand),
                    left: None,
                }
            }
            None => {
                let x_mm = self.motion().x_mm;
                Holder::Probe(Box::new(Moved {
                    target: Target::new(self.target.clone(), x_mm).ok(),
                    motion: still(x_mm),
                    next: None,
                    force_n: 0.0,
                    most_n: 0.0,
                    noise: ["force", "acceleration"].map(stream),
                    due: 0.0,
                }))
            }
        };
        self.sensor = Sensor::new(self.motion().x_mm, &self.probe, self.servo_hz);
    }

    /// Zero force.
    pub(super) fn release(&mut self) {
        self.force_n = 0.0;
        match &mut self.holder {
            Holder::Nobody { .. } => {}
            Holder::Hand { left, .. } => {
                left.get_or_insert((LETS_GO_S * self.servo_hz) as u32);
            }
            Holder::Probe(moved) => {
                let x_mm = moved.motion.x_mm;
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
            Holder::Nobody { x_mm } => still(*x_mm),
            Holder::Hand { hand, .. } => hand.motion(),
            Holder::Probe(moved) => moved.motion,
        }
    }

    /// What the sensors say.
    pub(super) fn measure(&mut self) -> Measured {
        let mut motion = self.sensor.read(self.motion());
        let mut force_n = None;
        if let Holder::Probe(moved) = &mut self.holder {
            let [force, acceleration] = &mut moved.noise;
            force_n = Some(moved.force_n + self.probe.force_noise_n * force.normal());
            motion.a_m_s2 += self.probe.acceleration_noise_m_s2 * acceleration.normal();
        }
        Measured { motion, force_n }
    }

    /// What the motor does from now on.
    pub(super) fn drive(&mut self, drive: Drive) {
        match drive {
            Drive::Force(force_n) => self.force_n = force_n,
            Drive::Position {
                x_mm,
                v_mm_s,
                force_n,
            } => {
                if let Holder::Probe(moved) = &mut self.holder {
                    self.force_n = moved.force_n;
                    moved.most_n = force_n;
                    moved.next = Some(Motion {
                        x_mm,
                        v_mm_s,
                        a_m_s2: (v_mm_s - moved.motion.v_mm_s) * self.servo_hz * 1e-3,
                    });
                }
            }
        }
    }

    /// Lets a servo period pass.
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
            Holder::Probe(moved) => moved.pass(period_s),
        }
    }
}

impl Moved {
    /// The probe is where it was told to be: it is ideal, up to its force limit.
    /// There it stays where it is, and the handler will miss it on its path.
    fn pass(&mut self, period_s: f64) {
        let Some(next) = self.next.take() else {
            return;
        };
        let from = self.motion;
        self.due += period_s / DT_S + 1e-9;
        let steps = self.due as u32;
        self.due -= f64::from(steps);
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let between = |from: f64, to: f64| from + share * (to - from);
            let at = Motion {
                x_mm: between(from.x_mm, next.x_mm),
                v_mm_s: between(from.v_mm_s, next.v_mm_s),
                a_m_s2: next.a_m_s2,
            };
            if let Some(target) = &mut self.target {
                self.force_n = target.step(at);
            }
        }
        if self.force_n.abs() <= self.most_n {
            self.motion = next;
        } else {
            self.force_n = self.force_n.clamp(-self.most_n, self.most_n);
            self.motion = still(from.x_mm);
        }
    }
}

fn still(x_mm: f64) -> Motion {
    Motion {
        x_mm,
        v_mm_s: 0.0,
        a_m_s2: 0.0,
    }
}

/// Encoder, speed from its differences, accelerometer.
#[derive(Debug)]
struct Sensor {
    encoder_mm: f64,
    x_mm: f64,
    v_mm_s: f64,
    servo_hz: f64,
    /// Of the one-pole low-pass, a period.
    share: f64,
}

impl Sensor {
    fn new(x_mm: f64, probe: &Probe, servo_hz: f64) -> Self {
        let mut sensor = Self {
            encoder_mm: probe.encoder_mm,
            x_mm: 0.0,
            v_mm_s: 0.0,
            servo_hz,
            share: 1.0 - libm::exp(-std::f64::consts::TAU * SPEED_HZ / servo_hz),
        };
        sensor.x_mm = sensor.quantised(x_mm);
        sensor
    }

    fn read(&mut self, motion: Motion) -> Motion {
        let x_mm = self.quantised(motion.x_mm);
        let difference = (x_mm - self.x_mm) * self.servo_hz;
        self.v_mm_s += self.share * (difference - self.v_mm_s);
        self.x_mm = x_mm;
        Motion {
            x_mm,
            v_mm_s: self.v_mm_s,
            a_m_s2: motion.a_m_s2,
        }
    }

    fn quantised(&self, x_mm: f64) -> f64 {
        (x_mm / self.encoder_mm).round() * self.encoder_mm
    }
}
