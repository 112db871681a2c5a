//! `study doctor`: is this computer, its disk, its terminal and its device fit for a session?
//!
//! The files here measure; [`crate::doctor`] judges.

mod connection;
mod disk;
mod surroundings;
mod text;
mod ticks;
#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
use unix as system;
#[cfg(windows)]
use windows as system;

use super::device_selection::DeviceAddress;
use super::{Console, Failure, Kind, study_folder};
use crate::doctor::{self, About, Disk, Fit, Judgement, Measured, Timing, Use};
use crate::tui::Signals;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use study_analysis::load;
use study_device::link::Priority;
use study_plan::protocol::DeviceKind;
use study_session::store::disk::RealDisk;
use study_session::store::{StudyFolder, layout};
use ticks::Ticks;

/// `study-doctor/1`.
const FORMAT: &str = "study-doctor/1";
/// How long lateness is measured while nothing else is done.
const QUIET: Duration = Duration::from_millis(2500);
/// Longest time of everything.
const LONGEST: Duration = Duration::from_secs(20);
/// A disk that does not answer for so long beyond its time is given up.
const HUNG: Duration = Duration::from_secs(5);
/// Time between two looks whether a signal has arrived.
const LOOK: Duration = Duration::from_millis(20);
/// Time for a measurement to end after a signal, and to remove what it has made.
const LAST: Duration = Duration::from_secs(2);

/// Arguments of `study doctor`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder, a study in it (which then keeps the record), or a protocol, whose device
    /// decides what is asked [default: results]
    #[arg(value_name = "RESULTS|PROTOCOL")]
    place: Option<PathBuf>,
    #[command(flatten)]
    address: DeviceAddress,
    /// Folder of all results, beside a protocol
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// What is asked of which folder.
struct Place {
    /// The folder in which the disk is tried. It exists.
    folder: PathBuf,
    /// The study that keeps the record.
    study: Option<StudyFolder>,
    /// The kind of device of the protocol.
    kind: Option<DeviceKind>,
}

impl Place {
    fn of(args: &Args) -> Result<Self, Failure> {
        let given = args.place.as_ref().unwrap_or(&args.results);
        if given.join(layout::MANIFEST).symlink_metadata().is_ok() {
            let study = StudyFolder::open(given)?;
            let kind = load::frozen(&study)?.protocol.device.kind;
            return Ok(Self {
                folder: given.clone(),
                study: Some(study),
                kind: Some(kind),
            });
        }
        let is_protocol = given.is_file() || given.join(layout::PROTOCOL).is_file();
        let (results, kind) = match args.place.is_some() && is_protocol {
            true => {
                let kind = load::load(given)?.protocol.device.kind;
                (&args.results, Some(kind))
            }
            false => (given, None),
        };
        if results.exists() && !results.is_dir() {
            let shown = results.display();
            return Err(Failure::input(format!("{shown} is a file, not a folder"))
                .hint("RESULTS is the folder for the results of all studies, or of one"));
        }
        Ok(Self {
            folder: existing(results),
            study: None,
            kind,
        })
    }
}

/// The folder, or the nearest one around it that exists: sessions make the others.
fn existing(folder: &Path) -> PathBuf {
    let around = folder.ancestors().filter(|a| !a.as_os_str().is_empty());
    let found = around.into_iter().find(|folder| folder.is_dir());
    found.unwrap_or(Path::new(".")).to_owned()
}

/// What ended a measurement that waits.
enum Waited<T> {
    Done(T),
    TooLong,
}

/// Looks for signals while something is measured in other threads.
struct Watch {
    signals: Signals,
    begun: Instant,
    /// Tells the threads to end.
    stop: Arc<AtomicBool>,
}

impl Watch {
    fn new() -> Result<Self, Failure> {
        Ok(Self {
            signals: Signals::register().map_err(Failure::device)?,
            begun: Instant::now(),
            stop: Arc::default(),
        })
    }

    fn left(&self) -> Duration {
        LONGEST.saturating_sub(self.begun.elapsed())
    }

    /// Fails if a signal has arrived.
    fn goes_on(&self) -> Result<(), Failure> {
        let Some(name) = self.signals.take() else {
            return Ok(());
        };
        self.stop.store(true, Ordering::SeqCst);
        Err(Failure::device(format!(
            "{name} ended it before everything was measured"
        )))
    }

