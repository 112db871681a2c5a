//! Plays a table of three nodes: moves the handle at constant speed and prints the
//! force that the servo commands. Run with `cargo run -p study-wire --example servo`.

use std::io::Write as _;
use study_wire::certificate::{Range, certify};
use study_wire::predict::{BranchView, Direction, Lookup, Motion, TableView};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings};

fn main() -> std::io::Result<()> {
    // A spring of 0.2 N/mm about 15 mm, with 0.5 N of friction.
    let branch = |f0_n| BranchView {
        m_kg: &[0.0; 3],
        b_n_s_per_mm: &[0.01; 3],
        k_n_per_mm: &[0.2; 3],
        f0_n,
    };
    let table = TableView {
        x_mm: &[0.0, 15.0, 30.0],
        positive: branch(&[-2.5; 3]),
        negative: branch(&[-3.5; 3]),
        lookup: Lookup::Linear,
    };
    let rule = Direction::Play { delta_mm: 0.5 };
    let rendering = Rendering {
        law: Law::Table { table, rule },
        range_mm: [0.0, 30.0],
        trained_mm_s: 100.0,
    };
    let range = Range {
        x_mm: rendering.range_mm,
        v_mm_s: rendering.trained_mm_s,
    };
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", certify(&table, rule, range))?;

    let mut servo = Servo::new(ServoSettings::default());
    servo.start();
    for period in 0..=4000 {
        let x_mm = 5.0 + 20.0 * f64::from(period) / 4000.0;
        let motion = Motion {
            x_mm,
            v_mm_s: 20.0,
            a_m_s2: 0.0,
        };
        let force_n = servo.step(&rendering, motion);
        if period % 400 == 0 {
            writeln!(out, "{x_mm:5.1} mm  {force_n:6.3} N")?;
        }
    }
    writeln!(out, "energy from the hand: {:.4} J", servo.tally().energy_j)
}
