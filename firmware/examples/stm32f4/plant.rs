//! A simulated handle with a hand, in place of encoder and motor: for an emulator.
//! Nothing of it is measured.

use super::registers::*;
use study_wire::estimate::Estimator;
use study_wire::predict::Motion;

pub(crate) const SERIAL: &str = "emulated-1";
pub(crate) const SIMULATED: bool = true;
/// TIM2 counts nanoseconds in the emulator.
pub(crate) const TICKS_PER_S: u32 = 1_000_000_000;
/// Mass of the handle, kg.
pub(crate) const HANDLE_KG: f64 = 0.25;

/// The hand: a spring and a damper to where it wants to be, N/mm and N·s/mm.
const GRIP_N_PER_MM: f32 = 1.0;
const GRIP_N_S_PER_MM: f32 = 0.02;
/// A shorter range is no realization, mm, and half of the stroke in it, mm.
const SHORTEST_MM: f32 = 1.5;
const LEAST_STROKE_MM: f32 = 14.0;
/// Strokes of the hand, Hz.
const STROKE_HZ: f32 = 0.7;
/// Resolution of the encoder, counts per mm.
const COUNTS_PER_MM: f32 = 1000.0;
/// Corner of the speed's low-pass, Hz.
const SPEED_HZ: f64 = 200.0;

pub(crate) struct Mechanics {
    estimator: Option<Estimator<f32>>,
    period_s: f32,
    x_mm: f32,
    v_mm_s: f32,
    force_n: f32,
    /// Range and phase of the hand's strokes while a table is played.
    hand: Option<([f32; 2], f32)>,
}

impl Mechanics {
    pub(crate) const fn new() -> Self {
        Self {
            estimator: None,
            period_s: 0.0,
            x_mm: 17.5,
            v_mm_s: 0.0,
            force_n: 0.0,
            hand: None,
        }
    }

    pub(crate) fn begin(&mut self, servo_hz: f64) {
        self.estimator = Some(Estimator::new(SPEED_HZ, servo_hz));
        self.period_s = 1.0 / servo_hz as f32;
    }

    /// The motion at the end of the last period.
    pub(crate) fn motion(&mut self) -> Motion<f32> {
        self.pass();
        let x_mm = libm::roundf(self.x_mm * COUNTS_PER_MM) / COUNTS_PER_MM;
        match &mut self.estimator {
            Some(estimator) => estimator.step(x_mm),
            None => Motion::at_rest(x_mm),
        }
    }

    /// The force that the motor holds, with the sign of the force that the hand applies.
    pub(crate) fn apply(&mut self, force_n: f32) {
        self.force_n = force_n;
    }

    /// The range of the table that is being played, if any.
    pub(crate) fn playing(&mut self, range_mm: Option<[f64; 2]>) {
        match range_mm {
            Some([low, high]) if self.hand.is_none() => {
                self.hand = Some(([low as f32, high as f32], 0.0));
            }
            Some(_) => {}
            None => self.hand = None,
        }
    }

    /// Simulates one servo period.
    fn pass(&mut self) {
        let Some(([low, high], phase)) = &mut self.hand else {
            // Friction holds a handle that nobody moves.
            self.v_mm_s = 0.0;
            return;
        };
        *phase = (*phase + STROKE_HZ * self.period_s) % 1.0;
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * *phase);
        // It leaves a range that is shorter than a finger moves.
        let half = match *high - *low > SHORTEST_MM {
            true => 0.4 * (*high - *low),
            false => LEAST_STROKE_MM,
        };
        let middle = 0.5 * (*low + *high);
        let wanted_mm = middle + half * sin;
        let wanted_mm_s = half * cos * core::f32::consts::TAU * STROKE_HZ;
        let hand_n =
            GRIP_N_PER_MM * (wanted_mm - self.x_mm) + GRIP_N_S_PER_MM * (wanted_mm_s - self.v_mm_s);
        let a_mm_s2 = 1000.0 * (hand_n - self.force_n) / HANDLE_KG as f32;
        self.v_mm_s += a_mm_s2 * self.period_s;
        self.x_mm += self.v_mm_s * self.period_s;
    }

    pub(crate) fn guard_open(&self) -> bool {
        false
    }

    pub(crate) fn feed_watchdog(&self) {}
}

/// The emulator has one clock, without a tree; returns its frequency, Hz.
pub(crate) fn start_clock() -> u32 {
    168_000_000
}

/// The emulated port has no rate.
pub(crate) fn start_port(_clock_hz: u32) {
    TIM2_CR1.write(1);
    // On, receives with an interrupt, sends.
    USART1_CR1.write(1 << 13 | 1 << 5 | 1 << 3 | 1 << 2);
}

pub(crate) fn motor_off() {}
