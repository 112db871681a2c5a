//! A whole study by keys, in lines and on the page: two people search, one of them on a computer that stops in the middle; a
//! second study confirms with six others what they found.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts_by_keys::{PROMPT, eventful, of, written_newest};
use crate::plain::{Lines, segments};
use crate::screen::Session;
use crate::support::player::play_to_end;
use crate::support::{Terminal, copy_folder, study};
use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;

/// The name of the space, which no sentence contains by accident; points are named after it.
const SPACE: &str = "XQZ-7";

/// What is on no page: the names of points, of axes, and of what a confirmation compares.
const SECRET: [&str; 4] = [SPACE, "friction", "detent", "static.toml"];

/// A study of one search in nine points, of which none is the table that is varied.
fn searching(folder: &Path) {
    let part = format!(
        r#"[[spaces]]
id = "{SPACE}"
from = "models/static.toml"
axes = {{ detent = [0.4, 1.2], friction = [0.0, 1.6] }}
grid = 3
[[parts]]
id = "answer"
kind = "search"
prompt = "{PROMPT}"
space = "{SPACE}"
rule = {{ name = "preference-gp", trials = 8, start = 4 }}
gap_s = 0.2
"#
    );
    written_newest(folder, &part);
}

/// How far a point is from what is liked best, the strongest detents without friction; no two points are equally far.
fn far(attempt: &Json, interval: usize) -> usize {
    let felt = attempt["intervals"][interval].as_str().unwrap();
    let number = felt.strip_prefix(SPACE).unwrap().strip_prefix('.').unwrap();
    let point: usize = number.parse::<usize>().unwrap() - 1;
    10 * (2 - point / 3) + 7 * (point % 3)
}

fn prefers_first(attempt: &Json) -> bool {
    far(attempt, 0) < far(attempt, 1)
}

/// The key of what is preferred, and the other one.
fn prefers(attempt: &Json) -> (String, String) {
    let (first, second) = ("1".to_owned(), "2".to_owned());
    match prefers_first(attempt) {
        true => (first, second),
        false => (second, first),
    }
}

/// The attempts of a participant at trials of the search, in their order.
fn attempts(folder: &Path, participant: &str) -> Vec<Json> {
    let journal = format!("results/p/sessions/{participant}/1/journal.jsonl");
    let events = segments(&folder.join(journal)).into_iter();
    events.filter(|e| of(e, "attempt_started")).collect()
}

/// The points that were compared, the lower number first, of the trials that have an answer.
fn compared(folder: &Path, participant: &str) -> Vec<[String; 2]> {
    let journal = format!("results/p/sessions/{participant}/1/journal.jsonl");
    let events = segments(&folder.join(journal));
    let done = events.iter().filter(|e| of(e, "trial_done"));
    done.map(|done| {
        let same = |e: &&Json| {
            of(e, "attempt_started")
                && e["trial"] == done["trial"]
                && e["attempt"] == done["attempt"]
        };
        let attempt = events.iter().find(same).unwrap();
        let name = |i: usize| attempt["intervals"][i].as_str().unwrap().to_owned();
        let mut pair = [name(0), name(1)];
        pair.sort();
        pair
    })
    .collect()
}

/// Answers on the page as the observer does, up to so many answers of this process or to the end. The pages as the browser got them.
fn search_on_page(session: &mut Session, folder: &Path, participant: &str, most: usize) -> String {
    let mut seen = String::new();
    let mut answered = 0;
    while answered < most {
        let asks = |page: &Json| page["questions"][0]["id"] == "answer" || page["over"] == true;
        let page = session.browser.play("a question or the end", asks);
        seen += &page.to_string();
        if page["over"] == true {
            break;
        }
        let attempt = attempts(folder, participant).pop().unwrap();
        let chosen = usize::from(!prefers_first(&attempt));
        let more = json!({"answers": {"answer": [chosen]}});
        let reply = session.browser.reply(&page, "answer", more);
        assert_eq!(session.browser.post("/reply", &reply).status, 200);
        answered += 1;
    }
    seen
}

fn is_blind(what: &str, pages: &str) {
    for secret in SECRET {
        assert!(!pages.contains(secret), "{secret} is shown: {what}");
    }
}

/// The second searcher: the computer stops after an answer, and two others go on from a copy of the folder each. They propose the
/// same pairs. The study goes on in `folder`.
fn second_searcher(folder: &Path) {
    let protocol = folder.join("p");
    let mut session = Session::opened_for("P02", folder, &protocol, &[]);
    let mut seen = search_on_page(&mut session, folder, "P02", 5);
    session.child.kill().unwrap();
    session.child.wait().unwrap();
    drop(session);
    let elsewhere = tempfile::tempdir().unwrap();
    copy_folder(folder, elsewhere.path());
    let mut all = Vec::new();
    for machine in [folder, elsewhere.path()] {
        let protocol = machine.join("p");
        let mut session = Session::opened_for("P02", machine, &protocol, &[]);
        seen += &search_on_page(&mut session, machine, "P02", usize::MAX);
        // The experimenter closes it.
        session.types("");
        assert!(session.child.wait().unwrap().success());
        let (code, out, err) = study(&["verify", "results"], machine);
        assert_eq!(code, 0, "{out}{err}");
        all.push(compared(machine, "P02"));
    }
    assert_eq!(all[0].len(), 8);
    assert_eq!(all[0], all[1], "two machines propose other pairs");
    is_blind("the page of a search", &seen);
}

