//! The text of a model file.

use super::{FORMAT, FORMAT_2, FORMAT_3, PARAMETERS, SCALAR_KEYS, elements};
use crate::model::{Realization, Units};
use std::fmt::Write as _;
/// Numbers of a list per line.
const PER_LINE: usize = 6;

/// The text of a model file.
pub fn write(realization: &Realization) -> String {
    let r = realization;
    let key = |key: &str| r.units.key(key);
    let mut out = Text::default();
    let turns = r.units != Units::Linear;
    let own_states = r.mechanism.is_some() || r.elements.is_some();
    if turns || own_states {
        out.text(
            "format",
            if r.elements.is_some() {
                FORMAT_3
            } else {
                FORMAT_2
            },
        );
        out.text(
            "kind",
            match (&r.mechanism, &r.elements) {
                (Some(_), _) => "mechanism",
                (None, Some(_)) => "elements",
                (None, None) => "table",
            },
        );
    } else {
        out.text("format", FORMAT);
    }
    if turns {
        let [x, f] = r.units.names();
        out.raw("units", &format!("{{ x = \"{x}\", f = \"{f}\" }}"));
    }
    out.text("id", &r.id);
    if !own_states {
        out.text("lookup", r.lookup.as_str());
        let rule = r.direction.as_str();
        let direction = match r.direction.delta_mm() {
            None => format!("{{ rule = \"{rule}\" }}"),
            Some(delta) => format!("{{ rule = \"{rule}\", {} = {delta:?} }}", key("delta_mm")),
        };
        out.raw("direction", &direction);
    }
    let [low, high] = r.trained.x_mm;
    out.raw(
        "trained",
        &format!(
            "{{ {} = [{low:?}, {high:?}], {} = {:?} }}",
            key("x_mm"),
            key("v_mm_s"),
            r.trained.v_mm_s
        ),
    );
    if !own_states {
        out.list(&key("x_mm"), &r.x_mm);
    }

    let p = &r.provenance;
    out.table("provenance");
    out.text("method", &p.method);
    for (name, number) in [
        ("lambda", p.lambda),
        ("memory_mm", p.memory_mm),
        ("dx_mm", p.dx_mm),
    ] {
        if let Some(number) = number {
            out.number(&key(name), number);
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
            out.text(&bare(name), hash);
        }
    }
    if !r.vaf.is_empty() {
        out.table("vaf");
        for (name, vaf) in &r.vaf {
            out.number(&bare(name), *vaf);
        }
    }
    if let Some(own) = &r.elements {
        elements::write(&mut out, own, r.units);
    }
    match &r.mechanism {
        None if own_states => {}
        None => {
            for (name, branch) in [("positive", &r.positive), ("negative", &r.negative)] {
                out.table(name);
                let columns = [
                    &branch.m_kg,
                    &branch.b_n_s_per_mm,
                    &branch.k_n_per_mm,
                    &branch.f0_n,
                ];
                for (name, values) in PARAMETERS.into_iter().zip(columns) {
                    out.list(&key(name), values);
                }
            }
        }
        Some(mechanism) => {
            out.table("mechanism");
            for (name, value) in SCALAR_KEYS.iter().zip(mechanism.scalars.to_array()) {
                out.number(&key(name), value);
            }
            if let Some(hz) = mechanism.recorded_hz {
                out.number("recorded_hz", hz);
            }
            for (name, profile) in [
                ("mechanism.detent", &mechanism.detent),
                ("mechanism.friction", &mechanism.friction),
            ] {
                out.table(name);
                out.number(&key("first_mm"), profile.first_mm);
                out.number(&key("step_mm"), profile.step_mm);
                out.list(&key("n"), &profile.n);
            }
        }
    }
    out.0
}

#[derive(Default)]
pub(super) struct Text(String);

impl Text {
    pub(super) fn raw(&mut self, key: &str, value: &str) {
        // writing to a String cannot fail
        let _ = writeln!(self.0, "{key} = {value}");
    }

    fn text(&mut self, key: &str, value: &str) {
        self.raw(key, &quoted(value));
    }

    pub(super) fn number(&mut self, key: &str, value: f64) {
        // {:?} gives the fewest digits that read back, and a point or an exponent
        self.raw(key, &format!("{value:?}"));
    }

    pub(super) fn list(&mut self, key: &str, values: &[f64]) {
        let lines: Vec<String> = values
            .chunks(PER_LINE)
            .map(|line| {
                let numbers: Vec<String> = line.iter().map(|v| format!("{v:?}")).collect();
                format!("  {},\n", numbers.join(", "))
            })
            .collect();
        self.raw(key, &format!("[\n{}]", lines.concat()));
    }

    pub(super) fn table(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n[{name}]");
    }
}

/// A basic TOML string, with invisible and control characters escaped.
pub(crate) fn quoted(text: &str) -> String {
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
fn bare(name: &str) -> String {
    let bare = !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if bare { name.to_owned() } else { quoted(name) }
}
