//! The report, read: its sentences agree with the numbers, with each other and with
//! the rules of grammar, and say nothing that was not done.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::report_support::{FIVE, analysis_of, golden, html, part, ratings, source, words};
use std::fmt::Write as _;
use study_analysis::analyze::{Question, TestKind, Value};
use study_report::text::{Page, page};
#[test]
fn counts_and_nouns_agree_and_empty_phrases_are_absent() {
    for (path, a) in golden() {
        let text = words(&html(a))
            + &page(
                &source(),
                a,
                Page {
                    width: 80,
                    color: false,
                },
            );
        let nouns = [
            "participants",
            "subjects",
            "realizations",
            "ratings",
            "rows",
            "pairs",
        ];
        for noun in nouns {
            for bad in [
                format!(" 1 {noun} "),
                format!(" 1 {noun}."),
                format!(" 0 {noun}"),
            ] {
                assert!(!text.contains(&bad), "{}: `{bad}`", path.display());
            }
        }
        for bad in [" ,", "..", "( ", "()", " – – ", "  "] {
            let prose = part(&text, "For the paper", "Included and excluded");
            assert!(
                !prose.contains(bad),
                "{}: `{bad}` in {prose}",
                path.display()
            );
        }
    }
}

#[test]
fn methods_and_results_hold_no_number_that_the_analysis_does_not() {
    for (path, a) in golden() {
        let mut known: Vec<f64> = Vec::new();
        for (_, value) in a.values.iter() {
            match value {
                Value::Number(x) => known.push(*x),
                Value::List(x) => known.extend(x),
                Value::Undefined(_) => {}
            }
        }
        let get = |id: &str| a.values.number(&format!("rmanova/{id}"));
        if let (Some(e), Some(one), Some(two)) = (get("eps_gg"), get("df1"), get("df2")) {
            known.extend([e * one, e * two]);
        }
        for (id, value) in a.values.iter() {
            // Slopes are given per .01 of VAF.
            let slope = id.starts_with("lmm_vaf") && id.contains("slope");
            if let (true, Value::Number(x)) = (slope || id == "clmm_vaf_crossed/beta/vaf", value) {
                known.push(x / 100.0);
            }
        }
        let text = words(&html(a));
        let answers = part(&text, "</h2>", "Figures");
        let results = part(&text, "Results ", "Included and excluded").to_owned();
        let mut said = format!("{answers} {results}");
        let mut names: Vec<&str> = a.realizations.iter().map(|m| m.id.as_str()).collect();
        names.sort_by_key(|n| std::cmp::Reverse(n.len()));
        for name in names {
            said = said
                .replace(&format!("{name} "), " ")
                .replace(&format!("{name},"), " ");
        }
        // Bounds and names of methods.
        for fixed in ["p < .001", "p > .999", ".05", ".025", ".01 of VAF"] {
            said = said.replace(fixed, " ");
        }
        let number = |c: char| c.is_ascii_digit() || c == '.' || c == '−' || c == 'e';
        let mut checked = 0;
        for word in said.split(|c: char| !number(c)) {
            let word = word.trim_end_matches('.');
            let Some(point) = word.find('.') else {
                continue;
            };
            let Ok(x) = word.replace('−', "-").parse::<f64>() else {
                continue;
            };
            if word.contains('e') {
                continue;
            }
            let half = 0.5 * 10f64.powi(-((word.len() - point - 1) as i32));
            let close = |v: &f64| (v - x).abs() <= half * (1.0 + 1e-6) || (v + x).abs() <= half;
            assert!(
                known.iter().any(close),
                "{}: {word} in {said}",
                path.display()
            );
            checked += 1;
        }
        if a.values.number("corr/pearson/r").is_some() {
            assert!(checked > 8, "{}: {checked}", path.display());
        }
    }
}

