//! Speed and acceleration from an encoder alone, and rotary devices.
//!
//! Everything beyond this module is in mm and N at the handle. A rotary device converts at
//! its sensors and at its motor with a [`Lever`].

use crate::predict::Motion;
use crate::real::Real;

/// Speed and acceleration from the positions of an encoder.
///
/// The speed is the difference of two positions through a low-pass with one pole, the
/// acceleration the difference of two speeds. Let the device say so in
/// [`Features::acceleration_from_speed`](crate::message::Features), so that a host can
/// compute the acceleration from TELEMETRY.
#[derive(Debug, Clone, Copy)]
pub struct Estimator<R = f64> {
    servo_hz: R,
    /// Weight of the newest difference.
    weight: R,
    x_mm: Option<R>,
    v_mm_s: R,
}

impl<R: Real> Estimator<R> {
    /// An estimator whose speed has the corner frequency `speed_hz`, for `servo_hz` periods
    /// a second. 200 Hz suit an encoder of a few µm at 4 kHz.
    pub fn new(speed_hz: f64, servo_hz: f64) -> Self {
        let decay = libm::exp(-core::f64::consts::TAU * speed_hz / servo_hz);
        Self {
            servo_hz: R::of(servo_hz),
            weight: R::of(1.0 - decay),
            x_mm: None,
            v_mm_s: R::ZERO,
        }
    }

    /// The motion in this period, at rest in the first one.
    pub fn step(&mut self, x_mm: R) -> Motion<R> {
        let difference = (x_mm - self.x_mm.unwrap_or(x_mm)) * self.servo_hz;
        let before = self.v_mm_s;
        self.v_mm_s += self.weight * (difference - before);
        self.x_mm = Some(x_mm);
        Motion {
            x_mm,
            v_mm_s: self.v_mm_s,
            a_m_s2: (self.v_mm_s - before) * self.servo_hz * R::of(1e-3),
        }
    }
}

/// A handle that turns about an axis: x is the length of the arc at the lever arm.
///
/// ```
/// # use study_wire::estimate::Lever;
/// let lever = Lever { arm_mm: 50.0 };
/// assert_eq!(lever.mm(0.5), 25.0);
/// assert_eq!(lever.torque_n_m(4.0), 0.2);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lever {
    /// Distance of the hand from the axis, mm.
    pub arm_mm: f64,
}

impl Lever {
    /// Position, mm, of an angle, rad; also mm/s of rad/s.
    pub fn mm<R: Real>(&self, rad: R) -> R {
        R::of(self.arm_mm) * rad
    }

    /// Torque, N·m, of a force at the handle, N.
    pub fn torque_n_m<R: Real>(&self, force_n: R) -> R {
        R::of(self.arm_mm * 1e-3) * force_n
    }

    /// Force at the handle, N, of a torque, N·m.
    pub fn force_n<R: Real>(&self, torque_n_m: R) -> R {
        torque_n_m / R::of(self.arm_mm * 1e-3)
    }

    /// Mass at the handle, kg, of an inertia, kg·m².
    pub fn mass_kg(&self, inertia_kg_m2: f64) -> f64 {
        let arm_m = self.arm_mm * 1e-3;
        inertia_kg_m2 / (arm_m * arm_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 15 ± 10 mm at 1.5 Hz, in steps of 1 µm: the speed within its lag of 0.8 ms, the
    /// acceleration through the servo's filter within that filter's lag.
    #[test]
    fn speed_and_acceleration_follow_a_sine_of_encoder_counts() {
        let (hz, omega) = (4000.0, core::f64::consts::TAU * 1.5);
        let mut estimator = Estimator::<f64>::new(200.0, hz);
        let [mut worst_v, mut worst_a] = [0.0_f64; 2];
        // a mean over 20 ms stands for the filter of 20 Hz
        let mut a = [0.0; 80];
        for i in 0..8000 {
            let phase = omega * f64::from(i) / hz;
            let x_mm = 15.0 + 10.0 * libm::sin(phase);
            let motion = estimator.step(libm::round(x_mm / 0.001) * 0.001);
            a[i as usize % 80] = motion.a_m_s2;
            if i > 800 {
                let v = 10.0 * omega * libm::cos(phase - omega * 0.8e-3);
                worst_v = worst_v.max((motion.v_mm_s - v).abs());
                let late = phase - omega * (0.8e-3 + 0.010);
                let expected = -10e-3 * omega * omega * libm::sin(late);
                let mean = a.iter().sum::<f64>() / 80.0;
                worst_a = worst_a.max((mean - expected).abs());
            }
        }
        // one step of the encoder in a period is 4 mm/s
        assert!(worst_v < 1.2, "{worst_v} mm/s of 94");
        assert!(worst_a < 0.1, "{worst_a} m/s² of 0.9");
    }

    #[test]
    fn the_first_position_is_at_rest() {
        let mut estimator = Estimator::<f32>::new(200.0, 4000.0);
        assert_eq!(estimator.step(17.5), Motion::at_rest(17.5));
        assert_eq!(estimator.step(17.5), Motion::at_rest(17.5));
    }

    /// A knob of 40 mm with 20 g at its rim: the power is the same on both sides.
    #[test]
    fn a_lever_keeps_power_and_energy() {
        let lever = Lever { arm_mm: 20.0 };
        let (torque_n_m, rad_s) = (0.05, 3.0);
        let power_w = torque_n_m * rad_s;
        let at_handle = lever.force_n(torque_n_m) * lever.mm(rad_s) * 1e-3;
        assert!((power_w - at_handle).abs() < 1e-12);
        assert_eq!(lever.torque_n_m(lever.force_n(0.05)), 0.05);
        let inertia_kg_m2 = 8e-6;
        let kinetic_j = 0.5 * inertia_kg_m2 * rad_s * rad_s;
        let v_m_s = lever.mm(rad_s) * 1e-3;
        let at_handle_j = 0.5 * lever.mass_kg(inertia_kg_m2) * v_m_s * v_m_s;
        assert!((kinetic_j - at_handle_j).abs() < 1e-15);
        assert!((lever.mass_kg(inertia_kg_m2) - 0.02).abs() < 1e-15);
    }
}
