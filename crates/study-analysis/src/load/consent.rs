//! The text of a consent document.

use study_base::diagnostic::{Fault, Findings};
use study_base::text::is_unsafe;

/// The text as it is shown, of a file at `path`, and the faults of the file. Word processors leave tabs, and marks of
/// direction and width that nobody sees: pages spell them out.
pub(super) fn read(path: String, text: &str) -> (String, Findings) {
    let text = text.trim_start_matches('\u{feff}').trim_end();
    let mut findings = Findings::new(path, text);
    if text.trim().is_empty() {
        findings.faults.push(
            Fault::error("the text of the consent document is empty")
                .hint("write what participants agree to, or leave out `text`"),
        );
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
        let (text, findings) = read("c.txt".to_owned(), "\u{feff}Turn\ta knob.\r\n\r\nRest.\r\n");
        assert_eq!(text, "Turn    a knob.\n\nRest.");
        assert!(findings.faults.is_empty());
        let (_, findings) = read("c.txt".to_owned(), "Turn\n\u{200f}a knob.");
        assert!(!findings.has_errors());
        let shown = findings.render(false);
        assert!(
            shown.contains("a character that is not seen as \\u{200f}"),
            "{shown}"
        );
        let (_, findings) = read("c.txt".to_owned(), " \n\t");
        assert!(findings.has_errors());
    }
}
