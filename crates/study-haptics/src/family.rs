//! Families: one dimension of the stimulus, a table for each level.
//!
//! Write θ for all parameters of a table. The margins of the passivity certificate for
//! mass and hysteresis are linear in θ, that for damping is b minus a maximum of linear
//! functions. Each margin of a family whose tables are affine in the level is therefore
//! concave in the level, and its least value over a range is at an end of it: if both ends
//! pass, every level between them does, and the levels that pass are an interval. The same
//! holds for the force, stiffness and damping that a device is asked for, whose maxima are
//! convex.
//!
//! Conditions: tables of a blend have the same look-up and direction rule. Different nodes
//! are united, which changes nothing with a linear look-up; with others the parameters jump
//! at nodes, and such a blend is refused. Outside its nodes a table keeps the parameters of
//! its edge.

use crate::model::{Branch, Elements, Mechanism, Provenance, Realization, Trained};
use std::collections::BTreeMap;
use study_wire::elements::Spring;
use study_wire::predict::{Lookup, locate};

/// A family: a table, and what a level changes in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Family {
    from: Realization,
    vary: Vary,
}

/// What a level changes.
#[derive(Debug, Clone, PartialEq)]
pub enum Vary {
    /// (1 − t) times the table plus t times this one.
    Blend(Box<Realization>),
    /// The damping is multiplied by the level.
    Damping,
    /// The mass is multiplied by the level.
    Mass,
    /// The mean of the spring forces of both directions is multiplied by the level; half
    /// their difference, the hysteresis, stays.
    Elastic,
    /// Coulomb friction of this force, N, is added.
    Friction,
}

/// Why two tables cannot be blended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FamilyError {
    /// Different look-ups.
    #[error("the tables of a blend need the same look-up")]
    Lookup,
    /// Different direction rules.
    #[error("the tables of a blend need the same direction rule")]
    Direction,
    /// A model of a mechanism has no table that could be varied.
    #[error("a family varies a table, not a mechanism")]
    Mechanism,
    /// Elements of a blend, or without a stop to which friction could be added.
    #[error("elements are no end of a blend, and need a stop to which friction is added")]
    Elements,
    /// Nodes that differ where parameters jump at nodes.
    #[error("with the look-up `{0}` the tables of a blend need the same nodes")]
    Nodes(&'static str),
}

/// Which levels of a range pass the certificate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Passing {
    /// All.
    All,
    /// Those from the first to the second number, found to a millionth of the range.
    Between(f64, f64),
    /// None that was found.
    None,
}

impl Family {
    /// A family.
    ///
    /// # Errors
    /// [`FamilyError`] if the tables of a blend do not fit together.
    pub fn new(from: Realization, vary: Vary) -> Result<Self, FamilyError> {
        if from.mechanism.is_some() {
            return Err(FamilyError::Mechanism);
        }
        if let Some(elements) = &from.elements {
            let possible = match vary {
                Vary::Blend(_) => false,
                Vary::Friction => stop_of(elements).is_some(),
                Vary::Damping | Vary::Mass | Vary::Elastic => true,
            };
            if !possible {
                return Err(FamilyError::Elements);
            }
        }
        if let Vary::Blend(to) = &vary {
            if to.mechanism.is_some() {
                return Err(FamilyError::Mechanism);
            }
            if to.elements.is_some() {
                return Err(FamilyError::Elements);
            }
            if to.lookup != from.lookup {
                return Err(FamilyError::Lookup);
            }
            if to.direction != from.direction {
                return Err(FamilyError::Direction);
            }
            if to.x_mm != from.x_mm && from.lookup != Lookup::Linear {
                return Err(FamilyError::Nodes(from.lookup.as_str()));
            }
        }
        Ok(Self { from, vary })
    }

    /// The same of a mechanism, too: the detents with the constant force, the friction of the follower, both dampings, both masses.
    /// Its margins are not concave in the level, so that the ends of a range say nothing of what is between: for levels that are
    /// certified one by one, such as the points of a space.
    ///
    /// # Errors
    /// [`FamilyError`] as [`Family::new`], and of a blend with a mechanism.
    pub fn of_points(from: Realization, vary: Vary) -> Result<Self, FamilyError> {
        if from.mechanism.is_none() {
            return Self::new(from, vary);
        }
        if matches!(vary, Vary::Blend(_)) {
            return Err(FamilyError::Mechanism);
        }
        Ok(Self { from, vary })
    }

