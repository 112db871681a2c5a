//! `study device safety`, hidden: how long it takes to zero force on the wall clock.
//!
//! A simulated device runs in this process at the end of a pseudo-terminal; a child
//! of this program is the host and plays. Then the child is killed, stopped, its
//! screen stalled, or the cable pulled, again and again, and the time until the
//! device's motor has no force is told. It is a claim about the simulated device, on
//! this machine, with whatever else it does.

use super::hold;
use crate::cli::{Console, Failure, Kind};
use crate::device::firmware::{Firmware, Options};
use crate::device::link::memory::Noise;
use crate::device::link::pty::{Control, Simulator};
use std::io::Write as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use study_wire::message::State;

/// Arguments of `study device safety`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// How often each
    #[arg(long, value_name = "N", default_value_t = 200)]
    times: u32,
    /// Servo periods a second
    #[arg(long, value_name = "HZ", default_value_t = 4000)]
    rate: u32,
}

/// What becomes of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Accident {
    Killed,
    Stopped,
    Stalled,
    Pulled,
}

impl Accident {
    const ALL: [Self; 4] = [Self::Killed, Self::Stopped, Self::Stalled, Self::Pulled];

    fn as_str(self) -> &'static str {
        match self {
            Self::Killed => "host killed",
            Self::Stopped => "host stopped",
            Self::Stalled => "its screen stalled",
            Self::Pulled => "cable pulled",
        }
    }

    /// What the device has to keep, ms.
    fn allowed_ms(self) -> f64 {
        match self {
            Self::Stalled => 150.0,
            _ => 50.0,
        }
    }
}

/// How long a host may take to play.
const PLAYS_WITHIN: Duration = Duration::from_secs(20);
/// How often one is tried.
const TRIES: u32 = 5;
/// Zero force has to stay for so long.
const STAYS: Duration = Duration::from_millis(100);

fn failed(why: impl std::fmt::Display) -> Failure {
    Failure::new(Kind::Device, why)
}

/// Does it.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let (mut late, mut spoilt) = (0, 0);
    console.out("accident             n   median   99 %    most   allowed\n")?;
    for accident in Accident::ALL {
        let progress = crate::cli::console::progress(u64::from(args.times), accident.as_str());
        let mut times_ms = Vec::new();
        for n in 0..args.times {
            // a busy machine may make the device limp before the accident does
            let mut took = None;
            for _ in 0..TRIES {
                took = once(accident, n, args.rate)?;
                if took.is_some() {
                    break;
                }
                spoilt += 1;
            }
            times_ms.push(took.ok_or_else(|| failed("the host does not play"))?);
            progress.inc(1);
        }
        progress.finish_and_clear();
        times_ms.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let place = (share * times_ms.len() as f64).ceil() as usize;
            times_ms[place.saturating_sub(1).min(times_ms.len() - 1)]
        };
        let allowed = accident.allowed_ms();
        late += times_ms.iter().filter(|t| **t > allowed).count();
        console.out(format!(
            "{:<18} {:>3}  {:>6.1}  {:>6.1}  {:>6.1}  {allowed:>6.0} ms\n",
            accident.as_str(),
            times_ms.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        ))?;
    }
    if spoilt > 0 {
        console.say(format!(
            "{spoilt} tries were spoilt before the accident: the machine is busy"
        ));
    }
    if late == 0 {
        return Ok(());
    }
    Err(failed(format!("{late} times it took longer than allowed"))
        .hint("is the machine busy? the simulated device needs a processor of its own"))
}

/// A host that plays, an accident, and the ms to zero force; nothing if the host ends
/// before.
fn once(accident: Accident, seed: u32, rate: u32) -> Result<Option<f64>, Failure> {
    let firmware = Firmware::new(Options {
        seed: u64::from(seed),
        servo_hz: f64::from(rate),
        ..Options::default()
    });
    let mut device =
        Simulator::open(firmware, Noise::default(), u64::from(seed), None).map_err(failed)?;
    let mut host = Host::start(device.path())?;
    let start = Instant::now();
    while device.firmware().state() != State::Run {
        device.turn();
        if host.ended() || start.elapsed() > PLAYS_WITHIN {
            return Ok(None);
        }
    }
    // the accident comes at any moment between two heartbeats, and under force
    let from = Instant::now();
    let wait = Duration::from_micros(20_000 + 397 * u64::from(seed % 100));
    while from.elapsed() < wait || device.firmware().held_n().abs() < 0.5 {
        device.turn();
        if host.ended() || start.elapsed() > PLAYS_WITHIN {
            return Ok(None);
        }
    }
    host.befalls(accident, &mut device)?;
    let from = Instant::now();
    while device.firmware().held_n() != 0.0 {
        device.turn();
        if from.elapsed() > PLAYS_WITHIN {
            return Err(failed("the force stays"));
        }
    }
    let took_ms = from.elapsed().as_secs_f64() * 1e3;
    let from = Instant::now();
    while from.elapsed() < STAYS {
        device.turn();
        if device.firmware().held_n() != 0.0 || !device.firmware().state().latched() {
            return Err(failed("it is not latched"));
        }
    }
    Ok(Some(took_ms))
}

/// A child of this program that plays.
struct Host {
    child: Child,
}

impl Host {
    fn start(port: &str) -> Result<Self, Failure> {
        let program = std::env::current_exe().map_err(failed)?;
        let child = Command::new(program)
            .args(["device", "hold", "--seconds", "60", "--port", port])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(failed)?;
        Ok(Self { child })
    }

    fn ended(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|ended| ended.is_some())
    }

    fn befalls(&mut self, accident: Accident, device: &mut Simulator) -> Result<(), Failure> {
        let signal = |signal| {
            let id = i32::try_from(self.child.id()).ok();
            let id = id.and_then(rustix::process::Pid::from_raw);
            id.ok_or_else(|| failed("the host has ended"))
                .and_then(|id| rustix::process::kill_process(id, signal).map_err(failed))
        };
        match accident {
            Accident::Killed => signal(rustix::process::Signal::KILL),
            Accident::Stopped => signal(rustix::process::Signal::STOP),
            Accident::Pulled => device.control(Control::Unplug).map_err(failed),
            Accident::Stalled => {
                let stdin = self.child.stdin.as_mut();
                let stdin = stdin.ok_or_else(|| failed("the host has no input"))?;
                writeln!(stdin, "{}", hold::STALL).map_err(failed)
            }
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // it may have ended already
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
