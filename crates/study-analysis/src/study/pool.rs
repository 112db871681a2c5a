//! One analysis of several sites, with the site as a factor.

use super::{Analyzed, Options, PoolError, Results, Site, SiteDevice, Source, Study, analyzed};
use super::{Difference, question};
use crate::analyze::{Deviation, Include, Rules, Warning};
use chrono::DateTime;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;
use study_base::text::{QuestionId, Untrusted};
use study_plan::protocol::difference::{self, Change};
use study_plan::protocol::fingerprint::Parts;
use study_plan::protocol::{Protocol, Task};
use study_session::outcome::ratings::{Origin, Ratings};
use study_session::store::{Derived, studies};

/// Differences that a refusal lists.
const MAX_LISTED: usize = 8;

/// The sites of a pooled analysis, as they were read.
#[derive(Debug)]
pub struct Pool {
    /// The paths, as the caller gave them.
    paths: Vec<String>,
    sites: Vec<Read>,
}

/// A site that was read.
#[derive(Debug)]
struct Read {
    name: String,
    study: Study,
}

impl Pool {
    /// Reads the sites, each a results folder with one study or the folder of a study.
    ///
    /// # Errors
    /// [`PoolError`] if one of them cannot be read or is named twice.
    pub fn open(paths: &[impl AsRef<Path>]) -> Result<Self, PoolError> {
        let mut folders = Vec::new();
        for path in paths.iter().map(AsRef::as_ref) {
            if path.is_file() {
                return Err(PoolError::Table(path.to_owned()));
            }
            let mut found = studies(path).map_err(super::StudyError::from)?;
            if found.len() > 1 {
                return Err(PoolError::Several {
                    path: path.to_owned(),
                    count: found.len(),
                    first: found[0].path().to_owned(),
                });
            }
            folders.extend(found.pop());
        }
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let known: Vec<PathBuf> = folders.iter().map(|s| real(s.path())).collect();
        if let Some(i) = (1..known.len()).find(|i| known[..*i].contains(&known[*i])) {
            return Err(PoolError::Twice(known[i].clone()));
        }
        let sites = folders
            .into_iter()
            .zip(names(&known))
            .map(|(folder, name)| {
                let study = Study::read(folder)?;
                Ok(Read { name, study })
            });
        Ok(Self {
            paths: (paths.iter())
                .map(|p| p.as_ref().display().to_string())
                .collect(),
            sites: sites.collect::<Result<_, PoolError>>()?,
        })
    }

    /// The studies of the sites, in the order in which they were named.
    pub fn studies(&self) -> impl Iterator<Item = &Study> {
        self.sites.iter().map(|site| &site.study)
    }

    /// The rows of all sites.
    pub fn derived(&self) -> Derived {
        let mut all = Derived::default();
        for Derived {
            rows,
            attempts,
            participants,
            intervals,
        } in self.studies().map(|study| &study.derived)
        {
            all.rows.extend_from_slice(rows);
            all.attempts.extend_from_slice(attempts);
            all.participants.extend_from_slice(participants);
            all.intervals.extend_from_slice(intervals);
        }
        all
    }

    /// Analyzes the ratings of all sites together, by the rules that they have in common.
    ///
    /// # Errors
    /// [`PoolError`] if the stimuli or the rules of two sites differ, if they have a session
    /// in common, or if real and other participants would be mixed unasked.
    pub fn analyze(&self, options: &Options<'_>) -> Result<Analyzed, PoolError> {
        let sites = &self.sites;
        let [first, others @ ..] = &sites[..] else {
            return Err(PoolError::TooFew);
        };
        if others.is_empty() {
            return Err(PoolError::TooFew);
        }
        for other in others {
            same_study(first, other)?;
        }
        same_sessions(sites)?;
        let protocol = &first.study.loaded.protocol;
        let apart = not_pooled(protocol);
        let is_rating = protocol
            .primary()
            .is_some_and(|q| q.kind.scale().is_number());
        if options.question.is_none() && !is_rating {
            return Err(PoolError::NotPooled {
                parts: apart.join(", "),
                primary: protocol.analysis.primary.clone(),
            });
        }
        let question = question(protocol, options.question)?;
        let tables: Vec<(String, Ratings)> = (sites.iter())
            .map(|s| (s.name.clone(), s.study.ratings(&question)))
            .collect();
        same_kind(&tables, options.include)?;
        let pooled = Ratings::pooled(&tables);
        let planned = (sites.iter()).map(|s| s.study.loaded.protocol.design.participants);
        let rules = Rules {
            planned: Some(planned.sum()),
            deviations: all_deviations(sites)?,
            ..Rules::of(protocol, question.as_str(), options.include)
        };
        let mut analysis = analyzed(&pooled, &rules, options.progress);
        analysis.warnings.splice(0..0, notes(sites));
        if !apart.is_empty() {
            analysis.warnings.push(Warning {
                code: "parts-not-pooled",
                text: format!(
                    "{}: comparisons and thresholds are not pooled; analyze each site",
                    apart.join(", ")
                ),
            });
        }
        Ok(Analyzed {
            source: Source {
                path: self.paths.join(" "),
                sites: sites.iter().map(|s| site(s, &question)).collect(),
                ..first.study.source()
            },
            results: Results::Ratings(Box::new(analysis)),
            damage: Vec::new(),
        })
    }
}

