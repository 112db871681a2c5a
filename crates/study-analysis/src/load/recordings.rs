//! The validation recording beside a protocol, for the VAF of what is delivered.
//!
//! `[analysis] vaf` names it, and the file is `NAME.csv` in the folder of the protocol. It
//! need not be there, and no session depends on it.

use super::Loaded;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use study_base::text::ModelId;
use study_haptics::identify::delivery::Delivery;
use study_haptics::identify::vaf;
use study_haptics::recording::{self, RecordingError as ReadingError};
use study_session::store::disk;

/// Largest difference of the VAF in a model file and that of the recording.
const SAME_VAF: f64 = 1e-6;

/// A validation recording that is there but cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened.
    #[error("{}: {}", .path.display(), study_session::store::plain(.source))]
    File {
        /// Path of the recording.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// It is no recording.
    #[error(transparent)]
    Content(#[from] ReadingError),
}

/// What is needed to say which VAF a playback delivered, for each realization that was
/// validated with the recording; and why others have none although it is there.
pub type Deliveries = (BTreeMap<ModelId, Delivery>, Vec<String>);

/// The [`Deliveries`] of a protocol.
///
/// # Errors
/// [`RecordingError`] if the file is there but cannot be read.
pub fn deliveries(loaded: &Loaded) -> Result<Deliveries, RecordingError> {
    let (mut all, mut notices) = (BTreeMap::new(), Vec::new());
    let Some(name) = loaded.protocol.analysis.vaf.as_deref() else {
        return Ok((all, notices));
    };
    let path = loaded.folder.join(format!("{name}.csv"));
    // The name is text: it must not lead out of the folder.
    if name.contains(['/', '\\']) || !path.is_file() {
        return Ok((all, notices));
    }
    let file = match disk::reader(&path) {
        Ok(file) => file,
        Err(source) => return Err(RecordingError::File { path, source }),
    };
    let recording = recording::read(name, file)?;
    let recorded_n: Arc<[f64]> = recording.f_n.clone().into();
    for (id, model) in &loaded.models {
        let (Some(hash), Some(stated)) =
            (model.provenance.recordings.get(name), model.vaf.get(name))
        else {
            continue;
        };
        let shown = path.display();
        if *hash != recording.sha256 {
            notices.push(format!(
                "{id}: {shown} is not the recording that its model file names: no delivered VAF"
            ));
        } else if (vaf::score(model, &recording).vaf - stated).abs() > SAME_VAF {
            notices.push(format!(
                "{id}: {shown} gives another VAF than its model file, which was validated with a filter{}: \
                 no delivered VAF",
                match model.elements {
                    Some(_) => ", or before springs that relax were estimated at the first sample",
                    None => "",
                }
            ));
        } else if let Some(delivery) = Delivery::of(model, &recording, &recorded_n) {
            all.insert(id.clone(), delivery);
        }
    }
    Ok((all, notices))
}
