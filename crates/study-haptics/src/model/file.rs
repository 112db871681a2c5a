//! Reading and writing model files.
//!
//! A model file is TOML with `format = "study-model/1"`. Reading is strict and reports
//! every fault with its line: unknown keys, numbers that are not finite, positions that
//! do not ascend, lists of different lengths, reversed ranges. Writing is reproducible:
//! the same realization gives the same bytes, numbers have the fewest digits that read
//! back as the same number, and `parse(write(r)) == r` for every valid `r`.
//!
//! A file of a newer format is refused by its number alone, because its unknown keys are
//! not mistakes.

mod write;

pub use write::write;

use super::{Branch, FORMAT, Provenance, Realization, Trained};
use std::collections::BTreeMap;
use study_base::diagnostic::table::{Document, Table, Value};
use study_base::diagnostic::{Fault, Findings};
use study_base::limits::Limit;
use study_base::text::{ModelId, Untrusted};
use study_wire::predict::{Direction, Lookup};

/// Most nodes of a table.
pub const MAX_NODES: usize = 20_000;

/// The values of `lookup`.
const LOOKUPS: [(&str, Lookup); 3] = [
    ("linear", Lookup::Linear),
    ("floor", Lookup::Floor),
    ("nearest", Lookup::Nearest),
];

/// The keys of a branch, in the order of [`Branch`].
const PARAMETERS: [&str; 4] = ["m_kg", "b_n_s_per_mm", "k_n_per_mm", "f0_n"];

/// The name of a look-up in model files and arguments.
pub fn lookup_name(lookup: Lookup) -> &'static str {
    match lookup {
        Lookup::Linear => "linear",
        Lookup::Floor => "floor",
        Lookup::Nearest => "nearest",
    }
}

/// Reads a model file; `path` is for messages. `None` if and only if the findings
/// contain an error.
pub fn parse(path: &str, text: &str) -> (Option<Realization>, Findings) {
    let document = Document::parse(text);
    let realization = read(&document);
    let mut findings = Findings::new(path, text);
    findings.faults = document.finish().faults;
    findings.sort();
    let good = !findings.has_errors();
    (realization.filter(|_| good), findings)
}

fn read(document: &Document<'_>) -> Option<Realization> {
    let mut root = document.root();
    if !has_known_format(&mut root) {
        return None;
    }
    let id = id(&mut root);
    let lookup = root
        .required("lookup")
        .and_then(|value| value.word(&LOOKUPS));
    let direction = root.required("direction").and_then(direction);
    let trained = root.required("trained").and_then(trained);
    let x_mm = root.required("x_mm").and_then(|value| positions(&value));
    let provenance = root.required("provenance").and_then(provenance);
    let vaf = root.value("vaf").map_or(Some(BTreeMap::new()), vaf);
    let nodes = x_mm.as_ref().map(Vec::len);
    let positive = root.required("positive").and_then(|v| branch(v, nodes));
    let negative = root.required("negative").and_then(|v| branch(v, nodes));
    if let (Some(trained), Some(x_mm)) = (&trained, &x_mm)
        && (x_mm[0] < trained.x_mm[0] || x_mm[x_mm.len() - 1] > trained.x_mm[1])
    {
        root.fault_at(
            "x_mm",
            Fault::warning("there are nodes outside `trained.x_mm`")
                .hint("the target was not identified there"),
        );
    }
    root.finish();
    Some(Realization {
        id: id?,
        provenance: provenance?,
        vaf: vaf?,
        lookup: lookup?,
        direction: direction?,
        trained: trained?,
        x_mm: x_mm?,
        positive: positive?,
        negative: negative?,
    })
}

