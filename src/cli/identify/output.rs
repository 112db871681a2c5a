//! What `study identify` prints.

use super::args::NamedPath;
use super::printed::{Printed, align, short_name};
use super::{Results, comparison, first, loops};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_haptics::identify::Method;
use study_haptics::identify::grid::Cell;
use study_haptics::identify::mechanism::{Filter, Fitted, PARAMETERS};
use study_haptics::identify::vaf::Score;
use study_haptics::identify::validation::{Accuracy, JUST_NOTICEABLE_N};
use study_haptics::model::Units;
use study_haptics::recording::Recording;
use study_wire::certificate::Certificate;

/// Most cells shown as a list; more are shown as rows of lambda and columns of dx.
const MAX_ROWS: usize = 30;

/// The results as a JSON document, format `study-identify/1`.
pub(super) fn json(results: &Results<'_>) -> String {
    let cells: Vec<Value> = results
        .cells
        .iter()
        .map(|cell| {
            let provenance = &cell.realization.provenance;
            let by_file = |of: fn(&Score) -> f64| -> Map<String, Value> {
                (results.recordings.iter().zip(&cell.scores))
                    .map(|((named, _), score)| (named.name.clone(), of(score).into()))
                    .collect()
            };
            let warnings: Vec<String> = cell.warnings.iter().map(ToString::to_string).collect();
            let [start, sort] = start_and_sort(cell.method);
            json!({
                "method": cell.method.as_str(),
                "lambda": provenance.lambda,
                "memory_mm": provenance.memory_mm,
                "dx_mm": provenance.dx_mm,
                "resample": provenance.resample,
                "lookup": cell.realization.lookup.as_str(),
                "direction": cell.realization.direction.as_str(),
                "delta_mm": cell.realization.direction.delta_mm(),
                "start": start,
                "sort": sort,
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
                "mechanism": cell.fitted.as_deref().map(mechanism),
            })
        })
        .collect();
    let recording = |named: &NamedPath, recording: &Recording, role: &str| {
        let warnings: Vec<String> = recording.warnings.iter().map(ToString::to_string).collect();
        json!({
            "file": named.path.file_name().map(|name| name.to_string_lossy()),
            "name": named.name,
            "sha256": recording.sha256,
            "role": role,
            "warnings": warnings,
        })
    };
    let further = (results.training.iter().skip(1)).map(|(named, r)| (*named, r, "training"));
    let others = results
        .recordings
        .iter()
        .enumerate()
        .map(|(i, (named, r))| {
            let validates = i < results.args.validate.len();
            (*named, *r, if validates { "validate" } else { "test" })
        });
    let recordings: Vec<Value> = (further.chain(others))
        .map(|(named, r, role)| recording(named, r, role))
        .collect();
    let validation: Map<String, Value> = results
        .recordings
        .iter()
        .zip(results.validations.iter().zip(&results.ceilings))
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
                    "residual_over_least": c.residual(v.whole.vaf),
                })),
            });
            Some((named.name.clone(), document))
        })
        .collect();
    let mut document = json!({
        "format": "study-identify/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "training": results.training.first().map(|(named, r)| recording(named, r, "training")),
        "recordings": recordings,
        "best": results.best,
        "validation": validation,
        "force_curve": loops::json(results),
        "cells": cells,
    });
    if let Some(comparison) = &results.comparison {
        document["comparison"] = comparison::json(comparison);
    }
    format!("{document:#}\n")
}

fn part(accuracy: &Accuracy) -> Value {
    json!({
        "samples": accuracy.samples,
        "vaf": accuracy.vaf,
        "bias_n": accuracy.bias_n,
        "residual_n": accuracy.residual_n,
        "nrmse": accuracy.nrmse,
    })
}