    /// The table of a level. It has the origin of the table that is varied, but no VAF.
    pub fn at(&self, level: f64) -> Realization {
        let scaled = |values: &[f64]| values.iter().map(|v| level * v).collect::<Vec<_>>();
        let from = Realization {
            vaf: BTreeMap::new(),
            provenance: Provenance {
                note: Some(format!("level {level} of a family from `{}`", self.from.id)),
                ..self.from.provenance.clone()
            },
            ..self.from.clone()
        };
        if let Some(elements) = &from.elements {
            let varied = elements_at(elements, &self.vary, level);
            let units = from.units;
            return Realization {
                units,
                ..Realization::of_elements(from.id, from.provenance, from.vaf, from.trained, varied)
            };
        }
        if let Some(mechanism) = &from.mechanism {
            let varied = mechanism_at(mechanism, &self.vary, level);
            let units = from.units;
            return Realization {
                units,
                ..Realization::of_mechanism(
                    from.id,
                    from.provenance,
                    from.vaf,
                    from.trained,
                    varied,
                )
            };
        }
        let (positive, negative) = (&from.positive, &from.negative);
        match &self.vary {
            Vary::Blend(to) => blend(&from, to, level),
            Vary::Damping => Realization {
                positive: Branch {
                    b_n_s_per_mm: scaled(&positive.b_n_s_per_mm),
                    ..positive.clone()
                },
                negative: Branch {
                    b_n_s_per_mm: scaled(&negative.b_n_s_per_mm),
                    ..negative.clone()
                },
                ..from
            },
            Vary::Mass => Realization {
                positive: Branch {
                    m_kg: scaled(&positive.m_kg),
                    ..positive.clone()
                },
                negative: Branch {
                    m_kg: scaled(&negative.m_kg),
                    ..negative.clone()
                },
                ..from
            },
            Vary::Elastic => {
                let k = elastic(&positive.k_n_per_mm, &negative.k_n_per_mm, level);
                let f0 = elastic(&positive.f0_n, &negative.f0_n, level);
                Realization {
                    positive: Branch {
                        k_n_per_mm: k.0,
                        f0_n: f0.0,
                        ..positive.clone()
                    },
                    negative: Branch {
                        k_n_per_mm: k.1,
                        f0_n: f0.1,
                        ..negative.clone()
                    },
                    ..from
                }
            }
            Vary::Friction => {
                let against = |branch: &Branch, sign: f64| Branch {
                    f0_n: branch.f0_n.iter().map(|f| f + sign * level).collect(),
                    ..branch.clone()
                };
                Realization {
                    positive: against(positive, 1.0),
                    negative: against(negative, -1.0),
                    ..from
                }
            }
        }
    }

    /// Which levels from `low` to `high` pass the certificate: all, if both ends do. The
    /// levels that pass are an interval; if neither end is in it, it is searched for at 64
    /// levels, and its ends by bisection.
    pub fn passing(&self, low: f64, high: f64) -> Passing {
        let passes = |level: f64| self.at(level).certificate().passes();
        if passes(low) && passes(high) {
            return Passing::All;
        }
        let at = |i: u32| low + (high - low) * f64::from(i) / 64.0;
        let Some(inside) = (0..=64).map(at).find(|level| passes(*level)) else {
            return Passing::None;
        };
        let end = |outside: f64| {
            if passes(outside) {
                return outside;
            }
            let (mut good, mut bad) = (inside, outside);
            while (good - bad).abs() > 1e-6 * (high - low) {
                let middle = 0.5 * (good + bad);
                if passes(middle) {
                    good = middle;
                } else {
                    bad = middle;
                }
            }
            good
        };
        Passing::Between(end(low), end(high))
    }
}

/// The first stop of elements.
fn stop_of(elements: &Elements) -> Option<usize> {
    (elements.springs.iter()).position(|spring| matches!(spring, Spring::Stop { .. }))
}

/// Elements of a level: all profiles are affine in it, and so are their margins.
fn elements_at(elements: &Elements, vary: &Vary, level: f64) -> Elements {
    let mut varied = elements.clone();
    let scale = |values: &mut Vec<f64>| values.iter_mut().for_each(|value| *value *= level);
    match vary {
        Vary::Blend(_) => {}
        Vary::Damping => varied.damping_n_s_per_mm.iter_mut().for_each(scale),
        Vary::Mass => varied.mass_kg *= level,
        Vary::Elastic => scale(&mut varied.force_n),
        Vary::Friction => {
            let stop = stop_of(elements).and_then(|stop| varied.spring_n.get_mut(stop));
            for value in stop.into_iter().flatten() {
                *value += level;
            }
        }
    }
    varied
}

