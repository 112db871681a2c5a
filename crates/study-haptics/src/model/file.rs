//! Reading and writing model files.
//!
//! A model file is TOML with `format = "study-model/1"`, or `"study-model/2"` with a `kind`: a
//! `table`, whose other keys are those of version 1, or a `mechanism`, and with `units` of a
//! straight or a turning handle, which the names of the keys then have. `"study-model/3"` has the
//! keys of version 2, `elements` as another kind, and what the recordings carry: `[coverage]` and
//! `[terms]`. Reading is strict and reports
//! every fault with its line: unknown keys, numbers that are not finite, positions that
//! do not ascend, lists of different lengths, reversed ranges. Writing is reproducible:
//! the same realization gives the same bytes, numbers have the fewest digits that read
//! back as the same number, and `parse(write(r)) == r` for every valid `r`.

mod carried;
mod elements;
mod text;
mod write;

pub(crate) use text::quoted;
pub use write::write;

use super::{
    Branch, FORMAT, FORMAT_2, FORMAT_3, Mechanism, Profile, Provenance, Realization, Trained, Units,
};
use std::collections::BTreeMap;
use study_base::diagnostic::table::{self, Table, Value};
use study_base::diagnostic::{Fault, Findings};
use study_base::limits::Limit;
use study_base::text::{ModelId, Untrusted};
use study_wire::mechanism::{Flaw, SCALARS, Scalars};
use study_wire::predict::{Direction, Lookup};

/// Most nodes of a table.
pub const MAX_NODES: usize = 20_000;

/// The keys of a branch, in the order of [`Branch`].
const PARAMETERS: [&str; 4] = ["m_kg", "b_n_s_per_mm", "k_n_per_mm", "f0_n"];

/// Reads a model file; `path` is for messages. `None` if and only if the findings
/// contain an error.
pub fn parse(path: &str, text: &str) -> (Option<Realization>, Findings) {
    table::parse(path, text, read)
}

/// What a model file has parameters of.
#[derive(Clone, Copy)]
enum Kind {
    Table,
    Mechanism,
    Elements,
}

fn read(mut root: Table<'_, '_>) -> Option<Realization> {
    let format = root.value("format").and_then(|v| v.text());
    let third = format.as_deref() == Some(FORMAT_3);
    let mut own = Units::Linear;
    if third || format.as_deref() == Some(FORMAT_2) {
        let kinds = [
            ("table", Kind::Table),
            ("mechanism", Kind::Mechanism),
            ("elements", Kind::Elements),
        ];
        let of_version = if third { &kinds[..] } else { &kinds[..2] };
        let kind = root.required("kind").and_then(|v| v.word(of_version));
        own = root.value("units").map_or(Some(Units::Linear), units)?;
        match kind? {
            Kind::Table => {}
            Kind::Mechanism => return read_mechanism(root, own, third),
            Kind::Elements => return read_elements(root, own),
        }
    } else if !root.has_format(FORMAT, "a model file") {
        return None;
    }
    let id = id(&mut root);
    let lookup = root.required("lookup").and_then(|v| v.word(&Lookup::NAMES));
    let direction = root.required("direction").and_then(|v| direction(v, own));
    let trained = root.required("trained").and_then(|v| trained(v, own));
    let x_key = own.key("x_mm");
    let x_mm = root.required(&x_key).and_then(|value| positions(&value));
    let provenance = provenance(&mut root, own, third);
    let vaf = root.value("vaf").map_or(Some(BTreeMap::new()), vaf);
    let nodes = x_mm.as_ref().map(Vec::len);
    let mut branch = |name| {
        let value = root.required(name)?;
        branch(value, nodes, own)
    };
    let (positive, negative) = (branch("positive"), branch("negative"));
    if let (Some(trained), Some(x_mm)) = (&trained, &x_mm) {
        let [low, high] = trained.x_mm;
        // Multiples of dx are rounded.
        let rounding = 1e-9 * (high - low);
        if x_mm[0] < low - rounding || x_mm[x_mm.len() - 1] > high + rounding {
            root.fault_at(
                &x_key,
                Fault::warning(format!("there are nodes outside `trained.{x_key}`"))
                    .hint("the target was not identified there"),
            );
        }
    }
    root.finish();
    Some(Realization {
        id: id?,
        provenance: provenance?,
        vaf: vaf?,
        units: own,
        lookup: lookup?,
        direction: direction?,
        trained: trained?,
        x_mm: x_mm?,
        positive: positive?,
        negative: negative?,
        mechanism: None,
        elements: None,
    })
}