#[test]
fn the_methods_name_exactly_the_tests_that_were_done() {
    for (path, a) in golden() {
        let text = words(&html(a));
        let methods = part(&text, "Methods ", "The level of significance");
        let defined = |start: &str, end: &str| {
            a.values.iter().any(|(id, v)| {
                id.starts_with(start) && id.ends_with(end) && matches!(v, Value::Number(_))
            })
        };
        let decided = |question| Some(a.finding(&question)?.test.as_ref()?.kind);
        for (word, done) in [
            ("Wilcoxon", defined("posthoc/", "/p_wilcoxon_exact")),
            ("Friedman", defined("friedman/chi2", "")),
            (
                "Greenhouse",
                decided(Question::Differ) == Some(TestKind::AnovaGreenhouseGeisser),
            ),
            ("Pearson", defined("corr/pearson/r", "")),
            (
                "all permutations",
                decided(Question::Vaf) == Some(TestKind::PermutationExact),
            ),
            (
                "random permutations",
                decided(Question::Vaf) == Some(TestKind::PermutationMonteCarlo),
            ),
            (
                "generalized least squares",
                decided(Question::Vaf) == Some(TestKind::WeightedTrend),
            ),
            (
                "mixed model of the ratings on VAF",
                defined("lmm_vaf_crossed/slope", ""),
            ),
            (
                "analysis of variance of all cell means",
                decided(Question::Differ) == Some(TestKind::WithinParticipants),
            ),
        ] {
            let told = methods.contains(word);
            assert_eq!(told, done, "{}: {word}: {methods}", path.display());
        }
    }
}

#[test]
fn a_singular_fit_is_attributed_to_the_right_variance() {
    // Subjects do not differ in their means, realizations do beyond VAF.
    let beyond = [0.0, 1.0, 0.0, 1.5, 1.0];
    let csv = ratings(6, &FIVE, |s, m, k| {
        2.0 + beyond[m] + ((7 * s + 13 * m + 29 * k + s * m * k) % 5 % 3) as f64
    });
    let a = analysis_of(&csv);
    assert_eq!(a.values.number("lmm_vaf_crossed/singular"), Some(1.0));
    assert!(a.values.number("lmm_vaf_crossed/var_model").unwrap() > 0.01);
    let text = words(&html(&a));
    assert!(
        !text.contains("no variance between realizations is left"),
        "{text}"
    );
    assert!(
        text.contains("Another variance component is estimated as 0"),
        "{text}"
    );
    for (path, a) in golden() {
        let said = html(a).contains("no variance between realizations is left");
        let none = a.values.number("lmm_vaf_crossed/var_model") == Some(0.0);
        assert_eq!(said, none, "{}", path.display());
    }
}

#[test]
fn tied_means_are_reported_where_they_limit_p() {
    // Four realizations alike, the one with the lowest VAF lower.
    let csv = ratings(
        5,
        &FIVE,
        |s, m, _| if m == 0 { 3.0 } else { 5.0 } + (s % 2) as f64,
    );
    let a = analysis_of(&csv);
    assert_eq!(a.values.number("corr/pearson/p_exact_two_sided"), Some(0.4));
    let text = words(&html(&a));
    assert!(text.contains("Four of the 5 means are tied"), "{text}");
    assert!(!text.contains("The best-rated realization is"), "{text}");
    assert!(
        text.contains("Four realizations share the highest mean"),
        "{text}"
    );
    let told = page(
        &source(),
        &a,
        Page {
            width: 100,
            color: false,
        },
    );
    assert!(told.contains("Four of the 5 means are tied"), "{told}");
}

#[test]
fn a_monte_carlo_p_has_its_own_lower_bound() {
    let names: Vec<String> = (0..12).map(|m| format!("m{m:02}")).collect();
    let models: Vec<(&str, f64)> = (names.iter().enumerate())
        .map(|(m, n)| (n.as_str(), 0.5 + 0.01 * (m * m) as f64))
        .collect();
    let a = analysis_of(&ratings(4, &models, |s, m, k| {
        1.0 + ((m + 2 * s + k) % 7) as f64
    }));
    assert!(
        a.values
            .number("corr/pearson/p_monte_carlo_two_sided")
            .is_some()
    );
    for text in [
        words(&html(&a)),
        page(
            &source(),
            &a,
            Page {
                width: 100,
                color: false,
            },
        ),
    ] {
        assert!(text.contains("1/10000"), "{text}");
        assert!(!text.contains("479001600"), "{text}");
    }
    let text = words(&html(&a));
    let ranks = part(&text, "Rank correlations:", "Leaving out");
    assert_eq!(ranks.matches("permutation p").count(), 2, "{ranks}");
    assert!(
        text.contains("Above 8 realizations only the one with the highest mean is compared"),
        "{text}"
    );
}

