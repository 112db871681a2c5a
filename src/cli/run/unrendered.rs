//! Realizations, levels and points that a device would refuse.

use crate::cli::Failure;
use study_analysis::load::Loaded;
use study_base::text::ModelId;
use study_device::Identity;
use study_haptics::model::Realization;
use study_plan::protocol::{DeviceKind, FamilyRules, Protocol, SpaceRules};

/// Refuses, before anything is recorded, a study with something that the device would
/// refuse: mechanisms where it plays tables only, and what is stiffer or more damped than it
/// renders, or beyond its stroke. Every level of a family and every point of a space that can be
/// presented is held against it; of points the force as well, which the device would clip.
pub(super) fn refuse_unrendered(
    device: &Identity,
    kind: DeviceKind,
    loaded: &Loaded,
) -> Result<(), Failure> {
    if kind == DeviceKind::Manual {
        return Ok(());
    }
    let protocol = &loaded.protocol;
    for model in protocol.models.iter().filter(|m| m.device.is_none()) {
        let table = loaded.models.get(&model.id);
        if let Some(why) = table.and_then(|table| unrendered(device, table, permitted(protocol))) {
            let what = format!("realization `{}` {}", model.id, why.what);
            return Err(Failure::device(what).hint(why.hint));
        }
    }
    let families = protocol.families.iter();
    let spaces = protocol.spaces.iter();
    (families.filter_map(|family| of_family(device, loaded, family)))
        .chain(spaces.filter_map(|space| of_space(device, loaded, space)))
        .next()
        .map_or(Ok(()), Err)
}

/// Whether the protocol permits what fails its certificate or is too stiff.
fn permitted(protocol: &Protocol) -> bool {
    let uncertified = protocol.device.uncertified.as_ref();
    uncertified.is_some_and(|u| u.play)
}

/// Why a device would refuse a table: what comes after its name in a sentence.
struct Why {
    what: String,
    hint: &'static str,
}

fn unrendered(device: &Identity, table: &Realization, permitted: bool) -> Option<Why> {
    let name = &device.id;
    let why = |what: String, hint| Some(Why { what, hint });
    if table.mechanism.is_some() && !device.mechanisms {
        return why(
            format!("is a mechanism, and the device `{name}` plays tables only"),
            "a serial device needs minor version 2 of docs/wire.md, a program `\"mechanisms\": true` in its hello; or take the realization out of the protocol",
        );
    }
    if table.elements.is_some() && !device.elements {
        return why(
            format!("is made of elements, which the device `{name}` does not play"),
            "a serial device needs the feature `elements` of docs/wire.md, minor version 2; or identify it as a table: --method passive",
        );
    }
    let [low, high] = table.trained.x_mm;
    let beyond = |[least, most]: &[f64; 2]| low < *least || high > *most;
    if let Some([least, most]) = device.stroke_mm.filter(beyond) {
        return why(
            format!(
                "ranges from {low} to {high} mm, and the stroke of the device `{name}` from {least} to {most} mm"
            ),
            "move the origin of the recordings, or use a device with a longer stroke",
        );
    }
    if permitted {
        return None;
    }
    let certificate = table.certificate();
    // as the device judges it: from minor version 1 on with the direction state
    let asked = match device.servo {
        Some(_) => certificate.rendered_n_per_mm(),
        None => certificate.stiffness_n_per_mm,
    };
    if let Some(most) = device.stiffness_n_per_mm.filter(|most| asked > *most) {
        return why(
            format!(
                "has a stiffness of {asked:.1} N/mm, direction state included, and the device `{name}` renders at most {most:.1} N/mm"
            ),
            "identify it with a longer --delta or a smaller friction, or permit it: uncertified = { play = true, … }",
        );
    }
    let asked = certificate.damping_n_s_per_mm;
    if let Some(most) = device.damping_n_s_per_mm.filter(|most| asked > *most) {
        return why(
            format!(
                "has a damping of {asked:.3} N·s/mm, and the device `{name}` renders at most {most:.3} N·s/mm"
            ),
            "identify it with less damping, or permit it: uncertified = { play = true, … }",
        );
    }
    None
}

/// The failure of a family of which the device would refuse some levels.
fn of_family(device: &Identity, loaded: &Loaded, family: &FamilyRules) -> Option<Failure> {
    let tracks = loaded.protocol.tracks.iter();
    let own = tracks.filter(|track| track.family() == Some(&family.id));
    let standards = own.filter_map(|track| Some((track.standard(), track.standard_level()?)));
    let levels: Vec<(ModelId, f64)> = family.realizations().chain(standards).collect();
    let permitted = permitted(&loaded.protocol);
    let found = levels.iter().filter_map(|(id, level)| {
        let why = unrendered(device, loaded.levels.get(id)?, permitted)?;
        Some((format!("level {level}"), why))
    });
    let whole = format!("levels of the family `{}`", family.id);
    let what_next = "take a range that the device plays";
    several(found.collect(), levels.len(), &whole, what_next)
}

