//! Weak forces, and forces that are wrong in a part of a playback.

use super::*;

/// A table with a tenth of the force: every limit in N is far away.
#[test]
fn a_tenth_of_a_weak_force_is_found() {
    let tenth = |p: [f64; 2]| p.map(|p| 0.1 * p);
    let strong = table();
    let weak = Table {
        x_mm: strong.x_mm,
        m_kg: tenth(strong.m_kg),
        b_n_s_per_mm: tenth(strong.b_n_s_per_mm),
        k_n_per_mm: tenth(strong.k_n_per_mm),
        f0_n: strong.f0_n.map(tenth),
    };
    let right = played(&weak.what(), AMPLITUDE_MM, 5.0);
    let said = |samples: &[Sample]| verdict_about(&weak, samples, |_| (), |_| ());
    let found = said(&right);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    assert!(found.rendered_error_share.unwrap() < 0.01, "{found:?}");
    let square: f64 = right.iter().map(|s| s.force_command_n.powi(2)).sum();
    let rms_n = (square / right.len() as f64).sqrt();
    assert!(rms_n < 0.25, "{rms_n}");
    // An offset; the share of the samples after the ramp differs a little.
    for by in [-0.12, 0.12] {
        let found = said(&forced(&right, |s| s.force_command_n + by * rms_n));
        assert_eq!(found.defects, [Defect::Bias], "{by}: {found:?}");
        near(found.rendered_error_share, 0.12, 0.02);
    }
    let found = said(&forced(&right, |s| s.force_command_n + 0.05 * rms_n));
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    type Change = fn(&Sample) -> f64;
    let others: [(&str, Change); 8] = [
        ("0.85", |s| 0.85 * s.force_command_n),
        ("1.15", |s| 1.15 * s.force_command_n),
        ("forwards", |s| match s.v_mm_s > 0.0 {
            true => 0.88 * s.force_command_n,
            false => s.force_command_n,
        }),
        ("after a while", |s| match s.t_s > 3.0 {
            true => 0.88 * s.force_command_n,
            false => s.force_command_n,
        }),
        ("dead zone", |s| match s.force_command_n.abs() < 0.1 {
            true => 0.0,
            false => s.force_command_n,
        }),
        ("steps", |s| (s.force_command_n / 0.1).round() * 0.1),
        ("one-sided", |s| s.force_command_n.min(0.12)),
        ("friction", |s| s.force_command_n + 0.03 * s.v_mm_s.signum()),
    ];
    for (what, change) in others {
        let found = said(&forced(&right, change));
        assert_eq!(found.verdict, Verdict::Flag, "{what}: {found:?}");
    }
    // A limit of the protocol.
    let biased = forced(&right, |s| s.force_command_n + 0.12 * rms_n);
    let wide = verdict_about(&weak, &biased, |_| (), |rules| rules.max_error_share = 0.2);
    assert_eq!(wide.verdict, Verdict::Ok, "{wide:?}");
}

/// On average over a long playback it is right.
#[test]
fn a_device_that_turns_wrong_late_or_in_one_direction_is_found() {
    let long = played(&table().what(), AMPLITUDE_MM, 12.5);
    assert_eq!(verdict_of(&long).verdict, Verdict::Ok);
    let late = forced(&long, |s| {
        let by = if s.t_s > 10.4 { 0.88 } else { 1.0 };
        by * s.force_command_n
    });
    let found = verdict_of(&late);
    assert_eq!(found.defects, [Defect::Error], "{found:?}");
    near(found.rendered_error_share, 0.12, 1e-3);
    near(found.rendered_gain, 0.98, 5e-3);
    let way = forced(&long, |s| {
        let by = if s.v_mm_s < 0.0 { 0.89 } else { 1.0 };
        by * s.force_command_n
    });
    let found = verdict_of(&way);
    assert_eq!(found.verdict, Verdict::Flag, "{found:?}");
    near(found.rendered_error_share, 0.11, 1e-3);
}

/// The hand turns while samples are lost: which branch is felt is known when it has moved
/// on.
#[test]
fn a_turn_among_lost_samples_accuses_nobody() {
    let table = table();
    let with_rule = |rule| {
        let what = table.what();
        let Law::Table { table: view, .. } = what.law else {
            unreachable!("it is a table");
        };
        Rendering {
            law: Law::Table { table: view, rule },
            ..what
        }
    };
    for rule in [
        Direction::Play { delta_mm: 2.0 },
        Direction::Dahl { delta_mm: 2.0 },
    ] {
        let what = with_rule(rule);
        // It turns each half second.
        let kept: Vec<Sample> = (played(&what, AMPLITUDE_MM, 5.0).into_iter())
            .filter(|s| (s.t_s + 0.0225).rem_euclid(0.5) > 0.045)
            .collect();
        let said = |samples: &[Sample]| {
            verdict(
                samples,
                |played| {
                    let Law::Table { rule: own, .. } = &mut played.what.law else {
                        unreachable!("it is a table");
                    };
                    *own = rule;
                    played.lost = 450;
                },
                |_| (),
            )
        };
        let found = said(&kept);
        assert_eq!(found.verdict, Verdict::Ok, "{rule:?}: {found:?}");
        let weak = forced(&kept, |s| 0.88 * s.force_command_n);
        assert_eq!(said(&weak).verdict, Verdict::Flag);
    }
}

/// A keyboard switch: 0.26 to 0.64 N over 4 mm, at its own speed. The standard deviation is
/// below 0.1 N.
#[test]
fn a_key_of_four_millimetres_is_judged() {
    let key = Table {
        x_mm: [13.0, 17.0],
        m_kg: [0.0; 2],
        b_n_s_per_mm: [0.0; 2],
        k_n_per_mm: [0.05; 2],
        f0_n: [[-0.2; 2], [-0.3; 2]],
    };
    let scaled = |gain: f64| {
        let mut samples = played(&key.what(), 1.8, 5.0);
        samples.iter_mut().for_each(|s| s.force_command_n *= gain);
        let told = |played: &mut Played<'_>| {
            played.what.range_mm = [13.0, 17.0];
            played.what.trained_mm_s = 20.0;
        };
        verdict_about(&key, &samples, told, |_| ())
    };
    let right = scaled(1.0);
    assert_eq!((right.verdict, right.because), (Verdict::Ok, None));
    let half = scaled(0.5);
    assert!(half.verdict == Verdict::Flag && half.defects.contains(&Defect::Gain));
}
