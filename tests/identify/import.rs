//! `study import force-curve`: from the files of a force tester to recordings.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use study_haptics::recording::{self, Recording};

const CLICKIEZ: &str = "tests/data/switches/Clickiez_75g_Tactile.csv";

fn study(args: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("study").unwrap().args(args).assert()
}

/// Imports one file, and reads the recording.
fn imported(file: &Path, out: &Path, more: &[&str]) -> Recording {
    let (file, to) = (file.to_str().unwrap(), out.to_str().unwrap());
    let mut args = vec!["import", "force-curve", file, "-o", to, "--force"];
    args.extend(more);
    study(&args).success();
    recording::read("imported", fs::read(out).unwrap().as_slice()).unwrap()
}

/// The three layouts of one measured curve: tidy, table, high resolution.
fn layouts(tidy: &str, dir: &Path) -> [PathBuf; 3] {
    let text = fs::read_to_string(tidy).unwrap();
    let rows: Vec<Vec<&str>> = (text.lines().skip(1))
        .map(|row| row.split(',').collect())
        .collect();
    let mut table = String::from(
        "Maximum,192.1,@,No.9,,,,,,\nNo.,Force,Unit,Displacement,Unit,Judge,Position,Time,Date,\n",
    );
    let mut fine = format!(
        "MAX FORCE = 192.4,4.275\nUNIT = gf,mm\nDATA COUNT = {},\nRECORDING RATE = 0.1,\n",
        rows.len()
    );
    for (i, row) in rows.iter().enumerate() {
        let (force, x, s) = (row[0], row[1], i / 10);
        let _ = writeln!(
            table,
            "{},{force},gf,{x},mm,OK,--,1:{:02}:{:02} PM,7/3/2025,",
            i + 1,
            s / 60,
            s % 60
        );
        let _ = writeln!(fine, "{force},{x}");
    }
    let paths = ["tidy.csv", "table.csv", "fine.csv"].map(|name| dir.join(name));
    for (path, text) in paths.iter().zip([&text, &table, &fine]) {
        fs::write(path, text).unwrap();
    }
    paths
}

#[test]
fn the_three_layouts_of_a_curve_are_the_same_recording() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("recording.csv");
    let [tidy, table, fine] = layouts(CLICKIEZ, dir.path()).map(|file| imported(&file, &out, &[]));
    assert_eq!(tidy.len(), 3124);
    for other in [&table, &fine] {
        assert_eq!(
            (&other.t_s, &other.x_mm, &other.f_n),
            (&tidy.t_s, &tidy.x_mm, &tidy.f_n)
        );
        assert_eq!(other.quasi_static(), None);
    }
    assert!(tidy.quasi_static().is_some());
    assert_eq!(tidy.header_line("target:"), Some("Clickiez 75g Tactile"));
    // 0.1 gf and 5 µm
    assert_eq!(
        tidy.header_line("resolution:"),
        Some("x 5.000e-3 mm, F 9.807e-4 N")
    );
    // the name of the file does not matter, unless it is asked for
    let [renamed, again] = ["Akko (1).csv", "again.csv"].map(|name| dir.path().join(name));
    fs::copy(dir.path().join("tidy.csv"), &renamed).unwrap();
    let other = imported(&renamed, &again, &[]);
    assert_eq!(other.sha256, tidy.sha256);
    let named = imported(&renamed, &again, &["--file-names"]);
    let source = named.header_line("source:").unwrap();
    assert!(source.starts_with("Akko (1).csv, sha256 "), "{source}");
    // twice as many rows a second are half the time
    let file = dir.path().join("tidy.csv");
    let fast = imported(&file, &out, &["--rate", "20", "--target", "Mine"]);
    assert!((fast.duration_s() - 0.5 * tidy.duration_s()).abs() < 1e-6);
    assert_eq!(fast.header_line("target:"), Some("Mine"));
}

