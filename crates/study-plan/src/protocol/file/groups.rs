//! `[groups]` and `[[sessions]]`.

use super::agree::at;
use crate::protocol::groups::{Assign, GroupRules, Groups, SessionPlan};
use crate::protocol::keys::{Id, Key, Kind, Words as _, keys};
use crate::protocol::section::Section;
use crate::protocol::{FamilyRules, Identification, Magnitude, Mushra, Part, Task};
use study_base::diagnostic::table::Document;
use study_base::diagnostic::{Fault, did_you_mean};
use study_base::text::{ModelId, PartId};

pub(super) const GROUPS: &[Key] = keys! {
    /// How a participant gets a group.
    "assign": Kind::Word(Assign::WORDS), r#""given""#, default(r#""row""#);
    /// The groups; at least two.
    "list": Kind::Tables(LIST), "", required;
};

const LIST: &[Key] = keys! {
    /// The name of the group.
    "id": Kind::Id(Id::Part), r#""novices""#, required;
    /// How many participants of it are in each block of rows.
    "share": Kind::Whole(1, 100), "2", default("1");
    /// The `[[parts]]` that the group has.
    "parts": Kind::Ids(Id::Part), r#"["realism"]"#, derived("all");
    /// The realizations that the group rates and compares, by id.
    "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995"]"#, derived("all");
};

pub(super) const SESSIONS: &[Key] = keys! {
    /// The name of the session.
    "id": Kind::Id(Id::Part), r#""day-2""#, required;
    /// The `[[parts]]` of the session.
    "parts": Kind::Ids(Id::Part), r#"["damping"]"#, derived("all");
    /// The least time since the end of the session before. Whoever comes earlier is asked to come back.
    "min_gap_h": Kind::not_negative("h"), "20", default("0");
    /// The largest time since the end of the session before. A longer one is recorded and reported.
    "max_gap_h": Kind::positive("h"), "72";
};

pub(super) fn groups(mut section: Section<'_, '_>) -> Option<Groups> {
    let assign = section.word("assign");
    let list: Vec<Option<GroupRules>> = section.sections("list").into_iter().map(group).collect();
    if list.len() == 1 {
        let fault = Fault::error("a study with groups has at least two");
        section.fault_at("list", fault);
    }
    Some(Groups {
        assign: assign?,
        list: list.into_iter().collect::<Option<_>>()?,
    })
}

fn group(mut section: Section<'_, '_>) -> Option<GroupRules> {
    let (id, share) = (section.part_id("id"), section.whole("share"));
    let (parts, models) = (section.ids("parts"), section.ids("models"));
    Some(GroupRules {
        id: id?,
        share: share?,
        parts,
        models,
    })
}

pub(super) fn session(mut section: Section<'_, '_>) -> Option<SessionPlan> {
    let (id, parts) = (section.part_id("id"), section.ids("parts"));
    let (min_gap_h, max_gap_h) = (section.number("min_gap_h"), section.number("max_gap_h"));
    if let (Some(min), Some(max)) = (min_gap_h, max_gap_h)
        && min > max
    {
        let what = format!(
            "`{}.min_gap_h` is above `max_gap_h`: {min} > {max}",
            section.path()
        );
        section.fault_at("min_gap_h", Fault::error(what));
    }
    Some(SessionPlan {
        id: id?,
        parts,
        min_gap_h: min_gap_h?,
        max_gap_h,
    })
}

