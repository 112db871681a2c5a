//! `study device simulate`: a device on a pseudo-terminal or at an address of this computer.

use crate::cli::{Console, Failure, Kind};
use crate::tui::Signals;
use std::net::SocketAddr;
#[cfg(unix)]
use std::path::PathBuf;
use std::time::Duration;
use study_device::firmware::{Firmware, Flaw, Options, Wrong, WrongLoads};
use study_device::link::memory::Noise;
use study_device::link::priority;
use study_device::link::simulator::{Control, Simulator, Socket};
use study_device::link::tcp::Token;

/// Arguments of `study device simulate`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// Servo periods per second
    #[arg(long, value_name = "HZ", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(500..=20_000))]
    rate: u32,
    /// Seed of the simulated hand and of the faults
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Time without a heartbeat after which it goes limp: 30, or 50 to 200 for a
    /// slow link
    #[arg(long, value_name = "MS", default_value_t = 30, value_parser = clap::value_parser!(u16).range(10..=1000))]
    watchdog: u16,
    /// Serial number
    #[arg(long, value_name = "NAME", default_value = "simulated-1")]
    serial: String,
    /// Create a symbolic link with this name that always leads to the current port
    #[cfg(unix)]
    #[arg(long, value_name = "PATH", conflicts_with = "listen")]
    link: Option<PathBuf>,
    /// Wait for a host at this address of this computer instead of on a pseudo-terminal; port 0 is
    /// any free one. Others can reach an address that is not of the loopback interface, and
    /// need the token that is printed
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, require_equals = true,
          default_missing_value = ANY_PORT)]
    listen: Option<SocketAddr>,
    /// Fault of the link: corrupt, drop, duplicate, reorder or delay, with the fraction of
    /// frames, such as drop=0.01. May be repeated
    #[arg(long, value_name = "FAULT", value_parser = fault)]
    fault: Vec<FaultArg>,
    /// Planted defect, to try out `study device check`
    #[arg(long, value_name = "DEFECT", value_parser = flaw)]
    flaw: Option<Flaw>,
    /// Wrong force, to try out sessions and `study device check`; with `@7` from the
    /// seventh load on, with `@7-9` until the ninth
    #[arg(long, value_name = "HOW", value_parser = wrong)]
    wrong: Option<WrongLoads>,
}

/// Any free port, which only this computer can reach.
const ANY_PORT: &str = "127.0.0.1:0";

/// Why an argument is rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum ArgumentError {
    #[error("use one of {names}", names = Flaw::ALL.map(|(_, name, _)| name).join(", "))]
    UnknownFlaw,
    #[error("use one of {names}", names = wrong_names())]
    UnknownWrong,
    #[error("after @ comes the first wrong load, or the first and the last, such as 7-9")]
    Loads,
    #[error("use one of corrupt, drop, duplicate, reorder, delay")]
    UnknownFault,
    #[error("the fraction of frames has to be between 0 and 1, not {0}")]
    Fraction(String),
}

fn flaw(given: &str) -> Result<Flaw, ArgumentError> {
    Flaw::named(given).ok_or(ArgumentError::UnknownFlaw)
}

fn wrong_names() -> String {
    let names: Vec<&str> = Wrong::ALL.iter().map(|(_, name, _)| *name).collect();
    names.join(", ")
}

fn wrong(given: &str) -> Result<WrongLoads, ArgumentError> {
    let (name, loads) = given.split_once('@').unwrap_or((given, "1"));
    let wrong = Wrong::named(name).ok_or(ArgumentError::UnknownWrong)?;
    let (from, to) = loads.split_once('-').unwrap_or((loads, ""));
    let number = |text: &str| text.parse::<u32>().map_err(|_| ArgumentError::Loads);
    let from = number(from)?;
    let to = if to.is_empty() { u32::MAX } else { number(to)? };
    Ok(WrongLoads {
        wrong,
        loads: [from, to],
    })
}

/// Commands on standard input, one per line.
const CONTROLS: &str = "unplug, plug, reset, trip, stall MS, hold MM, free, pull N, where, quit";
/// Additional delay of a frame with the fault `delay`.
const EXTRA_DELAY: Duration = Duration::from_millis(20);

/// A fault of the link and the fraction of frames that have it.
#[derive(Debug, Clone, Copy)]
struct FaultArg {
    what: fn(&mut Noise) -> &mut f64,
    fraction: f64,
}

fn fault(given: &str) -> Result<FaultArg, ArgumentError> {
    let (name, fraction) = given.split_once('=').unwrap_or((given, "0.01"));
    let what: fn(&mut Noise) -> &mut f64 = match name {
        "corrupt" => |noise| &mut noise.corrupt,
        "drop" => |noise| &mut noise.drop,
        "duplicate" => |noise| &mut noise.duplicate,
        "reorder" => |noise| &mut noise.reorder,
        "delay" => |noise| &mut noise.delay,
        _ => return Err(ArgumentError::UnknownFault),
    };
    match fraction.parse() {
        Ok(fraction) if (0.0..=1.0).contains(&fraction) => Ok(FaultArg { what, fraction }),
        _ => Err(ArgumentError::Fraction(fraction.to_owned())),
    }
}

fn noise(faults: &[FaultArg]) -> Noise {
    let mut noise = Noise {
        extra_delay: EXTRA_DELAY,
        ..Noise::default()
    };
    for FaultArg { what, fraction } in faults {
        *what(&mut noise) = *fraction;
    }
    noise
}

/// A command on standard input.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Command {
    Control(Control),
    /// Prints where the handle is, where it has been, how often at a stop, and the force.
    Where,
    Quit,
}

