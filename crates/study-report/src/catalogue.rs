//! A catalogue of bundles as static pages: one for each order, and a picture of each stimulus.
//!
//! The pages need no script and no server: links sort, and style sheets filter. All text of a bundle
//! is escaped, and its address names its files.

use super::apa::plain as size;
use super::chart::{Axis, Figure, Look, Mark, PALETTE, Panel};
use super::html::page_head;
use maud::{DOCTYPE, Markup, html};
use std::cmp::Ordering;
use study_base::sort::SmallSort as _;
use study_base::text::{Untrusted, counted};
use study_haptics::archive::{Bundle, Feel, at_rest};
use study_haptics::identify::repetition::WITHIN;
use study_haptics::model::Units;
use study_haptics::model::coverage::Origin;

const CSS: &str = include_str!("catalogue/style.css");

/// Most dots of a recording in a picture.
const MAX_DOTS: usize = 800;
/// Share of the force by which it falls in a tactile stimulus.
const TACTILE: f64 = 0.05;

/// An order: file name, name, and the number that it goes by.
type Sorting = (&'static str, &'static str, fn(&Feel) -> f64);

/// The pages. The first one goes by names alone.
const SORT_ORDERS: [Sorting; 4] = [
    ("index.html", "name", |_| 0.0),
    ("by-force.html", "peak force", |feel| feel.peak),
    ("by-travel.html", "travel", |feel| feel.travel),
    ("by-tactility.html", "tactility", |feel| {
        feel.tactility_share
    }),
];

/// A choice between stimuli: key, name, and the values with their keys; each has a bundle or not.
struct Filter {
    key: &'static str,
    name: &'static str,
    values: [(&'static str, &'static str); 3],
    of: fn(&Bundle, &Feel) -> Option<usize>,
}

/// What lies up to the first bound, up to the second one, and above. Turning handles have other
/// units, and no bounds.
fn bin(bundle: &Bundle, value: f64, bounds: [f64; 2]) -> Option<usize> {
    let linear = bundle.realization.units == Units::Linear;
    linear.then(|| bounds.iter().filter(|bound| value > **bound).count())
}

const FILTERS: [Filter; 3] = [
    Filter {
        key: "feel",
        name: "Feel",
        values: [("smooth", "smooth"), ("tactile", "tactile"), ("", "")],
        of: |_, feel| Some(usize::from(feel.tactility_share >= TACTILE)),
    },
    Filter {
        key: "force",
        name: "Peak force",
        values: [
            ("low", "up to 1 N"),
            ("middle", "1 to 5 N"),
            ("high", "above 5 N"),
        ],
        of: |bundle, feel| bin(bundle, feel.peak, [1.0, 5.0]),
    },
    Filter {
        key: "travel",
        name: "Travel",
        values: [
            ("short", "up to 3 mm"),
            ("middle", "3 to 10 mm"),
            ("long", "above 10 mm"),
        ],
        of: |bundle, feel| bin(bundle, feel.travel, [3.0, 10.0]),
    },
];

/// The files of a catalogue: names and texts, without the bundles, which the pages expect as
/// `bundles/ADDRESS.tar`.
pub fn files(bundles: &[Bundle]) -> Vec<(String, String)> {
    let mut all: Vec<(String, Feel, &Bundle)> = (bundles.iter())
        .map(|bundle| (bundle.sha256(), Feel::of(&bundle.realization), bundle))
        .collect();
    all.small_sort_by(|(a, _, x), (b, _, y)| (&x.realization.id, a).cmp(&(&y.realization.id, b)));
    all.dedup_by(|(a, ..), (b, ..)| a == b);
    let mut files: Vec<(String, String)> = (all.iter())
        .map(|(address, _, bundle)| (picture_path(address), figure(bundle).picture().to_svg()))
        .collect();
    for sorting in &SORT_ORDERS {
        let mut sorted: Vec<&(String, Feel, &Bundle)> = all.iter().collect();
        // stable: equal ones stay in the order of names
        sorted.small_sort_by(|(_, a, x), (_, b, y)| {
            let units = |bundle: &Bundle| bundle.realization.units.names();
            let value = (sorting.2)(a).total_cmp(&(sorting.2)(b));
            match sorting.0 {
                "index.html" => Ordering::Equal,
                _ => units(x).cmp(&units(y)).reverse().then(value),
            }
        });
        files.push((sorting.0.to_owned(), page(sorting, &sorted)));
    }
    files
}

fn picture_path(address: &str) -> String {
    format!("pictures/{address}.svg")
}

/// Force over position: the recordings as dots, the realization in slow motion as lines.
fn figure(bundle: &Bundle) -> Figure {
    let [x_unit, f_unit] = bundle.realization.units.names();
    let [press, release] = at_rest(&bundle.realization);
    // The lever arm of a recording of a turning handle is not known.
    let linear = bundle.realization.units == Units::Linear;
    let mut dots = Vec::new();
    for kept in bundle.recordings.iter().filter(|_| linear) {
        let recording = &kept.recording;
        let rows = recording.x_mm.iter().zip(&recording.f_n);
        let step = recording
            .len()
            .div_ceil(MAX_DOTS / bundle.recordings.len().min(MAX_DOTS));
        dots.extend(rows.step_by(step.max(1)).map(|(x, f)| (*x, *f)));
    }
    let all = || press.iter().chain(&release).chain(&dots);
    let panel = Panel::new(
        Axis::around(&format!("position ({x_unit})"), all().map(|(x, _)| *x)),
        Axis::around(
            &format!("force ({f_unit})"),
            all().map(|(_, f)| *f).chain([0.0]),
        ),
    )
    .with(
        Look::plain(PALETTE[6]).stroke(4.0),
        Mark::Dots(dots.clone()),
    )
    .named(
        "increasing",
        Look::nth(0).stroke(2.0),
        Mark::Line(press.clone()),
    )
    .named(
        "decreasing",
        Look::nth(1).stroke(2.0),
        Mark::Line(release.clone()),
    );
    let title = format!("Force over position of {}", bundle.realization.id);
    Figure::new("stimulus", &title, 480.0, 320.0).with(panel)
}

