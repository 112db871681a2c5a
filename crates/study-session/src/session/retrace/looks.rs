//! Which views are pages, and which of them are the same.

use crate::outcome::{Entry, Event};
use crate::session::project_view::can_advance;
use crate::session::{Screen, View};
use study_plan::protocol::{Answer, DeviceKind, Question};

/// Whether a device reports the samples of its playbacks, so that its strokes are counted.
pub(super) fn reports_samples(kind: DeviceKind, entries: &[Entry]) -> bool {
    match kind {
        DeviceKind::Simulated | DeviceKind::Serial => true,
        DeviceKind::Manual => false,
        DeviceKind::Process => entries.iter().any(|entry| {
            matches!(&entry.event, Event::PlaybackEnded { playback, .. } if playback.samples > 0)
        }),
    }
}

/// Whether a page is too short to be read, or tells of what no journal has.
pub(super) fn passes(screen: &Screen) -> bool {
    matches!(
        screen,
        Screen::Who { .. }
            | Screen::Saving
            | Screen::Stopping
            | Screen::DeviceTrouble { .. }
            | Screen::SaveTrouble { .. }
    )
}

/// The view when all waiting on it is over.
pub(super) fn timeless(mut view: View) -> View {
    match &mut view.screen {
        Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => *wait_s = 0.0,
        Screen::Playing {
            since_s,
            keep_exploring,
            ..
        } => (*since_s, *keep_exploring) = (0.0, false),
        Screen::Paused { since_s } => *since_s = 0.0,
        _ => {}
    }
    view.can_advance = can_advance(&view.screen);
    view.line.elapsed_s = 0.0;
    view
}

/// Whether two views are the same page.
pub(super) fn is_same(a: &View, b: &View) -> bool {
    let all = |view: &View| {
        let Screen::Form {
            form, questions, ..
        } = &view.screen
        else {
            return Vec::new();
        };
        let given = |q: &Question| view.given(*form, &q.id).cloned();
        questions.iter().map(given).collect::<Vec<Option<Answer>>>()
    };
    a.screen == b.screen
        && a.progress == b.progress
        && (a.can_replay, a.can_go_back) == (b.can_replay, b.can_go_back)
        && all(a) == all(b)
}
