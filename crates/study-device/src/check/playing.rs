//! Tests of a playing device. Somebody has to hold the handle.

use super::exchange::Exchange;
use super::uploads::Upload;
use super::{CheckFailure, ClauseResult, fail, tag};
use std::num::NonZeroU16;
use std::ops::Range;
use std::time::Duration;
use study_wire::message::{
    Ack, DeviceState, EventKind, Fault, Heartbeat, MINOR, Outcome, Play, Refusal, Request, Stop,
    TelemetrySample, fixed,
};
use study_wire::servo::ServoSettings;

const SECOND: Duration = Duration::from_secs(1);
/// Resolution of two clocks of whole ms, and one ms for the transfer.
const CLOCK_RESOLUTION_MS: f64 = 2.0;

/// Part of the force limit below which a force has fallen. In the second quarter of a fall at least half of
/// the force is left, and in the last tenth 2.5 %: ½ + ½ cos(0.9 π).
const FELL: f64 = 0.1;

/// A current playback.
pub(super) struct Playback {
    number: u32,
    started: Ack,
    servo_hz: f64,
}

/// Plays a table of constant force for at most `longest_ms`.
pub(super) fn play(
    exchange: &mut Exchange<'_>,
    force_n: f64,
    longest_ms: u32,
) -> Result<Playback, CheckFailure> {
    let device = exchange.identity()?;
    let table = Upload::passive(exchange, force_n)?;
    table.load(exchange)?;
    let rate = device.telemetry_hz.clamp(1.0, 1000.0);
    // `as` saturates.
    let every = NonZeroU16::new((device.servo_hz / rate).round() as u16);
    let play = Play {
        every: every.or(Some(NonZeroU16::MIN)),
        ..table.play(exchange, longest_ms)
    };
    let started = exchange.expect_done(Request::Play(play))?;
    if started.state != DeviceState::Ramp {
        return fail(format!("PLAY: {}", started.state));
    }
    Ok(Playback {
        number: play.playback,
        started,
        servo_hz: device.servo_hz,
    })
}

/// Plays for a second what is loaded; its largest force, N, which may not be above `limit_n`.
pub(super) fn peak_of(
    exchange: &mut Exchange<'_>,
    crc: u32,
    limit_n: f64,
) -> Result<f64, CheckFailure> {
    let playback = exchange.next_playback();
    exchange.expect_done(Request::Play(Play {
        playback,
        crc,
        longest_ms: 60_000,
        every: None,
    }))?;
    exchange.wait(SECOND)?;
    let outcome = exchange.outcome()?;
    exchange.expect_done(Request::Stop(Stop { playback }))?;
    if !outcome.state.applies_force() {
        return fail(format!(
            "the playback ended early: {}, {}; hold the handle near the middle of its stroke",
            outcome.state, outcome.fault
        ));
    }
    if outcome.peak_force_n > limit_n {
        return fail(format!("{} N", outcome.peak_force_n));
    }
    Ok(outcome.peak_force_n)
}

fn stop_request(playback: &Playback) -> Request {
    Request::Stop(Stop {
        playback: playback.number,
    })
}

/// Samples so far and the number of missing ones.
pub(super) fn samples(exchange: &Exchange<'_>, playback: &Playback) -> (Vec<TelemetrySample>, u64) {
    let mut all = Vec::new();
    let (mut due, mut missed) = (0u64, 0);
    for (_, telemetry) in &exchange.telemetry {
        if telemetry.playback == playback.number {
            missed += u64::from(telemetry.first).saturating_sub(due);
            all.extend_from_slice(telemetry.samples.as_slice());
            due = u64::from(telemetry.first) + telemetry.samples.as_slice().len() as u64;
        }
    }
    (all, missed)
}

/// Plays for `time` and checks that the device is still playing. A trip during a test is
/// usually caused by the hand and not by the device.
fn play_for(
    exchange: &mut Exchange<'_>,
    force_n: f64,
    time: Duration,
) -> Result<Playback, CheckFailure> {
    let playback = play(exchange, force_n, 60_000)?;
    exchange.wait(time)?;
    let outcome = exchange.outcome()?;
    if outcome.state.applies_force() {
        return Ok(playback);
    }
    fail(format!(
        "the playback ended early: {}, {}; hold the handle near the middle of its stroke",
        outcome.state, outcome.fault
    ))
}

