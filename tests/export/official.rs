//! What other programs say of the data sets: the official validators, and R. The tests
//! are started by `.ci/export`, which gets the validators; what is missing is said.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stderr, reason = "says what is missing on this machine")]

use crate::studies::{
    export, factorial_with_groups, files, grouped, hostile, japanese, new, of_groups_and_sessions,
    real_study, rehearsed,
};
use crate::support::{copy_folder, repository, study};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An official validator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Validator {
    Bids,
    PsychDs,
    Frictionless,
}

use Validator::{Bids, Frictionless, PsychDs};

/// Starts a program; `None` if there is none of this name.
fn started(command: &mut Command) -> Option<Output> {
    command.output().ok()
}

impl Validator {
    fn format(self) -> &'static str {
        match self {
            Bids => "bids",
            PsychDs => "psych-ds",
            Frictionless => "frictionless",
        }
    }

    /// The errors that it finds; `None` if it is not here.
    fn errors(self, folder: &Path) -> Option<Vec<String>> {
        let texts = |list: &Value, key: &str| -> Vec<String> {
            let all = list.as_array().into_iter().flatten();
            all.map(|e| e[key].as_str().unwrap_or_default().to_owned())
                .collect()
        };
        match self {
            Bids => {
                // By default it reads a thousand rows of a table.
                let options = ["--max-rows", "-1", "--format", "json"];
                let mut command = Command::new("bids-validator-deno");
                let told = report(&started(command.args(options).arg(folder))?);
                let issues = told["issues"]["issues"].as_array().unwrap().clone();
                let is_error = |i: &Value| i["severity"] == "error";
                let errors: Vec<Value> = issues.into_iter().filter(is_error).collect();
                Some(texts(&Value::from(errors), "code"))
            }
            Frictionless => {
                let options = ["validate", "--json", "datapackage.json"];
                let mut command = Command::new("frictionless");
                let told = report(&started(command.args(options).current_dir(folder))?);
                let mut errors = texts(&told["errors"], "type");
                for task in told["tasks"].as_array().unwrap() {
                    errors.extend(texts(&task["errors"], "type"));
                }
                assert_eq!(told["valid"] == true, errors.is_empty(), "{told}");
                Some(errors)
            }
            PsychDs => {
                let command = std::env::var_os("PSYCHDS_VALIDATOR")?;
                // It ends with 0 also if the data set is not valid.
                let told = report(&started(Command::new(command).arg(folder).arg("--json"))?);
                let issues = told["issues"].as_array().unwrap().clone();
                let is_error = |i: &Value| i["severity"] == "error";
                let errors: Vec<Value> = issues.into_iter().filter(is_error).collect();
                let errors = texts(&Value::from(errors), "key");
                assert_eq!(told["valid"] == true, errors.is_empty(), "{told}");
                Some(errors)
            }
        }
    }

    fn is_here(self) -> bool {
        let folder = tempfile::tempdir().unwrap();
        let asked = match self {
            Bids => started(Command::new("bids-validator-deno").arg("--version")),
            Frictionless => started(Command::new("frictionless").arg("--version")),
            PsychDs => std::env::var_os("PSYCHDS_VALIDATOR")
                .and_then(|c| started(Command::new(c).arg(folder.path()).arg("--json"))),
        };
        let here = asked.is_some_and(|o| o.status.success());
        if !here {
            eprintln!("SKIPPED: no validator of {}", self.format());
        }
        here
    }
}

/// The first JSON document of what a program printed.
fn report(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    let start = text.find('{').unwrap_or_else(|| panic!("{output:?}"));
    let mut documents = serde_json::Deserializer::from_str(&text[start..]).into_iter();
    documents.next().unwrap().unwrap()
}

/// Writes a text in the place of another in a file.
fn plant(folder: &Path, file: &str, old: &str, new: &str) {
    let path = folder.join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(old), "{file} has no {old}");
    fs::write(path, text.replacen(old, new, 1)).unwrap();
}

