//! The tables of ratings: one function each for terminal, report and CSV file.

mod exclusions;
pub(crate) mod factors;
pub(crate) mod outcomes;
mod pairs;
pub(crate) mod parts;
mod posterior;
mod rendering;
mod subjects;

pub(crate) use exclusions::{all_with_and_without, excluded, rules, with_and_without};
pub(crate) use pairs::{against_references, pairs, posthoc, repeats};
pub(crate) use posterior::posterior;
pub(crate) use rendering::{is_judged, rendered, rendered_by_participant};
pub(crate) use subjects::subjects;

use crate::apa::{self, one, percent, three, two, whole};
use crate::table::{Builder, Cell, Format, Head, Table, file, page, report, terminal};
use crate::{Site, SiteDevice, answers, plot, sites as of_sites};
use study_analysis::analyze::results::{
    Coefficient, Described, Differences, List, Number as _, Stat,
};
use study_analysis::analyze::{Analysis, RealizationSummary};
use study_base::text::{Untrusted, counted};
use study_session::outcome::Role;
use unicode_width::UnicodeWidthStr as _;

/// Largest width of the name of a hidden duplicate with that of its original.
const MAX_NAME: usize = 30;

/// Largest number of bins of a histogram on the terminal.
const MAX_BINS: usize = 11;

/// Number, median and such of the ratings of each realization; `gap` is between the bars of a
/// histogram.
pub(crate) fn realizations<'a>(a: &'a Analysis, gap: &str) -> Table {
    let results = &a.results.descriptives;
    let all = &results.desc_all;
    let from = all.hist_from.number().unwrap_or(0.0);
    let counts = all.hist.as_ref().and_then(List::numbers);
    let list = |d: &'a Described| d.hist.as_ref()?.numbers();
    let rows: Vec<(&RealizationSummary, &Described)> = (a.realizations.iter())
        .filter_map(|m| Some((m, a.described(&m.id)?)))
        .collect();
    let bins = counts.map_or(0, <[f64]>::len);
    let has_bars = counts.is_some() && bins <= MAX_BINS && from.abs() < 1000.0;
    let most = (rows.iter().filter_map(|r| list(r.1)).flatten().copied()).fold(0.0, f64::max);
    let vaf: Vec<f64> = a.realizations.iter().filter_map(|m| m.vaf).collect();
    let digits = apa::distinguishing_decimals(&vaf);
    let shown_vaf = |m: &RealizationSummary, format: fn(f64, usize) -> String| {
        Cell::Shown(m.vaf, apa::or_dash(m.vaf, |x| format(x, digits)))
    };
    let threshold = a.realistic_from.unwrap_or_default();
    let at_least = |sign: &str| format!("{sign}{threshold}");
    let realistic = |(m, _): (&RealizationSummary, _)| a.realistic(&m.id).map(|r| &r.share);
    let over_participants = |d: &Described| {
        let ci = d.subject_mean.ci95.ends();
        let ci = ci.map_or_else(String::new, |ci| format!(" {}", apa::interval(ci, two)));
        apa::or_dash(d.subject_mean.mean.number(), two) + &ci
    };
    let has_vaf = !vaf.is_empty();
    let vaf_head = if has_vaf {
        report("VAF")
    } else {
        Head::default()
    }
    .file("vaf");
    let mut table = Builder::new("Ratings by realization", rows)
        .apart(&|(m, _)| !m.tested)
        .text(terminal("realization"), &|(m, _)| with_role(m))
        .column(report("realization").file("model"), &|(m, _)| {
            Cell::Name(m.id.clone())
        })
        .text(report("role"), &|(m, _)| role(m))
        .text(file("role"), &|(m, _)| m.role.as_str().to_owned())
        .text(file("duplicate_of"), &|(m, _)| {
            m.duplicate_of.clone().unwrap_or_default()
        })
        .column(vaf_head, &|(m, _)| shown_vaf(m, apa::share))
        .field(page("n").file("n").droppable(3), whole, |(_, d)| &d.n)
        .field(page("mean").file("mean"), three, |(_, d)| &d.mean)
        .field(terminal("sd"), three, |(_, d)| &d.sd)
        .field(report("SD").file("sd"), three, |(_, d)| &d.sd)
        .field(page("median").file("median").droppable(0), one, |(_, d)| {
            &d.median
        })
        .field(file("q1"), two, |(_, d)| &d.q1)
        .field(file("q3"), two, |(_, d)| &d.q3)
        .field(file("min"), two, |(_, d)| &d.min)
        .field(file("max"), two, |(_, d)| &d.max)
        .field(file("subject_mean_n"), two, |(_, d)| &d.subject_mean.n)
        .field(file("subject_mean_mean"), two, |(_, d)| {
            &d.subject_mean.mean
        })
        .field(file("subject_mean_sd"), two, |(_, d)| &d.subject_mean.sd)
        .field(file("subject_mean_sem"), two, |(_, d)| &d.subject_mean.sem);
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
        .ends(interval, two, &|(_, d)| d.subject_mean.ci95.ends())
        .field(half, three, |(_, d)| {
            d.cousineau_morey.as_ref().map(|c| &c.ci95_half)
        })
        .text(bars_head.when(has_bars), &|(_, d)| {
            plot::bars(list(d).unwrap_or(&[]), most, gap)
        })
        .column(terminal("VAF").when(has_vaf), &|(m, _)| {
            shown_vaf(m, apa::number)
        })
        .field(adjusted, three, |(m, _)| a.adjusted(&m.id).map(|c| &c.mean))
        .field(share.when(a.realistic_from.is_some()), percent, realistic)
        .field(file("share_realistic"), percent, realistic)
        .text(terminal("by subject [95 %]"), &|(_, d)| {
            over_participants(d)
        });
    for bin in 0..bins {
        let name = file(&format!("count_{}", apa::digits(from + bin as f64)));
        table = table.number(name, whole, &|(_, d)| list(d)?.get(bin).copied());
    }
    table.notes(about_realizations(a))
}

