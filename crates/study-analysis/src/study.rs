//! What `study analyze` does: from a results folder, several of them, or a table to an
//! analysis with everything that a report needs.
//!
//! ```
//! use study_analysis::analyze::Include;
//! use study_analysis::study::{Options, Study};
//! # fn main() -> Result<(), study_analysis::study::StudyError> {
//! # let results = concat!(env!("CARGO_MANIFEST_DIR"), "/../../results/turn-signal-example");
//! let study = Study::open(results.as_ref())?;
//! let simulated = Include { simulated: true, ..Include::default() };
//! let analyzed = study.analyze(&Options { include: simulated, ..Options::default() })?;
//! let ratings = analyzed.ratings().expect("the primary question is a rating");
//! assert_eq!(ratings.findings[0].question.id(), "vaf");
//! # Ok(())
//! # }
//! ```

mod error;
mod factors;
mod motion;
mod pool;
mod preregistered;
mod source;
mod traces;

pub use error::{Difference, PoolError, StudyError};
pub use factors::{check_factors, factor};
pub use motion::samples;
pub use pool::Pool;
pub use source::{Site, SiteDevice, Source};
pub use traces::Trace;

use crate::analyze::psychophysics::perceptual::{Errors, Weighing, weighings};
use crate::analyze::psychophysics::search::{Exploration, explorations};
use crate::analyze::psychophysics::{PartAnalysis, StudyData, parts, searchers_of};
use crate::analyze::{
    self, Analysis, Deviation, Include, OrdinalEffort, Progress, Rules, Warning,
    analyze_with_progress,
};
use crate::load::{self, Loaded};
use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;
use study_base::text::{ParticipantId, QuestionId, Untrusted, counted};
use study_plan::protocol::{Factor, Protocol, Task, Transform};
use study_session::outcome::ratings::Ratings;
use study_session::outcome::{Event, RatingRow, SentFault};
use study_session::store::{Derived, SessionData, StudyFolder, one_study};

/// Most kinds of refused numbers that a warning names.
const MAX_TOLD: usize = 8;

/// What is analyzed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options<'a> {
    /// The question; `None`: the primary one.
    pub question: Option<&'a str>,
    /// Which sessions are included besides those of participants.
    pub include: Include,
    /// The draws of the ordinal hierarchical model; `None`: it is left out.
    pub posterior: Option<OrdinalEffort>,
    /// Where the analysis says how far it is.
    pub progress: Option<&'a Progress>,
}

/// A study that was read from its results folder.
#[derive(Debug)]
pub struct Study {
    /// The folder.
    pub folder: StudyFolder,
    /// Its sessions, by participant and number.
    pub sessions: Vec<SessionData>,
    /// The newest version of its protocol, with the models.
    pub loaded: Loaded,
    /// The rows of all sessions.
    pub derived: Derived,
}

/// An analysis with what a report says of its source.
#[derive(Debug)]
pub struct Analyzed {
    /// What was analyzed.
    pub source: Source,
    /// What came out.
    pub results: Results,
    /// Damage of the results folder, one sentence each. Untrusted.
    pub damage: Vec<String>,
}

/// What came out of an analysis.
#[derive(Debug)]
pub enum Results {
    /// The statistics of ratings, with those of the other parts of the study.
    Ratings(Box<Analysis>),
    /// Those of parts alone, of a study whose primary question is no rating.
    Parts(Vec<PartAnalysis>),
}

impl Analyzed {
    /// The analysis of ratings, if there is one.
    pub fn ratings(&self) -> Option<&Analysis> {
        match &self.results {
            Results::Ratings(analysis) => Some(analysis),
            Results::Parts(_) => None,
        }
    }

    /// The analyzes of the parts that are not ratings.
    pub fn parts(&self) -> &[PartAnalysis] {
        match &self.results {
            Results::Ratings(analysis) => &analysis.parts,
            Results::Parts(parts) => parts,
        }
    }
}

