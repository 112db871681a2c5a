//! `study power`: what it says, and the same bytes whatever the threads and parts.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{changed_protocol, repository, study};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// A small plan.
const SMALL: [&str; 8] = [
    "--participants",
    "10,12",
    "--realizations",
    "5",
    "--repetitions",
    "1,3",
    "--studies",
    "2500",
];

fn paper() -> String {
    repository("protocols/turn-signal")
}

fn power(more: &[&str], folder: &Path) -> (i32, String, String) {
    let protocol = paper();
    study(&[&["power", &protocol], more].concat(), folder)
}

fn good(more: &[&str], folder: &Path) -> String {
    let (code, out, err) = power(more, folder);
    assert_eq!(code, 0, "{err}");
    out
}

fn json(more: &[&str], folder: &Path) -> String {
    good(&[&SMALL[..], more, &["--json"]].concat(), folder)
}

#[test]
fn threads_and_parts_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let whole = json(&["--threads", "1"], dir);
    assert_eq!(json(&["--threads", "2"], dir), whole);
    let part = |shard: &str, more: &[&str]| {
        let own = ["--shards", "7", "--shard", shard, "--out", "parts"];
        power(&[&SMALL[..], &own, more].concat(), dir)
    };
    for shard in ["0", "1", "2", "4", "5", "6"] {
        assert_eq!(part(shard, &[]).0, 0);
    }
    // Part 3 is missing: refused with what to do, or merged as partial.
    let merge = ["--merge", "parts"];
    let (code, _, err) = power(&[&SMALL, &merge[..], &["--json"]].concat(), dir);
    assert_eq!(code, 1);
    assert!(err.contains("--array=3"), "{err}");
    let partial: Value =
        serde_json::from_str(&json(&["--merge", "parts", "--partial"], dir)).unwrap();
    assert!(partial["partial"]["missing_units"].as_u64().unwrap() > 0);
    assert!(
        partial["warnings"][0]
            .as_str()
            .unwrap()
            .starts_with("partial")
    );
    // Done again, only what is missing is done; the merge knows its own flags.
    for shard in ["3", "5"] {
        let (code, _, err) = part(shard, &[]);
        assert_eq!((code, err.contains("already done")), (0, shard == "5"));
    }
    assert_eq!(json(&merge, dir), whole);
    let (code, out, err) = study(&["power", "--merge", "parts", "--json"], dir);
    assert_eq!((code, out.as_str()), (0, whole.as_str()), "{err}");
}

#[test]
fn parts_that_do_not_belong_together_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    for shard in ["0", "1"] {
        good(
            &[
                &SMALL[..],
                &["--shards", "2", "--shard", shard, "--out", "parts"],
            ]
            .concat(),
            dir,
        );
    }
    let first = dir.join("parts/shard-0000-of-0002.json");
    let whole = fs::read_to_string(&first).unwrap();
    let refused = |text: &str, what: &str| {
        fs::write(&first, text).unwrap();
        let (code, out, err) = power(&[&SMALL[..], &["--merge", "parts"]].concat(), dir);
        assert_eq!(code, 1, "{out}");
        assert!(
            err.contains("shard-0000-of-0002.json") && err.contains(what),
            "{err}"
        );
    };
    refused(
        &whole.replacen("study-power-shard/1", "study-power-shard/2", 1),
        "format",
    );
    refused(&whole[..whole.len() / 2], "no part of a simulation");
    let digest = whole.find("\"digest\":\"").unwrap() + 10;
    refused(
        &format!("{}0000{}", &whole[..digest], &whole[digest + 4..]),
        "other settings",
    );
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    refused(
        &whole.replacen(&version, "\"version\":\"0.0.1\"", 1),
        "another version",
    );
    fs::write(&first, &whole).unwrap();
    // A unit twice, with other content.
    let other = whole.replacen("\"boundary\":", "\"boundary\":1", 1);
    fs::write(dir.join("parts/shard-0000-of-0002-copy.json"), other).unwrap();
    let (code, _, err) = power(&[&SMALL[..], &["--merge", "parts"]].concat(), dir);
    assert_eq!((code, err.contains("occurs twice")), (1, true), "{err}");
    fs::remove_file(dir.join("parts/shard-0000-of-0002-copy.json")).unwrap();
    // Other flags, other seed.
    let (code, _, err) = power(
        &[&SMALL[..], &["--seed", "1", "--merge", "parts"]].concat(),
        dir,
    );
    assert_eq!((code, err.contains("other settings")), (1, true), "{err}");
    let (code, _, _) = power(
        &[&SMALL[..], &["--shards", "2", "--shard", "2", "--out", "x"]].concat(),
        dir,
    );
    assert_eq!(code, 2);
}

