//! Wrong devices with many tables, hands and seeds. What is wrong is judged here by a
//! reference of its own, so that a device that is right for a table may be `ok`.

use crate::accused::{hand, others, playbacks};
use crate::rendering::{Heard, Shipped, judged, mixed, play, shipped};
use crate::tables;
use std::collections::BTreeMap;
use study::device::firmware::{Wrong, WrongLoads};
use study::device::rendering_of;
use study::device::virtual_device::Options;
use study_base::limits::Limits;
use study_base::text::ModelId;
use study_core::outcome::{Sample, Verdict};
use study_haptics::model::Realization;
use study_wire::predict::{Direction, Motion};
use study_wire::servo::{Servo, ServoSettings};

/// Slower than this, the direction may be unclear, mm/s.
const REST_MM_S: f64 = 5.0;
/// Time of one playback, s.
const SECONDS: f64 = 4.0;

/// By how much the commanded force was another one than that of the table.
#[derive(Debug)]
struct Truth {
    /// Root mean square, N, and its share of that of the table's force.
    rms_n: f64,
    share: f64,
    /// The same of measured minus commanded force.
    measured: Option<[f64; 2]>,
}

impl Truth {
    /// What must not be `ok`: more than 10 % or 0.5 N.
    fn is_wrong(&self) -> bool {
        let wrong = |rms_n: f64, share: f64| rms_n > 0.5 || (share > 0.1 && rms_n > 0.05);
        wrong(self.rms_n, self.share) || self.measured.is_some_and(|[n, share]| wrong(n, share))
    }
}

/// Compares a playback with a right servo that sees the positions only: the speed and the
/// acceleration are their differences, and the time is the number of samples.
fn truth(table: &Realization, limits: Limits, heard: &Heard) -> Option<Truth> {
    const APART: usize = 4;
    let told = heard.servo?;
    let hz = 1000.0;
    let mut servo = Servo::new(ServoSettings {
        servo_hz: hz,
        force_n: limits.force_n.get(),
        velocity_mm_s: f64::MAX,
        overtravel_mm: f64::MAX,
        jump_mm: f64::MAX,
        ..told
    });
    servo.start();
    let what = rendering_of(table);
    let all = &heard.samples;
    let dt_s = APART as f64 / hz;
    let (mut wrong, mut force, mut n) = (0.0, 0.0, 0.0);
    let mut measured = [0.0; 2];
    let mut has_sensor = false;
    for i in APART..all.len().checked_sub(APART)? {
        let [before, here, after] = [i - APART, i, i + APART].map(|i| all[i].x_mm);
        let motion = Motion {
            x_mm: here,
            v_mm_s: (after - before) / (2.0 * dt_s),
            a_m_s2: 1e-3 * (after - 2.0 * here + before) / (dt_s * dt_s),
        };
        let right_n = servo.step(&what, motion);
        let moves =
            |s: &[Sample]| (s.windows(2)).all(|w| (w[1].x_mm - w[0].x_mm) * motion.v_mm_s >= 0.0);
        // The direction is that of the samples around, and the slew limit has passed.
        let clear = motion.v_mm_s.abs() > REST_MM_S && moves(&all[i - APART..=i + APART]);
        if i as f64 / hz < told.ramp_s + 0.1 || !clear {
            continue;
        }
        let commanded_n = all[i].force_command_n;
        wrong += (commanded_n - right_n).powi(2);
        force += right_n.powi(2);
        n += 1.0;
        if let Some(measured_n) = all[i].force_measured_n {
            has_sensor = true;
            measured[0] += (measured_n - commanded_n).powi(2);
            measured[1] += commanded_n.powi(2);
        }
    }
    (n > 200.0).then(|| Truth {
        rms_n: f64::sqrt(wrong / n),
        share: f64::sqrt(wrong / force),
        measured: has_sensor.then(|| {
            let [error, whole] = measured;
            [f64::sqrt(error / n), f64::sqrt(error / whole)]
        }),
    })
}

/// The tables: those of the shipped protocols, and three in which every term counts.
fn all_tables() -> Vec<Shipped> {
    let limits = Limits::new(9.0, 1000.0).unwrap();
    let rules = [
        ("mixed-sign", Direction::Sign),
        ("mixed-play", tables::PLAY),
        ("mixed-dahl", Direction::Dahl { delta_mm: 1.0 }),
    ];
    let mixed = rules.map(|(id, rule)| (ModelId::new(id).unwrap(), mixed(rule), limits));
    mixed.into_iter().chain(shipped().iter().cloned()).collect()
}

/// Every wrong device plays two tables, the second with a reference beside it. No playback
/// that was wrong is `ok`. `STUDY_PLAYBACKS` is the number for each wrong device.
#[test]
fn no_wrong_device_is_ok_with_any_table_and_hand() {
    let each = playbacks(1);
    let tables = all_tables();
    let mut passed = Vec::new();
    let mut rows = String::new();
    let mut sums: BTreeMap<&str, usize> = BTreeMap::new();
    for (w, (wrong, name, _)) in Wrong::ALL.iter().enumerate() {
        if wrong.is_physical() {
            continue;
        }
        let mut said: BTreeMap<String, usize> = BTreeMap::new();
        for n in 0..each {
            // another table first, and every table, hand and seed in turn
            let which = (n + 7 * w) % tables.len();
            let own = &tables[which];
            let first = &tables[(which + 1 + n % 5) % tables.len()];
            let mut options = Options::seeded(9000 + (97 * w + n) as u64);
            options.device.hand = hand(n / tables.len());
            options.device.wrong = Some(WrongLoads {
                wrong: *wrong,
                loads: [2, u32::MAX],
            });
            let (id, table, limits) = own;
            let heard = play(options, &[(&first.1, first.2), (table, *limits)], SECONDS);
            if heard.playback.is_none() {
                *said.entry("tripped".to_owned()).or_default() += 1;
                continue;
            }
            let found = judged(id, table, *limits, &heard, &others(own));
            let truth = truth(table, *limits, &heard);
            let is_wrong = truth.as_ref().is_some_and(Truth::is_wrong);
            let word = match (found.verdict, is_wrong) {
                (Verdict::Ok, true) => {
                    passed.push(format!("{name} {n} {id}: {truth:.3?} {found:?}"));
                    "WRONG AND OK"
                }
                (Verdict::Ok, false) => "ok, under 10 % and 0.5 N",
                (verdict, _) => verdict.as_str(),
            };
            *said.entry(word.to_owned()).or_default() += 1;
            *sums.entry(found.verdict.as_str()).or_default() += 1;
        }
        rows.push_str(&format!("{name}: {said:?}\n"));
    }
    println!("{rows}{sums:?}");
    assert!(passed.is_empty(), "{}: {passed:#?}", passed.len());
}
