//! Force curves: displacement and force of a slow press and release, as force testers write them.
//!
//! Three layouts are read:
//!
//! * a **table**: lines of summary, then the columns `No.,Force,Unit,Displacement,Unit,Judge,Position,Time,Date`
//!   with the time of each row in whole seconds;
//! * **high resolution**: lines such as `UNIT = gf,mm` and `RECORDING RATE = 0.0005`, then rows of force and
//!   displacement without column names;
//! * **tidy**: the columns `force` and `displacement` in any order, with or without others; units may be
//!   part of the names, as in `force_n` or `Force (N)`, and are gf and mm otherwise. A column `time`, in s or in
//!   the unit of its name, gives the rate.
//!
//! Fields may be quoted. A row with fewer fields than column names is refused, also the last one: a journal's last line may be cut by
//! a crash and is set aside, but a file of an instrument that ends within a row was not copied whole, and nobody knows what else it lacks.
//!
//! A file whose rows begin at the bottom has its press put before its release; [`ForceCurve::passive`] tells rows in reverse order and swapped columns.
//! [`join()`] makes one recording of several curves: repeated measurements, or several speeds.

mod join;
mod order;
mod time;

use super::names::linear;
use super::rows::{number, separator, shown};
pub use join::{Source, Stated, USUAL_RATE_HZ, join, unlike};
use order::Order;
use study_base::text::Untrusted;
use time::{Time, moment, rate, time_of};

/// Column names are looked for in this many lines.
const MOST_HEADER_LINES: usize = 100;
/// Fewest rows of a curve: second differences need three.
const LEAST_ROWS: usize = 3;
/// Fewest rows a second: a slower press is likelier a time in another unit.
pub const LEAST_RATE_HZ: f64 = 0.001;
/// Most rows a second.
pub const MOST_RATE_HZ: f64 = 1e6;

study_base::named! {
    /// How a file writes a force curve.
    Layout {
        /// A summary, then a table with the time of each row.
        Table = "summary and table of a force tester",
        /// A list of settings, then rows at an even rate.
        HighResolution = "high-resolution file of a force tester",
        /// Columns force and displacement.
        Tidy = "columns of displacement and force",
    }
}

/// A force curve, in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceCurve {
    /// How the file is written.
    pub layout: Layout,
    /// What was measured, if the file says so in a column `name`. Untrusted.
    pub target: Option<String>,
    /// Displacement, mm.
    pub x_mm: Vec<f64>,
    /// Force, N, positive against a press.
    pub f_n: Vec<f64>,
    /// Rows a second, if the file has a time.
    pub rate_hz: Option<f64>,
    /// The units that the file does not state, such as `force in gf`.
    pub assumed: Vec<String>,
    /// Whether the file begins at the bottom: its press was put before its release.
    pub release_first: bool,
    /// The line of the first row.
    first_line: usize,
}

impl ForceCurve {
    /// Whether the press needs more force than the release gives back.
    ///
    /// # Errors
    /// What is most likely wrong with the file: the order of its rows, the names of its columns, or the sign of the force.
    pub fn passive(&self) -> Result<(), ForceCurveError> {
        order::passive(&self.x_mm, &self.f_n).map_err(|fault| ForceCurveError {
            line: match fault {
                Fault::Swapped => self.first_line - 1,
                _ => self.first_line,
            },
            fault,
        })
    }
}

/// Why a file is no force curve, and at which line.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct ForceCurveError {
    /// Line number from 1.
    pub line: usize,
    /// What is wrong.
    pub fault: ForceCurveFault,
}

