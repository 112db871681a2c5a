//! Measured outcomes, against R and from a protocol to the report.
//!
//! `outcomes/outcomes.R` writes two tables of simulated trials, `outcomes/*.csv`, and what R 4.2.2 says of
//! them, `outcomes/*.txt`: afex 1.2.1 (`aov_ez`), emmeans 1.8.4.1, lme4 1.1.31 with pbkrtest 0.5.2, `p.adjust`.
//! Tolerance: 10⁻⁹ of the value, 10⁻⁷ of p, and 2·10⁻⁵ of the intervals of the mixed model.
//! `outcomes/models.R` does so for generalized mixed models (lme4 1.1.31); tolerance 2·10⁻⁴.
#![allow(clippy::unwrap_used)]

use crate::parts::study;
use std::collections::BTreeMap;
use std::fs;
use study_analysis::analyze::{Analysis, Rules, Value, analyze};
use study_base::text::QuestionId;
use study_plan::protocol::{
    BetterEnd, Clock, Crossing, Factor, Measure, OutcomeFamily, OutcomeRules, Transform,
};
use study_session::outcome::ratings::{Measured, Ratings};

fn rules(id: &str, clock: Clock, transform: Transform) -> OutcomeRules {
    OutcomeRules {
        id: QuestionId::new(id).unwrap(),
        measure: Measure::Clock(clock),
        better: Some(BetterEnd::Lower),
        transform,
        model: None,
        of: None,
    }
}

/// `time`, analyzed as its logarithm, and `answer`.
fn both() -> Vec<OutcomeRules> {
    vec![
        rules("time", Clock::Exploration, Transform::Log),
        rules("answer", Clock::Response, Transform::Identity),
    ]
}

/// A column of a table, by row.
fn column(table: &str, name: &str) -> Vec<Option<f64>> {
    let mut lines = table.lines().map(|line| line.split(','));
    let at = lines.next().unwrap().position(|n| n == name).unwrap();
    lines
        .map(|mut cells| cells.nth(at).unwrap().parse().ok())
        .collect()
}

/// The ratings of a table, with its columns `time` and `answer` as what was measured.
fn measured(table: &str) -> Ratings {
    let mut ratings = Ratings::read_csv("t.csv", table.as_bytes(), None).unwrap();
    ratings.measured = ["time", "answer"]
        .map(|id| Measured {
            id: id.to_owned(),
            values: column(table, id),
        })
        .into();
    ratings
}

/// Friction and detent, of realizations named after their levels.
fn crossing() -> Crossing {
    let factor = |id: &str, levels: &[&str]| Factor {
        id: QuestionId::new(id).unwrap(),
        levels: levels.iter().map(|l| (*l).to_owned()).collect(),
    };
    let factors = vec![
        factor("friction", &["low", "high"]),
        factor("detent", &["soft", "medium", "crisp"]),
    ];
    let mut levels_of = BTreeMap::new();
    for (i, friction) in factors[0].levels.iter().enumerate() {
        for (j, detent) in factors[1].levels.iter().enumerate() {
            levels_of.insert(format!("{friction}-{detent}"), vec![i, j]);
        }
    }
    Crossing::full(factors, levels_of)
}

/// How many values agree with R.
fn agree(found: &Analysis, expected: &str) -> usize {
    for line in expected.lines() {
        let mut words = line.split_whitespace();
        let (id, value) = (words.next().unwrap(), words.next().unwrap());
        let value: f64 = value.parse().unwrap();
        let own = (found.values.number(id)).unwrap_or_else(|| panic!("{id}: not there"));
        let name = id.rsplit('/').next().unwrap();
        let tolerance = match name {
            "center_ci95_lo" | "center_ci95_hi" => 2e-5,
            "p" | "p_gg" | "p_holm" => 1e-7,
            _ => 1e-9,
        };
        assert!(
            (own - value).abs() <= tolerance * value.abs().max(1e-3),
            "{id}: {own}, and R {value}"
        );
    }
    expected.lines().count()
}

#[test]
fn outcomes_between_realizations_are_those_of_r() {
    let ratings = measured(include_str!("outcomes/realizations.csv"));
    let rules = Rules {
        outcomes: both(),
        ..Rules::default()
    };
    let found = analyze(&ratings, &rules);
    assert_eq!(agree(&found, include_str!("outcomes/realizations.txt")), 97);
    // The shortest time is the best one.
    assert_eq!(found.outcomes[0].order.first().unwrap(), "r5");
    assert!(found.outcomes[0].findings[0].is_yes());
    let test = found.outcomes[0].findings[0].test.as_ref().unwrap();
    assert_eq!(test.comparisons, 2);
    assert!(found.outcomes.iter().all(|o| o.caveats.is_empty()));
}

