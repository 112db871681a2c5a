//! Every sample is judged or counted: at rest, among lost samples, by a sensor, and against the
//! constants of docs/wire.md.

use super::*;
use study_base::rng::Stream;

/// The sine, held for a second and a half at three of its turns: the position does not move.
fn held(what: &Rendering<'_>) -> Vec<Sample> {
    let mut device = Servo::new(servo());
    device.start();
    let w = std::f64::consts::TAU * STROKES_HZ;
    let (mut moved_s, mut last_x_mm) = (0.0, CENTER_MM - AMPLITUDE_MM);
    let mut samples = Vec::new();
    for tick in 0..(10.0 * HZ) as u32 {
        let t_s = f64::from(tick) / HZ;
        let holds = [1.0..2.5, 3.0..4.5, 5.0..6.5]
            .iter()
            .any(|h| h.contains(&t_s));
        if !holds {
            moved_s += 1.0 / HZ;
        }
        let x_mm = CENTER_MM - AMPLITUDE_MM * (w * moved_s).cos();
        let motion = Motion {
            x_mm,
            v_mm_s: (x_mm - last_x_mm) * HZ,
            a_m_s2: if holds {
                0.0
            } else {
                1e-3 * AMPLITUDE_MM * w * w * (w * moved_s).cos()
            },
        };
        last_x_mm = x_mm;
        let force_command_n = device.step(what, motion);
        if tick % 4 == 0 {
            samples.push(Sample {
                t_s,
                x_mm,
                v_mm_s: motion.v_mm_s,
                force_command_n,
                force_measured_n: None,
            });
        }
    }
    samples
}

/// At rest the force of a table with the rule sign is that of the last direction: the encoder
/// did not move.
#[test]
fn a_force_that_is_wrong_at_rest_is_found() {
    let table = table();
    let right = held(&table.what());
    let found = verdict_of(&right);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    near(found.judged_share, 1.0, 1e-9);
    assert!(found.error_range_share.unwrap() < 0.02, "{found:?}");
    type Change = fn(&Sample) -> f64;
    let wrong: [(&str, Change); 3] = [
        ("folds back", |s| 0.2 * s.force_command_n),
        ("more", |s| s.force_command_n + 0.8),
        ("limp", |_| 0.0),
    ];
    for (what, change) in wrong {
        let samples = forced(&right, |s| match s.v_mm_s.abs() < 5.0 {
            true => change(s),
            false => s.force_command_n,
        });
        let found = verdict_of(&samples);
        assert_eq!(found.verdict, Verdict::Flag, "{what}: {found:?}");
        near(found.rendered_vaf, 1.0, 1e-3);
    }
}

/// A handle that trembles between two steps of the encoder has the force of either branch, or
/// any between them.
#[test]
fn between_the_branches_every_force_of_a_trembling_handle_is_right() {
    let table = table();
    let trembling = |by: f64| {
        let mut samples = held(&table.what());
        for (i, s) in samples.iter_mut().enumerate() {
            if s.v_mm_s.abs() < 5.0 && s.t_s > 1.0 {
                // Beyond the branches by what is above 1.
                let middle_n = 0.2 * (s.x_mm - CENTER_MM);
                s.x_mm += if i % 2 == 0 { 0.001 } else { -0.001 };
                s.v_mm_s = if i % 2 == 0 { 2.0 } else { -2.0 };
                s.force_command_n = middle_n + by * 0.5;
            }
        }
        verdict(&samples, |_| (), |rules| rules.min_vaf = 0.9)
    };
    for by in [-1.0, 0.0, 0.7] {
        let found = trembling(by);
        assert_eq!(found.verdict, Verdict::Ok, "{by}: {found:?}");
    }
    for by in [-2.5, 2.5] {
        let found = trembling(by);
        assert_eq!(found.defects, [Defect::Error], "{by}: {found:?}");
    }
}

