//! The standard of magnitude estimation, as it is read.

use crate::protocol::section::Section;
use study_base::diagnostic::Fault;
use study_base::text::ModelId;

/// What is felt first in each trial, with its number.
#[derive(Debug)]
pub(super) enum RawStandard {
    /// A level of the family.
    Level(f64, f64),
    /// A realization.
    Model(ModelId, f64),
}

/// What is felt first, if anything is; nothing after a fault.
pub(super) fn standard(
    section: &mut Section<'_, '_>,
    has_family: bool,
) -> Option<Option<RawStandard>> {
    let (level, model) = (section.number("standard"), section.model_id("reference"));
    let modulus = section.number("modulus");
    let path = section.path();
    let fault = match (level, &model, modulus) {
        (_, Some(_), _) if has_family => {
            let what = format!("`{path}` has a `reference` and a family");
            ("reference", what, "the level is named by `standard`")
        }
        (Some(_), ..) if !has_family => {
            let what = format!("`{path}` has a `standard` without a family");
            ("standard", what, "the realization is named by `reference`")
        }
        (Some(_), _, None) => {
            let what = format!("`{path}` has a `standard` without its number");
            ("standard", what, "add it, such as modulus = 100")
        }
        (_, Some(_), None) => {
            let what = format!("`{path}` has a `reference` without its number");
            ("reference", what, "add it, such as modulus = 100")
        }
        (None, None, Some(_)) => {
            let what = format!("`{path}` does not say what has the number `modulus`");
            let hint = match has_family {
                true => "add the level, such as standard = 1.0",
                false => "add the realization, such as reference = \"passive\"",
            };
            ("modulus", what, hint)
        }
        (Some(level), _, Some(modulus)) => return Some(Some(RawStandard::Level(level, modulus))),
        (None, Some(_), Some(modulus)) => {
            return Some(model.map(|model| RawStandard::Model(model, modulus)));
        }
        (None, None, None) => return Some(None),
    };
    let (key, what, hint) = fault;
    section.fault_at(key, Fault::error(what).hint(hint));
    None
}
