//! `study check`, `study new` and `study schema` on the command line.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn study() -> Command {
    let mut command = Command::cargo_bin("study").unwrap();
    command.env("NO_COLOR", "1");
    command
}

/// Runs and gives exit code, standard output, standard error.
fn run(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let output = study().current_dir(dir).args(args).output().unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// A folder with a copy of the paper's study.
fn turn_signal() -> TempDir {
    let dir = TempDir::new().unwrap();
    let from = Path::new(ROOT).join("protocols/turn-signal");
    fs::create_dir(dir.path().join("models")).unwrap();
    fs::copy(from.join("protocol.toml"), dir.path().join("protocol.toml")).unwrap();
    for entry in fs::read_dir(from.join("models")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(
            &path,
            dir.path().join("models").join(path.file_name().unwrap()),
        )
        .unwrap();
    }
    dir
}

fn edit(dir: &Path, file: &str, from: &str, to: &str) {
    let path = dir.join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

/// The messages of the errors and of the warnings.
fn report(dir: &Path) -> (i32, Vec<String>, Vec<String>) {
    let (code, out, err) = run(dir, &["check", ".", "--json"]);
    assert_eq!(err, "");
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(json["format"], "study-check/1");
    assert_eq!(json["ok"], code == 0);
    let messages = |key: &str| -> Vec<String> {
        json[key]
            .as_array()
            .unwrap()
            .iter()
            .map(|f| f["message"].as_str().unwrap().to_owned())
            .collect()
    };
    (code, messages("errors"), messages("warnings"))
}

#[test]
fn the_shipped_protocols_have_no_errors() {
    let (code, out, err) = run(Path::new(ROOT), &["check", "protocols/turn-signal"]);
    assert_eq!(code, 0, "{err}");
    let lines: Vec<&str> = out.lines().collect();
    // one line a realization, and the verdict last
    assert_eq!(lines.len(), 5 + 1 + 1 + 1 + 1, "{out}");
    assert!(lines.contains(&"lambda-0.9995: FAIL"), "{out}");
    assert_eq!(
        lines[5],
        "note: 5 of 5 model files do not say where their recordings went: identified before study-model/3"
    );
    assert_eq!(
        lines[7],
        "power: 80 % take a correlation of .885 between VAF and the true means, however many the \
         participants; the smallest p of the permutation test is .008; see `study power`"
    );
    assert_eq!(
        lines[8],
        "turn-signal: ok, 5 models, 15 trials, about 16 minutes, 1 warning"
    );
    let verbose = ["check", "protocols/turn-signal", "--verbose"];
    let (_, verbose, _) = run(Path::new(ROOT), &verbose);
    let margins = "lambda-0.9995: FAIL: least m -";
    assert!(verbose.contains(margins), "{verbose}");
    assert!(
        out.contains(
            "5 of 5 tables fail their certificate; `uncertified` permits playback at up to 9 N"
        ),
        "{out}"
    );
    assert!(err.contains("|r| with VAF has to exceed 0.878"), "{err}");

    let path = "protocols/turn-signal-extended/protocol.toml";
    let (code, out, err) = run(Path::new(ROOT), &["check", path]);
    assert_eq!((code, err.as_str()), (0, ""));
    let verdict = "\nturn-signal-extended: ok, 12 models, 33 trials, ";
    assert!(out.contains(verdict), "{out}");
}

/// The knob's model files are in degrees and N·m: all pass their certificates at the lever arm
/// of the protocol, and without one they are refused by name.
#[test]
fn a_knob_is_converted_at_its_lever_arm() {
    let (code, out, err) = run(Path::new(ROOT), &["check", "protocols/knob"]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("\nknob: ok, 8 models, 23 trials, "), "{out}");
    assert!(!out.contains("FAIL"), "{out}");
    let dir = tempfile::tempdir().unwrap();
    crate::support::changed_protocol("knob", dir.path(), &[("lever_mm = 20.0\n", "")]);
    let (code, _, err) = run(dir.path(), &["check", "."]);
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("passive-1.toml") && err.contains("the realization is in deg and N·m"),
        "{err}"
    );
    assert!(
        err.contains("`device.lever_mm` of the protocol says where the hand holds"),
        "{err}"
    );
}

#[test]
fn a_table_that_fails_its_certificate_is_refused_without_permission() {
    let dir = turn_signal();
    let path = dir.path().join("protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let without: String = text
        .lines()
        .filter(|line| !line.starts_with("uncertified"))
        .map(|line| format!("{line}\n"))
        .collect();
    assert_ne!(text, without);
    fs::write(&path, without).unwrap();
    for command in [
        &["check", "."][..],
        &["run", "."],
        &["rehearse", ".", "--participants", "1"],
    ] {
        let (code, _, err) = run(dir.path(), command);
        assert_eq!(code, 1, "{err}");
        assert!(err.contains("the table of `lambda-0.9991` can put energy into a hand"));
        assert!(err.contains("FAIL: least m -"), "{err}");
        assert!(err.contains("uncertified = {"), "{err}");
    }
    // `play = false` is no permission
    fs::write(&path, text.replace("play = true", "play = false")).unwrap();
    assert_eq!(run(dir.path(), &["check", "."]).0, 1);
}

/// A table as version 1 has it: without coverage, and without what is known of its terms.
fn of_version_1(table: &str) -> String {
    let (head, rest) = table.split_once("[coverage]").unwrap();
    let (_, nodes) = rest.split_once("[positive]").unwrap();
    let head = head.replacen("study-model/3\"\nkind = \"table", "study-model/1", 1);
    format!("{head}[positive]{nodes}")
}

/// The search can come back to the switch that was identified, and all of its points can be presented.
#[test]
fn the_shipped_search_has_the_identified_switch_among_its_points() {
    let (code, out, err) = run(Path::new("."), &["check", "protocols/realism-search"]);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("realism-search: ok") && out.contains("0 warnings"),
        "{out}{err}"
    );
    let loaded = study_analysis::load::load(Path::new("protocols/realism-search")).unwrap();
    let space = &loaded.protocol.spaces[0];
    let is_start = |point: &usize| {
        let levels = space.levels(*point);
        let apart = |(level, start): (&f64, f64)| (level - start).abs();
        levels.iter().zip([1.0, 0.0, 1.0]).map(apart).sum::<f64>() < 1e-12
    };
    assert_eq!((0..space.lattice.len()).filter(is_start).count(), 1);
    let model =
        |protocol: &str| fs::read(format!("protocols/{protocol}/models/passive.toml")).unwrap();
    assert!(
        model("realism-search") == model("turn-signal-passive"),
        "identify.sh makes both"
    );
}

/// The same of the keyboard switch, whose table is that of the other protocol.
#[test]
fn the_shipped_search_of_a_key_has_the_measured_switch_among_its_points() {
    let path = "protocols/keyboard-search";
    let (code, out, err) = run(Path::new("."), &["check", path]);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("keyboard-search: ok") && out.contains("0 warnings"),
        "{out}{err}"
    );
    let loaded = study_analysis::load::load(Path::new(path)).unwrap();
    let space = &loaded.protocol.spaces[0];
    assert_eq!(space.lattice.certified().len(), 81);
    let is_start = |point: &usize| space.levels(*point) == [1.0, 0.0];
    assert_eq!((0..space.lattice.len()).filter(is_start).count(), 1);
    let model =
        |protocol: &str| fs::read(format!("protocols/{protocol}/models/zaku-ii.toml")).unwrap();
    assert!(model("keyboard-search") == model("keyboard"));
}

