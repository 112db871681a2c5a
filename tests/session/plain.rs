//! Whole sessions in plain lines, typed at a pseudo-terminal and through a pipe.

use crate::support::player::play_to_end;
use crate::support::{
    HURRY, PATIENCE, PATIENT, Terminal, changed_protocol, program, repository, study,
};
use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{Read as _, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use study::plain::dialogue::Dialogue;
use study_plan::protocol::Answer;
use study_session::outcome::Author;
use study_session::session::{Input, Screen};

/// `study` with its lines.
pub(crate) struct Lines {
    pub(crate) child: Box<dyn Child + Send + Sync>,
    _master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    output: Receiver<Vec<u8>>,
    /// All that was printed.
    pub(crate) seen: String,
    /// How much of it was already acted on.
    read: usize,
    /// The trial that was named last.
    trial: u32,
    /// How long an Enter would be taken for a held key.
    unread: Duration,
}

/// How the lines begin that wait for an answer.
const ASKS: [&str; 8] = [
    "Type the participant",
    "Type the operator",
    "Type y",
    "Press Enter",
    "Type a number",
    "Type the number",
    "Type your answer",
    "The session is",
];

/// Text without the sequences by which the console of another system moves the cursor.
fn without_sequences(text: &str) -> String {
    let mut pieces = text.split("\u{1b}[");
    let mut plain = pieces.next().unwrap().to_owned();
    for piece in pieces {
        plain.push_str(
            piece
                .trim_start_matches(|c: char| !c.is_ascii_alphabetic())
                .get(1..)
                .unwrap_or(""),
        );
    }
    plain
}

impl Lines {
    /// A session that goes faster than a person would: see [`HURRY`].
    pub(crate) fn hurried(folder: &Path, arguments: &[&str]) -> Self {
        let mut lines = Self::start(folder, arguments, Some(HURRY));
        lines.unread /= HURRY.1.parse().unwrap();
        lines
    }

    pub(crate) fn start(folder: &Path, arguments: &[&str], variable: Option<(&str, &str)>) -> Self {
        Self::of(program(), folder, arguments, variable)
    }

    pub(crate) fn of(
        program: std::ffi::OsString,
        folder: &Path,
        arguments: &[&str],
        variable: Option<(&str, &str)>,
    ) -> Self {
        let size = PtySize {
            rows: 24,
            // The console of another system breaks longer lines.
            cols: 250,
            pixel_width: 0,
            pixel_height: 0,
        };
        let pair = native_pty_system().openpty(size).unwrap();
        let mut command = CommandBuilder::new(program);
        command.args(arguments);
        command.cwd(folder);
        command.env("TERM", "xterm-256color");
        if let Some((name, value)) = variable {
            command.env(name, value);
        }
        let child = pair.slave.spawn_command(command).unwrap();
        let mut reader = pair.master.try_clone_reader().unwrap();
        let (send, output) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n @ 1..) = reader.read(&mut bytes) {
                if send.send(bytes[..n].to_vec()).is_err() {
                    break;
                }
            }
        });
        Self {
            child,
            keys: pair.master.take_writer().unwrap(),
            _master: pair.master,
            output,
            seen: String::new(),
            read: 0,
            trial: 0,
            unread: Duration::from_millis(320),
        }
    }

    pub(crate) fn types(&mut self, text: &str) {
        self.keys.write_all(text.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Waits for a line after what was read that starts with one of `starts`; the line, or
    /// nothing at the end of the output.
    pub(crate) fn line(&mut self, starts: &[&str]) -> String {
        let line = self.line_before(starts, Instant::now() + PATIENCE);
        line.unwrap_or_else(|| panic!("{starts:?}:\n{}", self.seen))
    }

    /// The same; `None` if it does not come in time.
    fn line_before(&mut self, starts: &[&str], until: Instant) -> Option<String> {
        loop {
            while let Some((line, _)) = self.seen[self.read..].split_once('\n') {
                let line = line.trim_end().to_owned();
                self.read += self.seen[self.read..].find('\n').unwrap() + 1;
                let counted = line.strip_prefix("Trial ");
                if let Some(rest) = counted.or_else(|| line.strip_prefix("Practice ")) {
                    self.trial = rest.split(' ').next().unwrap().parse().unwrap();
                }
                if starts.iter().any(|start| line.starts_with(start)) {
                    return Some(line);
                }
            }
            let left = until.checked_duration_since(Instant::now())?;
            // The output ends after its last bytes, and the program may end before them.
            let wait = left.min(Duration::from_millis(100));
            match self.output.recv_timeout(wait) {
                Ok(bytes) => {
                    let text = String::from_utf8_lossy(&bytes);
                    self.seen
                        .push_str(&match std::env::var_os("STUDY_TEST_PROGRAM") {
                            Some(_) => without_sequences(&text),
                            None => text.into_owned(),
                        });
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Some(String::new()),
            }
        }
    }

    /// Waits for the line, and until an Enter is no longer taken for a held key.
    pub(crate) fn asked(&mut self, starts: &[&str]) -> String {
        let line = self.line(starts);
        std::thread::sleep(self.unread);
        line
    }

    /// Types what each page asks for, until a line starts with `stop`, or to the end.
    pub(crate) fn play(&mut self, stop: Option<&str>) -> String {
        let starts: Vec<&str> = ASKS.into_iter().chain(stop).collect();
        loop {
            let line = self.asked(&starts);
            if line.is_empty() || stop.is_some_and(|stop| line.starts_with(stop)) {
                return line;
            }
            if line.starts_with("The session is") {
                return line;
            }
            self.answer(&line);
        }
    }

    /// Types what a line of [`ASKS`] asks for.
    fn answer(&mut self, asked: &str) {
        let rating = 2 + self.trial % 5;
        let typed = match asked {
            l if l.contains("Enter alone: ") => "\n".to_owned(),
            l if l.starts_with("Type the participant") => "P01\n".to_owned(),
            l if l.starts_with("Type the operator") => "lw\n".to_owned(),
            l if l.starts_with("Type y:") || l.starts_with("Type y ") => "y\n".to_owned(),
            l if ["1 to 7", "1 to 9"]
                .iter()
                .any(|s| l[13..].starts_with(&format!(" from {s}"))) =>
            {
                format!("{rating}\n")
            }
            l if l.starts_with("Type a number") && self.trial > 0 => format!("3{rating}\n"),
            l if l.starts_with("Type a number") => "33\n".to_owned(),
            l if l.starts_with("Type the number") => "1\n".to_owned(),
            _ => "\n".to_owned(),
        };
        self.types(&typed);
    }

    /// Plays until a moment, then kills the program: the number of trials that were shown as
    /// saved.
    pub(crate) fn play_and_kill(mut self, until: Instant) -> usize {
        while let Some(line) = self.line_before(&ASKS, until)
            && !line.is_empty()
            && !line.starts_with("The session is")
        {
            std::thread::sleep(self.unread);
            self.answer(&line);
        }
        let id = self.child.process_id().unwrap().to_string();
        let killed = std::process::Command::new("kill")
            .args(["-KILL", &id])
            .status();
        // It may have ended by itself.
        killed.unwrap();
        self.child.wait().unwrap();
        while let Ok(bytes) = self.output.recv_timeout(PATIENCE) {
            self.seen.push_str(&String::from_utf8_lossy(&bytes));
        }
        let saved = self.seen.rsplit("Trials saved: ");
        let counts = saved.filter_map(|after| after.split('.').next()?.parse().ok());
        counts.max().unwrap_or(0)
    }

    /// Checks that the output is append-only text.
    fn is_plain(&self) {
        let drawn = |c: char| ('\u{2500}'..='\u{28ff}').contains(&c);
        let control = |c: char| c.is_control() && !matches!(c, '\n' | '\r');
        let odd = self.seen.chars().find(|c| drawn(*c) || control(*c));
        assert_eq!(odd, None, "{}", self.seen);
    }
}

/// Times, checksums, and what the device measured.
const NOT_COMPARED: [&str; 12] = [
    "crc",
    "prev",
    "seq",
    "wall",
    "mono_ns",
    "playback",
    "rendering",
    "telemetry",
    "reference_s",
    "response_s",
    "rested_s",
    "channel",
];

/// The events of a journal without what differs from session to session.
pub(crate) fn events(folder: &Path) -> Vec<Value> {
    events_of(folder, "turn-signal")
}

/// The same of another study.
pub(crate) fn events_of(folder: &Path, study: &str) -> Vec<Value> {
    let sessions = folder.join("results").join(study).join("sessions");
    let mut journals = Vec::new();
    find(&sessions, &mut journals);
    assert_eq!(journals.len(), 1, "{journals:?}");
    let lines = segments(&journals[0]).into_iter();
    let told = |event: Value| {
        let mut event = event;
        let object = event.as_object_mut().unwrap();
        for key in NOT_COMPARED {
            object.remove(key);
        }
        event
    };
    lines.map(told).collect()
}

/// The records of a journal and of its next segments, as lines. A session that is continued
/// after a kill repeats the records that were written and not yet acknowledged (the kill
/// came between the sync of the journal and that of its head): they count once. A line
/// without its end is no record.
pub(crate) fn records(journal: &Path) -> Vec<String> {
    let next = (2..).map(|n| journal.with_file_name(format!("journal-{n}.jsonl")));
    let all = std::iter::once(journal.to_owned()).chain(next.take_while(|path| path.exists()));
    let mut known = BTreeSet::new();
    let mut records = Vec::new();
    for path in all {
        let text = fs::read_to_string(path).unwrap();
        let lines = text
            .split_inclusive('\n')
            .filter(|line| line.ends_with('\n'));
        let new = lines.filter(|line| known.insert((*line).to_owned()));
        records.extend(new.map(|line| line.trim_end().to_owned()));
    }
    records
}

/// The events of a journal and of its next segments.
pub(crate) fn segments(journal: &Path) -> Vec<Value> {
    let lines = records(journal).into_iter();
    lines
        .map(|line| serde_json::from_str(&line).unwrap())
        .collect()
}

pub(crate) fn find(folder: &Path, journals: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(&path, journals);
        } else if path.ends_with("journal.jsonl") {
            journals.push(path);
        }
    }
}