pub(super) fn telemetry(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    if !device.flags.telemetry {
        return Ok("no telemetry".to_owned());
    }
    let playback = play_for(exchange, 0.0, 2 * SECOND)?;
    exchange.expect_done(stop_request(&playback))?;
    exchange.wait(SECOND / 10)?;
    let outcome = exchange.outcome()?;
    let (all, missed) = samples(exchange, &playback);
    let late_ms = exchange
        .telemetry
        .iter()
        .filter_map(|(at, t)| {
            Some(f64::from(
                exchange.clock.at(*at)?.wrapping_sub(t.clock_ms) as i32
            ))
        })
        .fold(0.0, f64::max);
    let Some((first, last)) = all.first().zip(all.last()) else {
        return fail("no samples received");
    };
    let ticks = last.tick.wrapping_sub(first.tick);
    let rate_hz = (all.len() - 1) as f64 / (f64::from(ticks.max(1)) / playback.servo_hz);
    let seen = format!(
        "{} samples at {rate_hz:.0} Hz, {missed} missing, delay at most {late_ms:.0} ms",
        all.len()
    );
    if missed > 0 || all.len() as u64 != u64::from(outcome.samples) {
        return fail(format!("{seen}; it sent {}", outcome.samples));
    }
    if first.tick != 0 {
        return fail(format!(
            "{seen}; the first sample is of period {}",
            first.tick
        ));
    }
    let requested_hz = device.telemetry_hz.min(1000.0);
    if !(0.9 * requested_hz..=1.01 * requested_hz).contains(&rate_hz) {
        return fail(format!("{seen}; {requested_hz:.0} Hz were requested"));
    }
    let events = &exchange.events;
    if !events.iter().any(|e| e.kind == EventKind::Stopped) {
        return fail(format!("{seen}; no EVENT `stopped`"));
    }
    Ok(seen)
}

pub(super) fn clamp(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let limit_n = super::FORCE_N.min(device.force_n);
    let playback = play_for(exchange, 3.0 * limit_n, SECOND)?;
    exchange.expect_done(stop_request(&playback))?;
    exchange.wait(SECOND / 10)?;
    let outcome = exchange.outcome()?;
    let (all, _) = samples(exchange, &playback);
    let force_n = |s: &TelemetrySample| fixed::from_un(s.command_un).abs();
    let peak_n = all.iter().map(force_n).fold(outcome.peak_force_n, f64::max);
    let early = |s: &&TelemetrySample| f64::from(s.tick) < 0.05 * playback.servo_hz;
    let early_n = all.iter().filter(early).map(force_n).fold(0.0, f64::max);
    let seen =
        format!("{peak_n:.3} N at a limit of {limit_n} N; {early_n:.3} N in the first 50 ms");
    if peak_n > limit_n + 1e-6 {
        return fail(seen);
    }
    if early_n > 0.25 * limit_n {
        return fail(format!("{seen}: it rises too fast"));
    }
    if peak_n < 0.9 * limit_n || outcome.clamps == 0 {
        return fail(format!("{seen}: the force of the table is missing"));
    }
    Ok(seen)
}

/// How long the playback continued after an acknowledgement, ms.
fn overhang_ms(playback: &Playback, ack: &Ack, ticks: u32) -> f64 {
    let by_clock = f64::from(ack.clock_ms.wrapping_sub(playback.started.clock_ms));
    1e3 * f64::from(ticks) / playback.servo_hz - by_clock
}

/// Sends a request that has to switch the force off at once. Returns its acknowledgement,
/// how long it took on the device's clock, ms, and how long it may take, ms.
fn timed(exchange: &mut Exchange<'_>, request: Request) -> Result<(Ack, f64, f64), CheckFailure> {
    let device = exchange.identity()?;
    let now = exchange.now();
    let sent_ms = exchange.clock.at(now).unwrap_or(device.clock_ms);
    let ack = exchange.expect_done(request)?;
    let took_ms = f64::from(ack.clock_ms.wrapping_sub(sent_ms) as i32);
    let [.., latency_ms] = exchange.latency_ms.unwrap_or([0.0; 3]);
    let allowed_ms = 1.0 + 1e3 / device.servo_hz + latency_ms + CLOCK_RESOLUTION_MS;
    Ok((ack, took_ms, allowed_ms))
}

