//! What `study identify` prints.

use super::Found;
use super::args::Named;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_haptics::identify::Method;
use study_haptics::identify::grid::Cell;
use study_haptics::identify::validation::{JUST_NOTICEABLE_N, Part};
use study_haptics::model::file::lookup_word;
use study_haptics::recording::Recording;
use study_wire::certificate::Certificate;
use unicode_width::UnicodeWidthStr as _;

/// More cells than this are shown as a surface instead of a list.
const MOST_ROWS: usize = 30;

/// `study-identify/1`.
pub(super) fn json(found: &Found<'_>) -> String {
    let cells: Vec<Value> = found
        .cells
        .iter()
        .map(|cell| {
            let provenance = &cell.realization.provenance;
            let by_file =
                |of: fn(&study_haptics::identify::vaf::Score) -> f64| -> Map<String, Value> {
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
                "estimator": provenance.method,
                "filter": provenance.filter,
                "nodes": cell.realization.x_mm.len(),
                "vaf": by_file(|s| s.vaf),
                "bias_n": by_file(|s| s.bias_n),
                "residual_n": by_file(|s| s.residual_n),
                "negative_mass": cell.certificate.negative_mass,
                "negative_damping": cell.certificate.negative_damping,
                "certificate": certificate(&cell.certificate),
                "warnings": warnings,
            })
        })
        .collect();
    let recording = |named: &Named, recording: &Recording, role: &str| {
        let warnings: Vec<String> = recording.warnings.iter().map(ToString::to_string).collect();
        json!({
            "file": key(found, named),
            "name": named.name,
            "sha256": recording.sha256,
            "role": role,
            "warnings": warnings,
        })
    };
    let recordings: Vec<Value> = found
        .recordings
        .iter()
        .enumerate()
        .map(|(i, (named, r))| {
            let validates = i < found.args.validate.len();
            recording(named, r, if validates { "validate" } else { "test" })
        })
        .collect();
    let validation: Map<String, Value> = found
        .recordings
        .iter()
        .zip(found.validations.iter().zip(&found.ceilings))
        .filter_map(|((named, _), (validation, ceiling))| {
            let v = validation.as_ref()?;
            let detents: Vec<Value> = v
                .detents
                .iter()
                .map(|(x_mm, p)| json!({ "x_mm": x_mm, "part": p.as_ref().map(part) }))
                .collect();
            let document = json!({
                "whole": part(&v.whole),
                "positive": v.positive.as_ref().map(part),
                "negative": v.negative.as_ref().map(part),
                "detents": detents,
                "ceiling": ceiling.map(|c| json!({
                    "vaf": c.vaf, "noise_n": c.noise_n, "apart_mm": c.apart_mm,
                })),
            });
            Some((key(found, named), document))
        })
        .collect();
    let document = json!({
        "format": "study-identify/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "training": recording(&found.args.training, found.training, "training"),
        "recordings": recordings,
        "best": found.best,
        "validation": validation,
        "cells": cells,
    });
    format!("{document:#}\n")
}

fn part(part: &Part) -> Value {
    json!({
        "samples": part.samples,
        "vaf": part.vaf,
        "bias_n": part.bias_n,
        "residual_n": part.residual_n,
        "nrmse": part.nrmse,
    })
}

/// What is not finite, such as a margin that nothing can mend, is null.
fn certificate(certificate: &Certificate) -> Value {
    let margins: Map<String, Value> = certificate
        .conditions()
        .iter()
        .map(|(condition, margin)| {
            let document = json!({
                "value": margin.value, "unit": condition.unit(), "at_mm": margin.at_mm,
            });
            (condition.word().to_owned(), document)
        })
        .collect();
    json!({
        "pass": certificate.passes(),
        "margins": margins,
        "stiffness_n_per_mm": certificate.stiffness_n_per_mm,
        "damping_n_s_per_mm": certificate.damping_n_s_per_mm,
        "mass_kg": certificate.mass_kg,
    })
}

fn start(method: Method) -> Option<&'static str> {
    match method {
        Method::Ewls(options) => Some(options.start.word()),
        _ => None,
    }
}

fn sort(method: Method) -> Option<&'static str> {
    match method {
        Method::Ewls(options) => Some(options.sort.word()),
        _ => None,
    }
}

/// The file's name; the whole path where two recordings have the same.
fn key(found: &Found<'_>, named: &Named) -> String {
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
    match surface(found) {
        Some(rows) => {
            let name = Untrusted(&found.recordings[0].0.name);
            let _ = writeln!(out, "VAF on {name}, by lambda (and L in mm) and dx in mm:");
            out.push_str(&align(&rows));
        }
        None => {
            let mut rows = vec![heads(found)];
            let cells = found.cells.iter().enumerate();
            rows.extend(cells.map(|(i, cell)| row(cell, found.best == Some(i))));
            out.push_str(&align(&rows));
        }
    }
    out.push('\n');
    out.push_str(&verdict(found));
    out.push_str(&worth(found));
    for (said, cells) in warnings(found) {
        let _ = writeln!(out, "warning: {said} ({cells})");
    }
    out
}

