//! `[[spaces]]`: several dimensions of the stimulus at once.

use crate::procedure::search::Acquire;
use crate::procedure::search::{MAX_POINTS, MAX_TRIALS};
use crate::procedure::{Choose, Ladder, Lattice, SearchRule};
use crate::protocol::Vary;
use crate::protocol::keys::{Id, Key, Kind, Shape, Variants, Word, Words, keys};
use crate::protocol::section::{Section, Variant, shapes};
use crate::protocol::spaces::{Axis, SpaceRules};
use study_base::diagnostic::Fault;

pub(super) const SPACES: &[Key] = keys! {
    /// The name of the space. Its points are the realizations `id.1`, `id.2` and so on.
    "id": Kind::Id(Id::Part), r#""switch""#, required;
    /// The model file that is varied.
    "from": Kind::Path, r#""models/passive.toml""#, required;
    /// What varies, one axis or more, each from its lowest to its highest level. Every point that passes the passivity
    /// certificate and needs no more force than `device.limits` can be presented; `study check` refuses a space of which too
    /// few can, or which they divide.
    "axes": Kind::Table(AXES), "{ detent = [0.5, 1.5], friction = [0.0, 1.5] }", required;
    /// The number of levels of each axis, at equal differences. There are at most 999 points.
    "grid": Kind::Whole(2, 999), "5", default("9");
};

/// In the order of the axes of a lattice, whatever the order in the file.
const AXES: &[Key] = keys! {
    /// The elastic force (the mean of both directions), multiplied by the level: the strength of the detents.
    "detent": Kind::NumberList, "[0.5, 1.5]";
    /// Coulomb friction, added: the level in N against the motion.
    "friction": Kind::NumberList, "[0.0, 1.5]";
    /// The damping, multiplied by the level.
    "b": Kind::NumberList, "[0.0, 3.0]";
    /// The mass, multiplied by the level.
    "mass": Kind::NumberList, "[0.5, 2.0]";
};

const VARIED: [Vary; 4] = [Vary::Detent, Vary::Friction, Vary::Damping, Vary::Mass];

/// Most points: the name of one has at most three digits after its dot.
const MOST: usize = MAX_POINTS - 1;

/// A space that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialSpace {
    /// Such as `spaces[0]`.
    pub(super) path: String,
    /// The file that it names.
    pub(super) file: Option<String>,
    /// The space, if it has no fault.
    pub(super) space: Option<SpaceRules>,
}

pub(super) fn read(mut section: Section<'_, '_>) -> PartialSpace {
    let (id, from) = (section.part_id("id"), section.path_of("from"));
    let grid: Option<usize> = section.whole::<u32>("grid").map(|n| n as usize);
    let axes = match section.value("axes") {
        None => None,
        Some(_) => section
            .section("axes")
            .and_then(|axes| read_axes(axes, grid)),
    };
    let lattice = axes.as_ref().and_then(|axes| {
        let points = axes.iter().map(|axis| axis.levels.levels().len());
        let points = points.fold(1usize, usize::saturating_mul);
        if points > MOST {
            let what = format!("the space has {points} points; at most {MOST} are possible");
            let fault = Fault::error(what).hint("take a smaller `grid`, or fewer axes");
            section.fault_at("grid", fault);
            return None;
        }
        let steps = axes.iter().map(|axis| axis.levels.levels().len());
        match Lattice::new(steps.collect(), |_| true) {
            Ok(lattice) => Some(lattice),
            Err(why) => {
                section.fault_at("axes", Fault::error(why.to_string()));
                None
            }
        }
    });
    PartialSpace {
        path: section.path().to_owned(),
        file: from.clone(),
        space: (|| {
            Some(SpaceRules {
                id: id?,
                from: from?,
                axes: axes?,
                lattice: lattice?,
            })
        })(),
    }
}

