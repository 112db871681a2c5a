//! Identification as `study identify` does it: recordings are read and checked, the estimators
//! identified, the best realization selected or recommended and validated, and the model files
//! written as text.
//!
//! [`Source::read`] reads a recording, [`run`] identifies, [`Identification::model_files`] has the
//! files. What is remarkable on the way is handed to `say`, a sentence at a time.

mod error;

pub use error::IdentificationError;

use super::compare::{self, Candidate, Comparison, Failure};
use super::coverage;
use super::elsewhere::{self, Elsewhere, Stated};
use super::evidence::lag;
use super::features;
use super::grid::{self, Cell};
use super::method::{Claim, Options, Progress};
use super::perceptual::{Reference, Weights};
use super::signal::{self, Acceleration, Excitation, filter};
use super::validation::{self, Ceiling, Validation};
use super::{IdentifyError, Training};
use crate::model::{Realization, Units, file};
use crate::recording::{self, Names, Recording};
use std::io::BufRead;
use study_base::text::{ModelId, Untrusted};
use study_wire::predict::Lookup;

/// Ranges from the origin at which cold recursions lose more than two digits.
const FAR: f64 = 100.0;

/// What is asked of an identification.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The estimators.
    pub options: Options,
    /// Look-up of parameters between nodes.
    pub lookup: Lookup,
    /// How signals are prepared.
    pub signals: signal::Settings,
    /// Whether most samples of dwells are removed from the training recordings.
    pub thin: bool,
    /// Whether spikes are replaced.
    pub robust: bool,
    /// Whether a target that supplies energy is accepted.
    pub active: bool,
    /// Units of the model files and the lever arm, mm, of a turning handle.
    pub turned: Option<(Units, f64)>,
    /// Whether model files say nothing of the coverage by the recordings, which release 0.1 reads.
    pub without_coverage: bool,
    /// Mass and damping that the experimenter states.
    pub stated: Stated,
    /// How much each component of an error counts in a comparison of estimators, if not alike.
    pub weights: Option<Weights>,
}

impl Default for Request {
    /// All estimators are compared on the recordings as they are.
    fn default() -> Self {
        Self {
            options: Options::default(),
            lookup: Lookup::Linear,
            signals: signal::Settings {
                filter_hz: None,
                acceleration: Acceleration::Accelerometer,
            },
            thin: false,
            robust: false,
            active: false,
            turned: None,
            without_coverage: false,
            stated: Stated::default(),
            weights: None,
        }
    }
}

/// A recording and where it is from.
#[derive(Debug, Clone)]
pub struct Source {
    /// The recording, whose name is that in model files.
    pub recording: Recording,
    /// How messages name it, such as its path. Untrusted.
    pub path: String,
}

/// The recordings of an identification.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    /// From which realizations are identified; at least one.
    pub training: Vec<Source>,
    /// From which mass and damping are identified, beside the force by position of `training`.
    pub dynamic: Vec<Source>,
    /// On which one is selected.
    pub validate: Vec<Source>,
    /// On which its VAF is reported.
    pub test: Vec<Source>,
    /// Repetitions of the trajectories of `validate` and `test`.
    pub repeat: Vec<Source>,
}