/// Checks that ids are there once, and name parts and realizations that exist and that leave
/// every group something to do in every session.
pub(super) fn agree(
    groups: Option<&Groups>,
    sessions: &[SessionPlan],
    (parts, families): (&[Part], &[FamilyRules]),
    document: &Document<'_>,
) {
    let fault = |place: &str, key: &str, fault: Fault| {
        document.fault(fault.at(at(document, place, key)));
    };
    let is_level = |model: &ModelId| families.iter().any(|f| f.level_of(model).is_some());
    let group_list = groups.map_or(&[][..], |g| &g.list);
    if parts.is_empty() {
        for (section, used) in [
            ("groups", groups.is_some()),
            ("sessions", !sessions.is_empty()),
        ] {
            if used {
                let place = if section == "groups" {
                    section.to_owned()
                } else {
                    "sessions[0]".to_owned()
                };
                let hint = "give the study [[parts]], such as one of kind \"rating\"";
                let what = format!("`{section}` needs [[parts]]");
                fault(&place, "id", Fault::error(what).hint(hint));
            }
        }
        return;
    }
    let of_groups = (group_list.iter().enumerate())
        .map(|(i, g)| (format!("groups.list[{i}]"), &g.id, g.parts.as_ref()));
    let of_sessions = (sessions.iter().enumerate())
        .map(|(i, s)| (format!("sessions[{i}]"), &s.id, s.parts.as_ref()));
    for list in [of_groups.collect::<Vec<_>>(), of_sessions.collect()] {
        for (i, (place, id, named)) in list.iter().enumerate() {
            if list[..i]
                .iter()
                .any(|(_, other, _)| other.collides_with(id))
            {
                fault(place, "id", Fault::error(format!("`{id}` is there twice")));
            }
            for part in named.iter().flat_map(|named| named.iter()) {
                if !parts.iter().any(|p| p.id == *part) {
                    let known = parts.iter().map(|p| p.id.as_str());
                    let mut unknown = Fault::error(format!("there is no part `{part}`"));
                    if let Some(near) = did_you_mean(part.as_str(), known) {
                        unknown = unknown.hint(format!("did you mean `{near}`?"));
                    }
                    fault(place, "parts", unknown);
                }
            }
        }
    }
    let listed = |list: Option<&Vec<PartId>>, id: &PartId| list.is_none_or(|l| l.contains(id));
    let all_sessions: Vec<Option<&Vec<PartId>>> = match sessions {
        [] => vec![None],
        some => some.iter().map(|s| s.parts.as_ref()).collect(),
    };
    for (i, group) in group_list.iter().enumerate() {
        let place = format!("groups.list[{i}]");
        let own = |part: &&Part| listed(group.parts.as_ref(), &part.id);
        for (n, session) in all_sessions.iter().enumerate() {
            if !parts.iter().any(|p| own(&p) && listed(*session, &p.id)) {
                let what = format!("group `{}` has no part in session {}", group.id, n + 1);
                fault(&place, "parts", Fault::error(what));
            }
        }
        let Some(models) = &group.models else {
            continue;
        };
        for part in parts.iter().filter(own) {
            let (all, left) = match &part.task {
                // The levels of a family belong to all groups.
                Task::Magnitude(task) if task.presentations.models.iter().any(is_level) => continue,
                Task::Rating(task)
                | Task::Magnitude(Magnitude {
                    presentations: task,
                    ..
                }) => {
                    let own = task.models.iter().filter(|m| models.contains(m));
                    (task.models.clone(), own.count())
                }
                Task::Pairs(task) => {
                    let mut own = task.clone();
                    own.keep(models);
                    (task.pairs.concat(), own.pairs.len())
                }
                Task::Mushra(Mushra { presentations, .. })
                | Task::Identification(Identification { presentations, .. }) => {
                    let all = &presentations.models;
                    let own = all.iter().filter(|m| models.contains(m) || is_level(m));
                    (all.clone(), own.count())
                }
                Task::Similarity(task) => {
                    let mut own = task.clone();
                    own.keep(|m| models.contains(m) || is_level(m));
                    (task.models.clone(), own.different.len())
                }
                Task::Ranking(task) if task.models.iter().all(is_level) => continue,
                Task::Ranking(task) => {
                    let own = task.models.iter().filter(|m| models.contains(m)).count();
                    if (1..task.models.len()).contains(&own) {
                        let what = format!(
                            "group `{}` has {own} of the {} realizations of the ranking `{}`",
                            group.id,
                            task.models.len(),
                            part.id
                        );
                        let hint = "give it all of them, or a part of its own, by `parts`";
                        fault(&place, "models", Fault::error(what).hint(hint));
                    }
                    (task.models.clone(), own)
                }
                Task::Discrimination { .. } | Task::Search(_) | Task::Adjustment(_) => continue,
            };
            if left == 0 {
                let what = format!(
                    "group `{}` has nothing to do in part `{}`",
                    group.id, part.id
                );
                fault(&place, "models", Fault::error(what));
            }
            for model in models.iter().filter(|m| !all.contains(m)) {
                let what = format!("part `{}` does not present `{model}`", part.id);
                fault(&place, "models", Fault::error(what));
            }
        }
    }
}
