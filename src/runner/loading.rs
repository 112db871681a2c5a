//! When a session is told that a table is loaded.

use super::Setup;
use std::collections::BTreeMap;
use std::time::Duration;
use study_base::limits::Limits;
use study_base::text::ModelId;
use study_device::Stimulus;

/// Every load takes one slot, so that its duration tells nothing about the realization: neither
/// the size of its table nor how the handle came to rest after the one before. Slots are
/// multiples of this time.
const STEP: Duration = Duration::from_millis(500);
/// Time for the handle to come to rest, and for a computer that is late.
const SPARE: Duration = Duration::from_millis(250);
/// One that takes longer is told at once: the session gives up at the end of its slot.
const LONGEST_LOAD: Duration = Duration::from_millis(4500);

/// The slot of every load of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Slot(Duration);

impl Slot {
    /// That of the realization of a study whose load takes longest.
    pub(super) fn planned(setup: &Setup, limits: &BTreeMap<ModelId, Limits>) -> Self {
        let rules = &setup.protocol.device;
        let allow_uncertified = rules.uncertified.as_ref().is_some_and(|u| u.play);
        let times = setup.models.iter().filter_map(|(id, table)| {
            let stimulus = Stimulus {
                allow_uncertified,
                ..Stimulus::of_table(table)
            };
            let limits = limits.get(id).copied().unwrap_or(rules.limits);
            setup.device.load_time(&stimulus, limits)
        });
        Self::for_loads_of(times.max())
    }

    /// For realizations whose loads take this long at most, if that is known: chosen before the
    /// first load, for all of them alike.
    fn for_loads_of(longest: Option<Duration>) -> Self {
        let longest = longest.unwrap_or_default();
        Self(steps(longest + longest / 4 + SPARE).min(LONGEST_LOAD))
    }

    /// When a load that began and has ended is told: at the end of its slot, or of the slot in which
    /// it ended. Later loads are not told later because of it: their time would tell of this one.
    pub(super) fn end(self, began: Duration, now: Duration) -> Duration {
        let took = now.saturating_sub(began);
        if took > LONGEST_LOAD {
            return now;
        }
        let slots = took.as_nanos().div_ceil(self.0.as_nanos()).max(1);
        began + self.0 * u32::try_from(slots).unwrap_or(u32::MAX)
    }
}

/// The first multiple of [`STEP`] that is not shorter, and not zero.
fn steps(time: Duration) -> Duration {
    let steps = time.as_nanos().div_ceil(STEP.as_nanos()).max(1);
    STEP * u32::try_from(steps).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use study_analysis::load;
    use study_device::link::memory::Pace;
    use study_device::virtual_device::{Options, VirtualDevice};
    use study_device::{Device as _, Report};
    use study_haptics::model::Realization;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn every_load_takes_the_slot_of_the_longest() {
        for (longest_ms, slot_ms) in [(0, 500), (200, 500), (201, 1000), (600, 1000), (9000, 4500)]
        {
            let slot = Slot::for_loads_of(Some(ms(longest_ms)));
            for took in [0, 1, 77, 499] {
                let told = slot.end(ms(7000), ms(7000 + took));
                assert_eq!(told, ms(7000 + slot_ms), "{longest_ms} {took}");
            }
        }
        assert_eq!(Slot::for_loads_of(None), Slot(STEP));
    }

    #[test]
    fn a_load_that_takes_longer_ends_with_a_slot_and_before_the_session_gives_up() {
        let slot = Slot::for_loads_of(None);
        let ends = [
            (0, 500),
            (500, 500),
            (501, 1000),
            (4499, 4500),
            (4501, 4501),
        ];
        for (took, told) in ends {
            assert_eq!(slot.end(ms(7000), ms(7000 + took)), ms(7000 + told));
        }
    }

    /// The time from a load to its report.
    fn took(device: &mut VirtualDevice, table: &Realization, now: &mut Duration) -> Duration {
        let began = *now;
        let limits = Limits::new(9.0, 1000.0).unwrap();
        let stimulus = Stimulus {
            allow_uncertified: true,
            ..Stimulus::of_table(table)
        };
        device.load(&stimulus, limits, began).unwrap();
        for _ in 0..1000 {
            *now += ms(10);
            if device.poll(*now).contains(&Report::Loaded) {
                return *now - began;
            }
        }
        panic!("{} was not loaded", table.id);
    }

    /// All realizations of each shipped protocol over every rate and adapter: each load is told
    /// after the same time. If one of n loads were told later, a realization with a share of 3/n
    /// of such loads would have been found with 95 %.
    fn loads_tell_nothing(at_least: usize) {
        let protocols = [
            "turn-signal",
            "turn-signal-extended",
            "turn-signal-passive",
            "knob",
            "keyboard",
        ];
        let mut loads = 0;
        let mut slots = BTreeMap::<Duration, usize>::new();
        for round in 0.. {
            for name in protocols {
                let path = format!("{}/protocols/{name}", env!("CARGO_MANIFEST_DIR"));
                let tables = load::load(Path::new(&path)).unwrap().tables();
                for baud in [115_200, 230_400, 460_800, 921_600] {
                    for adapter in [0, 1, 2, 4, 8, 16] {
                        let mut options = Options::seeded(round);
                        options.pace = Pace {
                            byte_time: Duration::from_secs(10) / baud,
                            adapter: ms(adapter),
                        };
                        // As docs/devices.md asks for such an adapter.
                        options.device.watchdog_ms = if adapter > 4 { 200 } else { 50 };
                        options.device.servo_hz = 1000.0;
                        let mut device = VirtualDevice::new(options);
                        let mut now = Duration::from_secs(3);
                        device.poll(now);
                        let limits = Limits::new(9.0, 1000.0).unwrap();
                        let times = tables.values().filter_map(|table| {
                            let stimulus = Stimulus {
                                allow_uncertified: true,
                                ..Stimulus::of_table(table)
                            };
                            device.load_time(&stimulus, limits)
                        });
                        let slot = Slot::for_loads_of(times.max());
                        for table in tables.values() {
                            let took = took(&mut device, table, &mut now);
                            let told = slot.end(ms(0), took);
                            let what = format!("{name} {} {baud} baud, {adapter} ms", table.id);
                            assert_eq!(Slot(told), slot, "{what}: {took:?}");
                            loads += 1;
                        }
                        *slots.entry(slot.0).or_default() += 1;
                    }
                }
            }
            if loads >= at_least {
                break;
            }
        }
        assert!(slots.len() > 1, "{slots:?}");
    }

    #[test]
    fn the_time_of_a_load_tells_nothing_on_any_line() {
        loads_tell_nothing(1);
    }

    #[test]
    #[ignore = "takes minutes"]
    fn the_time_of_ten_thousand_loads_tells_nothing_on_any_line() {
        loads_tell_nothing(10_000);
    }
}
