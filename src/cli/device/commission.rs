//! `study device commission`: what no telemetry can show, checked by a person with a weight,
//! a ruler and the emergency switch.
//!
//! A dialog in lines. The answers and what the device reported are saved beside the checks
//! of the device, with one page for the file of the laboratory.

use super::hold::input_lines;
use super::record::{Record, RecordKind};
use crate::cli::device_selection::{SerialPortArgs, Tested};
use crate::cli::{Console, Failure, Kind};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_base::text::Untrusted;
use study_device::host::HostSettings;
use study_device::link::LinkedDevice;
use study_device::{Device as _, Report, Stimulus};
use study_haptics::model::{Branch, Provenance, Realization, Trained, Units};
use study_report::commission::{Outcome, Page, Step, page};
use study_wire::message::{Fault, Refusal};
use study_wire::predict::{Direction, Lookup};

/// Force on the weight and at the emergency stop, N.
const FORCE_N: f64 = 2.0;
/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// Largest error of the force, as a share.
const FORCE_ERROR: f64 = 0.1;
/// Largest error of the scale of the position, as a share, and of its origin, mm.
const SCALE_ERROR: f64 = 0.02;
const ORIGIN_MM: f64 = 1.0;
/// Least distance of the two places on the ruler, mm.
const APART_MM: f64 = 10.0;
/// Time for a load, a start, a stop, or until a device answers again.
const ANSWER: Duration = Duration::from_secs(10);
/// How often a step is repeated because this computer was late.
const TRIES: u32 = 6;
/// Time between two polls, as in a session.
const POLL: Duration = Duration::from_millis(20);

/// Arguments of `study device commission`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    port: SerialPortArgs,
    /// Folder of all results; the record is saved in its devices/
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Who does it, for the page
    #[arg(long, value_name = "NAME", default_value = "")]
    operator: String,
}

/// Runs the command.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let device = args.port.open_serial(HostSettings::default())?;
    let tested = Tested::of(&device);
    let stroke_mm = device.status().device.map(|told| told.stroke_mm);
    let stroke_mm = stroke_mm.ok_or_else(|| Failure::device("the device told no stroke"))?;
    let mut rig = Rig {
        limits: device.identity().limits,
        device,
        lines: input_lines(),
        start: Instant::now(),
        stroke_mm,
        x_mm: None,
        trouble: None,
        console,
    };
    rig.say(&format!(
        "Device {}, firmware {}.\nAnswer each question with Enter; `skip` leaves a step out.",
        Untrusted(&tested.serial),
        Untrusted(tested.firmware.as_deref().unwrap_or("not told"))
    ))?;
    if tested.simulated {
        rig.say("This device is simulated: nothing is measured, and the record says so.")?;
    }
    let steps = [
        weight as fn(&mut Rig<'_>) -> Result<Step, Failure>,
        ruler,
        emergency_stop,
        friction,
    ];
    let mut done = Vec::new();
    for step in steps {
        let mut tries = 0;
        let step = loop {
            let made = step(&mut rig)?;
            rig.release();
            tries += 1;
            let late = [Fault::Watchdog.as_str(), Refusal::NoHeartbeat.as_str()]
                .iter()
                .any(|why| made.seen.contains(why));
            if !late || tries == TRIES {
                break made;
            }
            rig.say("This computer was late, and the device gives no force then, as it has to. Once more:")?;
        };
        rig.say(&format!("{}: {}", step.outcome.as_str(), step.seen))?;
        done.push(step);
    }
    let pass = done.iter().all(|step| step.outcome == Outcome::Passed);
    let summary: Vec<String> = (done.iter())
        .map(|step| format!("{} {}", step.what, step.outcome.as_str()))
        .collect();
    let parts = serde_json::to_value(&done).map_err(|e| Failure::new(Kind::Bug, e))?;
    let summary = summary.join(", ");
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
    console.out(format!("{summary}\n"))?;
    console.say(format!("saved: {}, {}", path.display(), beside.display()));
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

/// The device and the person.
struct Rig<'c> {
    device: LinkedDevice,
    limits: Limits,
    stroke_mm: [f64; 2],
    lines: Receiver<String>,
    start: Instant,
    /// The last reported position.
    x_mm: Option<f64>,
    /// The last fault or loss.
    trouble: Option<String>,
    console: &'c mut Console,
}

