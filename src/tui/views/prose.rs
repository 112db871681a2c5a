//! Screens that consist of text: instructions, prompts, pauses, choices by a letter.

use crate::tui::theme::Theme;
use crate::tui::ui_state::Reading;
use crate::tui::widgets::{
    BIG_ROWS, big, centre, centre_all, clock, left_all, middle, right, row, rows, styled,
};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_base::text::counted;
use study_core::protocol::phrases::Phrase;
use study_core::protocol::{DeviceKind, Entry};
use study_core::session::view::MessageKind;
use study_core::session::{Screen, View};

/// Width of the widest text column, in cells.
const COLUMN: u16 = 84;

/// Text in the middle of the page.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Prose {
    /// A dim line above the title.
    pub above: String,
    /// The title.
    pub title: String,
    /// The text below the title.
    pub body: String,
    /// Whether the body is a long text: left-aligned and scrollable.
    pub long: bool,
    /// A time below a long text, drawn large.
    pub big: String,
    /// The last line of a long text's page.
    pub below: String,
    /// Keys in a column: the key, its action, an explanation.
    pub choices: Vec<(&'static str, String, &'static str)>,
    /// The keys at the foot of the page and their actions.
    pub keys: Vec<(&'static str, Phrase)>,
}

/// The text of a screen; `None` for screens that show more than text.
pub fn prose(view: &View) -> Option<Prose> {
    let read_by_experimenter = view.entry == Entry::Experimenter;
    let read_out = |text: &str| {
        if read_by_experimenter {
            text.to_owned()
        } else {
            String::new()
        }
    };
    let words = &view.words;
    let by_hand = view.device == DeviceKind::Manual;
    let stopped = Stopped::of(view);
    let again = words.get(stopped.again);
    let ready: &[_] = if view.can_advance {
        &[("Enter", Phrase::Ready)]
    } else {
        &[]
    };
    Some(match &view.screen {
        Screen::ResumeChoice { gap_h, done, total } => Prose {
            title: "This session was not finished.".to_owned(),
            body: match total {
                Some(total) => format!(
                    "{done} of {total} trials are done. The last one was {} ago.",
                    ago(*gap_h)
                ),
                None => format!(
                    "{} done. The last one was {} ago.",
                    counted(*done as usize, "trial is", "trials are"),
                    ago(*gap_h)
                ),
            },
            choices: vec![
                (
                    "b",
                    "restart the block".to_owned(),
                    "the trials of the block are repeated",
                ),
                (
                    "c",
                    "continue where it stopped".to_owned(),
                    "later trials are flagged",
                ),
                (
                    "d",
                    "drop out".to_owned(),
                    "the participant does not return",
                ),
            ],
            ..Prose::default()
        },
        Screen::Consent { document, version } => Prose {
            above: read_out("Ask the participant"),
            title: words.get(Phrase::AgreeQuestion).to_owned(),
            body: if version.is_empty() {
                document.clone()
            } else {
                words.fill(
                    Phrase::Version,
                    &[("document", document), ("version", version)],
                )
            },
            choices: vec![
                ("y", words.get(Phrase::Agree).to_owned(), ""),
                ("n", words.get(Phrase::Refuse).to_owned(), ""),
            ],
            ..Prose::default()
        },
        Screen::Message { kind, text } => Prose {
            above: match kind {
                MessageKind::Welcome | MessageKind::Instructions => read_out("Read out"),
                MessageKind::Practice => words.get(Phrase::Practice).to_owned(),
                MessageKind::PracticeOver | MessageKind::Feedback => String::new(),
                MessageKind::Part => read_out("Read out"),
            },
            body: wrap::flow(text),
            long: true,
            keys: vec![("Enter", Phrase::Continue)],
            ..Prose::default()
        },
        Screen::Reference { prompt, wait_s } => Prose {
            above: read_out("Tell the participant"),
            title: prompt.clone(),
            body: if *wait_s > 0.0 {
                words.wait(*wait_s)
            } else {
                words.get(Phrase::AtLeisure).to_owned()
            },
            keys: ready.to_vec(),
            ..Prose::default()
        },
        Screen::Loading { .. } => Prose {
            title: words.get(Phrase::OneMoment).to_owned(),
            body: words.get(Phrase::Preparing).to_owned(),
            ..Prose::default()
        },
        Screen::Mount { code } => Prose {
            above: "For the experimenter".to_owned(),
            title: format!("Mount sample {code}."),
            body: "Press Enter when the sample is mounted.".to_owned(),
            keys: vec![("Enter", Phrase::Mounted), ("Esc", Phrase::Stop)],
            ..Prose::default()
        },
        Screen::Stopping => Prose {
            title: words.get(Phrase::Stopping).to_owned(),
            ..Prose::default()
        },
        Screen::Stopped { can_rate } => Prose {
            title: format!("■  {}", words.get(stopped.title)),
            body: words.get(stopped.body).to_owned(),
            choices: if *can_rate {
                vec![
                    ("Enter", again.to_owned(), ""),
                    ("r", words.get(stopped.rate).to_owned(), ""),
                ]
            } else {
                vec![("Enter", again.to_owned(), "")]
            },
            ..Prose::default()
        },
        Screen::Saving => Prose {
            title: words.get(Phrase::Saving).to_owned(),
            ..Prose::default()
        },
        Screen::Break {
            text,
            wait_s,
            done,
            total,
        } => Prose {
            big: if *wait_s > 0.0 {
                clock(wait_s.ceil())
            } else {
                String::new()
            },
            below: total.map_or_else(String::new, |total| {
                words.fill(Phrase::DoneOf, &[("n", done), ("total", &total)])
            }),
            above: words.get(Phrase::Break).to_owned(),
            body: wrap::flow(text),
            long: true,
            title: if *wait_s > 0.0 {
                words.wait(*wait_s)
            } else {
                String::new()
            },
            keys: ready.to_vec(),
            ..Prose::default()
        },
        Screen::Paused { since_s } => Prose {
            title: words.get(Phrase::Paused).to_owned(),
            body: words.fill(
                if by_hand || !view.force {
                    Phrase::PausedFor
                } else {
                    Phrase::PausedNoForce
                },
                &[("time", &clock(*since_s))],
            ),
            keys: vec![("Enter", Phrase::Continue), ("F10", Phrase::Quit)],
            ..Prose::default()
        },
        Screen::End { text } => Prose {
            body: wrap::flow(text),
            long: true,
            keys: vec![("Enter", Phrase::Close)],
            ..Prose::default()
        },
        Screen::Who { .. }
        | Screen::Form { .. }
        | Screen::Playing { .. }
        | Screen::DeviceTrouble { .. }
        | Screen::SaveTrouble { .. } => return None,
    })
}

