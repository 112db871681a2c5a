//! The simulated device as seen by the runner: its reports and their order, and no force
//! except during playback.

#![allow(clippy::unwrap_used)]

use crate::tables;
use proptest::prelude::*;
use std::time::Duration;
use study_base::limits::{Limit, Limits};
use study_device::faults::{FaultPlan, InjectedFault};
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError, Report, Stimulus};
use study_haptics::model::{Branch, Realization, Trained};
use study_session::outcome::{Playback, Sample};
use study_wire::predict::Direction;

/// A name and an action on a `T`.
type Case<'a, T> = (&'static str, &'a dyn Fn(&mut T));

fn limits(force_n: f64) -> Limits {
    Limits {
        force_n: Limit::new(force_n).unwrap(),
        velocity_mm_s: Limit::new(1000.0).unwrap(),
    }
}

/// Three detents of about 6 N with nodes 1 mm apart, a friction of 1 N and a constant mass
/// and damping.
fn detents(mass: f64, damping: f64, direction: Direction) -> Realization {
    tables::table(
        "detents",
        tables::fine(),
        [mass, damping, 0.0],
        |x_mm, side| 6.0 * tables::detent_n(x_mm) + side,
        direction,
    )
}

fn ordinary() -> Realization {
    detents(0.05, 0.01, tables::PLAY)
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Loads and starts. The playback begins at 32 ms, after 15 requests of 1 ms each for the
/// table and one for the start.
fn playing(options: Options, realization: &Realization) -> VirtualDevice {
    let mut device = VirtualDevice::new(options);
    device
        .load(&Stimulus::of_table(realization), limits(12.0), ms(0))
        .unwrap();
    assert_eq!(device.poll(ms(30)), [Report::Loaded]);
    device.start(ms(30)).unwrap();
    device
}

fn samples(reports: &[Report]) -> Vec<Sample> {
    let telemetry = reports.iter().filter_map(|report| match report {
        Report::Telemetry(samples) => Some(samples.clone()),
        _ => None,
    });
    telemetry.flatten().collect()
}

fn stopped(reports: &[Report]) -> Playback {
    let playback = reports.iter().find_map(|report| match report {
        Report::Stopped(playback) => Some(*playback),
        _ => None,
    });
    playback.expect("the device confirms the stop")
}

/// Plays for twelve seconds and stops.
fn played(realization: &Realization, seed: u64) -> (Playback, Vec<Sample>) {
    let options = Options::seeded(seed);
    let mut device = playing(options, realization);
    let mut reports = device.poll(ms(12_030));
    device.stop(ms(12_030)).unwrap();
    reports.extend(device.poll(ms(12_100)));
    (stopped(&reports), samples(&reports))
}

#[test]
fn a_start_is_confirmed_before_the_telemetry_and_a_stop_after_it() {
    let mut device = VirtualDevice::new(Options::default());
    assert_eq!(device.poll(ms(0)), []);
    device
        .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0))
        .unwrap();
    assert_eq!(device.poll(ms(10)), [], "not loaded yet");
    assert_eq!(device.poll(ms(30)), [Report::Loaded]);
    device.start(ms(30)).unwrap();
    let reports = device.poll(ms(5000));
    assert_eq!(reports[0], Report::Started);
    assert!(
        matches!(reports[1], Report::Telemetry(_)),
        "{:?}",
        reports[1]
    );
    device.stop(ms(6000)).unwrap();
    let reports = device.poll(ms(6020));
    assert!(matches!(reports.last(), Some(Report::Stopped(_))));
    assert_eq!(device.poll(ms(9000)), [], "nothing after the stop");
}