/// Numbers that are not finite, such as an unbounded stiffness, become null.
fn certificate(certificate: &Certificate) -> Value {
    let margins: Map<String, Value> = certificate
        .conditions()
        .iter()
        .map(|(condition, margin)| {
            let document = json!({
                "value": margin.value, "unit": condition.unit(), "at_mm": margin.at_mm,
            });
            (condition.as_str().to_owned(), document)
        })
        .collect();
    json!({
        "pass": certificate.passes(),
        "margins": margins,
        "stiffness_n_per_mm": certificate.stiffness_n_per_mm,
        "state_n_per_mm": certificate.state_n_per_mm,
        "damping_n_s_per_mm": certificate.damping_n_s_per_mm,
        "mass_kg": certificate.mass_kg,
    })
}

/// The parameters of a mechanism, its low-pass and all starts.
fn mechanism(fitted: &Fitted) -> Value {
    let values = fitted.mechanism.scalars.to_array();
    let parameters: Vec<Value> = (PARAMETERS.iter().zip(values))
        .zip(fitted.standard_errors)
        .map(|(((name, unit, _), value), error)| {
            json!({ "name": name, "unit": unit, "value": value, "standard_error": error })
        })
        .collect();
    let starts: Vec<Value> = (fitted.attempts.iter())
        .map(|a| {
            json!({
                "gap_mm": a.gap_mm, "mass_kg": a.mass_kg,
                "compared_rms_n": a.compared_n, "fitted_rms_n": a.fitted_n,
            })
        })
        .collect();
    let (filtered, corner_hz) = match fitted.filter {
        Filter::Recorded(hz) => (true, hz),
        Filter::Both(hz) => (false, hz),
    };
    json!({
        "parameters": parameters,
        "starts": starts,
        "iterations": fitted.iterations,
        "recorded_force_low_passed": filtered,
        "corner_hz": corner_hz,
    })
}

/// The parameters of a mechanism as text.
fn mechanism_in_detail(fitted: &Fitted) -> String {
    let mut rows = vec![
        ["mechanism", "", "standard error", ""]
            .map(String::from)
            .to_vec(),
    ];
    let values = fitted.mechanism.scalars.to_array();
    for (((name, unit, _), value), error) in
        (PARAMETERS.iter().zip(values)).zip(fitted.standard_errors)
    {
        let error = error.map_or("-".to_owned(), |error| format!("{error:.2e}"));
        rows.push(vec![
            (*name).to_owned(),
            format!("{value:.4e}"),
            error,
            (*unit).to_owned(),
        ]);
    }
    let mut out = align(&rows);
    let _ = match fitted.filter {
        Filter::Recorded(hz) => writeln!(
            out,
            "the recorded force passed a low-pass of about {hz} Hz; so does the predicted one"
        ),
        Filter::Both(hz) => writeln!(
            out,
            "recorded force not filtered; fitted below {hz} Hz, predicted without a filter"
        ),
    };
    let [low, high] = fitted.reach_mm;
    let _ = writeln!(
        out,
        "the follower was at {low:.2} to {high:.2} mm; beyond, detents and friction keep their last values"
    );
    out += "starts, with their rms error on a part and on all of the training recordings:\n";
    for a in &fitted.attempts {
        let fitted_n = a
            .fitted_n
            .map_or("not continued".to_owned(), |n| format!("{n:.4} N"));
        let _ = writeln!(
            out,
            "    backlash {:.2} mm, mass {:.3} kg: {:.4} N, {fitted_n}",
            a.gap_mm, a.mass_kg, a.compared_n
        );
    }
    out
}

/// The names of start and sort, for the methods that have them.
fn start_and_sort(method: Method) -> [Option<&'static str>; 2] {
    match method {
        Method::Ewls(options) => [Some(options.start.as_str()), Some(options.sort.as_str())],
        _ => [None; 2],
    }
}

/// A number without the digits that a conversion of units leaves.
fn plain(value: f64) -> String {
    let rounded = format!("{value:.6e}").parse::<f64>();
    rounded.map_or_else(|_| value.to_string(), |value| value.to_string())
}

