//! What `study identify` prints and writes.

use super::{Args, Failure, Found, MethodWord};
use crate::identify::Method;
use crate::identify::grid::Cell;
use crate::model::file::{self, lookup_word};
use crate::text::{ModelId, Untrusted};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use unicode_width::UnicodeWidthStr as _;

/// Gives every cell its id and makes its file.
pub(super) fn files(
    cells: &mut [Cell],
    args: &Args,
    dir: &Path,
) -> Result<Vec<(PathBuf, String)>, Failure> {
    let template = args.id.as_deref().unwrap_or(match args.method {
        MethodWord::Ewls => "lambda-{lambda}-dx-{dx}",
        MethodWord::Static => "static-dx-{dx}",
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
            file::write(&cell.realization),
        ));
        ids.push(id);
    }
    Ok(files)
}

/// Writes the files; without `force` none if one of them is there.
pub(super) fn write(dir: &Path, files: &[(PathBuf, String)], force: bool) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    if !force && let Some((path, _)) = files.iter().find(|(path, _)| path.exists()) {
        return Err(
            Failure::input(format!("{} is there already", path.display()))
                .hint("--force overwrites it; nothing was written"),
        );
    }
    for (path, text) in files {
        // A reader never sees half a file: the whole one takes the name at once.
        let part = path.with_extension("toml.part");
        let written = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .open(&part)
            .and_then(|mut file| {
                file.write_all(text.as_bytes())
                    .and_then(|()| file.sync_all())
            })
            .and_then(|()| fs::rename(&part, path));
        if let Err(e) = written {
            // what is left of it is of no use
            let _ = fs::remove_file(&part);
            return Err(Failure::file(path, &e));
        }
    }
    Ok(())
}

/// `study-identify/1`.
pub(super) fn json(found: &Found<'_>) -> String {
    let cells: Vec<Value> = found
        .cells
        .iter()
        .map(|cell| {
            let provenance = &cell.realization.provenance;
            let by_file = |of: fn(&crate::identify::vaf::Score) -> f64| -> Map<String, Value> {
                found
                    .recordings
                    .iter()
                    .zip(&cell.scores)
                    .map(|((named, _), score)| (key(found, named), of(score).into()))
                    .collect()
            };
            let warnings: Vec<String> = cell.warnings.iter().map(ToString::to_string).collect();
            json!({
                "method": cell.method.word(),
                "lambda": provenance.lambda,
                "memory_mm": provenance.memory_mm,
                "dx_mm": provenance.dx_mm,
                "resample": provenance.resample,
                "lookup": lookup_word(cell.realization.lookup),
                "start": start(cell.method),
                "sort": sort(cell.method),
                "nodes": cell.realization.x_mm.len(),
                "vaf": by_file(|s| s.vaf),
                "bias_n": by_file(|s| s.bias_n),
                "residual_n": by_file(|s| s.residual_n),
                "negative_mass": cell.negative_mass,
                "negative_damping": cell.negative_damping,
                "warnings": warnings,
            })
        })
        .collect();
    let recording = |named: &super::Named, sha256: &str, role: &str| {
        json!({
            "file": key(found, named),
            "name": named.name,
            "sha256": sha256,
            "role": role,
        })
    };
    let recordings: Vec<Value> = found
        .recordings
        .iter()
        .enumerate()
        .map(|(i, (named, r))| {
            let validates = i < found.args.validate.len();
            recording(
                named,
                &r.sha256,
                if validates { "validate" } else { "test" },
            )
        })
        .collect();
    let document = json!({
        "format": "study-identify/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "training": recording(&found.args.training, &found.training.sha256, "training"),
        "recordings": recordings,
        "best": found.best,
        "cells": cells,
    });
    format!("{document:#}\n")
}

fn start(method: Method) -> Option<&'static str> {
    matches!(method, Method::Ewls { .. }).then_some("cold")
}

fn sort(method: Method) -> Option<&'static str> {
    matches!(method, Method::Ewls { .. }).then_some("ascending")
}

/// The file's name; the whole path where two recordings have the same.
fn key(found: &Found<'_>, named: &super::Named) -> String {
    let name = named.file_name();
    let same = found
        .recordings
        .iter()
        .filter(|(other, _)| other.file_name() == name)
        .count();
    if same > 1 {
        named.path.display().to_string()
    } else {
        name
    }
}

