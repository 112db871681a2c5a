//! Recordings with a fault: read right, or named.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use study_base::rng::Stream;
use study_haptics::identify::evidence::lag;
use study_haptics::identify::signal;
use study_haptics::recording::{self, Recording};

/// Samples a second.
const RATE_HZ: f64 = 1000.0;
/// Noise of the force, N.
const NOISE_N: f64 = 0.02;

/// t, x and F of 20 s on a switch with detents, friction, mass and damping.
fn rows(seed: u64) -> Vec<[f64; 3]> {
    let mut stream = Stream::new(seed, &["doubtful"]);
    let (mut z, mut last) = (1.0, f64::NAN);
    (0..20_000)
        .map(|i| {
            let t = f64::from(i) / RATE_HZ;
            let (mut x, mut v, mut a) = (17.5, 0.0, 0.0);
            for (hz, mm) in [(0.5, 12.0), (2.37, 3.0)] {
                let w = hz * TAU;
                x += mm * (w * t).sin();
                v += mm * w * (w * t).cos();
                a -= mm * w * w * (w * t).sin() / 1000.0;
            }
            let counted: f64 = (x / 0.005_f64).round() * 0.005;
            if last.is_finite() && counted != last {
                let sign = (counted - last).signum();
                z = sign + (z - sign) * (-(counted - last).abs() / 0.4).exp();
            }
            last = counted;
            let f = 0.1 * a + 0.002 * v + 4.0 * (x / 2.0).sin() + 0.8 * z;
            [t, counted, f + NOISE_N * stream.normal()]
        })
        .collect()
}

fn text(rows: &[[f64; 3]]) -> String {
    let mut text = String::from("t_s,x_mm,f_n\n");
    for [t, x, f] in rows {
        writeln!(text, "{t},{x},{f}").unwrap();
    }
    text
}

fn read(rows: &[[f64; 3]]) -> Recording {
    recording::read("r", text(rows).as_bytes()).unwrap()
}

/// The warnings beside those about derived columns.
fn warnings(rows: &[[f64; 3]]) -> Vec<String> {
    let all = read(rows).warnings;
    (all.iter().map(ToString::to_string))
        .filter(|warning| !warning.starts_with("no column"))
        .collect()
}

fn lag_ms(rows: &[[f64; 3]]) -> Option<f64> {
    lag::of(&read(rows)).map(|lag| 1e3 * lag.lag_s)
}

/// Output and errors of `study identify`, with its exit code.
fn identify(rows: &[[f64; 3]], more: &[&str]) -> (i32, String, String) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("training.csv");
    std::fs::write(&path, text(rows)).unwrap();
    let output = Command::cargo_bin("study")
        .unwrap()
        .arg("identify")
        .arg(path)
        .args(more)
        .output()
        .unwrap();
    let words = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        words(&output.stdout),
        words(&output.stderr),
    )
}

#[test]
fn a_sound_recording_gives_rise_to_no_doubt() {
    for seed in 1..4 {
        let rows = rows(seed);
        assert_eq!(warnings(&rows), [""; 0], "{seed}");
        assert_eq!(lag_ms(&rows), None, "{seed}");
    }
}

/// Force that is 5 to 20 ms late, or early.
#[test]
fn a_lag_of_the_force_is_estimated() {
    for ms in [5_usize, 10, 20] {
        let sound = rows(ms as u64);
        let late: Vec<[f64; 3]> = (ms..sound.len())
            .map(|i| [sound[i][0], sound[i][1], sound[i - ms][2]])
            .collect();
        let found = lag_ms(&late).unwrap();
        assert!((found - ms as f64).abs() < 1.0, "{ms} {found}");
        let early: Vec<[f64; 3]> = (0..sound.len() - ms)
            .map(|i| [sound[i][0], sound[i][1], sound[i + ms][2]])
            .collect();
        let found = lag_ms(&early).unwrap();
        assert!((found + ms as f64).abs() < 1.0, "-{ms} {found}");
        let (code, _, err) = identify(&late, &["--method", "static", "--dx", "0.5"]);
        assert_eq!(code, 0, "{err}");
        assert!(err.contains("ms later than the position"), "{err}");
    }
}

#[test]
fn a_drift_of_the_force_is_measured() {
    let mut drifting = rows(1);
    for [t, _, f] in &mut drifting {
        *f += 3.0 * *t / 20.0;
    }
    let found = warnings(&drifting);
    assert_eq!(found.len(), 1, "{found:?}");
    let by_n: f64 = (found[0].split("changes by ").nth(1).unwrap())
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!((by_n - 3.0).abs() < 0.15, "{by_n}");
}

#[test]
fn saturation_is_named_although_noise_lies_on_it() {
    let mut stream = Stream::new(4, &["doubtful"]);
    let mut clipped = rows(1);
    for [.., f] in &mut clipped {
        *f = f.min(3.0) + NOISE_N * stream.normal();
    }
    let found = warnings(&clipped);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("saturated sensor with noise"),
        "{found:?}"
    );
}