/// The results as text for a terminal of this width.
pub(super) fn table(results: &Results<'_>, width: usize) -> String {
    let mut out = String::new();
    let p = Printed::of(results);
    if p.units != Units::Linear {
        let _ = writeln!(
            out,
            "angles in {} and torques in N·m; certificates, mechanisms and warnings in mm and N at {} mm",
            p.x(),
            p.lever_mm
        );
    }
    for (_, training) in results.training {
        let fastest = p.length(training.top_speed_mm_s());
        let decimals = if fastest < 10.0 { 2 } else { 0 };
        let _ = writeln!(
            out,
            "{}: {} samples, {:.1} s, x {:.2} to {:.2} {x}, |v| up to {fastest:.decimals$} {x}/s",
            Untrusted(&training.name),
            training.len(),
            training.duration_s(),
            p.length(training.range_mm()[0]),
            p.length(training.range_mm()[1]),
            x = p.x(),
        );
    }
    if let Some(comparison) = &results.comparison {
        out.push('\n');
        out += &comparison::table(results, comparison);
        return finished(out, results, width);
    }
    if let Some(cell) = results.cells.first() {
        let _ = writeln!(out, "{}", settings(cell));
    }
    out.push('\n');
    match surface(results) {
        Some(rows) => {
            let name = (results.recordings.first()).map_or("", |(named, _)| &named.name);
            let name = Untrusted(name);
            let x = p.x();
            let _ = writeln!(
                out,
                "VAF on {name}, by lambda (and L in {x}) and dx in {x}:"
            );
            out.push_str(&align(&rows));
        }
        None => {
            let mut rows = vec![heads(results)];
            let cells = results.cells.iter().enumerate();
            rows.extend(cells.map(|(i, cell)| row(results, cell, results.best == Some(i))));
            out.push_str(&align(&rows));
        }
    }
    out.push('\n');
    out.push_str(&selection(results));
    finished(out, results, width)
}

/// With the best cell in detail and the warnings.
fn finished(mut out: String, results: &Results<'_>, width: usize) -> String {
    out.push_str(&best_in_detail(results));
    out.push_str(&loops::text(results));
    for (warning, cells) in warnings(results) {
        let _ = writeln!(out, "warning: {warning} ({cells})");
    }
    out + &first::text(results, width)
}

/// A large grid as rows of lambda and columns of dx; `None` for a small one.
fn surface(results: &Results<'_>) -> Option<Vec<Vec<String>>> {
    if results.cells.len() <= MAX_ROWS {
        return None;
    }
    let p = Printed::of(results);
    let mut increments: Vec<f64> = Vec::new();
    let mut rows: Vec<(f64, Vec<String>)> = Vec::new();
    for (i, cell) in results.cells.iter().enumerate() {
        let provenance = &cell.realization.provenance;
        let (lambda, dx) = (provenance.lambda?, provenance.dx_mm?);
        if !increments.contains(&dx) {
            increments.push(dx);
        }
        let mark = if results.best == Some(i) { "*" } else { "" };
        let vaf = format!("{mark}{:.4}", cell.scores.first()?.vaf);
        match rows.last_mut() {
            Some((last, row)) if *last == lambda => row.push(vaf),
            _ => {
                let memory = provenance
                    .memory_mm
                    .map_or("all".into(), |l| format!("{:.3}", p.length(l)));
                rows.push((lambda, vec![lambda.to_string(), memory, vaf]));
            }
        }
    }
    let mut heads = vec!["lambda".to_owned(), "L".to_owned()];
    heads.extend(increments.iter().map(|dx| plain(p.length(*dx))));
    let mut table = vec![heads];
    table.extend(rows.into_iter().map(|(_, row)| row));
    let columns = table[0].len();
    table
        .iter()
        .all(|row| row.len() == columns)
        .then_some(table)
}

