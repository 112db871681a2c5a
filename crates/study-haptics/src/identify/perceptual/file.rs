//! Reading and writing files of weights.
//!
//! TOML with `format = "study-weights/1"`, a `note` for people, and `[weights]` with a number of at least 0 for each component
//! whose weight is known. Only their ratios matter. Reading is strict and reports every fault with its line.

use super::{Component, Weights};
use crate::model::file::quoted;
use std::fmt::Write as _;
use study_base::diagnostic::table::{self, Table};
use study_base::diagnostic::{Fault, Findings};

/// The format of a file of weights.
pub const FORMAT: &str = "study-weights/1";
/// Largest file that is read, bytes.
pub const MAX_FILE_BYTES: usize = 1 << 20;

/// Reads a file of weights; `path` is for messages. `None` if and only if the findings contain an error.
///
/// ```
/// # use study_haptics::identify::perceptual::{Component, file::parse};
/// let text = "format = \"study-weights/1\"\n[weights]\nlevel = 0.1\ndetent = 0.9\n";
/// let (weights, _) = parse("perceptual.toml", text);
/// let weights = weights.unwrap();
/// assert_eq!(weights.known(Component::Detent), Some(0.9));
/// assert_eq!(weights.known(Component::Fast), None);
/// // In place of those that are not known.
/// assert_eq!(weights.all()[4], 0.5);
/// ```
pub fn parse(path: &str, text: &str) -> (Option<Weights>, Findings) {
    table::parse(path, text, read)
}

fn read(mut root: Table<'_, '_>) -> Option<Weights> {
    if !root.has_format(FORMAT, "a file of weights") {
        return None;
    }
    let note = root.text("note");
    let known = root.required("weights").and_then(|value| value.table());
    let known = known.and_then(weights);
    let sound = known.and_then(|known| Weights::new(known, note));
    if known.is_some() && sound.is_none() {
        let fault = Fault::error("no weight is above 0");
        root.fault_at(
            "weights",
            fault.hint("with such weights every error is felt alike: not at all"),
        );
    }
    root.finish();
    sound
}

/// In the order of [`Component::ALL`]; `None` if one of them is no number of at least 0, which is reported.
fn weights(mut table: Table<'_, '_>) -> Option<[Option<f64>; 5]> {
    let mut sound = true;
    let known = Component::ALL.map(|component| {
        let value = table.value(component.as_str())?;
        let given = value.f64();
        let weight = given.filter(|w| *w >= 0.0 && w.is_finite());
        if given.is_some() && weight.is_none() {
            value.fault(Fault::error(format!(
                "the weight `{}` is not a number of at least 0",
                component.as_str()
            )));
        }
        sound &= weight.is_some();
        weight
    });
    table.finish();
    sound.then_some(known)
}

/// The text of a file of weights.
pub fn write(weights: &Weights) -> String {
    let mut out = format!("format = \"{FORMAT}\"\n");
    // writing to a String cannot fail
    if let Some(note) = &weights.note {
        let _ = writeln!(out, "note = {}", quoted(note));
    }
    out.push_str("\n[weights]\n");
    for component in Component::ALL {
        if let Some(weight) = weights.known(component) {
            let _ = writeln!(out, "{} = {weight:?}", component.as_str());
        }
    }
    out
}
