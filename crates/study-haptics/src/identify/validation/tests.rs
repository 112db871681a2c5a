//! Validation of synthetic recordings with known results.

use super::*;
use crate::identify::Training;
use std::fmt::Write as _;
use study_wire::predict::Lookup;

/// A 0.5 Hz stroke over 0 to 30 mm at 1 kHz; force by position and sign of v.
fn recording(name: &str, force: impl Fn(usize, f64, f64) -> f64) -> Recording {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..8000 {
        let t = i as f64 * 0.001;
        let w = std::f64::consts::PI;
        let (x, v) = (15.0 - 15.0 * (w * t).cos(), 15.0 * w * (w * t).sin());
        let a = 15.0 * w * w * (w * t).cos() / 1000.0;
        writeln!(text, "{t},{x},{v},{a},{}", force(i, x, v)).unwrap();
    }
    crate::recording::read(name, text.as_bytes()).unwrap()
}

/// Three detents at 5, 15 and 25 mm with crests at 10 and 20.
fn switch(x: f64, v: f64) -> f64 {
    -4.0 * (std::f64::consts::TAU * x / 10.0).sin() + 0.5 * v.signum()
}

#[test]
fn detents_lie_between_crests() {
    let r = recording("r", |_, x, v| switch(x, v));
    let found = detents(&r);
    assert_eq!(found.len(), 3, "{found:?}");
    for (range, [low, high]) in found.iter().zip([[0.0, 10.0], [10.0, 20.0], [20.0, 30.0]]) {
        assert!((range[0] - low).abs() < 0.6 && (range[1] - high).abs() < 0.6);
    }
    // The same switch as weak as a key has the same detents.
    let weak = recording("w", |_, x, v| 0.05 * switch(x, v));
    assert_eq!(detents(&weak), found);
    // a spring has none
    assert!(detents(&recording("s", |_, x, _| 0.4 * x - 6.0)).is_empty());
}

#[test]
fn parts_add_up_and_a_constant_error_is_in_the_nrmse_only() {
    let r = recording("r", |_, x, v| switch(x, v));
    let training = Training::new(&r).unwrap();
    let found = training
        .identify(crate::identify::Static, 0.5, Lookup::Linear)
        .unwrap();
    let shifted = recording("s", |_, x, v| switch(x, v) - 1.5);
    let plain = validate(&found.realization, &r, &detents(&r)).unwrap();
    let off = validate(&found.realization, &shifted, &detents(&r)).unwrap();
    assert!((off.whole.vaf - plain.whole.vaf).abs() < 1e-9);
    // 0.1 N, and a tenth of the greatest force of a recording as weak as a key (0.45 N)
    let weak = recording("w", |_, x, v| 0.1 * switch(x, v));
    let weak = validate(&found.realization, &weak, &[]).unwrap();
    assert_eq!(plain.noticeable_n, 0.1);
    assert!(
        (weak.noticeable_n - 0.045).abs() < 1e-6,
        "{}",
        weak.noticeable_n
    );
    assert!((off.whole.bias_n - plain.whole.bias_n - 1.5).abs() < 1e-9);
    let sd = mean_and_variance(&shifted.f_n).1.sqrt();
    let expected = (off.whole.residual_n.powi(2) + off.whole.bias_n.powi(2)).sqrt() / sd;
    assert!((off.whole.nrmse - expected).abs() < 1e-12);
    // σ_F √(1 − VAF)
    let residual = sd * (1.0 - off.whole.vaf).sqrt();
    assert!((residual - off.whole.residual_n).abs() < 1e-9);
    let of = |part: Option<Accuracy>| part.unwrap().samples;
    let detents: usize = plain.detents.iter().map(|(_, part)| of(*part)).sum();
    assert_eq!(detents, r.len());
    let still = r.v_mm_s.iter().filter(|v| **v == 0.0).count();
    assert_eq!(of(plain.positive) + of(plain.negative) + still, r.len());
    // An error of one direction is found there.
    let forwards = |_, x, v: f64| switch(x, v) - if v > 0.0 { 1.5 } else { 0.0 };
    let off = validate(&found.realization, &recording("f", forwards), &[]).unwrap();
    let bias = |part: Option<Accuracy>| part.unwrap().bias_n;
    assert!((bias(off.positive) - bias(plain.positive) - 1.5).abs() < 1e-9);
    assert!((bias(off.negative) - bias(plain.negative)).abs() < 1e-9);
}

#[test]
fn the_ceiling_of_a_repetition_is_its_noise() {
    // independent, ±0.2 N: the noise of each recording is 0.2 N
    let noise = |seed: usize| {
        move |i: usize| {
            let mut h = (i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            if (h >> 40) & 1 == 0 { 0.2 } else { -0.2 }
        }
    };
    let (one, two) = (noise(3), noise(77_777));
    let a = recording("a", |i, x, v| switch(x, v) + one(i));
    let b = recording("b", |i, x, v| switch(x, v) + two(i));
    let found = ceiling(&a, &b).unwrap();
    assert!((found.noise_n - 0.2).abs() < 0.01, "{found:?}");
    let expected = 1.0 - 0.04 / mean_and_variance(&a.f_n).1;
    assert!((found.vaf - expected).abs() < 1e-3, "{found:?} {expected}");
    assert!(found.apart_mm < 1e-12);
}

#[test]
fn another_trajectory_gives_no_ceiling() {
    let a = recording("a", |_, x, v| switch(x, v));
    let mut b = recording("b", |_, x, v| switch(x, v));
    for x in &mut b.x_mm {
        *x += 2.0;
    }
    assert_eq!(ceiling(&a, &b), None);
}