fn command(line: &str) -> Option<Command> {
    let mut words = line.split_whitespace();
    let command = match words.next()? {
        "unplug" => Command::Control(Control::Unplug),
        "plug" => Command::Control(Control::Plug),
        "reset" => Command::Control(Control::Reset),
        "trip" => Command::Control(Control::Trip),
        "stall" => {
            let ms = words.next()?.parse().ok()?;
            Command::Control(Control::Stall(Duration::from_millis(ms)))
        }
        "hold" => {
            let x_mm = words.next()?.parse().ok().filter(|x: &f64| x.is_finite())?;
            Command::Control(Control::Hold(x_mm))
        }
        "free" => Command::Control(Control::LetGo),
        "pull" => {
            let force_n = words.next()?.parse().ok().filter(|n: &f64| n.is_finite())?;
            Command::Control(Control::Pull(force_n))
        }
        "where" => Command::Where,
        "quit" => Command::Quit,
        _ => return None,
    };
    words.next().is_none().then_some(command)
}

/// Runs the device until it is told to end.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let firmware = Firmware::new(Options {
        seed: args.seed,
        servo_hz: f64::from(args.rate),
        watchdog_ms: args.watchdog,
        serial: args.serial.clone(),
        flaw: args.flaw,
        wrong: args.wrong,
        ..Options::default()
    });
    let failed = |e: study_device::link::LinkError| Failure::device(e);
    let socket = socket(args)?;
    let mut simulator =
        Simulator::open(firmware, noise(&args.fault), args.seed, socket).map_err(failed)?;
    let port = |simulator: &Simulator| format!("{}\n", simulator.path().unwrap_or_default());
    console.out(port(&simulator))?;
    console.say(format!(
        "simulated device with a servo rate of {} Hz; nothing that it reports is measured",
        args.rate
    ));
    let check = "study device check --port";
    console.say(format!(
        "in another terminal: {check} {}",
        port(&simulator).trim_end()
    ));
    let lines = super::hold::input_lines();
    // A device has a processor of its own.
    priority::raise();
    let signals = Signals::register().map_err(Failure::device)?;
    let mut ended = false;
    while !ended && signals.take().is_none() {
        for _ in 0..64 {
            simulator.step();
        }
        while let Ok(line) = lines.try_recv() {
            match command(&line) {
                Some(Command::Quit) => ended = true,
                Some(Command::Where) => {
                    let at = simulator.firmware().place();
                    let [low, high] = at.range_mm;
                    console.out(format!(
                        "{:.3} mm, {low:.3} to {high:.3} mm, {} stops, {:.3} N\n",
                        at.x_mm, at.stops, at.force_n
                    ))?;
                }
                Some(Command::Control(what)) => {
                    simulator.control(what).map_err(failed)?;
                    // Confirms that the command was executed.
                    console.out(match what {
                        Control::Plug => port(&simulator),
                        _ => format!("{}\n", line.trim()),
                    })?;
                }
                None => console.say(format!("unknown command; use one of: {CONTROLS}")),
            }
        }
    }
    let timing = simulator.timing();
    console.say(format!(
        "{} servo periods; lateness at most {} us in 50 %, {} us in 99 %, {} us in 99.9 % of them; {} pauses, {:.0} ms in total",
        timing.steps(),
        timing.quantile_us(0.5),
        timing.quantile_us(0.99),
        timing.quantile_us(0.999),
        timing.pauses,
        timing.paused.as_secs_f64() * 1e3,
    ));
    Ok(())
}

/// Where the device is found.
fn socket(args: &Args) -> Result<Socket, Failure> {
    match args.listen {
        Some(at) => at_address(at),
        #[cfg(unix)]
        None => {
            if let Some(name) = args.link.as_deref().filter(|name| is_in_use(name)) {
                return Err(
                    Failure::device(format!("{}: the port of another device", name.display()))
                        .hint("stop that device, or choose another name; if it no longer runs, remove the link"),
                );
            }
            Ok(Socket::Pty {
                name: args.link.clone(),
            })
        }
        #[cfg(not(unix))]
        None => at_address(SocketAddr::from(([127, 0, 0, 1], 0))),
    }
}

/// Whether a symbolic link leads to a port that exists. The link of a device that was killed leads nowhere.
#[cfg(unix)]
fn is_in_use(link: &std::path::Path) -> bool {
    let is_link = std::fs::symlink_metadata(link).is_ok_and(|found| found.is_symlink());
    is_link && link.exists()
}

/// At an address, with a new token.
pub(super) fn at_address(at: SocketAddr) -> Result<Socket, Failure> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)
        .map_err(|e| Failure::device(format!("no random number for the token: {e}")))?;
    let token: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let token = Token::new(&token).map_err(|e| Failure::new(Kind::Bug, e))?;
    Ok(Socket::Tcp { at, token })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_faults_are_read_strictly() {
        assert_eq!(command("unplug"), Some(Command::Control(Control::Unplug)));
        let stall = Control::Stall(Duration::from_millis(5));
        assert_eq!(command(" stall 5 "), Some(Command::Control(stall)));
        assert_eq!(command("stall"), None);
        assert_eq!(command("unplug now"), None);
        assert_eq!(fault("drop=0.1").unwrap().fraction, 0.1);
        assert_eq!(fault("delay").unwrap().fraction, 0.01);
        assert!(fault("drop=nan").is_err());
        assert!(fault("dorp").is_err());
        let noise = noise(&[fault("drop=0.1").unwrap(), fault("delay=1").unwrap()]);
        assert_eq!((noise.drop, noise.delay, noise.corrupt), (0.1, 1.0, 0.0));
    }
}
