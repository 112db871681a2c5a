//! `study check`: every fault of a protocol and of the files that it names.

use super::{Console, Failure};
use serde::Serialize;
use std::path::PathBuf;
use study_analysis::load;
use study_analysis::power;
use study_base::apa;
use study_base::diagnostic::{Findings, Severity};
use study_base::text::{ModelId, Untrusted, counted};
use study_haptics::model::Realization;
use study_haptics::safe_play::{self, Danger};
use study_plan::protocol::{DeviceKind, ModelEntry, Protocol, check};
use study_stats::power::detectable_correlation;
use study_wire::predict::Direction;

/// Arguments of `study check`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that holds one
    protocol: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    /// Show the margins of each certificate and the damping that the tables need
    #[arg(long, conflicts_with = "json")]
    verbose: bool,
}

/// The JSON document of `--json`.
#[derive(Debug, Serialize)]
struct Report<'a> {
    format: &'static str,
    ok: bool,
    errors: Vec<Item<'a>>,
    warnings: Vec<Item<'a>>,
    study: Option<&'a str>,
    models: Option<usize>,
    trials: Option<usize>,
    minutes: Option<f64>,
    fingerprints: Option<&'a study_plan::protocol::fingerprint::Fingerprints>,
    certificates: Vec<Certified<'a>>,
    /// Null without three realizations with a VAF.
    sensitivity: Option<Sensitivity>,
}

/// What the number of realizations allows.
#[derive(Debug, Serialize)]
struct Sensitivity {
    /// The smallest correlation of VAF with the true means that is found with 80 %, even
    /// with endlessly many participants.
    correlation: f64,
    /// The smallest p of the permutation test.
    smallest_p: Option<f64>,
}

impl Sensitivity {
    fn of(protocol: &Protocol) -> Option<Self> {
        let plan = power::Plan::of(protocol, &power::Overrides::default()).ok()?;
        if plan.part.is_some() {
            return None;
        }
        let (q, settings) = (plan.own.realizations, &plan.settings);
        let floor = power::floor(&settings.vaf(q), settings.alpha);
        Some(Self {
            correlation: detectable_correlation(q, 0.8, settings.alpha)?,
            smallest_p: floor.map(|f| f.smallest_p),
        })
    }

    fn in_words(&self) -> String {
        let floor = self.smallest_p.map_or(String::new(), |p| {
            format!(
                "; the smallest p of the permutation test is {}",
                apa::bare_p(p)
            )
        });
        format!(
            "power: 80 % take a correlation of {} between VAF and the true means, however many the \
             participants{floor}; see `study power`\n",
            apa::r(self.correlation)
        )
    }
}

/// The certificate of one realization. A margin that is not finite is null.
#[derive(Debug, Serialize)]
struct Certified<'a> {
    model: &'a str,
    pass: bool,
    margins: Vec<Margin>,
    negative_mass: f64,
    negative_damping: f64,
    /// Null where the spring force jumps.
    stiffness_n_per_mm: f64,
    damping_n_s_per_mm: f64,
    /// What an adversary makes of a realization that passes; null if it found nothing.
    danger: Option<String>,
}

#[derive(Debug, Serialize)]
struct Margin {
    condition: &'static str,
    unit: &'static str,
    value: f64,
    at_mm: f64,
}

#[derive(Debug, Serialize)]
struct Item<'a> {
    file: &'a str,
    line: Option<usize>,
    column: Option<usize>,
    message: &'a str,
    label: Option<&'a str>,
    hint: Option<&'a str>,
}

/// Runs `study check`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let (loaded, findings) = load::examine(&args.protocol);
    let count = |severity| findings.iter().map(|f| f.count(severity)).sum::<usize>();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let trials = loaded.as_ref().map(load::Loaded::trials);
    let minutes = loaded.as_ref().map(|l| check::minutes(&l.protocol));
    if args.json {
        let report = Report {
            format: "study-check/1",
            ok: errors == 0,
            errors: items(&findings, Severity::Error),
            warnings: items(&findings, Severity::Warning),
            study: loaded.as_ref().map(|l| l.protocol.study.id.as_str()),
            models: loaded.as_ref().map(|l| l.protocol.models.len()),
            trials,
            minutes,
            fingerprints: loaded.as_ref().map(|l| &l.fingerprints),
            certificates: loaded.as_ref().map(certified).unwrap_or_default(),
            sensitivity: loaded.as_ref().and_then(|l| Sensitivity::of(&l.protocol)),
        };
        let document = serde_json::to_string_pretty(&report)
            .map_err(|e| Failure::new(super::Kind::Bug, format!("the report: {e}")))?;
        console.document(document + "\n")?;
        // standard output holds the whole report
        return match loaded {
            Some(_) => Ok(()),
            None => Err(Failure::faults(Vec::new())),
        };
    }
    let (Some(loaded), Some(trials), Some(minutes)) = (loaded, trials, minutes) else {
        let mut failure = Failure::faults(findings);
        failure.message = match warnings {
            0 => counted(errors, "fault", "faults"),
            _ => format!(
                "{}, {}",
                counted(errors, "fault", "faults"),
                counted(warnings, "warning", "warnings")
            ),
        };
        return Err(failure);
    };
    console.findings(&findings);
    console.out(certificates(&loaded, args.verbose))?;
    if let Some(sensitivity) = Sensitivity::of(&loaded.protocol) {
        console.out(sensitivity.in_words())?;
    }
    console.out(format!(
        "{}: ok, {}, {}, about {minutes:.0} minutes, {}\n",
        loaded.protocol.study.id,
        counted(loaded.protocol.models.len(), "model", "models"),
        counted(trials, "trial", "trials"),
        counted(warnings, "warning", "warnings"),
    ))
}

