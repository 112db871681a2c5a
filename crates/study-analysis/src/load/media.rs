//! The files of pictures, videos and sounds.

use super::{Opened, OtherFiles};
use std::collections::BTreeMap;
use study_base::diagnostic::{Fault, Findings};
use study_base::hex::sha256;
use study_plan::protocol::check::Spans;
use study_plan::protocol::{Media, MediaFormat, Medium, ModelEntry, Protocol};

/// Largest file of a medium, bytes.
pub(super) const MAX_BYTES: usize = 16 * 1024 * 1024;
/// Largest size of all of them, bytes: the page keeps them in memory.
const MAX_TOGETHER: usize = 128 * 1024 * 1024;

/// Refuses content that is not that of a medium.
pub(super) fn check(bytes: &[u8], medium: Medium) -> Result<(), Fault> {
    let name = medium.as_str();
    let formats = medium.formats();
    match MediaFormat::of(bytes) {
        Some(format) if format.medium() == medium => Ok(()),
        Some(format) => Err(Fault::error(format!(
            "the {name} file is a {}, not a {name}",
            format.medium().as_str()
        ))
        .hint(format!("a {name} is {formats}"))),
        None if is_svg(bytes) => Err(Fault::error(format!(
            "the {name} file is an SVG, which can carry programs"
        ))
        .hint("export it as PNG")),
        None => Err(
            Fault::error(format!("the {name} file is not {formats}")).hint(
                "its first bytes say what a file is, not its name: convert it with another program",
            ),
        ),
    }
}

/// Whether it is text with the root of an SVG.
fn is_svg(bytes: &[u8]) -> bool {
    let begin = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    begin
        .trim_start_matches('\u{feff}')
        .trim_start()
        .starts_with('<')
        && begin.contains("<svg")
}

impl OtherFiles<'_> {
    /// Keeps the file of a medium.
    pub(super) fn keep(&mut self, file: &str, bytes: Vec<u8>, medium: Medium) -> Result<(), Fault> {
        check(&bytes, medium)?;
        let before = self.media_bytes;
        self.media_bytes += bytes.len();
        // Said once.
        if before <= MAX_TOGETHER && self.media_bytes > MAX_TOGETHER {
            let most = MAX_TOGETHER / (1024 * 1024);
            return Err(
                Fault::error(format!("the media have more than {most} MiB together"))
                    .hint("the page loads all of them before the first trial: compress them"),
            );
        }
        self.opened.push(Opened {
            file: file.to_owned(),
            bytes,
            model: None,
            realization: None,
            findings: Findings::new("", ""),
        });
        Ok(())
    }
}

/// Notes the content of the media, and refuses texts that tell apart what looks or sounds the same.
pub(super) fn pin(
    protocol: &mut Protocol,
    others: &OtherFiles<'_>,
    spans: &Spans,
    findings: &mut Findings,
) {
    let mut known: BTreeMap<String, Option<String>> = BTreeMap::new();
    for file in (protocol.models.iter_mut()).flat_map(|model| model.media.files_mut()) {
        let hash = known.entry(file.file.clone()).or_insert_with(|| {
            let opened = others.opened.iter().find(|o| o.file == file.file)?;
            Some(sha256(&opened.bytes))
        });
        file.sha256.clone_from(hash);
    }
    let visible = [Medium::Picture, Medium::Video];
    for i in 0..protocol.models.len() {
        let alt = told_by(&protocol.models, i, &visible, |media| &media.alt);
        let caption = told_by(&protocol.models, i, &Medium::ALL, |media| &media.caption);
        let told = [("alt", alt), ("caption", caption)].into_iter();
        for (key, other) in told.filter_map(|(key, other)| Some((key, other?))) {
            let span = |key: &str| spans.get(&format!("models[{i}].{key}")).cloned();
            findings.faults.push(
                Fault::error(format!(
                    "`{}` and `{}` look or sound the same, and their `{key}` tells them apart",
                    other.id, protocol.models[i].id
                ))
                .at(span(key).or(span("id")))
                .hint("write the same text for both"),
            );
        }
    }
}

