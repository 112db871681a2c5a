//! `study device hold`, hidden: plays one table for long, without a session.
//!
//! For measurements of the link: telemetry over minutes, memory, what becomes of the
//! force when this program is killed.

use crate::cli::playback::{Place, Waiting};
use crate::cli::{Console, Failure, Kind, load};
use crate::device::host::Settings;
use crate::device::link::Threaded;
use crate::device::process::ProcessDevice;
use crate::device::{Device, Report, Stimulus};
use std::io::BufRead as _;
use std::path::PathBuf;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};
use study_base::limits::{Limit, Limits};
use study_haptics::model::{Branch, Realization, Trained};
use study_wire::predict::{Direction, Lookup};

/// The line of standard input that makes the loop stand still for a second.
pub(super) const STALL: &str = "stall";
/// How long a load or a stop may take.
const ANSWER_WITHIN: Duration = Duration::from_secs(10);
/// Between two polls, as while a session plays.
const TURN: Duration = Duration::from_millis(20);

/// Arguments of `study device hold`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    #[command(flatten)]
    place: Place,
    /// For so long
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=590))]
    seconds: u64,
    /// The first table of this study; else a constant push of 1 N
    #[arg(long, value_name = "PROTOCOL")]
    models: Option<PathBuf>,
}

/// Does it.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let table = match &args.models {
        Some(protocol) => {
            let loaded = load::load(protocol)?;
            let table = loaded.models.into_values().next();
            table.ok_or_else(|| Failure::input("the study has no table"))?
        }
        None => push(),
    };
    let limit = |value| Limit::new(value).map_err(|e| Failure::new(Kind::Bug, e));
    let limits = Limits {
        force_n: limit(9.0)?,
        velocity_mm_s: limit(1000.0)?,
    };
    let mut device = match args.place.is_program()? {
        false => Held::Wire(args.place.serial.open_serial(Settings::default())?),
        true => match args.place.open_program(&mut Waiting::in_a_line(console))? {
            Some(device) => Held::Program(device),
            None => return Ok(()),
        },
    };
    let failed = |why: String| Failure::new(Kind::Device, why);
    let (say, lines) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if say.send(line).is_err() {
                return;
            }
        }
    });
    let start = Instant::now();
    let at = || start.elapsed();
    let told = |e: crate::device::DeviceError| failed(e.to_string());
    device
        .any()
        .load(&Stimulus::of_table(&table), limits, at())
        .map_err(told)?;
    let mut until = ANSWER_WITHIN;
    let mut stopping = false;
    loop {
        if lines.try_recv().is_ok_and(|line| line.trim() == STALL) {
            std::thread::sleep(Duration::from_secs(1));
        }
        for report in device.any().poll(at()) {
            match report {
                Report::Loaded => device.any().start(at()).map_err(told)?,
                Report::Started => until = at() + Duration::from_secs(args.seconds),
                Report::Stopped(playback) => {
                    return console.out(format!(
                        "{:.1} s, {} samples, {} lost, {} strokes, least energy {:.4} J, {:.1} switches/s, {} clamps\n{}",
                        playback.exploration_s,
                        playback.samples,
                        playback.samples_lost,
                        playback.strokes,
                        playback.least_energy_j,
                        playback.switches_per_s,
                        playback.clamp_count,
                        device.health(),
                    ));
                }
                Report::Fault(why) | Report::Lost(why) => return Err(failed(why)),
                _ => {}
            }
        }
        if at() > until {
            if stopping {
                return Err(failed("it does not answer in time".to_owned()));
            }
            stopping = true;
            until = at() + ANSWER_WITHIN;
            device.any().stop(at()).map_err(told)?;
        }
        std::thread::sleep(TURN);
    }
}

/// What is held.
enum Held {
    Wire(Threaded),
    Program(ProcessDevice),
}

impl Held {
    fn any(&mut self) -> &mut dyn Device {
        match self {
            Self::Wire(device) => device,
            Self::Program(device) => device,
        }
    }

    /// A line about the link, where there is one.
    fn health(&self) -> String {
        let Self::Wire(device) = self else {
            return String::new();
        };
        let health = device.facts().health;
        let number = |value: Option<f64>| match value {
            Some(value) => format!("{value:.1}"),
            None => "unknown".to_owned(),
        };
        format!(
            "clock: {} ms ahead, {} ppm fast; {} bad frames, {} repeats\n",
            number(health.clock.offset_ms()),
            number(health.clock.drift_ppm()),
            health.bad_frames,
            health.repeats,
        )
    }
}

/// 1 N and some damping everywhere.
fn push() -> Realization {
    let x_mm: Vec<f64> = (0..=7).map(|i| 5.0 * f64::from(i)).collect();
    let branch = Branch {
        m_kg: vec![0.0; x_mm.len()],
        b_n_s_per_mm: vec![0.005; x_mm.len()],
        k_n_per_mm: vec![0.0; x_mm.len()],
        f0_n: vec![1.0; x_mm.len()],
    };
    Realization {
        id: "push".to_owned(),
        provenance: Default::default(),
        vaf: Default::default(),
        lookup: Lookup::Linear,
        direction: Direction::Play { delta_mm: 0.5 },
        trained: Trained {
            x_mm: [1.5, 33.5],
            v_mm_s: 138.0,
        },
        x_mm,
        positive: branch.clone(),
        negative: branch,
    }
}
