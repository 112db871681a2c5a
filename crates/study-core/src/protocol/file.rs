//! Reading a protocol file.
//!
//! Strict, and never stopping at the first fault: unknown keys, wrong types,
//! values that cannot be, and sections that contradict each other are all
//! reported at once, each with its place. What opens other files (do the models
//! load? is the order feasible?) is not here.
//!
//! [`parse_orders`] reads the `orders.csv` that a protocol may name.

mod agree;
mod analysis;
mod design;
mod device;
mod models;
mod orders;
mod questions;
mod reader;

pub use analysis::EXCLUSIONS;
pub use orders::parse_orders;

use super::{
    Consent, Entry, FORMAT, Order, Protocol, Question, SessionRules, Study, Text, TrialRules,
};
use reader::{Reader, prose};
use std::collections::BTreeMap;
use std::ops::Range;
use study_base::diagnostic::table::{Document, Table};
use study_base::diagnostic::{Fault, Findings};
use study_base::text::Untrusted;

/// Largest protocol file that is read, bytes.
pub const MAX_FILE_BYTES: usize = 1024 * 1024;

/// What reading a protocol file came to.
#[derive(Debug, Clone)]
pub struct Parsed {
    /// The protocol, if the file has no errors.
    pub protocol: Option<Protocol>,
    /// Every fault of the file.
    pub findings: Findings,
    /// Path of a value (`models[2].vaf`, `design.order`) → its bytes in the file.
    pub spans: BTreeMap<String, Range<usize>>,
    /// The other files that it names, also where the protocol has errors.
    pub named: Vec<Named>,
}

/// A file that a protocol names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// Path of the value, such as `models[2].file`.
    pub place: String,
    /// Relative to the protocol, with `/`.
    pub file: String,
    /// Whether it holds orders, not a model.
    pub orders: bool,
}

/// Reads a protocol file; `path` is only for messages.
pub fn parse(path: &str, text: &str) -> Parsed {
    let mut findings = Findings::new(path, text);
    if text.len() > MAX_FILE_BYTES {
        findings.text.clear();
        findings.faults.push(Fault::error(format!(
            "the file has {} bytes, more than {MAX_FILE_BYTES}",
            text.len()
        )));
        return Parsed {
            protocol: None,
            findings,
            spans: BTreeMap::new(),
            named: Vec::new(),
        };
    }
    let document = Document::parse(text);
    let broken = document.fault_count();
    let reader = Reader {
        document: &document,
        broken: broken > 0,
    };
    let mut named = Vec::new();
    let protocol = if format_is_ours(&reader) {
        read(&reader, &mut named)
    } else {
        None
    };
    let read = document.finish();
    findings.faults = read.faults;
    drop_echoes(&mut findings.faults, broken);
    findings.sort();
    Parsed {
        protocol: protocol.filter(|_| !findings.has_errors()),
        findings,
        spans: read.spans,
        named,
    }
}

/// Where the syntax is broken (the first `broken` faults), the reader stumbles a
/// second time over what was put there instead: that is not a fault of its own.
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

/// A file of another format is not read any further: every key would be a fault.
fn format_is_ours(reader: &Reader<'_, '_>) -> bool {
    let mut root = reader.document.root();
    let Some(value) = root.value("format") else {
        if !reader.broken {
            reader.document.fault(
                Fault::error("the file has no `format`")
                    .hint(format!("its first line has to be: format = \"{FORMAT}\"")),
            );
        }
        return true;
    };
    let Some(format) = value.text() else {
        return true;
    };
    if format == FORMAT {
        return true;
    }
    let version =
        |format: &str| -> Option<u32> { format.strip_prefix("study-protocol/")?.parse().ok() };
    let fault = match (version(&format), version(FORMAT)) {
        (Some(theirs), Some(ours)) if theirs > ours => Fault::error(format!(
            "the format `{}` is newer than this program, which reads `{FORMAT}`",
            Untrusted(&format)
        ))
        .hint("use a newer version of study"),
        _ => Fault::error(format!(
            "`{}` is no format of a protocol",
            Untrusted(&format)
        ))
        .label(format!("`{FORMAT}` is")),
    };
    value.fault(fault);
    false
}

