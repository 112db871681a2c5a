//! Tables that a reader looks for first.

use super::{answers, safe};
use crate::report::apa;
use maud::{Markup, html};
use study_core::analyze::{Analysis, Listed, Value};
use study_core::outcome::Role;

/// Most rows of a table; the rest is in the CSV.
pub(super) const MAX_ROWS: usize = 200;

/// Rows of a table that is not cut at the end of a page.
const MAX_WHOLE: usize = 15;

/// A table: head, rows, and which of them stand beside the others.
struct Table {
    caption: String,
    head: Vec<String>,
    rows: Vec<(bool, Vec<String>)>,
    /// Rows that are left out.
    more: usize,
}

impl Table {
    fn new(caption: &str, head: &[&str]) -> Self {
        Self {
            caption: caption.to_owned(),
            head: head.iter().map(|h| (*h).to_owned()).collect(),
            rows: Vec::new(),
            more: 0,
        }
    }

    fn row(&mut self, beside: bool, cells: Vec<String>) {
        if self.rows.len() < MAX_ROWS {
            self.rows.push((beside, cells));
        } else {
            self.more += 1;
        }
    }

    fn render(&self) -> Markup {
        html! {
            @if !self.rows.is_empty() {
                div.scroll.whole[self.rows.len() <= MAX_WHOLE] tabindex="0" role="region" aria-label=(self.caption) {
                    table {
                        caption { (self.caption) }
                        thead { tr { @for h in &self.head { th scope="col" { (safe(h)) } } } }
                        tbody {
                            @for (beside, cells) in &self.rows {
                                tr.beside[*beside] { @for c in cells { td { (safe(c)) } } }
                            }
                        }
                    }
                }
                @if self.more > 0 {
                    p.note { (self.more) " more rows are in the CSV file." }
                }
            }
        }
    }
}

pub(super) fn section(a: &Analysis) -> Markup {
    let any_interval = a.realizations.iter().any(|m| {
        let id = format!("desc/{}/subject_mean/ci95_lo", m.id);
        a.values.number(&id).is_some()
    });
    html! {
        section {
            h2 { "Tables" }
            @if !a.realizations.is_empty() {
                (realizations(a).render())
                p.note {
                    "n: ratings. Mean, SD (standard deviation, n − 1) and median are over all ratings of a \
                     realization"
                    @if any_interval { "; the interval is a 95 % t interval of the mean over subjects" }
                    "."
                    @if a.realizations.len() > answers::tests(a).len() {
                        " Realizations in italics stand beside the tested ones."
                    }
                }
            }
            (pairs(a))
            @for table in against_references(a) { (table.render()) }
            (repeats(a).render())
            (shares(a).render())
            @if !answers::shares(a).is_empty() {
                p.note { "Shares are rounded to whole per cent: their sum can be 99 or 101." }
            }
            (agreement(a).render())
            (glossary(a))
            (with_and_without(a).render())
            (subjects(a))
        }
    }
}

/// What the letters mean, of those that are on the page.
fn glossary(a: &Analysis) -> Markup {
    let any = |ids: &[&str]| ids.iter().any(|id| a.values.number(id).is_some());
    let alpha = [
        "krippendorff_subjects/ordinal",
        "krippendorff_repetitions/ordinal",
    ];
    let all: Vec<&str> = [
        (
            any(&["rmanova/eps_gg"]),
            "ε: how nearly all differences vary alike (1: they do); it lowers the degrees of freedom.",
        ),
        (
            any(&["rmanova/ges"]),
            "Generalised η²: share of the variance that the realizations have.",
        ),
        (
            any(&["friedman/kendall_W"]),
            "W: how alike subjects rank, from 0 to 1.",
        ),
        (any(&alpha), "α: agreement beyond chance, 1 at most."),
        (
            !crate::report::pairs(a).0.is_empty(),
            "dz: mean difference by the standard deviation of the differences.",
        ),
    ]
    .into_iter()
    .filter(|(there, _)| *there)
    .map(|(_, text)| text)
    .collect();
    html! { @if !all.is_empty() { p.note { (all.join(" ")) } } }
}

