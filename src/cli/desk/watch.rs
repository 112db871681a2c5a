//! The desk in the terminal, read again and again. A disk that hangs does not keep anybody in it.

use super::text;
use crate::cli::overview::{self, Overview};
use crate::cli::{Failure, Kind};
use crate::tui::watching::Watching;
use crate::tui::wrap::one_line;
use std::path::PathBuf;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// Least time between two readings of the results.
const EVERY: Duration = Duration::from_secs(5);
/// Times the duration of a reading that must pass before the next one: sessions on the same computer
/// come first.
const IDLE: u32 = 19;
/// Longest wait for a key before the terminal is drawn again.
const SLICE: Duration = Duration::from_millis(100);

/// Shows the studies until q is pressed.
///
/// # Errors
/// [`Failure`] if the terminal cannot be used.
pub(super) fn watch(
    results: PathBuf,
    mirror: Option<PathBuf>,
    first: Vec<Overview>,
) -> Result<(), Failure> {
    let opened = Watching::open();
    let mut screen = opened.map_err(|error| {
        Failure::new(Kind::Usage, &error).hint("without --watch everything is printed once")
    })?;
    let (send, read) = channel();
    // It ends with the program, or when nobody listens any more.
    std::thread::Builder::new()
        .name("results".to_owned())
        .spawn(move || {
            let mut pause = EVERY;
            loop {
                std::thread::sleep(pause);
                let begun = Instant::now();
                let looked = overview::of_results(&results, mirror.as_deref());
                pause = EVERY.max(begun.elapsed() * IDLE);
                let looked = looked.map(|(studies, _)| studies);
                if send
                    .send(looked.map_err(|failure| failure.message))
                    .is_err()
                {
                    return;
                }
            }
        })
        .map_err(|error| Failure::input(format!("no thread can be started: {error}")))?;
    let (mut studies, mut trouble) = (first, None);
    let mut read_at = Instant::now();
    loop {
        match read.try_iter().last() {
            Some(Ok(newest)) => (studies, trouble, read_at) = (newest, None, Instant::now()),
            Some(Err(why)) => trouble = Some(why),
            None => {}
        }
        // It grows while a disk hangs.
        let age = read_at.elapsed();
        let lines = |columns, rows| page(&studies, trouble.as_deref(), age, (columns, rows));
        if screen.leaves(lines, SLICE) {
            return Ok(());
        }
    }
}

/// The lines of a terminal with so many columns and rows: the studies share its rows, and the last row has
/// the key and the age of what is shown.
fn page(
    studies: &[Overview],
    trouble: Option<&str>,
    age: Duration,
    (columns, rows): (usize, usize),
) -> Vec<String> {
    let room = rows.saturating_sub(2);
    let each = (room / studies.len().max(1)).saturating_sub(1);
    let mut lines = Vec::new();
    for study in studies {
        if !lines.is_empty() {
            lines.push(String::new());
        }
        lines.extend(text::within(study, columns, each.max(1)));
    }
    lines.truncate(room);
    lines.resize(room, String::new());
    lines.push(match trouble {
        Some(why) => one_line(&format!("CANNOT BE READ NOW: {why}"), columns),
        None => String::new(),
    });
    let seconds = age.as_secs();
    lines.push(one_line(
        &format!("q: quit · read {seconds} s ago"),
        columns,
    ));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_row_says_how_old_everything_is_and_the_one_above_why() {
        let age = Duration::from_secs(340);
        let lines = page(&[], Some("the disk\u{1b}[2J hangs"), age, (60, 20));
        assert_eq!(lines.len(), 20);
        assert_eq!(lines[19], "q: quit · read 340 s ago");
        assert_eq!(lines[18], "CANNOT BE READ NOW: the disk\\u{1b}[2J hangs");
        assert_eq!(page(&[], None, age, (60, 20))[18], "");
    }
}
