//! What `study check` says of a protocol and of the files that it names.
//!
//! ```
//! use study_analysis::check::Checked;
//!
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../protocols/turn-signal");
//! let checked = Checked::open(folder.as_ref());
//! let report = checked.report();
//! assert!(report.ok);
//! assert_eq!((report.models, report.trials), (Some(5), Some(15)));
//! // As in the paper, no table passes its certificate.
//! assert!(report.certificates.iter().all(|certified| !certified.pass));
//! ```

use crate::load::{self, Loaded};
use crate::power::{self, Overrides, Plan};
use serde::Serialize;
use std::path::Path;
use study_base::diagnostic::{Findings, Severity};
use study_base::text::ModelId;
use study_haptics::model::Realization;
use study_haptics::safe_play::{self, Danger};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{DeviceKind, Protocol, check};
use study_stats::power::detectable_correlation;
use study_wire::certificate::Certificate;
use study_wire::predict::Direction;

/// A protocol with everything that was found in its files.
#[derive(Debug)]
pub struct Checked {
    /// The protocol; `None` with an error.
    pub loaded: Option<Loaded>,
    /// All errors and warnings.
    pub findings: Vec<Findings>,
}

/// The document `study-check/1`.
#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "the keys say what they are")]
pub struct Report<'a> {
    pub format: &'static str,
    /// Whether there are no errors.
    pub ok: bool,
    pub errors: Vec<Item<'a>>,
    pub warnings: Vec<Item<'a>>,
    pub study: Option<&'a str>,
    /// Number of realizations.
    pub models: Option<usize>,
    /// Number of trials of a session, including practice.
    pub trials: Option<usize>,
    /// Estimated duration of a session.
    pub minutes: Option<f64>,
    pub fingerprints: Option<&'a Fingerprints>,
    pub certificates: Vec<Certified<'a>>,
    /// Null without three realizations with a VAF.
    pub sensitivity: Option<Sensitivity>,
}

/// What the number of realizations allows.
#[derive(Debug, Serialize)]
pub struct Sensitivity {
    /// The smallest correlation of VAF with the true means that is found with 80 %, even
    /// with endlessly many participants.
    pub correlation: f64,
    /// The smallest p of the permutation test.
    pub smallest_p: Option<f64>,
}

/// The certificate of one realization. A margin that is not finite is null.
#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "the keys say what they are")]
pub struct Certified<'a> {
    pub model: &'a ModelId,
    pub pass: bool,
    pub margins: Vec<Margin>,
    pub negative_mass: f64,
    pub negative_damping: f64,
    /// Null where the spring force jumps.
    pub stiffness_n_per_mm: f64,
    pub damping_n_s_per_mm: f64,
    /// What an adversary makes of a realization that passes; null if it found nothing.
    pub danger: Option<String>,
    /// The certificate itself.
    #[serde(skip)]
    pub certificate: Certificate,
    /// What a hand may do beyond the recordings of the realization, where it is held.
    pub beyond: Vec<String>,
    /// Whether its file says where the recordings went.
    pub has_coverage: bool,
}

/// A margin of a certificate.
#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "the keys say what they are")]
pub struct Margin {
    pub condition: &'static str,
    pub unit: &'static str,
    pub value: f64,
    pub at_mm: f64,
}

/// An error or a warning with its place.
#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "the keys say what they are")]
pub struct Item<'a> {
    pub file: &'a str,
    pub line: Option<usize>,
    pub column: Option<usize>,
    pub message: &'a str,
    pub label: Option<&'a str>,
    pub hint: Option<&'a str>,
}

impl Checked {
    /// Reads the protocol at `path`, a `protocol.toml` or the folder that contains one.
    pub fn open(path: &Path) -> Self {
        let (loaded, findings) = load::examine(path);
        Self { loaded, findings }
    }

    /// Number of findings of a severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().map(|f| f.count(severity)).sum()
    }

    /// Everything in one document.
    pub fn report(&self) -> Report<'_> {
        let loaded = self.loaded.as_ref();
        Report {
            format: "study-check/1",
            ok: self.count(Severity::Error) == 0,
            errors: items(&self.findings, Severity::Error),
            warnings: items(&self.findings, Severity::Warning),
            study: loaded.map(|l| l.protocol.study.id.as_str()),
            models: loaded.map(|l| l.protocol.models.len()),
            trials: loaded.map(Loaded::trials),
            minutes: loaded.map(|l| check::minutes(&l.protocol)),
            fingerprints: loaded.map(|l| &l.fingerprints),
            certificates: loaded.map(certified).unwrap_or_default(),
            sensitivity: loaded.and_then(|l| Sensitivity::of(&l.protocol)),
        }
    }
}

impl Sensitivity {
    fn of(protocol: &Protocol) -> Option<Self> {
        let plan = Plan::of(protocol, &Overrides::default()).ok()?;
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
}

/// The tables that a device plays. A sample mounted by hand has none, even if the
/// protocol names a file.
fn certified(loaded: &Loaded) -> Vec<Certified<'_>> {
    let protocol = &loaded.protocol;
    let by_hand = |m| protocol.device_of(m) == DeviceKind::Manual;
    let by_hand = |id| protocol.model(id).is_some_and(by_hand);
    let played = loaded.models.iter().filter(|(id, _)| !by_hand(id));
    played
        .map(|(id, realization)| {
            let certificate = realization.certificate();
            Certified {
                model: id,
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
                danger: danger(realization).map(|danger| stated(realization, danger)),
                certificate,
                beyond: beyond(realization),
                has_coverage: realization.provenance.coverage.is_some(),
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

/// A danger; chatter with what a reversal draws at most.
fn stated(realization: &Realization, danger: Danger) -> String {
    let reversal = safe_play::reversal(realization, &safe_play::Device::default());
    match (danger, reversal) {
        (Danger::Chatter { .. }, Some(reversal)) => format!(
            "{danger}; a reversal draws at most {:.3} mJ, and nothing above {:.0} mm/s",
            reversal.most_mj, reversal.up_to_mm_s
        ),
        _ => danger.to_string(),
    }
}

/// A hand moves a handle so fast, mm/s.
const HAND_MM_S: f64 = 200.0;
/// A hand that is this many times as fast as the recordings feels what no data support.
const MUCH_FASTER: f64 = 4.0;

/// What a hand may do beyond the recordings of a realization.
fn beyond(realization: &Realization) -> Vec<String> {
    let mut found = Vec::new();
    let trained = realization.trained.v_mm_s;
    let factor = HAND_MM_S / trained;
    if factor > MUCH_FASTER {
        let digits = if trained < 10.0 { 2 } else { 0 };
        found.push(format!(
            "trained up to {trained:.digits$} mm/s; a hand of {HAND_MM_S} mm/s is {factor:.0} times as fast"
        ));
    }
    let Some(coverage) = &realization.provenance.coverage else {
        return found;
    };
    let stretches = |held: &[[f64; 2]]| {
        let each = held
            .iter()
            .map(|[from, to]| format!("{from:.2} to {to:.2} mm"));
        each.collect::<Vec<_>>().join(", ")
    };
    if !coverage.held_mm.is_empty() {
        found.push(format!(
            "held where no recording went: {}",
            stretches(&coverage.held_mm)
        ));
    }
    if coverage.partial_strokes == 0 {
        found.push(
            "trained on full strokes only: nothing says what it is where a hand turns back"
                .to_owned(),
        );
    }
    found
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
