use super::*;

/// A plant whose parameters are known: mass, damping, friction, offset, gain and lag of the motor.
#[derive(Debug, Clone, Copy)]
struct Plant {
    mass_kg: f64,
    damping: f64,
    friction_n: f64,
    offset_n: f64,
    gain: f64,
    lag_s: f64,
    encoder_mm: f64,
    /// Stiffness of a hand that holds the handle, N/mm.
    hand_n_per_mm: f64,
}

const PLANT: Plant = Plant {
    mass_kg: 0.5,
    damping: 0.002,
    friction_n: 0.05,
    offset_n: 0.03,
    gain: 1.0,
    lag_s: 0.0,
    encoder_mm: 0.005,
    hand_n_per_mm: 0.0,
};

/// A swing from rest at 10 mm beside the rest of a spring, at 20 kHz, sampled at 1 kHz; the
/// spring sets in within 0.4 s.
fn swing(plant: Plant, stiffness: f64, damping: f64, seconds: f64) -> Vec<Point> {
    swing_from(10.0, plant, stiffness, damping, seconds)
}

fn swing_from(
    from_mm: f64,
    plant: Plant,
    stiffness: f64,
    damping: f64,
    seconds: f64,
) -> Vec<Point> {
    let dt = 5e-5;
    let (mut x, mut v) = (from_mm, 0.0_f64);
    let mut commands = std::collections::VecDeque::new();
    let late = (plant.lag_s / dt).round() as usize;
    let mut points = Vec::new();
    for i in 0..(seconds / dt) as usize {
        let t_s = dt * i as f64;
        let read = (x / plant.encoder_mm).round() * plant.encoder_mm;
        let ramp = 0.5 - 0.5 * (std::f64::consts::PI * (t_s / 0.4).min(1.0)).cos();
        let command_n = ramp * (stiffness * read + damping * v);
        commands.push_back(command_n);
        let given = if commands.len() > late {
            commands.pop_front()
        } else {
            None
        };
        if i % 20 == 0 {
            points.push(Point {
                t_s,
                x_mm: read,
                command_n,
            });
        }
        let driven = -plant.gain * given.unwrap_or(0.0)
            - plant.damping * v
            - plant.offset_n
            - plant.hand_n_per_mm * (x - from_mm);
        let free = v + dt * 1e3 * driven / plant.mass_kg;
        let rubbed = dt * 1e3 * plant.friction_n / plant.mass_kg;
        v = free.signum() * (free.abs() - rubbed).max(0.0);
        x += dt * v;
    }
    points
}

/// On two springs, each there and back: one way alone does not tell friction from a constant force.
fn both(plant: Plant) -> Result<Swing, NoSwing> {
    let of = |from_mm: f64| {
        let soft = swing_from(from_mm, plant, 0.04, 0.001, 2.0);
        [soft, swing_from(from_mm, plant, 0.16, 0.004, 1.5)]
    };
    let [there, back] = [10.0, -10.0].map(of);
    estimate(&[&there[0], &there[1], &back[0], &back[1]])
}

/// Against the parameters of the plant.
#[test]
fn mass_damping_friction_and_lag_are_those_of_the_plant() {
    for (mass_kg, friction_n, offset_n) in [(0.5, 0.05, 0.03), (0.3, 0.02, -0.015), (0.9, 0.1, 0.0)]
    {
        let plant = Plant {
            mass_kg,
            friction_n,
            offset_n,
            damping: 0.004,
            ..PLANT
        };
        let found = both(plant).unwrap();
        let off = [
            found.apparent_kg / mass_kg - 1.0,
            found.damping_n_s_per_mm - 0.004,
            found.friction_n - friction_n,
            found.offset_n - offset_n,
            found.lag_s,
            found.residual_mm,
        ];
        let most = [0.005, 5e-4, 0.005, 0.005, 5e-4, 0.01];
        let near = off.iter().zip(most).all(|(off, most)| off.abs() < most);
        assert!(near, "{plant:?} {found:?}");
    }
}

#[test]
fn a_weak_motor_has_a_heavy_handle_and_a_late_one_its_lag() {
    for gain in [0.5, 0.9, 1.1] {
        for lag_s in [0.0, 0.003, 0.008, 0.02] {
            let plant = Plant {
                gain,
                lag_s,
                ..PLANT
            };
            let found = both(plant).unwrap();
            let own = found.apparent_kg * gain / PLANT.mass_kg;
            assert!((own - 1.0).abs() < 0.02, "{gain} {lag_s}: {found:?}");
            assert!(
                (found.lag_s - lag_s).abs() < 1e-3,
                "{gain} {lag_s}: {found:?}"
            );
            // what a lag that is known tells
            let stiff = swing(plant, 0.16, 0.004, 1.5);
            let alone_kg = apparent_kg(&[&stiff], lag_s).unwrap();
            let own = alone_kg / found.apparent_kg;
            assert!((own - 1.0).abs() < 0.03, "{gain} {lag_s}: {alone_kg}");
        }
    }
}

#[test]
fn a_hand_and_a_handle_that_sticks_are_no_swing_of_its_own() {
    let held = Plant {
        friction_n: 3.0,
        ..PLANT
    };
    assert_eq!(both(held).unwrap_err(), NoSwing::Rests);
    let hand = Plant {
        hand_n_per_mm: 0.3,
        ..PLANT
    };
    let soft = swing(hand, 0.04, 0.001, 2.0);
    let stiff = swing(hand, 0.16, 0.004, 1.5);
    let alone = [&soft, &stiff].map(|one| estimate(&[one]).map(|s| s.apparent_kg));
    // each spring alone tells another mass
    let differ = match alone {
        [Ok(a), Ok(b)] => (a / b - 1.0).abs() > 0.2,
        _ => true,
    };
    assert!(differ, "{alone:?}");
    assert_eq!(estimate(&[&[]]).unwrap_err(), NoSwing::Samples);
    let mut gap = swing(PLANT, 0.04, 0.001, 2.0);
    gap.drain(300..400);
    assert_eq!(estimate(&[&gap]).unwrap_err(), NoSwing::Samples);
}
