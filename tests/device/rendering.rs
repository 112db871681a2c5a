//! The verdict about a playback: the simulated device is right, wrong devices are found.

use crate::support::repository;
use crate::tables;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;
use study::runner::playback_limits;
use study_analysis::load;
use study_base::limits::Limits;
use study_base::text::ModelId;
use study_device::firmware::{Wrong, WrongLoads};
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, Report, Stimulus, rendering_of};
use study_haptics::model::{Elements, Mechanism, Realization};
use study_plan::protocol::RenderingRules;
use study_session::outcome::{Fidelity, Playback, Sample, Verdict};
use study_session::rendering::{Played, judge};
use study_wire::elements::Spring;
use study_wire::predict::Direction;
use study_wire::servo::ServoSettings;

/// The page that lists the wrong devices, with what a session says of each.
const PAGE: &str = "docs/wrong-devices.md";

/// A table with its name and the limits of its playback.
pub(crate) type Shipped = (ModelId, Realization, Limits);

/// The tables of the shipped protocols.
pub(crate) fn shipped() -> &'static [Shipped] {
    static ALL: LazyLock<Vec<Shipped>> = LazyLock::new(read);
    &ALL
}

fn read() -> Vec<Shipped> {
    let mut all = Vec::new();
    for protocol in [
        "protocols/turn-signal",
        "protocols/turn-signal-extended",
        "protocols/turn-signal-passive",
        "protocols/knob",
    ] {
        let loaded = load::load(Path::new(&repository(protocol))).unwrap();
        for (id, table) in loaded.models {
            let limits = playback_limits(&loaded.protocol, Some(&table));
            let known = all.iter().any(|(_, other, _): &Shipped| *other == table);
            if !known {
                all.push((id, table, limits));
            }
        }
    }
    all
}

/// A table in which every term, direction and node counts.
pub(crate) fn mixed(direction: Direction) -> Realization {
    tables::table(
        "mixed",
        tables::fine(),
        [0.3, 0.02, 0.15],
        |x_mm, side| 2.5 * tables::detent_n(x_mm) + side - 2.6,
        direction,
    )
}

/// What a playback reports, and what the device says of its servo.
pub(crate) struct Heard {
    pub(crate) samples: Vec<Sample>,
    pub(crate) playback: Option<Playback>,
    pub(crate) servo: Option<ServoSettings>,
    /// Why the playback has no end, if it has none.
    pub(crate) failed: Vec<Report>,
}

/// Loads, plays for `seconds` and stops, each table in turn; what the last reports.
pub(crate) fn play(options: Options, tables: &[(&Realization, Limits)], seconds: f64) -> Heard {
    let mut device = VirtualDevice::new(options);
    let mut heard = Heard {
        samples: Vec::new(),
        playback: None,
        servo: device.identity().servo,
        failed: Vec::new(),
    };
    let mut ms = 0;
    let mut wait = |device: &mut VirtualDevice, most: u32, done: &dyn Fn(&Report) -> bool| {
        let mut all = Vec::new();
        for _ in 0..most {
            ms += 10;
            let reports = device.poll(Duration::from_millis(ms));
            let found = reports.iter().any(done);
            all.extend(reports);
            if found {
                break;
            }
        }
        (all, Duration::from_millis(ms))
    };
    for (table, limits) in tables {
        let (_, now) = wait(&mut device, 1, &|_| false);
        device
            .load(&Stimulus::of_table(table), *limits, now)
            .unwrap();
        let (reports, now) = wait(&mut device, 500, &|r| *r == Report::Loaded);
        device
            .start(now)
            .unwrap_or_else(|e| panic!("{}: {e}: {reports:?}", table.id));
        let (mut reports, _) = wait(&mut device, (100.0 * seconds) as u32, &|_| false);
        let (more, now) = wait(&mut device, 1, &|_| false);
        reports.extend(more);
        device.stop(now).unwrap();
        reports.extend(wait(&mut device, 300, &|r| matches!(r, Report::Stopped(_))).0);
        heard.samples.clear();
        heard.playback = None;
        heard.failed.clear();
        for report in reports {
            match report {
                Report::Telemetry(more) => heard.samples.extend(more),
                Report::Stopped(playback) => heard.playback = Some(playback),
                Report::Fault(_) | Report::Lost(_) => heard.failed.push(report),
                _ => {}
            }
        }
    }
    heard
}

/// The verdict as a session gives it.
pub(crate) fn judged(
    id: &ModelId,
    table: &Realization,
    limits: Limits,
    heard: &Heard,
    others: &[(ModelId, Realization)],
) -> Fidelity {
    let others: Vec<_> = (others.iter())
        .map(|(id, table)| (id.clone(), rendering_of(table)))
        .collect();
    let played = Played {
        model: id,
        what: rendering_of(table),
        servo: ServoSettings {
            force_n: limits.force_n.get(),
            ..heard.servo.unwrap()
        },
        servo_told: true,
        samples: &heard.samples,
        numbered: true,
        lost: heard.playback.map_or(0, |p| p.samples_lost),
        faded_from_s: None,
        time_ratio: heard.playback.and_then(|p| p.time_ratio),
        host_late_s: None,
        others: &others,
    };
    judge(&played, &RenderingRules::default())
}

