//! `study device commission`: what no telemetry can show, checked by a person with a
//! ruler, a scale and the emergency switch.
//!
//! A dialog in lines. Nothing moves before a word is typed for it; low forces and speeds come
//! first; every step can be refused. The record has numbers, and is saved beside the checks of the
//! device with one page for the file of the laboratory.

pub(super) mod desk;
pub(super) mod rig;
mod self_weigh;
mod steps;
mod swing;
mod weigh;

pub(in crate::cli) use self_weigh::self_weighed;

use super::hold::ActiveDevice;
use super::record::{Record, RecordKind, prepare};
use crate::cli::device_selection::{DeviceAddress, Tested, WaitDisplay};
use crate::cli::{Console, Failure};
use crate::runner::clock::RealClock;
use desk::Terminal;
use rig::{Rig, Stop, safe};
use std::path::PathBuf;
use std::time::Duration;
use study_base::limits::Limit;
use study_device::Device;
use study_device::commission::{NUMBERS, Numbers, Side};
use study_device::host::HostSettings;
use study_report::commission::{Outcome, Page, Step, page};
use study_wire::message::{Fault, Refusal};

/// The largest force that is weighed, as a share of the device's limit.
const LARGEST: f64 = 0.8;
/// With a scale of the position beyond these the bounds of a motion mean nothing.
const PLAYABLE: [f64; 2] = [0.4, 2.5];
/// How long the device is watched when everything is over.
const LAST: Duration = Duration::from_millis(300);
/// How often a step is repeated because this computer was late.
const TRIES: u32 = 6;

/// Arguments of `study device commission`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    address: DeviceAddress,
    /// Largest force to be weighed [default: 0.8 of the device's limit]
    #[arg(long, value_name = "N", value_parser = newtons)]
    force: Option<Limit>,
    /// Folder of all results; the record is saved in its devices/
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Who does it, for the page
    #[arg(long, value_name = "NAME", default_value = "")]
    operator: String,
}

/// Why `--force` is refused.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("a force above 0 N is needed")]
struct NoForce;

fn newtons(given: &str) -> Result<Limit, NoForce> {
    let force_n: f64 = given.parse().map_err(|_| NoForce)?;
    Limit::new(force_n).map_err(|_| NoForce)
}

/// What is known so far.
pub(super) struct Bench {
    pub(super) numbers: Numbers,
    /// The largest force to be weighed, N.
    largest_n: f64,
}

impl Bench {
    /// Why no force above the lowest one is played; `None`: it may be.
    fn bar(&self) -> Option<&'static str> {
        let stop = self.numbers.emergency_stop.as_ref();
        if stop.and_then(|stop| stop.is_right()) != Some(true) {
            return Some("the emergency stop is not shown to work");
        }
        let ruler = self.numbers.ruler.filter(|ruler| ruler.is_right());
        match ruler {
            None => Some("the position is not shown to be right"),
            Some(_) => None,
        }
    }

    /// Why no force is played at all: where position and force may count the wrong way round, a
    /// spring would push.
    fn ban(&self) -> Option<String> {
        let scale = self.numbers.ruler?.scale;
        let [least, most] = PLAYABLE;
        (!(least..=most).contains(&scale))
            .then(|| format!("no force was played, because the ruler shows the scale {scale:.3}"))
    }
}

/// A step that was done or left out.
#[derive(Debug)]
pub(super) struct Made {
    pub(super) step: Step,
}

impl Made {
    /// The same of another step.
    fn of(mut self, what: &'static str, required: &str) -> Self {
        self.step.what = what;
        required.clone_into(&mut self.step.required);
        self
    }

    /// The same with other words.
    fn seen(mut self, seen: String) -> Self {
        self.step.seen = seen;
        self
    }

    fn is_open(&self) -> bool {
        self.step.outcome == Outcome::NotDone
    }
}

fn judged(what: &'static str, required: &str, ok: bool, seen: String) -> Made {
    let outcome = if ok { Outcome::Passed } else { Outcome::Failed };
    Made {
        step: Step {
            what,
            required: required.to_owned(),
            seen,
            outcome,
        },
    }
}

fn failed(what: &'static str, required: &str, why: impl Into<String>) -> Made {
    judged(what, required, false, why.into())
}

fn left_out(what: &'static str, required: &str) -> Made {
    let mut made = judged(what, required, false, "refused".to_owned());
    made.step.outcome = Outcome::NotDone;
    made
}

