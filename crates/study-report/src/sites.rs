//! The sites of a pooled analysis and their devices, side by side.

use super::{Site, SiteDevice};
use study_base::text::counted;

/// What a device was tested for before its sessions.
pub(super) fn check(device: &SiteDevice) -> String {
    match &device.check {
        None => "no commissioning test recorded".to_owned(),
        Some((check, None)) => check.clone(),
        Some((check, Some(days))) => {
            let days = counted(usize::try_from(*days).unwrap_or(0), "day", "days");
            format!("{check} ({days} before the last session)")
        }
    }
}

/// A sentence for each site.
pub(super) fn sentences(sites: &[Site]) -> Vec<String> {
    let device = |d: &SiteDevice| {
        let sessions = counted(d.sessions, "session", "sessions");
        format!("{} {} ({sessions}; {})", d.kind, d.id, check(d))
    };
    (sites.iter())
        .map(|site| {
            let devices: Vec<String> = site.devices.iter().map(device).collect();
            let devices = match devices.is_empty() {
                true => "no device recorded".to_owned(),
                false => devices.join("; "),
            };
            format!(
                "{}: {}{}; {devices}.",
                site.name,
                counted(site.participants, "participant", "participants"),
                days(site)
            )
        })
        .collect()
}

/// `, 2026-01-03 to 2026-02-01`.
pub(super) fn days(site: &Site) -> String {
    match &site.days {
        Some((first, last)) if first == last => format!(", {first}"),
        Some((first, last)) => format!(", {first} to {last}"),
        None => String::new(),
    }
}