impl Source {
    /// Reads a recording, checks it and prepares its signals.
    ///
    /// # Errors
    /// [`IdentificationError`] if it cannot be read, supplies energy, or has signals that cannot be
    /// prepared.
    pub fn read(
        (name, path): (&str, &str),
        input: impl BufRead,
        names: &Names,
        request: &Request,
        mut say: impl FnMut(String),
    ) -> Result<Self, IdentificationError> {
        let path = path.to_owned();
        let mut recording = match recording::read_as(name, input, names) {
            Ok(recording) => recording,
            Err(error) => return Err(IdentificationError::Unreadable(path, error)),
        };
        for warning in &recording.warnings {
            say(format!("warning: {path}: {warning}"));
        }
        if let Some(how) = recording.quasi_static() {
            say(format!("{path}: {}", Untrusted(how)));
        }
        if request.robust {
            let replaced = recording.without_spikes();
            let plural = if replaced == 1 { "" } else { "s" };
            say(format!("{path}: {replaced} spike{plural} replaced"));
        }
        // swapped columns, which are warned of, have the opposite energy as well
        let swapped = |w: &recording::Warning| matches!(w, recording::Warning::Swapped { .. });
        let swapped = recording.warnings.iter().any(swapped);
        if let Some(energy) = recording.energy()
            && energy.negative
            && !request.active
            && !swapped
        {
            let spikes = !request.robust && recording.spikes_make_it_active();
            return Err(IdentificationError::Active {
                path,
                energy,
                spikes,
            });
        }
        if let Some((even, how)) = signal::evened(&recording)
            && request.needs_even_samples()
        {
            say(format!("{path}: {how}"));
            recording = even;
        }
        match signal::prepare(recording, request.signals) {
            Ok(recording) => Ok(Self { recording, path }),
            Err(error) => Err(IdentificationError::Signal(path, error)),
        }
    }
}

impl Request {
    /// Of mass and damping, whether it may be from elsewhere.
    fn elsewhere(&self, dynamic: &[Source]) -> [bool; 2] {
        (self.stated.both()).map(|stated| stated.is_some() || !dynamic.is_empty())
    }

    /// Whether a filter, a difference or a simulation needs even intervals.
    fn needs_even_samples(&self) -> bool {
        let simulates = |methods: Vec<super::Method>| methods.iter().any(|m| m.simulates());
        self.signals.filter_hz.is_some()
            || self.signals.acceleration == Acceleration::Encoder
            || self.options.compares()
            || self.options.methods().is_ok_and(simulates)
    }

    /// How the signals were filtered, for the table and model files: VAF depends on it.
    fn filter_description(&self, training: &Recording) -> String {
        let filter = self.signals.filter_hz.map(filter::description);
        let mut text = match (filter, training.filter()) {
            (Some(filter), None) => filter,
            (Some(filter), Some(before)) => format!("{filter}; before that {before}"),
            (None, Some(recorded)) => format!("as recorded: {recorded}"),
            (None, None) => "as recorded".to_owned(),
        };
        if self.signals.acceleration == Acceleration::Encoder {
            text += ", acceleration from the encoder";
        }
        if self.thin {
            text += ", dwells thinned";
        }
        text
    }
}

/// What was identified.
#[derive(Debug)]
pub struct Identification {
    /// The training recordings.
    pub training: Vec<Source>,
    /// The dynamic recordings.
    pub dynamic: Vec<Source>,
    /// Those on which a realization was selected, then those on which its VAF is reported.
    pub recordings: Vec<Source>,
    /// How many of `recordings` a realization was selected on.
    pub validations: usize,
    /// The realizations; where estimators were compared, only the recommended one.
    pub cells: Vec<Cell>,
    /// The selected one of `cells`.
    pub best: Option<usize>,
    /// The comparison of estimators, where there was one.
    pub comparison: Option<Comparison>,
    /// The accuracy of the best cell on each of `recordings`.
    pub accuracies: Vec<Option<Validation>>,
    /// The ceiling of VAF on each of `recordings` that has a repetition.
    pub ceilings: Vec<Option<Ceiling>>,
    /// Units of the model files and the lever arm, mm, of a turning handle.
    pub turned: Option<(Units, f64)>,
    /// How the best cell fails.
    pub failed: Option<Failure>,
    /// How much each component of an error counts, if that was asked for.
    pub weights: Option<Weights>,
    /// Whether an estimator was asked for, and not a comparison or the default.
    asked: bool,
    several_deltas: bool,
    /// What was subtracted from x, mm, and from F, N.
    offset: [f64; 2],
}

