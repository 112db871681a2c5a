//! What `study identify` prints of a comparison of methods.

use super::printed::{Printed, align, short_name};
use serde_json::{Value, json};
use std::fmt::Write as _;
use study_haptics::identify::compare::{Candidate, Comparison};
use study_haptics::identify::identification::Identification;
use study_haptics::model::Realization;

/// One table and one sentence.
pub(super) fn table(results: &Identification, comparison: &Comparison) -> String {
    let p = Printed::of(results);
    let (x, f) = (p.x(), p.f());
    let mut heads: Vec<String> = ["", "method"].map(String::from).into();
    heads.extend([format!("dx {x}"), format!("delta {x}")]);
    heads.extend(["VAF left out".into(), format!("residual {f}")]);
    if comparison.by_perceptual {
        heads.push("perceptual".into());
    }
    heads.extend((results.recordings.iter()).map(|source| format!("VAF {}", short_name(source))));
    if results.weights.is_some() {
        let names = results.recordings.iter().map(short_name);
        heads.extend(names.map(|name| format!("perceptual {name}")));
    }
    heads.push("passive".into());
    let mut rows = vec![heads];
    for (i, candidate) in comparison.candidates.iter().enumerate() {
        let realization = &candidate.cell.realization;
        let length = |mm: Option<f64>| mm.map_or("-".into(), |mm| format!("{:.3}", p.length(mm)));
        let mark = match comparison.recommended == Some(i) {
            true => "*",
            false => "",
        };
        let mut row = vec![mark.to_owned(), candidate.cell.method.as_str().to_owned()];
        row.push(length(realization.provenance.dx_mm));
        row.push(length(realization.direction.delta_mm()));
        let decimals = p.decimals();
        row.extend(match &candidate.left_out {
            Some(l) => [
                format!("{:.4}", l.vaf),
                format!("{:.decimals$}", p.force(l.rms_n)),
            ],
            None => ["-", "-"].map(String::from),
        });
        let shown = |vaf: Option<f64>| vaf.map_or("-".to_owned(), |vaf| format!("{vaf:.4}"));
        if comparison.by_perceptual {
            row.push(shown(candidate.left_out.and_then(|l| l.perceptual)));
        }
        row.extend((candidate.cell.scores.iter()).map(|score| format!("{:.4}", score.vaf)));
        row.extend(results.perceptual_vaf(realization).into_iter().map(shown));
        let passes = candidate.cell.certificate.passes();
        row.push(if passes { "PASS" } else { "FAIL" }.to_owned());
        rows.push(row);
    }
    let left_out = match comparison.whole_strokes {
        true => "strokes",
        false => "tenths of the travel in one direction",
    };
    let perceptual = match (comparison.by_perceptual, &results.weights) {
        (true, _) => "; perceptual: the VAF of weighted components there",
        (false, Some(_)) => {
            "; perceptual VAF is not defined there, so that methods are compared by their residual"
        }
        (false, None) => "",
    };
    let mut out = format!(
        "VAF left out: on {left_out} that were left out of the training, a fifth at a time{perceptual}\n{}",
        align(&rows)
    );
    for candidate in &comparison.candidates {
        if let Some(failure) = candidate.failure() {
            let _ = writeln!(out, "{} failed: {failure}", candidate.cell.method.as_str());
        }
    }
    for candidate in &comparison.candidates {
        if candidate.failure().is_none()
            && let Some((best, ratio)) = comparison.beaten(candidate)
        {
            let [name, best] = [candidate, best].map(|c| c.cell.method.as_str());
            let _ = writeln!(
                out,
                "{name}: its residual is {ratio:.1} times that of {best}"
            );
        }
    }
    for (name, why) in &comparison.not_tried {
        let _ = writeln!(out, "{name} not tried: {why}");
    }
    let _ = writeln!(out, "\n{}", sentence(p, comparison));
    out
}

