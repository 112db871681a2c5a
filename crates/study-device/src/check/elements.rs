//! Test of elements, which a device may play from minor version 2 on.

use super::exchange::Exchange;
use super::playing::peak_of;
use super::{ClauseResult, FORCE_N, fail};
use crate::host::upload::{Upload, elements_requests};
use study_wire::elements::{MAX_SPRINGS, Spring};
use study_wire::message::{
    Commit, ElementsBegin, FixedVec, Identity, MINOR, Node, Refusal, Request,
};

/// Nodes of the realization.
const NODES: u16 = 9;
/// Force of each spring, N.
const SPRING_N: f64 = 0.1;

/// The values of a node: C, both dampings, the springs.
type Values = [f64; 3 + MAX_SPRINGS];
/// Makes elements wrong.
type Change = fn(&mut ElementsBegin, &mut [Values]);

pub(super) fn plays(exchange: &mut Exchange<'_>) -> ClauseResult {
    let first = |device: &Identity| upload(device, |_, _| ()).requests[0];
    let device = exchange.identity()?;
    // The connection is one of minor version 0.
    exchange.expect_refusal(first(&device), Refusal::UnknownType)?;
    let told = exchange.hello_of(MINOR);
    let known = told.is_ok_and(|device| device.constants.is_some_and(|c| c.features.elements));
    if !known {
        exchange.expect_refusal(first(&device), Refusal::UnknownType)?;
        return Ok("no elements; they are refused".to_owned());
    }
    exchange.first_heartbeat()?;
    let refused: [(Refusal, &str, Change); 6] = [
        (Refusal::BadTable, "a stop of no length", |begin, _| {
            begin.springs = FixedVec::of(&[Spring::Stop { slip_mm: 0.0 }]);
        }),
        (
            Refusal::BadTable,
            "a value that is not a number",
            |_, values| {
                values[2][0] = f64::NAN;
            },
        ),
        (Refusal::Uncertified, "a negative mass", |begin, _| {
            begin.mass_kg = -0.1;
        }),
        (Refusal::Uncertified, "a negative damping", |_, values| {
            values[3][2] = -0.001;
        }),
        (
            Refusal::Uncertified,
            "a spring of negative force",
            |_, values| {
                values[4][3] = -0.1;
            },
        ),
        (
            Refusal::Uncertified,
            "a latch that releases nothing",
            |_, values| {
                values.iter_mut().for_each(|node| node[5] = 0.0);
                values[NODES as usize - 1][5] = SPRING_N;
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
    let wrong = Request::TableCommit(Commit { crc: !upload.crc });
    exchange.expect_refusal(wrong, Refusal::Checksum)?;
    exchange.expect_sent(&upload)?;
    exchange.expect_done(commit(&upload))?;
    let peak_n = peak_of(exchange, upload.crc, FORCE_N.min(device.force_n))?;
    Ok(format!(
        "{} refused, one played; force up to {peak_n:.2} N",
        refused.len()
    ))
}

fn commit(upload: &Upload) -> Request {
    Request::TableCommit(Commit { crc: upload.crc })
}

/// Elements of every kind, within the device's limits, after a change.
fn upload(device: &Identity, change: Change) -> Upload {
    let [low, high] = device.stroke_mm;
    let margin_mm = 0.1 * (high - low);
    let range_mm = [low + margin_mm, high - margin_mm];
    let step_mm = (range_mm[1] - range_mm[0]) / f64::from(NODES - 1);
    let long_mm = 10.0 * SPRING_N / device.stiffness_n_per_mm;
    let mut begin = ElementsBegin {
        nodes: NODES,
        mass_kg: 0.0,
        range_mm,
        trained_mm_s: 100.0,
        force_n: FORCE_N.min(device.force_n),
        velocity_mm_s: device.velocity_mm_s,
        uncertified_n: None,
        springs: FixedVec::of(&[
            Spring::Stop { slip_mm: long_mm },
            Spring::Maxwell {
                slip_mm: long_mm,
                relaxation_s: 0.1,
            },
            Spring::Latch {
                rearm_mm: range_mm[0] + 3.0 * step_mm,
                break_mm: range_mm[0] + 5.0 * step_mm,
            },
        ]),
    };
    let damping = 0.1 * device.damping_n_s_per_mm;
    let own = [
        0.0, damping, damping, SPRING_N, SPRING_N, SPRING_N, 0.0, 0.0,
    ];
    let mut values = vec![own; usize::from(NODES)];
    change(&mut begin, &mut values);
    let nodes: Vec<Node> = (values.iter().enumerate())
        .map(|(i, values)| Node::of_elements(range_mm[0] + i as f64 * step_mm, *values))
        .collect();
    elements_requests(begin, &nodes)
}
