//! `study device safety`, hidden: measures the time to zero force in real time.
//!
//! A simulated device runs in this process on a pseudo-terminal or at an address of this
//! computer, or, on Unix, this process stands between a port and a device that is an example of
//! `firmware/`. A child process is the host that plays. The child is killed, stopped (on Unix) or
//! stalled, or the cable is unplugged, repeatedly, and the time until the device's force is zero is
//! measured. The result holds for the simulated device on this machine under its present load.

use super::{hold, simulate};
use crate::cli::{Console, Failure};
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use study_device::check::quantile;
use study_device::firmware::{Firmware, Options};
use study_device::link::memory::Noise;
use study_device::link::priority;
#[cfg(unix)]
use study_device::link::relay::Relay;
#[cfg(unix)]
use study_device::link::simulator::Socket;
use study_device::link::simulator::{Control, Simulator};
#[cfg(unix)]
use study_device::serial::SerialLink;
use study_wire::message::DeviceState;

/// Arguments of `study device safety`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// Repetitions of each accident
    #[arg(long, value_name = "N", default_value_t = 200)]
    times: u32,
    /// Servo periods per second
    #[arg(long, value_name = "HZ", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(500..=20_000))]
    rate: u32,
    /// A device on this port instead of the simulated one
    #[cfg(unix)]
    #[arg(long, value_name = "PATH", conflicts_with = "tcp")]
    port: Option<String>,
    /// Reach the simulated device over TCP; on Windows there is no other way
    #[arg(long)]
    tcp: bool,
}

/// What happens to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Accident {
    Killed,
    #[cfg(unix)]
    Stopped,
    Stalled,
    Unplugged,
}

impl Accident {
    const ALL: &[Self] = &[
        Self::Killed,
        #[cfg(unix)]
        Self::Stopped,
        Self::Stalled,
        Self::Unplugged,
    ];

    fn as_str(self) -> &'static str {
        match self {
            Self::Killed => "host killed",
            #[cfg(unix)]
            Self::Stopped => "host stopped",
            Self::Stalled => "screen stalled",
            Self::Unplugged => "unplugged",
        }
    }

    /// Longest time to zero force, ms.
    fn allowed_ms(self) -> f64 {
        match self {
            Self::Stalled => 150.0,
            _ => 50.0,
        }
    }
}

/// Time for the host to start playing.
const PLAY_TIMEOUT: Duration = Duration::from_secs(20);
/// Number of attempts for one measurement.
const MAX_TRIES: u32 = 5;
/// The force has to stay zero for this time.
const ZERO_FOR: Duration = Duration::from_millis(100);

fn failed(why: impl std::fmt::Display) -> Failure {
    Failure::device(why)
}

/// Measures every accident and prints the times.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    // The device must not wait for a busy machine.
    priority::raise();
    let mut rig = rig(args)?;
    let (mut late, mut repeated) = (0, 0);
    console.out("accident             n   median   99 %    most   allowed\n")?;
    for accident in Accident::ALL.iter().copied() {
        let progress = crate::cli::console::progress(u64::from(args.times), accident.as_str());
        let mut times_ms = Vec::new();
        for n in 0..args.times {
            // On a busy machine the device may go limp before the accident.
            let mut took = None;
            for _ in 0..MAX_TRIES {
                took = once(&mut *rig, accident, n)?;
                if took.is_some() {
                    break;
                }
                repeated += 1;
            }
            times_ms.push(took.ok_or_else(|| failed("the host does not start to play"))?);
            progress.inc(1);
        }
        progress.finish_and_clear();
        times_ms.sort_by(f64::total_cmp);
        let at = |fraction: f64| quantile(&times_ms, fraction).unwrap_or_default();
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
    if repeated > 0 {
        console.say(format!(
            "{repeated} attempts were repeated because the device went limp before the accident: the machine is busy"
        ));
    }
    if late == 0 {
        return Ok(());
    }
    Err(failed(format!("{late} times exceed the allowed time"))
        .hint("repeat the measurement on an idle machine; the simulated device needs a free processor"))
}

fn rig(args: &Args) -> Result<Box<dyn Rig>, Failure> {
    #[cfg(unix)]
    if let Some(port) = &args.port {
        let device = SerialLink::open(port, 460_800).map_err(failed)?;
        return Ok(Box::new(Relay::new(Box::new(device))));
    }
    let tcp = args.tcp || cfg!(not(unix));
    Ok(Box::new(Simulated::new(0, args.rate, tcp)?))
}

