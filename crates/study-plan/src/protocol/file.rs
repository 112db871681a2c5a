//! Reading a protocol file.
//!
//! Strict, and never stopping at the first fault: unknown keys, wrong types,
//! values out of range, and sections that contradict each other are all reported
//! at once, each with its place. Faults that need other files (do the models
//! load? is the order feasible?) are found elsewhere.
//!
//! [`ROOT`] declares every key. [`parse_orders`] reads the `orders.csv` that a
//! protocol may name.

mod adjustment;
mod agree;
mod analysis;
mod confirms;
mod design;
mod device;
mod factors;
mod families;
mod general;
mod grids;
mod groups;
mod looked;
mod media;
mod models;
mod orders;
mod outcomes;
mod pairs;
mod parts;
mod power;
mod questionnaires;
mod questions;
mod ranking;
mod resolve;
mod scoring;
mod similarity;
mod spaces;
mod standard;
mod track_rules;
mod tracks;

pub(super) use grids::usual_grids;
pub use orders::parse_orders;

use super::keys::{Key, Kind, Variants, Word, keys};
use super::section::Section;
use super::{FORMAT, FORMAT_2, FORMAT_3, Medium, Protocol, Question};
use agree::Sections;
use models::PartialModel;
use questions::PartialQuestion;
use std::collections::BTreeMap;
use std::ops::Range;
use study_base::diagnostic::table::Document;
use study_base::diagnostic::{Fault, Findings};
use study_base::text::Untrusted;

/// Every key of a protocol file, by section.
pub const ROOT: &[Key] = keys! {
    /// The file format with its version.
    "format": Kind::Word(FORMATS), r#""study-protocol/1""#, required;
    /// Identity and provenance of the study.
    "study": Kind::Table(general::STUDY), "", required;
    /// What participants read, in any language. Each text can be left out.
    "text": Kind::Table(general::TEXT), "";
    /// The document that the participant agrees to before the session.
    "consent": Kind::Table(general::CONSENT), "";
    /// What the participant reads at the end of each session, after all questions: what the study was about. The journal has
    /// that it was shown. Needs the format `study-protocol/3`.
    "debriefing": Kind::Table(general::DEBRIEFING), "";
    /// The search whose result this study confirms, on people who did not take part in it. `study new --from RESULTS
    /// --confirm` writes it. Needs the format `study-protocol/3`.
    "confirms": Kind::Table(confirms::CONFIRMS), "";
    /// The trials of a participant and their order.
    "design": Kind::Table(design::DESIGN), "", required;
    /// How a session goes.
    "session": Kind::Table(general::SESSION), "";
    /// What plays the realizations, and its limits.
    "device": Kind::Table(device::DEVICE), "", required;
    /// How a trial goes.
    "trial": Kind::Table(general::TRIAL), "";
    /// The realizations; at least one whose role is not `practice`.
    "models": Kind::Tables(models::MODELS), "", derived("required, unless every part takes its levels from families or spaces, or only questionnaires are asked");
    /// The factors of a factorial design: what is varied within participants. Every combination of
    /// their levels has a realization. Needs the format `study-protocol/3`.
    "factors": Kind::Tables(factors::FACTORS), "";
    /// The parts of a session, in their order. Without any, the study is one rating part, whose
    /// keys are in `[design]`. Parts need the format `study-protocol/2`.
    "parts": Kind::Variants(&parts::PARTS), "";
    /// Dimensions of the stimulus: each is a ladder of levels, and each level a table of its
    /// own, certified and hashed before the session. Needs the format `study-protocol/2`.
    "families": Kind::Tables(families::FAMILIES), "";
    /// Spaces of the parts of kind `search`: several dimensions of the stimulus at once, on a finite lattice whose points are
    /// certified before the session. Needs the format `study-protocol/3`.
    "spaces": Kind::Tables(spaces::SPACES), "";
    /// Tracks of the parts of kind `discrimination`. Needs the format `study-protocol/2`.
    "tracks": Kind::Tables(tracks::TRACKS), "";
    /// Groups of participants: each belongs to one for good. Needs the format
    /// `study-protocol/2` and `[[parts]]`.
    "groups": Kind::Table(groups::GROUPS), "";
    /// Repeated sessions, in their order: the same participant comes again. Without any, a
    /// participant comes once. Needs the format `study-protocol/2` and `[[parts]]`.
    "sessions": Kind::Tables(groups::SESSIONS), "";
    /// Asked after each trial; at least one.
    "questions": Kind::Variants(&questions::QUESTIONS), "", derived("required, unless every part has an answer of its own, or only questionnaires are asked");
    /// Asked of the experimenter before the first trial.
    "setup": Kind::Variants(&questions::QUESTIONS), "";
    /// Asked of the participant once, before the first trial.
    "intake": Kind::Variants(&questions::QUESTIONS), "";
    /// Asked of the participant once, at the end.
    "outro": Kind::Variants(&questions::QUESTIONS), "";
    /// Standard questionnaires, asked of the participant after `[[outro]]` or between the trials, with their scores in
    /// the analysis. A study can consist of them alone, without `[[models]]` and `[[questions]]`: its primary question is
    /// then the name of one, and its device can be `manual`.
    "questionnaires": Kind::Variants(&questionnaires::QUESTIONNAIRES), "";
    /// What is measured in each trial beside the questions, such as times: described, and compared between the
    /// realizations. Needs the format `study-protocol/3`.
    "outcomes": Kind::Variants(&outcomes::OUTCOMES), "";
    /// Decisions that were made before the data.
    "analysis": Kind::Table(analysis::ANALYSIS), "", required;
    /// What is assumed before the data, for `study power`. It changes no session and no
    /// result.
    "power": Kind::Table(power::POWER), "";
};

