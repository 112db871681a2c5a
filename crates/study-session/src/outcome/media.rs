//! When pictures, videos and sounds came.

use study_plan::protocol::Medium;

/// The onset of a medium on the participant's page, which measures it by its own clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onset {
    /// After the confirmed start of the playback, ms; negative if before it.
    pub offset_ms: f64,
    /// By how much the clocks may make it wrong, ms.
    pub uncertainty_ms: f64,
}

/// The onsets of a presentation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Onsets {
    picture: Option<Onset>,
    video: Option<Onset>,
    sound: Option<Onset>,
}

impl Onsets {
    /// That of a medium, if the page confirmed it.
    pub fn of(&self, medium: Medium) -> Option<Onset> {
        match medium {
            Medium::Picture => self.picture,
            Medium::Video => self.video,
            Medium::Sound => self.sound,
        }
    }

    /// All that the page confirmed.
    pub fn iter(&self) -> impl Iterator<Item = Onset> {
        [self.picture, self.video, self.sound].into_iter().flatten()
    }

    pub(super) fn set(&mut self, medium: Medium, onset: Onset) {
        let place = match medium {
            Medium::Picture => &mut self.picture,
            Medium::Video => &mut self.video,
            Medium::Sound => &mut self.sound,
        };
        *place = Some(onset);
    }
}
