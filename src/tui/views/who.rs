//! The first screen: participant and operator.

use crate::tui::theme::Theme;
use crate::tui::ui_state::Who;
use crate::tui::widgets::{
    TextField, center, center_all, frame, left, left_all, middle, row, rows, styled,
};
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::widgets::Widget;
use study_session::session::Roster;

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

/// Width of the fields, in cells.
const WIDE: u16 = 56;
/// Rows of the title and the two boxed fields with their lines.
const ROWS: u16 = 10;
/// Rows below the title that say who has not finished and how to go on.
const PROPOSAL: u16 = 2;

impl WhoView<'_> {
    /// The title, the line below, the text and the box of each field.
    fn fields(&self, area: Rect) -> [(&'static str, String, TextField<'_>, Rect); 2] {
        let place = self.place(area);
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
                rows(place, 2 + self.proposal(), 3),
            ),
            (
                "Operator",
                "your initials or a code".to_owned(),
                field(operator, true),
                rows(place, 6 + self.proposal(), 3),
            ),
        ]
    }

    fn recent(&self) -> Vec<String> {
        let recent = self.roster.iter().flat_map(|roster| roster.recent());
        recent.map(|(id, who)| format!("{id:<12} {who}")).collect()
    }

    /// Rows of the sentences about somebody who has not finished; what is typed moves nothing.
    fn proposal(&self) -> u16 {
        let unfinished = self.roster.and_then(Roster::unfinished);
        unfinished.map_or(0, |_| PROPOSAL)
    }

    fn place(&self, area: Rect) -> Rect {
        let recent = u16::try_from(self.recent().len()).unwrap_or(0);
        let more = if recent > 0 { recent + 2 } else { 0 };
        middle(area, WIDE, ROWS + self.proposal() + more)
    }

    /// The text of a boxed field: its bar is the left side of the box.
    fn inner(at: Rect) -> Rect {
        Rect {
            width: at.width.saturating_sub(1),
            ..row(at, 1)
        }
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        let fields = self.fields(area);
        fields
            .iter()
            .find_map(|(_, _, field, at)| field.cursor(Self::inner(*at)))
    }
}

impl Widget for &WhoView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let place = self.place(area);
        let title = if self.claiming {
            "One moment."
        } else {
            "Who takes part?"
        };
        let title = styled(title, self.theme.strong());
        center(buf, row(place, 0), &title);
        if let Some(sentences) = self.roster.and_then(Roster::unfinished)
            && self.who.participant.is_blank()
        {
            // A long id may need more than the width of the fields.
            let below = Rect {
                x: area.x,
                width: area.width,
                ..rows(place, 1, PROPOSAL)
            };
            center_all(buf, below, &sentences, self.theme.notice());
        }
        let next = self.roster.and_then(Roster::proposed);
        for (label, hint, field, at) in self.fields(area) {
            let border = match field.focused {
                true => self.theme.focus(),
                false => self.theme.outline(),
            };
            frame(buf, at, field.focused, border);
            let name = Rect {
                x: at.x + 2.min(at.width),
                width: at.width.saturating_sub(4),
                ..row(at, 0)
            };
            left(buf, name, &styled(format!(" {label} "), self.theme.text()));
            field.render(WhoView::inner(at), buf);
            if let Some(next) = next.as_ref().filter(|_| label == "Participant")
                && field.editor.is_blank()
            {
                let ghost = Rect {
                    x: at.x + 2.min(at.width),
                    width: at.width.saturating_sub(4),
                    ..row(at, 1)
                };
                let words = format!("→ or Enter: {next}");
                left(buf, ghost, &styled(words, self.theme.quiet()));
            }
            let below = rows(area, at.bottom().saturating_sub(area.y), 1);
            let below = Rect {
                x: at.x,
                width: at.width,
                ..below
            };
            left(buf, below, &styled(format!("  {hint}"), self.theme.quiet()));
        }
        let recent = self.recent();
        if !recent.is_empty() {
            let list = rows(place, ROWS + self.proposal() + 1, place.height);
            let title = styled("Last participants", self.theme.quiet());
            left(buf, row(list, 0), &title);
            left_all(buf, rows(list, 1, list.height), &recent, self.theme.quiet());
        }
    }
}