/// The samples without those of a message of ten that `lost` names by its number.
fn without(samples: &[Sample], lost: impl Fn(usize) -> bool) -> (Vec<Sample>, u64) {
    let kept: Vec<Sample> = (samples.chunks(10).enumerate())
        .filter(|(i, _)| !lost(*i))
        .flat_map(|(_, chunk)| chunk.to_vec())
        .collect();
    let lost = (samples.len() - kept.len()) as u64;
    (kept, lost)
}

#[test]
fn lost_samples_are_counted_and_bounded() {
    let right = right();
    let said = |lost: fn(usize) -> bool| {
        let (kept, lost) = without(&right, lost);
        verdict(&kept, |played| played.lost = lost, |_| ())
    };
    let found = said(|i| i % 20 == 7);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    near(found.judged_share, 0.95, 1e-3);
    let found = said(|i| i % 10 < 2);
    let why = found.because.as_deref();
    assert_eq!(
        (found.verdict, why),
        (Verdict::TooLittle, Some("too many samples were lost"))
    );
    let found = said(|i| (200..207).contains(&i));
    let why = found.because.as_deref();
    assert_eq!(
        (found.verdict, why),
        (
            Verdict::TooLittle,
            Some("the samples of too long a time were lost")
        )
    );
    let (kept, lost) = without(&right, |i| i % 20 == 7);
    let strict = verdict(
        &kept,
        |played| played.lost = lost,
        |rules| rules.min_judged_share = 0.97,
    );
    let why = strict.because.as_deref();
    assert_eq!(
        (strict.verdict, why),
        (
            Verdict::TooLittle,
            Some("the force of too many samples is not known")
        )
    );
    // A limit of the protocol.
    let (kept, lost) = without(&right, |i| i % 10 < 2);
    let wide = verdict(
        &kept,
        |played| played.lost = lost,
        |rules| rules.max_lost_share = 0.3,
    );
    assert_eq!(wide.verdict, Verdict::Ok, "{wide:?}");
}

/// What comes after lost samples is judged, too.
#[test]
fn a_fault_behind_each_gap_is_found() {
    let limp = forced(&right(), |s| match (s.t_s % 0.2) > 0.13 {
        true => 0.0,
        false => s.force_command_n,
    });
    let (kept, lost) = without(&limp, |i| i % 20 == 12);
    let found = verdict(&kept, |played| played.lost = lost, |_| ());
    assert!(
        matches!(found.verdict, Verdict::Flag | Verdict::Fault),
        "{found:?}"
    );
}

/// A right sensor with noise, an offset and a filter, and what it shows of a wrong motor.
#[test]
fn a_sensor_is_judged_by_the_same_rules() {
    let sensed = |motor: &dyn Fn(&Sample) -> f64| {
        let mut noise = Stream::new(4, &["sensor"]);
        let mut filtered_n = 0.0;
        let mut samples = right();
        for s in &mut samples {
            filtered_n += 0.5 * (motor(s) - filtered_n);
            s.force_measured_n = Some(1.01 * filtered_n + 0.03 + 0.03 * noise.normal());
        }
        verdict_of(&samples)
    };
    let found = sensed(&|s| s.force_command_n);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    assert!(found.measured_error_share.unwrap() < 0.05, "{found:?}");
    assert!((0.0..3.0).contains(&found.measured_delay_ms.unwrap()));
    type Motor = fn(&Sample) -> f64;
    let wrong: [(&str, Motor); 9] = [
        ("limp for 50 ms of each second", |s| {
            match s.t_s.fract() > 0.95 {
                true => 0.0,
                false => s.force_command_n,
            }
        }),
        ("limp at the end", |s| match s.t_s > 4.3 {
            true => 0.0,
            false => s.force_command_n,
        }),
        ("saturated", |s| s.force_command_n.clamp(-1.3, 1.3)),
        ("in one direction", |s| match s.v_mm_s < 0.0 {
            true => 0.88 * s.force_command_n,
            false => s.force_command_n,
        }),
        ("weak after a while", |s| match s.t_s > 3.0 {
            true => 0.88 * s.force_command_n,
            false => s.force_command_n,
        }),
        ("dead zone", |s| {
            s.force_command_n - s.force_command_n.clamp(-0.3, 0.3)
        }),
        ("steps", |s| (s.force_command_n / 0.8).round() * 0.8),
        ("drift", |s| s.force_command_n + 0.15 * s.t_s),
        ("vibration", |s| {
            s.force_command_n + 0.4 * (std::f64::consts::TAU * 200.0 * s.t_s + 0.3).sin()
        }),
    ];
    for (what, motor) in wrong {
        let found = sensed(&motor);
        assert_eq!(found.defects, [Defect::Measured], "{what}: {found:?}");
        near(found.rendered_vaf, 1.0, 1e-3);
    }
    // 20 ms late.
    let right = right();
    let mut late = right.clone();
    for (i, s) in late.iter_mut().enumerate() {
        s.force_measured_n = Some(right[i.saturating_sub(20)].force_command_n);
    }
    let found = verdict_of(&late);
    near(found.measured_delay_ms, 20.0, 0.1);
    assert_eq!(found.defects, [Defect::Measured], "{found:?}");
}

