//! `study schema`: the JSON Schema of the protocol file, for editors.

use super::{Console, Failure};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_base::text::{Untrusted, escaped_json};
use study_plan::protocol::file::MAX_FILE_BYTES;
use study_plan::protocol::schema::{TITLE, json_schema};
use study_session::store::disk::read_capped;

/// The file of the schema, beside a protocol.
pub(super) const FILE_NAME: &str = "protocol.schema.json";

/// The comment by which an editor finds the schema of a TOML file: one of those before the first key. Taplo,
/// and the editors that use it (Even Better TOML of Visual Studio Code, Helix, Zed, …), follow it.
const DIRECTIVE: &str = "#:schema ";

/// Arguments of `study schema`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Write the schema beside this protocol, and name it in the protocol's first line
    #[arg(long, value_name = "PROTOCOL")]
    install: Option<PathBuf>,
}

/// Runs `study schema`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    match &args.install {
        None => console.document(document()),
        Some(protocol) => install(protocol, console),
    }
}

/// The text of the schema.
pub(super) fn document() -> String {
    escaped_json(&format!("{:#}\n", json_schema()))
}

/// The lines before the first key of a protocol, and the rest.
fn head(text: &str) -> (Vec<&str>, &str) {
    let is_head = |line: &&str| line.trim().is_empty() || line.trim_start().starts_with('#');
    let lines: Vec<&str> = text.split_inclusive('\n').take_while(is_head).collect();
    let length = lines.iter().map(|line| line.len()).sum();
    (lines, &text[length..])
}

/// The schema that a line of the head names.
fn named_by(line: &str) -> Option<&str> {
    Some(line.trim().strip_prefix(DIRECTIVE)?.trim())
}

/// The schema that a protocol names before its first key.
fn named(text: &str) -> Option<&str> {
    let (lines, _) = head(text.trim_start_matches('\u{feff}'));
    lines.into_iter().find_map(named_by)
}

/// A protocol whose first line names the schema beside it, and no other line another one.
pub(super) fn with_schema(text: &str) -> String {
    let (lines, rest) = head(text.trim_start_matches('\u{feff}'));
    let mut text = format!("{DIRECTIVE}{FILE_NAME}\n");
    text.extend(lines.into_iter().filter(|line| named_by(line).is_none()));
    text + rest
}

/// Writes the schema beside a protocol, which then names it. A schema that it names already stays.
fn install(path: &Path, console: &mut Console) -> Result<(), Failure> {
    let protocol = match path.is_dir() {
        true => path.join(load::FILE_NAME),
        false => path.to_owned(),
    };
    let bytes = read_capped(&protocol, MAX_FILE_BYTES).map_err(|e| {
        Failure::input(format!("{}: {e}", protocol.display()))
            .hint("PROTOCOL is a protocol.toml or the folder that contains it")
    })?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|_| Failure::input(format!("{}: it is not UTF-8", protocol.display())))?;
    let schema = protocol.with_file_name(FILE_NAME);
    refuse_unless_schema(&schema)?;
    super::power::replace(&schema, document().as_bytes())?;
    let (schema, shown) = (schema.display().to_string(), protocol.display().to_string());
    let (schema, shown) = (Untrusted(&schema), Untrusted(&shown));
    let mut told = format!("wrote {schema}\n");
    match named(text) {
        None => {
            super::power::replace(&protocol, with_schema(text).as_bytes())?;
            told += &format!("{shown} names it in its first line\n");
        }
        Some(name) if name.trim_start_matches("./") == FILE_NAME => {
            told += &format!("{shown} names it already\n");
        }
        Some(other) => {
            told += &format!(
                "{shown} names another schema, {}, and was left as it is\n",
                Untrusted(other)
            );
        }
    }
    console.out(told)
}

/// An earlier schema is replaced, and nothing else is.
fn refuse_unless_schema(path: &Path) -> Result<(), Failure> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(Failure::file(path, &e)),
    };
    let found: Option<serde_json::Value> = serde_json::from_slice(&bytes).ok();
    if found.is_some_and(|found| found["title"] == TITLE) {
        return Ok(());
    }
    Err(
        Failure::input(format!("{}: this is another file", path.display()))
            .hint("move it away: only an earlier schema is replaced"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schema_is_named_before_the_first_key() {
        for (text, found) in [
            ("#:schema a.json\nformat = 1\n", Some("a.json")),
            ("# x\n\n  #:schema  a.json \r\nformat = 1\n", Some("a.json")),
            ("\u{feff}#:schema a.json\n", Some("a.json")),
            ("format = 1\n#:schema a.json\n", None),
            ("# about #:schema a.json\n", None),
            ("#:schemas a.json\n", None),
            ("", None),
        ] {
            assert_eq!(named(text), found, "{text:?}");
        }
    }

    #[test]
    fn one_line_names_the_schema() {
        let first = "#:schema protocol.schema.json\n";
        assert_eq!(with_schema(""), first);
        assert_eq!(
            with_schema("\u{feff}# x\nformat = 1\n"),
            format!("{first}# x\nformat = 1\n")
        );
        let other = "# x\n#:schema https://example.org/a.json\nformat = 1\n";
        assert_eq!(with_schema(other), format!("{first}# x\nformat = 1\n"));
        let later = "format = 1\nx = \"\"\"\n#:schema a.json\n\"\"\"\n";
        assert_eq!(with_schema(later), format!("{first}{later}"));
        let once = with_schema("format = 1");
        assert_eq!(with_schema(&once), once);
    }
}
