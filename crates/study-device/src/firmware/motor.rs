//! A motor that is weak or late.

use std::collections::VecDeque;

/// What a motor makes of a commanded force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Force over commanded force.
    pub gain: f64,
    /// How late the force comes, s.
    pub lag_s: f64,
}

impl Default for Motor {
    /// A right motor.
    fn default() -> Self {
        Self {
            gain: 1.0,
            lag_s: 0.0,
        }
    }
}

/// A motor and the forces that it has not given yet.
#[derive(Debug)]
pub(super) struct Pending {
    motor: Motor,
    late_n: VecDeque<f64>,
    periods: usize,
}

impl Pending {
    pub(super) fn new(motor: Motor, servo_hz: f64) -> Self {
        Self {
            motor,
            late_n: VecDeque::new(),
            periods: (motor.lag_s * servo_hz).round() as usize,
        }
    }

    /// The force of a servo period in which this one is commanded, N.
    pub(super) fn give(&mut self, command_n: f64) -> f64 {
        self.late_n.push_back(command_n);
        let due = self.late_n.len() > self.periods;
        let given = if due { self.late_n.pop_front() } else { None };
        self.motor.gain * given.unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_and_weak_motor_gives_half_of_an_earlier_command() {
        let motor = Motor {
            gain: 0.5,
            lag_s: 0.002,
        };
        let mut pending = Pending::new(motor, 1000.0);
        let given: Vec<f64> = [1.0, 2.0, 3.0, 4.0].map(|n| pending.give(n)).to_vec();
        assert_eq!(given, [0.0, 0.0, 0.5, 1.0]);
        let mut right = Pending::new(Motor::default(), 1000.0);
        assert_eq!(right.give(3.0), 3.0);
    }
}
