//! An operator on a terminal.
