//! A whole session of ranking in a pseudo-terminal, by keys alone.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts_by_keys::{models, written_newest};
use crate::support::player::{enter, play};
use crate::support::{Terminal, study};
use serde_json::Value as Json;
use std::path::Path;
use std::time::Duration;

/// A study of one ranking of three.
fn ranking(folder: &Path) {
    let part = format!(
        r#"{}[[parts]]
id = "answer"
kind = "ranking"
prompt = "Which rank has number {{n}}?"
first = "best"
last = "worst"
models = ["l9991", "l9995", "l9999"]
repetitions = 2
gap_s = 0.2
"#,
        models()
    );
    written_newest(folder, &part);
}

/// Chooses a rank and confirms it.
fn give(terminal: &mut Terminal, rank: usize) {
    terminal.keys(&rank.to_string());
    let chosen = format!("┃{rank}┃");
    terminal.wait_until("the rank to be chosen", |s| {
        s.replace(' ', "").contains(&chosen) && s.contains("Enter: ")
    });
    enter(terminal);
}

/// Each rank on a page of its own; one that was given before is refused, and the page says why.
#[test]
fn ranking_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    ranking(folder.path());
    let mut terminal = Terminal::hurried(&["run", "p", "--operator", "lw"], folder.path());
    let mut refused = false;
    while terminal.runs() {
        let shown = terminal.shown();
        let asks = |n: &usize| shown.text.contains(&format!("Which rank has number {n}?"));
        let asked = (1..=3).find(asks);
        match asked.filter(|_| shown.text.contains("Enter: save")) {
            Some(2) if !refused => {
                give(&mut terminal, 1);
                terminal.wait_for("1 is given already.");
                refused = true;
            }
            Some(n) => {
                give(&mut terminal, n);
                let asked = format!("number {n}?");
                terminal.wait_until("the next page", |s| !s.contains(&asked));
            }
            None => {
                play(&mut terminal, "P01", &shown);
            }
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    assert!(refused);
    assert_eq!(terminal.exit_code(), 0);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let mut table = csv::Reader::from_path(folder.path().join("results/p/ratings.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let columns = ["answer", "answer-2", "answer-3"].map(at);
    for row in table.records() {
        let row = row.unwrap();
        assert_eq!(columns.map(|at| row[at].to_owned()), ["1", "2", "3"]);
    }
    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (_, out, _) = study(&arguments, folder.path());
    let document: Json = serde_json::from_str(&out).unwrap();
    let part = &document["parts"][0];
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"ranking".into(), &2.into())
    );
    assert_eq!(part["values"]["ranking/n"], 2.0);
    let alike = &part["findings"][0];
    assert_eq!(alike["question"], "ranked-alike");
    assert_eq!(alike["undefined_because"], "there is one participant");
}
