//! Rubber with two relaxation times, by Euler steps of the simulated target. Some recordings begin
//! in the middle of a motion: what the branches hold then is known to nobody.

use super::*;
use crate::identify::vaf;
use crate::recording::Recording;
use std::f64::consts::TAU;
use study_base::rng::Stream;

const STEPS_HZ: f64 = 20_000.0;
const RATE_HZ: f64 = 500.0;

/// A hardening spring f (x/travel)² with two branches behind dampers.
#[derive(Debug, Clone, Copy)]
struct Rubber {
    travel_mm: f64,
    hardening_n: f64,
    /// Stiffness, N per travel, and relaxation time, s.
    branches: [(f64, f64); 2],
    /// How long it has been moved when the recording begins; the branches hold nothing before, s.
    moved_s: f64,
}

/// Position as a share of the travel.
type Motion = fn(f64) -> f64;

/// Amplitude, Hz and phase of sines.
fn sines(parts: &[(f64, f64, f64)], t_s: f64) -> f64 {
    let each = parts
        .iter()
        .map(|(share, hz, phase)| share * (TAU * hz * t_s + phase).sin());
    0.5 + each.sum::<f64>()
}

fn trained(t_s: f64) -> f64 {
    let parts = [
        (0.18, 0.27, 0.4),
        (0.14, 0.43, 2.9),
        (0.11, 0.71, 5.1),
        (0.09, 1.13, 1.7),
        (0.05, 1.9, 3.6),
        (0.03, 2.9, 0.9),
    ];
    sines(&parts, t_s)
}

fn fast(t_s: f64) -> f64 {
    let swell = 0.7 + 0.3 * (TAU * 0.3 * t_s).sin();
    0.5 + 0.42 * swell * (TAU * 1.7 * t_s).sin()
}

fn slow(t_s: f64) -> f64 {
    0.5 - 0.45 * (TAU * 0.3 * t_s).cos()
}

fn partial(t_s: f64) -> f64 {
    let parts = [(0.09, 0.6, 1.0), (0.05, 1.4, 2.0), (0.02, 2.3, 4.0)];
    sines(&parts, t_s)
}

impl Rubber {
    /// With an encoder of 5 µm and noise of 5 mN.
    fn record(&self, seed: u64, motion: Motion, duration_s: f64) -> Recording {
        let mut noise = Stream::new(seed, &["viscoelastic"]);
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
        let dt_s = 1.0 / STEPS_HZ;
        let at = |t_s: f64| self.travel_mm * motion(t_s);
        let speed = |t_s: f64| (at(t_s + dt_s) - at(t_s - dt_s)) / (2.0 * dt_s);
        let every = (STEPS_HZ / RATE_HZ) as usize;
        let mut held_n = [0.0; 2];
        for step in 0..((self.moved_s + duration_s) * STEPS_HZ) as usize {
            let t_s = step as f64 * dt_s;
            if step % every == 0 && t_s >= self.moved_s {
                let stiff_n = self.hardening_n * motion(t_s).powi(2);
                let steeper_mm_s2 = (speed(t_s + 1e-3) - speed(t_s - 1e-3)) / 2e-3;
                r.t_s.push(r.t_s.len() as f64 / RATE_HZ);
                r.x_mm.push((at(t_s) / 0.005).round() * 0.005);
                r.v_mm_s.push(speed(t_s));
                r.a_m_s2.push(1e-3 * steeper_mm_s2);
                r.f_n
                    .push(stiff_n + held_n[0] + held_n[1] + 0.005 * noise.normal());
            }
            for (held_n, (n, relaxation_s)) in held_n.iter_mut().zip(self.branches) {
                *held_n += dt_s * (n / self.travel_mm * speed(t_s) - *held_n / relaxation_s);
            }
        }
        r
    }

    /// What is identified from one motion, and its VAF in three others.
    fn identified(&self) -> (Realization, [f64; 3]) {
        let recording = self.record(1, trained, 25.0);
        let training = Training::new(&recording).unwrap();
        let method = Elements { terms: Terms::ALL };
        let dx_mm = self.travel_mm / 15.0;
        let found = training.identify(method, dx_mm, Lookup::Linear).unwrap();
        let motions: [(Motion, f64); 3] = [(fast, 8.0), (slow, 10.0), (partial, 8.0)];
        let vafs = motions.map(|(motion, duration_s)| {
            let other = self.record(2, motion, duration_s);
            vaf::score(&found.realization, &other).vaf
        });
        (found.realization, vafs)
    }
}

/// They are predicted in motions that were not used, by branches alone.
fn is_predicted(rubber: Rubber) -> Vec<f64> {
    let (found, vafs) = rubber.identified();
    assert!(found.certificate().passes(), "{}", found.certificate());
    let springs = found.elements.unwrap().springs;
    eprintln!("{vafs:.4?} {springs:?}");
    assert!(vafs.iter().all(|vaf| *vaf >= 0.99), "{vafs:?} {springs:?}");
    (springs.iter())
        .map(|spring| match spring {
            Spring::Maxwell { relaxation_s, .. } => *relaxation_s,
            other => panic!("{other:?} of {rubber:?}"),
        })
        .collect()
}

#[test]
fn rubber_whose_recordings_begin_in_motion_is_predicted() {
    let mut found = is_predicted(Rubber {
        travel_mm: 7.0,
        hardening_n: 2.0,
        branches: [(2.0, 0.026), (1.5, 0.47)],
        moved_s: 0.0,
    });
    found.sort_by(f64::total_cmp);
    let [short_s, long_s] = found[..] else {
        panic!("{found:?}")
    };
    assert!((0.02..0.035).contains(&short_s), "{short_s}");
    assert!((0.42..0.52).contains(&long_s), "{long_s}");
}

