//! What a target is made of.

/// A valley or a crest of the cam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Well {
    /// Where, mm of the follower's path.
    pub at_mm: f64,
    /// How wide the turn of the slope is, mm. Small is crisp.
    pub width_mm: f64,
}

/// Every parameter of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Where the follower rests.
    pub valleys: Vec<Well>,
    /// Between the valleys.
    pub crests: Vec<Well>,
    /// Slope of the cam's flanks, 1.
    pub slope: f64,
    /// Force of the follower's spring in the reference valley, N.
    pub preload_n: f64,
    /// Position where the spring has its preload, mm.
    pub preload_at_mm: f64,
    /// Stiffness of the follower's spring, N/mm.
    pub spring_n_per_mm: f64,
    /// Amplitude of the surface ripple, N.
    pub ripple_n: f64,
    /// Wavelength of the surface ripple, mm.
    pub ripple_mm: f64,
    /// Coulomb coefficient between follower and cam.
    pub friction: f64,
    /// How much more than Coulomb friction breaks loose, share.
    pub stribeck: f64,
    /// Speed at which that has mostly gone, mm/s.
    pub stribeck_mm_s: f64,
    /// Elastic slip before the follower moves, mm.
    pub presliding_mm: f64,
    /// Damping of the elastic slip, N·s/m.
    pub bristle_n_s_per_m: f64,
    /// Viscous friction of the follower, N·s/m.
    pub follower_n_s_per_m: f64,
    /// Dahl friction of the pivot, N.
    pub pivot_n: f64,
    /// Viscous friction of the pivot, N·s/m.
    pub pivot_n_s_per_m: f64,
    /// Mass ahead of the backlash, kg.
    pub handle_kg: f64,
    /// Mass of lever and follower behind it, kg.
    pub follower_kg: f64,
    /// Free play between the two, mm.
    pub backlash_mm: f64,
    /// Stiffness of the contact on either side of it, N/mm.
    pub contact_n_per_mm: f64,
    /// Damping of the contact, N·s/m.
    pub contact_n_s_per_m: f64,
    /// Lower and upper end stop of the handle, mm.
    pub stops_mm: [f64; 2],
    /// Stiffness of the end stops, N/mm.
    pub stop_n_per_mm: f64,
    /// Damping of the end stops, N·s/m.
    pub stop_n_s_per_m: f64,
}

/// Why a set of parameters is no target.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("a target's {what} has to be {must}")]
pub struct BadPlant {
    what: &'static str,
    must: &'static str,
}

impl Parameters {
    /// Switch A: a smooth cam. Largest static force over the stroke 8.86 N.
    pub fn a() -> Self {
        let well = |at_mm, width_mm| Well { at_mm, width_mm };
        Self {
            valleys: vec![well(5.0, 1.5), well(17.5, 1.3), well(30.0, 1.5)],
            crests: vec![well(11.25, 1.4), well(23.9, 1.2)],
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

    /// Switch B: a sharp cam with a rippled surface. Largest static force 8.69 N;
    /// `docs/simulation.md` says where that differs from its description.
    pub fn b() -> Self {
        let mut b = Self::a();
        for well in b.valleys.iter_mut().chain(&mut b.crests) {
            well.width_mm *= 0.3;
        }
        Self {
            slope: 0.40,
            ripple_n: 0.8,
            ..b
        }
    }

    /// The built-in target of that name, `a` or `b` in either case.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "a" | "A" => Some(Self::a()),
            "b" | "B" => Some(Self::b()),
            _ => None,
        }
    }

    /// Checks that the parameters describe something that can be simulated.
    ///
    /// # Errors
    /// [`BadPlant`] for the first that does not: a number that is not finite, a
    /// mass, width or length that is not positive, a friction below zero, stops
    /// upside down.
    pub fn check(&self) -> Result<(), BadPlant> {
        let require = |good: bool, what, must| {
            if good {
                Ok(())
            } else {
                Err(BadPlant { what, must })
            }
        };
        for (what, value) in [
            ("follower mass", self.follower_kg),
            ("presliding", self.presliding_mm),
            ("Stribeck speed", self.stribeck_mm_s),
            ("ripple wavelength", self.ripple_mm),
            ("preload", self.preload_n),
            ("contact stiffness", self.contact_n_per_mm),
        ] {
            require(
                value.is_finite() && value > 0.0,
                what,
                "finite and above zero",
            )?;
        }
        for (what, value) in [
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
            require(
                value.is_finite() && value >= 0.0,
                what,
                "finite and not negative",
            )?;
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
        let wells = || self.valleys.iter().chain(&self.crests);
        require(
            wells().all(|w| w.at_mm.is_finite() && w.width_mm.is_finite() && w.width_mm > 0.0),
            "valleys and crests",
            "at finite places, with widths above zero",
        )?;
        require(!self.valleys.is_empty(), "cam", "given at least one valley")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_that_is_no_number_is_refused_by_name() {
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