#[test]
fn a_playback_of_twelve_seconds_has_strokes_telemetry_and_no_loss() {
    let (playback, samples) = played(&ordinary(), 1);
    assert!(
        (playback.exploration_s - 12.0).abs() < 0.003,
        "{playback:?}"
    );
    assert!(playback.samples.abs_diff(12_000) <= 3, "{playback:?}");
    assert_eq!(samples.len() as u64, playback.samples);
    assert_eq!(playback.samples_lost, 0);
    assert!((5..30).contains(&playback.strokes), "{playback:?}");
    assert!(samples.windows(2).all(|w| w[0].t_s < w[1].t_s));
    let positions: Vec<f64> = samples.iter().map(|s| s.x_mm).collect();
    assert!(positions.iter().all(|x| (-1.0..36.0).contains(x)));
}

#[test]
fn the_frequency_of_polling_has_no_influence() {
    let once = played(&ordinary(), 7);
    let mut device = playing(Options::seeded(7), &ordinary());
    let mut reports = Vec::new();
    for now in (30..=12_030).step_by(7) {
        reports.extend(device.poll(ms(now)));
    }
    reports.extend(device.poll(ms(12_030)));
    device.stop(ms(12_030)).unwrap();
    reports.extend(device.poll(ms(12_100)));
    assert_eq!((stopped(&reports), samples(&reports)), once);
}

/// On a busy computer the interface may pause so long that the device goes limp before the
/// start. The report says so, whichever of start and watchdog comes first.
#[test]
fn a_start_after_the_watchdog_is_refused_because_of_the_watchdog() {
    let mut limp = 0;
    for paused_ms in (90..170).chain([300]) {
        let mut device = VirtualDevice::new(Options {
            supervision_timeout: Some(ms(100)),
            ..Options::default()
        });
        let mut now = 0;
        // The numbers of playbacks differ from the first on.
        for is_last in [false, true] {
            let load = device.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(now));
            load.unwrap();
            while device.poll(ms(now)) != [Report::Loaded] {
                now += 5;
            }
            if is_last {
                break;
            }
            device.start(ms(now)).unwrap();
            device.poll(ms(now + 50));
            device.stop(ms(now + 50)).unwrap();
            now += 100;
            stopped(&device.poll(ms(now)));
        }
        now += paused_ms;
        let refused = device.start(ms(now)).is_err();
        let reports = device.poll(ms(now + 20));
        let faults: Vec<&str> = reports
            .iter()
            .filter_map(|report| match report {
                Report::Fault(what) => Some(what.as_str()),
                _ => None,
            })
            .collect();
        let watchdog = |what: &&str| what.contains("no fresh heartbeat from the host");
        assert!(faults.iter().all(watchdog), "{paused_ms}: {faults:?}");
        assert!(faults.len() <= 1, "{paused_ms}: {faults:?}");
        let started = reports.contains(&Report::Started);
        assert!(started || refused || faults.len() == 1, "{paused_ms}");
        limp += usize::from(!faults.is_empty());
    }
    assert!((20..75).contains(&limp), "{limp}");
}

#[test]
fn another_seed_gives_another_hand() {
    assert_eq!(played(&ordinary(), 1), played(&ordinary(), 1));
    assert_ne!(played(&ordinary(), 1).1, played(&ordinary(), 2).1);
}

/// A table that compensates the hand's damping, and one that adds damping.
#[test]
fn an_active_table_shows_in_the_energy_and_the_switches() {
    let (passive, _) = played(&detents(0.0, 0.02, Direction::Play { delta_mm: 0.5 }), 3);
    let (active, _) = played(&detents(0.0, -0.05, Direction::Sign), 3);
    assert!(passive.least_energy_j > -0.05, "{passive:?}");
    assert!(active.least_energy_j < -0.2, "{active:?}");
    assert!(
        active.switches_per_s > 2.0 * passive.switches_per_s,
        "{active:?} {passive:?}"
    );
}

/// The paper's realizations have m down to −1.9 kg. The device limits the mass to that of
/// the slider, which avoids faults.
#[test]
fn a_table_of_negative_mass_can_be_played_without_a_fault() {
    for seed in 0..5 {
        let mut device = playing(
            Options::seeded(seed),
            &detents(-1.2, 0.015, Direction::Sign),
        );
        let reports = device.poll(ms(12_022));
        let faults = reports.iter().filter(|r| matches!(r, Report::Fault(_)));
        assert_eq!(faults.count(), 0, "seed {seed}");
    }
}

