//! The analysis of a study's pairs and tracks, against the same statistics of a table.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::schema::described;
use assert_cmd::Command;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The range of the shipped protocol of a threshold, and the same as an option.
const LADDER: (&str, &str) = ("range = [0.02, 0.6] ", "0.02..0.6:1.1244372275696026");

/// Runs `study`: exit code, standard output, standard error.
pub(crate) fn study(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let mut command = Command::cargo_bin("study").unwrap();
    let output = command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, text(output.stdout), text(output.stderr))
}

/// The analysis of the study in `out`, which is as its schema describes it.
pub(crate) fn analyzed(folder: &Path) -> Value {
    let (code, out, err) = study(&["analyze", "out", "--json"], folder);
    assert_eq!(code, 0, "{err}");
    let document = serde_json::from_str(&out).unwrap();
    assert_eq!(described(&document), Ok(()));
    document
}

/// Rehearses the protocol of `study new --kind KIND`; the analysis of its only part, and
/// the study's folder.
pub(crate) fn rehearsed(folder: &Path, kind: &str) -> Value {
    for arguments in [
        vec!["new", "--seed", "20261123", kind, "--kind", kind],
        vec!["rehearse", kind, "--participants", "2", "--out", "out"],
    ] {
        let (code, _, err) = study(&arguments, folder);
        assert_eq!(code, 0, "{err}");
    }
    let document = analyzed(folder);
    assert_eq!(document["format"], "study-parts/1");
    let part = document["parts"][0].clone();
    assert_eq!(part["simulated"], true);
    part
}

/// The values of a table of trials.
pub(crate) fn of_table(folder: &Path, table: &str, arguments: &[&str]) -> Value {
    fs::write(folder.join("table.csv"), table).unwrap();
    let mut all = vec!["analyze", "table.csv", "--json", "--task"];
    all.extend(arguments);
    let (code, out, err) = study(&all, folder);
    assert_eq!(code, 0, "{err}");
    let document: Value = serde_json::from_str(&out).unwrap();
    document["values"].clone()
}

/// The cells of some columns, by row.
pub(crate) fn cells(path: &Path, columns: &[&str]) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let at = |name: &&str| header.iter().position(|h| h == *name).unwrap();
    let at: Vec<usize> = columns.iter().map(at).collect();
    let row = |r: csv::StringRecord| at.iter().map(|i| r[*i].to_owned()).collect();
    reader.records().map(|r| row(r.unwrap())).collect()
}

/// Analyzes a study as a user would: the report, after a look at the files beside it.
pub(crate) fn report(folder: &Path, study_id: &str, figures: &[&str], tables: &[&str]) -> String {
    let results = format!("out/{study_id}");
    let (code, page, err) = study(&["analyze", &results], folder);
    assert_eq!(code, 0, "{err}");
    // A table of abilities shows an ability of 0 with its rounding error.
    let answers = page.find("Is a realization preferred").unwrap_or(0);
    insta::assert_snapshot!(format!("the_page_of_{study_id}"), &page[answers..]);
    let analysis = folder.join(results).join("analysis");
    for figure in figures {
        for ending in ["svg", "png", "pdf", "csv"] {
            let file = analysis.join(format!("figures/part-1-{figure}.{ending}"));
            assert!(file.is_file(), "{}", file.display());
        }
    }
    for table in tables
        .iter()
        .chain(&["parts.csv", "parts_findings.csv", "parts.json"])
    {
        assert!(analysis.join(table).is_file(), "{table}");
    }
    let report = fs::read_to_string(analysis.join("report.html")).unwrap();
    for figure in figures {
        assert!(report.contains(&format!("figures/part-1-{figure} .pdf").replace(' ', "")));
    }
    assert!(
        report.contains("For the paper")
            && report.contains("Bradley and Terry (1952), with ties (Davidson, 1970), by")
                == (study_id == "pairs")
            && report.contains("<h2>Provenance</h2>")
    );
    report
}

