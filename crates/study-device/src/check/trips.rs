//! Round trips of a device that stays limp.

use super::exchange::Exchange;
use super::{CheckFailure, Connection};
use std::time::Duration;
use study_wire::message::{Identity, Request};

/// Bytes of the frames of STATE and OUTCOME.
const STATE_BYTES: usize = 113;
/// Longest time from a request to its reply, ms (11.1).
pub const REPLY_MS: f64 = 2.0;
/// What an adapter or a USB port adds in both directions, ms: at most two frames of 1 ms each
/// way.
pub const ADAPTER_MS: f64 = 4.0;

/// Round trips to a device, and what they are compared with.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundTrips {
    /// Its identification.
    pub device: Identity,
    /// Time of each round trip in their order, ms.
    pub trips_ms: Vec<f64>,
    /// What the bytes of one take on the line, ms; 0 where the line has no rate.
    pub line_ms: f64,
}

/// The longest time that 99 % of the round trips may take, ms: a third of the watchdog time.
pub fn longest_ms(watchdog_ms: u16) -> f64 {
    f64::from(watchdog_ms) / 3.0
}

/// Identifies a device and measures at most `count` round trips within `within`. It sends LIMP,
/// HELLO and STATE alone, so that the device has no force from the first message on.
///
/// # Errors
/// As [`super::identify`], and if the device no longer answers.
pub fn round_trips(
    connection: &mut dyn Connection,
    nonce: u32,
    count: usize,
    within: Duration,
) -> Result<RoundTrips, CheckFailure> {
    let mut exchange = Exchange::new(connection, nonce);
    let device = exchange.identify()?;
    let until = exchange.now() + within;
    let trips_ms = of_state(&mut exchange, count, Some(until))?;
    let line_ms = line_ms(&exchange);
    exchange.limp()?;
    Ok(RoundTrips {
        device,
        trips_ms,
        line_ms,
    })
}

/// Times of STATE and its answer, ms; fewer if it takes longer than `until`.
pub(super) fn of_state(
    exchange: &mut Exchange<'_>,
    count: usize,
    until: Option<Duration>,
) -> Result<Vec<f64>, CheckFailure> {
    let mut trips = Vec::with_capacity(count);
    while trips.len() < count {
        let sent = exchange.now();
        if until.is_some_and(|until| sent >= until) {
            break;
        }
        let received = exchange.ask(Request::State)?;
        trips.push(received.at.saturating_sub(sent).as_secs_f64() * 1e3);
    }
    Ok(trips)
}

/// What the bytes of a round trip of STATE take on the line, ms.
pub(super) fn line_ms(exchange: &Exchange<'_>) -> f64 {
    1e3 * exchange.line_time(STATE_BYTES).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::{Firmware, Options};
    use crate::link::LinkError;
    use study_wire::frame::Decoder;
    use study_wire::message::{DeviceState, Reply, kind};

    /// A device in virtual time, whose answers take 3 ms, and the messages that it was sent.
    struct Bench {
        firmware: Firmware,
        now: Duration,
        sent: Vec<u8>,
        states: Vec<DeviceState>,
        to_device: Decoder,
        to_host: Decoder,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                firmware: Firmware::new(Options::default()),
                now: Duration::ZERO,
                sent: Vec::new(),
                states: Vec::new(),
                to_device: Decoder::new(),
                to_host: Decoder::new(),
            }
        }
    }

    impl Connection for Bench {
        fn now(&mut self) -> Duration {
            self.now
        }

        fn exchange(&mut self, bytes: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError> {
            for byte in bytes {
                if let Some(Ok(body)) = self.to_device.push(*byte) {
                    self.sent.push(body[1]);
                }
            }
            self.firmware.receive(bytes, self.now);
            self.now += match bytes.is_empty() {
                true => wait,
                false => Duration::from_millis(3),
            };
            self.firmware.advance(self.now);
            let out = self.firmware.take_output();
            for byte in &out {
                if let Some(Ok(body)) = self.to_host.push(*byte)
                    && let Ok((_, Reply::Outcome(outcome))) = Reply::decode(body)
                {
                    self.states.push(outcome.state);
                }
            }
            Ok(out)
        }

        fn byte_time(&self) -> Duration {
            Duration::from_micros(20)
        }
    }

    #[test]
    fn round_trips_are_measured_and_the_device_stays_limp() {
        let mut bench = Bench::new();
        let found = round_trips(&mut bench, 7, 50, Duration::from_secs(5)).unwrap();
        assert_eq!(found.device.watchdog_ms, 30);
        assert_eq!(found.trips_ms.len(), 50);
        assert!(found.trips_ms.iter().all(|ms| (ms - 3.0).abs() < 1e-9));
        // 113 bytes of 20 µs
        assert!((found.line_ms - 2.26).abs() < 1e-9, "{}", found.line_ms);
        let allowed = [kind::LIMP, kind::HELLO, kind::STATE];
        let sent = &bench.sent;
        assert!(sent.iter().all(|kind| allowed.contains(kind)), "{sent:?}");
        assert_eq!(sent.last(), Some(&kind::LIMP));
        assert_eq!(bench.states.len(), 50);
        assert!(bench.states.iter().all(|state| *state == DeviceState::Limp));
    }

    #[test]
    fn a_slow_line_is_not_waited_for() {
        let found = round_trips(&mut Bench::new(), 7, 1000, Duration::from_millis(100)).unwrap();
        assert_eq!(found.trips_ms.len(), 34);
    }
}
