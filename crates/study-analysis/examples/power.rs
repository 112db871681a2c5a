//! The power of a protocol's own design, by simulation: `power [PROTOCOL]`.
#![allow(clippy::print_stdout, reason = "an example prints")]

use study_analysis::load::load;
use study_analysis::power::{Overrides, Plan};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args().nth(1);
    let loaded = load(given.as_deref().unwrap_or("protocols/turn-signal").as_ref())?;
    let mut flags = Overrides::default();
    flags.plan.studies = Some(2000);
    let plan = Plan::of(&loaded.protocol, &flags)?;
    let units = plan.units_of(&[plan.own]);
    let chunks = plan.simulate_designs(&units, &|| ());
    let results = plan.results(&units, &chunks);
    for result in results.iter().flat_map(|r| &r.tests) {
        println!("{}: power {:.3}", result.test.as_str(), result.power);
    }
    Ok(())
}
