//! The files that `study identify` writes: model files and figures.

use super::super::trajectory::{refuse_to_overwrite, write_file};
use super::args::{Args, MethodName, distinct};
use super::{Failure, Kind, Results};
use clap::ValueEnum as _;
use std::fs;
use std::path::{Path, PathBuf};
use study_base::text::{ModelId, Untrusted};
use study_haptics::identify::grid::Cell;
use study_haptics::model::file;
use study_haptics::recording::Recording;
use study_report::identification::{self, Drawing, GridCell, Row, Shown};
use study_report::picture::png::Painter;

/// Path and content.
type OutputFile = (PathBuf, Vec<u8>);

/// Sets the id of every cell; returns the model files.
pub(super) fn models(
    cells: &mut [Cell],
    args: &Args,
    dir: &Path,
) -> Result<Vec<OutputFile>, Failure> {
    let several = distinct(&args.delta).len() > 1;
    let method = cells.first().map(|cell| cell.method.as_str());
    let method = method.and_then(|name| MethodName::from_str(name, false).ok());
    let template = args
        .id
        .as_deref()
        .unwrap_or(match method.unwrap_or(args.method()) {
            MethodName::Ewls => "lambda-{lambda}-dx-{dx}",
            MethodName::Constrained => "constrained-lambda-{lambda}-dx-{dx}",
            MethodName::TwoSided if args.width.is_some() => "two-sided-dx-{dx}",
            MethodName::TwoSided => "two-sided-{lambda}-dx-{dx}",
            MethodName::Hat if several => "hat-delta-{delta}-dx-{dx}",
            MethodName::Hat => "hat-dx-{dx}",
            MethodName::Passive if several => "passive-delta-{delta}-dx-{dx}",
            MethodName::Passive => "passive-dx-{dx}",
            MethodName::Mechanism => "mechanism-dx-{dx}",
            MethodName::Elements => "elements-dx-{dx}",
            MethodName::Friction if several => "friction-delta-{delta}",
            MethodName::Friction => "friction",
            MethodName::Static => "static-dx-{dx}",
            MethodName::Segments => "segments",
            MethodName::Spring => "spring",
        });
    let mut ids: Vec<ModelId> = Vec::new();
    let mut files = Vec::new();
    for cell in cells {
        let number = |n: Option<f64>| n.map_or(String::new(), |n| n.to_string());
        let provenance = &cell.realization.provenance;
        let id = template
            .replace("{lambda}", &number(provenance.lambda))
            .replace("{dx}", &number(provenance.dx_mm))
            .replace("{delta}", &number(cell.realization.direction.delta_mm()));
        let id = ModelId::new(id).map_err(Failure::input)?;
        if ids.iter().any(|other| other.collides_with(&id)) {
            return Err(Failure::input(format!("two cells would have the id {id}"))
                .hint("use {lambda}, {dx} and {delta} in the template, or fewer values"));
        }
        cell.realization.id = id.to_string();
        let written = match args.units() {
            Some((units, lever_mm)) => {
                file::write(&cell.realization.clone().turned(units, lever_mm))
            }
            None => file::write(&cell.realization),
        };
        files.push((dir.join(format!("{id}.toml")), written.into_bytes()));
        ids.push(id);
    }
    Ok(files)
}

/// Writes the files; without `force` none if one of them exists.
pub(super) fn write(dir: &Path, files: &[OutputFile], force: bool) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    for (path, _) in files {
        refuse_to_overwrite(Some(path), force)?;
    }
    for (path, content) in files {
        write_file(path, |sink| sink.write_all(content))?;
    }
    Ok(())
}

/// The figures as SVG, PNG, PDF and CSV, and notes on figures that need more cells.
pub(super) fn figures(
    results: &Results<'_>,
    dir: &Path,
) -> Result<(Vec<OutputFile>, Vec<&'static str>), Failure> {
    let mut missing = Vec::new();
    let mut drawings: Vec<Drawing> = Vec::new();
    let shown = results
        .args
        .units()
        .map_or(Shown::LINEAR, |(units, lever_mm)| Shown { units, lever_mm });
    let lambdas = (results.cells.iter()).any(|c| c.realization.provenance.lambda.is_some());
    let row = if lambdas { Row::Lambda } else { Row::Delta };
    let places: Vec<GridCell> = results
        .cells
        .iter()
        .filter_map(|cell| {
            let provenance = &cell.realization.provenance;
            Some(GridCell {
                value: match row {
                    Row::Lambda => provenance.lambda?,
                    Row::Delta => cell.realization.direction.delta_mm()?,
                },
                memory_mm: provenance.memory_mm,
                dx_mm: provenance.dx_mm?,
                vaf: cell.scores.first()?.vaf,
            })
        })
        .collect();
    let whole = places.len() == results.cells.len();
    let selected_on = results
        .recordings
        .first()
        .map_or("", |(named, _)| &named.name);
    let name = Untrusted(selected_on).to_string();
    let best = results.best.filter(|_| whole);
    match identification::surface(row, &places, best, &name, shown) {
        Some(drawing) => drawings.push(drawing),
        None => {
            missing.push("no Fig. 4: it requires two dx and two lambda, or two dx and two delta")
        }
    }
    if let Some(cell) = results.cells.get(results.best.unwrap_or(0)) {
        let recording = results.reported();
        let realization = &cell.realization;
        let mechanism = identification::mechanism(realization, recording, shown);
        let is_table = mechanism.is_none();
        drawings.push(mechanism.unwrap_or_else(|| identification::parameters(realization, shown)));
        drawings.push(identification::force(realization, recording, shown));
        drawings.push(identification::spectra(realization, recording, shown));
        let training: Vec<&Recording> = results.training.iter().map(|(_, r)| r).collect();
        drawings.extend(identification::displacement(realization, &training, shown));
        let dx = realization.provenance.dx_mm;
        let same_dx: Vec<_> = results
            .cells
            .iter()
            .filter(|other| other.realization.provenance.dx_mm == dx)
            .filter_map(|other| Some((other.realization.provenance.lambda?, &other.realization)))
            .collect();
        match identification::map(&same_dx, shown) {
            Some(drawing) => drawings.push(drawing),
            None if is_table => missing.push("no Fig. 8: it requires at least two lambda"),
            None => {}
        }
    }
    let painter = Painter::default();
    let mut files = Vec::new();
    for drawing in drawings {
        let path = |ending: &str| dir.join(format!("{}.{ending}", drawing.name));
        let picture = drawing.figure.picture();
        let png = painter
            .png(&picture)
            .map_err(|e| Failure::new(Kind::Bug, e.to_string()))?;
        files.push((path("svg"), picture.to_svg().into_bytes()));
        files.push((path("png"), png));
        files.push((path("pdf"), picture.to_pdf()));
        files.push((path("csv"), drawing.csv.into_bytes()));
    }
    Ok((files, missing))
}
