//! What `study identify` says: features that a table is too coarse for, methods that others beat, the numbers of elements.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use crate::compare::{study, text_of};
use std::f64::consts::TAU;
use std::fs;

/// Bumps every 2 mm need nodes closer than 1 mm. The warning has their size, which is that of the residual, and is gone with closer nodes.
#[test]
fn features_narrower_than_two_distances_of_the_nodes_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let bumps = |x: f64, v: f64| 0.1 * x + 0.8 * (TAU * x / 2.0).sin() + 0.3 * v.signum();
    fs::write(dir.path().join("t.csv"), text_of(6, 30.0, bumps)).unwrap();
    let with = |dx: &str| {
        let args = ["t.csv", "--method", "passive", "--dx", dx];
        let (code, out, err) = study(dir.path(), &args);
        assert_eq!(code, 0, "{out}{err}");
        out + &err
    };
    let said = with("2");
    let (before, _) = said
        .split_once(
            " N rms of the force repeat at places closer than 2 dx = 4 mm, which nodes at this distance cannot follow: \
             choose a smaller dx",
        )
        .unwrap_or_else(|| panic!("{said}"));
    let rms_n: f64 = before.split_whitespace().last().unwrap().parse().unwrap();
    // a sine of 0.8 N: 0.566 N rms
    assert!((0.45..0.6).contains(&rms_n), "{said}");
    let said = with("0.25");
    assert!(!said.contains("closer than 2 dx"), "{said}");
}

/// On a target with detents, friction alone predicts better than a constant and is far from a table: a comparison says so with
/// the factor, and so does `--method friction` where it was validated.
#[test]
fn a_method_with_twice_the_residual_is_named_with_the_factor() {
    let dir = tempfile::tempdir().unwrap();
    let detents = |x: f64, v: f64| 0.5 * (TAU * x / 12.0).sin() + 0.5 * (v / 5.0).tanh();
    for (name, seed) in [("t.csv", 7), ("v.csv", 8)] {
        fs::write(dir.path().join(name), text_of(seed, 30.0, detents)).unwrap();
    }
    let factor = |said: &str, before: &str, after: &str| -> f64 {
        let (_, rest) = said
            .split_once(before)
            .unwrap_or_else(|| panic!("{before}: {said}"));
        let (number, _) = rest
            .split_once(after)
            .unwrap_or_else(|| panic!("{after}: {said}"));
        number.parse().unwrap()
    };
    let (code, out, err) = study(dir.path(), &["t.csv"]);
    assert_eq!(code, 0, "{out}{err}");
    // of the detents' 0.35 N rms and of what a table leaves of them
    let compared = factor(&out, "friction: its residual is ", " times that of ");
    assert!((2.0..15.0).contains(&compared), "{out}");
    let args = |method| ["t.csv", "--validate", "v.csv", "--method", method];
    let (_, out, err) = study(dir.path(), &args("friction"));
    let said = out + &err;
    let before = "warning: the residual of friction is ";
    let after = " times that of passive: without --method the methods are compared";
    let asked = factor(&said, before, after);
    assert!((2.0..15.0).contains(&asked), "{said}");
    let (_, out, err) = study(dir.path(), &args("passive"));
    let said = out + &err;
    assert!(!said.contains("warning: the residual of"), "{said}");
}

/// `cells` of `--json` have the elements of the model file: mass, nodes, potential, dampers, and every spring.
#[test]
fn the_document_of_elements_has_what_the_model_file_has() {
    let dir = tempfile::tempdir().unwrap();
    let target = |x: f64, v: f64| 0.05 * x + 0.02 * v + 0.3 * v.signum();
    fs::write(dir.path().join("t.csv"), text_of(9, 30.0, target)).unwrap();
    let args = ["t.csv", "--method", "elements", "--dx", "2", "--out", "m"];
    let (code, out, err) = study(dir.path(), &[&args[..], &["--json"]].concat());
    assert_eq!(code, 0, "{out}{err}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let elements = &document["cells"][0]["elements"];
    let written = fs::read_dir(dir.path().join("m")).unwrap().next().unwrap();
    let text = fs::read_to_string(written.unwrap().path()).unwrap();
    let file: toml::Table = text.parse().unwrap();
    assert_eq!(*elements, serde_json::to_value(&file["elements"]).unwrap());
    assert!(
        !elements["springs"].as_array().unwrap().is_empty(),
        "{elements}"
    );
    let args = ["t.csv", "--method", "passive", "--dx", "2", "--json"];
    let (_, out, _) = study(dir.path(), &args);
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(document["cells"][0]["elements"].is_null());
}
