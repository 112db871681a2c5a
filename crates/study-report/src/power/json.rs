//! The document of `study power --json`, `study-power/1`.

use super::{Report, part};
use serde_json::{Value, json};
use study_analysis::power::{Cell, Link, Reach, Scale, floor};
use study_stats::power::detectable_correlation;

/// The document. Equal results give equal bytes, whatever the threads and shards.
pub fn document(report: &Report) -> Value {
    let (plan, settings) = (&report.plan, &report.plan.settings);
    let of_part = plan.settings.part.is_some();
    let own = floor(&settings.vaf(plan.own.realizations), settings.alpha).filter(|_| !of_part);
    let smallest = match of_part {
        true => part::smallest_values(report),
        false => smallest(report),
    };
    let mut document = json!({
        "format": "study-power/1",
        "study": report.study,
        "title": report.title,
        "version": env!("CARGO_PKG_VERSION"),
        "summary": report.ceiling_sentence(),
        "assumptions": assumptions(report),
        "cells": report.results.iter().map(|r| cell(report, &r.cell)).collect::<Vec<_>>(),
        "smallest": smallest,
        "sensitivity": sensitivity(report),
        "permutation_floor": own.map(|f| json!({
            "smallest_p": f.smallest_p, "can_reject": f.can_reject,
        })),
        "warnings": report.warnings(),
        "paragraph": super::paragraph(report),
    });
    if let Some(part) = &plan.part {
        document["part"] = json!(part.as_str());
    }
    if let Some(ratios) = super::precision::has_ratios(report).filter(|_| !report.wanted.is_empty())
    {
        let candidates = super::precision::candidates(report);
        let values = super::precision::wanted_values(&report.wanted, ratios, &candidates);
        document["wanted"] = json!(values);
    }
    if report.missing_units > 0 {
        document["partial"] = json!({ "missing_units": report.missing_units });
    }
    document
}

/// What is known of the study's own design, for its preregistration.
pub fn own_design(report: &Report) -> Value {
    json!({
        "assumptions": assumptions(report),
        "design": cell(report, &report.plan.own),
        "sensitivity": sensitivity(report),
        "warnings": report.warnings(),
    })
}

fn assumptions(report: &Report) -> Value {
    if report.plan.settings.part.is_some() {
        return part::assumptions(report);
    }
    let (plan, settings) = (&report.plan, &report.plan.settings);
    let a = &settings.assumptions;
    let scale = match &a.scale {
        Scale::Continuous => json!("continuous"),
        Scale::Rounded(from, to) => json!({ "rounded": [from, to] }),
        Scale::Ordinal {
            link, thresholds, ..
        } => json!({ "link": link.as_str(), "thresholds": thresholds }),
    };
    let logit = matches!(
        a.scale,
        Scale::Ordinal {
            link: Link::Logit,
            ..
        }
    );
    let expected = report.closed(&plan.own);
    json!({
        "slope": a.slope,
        "rho_true": expected.and_then(|e| e.rho_true),
        "smallest": a.smallest,
        "mean": a.mean,
        "sd": {
            "participant": a.spread.subject,
            "realization": a.spread.realization,
            "interaction": a.spread.interaction,
            "residual": (!logit).then_some(a.spread.residual),
            "slope": a.spread.slope,
        },
        "scale": scale,
        "vaf": a.vaf.as_str(),
        "reference": a.reference,
        "listed_vaf": settings.listed,
        "dropout": a.dropout,
        "missing": a.missing,
        "alpha": settings.alpha,
        "tests": settings.tests.iter().map(|t| t.as_str()).collect::<Vec<_>>(),
        "targets": plan.targets,
        "studies": settings.studies,
        "within": plan.within,
        "max_session_min": plan.max_session_min,
        "equivalence_margin": settings.margin,
        "seed": settings.seed,
        "defaults": plan.defaults,
        "pilot": settings.pilot.as_ref().map(|p| json!({
            "participants": p.participants,
            "realizations": p.realizations,
            "ratings": p.ratings,
            "scatter_df": p.scatter_df(),
        })),
    })
}

fn cell(report: &Report, of: &Cell) -> Value {
    let settings = &report.plan.settings;
    let mut tests = serde_json::Map::new();
    let result = report.result(of);
    for (at, test) in result.iter().flat_map(|r| &r.tests).enumerate() {
        let value = json!({
            "rejected": test.rejected,
            "studies": test.studies,
            "power": test.power,
            "low": test.interval.0,
            "high": test.interval.1,
            "mcse": test.mcse,
            "type_s": test.type_s,
            "type_m": test.type_m,
            "undefined": test.undefined,
            "power_if_defined": test.power_if_defined(),
        });
        tests.insert(settings.test_name(at), value);
    }
    let smallest = settings.assumptions.smallest.and_then(|slope| {
        let design = study_analysis::power::design(settings, of);
        let design = study_stats::power::covariate::Design { slope, ..design };
        let e = design.expected(settings.alpha)?;
        Some(json!({ "slope": slope, "power": e.power, "type_s": e.type_s, "type_m": e.type_m }))
    });
    json!({
        "participants": of.participants,
        "realizations": of.realizations,
        "repetitions": of.repetitions,
        "session_min": report.plan.pace.minutes(of.realizations, of.repetitions),
        "tests": tests,
        "closed": report.closed(of).map(|e| json!({
            "ncp": e.ncp, "df": e.df, "power": e.power, "ceiling": e.ceiling, "size": e.size,
            "rho_observed": e.rho_observed, "reliability": e.reliability,
            "half_width": e.half_width, "type_s": e.type_s, "type_m": e.type_m,
        })),
        "at_smallest": smallest,
        "pilot_range": report.pilot_range(of).map(|(low, high)| [low, high]),
        "half_width": result.and_then(|r| r.half_width),
        "precision": result.and_then(|r| r.precision.as_ref()).map(super::precision::value),
        "boundary_share": result.map(|r| r.boundary_share),
    })
}

fn smallest(report: &Report) -> Vec<Value> {
    let all = report.smallest();
    let one = |s: &study_analysis::power::Smallest| {
        let (participants, power, sure, ceiling) = match s.reach {
            Reach::Participants {
                participants,
                power,
                sure,
            } => (Some(participants), Some(power), Some(sure), None),
            Reach::Ceiling(ceiling) => (None, None, None, Some(ceiling)),
            Reach::MoreThan { .. } | Reach::Limit(_) | Reach::NoSmallP(_) => {
                (None, None, None, None)
            }
        };
        json!({
            "target": s.target,
            "realizations": s.realizations,
            "repetitions": s.repetitions,
            "participants": participants,
            "power": power,
            "sure": sure,
            "ceiling": ceiling,
            "ratings": participants.map(|n| n * s.realizations * s.repetitions),
            "text": super::reached(&s.reach),
        })
    };
    all.iter().map(one).collect()
}

fn sensitivity(report: &Report) -> Vec<Value> {
    let (plan, settings) = (&report.plan, &report.plan.settings);
    if plan.settings.part.is_some() {
        return Vec::new();
    }
    let design = study_analysis::power::design(settings, &plan.own);
    let one = |target: &f64| {
        json!({
            "target": target,
            "slope": design.detectable_slope(*target, settings.alpha),
            "rho_observed": detectable_correlation(plan.own.realizations, *target, settings.alpha),
        })
    };
    plan.targets.iter().map(one).collect()
}
