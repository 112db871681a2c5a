//! The page of thresholds, sensitivities and preferences.

use super::Page;
use super::layout::{Grid, Paint, wrap};
use crate::report::apa::{interval_or_dash, name, or_dash, plain, two};
use std::collections::BTreeSet;
use study_base::text::counted;
use study_core::analyze::{Value, Values};

/// The parts of an identifier between `group/` and the statistic, each once.
fn cells<'a>(values: &'a Values, group: &str, parts: usize) -> BTreeSet<Vec<&'a str>> {
    let names = values.iter().filter_map(|(id, _)| {
        let rest = id.strip_prefix(group)?.strip_prefix('/')?;
        let names: Vec<&str> = rest.split('/').collect();
        (names.len() > parts).then(|| names[..parts].to_vec())
    });
    names.collect()
}

/// The statistics of a table of trials, or of the tracks and pairs of a study.
pub fn trials(title: &str, task: &str, rows: usize, values: &Values, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.colour);
    let mut out = paint.strong(&name(title));
    out += &format!("\n{task}, {}\n\n", counted(rows, "row", "rows"));
    for part in [
        thresholds,
        comparisons,
        sensitivities,
        abilities,
        magnitudes,
        ratings,
    ] {
        out += &part(values, width, paint);
    }
    out
}

fn grid(head: &[&str], rows: Vec<Vec<String>>, width: usize, paint: Paint) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let mut grid = Grid::new(head, Some(1), &[]);
    let tests = rows.len();
    for row in rows {
        grid.row(row);
    }
    grid.render(width, tests, paint)
}

/// Each participant and condition, then each condition.
fn thresholds(values: &Values, width: usize, paint: Paint) -> String {
    let mut rows = Vec::new();
    let mut reasons = String::new();
    for cell in cells(values, "psy", 2) {
        let id = |statistic: &str| format!("psy/{}/{}/{statistic}", cell[0], cell[1]);
        let number = |statistic: &str| values.number(&id(statistic));
        let interval = |statistic: &str| {
            interval_or_dash(
                values.interval(&id(&format!("posterior/{statistic}/ci95"))),
                plain,
            )
        };
        if cell[0] != "pooled" {
            rows.push(vec![
                name(cell[0]),
                name(cell[1]),
                or_dash(number("n_trials"), |n| format!("{n}")),
                or_dash(number("posterior/threshold/mean"), plain),
                interval("threshold"),
                or_dash(number("posterior/width/mean"), plain),
                interval("width"),
                or_dash(number("ml/threshold"), plain),
            ]);
        }
        if let Some(why) = values.reason(&id("ml/threshold")) {
            let text = format!(
                "{} {}: no maximum of the likelihood: {why}.",
                name(cell[0]),
                name(cell[1])
            );
            reasons += &wrap(&text, width, "", "  ");
        }
    }
    let head = [
        "",
        "condition",
        "trials",
        "threshold",
        "95 %",
        "width",
        "95 %",
        "ML",
    ];
    let mut out = grid(&head, rows, width, paint);
    if out.is_empty() {
        return out;
    }
    out += &wrap(
        "Threshold: the level at which the function without guesses and lapses is ½. Width: from .05 to .95 of it. Both are posterior means.",
        width,
        "",
        "",
    );
    out += &reasons;
    for cell in cells(values, "psy_group", 2) {
        let id = |statistic: &str| format!("psy_group/{}/{}/{statistic}", cell[0], cell[1]);
        let Some(mean) = values
            .number(&id("geometric_mean"))
            .filter(|_| cell[1] == "posterior_threshold")
        else {
            continue;
        };
        let n = values.number(&id("n")).unwrap_or_default();
        let text = format!(
            "{}: geometric mean {} {} of {n} participants.",
            name(cell[0]),
            plain(mean),
            interval_or_dash(values.interval(&id("ci95")), plain),
        );
        out += &wrap(&text, width, "", "  ");
    }
    out + "\n"
}

fn comparisons(values: &Values, width: usize, paint: Paint) -> String {
    let mut rows = Vec::new();
    for cell in cells(values, "psy", 2) {
        let number =
            |statistic: &str| values.number(&format!("psy/{}/{}/{statistic}", cell[0], cell[1]));
        let prefix = format!("psy/{}/{}/pse_ci95", cell[0], cell[1]);
        if let Some(pse) = number("pse") {
            rows.push(vec![
                name(cell[0]),
                name(cell[1]),
                plain(pse),
                interval_or_dash(values.interval(&prefix), plain),
                or_dash(number("constant_error"), plain),
                or_dash(number("jnd"), plain),
                or_dash(number("weber_fraction"), plain),
            ]);
        }
    }
    let head = [
        "",
        "condition",
        "PSE",
        "95 %",
        "constant error",
        "JND",
        "Weber fraction",
    ];
    grid(&head, rows, width, paint)
}

fn sensitivities(values: &Values, width: usize, paint: Paint) -> String {
    let mut rows = Vec::new();
    for cell in cells(values, "sdt", 2) {
        let id = |statistic: &str| format!("sdt/{}/{}/{statistic}", cell[0], cell[1]);
        let number = |statistic: &str| values.number(&id(statistic));
        let differencing = values.get(&id("d_differencing")).is_some();
        let d = if differencing { "d_differencing" } else { "d" };
        let bias = ["criterion", "interval_bias", "bias"]
            .iter()
            .find_map(|b| number(b));
        rows.push(vec![
            name(cell[0]),
            name(cell[1]),
            or_dash(number(d), two),
            interval_or_dash(values.interval(&id(&format!("{d}_ci95"))), two),
            or_dash(bias, two),
        ]);
    }
    let head = ["", "condition", "d′", "95 %", "bias"];
    grid(&head, rows, width, paint)
}

