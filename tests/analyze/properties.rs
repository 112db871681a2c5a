//! No table makes the analysis panic or print a number that is not finite, and
//! what must not matter does not.
#![allow(clippy::unwrap_used)]

use proptest::prelude::*;
use study_analysis::analyze::{Analysis, Better, Finding, Pair, Question, Rules, Value, analyze};
use study_report::html::Details;
use study_report::text::{Page, comments, page};
use study_report::{Source, csv, figures, html, json};
use study_session::outcome::ratings::Ratings;

fn source() -> Source {
    Source {
        title: "a table".to_owned(),
        study: None,
        protocol_version: None,
        path: "a.csv".to_owned(),
        ..Source::default()
    }
}

fn of(csv: &str) -> Analysis {
    let ratings = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
    let rules = Rules {
        realistic_from: Some(5.0),
        planned: Some(10),
        ..Rules::default()
    };
    analyze(&ratings, &rules)
}

/// One row: subject, model, repetition, rating, vaf, trial.
type Row = (u8, u8, u8, Option<f64>, Option<f64>, u8);

fn table(rows: &[Row]) -> String {
    let mut out = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    let mut seen = std::collections::BTreeSet::new();
    for (s, m, r, rating, vaf, trial) in rows {
        if seen.insert((s, m, r)) {
            let model = if *m == 9 {
                String::new()
            } else {
                format!("m{m}")
            };
            let text = |x: &Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
            out += &format!(
                "S{s},{model},{},{},{},{trial}\n",
                r + 1,
                text(rating),
                text(vaf)
            );
        }
    }
    out
}

fn number() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        6 => (1i32..=7).prop_map(|v| Some(f64::from(v))),
        1 => Just(None),
        1 => prop_oneof![
            Just(0.0), Just(-1.0), Just(1e308), Just(-1e308), Just(1e-308), Just(1.0 / 3.0),
            Just(1e15), Just(4.000000000001),
        ].prop_map(Some),
    ]
}

/// Ratings as people give them.
fn plain() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![9 => (1i32..=7).prop_map(|v| Some(f64::from(v))), 1 => Just(None)]
}

fn rows(rating: impl Strategy<Value = Option<f64>>) -> impl Strategy<Value = Vec<Row>> {
    let vaf = prop_oneof![
        8 => (0i32..4).prop_map(|v| Some(f64::from(v) / 4.0)),
        1 => Just(None),
        1 => Just(Some(1e300)),
    ];
    let model = prop_oneof![9 => 0u8..4, 1 => Just(9u8)];
    let row = (0u8..5, model, 0u8..3, rating, vaf, 0u8..12);
    prop::collection::vec(row, 1..60)
}

