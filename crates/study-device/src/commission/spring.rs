//! The realizations of a commissioning: no force, and a virtual spring.

use crate::table::both_ways;
use study_base::limits::{BadLimit, Limits};
use study_haptics::model::{Realization, Trained};

/// Most travel from the rest, mm, and as a share of the stroke.
const MOST_REACH_MM: f64 = 15.0;
const MOST_REACH: f64 = 0.2;
/// Least distance of the rest from a stop, in reaches.
const CLEARANCE: f64 = 1.3;
/// The spring reaches its largest force at this share of the reach.
const ELASTIC: f64 = 0.85;
/// A handle of this mass is damped so that it does not swing, kg.
const MASS_KG: f64 = 0.2;
/// Damping over critical damping of such a handle.
const DAMPING: f64 = 0.7;
/// A free handle stays below this share of the velocity limit.
const SPEED: f64 = 0.9;

/// A force to be weighed and the limits of its playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// The force, N.
    pub force_n: f64,
    /// Force limit: a device that gives too little shows it below this.
    pub limit_n: f64,
    /// Velocity limit, mm/s.
    pub velocity_mm_s: f64,
}

/// The three forces for a device, from low to high. `largest_n` is the largest one.
pub fn stages(largest_n: f64, device: Limits) -> [Stage; 3] {
    let cap_n = device.force_n.get();
    [(0.125, 2.2, 150.0), (0.5, 1.6, 250.0), (1.0, 1.25, 400.0)].map(
        |(share, above, velocity_mm_s)| Stage {
            force_n: share * largest_n,
            limit_n: (above * share * largest_n).min(cap_n),
            velocity_mm_s: device.velocity_mm_s.get().min(velocity_mm_s),
        },
    )
}

/// Why there is no room for a motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the handle is at {at_mm:.1} mm; bring it between {from_mm:.1} and {to_mm:.1} mm")]
pub struct NoRoom {
    /// Where it is, mm.
    pub at_mm: f64,
    /// Where it has to be, mm.
    pub from_mm: f64,
    /// See `from_mm`.
    pub to_mm: f64,
}

/// A spring whose force does not grow beyond a limit, the same in both directions of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VirtualSpring {
    /// Where it rests, mm.
    pub rest_mm: f64,
    /// Stiffness, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Damping, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Largest elastic force, N.
    pub force_n: f64,
    /// The device goes limp somewhat beyond this distance from the rest, mm.
    pub reach_mm: f64,
    /// The device goes limp above this speed, mm/s.
    pub velocity_mm_s: f64,
}

impl VirtualSpring {
    /// A spring for a stage, at rest where the handle is, between the stops of a device.
    ///
    /// # Errors
    /// [`NoRoom`] if the handle is too near to a stop.
    pub fn for_stage(stage: Stage, at_mm: f64, stroke_mm: [f64; 2]) -> Result<Self, NoRoom> {
        let [low, high] = stroke_mm;
        let reach_mm = MOST_REACH_MM.min(MOST_REACH * (high - low));
        let (from_mm, to_mm) = (low + CLEARANCE * reach_mm, high - CLEARANCE * reach_mm);
        if !(from_mm..=to_mm).contains(&at_mm) {
            return Err(NoRoom {
                at_mm,
                from_mm,
                to_mm,
            });
        }
        let stiffness_n_per_mm = stage.limit_n / (ELASTIC * reach_mm);
        let critical = 2e-3 * (1e3 * stiffness_n_per_mm * MASS_KG).sqrt();
        // Pushed by a force F, a handle from rest never passes F/b.
        let slow = stage.limit_n / (SPEED * stage.velocity_mm_s);
        Ok(Self {
            rest_mm: at_mm,
            stiffness_n_per_mm,
            damping_n_s_per_mm: slow.max(DAMPING * critical),
            force_n: stage.limit_n,
            reach_mm,
            velocity_mm_s: stage.velocity_mm_s,
        })
    }

    /// The force of a handle that rests at a place, which the hand applies, N.
    pub fn force_at(&self, x_mm: f64) -> f64 {
        let elastic_n = self.stiffness_n_per_mm * (x_mm - self.rest_mm);
        elastic_n.clamp(-self.force_n, self.force_n)
    }

    /// The limits of its playback.
    ///
    /// # Errors
    /// [`BadLimit`] for a force or a speed that is none.
    pub fn limits(&self) -> Result<Limits, BadLimit> {
        Limits::new(self.force_n, self.velocity_mm_s)
    }

    /// The table.
    pub fn table(&self) -> Realization {
        let elastic_mm = self.force_n / self.stiffness_n_per_mm;
        let reach_mm = self.reach_mm.max(elastic_mm);
        let mut places = vec![-reach_mm, -elastic_mm, elastic_mm, reach_mm];
        places.dedup_by(|b, a| *b - *a < 1e-6);
        let force_n =
            |place: &f64| (self.stiffness_n_per_mm * place).clamp(-self.force_n, self.force_n);
        table_of(
            "spring",
            places.iter().map(|place| self.rest_mm + place).collect(),
            places.iter().map(force_n).collect(),
            vec![self.damping_n_s_per_mm; places.len()],
            [self.rest_mm - self.reach_mm, self.rest_mm + self.reach_mm],
        )
    }
}

/// A table without force over a range, to read where the handle is.
pub fn force_free(range_mm: [f64; 2]) -> Realization {
    table_of(
        "none",
        range_mm.to_vec(),
        vec![0.0; 2],
        vec![0.0; 2],
        range_mm,
    )
}

/// A table of forces and damping at places, the same in both directions.
pub(super) fn table_of(
    id: &str,
    x_mm: Vec<f64>,
    f0_n: Vec<f64>,
    b_n_s_per_mm: Vec<f64>,
    range_mm: [f64; 2],
) -> Realization {
    let trained = Trained {
        x_mm: range_mm,
        v_mm_s: 1000.0,
    };
    both_ways(id, x_mm, (f0_n, b_n_s_per_mm), trained)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table;

    fn all() -> Vec<VirtualSpring> {
        let mut all = Vec::new();
        for (limit_n, stroke_mm) in [
            (15.0, [-20.0, 60.0]),
            (0.6, [0.0, 4.0]),
            (40.0, [-5.0, 300.0]),
        ] {
            let device = Limits::new(limit_n, 900.0).unwrap();
            let middle_mm = 0.5 * (stroke_mm[0] + stroke_mm[1]);
            for stage in stages(0.8 * limit_n, device) {
                assert!(stage.force_n < stage.limit_n && stage.limit_n <= limit_n);
                all.push(VirtualSpring::for_stage(stage, middle_mm, stroke_mm).unwrap());
            }
        }
        all
    }

    #[test]
    fn every_spring_is_a_valid_table_that_passes_its_certificate() {
        for spring in all() {
            let made = spring.table();
            table::check(&made).unwrap();
            assert!(
                made.certificate().passes(),
                "{spring:?}: {}",
                made.certificate()
            );
            let b = spring.damping_n_s_per_mm;
            assert!(spring.force_n / b <= spring.velocity_mm_s, "{spring:?}");
        }
    }

    #[test]
    fn near_a_stop_there_is_no_room() {
        let device = Limits::new(15.0, 1000.0).unwrap();
        let [low, ..] = stages(12.0, device);
        for at_mm in [-20.0, -1.0, 41.0, 60.0, f64::NAN] {
            let error = VirtualSpring::for_stage(low, at_mm, [-20.0, 60.0]).unwrap_err();
            assert!(
                error.to_string().contains("between -0.5 and 40.5 mm"),
                "{error}"
            );
        }
    }
}
