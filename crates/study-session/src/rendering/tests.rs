//! Analytic cases: a table whose force can be written down, and devices that deviate
//! from it in a known way.

use super::*;
use study_wire::predict::{BranchView, Direction, Lookup, Motion, TableView};
use study_wire::servo::{Law, Rendering, Servo};

mod parts;
mod uneven;
mod whole;

const HZ: f64 = 4000.0;
/// Position about which the hand moves, amplitude, mm, and frequency, Hz.
const CENTER_MM: f64 = 15.0;
const AMPLITUDE_MM: f64 = 10.0;
const STROKES_HZ: f64 = 1.0;
const LIMIT_N: f64 = 9.0;

/// A realization with constant parameters and a friction.
struct Table {
    x_mm: [f64; 2],
    m_kg: [f64; 2],
    b_n_s_per_mm: [f64; 2],
    k_n_per_mm: [f64; 2],
    f0_n: [[f64; 2]; 2],
}

/// F = 0.1 kg·a + 0.01 N·s/mm·v + 0.2 N/mm·(x − 15 mm) ± 0.5 N.
fn table() -> Table {
    Table {
        x_mm: [0.0, 30.0],
        m_kg: [0.1; 2],
        b_n_s_per_mm: [0.01; 2],
        k_n_per_mm: [0.2; 2],
        f0_n: [[-2.5; 2], [-3.5; 2]],
    }
}

impl Table {
    fn what(&self) -> Rendering<'_> {
        let branch = |f0_n| BranchView {
            m_kg: &self.m_kg,
            b_n_s_per_mm: &self.b_n_s_per_mm,
            k_n_per_mm: &self.k_n_per_mm,
            f0_n,
        };
        Rendering {
            law: Law::Table {
                table: TableView {
                    x_mm: &self.x_mm,
                    positive: branch(&self.f0_n[0]),
                    negative: branch(&self.f0_n[1]),
                    lookup: Lookup::Linear,
                },
                rule: Direction::Sign,
            },
            range_mm: [0.0, 30.0],
            trained_mm_s: 200.0,
        }
    }
}

fn servo() -> ServoSettings {
    ServoSettings {
        servo_hz: HZ,
        force_n: LIMIT_N,
        ..ServoSettings::default()
    }
}

/// A sine for `seconds`, rendered by a device with this table at 4 kHz and reported at
/// 1 kHz.
fn played(what: &Rendering<'_>, amplitude_mm: f64, seconds: f64) -> Vec<Sample> {
    played_at(what, amplitude_mm, seconds, |_, v_mm_s| v_mm_s)
}