/// Identifies realizations. `cell_done` and `step` are called after each cell and after each step of
/// a simulation, from any thread.
///
/// # Errors
/// [`IdentificationError`] if the request or the recordings are not sound.
pub fn run(
    request: &Request,
    sources: Sources,
    mut say: impl FnMut(String),
    cell_done: impl Fn() + Sync,
    step: impl Fn(Progress) + Sync,
) -> Result<Identification, IdentificationError> {
    let Sources {
        mut training,
        mut dynamic,
        validate,
        test,
        mut repeat,
    } = sources;
    let validations = validate.len();
    let mut recordings: Vec<Source> = validate.into_iter().chain(test).collect();
    let first = &training[0].recording;
    let plan = request.options.plan(first.scale_mm())?;
    let offset = [offset(first.range_mm()), offset(first.range_n())];
    let all = (training.iter_mut())
        .chain(&mut dynamic)
        .chain(&mut recordings)
        .chain(&mut repeat);
    for Source { recording, .. } in all {
        recording.x_mm.iter_mut().for_each(|x| *x -= offset[0]);
        recording.f_n.iter_mut().for_each(|f| *f -= offset[1]);
    }
    let [offset_mm, offset_n] = offset;
    if offset_mm != 0.0 {
        say(format!(
            "x is far from its origin, which costs digits: identified at x - {offset_mm} mm; model files have the positions of the recording"
        ));
    }
    if offset_n != 0.0 {
        say(format!(
            "warning: F is far from 0, which costs digits: identified at F - {offset_n} N; model files have the forces of the recording, so subtract the offset of the sensor before you play them"
        ));
    }
    let all = training.iter().chain(&dynamic);
    check_distinct(all.chain(&recordings).chain(&repeat))?;
    request.options.allow(request.elsewhere(&dynamic))?;
    for Source { recording, path } in &mut training {
        if request.thin {
            let (thinned, removed) = signal::thin(recording);
            say(format!("{removed} samples of dwells removed from {path}"));
            *recording = thinned;
        }
        if let Some(warning) = Excitation::of(recording).warning() {
            say(format!("warning: {path}: {warning}"));
        }
    }
    for Source { recording, path } in training.iter().chain(&dynamic) {
        if let Some(lag) = lag::of(recording) {
            say(format!("warning: {path}: {lag}"));
        }
    }
    let ceilings = ceilings(&recordings, &repeat)?;
    let compares = request.options.compares();
    if validations == 0 && !compares && plan.methods.len() * plan.dx_mm.len() > 1 {
        return Err(IdentificationError::NoValidation);
    }

    let scored: Vec<&Recording> = recordings.iter().map(|s| &s.recording).collect();
    let trained: Vec<&Recording> = training.iter().map(|s| &s.recording).collect();
    let fast: Vec<&Recording> = dynamic.iter().map(|s| &s.recording).collect();
    let identify = || -> Result<(Vec<Cell>, Option<Comparison>, Elsewhere), IdentifyError> {
        let mut training = Training::of(&trained)?;
        let mut elsewhere = Elsewhere::default();
        if request.elsewhere(&dynamic) != [false; 2] {
            let (range_mm, said) = (training.range_mm(), training.evidence());
            elsewhere = Elsewhere::of(&fast, request.stated, range_mm, said)?;
            training = training.with_elsewhere(elsewhere.clone());
        }
        if compares {
            let weights = request.weights.as_ref();
            let comparison =
                compare::run_weighed(&training, request.lookup, &scored, weights, step)?;
            let cells = comparison.best().map(|best| best.cell.clone());
            return Ok((cells.into_iter().collect(), Some(comparison), elsewhere));
        }
        let lookup = request.lookup;
        grid::run_in_steps(&training, &plan, lookup, &scored, cell_done, step)
            .map(|cells| (cells, None, elsewhere))
    };
    let (mut cells, comparison, elsewhere) = identify().map_err(|error| {
        let at_fault = dynamic.first().filter(|_| error.is_of_dynamic());
        let path = &at_fault.unwrap_or(&training[0]).path;
        IdentificationError::Estimator(path.clone(), error)
    })?;
    let others = training.iter().skip(1).chain(&dynamic).chain(&recordings);
    warn_about_filters(&training[0].recording, others, &mut say);
    let filter = request.filter_description(&training[0].recording);
    for cell in &mut cells {
        let from_dynamic = elsewhere::is_from_dynamic(&cell.terms);
        let also = elsewhere.dynamic().iter().filter(|_| from_dynamic);
        let went: Vec<&Recording> = trained.iter().copied().chain(also).collect();
        let covered = coverage::of(&cell.realization, &went);
        let provenance = &mut cell.realization.provenance;
        provenance.filter = Some(filter.clone());
        provenance.note = elsewhere::note(provenance.note.take(), &cell.terms, &fast);
        let hashes = fast.iter().map(|r| (r.name.clone(), r.sha256.clone()));
        provenance.recordings.extend(hashes);
        if !request.without_coverage {
            provenance.coverage = Some(covered);
            provenance.terms = coverage::determined(&cell.terms);
            provenance.note = coverage::note(provenance.note.take(), &cell.warnings);
        }
    }
    let detents = validation::detents(&training[0].recording);
    let best = grid::best(&cells, validations);
    let failed = match &comparison {
        Some(comparison) => comparison.best().and_then(Candidate::failure),
        None => best.and_then(|best| compare::failure(&cells[best])),
    };
    let accuracies = scored
        .iter()
        .map(|recording| {
            let realization = &cells.get(best?)?.realization;
            validation::validate(realization, recording, &detents)
        })
        .collect();
    if request.options.method.is_some()
        && let Some(cell) = best.map(|best| &cells[best])
        && cell.method.claim() == Claim::Passive
        && !scored.is_empty()
    {
        let training = Training::of(&trained)
            .map_err(|error| IdentificationError::Estimator(training[0].path.clone(), error))?;
        let beaten = compare::beaten_by(&training, cell, request.lookup, &scored);
        if let Some((method, ratio)) = beaten {
            say(format!(
                "warning: the residual of {} is {ratio:.1} times that of {}: without --method the methods are compared",
                cell.method.as_str(),
                method.as_str(),
            ));
        }
    }
    let narrow = best.and_then(|best| features::narrower(&trained, &cells[best].realization));
    if let Some((warning, best)) = narrow.zip(best) {
        cells[best].warnings.push(warning);
    }
    let mut found = Identification {
        training,
        dynamic,
        recordings,
        validations,
        cells,
        best,
        comparison,
        accuracies,
        ceilings,
        turned: request.turned,
        failed,
        weights: request.weights.clone(),
        asked: request.options.method.is_some(),
        several_deltas: request.options.delta_mm.len() > 1,
        offset,
    };
    if let Some((failed, best)) = failed.zip(best).filter(|_| !found.is_baseline()) {
        let provenance = &mut found.cells[best].realization.provenance;
        let note = provenance.note.take().unwrap_or_default();
        provenance.note = Some(format!("failed: {failed}; {note}"));
    }
    Ok(found)
}

