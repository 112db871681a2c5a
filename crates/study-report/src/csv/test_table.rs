//! `tests.csv`: every test, one per row, the deciding ones first.

use super::{cells, number};
use study_analysis::analyze::{Analysis, Finding, Question, pair_id};

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

/// A test that decides nothing, by the identifiers of its numbers; empty for none.
struct Model {
    question: &'static str,
    test: &'static str,
    group: &'static str,
    estimate: &'static str,
    std_error: &'static str,
    statistic: &'static str,
    df: [&'static str; 2],
    p: &'static str,
    ci: &'static str,
}

const NONE: Model = Model {
    question: "",
    test: "",
    group: "",
    estimate: "",
    std_error: "",
    statistic: "",
    df: [""; 2],
    p: "p",
    ci: "",
};

const fn anova(test: &'static str, p: &'static str) -> Model {
    Model {
        question: "differ",
        test,
        group: "rmanova",
        statistic: "F",
        df: ["df1", "df2"],
        p,
        ..NONE
    }
}

const fn slope(test: &'static str, group: &'static str) -> Model {
    Model {
        question: "vaf",
        test,
        group,
        estimate: "slope",
        std_error: "slope_se",
        statistic: "slope_t",
        df: ["slope_satterthwaite_df", ""],
        p: "slope_satterthwaite_p",
        ..NONE
    }
}

const fn correlation(
    test: &'static str,
    group: &'static str,
    r: &'static str,
    p: &'static str,
) -> Model {
    Model {
        question: "vaf",
        test,
        group,
        estimate: r,
        p,
        ci: "ci95",
        ..NONE
    }
}

const fn f_test(question: &'static str, test: &'static str, group: &'static str) -> Model {
    Model {
        question,
        test,
        group,
        statistic: "F",
        df: ["df1", "df2"],
        ..NONE
    }
}

const MODELS: [Model; 22] = [
    anova("anova", "p"),
    anova("anova-greenhouse-geisser", "p_gg"),
    anova("anova-huynh-feldt", "p_hf"),
    Model {
        statistic: "chi2",
        df: ["df", ""],
        group: "friedman",
        ..anova("friedman-chi2", "p")
    },
    Model {
        statistic: "iman_davenport_F",
        df: ["iman_davenport_df1", "iman_davenport_df2"],
        group: "friedman",
        ..anova("friedman-iman-davenport", "iman_davenport_p")
    },
    Model {
        statistic: "chi2",
        df: ["df", ""],
        group: "friedman",
        ..anova("friedman-exact", "exact_p")
    },
    f_test("differ", "mixed-model", "lmm_cells"),
    correlation("pearson-t", "corr/pearson", "r", "p_t"),
    correlation(
        "pearson-permutation-exact",
        "corr/pearson",
        "r",
        "p_exact_two_sided",
    ),
    correlation(
        "pearson-permutation-monte-carlo",
        "corr/pearson",
        "r",
        "p_monte_carlo_two_sided",
    ),
    correlation(
        "spearman-permutation-exact",
        "corr/spearman",
        "rho",
        "p_exact_two_sided",
    ),
    correlation(
        "kendall-permutation-exact",
        "corr/kendall",
        "tau_b",
        "p_exact_two_sided",
    ),
    correlation(
        "adjusted-spearman-permutation-exact",
        "corr_adjusted/spearman",
        "rho",
        "p_exact_two_sided",
    ),
    correlation(
        "adjusted-kendall-permutation-exact",
        "corr_adjusted/kendall",
        "tau_b",
        "p_exact_two_sided",
    ),
    slope("mixed-model-crossed", "lmm_vaf_crossed"),
    slope("mixed-model-these-realizations-only", "lmm_vaf"),
    slope(
        "mixed-model-slopes-these-realizations-only",
        "lmm_vaf_slope",
    ),
    Model {
        estimate: "beta/vaf",
        std_error: "se/vaf",
        statistic: "t",
        ..correlation("ordinal-crossed", "clmm_vaf_crossed", "beta/vaf", "p")
    },
    Model {
        df: ["df", ""],
        ..correlation(
            "repeated-measures-correlation-these-realizations-only",
            "rmcorr_cells",
            "r",
            "p",
        )
    },
    f_test("disagreement", "interaction", "disagreement/interaction"),
    f_test("disagreement", "slopes-differ", "disagreement/slopes"),
    Model {
        question: "vaf",
        test: "proportional-odds",
        group: "clm_vaf/proportional_odds",
        statistic: "chi2",
        df: ["df", ""],
        ..NONE
    },
];

/// The rows of the file.
pub(super) fn rows(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells(HEAD)];
    rows.extend(a.findings.iter().map(|f| finding(a, f)));
    for p in &a.pairs {
        let id = pair_id("pair", &p.first, &p.second);
        let get = |what: &str| a.values.number(&format!("{id}/{what}"));
        let test = p.test.as_ref();
        let mut row = vec![
            "pairs".to_owned(),
            test.map_or_else(String::new, |t| t.kind.as_str().to_owned()),
            format!("{}|{}", p.first, p.second),
        ];
        let ci = p.difference.ci95;
        row.extend(
            [
                get("difference"),
                get("se"),
                get("t"),
                get("df"),
                None,
                get("p_holm"),
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
            let get = |what: &str| a.about("reference", &[&r.id, &t.id], what);
            let Some(p) = get("p_t_holm") else {
                continue;
            };
            let question = Question::Reference(r.id.clone()).id();
            let mut row = vec![
                question,
                "paired-t".to_owned(),
                format!("{}|{}", t.id, r.id),
            ];
            row.extend(
                [
                    get("mean_diff"),
                    None,
                    get("t"),
                    get("n").map(|n| n - 1.0),
                    None,
                    Some(p),
                    get("ci95_lo"),
                    get("ci95_hi"),
                    get("n"),
                    Some(2.0),
                ]
                .map(number),
            );
            row.extend(["false".to_owned(), String::new()]);
            rows.push(row);
        }
    }
    rows.extend(MODELS.iter().filter_map(|m| model(a, m)));
    rows
}

fn finding(a: &Analysis, f: &Finding) -> Vec<String> {
    let test = f.test.as_ref();
    let statistic = test.and_then(|t| t.statistic.as_ref());
    let df = |i: usize| statistic.and_then(|s| s.df.get(i).copied());
    let ci = f.estimate.and_then(|e| e.ci95);
    let se = match &f.question {
        Question::Order => a.values.number("order_trial/se"),
        Question::CarryOver => a.values.number("carry_over/se"),
        Question::Best => f.names.get(1).and_then(|second| {
            let id = pair_id("pair", &f.names[0], second);
            a.values.number(&format!("{id}/se"))
        }),
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

fn model(a: &Analysis, m: &Model) -> Option<Vec<String>> {
    let get = |what: &str| {
        let id = format!("{}/{what}", m.group);
        a.values.number(&id).filter(|_| !what.is_empty())
    };
    let p = get(m.p)?;
    let ci = a.values.interval(&format!("{}/{}", m.group, m.ci));
    let mut row = vec![m.question.to_owned(), m.test.to_owned(), String::new()];
    row.extend(
        [
            get(m.estimate),
            get(m.std_error),
            get(m.statistic),
            get(m.df[0]),
            get(m.df[1]),
            Some(p),
            ci.map(|c| c.0),
            ci.map(|c| c.1),
            None,
            None,
        ]
        .map(number),
    );
    row.extend(["false".to_owned(), String::new()]);
    Some(row)
}
