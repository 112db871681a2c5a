//! Bundles: a realization with everything that it rests on, in one file (`study-stimulus/1`).
//!
//! A bundle has the model file, the recordings that it was identified from and validated with, the
//! certificate and the coverage, and what only people know: license, credit, instrument, day of
//! publication. It has no time, path or user of whoever packed it: equal recordings, model and
//! statements give equal bytes, whose SHA-256 is the address of the bundle.
//!
//! [`Bundle::open`] packs anew what it finds, and compares: nothing in a bundle is believed that can
//! be computed from its model and its recordings. Bundles come from others; sizes, names and kinds of
//! files are restricted before anything is read (the limits are those of [`TarError`]).

mod facts;
mod feel;
mod metadata;
mod tar;

pub use facts::Fact;
pub use feel::{Feel, at_rest};
pub use tar::{MAX_BYTES, TarError};

use crate::identify::vaf::score;
use crate::model::coverage::{Determined, Origin};
use crate::model::file;
use crate::model::{Realization, Units};
use crate::recording::{self, Recording, RecordingError, mean_and_variance};
use study_base::diagnostic::{Findings, Severity, table};
use study_base::hex::sha256;
use study_base::sort::SmallSort as _;
use study_base::text::{Untrusted, is_unsafe};

/// The `format` of a bundle.
pub const FORMAT: &str = "study-stimulus/1";
/// File name of the facts.
pub const MANIFEST: &str = "stimulus.toml";
/// File name of the realization.
pub const MODEL: &str = "model.toml";
/// How far the range for which a model says that it was identified may go beyond that of its recordings, as a share of it:
/// filters change ends and speeds.
const TRAINED_ROOM: f64 = 0.25;
/// Most characters of what a person states.
const MAX_TEXT: usize = 500;

/// What only people know of a stimulus. An empty text says nothing. Untrusted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Stated {
    /// On which terms it may be used: an SPDX identifier, or words.
    pub license: String,
    /// Whom to credit.
    pub credit: String,
    /// With what it was measured, and by whom.
    pub instrument: String,
    /// On which day the recordings were published, `YYYY-MM-DD`.
    pub published: String,
}

impl Stated {
    /// Each text with its key, which is also that of a header line of a recording.
    fn named(&self) -> [(&'static str, &str); 4] {
        [
            ("license", &self.license),
            ("credit", &self.credit),
            ("instrument", &self.instrument),
            ("published", &self.published),
        ]
    }

    /// Completed by the headers of the recordings, and checked.
    fn completed(mut self, recordings: &[Kept]) -> Result<Self, BundleError> {
        let Self {
            license,
            credit,
            instrument,
            published,
        } = &mut self;
        let all = [
            ("license", license),
            ("credit", credit),
            ("instrument", instrument),
            ("published", published),
        ];
        for (key, text) in all {
            for kept in recordings {
                let own = kept.recording.header_line(&format!("{key}:"));
                match own {
                    Some(own) if text.is_empty() => own.clone_into(text),
                    Some(own) if own != *text => {
                        return Err(BundleError::Contradicts {
                            key,
                            stated: text.clone(),
                            recording: kept.recording.name.clone(),
                            own: own.to_owned(),
                        });
                    }
                    _ => {}
                }
            }
            if text.trim().is_empty() {
                return Err(BundleError::NotStated(key));
            }
            if text.contains(is_unsafe) || text.chars().count() > MAX_TEXT {
                return Err(BundleError::Text(key));
            }
        }
        if !is_day(&self.published) {
            return Err(BundleError::Day(self.published));
        }
        Ok(self)
    }
}

/// Whether a text is a day as `YYYY-MM-DD`.
fn is_day(text: &str) -> bool {
    let within = |part: &str, most: u32| part.parse().is_ok_and(|n: u32| (1..=most).contains(&n));
    text.len() == 10
        && text.chars().all(|c| c.is_ascii_digit() || c == '-')
        && matches!(text.split('-').collect::<Vec<_>>()[..], [year, month, day]
            if year.len() == 4 && month.len() == 2 && within(year, 9999) && within(month, 12) && within(day, days(year, month)))
}

/// The number of days of a month.
fn days(year: &str, month: &str) -> u32 {
    let year: u32 = year.parse().unwrap_or_default();
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    match month {
        "02" => 28 + u32::from(leap),
        "04" | "06" | "09" | "11" => 30,
        _ => 31,
    }
}

study_base::named! {
    /// What a recording was used for.
    Purpose {
        /// The realization was identified from it.
        Training = "training",
        /// The realization was validated with it.
        Validation = "validation",
    }
}

/// A recording of a bundle.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// As it was read, under the name that the model file has for it.
    pub recording: Recording,
    /// What it was used for.
    pub purpose: Purpose,
    bytes: Vec<u8>,
}

