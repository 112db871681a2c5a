//! `[[questions]]`, `[[setup]]`, `[[intake]]`, `[[outro]]`: the same kinds in each.

use super::reader::{Reader, finite, prose, question_id};
use crate::protocol::{Question, QuestionKind};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::{Table, Value};
use study_base::text::{QuestionId, Untrusted};

/// Most points of a rating scale: one key or click each.
const MAX_RATING_POINTS: i64 = 101;

/// A question with its place; parts that are faulty are `None`.
#[derive(Debug)]
pub(super) struct Draft {
    /// Such as `questions[0]`.
    pub(super) path: String,
    pub(super) id: Option<QuestionId>,
    pub(super) kind: Option<QuestionKind>,
    prompt: Option<String>,
    required: Option<bool>,
}

impl Draft {
    /// The question, if every part could be read.
    pub(super) fn finish(self) -> Option<Question> {
        let kind = self.kind?;
        let required = self.required.unwrap_or(!matches!(kind, QuestionKind::Text));
        Some(Question {
            id: self.id?,
            prompt: self.prompt?,
            kind,
            required,
        })
    }
}

#[derive(Debug, Clone, Copy)]
enum Word {
    Rating,
    Slider,
    Choice,
    Number,
    Text,
}

const KINDS: [(&str, Word); 5] = [
    ("rating", Word::Rating),
    ("slider", Word::Slider),
    ("choice", Word::Choice),
    ("number", Word::Number),
    ("text", Word::Text),
];

/// All questions of one array.
pub(super) fn read<'d, 't>(
    reader: &Reader<'d, 't>,
    root: &mut Table<'d, 't>,
    name: &str,
) -> Vec<Draft> {
    root.tables(name)
        .into_iter()
        .map(|table| question(reader, table))
        .collect()
}

fn question<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> Draft {
    let path = table.path().to_owned();
    let id = reader
        .need(&mut table, "id", "it names a column of the results")
        .and_then(|v| question_id(&v));
    let prompt = reader.need_text(&mut table, "prompt", "the words that are shown");
    let required = table.bool("required");
    let word = reader
        .need(
            &mut table,
            "kind",
            "one of `rating`, `slider`, `choice`, `number`, `text`",
        )
        .and_then(|v| v.word(&KINDS));
    let Some(word) = word else {
        // Which keys are known depends on the kind: nothing more can be said.
        return Draft {
            path,
            id,
            kind: None,
            prompt,
            required,
        };
    };
    let kind = match word {
        Word::Rating => rating(reader, &mut table),
        Word::Slider => slider(reader, &mut table),
        Word::Choice => choice(reader, &mut table),
        Word::Number => number(reader, &mut table),
        Word::Text => Some(QuestionKind::Text),
    };
    table.finish();
    Draft {
        path,
        id,
        kind,
        prompt,
        required,
    }
}

fn rating<'d, 't>(reader: &Reader<'d, 't>, table: &mut Table<'d, 't>) -> Option<QuestionKind> {
    let from = reader.need(table, "from", "the smallest rating, such as 1");
    let to = reader.need(table, "to", "the largest rating, such as 7");
    let labels = table.value("labels");
    let (from, to) = (from?.i64()?, to?.i64()?);
    upright(table, from < to, from, to)?;
    if to.checked_sub(from).is_none_or(|n| n >= MAX_RATING_POINTS) {
        table.fault_at(
            "to",
            Fault::error(format!(
                "a rating has at most {MAX_RATING_POINTS} points, not {from} to {to}"
            ))
            .hint("`kind = \"slider\"` is for fine scales"),
        );
        return None;
    }
    let mut words = BTreeMap::new();
    for (key, label) in labels.map(entries).unwrap_or_default() {
        match key.parse::<i64>() {
            Ok(at) if (from..=to).contains(&at) => {
                words.insert(at, prose(&label)?);
            }
            Ok(at) => label.fault(Fault::error(format!(
                "the label at {at} is outside the scale {from} to {to}"
            ))),
            Err(_) => label.fault(
                Fault::error(format!(
                    "a label stands at a whole number, not at `{}`",
                    Untrusted(&key)
                ))
                .hint("such as labels = { 1 = \"not at all\", 7 = \"very\" }"),
            ),
        }
    }
    Some(QuestionKind::Rating {
        from,
        to,
        labels: words,
    })
}