/// The studies that every validator has to accept.
fn studies(home: &Path) -> Vec<(PathBuf, &'static [&'static str])> {
    let of = |name: &str| {
        let folder = home.join(name);
        fs::create_dir(&folder).unwrap();
        folder
    };
    const SIMULATED: &[&str] = &[
        "--include",
        "simulated",
        "--with-practice",
        "--with-telemetry",
    ];
    let paper = PathBuf::from(repository("protocols/turn-signal"));
    let extended = PathBuf::from(repository("protocols/turn-signal-extended"));
    let pairs = of("pairs");
    let tracks = of("tracks");
    let several = |kind: &str, participants| {
        let folder = of(&format!("several-{kind}"));
        let protocol = of_groups_and_sessions(kind, &folder);
        (rehearsed(&protocol, participants, &folder, &[]), SIMULATED)
    };
    vec![
        (rehearsed(&paper, 3, &of("paper"), &[]), SIMULATED),
        (
            rehearsed(&extended, 3, &of("extended"), &["--faults"]),
            SIMULATED,
        ),
        (rehearsed(&new("pairs", &pairs), 3, &pairs, &[]), SIMULATED),
        (rehearsed(&new("2ifc", &tracks), 2, &tracks, &[]), SIMULATED),
        (
            real_study(&extended, &["P01", "P02"], &of("real"), |_, _| true),
            &["--with-telemetry"],
        ),
        (japanese(&of("japanese")), &[]),
        (
            japanese(&of("redacted")),
            &["--redact", "ids,times", "--without-comments"],
        ),
        // Declined and missing answers, and a comment of everything.
        (hostile(&of("hostile")), &[]),
        (grouped(4, &of("grouped")), SIMULATED),
        (
            rehearsed(&new("abx", &of("abx")), 3, &home.join("abx"), &[]),
            SIMULATED,
        ),
        (
            rehearsed(
                &factorial_with_groups(&of("factors")),
                10,
                &home.join("factors"),
                &[],
            ),
            SIMULATED,
        ),
        several("pairs", 8),
        several("abx", 6),
        several("magnitude", 6),
        several("mushra", 6),
        several("identification", 6),
        several("similarity", 6),
        several("ranking", 6),
        several("adjustment", 6),
    ]
}

#[test]
#[ignore = "needs the validators: .ci/export gets them"]
fn the_official_validators_accept_every_study() {
    let home = tempfile::tempdir().unwrap();
    let here: Vec<Validator> = [Bids, PsychDs, Frictionless]
        .into_iter()
        .filter(|v| v.is_here())
        .collect();
    for (n, (study, more)) in studies(home.path()).iter().enumerate() {
        for validator in &here {
            let format = validator.format();
            let mut versions = vec![more.to_vec()];
            if *validator == Frictionless {
                versions.push([more, &["--profile", "1"][..]].concat());
            }
            for (version, more) in versions.iter().enumerate() {
                let name = format!("{n}-{format}-{version}");
                let (out, _) = export(study, format, home.path(), &name, more);
                let errors = validator.errors(&out).unwrap();
                assert!(
                    errors.is_empty(),
                    "{} {format} {more:?}: {errors:?}",
                    study.display()
                );
            }
        }
    }
    eprintln!("accepted by {here:?}");
}

