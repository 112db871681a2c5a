//! The document `study-identify/1`.

use super::{comparison, elements, loops};
use serde_json::{Map, Value, json};
use std::path::Path;
use study_haptics::identify::identification::{Identification, Source};
use study_haptics::identify::mechanism::{Filter, Fitted, PARAMETERS};
use study_haptics::identify::vaf::Score;
use study_haptics::identify::validation::Accuracy;
use study_haptics::identify::{Estimate, Method};
use study_wire::certificate::Certificate;

/// The results as a JSON document, format `study-identify/1`.
pub fn document(results: &Identification) -> String {
    let cells: Vec<Value> = results
        .cells
        .iter()
        .map(|cell| {
            let provenance = &cell.realization.provenance;
            let by_file = |of: fn(&Score) -> f64| -> Map<String, Value> {
                (results.recordings.iter().zip(&cell.scores))
                    .map(|(source, score)| (source.recording.name.clone(), of(score).into()))
                    .collect()
            };
            let warnings: Vec<String> = cell.warnings.iter().map(ToString::to_string).collect();
            let [start, sort] = start_and_sort(cell.method);
            let mut document = json!({
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
                "terms": cell.terms.iter().map(term).collect::<Vec<_>>(),
                "mechanism": cell.fitted.as_deref().map(mechanism),
                "elements": cell.realization.elements.as_ref().map(elements::json),
            });
            if results.weights.is_some() {
                document["perceptual_vaf"] = comparison::perceptual(results, &cell.realization);
            }
            document
        })
        .collect();
    let recording = |source: &Source, role: &str| {
        let Source { recording, path } = source;
        let warnings: Vec<String> = recording.warnings.iter().map(ToString::to_string).collect();
        let file = Path::new(path).file_name();
        json!({
            "file": file.map(|name| name.to_string_lossy()),
            "name": recording.name,
            "sha256": recording.sha256,
            "role": role,
            "warnings": warnings,
        })
    };
    let further = (results.training.iter().skip(1)).map(|source| (source, "training"));
    let dynamic = (results.dynamic.iter()).map(|source| (source, "dynamic"));
    let others = results.recordings.iter().enumerate().map(|(i, source)| {
        let validates = i < results.validations;
        (source, if validates { "validate" } else { "test" })
    });
    let recordings: Vec<Value> = (further.chain(dynamic).chain(others))
        .map(|(source, role)| recording(source, role))
        .collect();
    let validation: Map<String, Value> = results
        .recordings
        .iter()
        .zip(results.accuracies.iter().zip(&results.ceilings))
        .filter_map(|(source, (validation, ceiling))| {
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
            Some((source.recording.name.clone(), document))
        })
        .collect();
    let mut document = json!({
        "format": "study-identify/1",
        "tool_version": env!("CARGO_PKG_VERSION"),
        "training": results.training.first().map(|source| recording(source, "training")),
        "recordings": recordings,
        "best": results.best,
        "validation": validation,
        "force_curve": loops::json(results),
        "cells": cells,
    });
    if let Some(comparison) = &results.comparison {
        document["comparison"] = comparison::json(results, comparison);
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

/// What the recordings say of a term; its bound is null if they do not bound it.
fn term(term: &Estimate) -> Value {
    json!({
        "name": term.name,
        "unit": term.unit,
        "value": term.value,
        "standard_error": term.standard_error,
        "upper_bound": term.upper_bound,
        "identified": term.identified,
        "origin": term.origin.as_str(),
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
        "low_pass_decision": fitted.decision.map(|decision| json!({
            "by_header": decision.by_header,
            "left_out_rms_n": decision.rms_n[0],
            "left_out_rms_without_n": decision.rms_n[1],
        })),
    })
}

/// The names of start and sort, for the methods that have them.
pub(super) fn start_and_sort(method: Method) -> [Option<&'static str>; 2] {
    match method {
        Method::Ewls(options) => [Some(options.start.as_str()), Some(options.sort.as_str())],
        _ => [None; 2],
    }
}
