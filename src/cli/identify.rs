//! `study identify`

mod args;
mod comparison;
mod files;
mod loops;
mod output;
mod plan;
mod printed;

pub(super) use args::Args;

use super::console::{PATIENCE, progress};
use super::{Console, Failure, Kind};
use args::{MethodName, NamedPath};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use study_base::text::Untrusted;
use study_haptics::identify::compare::{self, Candidate, Comparison};
use study_haptics::identify::grid::{self, Cell, Plan};
use study_haptics::identify::mechanism::Progress;
use study_haptics::identify::signal::{self, Acceleration, Excitation, filter};
use study_haptics::identify::validation::{self, Ceiling, Validation};
use study_haptics::identify::{IdentifyError, Method, Training};
use study_haptics::model::Realization;
use study_haptics::recording::{self, Names, Recording, RecordingError, RecordingFault};
use study_haptics::safe_play::{self, Danger};
use study_wire::certificate::{Certificate, SERVO_RATES_HZ};

/// The results of an identification, for [`output`] and [`files`].
struct Results<'a> {
    args: &'a Args,
    training: &'a [(&'a NamedPath, Recording)],
    /// The --validate recordings, then the --test recordings.
    recordings: Vec<(&'a NamedPath, &'a Recording)>,
    cells: Vec<Cell>,
    best: Option<usize>,
    /// Where methods were compared, `cells` has only the recommended one.
    comparison: Option<Comparison>,
    /// The accuracy of the best cell on each of `recordings`.
    validations: Vec<Option<Validation>>,
    /// The ceiling of VAF on each of `recordings` that has a repetition.
    ceilings: Vec<Option<Ceiling>>,
    /// Model files and figures: path and content.
    files: Vec<(PathBuf, Vec<u8>)>,
}

impl Results<'_> {
    /// The recording whose VAF is to be reported: the first --test recording, or the
    /// first --validate recording without one, or that of the training.
    fn reported(&self) -> &Recording {
        let test = self.recordings.get(self.args.validate.len());
        let found = test.or(self.recordings.first());
        found.map_or(&self.training[0].1, |(_, recording)| recording)
    }
}