#[test]
fn what_is_no_curve_is_refused_with_file_and_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (bad, out) = (path("bad.csv"), path("out.csv"));
    fs::write(&bad, "force,displacement\n0,0\n1,x\n").unwrap();
    study(&["import", "force-curve", &bad, "-o", &out])
        .code(1)
        .stderr(contains(
            "bad.csv: line 3: displacement is `x`, which is not a number",
        ));
    // a measured curve, of which the copy ended within a row
    let whole = fs::read_to_string(CLICKIEZ).unwrap();
    let row = whole.lines().nth(2000).unwrap();
    let at = whole.find(&format!("\n{row}")).unwrap() + 1;
    let cut = row.match_indices(',').nth(1).unwrap().0;
    fs::write(&bad, &whole[..at + cut - 1]).unwrap();
    study(&["import", "force-curve", &bad, "-o", &out])
        .code(1)
        .stderr(
            contains("2 of 4 fields: the file ends within this row")
                .and(contains("bad.csv: line ")),
        );
    assert!(!Path::new(&out).exists());
    study(&["import", "force-curve", CLICKIEZ, CLICKIEZ, "-o", &out])
        .code(1)
        .stderr(contains("are the same measurement"));
    study(&["import", "force-curve", CLICKIEZ, "-o", &out]).success();
    study(&["import", "force-curve", CLICKIEZ, "-o", &out])
        .code(1)
        .stderr(contains("already exists"));
    // and who gives the curve itself to `study identify` is told of this command
    study(&["identify", CLICKIEZ])
        .code(1)
        .stderr(contains("hint: it is a force curve").and(contains("study import force-curve")));
    study(&["identify", &bad])
        .code(1)
        .stderr(contains("--columns").and(contains("import").not()));
    let slow = path("slow.csv");
    let rows: String = (0..1900)
        .map(|i| {
            let at = 1000 - (i - 1000i32).abs();
            // five more while it is pressed
            format!("{i},{},{at}\n", at + if i < 1000 { 5 } else { 0 })
        })
        .collect();
    fs::write(&slow, format!("time,force,displacement\n{rows}")).unwrap();
    study(&["import", "force-curve", &slow, "-o", &path("slow-r.csv")])
        .success()
        .stderr(contains(
            "the curve took 0.5 h; if that is in ms, call it time_ms",
        ));
    // a measurement is not replaced by its recording, and a folder or a device not at all
    let own = path("own.csv");
    fs::copy(CLICKIEZ, &own).unwrap();
    let again = dir.path().join("./own.csv").display().to_string();
    study(&["import", "force-curve", &own, "-o", &again, "--force"])
        .code(1)
        .stderr(contains("is one of the measurements, which would be lost"));
    assert_eq!(fs::read(&own).unwrap(), fs::read(CLICKIEZ).unwrap());
    let folder = dir.path().to_str().unwrap();
    study(&["import", "force-curve", CLICKIEZ, "-o", folder, "--force"])
        .code(1)
        .stderr(contains("is no regular file"));
}

/// The range is told, and nothing is read or written.
#[test]
fn a_rate_that_no_instrument_has_is_refused_with_the_range() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out.csv");
    let to = out.to_str().unwrap();
    let of_curves = "a rate is a number from 0.001 to 1000000 Hz";
    let of_probes = "a sampling rate is from 10 to 40000 Hz";
    for (command, range) in [
        (
            &["import", "force-curve", CLICKIEZ, "-o", to][..],
            of_curves,
        ),
        (&["record", "missing.toml", "--out", to], of_probes),
        (&["trajectory", "missing.toml", "--out", to], of_probes),
    ] {
        for rate in ["1e300", "1e-300", "0", "-5", "-1e300", "nan", "inf", "-inf"] {
            let rate = format!("--rate={rate}");
            let told = study(&[command, &[rate.as_str()]].concat()).code(2);
            let told = String::from_utf8(told.get_output().stderr.clone()).unwrap();
            assert!(told.contains(range), "{rate}: {told}");
            assert_eq!(told.matches("error: ").count(), 1, "{rate}: {told}");
        }
        study(&[command, &["--rate", "-5"]].concat())
            .code(2)
            .stderr(contains(range));
    }
    assert!(!out.exists());
}

/// Measured curves with their rows and columns in other orders: the release first is the same recording, and the rest is refused with its cause.
#[test]
fn rows_and_columns_in_another_order_are_read_right_or_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (changed, recording) = (path("changed.csv"), path("r.csv"));
    let import = |rows: &[&str], names: &str, more: &[&str]| {
        fs::write(&changed, format!("{names}\n{}\n", rows.join("\n"))).unwrap();
        let args = [
            "import",
            "force-curve",
            &changed,
            "-o",
            &recording,
            "--force",
        ];
        study(&[&args[..], more].concat())
    };
    let values = || recording::read("r", fs::read(&recording).unwrap().as_slice()).unwrap();
    for entry in fs::read_dir("tests/data/switches").unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|of| of != "csv") {
            continue;
        }
        let usual = imported(&file, Path::new(&recording), &[]);
        let text = fs::read_to_string(&file).unwrap();
        let (names, rows) = text.split_once('\n').unwrap();
        let mut rows: Vec<&str> = rows.lines().collect();
        let swapped = names.replace("force", "x").replace("displacement", "force");
        import(&rows, &swapped.replace('x', "displacement"), &[])
            .code(1)
            .stderr(contains(
                "changed.csv: line 1: the columns force and displacement are swapped",
            ));
        // the row of most displacement is the last one of the press
        let top = (0..usual.len()).fold(0, |top, i| match usual.x_mm[i] > usual.x_mm[top] {
            true => i,
            false => top,
        });
        rows.rotate_left(top + 1);
        import(&rows, names, &[]).success().stderr(contains(
            "the file begins at the bottom; its press was put before its release",
        ));
        // it may come to rest below where it began
        let [mut a, mut b] = [usual.clone(), values()].map(|r| r.f_n);
        a.sort_by(f64::total_cmp);
        b.sort_by(f64::total_cmp);
        assert_eq!(a, b, "{}", file.display());
        rows.rotate_right(top + 1);
        rows.reverse();
        import(&rows, names, &[]).code(1).stderr(contains(
            "changed.csv: line 2: the rows from here on are in the reverse order of time",
        ));
    }
    // who says that the target has a drive is believed, until it is to be identified
    let text = fs::read_to_string(CLICKIEZ).unwrap();
    let (names, rows) = text.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().rev().collect();
    import(&rows, names, &["--active"]).success();
    let identify = [
        "identify", &recording, "--method", "passive", "--dx", "0.05",
    ];
    study(&identify)
        .failure()
        .stderr(contains("the target supplies energy"));
}

