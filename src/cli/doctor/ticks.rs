//! How late the threads of a session are: the one that serves the link and sends heartbeats, and
//! the one of the screen, each with the priority that it has in a session.

use crate::doctor::{Lateness, Spread};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};
use study_device::host::HEARTBEAT_INTERVAL;
use study_device::link::{Priority, priority};

/// Longest single wait of the thread that serves a link.
const TURN: Duration = Duration::from_millis(1);
/// Turns of the screen's thread.
const SCREEN: Duration = Duration::from_millis(10);

/// By how much turns and heartbeats came late, ms.
struct OfLink {
    priority: Priority,
    turns_ms: Vec<f64>,
    heartbeats_ms: Vec<f64>,
}

/// Threads that measure how late they are, until they are ended or dropped.
pub(super) struct Ticks {
    stop: Arc<AtomicBool>,
    link: Option<JoinHandle<OfLink>>,
    screen: Option<JoinHandle<Vec<f64>>>,
}

impl Ticks {
    /// Starts the threads.
    ///
    /// # Errors
    /// The operating system's.
    pub(super) fn start() -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let mut ticks = Self {
            stop: Arc::clone(&stop),
            link: None,
            screen: None,
        };
        let ended = Arc::clone(&stop);
        let link = Builder::new().name("link".to_owned());
        ticks.link = Some(link.spawn(move || serve(&ended))?);
        let screen = Builder::new().name("screen".to_owned());
        ticks.screen = Some(screen.spawn(move || show(&stop))?);
        Ok(ticks)
    }

    /// Ends them: how late they were, and the priority of the first. `None` if one had no turn.
    pub(super) fn end(mut self) -> Option<(Lateness, Priority)> {
        self.stop.store(true, Ordering::Relaxed);
        let link = self.link.take()?.join().ok()?;
        let screen = self.screen.take()?.join().ok()?;
        let lateness = Lateness {
            turn: Spread::of(link.turns_ms)?,
            heartbeat: Spread::of(link.heartbeats_ms)?,
            screen: Spread::of(screen)?,
        };
        Some((lateness, link.priority))
    }
}

impl Drop for Ticks {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// By how much a time is longer than it should be, ms.
fn late_ms(took: Duration, wanted: Duration) -> f64 {
    1e3 * took.saturating_sub(wanted).as_secs_f64()
}

/// As the thread of a link does: it waits at most 1 ms, and sends a heartbeat when one is due.
fn serve(stop: &AtomicBool) -> OfLink {
    let mut of_link = OfLink {
        priority: priority::raise(),
        turns_ms: Vec::new(),
        heartbeats_ms: Vec::new(),
    };
    let mut turn_at = Instant::now();
    let mut beat_at = turn_at;
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(TURN);
        let now = Instant::now();
        of_link.turns_ms.push(late_ms(now - turn_at, TURN));
        turn_at = now;
        if now - beat_at >= HEARTBEAT_INTERVAL {
            let late = late_ms(now - beat_at, HEARTBEAT_INTERVAL);
            of_link.heartbeats_ms.push(late);
            beat_at = now;
        }
    }
    of_link
}

/// As the thread of the screen does.
fn show(stop: &AtomicBool) -> Vec<f64> {
    priority::raise_nice();
    let mut turns_ms = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let begun = Instant::now();
        std::thread::sleep(SCREEN);
        turns_ms.push(late_ms(begun.elapsed(), SCREEN));
    }
    turns_ms
}
