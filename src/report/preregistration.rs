//! The preregistration as a document.

use super::html::{declared_test, exclusion};
use super::{apa, sentences};
use serde_json::json;
use study_base::text::{Untrusted, capital, counted};
use study_core::analyze::Analysis;
use study_core::preregister::Preregistration;
use study_core::protocol::{Order, Protocol, Question, QuestionKind, Role, Unfinished};

/// What the document says besides its facts.
#[derive(Debug, Clone)]
pub struct Content<'a> {
    /// The facts.
    pub document: &'a Preregistration,
    /// The protocol, with the planned participants of the document.
    pub protocol: &'a Protocol,
    /// The analysis of a complete study, whose tests are declared.
    pub analysis: &'a Analysis,
    /// Sentences on power and sensitivity.
    pub power: Vec<String>,
}

/// The document in Markdown.
pub fn markdown(c: &Content<'_>) -> String {
    let (d, p) = (c.document, c.protocol);
    let mut out = format!("# Preregistration: {}\n\n", text(&p.study.title));
    let list = |out: &mut String, title: &str, lines: &[String]| {
        *out += &format!("## {title}\n\n");
        for line in lines {
            *out += &format!("* {line}\n");
        }
        out.push('\n');
    };
    let mut about = vec![
        format!(
            "Study `{}`, written on {} with study {}.",
            d.study, d.date, d.tool_version
        ),
        format!(
            "SHA-256 of the facts in `preregistration.json`: `{}`.",
            d.sha256
        ),
    ];
    if !p.study.authors.is_empty() {
        about.push(format!("Authors: {}.", text(&p.study.authors.join(", "))));
    }
    list(&mut out, "Document", &about);
    list(&mut out, "Design", &design(c));
    list(&mut out, "Questions", &questions(p));
    list(&mut out, "Exclusions", &exclusions(p));
    let mut tests = vec![format!(
        "Level of significance α = {}, two-sided: an answer is yes for p at or below its level. Nothing else \
         decides.",
        sentences::level(p.analysis.alpha())
    )];
    tests.extend(c.analysis.findings.iter().filter_map(|f| {
        let (what, test) = declared_test(c.analysis, f)?;
        Some(format!("{what}: {test}."))
    }));
    if tests.len() == 1 {
        tests.push(
            "The primary question is no rating of realizations: thresholds and preferences are \
             estimated, and no test decides."
                .to_owned(),
        );
    }
    if let Some(from) = p.analysis.realistic_from {
        tests.push(format!("A rating of {from} or higher counts as realistic."));
    }
    if let Some(margin) = p.analysis.equivalence_margin {
        tests.push(format!(
            "Equivalence means a difference of less than {margin} points."
        ));
    }
    tests.push(
        "These are the tests of a complete study of this design; if ratings are missing, the rule of \
         `study analyze` can choose another one, and its report says so."
            .to_owned(),
    );
    list(&mut out, "Deciding tests", &tests);
    list(&mut out, "Power", &c.power);
    list(
        &mut out,
        "Fingerprints",
        &[
            format!("stimulus `{}`", d.fingerprints.stimulus),
            format!("wording `{}`", d.fingerprints.wording),
            format!("analysis `{}`", d.fingerprints.analysis),
        ],
    );
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

/// Text from a protocol in Markdown.
fn text(raw: &str) -> String {
    let mut out = String::new();
    for c in Untrusted(raw).to_string().chars() {
        if "\\`*_[]<>#|&".contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn design(c: &Content<'_>) -> Vec<String> {
    let (d, p) = (c.document, c.protocol);
    let mut lines = vec![format!(
        "{}, {} of each realization.",
        counted(d.participants as usize, "participant", "participants"),
        counted(p.design.repetitions as usize, "repetition", "repetitions")
    )];
    let named = |m: &study_core::protocol::ModelEntry| match m.vaf {
        Some(vaf) => format!("`{}` (VAF {})", m.id, apa::share(vaf, 4)),
        None => format!("`{}`", m.id),
    };
    let tested =
        |m: &&study_core::protocol::ModelEntry| m.role == Role::Test && m.duplicate_of.is_none();
    let all: Vec<String> = p.models.iter().filter(tested).map(named).collect();
    if !all.is_empty() {
        lines.push(format!("Tested realizations: {}.", all.join(", ")));
    }
    for m in p.models.iter().filter(|m| !tested(m)) {
        lines.push(match &m.duplicate_of {
            Some(of) => format!("`{}`: hidden duplicate of `{of}`.", m.id),
            None => format!("`{}`: {}.", m.id, m.role.as_str().replace('-', " ")),
        });
    }
    for part in &p.parts {
        lines.push(format!("Part `{}`.", part.id));
    }
    let order = match &p.design.order {
        Order::File(_) => "a prepared file".to_owned(),
        order => json!(order).as_str().unwrap_or_default().to_owned(),
    };
    lines.push(format!(
        "Order of the trials: {order}; all orders follow from the seed {} (`study schedule`).",
        p.study.seed
    ));
    lines
}

fn questions(p: &Protocol) -> Vec<String> {
    let one = |q: &Question| {
        let scale = match &q.kind {
            QuestionKind::Rating { from, to, .. } => format!("rating from {from} to {to}"),
            QuestionKind::Slider { from, to, .. } => format!("slider from {from} to {to}"),
            QuestionKind::Choice { options, .. } => format!("choice of {}", options.len()),
            QuestionKind::Number { .. } => "number".to_owned(),
            QuestionKind::Text => "text".to_owned(),
        };
        let primary = if q.id == p.analysis.primary {
            ", primary"
        } else {
            ""
        };
        format!("`{}`: “{}” ({scale}{primary})", q.id, text(&q.prompt))
    };
    p.questions.iter().map(one).collect()
}

fn exclusions(p: &Protocol) -> Vec<String> {
    let mut lines: Vec<String> = (p.analysis.exclude.iter())
        .map(|rule| format!("Excluded: {} (`{rule}`).", exclusion(*rule)))
        .collect();
    if lines.is_empty() {
        lines.push("No exclusion rule.".to_owned());
    }
    lines.push(match p.analysis.unfinished {
        Unfinished::Include => "Ratings of unfinished sessions are included.".to_owned(),
        Unfinished::Exclude => "Unfinished sessions are excluded.".to_owned(),
    });
    lines
}

/// Power of the planned design, in sentences.
pub fn power(report: &super::power::Report) -> Vec<String> {
    let mut lines = vec![report.ceiling_sentence(), super::power::paragraph(report)];
    let finds = super::power::sensitivity_sentences(report).into_iter();
    lines.extend(finds.map(|line| format!("This design {line}.")));
    lines.extend(report.warnings().iter().map(|w| format!("{}.", capital(w))));
    lines
}
