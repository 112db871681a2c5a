//! A table as the requests that carry it.

use study_base::limits::Limits;
use study_haptics::model::{Branch, Realization};
use study_wire::message::{Commit, Few, Identity, Node, Request, TableBegin, TableChunk, TableCrc};

/// The requests of an upload, in their order, and the CRC over the whole.
#[derive(Debug)]
pub(super) struct Upload {
    pub(super) requests: Vec<Request>,
    pub(super) crc: u32,
}

/// A table that was checked, under limits. One that fails its certificate or is
/// stiffer than the device renders is armed for the force limit if that is
/// permitted; else the device refuses it.
pub(super) fn of(
    table: &Realization,
    limits: Limits,
    permitted: bool,
    device: &Identity,
) -> Result<Upload, String> {
    let count = table.x_mm.len();
    let nodes = u16::try_from(count).map_err(|_| format!("it has {count} nodes"))?;
    let certificate = table.certificate();
    let sound = certificate.passes()
        && certificate.stiffness_n_per_mm <= device.stiffness_n_per_mm
        && certificate.damping_n_s_per_mm <= device.damping_n_s_per_mm;
    let armed = permitted && !sound;
    let begin = TableBegin {
        nodes,
        lookup: table.lookup,
        direction: table.direction,
        range_mm: table.trained.x_mm,
        trained_mm_s: table.trained.v_mm_s,
        force_n: limits.force_n.get(),
        velocity_mm_s: limits.velocity_mm_s.get(),
        uncertified_n: armed.then(|| limits.force_n.get()),
    };
    let all: Vec<Node> = (0..count)
        .map(|i| Node {
            x_mm: table.x_mm[i],
            positive: parameters(&table.positive, i),
            negative: parameters(&table.negative, i),
        })
        .collect();
    let mut crc = TableCrc::of(&begin);
    for node in &all {
        crc.node(node);
    }
    let crc = crc.value();
    let mut requests = vec![Request::TableBegin(begin)];
    for (i, nodes) in all.chunks(TableChunk::MOST).enumerate() {
        requests.push(Request::TableChunk(TableChunk {
            // fewer than 65,536 nodes
            first: (i * TableChunk::MOST) as u16,
            nodes: Few::of(nodes),
        }));
    }
    requests.push(Request::TableCommit(Commit { crc }));
    Ok(Upload { requests, crc })
}

fn parameters(branch: &Branch, node: usize) -> [f64; 4] {
    [
        &branch.m_kg,
        &branch.b_n_s_per_mm,
        &branch.k_n_per_mm,
        &branch.f0_n,
    ]
    .map(|values| values[node])
}

/// A request in words.
pub(super) fn word(request: &Request) -> &'static str {
    match request {
        Request::Hello(_) => "the greeting",
        Request::TableBegin(_) | Request::TableChunk(_) | Request::TableCommit(_) => "the table",
        Request::Play(_) => "the start",
        Request::Stop(_) => "the stop",
        Request::Limp => "the command to be limp",
        Request::Heartbeat(_) => "a heartbeat",
        Request::Rearm => "to be armed again",
        Request::State => "the question how it is",
        Request::PathBegin(_) | Request::PathChunk(_) | Request::PathCommit(_) => "the path",
        Request::Record(_) => "the recording",
    }
}
