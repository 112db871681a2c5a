//! `study explore`: what a search found.

use super::include::{Who, include};
use super::{Console, Failure, study_folder};
use std::fs;
use std::path::PathBuf;
use study_analysis::study::Study;
use study_base::text::Untrusted;
use study_report::explore;

/// Arguments of `study explore`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder with one study, or the folder of a study in it
    results: PathBuf,
    /// Also write tables of all points and pairs into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also include these sessions
    #[arg(long, value_name = "WHO", value_delimiter = ',')]
    include: Vec<Who>,
}

/// Prints the maps, and writes the tables.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let study = Study::open(&args.results)?;
    let found = study.explore(include(&args.include));
    if found.is_empty() {
        let id = &study.loaded.protocol.study.id;
        return Err(Failure::input(explore::none(id)).hint(
            "`study new --kind search` writes such a study; `study analyze` analyzes all others",
        ));
    }
    study_folder::warn(&study.folder, &study.damage()?, console);
    let whole = study_folder::whole(&study.folder, &study.sessions);
    console.out(explore::text(&found))?;
    let Some(dir) = &args.out else {
        return whole;
    };
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    for own in &found {
        for (name, table) in [
            ("points", explore::points_csv(own)),
            ("pairs", explore::pairs_csv(own)),
        ] {
            let path = dir.join(format!("{}-{name}.csv", own.part));
            let bytes = table.map_err(|e| Failure::file(&path, &std::io::Error::other(e)))?;
            fs::write(&path, bytes).map_err(|e| Failure::file(&path, &e))?;
            let shown = path.display().to_string();
            console.say(format!("wrote {}", Untrusted(&shown)));
        }
    }
    whole
}
