//! The simulated participant.
