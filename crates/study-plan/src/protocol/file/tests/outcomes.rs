//! `[[outcomes]]`.

use super::super::parse;
use crate::protocol::{
    BetterEnd, Clock, Measure, OutcomeFamily, Telemetry, Transform, fingerprint,
};

const STUDY: &str = r#"
format = "study-protocol/3"
study = { id = "x", title = "X", seed = 1 }
device = { kind = "manual", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
design = { participants = 4, repetitions = 1, order = "blocked" }
questions = [{ id = "rough", kind = "rating", prompt = "How rough?", from = 1, to = 7 }]
analysis = { primary = "rough" }
models = [{ id = "a", covariates = { mass = 1.0 } }, { id = "b", covariates = { mass = 2.0 } }]
"#;

fn faults(outcomes: &str) -> String {
    let parsed = parse("p.toml", &format!("{STUDY}{outcomes}"));
    assert!(parsed.protocol.is_none(), "{outcomes}");
    parsed.findings.render(false)
}

#[test]
fn an_outcome_is_read_with_its_defaults() {
    let outcomes = r#"
outcomes = [
    { id = "time", from = "clock", unit = "s", better = "lower", transform = "log" },
    { id = "answer", from = "clock", measure = "response" },
]
"#;
    let parsed = parse("p.toml", &format!("{STUDY}{outcomes}"));
    let protocol = parsed.protocol.unwrap();
    let [time, answer] = &protocol.outcomes[..] else {
        panic!("{:?}", protocol.outcomes)
    };
    assert_eq!(time.measure, Measure::Clock(Clock::Exploration));
    assert_eq!(
        (time.better, time.transform),
        (Some(BetterEnd::Lower), Transform::Log)
    );
    assert_eq!(answer.measure, Measure::Clock(Clock::Response));
    assert_eq!(
        (answer.better, answer.transform),
        (None, Transform::Identity)
    );
    assert_eq!(
        time.in_words(),
        "time (exploration time, s, lower is better, log)"
    );
}

#[test]
fn a_number_of_the_device_has_a_key_with_its_unit() {
    let study = STUDY.replace(
        "\"manual\", limits = { force_n = 12.0, velocity_mm_s = 1000.0 }",
        "\"process\"",
    );
    let of = |outcomes: &str| parse("p.toml", &format!("{study}outcomes = {outcomes}"));
    let parsed = of(r#"[
  { id = "duration", from = "device", measure = "time", unit = "s", better = "lower" },
  { id = "missed", from = "device", measure = "errors", model = "poisson" },
]"#);
    let protocol = parsed.protocol.unwrap();
    let keys: Vec<String> = (protocol.numbers_of_device())
        .map(|(id, number)| format!("{id} {}", number.key()))
        .collect();
    assert_eq!(keys, ["duration time_s", "missed errors"]);
    assert_eq!(
        protocol.outcomes[0].in_words(),
        "duration (time that the device sends, s, lower is better)"
    );
    for (outcomes, told) in [
        (r#"[{ id = "a", from = "device" }]"#, "has no `measure`"),
        (
            r#"[{ id = "a", from = "device", measure = "time", unit = "·" }]"#,
            "has no letters for the key",
        ),
        (
            r#"[{ id = "a", from = "device", measure = "t" }, { id = "b", from = "device", measure = "t" }]"#,
            "are the same measurement",
        ),
        (
            r#"[{ id = "a", from = "device", measure = "t", unit = "mN" }, { id = "b", from = "device", measure = "t", unit = "MN" }]"#,
            "are the same measurement",
        ),
    ] {
        let parsed = of(outcomes);
        let found = parsed.findings.render(false);
        assert!(
            parsed.protocol.is_none() && found.contains(told),
            "{outcomes}: {found}"
        );
    }
    let by_hand = faults(r#"outcomes = [{ id = "a", from = "device", measure = "time" }]"#);
    assert!(
        by_hand.contains("sent by a controller program"),
        "{by_hand}"
    );
}

/// They belong to the analysis: nothing else of a study changes, and it can be amended.
#[test]
fn outcomes_are_part_of_the_analysis_and_of_no_other_fingerprint() {
    let prints = |outcomes: &str| {
        let protocol = parse("p.toml", &format!("{STUDY}{outcomes}"))
            .protocol
            .unwrap();
        fingerprint::parts(&protocol, &Default::default(), None).fingerprints()
    };
    let without = prints("");
    let with = prints("outcomes = [{ id = \"time\", from = \"clock\" }]");
    assert_eq!(without.stimulus, with.stimulus);
    assert_eq!(without.wording, with.wording);
    assert_ne!(without.analysis, with.analysis);
    let other = prints("outcomes = [{ id = \"time\", from = \"clock\", transform = \"log\" }]");
    assert_ne!(other.analysis, with.analysis);
}

#[test]
fn faulty_outcomes_are_refused_in_words() {
    for (outcomes, told) in [
        (r#"[{ id = "time" }]"#, "has no `from`"),
        (r#"[{ from = "clock" }]"#, "has no `id`"),
        (
            r#"[{ id = "time", from = "clok" }]"#,
            "did you mean `clock`?",
        ),
        (
            r#"[{ id = "time", from = "clock", measure = "explore" }]"#,
            "it is one of `exploration`, `response`",
        ),
        (
            r#"[{ id = "time", from = "clock", unit = "ms" }]"#,
            "the exploration time is measured in s, not in ms",
        ),
        (
            r#"[{ id = "time", from = "clock", beter = "lower" }]"#,
            "did you mean `better`?",
        ),
        (
            r#"[{ id = "time", from = "clock" }, { id = "Time", from = "clock", measure = "response" }]"#,
            "differ only in case",
        ),
        (
            r#"[{ id = "time", from = "clock" }, { id = "again", from = "clock" }]"#,
            "`time` and `again` are the same measurement",
        ),
        (
            r#"[{ id = "rough", from = "clock" }]"#,
            "is a question and an outcome",
        ),
        (
            r#"[{ id = "mass", from = "clock" }]"#,
            "is a covariate and an outcome",
        ),
        (
            r#"[{ id = "group", from = "clock" }]"#,
            "is a factor and an outcome",
        ),
        (
            r#"[{ id = "strokes", from = "clock" }]"#,
            "is a column of ratings.csv already",
        ),
    ] {
        let found = faults(&format!("outcomes = {outcomes}"));
        assert!(found.contains(told), "{outcomes}: {found}");
    }
    let all: Vec<String> = (0..13)
        .map(|i| format!("{{ id = \"o{i}\", from = \"clock\" }}"))
        .collect();
    let found = faults(&format!("outcomes = [{}]", all.join(", ")));
    assert!(found.contains("more than 12 outcomes"), "{found}");
}

#[test]
fn outcomes_need_the_third_format_and_rated_trials() {
    let older = STUDY.replace("protocol/3", "protocol/1");
    let parsed = parse(
        "p.toml",
        &format!("{older}outcomes = [{{ id = \"t\", from = \"clock\" }}]"),
    );
    let found = parsed.findings.render(false);
    assert!(
        found.contains("needs the format `study-protocol/3`"),
        "{found}"
    );
    let pairs = STUDY
        .replace("repetitions = 1, order = \"blocked\" ", "")
        .replace("analysis = { primary = \"rough\" }", "analysis = { primary = \"which\" }")
        .replace("questions = [{ id = \"rough\", kind = \"rating\", prompt = \"How rough?\", from = 1, to = 7 }]", "");
    let pairs = format!(
        "{pairs}parts = [{{ id = \"which\", kind = \"pairs\", prompt = \"Which?\", repetitions = 1 }}]\n\
         outcomes = [{{ id = \"time\", from = \"clock\" }}]\n"
    );
    let found = parse("p.toml", &pairs).findings.render(false);
    assert!(
        found.contains("the primary question, `which`, is the answer of a part of another kind"),
        "{found}"
    );
}

#[test]
fn telemetry_is_measured_in_its_units_and_not_of_samples_mounted_by_hand() {
    let simulated = STUDY
        .replace("kind = \"manual\"", "kind = \"simulated\"")
        .replace("id = \"a\",", "id = \"a\", file = \"a.toml\",")
        .replace("id = \"b\",", "id = \"b\", file = \"b.toml\",");
    let outcomes = r#"outcomes = [
    { id = "force", from = "telemetry", measure = "peak-force", unit = "N" },
    { id = "way", from = "telemetry", measure = "path", unit = "mm" },
    { id = "work", from = "telemetry", measure = "energy", unit = "J" },
    { id = "beyond", from = "telemetry", measure = "overshoot", unit = "mm" },
    { id = "rest", from = "telemetry", measure = "dwell", unit = "s" },
    { id = "presses", from = "telemetry", measure = "strokes", unit = "1" },
]"#;
    let parsed = parse("p.toml", &format!("{simulated}{outcomes}"));
    let found = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{found}"));
    assert_eq!(
        protocol.outcomes[0].measure,
        Measure::Telemetry(Telemetry::PeakForce)
    );
    let found = faults(outcomes);
    assert!(
        found.contains("`force` needs telemetry, and samples mounted by hand report none"),
        "{found}"
    );
    for (outcome, told) in [
        (r#"{ id = "f", from = "telemetry" }"#, "has no `measure`"),
        (
            r#"{ id = "f", from = "telemetry", measure = "exploration" }"#,
            "it is one of `peak-force`, `path`, `strokes`, `energy`, `overshoot`, `dwell`",
        ),
        (
            r#"{ id = "f", from = "telemetry", measure = "energy", unit = "mJ" }"#,
            "the energy of the hand is measured in J, not in mJ",
        ),
    ] {
        let parsed = parse("p.toml", &format!("{simulated}outcomes = [{outcome}]"));
        let found = parsed.findings.render(false);
        assert!(parsed.protocol.is_none() && found.contains(told), "{found}");
    }
}

#[test]
fn answers_are_outcomes_where_they_are_numbers() {
    let items = r#"questions = [
    { id = "rough", kind = "rating", prompt = "How rough?", from = 1, to = 7 },
    { id = "errors", kind = "number", prompt = "Errors", unit = "errors" },
    { id = "mental", kind = "slider", prompt = "Mental demand", from = 0, to = 100, step = 5 },
    { id = "effort", kind = "slider", prompt = "Effort", from = 0, to = 100, step = 5 },
    { id = "why", kind = "text", prompt = "Why?" },
]"#;
    let one = "questions = [{ id = \"rough\", kind = \"rating\", prompt = \"How rough?\", from = 1, to = 7 }]";
    assert!(STUDY.contains(one));
    let study = STUDY.replace(one, items);
    let read = |outcomes: &str| {
        let parsed = parse("p.toml", &format!("{study}outcomes = [{outcomes}]"));
        (parsed.protocol, parsed.findings.render(false))
    };
    let good = r#"
    { id = "load", from = "answers", questions = ["mental", "effort"], better = "lower" },
    { id = "wrong", from = "answers", questions = ["errors"], unit = "errors", better = "lower" },
    { id = "hits", from = "answers", questions = ["rough"], model = "binomial", of = 7 },
    { id = "time", from = "clock", model = "gamma" },
"#;
    let (protocol, found) = read(good);
    let protocol = protocol.unwrap_or_else(|| panic!("{found}"));
    let words: Vec<String> = protocol.outcomes.iter().map(|o| o.in_words()).collect();
    assert_eq!(
        words,
        [
            "load (mean of 2 answers, points, lower is better)",
            "wrong (answer to errors, errors, lower is better)",
            "hits (answer to rough, points, binomial model of 7 besides)",
            "time (exploration time, s, gamma model besides)",
        ]
    );
    let hits = &protocol.outcomes[2];
    assert_eq!(
        (hits.model, hits.of),
        (Some(OutcomeFamily::Binomial), Some(7))
    );
    for (outcome, told) in [
        (r#"{ id = "x", from = "answers" }"#, "has no `questions`"),
        (
            r#"{ id = "x", from = "answers", questions = [] }"#,
            "an outcome of no question",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["efort"] }"#,
            "did you mean `effort`?",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["why"] }"#,
            "the answers to `why` are no numbers",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["effort", "effort"] }"#,
            "`effort` is there twice",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["errors"], model = "binomial" }"#,
            "a binomial model needs the number of trials",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["errors"], model = "poisson", of = 5 }"#,
            "`of` belongs to a binomial model",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["errors"], model = "normal" }"#,
            "it is one of `poisson`, `binomial`, `gamma`",
        ),
        (
            r#"{ id = "x", from = "clock", model = "poisson" }"#,
            "a Poisson model is of counts, and the exploration time is none",
        ),
        (
            r#"{ id = "x", from = "answers", questions = ["mental", "effort"], model = "binomial", of = 100 }"#,
            "a binomial model is of counts, and the mean of 2 answers is none",
        ),
    ] {
        let (protocol, found) = read(outcome);
        assert!(
            protocol.is_none() && found.contains(told),
            "{outcome}: {found}"
        );
    }
}
