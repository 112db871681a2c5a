//! The experimenter's desk: everything about the session in fifteen rows, in the experimenter's
//! language.

use crate::tui::desk::{Desk, Say, Strip, Visit, is_almost_full, size};
use crate::tui::theme::Theme;
use crate::tui::widgets::{left, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use std::fmt::Display;
use study_plan::protocol::phrases::Phrase;
use study_session::page::{Page, clock};
use study_session::session::view::{DeviceState, Mirror, Telemetry};
use study_session::session::{Screen, View};

/// Smallest size of a terminal in which everything has room: columns and rows.
pub const MINIMUM: (u16, u16) = (60, 20);
/// Ids of who may come next that are shown.
const NEXT: usize = 3;
/// Stands where there is nothing to say.
const NOTHING: &str = "–";

/// The desk, below the banner and above the keys.
#[derive(Debug)]
pub struct DeskView<'a> {
    /// What the session shows.
    pub view: &'a View,
    /// What it says to the participant.
    pub page: &'a Page,
    /// What is known besides.
    pub desk: &'a Desk,
    /// The course of the session.
    pub strip: &'a Strip,
    /// The styles.
    pub theme: Theme,
}

impl DeskView<'_> {
    fn say(&self, say: Say) -> String {
        say.get(self.desk.language).to_owned()
    }

    fn fill(&self, say: Say, name: &str, value: &dyn Display) -> String {
        say.fill(self.desk.language, &[(name, value)])
    }

    fn participant(&self) -> String {
        let who = self.view.line.participant.clone();
        match self.view.course.session {
            0 => who,
            n => joined([who, self.fill(Say::Session, "n", &n)]),
        }
    }

    fn trial(&self) -> String {
        let course = self.view.course;
        let now = self.page.progress.as_ref().map(|at| at.words.clone());
        let done = course.total.map(|total| {
            let values = [("n", &course.done as &dyn Display), ("total", &total)];
            self.view.words.fill(Phrase::DoneOf, &values)
        });
        let part = course.part.filter(|(_, of)| *of > 1).map(|(n, of)| {
            let values = [("n", &n as &dyn Display), ("total", &of)];
            Say::Part.fill(self.desk.language, &values)
        });
        let known = joined([now, done, part].into_iter().flatten());
        match known.is_empty() {
            true => NOTHING.to_owned(),
            false => known,
        }
    }

    /// What the participant does, with the time that it takes or has taken.
    fn doing(&self) -> String {
        let (say, time) = match &self.view.screen {
            Screen::Consent { .. } => (Say::Consents, None),
            Screen::Message { .. } | Screen::End { .. } => (Say::Reads, None),
            Screen::Reference { wait_s, .. } => (Say::Before, until(*wait_s)),
            Screen::Form { .. } => (Say::Answers, None),
            Screen::Playing { since_s, .. } => (Say::Feels, Some(clock(*since_s))),
            Screen::Loading { .. } | Screen::Stopping | Screen::Mount { .. } => (Say::Waits, None),
            Screen::Stopped { .. } => (Say::Stopped, None),
            Screen::Break { wait_s, .. } => (Say::Rests, until(*wait_s)),
            Screen::Paused { since_s } => (Say::Rests, Some(clock(*since_s))),
            Screen::Saving | Screen::SaveTrouble { .. } => (Say::Saves, None),
            Screen::Who { .. } | Screen::ResumeChoice { .. } => (Say::NoSession, None),
            Screen::DeviceTrouble { .. } => (Say::Fault, None),
        };
        let sheet = self.page.sheet.as_ref().map(|at| at.words.clone());
        let interval = self.page.interval.as_ref();
        let interval = interval.map(|at| format!("{} / {}", at.at, at.of));
        joined(
            [Some(self.say(say)), time, interval, sheet]
                .into_iter()
                .flatten(),
        )
    }

    fn time(&self) -> String {
        let so_far = clock(self.view.line.elapsed_s);
        let to_come = match self.view.course.left_s {
            Some(left_s) => {
                let minutes = (left_s / 60.0).ceil().clamp(0.0, 1e6);
                self.fill(Say::Left, "n", &minutes)
            }
            None => self.say(Say::LeftUnknown),
        };
        joined([self.fill(Say::SoFar, "time", &so_far), to_come])
    }

    fn device(&self) -> (String, bool) {
        let (say, bad) = match self.view.line.device {
            DeviceState::Unknown => (Say::NoSession, false),
            DeviceState::Limp => (Say::Limp, false),
            DeviceState::Loading => (Say::Loading, false),
            DeviceState::Ready => (Say::DeviceReady, false),
            DeviceState::Running(Telemetry::None) => (Say::Running, false),
            DeviceState::Running(Telemetry::Arrives) => (Say::Reports, false),
            DeviceState::Running(Telemetry::Silent) => (Say::Silent, true),
            DeviceState::Stopping => (Say::Stopping, false),
            DeviceState::Fault => (Say::Fault, true),
            DeviceState::Lost => (Say::Lost, true),
            DeviceState::ByHand => (Say::ByHand, false),
            DeviceState::Felt => (Say::Felt, false),
        };
        (self.say(say), bad)
    }

    /// How long it is felt, and whether that is enough: as the participant's page tells it.
    fn exposure(&self) -> String {
        let Screen::Playing {
            since_s,
            keep_exploring,
            exposure,
            ..
        } = &self.view.screen
        else {
            return NOTHING.to_owned();
        };
        let time = |s: f64| clock(s.ceil());
        let least =
            (exposure.min_s > 0.0).then(|| self.fill(Say::AtLeast, "time", &time(exposure.min_s)));
        let most = exposure
            .max_s
            .map(|s| self.fill(Say::AtMost, "time", &time(s)));
        let enough = self.say(match keep_exploring {
            true => Say::More,
            false => Say::Enough,
        });
        let all = [Some(clock(*since_s)), least, most, Some(enough)];
        joined(all.into_iter().flatten())
    }

    /// How many strokes are required, and, once only they can be missing, whether they are made.
    /// A count would depend on what is felt.
    fn strokes(&self) -> String {
        let required = match self.view.course.minimum_strokes {
            0 => return self.say(Say::NotRequired),
            n => self.fill(Say::Required, "n", &n),
        };
        match &self.view.screen {
            Screen::Playing {
                since_s,
                keep_exploring,
                exposure,
                ..
            } if *since_s >= exposure.min_s => {
                let enough = match keep_exploring {
                    true => Say::More,
                    false => Say::Enough,
                };
                joined([required, self.say(enough)])
            }
            _ => required,
        }
    }

    fn saved(&self) -> (String, bool) {
        let line = &self.view.line;
        let (mirror, bad) = match line.mirror {
            None => (Say::NoMirror, false),
            Some(Mirror::InStep) => (Say::InStep, false),
            Some(Mirror::OnlyResults) => (Say::OnlyResults, true),
            Some(Mirror::OnlyMirror) => (Say::OnlyMirror, true),
        };
        let count = format!("{} / {}", line.trials_saved, line.trials_answered);
        let saving = (!line.all_saved).then(|| self.view.words.get(Phrase::Saving).to_owned());
        let all = [Some(count), saving, Some(self.say(mirror))];
        (joined(all.into_iter().flatten()), bad)
    }

    fn disk(&self) -> (String, bool) {
        match self.desk.free.bytes() {
            None => (NOTHING.to_owned(), false),
            Some(bytes) if is_almost_full(bytes) => {
                (self.fill(Say::AlmostFull, "size", &size(bytes)), true)
            }
            Some(bytes) => (self.fill(Say::Free, "size", &size(bytes)), false),
        }
    }

    /// Who may come next, without the participant of the session.
    fn next(&self) -> String {
        let others = self.desk.next.iter();
        let others = others.filter(|id| **id != self.view.line.participant);
        let ids: Vec<&str> = others.take(NEXT).map(String::as_str).collect();
        match ids.is_empty() {
            true => self.say(Say::Nobody),
            false => ids.join(", "),
        }
    }

    fn visits(&self, visits: &[Visit]) -> (String, bool) {
        let others: Vec<String> = (visits.iter())
            .filter(|visit| visit.participant != self.view.line.participant)
            .map(|visit| format!("{} {}", visit.participant, visit.what))
            .collect();
        match others.is_empty() {
            true => (self.say(Say::Nobody), false),
            false => (joined(others), true),
        }
    }

    /// The rows down to the strip, and those below its legend, up to the notes.
    fn lines(&self) -> [Vec<(Say, String, bool)>; 2] {
        let calm = |label: Say, text: String| (label, text, false);
        let told = |label: Say, (text, bad): (String, bool)| (label, text, bad);
        let due = self.visits(&self.desk.due).0;
        [
            vec![
                calm(Say::Participant, self.participant()),
                calm(Say::Trial, self.trial()),
                calm(Say::Page, self.doing()),
                calm(Say::Time, self.time()),
                told(Say::Device, self.device()),
                calm(Say::Exposure, self.exposure()),
                calm(Say::Strokes, self.strokes()),
            ],
            vec![
                told(Say::Saved, self.saved()),
                told(Say::Disk, self.disk()),
                calm(Say::Next, self.next()),
                told(Say::Overdue, self.visits(&self.desk.overdue)),
                calm(Say::Due, due),
            ],
        ]
    }

    /// The width of the labels with the gap after them, cells.
    fn labels(&self) -> usize {
        let wide = |say: Say| wrap::width(say.get(self.desk.language));
        Say::LABELS.into_iter().map(wide).max().unwrap_or(0) + 2
    }

    /// Draws a label and a text, which is cut where it has no room.
    fn labeled(&self, area: Rect, label: Say, text: &str, style: Style, buf: &mut Buffer) {
        let (wide, label) = (self.labels(), self.say(label));
        let gap = " ".repeat(wide.saturating_sub(wrap::width(&label)));
        let columns = usize::from(area.width).saturating_sub(wide);
        let line = Line::from(vec![
            Span::styled(format!("{label}{gap}"), self.theme.quiet()),
            Span::styled(wrap::one_line(text, columns), style),
        ]);
        left(buf, area, &line);
    }

    /// The remarks, newest first, in the rows that are left.
    fn notes(&self, area: Rect, buf: &mut Buffer) {
        let remarks = &self.view.remarks;
        if remarks.is_empty() {
            return self.labeled(row(area, 0), Say::Notes, NOTHING, self.theme.text(), buf);
        }
        for (y, remark) in (0..area.height).zip(remarks) {
            let place = row(area, y);
            match y {
                0 => self.labeled(place, Say::Notes, remark, self.theme.text(), buf),
                _ => {
                    let wide = self.labels();
                    let columns = usize::from(area.width).saturating_sub(wide);
                    let text = wrap::one_line(remark, columns);
                    let text = format!("{}{text}", " ".repeat(wide));
                    left(buf, place, &styled(text, self.theme.text()));
                }
            }
        }
    }
}

