//! Targets that a table cannot predict, and a bounded least-squares problem solved by another
//! program.

mod viscoelastic;

use super::*;
use crate::identify::vaf;
use crate::recording::Recording;
use std::f64::consts::TAU;
use study_base::rng::Stream;

/// Samples per second.
const RATE_HZ: f64 = 1000.0;
/// Steps of the simulated target per sample.
const STEPS: usize = 20;

/// Position, speed and acceleration of a sum of sines of 1 − cos, from 0: amplitude mm, Hz.
fn sines(parts: &[(f64, f64)], t_s: f64) -> [f64; 3] {
    parts.iter().fold([0.0; 3], |sum, (mm, hz)| {
        let w = TAU * hz;
        let (sin, cos) = (w * t_s).sin_cos();
        [
            sum[0] + mm * (1.0 - cos),
            sum[1] + mm * w * sin,
            sum[2] + mm * w * w * cos * 1e-3,
        ]
    })
}

/// Motions one after the other: duration, s, and amplitude, mm, and frequency, Hz, of each sine.
type Motions<'a> = [(f64, &'a [(f64, f64)])];

/// What a target does with a motion: the force at the end of a step of `dt_s`.
type Target<'a> = dyn FnMut([f64; 3], f64) -> f64 + 'a;

/// A recording with an encoder of 5 µm and noise of 10 mN.
fn record(seed: u64, motions: &Motions<'_>, target: &mut Target<'_>) -> Recording {
    let mut noise = Stream::new(seed, &["elements"]);
    let mut r = Recording {
        name: format!("r{seed}"),
        t_s: Vec::new(),
        x_mm: Vec::new(),
        v_mm_s: Vec::new(),
        a_m_s2: Vec::new(),
        f_n: Vec::new(),
        header: Vec::new(),
        sha256: String::new(),
        warnings: Vec::new(),
    };
    let dt_s = 1.0 / RATE_HZ;
    for (duration_s, parts) in motions {
        for i in 0..(duration_s * RATE_HZ) as usize {
            let mut force_n = 0.0;
            for j in 1..=STEPS {
                let t_s = (i as f64 + j as f64 / STEPS as f64) * dt_s;
                force_n = target(sines(parts, t_s), dt_s / STEPS as f64);
            }
            let [x, v, a] = sines(parts, (i + 1) as f64 * dt_s);
            r.t_s.push(r.t_s.len() as f64 * dt_s);
            r.x_mm.push((x / 0.005).round() * 0.005);
            r.v_mm_s.push(v);
            r.a_m_s2.push(a);
            r.f_n.push(force_n + 0.01 * noise.normal());
        }
    }
    r
}

/// Up and down at three speeds, with whole periods.
const TRAINED: [(f64, &[(f64, f64)]); 4] = [
    (10.0, &[(4.9, 0.2)]),
    (5.0, &[(4.6, 1.0)]),
    (5.0, &[(4.0, 3.0)]),
    (5.0, &[(2.5, 0.8), (1.8, 2.2)]),
];
const SLOW: [(f64, &[(f64, f64)]); 1] = [(12.0, &[(4.5, 0.25)])];
const FAST: [(f64, &[(f64, f64)]); 1] = [(5.0, &[(4.2, 2.4)])];
const MULTISINE: [(f64, &[(f64, f64)]); 1] = [(10.0, &[(1.6, 0.4), (1.4, 1.1), (1.2, 2.7)])];

