//! Commissioning: tests a device against the clauses of `docs/wire.md`.
//!
//! [`commission`] tests the device on a [`Connection`] with at most [`FORCE_N`] and gives
//! a verdict for each clause that can be tested from outside. The connection provides the
//! time, so the same test runs on a port and, in virtual time, on a simulated device.

mod bounds;
mod clauses;
mod elements;
pub(super) mod exchange;
mod mechanism;
mod moving;
mod playing;
mod strange;
mod trips;
mod uploads;

use super::link::LinkError;
pub(super) use bounds::{Bound, outside, servo_bounds};
use exchange::Exchange;
use std::fmt::Display;
use std::time::Duration;
use study_wire::frame::crc32;
use study_wire::message::Identity;
pub use trips::{ADAPTER_MS, REPLY_MS, RoundTrips, longest_ms, round_trips};

/// Largest force of the test, N.
pub const FORCE_N: f64 = 2.0;

/// A failed test of a clause in which this computer was late by more is repeated.
const LATE: Duration = Duration::from_millis(8);
/// How often.
const TRIES: u32 = 4;

/// A link to a device with a clock.
pub trait Connection {
    /// Monotonic time since an arbitrary origin.
    fn now(&mut self) -> Duration;

    /// Writes `bytes`, waits at most `wait` for bytes and returns those received.
    ///
    /// # Errors
    /// [`LinkError`] if the link has ended.
    fn exchange(&mut self, bytes: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError>;

    /// The time that a byte takes on the line; zero where that is not known.
    fn byte_time(&self) -> Duration {
        Duration::ZERO
    }
}

/// What a test tells while it runs.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// What somebody at the device has to do now.
    Ask(&'a str),
    /// The verdict about a clause.
    Judged(&'a Verdict),
}

/// Result of the test of one clause.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Verdict {
    /// Number of the clause in `docs/wire.md`, such as `6.3`.
    pub clause: &'static str,
    /// Requirement that was tested.
    pub what: &'static str,
    /// Whether the requirement is met.
    pub pass: bool,
    /// Observation.
    pub seen: String,
    /// Whether it was judged: not if this computer was late in every attempt, or nobody did
    /// what had to be done.
    pub judged: bool,
}

/// Result of a commissioning.
#[derive(Debug, Clone, PartialEq)]
pub struct Commissioning {
    /// Identification of the device; `None` if it sent none.
    pub device: Option<Identity>,
    /// Verdicts in the order of the tests.
    pub verdicts: Vec<Verdict>,
    /// Round-trip time: median, 99th percentile, maximum, ms.
    pub latency_ms: Option<[f64; 3]>,
}

impl Commissioning {
    /// Whether every requirement is met.
    pub fn passes(&self) -> bool {
        !self.verdicts.is_empty() && self.verdicts.iter().all(|v| v.pass)
    }

    /// One line for a session's records: device, verdict, latency.
    pub fn summary(&self) -> String {
        let passed = self.verdicts.iter().filter(|v| v.pass).count();
        let mut line = format!("{passed} of {} tests passed", self.verdicts.len());
        for (what, clauses) in [
            ("failed", self.failed_clauses()),
            ("not judged", self.unjudged_clauses()),
        ] {
            if !clauses.is_empty() {
                line.push_str(&format!(", {what}: {}", clauses.join(", ")));
            }
        }
        if let Some([median, p99, max]) = self.latency_ms {
            line.push_str(&format!(
                "; round trip {median:.2} ms, 99 % {p99:.2} ms, at most {max:.2} ms"
            ));
        }
        line
    }

    /// The clauses whose requirements are not met.
    pub fn failed_clauses(&self) -> Vec<&'static str> {
        let failed = self.verdicts.iter().filter(|v| !v.pass && v.judged);
        failed.map(|v| v.clause).collect()
    }

    /// The clauses that could not be judged.
    pub fn unjudged_clauses(&self) -> Vec<&'static str> {
        let unjudged = self.verdicts.iter().filter(|v| !v.judged);
        unjudged.map(|v| v.clause).collect()
    }
}

