//! `study identify`

mod args;
mod files;
mod output;

pub(super) use args::Args;

use super::{Console, Failure, Kind};
use args::{AccelerationWord, Named};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use study_base::text::Untrusted;
use study_haptics::identify::grid::{self, Cell, Plan};
use study_haptics::identify::signal::{self, Excitation};
use study_haptics::identify::validation::{self, Ceiling, Validation};
use study_haptics::identify::{IdentifyError, Training};
use study_haptics::recording::{self, Recording};
use study_wire::certificate::{Certificate, SERVO_RATES_HZ};

/// The filter of [`signal::prepare`], for model files.
const FILTER: &str = "zero-phase low-pass, Butterworth of 2nd order both ways,";

/// What was identified, for [`output`] and [`files`].
struct Found<'a> {
    args: &'a Args,
    training: &'a Recording,
    /// Validations, then tests.
    recordings: Vec<(&'a Named, &'a Recording)>,
    cells: Vec<Cell>,
    best: Option<usize>,
    /// The best cell on each of `recordings`.
    validations: Vec<Option<Validation>>,
    /// For each of `recordings` what a repetition of it says, if there is one.
    ceilings: Vec<Option<Ceiling>>,
    /// Models and figures: path and content.
    files: Vec<(PathBuf, Vec<u8>)>,
}

impl Found<'_> {
    /// The recording whose VAF is to be reported: the first that nothing was chosen
    /// on, else the first.
    fn reported(&self) -> usize {
        let validations = self.args.validate.len();
        if validations < self.recordings.len() {
            validations
        } else {
            0
        }
    }
}

/// Does it.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let plan = args.plan()?;
    let mut training = read(&args.training, args, console)?;
    let mut recordings = Vec::new();
    for named in args.validate.iter().chain(&args.test) {
        recordings.push((named, read(named, args, console)?));
    }
    let mut repeats = Vec::new();
    for named in &args.repeat {
        repeats.push((named, read(named, args, console)?));
    }
    refuse_reuse(&args.training, &training, &recordings, &repeats)?;
    if args.thin {
        let (thinned, gone) = signal::thin(&training, signal::Dwell::default());
        console.say(format!(
            "{gone} samples of dwells are left out of the training"
        ));
        training = thinned;
    }
    if let Some(doubt) = Excitation::of(&training).warning() {
        console.say(format!(
            "warning: {}: {doubt}",
            args.training.path.display()
        ));
    }
    let recordings: Vec<(&Named, &Recording)> = recordings.iter().map(|(n, r)| (*n, r)).collect();
    let ceilings = ceilings(&recordings, &repeats)?;

    let mut cells = identify(args, &plan, &training, &recordings)
        .map_err(|e| Failure::input(format!("{}: {e}", args.training.path.display())))?;
    warn_of_other_filters(&training, &recordings, console);
    let filter = signals_in_words(args, &training);
    for cell in &mut cells {
        cell.realization.provenance.filter = Some(filter.clone());
    }
    let best = grid::best(&cells, args.validate.len());
    let detents = validation::detents(&training);
    let validations = recordings
        .iter()
        .map(|(_, recording)| {
            let realization = &cells.get(best?)?.realization;
            validation::validate(realization, recording, &detents)
        })
        .collect();
    let mut found = Found {
        args,
        training: &training,
        recordings,
        cells,
        best,
        validations,
        ceilings,
        files: Vec::new(),
    };
    if let Some(dir) = &args.out {
        found.files = files::models(&mut found.cells, args, dir)?;
        files::write(dir, &found.files, args.force)?;
    }
    if let Some(dir) = &args.figures {
        let (figures, missing) = files::figures(&found, dir)?;
        // they follow from the recordings: making them again is no loss
        files::write(dir, &figures, true)?;
        for said in missing {
            console.say(format!("note: {said}"));
        }
        found.files.extend(figures);
    }
    if args.json {
        console.out(output::json(&found))?;
    } else {
        console.out(output::table(&found))?;
    }
    for (path, _) in &found.files {
        console.say(format!("wrote {}", path.display()));
    }
    Ok(())
}

/// What a device needs to render a table, in words; also for `study check`.
pub(super) fn needs(certificate: &Certificate) -> String {
    if certificate.stiffness_n_per_mm.is_infinite() {
        return "its force jumps at nodes: no servo rate renders that".to_owned();
    }
    let at = |hz: f64| {
        format!(
            "{:.2} at {} kHz",
            certificate.device_damping_n_s_per_m(hz, 0.0),
            hz / 1000.0
        )
    };
    format!(
        "K up to {:.2} N/mm, |b| up to {:.1} N·s/m: the device needs N·s/m of its own: {}",
        certificate.stiffness_n_per_mm,
        1000.0 * certificate.damping_n_s_per_mm,
        SERVO_RATES_HZ.map(at).join(", ")
    )
}

