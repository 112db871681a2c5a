//! docs/tutorial-first-study.md: beside its commands, its pictures: pages of the terminal and a figure.

use crate::markdown::page;
use crate::pictures::is_stored;
use crate::screen_picture::svg;
use crate::steps::Shell;
use crate::support::player::{enter, play_until, quit};
use crate::support::{Terminal, study};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use vt100::Screen;

pub const PAGE: &str = "docs/tutorial-first-study.md";

/// How often a session is begun to see its clock at [`SECONDS`]: a busy machine can stand still that long.
const TRIES: usize = 5;
/// What the clock shows in the picture of a playback: three seconds, in large digits.
const SECONDS: [&str; 3] = ["█▀█ ▄ █▀█ ▀▀█", "█ █ ▄ █ █  ▀█", "▀▀▀   ▀▀▀ ▀▀▀"];

#[test]
fn the_tutorial_says_what_its_commands_do() {
    let mut shell = Shell::new();
    shell.follow(&page(PAGE));
    let figures = shell.folder().join("rehearsal/my-study/analysis/figures");
    let drawn = fs::read_to_string(figures.join("fig10-means.svg")).unwrap();
    is_stored("docs/pictures/first-study-means.svg", &drawn);
}

/// A session of the tutorial on its first screen, in colors.
fn session(folder: &Path, hurry: bool) -> Terminal {
    let (code, _, err) = study(&["new", "my-study", "--seed", "1"], folder);
    assert_eq!(code, 0, "{err}");
    let variables = [("NO_COLOR", ""), crate::support::HURRY];
    let variables: Vec<(&str, &Path)> = (variables.into_iter().take(1 + usize::from(hurry)))
        .map(|(name, value)| (name, Path::new(value)))
        .collect();
    let mut terminal =
        Terminal::start_with(&["run", "my-study", "--pilot"], folder, 24, 80, &variables);
    terminal.wait_for("Who takes part?");
    terminal
}

/// The page that shows all of `texts` and saves nothing, as soon as it does, or none after `patience`.
fn seen(terminal: &Terminal, texts: &[&str], patience: Duration) -> Option<Screen> {
    let begun = Instant::now();
    loop {
        let screen = terminal.cells();
        let text = screen.contents();
        if !text.contains("aving …") && texts.iter().all(|part| text.contains(part)) {
            return Some(screen);
        }
        if begun.elapsed() > patience {
            return None;
        }
        std::thread::sleep(Duration::from_millis(3));
    }
}

/// The page after `keys`. What comes with a page, before the program has noted that it is on the screen, is not meant for
/// it: as a person would, this takes back what was read of it and types it again.
fn typed(terminal: &mut Terminal, keys: &str, texts: &[&str]) -> Screen {
    terminal.keys(keys);
    let read = seen(terminal, texts, Duration::from_secs(10));
    read.unwrap_or_else(|| {
        terminal.keys(&"\u{7f}".repeat(keys.len()));
        terminal.keys(keys);
        seen(terminal, texts, crate::support::PATIENCE).unwrap()
    })
}

/// Who takes part, the first playback after three seconds, and its rating; none if the clock was not seen.
fn first_pages(folder: &Path) -> Option<[Screen; 3]> {
    let patience = crate::support::PATIENCE;
    let mut terminal = session(folder, false);
    let who = typed(&mut terminal, "P01", &["┃ P01", "new, a pilot"]);
    play_until(&mut terminal, "P01", "Enter: rate");
    let felt = seen(&terminal, &SECONDS, Duration::from_secs(10));
    let pages = felt.map(|felt| {
        enter(&mut terminal);
        seen(&terminal, &["1–7: choose"], patience).unwrap();
        [who, felt, typed(&mut terminal, "5", &["┃  5  ┃"])]
    });
    quit(&mut terminal);
    pages
}

#[test]
fn the_pictures_are_the_pages_of_the_program() {
    let [who, felt, rated] = (0..TRIES)
        .find_map(|_| first_pages(tempfile::tempdir().unwrap().path()))
        .expect("the clock of a playback was never seen at three seconds");
    let home = tempfile::tempdir().unwrap();
    let mut terminal = session(home.path(), true);
    play_until(&mut terminal, "P01", "Enter: close");
    let end = seen(
        &terminal,
        &["Thank you!", "saved ✓"],
        crate::support::PATIENCE,
    )
    .unwrap();
    enter(&mut terminal);
    assert_eq!(terminal.exit_code(), 0);
    for (name, title, screen) in [
        ("who", "The first page asks who takes part", who),
        ("feel", "A playback after three seconds", felt),
        ("rate", "The question about realism, with 5 chosen", rated),
        ("end", "The last page of the session", end),
    ] {
        is_stored(
            &format!("docs/pictures/first-study-{name}.svg"),
            &svg(&screen, title),
        );
    }
}
