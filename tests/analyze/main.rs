//! From ratings to statistics, report and figures.

mod adjustment;
mod checks;
mod command;
#[path = "../support/designs.rs"]
mod designs;
mod docs;
mod factors;
mod findings;
mod golden;
mod identification;
mod import;
#[path = "../support/json_schema.rs"]
mod json_schema;
mod missing;
mod mixed;
mod nist;
mod odd;
mod outcomes;
mod parts;
mod perceptual;
mod pool;
mod possible;
mod posterior;
mod properties;
mod psychophysics;
mod questionnaires;
mod ranking;
mod rendering;
mod report_answers;
mod report_figures;
mod report_html;
mod report_reads;
mod report_support;
mod rows;
mod rules;
mod schema;
mod shipped_designs;
mod similarity;
mod study;
mod told_apart;
mod trials;
mod verdicts;
#[path = "../support/world.rs"]
mod world;
