//! Reads a results folder, analyzes it and prints three findings.
use study_analysis::analyze::Include;
use study_analysis::study::{Options, Study};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args().nth(1);
    let study = Study::open(
        given
            .as_deref()
            .unwrap_or("results/turn-signal-example")
            .as_ref(),
    )?;
    let include = Include {
        simulated: true,
        pilot: false,
    };
    let analyzed = study.analyze(&Options {
        include,
        ..Options::default()
    })?;
    for finding in analyzed.ratings().iter().flat_map(|a| &a.findings).take(3) {
        let p = finding.test.as_ref().map(|test| test.p);
        println!(
            "{}: {}, p = {p:?}",
            finding.question.id(),
            finding.verdict.as_str()
        );
    }
    Ok(())
}
