//! What may identify a person, said to whoever exports. Nothing is changed here.

use super::select::Selected;
use super::table::{Table, Tables};
use super::{Options, author, delimited};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::counted;
use study_plan::protocol::Protocol;
use study_session::outcome::cell::Cell;
use study_session::outcome::ratings::Origin;

/// Most places that are named one by one.
const MAX_NAMED: usize = 20;

/// Fewest people with the same answers that do not stand out.
const SMALL_GROUP: usize = 5;

/// Questions whose answers together can tell a person.
const TELLING: [&str; 4] = ["age", "sex", "gender", "handedness"];

pub(super) fn notices(
    protocol: &Protocol,
    selected: &Selected,
    tables: &Tables<'_>,
    options: &Options,
) -> Vec<String> {
    let mut notices = Vec::new();
    let typed = [&tables.ratings, &tables.participants];
    let free: usize = typed.iter().map(|t| typed_cells(t).count()).sum();
    if free > 0 {
        let texts = counted(
            free,
            "text that a person typed is",
            "texts that people typed are",
        );
        notices.push(format!(
            "{texts} in the data set and may identify somebody; --without-comments leaves them out"
        ));
    }
    notices.extend(flagged(protocol, &typed));
    if options.whose == Origin::Real {
        notices.extend(small_groups(&tables.participants));
    }
    if selected.ages_cut > 0 {
        let n = counted(selected.ages_cut, "age", "ages");
        notices.push(format!("{n} above 89 written as 89"));
    }
    if options.format.sheets && !options.dialect.safe {
        let formulas: usize = tables.all().map(delimited::formulas).sum();
        if formulas > 0 {
            let n = counted(formulas, "text", "texts");
            notices.push(format!(
                "{n} could run as a formula in a spreadsheet; --spreadsheet-safe prevents it"
            ));
        }
    }
    let study = &protocol.study;
    if study.license.is_none() {
        notices.push("no license in [study]: nobody may use the data set".to_owned());
    }
    if study.doi.is_some() && author::doi(study).is_none() {
        notices.push("the doi in [study] is none and is left out".to_owned());
    }
    notices
}

/// Row and column of each cell that a person typed.
fn typed_cells<'t>(table: &'t Table<'_>) -> impl Iterator<Item = (usize, &'t str, &'t str)> {
    table.rows.iter().enumerate().flat_map(move |(at, row)| {
        (table.fields.iter().zip(row)).filter_map(move |(field, cell)| match cell {
            Cell::Text(text) if field.free && !field.once => {
                Some((at, field.name.as_str(), text.as_ref()))
            }
            _ => None,
        })
    })
}

/// Texts with something that often tells who wrote them.
fn flagged(protocol: &Protocol, tables: &[&Table<'_>]) -> Vec<String> {
    // German writes every noun with a capital.
    let capitals = !(protocol.text.lang.as_deref()).is_some_and(|l| l.starts_with("de"));
    let mut found = Vec::new();
    for table in tables {
        for (at, column, text) in typed_cells(table) {
            if let Some(why) = telling(text, capitals) {
                let row = &table.rows[at];
                let who = table.text(row, "participant").unwrap_or_default();
                let trial = table.text(row, "trial");
                let trial = trial.map_or_else(String::new, |t| format!(" trial {t}"));
                found.push(format!("{}: {who}{trial}, {column}: {why}", table.name));
            }
        }
    }
    let more = found.len().saturating_sub(MAX_NAMED);
    found.truncate(MAX_NAMED);
    if more > 0 {
        found.push(format!("and {} more", counted(more, "text", "texts")));
    }
    found
}

/// Why a text may tell who wrote it.
fn telling(text: &str, capitals: bool) -> Option<&'static str> {
    let digits = text
        .split(|c: char| !c.is_ascii_digit())
        .map(str::len)
        .max();
    if digits >= Some(5) {
        return Some("has a long number");
    }
    if text.contains('@') {
        return Some("has an @");
    }
    let mut inside = false;
    for word in text.split_whitespace() {
        let mut letters = word
            .trim_start_matches(|c: char| !c.is_alphanumeric())
            .chars();
        let capital = letters.next().is_some_and(char::is_uppercase);
        if capitals && inside && capital && letters.next().is_some_and(char::is_lowercase) {
            return Some("has a word with a capital inside a sentence");
        }
        inside = !word.ends_with(['.', '!', '?', ':', '。', '"']);
    }
    None
}

/// Combinations of answers that few participants have.
fn small_groups(participants: &Table<'_>) -> Option<String> {
    let is_telling = |name: &str| TELLING.iter().any(|t| t.eq_ignore_ascii_case(name));
    let places: Vec<usize> = (participants.fields.iter().enumerate())
        .filter(|(_, f)| is_telling(&f.name))
        .map(|(i, _)| i)
        .collect();
    let mut groups: BTreeMap<Vec<String>, usize> = BTreeMap::new();
    for row in &participants.rows {
        let answers = places.iter().map(|&at| row[at].to_string()).collect();
        *groups.entry(answers).or_default() += 1;
    }
    let small = groups.values().filter(|n| **n < SMALL_GROUP).count();
    let names: BTreeSet<&str> = places
        .iter()
        .map(|&at| participants.fields[at].name.as_str())
        .collect();
    let names: Vec<&str> = names.into_iter().collect();
    (small > 0 && !names.is_empty()).then(|| {
        format!(
            "{} of {} with fewer than {SMALL_GROUP} participants",
            counted(small, "combination", "combinations"),
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::telling;

    #[test]
    fn numbers_addresses_and_names_are_flagged() {
        for (text, flagged) in [
            ("call 0171234567", true),
            ("a@b.org", true),
            ("as Miller said", true),
            ("It was fine. Then not.", false),
            ("1234 times", false),
            ("VAF and I", false),
            ("よかった", false),
        ] {
            assert_eq!(telling(text, true).is_some(), flagged, "{text}");
        }
        assert_eq!(telling("das ist Gummi", false), None);
    }
}
