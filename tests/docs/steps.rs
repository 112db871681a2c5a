//! The commands of a page, and a comparison of what they print with what it shows.

use crate::markdown::{Block, Page, code};
use crate::support::player::{play_to_end, play_until, quit};
use crate::support::{Terminal, repository};
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// Stands for lines, or for a part of a line, that the page leaves out.
const LEFT_OUT: &str = "…";
/// How often a command that depends on time is tried.
const TRIES: usize = 5;
/// The folders of the repository that a reader has at hand.
const AT_HAND: [&str; 5] = ["docs", "examples", "firmware", "protocols", "tests"];

/// A command and the output that the page shows below it.
#[derive(Debug, PartialEq, Eq)]
struct Step {
    command: String,
    shown: Vec<String>,
}

/// The commands of a block; one that ends with a backslash goes on in the next line.
fn steps(block: &Block) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    let mut goes_on = false;
    for line in &block.lines {
        match (line.strip_prefix("$ "), goes_on) {
            (Some(command), false) => steps.push(Step {
                command: command.to_owned(),
                shown: Vec::new(),
            }),
            (None, false) if steps.is_empty() => panic!("a block does not begin with `$ `: {line}"),
            (None, false) => steps.last_mut().unwrap().shown.push(line.clone()),
            (_, true) => {
                let command = &mut steps.last_mut().unwrap().command;
                command.push('\n');
                command.push_str(line);
            }
        }
        goes_on = line.ends_with('\\') && steps.last().is_some_and(|s| s.shown.is_empty());
    }
    steps
}

/// Whether a line was printed as the page shows it.
fn matches(shown: &str, printed: &str) -> bool {
    let mut parts = shown.split(LEFT_OUT);
    let Some(mut rest) = parts.next().and_then(|first| printed.strip_prefix(first)) else {
        return false;
    };
    let parts: Vec<&str> = parts.collect();
    let Some((last, middle)) = parts.split_last() else {
        return rest.is_empty();
    };
    for part in middle {
        match rest.split_once(part) {
            Some((_, after)) => rest = after,
            None => return false,
        }
    }
    rest.ends_with(last)
}

/// The first line of `shown` that was not printed in its place; an end that is missing is `…`.
fn difference<'a>(shown: &'a [String], printed: &[&str]) -> Option<&'a str> {
    let mut at = 0;
    let mut skips = false;
    for line in shown {
        if line == LEFT_OUT {
            skips = true;
            continue;
        }
        let mut rest = printed[at..].iter();
        let found = match skips {
            true => rest.position(|other| matches(line, other)),
            false => rest.next().filter(|other| matches(line, other)).map(|_| 0),
        };
        let Some(found) = found else {
            return Some(line.as_str());
        };
        at += found + 1;
        skips = false;
    }
    (!skips && at < printed.len()).then_some("(the end)")
}

/// What is wrong with what a command printed, if anything is.
fn wrong(step: &Step, ended_so: bool, printed: &str) -> Option<String> {
    let command = &step.command;
    if !ended_so {
        return Some(format!("`{command}` has another exit code:\n{printed}"));
    }
    let lines: Vec<&str> = printed.lines().map(str::trim_end).collect();
    difference(&step.shown, &lines)
        .map(|line| format!("`{command}`: the page has\n{line}\nbut it printed\n{printed}"))
}

/// A folder in which the commands of a page are run one after the other.
pub struct Shell {
    home: TempDir,
    background: Vec<Child>,
    /// All that was printed.
    printed: String,
}