#[test]
fn a_hand_faster_than_the_limit_trips_the_device_which_stays_limp() {
    let mut slow = limits(12.0);
    slow.velocity_mm_s = Limit::new(20.0).unwrap();
    let mut device = VirtualDevice::new(Options::default());
    device
        .load(&Stimulus::of_table(&ordinary()), slow, ms(0))
        .unwrap();
    device.poll(ms(30));
    device.start(ms(30)).unwrap();
    let reports = device.poll(ms(12_000));
    assert_eq!(
        reports.last(),
        Some(&Report::Fault("velocity limit exceeded".to_owned()))
    );
    assert_eq!(device.held_n(), 0.0);
    assert_eq!(device.poll(ms(20_000)), [], "latched");
}

#[test]
fn limp_is_no_force_and_no_report_in_every_state() {
    let states: [Case<'_, VirtualDevice>; 5] = [
        ("idle", &|_| {}),
        ("loading", &|d| {
            d.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0))
                .unwrap();
        }),
        ("loaded", &|d| {
            d.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0))
                .unwrap();
            d.poll(ms(30));
        }),
        ("playing", &|d| {
            d.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0))
                .unwrap();
            d.poll(ms(30));
            d.start(ms(30)).unwrap();
            d.poll(ms(2000));
        }),
        ("stopping", &|d| {
            d.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0))
                .unwrap();
            d.poll(ms(30));
            d.start(ms(30)).unwrap();
            d.stop(ms(2000)).unwrap();
        }),
    ];
    for (name, reach) in states {
        let mut device = VirtualDevice::new(Options::default());
        reach(&mut device);
        if name == "playing" {
            assert_ne!(device.held_n(), 0.0);
        }
        device.limp(ms(2001));
        // half a millisecond in each direction
        device.poll(ms(2002));
        assert_eq!(device.held_n(), 0.0, "{name}");
        assert_eq!(device.poll(ms(9000)), [], "{name}");
        assert!(device.start(ms(9000)).is_err(), "{name}: nothing is loaded");
        assert!(
            device
                .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(9000))
                .is_ok()
        );
    }
}

#[test]
fn commands_in_the_wrong_state_are_refused() {
    let mut device = VirtualDevice::new(Options::default());
    let refused = device.start(ms(0)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the device cannot start while nothing is loaded"
    );
    let mut device = playing(Options::default(), &ordinary());
    device.poll(ms(100));
    assert!(
        device
            .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(100))
            .is_err()
    );
    assert!(device.start(ms(100)).is_err());
}

#[test]
fn an_invalid_table_is_refused_with_the_reason() {
    let damage: [Case<'_, Realization>; 6] = [
        ("positive m_kg is not a finite number at node 4", &|r| {
            r.positive.m_kg[3] = f64::NAN;
        }),
        ("negative f0_n has 31 values for 32 nodes", &|r| {
            r.negative.f0_n.pop();
        }),
        ("positions do not ascend: 6 mm is followed by 3 mm", &|r| {
            r.x_mm[5] = 3.0;
        }),
        ("fewer than two nodes", &|r| r.x_mm.truncate(1)),
        ("the trained speed inf mm/s is invalid", &|r| {
            r.trained.v_mm_s = f64::INFINITY;
        }),
        ("the direction's delta_mm 0 is invalid", &|r| {
            r.direction = Direction::Dahl { delta_mm: 0.0 };
        }),
    ];
    for (expected, damage) in damage {
        let mut realization = ordinary();
        damage(&mut realization);
        let mut device = VirtualDevice::new(Options::default());
        let refused = device
            .load(&Stimulus::of_table(&realization), limits(12.0), ms(0))
            .unwrap_err()
            .to_string();
        assert!(refused.contains(expected), "{refused}");
        assert!(device.start(ms(50)).is_err());
    }
}