/// A device with another constant renders what it states.
#[test]
fn what_a_device_states_excuses_nothing() {
    let table = table();
    let with = |change: fn(&mut ServoSettings)| {
        let mut own = servo();
        change(&mut own);
        let mut device = Servo::new(own);
        device.start();
        let samples: Vec<Sample> = (played(&table.what(), AMPLITUDE_MM, 5.0).into_iter())
            .map(|s| {
                let mut force_command_n = 0.0;
                for _ in 0..4 {
                    let w = std::f64::consts::TAU * STROKES_HZ;
                    let motion = Motion {
                        x_mm: s.x_mm,
                        v_mm_s: s.v_mm_s,
                        a_m_s2: 1e-3 * AMPLITUDE_MM * w * w * (w * s.t_s).cos(),
                    };
                    force_command_n = device.step(&table.what(), motion);
                }
                Sample {
                    force_command_n,
                    ..s
                }
            })
            .collect();
        verdict(&samples, |played| played.servo = own, |_| ())
    };
    for right in [
        (|own| own.slew_n_s = 1500.0) as fn(&mut ServoSettings),
        |own| own.ramp_s = 0.8,
        |own| own.damping_n_s_per_mm = 0.003,
        |own| own.acceleration_hz = 40.0,
    ] {
        let found = with(right);
        assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
        assert!(found.table_error_share.is_some());
    }
    for wrong in [
        (|own| own.slew_n_s = 5.0) as fn(&mut ServoSettings),
        |own| own.ramp_s = 3.0,
        |own| own.damping_n_s_per_mm = 0.02,
        |own| own.damping_n_s_per_mm = -0.02,
    ] {
        let found = with(wrong);
        assert_eq!(found.defects, [Defect::Constants], "{found:?}");
        assert_eq!(found.verdict, Verdict::Flag);
    }
    assert_eq!(verdict_of(&right()).table_error_share, None);
}

#[test]
fn vibration_and_ticks_that_are_felt_are_found() {
    let added = |more: fn(&Sample) -> f64| {
        let samples = forced(&right(), |s| s.force_command_n + more(s));
        // Less than the vibration that other rules would find.
        verdict(
            &samples,
            |_| (),
            |rules| {
                (rules.min_vaf, rules.max_error_share) = (0.9, 0.3);
            },
        )
    };
    let hum = |s: &Sample| 0.3 * (std::f64::consts::TAU * 250.0 * s.t_s + 0.7).sin();
    let found = added(hum);
    assert_eq!(found.defects, [Defect::Vibration], "{found:?}");
    near(found.vibration_n, 0.3 / 2f64.sqrt(), 0.02);
    let found = added(|s| {
        if (s.t_s + 0.37) % 0.5 < 0.001 {
            4.0
        } else {
            0.0
        }
    });
    assert_eq!(found.defects, [Defect::Vibration], "{found:?}");
    // 0.01 N are not felt.
    let found = added(|s| 0.01 * (std::f64::consts::TAU * 250.0 * s.t_s + 0.7).sin());
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
}

