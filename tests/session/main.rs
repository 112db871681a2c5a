//! A session from the first screen to the last: state machine, terminal, kills.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod adjusting_channels;
mod adjustment_by_keys;
mod another_build;
mod blinding;
mod blinding_of_search;
mod bridges;
mod by_keys;
mod channels;
mod checked;
mod commission;
mod consent_page;
mod debriefing_page;
#[path = "../support/designs.rs"]
mod designs;
mod desk;
mod devices;
mod dying_disk;
mod exposure;
mod flow;
mod front;
mod groups;
mod idle_keys;
#[path = "../support/json_schema.rs"]
mod json_schema;
mod kill;
mod kinds;
mod languages;
#[path = "../store/memory.rs"]
mod memory;
mod mirror;
mod parts_by_keys;
mod plain;
mod programs;
mod ranking_by_keys;
mod rehearsed;
mod releases;
mod screen;
mod search_by_keys;
mod similarity_by_keys;
#[path = "../support/mod.rs"]
mod support;
mod tcp;
mod tui_hostile;
mod tui_keys;
mod tui_pictures;
mod tui_terminal;
mod turning;
mod unsaved;
mod views;
mod who;
#[path = "../support/world.rs"]
mod world;
