//! An analysis to bytes.
