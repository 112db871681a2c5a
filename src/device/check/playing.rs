//! Clauses about a device that plays. Somebody has to hold the handle.

use super::talk::Talk;
use super::uploads::Upload;
use super::{Broken, Kept, tag};
use std::time::Duration;
use study_wire::message::{
    Ack, Fault, Happening, Heartbeat, Outcome, Request, State, Stop, TelemetrySample, fixed,
};

const SECOND: Duration = Duration::from_secs(1);
/// How far two clocks of whole ms may be apart, and a ms for what is on its way.
const GRAIN_MS: f64 = 2.0;

/// A playback under way.
struct Playback {
    number: u32,
    started: Ack,
    servo_hz: f64,
}

/// Plays a table of constant force for at most so long.
fn play(talk: &mut Talk<'_>, force_n: f64, longest_ms: u32) -> Result<Playback, Broken> {
    let device = talk.identity()?;
    let table = Upload::sound(&device, force_n);
    table.load(talk)?;
    let rate = device.telemetry_hz.clamp(1.0, 1000.0);
    // `as` saturates
    let every = (device.servo_hz / rate).round().max(1.0) as u16;
    let request = table.play(talk, longest_ms, every);
    let Request::Play(asked) = request else {
        return Err(Broken::seen("no PLAY"));
    };
    let started = talk.done(request)?;
    if started.state != State::Ramp {
        return Err(Broken::seen(format!("PLAY: {}", started.state.as_str())));
    }
    Ok(Playback {
        number: asked.playback,
        started,
        servo_hz: device.servo_hz,
    })
}

fn stop_request(playback: &Playback) -> Request {
    Request::Stop(Stop {
        playback: playback.number,
    })
}

/// Samples so far, and how many were missed.
fn samples(talk: &Talk<'_>, playback: &Playback) -> (Vec<TelemetrySample>, u64) {
    let mut all = Vec::new();
    let (mut due, mut missed) = (0u64, 0);
    for (_, telemetry) in &talk.telemetry {
        if telemetry.playback == playback.number {
            missed += u64::from(telemetry.first).saturating_sub(due);
            all.extend_from_slice(telemetry.samples.as_slice());
            due = u64::from(telemetry.first) + telemetry.samples.as_slice().len() as u64;
        }
    }
    (all, missed)
}

/// Trips in the middle of a look are no broken clause: somebody let go.
fn still_plays(talk: &mut Talk<'_>) -> Result<(), Broken> {
    let outcome = talk.outcome()?;
    if outcome.state.forceful() {
        return Ok(());
    }
    Err(Broken::seen(format!(
        "it does not play on: {}, {}; hold the handle near the middle of its stroke",
        outcome.state.as_str(),
        outcome.fault.as_str()
    )))
}

pub(super) fn telemetry(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    if !device.flags.telemetry {
        return Ok("it has none".to_owned());
    }
    let playback = play(talk, 0.0, 60_000)?;
    talk.pass(2 * SECOND)?;
    still_plays(talk)?;
    talk.done(stop_request(&playback))?;
    talk.pass(SECOND / 10)?;
    let outcome = talk.outcome()?;
    let (all, missed) = samples(talk, &playback);
    let late_ms = talk
        .telemetry
        .iter()
        .filter_map(|(at, t)| {
            Some(f64::from(
                talk.clock.at(*at)?.wrapping_sub(t.clock_ms) as i32
            ))
        })
        .fold(0.0, f64::max);
    let Some((first, last)) = all.first().zip(all.last()) else {
        return Err(Broken::seen("nothing came"));
    };
    let ticks = last.tick.wrapping_sub(first.tick);
    let rate_hz = (all.len() - 1) as f64 / (f64::from(ticks.max(1)) / playback.servo_hz);
    let seen = format!(
        "{} samples at {rate_hz:.0} Hz, {missed} missed, the last of a message at most {late_ms:.0} ms old",
        all.len()
    );
    if missed > 0 || all.len() as u64 != u64::from(outcome.samples) {
        return Err(Broken::seen(format!("{seen}; it sent {}", outcome.samples)));
    }
    if first.tick != 0 {
        return Err(Broken::seen(format!(
            "{seen}; the first is of period {}",
            first.tick
        )));
    }
    let asked = device.telemetry_hz.min(1000.0);
    if !(0.9 * asked..=1.01 * asked).contains(&rate_hz) {
        return Err(Broken::seen(format!(
            "{seen}; {asked:.0} Hz were asked for"
        )));
    }
    let events = &talk.events;
    if !events.iter().any(|e| e.what == Happening::Stopped) {
        return Err(Broken::seen(format!("{seen}; no EVENT stopped")));
    }
    Ok(seen)
}

