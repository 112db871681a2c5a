//! Similarity: tables of ratings, and a rehearsed study.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{cells, of_table, rehearsed, report, study};
use crate::trials::{analyze, close, csv, golden, joined, text, values};
use std::fmt::Write as _;
use std::fs;

#[test]
fn similarity_has_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("similarity_sim");
    let table = csv("participant,first,second,rating", &file, joined);
    let arguments = ["--task", "similarity", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    for id in [
        "agreement/kendall_w",
        "order/rms",
        "dimensions/2/ratio_stress",
        "pair/m2|m4/rescaled",
        "participant/P5/with_others",
    ] {
        close(&found, &file, &format!("similarity/{id}"));
    }
    // Six points of a plane, and participants who agree.
    assert!(found["similarity/structure/p"].as_f64().unwrap() < 0.05);
    assert_eq!(found["similarity/map_dimensions"], 2.0);
    let page = text(&mut analyze(
        folder.path(),
        &table,
        &["--task", "similarity"],
    ));
    assert!(
        page.contains("dimensions  stress") && page.contains("m1 | m2"),
        "{page}"
    );
    let negative = "participant,first,second,rating\nP1,a,b,-1\n";
    let done = analyze(folder.path(), negative, &["--task", "similarity"])
        .assert()
        .code(1);
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(said.contains("t.csv:2: rating is `-1`"), "{said}");
}

/// Ekman (1954), "Dimensions of color vision", J. Psychol. 38: mean similarities of 14 colors, which lie on a circle in the order of their
/// wavelengths (Shepard 1962). Values of R and scikit-learn as in crates/study-stats/src/similarity/tests.rs.
#[test]
fn the_colors_of_ekman_are_a_circle() {
    let reference = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/crates/study-stats/tests/reference/similarity.R"
    );
    let reference = fs::read_to_string(reference).unwrap();
    let list = |name: &str| -> Vec<f64> {
        let (_, from) = reference.split_once(&format!("{name} <- c(")).unwrap();
        let (numbers, _) = from.split_once(')').unwrap();
        let numbers = numbers.split(',').map(|number| number.trim().parse());
        numbers.collect::<Result<_, _>>().unwrap()
    };
    let (similarity, wavelength) = (list("similarity"), list("wavelength"));
    let mut similarity = similarity.iter();
    let mut table = "participant,first,second,rating\n".to_owned();
    for (at, one) in wavelength.iter().enumerate() {
        for other in &wavelength[at + 1..] {
            let rating = 100.0 * (1.0 - similarity.next().unwrap());
            writeln!(table, "mean,{one},{other},{rating:.0}").unwrap();
        }
    }
    assert_eq!(similarity.next(), None);
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--task", "similarity", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    let number = |id: &str| found[format!("similarity/{id}")].as_f64().unwrap();
    for (id, expected, tolerance) in [
        ("n", 91.0, 0.0),
        ("dimensions/1/classical", 0.437_642_569_544, 1e-10),
        ("dimensions/2/classical", 0.724_527_005_946, 1e-10),
        ("dimensions/3/classical", 0.821_880_222_347, 1e-10),
        ("dimensions/2/stress", 0.023_102_506_1, 5e-5),
        ("dimensions/2/ratio_stress", 0.131_199_263_56, 1e-7),
        ("dimensions/3/ratio_stress", 0.073_346_799_81, 1e-7),
        // Of one participant: the mean of 31.
        ("map_dimensions", 2.0, 0.0),
        ("map_in_proportion", 0.0, 0.0),
        ("map_stress", 0.023_102_506_1, 5e-5),
    ] {
        let found = number(id);
        assert!((found - expected).abs() <= tolerance, "{id}: {found}");
    }
    assert!(number("structure/p") < 0.01);
    let angle = |color: &f64| {
        let at = |axis: &str| number(&format!("map/{color}/{axis}"));
        at("y").atan2(at("x"))
    };
    let turns: Vec<f64> = (wavelength.windows(2))
        .map(|two| (angle(&two[1]) - angle(&two[0])).sin())
        .collect();
    let one_way = turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0);
    assert!(one_way, "{turns:?}");
}

