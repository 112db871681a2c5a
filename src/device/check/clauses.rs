//! The clauses that can be seen from outside, in the order in which they are looked
//! at: first what costs nothing, then uploads, then playbacks.

use super::playing;
use super::talk::{Talk, name};
use super::uploads::Upload;
use super::{Broken, Clause, FORCE_N, Kept, percentile};
use crate::device::host::RETRY;
use std::time::Duration;
use study_wire::frame::Frame;
use study_wire::message::{
    self, Fault, Heartbeat, Identity, Refusal, Reply, Request, State, TableChunk, kind,
};

macro_rules! clauses {
    ($($clause:literal $what:literal $look:expr;)+) => {
        /// All of them.
        pub(super) const ALL: &[Clause] = &[
            $(Clause { clause: $clause, what: $what, look: $look },)+
        ];
    };
}

clauses! {
    "14.3" "HELLO is answered by an IDENTITY that makes sense, in a common version" handshake;
    "11.1" "round trips fit the watchdog" latency;
    "2.3" "a frame with a wrong CRC is dropped and counted" bad_frames;
    "2.4" "after noise the next frame is understood" noise;
    "3.1" "a message of the wrong length is refused" malformed;
    "3.2" "an unknown type is refused" unknown_type;
    "3.3" "another version is refused" other_version;
    "3.4" "LIMP is done whatever its version and length" any_limp;
    "4.3" "a repeated request is answered again and not done again" repeats;
    "4.5" "another connection makes it limp" another_connection;
    "5.2" "limp is latched: only REARM leads out" latched;
    "6.1" "an old heartbeat and one past its deadline are not fresh" stale_beats;
    "6.4" "nothing is armed without a heartbeat" no_heartbeat;
    "8.1" "chunks out of order and halves of tables are refused" order;
    "8.2" "a table with a wrong CRC is refused" checksum;
    "8.3" "tables that cannot be evaluated and limits above its own are refused" bad_tables;
    "8.4" "a table that fails its certificate is refused unless armed, and then capped" uncertified;
    "11.2" "the largest table goes up and is judged in time" largest;
    "12" "PLAY of another table, or for no time, is refused" wrong_play;
    "9.1" "telemetry is whole, at the rate that was asked for" playing::telemetry;
    "7.5" "the force comes up slowly and never exceeds its limit" playing::clamp;
    "11.3" "STOP is zero force at once" playing::stop;
    "5.1" "LIMP is zero force at once" playing::limp;
    "12" "a playback that nobody ends, ends" playing::longest;
    "6.3" "without heartbeats it is limp in time, and stays so" playing::watchdog;
    "6.2" "a heartbeat of a dead host is good until its deadline only" playing::deadline;
}

/// How many round trips are measured.
const TRIPS: usize = 300;

/// Whoever was there before: no force while we look around.
pub(super) fn introduce(talk: &mut Talk<'_>) -> Result<Identity, Broken> {
    let limp = Request::Limp.frame(0);
    let _ = talk.send(limp.as_bytes(), 0, RETRY)?;
    talk.hello()
}

fn handshake(talk: &mut Talk<'_>) -> Kept {
    let device = introduce(talk)?;
    let [oldest, newest] = device.versions;
    if !(oldest..=newest).contains(&message::VERSION) {
        return Err(Broken::Gone(format!(
            "it speaks versions {oldest} to {newest} and not {}",
            message::VERSION
        )));
    }
    let [low, high] = device.stroke_mm;
    let sense = [
        (device.watchdog_ms >= 10, "watchdog time under 10 ms"),
        (device.watchdog_ms <= 200, "watchdog time over 200 ms"),
        (device.servo_hz >= 4000.0, "servo under 4 kHz"),
        (device.most_nodes >= 2, "no room for a table"),
        (device.longest_ms > 0, "no playback may last"),
        (low < high, "a stroke that is none"),
        (device.state != State::Boot, "still in boot after HELLO"),
        (
            !device.flags.telemetry || device.telemetry_hz >= 1.0,
            "telemetry without a rate",
        ),
    ];
    match sense.iter().find(|(fine, _)| !fine) {
        Some((_, what)) => Err(Broken::seen(*what)),
        None => Ok(format!(
            "version {}, servo {} Hz, watchdog {} ms, {} N, {} mm/s, {} nodes",
            message::VERSION,
            device.servo_hz,
            device.watchdog_ms,
            device.force_n,
            device.velocity_mm_s,
            device.most_nodes
        )),
    }
}

