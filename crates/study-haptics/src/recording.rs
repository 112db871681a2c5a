//! Recordings of a probe: time, position, velocity, acceleration, force.
//!
//! A recording is a CSV file: `#` lines of text, one line of column names, then
//! numbers. `t_s`, `x_mm` and `f_n` are required; `v_mm_s` and `a_m_s2` are used as
//! given, and computed as differences of x with a warning if absent. Other columns are
//! ignored. Nothing is filtered or thinned. F is the force that the probe applies to
//! the target, positive with +x.
//!
//! Invariant of a [`Recording`] that was read: all columns are equally long, finite and
//! have at least three rows; time ascends strictly; x and F vary.

mod column;
mod differences;
mod doubts;
mod drift;
pub mod force_curve;
mod motion;
mod names;
mod rows;
mod saturation;
mod spikes;
mod swapped;
mod write;

pub(crate) use column::{mean_and_variance, range};
pub(crate) use differences::{acceleration, velocity};
pub use doubts::Energy;
pub use names::{NameError, Named, Names};
pub use write::{Columns, write};

use std::io::BufRead;

/// The largest deviation of an interval from the mean one, as a share of it, that is jitter and
/// no gap.
pub const JITTER: f64 = 0.75;

/// A recording as columns, with the SHA-256 hash of the bytes it was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Its name in model files and messages.
    pub name: String,
    /// Time, s, strictly ascending.
    pub t_s: Vec<f64>,
    /// Position, mm.
    pub x_mm: Vec<f64>,
    /// Velocity, mm/s.
    pub v_mm_s: Vec<f64>,
    /// Acceleration, m/s².
    pub a_m_s2: Vec<f64>,
    /// Force that the probe applies to the target, N.
    pub f_n: Vec<f64>,
    /// The `#` lines above the column names, without `#` and the space after it.
    pub header: Vec<String>,
    /// SHA-256 hash of all bytes of the file, 64 lower-case hexadecimal digits.
    pub sha256: String,
    /// What is doubtful about the recording.
    pub warnings: Vec<Warning>,
}

impl Recording {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there are no samples; [`read`] rejects such recordings.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The samples with these indices, with the same name, header and hash.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let pick = |column: &[f64]| indices.iter().map(|i| column[*i]).collect();
        Self {
            t_s: pick(&self.t_s),
            x_mm: pick(&self.x_mm),
            v_mm_s: pick(&self.v_mm_s),
            a_m_s2: pick(&self.a_m_s2),
            f_n: pick(&self.f_n),
            ..self.clone()
        }
    }

    /// Time from the first sample to the last, s.
    pub fn duration_s(&self) -> f64 {
        self.t_s.last().unwrap_or(&0.0) - self.t_s.first().unwrap_or(&0.0)
    }

    /// Lowest and highest position, mm.
    pub fn range_mm(&self) -> [f64; 2] {
        range(&self.x_mm)
    }

    /// Least and greatest force, N.
    pub fn range_n(&self) -> [f64; 2] {
        range(&self.f_n)
    }

    /// What 1 mm is in a switch with a travel of 10 to 100 mm, the length in which detents and
    /// changes of the force are looked for: 1 mm there, otherwise about 1/32 of the travel.
    pub fn scale_mm(&self) -> f64 {
        let [low, high] = self.range_mm();
        let travel_mm = high - low;
        if (10.0..=100.0).contains(&travel_mm) {
            return 1.0;
        }
        let least = travel_mm / 32.0;
        let decade = 10.0_f64.powf(least.log10().floor());
        let away = |digit: &f64| (least / (digit * decade)).ln().abs();
        let nearest = |a: &f64, b: &f64| away(a).total_cmp(&away(b));
        let digit = [1.0, 2.0, 5.0, 10.0].into_iter().min_by(nearest);
        let scale_mm = digit.unwrap_or(1.0) * decade;
        // as a person would write it
        format!("{scale_mm:.0e}").parse().unwrap_or(scale_mm)
    }

    /// Whether it is a slow press and release, or several: the header says so.
    pub fn is_force_curve(&self) -> bool {
        self.header_line("measured force curve:").is_some()
    }

    /// How the time of a recording that was measured without one was made up: the text of the header
    /// line `quasi-static: …`. `None` if it was measured.
    pub fn quasi_static(&self) -> Option<&str> {
        self.header_line("quasi-static:")
    }

    /// The count of the encoder, mm, if at least half of the differences of x are whole
    /// multiples of one of them: a filtered position has none.
    pub fn resolution_mm(&self) -> Option<f64> {
        resolution(&self.x_mm)
    }

    /// The filter of its signals according to the header: the text of the line
    /// `filter: …` up to a semicolon. `None` if unknown.
    pub fn filter(&self) -> Option<&str> {
        let line = self.header_line("filter:")?;
        let description = line.split(';').next().unwrap_or(line).trim();
        (!description.is_empty()).then_some(description)
    }

    /// The text after `key` of the first header line that begins with it; `None` if it is empty.
    pub fn header_line(&self, key: &str) -> Option<&str> {
        let line = self.header.iter().find_map(|line| line.strip_prefix(key))?;
        Some(line.trim()).filter(|text| !text.is_empty())
    }

    /// Largest speed, mm/s.
    pub fn top_speed_mm_s(&self) -> f64 {
        self.v_mm_s.iter().fold(0.0, |top, v| v.abs().max(top))
    }
}

