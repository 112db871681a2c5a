//! What is known without simulation, and the search for the smallest design.

use super::{Cell, CellResult, Link, Scale, Settings, Vaf};
use study_base::sort::SmallSort as _;
use study_stats::level;
use study_stats::permutation;
use study_stats::power::covariate::{Design, Expected, Spread, Values};

/// Standard deviation of the standard logistic distribution, π/√3.
pub(super) const LOGISTIC_SD: f64 = 1.813_799_364_234_217_8;

/// The design of a cell under the assumptions. For an ordered scale it is that of the
/// latent values.
pub fn design(settings: &Settings, cell: &Cell) -> Design {
    let a = &settings.assumptions;
    let residual = match &a.scale {
        Scale::Ordinal {
            link: Link::Logit, ..
        } => LOGISTIC_SD,
        _ => a.spread.residual,
    };
    Design {
        slope: a.slope,
        spread: Spread {
            residual,
            ..a.spread
        },
        subjects: Some(cell.participants),
        realizations: cell.realizations,
        repetitions: cell.repetitions,
        values: match a.vaf {
            Vaf::Drawn => Values::Drawn,
            Vaf::Listed | Vaf::Spread => Values::Fixed,
        },
    }
}

/// Power of Pearson's t test in closed form, without losses. `None` for fewer than three
/// realizations, where nothing varies, and for parts.
pub fn closed(settings: &Settings, cell: &Cell) -> Option<Expected> {
    if settings.part.is_some() {
        return None;
    }
    design(settings, cell).expected(settings.alpha)
}

/// The smallest p of the permutation test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// The smallest p that any ratings could have.
    pub smallest_p: f64,
    /// Whether the test can reject at the level of significance.
    pub can_reject: bool,
}

/// The floor of the permutation test with these VAF. `None` if VAF are drawn, do not vary,
/// or are fewer than three.
///
/// ```
/// # use study_analysis::power::floor;
/// // Five realizations: 5! orders, of which one is the most extreme.
/// let floor = floor(&[55.0, 70.0, 80.0, 90.0, 96.0], 0.05).unwrap();
/// assert_eq!((floor.smallest_p, floor.can_reject), (1.0 / 120.0, true));
/// ```
pub fn floor(vaf: &[f64], alpha: f64) -> Option<Floor> {
    let smallest_p = permutation::floor(vaf)?;
    Some(Floor {
        smallest_p,
        can_reject: level::rejects(smallest_p, alpha),
    })
}

/// How many participants reach a target.
#[derive(Debug, Clone, PartialEq)]
pub enum Reach {
    /// The fewest participants whose simulated power is at the target; `sure` if the lower
    /// end of its interval is.
    Participants {
        /// Their number.
        participants: usize,
        /// Simulated power.
        power: f64,
        /// Whether the interval of the power is above the target.
        sure: bool,
    },
    /// More than the closed form takes for enough.
    MoreThan {
        /// The most that were simulated around that number, and were too few.
        participants: usize,
        /// The fewest of the other simulated designs with the target.
        enough: Option<usize>,
    },
    /// No number of participants: the power with endlessly many.
    Ceiling(f64),
    /// None up to the largest number that is considered, although the ceiling is higher.
    Limit(usize),
    /// The permutation test has no p at or below the level.
    NoSmallP(f64),
}

/// The smallest design of some realizations and repetitions.
#[derive(Debug, Clone, PartialEq)]
pub struct Smallest {
    /// Target power.
    pub target: f64,
    /// Realizations.
    pub realizations: usize,
    /// Repetitions.
    pub repetitions: usize,
    /// How many participants it takes.
    pub reach: Reach,
}

/// What the closed form says of a target: the fewest participants, or why there are none.
pub fn reach(settings: &Settings, q: usize, r: usize, target: f64, most: usize) -> Option<Reach> {
    if let Some(floor) = floor(&settings.vaf(q), settings.alpha)
        && !floor.can_reject
    {
        return Some(Reach::NoSmallP(floor.smallest_p));
    }
    let cell = Cell {
        realizations: q,
        repetitions: r,
        participants: 2,
    };
    let design = design(settings, &cell);
    let ceiling = design.ceiling(settings.alpha)?;
    if ceiling < target {
        return Some(Reach::Ceiling(ceiling));
    }
    Some(
        match design.least_subjects(target, settings.alpha, 2..=most) {
            Some(n) => Reach::Participants {
                participants: n,
                power: target,
                sure: false,
            },
            None => Reach::Limit(most),
        },
    )
}

/// The cells that have to be simulated to decide the smallest designs: the closed form's
/// number of participants, one fewer and one more.
pub fn candidates(
    settings: &Settings,
    shapes: &[(usize, usize)],
    targets: &[f64],
    most: usize,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    for &(realizations, repetitions) in shapes {
        for &target in targets {
            let found = reach(settings, realizations, repetitions, target, most);
            if let Some(Reach::Participants { participants, .. }) = found {
                let around = (participants - 1).max(2)..=participants + 1;
                cells.extend(around.map(|participants| Cell {
                    realizations,
                    repetitions,
                    participants,
                }));
            }
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// The smallest designs, decided by the simulated power of the first test.
pub fn smallest(
    settings: &Settings,
    results: &[CellResult],
    shapes: &[(usize, usize)],
    targets: &[f64],
    most: usize,
) -> Vec<Smallest> {
    let mut found = Vec::new();
    for &target in targets {
        for &(realizations, repetitions) in shapes {
            let Some(mut reach) = reach(settings, realizations, repetitions, target, most) else {
                continue;
            };
            if let Reach::Participants { participants, .. } = reach {
                let own = |r: &&CellResult| {
                    (r.cell.realizations, r.cell.repetitions) == (realizations, repetitions)
                        && r.cell.participants + 1 >= participants
                };
                // Without simulation the closed form decides.
                let mut near: Vec<&CellResult> = results.iter().filter(own).collect();
                near.small_sort_by_key(|r| r.cell.participants);
                let enough = |r: &&CellResult| r.tests.first().is_some_and(|t| t.power >= target);
                let found = near.into_iter().find(enough);
                let first = found.filter(|r| r.cell.participants <= participants + 1);
                reach = match first.and_then(|r| Some((r.cell.participants, r.tests.first()?))) {
                    Some((participants, test)) => Reach::Participants {
                        participants,
                        power: test.power,
                        sure: test.interval.0 >= target,
                    },
                    None if results.is_empty() => reach,
                    None => Reach::MoreThan {
                        participants: participants + 1,
                        enough: found.map(|r| r.cell.participants),
                    },
                };
            }
            found.push(Smallest {
                target,
                realizations,
                repetitions,
                reach,
            });
        }
    }
    found
}