impl Kept {
    /// The sign between two columns and the names of the columns.
    fn layout(&self) -> (char, Vec<String>) {
        let text = String::from_utf8_lossy(&self.bytes);
        let text = text.trim_start_matches('\u{feff}');
        let is_names = |line: &&str| !line.starts_with('#') && !line.trim().is_empty();
        let line = text.lines().find(is_names).unwrap_or_default();
        let separator = [';', '\t']
            .into_iter()
            .find(|c| line.contains(*c))
            .unwrap_or(',');
        let names = line
            .split(separator)
            .map(|name| name.trim().trim_matches('"').to_owned());
        (separator, names.collect())
    }

    /// The decimal sign, where columns are not separated by commas.
    fn decimal(&self) -> &'static str {
        let text = String::from_utf8_lossy(&self.bytes);
        let mut rows = text.lines().filter(|line| !line.starts_with('#'));
        if rows.any(|row| row.contains(',')) {
            ","
        } else {
            "."
        }
    }
}

/// Path of the recording with this index.
fn path(index: usize) -> String {
    format!("recordings/{:02}.csv", index + 1)
}

/// What a key of [`Stated`] is called in a sentence.
fn words(key: &str) -> &str {
    match key {
        "published" => "day of publication",
        other => other,
    }
}

/// Why something is no bundle, or cannot become one.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum BundleError {
    #[error(transparent)]
    Container(#[from] TarError),
    #[error("there is no file `{0}`")]
    Missing(String),
    #[error("a bundle of this format has no file `{0}`")]
    Extra(String),
    #[error("{MANIFEST}: not a {FORMAT} file; a newer version of study may read it")]
    Format,
    #[error("{MANIFEST}: line {0} was changed: it is not as `study stimulus pack` writes it")]
    Line(usize),
    #[error("the {} is not stated", words(.0))]
    NotStated(&'static str),
    #[error("the {} has control characters or more than {MAX_TEXT} characters", words(.0))]
    Text(&'static str),
    #[error("`{}` is not a date: write the day of publication as 2024-05-17", Untrusted(.0))]
    Day(String),
    #[error("the {} is stated as `{}`, and the recording `{}` has `{}`", words(.key), Untrusted(.stated), Untrusted(.recording), Untrusted(.own))]
    Contradicts {
        key: &'static str,
        stated: String,
        recording: String,
        own: String,
    },
    #[error(
        "the model says that it was identified from the recording `{}`, but predicts its force worse than a constant (VAF {vaf:.1}, {bias_n:+.2} N on the average): is it of another target, in other units, or of the opposite sign?",
        Untrusted(.recording)
    )]
    Misfit {
        recording: String,
        vaf: f64,
        bias_n: f64,
    },
    #[error(
        "the model says that it was identified from {} to {} mm and up to {} mm/s, and its recordings go from {} to {} mm and up to {} mm/s",
        .stated[0], .stated[1], .stated[2], .found[0], .found[1], .found[2]
    )]
    Trained { stated: [f64; 3], found: [f64; 3] },
    #[error("{0} was changed: its SHA-256 is not the one in {MANIFEST}")]
    Changed(String),
    #[error("{MODEL}: {}", Untrusted(.0))]
    Model(String),
    #[error("recording {0}")]
    Recording(RecordingError),
    #[error("the model file names no recording that it was identified from")]
    NoRecordings,
    #[error("the recording `{}`, from which the model was identified, is not among the files", Untrusted(.0))]
    Absent(String),
    #[error("the model was identified from another recording `{}`: the SHA-256 in the model file differs", Untrusted(.0))]
    Other(String),
    #[error("the model file does not name the recording `{}`, neither as its source nor with a VAF", Untrusted(.0))]
    Unrelated(String),
    #[error("the certificate does not belong to the model: {} is stated as {}, and the model has {}", Untrusted(.name), Untrusted(.stated), Untrusted(.found))]
    Certificate {
        name: String,
        stated: String,
        found: String,
    },
    #[error("{MANIFEST} states {} as {}, which model and recordings do not give: {}", Untrusted(.name), Untrusted(.stated), Untrusted(.found))]
    Fact {
        name: String,
        stated: String,
        found: String,
    },
    #[error("{0} was changed: it does not say what {MANIFEST} says")]
    Metadata(String),
}

