//! Faults that the simulated device is told to have.
//!
//! A real device trips, drops a playback or loses its cable now and then. So that
//! a session's answer to that can be tried out, the simulated one does it on
//! purpose, at the loads that a plan names or that a seed draws.

use std::collections::BTreeMap;
use study_base::rng::Stream;

/// What goes wrong with one load and its playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Injected {
    /// The table is refused.
    RefuseLoad,
    /// The playback ends in a trip.
    Trip,
    /// The device stops playing without a word and does not confirm a stop.
    LosePlayback,
    /// The cable comes out during the playback, and is put back.
    Unplug,
}

/// When which fault happens.
#[derive(Debug, Default)]
pub struct FaultPlan {
    named: BTreeMap<u32, Injected>,
    random: Option<(Stream, f64)>,
}

/// A fault, and how long after the start of the playback it happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fate {
    pub(super) fault: Injected,
    pub(super) after_s: f64,
}

impl FaultPlan {
    /// Nothing goes wrong.
    pub fn none() -> Self {
        Self::default()
    }

    /// Adds a fault at the `load`-th load (from 1) or half a second into its
    /// playback.
    #[must_use]
    pub fn with(mut self, load: u32, fault: Injected) -> Self {
        self.named.insert(load, fault);
        self
    }

    /// Each load has a fault with this probability, any of the four alike, 0.2 to
    /// 2 s into the playback.
    pub fn random(seed: u64, probability: f64) -> Self {
        Self {
            named: BTreeMap::new(),
            random: Some((Stream::new(seed, &["device", "faults"]), probability)),
        }
    }

    /// What happens to the `load`-th load. Asked once for each, in order.
    pub(super) fn fate(&mut self, load: u32) -> Option<Fate> {
        if let Some(fault) = self.named.get(&load) {
            return Some(Fate {
                fault: *fault,
                after_s: 0.5,
            });
        }
        let (stream, probability) = self.random.as_mut()?;
        // always three draws, so that a load's fate does not move the next one's
        let struck = stream.unit() < *probability;
        let fault = [
            Injected::RefuseLoad,
            Injected::Trip,
            Injected::LosePlayback,
            Injected::Unplug,
        ][usize::try_from(stream.below(4)).expect("below 4")];
        let after_s = 0.2 + 1.8 * stream.unit();
        struck.then_some(Fate { fault, after_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_fault_strikes_its_load_only() {
        let mut plan = FaultPlan::none().with(2, Injected::Trip);
        assert_eq!(plan.fate(1), None);
        assert_eq!(plan.fate(2).map(|f| f.fault), Some(Injected::Trip));
        assert_eq!(plan.fate(3), None);
    }

    #[test]
    fn a_random_plan_strikes_about_as_often_as_asked_and_the_same_again() {
        let strikes = |seed| {
            let mut plan = FaultPlan::random(seed, 0.1);
            (1..=2000).filter(|n| plan.fate(*n).is_some()).count()
        };
        assert!((140..260).contains(&strikes(1)), "{}", strikes(1));
        assert_eq!(strikes(1), strikes(1));
        let mut never = FaultPlan::random(1, 0.0);
        assert!((1..100).all(|n| never.fate(n).is_none()));
    }
}
