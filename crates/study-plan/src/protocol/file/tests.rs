use super::*;
use crate::protocol::{Answer, DeviceKind, Entry, Order, QuestionKind, Role, Text, kinds};

const LEAST: &str = r#"
format = "study-protocol/1"

[study]
id = "s"
title = "t"
seed = 1

[design]
participants = 2
repetitions = 1
order = "blocked"

[device]
kind = "simulated"
limits = { force_n = 12.0, velocity_mm_s = 1000.0 }

[[models]]
id = "a"
file = "a.toml"

[[models]]
id = "b"
file = "b.toml"

[[questions]]
id = "realism"
kind = "rating"
prompt = "?"
from = 1
to = 7

[analysis]
primary = "realism"
"#;

fn good(text: &str) -> Protocol {
    let parsed = parse("protocol.toml", text);
    assert!(
        parsed.findings.faults.is_empty(),
        "{}",
        parsed.findings.render(false)
    );
    parsed.protocol.unwrap()
}

/// The messages for [`LEAST`] with one thing changed.
fn changed(from: &str, to: &str) -> Vec<String> {
    assert!(LEAST.contains(from), "{from}");
    messages(&LEAST.replacen(from, to, 1))
}

fn messages(text: &str) -> Vec<String> {
    let parsed = parse("protocol.toml", text);
    assert_eq!(
        parsed.protocol.is_none(),
        parsed.findings.has_errors(),
        "{}",
        parsed.findings.render(false)
    );
    parsed
        .findings
        .faults
        .into_iter()
        .map(|f| f.message)
        .collect()
}

#[test]
fn the_least_protocol_gets_the_documented_defaults() {
    let p = good(LEAST);
    assert_eq!(p.design.max_attempts, 3);
    assert_eq!(p.session.entry, Entry::Participant);
    assert_eq!(p.session.resume_within_h, 4.0);
    assert_eq!(p.models[0].role, Role::Test);
    assert_eq!(p.trial.minimum_strokes, 0);
    assert!(p.questions[0].required);
    assert_eq!(p.text, Text::default());
}

