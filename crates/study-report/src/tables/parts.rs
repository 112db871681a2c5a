//! The tables of thresholds, sensitivities and preferences: the same on the terminal, in
//! the report and as CSV.

mod scales;

use crate::apa::{self, bare_p, interval_or_dash, listing, name, or_dash, plain, two};
use crate::table::{Builder, Table, page};
use scales::{items, magnitudes, ratings, scores};
use std::collections::{BTreeMap, BTreeSet};
use study_analysis::analyze::{Value, Values, unescaped};
use study_base::text::Untrusted;

/// A kind of table: the file it goes into, and how it is made.
type Kind = (&'static str, fn(&Values) -> Table);

/// All tables, in the order of a page; those without rows and notes are left out of it.
pub(crate) const KINDS: [Kind; 14] = [
    ("part_thresholds.csv", thresholds),
    ("part_conditions.csv", conditions),
    ("part_contrasts.csv", contrasts),
    ("part_comparisons.csv", comparisons),
    ("part_sensitivities.csv", sensitivities),
    ("part_preferences.csv", abilities),
    ("part_preference_pairs.csv", differences),
    ("part_magnitudes.csv", magnitudes),
    ("part_magnitude_contrasts.csv", magnitude_contrasts),
    ("part_mushra.csv", ratings),
    ("part_scores.csv", scores),
    ("part_items.csv", items),
    ("part_groups.csv", groups),
    ("part_group_pairs.csv", group_pairs),
];

/// All tables of these statistics; those without rows are left out.
pub(crate) fn tables(values: &Values) -> Vec<Table> {
    let tables = KINDS.iter().map(|(_, table)| table(values));
    tables
        .filter(|t| !t.is_empty() || !t.notes.is_empty())
        .collect()
}

/// The names in the identifiers between `group/` and the statistic, each once.
fn names<'a>(values: &'a Values, group: &str) -> BTreeSet<&'a str> {
    cells(values, group).into_iter().map(|c| c.0).collect()
}

/// The first two names in the identifiers after `group/`, each pair once; the second one is
/// empty where the statistic follows the first.
fn cells<'a>(values: &'a Values, group: &str) -> BTreeSet<(&'a str, &'a str)> {
    let names = values.iter().filter_map(|(id, _)| {
        let rest = id.strip_prefix(group)?.strip_prefix('/')?;
        let (first, rest) = rest.split_once('/')?;
        Some((first, rest.split_once('/').map_or("", |r| r.0)))
    });
    names.collect()
}

/// Participant and condition of each cell.
fn participants<'a>(values: &'a Values, group: &str) -> Vec<(&'a str, &'a str)> {
    let cells = cells(values, group).into_iter();
    cells.filter(|cell| !cell.1.is_empty()).collect()
}

/// The two names of a pair, and what stands between them.
fn both(pair: &str, sign: &str) -> String {
    let names: Vec<String> = pair.split('|').map(unescaped).collect();
    names.join(sign)
}

/// The name that stands in a part of an identifier, in a sentence.
fn spelled(part: &str) -> String {
    name(&unescaped(part))
}

/// A statistic of a participant and a condition.
fn of_cell(values: &Values, group: &str, cell: (&str, &str), what: &str) -> Option<f64> {
    values.number(&format!("{group}/{}/{}/{what}", cell.0, cell.1))
}