/// A step of the dialog.
type StepOf = fn(&mut Rig<'_>, &mut Bench) -> Result<Made, Stop>;

/// The steps in their order: the switch before any higher force.
const STEPS: [(&str, StepOf); 7] = [
    ("stroke", steps::stroke),
    ("ruler", steps::ruler),
    ("unpowered friction", steps::friction),
    ("emergency stop", steps::emergency_stop),
    ("force towards −x", |rig, bench| {
        bench.numbers.instrument = weigh::ask_instrument(rig)?;
        weigh::direction(rig, bench, Side::Minus)
    }),
    ("force towards +x", |rig, bench| {
        weigh::direction(rig, bench, Side::Plus)
    }),
    ("self-weighing", swing::step),
];

/// Runs the command.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut device = match args.address.is_program()? {
        false => ActiveDevice::Linked(Box::new(
            args.address.serial.open_serial(HostSettings::default())?,
        )),
        true => match (args.address).open_program(&mut WaitDisplay::in_a_line(console))? {
            Some(device) => ActiveDevice::Program(Box::new(device)),
            None => return Ok(()),
        },
    };
    let tested = Tested::of(device.any());
    let stroke_mm = device.stroke_mm();
    let mut device = device.into_any();
    refuse_unseen(&*device)?;
    prepare(&args.results, &tested.serial)?;
    let (done, numbers, ended) = {
        let clock = RealClock::default();
        let desk = Terminal::open(console, &clock)?;
        let mut rig = Rig::new(&mut *device, Box::new(desk));
        dialog(&mut rig, &tested, stroke_mm, args.force)
    };
    let pass = done.iter().all(|step| step.outcome == Outcome::Passed);
    let summary: Vec<String> = (done.iter())
        .map(|step| format!("{} {}", step.what, step.outcome.as_str()))
        .collect();
    let summary = summary.join(", ");
    // What was found before an end still counts.
    if (done.iter()).any(|step| step.outcome != Outcome::NotDone) || ended.is_none() {
        let parts = serde_json::json!({ "version": NUMBERS, "steps": done, "numbers": numbers });
        let record = Record::new(RecordKind::Commission, tested, pass, summary.clone(), parts);
        let path = record.save(&args.results)?;
        let html = page(&Page {
            serial: &record.tested.serial,
            firmware: record.tested.firmware.as_deref(),
            simulated: record.tested.simulated,
            operator: &args.operator,
            at: record.at,
            steps: &done,
            pass,
        });
        let beside = path.with_extension("html");
        std::fs::write(&beside, html).map_err(|e| Failure::file(&beside, &e))?;
        console.say(format!("saved: {}, {}", path.display(), beside.display()));
    }
    if let Some(ended) = ended {
        return Err(ended.failure());
    }
    console.out(format!("{summary}\n"))?;
    if pass {
        return Ok(());
    }
    let open = done.iter().any(|step| step.outcome == Outcome::Failed);
    Err(Failure::device(match open {
        true => "the device failed a physical check",
        false => "not every physical check was done",
    })
    .hint("do not use it with participants before this is corrected"))
}

/// Refuses a device of which nobody would know where its handle is.
fn refuse_unseen(device: &dyn Device) -> Result<(), Failure> {
    if device.identity().telemetry {
        return Ok(());
    }
    Err(Failure::device(
        "the device reports no samples: nothing would bound the motion of its handle",
    )
    .hint(
        "a program has to say `\"telemetry\": true` and send samples (docs/devices.md, section 3)",
    ))
}

/// All steps; also what ended them early.
fn dialog(
    rig: &mut Rig<'_>,
    tested: &Tested,
    stroke_mm: Option<[f64; 2]>,
    force: Option<Limit>,
) -> (Vec<Step>, Numbers, Option<Stop>) {
    let limit_n = rig.limits.force_n.get();
    let mut bench = Bench {
        numbers: Numbers {
            version: NUMBERS.to_owned(),
            stroke_mm,
            ..Numbers::default()
        },
        largest_n: force.map_or(LARGEST * limit_n, |force| force.get().min(limit_n)),
    };
    let mut done = Vec::new();
    let mut ended = greet(rig, tested).err().map(Stop::Failed);
    for (what, step) in STEPS {
        let made = match ended {
            None => repeated(rig, &mut bench, step),
            Some(_) => Ok(left_out(what, "").seen("not reached".to_owned())),
        };
        rig.limp();
        let made = made.unwrap_or_else(|stop| {
            ended = Some(stop);
            left_out(what, "").seen("not reached".to_owned())
        });
        if ended.is_none() {
            let step = &made.step;
            let outcome = step.outcome.as_str();
            let said = rig.say(&format!("{} {outcome}: {}", step.what, step.seen));
            ended = said.err().map(Stop::Failed);
        }
        done.push(made.step);
    }
    // a program that is told to be limp needs a moment
    rig.settle(LAST);
    (done, bench.numbers, ended)
}

fn greet(rig: &mut Rig<'_>, tested: &Tested) -> Result<(), Failure> {
    rig.say(&format!(
        "Device {}, firmware {}.\nNothing moves before you type `go` for it. Keep the emergency switch at hand. \
         `skip` leaves a step out; the record says so. Ctrl-C ends everything, and the device goes limp.",
        safe(&tested.serial),
        safe(tested.firmware.as_deref().unwrap_or("not told"))
    ))?;
    if tested.simulated {
        rig.say("This device is simulated: nothing is measured, and the record says so.")?;
    }
    Ok(())
}

/// Whether a device went limp because of its motion, or the host stopped it for the same reason, and
/// not because of its emergency switch.
fn is_of_motion(why: &str) -> bool {
    let faults = [Fault::Velocity, Fault::Stroke, Fault::Encoder].map(|fault| fault.as_str());
    (faults.iter().chain(&rig::OWN)).any(|own| why.contains(own))
}

/// Whether a device gave no force because this computer was late.
fn is_late(why: &str) -> bool {
    let late = [
        Fault::Watchdog.as_str(),
        Refusal::NoHeartbeat.as_str(),
        rig::STOOD_STILL,
    ];
    late.iter().any(|late| why.contains(late))
}

/// A step, again if this computer was late.
fn repeated(rig: &mut Rig<'_>, bench: &mut Bench, step: StepOf) -> Result<Made, Stop> {
    for _ in 1..TRIES {
        let made = step(rig, bench)?;
        // what a signal interrupted says nothing about the device
        rig.ended()?;
        if !is_late(&made.step.seen) || made.step.outcome == Outcome::Passed {
            return Ok(made);
        }
        rig.limp();
        rig.say(
            "This computer was late, and the device gives no force then, as it has to. Once more:",
        )?;
    }
    let made = step(rig, bench)?;
    rig.ended()?;
    Ok(made)
}

#[cfg(test)]
mod tests;
