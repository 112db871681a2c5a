//! `stimulus.toml`: what a bundle says of itself, one fact a line, in one form only.

use super::feel::Feel;
use super::{FORMAT, Kept, Stated};
use crate::model::coverage::Origin;
use crate::model::file::quoted;
use crate::model::{Realization, Units};
use std::fmt::Write as _;

/// The lever arm at which the certificate of a turning handle is stated, mm: its conditions do not
/// depend on it.
const LEVER_MM: f64 = 100.0;
/// Share by which a computed number may differ on another machine.
const ROUNDING: f64 = 1e-9;

/// A fact: its section, its key and its value as TOML. Untrusted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fact {
    /// Such as `certificate`, or `recordings 1`; empty at the top.
    pub section: String,
    /// Such as `passes`.
    pub key: String,
    /// Such as `true`.
    pub value: String,
}

impl Fact {
    /// Whether both say the same but for rounding.
    pub(super) fn agrees(&self, other: &Self) -> bool {
        let numbers = |text: &str| -> Option<Vec<f64>> {
            let list = text.trim_start_matches('[').trim_end_matches(']');
            list.split(", ").map(|n| n.parse().ok()).collect()
        };
        let near = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= ROUNDING * a.abs().max(1.0);
        let same = self.value == other.value
            || match (numbers(&self.value), numbers(&other.value)) {
                (Some(a), Some(b)) => a.len() == b.len() && a.iter().zip(&b).all(near),
                _ => false,
            };
        same && (&self.section, &self.key) == (&other.section, &other.key)
    }

    /// Section and key, for messages and for pairing facts of two bundles.
    pub fn name(&self) -> String {
        match self.section.as_str() {
            "" => self.key.clone(),
            section => format!("{section}: {}", self.key),
        }
    }
}

/// All facts of a bundle.
pub(super) fn of(
    model_sha256: &str,
    realization: &Realization,
    stated: &Stated,
    recordings: &[Kept],
) -> Vec<Fact> {
    let r = realization;
    let mut facts = Vec::new();
    let mut section = String::new();
    let mut put = |section: &str, key: String, value: String| {
        facts.push(Fact {
            section: section.to_owned(),
            key,
            value,
        });
    };
    let number = |n: f64| format!("{n:?}");
    let list = |n: [f64; 2]| format!("[{:?}, {:?}]", n[0], n[1]);
    let [x, f] = r.units.names();
    let top = [
        ("format", FORMAT),
        ("id", &r.id),
        ("fingerprint", model_sha256),
    ];
    for (key, text) in top.into_iter().chain(stated.named()) {
        put("", key.to_owned(), quoted(text));
    }
    put(
        "",
        "units".to_owned(),
        format!("{{ x = \"{x}\", f = \"{f}\" }}"),
    );

    let own = |key: &str| r.units.key(key);
    let feel = Feel::of(r);
    for (key, value) in [
        ("peak_n", feel.peak),
        ("travel_mm", feel.travel),
        ("tactility_n", feel.tactility),
        ("tactility_share", feel.tactility_share),
    ] {
        put("feel", own(key), number(value));
    }
    put("coverage", own("x_mm"), list(r.trained.x_mm));
    put("coverage", own("v_mm_s"), number(r.trained.v_mm_s));
    // What is not from the recordings of the force by position is told apart.
    let terms = r.provenance.terms.iter();
    for (name, term) in terms.filter(|(_, term)| term.origin != Origin::Training) {
        put("terms", own(name), quoted(term.origin.as_str()));
    }
    for (name, vaf) in &r.vaf {
        put("validation", quoted(name), number(*vaf));
    }

    let turns = r.units != Units::Linear;
    let certificate = match turns {
        true => r.clone().at_lever(LEVER_MM).certificate(),
        false => r.certificate(),
    };
    put("certificate", "model".to_owned(), quoted(model_sha256));
    put(
        "certificate",
        "passes".to_owned(),
        certificate.passes().to_string(),
    );
    if turns {
        put("certificate", "lever_mm".to_owned(), number(LEVER_MM));
    }
    for (condition, margin) in certificate.conditions() {
        let key = format!("{}_margin_at_mm", condition.as_str());
        put("certificate", key, list([margin.value, margin.at_mm]));
    }
    for (key, value) in [
        ("stiffness_n_per_mm", certificate.stiffness_n_per_mm),
        ("damping_n_s_per_mm", certificate.damping_n_s_per_mm),
        ("mass_kg", certificate.mass_kg),
    ] {
        put("certificate", key.to_owned(), number(value));
    }

    for (i, kept) in recordings.iter().enumerate() {
        section.clear();
        let _ = write!(section, "recordings {}", i + 1);
        let recording = &kept.recording;
        let mut put = |key: &str, value| put(&section, key.to_owned(), value);
        put("name", quoted(&recording.name));
        put("use", quoted(kept.purpose.as_str()));
        put("file", quoted(&super::path(i)));
        put("sha256", quoted(&recording.sha256));
        put("rows", recording.len().to_string());
        put("duration_s", number(recording.duration_s()));
        put("x_mm", list(recording.range_mm()));
        put("f_n", list(recording.range_n()));
        put("v_mm_s", number(recording.top_speed_mm_s()));
    }
    facts
}

/// The text of `stimulus.toml`.
pub(super) fn write(facts: &[Fact]) -> String {
    let mut out = String::new();
    let mut section = "";
    for fact in facts {
        if fact.section != section {
            section = &fact.section;
            let _ = match section.starts_with("recordings ") {
                true => writeln!(out, "\n[[recordings]]"),
                false => writeln!(out, "\n[{section}]"),
            };
        }
        let _ = writeln!(out, "{} = {}", fact.key, fact.value);
    }
    out
}

/// The facts of a `stimulus.toml` that [`write`] could have written.
///
/// # Errors
/// The number of the first line that it could not.
pub(super) fn read(text: &str) -> Result<Vec<Fact>, usize> {
    let (mut section, mut recordings, mut facts) = (String::new(), 0, Vec::new());
    let mut blank = false;
    for (line, text) in (1..).zip(text.lines()) {
        let heading = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
        match (heading, text.split_once(" = ")) {
            (Some("[recordings]"), _) if blank => {
                recordings += 1;
                section = format!("recordings {recordings}");
            }
            (Some(name), _) if blank => name.clone_into(&mut section),
            (None, Some((key, value))) if !blank => facts.push(Fact {
                section: section.clone(),
                key: key.to_owned(),
                value: value.to_owned(),
            }),
            _ if text.is_empty() && !blank => {
                blank = true;
                continue;
            }
            _ => return Err(line),
        }
        blank = false;
    }
    let same = write(&facts);
    let differs = || {
        same.lines()
            .zip(text.lines())
            .take_while(|(a, b)| a == b)
            .count()
            + 1
    };
    match same == text {
        true => Ok(facts),
        false => Err(differs()),
    }
}