/// Each participant and condition.
fn thresholds(values: &Values) -> Table {
    let get = |cell: (&str, &str), what: &str| of_cell(values, "psy", cell, what);
    let reversals = |cell: (&str, &str)| of_cell(values, "track", cell, "estimate");
    // Only staircases have reversals.
    let staircases = participants(values, "track").iter().any(|cell| {
        let id = format!("track/{}/{}/estimate", cell.0, cell.1);
        values.get(&id).is_some()
    });
    let cells = participants(values, "psy");
    let own = cells.iter().copied().filter(|cell| cell.0 != "pooled");
    let table = Builder::new("Thresholds", own.clone(), &get)
        .name("", "participant", &|cell| unescaped(cell.0))
        .name("condition", "condition", &|cell| unescaped(cell.1))
        .stat("trials", "n_trials", count)
        .stat_as(
            page("threshold").file("threshold"),
            "posterior/threshold/mean",
            plain,
        )
        .interval(
            page("95 %").file("threshold_ci95"),
            "posterior/threshold/ci95",
            plain,
        )
        .stat_as(page("width").file("width"), "posterior/width/mean", plain)
        .interval(
            page("95 %").file("width_ci95"),
            "posterior/width/ci95",
            plain,
        )
        .stat_as(page("ML").file("ml_threshold"), "ml/threshold", plain)
        .number(
            page("reversals").file("reversal_mean").when(staircases),
            plain,
            &reversals,
        )
        .done();
    if table.is_empty() {
        return table;
    }
    let mut notes = vec![threshold_note(
        cells.iter().any(|cell| get(*cell, "log_scale").is_some()),
        staircases,
    )];
    // What is pooled is not in the table.
    let mut reasons: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for cell in own {
        let id = format!("psy/{}/{}/ml/threshold", cell.0, cell.1);
        if let Some(why) = values.reason(&id) {
            let whose = format!("{} {}", spelled(cell.0), spelled(cell.1));
            reasons.entry(why).or_default().push(whose);
        }
    }
    if !reasons.is_empty() {
        let rests = "Without a maximum of the likelihood a posterior mean rests on its priors as much as on the answers; see its interval.";
        notes.push(rests.to_owned());
    }
    let of_reason = |(why, whose): (&str, Vec<String>)| {
        format!("{}: no maximum of the likelihood: {why}.", listing(&whose))
    };
    notes.extend(reasons.into_iter().map(of_reason));
    let conditions = names(values, "psy_group").into_iter();
    notes.extend(conditions.filter_map(|condition| {
        let id = |what: &str| format!("psy_group/{condition}/posterior_threshold/{what}");
        Some(format!(
            "{}: geometric mean {} {} of {} participants.",
            spelled(condition),
            plain(values.number(&id("geometric_mean"))?),
            interval_or_dash(values.interval(&id("ci95")), plain),
            values.number(&id("n")).unwrap_or_default(),
        ))
    }));
    table.with_notes(notes)
}

/// What the columns of the thresholds are.
fn threshold_note(logarithms: bool, staircases: bool) -> String {
    let scale = match logarithms {
        true => {
            ", over logarithms: the threshold is a level, the width the natural logarithm of a ratio"
        }
        false => "",
    };
    let reversals = match staircases {
        true => " Reversals: the mean of the last reversals, where the rule settles.",
        false => "",
    };
    format!(
        "Threshold: the level at which the function without guesses and lapses is ½. Width: from .05 to \
         .95 of it. Both are posterior means{scale}.{reversals}"
    )
}

/// A number of trials or people.
fn count(n: f64) -> String {
    n.to_string()
}

/// A mean or, of logarithms, a geometric mean.
fn mean(get: &dyn Fn(&str) -> Option<f64>, what: &str) -> Option<f64> {
    get(&format!("geometric_{what}")).or_else(|| get(what))
}

/// Thresholds of the mixed model, by condition.
fn conditions(values: &Values) -> Table {
    let get = |condition: &str, what: &str| values.number(&format!("psy_mixed/{condition}/{what}"));
    let mean = |condition: &str| mean(&|what| get(condition, what), "mean");
    let all = names(values, "psy_mixed").into_iter();
    let all: Vec<&str> = all.filter(|c| mean(c).is_some()).collect();
    let ratios = all.iter().any(|c| get(c, "geometric_mean").is_some());
    let ratios = ratios.then(|| "Geometric means; contrasts are ratios.".to_owned());
    let why = values.reason("psy_mixed/F");
    let why = why.map(|why| format!("No comparison of conditions: {}.", Untrusted(why)));
    Builder::new("Thresholds by condition, mixed model", all, &get)
        .name("", "condition", &unescaped)
        .number(page("mean").file("mean"), plain, &mean)
        .interval(page("95 %").file("mean_ci95"), "ci95", plain)
        .notes(ratios.into_iter().chain(why))
}

