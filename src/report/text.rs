//! The terminal page: tables, charts after Fig. 10 and Fig. 11, answers, warnings,
//! counts.
//!
//! It uses 60 to 100 columns. Colour only repeats what the text says. Everything from
//! the data passes through [`Untrusted`].

pub(super) mod layout;
mod trials;

use super::answers::{answers, conditional};
use super::comparison;
use super::plot::{Axis, bars};
use super::{Source, apa, sentences};
use layout::{Grid, Paint, pad, wrap};
use study_base::text::{Untrusted, counted, cut_middle};
use study_core::analyze::{Analysis, RealizationSummary, group_id};
use study_core::outcome::Role;
use study_core::preregister::Comparison;
pub use trials::{part, trials};
use unicode_width::UnicodeWidthStr as _;

/// The terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// Columns of the terminal; the page uses 60 to 100 of them.
    pub width: usize,
    /// Whether the terminal shows colours.
    pub colour: bool,
}

/// Largest number of tested realizations on the page, and of the others.
const MAX_SHOWN: usize = 40;

/// Largest width of the name of a hidden duplicate with that of its original.
const MAX_NAME: usize = 30;

/// Largest number of bins of a histogram.
const MAX_BINS: usize = 11;

/// The page.
pub fn page(source: &Source, a: &Analysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.colour);
    let mut out = head(source, a, width, paint);
    let (tests, others): (Vec<_>, Vec<_>) = a.realizations.iter().partition(|m| m.tested);
    if !a.realizations.is_empty() {
        let tests = &tests[..tests.len().min(MAX_SHOWN)];
        let others = &others[..others.len().min(MAX_SHOWN)];
        out += &table(a, tests, others, width, paint);
        out += &chart(a, tests, others, width, paint);
        let more = a.realizations.len() - tests.len() - others.len();
        if more > 0 {
            let what = counted(more, "realization is", "realizations are");
            let text = format!("{what} not shown here: --out writes descriptives.csv with all.");
            out += &wrap(&text, width, "", "");
            out.push('\n');
        }
    }
    if a.counts.rated == 0 {
        out += &paint.warn("No rating is included: there is nothing to analyse.\n\n");
    }
    out += &all_answers(a, width, paint);
    if let Some(found) = &source.preregistration {
        out += &preregistered(found, page);
        out.push('\n');
    }
    if !source.sites.is_empty() {
        out += &paint.strong("Sites and their devices");
        out.push('\n');
        for site in super::sites::sentences(&source.sites) {
            out += &wrap(&Untrusted(&site).to_string(), width, "  ", "    ");
        }
        out.push('\n');
    }
    // The head and the answers contain these.
    let shown = [
        "no-participants",
        "few-realizations",
        "raw-and-adjusted",
        "preregistration",
    ];
    let warnings = a.warnings.iter().filter(|w| !shown.contains(&w.code));
    for w in warnings.clone() {
        let text = wrap(&Untrusted(&w.text).to_string(), width, "! ", "  ");
        out += &paint.warn(&text);
    }
    if warnings.count() > 0 {
        out.push('\n');
    }
    out += &counts(a, width);
    out
}

/// How the study compares with its preregistration.
pub fn preregistered(found: &Comparison, page: Page) -> String {
    let sentence = comparison::sentence(found);
    let mut out = Paint(page.colour).strong("Preregistration");
    out.push('\n');
    out + &wrap(
        &Untrusted(&sentence).to_string(),
        page.width.clamp(60, 100),
        "  ",
        "  ",
    )
}

/// Comments by realization.
pub fn comments(a: &Analysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.colour);
    if a.comments.is_empty() {
        return "no comments\n".to_owned();
    }
    let mut out = String::new();
    for group in a.comments.chunk_by(|x, y| x.model == y.model) {
        let id = Untrusted(&group[0].model).to_string();
        let mean = a.described(&group[0].model, "mean");
        let mean = mean.map_or_else(String::new, |m| format!("  mean {}", apa::number(m, 3)));
        out += &paint.strong(&format!("{id}{mean}"));
        out.push('\n');
        for c in group {
            let author = format!("  {} {}  ", Untrusted(&c.subject), c.repetition);
            let question = match c.question.as_str() {
                "comment" => String::new(),
                other => format!("[{}] ", Untrusted(other)),
            };
            let text = format!("{question}{}", Untrusted(&c.text));
            out += &wrap(&text, width, &author, &" ".repeat(author.width()));
        }
        out.push('\n');
    }
    out
}

