//! Findings, uses and verdicts.

use serde::Serialize;

/// What a computer can be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Use {
    /// Sessions with samples that are mounted by hand, or with a controller program.
    Hand,
    /// Sessions with a device on a serial port or an address.
    Serial,
    /// The participant's page on a tablet.
    Tablet,
    /// Rehearsals and analyses, without anybody at the terminal.
    Unattended,
}

impl Use {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Hand, Self::Serial, Self::Tablet, Self::Unattended];
    /// Those with a participant.
    pub const SESSIONS: [Self; 3] = [Self::Hand, Self::Serial, Self::Tablet];

    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Hand => "manual or process devices",
            Self::Serial => "serial device",
            Self::Tablet => "page on a tablet",
            Self::Unattended => "unattended rehearsal and analysis",
        }
    }
}

/// How fit something is, from best to worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Nothing speaks against it.
    Fit,
    /// It can be used, and something should be better.
    WithLimits,
    /// Nothing is known.
    NotMeasured,
    /// It should not be used.
    NotFit,
}

impl Fit {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fit => "fit",
            Self::WithLimits => "fit with limits",
            Self::NotMeasured => "not measured",
            Self::NotFit => "NOT FIT",
        }
    }
}

/// What a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum About {
    /// Processors, priority and lateness.
    Computer,
    /// The disk of the results.
    Disk,
    /// The terminal.
    Terminal,
    /// The participant's page.
    Page,
    /// The device.
    Device,
}

impl About {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Computer => "computer",
            Self::Disk => "disk",
            Self::Terminal => "terminal",
            Self::Page => "page",
            Self::Device => "device",
        }
    }
}

/// One thing that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub about: About,
    /// A name that stays the same, such as `heartbeat`.
    pub id: &'static str,
    /// What it means for the uses that it concerns.
    pub fit: Fit,
    /// The uses that it concerns.
    pub uses: Vec<Use>,
    /// A sentence with the numbers.
    pub says: String,
    /// What to do.
    pub advice: Option<String>,
}

impl Finding {
    /// Something that concerns these uses.
    pub(super) fn new(
        about: About,
        id: &'static str,
        uses: &[Use],
        fit: Fit,
        says: String,
    ) -> Self {
        Self {
            about,
            id,
            fit,
            uses: uses.to_vec(),
            says,
            advice: None,
        }
    }

    /// The same with what to do about it, unless it is fit.
    pub(super) fn advice(mut self, advice: impl Into<String>) -> Self {
        if self.fit != Fit::Fit {
            self.advice = Some(advice.into());
        }
        self
    }
}

/// A verdict for a use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The use.
    #[serde(rename = "use")]
    pub purpose: Use,
    /// The worst of the findings that concern it.
    pub fit: Fit,
    /// The names of the findings to which that is due.
    pub because: Vec<&'static str>,
}

impl Verdict {
    /// The worst of the findings decides.
    pub(super) fn of(purpose: Use, findings: &[Finding]) -> Self {
        let concern = findings.iter().filter(|f| f.uses.contains(&purpose));
        let fit = concern.clone().map(|f| f.fit).max().unwrap_or(Fit::Fit);
        let because = match fit {
            Fit::Fit => Vec::new(),
            fit => concern.filter(|f| f.fit == fit).map(|f| f.id).collect(),
        };
        Self {
            purpose,
            fit,
            because,
        }
    }
}

/// A time for people: as many digits as matter.
pub(super) fn ms(time_ms: f64) -> String {
    match time_ms {
        t if t < 10.0 => format!("{t:.2} ms"),
        t if t < 100.0 => format!("{t:.1} ms"),
        t if t < 10_000.0 => format!("{t:.0} ms"),
        t => format!("{:.1} s", t / 1e3),
    }
}

/// A size for people.
pub(super) fn size(bytes: u64) -> String {
    match bytes {
        b if b < 1 << 20 => format!("{} KiB", b >> 10),
        b if b < 1 << 30 => format!("{} MiB", b >> 20),
        b => format!("{:.1} GiB", b as f64 / f64::from(1 << 30)),
    }
}
