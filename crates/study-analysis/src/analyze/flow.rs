//! The flow of participants and trials: on record, left out and why, analyzed.

use super::select::{Decision, Reason};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use study_session::outcome::ratings::Ratings;

/// Numbers of participants and of their trials.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Share {
    /// Participants.
    pub participants: usize,
    /// Trials, without practice.
    pub trials: usize,
}

impl Share {
    fn add(&mut self, trials: usize) {
        if trials > 0 {
            self.participants += 1;
            self.trials += trials;
        }
    }
}

/// The flow of all participants, or of a group of them. The trials on record are those of the participants who are left out and of
/// those who are not; of the latter each trial is left out, without a rating, or analyzed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Flow {
    /// The group; `None` for all participants. Untrusted.
    pub group: Option<String>,
    /// With trials on record.
    pub recorded: Share,
    /// Without a trial that counts, by the reason of most of their trials, of equally many the one of the first. Untrusted.
    pub left_out: BTreeMap<String, Share>,
    /// All trials of participants who have one that counts.
    pub staying: Share,
    /// Trials that do not count, of participants who have others, by reason. Untrusted.
    pub trials_left_out: BTreeMap<String, Share>,
    /// Trials that count and have no rating.
    pub without_rating: Share,
    /// Trials that count and have a rating.
    pub analyzed: Share,
}

/// The trials of a participant.
#[derive(Default)]
struct Own<'a> {
    rated: usize,
    unrated: usize,
    /// In the order of the rows. There are few reasons.
    left_out: Vec<(&'a Arc<Reason>, usize)>,
}

impl Own<'_> {
    /// The reason of most of the trials that do not count.
    fn main_reason(&self) -> Option<String> {
        let first_of_most = (self.left_out.iter().rev()).max_by_key(|(_, trials)| *trials);
        first_of_most.map(|(reason, _)| reason.to_string())
    }
}

/// The flow of all participants and, with at least two groups, of each group, in the order of their names.
pub(super) fn flows(ratings: &Ratings, decisions: &[Decision]) -> Vec<Flow> {
    let mut own: Vec<Own<'_>> = Vec::new();
    own.resize_with(ratings.subjects.len(), Own::default);
    for (i, decision) in decisions.iter().enumerate() {
        let one = &mut own[ratings.subject[i] as usize];
        match decision {
            None if ratings.rating[i].is_some() => one.rated += 1,
            None => one.unrated += 1,
            Some(reason) => {
                let known = (one.left_out.iter_mut()).find(|(other, _)| Arc::ptr_eq(other, reason));
                match known {
                    Some((_, trials)) => *trials += 1,
                    None => one.left_out.push((reason, 1)),
                }
            }
        }
    }
    let group = |s: usize| ratings.subjects[s].group.as_ref();
    let names: BTreeSet<&String> = (0..own.len()).filter_map(group).collect();
    let mut flows = vec![flow(None, own.iter())];
    if names.len() > 1 {
        flows.extend(names.into_iter().map(|name| {
            let of_group = own.iter().enumerate();
            let of_group = of_group.filter(|(s, _)| group(*s) == Some(name));
            flow(Some(name.clone()), of_group.map(|(_, one)| one))
        }));
    }
    flows
}