/// Identifies a grid of realizations, prints it and writes the files.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut plan = args.plan()?;
    let names = args.names()?;
    let mut training = Vec::new();
    for named in &args.training {
        training.push((named, read(named, &names, args, console)?));
    }
    let mut recordings = Vec::new();
    for named in args.validate.iter().chain(&args.test) {
        recordings.push((named, read(named, &names, args, console)?));
    }
    let mut repeats = Vec::new();
    for named in &args.repeat {
        repeats.push((named, read(named, &names, args, console)?));
    }
    let first = &training[0].1;
    if plan.dx_mm.is_empty() {
        plan.dx_mm = args.default_dx_mm(first.scale_mm());
    }
    let (offset_mm, offset_n) = (offset(first.range_mm()), offset(first.range_n()));
    let all = (training.iter_mut())
        .chain(&mut recordings)
        .chain(&mut repeats);
    for (_, recording) in all {
        recording.x_mm.iter_mut().for_each(|x| *x -= offset_mm);
        recording.f_n.iter_mut().for_each(|f| *f -= offset_n);
    }
    if offset_mm != 0.0 {
        console.say(format!(
            "x is far from its origin, which costs digits: identified at x - {offset_mm} mm; model files have the positions of the recording"
        ));
    }
    if offset_n != 0.0 {
        console.say(format!(
            "warning: F is far from 0, which costs digits: identified at F - {offset_n} N; model files have the forces of the recording, so subtract the offset of the sensor before you play them"
        ));
    }
    check_distinct(training.iter().chain(&recordings).chain(&repeats))?;
    for (named, training) in &mut training {
        if args.thin {
            let (thinned, removed) = signal::thin(training);
            console.say(format!(
                "{removed} samples of dwells removed from {}",
                named.path.display()
            ));
            *training = thinned;
        }
        if let Some(warning) = Excitation::of(training).warning() {
            console.say(format!("warning: {}: {warning}", named.path.display()));
        }
    }
    let recordings: Vec<(&NamedPath, &Recording)> =
        recordings.iter().map(|(n, r)| (*n, r)).collect();
    let ceilings = ceilings(&recordings, &repeats)?;
    if args.validate.is_empty() && !args.compares() && plan.methods.len() * plan.dx_mm.len() > 1 {
        return Err(Failure::usage(
            "several realizations need --validate, on which one is selected",
        )
        .hint("or ask for one, such as --method passive --dx 0.05"));
    }

    let (mut cells, comparison) = identify(args, &plan, &training, &recordings)
        .map_err(|e| Failure::input(format!("{}: {e}", args.training[0].path.display())))?;
    let (_, first) = &training[0];
    let others = (training.iter().skip(1).map(|(n, r)| (*n, r))).chain(recordings.iter().copied());
    warn_about_filters(first, others, console);
    let filter = filter_description(args, first);
    for cell in &mut cells {
        cell.realization.provenance.filter = Some(filter.clone());
    }
    let detents = validation::detents(first);
    let best = grid::best(&cells, args.validate.len());
    let failed = match &comparison {
        Some(comparison) => comparison.best().and_then(Candidate::failure),
        None => best.and_then(|best| compare::failure(&cells[best])),
    };
    // A baseline that is asked for is what others are compared with.
    let is_baseline = |method| {
        matches!(
            method,
            Method::Static | Method::Segments(_) | Method::Spring
        )
    };
    let baseline =
        args.method.is_some() && best.is_some_and(|best| is_baseline(cells[best].method));
    if let Some((failed, best)) = failed.zip(best).filter(|_| !baseline) {
        let provenance = &mut cells[best].realization.provenance;
        let note = provenance.note.take().unwrap_or_default();
        provenance.note = Some(format!("failed: {failed}; {note}"));
    }
    let validations = recordings
        .iter()
        .map(|(_, recording)| {
            let realization = &cells.get(best?)?.realization;
            validation::validate(realization, recording, &detents)
        })
        .collect();
    let mut results = Results {
        args,
        training: &training,
        recordings,
        cells,
        best,
        comparison,
        validations,
        ceilings,
        files: Vec::new(),
    };
    let all_fail = (results.comparison.as_ref()).is_some_and(|c| c.recommended.is_none());
    if let Some(dir) = args.out.as_ref().filter(|_| !all_fail) {
        let shift = |cells: &mut [Cell], by_mm, by_n| {
            for cell in cells {
                cell.realization.shift(by_mm);
                cell.realization.raise(by_n);
            }
        };
        shift(&mut results.cells, offset_mm, offset_n);
        results.files = files::models(&mut results.cells, args, dir)?;
        shift(&mut results.cells, -offset_mm, -offset_n);
        files::write(dir, &results.files, args.force)?;
    }
    if let Some(dir) = &args.figures {
        let (figures, missing) = files::figures(&results, dir)?;
        // figures can be drawn again from the recordings, so overwriting loses nothing
        files::write(dir, &figures, true)?;
        for note in missing {
            console.say(format!("note: {note}"));
        }
        results.files.extend(figures);
    }
    if args.json {
        console.document(output::json(&results))?;
    } else {
        console.out(output::table(&results))?;
    }
    for (path, _) in &results.files {
        console.say(format!("wrote {}", path.display()));
    }
    match (failed, best.map(|best| results.cells[best].method)) {
        (Some(failed), Some(method)) => {
            let said = format!("{} failed: {failed}", method.as_str());
            if all_fail || (args.method.is_some() && !baseline) {
                let hint = "without --method the methods are compared on data left out";
                return Err(Failure::input(said).hint(hint));
            }
            console.say(format!("warning: {said}"));
            Ok(())
        }
        _ => Ok(()),
    }
}

/// The damping that a device needs to render a realization; also for `study check`.
pub(super) fn required_damping(certificate: &Certificate) -> String {
    if certificate.stiffness_n_per_mm.is_infinite() {
        return "the force jumps at nodes: no servo rate suffices".to_owned();
    }
    let at = |hz: f64| {
        format!(
            "{:.2} at {} kHz",
            certificate.device_damping_n_s_per_m(hz, 0.0),
            hz / 1000.0
        )
    };
    let state = match certificate.state_n_per_mm {
        Some(n_per_mm) => format!(" and {n_per_mm:.2} over the direction state"),
        None => String::new(),
    };
    format!(
        "K up to {:.2} N/mm{state}, |b| up to {:.1} N·s/m; required device damping in N·s/m: {}",
        certificate.stiffness_n_per_mm,
        1000.0 * certificate.damping_n_s_per_mm,
        SERVO_RATES_HZ.map(at).join(", ")
    )
}

