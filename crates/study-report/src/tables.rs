//! The tables of ratings: one function each for terminal, report and CSV file.

mod exclusions;
mod pairs;
pub(crate) mod parts;
mod rendering;
mod subjects;

pub(crate) use exclusions::{all_with_and_without, excluded, rules, with_and_without};
pub(crate) use pairs::{against_references, pairs, posthoc, repeats};
pub(crate) use rendering::{is_judged, rendered, rendered_by_participant};
pub(crate) use subjects::subjects;

use crate::apa::{self, one, percent, three, two, whole};
use crate::table::{Builder, Cell, Format, Head, Table, file, none, page, report, terminal};
use crate::{Site, SiteDevice, answers, plot, sites as of_sites};
use study_analysis::analyze::{Analysis, RealizationSummary, group_id};
use study_base::text::{Untrusted, counted};
use study_session::outcome::Role;
use unicode_width::UnicodeWidthStr as _;

/// Largest width of the name of a hidden duplicate with that of its original.
const MAX_NAME: usize = 30;

/// Largest number of bins of a histogram on the terminal.
const MAX_BINS: usize = 11;

/// Number, median and such of the ratings of each realization; `gap` is between the bars of a
/// histogram.
pub(crate) fn realizations(a: &Analysis, gap: &str) -> Table {
    let v = &a.values;
    let get = |m: &RealizationSummary, what: &str| a.described(&m.id, what);
    let list = |m: &RealizationSummary| v.list(&format!("{}/hist", group_id("desc", &[&m.id])));
    let from = v.number("desc_all/hist_from").unwrap_or(0.0);
    let counts = v.list("desc_all/hist");
    let bins = counts.map_or(0, <[f64]>::len);
    let has_bars = counts.is_some() && bins <= MAX_BINS && from.abs() < 1000.0;
    let most = (a.realizations.iter().filter_map(list).flatten().copied()).fold(0.0, f64::max);
    let vaf: Vec<f64> = a.realizations.iter().filter_map(|m| m.vaf).collect();
    let digits = apa::distinguishing_decimals(&vaf);
    let shown_vaf = |m: &RealizationSummary, format: fn(f64, usize) -> String| {
        Cell::Shown(m.vaf, apa::or_dash(m.vaf, |x| format(x, digits)))
    };
    let threshold = a.realistic_from.unwrap_or_default();
    let at_least = |sign: &str| format!("{sign}{threshold}");
    let realistic = |m: &RealizationSummary| a.about("realistic", &[&m.id], "share");
    let over_participants = |m: &RealizationSummary| {
        let end = |end: &str| get(m, &format!("subject_mean/ci95_{end}"));
        let ci = end("lo").zip(end("hi"));
        let ci = ci.map_or_else(String::new, |ci| format!(" {}", apa::interval(ci, two)));
        apa::or_dash(get(m, "subject_mean/mean"), two) + &ci
    };
    let has_vaf = !vaf.is_empty();
    let vaf_head = if has_vaf {
        report("VAF")
    } else {
        Head::default()
    }
    .file("vaf");
    let mut table = Builder::new("Ratings by realization", &a.realizations, &get)
        .apart(&|m| !m.tested)
        .text(terminal("realization"), &with_role)
        .column(report("realization").file("model"), &|m| {
            Cell::Name(m.id.clone())
        })
        .text(report("role"), &role)
        .text(file("role"), &|m| m.role.as_str().to_owned())
        .text(file("duplicate_of"), &|m| {
            m.duplicate_of.clone().unwrap_or_default()
        })
        .column(vaf_head, &|m| shown_vaf(m, apa::share))
        .stat_as(page("n").file("n").droppable(3), "n", whole)
        .stat("mean", "mean", three)
        .stat_as(terminal("sd"), "sd", three)
        .stat_as(report("SD").file("sd"), "sd", three)
        .stat_as(page("median").file("median").droppable(0), "median", one)
        .in_file("q1")
        .in_file("q3")
        .in_file("min")
        .in_file("max");
    for what in ["n", "mean", "sd", "sem"] {
        let name = file(&format!("subject_mean_{what}"));
        table = table.stat_as(name, &format!("subject_mean/{what}"), two);
    }
    let interval = report("95 % CI").file("subject_mean_ci95");
    let half = file("cousineau_morey_ci95_half");
    let bars_head = terminal(&scale(from, bins, gap))
        .aligned_left()
        .droppable(1);
    let adjusted = report("adjusted mean").when(!a.design.is_complete());
    let share = page(&at_least("≥ "))
        .on_terminal(&at_least("≥"))
        .droppable(2);
    table = table
        .interval(interval, "subject_mean/ci95", two)
        .stat_as(half, "cousineau_morey/ci95_half", three)
        .text(bars_head.when(has_bars), &|m| {
            plot::bars(list(m).unwrap_or(&[]), most, gap)
        })
        .column(terminal("VAF").when(has_vaf), &|m| {
            shown_vaf(m, apa::number)
        })
        .number(adjusted, three, &|m| a.about("adjusted", &[&m.id], "mean"))
        .number(share.when(a.realistic_from.is_some()), percent, &realistic)
        .number(file("share_realistic"), percent, &realistic)
        .text(terminal("by subject [95 %]"), &over_participants);
    for bin in 0..bins {
        let name = file(&format!("count_{}", apa::digits(from + bin as f64)));
        table = table.number(name, whole, &|m| list(m)?.get(bin).copied());
    }
    table.notes(about_realizations(a))
}

