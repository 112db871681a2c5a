//! `[study]`, `[text]`, `[consent]`, `[debriefing]`, `[session]` and `[trial]`.

use super::parts::{EXPOSURE, exposure};
use crate::protocol::keys::{Id, Key, Kind, Words as _, keys};
use crate::protocol::phrases::{Phrase, placeholders};
use crate::protocol::section::Section;
use crate::protocol::{
    Consent, Debriefing, Entry, ScaleDirection, SessionRules, Study, Text, TrialRules,
};
use std::collections::BTreeMap;
use study_base::diagnostic::{Fault, did_you_mean};
use study_base::text::Untrusted;

pub(super) const STUDY: &[Key] = keys! {
    /// The name of the study and of its results folder.
    "id": Kind::Id(Id::Study), r#""turn-signal""#, required;
    /// The title, for people. It heads reports and exports.
    "title": Kind::Text, r#""Realism of turn-signal switch models""#, required;
    /// The seed of all randomness. Every order of the study follows from it; another seed
    /// is another study.
    "seed": Kind::Whole(0, i64::MAX), "2007", required;
    /// The authors of the study, for exports.
    "authors": Kind::Texts(0), r#"["A. Researcher", "B. Researcher"]"#;
    /// The license of the data, for exports.
    "license": Kind::Text, r#""CC-BY-4.0""#;
    /// The number of the ethics approval, or a statement about it.
    "ethics": Kind::Text, r#""IRB 2007-12""#;
    /// Whom to contact about the study.
    "contact": Kind::Text, r#""lab@example.org""#;
    /// Who funded the study.
    "funding": Kind::Text, r#""Grant 1234""#;
    /// The DOI of the study or of its paper.
    "doi": Kind::Text, r#""10.1000/182""#;
};

pub(super) const TEXT: &[Key] = keys! {
    /// The first screen of the participant.
    "welcome": Kind::Text, r#""Welcome, and thank you for taking part.""#;
    /// Shown before the first trial.
    "instructions": Kind::Text, r#""Feel each realization, then rate it.""#;
    /// Shown before the practice trials.
    "practice": Kind::Text, r#""Two trials to practice come first.""#;
    /// Shown during a break.
    "break": Kind::Text, r#""Please rest your hand.""#;
    /// The last screen of the participant.
    "end": Kind::Text, r#""That was all. Thank you!""#;
    /// The language of the study's texts, as a BCP 47 tag. What a participant reads besides
    /// them, such as "Choose from the list first.", is shown in this language if it is one of
    /// en, de, fr, es, ja, zh-Hans and ar, else in English. Reports mark quoted texts with it.
    "lang": Kind::Text, r#""en""#;
    /// Single sentences instead of the fixed ones, by key. The JSON Schema lists the keys;
    /// words in braces, such as `{n}`, are replaced by numbers and have to stay.
    "words": Kind::Sentences, r#"{ rate = "go on", trial-of = "switch {n} of {total}" }"#;
    /// On which side scales begin, in the terminal and on the participant's page.
    "scale_direction": Kind::Word(ScaleDirection::WORDS), r#""ltr""#, derived("`rtl` for languages that are written from right to left, else `ltr`");
};

pub(super) const CONSENT: &[Key] = keys! {
    /// The title or file name of the document that the participant agrees to. The session
    /// asks for consent before anything else; no name is stored.
    "document": Kind::Text, r#""Consent to take part""#, required;
    /// The version of the document. It is recorded with the time of the consent.
    "version": Kind::Text, r#""2""#, required;
    /// The file with the text of the document, plain text in UTF-8. It is shown in full, and whoever agrees gets a
    /// copy: `consent.txt` in the folder of the session. Needs the format `study-protocol/3`.
    "text": Kind::Path, r#""consent.txt""#;
    /// Whether the participant types initials in place of a signature. Only the copy has them: no journal, table or
    /// export. Needs the format `study-protocol/3`.
    "initials": Kind::Flag, "true", default("false");
};

pub(super) const DEBRIEFING: &[Key] = keys! {
    /// The text, shown in full.
    "text": Kind::Text, r#""You felt models of one switch. We ask which details make it feel real.""#;
    /// A file with the text, plain text in UTF-8. With `text` as well, it is shown below that.
    "file": Kind::Path, r#""debriefing.txt""#;
};

pub(super) const SESSION: &[Key] = keys! {
    /// Who types the participant's answers. Each has screens of their own.
    "entry": Kind::Word(Entry::WORDS), r#""experimenter""#, default(r#""participant""#);
    /// The longest interruption after which a session simply resumes. After a longer one
    /// the operator chooses: restart the block (not of a search), continue (which is recorded), or record a
    /// drop-out.
    "resume_within_h": Kind::not_negative("h"), "2.5", default("4");
    /// The longest pause between feeling and answering, or between two intervals of a trial: the
    /// program was left or paused, waited for the device or the disk, or stood still, as on a
    /// suspended computer. After a longer one the trial is felt again, unless a question of it is
    /// answered already. Questionnaires between the trials are answered all the same, and marked: `questionnaire_late` of
    /// ratings.csv and a warning of the analysis.
    "longest_pause_s": Kind::not_negative("s"), "120", default("60");
};

