//! Findings: the right verdict in every design.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::report_support::{Numbers, Printed, analysis_of, p_of, sentence, source};
use rayon::prelude::*;
use std::fmt::Write as _;
use study_analysis::analyze::findings::Direction;
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{
    Analysis, Finding, Include, Question, Rules, TestKind, Verdict, analyze,
};
use study_session::outcome::ratings::Ratings;

pub(crate) fn rating_table(
    rows: &[(usize, usize, usize, f64)],
    vaf: impl Fn(usize) -> Option<f64>,
) -> String {
    let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
    for (s, m, k, rating) in rows {
        let vaf = vaf(*m).map_or_else(String::new, |v| v.to_string());
        let _ = writeln!(csv, "S{s:02},m{m:02},{k},{rating},{vaf}");
    }
    csv
}

pub(crate) fn finding(a: &Analysis, question: Question) -> &Finding {
    a.finding(&question).unwrap()
}

pub(crate) fn kind(a: &Analysis, question: Question) -> TestKind {
    finding(a, question).test.as_ref().unwrap().kind
}

/// Eight lenient participants rate m0 to m4 and eight severe ones m2 to m6; each
/// realization is better than the one before.
fn lenient_and_severe() -> Analysis {
    let mut random = Numbers::new(1);
    let mut rows = Vec::new();
    for s in 0..16 {
        let (first, level) = if s < 8 { (0, 7.0) } else { (2, 2.0) };
        for m in first..first + 5 {
            for k in 1..=2 {
                let rating = level + 0.5 * m as f64 + 0.4 * random.normal();
                rows.push((s, m, k, (rating * 100.0).round() / 100.0));
            }
        }
    }
    analysis_of(&rating_table(&rows, |m| Some(0.7 + 0.03 * m as f64)))
}

#[test]
fn who_rated_which_realization_does_not_turn_the_result_round() {
    let a = lenient_and_severe();
    assert!(a.values.number("corr/pearson/r").unwrap() < -0.7);
    let f = finding(&a, Question::Vaf);
    assert_eq!(
        (&f.verdict, f.direction),
        (&Verdict::Yes, Some(Direction::Up))
    );
    assert_eq!((f.participants, f.realizations), (16, 7));
    assert_eq!(a.ranked()[0].1, "m06");
    assert!(a.warnings.iter().any(|w| w.code == "raw-and-adjusted"));
    let printed = Printed::of(&a);
    printed.answers(&[
        "higher VAF are rated higher",
        "The best-rated realization is m06, adjusted mean",
        "Participants did not all rate the same realizations",
    ]);
    printed.paper("Realizations with a higher VAF were rated higher");
    printed.nowhere(&["are rated lower", "were rated lower"]);
    assert_eq!(printed.json["values"]["finding/vaf/verdict"], 1.0);
}

/// Two participants rank four realizations alike: no variance of error, so no F; Friedman's
/// exact test has p = 1/4! and decides, while its χ² approximation would not reject.
#[test]
fn two_participants_and_four_realizations_have_one_verdict() {
    let rows: Vec<_> = (0..2)
        .flat_map(|s| (0..4).map(move |m| (s, m, 1, m as f64 + 1.0)))
        .collect();
    let a = analysis_of(&rating_table(&rows, |m| Some(0.7 + 0.05 * m as f64)));
    assert!(a.values.number("friedman/p").unwrap() > 0.05);
    let f = finding(&a, Question::Differ);
    assert_eq!(f.verdict, Verdict::Yes);
    let test = f.test.as_ref().unwrap();
    assert_eq!(test.kind, TestKind::FriedmanExact);
    assert!((test.p - 1.0 / 24.0).abs() < 1e-12);
    let printed = Printed::of(&a);
    printed.answers(&[
        "Do the realizations differ? Yes, χ²(3, N = 2) = 6.00, p = .042 (Friedman's test, exact, 2 participants).",
    ]);
    printed.paper("The realizations differed, χ²(3, N = 2) = 6.00, p = .042");
}