/// The correlation with VAF is that of the points of its figure, and its test is the finding.
fn agrees_with_vaf(part: &Value, figures: &Path) {
    let points = cells(
        &figures.join("part-1-preference-against-vaf.csv"),
        &["vaf", "ability"],
    );
    let columns =
        [0, 1].map(|c| -> Vec<f64> { points.iter().map(|p| p[c].parse().unwrap()).collect() });
    let r = study_stats::correlation::pearson(&columns[0], &columns[1]).unwrap();
    let found = part["values"]["pairs/vaf/pearson/r"].as_f64().unwrap();
    assert!((r - found).abs() < 1e-12, "{r} {found}");
    let findings = part["findings"].as_array().unwrap();
    let of_vaf = findings
        .iter()
        .find(|f| f["question"] == "preference-vaf")
        .unwrap();
    assert_eq!(of_vaf["test"]["name"], "permutation-exact");
    // Three realizations have six orders.
    assert_eq!(of_vaf["caveats"][0]["code"], "too-few");
    assert_eq!(of_vaf["verdict"], "not shown");
}

#[test]
fn pairs_of_a_study_give_the_abilities_of_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "pairs");
    let results = folder.path().join("out/pairs");
    let answers = cells(
        &results.join("ratings.csv"),
        &["participant", "trial", "attempt", "more-real"],
    );
    let felt = cells(
        &results.join("intervals.csv"),
        &["participant", "trial", "attempt", "interval", "model"],
    );
    let mut table = "participant,first,second,answer\n".to_owned();
    for answer in &answers {
        let model = |interval: &str| {
            let it = felt
                .iter()
                .find(|f| f[..3] == answer[..3] && f[3] == interval);
            it.unwrap()[4].clone()
        };
        table += &format!(
            "{},{},{},{}\n",
            answer[0],
            model("1"),
            model("2"),
            answer[3]
        );
    }
    assert_eq!(part["trials"], answers.len());
    for (id, value) in of_table(folder.path(), &table, &["pairs"])
        .as_object()
        .unwrap()
    {
        assert_eq!(part["values"][id], *value, "{id}");
    }
    let figures = ["preferences", "preference-against-vaf"];
    let report = report(folder.path(), "pairs", &figures, &["part_preferences.csv"]);
    assert!(report.contains("Does VAF predict which is preferred?"));
    agrees_with_vaf(&part, &results.join("analysis/figures"));
    // The most preferred realization is the first.
    let drawn = results.join("analysis/figures/part-1-preferences.csv");
    let abilities = cells(&drawn, &["value"]);
    let abilities: Vec<f64> = abilities.iter().map(|a| a[0].parse().unwrap()).collect();
    assert!(abilities.is_sorted_by(|a, b| a > b), "{abilities:?}");

    // Whoever is excluded does not count.
    let exclude = [
        "participant",
        "out/pairs",
        "SIM001",
        "--state",
        "excluded",
        "--reason",
        "ill",
    ];
    let (code, _, err) = study(&exclude, folder.path());
    assert_eq!(code, 0, "{err}");
    let document = analyzed(folder.path());
    assert_eq!(document["parts"][0]["trials"], answers.len() / 2);
}

