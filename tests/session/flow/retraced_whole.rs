//! The same with all that is around a session: runner, store and a device that fails, on a
//! virtual clock.

use super::retraced::{assert_equal, record};
use crate::blinding::{self, LOOK};
use crate::support::repository;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::{Clock, VirtualClock};
use study_analysis::load::load;
use study_device::Device;
use study_device::faults::FaultPlan;
use study_device::virtual_device::{Options, VirtualDevice};
use study_session::outcome::{Entry, Event, Moment};
use study_session::session::{Input, Screen, View, retrace};

fn inputs(view: &View) -> Vec<Input> {
    match &view.screen {
        Screen::Break { wait_s, .. } if *wait_s <= 0.0 => vec![Input::Advance],
        Screen::DeviceTrouble {
            can_go_on: true, ..
        }
        | Screen::End { .. } => vec![Input::Advance],
        Screen::Stopped { .. } => vec![Input::PlayAgain],
        _ => blinding::inputs(view),
    }
}

fn failing(mut options: Options) -> Box<dyn Device> {
    options.faults = FaultPlan::random(3, 0.3);
    Box::new(VirtualDevice::new(options))
}

/// A clock of which no two readings are alike, as of that of a machine.
struct Ticking(VirtualClock);

impl Clock for Ticking {
    fn now(&self) -> Moment {
        self.0.advance(Duration::from_nanos(1));
        self.0.now()
    }
}

fn ticking(clock: VirtualClock) -> Box<dyn Clock> {
    Box::new(Ticking(clock))
}

/// A load may be over between two looks.
fn look(pages: &mut Vec<String>, view: &View) {
    if !matches!(view.screen, Screen::Loading { .. }) {
        record(pages, view);
    }
}

#[test]
fn shipped_studies_on_a_failing_device_show_the_same_pages_again() {
    for name in ["turn-signal", "turn-signal-extended", "keyboard"] {
        let path = repository(&format!("protocols/{name}"));
        let mut loaded = load(Path::new(&path)).unwrap();
        let orders = loaded.orders.take();
        let protocol = Arc::new(loaded.protocol.clone());
        let (mut runner, clock) = blinding::session_by(ticking, loaded, orders, None, failing);
        let (mut shown, mut looks) = (Vec::new(), 0);
        loop {
            let view = runner.view();
            look(&mut shown, &view);
            if runner.step(inputs(&view)).is_some() {
                break;
            }
            clock.advance(LOOK);
            looks += 1;
            assert!(looks < 500_000, "{name} stays at {:?}", view.screen);
        }
        let session = runner.study().sessions().unwrap().remove(0);
        let mut again = Vec::new();
        for page in retrace::pages(&|_: &Entry| protocol.clone(), &session.entries) {
            look(&mut again, &page.view);
        }
        assert_equal(&shown, &again);
        let failed = |e: &Entry| matches!(e.event, Event::AttemptFailed { .. });
        assert!(session.entries.iter().any(failed), "{name}");
    }
}
