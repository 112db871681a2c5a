//! Terms that are left out, and the scan of δ below its usual range.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use crate::estimators_tables::{identified, motion, target};
use assert_cmd::Command;
use study_haptics::identify::evidence::Term;
use study_haptics::identify::grid::{self, Plan};
use study_haptics::identify::method::{Start, Terms, Window};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{
    Ewls, Friction, Hat, Method, Passive, Training, TwoSided, Warning, Width,
};
use study_wire::predict::{Direction, DirectionState, Lookup, Motion};

/// Terms that are left out are 0, and the file says so.
#[test]
fn a_passive_table_has_only_the_terms_that_are_asked_for() {
    let r = target("r", 10, 0.1);
    let with = |m, b| {
        let method = Method::Passive(Passive {
            terms: Terms { m, b, ..Terms::ALL },
            ..Passive::default()
        });
        identified(&r, method, 1.0).realization
    };
    let all_zero = |of: &[f64]| of.iter().all(|v| *v == 0.0);
    let bare = with(false, false);
    assert!(all_zero(&bare.positive.m_kg) && all_zero(&bare.negative.b_n_s_per_mm));
    assert!(bare.provenance.method.ends_with("terms=f0"));
    let damped = with(false, true);
    assert!(all_zero(&damped.negative.m_kg) && damped.provenance.method.ends_with("terms=b"));
}

/// The paper's recursion without forgetting, with damping and a constant force only, is the
/// straight line of the force over the speed.
#[test]
fn a_recursion_without_mass_and_stiffness_is_the_regression_on_the_speed() {
    let r = target("r", 10, 0.1);
    let options = Ewls {
        terms: Terms {
            m: false,
            b: true,
            k: false,
            ..Terms::ALL
        },
        ..Ewls::paper(1.0, Resample::Point)
    };
    let estimates = Training::new(&r).unwrap().estimates(options).unwrap();
    let rows: Vec<[f64; 2]> = (0..r.len())
        .filter(|i| r.v_mm_s[*i] > 0.0)
        .map(|i| [r.v_mm_s[i], r.f_n[i]])
        .collect();
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| rows.iter().map(of).sum::<f64>() / rows.len() as f64;
    let (v, f) = (mean(&|row| row[0]), mean(&|row| row[1]));
    let product = mean(&|row| (row[0] - v) * (row[1] - f));
    let b = product / mean(&|row| (row[0] - v).powi(2));
    let [m, found, k, f0] = *estimates.positive.last().unwrap();
    assert_eq!([m, k], [0.0, 0.0]);
    assert!((found - b).abs() < 1e-6 * b.abs(), "{found} {b}");
    assert!((f0 - (f - b * v)).abs() < 1e-5, "{f0}");
}

/// Every method leaves out what it is told to, and a grid gives the tables of one cell.
#[test]
fn a_term_that_is_left_out_is_0_at_every_node_of_every_method() {
    let r = target("r", 10, 0.1);
    let training = Training::new(&r).unwrap();
    let terms = Terms {
        m: false,
        b: true,
        k: false,
        ..Terms::ALL
    };
    let of = |change: &dyn Fn(&mut Ewls)| {
        let mut options = Ewls {
            terms,
            ..Ewls::paper(0.99, Resample::Hat)
        };
        change(&mut options);
        Method::Ewls(options)
    };
    let methods = [
        of(&|_| ()),
        of(&|options| options.bounded = true),
        of(&|options| options.start = Start::Warm),
        Method::TwoSided(TwoSided {
            window: Window::Tricube,
            width: Width::Mm(0.5),
            bounded: true,
            terms,
        }),
        Method::Hat(Hat {
            terms,
            ..Hat::default()
        }),
        Method::Friction(Friction {
            terms,
            ..Friction::default()
        }),
    ];
    for method in methods {
        let alone = identified(&r, method, 1.0).realization;
        let plan = Plan {
            methods: vec![method],
            dx_mm: vec![1.0],
        };
        let cells = grid::run(&training, &plan, Lookup::Linear, &[], || ()).unwrap();
        for (one, other) in [
            (&alone.positive, &cells[0].realization.positive),
            (&alone.negative, &cells[0].realization.negative),
        ] {
            let out = one.m_kg.iter().chain(&one.k_n_per_mm);
            assert!(out.copied().all(|p| p == 0.0), "{method}: {one:?}");
            assert!(one.b_n_s_per_mm.iter().any(|b| *b != 0.0), "{method}");
            let forces = one.f0_n.iter().zip(&other.f0_n);
            assert!(
                forces.clone().all(|(a, b)| (a - b).abs() < 1e-6),
                "{method}"
            );
            let out = other.m_kg.iter().chain(&other.k_n_per_mm);
            assert!(out.copied().all(|p| p == 0.0), "{method}: {other:?}");
        }
        let name = alone.provenance.method;
        assert!(name.ends_with(" terms=b"), "{name}");
    }
}