/// The sentences of a stopped trial, by what was presented.
#[derive(Debug, Clone, Copy)]
pub struct Stopped {
    /// What is stopped.
    pub title: Phrase,
    /// What that means.
    pub body: Phrase,
    /// Present it again.
    pub again: Phrase,
    /// Rate it.
    pub rate: Phrase,
}

impl Stopped {
    /// Those of a view.
    pub fn of(view: &View) -> Self {
        let (title, body, again, rate) = match (view.device, view.force) {
            (DeviceKind::Manual, _) => (
                Phrase::StoppedSample,
                Phrase::LetGo,
                Phrase::FeelAgain,
                Phrase::RateFelt,
            ),
            (_, true) => (
                Phrase::StoppedDevice,
                Phrase::NoForce,
                Phrase::PlayAgain,
                Phrase::RateFelt,
            ),
            (_, false) => (
                Phrase::StoppedSample,
                Phrase::NotLost,
                Phrase::PlayAgain,
                Phrase::RateIt,
            ),
        };
        Self {
            title,
            body,
            again,
            rate,
        }
    }
}

/// What the participant does while it plays: the sentence, and, where more is needed, how
/// to go on.
pub fn attending(view: &View) -> (Phrase, Phrase) {
    match (view.device, view.force) {
        (DeviceKind::Manual, _) => (Phrase::FeelSample, Phrase::Longer),
        (_, true) => (Phrase::FeelDevice, Phrase::KeepExploring),
        (_, false) => (Phrase::Attend, Phrase::Longer),
    }
}

fn ago(gap_h: f64) -> String {
    if !gap_h.is_finite() || gap_h < 0.0 {
        "some time".to_owned()
    } else {
        let (count, unit) = match gap_h {
            h if h < 1.0 / 60.0 => (h * 3600.0, "second"),
            h if h < 1.0 => (h * 60.0, "minute"),
            h if h < 48.0 => (h, "hour"),
            h => (h / 24.0, "day"),
        };
        let count = count.floor().max(1.0);
        let plural = if count > 1.0 { "s" } else { "" };
        format!("{count} {unit}{plural}")
    }
}

/// The widget that draws a [`Prose`].
#[derive(Debug)]
pub struct ProseView<'a> {
    /// The text.
    pub prose: &'a Prose,
    /// How far a long text is scrolled.
    pub reading: Reading,
    /// The styles.
    pub theme: Theme,
}