/// 0.1 N for forces above 1 N.
#[test]
fn errors_are_told_in_just_noticeable_differences() {
    let bumpy = bumpy();
    let found = verdict_of(&bumpy);
    near(found.error_jnd, 8.0, 0.5);
    near(found.rendered_error_n, 0.8, 0.05);
    assert!(verdict_of(&right()).error_jnd.unwrap() < 0.2);
}

#[test]
fn a_constant_force_that_is_added_is_the_rms_difference_from_the_table() {
    let (table, model) = (table(), ModelId::new("right").unwrap());
    let of = |samples: &[Sample]| {
        expected(&Played {
            model: &model,
            what: table.what(),
            servo: servo(),
            servo_told: true,
            samples,
            numbered: true,
            lost: 0,
            faded_from_s: None,
            time_ratio: None,
            host_late_s: None,
            others: &[],
        })
    };
    let right = right();
    let found = of(&right);
    assert_eq!(found.samples, right);
    assert_eq!(found.force_n.len(), right.len());
    assert!(
        found.rms_difference_n.unwrap() < 0.05,
        "{:?}",
        found.rms_difference_n
    );
    let added = of(&forced(&right, |s| s.force_command_n + 0.5));
    let rms_n = added.rms_difference_n.unwrap();
    assert!((rms_n - 0.5).abs() < 0.05, "{rms_n}");
    // Between few samples nobody knows the motion; without any there is nothing to tell.
    let few: Vec<Sample> = right.iter().step_by(10).copied().collect();
    assert_eq!(of(&few).rms_difference_n, None);
    assert!(of(&[]).force_n.is_empty());
}

/// When the force of [`fading`] falls, s: over 0.4 s, to the end of five seconds.
const FALLS_S: f64 = 4.6;

/// As [`right`], with a force that falls to the end.
fn fading() -> Vec<Sample> {
    let periods = f64::from(servo().fade_periods());
    let fallen = |s: &Sample| ((s.t_s - FALLS_S) * HZ + 1.0) / periods;
    forced(&right(), |s| match s.t_s < FALLS_S - 0.5 / HZ {
        true => s.force_command_n,
        false => {
            let part = fallen(s).min(1.0);
            s.force_command_n * (0.5 + 0.5 * (std::f64::consts::PI * part).cos())
        }
    })
}

#[test]
fn a_force_that_falls_before_the_end_is_judged_as_such() {
    let told = |played: &mut Played<'_>| played.faded_from_s = Some(FALLS_S);
    let found = verdict(&fading(), told, |_| ());
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    assert_eq!(found.faded_from_s, Some(FALLS_S));
    near(found.rendered_error_n, 0.0, 0.03);
    near(found.judged_share, 1.0, 0.05);
    // A fall that nobody asked for, and one that did not come.
    let found = verdict_of(&fading());
    assert_eq!(found.verdict, Verdict::Flag, "{found:?}");
    let found = verdict(&right(), told, |_| ());
    assert!(found.defects.contains(&Defect::Error), "{found:?}");
    // Twice as fast as it should be: zero after half of the time.
    let fast = forced(&fading(), |s| match s.t_s < FALLS_S + 0.2 {
        true => s.force_command_n,
        false => 0.0,
    });
    let found = verdict(&fast, told, |_| ());
    assert!(found.defects.contains(&Defect::Error), "{found:?}");
}

