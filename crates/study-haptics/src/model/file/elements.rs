//! Elements in model files: version 3, `kind = "elements"`.

use super::text::Text;
use super::{finite, numbers, positions, positive};
use crate::model::{Elements, Units};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::{Table, Value};
use study_wire::elements::{MAX_SPRINGS, Spring};

/// The two scalars of a spring by its kind; those of a stop are one.
const STOP: [&str; 1] = ["slip_mm"];
const MAXWELL: [&str; 2] = ["slip_mm", "relaxation_s"];
const LATCH: [&str; 2] = ["rearm_mm", "break_mm"];

#[derive(Clone, Copy)]
enum Kind {
    Stop,
    Maxwell,
    Latch,
}

pub(super) fn read(value: Value<'_, '_>, own: Units) -> Option<Elements> {
    let mut table = value.table()?;
    let mass_kg = (table.required(&own.key("mass_kg"))).and_then(|v| not_negative(&v));
    let x_mm = (table.required(&own.key("x_mm"))).and_then(|v| positions(&v));
    let nodes = x_mm.as_ref().map(Vec::len);
    let force_n = (table.required(&own.key("force_n"))).and_then(|v| profile(&v, nodes, false));
    let [forwards, backwards] = ["forwards_n_s_per_mm", "backwards_n_s_per_mm"].map(|key| {
        let value = table.required(&own.key(key))?;
        profile(&value, nodes, true)
    });
    let springs = match table.value("springs") {
        None => Some(Vec::new()),
        Some(value) => springs(&value, nodes, own),
    };
    table.finish();
    let (springs, spring_n) = springs?.into_iter().unzip();
    Some(Elements {
        mass_kg: mass_kg?,
        x_mm: x_mm?,
        force_n: force_n?,
        damping_n_s_per_mm: [forwards?, backwards?],
        springs,
        spring_n,
    })
}

fn springs(
    value: &Value<'_, '_>,
    nodes: Option<usize>,
    own: Units,
) -> Option<Vec<(Spring, Vec<f64>)>> {
    let values = value.array()?;
    if values.len() > MAX_SPRINGS {
        return value.refuse(format_args!(
            "has {} springs: at most {MAX_SPRINGS}",
            values.len()
        ));
    }
    let read: Vec<Option<(Spring, Vec<f64>)>> = (values.into_iter())
        .map(|value| spring(value.table()?, nodes, own))
        .collect();
    read.into_iter().collect()
}

fn spring(
    mut table: Table<'_, '_>,
    nodes: Option<usize>,
    own: Units,
) -> Option<(Spring, Vec<f64>)> {
    let kinds = [
        ("stop", Kind::Stop),
        ("maxwell", Kind::Maxwell),
        ("latch", Kind::Latch),
    ];
    let kind = table.required("kind").and_then(|v| v.word(&kinds));
    let spring = kind.and_then(|kind| {
        let mut above = |key: &str| table.required(&own.key(key)).and_then(|v| positive(&v));
        match kind {
            Kind::Stop => above(STOP[0]).map(|slip_mm| Spring::Stop { slip_mm }),
            Kind::Maxwell => {
                let [slip_mm, relaxation_s] = MAXWELL.map(above);
                Some(Spring::Maxwell {
                    slip_mm: slip_mm?,
                    relaxation_s: relaxation_s?,
                })
            }
            Kind::Latch => {
                let [rearm_mm, break_mm] =
                    LATCH.map(|key| table.required(&own.key(key)).and_then(|v| finite(&v)));
                let spring = Spring::Latch {
                    rearm_mm: rearm_mm?,
                    break_mm: break_mm?,
                };
                if !spring.is_valid() {
                    table.fault_at(
                        &own.key(LATCH[1]),
                        Fault::error(
                            "a latch has to break above the position where it holds again",
                        ),
                    );
                    return None;
                }
                Some(spring)
            }
        }
    });
    let n = (table.required(&own.key("n"))).and_then(|v| profile(&v, nodes, true));
    if kind.is_some() {
        table.finish();
    }
    Some((spring?, n?))
}

/// One number per node; `bounded`: none of them negative.
fn profile(value: &Value<'_, '_>, nodes: Option<usize>, bounded: bool) -> Option<Vec<f64>> {
    let numbers = numbers(value)?;
    if let Some(nodes) = nodes.filter(|nodes| *nodes != numbers.len()) {
        return value.refuse(format_args!(
            "has {} numbers for {nodes} positions",
            numbers.len()
        ));
    }
    match numbers.iter().find(|n| bounded && **n < 0.0) {
        Some(n) => value.refuse(format_args!(
            "has {n}: with a negative value the element would not be passive"
        )),
        None => Some(numbers),
    }
}

fn not_negative(value: &Value<'_, '_>) -> Option<f64> {
    let number = finite(value)?;
    match number >= 0.0 {
        true => Some(number),
        false => value.refuse(format_args!("has to be 0 or more, not {number}")),
    }
}

/// The tables of elements at the end of a model file.
pub(super) fn write(out: &mut Text, elements: &Elements, own: Units) {
    let key = |key: &str| own.key(key);
    let [forwards, backwards] = &elements.damping_n_s_per_mm;
    out.table("elements");
    out.number(&key("mass_kg"), elements.mass_kg);
    out.list(&key("x_mm"), &elements.x_mm);
    out.list(&key("force_n"), &elements.force_n);
    out.list(&key("forwards_n_s_per_mm"), forwards);
    out.list(&key("backwards_n_s_per_mm"), backwards);
    for (spring, n) in elements.springs.iter().zip(&elements.spring_n) {
        out.table("[elements.springs]");
        let mut scalars = |kind: &str, keys: &[&str], values: &[f64]| {
            out.raw("kind", &format!("\"{kind}\""));
            for (name, value) in keys.iter().zip(values) {
                out.number(&key(name), *value);
            }
        };
        match *spring {
            Spring::Stop { slip_mm } => scalars("stop", &STOP, &[slip_mm]),
            Spring::Maxwell {
                slip_mm,
                relaxation_s,
            } => scalars("maxwell", &MAXWELL, &[slip_mm, relaxation_s]),
            Spring::Latch { rearm_mm, break_mm } => {
                scalars("latch", &LATCH, &[rearm_mm, break_mm]);
            }
        }
        out.list(&key("n"), n);
    }
}