/// The failure of a space of which the device would refuse some points, or clip them. Nothing permits them.
fn of_space(device: &Identity, loaded: &Loaded, space: &SpaceRules) -> Option<Failure> {
    let limits = loaded.protocol.device.limits;
    let most_n = limits.capped_at(device.limits).force_n.get();
    let points = space.lattice.certified();
    let found = points.iter().filter_map(|point| {
        let id = space.realization(*point);
        let table = loaded.levels.get(&id)?;
        let why = unrendered(device, table, false).or_else(|| clipped(device, table, most_n))?;
        let axes = space.axes.iter().zip(space.levels(*point));
        let axes: Vec<String> = axes
            .map(|(axis, level)| format!("{} {level}", axis.vary.as_str()))
            .collect();
        Some((format!("`{id}` ({})", axes.join(", ")), why))
    });
    let whole = format!("points of the space `{}` that can be presented", space.id);
    let what_next = "take smaller ranges in `axes`, so that the device plays every point, or a device that does";
    several(found.collect(), points.len(), &whole, what_next)
}

/// A table that needs more force than the device gives.
fn clipped(device: &Identity, table: &Realization, most_n: f64) -> Option<Why> {
    let asked_n = table.strongest_n();
    (asked_n > most_n).then(|| Why {
        what: format!(
            "needs up to {asked_n:.2} N, and the device `{}` gives at most {most_n:.2} N",
            device.id
        ),
        hint: "",
    })
}

/// One failure for all: how many there are, the first of them, and what to do.
fn several(found: Vec<(String, Why)>, all: usize, whole: &str, what_next: &str) -> Option<Failure> {
    let (first, why) = found.first()?;
    let some = found.len();
    let what = format!(
        "the device refuses {some} of the {all} {whole}; the first, {first}, {}",
        why.what
    );
    Some(Failure::device(what).hint(what_next))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use study_analysis::load;
    use study_base::limits::Limits;
    use study_device::Device as _;
    use study_device::virtual_device::{Options, VirtualDevice};

    /// The template of a kind of study, with its family or space.
    fn template(text: &str) -> Loaded {
        let folder = tempfile::tempdir().unwrap();
        let table = "protocols/turn-signal-extended/models/static.toml";
        fs::create_dir(folder.path().join("models")).unwrap();
        fs::copy(table, folder.path().join("models/static.toml")).unwrap();
        fs::write(folder.path().join("protocol.toml"), text).unwrap();
        load::load(folder.path()).unwrap()
    }

    /// The simulated device, without limits that it would tell, and changed.
    fn device(change: impl Fn(&mut Identity)) -> Identity {
        let mut device = VirtualDevice::new(Options::seeded(1)).identity();
        device.stroke_mm = None;
        change(&mut device);
        device
    }

    fn said(device: &Identity, loaded: &Loaded) -> String {
        let refused = refuse_unrendered(device, DeviceKind::Serial, loaded).unwrap_err();
        format!("{} / {}", refused.message, refused.hint.unwrap())
    }

    #[test]
    fn every_point_is_held_against_the_device() {
        let loaded = template(include_str!("../new/search.toml"));
        let whole = device(|_| ());
        assert!(refuse_unrendered(&whole, DeviceKind::Serial, &loaded).is_ok());
        let manual = device(|d| d.stroke_mm = Some([0.0, 1.0]));
        assert!(refuse_unrendered(&manual, DeviceKind::Manual, &loaded).is_ok());
        // Every point has the positions of the table.
        let short = said(&manual, &loaded);
        let words = "the device refuses 81 of the 81 points of the space `switch` that can be presented; the first, `switch.1` (detent 0.4, friction 0), ranges from 1.53481 to 33.46519 mm";
        assert!(short.contains(words), "{short}");
        assert!(short.contains("smaller ranges in `axes`"), "{short}");
        // The stiffness grows with the detents.
        let space = &loaded.protocol.spaces[0];
        let stiffest = &loaded.levels[&space.realization(80)].certificate();
        let soft = device(|d| d.stiffness_n_per_mm = Some(0.999 * stiffest.stiffness_n_per_mm));
        let soft = said(&soft, &loaded);
        assert!(soft.contains("the device refuses 9 of the 81"), "{soft}");
        assert!(
            soft.contains("`switch.73` (detent 1.2, friction 0)"),
            "{soft}"
        );
        // And so does the force.
        let strongest_n = loaded.levels[&space.realization(80)].strongest_n();
        let weak = device(|d| d.limits = Limits::new(0.999 * strongest_n, 1000.0).unwrap());
        let weak = said(&weak, &loaded);
        assert!(weak.contains("the device refuses 1 of the 81"), "{weak}");
        assert!(
            weak.contains("`switch.81` (detent 1.2, friction 1.6), needs up to"),
            "{weak}"
        );
    }

    #[test]
    fn damping_and_levels_are_held_against_it_as_well() {
        let loaded = template(include_str!("../new/search.toml"));
        let mut table = loaded.levels[&loaded.protocol.spaces[0].realization(0)].clone();
        table.positive.b_n_s_per_mm.fill(0.05);
        let most = |most| device(|d| d.damping_n_s_per_mm = Some(most));
        assert!(unrendered(&most(0.06), &table, false).is_none());
        let why = unrendered(&most(0.04), &table, false).unwrap().what;
        assert!(why.contains("a damping of 0.050 N·s/mm"), "{why}");
        assert!(unrendered(&most(0.04), &table, true).is_none());
        let loaded = template(include_str!("../new/staircase.toml"));
        let short = said(&device(|d| d.stroke_mm = Some([5.0, 60.0])), &loaded);
        assert!(
            short.contains("levels of the family `friction`; the first, level 0.02,"),
            "{short}"
        );
        assert!(
            short.contains("take a range that the device plays"),
            "{short}"
        );
    }
}