#[test]
fn every_key_is_read_and_stored() {
    let p = good(
        r#"
format = "study-protocol/1"
[study]
id = "every-key"
title = "t"
seed = 9223372036854775807
authors = ["A", "B"]
license = "l"
ethics = "e"
contact = "c"
funding = "f"
doi = "d"
[text]
welcome = "w"
instructions = "i"
practice = "p"
break = "b"
end = "e"
lang = "de"
[consent]
document = "form"
version = "2"
[design]
participants = 4
repetitions = 2
order = { file = "orders.csv" }
max_run = 1
min_distance = 2
practice = ["warm"]
breaks = { every = 8, at_least_s = 60 }
max_attempts = 5
[session]
entry = "experimenter"
resume_within_h = 2.5
[device]
kind = "serial"
limits = { force_n = 12, velocity_mm_s = 900.0 }
uncertified = { play = true, force_n = 9.0, reason = "r" }
[trial]
reference = "r"
reference_min_s = 1.5
[[models]]
id = "a"
file = "models/a.toml"
vaf = -0.5
covariates = { lambda = 0.99, n = 3 }
[[models]]
id = "again"
duplicate_of = "a"
[[models]]
id = "warm"
file = "w.toml"
role = "practice"
[[models]]
id = "real"
role = "hidden-reference"
device = "manual"
[[questions]]
id = "realism"
kind = "slider"
prompt = "?"
from = -1.0
to = 1
step = 0.5
labels = { -1 = "no", 1 = "yes" }
[[questions]]
id = "why"
kind = "text"
prompt = "Why?"
required = true
[[setup]]
id = "hand"
kind = "choice"
prompt = "?"
options = ["left", "right"]
required = false
[[intake]]
id = "age"
kind = "number"
prompt = "?"
unit = "years"
min = 18
max = 99.5
[[intake]]
id = "devices"
kind = "choice"
prompt = "?"
options = ["x", "y"]
multiple = true
[[outro]]
id = "more"
kind = "text"
prompt = "?"
[analysis]
primary = "realism"
vaf = "v"
realistic_from = 0.5
unfinished = "exclude"
[[analysis.exclude]]
rule = "constant-rater"
[[analysis.exclude]]
rule = "strokes-below"
strokes = 2
"#,
    );
    assert_eq!(p.study.seed, i64::MAX as u64);
    assert_eq!(p.study.authors, ["A", "B"]);
    assert_eq!(p.text.rest.as_deref(), Some("b"));
    assert_eq!(p.consent.as_ref().unwrap().version, "2");
    assert_eq!(p.design.order, Order::File("orders.csv".to_owned()));
    assert_eq!(p.design.min_distance, Some(2));
    assert_eq!(p.design.breaks.unwrap().at_least_s, 60.0);
    assert_eq!(p.session.entry, Entry::Experimenter);
    assert_eq!(p.device.limits.force_n.get(), 12.0);
    assert_eq!(p.device.uncertified.as_ref().unwrap().reason, "r");
    assert_eq!(p.trial.reference_min_s, 1.5);
    assert_eq!(p.models[0].vaf, Some(-0.5));
    assert_eq!(p.models[0].covariates["n"], 3.0);
    assert_eq!(p.models[1].file.as_deref(), Some("models/a.toml"));
    assert_eq!(p.models[3].device, Some(DeviceKind::Manual));
    let QuestionKind::Slider(kinds::Slider { labels, step, .. }) = &p.questions[0].kind else {
        panic!("{:?}", p.questions[0].kind);
    };
    assert_eq!((labels["-1"].as_str(), *step), ("no", 0.5));
    assert!(p.questions[1].required);
    assert!(!p.setup[0].required);
    assert!(
        p.intake[1]
            .accepts(&Answer::Choice(vec!["x".to_owned(), "y".to_owned()]))
            .is_ok()
    );
    assert!(!p.outro[0].required);
    assert_eq!(
        p.analysis.exclude[1],
        crate::protocol::Exclusion::StrokesBelow(2.0)
    );
    assert_eq!(p.scheduled_models().count(), 3);
}

#[test]
fn a_limit_has_to_be_finite_and_positive() {
    for bad in ["nan", "-nan", "inf", "-1.0", "0"] {
        let found = changed("force_n = 12.0", &format!("force_n = {bad}"));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].starts_with("`device.limits.force_n` has to be a finite number above 0, not "),
            "{found:?}"
        );
    }
    assert_eq!(
        changed(
            "velocity_mm_s = 1000.0 }",
            "velocity_mm_s = 1000.0 }\nuncertified = { play = true, force_n = 13.0, reason = \"r\" }"
        ),
        ["`device.uncertified.force_n` is 13 N, above `device.limits.force_n`, 12 N"]
    );
}

#[test]
fn a_model_file_stays_inside_the_folder() {
    for bad in [
        "../a.toml",
        "/etc/passwd",
        "x/../../a.toml",
        "./a.toml",
        "C:/a.toml",
        "x\\\\a.toml",
        "x//a.toml",
        "x/\\u001b[2J",
    ] {
        let found = changed("\"a.toml\"", &format!("\"{bad}\""));
        assert_eq!(found.len(), 1, "{bad}: {found:?}");
        assert!(
            found[0].starts_with("`models[0].file` cannot be"),
            "{found:?}"
        );
        assert!(!found[0].contains('\u{1b}'));
    }
}

#[test]
fn ids_that_differ_only_in_case_collide() {
    assert_eq!(
        changed("id = \"b\"", "id = \"A\""),
        ["`A` and `a` differ only in case"]
    );
    let twice = LEAST.to_owned()
        + "[[setup]]\nid = \"hand\"\nkind = \"text\"\nprompt = \"?\"\n\
           [[outro]]\nid = \"hand\"\nkind = \"text\"\nprompt = \"?\"\n\
           [[intake]]\nid = \"realism\"\nkind = \"text\"\nprompt = \"?\"\n";
    // `realism` lands in the other table
    assert_eq!(messages(&twice), ["`hand` is there twice"]);
}

