//! Wrong devices with many tables, hands and seeds. What is wrong is judged here by a
//! reference of its own, so that a device that is right for a table may be `ok`.

use crate::accused::{hand, others, playbacks};
use crate::rendering::{Heard, Shipped, judged, mixed, play, shipped};
use crate::tables;
use std::collections::BTreeMap;
use study_base::limits::Limits;
use study_base::text::ModelId;
use study_device::firmware::{Wrong, WrongLoads};
use study_device::rendering_of;
use study_device::virtual_device::Options;
use study_haptics::model::Realization;
use study_session::outcome::{Sample, Verdict};
use study_wire::predict::{Direction, Motion};
use study_wire::servo::{Servo, ServoSettings};

/// Slower than this, the direction may be unclear, mm/s.
const REST_MM_S: f64 = 5.0;
/// Time of one playback, s.
const SECONDS: f64 = 4.0;

/// Weaker forces count as this one, N: what a person just notices.
const LEAST_N: f64 = 0.1;
/// Samples on each side of one from which its motion is taken.
const APART: usize = 4;
/// Parts with fewer samples say nothing.
const LEAST_SAMPLES: f64 = 500.0;

/// By how much a force was another one than it should be.
#[derive(Debug, Clone, Copy, Default)]
struct Error {
    n: f64,
    wrong: f64,
    right: f64,
}

impl Error {
    fn add(&mut self, is_n: f64, right_n: f64) {
        self.n += 1.0;
        self.wrong += (is_n - right_n).powi(2);
        self.right += right_n.powi(2);
    }

    /// Root mean square, N, and its share of that of the right force.
    fn rms(&self) -> [f64; 2] {
        let [wrong_n, right_n] = [self.wrong, self.right].map(|sum| (sum / self.n).sqrt());
        [wrong_n, wrong_n / right_n.max(LEAST_N)]
    }

    /// What must not be `ok`: more than 10 % or 0.5 N.
    fn is_wrong(&self) -> bool {
        let [wrong_n, share] = self.rms();
        self.n >= LEAST_SAMPLES && (wrong_n > 0.5 || share > 0.1)
    }
}

/// The errors of a playback: of the commanded force in each direction and in each half, and
/// of the measured force.
#[derive(Debug, Default)]
struct Truth {
    directions: [Error; 2],
    halves: [Error; 2],
    measured: Error,
}

impl Truth {
    fn is_wrong(&self) -> bool {
        let [forwards, backwards] = &self.directions;
        let [first, second] = &self.halves;
        let all = [forwards, backwards, first, second, &self.measured];
        all.into_iter().any(Error::is_wrong)
    }
}

/// Compares a playback with a right servo that sees the positions only: the speed and the
/// acceleration are their differences, and the time is the number of samples.
fn truth(table: &Realization, limits: Limits, heard: &Heard) -> Truth {
    let mut truth = Truth::default();
    let all = &heard.samples;
    let (Some(told), Some(last)) = (heard.servo, all.len().checked_sub(APART + 1)) else {
        return truth;
    };
    let hz = 1000.0;
    // The states of a mechanism need the period of the device.
    let steps = (told.servo_hz / hz).round();
    let mut servo = Servo::new(ServoSettings {
        force_n: limits.force_n.get(),
        velocity_mm_s: f64::MAX,
        overtravel_mm: f64::MAX,
        jump_mm: f64::MAX,
        ..told
    });
    servo.start();
    let what = rendering_of(table);
    let dt_s = APART as f64 / hz;
    let motion = |i: usize| {
        let [before, here, after] = [i - APART, i, i + APART].map(|i| all[i].x_mm);
        Motion {
            x_mm: here,
            v_mm_s: (after - before) / (2.0 * dt_s),
            a_m_s2: 1e-3 * (after - 2.0 * here + before) / (dt_s * dt_s),
        }
    };
    for i in APART + 1..=last {
        let (from, here) = (motion(i - 1), motion(i));
        let mut right_n = 0.0;
        for step in 1..=steps as u32 {
            let part = f64::from(step) / steps;
            let between = |a: f64, b: f64| a + part * (b - a);
            right_n = servo.step(
                &what,
                Motion {
                    x_mm: between(from.x_mm, here.x_mm),
                    v_mm_s: between(from.v_mm_s, here.v_mm_s),
                    a_m_s2: between(from.a_m_s2, here.a_m_s2),
                },
            );
        }
        let moves =
            |s: &[Sample]| (s.windows(2)).all(|w| (w[1].x_mm - w[0].x_mm) * here.v_mm_s >= 0.0);
        // The direction is that of the samples around, and the slew limit has passed.
        let clear = here.v_mm_s.abs() > REST_MM_S && moves(&all[i - APART..=i + APART]);
        if i as f64 / hz < told.ramp_s + 0.1 || !clear {
            continue;
        }
        let commanded_n = all[i].force_command_n;
        let half = usize::from(2 * i > all.len());
        truth.directions[usize::from(here.v_mm_s > 0.0)].add(commanded_n, right_n);
        truth.halves[half].add(commanded_n, right_n);
        if let Some(measured_n) = all[i].force_measured_n {
            truth.measured.add(measured_n, commanded_n);
        }
    }
    truth
}

/// The mixed table with a tenth of its force.
fn weak(rule: Direction) -> Realization {
    let mut table = mixed(rule);
    for branch in [&mut table.positive, &mut table.negative] {
        let all = [
            &mut branch.m_kg,
            &mut branch.b_n_s_per_mm,
            &mut branch.k_n_per_mm,
            &mut branch.f0_n,
        ];
        all.into_iter().flatten().for_each(|p| *p *= 0.1);
    }
    table
}

/// The tables: those of the shipped protocols, and three in which every term counts, with a
/// strong and a weak force.
pub(crate) fn all_tables() -> Vec<Shipped> {
    let limits = Limits::new(9.0, 1000.0).unwrap();
    let rules = [
        ("sign", Direction::Sign),
        ("play", tables::PLAY),
        ("dahl", Direction::Dahl { delta_mm: 1.0 }),
    ];
    let own = rules.into_iter().flat_map(|(id, rule)| {
        [("mixed", mixed(rule)), ("weak", weak(rule))].map(|(force, table)| {
            (
                ModelId::new(format!("{force}-{id}")).unwrap(),
                table,
                limits,
            )
        })
    });
    own.chain(shipped().iter().cloned()).collect()
}

/// Those with a delay of more than 10 ms, whatever it does to the force.
const LATE: [Wrong; 2] = [Wrong::Late, Wrong::SlightlyLate];

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
            // Its delay of 3 ms is within what the default rules allow.
            let is_wrong = (truth.is_wrong() && *wrong != Wrong::LowPass50) || LATE.contains(wrong);
            let word = match (found.verdict, is_wrong) {
                (Verdict::Ok, true) => {
                    passed.push(format!("{name} {n} {id}: {truth:.4?} {found:?}"));
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
