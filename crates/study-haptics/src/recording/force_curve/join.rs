//! One recording of several force curves.

use super::ForceCurve;
use crate::recording::{Columns, acceleration, range, resolution, velocity, write};
use std::fmt::Write as _;
use study_base::sort::SmallSort as _;
use study_base::text::Untrusted;

/// Rows a second of a curve that has no time, unless another rate is given.
pub const USUAL_RATE_HZ: f64 = 10.0;
/// Curves of one target differ by less than this factor, unless it is a damper at other speeds.
const UNLIKE: f64 = 5.0;

/// A curve and where it comes from.
#[derive(Debug, Clone, Copy)]
pub struct Source<'c> {
    /// The curve.
    pub curve: &'c ForceCurve,
    /// Name of its file, without the folder, for messages.
    pub file: &'c str,
    /// SHA-256 hash of the file, hexadecimal.
    pub sha256: &'c str,
}

/// What a person says of the curves, for the header. Untrusted.
#[derive(Debug, Clone, Copy, Default)]
pub struct Stated<'c> {
    /// What was measured; otherwise what the first file says.
    pub target: Option<&'c str>,
    /// With what, and by whom.
    pub instrument: Option<&'c str>,
    /// Whom to credit.
    pub credit: Option<&'c str>,
    /// On which terms it may be used.
    pub license: Option<&'c str>,
    /// Rows a second of curves without a time.
    pub rate_hz: Option<f64>,
    /// Whether the names of the files stand in the header. Otherwise the recording is the same whatever they are called.
    pub file_names: bool,
}

/// Doubts that all curves are of one target in one unit: the force or the displacement of one varies by
/// many times that of another. Untrusted.
pub fn unlike(curves: &[Source<'_>]) -> Vec<String> {
    let quantities = [
        ("force", "N", "`force_gf` or `force_n`"),
        ("displacement", "mm", "`displacement_mm`"),
    ];
    let mut doubts = Vec::new();
    for (what, unit, names) in quantities {
        let spread = |source: &Source<'_>| {
            let ForceCurve { x_mm, f_n, .. } = source.curve;
            let [low, high] = range(if what == "force" { f_n } else { x_mm });
            high - low
        };
        let mut spreads: Vec<(f64, &str)> = (curves.iter())
            .map(|source| (spread(source), source.file))
            .collect();
        spreads.small_sort_by(|a, b| a.0.total_cmp(&b.0));
        if let [(small, one), .., (large, other)] = spreads[..]
            && large > UNLIKE * small
        {
            doubts.push(format!(
                "the {what} varies by {small:.4} {unit} in {one} and by {large:.4} {unit} in {other}: if both are of one target, their units differ, and the names of the columns have to say them, such as {names}"
            ));
        }
    }
    doubts
}

/// One recording of all curves, one after the other, as the bytes of its CSV file. Each line of the
/// header begins with what it says: `measured force curve` with the next ones in short, `target`, `instrument`, `source` (one for each curve, with
/// the SHA-256 of its file),
/// `quasi-static` where a time was made up, `resolution`, `credit`, `license`.
///
/// Velocity and acceleration are differences within a curve.
pub fn join(curves: &[Source<'_>], stated: Stated<'_>) -> Vec<u8> {
    let usual_hz = stated.rate_hz.unwrap_or(USUAL_RATE_HZ);
    let mut columns: [Vec<f64>; 5] = Default::default();
    let mut begin_s = 0.0;
    let mut sources = String::new();
    for source in curves {
        let curve = source.curve;
        let interval_s = 1.0 / curve.rate_hz.unwrap_or(usual_hz);
        let n = curve.x_mm.len();
        let t: Vec<f64> = (0..n).map(|i| begin_s + i as f64 * interval_s).collect();
        let x = &curve.x_mm;
        let v: Vec<f64> = (0..n).map(|i| velocity(&t, x, i)).collect();
        let a: Vec<f64> = (0..n).map(|i| acceleration(&t, x, i)).collect();
        let name = match stated.file_names {
            true => format!("{}, ", Untrusted(source.file)),
            false => String::new(),
        };
        let _ = writeln!(
            sources,
            "source: {name}sha256 {}; {}, {n} rows from {begin_s:.3} s{}",
            source.sha256,
            curve.layout.as_str(),
            match curve.release_first {
                true => ", the press put before the release",
                false => "",
            },
        );
        begin_s += n as f64 * interval_s;
        let parts = [&t, x, &v, &a, &curve.f_n];
        for (column, part) in columns.iter_mut().zip(parts) {
            column.extend_from_slice(part);
        }
    }
    let [t_s, x_mm, v_mm_s, a_m_s2, f_n] = &columns;
    let mut header = String::new();
    let mut line = |key: &str, text: Option<&str>| {
        if let Some(text) = text {
            let _ = writeln!(header, "{key}: {}", Untrusted(text));
        }
    };
    let named = curves.iter().find_map(|s| s.curve.target.as_deref());
    let target = stated.target.or(named);
    let whose = [
        target.or(Some("an unnamed target")),
        stated.instrument,
        stated.credit,
    ];
    let whose: Vec<&str> = whose.into_iter().flatten().collect();
    // model files keep this line as their note
    line("measured force curve", Some(&whose.join("; ")));
    line("target", target);
    line("instrument", stated.instrument);
    line("credit", stated.credit);
    line("license", stated.license);
    if curves.iter().any(|source| source.curve.rate_hz.is_none()) {
        let text = format!(
            "the file has no time; {usual_hz} rows a second are assumed, and bounds of mass and damping rest on that"
        );
        line("quasi-static", Some(&text));
    }
    let steps = [("x", x_mm, "mm"), ("F", f_n, "N")].map(|(name, values, unit)| {
        let step =
            resolution(values).map_or("unknown".to_owned(), |step| format!("{step:.3e} {unit}"));
        format!("{name} {step}")
    });
    line("resolution", Some(&steps.join(", ")));
    header.push_str(&sources);
    let columns = Columns {
        t_s,
        x_mm,
        v_mm_s: Some(v_mm_s),
        a_m_s2,
        f_n,
    };
    let mut bytes = Vec::with_capacity(64 * t_s.len());
    write(&mut bytes, &header, columns).expect("memory takes every write");
    bytes
}
