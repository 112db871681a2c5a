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
//! 4. Evaluate the table with the realization's direction rule, or step the mechanism or the elements. A
//!    table's speed is limited to the trained range, and the mass to at least
//!    [`ServoSettings::least_mass_kg`].
//! 5. Beyond the identified range, use the force at its edge and add a spring wall.
//! 6. Limit the slew rate, 7. apply the ramp, and the fall after [`Servo::fade`], 8. clamp to
//!    the force limit.
//!
//! [`tally`] accumulates energy, strokes and counts on the way.
//!
//! Invariant: the commanded force is finite and within the force limit, and it is
//! zero unless the servo is playing. A force limit that is not finite and positive
//! gives zero force, never an unlimited one.

mod low_pass;
pub mod tally;

use crate::elements::{self, ElementsView};
use crate::mechanism::{self, MechanismView};
use crate::predict::{self, Direction, DirectionState, Motion, TableView, clamp};
use crate::real::Real;
use low_pass::{DirectForm, LowPass};
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
    /// State minus that mass once it is known; the default is 0.
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
    fn default() -> Self {
        Self::new()
    }
}

impl ServoSettings {
    /// 4 kHz, 12 N, 1 m/s, no negative mass and the values given in
    /// `docs/simulation.md`.
    pub const fn new() -> Self {
        Self {
            servo_hz: 4000.0,
            force_n: 12.0,
            velocity_mm_s: 1000.0,
            acceleration_hz: 20.0,
            least_mass_kg: 0.0,
            damping_n_s_per_mm: 0.002,
            wall_n_per_mm: 10.0,
            wall_n_s_per_mm: 0.01,
            overtravel_mm: 2.5,
            jump_mm: 1.0,
            slew_n_s: 2000.0,
            ramp_s: 0.4,
        }
    }

    /// Servo periods in which a force falls to zero after [`Servo::fade`]: those of the ramp, or
    /// as many as the steepest part of the fall from the force limit needs within the slew limit.
    pub fn fade_periods(&self) -> u32 {
        let steepest_s = core::f64::consts::FRAC_PI_2 * self.force_n / self.slew_n_s;
        // A limit that is no number gives no force.
        let fade_s = match steepest_s.is_finite() {
            true => steepest_s.max(self.ramp_s),
            false => self.ramp_s,
        };
        // `as` saturates.
        (libm::ceil(fade_s * self.servo_hz - ROUNDING) as u32).max(1)
    }
}

/// Rounding that is no servo period more.
const ROUNDING: f64 = 1e-6;

