//! Orders and their balance as text for a terminal.

use std::collections::HashMap;
use std::fmt::Write as _;
use study_base::text::{ModelId, Untrusted};
use study_plan::protocol::{Criterion, Design, Drawn, Order, Protocol, Role, Trial};
use study_plan::schedule::balance::{Balance, Balances, Spread, balances};

/// Ids up to this length are used in the tables.
const SHORT: usize = 3;
/// Largest table of counts that is shown, in cells: a larger one fills thousands of
/// lines, and nobody reads it.
const MAX_CELLS: usize = 40_000;

/// Counts are shown for up to so many realizations; of more, nobody reads them.
const MAX_COUNTED: usize = 100;

/// The text of `study schedule`: orders, counts and a summary of the balance. Lines
/// have at most `width` columns if the numbers allow it.
pub(super) fn render(
    protocol: &Protocol,
    models: &[ModelId],
    plans: &[(u32, Vec<Trial>)],
    width: usize,
) -> String {
    let mut out = format!("{}\n", Untrusted(&protocol.study.title));
    section(
        &mut out,
        protocol,
        (&protocol.design, None),
        models,
        plans,
        width,
    );
    out
}

/// Orders, counts and summary of realizations under the rules of a `design`, whose practice may have
/// a criterion.
pub(super) fn section(
    out: &mut String,
    protocol: &Protocol,
    (design, criterion): (&Design, Option<Criterion>),
    models: &[ModelId],
    plans: &[(u32, Vec<Trial>)],
    width: usize,
) {
    let codes = Codes::of(models);
    let balance = Balance::of(models, plans.iter().map(|(_, plan)| plan.as_slice()));
    let _ = writeln!(out, "{}", headline(design, models.len(), "realizations"));
    legend(out, protocol, models, &codes);
    if !design.practice.is_empty() {
        let ids: Vec<_> = design.practice.iter().map(ModelId::as_str).collect();
        let _ = match criterion {
            None => writeln!(out, "Practice, before every order: {}\n", ids.join(", ")),
            Some(Criterion {
                correct,
                of,
                rounds,
                draw,
            }) => {
                let (how, most) = match draw {
                    Drawn::Rounds => (
                        "each time in an order that is drawn",
                        format!("{rounds} times"),
                    ),
                    Drawn::Independent => (
                        "each drawn on its own",
                        format!("{} trials", ids.len() * rounds as usize),
                    ),
                };
                writeln!(
                    out,
                    "Practice, before every order: {}, {how}, until {correct} of the last {of} answers are correct, \
                     at most {most}\n",
                    ids.join(", ")
                )
            }
        };
    }
    let code = |trial: &Trial| {
        let model = trial.model().map_or("", |model| codes.of_model(model));
        model.to_owned()
    };
    orders(out, plans, codes.width(), width, code);
    let Some(rows) = rows_shown(plans) else {
        return;
    };
    if models.len() <= MAX_COUNTED {
        balance_tables(out, &codes, &balance, &rows, width);
    } else {
        let _ = writeln!(
            out,
            "\nThe counts of more than {MAX_COUNTED} realizations are not shown; --csv prints the orders."
        );
    }
    out.push('\n');
    for line in verdict(design, &balance) {
        let _ = writeln!(out, "{line}");
    }
}

/// Such as `rows 1–4`; `None` if there are none.
pub(super) fn rows_shown(plans: &[(u32, Vec<Trial>)]) -> Option<String> {
    let ((first, _), (last, _)) = (plans.first()?, plans.last()?);
    Some(match first < last {
        true => format!("rows {first}–{last}"),
        false => format!("row {first}"),
    })
}

