//! `study explore`: what a search found, and what is weighed in choices.

use super::include::{Who, include};
use super::{Console, Failure, study_folder};
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::perceptual::{Errors, Weighing};
use study_analysis::study::Study;
use study_base::text::Untrusted;
use study_haptics::recording::{self, Recording};
use study_report::explore::{self, weights};

/// Arguments of `study explore`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder with one study, or the folder of a study in it
    results: PathBuf,
    /// Also say which errors against this recording of the real thing (t_s, x_mm, f_n) decide what is preferred, in searches and pairs
    #[arg(long, value_name = "RECORDING")]
    reference: Option<PathBuf>,
    /// Also write tables of all points and pairs into this folder, and weights for `study identify --weights`
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also include these sessions
    #[arg(long, value_name = "WHO", value_delimiter = ',')]
    include: Vec<Who>,
}

/// Prints the maps, and writes the tables.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let study = Study::open(&args.results)?;
    let who = include(&args.include);
    let found = study.explore(who);
    let id = &study.loaded.protocol.study.id;
    let weighed = match &args.reference {
        Some(path) => Some(weigh(&study, path, who)?),
        None if found.is_empty() => {
            return Err(Failure::input(explore::none(id)).hint(
                "`study new --kind search` writes such a study; `study analyze` analyzes all others",
            ));
        }
        None => None,
    };
    study_folder::warn(&study.folder, &study.damage()?, console);
    let whole = study_folder::whole(&study.folder, &study.sessions);
    console.out(explore::text(&found))?;
    if let Some((recording, all)) = &weighed {
        if !found.is_empty() {
            console.out("\n")?;
        }
        console.out(weights::text(all, recording))?;
    }
    let Some(dir) = &args.out else {
        return whole;
    };
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    let mut files = Vec::new();
    for own in &found {
        files.push((format!("{}-points.csv", own.part), explore::points_csv(own)));
        files.push((format!("{}-pairs.csv", own.part), explore::pairs_csv(own)));
    }
    for (recording, own) in weighed
        .iter()
        .flat_map(|(r, all)| all.iter().map(move |w| (r, w)))
    {
        if let Ok(perceived) = &own.found {
            files.push((
                format!("{}-weights.csv", own.part),
                weights::table(perceived),
            ));
        }
        if let Some(text) = weights::file_text(id, own, recording) {
            files.push((format!("{}-perceptual.toml", own.part), Ok(text.into())));
        }
    }
    for (name, content) in files {
        let path = dir.join(name);
        let bytes = content.map_err(|e| Failure::file(&path, &std::io::Error::other(e)))?;
        fs::write(&path, bytes).map_err(|e| Failure::file(&path, &e))?;
        let shown = path.display().to_string();
        console.say(format!("wrote {}", Untrusted(&shown)));
    }
    whole
}

/// What is weighed of the errors against a recording.
fn weigh(study: &Study, path: &Path, who: Include) -> Result<(Recording, Vec<Weighing>), Failure> {
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let shown = path.display().to_string();
    let mut recording =
        recording::read(shown.as_str(), BufReader::new(file)).map_err(Failure::input)?;
    let name = path.file_stem().unwrap_or(path.as_os_str());
    recording.name = name.to_string_lossy().into_owned();
    let Some((components, of)) = study.loaded.errors(&recording) else {
        return Err(Failure::input(format!(
            "{}: its force or its position varies too little to compare anything with it",
            Untrusted(&shown)
        ))
        .hint("take a recording of several strokes over the whole travel, in mm and N"));
    };
    let found = study.weigh(who, &Errors { components, of });
    match found.is_empty() {
        true => Err(
            Failure::input(weights::none(&study.loaded.protocol.study.id))
                .hint("`study new --kind pairs` and `study new --kind search` write such studies"),
        ),
        false => Ok((recording, found)),
    }
}