#[test]
fn rubber_that_was_moved_before_the_recording_is_predicted() {
    is_predicted(Rubber {
        travel_mm: 14.0,
        hardening_n: 5.5,
        branches: [(2.8, 0.03), (4.0, 0.67)],
        moved_s: 2.6,
    });
}

#[test]
fn rubber_of_two_times_that_are_close_is_predicted() {
    is_predicted(Rubber {
        travel_mm: 21.0,
        hardening_n: 4.5,
        branches: [(3.6, 0.064), (2.0, 0.26)],
        moved_s: 0.0,
    });
}

/// In cross-validation the stroke that is left out does not tell in which state springs enter it.
#[test]
fn a_force_that_is_left_out_tells_no_start() {
    let rubber = Rubber {
        travel_mm: 14.0,
        hardening_n: 5.5,
        branches: [(4.0, 0.67), (0.0, 1.0)],
        moved_s: 2.6,
    };
    let mut recording = rubber.record(1, trained, 10.0);
    let elements = model::Elements {
        mass_kg: 0.0,
        x_mm: vec![0.0, 14.0],
        force_n: vec![0.0, 5.5],
        damping_n_s_per_mm: [vec![0.0; 2], vec![0.0; 2]],
        springs: vec![Spring::Maxwell {
            slip_mm: 14.0,
            relaxation_s: 0.67,
        }],
        spring_n: vec![vec![4.0; 2]],
    };
    let first = recording.len() / 10;
    let by_rest = |recording: &Recording| start_of(&elements, recording, |i| i >= first)[0];
    let by_all = |recording: &Recording| start_of(&elements, recording, |_| true)[0];
    let before = [by_rest(&recording), by_all(&recording)];
    assert!(before[0].abs() > 0.01, "{before:?}");
    for f_n in &mut recording.f_n[..first] {
        *f_n += 3.0;
    }
    assert_eq!(by_rest(&recording), before[0]);
    assert!((by_all(&recording) - before[1]).abs() > 0.1);
    assert_eq!(start_of(&elements, &recording, |_| false)[0], 0.0);
}

/// A branch that fades within ten samples is predicted from the first one on.
#[test]
fn the_first_sample_has_the_force_of_the_start() {
    let rubber = Rubber {
        travel_mm: 14.0,
        hardening_n: 0.0,
        branches: [(20.0, 0.02), (0.0, 1.0)],
        moved_s: 3.4,
    };
    let recording = rubber.record(1, trained, 5.0);
    let elements = model::Elements {
        mass_kg: 0.0,
        x_mm: vec![0.0, 14.0],
        force_n: vec![0.0; 2],
        damping_n_s_per_mm: [vec![0.0; 2], vec![0.0; 2]],
        springs: vec![Spring::Maxwell {
            slip_mm: 14.0,
            relaxation_s: 0.02,
        }],
        spring_n: vec![vec![20.0; 2]],
    };
    let predicted_n = crate::identify::mechanism::predict_elements(&elements, &recording, |_| true);
    assert!(recording.f_n[0].abs() > 0.4, "{}", recording.f_n[0]);
    for i in [0, 1, 5] {
        let error_n = predicted_n[i] - recording.f_n[i];
        assert!(error_n.abs() < 0.03, "{i}: {error_n}");
    }
}

/// `cargo test --release -p study-haptics --lib -- sixty_thousand --ignored --nocapture`
#[test]
#[ignore = "seconds, which depend on the machine"]
fn sixty_thousand_samples_take_seconds() {
    let rubber = Rubber {
        travel_mm: 14.0,
        hardening_n: 5.5,
        branches: [(2.8, 0.03), (4.0, 0.67)],
        moved_s: 0.0,
    };
    let recording = rubber.record(1, trained, 120.0);
    let training = Training::new(&recording).unwrap();
    assert_eq!(recording.len(), 60_000);
    for dx_mm in [1.0, 0.1] {
        let began = std::time::Instant::now();
        let method = Elements { terms: Terms::ALL };
        let found = training.identify(method, dx_mm, Lookup::Linear).unwrap();
        let springs = found.realization.elements.unwrap().springs;
        eprintln!("{dx_mm} mm: {:?} {springs:?}", began.elapsed());
        assert!(began.elapsed().as_secs() < 10);
    }
}

/// A fast branch that slips is a damper whose force has a limit.
#[test]
fn a_damper_with_a_limit_is_found() {
    let mut recording = Rubber {
        travel_mm: 20.0,
        hardening_n: 1.0,
        branches: [(0.0, 1.0); 2],
        moved_s: 0.0,
    }
    .record(3, trained, 25.0);
    let limited = |v_mm_s: f64| (v_mm_s / 15.0).clamp(-1.0, 1.0);
    for (f_n, v_mm_s) in recording.f_n.iter_mut().zip(&recording.v_mm_s) {
        *f_n += limited(*v_mm_s);
    }
    let training = Training::new(&recording).unwrap();
    let method = Elements { terms: Terms::ALL };
    let found = training.identify(method, 1.5, Lookup::Linear).unwrap();
    let springs = found.realization.elements.as_ref().unwrap().springs.clone();
    let vaf = vaf::score(&found.realization, &recording).vaf;
    assert!(vaf >= 0.99, "{vaf} {springs:?}");
    let limited_near = |spring: &Spring| match spring {
        Spring::Maxwell {
            slip_mm,
            relaxation_s,
        } => (12.0..18.0).contains(&(slip_mm / relaxation_s)),
        _ => false,
    };
    assert!(springs.iter().any(limited_near), "{springs:?}");
}
