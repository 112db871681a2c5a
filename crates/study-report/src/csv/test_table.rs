//! `tests.csv`: every test, one per row, the deciding ones first.

use super::{cells, number};
use study_analysis::analyze::results::{
    Coefficients, Correlation, Differences, Interval, Number, PairName, PairTest, Permuted, Stat,
    Trend,
};
use study_analysis::analyze::{Analysis, Finding, Question};

const HEAD: [&str; 15] = [
    "question",
    "test",
    "term",
    "estimate",
    "std_error",
    "statistic",
    "df1",
    "df2",
    "p",
    "ci_low",
    "ci_high",
    "n_participants",
    "n_realizations",
    "deciding",
    "verdict",
];

/// A test that decides nothing.
#[derive(Default)]
struct Model {
    question: &'static str,
    test: &'static str,
    estimate: Option<f64>,
    std_error: Option<f64>,
    statistic: Option<f64>,
    df: [Option<f64>; 2],
    p: Option<f64>,
    ci: Option<(f64, f64)>,
}

/// A test by a statistic, with its degrees of freedom.
fn by_statistic(
    (question, test): (&'static str, &'static str),
    statistic: &dyn Number,
    df: [&dyn Number; 2],
    p: &dyn Number,
) -> Model {
    Model {
        question,
        test,
        statistic: statistic.number(),
        df: df.map(Number::number),
        p: p.number(),
        ..Model::default()
    }
}

fn slope(test: &'static str, model: &Coefficients) -> Model {
    Model {
        question: "vaf",
        test,
        estimate: model.slope.number(),
        std_error: model.slope_se.number(),
        statistic: model.slope_t.number(),
        df: [model.slope_satterthwaite_df.number(), None],
        p: model.slope_satterthwaite_p.number(),
        ci: None,
    }
}

fn correlation(test: &'static str, r: &dyn Number, p: &dyn Number) -> Model {
    Model {
        question: "vaf",
        test,
        estimate: r.number(),
        p: p.number(),
        ..Model::default()
    }
}