/// The numbers of the sentence are those of the noncentral t in SciPy and R.
#[test]
fn the_first_sentence_is_the_requirement_of_the_realizations() {
    let folder = tempfile::tempdir().unwrap();
    let page = good(&["--closed"], folder.path());
    let first: String = page.lines().take(2).collect::<Vec<_>>().join(" ");
    assert!(first.starts_with("With 5 realizations"), "{first}");
    assert!(first.contains(".885 or more for 80 % power"), "{first}");
    assert!(
        first.contains("assumed is .857, for which the ceiling is 70 %"),
        "{first}"
    );
    assert!(page.contains("6 participants (closed form)"), "{page}");
    let strict = ["--rho", "0.95", "--targets", "0.9", "--closed"];
    let page = good(&strict, folder.path());
    assert!(page.contains("assumed is .950"), "{page}");
    assert!(!page.contains("80 %"), "{page}");
}

/// The protocol of the paper with a `[power]` section.
fn with_section(folder: &Path, section: &str) -> PathBuf {
    let to = folder.join("with");
    let _ = fs::remove_dir_all(&to);
    changed_protocol("turn-signal", &to, &[]);
    let file = to.join("protocol.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{text}\n[power]\n{section}\n")).unwrap();
    to
}

fn of_section(folder: &Path, section: &str, more: &[&str]) -> Value {
    let protocol = with_section(folder, section);
    let base = ["power", protocol.to_str().unwrap(), "--json", "--closed"];
    let (code, out, err) = study(&[&base[..], more].concat(), folder);
    assert_eq!(code, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

#[test]
fn the_protocol_states_assumptions_and_flags_come_later() {
    let folder = tempfile::tempdir().unwrap();
    let section = "rho = 0.8\nstudies = 500\ntargets = [0.7]\ntests = [\"crossed\", \"pearson\"]\n\
                   sd = { realization = 0.4, residual = 1.0 }\nvaf = \"drawn\"\ndropout = 0.1\n\
                   scale = { link = \"probit\", thresholds = [1, 2, 3, 4, 5, 6] }\n\
                   grid = { participants = [8, 16], realizations = [5, 6] }";
    let found = of_section(folder.path(), section, &[]);
    let a = &found["assumptions"];
    let slope = 0.4 * 0.8 / 0.6;
    assert!((a["slope"].as_f64().unwrap() - slope).abs() < 1e-12);
    assert_eq!(a["tests"], serde_json::json!(["crossed", "pearson"]));
    assert_eq!(a["vaf"], "drawn");
    assert_eq!(a["mean"], 3.5);
    assert_eq!(found["assumptions"]["scale"]["thresholds"][5], 6.0);
    let later = of_section(
        folder.path(),
        section,
        &["--slope", "0.2", "--sd", "residual=0.5"],
    );
    assert_eq!(later["assumptions"]["slope"], 0.2);
    assert_eq!(later["assumptions"]["sd"]["residual"], 0.5);
    assert_eq!(later["assumptions"]["sd"]["realization"], 0.4);
    // It is in no fingerprint.
    let prints = |protocol: &Path| {
        let (_, out, _) = study(
            &["check", protocol.to_str().unwrap(), "--json"],
            folder.path(),
        );
        serde_json::from_str::<Value>(&out).unwrap()["fingerprints"].clone()
    };
    let (with, without) = (with_section(folder.path(), section), paper());
    assert_eq!(prints(&with), prints(Path::new(&without)));
}

#[test]
fn assumptions_that_contradict_each_other_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (section, what) in [
        ("slop = 0.5", "unknown key `slop`"),
        ("tests = [\"t\"]", "power.tests[0]"),
        ("dropout = 1.0", "power.dropout"),
        ("targets = [1.0]", "between 0 and 1"),
        (
            "scale = { link = \"logit\", thresholds = [1, 1] }",
            "do not rise",
        ),
        ("grid = { realizations = [2] }", "from 3 to 200"),
    ] {
        let protocol = with_section(folder.path(), section);
        let (code, _, err) = study(&["check", protocol.to_str().unwrap()], folder.path());
        assert_eq!(code, 1, "{section}");
        assert!(err.contains(what), "{section}: {err}");
    }
    let both = with_section(folder.path(), "slope = 0.5\nrho = 0.8");
    let (code, _, err) = study(&["power", both.to_str().unwrap()], folder.path());
    assert_eq!((code, err.contains("same effect")), (1, true), "{err}");
    for (flags, what) in [
        (
            &["--sd", "realization=0", "--rho", "0.5"][..],
            "rho needs scatter",
        ),
        (
            &["--vaf", "listed", "--realizations", "5,8"],
            "only the 5 listed",
        ),
        (&["--scale", "logit:-1,0,1"], "3 thresholds"),
        (
            &["--scale", "logit:-3,-2,-1,0,1,2", "--sd", "residual=1"],
            "its own residual",
        ),
    ] {
        let (code, _, err) = power(flags, folder.path());
        assert_eq!(code, 1, "{flags:?}");
        assert!(err.contains(what), "{flags:?}: {err}");
    }
}

/// The example's participants are simulated: they are used only if that is said.
#[test]
fn a_pilot_is_used_with_its_uncertainty() {
    let folder = tempfile::tempdir().unwrap();
    let example = repository("results/turn-signal-example");
    let from = ["--from", example.as_str()];
    let (code, _, err) = power(&from, folder.path());
    assert_eq!(code, 1);
    assert!(err.contains("--include simulated"), "{err}");
    let more = [
        &from[..],
        &["--include", "simulated", "--participants", "10"],
    ]
    .concat();
    let more = [
        &more[..],
        &[
            "--realizations",
            "5",
            "--repetitions",
            "3",
            "--studies",
            "1000",
        ],
    ]
    .concat();
    let found: Value =
        serde_json::from_str(&good(&[&more[..], &["--json"]].concat(), folder.path())).unwrap();
    assert_eq!(found["assumptions"]["pilot"]["scatter_df"], 3);
    let cell = &found["cells"][0];
    let (low, high) = (&cell["pilot_range"][0], &cell["pilot_range"][1]);
    assert!(low.as_f64().unwrap() < high.as_f64().unwrap(), "{cell}");
    assert!(good(&more, folder.path()).contains("assurance"));
}

#[test]
fn slurm_scripts_are_written_and_nothing_is_submitted() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let out = good(
        &[&SMALL[..], &["--slurm", "my job", "--tasks", "4"]].concat(),
        dir,
    );
    assert!(out.contains("Nothing is submitted"), "{out}");
    let read = |name: &str| fs::read_to_string(dir.join("my job").join(name)).unwrap();
    let array = read("power.sbatch");
    for line in [
        "#SBATCH --array=0-3",
        "--shards 4 ",
        "--shard \"$SLURM_ARRAY_TASK_ID\"",
        "--studies 2500",
    ] {
        assert!(array.contains(line), "{line}: {array}");
    }
    assert!(array.contains("job/parts'"), "quoted for a shell: {array}");
    assert!(read("merge.sbatch").contains("--merge"));
    assert!(read("submit.sh").contains("--dependency"));
    // What the scripts run, without Slurm.
    let whole = json(&[], dir);
    for task in 0..4 {
        let script = array
            .replace("srun ", "")
            .replace("\"$SLURM_ARRAY_TASK_ID\"", &task.to_string());
        assert_eq!(shell(&script, dir), 0);
    }
    assert_eq!(shell(&read("merge.sbatch"), dir), 0);
    assert_eq!(read("power.json"), whole);
    // Nothing is written over it, or into a folder of something else.
    for dir_name in ["my job", "."] {
        let again = [&SMALL[..], &["--slurm", dir_name]].concat();
        let (code, _, err) = power(&again, dir);
        assert_eq!((code, err.contains("is not empty")), (1, true), "{err}");
    }
    assert_eq!(read("power.sbatch"), array);
}

