//! Whether a playback had the force of its table.

use super::Runner;
use study_device::rendering_of;
use study_session::outcome::{Fidelity, Playback, Verdict};
use study_session::rendering::{Played, judge};
use study_wire::servo::ServoSettings;

impl Runner {
    /// Whether the force of the playback that has just ended was that of its table.
    pub(super) fn judge(&self, playback: &Playback) -> Fidelity {
        let (protocol, device) = (&self.setup.protocol, self.setup.device.identity());
        let Some(model) = self.session.playing_model() else {
            return Fidelity::default();
        };
        if !self.has_telemetry {
            return Fidelity::unverified("the device reports no samples");
        }
        let Some(table) = self.setup.models.get(model) else {
            return Fidelity::unverified("the realization has no table");
        };
        let limits = self.limits.get(model).copied();
        let limits = limits.unwrap_or(protocol.device.limits);
        let limits = limits.capped_at(device.limits);
        let others: Vec<_> = (self.setup.models.iter())
            .filter(|(id, _)| *id != model)
            .map(|(id, table)| (id.clone(), rendering_of(table)))
            .collect();
        let played = Played {
            model,
            what: rendering_of(table),
            servo: ServoSettings {
                force_n: limits.force_n.get(),
                ..device.servo.unwrap_or_default()
            },
            servo_told: device.servo.is_some(),
            samples: &self.samples,
            numbered: device.numbered,
            lost: playback.samples_lost,
            faded_from_s: self.faded_from_s,
            time_ratio: playback.time_ratio,
            host_late_s: playback.host_late_ms.map(|[_, most]| 1e-3 * most),
            others: &others,
        };
        let mut fidelity = judge(&played, &protocol.device.rendering);
        let delivery = self.setup.deliveries.get(model);
        fidelity.delivered_vaf = delivery
            .filter(|_| matches!(fidelity.verdict, Verdict::Ok | Verdict::Flag))
            .and_then(|own| own.vaf(fidelity.felt_gain()?, 1e-3 * fidelity.rendered_delay_ms?));
        if self.only_flags {
            fidelity.only_flag("the study was begun with an earlier release");
        }
        fidelity
    }
}