/// Ends a playback with `request`. Returns the acknowledgement, the outcome, the observed
/// times, and whether they are too long.
fn end_with(
    exchange: &mut Exchange<'_>,
    playback: &Playback,
    request: Request,
) -> Result<(Ack, Outcome, String, bool), CheckFailure> {
    let (ack, took_ms, allowed_ms) = timed(exchange, request)?;
    exchange.wait(SECOND / 10)?;
    let outcome = exchange.outcome()?;
    let over_ms = overhang_ms(playback, &ack, outcome.ticks);
    let seen = format!(
        "executed {:.0} ms after it was sent, zero force {:.1} ms after the reply",
        took_ms.max(0.0),
        over_ms.max(0.0)
    );
    let late =
        took_ms > allowed_ms || over_ms > 1.0 + 1e3 / playback.servo_hz + CLOCK_RESOLUTION_MS;
    Ok((ack, outcome, seen, late))
}

pub(super) fn stop(exchange: &mut Exchange<'_>) -> ClauseResult {
    let playback = play_for(exchange, 1.0, SECOND)?;
    let (ack, outcome, seen, late) = end_with(exchange, &playback, stop_request(&playback))?;
    if ack.state.applies_force() {
        return fail(format!("STOP: {}", ack.state));
    }
    if late {
        return fail(seen);
    }
    if outcome.state != DeviceState::Loaded {
        return fail(format!("then {}", outcome.state));
    }
    Ok(seen)
}

pub(super) fn limp(exchange: &mut Exchange<'_>) -> ClauseResult {
    let playback = play_for(exchange, 1.0, SECOND / 2)?;
    let (ack, outcome, seen, late) = end_with(exchange, &playback, Request::Limp)?;
    if ack.state != DeviceState::Limp || outcome.state != DeviceState::Limp {
        return fail(format!("LIMP: {}", outcome.state));
    }
    if late {
        return fail(seen);
    }
    Ok(seen)
}

/// The force falls to zero before the end, from minor version 3 on, on a device that says so.
pub(super) fn fade(exchange: &mut Exchange<'_>) -> ClauseResult {
    let unasked = Request::Fade(Stop { playback: 1 });
    // The connection is one of minor version 0.
    exchange.expect_refusal(unasked, Refusal::UnknownType)?;
    let told = exchange.hello_of(MINOR).ok();
    let told = told.and_then(|device| device.constants);
    let Some(told) = told.filter(|told| told.features.fade) else {
        exchange.expect_refusal(unasked, Refusal::UnknownType)?;
        return Ok("it ends at once; a fall is refused".to_owned());
    };
    exchange.first_heartbeat()?;
    let device = exchange.identity()?;
    let limit_n = super::FORCE_N.min(device.force_n);
    let playback = play_for(exchange, limit_n, SECOND / 2)?;
    let servo = ServoSettings {
        servo_hz: device.servo_hz,
        force_n: limit_n,
        slew_n_s: told.slew_n_s,
        ramp_s: told.ramp_s,
        ..ServoSettings::default()
    };
    let fade_s = f64::from(servo.fade_periods()) / servo.servo_hz;
    let ack = exchange.expect_done(Request::Fade(Stop {
        playback: playback.number,
    }))?;
    if !ack.state.applies_force() {
        return fail(format!("FADE: {}", ack.state));
    }
    // What is told may be anything, and a clock that is emulated may be slow.
    exchange.wait(Duration::from_secs_f64(fade_s.min(2.0)) + SECOND)?;
    let outcome = exchange.outcome()?;
    let took_ms = overhang_ms(&playback, &ack, outcome.ticks);
    let (all, _) = samples(exchange, &playback);
    let periods = servo.fade_periods();
    let from = outcome.ticks.saturating_sub(periods);
    // Largest force in a part of the fall; `None` without samples of it.
    let largest_n = |part: Range<u32>| {
        let within = |s: &&TelemetrySample| part.contains(&s.tick.saturating_sub(from));
        let sizes_n = all.iter().filter(within);
        let sizes_n = sizes_n.map(|s| fixed::from_un(s.command_un).abs());
        sizes_n.reduce(f64::max)
    };
    let early_n = largest_n(periods / 4..periods / 2);
    let late_n = largest_n(periods - periods / 10..u32::MAX);
    let in_words = |force_n: Option<f64>| match force_n {
        Some(force_n) => format!("{force_n:.3} N"),
        None => "no samples".to_owned(),
    };
    let seen = format!(
        "{took_ms:.0} ms of {:.0} ms; in its second quarter {}, in its last tenth {}",
        1e3 * fade_s,
        in_words(early_n),
        in_words(late_n)
    );
    if outcome.state != DeviceState::Loaded || outcome.fault != Fault::None {
        return fail(format!("{seen}; then {}, {}", outcome.state, outcome.fault));
    }
    let allowed_ms = 1.0 + 1e3 / servo.servo_hz + CLOCK_RESOLUTION_MS;
    let at_once = early_n.is_some_and(|force_n| force_n < FELL * limit_n);
    let too_late = late_n.is_some_and(|force_n| force_n > FELL * limit_n);
    if (took_ms - 1e3 * fade_s).abs() > allowed_ms || at_once || too_late {
        return fail(seen);
    }
    Ok(seen)
}

