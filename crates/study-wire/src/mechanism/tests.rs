//! Forces with known answers, and the energy balance under adversarial motions.

use super::*;
use crate::draw::Draw;
use crate::predict::Motion;
use crate::sum::Sum;
use core::f64::consts::TAU;

/// A switch of three detents of 12 mm and 5 N, with a node every 0.5 mm.
fn detents() -> Vec<f64> {
    (0..=64)
        .map(|i| 5.0 * (TAU * 0.5 * f64::from(i) / 12.0).sin())
        .collect()
}

fn scalars() -> Scalars {
    Scalars {
        handle_kg: 0.1,
        follower_kg: 0.14,
        contact_n_per_mm: 15.0,
        contact_n_s_per_mm: 0.012,
        gap_mm: 0.8,
        follower_n_s_per_mm: 0.006,
        slip_mm: 0.06,
        stribeck: 0.35,
        stribeck_mm_s: 8.0,
        handle_n: 0.25,
        handle_slip_mm: 0.06,
        handle_n_s_per_mm: 0.001,
        offset_n: 0.3,
    }
}

fn mechanism<'a>(scalars: Scalars, detent: &'a [f64], friction: &'a [f64]) -> MechanismView<'a> {
    let profile = |n, step_mm| Profile {
        first_mm: 0.0,
        step_mm,
        n,
    };
    MechanismView::new(scalars, profile(detent, 0.5), profile(friction, 4.0))
}

/// Moves the handle from `from` to `to` at `speed`; the forces.
fn sweep(of: &MechanismView<'_>, state: &mut State, from: f64, to: f64, speed: f64) -> Vec<f64> {
    let dt_s = 1e-4;
    let v_mm_s = speed * (to - from).signum();
    let steps = ((to - from).abs() / speed / dt_s).round() as usize;
    (1..=steps)
        .map(|i| {
            let x_mm = from + v_mm_s * dt_s * i as f64;
            let motion = Motion {
                x_mm,
                v_mm_s,
                a_m_s2: 0.0,
            };
            state.step(of, motion, dt_s)
        })
        .collect()
}

#[test]
fn a_slow_sweep_has_the_static_force_of_its_direction() {
    let (detent, friction) = (detents(), [1.2; 9]);
    let of = mechanism(scalars(), &detent, &friction);
    let mut state = State::at_rest(4.0);
    for (from, to) in [(4.0, 16.0), (16.0, 5.0)] {
        let force = *sweep(&of, &mut state, from, to, 0.5).last().unwrap();
        // the contact is compressed by F/k as well, under 1 % of the detent's pitch, and
        // breakaway friction is up to a third larger
        let expected = of.static_n(to, to > from);
        assert!((force - expected).abs() < 0.75, "{to}: {force} {expected}");
    }
}

#[test]
fn within_the_gap_there_is_only_the_friction_of_the_handle() {
    let (detent, friction) = (vec![0.0; 65], [1.2; 9]);
    let of = mechanism(scalars(), &detent, &friction);
    let mut state = State::at_rest(6.0);
    for force in sweep(&of, &mut state, 6.0, 6.39, 5.0) {
        let free = force - 0.3 - 0.005;
        assert!(free <= 0.25 && free > 0.0, "{free}");
    }
    assert_eq!(state.y_mm(), 6.0);
    // beyond it the contact pushes against the friction of the follower
    let force = *sweep(&of, &mut state, 6.39, 7.4, 5.0).last().unwrap();
    assert!(force > 0.3 + 0.25 + 1.0, "{force}");
    assert!(state.y_mm() > 6.3, "{}", state.y_mm());
}

