//! Names and units of the columns of a file.

use study_base::text::Untrusted;

/// The columns that are read, in the order of [`Names::default`].
pub(super) const COLUMNS: [&str; 5] = ["t_s", "x_mm", "v_mm_s", "a_m_s2", "f_n"];
/// The letters by which a user names them.
const LETTERS: [&str; 5] = ["t", "x", "v", "a", "f"];

/// Units of a column: name, factor to its unit in [`COLUMNS`], and the power of the lever
/// arm in mm by which it is multiplied.
type Units = &'static [(&'static str, f64, i32)];

const RAD_PER_DEG: f64 = std::f64::consts::PI / 180.0;
const UNITS: [Units; 5] = [
    &[
        ("s", 1.0, 0),
        ("ms", 1e-3, 0),
        ("us", 1e-6, 0),
        ("µs", 1e-6, 0),
    ],
    &[
        ("mm", 1.0, 0),
        ("cm", 10.0, 0),
        ("m", 1e3, 0),
        ("um", 1e-3, 0),
        ("µm", 1e-3, 0),
        ("deg", RAD_PER_DEG, 1),
        ("rad", 1.0, 1),
    ],
    &[
        ("mm/s", 1.0, 0),
        ("m/s", 1e3, 0),
        ("deg/s", RAD_PER_DEG, 1),
        ("rad/s", 1.0, 1),
    ],
    &[
        ("m/s2", 1.0, 0),
        ("m/s²", 1.0, 0),
        ("mm/s2", 1e-3, 0),
        ("mm/s²", 1e-3, 0),
        ("deg/s2", 1e-3 * RAD_PER_DEG, 1),
        ("deg/s²", 1e-3 * RAD_PER_DEG, 1),
        ("rad/s2", 1e-3, 1),
        ("rad/s²", 1e-3, 1),
    ],
    &[
        ("N", 1.0, 0),
        ("mN", 1e-3, 0),
        ("kN", 1e3, 0),
        ("cN", 1e-2, 0),
        ("gf", 9.806_65e-3, 0),
        ("kgf", 9.806_65, 0),
        ("N·m", 1e3, -1),
        ("N*m", 1e3, -1),
        ("Nm", 1e3, -1),
        ("N·mm", 1.0, -1),
        ("Nmm", 1.0, -1),
        ("mN·m", 1.0, -1),
        ("mNm", 1.0, -1),
    ],
];

/// The factor of a unit of length or force, in any case of letters, to mm or N. Units of rotation
/// have none.
pub(super) fn linear(column: usize, unit: &str) -> Option<f64> {
    let known = UNITS[column].iter();
    let mut same = known.filter(|(name, _, power)| *power == 0 && name.eq_ignore_ascii_case(unit));
    // mN and MN differ in case only, but nobody measures a switch in meganewtons
    same.next().map(|(_, factor, _)| *factor)
}

/// How a column is called in a file, and its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// Index in [`COLUMNS`].
    column: usize,
    name: String,
    factor: f64,
    lever_power: i32,
}

/// Why a column cannot be named so.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum NameError {
    #[error("write a column as KEY=NAME or KEY=NAME:UNIT, where KEY is t, x, v, a or f")]
    Form,
    #[error("`{}` is no unit of {column}: {units}", Untrusted(.unit))]
    Unit {
        unit: String,
        column: &'static str,
        units: String,
    },
}

impl std::str::FromStr for Named {
    type Err = NameError;
    /// `x=pos:deg`; without a unit that of the column.
    fn from_str(text: &str) -> Result<Self, NameError> {
        let (key, rest) = text.split_once('=').ok_or(NameError::Form)?;
        let found = LETTERS.iter().position(|letter| *letter == key.trim());
        let column = found.ok_or(NameError::Form)?;
        let (name, unit) = rest.rsplit_once(':').unwrap_or((rest, UNITS[column][0].0));
        if name.trim().is_empty() {
            return Err(NameError::Form);
        }
        let known = UNITS[column]
            .iter()
            .find(|(known, ..)| *known == unit.trim());
        let Some((_, factor, lever_power)) = known else {
            let all: Vec<&str> = UNITS[column].iter().map(|(known, ..)| *known).collect();
            return Err(NameError::Unit {
                unit: unit.into(),
                column: LETTERS[column],
                units: all.join(", "),
            });
        };
        Ok(Self {
            column,
            name: name.trim().to_owned(),
            factor: *factor,
            lever_power: *lever_power,
        })
    }
}

impl Named {
    /// Whether its unit is one of rotation, which needs a lever arm.
    pub fn is_rotary(&self) -> bool {
        self.lever_power != 0
    }

    /// Whether it is an angle, and in degrees.
    pub fn in_degrees(&self) -> Option<bool> {
        let angle = self.column == 1 && self.is_rotary();
        angle.then_some(self.factor != 1.0)
    }
}

/// Names and factors of all columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Names {
    names: [String; 5],
    factors: [f64; 5],
}

impl Default for Names {
    /// `t_s`, `x_mm`, `v_mm_s`, `a_m_s2` and `f_n`.
    fn default() -> Self {
        Self {
            names: COLUMNS.map(str::to_owned),
            factors: [1.0; 5],
        }
    }
}

impl Names {
    /// The default names except for those given; angles and torques become positions and
    /// forces at the end of a lever arm, mm.
    pub fn new(given: &[Named], lever_mm: f64) -> Self {
        let mut names = Self::default();
        for named in given {
            names.names[named.column].clone_from(&named.name);
            names.factors[named.column] = named.factor * lever_mm.powi(named.lever_power);
        }
        names
    }

    /// The index of the column with this name in the file.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| own == name)
    }

    /// The factor of a column.
    pub(super) fn factor(&self, column: usize) -> f64 {
        self.factors[column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_torques_become_positions_and_forces_at_a_lever() {
        let given: Vec<Named> = ["t=time:ms", "x=pos:deg", "f=torque:N·m"]
            .map(|text| text.parse().unwrap())
            .into();
        assert!(given[1].is_rotary() && !given[0].is_rotary());
        let names = Names::new(&given, 20.0);
        assert_eq!(names.column("pos"), Some(1));
        assert_eq!(names.column("x_mm"), None);
        assert_eq!(names.column("v_mm_s"), Some(2));
        assert_eq!(names.factor(0), 1e-3);
        // 180° at 20 mm, and 1 N·m
        assert!((180.0 * names.factor(1) - 20.0 * std::f64::consts::PI).abs() < 1e-12);
        assert!((names.factor(4) - 50.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_column_or_unit_is_refused() {
        for bad in ["", "x", "y=pos", "x=", "x=:deg"] {
            assert_eq!(bad.parse::<Named>(), Err(NameError::Form), "{bad}");
        }
        let message = "x=pos:inch".parse::<Named>().unwrap_err().to_string();
        assert_eq!(
            message,
            "`inch` is no unit of x: mm, cm, m, um, µm, deg, rad"
        );
    }
}
