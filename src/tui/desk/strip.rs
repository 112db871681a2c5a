//! The course of a session as a strip: one cell for each few seconds.

use std::collections::VecDeque;
use study_session::session::Screen;

/// Time of a cell, s.
pub const CELL_S: f64 = 5.0;
/// Cells that are kept: twenty minutes.
const MOST: usize = 240;

/// What a participant does. Of several in one cell the last of this list is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Doing {
    /// Reads, or nothing is under way.
    Reads,
    /// A break or a pause.
    Rests,
    /// Waits for the device.
    Waits,
    /// Answers questions.
    Answers,
    /// Feels.
    Feels,
    /// Something is wrong.
    Trouble,
}

impl Doing {
    /// What is done at a screen.
    pub fn of(screen: &Screen) -> Self {
        match screen {
            Screen::Who { .. }
            | Screen::ResumeChoice { .. }
            | Screen::Consent { .. }
            | Screen::Message { .. }
            | Screen::Reference { .. }
            | Screen::Saving
            | Screen::End { .. } => Self::Reads,
            Screen::Break { .. } | Screen::Paused { .. } => Self::Rests,
            Screen::Loading { .. }
            | Screen::Mount { .. }
            | Screen::Stopping
            | Screen::Stopped { .. } => Self::Waits,
            Screen::Form { .. } => Self::Answers,
            Screen::Playing { .. } => Self::Feels,
            Screen::DeviceTrouble { .. } | Screen::SaveTrouble { .. } => Self::Trouble,
        }
    }

    /// Its mark, which differs without color.
    pub fn symbol(self) -> char {
        match self {
            Self::Reads => '·',
            Self::Rests => '─',
            Self::Waits => '░',
            Self::Answers => '▄',
            Self::Feels => '█',
            Self::Trouble => '!',
        }
    }
}

/// The cells so far, the last one open.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Strip {
    cells: VecDeque<Doing>,
    /// Number of the last cell, and what was done last.
    last: Option<(u64, Doing)>,
}

impl Strip {
    /// Adds what is done at a time since the beginning of the session, s. What was done last went on
    /// until then.
    pub fn add(&mut self, elapsed_s: f64, doing: Doing) {
        let number = (elapsed_s / CELL_S).clamp(0.0, 1e12) as u64;
        let (last, before) = self.last.unwrap_or((number, doing));
        for _ in 0..number.saturating_sub(last).min(MOST as u64) {
            self.cells.push_back(before);
        }
        // A cell in which something else begins has both.
        match self.cells.back_mut() {
            Some(open) => *open = (*open).max(doing),
            None => self.cells.push_back(doing),
        }
        while self.cells.len() > MOST {
            self.cells.pop_front();
        }
        self.last = Some((number.max(last), doing));
    }

    /// The last cells as text, the newest at the end.
    pub fn text(&self, columns: usize) -> String {
        let skipped = self.cells.len().saturating_sub(columns);
        self.cells
            .iter()
            .skip(skipped)
            .map(|cell| cell.symbol())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(course: &[(f64, Doing)]) -> String {
        let mut strip = Strip::default();
        for (at, doing) in course {
            strip.add(*at, *doing);
        }
        strip.text(80)
    }

    #[test]
    fn a_cell_shows_the_most_important_of_its_time() {
        let course = [
            (0.0, Doing::Reads),
            (1.0, Doing::Feels),
            (3.0, Doing::Reads),
        ];
        assert_eq!(strip(&course), "█");
        assert_eq!(strip(&[(0.0, Doing::Reads), (7.0, Doing::Answers)]), "·▄");
    }

    #[test]
    fn what_nobody_looked_at_went_on() {
        let course = [
            (1.0, Doing::Feels),
            (21.0, Doing::Reads),
            (26.0, Doing::Reads),
        ];
        // Cells of 5 s: felt until 21 s.
        assert_eq!(strip(&course), "█████·");
    }

    #[test]
    fn only_the_newest_cells_are_kept_and_shown() {
        let mut strip = Strip::default();
        strip.add(0.0, Doing::Feels);
        strip.add(1e9, Doing::Rests);
        assert_eq!(strip.cells.len(), MOST);
        strip.add(1e9 + CELL_S, Doing::Rests);
        assert_eq!(strip.text(2), "█─");
        // A clock that goes back adds nothing.
        let before = strip.clone();
        strip.add(3.0, Doing::Reads);
        assert_eq!(strip.text(9), before.text(9));
    }
}
