//! Every identifier that an analysis prints is explained in `docs/statistics*.md`.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use study_analysis::analyze::{Rules, analyze};
use study_session::outcome::ratings::Ratings;

/// The words in the documents' code spans, split at `/`, with `a_{b,c}` and `a/{b,c}`
/// expanded. A word that ends in `*` stands for all words with that prefix.
fn explained() -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let mut words = BTreeSet::new();
    for name in ["statistics", "statistics-mixed", "statistics-ordinal"] {
        let text = fs::read_to_string(root.join(format!("{name}.md"))).unwrap();
        // Every second piece is code, which may contain a line break.
        for code in text.split('`').skip(1).step_by(2) {
            let code: String = code.split_whitespace().collect();
            for whole in expanded(&code) {
                words.extend(whole.split(['/', ',']).map(str::to_owned));
            }
        }
    }
    words
}

fn expanded(code: &str) -> Vec<String> {
    let Some((before, rest)) = code.split_once('{') else {
        return vec![code.to_owned()];
    };
    let Some((inside, after)) = rest.split_once('}') else {
        return vec![code.to_owned()];
    };
    let one = |part: &str| expanded(&format!("{before}{part}{after}"));
    inside.split(',').flat_map(one).collect()
}

/// Whether a word is a name from the data: a realization, subject, pair, threshold or
/// repetition.
fn is_from_the_data(word: &str, ratings: &Ratings) -> bool {
    ratings.models.iter().any(|m| m.id == word)
        || ratings.subjects.iter().any(|s| s.id == word)
        || word.contains('|')
        || word.parse::<u32>().is_ok()
}

#[test]
fn every_identifier_is_in_the_documents() {
    let explained = explained();
    let known = |word: &str| {
        explained.contains(word)
            || explained.iter().any(|e| {
                e.strip_suffix('*')
                    .is_some_and(|stem| stem.len() > 3 && word.starts_with(stem))
            })
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/data");
    let mut unknown = BTreeSet::new();
    for set in ["sim_paper", "sim_one_rep", "nist_norris", "nist_numacc1"] {
        let file = File::open(root.join(set).join("data.csv")).unwrap();
        let ratings = Ratings::read_csv(set, BufReader::new(file), None).unwrap();
        let rules = Rules {
            realistic_from: Some(5.0),
            ..Rules::default()
        };
        for (id, _) in analyze(&ratings, &rules).values.iter() {
            // A realization's name may contain a slash; those of these data sets do not.
            let words = id.split('/').filter(|w| !is_from_the_data(w, &ratings));
            unknown.extend(words.filter(|w| !known(w)).map(|w| format!("{w} in {id}")));
        }
    }
    assert!(unknown.is_empty(), "{unknown:#?}");
}