pub(super) fn longest(exchange: &mut Exchange<'_>) -> ClauseResult {
    const LONGEST_MS: u32 = 300;
    let playback = play(exchange, 0.5, LONGEST_MS)?;
    exchange.wait(SECOND)?;
    let outcome = exchange.outcome()?;
    let lasted_ms = 1e3 * f64::from(outcome.ticks) / playback.servo_hz;
    let seen = format!("{lasted_ms:.0} ms of {LONGEST_MS} ms, {}", outcome.fault);
    let ended = outcome.state == DeviceState::Loaded && outcome.fault == Fault::Longest;
    if ended && (lasted_ms - f64::from(LONGEST_MS)).abs() <= CLOCK_RESOLUTION_MS + 1.0 {
        Ok(seen)
    } else {
        fail(format!("{seen}, {}", outcome.state))
    }
}

/// Stops the heartbeats during a playback. Returns the time from the last fresh heartbeat
/// to limp on the device's clock, ms.
fn stop_heartbeats(exchange: &mut Exchange<'_>) -> Result<(f64, Playback), CheckFailure> {
    let playback = play_for(exchange, 1.0, SECOND / 2)?;
    exchange.sends_heartbeats = false;
    // Messages in transit.
    exchange.wait(SECOND / 50)?;
    let Some(heard) = exchange.pulses.iter().rev().find(|p| p.fresh) else {
        return fail("no heartbeat was fresh");
    };
    let heard_ms = heard.clock_ms;
    exchange.wait(SECOND / 2)?;
    let Some(event) = exchange.latched() else {
        return fail("it continues without heartbeats");
    };
    if event.fault != Fault::Watchdog {
        return fail(event.fault);
    }
    let after_ms = f64::from(event.clock_ms.wrapping_sub(heard_ms));
    Ok((after_ms, playback))
}

pub(super) fn watchdog(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let (after_ms, playback) = stop_heartbeats(exchange)?;
    let outcome = exchange.outcome()?;
    let seen = format!("{after_ms:.0} ms after the last heartbeat");
    if after_ms > f64::from(device.watchdog_ms) + CLOCK_RESOLUTION_MS {
        return fail(seen);
    }
    // New heartbeats do not resume the playback.
    exchange.sends_heartbeats = true;
    exchange.wait(SECOND / 5)?;
    let later = exchange.outcome()?;
    if later.state != DeviceState::Limp || later.ticks != outcome.ticks {
        return fail(format!("{seen}, then {}", later.state));
    }
    let (all, _) = samples(exchange, &playback);
    let last_tick = all.last().map_or(0, |s| s.tick);
    if last_tick > outcome.ticks {
        return fail(format!("{seen}; samples continue"));
    }
    Ok(format!("{seen}, latched"))
}

/// A driver's queue of heartbeats can outlive the host; their deadline ends it.
pub(super) fn deadline(exchange: &mut Exchange<'_>) -> ClauseResult {
    let playback = play_for(exchange, 1.0, SECOND / 2)?;
    exchange.sends_heartbeats = false;
    let now_ms = exchange.outcome()?.clock_ms;
    // All heartbeats are made now and delivered later.
    let first = exchange.beat_count().wrapping_add(tag("6.2") % 1000 + 1);
    let deadline_ms = now_ms.wrapping_add(40);
    let mut late = 0;
    for n in 0..30 {
        let beat = Heartbeat {
            count: first.wrapping_add(n),
            deadline_ms,
        };
        let received = exchange.ask(Request::Heartbeat(beat))?;
        if let study_wire::message::Reply::Pulse(pulse) = received.reply {
            late += u32::from(!pulse.fresh);
        }
        exchange.wait(SECOND / 200)?;
    }
    let Some(event) = exchange.latched() else {
        return fail("it continues with expired heartbeats");
    };
    let after_ms = f64::from(event.clock_ms.wrapping_sub(deadline_ms) as i32);
    let seen = format!("limp {after_ms:.0} ms after the deadline, {late} heartbeats not fresh");
    let outcome = exchange.outcome()?;
    if after_ms > CLOCK_RESOLUTION_MS || outcome.playback != playback.number || late == 0 {
        return fail(seen);
    }
    Ok(seen)
}