/// Presentations without a rating, by realization.
pub(crate) fn missing(a: &Analysis) -> Table {
    let missing = a.results.evidence.missing.as_ref();
    let rows = missing.into_iter().flat_map(|m| &m.realization);
    Builder::new("Missing ratings", rows)
        .text(report("realization"), &|(name, _)| name.as_str().to_owned())
        .field(report("presentations"), whole, |(_, of)| &of.n)
        .field(report("without a rating"), whole, |(_, of)| &of.missing)
        .field(report("share"), percent, |(_, of)| &of.share)
        .done()
}

/// What the columns of the realizations are.
fn about_realizations(a: &Analysis) -> Option<String> {
    let mut described = a.results.descriptives.desc.values();
    let interval = match described.any(|d| d.subject_mean.ci95.ends().is_some()) {
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
    let Differences {
        rmanova, friedman, ..
    } = &a.results.evidence.differences;
    let agreement = &a.results.agreement;
    let alpha = [
        &agreement.krippendorff_subjects.ordinal,
        &agreement.krippendorff_repetitions.ordinal,
    ];
    let all: Vec<&str> = [
        (
            rmanova.eps_gg.number().is_some(),
            "ε: departure from sphericity (1: none); it reduces the degrees of freedom.",
        ),
        (
            rmanova.ges.number().is_some(),
            "Generalized η²: share of the variance explained by the realizations.",
        ),
        (
            friedman.kendall_w.number().is_some(),
            "W: concordance of the participants' rankings, from 0 to 1.",
        ),
        (
            alpha.iter().any(|alpha| alpha.number().is_some()),
            "α: agreement beyond chance, at most 1.",
        ),
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
    Builder::new("Variance components", &answers::variance_shares(a))
        .text(report("component"), &|s| s.0.to_owned())
        .number(report("share"), percent, &|s| Some(s.1))
        .done()
}

/// The confidence interval of a coefficient of agreement.
pub(crate) fn icc_interval(icc: &Coefficient) -> Option<(f64, f64)> {
    icc.lo.number().zip(icc.hi.number())
}

/// Agreement of participants and of repetitions.
pub(crate) fn agreement(a: &Analysis) -> Table {
    let all = &a.results.agreement;
    let within = &a.results.descriptives.desc_all;
    let (single, mean) = (&all.icc_subjects.icc2, &all.icc_subjects.icc2k);
    let repeated = &all.icc_repetitions.icc.icc1;
    let of_subjects = &all.krippendorff_subjects.ordinal;
    let of_repetitions = &all.krippendorff_repetitions.ordinal;
    let share: Format = share_3;
    let icc = |what, icc: &'_ Coefficient| (what, icc.value.number(), share, icc_interval(icc));
    let alone = |what, stat: &Stat, format: Format| (what, stat.number(), format, None);
    let coefficients = [
        icc("between participants, single: ICC(2,1)", single),
        icc("between participants, mean: ICC(2,k)", mean),
        icc("over repetitions, single: ICC(1,1)", repeated),
        alone(
            "between participants: Krippendorff's α, ordinal",
            of_subjects,
            share,
        ),
        alone(
            "over repetitions: Krippendorff's α, ordinal",
            of_repetitions,
            share,
        ),
        alone("SD within cells", &within.within_cell_sd, three),
        alone(
            "repeatability coefficient (1.96 √2 SD)",
            &within.repeatability_coefficient,
            three,
        ),
    ];
    let defined = coefficients.into_iter().filter(|c| c.1.is_some());
    let rounded = "Shares are rounded to whole per cent, so their sum can be 99 or 101.";
    let shares = (!answers::variance_shares(a).is_empty()).then(|| rounded.to_owned());
    Builder::new("Agreement", defined)
        .text(report("coefficient"), &|c| c.0.to_owned())
        .column(report("value"), &|c| Cell::Number(c.1, c.2))
        .ends(report("95 % CI"), share_2, &|c| c.3)
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
    Builder::new("Sites and their devices", rows)
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
