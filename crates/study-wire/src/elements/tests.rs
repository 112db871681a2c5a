//! Forces with known answers, and the energy balance under adversarial motions.

use super::*;
use crate::draw::Draw;
use core::f64::consts::TAU;

const NONE: &[f64] = &[];

fn view<'a>(
    x_mm: &'a [f64],
    force_n: &'a [f64],
    damping: [&'a [f64]; 2],
    springs: &'a [Spring],
    spring_n: &[&'a [f64]],
) -> ElementsView<'a> {
    let mut all = [NONE; MAX_SPRINGS];
    all[..spring_n.len()].copy_from_slice(spring_n);
    ElementsView {
        x_mm,
        mass_kg: 0.0,
        force_n,
        damping_n_s_per_mm: damping,
        springs,
        spring_n: all,
    }
}

/// A motion at constant speed to a position; the last force.
fn sweep(of: &ElementsView<'_>, state: &mut State, to_mm: f64, v_mm_s: f64, dt_s: f64) -> f64 {
    let from_mm = state.x_mm;
    let steps = ((to_mm - from_mm) / (v_mm_s * dt_s)).round() as i32;
    let mut force_n = 0.0;
    for i in 1..=steps {
        let x_mm = from_mm + v_mm_s * dt_s * f64::from(i);
        let motion = Motion {
            x_mm,
            v_mm_s,
            a_m_s2: 0.0,
        };
        force_n = state.step(of, motion, dt_s);
    }
    force_n
}

#[test]
fn a_stop_is_a_spring_and_then_friction() {
    let springs = [Spring::Stop { slip_mm: 0.5 }];
    let of = view(
        &[0.0, 20.0],
        &[0.0; 2],
        [&[0.0; 2]; 2],
        &springs,
        &[&[2.0; 2]],
    );
    let mut state = State::at_rest(&of, 5.0);
    let force = sweep(&of, &mut state, 5.25, 10.0, 1e-3);
    assert!((force - 1.0).abs() < 1e-9, "{force}");
    let force = sweep(&of, &mut state, 9.0, 10.0, 1e-3);
    assert!((force - 2.0).abs() < 1e-9, "{force}");
    // back by one deflection: no force
    let force = sweep(&of, &mut state, 8.5, -10.0, 1e-3);
    assert!(force.abs() < 1e-9, "{force}");
}

/// F = k v τ (1 − e^(−t/τ)) at constant speed, whatever the step is, and then e^(−t/τ).
#[test]
fn a_maxwell_branch_has_the_exact_force_at_any_rate() {
    let springs = [Spring::Maxwell {
        slip_mm: 10.0,
        relaxation_s: 0.05,
    }];
    // 3 N/mm
    let of = view(
        &[0.0, 20.0],
        &[0.0; 2],
        [&[0.0; 2]; 2],
        &springs,
        &[&[30.0; 2]],
    );
    for dt_s in [1e-4, 1e-3, 1e-2] {
        let mut state = State::at_rest(&of, 5.0);
        let force = sweep(&of, &mut state, 7.0, 20.0, dt_s);
        let expected = 3.0 * 20.0 * 0.05 * (1.0 - (-0.1_f64 / 0.05).exp());
        assert!((force - expected).abs() < 1e-9, "{dt_s}: {force}");
        for _ in 0..(0.1 / dt_s) as usize {
            state.step(&of, Motion::at_rest(7.0), dt_s);
        }
        let force = state.step(&of, Motion::at_rest(7.0), dt_s);
        let left = expected * (-(0.1 + dt_s) / 0.05).exp();
        assert!((force - left).abs() < 1e-6, "{dt_s}: {force} {left}");
    }
}

#[test]
fn a_latch_breaks_and_holds_again() {
    let springs = [Spring::Latch {
        rearm_mm: 2.0,
        break_mm: 4.0,
    }];
    let of = view(
        &[0.0, 10.0],
        &[1.0; 2],
        [&[0.0; 2]; 2],
        &springs,
        &[&[3.0; 2]],
    );
    let mut state = State::at_rest(&of, 0.0);
    for (to, force) in [
        (3.9, 4.0),
        (2.5, 4.0),
        (4.1, 1.0),
        (2.1, 1.0),
        (1.9, 4.0),
        (3.0, 4.0),
    ] {
        let v = if to > state.x_mm { 10.0 } else { -10.0 };
        let found = sweep(&of, &mut state, to, v, 1e-3);
        assert!((found - force).abs() < 1e-9, "{to}: {found}");
    }
}

