//! The simulated target compared with a recording of another implementation of the same
//! switch.

#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, SQRT_2, TAU};
use study_haptics::plant::{DT_S, Parameters, Target};
use study_wire::predict::Motion;

/// x = 17.5 + 15·sin(2π·1.5·t) mm, faded in over half a second.
fn position_mm(t_s: f64) -> f64 {
    let fade = 0.5 - 0.5 * (PI * (t_s / 0.5).clamp(0.0, 1.0)).cos();
    17.5 + fade * 15.0 * (TAU * 1.5 * t_s).sin()
}

/// Zero-phase Butterworth filter with two poles, as used for the recording.
fn filtered(mut values: Vec<f64>, corner_hz: f64, rate_hz: f64) -> Vec<f64> {
    let k = (PI * corner_hz / rate_hz).tan();
    let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
    let gain = k * k * norm;
    let back = [
        2.0 * (k * k - 1.0) * norm,
        (1.0 - SQRT_2 * k + k * k) * norm,
    ];
    for _ in 0..2 {
        let first = values[0];
        let (mut x1, mut x2, mut y1, mut y2) = (first, first, first, first);
        for value in &mut values {
            let y = gain * (*value + 2.0 * x1 + x2) - back[0] * y1 - back[1] * y2;
            (x2, x1, y2, y1) = (x1, *value, y1, y);
            *value = y;
        }
        values.reverse();
    }
    values
}

/// Noise of 0.05 N rms leaves about 0.013 N after the filter.
#[test]
fn the_simulated_switch_gives_the_recorded_force() {
    let recording = include_str!("../data/plant/switch_a_1.5hz.csv");
    let mut target = Target::new(Parameters::a(), 17.5).unwrap();
    let mut force = Vec::new();
    for i in 0..(6.0 / DT_S) as usize {
        let t = i as f64 * DT_S;
        let [before, now, after] = [t - DT_S, t, t + DT_S].map(position_mm);
        let felt = target.step(Motion {
            x_mm: now,
            v_mm_s: (after - before) / (2.0 * DT_S),
            a_m_s2: (after - 2.0 * now + before) / (DT_S * DT_S) * 1e-3,
        });
        if i % 40 == 0 {
            force.push(felt);
        }
    }
    let force = filtered(force, 30.0, 1000.0);

    let mut errors = Vec::new();
    let mut recorded = Vec::new();
    for line in recording.lines().filter(|l| !l.starts_with(['#', 't'])) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!((row[1] - position_mm(row[0])).abs() < 0.01, "{line}");
        errors.push(row[2] - force[(row[0] * 1000.0).round() as usize]);
        recorded.push(row[2]);
    }
    assert_eq!(recorded.len(), 600);
    let mean_square =
        |values: &[f64]| -> f64 { values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64 };
    let mean = recorded.iter().sum::<f64>() / recorded.len() as f64;
    let variance = mean_square(&recorded) - mean * mean;
    let vaf = 1.0 - mean_square(&errors) / variance;
    assert!(vaf > 0.9999, "VAF {vaf}");
    assert!(
        mean_square(&errors).sqrt() < 0.03,
        "{}",
        mean_square(&errors).sqrt()
    );
}
