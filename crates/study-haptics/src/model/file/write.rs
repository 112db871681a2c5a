//! The text of a model file.

use super::text::{Text, bare};
use super::{FORMAT, FORMAT_2, FORMAT_3, PARAMETERS, SCALAR_KEYS, carried, elements};
use crate::model::{Realization, Units};

/// The text of a model file.
pub fn write(realization: &Realization) -> String {
    let r = realization;
    let key = |key: &str| r.units.key(key);
    let mut out = Text::default();
    let turns = r.units != Units::Linear;
    let own_states = r.mechanism.is_some() || r.elements.is_some();
    let carries = r.provenance.coverage.is_some() || !r.provenance.terms.is_empty();
    let third = carries || r.elements.is_some();
    if third || turns || own_states {
        out.text("format", if third { FORMAT_3 } else { FORMAT_2 });
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
    carried::write(&mut out, p, r.units);
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
    out.into()
}
