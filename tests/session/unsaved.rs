//! The real binary on a disk that fails in the middle of a session: nothing can be
//! written to the journal, and no new segment can be made.
//!
//! The limit of the file size makes each write to the journal fail, and a file in place
//! of the participant's folder each new segment. Both also stop a superuser.

#![cfg(target_os = "linux")]

use crate::support::player::{F10, enter, play_to_end, play_until};
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use std::fs;
use std::path::{Path, PathBuf};

struct Desk {
    folder: tempfile::TempDir,
    terminal: Terminal,
}

impl Desk {
    /// A session at its first rating.
    fn at_a_rating() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let protocol = folder.path().join("protocol");
        let once = ("repetitions = 3", "repetitions = 1");
        changed_protocol("turn-signal", &protocol, &[PATIENT, once]);
        fs::create_dir(folder.path().join("home")).unwrap();
        let mut desk = Self {
            terminal: start(folder.path()),
            folder,
        };
        play_until(&mut desk.terminal, "P01", "1–7: choose");
        // The end of the playback is on the disk, too.
        desk.terminal
            .wait_until("the playback to be saved", |s| !s.contains("saving …"));
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// From now on the journal cannot grow, and no file can be made beside it.
    fn fail(&self) {
        self.limit(Some(2048));
        let (folder, aside) = (self.participant(), self.path("aside"));
        fs::rename(&folder, aside).unwrap();
        fs::write(folder, "").unwrap();
    }

    /// Limits the size of the files that the program writes, bytes.
    fn limit(&self, bytes: Option<u64>) {
        let own = rustix::process::getrlimit(Resource::Fsize);
        let limit = Rlimit {
            current: bytes.or(own.current),
            ..own
        };
        let pid = self
            .terminal
            .process()
            .and_then(|id| i32::try_from(id).ok());
        if let Some(pid) = pid.and_then(Pid::from_raw) {
            // It may have ended.
            let _ = prlimit(Some(pid), Resource::Fsize, limit);
        }
    }

    /// The disk is repaired.
    fn repair(&self) {
        self.limit(None);
        fs::remove_file(self.participant()).unwrap();
        fs::rename(self.path("aside"), self.participant()).unwrap();
    }

    fn participant(&self) -> PathBuf {
        self.path("results/turn-signal/sessions/P01")
    }

    fn rate(&mut self, keys: &str) {
        self.terminal.keys(keys);
        self.terminal.wait_for("late");
        enter(&mut self.terminal);
        self.terminal.wait_for("NOT SAVED");
        let screen = self.terminal.screen();
        assert!(screen.contains("trial 1: realism = 6"), "{screen}");
    }

    /// The end: exit code 4, no word of safety, and everything named and kept.
    fn ended(&mut self) -> String {
        assert_eq!(self.terminal.exit_code(), 4, "{}", self.terminal.screen());
        assert!(!self.terminal.alternate());
        let said = self.terminal.screen().replace('\n', "");
        for word in ["safe", "✓", "kept", "are saved", "is saved"] {
            assert!(!said.contains(word), "{word}: {said}");
        }
        for words in [
            "NOT SAVED",
            "trial 1: realism = 6",
            "trial 1: comment = late",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
        let kept: Vec<PathBuf> = fs::read_dir(self.path("home"))
            .unwrap()
            .map(|f| f.unwrap().path())
            .collect();
        let [kept] = &kept[..] else {
            panic!("not one file: {kept:?}");
        };
        let name = kept.file_name().unwrap().to_str().unwrap();
        assert!(name.starts_with("study-unsaved-turn-signal-P01-"), "{name}");
        assert!(said.contains(name), "{said}");
        let text = fs::read_to_string(kept).unwrap();
        let answered = r#""question":"realism","answer":{"rating":6}"#;
        assert!(text.contains(answered), "{text}");
        text
    }

    /// After a repair the session goes on with the same trial, and nothing is damaged.
    fn resumed(mut self) {
        self.repair();
        self.terminal = start(self.folder.path());
        play_to_end(&mut self.terminal, "P01");
        let (code, out, err) = study(&["verify", "results"], self.folder.path());
        assert_eq!(code, 0, "{out}{err}");
        let ratings = fs::read_to_string(self.path("results/turn-signal/ratings.csv")).unwrap();
        assert_eq!(ratings.lines().count(), 6, "{ratings}");
    }
}

fn start(folder: &Path) -> Terminal {
    let home = folder.join("home");
    let variables = [("HOME", home.as_path())];
    let arguments = ["run", "protocol", "--operator", "lw"];
    let mut terminal = Terminal::start_with(&arguments, folder, 24, 80, &variables);
    terminal.wait_for("Who takes part?");
    terminal
}

#[test]
fn quitting_names_what_is_not_saved_and_writes_it_elsewhere() {
    let mut desk = Desk::at_a_rating();
    desk.fail();
    desk.rate("6\tlate");
    // A second attempt, in a new segment, fails as well.
    desk.terminal.wait_for("Enter: try again");
    desk.terminal.keys("\r");
    desk.terminal.wait_for("journal-2");
    desk.terminal.keys(F10);
    desk.terminal.wait_for("This is in memory only");
    let screen = desk.terminal.screen();
    for words in ["trial 1: realism = 6", "trial 1: comment = late", "a file"] {
        assert!(screen.contains(words), "{screen}");
    }
    for word in ["kept", "safe"] {
        assert!(!screen.contains(word), "{screen}");
    }
    desk.terminal.keys("n");
    desk.terminal
        .wait_until("the page below", |s| !s.contains("This is in memory only"));
    desk.terminal.keys(F10);
    desk.terminal.wait_for("This is in memory only");
    desk.terminal.keys("y");
    desk.ended();
    desk.resumed();
}

#[test]
fn signals_name_what_is_not_saved_and_write_it_elsewhere() {
    for signal in ["TERM", "HUP"] {
        let mut desk = Desk::at_a_rating();
        desk.fail();
        desk.rate("6\tlate");
        desk.terminal.signal(signal);
        let text = desk.ended();
        assert!(text.contains(&format!("SIG{signal}")), "{text}");
        desk.resumed();
    }
}

/// A disk that was repaired before the session is left costs nothing.
#[test]
fn a_repaired_disk_gets_everything() {
    let mut desk = Desk::at_a_rating();
    desk.fail();
    desk.rate("6\tlate");
    desk.repair();
    desk.terminal.wait_for("Enter: try again");
    desk.terminal.keys("\r");
    desk.terminal.wait_for("saved ✓ 1 of 1");
    play_to_end(&mut desk.terminal, "P01");
    let ratings = fs::read_to_string(desk.path("results/turn-signal/ratings.csv")).unwrap();
    assert!(ratings.contains(",6,late,"), "{ratings}");
    assert_eq!(fs::read_dir(desk.path("home")).unwrap().count(), 0);
}