/// What the columns of the realizations are.
fn about_realizations(a: &Analysis) -> Option<String> {
    let has_interval =
        |m: &RealizationSummary| a.described(&m.id, "subject_mean/ci95_lo").is_some();
    let interval = match a.realizations.iter().any(has_interval) {
        true => "; the interval is a 95 % t interval of the mean over participants",
        false => "",
    };
    let apart = match a.realizations.iter().all(|m| m.tested) {
        true => "",
        false => " Realizations in italics are not included in the tests.",
    };
    (!a.realizations.is_empty()).then(|| {
        format!(
            "n: number of ratings. Mean, SD (standard deviation, n − 1) and median are over all ratings of \
             a realization{interval}.{apart}"
        )
    })
}

/// The digits of the scale, or its ends, above the bars of a histogram.
fn scale(from: f64, bins: usize, gap: &str) -> String {
    let last = from + bins as f64 - 1.0;
    if from < 0.0 || last > 9.0 {
        return format!("{from}…{last}");
    }
    let digits = (0..bins).map(|b| (from + b as f64).to_string());
    digits.collect::<Vec<_>>().join(gap)
}

/// Name and role of a realization, on the terminal.
pub(crate) fn with_role(m: &RealizationSummary) -> String {
    let id = Untrusted(&m.id);
    match (&m.duplicate_of, m.role) {
        (Some(of), _) => {
            let whole = format!("{id} (duplicate of {})", Untrusted(of));
            if whole.width() <= MAX_NAME {
                whole
            } else {
                format!("{id} (duplicate)")
            }
        }
        (None, Role::Test) => id.to_string(),
        (None, role) => format!("{id} ({})", role.as_str()),
    }
}

/// The role of a realization, in the report.
fn role(m: &RealizationSummary) -> String {
    match &m.duplicate_of {
        Some(of) => format!("duplicate of {}", apa::name(of)),
        None => m.role.as_str().to_owned(),
    }
}

/// Definitions of the symbols on the page.
fn glossary(a: &Analysis) -> Option<String> {
    let any = |ids: &[&str]| ids.iter().any(|id| a.values.number(id).is_some());
    let alpha = [
        "krippendorff_subjects/ordinal",
        "krippendorff_repetitions/ordinal",
    ];
    let all: Vec<&str> = [
        (
            any(&["rmanova/eps_gg"]),
            "ε: departure from sphericity (1: none); it reduces the degrees of freedom.",
        ),
        (
            any(&["rmanova/ges"]),
            "Generalized η²: share of the variance explained by the realizations.",
        ),
        (
            any(&["friedman/kendall_W"]),
            "W: concordance of the participants' rankings, from 0 to 1.",
        ),
        (any(&alpha), "α: agreement beyond chance, at most 1."),
        (
            a.pairs.iter().any(|p| p.dz.is_some()),
            "dz: mean difference divided by the standard deviation of the differences.",
        ),
    ]
    .into_iter()
    .filter(|(shown, _)| *shown)
    .map(|(_, text)| text)
    .collect();
    (!all.is_empty()).then(|| all.join(" "))
}

