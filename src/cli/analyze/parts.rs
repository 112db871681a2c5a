//! The parts of a study that are not ratings: thresholds, sensitivities, preferences.

use super::{Args, include, only_pilots};
use crate::cli::{Console, Failure};
use crate::report::json;
use crate::report::text::{Page, trials};
use study_core::analyze::psychophysics::parts;
use study_core::protocol::Protocol;
use study_core::store::{Derived, SessionData, StudyFolder};

/// Prints the statistics of the parts of a study; with `--out`, also writes them.
pub(super) fn run(
    study: &StudyFolder,
    sessions: &[SessionData],
    protocol: &Protocol,
    args: &Args,
    console: &mut Console,
) -> Result<(), Failure> {
    let path = study.path().display().to_string();
    let derived = Derived::of(sessions, protocol);
    let (rows, intervals) = (&derived.rows, &derived.intervals);
    let real = rows.iter().any(|row| !row.pilot && !row.simulated);
    if !real && rows.iter().any(|row| row.pilot) && !include(args).pilot {
        return Err(only_pilots(study));
    }
    let found = parts(
        protocol,
        rows,
        intervals,
        &derived.participants,
        include(args),
    );
    if found.iter().all(|part| part.trials == 0) {
        return Err(Failure::input(format!("{path}: no answers that count")));
    }
    let document = json::parts(&path, &protocol.study.id, &found);
    if let Some(out) = &args.out {
        let file = super::report::Output {
            name: "parts.json".to_owned(),
            content: document.clone().into_bytes(),
        };
        super::write_files(out, &[file])?;
    }
    if args.json {
        return console.document(document);
    }
    let page = Page {
        width: console.width,
        colour: console.colour,
    };
    for part in &found {
        for (among, words) in [
            (part.simulated, "SIMULATED participants are included.\n"),
            (part.pilot, "PILOTS are included.\n"),
        ] {
            console.out(if among { words } else { "" })?;
        }
        let title = format!("{}: {}", protocol.study.title, part.part.as_str());
        let words = trials(&title, part.task, part.trials, &part.values, page);
        console.out(format!("{words}\n"))?;
    }
    Ok(())
}