fn latency(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let mut trips = Vec::new();
    for _ in 0..TRIPS {
        let sent = talk.now();
        let came = talk.ask(Request::State)?;
        trips.push(came.at.saturating_sub(sent).as_secs_f64() * 1e3);
    }
    trips.sort_by(f64::total_cmp);
    let most = trips.last().copied().unwrap_or(f64::NAN);
    let [median, p99] = [0.5, 0.99].map(|share| percentile(&trips, share));
    talk.latency_ms = Some([median, p99, most]);
    let allowed = f64::from(device.watchdog_ms) / 3.0;
    let seen = format!("median {median:.2} ms, 99 % {p99:.2} ms, at most {most:.2} ms");
    if p99 <= allowed {
        Ok(seen)
    } else {
        Err(Broken::seen(format!(
            "{seen}: more than a third of the watchdog time; an FTDI adapter wants its latency timer at 1 ms"
        )))
    }
}

fn bad_frames(talk: &mut Talk<'_>) -> Kept {
    let before = talk.outcome()?.bad_frames;
    let sequence = talk.next_sequence();
    let mut bytes = Request::State.frame(sequence).as_bytes().to_vec();
    // the first byte of the body; no zero comes of it
    bytes[2] ^= if bytes[2] == 0x40 { 0x20 } else { 0x40 };
    if talk.send(&bytes, sequence, RETRY)?.is_some() {
        return Err(Broken::seen("a frame with a wrong CRC was answered"));
    }
    match talk.outcome()?.bad_frames.wrapping_sub(before) {
        1 => Ok("dropped, counted once".to_owned()),
        n => Err(Broken::seen(format!("counted {n} times"))),
    }
}

fn noise(talk: &mut Talk<'_>) -> Kept {
    let pieces: [&[u8]; 5] = [
        &[0xFF; 700],
        &[0, 1, 0, 0, 5, 1, 0],
        &[0x55],
        &[2, 0, 3, 0],
        &[0xAA; 300],
    ];
    for piece in pieces {
        let sequence = talk.next_sequence();
        let mut bytes = piece.to_vec();
        bytes.extend_from_slice(Request::State.frame(sequence).as_bytes());
        if talk.send(&bytes, sequence, RETRY)?.is_none() {
            return Err(Broken::seen(format!(
                "no answer to the frame after {} bytes of noise",
                piece.len()
            )));
        }
    }
    Ok(format!("{} kinds of noise", pieces.len()))
}

/// A body sent as a frame of its own; the refusal that comes back.
fn refusal_of(talk: &mut Talk<'_>, body: &[u8]) -> Result<Option<(Refusal, u32)>, Broken> {
    let sequence = talk.next_sequence();
    let mut body = body.to_vec();
    body[2..4].copy_from_slice(&sequence.to_le_bytes());
    let frame = Frame::of(&body).map_err(|e| Broken::seen(e.to_string()))?;
    let came = talk.send(frame.as_bytes(), sequence, RETRY)?;
    Ok(match came.map(|came| came.reply) {
        Some(Reply::Ack(ack)) => Some((ack.refusal, ack.detail)),
        Some(_) => Some((Refusal::None, 0)),
        None => None,
    })
}

fn has_to_be(talk: &mut Talk<'_>, body: &[u8], why: Refusal, what: &str) -> Result<(), Broken> {
    match refusal_of(talk, body)? {
        Some((refusal, _)) if refusal == why => Ok(()),
        Some((refusal, _)) => Err(Broken::seen(format!(
            "{what}: {}, and not: {}",
            refusal.as_str(),
            why.as_str()
        ))),
        None => Err(Broken::seen(format!("{what}: no answer"))),
    }
}

fn malformed(talk: &mut Talk<'_>) -> Kept {
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
        has_to_be(talk, body, Refusal::Malformed, what)?;
    }
    Ok("four of them".to_owned())
}

