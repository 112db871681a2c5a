//! Preregistration: what a study states before its first session, and whether it kept to it.
//!
//! The document has the protocol as its three fingerprints see it (design, wording, analysis
//! rules), the planned number of participants, and the tests that decide. The tests are
//! those that [`analyze`](mod@crate::analyze) chooses for a complete study of this design: it
//! is asked, with drawn numbers in the place of ratings, because its choice depends on the
//! design and never on a rating.

mod complete;

pub use complete::{complete_parts, complete_study};

use crate::analyze::psychophysics::{PartAnalysis, PartFinding};
use crate::analyze::{Analysis, Finding};
use chrono::{DateTime, FixedOffset, NaiveDate};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use study_base::text::{PartId, QuestionId};
use study_plan::protocol::difference::{self, Change};
use study_plan::protocol::fingerprint::{Fingerprints, Parts, digest};
use thiserror::Error;

/// Name and version of the format.
pub const FORMAT: &str = "study-preregistration/1";

/// The document beside a protocol, which a study freezes with it.
pub const FILE: &str = "preregistration.json";

/// A test that is declared to decide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Declared {
    /// The part that the question is about; none of ratings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartId>,
    /// Identifier of the question.
    pub question: String,
    /// Identifier of the test.
    pub test: String,
    /// The level against which its p is held.
    pub level: f64,
    /// The number of tests for which p or the level is corrected.
    pub comparisons: usize,
}

/// The document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Preregistration {
    /// [`FORMAT`].
    pub format: String,
    /// Version of the program that wrote it.
    pub tool_version: String,
    /// The day on which it was written, as its author says.
    pub date: NaiveDate,
    /// Study id.
    pub study: String,
    /// Planned participants.
    pub participants: u32,
    /// The question whose answers are analyzed.
    pub question: QuestionId,
    /// The tests that decide.
    pub tests: Vec<Declared>,
    /// Power and sensitivity of the design, or why there are none.
    pub power: Value,
    /// Fingerprints of the protocol.
    pub fingerprints: Fingerprints,
    /// What they are made of.
    pub protocol: Parts,
    /// SHA-256 of everything above.
    #[serde(default)]
    pub sha256: String,
}

/// Why a file is no document.
#[derive(Debug, Error)]
pub enum DocumentError {
    /// It cannot be read as one.
    #[error("it is no {FORMAT}: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// It is of another format or version.
    #[error("its format is `{0}`, not {FORMAT}")]
    Format(String),
}

impl Preregistration {
    /// Reads a document.
    ///
    /// # Errors
    /// If it is none.
    pub fn read(bytes: &[u8]) -> Result<Self, DocumentError> {
        let found: Self = serde_json::from_slice(bytes)?;
        if found.format == FORMAT {
            Ok(found)
        } else {
            Err(DocumentError::Format(found.format))
        }
    }

    /// The same with its hash.
    #[must_use]
    pub fn sealed(mut self) -> Self {
        self.sha256 = self.hash();
        self
    }

    /// SHA-256 of all but itself.
    fn hash(&self) -> String {
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(map) = value.as_object_mut() {
            map.remove("sha256");
        }
        digest(&value)
    }
}

/// The tests that decided an analysis of ratings, if there is one, and those of parts.
pub fn deciding(ratings: Option<&Analysis>, parts: &[PartAnalysis]) -> Vec<Declared> {
    let of_ratings = ratings.iter().flat_map(|a| &a.findings);
    let of_ratings = of_ratings.filter_map(|f| declared(None, f, f.question.id()));
    let of_parts = parts.iter().flat_map(|own| {
        let one = |f: &PartFinding| declared(Some(&own.part), f, f.question.id());
        own.findings.iter().filter_map(one).collect::<Vec<_>>()
    });
    of_ratings.chain(of_parts).collect()
}

