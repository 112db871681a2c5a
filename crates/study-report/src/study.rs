//! The report of a study: what `study analyze` prints and writes.

mod details;
mod parts;

pub use details::details;
pub use parts::{search_rule, track_in_words};

use crate::csv::{self, TableFile};
use crate::figures::{self, Drawn, Trace};
use crate::html::{self, Details};
use crate::picture::Picture;
use crate::picture::png::{Painter, PngError};
use crate::{json, wide};
use rayon::prelude::*;
use study_analysis::study::{Analyzed, Results};

/// End of the name of a figure that is one column wide.
const COLUMN: &str = "-column";

/// A file of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// Path relative to the folder, separated by `/`.
    pub name: String,
    /// Bytes.
    pub content: Vec<u8>,
}

impl Output {
    fn text(name: impl Into<String>, content: String) -> Self {
        Self {
            name: name.into(),
            content: content.into_bytes(),
        }
    }

    fn table(table: TableFile) -> Self {
        Self::text(table.name, table.content)
    }
}

/// The document of `study analyze --json`, `study-analysis/1` or `study-parts/1`.
pub fn document(analyzed: &Analyzed) -> String {
    match &analyzed.results {
        Results::Ratings(analysis) => json::document(&analyzed.source, analysis),
        Results::Parts(parts) => json::parts(&analyzed.source, parts),
    }
}

/// Every file of a report: tables, the page, figures with their data.
///
/// # Errors
/// If a picture cannot be made.
pub fn files(
    analyzed: &Analyzed,
    details: &Details,
    traces: &[Trace],
) -> Result<Vec<Output>, PngError> {
    let source = &analyzed.source;
    let of_parts = details.parts.iter().flat_map(|part| &part.figures);
    let drawn = (analyzed.ratings()).map_or_else(Vec::new, |a| figures::all(a, traces));
    let all: Vec<&Drawn> = drawn.iter().chain(of_parts).collect();
    let page = || match &analyzed.results {
        Results::Ratings(analysis) => html::document(source, details, analysis, &drawn),
        Results::Parts(parts) => html::parts_document(source, details, parts),
    };
    let (page, figures) = rayon::join(page, || figure_files(&all));
    let mut files: Vec<Output> = match &analyzed.results {
        Results::Ratings(analysis) => {
            let tables = csv::tables(source, analysis).into_iter();
            tables
                .chain([wide::file(analysis)])
                .map(Output::table)
                .collect()
        }
        Results::Parts(parts) => {
            let tables = csv::part_tables(parts).into_iter().map(Output::table);
            let document = Output::text("parts.json", json::parts(source, parts));
            [document].into_iter().chain(tables).collect()
        }
    };
    files.push(Output::text("report.html", page));
    files.extend(figures?);
    Ok(files)
}

/// Whether a report can have this file in its folder `figures`, which a later report
/// without it removes.
pub fn is_figure(name: &str) -> bool {
    let ending = [".svg", ".png", ".pdf", ".csv"];
    let stem = ending.iter().find_map(|e| name.strip_suffix(e));
    stem.is_some_and(|stem| {
        let stem = stem.strip_suffix(COLUMN).unwrap_or(stem);
        figures::NAMES.contains(&stem) || stem.starts_with(figures::PARTS_PREFIX)
    })
}

/// The files of figures: pictures and data.
fn figure_files(drawn: &[&Drawn]) -> Result<Vec<Output>, PngError> {
    let mut files = pictures(drawn)?;
    files.extend(drawn.iter().map(|figure| Output {
        name: format!("figures/{}.csv", figure.name),
        content: figure.data.clone().into_bytes(),
    }));
    Ok(files)
}

/// SVG, PNG and PDF of each figure, two columns wide and one column wide. Each is drawn
/// by one thread, so the number of threads changes no byte.
fn pictures(drawn: &[&Drawn]) -> Result<Vec<Output>, PngError> {
    let painter = Painter::default();
    let figures = drawn.iter().flat_map(|d| {
        let column = format!("{}{COLUMN}", d.name);
        [(d.name.clone(), &d.wide), (column, &d.narrow)]
    });
    let figures: Vec<(String, &Picture)> = figures.collect();
    let files = figures.par_iter().with_max_len(1).map(|(name, picture)| {
        let named = |ending: &str, content| Output {
            name: format!("figures/{name}.{ending}"),
            content,
        };
        painter.png(picture).map(|png| {
            [
                named("svg", picture.to_svg().into_bytes()),
                named("png", png),
                named("pdf", picture.to_pdf()),
            ]
        })
    });
    let files: Vec<[Output; 3]> = files.collect::<Result<_, _>>()?;
    Ok(files.into_iter().flatten().collect())
}
