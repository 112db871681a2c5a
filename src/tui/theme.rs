//! All colors and text styles of the terminal.
//!
//! No information depends on color: a page has the same characters in the same cells
//! with every [`ColorDepth`]. The terminal's own background is kept, dark or light: each of
//! the 256 colors in use has a contrast of at least 4.5 : 1 to black and to white.

use ratatui::style::{Color, Modifier, Style};

/// The colors that the terminal can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorDepth {
    /// 256 colors.
    Full,
    /// The 16 colors of the terminal's scheme.
    Sixteen,
    /// No color: bold, dim and reversed only.
    None,
}

impl ColorDepth {
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
    color: ColorDepth,
}

impl Theme {
    /// The styles for a terminal.
    pub fn new(color: ColorDepth) -> Self {
        Self { color }
    }

    /// Text in a color. Of the 16 colors none is legible on black and on white in every
    /// scheme, so that text there keeps the terminal's own.
    fn tint(self, full: u8) -> Style {
        match self.color {
            ColorDepth::Full => Style::new().fg(Color::Indexed(full)),
            ColorDepth::Sixteen | ColorDepth::None => Style::new(),
        }
    }

    /// A line or a bar in a color.
    fn line(self, full: u8) -> Style {
        match self.color {
            ColorDepth::Sixteen => Style::new().fg(Color::Magenta),
            ColorDepth::Full | ColorDepth::None => self.tint(full),
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
        match self.color {
            ColorDepth::Full => Style::new().fg(Color::Indexed(243)),
            // Dim text is too faint on many terminals.
            ColorDepth::Sixteen | ColorDepth::None => Style::new(),
        }
    }

    /// The name of a key.
    pub fn key(self) -> Style {
        self.tint(63).add_modifier(Modifier::BOLD)
    }

    /// A chosen answer.
    pub fn chosen(self) -> Style {
        self.tint(63).add_modifier(Modifier::BOLD)
    }

    /// The inside of a chosen answer.
    pub fn filled(self) -> Style {
        self.chosen().add_modifier(Modifier::REVERSED)
    }

    /// The outline of an answer that can be chosen.
    pub fn outline(self) -> Style {
        self.quiet()
    }

    /// The bar of the field with the focus.
    pub fn focus(self) -> Style {
        self.line(63)
    }

    /// The playback indicator.
    pub fn playing(self) -> Style {
        self.tint(29).add_modifier(Modifier::BOLD)
    }

    /// The check mark of saved answers.
    pub fn saved(self) -> Style {
        self.tint(29)
    }

    /// A notice.
    pub fn notice(self) -> Style {
        self.tint(131)
    }

    /// The title of a fault.
    pub fn trouble(self) -> Style {
        self.tint(163)
            .add_modifier(Modifier::BOLD | Modifier::REVERSED)
    }

    /// The frame around a fault.
    pub fn trouble_frame(self) -> Style {
        self.tint(163).add_modifier(Modifier::BOLD)
    }

    /// The banner of pilots and simulations.
    pub fn banner(self) -> Style {
        self.tint(131).add_modifier(Modifier::REVERSED)
    }

    /// The force trace.
    pub fn trace(self) -> Color {
        match self.color {
            ColorDepth::Full => Color::Indexed(63),
            ColorDepth::Sixteen => Color::Magenta,
            ColorDepth::None => Color::Reset,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn styles(theme: Theme) -> [Style; 14] {
        [
            theme.text(),
            theme.strong(),
            theme.quiet(),
            theme.key(),
            theme.chosen(),
            theme.filled(),
            theme.outline(),
            theme.focus(),
            theme.playing(),
            theme.saved(),
            theme.notice(),
            theme.trouble(),
            theme.trouble_frame(),
            theme.banner(),
        ]
    }

    fn detect(vars: &[(&str, &str)]) -> ColorDepth {
        ColorDepth::detect(|name| {
            let found = vars.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn no_color_wins_over_everything() {
        assert_eq!(
            detect(&[("NO_COLOR", "1"), ("TERM", "xterm-256color")]),
            ColorDepth::None
        );
        assert_eq!(
            detect(&[("NO_COLOR", ""), ("TERM", "xterm-256color")]),
            ColorDepth::Full
        );
    }

    #[test]
    fn a_plain_terminal_gets_sixteen_colors() {
        assert_eq!(detect(&[("TERM", "linux")]), ColorDepth::Sixteen);
        assert_eq!(detect(&[("TERM", "vt100")]), ColorDepth::None);
        assert_eq!(
            detect(&[("TERM", "xterm"), ("COLORTERM", "truecolor")]),
            ColorDepth::Full
        );
    }

    /// Relative luminance of one of the 256 colors above the first 16, after WCAG 2.2.
    fn luminance(index: u8) -> f64 {
        let level = |n: u8| if n == 0 { 0 } else { 55 + 40 * n };
        let (r, g, b) = match index {
            232.. => {
                let gray = 8 + 10 * (index - 232);
                (gray, gray, gray)
            }
            _ => {
                let n = index - 16;
                (level(n / 36), level(n / 6 % 6), level(n % 6))
            }
        };
        let linear = |c: u8| match f64::from(c) / 255.0 {
            c if c <= 0.04045 => c / 12.92,
            c => ((c + 0.055) / 1.055).powf(2.4),
        };
        0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
    }

    #[test]
    fn every_color_is_legible_on_black_and_on_white() {
        let theme = Theme::new(ColorDepth::Full);
        let trace = Style::new().fg(theme.trace());
        for style in styles(theme).into_iter().chain([trace]) {
            let Some(Color::Indexed(index)) = style.fg else {
                assert_eq!(style.fg, None);
                continue;
            };
            let bright = luminance(index);
            let (on_black, on_white) = ((bright + 0.05) / 0.05, 1.05 / (bright + 0.05));
            let contrast = on_black.min(on_white);
            assert!(contrast >= 4.5, "color {index}: {contrast:.2}");
        }
        // Of 16 colors the terminal's own is text, and magenta, 4.48 : 1 on black and
        // 4.69 : 1 on white as in xterm, a line.
        let sixteen = Theme::new(ColorDepth::Sixteen);
        for style in styles(sixteen) {
            assert!(!style.add_modifier.contains(Modifier::DIM));
            assert!(style.fg.is_none() || style == sixteen.focus(), "{style:?}");
        }
    }

    #[test]
    fn without_color_no_style_has_one() {
        let theme = Theme::new(ColorDepth::None);
        for style in styles(theme) {
            assert_eq!((style.fg, style.bg), (None, None));
        }
        assert_eq!(theme.trace(), Color::Reset);
    }
}
