//! A page of the terminal as an SVG file: text as text, and lines and blocks as paths, which join whatever the
//! reader's font is.

use std::fmt::Write as _;
use vt100::{Cell, Color, Screen};

/// Size of a cell, px.
const WIDTH: u16 = 9;
const HEIGHT: u16 = 18;
/// From the top of a cell to the baseline of its text, px.
const BASELINE: u16 = 14;
/// Free space around the page, px.
const MARGIN: u16 = 9;
/// Widths of light and heavy lines, px.
const LINES: [f32; 2] = [1.2, 2.6];

const INK: &str = "#1a1a1a";
const PAPER: &str = "#ffffff";

/// The lines of a character that is drawn with lines: whether they go from the middle up, to the right, down and to
/// the left, and whether they are heavy.
fn lines(c: char) -> Option<([bool; 4], bool)> {
    const LIGHT: &str = "│─┌┐└┘├┤┬┴┼";
    const HEAVY: &str = "┃━┏┓┗┛┣┫┳┻╋";
    const WAYS: [[bool; 4]; 11] = [
        [true, false, true, false],
        [false, true, false, true],
        [false, true, true, false],
        [false, false, true, true],
        [true, true, false, false],
        [true, false, false, true],
        [true, true, true, false],
        [true, false, true, true],
        [false, true, true, true],
        [true, true, false, true],
        [true, true, true, true],
    ];
    let found = |of: &str| of.chars().position(|other| other == c);
    let (place, heavy) = match found(LIGHT) {
        Some(place) => (place, false),
        None => (found(HEAVY)?, true),
    };
    Some((WAYS[place], heavy))
}

/// Top and bottom of a block character, in halves of a cell.
fn block(c: char) -> Option<(u16, u16)> {
    match c {
        '█' => Some((0, 2)),
        '▀' => Some((0, 1)),
        '▄' => Some((1, 2)),
        _ => None,
    }
}

/// A color of the 256, as xterm has them.
fn rgb(color: Color, default: &str) -> String {
    let i = match color {
        Color::Default => return default.to_owned(),
        Color::Rgb(r, g, b) => return format!("#{r:02x}{g:02x}{b:02x}"),
        Color::Idx(i) => u16::from(i),
    };
    assert!(i >= 16, "color {i} depends on the terminal");
    if i >= 232 {
        let gray = 8 + 10 * (i - 232);
        return format!("#{gray:02x}{gray:02x}{gray:02x}");
    }
    let level = |n: u16| if n == 0 { 0 } else { 55 + 40 * n };
    let i = i - 16;
    let (r, g, b) = (level(i / 36), level(i / 6 % 6), level(i % 6));
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// What a cell looks like, beside its characters.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Look {
    ink: String,
    paper: String,
    bold: bool,
    italic: bool,
    underline: bool,
}

impl Look {
    fn of(cell: &Cell) -> Self {
        let (mut ink, mut paper) = (rgb(cell.fgcolor(), INK), rgb(cell.bgcolor(), PAPER));
        if cell.inverse() {
            std::mem::swap(&mut ink, &mut paper);
        }
        Self {
            ink,
            paper,
            bold: cell.bold(),
            italic: cell.italic(),
            underline: cell.underline(),
        }
    }

    fn attributes(&self) -> String {
        let mut text = format!(" fill=\"{}\"", self.ink);
        for (is, attribute) in [
            (self.bold, " font-weight=\"bold\""),
            (self.italic, " font-style=\"italic\""),
            (self.underline, " text-decoration=\"underline\""),
        ] {
            text.push_str(if is { attribute } else { "" });
        }
        text
    }
}

/// A text within an element.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// Cells of a row that follow each other and are drawn as one.
struct Run {
    /// The first column.
    column: u16,
    /// Columns.
    columns: u16,
    text: String,
    look: Look,
}

/// Rows and columns.
fn size(screen: &Screen) -> (u16, u16) {
    let (rows, columns) = screen.size();
    (rows.get(), columns.get())
}

/// The runs of a row. `joins` says whether a cell can follow in the same run.
fn runs(screen: &Screen, row: u16, joins: impl Fn(&Run, &Cell, &Look) -> bool) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for column in 0..size(screen).1 {
        let Some(cell) = screen.cell(row, column) else {
            continue;
        };
        let look = Look::of(cell);
        let columns = 1 + u16::from(cell.is_wide());
        match runs.last_mut() {
            Some(run) if run.column + run.columns == column && joins(run, cell, &look) => {
                run.columns += columns;
                run.text.push_str(cell.contents());
            }
            _ if cell.is_wide_continuation() => {}
            _ => runs.push(Run {
                column,
                columns,
                text: cell.contents().to_owned(),
                look,
            }),
        }
    }
    runs
}

/// A character that is drawn and not written.
fn is_drawn(text: &str) -> bool {
    text.chars()
        .all(|c| lines(c).is_some() || block(c).is_some())
}

/// A horizontal line through several cells, which is drawn as one.
fn is_rule(text: &str) -> bool {
    ["─", "━"]
        .iter()
        .any(|c| !text.is_empty() && text.replace(c, "").is_empty())
}

