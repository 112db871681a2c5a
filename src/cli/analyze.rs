//! `study analyze`

use super::{Console, Failure, results};
use crate::analyze::{Analysis, Include, Rules, Warning, analyze};
use crate::outcome::ratings::Ratings;
use crate::outcome::{ParticipantRow, RatingRow};
use crate::protocol::Protocol;
use crate::report::text::{Page, comments, page};
use crate::report::{Source, csv, json};
use crate::store::StudyFolder;
use crate::text::QuestionId;
use std::fs::{self, File};
use std::io::{BufReader, Write as _};
use std::path::{Path, PathBuf};

/// Arguments of `study analyze`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder, one study in it, or a CSV: subject,model,repetition,rating,vaf[,trial_index]
    results: PathBuf,
    /// Print one JSON document, numbers unrounded, and nothing else
    #[arg(long)]
    json: bool,
    /// Write the tables here (default for a study: its analysis/)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Analyse another question than the protocol's primary one
    #[arg(long, value_name = "ID")]
    question: Option<String>,
    /// Count these beside the participants
    #[arg(long, value_name = "WHO", value_delimiter = ',')]
    include: Vec<Who>,
    /// Print the comments by realization
    #[arg(long, conflicts_with = "json")]
    comments: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Who {
    Pilot,
    Simulated,
}

/// Does it.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    if args.results.is_file() {
        let (source, analysis) = of_csv(args)?;
        return show(args, &source, &analysis, args.out.as_deref(), console);
    }
    let studies = results::studies(&args.results)?;
    if args.json && studies.len() > 1 {
        return Err(Failure::input(format!(
            "{}: {} studies, and --json prints one",
            args.results.display(),
            studies.len()
        ))
        .hint(format!("name one, such as {}", studies[0].path().display())));
    }
    let several = studies.len() > 1;
    for (i, study) in studies.iter().enumerate() {
        if i > 0 {
            console.out(format!("\n{}\n\n", "─".repeat(60)))?;
        }
        let (source, mut analysis) = of_study(study, args)?;
        let damage = results::warn(study, console)?.into_iter();
        let code = "damaged-results";
        analysis
            .warnings
            .extend(damage.map(|text| Warning { code, text }));
        let folder = study.path();
        let out = match &args.out {
            Some(out) if several => Some(out.join(folder.file_name().unwrap_or_default())),
            Some(out) => Some(out.clone()),
            None if args.json => None,
            None => Some(folder.join("analysis")),
        };
        show(args, &source, &analysis, out.as_deref(), console)?;
    }
    Ok(())
}

fn show(
    args: &Args,
    source: &Source,
    analysis: &Analysis,
    out: Option<&Path>,
    console: &mut Console,
) -> Result<(), Failure> {
    let written = out.map(|dir| (dir, write_tables(dir, &csv::tables(source, analysis))));
    let written = match written {
        // Where the user wants the tables they have to go.
        Some((_, Err(failure))) if args.out.is_some() => return Err(failure),
        other => other,
    };
    if args.json {
        return console.out(json::document(source, analysis));
    }
    let set = Page {
        width: console.width,
        colour: console.colour,
    };
    if args.comments {
        console.out(comments(analysis, set))?;
    } else {
        console.out(page(source, analysis, set))?;
    }
    match written {
        Some((dir, Ok(()))) => console.say(format!("tables: {}", dir.display())),
        Some((_, Err(failure))) => results::tables_unwritten(&failure, console),
        None => {}
    }
    Ok(())
}

fn include(args: &Args) -> Include {
    Include {
        pilot: args.include.contains(&Who::Pilot),
        simulated: args.include.contains(&Who::Simulated),
    }
}

/// Somebody else's ratings, or our own table without its study.
fn of_csv(args: &Args) -> Result<(Source, Analysis), Failure> {
    let path = &args.results;
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let name = path.display().to_string();
    let ratings = Ratings::read_csv(&name, BufReader::new(file), args.question.as_deref())
        .map_err(Failure::input)?;
    let rules = Rules {
        include: include(args),
        ..Rules::default()
    };
    let title = path.file_name().unwrap_or_default().to_string_lossy();
    let source = Source {
        title: title.into_owned(),
        study: None,
        protocol_version: None,
        path: name,
    };
    Ok((source, analyze(&ratings, &rules)))
}

/// What a study's folder gives to the analysis.
struct StudyInput {
    protocol: Protocol,
    protocol_version: u32,
    rows: Vec<RatingRow>,
    participants: Vec<ParticipantRow>,
}

fn of_study(study: &StudyFolder, args: &Args) -> Result<(Source, Analysis), Failure> {
    let input = study_input(study)?;
    let question = question(&input.protocol, args.question.as_deref())?;
    let mut ratings = Ratings::from_rows(&input.rows, &question);
    ratings.set_states(&input.participants);
    ratings.set_duplicates(input.protocol.models.iter().filter_map(|m| {
        let original = m.duplicate_of.as_ref()?;
        Some((m.id.as_str(), original.as_str()))
    }));
    let rules = Rules::of(&input.protocol, question.as_str(), include(args));
    let source = Source {
        title: input.protocol.study.title.clone(),
        study: Some(input.protocol.study.id.clone()),
        protocol_version: Some(input.protocol_version),
        path: study.path().display().to_string(),
    };
    Ok((source, analyze(&ratings, &rules)))
}

/// The question that was asked for, or the primary one; it has to give numbers.
fn question(protocol: &Protocol, asked: Option<&str>) -> Result<QuestionId, Failure> {
    use crate::protocol::QuestionKind as K;
    let id = match asked {
        None => protocol.analysis.primary.clone(),
        Some(id) => QuestionId::new(id).map_err(Failure::input)?,
    };
    let numeric: Vec<&str> = protocol
        .questions
        .iter()
        .filter(|q| {
            matches!(
                q.kind,
                K::Rating { .. } | K::Slider { .. } | K::Number { .. }
            )
        })
        .map(|q| q.id.as_str())
        .collect();
    if numeric.contains(&id.as_str()) {
        Ok(id)
    } else {
        Err(
            Failure::input(format!("no question `{id}` that is answered with a number"))
                .hint(format!("there is: {}", numeric.join(", "))),
        )
    }
}

/// The rows of a study, by the newest version of its protocol. The VAF may stand
/// in the model files only: they are opened too.
fn study_input(study: &StudyFolder) -> Result<StudyInput, Failure> {
    let protocol = results::frozen(study)?.protocol;
    let derived = study.derive(&protocol)?;
    Ok(StudyInput {
        protocol,
        protocol_version: study.version(),
        rows: derived.rows,
        participants: derived.participants,
    })
}

/// Each file as a whole or not at all.
fn write_tables(dir: &Path, tables: &[csv::Table]) -> Result<(), Failure> {
    fs::create_dir_all(dir).map_err(|e| Failure::file(dir, &e))?;
    for table in tables {
        let path = dir.join(table.name);
        let part = dir.join(format!(".{}.{}.part", table.name, std::process::id()));
        let written = File::create(&part).and_then(|mut file| {
            file.write_all(table.content.as_bytes())?;
            file.sync_data()?;
            fs::rename(&part, &path)
        });
        if let Err(e) = written {
            // What is left of it is of no use; the first error is the one to tell.
            let _ = fs::remove_file(&part);
            return Err(Failure::file(&path, &e));
        }
    }
    Ok(())
}
