//! `study export`: the data of a study for other programs and for archives.

use super::{Console, Failure, study_folder};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use study_analysis::export::{
    self, Amendment, Dialect, ExportError, FORMATS, FormatInfo, Options, Recorded, Source, Summary,
};
use study_analysis::load;
use study_base::hex::Digest;
use study_base::sort::SmallSort as _;
use study_base::text::{Untrusted, counted};
use study_session::outcome::Event;
use study_session::outcome::ratings::Origin;
use study_session::store::disk::{Disk as _, RealDisk};
use study_session::store::{self, Derived, SessionData, StudyFolder, layout};

/// The formats, for the help and for completion.
fn formats() -> impl TypedValueParser<Value = &'static FormatInfo> {
    let value = |format: &FormatInfo| PossibleValue::new(format.name).help(format.about);
    PossibleValuesParser::new(FORMATS.iter().map(value))
        .try_map(|name| FormatInfo::named(&name).ok_or(SignError("a format of the list")))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Others {
    Pilot,
    Simulated,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Redacted {
    /// New numbers for the participants, in a random order
    Ids,
    /// No dates, times and operator
    Times,
}

/// Arguments of `study export`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder with one study, or the folder of a study in it
    results: PathBuf,
    /// The format
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    to: &'static FormatInfo,
    /// Folder for the data set; if it exists, it must be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Export these sessions instead of the real ones
    #[arg(long, value_name = "WHO")]
    include: Option<Others>,
    /// Also export practice trials
    #[arg(long)]
    with_practice: bool,
    /// Also export position and force of the attempts that count
    #[arg(long)]
    with_telemetry: bool,
    /// Leave out the columns that people typed: comments, remarks, reasons, operator, device
    #[arg(long)]
    without_comments: bool,
    /// What to leave out or to replace
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    redact: Vec<Redacted>,
    /// Version of the Data Package [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2))]
    profile: Option<u8>,
    #[command(flatten, next_help_heading = "Spreadsheets (csv and wide)")]
    sheets: Sheets,
}

/// How a spreadsheet reads a table.
#[derive(Debug, clap::Args)]
struct Sheets {
    /// Between two cells: , ; or tab [default: ,]
    #[arg(long, value_name = "CHAR", value_parser = parse_separator)]
    sep: Option<char>,
    /// Decimal sign: . or , [default: .]
    #[arg(long, value_name = "CHAR", value_parser = parse_decimal)]
    decimal: Option<char>,
    /// Begin with a byte order mark, without which Excel does not read UTF-8
    #[arg(long)]
    bom: bool,
    /// Put an apostrophe before texts that a spreadsheet could take for a formula
    #[arg(long)]
    spreadsheet_safe: bool,
}