/// Nobody rates everything, participants disagree, and nothing differs on average: a model
/// without the interaction rejects in a quarter of such studies.
#[test]
fn with_nobody_complete_the_verdict_keeps_its_level() {
    let studies = 300;
    let yes: usize = (0..studies)
        .into_par_iter()
        .map(|seed| {
            let mut random = Numbers::new(seed);
            let mut rows = Vec::new();
            for s in 0..12 {
                let level = random.normal();
                for m in (0..5).filter(|m| s % 5 != *m) {
                    let cell = level + 0.8 * random.normal();
                    for k in 1..=3 {
                        rows.push((s, m, k, cell + 0.6 * random.normal()));
                    }
                }
            }
            let a = analysis_of(&rating_table(&rows, |_| None));
            assert_eq!(kind(&a, Question::Differ), TestKind::WithinParticipants);
            usize::from(finding(&a, Question::Differ).is_yes())
        })
        .sum();
    // Binomial: 15 ± 3 · 3.8 of 300 at the level .05.
    assert!((4..=26).contains(&yes), "{yes} of {studies}");
}

/// Two realizations are equally good and three are far below: the case in which the second
/// best is most often taken for worse. With a clear best the answer is yes.
#[test]
fn the_best_is_named_at_its_level_and_found_where_it_is_better() {
    let yes = |better: f64, studies: u64| -> usize {
        let study = |seed| {
            let mut random = Numbers::new(seed);
            let mut rows = Vec::new();
            for s in 0..10 {
                let level = random.normal();
                for (m, mean) in [better, 0.0, -3.0, -3.0, -3.0].into_iter().enumerate() {
                    rows.push((s, m, 1, level + mean + 0.7 * random.normal()));
                }
            }
            let a = analysis_of(&rating_table(&rows, |_| None));
            usize::from(finding(&a, Question::Best).is_yes())
        };
        (0..studies).into_par_iter().map(study).sum()
    };
    // Binomial: 15 ± 3 · 3.8 of 300 at the level .05.
    let wrong = yes(0.0, 300);
    assert!((4..=26).contains(&wrong), "{wrong} of 300");
    // Paired t of 10 differences, mean 1.3 · √10 / (.7 · √2) = 4.15: power .96 (R: power.t.test).
    let right = yes(1.3, 100);
    assert!(right >= 85, "{right} of 100");
}

#[test]
fn names_with_separators_do_not_share_a_statistic() {
    let mut csv = "subject,model,rating\n".to_owned();
    for s in 0..6 {
        for (m, name) in ["a", "a/subject_mean", "a|b", "b|c", "c"]
            .iter()
            .enumerate()
        {
            let _ = writeln!(csv, "S{s},{name},{}", 1 + m + (s * (m + 1)) % 3);
        }
    }
    let a = analysis_of(&csv);
    let all: Vec<&str> = a.values.iter().map(|(id, _)| id).collect();
    let pairs = all
        .iter()
        .filter(|id| id.starts_with("posthoc/") && id.ends_with("/mean_diff"));
    assert_eq!(pairs.count(), 10);
    assert_eq!(a.pairs.len(), 10);
    for m in &a.realizations {
        let described = a.described(&m.id).unwrap();
        let mean = described.subject_mean.mean.number().unwrap();
        let (low, high) = described.subject_mean.ci95.ends().unwrap();
        assert!(low <= mean && mean <= high, "{}: {low} {mean} {high}", m.id);
        assert!((mean - described.mean.number().unwrap()).abs() < 1e-9);
    }
    let page = Printed::of(&a).html;
    assert!(page.contains("a|b − b|c"), "{page}");
}

/// Twelve participants, of whom eight lack one cell each: four are complete.
#[test]
fn the_verdict_rests_on_everybody_who_rated() {
    let mut random = Numbers::new(3);
    let mut rows = Vec::new();
    for s in 0..12 {
        let level = random.normal();
        for m in (0..4).filter(|m| s >= 8 || s % 4 != *m) {
            rows.push((
                s,
                m,
                1,
                4.0 + level + 0.8 * m as f64 + 0.7 * random.normal(),
            ));
        }
    }
    let a = analysis_of(&rating_table(&rows, |_| None));
    assert_eq!(a.design.complete, 4);
    let f = finding(&a, Question::Differ);
    assert_eq!((f.participants, &f.verdict), (12, &Verdict::Yes));
    assert_eq!(kind(&a, Question::Best), TestKind::WithinContrast);
    assert!(
        a.pairs
            .iter()
            .all(|p| p.participants == 12 && p.difference.ci95.is_some())
    );
    Printed::of(&a).answers(&[
        "(analysis of variance within participants, 12 participants)",
        "4 of 12 participants rated every realization",
    ]);
}