fn show(x: Option<f64>, decimals: usize) -> String {
    x.map_or_else(|| "–".to_owned(), |x| apa::number(x, decimals))
}

fn role(m: &Listed) -> String {
    match &m.duplicate_of {
        Some(of) => format!("repeats {}", apa::name(of)),
        None => m.role.as_str().to_owned(),
    }
}

fn realizations(a: &Analysis) -> Table {
    let v = &a.values;
    let share = a.realistic_from.map(|f| format!("≥ {f}"));
    let mut head = vec![
        "realization",
        "role",
        "VAF",
        "n",
        "mean",
        "SD",
        "median",
        "95 % CI",
    ];
    head.extend(share.as_deref());
    let mut table = Table::new("Ratings by realization", &head);
    let tests = answers::tests(a);
    let beside = |m: &Listed| !tests.iter().any(|t| t.id == m.id);
    let mut listed: Vec<&Listed> = a.realizations.iter().collect();
    listed.sort_by_key(|m| beside(m));
    let vaf: Vec<f64> = listed.iter().filter_map(|m| m.vaf).collect();
    let digits = apa::telling(&vaf);
    for m in listed {
        let get = |what: &str| v.number(&format!("desc/{}/{what}", m.id));
        let ends = get("subject_mean/ci95_lo").zip(get("subject_mean/ci95_hi"));
        let mut row = vec![
            apa::name(&m.id),
            role(m),
            m.vaf
                .map_or_else(|| "–".to_owned(), |v| apa::share(v, digits)),
            show(get("n"), 0),
            show(get("mean"), 3),
            show(get("sd"), 3),
            show(get("median"), 1),
            ends.map_or_else(
                || "–".to_owned(),
                |(l, h)| apa::interval(l, h, |x| apa::number(x, 2)),
            ),
        ];
        if share.is_some() {
            let s = v.number(&format!("realistic/{}/share", m.id));
            row.push(s.map_or_else(|| "–".to_owned(), apa::percent));
        }
        table.row(beside(m), row);
    }
    table
}

fn pairs(a: &Analysis) -> Markup {
    let head = [
        "pair (a minus b)",
        "difference",
        "dz",
        "t",
        "p (t, Holm)",
        "p (Wilcoxon, Holm)",
    ];
    let mut table = Table::new("Pairs of realizations", &head);
    let v = &a.values;
    let (compared, least) = crate::report::pairs(a);
    for (first, second) in &compared {
        let get = |what: &str| v.number(&format!("posthoc/{first}|{second}/{what}"));
        // thirds that cancel leave the digits that rounding left
        let shown = |what: &str, decimals: usize| {
            let x = get(what).map(|x| if x.abs() < 1e-9 { 0.0 } else { x });
            show(x, decimals)
        };
        let p = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), apa::p);
        table.row(
            false,
            vec![
                format!("{} − {}", apa::name(first), apa::name(second)),
                shown("mean_diff", 3),
                shown("dz", 2),
                shown("t", 2),
                p(get("p_t_holm")),
                p(get("p_wilcoxon_exact_holm")),
            ],
        );
    }
    html! {
        (table.render())
        @if !compared.is_empty() {
            p.note {
                "Differences of cell means over subjects; dz: mean difference by its standard deviation; \
                 p of the paired t test and of Wilcoxon’s signed-rank test (exact), with Holm’s \
                 correction over all pairs."
                @if let Some(least) = least.filter(|l| *l >= 0.05) {
                    " " (answers::too_few_for_pairs(compared.len(), least))
                }
            }
        }
    }
}

