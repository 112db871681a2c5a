//! `study rehearse`: a whole study with simulated participants.

use super::device_selection::with_manual_samples;
use super::{Console, Failure, Kind, load};
use crate::device::faults::FaultPlan;
use crate::device::firmware::{Wrong, WrongLoads};
use crate::device::manual::Manual;
use crate::device::virtual_device::{Options, VirtualDevice};
use crate::rater::{Effect, Percepts, Rater};
use crate::runner::Setup;
use crate::runner::clock::{Clock as _, VirtualClock};
use crate::runner::rehearsal::{first_day, run_one};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use study_base::rng::Stream;
use study_base::text::Untrusted;
use study_core::outcome::{State, Status};
use study_core::protocol::{DeviceKind, Seat, SessionPlan};
use study_core::store::{Frozen, SeatKind, StudyFolder};

/// Probability of a fault in a playback with `--faults`.
const FAULT_PROBABILITY: f64 = 0.08;

/// Arguments of `study rehearse`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Number of simulated participants
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999))]
    participants: u32,
    /// Seed of the raters; the orders always use the seed of the protocol
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "rehearsal")]
    out: PathBuf,
    /// Let the device fail at random, and render another force than the one it was sent in
    /// some of the sessions
    #[arg(long)]
    faults: bool,
    /// Whether ratings depend on the realization
    #[arg(long, value_enum, default_value_t = EffectArg::BuiltIn)]
    effect: EffectArg,
    /// Telemetry samples per second [default: 100, or 1000 with --faults, since slow telemetry
    /// shows no wrong force]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(1..=4000))]
    telemetry: Option<u32>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum EffectArg {
    /// Realizations that are closer to the target and less active are rated higher
    BuiltIn,
    /// Ratings do not depend on the realization
    None,
}

/// Runs the command.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let loaded = load::load(&args.protocol)?;
    let clock = VirtualClock::starting_at(first_day());
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    // Samples are mounted by simulated hands, which also stand for a program whose
    // realizations have no tables; everything else is played by the simulated device.
    let kind = match loaded.protocol.device.kind {
        DeviceKind::Manual => DeviceKind::Manual,
        DeviceKind::Process if loaded.models.is_empty() => DeviceKind::Process,
        _ => DeviceKind::Simulated,
    };
    super::run::refuse_unplayable(kind, &loaded)?;
    let study = StudyFolder::open_or_create(&args.out, &frozen, clock.now())?;
    let folder = study.path().to_owned();
    refuse_occupied(&study, &folder)?;

    let tables = loaded.tables();
    let (deliveries, said) = load::recordings::deliveries(&loaded)?;
    for notice in said {
        console.say(format!("warning: {}", Untrusted(&notice)));
    }
    let percepts = Percepts::of(&loaded.protocol, &tables);
    let effect = match args.effect {
        EffectArg::BuiltIn => Effect::BuiltIn,
        EffectArg::None => Effect::None,
    };
    let seed = args.seed.unwrap_or(loaded.protocol.study.seed);
    let protocol = Arc::new(loaded.protocol);
    let orders = loaded.orders.map(Arc::new);
    let mut study = Some(study);
    let progress = super::console::progress(u64::from(args.participants), "participants");
    for number in 1..=args.participants {
        let day = u64::from(number - 1);
        let clock = VirtualClock::starting_at(first_day() + chrono::Days::new(day));
        let mut rater = Rater::new(seed, number, effect);
        let id = format!("SIM{number:03}");
        for planned in 0..protocol.planned_sessions() {
            if let Some(session) = protocol.sessions.get(planned).filter(|_| planned > 0) {
                clock.advance(gap(session));
            }
            let device_seed = seed
                .wrapping_add(u64::from(number) << 32)
                .wrapping_add((planned as u64) << 48);
            let mut options = Options::seeded(device_seed);
            let usual_hz = if args.faults { 1000 } else { 100 };
            options.device.telemetry_hz = f64::from(args.telemetry.unwrap_or(usual_hz));
            if args.faults {
                options.device.wrong = wrong_loads(device_seed);
                options.faults = FaultPlan::random(device_seed, FAULT_PROBABILITY);
            }
            let folder_of_study = match study.take() {
                Some(first) => first,
                None => StudyFolder::open(&folder)?,
            };
            let setup = Setup {
                protocol: protocol.clone(),
                orders: orders.clone(),
                models: tables.clone(),
                deliveries: deliveries.clone(),
                fingerprints: loaded.fingerprints.clone(),
                study: folder_of_study,
                kind: SeatKind::Simulated,
                rows: None,
                group: None,
                device_kind: kind,
                device: match kind {
                    DeviceKind::Manual | DeviceKind::Process => Box::new(Manual::default()),
                    _ => with_manual_samples(Box::new(VirtualDevice::new(options)), &protocol),
                },
                device_check: None,
                clock: Box::new(clock.clone()),
                threaded: false,
            };
            run_one(setup, &id, &clock, &mut rater, &percepts)
                .map_err(|e| Failure::new(Kind::Results, e))?;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let study = StudyFolder::open(&folder)?;
    let derived = study.refresh(&protocol)?;
    let done = derived
        .participants
        .iter()
        .filter(|p| p.state == State::Done)
        .count();
    let rated = derived
        .rows
        .iter()
        .filter(|row| !row.practice && row.status == Status::Ok)
        .count();
    let shown = folder.display();
    let compared = match percepts.target() {
        _ if loaded.models.is_empty() && protocol.families.is_empty() => {
            "The realizations have no tables: the raters' answers do not depend on them.".to_owned()
        }
        Some(best) => {
            format!("The raters compare with the realization with the highest VAF, {best}.")
        }
        None => "The raters compare with the simulated switch B.".to_owned(),
    };
    console.out(format!(
        "{done} simulated participants, {rated} rated trials in {shown}.\n{compared}\nSimulated: the effects are built in (docs/simulation.md) and are no evidence.\nNext: study analyze {shown} --include simulated\n"
    ))
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
fn refuse_occupied(study: &StudyFolder, folder: &Path) -> Result<(), Failure> {
    let sessions = study.sessions()?;
    if sessions.is_empty() {
        return Ok(());
    }
    let simulated = sessions
        .iter()
        .filter(|s| s.seat.is_some_and(Seat::is_simulated))
        .count();
    let what = if simulated == sessions.len() {
        let plural = if simulated == 1 { "" } else { "s" };
        format!("already holds {simulated} rehearsed session{plural}")
    } else {
        "holds sessions of real participants".to_owned()
    };
    Err(Failure::results(format!("{} {what}", folder.display()))
        .hint("name another folder with --out"))
}
