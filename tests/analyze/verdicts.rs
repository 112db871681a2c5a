//! The same verdict wherever it is printed, in a thousand random designs.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::report_support::{Numbers, Printed, analysis_of, p_of, sentence};
use rayon::prelude::*;
use serde_json::Value as Json;
use std::fmt::Write as _;
use study_analysis::analyze::{Finding, Rules, all_findings, analyze};
use study_session::outcome::ratings::Ratings;

fn verdict_of(sentence: &str) -> &'static str {
    let words = [
        ("Yes", "yes"),
        ("Not shown", "not shown"),
        ("Cannot be determined", "undefined"),
    ];
    let found = words.iter().find(|(word, _)| sentence.starts_with(word));
    found.unwrap_or_else(|| panic!("no verdict: {sentence}")).1
}

/// Question, its heading, and its words in the results paragraph: yes, not shown,
/// undefined.
const PRINTED: [(&str, &str, [&str; 3]); 7] = [
    (
        "vaf",
        "Does VAF predict the rating? ",
        [
            "with a higher VAF were rated",
            "A relation with VAF was not shown",
            "Whether VAF predicts the rating cannot be determined",
        ],
    ),
    (
        "best",
        "Does the best-rated realization differ from the second best? ",
        [
            " differed from the second best",
            "not shown",
            "Whether the best-rated realization differs from the second best cannot be determined",
        ],
    ),
    (
        "differ",
        "Do the realizations differ? ",
        [
            "The realizations differed",
            "A difference between the realizations was not shown",
            "Whether the realizations differ cannot be determined",
        ],
    ),
    (
        "pairs",
        "Which pairs of realizations differ? ",
        [
            "These pairs of realizations differed",
            "No pair of realizations was shown to differ",
            "Which pairs of realizations differ cannot be determined",
        ],
    ),
    (
        "disagreement",
        "Do participants disagree about the realizations? ",
        [
            "Participants disagreed about the realizations",
            "A disagreement of participants about the realizations was not shown",
            "Whether participants disagree about the realizations cannot be determined",
        ],
    ),
    (
        "order",
        "Do order and learning matter? ",
        [
            "Ratings changed over the session",
            "A change of the ratings over the session was not shown",
            "Whether ratings change over the session cannot be determined",
        ],
    ),
    (
        "carry-over",
        "Does a rating depend on the one before it? ",
        [
            "Ratings depended on the ones before them",
            "A dependence of ratings on the ones before them was not shown",
            "Whether ratings depend on the ones before them cannot be determined",
        ],
    ),
];

/// A design: complete or not, tiny or not, tied or not, with two realizations or thirty.
fn random_design(seed: u64) -> String {
    let mut random = Numbers::new(1000 + seed);
    let participants = 1 + random.below(10);
    let realizations = match random.below(12) {
        0 => 1,
        1..=3 => 2,
        4 => 9 + random.below(3),
        5 if seed.is_multiple_of(10) => 30,
        _ => 3 + random.below(4),
    };
    let repetitions = 1 + random.below(3);
    let missing = [0, 0, 10, 40][random.below(4)];
    let steps = [0, 1, 2, 7][random.below(4)];
    let effect = [0.0, 0.3, 1.5][random.below(3)];
    let noise = [0.0, 0.7, 0.7][random.below(3)];
    let vaf = random.below(4);
    let camps = random.below(4) == 0;
    let mut csv = "subject,model,repetition,rating,vaf,trial_index\n".to_owned();
    for s in 0..participants {
        let level = random.normal();
        let mut trial = 0;
        for k in 1..=repetitions {
            for m in 0..realizations {
                trial += 1;
                if random.below(100) < missing {
                    continue;
                }
                let turn = if camps && s % 2 == 1 { -1.0 } else { 1.0 };
                let raw = 4.0 + level + turn * effect * m as f64 + noise * random.normal();
                let rating = match steps {
                    0 => raw,
                    steps => raw.round().clamp(1.0, f64::from(steps)),
                };
                let vaf = match vaf {
                    0 => String::new(),
                    1 => (m % 2).to_string(),
                    _ => format!("0.{}", 70 + 10 * m % 29),
                };
                let _ = writeln!(
                    csv,
                    "S{s:02},m{m:02},{k},{rating},{vaf},{}",
                    1 + (trial * 7) % 101
                );
            }
        }
    }
    csv
}

fn check_design(seed: u64) {
    let csv = random_design(seed);
    if csv.lines().count() < 2 {
        return;
    }
    let a = analysis_of(&csv);
    let printed = Printed::of(&a);
    let (answers, results) = printed.sections();
    let findings = printed.json["findings"].as_array().unwrap();
    for (id, heading, [yes, not_shown, undefined]) in PRINTED {
        let found = findings.iter().find(|f| f["question"] == id);
        let said = [printed.terminal.as_str(), answers].map(|text| sentence(text, heading));
        let Some(found) = found else {
            assert_eq!(said, [None, None], "design {seed}: {id} is answered");
            continue;
        };
        let verdict = found["verdict"].as_str().unwrap();
        for sentence in said {
            let sentence =
                sentence.unwrap_or_else(|| panic!("design {seed}: {id} is not answered"));
            assert_eq!(
                verdict_of(&sentence),
                verdict,
                "design {seed}: {id}: {sentence}"
            );
            if let (Some(p), true) = (p_of(&sentence), verdict != "undefined") {
                assert_eq!(
                    p <= 0.05,
                    verdict == "yes",
                    "design {seed}: {id}: {sentence}"
                );
            }
        }
        let value = &printed.json["values"][format!("finding/{id}/verdict")];
        let expected = match verdict {
            "yes" => Json::from(1.0),
            "not shown" => Json::from(0.0),
            _ => Json::Null,
        };
        assert_eq!(*value, expected, "design {seed}: {id}");
        let words = match verdict {
            "yes" => yes,
            "not shown" => not_shown,
            _ => undefined,
        };
        assert!(
            results.contains(words),
            "design {seed}: {id}: {verdict}: {results}"
        );
        for other in [yes, undefined].into_iter().filter(|w| *w != words) {
            assert!(
                !results.contains(other),
                "design {seed}: {id}: {verdict}: {results}"
            );
        }
    }
}

/// Calibration uses the findings without the rest of the analysis.
#[test]
fn findings_alone_are_those_of_the_analysis() {
    (0..200u64).into_par_iter().for_each(|seed| {
        let csv = random_design(seed);
        let ratings = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
        let whole = analyze(&ratings, &Rules::default());
        let (findings, _) = all_findings(&ratings, &Rules::default());
        let decided = |all: &[Finding]| -> Vec<_> {
            let one = |f: &Finding| (f.question.clone(), f.verdict.clone(), f.test.clone());
            all.iter().map(one).collect()
        };
        assert_eq!(
            decided(&findings),
            decided(&whole.findings),
            "design {seed}"
        );
    });
}

#[test]
fn all_renderers_give_the_same_verdicts_in_a_thousand_designs() {
    (0..1000u64).into_par_iter().for_each(check_design);
}
