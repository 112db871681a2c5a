//! Commands that no test runs: the program accepts each of them.

use crate::book::all_pages;
use crate::markdown::{Block, page};
use clap::CommandFactory as _;
use study::cli::Cli;

/// The command lines of a block, without comments, in one line each.
fn command_lines(block: &Block) -> Vec<String> {
    let text = block.lines.join("\n").replace("\\\n", " ");
    let lines = text.lines().map(|line| {
        let line = line.split(" #").next().unwrap_or(line);
        line.trim().to_owned()
    });
    lines.filter(|line| line.starts_with("study ")).collect()
}

#[test]
fn the_program_accepts_every_command_of_the_pages() {
    let mut tried = 0;
    for path in all_pages() {
        let page = page(&path);
        for block in page.blocks.iter().filter(|b| b.language() == "sh") {
            for line in command_lines(block) {
                tried += 1;
                let words = shell_words::split(&line)
                    .unwrap_or_else(|e| panic!("{path}:{}: {line}: {e}", block.line));
                // A shell makes several files of a pattern.
                let words = (words.into_iter())
                    .flat_map(|word| vec![word.clone(); 1 + usize::from(word.contains('*'))]);
                let parsed = Cli::command().try_get_matches_from(words);
                let fine = parsed.as_ref().err().is_none_or(|e| !e.use_stderr());
                assert!(
                    fine,
                    "{path}:{}: {line}\n{}",
                    block.line,
                    parsed.unwrap_err()
                );
            }
        }
    }
    assert!(tried > 40, "only {tried} commands");
}

#[test]
fn a_wrong_option_is_found() {
    let page = crate::markdown::parse(
        "p",
        "```sh\nstudy check x \\\n  --nonsense   # why\nls\n```\n",
    );
    let lines = command_lines(&page.blocks[0]);
    assert_eq!(lines, ["study check x    --nonsense"]);
    let words = shell_words::split(&lines[0]).unwrap();
    assert!(Cli::command().try_get_matches_from(words).is_err());
}
