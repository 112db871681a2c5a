//! `study power` of parts that are no ratings.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::study;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A new study of a kind, in `folder`.
fn new(kind: &str, folder: &Path) -> String {
    let (code, _, err) = study(&["new", "--seed", "20261123", kind, "--kind", kind], folder);
    assert_eq!(code, 0, "{err}");
    kind.to_owned()
}

#[test]
fn pairs_have_power_by_their_own_analysis() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let pairs = new("pairs", dir);
    let run = |more: &[&str]| {
        let own = [
            "power",
            &pairs,
            "--studies",
            "1500",
            "--participants",
            "10,40",
        ];
        study(&[&own[..], more].concat(), dir)
    };
    let json = |more: &[&str]| {
        let (code, out, err) = run(&[more, &["--json"]].concat());
        assert_eq!(code, 0, "{err}");
        out
    };
    let whole = json(&["--threads", "1"]);
    assert_eq!(json(&["--threads", "2"]), whole);
    for shard in ["0", "1", "2"] {
        let own = ["--shards", "3", "--shard", shard, "--out", "parts"];
        assert_eq!(run(&own).0, 0);
    }
    assert_eq!(json(&["--merge", "parts"]), whole);
    let found: Value = serde_json::from_str(&whole).unwrap();
    assert_eq!(found["part"], "more-real");
    let power = |cell: usize, test: &str| found["cells"][cell]["tests"][test]["power"].as_f64();
    assert!(power(1, "preferred") > power(0, "preferred"));
    // Three uneven VAF: 1/6 is the least p.
    assert_eq!(power(1, "preference-vaf"), Some(0.0));
    assert!(found["cells"][0]["closed"].is_null());
    let (code, page, err) = run(&[]);
    assert_eq!(code, 0, "{err}");
    assert!(
        page.starts_with("Part more-real: 3 pairs of 3 realizations, 2 trials each."),
        "{page}"
    );
    assert!(
        page.contains("no p of preference-vaf is below .167"),
        "{page}"
    );
    assert!(page.lines().all(|l| l.chars().count() <= 100), "{page}");
    for (more, what) in [
        (&["--closed"][..], "no closed form"),
        (
            &["--tests", "pearson"],
            "`pearson` is no test of part `more-real`",
        ),
        (&["--part", "other"], "there is no part `other`"),
        (&["--realizations", "8"], "realizations of part `more-real`"),
        (&["--slope", "1", "--from", "x"], "x"),
        (&["--track", "d=1"], "`--track` does not apply to pairs"),
        (
            &["--sd", "residual=1"],
            "`--sd residual` does not apply to pairs",
        ),
    ] {
        let (code, _, err) = run(more);
        assert!(code != 0 && err.contains(what), "{err}");
    }
}

#[test]
fn tracks_have_power_by_their_own_rule_and_fit() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let staircase = new("staircase", dir);
    // As few as possible: each fit takes long in a test; and two conditions, so that thresholds can differ.
    let protocol = dir.join("staircase/protocol.toml");
    let text = fs::read_to_string(&protocol).unwrap();
    fs::write(
        &protocol,
        text.replace("participants = 10", "participants = 2")
            .replace("condition = \"friction\"", ""),
    )
    .unwrap();
    let own = [
        "power",
        &staircase,
        "--studies",
        "10",
        "--participants",
        "2",
    ];
    let (code, out, err) = study(
        &[&own[..], &["--track", "ratio=4,width=0.2", "--json"]].concat(),
        dir,
    );
    assert_eq!(code, 0, "{err}");
    let found: Value = serde_json::from_str(&out).unwrap();
    let tracks = &found["assumptions"]["tracks"];
    let at = |i: usize| tracks[i]["threshold"].as_f64().unwrap();
    assert!((at(1) / at(0) - 4.0).abs() < 1e-12);
    let own_cells = found["cells"].as_array().unwrap();
    assert!(
        own_cells
            .iter()
            .all(|c| c["half_width"].as_f64().unwrap() > 0.0)
    );
    let abx = new("abx", dir);
    let (code, page, err) = study(
        &[
            "power",
            &abx,
            "--studies",
            "200",
            "--participants",
            "6,12",
            "--track",
            "d=2",
        ],
        dir,
    );
    assert_eq!(code, 0, "{err}");
    assert!(page.contains("told-apart"), "{page}");
    for (protocol, more, what) in [
        (
            &staircase,
            &["--missing", "0.1"][..],
            "missing trials of tracks",
        ),
        (
            &staircase,
            &["--track", "difference=1"],
            "state track.ratio",
        ),
        (&staircase, &["--repetitions", "2"], "repetitions of part"),
        (&abx, &["--track", "d=-1"], "0 or more"),
        (
            &abx,
            &["--slope", "1"],
            "`--slope` does not apply to tracks",
        ),
        (
            &staircase,
            &["--ties", "0.1"],
            "`--ties` does not apply to tracks",
        ),
    ] {
        let (code, _, err) = study(&[&["power", protocol], more].concat(), dir);
        assert!(code != 0 && err.contains(what), "{err}");
    }
}

