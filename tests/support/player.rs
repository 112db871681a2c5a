//! A participant who takes part by keys alone, looking only at the screen.
//!
//! Every key is pressed once, on a complete page that asks for it (once more if nothing happens), and
//! the player then waits for what only that key can have changed. A clock that ticks, a notice that
//! appears and a counter that moves do not count as an answer.

use super::{PATIENCE, Shown, Terminal};
use std::time::{Duration, Instant};
use study::tui::pace::TYPED;

/// The action of the player at a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Did {
    /// The page asks for nothing.
    Waited,
    /// The first screen was filled in.
    Who,
    /// A page of questions was answered.
    Answered,
    /// A playback was ended to rate it.
    Felt,
    /// Another page was confirmed.
    WentOn,
}

/// How a page says that a playback, one of several intervals or the last of them can be ended.
const FELT: [&str; 3] = ["Enter: rate", "Enter: next", "Enter: answer"];

/// A key on a page that has not changed for so long was not read.
const NOT_READ: Duration = Duration::from_secs(10);

/// Interval between two reads of the screen.
const INTERVAL: Duration = Duration::from_millis(3);

/// Does the one thing that `page` asks for, and waits for its effect. The caller's own look at
/// the screen decides: another one may show the page after it.
pub fn play(terminal: &mut Terminal, participant: &str, page: &Shown) -> Did {
    act(terminal, participant, page, None)
}

/// The same for the page that is shown now, but waits no longer than `until`.
pub fn play_before(terminal: &mut Terminal, participant: &str, until: Instant) -> Did {
    let page = terminal.shown();
    act(terminal, participant, &page, Some(until))
}

/// Plays until the screen contains `text`; the pages that were seen on the way. That
/// page itself is left as it is.
pub fn play_until(terminal: &mut Terminal, participant: &str, text: &str) -> Vec<String> {
    play_while(terminal, participant, |terminal, page| {
        assert!(
            terminal.runs() || page.contains(text),
            "it ended before `{text}`:\n{page}"
        );
        !page.contains(text)
    })
}

/// Plays until the program has ended with success; the pages that were seen.
pub fn play_to_end(terminal: &mut Terminal, participant: &str) -> Vec<String> {
    let seen = play_while(terminal, participant, |terminal, _| terminal.runs());
    assert_eq!(terminal.exit_code(), 0, "{}", terminal.screen());
    seen
}

fn play_while(
    terminal: &mut Terminal,
    participant: &str,
    mut goes_on: impl FnMut(&mut Terminal, &str) -> bool,
) -> Vec<String> {
    let mut seen: Vec<String> = Vec::new();
    let mut last = (String::new(), Instant::now());
    loop {
        // One read decides: a later one may show another page.
        let page = terminal.shown();
        if !goes_on(terminal, &page.text) {
            return seen;
        }
        let now = without_clocks(&page);
        if last.0 != now {
            last = (now, Instant::now());
        }
        assert!(
            last.1.elapsed() < PATIENCE,
            "nothing happens:\n{}",
            page.text
        );
        if seen.last() != Some(&page.text) {
            seen.push(page.text.clone());
        }
        if act(terminal, participant, &page, None) == Did::Waited {
            std::thread::sleep(INTERVAL);
        }
    }
}

/// The experimenter's keys, as a terminal sends them.
pub const F2: &str = "\u{1b}OQ";
pub const F3: &str = "\u{1b}OR";
pub const F4: &str = "\u{1b}OS";
pub const F7: &str = "\u{1b}[18~";
pub const F10: &str = "\u{1b}[21~";

/// Presses Enter after keys whose effect is on the screen. With them it would be pasted.
pub fn enter(terminal: &mut Terminal) {
    std::thread::sleep(2 * TYPED);
    terminal.keys("\r");
}

/// Opens a dialog by its key, waits for its title and types into it what ends it.
pub fn dialog(terminal: &mut Terminal, key: &str, title: &str, typed: &str) {
    terminal.keys(key);
    terminal.wait_for(title);
    terminal.keys(typed);
    terminal.wait_until("the dialog to close", |s| !s.contains(title));
}

/// Marks the trial under way, or the last one, as bad.
pub fn mark_bad(terminal: &mut Terminal, reason: &str) {
    dialog(terminal, F4, "Enter: mark as bad", &format!("{reason}\r"));
}

/// Corrects the newest answer.
pub fn correct_newest(terminal: &mut Terminal, answer: &str, reason: &str) {
    terminal.keys(F3);
    terminal.wait_for("Correct");
    terminal.keys("\r");
    terminal.wait_until("the new answer", |s| s.contains("Enter: continue"));
    terminal.keys(&format!("{answer}\r"));
    terminal.wait_until("the reason", |s| s.contains("Enter: correct"));
    terminal.keys(&format!("{reason}\r"));
    terminal.wait_until("the dialog to close", |s| !s.contains("Enter: correct"));
}

/// Leaves the session.
pub fn quit(terminal: &mut Terminal) {
    terminal.keys(F10);
    terminal.wait_for("Are you sure?");
    terminal.keys("y");
    assert_eq!(terminal.exit_code(), 0, "{}", terminal.screen());
}

