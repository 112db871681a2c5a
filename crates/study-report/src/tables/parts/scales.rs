//! The tables of estimated magnitudes, of ratings beside a reference and of questionnaires.

use super::{names, spelled};
use crate::apa::{interval_or_dash, plain, two};
use crate::table::{Builder, Cell, Table, page};
use study_analysis::analyze::{Values, unescaped};
use study_base::text::counted;

/// Estimates of levels or of realizations.
pub(super) fn magnitudes(values: &Values) -> Table {
    let get = |(kind, name): (&str, &str), what: &str| {
        values.number(&format!("magnitude/{kind}/{name}/{what}"))
    };
    let all = |kind: &'static str| {
        let names = names(values, &format!("magnitude/{kind}"));
        names.into_iter().map(move |name| (kind, name))
    };
    let number = |text: &str| text.parse().unwrap_or(f64::MAX);
    let mut levels: Vec<(&str, &str)> = all("level").collect();
    levels.sort_by(|a, b| number(a.1).total_cmp(&number(b.1)));
    let exponent = values.number("magnitude/exponent").map(|exponent| {
        let interval = values.interval("magnitude/exponent_over_participants/ci95");
        let left_out = values.number("magnitude/n_left_out").unwrap_or_default();
        format!(
            "Exponent {} {}, over participants. {} left out, because not above 0.",
            two(exponent),
            interval_or_dash(interval, two),
            counted(left_out as usize, "estimate", "estimates"),
        )
    });
    let rows = levels.into_iter().chain(all("realization"));
    let mean = page("geometric mean").file("geometric_mean");
    Builder::new("Estimated magnitudes", rows, &get)
        .column(page("").file("level"), &|(kind, name)| match name.parse() {
            Ok(level) if kind == "level" => Cell::Number(Some(level), plain),
            _ => Cell::Name(unescaped(name)),
        })
        .stat_as(mean, "geometric_mean", plain)
        .interval(page("95 %").file("geometric_mean_ci95"), "ci95", plain)
        .notes(exponent)
}

/// Ratings beside a reference.
pub(super) fn ratings(values: &Values) -> Table {
    let get = |name: &str, what: &str| values.number(&format!("mushra/{name}/{what}"));
    let of = |what: &str| -> Vec<&str> {
        let suffix = format!("/{what}");
        (values.iter())
            .filter_map(|(id, _)| id.strip_prefix("mushra/")?.strip_suffix(&suffix))
            .collect()
    };
    let unscreened = |condition: &str| {
        let id = format!("mushra_unscreened/{condition}/mean");
        match values.get(&id) {
            Some(_) => values.number(&id),
            None => get(condition, "mean"),
        }
    };
    let screened: Vec<String> = (of("screened").into_iter())
        .filter(|p| get(p, "screened") == Some(1.0))
        .map(spelled)
        .collect();
    let screened = (!screened.is_empty()).then(|| {
        format!(
            "Screened, and only in the last column, the mean over all: {}.",
            screened.join(", ")
        )
    });
    let half = page("95 %").file("mean_ci95_half");
    let all = page("with screened").file("mean_unscreened");
    Builder::new("Ratings from 0 to 100", of("median"), &get)
        .name("", "condition", &unescaped)
        .stat("median", "median", plain)
        .ends(page("quartiles").file("quartile"), plain, &|c| {
            get(c, "q1").zip(get(c, "q3"))
        })
        .stat("mean", "mean", plain)
        .stat_as(half, "ci95_half", |h| format!("± {}", plain(h)))
        .number(all, plain, &unscreened)
        .notes(screened)
}

/// The score of each participant in a questionnaire.
pub(super) fn scores(values: &Values) -> Table {
    let get = |name: &str, what: &str| values.number(&format!("questionnaire/{what}/{name}"));
    let participants =
        (values.iter()).filter_map(|(id, _)| id.strip_prefix("questionnaire/score/"));
    let number = |what: &str| values.number(&format!("questionnaire/{what}"));
    let mean = number("mean").zip(number("n")).map(|(mean, n)| {
        format!(
            "Score: mean {} {} of {}.",
            plain(mean),
            interval_or_dash(values.interval("questionnaire/ci95"), plain),
            counted(n as usize, "participant", "participants"),
        )
    });
    Builder::new("Scores", participants, &get)
        .name("", "participant", &unescaped)
        .stat("score", "score", plain)
        .notes(mean)
}

/// The answers to the items of a questionnaire, as they were given.
pub(super) fn items(values: &Values) -> Table {
    let get = |item: &str, what: &str| values.number(&format!("questionnaire/item/{item}/{what}"));
    let mut items: Vec<&str> = names(values, "questionnaire/item").into_iter().collect();
    // 2 before 10; names as they are.
    items.sort_by_key(|item| item.parse::<u32>().unwrap_or(0));
    Builder::new("Items, as answered", items, &get)
        .name("item", "item", &unescaped)
        .stat("mean", "mean", two)
        .stat("SD", "sd", two)
        .done()
}
