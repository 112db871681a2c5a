//! Errors of synthetic recordings with known components.

use super::*;
use crate::identify::{Static, Training};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use study_wire::predict::Lookup;

/// A 0.5 Hz stroke over 0 to 30 mm at 1 kHz; force by time, position and velocity.
fn recording(force: impl Fn(f64, f64, f64) -> f64) -> Recording {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..8000 {
        let t = f64::from(i) * 0.001;
        let (x, v) = (15.0 - 15.0 * (PI * t).cos(), 15.0 * PI * (PI * t).sin());
        let a = 15.0 * PI * PI * (PI * t).cos() / 1000.0;
        writeln!(text, "{t},{x},{v},{a},{}", force(t, x, v)).unwrap();
    }
    crate::recording::read("r", text.as_bytes()).unwrap()
}

/// Three detents at 5, 15 and 25 mm, between whose crests the force falls around 10 and 20 mm.
fn switch(x: f64, v: f64) -> f64 {
    -4.0 * (TAU * x / 10.0).sin() + 0.5 * v.signum()
}

/// The table of the recording of that switch, with another force at each node.
fn changed(change: impl Fn(f64, f64) -> f64) -> Realization {
    let r = recording(|_, x, v| switch(x, v));
    let found = Training::new(&r)
        .unwrap()
        .identify(Static, 0.25, Lookup::Linear)
        .unwrap();
    let mut table = found.realization;
    for (i, x) in table.x_mm.iter().enumerate() {
        table.positive.f0_n[i] += change(*x, 1.0);
        table.negative.f0_n[i] += change(*x, -1.0);
    }
    table
}

/// The part of the error that is of one component.
fn share(parts: Parts, component: Component) -> f64 {
    let place = Component::ALL.iter().position(|c| *c == component);
    parts[place.unwrap()] / parts.iter().sum::<f64>()
}

/// Of a sine that begins with a fall at 0, the force falls from −2.5 to 2.5 mm around 0, 10, 20 and 30.
fn in_detent(x: f64) -> bool {
    let apart = (x / 10.0 - (x / 10.0).round()).abs();
    apart < 0.25
}

#[test]
fn each_error_is_in_its_component() {
    let r = recording(|_, x, v| switch(x, v));
    let reference = Reference::of(&r).unwrap();
    assert!(reference.has_detents());
    let of = |change: &dyn Fn(f64, f64) -> f64| reference.errors(&changed(change)).unwrap();
    let direction = of(&|_, z| 0.4 * z);
    assert!(
        share(direction, Component::Direction) > 0.85,
        "{direction:?}"
    );
    // deep inside of a fall, and far from one
    let detent = of(&|x, _| if (x - 10.0).abs() < 1.5 { 1.0 } else { 0.0 });
    let elsewhere = of(&|x, _| if (x - 15.0).abs() < 1.5 { 1.0 } else { 0.0 });
    // less the mean of the error, which is everywhere
    assert!(share(detent, Component::Detent) > 0.8, "{detent:?}");
    assert!(share(elsewhere, Component::Level) > 0.6, "{elsewhere:?}");
    // what the recording has besides the force by position
    let vibrates = |hz: f64| {
        let r = recording(|t, x, v| switch(x, v) + 0.3 * (TAU * hz * t).sin());
        Reference::of(&r)
            .unwrap()
            .errors(&changed(|_, _| 0.0))
            .unwrap()
    };
    assert!(
        share(vibrates(3.3), Component::Slow) > 0.6,
        "{:?}",
        vibrates(3.3)
    );
    assert!(
        share(vibrates(90.3), Component::Fast) > 0.6,
        "{:?}",
        vibrates(90.3)
    );
}

