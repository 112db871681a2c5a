//! The validation recording beside a protocol, for the VAF of what is delivered.
//!
//! `[analysis] vaf` names it, and the file is `NAME.csv` in the folder of the protocol. It
//! need not be there, and no session depends on it.

use super::Loaded;
use crate::cli::Failure;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::sync::Arc;
use study_base::text::ModelId;
use study_haptics::identify::delivery::Delivery;
use study_haptics::identify::vaf;
use study_haptics::recording;

/// Largest difference of the VAF in a model file and that of the recording.
const SAME_VAF: f64 = 1e-6;

/// What is needed to say which VAF a playback delivered, for each realization that was
/// validated with the recording; and why others have none although it is there.
///
/// # Errors
/// [`Failure`] if the file is there but cannot be read.
pub fn deliveries(loaded: &Loaded) -> Result<(BTreeMap<ModelId, Delivery>, Vec<String>), Failure> {
    let (mut all, mut notices) = (BTreeMap::new(), Vec::new());
    let Some(name) = loaded.protocol.analysis.vaf.as_deref() else {
        return Ok((all, notices));
    };
    let path = loaded.folder.join(format!("{name}.csv"));
    // The name is text: it must not lead out of the folder.
    if name.contains(['/', '\\']) || !path.is_file() {
        return Ok((all, notices));
    }
    let file = File::open(&path).map_err(|e| Failure::file(&path, &e))?;
    let recording = recording::read(name, BufReader::new(file)).map_err(Failure::input)?;
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
                "{id}: {shown} gives another VAF than its model file, which was validated with a filter: \
                 no delivered VAF"
            ));
        } else if let Some(delivery) = Delivery::of(model, &recording, &recorded_n) {
            all.insert(id.clone(), delivery);
        }
    }
    Ok((all, notices))
}