pub(super) fn clamp(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let limit_n = super::FORCE_N.min(device.force_n);
    let playback = play(talk, 3.0 * limit_n, 60_000)?;
    talk.pass(SECOND)?;
    still_plays(talk)?;
    talk.done(stop_request(&playback))?;
    talk.pass(SECOND / 10)?;
    let outcome = talk.outcome()?;
    let (all, _) = samples(talk, &playback);
    let force_n = |s: &TelemetrySample| fixed::from_un(s.command_un).abs();
    let most_n = all.iter().map(force_n).fold(outcome.most_force_n, f64::max);
    let early = |s: &&TelemetrySample| f64::from(s.tick) < 0.05 * playback.servo_hz;
    let early_n = all.iter().filter(early).map(force_n).fold(0.0, f64::max);
    let seen =
        format!("{most_n:.3} N at a limit of {limit_n} N; {early_n:.3} N in the first 50 ms");
    if most_n > limit_n + 1e-6 {
        return Err(Broken::seen(seen));
    }
    if early_n > 0.25 * limit_n {
        return Err(Broken::seen(format!("{seen}: it does not come up slowly")));
    }
    if most_n < 0.9 * limit_n || outcome.clamps == 0 {
        return Err(Broken::seen(format!("{seen}: the table is not played")));
    }
    Ok(seen)
}

/// Servo periods that the playback lasted beyond an acknowledgement, ms.
fn overhang_ms(playback: &Playback, ack: &Ack, ticks: u32) -> f64 {
    let by_clock = f64::from(ack.clock_ms.wrapping_sub(playback.started.clock_ms));
    1e3 * f64::from(ticks) / playback.servo_hz - by_clock
}

/// A request that has to end the force at once: its acknowledgement, and how long it
/// took by the device's clock, ms, with what the link may take.
fn at_once(talk: &mut Talk<'_>, request: Request) -> Result<(Ack, f64, f64), Broken> {
    let device = talk.identity()?;
    let now = talk.now();
    let sent_ms = talk.clock.at(now).unwrap_or(device.clock_ms);
    let ack = talk.done(request)?;
    let took_ms = f64::from(ack.clock_ms.wrapping_sub(sent_ms) as i32);
    let [.., most_ms] = talk.latency_ms.unwrap_or([0.0; 3]);
    let allowed_ms = 1.0 + 1e3 / device.servo_hz + most_ms + GRAIN_MS;
    Ok((ack, took_ms, allowed_ms))
}

/// Ends a playback by `request`: its acknowledgement, the outcome, what was seen of
/// the time that it took, and whether that was too long.
fn ended(
    talk: &mut Talk<'_>,
    playback: &Playback,
    request: Request,
) -> Result<(Ack, Outcome, String, bool), Broken> {
    let (ack, took_ms, allowed_ms) = at_once(talk, request)?;
    talk.pass(SECOND / 10)?;
    let outcome = talk.outcome()?;
    let over_ms = overhang_ms(playback, &ack, outcome.ticks);
    let seen = format!(
        "done {:.0} ms after it was sent, zero force {:.1} ms after its reply",
        took_ms.max(0.0),
        over_ms.max(0.0)
    );
    let late = took_ms > allowed_ms || over_ms > 1.0 + 1e3 / playback.servo_hz + GRAIN_MS;
    Ok((ack, outcome, seen, late))
}

pub(super) fn stop(talk: &mut Talk<'_>) -> Kept {
    let playback = play(talk, 1.0, 60_000)?;
    talk.pass(SECOND)?;
    still_plays(talk)?;
    let (ack, outcome, seen, late) = ended(talk, &playback, stop_request(&playback))?;
    if ack.state.forceful() {
        return Err(Broken::seen(format!("STOP: {}", ack.state.as_str())));
    }
    if late {
        return Err(Broken::seen(seen));
    }
    if outcome.state != State::Loaded {
        return Err(Broken::seen(format!("then {}", outcome.state.as_str())));
    }
    Ok(seen)
}

pub(super) fn limp(talk: &mut Talk<'_>) -> Kept {
    let playback = play(talk, 1.0, 60_000)?;
    talk.pass(SECOND / 2)?;
    still_plays(talk)?;
    let (ack, outcome, seen, late) = ended(talk, &playback, Request::Limp)?;
    if ack.state != State::Limp || outcome.state != State::Limp {
        return Err(Broken::seen(format!("LIMP: {}", outcome.state.as_str())));
    }
    if late {
        return Err(Broken::seen(seen));
    }
    Ok(seen)
}

