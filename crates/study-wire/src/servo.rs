//! The servo step: from a measured motion to the force that the device holds.
//!
//! Only `core`, `libm` and slices, so that the same source runs on a device: no
//! clock, no allocation, no panic on a valid table. The host never calls it
//! across a link; whoever owns the motor does, once a servo period.
//!
//! In this order, each period:
//!
//! 1. trips on the measured motion: not a number, too fast, too far, a jump;
//! 2. energy of the period that has passed: E += F_held·Δx, exact because the
//!    force was held. F is the force that the hand has to apply, so E is what the
//!    hand has put in; a device that gives more than it got has E < 0;
//! 3. acceleration through a two-pole low-pass, because a sampled mass without
//!    one is unstable;
//! 4. the table's force with the realization's own direction rule, speed held to
//!    the trained range, mass not below [`Settings::least_mass_kg`];
//! 5. beyond the identified range the force of its edge and a spring wall;
//! 6. slew limit, 7. ramp-in, 8. clamp.
//!
//! What comes together on the way is in [`tally`].
//!
//! The invariant: the force that comes out is a number within the force limit,
//! and zero unless the state is playing. A limit that is no positive number
//! makes the device limp, never free.

mod low_pass;
pub mod tally;

use crate::predict::{self, Direction, DirectionState, Motion, TableView};
use low_pass::LowPass;
use tally::Tally;

/// What the device adds to a table, and what it never exceeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Servo periods per second.
    pub servo_hz: f64,
    /// Largest force, N.
    pub force_n: f64,
    /// Speed above which the device trips, mm/s.
    pub velocity_mm_s: f64,
    /// Corner of the acceleration's low-pass (Butterworth, two poles), Hz.
    pub acceleration_hz: f64,
    /// Smallest mass that is rendered, kg, zero or negative. A device can take
    /// away no more than its own moving mass: below that no hand holds it.
    pub least_mass_kg: f64,
    /// Damping that is rendered beside the table's, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Stiffness of the wall beyond the identified range, N/mm.
    pub wall_n_per_mm: f64,
    /// Damping of the wall, N·s/mm.
    pub wall_n_s_per_mm: f64,
    /// How far beyond the identified range the device trips, mm.
    pub overtravel_mm: f64,
    /// Further than this no handle moves in a servo period, mm.
    pub jump_mm: f64,
    /// Fastest change of force, N/s.
    pub slew_n_s: f64,
    /// Time from zero to full force at the start, s.
    pub ramp_s: f64,
}

impl Default for Settings {
    /// 4 kHz, 12 N, 1 m/s and the figures of `docs/simulation.md`.
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

/// What is played: a table, its direction rule and where it was identified.
#[derive(Debug, Clone, Copy)]
pub struct Rendering<'a> {
    /// The parameters.
    pub table: TableView<'a>,
    /// How its two branches are joined.
    pub rule: Direction,
    /// Identified range, mm.
    pub range_mm: [f64; 2],
    /// Largest speed that it was identified at, mm/s.
    pub trained_mm_s: f64,
}

/// Why the device went limp by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trip {
    /// Faster than the velocity limit.
    Velocity,
    /// Further than the wall lets anything come.
    Stroke,
    /// A position, speed, acceleration or force that is no number.
    NotANumber,
    /// The position jumped further than the handle can move in a servo period.
    Encoder,
    /// Told so from outside: an injected fault, a watchdog, a button.
    Told,
}

impl Trip {
    /// In words, for a report.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Velocity => "velocity limit exceeded",
            Self::Stroke => "stroke exceeded",
            Self::NotANumber => "a measured or computed value is not a number",
            Self::Encoder => "the encoder jumped",
            Self::Told => "stopped by the device's supervision",
        }
    }
}

/// What the servo is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Zero force.
    Limp,
    /// Holding the table's force.
    Playing,
    /// Zero force, latched until [`Core::limp`] and a new start.
    Tripped(Trip),
}

/// The servo's memory.
#[derive(Debug, Clone)]
pub struct Core {
    settings: Settings,
    filter: LowPass,
    /// What is slow in the force; the rest is roughness.
    steady: LowPass,
    state: State,
    direction: DirectionState,
    forwards: bool,
    /// Before the ramp, which is no part of what the slew limit guards.
    slewed_n: f64,
    held_n: f64,
    clamping: bool,
    tally: Tally,
}

