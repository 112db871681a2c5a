//! The tables of thresholds, sensitivities and preferences: the same on the terminal, in
//! the report and as CSV.

mod scales;

use super::apa::{self, bare_p, interval_or_dash, name, or_dash, plain, two};
use scales::{items, magnitudes, ratings, scores};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::Untrusted;
use study_core::analyze::{Value, Values};

/// How a number is printed.
type Format = fn(f64) -> String;

/// A cell, as printed and with all digits.
pub(super) enum PartCell {
    /// A name. Untrusted.
    Name(String),
    Number(Option<f64>, Format),
    Interval(Option<(f64, f64)>, Format),
}

impl PartCell {
    /// As on the page.
    pub(super) fn shown(&self) -> String {
        match self {
            Self::Name(text) => name(text),
            Self::Number(x, format) => or_dash(*x, format),
            Self::Interval(ends, format) => interval_or_dash(*ends, format),
        }
    }
}

/// A column: its head on the page, and its name in a CSV file.
pub(super) type Column = (&'static str, &'static str);

/// A table; it may have no rows.
pub(super) struct PartTable {
    /// Name of its CSV file, without extension.
    pub(super) file: &'static str,
    pub(super) caption: &'static str,
    pub(super) columns: &'static [Column],
    pub(super) rows: Vec<Vec<PartCell>>,
    /// Sentences below it.
    pub(super) notes: Vec<String>,
}

impl PartTable {
    /// The heads on the page.
    pub(super) fn head(&self) -> Vec<&'static str> {
        self.columns.iter().map(|c| c.0).collect()
    }
}

/// All tables of these statistics; those without rows are left out.
pub(super) fn tables(values: &Values) -> Vec<PartTable> {
    let all = [
        thresholds,
        conditions,
        contrasts,
        comparisons,
        sensitivities,
        abilities,
        differences,
        magnitudes,
        magnitude_contrasts,
        ratings,
        scores,
        items,
        groups,
        group_pairs,
    ];
    let tables = all.into_iter().map(|table| table(values));
    tables
        .filter(|t| !t.rows.is_empty() || !t.notes.is_empty())
        .collect()
}

/// The parts of an identifier between `group/` and the statistic, each once.
fn cells<'a>(values: &'a Values, group: &str, parts: usize) -> BTreeSet<Vec<&'a str>> {
    let names = values.iter().filter_map(|(id, _)| {
        let rest = id.strip_prefix(group)?.strip_prefix('/')?;
        let names: Vec<&str> = rest.split('/').collect();
        (names.len() > parts).then(|| names[..parts].to_vec())
    });
    names.collect()
}

fn named(text: &str) -> PartCell {
    PartCell::Name(text.to_owned())
}

