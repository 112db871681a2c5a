//! The terminal is restored on every way out. The interface runs in a child process on
//! a pseudo-terminal: this test program again, with one ignored test.

// A helper that unwraps is an assertion here.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use rustix::process::{Pid, Signal, kill_process};
use rustix::termios::{LocalModes, tcgetattr};
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use study::runner::Operator as _;
use study::tui::{ColorDepth, Options, Tui};
use study_session::session::{Input, Screen};

/// So long that only a program that hangs exceeds it.
const PATIENCE: Duration = Duration::from_secs(120);

#[test]
#[ignore = "runs only as a child of the other tests"]
fn child_operates_a_terminal() {
    let Ok(report) = std::env::var("TUI_CHILD") else {
        return;
    };
    let fails = std::env::var("TUI_CHILD_PANICS").is_ok();
    let aborts = std::env::var("TUI_CHILD_ABORTS").is_ok();
    let options = Options {
        mouse: true,
        live: true,
        color: ColorDepth::Full,
        hurry: 1,
    };
    let end = match Tui::open(options) {
        Err(error) => format!("refused: {error}; {}", error.hint()),
        Ok(mut tui) => {
            let view = crate::views::view(if std::env::var("TUI_CHILD_RATES").is_ok() {
                crate::views::form(vec![crate::views::realism(), crate::views::comment()])
            } else {
                Screen::Playing {
                    since_s: 1.0,
                    keep_exploring: false,
                    exposure: Default::default(),
                    interval: None,
                }
            });
            if fails {
                std::thread::spawn(|| panic!("planted"));
            }
            loop {
                match tui.next(&view, Duration::from_millis(100)) {
                    // Not in a thread of its own: the page must be complete.
                    Ok(_) if aborts => std::process::abort(),
                    Ok(inputs) => match &inputs[..] {
                        [Input::Quit] => break "quit".to_owned(),
                        [Input::Answer(answers)] => break format!("{answers:?}"),
                        [Input::Abort(why)] => break format!("abort: {why}"),
                        _ => {}
                    },
                    Err(error) => break format!("gone: {error}"),
                }
            }
        }
    };
    // Renamed when complete, so that the parent never reads half of it.
    let written = report.clone() + ".part";
    std::fs::write(&written, end).unwrap();
    std::fs::rename(written, report).unwrap();
    if std::env::var("TUI_CHILD_LINGERS").is_ok() {
        std::thread::sleep(PATIENCE * 2);
    }
}

fn cells(n: u16) -> NonZeroU16 {
    NonZeroU16::new(n).unwrap_or(NonZeroU16::MIN)
}

struct Desk {
    master: Option<Box<dyn MasterPty + Send>>,
    writer: Option<Box<dyn Write + Send>>,
    child: Box<dyn Child + Send + Sync>,
    output: Receiver<Vec<u8>>,
    screen: vt100::Parser,
    seen: String,
    report: PathBuf,
    _folder: tempfile::TempDir,
}

