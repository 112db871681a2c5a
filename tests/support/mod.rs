//! Drives the real binary in a pseudo-terminal, as a person would.

#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(unreachable_pub, reason = "a module of several test files")]

pub mod player;
pub mod simulator;

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::num::NonZero;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long the program may take for one step before the test gives up. Generous: the
/// machine may be busy; nothing is asserted about time.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A session on the simulated device goes ten times as fast with this variable: for tests in
/// which a person's pace is not the matter. Any other device refuses it.
pub const HURRY: (&str, &str) = ("STUDY_TEST_HURRY", "10");

/// The program under test: the one that was built with the tests, or the one that
/// `STUDY_TEST_PROGRAM` names, such as a script that runs a build for another system.
pub fn program() -> std::ffi::OsString {
    std::env::var_os("STUDY_TEST_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_study").into())
}

/// The emulator does not accept a size of 0.
fn cells(n: u16) -> NonZero<u16> {
    NonZero::new(n.max(1)).unwrap()
}

/// A terminal emulator that shows whole pages only: what comes between the beginning
/// and the end of a synchronized update is published at its end.
struct Emulator {
    parser: vt100::Parser,
    /// The last bytes, in which a control sequence may have begun.
    tail: Vec<u8>,
    updating: bool,
    /// How often the bell was rung.
    bells: usize,
    shown: Shown,
}

/// A page of the terminal.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Shown {
    /// The text.
    pub text: String,
    /// Row and column of the cursor, if it is visible.
    pub cursor: Option<(u16, u16)>,
    /// Whether the program uses the alternate screen.
    pub alternate: bool,
}

impl Emulator {
    const UPDATE: &[u8] = b"\x1b[?2026";

    fn process(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.parser.process(&[*byte]);
            self.bells += usize::from(*byte == b'\x07');
            self.tail.push(*byte);
            if let Some(marker) = self.tail.strip_prefix(Self::UPDATE) {
                match marker {
                    [] => continue,
                    [b'l'] => {
                        self.updating = false;
                        self.publish();
                    }
                    // the page before is complete
                    _ if !self.updating => self.updating = true,
                    _ => {}
                }
                self.tail.clear();
            } else if !Self::UPDATE.starts_with(&self.tail) {
                self.tail.clear();
                if *byte == Self::UPDATE[0] {
                    self.tail.push(*byte);
                }
            }
        }
        if !self.updating {
            self.publish();
        }
    }

    fn publish(&mut self) {
        let screen = self.parser.screen();
        self.shown = Shown {
            text: screen.contents(),
            cursor: (!screen.hide_cursor()).then(|| screen.cursor_position()),
            alternate: screen.alternate_screen(),
        };
    }
}

/// The binary in a terminal.
pub struct Terminal {
    child: Box<dyn Child + Send + Sync>,
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    screen: Arc<Mutex<Emulator>>,
    reader: JoinHandle<()>,
}

impl Terminal {
    /// Starts `study` with arguments in a folder.
    pub fn start(arguments: &[&str], folder: &Path, rows: u16, columns: u16) -> Self {
        Self::start_with(arguments, folder, rows, columns, &[])
    }

    /// A session of `study run` in 24 lines of 80 columns, with [`HURRY`]: its first screen.
    pub fn hurried(arguments: &[&str], folder: &Path) -> Self {
        let hurry = (HURRY.0, Path::new(HURRY.1));
        let mut terminal = Self::start_with(arguments, folder, 24, 80, &[hurry]);
        terminal.wait_for("Who takes part?");
        terminal
    }

    /// Starts `study` with arguments and environment variables.
    pub fn start_with(
        arguments: &[&str],
        folder: &Path,
        rows: u16,
        columns: u16,
        variables: &[(&str, &Path)],
    ) -> Self {
        let pair = native_pty_system()
            .openpty(PtySize {
                rows,
                cols: columns,
                pixel_width: 0,
                pixel_height: 0,
            })
            .unwrap();
        let mut command = CommandBuilder::new(program());
        command.args(arguments);
        command.cwd(folder);
        command.env("TERM", "xterm-256color");
        for (name, value) in variables {
            command.env(name, value);
        }
        let child = pair.slave.spawn_command(command).unwrap();
        drop(pair.slave);
        let screen = Arc::new(Mutex::new(Emulator {
            parser: vt100::Parser::new(cells(rows), cells(columns), 0),
            tail: Vec::new(),
            updating: false,
            bells: 0,
            shown: Shown::default(),
        }));
        let mut reader = pair.master.try_clone_reader().unwrap();
        let shown = screen.clone();
        let reader_thread = std::thread::spawn(move || {
            let mut bytes = [0; 8192];
            while let Ok(n) = reader.read(&mut bytes) {
                if n == 0 {
                    break;
                }
                shown.lock().unwrap().process(&bytes[..n]);
            }
        });
        let keys = pair.master.take_writer().unwrap();
        Self {
            child,
            master: pair.master,
            keys,
            screen,
            reader: reader_thread,
        }
    }

    /// The last complete page.
    pub fn shown(&self) -> Shown {
        let screen = self.screen.lock().unwrap();
        // No session makes a sound, whatever is played: a sound could tell it.
        assert_eq!(screen.bells, 0, "the program rang the bell");
        screen.shown.clone()
    }

    /// The text of the last complete page.
    pub fn screen(&self) -> String {
        self.shown().text
    }

