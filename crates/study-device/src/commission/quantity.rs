//! What somebody typed who read a scale: a value, its unit and its tolerance.

use serde::{Deserialize, Serialize};

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// Largest force that is believed, N.
const MOST_N: f64 = 1000.0;
/// Largest tolerance of an instrument, as a share.
const MOST_SHARE: f64 = 0.2;

/// What was weighed with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Instrument {
    /// `weights`, `scale` or `gauge`.
    pub kind: String,
    /// By how much it may be off, as a share of what it shows.
    pub share: f64,
    /// The same as a force, N; both add.
    pub force_n: f64,
}

/// A force that was read, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Force, N.
    pub force_n: f64,
    /// By how much it may be off, N, if that was typed.
    pub tolerance_n: Option<f64>,
}

/// What is wrong with a typed value. The messages say what to type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum QuantityError {
    #[error("a number with its unit is needed, such as 600 g, 0.6 kg or 5.9 N, or 600 g ± 2 g")]
    NoNumber,
    #[error("the unit has to be g, kg, mN or N, such as 600 g or 5.9 N")]
    Unit,
    #[error("above 0 and at most 1000 N is needed")]
    Size,
    #[error(
        "weights, scale or gauge with its tolerance is needed, such as weights 1 % or gauge 0.05 N"
    )]
    Instrument,
    #[error("the tolerance has to be above 0 and at most 20 %, or a force such as 0.05 N")]
    Tolerance,
}

impl Instrument {
    /// The tolerance of a force that it shows, N.
    pub fn tolerance_n(&self, force_n: f64) -> f64 {
        self.share * force_n.abs() + self.force_n
    }
}

/// A number, with a comma or a point, and what follows it.
fn number(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.' || c == ','))
        .unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let value: f64 = digits.replace(',', ".").parse().ok()?;
    value.is_finite().then_some((value, rest.trim()))
}

/// A force of a number and its unit, N.
fn force_n(text: &str) -> Result<f64, QuantityError> {
    let (value, unit) = number(text).ok_or(QuantityError::NoNumber)?;
    Ok(match unit {
        "g" => 1e-3 * GRAVITY * value,
        "kg" => GRAVITY * value,
        "mN" => 1e-3 * value,
        "N" => value,
        "" => return Err(QuantityError::NoNumber),
        _ => return Err(QuantityError::Unit),
    })
}

/// Reads a value with its unit and, after `±` or `+-`, its tolerance.
///
/// # Errors
/// [`QuantityError`] that says what to type.
///
/// ```
/// # use study_device::commission::measured;
/// let read = measured("0,5 kg ± 2 g")?;
/// assert!((read.force_n - 4.903325).abs() < 1e-9);
/// assert!((read.tolerance_n.unwrap_or(0.0) - 0.0196133).abs() < 1e-9);
/// assert!(measured("500").is_err());
/// # Ok::<(), study_device::commission::QuantityError>(())
/// ```
pub fn measured(typed: &str) -> Result<Measured, QuantityError> {
    let typed = typed.replace("+-", "±").replace("+/-", "±");
    let (value, tolerance) = match typed.split_once('±') {
        Some((value, tolerance)) => (value, Some(tolerance)),
        None => (typed.as_str(), None),
    };
    let read_n = force_n(value)?;
    if !(read_n > 0.0 && read_n <= MOST_N) {
        return Err(QuantityError::Size);
    }
    let tolerance_n = match tolerance {
        None => None,
        Some(text) => Some(match number(text) {
            Some((share, "%")) => 0.01 * share * read_n,
            _ => force_n(text)?,
        }),
    };
    if tolerance_n.is_some_and(|n| n <= 0.0 || n > MOST_SHARE * read_n) {
        return Err(QuantityError::Tolerance);
    }
    Ok(Measured {
        force_n: read_n,
        tolerance_n,
    })
}

/// Reads what is weighed with and its tolerance, such as `weights 1 %`.
///
/// # Errors
/// [`QuantityError`] that says what to type.
pub fn instrument(typed: &str) -> Result<Instrument, QuantityError> {
    let typed = typed.trim();
    let (kind, tolerance) = typed.split_once(' ').unwrap_or((typed, ""));
    if !["weights", "scale", "gauge"].contains(&kind) {
        return Err(QuantityError::Instrument);
    }
    let tolerance = tolerance.trim_start_matches(['±', ' ']);
    let (share, force_n) = match number(tolerance) {
        None => return Err(QuantityError::Instrument),
        Some((share, "%")) => (0.01 * share, 0.0),
        Some(_) => (0.0, force_n(tolerance)?),
    };
    let possible = share <= MOST_SHARE && force_n <= MOST_N && share + force_n > 0.0;
    possible
        .then(|| Instrument {
            kind: kind.to_owned(),
            share,
            force_n,
        })
        .ok_or(QuantityError::Tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_units_and_tolerances_are_read() {
        for (typed, force_n) in [
            ("204 g", 2.000_556_6),
            ("204g", 2.000_556_6),
            ("0.204 kg", 2.000_556_6),
            (" 2,5 N ", 2.5),
            ("2500 mN", 2.5),
        ] {
            let read = measured(typed).unwrap();
            assert!((read.force_n - force_n).abs() < 1e-6, "{typed}: {read:?}");
            assert_eq!(read.tolerance_n, None);
        }
        for typed in ["5 N ± 0.1 N", "5 N +- 2 %", "5 N +/- 100 mN", "5 N±0,1 N"] {
            let read = measured(typed).unwrap();
            assert!((read.tolerance_n.unwrap() - 0.1).abs() < 1e-12, "{typed}");
        }
    }

    #[test]
    fn what_is_none_says_what_to_type() {
        for (typed, why) in [
            ("", QuantityError::NoNumber),
            ("600", QuantityError::NoNumber),
            ("g", QuantityError::NoNumber),
            ("-5 N", QuantityError::NoNumber),
            ("1.2.3 N", QuantityError::NoNumber),
            ("nan N", QuantityError::NoNumber),
            ("6 lbs", QuantityError::Unit),
            ("0 N", QuantityError::Size),
            ("101 kg 5", QuantityError::Unit),
            ("200 kg", QuantityError::Size),
            ("5 N ± 3 N", QuantityError::Tolerance),
            ("5 N ± 0 N", QuantityError::Tolerance),
        ] {
            assert_eq!(measured(typed), Err(why), "{typed}");
        }
        for (typed, why) in [
            ("weights", QuantityError::Instrument),
            ("1 %", QuantityError::Instrument),
            ("gauge 50 %", QuantityError::Tolerance),
            ("gauge 0 N", QuantityError::Tolerance),
        ] {
            assert_eq!(instrument(typed), Err(why), "{typed}");
        }
        let gauge = instrument("gauge 0.05 N").unwrap();
        assert_eq!(gauge.tolerance_n(10.0), 0.05);
        let weights = instrument("weights 1 %").unwrap();
        assert!((weights.tolerance_n(10.0) - 0.1).abs() < 1e-12);
    }
}