/// The permutation tests of ranks.
fn of_ranks(tests: [&'static str; 2], of: &Correlation) -> Vec<Model> {
    let spearman = of.spearman.as_ref();
    let kendall = of.kendall.as_ref();
    let exact = |p: &Permuted| p.p_exact_two_sided.number();
    let model = |test, r: &Stat, permuted: &Permuted| Model {
        p: exact(permuted),
        ..correlation(test, r, &None::<Stat>)
    };
    let spearman = spearman.map(|s| model(tests[0], &s.rho, &s.permuted));
    let kendall = kendall.map(|k| model(tests[1], &k.tau_b, &k.permuted));
    [spearman, kendall].into_iter().flatten().collect()
}

/// The trend of means that are weighted by their precision.
fn weighted(trend: &Trend) -> Model {
    Model {
        std_error: trend.se.number(),
        statistic: trend.t.number(),
        df: [trend.df.number(), None],
        ci: trend.ci95.ends(),
        ..correlation("weighted-trend", &trend.slope, &trend.p)
    }
}

/// The tests that decide nothing.
fn models(a: &Analysis) -> Vec<Model> {
    let (evidence, mixed, ordinal) = (&a.results.evidence, &a.results.mixed, &a.results.ordinal);
    let Differences {
        rmanova, friedman, ..
    } = &evidence.differences;
    let none = &None::<Stat>;
    let anova = |test, p| {
        let df: [&dyn Number; 2] = [&rmanova.df1, &rmanova.df2];
        by_statistic(("differ", test), &rmanova.f, df, p)
    };
    let ranks = |test, p| by_statistic(("differ", test), &friedman.chi2, [&friedman.df, none], p);
    let mut all = vec![
        anova("anova", &rmanova.p),
        anova("anova-greenhouse-geisser", &rmanova.p_gg),
        anova("anova-huynh-feldt", &rmanova.p_hf),
        ranks("friedman-chi2", &friedman.p),
        by_statistic(
            ("differ", "friedman-iman-davenport"),
            &friedman.iman_davenport_f,
            [&friedman.iman_davenport_df1, &friedman.iman_davenport_df2],
            &friedman.iman_davenport_p,
        ),
        ranks("friedman-exact", &friedman.exact_p),
    ];
    let cells = &evidence.cells.model;
    let df: [&dyn Number; 2] = [&cells.df1, &cells.df2];
    all.push(by_statistic(
        ("differ", "mixed-model"),
        &cells.f,
        df,
        &cells.p,
    ));
    let within = &evidence.cells.within;
    let df: [&dyn Number; 2] = [&within.df1, &within.df2];
    all.push(by_statistic(
        ("differ", "within-participants"),
        &within.f,
        df,
        &within.p,
    ));
    if let Some(clustered) = &evidence.cells.clustered {
        all.push(by_statistic(
            ("differ", "within-participants-clustered-greenhouse-geisser"),
            &clustered.f,
            [&clustered.df1, &clustered.df2],
            &clustered.p_gg,
        ));
        all.push(by_statistic(
            ("differ", "within-participants-clustered-huynh-feldt"),
            &clustered.f,
            [&clustered.df1, &clustered.df2],
            &clustered.p_hf,
        ));
    }
    let pearson = &evidence.corr.pearson;
    let permuted = pearson.permuted.as_ref();
    let of_pearson = |test, p: &dyn Number| Model {
        ci: pearson.ci95.as_ref().and_then(Interval::ends),
        ..correlation(test, &pearson.r, p)
    };
    let exact = permuted.and_then(|p| p.p_exact_two_sided.as_ref());
    let random = permuted.and_then(|p| p.p_monte_carlo_two_sided.as_ref());
    all.extend([
        of_pearson("pearson-t", &pearson.p_t),
        of_pearson("pearson-permutation-exact", &exact),
        of_pearson("pearson-permutation-monte-carlo", &random),
    ]);
    let raw = ["spearman-permutation-exact", "kendall-permutation-exact"];
    all.extend(of_ranks(raw, &evidence.corr));
    let adjusted = [
        "adjusted-spearman-permutation-exact",
        "adjusted-kendall-permutation-exact",
    ];
    all.extend(of_ranks(adjusted, &evidence.corr_adjusted));
    all.extend(evidence.corr_adjusted.trend.as_ref().map(weighted));
    let crossed = &ordinal.clmm_vaf_crossed;
    let within = &a.results.over_participants.rmcorr_cells;
    all.extend([
        slope("mixed-model-crossed", &evidence.crossed.coefficients),
        slope(
            "mixed-model-these-realizations-only",
            &mixed.vaf.coefficients,
        ),
        slope(
            "mixed-model-slopes-these-realizations-only",
            &mixed.vaf_slope.coefficients,
        ),
        Model {
            std_error: crossed.se.number(),
            statistic: crossed.t.number(),
            ..correlation("ordinal-crossed", &crossed.beta, &crossed.p)
        },
        Model {
            df: [within.df.number(), None],
            ci: within.ci95.ends(),
            ..correlation(
                "repeated-measures-correlation-these-realizations-only",
                &within.r,
                &within.p,
            )
        },
    ]);
    let disagree = &evidence.disagreement;
    for (test, found) in [
        ("interaction", &disagree.interaction),
        ("slopes-differ", &disagree.slopes),
    ] {
        let df: [&dyn Number; 2] = [&found.df1, &found.df2];
        all.push(by_statistic(("disagreement", test), &found.f, df, &found.p));
    }
    if let Some(odds) = &ordinal.clm_vaf.proportional_odds {
        let df: [&dyn Number; 2] = [&odds.df, none];
        all.push(by_statistic(
            ("vaf", "proportional-odds"),
            &odds.chi2,
            df,
            &odds.p,
        ));
    }
    all.retain(|model| model.p.is_some());
    all
}

/// The rows of the file.
pub(super) fn rows(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells(HEAD)];
    rows.extend(a.findings.iter().map(|f| finding(a, f)));
    for p in &a.pairs {
        let compared = compared(a, &p.first, &p.second);
        let get = |field: fn(&PairTest) -> &Stat| compared.map(field).number();
        let test = p.test.as_ref();
        let mut row = vec![
            "pairs".to_owned(),
            test.map_or_else(String::new, |t| t.kind.as_str().to_owned()),
            format!("{}|{}", p.first, p.second),
        ];
        let ci = p.difference.ci95;
        row.extend(
            [
                get(|p| &p.difference),
                get(|p| &p.se),
                get(|p| &p.t),
                get(|p| &p.df),
                None,
                get(|p| &p.p_holm),
            ]
            .map(number),
        );
        row.extend(
            [
                ci.map(|c| c.0),
                ci.map(|c| c.1),
                Some(p.participants as f64),
                Some(2.0),
            ]
            .map(number),
        );
        row.extend(["true".to_owned(), p.verdict.as_str().to_owned()]);
        rows.push(row);
    }
    for r in a.realizations.iter().filter(|m| !m.tested) {
        for t in a.tested() {
            let Some((test, p)) =
                (a.against(&r.id, &t.id)).and_then(|test| Some((test, test.p_t_holm.number()?)))
            else {
                continue;
            };
            let ci = test.ci95.ends();
            let question = Question::Reference(r.id.clone()).id();
            let mut row = vec![
                question,
                "paired-t".to_owned(),
                format!("{}|{}", t.id, r.id),
            ];
            row.extend(
                [
                    test.mean_diff.number(),
                    None,
                    test.t.number(),
                    test.n.number().map(|n| n - 1.0),
                    None,
                    Some(p),
                    ci.map(|c| c.0),
                    ci.map(|c| c.1),
                    test.n.number(),
                    Some(2.0),
                ]
                .map(number),
            );
            row.extend(["false".to_owned(), String::new()]);
            rows.push(row);
        }
    }
    rows.extend(models(a).iter().map(model));
    rows
}