/// The paths of one character of lines or blocks.
fn drawn(svg: &mut String, c: char, (x, y): (u16, u16), ink: &str) {
    if let Some((top, bottom)) = block(c) {
        let (top, height) = (y + top * HEIGHT / 2, (bottom - top) * HEIGHT / 2);
        let _ = writeln!(
            svg,
            "<path d=\"M{x} {top}h{WIDTH}v{height}h-{WIDTH}z\" fill=\"{ink}\"/>"
        );
    }
    if let Some(([up, right, down, left], heavy)) = lines(c) {
        let (cx, cy) = (f32::from(2 * x + WIDTH) / 2.0, y + HEIGHT / 2);
        let mut path = String::new();
        for (goes, to) in [
            (up, format!("V{y}")),
            (right, format!("H{}", x + WIDTH)),
            (down, format!("V{}", y + HEIGHT)),
            (left, format!("H{x}")),
        ] {
            if goes {
                let _ = write!(path, "M{cx} {cy}{to}");
            }
        }
        let width = LINES[usize::from(heavy)];
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" stroke=\"{ink}\" stroke-width=\"{width}\" stroke-linecap=\"square\" fill=\"none\"/>"
        );
    }
}

/// The page as an SVG document.
pub fn svg(screen: &Screen, title: &str) -> String {
    let (rows, columns) = size(screen);
    let (width, height) = (columns * WIDTH + 2 * MARGIN, rows * HEIGHT + 2 * MARGIN);
    let place = |row: u16, column: u16| (MARGIN + column * WIDTH, MARGIN + row * HEIGHT);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"14\">\n<title>{}</title>\n\
         <rect x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"6\" fill=\"{PAPER}\" stroke=\"#888888\"/>\n",
        escaped(title),
        width - 1,
        height - 1
    );
    for row in 0..rows {
        for run in runs(screen, row, |run, _, look| run.look.paper == look.paper) {
            let ((x, y), paper) = (place(row, run.column), &run.look.paper);
            if paper != PAPER {
                let width = run.columns * WIDTH;
                let _ = writeln!(
                    svg,
                    "<path d=\"M{x} {y}h{width}v{HEIGHT}h-{width}z\" fill=\"{paper}\"/>"
                );
            }
        }
        for run in runs(screen, row, |run, cell, look| {
            let is_text = |text: &str| !text.trim().is_empty() && !is_drawn(text);
            let is_same_rule =
                is_rule(&run.text) && run.text.starts_with(cell.contents()) && cell.has_contents();
            let are_text = is_text(&run.text) && is_text(cell.contents());
            run.look == *look && (is_same_rule || are_text)
        }) {
            let (x, y) = place(row, run.column);
            if run.text.trim().is_empty() {
                continue;
            }
            if is_rule(&run.text) {
                let width = LINES[usize::from(run.text.starts_with('━'))];
                let _ = writeln!(
                    svg,
                    "<path d=\"M{x} {}H{}\" stroke=\"{}\" stroke-width=\"{width}\"/>",
                    y + HEIGHT / 2,
                    x + run.columns * WIDTH,
                    run.look.ink
                );
                continue;
            }
            if is_drawn(&run.text) {
                run.text
                    .chars()
                    .for_each(|c| drawn(&mut svg, c, (x, y), &run.look.ink));
                continue;
            }
            let _ = writeln!(
                svg,
                "<text x=\"{x}\" y=\"{}\" textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\"{}>{}</text>",
                y + BASELINE,
                run.columns * WIDTH,
                run.look.attributes(),
                escaped(&run.text)
            );
        }
    }
    if !screen.hide_cursor() {
        let (row, column) = screen.cursor_position();
        let (x, y) = place(row, column);
        let _ = writeln!(
            svg,
            "<path d=\"M{x} {y}h{WIDTH}v{HEIGHT}h-{WIDTH}z\" fill=\"{INK}\" fill-opacity=\"0.35\"/>"
        );
    }
    svg + "</svg>\n"
}

#[test]
fn text_lines_blocks_and_colors_are_drawn() {
    let mut parser = vt100::Parser::new(2.try_into().unwrap(), 12.try_into().unwrap(), 0);
    parser.process("\x1b[?25la<b \x1b[1;7;38;5;131mx\x1b[0m┌──█\x1b[38;5;243m·\r\n".as_bytes());
    let drawn = svg(parser.screen(), "a & b");
    let elements: Vec<&str> = drawn.lines().skip(3).collect();
    assert_eq!(
        elements,
        [
            "<path d=\"M45 9h9v18h-9z\" fill=\"#af5f5f\"/>",
            "<text x=\"9\" y=\"23\" textLength=\"27\" lengthAdjust=\"spacingAndGlyphs\" fill=\"#1a1a1a\">a&lt;b</text>",
            "<text x=\"45\" y=\"23\" textLength=\"9\" lengthAdjust=\"spacingAndGlyphs\" fill=\"#ffffff\" font-weight=\"bold\">x</text>",
            "<path d=\"M58.5 18H63M58.5 18V27\" stroke=\"#1a1a1a\" stroke-width=\"1.2\" stroke-linecap=\"square\" fill=\"none\"/>",
            "<path d=\"M63 18H81\" stroke=\"#1a1a1a\" stroke-width=\"1.2\"/>",
            "<path d=\"M81 9h9v18h-9z\" fill=\"#1a1a1a\"/>",
            "<text x=\"90\" y=\"23\" textLength=\"9\" lengthAdjust=\"spacingAndGlyphs\" fill=\"#767676\">·</text>",
            "</svg>",
        ]
    );
    assert!(drawn.contains("<title>a &amp; b</title>"), "{drawn}");
}