#[test]
fn a_track_of_a_study_gives_the_threshold_of_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "questplus");
    let results = folder.path().join("out/questplus");
    let columns = ["participant", "track", "level", "correct"];
    let trials = cells(&results.join("ratings.csv"), &columns);
    let mut table = "participant,condition,level,positive\n".to_owned();
    for t in &trials {
        table += &format!("{},{},{},{}\n", t[0], t[1], t[2], u8::from(t[3] == "true"));
    }
    assert_eq!(part["trials"], trials.len());
    assert!(trials.len() > 60);
    let protocol = fs::read_to_string(folder.path().join("questplus/protocol.toml")).unwrap();
    assert!(protocol.contains(LADDER.0), "{protocol}");
    let table = of_table(
        folder.path(),
        &table,
        &["2ifc", "--fit-scale", "log", "--ladder", LADDER.1],
    );
    let values = part["values"].as_object().unwrap();
    assert!(values.len() > 10);
    // The template's levels are spaced by equal ratios, and the functions fitted over them.
    assert_eq!(values["psy/SIM001/quest/log_scale"], 1.0);
    for (id, value) in values.iter().filter(|v| v.0.ends_with("threshold/mean")) {
        let within = (0.02..0.6).contains(&value.as_f64().unwrap());
        assert!(within || id.starts_with("track/"), "{id}: {value}");
    }
    let of_trials = ["psy/", "psy_group/"];
    for (id, value) in values
        .iter()
        .filter(|(id, _)| of_trials.iter().any(|g| id.starts_with(g)))
    {
        let (a, b) = (value.as_f64(), table[id].as_f64());
        let close = a
            .zip(b)
            .is_none_or(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(
            a.is_some() == b.is_some() && close,
            "{id}: {value} {}",
            table[id]
        );
    }
    let figures = ["psychometric", "functions", "thresholds", "tracks"];
    report(
        folder.path(),
        "questplus",
        &figures,
        &["part_thresholds.csv"],
    );
    // The track of the figure is the one that was told.
    let track = results.join("analysis/figures/part-1-tracks.csv");
    let drawn = cells(&track, &["participant", "track", "level", "positive"]);
    let rows: Vec<&Vec<String>> = drawn.iter().collect();
    assert_eq!(rows.len(), trials.len());
    assert!(
        rows.iter()
            .zip(&trials)
            .all(|(a, b)| a[..2] == b[..2] && a[3] == b[3])
    );
    // Its line joins what the rule proposed, and its axis names levels, not their logarithms.
    let picture = fs::read_to_string(track.with_extension("svg")).unwrap();
    let joined: usize = (picture.lines().filter(|l| l.contains("#4d4d4d")))
        .map(|line| line.matches(['M', 'L', 'H', 'V']).count())
        .sum();
    let easy = cells(&track, &["easy"]);
    let easy = easy.iter().filter(|row| row[0] == "true").count();
    assert!(easy > 0 && joined == trials.len() - easy, "{joined}");
    let ticks = picture
        .lines()
        .filter(|l| l.contains(r#"text-anchor="end""#));
    let ticks: Vec<&str> = ticks.map(|l| l.split(['>', '<']).nth(2).unwrap()).collect();
    assert!(ticks.contains(&"0.05"), "{ticks:?}");
    let posterior = values
        .keys()
        .filter(|id| id.starts_with("track/") && id.ends_with("/mean"));
    assert!(posterior.count() >= 2);
}

#[test]
fn exclusion_rules_apply_to_parts() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = study(
        &["new", "--seed", "20261123", "pairs", "--kind", "pairs"],
        folder.path(),
    );
    assert_eq!(code, 0, "{err}");
    let file = folder.path().join("pairs/protocol.toml");
    let protocol = fs::read_to_string(&file).unwrap();
    let rules = [
        r#"rule = "strokes-below", strokes = 7"#,
        r#"rule = "inconsistent", difference = 1"#,
    ];
    let rules = rules.map(|rule| format!("{{ {rule} }}")).join(", ");
    fs::write(&file, format!("{protocol}\nexclude = [{rules}]\n")).unwrap();
    let rehearse = ["rehearse", "pairs", "--participants", "3", "--out", "out"];
    let (code, _, err) = study(&rehearse, folder.path());
    assert_eq!(code, 0, "{err}");
    let document = analyzed(folder.path());
    let part = &document["parts"][0];
    // A trial goes by the interval with the fewest strokes.
    let columns = ["participant", "trial", "attempt", "strokes"];
    let felt = cells(&folder.path().join("out/pairs/intervals.csv"), &columns);
    let answers = cells(&folder.path().join("out/pairs/ratings.csv"), &columns[..3]);
    let below = |answer: &&Vec<String>| {
        let own = felt.iter().filter(|f| f[..3] == answer[..]);
        own.map(|f| f[3].parse::<u32>().unwrap()).min().unwrap() < 7
    };
    let excluded = answers.iter().filter(below).count();
    assert!(
        excluded > 0 && excluded < answers.len(),
        "{excluded} of {}",
        answers.len()
    );
    assert_eq!(part["exclusions"][0]["rows"], excluded);
    assert_eq!(part["trials"], answers.len() - excluded);
    assert_eq!(part["exclusions"][1]["rows"], 0);
    let problem = part["exclusions"][1]["problem"].as_str().unwrap();
    assert!(problem.contains("not points of a scale"), "{problem}");
    let who: BTreeSet<&String> = answers.iter().filter(below).map(|a| &a[0]).collect();
    assert_eq!(part["exclusions"][0]["participants"], who.len());
    let (_, page, _) = study(&["analyze", "out"], folder.path());
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    let said = format!(
        "The rule strokes-below 7 excludes {excluded} trials of {} participants.",
        who.len()
    );
    assert!(who.len() > 1 && page.contains(&said), "{said}: {page}");
    let before = |id: &&String| id.starts_with("before_exclusion/pairs/ability/");
    assert_eq!(
        part["values"]
            .as_object()
            .unwrap()
            .keys()
            .filter(before)
            .count(),
        3
    );
}

#[test]
fn magnitude_estimates_of_a_study_give_the_exponent_of_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "magnitude");
    let results = folder.path().join("out/magnitude");
    let estimates = cells(
        &results.join("ratings.csv"),
        &["participant", "level", "strength"],
    );
    // Two participants, seven levels, three repetitions; each estimate is above 0.
    assert_eq!(estimates.len(), 42);
    let mut table = "participant,level,estimate\n".to_owned();
    for e in &estimates {
        assert!(e[2].parse::<f64>().unwrap() > 0.0, "{e:?}");
        table += &format!("{}\n", e.join(","));
    }
    assert_eq!(part["task"], "magnitude");
    let values = of_table(folder.path(), &table, &["magnitude"]);
    assert_eq!(part["values"], values);
    report(folder.path(), "magnitude", &["magnitudes"], &[]);
    let exponent = values["magnitude/exponent"].as_f64().unwrap();
    assert!((0.4..1.6).contains(&exponent), "{exponent}");
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