#[test]
fn parts_add_up_to_what_vaf_misses() {
    let noise = |t: f64| 0.2 * (1000.0 * t * t).sin();
    let r = recording(|t, x, v| switch(x, v) + 0.01 * v + noise(t));
    let reference = Reference::of(&r).unwrap();
    assert!((reference.force().iter().sum::<f64>() - 1.0).abs() < 1e-9);
    for table in [
        changed(|x, z| 0.1 * x * z + 3.0),
        changed(|x, _| (0.7 * x).cos()),
    ] {
        let parts = reference.errors(&table).unwrap();
        let vaf = vaf::score(&table, &r).vaf;
        assert!((parts.iter().sum::<f64>() - (1.0 - vaf)).abs() < 1e-9);
        let equal = Weights::new([Some(0.2); 5], None).unwrap();
        assert!((reference.vaf(&table, &equal).unwrap() - vaf).abs() < 1e-9);
        // With the weight on one component the errors of others do not count.
        let known = [Some(0.0), Some(1.0), Some(0.0), Some(0.0), Some(0.0)];
        let detents = Weights::new(known, None).unwrap();
        let expected = 1.0 - parts[1] / reference.force()[1];
        assert!((reference.vaf(&table, &detents).unwrap() - expected).abs() < 1e-9);
    }
}

#[test]
fn falls_are_between_crest_and_valley() {
    let r = recording(|_, x, v| switch(x, v));
    let reference = Reference::of(&r).unwrap();
    for (bin, falls) in reference.falls.iter().enumerate() {
        let x = (bin as f64 + 0.5) * 0.5;
        // not within a bin of a crest or a valley
        if (x / 5.0 - 0.5 - (x / 5.0 - 0.5).round()).abs() > 0.15 && x < 30.0 {
            assert_eq!(*falls, in_detent(x), "{x}");
        }
    }
    // a spring has none, and neither has noise
    let spring = recording(|t, x, _| 0.4 * x + 0.2 * (999.0 * t).sin());
    let reference = Reference::of(&spring).unwrap();
    assert!(!reference.has_detents());
    assert_eq!(reference.force()[1], 0.0);
    let profile = [1.0, 3.0, 2.95, 3.0, 1.0, 1.0, 4.0, 2.0].map(Some);
    let found = falls(&profile, 1.0);
    let expected = [false, false, false, true, true, true, true, true];
    assert_eq!(found, expected);
}

/// A spring with friction, of which one half of the travel is left three times as fast as it is entered.
#[test]
fn friction_of_uneven_strokes_is_no_detent() {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    let (mut i, mut x) = (0, 0.0);
    for (v, samples) in [(10.0, 3000), (-10.0, 1500), (-30.0, 500)].repeat(2) {
        for _ in 0..samples {
            let force = 0.02 * x + 0.5 * f64::signum(v);
            writeln!(text, "{},{x},{v},0,{force}", f64::from(i) * 0.001).unwrap();
            (i, x) = (i + 1, x + 0.001 * v);
        }
    }
    let r = crate::recording::read("r", text.as_bytes()).unwrap();
    assert!(!Reference::of(&r).unwrap().has_detents());
}

#[test]
fn files_read_back() {
    let known = [Some(0.125), Some(1.5), None, Some(0.0), None];
    let weights = Weights::new(known, Some("of \"P01\"".to_owned())).unwrap();
    assert_eq!(weights.all(), [0.125, 1.5, 1.625 / 3.0, 0.0, 1.625 / 3.0]);
    let text = file::write(&weights);
    let (read, findings) = file::parse("w.toml", &text);
    assert_eq!(read, Some(weights), "{findings:?}");
    assert_eq!(Weights::new([None; 5], None), None);
    assert_eq!(Weights::new([Some(-1.0); 5], None), None);
}

#[test]
fn files_that_are_wrong_say_where() {
    let faults = |text: &str| -> Vec<String> {
        let (read, findings) = file::parse("w.toml", text);
        assert_eq!(read, None);
        let messages = findings.faults.iter().map(|f| f.message.clone());
        messages.collect()
    };
    let head = "format = \"study-weights/1\"\n[weights]\n";
    let of = |rest: &str| faults(&format!("{head}{rest}"));
    assert_eq!(of("level = 0\n"), ["no weight is above 0"]);
    assert_eq!(of(""), ["no weight is above 0"]);
    assert_eq!(
        of("level = -1\ndetent = inf\nfast = 1\n"),
        [
            "the weight `level` is not a number of at least 0",
            "the weight `detent` is not a number of at least 0"
        ]
    );
    assert_eq!(
        of("levels = 1\nfast = 1\n"),
        ["unknown key `levels` in [weights]"]
    );
    assert_eq!(
        faults("format = \"study-weights/1\"\n"),
        ["the file has no `weights`"]
    );
    assert_eq!(
        faults("format = \"study-model/1\"\n"),
        ["this is not a study-weights/1 file"]
    );
}
