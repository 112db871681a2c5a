//! The results folder: journals, crashes, ledger, derived tables.

mod chains;
mod commands;
mod crash;
#[path = "../support/designs.rs"]
mod designs;
mod dictionary;
mod example_study;
mod folder;
mod journal;
mod memory;
mod mirrors;
mod process;
mod processes;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/world.rs"]
mod world;
