//! The two points that a search presents next.

use super::Session;
use crate::outcome::{Event, Moment};
use study_base::text::{ModelId, PartId};
use study_plan::procedure::search::{LeftOut, RecordedPair};
use study_plan::protocol::Trial;

/// The last pair of a search, so that a trial that is repeated does not compute it again.
#[derive(Debug)]
pub(super) struct Searching {
    part: PartId,
    told: Vec<RecordedPair>,
    left_out: Vec<LeftOut>,
    pair: [usize; 2],
}

impl Session {
    /// The realizations of both intervals; `None` if the search has ended.
    pub(super) fn searched(&mut self, trial: &Trial, swapped: bool) -> Option<Vec<ModelId>> {
        let protocol = self.protocol.clone();
        let part = protocol.part(trial.part.as_ref()?)?;
        let (space, _) = protocol.searched(part)?;
        let told = self.history.compared(&part.id, space);
        let left_out = self.history.left_out(&part.id, space);
        let known = self.searching.as_ref().filter(|known| {
            known.part == part.id && known.told == told && known.left_out == left_out
        });
        let pair = match known {
            Some(known) => known.pair,
            None => {
                let seat = self.history.start()?.seat;
                let mut search = protocol.start_search(part, seat)?.ok()?;
                search.replay(&told, &left_out);
                let pair = search.next()?;
                self.searching = Some(Searching {
                    part: part.id.clone(),
                    told,
                    left_out,
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

    /// Leaves out the points at which the device has failed again, so that the search goes on with others. The last two stay.
    pub(super) fn leave_points_out(&mut self, trial: &Trial, at: Moment) {
        let protocol = self.protocol.clone();
        let part = trial.part.as_ref().and_then(|id| protocol.part(id));
        let Some((part, (space, _))) = part.and_then(|p| Some((p, protocol.searched(p)?))) else {
            return;
        };
        for point in self.history.to_leave_out(&part.id) {
            let left = space.lattice.certified().len();
            if self.history.left_out(&part.id, space).len() + 2 >= left {
                return;
            }
            let part = part.id.clone();
            self.record(Event::PointLeftOut { part, point }, at);
            self.notify("the device failed here before: the search goes on without this point");
        }
    }
}
