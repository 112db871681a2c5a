//! Commissioning: whether a device keeps `docs/wire.md`, clause by clause.
//!
//! [`commission`] talks to whatever is at the end of a [`Wire`], never with more than
//! [`FORCE_N`], and gives a verdict for each clause that can be seen from outside.
//! Time comes from the wire, so the same check runs over a port and, in tests, in
//! virtual time on a simulated device with a planted defect.

mod clauses;
mod playing;
pub(super) mod talk;
mod uploads;

use super::link::LinkError;
use std::time::Duration;
use study_wire::frame::crc32;
use study_wire::message::Identity;
use talk::Talk;

/// Largest force that is asked for, N.
pub const FORCE_N: f64 = 2.0;

/// Bytes to a device and back, with a clock.
pub trait Wire {
    /// Since some origin; never goes back.
    fn now(&mut self) -> Duration;

    /// Writes `bytes`, then waits at most `wait` for some; what came.
    ///
    /// # Errors
    /// [`LinkError`]: the link has ended.
    fn exchange(&mut self, bytes: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError>;
}

/// What one clause came to.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Verdict {
    /// Of `docs/wire.md`, such as `6.3`.
    pub clause: &'static str,
    /// What was looked at.
    pub what: &'static str,
    /// Whether it is kept.
    pub pass: bool,
    /// What was seen.
    pub seen: String,
}

/// A device's commissioning.
#[derive(Debug, Clone, PartialEq)]
pub struct Commissioning {
    /// Who it is; `None` if it never said so.
    pub device: Option<Identity>,
    /// In the order in which it was looked at.
    pub verdicts: Vec<Verdict>,
    /// Round trips of a heartbeat: median, 99th percentile, largest, ms.
    pub latency_ms: Option<[f64; 3]>,
}

impl Commissioning {
    /// Whether every clause is kept.
    pub fn passes(&self) -> bool {
        !self.verdicts.is_empty() && self.verdicts.iter().all(|v| v.pass)
    }

    /// One line for a session's records: device, verdict, latency.
    pub fn summary(&self) -> String {
        let kept = self.verdicts.iter().filter(|v| v.pass).count();
        let mut line = format!("{kept} of {} clauses kept", self.verdicts.len());
        let broken: Vec<&str> = self
            .verdicts
            .iter()
            .filter(|v| !v.pass)
            .map(|v| v.clause)
            .collect();
        if !broken.is_empty() {
            line.push_str(&format!(", broken: {}", broken.join(", ")));
        }
        if let Some([median, p99, most]) = self.latency_ms {
            line.push_str(&format!(
                "; round trip {median:.2} ms, 99 % {p99:.2} ms, at most {most:.2} ms"
            ));
        }
        line
    }
}

/// Why a clause is broken.
#[derive(Debug)]
pub(super) enum Broken {
    /// In words.
    Seen(String),
    /// Nothing more can be asked.
    Gone(String),
}

impl Broken {
    pub(super) fn seen(what: impl Into<String>) -> Self {
        Self::Seen(what.into())
    }
}

/// What was seen of a clause that is kept.
type Kept = Result<String, Broken>;

struct Clause {
    clause: &'static str,
    what: &'static str,
    look: fn(&mut Talk<'_>) -> Kept,
}

/// Looks at a device. `tell` hears each verdict as it comes; `nonce` is another one
/// for each run.
pub fn commission(
    wire: &mut dyn Wire,
    nonce: u32,
    tell: &mut dyn FnMut(&Verdict),
) -> Commissioning {
    let mut talk = Talk::new(wire, nonce);
    let mut verdicts = Vec::new();
    for Clause { clause, what, look } in clauses::ALL {
        // each begins with a device that is limp, idle and heard
        let ready = match verdicts.is_empty() {
            true => Ok(()),
            false => talk.ready(),
        };
        let kept = ready.and_then(|()| look(&mut talk));
        let (pass, seen, gone) = match kept {
            Ok(seen) => (true, seen, false),
            Err(Broken::Seen(seen)) => (false, seen, false),
            Err(Broken::Gone(seen)) => (false, seen, true),
        };
        let verdict = Verdict {
            clause,
            what,
            pass,
            seen,
        };
        tell(&verdict);
        verdicts.push(verdict);
        // what nobody answers cannot be asked
        if gone || talk.device.is_none() {
            break;
        }
    }
    // whatever came of it
    let _ = talk.limp();
    Commissioning {
        device: talk.device,
        verdicts,
        latency_ms: talk.latency_ms,
    }
}

/// Who is at the end of a wire: zero force, then HELLO.
///
/// # Errors
/// In words: nobody, somebody else, another version.
pub fn greet(wire: &mut dyn Wire, nonce: u32) -> Result<Identity, String> {
    let mut talk = Talk::new(wire, nonce);
    match clauses::introduce(&mut talk) {
        Ok(device) => Ok(device),
        Err(Broken::Seen(why) | Broken::Gone(why)) => Err(why),
    }
}

/// Percentile of sorted values, by the nearest rank.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    let place = rank.saturating_sub(1).min(sorted.len().saturating_sub(1));
    sorted.get(place).copied().unwrap_or(f64::NAN)
}

/// Numbers that no two clauses share.
fn tag(clause: &str) -> u32 {
    crc32(clause.as_bytes()) | 1
}
