//! The clauses that can be tested from outside, in the order of the tests: messages
//! first, then uploads, then playbacks.

use super::bounds;
use super::elements;
use super::exchange::{Exchange, unexpected};
use super::mechanism;
use super::moving;
use super::playing;
use super::trips::{self, ADAPTER_MS, REPLY_MS};
use super::uploads::Upload;
use super::{CheckFailure, Clause, ClauseResult, fail, quantile};
use crate::host::RETRY_INTERVAL;
use std::time::Duration;
use study_wire::frame::Frame;
use study_wire::message::{
    self, DeviceState, Fault, Heartbeat, Identity, Refusal, Reply, Request, TableChunk, kind,
};

macro_rules! clauses {
    ($($clause:literal $what:literal $test:expr $(, ask $ask:literal)?;)+) => {
        /// All tested clauses.
        pub(super) const ALL: &[Clause] = &[
            $(Clause { clause: $clause, what: $what, test: $test, ask: concat!("" $(, $ask)?) },)+
        ];
    };
}

clauses! {
    "14.3" "HELLO is answered by a valid IDENTITY in a common version" handshake;
    "7.7" "the constants that the device tells are within their bounds" bounds::told;
    "11.1" "replies leave in time, and round trips are short enough for the watchdog time" latency;
    "2.3" "a frame with a wrong CRC is dropped and counted" bad_frames;
    "2.4" "the next frame after noise is received" noise;
    "3.1" "a message of the wrong length is refused" malformed;
    "3.2" "an unknown message type is refused" unknown_type;
    "3.3" "another version is refused" other_version;
    "3.4" "LIMP is executed in any version and with any length" any_limp;
    "4.3" "a repeated request is answered again but executed only once" repeats;
    "4.5" "another connection makes the device limp" another_connection;
    "5.2" "limp is latched; only REARM leads out of it" latched;
    "6.1" "old and expired heartbeats are not fresh" stale_heartbeats;
    "6.4" "nothing can be loaded without a heartbeat" no_heartbeat;
    "8.1" "chunks out of order and incomplete tables are refused" order;
    "8.2" "a table with a wrong CRC is refused" checksum;
    "8.3" "invalid tables and limits above the device's are refused" bad_tables;
    "8.4" "an uncertified table is refused, or with permission its force is capped" uncertified;
    "8.7" "mechanisms are judged and played, or unknown" mechanism::plays;
    "8.10" "elements are judged and played, or unknown" elements::plays;
    "11.2" "the largest table is uploaded and validated in time" largest;
    "12" "PLAY with another table or an invalid duration is refused" wrong_play;
    "9.1" "telemetry is complete and has the requested rate" playing::telemetry;
    "7.5" "the force rises slowly and never exceeds its limit" playing::clamp;
    "11.3" "STOP switches the force off at once" playing::stop;
    "5.1" "LIMP switches the force off at once" playing::limp;
    "5.5" "FADE lets the force fall before the end, or is unknown" playing::fade;
    "12" "a playback ends after its longest duration" playing::longest;
    "5.3" "REARM is refused while the handle moves" moving::rearm, ask "move the handle to and fro until the next line appears";
    "6.3" "without heartbeats the device goes limp in time and stays limp" playing::watchdog;
    "6.2" "heartbeats of a dead host expire at their deadline" playing::deadline;
}

/// Number of round trips that are measured.
const TRIPS: usize = 300;

fn handshake(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identify()?;
    let [oldest, newest] = device.versions;
    if !(oldest..=newest).contains(&message::VERSION) {
        return Err(CheckFailure::Disconnected(format!(
            "it supports versions {oldest} to {newest}, not {}",
            message::VERSION
        )));
    }
    let [low, high] = device.stroke_mm;
    let requirements = [
        (device.watchdog_ms >= 10, "watchdog time under 10 ms"),
        (device.watchdog_ms <= 200, "watchdog time over 200 ms"),
        (device.servo_hz >= 4000.0, "servo rate under 4 kHz"),
        (device.max_nodes >= 2, "fewer than two nodes per table"),
        (device.longest_ms > 0, "longest playback of 0 ms"),
        (low < high, "an empty stroke"),
        (
            device.state != DeviceState::Boot,
            "still in boot after HELLO",
        ),
        (
            !device.flags.telemetry || device.telemetry_hz >= 1.0,
            "telemetry without a rate",
        ),
    ];
    let unmet = requirements.iter().find(|(met, _)| !met);
    let unmet = unmet.map(|(_, what)| (*what).to_owned());
    match unmet.or_else(|| bounds::limits(&device)) {
        Some(what) => fail(what),
        None => Ok(format!(
            "version {}, servo {} Hz, watchdog {} ms, {} N, {} mm/s, {} nodes",
            message::VERSION,
            device.servo_hz,
            device.watchdog_ms,
            device.force_n,
            device.velocity_mm_s,
            device.max_nodes
        )),
    }
}