/// A large grid as rows of lambda and columns of dx.
fn surface(found: &Found<'_>) -> Option<Vec<Vec<String>>> {
    if found.cells.len() <= MOST_ROWS {
        return None;
    }
    let mut increments: Vec<f64> = Vec::new();
    let mut rows: Vec<(f64, Vec<String>)> = Vec::new();
    for (i, cell) in found.cells.iter().enumerate() {
        let provenance = &cell.realization.provenance;
        let (lambda, dx) = (provenance.lambda?, provenance.dx_mm?);
        if !increments.contains(&dx) {
            increments.push(dx);
        }
        let mark = if found.best == Some(i) { "*" } else { "" };
        let vaf = format!("{mark}{:.4}", cell.scores.first()?.vaf);
        match rows.last_mut() {
            Some((last, row)) if *last == lambda => row.push(vaf),
            _ => {
                let memory = provenance
                    .memory_mm
                    .map_or("all".into(), |l| format!("{l:.3}"));
                rows.push((lambda, vec![lambda.to_string(), memory, vaf]));
            }
        }
    }
    let mut heads = vec!["lambda".to_owned(), "L".to_owned()];
    heads.extend(increments.iter().map(ToString::to_string));
    let mut table = vec![heads];
    table.extend(rows.into_iter().map(|(_, row)| row));
    let columns = table[0].len();
    table
        .iter()
        .all(|row| row.len() == columns)
        .then_some(table)
}

/// The best cell in parts, its ceiling and its certificate.
fn worth(found: &Found<'_>) -> String {
    let Some(cell) = found.best.map(|best| &found.cells[best]) else {
        return String::new();
    };
    let mut rows = vec![
        ["", "VAF", "NRMSE", "bias N", "residual N", "noticed"]
            .map(String::from)
            .to_vec(),
    ];
    let mut ceilings = String::new();
    for ((named, _), (validation, ceiling)) in found
        .recordings
        .iter()
        .zip(found.validations.iter().zip(&found.ceilings))
    {
        let Some(v) = validation else { continue };
        let mut row = |what: String, part: &Option<Part>| {
            if let Some(part) = part {
                rows.push(vec![
                    what,
                    format!("{:.4}", part.vaf),
                    format!("{:.3}", part.nrmse),
                    format!("{:+.3}", part.bias_n),
                    format!("{:.3}", part.residual_n),
                    format!("{:.1}x", part.noticeable()),
                ]);
            }
        };
        row(short_name(named), &Some(v.whole));
        row("v > 0".into(), &v.positive);
        row("v < 0".into(), &v.negative);
        for ([low, high], part) in &v.detents {
            row(format!("x {low:.1} to {high:.1} mm"), part);
        }
        if let Some(c) = ceiling {
            let _ = writeln!(
                ceilings,
                "the most that any model could reach on {}: {:.6}, by its repetition ({:.3} N does not come back)",
                Untrusted(&named.name),
                c.vaf,
                c.noise_n
            );
        }
    }
    let provenance = &cell.realization.provenance;
    let filter = provenance.filter.as_deref().unwrap_or("unknown");
    format!(
        "\nthe {} cell in parts, signals {filter}; `noticed` in just noticeable differences of {JUST_NOTICEABLE_N} N\n{}{ceilings}certificate {}\n    {}\n    m < 0 at {:.0} % of the nodes, b < 0 at {:.0} %\n",
        if found.cells.len() == 1 {
            "only"
        } else {
            "best"
        },
        align(&rows),
        cell.certificate,
        super::needs(&cell.certificate),
        100.0 * cell.certificate.negative_mass,
        100.0 * cell.certificate.negative_damping,
    )
}

/// A name as long as a path would push the numbers off the screen.
fn short_name(named: &Named) -> String {
    let name: String = named.name.chars().take(24).collect();
    Untrusted(&name).to_string()
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
        heads.push(format!("VAF {}", short_name(named)));
        heads.push("bias N".into());
        heads.push("residual N".into());
    }
    heads.push("m<0".into());
    heads.push("b<0".into());
    heads.push("passive".into());
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
    row.push(format!("{:.0} %", 100.0 * cell.certificate.negative_mass));
    row.push(format!(
        "{:.0} %",
        100.0 * cell.certificate.negative_damping
    ));
    row.push(
        if cell.certificate.passes() {
            "PASS"
        } else {
            "FAIL"
        }
        .into(),
    );
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
