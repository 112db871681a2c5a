//! What a session needs.

use super::clock::Clock;
use super::saver::Saving;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;
use study_base::text::{ModelId, PartId};
use study_device::Device;
use study_haptics::identify::delivery::Delivery;
use study_haptics::model::Realization;
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{DeviceKind, FileOrders, Protocol};
use study_session::outcome::SelfWeighed;
use study_session::store::{SeatKind, StudyFolder};

/// Everything that a session needs.
pub struct Setup {
    /// The protocol.
    pub protocol: Arc<Protocol>,
    /// Presentation orders, if they come from a file.
    pub orders: Option<Arc<FileOrders>>,
    /// Realizations by their id in the protocol, with the levels of families.
    pub models: BTreeMap<ModelId, Realization>,
    /// What is needed for the VAF of what is delivered, where there is a validation
    /// recording.
    pub deliveries: BTreeMap<ModelId, Delivery>,
    /// Fingerprints of the protocol.
    pub fingerprints: Fingerprints,
    /// The folder of the study.
    pub study: StudyFolder,
    /// Whether data are real, pilot or simulated.
    pub kind: SeatKind,
    /// The rows that may be assigned; `None`: all.
    pub rows: Option<RangeInclusive<u32>>,
    /// The group that the experimenter gives to a new participant.
    pub group: Option<PartId>,
    /// The kind of `device`.
    pub device_kind: DeviceKind,
    /// The playback device.
    pub device: Box<dyn Device>,
    /// Result of its last commissioning, recorded in the session's first event.
    pub device_check: Option<String>,
    /// How its motor weighed itself before the session.
    pub self_weighed: Option<SelfWeighed>,
    /// The clock.
    pub clock: Box<dyn Clock>,
    /// Who saves.
    pub saving: Saving,
}