/// The keys of a question, the same in four places.
pub static QUESTIONS: &Variants = &questions::QUESTIONS;

/// The formats of a protocol.
const FORMATS: &[Word] = &[
    Word::new(FORMAT, "A study of ratings."),
    Word::new(FORMAT_2, "A study of parts, such as pairs and thresholds."),
    Word::new(
        FORMAT_3,
        "The same, with keys that older programs do not know.",
    ),
];

/// Sections that need [`FORMAT_2`].
const OF_FORMAT_2: [&str; 5] = ["parts", "families", "tracks", "groups", "sessions"];

/// Keys that need [`FORMAT_3`], without the places in lists.
pub const OF_FORMAT_3: [&str; 27] = [
    "confirms",
    "consent.text",
    "consent.initials",
    "debriefing",
    "design.order_version",
    "factors",
    "outcomes",
    "spaces",
    "models.levels",
    "models.picture",
    "models.video",
    "models.sound",
    "models.alt",
    "models.caption",
    "parts.answers",
    "parts.confirm",
    "parts.different",
    "parts.first",
    "parts.modulus",
    "analysis.model",
    "device.commissioned_within_days",
    "device.self_weigh",
    "trial.media_within_ms",
    "tracks.relative",
    "tracks.condition",
    "questionnaires.after",
    "questionnaires.from",
];

/// Largest protocol file that is read, bytes.
pub const MAX_FILE_BYTES: usize = 1024 * 1024;

/// The result of reading a protocol file.
#[derive(Debug, Clone)]
pub struct Parsed {
    /// The protocol, if the file has no errors.
    pub protocol: Option<Protocol>,
    /// Every fault of the file.
    pub findings: Findings,
    /// Path of a value (`models[2].vaf`, `design.order`) → its bytes in the file.
    pub spans: BTreeMap<String, Range<usize>>,
    /// The other files that it names, even if the protocol has errors.
    pub named: Vec<Named>,
}

