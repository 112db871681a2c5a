//! Orders: golden, uniform, reproducible.

mod adjustment;
mod answers;
mod command;
#[path = "../support/designs.rs"]
mod designs;
mod faults;
mod golden;
mod guessing;
mod parts;
mod proposals;
mod reproduced;
mod requeue;
mod search;
mod second;
mod uniform;
