//! What a computer, the disk of its results, its terminal and a device are fit for.
//!
//! [`judge`] takes numbers, [`Measured`], and returns findings in sentences and a verdict for each
//! [`Use`]. It measures nothing itself, so that it can be tested without a machine that is slow,
//! full or badly connected; `cli` has what measures. docs/doctor.md says what is measured, and
//! where the limits come from.

mod device;
mod disk;
mod finding;
mod surroundings;
mod timing;

pub use finding::{About, Finding, Fit, Use, Verdict};

use serde::{Serialize, Serializer};
use study_device::check::quantile;
use study_device::link::Priority;
use study_session::store::Broken;

/// Times of something that was done `n` times, ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Half of them were shorter.
    pub median_ms: f64,
    /// 99 % of them were shorter.
    pub p99_ms: f64,
    /// The longest one.
    pub largest_ms: f64,
    /// How many there were.
    pub n: usize,
}

impl Spread {
    /// Of times in ms, by the nearest rank; `None` without times.
    pub fn of(mut times_ms: Vec<f64>) -> Option<Self> {
        times_ms.sort_by(f64::total_cmp);
        Some(Self {
            median_ms: quantile(&times_ms, 0.5)?,
            p99_ms: quantile(&times_ms, 0.99)?,
            largest_ms: *times_ms.last()?,
            n: times_ms.len(),
        })
    }
}

/// Everything that was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The computer.
    pub machine: Machine,
    /// How late its threads are.
    pub timing: Timing,
    /// The disk of the results.
    pub disk: Disk,
    /// The terminal.
    pub terminal: Terminal,
    /// The participant's page.
    pub page: Page,
    /// The device, if one was named.
    pub device: Option<Device>,
}

/// A computer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// Operating system and processor, such as `linux x86_64`.
    pub system: String,
    /// Number of processors that the program may use.
    pub processors: usize,
    /// How many of them were busy before the measurement; `None` where the system does not tell.
    pub busy: Option<f64>,
    /// Smallest step of the clock that was seen, ns.
    pub clock_step_ns: Option<f64>,
}

/// How late the threads of a session are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timing {
    /// What the thread that sends heartbeats was given.
    #[serde(serialize_with = "priority")]
    pub priority: Priority,
    /// The largest real-time priority that the system permits this user; `None` where it does
    /// not tell.
    pub permitted: Option<u64>,
    /// While nothing else was done.
    pub quiet: Option<Lateness>,
    /// While records were saved as fast as the disk permits.
    pub saving: Option<Lateness>,
}

fn priority<S: Serializer>(priority: &Priority, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(match priority {
        Priority::RealTime => "real-time",
        Priority::Raised => "raised",
        Priority::Usual => "usual",
    })
}

/// By how much threads came later than they wanted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lateness {
    /// Turns of 1 ms of the thread that serves the link.
    pub turn: Spread,
    /// Heartbeats of the same thread, every 10 ms.
    pub heartbeat: Spread,
    /// Turns of 10 ms of a thread with the priority of the screen.
    pub screen: Spread,
}

/// The disk of a results folder.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Disk {
    /// The folder in which it was tried.
    pub folder: String,
    /// What the system says of its file system.
    pub file_system: Option<FileSystem>,
    /// Space that can still be used, bytes.
    pub free_bytes: Option<u64>,
    /// Why the folder cannot be used.
    pub failure: Option<String>,
    /// A call that had not ended after this time, s.
    pub hung_s: Option<f64>,
    /// Appending a record to a journal, with its sync.
    pub journal: Option<Spread>,
    /// Replacing `head.json`.
    pub head: Option<Spread>,
    /// Both: how long a page waits for "saved".
    pub record: Option<Spread>,
    /// What the file system does not do.
    #[serde(serialize_with = "broken")]
    pub broken: Vec<Broken>,
    /// What could not be removed again.
    pub left: Option<String>,
}

fn broken<S: Serializer>(broken: &[Broken], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(broken.iter().map(|broken| broken.as_str()))
}

