//! `study import table`: results of other programs as a table that `study analyze` reads.

use crate::cli::trajectory::{refuse_to_overwrite, write_file};
use crate::cli::{Console, Failure, Kind as FailureKind, console};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::import::{Grid, ImportError, Imported, Kind, Mapping, Taken, import};
use study_base::text::{Untrusted, counted};

/// Arguments of `study import table`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Result files of one experiment: CSV with commas, semicolons or tabs, or the JSON of jsPsych
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Write the table to this file, and its columns beside it
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,

    /// What a row is: ratings, or a task of `study analyze --task`
    #[arg(long = "as", value_name = "KIND", required_unless_present = "columns",
          value_parser = clap::builder::PossibleValuesParser::new(Kind::names()))]
    kind: Option<String>,

    /// Which column of the files is which, such as model=texture; @file is the file's name, @order the
    /// number of the trial. May be repeated
    #[arg(long, value_name = "COLUMN=THEIRS", value_parser = pair)]
    column: Vec<(String, String)>,

    /// Only rows with one of these cells, such as task=rating. May be repeated
    #[arg(long, value_name = "THEIRS=CELL,CELL", value_parser = pair)]
    rows: Vec<(String, String)>,

    /// What the cells of a column mean, such as answer:f=first,j=second. May be repeated
    #[arg(long, value_name = "COLUMN:THEIRS=OURS", value_parser = meanings)]
    words: Vec<(String, Vec<(String, String)>)>,

    /// Columns to copy, such as factors; without a column of realizations their combinations are those
    #[arg(long, value_name = "THEIRS,THEIRS", value_delimiter = ',')]
    keep: Vec<String>,

    /// Columns that each have the ratings of one realization: their names, or {model}_{repetition}
    #[arg(long, value_name = "THEIRS,THEIRS", value_delimiter = ',')]
    wide: Vec<String>,

    /// Read all this from a file that an earlier import wrote
    #[arg(long, value_name = "FILE", conflicts_with_all = ["kind", "column", "rows", "words", "keep", "wide"])]
    columns: Option<PathBuf>,

    /// Overwrite OUT and its columns if they exist
    #[arg(long)]
    force: bool,
}

/// Reads `a=b`.
fn pair(given: &str) -> Result<(String, String), String> {
    let parts = given.split_once('=');
    let parts = parts.filter(|(ours, theirs)| !ours.is_empty() && !theirs.is_empty());
    let (ours, theirs) = parts.ok_or_else(|| "expected NAME=VALUE".to_owned())?;
    Ok((ours.to_owned(), theirs.to_owned()))
}

/// Reads `answer:f=first,j=second`.
fn meanings(given: &str) -> Result<(String, Vec<(String, String)>), String> {
    let (column, words) = given
        .split_once(':')
        .ok_or_else(|| "expected COLUMN:THEIRS=OURS".to_owned())?;
    let words = words.split(',').map(pair).collect::<Result<_, _>>()?;
    Ok((column.to_owned(), words))
}

impl Args {
    /// What the options say of the columns.
    fn mapping(&self) -> Result<Mapping, Failure> {
        if let Some(path) = &self.columns {
            let text = fs::read_to_string(path).map_err(|e| Failure::file(path, &e))?;
            return toml::from_str(&text)
                .map_err(|e| Failure::input(format!("{}: {}", path.display(), e.message())));
        }
        let mut mapping = Mapping::new(self.kind.as_deref().unwrap_or_default());
        mapping.columns = self.column.iter().cloned().collect();
        mapping.keep.clone_from(&self.keep);
        mapping.wide.clone_from(&self.wide);
        for (column, cells) in &self.rows {
            let cells = cells.split(',').map(str::to_owned);
            mapping
                .rows
                .entry(column.clone())
                .or_default()
                .extend(cells);
        }
        for (column, words) in &self.words {
            mapping
                .words
                .entry(column.clone())
                .or_default()
                .extend(words.iter().cloned());
        }
        Ok(mapping)
    }
}

/// The file with the columns of an imported table.
fn beside(out: &Path) -> PathBuf {
    out.with_extension("columns.toml")
}

