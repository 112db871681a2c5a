//! `study device hold`, hidden: plays one table without a session.
//!
//! For measurements of the link: telemetry over minutes, memory, and the force after
//! this program is killed.

use super::single_playback::{self, Pace};
use crate::cli::device_selection::{DeviceAddress, WaitDisplay};
use crate::cli::{Console, Failure, Kind};
use std::io::BufRead as _;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use study_analysis::load;
use study_base::limits::Limits;
use study_device::host::HostSettings;
use study_device::link::LinkedDevice;
use study_device::process::ProcessDevice;
use study_device::table::both_ways;
use study_device::{Device, Stimulus};
use study_haptics::model::{Realization, Trained};
use study_wire::predict::Direction;

/// A line of standard input with this text stalls the loop for a second.
pub(super) const STALL: &str = "stall";

/// Arguments of `study device hold`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    #[command(flatten)]
    address: DeviceAddress,
    /// Duration, s
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=590))]
    seconds: u64,
    /// Play the first table of this study instead of a constant force of 1 N
    #[arg(long, value_name = "PROTOCOL")]
    models: Option<PathBuf>,
}

/// Plays the table and prints the outcome.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let table = match &args.models {
        Some(protocol) => {
            let loaded = load::load(protocol)?;
            let table = loaded.models.into_values().next();
            table.ok_or_else(|| Failure::input("the study has no table"))?
        }
        None => constant_force(),
    };
    let limits = Limits::new(9.0, 1000.0).map_err(|e| Failure::new(Kind::Bug, e))?;
    let mut device = match args.address.is_program()? {
        false => ActiveDevice::Linked(Box::new(
            args.address.serial.open_serial(HostSettings::default())?,
        )),
        true => match args
            .address
            .open_program(&mut WaitDisplay::in_a_line(console))?
        {
            Some(device) => ActiveDevice::Program(Box::new(device)),
            None => return Ok(()),
        },
    };
    let lines = input_lines();
    let playback = single_playback::play(
        device.any(),
        &Stimulus::of_table(&table),
        limits,
        Duration::from_secs(args.seconds),
        &mut Pace::real(),
        &mut |_| {
            if lines.try_recv().is_ok_and(|line| line.trim() == STALL) {
                std::thread::sleep(Duration::from_secs(1));
            }
        },
    )
    .map_err(Failure::device)?;
    console.out(format!(
        "{:.1} s, {} samples, {} lost, {} strokes, least energy {:.4} J, {:.1} switches/s, {} clamps\n{}",
        playback.exploration_s,
        playback.samples,
        playback.samples_lost,
        playback.strokes,
        playback.least_energy_j,
        playback.switches_per_s,
        playback.clamp_count,
        device.health(),
    ))
}

/// Lines of standard input that are not blank; its end is ignored.
pub(super) fn input_lines() -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        let mut read = std::io::stdin().lock().lines();
        loop {
            wait_for_the_foreground();
            let Some(Ok(line)) = read.next() else {
                return;
            };
            if !line.trim().is_empty() && sender.send(line).is_err() {
                return;
            }
        }
    });
    lines
}

/// Returns once the process may read its terminal. A shell has a command with `&` in the background, where the
/// system would stop the whole process, with the device that it simulates.
fn wait_for_the_foreground() {
    #[cfg(unix)]
    while rustix::termios::tcgetpgrp(std::io::stdin())
        .is_ok_and(|group| group != rustix::process::getpgrp())
    {
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// The device, of either kind.
pub(super) enum ActiveDevice {
    Linked(Box<LinkedDevice>),
    Program(Box<ProcessDevice>),
}

impl ActiveDevice {
    pub(super) fn any(&mut self) -> &mut dyn Device {
        match self {
            Self::Linked(device) => device.as_mut(),
            Self::Program(device) => device.as_mut(),
        }
    }

    pub(super) fn into_any(self) -> Box<dyn Device> {
        match self {
            Self::Linked(device) => device,
            Self::Program(device) => device,
        }
    }

    /// Where its stops are, mm, if it tells.
    pub(super) fn stroke_mm(&self) -> Option<[f64; 2]> {
        match self {
            Self::Linked(device) => device.status().device.map(|told| told.stroke_mm),
            Self::Program(_) => None,
        }
    }

    /// A line about the link, empty for a program.
    fn health(&self) -> String {
        let Self::Linked(device) = self else {
            return String::new();
        };
        let health = device.status().health;
        let number = |value: Option<f64>| match value {
            Some(value) => format!("{value:.1}"),
            None => "unknown".to_owned(),
        };
        format!(
            "clock: offset {} ms, drift {} ppm; {} bad frames, {} repeats\n",
            number(health.clock.offset_ms()),
            number(health.clock.drift_ppm()),
            health.bad_frames,
            health.repeats,
        )
    }
}

/// A table of 1 N and some damping everywhere.
fn constant_force() -> Realization {
    let x_mm: Vec<f64> = (0..=7).map(|i| 5.0 * f64::from(i)).collect();
    let trained = Trained {
        x_mm: [1.5, 33.5],
        v_mm_s: 138.0,
    };
    let (force_n, damping) = (vec![1.0; x_mm.len()], vec![0.005; x_mm.len()]);
    Realization {
        direction: Direction::Play { delta_mm: 0.5 },
        ..both_ways("push", x_mm, (force_n, damping), trained)
    }
}
