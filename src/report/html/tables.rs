//! The main tables.

use super::safe;
use crate::report::{Site, answers, apa, sentences, sites};
use maud::{Markup, html};
use study_base::text::counted;
use study_core::analyze::{Analysis, RealizationSummary, group_id, pair_id};
use study_core::outcome::Role;

/// Largest number of rows of a table; the CSV has all.
pub(super) const MAX_ROWS: usize = 200;

/// Largest number of rows of a table that is kept on one printed page.
const MAX_WHOLE: usize = 10;

/// A table on the page.
pub(super) struct HtmlTable {
    caption: String,
    head: Vec<String>,
    /// The cells of each row, and whether it is in italics.
    rows: Vec<(bool, Vec<String>)>,
    /// Number of omitted rows.
    omitted: usize,
}

impl HtmlTable {
    pub(super) fn new(caption: &str, head: &[&str]) -> Self {
        Self {
            caption: caption.to_owned(),
            head: head.iter().map(|h| (*h).to_owned()).collect(),
            rows: Vec::new(),
            omitted: 0,
        }
    }

    pub(super) fn row(&mut self, cells: Vec<String>) {
        self.styled_row(false, cells);
    }

    fn styled_row(&mut self, italic: bool, cells: Vec<String>) {
        if self.rows.len() < MAX_ROWS {
            self.rows.push((italic, cells));
        } else {
            self.omitted += 1;
        }
    }

    pub(super) fn render(&self) -> Markup {
        html! {
            @if !self.rows.is_empty() {
                div.scroll.whole[self.rows.len() <= MAX_WHOLE] tabindex="0" role="region" aria-label=(self.caption) {
                    table {
                        caption { (self.caption) }
                        thead { tr { @for h in &self.head { th scope="col" { (safe(h)) } } } }
                        tbody {
                            @for (italic, cells) in &self.rows {
                                tr.italic[*italic] { @for c in cells { td { (safe(c)) } } }
                            }
                        }
                    }
                }
                @if self.omitted > 0 {
                    p.note { (self.omitted) " more rows are in the CSV file." }
                }
            }
        }
    }
}

/// The sites of a pooled analysis with their devices.
pub(super) fn sites(all: &[Site]) -> Markup {
    let mut table = HtmlTable::new(
        "Sites and their devices",
        &[
            "site",
            "participants",
            "sessions",
            "device",
            "commissioning test",
        ],
    );
    for site in all {
        let about = |device: String, check: String| {
            vec![
                site.name.clone(),
                site.participants.to_string(),
                sites::days(site).trim_start_matches(", ").to_owned(),
                device,
                check,
            ]
        };
        if site.devices.is_empty() {
            table.row(about("not recorded".to_owned(), String::new()));
        }
        for d in &site.devices {
            let device = format!(
                "{} {}: {}",
                d.kind,
                d.id,
                counted(d.sessions, "session", "sessions")
            );
            table.row(about(device, sites::check(d)));
        }
    }
    html! {
        @if !all.is_empty() {
            section { h2 { "Sites" } (table.render()) }
        }
    }
}

pub(super) fn section(a: &Analysis) -> Markup {
    let mut realizations_with = a.realizations.iter();
    let any_interval =
        realizations_with.any(|m| a.described(&m.id, "subject_mean/ci95_lo").is_some());
    html! {
        section {
            h2 { "Tables" }
            @if !a.realizations.is_empty() {
                (realizations(a).render())
                p.note {
                    "n: number of ratings. Mean, SD (standard deviation, n − 1) and median are over all \
                     ratings of a realization"
                    @if any_interval { "; the interval is a 95 % t interval of the mean over participants" }
                    "."
                    @if a.realizations.iter().any(|m| !m.tested) {
                        " Realizations in italics are not included in the tests."
                    }
                }
            }
            (pairs(a))
            @for table in against_references(a) { (table.render()) }
            (repeats(a).render())
            (shares(a).render())
            (agreement(a).render())
            @if !answers::variance_shares(a).is_empty() {
                p.note { "Shares are rounded to whole per cent, so their sum can be 99 or 101." }
            }
            (glossary(a))
            (with_and_without(a).render())
            (subjects(a))
        }
    }
}

/// Definitions of the symbols on the page.
fn glossary(a: &Analysis) -> Markup {
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
            "Generalised η²: share of the variance explained by the realizations.",
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
    html! { @if !all.is_empty() { p.note { (all.join(" ")) } } }
}

