//! A whole study with simulated participants: what `study rehearse` does.
//!
//! Their answers come from [`crate::rater`]; sessions, device and files are those of a real
//! study, on a virtual clock. The same protocol and seed give the same bytes.

use crate::rater::{Effect, Percepts, Rater};
use crate::runner::Setup;
use crate::runner::clock::{Clock as _, VirtualClock};
use crate::runner::rehearsal::{RehearsalError, first_day, run_one};
use crate::runner::saver::Saving;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use study_analysis::analyze::Progress;
use study_analysis::load::{LoadError, Loaded, RecordingError, Unplayable, deliveries};
use study_base::rng::Stream;
use study_device::Device;
use study_device::faults::FaultPlan;
use study_device::firmware::{Wrong, WrongLoads};
use study_device::manual::{Manual, WithManual};
use study_device::sending::{Drawn, Sending};
use study_device::virtual_device::{Options as DeviceOptions, VirtualDevice};
use study_plan::protocol::{DeviceKind, Protocol, Seat, SessionPlan};
use study_session::store::{Derived, Frozen, SeatKind, StoreError, StudyFolder};

/// Probability of a fault in a playback of a faulty device.
const FAULT_PROBABILITY: f64 = 0.08;

/// Who takes part, and with which device.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// Number of participants.
    pub participants: u32,
    /// Seed of the raters and the device; `None`: that of the study. Orders always follow
    /// from that of the study.
    pub seed: Option<u64>,
    /// Whether ratings depend on the realization.
    pub effect: Effect,
    /// Whether the device fails at random and sometimes renders another force.
    pub faults: bool,
    /// Telemetry samples per second; `None`: 100, or 1000 of a faulty device, since slow
    /// telemetry shows no wrong force.
    pub telemetry_hz: Option<u32>,
    /// Where the rehearsal says how many participants have finished.
    pub progress: Option<&'a Progress>,
}

impl Default for Options<'_> {
    /// Ten participants with the built-in effect and a device without faults.
    fn default() -> Self {
        Self {
            participants: 10,
            seed: None,
            effect: Effect::BuiltIn,
            faults: false,
            telemetry_hz: None,
            progress: None,
        }
    }
}

/// A study that was rehearsed.
#[derive(Debug)]
pub struct Rehearsed {
    /// The folder of the study.
    pub folder: PathBuf,
    /// Its rows.
    pub derived: Derived,
    /// What the raters compare realizations with.
    pub percepts: Percepts,
    /// Why realizations have no delivered VAF although there is a recording. Untrusted.
    pub notices: Vec<String>,
}

