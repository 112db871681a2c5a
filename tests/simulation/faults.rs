//! What goes wrong in a sitting, drawn from a seed.

use crate::memory::Fault;
use std::io::ErrorKind;
use std::time::Duration;
use study_base::rng::Stream;

/// Something that happens beside what the participant does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trouble {
    /// The process dies.
    Kill,
    /// The terminal is gone.
    HangUp,
    /// The computer is suspended.
    Suspend(Duration),
    /// The process stands still, and its clocks go on.
    Stall(Duration),
    /// The wall clock is set, ms forward.
    SetClock(i64),
    /// The device trips.
    Trip,
    /// The processor of the device hangs.
    Hang(Duration),
    /// Telemetry comes late.
    LateTelemetry(Duration),
    /// Stop, on the page and at the terminal.
    Stop,
    StopByKey,
    Pause,
    Quit,
    MarkBad,
    Remark,
}

/// When it happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum When {
    /// So long after the beginning.
    After(Duration),
    /// So long after a kind of screen is shown.
    During(Moment, Duration),
}

/// A kind of screen that is short.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Moment {
    Loading,
    Playing,
    Stopping,
    Stopped,
    Form,
    Saving,
}

const MOMENTS: [Moment; 6] = [
    Moment::Loading,
    Moment::Playing,
    Moment::Stopping,
    Moment::Stopped,
    Moment::Form,
    Moment::Saving,
];

/// A sitting: who sees what, and what goes wrong.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Whether the participant has a page.
    pub(crate) by_page: bool,
    /// Of the participant's messages so many are lost, come twice or late.
    pub(crate) loss: f64,
    /// Of the saver's turns so many take a while.
    pub(crate) slow: f64,
    /// Of the playbacks so many have a fault of the device.
    pub(crate) device_faults: f64,
    /// Of the pieces on its line so many come late or twice.
    pub(crate) uneven: f64,
    /// Faults of the disks, each at a call.
    pub(crate) disks: [Option<(usize, Fault)>; 2],
    pub(crate) troubles: Vec<(When, Trouble)>,
}

impl Plan {
    /// Nothing goes wrong.
    pub(crate) fn calm(by_page: bool) -> Self {
        Self {
            by_page,
            loss: 0.0,
            slow: 0.0,
            device_faults: 0.0,
            uneven: 0.0,
            disks: [None, None],
            troubles: Vec::new(),
        }
    }

    /// What goes wrong is drawn.
    pub(crate) fn drawn(chance: &mut Stream, mirrored: bool) -> Self {
        let share = |chance: &mut Stream| [0.0, 0.0, 0.1, 0.4][chance.below(4) as usize];
        let mut disks = [None, None];
        for disk in &mut disks[..1 + usize::from(mirrored)] {
            if chance.below(5) < 2 {
                *disk = Some((chance.below(420) as usize, fault(chance, mirrored)));
            }
        }
        // Only one of two disks is lost.
        if disks.iter().flatten().count() == 2 {
            disks[chance.below(2) as usize] = None;
        }
        let troubles = (0..chance.below(6)).map(|_| (when(chance), trouble(chance)));
        let troubles = troubles.collect();
        Self {
            by_page: chance.below(3) > 0,
            loss: share(chance),
            slow: share(chance),
            device_faults: share(chance),
            uneven: share(chance),
            disks,
            troubles,
        }
    }
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn fault(chance: &mut Stream, mirrored: bool) -> Fault {
    const FAULTS: [Fault; 8] = [
        Fault::Kill,
        Fault::KillInWrite,
        Fault::Error(ErrorKind::Other),
        Fault::Error(ErrorKind::StorageFull),
        Fault::Short(ErrorKind::StorageFull),
        Fault::From(ErrorKind::Other),
        Fault::From(ErrorKind::StorageFull),
        Fault::Removed,
    ];
    // Without a mirror nothing is left of a disk that is removed.
    let count = FAULTS.len() - usize::from(!mirrored);
    FAULTS[chance.below(count as u64) as usize]
}

fn when(chance: &mut Stream) -> When {
    match chance.below(3) {
        0 => When::After(ms(chance.below(40_000))),
        _ => {
            let moment = MOMENTS[chance.below(MOMENTS.len() as u64) as usize];
            When::During(moment, ms(chance.below(600)))
        }
    }
}

fn trouble(chance: &mut Stream) -> Trouble {
    let while_away =
        |chance: &mut Stream| [ms(1500), ms(20_000), ms(100_000)][chance.below(3) as usize];
    const DAY_MS: i64 = 86_400_000;
    match chance.below(18) {
        0..=2 => Trouble::Kill,
        3 => Trouble::HangUp,
        4 => Trouble::Suspend(while_away(chance)),
        5 => Trouble::Stall(while_away(chance)),
        6 => Trouble::SetClock(
            [2 * DAY_MS, -2 * DAY_MS, -20_000 * DAY_MS, 90_000][chance.below(4) as usize],
        ),
        7 => Trouble::Trip,
        8 => Trouble::Hang(ms(1 + chance.below(20))),
        9 => Trouble::LateTelemetry(ms(100 + chance.below(900))),
        10..=11 => Trouble::Stop,
        12 => Trouble::StopByKey,
        13 => Trouble::Pause,
        14 => Trouble::Quit,
        15 => Trouble::MarkBad,
        _ => Trouble::Remark,
    }
}