/// The tables that a device plays. A sample mounted by hand has none, even if the
/// protocol names a file.
fn played(loaded: &load::Loaded) -> impl Iterator<Item = (&ModelId, &Realization)> {
    let protocol = &loaded.protocol;
    let by_hand = |m| protocol.device_of(m) == DeviceKind::Manual;
    let by_hand = move |id| protocol.model(id).is_some_and(by_hand);
    loaded.models.iter().filter(move |(id, _)| !by_hand(id))
}

fn certified(loaded: &load::Loaded) -> Vec<Certified<'_>> {
    played(loaded)
        .map(|(id, realization)| {
            let certificate = realization.certificate();
            Certified {
                model: id.as_str(),
                pass: certificate.passes(),
                margins: certificate
                    .conditions()
                    .iter()
                    .map(|(condition, margin)| Margin {
                        condition: condition.as_str(),
                        unit: condition.unit(),
                        value: margin.value,
                        at_mm: margin.at_mm,
                    })
                    .collect(),
                negative_mass: certificate.negative_mass,
                negative_damping: certificate.negative_damping,
                stiffness_n_per_mm: certificate.stiffness_n_per_mm,
                damping_n_s_per_mm: certificate.damping_n_s_per_mm,
                danger: danger(realization).map(|danger| danger.to_string()),
            }
        })
        .collect()
}

/// What is not safe about a realization that passes its certificate.
fn danger(realization: &Realization) -> Option<Danger> {
    let device = safe_play::Device::default();
    let by_sign = realization.direction == Direction::Sign;
    let chatter = || {
        by_sign
            .then(|| safe_play::chatter(realization, &device))
            .flatten()
    };
    let passes = realization.certificate().passes();
    passes
        .then(|| safe_play::refusal(realization, &device).or_else(chatter))
        .flatten()
}

/// A hand moves a handle so fast, mm/s.
const HAND_MM_S: f64 = 200.0;
/// A hand that is this many times as fast as the recordings feels what no data support.
const MUCH_FASTER: f64 = 4.0;

/// What a hand may do beyond the recordings of a realization.
fn beyond(realization: &Realization) -> Option<String> {
    let trained = realization.trained.v_mm_s;
    let factor = HAND_MM_S / trained;
    (factor > MUCH_FASTER).then(|| {
        let digits = if trained < 10.0 { 2 } else { 0 };
        format!(
            "trained up to {trained:.digits$} mm/s; a hand of {HAND_MM_S} mm/s is {factor:.0} times as fast"
        )
    })
}

/// A line for each table that is played, with its certificate and, if `verbose`, its
/// margins; notes about tables that fail theirs and about samples mounted by hand.
fn certificates(loaded: &load::Loaded, verbose: bool) -> String {
    let mut out = String::new();
    let (mut failing, mut tables) = (0, 0);
    let mut dangers = Vec::new();
    for (id, realization) in played(loaded) {
        tables += 1;
        let certificate = realization.certificate();
        failing += usize::from(!certificate.passes());
        if verbose {
            let damping = super::identify::required_damping(&certificate);
            out += &format!("{id}: {certificate}\n    {damping}\n");
        } else {
            let verdict = if certificate.passes() { "PASS" } else { "FAIL" };
            out += &format!("{id}: {verdict}\n");
        }
        let danger = danger(realization).map(|danger| danger.to_string());
        let notes = danger.into_iter().chain(beyond(realization));
        dangers.extend(notes.map(|note| format!("note: `{id}`: {note}\n")));
    }
    out += &dangers.concat();
    if let (1.., Some(permission)) = (failing, &loaded.protocol.device.uncertified) {
        out += &format!(
            "note: {failing} of {} fail their certificate; `uncertified` permits playback at up to {} N: {}\n",
            counted(tables, "table", "tables"),
            permission.force_n.get(),
            Untrusted(&permission.reason),
        );
    }
    let protocol = &loaded.protocol;
    let by_hand = |m: &&ModelEntry| protocol.device_of(m) == DeviceKind::Manual;
    let samples = protocol.models.iter().filter(by_hand).count();
    if samples > 0 {
        out += &format!(
            "note: {} mounted by hand; `study device codes {}` lists what to write on them\n",
            counted(samples, "sample is", "samples are"),
            loaded.path.display()
        );
    }
    out
}

fn items(findings: &[Findings], severity: Severity) -> Vec<Item<'_>> {
    findings
        .iter()
        .flat_map(|f| f.faults.iter().map(move |fault| (f, fault)))
        .filter(|(_, fault)| fault.severity == severity)
        .map(|(f, fault)| {
            let place = fault
                .span
                .as_ref()
                .filter(|_| !f.text.is_empty())
                .map(|span| f.line_and_column(span.start));
            Item {
                file: &f.path,
                line: place.map(|(line, _)| line),
                column: place.map(|(_, column)| column),
                message: &fault.message,
                label: fault.label.as_deref(),
                hint: fault.hint.as_deref(),
            }
        })
        .collect()
}