/// The recommendation with its reason.
fn sentence(p: Printed, comparison: &Comparison) -> String {
    let decimals = p.decimals();
    let name = |i: usize| comparison.candidates[i].cell.method.as_str();
    let rms_n = |i: usize| comparison.candidates[i].left_out.map_or(0.0, |l| l.rms_n);
    let Some(best) = comparison.recommended else {
        return "no method is recommended: all fail".into();
    };
    if comparison.by_perceptual {
        return by_perceptual(comparison, best);
    }
    let shown = |n: f64| format!("{:.decimals$} {}", p.force(n), p.f());
    let noise = match comparison.noise_n {
        Some(noise_n) => format!(" (noise of the force: {})", shown(noise_n)),
        None => String::new(),
    };
    let against = match comparison.second {
        None => "and every other one fails".to_owned(),
        Some(next) => {
            let (next, ratio) = (name(next), rms_n(next) / rms_n(best));
            match ratio {
                1.005.. => {
                    format!("and that of {next}, the next best, is {ratio:.2} times as large")
                }
                1.0.. => format!("as small as that of {next}, the next best"),
                _ => format!("hardly more than that of {next}, and it is preferred to {next}"),
            }
        }
    };
    format!(
        "recommended: {}, because its residual on data left out is {}{noise}, {against}",
        name(best),
        shown(rms_n(best)),
    )
}

/// The same of candidates that were compared by their perceptual VAF.
fn by_perceptual(comparison: &Comparison, best: usize) -> String {
    let candidate = |i: usize| &comparison.candidates[i];
    let name = |i: usize| candidate(i).cell.method.as_str();
    let left_out = |i: usize| candidate(i).left_out;
    let vaf = |i: usize| left_out(i).and_then(|l| l.perceptual).unwrap_or(0.0);
    let against = match comparison.second {
        None => "and every other one fails".to_owned(),
        Some(next) if vaf(next) <= vaf(best) => {
            format!(
                "and that of {}, the next best, is {:.4}",
                name(next),
                vaf(next)
            )
        }
        Some(next) => format!(
            "hardly less than that of {next}, and it is preferred to {next}",
            next = name(next)
        ),
    };
    format!(
        "recommended: {}, because its perceptual VAF on data left out is {:.4}, {against}",
        name(best),
        vaf(best),
    )
}

/// The perceptual VAF of a realization by recording.
pub(super) fn perceptual(results: &Identification, realization: &Realization) -> Value {
    let each = results.perceptual_vaf(realization);
    let by_name = (results.recordings.iter().zip(each))
        .map(|(source, vaf)| (source.recording.name.clone(), json!(vaf)));
    Value::Object(by_name.collect())
}

pub(super) fn json(results: &Identification, comparison: &Comparison) -> Value {
    let candidate = |candidate: &Candidate| {
        let mut document = json!({
            "method": candidate.cell.method.as_str(),
            "vaf_left_out": candidate.left_out.map(|l| l.vaf),
            "residual_left_out_n": candidate.left_out.map(|l| l.rms_n),
            "dx_mm": candidate.cell.realization.provenance.dx_mm,
            "vaf": candidate.cell.realization.vaf,
            "certificate_pass": candidate.cell.certificate.passes(),
            "failed": candidate.failure().map(|failure| failure.to_string()),
        });
        if results.weights.is_some() {
            let left_out = candidate.left_out.and_then(|l| l.perceptual);
            document["perceptual_vaf_left_out"] = json!(left_out);
            let realization = &candidate.cell.realization;
            document["perceptual_vaf"] = perceptual(results, realization);
        }
        document
    };
    let candidates: Vec<Value> = comparison.candidates.iter().map(candidate).collect();
    let mut document = json!({
        "candidates": candidates,
        "recommended": comparison.recommended,
        "mechanism_not_tried": null,
        "noise_n": comparison.noise_n,
        "whole_strokes": comparison.whole_strokes,
    });
    for (name, why) in &comparison.not_tried {
        document[format!("{name}_not_tried")] = json!(why);
    }
    document
}