fn slider<'d, 't>(reader: &Reader<'d, 't>, table: &mut Table<'d, 't>) -> Option<QuestionKind> {
    let from = reader.need(table, "from", "the left end, such as 0");
    let to = reader.need(table, "to", "the right end, such as 100");
    let step = reader.number(table, "step");
    let labels = table.value("labels");
    let (from, to) = (finite(&from?)?, finite(&to?)?);
    upright(table, from < to, from, to)?;
    let step = step.unwrap_or((to - from) / 100.0);
    if !(step > 0.0 && step <= to - from) {
        table.fault_at(
            "step",
            Fault::error(format!(
                "`{}.step` has to be above 0 and at most {}, not {step}",
                table.path(),
                to - from
            )),
        );
    }
    let mut words = BTreeMap::new();
    for (key, label) in labels.map(entries).unwrap_or_default() {
        match key.parse::<f64>() {
            Ok(at) if at == from || at == to => {
                words.insert(at.to_string(), prose(&label)?);
            }
            _ => label.fault(Fault::error(format!(
                "a slider has labels at its ends, {from} and {to}, not at `{}`",
                Untrusted(&key)
            ))),
        }
    }
    Some(QuestionKind::Slider {
        from,
        to,
        step,
        labels: words,
    })
}

fn choice<'d, 't>(reader: &Reader<'d, 't>, table: &mut Table<'d, 't>) -> Option<QuestionKind> {
    let multiple = table.bool("multiple").unwrap_or(false);
    let options = reader.need(table, "options", "a list of what can be chosen")?;
    let mut seen: Vec<String> = Vec::new();
    let values = options.array()?;
    if values.is_empty() {
        options.fault(Fault::error(format!("`{}` is empty", options.path())));
    }
    for value in values {
        let Some(option) = prose(&value) else {
            continue;
        };
        if seen.iter().any(|s| s.trim() == option.trim()) {
            value.fault(Fault::error(format!(
                "`{}` is there twice",
                Untrusted(&option)
            )));
        }
        if multiple && option.contains(';') {
            value.fault(
                Fault::error("an option of a choice of several cannot hold a `;`")
                    .hint("it stands between the options that were chosen, in the results"),
            );
        }
        seen.push(option);
    }
    Some(QuestionKind::Choice {
        options: seen,
        multiple,
    })
}

fn number<'d, 't>(reader: &Reader<'d, 't>, table: &mut Table<'d, 't>) -> Option<QuestionKind> {
    let unit = reader.text(table, "unit");
    let min = reader.number(table, "min");
    let max = reader.number(table, "max");
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        table.fault_at(
            "min",
            Fault::error(format!("nothing lies between min = {min} and max = {max}"))
                .hint("swap them"),
        );
    }
    Some(QuestionKind::Number { unit, min, max })
}

/// The keys and values of a table of labels.
fn entries<'d, 't>(labels: Value<'d, 't>) -> Vec<(String, Value<'d, 't>)> {
    let Some(mut table) = labels.table() else {
        return Vec::new();
    };
    table
        .keys()
        .into_iter()
        .filter_map(|(key, _)| table.value(&key).map(|value| (key, value)))
        .collect()
}

/// Reports a scale that does not go up.
fn upright(
    table: &Table<'_, '_>,
    up: bool,
    from: impl std::fmt::Display,
    to: impl std::fmt::Display,
) -> Option<()> {
    if up {
        return Some(());
    }
    table.fault_at(
        "from",
        Fault::error(format!(
            "the scale of `{}` is upside down: from {from} to {to}",
            table.path()
        ))
        .label("has to be below `to`"),
    );
    None
}
