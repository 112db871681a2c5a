//! `study device simulate`: a device on a pseudo-terminal.

use crate::cli::{Console, Failure, Kind};
use crate::device::firmware::{Firmware, Flaw, Options};
use crate::device::link::memory::Noise;
use crate::device::link::pty::{Control, Simulator};
use std::io::BufRead as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Arguments of `study device simulate`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// Servo periods a second
    #[arg(long, value_name = "HZ", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(500..=20_000))]
    rate: u32,
    /// Seed of the simulated hand and of the faults
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Time without a heartbeat after which it goes limp: 30, or 50 to 200 for a
    /// slow link
    #[arg(long, value_name = "MS", default_value_t = 30, value_parser = clap::value_parser!(u16).range(10..=1000))]
    watchdog: u16,
    /// Its serial number
    #[arg(long, value_name = "NAME", default_value = "simulated-1")]
    serial: String,
    /// Make this name a symbolic link to the port, wherever it is plugged in
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Something that goes wrong: corrupt, drop, duplicate, reorder, delay with a
    /// share of the frames (such as drop=0.01). May be given several times
    #[arg(long, value_name = "FAULT", value_parser = fault)]
    fault: Vec<FaultArg>,
    /// A defect that it has all the time, to try `study device check` on it
    #[arg(long, value_name = "DEFECT", value_parser = flaw)]
    flaw: Option<Flaw>,
}

fn flaw(given: &str) -> Result<Flaw, String> {
    Flaw::named(given).ok_or_else(|| {
        let names: Vec<&str> = Flaw::ALL.iter().map(|(_, name, _)| *name).collect();
        format!("it is one of {}", names.join(", "))
    })
}

/// What stands on standard input, line by line.
const CONTROLS: &str = "unplug, plug, reset, trip, stall MS, quit";
/// How late a frame with the fault `delay` is.
const LATE: Duration = Duration::from_millis(20);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Bad {
    Corrupt,
    Drop,
    Duplicate,
    Reorder,
    Delay,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct FaultArg {
    what: Bad,
    share: f64,
}

fn fault(given: &str) -> Result<FaultArg, String> {
    let (name, share) = given.split_once('=').unwrap_or((given, "0.01"));
    let what = match name {
        "corrupt" => Bad::Corrupt,
        "drop" => Bad::Drop,
        "duplicate" => Bad::Duplicate,
        "reorder" => Bad::Reorder,
        "delay" => Bad::Delay,
        _ => return Err("it is one of corrupt, drop, duplicate, reorder, delay".to_owned()),
    };
    match share.parse() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(FaultArg { what, share }),
        _ => Err(format!("the share of frames is 0 to 1, not {share}")),
    }
}

fn noise(faults: &[FaultArg]) -> Noise {
    let mut noise = Noise {
        late: LATE,
        ..Noise::default()
    };
    for FaultArg { what, share } in faults {
        *match what {
            Bad::Corrupt => &mut noise.corrupt,
            Bad::Drop => &mut noise.drop,
            Bad::Duplicate => &mut noise.duplicate,
            Bad::Reorder => &mut noise.reorder,
            Bad::Delay => &mut noise.delay,
        } = *share;
    }
    noise
}

/// What a line of standard input asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Word {
    Do(Control),
    Quit,
}

fn word(line: &str) -> Option<Word> {
    let mut words = line.split_whitespace();
    let word = match words.next()? {
        "unplug" => Word::Do(Control::Unplug),
        "plug" => Word::Do(Control::Plug),
        "reset" => Word::Do(Control::Reset),
        "trip" => Word::Do(Control::Trip),
        "stall" => {
            let ms = words.next()?.parse().ok()?;
            Word::Do(Control::Stall(Duration::from_millis(ms)))
        }
        "quit" => Word::Quit,
        _ => return None,
    };
    words.next().is_none().then_some(word)
}

/// Does it, until it is told to end.
pub(in crate::cli) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let firmware = Firmware::new(Options {
        seed: args.seed,
        servo_hz: f64::from(args.rate),
        watchdog_ms: args.watchdog,
        serial: args.serial.clone(),
        flaw: args.flaw,
        ..Options::default()
    });
    let failed = |e: crate::device::link::LinkError| Failure::new(Kind::Device, e);
    let mut simulator = Simulator::open(firmware, noise(&args.fault), args.seed, args.link.clone())
        .map_err(failed)?;
    console.out(format!("{}\n", simulator.path()))?;
    console.say(format!(
        "a simulated device of {} Hz; nothing that it reports is measured",
        args.rate
    ));
    console.say(format!(
        "in another terminal: study device check --port {}",
        simulator.path()
    ));
    let lines = lines();
    let ended = ended();
    while !ended.load(Ordering::Relaxed) {
        for _ in 0..64 {
            simulator.turn();
        }
        while let Ok(line) = lines.try_recv() {
            match word(&line) {
                Some(Word::Quit) => ended.store(true, Ordering::Relaxed),
                Some(Word::Do(what)) => {
                    simulator.control(what).map_err(failed)?;
                    // so that whoever asked knows when
                    match what {
                        Control::Plug => console.out(format!("{}\n", simulator.path()))?,
                        _ => console.out(format!("{}\n", line.trim()))?,
                    }
                }
                None => console.say(format!("one of: {CONTROLS}")),
            }
        }
    }
    let punctuality = simulator.punctuality();
    console.say(format!(
        "{} servo periods; late by at most {} us in 50 %, {} us in 99 %, {} us in 99.9 %; time stood still {} times, {:.0} ms in all",
        punctuality.turns(),
        punctuality.percentile_us(0.5),
        punctuality.percentile_us(0.99),
        punctuality.percentile_us(0.999),
        punctuality.slips,
        punctuality.slipped.as_secs_f64() * 1e3,
    ));
    Ok(())
}

/// Lines of standard input, as they come; its end means nothing.
fn lines() -> Receiver<String> {
    let (say, lines) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { return };
            if !line.trim().is_empty() && say.send(line).is_err() {
                return;
            }
        }
    });
    lines
}

/// Raised by the signals that ask a program to end.
fn ended() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [
        signal_hook::consts::SIGINT,
        signal_hook::consts::SIGTERM,
        signal_hook::consts::SIGHUP,
    ] {
        // where it cannot be caught it ends the program at once
        let _ = signal_hook::flag::register(signal, Arc::clone(&flag));
    }
    flag
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_faults_are_read_strictly() {
        assert_eq!(word("unplug"), Some(Word::Do(Control::Unplug)));
        let stall = Control::Stall(Duration::from_millis(5));
        assert_eq!(word(" stall 5 "), Some(Word::Do(stall)));
        assert_eq!(word("stall"), None);
        assert_eq!(word("unplug now"), None);
        assert_eq!(fault("drop=0.1").unwrap().share, 0.1);
        assert_eq!(fault("delay").unwrap().share, 0.01);
        assert!(fault("drop=nan").is_err());
        assert!(fault("dorp").is_err());
        let noise = noise(&[fault("drop=0.1").unwrap(), fault("delay=1").unwrap()]);
        assert_eq!((noise.drop, noise.delay, noise.corrupt), (0.1, 1.0, 0.0));
    }
}
