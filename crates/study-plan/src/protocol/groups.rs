//! Groups of participants and repeated sessions: `[groups]` and `[[sessions]]`.
//!
//! A participant belongs to one group for good and comes to the sessions in their order.
//! Which trials a session has follows from both: [`Protocol::of`].

use super::keys::words;
use super::{Protocol, Role, Seat, Task};
use serde::{Deserialize, Serialize};
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};

/// `[groups]`
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Groups {
    /// Who decides.
    pub assign: Assign,
    /// The groups, in the order of the file.
    pub list: Vec<GroupRules>,
}

words! {
    /// How a participant gets a group.
    Assign {
        /// By row, in permuted blocks: every so many rows each group has its share.
        Row = "row",
        /// The experimenter says which, with `--group`, as for left- and right-handed people.
        Given = "given",
    }
}

/// One of `[[groups.list]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupRules {
    /// Identifier of the group.
    pub id: PartId,
    /// Participants of a block of rows.
    pub share: u32,
    /// The parts that it has; `None`: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<Vec<PartId>>,
    /// The realizations that it rates and compares; `None`: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub models: Option<Vec<ModelId>>,
}

/// One of `[[sessions]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionPlan {
    /// Identifier of the session.
    pub id: PartId,
    /// The parts that it has; `None`: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<Vec<PartId>>,
    /// Least time since the session before, h.
    pub min_gap_h: f64,
    /// Largest time since the session before, h.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_gap_h: Option<f64>,
}

/// Group and planned session of a session under way. In the journal's first event.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Assigned {
    /// The participant's group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<PartId>,
    /// Which of `[[sessions]]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session_id: Option<PartId>,
    /// Time since the session before, h.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_h: Option<f64>,
}

impl Groups {
    /// The group of a seat, if groups are assigned by row. Pilots and simulated
    /// participants draw from streams of their own.
    pub fn of_seat(&self, seed: u64, seat: Seat) -> Option<&PartId> {
        if self.assign == Assign::Given {
            return None;
        }
        let block: Vec<&PartId> = (self.list.iter())
            .flat_map(|group| std::iter::repeat_n(&group.id, group.share as usize))
            .collect();
        let index = seat.number().checked_sub(1)? as usize;
        let number = (index / block.len().max(1)).to_string();
        let mut order: Vec<usize> = (0..block.len()).collect();
        Stream::new(seed, &["groups", seat.stream(), &number]).shuffle(&mut order);
        block.get(*order.get(index % block.len().max(1))?).copied()
    }
}

impl Protocol {
    /// The protocol of one session: the parts and realizations of the group and of the
    /// planned session. After the first session the seed is another, so that orders do not
    /// repeat, and nothing is asked that is asked once.
    ///
    /// # Panics
    /// Never: an unknown id changes nothing.
    pub fn of(&self, assigned: &Assigned) -> Self {
        let mut own = self.clone();
        let id = |id: &Option<PartId>| id.clone();
        let group = (self.groups.iter().flat_map(|g| &g.list))
            .find(|g| Some(&g.id) == id(&assigned.group).as_ref());
        let place =
            (self.sessions.iter()).position(|s| Some(&s.id) == id(&assigned.session_id).as_ref());
        let session = place.map(|at| &self.sessions[at]);
        let listed = |list: Option<&Vec<PartId>>, id: &PartId| list.is_none_or(|l| l.contains(id));
        own.parts.retain(|part| {
            listed(group.and_then(|g| g.parts.as_ref()), &part.id)
                && listed(session.and_then(|s| s.parts.as_ref()), &part.id)
        });
        if let Some(models) = group.and_then(|g| g.models.as_ref()) {
            for part in &mut own.parts {
                match &mut part.task {
                    Task::Rating(task) => task.models.retain(|m| models.contains(m)),
                    // The levels of a family belong to all groups.
                    Task::Magnitude(task) => {
                        let stays = |m: &ModelId| models.contains(m) || self.level_of(m).is_some();
                        task.presentations.models.retain(stays);
                    }
                    Task::Pairs(task) => task.keep(models),
                    // The hidden reference stays, whatever the group rates.
                    Task::Mushra(task) => {
                        let hidden = |m: &ModelId| {
                            let model = self.models.iter().find(|own| own.id == *m);
                            model.is_some_and(|own| own.role == Role::HiddenReference)
                        };
                        let stays = |m: &ModelId| models.contains(m) || hidden(m);
                        task.presentations.models.retain(stays);
                    }
                    // The labels stay: they are the answers of everybody.
                    Task::Identification(task) => {
                        let stays = |m: &ModelId| models.contains(m) || self.level_of(m).is_some();
                        task.presentations.models.retain(stays);
                    }
                    Task::Similarity(task) => {
                        task.keep(|m| models.contains(m) || self.level_of(m).is_some());
                    }
                    // All realizations of a ranking belong to all groups.
                    Task::Discrimination { .. }
                    | Task::Search(_)
                    | Task::Ranking(_)
                    | Task::Adjustment(_) => {}
                }
            }
        }
        if let (Some(at @ 1..), Some(session)) = (place, session) {
            debug_assert!(at > 0);
            let mut stream = Stream::new(self.study.seed, &["session", session.id.as_str()]);
            own.study.seed = stream.below(1 << 53);
            own.intake.clear();
        }
        own
    }

