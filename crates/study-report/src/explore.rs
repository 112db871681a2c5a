//! What a search found, as text and as tables. There are no p values: a search decides nothing.

pub mod weights;

use crate::part_answers::included;
use std::fmt::Write as _;
use study_analysis::analyze::psychophysics::search::{Exploration, Explored};
use study_base::text::{Untrusted, counted};
use study_plan::protocol::SpaceRules;

/// Pairs in a line of the terminal.
const IN_A_LINE: usize = 8;

/// Everything for a terminal.
pub fn text(explorations: &[Exploration]) -> String {
    let mut out = String::new();
    for found in explorations {
        let space = &found.space;
        let _ = writeln!(
            out,
            "Part {}: the space {}, {} of {} points can be presented\n\
             Utilities are in units of the noise of one impression, from the mean of the map. A search decides nothing:\n\
             confirm what it found with participants who did not take part in it.",
            found.part,
            space.id,
            space.lattice.certified().len(),
            space.lattice.len()
        );
        if let Some(banner) = included(found.simulated, found.pilot) {
            let _ = writeln!(out, "{banner}");
        }
        for rule in found.exclusions.iter().filter(|rule| rule.rows > 0) {
            let (rows, who) = (
                counted(rule.rows, "answer", "answers"),
                counted(rule.participants, "participant", "participants"),
            );
            let _ = writeln!(out, "The rule {} excludes {rows} of {who}.", rule.rule);
        }
        if found.searches.is_empty() {
            out.push_str("\nNo participant who counts has an answer.\n");
        }
        if let Some(all) = &found.population {
            let people = found.people();
            let mut who = counted(people, "participant", "participants");
            if people < found.searches.len() {
                let _ = write!(who, " in {} sessions", found.searches.len());
            }
            let _ = writeln!(out, "\n{who}: {}", best(space, all.best, &all.mean));
            let between = match people {
                1 => "SD between sessions",
                _ => "SD between people",
            };
            maps(&mut out, space, (&all.mean, &all.sd), all.best, between);
        }
        for own in &found.searches {
            let _ = writeln!(
                out,
                "\n{}, session {}, {}: {}",
                own.participant,
                own.session,
                counted(own.pairs.len(), "pair", "pairs"),
                best(space, own.best, &own.mean)
            );
            maps(
                &mut out,
                space,
                (&own.mean, &own.sd),
                own.best,
                "posterior SD",
            );
            order(&mut out, own);
            if !own.left_out.is_empty() {
                let points = own.left_out.iter().map(|point| (point + 1).to_string());
                let points: Vec<String> = points.collect();
                let _ = writeln!(
                    out,
                    "{:>9}  {}: the device failed there",
                    "left out",
                    points.join(", ")
                );
            }
        }
    }
    out
}

/// The point with the largest mean, in words.
fn best(space: &SpaceRules, index: usize, mean: &[f64]) -> String {
    let point = space.lattice.certified()[index];
    format!("best at {}, {:+.2}", place(space, point), mean[index])
}

/// The levels of a point, such as `detent 1, friction 0.5 (point 7)`. Points count from 1, as in the names of
/// realizations.
fn place(space: &SpaceRules, point: usize) -> String {
    let levels = space.levels(point);
    let words = (space.axes.iter().zip(levels))
        .map(|(axis, level)| format!("{} {level}", axis.vary.as_str()));
    let words: Vec<String> = words.collect();
    format!("{} (point {})", words.join(", "), point + 1)
}

