//! Which keys are meant for the page on the screen.
//!
//! A key that was pressed before a page appeared does not act on it, nor does an Enter so
//! soon after that nobody can have seen the page. An Enter right after another one does not
//! advance: the key is held, or was pressed twice. The wait is not begun again by whoever is
//! impatient, only by a key that is held. Nor does an Enter advance that comes with the key
//! before: both were pasted. In a dialog every key counts. Keys that stop, leave or open a
//! dialog always count.

use super::keys::{self, Key};
use crossterm::event::{Event, KeyEventKind};
use std::time::{Duration, Instant};

/// Time after an Enter before another one advances. Most keyboards begin to repeat a held
/// key sooner, and repeat it much faster.
pub const QUIET: Duration = Duration::from_millis(700);

/// An Enter that comes sooner after the last one is that of a held key: few people press a key
/// five times a second, and keyboards repeat it ten to thirty times.
pub const REPEATED: Duration = Duration::from_millis(200);

/// Time that a page has to be on the screen before an Enter can be meant for it, unless
/// another key came before. Simple reactions to what is seen take 180 ms or more (Luce 1986,
/// Response Times).
pub const SEEN: Duration = Duration::from_millis(150);

/// Keys that come closer together were not typed but pasted: the quickest typists make about
/// one stroke in 60 ms.
pub const TYPED: Duration = Duration::from_millis(10);

/// Decides by the time of each event whether it is meant for the page.
#[derive(Debug, Clone)]
pub struct Pace {
    /// Since when the page is on the screen.
    shown: Instant,
    /// Whether a key was meant for it.
    used: bool,
    /// The Enter whose [`QUIET`] time passes or was the last to pass, if no other key came
    /// after it.
    entered: Option<Instant>,
    /// The last Enter, if no other key came after it.
    last: Option<Instant>,
    /// The last other key, meant for the page or not.
    pressed: Option<Instant>,
    /// Whether the page asks for lines of text only, which may be pasted.
    of_lines: bool,
    /// [`QUIET`], [`REPEATED`] and [`SEEN`] are divided by this.
    times: u32,
}

impl Pace {
    /// A page that appears at a moment.
    pub fn new(shown: Instant) -> Self {
        Self {
            shown,
            used: false,
            entered: None,
            last: None,
            pressed: None,
            of_lines: false,
            times: 1,
        }
    }

    /// With less time between keys, for tests of the program.
    pub fn hurried(self, times: u32) -> Self {
        let times = times.max(1);
        Self { times, ..self }
    }

    /// Another page is on the screen since a moment; `of_lines`: it asks for lines of text
    /// only.
    pub fn turned(&mut self, shown: Instant, of_lines: bool) {
        self.of_lines = of_lines;
        self.shown = shown;
        self.used = false;
    }

    /// Whether an Enter at a moment would not advance.
    pub fn waits(&self, at: Instant) -> bool {
        let unseen = !self.used && self.is_within(SEEN, Some(self.shown), at);
        unseen || self.is_within(QUIET, self.entered, at) || self.is_within(REPEATED, self.last, at)
    }

    fn is_within(&self, time: Duration, after: Option<Instant>, at: Instant) -> bool {
        after.is_some_and(|after| at.saturating_duration_since(after) < time / self.times)
    }

    /// Whether an Enter at a moment comes with the key before it.
    fn pasted(&self, at: Instant) -> bool {
        let close = |before: Instant| at.saturating_duration_since(before) < TYPED;
        !self.of_lines && self.pressed.is_some_and(close)
    }

    /// Whether an event is meant for what is on the screen. `dialog`: a dialog is open;
    /// `armed`: Space stops the device.
    pub fn accepts(&mut self, event: &Event, at: Instant, dialog: bool, armed: bool) -> bool {
        let key = match event {
            Event::Key(event) => keys::read(event),
            _ => None,
        };
        let on_time = dialog || at >= self.shown || always(event, key, armed);
        if key == Some(Key::Enter) {
            let repeated = matches!(event, Event::Key(key) if key.kind == KeyEventKind::Repeat);
            let waits = repeated || self.pasted(at) || self.waits(at);
            if !self.is_within(QUIET, self.entered, at) {
                self.entered = Some(at);
            }
            self.last = Some(at);
            return dialog || (on_time && !waits);
        }
        if key.is_some() {
            self.pressed = Some(at);
        }
        if key.is_some() && on_time {
            (self.entered, self.last) = (None, None);
            self.used = true;
        }
        on_time
    }
}