pub(super) fn longest(talk: &mut Talk<'_>) -> Kept {
    const LONGEST_MS: u32 = 300;
    let playback = play(talk, 0.5, LONGEST_MS)?;
    talk.pass(SECOND)?;
    let outcome = talk.outcome()?;
    let lasted_ms = 1e3 * f64::from(outcome.ticks) / playback.servo_hz;
    let seen = format!(
        "{lasted_ms:.0} ms of {LONGEST_MS} ms, {}",
        outcome.fault.as_str()
    );
    let ended = outcome.state == State::Loaded && outcome.fault == Fault::Longest;
    if ended && (lasted_ms - f64::from(LONGEST_MS)).abs() <= GRAIN_MS + 1.0 {
        Ok(seen)
    } else {
        Err(Broken::seen(format!("{seen}, {}", outcome.state.as_str())))
    }
}

/// How long after its last fresh heartbeat the device went limp, by its own clock.
fn silence(talk: &mut Talk<'_>, what: &str) -> Result<(f64, Playback), Broken> {
    let playback = play(talk, 1.0, 60_000)?;
    talk.pass(SECOND / 2)?;
    still_plays(talk)?;
    talk.beating = false;
    // what is on its way
    talk.pass(SECOND / 50)?;
    let heard = talk.pulses.iter().rev().find(|p| p.fresh);
    let heard_ms = heard
        .ok_or_else(|| Broken::seen("no heartbeat was fresh"))?
        .clock_ms;
    talk.pass(SECOND / 2)?;
    let event = talk
        .events
        .iter()
        .find(|e| e.what == Happening::Latched)
        .copied()
        .ok_or_else(|| Broken::seen(format!("{what}: it plays on")))?;
    if event.fault != Fault::Watchdog {
        return Err(Broken::seen(event.fault.as_str()));
    }
    let after_ms = f64::from(event.clock_ms.wrapping_sub(heard_ms));
    Ok((after_ms, playback))
}

pub(super) fn watchdog(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let (after_ms, playback) = silence(talk, "without heartbeats")?;
    let outcome = talk.outcome()?;
    let seen = format!("{after_ms:.0} ms after the last heartbeat");
    if after_ms > f64::from(device.watchdog_ms) + GRAIN_MS {
        return Err(Broken::seen(seen));
    }
    // a host that comes back does not make it play on
    talk.beating = true;
    talk.pass(SECOND / 5)?;
    let later = talk.outcome()?;
    if later.state != State::Limp || later.ticks != outcome.ticks {
        return Err(Broken::seen(format!(
            "{seen}, then {}",
            later.state.as_str()
        )));
    }
    let (all, _) = samples(talk, &playback);
    let last_tick = all.last().map_or(0, |s| s.tick);
    if last_tick > outcome.ticks {
        return Err(Broken::seen(format!("{seen}; samples go on")));
    }
    Ok(format!("{seen}, latched"))
}

/// A queue of heartbeats outlives its host: the deadline ends it.
pub(super) fn deadline(talk: &mut Talk<'_>) -> Kept {
    let playback = play(talk, 1.0, 60_000)?;
    talk.pass(SECOND / 2)?;
    still_plays(talk)?;
    talk.beating = false;
    let now_ms = talk.outcome()?.clock_ms;
    // all made now, delivered later
    let first = talk.beat_count().wrapping_add(tag("6.2") % 1000 + 1);
    let deadline_ms = now_ms.wrapping_add(40);
    let mut late = 0;
    for n in 0..30 {
        let beat = Heartbeat {
            count: first.wrapping_add(n),
            deadline_ms,
        };
        let came = talk.ask(Request::Heartbeat(beat))?;
        if let study_wire::message::Reply::Pulse(pulse) = came.reply {
            late += u32::from(!pulse.fresh);
        }
        talk.pass(SECOND / 200)?;
    }
    let event = talk
        .events
        .iter()
        .find(|e| e.what == Happening::Latched)
        .copied()
        .ok_or_else(|| Broken::seen("it plays on with heartbeats past their deadline"))?;
    let after_ms = f64::from(event.clock_ms.wrapping_sub(deadline_ms) as i32);
    let seen = format!("limp {after_ms:.0} ms after the deadline, {late} heartbeats not fresh");
    let outcome = talk.outcome()?;
    if after_ms > GRAIN_MS || outcome.playback != playback.number || late == 0 {
        return Err(Broken::seen(seen));
    }
    Ok(seen)
}
