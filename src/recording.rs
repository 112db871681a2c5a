//! What a probe measured.