/// Two halves with a realization each of their own, and one participant who links them: what this one alone determines is left out, as its
/// pairs are; with another one it is not.
#[test]
fn what_one_participant_alone_links_is_left_out() {
    let study = |links: usize| {
        let mut random = Numbers::new(11);
        let mut rows = Vec::new();
        for s in 0..12 {
            let level = random.normal();
            for m in (0..4).filter(|m| s < links || (s % 2 == 0) == (*m < 2)) {
                let half = if m < 2 { 0.0 } else { 3.0 };
                rows.push((s, m, 1, level + half + 0.7 * random.normal()));
            }
        }
        analysis_of(&rating_table(&rows, |_| None))
    };
    let a = study(1);
    let f = finding(&a, Question::Differ);
    assert_eq!(a.values.number("within_clustered/left_out"), Some(1.0));
    assert_eq!(a.values.number("within_clustered/df1"), Some(2.0));
    assert_eq!(f.verdict, Verdict::NotShown);
    assert!(f.caveats.iter().any(|c| c.code == "one-participant-links"));
    let tested: Vec<(&str, &str)> = (a.pairs.iter())
        .map(|p| (p.first.as_str(), p.second.as_str()))
        .collect();
    assert_eq!(tested, [("m00", "m01"), ("m02", "m03")]);
    Printed::of(&a).answers(&[
        "1 difference between realizations that one participant alone links is left out",
    ]);

    let a = study(4);
    let f = finding(&a, Question::Differ);
    assert_eq!(a.values.number("within_clustered/left_out"), Some(0.0));
    assert_eq!((&f.verdict, a.pairs.len()), (&Verdict::Yes, 6));
    assert!(f.caveats.iter().all(|c| c.code != "one-participant-links"));
}

/// ε̂ of Greenhouse and Geisser is at most (S − 1)/(k − 1), so that it could not say yes.
#[test]
fn few_participants_can_show_that_many_realizations_differ() {
    let mut random = Numbers::new(5);
    let mut rows = Vec::new();
    for s in 0..5 {
        let level = random.normal();
        for m in 0..20 {
            let rating = 4.0 + level + 0.08 * m as f64 + 0.7 * random.normal();
            rows.push((s, m, 1, rating));
        }
    }
    let a = analysis_of(&rating_table(&rows, |_| None));
    assert!(a.values.number("rmanova/p_gg").unwrap() > 0.05);
    assert_eq!(kind(&a, Question::Differ), TestKind::AnovaHuynhFeldt);
    assert!(finding(&a, Question::Differ).is_yes());
    // Above eight realizations the best is compared with each other one, at the price of all.
    assert_eq!(a.pairs.len(), 19);
    let comparisons = |question| finding(&a, question).test.as_ref().unwrap().comparisons;
    assert_eq!(comparisons(Question::Pairs), 190);
    assert_eq!(comparisons(Question::Best), 1);
}

/// Of 16 participants every so-many-th dislikes what the others like.
fn camps(repetitions: usize, every: usize) -> Analysis {
    let mut random = Numbers::new(7);
    let mut rows = Vec::new();
    for s in 0..16 {
        let slope = if s % every == every - 1 { -0.8 } else { 0.8 };
        for m in 0..6 {
            for k in 1..=repetitions {
                let rating = 4.0 + slope * (m as f64 - 2.5) + 0.6 * random.normal();
                rows.push((s, m, k, rating));
            }
        }
    }
    analysis_of(&rating_table(&rows, |m| Some(0.7 + 0.03 * m as f64)))
}