/// A device whose force can be seen.
trait Rig {
    /// The next device, or the same one with a new port; its port.
    fn ready(&mut self, seed: u32) -> Result<String, Failure>;
    /// Lets a fraction of a millisecond pass.
    fn step(&mut self) -> Result<(), Failure>;
    /// Whether a playback has begun and the ramp is over.
    fn plays(&self) -> bool;
    fn force_n(&self) -> f64;
    fn latched(&self) -> bool;
    fn unplug(&mut self) -> Result<(), Failure>;
}

/// The simulated device, anew for each accident.
struct Simulated {
    rate: u32,
    tcp: bool,
    device: Simulator,
}

impl Simulated {
    fn new(seed: u32, rate: u32, tcp: bool) -> Result<Self, Failure> {
        let firmware = Firmware::new(Options {
            seed: u64::from(seed),
            servo_hz: f64::from(rate),
            ..Options::default()
        });
        let socket = match tcp {
            #[cfg(unix)]
            false => Socket::Pty { name: None },
            _ => simulate::at_address(SocketAddr::from((Ipv4Addr::LOCALHOST, 0)))?,
        };
        let device = Simulator::open(firmware, Noise::default(), u64::from(seed), socket);
        let device = device.map_err(failed)?;
        Ok(Self { rate, tcp, device })
    }
}

impl Rig for Simulated {
    fn ready(&mut self, seed: u32) -> Result<String, Failure> {
        *self = Self::new(seed, self.rate, self.tcp)?;
        Ok(self.device.path().unwrap_or_default().to_owned())
    }

    fn step(&mut self) -> Result<(), Failure> {
        self.device.step();
        Ok(())
    }

    fn plays(&self) -> bool {
        self.device.firmware().state() == DeviceState::Run
    }

    fn force_n(&self) -> f64 {
        self.device.firmware().held_n()
    }

    fn latched(&self) -> bool {
        self.device.firmware().state().latched()
    }

    fn unplug(&mut self) -> Result<(), Failure> {
        self.device.control(Control::Unplug).map_err(failed)
    }
}

/// A device on a port; it is believed what it says of itself.
#[cfg(unix)]
impl Rig for Relay {
    fn ready(&mut self, _: u32) -> Result<String, Failure> {
        self.plug().map_err(failed)
    }

    fn step(&mut self) -> Result<(), Failure> {
        Self::step(self).map_err(failed)
    }

    fn plays(&self) -> bool {
        self.state() == Some(DeviceState::Run)
    }

    fn force_n(&self) -> f64 {
        Self::force_n(self)
    }

    fn latched(&self) -> bool {
        self.state().is_some_and(DeviceState::latched)
    }

    fn unplug(&mut self) -> Result<(), Failure> {
        Self::unplug(self);
        Ok(())
    }
}

/// Starts a host that plays, causes an accident and returns the time to zero force, ms;
/// `None` if the host ends earlier.
fn once(rig: &mut dyn Rig, accident: Accident, seed: u32) -> Result<Option<f64>, Failure> {
    let mut host = Host::start(&rig.ready(seed)?)?;
    let start = Instant::now();
    while !rig.plays() {
        rig.step()?;
        if host.ended() || start.elapsed() > PLAY_TIMEOUT {
            return Ok(None);
        }
    }
    // The accident happens at any phase between two heartbeats, while there is force.
    let from = Instant::now();
    let wait = Duration::from_micros(20_000 + 397 * u64::from(seed % 100));
    while from.elapsed() < wait || rig.force_n().abs() < 0.5 {
        rig.step()?;
        if host.ended() || start.elapsed() > PLAY_TIMEOUT {
            return Ok(None);
        }
    }
    host.cause(accident, rig)?;
    let from = Instant::now();
    while rig.force_n() != 0.0 {
        rig.step()?;
        if from.elapsed() > PLAY_TIMEOUT {
            return Err(failed("the force does not become zero"));
        }
    }
    let took_ms = from.elapsed().as_secs_f64() * 1e3;
    let from = Instant::now();
    while from.elapsed() < ZERO_FOR {
        rig.step()?;
        if rig.force_n() != 0.0 || !rig.latched() {
            return Err(failed("zero force is not latched"));
        }
    }
    Ok(Some(took_ms))
}

/// A child process that plays.
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

    fn cause(&mut self, accident: Accident, rig: &mut dyn Rig) -> Result<(), Failure> {
        match accident {
            // On Unix by SIGKILL.
            Accident::Killed => self.child.kill().map_err(failed),
            #[cfg(unix)]
            Accident::Stopped => {
                let id = i32::try_from(self.child.id()).ok();
                let id = id.and_then(rustix::process::Pid::from_raw);
                let id = id.ok_or_else(|| failed("the host has ended"))?;
                rustix::process::kill_process(id, rustix::process::Signal::STOP).map_err(failed)
            }
            Accident::Unplugged => rig.unplug(),
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
        // The child may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
