//! What the tracks of a session were told.

use super::History;
use study_plan::procedure::{Answer, Recorded};
use study_plan::protocol::{Stimuli, TrackRules};

impl History {
    /// The completed trials of a track of which its rule is told, in order: all but catch
    /// trials and those whose answer was declined. The answers are the first ones; a
    /// correction changes the analysis, not the track.
    pub fn recorded(&self, track: &TrackRules) -> Vec<Recorded> {
        let recorded = |(trial, attempt): (&study_plan::protocol::Trial, &super::Attempt)| {
            let Stimuli::Track {
                intervals, easy, ..
            } = &trial.stimuli
            else {
                return None;
            };
            if track.method.is_catch(intervals) {
                return None;
            }
            let level = attempt.level?;
            Some(Recorded {
                proposed: level.proposed,
                answer: Answer {
                    presented: level.presented,
                    positive: track.is_correct(intervals, attempt.told.as_ref()?)?,
                    easy: *easy,
                },
            })
        };
        self.told(&track.id).filter_map(recorded).collect()
    }
}