fn declared<Q>(part: Option<&PartId>, f: &Finding<Q>, question: String) -> Option<Declared> {
    let test = f.test.as_ref()?;
    Some(Declared {
        part: part.cloned(),
        question,
        test: test.kind.as_str().to_owned(),
        level: test.level,
        comparisons: test.comparisons,
    })
}

/// How a study compares with its preregistration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comparison {
    /// The day of the document, as its author says.
    pub date: NaiveDate,
    /// The hash in the document.
    pub sha256: String,
    /// When the first session of a real participant began.
    pub first_session: Option<DateTime<FixedOffset>>,
    /// What differs, in words; empty if the study matches. Names in it are untrusted.
    pub deviations: Vec<String>,
}

/// What was done.
#[derive(Debug, Clone, Copy)]
pub struct Conduct<'a> {
    /// The newest protocol.
    pub protocol: &'a Parts,
    /// The question that was analyzed.
    pub question: &'a str,
    /// The tests that decided.
    pub tests: &'a [Declared],
    /// Real participants whose session is finished; `None` before the first of them came.
    pub finished: Option<usize>,
    /// The planned number of participants.
    pub planned: u32,
    /// When the first session of a real participant began.
    pub first_session: Option<DateTime<FixedOffset>>,
    /// The version of the protocol with which the document was frozen.
    pub frozen_with: u32,
}

/// Compares a study with its preregistration.
pub fn compare(document: &Preregistration, done: &Conduct<'_>) -> Comparison {
    let mut found = Vec::new();
    if document.sha256 != document.hash() {
        found.push("the document was changed after it was written: its hash differs".to_owned());
    }
    if document.protocol.fingerprints() != document.fingerprints {
        found.push("the fingerprints in the document are not those of its protocol".to_owned());
    }
    if done.frozen_with > 1 {
        found.push(format!(
            "the document came with version {} of the protocol, after the study began",
            done.frozen_with
        ));
    }
    if let Some(first) = done.first_session
        && first.date_naive() < document.date
    {
        found.push(format!(
            "the first session began on {}, before the document of {}",
            first.format("%Y-%m-%d"),
            document.date
        ));
    }
    if let Some(finished) = done.finished
        && finished != document.participants as usize
    {
        let interim = finished < done.planned as usize;
        let so_far = if interim { " so far" } else { "" };
        found.push(format!(
            "participants: {} were planned, {finished} finished{so_far}",
            document.participants
        ));
    }
    let changes = difference::changes(&document.protocol, done.protocol);
    found.extend(changes.iter().map(change));
    let same = done.question == document.question.as_str();
    if !same {
        found.push(format!(
            "this analysis is of `{}`; `{}` was declared",
            done.question, document.question
        ));
    }
    let compared = |test: &&Declared| same || test.part.is_some();
    let tests = document.tests.iter().filter(compared);
    found.extend(tests.filter_map(|test| other_test(test, done.tests)));
    Comparison {
        date: document.date,
        sha256: document.sha256.clone(),
        first_session: done.first_session,
        deviations: found,
    }
}

fn change(change: &Change) -> String {
    let none = || "none".to_owned();
    match (&change.old, &change.new) {
        (Some(old), Some(new)) if old == new => format!("{}: {new} differs", change.key),
        (old, new) => format!(
            "{}: {} → {}",
            change.key,
            old.clone().unwrap_or_else(none),
            new.clone().unwrap_or_else(none)
        ),
    }
}

/// Whether two words of tests are one procedure. In rankings the sign test takes the place of t where two realizations never had
/// another order, which only the answers tell.
fn is_one_procedure(one: &str, other: &str) -> bool {
    let in_place = |sign: &str, t: &str| sign == "sign" && ["clustered-t", "wald"].contains(&t);
    one == other || in_place(one, other) || in_place(other, one)
}

