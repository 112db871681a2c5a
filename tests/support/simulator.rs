//! `study device simulate` as a child process.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A simulated device on a pseudo-terminal.
pub struct Simulator {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    /// A link to the port that stays valid when the device is reconnected.
    pub port: PathBuf,
}

impl Simulator {
    /// Starts one with a long watchdog time, for a busy machine.
    pub fn start(folder: &Path, more: &[&str]) -> Self {
        let port = folder.join("port");
        let mut child = Command::new(env!("CARGO_BIN_EXE_study"))
            .args(["device", "simulate", "--watchdog", "200", "--link"])
            .arg(&port)
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let stdin = child.stdin.take().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let mut simulator = Self {
            child,
            stdin,
            stdout,
            port,
        };
        let path = simulator.line();
        assert!(
            Path::new(&path).exists(),
            "the first line is not a port: {path}"
        );
        simulator
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        line.trim().to_owned()
    }

    /// Sends a control command and waits until it is done.
    pub fn control(&mut self, what: &str) {
        writeln!(self.stdin, "{what}").unwrap();
        self.line();
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
