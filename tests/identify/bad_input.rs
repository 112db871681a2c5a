//! `study identify` on invalid or doubtful recordings: one clear error, or a warning with
//! the table.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use study_haptics::recording;

const NAMES: &str = "t_s,x_mm,v_mm_s,a_m_s2,f_n";

/// t, x, v, a, F of a synthetic switch, 4 s at 500 Hz.
fn rows(sines: &[(f64, f64)]) -> Vec<[f64; 5]> {
    (0..2000)
        .map(|i| {
            let t = f64::from(i) / 500.0;
            let (mut x, mut v, mut a) = (17.5, 0.0, 0.0);
            for (hz, mm) in sines {
                let w = hz * std::f64::consts::TAU;
                x += mm * (w * t).sin();
                v += mm * w * (w * t).cos();
                a -= mm * w * w * (w * t).sin() / 1000.0;
            }
            let f = 0.2 * a + 0.01 * v + 6.0 * (x / 2.0).sin() + 0.8 * v.signum();
            [t, x, v, a, f]
        })
        .collect()
}

fn training() -> Vec<[f64; 5]> {
    rows(&[(0.5, 12.0), (2.37, 4.0)])
}

fn text(names: &str, rows: &[[f64; 5]]) -> String {
    let mut text = format!("{names}\n");
    for [t, x, v, a, f] in rows {
        // writing to a String cannot fail
        let _ = writeln!(text, "{t},{x},{v},{a},{f}");
    }
    text
}

/// Exit code, standard output and standard error with this training recording.
fn identify(training: &str, more: &[&str]) -> (i32, String, String) {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| -> PathBuf {
        let path = dir.path().join(name);
        fs::write(&path, text).unwrap();
        path
    };
    let training = file("training.csv", training);
    let validation = file("validation.csv", &text(NAMES, &rows(&[(1.5, 15.0)])));
    let output = Command::cargo_bin("study")
        .unwrap()
        .arg("identify")
        .arg(training)
        .arg("--validate")
        .arg(validation)
        .args(["--lambda", "0.98", "--dx", "1"])
        .args(more)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().expect("it was not killed"),
        text(&output.stdout),
        text(&output.stderr),
    )
}

/// Expects an input error and no table.
fn refused(training: &str, said: &str) {
    let (code, out, err) = identify(training, &[]);
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
    assert!(err.contains(said), "{said:?} in {err}");
}

/// Expects a table and a warning, also in the JSON document.
fn warned(training: &str, said: &str) {
    let (code, out, err) = identify(training, &[]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("VAF"), "{out}");
    assert!(
        err.contains("warning: ") && err.contains(said),
        "{said:?} in {err}"
    );
    let (code, out, _) = identify(training, &["--json"]);
    assert_eq!(code, 0);
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let warnings = document["training"]["warnings"].to_string();
    assert!(warnings.contains(said), "{said:?} in {warnings}");
}

#[test]
fn a_good_recording_has_no_warning() {
    let (code, _, err) = identify(&text(NAMES, &training()), &[]);
    assert_eq!((code, err.as_str()), (0, ""));
}

#[test]
fn a_force_of_the_wrong_sign_is_refused_by_its_energy_unless_the_target_is_active() {
    let mut flipped = training();
    flipped.iter_mut().for_each(|row| row[4] = -row[4]);
    let flipped = text(NAMES, &flipped);
    refused(&flipped, "training.csv: the target supplies energy: ");
    refused(&flipped, "change the sign of F");
    let (code, out, err) = identify(&flipped, &["--active"]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("VAF"), "{out}");
}