fn act(terminal: &mut Terminal, participant: &str, page: &Shown, until: Option<Instant>) -> Did {
    let shows = |text: &str| page.text.contains(text);
    let answer = rating(&page.text);
    // What is typed first, how the page shows that it has been read, and the key.
    let (typed, look, key, did) = if shows("Who takes part?") && shows("Enter: begin") {
        let look = format!("┃ {participant}");
        (participant.to_owned(), look, "\r", Did::Who)
    } else if shows("yes, I agree") {
        (String::new(), String::new(), "y", Did::WentOn)
    } else if FELT.into_iter().any(shows) && shows("Feel the ") {
        (String::new(), String::new(), "\r", Did::Felt)
    } else if shows("Feel the device") || shows("aving …") {
        return Did::Waited;
    } else if shows("Are you sure?") {
        (String::new(), String::new(), "n", Did::WentOn)
    } else if ["1–7: choose", "1–9: choose"].into_iter().any(shows) {
        let look = format!("┃  {answer}  ┃");
        (answer.to_string(), look, "\r", Did::Answered)
    } else if shows("↑ ↓: choose") {
        ("1".to_owned(), "(●)".to_owned(), "\r", Did::Answered)
    } else if shows("Enter: save") {
        // Earlier answers may be on the page.
        let number = match shows("trial ") {
            true => format!("3{answer}"),
            false => "33".to_owned(),
        };
        (number.clone(), number, "\r", Did::Answered)
    } else if ["when ready", "mounted", "continue", "read on", "close"]
        .iter()
        .any(|word| shows(&format!("Enter: {word}")))
    {
        (String::new(), String::new(), "\r", Did::WentOn)
    } else {
        return Did::Waited;
    };
    let mut before = page.clone();
    if !compact(&body(page)).contains(&compact(&look)) {
        terminal.keys(&typed);
        // A key that comes with the page, before the program could note that it is on the screen, is
        // not meant for it. A person presses it again; more than that is a fault.
        let (untouched, pressed) = (body(page), Instant::now());
        let is_read = |now: &Shown| compact(&body(now)).contains(&compact(&look));
        let mut ignored = false;
        let mut read = waited(terminal, until, &look, |now| {
            before = now.clone();
            ignored = body(now) == untouched && pressed.elapsed() > NOT_READ;
            ignored || is_read(now)
        });
        if ignored {
            terminal.keys(&typed);
            read = waited(terminal, until, &look, |now| {
                before = now.clone();
                is_read(now)
            });
        }
        if !read {
            return did;
        }
    }
    // A page that follows an Enter offers the next one a moment later.
    if key == "\r" && !before.text.contains("Enter: ") {
        let offered = waited(terminal, until, "Enter to be offered", |now| {
            before = now.clone();
            now.text.contains("Enter: ")
        });
        if !offered {
            return did;
        }
    }
    std::thread::sleep(2 * TYPED);
    terminal.keys(key);
    let before = asked(&before);
    waited(terminal, until, "the page to change", |now| {
        asked(now) != before
    });
    did
}

/// Waits until a condition holds; false if `until` comes first or the program has ended.
/// Fails after [`PATIENCE`].
fn waited(
    terminal: &mut Terminal,
    until: Option<Instant>,
    what: &str,
    mut fine: impl FnMut(&Shown) -> bool,
) -> bool {
    let start = Instant::now();
    loop {
        let now = terminal.shown();
        if fine(&now) {
            return true;
        }
        if until.is_some_and(|until| Instant::now() >= until) || !terminal.runs() {
            return false;
        }
        assert!(
            start.elapsed() < PATIENCE,
            "waited for {what}:\n{}",
            now.text
        );
        std::thread::sleep(INTERVAL);
    }
}

/// The lines of a page, without the experimenter's line, the keys and the notice above
/// them.
fn body(page: &Shown) -> String {
    let lines: Vec<&str> = page.text.trim_end().lines().collect();
    lines[..lines.len().saturating_sub(6)].join("\n")
}

/// A text without spaces: a box is as wide as there is room.
fn compact(text: &str) -> String {
    text.replace(' ', "")
}

/// What a page asks for: its body and keys without numbers that move by themselves, and
/// the cursor. While the device plays only the keys count.
fn asked(page: &Shown) -> (String, Option<(u16, u16)>) {
    let keys = page.text.trim_end().lines().rev().nth(2);
    let mut text = keys.unwrap_or_default().to_owned();
    let intervals = ["FIRST", "SECOND", "THIRD"].into_iter();
    if page.text.contains("Feel the ") {
        text.extend(intervals.filter(|word| page.text.contains(word)));
    } else {
        text.push_str(&body(page));
    }
    (text.replace(|c: char| c.is_ascii_digit(), ""), page.cursor)
}

/// The page without numbers, which move by themselves.
fn without_clocks(page: &Shown) -> String {
    page.text.replace(|c: char| c.is_ascii_digit(), "")
}

/// A rating that changes from trial to trial: a constant rater may be excluded from an
/// analysis.
fn rating(screen: &str) -> u32 {
    let counted = screen.split_once("trial ");
    let (_, after) = counted
        .or_else(|| screen.split_once("practice "))
        .unwrap_or_default();
    let trial: String = after.chars().take_while(char::is_ascii_digit).collect();
    2 + trial.parse::<u32>().unwrap_or(3) % 5
}
