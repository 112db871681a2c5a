//! Units of a model file: a straight handle in mm and N, or a turning one in degrees or
//! radians and N·m.
//!
//! Everything that is calculated, played and limited is in mm and N at the hand. A rotary
//! realization is converted when it is read, with the lever arm at which the hand holds:
//! x = r θ, F = T/r, m = I/r².

use super::{Mechanism, Profile, Realization};
use study_wire::mechanism::Scalars;

/// The units of the numbers of a [`Realization`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Units {
    /// mm, N, kg.
    #[default]
    Linear,
    /// Degrees, N·m, kg·m².
    Degrees,
    /// Radians, N·m, kg·m².
    Radians,
}

impl Units {
    /// Those of a turning handle by the name of the unit of the angle.
    pub fn of_angle(name: &str) -> Option<Self> {
        match name {
            "deg" => Some(Self::Degrees),
            "rad" => Some(Self::Radians),
            _ => None,
        }
    }

    /// Names of the units of position and force.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::Linear => ["mm", "N"],
            Self::Degrees => ["deg", "N·m"],
            Self::Radians => ["rad", "N·m"],
        }
    }

    /// A length in mm at the end of a lever arm of `lever_mm`, in these units.
    ///
    /// ```
    /// # use study_haptics::model::Units;
    /// // 90 degrees of a lever of 40 mm are 20 π mm.
    /// let angle = Units::Degrees.of_mm(20.0 * std::f64::consts::PI, 40.0);
    /// assert!((angle - 90.0).abs() < 1e-9);
    /// ```
    pub fn of_mm(self, mm: f64, lever_mm: f64) -> f64 {
        mm / self.at_lever(lever_mm).x
    }

    /// A force in N at the end of a lever arm of `lever_mm`, in these units.
    pub fn of_n(self, n: f64, lever_mm: f64) -> f64 {
        n / self.at_lever(lever_mm).f
    }

    /// A key of a model file with these units in its name; `key` is the one with mm and N.
    pub fn key(self, key: &str) -> String {
        if self == Self::Linear {
            return key.to_owned();
        }
        let [x, _] = self.names();
        let renamed = [
            ("n_s_per_mm", format!("nm_s_per_{x}")),
            ("n_per_mm", format!("nm_per_{x}")),
            ("mm_s", format!("{x}_s")),
            ("mm", x.to_owned()),
            ("kg", "kg_m2".to_owned()),
            ("n", "nm".to_owned()),
        ];
        let found = renamed.iter().find_map(|(unit, own)| {
            let before = key.strip_suffix(unit)?;
            (before.is_empty() || before.ends_with('_')).then(|| format!("{before}{own}"))
        });
        found.unwrap_or_else(|| key.to_owned())
    }

    /// What one unit is at a lever arm of `lever_mm`.
    fn at_lever(self, lever_mm: f64) -> Scale {
        let rad = match self {
            Self::Linear => {
                return Scale {
                    x: 1.0,
                    f: 1.0,
                    m: 1.0,
                };
            }
            Self::Degrees => std::f64::consts::PI / 180.0,
            Self::Radians => 1.0,
        };
        Scale {
            x: rad * lever_mm,
            f: 1e3 / lever_mm,
            m: 1e6 / lever_mm.powi(2),
        }
    }
}

/// Factors of length, force and mass.
#[derive(Debug, Clone, Copy)]
struct Scale {
    x: f64,
    f: f64,
    m: f64,
}

impl Scale {
    /// The factor of a parameter with its unit, in mm and N, in its name.
    fn of(self, key: &str) -> f64 {
        let Self { x, f, m } = self;
        let units = [
            ("n_s_per_mm", f / x),
            ("n_per_mm", f / x),
            ("mm_s", x),
            ("mm", x),
            ("kg", m),
            ("n", f),
        ];
        let found = units.iter().find(|(unit, _)| {
            let before = key.strip_suffix(unit);
            before.is_some_and(|before| before.is_empty() || before.ends_with('_'))
        });
        found.map_or(1.0, |(_, factor)| *factor)
    }
}

impl Realization {
    /// In mm and N at the end of a lever arm; a linear realization is as it was.
    #[must_use]
    pub fn at_lever(mut self, lever_mm: f64) -> Self {
        let scale = self.units.at_lever(lever_mm);
        self.units = Units::Linear;
        self.rescale(scale);
        self
    }

    /// A linear realization at the end of a lever arm, in the units of a turning handle.
    #[must_use]
    pub fn turned(mut self, units: Units, lever_mm: f64) -> Self {
        let Scale { x, f, m } = units.at_lever(lever_mm);
        self.units = units;
        self.rescale(Scale {
            x: 1.0 / x,
            f: 1.0 / f,
            m: 1.0 / m,
        });
        self
    }