impl Identification {
    /// The recording whose VAF is to be reported: the first of the test, or the first of the
    /// validation without one, or that of the training.
    pub fn reported(&self) -> &Recording {
        let test = self.recordings.get(self.validations);
        let found = test.or(self.recordings.first());
        &found.unwrap_or(&self.training[0]).recording
    }

    /// The perceptual VAF of a realization on each of `recordings`; nothing without weights.
    pub fn perceptual_vaf(&self, realization: &Realization) -> Vec<Option<f64>> {
        let Some(weights) = &self.weights else {
            return Vec::new();
        };
        (self.recordings.iter())
            .map(|source| Reference::of(&source.recording)?.vaf(realization, weights))
            .collect()
    }

    /// Whether the best cell is a baseline that was asked for, with which others are compared.
    fn is_baseline(&self) -> bool {
        let claim = |best: usize| self.cells[best].method.claim();
        self.asked && self.best.map(claim) == Some(Claim::Baseline)
    }

    /// Whether every estimator that was compared fails.
    pub fn all_fail(&self) -> bool {
        (self.comparison.as_ref()).is_some_and(|c| c.recommended.is_none())
    }

    /// Whether what was asked for fails, so that there is nothing to use.
    pub fn is_failure(&self) -> bool {
        self.failed.is_some() && (self.all_fail() || (self.asked && !self.is_baseline()))
    }

