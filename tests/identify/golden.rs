//! The paper's EWLS compared with reference values, on recordings of a simulated
//! turn-signal switch (1 kHz, filtered at 30 Hz; the plant is in their headers). Reference: the project's own prototype in double precision;
//! printed to six or seven significant digits. The tolerance is half a unit of the
//! last one and a twentieth of that, because one (0.015941852, printed .0159418)
//! was rounded twice.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use study_haptics::identify::grid::{self, Plan};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{Ewls, Training, vaf};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

fn recording(name: &str) -> Recording {
    let path = Path::new("tests/data/recordings").join(name);
    recording::read(name, BufReader::new(File::open(path).unwrap())).unwrap()
}

struct Golden {
    lambda: f64,
    positive: [&'static str; 4],
    negative: [&'static str; 4],
    point_half: f64,
    bin_half: f64,
    bin_one: f64,
}

const GOLDEN: [Golden; 4] = [
    Golden {
        lambda: 0.99,
        positive: [".069597", ".00751726", ".950005", "-16.45231"],
        negative: [".073656", ".0159418", "2.168712", "-37.61436"],
        point_half: 0.987545,
        bin_half: 0.988288,
        bin_one: 0.986332,
    },
    Golden {
        lambda: 0.999,
        positive: [".00715974", ".00940603", "1.132396", "-20.13881"],
        negative: ["-.0293209", ".0168987", "2.024553", "-35.65913"],
        point_half: 0.951895,
        bin_half: 0.951662,
        bin_one: 0.949471,
    },
    Golden {
        lambda: 0.9995,
        positive: ["-.094614", ".015863", "-.346158", "3.178958"],
        negative: ["-.274741", ".009879", ".353364", "-9.299672"],
        point_half: 0.827907,
        bin_half: 0.827046,
        bin_one: 0.820778,
    },
    Golden {
        lambda: 0.9999,
        positive: ["-1.170136", ".032311", "-.53196", "5.414693"],
        negative: ["-1.090380", "-.00208965", "-.516263", "3.050869"],
        point_half: 0.363831,
        bin_half: 0.363459,
        bin_one: 0.359412,
    },
];

/// Whether `found` rounds to the digits that are printed.
fn agrees(found: f64, printed: &str) -> bool {
    let digits = printed.split_once('.').unwrap().1.len();
    let half_a_unit = 0.5 * 10f64.powi(-i32::try_from(digits).unwrap());
    (found - printed.parse::<f64>().unwrap()).abs() <= half_a_unit * 1.05
}

#[test]
fn parameters_in_the_middle_agree_with_the_reference_to_the_printed_digits() {
    let recording = recording("training_a.csv");
    let training = Training::new(&recording).unwrap();
    for golden in &GOLDEN {
        let estimates = training
            .estimates(Ewls::paper(golden.lambda, Resample::Point))
            .unwrap();
        for (theta, printed) in [
            (&estimates.positive, golden.positive),
            (&estimates.negative, golden.negative),
        ] {
            let middle = theta[theta.len() / 2];
            for (found, printed) in middle.into_iter().zip(printed) {
                assert!(
                    agrees(found, printed),
                    "lambda {}: {middle:?}, not {printed}",
                    golden.lambda
                );
            }
        }
    }
}

#[test]
fn vaf_agrees_with_the_reference_to_the_printed_digits() {
    let recording_a = recording("training_a.csv");
    let validation = recording("validation_a.csv");
    let training = Training::new(&recording_a).unwrap();
    for golden in &GOLDEN {
        let estimates = training
            .estimates(Ewls::paper(golden.lambda, Resample::Point))
            .unwrap();
        for (resample, dx_mm, expected) in [
            (Resample::Point, 0.5, golden.point_half),
            (Resample::Bin, 0.5, golden.bin_half),
            (Resample::Bin, 1.0, golden.bin_one),
        ] {
            let found = training
                .ewls(&estimates, dx_mm, resample, Lookup::Linear)
                .unwrap();
            let score = vaf::score(&found.realization, &validation);
            assert!(
                (score.vaf - expected).abs() <= 0.51e-6,
                "lambda {} {resample:?} {dx_mm}: {} not {expected}",
                golden.lambda,
                score.vaf
            );
        }
    }
}

#[test]
fn the_paper_grid_falls_with_lambda_at_1_khz_and_does_not_peak() {
    // At 10 kHz it peaks at 0.9995, as the paper's Fig. 11; L is ten times longer here.
    let recording_a = recording("training_a.csv");
    let validation = recording("validation_a.csv");
    let training = Training::new(&recording_a).unwrap();
    let lambdas = [0.9991, 0.9993, 0.9995, 0.9997, 0.9999];
    let plan = Plan::ewls(&lambdas, &[1.0], Resample::Point);
    let cells = grid::run(&training, &plan, Lookup::Linear, &[&validation], || ()).unwrap();
    assert!(
        cells
            .windows(2)
            .all(|pair| pair[1].scores[0].vaf < pair[0].scores[0].vaf)
    );
    assert_eq!(grid::best(&cells, 1), Some(0));
    // 1 / ((1 − λ) ρ) with ρ samples over 31.93 mm
    let memory = cells[2].realization.provenance.memory_mm.unwrap();
    let [positive, negative] = training.directions();
    let dense = positive.len().max(negative.len()) as f64;
    assert!((memory - 2000.0 * 31.93 / dense).abs() < 0.01, "{memory}");
}