/// Why a study is not rehearsed.
#[derive(Debug, thiserror::Error)]
pub enum RehearseError {
    /// The protocol cannot be used.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A realization cannot be played.
    #[error(transparent)]
    Unplayable(#[from] Unplayable),
    /// The validation recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The results folder.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The folder holds rehearsed sessions already.
    #[error("{} already holds {count} rehearsed session{}", .folder.display(), if *.count == 1 { "" } else { "s" })]
    Rehearsed {
        /// The folder of the study.
        folder: PathBuf,
        /// Number of sessions.
        count: usize,
    },
    /// The folder holds sessions of people.
    #[error("{} holds sessions of real participants", .0.display())]
    Real(PathBuf),
    /// A session failed.
    #[error(transparent)]
    Session(#[from] RehearsalError),
}

/// Rehearses a study into a new folder in `out`.
///
/// # Errors
/// [`RehearseError`]; a folder that already holds sessions is refused.
///
/// ```
/// use study::rehearsal::{Options, rehearse};
/// use study_analysis::load::load;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let protocol = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/turn-signal");
/// # let out = tempfile::tempdir()?;
/// # let out = out.path();
/// let options = Options { participants: 1, ..Options::default() };
/// let rehearsed = rehearse(load(protocol.as_ref())?, out, &options)?;
/// assert_eq!(rehearsed.derived.participants.len(), 1);
/// # Ok(())
/// # }
/// ```
pub fn rehearse(
    loaded: Loaded,
    out: &Path,
    options: &Options<'_>,
) -> Result<Rehearsed, RehearseError> {
    // Samples are mounted by simulated hands, which also stand for a program whose
    // realizations have no tables; everything else is played by the simulated device.
    let kind = match loaded.protocol.device.kind {
        DeviceKind::Manual => DeviceKind::Manual,
        DeviceKind::Process if loaded.models.is_empty() => DeviceKind::Process,
        _ => DeviceKind::Simulated,
    };
    loaded.check_playable(kind)?;
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let now = VirtualClock::starting_at(first_day()).now();
    let study = StudyFolder::open_or_create(out, &frozen, now)?;
    let folder = study.path().to_owned();
    refuse_occupied(&study)?;

    let tables = loaded.tables();
    let (deliveries, mut notices) = deliveries(&loaded)?;
    if loaded.protocol.has_media() {
        notices.push(
            "pictures, videos and sounds are neither shown nor played in a rehearsal".to_owned(),
        );
    }
    let percepts = Percepts::of(&loaded.protocol, &tables);
    let seed = options.seed.unwrap_or(loaded.protocol.study.seed);
    let protocol = Arc::new(loaded.protocol);
    let orders = loaded.orders.map(Arc::new);
    let mut study = Some(study);
    for number in 1..=options.participants {
        let day = u64::from(number - 1);
        let clock = VirtualClock::starting_at(first_day() + chrono::Days::new(day));
        let mut rater = Rater::new(seed, number, options.effect);
        let id = format!("SIM{number:03}");
        for planned in 0..protocol.planned_sessions() {
            if let Some(session) = protocol.sessions.get(planned).filter(|_| planned > 0) {
                clock.advance(gap(session));
            }
            let device_seed = seed
                .wrapping_add(u64::from(number) << 32)
                .wrapping_add((planned as u64) << 48);
            let setup = Setup {
                protocol: protocol.clone(),
                orders: orders.clone(),
                models: tables.clone(),
                deliveries: deliveries.clone(),
                fingerprints: loaded.fingerprints.clone(),
                study: match study.take() {
                    Some(first) => first,
                    None => StudyFolder::open(&folder)?,
                },
                kind: SeatKind::Simulated,
                rows: None,
                group: None,
                device_kind: kind,
                device: {
                    let device: Box<dyn Device> = match kind {
                        DeviceKind::Manual | DeviceKind::Process => Box::new(Manual::default()),
                        _ => with_manual_samples(simulated(device_seed, options), &protocol),
                    };
                    with_numbers(device, &protocol, device_seed)
                },
                device_check: None,
                self_weighed: None,
                clock: Box::new(clock.clone()),
                saving: Saving::Loop,
            };
            run_one(setup, &id, &clock, &mut rater, &percepts)?;
        }
        if let Some(Progress { groups, done }) = options.progress {
            groups.store(u64::from(options.participants), Ordering::Relaxed);
            done.store(u64::from(number), Ordering::Relaxed);
        }
    }
    let derived = StudyFolder::open(&folder)?.refresh(&protocol)?;
    Ok(Rehearsed {
        folder,
        derived,
        percepts,
        notices,
    })
}

fn simulated(seed: u64, options: &Options<'_>) -> Box<dyn Device> {
    let mut device = DeviceOptions::seeded(seed);
    let usual_hz = if options.faults { 1000 } else { 100 };
    device.device.telemetry_hz = f64::from(options.telemetry_hz.unwrap_or(usual_hz));
    if options.faults {
        device.device.wrong = wrong_loads(seed);
        device.faults = FaultPlan::random(seed, FAULT_PROBABILITY);
    }
    Box::new(VirtualDevice::new(device))
}

/// Combines the device with an experimenter if some samples are mounted by hand.
pub fn with_manual_samples(device: Box<dyn Device>, protocol: &Protocol) -> Box<dyn Device> {
    let mut models = protocol.models.iter();
    if models.any(|m| m.device == Some(DeviceKind::Manual)) {
        Box::new(WithManual::new(device))
    } else {
        device
    }
}

/// Adds the numbers that the protocol expects of its controller program, drawn.
fn with_numbers(device: Box<dyn Device>, protocol: &Protocol, seed: u64) -> Box<dyn Device> {
    let numbers: Vec<Drawn> = (protocol.numbers_of_device())
        .map(|(_, number)| Drawn {
            key: number.key(),
            is_count: number.unit == "1",
        })
        .collect();
    match numbers.is_empty() {
        true => device,
        false => Box::new(Sending::new(device, numbers, seed)),
    }
}

/// The time that a simulated participant stays away before a session: halfway between the
/// least and the largest gap, or a day more than the least.
fn gap(session: &SessionPlan) -> Duration {
    let hours = match session.max_gap_h {
        Some(most) => f64::midpoint(session.min_gap_h, most),
        None => session.min_gap_h + 24.0,
    };
    Duration::from_secs_f64(3600.0 * hours)
}

/// In every third session the device is wrong for three loads.
fn wrong_loads(seed: u64) -> Option<WrongLoads> {
    let mut stream = Stream::new(seed, &["device", "wrong"]);
    let (chosen, which) = (stream.below(3) == 0, stream.below(Wrong::ALL.len() as u64));
    // Below a dozen.
    let from = 1 + stream.below(12) as u32;
    let (wrong, ..) = Wrong::ALL[usize::try_from(which).ok()?];
    chosen.then_some(WrongLoads {
        wrong,
        loads: [from, from + 2],
    })
}

/// Refuses a folder that already holds sessions.
fn refuse_occupied(study: &StudyFolder) -> Result<(), RehearseError> {
    let sessions = study.sessions()?;
    let simulated = |seat: Option<Seat>| seat.is_some_and(Seat::is_simulated);
    let folder = study.path().to_owned();
    match sessions.len() {
        0 => Ok(()),
        count if sessions.iter().all(|s| simulated(s.seat)) => {
            Err(RehearseError::Rehearsed { folder, count })
        }
        _ => Err(RehearseError::Real(folder)),
    }
}