/// The confirmation, with fewer trials.
fn confirming(folder: &Path) {
    let arguments = ["new", "c", "--from", "results", "--confirm"];
    let more = ["--include", "pilot", "--seed", "7"];
    let (code, out, err) = study(&[&arguments[..], &more[..]].concat(), folder);
    assert_eq!(code, 0, "{out}{err}");
    let path = folder.join("c/protocol.toml");
    let mut text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("searchers = [\"P01\", \"P02\"]"), "{text}");
    for (old, new) in [
        ("repetitions = 30", "repetitions = 4"),
        ("repetitions = 8", "repetitions = 2"),
        ("order_version = 2", "order_version = 2\nmax_attempts = 50"),
    ] {
        assert!(text.contains(old), "{old}: {text}");
        text = text.replacen(old, new, 1);
    }
    fs::write(&path, text).unwrap();
    // What the search found is the best point of the map of both.
    let explore = ["explore", "results", "--include", "pilot", "--out", "maps"];
    let (code, out, err) = study(&explore, folder);
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("2 participants: best at detent "), "{out}");
    assert!(out.contains("8 pairs"), "{out}");
    let maps = folder.join("maps/answer-points.csv");
    let mut table = csv::Reader::from_path(maps).unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3 * 9);
    let best = rows
        .iter()
        .find(|row| row[0].is_empty() && &row[8] == "true");
    let best = best.unwrap()[3].to_owned();
    let text = fs::read_to_string(&path).unwrap();
    assert!(
        text.contains(&format!("best = \"{best}\"")),
        "{best}: {text}"
    );
}

/// Two confirmers by keys, two in lines, two on the page.
fn confirmers(folder: &Path) {
    for participant in ["C01", "C02"] {
        let mut terminal = Terminal::hurried(&["run", "c", "--operator", "lw"], folder);
        let pages = play_to_end(&mut terminal, participant);
        is_blind("in the terminal", &pages.concat());
    }
    for participant in ["C03", "C04"] {
        let run = ["run", "c", "--plain", "--operator", "lw", "--participant"];
        let mut lines = Lines::hurried(folder, &[&run[..], &[participant]].concat());
        let end = lines.play(None);
        assert!(end.starts_with("The session is finished"), "{end}");
        lines.child.wait().unwrap();
        is_blind("in lines", &lines.seen);
    }
    for participant in ["C05", "C06"] {
        Session::opened_for(participant, folder, &folder.join("c"), &[]).finish();
    }
}

#[test]
fn two_search_and_six_confirm() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    searching(folder);
    // A bad trial, a correction, a quit and a resume.
    let rows = eventful(folder, prefers);
    assert_eq!(rows.len(), 8);
    second_searcher(folder);
    confirming(folder);

    // A searcher does not confirm.
    let mut terminal = Terminal::hurried(&["run", "c", "--operator", "lw"], folder);
    terminal.keys("P01");
    terminal.wait_for("took part in the search");
    terminal.signal("KILL");
    drop(terminal);
    assert!(!folder.join("results/p-confirmation/sessions/P01").exists());

    confirmers(folder);
    let confirmation = "results/p-confirmation";
    let (code, out, err) = study(&["verify", confirmation], folder);
    assert_eq!(code, 0, "{out}{err}");
    let analyze = ["analyze", confirmation, "--include", "pilot"];
    let (code, out, err) = study(&[&analyze[..], &["--json"]].concat(), folder);
    assert_eq!(code, 0, "{err}");
    let document: Json = serde_json::from_str(&out).unwrap();
    let [which, better] = [0usize, 1].map(|part| &document["parts"][part]);
    assert_eq!(
        (&which["task"], &which["trials"]),
        (&"abx".into(), &24.into())
    );
    assert_eq!(
        (&better["task"], &better["trials"]),
        (&"pairs".into(), &12.into())
    );
    let findings = which["findings"].as_array().unwrap();
    let told_apart = |finding: &Json| finding["question"] == "told-apart/abx";
    assert!(findings.iter().any(told_apart), "{which}");
    // Search and confirmation stay apart in words and pages.
    let (_, out, _) = study(&analyze, folder);
    let said = out.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in [
        "confirms, on participants who did not search, what the part answer of the study p found to be best: XQZ-7.",
        "PILOTS are among those who searched.",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let page = fs::read_to_string(folder.join(confirmation).join("analysis/report.html")).unwrap();
    assert!(page.contains("No answer of the search is in this analysis"));
}