/// The accuracy of the best cell by direction and detent, its ceiling and certificate.
fn best_in_detail(results: &Results<'_>) -> String {
    let Some(cell) = results.best.map(|best| &results.cells[best]) else {
        return String::new();
    };
    let p = Printed::of(results);
    let [bias, residual] = ["bias", "residual"].map(|name| format!("{name} {}", p.f()));
    let heads = ["", "VAF", "NRMSE", &bias, &residual, "in JND"];
    let mut rows = vec![heads.map(String::from).to_vec()];
    let mut ceilings = String::new();
    // a torque in N·m is some 30 times smaller than its force
    let decimals = if p.units == Units::Linear { 3 } else { 5 };
    for ((named, _), (validation, ceiling)) in results
        .recordings
        .iter()
        .zip(results.validations.iter().zip(&results.ceilings))
    {
        let Some(v) = validation else { continue };
        let mut row = |samples: String, accuracy: &Option<Accuracy>| {
            if let Some(accuracy) = accuracy {
                rows.push(vec![
                    samples,
                    format!("{:.4}", accuracy.vaf),
                    format!("{:.3}", accuracy.nrmse),
                    format!("{:+.*}", decimals, p.force(accuracy.bias_n)),
                    format!("{:.*}", decimals, p.force(accuracy.residual_n)),
                    format!("{:.1}", accuracy.in_noticeable_differences()),
                ]);
            }
        };
        row(short_name(named), &Some(v.whole));
        row("v > 0".into(), &v.positive);
        row("v < 0".into(), &v.negative);
        for ([low, high], part) in &v.detents {
            let [low, high] = [*low, *high].map(|mm| p.length(mm));
            row(format!("x {low:.1} to {high:.1} {}", p.x()), part);
        }
        if let Some(c) = ceiling {
            let _ = writeln!(
                ceilings,
                "highest VAF that a model can reach on {}: {:.6} (its repetition differs by noise of {:.*} {}); the residual is {:.1} times the least one",
                Untrusted(&named.name),
                c.vaf,
                decimals,
                p.force(c.noise_n),
                p.f(),
                c.residual(v.whole.vaf)
            );
        }
    }
    let provenance = &cell.realization.provenance;
    let filter = provenance.filter.as_deref().unwrap_or("unknown");
    let mechanism = (cell.fitted.as_deref()).map_or(String::new(), mechanism_in_detail);
    let (noticeable, accuracy) = match rows.len() {
        1 => (String::new(), String::new()),
        _ => (
            format!("; JND: just noticeable difference, {JUST_NOTICEABLE_N} N"),
            align(&rows),
        ),
    };
    format!(
        "\nthe {} cell in detail{noticeable}\nsignals: {filter}\n{accuracy}{ceilings}{mechanism}certificate {}\n    {}\n    m < 0 at {:.0} % of the nodes, b < 0 at {:.0} %\n{}",
        if results.cells.len() == 1 {
            "only"
        } else {
            "best"
        },
        cell.certificate,
        super::required_damping(&cell.certificate),
        100.0 * cell.certificate.negative_mass,
        100.0 * cell.certificate.negative_damping,
        super::dangers(&cell.realization),
    )
}

/// The settings that all cells share.
fn settings(cell: &Cell) -> String {
    let mut parts = vec![cell.method.as_str().to_owned()];
    let [start, sort] = start_and_sort(cell.method);
    parts.extend(start.map(|start| format!("{start} start")));
    parts.extend(sort.map(|sort| format!("{sort} in x")));
    if let Some(resample) = &cell.realization.provenance.resample {
        parts.push(format!("{resample} resampling"));
    }
    parts.push(format!("{} look-up", cell.realization.lookup.as_str()));
    parts.join(", ")
}

fn heads(results: &Results<'_>) -> Vec<String> {
    let p = Printed::of(results);
    let (x, f) = (p.x(), p.f());
    let mut heads = vec![String::new()];
    if has_memory(results) {
        heads.extend(["lambda".into(), format!("L {x}")]);
    }
    heads.push(format!("dx {x}"));
    if has_delta(results) {
        heads.push(format!("delta {x}"));
    }
    for (named, _) in &results.recordings {
        heads.push(format!("VAF {}", short_name(named)));
        heads.extend([format!("bias {f}"), format!("residual {f}")]);
    }
    heads.extend(["m<0", "b<0", "passive"].map(String::from));
    heads
}