/// The paper's study with each realization once.
pub(crate) fn short(folder: &Path) -> std::path::PathBuf {
    let protocol = folder.join("paper");
    let once = ("repetitions = 3", "repetitions = 1");
    changed_protocol("turn-signal", &protocol, &[PATIENT, once]);
    protocol
}

#[test]
fn the_journal_is_that_of_the_full_screen_and_the_lines_are_plain() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = short(folder.path());
    let path = protocol.to_str().unwrap();

    let lines = tempfile::tempdir().unwrap();
    let mut plain = Lines::hurried(lines.path(), &["run", path, "--plain"]);
    let end = plain.play(None);
    assert!(end.starts_with("The session is finished"), "{}", plain.seen);
    plain.is_plain();
    assert!(plain.seen.contains("Trials saved: 5."), "{}", plain.seen);

    let screen = tempfile::tempdir().unwrap();
    let arguments = ["run", path, "--operator", "lw"];
    let mut full = Terminal::hurried(&arguments, screen.path());
    play_to_end(&mut full, "P01");

    let (plain, full) = (events(lines.path()), events(screen.path()));
    assert!(plain.len() > 30, "{}", plain.len());
    assert_eq!(last_answers(&plain), last_answers(&full));
    // A busy machine can lose a playback: its trial is then repeated at another place.
    let lost = |events: &[Value]| events.iter().any(|e| e["event"] == "attempt_failed");
    if !lost(&plain) && !lost(&full) {
        assert_eq!(plain, full);
    }
}