/// A mechanism of version 2 or 3.
fn read_mechanism(mut root: Table<'_, '_>, own: Units, third: bool) -> Option<Realization> {
    let id = id(&mut root);
    let trained = root.required("trained").and_then(|v| trained(v, own));
    let provenance = provenance(&mut root, own, third);
    let vaf = root.value("vaf").map_or(Some(BTreeMap::new()), vaf);
    let mechanism = root
        .required("mechanism")
        .and_then(|v| mechanism(v, &trained, own));
    root.finish();
    let (trained, mechanism) = (trained?, mechanism?);
    Some(Realization {
        units: own,
        ..Realization::of_mechanism(id?, provenance?, vaf?, trained, mechanism)
    })
}

/// Elements of version 3.
fn read_elements(mut root: Table<'_, '_>, own: Units) -> Option<Realization> {
    let id = id(&mut root);
    let trained = root.required("trained").and_then(|v| trained(v, own));
    let provenance = provenance(&mut root, own, true);
    let vaf = root.value("vaf").map_or(Some(BTreeMap::new()), vaf);
    let elements = (root.required("elements")).and_then(|v| elements::read(v, own));
    root.finish();
    Some(Realization {
        units: own,
        ..Realization::of_elements(id?, provenance?, vaf?, trained?, elements?)
    })
}

/// `{ x = "deg", f = "N·m" }`
fn units(value: Value<'_, '_>) -> Option<Units> {
    let mut table = value.table()?;
    let all = [Units::Linear, Units::Degrees, Units::Radians];
    let x = table.required("x").and_then(|v| {
        let words = all.map(|units| (units.names()[0], units));
        v.word(&words)
    });
    let rotary = table.required("f").and_then(|v| {
        let word = v.word(&[("N", false), ("N·m", true)])?;
        let fits = x.is_none_or(|x| (x != Units::Linear) == word);
        match fits {
            true => Some(word),
            false => v.refuse("does not go with x: mm and N, deg and N·m, or rad and N·m"),
        }
    });
    table.finish();
    rotary.and(x)
}

/// The keys of a mechanism's scalars, in the order of [`Scalars::to_array`].
pub const SCALAR_KEYS: [&str; SCALARS] = [
    "handle_kg",
    "follower_kg",
    "contact_n_per_mm",
    "contact_n_s_per_mm",
    "gap_mm",
    "follower_n_s_per_mm",
    "slip_mm",
    "stribeck",
    "stribeck_mm_s",
    "handle_n",
    "handle_slip_mm",
    "handle_n_s_per_mm",
    "offset_n",
];

fn mechanism(value: Value<'_, '_>, trained: &Option<Trained>, own: Units) -> Option<Mechanism> {
    let mut table = value.table()?;
    let scalars = SCALAR_KEYS.map(|key| table.required(&own.key(key)).and_then(|v| finite(&v)));
    let recorded_hz = table.value("recorded_hz").and_then(|v| positive(&v));
    let detent = table.required("detent").and_then(|v| profile(v, own));
    let friction = table.required("friction").and_then(|v| profile(v, own));
    let mut values = [0.0; SCALARS];
    for (value, scalar) in values.iter_mut().zip(scalars) {
        *value = scalar?;
    }
    let mechanism = Mechanism {
        scalars: Scalars::from_array(values),
        detent: detent?,
        friction: friction?,
        recorded_hz,
    };
    // All conditions are homogeneous in the units of length and force.
    let top_mm_s = trained.as_ref().map_or(0.0, |trained| trained.v_mm_s);
    let fault = match mechanism.view().check(2.0 * top_mm_s) {
        Ok(()) => None,
        Err(Flaw::Scalar(i)) => Some((
            SCALAR_KEYS[i],
            "has to be positive, or 0 where nothing is divided by it",
        )),
        Err(Flaw::Profile | Flaw::Value) => Some(("friction", "has a negative value")),
        Err(Flaw::Friction) => Some((
            "friction",
            "rises too steeply from a small value: the mechanism would not be passive",
        )),
    };
    if let Some((key, message)) = fault {
        table.fault_at(key, Fault::error(format!("`{key}` {message}")));
    }
    table.finish();
    fault.is_none().then_some(mechanism)
}