/// A stimulus in one file.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    /// The realization, in its own units.
    pub realization: Realization,
    /// What people stated of it.
    pub stated: Stated,
    /// The recordings, those for training first.
    pub recordings: Vec<Kept>,
    facts: Vec<Fact>,
    files: Vec<(String, Vec<u8>)>,
    bytes: Vec<u8>,
}

impl Bundle {
    /// Packs a model file and its recordings, each with a name, which counts for those that the model
    /// was only validated with: the others are known by their SHA-256. What the headers of the
    /// recordings state need not be in `stated`.
    ///
    /// # Errors
    /// [`BundleError`].
    pub fn pack(
        model: &[u8],
        recordings: Vec<(String, Vec<u8>)>,
        stated: Stated,
    ) -> Result<Self, BundleError> {
        let realization = realization(model)?;
        let recordings = related(&realization, recordings)?;
        let stated = stated.completed(&recordings)?;
        let facts = facts::of(&sha256(model), &realization, &stated, &recordings);
        let crates = metadata::ro_crate(&realization, &stated, &recordings);
        let package = metadata::data_package(&realization, &stated, &recordings);
        let mut files = vec![
            (metadata::DATA_PACKAGE.to_owned(), package.into_bytes()),
            (metadata::RO_CRATE.to_owned(), crates.into_bytes()),
            (MANIFEST.to_owned(), facts::write(&facts).into_bytes()),
            (MODEL.to_owned(), model.to_owned()),
        ];
        let numbered = recordings.iter().enumerate();
        files.extend(numbered.map(|(i, kept)| (path(i), kept.bytes.clone())));
        files.small_sort();
        let bytes = tar::write(&files)?;
        Ok(Self {
            realization,
            stated,
            recordings,
            facts,
            files,
            bytes,
        })
    }

    /// Opens a bundle of unknown origin.
    ///
    /// # Errors
    /// [`BundleError`] with the first cause for which it is none.
    pub fn open(bytes: &[u8]) -> Result<Self, BundleError> {
        let files = tar::read(bytes)?;
        let file = |name: &str| {
            let found = files.iter().find(|(own, _)| own == name);
            found
                .map(|(_, content)| content.as_slice())
                .ok_or_else(|| BundleError::Missing(name.to_owned()))
        };
        let text = String::from_utf8_lossy(file(MANIFEST)?);
        if text.lines().next() != Some(&format!("format = \"{FORMAT}\"")) {
            return Err(BundleError::Format);
        }
        let facts = facts::read(&text).map_err(BundleError::Line)?;
        let manifest = Manifest::read(&text)?;
        let model = file(MODEL)?;
        if sha256(model) != manifest.fingerprint {
            return Err(BundleError::Changed(MODEL.to_owned()));
        }
        let mut recordings = Vec::new();
        for (i, (name, hash)) in manifest.recordings.into_iter().enumerate() {
            let content = file(&path(i))?;
            if sha256(content) != hash {
                return Err(BundleError::Changed(path(i)));
            }
            recordings.push((name, content.to_owned()));
        }
        let anew = Self::pack(model, recordings, manifest.stated)?;
        agree(&facts, &anew.facts)?;
        for (name, content) in &anew.files {
            if name != MANIFEST && file(name)? != content {
                return Err(BundleError::Metadata(name.clone()));
            }
        }
        let known = |name: &str| anew.files.iter().any(|(own, _)| own == name);
        match files.iter().find(|(name, _)| !known(name)) {
            Some((name, _)) => Err(BundleError::Extra(name.clone())),
            None => Ok(Self {
                facts,
                files,
                bytes: bytes.to_owned(),
                ..anew
            }),
        }
    }