/// A file system.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct FileSystem {
    /// Its name, such as `ext4` or `NTFS`.
    pub name: String,
    /// How it is mounted.
    pub options: Vec<String>,
    /// Whether the system says that it is on another computer.
    pub remote: bool,
    /// Whether the system says that it is in memory.
    pub in_memory: bool,
}

/// A terminal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Terminal {
    /// Whether standard input is one.
    pub input: bool,
    /// Whether standard output is one.
    pub output: bool,
    /// Columns and rows, if it tells.
    pub size: Option<[u16; 2]>,
    /// Columns and rows that a page needs.
    pub least: [u16; 2],
    /// Whether it can position text.
    pub positions: bool,
    /// Whether the environment says that it shows UTF-8; `None` where every terminal does.
    pub utf8: Option<bool>,
    /// Number of colors: 256, 16 or 0.
    pub colors: u16,
    /// Whether `NO_COLOR` is set.
    pub no_color: bool,
    /// Whether the environment asks for lines.
    pub plain: bool,
}

/// The participant's page.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Page {
    /// Address of this computer in a network.
    pub address: Option<String>,
    /// Why the page cannot be served there, or on this computer.
    pub failure: Option<String>,
}

/// How a device is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Connected {
    /// By a serial port or an address over TCP.
    Port,
    /// As a program.
    Program,
}

/// A device.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Device {
    /// How it is connected.
    pub connected: Connected,
    /// Port, address or command.
    pub address: String,
    /// Why nothing was measured.
    pub failure: Option<String>,
    /// Its name for itself.
    pub id: Option<String>,
    /// Version of its firmware or program.
    pub firmware: Option<String>,
    /// Whether it says that it is simulated.
    pub simulated: bool,
    /// Bits per second of a serial port.
    pub baud: Option<u32>,
    /// Its watchdog time, ms.
    pub watchdog_ms: Option<f64>,
    /// From the start of a program to its `hello`, ms.
    pub hello_ms: Option<f64>,
    /// Round trips.
    pub trips: Option<Spread>,
    /// What the bytes of a round trip take on the line, ms.
    pub line_ms: f64,
    /// Latency timer of the adapter, ms, if the system tells.
    pub adapter_ms: Option<f64>,
}

impl Device {
    /// A device that could not be measured.
    pub fn failed(connected: Connected, address: String, failure: String) -> Self {
        Self {
            connected,
            address,
            failure: Some(failure),
            id: None,
            firmware: None,
            simulated: false,
            baud: None,
            watchdog_ms: None,
            hello_ms: None,
            trips: None,
            line_ms: 0.0,
            adapter_ms: None,
        }
    }

    /// The use that it is for.
    fn purpose(&self) -> Use {
        match self.connected {
            Connected::Port => Use::Serial,
            Connected::Program => Use::Hand,
        }
    }
}

/// What the numbers mean.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judgement {
    /// What was found, in the order of the table.
    pub findings: Vec<Finding>,
    /// A verdict for each use.
    pub verdicts: Vec<Verdict>,
}

impl Judgement {
    /// The verdict for a use.
    pub fn of(&self, purpose: Use) -> Fit {
        let verdict = self.verdicts.iter().find(|v| v.purpose == purpose);
        verdict.map_or(Fit::NotMeasured, |verdict| verdict.fit)
    }

    /// The findings about something that make it unfit for a use.
    pub fn against(&self, about: Option<About>, purpose: Use) -> Vec<&Finding> {
        let all = self.findings.iter();
        all.filter(|finding| {
            finding.fit == Fit::NotFit
                && finding.uses.contains(&purpose)
                && about.is_none_or(|about| finding.about == about)
        })
        .collect()
    }
}

/// Judges what was measured.
pub fn judge(measured: &Measured) -> Judgement {
    let mut findings = timing::judge(measured);
    findings.extend(disk::judge(&measured.disk));
    findings.extend(surroundings::terminal(&measured.terminal));
    findings.push(surroundings::page(&measured.page));
    findings.extend(measured.device.iter().flat_map(device::judge));
    let verdicts = Use::ALL
        .into_iter()
        .map(|purpose| Verdict::of(purpose, &findings))
        .collect();
    Judgement { findings, verdicts }
}

#[cfg(test)]
mod tests;