/// Each tested realization minus each reference, anchor and physical sample.
fn against_references(a: &Analysis) -> Vec<Table> {
    let v = &a.values;
    let beside = [Role::HiddenReference, Role::Physical, Role::LowAnchor];
    let references = a.realizations.iter().filter(|m| beside.contains(&m.role));
    let one = |r: &Listed| {
        let caption = format!(
            "Differences from {} ({})",
            apa::name(&r.id),
            r.role.as_str().replace('-', " ")
        );
        let mut head = vec!["realization", "n", "difference", "95 % CI", "p (t, Holm)"];
        let contrast =
            |t: &Listed, what: &str| v.number(&format!("reference/{}/{}/{what}", r.id, t.id));
        let tests = answers::tests(a);
        let equivalence = tests.iter().any(|t| contrast(t, "p_tost").is_some());
        head.extend(equivalence.then_some("p (equivalence)"));
        let mut table = Table::new(&caption, &head);
        for t in tests {
            let get = |what: &str| contrast(t, what);
            let Some(difference) = get("mean_diff") else {
                continue;
            };
            let p = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), apa::p);
            let mut row = vec![
                apa::name(&t.id),
                show(get("n"), 0),
                apa::number(difference, 3),
                ends(get("ci95_lo"), get("ci95_hi")),
                p(get("p_t_holm")),
            ];
            row.extend(equivalence.then(|| p(get("p_tost"))));
            table.row(false, row);
        }
        table
    };
    references.map(one).collect()
}

/// Each hidden repeat minus its original.
fn repeats(a: &Analysis) -> Table {
    let head = [
        "repeat",
        "of",
        "n",
        "difference",
        "95 % CI",
        "mean distance",
    ];
    let mut table = Table::new("Hidden repeats minus their originals, over subjects", &head);
    for m in &a.realizations {
        let get = |what: &str| a.values.number(&format!("duplicate/{}/{what}", m.id));
        let (Some(of), Some(difference)) = (&m.duplicate_of, get("mean_diff")) else {
            continue;
        };
        table.row(
            false,
            vec![
                apa::name(&m.id),
                apa::name(of),
                show(get("n"), 0),
                apa::number(difference, 3),
                ends(get("ci95_lo"), get("ci95_hi")),
                show(get("mean_absolute_diff"), 3),
            ],
        );
    }
    table
}

/// An interval, or a dash.
fn ends(low: Option<f64>, high: Option<f64>) -> String {
    low.zip(high).map_or_else(
        || "–".to_owned(),
        |(l, h)| apa::interval(l, h, |x| apa::number(x, 2)),
    )
}

fn shares(a: &Analysis) -> Table {
    let mut table = Table::new("Shares of variance", &["of", "share"]);
    for (name, share) in answers::shares(a) {
        table.row(false, vec![name.to_owned(), apa::percent(share)]);
    }
    table
}

