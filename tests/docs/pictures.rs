//! The pictures of the pages, each made by the program.

use crate::support::repository;
use std::fs;

/// Compares a picture with the stored one; with `UPDATE_DOCS=1` stores it.
///
/// # Panics
/// If it is another one.
pub fn is_stored(path: &str, drawn: &str) {
    let file = repository(path);
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&file, drawn).unwrap();
    }
    let stored = fs::read_to_string(file).unwrap_or_default();
    let at = (drawn.lines().zip(stored.lines())).find(|(drawn, stored)| drawn != stored);
    assert!(
        drawn == stored,
        "{path} is another picture: UPDATE_DOCS=1 writes it; the first difference: {at:?}"
    );
}

/// Nothing lies beside the pictures that a page shows.
#[test]
fn every_picture_is_shown() {
    let mut shown = Vec::new();
    for path in crate::book::all_pages() {
        let links = crate::markdown::links(&crate::markdown::page(&path));
        shown.extend(links.into_iter().map(|(_, target)| target));
    }
    for entry in fs::read_dir(repository("docs/pictures")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let is_shown = shown
            .iter()
            .any(|target| *target == format!("pictures/{name}"));
        assert!(is_shown, "no page shows docs/pictures/{name}");
    }
}
