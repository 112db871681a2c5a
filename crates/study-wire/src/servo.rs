//! The servo step: from the measured motion to the commanded force.
//!
//! It has no clock and does not panic on a valid table. Whoever owns the motor calls
//! [`Servo::step`] once per servo period; the host never closes the force loop over a link.
//!
//! Each period performs these steps in order:
//!
//! 1. Trip if a measured value is not finite, too fast, out of range or a jump.
//! 2. Add the energy of the previous period, E += F·Δx. This is exact because the
//!    force was constant. F is the force that the hand has to apply, so E is the
//!    energy that the hand has put in; E < 0 means that the device was active.
//! 3. Low-pass the acceleration with two poles; a sampled mass is unstable without
//!    this filter.
//! 4. Evaluate the table with the realization's direction rule. The speed is
//!    limited to the trained range and the mass to at least
//!    [`ServoSettings::least_mass_kg`].
//! 5. Beyond the identified range, use the force at its edge and add a spring wall.
//! 6. Limit the slew rate, 7. apply the ramp, 8. clamp to the force limit.
//!
//! [`tally`] accumulates energy, strokes and counts on the way.
//!
//! Invariant: the commanded force is finite and within the force limit, and it is
//! zero unless the servo is playing. A force limit that is not finite and positive
//! gives zero force, never an unlimited one.

mod low_pass;
pub mod tally;

use crate::predict::{self, Direction, DirectionState, Motion, TableView};
use low_pass::LowPass;
use tally::Tally;

/// What the device adds to a table, and its limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoSettings {
    /// Servo periods per second.
    pub servo_hz: f64,
    /// Largest force, N.
    pub force_n: f64,
    /// Speed above which the device trips, mm/s.
    pub velocity_mm_s: f64,
    /// Corner of the acceleration's low-pass (Butterworth, two poles), Hz.
    pub acceleration_hz: f64,
    /// Smallest mass that is rendered, kg, zero or negative. A device cannot
    /// compensate more than its own moving mass: below that the motion is unstable.
    pub least_mass_kg: f64,
    /// Damping added to the table's, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Stiffness of the wall beyond the identified range, N/mm.
    pub wall_n_per_mm: f64,
    /// Damping of the wall, N·s/mm.
    pub wall_n_s_per_mm: f64,
    /// How far beyond the identified range the device trips, mm.
    pub overtravel_mm: f64,
    /// Larger position changes in one servo period are encoder faults, mm.
    pub jump_mm: f64,
    /// Fastest change of force, N/s.
    pub slew_n_s: f64,
    /// Time from zero to full force after the start, s.
    pub ramp_s: f64,
}

impl Default for ServoSettings {
    /// 4 kHz, 12 N, 1 m/s and the values given in `docs/simulation.md`.
    fn default() -> Self {
        Self {
            servo_hz: 4000.0,
            force_n: 12.0,
            velocity_mm_s: 1000.0,
            acceleration_hz: 20.0,
            least_mass_kg: f64::NEG_INFINITY,
            damping_n_s_per_mm: 0.002,
            wall_n_per_mm: 10.0,
            wall_n_s_per_mm: 0.01,
            overtravel_mm: 2.5,
            jump_mm: 1.0,
            slew_n_s: 2000.0,
            ramp_s: 0.4,
        }
    }
}

/// What is played: a table, its direction rule and the identified range.
#[derive(Debug, Clone, Copy)]
pub struct Rendering<'a> {
    /// The parameters.
    pub table: TableView<'a>,
    /// How the branches for the two directions are combined.
    pub rule: Direction,
    /// Identified range of positions, mm.
    pub range_mm: [f64; 2],
    /// Largest speed in the identification, mm/s.
    pub trained_mm_s: f64,
}

/// Why the servo switched the force off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trip {
    /// Faster than the velocity limit.
    Velocity,
    /// Further beyond the range than [`ServoSettings::overtravel_mm`].
    Stroke,
    /// A position, speed, acceleration or force is not finite.
    NotANumber,
    /// The position jumped by more than [`ServoSettings::jump_mm`].
    Encoder,
}

/// State of the servo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServoState {
    /// Zero force.
    Limp,
    /// Rendering the table's force.
    Playing,
    /// Zero force, latched until the next [`Servo::start`].
    Tripped(Trip),
}

/// A servo with its filters, direction state and totals.
#[derive(Debug, Clone)]
pub struct Servo {
    settings: ServoSettings,
    acceleration_filter: LowPass,
    /// Extracts the slow part of the force; the rest is roughness.
    force_filter: LowPass,
    state: ServoState,
    direction: DirectionState,
    forwards: bool,
    /// Slew-limited force before the ramp, N.
    slewed_n: f64,
    /// Force commanded in the current period, N.
    held_n: f64,
    clamping: bool,
    tally: Tally,
}

/// A clamp ends when the force falls below this fraction of the limit, so that noise
/// around the limit counts once.
const CLAMP_END_FRACTION: f64 = 0.9;
/// Force above this frequency counts as roughness, Hz.
const ROUGHNESS_HZ: f64 = 20.0;