/// Whether a cell has a forgetting factor or a width of its weights.
fn has_memory(results: &Results<'_>) -> bool {
    let memory = |cell: &Cell| {
        let provenance = &cell.realization.provenance;
        provenance.lambda.is_some() || provenance.memory_mm.is_some()
    };
    results.cells.iter().any(memory)
}

/// Whether a cell has a direction state.
fn has_delta(results: &Results<'_>) -> bool {
    let delta = |cell: &Cell| cell.realization.direction.delta_mm();
    results.cells.iter().any(|cell| delta(cell).is_some())
}

fn row(results: &Results<'_>, cell: &Cell, best: bool) -> Vec<String> {
    let p = Printed::of(results);
    let decimals = p.decimals();
    let provenance = &cell.realization.provenance;
    let number = |n: Option<f64>| n.map_or("-".to_owned(), |n| n.to_string());
    let memory = match (provenance.lambda, provenance.memory_mm) {
        (Some(_), None) => "all".to_owned(),
        (_, Some(memory)) => format!("{:.3}", p.length(memory)),
        (None, None) => "-".to_owned(),
    };
    let mut row = vec![if best { "*" } else { "" }.to_owned()];
    if has_memory(results) {
        row.extend([number(provenance.lambda), memory]);
    }
    row.push((provenance.dx_mm).map_or("-".to_owned(), |dx| plain(p.length(dx))));
    if has_delta(results) {
        let delta_mm = cell.realization.direction.delta_mm();
        row.push(number(
            delta_mm.map(|mm| (1e4 * p.length(mm)).round() / 1e4),
        ));
    }
    for score in &cell.scores {
        row.push(format!("{:.6}", score.vaf));
        row.push(format!("{:+.decimals$}", p.force(score.bias_n)));
        row.push(format!("{:.decimals$}", p.force(score.residual_n)));
    }
    let certificate = &cell.certificate;
    for share in [certificate.negative_mass, certificate.negative_damping] {
        row.push(format!("{:.0} %", 100.0 * share));
    }
    let passes = certificate.passes();
    row.push(if passes { "PASS" } else { "FAIL" }.to_owned());
    row
}

/// The VAF of the best cell, on what it was selected, and the VAF to report.
fn selection(results: &Results<'_>) -> String {
    let Some(best) = results.best else {
        return "no cell has a VAF\n".into();
    };
    let cell = &results.cells[best];
    let validations = results.args.validate.len();
    let list = |from: usize, to: usize| {
        results.recordings[from..to]
            .iter()
            .zip(&cell.scores[from..to])
            .map(|((named, _), s)| format!("{:.6} on {}", s.vaf, Untrusted(&named.name)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if results.recordings.is_empty() {
        return "no VAF: there is no --validate or --test recording\n".into();
    }
    if results.cells.len() == 1 {
        return format!("VAF {}\n", list(0, results.recordings.len()));
    }
    let mut out = format!(
        "* highest VAF: {}{}",
        list(0, validations),
        if validations == 1 {
            ", selected on this recording"
        } else {
            " (highest mean), selected on these recordings"
        }
    );
    out.push('\n');
    if validations < results.recordings.len() {
        let _ = writeln!(
            out,
            "  to report: {}",
            list(validations, results.recordings.len())
        );
    } else {
        out += "  the VAF on the recording used for selection is optimistic: report the VAF on a --test recording\n";
    }
    out
}

/// Each warning once, with the number of cells that have it.
fn warnings(results: &Results<'_>) -> Vec<(String, String)> {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for warning in results.cells.iter().flat_map(|cell| &cell.warnings) {
        let text = warning.to_string();
        match counts.iter_mut().find(|(other, _)| *other == text) {
            Some((_, count)) => *count += 1,
            None => counts.push((text, 1)),
        }
    }
    counts
        .into_iter()
        .map(|(text, count)| (text, format!("{count} of {} cells", results.cells.len())))
        .collect()
}
