//! The pages as a book: docs/SUMMARY.md has all of them, and links lead somewhere.

use crate::markdown::{anchors, links, page};
use crate::support::repository;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// The table of contents, in the format of mdBook.
const SUMMARY: &str = "docs/SUMMARY.md";

/// Markdown files of a folder of the repository.
fn in_folder(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(repository(folder)).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> = names
        .filter(|name| name.ends_with(".md"))
        .map(|name| match folder {
            "." => name,
            _ => format!("{folder}/{name}"),
        })
        .collect();
    pages.sort();
    pages
}

/// All pages for people, but the table of contents.
pub fn all_pages() -> Vec<String> {
    let folders = [
        ".",
        "docs",
        "bridges",
        "clients",
        "firmware",
        "firmware/c",
        "dist",
        "lab",
    ];
    let folders = folders
        .into_iter()
        .filter(|f| Path::new(&repository(f)).exists());
    let pages = folders.flat_map(in_folder);
    pages.filter(|path| path != SUMMARY).collect()
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                normal.pop();
            }
            Component::CurDir => {}
            other => normal.push(other),
        }
    }
    normal
}

/// What is wrong with the link of a page, if anything is.
fn broken(from: &str, target: &str) -> Option<String> {
    if ["http://", "https://", "mailto:"]
        .iter()
        .any(|scheme| target.starts_with(scheme))
    {
        return None;
    }
    let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
    let file = match path {
        "" => PathBuf::from(from),
        _ => normal(&Path::new(from).parent().unwrap().join(path)),
    };
    if !Path::new(&repository(file.to_str().unwrap())).exists() {
        return Some(format!("{target}: there is no such file"));
    }
    let is_page = file.extension().is_some_and(|e| e == "md");
    if anchor.is_empty() || !is_page {
        return None;
    }
    let found = anchors(&page(file.to_str().unwrap()));
    (!found.iter().any(|a| a == anchor)).then(|| format!("{target}: there is no such heading"))
}

#[test]
fn every_link_leads_somewhere() {
    let mut faults = Vec::new();
    let mut followed = 0;
    for path in all_pages().into_iter().chain([SUMMARY.to_owned()]) {
        for (line, target) in links(&page(&path)) {
            followed += 1;
            faults.extend(broken(&path, &target).map(|f| format!("{path}:{line}: {f}")));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(followed > 100, "only {followed} links");
}

#[test]
fn a_broken_link_is_found() {
    assert_eq!(broken("README.md", "docs/wire.md"), None);
    assert_eq!(broken("docs/wire.md", "../README.md#start"), None);
    for target in ["docs/wires.md", "docs/wire.md#nowhere", "#nowhere"] {
        assert!(broken("README.md", target).is_some(), "{target}");
    }
}

/// The book has every page of docs/ once, and no other.
#[test]
fn the_book_has_every_page() {
    let summary = page(SUMMARY);
    let chapters: Vec<String> = links(&summary).into_iter().map(|(_, t)| t).collect();
    let pages = in_folder("docs").into_iter();
    let pages: BTreeSet<String> = pages
        .filter_map(|path| path.strip_prefix("docs/").map(str::to_owned))
        .filter(|path| path != "SUMMARY.md")
        .collect();
    let once: BTreeSet<String> = chapters.iter().cloned().collect();
    assert_eq!(once.len(), chapters.len(), "a chapter is there twice");
    assert_eq!(once, pages);
    let parts: Vec<&str> = (summary.prose.iter())
        .filter_map(|(_, line)| line.strip_prefix("# "))
        .collect();
    let four = ["Tutorials", "How-to guides", "Reference", "Explanation"];
    assert!(four.iter().all(|part| parts.contains(part)), "{parts:?}");
    let book = fs::read_to_string(repository("book.toml")).unwrap();
    assert!(book.contains("src = \"docs\""), "{book}");
}

/// A release has one version.
#[test]
fn the_version_is_the_same_everywhere() {
    let version = env!("CARGO_PKG_VERSION");
    for (path, line) in [
        ("Cargo.toml", format!("version = \"{version}\"")),
        ("CITATION.cff", format!("version: {version}")),
    ] {
        let text = fs::read_to_string(repository(path)).unwrap();
        assert!(text.lines().any(|l| l == line), "{path} has no `{line}`");
    }
}