/// The order of few differences fits without stress, and would say no more than an order: the map is in proportion to them.
#[test]
fn places_of_few_realizations_are_in_proportion() {
    let folder = tempfile::tempdir().unwrap();
    let places = [("a", 0), ("b", 10), ("c", 40), ("d", 50), ("e", 90)];
    let mut table = "participant,first,second,rating\n".to_owned();
    for who in ["P1", "P2"] {
        for (i, (one, x)) in places.iter().enumerate() {
            for (other, y) in &places[i + 1..] {
                writeln!(table, "{who},{one},{other},{}", y - x).unwrap();
            }
        }
    }
    let arguments = ["--task", "similarity", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    let number = |id: &str| found[format!("similarity/{id}")].as_f64().unwrap();
    assert_eq!(number("map_dimensions"), 1.0);
    assert_eq!(number("map_in_proportion"), 1.0);
    assert_eq!(number("dimensions/1/stress"), 0.0);
    let at = |name: &str| number(&format!("map/{name}/x"));
    for (name, x) in places {
        let apart = (at(name) - at("a")).abs();
        assert!((apart - f64::from(x)).abs() < 1e-6, "{name}: {apart}");
    }
}

/// Who rates which pairs does not move the realizations: half of the people rate near pairs of a line, the others far ones, with numbers
/// twice as large.
#[test]
fn people_who_rate_other_pairs_have_a_map_in_common() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = "participant,first,second,rating\n".to_owned();
    for person in 0..4 {
        for first in 0..6 {
            for second in first + 1..6 {
                let (apart, far) = (second - first, person % 2 == 1);
                let rates = if far { apart >= 2 } else { apart <= 2 };
                if rates {
                    let rating = if far { 16 * apart } else { 8 * apart };
                    writeln!(table, "P{person},m{first},m{second},{rating}").unwrap();
                }
            }
        }
    }
    let arguments = ["--task", "similarity", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    let number = |id: &str| found[format!("similarity/{id}")].as_f64().unwrap();
    for second in 1..6 {
        let rescaled = number(&format!("pair/m0|m{second}/rescaled"));
        // Eight and sixteen points a step are twelve on average.
        assert!(
            (rescaled - 12.0 * f64::from(second)).abs() < 1e-6,
            "{second}: {rescaled}"
        );
    }
}

/// Five people weigh the two properties of eight points differently; SciPy and the program's own tests have the numbers
/// (crates/study-stats/tests/reference/individual.py). A line has no weights, and neither has one person.
#[test]
fn people_who_weigh_dimensions_differently_have_weights() {
    let folder = tempfile::tempdir().unwrap();
    // All differences of the first property are different: their order has no ties.
    let places = [
        (0, 0),
        (22, 10),
        (9, 40),
        (32, 45),
        (15, 22),
        (34, 5),
        (4, 26),
        (1, 15),
    ];
    let weights = [(1.0, 0.1), (0.8, 0.4), (0.5, 0.9), (0.1, 1.0), (1.0, 1.0)];
    let table = |people: &[(f64, f64)], flat: f64| {
        let mut table = "participant,first,second,rating\n".to_owned();
        for (person, (a, b)) in people.iter().enumerate() {
            for (i, one) in places.iter().enumerate() {
                for (j, other) in places.iter().enumerate().skip(i + 1) {
                    let (x, y) = (
                        f64::from(one.0 - other.0),
                        flat * f64::from(one.1 - other.1),
                    );
                    let rating = (a * x * x + b * y * y).sqrt();
                    writeln!(table, "P{person},m{i},m{j},{rating:.1}").unwrap();
                }
            }
        }
        table
    };
    let arguments = ["--task", "similarity", "--json"];
    let whole = table(&weights, 1.0);
    let found = values(&mut analyze(folder.path(), &whole, &arguments));
    let number = |id: &str| found[format!("similarity/weights/{id}")].as_f64();
    assert_eq!(number("n"), Some(5.0));
    // A third dimension, if the map has one, adds nothing.
    assert!(number("fit").unwrap() > 0.999, "{:?}", number("fit"));
    assert!(number("common_fit").unwrap() < 0.95 && number("p").unwrap() < 0.05);
    let own = |who: &str, axis: &str| number(&format!("participant/{who}/{axis}")).unwrap();
    // Which of the two properties has the larger weights is the first dimension.
    let (first, second) = match own("P0", "x") > own("P0", "y") {
        true => ("x", "y"),
        false => ("y", "x"),
    };
    let shares: Vec<f64> = ["P0", "P1", "P2", "P3"]
        .iter()
        .map(|who| own(who, first) / own(who, second))
        .collect();
    assert!(shares.windows(2).all(|two| two[0] > two[1]), "{shares:?}");
    let page = text(&mut analyze(
        folder.path(),
        &whole,
        &["--task", "similarity"],
    ));
    assert!(
        page.contains("Weights of the dimensions") && page.contains("cannot be turned"),
        "{page}"
    );
    for (table, why) in [
        (table(&weights, 0.0), "the map has one dimension"),
        (
            table(&weights[..1], 1.0),
            "fewer than two participants rated every pair",
        ),
    ] {
        let out = text(&mut analyze(folder.path(), &table, &arguments));
        let document: serde_json::Value = serde_json::from_str(&out).unwrap();
        assert_eq!(
            document["undefined"]["similarity/weights/fit"], why,
            "{out}"
        );
    }
}

/// Fewer than four realizations, one participant, ratings that are all 0, and pairs that do not connect all realizations: each
/// is said, and nothing panics.
#[test]
fn similarity_without_a_map_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let head = "participant,first,second,rating\n";
    let pairs = |names: &[&str], rating: &dyn Fn(usize, usize) -> usize| {
        let mut rows = String::new();
        for (i, a) in names.iter().enumerate() {
            for (j, b) in names.iter().enumerate().skip(i + 1) {
                rows += &format!("{a},{b},{}\n", rating(i, j));
            }
        }
        rows
    };
    let of = |people: &[&str], rows: &str| {
        let all = people
            .iter()
            .flat_map(|who| rows.lines().map(move |row| format!("{who},{row}\n")));
        format!("{head}{}", all.collect::<String>())
    };
    let apart = |i: usize, j: usize| 10 * (j - i) + i;
    let (two, five) = (["P1", "P2"], ["a", "b", "c", "d", "e"]);
    let halves = pairs(&five[..3], &apart) + &pairs(&["x", "y", "z"], &apart);
    for (table, id, why) in [
        (
            of(&two, &pairs(&five[..3], &apart)),
            "structure/p",
            "there are fewer than four realizations",
        ),
        (
            of(&two, &pairs(&five, &|_, _| 0)),
            "structure/p",
            "no two different realizations were rated as different",
        ),
        (
            of(&two, &halves),
            "map_dimensions",
            "the rated pairs do not connect all realizations, or no two differ",
        ),
        (
            of(&two[..1], &pairs(&five, &apart)),
            "agreement/mean_correlation",
            "there is one participant",
        ),
        (
            of(&two, &pairs(&five[..2], &apart)),
            "agreement/kendall_w",
            "one pair was rated",
        ),
        (
            of(&two, &pairs(&five, &|_, _| 50)),
            "dimensions/1/predicted",
            "the pairs of the others do not connect all realizations, or each participant's ratings are all equal",
        ),
        (
            of(&two[..1], &pairs(&five, &apart)),
            "dimensions/1/predicted",
            "there are no other participants",
        ),
    ] {
        let arguments = ["--task", "similarity", "--json"];
        let out = text(&mut analyze(folder.path(), &table, &arguments));
        let document: serde_json::Value = serde_json::from_str(&out).unwrap();
        let id = format!("similarity/{id}");
        assert!(document["values"][&id].is_null(), "{id}: {out}");
        assert_eq!(document["undefined"][&id], why, "{out}");
    }
}