/// The parts that rate no single realizations. Their estimates are made of the answers of one
/// site's participants, and which rows of two sites are alike is not known.
fn not_pooled(protocol: &Protocol) -> Vec<String> {
    (protocol.parts.iter())
        .filter(|part| !matches!(part.task, Task::Rating(_)))
        .map(|part| format!("part {}", part.id))
        .collect()
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
    found.unwrap_or_else(|| {
        let shown = |f: &PathBuf| Untrusted(&f.display().to_string()).to_string();
        folders.iter().map(shown).collect()
    })
}

/// Refuses another stimulus and another analysis.
fn same_study(first: &Read, other: &Read) -> Result<(), PoolError> {
    let [a, b] = [first, other].map(|site| &site.study.loaded.parts);
    let refused = |what, changes: &[Change]| PoolError::Differ {
        first: first.name.clone(),
        other: other.name.clone(),
        what,
        listed: listed(changes),
    };
    let stimulus = difference::changes(&only(a, Part::Stimulus), &only(b, Part::Stimulus));
    if !stimulus.is_empty() {
        return Err(refused(Difference::Stimuli, &stimulus));
    }
    let mut analysis = difference::changes(&only(a, Part::Analysis), &only(b, Part::Analysis));
    // The sites' numbers are added.
    analysis.retain(|change| change.key != "design.participants");
    match analysis.is_empty() {
        true => Ok(()),
        false => Err(refused(Difference::Rules, &analysis)),
    }
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

fn listed(changes: &[Change]) -> String {
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
    format!("{}{more}", listed.join("; "))
}

/// Refuses a session that two folders have.
fn same_sessions(sites: &[Read]) -> Result<(), PoolError> {
    for (i, a) in sites.iter().enumerate() {
        for b in &sites[i + 1..] {
            for session in a.study.sessions.iter().filter(|s| !s.entries.is_empty()) {
                let theirs = &b.study.sessions;
                if let Some(twin) = theirs.iter().find(|s| s.entries == session.entries) {
                    return Err(PoolError::SameSession {
                        participant: twin.participant.clone(),
                        folders: [a, b].map(|site| site.study.folder.path().to_owned()),
                    });
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
fn same_kind(tables: &[(String, Ratings)], include: Include) -> Result<(), PoolError> {
    let kinds: Vec<(&String, Origin)> = (tables.iter())
        .filter_map(|(name, ratings)| Some((name, kind(ratings)?)))
        .collect();
    if let Some((name, _)) = tables.iter().find(|(_, ratings)| ratings.is_empty()) {
        return Err(PoolError::Empty(name.clone()));
    }
    let asked = |kind: Origin| match kind {
        Origin::Real => true,
        Origin::Pilot => include.pilot,
        Origin::Simulated => include.simulated,
    };
    let Some(best) = kinds.iter().min_by_key(|(_, kind)| *kind) else {
        return Ok(());
    };
    if let Some(other) = kinds.iter().find(|(_, k)| *k != best.1 && !asked(*k)) {
        return Err(PoolError::Mixed {
            best: (best.0.clone(), best.1),
            other: (other.0.clone(), other.1),
        });
    }
    if best.1 == Origin::Pilot && !include.pilot {
        return Err(PoolError::OnlyPilots);
    }
    Ok(())
}

/// Changes of the analysis after a site's study began, with the site's name.
fn all_deviations(sites: &[Read]) -> Result<Vec<Deviation>, PoolError> {
    let mut all = Vec::new();
    for site in sites {
        all.extend(site.study.deviations()?.into_iter().map(|d| Deviation {
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
        let ids: BTreeSet<&str> =
            (site.study.sessions.iter().map(|s| s.participant.as_str())).collect();
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
        .filter(|s| s.study.loaded.fingerprints.wording != first.study.loaded.fingerprints.wording)
        .map(|s| s.name.as_str())
        .collect();
    if !different.is_empty() {
        let keys: BTreeSet<String> = (sites[1..].iter())
            .flat_map(|s| {
                let [a, b] = [&first.study.loaded.parts, &s.study.loaded.parts]
                    .map(|p| only(p, Part::Wording));
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
    let rated: BTreeSet<&str> = (read.study.derived.rows.iter())
        .filter(|r| !r.practice && r.answers.contains_key(question))
        .map(|r| r.participant.as_str())
        .collect();
    let mut days = Vec::new();
    let mut devices: Vec<SiteDevice> = Vec::new();
    let mut sessions: Vec<_> = (read.study.sessions.iter())
        .filter_map(|s| Some((s.history.started_at()?.wall, s.history.start()?)))
        .collect();
    sessions.small_sort_by_key(|(at, start)| (*at, start.participant.clone()));
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
        path: read.study.folder.path().display().to_string(),
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
            same_kind(&tables, include).err().map(|e| e.to_string())
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
