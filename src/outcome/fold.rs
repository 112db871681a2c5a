//! The fold of events into rows.
