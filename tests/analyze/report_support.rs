//! Analyses to be reported, and what the reports say in plain words.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(missing_docs, unreachable_pub, clippy::unwrap_used)]

use serde_json::Value as Json;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use study_analysis::analyze::{Analysis, Rules, analyze};
use study_base::rng::Stream;
use study_report::Source;
use study_report::figures;
use study_report::html::{Details, document};
use study_report::json;
use study_report::text::{Page, page};
use study_session::outcome::ratings::Ratings;

pub fn source() -> Source {
    Source {
        title: "A study".to_owned(),
        study: None,
        protocol_version: None,
        path: "data.csv".to_owned(),
        ..Source::default()
    }
}

pub fn analysis_of(csv: &str) -> Analysis {
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    analyze(&ratings, &Rules::default())
}

/// Read once for all tests.
pub fn golden() -> &'static [(PathBuf, Analysis)] {
    static SETS: OnceLock<Vec<(PathBuf, Analysis)>> = OnceLock::new();
    SETS.get_or_init(read_golden)
}

pub fn read_golden() -> Vec<(PathBuf, Analysis)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/data");
    let sets = fs::read_dir(root).unwrap();
    let mut sets: Vec<PathBuf> = sets.map(|e| e.unwrap().path().join("data.csv")).collect();
    // What takes long unoptimized has no sentence that others have not.
    sets.retain(|p| p.exists() && fs::metadata(p).unwrap().len() < 20_000);
    sets.sort();
    assert!(sets.len() > 8, "the data sets were not found");
    let read = |p: PathBuf| {
        let a = analysis_of(&fs::read_to_string(&p).unwrap());
        (p, a)
    };
    sets.into_iter().map(read).collect()
}

pub fn html(a: &Analysis) -> String {
    document(&source(), &Details::default(), a, &figures::all(a, &[]))
}

/// The words of a page, without tags, pictures and style.
pub fn words(page: &str) -> String {
    let mut text = String::new();
    let mut rest = page;
    while let Some(at) = rest.find('<') {
        text.push_str(&rest[..at]);
        text.push(' ');
        let from = &rest[at..];
        let skip = ["style", "svg"].iter().find_map(|t| {
            let open = from.starts_with(&format!("<{t}"));
            let end = format!("</{t}>");
            open.then(|| from.find(&end).map(|e| e + end.len()))?
        });
        let end = skip.unwrap_or_else(|| from.find('>').unwrap() + 1);
        rest = &from[end..];
    }
    text.push_str(rest);
    let text = text.replace("&lt;", "<").replace("&gt;", ">");
    let text = text.replace('\u{a0}', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What stands between two headings.
pub fn part<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
    let start = text.find(from).map_or(text.len(), |at| at + from.len());
    let end = text[start..].find(to).map_or(text.len(), |at| start + at);
    &text[start..end]
}

pub fn ratings(
    subjects: usize,
    models: &[(&str, f64)],
    rate: impl Fn(usize, usize, usize) -> f64,
) -> String {
    let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
    for s in 0..subjects {
        for (m, (name, vaf)) in models.iter().enumerate() {
            for k in 1..=2 {
                let _ = writeln!(csv, "S{s},{name},{k},{},{vaf}", rate(s, m, k));
            }
        }
    }
    csv
}

pub const FIVE: [(&str, f64); 5] = [("a", 0.7), ("b", 0.75), ("c", 0.8), ("d", 0.85), ("e", 0.9)];

/// Random numbers of a design.
pub struct Numbers(Stream);

impl Numbers {
    pub fn new(seed: u64) -> Self {
        Self(Stream::new(seed, &["findings"]))
    }

    pub fn below(&mut self, n: u64) -> usize {
        self.0.below(n) as usize
    }

    pub fn normal(&mut self) -> f64 {
        self.0.normal()
    }
}

/// Everything that is printed about an analysis, with single spaces.
pub struct Printed {
    pub terminal: String,
    pub html: String,
    pub json: Json,
}

impl Printed {
    pub fn of(a: &Analysis) -> Self {
        let wide = Page {
            width: 100,
            color: false,
        };
        let terminal = page(&source(), a, wide);
        Self {
            terminal: terminal.split_whitespace().collect::<Vec<_>>().join(" "),
            html: words(&document(&source(), &Details::default(), a, &[])),
            json: serde_json::from_str(&json::document(&source(), a)).unwrap(),
        }
    }

    /// The answers and the results paragraph of the report.
    pub fn sections(&self) -> (&str, &str) {
        let answers = part(&self.html, "Answers", "For the paper");
        let paper = part(&self.html, "For the paper", "Included and excluded");
        (
            answers,
            part(paper, " Results ", "For these realizations only"),
        )
    }

    /// Terminal page and answers of the report have these words.
    pub fn answers(&self, words: &[&str]) {
        for text in [&self.terminal, self.sections().0] {
            for word in words {
                assert!(text.contains(word), "{word}: {text}");
            }
        }
    }

    /// The results paragraph of the report has these words.
    pub fn paper(&self, words: &str) {
        let (_, results) = self.sections();
        assert!(results.contains(words), "{words}: {results}");
    }

    /// Neither terminal page nor report has one of these words.
    pub fn nowhere(&self, words: &[&str]) {
        for text in [&self.terminal, &self.html] {
            let found = words.iter().find(|word| text.contains(**word));
            assert_eq!(found, None, "{text}");
        }
    }
}

/// The sentence after a question.
pub fn sentence(text: &str, question: &str) -> Option<String> {
    let (_, rest) = text.split_once(question)?;
    Some(rest.split(". ").next()?.to_owned())
}

/// The first p of a sentence; the bound of `p < .001`.
pub fn p_of(sentence: &str) -> Option<f64> {
    let (_, rest) = sentence
        .split_once("p = ")
        .or_else(|| sentence.split_once("p < "))?;
    let digits = rest
        .split(|c: char| !c.is_ascii_digit() && c != '.')
        .next()?;
    digits.trim_end_matches('.').parse().ok()
}
