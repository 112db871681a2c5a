//! `[[families]]`: one dimension of the stimulus each.

use crate::procedure::Ladder;
use crate::protocol::keys::{Id, Key, Kind, Word, Words, keys};
use crate::protocol::parts::MAX_LEVELS;
use crate::protocol::section::Section;
use crate::protocol::{FamilyRules, Vary};
use study_base::diagnostic::Fault;
use study_stats::psychometric::Spacing;

pub(super) const FAMILIES: &[Key] = keys! {
    /// The name of the family. Its levels are the realizations `id.1`, `id.2` and so on.
    "id": Kind::Id(Id::Part), r#""damping""#, required;
    /// The model file that is varied.
    "from": Kind::Path, r#""models/passive.toml""#, required;
    /// What a level changes in the table. Every level has to pass the passivity certificate;
    /// otherwise `study check` refuses the family and says which range passes.
    "vary": Kind::Word(Vary::WORDS), r#""b""#, required;
    /// The model file at level 1 of a blend.
    "to": Kind::Path, r#""models/other.toml""#;
    /// The lowest and the highest level of the ladder.
    "range": Kind::NumberList, "[0.0, 3.0]", derived("`levels` lists them");
    /// The number of levels from the lowest to the highest.
    "steps": Kind::Whole(2, MAX_LEVELS as i64), "41", derived("`levels` lists them");
    /// How the levels are spaced between the ends of `range`. Psychometric functions are fitted
    /// over the same scale, unless the `fit` of a track says otherwise.
    "scale": Kind::Word(Spacing::WORDS), r#""log""#, default(r#""lin""#);
    /// The levels themselves, rising, instead of `range` and `steps`.
    "levels": Kind::NumberList, "[0.5, 1.0, 2.0]";
    /// The unit of the levels, for people.
    "unit": Kind::Text, r#""×""#;
};

impl Words for Spacing {
    const VALUES: &'static [(&'static str, Self)] = &[("lin", Self::Lin), ("log", Self::Log)];
    const WORDS: &'static [Word] = &[
        Word::new("lin", "By equal differences."),
        Word::new("log", "By equal ratios."),
    ];
}

/// A family that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialFamily {
    /// Such as `families[0]`.
    pub(super) path: String,
    /// The files that it names, each with its key.
    pub(super) files: Vec<(&'static str, String)>,
    /// The family, if it has no fault.
    pub(super) family: Option<FamilyRules>,
}

pub(super) fn read(mut section: Section<'_, '_>) -> PartialFamily {
    let id = section.part_id("id");
    let (from, to) = (section.path_of("from"), section.path_of("to"));
    let vary = section.word::<Vary>("vary");
    let unit = section.text("unit");
    if let Some(vary) = vary {
        let blend = vary == Vary::Blend;
        if blend && section.value("to").is_none() {
            section.report_missing("to", section.key("to").such_as());
        } else if !blend && section.value("to").is_some() {
            let what = format!("`{}.to` belongs to vary = \"blend\"", section.path());
            section.fault_at("to", Fault::error(what));
        }
    }
    let ladder = levels(&mut section).and_then(|(levels, spacing)| {
        let ladder = Ladder::new(levels);
        if let Err(why) = &ladder {
            section.fault_at("levels", Fault::error(why.to_string()));
        }
        Some((ladder.ok()?, spacing))
    });
    if let (Some((ladder, _)), Some(vary)) = (&ladder, vary) {
        outside(&section, vary, ladder);
    }
    let files = [("from", &from), ("to", &to)];
    let files = files
        .into_iter()
        .filter_map(|(key, file)| Some((key, file.clone()?)));
    PartialFamily {
        path: section.path().to_owned(),
        files: files.collect(),
        family: (|| {
            let (ladder, spacing) = ladder?;
            Some(FamilyRules {
                id: id?,
                from: from?,
                vary: vary?,
                to,
                ladder,
                spacing,
                unit,
            })
        })(),
    }
}

/// The levels, as they are listed or from `range`, `steps` and `scale`, and how they are spaced.
fn levels(section: &mut Section<'_, '_>) -> Option<(Vec<f64>, Spacing)> {
    let listed = section.numbers("levels");
    let range = section.numbers("range");
    let steps = section.whole::<u32>("steps");
    let scale = section.word("scale")?;
    if let Some(levels) = listed {
        if range.is_some() || steps.is_some() {
            let what = format!("`{}` has both `levels` and a range", section.path());
            let hint = "leave `range` and `steps` out, or `levels`";
            section.fault_at("levels", Fault::error(what).hint(hint));
        }
        if levels.len() > MAX_LEVELS {
            let what = format!(
                "a family has at most {MAX_LEVELS} levels, not {}",
                levels.len()
            );
            section.fault_at("levels", Fault::error(what));
            return None;
        }
        return Some((levels, scale));
    }
    let (Some(range), Some(steps)) = (range, steps) else {
        let hint = "such as range = [0.0, 3.0] with steps = 41, or levels = [0.5, 1.0, 2.0]";
        // A range that is there is at fault itself.
        let both = ["range", "steps"].map(|key| section.value(key).is_some());
        if both != [true, true] {
            section.report_missing("levels", hint.to_owned());
        }
        return None;
    };
    let refuse = |what: &str| {
        let what = format!("`{}.range` {what}", section.path());
        let hint = "such as range = [0.5, 3.0]";
        section.fault_at("range", Fault::error(what).hint(hint));
    };
    let [low, high] = range[..] else {
        refuse("has to be two numbers, the lowest and the highest level");
        return None;
    };
    if low >= high {
        refuse(&format!("does not rise: {low} to {high}"));
        return None;
    }
    if scale == Spacing::Log && low <= 0.0 {
        refuse(&format!("cannot begin at {low} with scale = \"log\""));
        return None;
    }
    let last = steps - 1;
    let level = |step: u32| {
        let along = f64::from(step) / f64::from(last);
        match (step, scale) {
            (0, _) => low,
            (step, _) if step == last => high,
            (_, Spacing::Lin) => low + along * (high - low),
            (_, Spacing::Log) => low * libm::pow(high / low, along),
        }
    };
    Some(((0..steps).map(level).map(rounded).collect(), scale))
}

/// A number to twelve digits, so that a level of the ladder can be named as it is read.
fn rounded(level: f64) -> f64 {
    format!("{level:.11e}").parse().unwrap_or(level)
}

/// Reports levels that cannot be: a negative damping, mass or friction, or a blend
/// beyond its ends.
fn outside(section: &Section<'_, '_>, vary: Vary, ladder: &Ladder) {
    let (least, most) = match vary {
        Vary::Blend => (0.0, 1.0),
        Vary::Damping | Vary::Mass | Vary::Friction => (0.0, f64::INFINITY),
        Vary::Detent => return,
    };
    let beyond = if ladder.first() < least {
        ladder.first()
    } else if ladder.last() > most {
        ladder.last()
    } else {
        return;
    };
    let range = match vary {
        Vary::Blend => "from 0, `from`, to 1, `to`",
        _ => "0 or more",
    };
    let what = format!(
        "a level of vary = \"{}\" is {range}, not {beyond}",
        vary.as_str()
    );
    section.fault_at("range", Fault::error(what));
}
