//! The target, and the hand that holds the device.