impl Shell {
    pub fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        for part in AT_HAND {
            std::os::unix::fs::symlink(repository(part), home.path().join(part)).unwrap();
        }
        Self {
            home,
            background: Vec::new(),
            printed: String::new(),
        }
    }

    pub fn folder(&self) -> &Path {
        self.home.path()
    }

    fn command(&self, line: &str) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_study")).parent().unwrap();
        let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
        let mut shell = Command::new("sh");
        shell
            .args(["-c", line])
            .current_dir(self.folder())
            .env("PATH", path);
        shell
    }

    /// Runs a command; whether it succeeded, and what it printed.
    fn run(&self, line: &str) -> (bool, String) {
        let both = format!("exec 2>&1\n{line}");
        let output = self.command(&both).output().unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        (output.status.success(), printed)
    }

    /// Starts a command that goes on, and waits for its first lines: as many as the page shows, or one.
    fn start(&mut self, line: &str, shown: &[String]) -> Option<String> {
        let both = format!("exec 2>&1\nexec {}", line.trim_end_matches('&'));
        let mut command = self.command(&both);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let printed = BufReader::new(child.stdout.take().unwrap()).lines();
        let printed: Vec<String> = (printed.take(shown.len().max(1)))
            .map(Result::unwrap)
            .collect();
        self.background.push(child);
        let lines: Vec<&str> = printed.iter().map(|line| line.trim_end()).collect();
        let different = !shown.is_empty() && difference(shown, &lines).is_some();
        (different || printed.is_empty())
            .then(|| format!("`{line}` printed\n{}", printed.join("\n")))
    }

    /// Plays a session in a terminal.
    fn session(&self, line: &str, to_the_end: bool) {
        let words = shell_words::split(line).unwrap();
        let arguments: Vec<&str> = words.iter().skip(1).map(String::as_str).collect();
        // Only the simulated device within the program can be hurried.
        let is_within = !["--port", "--command"]
            .iter()
            .any(|o| arguments.contains(o));
        let mut terminal = match is_within {
            true => Terminal::hurried(&arguments, self.folder()),
            false => Terminal::start(&arguments, self.folder(), 24, 80),
        };
        terminal.wait_for("Who takes part?");
        if to_the_end {
            play_to_end(&mut terminal, "P01");
        } else {
            play_until(&mut terminal, "P01", "trial 3 of");
            quit(&mut terminal);
        }
    }

    /// Runs one command; what is wrong with it, if anything is.
    fn step(&mut self, step: &Step, block: &Block) -> Option<String> {
        let Step { command, shown } = step;
        let in_terminal = command.starts_with("study run ") && !command.contains("--plain");
        if command.ends_with('&') {
            return self.start(command, shown);
        }
        if in_terminal {
            assert!(shown.is_empty(), "`{command}` has no output to compare");
            self.session(command, block.is("to-the-end"));
            return None;
        }
        // A check of a device can miss a time limit on a busy machine.
        let tries = if block.is("in-time") { TRIES } else { 1 };
        let mut fault = None;
        for _ in 0..tries {
            let (succeeded, printed) = self.run(command);
            fault = wrong(step, succeeded != block.is("fails"), &printed);
            if fault.is_none() {
                self.printed.push_str(&printed);
                break;
            }
        }
        fault
    }

    /// Runs all commands of a page.
    ///
    /// # Panics
    /// With everything that is not as the page says.
    pub fn follow(&mut self, page: &Page) {
        let mut faults = Vec::new();
        let mut commands = 0;
        for block in &page.blocks {
            let place = |fault: String| format!("{}:{}: {fault}", page.path, block.line);
            if let Some(file) = block.value("save") {
                let text = block.lines.join("\n") + "\n";
                fs::write(self.folder().join(file), text).unwrap();
            }
            if block.language() == "console" {
                let steps = steps(block);
                commands += steps.len();
                let found = steps.iter().filter_map(|step| self.step(step, block));
                faults.extend(found.map(place));
            }
        }
        assert!(commands > 0, "{}: there are no commands", page.path);
        for (line, text) in &page.prose {
            for number in code(text).filter(|n| n.contains('.') && n.parse::<f64>().is_ok()) {
                if !self.printed.contains(number) {
                    let path = &page.path;
                    faults.push(format!("{path}:{line}: `{number}` was not printed"));
                }
            }
        }
        assert!(faults.is_empty(), "{}", faults.join("\n\n"));
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        for child in &mut self.background {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::markdown::parse;

    fn lines(text: &str) -> Vec<String> {
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn commands_and_their_output() {
        let page = parse("p", "```console\n$ a \\\n  b\nx\\\ny\n$ c\n```\n");
        let [first, second] = &steps(&page.blocks[0])[..] else {
            panic!("two commands");
        };
        assert_eq!(first.command, "a \\\n  b");
        assert_eq!(first.shown, ["x\\", "y"]);
        assert_eq!((second.command.as_str(), second.shown.len()), ("c", 0));
    }

    #[test]
    fn what_is_left_out_is_marked() {
        for (shown, printed, same) in [
            ("a\nb", "a\nb", true),
            ("a", "a\nb", false),
            ("a\n…", "a\nb", true),
            ("…\nb", "a\nb", true),
            ("…\nb", "a\nb\nc", false),
            ("b", "a\nb", false),
            ("", "", true),
            ("", "a", false),
            ("p = … of 5", "p = 0.03 of 5", true),
            ("p = … of 5", "p = 0.03 of 6", false),
            ("p = 0.02 …", "p = 0.03 x", false),
            ("a … b … c", "a 1 b 2 c", true),
            ("a … b … c", "a 1 c", false),
        ] {
            let printed: Vec<&str> = printed.lines().collect();
            let shown = lines(shown);
            assert_eq!(difference(&shown, &printed).is_none(), same, "{shown:?}");
        }
    }

    #[test]
    fn a_wrong_number_is_found() {
        let page = |text: &str| parse("p", text);
        let right = "```console\n$ echo 0.25 N\n0.25 N\n$ echo more >&2\nmore\n```\n`0.25`\n";
        Shell::new().follow(&page(right));
        for wrong in [
            right.replacen("\n0.25 N", "\n0.24 N", 1),
            right.replace("`0.25`", "`0.24`"),
            right.replace("\nmore", ""),
            right.replace("console", "console,fails"),
            right.replace("$ echo more >&2\nmore", "$ false"),
        ] {
            let followed = std::panic::catch_unwind(|| Shell::new().follow(&page(&wrong)));
            assert!(followed.is_err(), "{wrong}");
        }
    }
}
