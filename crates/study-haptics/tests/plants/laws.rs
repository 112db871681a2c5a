//! Targets that no estimator here contains, as simulations. None of them was measured.
//!
//! A law is stepped with the motion of the handle at [`STEP_S`] and gives the force that moves it.
//! Positions in mm, speeds in mm/s, accelerations in m/s², forces in N, times in s. All parameters
//! were chosen for the order of magnitude of such a part, before any estimator was run on it.

use study_wire::predict::Motion;

/// The step of the simulations, s.
pub(super) const STEP_S: f64 = 1.0 / 20_000.0;

/// A target: the force for the motion of its handle.
pub(super) type Law = Box<dyn FnMut(Motion) -> f64>;

/// A target with the range that it is moved in.
pub(super) struct Plant {
    pub(super) name: &'static str,
    /// The range of the strokes, mm.
    pub(super) range_mm: [f64; 2],
    /// The speed of a fast stroke, mm/s.
    pub(super) fast_mm_s: f64,
    /// A new target at rest.
    pub(super) law: fn() -> Law,
}

/// Dahl friction of 1 N: the state after a step.
fn dahl(z: &mut f64, dx_mm: f64, length_mm: f64) -> f64 {
    *z = (*z + dx_mm / length_mm) / (1.0 + dx_mm.abs() / length_mm);
    *z
}

/// A body of `kg` that a force accelerates, semi-implicitly.
#[derive(Default, Clone, Copy)]
struct Body {
    x_mm: f64,
    v_mm_s: f64,
}

impl Body {
    fn step(&mut self, force_n: f64, kg: f64) {
        // N/kg is m/s²
        self.v_mm_s += 1e3 * force_n / kg * STEP_S;
        self.x_mm += self.v_mm_s * STEP_S;
    }
}

/// The force of a contact with play, and with damping that never pulls.
fn contact(gap_mm: f64, n_per_mm: f64, n_s_per_mm: f64, e_mm: f64, w_mm_s: f64) -> f64 {
    let depth = e_mm.abs() - 0.5 * gap_mm;
    if depth <= 0.0 {
        return 0.0;
    }
    let sign = e_mm.signum();
    sign * (n_per_mm * depth + n_s_per_mm * w_mm_s * sign).max(0.0)
}

fn snap_through() -> Law {
    // a dome behind a plunger of 2 g: the dome moves through its unstable part by itself
    let mut dome = Body::default();
    Box::new(move |m| {
        let x = dome.x_mm;
        let own = 1.6 * x - 1.15 * x * x + 0.21 * x * x * x;
        let spring = 6.0 * (m.x_mm - x);
        dome.step(spring - own - 0.004 * dome.v_mm_s, 0.002);
        spring + 0.3 * m.x_mm + 0.004 * m.a_m_s2
    })
}

/// 24 detents in a turn at a lever of 20 mm.
fn knob() -> Law {
    let mut z = 0.0;
    Box::new(move |m| {
        let turn = 2.0 * std::f64::consts::PI * 20.0;
        let detent = 1.2 * (24.0 * std::f64::consts::TAU * m.x_mm / turn).sin();
        let friction = 0.3 * dahl(&mut z, m.v_mm_s * STEP_S, 0.15);
        detent + friction + 0.0008 * m.v_mm_s + 0.05 * m.a_m_s2
    })
}

fn trigger() -> Law {
    // breaks at 6 mm, sets again at 4 mm
    let (mut broken, mut z, mut drop) = (false, 0.0, 0.0);
    Box::new(move |m| {
        broken = if broken { m.x_mm > 4.0 } else { m.x_mm > 6.0 };
        // the sear needs some milliseconds
        let target = if broken { 1.0 } else { 0.0 };
        drop += (target - drop) * STEP_S / 0.004;
        let friction = 0.25 * dahl(&mut z, m.v_mm_s * STEP_S, 0.1);
        let wall = 1.4 * (m.x_mm - 3.0).max(0.0) * (1.0 - drop);
        0.35 * m.x_mm + wall + friction + 0.02 * m.a_m_s2
    })
}