/// At 20 mm of every press the force breaks down within two samples.
fn snapping() -> Vec<[f64; 3]> {
    let mut rows = rows(1);
    for i in 1..rows.len() - 1 {
        if rows[i - 1][1] < 20.0 && rows[i][1] >= 20.0 {
            rows[i][2] -= 6.0;
            rows[i + 1][2] += 3.0;
        }
    }
    rows
}

#[test]
fn a_snap_is_no_spike_and_is_not_replaced() {
    let rows = snapping();
    let found = warnings(&rows);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("the target's own snap"), "{found:?}");
    let mut robust = read(&rows);
    assert_eq!(robust.without_spikes(), 0);
    assert_eq!(robust.f_n, read(&rows).f_n);
    // a spike beside the snaps is one, and the only one
    let mut spiked = rows;
    spiked[4321][2] = 80.0;
    let found = warnings(&spiked);
    assert!(
        found
            .iter()
            .any(|w| w.starts_with("1 spike in f_n, the largest 80")),
        "{found:?}"
    );
    assert_eq!(read(&spiked).without_spikes(), 1);
}

#[test]
fn a_position_that_is_counted_backwards_is_refused_with_a_hint_to_signs() {
    for mut rows in [rows(1), snapping()] {
        rows[4321][2] = 80.0;
        for [_, x, _] in &mut rows {
            *x = 35.0 - *x;
        }
        let (code, _, err) = identify(&rows, &["--method", "static"]);
        assert_eq!(code, 1, "{err}");
        assert!(err.contains("supplies energy"), "{err}");
        assert!(err.contains("the sign of F, or that of x"), "{err}");
        assert!(!err.contains("may be the cause"), "{err}");
    }
}

/// Two in a hundred are missing, one here and two there.
#[test]
fn lost_samples_are_interpolated_where_a_filter_needs_them() {
    let mut stream = Stream::new(5, &["doubtful"]);
    let whole = rows(1);
    let ends = [0, whole.len() - 1];
    let kept: Vec<[f64; 3]> = (whole.iter().enumerate())
        .filter(|(i, _)| stream.below(50) > 0 || ends.contains(i))
        .map(|(_, row)| *row)
        .collect();
    let recording = read(&kept);
    assert!(
        recording
            .warnings
            .iter()
            .any(|w| w.to_string().contains("gaps in time"))
    );
    let (even, how) = signal::evened(&recording).unwrap();
    assert_eq!(how.lost, whole.len() - kept.len());
    assert!((350..450).contains(&how.lost), "{how:?}");
    for (i, [_, x, _]) in whole.iter().enumerate() {
        assert!((even.x_mm[i] - x).abs() < 0.02, "{i}");
    }
    let arguments = ["--method", "static", "--dx", "0.5", "--filter", "30"];
    let (code, _, err) = identify(&kept, &arguments);
    assert_eq!(code, 0, "{err}");
    assert!(
        err.contains("samples are missing, at most 5 in a row: resampled"),
        "{err}"
    );
}

#[test]
fn a_row_that_is_there_twice_is_left_out_and_named() {
    let once = rows(1);
    let mut twice = once.clone();
    twice.insert(100, once[99]);
    let found = warnings(&twice);
    assert_eq!(
        found,
        ["1 row repeats the one before it and is left out, the first at line 102"]
    );
    assert_eq!(read(&twice).t_s, read(&once).t_s);
    // the same time with another force is no repetition
    twice[100][2] += 1.0;
    let refused = recording::read("r", text(&twice).as_bytes()).unwrap_err();
    assert!(
        refused.to_string().contains("time has to increase"),
        "{refused}"
    );
}

/// A slow motion with an accelerometer, whose noise says nothing of its unit; a wrong unit of one that
/// shows the motion is still named.
#[test]
fn the_unit_of_an_acceleration_is_doubted_only_where_the_motion_shows_it() {
    let recording = |hz: f64, factor: f64| {
        let mut stream = Stream::new(6, &["doubtful"]);
        let mut text = String::from("t_s,x_mm,a_m_s2,f_n\n");
        for i in 0..20_000 {
            let (t, w) = (f64::from(i) / RATE_HZ, hz * TAU);
            let x = ((10.0 * (w * t).sin()) / 0.005_f64).round() * 0.005;
            let a = factor * (-0.01 * w * w * (w * t).sin() + 0.05 * stream.normal());
            writeln!(text, "{t},{x},{a},{}", 0.1 * x + (w * t).cos().signum()).unwrap();
        }
        let recording = recording::read("r", text.as_bytes()).unwrap();
        let unit = |w: &&recording::Warning| w.to_string().contains("check its unit");
        recording.warnings.iter().filter(unit).count()
    };
    assert_eq!(recording(0.05, 1.0), 0);
    assert_eq!(recording(0.05, 9.81), 0);
    assert_eq!(recording(2.0, 1.0), 0);
    for factor in [1e3, -1.0, 1.0 / 9.81] {
        assert_eq!(recording(2.0, factor), 1, "{factor}");
    }
}