/// The fall counts for what is told of the constants of the device as little as its ramp.
#[test]
fn a_fall_is_not_compared_with_other_constants() {
    let slow = |own: &mut ServoSettings| own.ramp_s = 0.8;
    let mut settings = servo();
    slow(&mut settings);
    let from_s = 5.0 - f64::from(settings.fade_periods()) / HZ;
    near(Some(from_s), 4.2, 1e-9);
    let (table, w) = (table(), std::f64::consts::TAU * STROKES_HZ);
    let mut device = Servo::new(settings);
    device.start();
    let mut samples = Vec::new();
    for tick in 0..(5.0 * HZ) as u32 {
        let t_s = f64::from(tick) / HZ;
        let motion = Motion {
            x_mm: CENTER_MM - AMPLITUDE_MM * (w * t_s).cos(),
            v_mm_s: AMPLITUDE_MM * w * (w * t_s).sin(),
            a_m_s2: 1e-3 * AMPLITUDE_MM * w * w * (w * t_s).cos(),
        };
        if t_s + 0.5 / HZ >= from_s {
            device.fade();
        }
        let force_command_n = device.step(&table.what(), motion);
        if tick % 4 == 0 {
            samples.push(Sample {
                t_s,
                x_mm: motion.x_mm,
                v_mm_s: motion.v_mm_s,
                force_command_n,
                force_measured_n: None,
            });
        }
    }
    assert!(device.faded());
    let found = verdict(
        &samples,
        |played| {
            slow(&mut played.servo);
            played.faded_from_s = Some(from_s);
        },
        |_| (),
    );
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
}

/// Whoever leans against the wall goes through it in a fall: no force is left then, and none is expected.
#[test]
fn no_force_is_expected_beyond_the_wall_of_a_fall() {
    let (table, w) = (table(), std::f64::consts::TAU * STROKES_HZ);
    let x_mm = |t_s: f64| CENTER_MM - AMPLITUDE_MM * (w * t_s).cos();
    let v_mm_s = |t_s: f64| AMPLITUDE_MM * w * (w * t_s).sin();
    // From the place and the speed at the beginning of the fall to 36 mm within 0.2 s, in half of it.
    let (x0_mm, v0_mm_s) = (x_mm(FALLS_S), v_mm_s(FALLS_S));
    let a_mm_s2 = (36.0 - x0_mm - 0.2 * v0_mm_s) / 0.02;
    let mut device = Servo::new(servo());
    device.start();
    let mut samples = Vec::new();
    for tick in 0..(5.0 * HZ) as u32 {
        let t_s = f64::from(tick) / HZ;
        let since_s = t_s - FALLS_S;
        let falls = since_s > -0.5 / HZ;
        let motion = match falls {
            false => Motion {
                x_mm: x_mm(t_s),
                v_mm_s: v_mm_s(t_s),
                a_m_s2: 1e-3 * AMPLITUDE_MM * w * w * (w * t_s).cos(),
            },
            true => Motion {
                x_mm: x0_mm + since_s * (v0_mm_s + 0.5 * a_mm_s2 * since_s),
                v_mm_s: v0_mm_s + a_mm_s2 * since_s,
                a_m_s2: 1e-3 * a_mm_s2,
            },
        };
        if falls {
            device.fade();
        }
        let force_command_n = device.step(&table.what(), motion);
        if tick % 4 == 0 {
            samples.push(Sample {
                t_s,
                x_mm: motion.x_mm,
                v_mm_s: motion.v_mm_s,
                force_command_n,
                force_measured_n: None,
            });
        }
    }
    assert!(device.faded() && device.held_n() == 0.0);
    let beyond = samples.iter().filter(|s| s.x_mm > 33.0);
    assert!(beyond.clone().count() > 100);
    assert!(beyond.clone().all(|s| s.force_command_n == 0.0));
    let told = |played: &mut Played<'_>| played.faded_from_s = Some(FALLS_S);
    let found = verdict(&samples, told, |_| ());
    assert!(!found.defects.contains(&Defect::Error), "{found:?}");
    // With half of the force of the wall instead.
    let pushed = forced(&samples, |s| match s.x_mm > 33.0 {
        true => 0.5 * LIMIT_N,
        false => s.force_command_n,
    });
    let found = verdict(&pushed, told, |_| ());
    assert!(found.defects.contains(&Defect::Error), "{found:?}");
}