/// How a declared test differs from the one that decided.
fn other_test(declared: &Declared, done: &[Declared]) -> Option<String> {
    let alike = |d: &&Declared| d.question == declared.question && d.part == declared.part;
    let test = &declared.test;
    let question = match &declared.part {
        Some(part) => format!("part `{part}`, `{}`", declared.question),
        None => format!("`{}`", declared.question),
    };
    match done.iter().find(alike) {
        None => Some(format!(
            "{question}: no test decided; `{test}` was declared"
        )),
        Some(own) if !is_one_procedure(&own.test, test) => Some(format!(
            "{question}: `{}` decided; `{test}` was declared",
            own.test
        )),
        Some(own) if (own.level - declared.level).abs() > 1e-12 => Some(format!(
            "{question}: p is held against {}; {} was declared",
            own.level, declared.level
        )),
        Some(own) if own.comparisons != declared.comparisons => Some(format!(
            "{question}: corrected for {} tests; {} were declared",
            own.comparisons, declared.comparisons
        )),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::{Include, Rules, analyze};
    use std::collections::BTreeMap;
    use study_plan::protocol::fingerprint::parts;
    use study_plan::protocol::{Protocol, example};

    fn parts_of(protocol: &Protocol) -> Parts {
        parts(protocol, &BTreeMap::new(), None)
    }

    /// The analysis of a complete study of a protocol.
    fn analyzed(protocol: &Protocol, participants: u32) -> Analysis {
        let question = &protocol.analysis.primary;
        let ratings = complete_study(protocol, question, participants);
        let rules = Rules::of(protocol, question.as_str(), Include::default());
        analyze(&ratings, &rules)
    }

    fn document(protocol: &Protocol) -> Preregistration {
        let n = protocol.design.participants;
        let parts = parts_of(protocol);
        Preregistration {
            format: FORMAT.to_owned(),
            tool_version: "0.1.0".to_owned(),
            date: NaiveDate::from_ymd_opt(2026, 3, 1).unwrap(),
            study: protocol.study.id.clone(),
            participants: n,
            question: protocol.analysis.primary.clone(),
            tests: deciding(Some(&analyzed(protocol, n)), &complete_parts(protocol, n)),
            power: Value::Null,
            fingerprints: parts.fingerprints(),
            protocol: parts,
            sha256: String::new(),
        }
        .sealed()
    }

    fn with_vaf() -> Protocol {
        let mut protocol = example::protocol(6, 2);
        protocol.design.participants = 12;
        for (i, model) in protocol.models.iter_mut().enumerate() {
            model.vaf = Some(0.7 + 0.03 * i as f64);
        }
        protocol
    }

    fn said(document: &Preregistration, protocol: &Protocol, participants: u32) -> Vec<String> {
        let analysis = analyzed(protocol, participants);
        let done = Conduct {
            protocol: &parts_of(protocol),
            question: &analysis.question,
            tests: &deciding(Some(&analysis), &complete_parts(protocol, participants)),
            finished: Some(participants as usize),
            planned: protocol.design.participants,
            first_session: DateTime::parse_from_rfc3339("2026-03-02T09:00:00Z").ok(),
            frozen_with: 1,
        };
        compare(document, &done).deviations
    }

    /// The document survives its file, and a study that kept to it matches, whatever the
    /// ratings.
    #[test]
    fn a_study_that_kept_to_it_matches() {
        let protocol = with_vaf();
        let text = serde_json::to_string_pretty(&document(&protocol)).unwrap();
        let read = Preregistration::read(text.as_bytes()).unwrap();
        assert_eq!(read, document(&protocol));
        assert!(read.tests.iter().any(|t| t.question == "vaf"));
        assert_eq!(said(&read, &protocol, 12), [""; 0]);
        // Other numbers in the place of the drawn ones choose the same tests.
        let mut ratings = complete_study(&protocol, &protocol.analysis.primary, 12);
        for (i, rating) in ratings.rating.iter_mut().enumerate() {
            *rating = Some(1.0 + (i * i % 7) as f64);
        }
        let rules = Rules::of(&protocol, "realism", Include::default());
        assert_eq!(deciding(Some(&analyze(&ratings, &rules)), &[]), read.tests);
    }

    #[test]
    fn what_was_changed_is_named() {
        let before = with_vaf();
        let document = document(&before);
        let changed = |f: &dyn Fn(&mut Protocol)| {
            let mut after = before.clone();
            f(&mut after);
            said(&document, &after, 12).join("; ")
        };
        let alpha = changed(&|p| p.analysis.alpha = Some(0.01));
        assert!(alpha.contains("alpha: none → 0.01"), "{alpha}");
        assert!(
            alpha.contains("`vaf`: p is held against 0.01; 0.05 was declared"),
            "{alpha}"
        );
        let rule = changed(&|p| {
            p.analysis
                .exclude
                .push(study_plan::protocol::Exclusion::ConstantRater)
        });
        assert!(
            rule.contains("exclude") && rule.contains("constant-rater"),
            "{rule}"
        );
        let planned = changed(&|p| p.design.participants = 20);
        assert!(
            planned.contains("design.participants: 12 → 20"),
            "{planned}"
        );
        let trials = changed(&|p| p.design.repetitions = 3);
        assert!(trials.contains("design.repetitions: 2 → 3"), "{trials}");
        let seed = changed(&|p| p.study.seed += 1);
        assert!(seed.contains("study.seed"), "{seed}");
        let fewer = said(&document, &before, 11);
        assert_eq!(fewer, ["participants: 12 were planned, 11 finished so far"]);
        // A vanished realization changes the tests, too.
        let one = changed(&|p| p.models[1].vaf = None);
        assert!(one.contains("vaf: 0.73 → none"), "{one}");
    }

    /// The sign test of what never had another order is part of the declared procedure, and nothing else is.
    #[test]
    fn the_sign_test_stands_for_t() {
        let of = |test: &str| Declared {
            part: Some(PartId::new("order").unwrap()),
            question: "ranked-first".to_owned(),
            test: test.to_owned(),
            level: 0.05,
            comparisons: 6,
        };
        let differs = |declared: &str, done: &str| other_test(&of(declared), &[of(done)]);
        assert_eq!(differs("clustered-t", "sign"), None);
        assert_eq!(differs("sign", "wald"), None);
        for (declared, done) in [("clustered-t", "wald"), ("ranks-exact", "sign")] {
            let said = differs(declared, done).unwrap();
            assert!(said.contains(&format!("`{done}` decided")), "{said}");
        }
    }

    #[test]
    fn a_document_that_was_edited_or_is_too_late_is_noticed() {
        let protocol = with_vaf();
        let mut edited = document(&protocol);
        edited.participants = 10;
        let found = said(&edited, &protocol, 10);
        assert!(
            found.iter().any(|d| d.contains("its hash differs")),
            "{found:?}"
        );
        // With a new hash the contradiction inside is left.
        let mut forged = document(&protocol);
        forged.protocol.analysis["analysis"]["alpha"] = serde_json::json!(0.2);
        let found = said(&forged.sealed(), &protocol, 12);
        assert!(
            found.iter().any(|d| d.contains("fingerprints")),
            "{found:?}"
        );
        let mut late = document(&protocol);
        late.date = NaiveDate::from_ymd_opt(2026, 3, 3).unwrap();
        let found = said(&late.sealed(), &protocol, 12);
        assert!(
            found[0].starts_with("the first session began on 2026-03-02"),
            "{found:?}"
        );
        assert!(Preregistration::read(b"{}").is_err());
        let other = serde_json::to_string(&document(&protocol)).unwrap();
        let other = other.replace("preregistration/1", "preregistration/2");
        let error = Preregistration::read(other.as_bytes()).unwrap_err();
        assert!(error.to_string().contains("preregistration/2"));
    }
}