    /// Every group in every planned session; one of neither in a study without.
    pub fn assignments(&self) -> Vec<Assigned> {
        let groups = self
            .groups
            .iter()
            .flat_map(|g| &g.list)
            .map(|g| Some(g.id.clone()));
        let sessions = self.sessions.iter().map(|s| Some(s.id.clone()));
        let or_none = |list: Vec<Option<PartId>>| if list.is_empty() { vec![None] } else { list };
        let sessions = or_none(sessions.collect());
        let all = or_none(groups.collect()).into_iter().flat_map(|group| {
            let one = move |session_id: &Option<PartId>| Assigned {
                group: group.clone(),
                session_id: session_id.clone(),
                gap_h: None,
            };
            sessions.iter().map(one).collect::<Vec<_>>()
        });
        all.collect()
    }

    /// The most sessions of a participant.
    pub fn planned_sessions(&self) -> usize {
        self.sessions.len().max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(shares: &[u32]) -> Groups {
        let list = (1..).zip(shares).map(|(n, share)| GroupRules {
            id: PartId::new(format!("g{n}")).unwrap(),
            share: *share,
            parts: None,
            models: None,
        });
        Groups {
            assign: Assign::Row,
            list: list.collect(),
        }
    }

    #[test]
    fn every_block_of_rows_has_the_shares() {
        let groups = groups(&[2, 1]);
        let of = |row| {
            groups
                .of_seat(7, Seat::Row(row))
                .unwrap()
                .as_str()
                .to_owned()
        };
        let mut orders = std::collections::BTreeSet::new();
        for block in 0..40 {
            let own: Vec<String> = (1..=3).map(|i| of(3 * block + i)).collect();
            assert_eq!(own.iter().filter(|g| *g == "g1").count(), 2, "{own:?}");
            orders.insert(own);
        }
        // Not always in the same order, and never drawn again.
        assert_eq!(orders.len(), 3);
        assert_eq!(of(5), of(5));
    }

    #[test]
    fn the_intake_is_asked_in_the_first_session() {
        let mut protocol = crate::protocol::example::protocol(2, 1);
        protocol.intake = protocol.questions.clone();
        protocol.sessions = ["first", "second"]
            .map(|id| SessionPlan {
                id: PartId::new(id).unwrap(),
                parts: None,
                min_gap_h: 24.0,
                max_gap_h: None,
            })
            .to_vec();
        let asked = |session: usize| {
            let assigned = Assigned {
                session_id: Some(protocol.sessions[session].id.clone()),
                ..Assigned::default()
            };
            protocol.of(&assigned).intake.len()
        };
        assert_eq!([asked(0), asked(1)], [2, 0]);
    }

    #[test]
    fn pilots_do_not_take_a_place_of_a_row() {
        let groups = groups(&[1, 1]);
        let differs = |n| groups.of_seat(7, Seat::Row(n)) != groups.of_seat(7, Seat::Pilot(n));
        assert!((1..40).any(differs));
        let given = Groups {
            assign: Assign::Given,
            ..groups
        };
        assert_eq!(given.of_seat(7, Seat::Row(1)), None);
    }
}