/// The last answer to each question of each trial.
pub(crate) fn last_answers(events: &[Value]) -> BTreeMap<String, Value> {
    let answers = events.iter().filter(|e| e["event"] == "answered");
    let place = |e: &Value| format!("{} {}", e["place"]["trial"]["trial"], e["question"]);
    answers.map(|e| (place(e), e["answer"].clone())).collect()
}

/// A kill between the sync of the journal and that of its head, and one in a write.
#[test]
fn a_repeated_record_counts_once_and_a_torn_one_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("journal.jsonl");
    fs::write(&journal, "{\"seq\":1}\n{\"seq\":2}\n{\"se").unwrap();
    let second = folder.path().join("journal-2.jsonl");
    fs::write(second, "{\"seq\":2}\n{\"seq\":3}\n").unwrap();
    let found: Vec<u64> = (segments(&journal).iter())
        .map(|event| event["seq"].as_u64().unwrap())
        .collect();
    assert_eq!(found, [1, 2, 3]);
}

#[test]
fn lines_can_remark_correct_stop_pause_quit_and_resume() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = short(folder.path());
    let run = ["run", protocol.to_str().unwrap(), "--operator", "lw"];
    let mut plain = Lines::start(folder.path(), &run, Some(("STUDY_PLAIN", "1")));
    plain.play(Some("Press Enter to go on"));
    plain.types(" ");
    plain.asked(&["Enter alone: play it again."]);
    plain.types("\n");
    plain.asked(&["Press Enter to go on"]);
    plain.types("\u{1b}");
    plain.asked(&["Enter alone: play it again."]);
    plain.types("/remark motor hums\n/bad somebody came in\n");
    plain.play(Some("Trials saved: 2."));
    plain.types("/correct\n");
    plain.asked(&["Type the number of the answer to correct"]);
    plain.types("1\n");
    plain.asked(&["Type a number from 1 to 7"]);
    plain.types("9\n");
    plain.asked(&["The scale goes from 1 to 7."]);
    plain.types("7\n");
    plain.asked(&["Type the reason"]);
    plain.types("mistyped\n");
    plain.types("/pause\n");
    plain.asked(&["Press Enter to continue, or type /quit."]);
    plain.types("/nonsense\u{7}\n");
    plain.asked(&["/nonsense\\u{7} is no command."]);
    plain.types("/quit\n");
    plain.asked(&["Leave the session?"]);
    plain.types("y\n");
    let end = plain.line(&["The session is not finished"]);
    assert!(!end.is_empty(), "{}", plain.seen);
    plain.child.wait().unwrap();

    let mut plain = Lines::start(folder.path(), &run, Some(("TERM", "dumb")));
    let end = plain.play(None);
    assert!(end.starts_with("The session is finished"), "{}", plain.seen);
    plain.is_plain();
    plain.child.wait().unwrap();
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let results = folder.path().join("results/turn-signal");
    let ratings = fs::read_to_string(results.join("ratings.csv")).unwrap();
    assert_eq!(ratings.lines().count(), 6, "{ratings}");
    assert_eq!(crate::screen::rated(&ratings), 5, "{ratings}");
    let attempts = fs::read_to_string(results.join("attempts.csv")).unwrap();
    for by in [
        ",experimenter,motor hums,",
        ",marked-bad,,somebody came in,",
        ",experimenter,mistyped,",
    ] {
        assert_eq!(attempts.matches(by).count(), 1, "{by}\n{attempts}");
    }
}

