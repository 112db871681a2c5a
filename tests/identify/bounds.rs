//! The bounds of mass and damping in simulations: do they cover, and is twice the bound found?
//!
//! None of the targets has the shape of the reference model: friction is Dahl's with another length, changes at low speed, or is the
//! sign of the true velocity; forces are correlated, filtered or rounded.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use study_base::rng::Stream;
use study_haptics::identify::evidence::{self, Evidence};
use study_haptics::recording::{self, Recording};

/// A newton in gram-force.
const GRAM_FORCE_N: f64 = 9.80665e-3;

/// Position, mm, velocity, mm/s, acceleration, m/s², and force, N.
type Moment = [f64; 4];

/// Mass, kg, and damping, N·s/mm.
type Planted = [f64; 2];

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum Condition {
    /// A lever of 35 mm at 1 kHz by an encoder of 5 µm, without accelerometer.
    Lever,
    /// The same by 1 µm with a noisy accelerometer, Stribeck's friction and correlated noise of the force.
    Accelerometer,
    /// A switch of 4 mm at 200 Hz, with friction by the sign of the velocity.
    Switch,
    /// Presses of a hand on a switch of 4 mm at 1 kHz, both signals through the same moving means.
    Hand,
    /// The same as recorded.
    RawHand,
    /// One slow press and release of a key at a speed that varies, at 10 Hz in steps of 5 µm and 0.1 gf.
    Loop,
    /// Three of them at 0.05, 0.1 and 0.3 mm/s.
    Loops,
    /// Three of them that are alike.
    Repeats,
    /// One fast press and release by a hand, at 1 kHz.
    Press,
}

const ALL: [Condition; 9] = [
    Condition::Lever,
    Condition::Accelerometer,
    Condition::Switch,
    Condition::Hand,
    Condition::RawHand,
    Condition::Loop,
    Condition::Loops,
    Condition::Repeats,
    Condition::Press,
];

/// A number between 0 and 1.
fn uniform(stream: &mut Stream) -> f64 {
    stream.below(1 << 52) as f64 / (1_u64 << 52) as f64
}