/// Reads all sections; `None` if a part is faulty, which has been reported.
fn read<'d, 't>(reader: &Reader<'d, 't>, named: &mut Vec<Named>) -> Option<Protocol> {
    let mut root = reader.document.root();
    root.value("format");
    let study = study(reader, &mut root);
    let text = root.table("text").map(|table| texts(reader, table));
    let consent = root.table("consent").map(|table| consent(reader, table));
    let design = design::read(reader, &mut root);
    let session = root.table("session").map(|table| session(reader, table));
    let device = device::read(reader, &mut root);
    let trial = root.table("trial").map(|table| trial(reader, table));
    let models = models::read(reader, &mut root);
    let questions = questions::read(reader, &mut root, "questions");
    let setup = questions::read(reader, &mut root, "setup");
    let intake = questions::read(reader, &mut root, "intake");
    let outro = questions::read(reader, &mut root, "outro");
    let analysis = analysis::read(reader, &mut root);
    root.finish();

    named.extend(models.iter().filter_map(|model| {
        Some(Named {
            place: format!("{}.file", model.path),
            file: model.file.clone()?,
            orders: false,
        })
    }));
    if let Some(Order::File(file)) = design.as_ref().map(|d| &d.order) {
        named.push(Named {
            place: "design.order.file".to_owned(),
            file: file.clone(),
            orders: true,
        });
    }
    let mut draft = agree::Draft {
        design: design.as_ref(),
        device: device.as_ref(),
        minimum_strokes: trial.as_ref().map_or(0, |t| t.minimum_strokes),
        models,
        questions,
        setup,
        intake,
        outro,
        analysis: analysis.as_ref(),
    };
    if !reader.broken {
        draft.agree(reader.document);
    }
    draft.fill_duplicates();
    let agree::Draft {
        models,
        questions,
        setup,
        intake,
        outro,
        ..
    } = draft;
    Some(Protocol {
        study: study?,
        text: text.unwrap_or_default(),
        consent: match consent {
            Some(consent) => Some(consent?),
            None => None,
        },
        session: session.unwrap_or(SessionRules {
            entry: Entry::Participant,
            resume_within_h: RESUME_WITHIN_H,
        }),
        trial: trial.unwrap_or(TrialRules {
            reference: None,
            reference_min_s: 0.0,
            minimum_strokes: 0,
        }),
        models: models
            .into_iter()
            .map(models::Draft::finish)
            .collect::<Option<_>>()?,
        questions: all(questions)?,
        setup: all(setup)?,
        intake: all(intake)?,
        outro: all(outro)?,
        design: design?,
        device: device?,
        analysis: analysis?,
    })
}

fn all(drafts: Vec<questions::Draft>) -> Option<Vec<Question>> {
    drafts.into_iter().map(questions::Draft::finish).collect()
}

const RESUME_WITHIN_H: f64 = 4.0;

fn study<'d, 't>(reader: &Reader<'d, 't>, root: &mut Table<'d, 't>) -> Option<Study> {
    let mut table = reader.section(root, "study", "it needs an id, a title and a seed")?;
    let id = reader
        .need(
            &mut table,
            "id",
            "it names the results folder, such as \"turn-signal\"",
        )
        .and_then(|value| {
            let id = value.text()?;
            let good = (1..=64).contains(&id.len())
                && id
                    .chars()
                    .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
            if !good {
                value.fault(
                    Fault::error(format!("`{}` is no study id", Untrusted(&id)))
                        .label("use 1 to 64 of a-z 0-9 -"),
                );
            }
            good.then_some(id)
        });
    let title = reader.need_text(&mut table, "title", "a line for people");
    let seed = reader
        .need(
            &mut table,
            "seed",
            "any whole number; every order of the study follows from it",
        )
        .and_then(|value| {
            let seed = u64::try_from(value.i64()?).ok();
            if seed.is_none() {
                value.fault(Fault::error("`study.seed` cannot be below 0"));
            }
            seed
        });
    let authors = table
        .value("authors")
        .and_then(|v| v.array())
        .unwrap_or_default()
        .iter()
        .filter_map(prose)
        .collect();
    let license = reader.text(&mut table, "license");
    let ethics = reader.text(&mut table, "ethics");
    let contact = reader.text(&mut table, "contact");
    let funding = reader.text(&mut table, "funding");
    let doi = reader.text(&mut table, "doi");
    table.finish();
    Some(Study {
        id: id?,
        title: title?,
        seed: seed?,
        authors,
        license,
        ethics,
        contact,
        funding,
        doi,
    })
}

fn texts<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> Text {
    let text = Text {
        welcome: reader.text(&mut table, "welcome"),
        instructions: reader.text(&mut table, "instructions"),
        practice: reader.text(&mut table, "practice"),
        rest: reader.text(&mut table, "break"),
        end: reader.text(&mut table, "end"),
        lang: reader.text(&mut table, "lang"),
    };
    table.finish();
    text
}

fn consent<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> Option<Consent> {
    let document = reader.need_text(&mut table, "document", "the title or file name of the form");
    let version = reader.need_text(&mut table, "version", "which one was signed, such as \"2\"");
    table.finish();
    Some(Consent {
        document: document?,
        version: version?,
    })
}

fn session<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> SessionRules {
    let entry = table
        .word(
            "entry",
            &[
                ("participant", Entry::Participant),
                ("experimenter", Entry::Experimenter),
            ],
        )
        .unwrap_or(Entry::Participant);
    let resume_within_h = reader
        .duration(&mut table, "resume_within_h")
        .unwrap_or(RESUME_WITHIN_H);
    table.finish();
    SessionRules {
        entry,
        resume_within_h,
    }
}

fn trial<'d, 't>(reader: &Reader<'d, 't>, mut table: Table<'d, 't>) -> TrialRules {
    let rules = TrialRules {
        reference: reader.text(&mut table, "reference"),
        reference_min_s: reader
            .duration(&mut table, "reference_min_s")
            .unwrap_or(0.0),
        minimum_strokes: table.u32("minimum_strokes").unwrap_or(0),
    };
    table.finish();
    rules
}

#[cfg(test)]
mod tests;
