//! Read recordings, compare the estimators, and write the model that is recommended:
//!
//!     cargo run -p study-haptics --release --example recommend -- model.toml training.csv validation.csv

#![allow(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use std::fs::{self, File};
use std::io::BufReader;
use study_haptics::identify::identification::{self, Request, Source, Sources};
use study_haptics::recording::Names;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [model, training, validation @ ..] = &paths[..] else {
        println!("usage: recommend MODEL TRAINING [VALIDATION…]");
        return Ok(());
    };
    let request = Request::default();
    let read = |path: &String| -> Result<Source, Box<dyn Error>> {
        let (file, names) = (BufReader::new(File::open(path)?), Names::default());
        let say = |note| println!("{note}");
        Ok(Source::read((path, path), file, &names, &request, say)?)
    };
    let sources = Sources {
        training: vec![read(training)?],
        validate: validation.iter().map(read).collect::<Result<_, _>>()?,
        ..Sources::default()
    };
    let note = |note| println!("{note}");
    let mut found = identification::run(&request, sources, note, || (), |_| ())?;
    let best = (found.comparison.as_ref()).and_then(|comparison| comparison.best());
    let best = best.ok_or("nothing was compared")?;
    let left_out = best.left_out.map_or(f64::NAN, |left_out| left_out.vaf);
    println!(
        "{}: VAF on strokes left out {left_out:.4}",
        best.cell.method
    );
    if let Some(failure) = best.failure() {
        return Err(failure.into());
    }
    for term in &best.cell.terms {
        println!(
            "{}: {:.3e} {}, identified: {}",
            term.name, term.value, term.unit, term.identified
        );
    }
    for (_, text) in found.model_files(None)? {
        fs::write(model, text)?;
    }
    Ok(())
}