/// Share of the limit below which a clamp is over: noise about the limit is one.
const CLAMP_OVER: f64 = 0.9;
/// Above this frequency force is roughness, Hz.
const ROUGH_HZ: f64 = 20.0;

impl Core {
    /// A limp servo.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            filter: LowPass::new(settings.acceleration_hz, settings.servo_hz),
            steady: LowPass::new(ROUGH_HZ, settings.servo_hz),
            state: State::Limp,
            direction: DirectionState::default(),
            forwards: true,
            slewed_n: 0.0,
            held_n: 0.0,
            clamping: false,
            tally: Tally::default(),
        }
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// The force that it holds, N.
    pub fn held_n(&self) -> f64 {
        self.held_n
    }

    /// What has come together since the last start.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Starts playing from zero force; a trip is forgotten.
    pub fn start(&mut self) {
        *self = Self::new(self.settings);
        self.state = State::Playing;
    }

    /// Zero force, at once. The tally stays; so does a trip.
    pub fn limp(&mut self) {
        self.held_n = 0.0;
        if self.state == State::Playing {
            self.state = State::Limp;
        }
    }

    /// Zero force, latched.
    pub fn trip(&mut self, why: Trip) {
        self.held_n = 0.0;
        self.state = State::Tripped(why);
    }

    /// One servo period: the force to hold until the next, N.
    pub fn step(&mut self, what: &Rendering<'_>, motion: Motion) -> f64 {
        if self.state != State::Playing {
            return 0.0;
        }
        if let Some(why) = self.danger(what, motion) {
            self.trip(why);
            return 0.0;
        }
        self.tally.account(self.held_n, motion.x_mm, what.range_mm);

        let settings = self.settings;
        let wanted_n = self.table_n(what, motion) + settings.damping_n_s_per_mm * motion.v_mm_s;
        if !wanted_n.is_finite() {
            self.trip(Trip::NotANumber);
            return 0.0;
        }
        let ramp = self.ramp();
        self.count_clamps(wanted_n * ramp);
        // what the slew limit runs after is within the force limit too: otherwise
        // a force far above it would take its time to come back
        let change_n = within(wanted_n, settings.force_n) - self.slewed_n;
        let allowed_n = within(change_n, settings.slew_n_s / settings.servo_hz);
        self.tally.slewed += u64::from(allowed_n != change_n);
        self.slewed_n += allowed_n;
        self.held_n = within(self.slewed_n * ramp, settings.force_n);
        let rough_n = self.held_n - self.steady.step(self.held_n);
        self.tally.held(self.held_n, rough_n);
        self.held_n
    }

    fn danger(&self, what: &Rendering<'_>, motion: Motion) -> Option<Trip> {
        let Motion {
            x_mm,
            v_mm_s,
            a_m_s2,
        } = motion;
        if !(x_mm.is_finite() && v_mm_s.is_finite() && a_m_s2.is_finite()) {
            return Some(Trip::NotANumber);
        }
        let beyond = self.settings.overtravel_mm;
        let [low, high] = what.range_mm;
        // asked this way round, a limit that is no number trips
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

    /// The table's force inside the identified range, its edge's and the wall's
    /// outside.
    fn table_n(&mut self, what: &Rendering<'_>, motion: Motion) -> f64 {
        let settings = self.settings;
        let a_m_s2 = self.filter.step(motion.a_m_s2);
        let z = self.direction.step(what.rule, motion);
        if (z >= 0.0) != self.forwards {
            self.forwards = !self.forwards;
            self.tally.switches += 1;
        }

        let [low, high] = what.range_mm;
        let x_mm = motion.x_mm.max(low).min(high);
        let v_mm_s = within(motion.v_mm_s, what.trained_mm_s);
        let force_at = |a_m_s2| {
            let felt = Motion {
                x_mm,
                v_mm_s,
                a_m_s2,
            };
            predict::force_n(&what.table, z, felt)
        };
        // the force is linear in a, so this is the table's mass
        let without_n = force_at(0.0);
        let mut mass_kg = force_at(1.0) - without_n;
        if mass_kg < settings.least_mass_kg {
            self.tally.mass_held += 1;
            mass_kg = settings.least_mass_kg;
        }
        let mut force_n = without_n + mass_kg * a_m_s2;
        let beyond = motion.x_mm - x_mm;
        if beyond != 0.0 {
            let wall_n = settings.wall_n_per_mm * beyond + settings.wall_n_s_per_mm * motion.v_mm_s;
            // a wall pushes back and never holds on
            force_n += if beyond > 0.0 {
                wall_n.max(0.0)
            } else {
                wall_n.min(0.0)
            };
        }
        force_n
    }

    /// Half a cosine from 0 to 1.
    fn ramp(&self) -> f64 {
        let since_s = self.tally.steps as f64 / self.settings.servo_hz;
        if since_s >= self.settings.ramp_s {
            return 1.0;
        }
        let share = since_s / self.settings.ramp_s;
        0.5 - 0.5 * libm::cos(core::f64::consts::PI * share)
    }

    fn count_clamps(&mut self, force_n: f64) {
        let size = libm::fabs(force_n);
        if size > self.settings.force_n {
            self.tally.clamps += u64::from(!self.clamping);
            self.clamping = true;
        } else if size < CLAMP_OVER * self.settings.force_n {
            self.clamping = false;
        }
    }
}