/// The components of the variance, with their shares.
pub(crate) fn variance(a: &Analysis) -> Table {
    Builder::new("Variance components", &answers::variance_shares(a), &none)
        .text(report("component"), &|s| s.0.to_owned())
        .number(report("share"), percent, &|s| Some(s.1))
        .done()
}

/// The confidence interval of a coefficient of agreement.
pub(crate) fn icc_interval(a: &Analysis, id: &str) -> Option<(f64, f64)> {
    let bound = |end: &str| a.values.number(&format!("{id}/{end}"));
    bound("lo").zip(bound("hi"))
}

/// What a coefficient of agreement is, its identifier and its format.
const COEFFICIENTS: [(&str, &str, Format); 7] = [
    (
        "between participants, single: ICC(2,1)",
        "icc_subjects/ICC2",
        share_3,
    ),
    (
        "between participants, mean: ICC(2,k)",
        "icc_subjects/ICC2k",
        share_3,
    ),
    (
        "over repetitions, single: ICC(1,1)",
        "icc_repetitions/ICC1",
        share_3,
    ),
    (
        "between participants: Krippendorff's α, ordinal",
        "krippendorff_subjects/ordinal",
        share_3,
    ),
    (
        "over repetitions: Krippendorff's α, ordinal",
        "krippendorff_repetitions/ordinal",
        share_3,
    ),
    ("SD within cells", "desc_all/within_cell_sd", three),
    (
        "repeatability coefficient (1.96 √2 SD)",
        "desc_all/repeatability_coefficient",
        three,
    ),
];

/// Agreement of participants and of repetitions.
pub(crate) fn agreement(a: &Analysis) -> Table {
    let defined = COEFFICIENTS
        .iter()
        .filter(|c| a.values.number(c.1).is_some());
    let rounded = "Shares are rounded to whole per cent, so their sum can be 99 or 101.";
    let shares = (!answers::variance_shares(a).is_empty()).then(|| rounded.to_owned());
    Builder::new("Agreement", defined, none)
        .text(report("coefficient"), &|c| c.0.to_owned())
        .column(report("value"), &|c| {
            Cell::Number(a.values.number(c.1), c.2)
        })
        .ends(report("95 % CI"), share_2, &|c| icc_interval(a, c.1))
        .notes(shares.into_iter().chain(glossary(a)))
}

fn share_2(x: f64) -> String {
    apa::share(x, 2)
}

fn share_3(x: f64) -> String {
    apa::share(x, 3)
}

/// The sites of a pooled analysis with their devices.
pub(crate) fn sites(all: &[Site]) -> Table {
    let rows = all.iter().flat_map(|site| {
        let none = site.devices.is_empty().then_some((site, None));
        let devices = site.devices.iter().map(move |d| (site, Some(d)));
        none.into_iter().chain(devices)
    });
    let device = |d: &SiteDevice| {
        let sessions = counted(d.sessions, "session", "sessions");
        format!("{} {}: {sessions}", d.kind, d.id)
    };
    Builder::new("Sites and their devices", rows, &none)
        .text(report("site"), &|(site, _)| site.name.clone())
        .text(report("participants"), &|(site, _)| {
            site.participants.to_string()
        })
        .text(report("sessions"), &|(site, _)| {
            of_sites::days(site).trim_start_matches(", ").to_owned()
        })
        .text(report("device"), &|(_, d)| {
            d.map_or_else(|| "not recorded".to_owned(), device)
        })
        .text(report("commissioning test"), &|(_, d)| {
            d.map_or_else(String::new, of_sites::check)
        })
        .done()
}