/// A mechanism of an older version has 33 N at an edge that no data reached: it passes its
/// certificate and is refused, or named where the protocol permits it.
#[test]
fn a_mechanism_that_is_not_safe_to_play_is_refused_without_permission() {
    let dir = tempfile::tempdir().unwrap();
    let from = Path::new("protocols/turn-signal-passive");
    fs::create_dir(dir.path().join("models")).unwrap();
    for entry in fs::read_dir(from.join("models")).unwrap() {
        let path = entry.unwrap().path();
        let to = dir.path().join("models").join(path.file_name().unwrap());
        fs::copy(path, to).unwrap();
    }
    let old = "crates/study-haptics/tests/data/edge.toml";
    fs::copy(old, dir.path().join("models/mechanism.toml")).unwrap();
    let text = fs::read_to_string(from.join("protocol.toml")).unwrap();
    let path = dir.path().join("protocol.toml");
    fs::write(&path, &text).unwrap();
    let (code, out, err) = run(dir.path(), &["check", "."]);
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("note: `mechanism`: 12.00 N at rest at 1.53 mm"),
        "{out}"
    );
    // friction by the sign of the speed is named, too
    assert!(
        out.contains("note: `static`: 320 reversals a second"),
        "{out}"
    );
    // a recording so slow that it says nothing of a hand is named with the factor
    let old = of_version_1(&fs::read_to_string(from.join("models/passive.toml")).unwrap());
    let slow = old.replace("v_mm_s = 138.1611", "v_mm_s = 0.2");
    fs::write(dir.path().join("models/passive.toml"), slow).unwrap();
    let out = run(dir.path(), &["check", "."]).1;
    let words =
        "note: `passive`: trained up to 0.20 mm/s; a hand of 200 mm/s is 1000 times as fast";
    assert!(out.contains(words), "{out}");
    // so are stretches that no recording reached, and recordings that never turn back
    let coverage = "[coverage]\nx_mm = [1.5, 33.5]\nv_mm_s = [140]\nfull_strokes = 4\n\
         partial_strokes = 0\nheld_mm = [[1.5, 3]]\n[coverage.positive]\ntop_mm_s = 40\n\
         samples = [[0, 9]]\n[coverage.negative]\ntop_mm_s = 130\nsamples = [[3, 9]]\n\n[positive]";
    let third = (old.replacen("study-model/1", "study-model/3\"\nkind = \"table", 1)).replacen(
        "[positive]",
        coverage,
        1,
    );
    fs::write(dir.path().join("models/passive.toml"), third).unwrap();
    let out = run(dir.path(), &["check", "."]).1;
    // the trained speed is the one that the file states and the certificate has, not that of the slower direction
    assert!(!out.contains("trained up to"), "{out}");
    for words in [
        "note: `passive`: held where no recording went: 1.50 to 3.00 mm",
        "note: `passive`: trained on full strokes only",
    ] {
        assert!(out.contains(words), "{out}");
    }
    fs::write(&path, text.replace("play = true", "play = false")).unwrap();
    for command in [&["check", "."][..], &["run", "."]] {
        let (code, _, err) = run(dir.path(), command);
        assert_eq!(code, 1, "{err}");
        assert!(err.contains("`mechanism` is not safe to play"), "{err}");
        assert!(err.contains("after a stroke of 83 mm/s"), "{err}");
        assert!(err.contains("identify it anew, or permit it"), "{err}");
    }
}