    /// The address of the bundle: the SHA-256 of its bytes, in hexadecimal.
    pub fn sha256(&self) -> String {
        sha256(&self.bytes)
    }

    /// The bytes of the bundle.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Its files: a path that is safe below any folder, and the content.
    pub fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        (self.files.iter()).map(|(name, content)| (name.as_str(), content.as_slice()))
    }

    /// The bytes of the model file.
    pub fn model(&self) -> &[u8] {
        let found = self.files().find(|(name, _)| *name == MODEL);
        found.map(|(_, content)| content).unwrap_or_default()
    }

    /// Everything that it says of itself.
    pub fn facts(&self) -> &[Fact] {
        &self.facts
    }

    /// The facts in which two bundles differ: the name, and the values where there are any. Untrusted.
    pub fn differences<'b>(&'b self, other: &'b Self) -> Vec<Difference<'b>> {
        let of = |facts: &'b [Fact], fact: &Fact| {
            let same = |other: &&Fact| (&other.section, &other.key) == (&fact.section, &fact.key);
            facts.iter().find(same).map(|found| found.value.as_str())
        };
        let mine = self.facts.iter();
        let theirs = other
            .facts
            .iter()
            .filter(|fact| of(&self.facts, fact).is_none());
        mine.chain(theirs)
            .map(|fact| (fact.name(), [of(&self.facts, fact), of(&other.facts, fact)]))
            .filter(|(_, [mine, theirs])| mine != theirs)
            .collect()
    }
}

/// The name of a fact, and its values in two bundles.
pub type Difference<'b> = (String, [Option<&'b str>; 2]);

/// What [`Bundle::open`] takes from `stimulus.toml`; all the rest is computed.
struct Manifest {
    fingerprint: String,
    stated: Stated,
    /// Names and SHA-256.
    recordings: Vec<(String, String)>,
}

impl Manifest {
    fn read(text: &str) -> Result<Self, BundleError> {
        let mut wrong = None;
        let (read, findings) = table::parse(MANIFEST, text, |mut root| {
            let mut stated = |key| match root.text(key) {
                Some(text) => text,
                None => {
                    wrong = wrong.or(Some(key));
                    String::new()
                }
            };
            let stated = Stated {
                license: stated("license"),
                credit: stated("credit"),
                instrument: stated("instrument"),
                published: stated("published"),
            };
            let mut recordings = Vec::new();
            for mut recording in root.tables("recordings") {
                recordings.push((recording.text("name")?, recording.text("sha256")?));
            }
            Some(Self {
                fingerprint: root.text("fingerprint")?,
                stated,
                recordings,
            })
        });
        if let Some(key) = wrong {
            return Err(BundleError::NotStated(key));
        }
        read.ok_or_else(|| {
            let at = findings
                .faults
                .first()
                .and_then(|fault| fault.span.as_ref());
            let before = at
                .and_then(|span| text.get(..span.start))
                .unwrap_or_default();
            BundleError::Line(before.matches('\n').count() + 1)
        })
    }
}

/// Compares what a bundle states with what its model and its recordings give.
fn agree(stated: &[Fact], anew: &[Fact]) -> Result<(), BundleError> {
    // as they are read: a name may contain what separates a key from its value
    let anew = facts::read(&facts::write(anew)).map_err(BundleError::Line)?;
    let none = || Fact {
        section: String::new(),
        key: "nothing".to_owned(),
        value: "nothing".to_owned(),
    };
    for i in 0..stated.len().max(anew.len()) {
        let [a, b] = [stated, &anew].map(|facts| facts.get(i).cloned().unwrap_or_else(none));
        if a.agrees(&b) {
            continue;
        }
        let of_certificate = [&a, &b].iter().any(|fact| fact.section == "certificate");
        let (name, stated) = (a.name(), a.value.clone());
        let found = match a.name() == b.name() {
            true => b.value,
            false => format!("{} = {}", b.name(), b.value),
        };
        return Err(match of_certificate {
            true => BundleError::Certificate {
                name,
                stated,
                found,
            },
            false => BundleError::Fact {
                name,
                stated,
                found,
            },
        });
    }
    Ok(())
}

