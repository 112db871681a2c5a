//! The parts of a study that are not ratings: thresholds, sensitivities, preferences.

use super::report::{self, Output};
use super::{Args, Place, include, write_files};
use crate::cli::{Console, Failure, study_folder};
use crate::report::figures::{Drawn, of_part};
use crate::report::html::{self, Details, PartReport};
use crate::report::text::{Page, part, preregistered};
use crate::report::{Source, csv, json};
use study_base::text::counted;
use study_core::analyze::psychophysics::{PartAnalysis, StudyData, parts};
use study_core::procedure::Rule;
use study_core::protocol::Protocol;
use study_core::protocol::parts::{Compared, IntervalOrder, Part, Task, TrackRules};
use study_core::store::{Derived, SessionData};

/// The analysis of each part and questionnaire; none of a study without any.
pub(super) fn analyse(
    sessions: &[SessionData],
    derived: &Derived,
    protocol: &Protocol,
    args: &Args,
) -> Vec<PartAnalysis> {
    let sessions: Vec<_> = sessions.iter().map(|s| &s.history).collect();
    let data = StudyData {
        protocol,
        rows: &derived.rows,
        intervals: &derived.intervals,
        participants: &derived.participants,
        sessions: &sessions,
    };
    parts(&data, include(args))
}

/// What the report has of the parts besides their analyses.
pub(super) fn reports(protocol: &Protocol, parts: &[PartAnalysis]) -> Vec<PartReport> {
    let report = |(i, analysis): (usize, &PartAnalysis)| PartReport {
        trials: protocol
            .part(&analysis.part)
            .map_or_else(String::new, |part| trials(protocol, part)),
        figures: of_part(i + 1, analysis),
    };
    parts.iter().enumerate().map(report).collect()
}

/// The parts on the terminal.
pub(super) fn pages(
    title: &str,
    parts: &[PartAnalysis],
    console: &mut Console,
) -> Result<(), Failure> {
    let page = Page {
        width: console.width,
        colour: console.colour,
    };
    for analysis in parts {
        let title = format!("{title}: {}", analysis.part.as_str());
        console.out(format!("{}\n", part(&title, analysis, page)))?;
    }
    Ok(())
}

/// Shows and writes the analysis of a study without ratings.
pub(super) fn show(
    source: &Source,
    details: &Details,
    parts: &[PartAnalysis],
    args: &Args,
    place: Place,
    console: &mut Console,
) -> Result<(), Failure> {
    if parts.iter().all(|part| part.trials == 0) {
        return Err(Failure::input(format!(
            "{}: no answers that count",
            source.path
        )));
    }
    let document = json::parts(source, parts);
    let write = |dir: &std::path::Path| {
        let mut files = vec![
            Output {
                name: "parts.json".to_owned(),
                content: document.clone().into_bytes(),
            },
            Output {
                name: "report.html".to_owned(),
                content: html::parts_document(source, details, parts).into_bytes(),
            },
        ];
        files.extend(csv::part_tables(parts).into_iter().map(Output::table));
        let figures = details.parts.iter().flat_map(|p| &p.figures);
        files.extend(report::figure_files(&figures.collect::<Vec<&Drawn>>())?);
        write_files(dir, &files)?;
        report::clear_figures(dir, &files);
        Ok(())
    };
    let written = place.out.as_deref().map(|dir| (dir, write(dir)));
    let written = match written {
        Some((_, Err(failure))) if args.out.is_some() => return Err(failure),
        other => other,
    };
    if args.json {
        return console.document(document);
    }
    pages(&source.title, parts, console)?;
    if let Some(comparison) = &source.preregistration {
        let page = Page {
            width: console.width,
            colour: console.colour,
        };
        console.out(preregistered(comparison, page))?;
    }
    match written {
        Some((dir, Ok(()))) => {
            console.say(format!("report: {}", dir.join("report.html").display()))
        }
        Some((_, Err(failure))) => study_folder::tables_unwritten(&failure, console),
        None => {}
    }
    Ok(())
}