impl Rig<'_> {
    fn say(&mut self, text: &str) -> Result<(), Failure> {
        self.console.out(format!("{text}\n"))
    }

    /// Polls the device; heartbeats depend on it.
    fn poll(&mut self) -> Vec<Report> {
        let reports = self.device.poll(self.start.elapsed());
        for report in &reports {
            match report {
                Report::Telemetry(samples) => {
                    self.x_mm = samples.last().map(|s| s.x_mm).or(self.x_mm);
                }
                Report::Fault(why) | Report::Lost(why) => self.trouble = Some(why.clone()),
                _ => {}
            }
        }
        std::thread::sleep(POLL);
        reports
    }

    /// Polls until a report comes; `None` if it does not in time or the device trips.
    fn until(&mut self, wanted: impl Fn(&Report) -> bool) -> Option<()> {
        let begun = Instant::now();
        self.trouble = None;
        while begun.elapsed() < ANSWER && self.trouble.is_none() {
            if self.poll().iter().any(&wanted) {
                return Some(());
            }
        }
        None
    }

    /// Asks, and waits for a line while the device goes on. `None`: skip.
    fn ask(&mut self, question: &str) -> Result<Option<String>, Failure> {
        self.say(question)?;
        loop {
            match self.lines.try_recv() {
                Ok(line) if line.trim() == "skip" => return Ok(None),
                Ok(line) => return Ok(Some(line.trim().to_owned())),
                Err(TryRecvError::Disconnected) => {
                    self.device.limp(self.start.elapsed());
                    return Err(Failure::usage("the input ended before all steps were done"));
                }
                Err(TryRecvError::Empty) => drop(self.poll()),
            }
        }
    }

    /// A number within bounds, asked until it is one.
    fn number(&mut self, question: &str, bounds: [f64; 2]) -> Result<Option<f64>, Failure> {
        loop {
            let Some(given) = self.ask(question)? else {
                return Ok(None);
            };
            let number = given.replace(',', ".").parse::<f64>();
            match number {
                Ok(x) if (bounds[0]..=bounds[1]).contains(&x) => return Ok(Some(x)),
                _ => self.say(&format!(
                    "a number from {} to {} is needed, or `skip`",
                    bounds[0], bounds[1]
                ))?,
            }
        }
    }

    /// One of some words, asked until it is one.
    fn word(&mut self, question: &str, words: &[&str]) -> Result<Option<String>, Failure> {
        loop {
            match self.ask(question)? {
                Some(given) if !words.contains(&given.as_str()) => {
                    self.say(&format!("one of {} is needed, or `skip`", words.join(", ")))?;
                }
                answer => return Ok(answer),
            }
        }
    }

    /// Plays a constant force.
    fn hold(&mut self, force_n: f64) -> Result<(), String> {
        let table = constant(self.stroke_mm, force_n);
        let at = self.start.elapsed();
        let loading = self
            .device
            .load(&Stimulus::of_table(&table), self.limits, at);
        let trouble = |rig: &mut Self| {
            let why = rig.trouble.take();
            why.unwrap_or_else(|| "the device does not answer in time".to_owned())
        };
        loading.map_err(|e| e.to_string())?;
        if self.until(|r| *r == Report::Loaded).is_none() {
            return Err(trouble(self));
        }
        let at = self.start.elapsed();
        self.device.start(at).map_err(|e| e.to_string())?;
        match self.until(|r| *r == Report::Started) {
            Some(()) => Ok(()),
            None => Err(trouble(self)),
        }
    }

    fn release(&mut self) {
        self.device.limp(self.start.elapsed());
        self.poll();
    }
}

/// A table that has the same force everywhere.
fn constant([low, high]: [f64; 2], force_n: f64) -> Realization {
    let branch = || Branch {
        m_kg: vec![0.0; 2],
        b_n_s_per_mm: vec![0.0; 2],
        k_n_per_mm: vec![0.0; 2],
        f0_n: vec![force_n; 2],
    };
    Realization {
        units: Units::Linear,
        id: "constant".to_owned(),
        provenance: Provenance::default(),
        vaf: BTreeMap::new(),
        lookup: Lookup::Linear,
        direction: Direction::Sign,
        trained: Trained {
            x_mm: [low, high],
            v_mm_s: 100.0,
        },
        x_mm: vec![low, high],
        positive: branch(),
        negative: branch(),
        mechanism: None,
        elements: None,
    }
}

fn step(what: &'static str, required: String, ok: bool, seen: String) -> Step {
    Step {
        what,
        required,
        seen,
        outcome: if ok { Outcome::Passed } else { Outcome::Failed },
    }
}

fn skipped(what: &'static str, required: String) -> Step {
    Step {
        what,
        required,
        seen: "left out".to_owned(),
        outcome: Outcome::NotDone,
    }
}

