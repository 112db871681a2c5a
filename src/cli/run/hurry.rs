//! Sessions that go faster than a clock, for tests of the program.
//!
//! A session on the simulated device is always a pilot's: nobody feels anything. Any other
//! device refuses to be hurried.

use crate::cli::Failure;
use study_plan::protocol::DeviceKind;

/// How many times as fast the session goes.
pub(super) const VARIABLE: &str = "STUDY_TEST_HURRY";
const MOST: u32 = 50;

/// How many times as fast the session goes: 1 unless the variable is set.
pub(super) fn hurry(value: Option<String>, kind: DeviceKind) -> Result<u32, Failure> {
    let Some(value) = value else {
        return Ok(1);
    };
    let hint = format!("unset {VARIABLE}: it is for tests of the program only");
    if kind != DeviceKind::Simulated {
        let what = format!("{VARIABLE} does not apply to a {} device", kind.as_str());
        return Err(Failure::usage(what).hint(hint));
    }
    let times = value
        .parse()
        .ok()
        .filter(|times| (1..=MOST).contains(times));
    let what = || format!("{VARIABLE} is a whole number from 1 to {MOST}");
    times.ok_or_else(|| Failure::usage(what()).hint(hint))
}

/// What the session's first event says instead of the device's last check.
pub(super) fn mark(times: u32) -> String {
    format!("none: the clock went {times} times as fast as a real one ({VARIABLE})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_simulated_device_is_hurried() {
        let hurried = |value: &str, kind| hurry(Some(value.to_owned()), kind).ok();
        assert_eq!(hurry(None, DeviceKind::Serial).ok(), Some(1));
        assert_eq!(hurried("10", DeviceKind::Simulated), Some(10));
        for kind in [DeviceKind::Serial, DeviceKind::Process, DeviceKind::Manual] {
            assert_eq!(hurried("10", kind), None, "{kind:?}");
            assert_eq!(hurried("1", kind), None, "{kind:?}");
        }
        for value in ["", "0", "51", "-1", "1.5", "fast"] {
            assert_eq!(hurried(value, DeviceKind::Simulated), None, "{value}");
        }
    }
}