/// The table for a terminal, and what to make of it.
pub(super) fn table(found: &Found<'_>) -> String {
    let mut rows = vec![heads(found)];
    rows.extend(
        found
            .cells
            .iter()
            .enumerate()
            .map(|(i, cell)| row(cell, found.best == Some(i))),
    );
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}: {} samples, {:.1} s, x {:.2} to {:.2} mm, |v| up to {:.0} mm/s",
        Untrusted(&found.training.name),
        found.training.len(),
        found.training.duration_s(),
        found.training.range_mm()[0],
        found.training.range_mm()[1],
        found.training.top_speed_mm_s(),
    );
    if let Some(cell) = found.cells.first() {
        let _ = writeln!(out, "{}", how(cell));
    }
    out.push('\n');
    out.push_str(&align(&rows));
    out.push('\n');
    out.push_str(&verdict(found));
    for (said, cells) in warnings(found) {
        let _ = writeln!(out, "warning: {said} ({cells})");
    }
    out
}

/// What all cells have in common.
fn how(cell: &Cell) -> String {
    let mut words = vec![cell.method.word().to_owned()];
    if let Some(start) = start(cell.method) {
        words.push(format!("{start} start"));
    }
    if let Some(sort) = sort(cell.method) {
        words.push(format!("{sort} in x"));
    }
    if let Some(resample) = &cell.realization.provenance.resample {
        words.push(format!("{resample} resampling"));
    }
    words.push(format!("{} look-up", lookup_word(cell.realization.lookup)));
    words.join(", ")
}

fn heads(found: &Found<'_>) -> Vec<String> {
    let mut heads: Vec<String> = ["", "lambda", "L mm", "dx mm"].map(String::from).to_vec();
    for (named, _) in &found.recordings {
        // A name as long as a path would push the numbers off the screen.
        let name: String = named.name.chars().take(24).collect();
        heads.push(format!("VAF {}", Untrusted(&name)));
        heads.push("bias N".into());
        heads.push("residual N".into());
    }
    heads.push("m<0".into());
    heads.push("b<0".into());
    heads
}

fn row(cell: &Cell, best: bool) -> Vec<String> {
    let provenance = &cell.realization.provenance;
    let number = |n: Option<f64>| n.map_or("-".to_owned(), |n| n.to_string());
    let memory = match (provenance.lambda, provenance.memory_mm) {
        (Some(_), None) => "all".to_owned(),
        (_, Some(memory)) => format!("{memory:.3}"),
        (None, None) => "-".to_owned(),
    };
    let mut row = vec![
        if best { "*" } else { "" }.to_owned(),
        number(provenance.lambda),
        memory,
        number(provenance.dx_mm),
    ];
    for score in &cell.scores {
        row.push(format!("{:.6}", score.vaf));
        row.push(format!("{:+.4}", score.bias_n));
        row.push(format!("{:.4}", score.residual_n));
    }
    row.push(format!("{:.0} %", 100.0 * cell.negative_mass));
    row.push(format!("{:.0} %", 100.0 * cell.negative_damping));
    row
}

/// Which cell is best and what that is worth.
fn verdict(found: &Found<'_>) -> String {
    let Some(best) = found.best else {
        return "no cell has a VAF\n".into();
    };
    let cell = &found.cells[best];
    let validations = found.args.validate.len();
    let list = |from: usize, to: usize| {
        found.recordings[from..to]
            .iter()
            .zip(&cell.scores[from..to])
            .map(|((named, _), s)| format!("{:.6} on {}", s.vaf, Untrusted(&named.name)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if found.cells.len() == 1 {
        return format!("VAF {}\n", list(0, found.recordings.len()));
    }
    let mut out = format!(
        "* highest VAF: {}{}",
        list(0, validations),
        if validations == 1 {
            ", chosen on this recording"
        } else {
            " (highest mean), chosen on these recordings"
        }
    );
    out.push('\n');
    if validations < found.recordings.len() {
        let _ = writeln!(
            out,
            "  to report: {}",
            list(validations, found.recordings.len())
        );
    } else {
        out += "  a VAF that chose its own cell is optimistic: report one on a --test recording\n";
    }
    out
}

/// Each warning once, with the cells that have it.
fn warnings(found: &Found<'_>) -> Vec<(String, String)> {
    let mut said: Vec<(String, usize)> = Vec::new();
    for warning in found.cells.iter().flat_map(|cell| &cell.warnings) {
        let text = warning.to_string();
        match said.iter_mut().find(|(other, _)| *other == text) {
            Some((_, count)) => *count += 1,
            None => said.push((text, 1)),
        }
    }
    said.into_iter()
        .map(|(text, count)| (text, format!("{count} of {} cells", found.cells.len())))
        .collect()
}

/// Columns as wide as their widest entry, flush right.
fn align(rows: &[Vec<String>]) -> String {
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
