//! The texts of files that participants read.

use study_base::diagnostic::{Fault, Findings};
use study_base::text::is_unsafe;
use study_plan::protocol::Protocol;
use study_plan::protocol::file::Prose;

/// Largest file that is read, bytes.
pub(super) const MAX_BYTES: usize = 256 * 1024;

/// What a file is called in messages.
pub(super) fn name(which: Prose) -> &'static str {
    match which {
        Prose::Consent => "consent",
        Prose::Debriefing => "debriefing",
    }
}

/// The texts that were read.
#[derive(Debug, Default)]
pub(super) struct Texts {
    consent: Option<String>,
    debriefing: Option<String>,
}

impl Texts {
    /// Takes the text of a file at `path`; the faults of the file.
    pub(super) fn read(&mut self, which: Prose, path: String, text: &str) -> Findings {
        let (text, findings) = read(which, path, text);
        match which {
            Prose::Consent => self.consent = Some(text),
            Prose::Debriefing => self.debriefing = Some(text),
        }
        findings
    }

    /// Gives a protocol the texts of its files.
    pub(super) fn fill(&mut self, protocol: &mut Protocol) {
        if let Some(consent) = &mut protocol.consent {
            consent.text = self.consent.take();
        }
        if let (Some(debriefing), Some(text)) = (&mut protocol.debriefing, self.debriefing.take()) {
            debriefing.add(&text);
        }
    }
}

/// The text as it is shown, of a file at `path`, and the faults of the file. Word processors leave tabs, and marks of
/// direction and width that nobody sees: pages spell them out.
fn read(which: Prose, path: String, text: &str) -> (String, Findings) {
    let text = text.trim_start_matches('\u{feff}').trim_end();
    let mut findings = Findings::new(path, text);
    if text.trim().is_empty() {
        let (what, hint) = match which {
            Prose::Consent => (
                "the text of the consent document is empty",
                "write what participants agree to, or leave out `text`",
            ),
            Prose::Debriefing => (
                "the text of the debriefing is empty",
                "write what the study was about, or leave out `file`",
            ),
        };
        findings.faults.push(Fault::error(what).hint(hint));
    }
    let spelled = |c: char| is_unsafe(c) && !matches!(c, '\n' | '\r' | '\t');
    if let Some((at, c)) = text.char_indices().find(|(_, c)| spelled(*c)) {
        findings.faults.push(
            Fault::warning(format!(
                "the participant reads a character that is not seen as \\u{{{:x}}}",
                u32::from(c)
            ))
            .at(Some(at..at + c.len_utf8()))
            .hint("remove it, and others like it: save the text as plain text"),
        );
    }
    let shown = text.replace("\r\n", "\n").replace('\r', "\n");
    (shown.replace('\t', "    "), findings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tabs_are_spaces_and_what_nobody_sees_is_a_warning() {
        let (text, findings) = read(
            Prose::Consent,
            "c.txt".to_owned(),
            "\u{feff}Turn\ta knob.\r\n\r\nRest.\r\n",
        );
        assert_eq!(text, "Turn    a knob.\n\nRest.");
        assert!(findings.faults.is_empty());
        let (_, findings) = read(Prose::Consent, "c.txt".to_owned(), "Turn\n\u{200f}a knob.");
        assert!(!findings.has_errors());
        let shown = findings.render(false);
        assert!(
            shown.contains("a character that is not seen as \\u{200f}"),
            "{shown}"
        );
        for (prose, what) in [
            (Prose::Consent, "the text of the consent document is empty"),
            (Prose::Debriefing, "the text of the debriefing is empty"),
        ] {
            let (_, findings) = read(prose, "c.txt".to_owned(), " \n\t");
            assert!(findings.has_errors());
            let shown = findings.render(false);
            assert!(shown.contains(what), "{shown}");
        }
    }
}