fn shell(script: &str, dir: &Path) -> i32 {
    let file = dir.join("script.sh");
    fs::write(&file, script).unwrap();
    let output = std::process::Command::new("sh")
        .arg(&file)
        .current_dir(dir)
        .output()
        .unwrap();
    output.status.code().unwrap()
}

#[test]
fn files_and_a_hostile_title() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("hostile");
    changed_protocol(
        "turn-signal",
        &to,
        &[("title = \"Realism", "title = \"<b>\\u001b[31mRealism")],
    );
    let base = ["power", to.to_str().unwrap(), "--out", "figures"];
    let (code, out, err) = study(&[&base[..], &SMALL[..]].concat(), folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(!out.contains('\u{1b}') && out.contains("<b>"), "{out}");
    for name in ["power.json", "power.svg", "power.pdf", "power.png"] {
        assert!(folder.path().join("figures").join(name).exists(), "{name}");
    }
    let written = fs::read_to_string(folder.path().join("figures/power.json")).unwrap();
    assert!(!written.contains('\u{1b}'));
}

/// Early stops are decided at fixed places: threads and parts change no byte, and a design
/// with a clear power has fewer studies.
#[test]
fn a_narrow_interval_ends_a_design_whoever_simulates_it() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let more = [
        "--within",
        "0.016",
        "--slope",
        "1.5",
        "--sd",
        "realization=0.4",
    ];
    let own = [&SMALL[..6], &["--studies", "6000"], &more[..]].concat();
    let whole = good(&[&own[..], &["--json", "--threads", "1"]].concat(), dir);
    assert_eq!(
        good(&[&own[..], &["--json", "--threads", "2"]].concat(), dir),
        whole
    );
    for shard in ["0", "1", "2"] {
        let part = ["--shards", "3", "--shard", shard, "--out", "parts"];
        assert_eq!(power(&[&own[..], &part].concat(), dir).0, 0);
    }
    let merged = good(&[&own[..], &["--merge", "parts", "--json"]].concat(), dir);
    assert_eq!(merged, whole);
    let json: Value = serde_json::from_str(&whole).unwrap();
    for cell in json["cells"].as_array().unwrap() {
        let test = &cell["tests"]["verdict"];
        let number = |key: &str| test[key].as_f64().unwrap();
        let half = (number("high") - number("low")) / 2.0;
        let studies = number("studies");
        assert!(half <= 0.016 || studies == 6000.0, "{cell}");
        assert!(studies < 6000.0 && studies % 1000.0 == 0.0, "{cell}");
    }
    // Without the flag: all studies.
    let all = good(&[&own[..8], &["--json"]].concat(), dir);
    let all: Value = serde_json::from_str(&all).unwrap();
    assert_eq!(all["cells"][0]["tests"]["verdict"]["studies"], 6000);
}