fn flow<'a>(group: Option<String>, participants: impl Iterator<Item = &'a Own<'a>>) -> Flow {
    let mut flow = Flow {
        group,
        ..Flow::default()
    };
    for one in participants {
        let left_out: usize = one.left_out.iter().map(|(_, trials)| trials).sum();
        let all = one.rated + one.unrated + left_out;
        flow.recorded.add(all);
        if one.rated + one.unrated == 0 {
            if let Some(reason) = one.main_reason() {
                flow.left_out.entry(reason).or_default().add(left_out);
            }
            continue;
        }
        flow.staying.add(all);
        // Reasons that read the same are one.
        let mut by_reason: BTreeMap<String, usize> = BTreeMap::new();
        for (reason, trials) in &one.left_out {
            *by_reason.entry(reason.to_string()).or_default() += trials;
        }
        for (reason, trials) in by_reason {
            flow.trials_left_out.entry(reason).or_default().add(trials);
        }
        flow.without_rating.add(one.unrated);
        flow.analyzed.add(one.rated);
    }
    flow
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::{Rules, analyze};
    use study_plan::protocol::Exclusion;
    use study_session::outcome::event::State;

    /// Counted by hand: S1 and S2 are whole, S3 withdrew, S4 rates always the same and is left out by the rule, S5 has one
    /// answer of three.
    fn ratings() -> Ratings {
        let csv = "subject,model,repetition,rating,vaf\n\
                   S1,a,1,2,0.5\nS1,b,1,4,0.6\nS1,c,1,6,0.7\n\
                   S2,a,1,1,0.5\nS2,b,1,5,0.6\nS2,c,1,7,0.7\n\
                   S3,a,1,3,0.5\nS3,b,1,2,0.6\n\
                   S4,a,1,4,0.5\nS4,b,1,4,0.6\nS4,c,1,4,0.7\n\
                   S5,a,1,,0.5\nS5,b,1,,0.6\nS5,c,1,5,0.7\n";
        let mut ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
        for subject in &mut ratings.subjects {
            let young = ["S1", "S3"].contains(&&*subject.id);
            subject.group = Some(if young { "young" } else { "old" }.to_owned());
            let withdrew = subject.id == "S3";
            subject.state = Some(if withdrew {
                State::Withdrawn
            } else {
                State::Done
            });
        }
        ratings
    }

    fn share(participants: usize, trials: usize) -> Share {
        Share {
            participants,
            trials,
        }
    }

    #[test]
    fn all_trials_have_a_place() {
        let rules = Rules {
            exclude: vec![Exclusion::ConstantRater],
            ..Rules::default()
        };
        let analysis = analyze(&ratings(), &rules);
        let [all, old, young] = &analysis.flows[..] else {
            panic!("{:?}", analysis.flows);
        };
        assert_eq!(all.group, None);
        assert_eq!(all.recorded, share(5, 14));
        let reasons: Vec<(&str, Share)> = all.left_out.iter().map(|(r, s)| (&**r, *s)).collect();
        let rule = Reason::Rule(Exclusion::ConstantRater).to_string();
        assert_eq!(reasons, [(&*rule, share(1, 3)), ("withdrawn", share(1, 2))]);
        assert_eq!(all.staying, share(3, 9));
        assert_eq!(all.trials_left_out, BTreeMap::new());
        assert_eq!(all.without_rating, share(1, 2));
        assert_eq!(all.analyzed, share(3, 7));
        assert_eq!(old.group.as_deref(), Some("old"));
        assert_eq!((old.recorded, old.analyzed), (share(3, 9), share(2, 4)));
        assert_eq!(young.group.as_deref(), Some("young"));
        assert_eq!((young.recorded, young.analyzed), (share(2, 5), share(1, 3)));
    }

    /// Of the two trials of S3 one is a pilot's: of equally many reasons the first one counts, and of more the one of most.
    #[test]
    fn who_is_left_out_has_one_reason() {
        use study_session::outcome::ratings::Origin;
        let reasons = |pilots: &[usize]| {
            let mut ratings = ratings();
            for at in pilots {
                ratings.origin[*at] = Origin::Pilot;
            }
            let analysis = analyze(&ratings, &Rules::default());
            analysis.flows[0].left_out.clone()
        };
        let place = |reason: &str| BTreeMap::from([(reason.to_owned(), share(1, 2))]);
        assert_eq!(reasons(&[]), place("withdrawn"));
        assert_eq!(reasons(&[6]), place("pilot"));
        assert_eq!(reasons(&[7]), place("withdrawn"));
        assert_eq!(reasons(&[6, 7]), place("pilot"));
    }

    /// A participant with trials of several origins: the pilot's do not count beside real ones.
    #[test]
    fn trials_of_one_who_stays_are_left_out_by_themselves() {
        use study_session::outcome::ratings::Origin;
        let mut ratings = ratings();
        let first = ratings.subject[0];
        let own: Vec<usize> = (0..ratings.len())
            .filter(|&i| ratings.subject[i] == first)
            .collect();
        ratings.origin[own[0]] = Origin::Pilot;
        let analysis = analyze(&ratings, &Rules::default());
        let all = &analysis.flows[0];
        assert_eq!(all.trials_left_out["pilot"], share(1, 1));
        assert_eq!(all.left_out["withdrawn"], share(1, 2));
        assert_eq!(all.analyzed, share(4, 9));
        assert_eq!(all.staying, share(4, 12));
        let places = all.left_out.values().chain(all.trials_left_out.values());
        let left_out: usize = places.map(|s| s.trials).sum();
        let others = all.without_rating.trials + all.analyzed.trials;
        assert_eq!(left_out + others, all.recorded.trials);
    }
}
