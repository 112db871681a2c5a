//! One entry of a schedule, and where a schedule comes from.
//!
//! These live beside the protocol because both the schedule, which makes them,
//! and the outcomes, which record them, speak of them.

use serde::{Deserialize, Serialize};
use std::fmt;
use study_base::text::ModelId;

/// A planned trial. Frozen before the session starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Trial {
    /// Number in the whole session, practice included, from 1.
    pub trial: u32,
    /// Block from 1; 0 for practice.
    pub block: u32,
    /// Place among the trials that count, from 1; among the practice trials for
    /// practice.
    pub position: u32,
    /// What is played.
    pub model: ModelId,
    /// The how-maniest time it is played among the trials that count, from 1; 0
    /// for practice.
    pub repetition: u32,
    /// Whether it is practice, which is never analysed.
    pub practice: bool,
}

/// Where a participant's order comes from.
///
/// Only real participants take a row. Pilots and simulated participants draw
/// from streams of their own, so that they never change what a row holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Seat {
    /// The participant's place in the ledger, from 1.
    Row(u32),
    /// The pilot's number, from 1.
    Pilot(u32),
    /// The simulated participant's number, from 1.
    Simulated(u32),
}

impl Seat {
    /// The name of the stream that its order is drawn from.
    pub fn stream(self) -> &'static str {
        match self {
            Self::Row(_) => "row",
            Self::Pilot(_) => "pilot",
            Self::Simulated(_) => "simulated",
        }
    }

    /// Its number, from 1.
    pub fn number(self) -> u32 {
        match self {
            Self::Row(n) | Self::Pilot(n) | Self::Simulated(n) => n,
        }
    }

    /// The row, for a real participant.
    pub fn row(self) -> Option<u32> {
        match self {
            Self::Row(n) => Some(n),
            Self::Pilot(_) | Self::Simulated(_) => None,
        }
    }

    /// Whether the participant is no real one but tried the study out.
    pub fn is_pilot(self) -> bool {
        matches!(self, Self::Pilot(_))
    }

    /// Whether there was no person.
    pub fn is_simulated(self) -> bool {
        matches!(self, Self::Simulated(_))
    }
}

impl fmt::Display for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.stream(), self.number())
    }
}
