//! Design and seat to a whole, frozen order of trials.
