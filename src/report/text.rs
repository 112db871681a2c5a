//! The terminal page: tables, the chart of Fig. 10 above that of Fig. 11, the
//! answers in words, what a reader has to know, what was counted.
//!
//! It fits 80 columns and uses up to 100. Colour supports and never carries.
//! Everything from the data passes through [`Untrusted`].

mod answers;
mod headline;
mod layout;

use super::plot::{Axis, bars};
use super::{Source, apa};
use layout::{Grid, Paint, number, pad, squeezed, wrap};
use study_base::text::Untrusted;
use study_core::analyze::{Analysis, Listed};
use study_core::outcome::Role;
use unicode_width::UnicodeWidthStr as _;

/// How the page is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// Columns of the terminal; the page uses 60 to 100 of them.
    pub width: usize,
    /// Whether it shows colours.
    pub colour: bool,
}

/// Most realizations on the page, of those that are asked about and of the others.
const MAX_SHOWN: usize = 40;

/// Columns that are spent on saying of what a repeat is one.
const MAX_NAME: usize = 30;

/// Most bins that a table shows as a histogram.
const MAX_BINS: usize = 11;

/// The page.
pub fn page(source: &Source, a: &Analysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.colour);
    let mut out = head(source, a, width, paint);
    let (tests, others) = listed(a);
    if !a.realizations.is_empty() {
        let tests = &tests[..tests.len().min(MAX_SHOWN)];
        let others = &others[..others.len().min(MAX_SHOWN)];
        out += &table(a, tests, others, width, paint);
        out += &chart(a, tests, others, width, paint);
        let more = a.realizations.len() - tests.len() - others.len();
        if more > 0 {
            let what = apa::counted(more, "realization is", "realizations are");
            let text = format!("{what} not shown here: --out writes descriptives.csv, with all.");
            out += &wrap(&text, width, "", "");
            out.push('\n');
        }
    }
    if a.counts.rated == 0 {
        out += &paint.warn("Nothing is left to analyse: no rating counts.\n\n");
    }
    out += &answers::answers(a, width, paint);
    out += &headline::headline(a, width, paint);
    // The first stands at the top, the second in the answer.
    let said = ["no-participants", "few-realizations"];
    let warnings = a.warnings.iter().filter(|w| !said.contains(&w.code));
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
        let mean = a.values.number(&format!("desc/{}/mean", group[0].model));
        let mean = mean.map_or_else(String::new, |m| format!("  mean {}", number(m, 3)));
        out += &paint.strong(&format!("{id}{mean}"));
        out.push('\n');
        for c in group {
            let who = format!("  {} {}  ", Untrusted(&c.subject), c.repetition);
            let what = match c.question.as_str() {
                "comment" => String::new(),
                other => format!("[{}] ", Untrusted(other)),
            };
            let rest = " ".repeat(who.width());
            out += &wrap(&format!("{what}{}", Untrusted(&c.text)), width, &who, &rest);
        }
        out.push('\n');
    }
    out
}

/// Those that the study asks about, and those that stand beside them.
fn listed(a: &Analysis) -> (Vec<&Listed>, Vec<&Listed>) {
    a.realizations
        .iter()
        .partition(|m| m.role == Role::Test && m.duplicate_of.is_none())
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
            let planned = apa::counted(planned as usize, "participant", "participants");
            let finished = format!("{} of {planned}", c.finished);
            if c.participants == c.finished {
                finished
            } else {
                format!("{finished}, {} analysed", c.participants)
            }
        }
        None => apa::counted(c.participants, "subject", "subjects"),
    });
    facts.push(apa::counted(c.rated, "rating", "ratings"));
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

fn name(m: &Listed) -> String {
    let id = Untrusted(&m.id);
    match (&m.duplicate_of, m.role) {
        (Some(of), _) => {
            let whole = format!("{id} (repeats {})", Untrusted(of));
            if whole.width() <= MAX_NAME {
                whole
            } else {
                format!("{id} (repeat)")
            }
        }
        (None, Role::Test) => id.to_string(),
        (None, role) => format!("{id} ({})", role.as_str()),
    }
}

