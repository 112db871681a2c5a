//! Facts about the study for the report, and the report's files.

use super::super::{Failure, Kind};
use crate::report::Source;
use crate::report::csv::TableFile;
use crate::report::figures::{self, Drawn, Trace};
use crate::report::html::{self, Details};
use crate::report::picture::Picture;
use crate::report::picture::png::{Painter, PngError};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use study_base::apa;
use study_base::text::{ModelId, counted};
use study_core::analyze::Analysis;
use study_core::outcome::{ParticipantRow, RatingRow, Status};
use study_core::protocol::columns::SampleColumn;
use study_core::protocol::{Answer, Order, Protocol, Question, QuestionKind};
use study_core::store::{Derived, StudyFolder, layout};
use study_stats::describe::mean;

/// Largest number of samples that are read of a playback.
const MAX_SAMPLES: usize = 200_000;

/// Largest number of playbacks of a realization that are shown.
const MAX_TRACES: usize = 3;

/// End of the name of a figure that is one column wide.
const COLUMN: &str = "-column";

/// A file of `analysis/`.
pub(super) struct Output {
    /// Path relative to the folder.
    pub(super) name: String,
    pub(super) content: Vec<u8>,
}

impl Output {
    pub(super) fn table(table: TableFile) -> Self {
        Self {
            name: table.name.to_owned(),
            content: table.content.into_bytes(),
        }
    }
}

/// The report and the figures' files.
pub(super) fn files(
    source: &Source,
    details: &Details,
    analysis: &Analysis,
    traces: &[Trace],
) -> Result<Vec<Output>, Failure> {
    let drawn = figures::all(analysis, traces);
    let of_parts = details.parts.iter().flat_map(|part| &part.figures);
    let all: Vec<&Drawn> = drawn.iter().chain(of_parts).collect();
    let (document, figures) = rayon::join(
        || html::document(source, details, analysis, &drawn),
        || figure_files(&all),
    );
    let figures = figures?;
    let mut files = vec![Output {
        name: "report.html".to_owned(),
        content: document.into_bytes(),
    }];
    files.extend(figures);
    Ok(files)
}

/// The files of figures: pictures and data.
pub(super) fn figure_files(drawn: &[&Drawn]) -> Result<Vec<Output>, Failure> {
    let mut files = pictures(drawn).map_err(|e| Failure::new(Kind::Bug, e))?;
    files.extend(drawn.iter().map(|figure| Output {
        name: format!("figures/{}.csv", figure.name),
        content: figure.data.clone().into_bytes(),
    }));
    Ok(files)
}

/// SVG, PNG and PDF of each figure, two columns wide and one column wide. Each is drawn
/// by one thread, so the number of threads changes no byte.
fn pictures(drawn: &[&Drawn]) -> Result<Vec<Output>, PngError> {
    let painter = Painter::default();
    let figures = drawn.iter().flat_map(|d| {
        let column = format!("{}{COLUMN}", d.name);
        [(d.name.clone(), &d.wide), (column, &d.narrow)]
    });
    let figures: Vec<(String, &Picture)> = figures.collect();
    let files = figures.par_iter().with_max_len(1).map(|(name, picture)| {
        let named = |ending: &str, content| Output {
            name: format!("figures/{name}.{ending}"),
            content,
        };
        painter.png(picture).map(|png| {
            [
                named("svg", picture.to_svg().into_bytes()),
                named("png", png),
                named("pdf", picture.to_pdf()),
            ]
        })
    });
    let files: Vec<[Output; 3]> = files.collect::<Result<_, _>>()?;
    Ok(files.into_iter().flatten().collect())
}

