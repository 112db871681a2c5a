//! The meaning of a key press, independent of the screen.
//!
//! A terminal sends Alt as an Esc before the key, so that Esc and a key pressed
//! right after it may arrive as one. An Alt with a character therefore counts as
//! Esc: an unnecessary stop of the device is harmless, a missed one is not.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::page::Does;

/// A key press.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// Enter.
    Enter,
    /// A new line in a text: Alt-Enter, Shift-Enter or Ctrl-J.
    NewLine,
    /// Esc.
    Esc,
    /// Tab.
    Tab,
    /// Shift-Tab.
    BackTab,
    /// Left arrow.
    Left,
    /// Right arrow.
    Right,
    /// Up arrow.
    Up,
    /// Down arrow.
    Down,
    /// Ctrl-Left.
    WordLeft,
    /// Ctrl-Right.
    WordRight,
    /// Home, or Ctrl-A.
    Home,
    /// End.
    End,
    /// Page up.
    PageUp,
    /// Page down.
    PageDown,
    /// Backspace.
    Backspace,
    /// Delete.
    Delete,
    /// Ctrl-W.
    DeleteWord,
    /// Ctrl-U.
    DeleteToStart,
    /// A character, Space included.
    Char(char),
    /// F1.
    Help,
    /// F2 or Ctrl-R.
    Remark,
    /// F3 or Ctrl-E.
    Correct,
    /// F4 or Ctrl-B.
    MarkBad,
    /// F5 or Ctrl-P.
    Pause,
    /// F6 or Ctrl-D.
    Decline,
    /// F7 or Ctrl-F.
    Replay,
    /// F9 or Ctrl-G: the desk, or the participant's page.
    Desk,
    /// F10, Ctrl-Q or Ctrl-C.
    Quit,
    /// Ctrl-Z.
    Suspend,
}

/// The name of the key that does something on the page that offers it.
pub fn of(does: Does) -> &'static str {
    match does {
        Does::Advance | Does::Answer | Does::PlayAgain | Does::RetrySave => "Enter",
        Does::Agree => "y",
        Does::Refuse => "n",
        Does::RateStopped => "r",
        // Not the key that confirms a level once it has stopped.
        Does::Compare => "s",
        Does::Lower => "←",
        Does::Higher => "→",
        Does::RestartBlock => "b",
        Does::Continue => "c",
        Does::DropOut => "d",
        Does::Back => "Shift-Tab",
        Does::Decline => "F6",
        Does::Replay => "F7",
        Does::Quit => "F10",
        Does::Stop => "Esc",
    }
}

/// Whether a key says yes: `y`, or the first letter of the word in the language of the study,
/// unless that is the one of no.
pub fn is_yes(key: Key, words: &Words) -> bool {
    let Key::Char(typed) = key else {
        return false;
    };
    let typed = typed.to_ascii_lowercase();
    let own = words.get(Phrase::Yes).chars().next();
    let own = own
        .map(|c| c.to_ascii_lowercase())
        .filter(|c| c.is_ascii_lowercase());
    typed == 'y' || (typed != 'n' && own == Some(typed))
}

/// The key of an event; `None` for releases and for keys without a function.
pub fn read(event: &KeyEvent) -> Option<Key> {
    if event.kind == KeyEventKind::Release {
        return None;
    }
    let control = event.modifiers.contains(KeyModifiers::CONTROL);
    let alt = event.modifiers.contains(KeyModifiers::ALT);
    let shift = event.modifiers.contains(KeyModifiers::SHIFT);
    Some(match event.code {
        KeyCode::Enter if alt || shift => Key::NewLine,
        KeyCode::Enter => Key::Enter,
        KeyCode::Esc => Key::Esc,
        KeyCode::BackTab => Key::BackTab,
        KeyCode::Tab if shift => Key::BackTab,
        KeyCode::Tab => Key::Tab,
        KeyCode::Left if control || alt => Key::WordLeft,
        KeyCode::Right if control || alt => Key::WordRight,
        KeyCode::Left => Key::Left,
        KeyCode::Right => Key::Right,
        KeyCode::Up => Key::Up,
        KeyCode::Down => Key::Down,
        KeyCode::Home => Key::Home,
        KeyCode::End => Key::End,
        KeyCode::PageUp => Key::PageUp,
        KeyCode::PageDown => Key::PageDown,
        KeyCode::Backspace if control || alt => Key::DeleteWord,
        KeyCode::Backspace => Key::Backspace,
        KeyCode::Delete => Key::Delete,
        KeyCode::F(1) => Key::Help,
        KeyCode::F(2) => Key::Remark,
        KeyCode::F(3) => Key::Correct,
        KeyCode::F(4) => Key::MarkBad,
        KeyCode::F(5) => Key::Pause,
        KeyCode::F(6) => Key::Decline,
        KeyCode::F(7) => Key::Replay,
        KeyCode::F(9) => Key::Desk,
        KeyCode::F(10) => Key::Quit,
        // AltGr arrives as Ctrl and Alt on some systems: a character.
        KeyCode::Char(c) if control && alt => Key::Char(c),
        KeyCode::Char(c) if control => return with_control(c.to_ascii_lowercase()),
        KeyCode::Char(_) if alt => Key::Esc,
        KeyCode::Char(c) => Key::Char(c),
        _ => return None,
    })
}

fn with_control(c: char) -> Option<Key> {
    Some(match c {
        'a' => Key::Home,
        'b' => Key::MarkBad,
        'c' | 'q' => Key::Quit,
        'd' => Key::Decline,
        'e' => Key::Correct,
        'f' => Key::Replay,
        'g' => Key::Desk,
        'h' => Key::Backspace,
        'j' => Key::NewLine,
        'p' => Key::Pause,
        'r' => Key::Remark,
        'u' => Key::DeleteToStart,
        'w' => Key::DeleteWord,
        'z' => Key::Suspend,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_arrives_together_with_esc_is_still_a_stop() {
        let pressed = KeyEvent::new(KeyCode::Char(' '), KeyModifiers::ALT);
        assert_eq!(read(&pressed), Some(Key::Esc));
    }

    #[test]
    fn the_release_of_a_key_means_nothing() {
        let mut released = KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE);
        released.kind = KeyEventKind::Release;
        assert_eq!(read(&released), None);
    }

    #[test]
    fn every_command_has_a_function_key_and_a_letter() {
        for (function, letter, key) in [
            (2, 'r', Key::Remark),
            (3, 'e', Key::Correct),
            (4, 'b', Key::MarkBad),
            (5, 'p', Key::Pause),
            (6, 'd', Key::Decline),
            (9, 'g', Key::Desk),
            (10, 'q', Key::Quit),
            (10, 'c', Key::Quit),
        ] {
            let f = KeyEvent::new(KeyCode::F(function), KeyModifiers::NONE);
            let c = KeyEvent::new(KeyCode::Char(letter), KeyModifiers::CONTROL);
            assert_eq!((read(&f), read(&c)), (Some(key), Some(key)));
        }
    }
}
