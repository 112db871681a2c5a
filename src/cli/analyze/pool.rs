//! `study analyze --pool`: one analysis of several sites.

use super::super::load::Loaded;
use super::super::{Console, Failure, study_folder};
use super::{Analysed, Args, deviations, include, progress, question, ratings, report, source_of};
use crate::report::{Site, SiteDevice, Source};
use chrono::DateTime;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use study_base::text::{QuestionId, Untrusted};
use study_core::analyze::{Deviation, Include, Rules, Warning};
use study_core::outcome::ratings::{Origin, Ratings};
use study_core::protocol::difference::{self, Change};
use study_core::protocol::fingerprint::Parts;
use study_core::protocol::{Protocol, Task};
use study_core::store::{Derived, SessionData, StudyFolder};

/// Differences that a refusal lists.
const MAX_LISTED: usize = 8;

/// A site that was read.
struct Read {
    name: String,
    study: StudyFolder,
    sessions: Vec<SessionData>,
    loaded: Loaded,
    derived: Derived,
}

/// The sites' pooled analysis.
pub(super) fn analysed(
    paths: &[PathBuf],
    args: &Args,
    console: &mut Console,
) -> Result<Analysed, Failure> {
    let sites = read(paths, console)?;
    let [first, others @ ..] = &sites[..] else {
        return Err(Failure::usage("--pool takes two sites or more"));
    };
    if others.is_empty() {
        return Err(Failure::usage("--pool takes two sites or more")
            .hint("study analyze --pool SITE-A SITE-B"));
    }
    for other in others {
        same_study(first, other)?;
    }
    same_sessions(&sites)?;
    let protocol = &first.loaded.protocol;
    let apart = not_pooled(protocol);
    let is_rating = protocol.primary().is_some_and(|q| q.kind.is_number());
    if args.question.is_none() && !is_rating {
        return Err(Failure::input(format!(
            "{}: comparisons and thresholds are not pooled, and the primary question `{}` is theirs",
            apart.join(", "),
            protocol.analysis.primary
        ))
        .hint("analyze each site; `--question` names a rating of the study, if it has one"));
    }
    let question = question(protocol, args.question.as_deref())?;
    let tables: Vec<(String, Ratings)> = (sites.iter())
        .map(|s| (s.name.clone(), ratings(&s.loaded, &s.derived, &question)))
        .collect();
    same_kind(&tables, include(args))?;
    let pooled = Ratings::pooled(&tables);
    let planned = sites.iter().map(|s| s.loaded.protocol.design.participants);
    let rules = Rules {
        planned: Some(planned.sum()),
        deviations: all_deviations(&sites)?,
        ..Rules::of(protocol, question.as_str(), include(args))
    };
    let mut analysis = progress::analyze(&pooled, &rules);
    analysis.warnings.splice(0..0, notes(&sites));
    if !apart.is_empty() {
        analysis.warnings.push(Warning {
            code: "parts-not-pooled",
            text: format!(
                "{}: comparisons and thresholds are not pooled; analyze each site",
                apart.join(", ")
            ),
        });
    }
    let shown: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
    let mut derived = Derived::default();
    for site in &sites {
        derived.rows.extend_from_slice(&site.derived.rows);
        derived.attempts.extend_from_slice(&site.derived.attempts);
        derived.intervals.extend_from_slice(&site.derived.intervals);
        derived
            .participants
            .extend_from_slice(&site.derived.participants);
    }
    let details = report::details(protocol, &first.study, &derived, question.as_str());
    Ok(Analysed {
        source: Source {
            path: shown.join(" "),
            sites: sites.iter().map(|s| site(s, &question)).collect(),
            ..source_of(&first.study, protocol)
        },
        details,
        // Whose playbacks would be shown? The reports of the sites have theirs.
        traces: Vec::new(),
        analysis,
    })
}

/// The parts that rate no single realizations. Their estimates are made of the answers of one
/// site's participants, and which rows of two sites are alike is not known.
fn not_pooled(protocol: &Protocol) -> Vec<String> {
    (protocol.parts.iter())
        .filter(|part| !matches!(part.task, Task::Rating(_)))
        .map(|part| format!("part {}", part.id))
        .collect()
}