    /// The cells of the last complete page, with their colors.
    pub fn cells(&self) -> vt100::Screen {
        loop {
            let emulator = self.screen.lock().unwrap();
            if !emulator.updating {
                return emulator.parser.screen().clone();
            }
            drop(emulator);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Whether the program is on the alternate screen.
    pub fn alternate(&self) -> bool {
        self.shown().alternate
    }

    /// Types keys.
    pub fn keys(&mut self, keys: &str) {
        // A program that has ended reads no keys; the test sees that elsewhere.
        let _ = self.keys.write_all(keys.as_bytes());
        let _ = self.keys.flush();
    }

    /// Waits until the screen contains a text.
    pub fn wait_for(&mut self, text: &str) {
        self.wait_until(text, |screen| screen.contains(text));
    }

    /// Waits until the text of the screen satisfies a condition.
    pub fn wait_until(&mut self, what: &str, mut fine: impl FnMut(&str) -> bool) {
        let start = Instant::now();
        loop {
            let screen = self.screen();
            if fine(&screen) {
                return;
            }
            if start.elapsed() > PATIENCE {
                panic!("waited for `{what}`, the screen shows:\n{screen}");
            }
            std::thread::sleep(Duration::from_millis(3));
        }
    }

    /// Waits for the program to end and for its last output; the exit code.
    pub fn exit_code(&mut self) -> u32 {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap()
                && self.reader.is_finished()
            {
                return status.exit_code();
            }
            if start.elapsed() > PATIENCE {
                panic!("it does not end, the screen shows:\n{}", self.screen());
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Whether the program still runs.
    pub fn runs(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// The process, while it runs.
    pub fn process(&self) -> Option<u32> {
        self.child.process_id()
    }

    /// Sends a signal by name, such as `KILL`.
    pub fn signal(&mut self, name: &str) {
        if let Some(id) = self.child.process_id() {
            // It may have ended by itself in between.
            let _ = std::process::Command::new("kill")
                .args([&format!("-{name}"), &id.to_string()])
                .output();
        }
    }

    /// Memory of the process that is in RAM, KiB (Linux; 0 elsewhere).
    pub fn resident_kib(&self) -> u64 {
        let Some(id) = self.child.process_id() else {
            return 0;
        };
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
        let line = status.lines().find(|l| l.starts_with("VmRSS:"));
        line.and_then(|l| l.split_whitespace().nth(1)?.parse().ok())
            .unwrap_or(0)
    }

    /// Changes the size of the terminal.
    pub fn resize(&mut self, rows: u16, columns: u16) {
        self.master
            .resize(PtySize {
                rows,
                cols: columns,
                pixel_width: 0,
                pixel_height: 0,
            })
            .unwrap();
        let mut emulator = self.screen.lock().unwrap();
        let screen = emulator.parser.screen_mut();
        screen.set_size(cells(rows), cells(columns));
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs `study` without a terminal: exit code, standard output, standard error.
pub fn study(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_study"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    (
        output.status.code().unwrap_or(-1),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// A folder of the repository.
pub fn repository(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(path)
        .to_str()
        .unwrap()
        .to_owned()
}

/// Copies a folder with its contents.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// A change to a protocol: many attempts, since a busy machine may lose playbacks.
pub const PATIENT: (&str, &str) = (
    "order = \"blocked\"\n",
    "order = \"blocked\"\nmax_attempts = 50\n",
);

/// A copy of a protocol of the repository in `to`, each text replaced once.
pub fn changed_protocol(name: &str, to: &Path, changes: &[(&str, &str)]) {
    copy_folder(Path::new(&repository(&format!("protocols/{name}"))), to);
    let file = to.join("protocol.toml");
    let mut text = std::fs::read_to_string(&file).unwrap();
    for (old, new) in changes {
        assert!(text.contains(old), "the protocol has no `{old}` any more");
        text = text.replacen(old, new, 1);
    }
    std::fs::write(file, text).unwrap();
}

/// protocols/keyboard in `folder`, with every realization in a bundle: the address of each by id.
pub fn keyboard_of_bundles(folder: &Path) -> BTreeMap<String, String> {
    let script = std::fs::read_to_string(repository("protocols/keyboard/identify.sh")).unwrap();
    let switches = script.lines().filter_map(|line| {
        let mut words = line.strip_prefix("switch ")?.split(' ');
        Some((words.next()?.to_owned(), words.next()?.to_owned()))
    });
    let source = repository("protocols/keyboard/protocol.toml");
    let mut protocol = std::fs::read_to_string(source).unwrap();
    let mut addresses = BTreeMap::new();
    let run = |words: &str, last: &[&str]| {
        let words: Vec<&str> = words.split(' ').chain(last.iter().copied()).collect();
        let (code, out, told) = study(&words, folder);
        assert_eq!(code, 0, "{words:?}: {told}");
        out
    };
    for (id, curve) in switches {
        let curve = repository(&format!("tests/data/switches/{curve}.csv"));
        let (recording, file) = (format!("{id}.csv"), format!("models/{id}.toml"));
        let credit = ["--credit", "measured by ThereminGoat (theremingoat.com)"];
        run(
            "import force-curve",
            &[&curve, "-o", &recording, credit[0], credit[1]],
        );
        let model = repository(&format!("protocols/keyboard/{file}"));
        let stated = "stimulus pack --license CC-BY-4.0 --instrument tester --published 2024-05-17";
        let address = run(stated, &[&model, &recording]).trim().to_owned();
        let old = format!("file = \"{file}\"");
        assert!(protocol.contains(&old), "{old}");
        protocol = protocol.replace(&old, &format!("bundle = \"{address}\""));
        addresses.insert(id, address);
    }
    std::fs::write(folder.join("protocol.toml"), protocol).unwrap();
    assert_eq!(addresses.len(), 8);
    addresses
}