/// The realization from the training motion and its VAF on motions that follow.
fn identified(
    trained: &Motions<'_>,
    validated: &[&Motions<'_>],
    target: &mut dyn FnMut() -> Box<Target<'static>>,
) -> (Realization, Vec<f64>) {
    let recording = record(1, trained, &mut *target());
    let training = Training::new(&recording).unwrap();
    let terms = Terms::ALL;
    let method = Elements { terms };
    let identified = training.identify(method, 0.4, Lookup::Linear).unwrap();
    let realization = identified.realization;
    let vafs = (validated.iter().enumerate())
        .map(|(i, motions)| {
            let recording = record(2 + i as u64, motions, &mut *target());
            vaf::score(&realization, &recording).vaf
        })
        .collect();
    (realization, vafs)
}

/// A hardening spring with two Maxwell branches.
fn rubber() -> Box<Target<'static>> {
    let (mut q, mut last) = ([0.0; 2], 0.0);
    Box::new(move |[x, _, _], dt_s| {
        for (q, relaxation_s) in q.iter_mut().zip([0.07, 0.6]) {
            let share: f64 = dt_s / relaxation_s;
            let gain = (1.0 - (-share).exp()) / share;
            *q = *q * (-share).exp() + gain * (x - last);
        }
        last = x;
        0.5 + 0.5 * x + 0.03 * x * x + 1.4 * q[0] + 0.5 * q[1]
    })
}

/// F = k p^1.5 (1 + c v) where it is pressed, and never pulling (Hunt & Crossley 1975).
fn tissue() -> Box<Target<'static>> {
    Box::new(|[x, v, _], _| {
        let p: f64 = (x - 1.5).max(0.0);
        (0.25 * p.powf(1.5) * (1.0 + 0.006 * v)).max(0.0)
    })
}

/// A spring with a wall that breaks away at 6.2 mm, holds again below 5 mm, and friction.
fn trigger() -> Box<Target<'static>> {
    let (mut holds, mut z, mut last): (bool, f64, f64) = (true, 0.0, 0.0);
    Box::new(move |[x, v, a], _| {
        holds = if holds { x <= 6.2 } else { x < 5.0 };
        z = (z + (x - last) / 0.05).clamp(-1.0, 1.0);
        last = x;
        let wall = if holds { 2.5 * (x - 4.8).max(0.0) } else { 0.0 };
        1.0 + 0.4 * x + wall + 0.12 * z + 0.002 * v + 0.01 * a
    })
}

#[test]
fn rubber_is_predicted_in_all_motions() {
    let (found, vafs) = identified(&TRAINED, &[&FAST, &SLOW, &MULTISINE], &mut rubber);
    assert!(vafs.iter().all(|vaf| *vaf >= 0.99), "{vafs:?}");
    let elements = found.elements.as_ref().unwrap();
    assert!(found.certificate().passes(), "{}", found.certificate());
    let relaxes = |spring: &Spring| matches!(spring, Spring::Maxwell { .. });
    assert!(
        elements.springs.iter().any(relaxes),
        "{:?}",
        elements.springs
    );
    eprintln!("rubber {vafs:?} {:?}", elements.springs);
}

#[test]
fn tissue_is_predicted_in_all_motions() {
    let (found, vafs) = identified(&TRAINED, &[&FAST, &SLOW, &MULTISINE], &mut tissue);
    assert!(vafs.iter().all(|vaf| *vaf >= 0.99), "{vafs:?}");
    assert!(found.certificate().passes(), "{}", found.certificate());
    eprintln!("tissue {vafs:?} {:?}", found.elements.unwrap().springs);
}

/// Trained with strokes of all lengths, validated with strokes that turn before the break and with
/// strokes that turn between break and end.
#[test]
fn partial_strokes_of_a_trigger_are_predicted() {
    let partial: [(f64, &[(f64, f64)]); 2] = [(6.0, &[(2.9, 0.5)]), (6.0, &[(3.3, 0.7)])];
    let (found, vafs) = identified(&TRAINED, &[&FAST, &SLOW, &partial], &mut trigger);
    let springs = &found.elements.as_ref().unwrap().springs;
    assert!(vafs.iter().all(|vaf| *vaf >= 0.98), "{vafs:?} {springs:?}");
    assert!(found.certificate().passes(), "{}", found.certificate());
    let latch = found
        .elements
        .as_ref()
        .unwrap()
        .springs
        .iter()
        .find_map(|spring| match spring {
            Spring::Latch { rearm_mm, break_mm } => Some([*rearm_mm, *break_mm]),
            _ => None,
        });
    let [rearm_mm, break_mm] = latch.unwrap();
    assert!((break_mm - 6.2).abs() < 0.1, "{break_mm}");
    assert!((rearm_mm - 5.0).abs() < 0.3, "{rearm_mm}");
    eprintln!("trigger {vafs:?} {:?}", found.elements.unwrap().springs);
}