/// A known mass: size and sign of the force.
fn weight(rig: &mut Rig<'_>) -> Result<Step, Failure> {
    let what = "weight";
    let required = format!(
        "{FORCE_N} N towards −x, balanced by {:.0} g within {:.0} %",
        1e3 * FORCE_N / GRAVITY,
        100.0 * FORCE_ERROR
    );
    rig.say(&format!(
        "\n1. Weight. The device pushes with {FORCE_N} N. Hang weights on the handle, over a pulley if it moves \
         horizontally, until it stays where it is."
    ))?;
    if let Err(why) = rig.hold(FORCE_N) {
        return Ok(step(what, required, false, why));
    }
    let Some(side) = rig.word(
        "Towards which side does the device push, + or -?",
        &["+", "-"],
    )?
    else {
        return Ok(skipped(what, required));
    };
    let question = "Which mass balances it, in g?";
    let Some(mass_g) = rig.number(question, [0.0, 100_000.0])? else {
        return Ok(skipped(what, required));
    };
    if let Some(why) = rig.trouble.take() {
        return Ok(step(
            what,
            required,
            false,
            format!("the force ended: {why}"),
        ));
    }
    let measured_n = 1e-3 * mass_g * GRAVITY;
    let gain = measured_n / FORCE_N;
    let ok = side == "-" && (gain - 1.0).abs() <= FORCE_ERROR;
    let seen = format!(
        "{mass_g} g, {measured_n:.2} N, gain {gain:.2}, towards {}x",
        side.replace('-', "−")
    );
    Ok(step(what, required, ok, seen))
}

/// A ruler: scale and origin of the position.
fn ruler(rig: &mut Rig<'_>) -> Result<Step, Failure> {
    let what = "ruler";
    let required = format!(
        "scale within {:.0} %, origin within {ORIGIN_MM} mm",
        100.0 * SCALE_ERROR
    );
    rig.say(
        "\n2. Ruler. No force. Lay a ruler along the handle's way, its zero at the origin of the device \
         (x = 0), rising towards +x.",
    )?;
    if let Err(why) = rig.hold(0.0) {
        return Ok(step(what, required, false, why));
    }
    let mut places: Vec<[f64; 2]> = Vec::new();
    for which in [
        "a first place",
        "a second place, as far from it as possible",
    ] {
        let question = format!("Move the handle to {which}. Where is it on the ruler, in mm?");
        let given = loop {
            let Some(given) = rig.number(&question, [-2000.0, 2000.0])? else {
                return Ok(skipped(what, required));
            };
            match places.first() {
                Some([first, _]) if (given - first).abs() < APART_MM => {
                    rig.say(&format!("at least {APART_MM} mm from the first place"))?;
                }
                _ => break given,
            }
        };
        // What the device reports now.
        rig.x_mm = None;
        let begun = Instant::now();
        while rig.x_mm.is_none() && begun.elapsed() < Duration::from_secs(2) {
            rig.poll();
        }
        match (rig.x_mm, rig.trouble.take()) {
            (Some(x_mm), _) => places.push([given, x_mm]),
            (None, why) => {
                let why = why.unwrap_or_else(|| "the device reports no position".to_owned());
                return Ok(step(what, required, false, why));
            }
        }
    }
    let [[r1, x1], [r2, x2]] = [places[0], places[1]];
    let scale = (x2 - x1) / (r2 - r1);
    let origin_mm = 0.5 * ((x1 - r1) + (x2 - r2));
    let ok = (scale - 1.0).abs() <= SCALE_ERROR && origin_mm.abs() <= ORIGIN_MM;
    let seen = format!(
        "{r1} and {r2} mm on the ruler, {x1:.2} and {x2:.2} mm reported: scale {scale:.3}, off by {origin_mm:.2} mm"
    );
    Ok(step(what, required, ok, seen))
}

fn emergency_stop(rig: &mut Rig<'_>) -> Result<Step, Failure> {
    let what = "emergency stop";
    let required = "the switch takes the force away at once".to_owned();
    rig.say(&format!(
        "\n3. Emergency stop. The device pushes with {FORCE_N} N. Press the emergency switch."
    ))?;
    if let Err(why) = rig.hold(FORCE_N) {
        return Ok(step(what, required, false, why));
    }
    let question = "Was the force gone at once, yes or no?";
    let Some(answer) = rig.word(question, &["yes", "no"])? else {
        return Ok(skipped(what, required));
    };
    let reported = rig.trouble.take();
    let reported = reported.unwrap_or_else(|| "nothing: it did not notice".to_owned());
    let seen = format!("{answer}; the device reported: {reported}");
    let made = step(what, required, answer == "yes", seen);
    let released = "Release the switch, then type yes.";
    if rig.word(released, &["yes"])?.is_some() {
        // The device may have lost its power.
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(1) {
            rig.poll();
        }
    }
    Ok(made)
}

fn friction(rig: &mut Rig<'_>) -> Result<Step, Failure> {
    let what = "unpowered friction";
    let required = "known".to_owned();
    rig.release();
    rig.say("\n4. Friction. Switch off the power of the motor. Pull the handle slowly with a spring scale.")?;
    let question = "Which force moves it, in N, the larger one of both directions?";
    Ok(match rig.number(question, [0.0, 100.0])? {
        Some(force_n) => step(what, required, true, format!("{force_n} N")),
        None => skipped(what, required),
    })
}
