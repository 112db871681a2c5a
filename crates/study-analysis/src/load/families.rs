//! The tables of families: every level is built before the session, and has to be as safe as a realization.

use super::{ANEW, OtherFiles, PERMIT};
use std::collections::BTreeMap;
use study_base::diagnostic::{Fault, Findings};
use study_base::perception::force_jnd_n;
use study_base::text::ModelId;
use study_haptics::family::{self, Family, Passing};
use study_haptics::model::Realization;
use study_haptics::safe_play;
use study_plan::protocol::check::Spans;
use study_plan::protocol::fingerprint::family_file;
use study_plan::protocol::{FamilyRules, Protocol, TrackRules, Vary};
use study_wire::predict::{Motion, force_n};

/// The realizations of all levels and standards. Reports families that do not fit
/// together and, if they are to be `played`, levels that fail their certificate or are not safe to play.
pub(super) fn realizations(
    protocol: &Protocol,
    others: &OtherFiles<'_>,
    spans: &Spans,
    played: bool,
    findings: &mut Findings,
) -> BTreeMap<ModelId, Realization> {
    let mut levels = BTreeMap::new();
    for (i, rules) in protocol.families.iter().enumerate() {
        let path = format!("families[{i}]");
        let place = |key: &str| {
            let span = spans.get(&format!("{path}.{key}"));
            span.or_else(|| spans.get(&path)).cloned()
        };
        let Some(family) = built(rules, others) else {
            continue;
        };
        let family = match family {
            Ok(family) => family,
            Err(why) => {
                findings
                    .faults
                    .push(Fault::error(why.to_string()).at(place("to")));
                continue;
            }
        };
        let standards: Vec<(ModelId, f64)> = (protocol.tracks.iter())
            .filter(|t| t.family() == Some(&rules.id))
            .filter_map(|t: &TrackRules| Some((t.standard(), t.standard_level()?)))
            .collect();
        if played {
            let at = place("range").or_else(|| place("levels"));
            findings.faults.extend(
                refused(protocol, rules, &family, &standards)
                    .or_else(|| doubtful(protocol, rules, &family, &standards))
                    .map(|fault| fault.at(at)),
            );
        }
        for (id, level) in rules.realizations().chain(standards) {
            levels.insert(id, family.at(level));
        }
    }
    levels
}

/// The family; `None` if a file of it could not be read.
fn built(
    rules: &FamilyRules,
    others: &OtherFiles<'_>,
) -> Option<Result<Family, family::FamilyError>> {
    let file = |end| others.realization(&family_file(&rules.id, end)?).cloned();
    let vary = match rules.vary {
        Vary::Blend => family::Vary::Blend(Box::new(file("to")?)),
        Vary::Damping => family::Vary::Damping,
        Vary::Mass => family::Vary::Mass,
        Vary::Detent => family::Vary::Elastic,
        Vary::Friction => family::Vary::Friction,
    };
    Some(Family::new(file("from")?, vary))
}

/// The lowest and the highest level of a family and of the standards in it.
fn ends(rules: &FamilyRules, standards: &[(ModelId, f64)]) -> (f64, f64) {
    let ladder = (rules.ladder.first(), rules.ladder.last());
    let levels = standards.iter().map(|(_, level)| *level);
    levels.fold(ladder, |(low, high), level| {
        (low.min(level), high.max(level))
    })
}

/// The fault of a family whose certificate fails in part, with the range that passes, or of which some levels are not safe to
/// play.
fn refused(
    protocol: &Protocol,
    rules: &FamilyRules,
    family: &Family,
    standards: &[(ModelId, f64)],
) -> Option<Fault> {
    if protocol.device.uncertified.as_ref().is_some_and(|u| u.play) {
        return None;
    }
    let (low, high) = ends(rules, standards);
    let id = &rules.id;
    // The ends decide; a table at margin 0 is certified for itself, too.
    let built = || rules.realizations().map(|(_, level)| level);
    let fails = |level: &f64| !family.at(*level).certificate().passes();
    let Some(failing) = [low, high].into_iter().chain(built()).find(fails) else {
        let of_standards = standards.iter().map(|(_, level)| *level);
        let mut levels: Vec<f64> = built().chain(of_standards).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        return unsafe_levels(rules, family, &levels);
    };
    let label = family.at(failing).certificate().to_string();
    Some(match family.passing(low, high) {
        Passing::Between(from, to) => Fault::error(format!(
            "levels of the family `{id}` can put energy into a hand: of {low} to {high} only {} to {} pass",
            // Rounded inwards, so that they pass.
            (from * 1e6).ceil() / 1e6,
            (to * 1e6).floor() / 1e6,
        ))
        .label(format!("level {failing}: {label}"))
        .hint("take a range that passes"),
        Passing::All | Passing::None => Fault::error(format!(
            "no level of the family `{id}` from {low} to {high} passes its certificate"
        ))
        .label(format!("level {failing}: {label}"))
        .hint(PERMIT),
    })
}

