//! The preregistration as a document.

mod trials;

use super::power::{Report, own_design};
use super::study::track_in_words;
use super::{apa, confirmation, sentences, wording};
use chrono::NaiveDate;
use serde_json::{Value, json};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::{Analysis, Include, Rules, analyze};
use study_analysis::load::Loaded;
use study_analysis::power::{Overrides, Plan, merge};
use study_analysis::preregister::{
    FILE, FORMAT, Preregistration, complete_parts, complete_study, deciding,
};
use study_analysis::study::{describe_realizations, is_rated};
use study_base::text::{Untrusted, capital, counted, escaped_json};
use study_plan::protocol::{
    Assign, Occasion, Protocol, Question, Questionnaire, Role, Scale, SessionPlan, Unfinished,
};
use trials::{order, trials};

/// The document for people.
const MARKDOWN: &str = "preregistration.md";

/// What a document states besides its protocol.
#[derive(Debug, Clone)]
pub struct Options {
    /// Planned participants; `None`: those of the protocol.
    pub participants: Option<u32>,
    /// The day of the document.
    pub date: NaiveDate,
    /// Simulated studies for the power; `None`: those of the protocol.
    pub studies: Option<u64>,
}

/// A document in its two forms.
#[derive(Debug)]
pub struct Document {
    /// Names and contents: for people in Markdown, and for programs in JSON, with which
    /// `study analyze` compares the study.
    pub files: [(&'static str, String); 2],
    /// The hash that the document has of itself.
    pub sha256: String,
}

/// States what a study will do, before its first session: design, exclusions, the tests that a
/// complete study of this design is decided by, and its power.
///
/// `progress` is called with the number of units of the simulation after each of them.
///
/// # Errors
/// If the facts cannot be written as JSON.
pub fn document(
    mut loaded: Loaded,
    options: &Options,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Document, serde_json::Error> {
    let n = (options.participants).unwrap_or(loaded.protocol.design.participants);
    loaded.protocol.design.participants = n;
    loaded.parts.analysis["participants"] = json!(n);
    let protocol = &loaded.protocol;
    let question = protocol.analysis.primary.clone();
    let mut ratings = complete_study(protocol, &question, n);
    describe_realizations(&mut ratings, &loaded);
    if !is_rated(protocol) {
        ratings = ratings.keep(|_| false);
    }
    let rules = Rules::of(protocol, question.as_str(), Include::default());
    let analysis = analyze(&ratings, &rules);
    let parts = complete_parts(protocol, n);
    let (power, sentences) = power(protocol, options.studies, progress);
    let facts = Preregistration {
        format: FORMAT.to_owned(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        date: options.date,
        study: protocol.study.id.clone(),
        participants: n,
        question,
        tests: deciding(Some(&analysis), &parts),
        power,
        fingerprints: loaded.parts.fingerprints(),
        protocol: loaded.parts.clone(),
        sha256: String::new(),
    }
    .sealed();
    let tracks = (protocol.tracks.iter())
        .map(|track| track_in_words(protocol, track))
        .collect();
    let text = markdown(&Content {
        document: &facts,
        protocol,
        analysis: &analysis,
        parts: &parts,
        tracks,
        power: sentences,
    });
    let value = serde_json::to_value(&facts)?;
    let facts_text = escaped_json(&format!("{value:#}\n")).to_string();
    Ok(Document {
        files: [(MARKDOWN, text), (FILE, facts_text)],
        sha256: facts.sha256,
    })
}

/// Power of the planned design, as facts and in sentences; why there is none otherwise.
fn power(
    protocol: &Protocol,
    studies: Option<u64>,
    progress: &(dyn Fn(usize) + Sync),
) -> (Value, Vec<String>) {
    let mut flags = Overrides::default();
    flags.plan.studies = studies;
    let mut plan = match Plan::of(protocol, &flags) {
        Ok(plan) => plan,
        Err(why) => {
            let facts = json!({ "undefined_because": why.to_string() });
            return (facts, vec![format!("Power was not computed: {why}.")]);
        }
    };
    plan.grid = vec![plan.own];
    let units = plan.units_of(&[plan.own]);
    let chunks = plan.simulate(&units, &|| progress(units.len()));
    let results = merge(&plan.settings, plan.own, &chunks);
    let report = Report {
        title: protocol.study.title.clone(),
        study: protocol.study.id.clone(),
        plan,
        results: results.into_iter().collect(),
        missing_units: 0,
        wanted: Vec::new(),
    };
    (own_design(&report), power_sentences(&report))
}

/// What the document says besides its facts.
struct Content<'a> {
    /// The facts.
    document: &'a Preregistration,
    /// The protocol, with the planned participants of the document.
    protocol: &'a Protocol,
    /// The analysis of a complete study, whose tests are declared.
    analysis: &'a Analysis,
    /// Those of its parts.
    parts: &'a [PartAnalysis],
    /// What each track compares, and how. Untrusted.
    tracks: Vec<String>,
    /// Sentences on power and sensitivity.
    power: Vec<String>,
}

/// The document in Markdown.
fn markdown(c: &Content<'_>) -> String {
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
    let findings = c.analysis.findings.iter();
    tests.extend(findings.filter_map(|f| wording::declared(c.analysis, f)));
    for part in c.parts {
        let own = part.findings.iter();
        tests.extend(own.filter_map(|f| wording::declared_of_part(part, f)));
    }
    if tests.len() == 1 {
        tests.push(
            "The primary question is no rating of realizations: thresholds, preferences and magnitudes are \
             estimated, and no test decides."
                .to_owned(),
        );
    }
    if let Some(from) = p.analysis.realistic_from {
        tests.push(format!("A rating of {from} or higher counts as realistic."));
    }
    if let Some(margin) = p.analysis.equivalence_margin {
        let of_levels = match p.factors.is_empty() {
            true => "",
            false => {
                " Levels of a factor are tested for it by two one-sided t tests, with Holm's correction over the pairs of levels."
            }
        };
        tests.push(format!(
            "Equivalence means a difference of less than {margin} points.{of_levels}"
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
        if "\\`*_[]<>#|&$".contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn design(c: &Content<'_>) -> Vec<String> {
    let (d, p) = (c.document, c.protocol);
    let people = counted(d.participants as usize, "participant", "participants");
    let only = p.only_asks();
    let mut lines = vec![match p.parts.is_empty() && !only {
        true => format!(
            "{people}, {} of each realization.",
            counted(p.design.repetitions as usize, "repetition", "repetitions")
        ),
        false => format!("{people}."),
    }];
    lines.extend(
        p.confirms
            .as_ref()
            .map(|search| text(&confirmation::sentence(search))),
    );
    lines.extend(groups(p));
    let session = |s: &SessionPlan| {
        let gap = match s.min_gap_h > 0.0 {
            true => format!(" (at least {} h after the one before)", s.min_gap_h),
            false => String::new(),
        };
        let parts = s.parts.iter().flatten().map(|id| format!("`{id}`"));
        let parts: Vec<String> = parts.collect();
        let with = match parts.is_empty() {
            true => String::new(),
            false => format!(" with {}", parts.join(", ")),
        };
        format!("`{}`{with}{gap}", s.id)
    };
    let sessions: Vec<String> = p.sessions.iter().map(session).collect();
    if !sessions.is_empty() {
        lines.push(format!(
            "Sessions of each participant: {}.",
            sessions.join(", ")
        ));
    }
    let named = |m: &study_plan::protocol::ModelEntry| match m.vaf {
        Some(vaf) => format!("`{}` (VAF {})", m.id, apa::share(vaf, 4)),
        None => format!("`{}`", m.id),
    };
    let tested =
        |m: &&study_plan::protocol::ModelEntry| m.role == Role::Test && m.duplicate_of.is_none();
    let all: Vec<String> = p.models.iter().filter(tested).map(named).collect();
    if !all.is_empty() {
        lines.push(format!("Tested realizations: {}.", all.join(", ")));
    }
    if let Some(crossing) = p.crossing() {
        let mut factors: Vec<String> = (crossing.factors.iter())
            .map(|factor| format!("`{}` ({})", factor.id, factor.levels.join(", ")))
            .collect();
        if !crossing.groups.is_empty() {
            let groups = crossing.groups.join(", ");
            factors.push(format!("the group between participants ({groups})"));
        }
        let effects: Vec<String> = (crossing.effects.iter())
            .map(|effect| crossing.effect_name(effect).replace(':', " × "))
            .collect();
        lines.push(format!(
            "Factors: {}. Effects that are tested, as one family: {}.",
            factors.join(", "),
            effects.join(", ")
        ));
    }
    if !p.outcomes.is_empty() {
        let outcomes: Vec<String> = p.outcomes.iter().map(|o| text(&o.in_words())).collect();
        lines.push(format!(
            "Measured besides, and tested as one family (Holm's correction); no answer rests on them: {}.",
            outcomes.join(", ")
        ));
    }
    for m in p.models.iter().filter(|m| !tested(m)) {
        lines.push(match &m.duplicate_of {
            Some(of) => format!("`{}`: hidden duplicate of `{of}`.", m.id),
            None => format!("`{}`: {}.", m.id, m.role.as_str().replace('-', " ")),
        });
    }
    for part in &p.parts {
        lines.push(format!("Part `{}`: {}.", part.id, trials(p, part)));
    }
    let told = |own: &&Questionnaire| only || own.after != Occasion::Session;
    for own in p.questionnaires.iter().filter(told) {
        lines.push(format!(
            "Questionnaire `{}` ({}): {}.",
            own.id,
            own.kind.as_str(),
            own.after.when()
        ));
    }
    lines.extend(c.tracks.iter().map(|track| text(track)));
    let seed = p.study.seed;
    lines.push(match p.parts.is_empty() {
        true if only => "Nothing is presented: there are no trials.".to_owned(),
        true => format!(
            "Order of the trials: {}; all orders follow from the seed {seed} (`study schedule`).",
            order(&p.design.order)
        ),
        false => format!("All orders follow from the seed {seed} (`study schedule`)."),
    });
    lines
}

/// The groups, with what distinguishes them.
fn groups(p: &Protocol) -> Option<String> {
    let groups = p.groups.as_ref()?;
    let one = |g: &study_plan::protocol::GroupRules| {
        let ids = |ids: Vec<&str>| match ids.is_empty() {
            true => String::new(),
            false => format!(" with `{}`", ids.join("`, `")),
        };
        let parts = g.parts.iter().flatten().map(|id| id.as_str());
        let models = g.models.iter().flatten().map(|id| id.as_str());
        let only = ids(parts.chain(models).collect());
        format!("`{}`{only} (share {})", g.id, g.share)
    };
    let all: Vec<String> = groups.list.iter().map(one).collect();
    let assigned = match groups.assign {
        Assign::Row => "assigned by row in permuted blocks",
        Assign::Given => "given by the experimenter",
    };
    Some(format!("Groups: {}; {assigned}.", all.join(", ")))
}

fn questions(p: &Protocol) -> Vec<String> {
    let one = |q: &Question| {
        let scale = match q.kind.scale() {
            Scale::Levels { from, to, .. } => format!("rating from {from} to {to}"),
            Scale::Interval { from, to, .. } => format!("slider from {from} to {to}"),
            Scale::Names { options, .. } => format!("choice of {}", options.len()),
            Scale::Open { .. } => "number".to_owned(),
            Scale::Free => "text".to_owned(),
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
        .map(|rule| format!("Excluded: {} (`{rule}`).", rule.words()))
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
fn power_sentences(report: &Report) -> Vec<String> {
    let mut lines = vec![report.ceiling_sentence(), super::power::paragraph(report)];
    let finds = super::power::sensitivity_sentences(report).into_iter();
    lines.extend(finds.map(|line| format!("This design {line}.")));
    lines.extend(report.warnings().iter().map(|w| format!("{}.", capital(w))));
    lines
}
