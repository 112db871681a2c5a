//! Realizations of measured force curves: do they have the force of the curve, and of what was left out?

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::path::{Path, PathBuf};
use study_haptics::identify::compare;
use study_haptics::identify::evidence::Term;
use study_haptics::identify::repetition::{Curve, Loops, WITHIN};
use study_haptics::identify::{Method, Passive, Training, Warning, vaf};
use study_haptics::recording::force_curve::{self, Source, Stated};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

/// A newton in gram-force.
const GRAM_FORCE_N: f64 = 9.80665e-3;
/// Nodes every 50 µm.
const DX_MM: f64 = 0.05;
const TENTHS: usize = 10;

fn read(path: &Path) -> Recording {
    let curve = force_curve::read(&std::fs::read_to_string(path).unwrap()).unwrap();
    let source = Source {
        curve: &curve,
        file: "curve.csv",
        sha256: "",
    };
    let bytes = force_curve::join(&[source], Stated::default());
    recording::read(
        path.file_stem().unwrap().to_string_lossy(),
        bytes.as_slice(),
    )
    .unwrap()
}

struct Quality {
    /// SD of the played force over that of the measured one.
    deviation: f64,
    /// rms difference of both, N.
    difference_n: f64,
    /// 1 − Σ e²/Σ (F − mean F)² over tenths of the travel of one direction that were left out, one
    /// after the other.
    left_out_vaf: f64,
    /// Whether mass and damping are named as not identified, with a bound of both.
    bounds: Vec<(Term, Option<f64>)>,
    measured: Curve,
}

fn quality(recording: &Recording) -> Quality {
    let method = Method::Passive(Passive::default());
    let identify = |recording: &Recording| {
        let training = Training::new(recording).unwrap();
        training.identify(method, DX_MM, Lookup::Linear).unwrap()
    };
    let whole = identify(recording);
    let loops = Loops::of(&[recording]).unwrap();
    let (measured, _) = loops.mean(loops.within_mm).unwrap();
    let played = loops.played(&whole.realization, loops.within_mm).unwrap();
    let (x, f) = (&recording.x_mm, &recording.f_n);
    let top = (0..x.len()).fold(0, |top, i| if x[i] > x[top] { i } else { top });
    let (mut squares, mut forces) = (0.0, Vec::new());
    for press in [true, false] {
        for tenth in 0..TENTHS {
            let [low, high] = [tenth, tenth + 1].map(|k| {
                let share = WITHIN[0] + (WITHIN[1] - WITHIN[0]) * k as f64 / TENTHS as f64;
                loops.range_mm[0] + share * (loops.range_mm[1] - loops.range_mm[0])
            });
            let out = |i: &usize| (*i <= top) == press && x[*i] >= low && x[*i] < high;
            let rest: Vec<usize> = (0..x.len()).filter(|i| !out(i)).collect();
            let found = identify(&recording.select(&rest)).realization;
            // the state of a prediction depends on the motion before
            let errors = vaf::errors(&found, recording);
            for i in (0..x.len()).filter(out) {
                squares += errors[i] * errors[i];
                forces.push(f[i]);
            }
        }
    }
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    let total: f64 = forces.iter().map(|f| (f - mean) * (f - mean)).sum();
    let bounds = whole.warnings.iter().filter_map(|warning| match warning {
        Warning::LeftOut(evidence) => Some((evidence.term, evidence.upper_bound)),
        _ => None,
    });
    Quality {
        deviation: played.deviation_n() / measured.deviation_n(),
        difference_n: played.difference_n(&measured),
        left_out_vaf: 1.0 - squares / total,
        bounds: bounds.collect(),
        measured,
    }
}

fn check(name: &str, quality: &Quality) {
    assert!((quality.deviation - 1.0).abs() < 0.05, "{name}");
    assert!(quality.difference_n < 3.0 * GRAM_FORCE_N, "{name}");
    let terms: Vec<Term> = quality.bounds.iter().map(|(term, _)| *term).collect();
    assert_eq!(terms, [Term::Mass, Term::Damping], "{name}");
}

/// The eight switches of the protocol `keyboard`.
#[test]
fn measured_switches_are_played_with_their_own_force() {
    let files = files("tests/data/switches");
    assert_eq!(files.len(), 8);
    for path in files {
        let recording = read(&path);
        let quality = quality(&recording);
        let name = &recording.name;
        check(name, &quality);
        // of a table of a fixed increment, and of what is recommended: a linear switch has no use for such short increments
        let training = Training::new(&recording).unwrap();
        let compared = compare::run(&training, Lookup::Linear, &[], |_| ()).unwrap();
        let recommended = compared.best().unwrap().left_out.unwrap().vaf;
        let vaf = quality.left_out_vaf;
        assert!(
            vaf >= 0.97 && recommended >= 0.98,
            "{name} {vaf} {recommended}"
        );
    }
}

/// The force curves of a folder.
fn files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    files.sort();
    files
}

/// A report over every file of the folder SWITCHES:
/// `SWITCHES=… cargo test --test identify every_switch -- --ignored --nocapture`
#[test]
#[ignore = "needs a folder of force curves"]
fn every_switch_of_a_folder() {
    let folder = std::env::var("SWITCHES").unwrap_or("tests/data/switches".into());
    let files = files(&folder);
    println!(
        "file | SD played/measured | rms difference, gf | VAF left out | mass, g | damping, N·s/m"
    );
    let mut all = Vec::new();
    for path in &files {
        let recording = read(path);
        let quality = quality(&recording);
        let bound = |i: usize, unit: f64| {
            let bound = quality.bounds.get(i).and_then(|(_, bound)| *bound);
            bound.map_or("-".into(), |bound| format!("< {:.0}", unit * bound))
        };
        println!(
            "{} | {:.3} | {:.2} | {:.4} | {} | {}",
            recording.name,
            quality.deviation,
            quality.difference_n / GRAM_FORCE_N,
            quality.left_out_vaf,
            bound(0, 1e3),
            bound(1, 1e3),
        );
        all.push((recording, quality));
    }
    let count = |of: &dyn Fn(&Quality) -> bool| all.iter().filter(|(_, q)| of(q)).count();
    println!(
        "{} files; SD within 5 %: {}, rms difference within 3 gf: {}, VAF left out ≥ .98: {}",
        all.len(),
        count(&|q| (q.deviation - 1.0).abs() < 0.05),
        count(&|q| q.difference_n < 3.0 * GRAM_FORCE_N),
        count(&|q| q.left_out_vaf >= 0.98),
    );
    for prefix in [
        "Cherry_MX_Purple_",
        "Diamond_Avalon_",
        "DareU_Mahjong_Green_",
        "Clickiez_",
    ] {
        let same = all
            .iter()
            .filter(|(r, _)| r.name.starts_with(prefix) && !r.name.contains("Actuations"));
        let curves: Vec<&Curve> = same.map(|(_, q)| &q.measured).collect();
        let pairs = (0..curves.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let each: Vec<String> = pairs
            .map(|(i, j)| format!("{:.2}", curves[i].difference_n(curves[j]) / GRAM_FORCE_N))
            .collect();
        println!("{prefix}: specimens differ by {} gf", each.join(", "));
    }
    for (recording, quality) in &all {
        check(&recording.name, quality);
    }
}