/// A sign that is not possible.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("use {0}")]
struct SignError(&'static str);

fn parse_separator(given: &str) -> Result<char, SignError> {
    match given {
        "," | ";" => Ok(given.chars().next().unwrap_or(',')),
        "tab" | "\t" => Ok('\t'),
        _ => Err(SignError(", or ; or tab")),
    }
}

fn parse_decimal(given: &str) -> Result<char, SignError> {
    match given {
        "." => Ok('.'),
        "," => Ok(','),
        _ => Err(SignError(". or ,")),
    }
}

impl Args {
    fn options(&self) -> Result<Options, Failure> {
        let format = self.to;
        let dialect = Dialect {
            separator: self.sheets.sep.unwrap_or(','),
            decimal_comma: self.sheets.decimal == Some(','),
            bom: self.sheets.bom,
            safe: self.sheets.spreadsheet_safe,
        };
        if !format.sheets && dialect != Dialect::default() {
            return Err(Failure::usage(format!(
                "--sep, --decimal, --bom and --spreadsheet-safe are for csv and wide: {} has a fixed form",
                format.name
            )));
        }
        if dialect.decimal_comma && dialect.separator == ',' {
            return Err(
                Failure::usage("--decimal , needs another separator than the comma")
                    .hint("add --sep ';', as spreadsheets with a decimal comma expect"),
            );
        }
        if self.profile.is_some() && !format.profiles {
            return Err(Failure::usage("--profile is for --to frictionless"));
        }
        if self.with_telemetry && !format.telemetry {
            return Err(Failure::usage(
                "--with-telemetry: one row for each participant has no place for it",
            )
            .hint("use --to csv"));
        }
        Ok(Options {
            format,
            whose: match self.include {
                None => Origin::Real,
                Some(Others::Pilot) => Origin::Pilot,
                Some(Others::Simulated) => Origin::Simulated,
            },
            practice: self.with_practice,
            comments: !self.without_comments,
            telemetry: self.with_telemetry,
            redact_ids: self.redact.contains(&Redacted::Ids),
            redact_times: self.redact.contains(&Redacted::Times),
            dialect,
            profile_1: self.profile == Some(1),
        })
    }
}

/// Runs `study export`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let options = args.options()?;
    let mut studies = store::studies(&args.results)?;
    let study = match (studies.pop(), studies.first()) {
        (Some(study), None) => study,
        (_, first) => {
            let first = first.map_or(String::new(), |s| s.path().display().to_string());
            return Err(Failure::input(format!(
                "{}: contains several studies, and a data set is of one",
                args.results.display()
            ))
            .hint(format!("name one, such as {first}")));
        }
    };
    let target = Target::new(&args.out, study.path())?;
    let sessions = study.sessions()?;
    let loaded = load::frozen(&study)?;
    let damage = load::damage(&study, &sessions, Some(&loaded))?;
    study_folder::warn(&study, &damage, console);
    let derived = Derived::of(&sessions, &loaded.protocol);
    let manifest = study.manifest();
    let versions: Vec<Amendment> = (manifest.versions.iter())
        .map(|v| Amendment {
            version: v.version,
            at: v.at,
            reason: v.reason.clone(),
        })
        .collect();
    let telemetry: Vec<Recorded> = sessions.iter().flat_map(recorded).collect();
    let secrets = secrets(&sessions);
    let source = Source {
        protocol: &loaded.protocol,
        rows: &derived.rows,
        participants: &derived.participants,
        intervals: &derived.intervals,
        versions: &versions,
        fingerprints: &manifest.newest().fingerprints,
        files: &loaded.files,
        telemetry: &telemetry,
        secrets: &secrets,
        tool_version: env!("CARGO_PKG_VERSION"),
    };
    let summary = target.write(|write| {
        let read = &mut |recorded: &Recorded| read(&study, recorded);
        export::export(&source, &options, read, write)
    });
    let summary = summary.map_err(|e| explained(e, &derived, &study))?;
    for left in target.left_behind() {
        console.say(format!(
            "note: {} was left by an export that was interrupted, or is of one that still runs; \
             it has data of participants: delete it if none runs",
            Untrusted(&left.display().to_string())
        ));
    }
    tell(&summary, &study, args, console)?;
    study_folder::whole(&study, &sessions)
}

/// The telemetry files that a journal names.
fn recorded(session: &SessionData) -> Vec<Recorded> {
    let mut started = BTreeMap::new();
    let mut found = Vec::new();
    for entry in &session.entries {
        match &entry.event {
            Event::PlaybackStarted {
                trial,
                attempt,
                interval,
            } => {
                started.insert((*trial, *attempt, *interval), entry.at.wall);
            }
            Event::PlaybackEnded {
                trial,
                attempt,
                telemetry: Some(file),
                interval,
                ..
            } => {
                let recorded = Recorded {
                    participant: session.participant.clone(),
                    session: session.session,
                    trial: *trial,
                    attempt: *attempt,
                    interval: *interval,
                    file: file.file.clone(),
                    started_at: started.get(&(*trial, *attempt, *interval)).copied(),
                };
                // An interval that was felt again has another file.
                found.retain(|r: &Recorded| {
                    (r.trial, r.attempt, r.interval) != (*trial, *attempt, *interval)
                });
                found.push(recorded);
            }
            _ => {}
        }
    }
    found
}