impl Servo {
    /// A servo at zero force.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            settings,
            acceleration_filter: LowPass::new(settings.acceleration_hz, settings.servo_hz),
            force_filter: LowPass::new(ROUGHNESS_HZ, settings.servo_hz),
            state: ServoState::Limp,
            direction: DirectionState::default(),
            forwards: true,
            slewed_n: 0.0,
            held_n: 0.0,
            clamping: false,
            tally: Tally::default(),
        }
    }

    /// The current state.
    pub fn state(&self) -> ServoState {
        self.state
    }

    /// The commanded force, N.
    pub fn held_n(&self) -> f64 {
        self.held_n
    }

    /// Totals since the last start.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Starts playing from zero force and clears a trip.
    pub fn start(&mut self) {
        *self = Self::new(self.settings);
        self.state = ServoState::Playing;
    }

    /// Sets the force to zero at once. Totals and a trip are kept.
    pub fn limp(&mut self) {
        self.held_n = 0.0;
        if self.state == ServoState::Playing {
            self.state = ServoState::Limp;
        }
    }

    /// Sets the force to zero and latches this state until the next start.
    pub fn trip(&mut self, cause: Trip) {
        self.held_n = 0.0;
        self.state = ServoState::Tripped(cause);
    }

    /// Runs one servo period and returns the force to hold until the next, N.
    pub fn step(&mut self, what: &Rendering<'_>, motion: Motion) -> f64 {
        if self.state != ServoState::Playing {
            return 0.0;
        }
        if let Some(cause) = self.trip_cause(what, motion) {
            self.trip(cause);
            return 0.0;
        }
        self.tally
            .add_motion(self.held_n, motion.x_mm, what.range_mm);

        let settings = self.settings;
        let wanted_n = self.table_n(what, motion) + settings.damping_n_s_per_mm * motion.v_mm_s;
        if !wanted_n.is_finite() {
            self.trip(Trip::NotANumber);
            return 0.0;
        }
        let ramp = self.ramp();
        self.count_clamps(wanted_n * ramp);
        // The target of the slew limit is clamped as well. Otherwise a force far
        // above the limit would delay the return to a smaller one.
        let change_n = within(wanted_n, settings.force_n) - self.slewed_n;
        let allowed_n = within(change_n, settings.slew_n_s / settings.servo_hz);
        self.tally.slewed += u64::from(allowed_n != change_n);
        self.slewed_n += allowed_n;
        self.held_n = within(self.slewed_n * ramp, settings.force_n);
        let rough_n = self.held_n - self.force_filter.step(self.held_n);
        self.tally.add_force(self.held_n, rough_n);
        self.held_n
    }

    fn trip_cause(&self, what: &Rendering<'_>, motion: Motion) -> Option<Trip> {
        let Motion { x_mm, v_mm_s, .. } = motion;
        if !motion.is_finite() {
            return Some(Trip::NotANumber);
        }
        let beyond = self.settings.overtravel_mm;
        let [low, high] = what.range_mm;
        // With `<=` a limit that is NaN trips.
        let slow_enough = libm::fabs(v_mm_s) <= self.settings.velocity_mm_s;
        let near_enough = x_mm >= low - beyond && x_mm <= high + beyond;
        let steady = self
            .tally
            .last_x_mm()
            .is_none_or(|last| libm::fabs(x_mm - last) <= self.settings.jump_mm);
        if !slow_enough {
            Some(Trip::Velocity)
        } else if !near_enough {
            Some(Trip::Stroke)
        } else if !steady {
            Some(Trip::Encoder)
        } else {
            None
        }
    }

    /// The table's force, N: inside the identified range at the actual position,
    /// outside at the edge plus the wall.
    fn table_n(&mut self, what: &Rendering<'_>, motion: Motion) -> f64 {
        let settings = self.settings;
        let a_m_s2 = self.acceleration_filter.step(motion.a_m_s2);
        let z = self.direction.step(what.rule, motion);
        if (z >= 0.0) != self.forwards {
            self.forwards = !self.forwards;
            self.tally.switches += 1;
        }

        let [low, high] = what.range_mm;
        let x_mm = motion.x_mm.max(low).min(high);
        let v_mm_s = within(motion.v_mm_s, what.trained_mm_s);
        let force_at = |a_m_s2| {
            let limited = Motion {
                x_mm,
                v_mm_s,
                a_m_s2,
            };
            predict::force_n(&what.table, z, limited)
        };
        // The force is linear in a, so the difference is the table's mass.
        let without_mass_n = force_at(0.0);
        let mut mass_kg = force_at(1.0) - without_mass_n;
        if mass_kg < settings.least_mass_kg {
            self.tally.mass_held += 1;
            mass_kg = settings.least_mass_kg;
        }
        let mut force_n = without_mass_n + mass_kg * a_m_s2;
        let beyond_mm = motion.x_mm - x_mm;
        if beyond_mm != 0.0 {
            let wall_n =
                settings.wall_n_per_mm * beyond_mm + settings.wall_n_s_per_mm * motion.v_mm_s;
            // The wall only pushes back into the range; its damping never pulls.
            force_n += if beyond_mm > 0.0 {
                wall_n.max(0.0)
            } else {
                wall_n.min(0.0)
            };
        }
        force_n
    }

    /// Ramp factor of the current period: half a cosine from 0 to 1.
    fn ramp(&self) -> f64 {
        let since_s = self.tally.steps as f64 / self.settings.servo_hz;
        if since_s >= self.settings.ramp_s {
            return 1.0;
        }
        let fraction = since_s / self.settings.ramp_s;
        0.5 - 0.5 * libm::cos(core::f64::consts::PI * fraction)
    }

    fn count_clamps(&mut self, force_n: f64) {
        let size = libm::fabs(force_n);
        if size > self.settings.force_n {
            self.tally.clamps += u64::from(!self.clamping);
            self.clamping = true;
        } else if size < CLAMP_END_FRACTION * self.settings.force_n {
            self.clamping = false;
        }
    }
}

/// `value` limited to [−limit, limit]; 0 if the limit is not finite and positive.
fn within(value: f64, limit: f64) -> f64 {
    if limit.is_finite() && limit > 0.0 {
        value.clamp(-limit, limit)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;