#[test]
fn long_sessions_are_not_proposed() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let of = |most: &str| -> Value {
        let own = [
            "--closed",
            "--json",
            "--realizations",
            "5,12",
            "--rho",
            "0.95",
        ];
        let out = good(&[&own[..], &["--max-session-min", most]].concat(), dir);
        serde_json::from_str(&out).unwrap()
    };
    let proposed = |json: &Value| json["smallest"].as_array().unwrap().len();
    let (short, long) = (of("8"), of("1000"));
    assert!(proposed(&short) < proposed(&long));
    assert!(
        short["warnings"].to_string().contains("not proposed"),
        "{short}"
    );
    assert!(!long["warnings"].to_string().contains("not proposed"));
}

#[test]
fn equivalence_needs_the_margin_of_the_analysis() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let tests = [
        "--tests",
        "equivalence",
        "--slope",
        "0",
        "--studies",
        "1000",
    ];
    let (code, _, err) = power(&tests, dir);
    assert_eq!(code, 1);
    assert!(err.contains("equivalence_margin"), "{err}");
    let margin = [("primary = ", "equivalence_margin = 2.0\nprimary = ")];
    changed_protocol("turn-signal", &dir.join("p"), &margin);
    let own = [&["power", "p", "--json"][..], &SMALL[..6], &tests].concat();
    let (code, out, err) = study(&own, dir);
    assert_eq!(code, 0, "{err}");
    let json: Value = serde_json::from_str(&out).unwrap();
    let cells = json["cells"].as_array().unwrap();
    let power = |n: u64| {
        let cell = |c: &&Value| c["participants"] == n && c["repetitions"] == 3;
        let cell = cells.iter().find(cell).unwrap();
        cell["tests"]["equivalence"]["power"].as_f64().unwrap()
    };
    assert!(power(10) > 0.2, "{}", power(10));
    assert_eq!(cells[0]["tests"]["equivalence"]["type_s"], Value::Null);
}

#[test]
fn what_cannot_be_simulated_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (more, what) in [
        (
            &["--tests", "preferred"][..],
            "`preferred` is no test of ratings",
        ),
        (&["--tests", "reference-equivalence"], "equivalence_margin"),
        (&["--scale", "logit"], "from a pilot, and there is none"),
        (&["--part", "x"], "there is no part `x`"),
    ] {
        let (code, _, err) = power(more, folder.path());
        assert_eq!(code, 1, "{err}");
        assert!(err.contains(what), "{err}");
    }
}

/// The thresholds of a pilot, with their uncertainty.
#[test]
fn a_pilot_gives_the_thresholds_of_the_ordinal_model() {
    let folder = tempfile::tempdir().unwrap();
    let example = repository("results/turn-signal-example");
    let from = [
        "--from",
        &example,
        "--include",
        "simulated",
        "--scale",
        "logit",
    ];
    let text = json(&from, folder.path());
    assert_eq!(
        json(&[&from[..], &["--threads", "1"]].concat(), folder.path()),
        text
    );
    let found: Value = serde_json::from_str(&text).unwrap();
    let scale = &found["assumptions"]["scale"];
    assert_eq!(scale["link"], "logit");
    assert_eq!(scale["thresholds"].as_array().unwrap().len(), 6);
    let range = found["cells"][0]["pilot_range"].as_array().unwrap();
    assert!(range[0].as_f64() < range[1].as_f64());
    // Stated thresholds and estimates in rating points do not go together.
    let (code, _, err) = power(
        &[&from[..4], &["--scale", "logit:-2,-1,0,1,2,3"]].concat(),
        folder.path(),
    );
    assert!(
        code == 1 && err.contains("leave the thresholds out"),
        "{err}"
    );
}