fn latency(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let mut trips = trips::of_state(exchange, TRIPS, None)?;
    trips.sort_by(f64::total_cmp);
    let quantiles = [0.5, 0.99, 1.0].map(|fraction| quantile(&trips, fraction));
    let [Some(median), Some(p99), Some(max)] = quantiles else {
        return fail("no round trips");
    };
    exchange.latency_ms = Some([median, p99, max]);
    let allowed = trips::longest_ms(device.watchdog_ms);
    let line_ms = trips::line_ms(exchange);
    let seen = format!("median {median:.2} ms, 99 % {p99:.2} ms, at most {max:.2} ms");
    if median > REPLY_MS + line_ms + ADAPTER_MS {
        fail(format!(
            "{seen}: the line needs {line_ms:.1} ms and an adapter up to {ADAPTER_MS} ms, so that replies take more than the {REPLY_MS} ms of 11.1; set the latency timer of an FTDI adapter to 1 ms"
        ))
    } else if p99 <= allowed {
        Ok(seen)
    } else {
        fail(format!(
            "{seen}: more than a third of the watchdog time; set the latency timer of an FTDI adapter to 1 ms"
        ))
    }
}

fn bad_frames(exchange: &mut Exchange<'_>) -> ClauseResult {
    let before = exchange.outcome()?.bad_frames;
    let sequence = exchange.next_sequence();
    let mut bytes = Request::State.frame(sequence).as_bytes().to_vec();
    // Changes the first byte of the body without producing a zero.
    bytes[2] ^= if bytes[2] == 0x40 { 0x20 } else { 0x40 };
    if exchange.send(&bytes, sequence, RETRY_INTERVAL)?.is_some() {
        return fail("a frame with a wrong CRC was answered");
    }
    match exchange.outcome()?.bad_frames.wrapping_sub(before) {
        1 => Ok("dropped, counted once".to_owned()),
        n => fail(format!("counted {n} times")),
    }
}

fn noise(exchange: &mut Exchange<'_>) -> ClauseResult {
    let pieces: [&[u8]; 5] = [
        &[0xFF; 700],
        &[0, 1, 0, 0, 5, 1, 0],
        &[0x55],
        &[2, 0, 3, 0],
        &[0xAA; 300],
    ];
    for piece in pieces {
        let sequence = exchange.next_sequence();
        let mut bytes = piece.to_vec();
        bytes.extend_from_slice(Request::State.frame(sequence).as_bytes());
        if exchange.send(&bytes, sequence, RETRY_INTERVAL)?.is_none() {
            let length = piece.len();
            let nothing = || format!("no answer to the frame after {length} bytes of noise");
            return fail(exchange.take_malformed().unwrap_or_else(nothing));
        }
    }
    Ok(format!("{} kinds of noise", pieces.len()))
}

/// Sends a body as a frame and returns the refusal, if there is an answer.
fn refusal_of(
    exchange: &mut Exchange<'_>,
    body: &[u8],
) -> Result<Option<(Refusal, u32)>, CheckFailure> {
    let sequence = exchange.next_sequence();
    let mut body = body.to_vec();
    body[2..4].copy_from_slice(&sequence.to_le_bytes());
    let frame = Frame::of(&body).map_err(|e| CheckFailure::violation(e.to_string()))?;
    let received = exchange.send(frame.as_bytes(), sequence, RETRY_INTERVAL)?;
    Ok(match received.map(|received| received.reply) {
        Some(Reply::Ack(ack)) => Some((ack.refusal, ack.detail)),
        Some(_) => Some((Refusal::None, 0)),
        None => None,
    })
}

fn expect_refusal_of(
    exchange: &mut Exchange<'_>,
    body: &[u8],
    reason: Refusal,
    what: &str,
) -> Result<(), CheckFailure> {
    match refusal_of(exchange, body)? {
        Some((refusal, _)) => same_refusal(refusal, reason, what),
        None => fail(format!("{what}: no answer")),
    }
}

fn same_refusal(found: Refusal, required: Refusal, what: &str) -> Result<(), CheckFailure> {
    if found == required {
        Ok(())
    } else {
        fail(format!("{what}: {found} instead of: {required}"))
    }
}