fn finding(a: &Analysis, f: &Finding) -> Vec<String> {
    let test = f.test.as_ref();
    let statistic = test.and_then(|t| t.statistic.as_ref());
    let df = |i: usize| statistic.and_then(|s| s.df.get(i).copied());
    let ci = f.estimate.and_then(|e| e.ci95);
    let se = match &f.question {
        Question::Order => a.results.evidence.order.trial.se.number(),
        Question::CarryOver => a.results.evidence.order.carry_over.se.number(),
        Question::Best => {
            (f.names.get(1)).and_then(|second| compared(a, &f.names[0], second)?.se.number())
        }
        _ => None,
    };
    let mut row = vec![
        f.question.id(),
        test.map_or_else(String::new, |t| t.kind.as_str().to_owned()),
        f.names.join("|"),
    ];
    row.extend(
        [
            f.estimate.map(|e| e.value),
            se,
            statistic.map(|s| s.value),
            df(0),
            df(1),
            test.map(|t| t.p),
            ci.map(|c| c.0),
            ci.map(|c| c.1),
            Some(f.participants as f64),
            Some(f.realizations as f64),
        ]
        .map(number),
    );
    row.extend(["true".to_owned(), f.verdict.as_str().to_owned()]);
    row
}

/// The comparison of a pair.
fn compared<'a>(a: &'a Analysis, first: &str, second: &str) -> Option<&'a PairTest> {
    let tests = a.results.evidence.pairs.as_ref()?;
    tests.compared.get(&PairName::of(first, second))
}

fn model(m: &Model) -> Vec<String> {
    let mut row = vec![m.question.to_owned(), m.test.to_owned(), String::new()];
    row.extend(
        [
            m.estimate,
            m.std_error,
            m.statistic,
            m.df[0],
            m.df[1],
            m.p,
            m.ci.map(|c| c.0),
            m.ci.map(|c| c.1),
            None,
            None,
        ]
        .map(number),
    );
    row.extend(["false".to_owned(), String::new()]);
    row
}