#[test]
fn effects_of_factors_on_outcomes_are_those_of_r() {
    let ratings = measured(include_str!("outcomes/factors.csv"));
    let rules = Rules {
        outcomes: both(),
        crossing: Some(crossing()),
        ..Rules::default()
    };
    let found = analyze(&ratings, &rules);
    assert_eq!(agree(&found, include_str!("outcomes/factors.txt")), 140);
    // By itself the interaction in `answer` would be shown at .05, with R's p of .044.
    let answer = &found.outcomes[1].findings[2];
    assert_eq!(answer.names, ["friction", "detent"]);
    assert!(!answer.is_yes());
    assert_eq!(answer.test.as_ref().unwrap().comparisons, 6);
}

/// An outcome is analyzed as a rating with these numbers would be, also where cells are missing, and
/// it changes nothing of the ratings' analysis.
#[test]
fn an_outcome_is_compared_as_ratings_are() {
    for (table, crossing) in [
        (include_str!("outcomes/realizations.csv"), None),
        (include_str!("outcomes/factors.csv"), Some(crossing())),
    ] {
        // A third of the participants without their first realization.
        let lines: Vec<&str> = (table.lines())
            .filter(|line| {
                let third = ["P01", "P04", "P07", "P10"];
                let first = [",r1,", ",low-soft,"];
                !(third.iter().any(|p| line.starts_with(p))
                    && first.iter().any(|m| line.contains(m)))
            })
            .collect();
        for table in [table.to_owned(), lines.join("\n")] {
            let ratings = measured(&table);
            let rules = Rules {
                outcomes: vec![rules("time", Clock::Exploration, Transform::Log)],
                crossing: crossing.clone(),
                ..Rules::default()
            };
            let found = analyze(&ratings, &rules);
            let mut as_ratings = ratings.clone();
            for (rating, time) in as_ratings
                .rating
                .iter_mut()
                .zip(&ratings.measured[0].values)
            {
                *rating = time.map(f64::ln);
            }
            let without = Rules {
                outcomes: Vec::new(),
                ..rules.clone()
            };
            let expected = analyze(&as_ratings, &without);
            let mut compared = 0;
            let groups = [
                "rmanova/",
                "factorial/",
                "factorial_mean/",
                "factorial_contrast/",
            ];
            for (id, value) in expected.values.iter() {
                if !groups.iter().any(|group| id.starts_with(group)) {
                    continue;
                }
                // Only where there is one: it is not corrected over other outcomes here.
                if let Some(own) = found.values.get(&format!("outcomes/time/{id}")) {
                    assert_eq!(own, value, "{id}");
                    compared += 1;
                }
            }
            let is_complete = table.contains("P01,r1,") || table.contains("P01,low-soft,");
            if crossing.is_some() || is_complete {
                assert!(compared > 10, "{compared}");
            }
            if crossing.is_none() {
                for (own, other) in [("p", "p"), ("statistic", "statistic"), ("df2", "df2")] {
                    let own = found.values.get(&format!("outcomes/time/differ/{own}"));
                    assert_eq!(own, expected.values.get(&format!("finding/differ/{other}")));
                }
            }
            // The ratings are analyzed as they were.
            let alone = analyze(&ratings, &without);
            let is_own = |id: &str| !id.starts_with("outcomes/");
            let own: Vec<(&str, &Value)> = found.values.iter().filter(|v| is_own(v.0)).collect();
            assert!(own == alone.values.iter().collect::<Vec<_>>());
            assert_eq!(alone.findings, found.findings);
        }
    }
}

#[test]
fn what_has_no_logarithm_or_was_not_measured_is_counted() {
    let table = include_str!("outcomes/realizations.csv");
    let mut ratings = measured(table);
    let values = &mut ratings.measured[0].values;
    (values[0], values[1], values[2]) = (Some(0.0), Some(-1.0), None);
    let none = ratings.rating[3].take();
    assert!(none.is_some());
    let rules = Rules {
        outcomes: both(),
        ..Rules::default()
    };
    let found = analyze(&ratings, &rules);
    let number = |id: &str| found.values.number(&format!("outcomes/time/{id}")).unwrap();
    // One of 120 trials has no rating, and one no time.
    assert_eq!(number("n"), 118.0);
    assert_eq!((number("n_missing"), number("n_left_out")), (1.0, 2.0));
    assert_eq!(found.outcomes[0].caveats[0].code, "outcome-left-out");
    // Both trials of P01 with r1 have none.
    assert_eq!(number("desc/r1/n_participants"), 12.0);
    assert!(
        found.outcomes[0]
            .caveats
            .iter()
            .any(|c| c.text.contains("11 of 12"))
    );
}

