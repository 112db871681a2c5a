//! Units, names and columns of what `study identify` prints.

use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_haptics::identify::identification::{Identification, Source};
use study_haptics::model::Units;
use unicode_width::UnicodeWidthStr as _;

/// Lengths and forces as the recording has them: a turning handle in angles and torques.
#[derive(Clone, Copy)]
pub(super) struct Printed {
    pub(super) units: Units,
    pub(super) lever_mm: f64,
}

impl Printed {
    pub(super) fn of(results: &Identification) -> Self {
        let (units, lever_mm) = results.turned.unwrap_or((Units::Linear, 1.0));
        Self { units, lever_mm }
    }

    pub(super) fn length(self, mm: f64) -> f64 {
        self.units.of_mm(mm, self.lever_mm)
    }

    pub(super) fn force(self, n: f64) -> f64 {
        self.units.of_n(n, self.lever_mm)
    }

    /// Decimals of a force: a torque in N·m is some 30 times smaller.
    pub(super) fn decimals(self) -> usize {
        if self.units == Units::Linear { 4 } else { 6 }
    }

    pub(super) fn x(self) -> &'static str {
        self.units.names()[0]
    }

    pub(super) fn f(self) -> &'static str {
        self.units.names()[1]
    }
}

/// The name, truncated so that the numbers stay on the screen.
pub(super) fn short_name(source: &Source) -> String {
    let name: String = source.recording.name.chars().take(24).collect();
    Untrusted(&name).to_string()
}

/// Columns as wide as their widest entry, right-aligned.
pub(super) fn align(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> = (0..columns)
        .map(|i| rows.iter().map(|row| row[i].width()).max().unwrap_or(0))
        .collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::new();
        for (i, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let blanks = " ".repeat(width - cell.width());
            let gap = if i == 0 { " " } else { "  " };
            let _ = write!(line, "{blanks}{cell}{gap}");
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}
