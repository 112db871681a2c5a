//! Widgets: one file for each kind of screen, and the page around them.
//!
//! A widget borrows its data and implements `Widget for &…`: drawing changes nothing.
//! Everything on the page comes from the `View`, which holds nothing that identifies a
//! realization, and from the `UiState`. The participant's part is
//! large and centered; the experimenter's status line is the last row.

pub mod answer;
pub mod choice;
pub mod desk;
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

/// Smallest supported size: columns and rows.
pub const MINIMUM: (u16, u16) = (80, 24);
