//! Tables. A table is made once, column by column; the terminal, the report and the CSV files
//! print the columns that name them.

use super::apa::{digits, interval_or_dash, name, or_dash};
use study_analysis::analyze::results::Number;

/// How a number is printed.
pub(crate) type Format = fn(f64) -> String;

/// Largest number of rows of a table in the report; its CSV file has all.
pub(crate) const MAX_ROWS: usize = 200;

/// A cell: what a reader sees, and what a file stores.
#[derive(Debug, Clone)]
pub(crate) enum Cell {
    /// A name; readers see at most 60 columns of it. Untrusted.
    Name(String),
    /// Text that is shown whole. Untrusted.
    Text(String),
    /// Text in the typeface of a program. Untrusted.
    Code(String),
    Number(Option<f64>, Format),
    /// A number whose format depends on its row.
    Shown(Option<f64>, String),
    Interval(Option<(f64, f64)>, Format),
}

impl Cell {
    /// As on the page.
    pub(crate) fn shown(&self) -> String {
        match self {
            Self::Name(text) => name(text),
            Self::Text(text) | Self::Code(text) | Self::Shown(_, text) => text.clone(),
            Self::Number(x, format) => or_dash(*x, format),
            Self::Interval(ends, format) => interval_or_dash(*ends, format),
        }
    }

    /// With all digits; an interval has two cells.
    fn exact(&self) -> Vec<String> {
        let number = |x: Option<f64>| x.map_or_else(String::new, digits);
        match self {
            Self::Name(text) | Self::Text(text) | Self::Code(text) => vec![text.clone()],
            Self::Number(x, _) | Self::Shown(x, _) => vec![number(*x)],
            Self::Interval(ends, _) => vec![number(ends.map(|e| e.0)), number(ends.map(|e| e.1))],
        }
    }
}

/// Where a table is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Medium {
    Terminal,
    Report,
    File,
}

/// The head of a column in each medium that shows it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Head {
    terminal: Option<String>,
    report: Option<String>,
    file: Option<String>,
    /// Whether the column has text that may take several lines.
    pub(crate) wraps: bool,
    /// Whether it is aligned to the left on the terminal, as the first column is.
    pub(crate) left: bool,
    /// The rank of the column among those that a narrow terminal leaves out.
    pub(crate) rank: Option<u8>,
    /// What the column is, as a sentence below the table; it goes where the column goes.
    note: Option<String>,
}

/// A column of terminal and report.
pub(crate) fn page(head: &str) -> Head {
    Head {
        terminal: Some(head.to_owned()),
        ..report(head)
    }
}

/// A column of the terminal only.
pub(crate) fn terminal(head: &str) -> Head {
    Head {
        terminal: Some(head.to_owned()),
        ..Head::default()
    }
}

/// A column of the report only.
pub(crate) fn report(head: &str) -> Head {
    Head {
        report: Some(head.to_owned()),
        ..Head::default()
    }
}

/// A column of the CSV file only.
pub(crate) fn file(name: &str) -> Head {
    Head::default().file(name)
}

impl Head {
    /// Also in the CSV file.
    pub(crate) fn file(mut self, name: &str) -> Self {
        self.file = Some(name.to_owned());
        self
    }

    /// With another head on the terminal.
    pub(crate) fn on_terminal(mut self, head: &str) -> Self {
        self.terminal = Some(head.to_owned());
        self
    }

    /// Its text may take several lines.
    pub(crate) fn wrapped(mut self) -> Self {
        self.wraps = true;
        self
    }

    /// Aligned to the left on the terminal.
    pub(crate) fn aligned_left(mut self) -> Self {
        self.left = true;
        self
    }

    /// With a sentence below the table that says what the column is.
    pub(crate) fn explained(mut self, note: String) -> Self {
        self.note = Some(note);
        self
    }

    /// Left out where the terminal is narrow; of several columns, the lowest rank first, and all
    /// of a rank together.
    pub(crate) fn droppable(mut self, rank: u8) -> Self {
        self.rank = Some(rank);
        self
    }

    /// Nowhere, unless `shown`.
    pub(crate) fn when(self, shown: bool) -> Self {
        if shown { self } else { Self::default() }
    }

    fn on(&self, medium: Medium) -> Option<&str> {
        match medium {
            Medium::Terminal => self.terminal.as_deref(),
            Medium::Report => self.report.as_deref(),
            Medium::File => self.file.as_deref(),
        }
    }
}

/// A column with its cells from top to bottom.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) head: Head,
    /// Whether its cells are intervals, which are two columns of a file.
    interval: bool,
    cells: Vec<Cell>,
}

/// A table; it may have no rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table {
    pub(crate) caption: String,
    columns: Vec<Column>,
    /// Whether each row is apart from the others: in italics below them on a page.
    apart: Vec<bool>,
    /// Sentences below it, after those of its columns.
    notes: Vec<String>,
}

impl Table {
    pub(crate) fn is_empty(&self) -> bool {
        self.apart.is_empty()
    }

    /// The table, with sentences below it.
    pub(crate) fn with_notes(mut self, notes: impl IntoIterator<Item = String>) -> Self {
        self.notes.extend(notes);
        self
    }

