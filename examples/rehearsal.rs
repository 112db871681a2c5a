//! Rehearses a study at two sites, and analyzes both together.
#![allow(clippy::print_stdout, reason = "an example prints")]

use study::rehearsal::{Options, rehearse};
use study_analysis::analyze::Include;
use study_analysis::load::load;
use study_analysis::study::{Options as Analyze, Pool};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let results = tempfile::tempdir()?;
    let sites = [("utah", 1), ("bern", 2)].map(|(site, seed)| (results.path().join(site), seed));
    for (site, seed) in &sites {
        let options = Options {
            participants: 4,
            seed: Some(*seed),
            ..Options::default()
        };
        let rehearsed = rehearse(load("protocols/turn-signal".as_ref())?, site, &options)?;
        println!("{} rows", rehearsed.derived.rows.len());
    }
    let pool = Pool::open(&sites.map(|(site, _)| site))?;
    let simulated = Include {
        simulated: true,
        ..Include::default()
    };
    let analyzed = pool.analyze(&Analyze {
        include: simulated,
        ..Analyze::default()
    })?;
    for site in &analyzed.source.sites {
        println!("{}: {} participants", site.name, site.participants);
    }
    for finding in analyzed.ratings().iter().flat_map(|a| &a.findings) {
        println!("{}: {}", finding.question.id(), finding.verdict.as_str());
    }
    Ok(())
}