#[test]
fn a_certificate_names_what_is_negative() {
    let x = [0.0, 1.0, 2.0];
    let springs = [Spring::Stop { slip_mm: 0.5 }];
    let one = [1.0; 3];
    let of = |damping: &'static [f64], spring: &'static [f64]| {
        let of = ElementsView {
            x_mm: &x,
            mass_kg: 0.1,
            force_n: &[0.0, 1.0, 0.0],
            damping_n_s_per_mm: [&one, damping],
            springs: &springs,
            spring_n: [spring, NONE, NONE, NONE, NONE],
        };
        of.certificate(100.0)
    };
    let good = of(&[0.0; 3], &[0.0, 2.0, 1.0]);
    assert!(good.passes(), "{good}");
    // 1 N/mm of the potential and 2 N/mm of the profile; 2 N over 0.5 mm
    assert_eq!(good.stiffness_n_per_mm, 3.0);
    assert_eq!(good.state_n_per_mm, Some(4.0));
    assert_eq!(good.damping_n_s_per_mm, 1.0);
    assert_eq!(of(&[0.0, -0.2, 0.0], &[0.0; 3]).damping.value, -0.2);
    let bad = of(&[0.0; 3], &[0.0, 0.0, -0.3]);
    assert_eq!((bad.hysteresis.value, bad.hysteresis.at_mm), (-0.3, 2.0));
    assert!(!bad.passes());
    assert!(!of(&[0.0; 3], &[0.0, f64::NAN, 0.0]).passes());
}

#[test]
fn a_latch_has_to_release_more_than_a_step_can_draw() {
    let of = |break_mm: f64, trained_mm_s: f64| {
        let springs = [Spring::Latch {
            rearm_mm: 2.0,
            break_mm,
        }];
        let of = view(
            &[0.0, 3.0, 10.0],
            &[0.0; 3],
            [&[0.0; 3]; 2],
            &springs,
            &[&[3.0; 3]],
        );
        of.certificate(trained_mm_s).hysteresis.value
    };
    // 1 mm of 3 N: half of 3 N·mm over 0.4 mm, minus 3 N
    assert!((of(3.0, 800.0) - (1.5 / 0.4 - 3.0)).abs() < 1e-9);
    // 1.5 mm over two intervals
    assert!((of(3.5, 1000.0) - (2.25 / 0.5 - 3.0)).abs() < 1e-9);
    // the least force of the profile, where the latch has more than it needs
    assert!((of(4.0, 200.0) - 3.0).abs() < 1e-9);
    // a step of 0.1 mm is more than half of 0.15 mm
    assert!(of(2.15, 200.0) < 0.0);
}

/// A realization of all kinds of springs, with profiles that vary from node to node.
struct Random {
    x_mm: Vec<f64>,
    profiles: Vec<Vec<f64>>,
    springs: Vec<Spring>,
}

impl Random {
    fn new(draw: &mut Draw) -> Self {
        let mut x_mm = vec![0.0];
        while x_mm[x_mm.len() - 1] < 20.0 {
            x_mm.push(x_mm[x_mm.len() - 1] + draw.within(0.1, 2.0));
        }
        let springs = (0..MAX_SPRINGS)
            .map(|_| {
                let slip_mm = draw.within(0.02, 3.0);
                match (3.0 * draw.unit()) as u8 {
                    0 => Spring::Stop { slip_mm },
                    1 => Spring::Maxwell {
                        slip_mm,
                        relaxation_s: draw.within(3e-4, 0.5),
                    },
                    _ => {
                        let rearm_mm = draw.within(3.0, 12.0);
                        Spring::Latch {
                            rearm_mm,
                            break_mm: rearm_mm + draw.within(2.0, 5.0),
                        }
                    }
                }
            })
            .collect();
        let mut profile = |low: f64, high: f64| -> Vec<f64> {
            // whatever may be 0 is 0 now and then
            let value = |draw: &mut Draw| draw.within(low, high).max(low.max(-9.0));
            (x_mm.iter())
                .map(|_| match draw.unit() < 0.3 && low == 0.0 {
                    true => 0.0,
                    false => value(draw),
                })
                .collect()
        };
        let mut profiles = vec![profile(-6.0, 6.0), profile(0.0, 0.01), profile(0.0, 0.01)];
        profiles.extend((0..MAX_SPRINGS).map(|_| profile(0.0, 4.0)));
        Self {
            x_mm,
            profiles,
            springs,
        }
    }