impl Study {
    /// Reads the only study of a results folder, or the study in this folder.
    ///
    /// # Errors
    /// [`StudyError::Store`] or [`StudyError::Frozen`].
    pub fn open(path: &Path) -> Result<Self, StudyError> {
        Self::read(one_study(path)?)
    }

    /// Reads the sessions and the newest protocol of an opened folder.
    ///
    /// # Errors
    /// As [`Study::open`].
    pub fn read(folder: StudyFolder) -> Result<Self, StudyError> {
        let sessions = folder.sessions()?;
        let loaded = load::frozen(&folder)?;
        let derived = Derived::of(&sessions, &loaded.protocol);
        Ok(Self {
            folder,
            sessions,
            loaded,
            derived,
        })
    }

    /// The problems of the journals and the frozen protocols, one sentence each.
    ///
    /// # Errors
    /// [`StudyError::Store`] if the folder cannot be read.
    pub fn damage(&self) -> Result<Vec<String>, StudyError> {
        let found = load::damage(&self.folder, &self.sessions, Some(&self.loaded));
        Ok(found?)
    }

    /// The participants whose journals lack answers that were acknowledged.
    pub fn truncated(&self) -> Vec<&ParticipantId> {
        let truncated = self.sessions.iter().filter(|s| s.truncated);
        truncated.map(|s| &s.participant).collect()
    }

    /// Analyzes the study by the newest version of its protocol.
    ///
    /// # Errors
    /// [`StudyError`] if the question has no numeric answers, if there are only pilots and
    /// they are not asked for, or if the folder cannot be read.
    pub fn analyze(&self, options: &Options<'_>) -> Result<Analyzed, StudyError> {
        let protocol = &self.loaded.protocol;
        let is_real = |row: &RatingRow| !row.pilot && !row.simulated;
        let rows = &self.derived.rows;
        let pilots = rows.iter().any(|row| row.pilot) && !options.include.pilot;
        if pilots && !rows.iter().any(is_real) {
            return Err(StudyError::OnlyPilots(self.folder.path().to_owned()));
        }
        let mut parts = self.analyze_parts(options.include);
        let changed = self.deviations()?;
        let only_parts = !parts.is_empty() && options.question.is_none() && !is_rated(protocol);
        warn_of_changes(protocol, &changed, only_parts, &mut parts);
        if only_parts {
            if let Some(first) = parts.first_mut() {
                first.warnings.extend(self.clock_jumps());
            }
            let source = Source {
                preregistration: preregistered::of_parts(self, &parts)?,
                ..self.source()
            };
            return Ok(Analyzed {
                source,
                results: Results::Parts(parts),
                damage: self.damage()?,
            });
        }
        let question = question(protocol, options.question)?;
        let (analysis, damage) = rayon::join(
            || self.analyze_ratings(&question, options),
            || self.damage(),
        );
        let (mut analysis, damage) = (analysis?, damage?);
        analysis.parts = parts;
        let mut source = self.source();
        source.preregistration = preregistered::add(self, &mut analysis)?;
        let warnings = damage.iter().map(|text| Warning {
            code: "damaged-results",
            text: format!("{text} (see `study verify`)"),
        });
        // Before all other warnings.
        let warnings = warnings.chain(self.clock_jumps());
        let warnings = warnings.chain(self.with_data(|data| searchers_of(data, options.include)));
        analysis.warnings.splice(0..0, warnings);
        Ok(Analyzed {
            source,
            results: Results::Ratings(Box::new(analysis)),
            damage,
        })
    }

    /// That dates are wrong, if the clock of a computer jumped during a session.
    fn clock_jumps(&self) -> Option<Warning> {
        let jumped = self.sessions.iter().filter(|s| !s.clock_jumps().is_empty());
        let names: Vec<&str> = jumped.map(|s| s.participant.as_str()).collect();
        (!names.is_empty()).then(|| Warning {
            code: "clock-jumped",
            text: format!(
                "the clock of the computer jumped during sessions of {}: their dates and gaps are wrong, \
                 durations are not (see `study verify`)",
                names.join(", ")
            ),
        })
    }