/// A sample mounted by hand has no force: no certificate is shown and no permission is
/// needed. Played on a device with `--device`, it needs permission.
#[test]
fn a_sample_mounted_by_hand_has_no_certificate() {
    let dir = turn_signal();
    edit(dir.path(), "protocol.toml", "\"simulated\"", "\"manual\"");
    let path = dir.path().join("protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let without: Vec<&str> = text
        .lines()
        .filter(|line| !line.starts_with("uncertified"))
        .collect();
    fs::write(&path, without.join("\n")).unwrap();
    let (code, out, err) = run(dir.path(), &["check", "."]);
    assert_eq!(code, 0, "{err}");
    assert_eq!(
        out.lines().collect::<Vec<_>>(),
        [
            "note: 5 samples are mounted by hand; `study device codes ./protocol.toml` lists what to write on them",
            "power: 80 % take a correlation of .885 between VAF and the true means, however many the participants; the smallest p of the permutation test is .008; see `study power`",
            "turn-signal: ok, 5 models, 15 trials, about 23 minutes, 1 warning",
        ]
    );
    let (_, out, _) = run(dir.path(), &["check", ".", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(json["certificates"], serde_json::json!([]));
    let (code, _, err) = run(dir.path(), &["run", ".", "--device", "simulated"]);
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("the table of `lambda-0.9991` can put energy into a hand"));

    // one sample among tables
    let dir = turn_signal();
    let id = "id = \"lambda-0.9991\"";
    edit(
        dir.path(),
        "protocol.toml",
        id,
        &format!("{id}\ndevice = \"manual\""),
    );
    let (code, out, _) = run(dir.path(), &["check", "."]);
    assert_eq!(code, 0);
    assert!(!out.contains("lambda-0.9991"), "{out}");
    assert!(out.contains("4 of 4 tables fail"), "{out}");
    assert!(out.contains("note: 1 sample is mounted by hand"), "{out}");
}

/// Errors come first, then warnings, without consequences of the errors.
#[test]
fn errors_come_before_warnings_and_nothing_twice() {
    let dir = turn_signal();
    fs::remove_file(dir.path().join("models/lambda-0.9995.toml")).unwrap();
    edit(dir.path(), "models/lambda-0.9999.toml", "lookup", "look_up");
    edit(
        dir.path(),
        "protocol.toml",
        "repetitions = 3",
        "repetitions = 5",
    );
    let (code, _, err) = run(dir.path(), &["check", "."]);
    assert_eq!(code, 1);
    let told: Vec<&str> = err
        .lines()
        .filter(|l| l.starts_with("error: ") || l.starts_with("warning: "))
        .collect();
    assert_eq!(
        told,
        [
            "error: the model file cannot be read: there is no such file",
            "error: unknown key `look_up` at the top level",
            "warning: 25 trials without a break",
            "warning: 5 test realizations: |r| with VAF has to exceed 0.878 for p < .05",
            "error: 2 faults, 2 warnings",
        ],
        "{err}"
    );
}

#[test]
fn ten_faults_of_three_files_are_reported_at_once() {
    let dir = turn_signal();
    let at = dir.path();
    let file = "protocol.toml";
    edit(at, file, "seed = 2007", "seed = -2007");
    edit(at, file, "repetitions = 3", "repetition = 3");
    edit(at, file, "\"blocked\"\n", "\"blokced\"\n");
    edit(at, file, "force_n = 12.0", "force_n = nan");
    edit(
        at,
        file,
        "models/lambda-0.9991.toml",
        "../lambda-0.9991.toml",
    );
    edit(at, file, "models/lambda-0.9993.toml", "models/missing.toml");
    edit(at, file, "id = \"lambda-0.9999\"", "id = \"Lambda-0.9997\"");
    edit(at, file, "from = 1\nto = 7", "from = 7\nto = 1");
    edit(at, file, "primary = \"realism\"", "primary = \"realsim\"");
    edit(
        at,
        "models/lambda-0.9995.toml",
        "x_mm = [\n  2.0",
        "x_mm = [\n  nan",
    );
    edit(at, "models/lambda-0.9999.toml", "lookup", "look_up");

    let (code, out, err) = run(at, &["check", "."]);
    assert_eq!((code, out.as_str()), (1, ""));
    insta::assert_snapshot!(err);
}

#[test]
fn a_vaf_that_differs_from_the_file_is_an_error_and_a_rounded_one_is_not() {
    let dir = turn_signal();
    let id = "id = \"lambda-0.9995\"\n";
    edit(
        dir.path(),
        "protocol.toml",
        id,
        &format!("{id}vaf = 0.96\n"),
    );
    assert_eq!(report(dir.path()).0, 0);
    edit(dir.path(), "protocol.toml", "vaf = 0.96\n", "vaf = 0.79\n");
    let (code, errors, _) = report(dir.path());
    assert_eq!(code, 1);
    assert_eq!(
        errors,
        [
            "the VAF of `lambda-0.9995` is not 0.79: its file has 0.9623644884535236 for `validation-1.5hz`"
        ]
    );
}

#[test]
fn a_recording_that_no_model_knows_is_an_error() {
    let dir = turn_signal();
    edit(
        dir.path(),
        "protocol.toml",
        "validation-1.5hz",
        "validation-15hz",
    );
    let (_, errors, _) = report(dir.path());
    assert_eq!(errors, ["no model file has a VAF for `validation-15hz`"]);
}

#[test]
fn an_infeasible_order_is_an_error_with_its_reason() {
    let dir = turn_signal();
    let order = "order = \"blocked\"\n";
    edit(
        dir.path(),
        "protocol.toml",
        order,
        &format!("{order}min_distance = 6\n"),
    );
    let (code, errors, _) = report(dir.path());
    assert_eq!(code, 1);
    assert_eq!(
        errors,
        ["min_distance = 6 needs at least 6 realizations, there are 5"]
    );

    let dir = turn_signal();
    edit(
        dir.path(),
        "protocol.toml",
        order,
        "order = { file = \"orders.csv\" }\n",
    );
    assert_eq!(
        report(dir.path()).1,
        ["the orders file cannot be read: there is no such file"]
    );
    fs::write(dir.path().join("orders.csv"), "row,position,model\n1,1\n").unwrap();
    assert_eq!(report(dir.path()).1, ["line 2 has 2 of 3 columns"]);
    fs::write(
        dir.path().join("orders.csv"),
        b"row,position,model\n1,1,\xff\n",
    )
    .unwrap();
    assert_eq!(report(dir.path()).1, ["line 2 is not UTF-8"]);
    fs::write(
        dir.path().join("orders.csv"),
        "row,position,model\n1,1,lambda-0.9991\n",
    )
    .unwrap();
    assert_eq!(
        report(dir.path()).1,
        ["the file of orders, row 1: 1 positions instead of 15"]
    );
}

/// The order of row 1 is valid, that of row 2 is not.
#[test]
fn given_orders_are_checked_beyond_the_planned_participants() {
    let dir = turn_signal();
    let design = "order = \"williams\"\nmin_distance = 3\n";
    edit(dir.path(), "protocol.toml", "order = \"blocked\"\n", design);
    edit(
        dir.path(),
        "protocol.toml",
        "participants = 10",
        "participants = 1",
    );
    let (code, errors, _) = report(dir.path());
    assert_eq!(code, 1);
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(errors[0].starts_with("row 2, position 12: "), "{errors:?}");

    // A rehearsal says so before it begins.
    let (code, _, err) = run(dir.path(), &["rehearse", ".", "--participants", "3"]);
    assert_eq!(code, 1);
    assert!(err.contains("row 2, position 12: "), "{err}");
    assert!(!dir.path().join("rehearsal").exists());
}

#[test]
fn a_warning_says_at_how_many_participants_an_order_is_balanced() {
    let dir = turn_signal();
    edit(
        dir.path(),
        "protocol.toml",
        "\"blocked\"\n",
        "\"williams\"\n",
    );
    // only that five realizations are few
    assert_eq!(report(dir.path()).2.len(), 1);
    edit(
        dir.path(),
        "protocol.toml",
        "participants = 10",
        "participants = 12",
    );
    let warnings = report(dir.path()).2;
    assert!(
        warnings.contains(
            &"the orders are balanced at multiples of 10 participants, not at 12".to_owned()
        ),
        "{warnings:?}"
    );
}

#[test]
fn a_path_without_a_protocol_is_one_clear_error() {
    let dir = TempDir::new().unwrap();
    for (args, said) in [
        (["check", "nowhere"], "there is no such file"),
        (["check", "."], "there is no such file"),
        (["check", "/dev/null"], "it is not a regular file"),
    ] {
        let (code, out, err) = run(dir.path(), &args);
        assert_eq!((code, out.as_str()), (1, ""));
        assert!(err.contains(said), "{err}");
        assert!(err.contains("or the folder that contains it"), "{err}");
    }
    fs::write(dir.path().join("p.toml"), b"a = \"\xff\"").unwrap();
    let (code, _, err) = run(dir.path(), &["check", "p.toml"]);
    assert!(code == 1 && err.contains("line 1 is not UTF-8"), "{err}");
    fs::write(dir.path().join("p.toml"), vec![b'#'; 1024 * 1024 + 1]).unwrap();
    let (code, _, err) = run(dir.path(), &["check", "p.toml"]);
    assert!(code == 1 && err.contains("more than 1024 KiB"), "{err}");
}

#[test]
fn a_new_study_has_no_errors_and_overwrites_nothing() {
    let dir = TempDir::new().unwrap();
    let (code, out, err) = run(dir.path(), &["new", "Our Switch"]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(out.contains("study check 'Our Switch'"), "{out}");
    let (code, out, _) = run(dir.path(), &["check", "Our Switch"]);
    assert_eq!(code, 0);
    assert!(
        out.contains("\nour-switch: ok, 3 models, 9 trials"),
        "{out}"
    );

    let before = fs::read(dir.path().join("Our Switch/protocol.toml")).unwrap();
    let (code, _, err) = run(dir.path(), &["new", "Our Switch"]);
    assert_eq!(code, 1);
    assert!(err.contains("the folder is not empty"), "{err}");
    let after = fs::read(dir.path().join("Our Switch/protocol.toml")).unwrap();
    assert_eq!(before, after);
}

#[test]
fn a_replication_takes_the_newest_frozen_protocol_with_a_seed_of_its_own() {
    let dir = TempDir::new().unwrap();
    let study = dir.path().join("results/turn-signal");
    for version in ["1", "2"] {
        let to = study.join("protocol").join(version);
        fs::create_dir_all(to.join("models")).unwrap();
        let from = turn_signal();
        for entry in fs::read_dir(from.path().join("models")).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, to.join("models").join(path.file_name().unwrap())).unwrap();
        }
        edit(
            from.path(),
            "protocol.toml",
            "title = \"",
            &format!("title = \"{version} "),
        );
        fs::copy(from.path().join("protocol.toml"), to.join("protocol.toml")).unwrap();
    }
    for results in ["results", "results/turn-signal"] {
        let name = format!("again-{}", results.replace('/', "-"));
        let (code, _, err) = run(dir.path(), &["new", &name, "--from", results]);
        assert_eq!((code, err.as_str()), (0, ""));
        let text = fs::read_to_string(dir.path().join(&name).join("protocol.toml")).unwrap();
        let head =
            "#:schema protocol.schema.json\n# A replication of the study `turn-signal`, version 2";
        assert!(text.starts_with(head), "{text}");
        assert!(text.contains("title = \"2 Realism"));
        assert!(text.contains("id = \"turn-signal-replication\""));
        assert!(!text.contains("seed = 2007 "));
        assert_eq!(run(dir.path(), &["check", &name]).0, 0);
    }
    let (code, _, err) = run(dir.path(), &["new", "other", "--from", "."]);
    assert_eq!(code, 4, "{err}");
    assert!(!dir.path().join("other").exists());
}

#[test]
fn a_language_that_is_not_shipped_lacks_sentences_and_a_study_can_replace_them() {
    let dir = turn_signal();
    let first = "[design]";
    let text = "[text]\nlang = \"nl\"\nwords = { rate = \"verder\" }\n\n[design]";
    edit(dir.path(), "protocol.toml", first, text);
    let (code, errors, warnings) = report(dir.path());
    assert_eq!((code, errors), (0, Vec::<String>::new()));
    let lacks = |w: &String| w.contains("would be in English: `nl` is not one of en, de");
    assert_eq!(
        warnings.iter().filter(|w| lacks(w)).count(),
        1,
        "{warnings:?}"
    );

    edit(dir.path(), "protocol.toml", "\"nl\"", "\"de-AT\"");
    let (_, _, warnings) = report(dir.path());
    assert!(!warnings.iter().any(lacks), "{warnings:?}");

    edit(
        dir.path(),
        "protocol.toml",
        "rate = \"verder\"",
        "rat = \"x\", trial-of = \"nr {n}\"",
    );
    let (code, errors, _) = report(dir.path());
    assert_eq!(code, 1);
    assert!(
        errors
            .iter()
            .any(|e| e.contains("`rat` is no fixed sentence")),
        "{errors:?}"
    );
    assert!(
        errors
            .iter()
            .any(|e| e.contains("`trial-of` needs the words in braces")),
        "{errors:?}"
    );
}

#[test]
fn a_study_of_pairs_has_no_power_of_a_correlation() {
    let dir = TempDir::new().unwrap();
    let (code, _, err) = run(
        dir.path(),
        &["new", "--seed", "20261123", "pairs", "--kind", "pairs"],
    );
    assert_eq!(code, 0, "{err}");
    let text = fs::read_to_string(dir.path().join("pairs/protocol.toml")).unwrap();
    assert!(text.contains("\nseed = 20261123 "), "{text}");
    let (code, out, err) = run(dir.path(), &["check", "pairs"]);
    assert_eq!(code, 0, "{err}");
    assert!(!out.contains("power:"), "{out}");
    let (code, _, err) = run(dir.path(), &["power", "pairs", "--closed"]);
    assert_eq!(code, 2);
    assert!(err.contains("have no closed form"), "{err}");
}

/// The residual force of a realization is σ_F √(1 − VAF), and a tenth of a newton is noticed;
/// of realizations as weak as a key, a tenth of their force.
#[test]
fn realizations_that_differ_by_less_than_is_felt_give_a_warning() {
    let dir = turn_signal();
    let close = |warnings: &[String]| -> Vec<String> {
        let about = warnings.iter().filter(|w| w.contains("differ too little"));
        about.cloned().collect()
    };
    let (code, _, warnings) = report(dir.path());
    assert_eq!((code, close(&warnings)), (0, Vec::new()), "{warnings:?}");
    let model = |vaf: &str| dir.path().join(format!("models/lambda-{vaf}.toml"));
    for vaf in ["0.9991", "0.9993", "0.9997", "0.9999"] {
        fs::copy(model("0.9995"), model(vaf)).unwrap();
        edit(
            dir.path(),
            &format!("models/lambda-{vaf}.toml"),
            "0.9995",
            vaf,
        );
    }
    let (code, errors, warnings) = report(dir.path());
    assert_eq!(code, 0, "{errors:?}");
    let found = close(&warnings);
    assert_eq!(found.len(), 1, "{warnings:?}");
    assert!(
        found[0].ends_with("and 0.10 N is just noticeable"),
        "{found:?}"
    );
}