#[test]
fn a_pipe_that_ends_leaves_the_session_unfinished_and_everything_saved() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let mut child = std::process::Command::new(program())
        .args(["run", &protocol, "--plain"])
        .current_dir(folder.path())
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(b"P01\nlw\n").unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{out}");
    assert!(out.contains("The session is not finished"), "{out}");
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

/// Of several lines that are pasted at once only the first is meant for the page.
#[test]
fn of_pasted_lines_only_the_first_answers() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = short(folder.path());
    let run = ["run", protocol.to_str().unwrap(), "--plain"];
    let mut lines = Lines::start(folder.path(), &run, None);
    lines.play(Some("Type a number from 1 to 7"));
    lines.types("6\n7\n6\n7\n6\n");
    lines.play(Some("Trial 3 of"));
    lines.types("/quit\n");
    lines.asked(&["Leave the session?"]);
    lines.types("y\n");
    lines.line(&["The session is not finished"]);
    lines.child.wait().unwrap();
    let journal = events(folder.path());
    let answered = journal.iter().filter(|e| e["event"] == "answered");
    let ratings: Vec<u64> = answered
        .filter_map(|e| e["answer"]["rating"].as_u64())
        .collect();
    // the second by the player
    assert_eq!(ratings, [6, 4]);
}

/// By whom a remark and a correction are, what an Enter keeps, and how a correction is left.
#[test]
fn typed_lines_have_an_author_and_a_way_back() {
    use crate::views::{TRIAL, comment, form, realism, view as shown};
    let mut view = shown(form(vec![realism(), comment()]));
    let mut dialogue = Dialogue::new(false, false);
    dialogue.follow(&view);
    for (command, by) in [
        ("/says", Author::Participant),
        ("/remark", Author::Experimenter),
    ] {
        let text = "it hums".to_owned();
        let typed = dialogue.line(&format!("{command} it hums"), &view);
        assert_eq!(typed.0, [Input::Remark { by, text }]);
    }
    let typed = |dialogue: &mut Dialogue, lines: &[&str]| {
        let mut last = (Vec::new(), Vec::new());
        for line in lines {
            last = dialogue.line(line, &view);
        }
        last
    };
    // At every step Enter alone leaves a correction.
    for steps in [
        &["/correct", ""][..],
        &["/correct", "1", ""],
        &["/correct", "1", "7", ""],
    ] {
        let left = typed(&mut dialogue, steps);
        assert_eq!(left, (Vec::new(), vec!["Nothing is corrected.".to_owned()]));
    }
    let (inputs, _) = typed(&mut dialogue, &["/correct", "1", "7", "mistyped"]);
    assert!(
        matches!(&inputs[..], [Input::Correct { by: Author::Experimenter, answer: Answer::Rating(7), reason, .. }] if reason == "mistyped"),
        "{inputs:?}"
    );
    // Nobody remarks before it is known who takes part.
    let who = shown(Screen::Who {
        participant: String::new(),
        operator: String::new(),
        roster: None,
        claiming: false,
    });
    let mut first = Dialogue::new(false, false);
    first.follow(&who);
    let said = first.line("/remark it hums", &who);
    assert_eq!(said.0, []);
    assert_eq!(said.1, ["That is possible once the session has begun."]);
    // Which answer Enter keeps after a step back.
    view.correctable[0].form = TRIAL;
    let said = Dialogue::new(false, false).follow(&view).lines.join(" ");
    assert!(
        said.contains('3') && said.contains("Enter alone keeps"),
        "{said}"
    );
}