#[test]
fn questions_cannot_have_the_names_of_fixed_columns() {
    for (name, section, taken) in [
        ("trial", "questions", true),
        ("VAF", "questions", true),
        ("consent_version", "questions", false),
        ("consent_version", "intake", true),
        ("vaf", "intake", false),
    ] {
        let text =
            format!("{LEAST}[[{section}]]\nid = \"{name}\"\nkind = \"text\"\nprompt = \"?\"\n");
        assert_eq!(messages(&text).len(), usize::from(taken), "{name}");
    }
    assert_eq!(
        changed(
            "file = \"a.toml\"",
            "file = \"a.toml\"\ncovariates = { block = 1, realism = 2 }"
        ),
        [
            "`block` is a column of ratings.csv already",
            "`realism` is a question and a covariate"
        ]
    );
}

#[test]
fn scales_options_and_ranges_are_checked() {
    assert_eq!(
        changed("from = 1", "from = 7"),
        ["the scale of `questions[0]` is a single point: from 7 to 7"]
    );
    assert_eq!(
        changed("from = 1", "from = 8"),
        ["the scale of `questions[0]` is reversed: from 8 to 7"]
    );
    assert_eq!(
        changed("to = 7", "to = 7\nlabels = { 0 = \"none\", x = \"?\" }"),
        [
            "the label at 0 is outside the scale 1 to 7",
            "a label belongs to a whole number, not to `x`"
        ]
    );
    assert_eq!(
        changed("from = 1", "from = -9223372036854775808"),
        ["a rating has at most 101 points, not -9223372036854775808 to 7"]
    );
    let question = |body: &str| {
        messages(&format!(
            "{LEAST}[[outro]]\nid = \"q\"\nprompt = \"?\"\n{body}\n"
        ))
    };
    assert_eq!(
        question("kind = \"choice\"\noptions = []"),
        ["`outro[0].options` is empty"]
    );
    assert_eq!(
        question("kind = \"choice\"\noptions = [\"a\", \"b\", \"a \"]"),
        ["`a ` is there twice"]
    );
    assert_eq!(
        question("kind = \"number\"\nmin = 3\nmax = 2"),
        ["no number lies between min = 3 and max = 2"]
    );
    assert_eq!(
        question("kind = \"number\"\nmin = nan"),
        ["`outro[0].min` has to be a finite number, not NaN"]
    );
    assert_eq!(
        question("kind = \"slider\"\nfrom = 0\nto = 1\nstep = 0"),
        ["`outro[0].step` has to be a finite number above 0, not 0"]
    );
}

#[test]
fn a_vaf_is_at_most_one() {
    for bad in ["1.1", "nan", "inf", "-inf"] {
        let found = changed("id = \"a\"", &format!("id = \"a\"\nvaf = {bad}"));
        assert_eq!(found.len(), 1, "{bad}: {found:?}");
    }
    assert!(changed("id = \"a\"", "id = \"a\"\nvaf = -3.5").is_empty());
}

#[test]
fn duplicates_practice_and_primary_refer_to_existing_ids() {
    assert_eq!(
        changed("id = \"b\"", "id = \"b\"\nduplicate_of = \"c\""),
        ["there is no model `c`"]
    );
    assert_eq!(
        changed("id = \"b\"", "id = \"b\"\nduplicate_of = \"b\""),
        ["`b` cannot be a duplicate of itself"]
    );
    assert_eq!(
        changed("id = \"b\"", "id = \"b\"\nduplicate_of = \"a\""),
        ["a duplicate of `a` has to have the same file"]
    );
    assert_eq!(
        changed("participants = 2", "participants = 2\npractice = [\"bb\"]"),
        ["there is no model `bb`"]
    );
    assert_eq!(
        changed("primary = \"realism\"", "primary = \"realsim\""),
        ["there is no question `realsim`"]
    );
    assert_eq!(
        changed(
            "primary = \"realism\"",
            "primary = \"realism\"\nrealistic_from = 9"
        ),
        ["`analysis.realistic_from` is outside the scale of `realism`"]
    );
    let chain = LEAST.replacen("file = \"a.toml\"", "duplicate_of = \"b\"", 1)
        + "[[models]]\nid = \"c\"\nduplicate_of = \"a\"\n";
    assert_eq!(messages(&chain), ["`a` is itself a duplicate, of `b`"]);
    let words = LEAST.replacen("kind = \"rating\"", "kind = \"text\"", 1);
    let words = words.replacen("from = 1\nto = 7\n", "", 1);
    assert_eq!(
        messages(&words),
        ["`realism` cannot be the primary question: its answers are not numbers"]
    );
}