/// A presliding far below 1/100 of the travel is found where the error says so.
#[test]
fn the_scan_goes_below_a_hundredth_of_the_travel_while_the_error_falls() {
    let mut r = motion("r", 10);
    let rule = Direction::Dahl { delta_mm: 0.05 };
    let mut state = DirectionState::default();
    for i in 0..r.len() {
        let at = Motion {
            x_mm: r.x_mm[i],
            v_mm_s: r.v_mm_s[i],
            a_m_s2: r.a_m_s2[i],
        };
        r.f_n[i] = 0.01 * at.v_mm_s + 1.5 * state.step(rule, at);
    }
    let [low, high] = r.range_mm();
    assert!(0.05 < 0.005 * (high - low));
    let found = identified(&r, Method::Friction(Friction::default()), 1.0);
    let delta = found.realization.direction.delta_mm().unwrap();
    assert!((0.035..=0.055).contains(&delta), "{delta}");
    // there is no mass, and the output says so
    let [Warning::LeftOut(mass)] = found.warnings[..] else {
        panic!("{:?}", found.warnings)
    };
    assert_eq!((mass.term, mass.found), (Term::Mass, false));
    assert_eq!(found.realization.positive.m_kg[0], 0.0);
}

/// A table without mass and damping is recommended for this key; what is known of both is said all the same, and a statement of another origin is refused.
#[test]
fn a_recommended_static_table_says_what_is_known_of_mass_and_damping() {
    let dir = tempfile::tempdir().unwrap();
    let study = || {
        let mut command = Command::cargo_bin("study").unwrap();
        command.current_dir(dir.path());
        command
    };
    let curve = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/switches/Haimu_x_Geon_HG_Silent_Red.csv"
    );
    study()
        .args(["import", "force-curve", curve, "-o", "key.csv"])
        .assert()
        .success();
    let identify = study()
        .args(["identify", "key.csv", "--out", "m", "--id", "key"])
        .assert()
        .success();
    let said = String::from_utf8_lossy(&identify.get_output().stdout);
    assert!(said.contains("\n*   static"), "{said}");
    for term in [
        "warning: mass: not identified by the recordings and not bounded",
        "warning: damping: not identified by the recordings, at most ",
    ] {
        assert!(said.contains(term), "{said}");
    }
    let document = study().args(["identify", "key.csv", "--json"]).assert();
    let document: serde_json::Value =
        serde_json::from_slice(&document.get_output().stdout).unwrap();
    let cells = document["cells"].as_array().unwrap();
    let cell = cells.iter().find(|cell| cell["method"] == "static");
    let terms = cell.unwrap()["terms"].as_array().unwrap();
    assert_eq!(terms.len(), 2, "{terms:?}");
    assert!(terms[0]["upper_bound"].is_null(), "{terms:?}");
    assert!(terms[1]["upper_bound"].as_f64() > Some(0.1), "{terms:?}");
    let text = std::fs::read_to_string(dir.path().join("m/key.toml")).unwrap();
    let bounded = "[terms.b_n_s_per_mm]\nupper_bound = ";
    assert!(text.contains(bounded), "{text}");
    let foreign = text.replace(
        bounded,
        "[terms.b_n_s_per_mm]\norigin = \"guessed\"\nupper_bound = ",
    );
    let faults = study_haptics::model::file::parse("key", &foreign).1;
    assert!(format!("{faults:?}").contains("guessed"), "{faults:?}");
}

/// Friction that grows smoothly with the speed is none that a table has: it takes up more mass than its recordings show, and says so.
#[test]
fn a_mass_of_a_table_that_is_not_the_one_of_the_recordings_is_named() {
    let warned = |friction_n: f64| {
        let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
        for i in 0..4000 {
            let t = f64::from(i) / 500.0;
            let [mut x, mut v, mut a] = [0.0; 3];
            for (hz, phase) in [(0.3, 3.2), (0.55, 6.0), (0.9, 0.9), (1.5, 6.0)] {
                let (mm, w) = (8.0 / (1.0 + hz), std::f64::consts::TAU * hz);
                let (sin, cos) = (w * t + phase).sin_cos();
                x += mm * sin;
                v += mm * w * cos;
                a -= 1e-3 * mm * w * w * sin;
            }
            let f = 0.3 * a + 0.005 * v + 2.0 * (0.5 * x).sin() + friction_n * v.tanh();
            let x = (x / 0.005).round() * 0.005;
            text += &format!("{t},{x},{v},{a},{f}\n");
        }
        let recording = study_haptics::recording::read("detents", text.as_bytes()).unwrap();
        let found = identified(&recording, Method::Passive(Passive::default()), 1.0);
        let of_table = found.realization.positive.m_kg[0];
        let other = found.warnings.iter().any(|warning| {
            matches!(warning, Warning::OtherMass { table_kg, .. } if *table_kg == of_table)
        });
        (of_table, other)
    };
    let (smooth, said) = warned(0.5);
    assert!(smooth > 0.35 && said, "{smooth} {said}");
    let (without, said) = warned(0.0);
    assert!((without - 0.3).abs() < 0.02 && !said, "{without} {said}");
}