/// Why a test or a recording fails.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CheckFailure {
    /// The device does not do what is required.
    #[error("{0}")]
    Violation(String),
    /// The device no longer answers or is incompatible; no further test is possible.
    #[error("{0}")]
    Disconnected(String),
    /// Nothing can be said, because nobody did what had to be done.
    #[error("not judged: {0}")]
    NotJudged(String),
}

impl CheckFailure {
    pub(super) fn violation(what: impl Display) -> Self {
        Self::Violation(what.to_string())
    }
}

/// A violation with this observation.
pub(super) fn fail<T>(seen: impl Display) -> Result<T, CheckFailure> {
    Err(CheckFailure::violation(seen))
}

/// The observation if the requirement is met.
type ClauseResult = Result<String, CheckFailure>;

/// A requirement of the specification and its test.
struct Clause {
    clause: &'static str,
    what: &'static str,
    test: fn(&mut Exchange<'_>) -> ClauseResult,
    /// What somebody has to do for it; empty if nothing.
    ask: &'static str,
}

/// Tests a device. `report` receives each verdict at once, and what somebody has to do; `nonce`
/// has to differ between runs.
pub fn commission(
    connection: &mut dyn Connection,
    nonce: u32,
    report: &mut dyn FnMut(Progress<'_>),
) -> Commissioning {
    let mut exchange = Exchange::new(connection, nonce);
    let mut verdicts = Vec::new();
    for Clause {
        clause,
        what,
        test,
        ask,
    } in clauses::ALL
    {
        let mut tries = 0;
        if !ask.is_empty() {
            report(Progress::Ask(ask));
        }
        let (result, late) = loop {
            exchange.late = Duration::ZERO;
            tries += 1;
            // Each test begins with an idle device that receives heartbeats.
            let reset = match verdicts.is_empty() && tries == 1 {
                true => Ok(()),
                false => exchange.reset(),
            };
            let result = reset.and_then(|()| test(&mut exchange));
            // A failure says nothing of the device while this computer was late.
            let late = Some(exchange.late).filter(|late| *late > LATE && result.is_err());
            if late.is_none() || tries == TRIES {
                break (result, late);
            }
        };
        let disconnected = matches!(result, Err(CheckFailure::Disconnected(_)));
        let undone = matches!(result, Err(CheckFailure::NotJudged(_)));
        let pass = result.is_ok();
        let seen = result.unwrap_or_else(|failure| failure.to_string());
        let seen = match late {
            Some(late) => format!(
                "not judged (this computer was late by {} ms): {seen}",
                late.as_millis()
            ),
            None => seen,
        };
        let verdict = Verdict {
            clause,
            what,
            pass,
            seen,
            judged: late.is_none() && !undone,
        };
        report(Progress::Judged(&verdict));
        verdicts.push(verdict);
        if disconnected || exchange.device.is_none() {
            break;
        }
    }
    // Also after a failure; the verdicts report it.
    let _ = exchange.limp();
    Commissioning {
        device: exchange.device,
        verdicts,
        latency_ms: exchange.latency_ms,
    }
}

/// Identifies a device: LIMP, then HELLO.
///
/// # Errors
/// [`CheckFailure`] if there is no answer, an incorrect one, or another version.
pub fn identify(connection: &mut dyn Connection, nonce: u32) -> Result<Identity, CheckFailure> {
    Exchange::new(connection, nonce).identify()
}

/// Quantile of sorted values by the nearest rank, `fraction` between 0 and 1; `None`
/// without values.
///
/// ```
/// # use study_device::check::quantile;
/// assert_eq!(quantile(&[1.0, 2.0, 3.0, 10.0], 0.5), Some(2.0));
/// ```
pub fn quantile(sorted: &[f64], fraction: f64) -> Option<f64> {
    let rank = (fraction * sorted.len() as f64).ceil() as usize;
    let last = sorted.len().checked_sub(1)?;
    sorted.get(rank.saturating_sub(1).min(last)).copied()
}

/// A number that depends on the clause.
fn tag(clause: &str) -> u32 {
    crc32(clause.as_bytes()) | 1
}