#[test]
fn ratings_beside_a_reference_are_screened_and_rated_as_their_table() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        vec!["new", "--seed", "20261123", "m", "--kind", "mushra"],
        vec!["rehearse", "m", "--participants", "3", "--out", "out"],
        vec!["verify", "out"],
    ] {
        let (code, out, err) = study(&arguments, folder.path());
        assert_eq!(code, 0, "{out}{err}");
    }
    let results = folder.path().join("out/m");
    let columns = ["participant", "model", "role", "quality"];
    let ratings = cells(&results.join("ratings.csv"), &columns);
    assert_eq!(ratings.len(), 3 * 5 * 2);
    let mut table = "participant,condition,role,rating\n".to_owned();
    for r in &ratings {
        table += &format!("{}\n", r.join(","));
    }
    // The reference is felt before each realization, itself among them.
    let felt = cells(
        &results.join("intervals.csv"),
        &["interval", "model", "gap_s"],
    );
    let (first, second): (Vec<_>, Vec<_>) = felt.iter().partition(|i| i[0] == "1");
    assert!(first.iter().all(|i| i[1] == "target" && i[2].is_empty()));
    assert!(second.iter().any(|i| i[1] == "target"));
    assert_eq!(second.len(), 30);
    // The ratings are numbers: the report of ratings, and the part with its screening.
    let document = analyzed(folder.path());
    assert_eq!(document["format"], "study-analysis/1");
    assert_eq!(
        document["parts"][0]["values"],
        of_table(folder.path(), &table, &["mushra"])
    );
    let (code, out, err) = study(&["analyze", "out"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("mushra, 30 trials"), "{out}");
}

