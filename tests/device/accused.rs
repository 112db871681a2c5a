//! The right device, with many tables, hands and lines: nothing is said against it.

use crate::rendering::{Heard, Shipped, judged, play, shipped};
use std::collections::BTreeMap;
use std::fmt;
use study_base::text::ModelId;
use study_device::Report;
use study_device::link::memory::Noise;
use study_device::virtual_device::Options;
use study_haptics::model::Realization;
use study_haptics::plant::HandParameters;
use study_session::outcome::{Fidelity, Verdict};
use study_wire::message::Fault;

/// How fast hands move, mm/s. The third is hardly above rest, the last one slower than a
/// verdict asks for.
pub(crate) const HANDS: [[f64; 2]; 5] = [
    [40.0, 200.0],
    [150.0, 400.0],
    [15.0, 50.0],
    [60.0, 120.0],
    [5.0, 15.0],
];

pub(crate) fn hand(n: usize) -> HandParameters {
    HandParameters {
        speed_mm_s: HANDS[n % HANDS.len()],
        ..HandParameters::default()
    }
}

/// A line that damages one byte in 10,000 and loses one frame of telemetry in a hundred.
pub(crate) fn bad_line() -> Noise {
    Noise {
        byte_errors: 1e-4,
        drop_telemetry: 0.01,
        ..Noise::default()
    }
}

/// How often the tests of this file play; `STUDY_PLAYBACKS` is another number.
pub(crate) fn playbacks(usually: usize) -> usize {
    std::env::var("STUDY_PLAYBACKS").map_or(usually, |n| n.parse().unwrap())
}

/// What was said of many playbacks.
#[derive(Default)]
pub(crate) struct Tally {
    counts: BTreeMap<Verdict, u32>,
    /// Those without a verdict, by hand and reason.
    open: BTreeMap<String, u32>,
    pub(crate) accused: Vec<String>,
    /// Extremes of those that are ok.
    least_vaf: Option<f64>,
    gain: Option<[f64; 2]>,
    largest: [f64; 4],
}

impl Tally {
    pub(crate) fn add(&mut self, what: &str, hand: usize, found: &Fidelity) {
        *self.counts.entry(found.verdict).or_default() += 1;
        match found.verdict {
            Verdict::Ok => {
                let vaf = found.rendered_vaf.unwrap();
                self.least_vaf = Some(self.least_vaf.map_or(vaf, |least| least.min(vaf)));
                let gain = found.rendered_gain.unwrap();
                let [low, high] = self.gain.unwrap_or([gain; 2]);
                self.gain = Some([low.min(gain), high.max(gain)]);
                let here = [
                    found.rendered_bias_n,
                    found.rendered_delay_ms,
                    found.rendered_error_n,
                    found.rendered_error_share,
                ];
                for (most, here) in self.largest.iter_mut().zip(here) {
                    *most = most.max(here.unwrap_or(0.0).abs());
                }
            }
            Verdict::Flag | Verdict::Fault => self.accused.push(format!("{what}: {found:?}")),
            _ => {
                let [low, high] = HANDS[hand % HANDS.len()];
                let why = found.because.clone().unwrap_or_default();
                *(self.open)
                    .entry(format!("hand of {low} to {high} mm/s: {why}"))
                    .or_default() += 1;
            }
        }
    }

    pub(crate) fn of(&self, verdict: Verdict) -> usize {
        self.counts.get(&verdict).copied().unwrap_or(0) as usize
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [bias_n, delay_ms, error_n, share] = self.largest;
        writeln!(
            f,
            "{:?}; VAF from {:.5}, gain {:.3?}, bias {bias_n:.3} N, delay {delay_ms:.2} ms, error {error_n:.3} N, {share:.4} of the force",
            self.counts,
            self.least_vaf.unwrap_or(1.0),
            self.gain.unwrap_or([1.0; 2]),
        )?;
        (self.open.iter()).try_for_each(|(why, count)| writeln!(f, "{count:6} {why}"))
    }
}

/// The other tables of the shipped protocols.
pub(crate) fn others(own: &Shipped) -> Vec<(ModelId, Realization)> {
    let differs = |other: &&Shipped| other.0 != own.0 && other.1.positive != own.1.positive;
    let pair = |(id, table, _): &Shipped| (id.clone(), table.clone());
    shipped().iter().filter(differs).map(pair).collect()
}