fn unknown_type(talk: &mut Talk<'_>) -> Kept {
    for kind in [0x00, 0x0B, 0x7F] {
        let what = format!("type 0x{kind:02x}");
        has_to_be(talk, &[1, kind, 0, 0], Refusal::UnknownType, &what)?;
    }
    match refusal_of(talk, &[1, 0xF0, 0, 0])? {
        None => Ok("three of them; 0xf0 is dropped".to_owned()),
        Some(_) => Err(Broken::seen("type 0xf0, which is for a host, is answered")),
    }
}

fn other_version(talk: &mut Talk<'_>) -> Kept {
    match refusal_of(talk, &[250, kind::STATE, 0, 0])? {
        Some((Refusal::Version, detail)) if (1..250).contains(&detail) => {
            Ok(format!("version 250: it speaks {detail}"))
        }
        Some((refusal, detail)) => Err(Broken::seen(format!(
            "version 250: {} ({detail})",
            refusal.as_str()
        ))),
        None => Err(Broken::seen("version 250: no answer")),
    }
}

fn any_limp(talk: &mut Talk<'_>) -> Kept {
    for body in [&[1, kind::LIMP, 0, 0, 1, 2, 3][..], &[77, kind::LIMP, 0, 0]] {
        talk.ready()?;
        refusal_of(talk, body)?;
        let state = talk.outcome()?.state;
        if state != State::Limp {
            return Err(Broken::seen(format!(
                "after a LIMP of version {} and {} bytes {}",
                body[0],
                body.len(),
                state.as_str()
            )));
        }
    }
    Ok("of version 77, and with three bytes behind it".to_owned())
}

fn repeats(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::sound(&device, 0.0);
    talk.done(Request::TableBegin(table.begin))?;
    let chunks = table.chunks();
    let sequence = talk.next_sequence();
    let first = chunks[0].frame(sequence);
    let mut replies = Vec::new();
    for _ in 0..3 {
        let came = talk.send(first.as_bytes(), sequence, RETRY)?;
        let came = came.ok_or_else(|| Broken::seen("a repeat is not answered"))?;
        replies.push(came.body);
    }
    if replies.iter().any(|body| *body != replies[0]) {
        return Err(Broken::seen("a repeat gets another reply"));
    }
    // other bytes under the same number
    let came = talk.send(chunks[1].frame(sequence).as_bytes(), sequence, RETRY)?;
    match came.map(|came| came.reply) {
        Some(Reply::Ack(ack)) if ack.refusal == Refusal::Reused => {}
        _ => {
            return Err(Broken::seen(
                "other bytes under a used number are not refused",
            ));
        }
    }
    // and one that was overtaken
    let old = sequence.wrapping_sub(1);
    if talk
        .send(chunks[1].frame(old).as_bytes(), old, RETRY)?
        .is_some()
    {
        return Err(Broken::seen("an overtaken request is answered"));
    }
    // done once: the table is whole now
    talk.done(chunks[1])?;
    talk.done(table.commit())?;
    Ok("the same bytes three times, other bytes, and an old number".to_owned())
}

fn another_connection(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    Upload::sound(&device, 0.0).load(talk)?;
    let identity = talk.hello()?;
    if identity.state != State::Limp || identity.fault != Fault::NewConnection {
        return Err(Broken::seen(format!(
            "{}: {}",
            identity.state.as_str(),
            identity.fault.as_str()
        )));
    }
    Ok(identity.fault.as_str().to_owned())
}

fn latched(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::sound(&device, 0.0);
    table.load(talk)?;
    talk.limp()?;
    talk.refused(Request::TableBegin(table.begin), Refusal::WrongState)?;
    let play = table.play(talk, 1000, 0);
    talk.refused(play, Refusal::WrongState)?;
    // nor does time lead out
    talk.pass(Duration::from_secs(1))?;
    let state = talk.outcome()?.state;
    if state != State::Limp {
        return Err(Broken::seen(format!("a second later {}", state.as_str())));
    }
    talk.ready()?;
    // the table is forgotten
    let play = table.play(talk, 1000, 0);
    talk.refused(play, Refusal::WrongState)?;
    Ok("upload and PLAY refused; after REARM the table is gone".to_owned())
}