/// What is wrong with a file that should be a force curve.
#[derive(Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum ForceCurveFault {
    #[error(
        "no column names: a line has to name the columns force and displacement, or to begin with `MAX FORCE =`"
    )]
    NoColumns,
    #[error("two columns are called {0}: remove one")]
    DoubleColumn(&'static str),
    #[error("no `{0} =` above the rows: export the file again with its settings")]
    NoSetting(&'static str),
    #[error("`{}` is no unit of {what}: {units}", Untrusted(.unit))]
    Unit {
        what: &'static str,
        unit: String,
        units: &'static str,
    },
    #[error("the unit of {0} changes: a curve has one unit")]
    UnitChanges(&'static str),
    #[error(
        "{found} fields under {expected} column names: complete or remove the row; where the decimal mark is a comma, separate the columns by semicolons or quote the numbers"
    )]
    Fields { found: usize, expected: usize },
    #[error(
        "the time is `{}`, neither a number nor a time of day: correct it, or remove the column of the time", Untrusted(.0)
    )]
    Time(String),
    #[error("the time does not increase: sort the rows by time, or remove the column of the time")]
    TimeBackwards,
    #[error(
        "rows are {longest_s:.3} s apart here and {usual_s:.3} s usually: measure at an even rate, or resample the file"
    )]
    Uneven { longest_s: f64, usual_s: f64 },
    #[error(
        "the displacement decreases during the press: change its sign, so that a press increases it"
    )]
    Downwards,
    #[error("{found} of {expected} fields: {}", if *.last { "the file ends within this row; export it again, or remove the row" } else { "complete or remove the row" })]
    Short {
        found: usize,
        expected: usize,
        last: bool,
    },
    #[error("{column} is `{}`, which is not a number: remove or correct the row", Untrusted(.text))]
    NotANumber { column: &'static str, text: String },
    #[error("the recording rate is `{}`: it has to be a time from {least} to {most} s", Untrusted(.0), least = 1.0 / MOST_RATE_HZ, most = 1.0 / LEAST_RATE_HZ)]
    Rate(String),
    #[error(
        "by the column of the time there are {0:.3e} rows a second, and from {LEAST_RATE_HZ} to {MOST_RATE_HZ} are possible: name its unit, as in time_ms, or remove the column"
    )]
    TimeRate(f64),
    #[error("{found} rows, but DATA COUNT is {stated}: the file is not complete, export it again")]
    Count { found: usize, stated: usize },
    #[error("{0} rows: a curve has at least {LEAST_ROWS}")]
    TooShort(usize),
    #[error("{0} never changes: nothing was measured")]
    Constant(&'static str),
    #[error(
        "the displacement goes one way only: a curve needs a press and a release, in the order of time"
    )]
    OneDirection,
    #[error(
        "displacement and force decrease during the press: change the sign of both, so that a press increases them"
    )]
    BothDownwards,
    #[error(
        "the displacement jumps here from {from_mm:.3} to {to_mm:.3} mm, and its strokes all go the same way: list the rows in the order of time, the press from rest to the bottom and the release from there to rest"
    )]
    SameWay { from_mm: f64, to_mm: f64 },
    #[error("`{}` is a unit of {of}, not of {what}: the columns of force and displacement are swapped, exchange their names or units", Untrusted(.unit))]
    UnitOfOther {
        what: &'static str,
        of: &'static str,
        unit: String,
    },
    #[error(
        "the columns force and displacement are swapped: what is called force advances evenly, as the displacement of a tester does, and what is called displacement does not; exchange their names"
    )]
    Swapped,
    #[error(
        "there is less force at the bottom than at rest, and the release has more of it than the press: change the sign of the force, so that it is positive against a press"
    )]
    Sign,
    #[error(
        "the rows from here on are in the reverse order of time: at {at_mm:.3} mm the press has {press_n:.4} N and the release {release_n:.4} N, but no passive target gives back more than it takes; sort them from first to last, or exchange press and release"
    )]
    TurnedAround {
        at_mm: f64,
        press_n: f64,
        release_n: f64,
    },
}

use ForceCurveFault as Fault;

/// Where the columns are, and their factors to mm and N where they do not depend on the row.
struct Header {
    separator: u8,
    force: Column,
    displacement: Column,
    time: Option<Time>,
    name: Option<usize>,
    /// Fields of a row, without empty ones at the end.
    fields: usize,
}

/// A column of numbers.
struct Column {
    what: &'static str,
    /// Index of its kind among the columns of a recording.
    kind: usize,
    at: usize,
    /// To mm or N; `None` until a row has told its unit.
    factor: Option<f64>,
    /// Where each row has the unit.
    unit_at: Option<usize>,
    /// The unit that was taken because the file states none.
    assumed: Option<&'static str>,
}

impl Column {
    const FORCE: (&'static str, usize, &'static str) = ("force", 4, "gf");
    const DISPLACEMENT: (&'static str, usize, &'static str) = ("displacement", 1, "mm");

    fn unit(&mut self, unit: &str) -> Result<(), Fault> {
        let (what, unit_shown) = (self.what, || shown(unit));
        let (units, other) = match self.kind {
            1 => ("mm, cm, m, um", Self::FORCE),
            _ => ("gf, kgf, N, mN, cN", Self::DISPLACEMENT),
        };
        let factor = linear(self.kind, unit).ok_or_else(|| match linear(other.1, unit) {
            Some(_) => Fault::UnitOfOther {
                what,
                of: other.0,
                unit: unit_shown(),
            },
            None => Fault::Unit {
                what,
                unit: unit_shown(),
                units,
            },
        })?;
        match self.factor.replace(factor) {
            Some(before) if before != factor => Err(Fault::UnitChanges(self.what)),
            _ => Ok(()),
        }
    }

    /// The value in one row, mm or N.
    fn value(&mut self, fields: &[&str], separator: u8) -> Result<f64, Fault> {
        let field = |at: usize| fields.get(at).copied().unwrap_or_default();
        let text = field(self.at);
        let value = number_in(text, separator).filter(|value: &f64| value.is_finite());
        let value = value.ok_or_else(|| Fault::NotANumber {
            column: self.what,
            text: shown(text),
        })?;
        if let Some(at) = self.unit_at {
            self.unit(field(at))?;
        }
        Ok(value * self.factor.unwrap_or(1.0))
    }
}

