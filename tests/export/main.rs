//! `study export`: what a data set has, and that the official validators accept it.

mod command;
#[path = "../support/designs.rs"]
mod designs;
mod official;
mod sessions;
mod studies;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/world.rs"]
mod world;