fn profile(value: Value<'_, '_>, own: Units) -> Option<Profile> {
    let mut table = value.table()?;
    let first = table.required(&own.key("first_mm"));
    let first_mm = first.and_then(|v| finite(&v));
    let step_mm = table
        .required(&own.key("step_mm"))
        .and_then(|v| positive(&v));
    let n = table.required(&own.key("n")).and_then(|value| {
        let numbers = numbers(&value)?;
        if (2..=MAX_NODES).contains(&numbers.len()) {
            return Some(numbers);
        }
        value.refuse(format_args!(
            "has {} values: 2 to {MAX_NODES}",
            numbers.len()
        ))
    });
    table.finish();
    Some(Profile {
        first_mm: first_mm?,
        step_mm: step_mm?,
        n: n?,
    })
}

fn id(root: &mut Table<'_, '_>) -> Option<String> {
    let value = root.required("id")?;
    match ModelId::new(value.text()?) {
        Ok(id) => Some(id.into()),
        Err(bad) => {
            value.fault(Fault::error(bad.to_string()));
            None
        }
    }
}

fn direction(value: Value<'_, '_>, own: Units) -> Option<Direction> {
    let mut table = value.table()?;
    type WithDelta = fn(f64) -> Direction;
    let rules: [(&str, Option<WithDelta>); 3] = [
        ("sign", None),
        ("play", Some(|delta_mm| Direction::Play { delta_mm })),
        ("dahl", Some(|delta_mm| Direction::Dahl { delta_mm })),
    ];
    let direction = match table.required("rule").and_then(|v| v.word(&rules)) {
        Some(None) => Some(Direction::Sign),
        Some(Some(with_delta)) => table
            .required(&own.key("delta_mm"))
            .and_then(|v| positive(&v))
            .map(with_delta),
        None => {
            // a valid key, whatever the rule was meant to be
            let _ = table.value(&own.key("delta_mm"));
            None
        }
    };
    table.finish();
    direction
}

fn trained(value: Value<'_, '_>, own: Units) -> Option<Trained> {
    let mut table = value.table()?;
    let x_mm = table.required(&own.key("x_mm"));
    let x_mm = x_mm.and_then(|value| carried::ascending(&value));
    let v_mm_s = table
        .required(&own.key("v_mm_s"))
        .and_then(|v| positive(&v));
    table.finish();
    Some(Trained {
        x_mm: x_mm?,
        v_mm_s: v_mm_s?,
    })
}

fn positions(value: &Value<'_, '_>) -> Option<Vec<f64>> {
    let numbers = numbers(value)?;
    let nodes = numbers.len();
    if !(2..=MAX_NODES).contains(&nodes) {
        return value.refuse(format_args!(
            "has {nodes} nodes: a table has 2 to {MAX_NODES}"
        ));
    }
    let values = value.array()?;
    let mut all = Some(());
    for (pair, value) in numbers.windows(2).zip(&values[1..]) {
        let [before, x] = [pair[0], pair[1]];
        if x <= before {
            all = value.refuse(format_args!(
                "is {x} after {before}: positions have to ascend"
            ));
        }
    }
    all.map(|()| numbers)
}

