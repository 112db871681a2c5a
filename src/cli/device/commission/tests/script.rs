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

/// A device that the script can reach as well.
#[derive(Clone)]
pub(super) struct Shared {
    device: Arc<Mutex<VirtualDevice>>,
    /// When it was last polled.
    at: Arc<Mutex<Duration>>,
}

impl Shared {
    pub(super) fn new(options: Options) -> Self {
        let device = Self {
            device: Arc::new(Mutex::new(VirtualDevice::new(options))),
            at: Arc::default(),
        };
        device.lock().firmware().let_go();
        device
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, VirtualDevice> {
        self.device.lock().unwrap()
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
        self.lock().poll(at)
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
                "<panic>" => panic!("a bug"),
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
        Ok(())
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
