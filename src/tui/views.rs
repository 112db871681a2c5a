//! What is drawn: one file for each screen, and the page around them.
//!
//! A view is borrowed data with `impl Widget for &…`: drawing changes nothing.
//! Everything on the page comes from the `View`, which holds nothing that
//! identifies a realization, from the `UiState` and from the strip. The
//! participant's part is in the middle and large; the experimenter's line is the
//! last row.

pub mod answer;
pub mod choice;
pub mod dialogs;
pub mod form;
pub mod page;
pub mod playing;
pub mod prose;
pub mod scale;
pub mod status;
pub mod trouble;
pub mod who;

pub use page::Page;

/// Smallest size that is drawn for, columns and rows.
pub const MINIMUM: (u16, u16) = (80, 24);