#[test]
fn a_table_that_fails_its_certificate_needs_a_permission() {
    let table = detents(-0.2, 0.01, Direction::Sign);
    for allow_uncertified in [false, true] {
        let what = Stimulus {
            allow_uncertified,
            ..Stimulus::of_table(&table)
        };
        let mut device = VirtualDevice::new(Options::default());
        device.load(&what, limits(12.0), ms(0)).unwrap();
        let reports = device.poll(ms(100));
        if allow_uncertified {
            assert_eq!(reports, [Report::Loaded]);
        } else {
            let [Report::Fault(reason)] = &reports[..] else {
                panic!("{reports:?}");
            };
            assert!(reason.contains("fails its certificate"), "{reason}");
        }
        assert_eq!(device.start(ms(100)).is_ok(), allow_uncertified);
    }
}

/// Between nodes 1 mm apart the gap of 2 N between the branches falls to the gap at one node; the
/// mean over the play of 0.5 mm is an eighth of the fall above it. The device judges each position.
#[test]
fn a_table_that_is_passive_over_its_play_needs_no_permission() {
    for (gap_n, loads) in [(-0.1, true), (-0.5, false)] {
        let mut table = ordinary();
        let node = table.x_mm.len() / 2;
        table.positive.f0_n[node] = table.negative.f0_n[node] + gap_n;
        assert!(!table.certificate_of_device().passes());
        assert_eq!(table.certificate().passes(), loads);
        let mut device = VirtualDevice::new(Options::default());
        let what = Stimulus {
            allow_uncertified: false,
            ..Stimulus::of_table(&table)
        };
        device.load(&what, limits(12.0), ms(0)).unwrap();
        assert_eq!(device.poll(ms(100)) == [Report::Loaded], loads, "{gap_n}");
        assert_eq!(device.start(ms(100)).is_ok(), loads);
    }
}

#[test]
fn each_injected_fault_has_its_effect() {
    let with = |fault| Options {
        faults: FaultPlan::default().with(1, fault),
        ..Options::default()
    };
    let mut device = VirtualDevice::new(with(InjectedFault::RefuseLoad));
    let refused = device.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(0));
    assert!(matches!(refused, Err(DeviceError::Refused(_))));
    assert!(
        device
            .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(1))
            .is_ok()
    );

    let mut device = playing(with(InjectedFault::Trip), &ordinary());
    let reports = device.poll(ms(3000));
    assert!(matches!(reports.last(), Some(Report::Fault(_))));
    assert_eq!(device.held_n(), 0.0);
    assert!(device.start(ms(3000)).is_err(), "latched");
    assert!(
        device
            .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(3000))
            .is_ok()
    );

    let mut device = playing(with(InjectedFault::LosePlayback), &ordinary());
    let reports = device.poll(ms(1500));
    let before = samples(&reports).len();
    assert!(
        (470..=500).contains(&before),
        "{before}: silent after half a second"
    );
    assert_eq!(
        reports.last(),
        Some(&Report::Lost("it no longer answers".to_owned()))
    );
    assert_eq!(device.held_n(), 0.0, "its watchdog");
    device.stop(ms(1500)).unwrap();
    assert_eq!(
        device.poll(ms(9000)),
        [Report::Ready],
        "no stop is confirmed"
    );
    assert!(
        device
            .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(9000))
            .is_ok()
    );

    let mut device = playing(with(InjectedFault::Unplug), &ordinary());
    let reports = device.poll(ms(1000));
    assert!(matches!(reports.last(), Some(Report::Lost(_))));
    let gone = device.load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(1000));
    assert!(matches!(gone, Err(DeviceError::Lost(_))));
    assert_eq!(device.poll(ms(4000)), [Report::Ready]);
    assert!(
        device
            .load(&Stimulus::of_table(&ordinary()), limits(12.0), ms(4000))
            .is_ok()
    );
}