fn read(paths: &[PathBuf], console: &mut Console) -> Result<Vec<Read>, Failure> {
    let mut sites = Vec::new();
    for path in paths {
        if path.is_file() {
            return Err(Failure::input(format!(
                "{}: --pool compares the fingerprints of studies, and a table has none",
                shown(path)
            ))
            .hint("name the results folder of each site"));
        }
        let mut found = study_folder::studies(path)?;
        if found.len() > 1 {
            return Err(Failure::input(format!(
                "{}: {} studies, but a site has one",
                shown(path),
                found.len()
            ))
            .hint(format!("name one, such as {}", shown(found[0].path()))));
        }
        sites.extend(found.pop());
    }
    let folders: Vec<PathBuf> = sites.iter().map(|s| real(s.path())).collect();
    for (i, folder) in folders.iter().enumerate() {
        if folders[..i].contains(folder) {
            return Err(Failure::input(format!(
                "{}: this site is named twice",
                shown(folder)
            )));
        }
    }
    let names = names(&folders);
    (sites.into_iter().zip(names))
        .map(|(study, name)| {
            let sessions = study.sessions()?;
            let loaded = study_folder::frozen(&study)?;
            let warnings = study_folder::warnings(&study, &sessions, Some(&loaded))?;
            study_folder::warn(&study, &warnings, console);
            study_folder::whole(&study, &sessions)?;
            let derived = Derived::of(&sessions, &loaded.protocol);
            Ok(Read {
                name,
                study,
                sessions,
                loaded,
                derived,
            })
        })
        .collect()
}

fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn shown(path: &Path) -> String {
    Untrusted(&path.display().to_string()).to_string()
}

/// The name of each site: the last part of its path that differs from all others'.
fn names(folders: &[PathBuf]) -> Vec<String> {
    let parts: Vec<Vec<String>> = (folders.iter())
        .map(|path| {
            let parts = path.iter().map(|p| p.to_string_lossy().into_owned());
            parts.rev().collect()
        })
        .collect();
    let longest = parts.iter().map(Vec::len).max().unwrap_or(0);
    let at = |level: usize| -> Vec<String> {
        let part = |own: &Vec<String>| own.get(level).cloned().unwrap_or_default();
        parts.iter().map(part).collect()
    };
    let differ = |names: &Vec<String>| {
        let all: BTreeSet<&String> = names.iter().collect();
        all.len() == names.len() && !names.contains(&String::new())
    };
    let found = (0..longest).map(at).find(differ);
    found.unwrap_or_else(|| folders.iter().map(|f| shown(f)).collect())
}

/// Refuses another stimulus and another analysis.
fn same_study(first: &Read, other: &Read) -> Result<(), Failure> {
    let (a, b) = (&first.loaded.parts, &other.loaded.parts);
    let stimulus = difference::changes(&only(a, Part::Stimulus), &only(b, Part::Stimulus));
    if !stimulus.is_empty() {
        return Err(refused(first, other, "stimuli", &stimulus).hint(
            "only sites with the same stimulus fingerprint can be pooled; analyze them apart",
        ));
    }
    let mut analysis = difference::changes(&only(a, Part::Analysis), &only(b, Part::Analysis));
    // The sites' numbers are added.
    analysis.retain(|change| change.key != "design.participants");
    if !analysis.is_empty() {
        return Err(refused(first, other, "analysis rules", &analysis)
            .hint("amend one of them, so that one set of rules holds for both sites"));
    }
    Ok(())
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    Stimulus,
    Wording,
    Analysis,
}

/// One of the three parts that make the fingerprints.
fn only(parts: &Parts, part: Part) -> Parts {
    let keep = |value: &serde_json::Value, this: Part| match part == this {
        true => value.clone(),
        false => serde_json::Value::Null,
    };
    Parts {
        stimulus: keep(&parts.stimulus, Part::Stimulus),
        wording: keep(&parts.wording, Part::Wording),
        analysis: keep(&parts.analysis, Part::Analysis),
    }
}