/// How it was identified; in version 3 with what the recordings carry.
fn provenance(root: &mut Table<'_, '_>, own: Units, third: bool) -> Option<Provenance> {
    let mut optional = |key| third.then(|| root.value(key)).flatten();
    let (coverage, terms) = (optional("coverage"), optional("terms"));
    let coverage = coverage.map(|v| carried::coverage(v, own));
    let terms = terms.map_or(Some(BTreeMap::new()), |v| carried::terms(v, own));
    let mut table = root.required("provenance")?.table()?;
    let method = table.required("method").and_then(|v| v.text());
    let lambda = table.value("lambda").and_then(|value| {
        let lambda = finite(&value)?;
        if lambda > 0.0 && lambda <= 1.0 {
            return Some(lambda);
        }
        value.refuse(format_args!(
            "has to be above 0 and at most 1, not {lambda}"
        ))
    });
    let memory_mm = table
        .value(&own.key("memory_mm"))
        .and_then(|v| positive(&v));
    let dx_mm = table.value(&own.key("dx_mm")).and_then(|v| positive(&v));
    let resample = table.text("resample");
    let filter = table.text("filter");
    let note = table.text("note");
    let mut recordings = BTreeMap::new();
    if let Some(mut hashes) = table.table("recordings") {
        for (name, _) in hashes.keys() {
            if let Some(hash) = hashes.text(&name) {
                recordings.insert(name, hash);
            }
        }
    }
    table.finish();
    Some(Provenance {
        method: method?,
        lambda,
        memory_mm,
        dx_mm,
        resample,
        filter,
        recordings,
        note,
        coverage: match coverage {
            None => None,
            Some(coverage) => Some(coverage?),
        },
        terms: terms?,
    })
}

fn vaf(value: Value<'_, '_>) -> Option<BTreeMap<String, f64>> {
    let mut table = value.table()?;
    let mut vaf = BTreeMap::new();
    for (name, _) in table.keys() {
        let Some(value) = table.value(&name) else {
            continue;
        };
        let Some(number) = finite(&value) else {
            continue;
        };
        if number > 1.0 {
            value.fault(
                Fault::error(format!(
                    "the VAF on `{}` is {number}: it is at most 1",
                    Untrusted(&name)
                ))
                .hint("a VAF of 79 % is 0.79"),
            );
        }
        vaf.insert(name, number);
    }
    table.finish();
    Some(vaf)
}

fn branch(value: Value<'_, '_>, nodes: Option<usize>, own: Units) -> Option<Branch> {
    let mut table = value.table()?;
    let [m_kg, b_n_s_per_mm, k_n_per_mm, f0_n] = PARAMETERS.map(|key| {
        let value = table.required(&own.key(key))?;
        let numbers = numbers(&value)?;
        let n = numbers.len();
        match nodes {
            Some(nodes) if nodes != n => value.refuse(format_args!(
                "has {n} numbers where `{}` has {nodes}",
                own.key("x_mm")
            )),
            _ => Some(numbers),
        }
    });
    table.finish();
    Some(Branch {
        m_kg: m_kg?,
        b_n_s_per_mm: b_n_s_per_mm?,
        k_n_per_mm: k_n_per_mm?,
        f0_n: f0_n?,
    })
}

/// A list of finite numbers; each other value is a fault.
fn numbers(value: &Value<'_, '_>) -> Option<Vec<f64>> {
    let values = value.array()?;
    let numbers: Vec<f64> = values.iter().filter_map(finite).collect();
    (numbers.len() == values.len()).then_some(numbers)
}

fn finite(value: &Value<'_, '_>) -> Option<f64> {
    let number = value.f64()?;
    if number.is_finite() {
        return Some(number);
    }
    value.refuse(format_args!("has to be a finite number, not {number}"))
}

fn positive(value: &Value<'_, '_>) -> Option<f64> {
    let number = value.f64()?;
    if Limit::new(number).is_ok() {
        return Some(number);
    }
    value.refuse(format_args!(
        "has to be a finite number above zero, not {number}"
    ))
}

#[cfg(test)]
mod tests;