#[test]
#[ignore = "needs the validators: .ci/export gets them"]
fn each_validator_refuses_planted_errors() {
    let home = tempfile::tempdir().unwrap();
    let study = hostile(home.path());
    let beh = "sub-001/beh/sub-001_task-turnsignal_beh.tsv";
    let psych = "data/study-turnsignal_data.csv";
    // The file, what stands there, what is planted, and the error.
    type Planted = (
        Validator,
        &'static str,
        &'static str,
        &'static str,
        &'static str,
    );
    let errors: [Planted; 14] = [
        (
            Bids,
            beh,
            concat!("simulated-1\tOkafor\t", env!("CARGO_PKG_VERSION"), "\t1\t"),
            concat!("simulated-1\tOkafor\t", env!("CARGO_PKG_VERSION"), "\t1\t9"),
            "TSV_VALUE_INCORRECT_TYPE",
        ),
        (
            Bids,
            beh,
            "\tTRUE\ttest\t",
            "\tnobody\ttest\t",
            "TSV_VALUE_INCORRECT_TYPE",
        ),
        (Bids, beh, "n/a", "", "TSV_VALUE_INCORRECT_TYPE"),
        (
            Bids,
            "participants.tsv",
            "sub-001",
            "sub-002",
            "PARTICIPANT_ID_MISMATCH",
        ),
        (
            Bids,
            "dataset_description.json",
            "\"Name\": \"=",
            "\"Title\": \"=",
            "JSON_KEY_REQUIRED",
        ),
        (
            PsychDs,
            psych,
            "study,participant",
            "study,who",
            "CSV_COLUMN_MISSING_FROM_METADATA",
        ),
        (
            PsychDs,
            psych,
            "study,participant,",
            "\u{feff}study,participant,",
            "CSV_COLUMN_MISSING_FROM_METADATA",
        ),
        (
            PsychDs,
            psych,
            "turn-signal,001,",
            "turn-signal,001,x,",
            "CSV_HEADER_LENGTH_MISMATCH",
        ),
        (
            PsychDs,
            "dataset_description.json",
            "\"name\": \"study\"",
            "\"name\": \"other\"",
            "CSV_COLUMN_MISSING_FROM_METADATA",
        ),
        (
            Frictionless,
            "ratings.csv",
            concat!("simulated-1,Okafor,", env!("CARGO_PKG_VERSION"), ",1,"),
            concat!("simulated-1,Okafor,", env!("CARGO_PKG_VERSION"), ",1,9"),
            "constraint-error",
        ),
        (
            Frictionless,
            "ratings.csv",
            ",TRUE,test,",
            ",nobody,test,",
            "constraint-error",
        ),
        (
            Frictionless,
            "ratings.csv",
            "turn-signal,001,",
            "turn-signal,P99,",
            "foreign-key",
        ),
        (
            Frictionless,
            "ratings.csv",
            "turn-signal,001,1,4,2,",
            "turn-signal,001,1,4,1,",
            "primary-key",
        ),
        (
            Frictionless,
            "participants.csv",
            "001,1,done,",
            "001,1,gone,",
            "constraint-error",
        ),
    ];
    for validator in [Bids, PsychDs, Frictionless]
        .into_iter()
        .filter(|v| v.is_here())
    {
        let (good, _) = export(
            &study,
            validator.format(),
            home.path(),
            validator.format(),
            &[],
        );
        let mut refused = 0;
        for (n, (_, file, old, new, code)) in errors.iter().filter(|e| e.0 == validator).enumerate()
        {
            let bad = home.path().join(format!("{}-{n}", validator.format()));
            copy_folder(&good, &bad);
            plant(&bad, file, old, new);
            let found = validator.errors(&bad).unwrap();
            assert!(
                found.iter().any(|f| f == code),
                "{validator:?} {file} {old} → {new}: {found:?}"
            );
            refused += 1;
        }
        assert!(refused >= 4, "{validator:?}");
        eprintln!("{validator:?}: {refused} planted errors refused");
    }
}

/// The required checks of RO-Crate 1.1 that a folder does not pass; `None` if the validator is not
/// here, or cannot get the vocabulary, for which it needs the network.
fn ro_crate(folder: &Path, home: &Path) -> Option<Vec<String>> {
    let out = home.join("ro-crate.json");
    let _ = fs::remove_file(&out);
    let options = "-y validate --no-paging -p ro-crate-1.1 -l required -f json -o";
    let mut command = Command::new("rocrate-validator");
    command.args(options.split(' ')).arg(&out).arg(folder);
    started(&mut command)?;
    let told: Value = serde_json::from_slice(&fs::read(out).ok()?).unwrap();
    let issues = told["issues"].as_array().unwrap().iter();
    let codes = issues.map(|issue| issue["check"]["identifier"].as_str().unwrap().to_owned());
    let codes: Vec<String> = codes.collect();
    assert_eq!(told["passed"] == true, codes.is_empty(), "{told}");
    Some(codes)
}