/// Rankings, differences, settings and labels are simulated and decided by their own analysis; threads change nothing.
#[test]
fn what_is_felt_has_power_by_its_own_analysis() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    for (kind, test, flags, said) in [
        (
            "ranking",
            "ranked-alike",
            &["--slope", "1.5", "--sd", "residual=0.5", "--studies", "120"][..],
            "Part order: 2 rankings of 4 realizations, without ties.",
        ),
        (
            "similarity",
            "map-follows",
            &["--slope", "25", "--sd", "realization=2", "--studies", "20"],
            "Part difference: 15 pairs of 6 realizations, 2 trials each; the map is held against the level.",
        ),
        (
            "adjustment",
            "adjusted",
            &[
                "--mean",
                "1.1",
                "--sd",
                "participant=0.05,residual=0.1",
                "--studies",
                "120",
            ],
            "Part equal: 3 settings from below and as many from above, beside a standard of 1.",
        ),
        (
            "identification",
            "identified",
            &[
                "--mean",
                "0.5",
                "--sd",
                "participant=0.3",
                "--studies",
                "120",
            ],
            "Part which: 4 realizations, 6 trials each, with 4 labels.",
        ),
    ] {
        let protocol = new(kind, dir);
        let run = |more: &[&str]| {
            let own = ["power", &protocol, "--participants", "4,12"];
            study(&[&own[..], flags, more].concat(), dir)
        };
        let (code, whole, err) = run(&["--json", "--threads", "1"]);
        assert_eq!(code, 0, "{kind}: {err}");
        assert_eq!(run(&["--json", "--threads", "2"]).1, whole, "{kind}");
        let found: Value = serde_json::from_str(&whole).unwrap();
        let cells = found["cells"].as_array().unwrap();
        let of = |participants: u64| {
            let cell = cells
                .iter()
                .find(|c| c["participants"] == participants)
                .unwrap();
            let own = &cell["tests"][test];
            assert!(own["mcse"].is_f64() && own["low"].is_f64(), "{kind}: {own}");
            own["power"].as_f64().unwrap()
        };
        assert!(
            of(12) > of(4) - 0.15 && of(12) > 0.7,
            "{kind}: {} {}",
            of(4),
            of(12)
        );
        let (code, page, err) = run(&[]);
        assert_eq!(code, 0, "{kind}: {err}");
        let words = page.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(said), "{said}\n{page}");
        assert!(
            page.contains(test) && page.lines().all(|l| l.chars().count() <= 100),
            "{page}"
        );
    }
    for (kind, flags, why) in [
        (
            "ranking",
            &["--mean", "3"][..],
            "`--mean` does not apply to rankings",
        ),
        (
            "similarity",
            &["--sd", "participant=1"],
            "`--sd participant` does not apply to ratings of difference",
        ),
        (
            "adjustment",
            &["--slope", "1"],
            "`--slope` does not apply to adjustment",
        ),
        (
            "adjustment",
            &["--realizations", "8"],
            "realizations of part `equal`",
        ),
        (
            "identification",
            &["--mean", "1.5"],
            "1.5 is not between 0 and 1",
        ),
        (
            "identification",
            &["--tests", "adjusted"],
            "`adjusted` is no test of part `which`",
        ),
    ] {
        let (code, _, err) = study(&[&["power", kind], flags].concat(), dir);
        assert!(code != 0 && err.contains(why), "{kind}: {err}");
    }
    // Ranks that may follow the order decide nothing, however many participants there are.
    let path = dir.join("ranking/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let fixed = text.replacen("order = \"williams\"", "order = \"fixed\"", 1);
    assert_ne!(fixed, text);
    fs::write(&path, fixed).unwrap();
    let (code, _, err) = study(&["power", "ranking"], dir);
    assert!(code == 1 && err.contains("in the same order"), "{err}");
}

