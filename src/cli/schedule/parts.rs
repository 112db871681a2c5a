//! The trials of a study with parts, as lines. Levels of tracks are not known before the
//! answers.

use std::fmt::Write as _;
use study_base::text::{Untrusted, counted};
use study_core::protocol::{Interval, Protocol, Stimuli, Trial};

/// The text of `study schedule`: a line for each trial of each row.
pub(super) fn render(protocol: &Protocol, plans: &[(u32, Vec<Trial>)]) -> String {
    let mut out = format!("{}\n", Untrusted(&protocol.study.title));
    for (row, plan) in plans {
        let _ = write!(
            out,
            "\nrow {row}, {}",
            counted(plan.len(), "trial", "trials")
        );
        out.push_str(if protocol.is_adaptive() {
            " at most\n"
        } else {
            "\n"
        });
        for trial in plan {
            let part = trial.part.as_ref().map_or("", |part| part.as_str());
            let practice = if trial.practice { ", practice" } else { "" };
            let _ = writeln!(
                out,
                "{:>5}  {part:<20}  block {:<3}  {}{practice}",
                trial.trial,
                trial.block,
                presented(&trial.stimuli)
            );
        }
    }
    out
}

/// What a trial presents, in words.
fn presented(stimuli: &Stimuli) -> String {
    match stimuli {
        Stimuli::One { model } => model.to_string(),
        Stimuli::Pair { pair: [a, b] } => format!("{a}, then {b}"),
        Stimuli::Track {
            track,
            easy,
            intervals: all,
        } => {
            let easy = if *easy { ", easy" } else { "" };
            format!("{track}: {}{easy}", intervals(all))
        }
    }
}

/// The intervals as letters: `S` standard, `C` comparison.
pub(super) fn intervals(intervals: &[Interval]) -> String {
    let letter = |interval: &Interval| match interval {
        Interval::Standard => 'S',
        Interval::Comparison => 'C',
    };
    intervals.iter().map(letter).collect()
}