/// The time that is left, if some is.
fn until(wait_s: f64) -> Option<String> {
    (wait_s > 0.0).then(|| clock(wait_s.ceil()))
}

fn joined(parts: impl IntoIterator<Item = String>) -> String {
    parts.into_iter().collect::<Vec<_>>().join(" · ")
}

impl Widget for &DeskView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let area = area.inner(Margin::new(1, 0));
        let [above, below] = self.lines();
        let mut y: u16 = 0;
        let draw = |lines: Vec<(Say, String, bool)>, y: &mut u16, buf: &mut Buffer| {
            for (label, text, bad) in lines {
                let style = match bad {
                    true => self.theme.trouble_frame(),
                    false => self.theme.text(),
                };
                self.labeled(row(area, *y), label, &text, style, buf);
                *y += 1;
            }
        };
        draw(above, &mut y, buf);
        let columns = usize::from(area.width).saturating_sub(self.labels());
        let strip = self.strip.text(columns);
        self.labeled(row(area, y), Say::Course, &strip, self.theme.chosen(), buf);
        let legend = wrap::one_line(Say::Legend.get(self.desk.language), area.width.into());
        left(buf, row(area, y + 1), &styled(legend, self.theme.quiet()));
        y += 2;
        draw(below, &mut y, buf);
        let notes = rows(area, y, area.height.saturating_sub(y));
        self.notes(notes, buf);
    }
}