/// Reads a force curve.
///
/// # Errors
/// [`ForceCurveError`] with the line of the first fault.
pub fn read(text: &str) -> Result<ForceCurve, ForceCurveError> {
    let at = |line: usize| move |fault| ForceCurveError { line, fault };
    let text = text.trim_start_matches('\u{feff}');
    let lines = || (1..).zip(text.lines().map(str::trim_end));
    let high_resolution = (lines().find(|(_, line)| !line.is_empty()))
        .is_some_and(|(_, line)| line.trim_start().to_uppercase().starts_with("MAX FORCE"));
    let (first_row, mut header, layout, settings) = if high_resolution {
        let (first_row, header, settings) = settings(lines())?;
        (first_row, header, Layout::HighResolution, Some(settings))
    } else {
        let mut named = None;
        for (line, text) in lines().take(MOST_HEADER_LINES) {
            if let Some(header) = columns(text).map_err(at(line))? {
                named = Some((line + 1, header));
                break;
            }
        }
        let (first_row, header) = named.ok_or_else(|| at(1)(Fault::NoColumns))?;
        let layout = match header.force.unit_at {
            Some(_) => Layout::Table,
            None => Layout::Tidy,
        };
        (first_row, header, layout, None)
    };
    let (mut x_mm, mut f_n, mut times) = (Vec::new(), Vec::new(), Vec::new());
    let mut target = None;
    let (mut last, mut lines_of_rows) = (first_row, Vec::new());
    // a tab at the end of a line is an empty field
    let mut rows = (1..)
        .zip(text.lines())
        .filter(|(line, text)| *line >= first_row && !text.trim().is_empty())
        .peekable();
    while let Some((line, text)) = rows.next() {
        let separator = header.separator;
        let fields = fields(text, separator);
        let fields: Vec<&str> = fields.iter().map(str::trim).collect();
        let found = fields.len() - fields.iter().rev().take_while(|f| f.is_empty()).count();
        if found > header.fields {
            let expected = header.fields;
            return Err(at(line)(Fault::Fields { found, expected }));
        }
        if fields.len() < header.fields {
            return Err(at(line)(Fault::Short {
                found: fields.len(),
                expected: header.fields,
                last: rows.peek().is_none(),
            }));
        }
        let value = |column: &mut Column| column.value(&fields, separator).map_err(at(line));
        f_n.push(value(&mut header.force)?);
        x_mm.push(value(&mut header.displacement)?);
        if let Some(time) = header.time {
            let text = fields.get(time.at).copied().unwrap_or_default();
            times.push((
                line,
                moment(text, time.unit_s, separator).map_err(at(line))?,
            ));
        }
        let name = || fields.get(header.name?).filter(|name| !name.is_empty());
        target = target.or_else(|| name().map(|name| (*name).to_owned()));
        last = line;
        lines_of_rows.push(line);
    }
    if x_mm.len() < LEAST_ROWS {
        return Err(at(last)(Fault::TooShort(x_mm.len())));
    }
    for (what, values) in [("displacement", &x_mm), ("force", &f_n)] {
        if values.iter().all(|value| *value == values[0]) {
            return Err(at(first_row)(Fault::Constant(what)));
        }
    }
    let order = order::order(&x_mm, &f_n)
        .map_err(|(row, fault)| at(row.map_or(last, |row| lines_of_rows[row]))(fault))?;
    let release_first = order != Order::PressFirst;
    if let Order::ReleaseFirst(rest) = order {
        x_mm.rotate_left(rest);
        f_n.rotate_left(rest);
    }
    let rate_hz = match settings {
        Some(settings) if settings.count != x_mm.len() => {
            let (found, stated) = (x_mm.len(), settings.count);
            return Err(at(last)(Fault::Count { found, stated }));
        }
        Some(settings) => Some(1.0 / settings.interval_s),
        None => {
            let hz = rate(&times).map_err(|(line, fault)| ForceCurveError { line, fault })?;
            if let Some(hz) = hz.filter(|hz| !is_rate(*hz)) {
                return Err(at(first_row - 1)(Fault::TimeRate(hz)));
            }
            hz
        }
    };
    let assumed = [&header.force, &header.displacement]
        .into_iter()
        .filter_map(|column| Some(format!("{} in {}", column.what, column.assumed?)))
        .collect();
    Ok(ForceCurve {
        layout,
        target,
        x_mm,
        f_n,
        rate_hz,
        assumed,
        release_first,
        first_line: lines_of_rows[0],
    })
}