/// Errors, hits of ten and times in 2 × 3 conditions, with their generalized mixed models.
fn modeled() -> (Ratings, Rules) {
    let table = include_str!("outcomes/models.csv");
    let mut ratings = Ratings::read_csv("t.csv", table.as_bytes(), None).unwrap();
    let names = ["errors", "hits", "time"];
    ratings.measured = names
        .map(|id| Measured {
            id: id.to_owned(),
            values: column(table, id),
        })
        .into();
    let of = |id: &str, family: OutcomeFamily, of: Option<u32>| OutcomeRules {
        model: Some(family),
        of,
        ..rules(id, Clock::Exploration, Transform::Identity)
    };
    let rules = Rules {
        outcomes: vec![
            of("errors", OutcomeFamily::Poisson, None),
            of("hits", OutcomeFamily::Binomial, Some(10)),
            of("time", OutcomeFamily::Gamma, None),
        ],
        crossing: Some(crossing()),
        ..Rules::default()
    };
    (ratings, rules)
}

#[test]
fn generalized_mixed_models_are_those_of_r_and_decide_nothing() {
    let (ratings, rules) = modeled();
    let found = analyze(&ratings, &rules);
    let number = |id: &str| found.values.number(id).unwrap_or_else(|| panic!("{id}"));
    let expected = include_str!("outcomes/models.txt");
    for line in expected.lines() {
        let (id, value) = line.split_once(' ').unwrap();
        let (own, value) = (number(id), value.parse::<f64>().unwrap());
        assert!(
            (own - value).abs() <= 2e-4 * value.abs(),
            "{id}: {own}, and R {value}"
        );
    }
    assert_eq!(expected.lines().count(), 36);
    // Simulated with a dispersion of 1/8 and a ratio of e^½.
    assert!((0.09..0.17).contains(&number("outcomes/time/model/dispersion")));
    assert!((1.4..1.9).contains(&number("outcomes/time/model/effect/friction/ratio")));
    // Everything else is as without the models.
    let without = |o: &OutcomeRules| OutcomeRules {
        model: None,
        of: None,
        ..o.clone()
    };
    let plain = Rules {
        outcomes: rules.outcomes.iter().map(without).collect(),
        ..rules.clone()
    };
    let alone = analyze(&ratings, &plain);
    let is_modeled = |id: &str| id.starts_with("outcomes/") && id.contains("/model/");
    let others = (found.values.iter()).filter(|v| !is_modeled(v.0));
    // In words, in which an undefined number is itself.
    let in_words = |value| format!("{value:?}");
    let others: Vec<String> = others.map(in_words).collect();
    let alone_in_words: Vec<String> = alone.values.iter().map(in_words).collect();
    let missing = |all: &[String], of: &[String]| -> Vec<String> {
        (all.iter().filter(|one| !of.contains(one)).cloned()).collect()
    };
    assert_eq!(missing(&alone_in_words, &others), [""; 0]);
    assert_eq!(missing(&others, &alone_in_words), [""; 0]);
    for (own, other) in others.iter().zip(&alone_in_words) {
        assert_eq!(own, other);
    }
    for (own, other) in found.outcomes.iter().zip(&alone.outcomes) {
        assert_eq!(own.findings, other.findings);
    }
}

#[test]
fn a_generalized_mixed_model_without_an_estimate_says_why() {
    let (mut ratings, rules) = modeled();
    let soft = ratings.models.iter().position(|m| m.id == "high-soft");
    for (i, value) in ratings.measured[0].values.iter_mut().enumerate() {
        if ratings.model[i].map(|m| m as usize) == soft {
            *value = Some(0.0);
        }
    }
    ratings.measured[1].values[0] = Some(11.0);
    let found = analyze(&ratings, &rules);
    for (id, told) in [
        ("outcomes/errors/model/loglik", "an estimate is infinite"),
        (
            "outcomes/hits/model/loglik",
            "not a whole number from 0 to 10",
        ),
    ] {
        match found.values.get(id) {
            Some(Value::Undefined(why)) => assert!(why.contains(told), "{why}"),
            other => panic!("{id}: {other:?}"),
        }
    }
    assert!(
        (found.values)
            .number("outcomes/time/model/loglik")
            .is_some()
    );
}

