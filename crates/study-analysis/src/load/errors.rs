//! The errors of the realizations of a study against a recording of the real thing.

use super::Loaded;
use rayon::prelude::*;
use std::collections::BTreeMap;
use study_base::text::ModelId;
use study_haptics::identify::perceptual::{Component, Reference};
use study_haptics::model::Realization;
use study_haptics::recording::Recording;

/// The names of the components of an error, and by realization one number for each.
pub type ComponentErrors = (Vec<&'static str>, BTreeMap<String, Vec<f64>>);

impl Loaded {
    /// The errors of every realization with a table on a recording, in components: shares of the variance of its force that add
    /// up to 1 − VAF. `None` if the recording cannot be divided into components.
    pub fn errors(&self, recording: &Recording) -> Option<ComponentErrors> {
        let reference = Reference::of(recording)?;
        let tables: Vec<(&ModelId, &Realization)> =
            self.models.iter().chain(&self.levels).collect();
        let of = (tables.into_par_iter())
            .filter_map(|(id, table)| {
                let errors = reference.errors(table)?;
                Some((id.as_str().to_owned(), errors.to_vec()))
            })
            .collect();
        Some((Component::ALL.map(Component::as_str).to_vec(), of))
    }
}