fn locally_active() -> Law {
    let mut z = 0.0;
    Box::new(move |m| {
        let z = dahl(&mut z, m.v_mm_s * STEP_S, 0.3);
        let place = (-((m.x_mm - 20.0) / 3.0).powi(2)).exp();
        2.0 * (m.x_mm / 5.0).sin() + z * (0.8 - 1.2 * place) + 0.06 * m.a_m_s2 + 0.002 * m.v_mm_s
    })
}

fn tissue() -> Law {
    Box::new(|m| {
        let depth = (m.x_mm - 1.0).max(0.0);
        (0.05 * depth.powf(1.5) * (1.0 + 0.012 * m.v_mm_s)).max(0.0) + 0.01 * m.a_m_s2
    })
}

fn rubber() -> Law {
    let mut branches = [0.0; 2];
    Box::new(move |m| {
        let mut force = 0.25 * m.x_mm;
        for (q, (n_per_mm, s)) in branches.iter_mut().zip([(0.3, 0.05), (0.2, 0.8)]) {
            *q += STEP_S * (n_per_mm * m.v_mm_s - *q / s);
            force += *q;
        }
        force + 0.01 * m.a_m_s2
    })
}

fn magnetorheological() -> Law {
    // Bouc–Wen at a constant current, with a presliding of its own (Spencer et al. 1997)
    let mut z: f64 = 0.0;
    Box::new(move |m| {
        let v = m.v_mm_s;
        let (gamma, beta, full) = (0.6, 0.9, 1.6);
        z += STEP_S * (full * v - gamma * v.abs() * z * z.abs() - beta * v * z * z);
        1.5 * z + 0.006 * v + 0.4 * (v / 40.0).tanh() + 0.05 * m.a_m_s2
    })
}

fn warming_friction() -> Law {
    let (mut z, mut heat_j) = (0.0, 0.0);
    Box::new(move |m| {
        let share = 1.0 + 0.6 * (-heat_j / 1.5_f64).exp();
        let friction = 1.8 * share * dahl(&mut z, m.v_mm_s * STEP_S, 0.2);
        heat_j += (1e-3 * friction * m.v_mm_s).max(0.0) * STEP_S - heat_j * STEP_S / 40.0;
        friction + 0.003 * m.v_mm_s + 0.12 * m.x_mm + 0.08 * m.a_m_s2
    })
}

fn two_gaps() -> Law {
    let (mut first, mut second) = (Body::default(), Body::default());
    let mut z = 0.0;
    Box::new(move |m| {
        let outer = contact(
            0.9,
            12.0,
            0.01,
            m.x_mm - first.x_mm,
            m.v_mm_s - first.v_mm_s,
        );
        let inner = contact(
            1.4,
            15.0,
            0.012,
            first.x_mm - second.x_mm,
            first.v_mm_s - second.v_mm_s,
        );
        let friction = 0.5 * dahl(&mut z, second.v_mm_s * STEP_S, 0.08);
        first.step(outer - inner - 0.004 * first.v_mm_s, 0.05);
        let own = 2.5 * (second.x_mm / 4.0).sin() + friction + 0.005 * second.v_mm_s;
        second.step(inner - own, 0.08);
        outer + 0.06 * m.a_m_s2 + 0.001 * m.v_mm_s
    })
}

fn fluid_damper() -> Law {
    // turbulent: the force grows with the square of the speed
    Box::new(|m| {
        let v = m.v_mm_s;
        6e-5 * v * v.abs() + 0.15 * m.x_mm + 0.05 * m.a_m_s2
    })
}

fn bypass_damper() -> Law {
    // a valve that is closed in one direction, and a bypass in the middle of the stroke
    let mut z = 0.0;
    Box::new(move |m| {
        let open = 1.0 - 0.8 * (-((m.x_mm - 20.0) / 5.0).powi(2)).exp();
        let b = if m.v_mm_s > 0.0 { 0.03 } else { 0.008 };
        b * open * m.v_mm_s + 0.4 * dahl(&mut z, m.v_mm_s * STEP_S, 0.2) + 0.07 * m.a_m_s2
    })
}