/// A mechanism of a level.
fn mechanism_at(mechanism: &Mechanism, vary: &Vary, level: f64) -> Mechanism {
    let mut varied = mechanism.clone();
    let scalars = &mut varied.scalars;
    match vary {
        Vary::Blend(_) => {}
        Vary::Damping => {
            scalars.follower_n_s_per_mm *= level;
            scalars.handle_n_s_per_mm *= level;
        }
        Vary::Mass => {
            scalars.handle_kg *= level;
            scalars.follower_kg *= level;
        }
        Vary::Elastic => {
            scalars.offset_n *= level;
            varied.detent.n.iter_mut().for_each(|n| *n *= level);
        }
        Vary::Friction => varied.friction.n.iter_mut().for_each(|n| *n += level),
    }
    varied
}

/// Mean ± half the difference of two directions, with the mean times `s`.
fn elastic(positive: &[f64], negative: &[f64], s: f64) -> (Vec<f64>, Vec<f64>) {
    (positive.iter().zip(negative))
        .map(|(p, n)| {
            let (mean, half) = (0.5 * (p + n), 0.5 * (p - n));
            (s * mean + half, s * mean - half)
        })
        .unzip()
}

/// (1 − t) times one table plus t times the other, at the nodes of both.
fn blend(from: &Realization, to: &Realization, t: f64) -> Realization {
    let mut x_mm: Vec<f64> = from.x_mm.iter().chain(&to.x_mm).copied().collect();
    x_mm.sort_by(f64::total_cmp);
    x_mm.dedup();
    let branch = |a: &Branch, b: &Branch| {
        let parameter = |of: fn(&Branch) -> &Vec<f64>| {
            let value = |x: f64| {
                let (a, b) = (at(&from.x_mm, of(a), x), at(&to.x_mm, of(b), x));
                (1.0 - t) * a + t * b
            };
            x_mm.iter().map(|x| value(*x)).collect()
        };
        Branch {
            m_kg: parameter(|b| &b.m_kg),
            b_n_s_per_mm: parameter(|b| &b.b_n_s_per_mm),
            k_n_per_mm: parameter(|b| &b.k_n_per_mm),
            f0_n: parameter(|b| &b.f0_n),
        }
    };
    let (positive, negative) = (
        branch(&from.positive, &to.positive),
        branch(&from.negative, &to.negative),
    );
    // Identified only where both are, and certified for the faster of the two.
    let trained = Trained {
        x_mm: [
            from.trained.x_mm[0].max(to.trained.x_mm[0]),
            from.trained.x_mm[1].min(to.trained.x_mm[1]),
        ],
        v_mm_s: from.trained.v_mm_s.max(to.trained.v_mm_s),
    };
    let mut blend = Realization {
        trained,
        x_mm,
        positive,
        negative,
        ..from.clone()
    };
    // no recording is that of a blend
    blend.provenance.coverage = None;
    blend
}