#[test]
fn the_spline_passes_through_its_values_and_its_slopes_are_its_derivatives() {
    let n = [0.0, 2.0, -1.0, 3.0, 3.5, 1.0];
    let of = Profile {
        first_mm: 1.0,
        step_mm: 0.5,
        n: &n,
    };
    for (i, value) in n.iter().enumerate() {
        assert!((of.spline_n(1.0 + 0.5 * i as f64) - value).abs() < 1e-12);
    }
    assert_eq!((of.spline_n(-9.0), of.spline_n(99.0)), (0.0, 1.0));
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for left in 0..n.len() - 1 {
        let [least, most] = of.slopes_n_per_mm(left);
        (low, high) = (low.min(least), high.max(most));
    }
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for i in 0..2500 {
        let x = 1.0 + 1e-3 * f64::from(i);
        let around = of.spline(x);
        let slope: f64 = (around.at.iter().zip(around.slope))
            .map(|(i, s)| s * n[*i])
            .sum();
        let difference = (of.spline_n(x + 1e-6) - of.spline_n(x - 1e-6)) / 2e-6;
        if i % 500 != 0 {
            assert!(
                (slope - difference).abs() < 1e-3,
                "{x}: {slope} {difference}"
            );
        }
        (least, most) = (least.min(slope), most.max(slope));
    }
    assert!((low - least).abs() < 0.01 && (high - most).abs() < 0.01);
}

#[test]
fn parameters_that_are_no_passive_mechanism_are_refused() {
    let (detent, friction) = (detents(), [1.2; 9]);
    assert_eq!(
        mechanism(scalars(), &detent, &friction).check(300.0),
        Ok(())
    );
    for i in 0..SCALARS {
        for bad in [-0.1, f64::NAN, f64::INFINITY, 0.0] {
            let mut p = scalars().to_array();
            p[i] = bad;
            let of = mechanism(Scalars::from_array(p), &detent, &friction);
            let may_be_zero = bad == 0.0 && !matches!(i, 1 | 6 | 8 | 10);
            let any_sign = i == 12 && bad.is_finite();
            let expected = if may_be_zero || any_sign {
                Ok(())
            } else {
                Err(Flaw::Scalar(i))
            };
            assert_eq!(of.check(300.0), expected, "{i} {bad}");
        }
    }
    let negative = [1.2, -0.1, 1.2];
    assert_eq!(
        mechanism(scalars(), &detent, &negative).check(300.0),
        Err(Flaw::Value)
    );
    // from 0 to 1 N over 4 mm is too steep at 0
    let steep = [0.0, 1.0, 1.0];
    assert_eq!(
        mechanism(scalars(), &detent, &steep).check(300.0),
        Err(Flaw::Friction)
    );
    // the certificate has the margin of what fails and of nothing else
    let said = mechanism(scalars(), &detent, &steep).certificate(300.0);
    assert_eq!(said.to_string(), "FAIL: least S+ - S- -0.010 N at 0.00 mm");
    let said = mechanism(scalars(), &detent, &negative).certificate(300.0);
    assert_eq!(said.to_string(), "FAIL: least S+ - S- -0.113 N at 4.00 mm");
    assert_eq!(
        mechanism(scalars(), &detent[..1], &friction).check(300.0),
        Err(Flaw::Profile)
    );
}

/// ½ r s (1 + σ) + a T w at the value in the middle, in either direction, with the slopes a behind and r ahead and T = 1 ms.
#[test]
fn friction_that_rises_on_both_sides_of_a_value_needs_more_at_speed() {
    let (a, r) = (0.11, 11.1);
    let middle_n = 0.5;
    let rising = [middle_n - 4.0 * a, middle_n, middle_n + 4.0 * r];
    let falling = [rising[2], rising[1], rising[0]];
    let bristle_mm = 0.5 * 0.06 * 1.35;
    for friction in [rising, falling] {
        let of = mechanism(scalars(), &[0.0; 2], &friction);
        for top_mm_s in [0.0, 300.0, 1000.0] {
            let (margin, at_mm) = of.friction_margin_n(top_mm_s);
            let expected = middle_n - bristle_mm * r - a * 1e-3 * top_mm_s;
            assert!((margin - expected).abs() < 1e-12, "{margin} {expected}");
            assert_eq!(at_mm, 4.0);
        }
        assert_eq!(of.check(300.0), Ok(()));
        assert_eq!(of.check(1000.0), Err(Flaw::Friction));
        // up to twice the trained speed
        let of_trained = of.certificate(500.0).hysteresis.value;
        assert_eq!(of_trained, of.friction_margin_n(1000.0).0);
    }
    // behind a value from which friction had fallen it needs no more, however fast the follower is
    let friction = [middle_n + 4.0 * a, middle_n, middle_n + 4.0 * r];
    let of = mechanism(scalars(), &[0.0; 2], &friction);
    for top_mm_s in [0.0, 3900.0] {
        let (margin, _) = of.friction_margin_n(top_mm_s);
        assert!(
            (margin - (middle_n - bristle_mm * r)).abs() < 1e-12,
            "{margin}"
        );
    }
}

