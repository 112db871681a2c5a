//! From trajectories and recordings to model files.

mod bad_input;
mod bounds;
mod cli;
mod compare;
mod doubtful;
mod elsewhere;
mod estimators_switches;
mod estimators_tables;
mod evidence;
mod force_curves;
mod golden;
mod grid;
mod import;
mod mechanism;
mod metamorphic;
mod record;
mod shipped;
mod stimulus;
#[path = "../support/switches.rs"]
mod switches;
mod terms;
mod trajectory;
mod weights;
mod words;