#[test]
#[ignore = "needs the validators: .ci/export gets them"]
fn bundles_are_data_packages_and_ro_crates() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, told) = study(arguments, home.path());
        assert_eq!(code, 0, "{told}");
        out
    };
    for (id, curve, license) in [
        ("akko-blue", "Akko_Blue_V2", "any use, with credit"),
        ("jwk-bluey", "JWK_Bluey", "CC-BY-4.0"),
    ] {
        let curve = repository(&format!("tests/data/switches/{curve}.csv"));
        let model = repository(&format!("protocols/keyboard/models/{id}.toml"));
        let credit = "measured by ThereminGoat (theremingoat.com)";
        let recording = format!("{id}.csv");
        run(&[
            "import",
            "force-curve",
            &curve,
            "-o",
            &recording,
            "--credit",
            credit,
        ]);
        let stated = [
            "--instrument",
            "a \"tester\"",
            "--published",
            "2024-05-17",
            "--license",
            license,
        ];
        let pack = [&["stimulus", "pack", &model, &recording][..], &stated].concat();
        let address = run(&pack);
        let address = address.trim().trim_start_matches("sha256:");
        run(&[
            "stimulus",
            "unpack",
            &format!("bundles/{address}.tar"),
            "--out",
            id,
        ]);
        let folder = home.path().join(id);
        if Frictionless.is_here() {
            assert_eq!(Frictionless.errors(&folder), Some(Vec::new()));
            let bad = home.path().join(format!("{id}-changed"));
            copy_folder(&folder, &bad);
            plant(&bad, "recordings/01.csv", "t_s,x_mm", "t_s,y_mm");
            assert_ne!(Frictionless.errors(&bad), Some(Vec::new()));
        }
        match ro_crate(&folder, home.path()) {
            Some(errors) => assert!(errors.is_empty(), "{errors:?}"),
            None => eprintln!("SKIPPED: no validator of RO-Crate, or no network for it"),
        }
        let bad = home.path().join(format!("{id}-undated"));
        copy_folder(&folder, &bad);
        plant(
            &bad,
            "ro-crate-metadata.json",
            "datePublished",
            "dateModified",
        );
        let found = ro_crate(&bad, home.path());
        assert!(found.is_none_or(|codes| codes == ["ro-crate-1.1_8.4"]));
    }
}

/// Runs R in a folder; `None` if it or one of its packages is not here.
fn r(folder: &Path, arguments: &[&str]) -> Option<(bool, String)> {
    let packages = "q(status = !all(sapply(c('lme4', 'lmerTest', 'ordinal'), requireNamespace, quietly = TRUE)))";
    let asked = started(Command::new("Rscript").args(["-e", packages]));
    if !asked.is_some_and(|o| o.status.success()) {
        eprintln!("SKIPPED: no R with lme4, lmerTest and ordinal");
        return None;
    }
    let output = started(Command::new("Rscript").args(arguments).current_dir(folder)).unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    Some((output.status.success(), text.into_owned()))
}

#[test]
#[ignore = "needs R with lme4, lmerTest and ordinal: .ci/export runs it"]
fn r_comes_to_the_same_numbers() {
    let home = tempfile::tempdir().unwrap();
    for (n, (study, more)) in studies(home.path()).iter().enumerate() {
        let (out, _) = export(study, "r", home.path(), &format!("r-{n}"), more);
        let Some((good, said)) = r(&out, &["analysis.R"]) else {
            return;
        };
        assert!(good, "{}: {said}", study.display());
        let compared = fs::read_to_string(out.join("headline.csv")).unwrap();
        let fitted = !said.contains("the ordinal model is not compared");
        let is_compared = |l: &&str| !l.contains(",,") && (fitted || !l.starts_with("clmm_"));
        let numbers = compared.lines().skip(1).filter(is_compared).count();
        let expected = match numbers {
            0 => "no number is computed again here".to_owned(),
            _ => format!("all {numbers} numbers agree"),
        };
        assert!(said.contains(&expected), "{said}");
        eprintln!("{}: {expected}", study.display());
        // The same from any folder and in a locale without Unicode, and the chunks of the
        // Quarto document.
        if n == 7 {
            let script = out.join("analysis.R");
            let (good, said) = r(home.path(), &[script.to_str().unwrap()]).unwrap();
            assert!(good, "{said}");
            let document = fs::read_to_string(out.join("analysis.qmd")).unwrap();
            let chunks = document
                .split("```{r}\n")
                .skip(1)
                .map(|c| c.split("```").next().unwrap());
            fs::write(out.join("chunks.R"), chunks.collect::<String>()).unwrap();
            let (good, said) = r(&out, &["chunks.R"]).unwrap();
            assert!(good && said.contains("numbers agree"), "{said}");
        }
    }
}