/// Contrasts of thresholds.
fn contrasts(values: &Values) -> Table {
    of_pairs(
        values,
        &["psy_mixed"],
        "Contrasts of thresholds",
        "conditions",
    )
    .done()
}

/// Contrasts of estimated magnitudes.
fn magnitude_contrasts(values: &Values) -> Table {
    let caption = "Contrasts of estimated magnitudes";
    of_pairs(values, &["magnitude_mixed"], caption, "conditions").done()
}

/// Contrasts of groups and of sessions.
fn group_pairs(values: &Values) -> Table {
    let caption = "Contrasts of groups and sessions";
    of_pairs(values, &["groups", "sessions"], caption, "names")
        .stat("g", "hedges_g", two)
        .done()
}

/// A contrast: the group of its statistics, and the pair.
type Contrast<'a> = (&'a str, &'a str);

/// The columns that all contrasts have: ratios or differences.
fn of_pairs<'a>(
    values: &'a Values,
    groups: &[&'static str],
    caption: &str,
    file: &str,
) -> Builder<'a, Contrast<'a>> {
    let all = groups.iter().flat_map(|group| {
        let pairs = names(values, group).into_iter();
        pairs.map(move |pair| (*group, pair))
    });
    let ratio = |c: Contrast<'_>| values.number(&format!("{}/{}/ratio", c.0, c.1));
    let difference = |c: Contrast<'_>| values.number(&format!("{}/{}/difference", c.0, c.1));
    let estimate = |c: Contrast<'_>| ratio(c).or_else(|| difference(c));
    let get = move |c: Contrast<'_>, what: &str| values.number(&format!("{}/{}/{what}", c.0, c.1));
    Builder::new(caption, all.filter(|c| estimate(*c).is_some()), get)
        .name("", file, &|c| {
            both(c.1, if ratio(c).is_some() { " / " } else { " − " })
        })
        .number(page("estimate").file("estimate"), plain, &estimate)
        .interval(page("95 %").file("estimate_ci95"), "ci95", plain)
        .stat("t", "t", two)
        .stat("df", "df", two)
        .stat("p (Holm)", "p_holm", bare_p)
}

/// Means of groups and of sessions.
fn groups(values: &Values) -> Table {
    let kinds = ["groups", "sessions"];
    let get =
        |(kind, name): (&str, &str), what: &str| values.number(&format!("{kind}/{name}/{what}"));
    let mean = |row, what| mean(&|what| get(row, what), what);
    let all = kinds.into_iter().flat_map(|kind| {
        let names = names(values, kind).into_iter();
        names.map(move |name| (kind, name))
    });
    let means = all.filter(|row| !row.1.contains('|') && mean(*row, "mean").is_some());
    let why = kinds.into_iter().filter_map(|kind| {
        let why = Untrusted(values.reason(&format!("{kind}/F"))?);
        Some(format!("No comparison of {kind}: {why}."))
    });
    Builder::new("Groups and sessions", means, &get)
        .name("", "name", &|row| unescaped(row.1))
        .stat("n", "n", count)
        .number(page("mean").file("mean"), plain, &|row| mean(row, "mean"))
        .number(page("SD").file("sd"), plain, &|row| mean(row, "sd"))
        .interval(page("95 %").file("mean_ci95"), "ci95", plain)
        .notes(why)
}

fn comparisons(values: &Values) -> Table {
    let get = |cell: (&str, &str), what: &str| of_cell(values, "psy", cell, what);
    let all = participants(values, "psy").into_iter();
    let compared = all.filter(|cell| get(*cell, "pse").is_some());
    Builder::new("Comparisons with the standard", compared, &get)
        .name("", "participant", &|cell| unescaped(cell.0))
        .name("condition", "condition", &|cell| unescaped(cell.1))
        .stat("PSE", "pse", plain)
        .interval(page("95 %").file("pse_ci95"), "pse_ci95", plain)
        .stat("constant error", "constant_error", plain)
        .stat("JND", "jnd", plain)
        .stat("Weber fraction", "weber_fraction", plain)
        .done()
}

