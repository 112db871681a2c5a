//! The answers of the report and the terminal page, also for unusual data.
#![allow(clippy::unwrap_used)]

use crate::report_support::{FIVE, analysis_of, golden, html, part, ratings, source, words};
use std::fmt::Write as _;
use study_analysis::analyze::{Analysis, Question, Rules, Verdict, analyze};
use study_report::Source;
use study_report::html::{Details, document};
use study_report::text::{Page, page};
use study_session::outcome::ratings::Ratings;
const WIDE: Page = Page {
    width: 100,
    color: false,
};

/// The terminal page on one line.
fn terminal(a: &Analysis) -> String {
    let text = page(&source(), a, WIDE);
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Nobody rates everything: each leaves out another realization.
fn incomplete() -> Analysis {
    let all = ratings(6, &FIVE, |s, m, k| 1.0 + ((m + s * k) % 4 + m) as f64);
    let kept = all.lines().filter(|l| {
        let mut cells = l.split(',');
        let (who, what) = (cells.next().unwrap(), cells.next().unwrap());
        let left_out = who.strip_prefix('S').and_then(|n| n.parse::<usize>().ok());
        left_out.is_none_or(|s| FIVE[s % 5].0 != what)
    });
    analysis_of(&kept.fold(String::new(), |csv, l| csv + l + "\n"))
}

#[test]
fn with_incomplete_tables_participants_are_compared_with_themselves() {
    let a = incomplete();
    assert!(a.values.number("rmanova/F").is_none());
    let f = a.values.number("within_clustered/F").unwrap();
    let text = words(&html(&a));
    for text in [text.clone(), terminal(&a)] {
        assert!(!text.contains("too few subjects rated both"), "{text}");
        assert!(
            text.contains("None of 6 participants rated every realization"),
            "{text}"
        );
        assert!(text.contains("t test within participants"), "{text}");
        assert!(text.contains(&format!(") = {f:.2}, p")), "{text}");
    }
    assert!(text.contains("Do the realizations differ?"));
    let methods = part(&text, "Methods ", "Results ");
    assert!(
        methods.contains("because only 0 of 6 participants rated every realization"),
        "{methods}"
    );
    let results = part(&text, "Results ", "Included and excluded");
    assert!(
        results.contains("(analysis of variance within participants, 6 participants)"),
        "{results}"
    );
}

#[test]
fn an_undefined_test_of_equivalence_gives_its_reason() {
    use study_plan::protocol::Role;
    // Everybody rates a one above the reference: no variance, no test.
    let text = "study,participant,session,row,trial,block,position,planned_position,model,role,\
         repetition,practice,pilot,simulated,protocol_version,realism,corrected,strokes,attempt,\
         status,vaf\n";
    let mut csv = text.to_owned();
    for s in 0..4 {
        for (i, (model, role, up)) in [
            ("a", "test", 1),
            ("b", "test", 0),
            ("R", "hidden-reference", 0),
        ]
        .iter()
        .enumerate()
        {
            let n = i + 1;
            let _ = writeln!(
                csv,
                "s,P{s},1,1,{n},1,{n},{n},{model},{role},1,false,false,false,1,{},false,9,1,ok,0.{n}",
                s + up + 1
            );
        }
    }
    let ratings = Ratings::read_csv("r.csv", csv.as_bytes(), None).unwrap();
    let rules = Rules {
        equivalence_margin: Some(0.5),
        ..Rules::default()
    };
    let a = analyze(&ratings, &rules);
    assert!(
        a.realizations
            .iter()
            .any(|m| m.role == Role::HiddenReference)
    );
    assert!(a.values.reason("reference/R/a/p_tost").is_some());
    for text in [words(&html(&a)), terminal(&a)] {
        assert!(!text.contains("margin was set"), "{text}");
        assert!(
            text.contains("Equivalence within ± 0.5 was not tested: "),
            "{text}"
        );
    }
    let without = analyze(&ratings, &Rules::default());
    assert!(terminal(&without).contains("No equivalence margin was set in advance"));
}

#[test]
fn linear_and_quadratic_terms_are_tested_at_half_the_level_and_jointly() {
    let mut csv = String::from("subject,model,rating,vaf,lambda\n");
    for s in 0..3 {
        for (m, lambda) in [0.9, 0.99, 0.999, 0.9999, 0.99999].iter().enumerate() {
            let rating = [2, 5, 6, 5, 3][m] + s % 2;
            let _ = writeln!(csv, "S{s},m{m},{rating},0.{},{lambda}", [3, 5, 9, 7, 4][m]);
        }
    }
    let a = analysis_of(&csv);
    let f = a
        .values
        .number("covariate/log10_memory/quadratic/F")
        .unwrap();
    for text in [words(&html(&a)), terminal(&a)] {
        assert!(text.contains("each at the level .025"), "{text}");
        assert!(text.contains(&format!("F(2, 2) = {f:.2}, p")), "{text}");
    }
    // A p between half the level and the level shows nothing.
    let p = ["p", "quadratic/p"].map(|id| {
        a.values
            .number(&format!("covariate/log10_memory/{id}"))
            .unwrap()
    });
    let smaller = p[0].min(p[1]);
    let ratings = Ratings::read_csv("r.csv", csv.as_bytes(), None).unwrap();
    for (alpha, verdict) in [
        (1.9 * smaller, Verdict::NotShown),
        (2.1 * smaller, Verdict::Yes),
    ] {
        let rules = Rules {
            alpha,
            ..Rules::default()
        };
        let a = analyze(&ratings, &rules);
        let found = a.finding(&Question::Memory).unwrap();
        assert_eq!(found.verdict, verdict, "{p:?} {alpha}");
        assert_eq!(found.test.as_ref().unwrap().level, alpha / 2.0);
    }
}

#[test]
fn the_methods_give_the_numbers_of_participants_and_realizations() {
    // d is in the table, but nobody rated it.
    let all = ratings(4, &FIVE[..3], |s, m, k| 1.0 + ((m + s * k) % 4 + m) as f64);
    let csv = all.clone() + "S1,d,1,,0.9\n";
    let a = analysis_of(&csv);
    let text = words(&html(&a));
    let methods = part(&text, "Methods ", "Results ");
    assert!(
        methods.contains("4 participants rated 3 of 4 realizations; nobody rated the others."),
        "{methods}"
    );
    let whole = analysis_of(&ratings(4, &FIVE[..3], |s, m, k| {
        1.0 + ((m + s * k) % 4 + m) as f64
    }));
    assert!(!html(&whole).contains("rated every realization; only they"));
    // One of twelve: few enough to be left out.
    let twelve = ratings(12, &FIVE[..3], |s, m, k| 1.0 + ((m + s * k) % 4 + m) as f64);
    let incomplete = analysis_of(&kept_of(&twelve, |l| !l.starts_with("S0,c")));
    let text = words(&html(&incomplete));
    assert!(
        text.contains(
            "Of the 12 participants, 11 rated every realization; only they are included in the analysis of variance"
        ),
        "{text}"
    );
    // One of four: they are compared with themselves.
    let incomplete = analysis_of(&kept_of(&all, |l| !l.starts_with("S0,c")));
    let text = words(&html(&incomplete));
    assert!(
        text.contains("3 rated every realization; only they are included in Friedman's test."),
        "{text}"
    );
    assert!(
        text.contains("(analysis of variance within participants, 4 participants)"),
        "{text}"
    );
}

/// Some lines of a table.
fn kept_of(csv: &str, keep: impl Fn(&str) -> bool) -> String {
    let kept = csv.lines().filter(|l| keep(l));
    kept.fold(String::new(), |csv, l| csv + l + "\n")
}

#[test]
fn a_single_participant_has_no_intervals() {
    let a = analysis_of(&ratings(1, &FIVE, |_, m, k| 1.0 + ((m * k) % 5) as f64));
    let text = words(&html(&a));
    assert!(!text.contains("t intervals over participants"), "{text}");
    assert!(!text.contains("95 % t interval of the mean"), "{text}");
    for text in [text, terminal(&a)] {
        assert!(text.contains("nly one participant is analyzed"), "{text}");
        assert!(text.contains("there is only one participant"), "{text}");
    }
    let two = analysis_of(&ratings(2, &FIVE, |s, m, k| 1.0 + ((m * k + s) % 5) as f64));
    assert!(words(&html(&two)).contains("t intervals over participants"));
    assert!(!terminal(&two).contains("nly one participant"));
}

#[test]
fn with_all_rows_excluded_nothing_is_reported() {
    use study_analysis::analyze::Exclusion;
    let constant = ratings(3, &FIVE, |s, _, _| 2.0 + s as f64);
    let ratings = Ratings::read_csv("data.csv", constant.as_bytes(), None).unwrap();
    let rules = Rules {
        exclude: vec![Exclusion::ConstantRater],
        ..Rules::default()
    };
    let a = analyze(&ratings, &rules);
    assert_eq!(a.counts.rated, 0);
    let study = Source {
        study: Some("s".to_owned()),
        ..source()
    };
    let page = words(&document(&study, &Details::default(), &a, &[]));
    assert!(!page.contains("r = –"), "{page}");
    assert!(page.contains("No rating is included: there is nothing to analyze."));
    for text in [page, terminal(&a)] {
        assert!(text.contains("there is nothing to analyze"), "{text}");
    }
}

#[test]
fn the_realization_that_alone_drives_r_is_named() {
    let a = analysis_of(&ratings(5, &FIVE, |s, m, _| {
        [3.0, 6.0][usize::from(m == 4)] + (s % 2) as f64
    }));
    for text in [words(&html(&a)), terminal(&a)] {
        let expected =
            "Without e all means are equal: the correlation is driven by this realization alone.";
        assert!(text.contains(expected), "{text}");
    }
    let other = analysis_of(&ratings(5, &FIVE, |s, m, _| (m + s % 2) as f64));
    assert!(!terminal(&other).contains("is driven by this"));
}

#[test]
fn realizations_that_differ_without_a_trend_are_warned_of() {
    let warned = |means: [f64; 5]| {
        let rated = |s: usize, m: usize, k: usize| means[m] + 0.1 * ((s + m * k) % 3) as f64;
        let a = analysis_of(&ratings(6, &FIVE, rated));
        assert_eq!(a.finding(&Question::Differ).unwrap().verdict, Verdict::Yes);
        terminal(&a).contains("look at the means, not only at the slope")
    };
    assert!(warned([2.0, 6.0, 3.0, 6.0, 2.0]));
    assert!(!warned([2.0, 3.0, 4.0, 5.0, 6.0]));
}

#[test]
fn the_terminal_shows_the_crossed_slope_the_critical_r_and_order_effects() {
    let csv = ratings(6, &FIVE, |s, m, k| {
        1.0 + ((m + s * k + m * k) % 4 + m) as f64
    });
    let mut n = 0;
    let with_order = csv.lines().fold(String::new(), |out, l| {
        n += 1;
        let last = match n {
            1 => "trial_index".to_owned(),
            n => (1 + (n * 7) % 10).to_string(),
        };
        format!("{out}{l},{last}\n")
    });
    let a = analysis_of(&with_order);
    let get = |id: &str| a.values.number(id).unwrap();
    let text = terminal(&a);
    for expected in [
        format!(
            "random effects of participants and realizations: b = {:.1}",
            get("lmm_vaf_crossed/slope") / 100.0
        ),
        format!(
            "requires |r| ≥ {}",
            format!("{:.3}", get("corr/pearson/critical_r")).trim_start_matches('0')
        ),
        "Do order and learning matter?".to_owned(),
        "points per trial, t(".to_owned(),
    ] {
        assert!(text.contains(&expected), "{expected}: {text}");
    }
    assert!(!terminal(&analysis_of(&csv)).contains("order and learning"));
}

#[test]
fn references_and_duplicates_have_tables_and_screening_columns() {
    let mut csv = "study,participant,session,row,trial,block,position,planned_position,model,role,\
         repetition,practice,pilot,simulated,protocol_version,realism,corrected,strokes,attempt,\
         status,vaf\n"
        .to_owned();
    let models = [
        ("a", "test", 2),
        ("b", "test", 5),
        ("c", "test", 2),
        ("R", "hidden-reference", 6),
        ("L", "low-anchor", 1),
    ];
    for s in 0..4 {
        for (i, (model, role, rating)) in models.iter().enumerate() {
            let n = i + 1;
            let rating = rating + (s * n) % 2;
            let _ = writeln!(
                csv,
                "s,P{s},1,1,{n},1,{n},{n},{model},{role},1,false,false,false,1,{rating},false,9,1,ok,0.5"
            );
        }
    }
    let mut ratings = Ratings::read_csv("r.csv", csv.as_bytes(), None).unwrap();
    ratings.set_duplicates([("c", "a")]);
    let a = analyze(&ratings, &Rules::default());
    let text = words(&html(&a));
    for expected in [
        "Differences from R (hidden reference)",
        "Differences from L (low anchor)",
        "Hidden duplicates minus their originals",
        "mean of the references mean of the anchors mean |difference| of duplicates",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    assert!(text.contains("; they differ, t(3) = "), "{text}");
    let d = a.values.number("reference/R/b/mean_diff").unwrap();
    let shown = format!("b 4 {d:.3}").replace('-', "−");
    assert!(
        part(&text, "Differences from R", "Differences from L").contains(&shown),
        "{text}"
    );
    let plain = words(&html(&analysis_of(&ratings_of_three())));
    for absent in [
        "mean of the references",
        "Differences from",
        "Hidden duplicates",
    ] {
        assert!(!plain.contains(absent), "{absent}");
    }
}

fn ratings_of_three() -> String {
    ratings(4, &FIVE[..3], |s, m, k| 1.0 + ((m + s * k) % 4 + m) as f64)
}

#[test]
fn a_foreign_table_has_no_words_about_the_paper_or_lambda() {
    let foreign = analysis_of(&ratings_of_three());
    let mut csv = String::from("subject,model,rating,vaf,lambda\n");
    for s in 0..4 {
        for (m, lambda) in [0.9, 0.99, 0.999, 0.9999].iter().enumerate() {
            let _ = writeln!(
                csv,
                "S{s},m{m},{},0.{},{lambda}",
                1 + (m * 2 + s) % 6,
                m + 2
            );
        }
    }
    let own = analysis_of(&csv);
    for word in [
        "Fig. 1",
        "validation recording",
        "λ",
        "lambda",
        "activeness",
    ] {
        for text in [words(&html(&foreign)), terminal(&foreign)] {
            assert!(!text.contains(word), "{word}: {text}");
        }
    }
    let text = words(&html(&own));
    for expected in [
        "as in Fig. 10 and 11 of Colton &amp; Hollerbach (World Haptics 2007)",
        "validation recording",
        "adjacent lambda",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn shared_vaf_explains_the_smallest_p() {
    let models = [("a", 0.7), ("b", 0.7), ("c", 0.8), ("d", 0.95)];
    let rate = |s: usize, m: usize, k: usize| 1.0 + ((m + s * k) % 4 + m) as f64;
    let a = analysis_of(&ratings(5, &models, rate));
    let b = analysis_of(&ratings(5, &FIVE, rate));
    for (a, tied) in [(&a, true), (&b, false)] {
        for text in [words(&html(a)), terminal(a)] {
            let mentioned = text.contains("Two realizations share a VAF with another");
            assert_eq!(mentioned, tied, "{text}");
        }
    }
}

#[test]
fn an_approximate_friedman_p_comes_with_iman_and_davenports() {
    let many = analysis_of(&ratings(30, &FIVE, |s, m, k| {
        1.0 + ((m + s * k + s * m) % 5 + m) as f64
    }));
    let few = analysis_of(&ratings_of_three());
    for (a, exact) in [(&many, false), (&few, true)] {
        assert_eq!(a.values.number("friedman/exact_p").is_some(), exact);
        for text in [words(&html(a)), terminal(a)] {
            let approximate = text.contains("by Iman and Davenport's F, p ");
            assert_eq!(approximate, !exact, "{text}");
        }
    }
}

#[test]
fn correlations_in_warnings_read_as_on_the_page() {
    let a = analysis_of(&ratings(5, &FIVE, |s, m, _| {
        [3.0, 2.0, 3.0, 2.0, 6.0][m] + (s % 2) as f64
    }));
    let hangs = a
        .warnings
        .iter()
        .find(|w| w.code == "one-realization")
        .unwrap();
    assert!(hangs.text.contains("between −."), "{}", hangs.text);
    assert!(!hangs.text.contains("0."), "{}", hangs.text);
}

#[test]
fn symbols_are_explained_only_where_they_occur() {
    let text = words(&html(&analysis_of(&ratings_of_three())));
    for letter in ["ε: ", "Generalized η²: ", "W: ", "α: ", "dz: "] {
        assert!(text.contains(letter), "{letter}: {text}");
    }
    assert!(text.contains("Shares are rounded"));
    let one = words(&html(&analysis_of(&ratings(1, &FIVE, |_, m, k| {
        1.0 + ((m * k) % 5) as f64
    }))));
    assert!(!one.contains("Generalized η²") && !one.contains("Shares are rounded"));
}

#[test]
fn page_and_terminal_give_the_same_verdicts() {
    let questions = [
        "Which realization is rated highest? ",
        "Does VAF predict the rating? ",
        "Does the best-rated realization differ from the second best? ",
        "Do the realizations differ? ",
        "Variance components ",
    ];
    for (path, a) in golden() {
        let (page, printed) = (words(&html(a)), terminal(a));
        for question in questions {
            let sentence = |text: &str| {
                let (_, rest) = text.split_once(question)?;
                Some(rest.split(". ").next()?.to_owned())
            };
            let (page, printed) = (sentence(&page), sentence(&printed));
            assert_eq!(page, printed, "{}: {question}", path.display());
        }
    }
}

/// A correlation of two points is always ±1 and says nothing.
#[test]
fn participants_are_not_screened_by_a_correlation_of_two_realizations() {
    let dashes = |models: usize| {
        let rate = |s: usize, m: usize, k: usize| (1 + (2 * s + 3 * m + k) % 7) as f64;
        let page = html(&analysis_of(&ratings(4, &FIVE[..models], rate)));
        let table = page.split_once("Screening of participants (").unwrap().1;
        table.split_once("</table>").unwrap().0.matches('–').count()
    };
    // Of four participants: the longest run, whose order is not known, and of two
    // realizations also r with the others and with VAF.
    assert_eq!((dashes(2), dashes(3)), (4 + 8, 4));
}
