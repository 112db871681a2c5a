//! All colours and text styles of the terminal.
//!
//! No information depends on colour: a page has the same characters in the same cells
//! with every [`Colour`]. The terminal's own background is kept.

use ratatui::style::{Color, Modifier, Style};

/// The colours that the terminal can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// 256 colours.
    Full,
    /// The 16 colours of the terminal's scheme.
    Sixteen,
    /// No colour: bold, dim and reversed only.
    None,
}

impl Colour {
    /// From the environment: `NO_COLOR` (any value that is not empty), `TERM`
    /// and `COLORTERM`, read with `var`.
    pub fn detect(var: impl Fn(&str) -> Option<String>) -> Self {
        let set = |name| var(name).filter(|value: &String| !value.is_empty());
        if set("NO_COLOR").is_some() {
            return Self::None;
        }
        let term = set("TERM").unwrap_or_default();
        if set("COLORTERM").is_some() || term.contains("256color") || term.contains("direct") {
            Self::Full
        } else if term.contains("mono") || term.starts_with("vt") {
            Self::None
        } else {
            Self::Sixteen
        }
    }
}

/// The styles of everything on the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Theme {
    colour: Colour,
}

impl Theme {
    /// The styles for a terminal.
    pub fn new(colour: Colour) -> Self {
        Self { colour }
    }

    fn tint(self, full: u8, sixteen: Color) -> Style {
        match self.colour {
            Colour::Full => Style::new().fg(Color::Indexed(full)),
            Colour::Sixteen => Style::new().fg(sixteen),
            Colour::None => Style::new(),
        }
    }

    /// Ordinary text.
    pub fn text(self) -> Style {
        Style::new()
    }

    /// Emphasized text.
    pub fn strong(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Secondary text: the experimenter's status line, explanations.
    pub fn quiet(self) -> Style {
        match self.colour {
            Colour::Full => Style::new().fg(Color::Indexed(244)),
            Colour::Sixteen | Colour::None => Style::new().add_modifier(Modifier::DIM),
        }
    }

    /// The name of a key.
    pub fn key(self) -> Style {
        self.tint(73, Color::Cyan).add_modifier(Modifier::BOLD)
    }

    /// A chosen answer.
    pub fn chosen(self) -> Style {
        self.tint(73, Color::Cyan).add_modifier(Modifier::BOLD)
    }

    /// The outline of an answer that can be chosen.
    pub fn outline(self) -> Style {
        self.quiet()
    }

    /// The bar of the field with the focus.
    pub fn focus(self) -> Style {
        self.tint(73, Color::Cyan)
    }

    /// The playback indicator.
    pub fn playing(self) -> Style {
        self.tint(71, Color::Green).add_modifier(Modifier::BOLD)
    }

    /// The check mark of saved answers.
    pub fn saved(self) -> Style {
        self.tint(71, Color::Green)
    }

    /// A notice.
    pub fn notice(self) -> Style {
        self.tint(172, Color::Yellow)
    }

    /// The title of a fault.
    pub fn trouble(self) -> Style {
        self.tint(167, Color::Red)
            .add_modifier(Modifier::BOLD | Modifier::REVERSED)
    }

    /// The frame around a fault.
    pub fn trouble_frame(self) -> Style {
        self.tint(167, Color::Red).add_modifier(Modifier::BOLD)
    }

    /// The banner of pilots and simulations.
    pub fn banner(self) -> Style {
        self.tint(172, Color::Yellow)
            .add_modifier(Modifier::REVERSED)
    }

    /// The force trace.
    pub fn trace(self) -> Color {
        match self.colour {
            Colour::Full => Color::Indexed(73),
            Colour::Sixteen => Color::Cyan,
            Colour::None => Color::Reset,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detect(vars: &[(&str, &str)]) -> Colour {
        Colour::detect(|name| {
            let found = vars.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn no_color_wins_over_everything() {
        assert_eq!(
            detect(&[("NO_COLOR", "1"), ("TERM", "xterm-256color")]),
            Colour::None
        );
        assert_eq!(
            detect(&[("NO_COLOR", ""), ("TERM", "xterm-256color")]),
            Colour::Full
        );
    }

    #[test]
    fn a_plain_terminal_gets_sixteen_colours() {
        assert_eq!(detect(&[("TERM", "linux")]), Colour::Sixteen);
        assert_eq!(detect(&[("TERM", "vt100")]), Colour::None);
        assert_eq!(
            detect(&[("TERM", "xterm"), ("COLORTERM", "truecolor")]),
            Colour::Full
        );
    }

    #[test]
    fn without_colour_no_style_has_one() {
        let theme = Theme::new(Colour::None);
        for style in [
            theme.text(),
            theme.strong(),
            theme.quiet(),
            theme.key(),
            theme.chosen(),
            theme.outline(),
            theme.focus(),
            theme.playing(),
            theme.saved(),
            theme.notice(),
            theme.trouble(),
            theme.trouble_frame(),
            theme.banner(),
        ] {
            assert_eq!((style.fg, style.bg), (None, None));
        }
        assert_eq!(theme.trace(), Color::Reset);
    }
}
