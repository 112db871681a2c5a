//! The text of a model file.

use super::{FORMAT, FORMAT_2, PARAMETERS, SCALAR_KEYS};
use crate::model::{Branch, Realization};
use std::fmt::Write as _;
/// Numbers of a list per line.
const PER_LINE: usize = 6;

/// The text of a model file.
pub fn write(realization: &Realization) -> String {
    let r = realization;
    let mut out = Text::default();
    match &r.mechanism {
        None => {
            out.text("format", FORMAT);
            out.text("id", &r.id);
            out.text("lookup", r.lookup.as_str());
            let rule = r.direction.as_str();
            let direction = match r.direction.delta_mm() {
                None => format!("{{ rule = \"{rule}\" }}"),
                Some(delta_mm) => format!("{{ rule = \"{rule}\", delta_mm = {delta_mm:?} }}"),
            };
            out.raw("direction", &direction);
        }
        Some(_) => {
            out.text("format", FORMAT_2);
            out.text("kind", "mechanism");
            out.text("id", &r.id);
        }
    }
    let [low, high] = r.trained.x_mm;
    out.raw(
        "trained",
        &format!(
            "{{ x_mm = [{low:?}, {high:?}], v_mm_s = {:?} }}",
            r.trained.v_mm_s
        ),
    );
    if r.mechanism.is_none() {
        out.list("x_mm", &r.x_mm);
    }

    let p = &r.provenance;
    out.table("provenance");
    out.text("method", &p.method);
    for (key, number) in [
        ("lambda", p.lambda),
        ("memory_mm", p.memory_mm),
        ("dx_mm", p.dx_mm),
    ] {
        if let Some(number) = number {
            out.number(key, number);
        }
    }
    for (key, text) in [
        ("resample", &p.resample),
        ("filter", &p.filter),
        ("note", &p.note),
    ] {
        if let Some(text) = text {
            out.text(key, text);
        }
    }
    if !p.recordings.is_empty() {
        out.table("provenance.recordings");
        for (name, hash) in &p.recordings {
            out.text(&key(name), hash);
        }
    }
    if !r.vaf.is_empty() {
        out.table("vaf");
        for (name, vaf) in &r.vaf {
            out.number(&key(name), *vaf);
        }
    }
    match &r.mechanism {
        None => {
            out.branch("positive", &r.positive);
            out.branch("negative", &r.negative);
        }
        Some(mechanism) => {
            out.table("mechanism");
            for (key, value) in SCALAR_KEYS.iter().zip(mechanism.scalars.to_array()) {
                out.number(key, value);
            }
            if let Some(hz) = mechanism.recorded_hz {
                out.number("recorded_hz", hz);
            }
            for (name, profile) in [
                ("mechanism.detent", &mechanism.detent),
                ("mechanism.friction", &mechanism.friction),
            ] {
                out.table(name);
                out.number("first_mm", profile.first_mm);
                out.number("step_mm", profile.step_mm);
                out.list("n", &profile.n);
            }
        }
    }
    out.0
}

#[derive(Default)]
struct Text(String);

impl Text {
    fn raw(&mut self, key: &str, value: &str) {
        // writing to a String cannot fail
        let _ = writeln!(self.0, "{key} = {value}");
    }

    fn text(&mut self, key: &str, value: &str) {
        self.raw(key, &quoted(value));
    }

    fn number(&mut self, key: &str, value: f64) {
        // {:?} gives the fewest digits that read back, and a point or an exponent
        self.raw(key, &format!("{value:?}"));
    }

    fn list(&mut self, key: &str, values: &[f64]) {
        let lines: Vec<String> = values
            .chunks(PER_LINE)
            .map(|line| {
                let numbers: Vec<String> = line.iter().map(|v| format!("{v:?}")).collect();
                format!("  {},\n", numbers.join(", "))
            })
            .collect();
        self.raw(key, &format!("[\n{}]", lines.concat()));
    }

    fn table(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n[{name}]");
    }

    fn branch(&mut self, name: &str, branch: &Branch) {
        self.table(name);
        let columns = [
            &branch.m_kg,
            &branch.b_n_s_per_mm,
            &branch.k_n_per_mm,
            &branch.f0_n,
        ];
        for (key, values) in PARAMETERS.into_iter().zip(columns) {
            self.list(key, values);
        }
    }
}

/// A basic TOML string, with invisible and control characters escaped.
fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            c if study_base::text::is_unsafe(c) => {
                let _ = write!(out, "\\U{:08X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A key, bare if TOML allows it.
fn key(name: &str) -> String {
    let bare = !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if bare { name.to_owned() } else { quoted(name) }
}
