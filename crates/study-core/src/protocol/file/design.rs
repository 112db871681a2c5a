//! `[design]`.

use super::reader::{Reader, count, duration, inner_path, model_id};
use crate::protocol::{Breaks, Design, Order};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::{Table, Value};

const MAX_ATTEMPTS: u32 = 3;

/// Largest number of participants and of repetitions: above it is a slip.
const MAX_PARTICIPANTS: u32 = 100_000;
const MAX_REPETITIONS: u32 = 10_000;

#[derive(Debug, Clone, Copy)]
enum Word {
    Blocked,
    Shuffled,
    Williams,
    LatinSquare,
    Fixed,
}

const ORDERS: [(&str, Word); 5] = [
    ("blocked", Word::Blocked),
    ("shuffled", Word::Shuffled),
    ("williams", Word::Williams),
    ("latin-square", Word::LatinSquare),
    ("fixed", Word::Fixed),
];

/// The section; `None` if a part of it is faulty.
pub(super) fn read<'d, 't>(reader: &Reader<'d, 't>, root: &mut Table<'d, 't>) -> Option<Design> {
    let mut table = reader.section(
        root,
        "design",
        "it needs participants, repetitions and order",
    )?;
    let participants = reader.need_count(&mut table, "participants", "how many are planned");
    let repetitions = reader.need_count(
        &mut table,
        "repetitions",
        "how often each realization is felt",
    );
    for (key, given, most) in [
        ("participants", participants, MAX_PARTICIPANTS),
        ("repetitions", repetitions, MAX_REPETITIONS),
    ] {
        if given.is_some_and(|n| n > most) {
            table.fault_at(key, Fault::error(format!("`design.{key}` is above {most}")));
        }
    }
    let order = reader
        .need(
            &mut table,
            "order",
            "one of `blocked`, `shuffled`, `williams`, `latin-square`, `fixed`, or { file = \"orders.csv\" }",
        )
        .and_then(order);
    let max_run = reader.count(&mut table, "max_run");
    let min_distance = reader.count(&mut table, "min_distance");
    let practice = table
        .value("practice")
        .and_then(|v| v.array())
        .unwrap_or_default()
        .iter()
        .filter_map(model_id)
        .collect();
    let breaks = table.value("breaks").map(breaks_of(reader));
    let max_attempts = reader
        .count(&mut table, "max_attempts")
        .unwrap_or(MAX_ATTEMPTS);
    table.finish();
    Some(Design {
        participants: participants?,
        repetitions: repetitions?,
        order: order?,
        max_run,
        min_distance,
        practice,
        breaks: match breaks {
            Some(breaks) => Some(breaks?),
            None => None,
        },
        max_attempts,
    })
}

fn order(value: Value<'_, '_>) -> Option<Order> {
    if !value.is_table() {
        return Some(match value.word(&ORDERS)? {
            Word::Blocked => Order::Blocked,
            Word::Shuffled => Order::Shuffled,
            Word::Williams => Order::Williams,
            Word::LatinSquare => Order::LatinSquare,
            Word::Fixed => Order::Fixed,
        });
    }
    let mut table = value.table()?;
    let file = table.required("file").and_then(|v| inner_path(&v));
    table.finish();
    Some(Order::File(file?))
}

fn breaks_of<'d, 't>(reader: &Reader<'d, 't>) -> impl FnOnce(Value<'d, 't>) -> Option<Breaks> {
    let reader = *reader;
    move |value| {
        let mut table = value.table()?;
        let every = reader
            .need(&mut table, "every", "after so many trials")
            .and_then(|v| count(&v));
        let at_least_s = match table.value("at_least_s") {
            Some(value) => duration(&value),
            None => Some(0.0),
        };
        table.finish();
        Some(Breaks {
            every: every?,
            at_least_s: at_least_s?,
        })
    }
}
