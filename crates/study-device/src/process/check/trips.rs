//! Round trips to a controller program that has nothing loaded.

use super::talk::Talk;
use crate::DeviceError;
use crate::process::hello::Told;
use std::time::{Duration, Instant};

/// Round trips to a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramTrips {
    /// What it told.
    pub told: Told,
    /// From its start to its `hello`, ms.
    pub hello_ms: f64,
    /// From `free` to its confirmation, ms; empty for version 1, which confirms nothing.
    pub trips_ms: Vec<f64>,
}

/// Starts a program and measures at most `count` round trips within `within`. It is sent `free`
/// alone, so that it has no force.
///
/// # Errors
/// [`DeviceError::Lost`] if it cannot be started, sends no valid `hello`, or does not confirm.
pub fn round_trips(
    command: &[String],
    count: usize,
    within: Duration,
) -> Result<ProgramTrips, DeviceError> {
    let begun = Instant::now();
    let mut talk = Talk::open(command)?;
    let ms = |time: Duration| 1e3 * time.as_secs_f64();
    let hello_ms = ms(begun.elapsed());
    let (mut trips_ms, since) = (Vec::new(), Instant::now());
    while !talk.told.is_version_1 && trips_ms.len() < count && since.elapsed() < within {
        let trip = talk.trip().map_err(|e| DeviceError::Lost(e.to_string()))?;
        trips_ms.push(ms(trip));
    }
    Ok(ProgramTrips {
        told: talk.told.clone(),
        hello_ms,
        trips_ms,
    })
}