    fn view(&self) -> ElementsView<'_> {
        let p: Vec<&[f64]> = self.profiles.iter().map(Vec::as_slice).collect();
        view(&self.x_mm, p[0], [p[1], p[2]], &self.springs, &p[3..])
    }

    /// ∫ of a profile from `from` to `to` with a weight w(ξ) linear between the breaks, by
    /// Simpson's rule between all nodes, which is exact for cubic functions.
    fn integral(&self, profile: usize, from: f64, to: f64, weight: impl Fn(f64) -> f64) -> f64 {
        let [low, high] = [from.min(to), from.max(to)];
        let mut at: Vec<f64> = (self.x_mm.iter().copied())
            .filter(|x| *x > low && *x < high)
            .collect();
        at.insert(0, low);
        at.push(high);
        let of = |x: f64| {
            let (left, share) = locate(&self.x_mm, Lookup::Linear, x);
            between(&self.profiles[profile], left, share) * weight(x)
        };
        let parts = at.windows(2).map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            (b - a) / 6.0 * (of(a) + 4.0 * of(0.5 * (a + b)) + of(b))
        });
        let sum: f64 = parts.sum();
        if to < from { -sum } else { sum }
    }

    /// The stored energy of docs/estimators.md, N·mm.
    fn stored_n_mm(&self, state: &State, dt_s: f64) -> f64 {
        let x = state.x_mm;
        let mut energy = self.integral(0, 0.0, x, |_| 1.0);
        for (i, (spring, z)) in self.springs.iter().zip(state.z()).enumerate() {
            energy += match *spring {
                Spring::Latch { rearm_mm, break_mm } => {
                    let all = self.integral(3 + i, rearm_mm, break_mm, |_| 1.0);
                    z * (self.integral(3 + i, rearm_mm, x, |_| 1.0) - 0.5 * all)
                }
                Spring::Stop { slip_mm } | Spring::Maxwell { slip_mm, .. } => {
                    let gain = match *spring {
                        Spring::Maxwell { relaxation_s, .. } => {
                            let share = dt_s / relaxation_s;
                            (1.0 - (-share).exp()) / share
                        }
                        _ => 1.0,
                    };
                    let long_mm = slip_mm / gain;
                    let anchor_mm = x - long_mm * z;
                    self.integral(3 + i, anchor_mm, x, |at| (at - anchor_mm) / long_mm)
                }
            };
        }
        energy
    }
}

/// What the hand does next, mm: waves, noise, and motions that follow the force so as to draw
/// as much energy as they can.
fn move_mm(kind: u64, draw: &mut Draw, i: usize, force_n: f64, most: f64) -> f64 {
    let along = -force_n.signum();
    match kind {
        0 => most * (0.02 * i as f64 * TAU).sin(),
        1 => most * if draw.unit() < 0.5 { 1.0 } else { -1.0 },
        2 => most * draw.within(-1.0, 1.0),
        3 => most * along,
        4 => most * along * draw.unit(),
        5 if i % 8 < 5 => -0.2 * most * along,
        5 => most * along,
        // whole strokes through the latches
        _ => {
            most * if (i / 60).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            }
        }
    }
}