/// Whether the rest of the file can be read as [`FORMAT`].
fn has_known_format(root: &mut Table<'_, '_>) -> bool {
    let Some(value) = root.required("format") else {
        // most likely forgotten: report the faults of the rest as well
        return true;
    };
    let Some(given) = value.text() else {
        return true;
    };
    if given == FORMAT {
        return true;
    }
    let fault = Fault::error(format!("this is not a {FORMAT} file"));
    let newer = given
        .strip_prefix("study-model/")
        .and_then(|n| n.parse::<u32>().ok())
        .is_some_and(|n| n > 1);
    value.fault(if newer {
        fault
            .label("a newer format")
            .hint("it was written by a newer version of study, which can read it")
    } else {
        fault.hint(format!("a model file begins with format = \"{FORMAT}\""))
    });
    false
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

fn direction(value: Value<'_, '_>) -> Option<Direction> {
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
            .required("delta_mm")
            .and_then(|v| positive(&v))
            .map(with_delta),
        None => {
            // a valid key, whatever the rule was meant to be
            let _ = table.value("delta_mm");
            None
        }
    };
    table.finish();
    direction
}

fn trained(value: Value<'_, '_>) -> Option<Trained> {
    let mut table = value.table()?;
    let x_mm = table.required("x_mm").and_then(|value| {
        let numbers = numbers(&value)?;
        match numbers[..] {
            [low, high] if low < high => Some([low, high]),
            [_, _] => {
                value.fault(Fault::error(format!(
                    "`{}` has to ascend: lowest, then highest position",
                    value.path()
                )));
                None
            }
            _ => {
                value.fault(Fault::error(format!(
                    "`{}` has to be two numbers, not {}",
                    value.path(),
                    numbers.len()
                )));
                None
            }
        }
    });
    let v_mm_s = table.required("v_mm_s").and_then(|v| positive(&v));
    table.finish();
    Some(Trained {
        x_mm: x_mm?,
        v_mm_s: v_mm_s?,
    })
}

fn positions(value: &Value<'_, '_>) -> Option<Vec<f64>> {
    let numbers = numbers(value)?;
    if !(2..=MAX_NODES).contains(&numbers.len()) {
        value.fault(Fault::error(format!(
            "`{}` has {} nodes: a table has 2 to {MAX_NODES}",
            value.path(),
            numbers.len()
        )));
        return None;
    }
    let values = value.array()?;
    let mut ascends = true;
    for (pair, value) in numbers.windows(2).zip(&values[1..]) {
        if pair[1] <= pair[0] {
            value.fault(Fault::error(format!(
                "`{}` is {} after {}: positions have to ascend",
                value.path(),
                pair[1],
                pair[0]
            )));
            ascends = false;
        }
    }
    ascends.then_some(numbers)
}

fn provenance(value: Value<'_, '_>) -> Option<Provenance> {
    let mut table = value.table()?;
    let method = table.required("method").and_then(|v| v.text());
    let lambda = table.value("lambda").and_then(|value| {
        let lambda = finite(&value)?;
        if lambda > 0.0 && lambda <= 1.0 {
            return Some(lambda);
        }
        value.fault(Fault::error(format!(
            "`{}` has to be above 0 and at most 1, not {lambda}",
            value.path()
        )));
        None
    });
    let memory_mm = table.value("memory_mm").and_then(|v| positive(&v));
    let dx_mm = table.value("dx_mm").and_then(|v| positive(&v));
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

fn branch(value: Value<'_, '_>, nodes: Option<usize>) -> Option<Branch> {
    let mut table = value.table()?;
    let [m_kg, b_n_s_per_mm, k_n_per_mm, f0_n] = PARAMETERS.map(|key| {
        let value = table.required(key)?;
        let numbers = numbers(&value)?;
        match nodes {
            Some(nodes) if nodes != numbers.len() => {
                value.fault(Fault::error(format!(
                    "`{}` has {} numbers where `x_mm` has {nodes}",
                    value.path(),
                    numbers.len()
                )));
                None
            }
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
    value.fault(Fault::error(format!(
        "`{}` has to be a finite number, not {number}",
        value.path()
    )));
    None
}

fn positive(value: &Value<'_, '_>) -> Option<f64> {
    let number = value.f64()?;
    match Limit::new(number) {
        Ok(limit) => Some(limit.get()),
        Err(_) => {
            value.fault(Fault::error(format!(
                "`{}` has to be a finite number above zero, not {number}",
                value.path()
            )));
            None
        }
    }
}

#[cfg(test)]
mod tests;
