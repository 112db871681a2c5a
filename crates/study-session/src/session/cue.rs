//! What the participant's page shows and plays beside what is felt, and what it says of it.

use serde::Serialize;
use std::collections::BTreeMap;
use study_base::text::ModelId;
use study_plan::protocol::Medium;

/// A medium as the page has it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Shown {
    /// What it is.
    pub medium: Medium,
    /// The name of its content on the page. No other run has it, and realizations that look or sound the same have the
    /// same: nothing of what is felt follows from it.
    pub id: String,
    /// What is seen, for screen readers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alt: Option<String>,
    /// What is heard, as text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caption: Option<String>,
}

/// The media of each realization that has some.
pub type Shows = BTreeMap<ModelId, Vec<Shown>>;

/// The media of a presentation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Cue {
    /// Names the presentation: the page says of which one it speaks.
    pub cue: u64,
    /// What is to be shown and played at once.
    pub media: Vec<Shown>,
}

/// What the page says of its media.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MediaReport {
    /// It is there; said all the time.
    Here {
        /// Whether everything is loaded, can be played and is in sight.
        ready: bool,
    },
    /// A medium was seen or heard.
    Onset {
        /// [`Cue::cue`]
        cue: u64,
        /// Which of its media.
        medium: Medium,
        /// How long ago, s, by the clock of this program.
        ago_s: f64,
        /// By how much the two clocks may make that wrong, s.
        uncertainty_s: f64,
    },
    /// What was to be shown and played was not, or not for the whole time.
    Lost {
        /// [`Cue::cue`]
        cue: u64,
        /// Why.
        why: Loss,
    },
}

study_base::named! {
    /// Why media were not shown or played to the end; the words are those of `attempts.csv`.
    Loss {
        /// Another page or window was in front, or the screen was locked.
        Hidden = "the participant's page was out of sight",
        /// The browser did not run the page for a while.
        Asleep = "the participant's page stood still",
        /// The browser refused.
        NotPlayed = "the participant's browser did not show or play it",
    }
}