/// A heartbeat that is answered: was it fresh?
fn beat(talk: &mut Talk<'_>, count: u32, deadline_ms: u32) -> Result<bool, Broken> {
    let beat = Heartbeat { count, deadline_ms };
    match talk.ask(Request::Heartbeat(beat))?.reply {
        Reply::Pulse(pulse) => Ok(pulse.fresh),
        other => Err(Broken::seen(format!(
            "HEARTBEAT is answered by {}",
            name(other.kind())
        ))),
    }
}

fn stale_beats(talk: &mut Talk<'_>) -> Kept {
    talk.beating = false;
    let now_ms = talk.outcome()?.clock_ms;
    let newest = talk.beat_count().wrapping_add(1000);
    let soon = now_ms.wrapping_add(200);
    for (what, count, deadline_ms, fresh) in [
        ("a new one", newest, soon, true),
        ("the same again", newest, soon, false),
        ("an older one", newest.wrapping_sub(1), soon, false),
        (
            "one past its deadline",
            newest.wrapping_add(1),
            now_ms.wrapping_sub(1),
            false,
        ),
        (
            "one of the far future",
            newest.wrapping_add(2),
            now_ms.wrapping_add(60_000),
            false,
        ),
        ("the next", newest.wrapping_add(3), soon, true),
    ] {
        if beat(talk, count, deadline_ms)? != fresh {
            let not = if fresh { "not " } else { "" };
            return Err(Broken::seen(format!("{what} is {not}fresh")));
        }
    }
    Ok("six of them".to_owned())
}

fn no_heartbeat(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::sound(&device, 0.0);
    talk.beating = false;
    // a new connection knows of no heartbeat
    let hello = talk.hello()?;
    if hello.state != State::Idle {
        return Err(Broken::seen(hello.state.as_str()));
    }
    talk.pass(Duration::from_millis(u64::from(device.watchdog_ms) + 20))?;
    table.send(talk)?;
    talk.refused(table.commit(), Refusal::NoHeartbeat)?;
    Ok("COMMIT refused".to_owned())
}

fn order(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::with_nodes(&device, 0.0, 8);
    talk.done(Request::TableBegin(table.begin))?;
    let chunks = table.chunks();
    talk.done(chunks[0])?;
    talk.refused(chunks[2], Refusal::Order)?;
    talk.refused(chunks[0], Refusal::Order)?;
    talk.refused(table.commit(), Refusal::Incomplete)?;
    talk.done(chunks[1])?;
    talk.done(chunks[2])?;
    if let Request::TableChunk(last) = chunks[2] {
        let one_more = TableChunk {
            first: table.begin.nodes,
            ..last
        };
        talk.refused(Request::TableChunk(one_more), Refusal::TooMany)?;
    }
    talk.done(table.commit())?;
    Ok("what came before stays".to_owned())
}

fn checksum(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::sound(&device, 0.0);
    table.send(talk)?;
    let wrong = message::Commit {
        crc: table.crc() ^ 1,
    };
    talk.refused(Request::TableCommit(wrong), Refusal::Checksum)?;
    let state = talk.outcome()?.state;
    if state != State::Idle {
        return Err(Broken::seen(state.as_str()));
    }
    table.load(talk)?;
    Ok("refused, and taken at the second try".to_owned())
}