impl Desk {
    /// Starts the child, or a shell script in which `RUN` stands for it.
    fn start(shell: Option<&str>, vars: &[(&str, &str)]) -> Self {
        let size = PtySize {
            rows: 24,
            cols: 80,
            pixel_width: 0,
            pixel_height: 0,
        };
        let pty = native_pty_system().openpty(size).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().join("report");
        let program = std::env::current_exe().unwrap();
        let arguments = "tui_terminal::child_operates_a_terminal --exact --ignored --nocapture";
        let mut command = if let Some(script) = shell {
            let run = format!("{} {arguments}", program.display());
            let mut command = CommandBuilder::new("sh");
            command.args(["-c", &script.replace("RUN", &run)]);
            command
        } else {
            let mut command = CommandBuilder::new(program);
            command.args(arguments.split(' '));
            command
        };
        command.env("TERM", "xterm-256color");
        command.env("TUI_CHILD", &report);
        command.cwd(folder.path());
        for (name, value) in vars {
            command.env(name, value);
        }
        let child = pty.slave.spawn_command(command).unwrap();
        drop(pty.slave);
        let mut reader = pty.master.try_clone_reader().unwrap();
        let (send, output) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n) = reader.read(&mut bytes) {
                if n == 0 || send.send(bytes[..n].to_vec()).is_err() {
                    break;
                }
            }
        });
        Self {
            writer: Some(pty.master.take_writer().unwrap()),
            master: Some(pty.master),
            child,
            output,
            screen: vt100::Parser::new(cells(24), cells(80), 0),
            seen: String::new(),
            report,
            _folder: folder,
        }
    }

    fn listen(&mut self) {
        let slice = Duration::from_millis(20);
        loop {
            match self.output.recv_timeout(slice) {
                Ok(bytes) => {
                    self.screen.process(&bytes);
                    self.seen.push_str(&String::from_utf8_lossy(&bytes));
                }
                Err(RecvTimeoutError::Timeout) => return,
                Err(RecvTimeoutError::Disconnected) => return std::thread::sleep(slice),
            }
        }
    }

    /// Waits until a condition holds.
    fn until(&mut self, what: &str, so: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        loop {
            self.listen();
            if so(self) {
                return;
            }
            let screen = self.screen.screen().contents();
            assert!(start.elapsed() < PATIENCE, "never {what}:\n{screen}");
        }
    }

    fn shows(&mut self, text: &str) {
        self.until(text, |desk| desk.screen.screen().contents().contains(text));
    }

    fn types(&mut self, keys: &str) {
        let writer = self.writer.as_mut().unwrap();
        writer.write_all(keys.as_bytes()).unwrap();
        writer.flush().unwrap();
    }

    fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.child.process_id().unwrap()).unwrap();
        kill_process(Pid::from_raw(pid).unwrap(), signal).unwrap();
    }

    fn report(&mut self) -> String {
        self.until("ended", |desk| desk.report.exists());
        std::fs::read_to_string(&self.report).unwrap()
    }

    /// Waits for the end of the child.
    fn ends(&mut self) {
        let start = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < PATIENCE, "the signal was swallowed");
            self.listen();
        }
    }

    fn is_restored(&mut self) {
        self.until("restored", |desk| {
            let screen = desk.screen.screen();
            !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste()
        });
        let screen = self.screen.screen();
        assert_eq!(screen.mouse_protocol_mode(), vt100::MouseProtocolMode::None);
        let name = self.master.as_ref().unwrap().tty_name().unwrap();
        if let Ok(tty) = std::fs::File::open(name) {
            let modes = tcgetattr(&tty).unwrap().local_modes;
            assert!(modes.contains(LocalModes::ICANON | LocalModes::ECHO));
        }
    }
}

#[test]
fn quitting_restores_the_terminal() {
    let mut desk = Desk::start(None, &[]);
    desk.shows("Feel the device.");
    assert!(desk.screen.screen().alternate_screen());
    desk.types("\u{11}");
    desk.shows("Are you sure?");
    desk.types("y");
    assert_eq!(desk.report(), "quit");
    desk.is_restored();
}

#[test]
fn signals_end_the_session_in_order() {
    for (signal, name) in [
        (Signal::TERM, "SIGTERM"),
        (Signal::HUP, "SIGHUP"),
        (Signal::INT, "SIGINT"),
        (Signal::QUIT, "SIGQUIT"),
        (Signal::USR1, "SIGUSR1"),
        (Signal::USR2, "SIGUSR2"),
        (Signal::ALARM, "SIGALRM"),
        (Signal::VTALARM, "SIGVTALRM"),
        (Signal::PROF, "SIGPROF"),
    ] {
        let mut desk = Desk::start(None, &[]);
        desk.shows("Feel the device.");
        desk.signal(signal);
        assert_eq!(desk.report(), format!("abort: the program received {name}"));
        desk.is_restored();
    }
}

/// There is no time to end the session in order, but the terminal is given back.
#[test]
fn a_failure_restores_the_terminal_and_ends_the_program() {
    for (signal, variables) in [
        (Some(Signal::ABORT), &[][..]),
        (Some(Signal::BUS), &[]),
        (Some(Signal::FPE), &[]),
        (Some(Signal::ILL), &[]),
        (Some(Signal::TRAP), &[]),
        (Some(Signal::SYS), &[]),
        (Some(Signal::XCPU), &[]),
        (None, &[("TUI_CHILD_ABORTS", "1")]),
    ] {
        let mut desk = Desk::start(None, variables);
        desk.until("on the alternate screen", |desk| {
            desk.seen.contains("\u{1b}[?1049h")
        });
        if let Some(signal) = signal {
            desk.shows("Feel the device.");
            desk.signal(signal);
        }
        desk.ends();
        desk.is_restored();
        assert!(!desk.report.exists(), "{signal:?}: it ended in order");
    }
}

#[test]
fn after_the_session_a_signal_has_its_default_effect() {
    let mut desk = Desk::start(None, &[("TUI_CHILD_LINGERS", "1")]);
    desk.shows("Feel the device.");
    desk.types("\u{11}y");
    assert_eq!(desk.report(), "quit");
    desk.is_restored();
    desk.signal(Signal::TERM);
    desk.ends();
}