#[test]
fn minimum_strokes_need_telemetry() {
    let trial = "[trial]\nminimum_strokes = 2\n";
    assert!(messages(&format!("{LEAST}{trial}")).is_empty());
    let manual = LEAST.replacen("file = \"a.toml\"", "device = \"manual\"", 1) + trial;
    let found = messages(&manual);
    assert!(found[0].contains("cannot be reached with `a`"), "{found:?}");
    let process = LEAST.replacen("\"simulated\"", "\"process\"", 1) + trial;
    let parsed = parse("p", &process);
    assert!(parsed.protocol.is_some());
    assert_eq!(parsed.findings.faults.len(), 1);
}

#[test]
fn a_device_that_plays_tables_needs_files() {
    let found = changed("file = \"a.toml\"\n", "");
    assert_eq!(found, ["model `a` has no `file`"]);
    let manual = LEAST
        .replace("file = \"a.toml\"\n", "")
        .replace("file = \"b.toml\"\n", "")
        .replace("\"simulated\"", "\"manual\"")
        .replace("limits = { force_n = 12.0, velocity_mm_s = 1000.0 }\n", "");
    assert!(messages(&manual).is_empty());
    // A program without tables needs no limits of force; with one it does.
    let process = manual.replace("\"manual\"", "\"process\"");
    assert!(messages(&process).is_empty());
    let plays = process.replacen("id = \"a\"\n", "id = \"a\"\nfile = \"a.toml\"\n", 1);
    assert_ne!(plays, process);
    assert_eq!(messages(&plays), ["[device] has no `limits`"]);
}

#[test]
fn seed_and_counts_are_whole_and_not_negative() {
    assert_eq!(
        changed("seed = 1", "seed = -1"),
        ["`study.seed` has to be a whole number, 0 or more, not -1"]
    );
    assert_eq!(
        changed("seed = 1", "seed = 2.5"),
        ["`study.seed` has to be a whole number, not 2.5"]
    );
    assert_eq!(
        changed("seed = 1", "seed = 99999999999999999999"),
        ["`study.seed` has to be a whole number, not one beyond 64 bits"]
    );
    assert_eq!(changed("seed = 1\n", ""), ["[study] has no `seed`"]);
    assert_eq!(
        changed("repetitions = 1", "repetitions = 0"),
        ["`design.repetitions` has to be a whole number from 1 to 10000, not 0"]
    );
    assert_eq!(
        changed(
            "order = \"blocked\"",
            "order = \"blocked\"\nbreaks = { every = 0 }"
        ),
        ["`design.breaks.every` has to be a whole number, 1 or more, not 0"]
    );
    for bad in ["Turn", "", "a_b", "../x"] {
        assert_eq!(changed("id = \"s\"", &format!("id = \"{bad}\"")).len(), 1);
    }
}

#[test]
fn another_format_is_one_clear_fault() {
    let newer = LEAST.replace("study-protocol/1", "study-protocol/4") + "[[new_things]]\n";
    assert_eq!(
        messages(&newer),
        [
            "the format `study-protocol/4` is newer than this program, which reads `study-protocol/3`"
        ]
    );
    let foreign = LEAST.replace("study-protocol/1", "study-model/1");
    assert_eq!(
        messages(&foreign),
        ["`study-model/1` is not a format of a protocol"]
    );
    let none = LEAST.replace("format = \"study-protocol/1\"", "");
    assert_eq!(messages(&none), ["the file has no `format`"]);
}

