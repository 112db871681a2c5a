//! Numbers that a controller program sends: checked against the declarations, and recorded whatever is wrong with
//! them.

use super::Session;
use super::phase::Phase;
use crate::outcome::{Event, Moment, SentFault, SentNumber};

impl Session {
    /// Records what a controller program sent, in a study that declares numbers of its device. `outside`: the device
    /// knows of no playback that they belong to. Nothing is recorded once the participant has dropped out.
    pub(super) fn device_numbers(
        &mut self,
        mut numbers: Vec<SentNumber>,
        outside: bool,
        at: Moment,
    ) {
        let is_declared = self.protocol.numbers_of_device().next().is_some();
        let goes_on = self.phase.under_way() && self.accepts_records().is_ok();
        if numbers.is_empty() || !is_declared || !goes_on {
            return;
        }
        let plays = matches!(self.phase, Phase::Playing { .. } | Phase::Stopping { .. });
        let open = self.history.open().filter(|_| plays && !outside);
        for place in 0..numbers.len() {
            let (before, rest) = numbers.split_at_mut(place);
            let Some(number) = rest.first_mut() else {
                continue;
            };
            let in_message = before.iter().any(|other| other.key == number.key);
            number.fault = match &open {
                _ if number.value.is_none() => Some(SentFault::NoNumber),
                None => Some(SentFault::OutsidePlayback),
                Some(open) => match number.declared_in(&self.protocol) {
                    Err(fault) => Some(fault),
                    Ok(()) => (in_message || open.attempt.was_sent(&number.key))
                        .then_some(SentFault::Twice),
                },
            };
        }
        let under_way = open.map(|open| (open.trial.trial, open.attempt.number));
        let (trial, attempt) = under_way.or(self.history.last_attempt()).unzip();
        let sent = Event::NumbersSent {
            trial,
            attempt,
            numbers,
        };
        self.record(sent, at);
    }
}
