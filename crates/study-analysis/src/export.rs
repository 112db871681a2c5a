//! Data sets for other programs and for archives, from the rows of a study and its
//! protocol. No input or output: files are handed to a function, one after the other.
//!
//! What all formats share is decided once: whose rows are exported and which columns. The declarations of the columns and the texts of the
//! protocol describe every column; a format only writes them down. Real, pilot and
//! simulated data are never in one data set.

mod author;
mod bids;
mod delimited;
mod frictionless;
mod hand_over;
mod privacy;
mod psych_ds;
mod readme;
mod select;
mod sheets;
mod table;
mod telemetry;

pub use delimited::Dialect;
pub use telemetry::Recorded;

use chrono::{DateTime, FixedOffset};
use select::Selected;
use std::collections::BTreeMap;
use std::io;
use study_base::text::{ParticipantId, Untrusted};
use study_plan::protocol::Protocol;
use study_plan::protocol::fingerprint::Fingerprints;
use study_session::outcome::ratings::Origin;
use study_session::outcome::{IntervalRow, ParticipantRow, RatingRow};
use table::Tables;

/// A format of a data set: one file of this folder, and its line in [`FORMATS`].
trait Format {
    /// The word after `--to`.
    const NAME: &'static str;
    /// What it is for, in one line of the help.
    const ABOUT: &'static str;
    /// Whether people open its tables in spreadsheets, and choose how cells are written.
    const SHEETS: bool = false;
    /// Whether it has a place for telemetry.
    const TELEMETRY: bool = true;
    /// Whether [`Options::profile_1`] changes it.
    const PROFILES: bool = false;
    /// How a missing value is written.
    const MISSING: &'static str = "an empty cell";

    /// Hands over all files.
    fn files(job: &mut Job<'_>) -> Result<(), ExportError>;
}

/// The formats, as the help lists them.
pub static FORMATS: &[FormatInfo] = &[
    FormatInfo::of::<sheets::Csv>(),
    FormatInfo::of::<sheets::Wide>(),
    FormatInfo::of::<bids::Bids>(),
    FormatInfo::of::<psych_ds::PsychDs>(),
    FormatInfo::of::<frictionless::Frictionless>(),
    FormatInfo::of::<hand_over::R>(),
];

/// One of [`FORMATS`].
#[derive(Debug, Clone, Copy)]
pub struct FormatInfo {
    /// Its name in arguments.
    pub name: &'static str,
    /// What it is for.
    pub about: &'static str,
    /// Whether [`Options::dialect`] applies.
    pub sheets: bool,
    /// Whether it has a place for telemetry.
    pub telemetry: bool,
    /// Whether [`Options::profile_1`] applies.
    pub profiles: bool,
    missing: &'static str,
    files: fn(&mut Job<'_>) -> Result<(), ExportError>,
}

impl FormatInfo {
    const fn of<F: Format>() -> Self {
        Self {
            name: F::NAME,
            about: F::ABOUT,
            sheets: F::SHEETS,
            telemetry: F::TELEMETRY,
            profiles: F::PROFILES,
            missing: F::MISSING,
            files: F::files,
        }
    }

    /// The format of this name.
    ///
    /// ```
    /// use study_analysis::export::FormatInfo;
    /// assert!(FormatInfo::named("csv").is_some_and(|format| format.sheets));
    /// assert!(FormatInfo::named("spss").is_none());
    /// ```
    pub fn named(name: &str) -> Option<&'static Self> {
        FORMATS.iter().find(|format| format.name == name)
    }
}

/// A version of the protocol.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Amendment {
    /// Its number, from 1.
    pub version: u32,
    /// When it was frozen.
    pub at: DateTime<FixedOffset>,
    /// Why; empty for the first. Untrusted.
    pub reason: String,
}

/// What is exported.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The newest version of the protocol.
    pub protocol: &'a Protocol,
    /// Every row of a trial, by participant, session and trial.
    pub rows: &'a [RatingRow],
    /// Every participant.
    pub participants: &'a [ParticipantRow],
    /// Every presentation of a study with parts.
    pub intervals: &'a [IntervalRow],
    /// All versions of the protocol.
    pub versions: &'a [Amendment],
    /// Fingerprints of the newest one.
    pub fingerprints: &'a Fingerprints,
    /// Its files: relative path, separated by `/`, and bytes.
    pub files: &'a [(String, Vec<u8>)],
    /// Every telemetry file that the journals name.
    pub telemetry: &'a [Recorded],
    /// A text for each participant that only the results folder has.
    pub secrets: &'a BTreeMap<ParticipantId, String>,
    /// Version of this program.
    pub tool_version: &'a str,
}

