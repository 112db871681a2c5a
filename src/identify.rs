//! From a recording to a realization.