/// The parameter at a position, interpolated; beyond the nodes that of the edge.
fn at(nodes: &[f64], values: &[f64], x: f64) -> f64 {
    match locate(nodes, Lookup::Linear, x) {
        (left, 0.0) => values[left],
        (left, weight) => values[left] + weight * (values[left + 1] - values[left]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use study_wire::predict::{Direction, Motion, force_n};

    fn table(values: &[f64], nodes: &[f64]) -> Realization {
        let n = nodes.len();
        let mut next = values.iter().cycle().copied();
        let mut branch = |shift: f64| Branch {
            m_kg: next.by_ref().take(n).map(|v| 0.1 * (v + 0.2)).collect(),
            b_n_s_per_mm: next.by_ref().take(n).map(|v| 0.01 * (v + 0.5)).collect(),
            k_n_per_mm: next.by_ref().take(n).map(|v| 0.3 * v).collect(),
            f0_n: next.by_ref().take(n).map(|v| 2.0 * v + shift).collect(),
        };
        Realization {
            id: "t".to_owned(),
            provenance: Provenance::default(),
            vaf: BTreeMap::from([("v".to_owned(), 0.9)]),
            lookup: Lookup::Linear,
            direction: Direction::Play { delta_mm: 0.5 },
            trained: Trained {
                x_mm: [nodes[0], nodes[n - 1]],
                v_mm_s: 120.0,
            },
            x_mm: nodes.to_vec(),
            mechanism: None,
            elements: None,
            units: crate::model::Units::Linear,
            positive: branch(2.0),
            negative: branch(-2.0),
        }
    }

    const NODES: [f64; 4] = [0.0, 1.0, 2.5, 4.0];

    fn all(values: &[f64]) -> Vec<Family> {
        let from = table(values, &NODES);
        let to = table(&values[1..], &[0.0, 0.7, 3.0, 4.0]);
        [
            Vary::Blend(Box::new(to)),
            Vary::Damping,
            Vary::Mass,
            Vary::Elastic,
            Vary::Friction,
        ]
        .map(|vary| Family::new(from.clone(), vary).unwrap())
        .to_vec()
    }

    /// Forces of a table in both directions at several motions.
    fn forces(table: &Realization) -> Vec<f64> {
        let motions = (0..24).map(|i| Motion {
            x_mm: f64::from(i) * 0.17,
            v_mm_s: 40.0 - f64::from(i) * 3.0,
            a_m_s2: f64::from(i % 5) - 2.0,
        });
        motions
            .flat_map(|m| [1.0, -1.0].map(|z| force_n(&table.table(), z, m)))
            .collect()
    }

    fn near(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    proptest! {
        /// The corner rule: no level has a smaller margin than the worse end. Where positions fail and
        /// windows of play do not, a certificate states the margin of windows, which is another number.
        #[test]
        fn the_least_margin_is_at_an_end(
            values in prop::collection::vec(-1.0f64..1.0, 33),
            along in 0.0f64..1.0,
        ) {
            for family in all(&values) {
                let margins = |level| {
                    let certificate = family.at(level).certificate_of_device();
                    certificate.conditions().map(|(_, margin)| margin.value)
                };
                let (low, high) = (margins(0.0), margins(1.0));
                for ((inside, low), high) in margins(along).iter().zip(low).zip(high) {
                    let bound = (1.0 - along) * low + along * high;
                    prop_assert!(*inside >= bound - 1e-9, "{:?} {along}", family.vary);
                }
            }
        }

        #[test]
        fn the_range_that_passes_is_the_whole_one_or_ends_where_it_fails(
            values in prop::collection::vec(-1.0f64..1.0, 33),
        ) {
            for family in all(&values) {
                let passes = |level: f64| family.at(level).certificate().passes();
                match family.passing(0.0, 1.0) {
                    Passing::All => prop_assert!((0..=20).all(|i| passes(f64::from(i) / 20.0))),
                    Passing::Between(low, high) => {
                        prop_assert!(passes(low) && passes(high));
                        prop_assert!(low == 0.0 || !passes(low - 1e-5));
                        prop_assert!(high == 1.0 || !passes(high + 1e-5));
                        prop_assert!(low > 0.0 || high < 1.0);
                    }
                    Passing::None => {
                        prop_assert!((0..=64).all(|i| !passes(f64::from(i) / 64.0)));
                    }
                }
            }
        }

        #[test]
        fn a_blend_has_the_weighted_force_at_every_place(
            values in prop::collection::vec(-1.0f64..1.0, 33),
            t in 0.0f64..1.0,
        ) {
            let blend = &all(&values)[0];
            let Vary::Blend(to) = &blend.vary else { unreachable!() };
            let (a, b) = (forces(&blend.from), forces(to));
            let mean: Vec<f64> = a.iter().zip(b).map(|(a, b)| (1.0 - t) * a + t * b).collect();
            prop_assert!(near(&forces(&blend.at(t)), &mean));
        }
    }

    #[test]
    fn level_one_of_a_scale_and_level_zero_of_a_sum_are_the_table_itself() {
        let values: Vec<f64> = (0..33).map(|i| (f64::from(i) * 0.7).sin()).collect();
        for family in all(&values) {
            let level = match family.vary {
                Vary::Blend(_) | Vary::Friction => 0.0,
                Vary::Damping | Vary::Mass | Vary::Elastic => 1.0,
            };
            assert!(near(&forces(&family.at(level)), &forces(&family.from)));
            assert!(family.at(level).vaf.is_empty());
        }
    }

    #[test]
    fn friction_opposes_the_motion_and_the_detent_keeps_the_hysteresis() {
        let values: Vec<f64> = (0..33).map(|i| (f64::from(i) * 0.7).cos()).collect();
        let families = all(&values);
        let rest = |table: &Realization, z| force_n(&table.table(), z, Motion::at_rest(1.3));
        let (base, rubbed) = (&families[4].from, families[4].at(0.75));
        assert!((rest(&rubbed, 1.0) - rest(base, 1.0) - 0.75).abs() < 1e-12);
        assert!((rest(&rubbed, -1.0) - rest(base, -1.0) + 0.75).abs() < 1e-12);
        let flat = families[3].at(0.0);
        let half = 0.5 * (rest(base, 1.0) - rest(base, -1.0));
        assert!((rest(&flat, 1.0) - half).abs() < 1e-12);
        assert!((rest(&flat, -1.0) + half).abs() < 1e-12);
    }

    #[test]
    fn tables_of_different_rules_or_jumping_nodes_are_not_blended() {
        let from = table(&[0.5], &NODES);
        let blend = |to: Realization| Family::new(from.clone(), Vary::Blend(Box::new(to)));
        let floor = |nodes: &[f64]| Realization {
            lookup: Lookup::Floor,
            ..table(&[0.5], nodes)
        };
        assert_eq!(blend(floor(&NODES)), Err(FamilyError::Lookup));
        let sign = Realization {
            direction: Direction::Sign,
            ..from.clone()
        };
        assert_eq!(blend(sign), Err(FamilyError::Direction));
        let other = Vary::Blend(Box::new(floor(&[0.0, 2.0, 4.0])));
        let refused = Family::new(floor(&NODES), other);
        assert_eq!(refused, Err(FamilyError::Nodes("floor")));
    }

    /// Elements are varied by their profiles, and what a hand feels in slow motion with them.
    #[test]
    fn elements_are_varied_by_their_profiles() {
        let elements = Elements {
            mass_kg: 0.1,
            x_mm: NODES.to_vec(),
            force_n: vec![1.0, -2.0, 0.5, 3.0],
            damping_n_s_per_mm: [vec![0.01; 4], vec![0.02; 4]],
            springs: vec![Spring::Stop { slip_mm: 0.2 }],
            spring_n: vec![vec![0.5, 0.0, 1.0, 0.5]],
        };
        let table = table(&[0.1; 16], &NODES);
        let trained = table.trained;
        let of = |elements: &Elements| {
            let (provenance, vaf) = (Provenance::default(), BTreeMap::new());
            let own = elements.clone();
            Realization::of_elements("e".to_owned(), provenance, vaf, trained, own)
        };
        let from = of(&elements);
        let at = |vary: Vary, level: f64| Family::new(from.clone(), vary).unwrap().at(level);
        let damped = at(Vary::Damping, 3.0);
        assert_eq!(damped.negative.b_n_s_per_mm, [0.06; 4]);
        assert_eq!(at(Vary::Mass, 2.0).elements.unwrap().mass_kg, 0.2);
        // C ± D: the mean is scaled, the hysteresis stays
        let elastic = at(Vary::Elastic, 2.0);
        assert_eq!(elastic.positive.f0_n, [2.5, -4.0, 2.0, 6.5]);
        assert_eq!(elastic.negative.f0_n, [1.5, -4.0, 0.0, 5.5]);
        let rough = at(Vary::Friction, 0.25);
        assert_eq!(
            rough.elements.unwrap().spring_n[0],
            [0.75, 0.25, 1.25, 0.75]
        );
        // less friction than there is
        let family = Family::new(from.clone(), Vary::Friction).unwrap();
        assert_eq!(family.passing(0.0, 1.0), Passing::All);
        assert!(matches!(family.passing(-1.0, 1.0), Passing::Between(low, _) if low.abs() < 1e-5));
        let blend = Vary::Blend(Box::new(table.clone()));
        assert_eq!(Family::new(from.clone(), blend), Err(FamilyError::Elements));
        let blend = Vary::Blend(Box::new(from));
        assert_eq!(Family::new(table, blend), Err(FamilyError::Elements));
        let free = of(&Elements {
            springs: Vec::new(),
            spring_n: Vec::new(),
            ..elements
        });
        assert_eq!(
            Family::new(free, Vary::Friction),
            Err(FamilyError::Elements)
        );
    }
}