#[test]
fn the_lower_of_the_two_force_limits_holds() {
    let mut options = Options::default();
    options.device.limits = limits(4.0);
    let mut device = playing(options, &ordinary());
    let felt = samples(&device.poll(ms(8000)));
    let most = felt.iter().map(|s| s.force_command_n.abs());
    assert_eq!(most.fold(0.0, f64::max), 4.0);
}

prop_compose! {
    /// Any table that a host could send.
    fn any_table()(
        nodes in 2usize..40,
        dx in 0.2..4.0f64,
        start in -20.0..20.0f64,
    )(
        x_mm in Just((0..nodes).map(|i| start + dx * i as f64).collect::<Vec<f64>>()),
        values in prop::collection::vec(-1.0..1.0f64, nodes * 8),
        scale in prop::array::uniform4(0.0..200.0f64),
        delta_mm in 0.01..3.0f64,
        rule in 0..3,
        v_mm_s in 1.0..500.0f64,
    ) -> Realization {
        let n = x_mm.len();
        let column = |i: usize, scale: f64| -> Vec<f64> {
            values[i * n..(i + 1) * n].iter().map(|v| v * scale).collect()
        };
        let branch = |first: usize| Branch {
            m_kg: column(first, scale[0]),
            b_n_s_per_mm: column(first + 1, scale[1]),
            k_n_per_mm: column(first + 2, scale[2]),
            f0_n: column(first + 3, scale[3]),
        };
        Realization {
            direction: match rule {
                0 => Direction::Sign,
                1 => Direction::Play { delta_mm },
                _ => Direction::Dahl { delta_mm },
            },
            trained: Trained { x_mm: [x_mm[0], x_mm[n - 1]], v_mm_s },
            positive: branch(0),
            negative: branch(4),
            x_mm,
            ..ordinary()
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_table_ever_gets_more_force_than_the_limit(
        table in any_table(),
        force_n in 0.5..20.0f64,
        seed in any::<u64>(),
    ) {
        let mut device = VirtualDevice::new(Options::seeded(seed));
        device.load(&Stimulus::of_table(&table), limits(force_n), ms(0)).unwrap();
        device.poll(ms(100));
        // a table beyond the device's stroke is refused
        let beyond = table.trained.x_mm[0] < -20.0 || table.trained.x_mm[1] > 60.0;
        prop_assert_eq!(device.start(ms(100)).is_err(), beyond);
        let allowed = force_n.min(15.0) + 1e-6;
        let mut fault = false;
        for now in (100..3000).step_by(10) {
            let reports = device.poll(ms(now));
            for sample in samples(&reports) {
                prop_assert!(sample.force_command_n.abs() <= allowed);
                prop_assert!(sample.x_mm.is_finite());
            }
            fault |= reports.iter().any(|r| matches!(r, Report::Fault(_)));
            prop_assert!(device.held_n().abs() <= allowed);
            prop_assert!(!fault || device.held_n() == 0.0);
        }
    }
}

/// The end of a playback is asked for again where the line loses long messages, and the
/// device does not go limp meanwhile.
#[test]
fn a_lost_report_of_the_end_is_asked_for_again() {
    for seed in 0..30 {
        let mut options = Options::seeded(seed);
        options.noise.drop_telemetry = 0.12;
        let mut device = VirtualDevice::new(options);
        let table = ordinary();
        device
            .load(&Stimulus::of_table(&table), limits(12.0), ms(0))
            .unwrap();
        let loaded = device.poll(ms(3000));
        assert!(loaded.contains(&Report::Loaded), "{seed}: {loaded:?}");
        device.start(ms(3000)).unwrap();
        let mut reports = device.poll(ms(4000));
        device.stop(ms(4000)).unwrap();
        reports.extend(device.poll(ms(6000)));
        assert!(stopped(&reports).samples > 0, "{seed}");
    }
}