/// Items, the most preferred first, then their differences.
fn abilities(values: &Values, width: usize, paint: Paint) -> String {
    let mut items: Vec<(&str, Option<f64>)> = (values.iter())
        .filter_map(|(id, value)| {
            let item = id.strip_prefix("pairs/ability/")?;
            let ability = match value {
                Value::Number(x) => Some(*x),
                Value::List(_) | Value::Undefined(_) => None,
            };
            Some((item, ability))
        })
        .collect();
    items.sort_by(|a, b| b.1.unwrap_or(f64::MIN).total_cmp(&a.1.unwrap_or(f64::MIN)));
    if let Some((item, None)) = items.first() {
        let why = values
            .reason(&format!("pairs/ability/{item}"))
            .unwrap_or_default();
        return wrap(&format!("No abilities: {}.", name(why)), width, "", "  ") + "\n";
    }
    let rows = (items.iter())
        .map(|(item, ability)| {
            let se = values.number(&format!("pairs/ability_se/{item}"));
            vec![name(item), or_dash(*ability, two), or_dash(se, two)]
        })
        .collect();
    let mut out = grid(&["", "ability", "SE"], rows, width, paint);
    let rows = (values.iter())
        .filter_map(|(id, value)| {
            let pair = id.strip_prefix("pairs/")?.strip_suffix("/difference")?;
            let Value::Number(difference) = value else {
                return None;
            };
            let number = |statistic: &str| values.number(&format!("pairs/{pair}/{statistic}"));
            Some(vec![
                name(&pair.replace('|', " − ")),
                two(*difference),
                or_dash(number("se"), two),
                or_dash(number("se_clustered"), two),
                or_dash(number("preferred"), two),
                or_dash(number("p_holm"), plain),
            ])
        })
        .collect();
    let head = ["", "difference", "SE", "clustered", "preferred", "p (Holm)"];
    out += &grid(&head, rows, width, paint);
    if let Some(order) = values.number("pairs/order") {
        let p = or_dash(values.number("pairs/order_p"), plain);
        let text = format!(
            "Order: {} for what is presented first, p = {p}.",
            two(order)
        );
        out += &(wrap(&text, width, "", "  ") + "\n");
    }
    out
}

fn magnitudes(values: &Values, width: usize, paint: Paint) -> String {
    let mut levels: Vec<&str> = (values.iter())
        .filter_map(|(id, _)| {
            id.strip_prefix("magnitude/level/")?
                .strip_suffix("/geometric_mean")
        })
        .collect();
    let level = |text: &str| text.parse().unwrap_or(f64::MAX);
    levels.sort_by(|a, b| level(a).total_cmp(&level(b)));
    let rows = (levels.iter())
        .map(|level| {
            let id = format!("magnitude/level/{level}");
            vec![
                name(level),
                or_dash(values.number(&format!("{id}/geometric_mean")), plain),
                interval_or_dash(values.interval(&format!("{id}/ci95")), plain),
            ]
        })
        .collect();
    let mut out = grid(&["level", "geometric mean", "95 %"], rows, width, paint);
    if let Some(exponent) = values.number("magnitude/exponent") {
        let interval = values.interval("magnitude/exponent_over_participants/ci95");
        let left_out = values.number("magnitude/n_left_out").unwrap_or_default();
        let text = format!(
            "Exponent {} {}, over participants. {} left out, because not above 0.",
            two(exponent),
            interval_or_dash(interval, two),
            counted(left_out as usize, "estimate", "estimates"),
        );
        out += &(wrap(&text, width, "", "  ") + "\n");
    }
    out
}

fn ratings(values: &Values, width: usize, paint: Paint) -> String {
    let of = |statistic: &str| -> Vec<&str> {
        let suffix = format!("/{statistic}");
        (values.iter())
            .filter_map(|(id, _)| id.strip_prefix("mushra/")?.strip_suffix(&suffix))
            .collect()
    };
    let rows = (of("median").iter())
        .map(|condition| {
            let number =
                |statistic: &str| values.number(&format!("mushra/{condition}/{statistic}"));
            let quartiles = number("q1").zip(number("q3"));
            vec![
                name(condition),
                or_dash(number("median"), plain),
                interval_or_dash(quartiles, plain),
                or_dash(number("mean"), plain),
                or_dash(number("ci95_half"), |h| format!("± {}", plain(h))),
            ]
        })
        .collect();
    let head = ["", "median", "quartiles", "mean", "95 %"];
    let mut out = grid(&head, rows, width, paint);
    let screened: Vec<String> = (of("screened").iter())
        .filter(|p| values.number(&format!("mushra/{p}/screened")) == Some(1.0))
        .map(|p| name(p))
        .collect();
    if !screened.is_empty() {
        let text = format!("Screened, and not in this table: {}.", screened.join(", "));
        out += &(wrap(&text, width, "", "  ") + "\n");
    }
    out
}
