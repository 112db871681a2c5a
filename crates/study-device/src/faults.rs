//! Injected faults of the simulated device.
//!
//! Real devices trip, lose a playback or their cable from time to time. To test how a
//! session reacts, the simulated device has such faults at planned or random loads.

use std::collections::BTreeMap;
use study_base::rng::Stream;

/// A fault during one load and its playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InjectedFault {
    /// The table is refused.
    RefuseLoad,
    /// The playback ends in a trip.
    Trip,
    /// The device stops answering during the playback and does not confirm a stop.
    LosePlayback,
    /// The cable is unplugged during the playback and plugged in again later.
    Unplug,
}

/// Which loads have which fault; by default none.
#[derive(Debug, Default)]
pub struct FaultPlan {
    named: BTreeMap<u32, InjectedFault>,
    random: Option<(Stream, f64)>,
}

/// A fault and its time after the start of the playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlannedFault {
    pub(super) fault: InjectedFault,
    pub(super) after_s: f64,
}

impl FaultPlan {
    /// Adds a fault at load number `load`, from 1; faults of the playback occur half a
    /// second after its start.
    #[must_use]
    pub fn with(mut self, load: u32, fault: InjectedFault) -> Self {
        self.named.insert(load, fault);
        self
    }

    /// Each load has a fault with this probability, each of the four equally often, 0.2
    /// to 2 s after the start of the playback.
    pub fn random(seed: u64, probability: f64) -> Self {
        Self {
            named: BTreeMap::new(),
            random: Some((Stream::new(seed, &["device", "faults"]), probability)),
        }
    }

    /// The fault of load number `load`. Call it once for each load, in order.
    pub(super) fn for_load(&mut self, load: u32) -> Option<PlannedFault> {
        if let Some(fault) = self.named.get(&load) {
            return Some(PlannedFault {
                fault: *fault,
                after_s: 0.5,
            });
        }
        let (stream, probability) = self.random.as_mut()?;
        // Always three draws, so that a fault does not change the later ones.
        let occurs = stream.unit() < *probability;
        let fault = [
            InjectedFault::RefuseLoad,
            InjectedFault::Trip,
            InjectedFault::LosePlayback,
            InjectedFault::Unplug,
        ][usize::try_from(stream.below(4)).expect("below 4")];
        let after_s = 0.2 + 1.8 * stream.unit();
        occurs.then_some(PlannedFault { fault, after_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planned_fault_affects_only_its_load() {
        let mut plan = FaultPlan::default().with(2, InjectedFault::Trip);
        assert_eq!(plan.for_load(1), None);
        assert_eq!(plan.for_load(2).map(|f| f.fault), Some(InjectedFault::Trip));
        assert_eq!(plan.for_load(3), None);
    }

    #[test]
    fn a_random_plan_has_the_requested_frequency_and_is_reproducible() {
        let count = |seed| {
            let mut plan = FaultPlan::random(seed, 0.1);
            (1..=2000).filter(|n| plan.for_load(*n).is_some()).count()
        };
        assert!((140..260).contains(&count(1)), "{}", count(1));
        assert_eq!(count(1), count(1));
        let mut never = FaultPlan::random(1, 0.0);
        assert!((1..100).all(|n| never.for_load(n).is_none()));
    }
}