/// The fault of a family of which some of these levels are refused as realizations are.
fn unsafe_levels(rules: &FamilyRules, family: &Family, levels: &[f64]) -> Option<Fault> {
    let danger = |level: &f64| {
        let danger = safe_play::refusal(&family.at(*level), &safe_play::Device::default());
        Some((*level, danger?))
    };
    let dangers: Vec<_> = levels.iter().filter_map(danger).collect();
    let (level, danger) = dangers.first()?;
    let (some, all) = (dangers.len(), levels.len());
    let what = format!(
        "{some} of the {all} levels of the family `{}` are not safe to play",
        rules.id
    );
    let hint = match some < all {
        true => format!("take a range without level {level}"),
        false => ANEW.to_owned(),
    };
    let label = format!("level {level}: {danger}");
    Some(Fault::error(what).label(label).hint(hint))
}

/// The warning of a family that the device clips, or whose levels cannot be told apart.
fn doubtful(
    protocol: &Protocol,
    rules: &FamilyRules,
    family: &Family,
    standards: &[(ModelId, f64)],
) -> Option<Fault> {
    let id = &rules.id;
    let (low, high) = (
        family.at(rules.ladder.first()),
        family.at(rules.ladder.last()),
    );
    let limit = protocol.device.limits.force_n.get();
    // The force is convex in the level: the largest is at an end.
    let (lowest, highest) = ends(rules, standards);
    let strongest_n = [lowest, highest].map(|level| family.at(level).strongest_n());
    let strongest_n = strongest_n[0].max(strongest_n[1]);
    if strongest_n > limit {
        return Some(
            Fault::warning(format!(
                "the family `{id}` needs up to {strongest_n:.1} N up to its trained speed, and the device clips at {limit} N"
            ))
            .hint("take a smaller range, or a higher limit"),
        );
    }
    let fast = high.trained.v_mm_s;
    let difference = |v: f64| {
        let pairs = forces(&high, &low, v)
            .into_iter()
            .zip(forces(&low, &low, v));
        pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
    };
    let span = difference(0.0).max(difference(fast)).max(difference(-fast));
    // A mass is felt in accelerations, of which nothing is known here.
    let noticeable = force_jnd_n(strongest_at_rest_n(&low).max(strongest_at_rest_n(&high)));
    (span < noticeable && rules.vary != Vary::Mass).then(|| {
        Fault::warning(format!(
            "the levels of the family `{id}` differ by at most {span:.2} N, and {noticeable:.2} N is just noticeable"
        ))
        .hint("take a larger range")
    })
}

/// The largest force of a table at rest at its nodes, N.
pub(super) fn strongest_at_rest_n(table: &Realization) -> f64 {
    let forces = forces(table, table, 0.0).into_iter();
    forces.fold(0.0, |most: f64, f| most.max(f.abs()))
}

/// Forces of a table at the nodes of another, in both directions, at a speed.
pub(super) fn forces(table: &Realization, nodes: &Realization, v_mm_s: f64) -> Vec<f64> {
    let [from, to] = nodes.trained.x_mm;
    let inside = nodes.x_mm.iter().filter(|x| (from..=to).contains(*x));
    inside
        .flat_map(|&x_mm| {
            let motion = Motion {
                v_mm_s,
                ..Motion::at_rest(x_mm)
            };
            [1.0, -1.0].map(|z| force_n(&table.table(), z, motion))
        })
        .collect()
}
