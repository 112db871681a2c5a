//! The participant's page: its link and its code, before the session.

use super::super::{Console, Failure, Kind};
use crate::screen::{Address, Screen, ScreenError};
use crossterm::event::{self, Event, KeyCode};
use std::io::IsTerminal as _;
use std::time::Duration;
use study_plan::protocol::{Entry, Protocol};

/// How often it is checked whether the page was opened.
const CHECK: Duration = Duration::from_millis(100);

/// Serves the page and says where. On a screen it waits until the page is open, because
/// the link is hidden during the session.
pub(super) fn open(
    at: Address,
    protocol: &Protocol,
    plain: bool,
    console: &mut Console,
) -> Result<Screen, Failure> {
    if protocol.session.entry == Entry::Experimenter {
        return Err(Failure::input(
            "in this study the experimenter types the answers, so that a page of the participant's own has no use",
        )
        .hint("run it without --screen, or set `entry = \"participant\"` in [session]"));
    }
    let words = protocol.text.phrases();
    let opened = Screen::open(at, protocol.text.lang.as_deref(), &words);
    let screen = opened.map_err(|e| unusable(&e))?;
    if plain {
        console.out(format!("The participant's page: {}\n", screen.link()))?;
        return Ok(screen);
    }
    let code: String = screen
        .code()
        .iter()
        .map(|line| format!("{line}\n"))
        .collect();
    console.out(format!(
        "{code}The participant's page, for one browser: {}\nOpen it now, or press Enter to begin without it.\n",
        screen.link()
    ))?;
    while std::io::stdin().is_terminal() && !screen.is_open() && !enter_pressed() {}
    Ok(screen)
}

/// Whether Enter was pressed; a terminal that cannot be read is reported by the session.
fn enter_pressed() -> bool {
    match event::poll(CHECK) {
        Ok(false) => false,
        Ok(true) => match event::read() {
            Ok(Event::Key(key)) => key.code == KeyCode::Enter,
            other => other.is_err(),
        },
        Err(_) => true,
    }
}

fn unusable(error: &ScreenError) -> Failure {
    Failure::new(Kind::Usage, error).hint(error.hint())
}