fn bad_tables(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let sound = || Upload::sound(&device, 0.0);
    let mut cases: Vec<(&str, Upload, Refusal)> = Vec::new();
    let mut case = |what, why, damage: &dyn Fn(&mut Upload)| {
        let mut table = sound();
        damage(&mut table);
        cases.push((what, table, why));
    };
    case("a parameter that is no number", Refusal::BadTable, &|t| {
        t.nodes[1].positive[3] = f64::NAN;
    });
    case("an endless parameter", Refusal::BadTable, &|t| {
        t.nodes[2].negative[0] = f64::INFINITY;
    });
    case("positions that do not ascend", Refusal::BadTable, &|t| {
        t.nodes[2].x_mm = t.nodes[1].x_mm;
    });
    case("one node", Refusal::BadTable, &|t| {
        t.nodes.truncate(1);
        t.begin.nodes = 1;
    });
    case("a range that is none", Refusal::BadTable, &|t| {
        t.begin.range_mm.swap(0, 1);
    });
    case("a force limit above its own", Refusal::Limit, &|t| {
        t.begin.force_n = 1.01 * device.force_n;
    });
    case("a force limit that is no number", Refusal::Limit, &|t| {
        t.begin.force_n = f64::NAN;
    });
    case("a velocity limit above its own", Refusal::Limit, &|t| {
        t.begin.velocity_mm_s = 1.01 * device.velocity_mm_s;
    });
    case("a range beyond its stroke", Refusal::Limit, &|t| {
        t.begin.range_mm[1] = device.stroke_mm[1] + 1.0;
    });
    case("more damping than it renders", Refusal::Limit, &|t| {
        for node in &mut t.nodes {
            node.positive[1] = 2.0 * device.damping_n_s_per_mm;
            node.negative[1] = 2.0 * device.damping_n_s_per_mm;
        }
    });
    let count = cases.len();
    for (what, table, why) in cases {
        table.send(talk)?;
        let ack = talk.ack(table.commit())?;
        if ack.refusal != why {
            return Err(Broken::seen(format!(
                "{what}: {}, and not: {}",
                ack.refusal.as_str(),
                why.as_str()
            )));
        }
    }
    Ok(format!("{count} of them"))
}

fn uncertified(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let mut table = Upload::unsound(&device);
    table.send(talk)?;
    talk.refused(table.commit(), Refusal::Uncertified)?;
    let cap_n = 0.5 * table.begin.force_n;
    table.begin.uncertified_n = Some(cap_n);
    table.load(talk)?;
    let limit_n = talk.outcome()?.limit_n;
    if (limit_n - cap_n).abs() > 1e-9 {
        return Err(Broken::seen(format!(
            "armed with a cap of {cap_n} N, it allows itself {limit_n} N"
        )));
    }
    // one that passes is not capped
    let mut table = Upload::sound(&device, 0.0);
    table.begin.uncertified_n = Some(cap_n);
    table.load(talk)?;
    let limit_n = talk.outcome()?.limit_n;
    if (limit_n - table.begin.force_n).abs() > 1e-9 {
        return Err(Broken::seen(format!(
            "a sound table has {limit_n} N of {} N",
            table.begin.force_n
        )));
    }
    Ok(format!("refused; armed: capped at {cap_n} N"))
}

fn largest(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::with_nodes(&device, 0.0, device.most_nodes);
    let from = talk.now();
    table.send(talk)?;
    let up = talk.now();
    talk.done(table.commit())?;
    let judged = talk.now();
    let seconds = |from: Duration, to: Duration| to.saturating_sub(from).as_secs_f64();
    let (up_s, commit_ms) = (seconds(from, up), 1e3 * seconds(up, judged));
    let [median_ms, ..] = talk.latency_ms.unwrap_or([0.0; 3]);
    let seen = format!(
        "{} nodes up in {up_s:.2} s, judged in {commit_ms:.1} ms",
        device.most_nodes
    );
    // the link's own time is not the device's
    if commit_ms <= 50.0 + 2.0 * median_ms + 2.0 {
        Ok(seen)
    } else {
        Err(Broken::seen(seen))
    }
}

fn wrong_play(talk: &mut Talk<'_>) -> Kept {
    let device = talk.identity()?;
    let table = Upload::sound(&device, 0.0);
    table.load(talk)?;
    let Request::Play(play) = table.play(talk, 1000, 0) else {
        return Err(Broken::seen("no PLAY"));
    };
    let other = message::Play {
        crc: play.crc ^ 1,
        ..play
    };
    talk.refused(Request::Play(other), Refusal::OtherTable)?;
    for longest_ms in [0, device.longest_ms.saturating_add(1)] {
        let endless = message::Play { longest_ms, ..play };
        talk.refused(Request::Play(endless), Refusal::Duration)?;
    }
    Ok(format!("never more than {FORCE_N} N was asked for"))
}