fn eddy_current_brake() -> Law {
    // the force falls again above its critical speed
    Box::new(|m| {
        let u = m.v_mm_s / 60.0;
        3.0 * 2.0 * u / (1.0 + u * u) + 0.08 * m.x_mm + 0.1 * m.a_m_s2
    })
}

fn ageing_friction() -> Law {
    // rate and state (Dieterich 1979): contacts grow at rest
    let (mut z, mut theta_s) = (0.0, 1.0);
    Box::new(move |m| {
        let v = m.v_mm_s.abs();
        theta_s += STEP_S * (1.0 - v * theta_s / 0.3);
        theta_s = theta_s.max(1e-3);
        let level = 1.4 + 0.05 * (v / 10.0 + 1e-3).ln() + 0.12 * (theta_s / 0.03 + 1.0).ln();
        level * dahl(&mut z, m.v_mm_s * STEP_S, 0.05) + 0.1 * m.x_mm + 0.06 * m.a_m_s2
    })
}

fn leaf_springs() -> Law {
    // leaves that slip one after the other, on a stiffening spring
    let mut slips = [0.0; 5];
    Box::new(move |m| {
        let x = m.x_mm - 10.0;
        let mut force = 0.12 * x + 0.0012 * x * x * x;
        for (j, s) in slips.iter_mut().enumerate() {
            let (n_per_mm, most) = (0.5 / (1.0 + j as f64), 0.15 + 0.12 * j as f64);
            *s = (*s + n_per_mm * m.v_mm_s * STEP_S).clamp(-most, most);
            force += *s;
        }
        force + 0.03 * m.a_m_s2
    })
}

fn leaking_cylinder() -> Law {
    // air that is compressed and leaks through a small hole
    let mut mass = 1.0;
    let mut z = 0.0;
    Box::new(move |m| {
        let volume = 1.0 - m.x_mm / 60.0;
        let pressure: f64 = (mass / volume) - 1.0;
        let flow = pressure.signum() * pressure.abs().sqrt();
        mass -= 1.2 * flow * STEP_S;
        9.0 * pressure + 0.3 * dahl(&mut z, m.v_mm_s * STEP_S, 0.2) + 0.04 * m.a_m_s2
    })
}

/// All plants: the nine that identification was tried on before, then six more.
pub(super) const PLANTS: [Plant; 15] = [
    plant("snap-through button", [0.0, 4.0], 40.0, snap_through),
    plant("knob, 24 detents a turn", [0.0, 125.0], 500.0, knob),
    plant("trigger with a break", [0.0, 9.0], 90.0, trigger),
    plant("locally active", [3.0, 37.0], 250.0, locally_active),
    plant("Hunt-Crossley tissue", [0.0, 12.0], 100.0, tissue),
    plant("rubber (Maxwell)", [0.0, 10.0], 100.0, rubber),
    plant(
        "magnetorheological brake",
        [0.0, 40.0],
        250.0,
        magnetorheological,
    ),
    plant(
        "friction that warms up",
        [0.0, 40.0],
        250.0,
        warming_friction,
    ),
    plant("two gaps in series", [3.0, 37.0], 250.0, two_gaps),
    plant("turbulent damper", [0.0, 40.0], 250.0, fluid_damper),
    plant("valve and bypass", [0.0, 40.0], 250.0, bypass_damper),
    plant("eddy-current brake", [0.0, 40.0], 250.0, eddy_current_brake),
    plant("ageing friction", [0.0, 30.0], 150.0, ageing_friction),
    plant("leaf springs", [0.0, 20.0], 150.0, leaf_springs),
    plant("leaking cylinder", [0.0, 30.0], 150.0, leaking_cylinder),
];

const fn plant(name: &'static str, range_mm: [f64; 2], fast_mm_s: f64, law: fn() -> Law) -> Plant {
    Plant {
        name,
        range_mm,
        fast_mm_s,
        law,
    }
}
