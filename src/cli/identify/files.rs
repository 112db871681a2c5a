//! The files that `study identify` writes: models and figures.

use super::args::{Args, MethodWord};
use super::{Failure, Found, Kind};
use crate::report::identification::{self, Drawing, Place};
use crate::report::png::Painter;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use study_base::text::{ModelId, Untrusted};
use study_haptics::identify::grid::Cell;
use study_haptics::model::file;

/// Path and content.
type Written = (PathBuf, Vec<u8>);

/// Gives every cell its id and makes its file.
pub(super) fn models(cells: &mut [Cell], args: &Args, dir: &Path) -> Result<Vec<Written>, Failure> {
    let template = args.id.as_deref().unwrap_or(match args.method {
        MethodWord::Ewls => "lambda-{lambda}-dx-{dx}",
        MethodWord::Constrained => "constrained-lambda-{lambda}-dx-{dx}",
        MethodWord::TwoSided if args.width.is_some() => "two-sided-dx-{dx}",
        MethodWord::TwoSided => "two-sided-{lambda}-dx-{dx}",
        MethodWord::Hat => "hat-dx-{dx}",
        MethodWord::Static => "static-dx-{dx}",
        MethodWord::Segments => "segments",
        MethodWord::Spring => "spring",
    });
    let mut ids: Vec<ModelId> = Vec::new();
    let mut files = Vec::new();
    for cell in cells {
        let number = |n: Option<f64>| n.map_or(String::new(), |n| n.to_string());
        let provenance = &cell.realization.provenance;
        let id = template
            .replace("{lambda}", &number(provenance.lambda))
            .replace("{dx}", &number(provenance.dx_mm));
        let id = ModelId::new(id).map_err(Failure::input)?;
        if ids.iter().any(|other| other.collides_with(&id)) {
            return Err(Failure::input(format!("two cells would be called {id}"))
                .hint("the template needs {lambda} or {dx}, or the list is too long"));
        }
        cell.realization.id = id.to_string();
        files.push((
            dir.join(format!("{id}.toml")),
            file::write(&cell.realization).into_bytes(),
        ));
        ids.push(id);
    }
    Ok(files)
}

/// Writes the files; without `force` none if one of them is there.
pub(super) fn write(dir: &Path, files: &[Written], force: bool) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    if !force && let Some((path, _)) = files.iter().find(|(path, _)| path.exists()) {
        return Err(
            Failure::input(format!("{} is there already", path.display()))
                .hint("--force overwrites it; nothing was written"),
        );
    }
    for (path, content) in files {
        // A reader never sees half a file: the whole one takes the name at once.
        let mut part = path.clone().into_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        let written = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .open(&part)
            .and_then(|mut file| file.write_all(content).and_then(|()| file.sync_all()))
            .and_then(|()| fs::rename(&part, path));
        if let Err(e) = written {
            // what is left of it is of no use
            let _ = fs::remove_file(&part);
            return Err(Failure::file(path, &e));
        }
    }
    Ok(())
}

/// The figures that the cells are enough for, as SVG, PNG and CSV, and in words
/// those that they are not.
pub(super) fn figures(
    found: &Found<'_>,
    dir: &Path,
) -> Result<(Vec<Written>, Vec<&'static str>), Failure> {
    let mut missing = Vec::new();
    let mut drawings: Vec<Drawing> = Vec::new();
    // chosen on this one, and drawn for the one that nothing was chosen on
    let (chosen_on, _) = found.recordings[0];
    let places: Vec<Place> = found
        .cells
        .iter()
        .filter_map(|cell| {
            let provenance = &cell.realization.provenance;
            Some(Place {
                lambda: provenance.lambda?,
                memory_mm: provenance.memory_mm,
                dx_mm: provenance.dx_mm?,
                vaf: cell.scores.first()?.vaf,
            })
        })
        .collect();
    let whole = places.len() == found.cells.len();
    let name = Untrusted(&chosen_on.name).to_string();
    match identification::surface(&places, found.best.filter(|_| whole), &name) {
        Some(drawing) => drawings.push(drawing),
        None => missing.push("no Fig. 4: it takes two or more lambda and dx"),
    }
    let shown = found.best.unwrap_or(0);
    if let Some(cell) = found.cells.get(shown) {
        let recording = found.recordings[found.reported()].1;
        drawings.push(identification::parameters(&cell.realization));
        drawings.push(identification::force(&cell.realization, recording));
        drawings.push(identification::spectra(&cell.realization, recording));
        let dx = cell.realization.provenance.dx_mm;
        let beside: Vec<_> = found
            .cells
            .iter()
            .filter(|other| other.realization.provenance.dx_mm == dx)
            .filter_map(|other| Some((other.realization.provenance.lambda?, &other.realization)))
            .collect();
        match identification::map(&beside) {
            Some(drawing) => drawings.push(drawing),
            None => missing.push("no Fig. 8: it takes two or more lambda"),
        }
    }
    let painter = Painter::default();
    let mut files = Vec::new();
    for drawing in drawings {
        let path = |ending: &str| dir.join(format!("{}.{ending}", drawing.name));
        let svg = drawing.figure.to_svg();
        let png = painter
            .png(&svg)
            .map_err(|e| Failure::new(Kind::Bug, e.to_string()))?;
        files.push((path("svg"), svg.into_bytes()));
        files.push((path("png"), png));
        files.push((path("csv"), drawing.csv.into_bytes()));
    }
    Ok((files, missing))
}
