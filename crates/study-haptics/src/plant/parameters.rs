//! The parameters of a target.

/// A valley or a crest of the cam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremum {
    /// Position along the follower's path, mm.
    pub at_mm: f64,
    /// Width over which the slope changes sign, mm; smaller is sharper.
    pub width_mm: f64,
}

/// The parameters of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Valleys of the cam, where the follower rests.
    pub valleys: Vec<Extremum>,
    /// Crests of the cam, between the valleys.
    pub crests: Vec<Extremum>,
    /// Slope of the cam's flanks, dimensionless.
    pub slope: f64,
    /// Force of the follower's spring in the reference valley, N.
    pub preload_n: f64,
    /// Position at which the spring has its preload, mm.
    pub preload_at_mm: f64,
    /// Stiffness of the follower's spring, N/mm.
    pub spring_n_per_mm: f64,
    /// Amplitude of the surface ripple, N.
    pub ripple_n: f64,
    /// Wavelength of the surface ripple, mm.
    pub ripple_mm: f64,
    /// Coefficient of Coulomb friction between follower and cam.
    pub friction: f64,
    /// Breakaway friction in excess of Coulomb friction, as a share of it.
    pub stribeck: f64,
    /// Stribeck speed, at which the excess has mostly vanished, mm/s.
    pub stribeck_mm_s: f64,
    /// Presliding displacement before the follower slips, mm.
    pub presliding_mm: f64,
    /// Damping of the presliding displacement, N·s/m.
    pub bristle_n_s_per_m: f64,
    /// Viscous friction of the follower, N·s/m.
    pub follower_n_s_per_m: f64,
    /// Dahl friction of the pivot, N.
    pub pivot_n: f64,
    /// Viscous friction of the pivot, N·s/m.
    pub pivot_n_s_per_m: f64,
    /// Mass of the handle, before the backlash, kg.
    pub handle_kg: f64,
    /// Mass of lever and follower, behind the backlash, kg.
    pub follower_kg: f64,
    /// Backlash between handle and follower, mm.
    pub backlash_mm: f64,
    /// Stiffness of the contact at either end of the backlash, N/mm.
    pub contact_n_per_mm: f64,
    /// Damping of this contact, N·s/m.
    pub contact_n_s_per_m: f64,
    /// Lower and upper end stop of the handle, mm.
    pub stops_mm: [f64; 2],
    /// Stiffness of the end stops, N/mm.
    pub stop_n_per_mm: f64,
    /// Damping of the end stops, N·s/m.
    pub stop_n_s_per_m: f64,
}

/// A parameter with which a target cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("a target's {parameter} has to be {requirement}")]
pub struct PlantError {
    parameter: &'static str,
    requirement: &'static str,
}

impl Parameters {
    /// Switch A: a smooth cam. Largest static force over the stroke 8.86 N.
    pub fn a() -> Self {
        let at = |at_mm, width_mm| Extremum { at_mm, width_mm };
        Self {
            valleys: vec![at(5.0, 1.5), at(17.5, 1.3), at(30.0, 1.5)],
            crests: vec![at(11.25, 1.4), at(23.9, 1.2)],
            slope: 0.478,
            preload_n: 13.5,
            preload_at_mm: 17.5,
            spring_n_per_mm: 0.6,
            ripple_n: 0.0,
            ripple_mm: 0.9,
            friction: 0.09,
            stribeck: 0.35,
            stribeck_mm_s: 8.0,
            presliding_mm: 0.06,
            bristle_n_s_per_m: 4.0,
            follower_n_s_per_m: 6.0,
            pivot_n: 0.25,
            pivot_n_s_per_m: 1.0,
            handle_kg: 0.10,
            follower_kg: 0.14,
            backlash_mm: 0.8,
            contact_n_per_mm: 15.0,
            contact_n_s_per_m: 12.0,
            stops_mm: [0.0, 35.0],
            stop_n_per_mm: 60.0,
            stop_n_s_per_m: 60.0,
        }
    }

    /// Switch B: a sharp cam with a rippled surface. Largest static force 8.69 N, which
    /// differs from the description of the switch, see `docs/simulation.md`.
    pub fn b() -> Self {
        let mut b = Self::a();
        for extremum in b.valleys.iter_mut().chain(&mut b.crests) {
            extremum.width_mm *= 0.3;
        }
        Self {
            slope: 0.40,
            ripple_n: 0.8,
            ..b
        }
    }

    /// The built-in target with this name, `a` or `b` in either case.
    ///
    /// ```
    /// # use study_haptics::plant::Parameters;
    /// assert_eq!(Parameters::named("a"), Some(Parameters::a()));
    /// assert!(Parameters::named("z").is_none());
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "a" | "A" => Some(Self::a()),
            "b" | "B" => Some(Self::b()),
            _ => None,
        }
    }

    /// Checks that the target can be simulated.
    ///
    /// # Errors
    /// [`PlantError`] for the first parameter that is out of range, such as a number that
    /// is not finite, a mass or length that is not positive, or stops in the wrong order.
    pub fn check(&self) -> Result<(), PlantError> {
        let require = |satisfied: bool, parameter, requirement| match satisfied {
            true => Ok(()),
            false => Err(PlantError {
                parameter,
                requirement,
            }),
        };
        for (parameter, value) in [
            ("follower mass", self.follower_kg),
            ("presliding", self.presliding_mm),
            ("Stribeck speed", self.stribeck_mm_s),
            ("ripple wavelength", self.ripple_mm),
            ("preload", self.preload_n),
            ("contact stiffness", self.contact_n_per_mm),
        ] {
            let good = value.is_finite() && value > 0.0;
            require(good, parameter, "finite and above zero")?;
        }
        for (parameter, value) in [
            ("handle mass", self.handle_kg),
            ("spring stiffness", self.spring_n_per_mm),
            ("ripple", self.ripple_n),
            ("friction", self.friction),
            ("Stribeck share", self.stribeck),
            ("bristle damping", self.bristle_n_s_per_m),
            ("follower damping", self.follower_n_s_per_m),
            ("pivot friction", self.pivot_n),
            ("pivot damping", self.pivot_n_s_per_m),
            ("backlash", self.backlash_mm),
            ("contact damping", self.contact_n_s_per_m),
            ("stop stiffness", self.stop_n_per_mm),
            ("stop damping", self.stop_n_s_per_m),
        ] {
            let good = value.is_finite() && value >= 0.0;
            require(good, parameter, "finite and not negative")?;
        }
        require(
            self.slope.is_finite() && self.preload_at_mm.is_finite(),
            "cam slope and preload position",
            "finite",
        )?;
        require(
            self.stops_mm.iter().all(|s| s.is_finite()) && self.stops_mm[0] < self.stops_mm[1],
            "end stops",
            "finite, the lower first",
        )?;
        let extrema = || self.valleys.iter().chain(&self.crests);
        require(
            extrema().all(|w| w.at_mm.is_finite() && w.width_mm.is_finite() && w.width_mm > 0.0),
            "valleys and crests",
            "at finite positions, with widths above zero",
        )?;
        require(!self.valleys.is_empty(), "cam", "given at least one valley")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_that_is_not_finite_is_refused_by_name() {
        let mut plant = Parameters::a();
        plant.friction = f64::NAN;
        assert_eq!(
            plant.check().unwrap_err().to_string(),
            "a target's friction has to be finite and not negative"
        );
        assert!(Parameters::named("c").is_none());
        for name in ["a", "B"] {
            assert!(Parameters::named(name).unwrap().check().is_ok());
        }
    }
}
