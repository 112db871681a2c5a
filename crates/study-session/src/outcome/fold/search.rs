//! What the searches of a session were told.

use super::{Attempt, History};
use study_base::text::{ModelId, PartId};
use study_plan::procedure::search::RecordedPair;
use study_plan::protocol::{Answer, SpaceRules, Stimuli, Trial};

impl History {
    /// The completed trials of a part that searches, in the order in which the search was told.
    pub fn searched<'a>(
        &'a self,
        part: &'a PartId,
    ) -> impl Iterator<Item = (&'a Trial, &'a Attempt)> + 'a {
        self.told_of(move |trial| {
            trial.part.as_ref() == Some(part) && matches!(trial.stimuli, Stimuli::Search { .. })
        })
    }

    /// The same as points of the space, with the answers that were given first; a correction changes the analysis, not the
    /// search. Trials of which the journal does not have two points are left out.
    pub fn compared(&self, part: &PartId, space: &SpaceRules) -> Vec<RecordedPair> {
        let point = |model: &ModelId| space.point_of(model);
        let recorded = |(_, attempt): (&Trial, &Attempt)| {
            let [first, second] = &attempt.models[..] else {
                return None;
            };
            let (first, second) = (point(first)?, point(second)?);
            let preferred = match &attempt.told {
                Some(Answer::Choice(chosen)) => match chosen.first().map(String::as_str) {
                    Some("first") => Some(first),
                    Some("second") => Some(second),
                    _ => None,
                },
                _ => None,
            };
            Some(RecordedPair {
                pair: [first.min(second), first.max(second)],
                preferred,
            })
        };
        self.searched(part).filter_map(recorded).collect()
    }
}
