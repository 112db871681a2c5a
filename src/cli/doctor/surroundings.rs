//! What can be asked at once: processors and clock, the terminal, the participant's page.

use super::super::run::wants_plain;
use super::system;
use crate::doctor::{Machine, Page, Terminal};
use crate::screen::{Address, Gallery, Screen};
use crate::tui::ColorDepth;
use crate::tui::views::MINIMUM;
use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::time::Instant;
use study_plan::protocol::phrases::Words;

/// How often the clock is read to find its steps.
const READINGS: usize = 20_000;
/// An address that is in no network (RFC 5737).
const NOBODY: (Ipv4Addr, u16) = (Ipv4Addr::new(192, 0, 2, 1), 9);

/// Processors, how busy they are, and the clock.
pub(super) fn machine() -> Machine {
    let processors = std::thread::available_parallelism();
    Machine {
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        processors: processors.map_or(1, std::num::NonZero::get),
        busy: system::busy_processors(),
        clock_step_ns: clock_step_ns(),
    }
}

/// The smallest difference of two readings of the clock that is not zero.
fn clock_step_ns() -> Option<f64> {
    let mut before = Instant::now();
    let mut steps = Vec::new();
    for _ in 0..READINGS {
        let now = Instant::now();
        if now > before {
            steps.push((now - before).as_nanos());
        }
        before = now;
    }
    steps.into_iter().min().map(|ns| ns as f64)
}

/// The terminal of standard input and output.
pub(super) fn terminal() -> Terminal {
    let var = |name: &str| std::env::var(name).ok();
    let output = std::io::stdout().is_terminal();
    let size = output.then(crossterm::terminal::size);
    let (columns, rows) = MINIMUM;
    Terminal {
        input: std::io::stdin().is_terminal(),
        output,
        size: match size {
            Some(Ok((columns, rows))) if columns > 0 && rows > 0 => Some([columns, rows]),
            _ => None,
        },
        least: [columns, rows],
        positions: system::positions_text(),
        utf8: system::shows_utf8(var),
        colors: match ColorDepth::detect(var) {
            ColorDepth::Full => 256,
            ColorDepth::Sixteen => 16,
            ColorDepth::None => 0,
        },
        no_color: var("NO_COLOR").is_some_and(|value| !value.is_empty()),
        plain: wants_plain(var),
    }
}

/// Serves the participant's page for a moment, at the address that other computers see.
pub(super) fn page() -> Page {
    let ip = address();
    let at = SocketAddr::new(ip.unwrap_or(Ipv4Addr::LOCALHOST.into()), 0).ip();
    let served = at.to_string().parse::<Address>().and_then(|at| {
        let words = Words::new(None, &BTreeMap::new());
        Screen::open(at, None, &words, Gallery::default())
    });
    Page {
        address: ip.map(|ip| ip.to_string()),
        failure: served.err().map(|error| error.to_string()),
    }
}

/// The address with which this computer would reach another network. Nothing is sent.
fn address() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    socket.connect(NOBODY).ok()?;
    let ip = socket.local_addr().ok()?.ip();
    (!ip.is_loopback() && !ip.is_unspecified()).then_some(ip)
}