pub(super) const TRIAL: &[Key] = keys! {
    /// The instruction about the reference, shown before each trial.
    "reference": Kind::Text, r#""Operate the real switch.""#;
    /// The least time that the reference screen stays.
    "reference_min_s": Kind::not_negative("s"), "5", default("0");
    /// Full strokes, counted from telemetry, before the questions of a trial open. A
    /// device without telemetry, such as a sample mounted by hand, cannot count them.
    "minimum_strokes": Kind::Whole(0, u32::MAX as i64), "2", default("0");
    /// How long a realization is felt. Enter goes on after the least time; a trial that was
    /// felt for less cannot be answered.
    "exposure": Kind::Table(EXPOSURE), "{ min_s = 3, max_s = 20, replays = 1 }";
    /// The largest time between the device's confirmed start and the onset of a picture, video or sound, by the page's
    /// clock and with what it may be wrong. Beyond it the attempt fails and the trial comes again. Needs the format
    /// `study-protocol/3`.
    "media_within_ms": Kind::positive("ms"), "60", default("100");
};

pub(super) fn study(mut section: Section<'_, '_>) -> Option<Study> {
    let (id, title) = (section.study_id("id"), section.text("title"));
    let seed = section.whole("seed");
    let authors = section
        .texts("authors")
        .into_iter()
        .map(|(_, name)| name)
        .collect();
    let license = section.text("license");
    let ethics = section.text("ethics");
    let contact = section.text("contact");
    let funding = section.text("funding");
    let doi = section.text("doi");
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

pub(super) fn text(mut section: Section<'_, '_>) -> Text {
    Text {
        welcome: section.text("welcome"),
        instructions: section.text("instructions"),
        practice: section.text("practice"),
        rest: section.text("break"),
        end: section.text("end"),
        lang: section.text("lang"),
        words: words(&mut section),
        scale_direction: section.word("scale_direction"),
    }
}

fn words(section: &mut Section<'_, '_>) -> BTreeMap<String, String> {
    let mut words = BTreeMap::new();
    for (key, value) in section.entries("words") {
        let Some(phrase) = Phrase::ALL.iter().find(|p| p.key() == key) else {
            let keys = Phrase::ALL.iter().map(|phrase| phrase.key());
            let hint = match did_you_mean(&key, keys) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`study schema` lists the keys".to_owned(),
            };
            let what = format!("`{}` is no fixed sentence", Untrusted(&key));
            value.fault(Fault::error(what).hint(hint));
            continue;
        };
        let Some(text) = crate::protocol::section::text(&value) else {
            continue;
        };
        let needed = placeholders(phrase.english());
        if placeholders(&text) != needed {
            value.fault(
                Fault::error(format!("`{key}` needs the words in braces of the sentence"))
                    .hint(format!("in English: \"{}\"", phrase.english())),
            );
        }
        words.insert(key, text);
    }
    words
}

pub(super) fn consent(mut section: Section<'_, '_>) -> Option<Consent> {
    let (document, version) = (section.text("document"), section.text("version"));
    let (file, initials) = (section.path_of("text"), section.flag("initials"));
    Some(Consent {
        document: document?,
        version: version?,
        file,
        text: None,
        initials: initials?,
    })
}

pub(super) fn debriefing(mut section: Section<'_, '_>) -> Option<Debriefing> {
    let says_nothing = section.value("text").is_none() && section.value("file").is_none();
    if section.is_there() && says_nothing {
        let fault = Fault::error("[debriefing] is empty");
        section.fault_at(
            "text",
            fault.hint("write `text`, or name a `file` with it, or leave the section out"),
        );
    }
    let (text, file) = (section.text("text"), section.path_of("file"));
    (text.is_some() || file.is_some()).then_some(Debriefing { file, text })
}

pub(super) fn session(mut section: Section<'_, '_>) -> Option<SessionRules> {
    Some(SessionRules {
        entry: section.word("entry")?,
        resume_within_h: section.number("resume_within_h")?,
        longest_pause_s: section.number("longest_pause_s")?,
    })
}

pub(super) fn trial(mut section: Section<'_, '_>) -> Option<TrialRules> {
    Some(TrialRules {
        reference: section.text("reference"),
        reference_min_s: section.number("reference_min_s")?,
        minimum_strokes: section.whole("minimum_strokes")?,
        exposure: section.section("exposure").and_then(exposure)?,
        media_within_ms: section.number("media_within_ms")?,
    })
}