/// Sentences on the trials of a part, for the methods.
fn trials(protocol: &Protocol, part: &Part) -> String {
    let mut text = Vec::new();
    match &part.task {
        Task::Rating(_) => {}
        Task::Magnitude(own) => {
            let levels = own.models.iter().any(|m| protocol.level_of(m).is_some());
            let (one, many) = match levels {
                true => ("level", "levels"),
                false => ("realization", "realizations"),
            };
            text.push(format!(
                "In each trial one of {} was felt and given a number above 0, each {one} in {}.",
                counted(own.models.len(), one, many),
                counted(own.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Mushra(own) => {
            let presented = &own.presentations;
            let reference = match &own.reference {
                Some(id) => format!("after {id} as the reference"),
                None => "beside a real reference".to_owned(),
            };
            text.push(format!(
                "In each trial one of {} was rated from 0 to 100 {reference}, each in {}; a hidden reference was among them \
                 (after ITU-R BS.1534-3, one at a time).",
                counted(presented.models.len(), "realization", "realizations"),
                counted(presented.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Pairs(pairs) => {
            let order = match pairs.interval_order {
                IntervalOrder::Balanced => "each pair in both orders in turn",
                IntervalOrder::Random => "the order of a pair was drawn for each trial",
            };
            let tie = if pairs.tie {
                "“no difference” was an answer"
            } else {
                "there was no tie"
            };
            text.push(format!(
                "In each trial two realizations were felt one after the other and one was chosen: {}, {} each; \
                 {order}; {tie}.",
                counted(pairs.pairs.len(), "pair", "pairs"),
                counted(pairs.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Discrimination { tracks } => {
            let tracks = tracks.iter().filter_map(|id| protocol.track(id));
            text.extend(tracks.map(|track| of_track(protocol, track)));
        }
    }
    let exposure = &part.exposure;
    let mut felt = match part.gap_s > 0.0 {
        true => format!("Intervals were {} s apart.", part.gap_s),
        false => String::new(),
    };
    match (exposure.min_s > 0.0, exposure.max_s) {
        (true, Some(most)) => {
            felt += &format!(" Each was felt for {} to {most} s.", exposure.min_s);
        }
        (true, None) => felt += &format!(" Each was felt for at least {} s.", exposure.min_s),
        (false, Some(most)) => felt += &format!(" Each was felt for at most {most} s."),
        (false, None) => {}
    }
    felt += &match exposure.replays {
        0 => " Nothing could be felt again.".to_owned(),
        1 => " A trial could be felt again once.".to_owned(),
        n => format!(
            " A trial could be felt again {}.",
            counted(n as usize, "time", "times")
        ),
    };
    text.push(felt.trim_start().to_owned());
    text.join(" ")
}

/// What a track compares, and by which rule.
pub(in crate::cli) fn of_track(protocol: &Protocol, track: &TrackRules) -> String {
    let compared = match &track.compared {
        Compared::Models { models } => format!("{} against the standard {}", models[1], models[0]),
        Compared::Levels { family, standard } => {
            let levels = protocol.ladder(track);
            let levels = levels.levels();
            let unit = protocol.family(family).and_then(|f| f.unit.clone());
            let unit = unit.map_or_else(String::new, |u| format!(" {u}"));
            format!(
                "{family} at {} from {} to {}{unit} against the standard {standard}{unit}",
                counted(levels.len(), "level", "levels"),
                levels.first().copied().unwrap_or_default(),
                levels.last().copied().unwrap_or_default(),
            )
        }
    };
    let rule = match &track.rule {
        Rule::Staircase(rule) => format!(
            "a {}-up-{}-down staircase that stops after {} reversals, {} trials at most",
            rule.up, rule.down, rule.stop.reversals, rule.stop.max_trials
        ),
        Rule::QuestPlus(rule) => format!("QUEST+ with {} trials", rule.trials),
        Rule::Constant(rule) => format!("constant stimuli in {} trials", rule.trials()),
    };
    let share = |share: f64, what: &str| match share > 0.0 {
        true => format!(", {:.0} % {what} trials", 100.0 * share),
        false => String::new(),
    };
    format!(
        "Track {} ({}): {compared}, by {rule}{}{}; {} feedback.",
        track.id,
        track.method.as_str(),
        share(track.easy, "easy"),
        share(track.catch, "catch"),
        if track.feedback { "with" } else { "no" }
    )
}