/// The same with another speed of each servo period.
fn played_at(
    what: &Rendering<'_>,
    amplitude_mm: f64,
    seconds: f64,
    speed: impl Fn(u32, f64) -> f64,
) -> Vec<Sample> {
    let mut device = Servo::new(servo());
    device.start();
    let w = std::f64::consts::TAU * STROKES_HZ;
    let mut samples = Vec::new();
    for tick in 0..(seconds * HZ) as u32 {
        let t_s = f64::from(tick) / HZ;
        let motion = Motion {
            x_mm: CENTER_MM - amplitude_mm * (w * t_s).cos(),
            v_mm_s: speed(tick, amplitude_mm * w * (w * t_s).sin()),
            a_m_s2: 1e-3 * amplitude_mm * w * w * (w * t_s).cos(),
        };
        let force_command_n = device.step(what, motion);
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
    samples
}

fn right() -> Vec<Sample> {
    played(&table().what(), AMPLITUDE_MM, 5.0)
}

fn verdict_of(samples: &[Sample]) -> Fidelity {
    verdict(samples, |_| (), |_| ())
}

/// Judges samples with changes of the playback and of the rules.
fn verdict(
    samples: &[Sample],
    change: impl FnOnce(&mut Played<'_>),
    rule: impl FnOnce(&mut RenderingRules),
) -> Fidelity {
    verdict_about(&table(), samples, change, rule)
}

/// The same about another table.
fn verdict_about(
    table: &Table,
    samples: &[Sample],
    change: impl FnOnce(&mut Played<'_>),
    rule: impl FnOnce(&mut RenderingRules),
) -> Fidelity {
    let model = ModelId::new("right").unwrap();
    let other = Table {
        k_n_per_mm: [0.0; 2],
        f0_n: [[3.0; 2], [-1.0; 2]],
        ..self::table()
    };
    let others = [(ModelId::new("other").unwrap(), other.what())];
    let mut played = Played {
        model: &model,
        what: table.what(),
        servo: servo(),
        servo_told: true,
        samples,
        numbered: true,
        lost: 0,
        faded_from_s: None,
        time_ratio: Some(1.0),
        host_late_s: None,
        others: &others,
    };
    let mut rules = RenderingRules::default();
    change(&mut played);
    rule(&mut rules);
    judge(&played, &rules)
}

/// The samples with another commanded force.
fn forced(samples: &[Sample], force: impl Fn(&Sample) -> f64) -> Vec<Sample> {
    (samples.iter())
        .map(|s| Sample {
            force_command_n: force(s),
            ..*s
        })
        .collect()
}

fn near(value: Option<f64>, expected: f64, within: f64) {
    let found = value.expect("a value");
    assert!(
        (found - expected).abs() <= within,
        "{found}, not {expected}"
    );
}

#[test]
fn a_right_device_is_ok() {
    let found = verdict_of(&right());
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    near(found.rendered_vaf, 1.0, 1e-4);
    near(found.rendered_gain, 1.0, 1e-3);
    near(found.rendered_bias_n, 0.0, 1e-3);
    near(found.rendered_delay_ms, 0.0, 0.1);
    near(found.speed_gain, 1.0, 0.01);
    // Ten strokes of 20 mm; two thirds of the range of 30 mm; 2π·10 mm/s.
    near(found.travel_mm, 200.0, 0.1);
    near(found.range_share, 2.0 / 3.0, 1e-3);
    near(found.top_speed_mm_s, 62.83, 0.1);
    assert_eq!(found.nearest_model, Some(ModelId::new("right").unwrap()));
    assert_eq!((found.over_limit_n, found.measured_vaf), (None, None));
}

/// Near its ends of motion the handle trembles by one step of the encoder: the direction
/// changes in the period of each sample, and the force is on its way.
#[test]
fn a_direction_that_changes_between_samples_accuses_nobody() {
    let trembling = |tick: u32, v_mm_s: f64| {
        let side = if (tick / 4).is_multiple_of(2) {
            5.4
        } else {
            -5.4
        };
        if v_mm_s.abs() < 25.0 { side } else { v_mm_s }
    };
    let samples = played_at(&table().what(), AMPLITUDE_MM, 5.0, trembling);
    let found = verdict_of(&samples);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    near(found.rendered_vaf, 1.0, 1e-3);
    near(found.rendered_delay_ms, 0.0, 0.2);
    let found = verdict_of(&forced(&samples, |s| 0.8 * s.force_command_n));
    assert_eq!(found.defects, [Defect::Gain], "{found:?}");
    // A direction that is late by 10 ms is late long after it is known.
    let late = |i: usize| samples[i.saturating_sub(10)].force_command_n;
    let shifted: Vec<Sample> = (samples.iter().enumerate())
        .map(|(i, s)| Sample {
            force_command_n: late(i),
            ..*s
        })
        .collect();
    let found = verdict(&shifted, |_| (), |rules| rules.max_delay_ms = 8.0);
    assert_eq!(found.verdict, Verdict::Flag, "{found:?}");
}

/// The ratio alone would find a shape in the rounding of the numbers.
#[test]
fn a_residual_of_rounding_is_no_shape() {
    let jitter = |size_n: f64| {
        let side = |s: &Sample| (1e3 * s.t_s).round().rem_euclid(2.0) - 0.5;
        let samples = forced(&right(), |s| s.force_command_n + size_n * side(s));
        verdict(&samples, |_| (), |rules| rules.min_vaf = 0.999_999)
    };
    let found = jitter(0.01);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    let found = jitter(0.1);
    assert_eq!(found.defects, [Defect::Shape], "{found:?}");
}

/// VAF 1 − (1 − g)² for a gain of g.
#[test]
fn a_gain_is_its_slope_and_no_other_defect() {
    for gain in [0.5, 0.85, 1.15] {
        let found = verdict_of(&forced(&right(), |s| gain * s.force_command_n));
        near(found.rendered_gain, gain, 1e-3);
        near(found.rendered_vaf, 1.0 - (1.0 - gain).powi(2), 1e-3);
        assert_eq!(found.defects, [Defect::Gain], "{gain}: {found:?}");
        assert_eq!(found.verdict, Verdict::Flag);
    }
    let found = verdict_of(&forced(&right(), |s| 0.0 * s.force_command_n));
    near(found.rendered_gain, 0.0, 1e-9);
    assert!(found.defects.contains(&Defect::Gain), "{found:?}");
}

#[test]
fn a_reversed_force_is_a_fault() {
    let found = verdict_of(&forced(&right(), |s| -s.force_command_n));
    near(found.rendered_gain, -1.0, 1e-3);
    assert_eq!(found.defects, [Defect::Sign]);
    assert_eq!(found.verdict, Verdict::Fault);
}

#[test]
fn a_constant_force_is_a_bias() {
    let found = verdict_of(&forced(&right(), |s| s.force_command_n - 0.3));
    near(found.rendered_bias_n, -0.3, 1e-3);
    near(found.rendered_vaf, 1.0, 1e-3);
    assert_eq!(found.defects, [Defect::Bias]);
}

#[test]
fn a_late_force_has_its_delay_below_one_sample() {
    for delay_ms in [7.0, 10.25, 20.0] {
        let right = right();
        let at = |t_ms: f64| {
            let (left, part) = (t_ms.max(0.0).floor(), t_ms.max(0.0).fract());
            let force = |i: f64| right[(i as usize).min(right.len() - 1)].force_command_n;
            force(left) + part * (force(left + 1.0) - force(left))
        };
        let found = verdict_of(&forced(&right, |s| at(1e3 * s.t_s - delay_ms)));
        near(found.rendered_delay_ms, delay_ms, 0.5);
        assert_eq!(found.defects, [Defect::Delay], "{delay_ms}: {found:?}");
    }
}

#[test]
fn a_missing_term_is_named_as_another_shape() {
    // Without damping, a tenth of the force is missing at the largest speed.
    let undamped = Table {
        b_n_s_per_mm: [0.0; 2],
        ..table()
    };
    let found = verdict_of(&played(&undamped.what(), AMPLITUDE_MM, 5.0));
    assert_eq!(found.verdict, Verdict::Flag, "{found:?}");
    let one_way = Table {
        f0_n: [[-2.5; 2]; 2],
        ..table()
    };
    let found = verdict_of(&played(&one_way.what(), AMPLITUDE_MM, 5.0));
    assert_ne!(found.verdict, Verdict::Ok, "{found:?}");
}

/// 0.8 N too much within 0.7 mm of one place.
fn bumpy() -> Vec<Sample> {
    forced(&right(), |s| {
        let bump = if (s.x_mm - 20.0).abs() < 0.7 {
            0.8
        } else {
            0.0
        };
        s.force_command_n + bump
    })
}

/// The variance hardly changes.
#[test]
fn a_wrong_force_at_one_place_is_an_error() {
    let bumpy = bumpy();
    // Less than the wrong force changes the share of variance that counts.
    let found = verdict(&bumpy, |_| (), |rules| rules.min_vaf = 0.985);
    assert_eq!(found.defects, [Defect::Error], "{found:?}");
    near(found.rendered_error_n, 0.8, 0.05);
}

#[test]
fn the_table_of_another_trial_is_a_fault_and_named() {
    let other = Table {
        k_n_per_mm: [0.0; 2],
        f0_n: [[3.0; 2], [-1.0; 2]],
        ..table()
    };
    let found = verdict_of(&played(&other.what(), AMPLITUDE_MM, 5.0));
    assert_eq!(found.defects, [Defect::OtherTable], "{found:?}");
    assert_eq!(found.nearest_model, Some(ModelId::new("other").unwrap()));
    assert_eq!(found.verdict, Verdict::Fault);
}

#[test]
fn a_force_above_the_limit_is_a_fault_also_of_an_unknown_servo() {
    let found = verdict(
        &right(),
        |played| {
            played.servo.force_n = 1.5;
            played.servo_told = false;
        },
        |_| (),
    );
    assert!(found.defects.contains(&Defect::OverLimit), "{found:?}");
    assert_eq!(found.verdict, Verdict::Fault);
    // The largest force of the table here: ((2 − 0.395)² + 0.628²)½ + 0.5 with rounding.
    let most = right()
        .iter()
        .map(|s| s.force_command_n.abs())
        .fold(0.0, f64::max);
    near(found.over_limit_n, most - 1.5, 1e-9);
    near(found.max_force_n, most, 1e-9);
}

/// What a sensor feels counts where it lasts.
#[test]
fn a_measured_force_above_the_limit_is_a_fault_if_it_lasts() {
    let felt = |ms: usize| {
        let mut samples = right();
        for (i, s) in samples.iter_mut().enumerate() {
            let strong = (2000..2000 + ms).contains(&i);
            s.force_measured_n = Some(if strong {
                2.0 * LIMIT_N
            } else {
                s.force_command_n
            });
        }
        verdict_of(&samples)
    };
    let found = felt(200);
    near(found.over_limit_n, LIMIT_N, 1e-9);
    assert!(found.defects.contains(&Defect::OverLimit), "{found:?}");
    assert_eq!(felt(5).over_limit_n, None);
}

#[test]
fn a_limp_motor_with_a_sensor_is_found() {
    let mut limp = right();
    limp.iter_mut().for_each(|s| s.force_measured_n = Some(0.0));
    let found = verdict_of(&limp);
    assert_eq!(found.defects, [Defect::Measured]);
    near(found.measured_gain, 0.0, 1e-9);
    near(found.rendered_vaf, 1.0, 1e-4);
    for gain in [-1.0, 0.85, 1.15] {
        let mut weak = right();
        (weak.iter_mut()).for_each(|s| s.force_measured_n = Some(gain * s.force_command_n));
        let found = verdict_of(&weak);
        near(found.measured_gain, gain, 1e-9);
        assert_eq!(found.defects, [Defect::Measured], "{gain}");
    }
    let mut good = right();
    (good.iter_mut()).for_each(|s| s.force_measured_n = Some(s.force_command_n + 0.1));
    let found = verdict_of(&good);
    near(found.measured_bias_n, 0.1, 1e-9);
    assert_eq!(found.verdict, Verdict::Ok);
}

#[test]
fn sensors_and_clocks_that_disagree_are_found() {
    let samples: Vec<Sample> = (right().iter())
        .map(|s| Sample {
            v_mm_s: 0.5 * s.v_mm_s,
            ..*s
        })
        .collect();
    let found = verdict_of(&samples);
    near(found.speed_gain, 0.5, 0.01);
    assert!(found.defects.contains(&Defect::Speed), "{found:?}");
    let at_ratio = |host_late_s| {
        let change = |played: &mut Played<'_>| {
            (played.time_ratio, played.host_late_s) = (Some(0.8), host_late_s);
        };
        verdict(&right(), change, |_| ()).defects
    };
    assert_eq!(at_ratio(None), [Defect::Clock]);
    assert_eq!(at_ratio(Some(0.002)), [Defect::Clock]);
    // A computer that reads late makes the arrivals uneven, not the clock of the device.
    assert_eq!(at_ratio(Some(0.2)), []);
    let mut stale = right();
    for i in (0..stale.len()).filter(|i| i % 3 > 0) {
        let t_s = stale[i].t_s;
        stale[i] = Sample {
            t_s,
            ..stale[i - 1]
        };
    }
    assert!(verdict_of(&stale).defects.contains(&Defect::Samples));
    let mut not_finite = right();
    not_finite[70].x_mm = f64::NAN;
    assert_eq!(verdict_of(&not_finite).defects, [Defect::Samples]);
}

#[test]
fn too_little_is_never_ok() {
    assert_eq!(verdict_of(&[]).verdict, Verdict::TooLittle);
    assert_eq!(verdict_of(&right()[..1]).verdict, Verdict::TooLittle);
    // Only the ramp; a hand that rests; one that moves by a millimeter.
    assert_eq!(verdict_of(&right()[..400]).verdict, Verdict::TooLittle);
    for amplitude_mm in [0.0, 0.1, 0.5] {
        let found = verdict_of(&played(&table().what(), amplitude_mm, 5.0));
        assert_eq!(
            found.verdict,
            Verdict::TooLittle,
            "{amplitude_mm}: {found:?}"
        );
        assert!(found.because.is_some());
    }
    // A slow report of everything.
    let slow: Vec<Sample> = right().into_iter().step_by(5).collect();
    let found = verdict_of(&slow);
    assert_eq!(found.verdict, Verdict::TooLittle, "{found:?}");
    // Half a stroke: never back.
    let found = verdict_of(&right()[..500]);
    assert_eq!(found.verdict, Verdict::TooLittle, "{found:?}");
}

/// At 100 samples a second nobody knows how the hand moved between two of them; a force at rest is known.
#[test]
fn a_slow_report_of_the_right_force_accuses_nobody() {
    let steep = Table {
        k_n_per_mm: [1.0; 2],
        f0_n: [[-13.0; 2], [-17.0; 2]],
        ..table()
    };
    let trembling = |tick: u32, v_mm_s: f64| v_mm_s + 40.0 * f64::from(tick % 5) - 80.0;
    let fast = played_at(&steep.what(), AMPLITUDE_MM, 5.0, trembling);
    for every in [3, 5, 10, 25] {
        let slow: Vec<Sample> = fast.iter().copied().step_by(every).collect();
        let found = verdict_about(&steep, &slow, |_| (), |_| ());
        assert_eq!(found.verdict, Verdict::TooLittle, "{every}: {found:?}");
    }
    let rests = played(&table().what(), 0.0, 5.0);
    let slow: Vec<Sample> = rests.into_iter().step_by(10).collect();
    assert_eq!(verdict_of(&slow).verdict, Verdict::TooLittle);
    let wrong = forced(&slow, |s| s.force_command_n + 2.0);
    assert_eq!(verdict_of(&wrong).defects, [Defect::Error]);
}

/// An accelerometer knows what the positions do not tell.
#[test]
fn steps_of_the_position_accuse_nobody_and_excuse_nothing() {
    let heavy = Table {
        m_kg: [0.8; 2],
        ..table()
    };
    let model = ModelId::new("heavy").unwrap();
    let with_steps = |step_mm: f64, by: f64| {
        let rounded = |x_mm: f64| (x_mm / step_mm).round() * step_mm;
        let samples: Vec<Sample> = (played(&heavy.what(), AMPLITUDE_MM, 5.0).into_iter())
            .map(|s| Sample {
                x_mm: rounded(s.x_mm),
                force_command_n: by * s.force_command_n,
                ..s
            })
            .collect();
        let played = Played {
            model: &model,
            what: heavy.what(),
            servo: servo(),
            servo_told: true,
            samples: &samples,
            numbered: true,
            lost: 0,
            faded_from_s: None,
            time_ratio: None,
            host_late_s: None,
            others: &[],
        };
        judge(&played, &RenderingRules::default())
    };
    for step_mm in [0.001, 0.005, 0.02] {
        let found = with_steps(step_mm, 1.0);
        assert_eq!(found.verdict, Verdict::Ok, "{step_mm}: {found:?}");
        near(found.rendered_gain, 1.0, 0.01);
        for by in [0.8, 1.2] {
            let found = with_steps(step_mm, by);
            assert_eq!(found.verdict, Verdict::Flag, "{step_mm} {by}: {found:?}");
        }
    }
    let found = with_steps(0.2, 1.0);
    assert_eq!(found.verdict, Verdict::TooLittle, "{found:?}");
    assert!(found.because.is_some_and(|why| why.contains("too coarse")));
    assert_eq!(with_steps(0.2, -1.0).defects, [Defect::Sign]);
}

#[test]
fn lost_samples_cost_only_their_time() {
    let right = right();
    let kept: Vec<Sample> = (right.chunks(10).enumerate())
        .filter(|(i, _)| i % 20 != 7)
        .flat_map(|(_, chunk)| chunk.to_vec())
        .collect();
    let lost = (right.len() - kept.len()) as u64;
    let found = verdict(&kept, |played| played.lost = lost, |_| ());
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    near(found.lost_share, 0.05, 1e-3);
    near(found.rendered_vaf, 1.0, 1e-3);
}

#[test]
fn the_protocol_says_what_fails() {
    let weak = forced(&right(), |s| 0.5 * s.force_command_n);
    let reversed = forced(&right(), |s| -s.force_command_n);
    let by = |samples: &[Sample], on_fault| {
        verdict(samples, |_| (), |rules| rules.on_fault = on_fault).verdict
    };
    for (on_fault, expected) in [
        (None, [Verdict::Flag, Verdict::Fault]),
        (Some(OnFault::Fail), [Verdict::Fault; 2]),
        (Some(OnFault::Flag), [Verdict::Flag; 2]),
    ] {
        assert_eq!([by(&weak, on_fault), by(&reversed, on_fault)], expected);
    }
    // A wrong sign is wrong with any constants; what other constants may explain is not held
    // against a device that tells none.
    for (samples, expected) in [
        (&reversed, Verdict::Flag),
        (&weak, Verdict::Unverified),
        (&right(), Verdict::Ok),
    ] {
        let unknown = verdict(samples, |played| played.servo_told = false, |_| ());
        assert_eq!(unknown.verdict, expected, "{unknown:?}");
        let why = unknown.because.unwrap_or_default();
        assert_eq!(why.contains("constants"), expected != Verdict::Ok, "{why}");
    }
    let wide = verdict(
        &weak,
        |_| (),
        |rules| {
            (rules.gain, rules.min_vaf, rules.max_error_n) = ([0.4, 1.2], 0.7, 5.0);
            (rules.max_error_share, rules.max_range_share) = (0.6, 0.2);
        },
    );
    assert_eq!(wide.verdict, Verdict::Ok, "{wide:?}");
}

/// A clock that jumps by days asks for no memory and no time.
#[test]
fn absurd_times_end() {
    let mut samples = right();
    for (i, sample) in samples.iter_mut().enumerate().skip(3000) {
        sample.t_s += 1e9 * (i - 2999) as f64;
    }
    let found = verdict_of(&samples);
    assert_ne!(found.verdict, Verdict::Ok, "{found:?}");
}