/// In every step of the motions, a third each at 1, 4 and 10 kHz the stored energy rises by no more than the
/// hand supplies; with `without` the drag that this needs is left out.
fn worst_rise(without: bool, motions: u64) -> (f64, f64) {
    let mut draw = Draw(11);
    let (mut worst, mut drawn) = (f64::NEG_INFINITY, 0.0_f64);
    for motion in 0..motions {
        let random = Random::new(&mut draw);
        let of = random.view();
        let dt_s = [1e-3, 0.25e-3, 1e-4][(motion % 3) as usize];
        // a latch is certified up to this way in a step
        let most = draw.within(0.001, 0.3);
        let mut state = State::at_rest(&of, draw.within(2.0, 18.0));
        let mut force_n = 0.0;
        let mut before: Option<f64> = None;
        for i in 0..200 {
            let by = move_mm(motion % 7, &mut draw, i, force_n, most);
            let x_mm = (state.x_mm + by).clamp(0.0, 20.0);
            let moved = x_mm - state.x_mm;
            let kinds: Vec<f64> = state.z().to_vec();
            let motion = Motion {
                x_mm,
                // the speed of a filter may well be another one
                v_mm_s: moved / dt_s * draw.within(0.0, 1.5),
                a_m_s2: 0.0,
            };
            let (was, _) = locate(of.x_mm, Lookup::Linear, state.x_mm);
            force_n = state.step(&of, motion, dt_s);
            if without {
                let (is, _) = locate(of.x_mm, Lookup::Linear, x_mm);
                force_n -= 0.5 * of.most_falling_n_per_mm(was, is) * moved;
            }
            let after = random.stored_n_mm(&state, dt_s);
            let supplied = force_n * moved;
            if let Some(before) = before {
                let rounding = 1e-9 * (1.0 + after.abs() + supplied.abs());
                let rise = after - before - supplied - rounding;
                if rise > worst {
                    worst = rise;
                }
                assert!(
                    without || rise <= 0.0,
                    "motion {}, step {i}: {rise}, {kinds:?} {:?} {:?}",
                    motion.x_mm,
                    state.z(),
                    random.springs
                );
            }
            drawn = drawn.min(supplied);
            before = Some(after);
        }
    }
    (worst, drawn)
}

#[test]
fn no_motion_draws_more_energy_than_is_stored() {
    let (_, drawn) = worst_rise(false, 10_000);
    // the motions did try
    assert!(drawn < -0.1, "{drawn}");
}

/// Without the least drag a falling force supplies energy: the test above can fail.
#[test]
fn the_least_drag_is_needed() {
    let (worst, _) = worst_rise(true, 200);
    assert!(worst > 1e-3, "{worst}");
}

#[test]
fn single_precision_agrees() {
    let mut draw = Draw(5);
    let random = Random::new(&mut draw);
    let of = random.view();
    let single = |values: &[f64]| values.iter().map(|v| *v as f32).collect::<Vec<f32>>();
    let x = single(&random.x_mm);
    let profiles: Vec<Vec<f32>> = random.profiles.iter().map(|p| single(p)).collect();
    let mut spring_n: [&[f32]; MAX_SPRINGS] = [&[]; MAX_SPRINGS];
    for (to, from) in spring_n.iter_mut().zip(&profiles[3..]) {
        *to = from;
    }
    let narrow = ElementsView::<f32> {
        x_mm: &x,
        mass_kg: 0.0,
        force_n: &profiles[0],
        damping_n_s_per_mm: [&profiles[1], &profiles[2]],
        springs: &random.springs,
        spring_n,
    };
    let start = 1.0_f32;
    let mut wide_state = State::at_rest(&of, f64::from(start));
    let mut narrow_state = State::at_rest(&narrow, start);
    let (dt_s, mut worst) = (1e-4_f32, 0.0_f64);
    for i in 0..300_000 {
        let t = f64::from(dt_s) * f64::from(i);
        let x_mm = (1.0 + 8.5 * (1.0 - (TAU * 0.2 * t).cos())) as f32;
        let v = (8.5 * TAU * 0.2 * (TAU * 0.2 * t).sin()) as f32;
        let motion = Motion {
            x_mm,
            v_mm_s: v,
            a_m_s2: 0.0,
        };
        let wide = wide_state.step(&of, motion.f64(), f64::from(dt_s));
        let force = narrow_state.step(&narrow, motion, dt_s);
        worst = worst.max((wide - f64::from(force)).abs());
    }
    assert!(worst < 1e-3, "{worst}");
}