    /// Force against position in some included playbacks: the first of each realization by
    /// up to three participants. Files that cannot be read are skipped; `study verify`
    /// reports them.
    pub fn traces(&self, analysis: &Analysis) -> Vec<Trace> {
        traces::traces(self, analysis)
    }

    /// The study for the head of its report.
    fn source(&self) -> Source {
        let study = &self.loaded.protocol.study;
        Source {
            title: study.title.clone(),
            study: Some(study.id.clone()),
            protocol_version: Some(self.folder.version()),
            path: self.folder.path().display().to_string(),
            confirms: self.loaded.protocol.confirms.clone(),
            ..Source::default()
        }
    }

    /// The analysis of each part and questionnaire; none of a study without any.
    fn analyze_parts(&self, include: Include) -> Vec<PartAnalysis> {
        self.with_data(|data| parts(data, include))
    }

    /// What each part that searches found; none of a study without one.
    pub fn explore(&self, include: Include) -> Vec<Exploration> {
        self.with_data(|data| explorations(data, include))
    }

    /// What the choices of each part with pairs or a search tell of what is weighed in errors; none of a study without
    /// such a part.
    pub fn weigh(&self, include: Include, errors: &Errors) -> Vec<Weighing> {
        self.with_data(|data| weighings(data, include, errors))
    }