/// `value` brought into [−limit, limit]; 0 if the limit is no finite positive
/// number.
fn within(value: f64, limit: f64) -> f64 {
    if limit.is_finite() && limit > 0.0 {
        value.clamp(-limit, limit)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::{BranchView, Lookup};

    const NODES: [f64; 2] = [0.0, 30.0];
    const NONE: [f64; 2] = [0.0; 2];

    /// A table of constant damping in both directions.
    fn damper(b_n_s_per_mm: &[f64; 2]) -> Rendering<'_> {
        let branch = BranchView {
            m_kg: &NONE,
            b_n_s_per_mm,
            k_n_per_mm: &NONE,
            f0_n: &NONE,
        };
        Rendering {
            table: TableView {
                x_mm: &NODES,
                positive: branch,
                negative: branch,
                lookup: Lookup::Linear,
            },
            rule: Direction::Sign,
            range_mm: NODES,
            trained_mm_s: 500.0,
        }
    }

    fn bare() -> Settings {
        Settings {
            damping_n_s_per_mm: 0.0,
            ..Settings::default()
        }
    }

    fn motion(x_mm: f64, v_mm_s: f64) -> Motion {
        Motion {
            x_mm,
            v_mm_s,
            a_m_s2: 0.0,
        }
    }

    /// Four seconds of 15 ± 14 mm at 1 Hz.
    fn swing(core: &mut Core, what: &Rendering<'_>) {
        core.start();
        for i in 0..16_000 {
            let phase = core::f64::consts::TAU * f64::from(i) / 4000.0;
            let v = 14.0 * core::f64::consts::TAU * libm::cos(phase);
            core.step(what, motion(15.0 + 14.0 * libm::sin(phase), v));
        }
    }

    #[test]
    fn a_damper_takes_energy_and_a_negative_one_gives_it() {
        let mut core = Core::new(bare());
        swing(&mut core, &damper(&[0.02; 2]));
        let tally = core.tally();
        assert!(tally.energy_j > 0.1, "{tally:?}");
        assert!(tally.least_energy_j > -1e-3, "{tally:?}");

        swing(&mut core, &damper(&[-0.02; 2]));
        let tally = core.tally();
        assert!(tally.energy_j < -0.1, "{tally:?}");
        assert!(tally.least_energy_j < -0.1, "{tally:?}");
    }

    #[test]
    fn a_trip_is_latched_until_a_new_start() {
        let what = damper(&[0.02; 2]);
        for (bad, why) in [
            (motion(15.0, 1000.5), Trip::Velocity),
            (motion(33.0, 0.0), Trip::Stroke),
            (motion(-3.0, 0.0), Trip::Stroke),
            (motion(f64::NAN, 0.0), Trip::NotANumber),
            (motion(5.0, 0.0), Trip::Encoder),
            (motion(15.0, f64::INFINITY), Trip::NotANumber),
        ] {
            let mut core = Core::new(bare());
            swing(&mut core, &what);
            assert_eq!(core.step(&what, bad), 0.0);
            assert_eq!(core.state(), State::Tripped(why));
            assert_eq!(core.step(&what, motion(15.0, 100.0)), 0.0);
            core.limp();
            assert_eq!(core.state(), State::Tripped(why));
            core.start();
            assert_eq!(core.state(), State::Playing);
        }
    }

    #[test]
    fn a_table_of_no_numbers_trips_and_never_reaches_the_motor() {
        let mut core = Core::new(bare());
        core.start();
        assert_eq!(core.step(&damper(&[f64::NAN; 2]), motion(15.0, 10.0)), 0.0);
        assert_eq!(core.state(), State::Tripped(Trip::NotANumber));
    }

    #[test]
    fn a_limit_that_is_none_is_limp() {
        for force_n in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            let mut core = Core::new(Settings { force_n, ..bare() });
            swing(&mut core, &damper(&[0.05; 2]));
            assert_eq!(core.held_n(), 0.0, "{force_n}");
        }
        let mut core = Core::new(Settings {
            velocity_mm_s: f64::NAN,
            ..bare()
        });
        core.start();
        core.step(&damper(&[0.05; 2]), motion(15.0, 1.0));
        assert_eq!(core.state(), State::Tripped(Trip::Velocity));
    }

    #[test]
    fn the_force_comes_up_over_the_ramp_and_never_faster_than_the_slew_limit() {
        let what = damper(&[0.05; 2]);
        let mut core = Core::new(bare());
        core.start();
        let moving = motion(15.0, 200.0);
        let force: Vec<f64> = (0..2000).map(|_| core.step(&what, moving)).collect();
        assert_eq!(force[0], 0.0);
        assert!((force[800] - 5.0).abs() < 0.02, "{}", force[800]);
        assert!((force[1999] - 10.0).abs() < 1e-9);
        let back = motion(15.0, -200.0);
        let mut last = force[1999];
        for _ in 0..80 {
            let now = core.step(&what, back);
            assert!((now - last).abs() <= 0.5 + 1e-9);
            last = now;
        }
        assert!((last + 10.0).abs() < 1e-9, "{last}");
        assert!(core.tally().slewed > 30);
    }

    #[test]
    fn a_force_far_above_the_limit_comes_back_without_delay() {
        let what = damper(&[1.0; 2]);
        let mut core = Core::new(bare());
        core.start();
        for _ in 0..4000 {
            core.step(&what, motion(15.0, 400.0));
        }
        assert_eq!(core.held_n(), 12.0);
        core.step(&what, motion(15.0, 0.0));
        assert!(core.held_n() < 12.0);
    }

    #[test]
    fn beyond_the_range_a_wall_pushes_back() {
        let what = damper(&NONE);
        let mut core = Core::new(bare());
        core.start();
        let mut force = 0.0;
        for _ in 0..4000 {
            force = core.step(&what, motion(30.5, 0.0));
        }
        assert!((force - 5.0).abs() < 1e-9, "{force}");
        core.start();
        for _ in 0..4000 {
            force = core.step(&what, motion(-0.5, 0.0));
        }
        assert!((force + 5.0).abs() < 1e-9, "{force}");
    }

    #[test]
    fn one_run_into_the_limit_is_one_clamp() {
        let what = damper(&[0.05; 2]);
        let mut core = Core::new(bare());
        core.start();
        for i in 0..4000 {
            // about the limit of 12 N at 240 mm/s
            let v = 240.0 + 5.0 * libm::sin(f64::from(i));
            assert!(core.step(&what, motion(15.0, v)) <= 12.0);
        }
        assert_eq!(core.tally().clamps, 1);
    }

    #[test]
    fn a_mass_below_the_least_is_held_to_it_and_counted() {
        let heavy = [-2.0; 2];
        let branch = BranchView {
            m_kg: &heavy,
            b_n_s_per_mm: &NONE,
            k_n_per_mm: &NONE,
            f0_n: &NONE,
        };
        let mut what = damper(&NONE);
        what.table.positive = branch;
        let pushed = Motion {
            a_m_s2: 5.0,
            ..motion(15.0, 1.0)
        };
        let settle = |least_mass_kg| {
            let mut core = Core::new(Settings {
                least_mass_kg,
                ..bare()
            });
            core.start();
            let force = (0..4000).fold(0.0, |_, _| core.step(&what, pushed));
            (force, core.tally().mass_held)
        };
        let (force, held) = settle(-0.6);
        assert!((force + 3.0).abs() < 1e-6, "{force}");
        assert_eq!(held, 4000);
        let (force, held) = settle(f64::NEG_INFINITY);
        assert!((force + 10.0).abs() < 1e-6, "{force}");
        assert_eq!(held, 0);
    }
}