fn rounded(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

/// Position and derivatives of a sum of sines: Hz, mm, phase.
fn sines(t: f64, parts: &[[f64; 3]]) -> [f64; 3] {
    let mut motion = [0.0; 3];
    for [hz, mm, phase] in parts {
        let w = TAU * hz;
        let (sin, cos) = (w * t + phase).sin_cos();
        motion[0] += mm * sin;
        motion[1] += mm * w * cos;
        motion[2] -= 1e-3 * mm * w * w * sin;
    }
    motion
}

/// Dahl's friction of 1 N.
struct Dahl {
    z: f64,
    last_mm: Option<f64>,
    length_mm: f64,
}

impl Dahl {
    fn new(length_mm: f64) -> Self {
        Self {
            z: 1.0,
            last_mm: None,
            length_mm,
        }
    }

    fn step(&mut self, x_mm: f64) -> f64 {
        let moved = x_mm - self.last_mm.replace(x_mm).unwrap_or(x_mm);
        if moved != 0.0 {
            let sign = moved.signum();
            self.z = sign + (self.z - sign) * (-moved.abs() / self.length_mm).exp();
        }
        self.z
    }
}

/// A slow press and release for each speed, mm/s, with rows at 10 Hz.
fn presses(plant: &mut Stream, speeds: &[f64], varies: bool) -> Vec<[f64; 3]> {
    const STEPS: usize = 20;
    let step_s = 0.1 / STEPS as f64;
    let (phase, turn_s) = (TAU * uniform(plant), 0.15 + 0.2 * uniform(plant));
    let (mut x, mut v, mut count, mut moments) = (0.0_f64, 0.0, 0, Vec::new());
    for speed in speeds {
        for direction in [1.0, -1.0] {
            while direction * x < direction * if direction > 0.0 { 4.0 } else { 0.02 } {
                let share = if varies {
                    1.0 + 0.6 * (1.7 * x + phase).sin()
                } else {
                    1.0
                };
                let a = (direction * speed * share - v) / turn_s;
                v += a * step_s;
                x += v * step_s;
                count += 1;
                if count % STEPS == 0 {
                    moments.push([x, v, 1e-3 * a]);
                }
            }
        }
    }
    moments
}

impl Condition {
    fn motion(self, plant: &mut Stream) -> (f64, Vec<[f64; 3]>) {
        let phases: Vec<f64> = (0..8).map(|_| TAU * uniform(plant)).collect();
        let sampled = |rate_hz: f64, n: u32, parts: &[[f64; 3]]| {
            let at = |i: u32| sines(f64::from(i) / rate_hz, parts);
            (rate_hz, (0..n).map(at).collect())
        };
        match self {
            Self::Lever | Self::Accelerometer => {
                let parts = [(0.5, 12.0), (1.3, 3.0), (3.1, 1.0)];
                let with_phase = |k: usize| [parts[k].0, parts[k].1, phases[k]];
                sampled(1000.0, 20_000, &[0, 1, 2].map(with_phase))
            }
            Self::Switch => {
                let parts = [(0.3, 1.4), (1.7, 0.3), (4.0, 0.08)];
                let with_phase = |k: usize| [parts[k].0, parts[k].1, phases[k]];
                sampled(200.0, 4000, &[0, 1, 2].map(with_phase))
            }
            Self::Hand | Self::RawHand => {
                let part = |k: usize| {
                    let hz = 0.4 + 0.9 * k as f64 * (0.8 + 0.4 * uniform(plant));
                    [hz, 1.6 / (1.0 + k as f64).powf(1.5), phases[k]]
                };
                let parts: Vec<[f64; 3]> = (0..8).map(part).collect();
                sampled(1000.0, 15_000, &parts)
            }
            Self::Loop => {
                let speed = 0.05 + 0.25 * uniform(plant);
                (10.0, presses(plant, &[speed], true))
            }
            Self::Loops => (10.0, presses(plant, &[0.05, 0.1, 0.3], false)),
            Self::Repeats => {
                let speed = 0.05 + 0.25 * uniform(plant);
                (10.0, presses(plant, &[speed; 3], true))
            }
            Self::Press => {
                let period_s = 0.2 + 0.3 * uniform(plant);
                let w = TAU / period_s;
                let at = |i: u32| {
                    let (sin, cos) = (w * f64::from(i) / 1000.0).sin_cos();
                    [2.0 - 2.0 * cos, 2.0 * w * sin, 2e-3 * w * w * cos]
                };
                (1000.0, (0..(1000.0 * period_s) as u32).map(at).collect())
            }
        }
    }

    /// Of one plant, the same for the same stream, with fresh noise.
    fn recording(self, plant: &mut Stream, noise: &mut Stream, [m, b]: Planted) -> Recording {
        let (rate_hz, motion) = self.motion(plant);
        let length = uniform(plant);
        let mut dahl = Dahl::new(match self {
            Self::Lever => 0.5 + length,
            Self::Accelerometer => 0.2,
            _ => 0.02 + 0.05 * length,
        });
        let [place, height] = [1.2 + uniform(plant), 0.1 + 0.2 * uniform(plant)];
        let mut correlated = 0.0;
        let mut accelerometer = Vec::new();
        let mut moments: Vec<Moment> = Vec::new();
        for [x, v, a] in motion {
            let z = dahl.step(x);
            let mut white = |rms: f64| rms * noise.normal();
            let f = match self {
                Self::Lever => 0.8 * z + 2.0 * (0.7 * x).sin() + 0.05 * x + white(0.03),
                Self::Accelerometer => {
                    correlated = 0.98 * correlated + white(0.01);
                    accelerometer.push(a + white(0.1));
                    let low = 1.0 + 0.5 * (-(v / 5.0).powi(2)).exp();
                    let friction = (0.8 + 0.2 * (0.3 * x).cos()) * z * low;
                    friction + 2.0 * (0.7 * x).sin() + correlated + white(0.01)
                }
                Self::Switch => 0.1_f64.copysign(v) + 0.3 * (3.0 * x).sin() + white(0.02),
                Self::Hand | Self::RawHand | Self::Press => {
                    0.1 * z + 0.3 * (2.0 * x).sin() + white(0.02)
                }
                Self::Loop | Self::Loops | Self::Repeats => {
                    correlated = 0.9 * correlated + white(0.022 * GRAM_FORCE_N);
                    let tactile = height * (-((x - place) / 0.25).powi(2)).exp();
                    let friction = (0.06 + 0.02 * (2.0 * x).sin()) * z;
                    let stop = 4.0 * (x - 3.8).max(0.0);
                    let spring = 0.3 + 0.08 * x + tactile + stop;
                    spring + friction + correlated + white(0.03 * GRAM_FORCE_N)
                }
            };
            let total = f + m * a + b * v;
            let (count_mm, step_n) = match self {
                Self::Lever | Self::Hand | Self::RawHand | Self::Press => (0.005, 0.0),
                Self::Accelerometer => (0.001, 0.0),
                Self::Switch => (0.002, 0.0),
                Self::Loop | Self::Loops | Self::Repeats => (0.005, 0.1 * GRAM_FORCE_N),
            };
            let total = if step_n > 0.0 {
                rounded(total, step_n)
            } else {
                total
            };
            moments.push([rounded(x, count_mm), v, a, total]);
        }
        if self == Self::Hand {
            moments = smooth(&moments);
        }
        let mut text = String::from(match self {
            Self::Accelerometer => "t_s,x_mm,f_n,a_m_s2\n",
            _ => "t_s,x_mm,f_n\n",
        });
        for (i, [x, .., f]) in moments.iter().enumerate() {
            write!(text, "{},{x},{f}", i as f64 / rate_hz).unwrap();
            if let Some(a) = accelerometer.get(i) {
                write!(text, ",{a}").unwrap();
            }
            text.push('\n');
        }
        recording::read("simulated", text.as_bytes()).unwrap()
    }
}

/// Means of 15 samples.
fn smooth(moments: &[Moment]) -> Vec<Moment> {
    let mean = |w: &[Moment]| [0, 1, 2, 3].map(|k| w.iter().map(|m| m[k]).sum::<f64>() / 15.0);
    moments.windows(15).map(mean).collect()
}

/// Of some plants: how many have a bound, in how many of these it covers what is planted between 0 and 1.2
/// bounds, in how many twice the bound is found, and in how many something is found, or taken up by a table, where nothing is.
#[derive(Debug, Default, PartialEq)]
struct Rates {
    bounded: usize,
    covered: usize,
    shown: usize,
    found: usize,
    wrong: usize,
    taken_up: usize,
    bounds: Vec<f64>,
}

fn rates(condition: Condition, term: usize, sets: std::ops::Range<u64>, seed: u64) -> Rates {
    let mut rates = Rates::default();
    for set in sets {
        let names = [format!("{condition:?}"), set.to_string(), term.to_string()];
        let stream = |what: &str| Stream::new(seed, &[what, &names[0], &names[1], &names[2]]);
        let evidence = |what: &str, value: f64| -> Evidence {
            let mut planted = [0.0; 2];
            planted[term] = value;
            let (mut plant, mut noise) = (stream("plant"), stream(what));
            let recording = condition.recording(&mut plant, &mut noise, planted);
            evidence::of(&[&recording], recording.range_mm()).unwrap()[term]
        };
        let nothing = evidence("nothing", 0.0);
        rates.wrong += usize::from(nothing.found);
        rates.taken_up += usize::from(nothing.carried);
        let Some(bound) = nothing.upper_bound else {
            continue;
        };
        let planted = 1.2 * bound * uniform(&mut stream("value"));
        let covers = |evidence: Evidence| evidence.upper_bound.is_none_or(|b| b >= planted);
        rates.bounded += 1;
        rates.covered += usize::from(covers(evidence("covered", planted)));
        if nothing.shows {
            rates.shown += 1;
            rates.found += usize::from(evidence("found", 2.0 * bound).found);
        }
        rates.bounds.push(bound);
    }
    rates
}

/// A few plants of each condition that takes little time.
#[test]
fn bounds_cover_and_twice_the_bound_is_found() {
    for condition in [Condition::Switch, Condition::Loops] {
        for term in [0, 1] {
            let sets = 12;
            let found = rates(condition, term, 0..sets as u64, 24);
            assert_eq!(
                [found.bounded, found.shown],
                [sets; 2],
                "{condition:?} {term} {found:?}"
            );
            assert!(found.covered + 1 >= sets, "{condition:?} {term} {found:?}");
            assert!(found.found + 2 >= sets, "{condition:?} {term} {found:?}");
            assert!(found.wrong <= 1, "{condition:?} {term} {found:?}");
        }
    }
}

/// The acceleration of the lever's encoder is mostly noise: a mass is found, without bias, and a table does not take it up; the output says both.
#[test]
fn a_mass_that_a_table_would_find_too_little_of_is_found_and_left_out() {
    let [mut plant, mut noise] = ["plant", "noise"].map(|name| Stream::new(24, &[name]));
    let recording = Condition::Lever.recording(&mut plant, &mut noise, [0.3, 0.0]);
    let [mass, _] = evidence::of(&[&recording], recording.range_mm()).unwrap();
    assert!(mass.found && !mass.carried, "{mass:?}");
    assert!(mass.reliability < 0.8, "{mass:?}");
    assert!(
        (mass.value - 0.3).abs() < 3.0 * mass.standard_error,
        "{mass:?}"
    );
    assert!(mass.standard_error < 0.1 * mass.value, "{mass:?}");
    let text = mass.to_string();
    let why = "left out, because a table would find too little of it";
    assert!(text.contains(" g ± ") && text.contains(why), "{text}");
}

/// With a single press and release, slow or fast, nothing is found. The output says so; there is no bound of the mass, and that
/// of the damping covers.
#[test]
fn a_single_press_is_told_to_show_no_term() {
    for condition in [Condition::Loop, Condition::Press] {
        for term in [0, 1] {
            let sets = 12;
            let found = rates(condition, term, 0..sets as u64, 24);
            let said = [found.shown, found.wrong, found.taken_up];
            assert_eq!(said, [0; 3], "{condition:?} {term} {found:?}");
            let bounded = if term == 0 { 0 } else { sets };
            let counts = [found.bounded, found.covered];
            assert_eq!(counts, [bounded; 2], "{condition:?} {term} {found:?}");
        }
        let [mut plant, mut noise] = ["plant", "noise"].map(|name| Stream::new(24, &[name]));
        let recording = condition.recording(&mut plant, &mut noise, Planted::default());
        let [mass, damping] = evidence::of(&[&recording], recording.range_mm()).unwrap();
        let why = "with fewer than 4 strokes a force that depends on position and direction looks like any";
        let text = mass.to_string();
        let begins = "mass: not identified by the recordings and not bounded; ";
        assert!(text.starts_with(begins) && text.contains(why), "{text}");
        let text = damping.to_string();
        let begins = "damping: not identified by the recordings, at most ";
        assert!(text.starts_with(begins) && text.contains(why), "{text}");
    }
}

/// Strokes that are alike show no damping, because the speed is a function of position and direction there, too, and bound no mass.
#[test]
fn strokes_that_are_alike_show_no_damping_and_bound_no_mass() {
    let sets = 12;
    let mass = rates(Condition::Repeats, 0, 0..sets as u64, 24);
    let said = [mass.bounded, mass.wrong, mass.taken_up];
    assert_eq!(said, [0; 3], "{mass:?}");
    let found = rates(Condition::Repeats, 1, 0..sets as u64, 24);
    assert_eq!([found.wrong, found.taken_up], [0; 2], "{found:?}");
    assert_eq!(found.bounded, sets, "{found:?}");
    assert!(found.covered + 1 >= sets, "{found:?}");
}

/// A table over many plants:
/// `SETS=500 SEED=7 cargo test --release --test identify bounds_in_many -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes"]
fn bounds_in_many_simulations() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.map_or(usual, |text| text.parse().unwrap())
    };
    let (sets, seed) = (number("SETS", 100), number("SEED", 1));
    println!(
        "condition term | bounded | covered | shown | found | wrong | taken up | median bound, kg or N·s/mm"
    );
    let only = std::env::var("CONDITION").ok();
    let asked = |c: &Condition| only.as_ref().is_none_or(|only| format!("{c:?}") == *only);
    for condition in ALL.into_iter().filter(asked) {
        for term in [0, 1] {
            let mut all = Rates::default();
            let parts: Vec<Rates> = std::thread::scope(|scope| {
                let part = |k: u64| {
                    scope.spawn(move || {
                        rates(condition, term, k * sets / 2..(k + 1) * sets / 2, seed)
                    })
                };
                let running = [part(0), part(1)];
                running
                    .into_iter()
                    .map(|thread| thread.join().unwrap())
                    .collect()
            });
            for part in parts {
                all.bounded += part.bounded;
                all.covered += part.covered;
                all.shown += part.shown;
                all.found += part.found;
                all.wrong += part.wrong;
                all.taken_up += part.taken_up;
                all.bounds.extend(part.bounds);
            }
            all.bounds.sort_by(f64::total_cmp);
            let share = |count: usize, of: usize| {
                let n = of as f64;
                let p = count as f64 / n;
                format!("{p:.3} ± {:.3}", (p * (1.0 - p) / n).sqrt())
            };
            println!(
                "{condition:?} {term} | {}/{sets} | {} | {}/{sets} | {} | {}/{sets} | {}/{sets} | {:.3e}",
                all.bounded,
                share(all.covered, all.bounded),
                all.shown,
                share(all.found, all.shown),
                all.wrong,
                all.taken_up,
                all.bounds.get(all.bounds.len() / 2).unwrap_or(&f64::NAN),
            );
        }
    }
}

