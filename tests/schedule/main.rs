//! Orders: golden, uniform, reproducible.

mod command;
#[path = "../support/designs.rs"]
mod designs;
mod golden;
mod reproduced;
mod requeue;
mod uniform;
