//! Velocity and acceleration where they are absent, and plausibility checks.

use super::differences::{acceleration, velocity};
use super::rows::Rows;
use super::swapped::swapped;
use super::{JITTER, Recording, RecordingError, RecordingFault, Warning, range};

/// A smaller stroke, in mm, must have been written in meters.
const MIN_STROKE_MM: f64 = 0.1;
/// Number of intervals from which the median one is estimated.
const INTERVALS: usize = 4096;
/// Spans over which a column is compared with the differences of another one, in samples.
const SPANS: [usize; 5] = [1, 4, 16, 64, 256];
/// Two columns measure the same if their correlation squared is at least this.
const LEAST_ALIKE: f64 = 0.5;
/// A quantity shows in its changes if their mean square is so many times what its noise makes of them.
const SHOWN: f64 = 20.0;

/// The recording with these rows.
pub(super) fn complete(name: String, rows: Rows) -> Result<Recording, RecordingError> {
    let Rows { t_s, x_mm, f_n, .. } = rows;
    let refuse = |fault| {
        Err(RecordingError {
            name: name.clone(),
            line: rows.header_line,
            fault,
        })
    };
    for (column, values) in [("x_mm", &x_mm), ("f_n", &f_n)] {
        if is_constant(values) {
            return refuse(RecordingFault::Constant(column));
        }
    }
    let [low, high] = range(&x_mm);
    let stroke_mm = high - low;
    if stroke_mm < MIN_STROKE_MM {
        return refuse(RecordingFault::Meters { stroke_mm });
    }
    let mut warnings: Vec<Warning> = gaps(&t_s).into_iter().collect();
    warnings.extend(rows.separator.map(Warning::Separated));
    let repeated = |(count, line)| Warning::Repeated { count, line };
    warnings.extend(rows.repeated.map(repeated));
    if rows.v_mm_s.is_none() && rows.a_m_s2.is_none() {
        warnings.extend(swapped(&t_s, &x_mm, &f_n));
    }
    warnings.extend(super::doubts::warnings(&x_mm, &f_n, &t_s));
    let velocity = |i: usize| velocity(&t_s, &x_mm, i);
    let acceleration = |i: usize| acceleration(&t_s, &x_mm, i);
    if let Some(given) = &rows.v_mm_s {
        warnings.extend(scale("v_mm_s", given, &t_s, &x_mm));
    } else {
        warnings.push(Warning::Derived {
            column: "v_mm_s",
            formula: "central difference of x_mm",
        });
    }
    match &rows.a_m_s2 {
        None => warnings.push(Warning::Derived {
            column: "a_m_s2",
            formula: "second central difference of x_mm",
        }),
        Some(given) if is_constant(given) => {
            warnings.push(Warning::Constant { column: "a_m_s2" });
        }
        Some(given) => {
            let m_s: Vec<f64> = (0..t_s.len()).map(|i| 1e-3 * velocity(i)).collect();
            warnings.extend(scale("a_m_s2", given, &t_s, &m_s));
        }
    }
    let rows_of = |value: &dyn Fn(usize) -> f64| (0..t_s.len()).map(value).collect();
    let v_mm_s: Vec<f64> = rows.v_mm_s.unwrap_or_else(|| rows_of(&velocity));
    let a_m_s2 = rows.a_m_s2.unwrap_or_else(|| rows_of(&acceleration));
    if !(v_mm_s.iter().any(|v| *v > 0.0) && v_mm_s.iter().any(|v| *v < 0.0)) {
        warnings.push(Warning::OneDirection);
    }
    warnings.extend(super::drift::warning(&t_s, &x_mm, &v_mm_s, &f_n));
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

fn is_constant(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}

/// A warning about intervals longer than jitter makes them.
fn gaps(t: &[f64]) -> Option<Warning> {
    // from evenly chosen intervals, so that memory does not grow with the recording
    let every = (t.len() / INTERVALS).max(1);
    let mut intervals: Vec<f64> = (1..t.len())
        .step_by(every)
        .map(|i| t[i] - t[i - 1])
        .collect();
    let middle = intervals.len() / 2;
    let median = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (mut count, mut longest_s, mut at_s) = (0, 0.0, 0.0);
    for pair in t.windows(2) {
        let interval = pair[1] - pair[0];
        if interval > (1.0 + JITTER) * median {
            count += 1;
            if interval > longest_s {
                (longest_s, at_s) = (interval, pair[0]);
            }
        }
    }
    (count > 0).then_some(Warning::Gaps {
        count,
        longest_s,
        at_s,
    })
}

/// A warning if a column does not have the scale of the differences of the quantity that it is the derivative of.
///
/// What a quantity gains over a span of time is compared with what its derivative adds up to, over
/// the span of those in [`SPANS`] over which the two are most alike: over short ones the steps of an encoder
/// hide a slow motion, over long ones the derivative cancels. Where they are never alike because one of them is
/// noise, that says nothing of a unit; where neither is, the column is another quantity.
fn scale(column: &'static str, given: &[f64], t: &[f64], quantity: &[f64]) -> Option<Warning> {
    let n = given.len();
    let interval_s = (t[n - 1] - t[0]) / (n - 1) as f64;
    // means of neighbors times their interval, added up
    let mut sums = vec![0.0; n];
    for i in 1..n {
        sums[i] = sums[i - 1] + 0.5 * (given[i] + given[i - 1]) * (t[i] - t[i - 1]);
    }
    let [noise_of_given, noise_of_quantity] = [given, quantity].map(noise);
    let over = |span: usize| {
        let [mut product, mut of_given, mut of_quantity] = [0.0; 3];
        for i in span..n {
            let (added, gained) = (sums[i] - sums[i - span], quantity[i] - quantity[i - span]);
            product += added * gained;
            of_given += added * added;
            of_quantity += gained * gained;
        }
        let count = (n - span) as f64;
        let random_walk = span as f64 * interval_s.powi(2) * noise_of_given;
        let shown = of_given > SHOWN * count * random_walk
            && of_quantity > SHOWN * count * 2.0 * noise_of_quantity;
        let alike = product * product / (of_given * of_quantity);
        (alike, product / of_given, of_given == 0.0, shown)
    };
    let spans = SPANS.into_iter().filter(|span| 4 * span <= n || *span == 1);
    let (alike, ratio, nothing, shown) =
        (spans.map(over)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.2.cmp(&a.2)))?;
    let comparable = alike >= LEAST_ALIKE || shown;
    // an all-zero column has the ratio NaN
    (nothing || comparable && !(0.5..=2.0).contains(&ratio))
        .then_some(Warning::Scale { column, ratio })
}

/// The variance of the noise of single samples: that of third differences over 1 + 9 + 9 + 1.
fn noise(values: &[f64]) -> f64 {
    let differences = values
        .windows(4)
        .map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]);
    let square: f64 = differences.map(|d| d * d).sum();
    square / (20.0 * values.len() as f64)
}