#[test]
fn newer_keys_need_the_newer_format() {
    let with_key = LEAST.replace("[design]\n", "[design]\norder_version = 2\n");
    assert_eq!(
        messages(&with_key),
        ["`design.order_version` needs the format `study-protocol/3`"]
    );
    let newer = with_key.replace("study-protocol/1", "study-protocol/3");
    assert_eq!(messages(&newer), [""; 0]);
    // Without the key, orders are as they were before there was one.
    let of = |text: &str| parse("p.toml", text).protocol.unwrap().design.order_version;
    assert_eq!(of(LEAST), crate::protocol::OrderVersion::Balanced);
    assert_eq!(of(&newer), crate::protocol::OrderVersion::Unguessable);
}

#[test]
fn keys_about_the_force_need_the_newer_format() {
    let keys = "[device]\ncommissioned_within_days = 30\nself_weigh = true\n";
    let with_keys = LEAST.replace("[device]\n", keys);
    let needs = |key: &str| format!("`device.{key}` needs the format `study-protocol/3`");
    let both = ["commissioned_within_days", "self_weigh"].map(needs);
    assert_eq!(messages(&with_keys), both);
    let newer = with_keys.replace("study-protocol/1", "study-protocol/3");
    assert_eq!(messages(&newer), [""; 0]);
    let of = |text: &str| {
        let device = parse("p.toml", text).protocol.unwrap().device;
        (device.commissioned_within_days, device.self_weigh)
    };
    assert_eq!(of(LEAST), (None, false));
    assert_eq!(of(&newer), (Some(30.0), true));
}

#[test]
fn broken_syntax_hides_missing_keys() {
    let found = changed("seed = 1", "seed = ");
    assert_eq!(found.len(), 1, "{found:?}");
    let found = changed("[design]", "[design");
    assert!(found.len() <= 2, "{found:?}");
}

#[test]
fn too_much_text_is_refused() {
    let long = "x".repeat(64 * 1024 + 1);
    let found = changed("prompt = \"?\"", &format!("prompt = \"{long}\""));
    assert_eq!(
        found,
        ["`questions[0].prompt` is 65537 bytes long, more than 65536"]
    );
    let huge = format!("# {}\n{LEAST}", "x".repeat(MAX_FILE_BYTES));
    assert_eq!(messages(&huge).len(), 1);
}

#[test]
fn a_protocol_without_models_or_questions_is_refused() {
    let found = messages("format = \"study-protocol/1\"\n");
    assert_eq!(
        found,
        [
            "the file has no [study]",
            "the file has no [design]",
            "the file has no [device]",
            "the file has no [analysis]",
            "nothing to present: no [[models]] whose role is not practice",
            "nothing to ask: no [[questions]]",
        ]
    );
    assert!(!messages("").is_empty());
}

#[test]
fn spans_are_recorded_for_later_checks() {
    let parsed = parse("p", LEAST);
    assert_eq!(&LEAST[parsed.spans["models[1].file"].clone()], "\"b.toml\"");
    assert_eq!(&LEAST[parsed.spans["design.order"].clone()], "\"blocked\"");
    let files: Vec<&str> = parsed.named.iter().map(|n| n.file.as_str()).collect();
    assert_eq!(files, ["a.toml", "b.toml"]);
}

#[test]
fn any_text_is_read_without_a_panic() {
    for end in 0..LEAST.len() {
        if LEAST.is_char_boundary(end) {
            parse("p", &LEAST[..end]).findings.render(false);
        }
    }
    let bom = format!("\u{feff}{LEAST}");
    assert!(parse("p", &bom).protocol.is_some());
}

mod adjustment;
mod factors;
mod fits;
mod identification;
mod keys;
mod media;
mod outcomes;
mod parts;
mod questionnaires;
mod random;
mod ranking;
mod relative;
mod similarity;
mod standard;