/// The force of a realization as a function of the motion.
#[derive(Debug, Clone, Copy)]
pub enum Law<'a, R = f64> {
    /// Parameters by position and direction.
    Table {
        /// The parameters.
        table: TableView<'a, R>,
        /// How the branches for the two directions are combined.
        rule: Direction,
    },
    /// A mechanism with a state of its own.
    Mechanism(MechanismView<'a, R>),
    /// A potential with dampers and springs.
    Elements(ElementsView<'a, R>),
}

/// What is played, and the range in which it was identified.
#[derive(Debug, Clone, Copy)]
pub struct Rendering<'a, R = f64> {
    /// The force.
    pub law: Law<'a, R>,
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
pub struct Servo<R = f64> {
    settings: ServoSettings,
    constants: Constants<R>,
    acceleration_filter: LowPass<R>,
    /// Extracts the slow part of the force; the rest is roughness.
    force_filter: DirectForm<R>,
    state: ServoState,
    direction: DirectionState<R>,
    /// State of a mechanism, from the first period on.
    mechanism: Option<mechanism::State<R>>,
    /// State of elements, likewise.
    elements: Option<elements::State<R>>,
    forwards: bool,
    /// Slew-limited force before the ramp, N.
    slewed_n: R,
    /// Force commanded in the current period, N.
    held_n: R,
    clamping: bool,
    /// Servo periods of the fall so far, once the force falls.
    fallen: Option<u32>,
    /// Whether the handle has left the range during the fall: no force is left.
    released: bool,
    tally: Tally<R>,
}

/// The settings in the servo's precision.
#[derive(Debug, Clone, Copy)]
struct Constants<R> {
    force_n: R,
    velocity_mm_s: R,
    least_mass_kg: R,
    damping_n_s_per_mm: R,
    wall_n_per_mm: R,
    wall_n_s_per_mm: R,
    overtravel_mm: R,
    jump_mm: R,
    /// Largest change of force in a servo period, N.
    slew_n: R,
    servo_hz: R,
    period_s: R,
    ramp_s: R,
    /// Servo periods of a fall.
    fade_periods: R,
}

impl<R: Real> Constants<R> {
    const ZERO: Self = Self {
        force_n: R::ZERO,
        velocity_mm_s: R::ZERO,
        least_mass_kg: R::ZERO,
        damping_n_s_per_mm: R::ZERO,
        wall_n_per_mm: R::ZERO,
        wall_n_s_per_mm: R::ZERO,
        overtravel_mm: R::ZERO,
        jump_mm: R::ZERO,
        slew_n: R::ZERO,
        servo_hz: R::ZERO,
        period_s: R::ZERO,
        ramp_s: R::ZERO,
        fade_periods: R::ZERO,
    };

    fn of(settings: &ServoSettings) -> Self {
        Self {
            force_n: R::of(settings.force_n),
            velocity_mm_s: R::of(settings.velocity_mm_s),
            least_mass_kg: R::of(settings.least_mass_kg),
            damping_n_s_per_mm: R::of(settings.damping_n_s_per_mm),
            wall_n_per_mm: R::of(settings.wall_n_per_mm),
            wall_n_s_per_mm: R::of(settings.wall_n_s_per_mm),
            overtravel_mm: R::of(settings.overtravel_mm),
            jump_mm: R::of(settings.jump_mm),
            slew_n: R::of(settings.slew_n_s / settings.servo_hz),
            servo_hz: R::of(settings.servo_hz),
            period_s: R::of(1.0 / settings.servo_hz),
            ramp_s: R::of(settings.ramp_s),
            fade_periods: R::of(f64::from(settings.fade_periods())),
        }
    }
}

/// A clamp ends when the force falls below this fraction of the limit, so that noise
/// around the limit counts once.
const CLAMP_END_FRACTION: f64 = 0.9;
/// Force above this frequency counts as roughness, Hz.
const ROUGHNESS_HZ: f64 = 20.0;

impl<R: Real> Servo<R> {
    /// A servo at zero force.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            constants: Constants::of(&settings),
            acceleration_filter: LowPass::new(settings.acceleration_hz, settings.servo_hz),
            force_filter: DirectForm::new(ROUGHNESS_HZ, settings.servo_hz),
            ..Self::limp_with(settings)
        }
    }

    /// A servo that is not ready to play before [`Servo::start`], for constants.
    pub(crate) const fn limp_with(settings: ServoSettings) -> Self {
        Self {
            settings,
            constants: Constants::ZERO,
            acceleration_filter: LowPass::ZERO,
            force_filter: DirectForm::ZERO,
            state: ServoState::Limp,
            direction: DirectionState::new(),
            mechanism: None,
            elements: None,
            forwards: true,
            slewed_n: R::ZERO,
            held_n: R::ZERO,
            clamping: false,
            fallen: None,
            released: false,
            tally: Tally::new(),
        }
    }

    /// The current state.
    pub fn state(&self) -> ServoState {
        self.state
    }

    /// The commanded force, N.
    pub fn held_n(&self) -> R {
        self.held_n
    }

    /// Totals since the last start.
    pub fn tally(&self) -> Tally<R> {
        self.tally
    }

    /// Starts playing from zero force and clears a trip.
    pub fn start(&mut self) {
        *self = Self::new(self.settings);
        self.state = ServoState::Playing;
    }

    /// Lets the force fall to zero from the next period on, by half a cosine over
    /// [`ServoSettings::fade_periods`]. It falls once: later calls change nothing.
    ///
    /// The wall beyond the range falls, too. A hand that leans against it goes through it, which is no
    /// [`Trip::Stroke`]: the force is zero from then on.
    pub fn fade(&mut self) {
        self.fallen = self.fallen.or(Some(0));
    }

    /// Whether a force that falls has reached zero.
    pub fn faded(&self) -> bool {
        let fallen = self.fallen.map(|periods| R::of(f64::from(periods)));
        fallen.is_some_and(|periods| periods >= self.constants.fade_periods)
    }

    /// Sets the force to zero at once. Totals and a trip are kept.
    pub fn limp(&mut self) {
        self.held_n = R::ZERO;
        if self.state == ServoState::Playing {
            self.state = ServoState::Limp;
        }
    }

    /// Sets the force to zero and latches this state until the next start.
    pub fn trip(&mut self, cause: Trip) {
        self.held_n = R::ZERO;
        self.state = ServoState::Tripped(cause);
    }

    /// Runs one servo period and returns the force to hold until the next, N.
    pub fn step(&mut self, what: &Rendering<'_, R>, motion: Motion<R>) -> R {
        if self.state != ServoState::Playing {
            return R::ZERO;
        }
        let range_mm = what.range_mm.map(R::of);
        if let Some(cause) = self.trip_cause(range_mm, motion) {
            self.trip(cause);
            return R::ZERO;
        }
        self.tally.add_motion(self.held_n, motion.x_mm, range_mm);
        self.released |= self.fallen.is_some() && !self.is_near(range_mm, motion.x_mm);

        let constants = self.constants;
        let wanted_n =
            self.law_n(what, range_mm, motion) + constants.damping_n_s_per_mm * motion.v_mm_s;
        if !wanted_n.is_finite() {
            self.trip(Trip::NotANumber);
            return R::ZERO;
        }
        let ramp = self.ramp() * self.fall();
        self.count_clamps(wanted_n * ramp);
        // The target of the slew limit is clamped as well. Otherwise a force far
        // above the limit would delay the return to a smaller one.
        let change_n = within(wanted_n, constants.force_n) - self.slewed_n;
        let allowed_n = within(change_n, constants.slew_n);
        self.tally.slewed += u64::from(allowed_n != change_n);
        self.slewed_n += allowed_n;
        self.held_n = within(self.slewed_n * ramp, constants.force_n);
        let rough_n = self.held_n - self.force_filter.step(self.held_n);
        self.tally.add_force(self.held_n, rough_n);
        self.held_n
    }

    /// Whether a position is beyond the range by no more than the overtravel.
    fn is_near(&self, [low, high]: [R; 2], x_mm: R) -> bool {
        let beyond = self.constants.overtravel_mm;
        x_mm >= low - beyond && x_mm <= high + beyond
    }

    fn trip_cause(&self, range_mm: [R; 2], motion: Motion<R>) -> Option<Trip> {
        let Motion { x_mm, v_mm_s, .. } = motion;
        if !motion.is_finite() {
            return Some(Trip::NotANumber);
        }
        // With `<=` a limit that is NaN trips.
        let slow_enough = v_mm_s.abs() <= self.constants.velocity_mm_s;
        let near_enough = self.fallen.is_some() || self.is_near(range_mm, x_mm);
        let steady = self
            .tally
            .last_x_mm()
            .is_none_or(|last| (x_mm - last).abs() <= self.constants.jump_mm);
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

    /// The force of the realization, N: inside the identified range at the actual
    /// position, outside at the edge plus the wall.
    fn law_n(&mut self, what: &Rendering<'_, R>, [low, high]: [R; 2], motion: Motion<R>) -> R {
        let constants = self.constants;
        let a_m_s2 = self.acceleration_filter.step(motion.a_m_s2);
        let x_mm = motion.x_mm.max(low).min(high);
        // What has a state of its own has a handle that stops at the edge.
        let handle = Motion {
            x_mm,
            v_mm_s: if x_mm == motion.x_mm {
                motion.v_mm_s
            } else {
                R::ZERO
            },
            a_m_s2: R::ZERO,
        };
        let (z, mut mass_kg, without_mass_n) = match &what.law {
            Law::Table { table, rule } => {
                let z = self.direction.step(*rule, motion);
                let v_mm_s = within(motion.v_mm_s, R::of(what.trained_mm_s));
                let (mass_kg, force_n) = predict::mass_and_force(table, z, x_mm, v_mm_s);
                (z, mass_kg, force_n)
            }
            Law::Mechanism(mechanism) => {
                let at_rest = || mechanism::State::at_rest(x_mm);
                let state = self.mechanism.get_or_insert_with(at_rest);
                let force_n = state.step(mechanism, handle, constants.period_s);
                (state.z_handle, mechanism.scalars.handle_kg, force_n)
            }
            Law::Elements(view) => {
                let at_rest = || elements::State::at_rest(view, x_mm);
                let state = self.elements.get_or_insert_with(at_rest);
                let force_n = state.step(view, handle, constants.period_s);
                (state.direction(view), view.mass_kg, force_n)
            }
        };
        if (z >= R::ZERO) != self.forwards {
            self.forwards = !self.forwards;
            self.tally.switches += 1;
        }
        if mass_kg < constants.least_mass_kg {
            self.tally.mass_held += 1;
            mass_kg = constants.least_mass_kg;
        }
        let mut force_n = without_mass_n + mass_kg * a_m_s2;
        let beyond_mm = motion.x_mm - x_mm;
        if beyond_mm != R::ZERO {
            let wall_n =
                constants.wall_n_per_mm * beyond_mm + constants.wall_n_s_per_mm * motion.v_mm_s;
            // The wall only pushes back into the range; its damping never pulls.
            force_n += if beyond_mm > R::ZERO {
                wall_n.max(R::ZERO)
            } else {
                wall_n.min(R::ZERO)
            };
        }
        force_n
    }

    /// Ramp factor of the current period: half a cosine from 0 to 1.
    fn ramp(&self) -> R {
        let Constants {
            servo_hz, ramp_s, ..
        } = self.constants;
        let since_s = R::of(self.tally.steps as f64) / servo_hz;
        if since_s < ramp_s {
            let fraction = since_s / ramp_s;
            R::HALF - R::HALF * (R::of(core::f64::consts::PI) * fraction).cos()
        } else {
            R::ONE
        }
    }

    /// Factor of a force that falls in the current period, and the next one afterwards: half a
    /// cosine from 1 to 0. The first one is below 1, the last one 0.
    fn fall(&mut self) -> R {
        let Some(fallen) = &mut self.fallen else {
            return R::ONE;
        };
        *fallen = fallen.saturating_add(1);
        if self.released {
            return R::ZERO;
        }
        let fraction = (R::of(f64::from(*fallen)) / self.constants.fade_periods).min(R::ONE);
        R::HALF + R::HALF * (R::of(core::f64::consts::PI) * fraction).cos()
    }

    fn count_clamps(&mut self, force_n: R) {
        let size = force_n.abs();
        if size > self.constants.force_n {
            self.tally.clamps += u64::from(!self.clamping);
            self.clamping = true;
        } else if size < R::of(CLAMP_END_FRACTION) * self.constants.force_n {
            self.clamping = false;
        }
    }
}

/// `value` limited to [−limit, limit]; 0 if the limit is not finite and positive.
fn within<R: Real>(value: R, limit: R) -> R {
    if limit.is_finite() && limit > R::ZERO {
        clamp(value, limit)
    } else {
        R::ZERO
    }
}

#[cfg(test)]
mod tests;
