//! What is wrong with bytes that are no reply, in words: a device that answers wrongly is not
//! one that does not answer.

use study_wire::message::{Reply, Request, WireError, kind};

/// Bytes of a header.
const HEADER: usize = 4;

/// A number in a reply: its offset behind the header, what it is, and whether it may be −∞.
type Number = (usize, &'static str);

/// The numbers of IDENTITY (docs/wire.md, §12).
const IDENTITY: [Number; 17] = [
    (25, "servo rate"),
    (33, "telemetry rate"),
    (41, "force limit"),
    (49, "velocity limit"),
    (57, "stiffness limit"),
    (65, "damping limit"),
    (73, "stroke"),
    (81, "stroke"),
    (160, "acceleration filter"),
    (168, "least mass"),
    (176, "added damping"),
    (184, "wall"),
    (192, "damping of the wall"),
    (200, "overtravel"),
    (208, "jump"),
    (216, "slew limit"),
    (224, "ramp"),
];

/// The numbers of OUTCOME.
const OUTCOME: [Number; 5] = [
    (43, "energy"),
    (51, "smallest energy"),
    (59, "largest force"),
    (67, "roughness"),
    (75, "force limit"),
];

/// Why a body is no reply.
pub(super) fn why(body: &[u8], error: WireError) -> String {
    let own = body.get(1).copied().unwrap_or(0);
    let name = kind::name(own);
    match error {
        WireError::Field => {
            let numbers: &[Number] = match own {
                kind::IDENTITY => &IDENTITY,
                kind::OUTCOME => &OUTCOME,
                _ => &[],
            };
            match numbers.iter().find_map(|number| strange(body, *number)) {
                Some(found) => format!("{name} is malformed: its {found}"),
                None => format!("{name} is malformed: a field or code of it is invalid"),
            }
        }
        WireError::Length => format!("{name} is malformed: it has {} bytes", body.len()),
        other => format!("a reply is malformed: {other}"),
    }
}

/// A number that cannot be one.
fn strange(body: &[u8], (offset, what): Number) -> Option<String> {
    let bytes = body.get(HEADER + offset..)?.first_chunk()?;
    let value = f64::from_le_bytes(*bytes);
    let rate = matches!(offset, 25 | 41 | 49 | 57 | 65 | 160 | 216);
    if value.is_nan() {
        Some(format!("{what} is not a number"))
    } else if value.is_infinite() && what != "least mass" {
        Some(format!("{what} is infinite"))
    } else if value <= 0.0 && rate && body.get(1) == Some(&kind::IDENTITY) {
        Some(format!("{what} is {value}, and not above 0"))
    } else {
        None
    }
}

/// Whether a reply is one to a request, apart from its sequence number.
pub(super) fn answers(request: &Request, reply: &Reply) -> bool {
    match (request, reply) {
        (Request::Hello(_), Reply::Identity(_))
        | (Request::State, Reply::Outcome(_))
        | (Request::Heartbeat(_), Reply::Pulse(_)) => true,
        (_, Reply::Ack(ack)) => ack.request == request.kind(),
        _ => false,
    }
}
