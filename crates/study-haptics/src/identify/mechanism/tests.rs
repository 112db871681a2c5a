//! Whether the standard errors are those of repeated recordings.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use super::decision::Part;
use super::objective::Compared;
use super::sensitivity::{STRIBECK, STRIBECK_MM_S};
use super::{Filter, Fitted, PARAMETERS, levenberg, predict, reach};
use crate::identify::Warning;
use crate::identify::signal::LowPass;
use crate::model::{Mechanism, Profile};
use crate::recording::Recording;
use rayon::prelude::*;
use std::f64::consts::TAU;
use study_base::rng::Stream;
use study_wire::mechanism::{SCALARS, Scalars};

const STEPS_HZ: f64 = 2000.0;
const RATE_HZ: f64 = 1000.0;
const CORNER_HZ: f64 = 30.0;

fn truth() -> Mechanism {
    Mechanism {
        scalars: Scalars::from_array([
            0.1, 0.14, 15.0, 0.012, 0.8, 0.006, 0.06, 0.35, 8.0, 0.25, 0.07, 0.001, 0.1,
        ]),
        detent: Profile {
            first_mm: -7.0,
            step_mm: 1.0,
            n: (-7..=7).map(|i| 4.0 * (f64::from(i) * 0.8).sin()).collect(),
        },
        friction: Profile {
            first_mm: -7.0,
            step_mm: 7.0,
            n: vec![1.2, 0.9, 1.4],
        },
        recorded_hz: None,
    }
}

/// Twelve seconds of two sines, and the low-passed force of the mechanism.
fn recording() -> Recording {
    let sines = [(4.0, 0.7, 0.0), (2.0, 3.1, 1.0)];
    let sum = |of: &dyn Fn(f64, f64, f64) -> f64| -> f64 {
        sines
            .iter()
            .map(|(mm, hz, lag)| of(*mm, TAU * hz, *lag))
            .sum()
    };
    let all = 0..12_000;
    let t_s: Vec<f64> = all.map(|i| f64::from(i) / RATE_HZ).collect();
    let each = |of: &dyn Fn(f64) -> f64| t_s.iter().map(|t| of(*t)).collect::<Vec<f64>>();
    let mut recording = Recording {
        name: "r".into(),
        x_mm: each(&|t| sum(&|mm, w, lag| mm * (w * t + lag).sin())),
        v_mm_s: each(&|t| sum(&|mm, w, lag| mm * w * (w * t + lag).cos())),
        a_m_s2: each(&|t| sum(&|mm, w, lag| -1e-3 * mm * w * w * (w * t + lag).sin())),
        f_n: Vec::new(),
        t_s,
        header: Vec::new(),
        sha256: String::new(),
        warnings: Vec::new(),
    };
    let force_n = predict(&truth().view(), &recording, recording.len(), STEPS_HZ);
    recording.f_n = LowPass::new(CORNER_HZ, RATE_HZ)
        .unwrap()
        .zero_phase(&force_n);
    recording
}

/// 0.05 N of noise with a correlation time of 50 ms, twelve times that of the samples that
/// count: standard errors that took them as independent would be 2.5 times too small.
fn noisy(clean: &Recording, seed: u64) -> Recording {
    let mut noise = Stream::new(seed, &["standard errors"]);
    let (keep, mut state) = ((-1.0 / (0.05 * RATE_HZ)).exp(), 0.0);
    let mut next = || {
        state = keep * state + (1.0 - keep * keep).sqrt() * 0.05 * noise.normal();
        state
    };
    Recording {
        f_n: clean.f_n.iter().map(|f| f + next()).collect(),
        ..clean.clone()
    }
}

#[test]
fn standard_errors_are_the_spread_of_repeated_recordings_under_correlated_noise() {
    let clean = recording();
    let fits: Vec<([f64; SCALARS], [f64; SCALARS])> = (0..24_u64)
        .into_par_iter()
        .map(|seed| {
            let recording = noisy(&clean, seed);
            let compared = Compared::new(&recording, Filter::Recorded(CORNER_HZ), 99.0).unwrap();
            let on = [compared];
            let fit = levenberg::fit(&truth(), &on, STEPS_HZ, 6, 100.0, &|| ()).unwrap();
            let errors = fit.standard_errors.map(|error| error.unwrap());
            (fit.mechanism.scalars.to_array(), errors)
        })
        .collect();
    let n = fits.len() as f64;
    let mut product = 1.0;
    for (i, (name, ..)) in PARAMETERS.iter().enumerate() {
        let mean = fits.iter().map(|(p, _)| p[i]).sum::<f64>() / n;
        let square = fits.iter().map(|(p, _)| (p[i] - mean).powi(2)).sum::<f64>();
        let error = fits.iter().map(|(_, e)| e[i]).sum::<f64>() / n;
        let ratio = (square / (n - 1.0)).sqrt() / error;
        // of 24 recordings: a standard deviation has an error of 15 %
        assert!((0.5..2.0).contains(&ratio), "{name}: {ratio}");
        product *= ratio;
    }
    let geometric = product.powf(1.0 / PARAMETERS.len() as f64);
    assert!((0.8..1.25).contains(&geometric), "{geometric}");
}