fn show(x: Option<f64>, decimals: usize) -> String {
    apa::or_dash(x, |x| apa::number(x, decimals))
}

fn show_p(x: Option<f64>) -> String {
    apa::or_dash(x, apa::bare_p)
}

fn role(m: &RealizationSummary) -> String {
    match &m.duplicate_of {
        Some(of) => format!("duplicate of {}", apa::name(of)),
        None => m.role.as_str().to_owned(),
    }
}

fn realizations(a: &Analysis) -> HtmlTable {
    let v = &a.values;
    let share = a.realistic_from.map(|f| format!("≥ {f}"));
    let has_vaf = a.realizations.iter().any(|m| m.vaf.is_some());
    let mut head = vec!["realization", "role"];
    head.extend(has_vaf.then_some("VAF"));
    head.extend(["n", "mean", "SD", "median", "95 % CI"]);
    let adjusted = !a.design.is_complete();
    head.extend(adjusted.then_some("adjusted mean"));
    head.extend(share.as_deref());
    let mut table = HtmlTable::new("Ratings by realization", &head);
    let mut listed: Vec<&RealizationSummary> = a.realizations.iter().collect();
    listed.sort_by_key(|m| !m.tested);
    let vaf: Vec<f64> = listed.iter().filter_map(|m| m.vaf).collect();
    let digits = apa::distinguishing_decimals(&vaf);
    for m in listed {
        let get = |what: &str| a.described(&m.id, what);
        let ci = v.interval(&format!("{}/subject_mean/ci95", group_id("desc", &[&m.id])));
        let mut row = vec![apa::name(&m.id), role(m)];
        row.extend(has_vaf.then(|| apa::or_dash(m.vaf, |v| apa::share(v, digits))));
        row.extend([
            show(get("n"), 0),
            show(get("mean"), 3),
            show(get("sd"), 3),
            show(get("median"), 1),
            apa::interval_or_dash(ci, apa::two),
        ]);
        if adjusted {
            row.push(show(a.about("adjusted", &[&m.id], "mean"), 3));
        }
        if share.is_some() {
            let s = a.about("realistic", &[&m.id], "share");
            row.push(apa::or_dash(s, apa::percent));
        }
        table.styled_row(!m.tested, row);
    }
    table
}

fn pairs(a: &Analysis) -> Markup {
    let wilcoxon = |first: &str, second: &str| {
        let id = pair_id("posthoc", first, second);
        a.values.number(&format!("{id}/p_wilcoxon_exact_holm"))
    };
    let any = (a.pairs.iter()).any(|p| wilcoxon(&p.first, &p.second).is_some());
    let mut head = vec![
        "pair (a − b)",
        "difference",
        "95 % CI",
        "dz",
        "t",
        "p (Holm)",
    ];
    head.extend(any.then_some("p (Wilcoxon, Holm)"));
    let mut table = HtmlTable::new("Pairs of realizations", &head);
    for pair in &a.pairs {
        // Cancelling thirds leave a rounding error.
        let whole = |x: f64| if x.abs() < 1e-9 { 0.0 } else { x };
        let test = pair.test.as_ref();
        let t = test.and_then(|t| Some(whole(t.statistic.as_ref()?.value)));
        let mut row = vec![
            format!("{} − {}", apa::name(&pair.first), apa::name(&pair.second)),
            apa::number(whole(pair.difference.value), 3),
            apa::interval_or_dash(pair.difference.ci95, apa::two),
            show(pair.dz.map(whole), 2),
            show(t, 2),
            test.map_or_else(
                || "–".to_owned(),
                |t| {
                    apa::p_beside(t.p, t.level)
                        .trim_start_matches("= ")
                        .to_owned()
                },
            ),
        ];
        row.extend(any.then(|| show_p(wilcoxon(&pair.first, &pair.second))));
        table.row(row);
    }
    html! {
        (table.render())
        @if let Some(test) = a.pairs.iter().find_map(|p| p.test.as_ref()) {
            p.note {
                "Differences of " (if a.design.uses_complete() { "cell means over participants" } else { "adjusted means" })
                "; the intervals are not corrected for the number of pairs, p (" (sentences::test_name(test.kind))
                ") has Holm's correction over " (counted(test.comparisons, "pair", "pairs")) "."
            }
        }
    }
}

