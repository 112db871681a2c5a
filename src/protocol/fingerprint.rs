//! Fingerprints: what of a study may change while it runs.
//!
//! A change of the *stimulus* fingerprint is a new study; *wording* and
//! *analysis* can be amended, and each session records its own.

use serde::{Deserialize, Serialize};

/// SHA-256 in hexadecimal of the three parts of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprints {
    /// Design, models' bytes, limits, rating scales, orders file.
    pub stimulus: String,
    /// Every text that a person reads.
    pub wording: String,
    /// `[analysis]` and what enters only the analysis.
    pub analysis: String,
}
