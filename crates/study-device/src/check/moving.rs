//! A test for which the handle has to move.

use super::exchange::Exchange;
use super::playing::{Playback, play, samples};
use super::{CheckFailure, ClauseResult, fail};
use std::time::Duration;
use study_wire::message::{DeviceState, Refusal, Request, TelemetrySample};

/// How long somebody may take to move the handle.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time between two looks.
const LOOK: Duration = Duration::from_millis(10);
/// It moves: faster than this in the last samples, mm/s; at rest it is slower than 5 mm/s.
const MOVES_MM_S: f64 = 25.0;
/// Samples that are looked at.
const LAST: usize = 20;

/// 5.2, 5.3: LIMP while the handle moves, and REARM at once.
pub(super) fn rearm(exchange: &mut Exchange<'_>) -> ClauseResult {
    if !exchange.identity()?.flags.telemetry {
        return Ok("no telemetry: not tested".to_owned());
    }
    let playback = play(exchange, 0.0, 60_000)?;
    let until = exchange.now() + PATIENCE;
    let speed_mm_s = loop {
        exchange.wait(LOOK)?;
        let speed_mm_s = least_speed(exchange, &playback);
        if speed_mm_s > MOVES_MM_S {
            break speed_mm_s;
        }
        if exchange.now() > until {
            return Err(CheckFailure::NotJudged(
                "nobody moved the handle to and fro".to_owned(),
            ));
        }
    };
    exchange.expect_done(Request::Limp)?;
    let ack = exchange.ack(Request::Rearm)?;
    let seen = format!("at {speed_mm_s:.0} mm/s");
    match ack.refusal {
        Refusal::Moving if ack.state == DeviceState::Limp => Ok(format!("refused {seen}")),
        Refusal::Moving => fail(format!("refused {seen}, but then {}", ack.state)),
        Refusal::None => fail(format!("it is armed again {seen}")),
        other => fail(format!("{seen}: {other}")),
    }
}

/// The least speed in the last samples, mm/s; 0 without enough of them.
fn least_speed(exchange: &Exchange<'_>, playback: &Playback) -> f64 {
    let (all, _) = samples(exchange, playback);
    let Some(from) = all.len().checked_sub(LAST) else {
        return 0.0;
    };
    let speed = |s: &TelemetrySample| f64::from(s.v_um_s).abs() * 1e-3;
    all[from..].iter().map(speed).fold(f64::INFINITY, f64::min)
}