/// Each tested realization minus each reference, anchor and physical sample.
fn against_references(a: &Analysis) -> Vec<HtmlTable> {
    let v = &a.values;
    let roles = [
        Role::HiddenReference,
        Role::Physical,
        Role::LowAnchor,
        Role::MidAnchor,
    ];
    let references = a.realizations.iter().filter(|m| roles.contains(&m.role));
    let one = |r: &RealizationSummary| {
        let caption = format!(
            "Differences from {} ({})",
            apa::name(&r.id),
            r.role.as_str().replace('-', " ")
        );
        let mut head = vec!["realization", "n", "difference", "95 % CI", "p (t, Holm)"];
        let id = |t: &RealizationSummary| group_id("reference", &[&r.id, &t.id]);
        let contrast = |t: &RealizationSummary, what: &str| v.number(&format!("{}/{what}", id(t)));
        let equivalence = a.tested().any(|t| contrast(t, "p_tost").is_some());
        head.extend(equivalence.then_some("p (equivalence)"));
        let mut table = HtmlTable::new(&caption, &head);
        for t in a.tested() {
            let get = |what: &str| contrast(t, what);
            let Some(difference) = get("mean_diff") else {
                continue;
            };
            let ci = v.interval(&format!("{}/ci95", id(t)));
            let mut row = vec![
                apa::name(&t.id),
                show(get("n"), 0),
                apa::number(difference, 3),
                apa::interval_or_dash(ci, apa::two),
                show_p(get("p_t_holm")),
            ];
            row.extend(equivalence.then(|| show_p(get("p_tost"))));
            table.row(row);
        }
        table
    };
    references.map(one).collect()
}

/// Each hidden duplicate minus its original.
fn repeats(a: &Analysis) -> HtmlTable {
    let head = [
        "duplicate",
        "of",
        "n",
        "difference",
        "95 % CI",
        "mean |difference|",
    ];
    let mut table = HtmlTable::new(
        "Hidden duplicates minus their originals, over participants",
        &head,
    );
    for m in &a.realizations {
        let id = group_id("duplicate", &[&m.id]);
        let get = |what: &str| a.values.number(&format!("{id}/{what}"));
        let (Some(of), Some(difference)) = (&m.duplicate_of, get("mean_diff")) else {
            continue;
        };
        let ci = a.values.interval(&format!("{id}/ci95"));
        table.row(vec![
            apa::name(&m.id),
            apa::name(of),
            show(get("n"), 0),
            apa::number(difference, 3),
            apa::interval_or_dash(ci, apa::two),
            show(get("mean_absolute_diff"), 3),
        ]);
    }
    table
}

fn shares(a: &Analysis) -> HtmlTable {
    let mut table = HtmlTable::new("Variance components", &["component", "share"]);
    for (name, share) in answers::variance_shares(a) {
        table.row(vec![name.to_owned(), apa::percent(share)]);
    }
    table
}

/// The confidence interval of a coefficient of agreement.
pub(super) fn icc_interval(a: &Analysis, id: &str) -> Option<(f64, f64)> {
    let bound = |end: &str| a.values.number(&format!("{id}/{end}"));
    bound("lo").zip(bound("hi"))
}

fn agreement(a: &Analysis) -> HtmlTable {
    let mut table = HtmlTable::new("Agreement", &["coefficient", "value", "95 % CI"]);
    let v = &a.values;
    for (id, what) in [
        (
            "icc_subjects/ICC2",
            "between participants, single: ICC(2,1)",
        ),
        ("icc_subjects/ICC2k", "between participants, mean: ICC(2,k)"),
        ("icc_repetitions/ICC1", "over repetitions, single: ICC(1,1)"),
        (
            "krippendorff_subjects/ordinal",
            "between participants: Krippendorff's α, ordinal",
        ),
        (
            "krippendorff_repetitions/ordinal",
            "over repetitions: Krippendorff's α, ordinal",
        ),
    ] {
        let Some(x) = v.number(id) else { continue };
        let ci = apa::interval_or_dash(icc_interval(a, id), |x| apa::share(x, 2));
        table.row(vec![what.to_owned(), apa::share(x, 3), ci]);
    }
    for (id, what) in [
        ("desc_all/within_cell_sd", "SD within cells"),
        (
            "desc_all/repeatability_coefficient",
            "repeatability coefficient (1.96 √2 SD)",
        ),
    ] {
        if let Some(x) = v.number(id) {
            table.row(vec![what.to_owned(), apa::number(x, 3), "–".to_owned()]);
        }
    }
    table
}