/// ∫ D from the first value, N·mm: exact, because D is cubic in each interval.
struct Potential<'a> {
    of: Profile<'a>,
    at_nodes: Vec<f64>,
}

impl<'a> Potential<'a> {
    fn new(of: Profile<'a>) -> Self {
        let mut at_nodes = vec![0.0];
        for i in 0..of.n.len() - 1 {
            let from = of.first_mm + of.step_mm * i as f64;
            let next = at_nodes[i] + Self::simpson(&of, from, from + of.step_mm);
            at_nodes.push(next);
        }
        Self { of, at_nodes }
    }

    fn simpson(of: &Profile<'_>, from: f64, to: f64) -> f64 {
        let sum = of.spline_n(from) + 4.0 * of.spline_n(0.5 * (from + to)) + of.spline_n(to);
        sum * (to - from) / 6.0
    }

    fn at(&self, y: f64) -> f64 {
        let last = self.at_nodes.len() - 1;
        let end = self.of.first_mm + self.of.step_mm * last as f64;
        if y <= self.of.first_mm {
            return self.of.n[0] * (y - self.of.first_mm);
        }
        if y >= end {
            return self.at_nodes[last] + self.of.n[last] * (y - end);
        }
        let left = (((y - self.of.first_mm) / self.of.step_mm) as usize).min(last - 1);
        let from = self.of.first_mm + self.of.step_mm * left as f64;
        self.at_nodes[left] + Self::simpson(&self.of, from, y)
    }
}

/// Parameters from soft to hard, with gaps from none to 2 mm, and profiles that vary.
fn random(draw: &mut Draw) -> (Scalars, Vec<f64>, Vec<f64>) {
    let mut log = |low: f64, high: f64| (draw.within(low.ln(), high.ln())).exp();
    let mut p = Scalars {
        handle_kg: 0.0,
        follower_kg: log(0.005, 1.0),
        contact_n_per_mm: log(0.5, 50.0),
        contact_n_s_per_mm: log(1e-4, 0.1),
        gap_mm: log(0.01, 2.0),
        follower_n_s_per_mm: log(1e-6, 0.02),
        slip_mm: log(0.005, 0.3),
        stribeck: log(0.01, 1.0),
        stribeck_mm_s: log(1.0, 50.0),
        handle_n: log(0.01, 1.0),
        handle_slip_mm: log(0.005, 0.3),
        handle_n_s_per_mm: log(1e-6, 0.01),
        offset_n: 0.0,
    };
    // whatever may be zero is zero now and then
    for zero in [
        &mut p.contact_n_s_per_mm,
        &mut p.gap_mm,
        &mut p.follower_n_s_per_mm,
        &mut p.stribeck,
        &mut p.handle_n,
        &mut p.handle_n_s_per_mm,
    ] {
        if draw.unit() < 0.2 {
            *zero = 0.0;
        }
    }
    p.offset_n = draw.within(-1.0, 1.0);
    let detent = (0..=40).map(|_| draw.within(-6.0, 6.0)).collect();
    let mut friction: Vec<f64> = (0..6).map(|_| draw.within(0.0, 2.0)).collect();
    while mechanism(p, &[0.0; 2], &friction)
        .friction_margin_n(TOP_MM_S)
        .0
        < 0.0
    {
        friction.iter_mut().for_each(|n| *n += 0.05);
    }
    (p, detent, friction)
}

const TOP_MM_S: f64 = 2000.0;