fn malformed(exchange: &mut Exchange<'_>) -> ClauseResult {
    for (what, body) in [
        ("REARM with a field", &[1, kind::REARM, 0, 0, 9][..]),
        ("STOP without its fields", &[1, kind::STOP, 0, 0]),
        (
            "a chunk of no nodes",
            &[1, kind::TABLE_CHUNK, 0, 0, 0, 0, 0],
        ),
        (
            "a heartbeat cut short",
            &[1, kind::HEARTBEAT, 0, 0, 1, 2, 3],
        ),
    ] {
        expect_refusal_of(exchange, body, Refusal::Malformed, what)?;
    }
    Ok("four messages".to_owned())
}

fn unknown_type(exchange: &mut Exchange<'_>) -> ClauseResult {
    for kind in [0x00, 0x0B, 0x7F] {
        let what = format!("type 0x{kind:02x}");
        expect_refusal_of(exchange, &[1, kind, 0, 0], Refusal::UnknownType, &what)?;
    }
    match refusal_of(exchange, &[1, 0xF0, 0, 0])? {
        None => Ok("three types refused; 0xf0 is dropped".to_owned()),
        Some(_) => fail("type 0xf0, a reply, is answered"),
    }
}

fn other_version(exchange: &mut Exchange<'_>) -> ClauseResult {
    match refusal_of(exchange, &[250, kind::STATE, 0, 0])? {
        Some((Refusal::Version, detail)) if (1..250).contains(&detail) => {
            Ok(format!("version 250: it supports {detail}"))
        }
        Some((refusal, detail)) => fail(format!("version 250: {refusal} ({detail})")),
        None => fail("version 250: no answer"),
    }
}

fn any_limp(exchange: &mut Exchange<'_>) -> ClauseResult {
    for body in [&[1, kind::LIMP, 0, 0, 1, 2, 3][..], &[77, kind::LIMP, 0, 0]] {
        exchange.reset()?;
        refusal_of(exchange, body)?;
        let state = exchange.outcome()?.state;
        if state != DeviceState::Limp {
            let (version, length) = (body[0], body.len());
            return fail(format!(
                "after a LIMP of version {version} and {length} bytes {state}"
            ));
        }
    }
    Ok("in version 77, and with three additional bytes".to_owned())
}

fn repeats(exchange: &mut Exchange<'_>) -> ClauseResult {
    let table = Upload::passive(exchange, 0.0)?;
    exchange.expect_done(Request::TableBegin(table.begin))?;
    let chunks = table.chunks();
    let sequence = exchange.next_sequence();
    let first = chunks[0].frame(sequence);
    let mut replies = Vec::new();
    for _ in 0..3 {
        match exchange.send(first.as_bytes(), sequence, RETRY_INTERVAL)? {
            Some(received) => replies.push(received.body),
            None => return fail("a repeat is not answered"),
        }
    }
    if replies.iter().any(|body| *body != replies[0]) {
        return fail("the reply to a repeat differs");
    }
    // Other bytes with the same number.
    let other = chunks[1].frame(sequence);
    let received = exchange.send(other.as_bytes(), sequence, RETRY_INTERVAL)?;
    match received.map(|received| received.reply) {
        Some(Reply::Ack(ack)) if ack.refusal == Refusal::Reused => {}
        _ => return fail("other bytes with a used number are not refused"),
    }
    let overtaken = sequence.wrapping_sub(1);
    let frame = chunks[1].frame(overtaken);
    if (exchange.send(frame.as_bytes(), overtaken, RETRY_INTERVAL)?).is_some() {
        return fail("an overtaken request is answered");
    }
    // If the chunk was executed once, the table is complete now.
    exchange.expect_done(chunks[1])?;
    exchange.expect_done(table.commit())?;
    Ok("the same bytes three times, other bytes, and an old number".to_owned())
}

fn another_connection(exchange: &mut Exchange<'_>) -> ClauseResult {
    Upload::passive(exchange, 0.0)?.load(exchange)?;
    let Identity { state, fault, .. } = exchange.hello()?;
    if state != DeviceState::Limp || fault != Fault::NewConnection {
        return fail(format!("{state}: {fault}"));
    }
    Ok(fault.to_string())
}