fn three(x: f64) -> String {
    apa::number(x, 3)
}

fn whole(x: f64) -> String {
    apa::number(x, 0)
}

/// A row of the comparison: name, identifier, format.
type Row = (&'static str, &'static str, fn(f64) -> String);

/// The results that are compared with and without the exclusions, besides the means.
const HEADLINE: [Row; 8] = [
    ("participants", "design/n_subjects", whole),
    ("r of mean rating and VAF", "corr/pearson/r", apa::r),
    (
        "its p, exact",
        "corr/pearson/p_exact_two_sided",
        apa::bare_p,
    ),
    (
        "its p, random permutations",
        "corr/pearson/p_monte_carlo_two_sided",
        apa::bare_p,
    ),
    ("Spearman's ρ", "corr/spearman/rho", apa::r),
    ("F of the realizations", "rmanova/F", three),
    ("its p, Greenhouse–Geisser", "rmanova/p_gg", apa::bare_p),
    ("p of Friedman's test", "friedman/p", apa::bare_p),
];

/// The main results with and without the exclusions.
fn with_and_without(a: &Analysis) -> HtmlTable {
    let head = ["statistic", "with the exclusions", "without them"];
    let mut table = HtmlTable::new("Main results with and without the exclusions", &head);
    let v = &a.values;
    let mut both = |what: String, id: &str, shown: fn(f64) -> String| {
        if let Some(before) = v.number(&format!("before_exclusion/{id}")) {
            let with = apa::or_dash(v.number(id), shown);
            table.row(vec![what, with, shown(before)]);
        }
    };
    for (what, id, shown) in HEADLINE {
        both(what.to_owned(), id, shown);
    }
    for m in &a.realizations {
        let id = format!("{}/mean", group_id("desc", &[&m.id]));
        both(format!("mean of {}", apa::name(&m.id)), &id, three);
    }
    table
}

fn subjects(a: &Analysis) -> Markup {
    let mut head = vec![
        "participant",
        "n",
        "mean",
        "SD",
        "distinct",
        "longest run",
        "SD within cells",
        "r with the others",
    ];
    let has_vaf = a.realizations.iter().any(|m| m.vaf.is_some());
    head.extend(has_vaf.then_some("r with VAF"));
    // Columns of designs with a reference, an anchor or a repeat.
    let extra: Vec<(&str, &str)> = [
        ("hidden_reference_mean", "mean of the references"),
        ("low_anchor_mean", "mean of the anchors"),
        ("repeat_distance", "mean |difference| of duplicates"),
    ]
    .into_iter()
    .filter(|(id, _)| {
        a.listed_subjects()
            .any(|s| a.about("subject", &[s], id).is_some())
    })
    .collect();
    head.extend(extra.iter().map(|(_, what)| *what));
    let mut table = HtmlTable::new(
        "Screening of participants (nobody is excluded by it)",
        &head,
    );
    // A correlation of two points is always ±1.
    let enough = a.tested().count() > 2;
    for s in a.listed_subjects() {
        let get = |what: &str| a.about("subject", &[s], what);
        let r = |x: Option<f64>| apa::or_dash(x.filter(|_| enough), |x| apa::share(x, 2));
        let mut row = vec![
            apa::name(s),
            show(get("n"), 0),
            show(get("mean"), 2),
            show(get("sd"), 2),
            show(get("distinct"), 0),
            show(get("longest_run"), 0),
            show(get("within_cell_sd"), 2),
            r(get("leave_one_out_r")),
        ];
        row.extend(has_vaf.then(|| r(a.about("subject_corr", &[s], "r"))));
        row.extend(extra.iter().map(|(id, _)| show(get(id), 2)));
        table.row(row);
    }
    html! {
        (table.render())
        @if !table.rows.is_empty() {
            p.note {
                "Over all ratings of a participant. Distinct: number of different ratings; longest run: \
                 number of consecutive trials with the same rating; SD within cells: of the repetitions; \
                 r with the others: correlation of the participant's means with those of all others, over \
                 realizations."
            }
        }
    }
}