/// For each participant a text that follows from the journals and is in no data set.
fn secrets(sessions: &[SessionData]) -> BTreeMap<study_base::text::ParticipantId, String> {
    let mut digests: BTreeMap<_, Digest> = BTreeMap::new();
    for session in sessions {
        let digest = digests.entry(session.participant.clone()).or_default();
        digest.update(session.last_hash());
    }
    let texts = digests.into_iter();
    texts.map(|(id, digest)| (id, digest.finish())).collect()
}

fn read(study: &StudyFolder, recorded: &Recorded) -> io::Result<Vec<u8>> {
    // The name is from a journal, which may be damaged.
    if recorded.file.contains(['/', '\\', '\0']) {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let folder = layout::session(study.path(), &recorded.participant, recorded.session);
    RealDisk.read(&folder.join(layout::TELEMETRY).join(&recorded.file))
}

fn explained(error: WriteError, derived: &Derived, study: &StudyFolder) -> Failure {
    let path = study.path().display();
    match error {
        WriteError::Export(ExportError::Nobody(whose)) => {
            let failure = Failure::input(format!("{path}: {}", ExportError::Nobody(whose)));
            let has = |of: Origin| {
                let mut rows = derived.rows.iter();
                rows.any(|r| Origin::of(r.simulated, r.pilot) == of)
            };
            let others = [Origin::Pilot, Origin::Simulated];
            match others.into_iter().find(|o| *o != whose && has(*o)) {
                Some(other) => failure.hint(format!(
                    "--include {} exports the {} ones, marked as such",
                    export::word(other),
                    export::word(other)
                )),
                None => failure,
            }
        }
        WriteError::Export(error @ ExportError::NotWide) => {
            Failure::input(format!("{path}: {error}")).hint("use --to csv")
        }
        WriteError::Export(error @ (ExportError::SameLabel { .. } | ExportError::NoLabel(_))) => {
            Failure::input(format!("{path}: {error}"))
                .hint("--redact ids gives the participants new numbers")
        }
        WriteError::Export(error @ ExportError::Telemetry { .. }) => {
            Failure::results(format!("{path}: {error}"))
                .hint(format!("`study verify {path}` lists all findings"))
        }
        WriteError::Export(ExportError::Io(e)) => {
            Failure::results(format!("{path}: a telemetry file: {}", store::plain(&e)))
                .hint(format!("`study verify {path}` lists all findings"))
        }
        WriteError::File(path, e) => Failure::file(&path, &e),
    }
}

fn tell(
    summary: &Summary,
    study: &StudyFolder,
    args: &Args,
    console: &mut Console,
) -> Result<(), Failure> {
    for notice in &summary.notices {
        console.say(format!("note: {notice}"));
    }
    if let Some((first, last)) = summary.interim {
        console.say("note: interim: fewer participants have finished than were planned");
        // The data set has the orders of rows that may be assigned again.
        let reason = "study export of an unfinished study";
        match study.log_reveal(&(first..=last), reason, study_folder::now()) {
            Ok(()) => console.say(format!(
                "logged in {}: the orders of rows {first}-{last} are in the data set",
                study.path().display()
            )),
            Err(e) => console.say(format!("warning: not logged: {e}")),
        }
    }
    console.out(format!(
        "wrote {}: {} of {}, {}\n",
        Untrusted(&args.out.display().to_string()),
        counted(summary.trials, "trial", "trials"),
        counted(summary.participants, "participant", "participants"),
        counted(summary.files, "file", "files")
    ))
}

/// Why a data set was not written.
enum WriteError {
    Export(ExportError),
    File(PathBuf, io::Error),
}

/// The folder of a data set, and where it is until it is whole.
struct Target {
    out: PathBuf,
    part: PathBuf,
}

impl Target {
    /// # Errors
    /// If it has other things, is a link, or is in the folder of the study.
    fn new(out: &Path, study: &Path) -> Result<Self, Failure> {
        let shown = || Untrusted(&out.display().to_string()).to_string();
        let absolute = std::path::absolute(out).map_err(|e| Failure::file(out, &e))?;
        let (Some(parent), Some(name)) = (absolute.parent(), absolute.file_name()) else {
            return Err(Failure::input(format!("{}: not a new folder", shown())));
        };
        match fs::symlink_metadata(out) {
            Ok(known) if known.is_symlink() => {
                return Err(Failure::input(format!(
                    "{}: a symbolic link, and the data set would be written to its target",
                    shown()
                ))
                .hint("name a new folder"));
            }
            Ok(known) if !known.is_dir() => {
                return Err(Failure::input(format!("{}: there is a file", shown()))
                    .hint("name a new folder"));
            }
            Ok(_) => {
                let mut items = fs::read_dir(out).map_err(|e| Failure::file(out, &e))?;
                if items.next().is_some() {
                    return Err(Failure::input(format!(
                        "{}: the folder is not empty, and nothing is overwritten",
                        shown()
                    ))
                    .hint("name a new folder, or remove this one first"));
                }
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(Failure::file(out, &e)),
        }
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if real(parent).join(name).starts_with(real(study)) {
            return Err(
                Failure::input(format!("{}: inside the results of the study", shown()))
                    .hint("name a folder beside the results"),
            );
        }
        let part = format!(".{}.{}.part", name.to_string_lossy(), std::process::id());
        Ok(Self {
            out: out.to_owned(),
            part: parent.join(part),
        })
    }

    /// Writes all files, and gives the folder its name when it is whole. Only the owner
    /// can read it. Nothing is synced, because it can be exported again.
    fn write<T>(
        &self,
        export: impl FnOnce(&mut export::Write<'_>) -> Result<T, ExportError>,
    ) -> Result<T, WriteError> {
        let folder = |path: &Path| match RealDisk.create_folder(path) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
            other => other,
        };
        let at = |path: &Path| {
            let path = path.to_owned();
            move |e| WriteError::File(path, e)
        };
        // Left by a process of the same number that died.
        if self.part.symlink_metadata().is_ok_and(|m| m.is_dir()) {
            fs::remove_dir_all(&self.part).map_err(at(&self.part))?;
        }
        if let Some(parent) = self.part.parent() {
            super::analyze::private_folder(parent).map_err(at(parent))?;
        }
        RealDisk.create_folder(&self.part).map_err(at(&self.part))?;
        let mut failed = None;
        let written = export(&mut |path, bytes| {
            let full = self.part.join(path);
            let mut ancestors: Vec<&Path> = (full.ancestors().skip(1))
                .take_while(|a| *a != self.part)
                .collect();
            ancestors.reverse();
            let made = ancestors.into_iter().try_for_each(folder);
            let made = made.and_then(|()| RealDisk.create(&full)?.write_all(bytes));
            made.map_err(|e| {
                let copy = io::Error::from(e.kind());
                failed = Some((self.out.join(path), e));
                copy
            })
        });
        let named = match (written, failed) {
            (_, Some((path, e))) => Err(WriteError::File(path, e)),
            (Err(e), None) => Err(WriteError::Export(e)),
            (Ok(summary), None) => self.rename().map(|()| summary),
        };
        if named.is_err() {
            // The first error is the one to report.
            let _ = fs::remove_dir_all(&self.part);
        }
        named
    }

    /// What other exports into the same folder did not finish.
    fn left_behind(&self) -> Vec<PathBuf> {
        let (Some(parent), Some(name)) = (self.part.parent(), self.out.file_name()) else {
            return Vec::new();
        };
        let start = format!(".{}.", name.to_string_lossy());
        let is_left = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let middle = name
                .strip_prefix(&start)
                .and_then(|n| n.strip_suffix(".part"));
            middle.is_some_and(|pid| pid.parse::<u32>().is_ok()) && path.is_dir()
        };
        let items = fs::read_dir(parent).into_iter().flatten().flatten();
        let mut found: Vec<PathBuf> = items.map(|i| i.path()).filter(is_left).collect();
        found.small_sort();
        found
    }

    fn rename(&self) -> Result<(), WriteError> {
        let failed = |e| WriteError::File(self.out.clone(), e);
        // Only an empty folder can be removed so.
        match fs::remove_dir(&self.out) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(failed(e)),
            _ => {}
        }
        fs::rename(&self.part, &self.out).map_err(failed)
    }
}
