//! Realizations that a device would refuse.

use crate::cli::Failure;
use study_analysis::load;
use study_device::Identity;
use study_plan::protocol::DeviceKind;

/// Refuses, before anything is recorded, a study with realizations that the device would
/// refuse: mechanisms where it plays tables only, and what is stiffer than it renders.
pub(super) fn refuse_unrendered(
    device: &Identity,
    kind: DeviceKind,
    loaded: &load::Loaded,
) -> Result<(), Failure> {
    if kind == DeviceKind::Manual {
        return Ok(());
    }
    let protocol = &loaded.protocol;
    let permitted = protocol.device.uncertified.as_ref().is_some_and(|u| u.play);
    for model in protocol.models.iter().filter(|m| m.device.is_none()) {
        let Some(table) = loaded.models.get(&model.id) else {
            continue;
        };
        if table.mechanism.is_some() && !device.mechanisms {
            return Err(Failure::device(format!(
                "realization `{}` is a mechanism, and the device `{}` plays tables only",
                model.id, device.id
            ))
            .hint("a serial device needs minor version 2 of docs/wire.md, a program `\"mechanisms\": true` in its hello; or take the realization out of the protocol"));
        }
        if table.elements.is_some() && !device.elements {
            let (id, device) = (&model.id, &device.id);
            return Err(Failure::device(format!("realization `{id}` is made of elements, which the device `{device}` does not play"))
                .hint("a serial device needs the feature `elements` of docs/wire.md, minor version 2; or identify it as a table: --method passive"));
        }
        let [low, high] = table.trained.x_mm;
        if let Some([least, most]) = device
            .stroke_mm
            .filter(|[least, most]| low < *least || high > *most)
        {
            return Err(Failure::device(format!(
                "realization `{}` ranges from {low} to {high} mm, and the stroke of the device `{}` from {least} to {most} mm",
                model.id, device.id
            ))
            .hint("move the origin of the recordings, or use a device with a longer stroke"));
        }
        let certificate = table.certificate();
        // as the device judges it: from minor version 1 on with the direction state
        let asked = match device.servo {
            Some(_) => certificate.rendered_n_per_mm(),
            None => certificate.stiffness_n_per_mm,
        };
        if let Some(most) = device.stiffness_n_per_mm.filter(|most| asked > *most)
            && !permitted
        {
            return Err(Failure::device(format!(
                "realization `{}` has a stiffness of {asked:.1} N/mm, direction state included, and the device `{}` renders at most {most:.1} N/mm",
                model.id, device.id
            ))
            .hint("identify it with a longer --delta or a smaller friction, or permit it: uncertified = { play = true, … }"));
        }
    }
    Ok(())
}
