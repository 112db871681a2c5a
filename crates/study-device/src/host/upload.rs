//! Upload of a table or a mechanism as a sequence of requests.

use super::HEARTBEAT_INTERVAL;
use crate::Stimulus;
use crate::table::{self, TableError};
use std::time::Duration;
use study_base::limits::Limits;
use study_haptics::model::{Branch, Elements, Mechanism, Profile, Realization};
use study_wire::elements::MAX_SPRINGS;
use study_wire::message::{
    Commit, ElementsBegin, FixedVec, Identity, MechanismBegin, MechanismChunk, Node, Request,
    TableBegin, TableChunk, UploadCrc,
};

/// The requests of an upload in order, and the CRC of the table.
#[derive(Debug)]
pub(crate) struct Upload {
    pub(crate) requests: Vec<Request>,
    pub(crate) crc: u32,
}

/// The requests that upload these nodes.
pub(crate) fn requests(begin: TableBegin, nodes: &[Node]) -> Upload {
    with_nodes(
        Request::TableBegin(begin),
        UploadCrc::of_table(&begin),
        nodes,
    )
}

/// The requests that upload elements with these nodes.
pub(crate) fn elements_requests(begin: ElementsBegin, nodes: &[Node]) -> Upload {
    let crc = UploadCrc::of_elements(&begin);
    with_nodes(Request::ElementsBegin(begin), crc, nodes)
}

fn with_nodes(begin: Request, mut crc: UploadCrc, nodes: &[Node]) -> Upload {
    nodes.iter().for_each(|node| crc.node(node));
    let crc = crc.value();
    let chunks = nodes.chunks(TableChunk::MAX_NODES).enumerate();
    let chunks = chunks.map(|(i, nodes)| {
        Request::TableChunk(TableChunk {
            // A table has fewer than 65,536 nodes.
            first: (i * TableChunk::MAX_NODES) as u16,
            nodes: FixedVec::of(nodes),
        })
    });
    let mut requests = vec![begin];
    requests.extend(chunks);
    requests.push(Request::TableCommit(Commit { crc }));
    Upload { requests, crc }
}

/// The requests that upload a mechanism with these values: detents, then frictions.
pub(crate) fn mechanism_requests(begin: MechanismBegin, values_n: &[f64]) -> Upload {
    let mut crc = UploadCrc::of_mechanism(&begin);
    values_n.iter().for_each(|value| crc.value_n(*value));
    let crc = crc.value();
    let chunks = values_n.chunks(MechanismChunk::MAX_VALUES).enumerate();
    let chunks = chunks.map(|(i, values)| {
        Request::MechanismChunk(MechanismChunk {
            // There are fewer than 65,536 values.
            first: (i * MechanismChunk::MAX_VALUES) as u16,
            values: FixedVec::of(values),
        })
    });
    let mut requests = vec![Request::MechanismBegin(begin)];
    requests.extend(chunks);
    requests.push(Request::MechanismCommit(Commit { crc }));
    Upload { requests, crc }
}

/// Builds the upload of a realization. If it fails its certificate or is stiffer than
/// the device's limit, `allow_uncertified` requests its playback anyway, within the
/// force limit; otherwise the device refuses it.
///
/// # Errors
/// [`TableError`] if it is invalid, too large, or a mechanism that the device cannot play.
pub(super) fn of(
    table: &Realization,
    limits: Limits,
    allow_uncertified: bool,
    device: &Identity,
) -> Result<Upload, TableError> {
    table::check(table)?;
    let count = table.x_mm.len();
    let nodes = u16::try_from(count).map_err(|_| TableError::TooManyNodes(count))?;
    let certificate = table.certificate_of_device();
    // As the device judges it in the minor version of the connection.
    let stiffness_n_per_mm = match device.constants {
        Some(_) => certificate.rendered_n_per_mm(),
        None => certificate.stiffness_n_per_mm,
    };
    let rendered = stiffness_n_per_mm <= device.stiffness_n_per_mm
        && certificate.damping_n_s_per_mm <= device.damping_n_s_per_mm;
    let certified = certificate.passes() && rendered;
    // The device does not know of windows of play.
    let by_windows = rendered && !certified && table.certificate().passes();
    let armed = by_windows || (allow_uncertified && !certified);
    let uncertified_n = armed.then(|| limits.force_n.get());
    if let Some(mechanism) = &table.mechanism {
        let features = device.constants.map(|told| told.features);
        if !features.is_some_and(|features| features.mechanism) {
            return Err(TableError::Mechanism);
        }
        return of_mechanism(table, mechanism, limits, uncertified_n);
    }
    if let Some(elements) = &table.elements {
        let features = device.constants.map(|told| told.features);
        if !features.is_some_and(|features| features.elements) {
            return Err(TableError::Elements);
        }
        let begin = ElementsBegin {
            nodes,
            mass_kg: elements.mass_kg,
            range_mm: table.trained.x_mm,
            trained_mm_s: table.trained.v_mm_s,
            force_n: limits.force_n.get(),
            velocity_mm_s: limits.velocity_mm_s.get(),
            uncertified_n,
            springs: FixedVec::of(&elements.springs),
        };
        let nodes: Vec<Node> = (0..count).map(|i| element_node(elements, i)).collect();
        return Ok(elements_requests(begin, &nodes));
    }
    let begin = TableBegin {
        nodes,
        lookup: table.lookup,
        direction: table.direction,
        range_mm: table.trained.x_mm,
        trained_mm_s: table.trained.v_mm_s,
        force_n: limits.force_n.get(),
        velocity_mm_s: limits.velocity_mm_s.get(),
        uncertified_n,
    };
    let all: Vec<Node> = (0..count)
        .map(|i| Node {
            x_mm: table.x_mm[i],
            positive: parameters(&table.positive, i),
            negative: parameters(&table.negative, i),
        })
        .collect();
    Ok(requests(begin, &all))
}