/// Each participant and condition.
fn thresholds(values: &Values) -> PartTable {
    const COLUMNS: [Column; 9] = [
        ("", "participant"),
        ("condition", "condition"),
        ("trials", "n_trials"),
        ("threshold", "threshold"),
        ("95 %", "threshold_ci95"),
        ("width", "width"),
        ("95 %", "width_ci95"),
        ("ML", "ml_threshold"),
        ("reversals", "reversal_mean"),
    ];
    // Only staircases have reversals.
    let staircases = (cells(values, "track", 2).iter()).any(|cell| {
        values
            .get(&format!("track/{}/{}/estimate", cell[0], cell[1]))
            .is_some()
    });
    let mut table = PartTable {
        file: "thresholds",
        caption: "Thresholds",
        columns: if staircases { &COLUMNS } else { &COLUMNS[..8] },
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let mut reasons: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut logarithms = false;
    for cell in cells(values, "psy", 2) {
        let id = |statistic: &str| format!("psy/{}/{}/{statistic}", cell[0], cell[1]);
        let number = |statistic: &str| PartCell::Number(values.number(&id(statistic)), plain);
        let interval = |statistic: &str| {
            let ends = values.interval(&id(&format!("posterior/{statistic}/ci95")));
            PartCell::Interval(ends, plain)
        };
        logarithms |= values.number(&id("log_scale")).is_some();
        if cell[0] != "pooled" {
            let trials = values.number(&id("n_trials"));
            let mut row = vec![
                named(cell[0]),
                named(cell[1]),
                PartCell::Number(trials, |n| format!("{n}")),
                number("posterior/threshold/mean"),
                interval("threshold"),
                number("posterior/width/mean"),
                interval("width"),
                number("ml/threshold"),
            ];
            if staircases {
                let mean = format!("track/{}/{}/estimate", cell[0], cell[1]);
                row.push(PartCell::Number(values.number(&mean), plain));
            }
            table.rows.push(row);
        }
        // What is pooled is not in the table.
        let why = values.reason(&id("ml/threshold"));
        if let Some(why) = why.filter(|_| cell[0] != "pooled") {
            let whose = format!("{} {}", name(cell[0]), name(cell[1]));
            reasons.entry(why.to_owned()).or_default().push(whose);
        }
    }
    if table.rows.is_empty() {
        return table;
    }
    let scale = match logarithms {
        true => {
            ", over logarithms: the threshold is a level, the width the natural logarithm of a ratio"
        }
        false => "",
    };
    table.notes.push(format!(
        "Threshold: the level at which the function without guesses and lapses is ½. Width: from .05 to \
         .95 of it. Both are posterior means{scale}.{}",
        match staircases {
            true => " Reversals: the mean of the last reversals, where the rule settles.",
            false => "",
        }
    ));
    if !reasons.is_empty() {
        let rests = "Without a maximum of the likelihood a posterior mean rests on its priors as much as on the answers; see its interval.";
        table.notes.push(rests.to_owned());
    }
    for (why, whose) in reasons {
        let whose = apa::listing(&whose);
        table
            .notes
            .push(format!("{whose}: no maximum of the likelihood: {why}."));
    }
    for cell in cells(values, "psy_group", 2) {
        let id = |statistic: &str| format!("psy_group/{}/{}/{statistic}", cell[0], cell[1]);
        let Some(mean) = values
            .number(&id("geometric_mean"))
            .filter(|_| cell[1] == "posterior_threshold")
        else {
            continue;
        };
        let n = values.number(&id("n")).unwrap_or_default();
        table.notes.push(format!(
            "{}: geometric mean {} {} of {n} participants.",
            name(cell[0]),
            plain(mean),
            interval_or_dash(values.interval(&id("ci95")), plain),
        ));
    }
    table
}

/// Thresholds of the mixed model, by condition.
fn conditions(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "conditions",
        caption: "Thresholds by condition, mixed model",
        columns: &[("", "condition"), ("mean", "mean"), ("95 %", "mean_ci95")],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let mut ratios = false;
    for cell in cells(values, "psy_mixed", 1) {
        let id = |statistic: &str| format!("psy_mixed/{}/{statistic}", cell[0]);
        let mean = values.number(&id("geometric_mean"));
        ratios |= mean.is_some();
        let Some(mean) = mean.or_else(|| values.number(&id("mean"))) else {
            continue;
        };
        table.rows.push(vec![
            named(cell[0]),
            PartCell::Number(Some(mean), plain),
            PartCell::Interval(values.interval(&id("ci95")), plain),
        ]);
    }
    if !table.rows.is_empty() && ratios {
        table
            .notes
            .push("Geometric means; contrasts are ratios.".to_owned());
    }
    if let Some(why) = values.reason("psy_mixed/F") {
        table
            .notes
            .push(format!("No comparison of conditions: {}.", Untrusted(why)));
    }
    table
}

/// Contrasts of thresholds.
fn contrasts(values: &Values) -> PartTable {
    of_model(
        values,
        "psy_mixed",
        ("contrasts", "Contrasts of thresholds"),
    )
}

/// Contrasts of estimated magnitudes.
fn magnitude_contrasts(values: &Values) -> PartTable {
    let names = ("magnitude_contrasts", "Contrasts of estimated magnitudes");
    of_model(values, "magnitude_mixed", names)
}

/// The contrasts of a mixed model, with the name of its file and the caption.
fn of_model(
    values: &Values,
    model: &str,
    (file, caption): (&'static str, &'static str),
) -> PartTable {
    let mut table = PartTable {
        file,
        caption,
        columns: &[
            ("", "conditions"),
            ("estimate", "estimate"),
            ("95 %", "estimate_ci95"),
            ("t", "t"),
            ("df", "df"),
            ("p (Holm)", "p_holm"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for cell in cells(values, model, 1) {
        table.rows.extend(contrast(values, model, cell[0]));
    }
    table
}

/// The columns of a contrast that all tables have; `None` if this is no contrast.
fn contrast(values: &Values, group: &str, pair: &str) -> Option<Vec<PartCell>> {
    let id = |statistic: &str| format!("{group}/{pair}/{statistic}");
    let number = |statistic: &str| values.number(&id(statistic));
    let (estimate, sign) = match number("ratio") {
        Some(ratio) => (ratio, " / "),
        None => (number("difference")?, " − "),
    };
    Some(vec![
        PartCell::Name(pair.replace('|', sign)),
        PartCell::Number(Some(estimate), plain),
        PartCell::Interval(values.interval(&id("ci95")), plain),
        PartCell::Number(number("t"), two),
        PartCell::Number(number("df"), two),
        PartCell::Number(number("p_holm"), bare_p),
    ])
}

/// Means of groups and of sessions.
fn groups(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "groups",
        caption: "Groups and sessions",
        columns: &[
            ("", "name"),
            ("n", "n"),
            ("mean", "mean"),
            ("SD", "sd"),
            ("95 %", "mean_ci95"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for kind in ["groups", "sessions"] {
        for cell in cells(values, kind, 1)
            .iter()
            .filter(|cell| !cell[0].contains('|'))
        {
            let number =
                |statistic: &str| values.number(&format!("{kind}/{}/{statistic}", cell[0]));
            let Some(mean) = number("geometric_mean").or_else(|| number("mean")) else {
                continue;
            };
            table.rows.push(vec![
                named(cell[0]),
                PartCell::Number(number("n"), |n| format!("{n}")),
                PartCell::Number(Some(mean), plain),
                PartCell::Number(number("geometric_sd").or_else(|| number("sd")), plain),
                PartCell::Interval(values.interval(&format!("{kind}/{}/ci95", cell[0])), plain),
            ]);
        }
        if let Some(why) = values.reason(&format!("{kind}/F")) {
            table
                .notes
                .push(format!("No comparison of {kind}: {}.", Untrusted(why)));
        }
    }
    table
}

/// Contrasts of groups and of sessions.
fn group_pairs(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "group_pairs",
        caption: "Contrasts of groups and sessions",
        columns: &[
            ("", "names"),
            ("estimate", "estimate"),
            ("95 %", "estimate_ci95"),
            ("t", "t"),
            ("df", "df"),
            ("p (Holm)", "p_holm"),
            ("g", "hedges_g"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for kind in ["groups", "sessions"] {
        for cell in cells(values, kind, 1) {
            if let Some(mut row) = contrast(values, kind, cell[0]) {
                let g = values.number(&format!("{kind}/{}/hedges_g", cell[0]));
                row.push(PartCell::Number(g, two));
                table.rows.push(row);
            }
        }
    }
    table
}

fn comparisons(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "comparisons",
        caption: "Comparisons with the standard",
        columns: &[
            ("", "participant"),
            ("condition", "condition"),
            ("PSE", "pse"),
            ("95 %", "pse_ci95"),
            ("constant error", "constant_error"),
            ("JND", "jnd"),
            ("Weber fraction", "weber_fraction"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for cell in cells(values, "psy", 2) {
        let id = |statistic: &str| format!("psy/{}/{}/{statistic}", cell[0], cell[1]);
        let number = |statistic: &str| PartCell::Number(values.number(&id(statistic)), plain);
        if values.number(&id("pse")).is_some() {
            table.rows.push(vec![
                named(cell[0]),
                named(cell[1]),
                number("pse"),
                PartCell::Interval(values.interval(&id("pse_ci95")), plain),
                number("constant_error"),
                number("jnd"),
                number("weber_fraction"),
            ]);
        }
    }
    table
}

/// With two decimals; what is 0 but for rounding is 0.
fn two_or_0(x: f64) -> String {
    two(if x.abs() < 1e-9 { 0.0 } else { x })
}

fn sensitivities(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "sensitivities",
        caption: "Sensitivities",
        columns: &[
            ("", "participant"),
            ("condition", "condition"),
            ("d′", "d"),
            ("95 %", "d_ci95"),
            ("bias", "bias"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for cell in cells(values, "sdt", 2) {
        let id = |statistic: &str| format!("sdt/{}/{}/{statistic}", cell[0], cell[1]);
        let number = |statistic: &str| values.number(&id(statistic));
        let differencing = values.get(&id("d_differencing")).is_some();
        let d = if differencing { "d_differencing" } else { "d" };
        let bias = ["criterion", "interval_bias", "bias"]
            .iter()
            .find_map(|b| number(b));
        table.rows.push(vec![
            named(cell[0]),
            named(cell[1]),
            PartCell::Number(number(d), two),
            PartCell::Interval(values.interval(&id(&format!("{d}_ci95"))), two),
            PartCell::Number(bias, two_or_0),
        ]);
    }
    for cell in cells(values, "sdt_group", 1) {
        let id = |statistic: &str| format!("sdt_group/{}/{statistic}", cell[0]);
        if let Some(mean) = values.number(&id("d/mean")) {
            table.notes.push(format!(
                "{}: mean d′ {} {} of {} participants.",
                name(cell[0]),
                two(mean),
                interval_or_dash(values.interval(&id("d/ci95")), two),
                values.number(&id("n")).unwrap_or_default(),
            ));
        }
    }
    table
}

/// Items, the most preferred first.
fn abilities(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "preferences",
        caption: "Preferences",
        columns: &[
            ("", "realization"),
            ("ability", "ability"),
            ("SE", "se"),
            ("95 %", "ability_ci95"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
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
        table.notes.push(format!("No abilities: {}.", name(why)));
        return table;
    }
    for (item, ability) in items {
        let number = |what: &str| values.number(&format!("pairs/ability_{what}/{item}"));
        table.rows.push(vec![
            named(item),
            PartCell::Number(ability, two),
            PartCell::Number(number("se"), two),
            PartCell::Interval(number("ci95_lo").zip(number("ci95_hi")), two),
        ]);
    }
    if let Some(order) = values.number("pairs/order") {
        let p = or_dash(values.number("pairs/order_p"), apa::p);
        table.notes.push(format!(
            "Order: {} for what is presented first, p {p}.",
            two(order)
        ));
    }
    table
}

/// Differences of abilities.
fn differences(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "preference_pairs",
        caption: "Differences of abilities",
        columns: &[
            ("", "realizations"),
            ("difference", "difference"),
            ("SE", "se"),
            ("clustered", "se_clustered"),
            ("preferred", "preferred"),
            ("p (Holm)", "p_holm"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for (id, value) in values.iter() {
        let pair = id
            .strip_prefix("pairs/")
            .and_then(|p| p.strip_suffix("/difference"));
        let (Some(pair), Value::Number(difference)) = (pair, value) else {
            continue;
        };
        let number = |statistic: &str| values.number(&format!("pairs/{pair}/{statistic}"));
        table.rows.push(vec![
            PartCell::Name(pair.replace('|', " − ")),
            PartCell::Number(Some(*difference), two),
            PartCell::Number(number("se"), two),
            PartCell::Number(number("se_clustered"), two),
            PartCell::Number(number("preferred"), two),
            PartCell::Number(number("p_holm"), bare_p),
        ]);
    }
    table
}