/// From a protocol to the report: the page, the tables and the figure have the outcomes.
#[test]
fn a_study_with_outcomes_reports_them() {
    for kind in ["rating", "factorial"] {
        let home = tempfile::tempdir().unwrap();
        let run = |arguments: &[&str]| {
            let (code, out, err) = study(arguments, home.path());
            assert_eq!(code, 0, "{arguments:?}: {out}{err}");
            out
        };
        run(&["new", "x", "--kind", kind, "--seed", "5"]);
        let path = home.path().join("x/protocol.toml");
        let text = fs::read_to_string(&path).unwrap();
        let text = text.replace("study-protocol/1", "study-protocol/3");
        let text = text.replace("study-protocol/2", "study-protocol/3");
        let outcomes = "\n[[outcomes]]\nid = \"time\"\nfrom = \"clock\"\nunit = \"s\"\nbetter = \"lower\"\n\
                        transform = \"log\"\n\n[[outcomes]]\nid = \"thinking\"\nfrom = \"clock\"\nmeasure = \"response\"\nmodel = \"gamma\"\n";
        fs::write(&path, text + outcomes).unwrap();
        run(&["check", "x"]);
        run(&["preregister", "x"]);
        let registered = fs::read_to_string(home.path().join("x/preregistration.md")).unwrap();
        assert!(
            registered.contains("no answer rests on them: time (exploration time, s, lower is better, log), thinking"),
            "{registered}"
        );
        run(&["rehearse", "x", "--participants", "8", "--seed", "3"]);
        let out = run(&["analyze", "rehearsal/x", "--include", "simulated"]);
        let words = match kind {
            "factorial" => "Measured: does time (exploration time) depend on the factors?",
            _ => "Measured: does time (exploration time) differ between the realizations?",
        };
        assert!(out.contains(words), "{out}");
        let flat = out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            flat.contains("Geometric means over participants: best (lowest) "),
            "{out}"
        );
        let analysis = home.path().join("rehearsal/x/analysis");
        let read = |name: &str| fs::read_to_string(analysis.join(name)).unwrap();
        let page = read("report.html");
        for told in [
            "Measured outcomes by realization, in the order of",
            "Tests of the measured outcomes",
            "Measured besides: time (exploration time, s, lower is better, log) and thinking (response time, s, gamma model besides).",
            "A gamma mixed model",
        ] {
            assert!(page.contains(told), "{told}");
        }
        let means = read("outcomes.csv");
        assert!(
            means.starts_with("outcome,unit,model,n,mean,sd,median,geometric_mean,n_participants,center,center_ci95_lo,"),
            "{means}"
        );
        let tests = read("outcome_tests.csv");
        let expected = if kind == "factorial" { 6 } else { 2 };
        assert_eq!(tests.lines().count(), 1 + expected, "{tests}");
        let head = tests.lines().next().unwrap().trim_end();
        assert!(head.ends_with(",model_chi2,model_df,model_p"), "{tests}");
        assert!(analysis.join("figures/outcomes.svg").is_file());
        // One of them in place of the rating.
        let alone = run(&[
            "analyze",
            "rehearsal/x",
            "--include",
            "simulated",
            "--question",
            "time",
            "--json",
        ]);
        let alone: serde_json::Value = serde_json::from_str(&alone).unwrap();
        let beside: serde_json::Value = serde_json::from_str(&read("values.json")).unwrap();
        let model = beside["realizations"][0]["id"].as_str().unwrap();
        let [own, other] = [
            &alone["values"][format!("adjusted/{model}/mean")],
            &beside["values"][format!("outcomes/time/desc/{model}/center")],
        ]
        .map(|x| x.as_f64().unwrap());
        assert!((own.exp() - other).abs() < 1e-9 * other, "{own} {other}");
        assert_eq!(
            alone["warnings"][0]["code"], "outcome",
            "{}",
            alone["warnings"]
        );
        // The rows have what was analyzed.
        let ratings = fs::read_to_string(home.path().join("rehearsal/x/ratings.csv")).unwrap();
        assert!(
            column(&ratings, "exploration_s")
                .iter()
                .any(Option::is_some)
        );
    }
}

