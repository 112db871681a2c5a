//! What the recordings carry, in a model file of version 3: `[coverage]` and `[terms]`.

use super::text::Text;
use super::{PARAMETERS, SCALAR_KEYS, finite, numbers, positive};
use crate::model::coverage::{Coverage, Covered, Determined, MOST_CELLS, Origin};
use crate::model::{Provenance, Units};
use std::collections::BTreeMap;
use study_base::diagnostic::table::Value;

/// Reads `[coverage]`.
pub(super) fn coverage(value: Value<'_, '_>, own: Units) -> Option<Coverage> {
    let mut table = value.table()?;
    let x_mm = table.required(&own.key("x_mm")).and_then(|v| ascending(&v));
    let v_mm_s = table.required(&own.key("v_mm_s")).and_then(|value| {
        let numbers = numbers(&value)?;
        let classes = (1..=MOST_CELLS).contains(&numbers.len());
        let ascend = numbers[..].first().is_some_and(|v| *v > 0.0)
            && numbers.windows(2).all(|pair| pair[0] < pair[1]);
        match classes && ascend {
            true => Some(numbers),
            false => value.refuse("has to be speeds above 0 that ascend"),
        }
    });
    let strokes =
        ["full_strokes", "partial_strokes"].map(|key| table.required(key).and_then(|v| v.u32()));
    let held_mm = match table.value(&own.key("held_mm")) {
        None => Some(Vec::new()),
        Some(value) => (value.array()).and_then(|held| held.iter().map(ascending).collect()),
    };
    let classes = v_mm_s.as_ref().map(Vec::len);
    let mut direction = |key| {
        let value = table.required(key)?;
        covered(value, classes, own)
    };
    let (positive, negative) = (direction("positive"), direction("negative"));
    if let (Some(one), Some(other)) = (&positive, &negative)
        && one.samples.first().map(Vec::len) != other.samples.first().map(Vec::len)
    {
        table
            .required("negative")?
            .refuse::<()>("has another number of places than `positive`");
        return None;
    }
    table.finish();
    let [full_strokes, partial_strokes] = strokes;
    Some(Coverage {
        x_mm: x_mm?,
        v_mm_s: v_mm_s?,
        directions: [positive?, negative?],
        full_strokes: full_strokes?,
        partial_strokes: partial_strokes?,
        held_mm: held_mm?,
    })
}

fn covered(value: Value<'_, '_>, classes: Option<usize>, own: Units) -> Option<Covered> {
    let mut table = value.table()?;
    let top_mm_s = table
        .required(&own.key("top_mm_s"))
        .and_then(|v| positive(&v));
    let samples = table.required("samples").and_then(|value| {
        let rows = value.array()?;
        if classes.is_some_and(|classes| classes != rows.len()) {
            let key = own.key("v_mm_s");
            return value.refuse(format_args!(
                "has {} rows: one for each class of `{key}`",
                rows.len()
            ));
        }
        let counts = |row: &Value<'_, '_>| -> Option<Vec<u32>> {
            row.array()?.iter().map(|count| count.u32()).collect()
        };
        let counted = rows.iter().map(counts).collect::<Option<Vec<_>>>()?;
        let places = counted.first().map_or(0, Vec::len);
        match (1..=MOST_CELLS).contains(&places) && counted.iter().all(|row| row.len() == places) {
            true => Some(counted),
            false => value.refuse("has to have the same number of places in each row"),
        }
    });
    table.finish();
    Some(Covered {
        top_mm_s: top_mm_s?,
        samples: samples?,
    })
}

/// Two numbers, the first below the second.
pub(super) fn ascending(value: &Value<'_, '_>) -> Option<[f64; 2]> {
    let numbers = numbers(value)?;
    match numbers[..] {
        [low, high] if low < high => Some([low, high]),
        [_, _] => value.refuse("has to ascend: lowest, then highest position"),
        _ => value.refuse(format_args!("has to be two numbers, not {}", numbers.len())),
    }
}

/// Reads `[terms]`, by the names of the parameters of a table or a mechanism with mm and N.
pub(super) fn terms(value: Value<'_, '_>, own: Units) -> Option<BTreeMap<String, Determined>> {
    let mut table = value.table()?;
    let mut terms = BTreeMap::new();
    for name in PARAMETERS.into_iter().chain(SCALAR_KEYS) {
        let Some(value) = table.value(&own.key(name)) else {
            continue;
        };
        terms.insert(name.to_owned(), determined(value)?);
    }
    table.finish();
    Some(terms)
}

fn determined(value: Value<'_, '_>) -> Option<Determined> {
    let mut table = value.table()?;
    let not_negative = |value: Value<'_, '_>| match finite(&value)? {
        number if number >= 0.0 => Some(number),
        number => value.refuse(format_args!("has to be 0 or more, not {number}")),
    };
    let mut optional =
        |key: &str, read: &dyn Fn(Value<'_, '_>) -> Option<f64>| match table.value(key) {
            None => Some(None),
            Some(value) => read(value).map(Some),
        };
    let value = optional("value", &|v| finite(&v));
    let standard_error = optional("standard_error", &not_negative);
    let upper_bound = optional("upper_bound", &|v| finite(&v));
    let origin = match table.value("origin") {
        None => Some(Origin::default()),
        Some(value) => {
            let all = [Origin::Training, Origin::Dynamic, Origin::Stated];
            value.word(&all.map(|origin| (origin.as_str(), origin)))
        }
    };
    table.finish();
    Some(Determined {
        origin: origin?,
        value: value?,
        standard_error: standard_error?,
        upper_bound: upper_bound?,
    })
}

/// Writes both.
pub(super) fn write(out: &mut Text, provenance: &Provenance, own: Units) {
    if let Some(coverage) = &provenance.coverage {
        out.table("coverage");
        let [low, high] = coverage.x_mm;
        out.raw(&own.key("x_mm"), &format!("[{low:?}, {high:?}]"));
        out.list(&own.key("v_mm_s"), &coverage.v_mm_s);
        out.raw("full_strokes", &coverage.full_strokes.to_string());
        out.raw("partial_strokes", &coverage.partial_strokes.to_string());
        if !coverage.held_mm.is_empty() {
            out.raw(&own.key("held_mm"), &format!("{:?}", coverage.held_mm));
        }
        for (name, covered) in ["positive", "negative"].iter().zip(&coverage.directions) {
            out.table(&format!("coverage.{name}"));
            out.number(&own.key("top_mm_s"), covered.top_mm_s);
            out.rows("samples", &covered.samples);
        }
    }
    for (name, known) in &provenance.terms {
        out.table(&format!("terms.{}", own.key(name)));
        for (key, number) in [
            ("value", known.value),
            ("standard_error", known.standard_error),
            ("upper_bound", known.upper_bound),
        ] {
            if let Some(number) = number {
                out.number(key, number);
            }
        }
        if known.origin != Origin::default() {
            out.text("origin", known.origin.as_str());
        }
    }
}