/// `None` if one of them has a fault.
fn read_axes(mut section: Section<'_, '_>, grid: Option<usize>) -> Option<Vec<Axis>> {
    let mut axes = Vec::new();
    let mut good = true;
    for (key, vary) in AXES.iter().zip(VARIED) {
        if section.value(key.name).is_none() {
            continue;
        }
        let axis = section.numbers(key.name).and_then(|range| {
            let least = if vary == Vary::Detent {
                f64::NEG_INFINITY
            } else {
                0.0
            };
            let wrong = match range[..] {
                [low, high] if low >= high => format!("does not rise: {low} to {high}"),
                [low, _] if low < least => format!("has to begin at 0 or more, not at {low}"),
                [low, high] => return Some(levels(low, high, grid?)),
                _ => "has to be two numbers, the lowest and the highest level".to_owned(),
            };
            let what = format!("`{}.{}` {wrong}", section.path(), key.name);
            let hint = format!("such as {} = {}", key.name, key.example);
            section.fault_at(key.name, Fault::error(what).hint(hint));
            None
        });
        match axis.flatten() {
            Some(levels) => axes.push(Axis { vary, levels }),
            None => good = false,
        }
    }
    if axes.is_empty() && good {
        let names: Vec<&str> = AXES.iter().map(|key| key.name).collect();
        let what = format!("`{}` has no axis", section.path());
        let hint = format!("one of {}, such as detent = [0.5, 1.5]", names.join(", "));
        section.fault_at_path(section.path(), Fault::error(what).hint(hint));
        return None;
    }
    good.then_some(axes)
}

/// Levels to twelve digits, as those of families.
fn levels(low: f64, high: f64, grid: usize) -> Option<Ladder> {
    let last = (grid - 1) as f64;
    let level = |step: usize| match step {
        0 => low,
        step if step == grid - 1 => high,
        step => rounded(low + step as f64 / last * (high - low)),
    };
    Ladder::new((0..grid).map(level).collect()).ok()
}

fn rounded(level: f64) -> f64 {
    format!("{level:.11e}").parse().unwrap_or(level)
}

/// How the points of a search are chosen.
pub(super) static RULE: Variants = Variants {
    tag: "name",
    effect: "The rule",
    common: keys! {
        /// Number of trials.
        "trials": Kind::Whole(1, MAX_TRIALS as i64), "40", required;
    },
    shapes: &SHAPES,
};

static SHAPES: [Shape; RULES.len()] = shapes(&RULES);

impl Words for Acquire {
    const VALUES: &'static [(&'static str, Self)] =
        &[("challenger", Self::Challenger), ("eubo", Self::Eubo)];
    const WORDS: &'static [Word] = &[
        Word::new(
            "challenger",
            "The best point so far, and of all others the one that may be better by most.",
        ),
        Word::new(
            "eubo",
            "The pair with the largest expected utility of the better point (Lin et al. 2022).",
        ),
    ];
}

pub(super) const RULES: [Variant<SearchRule>; 3] = [
    Variant::new(
        "preference-gp",
        "A Gaussian process learns the utility of every point from the participant's own answers in the session, and the next pair follows from it. docs/search.md defines it.",
        keys! {
            /// So many first pairs fill the space evenly, as those of `sobol`.
            "start": Kind::Whole(1, MAX_TRIALS as i64), "6", default("8");
            /// Which pair comes after them.
            "acquire": Kind::Word(Acquire::WORDS), r#""eubo""#, default(r#""challenger""#);
        },
        preference_gp,
    ),
    Variant::new(
        "sobol",
        "Pairs of a Sobol sequence, which fill the space evenly whatever is answered.",
        &[],
        sobol,
    ),
    Variant::new("random", "Random pairs, whatever is answered.", &[], random),
];

fn preference_gp(section: &mut Section<'_, '_>) -> Option<SearchRule> {
    let (trials, start) = (section.whole("trials"), section.whole("start"));
    let acquire = section.word("acquire");
    if let (Some(trials), Some(start)) = (trials, start)
        && start > trials
    {
        let what = format!(
            "`{}.start` is above `trials`: {start} > {trials}",
            section.path()
        );
        section.fault_at("start", Fault::error(what));
        return None;
    }
    Some(SearchRule {
        choose: Choose::PreferenceGp {
            start: start?,
            acquire: acquire?,
        },
        trials: trials?,
    })
}

fn sobol(section: &mut Section<'_, '_>) -> Option<SearchRule> {
    without_model(section, Choose::Sobol)
}

fn random(section: &mut Section<'_, '_>) -> Option<SearchRule> {
    without_model(section, Choose::Random)
}

fn without_model(section: &mut Section<'_, '_>, choose: Choose) -> Option<SearchRule> {
    Some(SearchRule {
        choose,
        trials: section.whole("trials")?,
    })
}