/// Precision of each design, and procedures beside each other.
#[test]
fn procedures_of_tracks_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let questplus = new("questplus", dir);
    let protocol = dir.join("questplus/protocol.toml");
    let text = fs::read_to_string(&protocol).unwrap();
    fs::write(
        &protocol,
        text.replace("participants = 10", "participants = 3"),
    )
    .unwrap();
    let run = |more: &[&str]| {
        let own = [
            "power",
            &questplus,
            "--studies",
            "10",
            "--participants",
            "3",
        ];
        study(&[&own[..], more].concat(), dir)
    };
    let (code, page, err) = run(&["--pooled", "2", "--precision", "mean=9,participant=1.01"]);
    assert_eq!(code, 0, "{err}");
    for part in [
        "a participant's threshold",
        "the mean threshold",
        "together: the pooled model, in the first 2 studies",
        "the mean threshold within × 9.00, alone: 3 participants",
        "a participant's threshold within × 1.01, alone: not reached",
    ] {
        let words: Vec<&str> = page.split_whitespace().collect();
        assert!(words.join(" ").contains(part), "{part}\n{page}");
    }
    assert!(page.lines().all(|l| l.chars().count() <= 100), "{page}");
    let compared = [
        "--procedure",
        "own,constant",
        "--trials",
        "8,16",
        "--pooled",
        "0",
    ];
    let (code, text, err) = run(&[&compared[..], &["--json", "--threads", "1"]].concat());
    assert_eq!(code, 0, "{err}");
    assert_eq!(
        run(&[&compared[..], &["--json", "--threads", "2"]].concat()).1,
        text
    );
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["format"], "study-power-procedures/1");
    let designs = found["designs"].as_array().unwrap();
    let known: Vec<_> = (designs.iter())
        .map(|d| {
            (
                d["procedure"].as_str().unwrap(),
                d["trials_asked"].as_u64().unwrap(),
            )
        })
        .collect();
    assert_eq!(
        known,
        [("own", 8), ("constant", 8), ("own", 16), ("constant", 16)]
    );
    assert_eq!(designs[0]["per_minute"]["alone"]["relative"], 1.0);
    let trials = |at: usize| designs[at]["precision"]["trials"].as_f64().unwrap();
    let minutes = |at: usize| designs[at]["minutes"].as_f64().unwrap();
    assert!((minutes(2) / minutes(0) - trials(2) / trials(0)).abs() < 1e-9);
    assert!(
        designs[0]["precision"]["alone"]["participant"]["rms_mcse"]
            .as_f64()
            .unwrap()
            > 0.0
    );
    let (code, page, err) = run(&[&compared[..], &["--out", "compared"]].concat());
    assert_eq!(code, 0, "{err}");
    assert!(
        page.contains("per minute") && page.contains("constant"),
        "{page}"
    );
    assert!(page.lines().all(|l| l.chars().count() <= 100), "{page}");
    assert!(dir.join("compared/procedures.json").is_file());
    let abx = new("abx", dir);
    for (protocol, more, what) in [
        (&questplus, &["--procedure", "psi"][..], "own, staircase"),
        (&questplus, &["--precision", "mean=0.9"], "a factor above 1"),
        (&questplus, &["--precision", "median=2"], "participant=1.5"),
        (
            &questplus,
            &["--trials", "8", "--closed"],
            "cannot be used with",
        ),
        (&abx, &["--trials", "8"], "no tracks with levels"),
    ] {
        let (code, _, err) = study(&[&["power", protocol], more].concat(), dir);
        assert!(code != 0 && err.contains(what), "{err}");
    }
}