/// A participant with one answer has no variance of guesses, and of an answer that was corrected after the right label was told the
/// first one counts.
#[test]
#[ignore = "needs R with lme4, lmerTest and ordinal: .ci/export runs it"]
fn r_counts_the_answers_of_an_identification_as_the_program_does() {
    let home = tempfile::tempdir().unwrap();
    let kind = "identification";
    let protocol = new(kind, home.path()).join("protocol.toml");
    let text = fs::read_to_string(&protocol).unwrap();
    let text = text.replace("repetitions = 6 ", "repetitions = 1 ");
    let text = text.replace("feedback = \"practice\" ", "feedback = \"always\" ");
    let groups = "\n[groups]\n[[groups.list]]\nid = \"all\"\nshare = 3\n[[groups.list]]\nid = \"one\"\nmodels = [\"low-soft\"]\n";
    fs::write(&protocol, text + groups).unwrap();
    let folder = rehearsed(&home.path().join(kind), 8, home.path(), &[]);
    let table = fs::read_to_string(folder.join("ratings.csv")).unwrap();
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let at = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let wrong = lines
        .find(|row| row[at("practice")] == "false" && row[at("correct")] == "false")
        .unwrap();
    // Labels are entered by their numbers.
    let models = ["low-soft", "low-crisp", "high-soft", "high-crisp"];
    let right = models.iter().position(|model| *model == wrong[at("model")]);
    let right = (right.unwrap() + 1).to_string();
    let (code, out, err) = study(
        &[
            "correct",
            folder.to_str().unwrap(),
            wrong[at("participant")],
            "--trial",
            wrong[at("trial")],
            "--question",
            "which",
            "--to",
            &right,
            "--reason",
            "a slip",
        ],
        home.path(),
    );
    assert_eq!(code, 0, "{out}{err}");
    let simulated = ["--include", "simulated"];
    let (out, _) = export(&folder, "r", home.path(), "r", &simulated);
    let exported = fs::read_to_string(out.join("ratings.csv")).unwrap();
    assert!(
        exported
            .lines()
            .next()
            .unwrap()
            .contains("answer_before_feedback")
    );
    let Some((good, said)) = r(&out, &["analysis.R"]) else {
        return;
    };
    assert!(good && said.contains("numbers agree"), "{said}");
    assert!(
        said.contains("Participants with a single answer are left out"),
        "{said}"
    );
}

#[test]
#[ignore = "needs R with lme4, lmerTest and ordinal: .ci/export runs it"]
fn r_refuses_changed_tables_and_other_numbers() {
    let home = tempfile::tempdir().unwrap();
    let (good, _) = export(&hostile(home.path()), "r", home.path(), "good", &[]);
    let before = files(&good);
    for (n, (file, old, new, why)) in [
        (
            "ratings.csv",
            ",ok,",
            ",missing,",
            "was changed after the export",
        ),
        (
            "headline.csv",
            "corr/pearson/r,0.",
            "corr/pearson/r,0.1",
            "some numbers differ",
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let bad = home.path().join(format!("bad-{n}"));
        copy_folder(&good, &bad);
        plant(&bad, file, old, new);
        let Some((fine, said)) = r(&bad, &["analysis.R"]) else {
            return;
        };
        assert!(!fine && said.contains(why), "{said}");
    }
    assert!(before == files(&good), "a run writes nothing");
}
