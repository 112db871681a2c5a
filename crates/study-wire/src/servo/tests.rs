//! Trips, limits and the wall of the servo.

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
        law: Law::Table {
            table: TableView {
                x_mm: &NODES,
                positive: branch,
                negative: branch,
                lookup: Lookup::Linear,
            },
            rule: Direction::Sign,
        },
        range_mm: NODES,
        trained_mm_s: 500.0,
    }
}

/// The table of a rendering.
fn table<'a, 'b>(what: &'b mut Rendering<'a>) -> &'b mut TableView<'a> {
    match &mut what.law {
        Law::Table { table, .. } => table,
        Law::Mechanism(_) | Law::Elements(_) => panic!("no table"),
    }
}

fn bare() -> ServoSettings {
    ServoSettings {
        damping_n_s_per_mm: 0.0,
        ..ServoSettings::default()
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
fn swing(servo: &mut Servo, what: &Rendering<'_>) {
    servo.start();
    for i in 0..16_000 {
        let phase = core::f64::consts::TAU * f64::from(i) / 4000.0;
        let v = 14.0 * core::f64::consts::TAU * libm::cos(phase);
        servo.step(what, motion(15.0 + 14.0 * libm::sin(phase), v));
    }
}

#[test]
fn a_damper_absorbs_energy_and_a_negative_one_supplies_it() {
    let mut servo = Servo::new(bare());
    swing(&mut servo, &damper(&[0.02; 2]));
    let tally = servo.tally();
    assert!(tally.energy_j > 0.1, "{tally:?}");
    assert!(tally.least_energy_j > -1e-3, "{tally:?}");

    swing(&mut servo, &damper(&[-0.02; 2]));
    let tally = servo.tally();
    assert!(tally.energy_j < -0.1, "{tally:?}");
    assert!(tally.least_energy_j < -0.1, "{tally:?}");
}

#[test]
fn a_trip_is_latched_until_a_new_start() {
    let what = damper(&[0.02; 2]);
    for (bad, cause) in [
        (motion(15.0, 1000.5), Trip::Velocity),
        (motion(33.0, 0.0), Trip::Stroke),
        (motion(-3.0, 0.0), Trip::Stroke),
        (motion(f64::NAN, 0.0), Trip::NotANumber),
        (motion(5.0, 0.0), Trip::Encoder),
        (motion(15.0, f64::INFINITY), Trip::NotANumber),
    ] {
        let mut servo = Servo::new(bare());
        swing(&mut servo, &what);
        assert_eq!(servo.step(&what, bad), 0.0);
        assert_eq!(servo.state(), ServoState::Tripped(cause));
        assert_eq!(servo.step(&what, motion(15.0, 100.0)), 0.0);
        servo.limp();
        assert_eq!(servo.state(), ServoState::Tripped(cause));
        servo.start();
        assert_eq!(servo.state(), ServoState::Playing);
    }
}

#[test]
fn a_table_that_is_not_finite_trips_before_it_reaches_the_motor() {
    let mut servo = Servo::new(bare());
    servo.start();
    assert_eq!(servo.step(&damper(&[f64::NAN; 2]), motion(15.0, 10.0)), 0.0);
    assert_eq!(servo.state(), ServoState::Tripped(Trip::NotANumber));
}

#[test]
fn an_invalid_limit_gives_zero_force() {
    for force_n in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        let mut servo = Servo::new(ServoSettings { force_n, ..bare() });
        swing(&mut servo, &damper(&[0.05; 2]));
        assert_eq!(servo.held_n(), 0.0, "{force_n}");
    }
    let mut servo = Servo::new(ServoSettings {
        velocity_mm_s: f64::NAN,
        ..bare()
    });
    servo.start();
    servo.step(&damper(&[0.05; 2]), motion(15.0, 1.0));
    assert_eq!(servo.state(), ServoState::Tripped(Trip::Velocity));
}

#[test]
fn the_force_comes_up_over_the_ramp_and_never_faster_than_the_slew_limit() {
    let what = damper(&[0.05; 2]);
    let mut servo = Servo::new(bare());
    servo.start();
    let moving = motion(15.0, 200.0);
    let force: Vec<f64> = (0..2000).map(|_| servo.step(&what, moving)).collect();
    assert_eq!(force[0], 0.0);
    assert!((force[800] - 5.0).abs() < 0.02, "{}", force[800]);
    assert!((force[1999] - 10.0).abs() < 1e-9);
    let back = motion(15.0, -200.0);
    let mut last = force[1999];
    for _ in 0..80 {
        let now = servo.step(&what, back);
        assert!((now - last).abs() <= 0.5 + 1e-9);
        last = now;
    }
    assert!((last + 10.0).abs() < 1e-9, "{last}");
    assert!(servo.tally().slewed > 30);
}

#[test]
fn a_force_far_above_the_limit_returns_without_delay() {
    let what = damper(&[1.0; 2]);
    let mut servo = Servo::new(bare());
    servo.start();
    for _ in 0..4000 {
        servo.step(&what, motion(15.0, 400.0));
    }
    assert_eq!(servo.held_n(), 12.0);
    servo.step(&what, motion(15.0, 0.0));
    assert!(servo.held_n() < 12.0);
}

#[test]
fn beyond_the_range_the_wall_pushes_back() {
    let what = damper(&NONE);
    let mut servo = Servo::new(bare());
    servo.start();
    let mut force = 0.0;
    for _ in 0..4000 {
        force = servo.step(&what, motion(30.5, 0.0));
    }
    assert!((force - 5.0).abs() < 1e-9, "{force}");
    servo.start();
    for _ in 0..4000 {
        force = servo.step(&what, motion(-0.5, 0.0));
    }
    assert!((force + 5.0).abs() < 1e-9, "{force}");
}

#[test]
fn noise_around_the_limit_is_one_clamp() {
    let what = damper(&[0.05; 2]);
    let mut servo = Servo::new(bare());
    servo.start();
    for i in 0..4000 {
        // about the limit of 12 N at 240 mm/s
        let v = 240.0 + 5.0 * libm::sin(f64::from(i));
        assert!(servo.step(&what, motion(15.0, v)) <= 12.0);
    }
    assert_eq!(servo.tally().clamps, 1);
}

#[test]
fn a_mass_below_the_smallest_is_limited_and_counted() {
    let heavy = [-2.0; 2];
    let branch = BranchView {
        m_kg: &heavy,
        b_n_s_per_mm: &NONE,
        k_n_per_mm: &NONE,
        f0_n: &NONE,
    };
    let mut what = damper(&NONE);
    table(&mut what).positive = branch;
    let pushed = Motion {
        a_m_s2: 5.0,
        ..motion(15.0, 1.0)
    };
    let settle = |least_mass_kg| {
        let mut servo = Servo::new(ServoSettings {
            least_mass_kg,
            ..bare()
        });
        servo.start();
        let force = (0..4000).fold(0.0, |_, _| servo.step(&what, pushed));
        (force, servo.tally().mass_held)
    };
    let (force, held) = settle(-0.6);
    assert!((force + 3.0).abs() < 1e-6, "{force}");
    assert_eq!(held, 4000);
    let (force, held) = settle(f64::NEG_INFINITY);
    assert!((force + 10.0).abs() < 1e-6, "{force}");
    assert_eq!(held, 0);
}

/// The force after the ramp for one constant motion, N.
fn settled(what: &Rendering<'_>, settings: ServoSettings, constant: Motion) -> f64 {
    let mut servo = Servo::new(settings);
    servo.start();
    (0..4000).fold(0.0, |_, _| servo.step(what, constant))
}

/// The wall's damping may weaken its push, but never pull the handle outwards.
#[test]
fn the_wall_never_pulls() {
    let what = damper(&NONE);
    // 0.1 mm beyond: 1 N of spring, ∓2 N of damping while the handle returns
    assert_eq!(settled(&what, bare(), motion(30.1, -200.0)), 0.0);
    assert_eq!(settled(&what, bare(), motion(-0.1, 200.0)), 0.0);
    // on the way out both push back
    assert!((settled(&what, bare(), motion(30.1, 200.0)) - 3.0).abs() < 1e-9);
    assert!((settled(&what, bare(), motion(-0.1, -200.0)) + 3.0).abs() < 1e-9);
}

/// Just inside each limit the servo plays, just outside it trips.
#[test]
fn trips_have_the_stated_limits() {
    let what = damper(&NONE);
    for (first, second, expected) in [
        (motion(15.0, 0.0), motion(15.0, 999.9), None),
        (
            motion(15.0, 0.0),
            motion(15.0, -1000.1),
            Some(Trip::Velocity),
        ),
        (motion(32.4, 0.0), motion(32.49, 0.0), None),
        (motion(32.4, 0.0), motion(32.51, 0.0), Some(Trip::Stroke)),
        (motion(-2.4, 0.0), motion(-2.49, 0.0), None),
        (motion(-2.4, 0.0), motion(-2.51, 0.0), Some(Trip::Stroke)),
        (motion(15.0, 0.0), motion(15.99, 0.0), None),
        (motion(15.0, 0.0), motion(16.01, 0.0), Some(Trip::Encoder)),
        (motion(15.0, 0.0), motion(13.99, 0.0), Some(Trip::Encoder)),
    ] {
        let mut servo = Servo::new(bare());
        servo.start();
        servo.step(&what, first);
        servo.step(&what, second);
        let expected = expected.map_or(ServoState::Playing, ServoState::Tripped);
        assert_eq!(servo.state(), expected, "{second:?}");
    }
}

#[test]
fn the_speed_is_limited_to_the_trained_one_and_the_position_to_the_range() {
    let what = damper(&[0.01; 2]);
    // trained at 500 mm/s
    assert!((settled(&what, bare(), motion(15.0, 900.0)) - 5.0).abs() < 1e-9);
    assert!((settled(&what, bare(), motion(15.0, -900.0)) + 5.0).abs() < 1e-9);
    let stiffness = [0.1; 2];
    let branch = BranchView {
        k_n_per_mm: &stiffness,
        ..table(&mut damper(&NONE)).positive
    };
    let mut spring = damper(&NONE);
    (table(&mut spring).positive, table(&mut spring).negative) = (branch, branch);
    // 3 N at the edge, 5 N of wall, and no extrapolated spring
    assert!((settled(&spring, bare(), motion(30.5, 0.0)) - 8.0).abs() < 1e-9);
}

#[test]
fn the_device_adds_its_own_damping() {
    let force_n = settled(
        &damper(&NONE),
        ServoSettings::default(),
        motion(15.0, 100.0),
    );
    assert!((force_n - 0.2).abs() < 1e-9, "{force_n}");
}

/// A step of the acceleration reaches the force only through the low-pass.
#[test]
fn the_acceleration_is_filtered() {
    let mass = [1.0; 2];
    let branch = BranchView {
        m_kg: &mass,
        ..table(&mut damper(&NONE)).positive
    };
    let mut what = damper(&NONE);
    (table(&mut what).positive, table(&mut what).negative) = (branch, branch);
    let settings = ServoSettings {
        ramp_s: 0.0,
        ..bare()
    };
    let mut servo = Servo::new(settings);
    servo.start();
    let accelerated = Motion {
        a_m_s2: 5.0,
        ..motion(15.0, 0.0)
    };
    let first: Vec<f64> = (0..4).map(|_| servo.step(&what, accelerated)).collect();
    assert!(first.iter().all(|force_n| *force_n < 0.1), "{first:?}");
    let settled_n = (0..4000).fold(0.0, |_, _| servo.step(&what, accelerated));
    assert!((settled_n - 5.0).abs() < 1e-6, "{settled_n}");
}

/// The force stays small at first: a quarter of the ramp gives less than 15 %.
#[test]
fn the_ramp_is_smooth_and_starts_anew_with_each_playback() {
    let what = damper(&[0.05; 2]);
    let mut servo = Servo::new(bare());
    for _ in 0..2 {
        servo.start();
        let force: Vec<f64> = (0..2000)
            .map(|_| servo.step(&what, motion(15.0, 200.0)))
            .collect();
        assert_eq!(force[0], 0.0);
        assert!(force[400] < 1.5, "{}", force[400]);
        assert!(force[1599] > 9.99, "{}", force[1599]);
    }
}

/// A servo that was not started, or was stopped, commands nothing.
#[test]
fn only_a_started_servo_has_force() {
    let what = damper(&[0.05; 2]);
    let mut servo = Servo::new(bare());
    assert_eq!(servo.step(&what, motion(15.0, 200.0)), 0.0);
    swing(&mut servo, &what);
    assert_ne!(servo.held_n(), 0.0);
    servo.limp();
    assert_eq!(servo.held_n(), 0.0);
    assert_eq!(servo.step(&what, motion(15.0, 200.0)), 0.0);
    assert_eq!(servo.state(), ServoState::Limp);
}

/// Ten thousand changes by one step of a ladder, as while a level is set: a stop, the next table, a start. The force comes up
/// from nothing and changes by 2 N/ms at most, also where the hand turns at once.
#[test]
fn ten_thousand_changes_of_table_come_up_from_nothing() {
    let levels: Vec<[f64; 2]> = (0..21).map(|n| [0.03 + 0.001 * f64::from(n); 2]).collect();
    let mut servo = Servo::new(bare());
    let mut fastest_n = 0.0_f64;
    for change in 0..10_000_usize {
        // Up the ladder and down again.
        let at = change % 40;
        let what = damper(&levels[at.min(40 - at)]);
        assert_eq!(servo.held_n(), 0.0);
        servo.start();
        let mut last_n = 0.0;
        // The ramp and 25 ms more; the hand turns every 37.5 ms.
        for period in 0..1700_usize {
            let v_mm_s = if (period / 150 + change).is_multiple_of(2) {
                200.0
            } else {
                -200.0
            };
            let now_n = servo.step(&what, motion(15.0, v_mm_s));
            fastest_n = fastest_n.max((now_n - last_n).abs());
            last_n = now_n;
        }
        assert_eq!(servo.state(), ServoState::Playing);
        servo.limp();
    }
    // Of a period of 0.25 ms; where both rise, the ramp adds less than a thousandth.
    assert!((0.4..=0.5 * 1.001).contains(&fastest_n), "{fastest_n}");
}

/// A constant force of the damper at a constant speed, after the ramp.
fn at_full_force(settings: ServoSettings, what: &Rendering<'_>) -> (Servo, f64) {
    let mut servo = Servo::new(settings);
    servo.start();
    let mut force_n = 0.0;
    for _ in 0..4000 {
        force_n = servo.step(what, motion(15.0, 200.0));
    }
    (servo, force_n)
}

#[test]
fn a_force_falls_by_half_a_cosine_over_the_time_of_the_ramp() {
    let what = damper(&[0.05; 2]);
    let (mut servo, whole_n) = at_full_force(bare(), &what);
    assert!((whole_n - 10.0).abs() < 1e-9);
    assert_eq!(bare().fade_periods(), 1600);
    servo.fade();
    assert!(!servo.faded());
    for period in 1..=1600 {
        if period == 700 {
            servo.fade();
        }
        let force_n = servo.step(&what, motion(15.0, 200.0));
        let part = f64::from(period) / 1600.0;
        let expected_n = 5.0 + 5.0 * libm::cos(core::f64::consts::PI * part);
        assert!((force_n - expected_n).abs() < 1e-9, "{period}: {force_n}");
        assert_eq!(servo.faded(), period == 1600, "{period}");
    }
    assert_eq!(servo.held_n(), 0.0);
    assert_eq!(servo.step(&what, motion(15.0, 200.0)), 0.0);
    servo.start();
    assert!(!servo.faded());
}

/// 400 N within 0.1 s would pass 2 N/ms, which it may not: π/2 · 400 N over 2000 N/s.
#[test]
fn a_large_force_falls_no_faster_than_the_slew_limit() {
    let settings = ServoSettings {
        force_n: 400.0,
        ramp_s: 0.1,
        ..bare()
    };
    let what = damper(&[2.0; 2]);
    let (mut servo, whole_n) = at_full_force(settings, &what);
    assert!((whole_n - 400.0).abs() < 1e-9);
    let steepest_s = core::f64::consts::FRAC_PI_2 * 400.0 / 2000.0;
    assert_eq!(
        settings.fade_periods(),
        libm::ceil(4000.0 * steepest_s) as u32
    );
    servo.fade();
    let (mut last_n, mut largest_n) = (whole_n, 0.0_f64);
    while !servo.faded() {
        let force_n = servo.step(&what, motion(15.0, 200.0));
        largest_n = largest_n.max((force_n - last_n).abs());
        last_n = force_n;
    }
    assert!(largest_n <= 0.5 && largest_n > 0.499, "{largest_n}");
    for force_n in [f64::NAN, f64::INFINITY] {
        let invalid = ServoSettings { force_n, ..bare() };
        assert_eq!(invalid.fade_periods(), 1600);
    }
}

/// A force whose size falls gives back no more than the springs held when it began to fall: of a
/// passive table λ(t) S(x) with λ falling and the potential V(x) ≥ 0 of S the hand puts in at least
/// the change of λ V.
#[test]
fn a_fall_supplies_no_more_than_the_springs_hold() {
    const SPRING: [f64; 2] = [0.2; 2];
    const OFFSET: [f64; 2] = [-3.0; 2];
    let branch = BranchView {
        m_kg: &NONE,
        b_n_s_per_mm: &NONE,
        k_n_per_mm: &SPRING,
        f0_n: &OFFSET,
    };
    let mut what = damper(&NONE);
    (table(&mut what).positive, table(&mut what).negative) = (branch, branch);
    let mut least_j = f64::INFINITY;
    for phase in 0..40 {
        for cycles in [0.3, 1.0, 2.5, 5.0] {
            let mut servo = Servo::new(bare());
            servo.start();
            let at = |period: i32| {
                let turns = cycles * f64::from(period) / 1600.0 + f64::from(phase) / 40.0;
                let turn = core::f64::consts::TAU * turns;
                let speed = 4000.0 * 12.0 * core::f64::consts::TAU * cycles / 1600.0;
                motion(15.0 + 12.0 * libm::sin(turn), speed * libm::cos(turn))
            };
            for period in -3200..0 {
                servo.step(&what, at(period));
            }
            let before_j = servo.tally().energy_j;
            let held_j = 0.5 * 0.2e-3 * (at(0).x_mm - 15.0) * (at(0).x_mm - 15.0);
            servo.fade();
            for period in 0..1600 {
                servo.step(&what, at(period));
            }
            assert!(servo.faded() && servo.state() == ServoState::Playing);
            least_j = least_j.min(servo.tally().energy_j - before_j + held_j);
        }
    }
    assert!(least_j > -1e-4, "{least_j}");
}

/// A hand with 5 N against the wall goes through it when the wall falls, and a playback that was to end
/// does not end with a fault.
#[test]
fn a_hand_that_leans_against_the_wall_goes_through_it_without_a_trip() {
    let what = damper(&NONE);
    let pressed = |fades: bool| {
        let mut servo = Servo::new(bare());
        servo.start();
        // Half a millimeter of the wall.
        for _ in 0..4000 {
            servo.step(&what, motion(30.5, 0.0));
        }
        assert!((servo.held_n() - 5.0).abs() < 1e-9);
        if fades {
            servo.fade();
        }
        // 10 mm/s.
        let at = |period: i32| motion(30.5 + 0.0025 * f64::from(period), 10.0);
        let forces_n: Vec<f64> = (1..=1600).map(|n| servo.step(&what, at(n))).collect();
        (servo, forces_n)
    };
    let (servo, forces_n) = pressed(true);
    assert_eq!(servo.state(), ServoState::Playing);
    assert!(servo.faded());
    // 32.5 mm are reached after 800 periods, and are still in the overtravel.
    let gone = forces_n.iter().position(|n| *n == 0.0).unwrap();
    assert!((799..=801).contains(&gone), "{gone}");
    assert!(forces_n[gone..].iter().all(|n| *n == 0.0));
    // 5 to 12 N, which is the limit, by half.
    assert!(
        (5.0..=6.1).contains(&forces_n[gone - 1]),
        "{}",
        forces_n[gone - 1]
    );

    let (servo, _) = pressed(false);
    assert_eq!(servo.state(), ServoState::Tripped(Trip::Stroke));

    // What else trips does so during a fall.
    for (bad, cause) in [
        (motion(15.0, 1001.0), Trip::Velocity),
        (motion(40.0, 0.0), Trip::Encoder),
        (motion(f64::NAN, 0.0), Trip::NotANumber),
    ] {
        let mut servo = Servo::new(bare());
        servo.start();
        servo.step(&what, motion(15.0, 0.0));
        servo.fade();
        assert_eq!(servo.step(&what, bad), 0.0);
        assert_eq!(servo.state(), ServoState::Tripped(cause));
    }
}
