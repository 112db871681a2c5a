//! Terms that recordings carry and terms that they do not.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::fmt::Write as _;
use study_base::rng::Stream;
use study_haptics::identify::evidence::{self, Term};
use study_haptics::identify::method::Terms;
use study_haptics::identify::{Hat, Method, Passive, Training, Warning};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

/// A newton in gram-force.
const GRAM_FORCE_N: f64 = 9.80665e-3;

/// A measured loop of a switch, at ten samples a second.
pub(crate) fn switch(name: &str) -> Recording {
    recording::read(name, switch_text(name).as_bytes()).unwrap()
}

/// The same as text.
pub(crate) fn switch_text(name: &str) -> String {
    let path = format!(
        "{}/tests/data/switches/{name}.csv",
        env!("CARGO_MANIFEST_DIR")
    );
    let file = std::fs::read_to_string(path).unwrap();
    let mut text = String::from("t_s,x_mm,f_n\n");
    for (i, row) in file.lines().skip(1).enumerate() {
        let mut cells = row.split(',');
        let force: f64 = cells.next().unwrap().parse().unwrap();
        let x_mm = cells.next().unwrap();
        writeln!(text, "{},{x_mm},{}", 0.1 * i as f64, force * GRAM_FORCE_N).unwrap();
    }
    text
}

/// Measured loops of a linear, a clicky and a tactile switch say nothing about mass and damping:
/// tables have none, and say so. Asked for, the mass is kilograms.
#[test]
fn a_slow_loop_of_a_real_switch_has_neither_mass_nor_damping() {
    for name in ["Cherry_MX_Purple_1", "Akko_Blue_V2", "Clickiez_75g_Tactile"] {
        let recording = switch(name);
        let training = Training::new(&recording).unwrap();
        for method in [
            Method::Passive(Passive::default()),
            Method::Hat(Hat::default()),
        ] {
            let found = training.identify(method, 0.1, Lookup::Linear).unwrap();
            let [plus, minus] = [&found.realization.positive, &found.realization.negative];
            for of in [&plus.m_kg, &plus.b_n_s_per_mm, &minus.m_kg] {
                assert!(of.iter().all(|value| *value == 0.0), "{name} {method}");
            }
            let terms: Vec<Term> = (found.warnings.iter())
                .filter_map(|warning| match warning {
                    Warning::LeftOut(evidence) => Some(evidence.term),
                    _ => None,
                })
                .collect();
            assert_eq!(terms, [Term::Mass, Term::Damping], "{name} {method}");
            let [low, high] = recording.range_n();
            let forces = plus.f0_n.iter().chain(&minus.f0_n);
            for force_n in forces {
                let beyond = (low - force_n).max(force_n - high);
                assert!(beyond < 0.1 * (high - low), "{name} {method} {force_n}");
            }
        }
        let asked = Method::Passive(Passive {
            terms: Terms::ALL,
            ..Passive::default()
        });
        let found = training.identify(asked, 0.1, Lookup::Linear).unwrap();
        assert!(found.realization.positive.m_kg[0] > 0.5, "{name}");
        assert!(
            !(found.warnings.iter()).any(|warning| matches!(warning, Warning::LeftOut(_))),
            "{name}"
        );
    }
}

/// 20 s of a target at 200 Hz with a mass and a damping, a detent force and dry friction, by an
/// encoder with counts of 2 µm and a noisy sensor of the force.
fn slow_target(stream: &mut Stream, phase: f64, mass_kg: f64, damping: f64) -> Recording {
    let mut text = String::from("t_s,x_mm,f_n\n");
    for i in 0..4000 {
        let t = f64::from(i) * 0.005;
        let (mut x, mut v, mut a) = (2.0, 0.0, 0.0);
        for (hz, mm) in [(0.3, 1.4), (1.7, 0.3)] {
            let w = hz * std::f64::consts::TAU;
            x += mm * (w * t + phase).sin();
            v += mm * w * (w * t + phase).cos();
            a -= mm * w * w * (w * t + phase).sin() / 1000.0;
        }
        let count_mm = 0.002;
        let measured = (x / count_mm).round() * count_mm;
        let f = mass_kg * a
            + damping * v
            + 0.1f64.copysign(v)
            + 0.3 * (3.0 * x).sin()
            + 0.02 * stream.normal();
        writeln!(text, "{t},{measured},{f}").unwrap();
    }
    recording::read("slow", text.as_bytes()).unwrap()
}

