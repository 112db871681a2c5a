//! Perceptual VAF beside VAF: `study identify --weights`.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use crate::compare::{study, text_of};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

const EQUAL: &str = "format = \"study-weights/1\"\nnote = \"alike\"\n[weights]\n\
    level = 2\ndetent = 2\ndirection = 2\nslow = 2\nfast = 2\n";
const DETENTS: &str = "format = \"study-weights/1\"\n[weights]\n\
    level = 0\ndetent = 1\ndirection = 0\nslow = 0\nfast = 0\n";

/// A training recording and one for validation of a target with detents, and both files of weights.
fn files(dir: &Path) {
    let detents = |x: f64, v: f64| 0.5 * (TAU * x / 12.0).sin() + 0.5 * (v / 5.0).tanh();
    for (name, seed) in [("t.csv", 7), ("v.csv", 8)] {
        fs::write(dir.join(name), text_of(seed, 30.0, detents)).unwrap();
    }
    fs::write(dir.join("equal.toml"), EQUAL).unwrap();
    fs::write(dir.join("detents.toml"), DETENTS).unwrap();
}

#[test]
fn perceptual_vaf_is_beside_vaf() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let passive = ["t.csv", "--validate", "v.csv", "--method", "passive"];
    let with = |more: &[&str]| -> String {
        let (code, out, err) = study(dir.path(), &[&passive[..], more].concat());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    let cell = |weights: &str| -> Value {
        let document: Value =
            serde_json::from_str(&with(&["--dx", "1", "--json", "--weights", weights])).unwrap();
        document["cells"][0].clone()
    };
    // Equal weights are those of VAF.
    let equal = cell("equal.toml");
    let vaf = equal["vaf"]["v"].as_f64().unwrap();
    assert!((equal["perceptual_vaf"]["v"].as_f64().unwrap() - vaf).abs() < 1e-9);
    let detents = cell("detents.toml");
    assert_eq!(detents["vaf"], equal["vaf"]);
    let weighed = detents["perceptual_vaf"]["v"].as_f64().unwrap();
    assert!(weighed < 1.0 && (weighed - vaf).abs() > 1e-4, "{weighed}");
    let page = with(&["--dx", "1", "--weights", "detents.toml"]);
    assert!(
        page.contains("perceptual v") && page.contains(&format!("{weighed:.6}")),
        "{page}"
    );
    let plain: Value = serde_json::from_str(&with(&["--dx", "1", "--json"])).unwrap();
    assert!(plain["cells"][0].get("perceptual_vaf").is_none());
}

#[test]
fn methods_are_compared_by_what_is_weighed() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let compared = |more: &[&str]| -> String {
        let (code, out, err) = study(dir.path(), &[&["t.csv"][..], more].concat());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    let page = compared(&["--weights", "detents.toml"]);
    assert!(
        page.contains("because its perceptual VAF on data left out is "),
        "{page}"
    );
    let document = compared(&["--weights", "equal.toml", "--json"]);
    let document: Value = serde_json::from_str(&document).unwrap();
    let candidates = document["comparison"]["candidates"].as_array().unwrap();
    let mut known = 0;
    for candidate in candidates {
        let both = ["vaf_left_out", "perceptual_vaf_left_out"].map(|key| candidate[key].as_f64());
        if let [Some(vaf), Some(weighed)] = both {
            // It does not count a constant error.
            assert!(weighed >= vaf - 1e-9, "{candidate}");
            known += 1;
        }
    }
    assert!(known >= 2, "{candidates:?}");
}

/// A spring has no detents, so that weights of detents alone say nothing of it.
#[test]
fn weights_that_say_nothing_do_not_compare() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let spring = |x: f64, v: f64| 0.3 * (x - 15.0) + 0.2 * (v / 5.0).tanh();
    fs::write(dir.path().join("s.csv"), text_of(7, 30.0, spring)).unwrap();
    let args = ["s.csv", "--weights", "detents.toml"];
    let (_, out, err) = study(dir.path(), &args);
    let said =
        "perceptual VAF is not defined there, so that methods are compared by their residual";
    assert!(out.contains(said), "{out}{err}");
}

#[test]
fn files_of_weights_that_are_wrong_are_named() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let refused = |weights: &str| -> String {
        let args = ["t.csv", "--method", "passive", "--weights", weights];
        let (code, out, err) = study(dir.path(), &args);
        assert_eq!(code, 1, "{out}{err}");
        err
    };
    let said = refused("none.toml");
    assert!(said.contains("none.toml"), "{said}");
    let nothing = DETENTS.replace("detent = 1", "detent = 0");
    fs::write(dir.path().join("nothing.toml"), nothing).unwrap();
    let said = refused("nothing.toml");
    assert!(
        said.contains("nothing.toml") && said.contains("no weight is above 0"),
        "{said}"
    );
}