    fn rescale(&mut self, Scale { x, f, m }: Scale) {
        let by = |values: &mut [f64], factor: f64| values.iter_mut().for_each(|v| *v *= factor);
        by(&mut self.x_mm, x);
        by(&mut self.trained.x_mm, x);
        self.trained.v_mm_s *= x;
        self.direction = self.direction.scaled(x);
        for branch in [&mut self.positive, &mut self.negative] {
            by(&mut branch.m_kg, m);
            by(&mut branch.b_n_s_per_mm, f / x);
            by(&mut branch.k_n_per_mm, f / x);
            by(&mut branch.f0_n, f);
        }
        for length in [&mut self.provenance.dx_mm, &mut self.provenance.memory_mm] {
            *length = length.map(|mm| mm * x);
        }
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.rescale(Scale { x, f, m });
        }
        if let Some(elements) = &mut self.elements {
            elements.rescale(x, f, m);
        }
        if let Some(coverage) = &mut self.provenance.coverage {
            coverage.rescale(x);
        }
        for (name, known) in &mut self.provenance.terms {
            known.rescale(Scale { x, f, m }.of(name));
        }
    }
}

impl Mechanism {
    fn rescale(&mut self, Scale { x, f, m }: Scale) {
        let p = &mut self.scalars;
        *p = Scalars {
            handle_kg: p.handle_kg * m,
            follower_kg: p.follower_kg * m,
            contact_n_per_mm: p.contact_n_per_mm * f / x,
            contact_n_s_per_mm: p.contact_n_s_per_mm * f / x,
            gap_mm: p.gap_mm * x,
            follower_n_s_per_mm: p.follower_n_s_per_mm * f / x,
            slip_mm: p.slip_mm * x,
            stribeck: p.stribeck,
            stribeck_mm_s: p.stribeck_mm_s * x,
            handle_n: p.handle_n * f,
            handle_slip_mm: p.handle_slip_mm * x,
            handle_n_s_per_mm: p.handle_n_s_per_mm * f / x,
            offset_n: p.offset_n * f,
        };
        for profile in [&mut self.detent, &mut self.friction] {
            let Profile {
                first_mm,
                step_mm,
                n,
            } = profile;
            *first_mm *= x;
            *step_mm *= x;
            n.iter_mut().for_each(|n| *n *= f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::file::SCALAR_KEYS;
    use study_wire::mechanism::SCALARS;

    /// 20 N at 30 mm are 0.6 N·m, and 30 mm along the arc are 1 rad.
    #[test]
    fn lengths_and_forces_at_a_lever_arm() {
        assert!((Units::Radians.of_mm(30.0, 30.0) - 1.0).abs() < 1e-12);
        let degrees = Units::Degrees.of_mm(30.0, 30.0);
        assert!((degrees - 57.295_779_513).abs() < 1e-9, "{degrees}");
        assert!((Units::Degrees.of_n(20.0, 30.0) - 0.6).abs() < 1e-12);
        assert_eq!(Units::Linear.of_mm(3.0, 30.0), 3.0);
    }

    /// Every number of a mechanism is converted as the unit in its key says.
    #[test]
    fn a_mechanism_is_converted_by_the_units_of_its_keys() {
        let profile = Profile {
            first_mm: 1.0,
            step_mm: 1.0,
            n: vec![1.0; 2],
        };
        let mut mechanism = Mechanism {
            scalars: Scalars::from_array([1.0; SCALARS]),
            detent: profile.clone(),
            friction: profile,
            recorded_hz: None,
        };
        let (x, f, m) = (2.0, 3.0, 5.0);
        mechanism.rescale(Scale { x, f, m });
        for (key, found) in SCALAR_KEYS.iter().zip(mechanism.scalars.to_array()) {
            let expected = match key.split_once('_').map_or("", |(_, unit)| unit) {
                "kg" => m,
                "n_per_mm" | "n_s_per_mm" => f / x,
                "mm" | "mm_s" | "slip_mm" => x,
                "n" => f,
                "" => 1.0,
                other => panic!("{other}"),
            };
            assert_eq!(found, expected, "{key}");
        }
        assert_eq!((mechanism.detent.step_mm, mechanism.friction.n[0]), (x, f));
    }

    #[test]
    fn keys_name_their_units() {
        let deg = |key| Units::Degrees.key(key);
        assert_eq!(deg("x_mm"), "x_deg");
        assert_eq!(deg("v_mm_s"), "v_deg_s");
        assert_eq!(deg("m_kg"), "m_kg_m2");
        assert_eq!(deg("b_n_s_per_mm"), "b_nm_s_per_deg");
        assert_eq!(deg("contact_n_per_mm"), "contact_nm_per_deg");
        assert_eq!(deg("f0_n"), "f0_nm");
        assert_eq!(deg("n"), "nm");
        assert_eq!(Units::Radians.key("gap_mm"), "gap_rad");
        for key in ["stribeck", "filter", "rule", "recorded_hz", "lambda"] {
            assert_eq!(deg(key), key);
        }
        assert_eq!(Units::Linear.key("x_mm"), "x_mm");
    }
}