/// A planted damping stays below its bound in at least 95 % of recordings, and in the same motion
/// twice the bound is found in at least 90 %.
#[test]
fn an_upper_bound_covers_and_twice_the_bound_is_found() {
    let mut stream = Stream::new(24, &["evidence"]);
    let evidence =
        |recording: &Recording| evidence::of(&[recording], recording.range_mm()).unwrap()[1];
    let sets = 40;
    let (mut covered, mut found) = (0, 0);
    for set in 0..sets {
        let phase = 0.5 * f64::from(set);
        let nothing = evidence(&slow_target(&mut stream, phase, 0.0, 0.0));
        assert!(!nothing.carried, "{nothing:?}");
        let bound = nothing.upper_bound.unwrap();
        let planted = 0.7 * bound;
        let small = evidence(&slow_target(&mut stream, phase, 0.0, planted));
        covered += usize::from(small.upper_bound.unwrap() >= planted);
        let large = evidence(&slow_target(&mut stream, phase, 0.0, 2.0 * bound));
        found += usize::from(large.carried);
    }
    assert!(covered >= 38, "{covered} of {sets}");
    assert!(found >= 36, "{found} of {sets}");
}

/// The acceleration of an encoder at 200 Hz is noise, by which a table would find a third of the mass: none is claimed there, even where it
/// is large enough to be felt. The estimate beside the bound has no such bias.
#[test]
fn a_mass_that_the_encoder_cannot_show_is_not_claimed() {
    let mut stream = Stream::new(25, &["evidence"]);
    let recording = slow_target(&mut stream, 0.0, 0.05, 0.03);
    let [mass, damping] = evidence::of(&[&recording], recording.range_mm()).unwrap();
    assert!(!mass.carried && mass.reliability < 0.5, "{mass:?}");
    let errors = (mass.value - 0.05) / mass.standard_error;
    assert!(errors.abs() < 3.0, "{mass:?}");
    assert!(
        mass.upper_bound.is_none_or(|bound| bound > 0.05),
        "{mass:?}"
    );
    assert!(damping.carried, "{damping:?}");
    assert!((damping.value - 0.03).abs() < 0.1 * 0.03, "{damping:?}");
}

/// 20 s of a lever at 500 Hz whose friction sticks over four lengths at once (Maxwell-slip elements), with neither mass nor damping.
fn sticking_at_four_lengths(stream: &mut Stream) -> Recording {
    let travel_mm = 30.0;
    let tones: Vec<[f64; 3]> = (0..9)
        .map(|_| {
            let hz = 0.15 * (3.5f64 / 0.15).powf(stream.unit());
            let phase = std::f64::consts::TAU * stream.unit();
            [hz, hz.powf(-0.7) * (0.3 * stream.normal()).exp(), phase]
        })
        .collect();
    let most: f64 = tones.iter().map(|[_, size, _]| size).sum();
    let shares: Vec<f64> = (0..4).map(|_| -stream.unit().ln()).collect();
    let all: f64 = shares.iter().sum();
    let lengths_mm: Vec<f64> = [0.002, 0.006, 0.015, 0.03]
        .map(|share| share * travel_mm * (0.5 + stream.unit()))
        .to_vec();
    let (mut states, mut last_mm) = ([0.0f64; 4], None);
    let mut text = String::from("t_s,x_mm,f_n\n");
    // in steps of 0.25 ms, of which every eighth is recorded
    for i in 0..80_000 {
        let t = f64::from(i) * 2.5e-4;
        let wave: f64 = (tones.iter())
            .map(|[hz, size, phase]| size * (std::f64::consts::TAU * hz * t + phase).sin())
            .sum();
        let x = 0.5 * travel_mm * (1.0 + 0.96 * wave / most);
        let moved = x - last_mm.replace(x).unwrap_or(x);
        for (state, length_mm) in states.iter_mut().zip(&lengths_mm) {
            *state = (*state + moved / length_mm).clamp(-1.0, 1.0);
        }
        if i % 8 > 0 {
            continue;
        }
        let friction: f64 = states.iter().zip(&shares).map(|(z, s)| z * s / all).sum();
        let f = 3.0 + 2.0 * (0.3 * x).sin() + 0.5 * friction + 0.02 * stream.normal();
        let measured = (x / 0.005).round() * 0.005;
        writeln!(text, "{t:.4},{measured:.4},{f:.4}").unwrap();
    }
    recording::read("sticking", text.as_bytes()).unwrap()
}

/// Friction that sticks over several lengths leaves forces at each reversal that a single length does not explain. They are neither mass
/// nor damping.
#[test]
fn friction_of_four_lengths_is_neither_mass_nor_damping() {
    let mut stream = Stream::new(26, &["evidence"]);
    for set in 0..12 {
        let recording = sticking_at_four_lengths(&mut stream);
        for term in evidence::of(&[&recording], recording.range_mm()).unwrap() {
            assert!(!term.found, "{set} {term:?}");
        }
    }
}