/// A file that a protocol names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// Path of the value, such as `models[2].file`.
    pub place: String,
    /// Relative to the protocol, with `/`.
    pub file: String,
    /// What it contains.
    pub content: Content,
}

/// A text of a file that participants read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prose {
    /// The consent document.
    Consent,
    /// What the study was about.
    Debriefing,
}

/// What a file of a protocol contains.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// A realization.
    Model,
    /// Orders.
    Orders,
    /// A text that participants read.
    Text(Prose),
    /// A bundle with a realization; with the SHA-256 that it has to have, if the protocol says it.
    Bundle(Option<String>),
    /// A picture, video or sound.
    Media(Medium),
}

/// Reads a protocol file; `path` is only for messages.
///
/// ```
/// # use study_plan::protocol::file::parse;
/// let parsed = parse("protocol.toml", "format = \"study-protocol/1\"\n[design]\nrepetition = 3\n");
/// assert!(parsed.protocol.is_none());
/// assert!(parsed.findings.render(false).contains("did you mean `repetitions`?"));
/// ```
pub fn parse(path: &str, text: &str) -> Parsed {
    let length = text.len();
    if length > MAX_FILE_BYTES {
        let what = format!("the file has {length} bytes, more than {MAX_FILE_BYTES}");
        return Parsed {
            protocol: None,
            findings: Findings::alone(path, Fault::error(what)),
            spans: BTreeMap::new(),
            named: Vec::new(),
        };
    }
    let mut findings = Findings::new(path, text);
    let document = Document::parse(text);
    let broken = document.fault_count();
    let mut named = Vec::new();
    let version = format_version(&document, broken > 0);
    let protocol = version.and_then(|_| read(&document, broken > 0, &mut named));
    let read = document.finish();
    findings.faults = read.faults;
    if version.is_some_and(|version| version < 3) {
        // A list is reported once, and not for each of its entries.
        let is_listed = |place: &str| {
            let list = place.strip_suffix(']').and_then(|p| p.rsplit_once('['));
            list.is_some_and(|(list, _)| read.spans.contains_key(list))
        };
        let newer =
            (read.spans.iter()).filter(|(place, _)| is_of_format_3(place) && !is_listed(place));
        (findings.faults).extend(newer.map(|(place, span)| {
            Fault::error(format!("`{place}` needs the format `{FORMAT_3}`"))
                .at(Some(span.clone()))
                .hint(format!("write format = \"{FORMAT_3}\" in the first line"))
        }));
    }
    drop_echoes(&mut findings.faults, broken);
    findings.sort();
    Parsed {
        protocol: protocol.filter(|_| !findings.has_errors()),
        findings,
        spans: read.spans,
        named,
    }
}

/// Whether a place such as `tracks[0].id` is a key of [`OF_FORMAT_3`].
fn is_of_format_3(place: &str) -> bool {
    let mut inside = false;
    let without_places = place.chars().filter(|c| {
        inside = (inside || *c == '[') && *c != ']';
        !inside && *c != ']'
    });
    let key: String = without_places.collect();
    OF_FORMAT_3.contains(&key.as_str())
}

/// Removes faults at the places of syntax errors (the first `broken` faults): they are
/// consequences of these.
fn drop_echoes(faults: &mut Vec<Fault>, broken: usize) {
    let holes: Vec<Range<usize>> = faults[..broken]
        .iter()
        .filter_map(|f| f.span.clone())
        .collect();
    let mut at = 0;
    faults.retain(|fault| {
        at += 1;
        at <= broken
            || !fault.span.as_ref().is_some_and(|span| {
                holes
                    .iter()
                    .any(|hole| span.start <= hole.end && hole.start <= span.end)
            })
    });
}