fn latched(exchange: &mut Exchange<'_>) -> ClauseResult {
    let table = Upload::passive(exchange, 0.0)?;
    table.load(exchange)?;
    exchange.limp()?;
    exchange.expect_refusal(Request::TableBegin(table.begin), Refusal::WrongState)?;
    let play = Request::Play(table.play(exchange, 1000));
    exchange.expect_refusal(play, Refusal::WrongState)?;
    // Waiting does not lead out either.
    exchange.wait(Duration::from_secs(1))?;
    let state = exchange.outcome()?.state;
    if state != DeviceState::Limp {
        return fail(format!("a second later {state}"));
    }
    exchange.reset()?;
    // The table is no longer loaded.
    exchange.expect_refusal(play, Refusal::WrongState)?;
    Ok("upload and PLAY refused; after REARM the table is gone".to_owned())
}

/// Sends a heartbeat and returns whether the device counts it as fresh.
fn beat(exchange: &mut Exchange<'_>, count: u32, deadline_ms: u32) -> Result<bool, CheckFailure> {
    let beat = Heartbeat { count, deadline_ms };
    match exchange.ask(Request::Heartbeat(beat))?.reply {
        Reply::Pulse(pulse) => Ok(pulse.fresh),
        other => unexpected(Request::Heartbeat(beat), &other),
    }
}

fn stale_heartbeats(exchange: &mut Exchange<'_>) -> ClauseResult {
    exchange.sends_heartbeats = false;
    let now_ms = exchange.outcome()?.clock_ms;
    let newest = exchange.beat_count().wrapping_add(1000);
    // What is sent, its distance from the newest heartbeat, its time to live, ms.
    for (what, after, ahead_ms, fresh) in [
        ("a new heartbeat", 0, 200, true),
        ("a repeated heartbeat", 0, 200, false),
        ("an older heartbeat", -1, 200, false),
        ("an expired heartbeat", 1, -1, false),
        (
            "a heartbeat with a deadline in the far future",
            2,
            60_000,
            false,
        ),
        ("the next heartbeat", 3, 200, true),
    ] {
        let count = newest.wrapping_add_signed(after);
        if beat(exchange, count, now_ms.wrapping_add_signed(ahead_ms))? != fresh {
            let not = if fresh { "not " } else { "" };
            return fail(format!("{what} is {not}fresh"));
        }
    }
    Ok("six heartbeats".to_owned())
}

fn no_heartbeat(exchange: &mut Exchange<'_>) -> ClauseResult {
    let table = Upload::passive(exchange, 0.0)?;
    exchange.sends_heartbeats = false;
    // A new connection has received no heartbeat.
    let hello = exchange.hello()?;
    if hello.state != DeviceState::Idle {
        return fail(hello.state);
    }
    exchange.wait(Duration::from_millis(u64::from(hello.watchdog_ms) + 20))?;
    table.send(exchange)?;
    exchange.expect_refusal(table.commit(), Refusal::NoHeartbeat)?;
    Ok("COMMIT refused".to_owned())
}

fn order(exchange: &mut Exchange<'_>) -> ClauseResult {
    let table = Upload::with_nodes(exchange, 0.0, 8)?;
    exchange.expect_done(Request::TableBegin(table.begin))?;
    let chunks = table.chunks();
    exchange.expect_done(chunks[0])?;
    exchange.expect_refusal(chunks[2], Refusal::Order)?;
    exchange.expect_refusal(chunks[0], Refusal::Order)?;
    exchange.expect_refusal(table.commit(), Refusal::Incomplete)?;
    exchange.expect_done(chunks[1])?;
    exchange.expect_done(chunks[2])?;
    if let Request::TableChunk(last) = chunks[2] {
        let one_more = TableChunk {
            first: table.begin.nodes,
            ..last
        };
        exchange.expect_refusal(Request::TableChunk(one_more), Refusal::TooMany)?;
    }
    exchange.expect_done(table.commit())?;
    Ok("the nodes before are kept".to_owned())
}

fn checksum(exchange: &mut Exchange<'_>) -> ClauseResult {
    let table = Upload::passive(exchange, 0.0)?;
    table.send(exchange)?;
    let crc = table.crc() ^ 1;
    let wrong = message::Commit { crc };
    exchange.expect_refusal(Request::TableCommit(wrong), Refusal::Checksum)?;
    let state = exchange.outcome()?.state;
    if state != DeviceState::Idle {
        return fail(state);
    }
    table.load(exchange)?;
    Ok("refused, and accepted with the correct CRC".to_owned())
}