/// What an adversary makes on a device of a realization that passes its certificate.
fn dangers(realization: &Realization) -> String {
    if !realization.certificate().passes() {
        return String::new();
    }
    let found = safe_play::search(realization, &safe_play::Device::default());
    let line = |danger: &Danger| format!("warning: on a device, {danger}\n");
    found.iter().map(line).collect()
}

/// What is subtracted from all positions, mm, or forces, N, before identification: 0 unless the
/// middle of the range is more than [`FAR`] ranges from the origin, because the origin matters to a
/// cold start. A whole number, so that nodes keep their places.
fn offset([low, high]: [f64; 2]) -> f64 {
    let middle = 0.5 * (low + high);
    if middle.abs() > FAR * (high - low) {
        middle.round()
    } else {
        0.0
    }
}

/// Ranges from the origin at which cold recursions lose more than two digits.
const FAR: f64 = 100.0;

/// The ceiling of VAF on each recording, from the repetitions.
fn ceilings(
    recordings: &[(&NamedPath, &Recording)],
    repeats: &[(&NamedPath, Recording)],
) -> Result<Vec<Option<Ceiling>>, Failure> {
    let mut ceilings = vec![None; recordings.len()];
    for (named, repeat) in repeats {
        let nearest = recordings
            .iter()
            .enumerate()
            .filter_map(|(i, (_, r))| Some((i, validation::ceiling(r, repeat)?)))
            .min_by(|a, b| a.1.apart_mm.total_cmp(&b.1.apart_mm));
        let Some((i, ceiling)) = nearest else {
            return Err(Failure::input(format!(
                "{} does not repeat the trajectory of a --validate or --test recording",
                named.path.display()
            ))
            .hint("record the same trajectory twice, and pass the second recording as --repeat"));
        };
        ceilings[i] = Some(ceiling);
    }
    Ok(ceilings)
}

/// How the signals were filtered, for the table and model files: VAF depends on it.
fn filter_description(args: &Args, training: &Recording) -> String {
    let mut text = match (args.filter.map(filter::description), training.filter()) {
        (Some(filter), None) => filter,
        (Some(filter), Some(before)) => format!("{filter}; before that {before}"),
        (None, Some(recorded)) => format!("as recorded: {recorded}"),
        (None, None) => "as recorded".to_owned(),
    };
    if args.acceleration == Acceleration::Encoder {
        text += ", acceleration from the encoder";
    }
    if args.thin {
        text += ", dwells thinned";
    }
    text
}

/// Warns if a recording was filtered differently from the training recording, which
/// distorts its VAF.
fn warn_about_filters<'a>(
    training: &Recording,
    recordings: impl Iterator<Item = (&'a NamedPath, &'a Recording)>,
    console: &mut Console,
) {
    let filter = |r: &Recording| Untrusted(r.filter().unwrap_or("unknown")).to_string();
    for (named, recording) in recordings {
        if recording.filter() != training.filter() {
            console.say(format!(
                "warning: {}: the filter ({}) differs from that of the training recording ({})",
                named.path.display(),
                filter(recording),
                filter(training),
            ));
        }
    }
}

/// The failure of reading a recording, with what to do about it.
fn unreadable(path: &Path, error: &RecordingError) -> Failure {
    let failure = Failure::input(format!(
        "{}: line {}: {}",
        path.display(),
        error.line,
        error.fault
    ));
    match &error.fault {
        RecordingFault::MissingColumn { .. } => failure.hint(
            "name the columns of your file: --columns t=NAME,x=NAME:UNIT,f=NAME:UNIT, with units such as mm, deg, rad, N and N·m",
        ),
        RecordingFault::Ragged { found, expected } if found > expected => {
            failure.hint("decimal commas need semicolons or tabs between the columns")
        }
        RecordingFault::LongLine => failure.hint("a row is a line that ends with a line feed"),
        _ => failure,
    }
}

