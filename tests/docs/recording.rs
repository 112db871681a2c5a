//! docs/tutorial-recording.md: beside its commands, its picture, and the pages that repeat them.

use crate::markdown::page;
use crate::pictures::is_stored;
use crate::steps::Shell;
use std::fs;

pub const PAGE: &str = "docs/tutorial-recording.md";
/// The file that the page has in place of the reader's own.
const EXAMPLE: &str = "cp tests/data/switches/";

#[test]
fn the_tutorial_says_what_its_commands_do() {
    let mut shell = Shell::new();
    shell.follow(&page(PAGE));
    let drawn = shell.folder().join("figures/force-displacement.svg");
    let drawn = fs::read_to_string(drawn).unwrap();
    is_stored("docs/pictures/recording-fit.svg", &drawn);
}

/// docs/identification.md has the tutorial's own commands, without the example's file.
#[test]
fn the_four_commands_are_the_same_everywhere() {
    let tutorial = page(PAGE);
    let lines = tutorial.blocks.iter().flat_map(|block| &block.lines);
    let commands = lines.filter_map(|line| line.strip_prefix("$ "));
    let own = commands.filter(|line| !line.starts_with(EXAMPLE));
    let four: Vec<&str> = own.take(4).collect();
    assert!(
        four[0].starts_with("cp -r ") && four[3].starts_with("study run "),
        "{four:?}"
    );
    let other = page("docs/identification.md");
    let same = (other.blocks.iter()).any(|block| block.lines.iter().eq(four.iter().copied()));
    assert!(
        same,
        "docs/identification.md has other commands than {four:#?}"
    );
}