#[test]
fn two_opposed_camps_are_named() {
    for (repetitions, test, by) in [
        (3, TestKind::Interaction, "the interaction of participants"),
        (
            1,
            TestKind::SlopesDiffer,
            "the differences between their slopes on VAF",
        ),
    ] {
        let a = camps(repetitions, 2);
        assert_eq!(finding(&a, Question::Differ).verdict, Verdict::NotShown);
        assert_eq!(kind(&a, Question::Disagreement), test);
        let printed = Printed::of(&a);
        printed.answers(&[
            "Do participants disagree about the realizations? Yes, F(",
            "rated higher by 8 and lower by 8 of the participants",
            "Participants disagree about the realizations, and means",
        ]);
        printed.paper("Participants disagreed about the realizations, F(");
        let methods =
            format!("Whether participants disagree about the realizations was tested by F of {by}");
        assert!(printed.html.contains(&methods), "{methods}");
    }
}

#[test]
fn an_effect_of_vaf_that_some_oppose_is_limited_to_these_participants() {
    let a = camps(3, 4);
    assert!(finding(&a, Question::Vaf).is_yes());
    Printed::of(&a).answers(&["he test takes these participants as given"]);
    // All agree.
    let agreed = camps(3, 17);
    let caveats = &finding(&agreed, Question::Vaf).caveats;
    assert!(caveats.iter().all(|c| c.code != "these-participants"));
}

#[test]
fn the_level_of_significance_is_that_of_the_protocol() {
    let mut rows = Vec::new();
    let mut random = Numbers::new(11);
    for s in 0..10 {
        for m in 0..2 {
            rows.push((s, m, 1, 4.0 + 0.75 * m as f64 + 0.7 * random.normal()));
        }
    }
    let csv = rating_table(&rows, |_| None);
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    let at = |alpha: f64| {
        let rules = Rules {
            alpha,
            ..Rules::default()
        };
        analyze(&ratings, &rules)
    };
    let p = finding(&at(0.05), Question::Differ)
        .test
        .as_ref()
        .unwrap()
        .p;
    assert!((0.0001..0.045).contains(&p), "{p}");
    // Between three and four decimals of p, so that the printed p has to show the side;
    // and exactly p.
    for alpha in [p * 0.9999, p, p * 1.0001] {
        let a = at(alpha);
        let verdict = if p <= alpha {
            Verdict::Yes
        } else {
            Verdict::NotShown
        };
        assert_eq!(finding(&a, Question::Differ).verdict, verdict);
        let printed = Printed::of(&a);
        let shown = p_of(&sentence(&printed.terminal, "Do the realizations differ? ").unwrap());
        assert_eq!(shown.unwrap() <= alpha, p <= alpha, "{}", printed.terminal);
    }
    let page = Printed::of(&at(0.01)).html;
    assert!(
        page.contains("The level of significance is .01, two-sided"),
        "{page}"
    );
    assert!(!page.contains("The level of significance is .05"), "{page}");
    // Two realizations: ε is 1 by definition.
    assert!(!page.contains("ε = "), "{page}");
}

/// With five realizations, the sixth largest |r| of all 120 orders has p = 6/120.
#[test]
fn a_p_that_is_the_level_is_a_yes() {
    const MEANS: [f64; 5] = [2.0, 3.0, 4.0, 6.5, 5.5];
    const VAF: [f64; 5] = [0.70, 0.74, 0.80, 0.88, 0.95];
    let rows: Vec<_> = (0..6)
        .flat_map(|s| (0..5).map(move |m| (s, m, 1, MEANS[m] + [-0.5, 0.5][(s + m % 2) % 2])))
        .collect();
    let a = analysis_of(&rating_table(&rows, |m| Some(VAF[m])));
    let found = finding(&a, Question::Vaf);
    assert_eq!(found.test.as_ref().unwrap().p, 0.05);
    assert_eq!(found.verdict, Verdict::Yes);
    assert_eq!(found.direction, Some(Direction::Up));
    let printed = Printed::of(&a);
    for text in [&printed.terminal, printed.sections().0] {
        let said = sentence(text, "Does VAF predict the rating? ").unwrap();
        assert!(
            said.starts_with("Yes") && said.contains("p = .05"),
            "{said}"
        );
        assert!(!said.contains("p = .050"), "{said}");
    }
    printed.paper("with a higher VAF were rated");
}