/// Counts by place, by position and of carry-over.
fn balance_tables(out: &mut String, codes: &Codes, balance: &Balance, rows: &str, width: usize) {
    if balance.blocks > 1 {
        let _ = writeln!(out, "\nOccurrences at each place of a block, {rows}");
        counts(
            out,
            codes,
            &numbers(&balance.by_place),
            &balance.by_place,
            width,
        );
    }
    let _ = writeln!(out, "\nOccurrences at each position of the session, {rows}");
    counts(
        out,
        codes,
        &numbers(&balance.by_position),
        &balance.by_position,
        width,
    );
    if balance.blocks > 1 {
        let _ = writeln!(
            out,
            "\nOccurrences of the column directly after the line, within blocks, {rows}"
        );
        counts(out, codes, &codes.names, &balance.carry_over, width);
        let _ = writeln!(
            out,
            "\nOccurrences of the column at the start of a block after one that ends with the line, {rows}"
        );
        counts(out, codes, &codes.names, &balance.between_blocks, width);
    } else {
        let _ = writeln!(
            out,
            "\nOccurrences of the column directly after the line, {rows}"
        );
        counts(out, codes, &codes.names, &balance.carry_over, width);
    }
}

/// Short codes of the realizations in the tables.
pub(super) struct Codes {
    names: Vec<String>,
    by_id: HashMap<ModelId, usize>,
    are_ids: bool,
}

impl Codes {
    pub(super) fn of(models: &[ModelId]) -> Self {
        let are_ids = models.iter().all(|m| m.as_str().len() <= SHORT);
        let names = match models {
            _ if are_ids => models.iter().map(ToString::to_string).collect(),
            _ if models.len() <= 26 => (b'A'..=b'Z')
                .take(models.len())
                .map(|c| char::from(c).to_string())
                .collect(),
            _ => (1..=models.len()).map(|i| i.to_string()).collect(),
        };
        Self {
            names,
            by_id: models.iter().cloned().zip(0..).collect(),
            are_ids,
        }
    }

    pub(super) fn of_model<'a>(&'a self, model: &'a ModelId) -> &'a str {
        self.by_id
            .get(model)
            .map_or(model.as_str(), |&i| &self.names[i])
    }

    pub(super) fn width(&self) -> usize {
        self.names.iter().map(String::len).max().unwrap_or(1)
    }
}

/// Such as `blocked, 5 realizations × 3 repetitions`.
pub(super) fn headline(design: &Design, number: usize, of: &str) -> String {
    let order = match &design.order {
        Order::File(path) => format!("orders from {}", Untrusted(path)),
        order => order.as_str().to_owned(),
    };
    let mut line = format!(
        "{order}, {number} {of} × {} repetitions",
        design.repetitions
    );
    if let Some(k) = design.max_run {
        let _ = write!(line, ", max_run = {k}");
    }
    if let Some(d) = design.min_distance {
        let _ = write!(line, ", min_distance = {d}");
    }
    line
}

/// The codes, where they are not the ids.
pub(super) fn legend(out: &mut String, protocol: &Protocol, models: &[ModelId], codes: &Codes) {
    out.push('\n');
    if codes.are_ids {
        return;
    }
    for (code, id) in codes.names.iter().zip(models) {
        let role = match protocol.model(id).map(|m| m.role) {
            Some(Role::Test) | None => String::new(),
            Some(role) => format!("  ({})", role.as_str()),
        };
        let _ = writeln!(out, "{code:>width$}  {id}{role}", width = codes.width());
    }
    out.push('\n');
}

/// One line per row, wrapped between trials; the `code` of a trial has up to `cell` columns.
pub(super) fn orders(
    out: &mut String,
    plans: &[(u32, Vec<Trial>)],
    cell: usize,
    width: usize,
    code: impl Fn(&Trial) -> String,
) {
    let label = plans.last().map_or(1, |(row, _)| row.to_string().len());
    for (row, plan) in plans {
        let _ = write!(out, "row {row:>label$} ");
        let indent = 5 + label;
        let mut column = indent;
        let mut block = None;
        for trial in plan.iter().filter(|t| !t.practice) {
            let bar = if block.is_some_and(|b| b != trial.block) {
                " │"
            } else {
                ""
            };
            block = Some(trial.block);
            // With room for a bar at the end of the line.
            let needed = bar.chars().count() + 1 + cell + 2;
            if column + needed > width && column > indent {
                let _ = write!(out, "{bar}\n{:indent$}", "");
                column = indent;
            } else {
                out.push_str(bar);
                column += bar.chars().count();
            }
            let _ = write!(out, " {:>cell$}", code(trial));
            column += 1 + cell;
        }
        out.push('\n');
    }
}