/// With two decimals; what is 0 but for rounding is 0.
fn two_or_0(x: f64) -> String {
    two(if x.abs() < 1e-9 { 0.0 } else { x })
}

fn sensitivities(values: &Values) -> Table {
    let number = |cell: (&str, &str), what: &str| of_cell(values, "sdt", cell, what);
    // Where participants compare the intervals, d′ is that of differencing.
    let get = |cell: (&str, &str), what: &str| {
        let id = format!("sdt/{}/{}/d_differencing", cell.0, cell.1);
        match values.get(&id) {
            Some(_) => number(cell, &what.replacen('d', "d_differencing", 1)),
            None => number(cell, what),
        }
    };
    let bias = |cell| {
        let mut all = ["criterion", "interval_bias", "bias"].into_iter();
        all.find_map(|bias| number(cell, bias))
    };
    let groups = names(values, "sdt_group").into_iter().filter_map(|group| {
        let id = |what: &str| format!("sdt_group/{group}/{what}");
        Some(format!(
            "{}: mean d′ {} {} of {} participants.",
            spelled(group),
            two(values.number(&id("d/mean"))?),
            interval_or_dash(values.interval(&id("d/ci95")), two),
            values.number(&id("n")).unwrap_or_default(),
        ))
    });
    Builder::new("Sensitivities", participants(values, "sdt"), &get)
        .name("", "participant", &|cell| unescaped(cell.0))
        .name("condition", "condition", &|cell| unescaped(cell.1))
        .stat("d′", "d", two)
        .interval(page("95 %").file("d_ci95"), "d_ci95", two)
        .number(page("bias").file("bias"), two_or_0, &bias)
        .notes(groups)
}

/// Items, the most preferred first.
fn abilities(values: &Values) -> Table {
    let get = |item: &str, what: &str| values.number(&format!("pairs/{what}/{item}"));
    let ability = |item: &str| get(item, "ability");
    let mut items: Vec<&str> = (values.iter())
        .filter_map(|(id, _)| id.strip_prefix("pairs/ability/"))
        .collect();
    let order = |item: &str| ability(item).unwrap_or(f64::MIN);
    items.sort_by(|a, b| order(b).total_cmp(&order(a)));
    let mut notes = Vec::new();
    if let Some(item) = items.first().filter(|item| ability(item).is_none()) {
        let why = values.reason(&format!("pairs/ability/{item}"));
        notes.push(format!("No abilities: {}.", name(why.unwrap_or_default())));
        items.clear();
    } else if let Some(order) = values.number("pairs/order") {
        let p = or_dash(values.number("pairs/order_p"), apa::p);
        notes.push(format!(
            "Order: {} for what is presented first, p {p}.",
            two(order)
        ));
    }
    Builder::new("Preferences", items, &get)
        .name("", "realization", &unescaped)
        .stat("ability", "ability", two_or_0)
        .stat_as(page("SE").file("se"), "ability_se", two)
        .interval(page("95 %").file("ability_ci95"), "ability_ci95", two)
        .notes(notes)
}

/// Differences of abilities.
fn differences(values: &Values) -> Table {
    let get = |pair: &str, what: &str| values.number(&format!("pairs/{pair}/{what}"));
    let pairs = values.iter().filter_map(|(id, value)| {
        let pair = id.strip_prefix("pairs/")?.strip_suffix("/difference")?;
        matches!(value, Value::Number(_)).then_some(pair)
    });
    Builder::new("Differences of abilities", pairs, &get)
        .name("", "realizations", &|pair| both(pair, " − "))
        .stat("difference", "difference", two_or_0)
        .stat("SE", "se", two)
        .stat("clustered", "se_clustered", two)
        .stat("preferred", "preferred", two)
        .stat("p (Holm)", "p_holm", bare_p)
        .done()
}