/// One playback of a shipped table.
fn one(n: usize, change: impl FnOnce(&mut Options)) -> (ModelId, Heard, Option<Fidelity>) {
    let tables = shipped();
    let own = &tables[n % tables.len()];
    let mut options = Options::seeded(1000 + n as u64);
    options.device.hand = hand(n / tables.len());
    change(&mut options);
    let (id, table, limits) = own;
    let heard = play(options, &[(table, *limits)], 4.0);
    let found =
        (heard.playback.is_some()).then(|| judged(id, table, *limits, &heard, &others(own)));
    (id.clone(), heard, found)
}

/// All shipped tables with hands of different vigour, every second playback on a bad
/// line. `STUDY_PLAYBACKS` repeats the test with another number.
///
/// On such a line heartbeats are lost now and then, and the device goes limp, as it has
/// to; a vigorous hand may pull the handle beyond its stroke. Then the attempt fails as
/// one of the link or of the stroke, and nothing is said of the force.
#[test]
fn the_right_device_is_not_accused() {
    let playbacks = playbacks(120);
    let tables = shipped().len();
    let (mut tally, mut ended_early) = (Tally::default(), BTreeMap::<String, usize>::new());
    for n in 0..playbacks {
        let bad = n % 2 == 1;
        let (id, heard, found) = one(n, |options| {
            if bad {
                options.noise = bad_line();
            }
        });
        let Some(found) = found else {
            let [Report::Fault(why)] = &heard.failed[..] else {
                panic!("{n} {id}: {:?}", heard.failed);
            };
            let known = [Fault::Watchdog, Fault::Stroke].map(Fault::as_str);
            let why = known.into_iter().find(|known| why.starts_with(known));
            let why = why.unwrap_or_else(|| panic!("{n} {id}: {:?}", heard.failed));
            assert!(bad || why != known[0], "without a bad line: {n} {id}");
            println!("{n} {id}: {why} after {} samples", heard.samples.len());
            *ended_early.entry(why.to_owned()).or_default() += 1;
            continue;
        };
        tally.add(&format!("{n} {id}"), n / tables, &found);
    }
    println!("{tally}ended early {ended_early:?}");
    assert_eq!(tally.of(Verdict::Fault), 0, "{:#?}", tally.accused);
    let flags = tally.of(Verdict::Flag);
    assert!(flags * 500 <= playbacks, "{:#?}", tally.accused);
    assert!(tally.of(Verdict::Ok) * 10 > playbacks * 6, "{tally}");
    let early: usize = ended_early.values().sum();
    assert!(early * 100 <= playbacks, "{ended_early:?}");
}

/// Encoders, servos and telemetry that are coarser than those of the simulated device, as
/// far as docs/devices.md promises.
#[test]
fn a_coarse_device_is_not_accused() {
    type Change = fn(&mut Options);
    let coarse: [(&str, Change); 6] = [
        ("encoder 0.01 mm", |o| o.device.encoder_mm = 0.01),
        ("encoder 0.025 mm", |o| o.device.encoder_mm = 0.025),
        ("servo 1 kHz", |o| o.device.servo_hz = 1000.0),
        ("servo 10 kHz", |o| o.device.servo_hz = 10_000.0),
        ("telemetry 400 Hz", |o| o.device.telemetry_hz = 400.0),
        ("all, bad line", |o| {
            o.device.encoder_mm = 0.025;
            o.device.servo_hz = 2000.0;
            o.device.telemetry_hz = 500.0;
            o.noise = bad_line();
        }),
    ];
    let tables = shipped().len();
    let playbacks = playbacks(2 * coarse.len());
    let mut tallies: Vec<Tally> = coarse.iter().map(|_| Tally::default()).collect();
    for n in 0..playbacks {
        let which = n % coarse.len();
        // every table and hand with every device
        let (id, _, found) = one(n / coarse.len(), coarse[which].1);
        if let Some(found) = found {
            tallies[which].add(&id.to_string(), n / coarse.len() / tables, &found);
        }
    }
    for ((name, _), tally) in coarse.iter().zip(&tallies) {
        println!("{name}: {tally}{:#?}", tally.accused);
    }
    let accused: Vec<&String> = tallies.iter().flat_map(|t| &t.accused).collect();
    assert!(accused.is_empty(), "{accused:#?}");
}