fn realization(model: &[u8]) -> Result<Realization, BundleError> {
    let text = std::str::from_utf8(model).map_err(|e| BundleError::Model(e.to_string()))?;
    let first = |findings: &Findings| {
        let errors = findings.only(Severity::Error).faults;
        errors
            .first()
            .map(|fault| fault.message.clone())
            .unwrap_or_default()
    };
    let (read, findings) = file::parse(MODEL, text);
    read.ok_or_else(|| BundleError::Model(first(&findings)))
}

/// The recordings in the order of a bundle: those that the model file names as its source, then those
/// of which it has a VAF only, each by name.
fn related(
    realization: &Realization,
    given: Vec<(String, Vec<u8>)>,
) -> Result<Vec<Kept>, BundleError> {
    let sources = &realization.provenance.recordings;
    if sources.is_empty() {
        return Err(BundleError::NoRecordings);
    }
    let mut kept: Vec<Kept> = Vec::new();
    for (given_name, bytes) in given {
        let hash = sha256(&bytes);
        let source = sources.iter().find(|(_, own)| **own == hash);
        let (name, purpose) = match source {
            Some((name, _)) => (name.clone(), Purpose::Training),
            None if sources.contains_key(&given_name) => {
                return Err(BundleError::Other(given_name));
            }
            None if realization.vaf.contains_key(&given_name) => (given_name, Purpose::Validation),
            None => return Err(BundleError::Unrelated(given_name)),
        };
        // a copy says nothing new
        if kept.iter().any(|kept| kept.bytes == bytes) {
            continue;
        }
        let recording = recording::read(name, bytes.as_slice()).map_err(BundleError::Recording)?;
        kept.push(Kept {
            recording,
            purpose,
            bytes,
        });
    }
    let has = |hash: &String| kept.iter().any(|kept| kept.recording.sha256 == *hash);
    if let Some((name, _)) = sources.iter().find(|(_, hash)| !has(hash)) {
        return Err(BundleError::Absent(name.clone()));
    }
    let key = |kept: &Kept| {
        (
            kept.purpose == Purpose::Validation,
            kept.recording.name.clone(),
        )
    };
    kept.small_sort_by_key(key);
    // That of a turning handle needs a lever arm, which is not known.
    let judged = kept.iter().filter(|_| realization.units == Units::Linear);
    let training = judged.filter(|kept| kept.purpose == Purpose::Training);
    let training: Vec<&Recording> = training.map(|kept| &kept.recording).collect();
    for recording in &training {
        let score = score(realization, recording);
        // A constant error is one, although VAF does not see it.
        let (_, variance) = mean_and_variance(&recording.f_n);
        if score.vaf < 0.0 || score.residual_n.powi(2) + score.bias_n.powi(2) > variance {
            return Err(BundleError::Misfit {
                recording: recording.name.clone(),
                vaf: score.vaf,
                bias_n: score.bias_n,
            });
        }
    }
    trained(realization, &training)?;
    Ok(kept)
}

/// Whether the range for which a model says that it was identified is that of its recordings. The speed of one with a term
/// from a dynamic recording, which is no source of its table, is not known here.
fn trained(realization: &Realization, recordings: &[&Recording]) -> Result<(), BundleError> {
    let ranges = recordings.iter().map(|recording| recording.range_mm());
    let Some([low, high]) = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else {
        return Ok(());
    };
    let top = (recordings.iter()).fold(0.0, |top: f64, r| r.top_speed_mm_s().max(top));
    let dynamic = |term: &Determined| term.origin == Origin::Dynamic;
    let elsewhere = realization.provenance.terms.values().any(dynamic);
    let stated = realization.trained;
    let room_mm = TRAINED_ROOM * (high - low);
    let wide = stated.x_mm[0] < low - room_mm || stated.x_mm[1] > high + room_mm;
    let fast = !elsewhere && stated.v_mm_s > (1.0 + TRAINED_ROOM) * top;
    if wide || fast {
        return Err(BundleError::Trained {
            stated: [stated.x_mm[0], stated.x_mm[1], stated.v_mm_s],
            found: [low, high, top],
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
