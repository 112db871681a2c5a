//! Reads a protocol from text and prints the orders of its first participants.
//!
//! `cargo run -p study-plan --example schedule`

use study_plan::protocol::{Seat, file};
use study_plan::schedule::Planner;

const PROTOCOL: &str = r#"
format = "study-protocol/1"
study = { id = "example", title = "An example", seed = 2007 }
design = { participants = 4, repetitions = 2, order = "williams" }
device = { kind = "manual" }
models = [{ id = "A" }, { id = "B" }, { id = "C" }, { id = "D" }]
analysis = { primary = "realism" }

[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic did it feel?"
from = 1
to = 7
"#;

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() {
    let parsed = file::parse("protocol.toml", PROTOCOL);
    let Some(protocol) = parsed.protocol else {
        // Every fault, with its line and a suggestion.
        println!("{}", parsed.findings.render(false));
        return;
    };
    let planner = match Planner::new(&protocol, None) {
        Ok(planner) => planner,
        Err(infeasible) => return println!("{infeasible}"),
    };
    for row in 1..=protocol.design.participants {
        match planner.plan(Seat::Row(row)) {
            Ok(trials) => {
                let models: Vec<&str> = trials
                    .iter()
                    .filter_map(|t| Some(t.model()?.as_str()))
                    .collect();
                println!("row {row}: {}", models.join(" "));
            }
            Err(error) => println!("row {row}: {error}"),
        }
    }
}