#[test]
fn a_spike_is_named_and_replaced_on_request() {
    let mut spiked = training();
    spiked[700][4] = 1e8;
    let spiked = text(NAMES, &spiked);
    warned(&spiked, "1 spike in f_n, the largest 100000000 at 1.4000 s");
    let vaf = |training: &str, more: &[&str]| {
        let (code, out, err) = identify(training, &[&["--json"], more].concat());
        assert_eq!(code, 0, "{err}");
        let document: serde_json::Value = serde_json::from_str(&out).unwrap();
        document["cells"][0]["vaf"]["validation"].as_f64().unwrap()
    };
    let good = vaf(&text(NAMES, &training()), &[]);
    let robust = vaf(&spiked, &["--robust"]);
    assert!((good - robust).abs() < 0.001, "{good} {robust}");
    assert!(vaf(&spiked, &[]) < -1e3);
    // a position that is impossible may turn the sign of the energy
    let mut jump = training();
    let rise = |i: &usize| jump[i + 1][4] - jump[i - 1][4];
    let steepest = (100..1000).max_by(|a, b| rise(a).total_cmp(&rise(b)));
    jump[steepest.unwrap()][1] = 1e8;
    let (code, _, err) = identify(&text(NAMES, &jump), &[]);
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("may be the cause: --robust replaces them"),
        "{err}"
    );
    let (code, out, err) = identify(&text(NAMES, &jump), &["--robust"]);
    assert_eq!(code, 0, "{out}{err}");
    assert!(err.contains(": 1 spike replaced"), "{err}");
}

#[test]
fn jitter_is_resampled_for_a_filter_and_said() {
    let mut rows = training();
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] += if i % 3 == 1 { 0.0006 } else { 0.0 };
    }
    // and stamps that are each off by up to 0.35 of an interval
    let mut rough = training();
    for (i, row) in rough.iter_mut().enumerate() {
        row[0] += 0.0007 * (((i * 7919) % 100) as f64 / 49.5 - 1.0);
    }
    for rows in [rows, rough] {
        let (code, _, err) = identify(&text(NAMES, &rows), &["--filter", "30"]);
        assert_eq!(code, 0, "{err}");
        assert!(err.contains("resampled at even intervals"), "{err}");
        assert!(!err.contains("gap"), "{err}");
    }
}

