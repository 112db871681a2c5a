//! Properties of identification that hold for all parameters.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::fmt::Write as _;
use study_haptics::identify::grid::{self, Plan};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{Ewls, IdentifyError, Spring, Static, Training, vaf};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

/// m (kg), b (N·s/mm), k (N/mm), F0 (N) of a direction.
type Theta = [f64; 4];

/// Two sines over 0 to 30 mm at 1 kHz, of `seconds`, on a target with constant
/// parameters in each direction and a force ripple that depends on x.
fn recording(
    name: &str,
    seconds: u32,
    shift_mm: f64,
    plus: Theta,
    minus: Theta,
    ripple_n: f64,
) -> Recording {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..seconds * 1000 {
        let t = f64::from(i) * 0.001;
        let (mut x, mut v, mut a) = (15.0, 0.0, 0.0);
        for (hz, mm) in [(0.5, 11.0), (2.3, 4.0)] {
            let w = hz * std::f64::consts::TAU;
            x += mm * (w * t).sin();
            v += mm * w * (w * t).cos();
            a -= mm * w * w * (w * t).sin() / 1000.0;
        }
        let [m, b, k, f0] = if v > 0.0 { plus } else { minus };
        let f = m * a + b * v + k * x + f0 + ripple_n * (x / 2.0).sin();
        writeln!(text, "{t},{},{v},{a},{f}", x + shift_mm).unwrap();
    }
    recording::read(name, text.as_bytes()).unwrap()
}

const PLUS: Theta = [0.3, 0.02, 0.5, -6.0];
const MINUS: Theta = [0.2, 0.03, 0.4, -8.0];

#[test]
fn a_known_table_is_recovered_from_noise_free_data() {
    let r = recording("r", 20, 0.0, PLUS, MINUS, 0.0);
    let training = Training::new(&r).unwrap();
    let estimates = training
        .estimates(Ewls::paper(0.999, Resample::Point))
        .unwrap();
    for resample in [Resample::Point, Resample::Bin] {
        let found = training
            .ewls(&estimates, 1.0, resample, Lookup::Linear)
            .unwrap()
            .realization;
        let middle = found.x_mm.iter().position(|x| *x == 15.0).unwrap();
        for (branch, theta) in [(&found.positive, PLUS), (&found.negative, MINUS)] {
            for (list, truth) in [
                (&branch.m_kg, theta[0]),
                (&branch.b_n_s_per_mm, theta[1]),
                (&branch.k_n_per_mm, theta[2]),
                (&branch.f0_n, theta[3]),
            ] {
                assert!((list[middle] - truth).abs() < 1e-4, "{truth}: {list:?}");
            }
        }
        let score = vaf::score(&found, &r);
        assert!(score.vaf > 0.999_99, "{score:?}");
    }
}

#[test]
fn vaf_does_not_depend_on_the_origin_of_x() {
    let of = |shift: f64, resample| {
        let train = recording("t", 20, shift, PLUS, MINUS, 3.0);
        let other = recording("o", 7, shift, PLUS, MINUS, 3.0);
        let training = Training::new(&train).unwrap();
        let plan = Plan::ewls(&[0.999], &[0.5], resample);
        let cells = grid::run(&training, &plan, Lookup::Linear, &[&other], || ()).unwrap();
        cells[0].scores[0].vaf
    };
    for resample in [Resample::Point, Resample::Bin] {
        let here = of(0.0, resample);
        assert!(here < 0.999, "the ripple has to be hard to predict: {here}");
        for shift in [-20.0, 10.0, 100.0] {
            let there = of(shift, resample);
            // not zero: the start, θ = 0 and P = 10⁶ I, is tied to the origin
            assert!((here - there).abs() < 1e-5, "{shift}: {here} {there}");
        }
    }
}

#[test]
fn a_constant_error_is_bias_and_not_vaf() {
    let train = recording("t", 20, 0.0, PLUS, MINUS, 1.0);
    let mut other = recording("o", 7, 0.0, PLUS, MINUS, 1.0);
    let training = Training::new(&train).unwrap();
    let found = training.identify(Static, 1.0, Lookup::Linear).unwrap();
    let before = vaf::score(&found.realization, &other);
    for f in &mut other.f_n {
        *f -= 2.5;
    }
    let after = vaf::score(&found.realization, &other);
    assert!((after.vaf - before.vaf).abs() < 1e-12);
    assert!((after.bias_n - before.bias_n - 2.5).abs() < 1e-12);
    assert!((after.residual_n - before.residual_n).abs() < 1e-12);
}

#[test]
fn the_spring_recovers_a_line() {
    let theta = [0.0, 0.0, 0.7, -3.0];
    let r = recording("r", 5, 0.0, theta, theta, 0.0);
    let spring = Training::new(&r)
        .unwrap()
        .identify(Spring, 0.0, Lookup::Linear)
        .unwrap()
        .realization;
    for branch in [&spring.positive, &spring.negative] {
        for k in &branch.k_n_per_mm {
            assert!((k - 0.7).abs() < 1e-9);
        }
        assert_eq!(branch.m_kg, [0.0, 0.0]);
    }
    assert!((vaf::score(&spring, &r).vaf - 1.0).abs() < 1e-12);
}

#[test]
fn impossible_arguments_give_an_error_with_the_reason() {
    let r = recording("r", 5, 0.0, PLUS, MINUS, 0.0);
    let training = Training::new(&r).unwrap();
    for bad in [0.0, -1.0, 1.5, f64::NAN] {
        let error = training
            .estimates(Ewls::paper(bad, Resample::Point))
            .unwrap_err();
        assert!(error.to_string().starts_with("lambda has to be above 0"));
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = training.nodes(bad).unwrap_err();
        assert!(error.to_string().starts_with("dx has to be a length"));
    }
    assert!(matches!(
        training.nodes(100.0),
        Err(IdentifyError::TooCoarse { nodes: 0 | 1, .. })
    ));
    assert!(matches!(
        training.nodes(1e-9),
        Err(IdentifyError::TooFine { .. })
    ));
    // forgetting everything but the last sample cannot give four parameters
    match training.estimates(Ewls::paper(1e-3, Resample::Point)) {
        Err(IdentifyError::Diverged { .. }) => {}
        other => panic!("{other:?}"),
    }

    let mut one_way = r.clone();
    for v in &mut one_way.v_mm_s {
        *v = v.abs();
    }
    assert_eq!(
        Training::new(&one_way).unwrap_err().to_string(),
        "r has no samples with v < 0: both directions are needed"
    );
}
