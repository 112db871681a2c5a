//! What the rows of a study show.
//!
//! [`analyze`] turns rows into statistics and findings, and alone decides; [`power`] says
//! how large a study has to be; [`preregister`] states a study before its first session and
//! compares it later; [`export`] writes the rows as data sets for other programs, and [`import`] reads
//! the tables of others.

pub mod analyze;
pub mod check;
pub mod export;
pub mod import;
pub mod load;
pub mod power;
pub mod preregister;
pub mod study;
