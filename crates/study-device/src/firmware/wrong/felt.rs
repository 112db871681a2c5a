//! Motors that do not give the force that telemetry reports, with a force sensor that shows it.

use super::Wrong;

/// The force of a motor over the samples of a playback.
#[derive(Debug, Clone, Default)]
pub(super) struct Felt {
    /// Time of the last sample, s.
    before_s: Option<f64>,
    /// Force of the motor, N: of a filter, of a transmission with play, or that was held.
    force_n: f64,
    /// Heat of the winding, N²·s, of which it loses a third in a second.
    heat_n2_s: f64,
    /// Sign of the speed, and when it changed, s.
    side: f64,
    turned_s: f64,
}

impl Felt {
    /// What the sensor measures of a force that is commanded at this time and speed, N; `None` for
    /// a device without a sensor.
    pub(super) fn measured_n(
        &mut self,
        wrong: Wrong,
        t_s: f64,
        v_mm_s: f64,
        command_n: f64,
    ) -> Option<f64> {
        let dt_s = self.before_s.map_or(0.0, |before| t_s - before);
        self.before_s = Some(t_s);
        if v_mm_s * self.side < 0.0 || self.side == 0.0 {
            (self.side, self.turned_s) = (v_mm_s.signum(), t_s);
        }
        let low_passed = |from_n: f64, hz: f64| {
            let share = 1.0 - (-std::f64::consts::TAU * hz * dt_s).exp();
            from_n + share * (command_n - from_n)
        };
        self.force_n = match wrong {
            Wrong::LimpSensor => 0.0,
            Wrong::ReversedSensor => -command_n,
            Wrong::HalfSensor => 0.5 * command_n,
            Wrong::StuckSensor => 3.0,
            Wrong::LimpMoments if t_s.fract() > 0.95 => 0.0,
            Wrong::LimpEnd if t_s > 3.3 => 0.0,
            Wrong::LimpMoments | Wrong::LimpEnd => command_n,
            Wrong::Saturated => command_n.clamp(-3.0, 3.0),
            Wrong::Derated => {
                let lost = (-0.4 * dt_s).exp();
                self.heat_n2_s = lost * self.heat_n2_s + dt_s * command_n.powi(2);
                command_n * (1.0 - 0.05 * self.heat_n2_s).max(0.4)
            }
            Wrong::WeakLater => command_n * if t_s > 2.0 { 0.7 } else { 1.0 },
            Wrong::MotorBackwards if v_mm_s < 0.0 => 0.4 * command_n,
            Wrong::MotorBackwards => command_n,
            Wrong::DeadZone => command_n - command_n.clamp(-0.9, 0.9),
            Wrong::CoarseMotor => (command_n / 2.0).round() * 2.0,
            Wrong::LowPass5 => low_passed(self.force_n, 5.0),
            Wrong::LowPass20 => low_passed(self.force_n, 20.0),
            Wrong::LowPass50 => low_passed(self.force_n, 50.0),
            Wrong::TurnsLate if t_s - self.turned_s < 0.12 && self.turned_s > 0.0 => self.force_n,
            Wrong::TurnsLate => command_n,
            Wrong::Drifting => command_n + 0.4 * t_s,
            Wrong::SlackTransmission => self.force_n.clamp(command_n - 0.9, command_n + 0.9),
            Wrong::MotorHums => command_n + hum_n(t_s),
            Wrong::MotorTicks => command_n + tick_n(t_s),
            _ => return None,
        };
        Some(self.force_n)
    }
}

/// A vibration of 250 Hz and 0.3 N; a telemetry of 1 kHz has its peaks.
pub(super) fn hum_n(t_s: f64) -> f64 {
    0.3 * (std::f64::consts::TAU * 250.0 * t_s + 0.7).sin()
}

/// 4 N for a millisecond, three times in a second.
pub(super) fn tick_n(t_s: f64) -> f64 {
    let since_s = (t_s + 0.1) % (1.0 / 3.0);
    if since_s < 0.001 { 4.0 } else { 0.0 }
}
