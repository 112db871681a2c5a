//! Standard output and standard error.

use super::failure::Failure;
use std::io::{self, IsTerminal as _, Write};
use study_base::diagnostic::{Findings, Severity};
use study_base::text::{Untrusted, escaped_json};

/// Where a command prints: results with [`Console::out`], messages for the user with
/// [`Console::say`].
pub struct Console {
    out: Box<dyn Write>,
    err: Box<dyn Write>,
    /// Whether standard output shows colors.
    pub color: bool,
    /// Whether standard error shows colors.
    pub err_color: bool,
    /// Whether standard output is a terminal.
    pub terminal: bool,
    /// Columns of the terminal; 100 where there is none.
    pub width: usize,
}

/// Work that takes less time shows no progress bar.
pub(super) const PATIENCE: std::time::Duration = std::time::Duration::from_secs(1);

/// A progress bar on standard error, only on a terminal and only for work that
/// takes over a second.
pub(super) fn progress(length: u64, unit: &'static str) -> indicatif::ProgressBar {
    if !io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let bar = indicatif::ProgressBar::with_draw_target(
        Some(length),
        indicatif::ProgressDrawTarget::stderr_with_hz(5),
    );
    let template = "{bar:40} {pos} of {len} {msg} · {eta} left";
    if let Ok(style) = indicatif::ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(unit);
    bar
}

/// Joins words to a command line, quoted for a shell.
pub(super) fn shell_command(words: &[String]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    quoted.join(" ")
}

/// Quotes a word for a shell if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=@%+,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The failure to write standard output; none for a closed pipe, whose reader has ended.
pub(super) fn unwritten(error: &io::Error) -> Option<Failure> {
    let closed = error.kind() == io::ErrorKind::BrokenPipe;
    let why = study_session::store::plain(error);
    (!closed).then(|| Failure::input(format!("standard output: {why}")))
}

impl Console {
    /// The console of the process.
    pub fn of_process() -> Self {
        let plain = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty())
            || std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        let terminal = io::stdout().is_terminal();
        // Only with a terminal: without one, crossterm runs `tput`.
        let columns = terminal.then(crossterm::terminal::size);
        let width = match columns {
            Some(Ok((columns, _))) if columns > 0 => usize::from(columns),
            _ => 100,
        };
        Self {
            out: Box::new(io::BufWriter::new(io::stdout())),
            err: Box::new(io::stderr()),
            color: terminal && !plain,
            err_color: io::stderr().is_terminal() && !plain,
            terminal,
            width,
        }
    }

    /// A console that writes to `out` and `err`, without color, 100 columns wide.
    pub fn to(out: impl Write + 'static, err: impl Write + 'static) -> Self {
        Self {
            out: Box::new(out),
            err: Box::new(err),
            color: false,
            err_color: false,
            terminal: false,
            width: 100,
        }
    }

    /// Prints to standard output. A closed pipe is no error: the reader has ended.
    ///
    /// # Errors
    /// [`Failure`] if it cannot be written for another reason.
    pub fn out(&mut self, text: impl AsRef<str>) -> Result<(), Failure> {
        let written = self
            .out
            .write_all(text.as_ref().as_bytes())
            .and_then(|()| self.out.flush());
        match written.map_err(|e| unwritten(&e)) {
            Err(Some(failure)) => Err(failure),
            _ => Ok(()),
        }
    }

    /// Prints a JSON document to standard output.
    ///
    /// # Errors
    /// As [`Console::out`].
    pub fn json(&mut self, document: &serde_json::Value) -> Result<(), Failure> {
        self.document(format!("{document:#}\n"))
    }

    /// Prints the text of a JSON document to standard output, unsafe characters escaped.
    ///
    /// # Errors
    /// As [`Console::out`].
    pub fn document(&mut self, text: impl AsRef<str>) -> Result<(), Failure> {
        self.out(escaped_json(text.as_ref()))
    }

    /// Prints a message of one line to standard error.
    pub fn say(&mut self, text: impl AsRef<str>) {
        // A failure cannot be reported anywhere.
        let _ = writeln!(self.err, "{}", Untrusted(text.as_ref()));
    }

    /// Prints findings to standard error: first the errors of all files, then the warnings.
    pub fn findings(&mut self, findings: &[Findings]) {
        for severity in [Severity::Error, Severity::Warning] {
            for f in findings {
                let shown = f.only(severity).render(self.err_color);
                let _ = write!(self.err, "{shown}");
            }
        }
    }

    /// Prints the number of warnings and the command that shows them; nothing if none.
    pub fn warnings_in_short(&mut self, findings: &[Findings], protocol: &std::path::Path) {
        let count: usize = findings.iter().map(|f| f.faults.len()).sum();
        let path = protocol.display();
        match count {
            0 => {}
            1 => self.say(format!("1 warning: `study check {path}` shows it")),
            n => self.say(format!("{n} warnings: `study check {path}` shows them")),
        }
    }

    /// Prints why a command failed.
    pub fn failure(&mut self, failure: &Failure) {
        self.findings(&failure.findings);
        if !failure.message.is_empty() {
            self.say(format!("error: {}", failure.message));
        }
        if let Some(hint) = &failure.hint {
            self.say(format!("  hint: {hint}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_one_that_a_shell_understands() {
        let words = ["results/P-01", "my study", "it's", ""].map(quoted);
        assert_eq!(words, ["results/P-01", "'my study'", r"'it'\''s'", "''"]);
    }
}