/// Facts about the study besides its ratings.
pub(super) fn details(
    protocol: &Protocol,
    study: &StudyFolder,
    derived: &Derived,
    question: &str,
) -> Details {
    let (rows, participants) = (&derived.rows, &derived.participants);
    let asked = protocol
        .questions
        .iter()
        .find(|q| q.id.as_str() == question);
    let labels = match asked.map(|q| &q.kind) {
        Some(QuestionKind::Rating { labels, .. }) => {
            let all = labels.iter();
            all.map(|(at, l)| (*at as f64, l.clone())).collect()
        }
        _ => Vec::new(),
    };
    let some = |name: &str, value: &Option<String>| {
        let value = value.clone()?;
        Some((name.to_owned(), value))
    };
    let s = &protocol.study;
    let mut facts: Vec<(String, String)> = [
        some("ethics", &s.ethics),
        some("contact", &s.contact),
        some("funding", &s.funding),
        some("data license", &s.license),
        some("doi", &s.doi),
        some("VAF on recording", &protocol.analysis.vaf),
    ]
    .into_iter()
    .flatten()
    .collect();
    if let Some(u) = &protocol.device.uncertified {
        facts.push((
            "uncertified realizations played".to_owned(),
            u.reason.clone(),
        ));
    }
    // The devices used, which for pilots can differ from the protocol's.
    let played = rows.iter().filter(|r| r.attempt.is_some());
    let devices: BTreeSet<&str> = played.map(|r| r.device_kind.as_str()).collect();
    let devices: Vec<&str> = devices.into_iter().collect();
    let tools: BTreeSet<&str> = rows.iter().map(|r| r.tool_version.as_str()).collect();
    let manifest = study.manifest();
    let prints = &manifest.newest().fingerprints;
    Details {
        lang: protocol.text.lang.clone(),
        authors: s.authors.clone(),
        prompt: asked.map(|q| q.prompt.clone()),
        labels,
        facts,
        repetitions: Some(protocol.design.repetitions),
        order: Some(order(&protocol.design.order).to_owned()),
        sample: sample(protocol, participants),
        ethics: s.ethics.clone(),
        conduct: conduct(protocol, &devices),
        states: states(participants),
        reference: protocol.trial.reference.clone(),
        device: Some(devices.join(", ")).filter(|d| !d.is_empty()),
        seed: Some(s.seed),
        tools: tools
            .into_iter()
            .filter(|t| !t.is_empty())
            .map(str::to_owned)
            .collect(),
        parts: Vec::new(),
        damage: Vec::new(),
        fingerprints: vec![
            ("stimulus".to_owned(), prints.stimulus.clone()),
            ("wording".to_owned(), prints.wording.clone()),
            ("analysis".to_owned(), prints.analysis.clone()),
        ],
        versions: manifest
            .versions
            .iter()
            .map(|v| (v.version, v.at.to_rfc3339(), v.reason.clone()))
            .collect(),
    }
}

/// Number of participants by state; pilots and simulated ones only if there are no
/// others.
fn states(participants: &[ParticipantRow]) -> Vec<(String, usize)> {
    let mut by: BTreeMap<&str, usize> = BTreeMap::new();
    for p in described(participants) {
        *by.entry(p.state.as_str()).or_default() += 1;
    }
    by.into_iter().map(|(s, n)| (s.to_owned(), n)).collect()
}

/// The participants; pilots and simulated ones only if there are no others.
fn described(participants: &[ParticipantRow]) -> impl Iterator<Item = &ParticipantRow> {
    let real = |p: &ParticipantRow| !p.pilot && !p.simulated;
    let any = participants.iter().any(real);
    participants.iter().filter(move |p| real(p) || !any)
}

/// Most options that a sentence lists.
const MAX_OPTIONS: usize = 6;

/// A sentence for each intake question that is answered by a number or a choice.
fn sample(protocol: &Protocol, participants: &[ParticipantRow]) -> Vec<String> {
    let sentence = |question: &Question| {
        let answers: Vec<&Answer> = described(participants)
            .filter_map(|p| p.answers.get(&question.id))
            .filter(|answer| !answer.is_declined())
            .collect();
        let numbers: Vec<f64> = answers.iter().filter_map(|a| a.number()).collect();
        let unit = match &question.kind {
            QuestionKind::Number {
                unit: Some(unit), ..
            } => format!(" {unit}"),
            _ => String::new(),
        };
        let prompt = question.prompt.trim_end_matches([':', '.']);
        if let Some(mean) = mean(&numbers) {
            let low = numbers.iter().fold(f64::INFINITY, |a, b| a.min(*b));
            let high = numbers.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
            let (mean, n) = (apa::number(mean, 2), numbers.len());
            return Some(format!(
                "“{prompt}”: mean {mean}{unit}, range {low} to {high} (n = {n})."
            ));
        }
        let QuestionKind::Choice { options, .. } = &question.kind else {
            return None;
        };
        let chosen = |option: &String| {
            let by = |a: &&&Answer| matches!(a, Answer::Choice(all) if all.contains(option));
            answers.iter().filter(by).count()
        };
        let counts: Vec<String> = (options.iter())
            .map(|option| (chosen(option), option))
            .filter(|(n, _)| *n > 0)
            .map(|(n, option)| format!("{option} {n}"))
            .take(MAX_OPTIONS)
            .collect();
        (!counts.is_empty()).then(|| format!("“{prompt}”: {}.", counts.join(", ")))
    };
    protocol.intake.iter().filter_map(sentence).collect()
}

