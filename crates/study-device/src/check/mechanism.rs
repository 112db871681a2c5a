//! Test of mechanisms, which a device may play from minor version 2 on.

use super::exchange::Exchange;
use super::playing::peak_of;
use super::{ClauseResult, FORCE_N, fail};
use crate::host::upload::{Upload, mechanism_requests};
use study_wire::mechanism::Scalars;
use study_wire::message::{Commit, Identity, MINOR, MechanismBegin, Refusal, Request};

/// Intervals of both profiles.
const INTERVALS: u16 = 8;
/// Friction of the follower, N.
const FRICTION_N: f64 = 0.2;

pub(super) fn plays(exchange: &mut Exchange<'_>) -> ClauseResult {
    let first = |device: &Identity| upload(device, |_, _| ()).requests[0];
    let device = exchange.identity()?;
    // The connection is one of minor version 0.
    exchange.expect_refusal(first(&device), Refusal::UnknownType)?;
    let told = exchange.hello_of(MINOR);
    let known = told.is_ok_and(|device| device.constants.is_some_and(|c| c.features.mechanism));
    if !known {
        exchange.expect_refusal(first(&device), Refusal::UnknownType)?;
        return Ok("tables only; a mechanism is refused".to_owned());
    }
    exchange.first_heartbeat()?;
    let refused: [(Refusal, &str, Change); 5] = [
        (Refusal::BadTable, "no mass of the follower", |begin, _| {
            begin.scalars.follower_kg = 0.0;
        }),
        (Refusal::BadTable, "a negative friction", |_, values| {
            values[12] = -1.0;
        }),
        (
            Refusal::BadTable,
            "a value that is not a number",
            |_, values| {
                values[0] = f64::NAN;
            },
        ),
        (
            Refusal::Uncertified,
            "a friction that rises from 0",
            |begin, values| {
                begin.scalars.slip_mm = 2.0 * begin.friction_mm[1];
                values[9] = 0.0;
            },
        ),
        (
            Refusal::Limit,
            "a contact above the device's stiffness",
            |begin, _| {
                begin.scalars.contact_n_per_mm *= 4.0;
            },
        ),
    ];
    for (refusal, what, change) in refused {
        let upload = upload(&device, change);
        exchange.expect_sent(&upload)?;
        let found = exchange.ack(commit(&upload))?.refusal;
        if found != refusal {
            return fail(format!("{what}: {found} instead of {refusal}"));
        }
    }
    let upload = upload(&device, |_, _| ());
    exchange.expect_sent(&upload)?;
    let wrong = Request::MechanismCommit(Commit { crc: !upload.crc });
    exchange.expect_refusal(wrong, Refusal::Checksum)?;
    exchange.expect_sent(&upload)?;
    exchange.expect_done(commit(&upload))?;
    let peak_n = peak_of(exchange, upload.crc, FORCE_N.min(device.force_n))?;
    Ok(format!(
        "{} refused, one played; force up to {peak_n:.2} N",
        refused.len()
    ))
}

/// Makes a mechanism wrong.
type Change = fn(&mut MechanismBegin, &mut [f64]);

fn commit(upload: &Upload) -> Request {
    Request::MechanismCommit(Commit { crc: upload.crc })
}

/// A mechanism of friction alone, within the device's limits, after a change.
fn upload(device: &Identity, change: Change) -> Upload {
    let [low, high] = device.stroke_mm;
    let margin = 0.1 * (high - low);
    let range_mm = [low + margin, high - margin];
    let step_mm = (range_mm[1] - range_mm[0]) / f64::from(INTERVALS);
    let damping = 0.1 * device.damping_n_s_per_mm;
    let mut begin = MechanismBegin {
        detents: INTERVALS + 1,
        frictions: INTERVALS + 1,
        detent_mm: [range_mm[0], step_mm],
        friction_mm: [range_mm[0], step_mm],
        range_mm,
        trained_mm_s: 100.0,
        force_n: FORCE_N.min(device.force_n),
        velocity_mm_s: device.velocity_mm_s,
        uncertified_n: None,
        scalars: Scalars {
            handle_kg: 0.0,
            follower_kg: 0.05,
            contact_n_per_mm: 0.3 * device.stiffness_n_per_mm,
            contact_n_s_per_mm: damping,
            gap_mm: 0.2,
            follower_n_s_per_mm: 0.005,
            slip_mm: 0.05,
            stribeck: 0.2,
            stribeck_mm_s: 10.0,
            handle_n: 0.0,
            handle_slip_mm: 0.05,
            handle_n_s_per_mm: damping,
            offset_n: 0.0,
        },
    };
    let values = usize::from(INTERVALS) + 1;
    let mut values_n = [vec![0.0; values], vec![FRICTION_N; values]].concat();
    change(&mut begin, &mut values_n);
    mechanism_requests(begin, &values_n)
}