/// Detents end where the follower was, whatever their values are beyond, and are a line across
/// what it left out.
#[test]
fn values_that_no_data_reached_are_held() {
    let recording = recording();
    let part = |samples: std::ops::Range<usize>, by: f64, plus_mm: f64| {
        let mut part = recording.select(&samples.collect::<Vec<_>>());
        part.x_mm.iter_mut().for_each(|x| *x = by * *x + plus_mm);
        part.v_mm_s.iter_mut().for_each(|v| *v *= by);
        part
    };
    let mut wild = truth();
    for i in [0, 14] {
        wild.detent.n[i] = 30.0;
    }
    // the handle is at −4.8 to 4.8 mm
    let reach = reach::of(&truth(), &[&part(0..12_000, 0.8, 0.0)], None);
    assert!(reach.range_mm[0] > -6.0 && reach.range_mm[1] < 6.0);
    let held = reach::held(&wild, &reach);
    let [low, high] = reach.range_mm;
    let ends = held.detent.x_mm().collect::<Vec<_>>();
    assert!((ends[0] - low).abs() <= 1.0 && (ends[ends.len() - 1] - high).abs() <= 1.0);
    assert!(held.detent.n.iter().all(|n| n.abs() < 5.0));
    let same =
        |x: f64| (held.friction.view().linear_n(x) - truth().friction.view().linear_n(x)).abs();
    assert!(same(ends[0]) < 1e-9 && same(ends[ends.len() - 1]) < 1e-9);
    // beyond the ends the force is that of the ends
    assert_eq!(held.detent.view().spline_n(-9.0), held.detent.n[0]);

    // two parts of the travel
    let parts = [part(0..900, 0.2, -4.0), part(3000..3900, 0.2, 4.0)];
    wild.detent.n[7] = 30.0;
    let reach = reach::of(&truth(), &[&parts[0], &parts[1]], None);
    let bridged = reach::bridged(wild, &reach);
    let n = &bridged.detent.n;
    assert!(n[7].abs() < 5.0 && n[6] != n[8], "{n:?}");
    assert!((n[7] - 0.5 * (n[6] + n[8])).abs() < 1e-9, "{n:?}");
}

/// A standard error above half the value is told, except of a force, which may well be 0.
#[test]
fn what_the_recordings_do_not_determine_is_told() {
    let warned = |unsure: usize| {
        let mut standard_errors = truth().scalars.to_array().map(|x| Some(0.1 * x.abs()));
        standard_errors[unsure] = None;
        let fitted = Fitted {
            mechanism: truth(),
            standard_errors,
            filter: Filter::Recorded(CORNER_HZ),
            decision: None,
            attempts: Vec::new(),
            iterations: 1,
            reach_mm: [-7.0, 7.0],
        };
        let unsure_terms = fitted.terms().into_iter().filter(|term| !term.identified);
        let unsure_terms: Vec<&str> = unsure_terms.map(|term| term.name).collect();
        assert!(unsure_terms.contains(&PARAMETERS[unsure].0));
        let name = |warning| match warning {
            Warning::NotDetermined { parameter, .. } => parameter,
            other => panic!("{other:?}"),
        };
        fitted.warnings().into_iter().map(name).collect::<Vec<_>>()
    };
    for (i, (name, ..)) in PARAMETERS.iter().enumerate() {
        match *name {
            "offset force" => assert!(warned(i).is_empty()),
            name => assert_eq!(warned(i), [name]),
        }
    }
}

/// Of one plant, with its force through a low-pass and without: the fit that predicts the measured
/// force better where it was left out decides, unless the header says it.
#[test]
fn a_low_pass_of_the_force_is_found_or_stated_by_the_header() {
    let clean = recording();
    let filtered = noisy(&clean, 1);
    let f_n = predict(&truth().view(), &clean, clean.len(), STEPS_HZ);
    let plain = noisy(&Recording { f_n, ..clean }, 1);
    let decided = |recording: &Recording, filter: &str| {
        let recording = Recording {
            header: vec![format!("filter: {filter}")],
            ..recording.clone()
        };
        let part = Part {
            recordings: &[&recording],
            share: 0.5,
            top_mm_s: 100.0,
        };
        part.decide(&truth()).unwrap()
    };
    let (filter, decision) = decided(&filtered, "");
    assert_eq!(filter, Filter::Recorded(CORNER_HZ), "{decision:?}");
    assert!(!decision.by_header && decision.rms_n[0] < decision.rms_n[1]);
    let (filter, decision) = decided(&plain, "unknown");
    assert!(matches!(filter, Filter::Both(_)), "{decision:?}");
    assert!(!decision.by_header && decision.rms_n[1] < decision.rms_n[0]);
    // the header is believed; the errors of both say what it costs
    let (filter, decision) = decided(&filtered, "none");
    assert!(matches!(filter, Filter::Both(_)));
    assert!(decision.by_header && decision.rms_n[0] < decision.rms_n[1]);
    let (filter, _) = decided(&filtered, "Butterworth at 40 Hz; both ways");
    assert_eq!(filter, Filter::Recorded(40.0));
}

/// What is set is not fitted: it stays, has no standard error, and leaves the others theirs.
#[test]
fn a_scalar_that_is_set_stays() {
    let recording = noisy(&recording(), 3);
    let on = [Compared::new(&recording, Filter::Recorded(CORNER_HZ), 7.0).unwrap()];
    let mut set = [false; SCALARS];
    set[STRIBECK] = true;
    set[STRIBECK_MM_S] = true;
    let mut from = truth();
    from.scalars.gap_mm *= 1.1;
    let fit = levenberg::fit_with(&from, &set, &on, STEPS_HZ, 6, 100.0, &|| ()).unwrap();
    let (before, after) = (from.scalars.to_array(), fit.mechanism.scalars.to_array());
    for i in 0..SCALARS {
        assert_eq!(before[i] == after[i], set[i], "{}", PARAMETERS[i].0);
        assert_eq!(
            fit.standard_errors[i].is_none(),
            set[i],
            "{}",
            PARAMETERS[i].0
        );
    }
    assert!((fit.mechanism.scalars.gap_mm - truth().scalars.gap_mm).abs() < 0.02);
    assert_eq!(fit.hopeless(), None);
}