/// A loop of a force tester in gram-force and mm, ten rows a second.
fn measured(path: &std::path::Path) -> Recording {
    let file = std::fs::read_to_string(path).unwrap();
    let mut text = String::from("t_s,x_mm,f_n\n");
    for (i, row) in file.lines().skip(1).enumerate() {
        let mut cells = row.split(',');
        let force: f64 = cells.next().unwrap().parse().unwrap();
        let x_mm = cells.next().unwrap();
        writeln!(text, "{},{x_mm},{}", 0.1 * i as f64, force * GRAM_FORCE_N).unwrap();
    }
    recording::read("measured", text.as_bytes()).unwrap()
}

/// What each measured loop in a folder says of mass and damping:
/// `SWITCHES=FOLDER cargo test --release --test identify measured_loops -- --ignored --nocapture`
#[test]
#[ignore = "needs a folder of force curves"]
fn measured_loops() {
    let folder = std::env::var("SWITCHES").unwrap();
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    paths.sort();
    for path in paths {
        let recording = measured(&path);
        let evidence = evidence::of(&[&recording], recording.range_mm()).unwrap();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        for e in evidence {
            println!(
                "{name:40} {:8} {:10.3e} ± {:9.3e} κ {:.3} at most {:9.3e} {} {} {}",
                e.term.as_str(),
                e.value,
                e.standard_error,
                e.reliability,
                e.upper_bound.unwrap_or(f64::NAN),
                if e.shows { "shows" } else { "-" },
                if e.found { "FOUND" } else { "" },
                if e.carried { "TAKEN UP" } else { "" },
            );
        }
    }
}