/// The same table at an offset of 10⁸ mm, with the positions of the recording.
#[test]
fn a_far_origin_is_moved_and_said() {
    let far: Vec<[f64; 5]> = (training().iter())
        .map(|[t, x, v, a, f]| [*t, (x * 1e3).round() / 1e3 + 1e8, *v, *a, *f])
        .collect();
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str, text: &str| {
        let path = dir.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let other: Vec<[f64; 5]> = (rows(&[(1.5, 15.0)]).iter())
        .map(|[t, x, v, a, f]| [*t, x + 1e8, *v, *a, *f])
        .collect();
    let (one, two) = (
        path("t.csv", &text(NAMES, &far)),
        path("v.csv", &text(NAMES, &other)),
    );
    let out = dir.path().join("models");
    let output = Command::cargo_bin("study")
        .unwrap()
        .args(["identify", &one, "--validate", &two, "--dx", "1", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{err}");
    assert!(err.contains("identified at x - 100000018 mm"), "{err}");
    let model = fs::read_to_string(out.join("passive-dx-1.toml")).unwrap();
    assert!(model.contains("100000010.0"), "{model}");
    let vaf = |text: &str| -> f64 {
        let (_, rest) = text.split_once("[vaf]\nv = ").unwrap();
        rest.lines().next().unwrap().parse().unwrap()
    };
    assert!(vaf(&model) > 0.95, "{model}");
}

/// The document of `study identify` of motions with every row changed, and what it says.
fn identified(
    dir: &Path,
    change: impl Fn([f64; 5]) -> [f64; 5],
    more: &[&str],
) -> (serde_json::Value, String) {
    let path = |name: &str, rows: Vec<[f64; 5]>| {
        let changed: Vec<[f64; 5]> = rows.into_iter().map(&change).collect();
        let path = dir.join(name);
        fs::write(&path, text(NAMES, &changed)).unwrap();
        path
    };
    let output = Command::cargo_bin("study")
        .unwrap()
        .arg("identify")
        .arg(path("t.csv", training()))
        .arg("--validate")
        .arg(path("v.csv", rows(&[(1.5, 15.0)])))
        .arg("--json")
        .args(more)
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{err}");
    (serde_json::from_slice(&output.stdout).unwrap(), err)
}

/// The paper's table of a force with an offset of 10⁸ N has the VAF of the force without it.
#[test]
fn a_far_force_is_moved_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let models = dir.path().join("models");
    let out = models.to_str().unwrap();
    let more = ["--lambda", "0.98", "--dx", "1", "--force", "--out", out];
    let identified = |offset_n: f64| {
        let moved = |[t, x, v, a, f]: [f64; 5]| [t, x, v, a, f + offset_n];
        let (document, err) = identified(dir.path(), moved, &more);
        (document["cells"][0]["vaf"]["v"].as_f64().unwrap(), err)
    };
    let (here, _) = identified(0.0);
    let (far, err) = identified(1e8);
    assert!((here - far).abs() < 1e-6, "{here} {far}");
    assert!(err.contains("identified at F - 100000000 N"), "{err}");
    let model = fs::read_to_string(models.join("lambda-0.98-dx-1.toml")).unwrap();
    let (_, forces) = model.split_once("f0_n = [").unwrap();
    let first: f64 = forces.split(',').next().unwrap().trim().parse().unwrap();
    assert!((first - 1e8).abs() < 1e4, "{first}");
}

/// Lengths that are looked for are in proportion to the travel: a button and a joint have the
/// table of the switch.
#[test]
fn a_travel_of_a_tenth_of_a_millimeter_or_of_meters_gives_the_same_table() {
    let vaf = |times: f64| {
        let dir = tempfile::tempdir().unwrap();
        let larger = |[t, x, v, a, f]: [f64; 5]| [t, times * x, times * v, times * a, f];
        let (document, _) = identified(dir.path(), larger, &["--method", "passive"]);
        let cells = document["cells"].as_array().unwrap();
        let dx: Vec<f64> = (cells.iter())
            .map(|cell| cell["dx_mm"].as_f64().unwrap() / times)
            .collect();
        (dx, cells[0]["vaf"]["v"].as_f64().unwrap())
    };
    let (dx, here) = vaf(1.0);
    assert_eq!(dx, [0.5, 1.0]);
    for times in [0.01, 100.0] {
        let (dx, there) = vaf(times);
        assert_eq!(dx, [0.5, 1.0]);
        assert!((here - there).abs() < 1e-3, "{times}: {here} {there}");
    }
}

/// Decimal commas in a file with commas, whole numbers among them.
#[test]
fn decimal_commas_between_commas_are_refused_with_what_to_do() {
    let commas = "t_s,x_mm,f_n\n0,0,5,1\n0,1,1,5,1,2\n";
    refused(commas, "line 2: 4 fields, but there are 3 columns");
    refused(commas, "decimal commas need semicolons or tabs");
}

/// A knob in degrees and N·m, in a file with semicolons and decimal commas, has the VAF of
/// the same recording in mm and N.
#[test]
fn a_knob_with_semicolons_and_decimal_commas_is_read_at_its_lever() {
    let lever = 25.0;
    let mut text = String::from("time;pos;torque\n");
    let mut plain = String::from("t_s,x_mm,f_n\n");
    for [t, x, _, _, f] in training() {
        let (deg, n_m) = ((x / lever).to_degrees(), 1e-3 * f * lever);
        let _ = writeln!(
            text,
            "{}",
            format!("{t};{deg:.9};{n_m:.9}").replace('.', ",")
        );
        let _ = writeln!(plain, "{t},{x:.9},{f:.9}");
    }
    let dir = tempfile::tempdir().unwrap();
    let vaf = |name: &str, training: &str, more: &[&str]| {
        let path = dir.path().join(name);
        fs::write(&path, training).unwrap();
        let half: String = (training.lines().enumerate())
            .filter(|(i, _)| *i == 0 || *i > 900)
            .map(|(_, line)| format!("{line}\n"))
            .collect();
        let other = dir.path().join("v.csv");
        fs::write(&other, half).unwrap();
        let output = Command::cargo_bin("study")
            .unwrap()
            .arg("identify")
            .args([&path, &PathBuf::from("--validate"), &other])
            .args(["--dx", "1", "--json"])
            .args(more)
            .output()
            .unwrap();
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        let document: Option<serde_json::Value> = serde_json::from_slice(&output.stdout).ok();
        let vaf = document.and_then(|d| d["cells"][0]["vaf"]["v"].as_f64());
        (vaf, err)
    };
    let columns = "t=time,x=pos:deg,f=torque:N·m";
    let (of_knob, said) = vaf("k.csv", &text, &["--columns", columns, "--lever", "25"]);
    assert!(
        said.contains("columns are separated by semicolons"),
        "{said}"
    );
    let (of_slider, _) = vaf("s.csv", &plain, &[]);
    assert!(
        (of_knob.unwrap() - of_slider.unwrap()).abs() < 1e-4,
        "{of_knob:?} {of_slider:?}"
    );
    let (none, said) = vaf("k.csv", &text, &[]);
    assert!(
        none.is_none() && said.contains("--columns t=NAME"),
        "{said}"
    );
    // the model file is in the units of the recording
    let out = dir.path().join("m");
    let arguments = ["--columns", columns, "--lever", "25", "--out"];
    let arguments = [&arguments[..], &[out.to_str().unwrap()]].concat();
    vaf("k.csv", &text, &arguments);
    let file = fs::read_to_string(out.join("passive-dx-1.toml")).unwrap();
    assert!(
        file.contains("units = { x = \"deg\", f = \"N·m\" }"),
        "{file}"
    );
    let (none, said) = vaf("k.csv", &text, &["--columns", columns]);
    assert!(none.is_none() && said.contains("--lever MM"), "{said}");
    // the table and the figures are in these units as well
    let figures = dir.path().join("figures");
    let output = Command::cargo_bin("study")
        .unwrap()
        .arg("identify")
        .args([&dir.path().join("k.csv"), &PathBuf::from("--validate")])
        .arg(dir.path().join("v.csv"))
        .args([
            "--columns",
            columns,
            "--lever",
            "25",
            "--dx",
            "1,2",
            "--delta",
            "0.5,1",
        ])
        .args([&PathBuf::from("--figures"), &figures])
        .output()
        .unwrap();
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for said in [
        "angles in deg",
        "dx deg",
        "delta deg",
        "bias N·m",
        "2.29183",
    ] {
        assert!(table.contains(said), "no {said}: {table}");
    }
    let four = fs::read_to_string(figures.join("fig4-vaf.csv")).unwrap();
    assert!(four.starts_with("delta_deg,dx_deg,vaf\n"), "{four}");
    assert_eq!(four.lines().count(), 5, "{four}");
    let six = fs::read_to_string(figures.join("fig6-force.csv")).unwrap();
    assert!(six.starts_with("t_s,measured_nm,predicted_nm\n"), "{six}");
}

#[test]
fn gaps_give_a_warning_and_cannot_be_filtered() {
    let mut rows = training();
    rows.drain(300..420);
    let gappy = text(NAMES, &rows);
    warned(&gappy, "1 gap in time, the longest 0.2420 s");
    let (code, out, err) = identify(&gappy, &["--filter", "30"]);
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
    assert!(err.contains("gap"), "{err}");
}

#[test]
fn a_value_that_is_not_finite_is_refused_with_its_line() {
    for (value, said) in [
        (
            f64::NAN,
            "line 12: f_n is NaN, which cannot be a measurement",
        ),
        (f64::INFINITY, "line 12: f_n is inf"),
    ] {
        let mut rows = training();
        rows[10][4] = value;
        refused(&text(NAMES, &rows), said);
    }
    let words = text(NAMES, &training()).replacen(",", ",a\u{1b}[31m", 6);
    let (code, _, err) = identify(&words, &[]);
    assert_eq!(code, 1, "{err}");
    assert!(!err.contains('\u{1b}'), "{err}");
}

#[test]
fn a_constant_column_is_refused_or_gives_a_warning() {
    let constant = |column: usize| {
        let mut rows = training();
        for row in &mut rows {
            row[column] = 3.0;
        }
        text(NAMES, &rows)
    };
    refused(
        &constant(1),
        "x_mm is the same in every row: nothing was measured",
    );
    refused(
        &constant(4),
        "f_n is the same in every row: nothing was measured",
    );
    refused(&constant(0), "time has to increase");
    warned(&constant(3), "a_m_s2 is the same in every row");
    // a constant velocity is a motion in one direction
    refused(&constant(2), "one direction");
}

#[test]
fn one_direction_is_refused() {
    let mut rows = training();
    rows.retain(|row| row[2] > 0.0);
    refused(&text(NAMES, &rows), "direction");
}

#[test]
fn metres_are_refused_and_a_wrong_unit_of_velocity_gives_a_warning() {
    let scaled = |column: usize, factor: f64| {
        let mut rows = training();
        for row in &mut rows {
            row[column] *= factor;
        }
        text(NAMES, &rows)
    };
    refused(&scaled(1, 1e-3), "x_mm seems to be in meters");
    warned(&scaled(2, 1e-3), "times v_mm_s: check its unit and sign");
    warned(&scaled(3, 1e3), "times a_m_s2: check its unit and sign");
    warned(&scaled(2, -1.0), "check its unit and sign");
}

#[test]
fn swapped_columns_are_refused_or_give_a_warning() {
    for (names, column) in [
        ("t_s,x_mm,a_m_s2,v_mm_s,f_n", "v_mm_s"),
        ("t_s,f_n,v_mm_s,a_m_s2,x_mm", "v_mm_s"),
        ("t_s,v_mm_s,x_mm,a_m_s2,f_n", "v_mm_s"),
        ("t_s,x_mm,v_mm_s,f_n,a_m_s2", "a_m_s2"),
    ] {
        let (code, _, err) = identify(&text(names, &training()), &[]);
        let said = format!("times {column}: check its unit");
        assert!(err.contains(&said) || code == 1, "{names}: {err}");
    }
    refused(
        &text("x_mm,t_s,v_mm_s,a_m_s2,f_n", &training()),
        "time has to increase",
    );
}

/// Without v and a only the courses of position and force tell; checked on every recording
/// of the repository.
#[test]
fn swapped_position_and_force_give_a_warning_and_correct_recordings_do_not() {
    for name in [
        "recordings/training_a.csv",
        "recordings/validation_a.csv",
        "plant/switch_a_1.5hz.csv",
    ] {
        let file = fs::File::open(format!("tests/data/{name}")).unwrap();
        let whole = recording::read(name, std::io::BufReader::new(file)).unwrap();
        let warnings = |x_mm: &[f64], f_n: &[f64]| {
            let mut bytes = Vec::from("t_s,x_mm,f_n\n");
            for ((t, x), f) in whole.t_s.iter().zip(x_mm).zip(f_n) {
                bytes.extend(format!("{t},{x},{f}\n").bytes());
            }
            let read = recording::read(name, &bytes[..]).unwrap();
            let said = read.warnings.iter().map(ToString::to_string);
            said.filter(|w| w.contains("seem to be swapped")).count()
        };
        assert_eq!(warnings(&whole.x_mm, &whole.f_n), 0, "{name}");
        assert_eq!(warnings(&whole.f_n, &whole.x_mm), 1, "{name}");
    }
    let rows: Vec<[f64; 5]> = training();
    let names = "t_s,x_mm,ignored,unused,f_n";
    let swapped = "t_s,f_n,ignored,unused,x_mm";
    let (_, _, err) = identify(&text(names, &rows), &[]);
    assert!(!err.contains("seem to be swapped"), "{err}");
    warned(
        &text(swapped, &rows),
        "x_mm and f_n seem to be swapped: f_n is ",
    );
}

#[test]
fn one_row_or_none_is_refused() {
    let all = text(NAMES, &training());
    let lines = |n: usize| all.lines().take(n).collect::<Vec<_>>().join("\n");
    refused(&lines(2), "1 rows: a recording has at least 3");
    refused(&lines(1), "0 rows: a recording has at least 3");
    refused("", "the file ends before a line of column names");
    // three rows are a valid recording, but not a stroke
    let (code, out, err) = identify(&lines(4), &[]);
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
}

#[test]
fn factors_and_increments_out_of_range_are_refused() {
    let good = text(NAMES, &training());
    for (flag, value, exit, said) in [
        (
            "--lambda",
            "0",
            2,
            "a forgetting factor is above 0 and at most 1",
        ),
        (
            "--lambda",
            "-0.5",
            2,
            "a forgetting factor is above 0 and at most 1",
        ),
        (
            "--lambda",
            "1.0001",
            2,
            "a forgetting factor is above 0 and at most 1",
        ),
        ("--dx", "-1", 2, "an increment is a length above 0 mm"),
        ("--dx", "40", 1, "dx = 40 mm leaves"),
        ("--dx", "0.0001", 1, "dx = 0.0001 mm"),
    ] {
        for method in ["ewls", "constrained"] {
            let given = format!("{flag}={value}");
            let (code, out, err) = identify(&good, &[&given, "--method", method]);
            assert_eq!((code, out.as_str()), (exit, ""), "{given}: {err}");
            assert!(err.contains(said), "{given}: {err}");
        }
    }
    // the extremes of λ
    for lambda in ["1e-9", "1"] {
        let (code, out, err) = identify(&good, &["--lambda", lambda]);
        assert!(code == 0 && out.contains("VAF") || code == 1, "{err}");
    }
}