/// A rehearsed identification study has the statistics of its table, and what its confusions say.
#[test]
fn labels_of_a_study_are_confused_as_in_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "identification");
    let results = folder.path().join("out/identification");
    let protocol = fs::read_to_string(folder.path().join("identification/protocol.toml")).unwrap();
    let columns = ["participant", "model", "which", "correct", "practice"];
    let rows = cells(&results.join("ratings.csv"), &columns);
    // Two participants, four realizations, six repetitions; and practice, until a criterion is reached.
    let practice = rows.iter().filter(|row| row[4] == "true").count();
    assert_eq!(rows.len(), 2 * 4 * 6 + practice);
    assert!((2 * 8..=2 * 6 * 4).contains(&practice), "{practice}");
    let label = |model: &str| {
        let line = protocol
            .lines()
            .find(|l| l.contains(&format!("models = [\"{model}\"]")));
        line.unwrap().split('"').nth(1).unwrap().to_owned()
    };
    let mut table = "participant,realization,target,answer\n".to_owned();
    for row in rows.iter().filter(|row| row[4] == "false") {
        let right = label(&row[1]);
        assert_eq!(row[3] == "true", row[2] == right, "{row:?}");
        table += &format!("{},{},{right},{}\n", row[0], row[1], row[2]);
    }
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"identification".into(), &48.into())
    );
    let mut values = part["values"].clone();
    let mut of_table = of_table(folder.path(), &table, &["identification"]);
    // The labels of a table are in alphabetical order.
    for values in [&mut values, &mut of_table] {
        let values = values.as_object_mut().unwrap();
        values.retain(|id, _| !id.ends_with("/place"));
        assert!(values.len() > 80, "{}", values.len());
    }
    for (id, value) in values.as_object().unwrap() {
        let (a, b) = (value.as_f64(), of_table[id].as_f64());
        let close = a
            .zip(b)
            .is_none_or(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(
            a.is_some() == b.is_some() && close,
            "{id}: {value} {}",
            of_table[id]
        );
    }
    let tables = [
        "part_confusions.csv",
        "part_label_pairs.csv",
        "part_recall.csv",
        "part_identification.csv",
    ];
    let report = report(folder.path(), "identification", &["confusions"], &tables);
    assert!(report.contains("Is the right label given more often than by guessing?"));
    let analysis = results.join("analysis");
    // The matrix of everybody in the figure is that of the table, and the sum of the participants'.
    let drawn = cells(
        &analysis.join("figures/part-1-confusions.csv"),
        &["participant", "right", "given", "n"],
    );
    let count = |who: &str, right: &str, given: &str| -> f64 {
        let row = drawn
            .iter()
            .find(|r| r[0] == who && r[1] == right && r[2] == given);
        row.unwrap()[3].parse().unwrap()
    };
    let matrix = cells(
        &analysis.join("part_confusions.csv"),
        &["label", "given_1", "given_2", "given_3", "given_4"],
    );
    let mut correct = 0.0;
    for (i, right) in matrix.iter().enumerate() {
        for (j, given) in matrix.iter().enumerate() {
            let (right, given, n) = (&right[0], &given[0], &right[j + 1]);
            let own = count("SIM001", right, given) + count("SIM002", right, given);
            assert_eq!(n.parse::<f64>().unwrap(), own);
            assert_eq!(count("", right, given), own);
            correct += if i == j { own } else { 0.0 };
        }
    }
    let share = part["values"]["identification/correct"].as_f64().unwrap();
    assert!(
        (correct / 48.0 - share).abs() < 1e-12 && (0.4..0.95).contains(&share),
        "{share}"
    );
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

/// The other kinds, with few trials, rehearse, pass `verify` and have an analysis.
#[test]
fn yes_no_and_abx_are_rehearsed_and_analyzed() {
    for (kind, statistic) in [
        ("yesno", "psy/SIM001/friction-yes/posterior/threshold/mean"),
        ("abx", "sdt/SIM001/abx/d_differencing"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let study = |arguments: &[&str]| {
            let (code, out, err) = study(arguments, folder.path());
            assert_eq!(code, 0, "{out}{err}");
            out
        };
        study(&["new", "--seed", "20261123", "p", "--kind", kind]);
        let file = folder.path().join("p/protocol.toml");
        let text = fs::read_to_string(&file).unwrap();
        let fewer = text.replace("repetitions = 20", "repetitions = 4");
        fs::write(&file, fewer.replace("repetitions = 40", "repetitions = 12")).unwrap();
        study(&["rehearse", "p", "--participants", "1", "--out", "out"]);
        study(&["verify", "out"]);
        let document = analyzed(folder.path());
        let values = &document["parts"][0]["values"];
        assert!(values[statistic].is_number(), "{values}");
    }
}