/// Reads the files and writes one table.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    refuse_to_overwrite(Some(&args.out), args.force)?;
    super::refuse_to_replace_an_input(&args.files, &args.out)?;
    let mapping = args.mapping()?;
    let (mut grids, mut known) = (Vec::new(), BTreeMap::new());
    for path in &args.files {
        let bytes = fs::read(path).map_err(|e| Failure::file(path, &e))?;
        let name = path.display().to_string();
        if let Some(before) = known.insert(study_base::hex::sha256(&bytes), name.clone()) {
            return Err(
                Failure::input(format!("{before} and {name} are the same file"))
                    .hint("give every file once; nothing was written"),
            );
        }
        grids.push(Grid::read(&name, &bytes).map_err(failure)?);
    }
    let imported = import(&grids, mapping).map_err(failure)?;
    let kept = match &args.columns {
        Some(_) => None,
        None => Some((beside(&args.out), columns(&imported.mapping)?)),
    };
    if let Some((path, text)) = &kept {
        let same = fs::read_to_string(path).is_ok_and(|old| old == *text);
        refuse_to_overwrite(Some(path), args.force || same)?;
    }
    for taken in &imported.files {
        console.say(in_words(taken));
    }
    console.say(found(&imported.mapping));
    for (person, first, second) in &imported.shared {
        console.say(format!(
            "warning: participant {} is in {} and in {}: if these are two people, give them different names",
            Untrusted(person),
            Untrusted(first),
            Untrusted(second)
        ));
    }
    write_file(&args.out, |sink| sink.write_all(imported.table.as_bytes()))?;
    console.say(written(&imported, &args.out));
    if let Some((path, text)) = &kept {
        write_file(path, |sink| sink.write_all(text.as_bytes()))?;
        console.say(format!("the columns are kept in {}", path.display()));
    }
    console.say(format!("next: {}", next(&imported.mapping, &args.out)));
    Ok(())
}

/// The errors of an import, with what to do.
fn failure(error: ImportError) -> Failure {
    let hint = match &error {
        ImportError::Asked { field, .. } => format!(
            "name it: --column {field}=NAME{}",
            match field.as_str() {
                "subject" | "participant" => {
                    format!("; --column {field}=@file takes it from the name of the file")
                }
                "model" =>
                    "; if each realization has a column of its own: --wide NAME,NAME".to_owned(),
                _ => String::new(),
            }
        ),
        ImportError::Cell { .. } => {
            "say what the cells mean (--words answer:f=first,j=second), or leave rows out by \
                                     what is in one of their columns (--rows task=rating)"
                .to_owned()
        }
        _ => return Failure::input(error),
    };
    Failure::input(error).hint(hint)
}

/// The file that keeps the columns.
fn columns(mapping: &Mapping) -> Result<String, Failure> {
    let text = toml::to_string(mapping).map_err(|e| Failure::new(FailureKind::Bug, e))?;
    Ok(format!(
        "# Which columns `study import table` read, and how. For more files of this experiment:\n\
         #     study import table FILE … --columns THIS -o OUT\n{text}"
    ))
}

/// One file.
fn in_words(taken: &Taken) -> String {
    let program = taken
        .program
        .map_or_else(String::new, |p| format!("{}, ", p.as_str()));
    let mut text = format!(
        "{}: {program}{}, {} taken",
        Untrusted(&taken.name),
        counted(taken.rows, "row", "rows"),
        taken.taken
    );
    for (n, what) in [
        (taken.unrated, "of them without a rating"),
        (taken.filtered, "left out by --rows"),
        (taken.others, "left out: not trials"),
    ] {
        if n > 0 {
            text += &format!(", {n} {what}");
        }
    }
    text
}

/// Which columns were read.
fn found(mapping: &Mapping) -> String {
    let columns = mapping.columns.iter();
    let columns = columns.map(|(ours, theirs)| format!("{ours} = {}", Untrusted(theirs)));
    format!("columns: {}", columns.collect::<Vec<_>>().join(", "))
}

fn written(imported: &Imported, out: &Path) -> String {
    let rows: usize = imported.files.iter().map(|taken| taken.taken).sum();
    let what = match imported.mapping.kind.as_str() {
        "ratings" => counted(rows, "rating", "ratings"),
        _ => counted(rows, "row", "rows"),
    };
    let people = counted(imported.participants, "participant", "participants");
    format!("wrote {what} of {people} to {}", out.display())
}

/// The analysis of the table.
fn next(mapping: &Mapping, out: &Path) -> String {
    let out = out.display().to_string();
    let words = match mapping.kind.as_str() {
        "ratings" => vec!["study", "analyze", &out],
        task => vec!["study", "analyze", &out, "--task", task],
    };
    let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    console::shell_command(&words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_pairs() {
        assert_eq!(
            pair("model=a=b"),
            Ok(("model".to_owned(), "a=b".to_owned()))
        );
        assert!(pair("model").is_err() && pair("=x").is_err() && pair("x=").is_err());
        let (column, words) = meanings("answer:f=first,j=second").unwrap();
        assert_eq!((column.as_str(), words.len()), ("answer", 2));
        assert!(meanings("answer").is_err() && meanings("answer:f").is_err());
    }

    #[test]
    fn what_is_kept_reads_as_it_was() {
        let mut mapping = Mapping::new("ratings");
        mapping.set("model", "a \"b\"").unwrap();
        mapping.rows.insert("task".to_owned(), vec!["x".to_owned()]);
        let text = columns(&mapping).unwrap();
        let read: Mapping = toml::from_str(&text).unwrap();
        assert_eq!(
            (&read.columns, &read.rows, &read.kind),
            (&mapping.columns, &mapping.rows, &mapping.kind)
        );
        assert!(text.contains("format = \"study-columns/1\""), "{text}");
    }
}
