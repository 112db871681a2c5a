//! Recording with a probe over the wire format: upload of a path, samples in return.
//!
//! The device follows the path by itself; the host closes no control loop. Samples are
//! neither acknowledged nor repeated, so a recording with a gap is rejected and has to be
//! repeated.

use super::check::exchange::Exchange;
use super::check::{CheckFailure, Connection, fail};
use std::time::Duration;
use study_haptics::plant::Measurement;
use study_wire::message::{
    Commit, DeviceState, FixedVec, Identity, PathBegin, PathChunk, RecordedPoint, Request,
    UploadCrc, fixed,
};

/// Time between two requests for the state.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Additional time for the approach to the first point.
const APPROACH_TIMEOUT: Duration = Duration::from_secs(20);

/// A path for a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ProbePath {
    /// Positions, mm.
    pub x_mm: Vec<f64>,
    /// Positions per second.
    pub rate_hz: f64,
    /// Largest force, N; the device's own limit applies if it is lower.
    pub force_n: f64,
}

/// Records along a path, one sample for each position. `progress` receives the completed
/// fraction, 0 to 1.
///
/// # Errors
/// [`CheckFailure`] if there is no device or no probe, if the path is refused, and after
/// a trip or with missing samples.
pub fn record(
    connection: &mut dyn Connection,
    nonce: u32,
    path: &ProbePath,
    progress: &mut dyn FnMut(f64),
) -> Result<(Identity, Measurement), CheckFailure> {
    let mut exchange = Exchange::new(connection, nonce);
    let result = follow(&mut exchange, path, progress);
    // Also after a failure, which is reported first.
    let _ = exchange.limp();
    result
}

fn follow(
    exchange: &mut Exchange<'_>,
    path: &ProbePath,
    progress: &mut dyn FnMut(f64),
) -> Result<(Identity, Measurement), CheckFailure> {
    exchange.hello()?;
    exchange.reset()?;
    let device = exchange.identity()?;
    if !device.flags.probe {
        return fail("it has no probe mode");
    }
    if path.x_mm.len() as u64 > u64::from(device.max_points) {
        return fail(format!(
            "the path has {} points, but the device accepts {}: use a rate of at most {} samples \
             per second (--rate)",
            path.x_mm.len(),
            device.max_points,
            (path.rate_hz * f64::from(device.max_points) / path.x_mm.len() as f64).floor()
        ));
    }
    let x_nm: Vec<i32> = path.x_mm.iter().map(|x| fixed::nm(*x)).collect();
    let crc = upload(exchange, path, &x_nm, &device)?;
    let playback = exchange.next_playback();
    exchange.recorded.clear();
    exchange.expect_done(Request::Record(study_wire::message::Record {
        playback,
        crc,
    }))?;
    let duration = Duration::from_secs_f64(path.x_mm.len() as f64 / path.rate_hz);
    let until = exchange.now() + duration + APPROACH_TIMEOUT;
    loop {
        exchange.wait(POLL_INTERVAL)?;
        let sizes = exchange.recorded.iter().map(|r| r.points.as_slice().len());
        let received: usize = sizes.sum();
        progress(received as f64 / path.x_mm.len() as f64);
        if let Some(event) = exchange.latched() {
            return fail(event.fault);
        }
        let outcome = exchange.outcome()?;
        if outcome.state.latched() {
            return fail(outcome.fault);
        }
        if outcome.state == DeviceState::Loaded {
            break;
        }
        if exchange.now() > until {
            return fail("it does not reach the end of the path");
        }
    }
    let mut points: Vec<RecordedPoint> = Vec::with_capacity(x_nm.len());
    for message in &exchange.recorded {
        if message.playback == playback && message.first as usize == points.len() {
            points.extend_from_slice(message.points.as_slice());
        }
    }
    if points.len() != x_nm.len() {
        return fail(format!(
            "{} of {} samples were lost on the link",
            x_nm.len() - points.len().min(x_nm.len()),
            x_nm.len()
        ));
    }
    let forces = points.iter().map(|p| p.force_un.map(fixed::from_un));
    let f_n: Option<Vec<f64>> = forces.collect();
    let accelerations = points.iter().map(|p| fixed::from_um_s2(p.a_um_s2));
    let measured = Measurement {
        t_s: (0..points.len()).map(|i| i as f64 / path.rate_hz).collect(),
        x_mm: points.iter().map(|p| fixed::from_nm(p.x_nm)).collect(),
        a_m_s2: accelerations.collect(),
        f_n: f_n.ok_or_else(|| CheckFailure::violation("it has no force sensor"))?,
    };
    Ok((device, measured))
}

fn upload(
    exchange: &mut Exchange<'_>,
    path: &ProbePath,
    x_nm: &[i32],
    device: &Identity,
) -> Result<u32, CheckFailure> {
    let begin = PathBegin {
        // At most the device's capacity, which is a u32.
        points: x_nm.len() as u32,
        rate_hz: path.rate_hz,
        force_n: path.force_n.min(device.force_n),
        velocity_mm_s: device.velocity_mm_s,
    };
    let mut crc = UploadCrc::of_path(&begin);
    for x_nm in x_nm {
        crc.point(*x_nm);
    }
    let crc = crc.value();
    exchange.expect_done(Request::PathBegin(begin))?;
    for (i, x_nm) in x_nm.chunks(PathChunk::MAX_POINTS).enumerate() {
        exchange.expect_done(Request::PathChunk(PathChunk {
            first: (i * PathChunk::MAX_POINTS) as u32,
            x_nm: FixedVec::of(x_nm),
        }))?;
    }
    exchange.expect_done(Request::PathCommit(Commit { crc }))?;
    Ok(crc)
}