    /// The sentences below it, where only these columns are shown.
    pub(crate) fn notes_with<'a>(&'a self, shown: &[&'a Column]) -> Vec<&'a str> {
        let of_columns = shown.iter().filter_map(|c| c.head.note.as_deref());
        let own = self.notes.iter().map(String::as_str);
        of_columns.filter(|_| !self.is_empty()).chain(own).collect()
    }

    /// The sentences below it in a medium.
    pub(crate) fn notes(&self, medium: Medium) -> Vec<&str> {
        self.notes_with(&self.columns(medium))
    }

    /// Whether there is nothing to show.
    pub(crate) fn is_blank(&self) -> bool {
        self.is_empty() && self.notes.is_empty()
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.apart.len()
    }

    /// Leaves out all but the first rows of either kind; the number of those that do not stand
    /// apart.
    pub(crate) fn keep_first(&mut self, most: usize) -> usize {
        let mut found = [0, 0];
        let kept: Vec<bool> = (self.apart.iter())
            .map(|apart| {
                let found = &mut found[usize::from(*apart)];
                *found += 1;
                *found <= most
            })
            .collect();
        for column in &mut self.columns {
            let mut kept = kept.iter();
            column.cells.retain(|_| kept.next() == Some(&true));
        }
        let mut kept = kept.iter();
        self.apart.retain(|_| kept.next() == Some(&true));
        self.apart.iter().filter(|apart| !**apart).count()
    }

    /// The columns of a medium.
    pub(crate) fn columns(&self, medium: Medium) -> Vec<&Column> {
        let columns = self.columns.iter();
        columns.filter(|c| c.head.on(medium).is_some()).collect()
    }

    /// The heads in a medium for readers.
    pub(crate) fn heads(&self, medium: Medium) -> Vec<&str> {
        let columns = self.columns.iter();
        columns.filter_map(|c| c.head.on(medium)).collect()
    }

    /// The cells of each row in a medium for readers, and whether it stands apart; those that
    /// do come last.
    pub(crate) fn rows(&self, medium: Medium) -> Vec<(bool, Vec<&Cell>)> {
        let columns = self.columns(medium);
        let of = |apart: bool| (0..self.len()).filter(move |i| self.apart[*i] == apart);
        let row = |i: usize| columns.iter().map(|c| &c.cells[i]).collect();
        let all = of(false).chain(of(true));
        all.map(|i| (self.apart[i], row(i))).collect()
    }

    /// Head and rows of the CSV file, after `before` in each of them.
    pub(crate) fn records(&self, before: &[(&str, &str)]) -> Vec<Vec<String>> {
        let columns = self.columns(Medium::File);
        let mut head: Vec<String> = before.iter().map(|b| b.0.to_owned()).collect();
        for column in &columns {
            let name = column.head.file.as_deref().unwrap_or_default();
            match column.interval {
                true => head.extend([format!("{name}_lo"), format!("{name}_hi")]),
                false => head.push(name.to_owned()),
            }
        }
        let mut records = vec![head];
        records.extend((0..self.len()).map(|i| {
            let first = before.iter().map(|b| b.1.to_owned());
            let cells = columns.iter().flat_map(|c| c.cells[i].exact());
            first.chain(cells).collect()
        }));
        records
    }
}

/// A table in the making, and the things that its rows are about.
pub(crate) struct Builder<T> {
    rows: Vec<T>,
    table: Table,
}

impl<T: Copy> Builder<T> {
    pub(crate) fn new(caption: &str, rows: impl IntoIterator<Item = T>) -> Self {
        let rows: Vec<T> = rows.into_iter().collect();
        let table = Table {
            caption: caption.to_owned(),
            apart: vec![false; rows.len()],
            ..Table::default()
        };
        Self { rows, table }
    }

    /// Rows that stand apart from the others.
    pub(crate) fn apart(mut self, apart: &dyn Fn(T) -> bool) -> Self {
        self.table.apart = self.rows.iter().copied().map(apart).collect();
        self
    }

    /// A column of statistics that are a field of what a row is about.
    pub(crate) fn field<N: Number>(
        self,
        head: Head,
        format: Format,
        field: impl Fn(T) -> N,
    ) -> Self {
        self.number(head, format, &|row| field(row).number())
    }

    /// A column of intervals.
    pub(crate) fn ends(
        self,
        head: Head,
        format: Format,
        ends: &dyn Fn(T) -> Option<(f64, f64)>,
    ) -> Self {
        self.push(head, true, &|row| Cell::Interval(ends(row), format))
    }

    /// A column of numbers.
    pub(crate) fn number(
        self,
        head: Head,
        format: Format,
        number: &dyn Fn(T) -> Option<f64>,
    ) -> Self {
        self.push(head, false, &|row| Cell::Number(number(row), format))
    }

    /// A column of names. Untrusted.
    pub(crate) fn name(self, head: &str, file: &str, name: &dyn Fn(T) -> String) -> Self {
        self.push(page(head).file(file), false, &|row| Cell::Name(name(row)))
    }

    /// A column of texts. Untrusted.
    pub(crate) fn text(self, head: Head, text: &dyn Fn(T) -> String) -> Self {
        self.push(head, false, &|row| Cell::Text(text(row)))
    }

    /// A column of any cells but intervals.
    pub(crate) fn column(self, head: Head, cell: &dyn Fn(T) -> Cell) -> Self {
        self.push(head, false, cell)
    }

    fn push(mut self, head: Head, interval: bool, cell: &dyn Fn(T) -> Cell) -> Self {
        let cells = self.rows.iter().copied().map(cell).collect();
        self.table.columns.push(Column {
            head,
            interval,
            cells,
        });
        self
    }

    /// The table, with sentences below it.
    pub(crate) fn notes(self, notes: impl IntoIterator<Item = String>) -> Table {
        self.table.with_notes(notes)
    }

    pub(crate) fn done(self) -> Table {
        self.table
    }
}