/// Finds the recording that each repetition repeats.
fn ceilings(
    recordings: &[(&Named, &Recording)],
    repeats: &[(&Named, Recording)],
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
                "{} repeats the trajectory of no --validate or --test recording",
                named.path.display()
            ))
            .hint("record the same trajectory twice: the second is the --repeat"));
        };
        ceilings[i] = Some(ceiling);
    }
    Ok(ceilings)
}

/// A VAF belongs to its filter: this stands beside it and in model files.
fn signals_in_words(args: &Args, training: &Recording) -> String {
    let mut words = match (args.filter, training.filter()) {
        (Some(hz), None) => format!("{FILTER} at {hz} Hz"),
        (Some(hz), Some(before)) => format!("{FILTER} at {hz} Hz; before that {before}"),
        (None, Some(recorded)) => format!("as recorded: {recorded}"),
        (None, None) => "as recorded".to_owned(),
    };
    if let AccelerationWord::Encoder = args.acceleration {
        words += ", acceleration from the encoder";
    }
    if args.thin {
        words += ", dwells thinned";
    }
    words
}

/// Between signals that went through different filters a VAF is worth little.
fn warn_of_other_filters(
    training: &Recording,
    recordings: &[(&Named, &Recording)],
    console: &mut Console,
) {
    let words = |r: &Recording| Untrusted(r.filter().unwrap_or("unknown")).to_string();
    for (named, recording) in recordings {
        if recording.filter() != training.filter() {
            console.say(format!(
                "warning: {}: its filter is not that of the training recording: {}, there {}",
                named.path.display(),
                words(recording),
                words(training),
            ));
        }
    }
}

fn read(named: &Named, args: &Args, console: &mut Console) -> Result<Recording, Failure> {
    let path = &named.path;
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let recording = recording::read(&named.name, BufReader::with_capacity(1 << 16, file))
        .map_err(|e| Failure::input(format!("{}: line {}: {}", path.display(), e.line, e.fault)))?;
    for warning in &recording.warnings {
        console.say(format!("warning: {}: {warning}", path.display()));
    }
    signal::prepare(&recording, args.signals())
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}

/// Two recordings with the same bytes are not independent, whatever they are
/// called; and two with one name would be one entry of a model file.
fn refuse_reuse(
    training_name: &Named,
    training: &Recording,
    recordings: &[(&Named, Recording)],
    repeats: &[(&Named, Recording)],
) -> Result<(), Failure> {
    let all: Vec<(&Named, &Recording)> = std::iter::once((training_name, training))
        .chain(recordings.iter().chain(repeats).map(|(n, r)| (*n, r)))
        .collect();
    for (i, (named, recording)) in all.iter().enumerate() {
        for (before, other) in &all[..i] {
            if recording.sha256 == other.sha256 {
                return Err(Failure::input(format!(
                    "{} and {} are the same recording",
                    before.path.display(),
                    named.path.display()
                ))
                .hint("identify from one recording, choose on a second, report a third"));
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
    training: &Recording,
    recordings: &[(&Named, &Recording)],
) -> Result<Vec<Cell>, IdentifyError> {
    let training = Training::new(training)?;
    let recordings: Vec<&Recording> = recordings.iter().map(|(_, r)| *r).collect();
    let progress = Progress::new(plan.cells());
    grid::run(&training, plan, args.lookup(), &recordings, || {
        progress.step()
    })
}

/// A bar on standard error that appears after a second, on a terminal only.
struct Progress {
    began: Instant,
    cells: u64,
    done: AtomicU64,
    bar: OnceLock<ProgressBar>,
}

impl Progress {
    fn new(cells: usize) -> Self {
        Self {
            began: Instant::now(),
            cells: cells as u64,
            done: AtomicU64::new(0),
            bar: OnceLock::new(),
        }
    }

    /// From any thread.
    fn step(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if self.began.elapsed() > Duration::from_secs(1) {
            let bar = self.bar.get_or_init(|| {
                // indicatif draws nothing where standard error is no terminal
                let style = ProgressStyle::with_template("{bar:30} {pos}/{len} cells, {eta} left")
                    .unwrap_or_else(|_| ProgressStyle::default_bar());
                ProgressBar::new(self.cells).with_style(style)
            });
            bar.set_position(done);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