fn agreement(a: &Analysis) -> Table {
    let mut table = Table::new("Agreement", &["coefficient", "value", "95 % CI"]);
    let v = &a.values;
    for (id, what) in [
        ("icc_subjects/ICC2", "subjects, one: ICC(2,1)"),
        ("icc_subjects/ICC2k", "subjects, their mean: ICC(2,k)"),
        ("icc_repetitions/ICC1", "repetitions, one: ICC(1,1)"),
        (
            "krippendorff_subjects/ordinal",
            "subjects: Krippendorff’s α, ordinal",
        ),
        (
            "krippendorff_repetitions/ordinal",
            "repetitions: Krippendorff’s α, ordinal",
        ),
    ] {
        let Some(x) = v.number(id) else { continue };
        let ends = v
            .number(&format!("{id}/lo"))
            .zip(v.number(&format!("{id}/hi")));
        let ends = ends.map_or_else(
            || "–".to_owned(),
            |(l, h)| apa::interval(l, h, |x| apa::share(x, 2)),
        );
        table.row(false, vec![what.to_owned(), apa::share(x, 3), ends]);
    }
    for (id, what) in [
        ("desc_all/within_cell_sd", "SD within cells"),
        (
            "desc_all/repeatability_coefficient",
            "repeatability coefficient (1.96 √2 SD)",
        ),
    ] {
        if let Some(x) = v.number(id) {
            table.row(
                false,
                vec![what.to_owned(), apa::number(x, 3), "–".to_owned()],
            );
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

/// A row of the comparison: what, its identifier, how it is printed.
type Row = (&'static str, &'static str, fn(f64) -> String);

/// What is compared with and without the exclusions, beside the means.
const HEADLINE: [Row; 8] = [
    ("participants", "design/n_subjects", whole),
    ("r of mean rating and VAF", "corr/pearson/r", apa::r),
    ("its p, exact", "corr/pearson/p_exact_two_sided", apa::p),
    (
        "its p, random permutations",
        "corr/pearson/p_monte_carlo_two_sided",
        apa::p,
    ),
    ("Spearman’s ρ", "corr/spearman/rho", apa::r),
    ("F of the realizations", "rmanova/F", three),
    ("its p, Greenhouse–Geisser", "rmanova/p_gg", apa::p),
    ("p of Friedman’s test", "friedman/p", apa::p),
];

/// The headline with the exclusions and without them.
fn with_and_without(a: &Analysis) -> Table {
    let head = ["statistic", "with the exclusions", "without them"];
    let mut table = Table::new("The headline with and without the exclusions", &head);
    let v = &a.values;
    let mut both = |what: String, id: &str, shown: fn(f64) -> String| {
        let pair = (v.number(id), v.number(&format!("before_exclusion/{id}")));
        if let (with, Some(before)) = pair {
            let with = with.map_or_else(|| "–".to_owned(), shown);
            table.row(false, vec![what, with, shown(before)]);
        }
    };
    for (what, id, shown) in HEADLINE {
        both(what.to_owned(), id, shown);
    }
    for m in &a.realizations {
        let id = format!("desc/{}/mean", m.id);
        both(format!("mean of {}", apa::name(&m.id)), &id, three);
    }
    table
}

fn subjects(a: &Analysis) -> Markup {
    let mut head = vec![
        "subject",
        "n",
        "mean",
        "SD",
        "distinct",
        "longest run",
        "SD within cells",
        "r with the others",
        "r with VAF",
    ];
    let v = &a.values;
    // What the design has: a reference, an anchor, a repeat.
    let beside: Vec<(&str, &str)> = [
        ("hidden_reference_mean", "mean of the references"),
        ("low_anchor_mean", "mean of the anchors"),
        ("repeat_distance", "distance of the repeats"),
    ]
    .into_iter()
    .filter(|(id, _)| {
        let end = format!("/{id}");
        v.iter().any(|(id, value)| {
            id.starts_with("subject/") && id.ends_with(&end) && matches!(value, Value::Number(_))
        })
    })
    .collect();
    head.extend(beside.iter().map(|(_, what)| *what));
    let mut table = Table::new("Subjects: flagged, never dropped", &head);
    let ids = v.iter().map(|(id, _)| id);
    let names = ids.filter_map(|id| id.strip_prefix("subject/")?.strip_suffix("/n"));
    // Two points always lie on a line.
    let enough = answers::tests(a).len() > 2;
    for s in names {
        let get = |what: &str| v.number(&format!("subject/{s}/{what}"));
        let r = |x: Option<f64>| {
            let x = x.filter(|_| enough);
            x.map_or_else(|| "–".to_owned(), |x| apa::share(x, 2))
        };
        let mut row = vec![
            apa::name(s),
            show(get("n"), 0),
            show(get("mean"), 2),
            show(get("sd"), 2),
            show(get("distinct"), 0),
            show(get("longest_run"), 0),
            show(get("within_cell_sd"), 2),
            r(get("leave_one_out_r")),
            r(v.number(&format!("subject_corr/{s}/r"))),
        ];
        row.extend(beside.iter().map(|(id, _)| show(get(id), 2)));
        table.row(false, row);
    }
    html! {
        (table.render())
        @if !table.rows.is_empty() {
            p.note {
                "Over all ratings of a subject. Distinct: how many different ratings were given; longest \
                 run: trials in a row with the same one; SD within cells: of the repetitions; r with the \
                 others: of the subject’s means with those of all other subjects, over realizations."
            }
        }
    }
}