fn of_mechanism(
    realization: &Realization,
    mechanism: &Mechanism,
    limits: Limits,
    uncertified_n: Option<f64>,
) -> Result<Upload, TableError> {
    let values_n = [&mechanism.detent.n[..], &mechanism.friction.n].concat();
    let too_many = |_| TableError::TooManyValues(values_n.len());
    u16::try_from(values_n.len()).map_err(too_many)?;
    let place = |profile: &Profile| [profile.first_mm, profile.step_mm];
    let begin = MechanismBegin {
        detents: mechanism.detent.n.len() as u16,
        frictions: mechanism.friction.n.len() as u16,
        detent_mm: place(&mechanism.detent),
        friction_mm: place(&mechanism.friction),
        range_mm: realization.trained.x_mm,
        trained_mm_s: realization.trained.v_mm_s,
        force_n: limits.force_n.get(),
        velocity_mm_s: limits.velocity_mm_s.get(),
        uncertified_n,
        scalars: mechanism.scalars,
    };
    Ok(mechanism_requests(begin, &values_n))
}

fn element_node(elements: &Elements, node: usize) -> Node {
    let [forwards, backwards] = &elements.damping_n_s_per_mm;
    let mut values = [0.0; 3 + MAX_SPRINGS];
    let profiles = [&elements.force_n, forwards, backwards];
    for (value, profile) in (values.iter_mut()).zip(profiles.into_iter().chain(&elements.spring_n))
    {
        *value = profile[node];
    }
    Node::of_elements(elements.x_mm[node], values)
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

/// How long the upload of a stimulus takes on a line on which a round trip takes `trip` and a byte
/// `byte_time`, with a heartbeat every 10 ms; `None` if the device refuses it.
pub fn load_time(
    device: &Identity,
    what: &Stimulus<'_>,
    limits: Limits,
    trip: Duration,
    byte_time: Duration,
) -> Option<Duration> {
    let limits = limits.capped_at(super::identity(device)?.limits);
    let table = what.need_table().ok()?;
    let upload = of(table, limits, what.allow_uncertified, device).ok()?;
    // LIMP and REARM come first.
    let trips = upload.requests.len() as u32 + 2;
    let bytes: usize = (upload.requests.iter())
        .map(|request| request.frame(0).as_bytes().len())
        .sum();
    let commit_ms = device.constants.map_or(50, |told| told.commit_ms);
    let beats = byte_time.as_secs_f64() * HEARTBEAT_BYTES / HEARTBEAT_INTERVAL.as_secs_f64();
    let alone = trip * trips + byte_time * bytes as u32;
    let shared = alone.as_secs_f64() / (1.0 - beats).max(0.1);
    Some(Duration::from_secs_f64(shared) + Duration::from_millis(u64::from(commit_ms)))
}

/// Bytes of the frame of a heartbeat.
const HEARTBEAT_BYTES: f64 = 19.0;

/// Describes a request in messages.
pub(super) fn describe(request: &Request) -> &'static str {
    match request {
        Request::Hello(_) => "the connection",
        Request::TableBegin(_) | Request::TableChunk(_) | Request::TableCommit(_) => "the table",
        Request::ElementsBegin(_) => "the elements",
        Request::MechanismBegin(_) | Request::MechanismChunk(_) | Request::MechanismCommit(_) => {
            "the mechanism"
        }
        Request::Play(_) => "the start",
        Request::Stop(_) => "the stop",
        Request::Fade(_) => "the fall of the force",
        Request::Limp => "the command LIMP",
        Request::Heartbeat(_) => "a heartbeat",
        Request::Rearm => "to re-arm",
        Request::State => "the request for its state",
        Request::PathBegin(_) | Request::PathChunk(_) | Request::PathCommit(_) => "the path",
        Request::Record(_) => "the recording",
    }
}