fn refused(first: &Read, other: &Read, what: &str, changes: &[Change]) -> Failure {
    let none = || "none".to_owned();
    let one = |change: &Change| match (&change.old, &change.new) {
        (Some(old), Some(new)) if old == new => format!("{} ({new} differs)", change.key),
        (old, new) => format!(
            "{} ({} and {})",
            change.key,
            old.clone().unwrap_or_else(none),
            new.clone().unwrap_or_else(none)
        ),
    };
    let listed: Vec<String> = changes.iter().take(MAX_LISTED).map(one).collect();
    let more = match changes.len().saturating_sub(MAX_LISTED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    Failure::input(Untrusted(&format!(
        "{} and {} differ in their {what}: {}{more}",
        first.name,
        other.name,
        listed.join("; ")
    )))
}

/// Refuses a session that two folders have.
fn same_sessions(sites: &[Read]) -> Result<(), Failure> {
    for (i, a) in sites.iter().enumerate() {
        for b in &sites[i + 1..] {
            for session in a.sessions.iter().filter(|s| !s.entries.is_empty()) {
                if let Some(twin) = (b.sessions.iter()).find(|s| s.entries == session.entries) {
                    return Err(Failure::input(format!(
                        "the session of {} is in {} and in {}",
                        twin.participant,
                        shown(a.study.path()),
                        shown(b.study.path())
                    ))
                    .hint("a site is counted once; was a folder copied?"));
                }
            }
        }
    }
    Ok(())
}

/// Whose rows a site would count alone.
fn kind(ratings: &Ratings) -> Option<Origin> {
    ratings.origin.iter().copied().min()
}

/// Sites of real participants, pilots and simulated participants are mixed only on request.
fn same_kind(tables: &[(String, Ratings)], include: Include) -> Result<(), Failure> {
    let kinds: Vec<(&str, Origin)> = (tables.iter())
        .filter_map(|(name, ratings)| Some((name.as_str(), kind(ratings)?)))
        .collect();
    if let Some((name, _)) = tables.iter().find(|(_, ratings)| ratings.is_empty()) {
        return Err(Failure::input(format!(
            "{}: no ratings yet",
            Untrusted(name)
        )));
    }
    let asked = |kind: Origin| match kind {
        Origin::Real => true,
        Origin::Pilot => include.pilot,
        Origin::Simulated => include.simulated,
    };
    let word = |kind: Origin| match kind {
        Origin::Real => "real participants",
        Origin::Pilot => "only pilots",
        Origin::Simulated => "only simulated participants",
    };
    let flag = |kind: Origin| match kind {
        Origin::Simulated => "simulated",
        _ => "pilot",
    };
    let Some(best) = kinds.iter().min_by_key(|(_, kind)| *kind) else {
        return Ok(());
    };
    if let Some(other) = kinds.iter().find(|(_, k)| *k != best.1 && !asked(*k)) {
        return Err(Failure::input(Untrusted(&format!(
            "{} has {}, {} {}: they are not mixed unasked",
            best.0,
            word(best.1),
            other.0,
            word(other.1)
        )))
        .hint(format!(
            "--include {} mixes them, under a banner",
            flag(other.1)
        )));
    }
    if best.1 == Origin::Pilot && !include.pilot {
        return Err(Failure::input("the sites hold only pilots so far")
            .hint("--include pilot analyzes them"));
    }
    Ok(())
}

/// Changes of the analysis after a site's study began, with the site's name.
fn all_deviations(sites: &[Read]) -> Result<Vec<Deviation>, Failure> {
    let mut all = Vec::new();
    for site in sites {
        let own = deviations(&site.study)?;
        all.extend(own.into_iter().map(|d| Deviation {
            text: format!("{}: {}", site.name, d.text),
            ..d
        }));
    }
    Ok(all)
}

/// What a reader of the pooled analysis has to know.
fn notes(sites: &[Read]) -> Vec<Warning> {
    let mut found = Vec::new();
    let mut note = |code, text: String| found.push(Warning { code, text });
    let mut at: BTreeMap<&str, usize> = BTreeMap::new();
    for site in sites {
        let ids: BTreeSet<&str> = (site.sessions.iter().map(|s| s.participant.as_str())).collect();
        for id in ids {
            *at.entry(id).or_default() += 1;
        }
    }
    let shared: Vec<&str> = (at.iter())
        .filter(|(_, n)| **n > 1)
        .map(|(id, _)| *id)
        .collect();
    if !shared.is_empty() {
        note(
            "same-ids",
            format!(
                "{} at several sites ({}) count as different persons",
                match shared.len() {
                    1 => "an id that occurs".to_owned(),
                    n => format!("{n} ids that occur"),
                },
                few(&shared)
            ),
        );
    }
    let first = &sites[0];
    let different: Vec<&str> = (sites[1..].iter())
        .filter(|s| s.loaded.fingerprints.wording != first.loaded.fingerprints.wording)
        .map(|s| s.name.as_str())
        .collect();
    if !different.is_empty() {
        let keys: BTreeSet<String> = (sites[1..].iter())
            .flat_map(|s| {
                let [a, b] = [&first.loaded.parts, &s.loaded.parts].map(|p| only(p, Part::Wording));
                difference::changes(&a, &b).into_iter().map(|c| c.key)
            })
            .collect();
        let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
        note(
            "wording",
            format!(
                "participants of {} read another wording than those of {}: {}",
                different.join(", "),
                first.name,
                few(&keys)
            ),
        );
    }
    found
}

fn few(all: &[&str]) -> String {
    let listed: Vec<&str> = all.iter().copied().take(MAX_LISTED).collect();
    let more = if all.len() > MAX_LISTED { ", …" } else { "" };
    format!("{}{more}", listed.join(", "))
}

/// A site with the devices of its sessions, as the journals have them.
fn site(read: &Read, question: &QuestionId) -> Site {
    let rated: BTreeSet<&str> = (read.derived.rows.iter())
        .filter(|r| !r.practice && r.answers.contains_key(question))
        .map(|r| r.participant.as_str())
        .collect();
    let mut days = Vec::new();
    let mut devices: Vec<SiteDevice> = Vec::new();
    let mut sessions: Vec<_> = (read.sessions.iter())
        .filter_map(|s| Some((s.history.started_at()?.wall, s.history.start()?)))
        .collect();
    sessions.sort_by_key(|(at, start)| (*at, start.participant.clone()));
    for (at, start) in sessions {
        days.push(at.format("%Y-%m-%d").to_string());
        let kind = start.device_kind.as_str();
        let known = (devices.iter()).position(|d| d.kind == kind && d.id == start.device_id);
        let known = known.unwrap_or_else(|| {
            devices.push(SiteDevice {
                kind: kind.to_owned(),
                id: start.device_id.clone(),
                sessions: 0,
                check: None,
            });
            devices.len() - 1
        });
        devices[known].sessions += 1;
        devices[known].check = start.device_check.as_ref().map(|check| {
            // The record begins with its time.
            let tested = check
                .split(": ")
                .next()
                .and_then(|t| DateTime::parse_from_rfc3339(t).ok());
            (check.clone(), tested.map(|t| (at - t).num_days()))
        });
    }
    let ends = days.first().cloned().zip(days.last().cloned());
    Site {
        name: read.name.clone(),
        path: read.study.path().display().to_string(),
        participants: rated.len(),
        days: ends,
        devices,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(origins: &[Origin]) -> Ratings {
        let csv = "subject,model,rating\nP1,a,1\nP2,a,2\n";
        let mut ratings = Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap();
        ratings.origin = origins.to_vec();
        ratings
    }

    #[test]
    fn real_and_other_sites_are_mixed_only_on_request() {
        use Origin::{Pilot, Real, Simulated};
        let said = |a: [Origin; 2], b: [Origin; 2], include: Include| {
            let tables = [("a".to_owned(), of(&a)), ("b".to_owned(), of(&b))];
            same_kind(&tables, include).err().map(|f| f.message)
        };
        let none = Include::default();
        assert_eq!(said([Real, Pilot], [Real, Real], none), None);
        assert_eq!(said([Simulated; 2], [Simulated; 2], none), None);
        let refused = said([Real; 2], [Simulated; 2], none).unwrap();
        assert!(
            refused.contains("b only simulated participants"),
            "{refused}"
        );
        let refused = said([Pilot; 2], [Real, Pilot], none).unwrap();
        assert!(refused.contains("a only pilots"), "{refused}");
        assert!(said([Pilot; 2], [Simulated; 2], none).is_some());
        assert!(said([Pilot; 2], [Pilot; 2], none).is_some());
        let pilot = Include {
            pilot: true,
            simulated: false,
        };
        assert_eq!(said([Pilot; 2], [Pilot; 2], pilot), None);
        assert_eq!(said([Pilot; 2], [Real; 2], pilot), None);
        assert!(said([Simulated; 2], [Real; 2], pilot).is_some());
    }

    #[test]
    fn a_site_is_named_by_the_part_of_its_path_that_differs() {
        let of = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(of(&["/d/utah", "/d/bern"]), ["utah", "bern"]);
        assert_eq!(of(&["/d/utah/switch", "/d/bern/switch"]), ["utah", "bern"]);
        assert_eq!(of(&["/a/x/switch", "/a/x/2"]), ["switch", "2"]);
        let unequal = of(&["/a/b", "/a/b/b"]);
        assert_eq!(unequal, ["a", "b"]);
    }
}
