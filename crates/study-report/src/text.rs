//! The terminal page: tables, charts after Fig. 10 and Fig. 11, answers, warnings,
//! counts.
//!
//! It uses 60 to 100 columns. Color only repeats what the text says. Everything from
//! the data passes through [`Untrusted`].

pub(super) mod layout;
mod trials;

use super::answers::{answers, conditional};
use super::plot::Axis;
use super::tables::{self, with_role};
use super::{Source, apa, sentences};
use super::{comparison, confirmation};
use layout::{Grid, Paint, pad, wrap};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, RealizationSummary};
use study_analysis::preregister::Comparison;
use study_base::text::{Untrusted, counted, cut_middle};
use study_plan::protocol::Confirms;
pub use trials::{part, trials};
use unicode_width::UnicodeWidthStr as _;

/// The terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// Columns of the terminal; the page uses 60 to 100 of them.
    pub width: usize,
    /// Whether the terminal shows colors.
    pub color: bool,
}

/// Largest number of tested realizations on the page, and of the others.
const MAX_SHOWN: usize = 40;

/// The page.
pub fn page(source: &Source, a: &Analysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.color);
    let mut out = head(source, a, width, paint);
    let (tests, others): (Vec<_>, Vec<_>) = a.realizations.iter().partition(|m| m.tested);
    if !a.realizations.is_empty() {
        let tests = &tests[..tests.len().min(MAX_SHOWN)];
        let others = &others[..others.len().min(MAX_SHOWN)];
        out += &table(a, width, paint);
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
        out += &paint.warn("No rating is included: there is nothing to analyze.\n\n");
    }
    out += &all_answers(a, width, paint);
    if let Some(search) = &source.confirms {
        out += &confirms(search, page);
        out.push('\n');
    }
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

/// Which search the study confirms.
pub fn confirms(search: &Confirms, page: Page) -> String {
    let text = Untrusted(&confirmation::sentence(search)).to_string();
    wrap(&text, page.width.clamp(60, 100), "", "")
}

/// How the study compares with its preregistration.
pub fn preregistered(found: &Comparison, page: Page) -> String {
    let sentence = comparison::sentence(found);
    let mut out = Paint(page.color).strong("Preregistration");
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
    let paint = Paint(page.color);
    if a.comments.is_empty() {
        return "no comments\n".to_owned();
    }
    let mut out = String::new();
    for group in a.comments.chunk_by(|x, y| x.model == y.model) {
        let id = Untrusted(&group[0].model).to_string();
        let mean = a.described(&group[0].model).map(|d| &d.mean).number();
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
        rows.push("These results do not generalize to other realizations.".to_owned());
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
                format!("{finished}, {} analyzed", c.participants)
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

/// The realizations, the tested ones first.
fn table(a: &Analysis, width: usize, paint: Paint) -> String {
    let gap = if width >= 96 { " " } else { "" };
    let mut table = tables::realizations(a, gap);
    let tests = table.keep_first(MAX_SHOWN);
    Grid::of(&table, None).render(width, tests, paint)
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
        .map(|m| with_role(m).width())
        .max()
        .unwrap_or(0)
        .clamp(8, width / 3);
    let columns = width - margin - 3;
    let described = || shown.iter().filter_map(|m| a.described(&m.id));
    let mut out = String::new();
    let ends = a.scale.or_else(|| {
        let least = described().filter_map(|d| d.min.number());
        let most = described().filter_map(|d| d.max.number());
        let low = least.fold(f64::INFINITY, f64::min);
        let high = most.fold(f64::NEG_INFINITY, f64::max);
        Some((low, high))
    });
    if let Some(axis) = ends.and_then(|(l, h)| Axis::new(l, h, columns)) {
        let title = format!("{}, mean ± 1 SD", Untrusted(&sentences::asked(a)));
        out += &section(&title, &axis, margin, paint);
        for m in &shown {
            let described = a.described(&m.id);
            if let Some(mean) = described.map(|d| &d.mean).number() {
                let half = described.map(|d| &d.sd).number();
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
    format!(
        "{}   {drawn}\n",
        pad(&cut_middle(&with_role(m), margin), margin)
    )
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