/// The answers, with the results that hold for these realizations only at the end.
fn all_answers(a: &Analysis, width: usize, paint: Paint) -> String {
    let mut out = String::new();
    let mut section = |title: &str, sentences: &[String]| {
        out += &paint.strong(&Untrusted(title).to_string());
        out.push('\n');
        for sentence in sentences {
            out += &wrap(&Untrusted(sentence).to_string(), width, "  ", "  ");
        }
        out.push('\n');
    };
    for mut answer in answers(a) {
        answer.main.insert(0, answer.short);
        section(&answer.question, &answer.main);
    }
    let (mut rows, on_terminal) = conditional(a);
    rows.truncate(on_terminal);
    if !rows.is_empty() {
        rows.push("These results do not generalise to other realizations.".to_owned());
        section("For these realizations only", &rows);
    }
    out
}

fn head(source: &Source, a: &Analysis, width: usize, paint: Paint) -> String {
    let c = &a.counts;
    let mut facts = Vec::new();
    if let Some(id) = &source.study {
        facts.push(Untrusted(id).to_string());
    }
    if let Some(version) = source.protocol_version {
        facts.push(format!("protocol {version}"));
    }
    facts.push(match c.planned {
        Some(planned) => {
            let planned = counted(planned as usize, "participant", "participants");
            let finished = format!("{} of {planned}", c.finished);
            if c.participants == c.finished {
                finished
            } else {
                format!("{finished}, {} analysed", c.participants)
            }
        }
        None if c.with_ratings < c.participants => format!(
            "{} of {} gave ratings",
            c.with_ratings,
            counted(c.participants, "participant", "participants")
        ),
        None => counted(c.participants, "participant", "participants"),
    });
    facts.push(counted(c.rated, "rating", "ratings"));
    let facts = facts.join(" · ");
    let title = Untrusted(&source.title).to_string();
    let mut out = String::new();
    if title.width() + facts.width() + 3 <= width {
        let gap = " ".repeat(width - title.width() - facts.width());
        out += &format!("{}{gap}{facts}\n", paint.strong(&title));
    } else {
        out += &paint.strong(&wrap(&title, width, "", ""));
        out += &wrap(&facts, width, "", "");
    }
    if let Some(w) = a.warnings.iter().find(|w| w.code == "no-participants") {
        let banner = format!("NO PARTICIPANTS: {}", w.text);
        out += &paint.warn(&wrap(&banner, width, "*** ", "    "));
    }
    out.push('\n');
    out
}