#[test]
fn a_panic_in_any_thread_restores_the_terminal_and_ends_the_session() {
    let mut desk = Desk::start(None, &[("TUI_CHILD_PANICS", "1")]);
    assert!(
        desk.report()
            .starts_with("gone: a part of the program failed")
    );
    desk.is_restored();
    assert!(desk.seen.contains("planted"));
}

#[test]
fn a_closed_terminal_ends_the_session_without_a_signal() {
    // A child in a session of its own receives no SIGHUP.
    let mut desk = Desk::start(Some("setsid -w RUN"), &[]);
    desk.shows("Feel the device.");
    // The reading thread closes the terminal when the receiver is gone.
    desk.output = channel().1;
    desk.types("?");
    desk.writer = None;
    desk.master = None;
    let report = desk.report();
    assert!(report.starts_with("gone: the terminal "), "{report}");
}

#[test]
fn ctrl_z_restores_the_terminal_and_fg_resumes_the_session() {
    let mut desk = Desk::start(Some("set -m; RUN; echo IN-THE-SHELL; fg"), &[]);
    desk.shows("Feel the device.");
    desk.types("\u{1a}");
    desk.until("in the shell", |desk| desk.seen.contains("IN-THE-SHELL"));
    let (before, _) = desk.seen.split_once("IN-THE-SHELL").unwrap();
    assert!(before.contains("\u{1b}[?1049l"), "not restored first");
    desk.until("back", |desk| desk.screen.screen().alternate_screen());
    desk.shows("Feel the device.");
    desk.types("\u{11}");
    desk.shows("Are you sure?");
    desk.types("y");
    assert_eq!(desk.report(), "quit");
    desk.is_restored();
}

#[test]
fn a_dumb_terminal_is_refused_with_a_hint() {
    let mut desk = Desk::start(None, &[("TERM", "dumb")]);
    let report = desk.report();
    assert!(
        report.starts_with("refused: the terminal (TERM=\"dumb\")"),
        "{report}"
    );
    assert!(report.contains("study rehearse"));
}

#[test]
fn without_a_terminal_it_is_refused() {
    // Under the test harness input is no terminal, or the test would hang here.
    if std::io::IsTerminal::is_terminal(&std::io::stdin()) {
        return;
    }
    let options = Options {
        mouse: false,
        live: false,
        color: ColorDepth::None,
        hurry: 1,
    };
    let error = Tui::open(options).err().unwrap();
    assert!(error.to_string().contains("needs a terminal"));
}

#[test]
fn typed_and_pasted_text_of_any_language_arrives_whole() {
    let mut desk = Desk::start(None, &[("TUI_CHILD_RATES", "1")]);
    desk.shows("How realistic did it feel?");
    desk.shows("│  5  │");
    // A click on the box of 5, then the comment.
    let screen = desk.screen.screen().contents();
    let row = screen
        .lines()
        .position(|line| line.contains("│  5  │"))
        .unwrap();
    let line = screen.lines().nth(row).unwrap();
    let column = line[..line.find("│  5  │").unwrap()].chars().count();
    desk.types(&format!("\u{1b}[<0;{};{}M", column + 3, row + 1));
    desk.shows("┃  5  ┃");
    desk.types("\t日本 é 👍🏽 ");
    desk.types("\u{1b}[200~שלום\r=1+1\u{1b}[201~");
    desk.shows("=1+1");
    desk.shows("日本");
    desk.types("\r");
    let report = desk.report();
    assert!(report.contains("Rating(5)"), "{report}");
    let text = format!("{:?}", "日本 é 👍🏽 שלום\n=1+1");
    assert!(report.contains(&text), "{report}");
    desk.is_restored();
}

#[test]
fn a_size_change_is_followed() {
    let mut desk = Desk::start(None, &[]);
    desk.shows("Feel the device.");
    let resize = |desk: &mut Desk, rows: u16, cols: u16| {
        desk.screen.screen_mut().set_size(cells(rows), cells(cols));
        let size = PtySize {
            rows,
            cols,
            pixel_width: 0,
            pixel_height: 0,
        };
        desk.master.as_ref().unwrap().resize(size).unwrap();
    };
    resize(&mut desk, 20, 60);
    desk.shows("This window has 60 × 20 cells; 80 × 24 are needed.");
    resize(&mut desk, 0, 0);
    resize(&mut desk, 24, 80);
    desk.shows("Feel the device.");
    desk.types("\u{11}y");
    assert_eq!(desk.report(), "quit");
}
