//! What tracks measure, and how they are fitted.

use super::keys::word;
use super::{Part, Protocol, Task, TrackRules};
use study_base::text::PartId;
use study_stats::psychometric::{Core, Spacing};

impl TrackRules {
    /// The condition that a track measures: the name of its statistics.
    pub fn condition(&self) -> &PartId {
        self.measures.as_ref().unwrap_or(&self.id)
    }

    /// Why two tracks cannot measure one condition; `None` if they can.
    pub fn differs_in(&self, other: &Self) -> Option<&'static str> {
        let all = [
            ("method", self.method == other.method),
            ("family or standard", self.compared == other.compared),
            ("relative", self.relative == other.relative),
            ("fit", self.fit == other.fit),
        ];
        all.into_iter()
            .find(|(_, same)| !same)
            .map(|(what, _)| what)
    }
}

impl Protocol {
    /// The scale and the shape of the functions of a track. Levels that are counted from the
    /// standard are all above 0, and at 0 there is nothing to feel: a function of their logarithm
    /// is chance there, one of the level itself need not be.
    pub fn fit(&self, track: &TrackRules) -> (Spacing, Core) {
        let family = track.family().and_then(|id| self.family(id));
        let own = || match track.relative {
            Some(_) => Some(Spacing::Log),
            None => family.map(|family| family.spacing),
        };
        let spacing = track.fit.scale.or_else(own).unwrap_or_default();
        let core = track.fit.core.unwrap_or_else(|| spacing.usual_core());
        (spacing, core)
    }

    /// How a track is fitted, in words.
    pub fn fit_in_words(&self, track: &TrackRules) -> String {
        let (spacing, core) = self.fit(track);
        let (core, spacing) = (word(core), word(spacing));
        format!(
            "{core} over {spacing} levels, lapse rate {}",
            track.fit.lapse
        )
    }

    /// The tracks of a part by condition, in their order.
    pub fn conditions(&self, part: &Part) -> Vec<Vec<&TrackRules>> {
        let Task::Discrimination { tracks } = &part.task else {
            return Vec::new();
        };
        let tracks: Vec<&TrackRules> = tracks.iter().filter_map(|id| self.track(id)).collect();
        by_condition(&tracks)
    }
}

/// Tracks by condition, in the order of their first ones.
pub fn by_condition<'t>(tracks: &[&'t TrackRules]) -> Vec<Vec<&'t TrackRules>> {
    let mut found: Vec<Vec<&TrackRules>> = Vec::new();
    for track in tracks {
        match (found.iter_mut()).find(|own| own[0].condition() == track.condition()) {
            Some(own) => own.push(track),
            None => found.push(vec![track]),
        }
    }
    found
}
