//! The pages that people follow: every command is run and prints what the page says, every
//! command line can be typed, every link leads somewhere, every page is in the book.
//!
//! A block ```` ```console ```` has commands, each after `$ `, and below each what it prints: lines of
//! standard output and standard error as a terminal shows them. A line `…` stands for any lines,
//! `…` within a line for any text. All blocks of a page are run in order in one folder, which has
//! `protocols` and `tests` of the repository. Words after `console`, separated by commas:
//!
//! * `fails`: the commands of this block end with an error, which the page shows.
//! * `in-time`: the commands depend on a computer that is in time, and are tried up to five times.
//! * `to-the-end`: a session of this block is played to its end; otherwise it is left in its third trial.
//!
//! A command that ends with `&` runs until the page ends. A block with `save=FILE`, such as
//! ```` ```csv,save=own.csv ````, is written to that file. A number with a point that stands in the text as `` `0.25` ``
//! has to be in what the commands of the page print.
//!
//! Commands in ```` ```sh ```` are not run, because they need a device, a second person or hours; each has
//! to be one that the program accepts.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(unreachable_pub, reason = "modules of one test")]

mod book;
mod command_lines;
mod first_study;
mod markdown;
mod pages;
mod pictures;
mod recording;
mod screen_picture;
mod steps;
#[path = "../support/mod.rs"]
mod support;