fn numbers(table: &[Vec<u32>]) -> Vec<String> {
    let columns = table.first().map_or(0, Vec::len);
    (1..=columns).map(|i| i.to_string()).collect()
}

/// A table of counts, split into parts if it is too wide.
fn counts(out: &mut String, codes: &Codes, heads: &[String], table: &[Vec<u32>], width: usize) {
    if heads.len() * table.len() > MAX_CELLS {
        let _ = writeln!(
            out,
            "  {} × {} counts, too many to be shown; `--csv` prints the orders",
            table.len(),
            heads.len()
        );
        return;
    }
    let largest = table.iter().flatten().map(|c| c.to_string().len()).max();
    let head = heads.iter().map(String::len).max().unwrap_or(1);
    let cell = largest.unwrap_or(1).max(head) + 1;
    let label = codes.width() + 2;
    let columns = (width.saturating_sub(label) / cell).max(1);
    for from in (0..heads.len()).step_by(columns) {
        let part = from..heads.len().min(from + columns);
        let _ = write!(out, "{:label$}", "");
        for head in &heads[part.clone()] {
            let _ = write!(out, "{head:>cell$}");
        }
        out.push('\n');
        for (name, line) in codes.names.iter().zip(table) {
            let _ = write!(out, "{name:>label$}");
            for count in &line[part.clone()] {
                match count {
                    0 => drop(write!(out, "{:>cell$}", "·")),
                    count => drop(write!(out, "{count:>cell$}")),
                }
            }
            out.push('\n');
        }
    }
}

/// The balance in sentences.
fn verdict(design: &Design, balance: &Balance) -> Vec<String> {
    let (place, within) = if balance.blocks > 1 {
        ("place of a block", " within blocks")
    } else {
        ("position", "")
    };
    let mut lines = Vec::new();
    if let Some(spread) = balance.places() {
        lines.push(format!(
            "Positions: {}.",
            evenness(
                spread,
                &format!("each realization occurs {{}} at each {place}")
            )
        ));
    }
    if let Some(spread) = balance.carry_overs() {
        lines.push(format!(
            "Carry-over: {}.",
            evenness(
                spread,
                &format!("each realization follows each other one {{}}{within}")
            )
        ));
    }
    lines.push(promise(
        design,
        balances(&design.order, balance.models.len(), design.repetitions),
    ));
    lines
}

fn evenness(spread: Spread, sentence: &str) -> String {
    if spread.is_even() {
        format!("balanced; {}", sentence.replace("{}", &times(spread.least)))
    } else {
        let range = format!("{} to {} times", spread.least, spread.most);
        let even = (spread.even * 10.0).round() / 10.0;
        format!(
            "unbalanced; {} (balanced: {even})",
            sentence.replace("{}", &range)
        )
    }
}

fn times(n: u32) -> String {
    match n {
        0 => "never".to_owned(),
        1 => "once".to_owned(),
        n => format!("{n} times"),
    }
}