/// What the hand does next, mm: waves, jumps, noise, and motions that follow the force so
/// as to draw as much energy as they can.
fn move_mm(kind: u64, draw: &mut Draw, i: usize, dt_s: f64, force_n: f64, speed: f64) -> f64 {
    let along = -force_n.signum();
    match kind {
        0 => speed * dt_s * (TAU * 7.0 * dt_s * i as f64).sin(),
        1 => speed * dt_s * (TAU * 200.0 * dt_s * i as f64).sin(),
        2 => speed * dt_s * if draw.unit() < 0.5 { 1.0 } else { -1.0 },
        3 => speed * dt_s * draw.within(-1.0, 1.0),
        4 => speed * dt_s * along,
        5 => speed * dt_s * along * draw.unit(),
        // waits for the force to build up, then gives way
        6 if i % 8 < 5 => -0.2 * speed * dt_s * along,
        6 => speed * dt_s * along,
        _ => 0.02 * speed * dt_s * draw.within(-1.0, 1.0) + 0.3 * speed * dt_s * along,
    }
}

/// No motion draws more energy than is stored: in every single step of 10,000 motions at
/// 4 kHz and as many at 1 kHz, on random mechanisms, the energy rises by no more than the
/// hand supplies. The hand's speed is that of its steps; m·a belongs to the device's mass
/// rule and is left out.
#[test]
fn no_motion_draws_more_energy_than_is_stored() {
    let mut draw = Draw(7);
    let (mut dissipated, mut drawn, mut fastest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for dt_s in [0.25e-3, 1e-3] {
        for motion in 0..10_000_u64 {
            let (p, detent, friction) = random(&mut draw);
            let of = mechanism(p, &detent, &friction);
            let potential = Potential::new(of.detent);
            let mut x_mm = draw.within(2.0, 18.0);
            let mut state = State::at_rest(x_mm);
            let energy = |state: &State, x_mm: f64| {
                state.stored_n_mm(&of, dt_s) + potential.at(state.y_mm()) + p.offset_n * x_mm
            };
            let speed = draw.within(1.0, 600.0);
            let mut force_n = 0.0;
            let mut before = energy(&state, x_mm);
            for i in 0..120 {
                let dx = move_mm(motion % 8, &mut draw, i, dt_s, force_n, speed);
                x_mm += dx;
                let motion = Motion {
                    x_mm,
                    v_mm_s: dx / dt_s,
                    a_m_s2: 0.0,
                };
                force_n = state.step(&of, motion, dt_s);
                let after = energy(&state, x_mm);
                let supplied = force_n * dx;
                let rounding = 1e-9 * (1.0 + after.abs() + supplied.abs());
                assert!(
                    after - before <= supplied + rounding,
                    "step {i}: {after} - {before} > {supplied}, {p:?}"
                );
                dissipated += supplied - (after - before);
                drawn = drawn.min(supplied);
                fastest = fastest.max(state.w_mm_s().abs());
                before = after;
            }
        }
    }
    // the motions did try: energy was drawn, and followers were fast
    assert!(dissipated > 0.0 && drawn < -1.0, "{dissipated} {drawn}");
    assert!(fastest > 300.0, "{fastest}");
}

/// Without the least damping of the follower the explicit detent force supplies energy: the
/// test above can fail.
#[test]
fn the_least_damping_of_the_follower_is_needed() {
    let detent: Vec<f64> = (0..=40).map(|i| 6.0 * f64::from(i % 2)).collect();
    let mut p = scalars();
    p.follower_n_s_per_mm = 0.0;
    p.gap_mm = 2.0;
    let friction = [0.0; 6];
    let rise = |of: &MechanismView<'_>| {
        let potential = Potential::new(of.detent);
        let mut state = State::at_rest(5.25);
        state.w_mm_s = Sum::of(50.0);
        let energy = |state: &State| state.stored_n_mm(of, 1e-3) + potential.at(state.y_mm());
        let mut worst = f64::NEG_INFINITY;
        let mut before = energy(&state);
        for _ in 0..100 {
            state.step(of, Motion::at_rest(5.25), 1e-3);
            worst = worst.max(energy(&state) - before);
            before = energy(&state);
        }
        worst
    };
    let of = mechanism(p, &detent, &friction);
    assert!(rise(&of) < 1e-9);
    let without = MechanismView::with_slope(p, of.detent, of.friction, 0.0);
    assert!(rise(&without) > 0.01);
}
