//! Parts of adjustment whose settings say little.

use crate::protocol::{Adjustment, Part, Task};
use study_base::diagnostic::Fault;
use study_base::text::counted;

/// Fewest levels of a ladder that need no warning: a setting is no finer than a step.
const LEVELS: usize = 9;

/// Fewest settings from each side that need no warning: their scatter is a measure of the just noticeable difference.
const SETTINGS: u32 = 3;

/// All doubts about a part.
pub(super) fn doubts(part: &Part) -> Vec<Fault> {
    let Task::Adjustment(own) = &part.task else {
        return Vec::new();
    };
    let all = [coarse(part, own), few(part, own), replays(part)];
    all.into_iter().flatten().collect()
}

fn coarse(part: &Part, own: &Adjustment) -> Option<Fault> {
    let n = own.models.len();
    (n < LEVELS).then(|| {
        let what = format!(
            "a level of {n} is set in the part `{}`: a setting is no finer than a step of the ladder",
            part.id
        );
        Fault::warning(what).hint(format!(
            "take a family of {LEVELS} levels or more, such as steps = 21"
        ))
    })
}

fn few(part: &Part, own: &Adjustment) -> Option<Fault> {
    (own.repetitions < SETTINGS).then(|| {
        let settings = counted(own.repetitions as usize, "setting", "settings");
        let what = format!(
            "{settings} of `{}` from each side: how much settings scatter is known badly",
            part.id
        );
        Fault::warning(what).hint(format!("take repetitions = {SETTINGS} or more"))
    })
}

fn replays(part: &Part) -> Option<Fault> {
    (part.exposure.replays > 0).then(|| {
        let what = format!(
            "`replays` has no effect in the part `{}`: a level is changed until it is confirmed",
            part.id
        );
        Fault::warning(what).hint("leave it out, or give the part an `exposure` without it")
    })
}
