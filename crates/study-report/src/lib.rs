//! Renders an analysis: terminal page, HTML report, figures, CSV tables, JSON.
//!
//! Nothing is inferred here: statistics and verdicts are looked up in the analysis,
//! and what is absent is left out. Text from the data is escaped on its way to a
//! terminal, to HTML and to a picture; CSV and JSON store it as it is.

mod answers;
mod apa;
pub mod catalogue;
pub mod chart;
pub mod commission;
pub mod comparison;
pub mod confirmation;
pub mod csv;
pub mod explore;
pub mod figures;
pub mod html;
pub mod identification;
pub mod json;
mod part_answers;
pub mod picture;
pub mod plot;
pub mod power;
pub mod preregistration;
mod sentences;
mod sites;
pub mod study;
mod table;
mod tables;
pub mod text;
pub mod wide;
mod wording;

pub use study_analysis::study::{Site, SiteDevice, Source};