/// What a data set has.
#[derive(Debug, Clone)]
pub struct Options {
    /// The format.
    pub format: &'static FormatInfo,
    /// Whose rows.
    pub whose: Origin,
    /// Whether practice trials are exported.
    pub practice: bool,
    /// Whether columns of free text are exported.
    pub comments: bool,
    /// Whether telemetry is exported.
    pub telemetry: bool,
    /// Whether participants get new numbers in a random order.
    pub redact_ids: bool,
    /// Whether dates and times and the operator are left out.
    pub redact_times: bool,
    /// How cells are written, for `csv` and `wide`.
    pub dialect: Dialect,
    /// Whether a Data Package is of version 1.
    pub profile_1: bool,
}

/// What was exported.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// Number of participants.
    pub participants: usize,
    /// Number of trials.
    pub trials: usize,
    /// Number of files.
    pub files: usize,
    /// Rows of the schedule whose orders are in the data, if the planned number of
    /// participants is not complete.
    pub interim: Option<(u32, u32)>,
    /// Sentences for whoever exports: what could identify a person, what is missing.
    /// Untrusted.
    pub notices: Vec<String>,
}

/// Why nothing is exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Nobody of the kind took part.
    #[error("there are no trials of {} participants", word(*.0))]
    Nobody(Origin),
    /// Ids that become the same label, or none.
    #[error("participants {} and {} would both be `sub-{label}`: BIDS knows letters and digits only", .ids[0], .ids[1])]
    SameLabel {
        /// The ids.
        ids: [ParticipantId; 2],
        /// The label.
        label: String,
    },
    /// An id without a letter or digit.
    #[error("participant {0} has no letter or digit, which BIDS needs")]
    NoLabel(ParticipantId),
    /// A study without ratings.
    #[error("the study rates no single realizations, so that there is nothing to put side by side")]
    NotWide,
    /// A telemetry file that cannot be read.
    #[error("{}: no telemetry: {why}", Untrusted(.file))]
    Telemetry {
        /// The file.
        file: String,
        /// What is wrong with it.
        why: String,
    },
    /// A function that was given failed.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// The word for a kind of participants.
pub fn word(whose: Origin) -> &'static str {
    match whose {
        Origin::Real => "real",
        Origin::Pilot => "pilot",
        Origin::Simulated => "simulated",
    }
}

/// Reads a telemetry file.
pub type Read<'a> = dyn FnMut(&Recorded) -> io::Result<Vec<u8>> + 'a;
/// Takes a file of the data set: path, separated by `/`, and bytes.
pub type Write<'a> = dyn FnMut(&str, &[u8]) -> io::Result<()> + 'a;

/// What the writers of the formats use.
struct Job<'a> {
    source: &'a Source<'a>,
    options: &'a Options,
    selected: &'a Selected,
    tables: &'a Tables<'a>,
    read: &'a mut Read<'a>,
    write: &'a mut Write<'a>,
}

impl Job<'_> {
    /// The title, with what the data are if they are not real.
    fn title(&self) -> String {
        let title = &self.source.protocol.study.title;
        match self.options.whose {
            Origin::Real => title.clone(),
            Origin::Pilot => format!("PILOT: {title}"),
            Origin::Simulated => format!("SIMULATED: {title}"),
        }
    }

    fn file(&mut self, path: &str, bytes: &[u8]) -> Result<(), ExportError> {
        Ok((self.write)(path, bytes)?)
    }

    fn json(&mut self, path: &str, document: &serde_json::Value) -> Result<(), ExportError> {
        self.file(path, format!("{document:#}\n").as_bytes())
    }

    /// The frozen protocol and its files.
    fn protocol(&mut self, folder: &str) -> Result<(), ExportError> {
        for (path, bytes) in self.source.files {
            (self.write)(&format!("{folder}/{path}"), bytes)?;
        }
        Ok(())
    }
}

/// Exports a study. The same study and options give the same bytes.
///
/// # Errors
/// [`ExportError`]; some of the files may then have been handed over.
pub fn export(
    source: &Source<'_>,
    options: &Options,
    read: &mut Read<'_>,
    write: &mut Write<'_>,
) -> Result<Summary, ExportError> {
    let selected = select::select(source, options)?;
    let tables = Tables::of(source.protocol, &selected, options);
    let mut files = 0;
    let mut counted = |path: &str, bytes: &[u8]| {
        files += 1;
        write(path, bytes)
    };
    let mut read = |recorded: &Recorded| read(recorded);
    let mut job = Job {
        source,
        options,
        selected: &selected,
        tables: &tables,
        read: &mut read,
        write: &mut counted,
    };
    (options.format.files)(&mut job)?;
    Ok(Summary {
        participants: selected.participants.len(),
        trials: selected.rows.len(),
        files,
        interim: selected.interim(source.protocol.design.participants),
        notices: privacy::notices(source.protocol, &selected, &tables, options),
    })
}