    fn with_data<T>(&self, what: impl FnOnce(&StudyData<'_>) -> T) -> T {
        let sessions: Vec<_> = self.sessions.iter().map(|s| &s.history).collect();
        let data = StudyData {
            protocol: &self.loaded.protocol,
            rows: &self.derived.rows,
            intervals: &self.derived.intervals,
            participants: &self.derived.participants,
            sessions: &sessions,
            pools: true,
        };
        what(&data)
    }

    fn analyze_ratings(
        &self,
        question: &QuestionId,
        options: &Options<'_>,
    ) -> Result<Analysis, StudyError> {
        let protocol = &self.loaded.protocol;
        let rules = Rules {
            deviations: self.deviations()?,
            posterior: options.posterior,
            ..Rules::of(protocol, question.as_str(), options.include)
        };
        let mut analysis = analyzed(&self.ratings(question), &rules, options.progress);
        let shares = protocol.analysis.share_of(question).map(|option| Warning {
            code: "shares",
            text: format!(
                "numbers are shares: 1 for the answer “{option}”, and 0 for any other; t tests of shares are \
                 approximate, and the ordinal model is a logistic one"
            ),
        });
        let outcome = protocol.outcomes.iter().find(|o| o.id == *question);
        let measured = outcome.map(|outcome| Warning {
            code: "outcome",
            text: format!(
                "this analysis is of a measured outcome, {}, in place of the rating{}: what it shows was not planned for",
                outcome.in_words(),
                match outcome.transform {
                    Transform::Log => "; numbers are its natural logarithms",
                    Transform::Identity => "",
                }
            ),
        });
        let warnings = shares.into_iter().chain(measured);
        let warnings = warnings.chain(self.refused_numbers(options.include));
        analysis.warnings.splice(0..0, warnings);
        Ok(analysis)
    }

    /// How many numbers that a controller program sent do not count, and why.
    fn refused_numbers(&self, include: Include) -> Option<Warning> {
        let included = |session: &&SessionData| {
            session.history.start().is_some_and(|start| {
                (include.pilot || !start.seat.is_pilot())
                    && (include.simulated || !start.seat.is_simulated())
            })
        };
        let mut counts: BTreeMap<(String, &str), usize> = BTreeMap::new();
        let sessions = self.sessions.iter().filter(included);
        for entry in sessions.flat_map(|session| &session.entries) {
            let Event::NumbersSent { numbers, .. } = &entry.event else {
                continue;
            };
            for number in numbers {
                let own = number.fault.filter(|fault| match fault {
                    // It may have been declared since.
                    SentFault::Undeclared | SentFault::OtherUnit => {
                        number.declared_in(&self.loaded.protocol).is_err()
                    }
                    SentFault::NoNumber | SentFault::OutsidePlayback | SentFault::Twice => true,
                });
                if let Some(fault) = own {
                    let key = Untrusted(&number.key).to_string();
                    *counts.entry((key, fault.in_words())).or_default() += 1;
                }
            }
        }
        let all: usize = counts.values().sum();
        let told: Vec<String> = (counts.into_iter().take(MAX_TOLD))
            .map(|((key, why), n)| format!("{key} {why} ({n})"))
            .collect();
        (all > 0).then(|| Warning {
            code: "numbers-refused",
            text: format!(
                "{} that the device sent {} not count: {} (see attempts.csv)",
                counted(all, "number", "numbers"),
                if all == 1 { "does" } else { "do" },
                told.join("; ")
            ),
        })
    }

    /// The answers to a question, with what the protocol and the model files say of the
    /// realizations.
    fn ratings(&self, question: &QuestionId) -> Ratings {
        let protocol = &self.loaded.protocol;
        // An outcome is measured in the trials whose rating counts.
        let outcome = protocol.outcomes.iter().find(|o| o.id == *question);
        let question = outcome.map_or(question, |_| &protocol.analysis.primary);
        let share_of = protocol.analysis.share_of(question);
        let derived = &self.derived;
        let mut ratings = Ratings::from_rows(&derived.rows, question, share_of);
        ratings.set_states(&derived.participants);
        ratings.set_failed(&derived.rows, &derived.attempts);
        let outcomes = match outcome {
            None => protocol.outcomes.as_slice(),
            Some(outcome) => std::slice::from_ref(outcome),
        };
        ratings.set_measured(&derived.rows, outcomes, &motion::measured(self, outcomes));
        if let (Some(outcome), Some(own)) = (outcome, ratings.measured.first()) {
            ratings = ratings.of_measured(own, |x| outcome.transform.apply(x));
        }
        describe_realizations(&mut ratings, &self.loaded);
        ratings
    }

    /// The changes of the analysis in later versions of the protocol.
    fn deviations(&self) -> Result<Vec<Deviation>, StudyError> {
        let mut found = Vec::new();
        let mut before: Option<Protocol> = None;
        let versions = &self.folder.manifest().versions;
        let registered = versions.len() > 1 && preregistered::has_document(self)?;
        for version in versions.iter().filter(|_| versions.len() > 1) {
            let after = load::frozen_version(&self.folder, version.version)?.protocol;
            if let Some(before) = &before {
                let changes = analyze::deviations(before, &after);
                found.extend(changes.into_iter().map(|change| Deviation {
                    text: format!(
                        "protocol {} of {}, because \"{}\": {}",
                        version.version,
                        version.at.format("%Y-%m-%d"),
                        version.reason,
                        change.text
                    ),
                    registered,
                    ..change
                }));
            }
            before = Some(after);
        }
        Ok(found)
    }
}

/// Adds changes of the analysis to the warnings of parts: those of a track to its part, the others
/// to the first one, if there is no analysis of ratings that warns of them.
fn warn_of_changes(
    protocol: &Protocol,
    changed: &[Deviation],
    only_parts: bool,
    parts: &mut [PartAnalysis],
) {
    for change in changed {
        let has = |own: &PartAnalysis, track| match protocol.part(&own.part).map(|p| &p.task) {
            Some(Task::Discrimination { tracks }) => tracks.contains(track),
            _ => false,
        };
        let own = match &change.track {
            Some(track) => parts.iter_mut().find(|part| has(part, track)),
            None if only_parts => parts.first_mut(),
            None => None,
        };
        if let Some(part) = own {
            part.warnings.push(change.warning());
        }
    }
}

/// Analyzes a table of ratings without a study: `subject,model,rating` and further columns
/// that are optional. `path` names it in messages and in the report.
///
/// # Errors
/// [`StudyError::Table`] if it is no such table.
///
/// ```
/// use study_analysis::analyze::Rules;
/// use study_analysis::study;
/// # fn main() -> Result<(), study::StudyError> {
/// let table = "subject,model,rating\nP1,a,1\nP1,b,3\nP2,a,2\nP2,b,4\n";
/// let analyzed = study::analyze_table("t.csv".as_ref(), table.as_bytes(), None, &Rules::default(), None)?;
/// assert_eq!(analyzed.ratings().map(|a| a.realizations.len()), Some(2));
/// # Ok(())
/// # }
/// ```
pub fn analyze_table(
    path: &Path,
    input: impl BufRead,
    question: Option<&str>,
    rules: &Rules,
    progress: Option<&Progress>,
) -> Result<Analyzed, StudyError> {
    let name = path.display().to_string();
    let ratings = Ratings::read_csv(&name, input, question)?;
    let title = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(Analyzed {
        source: Source {
            title: title.into_owned(),
            path: name,
            ..Source::default()
        },
        results: Results::Ratings(Box::new(analyzed(&ratings, rules, progress))),
        damage: Vec::new(),
    })
}

/// [`analyze_table`] of a factorial design, whose table has a column for each factor.
///
/// # Errors
/// As for [`analyze_table`], or if a cell holds another level than those of its factor.
pub fn analyze_factorial_table(
    path: &Path,
    input: impl BufRead,
    factors: &[Factor],
    question: Option<&str>,
    rules: &Rules,
    progress: Option<&Progress>,
) -> Result<Analyzed, StudyError> {
    let name = path.display().to_string();
    let (table, crossing) = factors::with_factors(&name, input, factors)?;
    let rules = Rules {
        crossing: Some(crossing),
        ..rules.clone()
    };
    analyze_table(path, table.as_slice(), question, &rules, progress)
}

fn analyzed(ratings: &Ratings, rules: &Rules, progress: Option<&Progress>) -> Analysis {
    match progress {
        Some(progress) => analyze_with_progress(ratings, rules, progress),
        None => analyze::analyze(ratings, rules),
    }
}

/// Whether the primary question is analyzed as a rating: numbers other than estimates of
/// magnitude, ranks, levels that were set and ratings of two realizations, or the share of an answer.
pub fn is_rated(protocol: &Protocol) -> bool {
    !protocol.has_other_numbers(&protocol.analysis.primary) && question(protocol, None).is_ok()
}

/// Adds hidden duplicates, and covariates from the model files.
pub fn describe_realizations(ratings: &mut Ratings, loaded: &Loaded) {
    let Loaded {
        protocol, models, ..
    } = loaded;
    ratings.set_duplicates(protocol.models.iter().filter_map(|m| {
        let original = m.duplicate_of.as_ref()?;
        Some((m.id.as_str(), original.as_str()))
    }));
    for (id, model) in models {
        let covariates = [
            ("memory_mm", model.provenance.memory_mm),
            ("lambda", model.provenance.lambda),
        ];
        for (name, value) in covariates {
            if let Some(value) = value {
                ratings.add_covariate(id.as_str(), name, value);
            }
        }
    }
}

/// The given question, or measured outcome, or the primary question, which must have numeric answers.
fn question(protocol: &Protocol, asked: Option<&str>) -> Result<QuestionId, StudyError> {
    let id = match asked {
        None => protocol.analysis.primary.clone(),
        Some(id) => QuestionId::new(id)?,
    };
    let numeric: Vec<&str> = (protocol.questions.iter())
        .filter(|q| q.kind.scale().is_number() || protocol.analysis.share_of(&q.id).is_some())
        .map(|q| q.id.as_str())
        .chain(protocol.outcomes.iter().map(|o| o.id.as_str()))
        .collect();
    if numeric.contains(&id.as_str()) {
        return Ok(id);
    }
    let numeric = numeric.join(", ");
    Err(StudyError::NotNumeric { id, numeric })
}
