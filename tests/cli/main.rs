//! What the other commands say, above all of bad input.

mod bad_input;
mod doctor;
mod families;
mod power;
mod power_parts;
mod preregister;
mod protocol_check;
mod protocol_docs;
mod protocol_schema;
mod schema_install;
mod searchers;
mod spaces;
#[path = "../support/mod.rs"]
mod support;
