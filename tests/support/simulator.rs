//! `study device simulate` as a child process.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A simulated device on a pseudo-terminal or at an address.
pub struct Simulator {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    /// A link to the port that stays valid when the device is reconnected, or the address with
    /// its token.
    pub port: PathBuf,
}

impl Simulator {
    /// Starts one with a long watchdog time, for a busy machine.
    pub fn start(folder: &Path, more: &[&str]) -> Self {
        let link = folder.join("port");
        let at_link = ["--link", link.to_str().unwrap()];
        let mut simulator = Self::of(&[&at_link, more].concat());
        assert!(
            simulator.port.exists(),
            "the first line is not a port: {:?}",
            simulator.port
        );
        simulator.port = link;
        simulator
    }

    /// Starts one that is reached over TCP.
    pub fn start_tcp(more: &[&str]) -> Self {
        let simulator = Self::of(&[&["--listen"], more].concat());
        assert!(simulator.port.to_str().unwrap().starts_with("tcp://"));
        simulator
    }

    fn of(arguments: &[&str]) -> Self {
        let mut child = Command::new(super::program())
            .args(["device", "simulate", "--watchdog", "200"])
            .args(arguments)
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
            port: PathBuf::new(),
        };
        simulator.port = simulator.line().into();
        simulator
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        line.trim().to_owned()
    }

    /// Sends a control command and waits until it is done.
    pub fn control(&mut self, what: &str) {
        self.ask(what);
    }

    /// Sends a control command; returns the line with which it answers.
    pub fn ask(&mut self, what: &str) -> String {
        writeln!(self.stdin, "{what}").unwrap();
        self.line()
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