    /// Lets time pass.
    fn pause(&self, time: Duration) -> Result<(), Failure> {
        let since = Instant::now();
        while since.elapsed() < time {
            self.goes_on()?;
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// Runs something in a thread of its own, which is left behind if it takes too long. After a
    /// signal it has a moment to end.
    fn run<T: Send + 'static>(
        &self,
        longest: Duration,
        work: impl FnOnce(Arc<AtomicBool>) -> T + Send + 'static,
    ) -> Result<Waited<T>, Failure> {
        let (send, receive) = channel();
        let stop = Arc::clone(&self.stop);
        std::thread::spawn(move || {
            // Nobody waits any more for what comes too late.
            let _ = send.send(work(stop));
        });
        let since = Instant::now();
        loop {
            match receive.recv_timeout(LOOK) {
                Ok(done) => return Ok(Waited::Done(done)),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Failure::new(Kind::Bug, "a measurement failed"));
                }
                Err(RecvTimeoutError::Timeout) if since.elapsed() > longest => {
                    self.stop.store(true, Ordering::SeqCst);
                    return Ok(Waited::TooLong);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(ended) = self.goes_on() {
                let _ = receive.recv_timeout(LAST);
                return Err(ended);
            }
        }
    }
}

/// Measures, judges and prints; fails if the machine is not fit for what was asked.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let place = Place::of(args)?;
    let connection = connection::named(&args.address, place.kind)?;
    let asked = match (&connection, place.kind) {
        (Some(connection), _) => Some(connection.purpose()),
        (None, Some(DeviceKind::Serial)) => Some(Use::Serial),
        (None, Some(DeviceKind::Process)) => Some(Use::Hand),
        (None, _) => None,
    };
    let watch = Watch::new()?;
    if !args.json {
        console.say("measures for some seconds; start nothing else meanwhile");
    }
    let measured = measure(&place.folder, connection, &watch)?;
    let judgement = doctor::judge(&measured);
    let at = study_folder::now().wall;
    let document = serde_json::json!({
        "format": FORMAT,
        "at": at,
        "tool_version": env!("CARGO_PKG_VERSION"),
        "seconds": watch.begun.elapsed().as_secs_f64(),
        "asked": asked,
        "measured": measured,
        "findings": judgement.findings,
        "verdicts": judgement.verdicts,
    });
    // A disk that does not answer would be waited for.
    let answers = measured.disk.hung_s.is_none();
    if let Some(study) = place.study.as_ref().filter(|_| answers) {
        let name = format!("{}.json", at.to_utc().format("%Y-%m-%dT%H-%M-%SZ"));
        let record = format!("{document:#}\n");
        match study.save_doctor(&name, record.as_bytes()) {
            Ok(path) => console.say(format!("saved: {}", path.display())),
            // The findings say why, and are printed all the same.
            Err(error) => console.say(format!("warning: no record was saved: {error}")),
        }
    }
    match args.json {
        true => console.json(&document)?,
        false => {
            let width = console.terminal.then_some(console.width);
            console.out(text::page(&measured, &judgement, width))?;
        }
    }
    verdict(&judgement, asked)
}

/// Exit code 4 if nothing can be saved as it has to be, else 3 if what was asked is not fit.
fn verdict(judgement: &Judgement, asked: Option<Use>) -> Result<(), Failure> {
    let names = |against: Vec<&doctor::Finding>| {
        let names: Vec<&str> = against.iter().map(|finding| finding.id).collect();
        names.join(", ")
    };
    let of_disk = judgement.against(Some(About::Disk), Use::Hand);
    if !of_disk.is_empty() {
        let why = names(of_disk);
        return Err(
            Failure::results(format!("the results folder is not fit for sessions: {why}"))
                .hint("the findings above say what to do"),
        );
    }
    let Some(asked) = asked.filter(|asked| judgement.of(*asked) == Fit::NotFit) else {
        return Ok(());
    };
    let (what, why) = (asked.as_str(), names(judgement.against(None, asked)));
    Err(
        Failure::device(format!("not fit for a session ({what}): {why}"))
            .hint("the findings above say what to do"),
    )
}

/// Measures everything, one after the other.
fn measure(
    folder: &Path,
    connection: Option<connection::Named>,
    watch: &Watch,
) -> Result<Measured, Failure> {
    let machine = surroundings::machine();
    let terminal = surroundings::terminal();
    let page = surroundings::page();
    let no_thread = |error| Failure::device(format!("no thread can be started: {error}"));
    let ticks = Ticks::start().map_err(no_thread)?;
    watch.pause(QUIET)?;
    let quiet = ticks.end();
    let ticks = Ticks::start().map_err(no_thread)?;
    let disk = tried(folder, watch)?;
    let saving = ticks.end();
    let timing = Timing {
        priority: quiet.as_ref().map_or(Priority::Usual, |(_, given)| *given),
        permitted: system::permitted_priority(),
        quiet: quiet.map(|(lateness, _)| lateness),
        saving: saving.map(|(lateness, _)| lateness),
    };
    let device = match connection {
        None => None,
        Some(named) => {
            let (longest, begun) = (watch.left(), named.clone());
            Some(match watch.run(longest, move |_| named.measure())? {
                Waited::Done(device) => device,
                Waited::TooLong => begun.silent(longest),
            })
        }
    };
    Ok(Measured {
        machine,
        timing,
        disk,
        terminal,
        page,
        device,
    })
}

/// Tries the disk of a folder.
fn tried(folder: &Path, watch: &Watch) -> Result<Disk, Failure> {
    let real = folder.to_owned();
    let longest = disk::TIME + HUNG;
    let tried = watch.run(longest, move |stop| {
        disk::measure(Arc::new(RealDisk), &real, &stop)
    })?;
    Ok(match tried {
        Waited::Done(measured) => measured?,
        Waited::TooLong => Disk {
            folder: folder.display().to_string(),
            file_system: system::file_system(folder),
            hung_s: Some(longest.as_secs_f64()),
            left: Some(folder.join(layout::TRIAL).display().to_string()),
            ..Disk::default()
        },
    })
}
