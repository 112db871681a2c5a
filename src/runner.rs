//! Effects of a session to device, store and operator.