/// A curve and the same with a tenth more force: two loops that differ by a tenth of the force.
#[test]
fn repeated_curves_say_how_much_a_model_can_know() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (stronger, recording, figures) = (path("b.csv"), path("r.csv"), path("figures"));
    let mut text = String::from("force,displacement\n");
    for row in fs::read_to_string(CLICKIEZ).unwrap().lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let _ = writeln!(
            text,
            "{},{}",
            1.1 * cells[0].parse::<f64>().unwrap(),
            cells[1]
        );
    }
    fs::write(&stronger, text).unwrap();
    study(&[
        "import",
        "force-curve",
        CLICKIEZ,
        &stronger,
        "-o",
        &recording,
    ])
    .success();
    let one = [
        "identify", &recording, "--method", "passive", "--dx", "0.05",
    ];
    let with = |more: &[&str]| study(&[&one[..], more].concat()).success();
    let said = with(&["--figures", &figures]);
    let said = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    assert!(said.contains("2 loops differ by 0.0"), "{said}");
    assert!(said.contains("no VAF: there is no --validate"), "{said}");
    let json = with(&["--json"]);
    let json: serde_json::Value = serde_json::from_slice(&json.get_output().stdout).unwrap();
    let found = &json["force_curve"];
    assert_eq!(found["loops"], 2);
    let number = |key: &str| found[key].as_f64().unwrap();
    // the mean force is 1.05 times the first one, from which both differ by a tenth of it
    let csv = fs::read_to_string(format!("{figures}/force-displacement.csv")).unwrap();
    assert!(csv.starts_with(
        "x_mm,press_n,release_n,played_press_n,played_release_n,press_difference_n,release_difference_n\n"
    ));
    for row in csv.lines().skip(10).take(80) {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!((cells[5] - 0.1 / 1.05 * cells[1]).abs() < 1e-4, "{row}");
        // a table between both: its error is at most half of their difference, and a little
        assert!((cells[3] - cells[1]).abs() < 0.03, "{row}");
    }
    assert!(number("ceiling_vaf") > 0.9 && number("ceiling_vaf") < 0.99);
    assert!(number("played_difference_n") < 0.5 * number("repetition_difference_n"));
    study(&["identify", &recording, "--method", "passive"])
        .code(2)
        .stderr(contains("several realizations need --validate"));
}

/// The eight realizations of `protocols/keyboard` from the measured curves, byte for byte.
#[test]
fn the_keyboard_switches_are_reproduced() {
    let dir = tempfile::tempdir().unwrap();
    Command::new("sh")
        .arg("protocols/keyboard/identify.sh")
        .env("STUDY", assert_cmd::cargo::cargo_bin!("study"))
        .env("MODELS", dir.path())
        .assert()
        .success();
    let mut switches = 0;
    for entry in fs::read_dir("protocols/keyboard/models").unwrap() {
        let shipped = entry.unwrap().path();
        let made = dir.path().join(shipped.file_name().unwrap());
        let same = fs::read(&shipped).unwrap() == fs::read(made).unwrap();
        assert!(same, "{}", shipped.display());
        switches += 1;
    }
    assert_eq!(switches, 8);
}

/// Three loops of 1 mm at three speeds with a measured time, of which each is .05 N wider than the one before.
#[test]
fn loops_of_several_speeds_say_whether_the_force_depends_on_it() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("speeds.csv");
    let mut text = String::from("# measured force curve: a test\nt_s,x_mm,f_n\n");
    let mut t = 0.0;
    for decade in 0..3 {
        for i in (0..200).chain((0..200).rev().map(|i| i + 1000)) {
            let (x, press) = (f64::from(i % 1000) / 199.0, i < 1000);
            let width = if press {
                0.2 + 0.05 * f64::from(decade)
            } else {
                0.0
            };
            let _ = writeln!(text, "{t},{x},{}", x + width);
            t += 0.05 / 10_f64.powi(decade);
        }
    }
    fs::write(&path, text).unwrap();
    let identify = [
        "identify",
        path.to_str().unwrap(),
        "--method",
        "passive",
        "--dx",
        "0.1",
    ];
    let with = |more: &[&str]| {
        let output = study(&[&identify[..], more].concat()).success();
        String::from_utf8_lossy(&output.get_output().stdout).into_owned()
    };
    let said = with(&[]);
    assert!(said.contains("the loop is wider by 0.0500 ± "), "{said}");
    assert!(said.contains("the force depends on the speed"), "{said}");
    let json: serde_json::Value = serde_json::from_str(&with(&["--json"])).unwrap();
    let rate = &json["force_curve"]["rate_dependence"];
    assert_eq!(rate["depends"], true);
    assert!(
        (rate["per_decade_n"].as_f64().unwrap() - 0.05).abs() < 1e-3,
        "{rate}"
    );
}