/// The step of a sensor, if at least half of the differences of its values are whole multiples of
/// it: filtered values have none.
fn resolution(values: &[f64]) -> Option<f64> {
    let steps = || (values.windows(2).map(|w| (w[1] - w[0]).abs())).filter(|d| *d > 0.0);
    // differences of numbers near the largest position are no more exact than this
    let rounding = 1e-12 * values.iter().fold(1.0, |most: f64, x| x.abs().max(most));
    let count = steps()
        .filter(|d| *d > rounding)
        .fold(f64::INFINITY, f64::min);
    let whole = |d: &f64| {
        let ratio = d / count;
        (ratio - ratio.round()).abs() < 0.01 && ratio < 1000.0
    };
    let [low, high] = range(values);
    // ten decimals of a filtered position are not counts either
    let plausible = count.is_finite() && count > 1e-6 * (high - low);
    (plausible && 2 * steps().filter(whole).count() >= steps().count()).then_some(count)
}

/// What is doubtful about a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum Warning {
    #[error("no column {column}: computed as the {formula}")]
    Derived {
        column: &'static str,
        formula: &'static str,
    },
    #[error("columns are separated by {0}")]
    Separated(&'static str),
    /// Rows whose values are all those of the row before.
    #[error("{count} row{} the one before {} and {} left out, the first at line {line}", if *.count == 1 { " repeats" } else { "s repeat" }, if *.count == 1 { "it" } else { "them" }, if *.count == 1 { "is" } else { "are" })]
    Repeated { count: usize, line: u64 },
    /// Intervals longer than 1.75 median ones, which jitter does not explain.
    #[error("{count} gap{} in time, the longest {longest_s:.4} s at {at_s:.4} s", if *.count == 1 { "" } else { "s" })]
    Gaps {
        count: usize,
        longest_s: f64,
        at_s: f64,
    },
    /// The largest one with its time.
    #[error("{count} spike{} in {column}, the largest {value} at {at_s:.4} s: --robust replaces {}", if *.count == 1 { "" } else { "s" }, if *.count == 1 { "it" } else { "them" })]
    Spikes {
        column: &'static str,
        count: usize,
        value: f64,
        at_s: f64,
    },
    #[error(
        "f_n stays at exactly {force_n} N for {count} samples: the sensor seems to be saturated"
    )]
    Saturated { count: usize, force_n: f64 },
    /// The force rises to it and falls from it steeply.
    #[error(
        "f_n stays within its noise of {force_n:.3} N for {count} samples in {runs} runs, and leaves it steeply: as a saturated sensor with noise does, or dry friction alone; compare with the range of the sensor"
    )]
    Plateau {
        count: usize,
        runs: usize,
        force_n: f64,
    },
    /// Jumps of the force that recur at a position, or after which it stays elsewhere.
    #[error(
        "f_n jumps {count} time{} within a few samples, first at {at_s:.4} s and {at_mm:.2} mm, {why}: the target's own snap, no spike, and --robust leaves it as it is",
        if *.count == 1 { "" } else { "s" }
    )]
    Snap {
        count: usize,
        at_s: f64,
        at_mm: f64,
        why: &'static str,
    },
    /// At the same positions, in both directions of travel.
    #[error(
        "at the same positions f_n changes by {by_n:.3} N from the beginning to the end: the sensor drifts; tare it, or subtract the drift"
    )]
    Drift { by_n: f64 },
    #[error("the target moves in one direction only")]
    OneDirection,
    #[error("the differences of x_mm are {ratio:.3e} times {column}: check its unit and sign")]
    Scale { column: &'static str, ratio: f64 },
    #[error("{column} is the same in every row")]
    Constant { column: &'static str },
    /// With the shares of the variance of each column that the other does not explain.
    #[error("x_mm and f_n seem to be swapped: f_n is {smoother:.0} times smoother than x_mm, is one-sided, and explains {:.0} % of the variance of x_mm, which explains {:.0} % of that of f_n; check the column names", 100.0 * (1.0 - .of_position), 100.0 * (1.0 - .of_force))]
    Swapped {
        smoother: f64,
        of_force: f64,
        of_position: f64,
    },
}

/// Why a file is not a valid recording, and at which line.
#[derive(Debug, thiserror::Error)]
#[error("{name}: line {line}: {fault}")]
pub struct RecordingError {
    /// The name that the caller gave.
    pub name: String,
    /// Line number from 1. For faults of a whole column the line of column names.
    pub line: u64,
    /// What is wrong.
    pub fault: RecordingFault,
}

/// What is wrong with a file that should be a recording.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum RecordingFault {
    #[error("cannot be read: {0}")]
    Io(#[source] std::io::Error),
    #[error("the file ends before a line of column names such as t_s,x_mm,f_n")]
    NoColumns,
    #[error("no column {missing}; the columns are {found}")]
    MissingColumn {
        missing: &'static str,
        found: String,
    },
    #[error("two columns are called {0}")]
    DoubleColumn(&'static str),
    #[error("{found} fields, but there are {expected} columns")]
    Ragged { found: usize, expected: usize },
    #[error("{column} is `{text}`, which is not a number")]
    NotANumber { column: &'static str, text: String },
    #[error("{column} is {value}, which cannot be a measurement")]
    NotFinite { column: &'static str, value: f64 },
    #[error("t_s goes from {before} to {now}: time has to increase")]
    Time { before: f64, now: f64 },
    #[error("{0} rows: a recording has at least {least}", least = rows::MIN_ROWS)]
    TooShort(usize),
    #[error("more than {most} rows: shorten the recording or lower its sampling rate", most = rows::MAX_ROWS)]
    TooLong,
    #[error("the line is longer than {most} bytes", most = rows::MAX_LINE_BYTES)]
    LongLine,
    #[error("{0} is the same in every row: nothing was measured")]
    Constant(&'static str),
    #[error("the stroke is {stroke_mm} mm: x_mm seems to be in meters, multiply it by 1000")]
    Meters { stroke_mm: f64 },
}

/// Reads a recording.
///
/// ```
/// # use study_haptics::recording::{self, RecordingError};
/// let csv = "t_s,x_mm,f_n\n0,0,2\n0.5,4,3\n1,2,1\n";
/// let recording = recording::read("press.csv", csv.as_bytes())?;
/// assert_eq!((recording.len(), recording.duration_s()), (3, 1.0));
/// assert_eq!(recording.range_mm(), [0.0, 4.0]);
/// # Ok::<(), RecordingError>(())
/// ```
///
/// # Errors
/// [`RecordingError`] with the line of the first fault.
pub fn read(name: impl Into<String>, input: impl BufRead) -> Result<Recording, RecordingError> {
    read_as(name, input, &Names::default())
}

/// Reads a recording whose columns have other names or units.
///
/// # Errors
/// As [`read`].
pub fn read_as(
    name: impl Into<String>,
    input: impl BufRead,
    names: &Names,
) -> Result<Recording, RecordingError> {
    let name = name.into();
    match rows::read(input, names) {
        Ok(rows) => motion::complete(name, rows),
        Err((line, fault)) => Err(RecordingError { name, line, fault }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Recording, RecordingError> {
        read("r.csv", text.as_bytes())
    }

    fn message(text: &str) -> String {
        read_text(text).unwrap_err().to_string()
    }

    const GOOD: &str = "# a probe\n# of ours\nt_s,x_mm,v_mm_s,a_m_s2,f_n\n\
        0,1,5,0,2\n0.5,4,1,-0.01,3\n1,2,-4,0,1\n";

    #[test]
    fn columns_are_found_by_name_and_used_as_they_are() {
        let r = read_text(GOOD).unwrap();
        assert_eq!(r.header, ["a probe", "of ours"]);
        assert_eq!(r.x_mm, [1.0, 4.0, 2.0]);
        assert_eq!(r.v_mm_s, [5.0, 1.0, -4.0]);
        assert_eq!(r.a_m_s2, [0.0, -0.01, 0.0]);
        assert_eq!(r.range_mm(), [1.0, 4.0]);
        assert_eq!(r.top_speed_mm_s(), 5.0);
        let swapped = "f_n,note,x_mm,t_s\n2,9,1,0\n3,9,4,0.5\n1,9,2,1\n";
        let r = read_text(swapped).unwrap();
        assert_eq!(r.f_n, [2.0, 3.0, 1.0]);
        assert_eq!(r.t_s, [0.0, 0.5, 1.0]);
    }

    #[test]
    fn the_filter_is_read_from_the_header() {
        let with = |header: &str| read_text(&format!("{header}{GOOD}")).unwrap();
        let r = with("# filter: low-pass at 30 Hz; v: differences\n");
        assert_eq!(r.filter(), Some("low-pass at 30 Hz"));
        for none in ["", "# filter: ; x\n", "# filtered at 30 Hz\n"] {
            assert_eq!(with(none).filter(), None, "{none}");
        }
    }

    #[test]
    fn the_hash_is_that_of_the_file() {
        // printf 't_s,x_mm,f_n\n0,1,1\n1,2,2\n2,1,1\n' | sha256sum
        let r = read_text("t_s,x_mm,f_n\n0,1,1\n1,2,2\n2,1,1\n").unwrap();
        assert_eq!(
            r.sha256,
            "051a84a58e1b3ce81a4fa4bb35ac342cd6a2a3d792b52c4a5d55161529b8311d"
        );
    }

    #[test]
    fn absent_velocity_and_acceleration_are_differences_and_say_so() {
        // x = t³ mm at 0, 1, 2, 3 s: central v at 1 is (8 − 0)/2, a is 6 mm/s²
        let r = read_text("t_s,x_mm,f_n\n0,0,1\n1,1,2\n2,8,3\n3,27,4\n").unwrap();
        assert_eq!(r.v_mm_s, [1.0, 4.0, 13.0, 19.0]);
        assert_eq!(r.a_m_s2, [0.006, 0.006, 0.012, 0.012]);
        let messages: Vec<_> = r.warnings.iter().map(ToString::to_string).collect();
        assert_eq!(
            messages,
            [
                "no column v_mm_s: computed as the central difference of x_mm",
                "no column a_m_s2: computed as the second central difference of x_mm",
                "the target moves in one direction only",
            ]
        );
    }

    #[test]
    fn byte_order_mark_carriage_returns_blank_lines_and_quoted_names_are_accepted() {
        let text = "\u{feff}# made elsewhere\r\n\"t_s\",\"x_mm\",\"f_n\"\r\n0, 1 ,2\r\n\r\n1,3,1\r\n# pause\r\n2,1,2";
        let r = read_text(text).unwrap();
        assert_eq!(r.header, ["made elsewhere"]);
        assert_eq!(r.x_mm, [1.0, 3.0, 1.0]);
    }

    #[test]
    fn semicolons_tabs_and_decimal_commas_are_read_and_said() {
        let plain = read_text(GOOD).unwrap();
        for (separator, said) in [(";", "semicolons"), ("\t", "tabs")] {
            let text = GOOD.replace(',', separator);
            let (header, rows) = text.split_once("f_n\n").unwrap();
            let r = read_text(&format!("{header}f_n\n{}", rows.replace('.', ","))).unwrap();
            assert_eq!((&r.t_s, &r.a_m_s2), (&plain.t_s, &plain.a_m_s2));
            let warnings: Vec<_> = r.warnings.iter().map(ToString::to_string).collect();
            assert!(
                warnings.contains(&format!("columns are separated by {said}")),
                "{warnings:?}"
            );
        }
    }

    #[test]
    fn a_knob_in_degrees_and_newton_meters_is_read_at_its_lever() {
        let given: Vec<Named> = ["t=time", "x=pos:deg", "f=torque:N·m"]
            .map(|text| text.parse().unwrap())
            .into();
        let text = "time,pos,torque\n0,0,0.1\n1,90,0.2\n2,10,0.1\n";
        let r = read_as("k", text.as_bytes(), &Names::new(&given, 20.0)).unwrap();
        assert!((r.x_mm[1] - 10.0 * std::f64::consts::PI).abs() < 1e-12);
        assert!((r.f_n[1] - 10.0).abs() < 1e-12);
    }

    #[test]
    fn every_bad_row_is_named_with_its_line() {
        let at = |row: &str| format!("# h\nt_s,x_mm,f_n\n0,1,1\n\n1,2,2\n{row}\n3,1,1\n");
        for (row, expected) in [
            ("2,1", "r.csv: line 6: 2 fields, but there are 3 columns"),
            (
                "2,1,1,1",
                "r.csv: line 6: 4 fields, but there are 3 columns",
            ),
            (
                "2,NaN,1",
                "r.csv: line 6: x_mm is NaN, which cannot be a measurement",
            ),
            (
                "2,1,1e999",
                "r.csv: line 6: f_n is inf, which cannot be a measurement",
            ),
            ("2,,1", "r.csv: line 6: x_mm is ``, which is not a number"),
            (
                "2,\u{1b}[2J,1",
                "r.csv: line 6: x_mm is `\\u{1b}[2J`, which is not a number",
            ),
            (
                "1,1,1",
                "r.csv: line 6: t_s goes from 1 to 1: time has to increase",
            ),
            (
                "0.5,1,1",
                "r.csv: line 6: t_s goes from 1 to 0.5: time has to increase",
            ),
        ] {
            assert_eq!(message(&at(row)), expected);
        }
    }

    #[test]
    fn a_file_that_is_not_a_recording_is_refused_with_what_is_missing() {
        assert_eq!(
            message(""),
            "r.csv: line 1: the file ends before a line of column names such as t_s,x_mm,f_n"
        );
        assert_eq!(
            message("# h\nt_s,x,f_n\n"),
            "r.csv: line 2: no column x_mm; the columns are t_s, x, f_n"
        );
        assert_eq!(
            message("t_s,x_mm,f_n,x_mm\n"),
            "r.csv: line 1: two columns are called x_mm"
        );
        assert_eq!(
            message("t_s,x_mm,f_n\n0,1,1\n"),
            "r.csv: line 2: 1 rows: a recording has at least 3"
        );
        assert_eq!(
            message(&format!("t_s,x_mm,f_n\n0,{},1\n", "1".repeat(70_000))),
            "r.csv: line 2: the line is longer than 65536 bytes"
        );
    }

    #[test]
    fn constant_columns_and_meters_are_refused() {
        assert_eq!(
            message("# h\nt_s,x_mm,f_n\n0,1,1\n1,1,2\n2,1,3\n"),
            "r.csv: line 2: x_mm is the same in every row: nothing was measured"
        );
        assert_eq!(
            message("t_s,x_mm,f_n\n0,1,1\n1,2,1\n2,1,1\n"),
            "r.csv: line 1: f_n is the same in every row: nothing was measured"
        );
        assert_eq!(
            message("t_s,x_mm,f_n\n0,0.001,1\n1,0.035,2\n2,0.001,3\n"),
            "r.csv: line 1: the stroke is 0.034 mm: x_mm seems to be in meters, multiply it by 1000"
        );
    }

    #[test]
    fn gaps_and_wrong_units_are_warnings() {
        let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
        for i in 0..400 {
            let t = f64::from(if i < 200 { i } else { i + 7 }) * 0.001;
            let (w, x) = (60.0, (60.0 * t).sin());
            // v in m/s instead of mm/s
            let v = w * (w * t).cos() / 1000.0;
            text += &format!(
                "{t},{},{v},{},{}\n",
                10.0 * x,
                -w * w * x / 100.0,
                (w * t).cos()
            );
        }
        let r = read_text(&text).unwrap();
        let messages: Vec<_> = r.warnings.iter().map(ToString::to_string).collect();
        assert_eq!(
            messages[0],
            "1 gap in time, the longest 0.0080 s at 0.1990 s"
        );
        assert!(
            messages[1].contains("times v_mm_s: check its unit"),
            "{messages:?}"
        );
        assert_eq!(messages.len(), 2, "{messages:?}");
    }
}
