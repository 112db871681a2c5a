//! The results folder: journals, crashes, ledger, derived tables.

mod chains;
mod commands;
mod consented;
mod corrected;
mod crash;
#[path = "../support/designs.rs"]
mod designs;
mod desk;
mod dictionary;
mod example_study;
mod folder;
mod groups;
mod heads;
mod journal;
#[path = "../support/json_schema.rs"]
mod json_schema;
mod memory;
mod mirrors;
mod process;
mod processes;
mod replayed;
mod saver;
#[path = "../support/mod.rs"]
mod support;
mod verified;
#[path = "../support/world.rs"]
mod world;
mod wrong_kinds;
