//! States what a study will do before its first session: `preregister [PROTOCOL]`.
#![allow(clippy::print_stdout, reason = "an example prints")]

use chrono::NaiveDate;
use study_analysis::load::load;
use study_report::preregistration::{Options, document};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args().nth(1);
    let loaded = load(given.as_deref().unwrap_or("protocols/turn-signal").as_ref())?;
    let options = Options {
        participants: Some(24),
        date: NaiveDate::from_ymd_opt(2026, 11, 23).ok_or("a date")?,
        studies: Some(1000),
    };
    let document = document(loaded, &options, &|_| ())?;
    let (_, markdown) = &document.files[0];
    print!("{markdown}");
    Ok(())
}