/// After how many answers the best point of a search is near enough.
#[test]
fn numbers_of_answers_of_a_search_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let search = new("search", dir);
    let run = |more: &[&str]| {
        let own = ["power", &search, "--studies", "10", "--trials", "16,12"];
        study(&[&own[..], more].concat(), dir)
    };
    let (code, page, err) = run(&["--jnd", "9", "--out", "found"]);
    assert_eq!(code, 0, "{err}");
    let words: Vec<&str> = page.split_whitespace().collect();
    for part in [
        "10 perceivers of each kind search in the space switch, of which 81 points can be presented, up to 16 answers.",
        "recommended one, and is not noticed below 9.00.",
        "ridge: with 12 answers at least 80 % of the simulated perceivers do not notice their regret.",
        "What a search finds is to be confirmed.",
    ] {
        assert!(words.join(" ").contains(part), "{part}\n{page}");
    }
    assert!(page.lines().all(|l| l.chars().count() <= 100), "{page}");
    let (code, text, err) = run(&["--json", "--threads", "1"]);
    assert_eq!(code, 0, "{err}");
    assert_eq!(run(&["--json", "--threads", "2"]).1, text);
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["format"], "study-power-search/1");
    assert_eq!(found["assumptions"]["perceivers"], 10);
    let jnd = found["assumptions"]["jnd"].as_f64().unwrap();
    assert!((jnd - 0.953_872_552).abs() < 1e-6, "{jnd}");
    let results = found["results"].as_array().unwrap();
    let names: Vec<&str> = (results.iter())
        .map(|r| r["perceivers"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["peaked", "ridge", "two camps"]);
    for result in results {
        let regrets = result["regrets"].as_array().unwrap();
        let answers: Vec<u64> = (regrets.iter())
            .map(|r| r["answers"].as_u64().unwrap())
            .collect();
        assert_eq!(answers, [12, 16]);
        assert!(regrets.iter().all(|r| r["mcse"].as_f64().unwrap() > 0.0));
    }
    assert!(dir.join("found/search.json").is_file());
    let pairs = new("pairs", dir);
    for (protocol, more, what) in [
        (
            &search,
            &["--slope", "1"][..],
            "of which only the number of perceivers",
        ),
        (&search, &["--trials", "501"], "at most 500 trials, not 501"),
        (&search, &["--closed"], "do not apply to a search"),
        (&search, &["--procedure", "own"], "do not apply to a search"),
        (&pairs, &["--jnd", "1"], "--jnd and --best are of searches"),
    ] {
        let (code, _, err) = study(&[&["power", protocol], more].concat(), dir);
        assert!(code != 0 && err.contains(what), "{more:?}: {err}");
    }
}

/// What a protocol has and the simulation has not is said.
#[test]
fn what_is_not_simulated_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    for kind in ["magnitude", "mushra"] {
        let protocol = new(kind, dir);
        let (code, _, err) = study(&["power", &protocol], dir);
        assert_eq!(code, 1, "{err}");
        for part in ["not magnitude estimation and MUSHRA", "--scale continuous"] {
            assert!(err.contains(part), "{err}");
        }
    }
    let pairs = new("pairs", dir);
    let protocol = dir.join("pairs/protocol.toml");
    let more = "\n[groups]\n[[groups.list]]\nid = \"a\"\n[[groups.list]]\nid = \"b\"\n\n\
        [[sessions]]\nid = \"one\"\n[[sessions]]\nid = \"two\"\n";
    let text = fs::read_to_string(&protocol).unwrap() + more;
    fs::write(&protocol, text).unwrap();
    let (code, page, err) = study(&["power", &pairs, "--studies", "100"], dir);
    assert_eq!(code, 0, "{err}");
    assert!(
        page.contains("groups and sessions are not simulated"),
        "{page}"
    );
    let (_, json, _) = study(&["power", &pairs, "--studies", "100", "--json"], dir);
    assert!(
        json.contains("groups and sessions are not simulated"),
        "{json}"
    );
}