/// Every wrong device plays two tables; what a session says of the second.
#[test]
fn no_wrong_device_is_ok_where_telemetry_can_show_it() {
    let (id, before) = (
        ModelId::new("mixed").unwrap(),
        ModelId::new("before").unwrap(),
    );
    let table = mixed(Direction::Sign);
    let mut first = mixed(Direction::Sign);
    first.positive.f0_n.iter_mut().for_each(|f| *f *= -1.0);
    let limits = Limits::new(9.0, 1000.0).unwrap();
    let others = [(before, first.clone())];
    let mut rows = String::new();
    let mut unseen = Vec::new();
    for (wrong, name, what) in Wrong::ALL {
        let mut options = Options::seeded(7);
        options.device.wrong = Some(WrongLoads {
            wrong: *wrong,
            loads: [1, u32::MAX],
        });
        if matches!(wrong, Wrong::FoldsBack | Wrong::RestsHigh) {
            // It shows where somebody pushes and holds.
            options.device.hand.rest_s = [0.8, 1.6];
            options.device.hand.end_spread_mm = 10.0;
        }
        let heard = play(options, &[(&first, limits), (&table, limits)], 6.0);
        let found = judged(&id, &table, limits, &heard, &others);
        let defects: Vec<&str> = found.defects.iter().map(|d| d.as_str()).collect();
        let _ = writeln!(
            rows,
            "| `{name}` | {what} | {} | {} |",
            found.verdict.as_str(),
            defects.join(", "),
        );
        // What they do is within what the default rules allow: a delay of 3 ms, and a slew limit and a
        // wall that this table and hand do not reach.
        let allowed = matches!(
            wrong,
            Wrong::LowPass50 | Wrong::TellsSlew500 | Wrong::TellsPullingWall
        );
        let seen = match found.verdict {
            Verdict::Flag | Verdict::Fault => true,
            // It was not heard.
            Verdict::TooLittle => wrong.is_unheard(),
            _ => allowed,
        };
        if !wrong.is_physical() && !seen {
            unseen.push(format!("{name}: {found:?}"));
        }
        assert!(
            !wrong.is_physical() || found.verdict == Verdict::Ok,
            "{name}: {found:?}"
        );
    }
    assert_eq!(unseen, Vec::<String>::new());
    assert!(Wrong::ALL.len() > 50);
    let path = repository(PAGE);
    let text = std::fs::read_to_string(&path).unwrap();
    let (head, rest) = text.split_once("|---|---|---|---|\n").unwrap();
    let tail = &rest[rest.find("\n\n").unwrap()..];
    let expected = format!("{head}|---|---|---|---|\n{}{tail}", rows.trim_end());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, expected).unwrap();
    } else {
        assert!(text == expected, "UPDATE_DOCS=1 writes {PAGE}:\n{rows}");
    }
}

/// A device that plays another mechanism than the one it was sent is found, whichever
/// part is wrong.
#[test]
fn a_wrong_part_of_a_mechanism_is_found() {
    let mut all = shipped().iter();
    let (id, right, limits) = all.find(|(_, r, _)| r.mechanism.is_some()).unwrap();
    type Change = fn(&mut Mechanism);
    let parts: [(&str, Change); 7] = [
        ("detents", |m| m.detent.n.iter_mut().for_each(|n| *n *= 0.7)),
        ("detents moved", |m| m.detent.first_mm += 2.0),
        ("friction", |m| {
            m.friction.n.iter_mut().for_each(|n| *n = 0.0)
        }),
        ("backlash", |m| m.scalars.gap_mm *= 3.0),
        ("masses", |m| m.scalars.follower_kg *= 6.0),
        ("handle", |m| m.scalars.handle_n += 1.0),
        ("offset", |m| m.scalars.offset_n += 0.6),
    ];
    let said = |played: &Realization| {
        let heard = play(Options::seeded(5), &[(played, *limits)], 5.0);
        judged(id, right, *limits, &heard, &[])
    };
    assert_eq!(said(right).verdict, Verdict::Ok);
    for (part, change) in parts {
        let mut wrong = right.clone();
        change(wrong.mechanism.as_mut().unwrap());
        let found = said(&wrong);
        assert!(
            matches!(found.verdict, Verdict::Flag | Verdict::Fault),
            "{part}: {found:?}"
        );
    }
}

/// The same of elements.
#[test]
fn a_wrong_part_of_elements_is_found() {
    let (id, right) = (ModelId::new("e").unwrap(), tables::elements());
    let limits = Limits::new(12.0, 1000.0).unwrap();
    type Change = fn(&mut Elements);
    let parts: [(&str, Change); 7] = [
        ("potential", |e| {
            e.force_n.iter_mut().for_each(|n| *n *= 0.7)
        }),
        ("nodes moved", |e| e.x_mm.iter_mut().for_each(|x| *x += 2.0)),
        ("damping", |e| {
            let all = e.damping_n_s_per_mm.iter_mut().flatten();
            all.for_each(|b| *b += 0.02);
        }),
        ("friction", |e| {
            e.spring_n[0].iter_mut().for_each(|n| *n = 0.0)
        }),
        ("relaxation", |e| {
            e.springs[2] = Spring::Stop { slip_mm: 30.0 };
            e.springs[1] = Spring::Stop { slip_mm: 8.0 };
        }),
        ("latch", |e| e.spring_n[3].iter_mut().for_each(|n| *n = 0.0)),
        ("mass", |e| e.mass_kg *= 8.0),
    ];
    let said = |played: &Realization| {
        let heard = play(Options::seeded(5), &[(played, limits)], 6.0);
        judged(&id, &right, limits, &heard, &[])
    };
    let found = said(&right);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    for (part, change) in parts {
        let mut wrong = right.clone();
        change(wrong.elements.as_mut().unwrap());
        let found = said(&wrong);
        assert!(
            matches!(found.verdict, Verdict::Flag | Verdict::Fault),
            "{part}: {found:?}"
        );
    }
}