    /// What failed and how, in a few words.
    pub fn failure(&self) -> Option<String> {
        let method = self.best.map(|best| self.cells[best].method)?;
        self.failed
            .map(|failed| format!("{} failed: {failed}", method.as_str()))
    }

    /// Gives every cell its id; returns ids and model files. The template has `{lambda}`, `{dx}` and
    /// `{delta}`.
    ///
    /// # Errors
    /// [`IdentificationError`] if an id is not possible or occurs twice.
    pub fn model_files(
        &mut self,
        template: Option<&str>,
    ) -> Result<Vec<(ModelId, String)>, IdentificationError> {
        let [offset_mm, offset_n] = self.offset;
        let several = self.several_deltas;
        let mut files: Vec<(ModelId, String)> = Vec::new();
        for cell in &mut self.cells {
            let number = |n: Option<f64>| n.map_or(String::new(), |n| n.to_string());
            let provenance = &cell.realization.provenance;
            let template = match template {
                Some(template) => template.to_owned(),
                None => cell.method.id_template(several),
            };
            let id = template
                .replace("{lambda}", &number(provenance.lambda))
                .replace("{dx}", &number(provenance.dx_mm))
                .replace("{delta}", &number(cell.realization.direction.delta_mm()));
            let id = ModelId::new(id).map_err(|e| IdentificationError::Id(e.to_string()))?;
            if files.iter().any(|(other, _)| other.collides_with(&id)) {
                return Err(IdentificationError::SameId(id));
            }
            cell.realization.id = id.to_string();
            let mut written = cell.realization.clone();
            written.shift(offset_mm);
            written.raise(offset_n);
            if let Some((units, lever_mm)) = self.turned {
                written = written.turned(units, lever_mm);
            }
            files.push((id, file::write(&written)));
        }
        Ok(files)
    }
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

/// The ceiling of VAF on each recording, from the repetitions.
fn ceilings(
    recordings: &[Source],
    repeats: &[Source],
) -> Result<Vec<Option<Ceiling>>, IdentificationError> {
    let mut ceilings = vec![None; recordings.len()];
    for repeat in repeats {
        let nearest = recordings
            .iter()
            .enumerate()
            .filter_map(|(i, r)| Some((i, validation::ceiling(&r.recording, &repeat.recording)?)))
            .min_by(|a, b| a.1.apart_mm.total_cmp(&b.1.apart_mm));
        let Some((i, ceiling)) = nearest else {
            return Err(IdentificationError::NoRepetition(repeat.path.clone()));
        };
        ceilings[i] = Some(ceiling);
    }
    Ok(ceilings)
}

/// Warns if a recording was filtered differently from the training recording, which
/// distorts its VAF.
fn warn_about_filters<'a>(
    training: &Recording,
    recordings: impl Iterator<Item = &'a Source>,
    say: &mut impl FnMut(String),
) {
    let filter = |r: &Recording| Untrusted(r.filter().unwrap_or("unknown")).to_string();
    for Source { recording, path } in recordings {
        if recording.filter() != training.filter() {
            say(format!(
                "warning: {path}: the filter ({}) differs from that of the training recording ({})",
                filter(recording),
                filter(training),
            ));
        }
    }
}

/// Rejects recordings with the same bytes, which are not independent, and recordings
/// with the same name, which would be one entry of a model file.
fn check_distinct<'a>(all: impl Iterator<Item = &'a Source>) -> Result<(), IdentificationError> {
    let all: Vec<&Source> = all.collect();
    for (i, source) in all.iter().enumerate() {
        for before in &all[..i] {
            let (one, other) = (&source.recording, &before.recording);
            if one.sha256 == other.sha256 {
                let (first, second) = (before.path.clone(), source.path.clone());
                return Err(IdentificationError::Same(first, second));
            }
            if one.name == other.name {
                return Err(IdentificationError::SameName {
                    name: one.name.clone(),
                    first: before.path.clone(),
                    second: source.path.clone(),
                });
            }
        }
    }
    Ok(())
}
