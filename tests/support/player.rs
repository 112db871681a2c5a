//! Somebody who takes part by keys alone, looking only at the screen.

use super::Terminal;
use std::time::{Duration, Instant};

/// What the player did at a screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Did {
    /// Nothing is asked at the moment.
    Waited,
    /// Something was typed at one of these.
    Who,
    /// A page of questions was answered.
    Answered,
    /// A playback was ended to rate it.
    Felt,
    /// Something else was confirmed.
    WentOn,
}

/// Does the one thing that the screen asks for, and waits for what comes of it.
pub fn play(terminal: &mut Terminal, participant: &str) -> Did {
    let screen = terminal.screen();
    let did = press(terminal, participant, &screen);
    if did != Did::Waited {
        // the clock in the last line says nothing of the key: it might be pressed twice
        let since = Instant::now();
        terminal.wait_until("the screen to change", |now| {
            body(now) != body(&screen) || (now != screen && since.elapsed() > CLOCK)
        });
    }
    did
}

/// After so long a change of the clock alone is taken for an answer.
const CLOCK: Duration = Duration::from_secs(5);

/// The screen without the experimenter's line.
fn body(screen: &str) -> &str {
    screen
        .trim_end()
        .rsplit_once('\n')
        .map_or(screen, |(body, _)| body)
}

/// The same, but waits no longer than `until`.
pub fn play_before(terminal: &mut Terminal, participant: &str, until: Instant) -> Did {
    let screen = terminal.screen();
    let did = press(terminal, participant, &screen);
    while did != Did::Waited && terminal.screen() == screen && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(2));
    }
    did
}

fn press(terminal: &mut Terminal, participant: &str, screen: &str) -> Did {
    let shows = |text: &str| screen.contains(text);
    let (keys, did) = if shows("Who takes part?") && shows("Enter begin") {
        (format!("\u{15}{participant}\r"), Did::Who)
    } else if shows("yes, I agree") {
        ("y".to_owned(), Did::WentOn)
    } else if shows("Enter to rate") {
        ("\r".to_owned(), Did::Felt)
    } else if shows("Feel the device") || shows("saving") {
        return Did::Waited;
    } else if shows("Are you sure?") {
        ("n".to_owned(), Did::WentOn)
    } else if shows("1–7 choose") {
        (format!("{}\r", rating(screen)), Did::Answered)
    } else if shows("↑ ↓ choose") {
        ("1\r".to_owned(), Did::Answered)
    } else if shows("Enter save") {
        ("33\r".to_owned(), Did::Answered)
    } else if [
        "when ready",
        "it is mounted",
        "goes on",
        "reads on",
        "closes",
    ]
    .iter()
    .any(|word| shows(&format!("Enter {word}")))
    {
        ("\r".to_owned(), Did::WentOn)
    } else {
        return Did::Waited;
    };
    terminal.keys(&keys);
    did
}

/// An opinion that changes from trial to trial: somebody who always says the same
/// is left out of an analysis.
fn rating(screen: &str) -> u32 {
    let (_, after) = screen.split_once("trial ").unwrap_or_default();
    let trial: String = after.chars().take_while(char::is_ascii_digit).collect();
    2 + trial.parse::<u32>().unwrap_or(3) % 5
}