/// Outcomes from telemetry are those of the files of the playbacks; a file that is gone was not measured.
#[test]
fn outcomes_from_telemetry_are_those_of_the_files() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, home.path());
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        out
    };
    run(&["new", "x", "--kind", "factorial", "--seed", "5"]);
    let path = home.path().join("x/protocol.toml");
    let mut text = fs::read_to_string(&path).unwrap();
    let measures = ["peak-force", "path", "strokes", "energy", "dwell"];
    for (i, measure) in measures.iter().enumerate() {
        text += &format!(
            "\n[[outcomes]]\nid = \"o{i}\"\nfrom = \"telemetry\"\nmeasure = \"{measure}\"\nbetter = \"lower\"\n"
        );
    }
    text += "\n[[outcomes]]\nid = \"time\"\nfrom = \"clock\"\nbetter = \"lower\"\n";
    fs::write(&path, text).unwrap();
    run(&["rehearse", "x", "--participants", "4", "--seed", "3"]);
    let analyze = || -> serde_json::Value {
        let out = run(&["analyze", "rehearsal/x", "--include", "simulated", "--json"]);
        serde_json::from_str(&out).unwrap()
    };
    let number = |all: &serde_json::Value, id: &str| -> f64 {
        let found = all["values"][id].as_f64();
        found.unwrap_or_else(|| panic!("{id}: {}", all["undefined"][id]))
    };
    let found = analyze();
    let rows = fs::read_to_string(home.path().join("rehearsal/x/ratings.csv")).unwrap();
    let models: Vec<String> = (rows.lines().skip(1))
        .map(|line| line.split(',').nth(8).unwrap().to_owned())
        .collect();
    let (trials, practice) = (column(&rows, "trial"), {
        let at = rows
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|n| n == "practice");
        let cells = rows
            .lines()
            .skip(1)
            .map(move |l| l.split(',').nth(at.unwrap()).unwrap());
        cells.map(|cell| cell == "true").collect::<Vec<_>>()
    });
    let counted = practice.iter().filter(|practice| !**practice).count() as f64;
    assert_eq!(number(&found, "outcomes/o0/n"), counted);
    // By hand from the files of one realization: the energy by trapezoids, and the largest force, which the mean
    // over 20 ms does not exceed.
    let model = &models[practice.iter().position(|p| !p).unwrap()];
    let (mut energies, mut largest, mut strokes) = (Vec::new(), Vec::new(), Vec::new());
    let of_strokes = column(&rows, "strokes");
    let participants = rows
        .lines()
        .skip(1)
        .map(|l| l.split(',').nth(1).unwrap().to_owned());
    for (i, participant) in participants.enumerate() {
        if &models[i] != model || practice[i] {
            continue;
        }
        let file = format!(
            "rehearsal/x/sessions/{participant}/1/telemetry/{:03}-a1.csv",
            trials[i].unwrap()
        );
        let samples = fs::read_to_string(home.path().join(file))
            .unwrap()
            .replace('\r', "");
        let [x, force] = ["x_mm", "force_command_n"].map(|name| {
            let all: Option<Vec<f64>> = column(&samples, name).into_iter().collect();
            all.unwrap()
        });
        let work =
            (x.windows(2).zip(force.windows(2))).map(|(x, f)| 5e-4 * (f[0] + f[1]) * (x[1] - x[0]));
        energies.push(work.sum::<f64>());
        largest.push(force.iter().map(|f| f.abs()).fold(0.0, f64::max));
        strokes.push(of_strokes[i].unwrap());
    }
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let of = |outcome: &str| number(&found, &format!("outcomes/{outcome}/desc/{model}/mean"));
    assert!(
        (of("o3") - mean(&energies)).abs() < 1e-9,
        "{} {energies:?}",
        of("o3")
    );
    assert!(of("o0") <= mean(&largest) && of("o0") > 0.5 * mean(&largest));
    assert!((of("o2") - mean(&strokes)).abs() < 1e-9);
    assert!(of("o1") > 10.0 && of("o4") >= 0.0);
    // Speed and accuracy: the time with each of them.
    for i in 0..measures.len() {
        let r = number(&found, &format!("outcomes/time/with/o{i}/r"));
        assert!(r.abs() <= 1.0);
    }
    let page = run(&["analyze", "rehearsal/x", "--include", "simulated"]);
    assert!(page.contains("Within participants time and o"), "{page}");
    let first = home.path().join("rehearsal/x/sessions/SIM001/1/telemetry");
    let name = format!(
        "{counted:03}-a1.csv",
        counted = trials[practice.iter().position(|p| !p).unwrap()].unwrap()
    );
    fs::remove_file(first.join(name)).unwrap();
    let found = analyze();
    assert_eq!(number(&found, "outcomes/o0/n_missing"), 1.0);
    assert_eq!(number(&found, "outcomes/o2/n_missing"), 0.0);
}
