//! `study identify`: its arguments, its files, and the progress bar. What it does is
//! [`study_haptics::identify::identification`], what it prints [`study_report::identification`].

mod args;

pub(super) use args::Args;

use super::console::{PATIENCE, progress};
use super::progress::Reader;
use super::trajectory::{refuse_to_overwrite, write_file};
use super::{Console, Failure, Kind};
use args::NamedPath;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use study_haptics::identify::identification::{
    self, Identification, IdentificationError, Request, Source, Sources,
};
use study_haptics::identify::method::Progress;
use study_haptics::identify::perceptual::{Weights, file};
use study_haptics::recording::{Names, RecordingFault, force_curve};
use study_report::identification::{Drawing, document, figures, page, text};
use study_report::picture::png::Painter;
use study_session::store::disk::read_capped;

/// Most bytes of a file that is tried as a force curve.
const LARGEST_CURVE: usize = 1 << 26;
/// Columns of the text on a page.
const PAGE_WIDTH: usize = 100;

/// Path and content.
type OutputFile = (PathBuf, Vec<u8>);

/// Identifies a grid of realizations, prints it and writes the files.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut request = args.request();
    request.weights = (args.weights.as_deref())
        .map(|path| read_weights(path, console))
        .transpose()?;
    request.options.methods().map_err(|e| refused(&e.into()))?;
    let names = args.names()?;
    let mut read = |paths: &[NamedPath]| -> Result<Vec<Source>, Failure> {
        let one = |named| read(named, &names, &request, console);
        paths.iter().map(one).collect()
    };
    let sources = Sources {
        training: read(&args.training)?,
        dynamic: read(&args.dynamic)?,
        validate: read(&args.validate)?,
        test: read(&args.test)?,
        repeat: read(&args.repeat)?,
    };
    let mut results = identify(&request, sources, console)?;
    let mut files = Vec::new();
    if let Some(dir) = args.out.as_ref().filter(|_| !results.all_fail()) {
        let models = results
            .model_files(args.id.as_deref())
            .map_err(|e| refused(&e))?;
        files = (models.into_iter())
            .map(|(id, text)| (dir.join(format!("{id}.toml")), text.into_bytes()))
            .collect();
        write(dir, &files, args.force)?;
    }
    if let Some(dir) = &args.figures {
        let (drawings, missing) = figures(&results);
        let page = page("Identification", &text(&results, PAGE_WIDTH), &drawings);
        let mut drawn = drawn(&drawings, dir)?;
        drawn.insert(0, (dir.join("identification.html"), page.into_bytes()));
        // figures can be drawn again from the recordings, so overwriting loses nothing
        write(dir, &drawn, true)?;
        for note in missing {
            console.say(format!("note: {note}"));
        }
        files.extend(drawn);
    }
    if args.json {
        console.document(document(&results))?;
    } else {
        console.out(text(&results, console.width))?;
    }
    for (path, _) in &files {
        console.say(format!("wrote {}", path.display()));
    }
    match results.failure() {
        Some(failure) if results.is_failure() => Err(Failure::input(failure)
            .hint("without --method the methods are compared on data left out")),
        Some(failure) => {
            console.say(format!("warning: {failure}"));
            Ok(())
        }
        None => Ok(()),
    }
}

/// Identifies with a progress bar.
fn identify(
    request: &Request,
    sources: Sources,
    console: &mut Console,
) -> Result<Identification, Failure> {
    let methods = request.options.methods().unwrap_or_default();
    let simulates = methods.iter().any(|method| method.simulates());
    let increments = request.options.dx_mm.len().max(1);
    let (began, done, bar) = (Instant::now(), AtomicU64::new(0), OnceLock::new());
    let cell_done = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if began.elapsed() > PATIENCE && !simulates {
            let cells = (methods.len() * increments) as u64;
            bar.get_or_init(|| progress(cells.max(done), "cells"))
                .set_position(done);
        }
    };
    let step_done = |step: Progress| {
        if began.elapsed() > PATIENCE {
            bar.get_or_init(|| progress(step.of as u64, "steps"))
                .set_position(step.steps as u64);
        }
    };
    let say = |text: String| console.say(text);
    let found = identification::run(request, sources, say, cell_done, step_done);
    if let Some(bar) = bar.get() {
        bar.finish_and_clear();
    }
    found.map_err(|e| refused(&e))
}

/// Reads a file of weights; prints its warnings.
fn read_weights(path: &Path, console: &mut Console) -> Result<Weights, Failure> {
    let shown = path.display().to_string();
    let bytes = read_capped(path, file::MAX_FILE_BYTES)
        .map_err(|problem| Failure::input(format!("{shown}: {problem}")))?;
    match file::parse(&shown, &String::from_utf8_lossy(&bytes)) {
        (Some(weights), findings) => {
            console.findings(&[findings]);
            Ok(weights)
        }
        (None, findings) => Err(Failure::faults(vec![findings])),
    }
}

fn refused(error: &IdentificationError) -> Failure {
    let failure = match error.is_usage() {
        true => Failure::usage(error),
        false => Failure::input(error),
    };
    match error.hint() {
        Some(hint) => failure.hint(hint),
        None => failure,
    }
}

fn read(
    named: &NamedPath,
    names: &Names,
    request: &Request,
    console: &mut Console,
) -> Result<Source, Failure> {
    let path = &named.path;
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let length = file.metadata().map_or(0, |about| about.len());
    let input = BufReader::with_capacity(1 << 16, Reader::new(file, length));
    let shown = path.display().to_string();
    let say = |text: String| console.say(text);
    let found = Source::read((&named.name, &shown), input, names, request, say);
    found.map_err(|error| {
        let no_columns = matches!(&error, IdentificationError::Unreadable(_, error)
            if matches!(error.fault, RecordingFault::MissingColumn { .. } | RecordingFault::NoColumns | RecordingFault::Ragged { .. }));
        let failure = refused(&error);
        match no_columns && is_force_curve(path) {
            true => failure.hint(format!(
                "it is a force curve of displacement and force: `study import force-curve {shown} -o recording.csv` makes a recording of it"
            )),
            false => failure,
        }
    })
}

/// Whether a file is what `study import force-curve` reads.
fn is_force_curve(path: &Path) -> bool {
    let text = read_capped(path, LARGEST_CURVE).ok();
    text.is_some_and(|bytes| force_curve::read(&String::from_utf8_lossy(&bytes)).is_ok())
}

/// Writes the files; without `force` none if one of them exists.
fn write(dir: &Path, files: &[OutputFile], force: bool) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    for (path, _) in files {
        refuse_to_overwrite(Some(path), force)?;
    }
    for (path, content) in files {
        write_file(path, |sink| sink.write_all(content))?;
    }
    Ok(())
}

/// The figures as SVG, PNG, PDF and CSV.
fn drawn(drawings: &[Drawing], dir: &Path) -> Result<Vec<OutputFile>, Failure> {
    let painter = Painter::default();
    let mut files = Vec::new();
    for drawing in drawings {
        let path = |ending: &str| dir.join(format!("{}.{ending}", drawing.name));
        let picture = drawing.figure.picture();
        let png = painter
            .png(&picture)
            .map_err(|e| Failure::new(Kind::Bug, e.to_string()))?;
        files.push((path("svg"), picture.to_svg().into_bytes()));
        files.push((path("png"), png));
        files.push((path("pdf"), picture.to_pdf()));
        files.push((path("csv"), drawing.csv.clone().into_bytes()));
    }
    Ok(files)
}