#[test]
fn a_bar_in_a_name_does_not_split_a_pair() {
    let csv = ratings(6, &[("x|y", 0.7), ("z", 0.8)], |s, m, k| {
        ((s * (m + 1) + k) % 5) as f64
    });
    let text = words(&html(&analysis_of(&csv)));
    assert!(text.contains("x|y − z"), "{text}");
    assert!(!text.contains("x − y"), "{text}");
}

#[test]
fn three_columns_give_a_report_without_a_word_of_vaf() {
    let mut csv = "subject,model,rating\n".to_owned();
    for s in 0..6 {
        for (m, name) in ["a", "b", "c"].iter().enumerate() {
            let _ = writeln!(csv, "S{s},{name},{}", 1 + (2 * s + 3 * m) % 7);
        }
    }
    let a = analysis_of(&csv);
    let text = words(&html(&a));
    assert!(!part(&text, "Answers", "Tables").contains("VAF"), "{text}");
    assert!(part(&text, "Methods ", "Results").starts_with("6 participants rated 3 realizations."));
}

/// Wilcoxon's exact test with Holm's correction over 45 pairs cannot give a p below .05 for
/// eight participants, however clear the differences.
#[test]
fn pairs_can_be_shown_to_differ_in_a_design_of_eight_by_ten() {
    let names: Vec<String> = (0..10).map(|m| format!("m{m}")).collect();
    let models: Vec<(&str, f64)> = names.iter().map(|n| (n.as_str(), 0.5)).collect();
    let a = analysis_of(&ratings(8, &models, |s, m, k| (m + (s + m * k) % 3) as f64));
    let text = words(&html(&a));
    let found = part(
        &text,
        "Which pairs of realizations differ?",
        "Do participants",
    );
    assert!(found.contains("Yes: "), "{found}");
    assert!(found.contains(" above m"), "{found}");
}

#[test]
fn headings_are_in_order_and_tables_have_heads() {
    for (path, a) in golden() {
        let page = html(a);
        let levels: Vec<u32> = (page.match_indices("<h"))
            .filter_map(|(at, _)| page[at + 2..].chars().next()?.to_digit(10))
            .collect();
        assert_eq!(levels[0], 1);
        assert!(
            levels.windows(2).all(|w| w[1] <= w[0] + 1),
            "{}",
            path.display()
        );
        for (at, _) in page.match_indices("<th") {
            let tag = page[at..].split('>').next().unwrap();
            let other = tag.starts_with("<thead");
            assert!(
                other || tag.contains("scope=\"col\""),
                "{}: {tag}",
                path.display()
            );
            let head = &page[at..at + page[at..].find("</th").unwrap()];
            assert!(other || !head.ends_with('>'), "{}: {head}", path.display());
        }
    }
}

#[test]
fn the_terminal_page_is_bounded() {
    let names: Vec<String> = (0..300).map(|m| format!("m{m:03}")).collect();
    let models: Vec<(&str, f64)> = names.iter().map(|n| (n.as_str(), 0.5)).collect();
    let a = analysis_of(&ratings(2, &models, |_, m, k| 1.0 + ((m + k) % 3) as f64));
    let told = page(
        &source(),
        &a,
        Page {
            width: 80,
            color: false,
        },
    );
    assert!(told.lines().count() < 150, "{}", told.lines().count());
    assert!(
        told.contains("260 realizations are not shown here"),
        "{told}"
    );
    assert!(told.lines().all(|l| l.chars().count() <= 80), "{told}");
}