/// Whether an event counts even if it is older than the page.
fn always(event: &Event, key: Option<Key>, armed: bool) -> bool {
    match key {
        Some(Key::Char(' ')) => armed,
        Some(key) => matches!(
            key,
            Key::Esc
                | Key::Quit
                | Key::Suspend
                | Key::Pause
                | Key::Help
                | Key::Remark
                | Key::Correct
                | Key::MarkBad
        ),
        None => matches!(event, Event::Resize(..)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

    fn key(code: KeyCode) -> Event {
        Event::Key(KeyEvent::new(code, KeyModifiers::NONE))
    }

    /// Whether a key counts at each of these times, in ms, on a page that appears at 100.
    fn accepted(code: KeyCode, times: &[u64], dialog: bool) -> Vec<bool> {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut pace = Pace::new(at(100));
        let times = times.iter();
        times
            .map(|ms| pace.accepts(&key(code), at(*ms), dialog, false))
            .collect()
    }

    #[test]
    fn of_quick_or_held_enters_only_the_first_advances() {
        let quick = [250, 300, 400, 500];
        assert_eq!(
            accepted(KeyCode::Enter, &quick, false),
            [true, false, false, false]
        );
        // the first repeat comes late, the others every 33 ms, for longer than the pause
        let held = [250, 910, 943, 976, 1009, 1042, 1742];
        let expected = [true, false, false, false, false, false, true];
        assert_eq!(accepted(KeyCode::Enter, &held, false), expected);
        assert_eq!(accepted(KeyCode::Enter, &quick, true), [true; 4]);
    }

    /// Whoever presses again and again goes on, if not with every press.
    #[test]
    fn who_is_impatient_does_not_stay_for_ever() {
        for (every_ms, most) in [(500, 2), (350, 3), (250, 4)] {
            let times: Vec<u64> = (0..40).map(|n| 250 + n * every_ms).collect();
            let counted = accepted(KeyCode::Enter, &times, false);
            let ignored = counted.split(|counts| *counts).map(<[bool]>::len).max();
            assert!(ignored < Some(most), "every {every_ms} ms: {counted:?}");
        }
    }

    #[test]
    fn a_key_from_before_the_page_counts_only_if_it_stops() {
        assert_eq!(
            accepted(KeyCode::Char('5'), &[99, 100], false),
            [false, true]
        );
        assert_eq!(accepted(KeyCode::Char('5'), &[99], true), [true]);
        assert_eq!(accepted(KeyCode::Esc, &[99], false), [true]);
        // it is forgotten, but one that follows at once is still its repetition
        assert_eq!(
            accepted(KeyCode::Enter, &[99, 350, 1050], false),
            [false, false, true]
        );
        let mut pace = Pace::new(Instant::now());
        let before = Instant::now().checked_sub(QUIET).unwrap();
        let space = key(KeyCode::Char(' '));
        assert!(pace.accepts(&space, before, false, true));
        assert!(!pace.accepts(&space, before, false, false));
    }

    #[test]
    fn an_enter_before_the_page_can_have_been_seen_does_not_advance() {
        assert_eq!(accepted(KeyCode::Enter, &[249], false), [false]);
        assert_eq!(accepted(KeyCode::Enter, &[250], false), [true]);
        assert_eq!(accepted(KeyCode::Enter, &[101], true), [true]);
        // after a choice on the page it is meant
        let start = Instant::now();
        let mut pace = Pace::new(start);
        assert!(pace.waits(start));
        assert!(pace.accepts(&key(KeyCode::Char('5')), start, false, false));
        assert!(!pace.waits(start + TYPED));
        assert!(pace.accepts(&key(KeyCode::Enter), start + TYPED, false, false));
        // but not on the next one
        let next = start + QUIET * 2;
        pace.turned(next, false);
        assert!(!pace.accepts(&key(KeyCode::Enter), next, false, false));
        assert!(pace.waits(next + SEEN));
        assert!(!pace.waits(next + QUIET));
    }

    #[test]
    fn a_choice_between_two_enters_makes_the_second_deliberate() {
        let shown = Instant::now();
        let mut pace = Pace::new(shown);
        let start = shown + SEEN;
        assert!(pace.accepts(&key(KeyCode::Enter), start, false, false));
        assert!(pace.waits(start));
        assert!(pace.accepts(&key(KeyCode::Char('5')), start, false, false));
        assert!(!pace.waits(start));
        assert!(pace.accepts(&key(KeyCode::Enter), start + TYPED, false, false));
    }

    /// A terminal that does not mark what is pasted sends it as keys.
    #[test]
    fn an_enter_that_comes_with_another_key_is_pasted_and_does_not_advance() {
        let shown = Instant::now();
        let at = |ms| shown + Duration::from_millis(ms);
        let pasted = |times: [u64; 2], dialog| {
            let mut pace = Pace::new(shown);
            pace.accepts(&key(KeyCode::Char('5')), at(times[0]), dialog, false);
            pace.accepts(&key(KeyCode::Enter), at(times[1]), dialog, false)
        };
        assert!(!pasted([2000, 2000], false));
        assert!(!pasted([2000, 2009], false));
        assert!(pasted([2000, 2010], false));
        assert!(pasted([2000, 2000], true));
        let mut pace = Pace::new(shown);
        pace.turned(shown, true);
        assert!(pace.accepts(&key(KeyCode::Char('1')), at(300), false, false));
        assert!(pace.accepts(&key(KeyCode::Enter), at(300), false, false));
    }

    #[test]
    fn a_repeat_that_the_terminal_reports_never_advances() {
        let start = Instant::now();
        let mut pace = Pace::new(start);
        let mut held = KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE);
        held.kind = KeyEventKind::Repeat;
        assert!(!pace.accepts(&Event::Key(held), start + QUIET * 2, false, false));
    }
}