impl ProseView<'_> {
    /// The lines of a long text and their area.
    fn text(&self, area: Rect) -> (Vec<String>, Rect) {
        let column = middle(area, COLUMN.min(area.width.saturating_sub(8)), area.height);
        let lines = wrap::paragraph(&self.prose.body, usize::from(column.width), usize::MAX);
        let head = u16::from(!self.prose.above.is_empty()) * 2;
        let foot = self.foot();
        let room = area.height.saturating_sub(head + foot).max(1);
        let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).min(room);
        let widest = lines.iter().map(|l| wrap::width(l)).max().unwrap_or(0);
        let used = height + head + foot;
        let top = head + area.height.saturating_sub(used) * 2 / 5;
        let narrow = u16::try_from(widest).unwrap_or(column.width);
        (lines, middle(rows(column, top, height), narrow, height))
    }

    /// Rows below a long text.
    fn foot(&self) -> u16 {
        let prose = self.prose;
        let some = |text: &str| u16::from(!text.is_empty());
        some(&prose.title) * 2 + some(&prose.big) * (BIG_ROWS + 1) + some(&prose.below) * 2
    }

    /// The largest scroll position and the number of lines on a page.
    pub fn room(&self, area: Rect) -> (usize, usize) {
        if !self.prose.long {
            return (0, 0);
        }
        let (lines, place) = self.text(area);
        let page = usize::from(place.height);
        (lines.len().saturating_sub(page), page)
    }

    fn long(&self, area: Rect, buf: &mut Buffer) {
        let (lines, place) = self.text(area);
        let page = usize::from(place.height);
        let from = self.reading.scrolled.min(lines.len().saturating_sub(page));
        let style = self.theme.text();
        if place.y >= area.y + 2 && !self.prose.above.is_empty() {
            let above = Rect {
                y: place.y - 2,
                height: 1,
                ..area
            };
            let line = styled(self.prose.above.as_str(), self.theme.quiet());
            centre(buf, above, &line);
        }
        if lines.len() <= 2 {
            let wide = Rect {
                x: area.x,
                width: area.width,
                ..place
            };
            centre_all(buf, wide, &lines, self.theme.strong());
        } else {
            left_all(buf, place, &lines[from..], style);
        }
        let more = lines.len() > from + page;
        let mut foot = Rect {
            y: place.bottom() + 1,
            height: area.bottom().saturating_sub(place.bottom() + 1),
            ..area
        };
        if !self.prose.big.is_empty() {
            let time = rows(foot, 0, BIG_ROWS);
            big(buf, time, &self.prose.big, self.theme.strong());
            foot = rows(foot, BIG_ROWS + 1, foot.height);
        }
        for text in [&self.prose.title, &self.prose.below] {
            if !text.is_empty() {
                centre(
                    buf,
                    row(foot, 0),
                    &styled(text.as_str(), self.theme.quiet()),
                );
                foot = rows(foot, 2, foot.height);
            }
        }
        let arrow = |text: &'static str| styled(text, self.theme.key());
        if from > 0 {
            right(buf, row(area, 0), &arrow("↑  "));
        }
        if more {
            right(buf, row(area, area.height.saturating_sub(1)), &arrow("↓  "));
        }
    }
}

impl Widget for &ProseView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let prose = self.prose;
        if prose.long {
            self.long(area, buf);
            return;
        }
        let columns = usize::from(area.width.saturating_sub(8).min(COLUMN)).max(1);
        let room = usize::from(area.height / 2).max(1);
        let above = wrap::paragraph(&prose.above, columns, 1);
        let title = wrap::paragraph(&prose.title, columns, room);
        let body = if prose.body.is_empty() {
            Vec::new()
        } else {
            wrap::paragraph(&prose.body, columns, room)
        };
        let len = |lines: &[String]| u16::try_from(lines.len()).unwrap_or(0);
        let has_above = !prose.above.is_empty();
        let choice_rows = u16::try_from(prose.choices.len() * 2).unwrap_or(0);
        let used = u16::from(has_above) * 2 + len(&title) + 2 + len(&body) + 1 + choice_rows;
        let mut y = area.height.saturating_sub(used) * 2 / 5;
        if has_above {
            centre_all(buf, rows(area, y, 1), &above, self.theme.quiet());
            y += 2;
        }
        centre_all(buf, rows(area, y, len(&title)), &title, self.theme.strong());
        y += len(&title) + 1;
        centre_all(buf, rows(area, y, len(&body)), &body, self.theme.text());
        y += len(&body) + 2;
        let widest = |(key, what, more): &(&str, String, &str)| {
            let more = if more.is_empty() {
                0
            } else {
                wrap::width(more) + 3
            };
            wrap::width(key).max(5) + 2 + wrap::width(what) + more
        };
        let wide = prose.choices.iter().map(widest).max().unwrap_or(0);
        let wide = u16::try_from(wide).unwrap_or(u16::MAX);
        for (key, what, more) in &prose.choices {
            let mut spans = vec![
                Span::styled(format!("{key:>5}"), self.theme.key()),
                Span::styled(format!("  {what}"), self.theme.text()),
            ];
            if !more.is_empty() {
                spans.push(Span::styled(format!(" – {more}"), self.theme.quiet()));
            }
            let at = middle(row(area, y), wide, 1);
            crate::tui::widgets::left(buf, at, &Line::from(spans));
            y += 2;
        }
    }
}