/// A rehearsed study of similarity has the statistics of its table, a map, and what it follows.
#[test]
fn differences_of_a_study_are_mapped_as_in_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "similarity");
    let results = folder.path().join("out/similarity");
    let columns = ["participant", "trial", "difference", "practice", "model"];
    let rows = cells(&results.join("ratings.csv"), &columns);
    // Two participants; 15 pairs and 6 identical ones, twice, and 6 of practice.
    assert_eq!(rows.len(), 2 * (2 * (15 + 6) + 6));
    let columns = ["participant", "trial", "interval", "model"];
    let felt = cells(&results.join("intervals.csv"), &columns);
    let mut table = "participant,first,second,rating\n".to_owned();
    for row in rows.iter().filter(|row| row[3] == "false") {
        assert_eq!(row[4], "");
        let model = |interval: &str| {
            let own = felt.iter().find(|f| f[..2] == row[..2] && f[2] == interval);
            own.unwrap()[3].clone()
        };
        table += &format!("{},{},{},{}\n", row[0], model("1"), model("2"), row[2]);
    }
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"similarity".into(), &84.into())
    );
    let values = &part["values"];
    let of_table = of_table(folder.path(), &table, &["similarity"]);
    // What has random starts, draws or properties of the realizations is not in a table.
    let drawn = [
        "map",
        "structure",
        "follows",
        "second",
        "weights",
        "dimensions",
        "order/p",
    ];
    let mut compared = 0;
    for (id, value) in values.as_object().unwrap() {
        let own = id.strip_prefix("similarity/").unwrap();
        if drawn.iter().any(|of| own.starts_with(of)) || own.ends_with("/distance") {
            continue;
        }
        let (a, b) = (value.as_f64(), of_table[id].as_f64());
        let close = (a.zip(b)).is_none_or(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(
            a.is_some() == b.is_some() && close,
            "{id}: {value} {}",
            of_table[id]
        );
        compared += 1;
    }
    assert!(compared > 60, "{compared}");
    let number = |id: &str| values[format!("similarity/{id}")].as_f64().unwrap();
    // Raters feel distances that rise along the levels.
    assert!(number("agreement/mean_correlation") > 0.7);
    assert!(number("identical/mean") < 0.5 * number("mean"));
    assert_eq!(number("follows/level/exact"), 1.0);
    assert!(number("follows/level/r") > 0.9);
    let tables = [
        "part_dimensions.csv",
        "part_map.csv",
        "part_map_follows.csv",
        "part_differences.csv",
        "part_similarity.csv",
    ];
    let report = report(folder.path(), "similarity", &["map"], &tables);
    for asked in [
        "Is there a structure that a map shows better than chance?",
        "Does it take more than one dimension?",
        "Does the map follow the level?",
    ] {
        assert!(report.contains(asked), "{asked}");
    }
    // The map of the figure is that of the table.
    let analysis = results.join("analysis");
    let columns = ["realization", "x", "x_se"];
    let drawn = cells(&analysis.join("figures/part-1-map.csv"), &columns);
    assert_eq!(cells(&analysis.join("part_map.csv"), &columns).len(), 6);
    for row in &drawn {
        let x: f64 = row[1].parse().unwrap();
        assert!((x - number(&format!("map/{}/x", row[0]))).abs() < 1e-9);
    }
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}