/// The realization before another one in the protocol that has the same content of some media, and another text.
fn told_by<'p>(
    models: &'p [ModelEntry],
    at: usize,
    of: &[Medium],
    text: fn(&Media) -> &Option<String>,
) -> Option<&'p ModelEntry> {
    let own = &models[at].media;
    let hash = |media: &Media, medium| media.file(medium).and_then(|file| file.sha256.clone());
    let same = |other: &Media| of.iter().all(|m| hash(other, *m) == hash(own, *m));
    let mut earlier = models[..at].iter();
    earlier.find(|other| {
        let media = &other.media;
        !media.is_empty() && !own.is_empty() && same(media) && text(media) != text(own)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{FILE_NAME, examine};
    use std::fs;
    use std::path::Path;

    const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01";
    const WAV: &[u8] = b"RIFF\x24\0\0\0WAVEfmt \x10\0\0\0";

    const PROTOCOL: &str = r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 2007 }
design = { participants = 2, repetitions = 1, order = "blocked" }
device = { kind = "manual", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "realism" }
models = [
    { id = "A", picture = "a.png", alt = "wood" },
    { id = "B", picture = "b.png", alt = "wood" },
]

[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic did it feel?"
from = 1
to = 7
"#;

    /// The study with these files: the messages of its errors, and what was loaded.
    fn loaded(
        protocol: &str,
        files: &[(&str, &[u8])],
    ) -> (Vec<String>, Option<crate::load::Loaded>) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(FILE_NAME), protocol).unwrap();
        for (name, bytes) in files {
            fs::write(folder.path().join(name), bytes).unwrap();
        }
        let (loaded, findings) = examine(Path::new(folder.path()));
        let errors = |f: &Findings| f.only(study_base::diagnostic::Severity::Error).faults;
        let faults = findings.iter().flat_map(errors);
        (faults.map(|fault| fault.message).collect(), loaded)
    }

    #[test]
    fn media_are_read_hashed_and_handed_over_to_be_frozen() {
        let (errors, study) = loaded(PROTOCOL, &[("a.png", PNG), ("b.png", PNG)]);
        assert_eq!(errors, Vec::<String>::new());
        let study = study.unwrap();
        let names: Vec<&str> = study.files.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, [FILE_NAME, "a.png", "b.png"]);
        assert_eq!(study.files[1].1, PNG);
        for model in &study.protocol.models {
            let file = model.media.file(Medium::Picture).unwrap();
            assert_eq!(file.sha256.as_deref(), Some(sha256(PNG).as_str()));
        }
        let other = [PNG, b"more"].concat();
        let (_, changed) = loaded(PROTOCOL, &[("a.png", PNG), ("b.png", &other[..])]);
        let changed = changed.unwrap().fingerprints;
        assert_ne!(changed.stimulus, study.fingerprints.stimulus);
        assert_eq!(changed.wording, study.fingerprints.wording);
    }

    #[test]
    fn what_is_missing_too_large_or_something_else_is_one_error() {
        let large = [PNG, &vec![0; MAX_BYTES]].concat();
        let svg = b"<?xml version=\"1.0\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\"/>";
        for (file, message) in [
            (
                None,
                "the picture file cannot be read: there is no such file",
            ),
            (
                Some(&large[..]),
                "the picture file cannot be read: it has more than 16384 KiB",
            ),
            (
                Some(&svg[..]),
                "the picture file is an SVG, which can carry programs",
            ),
            (Some(WAV), "the picture file is a sound, not a picture"),
            (
                Some(&b"<script>"[..]),
                "the picture file is not PNG or JPEG",
            ),
            (Some(&b""[..]), "the picture file is not PNG or JPEG"),
        ] {
            let mut files = vec![("a.png", PNG)];
            files.extend(file.map(|bytes| ("b.png", bytes)));
            let (errors, study) = loaded(PROTOCOL, &files);
            assert_eq!(errors, [message]);
            assert!(study.is_none());
        }
    }

    #[test]
    fn a_file_that_was_read_as_something_else_is_looked_at_too() {
        let text = PROTOCOL.replace("\"b.png\"", "\"protocol.txt\"");
        let text = text.replace(
            "[[questions]]",
            "[consent]\ndocument = \"Consent\"\nversion = \"1\"\ntext = \"protocol.txt\"\n\n[[questions]]",
        );
        let (errors, _) = loaded(&text, &[("a.png", PNG), ("protocol.txt", &b"I agree."[..])]);
        assert_eq!(errors, ["the picture file is not PNG or JPEG"]);
        let both = PROTOCOL.replace("picture = \"b.png\", alt = \"wood\"", "sound = \"a.png\"");
        let (errors, _) = loaded(&both, &[("a.png", PNG)]);
        assert_eq!(errors, ["the sound file is a picture, not a sound"]);
    }

    #[test]
    fn texts_do_not_tell_apart_what_looks_the_same() {
        let other = PROTOCOL.replacen("wood", "stone", 1);
        let (errors, _) = loaded(&other, &[("a.png", PNG), ("b.png", PNG)]);
        assert_eq!(
            errors,
            ["`A` and `B` look or sound the same, and their `alt` tells them apart"]
        );
        let differ = [PNG, b"more"].concat();
        let (errors, _) = loaded(&other, &[("a.png", PNG), ("b.png", &differ[..])]);
        assert_eq!(errors, Vec::<String>::new());
    }

    #[test]
    fn all_media_together_have_a_limit() {
        let mut others = OtherFiles::new(Path::new("."));
        let bytes = [PNG, &vec![0; MAX_BYTES - PNG.len()]].concat();
        let mut refused = Vec::new();
        for n in 0..10 {
            let kept = others.keep(&format!("{n}.png"), bytes.clone(), Medium::Picture);
            refused.extend(kept.err().map(|fault| (n, fault.message)));
        }
        let message = "the media have more than 128 MiB together".to_owned();
        assert_eq!(refused, [(8, message)]);
    }
}