/// Sentences on the conduct of the sessions, for the methods.
fn conduct(protocol: &Protocol, devices: &[&str]) -> Vec<String> {
    let design = &protocol.design;
    let mut text = Vec::new();
    match design.max_run {
        Some(1) => text.push("No realization was presented twice in a row.".to_owned()),
        Some(n) => text.push(format!(
            "No realization was presented more than {n} times in a row."
        )),
        None => {}
    }
    match design.practice.len() {
        0 => {}
        n => text.push(format!(
            "{} preceded these and {} not analysed.",
            counted(n, "practice trial", "practice trials"),
            if n == 1 { "was" } else { "were" }
        )),
    }
    if let Some(breaks) = &design.breaks {
        text.push(format!(
            "After every {} there was a break of at least {} s.",
            counted(breaks.every as usize, "trial", "trials"),
            breaks.at_least_s
        ));
    }
    text.push(match devices {
        [] => return text,
        ["simulated"] => "The device was simulated: nobody felt a force.".to_owned(),
        kinds => format!("Kinds of device used: {}.", kinds.join(", ")),
    });
    if let Some(u) = protocol.device.uncertified.as_ref().filter(|u| u.play) {
        text.push(format!(
            "Realizations without a passivity certificate were limited to {} N.",
            u.force_n.get()
        ));
    }
    text
}

fn order(order: &Order) -> &'static str {
    match order {
        Order::Blocked => "random within blocks that hold each realization once",
        Order::Shuffled => "one random order of all trials",
        Order::Williams => "taken from a Williams design, balanced for first-order carry-over",
        Order::LatinSquare => "taken from a cyclic Latin square",
        Order::Fixed => "the same in every repetition",
        Order::File(_) => "read from a prepared file",
    }
}

/// Force against position in some included playbacks: the first of each realization by
/// up to three participants. Files that cannot be read are skipped; `study verify`
/// reports them.
pub(super) fn traces(study: &StudyFolder, rows: &[RatingRow], analysis: &Analysis) -> Vec<Trace> {
    let included: BTreeSet<(&str, &str, u32)> = analysis
        .rows
        .iter()
        .filter(|r| r.excluded.is_none())
        .map(|r| (analysis.subject(r), analysis.model(r), r.repetition))
        .collect();
    let mut shown: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut wanted = Vec::new();
    for row in rows
        .iter()
        .filter(|r| !r.practice && r.status == Status::Ok)
    {
        let Some(model) = row.model.as_ref().map(ModelId::as_str) else {
            continue;
        };
        let participant = row.participant.as_str();
        let own = shown.entry(model).or_default();
        let enough = own.len() >= MAX_TRACES || own.contains(participant);
        if enough || !included.contains(&(participant, model, row.repetition)) {
            continue;
        }
        let Some(attempt) = row.attempt else { continue };
        let path = layout::session(study.path(), &row.participant, row.session)
            .join(layout::TELEMETRY)
            .join(layout::telemetry(row.trial, attempt, 1));
        if path.is_file() {
            own.insert(participant);
            wanted.push((row, model, path));
        }
    }
    let read = wanted.par_iter().with_max_len(1).map(|(row, model, path)| {
        let (points, measured) = trace(path)?;
        Some(Trace {
            model: (*model).to_owned(),
            label: format!("{} trial {}", row.participant, row.trial),
            measured,
            points,
        })
    });
    read.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// Position (mm) and force (N) of a telemetry file, and whether the force was measured.
fn trace(path: &Path) -> Option<(Vec<(f64, f64)>, bool)> {
    let mut reader = csv::Reader::from_reader(BufReader::new(File::open(path).ok()?));
    let head = reader.headers().ok()?.clone();
    let column = |column: SampleColumn| head.iter().position(|h| h == column.name());
    let x = column(SampleColumn::XMm)?;
    let command = column(SampleColumn::ForceCommandN)?;
    let measured = column(SampleColumn::ForceMeasuredN);
    let mut points = Vec::new();
    let mut all_measured = measured.is_some();
    let mut record = csv::StringRecord::new();
    while points.len() < MAX_SAMPLES && matches!(reader.read_record(&mut record), Ok(true)) {
        let number = |at: usize| record.get(at).and_then(|t| t.parse::<f64>().ok());
        let force = measured.and_then(number);
        all_measured &= force.is_some();
        if let (Some(x), Some(force)) = (number(x), force.or_else(|| number(command))) {
            points.push((x, force));
        }
    }
    (points.len() > 1).then_some((points, all_measured))
}

/// Removes figures of an earlier analysis that this one did not write.
pub(super) fn clear_figures(dir: &Path, files: &[Output]) {
    let Ok(items) = fs::read_dir(dir.join("figures")) else {
        return;
    };
    for item in items.flatten() {
        let name = format!("figures/{}", item.file_name().to_string_lossy());
        let ending = [".svg", ".png", ".pdf", ".csv"];
        let stem = ending.iter().find_map(|e| name.strip_suffix(e));
        let stem = stem.and_then(|s| s.strip_prefix("figures/"));
        let ours = stem.is_some_and(|stem| {
            let stem = stem.strip_suffix(COLUMN).unwrap_or(stem);
            figures::NAMES.contains(&stem) || stem.starts_with(figures::PARTS_PREFIX)
        });
        if ours && !files.iter().any(|f| f.name == name) {
            // A remaining outdated figure is no reason to fail.
            let _ = fs::remove_file(item.path());
        }
    }
}
