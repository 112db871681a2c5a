//! The participant's screen before the session: link and code of the page, or a front's hello.

use super::super::{Console, Failure, Kind, command_line};
use crate::front::Front;
use crate::screen::{Address, Gallery, Screen, ScreenError, secret};
use crossterm::event::{self, Event, KeyCode};
use std::io::IsTerminal as _;
use std::time::Duration;
use study_analysis::load::Loaded;
use study_plan::protocol::{Entry, Protocol};

/// How often it is checked whether the page was opened.
const CHECK: Duration = Duration::from_millis(100);

/// Serves the page and says where. On a screen it waits until the page is open, because
/// the link is hidden during the session.
pub(super) fn open(
    at: Address,
    loaded: &Loaded,
    plain: bool,
    console: &mut Console,
) -> Result<Screen, Failure> {
    let protocol = &loaded.protocol;
    has_use(protocol, "--screen")?;
    let words = protocol.text.phrases();
    let gallery = Gallery::of(protocol, &loaded.files);
    let opened = gallery
        .and_then(|gallery| Screen::open(at, protocol.text.lang.as_deref(), &words, gallery));
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

/// Starts a front and waits until it says who it is.
pub(super) fn start(command: &str, protocol: &Protocol) -> Result<Front, Failure> {
    has_use(protocol, "--front")?;
    let words = protocol.text.phrases();
    let command = command_line::words("--front", command)?;
    let run = secret().map_err(|e| unusable(&e))?;
    let front = Front::open(command, run, protocol.text.lang.as_deref(), &words);
    front.map_err(|error| {
        Failure::new(Kind::Usage, &error)
            .hint("--front \"PROGRAM ARGUMENTS\" names a program that speaks docs/page.md")
    })
}

/// Refuses a study with media where no page shows and plays them.
pub(super) fn can_present(protocol: &Protocol, on_page: bool) -> Result<(), Failure> {
    if on_page || !protocol.has_media() {
        return Ok(());
    }
    Err(Failure::input(
        "this study has pictures, videos or sounds, which only the participant's page shows and plays",
    )
    .hint("run it with --screen, or with --screen=ADDRESS for a tablet; docs/screen.md"))
}

/// Refuses a screen of the participant's own where the experimenter types the answers.
fn has_use(protocol: &Protocol, option: &str) -> Result<(), Failure> {
    if protocol.session.entry != Entry::Experimenter {
        return Ok(());
    }
    Err(Failure::input(
        "in this study the experimenter types the answers, so that a page of the participant's own has no use",
    )
    .hint(format!("run it without {option}, or set `entry = \"participant\"` in [session]")))
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
