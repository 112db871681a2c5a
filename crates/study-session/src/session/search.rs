//! The two points that a search presents next.

use super::Session;
use study_base::text::{ModelId, PartId};
use study_plan::procedure::Preferred;
use study_plan::procedure::search::RecordedPair;
use study_plan::protocol::Trial;

/// The last pair of a search, so that a trial that is repeated does not compute it again.
#[derive(Debug)]
pub(super) struct Searching {
    part: PartId,
    told: Vec<RecordedPair>,
    pair: [usize; 2],
}

impl Session {
    /// The realizations of both intervals; `None` if the search has ended.
    pub(super) fn searched(&mut self, trial: &Trial, swapped: bool) -> Option<Vec<ModelId>> {
        let protocol = self.protocol.clone();
        let part = protocol.part(trial.part.as_ref()?)?;
        let (space, _) = protocol.searched(part)?;
        let told = self.history.compared(&part.id, space);
        let known = self.searching.as_ref();
        let known = known.filter(|known| known.part == part.id && known.told == told);
        let pair = match known {
            Some(known) => known.pair,
            None => {
                let seat = self.history.start()?.seat;
                let mut search = protocol.start_search(part, seat)?.ok()?;
                told.iter()
                    .filter_map(RecordedPair::answer)
                    .for_each(|answer: Preferred| search.answer(&answer));
                let pair = search.next()?;
                self.searching = Some(Searching {
                    part: part.id.clone(),
                    told,
                    pair,
                });
                pair
            }
        };
        let [low, high] = pair.map(|point| space.realization(point));
        Some(match swapped {
            false => vec![low, high],
            true => vec![high, low],
        })
    }
}