/// Of a target without memory no spring is worth it.
#[test]
fn a_spring_alone_gets_no_elements_that_it_does_not_have() {
    let mut plain = || -> Box<Target<'static>> { Box::new(|[x, v, _], _| 0.4 * x + 0.003 * v) };
    let (found, vafs) = identified(&TRAINED, &[&FAST, &SLOW], &mut plain);
    assert!(vafs.iter().all(|vaf| *vaf > 0.998), "{vafs:?}");
    let springs = found.elements.unwrap().springs;
    assert!(springs.is_empty(), "{springs:?}");
}

/// The bounded problem with a stop and a Maxwell branch on five nodes. Expected: SciPy 1.17.1,
/// `scipy.optimize.lsq_linear` (BVLS) with columns and ridges written out in Python with NumPy 2.4.6;
/// nine digits were printed, and ten of the 21 bounded unknowns are 0.
#[test]
fn profiles_are_those_of_another_bounded_solver() {
    let samples = 600;
    let at = |i: usize| 0.01 * i as f64;
    let mut r = record(1, &[], &mut |_, _| 0.0);
    for i in 0..samples {
        let t = at(i);
        let x = 5.0 + 4.0 * (1.3 * t).sin() + 0.9 * (4.1 * t).sin();
        let v = 4.0 * 1.3 * (1.3 * t).cos() + 0.9 * 4.1 * (4.1 * t).cos();
        let a = 1e-3 * (-4.0 * 1.69 * (1.3 * t).sin() - 0.9 * 16.81 * (4.1 * t).sin());
        let wave = 0.2 * (37.0 * (i * i) as f64).sin();
        r.t_s.push(t);
        r.x_mm.push(x);
        r.v_mm_s.push(v);
        r.a_m_s2.push(a);
        r.f_n
            .push(2.0 * (0.9 * x).sin() + 0.004 * v + 0.3 * v.signum() + 20.0 * a + wave);
    }
    let training = Training::new(&r).unwrap();
    let springs = [
        Spring::Stop { slip_mm: 0.5 },
        Spring::Maxwell {
            slip_mm: 6.0,
            relaxation_s: 0.2,
        },
    ];
    let nodes = [1.0, 3.0, 5.0, 7.0, 9.0];
    let penalty = Penalty::of(Terms::ALL);
    // the branch as after a long motion at the first speed
    let starts = vec![vec![1.0, r.v_mm_s[0] * 0.2 / 6.0]];
    let sums = Sums::of(&training, &nodes, &springs, Some(&starts), 1);
    let found = sums.solve(&[0, 1], penalty).unwrap().elements;
    let expected = [
        [2.40159761, 1.41589396, -1.81588567, 0.32803912, 2.58705869],
        [0.0, 0.0, 0.0, 0.0, 0.0804482438],
        [
            0.125885475,
            0.131696232,
            0.108056838,
            0.0676197293,
            0.0571025371,
        ],
        [0.484613824, 0.0, 0.0, 0.10301576, 0.0],
        [0.368038889, 0.0, 0.0, 0.0, 2.05432969],
    ];
    let [forwards, backwards] = &found.damping_n_s_per_mm;
    let profiles = [&found.force_n, forwards, backwards];
    for (found, expected) in profiles.into_iter().chain(&found.spring_n).zip(&expected) {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 2e-7, "{found} {expected}");
        }
    }
    assert!(
        (found.mass_kg - 24.634_849_253).abs() < 2e-6,
        "{}",
        found.mass_kg
    );
}