#[test]
fn level_and_construct_come_from_the_protocol() {
    let mut protocol = crate::designs::design(3, 1, study_plan::protocol::Order::Blocked);
    let rules = |p: &study_plan::protocol::Protocol| Rules::of(p, "realism", Include::default());
    assert_eq!(
        (rules(&protocol).alpha, rules(&protocol).construct),
        (0.05, None)
    );
    protocol.analysis.alpha = Some(0.01);
    protocol.analysis.construct = Some("pleasantness".to_owned());
    let rules = rules(&protocol);
    assert_eq!(rules.alpha, 0.01);
    let rows: Vec<_> = (0..6)
        .flat_map(|s| (0..3).map(move |m| (s, m, 1, (m + s % 2) as f64)))
        .collect();
    let csv = rating_table(&rows, |m| Some(0.7 + 0.1 * m as f64));
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    let a = analyze(
        &ratings,
        &Rules {
            planned: None,
            ..rules
        },
    );
    let printed = Printed::of(&a);
    printed.answers(&[
        "Which realization is rated highest in pleasantness?",
        "Does VAF predict pleasantness?",
    ]);
    printed.nowhere(&["feel like the target"]);
    assert_eq!(printed.json["alpha"], 0.01);
}

/// Every finding and every pair, with the p on which it rests.
#[test]
fn the_table_of_tests_has_all_findings() {
    let a = lenient_and_severe();
    let tables = study_report::csv::tables(&source(), &a);
    let table = tables.iter().find(|t| t.name == "tests.csv").unwrap();
    let mut reader = csv_lines(&table.content);
    let head = reader.remove(0);
    let column = |name: &str| head.iter().position(|h| h == name).unwrap();
    for f in &a.findings {
        let row = reader.iter().find(|r| r[0] == f.question.id()).unwrap();
        assert_eq!(row[column("verdict")], f.verdict.as_str());
        let p = row[column("p")].parse::<f64>().ok();
        assert_eq!(p, f.test.as_ref().map(|t| t.p));
    }
    let pairs = reader.iter().filter(|r| r[0] == "pairs").count();
    assert_eq!(pairs, 1 + a.pairs.len());
    let crossed = reader
        .iter()
        .find(|r| r[1] == "mixed-model-crossed")
        .unwrap();
    let slope = a.values.number("lmm_vaf_crossed/slope").unwrap();
    assert_eq!(crossed[column("estimate")].parse::<f64>().unwrap(), slope);
    assert_eq!(crossed[column("deciding")], "false");
}

fn csv_lines(text: &str) -> Vec<Vec<String>> {
    let fields = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(fields).collect()
}

#[test]
fn those_who_gave_no_rating_did_not_rate() {
    let mut csv = "subject,model,rating\n".to_owned();
    for s in 0..10 {
        for (m, name) in ["a", "b", "c"].iter().enumerate() {
            let rating = if s < 7 {
                (1 + (s + 2 * m) % 5).to_string()
            } else {
                String::new()
            };
            let _ = writeln!(csv, "S{s},{name},{rating}");
        }
    }
    let a = analysis_of(&csv);
    assert_eq!(finding(&a, Question::Differ).participants, 7);
    let printed = Printed::of(&a);
    assert!(
        (printed.html).contains("7 participants rated 3 realizations"),
        "{}",
        printed.html
    );
    printed.nowhere(&["10 participants rated"]);
    assert!(
        (printed.terminal).contains("7 of 10 participants gave ratings"),
        "{}",
        printed.terminal
    );
}

#[test]
fn perfect_agreement_is_1_and_not_undefined() {
    let rows: Vec<_> = (0..4)
        .flat_map(|s| (0..3).flat_map(move |m| (1..=2).map(move |k| (s, m, k, 2.0 + m as f64))))
        .collect();
    let a = analysis_of(&rating_table(&rows, |_| None));
    for id in [
        "icc_subjects/ICC2",
        "icc_subjects/ICC3",
        "icc_subjects/ICC1k",
        "rmanova/pes",
        "rmanova2/model/ges",
    ] {
        assert_eq!(a.values.number(id), Some(1.0), "{id}");
    }
    for id in [
        "rmanova/F",
        "icc_subjects/F_3",
        "rmanova2/model/F",
        "rmanova2/inter/ges",
        "icc_subjects/ICC2/lo",
    ] {
        assert!(a.values.reason(id).is_some(), "{id}");
    }
}