fn name(m: &RealizationSummary) -> String {
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

fn table(
    a: &Analysis,
    tests: &[&RealizationSummary],
    others: &[&RealizationSummary],
    width: usize,
    paint: Paint,
) -> String {
    let v = &a.values;
    let from = v.number("desc_all/hist_from").unwrap_or(0.0);
    let near = from.abs() < 1000.0;
    let hist = v
        .list("desc_all/hist")
        .filter(|h| near && h.len() <= MAX_BINS);
    let gap = if width >= 96 { " " } else { "" };
    let most = a
        .realizations
        .iter()
        .filter_map(|m| v.list(&format!("{}/hist", group_id("desc", &[&m.id]))))
        .flatten()
        .copied()
        .fold(0.0, f64::max);
    let mut head = vec!["realization", "n", "mean", "sd", "median"];
    let last = hist.map_or(0.0, |h| from + h.len() as f64 - 1.0);
    let scale = match hist {
        // The digits of the scale, or its ends.
        Some(h) if from >= 0.0 && last <= 9.0 => (0..h.len())
            .map(|b| (from + b as f64).to_string())
            .collect::<Vec<_>>()
            .join(gap),
        Some(_) => format!("{from}…{last}"),
        None => String::new(),
    };
    let at_least = a.realistic_from.map(|f| format!("≥{f}"));
    if hist.is_some() {
        head.push(&scale);
    }
    let vaf: Vec<f64> = a.realizations.iter().filter_map(|m| m.vaf).collect();
    head.extend((!vaf.is_empty()).then_some("VAF"));
    if let Some(h) = &at_least {
        head.push(h);
    }
    head.push("by subject [95 %]");
    // Dropped first: median, histogram, share, count.
    let counts_at = hist.map(|_| 5);
    let share_at = at_least.as_ref().map(|_| head.len() - 2);
    let dropped: Vec<usize> = [Some(4), counts_at, share_at, Some(1)]
        .into_iter()
        .flatten()
        .collect();
    let mut grid = Grid::new(&head, counts_at, &dropped);
    let digits = apa::distinguishing_decimals(&vaf);
    for m in tests.iter().chain(others) {
        let get = |s: &str| a.described(&m.id, s);
        let show = |x: Option<f64>, digits: usize| apa::or_dash(x, |x| apa::number(x, digits));
        let mut row = vec![
            name(m),
            show(get("n"), 0),
            show(get("mean"), 3),
            show(get("sd"), 3),
            show(get("median"), 1),
        ];
        if hist.is_some() {
            let counts = v
                .list(&format!("{}/hist", group_id("desc", &[&m.id])))
                .unwrap_or(&[]);
            row.push(bars(counts, most, gap));
        }
        row.extend((!vaf.is_empty()).then(|| show(m.vaf, digits)));
        if at_least.is_some() {
            let share = a.about("realistic", &[&m.id], "share");
            row.push(apa::or_dash(share, apa::percent));
        }
        let ci = v.interval(&format!("{}/subject_mean/ci95", group_id("desc", &[&m.id])));
        let ci = ci.map_or_else(String::new, |ci| {
            format!(" {}", apa::interval(ci, apa::two))
        });
        row.push(show(get("subject_mean/mean"), 2) + &ci);
        grid.row(row);
    }
    grid.render(width, tests.len(), paint)
}

/// Means ± one SD (Fig. 10) and VAF (Fig. 11), with aligned margins.
fn chart(
    a: &Analysis,
    tests: &[&RealizationSummary],
    others: &[&RealizationSummary],
    width: usize,
    paint: Paint,
) -> String {
    let shown: Vec<&&RealizationSummary> = tests.iter().chain(others).collect();
    let margin = shown
        .iter()
        .map(|m| name(m).width())
        .max()
        .unwrap_or(0)
        .clamp(8, width / 3);
    let columns = width - margin - 3;
    let extent = |id: &str| -> Vec<f64> {
        let values = shown.iter().filter_map(|m| a.described(&m.id, id));
        values.collect()
    };
    let mut out = String::new();
    let ends = a.scale.or_else(|| {
        let low = extent("min").into_iter().fold(f64::INFINITY, f64::min);
        let high = extent("max").into_iter().fold(f64::NEG_INFINITY, f64::max);
        Some((low, high))
    });
    if let Some(axis) = ends.and_then(|(l, h)| Axis::new(l, h, columns)) {
        let title = format!("{}, mean ± 1 SD", Untrusted(&sentences::asked(a)));
        out += &section(&title, &axis, margin, paint);
        for m in &shown {
            if let Some(mean) = a.described(&m.id, "mean") {
                let half = a.described(&m.id, "sd");
                out += &line(m, &axis.dot(mean, half), margin);
            }
        }
        out.push('\n');
    }
    let vaf: Vec<f64> = shown.iter().filter_map(|m| m.vaf).collect();
    let low = vaf.iter().copied().fold(f64::INFINITY, f64::min);
    let high = vaf.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let pad = (high - low) * 0.1;
    if let Some(axis) = Axis::new(low - pad, high + pad, columns) {
        out += &section("VAF", &axis, margin, paint);
        for m in &shown {
            if let Some(vaf) = m.vaf {
                out += &line(m, &axis.dot(vaf, None), margin);
            }
        }
        out.push('\n');
    }
    out
}

fn section(title: &str, axis: &Axis, margin: usize, paint: Paint) -> String {
    let ticks = format!("{}   {}", " ".repeat(margin), axis.ticks());
    format!("{}\n{}\n", paint.strong(title), paint.dim(&ticks))
}

fn line(m: &RealizationSummary, drawn: &str, margin: usize) -> String {
    format!("{}   {drawn}\n", pad(&cut_middle(&name(m), margin), margin))
}

fn counts(a: &Analysis, width: usize) -> String {
    let c = &a.counts;
    let some = |n: usize, one: &str, many: &str| (n > 0).then(|| counted(n, one, many));
    let mut parts: Vec<String> = [
        some(c.corrected, "trial corrected", "trials corrected"),
        some(c.repeated, "trial repeated", "trials repeated"),
        some(c.failed, "trial failed", "trials failed"),
        some(c.declined, "rating declined", "ratings declined"),
        some(c.missing, "rating missing", "ratings missing"),
        some(
            c.practice,
            "practice trial not included",
            "practice trials not included",
        ),
        some(c.pilots, "pilot", "pilots"),
        some(
            c.simulated,
            "simulated participant",
            "simulated participants",
        ),
    ]
    .into_iter()
    .flatten()
    .collect();
    if c.excluded.is_empty() {
        parts.push("no rows excluded".to_owned());
    }
    for (reason, n) in &c.excluded {
        let rows = counted(*n, "row", "rows");
        parts.push(format!("{rows} excluded ({})", Untrusted(reason)));
    }
    if !a.comments.is_empty() {
        parts.push(format!("comments: {} (--comments)", a.comments.len()));
    }
    wrap(&parts.join(" · "), width, "", "")
}
