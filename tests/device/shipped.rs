//! The shipped realizations on the simulated device play without faults.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;
use study_base::limits::{Limit, Limits};
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, Report, Stimulus};
use study_haptics::model::{Realization, file};
use study_session::outcome::Playback;

/// Force limit of the protocols for uncertified tables.
const UNCERTIFIED_N: f64 = 9.0;

pub(crate) fn shipped() -> BTreeMap<String, Realization> {
    // the same file in two protocols counts once
    ["turn-signal", "turn-signal-extended", "turn-signal-passive"]
        .into_iter()
        .flat_map(of_protocol)
        .collect()
}

/// Those of a protocol, by identifier.
pub(crate) fn of_protocol(protocol: &str) -> BTreeMap<String, Realization> {
    fs::read_dir(format!("protocols/{protocol}/models"))
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let text = fs::read_to_string(&path).unwrap();
            let realization = file::parse(&path.display().to_string(), &text).0.unwrap();
            (realization.id.clone(), realization)
        })
        .collect()
}

/// A playback of twelve seconds; `Err` is the fault.
fn played(realization: &Realization, options: Options, force_n: f64) -> Result<Playback, String> {
    let ms = Duration::from_millis;
    let limits = Limits {
        force_n: Limit::new(force_n).unwrap(),
        velocity_mm_s: Limit::new(1000.0).unwrap(),
    };
    let mut device = VirtualDevice::new(options);
    let what = Stimulus::of_table(realization);
    device.load(&what, limits, ms(0)).unwrap();
    device.poll(ms(100));
    device.start(ms(100)).unwrap();
    let mut reports = device.poll(ms(12_102));
    if let Some(Report::Fault(said)) = reports.iter().find(|r| matches!(r, Report::Fault(_))) {
        return Err(said.clone());
    }
    device.stop(ms(12_102)).unwrap();
    reports.extend(device.poll(ms(12_200)));
    let playback = reports.iter().find_map(|report| match report {
        Report::Stopped(playback) => Some(*playback),
        _ => None,
    });
    Ok(playback.unwrap())
}

#[test]
fn every_shipped_realization_plays_without_faults_and_supplies_little_energy() {
    let shipped = shipped();
    assert_eq!(shipped.len(), 18);
    for (id, realization) in shipped {
        for seed in 0..3 {
            let options = Options::seeded(seed);
            let playback = played(&realization, options, UNCERTIFIED_N).unwrap();
            // a table that starts on the flank of a detent supplies a few mJ
            assert!(
                playback.least_energy_j > -0.01,
                "{id}, {seed}: {playback:?}"
            );
            assert!(playback.strokes >= 1, "{id}, {seed}: {playback:?}");
        }
    }
}

/// The table of docs/simulation.md.
/// `cargo test --release --test device shipped -- --ignored --nocapture`
#[test]
#[ignore = "prints a table"]
fn playbacks_of_each_realization() {
    for (id, realization) in shipped() {
        let branches = [&realization.positive, &realization.negative];
        let masses = branches.iter().flat_map(|branch| &branch.m_kg);
        let least = masses.copied().fold(f64::INFINITY, f64::min);
        let mut line = format!("{id:32} {least:6.2} kg");
        for (least_mass_kg, force_n) in [
            (f64::NEG_INFINITY, UNCERTIFIED_N),
            (Options::default().device.least_mass_kg, UNCERTIFIED_N),
            (Options::default().device.least_mass_kg, 12.0),
        ] {
            let playbacks: Vec<_> = (0..20)
                .map(|seed| {
                    let mut options = Options::seeded(seed);
                    options.device.least_mass_kg = least_mass_kg;
                    played(&realization, options, force_n)
                })
                .collect();
            let ended: Vec<&Playback> = playbacks.iter().flatten().collect();
            let mean = |of: fn(&Playback) -> f64| {
                ended.iter().map(|p| of(p)).sum::<f64>() / ended.len() as f64
            };
            line += &format!(
                " | {force_n} N: {} trips, {:.3} J, {:.0} switches/s, {:.0} clamps, {:.1} strokes",
                20 - ended.len(),
                ended
                    .iter()
                    .map(|p| p.least_energy_j)
                    .fold(f64::INFINITY, f64::min),
                mean(|p| p.switches_per_s),
                mean(|p| p.clamp_count as f64),
                mean(|p| p.strokes as f64),
            );
        }
        println!("{line}");
    }
}
