//! The simulated device, in this process.