/// The balance of the design, independent of the rows that are shown.
fn promise(design: &Design, balances: Option<Balances>) -> String {
    match (&design.order, balances) {
        (_, Some(b)) => {
            let what = if b.carry_over {
                "Positions and carry-over are"
            } else {
                "Positions (not carry-over) are"
            };
            let planned = u64::from(design.participants);
            let fits = if planned.is_multiple_of(b.participants) {
                format!("{planned} are planned, which is one")
            } else {
                let below = planned / b.participants * b.participants;
                let above = below + b.participants;
                match below {
                    0 => format!("{planned} are planned; the next is {above}"),
                    below => format!("{planned} are planned; the nearest are {below} and {above}"),
                }
            };
            match b.participants {
                1 => format!("{what} balanced for any number of participants."),
                n => format!("{what} balanced at multiples of {n} participants; {fits}."),
            }
        }
        (Order::Fixed, _) => {
            "All participants have the same order: order effects cannot be separated from effects of realizations."
                .to_owned()
        }
        (Order::File(_), _) => "The orders are those of the file.".to_owned(),
        _ => "The orders are random: balanced on average over many participants, not over a few."
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::Seat;
    use study_plan::protocol::example::protocol;
    use study_plan::schedule::Planner;

    fn rendered(p: &Protocol, rows: u32, width: usize) -> String {
        let planner = Planner::new(p, None).unwrap();
        let plans: Vec<_> = (1..=rows)
            .map(|row| (row, planner.plan(Seat::Row(row)).unwrap()))
            .collect();
        render(p, planner.models(), &plans, width)
    }

    #[test]
    fn orders_counts_and_a_summary_are_shown() {
        let mut p = protocol(4, 3);
        p.design.order = Order::Williams;
        p.design.max_run = Some(1);
        p.design.participants = 6;
        let text = rendered(&p, 4, 80);
        insta::assert_snapshot!(text);
    }

    #[test]
    fn long_ids_get_letters_and_a_legend() {
        let mut p = protocol(3, 2);
        p.models[1].id = ModelId::new("lambda-0.9995").unwrap();
        p.models[2].role = Role::LowAnchor;
        let text = rendered(&p, 2, 80);
        assert!(text.contains("B  lambda-0.9995\n"), "{text}");
        assert!(text.contains("C  C  (low-anchor)\n"), "{text}");
        assert!(text.contains("The orders are random"), "{text}");
    }

    #[test]
    fn lines_are_broken_at_the_width() {
        let mut p = protocol(12, 3);
        p.study.title = "An \u{1b}[2Jexample".to_owned();
        for order in [Order::Blocked, Order::Shuffled] {
            p.design.order = order;
            let text = rendered(&p, 12, 60);
            assert!(!text.contains('\u{1b}'));
            let counted = text
                .lines()
                .filter(|l| !l.contains(". ") && !l.ends_with('.'));
            for line in counted.filter(|l| !l.starts_with("Occurrences")) {
                assert!(line.chars().count() <= 60, "{line}");
            }
            // Nothing is lost: 36 trials in the first row.
            let orders = text
                .split("row  2")
                .next()
                .unwrap()
                .split("row  1")
                .nth(1)
                .unwrap();
            let trials = orders.split_whitespace().filter(|w| *w != "│");
            assert_eq!(trials.count(), 36, "{text}");
        }
    }

    #[test]
    fn counts_of_very_many_realizations_are_not_shown() {
        let text = rendered(&protocol(100, 1), 1, 80);
        assert!(text.contains("Occurrences at each position"), "{text}");
        let text = rendered(&protocol(101, 1), 1, 80);
        assert!(!text.contains("Occurrences"), "{text}");
        assert!(text.contains("more than 100 realizations"), "{text}");
        assert!(text.contains("Positions: unbalanced"), "{text}");
    }

    #[test]
    fn an_unbalanced_design_is_described_by_its_range() {
        let mut p = protocol(5, 3);
        p.design.order = Order::Williams;
        p.design.participants = 12;
        let text = rendered(&p, 7, 80);
        assert!(text.contains("Positions: unbalanced; "), "{text}");
        assert!(text.contains("(balanced: 4.2)"), "{text}");
        assert!(
            text.contains("12 are planned; the nearest are 10 and 20."),
            "{text}"
        );
        assert!(rendered(&p, 10, 80).contains("Carry-over: balanced; "));
    }
}