/// The version of the format, the newest if it is not there. A file of another format is not
/// read any further, because every key would be a fault.
fn format_version(document: &Document<'_>, broken: bool) -> Option<u32> {
    let mut root = document.root();
    let Some(value) = root.value("format") else {
        if !broken {
            document.fault(
                Fault::error("the file has no `format`")
                    .hint(format!("its first line has to be: format = \"{FORMAT}\"")),
            );
        }
        return Some(3);
    };
    let Some(format) = value.text() else {
        return Some(3);
    };
    if format == FORMAT {
        for name in OF_FORMAT_2 {
            if let Some(value) = root.value(name) {
                let name = match name {
                    "groups" => "[groups]".to_owned(),
                    name => format!("[[{name}]]"),
                };
                value.fault(
                    Fault::error(format!("{name} needs the format `{FORMAT_2}`"))
                        .hint(format!("write format = \"{FORMAT_2}\" in the first line")),
                );
            }
        }
        return Some(1);
    }
    if format == FORMAT_2 {
        return Some(2);
    }
    if format == FORMAT_3 {
        return Some(3);
    }
    let version =
        |format: &str| -> Option<u32> { format.strip_prefix("study-protocol/")?.parse().ok() };
    let given = Untrusted(&format);
    value.fault(match (version(&format), version(FORMAT_3)) {
        (Some(theirs), Some(ours)) if theirs > ours => Fault::error(format!(
            "the format `{given}` is newer than this program, which reads `{FORMAT_3}`"
        ))
        .hint("use a newer version of study"),
        _ => Fault::error(format!("`{given}` is not a format of a protocol"))
            .label(format!("`{FORMAT}` is")),
    });
    None
}