/// Words that a broken number is printed as.
fn has_no_number_that_is_none(text: &str) -> bool {
    !text
        .split(|c: char| !c.is_ascii_alphabetic())
        .any(|w| matches!(w, "NaN" | "inf" | "nan"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_table_is_analyzed_and_every_number_is_one(rows in rows(number())) {
        let a = of(&table(&rows));
        for (id, value) in a.values.iter() {
            let finite = match value {
                Value::Number(x) => x.is_finite(),
                Value::List(x) => x.iter().all(|v| v.is_finite()),
                Value::Undefined(why) => !why.is_empty(),
            };
            prop_assert!(finite, "{id}: {value:?}");
            let is_p = id.rsplit('/').next().is_some_and(|n| n == "p" || n.starts_with("p_"));
            if let (true, Value::Number(p)) = (is_p, value) {
                prop_assert!((0.0..=1.0).contains(p), "{id} = {p}");
            }
        }
        for width in [20, 80, 100] {
            let text = page(&source(), &a, Page { width, color: false });
            prop_assert!(has_no_number_that_is_none(&text), "{text}");
        }
        let document = json::document(&source(), &a);
        let parsed: serde_json::Value = serde_json::from_str(&document).unwrap();
        prop_assert_eq!(&parsed["format"], "study-analysis/1");
        for table in csv::tables(&source(), &a) {
            prop_assert!(has_no_number_that_is_none(&table.content), "{}", table.name);
        }
        let figures = figures::all(&a, &[]);
        for figure in &figures {
            prop_assert!(has_no_number_that_is_none(&figure.wide.to_svg()), "{}", figure.name);
            prop_assert!(has_no_number_that_is_none(&figure.data), "{}", figure.name);
        }
        let report = html::document(&source(), &Details::default(), &a, &figures);
        prop_assert!(has_no_number_that_is_none(&report), "{report}");
    }

    #[test]
    fn the_order_of_the_rows_does_not_matter(rows in rows(plain()), seed in 0u64..1000) {
        let csv = table(&rows);
        let mut lines: Vec<&str> = csv.lines().skip(1).collect();
        study_base::rng::Stream::new(seed, &["lines"]).shuffle(&mut lines);
        let shuffled = format!("{}\n{}\n", csv.lines().next().unwrap(), lines.join("\n"));
        // Of one subject the order of the file is the order in time.
        let (a, b) = (of(&csv), of(&shuffled));
        same(&a, &b, |x| x, &["univariate", "subject", "order_trial", "order_previous_rating", "drift"])?;
    }
}

/// Every statistic of `b` is that of `a` after `map`, but for some groups.
fn same(
    a: &Analysis,
    b: &Analysis,
    map: impl Fn(f64) -> f64,
    but: &[&str],
) -> Result<(), TestCaseError> {
    for (id, value) in a.values.iter() {
        if but.iter().any(|g| id.split('/').next() == Some(g)) {
            continue;
        }
        match (value, b.values.get(id)) {
            (Value::Number(x), Some(Value::Number(y))) => {
                let x = map(*x);
                let near = (x - y).abs() <= 1e-7 * x.abs().max(y.abs()).max(1e-3);
                prop_assert!(near, "{id}: {x} and {y}");
            }
            (x, Some(y)) => {
                prop_assert_eq!(
                    std::mem::discriminant(x),
                    std::mem::discriminant(y),
                    "{}",
                    id
                );
            }
            (_, None) => prop_assert!(false, "{id} is gone"),
        }
    }
    Ok(())
}

const SMALL: &str = include_str!("../golden/data/sim_three_by_three/data.csv");

/// The rows of a set, each rating changed.
fn changed(csv: &str, rating: impl Fn(f64) -> f64, name: impl Fn(&str) -> String) -> String {
    let mut lines = csv.lines();
    let mut out = format!("{}\n", lines.next().unwrap());
    for line in lines {
        let mut f: Vec<String> = line.split(',').map(str::to_owned).collect();
        f[1] = name(&f[1]);
        f[3] = rating(f[3].parse().unwrap()).to_string();
        out += &format!("{}\n", f.join(","));
    }
    out
}

/// Groups that have the unit of a rating, or its origin.
const WITH_UNITS: [&str; 23] = [
    "adjusted",
    "finding",
    "lmm_cells",
    "within_cells",
    "pair",
    "desc",
    "desc_all",
    "subject",
    "subject_corr",
    "subject_slope",
    "order_repetition",
    "order_trial",
    "drift",
    "slope_variance",
    "realistic",
    "rmanova",
    "lmm_model",
    "lmm_vaf",
    "lmm_vaf_slope",
    "lmm_vaf_crossed",
    "lmm_crossed",
    "lmm_variance",
    "variance",
];

/// Groups in which the ratings are names of categories.
const ORDINAL: [&str; 7] = [
    "clmm_vaf_crossed",
    "clm_model",
    "clm_vaf",
    "clmm_model_laplace",
    "clmm_model_quad",
    "clmm_vaf_laplace",
    "clmm_vaf_quad",
];

#[test]
fn a_shift_and_a_scale_leave_every_standardized_statistic() {
    let a = of(SMALL);
    let b = of(&changed(SMALL, |x| 2.0 * x + 1000.0, str::to_owned));
    same(
        &a,
        &b,
        |x| x,
        &[
            &WITH_UNITS[..],
            &["posthoc", "icc_subjects", "icc_repetitions"],
            &ORDINAL[..],
        ]
        .concat(),
    )
    .unwrap();
    for id in [
        "rmanova/F",
        "rmanova/p_gg",
        "rmanova/ges",
        "posthoc/A|B/t",
        "icc_subjects/ICC2",
        "lmm_cells/F",
        "within_cells/F",
        "pair/A|B/p_holm",
        "finding/differ/p",
        "finding/best/p",
        "lmm_model/kenward_roger_F",
        "lmm_model/satterthwaite_F",
        "lmm_model/icc_subject",
        "lmm_model/lrt_chi2",
        "lmm_vaf/slope_t",
        "lmm_vaf_crossed/slope_t",
    ] {
        let (x, y) = (a.values.number(id).unwrap(), b.values.number(id).unwrap());
        assert!((x - y).abs() < 1e-7 * x.abs(), "{id}: {x} and {y}");
    }
    // The categories have other names and the same order: nothing changes.
    for group in &ORDINAL[1..] {
        for name in ["loglik", "beta/B", "beta/vaf", "se/vaf", "sd_subject"] {
            let id = format!("{group}/{name}");
            assert_eq!(a.values.get(&id), b.values.get(&id), "{id}");
        }
    }
    let sd = |a: &Analysis| a.values.number("desc/A/sd").unwrap();
    assert!((2.0 * sd(&a) - sd(&b)).abs() < 1e-12);
}

#[test]
fn a_scale_turned_round_turns_the_correlation_round() {
    let a = of(SMALL);
    let b = of(&changed(SMALL, |x| 8.0 - x, str::to_owned));
    for id in [
        "corr/pearson/r",
        "corr/spearman/rho",
        "corr/kendall/tau_b",
        "rmcorr_cells/r",
    ] {
        let (x, y) = (a.values.number(id).unwrap(), b.values.number(id).unwrap());
        assert!((x + y).abs() < 1e-12, "{id}: {x} and {y}");
    }
    for id in ["clm_vaf/beta/vaf", "clmm_model_quad/beta/B"] {
        let (x, y) = (a.values.number(id).unwrap(), b.values.number(id).unwrap());
        assert!((x + y).abs() < 1e-6 * x.abs(), "{id}: {x} and {y}");
    }
    let p = "corr/pearson/p_exact_two_sided";
    assert_eq!(a.values.number(p), b.values.number(p));
}

/// Where lower ratings are better, the findings are those of the mirrored ratings.
#[test]
fn lower_ratings_are_better_where_they_are_said_to_be() {
    // With twelve realizations only the pairs with the best-rated one are listed.
    let twelve: String = (0..6)
        .flat_map(|s| {
            (0..12).map(move |m| format!("S{s},m{m},1,{},.{}\n", 1 + (m * 5 + s) % 7, 70 + m))
        })
        .collect();
    for csv in [
        SMALL.to_owned(),
        format!("subject,model,repetition,rating,vaf\n{twelve}"),
    ] {
        let lower = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
        let lower = analyze(
            &lower,
            &Rules {
                better: Better::Lower,
                ..Rules::default()
            },
        );
        let mirrored = changed(&csv, |x| 8.0 - x, str::to_owned);
        let mirrored = Ratings::read_csv("a.csv", mirrored.as_bytes(), None).unwrap();
        let mirrored = analyze(&mirrored, &Rules::default());
        let names = |a: &Analysis| {
            a.ranked()
                .iter()
                .map(|r| r.1.to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(&lower), names(&mirrored));
        assert_eq!(lower.findings.len(), mirrored.findings.len());
        for (f, g) in lower.findings.iter().zip(&mirrored.findings) {
            assert_eq!((&f.verdict, &f.question), (&g.verdict, &g.question));
            if f.question == Question::Best {
                assert_eq!(f.names, g.names);
                let size = |f: &Finding| f.estimate.unwrap().value;
                assert!((size(f) + size(g)).abs() < 1e-12);
            }
        }
        let pairs = |a: &Analysis| {
            let pair = |p: &Pair| (p.first.clone(), p.second.clone());
            a.pairs.iter().map(pair).collect::<Vec<_>>()
        };
        assert_eq!(pairs(&lower), pairs(&mirrored));
        let wide = Page {
            width: 100,
            color: false,
        };
        let text = page(&source(), &lower, wide);
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let report = html::document(&source(), &Details::default(), &lower, &[]);
        for text in [&text, &report] {
            assert!(!text.contains("highest"), "{text}");
            assert!(text.contains("of which lower ratings are better"), "{text}");
        }
        assert!(report.contains("Lower ratings are better."), "{report}");
    }
}

#[test]
fn names_do_not_matter() {
    let a = of(SMALL);
    let b = of(&changed(SMALL, |x| x, |m| format!("z{m}")));
    for id in [
        "corr/pearson/r",
        "friedman/chi2",
        "rmanova/F",
        "icc_subjects/ICC1",
    ] {
        assert_eq!(a.values.number(id), b.values.number(id), "{id}");
    }
    assert_eq!(
        a.values.number("desc/A/mean"),
        b.values.number("desc/zA/mean")
    );
}

#[test]
fn a_hostile_name_stays_text() {
    let hostile = "\u{1b}]0;x\u{7}\u{202e}<script>/|=1+1";
    let csv = changed(SMALL, |x| x, |m| format!("{hostile}{m}"));
    let a = of(&csv);
    let wide = Page {
        width: 100,
        color: false,
    };
    let shown = page(&source(), &a, wide) + &comments(&a, wide);
    assert!(!shown.contains(['\u{1b}', '\u{7}', '\u{202e}']), "{shown}");
    // The tables keep it as it is.
    let tables = csv::tables(&source(), &a);
    assert!(tables[0].content.contains(hostile));
}

#[test]
fn a_page_fits_its_width() {
    use unicode_width::UnicodeWidthStr as _;
    for csv in [
        SMALL,
        include_str!("../golden/data/sim_paper/data.csv"),
        include_str!("../golden/data/sim_offset_1e9/data.csv"),
        include_str!("../golden/data/sim_all_equal/data.csv"),
        include_str!("../golden/data/nist_norris/data.csv"),
    ] {
        let long = changed(csv, |x| x, |m| format!("a-rather-long-name-of-a-model-{m}"));
        for text in [csv, &long] {
            let a = of(text);
            for width in [80, 100, 200] {
                let text = page(
                    &source(),
                    &a,
                    Page {
                        width,
                        color: false,
                    },
                );
                for line in text.lines() {
                    assert!(line.width() <= width.min(100), "{width}: {line}");
                }
            }
        }
    }
}

#[test]
fn a_hundred_thousand_subjects_are_analyzed_and_not_listed() {
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    let mut noise = study_base::rng::Stream::new(5, &["many"]);
    for s in 0..100_000 {
        for (m, vaf) in [("a", 0.7), ("b", 0.75), ("c", 0.9)] {
            let rating = 1 + noise.below(7);
            csv += &format!("S{s},{m},1,{rating},{vaf},{}\n", 1 + noise.below(3));
        }
    }
    let a = of(&csv);
    assert_eq!(a.values.number("design/n_subjects"), Some(100_000.0));
    assert!(a.values.iter().count() < 1000);
    assert!(a.warnings.iter().any(|w| w.code == "many-participants"));
    assert!(a.values.number("bootstrap/percentile_lo").is_some());
    assert!(has_no_number_that_is_none(&page(
        &source(),
        &a,
        Page {
            width: 80,
            color: false
        }
    )));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    let mut noise = study_base::rng::Stream::new(6, &["threads"]);
    for s in 0..40 {
        for trial in 0..15 {
            let rating = 1 + noise.below(7);
            csv += &format!(
                "S{s},m{},{},{rating},0.{},{}\n",
                trial % 5,
                trial / 5 + 1,
                70 + trial % 5,
                trial + 1
            );
        }
    }
    let bytes = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| json::document(&source(), &of(&csv)))
    };
    assert_eq!(bytes(1), bytes(4));
}

/// Every row alike but for one thing that should break something.
#[test]
fn degenerate_tables_are_analyzed() {
    let head = "subject,model,repetition,rating,vaf,trial_index\n";
    let tables = [
        "S,a,1,4,0.5,1\n",
        "S,,1,4,,\n",
        "S,a,1,,,\n",
        "S,a,1,NaN,NA,1\nT,a,1,nan,,1\n",
        "S,a,1,4,0.5,1\nS,b,1,4,0.5,2\nT,a,1,4,0.5,1\nT,b,1,4,0.5,2\n",
        "S,a,1,1e308,0.5,1\nS,b,1,-1e308,0.6,2\nT,a,1,1e308,0.5,1\nT,b,1,-1e308,0.6,2\n",
        "S,a,1,1e308,1e308,1\nS,b,1,1e308,-1e308,1\nT,a,1,1,1e-308,1\nT,b,1,2,0,1\n",
        "S,a,1,4,0.5,7\nS,a,2,4,0.5,7\nS,b,1,5,0.6,7\nT,a,1,3,0.5,7\nT,b,1,5,0.7,7\n",
    ];
    for rows in tables {
        let a = of(&format!("{head}{rows}"));
        let text = page(
            &source(),
            &a,
            Page {
                width: 80,
                color: false,
            },
        );
        assert!(has_no_number_that_is_none(&text), "{rows}\n{text}");
    }
}

/// Ties everywhere and just too many subjects for the exact distribution.
#[test]
fn exact_tests_end_where_there_are_many_ties() {
    let mut csv = String::from("subject,model,repetition,rating,vaf\n");
    for s in 0..300 {
        for m in 0..9 {
            csv += &format!("S{s},m{m},1,{},{}\n", (s + m) % 2 + m / 8, m % 2);
        }
    }
    let a = of(&csv);
    assert!(a.values.reason("friedman/exact_p").is_some());
    assert!(
        a.values
            .number("corr/pearson/p_exact_two_sided")
            .is_some_and(|p| p > 0.0)
    );
}
