//! A scripted person and a device that the script can reach.

use super::super::desk::{Desk, Ended};
use crate::cli::Failure;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use study_base::limits::Limits;
use study_device::firmware::Place;
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError, Identity, Report, Stimulus};
use study_wire::message::Fault;

/// A device that the script can reach as well.
#[derive(Clone)]
pub(super) struct Shared {
    device: Arc<Mutex<VirtualDevice>>,
    /// When it was last polled.
    at: Arc<Mutex<Duration>>,
    /// Whether it keeps its samples for itself.
    mute: Arc<Mutex<bool>>,
    /// How often something was loaded.
    loads: Arc<Mutex<u32>>,
    /// The number of a load with whose start it trips, and why.
    trip: Arc<Mutex<Option<(u32, Fault)>>>,
}

impl Shared {
    pub(super) fn new(options: Options) -> Self {
        let device = Self {
            device: Arc::new(Mutex::new(VirtualDevice::new(options))),
            at: Arc::default(),
            mute: Arc::default(),
            loads: Arc::default(),
            trip: Arc::default(),
        };
        device.lock().firmware().let_go();
        device
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, VirtualDevice> {
        self.device.lock().unwrap()
    }

    /// From now on it reports no samples, or does again.
    pub(super) fn mute(&self, is_mute: bool) {
        *self.mute.lock().unwrap() = is_mute;
    }

    /// How often something was loaded.
    pub(super) fn loads(&self) -> u32 {
        *self.loads.lock().unwrap()
    }

    /// It trips as soon as the nth load plays.
    pub(super) fn trips_at(&self, nth: u32, fault: Fault) {
        *self.trip.lock().unwrap() = Some((nth, fault));
    }

    /// Lets a time pass in which nobody polls.
    pub(super) fn poll_after(&self, time: Duration) {
        let at = *self.at.lock().unwrap() + time;
        self.lock().poll(at);
    }

    pub(super) fn place(&self) -> Place {
        self.lock().firmware().place()
    }
}

impl Device for Shared {
    fn identity(&self) -> Identity {
        self.lock().identity()
    }
    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        *self.loads.lock().unwrap() += 1;
        self.lock().load(what, limits, at)
    }
    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.lock().start(at)
    }
    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.lock().stop(at)
    }
    fn limp(&mut self, at: Duration) {
        self.lock().limp(at);
    }
    fn poll(&mut self, at: Duration) -> Vec<Report> {
        *self.at.lock().unwrap() = at;
        let mut reports = self.lock().poll(at);
        let loads = self.loads();
        let due = |(nth, _): &mut (u32, Fault)| *nth == loads;
        if reports.contains(&Report::Started)
            && let Some((_, fault)) = self.trip.lock().unwrap().take_if(due)
        {
            self.lock().trip(fault);
        }
        if *self.mute.lock().unwrap() {
            reports.retain(|report| !matches!(report, Report::Telemetry(_)));
        }
        reports
    }
}

/// What is typed after a paragraph, and how long after it, s.
pub(super) type Typed = Vec<(f64, String)>;
/// A person: from what was said to what is typed.
pub(super) type Person<'p> = Box<dyn FnMut(&str, &Shared) -> Typed + 'p>;

/// A scripted desk.
pub(super) struct Script<'p> {
    device: Shared,
    person: Person<'p>,
    typed: VecDeque<(Duration, String)>,
    said: Rc<RefCell<String>>,
    now: Duration,
    /// When nobody answers any more.
    end: Option<Ended>,
    /// When Ctrl-C is pressed.
    signal: Option<Duration>,
}

impl<'p> Script<'p> {
    pub(super) fn new(device: &Shared, person: Person<'p>) -> (Self, Rc<RefCell<String>>) {
        let said = Rc::default();
        let script = Self {
            device: device.clone(),
            person,
            typed: VecDeque::new(),
            said: Rc::clone(&said),
            now: Duration::ZERO,
            end: None,
            signal: None,
        };
        (script, said)
    }
}

impl Desk for Script<'_> {
    fn say(&mut self, text: &str) -> Result<(), Failure> {
        self.said.borrow_mut().push_str(&format!("{text}\n"));
        for (after_s, line) in (self.person)(text, &self.device) {
            match line.as_str() {
                "<end>" => self.end = Some(Ended::Input),
                "<late>" => self.now += Duration::from_secs(2),
                "<panic>" => panic!("a bug"),
                "<ctrl-c>" => self.signal = Some(self.now + Duration::from_secs_f64(after_s)),
                _ => {
                    let at = self.now + Duration::from_secs_f64(after_s);
                    self.typed.push_back((at, line));
                }
            }
        }
        Ok(())
    }

    fn line(&mut self) -> Result<Option<String>, Ended> {
        if let Some(end) = &self.end {
            return Err(end.clone());
        }
        self.goes_on()?;
        assert!(
            self.now < Duration::from_secs(3600),
            "nobody answers: {}",
            self.said.borrow()
        );
        let due = self.typed.front().is_some_and(|(at, _)| *at <= self.now);
        Ok(if due {
            self.typed.pop_front().map(|(_, line)| line)
        } else {
            None
        })
    }

    fn goes_on(&mut self) -> Result<(), Ended> {
        match self.signal.take_if(|at| *at <= self.now) {
            Some(_) => Err(Ended::Signal("SIGINT")),
            None => Ok(()),
        }
    }

    fn drop_typed(&mut self) {}

    fn now(&self) -> Duration {
        self.now
    }

    fn wait(&mut self) {
        self.now += Duration::from_millis(20);
    }
}

pub(super) fn typed(after_s: f64, line: impl Into<String>) -> Typed {
    vec![(after_s, line.into())]
}