fn page(sorting: &Sorting, all: &[&(String, Feel, &Bundle)]) -> String {
    let (file, name, _) = sorting;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("Haptic stimuli by {name}"), "'self' file:", &(CSS.to_owned() + &hiding())))
            body {
                header {
                    h1 { "Haptic stimuli by " (name) }
                    p { (counted(all.len(), "stimulus", "stimuli")) ", each with its recordings, model and certificate in one file." }
                    nav aria-label="Order" {
                        "Order by "
                        @for (other, name, _) in &SORT_ORDERS {
                            a href=(other) aria-current=[(other == file).then_some("page")] { (name) } " "
                        }
                    }
                    form { @for filter in &FILTERS { (choices(filter)) } }
                }
                main {
                    @for (address, feel, bundle) in all { (card(address, feel, bundle)) }
                    p.none { "No other stimuli match the choices above." }
                }
                footer {
                    "Written by study " (env!("CARGO_PKG_VERSION")) ". Dots: recordings. Lines: the realization in slow \
                     motion, with increasing and decreasing position. Of it, without " (100.0 * WITHIN[0]) " % of the travel at \
                     either end: peak force is the greatest one of both directions; tactility is the \
                     largest fall of the force while the position increases, and its share of the force; \
                     tactile means at least " (100.0 * TACTILE) " %."
                }
            }
        }
    };
    page.into_string() + "\n"
}

fn choices(filter: &Filter) -> Markup {
    let id = |value: &str| format!("{}-{value}", filter.key);
    html! {
        fieldset {
            legend { (filter.name) }
            span {
                input type="radio" name=(filter.key) id=(id("all")) checked;
                label for=(id("all")) { "all" }
            }
            @for (value, name) in filter.values.iter().filter(|(value, _)| !value.is_empty()) {
                " "
                span {
                    input type="radio" name=(filter.key) id=(id(value));
                    label for=(id(value)) { (name) }
                }
            }
        }
    }
}

/// The rules that hide what was not chosen.
fn hiding() -> String {
    let rules = FILTERS.iter().flat_map(|filter| {
        let values = filter.values.iter().filter(|(value, _)| !value.is_empty());
        values.map(|(value, _)| {
            let class = format!("{}-{value}", filter.key);
            format!("body:has(#{class}:checked) article:not(.{class}) {{ display: none; }}\n")
        })
    });
    rules.collect()
}

fn card(address: &str, feel: &Feel, bundle: &Bundle) -> Markup {
    let r = &bundle.realization;
    let [x, f] = r.units.names();
    let safe = |text: &str| Untrusted(text).to_string();
    let classes: Vec<String> = (FILTERS.iter())
        .filter_map(|filter| {
            let (value, _) = filter.values[(filter.of)(bundle, feel)?];
            Some(format!("{}-{value}", filter.key))
        })
        .collect();
    let rows: usize = bundle
        .recordings
        .iter()
        .map(|kept| kept.recording.len())
        .sum();
    let [low, high] = r.trained.x_mm.map(size);
    let mut facts = vec![
        ("Peak force", format!("{} {f}", size(feel.peak))),
        ("Travel", format!("{} {x}", size(feel.travel))),
        (
            "Tactility",
            format!(
                "{} {f}, {:.0} %",
                size(feel.tactility),
                100.0 * feel.tactility_share
            ),
        ),
        (
            "Identified",
            format!(
                "from {low} to {high} {x}, up to {} {x}/s, {}",
                size(r.trained.v_mm_s),
                r.provenance.method
            ),
        ),
    ];
    for (name, term) in &r.provenance.terms {
        let what = match name.as_str() {
            "m_kg" => "Mass",
            "b_n_s_per_mm" => "Damping",
            other => other,
        };
        match term.origin {
            Origin::Training => {}
            Origin::Dynamic => facts.push((what, "from a dynamic recording".to_owned())),
            Origin::Stated => facts.push((what, "stated, not identified".to_owned())),
        }
    }
    for (name, vaf) in &r.vaf {
        facts.push(("VAF", format!("{} ({name})", size(*vaf))));
    }
    let passes = bundle
        .facts()
        .iter()
        .any(|fact| fact.key == "passes" && fact.value == "true");
    let certificate = if passes {
        "passive"
    } else {
        "not passive: it can put energy into a hand"
    };
    let recordings = counted(bundle.recordings.len(), "recording", "recordings");
    let stated = &bundle.stated;
    facts.extend([
        ("Certificate", certificate.to_owned()),
        (
            "Data",
            format!("{recordings}, {}", counted(rows, "row", "rows")),
        ),
        ("License", stated.license.clone()),
        ("Credit", stated.credit.clone()),
        ("Instrument", stated.instrument.clone()),
        ("Published", stated.published.clone()),
    ]);
    html! {
        article class=(classes.join(" ")) {
            h2 { (safe(&r.id)) }
            img src=(picture_path(address)) width="480" height="320" loading="lazy"
                alt={ "Force over position: the recordings as dots, the realization as lines, up to " (size(feel.peak)) " " (f) };
            dl { @for (name, value) in &facts { dt { (name) } dd dir="auto" { (safe(value)) } } }
            p { a href={ "bundles/" (address) ".tar" } { "Bundle " (safe(&r.id)) } ", in a protocol:" }
            p { code { "bundle = \"sha256:" (address) "\"" } }
        }
    }
}