fn table(
    a: &Analysis,
    tests: &[&Listed],
    others: &[&Listed],
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
        .filter_map(|m| v.list(&format!("desc/{}/hist", m.id)))
        .flatten()
        .copied()
        .fold(0.0, f64::max);
    let mut head = vec!["realization", "n", "mean", "sd", "median"];
    let last = hist.map_or(0.0, |h| from + h.len() as f64 - 1.0);
    let scale = match hist {
        // One digit each, or the two ends.
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
    head.push("VAF");
    if let Some(h) = &at_least {
        head.push(h);
    }
    head.push("by subject [95 %]");
    // The median, the histogram, the share, the count.
    let counts_at = hist.map(|_| 5);
    let share_at = at_least.as_ref().map(|_| head.len() - 2);
    let dropped: Vec<usize> = [Some(4), counts_at, share_at, Some(1)]
        .into_iter()
        .flatten()
        .collect();
    let mut grid = Grid::new(&head, counts_at, &dropped);
    let vaf: Vec<f64> = a.realizations.iter().filter_map(|m| m.vaf).collect();
    let digits = apa::telling(&vaf);
    for m in tests.iter().chain(others) {
        let get = |s: &str| v.number(&format!("desc/{}/{s}", m.id));
        let show =
            |x: Option<f64>, digits: usize| x.map_or_else(|| "–".to_owned(), |x| number(x, digits));
        let mut row = vec![
            name(m),
            show(get("n"), 0),
            show(get("mean"), 3),
            show(get("sd"), 3),
            show(get("median"), 1),
        ];
        if hist.is_some() {
            let counts = v.list(&format!("desc/{}/hist", m.id)).unwrap_or(&[]);
            row.push(bars(counts, most, gap));
        }
        row.push(show(m.vaf, digits));
        if at_least.is_some() {
            let share = v.number(&format!("realistic/{}/share", m.id));
            row.push(share.map_or_else(|| "–".to_owned(), |s| format!("{:.0} %", 100.0 * s)));
        }
        let over = get("subject_mean/mean");
        let ends = get("subject_mean/ci95_lo").zip(get("subject_mean/ci95_hi"));
        row.push(match ends {
            Some((low, high)) => format!(
                "{} [{}, {}]",
                show(over, 2),
                number(low, 2),
                number(high, 2)
            ),
            None => show(over, 2),
        });
        grid.row(row);
    }
    grid.render(width, tests.len(), paint)
}

/// Means ± one SD (Fig. 10) above the VAF (Fig. 11), on one margin.
fn chart(
    a: &Analysis,
    tests: &[&Listed],
    others: &[&Listed],
    width: usize,
    paint: Paint,
) -> String {
    let v = &a.values;
    let shown: Vec<&&Listed> = tests.iter().chain(others).collect();
    let margin = shown
        .iter()
        .map(|m| name(m).width())
        .max()
        .unwrap_or(0)
        .clamp(8, width / 3);
    let columns = width - margin - 3;
    let extent = |id: &str| -> Vec<f64> {
        let of = |m: &&&Listed| v.number(&format!("desc/{}/{id}", m.id));
        shown.iter().filter_map(of).collect()
    };
    let mut out = String::new();
    let ends = a.scale.or_else(|| {
        let low = extent("min").into_iter().fold(f64::INFINITY, f64::min);
        let high = extent("max").into_iter().fold(f64::NEG_INFINITY, f64::max);
        Some((low, high))
    });
    if let Some(axis) = ends.and_then(|(l, h)| Axis::new(l, h, columns)) {
        let title = format!("{}, mean ± one SD", asked(a));
        out += &section(&title, &axis, margin, paint);
        for m in &shown {
            if let Some(mean) = v.number(&format!("desc/{}/mean", m.id)) {
                let half = v.number(&format!("desc/{}/sd", m.id));
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

fn line(m: &Listed, drawn: &str, margin: usize) -> String {
    format!("{}   {drawn}\n", pad(&squeezed(&name(m), margin), margin))
}

/// The question as a noun.
fn asked(a: &Analysis) -> String {
    match a.question.as_str() {
        "rating" => "the rating".to_owned(),
        other => Untrusted(other).to_string(),
    }
}

fn counts(a: &Analysis, width: usize) -> String {
    let c = &a.counts;
    let some = |n: usize, one: &str, many: &str| match n {
        0 => None,
        1 => Some(format!("1 {one}")),
        n => Some(format!("{n} {many}")),
    };
    let mut parts: Vec<String> = [
        some(c.corrected, "trial corrected", "trials corrected"),
        some(c.repeated, "trial repeated", "trials repeated"),
        some(c.failed, "trial failed", "trials failed"),
        some(c.declined, "rating declined", "ratings declined"),
        some(c.missing, "rating missing", "ratings missing"),
        some(
            c.practice,
            "practice trial not counted",
            "practice trials not counted",
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
        parts.push("none excluded".to_owned());
    }
    for (reason, n) in &c.excluded {
        let rows = if *n == 1 { "row" } else { "rows" };
        parts.push(format!("{n} {rows} left out ({})", Untrusted(reason)));
    }
    if !a.comments.is_empty() {
        parts.push(format!("comments: {} (--comments)", a.comments.len()));
    }
    wrap(&parts.join(" · "), width, "", "")
}