/// Whether an instrument may write so many rows a second.
fn is_rate(hz: f64) -> bool {
    (LEAST_RATE_HZ..=MOST_RATE_HZ).contains(&hz)
}

/// The columns of a line of column names; `None` if it is none.
fn columns(line: &str) -> Result<Option<Header>, Fault> {
    let separator = separator(line.as_bytes());
    let names: Vec<String> = (fields(line, separator).iter())
        .map(|name| name.trim().to_lowercase())
        .collect();
    let find = |word: &str| names.iter().position(|name| name == word);
    let column = |(what, kind, usual): (&'static str, usize, &'static str)| {
        let rest_of = |name: &String| name.strip_prefix(what).map(str::to_owned);
        let mut found = (names.iter().enumerate())
            .filter_map(|(at, name)| Some((at, rest_of(name)?)))
            .filter(|(_, rest)| !rest.starts_with(char::is_alphanumeric));
        let Some((at, rest)) = found.next() else {
            return Ok(None);
        };
        if found.next().is_some() {
            return Err(Fault::DoubleColumn(what));
        }
        let stated = rest.trim_matches(|c: char| !c.is_alphabetic());
        let unit_at = Some(at + 1).filter(|next| names.get(*next).is_some_and(|n| n == "unit"));
        let mut column = Column {
            what,
            kind,
            at,
            factor: None,
            unit_at,
            assumed: (unit_at.is_none() && stated.is_empty()).then_some(usual),
        };
        if unit_at.is_none() {
            column.unit(column.assumed.unwrap_or(stated))?;
        }
        Ok(Some(column))
    };
    let (force, displacement) = (column(Column::FORCE)?, column(Column::DISPLACEMENT)?);
    Ok(force.zip(displacement).map(|(force, displacement)| Header {
        separator,
        force,
        displacement,
        time: time_of(&names),
        name: find("name"),
        fields: names.len() - names.iter().rev().take_while(|n| n.is_empty()).count(),
    }))
}

/// What the settings of a high-resolution file say.
struct Settings {
    interval_s: f64,
    count: usize,
}

/// The settings of a high-resolution file, and the line of its first row.
fn settings<'t>(
    lines: impl Iterator<Item = (usize, &'t str)>,
) -> Result<(usize, Header, Settings), ForceCurveError> {
    let mut header = Header {
        separator: b',',
        force: column_at(0, Column::FORCE),
        displacement: column_at(1, Column::DISPLACEMENT),
        time: None,
        name: None,
        fields: 2,
    };
    let (mut units, mut interval_s, mut count) = (false, None, None);
    for (line, text) in lines {
        let at = |fault| ForceCurveError { line, fault };
        let Some((key, value)) = text.split_once('=') else {
            let missing = [
                ("UNIT", units),
                ("RECORDING RATE", interval_s.is_some()),
                ("DATA COUNT", count.is_some()),
            ];
            if let Some((key, _)) = missing.iter().find(|(_, found)| !found) {
                return Err(at(Fault::NoSetting(key)));
            }
            let settings = Settings {
                interval_s: interval_s.unwrap_or_default(),
                count: count.unwrap_or_default(),
            };
            return Ok((line, header, settings));
        };
        let mut values = value.split(',').map(str::trim);
        let mut next = || values.next().unwrap_or_default();
        match key.trim().to_uppercase().as_str() {
            "UNIT" => {
                header.force.unit(next()).map_err(at)?;
                header.displacement.unit(next()).map_err(at)?;
                units = true;
            }
            "RECORDING RATE" => {
                let text = next();
                let parsed = text.parse().ok().filter(|s: &f64| is_rate(1.0 / *s));
                interval_s = Some(parsed.ok_or_else(|| at(Fault::Rate(shown(text))))?);
            }
            "DATA COUNT" => {
                let text = next();
                let column = "DATA COUNT";
                let text_of = || shown(text);
                let parsed = text.parse().map_err(|_| Fault::NotANumber {
                    column,
                    text: text_of(),
                });
                count = Some(parsed.map_err(at)?);
            }
            _ => {}
        }
    }
    Err(ForceCurveError {
        line: 1,
        fault: Fault::TooShort(0),
    })
}

fn column_at(at: usize, (what, kind, _): (&'static str, usize, &'static str)) -> Column {
    Column {
        what,
        kind,
        at,
        factor: None,
        unit_at: None,
        assumed: None,
    }
}

/// The fields of a line, without their quotes.
fn fields(line: &str, separator: u8) -> csv::StringRecord {
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator)
        .from_reader(line.as_bytes());
    (reader.into_records().next().and_then(Result::ok)).unwrap_or_default()
}

/// A number; a comma in a field can only be a decimal one.
fn number_in(text: &str, separator: u8) -> Option<f64> {
    number(text, if text.contains(',') { b';' } else { separator })
}

#[cfg(test)]
mod tests;
