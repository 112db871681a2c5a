//! Mass and damping from a dynamic recording beside slow loops, or stated.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use predicates::prelude::*;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use study_base::rng::Stream;
use study_haptics::identify::elsewhere::{Elsewhere, Stated};
use study_haptics::identify::grid::{self, Cell, Plan};
use study_haptics::identify::{Estimate, IdentifyError, Method, Passive, Training};
use study_haptics::model::coverage::Origin;
use study_haptics::model::file;
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

/// A newton in gram-force.
const GRAM_FORCE_N: f64 = 9.80665e-3;

fn uniform(stream: &mut Stream) -> f64 {
    stream.below(1 << 52) as f64 / (1_u64 << 52) as f64
}

fn rounded(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

/// A key of 4 mm and 0.6 N: a spring, a tactile bump, and Dahl's friction, which is not the rule of the tables.
#[derive(Debug, Clone, Copy)]
struct Key {
    bump_mm: f64,
    bump_n: f64,
    slip_mm: f64,
    m_kg: f64,
    b_n_s_per_mm: f64,
}

impl Key {
    fn new(stream: &mut Stream, [m_kg, b_n_s_per_mm]: [f64; 2]) -> Self {
        Self {
            bump_mm: 1.2 + uniform(stream),
            bump_n: 0.1 + 0.2 * uniform(stream),
            slip_mm: 0.02 + 0.05 * uniform(stream),
            m_kg,
            b_n_s_per_mm,
        }
    }

    /// The force along positions, mm, with velocity and acceleration.
    fn forces(&self, motion: &[[f64; 3]]) -> Vec<f64> {
        let (mut z, mut last) = (1.0_f64, motion[0][0]);
        let force = |[x, v, a]: &[f64; 3]| {
            let moved = x - last;
            last = *x;
            let sign = moved.signum();
            z = sign + (z - sign) * (-moved.abs() / self.slip_mm).exp();
            let bump = self.bump_n * (-((x - self.bump_mm) / 0.25).powi(2)).exp();
            let friction = (0.06 + 0.02 * (2.0 * x).sin()) * z;
            0.3 + 0.08 * x + bump + friction + self.m_kg * a + self.b_n_s_per_mm * v
        };
        motion.iter().map(force).collect()
    }
}

/// A press and a release at 0.1 mm/s by a force tester: 10 Hz, 5 µm, 0.1 gf.
fn slow(key: Key, noise: &mut Stream) -> String {
    const STEPS: usize = 20;
    let mut motion = Vec::new();
    let (mut x, mut v) = (0.0, 0.0);
    for direction in [1.0, -1.0] {
        while direction * x < direction * if direction > 0.0 { 4.0 } else { 0.02 } {
            let a = (0.1 * direction - v) / 0.2;
            v += a * 0.1 / STEPS as f64;
            x += v * 0.1 / STEPS as f64;
            motion.push([x, v, 1e-3 * a]);
        }
    }
    let forces = key.forces(&motion);
    let mut text = String::from("t_s,x_mm,f_n\n");
    for (row, i) in (0..motion.len()).step_by(STEPS).enumerate() {
        let f = forces[i] + 0.05 * GRAM_FORCE_N * noise.normal();
        let (x, f) = (rounded(motion[i][0], 0.005), rounded(f, 0.1 * GRAM_FORCE_N));
        writeln!(text, "{},{x},{f}", 0.1 * row as f64).unwrap();
    }
    text
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fast {
    /// One press by a hand.
    Press,
    /// Presses by a hand for 10 s.
    Presses,
    /// Eight presses that are alike.
    Alike,
    /// As slow as the loops, at 100 Hz.
    Slow,
}

/// At 1 kHz by an encoder of 2 µm, with another force sensor that has another zero.
fn fast(kind: Fast, key: Key, noise: &mut Stream) -> String {
    let motion: Vec<[f64; 3]> = match kind {
        Fast::Press | Fast::Alike | Fast::Slow => {
            let (period_s, n) = match kind {
                Fast::Slow => (60.0, 6000),
                Fast::Alike => (2.4, 2400),
                _ => (0.3, 300),
            };
            let w = TAU / if kind == Fast::Alike { 0.3 } else { period_s };
            let at = |i: u32| {
                let (sin, cos) = (w * (period_s * f64::from(i) / f64::from(n))).sin_cos();
                [2.0 - 1.9 * cos, 1.9 * w * sin, 1.9e-3 * w * w * cos]
            };
            (0..n).map(at).collect()
        }
        Fast::Presses => {
            let parts: Vec<[f64; 3]> = (0..6)
                .map(|k| {
                    let hz = 0.5 + 0.9 * f64::from(k) * (0.8 + 0.4 * uniform(noise));
                    [TAU * hz, 1.1 / f64::from(1 + k), TAU * uniform(noise)]
                })
                .collect();
            let at = |i: u32| {
                let t = 1e-3 * f64::from(i);
                let mut all = [2.0, 0.0, 0.0];
                for [w, mm, phase] in &parts {
                    let (sin, cos) = (w * t + phase).sin_cos();
                    all[0] += mm * sin;
                    all[1] += mm * w * cos;
                    all[2] -= 1e-3 * mm * w * w * sin;
                }
                all
            };
            // beyond the travel nothing was measured
            (0..10_000).map(at).collect()
        }
    };
    let rate_hz = if kind == Fast::Slow { 100.0 } else { 1000.0 };
    let mut text = String::from("t_s,x_mm,f_n\n");
    for (i, (moment, f)) in motion.iter().zip(key.forces(&motion)).enumerate() {
        let f = f + 0.04 + 0.005 * noise.normal();
        let x = rounded(moment[0], 0.002);
        writeln!(text, "{},{x},{f}", i as f64 / rate_hz).unwrap();
    }
    text
}

fn read(name: &str, text: &str) -> Recording {
    recording::read(name, text.as_bytes()).unwrap()
}

fn identified(slow: &Recording, dynamic: &[&Recording]) -> Result<Cell, IdentifyError> {
    let training = Training::new(slow)?;
    let (range_mm, said) = (training.range_mm(), training.evidence().copied());
    let elsewhere = Elsewhere::of(dynamic, Stated::default(), range_mm, said.as_ref())?;
    let plan = Plan {
        methods: vec![Method::Passive(Passive::default())],
        dx_mm: vec![0.05],
    };
    let training = training.with_elsewhere(elsewhere);
    let cells = grid::run(&training, &plan, Lookup::Linear, &[], || ())?;
    Ok(cells.into_iter().next().unwrap())
}

/// What is found of mass and damping of a key.
fn found(kind: Fast, set: u64, planted: [f64; 2]) -> ([Estimate; 2], Cell) {
    let name = format!("{kind:?} {set}");
    let [mut plant, mut noise] = ["plant", "noise"].map(|what| Stream::new(1541, &[what, &name]));
    let key = Key::new(&mut plant, planted);
    let slow = read("slow", &slow(key, &mut noise));
    let fast = read("fast", &fast(kind, key, &mut noise));
    let cell = identified(&slow, &[&fast]).unwrap();
    let terms = cell.terms.clone().try_into().unwrap();
    (terms, cell)
}

/// Of keys with nothing, and with a mass or a damping: how often something is found where nothing is, where something is, how often it is within 99 % of its
/// estimate, and below its bound where it is not found; and the median standard error.
#[derive(Debug, Default)]
struct Rates {
    wrong: usize,
    bounded: usize,
    found: usize,
    within: usize,
    covered: usize,
    errors: Vec<f64>,
}

fn rates(kind: Fast, term: usize, sets: u64) -> Rates {
    let mut rates = Rates::default();
    for set in 0..sets {
        let nothing = found(kind, set, [0.0; 2]).0[term];
        rates.wrong += usize::from(nothing.identified);
        let Some(bound) = nothing.upper_bound else {
            continue;
        };
        rates.bounded += 1;
        let mut planted = [0.0; 2];
        planted[term] = 2.5 * bound;
        let there = found(kind, set, planted).0[term];
        rates.found += usize::from(there.identified);
        let error = there.standard_error.unwrap();
        rates.errors.push(error);
        rates.within += usize::from((there.value - planted[term]).abs() < 2.576 * error);
        planted[term] = 0.5 * bound;
        let half = found(kind, set, planted).0[term];
        rates.covered += usize::from(half.upper_bound.is_none_or(|b| b >= planted[term]));
    }
    rates
}

/// A single fast press shows mass and damping of a key beside its slow loop, within the intervals that are stated, and presses for 10 s show the mass.
#[test]
fn a_planted_mass_and_damping_are_found_within_their_intervals() {
    let sets = 8;
    for (kind, term) in [
        (Fast::Press, 0),
        (Fast::Press, 1),
        (Fast::Presses, 0),
        (Fast::Alike, 0),
    ] {
        let found = rates(kind, term, sets as u64);
        assert!(found.wrong <= 1, "{kind:?} {term} {found:?}");
        assert_eq!(found.bounded, sets, "{kind:?} {term} {found:?}");
        let most = [found.found, found.within, found.covered];
        assert!(
            most.iter().all(|count| count + 1 >= sets),
            "{kind:?} {term} {found:?}"
        );
    }
}

#[test]
fn the_table_of_the_slow_loop_is_held() {
    let ([mass, damping], cell) = found(Fast::Presses, 0, [0.02, 2e-4]);
    assert!(
        mass.identified && damping.identified,
        "{mass:?} {damping:?}"
    );
    assert_eq!([mass.origin, damping.origin], [Origin::Dynamic; 2]);
    let [mut plant, mut noise] =
        ["plant", "noise"].map(|what| Stream::new(1541, &[what, "Presses 0"]));
    let key = Key::new(&mut plant, [0.02, 2e-4]);
    let slow = read("slow", &slow(key, &mut noise));
    let training = Training::new(&slow).unwrap();
    let alone = training
        .identify(Passive::default(), 0.05, Lookup::Linear)
        .unwrap();
    let (with, alone) = (&cell.realization, &alone.realization);
    for (one, other) in [
        (&with.positive, &alone.positive),
        (&with.negative, &alone.negative),
    ] {
        assert_eq!(one.f0_n, other.f0_n);
        assert!(one.m_kg.iter().all(|m| *m == mass.value));
        assert!(one.b_n_s_per_mm.iter().all(|b| *b == damping.value));
        assert!(
            other
                .m_kg
                .iter()
                .chain(&other.b_n_s_per_mm)
                .all(|p| *p == 0.0)
        );
    }
    assert!(cell.certificate.passes());
    assert!(with.trained.v_mm_s > 10.0 * alone.trained.v_mm_s);
}

/// As slow as the loop, another recording says nothing of a mass of a few grams, and says that.
#[test]
fn a_slow_recording_says_that_it_shows_no_mass() {
    let ([mass, _], cell) = found(Fast::Slow, 0, [0.02, 0.0]);
    assert!(!mass.identified, "{mass:?}");
    assert!(mass.upper_bound.is_none_or(|bound| bound > 0.5), "{mass:?}");
    let said: Vec<String> = cell.warnings.iter().map(ToString::to_string).collect();
    assert!(
        said.iter()
            .any(|text| text.starts_with("mass: not identified by the dynamic recordings")),
        "{said:?}"
    );
    assert_eq!(cell.realization.positive.m_kg[0], 0.0);
}

/// `SETS=40 cargo test --release --test identify elsewhere::rates_in_many -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes"]
fn rates_in_many() {
    let sets = std::env::var("SETS").map_or(20, |text| text.parse().unwrap());
    for kind in [Fast::Press, Fast::Presses, Fast::Alike, Fast::Slow] {
        for term in [0, 1] {
            let Rates {
                wrong,
                bounded,
                found,
                within,
                covered,
                mut errors,
            } = rates(kind, term, sets);
            errors.sort_by(f64::total_cmp);
            let median = errors.get(errors.len() / 2).unwrap_or(&f64::NAN);
            println!(
                "{kind:?} {term} | bounded {bounded}/{sets} | wrong {wrong} | found {found} | within {within} | covered {covered} | {median:.2e}"
            );
        }
    }
}

const LOOP: &str = "loop.csv";
const PRESS: &str = "press.csv";

/// A folder with a loop and a press of a key of 20 g, the second one changed.
fn folder(change: impl Fn(&str) -> String) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let [mut plant, mut noise] = ["plant", "noise"].map(|what| Stream::new(7, &[what]));
    let key = Key::new(&mut plant, [0.02, 0.0]);
    let quasi = "# quasi-static: 10 rows a second are assumed\n";
    fs::write(
        dir.path().join(LOOP),
        format!("{quasi}{}", slow(key, &mut noise)),
    )
    .unwrap();
    let press = change(&fast(Fast::Press, key, &mut noise));
    fs::write(dir.path().join(PRESS), press).unwrap();
    dir
}

fn identify(dir: &Path, args: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("study").unwrap();
    command.current_dir(dir).args(["identify", LOOP]).args(args);
    command.assert()
}

/// One column of a press, otherwise.
fn with(text: &str, column: usize, of: impl Fn(f64) -> f64) -> String {
    let mut lines = text.lines();
    let mut out = format!("{}\n", lines.next().unwrap());
    for line in lines {
        let mut fields: Vec<f64> = line.split(',').map(|f| f.parse().unwrap()).collect();
        fields[column] = of(fields[column]);
        writeln!(out, "{},{},{}", fields[0], fields[1], fields[2]).unwrap();
    }
    out
}

const PASSIVE: [&str; 4] = ["--method", "passive", "--dx", "0.05"];

/// Terminal, document, model file and page say where the mass is from.
#[test]
fn every_output_says_that_a_mass_is_from_a_dynamic_recording() {
    let dir = folder(str::to_owned);
    let args = [
        "--dynamic",
        PRESS,
        "--out",
        "m",
        "--id",
        "key",
        "--figures",
        "figures",
    ];
    identify(dir.path(), &[&PASSIVE[..], &args].concat())
        .success()
        .stdout(predicate::str::contains("g, identified from press\n"))
        .stdout(predicate::str::contains(
            "damping: not identified by the dynamic recordings",
        ));
    let text = fs::read_to_string(dir.path().join("m/key.toml")).unwrap();
    let model = file::parse("key", &text).0.unwrap();
    let mass = model.provenance.terms["m_kg"];
    assert_eq!(mass.origin, Origin::Dynamic);
    assert!((mass.value.unwrap() - 0.02).abs() < 2.576 * mass.standard_error.unwrap());
    assert!(model.provenance.recordings.contains_key("press"));
    let note = model.provenance.note.unwrap();
    assert!(note.contains("kg is from the recording press"), "{note}");
    assert_eq!(file::write(&file::parse("key", &text).0.unwrap()), text);
    let page = fs::read_to_string(dir.path().join("figures/identification.html")).unwrap();
    assert!(page.contains("identified from press"));
    let args = ["--dynamic", PRESS, "--json"];
    let out = identify(dir.path(), &[&PASSIVE[..], &args].concat()).success();
    let document: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    assert_eq!(document["cells"][0]["terms"][0]["origin"], "dynamic");
    assert_eq!(document["recordings"][0]["role"], "dynamic");
}

/// A stated mass is named as such in the terminal, the document and the model file, and the method stays free.
#[test]
fn every_output_says_that_a_mass_is_stated() {
    let dir = folder(str::to_owned);
    let args = ["--mass-kg", "0.012", "--out", "m", "--id", "key"];
    identify(dir.path(), &args)
        .success()
        .stdout(predicate::str::contains(
            "mass 12.00 g, stated and not identified\n",
        ))
        .stdout(predicate::str::contains(
            "damping: not identified by the recordings, at most",
        ));
    let text = fs::read_to_string(dir.path().join("m/key.toml")).unwrap();
    assert!(
        text.contains("[terms.m_kg]\nvalue = 0.012\norigin = \"stated\"\n"),
        "{text}"
    );
    let model = file::parse("key", &text).0.unwrap();
    assert!(model.positive.m_kg.iter().all(|m| *m == 0.012));
    assert!(
        model
            .provenance
            .note
            .unwrap()
            .contains("mass 0.012 kg is stated, not identified")
    );
    let out = identify(dir.path(), &["--mass-kg", "0.012", "--json"]).success();
    let document: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    let mass = &document["cells"][0]["terms"][0];
    assert_eq!(
        (&mass["origin"], &mass["identified"]),
        (&"stated".into(), &false.into())
    );
    // grams that are taken for kilograms
    let out = identify(dir.path(), &[&PASSIVE[..], &["--mass-kg", "12"]].concat()).success();
    out.stdout(predicate::str::contains(
        "warning: mass of 12.00 kg is stated: five strokes a second over the travel would take ",
    ));
    let out = identify(
        dir.path(),
        &[&PASSIVE[..], &["--mass-kg", "0.012"]].concat(),
    )
    .success();
    out.stdout(predicate::str::contains("five strokes a second").not());
    // a press contradicts it
    let args = ["--mass-kg", "0.2", "--dynamic", PRESS];
    identify(dir.path(), &[&PASSIVE[..], &args].concat())
        .success()
        .stdout(predicate::str::contains(
            "warning: mass of 200.00 g is stated, but the dynamic recordings say ",
        ));
}

#[test]
fn a_dynamic_recording_that_does_not_belong_there_is_refused_with_the_cause() {
    let refused = |change: &dyn Fn(&str) -> String, args: &[&str], said: &[&str]| {
        let dir = folder(change);
        let mut all = [&PASSIVE[..], &["--dynamic", PRESS]].concat();
        all.extend(args);
        let assert = identify(dir.path(), &all).failure().stdout("");
        for text in said {
            assert!(
                String::from_utf8_lossy(&assert.get_output().stderr).contains(text),
                "{text}: {assert}"
            );
        }
    };
    let same = |text: &str| text.to_owned();
    // another origin, and another unit of the positions
    let range = "% of its samples are where the force by position is known";
    refused(
        &|text| with(text, 1, |x| x + 10.0),
        &[],
        &["0 ", range, "same origin"],
    );
    refused(
        &|text| with(text, 1, |x| 1e3 * x),
        &[],
        &[range, "same unit"],
    );
    // gram-force
    refused(
        &|text| with(text, 2, |f| f / GRAM_FORCE_N),
        &[],
        &["times that of the training recordings", "same unit"],
    );
    refused(
        &|text| text.replace("f_n", "force"),
        &[],
        &["press.csv", "no column f_n", "--columns"],
    );
    refused(
        &|text| text.lines().take(61).collect::<Vec<_>>().join("\n"),
        &[],
        &["press has 60 samples", "need 80"],
    );
    refused(
        &same,
        &["--terms", "m,f0"],
        &["--terms m asks for what is from elsewhere"],
    );
    // pounds are not so far away that they are refused
    let pounds = folder(|text| with(text, 2, |f| f / 4.448_221_6));
    identify(
        pounds.path(),
        &[&PASSIVE[..], &["--dynamic", PRESS]].concat(),
    )
    .success()
    .stdout(predicate::str::contains(
        "warning: the force of the dynamic recordings is 0.2",
    ));
    let elements = ["--method", "mechanism"];
    let dir = folder(same);
    identify(dir.path(), &[&elements[..], &["--dynamic", PRESS]].concat())
        .failure()
        .stderr(predicate::str::contains("mechanism has its own"));
}
