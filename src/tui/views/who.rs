//! The first screen: participant and operator.

use crate::tui::theme::Theme;
use crate::tui::ui_state::Who;
use crate::tui::widgets::{TextField, centre, left, middle, row, styled};
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::widgets::Widget;
use study_core::session::Roster;

/// The widget of the first screen.
#[derive(Debug)]
pub struct WhoView<'a> {
    /// What has been entered.
    pub who: &'a Who,
    /// Tells who a typed id is.
    pub roster: Option<&'a Roster>,
    /// Whether the session folder is being claimed.
    pub claiming: bool,
    /// Whether it has the focus.
    pub focused: bool,
    /// The styles.
    pub theme: Theme,
}

/// Width of the fields with their labels, in cells.
const WIDE: u16 = 56;
/// Width of the labels, in cells.
const LABEL: u16 = 14;

impl WhoView<'_> {
    fn fields(&self, area: Rect) -> [(&'static str, String, TextField<'_>, Rect); 2] {
        let place = middle(area, WIDE, 9);
        let at = |y| {
            let label = LABEL.min(place.width);
            let all = row(place, y);
            Rect {
                x: all.x + label.min(all.width),
                width: all.width.saturating_sub(label),
                ..all
            }
        };
        let field = |editor, on| TextField {
            editor,
            focused: self.focused && !self.claiming && self.who.on_operator == on,
            theme: self.theme,
        };
        let (participant, operator) = (&self.who.participant, &self.who.operator);
        let who = self
            .roster
            .and_then(|roster| roster.who(participant.text()));
        [
            (
                "Participant",
                who.unwrap_or_else(|| "a pseudonym, such as P01".to_owned()),
                field(participant, false),
                at(3),
            ),
            (
                "Operator",
                "your initials or a code".to_owned(),
                field(operator, true),
                at(6),
            ),
        ]
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        let fields = self.fields(area);
        fields
            .iter()
            .find_map(|(_, _, field, at)| field.cursor(*at))
    }
}

impl Widget for &WhoView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let place = middle(area, WIDE, 9);
        let title = if self.claiming {
            "One moment."
        } else {
            "Who takes part?"
        };
        let title = styled(title, self.theme.strong());
        centre(buf, row(place, 0), &title);
        for (label, hint, field, at) in self.fields(area) {
            let start = Rect {
                x: place.x,
                width: LABEL.min(place.width),
                ..at
            };
            let label = styled(label, self.theme.text());
            left(buf, start, &label);
            field.render(at, buf);
            let below = Rect { y: at.y + 1, ..at };
            if below.bottom() <= area.bottom() && !at.is_empty() {
                let hint = styled(format!("  {hint}"), self.theme.quiet());
                left(buf, below, &hint);
            }
        }
    }
}