/// Reads all sections; `None` if a part is faulty, which has been reported.
fn read(document: &Document<'_>, broken: bool, named: &mut Vec<Named>) -> Option<Protocol> {
    let mut root = Section::root(document, broken, ROOT);
    let study = root.section("study").and_then(general::study);
    let text = root.section("text").map(general::text);
    let consent = root.section("consent").and_then(general::consent);
    let debriefing = root.section("debriefing").and_then(general::debriefing);
    let confirms = root.section("confirms").and_then(confirms::read);
    let raw = resolve::Raw {
        parts: parts::read(&mut root),
        families: (root.sections("families").into_iter())
            .map(families::read)
            .collect(),
        spaces: (root.sections("spaces").into_iter())
            .map(spaces::read)
            .collect(),
        tracks: root
            .sections("tracks")
            .into_iter()
            .map(tracks::read)
            .collect(),
    };
    let groups = root.section("groups").map(groups::groups);
    let sessions = root.sections("sessions").into_iter().map(groups::session);
    let sessions: Option<Vec<_>> = sessions.collect();
    let has_parts = !raw.parts.is_empty();
    let models = root.sections("models").into_iter().map(models::read);
    let models: Vec<PartialModel> = models.collect();
    let questionnaires = questionnaires::read(&mut root);
    let only_asks = !has_parts && models.is_empty() && !questionnaires.is_empty();
    let design =
        (root.section("design")).and_then(|section| design::read(section, has_parts, only_asks));
    let session = root.section("session").and_then(general::session);
    let device = root.section("device").and_then(device::read);
    let trial = root.section("trial").and_then(general::trial);
    let factors = root.sections("factors").into_iter().map(factors::read);
    let factors: Option<Vec<_>> = factors.collect();
    let mut questions = questions::read(&mut root, "questions");
    let own_questions = raw.questions();
    let has_faulty_parts = raw.rating_parts() + own_questions.len() < raw.parts.len();
    questions.extend(own_questions.into_iter().flatten());
    let setup = questions::read(&mut root, "setup");
    let intake = questions::read(&mut root, "intake");
    let mut outro = questions::read(&mut root, "outro");
    let items = |between: bool| {
        let own = (questionnaires.iter()).filter(move |q| q.is_between() == between);
        own.flat_map(|q| q.questions())
    };
    outro.extend(items(false));
    let between: Vec<PartialQuestion> = items(true).collect();
    let mut outcomes = outcomes::read(&mut root);
    let analysis = root.section("analysis").and_then(analysis::read);
    let power = root.section("power").and_then(power::read);

    let mut sections = Sections {
        design: design.as_ref(),
        device: device.as_ref(),
        minimum_strokes: trial.as_ref().map_or(0, |t| t.minimum_strokes),
        exposure: trial.as_ref().map(|t| t.exposure).unwrap_or_default(),
        models,
        factors: factors.as_deref().unwrap_or_default(),
        questions,
        setup,
        intake,
        outro,
        between,
        questionnaires: (questionnaires.iter())
            .filter_map(|q| q.id().cloned())
            .collect(),
        analysis: analysis.as_ref(),
        has_parts,
        has_faulty_parts,
    };
    named.extend(sections.files());
    named.extend(raw.files());
    if outcomes::primary_of_part(&sections).is_none() {
        outcomes.extend(questionnaires.iter().filter_map(|q| q.outcome()));
    }
    let texts = [
        (
            "consent.text",
            consent.as_ref().and_then(|own| own.file.clone()),
            Prose::Consent,
        ),
        (
            "debriefing.file",
            debriefing.as_ref().and_then(|own| own.file.clone()),
            Prose::Debriefing,
        ),
    ];
    named.extend(texts.into_iter().filter_map(|(place, file, prose)| {
        Some(Named {
            place: place.to_owned(),
            file: file?,
            content: Content::Text(prose),
        })
    }));
    if !broken {
        sections.agree(document);
        questionnaires::agree(&questionnaires, &raw.parts, document);
        media::agree(&sections.models, session.as_ref(), document);
        outcomes::agree(&outcomes, &sections, document);
    }
    // After the others: a file of another kind is read as what it is.
    named.extend(media::files(&sections.models));
    let resolved = raw.resolve(&sections, document, broken);
    if let (Some(sessions), Some(parts), Some(families), false) =
        (&sessions, &resolved.parts, &resolved.families, broken)
    {
        let known = groups.as_ref().and_then(Option::as_ref);
        groups::agree(known, sessions, (parts, families), document);
    }
    if let (Some(parts), false) = (&resolved.parts, broken) {
        questionnaires::agree_after(&questionnaires, &sections, parts, document);
    }
    if let (Some(factors), false) = (&factors, broken) {
        let known = groups.as_ref().and_then(Option::as_ref);
        let rules = analysis.as_ref();
        factors::agree(factors, &sections.models, known, rules, document);
    }
    sections.fill_duplicates();
    media::fill_duplicates(&mut sections.models);
    let Sections {
        models,
        questions,
        setup,
        intake,
        outro,
        ..
    } = sections;
    let models: Option<_> = models.into_iter().map(PartialModel::finish).collect();
    Some(Protocol {
        study: study?,
        text: text?,
        consent,
        debriefing,
        confirms,
        session: session?,
        trial: trial?,
        models: models?,
        factors: factors?,
        questions: all(questions)?,
        setup: all(setup)?,
        intake: all(intake)?,
        outro: all(outro)?,
        questionnaires: (questionnaires.iter())
            .map(|q| q.finish())
            .collect::<Option<_>>()?,
        design: design?,
        device: device?,
        outcomes: (outcomes.into_iter())
            .map(outcomes::PartialOutcome::finish)
            .collect::<Option<_>>()?,
        analysis: analysis?,
        parts: resolved.parts?,
        families: resolved.families?,
        spaces: resolved.spaces?,
        tracks: resolved.tracks?,
        groups: match groups {
            None => None,
            Some(groups) => Some(groups?),
        },
        sessions: sessions?,
        power: power?,
    })
}

fn all(questions: Vec<PartialQuestion>) -> Option<Vec<Question>> {
    questions.into_iter().map(PartialQuestion::finish).collect()
}

#[cfg(test)]
mod tests;
