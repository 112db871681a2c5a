//! A real probe over the wire: a path goes up, what was measured comes back.
//!
//! The device follows the path by itself; nothing here closes a loop. Samples are
//! neither acknowledged nor repeated, so a recording with a gap is refused and has to
//! be made again.

use super::check::Wire;
use super::check::talk::{Broken, Talk};
use std::time::Duration;
use study_wire::message::{
    Commit, Few, Happening, Identity, PathBegin, PathChunk, PathCrc, RecordedPoint, Request, State,
    fixed,
};

/// Between two looks at how far it is.
const LOOK: Duration = Duration::from_millis(50);
/// How long a probe may take beyond the time of its path: the way to its begin.
const EXTRA: Duration = Duration::from_secs(20);

/// What a probe shall do.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// Positions, mm.
    pub x_mm: Vec<f64>,
    /// Positions per second.
    pub rate_hz: f64,
    /// The largest force, N; the device's own where that is lower.
    pub force_n: f64,
}

/// What it measured, one value for each position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// mm.
    pub x_mm: Vec<f64>,
    /// N, that the probe applies.
    pub f_n: Vec<f64>,
    /// m/s².
    pub a_m_s2: Vec<f64>,
}

/// Follows a path. `tell` hears the share that is done.
///
/// # Errors
/// In words: no device, no probe, a path that it refuses, a trip, a gap.
pub fn record(
    wire: &mut dyn Wire,
    nonce: u32,
    path: &Path,
    tell: &mut dyn FnMut(f64),
) -> Result<(Identity, Recording), String> {
    let mut talk = Talk::new(wire, nonce);
    let done = follow(&mut talk, path, tell);
    // whatever came of it
    let _ = talk.limp();
    done.map_err(|broken| match broken {
        Broken::Seen(why) | Broken::Gone(why) => why,
    })
}

fn follow(
    talk: &mut Talk<'_>,
    path: &Path,
    tell: &mut dyn FnMut(f64),
) -> Result<(Identity, Recording), Broken> {
    talk.hello()?;
    talk.ready()?;
    let device = talk.identity()?;
    if !device.flags.probe {
        return Err(Broken::seen("it has no probe mode"));
    }
    if path.x_mm.len() as u64 > u64::from(device.most_points) {
        return Err(Broken::seen(format!(
            "the path has {} points, and it has room for {}: record it at {} samples a second \
             or fewer (--rate)",
            path.x_mm.len(),
            device.most_points,
            (path.rate_hz * f64::from(device.most_points) / path.x_mm.len() as f64).floor()
        )));
    }
    let x_nm: Vec<i32> = path.x_mm.iter().map(|x| fixed::nm(*x)).collect();
    let crc = upload(talk, path, &x_nm, &device)?;
    let playback = talk.next_playback();
    talk.recorded.clear();
    talk.done(Request::Record(study_wire::message::Record {
        playback,
        crc,
    }))?;
    let lasts = Duration::from_secs_f64(path.x_mm.len() as f64 / path.rate_hz);
    let until = talk.now() + lasts + EXTRA;
    loop {
        talk.pass(LOOK)?;
        let came: usize = talk
            .recorded
            .iter()
            .map(|r| r.points.as_slice().len())
            .sum();
        tell(came as f64 / path.x_mm.len() as f64);
        let latched = talk.events.iter().find(|e| e.what == Happening::Latched);
        if let Some(event) = latched {
            return Err(Broken::seen(event.fault.as_str()));
        }
        let outcome = talk.outcome()?;
        if outcome.state.latched() {
            return Err(Broken::seen(outcome.fault.as_str()));
        }
        if outcome.state == State::Loaded {
            break;
        }
        if talk.now() > until {
            return Err(Broken::seen("it does not come to the end of the path"));
        }
    }
    let mut points: Vec<RecordedPoint> = Vec::with_capacity(x_nm.len());
    for message in &talk.recorded {
        if message.playback == playback && message.first as usize == points.len() {
            points.extend_from_slice(message.points.as_slice());
        }
    }
    if points.len() != x_nm.len() {
        return Err(Broken::seen(format!(
            "{} of {} samples were lost on the way",
            x_nm.len() - points.len().min(x_nm.len()),
            x_nm.len()
        )));
    }
    if points.iter().any(|p| p.force_un == fixed::NONE) {
        return Err(Broken::seen("it measures no force"));
    }
    let recording = Recording {
        x_mm: points.iter().map(|p| fixed::from_nm(p.x_nm)).collect(),
        f_n: points.iter().map(|p| fixed::from_un(p.force_un)).collect(),
        a_m_s2: points
            .iter()
            .map(|p| fixed::from_um_s2(p.a_um_s2))
            .collect(),
    };
    Ok((device, recording))
}

fn upload(
    talk: &mut Talk<'_>,
    path: &Path,
    x_nm: &[i32],
    device: &Identity,
) -> Result<u32, Broken> {
    let begin = PathBegin {
        // not more than the device has room for, which is a u32
        points: x_nm.len() as u32,
        rate_hz: path.rate_hz,
        force_n: path.force_n.min(device.force_n),
        velocity_mm_s: device.velocity_mm_s,
    };
    let mut crc = PathCrc::of(&begin);
    for x_nm in x_nm {
        crc.point(*x_nm);
    }
    let crc = crc.value();
    talk.done(Request::PathBegin(begin))?;
    for (i, x_nm) in x_nm.chunks(PathChunk::MOST).enumerate() {
        talk.done(Request::PathChunk(PathChunk {
            first: (i * PathChunk::MOST) as u32,
            x_nm: Few::of(x_nm),
        }))?;
    }
    talk.done(Request::PathCommit(Commit { crc }))?;
    Ok(crc)
}