/// Mean and standard deviation beside each other: the first axis downward, the second across, through the best point along
/// all others.
fn maps(
    out: &mut String,
    space: &SpaceRules,
    (mean, sd): (&[f64], &[f64]),
    best: usize,
    of_sd: &str,
) {
    let lattice = &space.lattice;
    let through = lattice.at(lattice.certified()[best]);
    let (rows, columns) = (
        lattice.steps()[0],
        lattice.steps().get(1).copied().unwrap_or(1),
    );
    let cell = |row: usize, column: usize, values: &[f64], sign: bool| {
        let mut at = through.clone();
        at[0] = row;
        if let Some(second) = at.get_mut(1) {
            *second = column;
        }
        match lattice.certified().binary_search(&lattice.point(&at)) {
            Err(_) => format!("{:>6}", "·"),
            Ok(index) if sign => {
                let mark = if index == best { "*" } else { "" };
                format!("{:>6}", format!("{mark}{:+.1}", values[index]))
            }
            Ok(index) => format!("{:>6.1}", values[index]),
        }
    };
    let name = |axis: usize| space.axes.get(axis).map_or("", |axis| axis.vary.as_str());
    let width = 6 * columns;
    let _ = writeln!(
        out,
        "{:>9} {:<width$}   {of_sd}",
        name(0),
        match columns {
            1 => "mean".to_owned(),
            _ => format!("mean, {} across", name(1)),
        }
    );
    let across = || -> String {
        match space.axes.get(1) {
            Some(axis) => (axis.levels.levels().iter())
                .map(|level| format!("{:>6}", short(*level)))
                .collect(),
            None => " ".repeat(width),
        }
    };
    let _ = writeln!(out, "{:>9} {}   {}", "", across(), across());
    for row in 0..rows {
        let line = |values: &[f64], sign: bool| -> String {
            (0..columns)
                .map(|column| cell(row, column, values, sign))
                .collect()
        };
        let level = short(space.axes[0].levels.level(row));
        let _ = writeln!(out, "{level:>9} {}   {}", line(mean, true), line(sd, false));
    }
    if space.axes.len() > 2 {
        let point = lattice.certified()[best];
        let others: Vec<String> = (space.axes.iter().zip(space.levels(point)).skip(2))
            .map(|(axis, level)| format!("{} {level}", axis.vary.as_str()))
            .collect();
        let _ = writeln!(out, "{:>9} at {}", "", others.join(", "));
    }
}

/// A level in five characters or fewer.
fn short(level: f64) -> String {
    let text = format!("{level:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The pairs in their order; the preferred point of each has a star.
fn order(out: &mut String, own: &Explored) {
    let pair = |pair: &study_analysis::analyze::psychophysics::search::ExploredPair| {
        let words = pair.points.map(|point| {
            let star = if pair.preferred == Some(point) {
                "*"
            } else {
                ""
            };
            format!("{}{star}", point + 1)
        });
        words.join("–")
    };
    let words: Vec<String> = own.pairs.iter().map(pair).collect();
    for (i, line) in words.chunks(IN_A_LINE).enumerate() {
        let head = if i == 0 { "pairs" } else { "" };
        let _ = writeln!(out, "{head:>9}  {}", line.join("  "));
    }
}

/// A table of all points: who, mean and standard deviation.
///
/// # Errors
/// If the writer of the table fails.
pub fn points_csv(found: &Exploration) -> Result<Vec<u8>, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let axes = found.space.axes.iter().map(|axis| axis.vary.as_str());
    let head = ["participant", "session", "point", "model"].into_iter();
    table.write_record(head.chain(axes).chain(["mean", "sd", "best"]))?;
    let mut rows = |who: &str, session: &str, (mean, sd): (&[f64], &[f64]), best: usize| {
        for (index, point) in found.space.lattice.certified().iter().enumerate() {
            let mut row = vec![
                who.to_owned(),
                session.to_owned(),
                (point + 1).to_string(),
                found.space.realization(*point).to_string(),
            ];
            row.extend(found.space.levels(*point).iter().map(f64::to_string));
            row.extend([mean[index].to_string(), sd[index].to_string()]);
            row.push((index == best).to_string());
            table.write_record(row)?;
        }
        Ok::<(), csv::Error>(())
    };
    if let Some(all) = &found.population {
        rows("", "", (&all.mean, &all.sd), all.best)?;
    }
    for own in &found.searches {
        let session = own.session.to_string();
        rows(
            own.participant.as_str(),
            &session,
            (&own.mean, &own.sd),
            own.best,
        )?;
    }
    table.into_inner().map_err(|e| e.into_error().into())
}

/// A table of all pairs, in the order in which they were presented.
///
/// # Errors
/// If the writer of the table fails.
pub fn pairs_csv(found: &Exploration) -> Result<Vec<u8>, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["participant", "session", "trial", "a", "b", "preferred"])?;
    for own in &found.searches {
        for pair in &own.pairs {
            let [a, b] = pair.points.map(|point| (point + 1).to_string());
            table.write_record([
                own.participant.to_string(),
                own.session.to_string(),
                pair.trial.to_string(),
                a,
                b,
                pair.preferred
                    .map_or_else(String::new, |point| (point + 1).to_string()),
            ])?;
        }
    }
    table.into_inner().map_err(|e| e.into_error().into())
}

/// What to say of a study without a search.
pub fn none(study: &str) -> String {
    format!(
        "the study `{}` has no part of kind \"search\"",
        Untrusted(study)
    )
}