fn read(
    named: &NamedPath,
    names: &Names,
    args: &Args,
    console: &mut Console,
) -> Result<Recording, Failure> {
    let path = &named.path;
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let mut recording =
        recording::read_as(&named.name, BufReader::with_capacity(1 << 16, file), names)
            .map_err(|e| unreadable(path, &e))?;
    for warning in &recording.warnings {
        console.say(format!("warning: {}: {warning}", path.display()));
    }
    if let Some(how) = recording.quasi_static() {
        console.say(format!("{}: {}", path.display(), Untrusted(how)));
    }
    if args.robust {
        let replaced = recording.without_spikes();
        let plural = if replaced == 1 { "" } else { "s" };
        console.say(format!(
            "{}: {replaced} spike{plural} replaced",
            path.display()
        ));
    }
    // swapped columns, which are warned of, have the opposite energy as well
    let swapped = |w: &recording::Warning| matches!(w, recording::Warning::Swapped { .. });
    if let Some(energy) = recording.energy()
        && energy.negative
        && !args.active
        && !recording.warnings.iter().any(swapped)
    {
        let hint = match !args.robust && recording.spikes_make_it_active() {
            true => "the spikes may be the cause: --robust replaces them",
            false => {
                "F is the force that the probe applies to the target, positive with +x: change the sign of F, or that of x if the position is counted the other way round. For a target with a motor: --active"
            }
        };
        return Err(Failure::input(format!(
            "{}: the target supplies energy: the work of the force over closed cycles is {:.3} J on {:.0} mm, but no passive target gives any",
            path.display(),
            energy.supplied_j,
            energy.path_mm,
        ))
        .hint(hint));
    }
    if let Some((even, how)) = signal::evened(&recording)
        && args.needs_even_samples()
    {
        console.say(format!("{}: {how}", path.display()));
        recording = even;
    }
    signal::prepare(&recording, args.signals())
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}

/// Rejects recordings with the same bytes, which are not independent, and recordings
/// with the same name, which would be one entry of a model file.
fn check_distinct<'a>(
    all: impl Iterator<Item = &'a (&'a NamedPath, Recording)>,
) -> Result<(), Failure> {
    let all: Vec<&(&NamedPath, Recording)> = all.collect();
    for (i, (named, recording)) in all.iter().enumerate() {
        for (before, other) in &all[..i] {
            if recording.sha256 == other.sha256 {
                return Err(Failure::input(format!(
                    "{} and {} are the same recording",
                    before.path.display(),
                    named.path.display()
                ))
                .hint("identify from one recording, select on a second and report a third"));
            }
            if recording.name == other.name {
                return Err(Failure::input(format!(
                    "two recordings are called {}: {} and {}",
                    recording.name,
                    before.path.display(),
                    named.path.display()
                ))
                .hint("give one another name: --validate NAME=PATH"));
            }
        }
    }
    Ok(())
}

fn identify(
    args: &Args,
    plan: &Plan,
    training: &[(&NamedPath, Recording)],
    recordings: &[(&NamedPath, &Recording)],
) -> Result<(Vec<Cell>, Option<Comparison>), IdentifyError> {
    let training: Vec<&Recording> = training.iter().map(|(_, r)| r).collect();
    let training = Training::of(&training)?;
    let recordings: Vec<&Recording> = recordings.iter().map(|(_, r)| *r).collect();
    let (began, done, bar) = (Instant::now(), AtomicU64::new(0), OnceLock::new());
    let cell_done = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if began.elapsed() > PATIENCE && args.method() != MethodName::Mechanism {
            bar.get_or_init(|| progress(plan.cells() as u64, "cells"))
                .set_position(done);
        }
    };
    let step_done = |step: Progress| {
        if began.elapsed() > PATIENCE {
            bar.get_or_init(|| progress(step.of as u64, "steps"))
                .set_position(step.steps as u64);
        }
    };
    let found = if args.compares() {
        compare::run(&training, args.lookup, &recordings, step_done).map(|comparison| {
            let cells = comparison.best().map(|best| best.cell.clone());
            (cells.into_iter().collect(), Some(comparison))
        })
    } else {
        let lookup = args.lookup;
        grid::run_in_steps(&training, plan, lookup, &recordings, cell_done, step_done)
            .map(|cells| (cells, None))
    };
    if let Some(bar) = bar.get() {
        bar.finish_and_clear();
    }
    found
}
