//! Velocity and acceleration where they are absent, and doubts about the rest.

use super::rows::{COLUMNS, Rows};
use super::swapped::swapped;
use super::{Recording, RecordingError, RecordingFault, Warning};

/// A stroke below this, in mm, was surely written in metres.
const LEAST_STROKE_MM: f64 = 0.1;
/// Steps of time that are looked at to find the usual one.
const STEPS: usize = 4096;

/// Makes the recording of its rows.
pub(super) fn complete(name: String, rows: Rows) -> Result<Recording, RecordingError> {
    let [t_s, x_mm, mut v_mm_s, mut a_m_s2, f_n] = rows.columns;
    let refuse = |fault| {
        Err(RecordingError {
            name: name.clone(),
            line: rows.header_line,
            fault,
        })
    };
    for (column, values) in [(COLUMNS[1], &x_mm), (COLUMNS[4], &f_n)] {
        if is_constant(values) {
            return refuse(RecordingFault::Constant(column));
        }
    }
    let [low, high] = range(&x_mm);
    let stroke_mm = high - low;
    if stroke_mm < LEAST_STROKE_MM {
        return refuse(RecordingFault::Metres { stroke_mm });
    }
    let mut warnings: Vec<Warning> = gaps(&t_s).into_iter().collect();
    if v_mm_s.is_empty() && a_m_s2.is_empty() {
        warnings.extend(swapped(&t_s, &x_mm, &f_n));
    }
    if v_mm_s.is_empty() {
        v_mm_s = (0..t_s.len()).map(|i| velocity(&t_s, &x_mm, i)).collect();
        warnings.push(Warning::Derived {
            column: COLUMNS[2],
            how: "the central difference of x_mm",
        });
    } else {
        warnings.extend(scale(COLUMNS[2], &v_mm_s, |i| velocity(&t_s, &x_mm, i)));
    }
    if a_m_s2.is_empty() {
        a_m_s2 = (0..t_s.len())
            .map(|i| acceleration(&t_s, &x_mm, i))
            .collect();
        warnings.push(Warning::Derived {
            column: COLUMNS[3],
            how: "the second central difference of x_mm",
        });
    } else if is_constant(&a_m_s2) {
        warnings.push(Warning::Constant { column: COLUMNS[3] });
    } else {
        warnings.extend(scale(COLUMNS[3], &a_m_s2, |i| acceleration(&t_s, &x_mm, i)));
    }
    if !(v_mm_s.iter().any(|v| *v > 0.0) && v_mm_s.iter().any(|v| *v < 0.0)) {
        warnings.push(Warning::OneDirection);
    }
    Ok(Recording {
        name,
        t_s,
        x_mm,
        v_mm_s,
        a_m_s2,
        f_n,
        header: rows.header,
        sha256: rows.sha256,
        warnings,
    })
}

/// Lowest and highest.
pub(super) fn range(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(*x), high.max(*x)]
        })
}

fn is_constant(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}

/// Central difference, one-sided at the ends, mm/s.
fn velocity(t: &[f64], x: &[f64], i: usize) -> f64 {
    let before = i.saturating_sub(1);
    let after = (i + 1).min(t.len() - 1);
    (x[after] - x[before]) / (t[after] - t[before])
}

/// Second central difference, that of the neighbour at the ends, m/s².
fn acceleration(t: &[f64], x: &[f64], i: usize) -> f64 {
    let i = i.clamp(1, t.len() - 2);
    let before = (x[i] - x[i - 1]) / (t[i] - t[i - 1]);
    let after = (x[i + 1] - x[i]) / (t[i + 1] - t[i]);
    (after - before) / (0.5 * (t[i + 1] - t[i - 1])) / 1000.0
}

/// Steps of time longer than one and a half usual ones.
fn gaps(t: &[f64]) -> Option<Warning> {
    // the median of evenly chosen steps: memory does not grow with the recording
    let every = (t.len() / STEPS).max(1);
    let mut steps: Vec<f64> = (1..t.len())
        .step_by(every)
        .map(|i| t[i] - t[i - 1])
        .collect();
    let middle = steps.len() / 2;
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (mut count, mut longest_s, mut at_s) = (0, 0.0, 0.0);
    for pair in t.windows(2) {
        let step = pair[1] - pair[0];
        if step > 1.5 * usual {
            count += 1;
            if step > longest_s {
                (longest_s, at_s) = (step, pair[0]);
            }
        }
    }
    (count > 0).then_some(Warning::Gaps {
        count,
        longest_s,
        at_s,
    })
}

/// Whether a given column has the scale of the difference of x that it should
/// be. Noise of the differences does not bias the ratio, as it would the inverse.
fn scale(column: &'static str, given: &[f64], of_x: impl Fn(usize) -> f64) -> Option<Warning> {
    let (mut product, mut square) = (0.0, 0.0);
    for (i, value) in given.iter().enumerate() {
        product += of_x(i) * value;
        square += value * value;
    }
    let ratio = product / square;
    // also true of a NaN, which an all-zero column gives
    (!(0.5..=2.0).contains(&ratio)).then_some(Warning::Scale { column, ratio })
}
