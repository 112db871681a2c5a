//! docs/tutorial-recording.md, command by command: each is run, and prints what the page says.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{play_until, quit};
use crate::support::{Terminal, repository};
use std::fs;
use std::path::Path;
use std::process::Command;

const PAGE: &str = "docs/tutorial-recording.md";
/// Stands for lines of the output that the page leaves out.
const LEFT_OUT: &str = "…";
/// The file that the page has in place of the reader's own.
const EXAMPLE: &str = "cp tests/data/switches/";

/// A fenced block: its language and its lines.
type Block = (String, Vec<String>);

fn blocks(page: &str) -> Vec<Block> {
    let text = fs::read_to_string(repository(page)).unwrap();
    let mut found: Vec<Block> = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        match (line.strip_prefix("```"), inside) {
            (Some(language), false) => found.push((language.to_owned(), Vec::new())),
            (Some(_), true) => {}
            (None, true) => found.last_mut().unwrap().1.push(line.to_owned()),
            (None, false) => continue,
        }
        if line.starts_with("```") {
            inside = !inside;
        }
    }
    assert!(!inside, "{page}: a block does not end");
    found
}

/// The commands of the blocks, one a line.
fn commands(blocks: &[Block]) -> Vec<String> {
    let shell = blocks.iter().filter(|(language, _)| language == "sh");
    shell.flat_map(|(_, lines)| lines.iter().cloned()).collect()
}

/// Plays a few trials in a terminal, and leaves.
fn session(command: &str, folder: &Path) {
    let arguments: Vec<&str> = command.split(' ').skip(1).collect();
    let mut terminal = Terminal::hurried(&arguments, folder);
    let seen = play_until(&mut terminal, "P01", "trial 3 of").concat();
    assert!(seen.contains("How much did it feel like a key?"), "{seen}");
    quit(&mut terminal);
}

/// What a command prints, standard output before standard error.
fn run(command: &str, folder: &Path) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_study")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut shell = Command::new("sh");
    shell
        .args(["-c", command])
        .current_dir(folder)
        .env("PATH", path);
    let output = shell.output().unwrap();
    let [out, told] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{command}: {out}{told}");
    out + &told
}

/// Checks that the lines are those that were printed, in their order; lines that were left out are marked.
fn compare(shown: &[String], printed: &str, command: &str) {
    let printed: Vec<&str> = printed.lines().map(str::trim_end).collect();
    let mut at = 0;
    let mut skips = false;
    for line in shown {
        if line == LEFT_OUT {
            skips = true;
            continue;
        }
        let rest = &printed[at..];
        let found = match skips {
            true => rest.iter().position(|other| other == line),
            false => (rest.first() == Some(&line.as_str())).then_some(0),
        };
        let Some(found) = found else {
            panic!(
                "{command}: {PAGE} has\n{line}\nbut it printed\n{}",
                printed.join("\n")
            );
        };
        at += found + 1;
        skips = false;
    }
    assert!(
        skips || at == printed.len(),
        "{command}: {PAGE} ends before\n{}",
        printed[at..].join("\n")
    );
}

#[test]
fn the_tutorial_says_what_its_commands_do() {
    let home = tempfile::tempdir().unwrap();
    for part in ["protocols", "tests"] {
        std::os::unix::fs::symlink(repository(part), home.path().join(part)).unwrap();
    }
    let blocks = blocks(PAGE);
    let mut printed = (String::new(), String::new());
    let (mut commands, mut outputs) = (0, 0);
    for (language, lines) in &blocks {
        match language.as_str() {
            "sh" => {
                printed = (lines.join("; "), String::new());
                for command in lines {
                    commands += 1;
                    match command.starts_with("study run ") {
                        true => session(command, home.path()),
                        false => printed.1 += &run(command, home.path()),
                    }
                }
            }
            "text" => {
                outputs += 1;
                compare(lines, &printed.1, &printed.0);
            }
            other => panic!("{PAGE}: a block is neither commands nor output: {other}"),
        }
    }
    assert!(
        commands >= 8 && outputs >= 4,
        "{commands} commands, {outputs} outputs"
    );
    let drawn = home.path().join("figures/force-displacement.svg");
    let picture = repository("docs/tutorial-recording.svg");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::copy(&drawn, &picture).unwrap();
    }
    assert!(
        fs::read(drawn).unwrap() == fs::read(picture).unwrap(),
        "the picture is another one: UPDATE_DOCS=1 writes it"
    );
}

/// README and docs/identification.md have the tutorial's own commands, without the example's file.
#[test]
fn the_four_commands_are_the_same_everywhere() {
    let all = commands(&blocks(PAGE));
    let own: Vec<&String> = all
        .iter()
        .filter(|line| !line.starts_with(EXAMPLE))
        .collect();
    let four = &own[..4];
    assert!(
        four[0].starts_with("cp -r ") && four[3].starts_with("study run "),
        "{four:?}"
    );
    for page in ["README.md", "docs/identification.md"] {
        let found = blocks(page);
        let same = found
            .iter()
            .any(|(_, lines)| lines.iter().eq(four.iter().copied()));
        assert!(same, "{page} has other commands than {four:#?}");
    }
}