fn bad_tables(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let mut count = 0;
    let mut refused = |reason, what, damage: &dyn Fn(&mut Upload)| {
        let mut table = Upload::passive(exchange, 0.0)?;
        damage(&mut table);
        table.send(exchange)?;
        count += 1;
        same_refusal(exchange.ack(table.commit())?.refusal, reason, what)
    };
    refused(
        Refusal::BadTable,
        "a parameter that is not a number",
        &|t| {
            t.nodes[1].positive[3] = f64::NAN;
        },
    )?;
    refused(Refusal::BadTable, "an infinite parameter", &|t| {
        t.nodes[2].negative[0] = f64::INFINITY;
    })?;
    refused(Refusal::BadTable, "positions that do not ascend", &|t| {
        t.nodes[2].x_mm = t.nodes[1].x_mm;
    })?;
    refused(Refusal::BadTable, "one node", &|t| {
        t.nodes.truncate(1);
        t.begin.nodes = 1;
    })?;
    refused(Refusal::BadTable, "an empty range", &|t| {
        t.begin.range_mm.swap(0, 1);
    })?;
    refused(Refusal::Limit, "a force limit above the device's", &|t| {
        t.begin.force_n = 1.01 * device.force_n;
    })?;
    refused(Refusal::Limit, "a force limit that is not a number", &|t| {
        t.begin.force_n = f64::NAN;
    })?;
    refused(
        Refusal::Limit,
        "a velocity limit above the device's",
        &|t| {
            t.begin.velocity_mm_s = 1.01 * device.velocity_mm_s;
        },
    )?;
    refused(Refusal::Limit, "a range beyond the stroke", &|t| {
        t.begin.range_mm[1] = device.stroke_mm[1] + 1.0;
    })?;
    refused(Refusal::Limit, "a damping above the device's", &|t| {
        for node in &mut t.nodes {
            node.positive[1] = 2.0 * device.damping_n_s_per_mm;
            node.negative[1] = 2.0 * device.damping_n_s_per_mm;
        }
    })?;
    Ok(format!("{count} tables"))
}

fn uncertified(exchange: &mut Exchange<'_>) -> ClauseResult {
    let mut table = Upload::uncertified(exchange)?;
    table.send(exchange)?;
    exchange.expect_refusal(table.commit(), Refusal::Uncertified)?;
    let cap_n = 0.5 * table.begin.force_n;
    table.begin.uncertified_n = Some(cap_n);
    table.load(exchange)?;
    let limit_n = exchange.outcome()?.limit_n;
    if (limit_n - cap_n).abs() > 1e-9 {
        return fail(format!("with a cap of {cap_n} N its limit is {limit_n} N"));
    }
    // A table that passes is not capped.
    let mut table = Upload::passive(exchange, 0.0)?;
    table.begin.uncertified_n = Some(cap_n);
    table.load(exchange)?;
    let (limit_n, force_n) = (exchange.outcome()?.limit_n, table.begin.force_n);
    if (limit_n - force_n).abs() > 1e-9 {
        return fail(format!(
            "a passive table is limited to {limit_n} N instead of {force_n} N"
        ));
    }
    Ok(format!("refused; with permission capped at {cap_n} N"))
}

fn largest(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let table = Upload::with_nodes(exchange, 0.0, device.max_nodes)?;
    let begin = exchange.now();
    table.send(exchange)?;
    let sent = exchange.now();
    exchange.expect_done(table.commit())?;
    let validated = exchange.now();
    let seconds = |from: Duration, to: Duration| to.saturating_sub(from).as_secs_f64();
    let (upload_s, commit_ms) = (seconds(begin, sent), 1e3 * seconds(sent, validated));
    let [median_ms, ..] = exchange.latency_ms.unwrap_or([0.0; 3]);
    let seen = format!(
        "{} nodes uploaded in {upload_s:.2} s, validated in {commit_ms:.1} ms",
        device.max_nodes
    );
    // The round trip of the link is allowed in addition.
    if commit_ms <= 50.0 + 2.0 * median_ms + 2.0 {
        Ok(seen)
    } else {
        fail(seen)
    }
}

fn wrong_play(exchange: &mut Exchange<'_>) -> ClauseResult {
    let device = exchange.identity()?;
    let table = Upload::passive(exchange, 0.0)?;
    table.load(exchange)?;
    let play = table.play(exchange, 1000);
    let other = message::Play {
        crc: play.crc ^ 1,
        ..play
    };
    exchange.expect_refusal(Request::Play(other), Refusal::OtherTable)?;
    for longest_ms in [0, device.longest_ms.saturating_add(1)] {
        let endless = message::Play { longest_ms, ..play };
        exchange.expect_refusal(Request::Play(endless), Refusal::Duration)?;
    }
    Ok("another table, 0 ms, and more than the longest duration".to_owned())
}
