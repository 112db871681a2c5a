//! `[[questionnaires]]`.

use crate::protocol::file::parse;
use crate::protocol::{
    Answer, BetterEnd, Inventory, Measure, Occasion, QuestionKind, Scored, kinds,
};
use study_base::diagnostic::Fault;

const STUDY: &str = r#"
format = "study-protocol/1"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4, repetitions = 1, order = "blocked" }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "realism" }
models = [{ id = "a", file = "a.toml" }]
questions = [{ id = "realism", kind = "rating", prompt = "?", from = 1, to = 7 }]
outro = [{ id = "comment", kind = "text", prompt = "?" }]
"#;

fn with(questionnaires: &str) -> String {
    format!("{STUDY}{questionnaires}")
}

const BOTH: &str = r#"
[[questionnaires]]
id = "sus"
kind = "sus"
system = "switch"

[[questionnaires]]
id = "load"
kind = "nasa-tlx"
labels = ["gering", "hoch"]
"#;

#[test]
fn items_are_asked_after_the_outro() {
    let parsed = parse("p", &with(BOTH));
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    let ids: Vec<&str> = protocol.outro.iter().map(|q| q.id.as_str()).collect();
    assert_eq!(ids.len(), 1 + 10 + 6);
    assert_eq!(ids[..3], ["comment", "sus_1", "sus_2"]);
    assert_eq!(ids[10..12], ["sus_10", "load_mental"]);
    let prompt = &protocol.outro[3].prompt;
    assert_eq!(prompt, "I thought the switch was easy to use.");
    assert!(protocol.outro[1].required);
    assert!(protocol.outro[1].accepts(&Answer::Rating(5)).is_ok());
    assert!(protocol.outro[1].accepts(&Answer::Rating(6)).is_err());
    let QuestionKind::Slider(kinds::Slider {
        from, to, labels, ..
    }) = &protocol.outro[11].kind
    else {
        panic!()
    };
    assert_eq!((*from, *to), (0.0, 100.0));
    assert_eq!(
        (labels["0"].as_str(), labels["100"].as_str()),
        ("gering", "hoch")
    );
}

#[test]
fn wrong_questionnaires_are_refused() {
    let sus = "[[questionnaires]]\nid = \"sus\"\nkind = \"sus\"\n";
    let intake = "[[intake]]\nid = \"sus_3\"\nkind = \"text\"\nprompt = \"?\"\n";
    for (text, expected) in [
        (format!("{sus}{sus}"), "`sus` is there twice"),
        (
            format!("{sus}items = [\"a\", \"b\"]\n"),
            "`questionnaires[0].items` has 2 texts, not 10",
        ),
        (
            format!("{sus}labels = [\"a\", \"b\", \"c\"]\n"),
            "`questionnaires[0].labels` has 3 texts, not 2",
        ),
        (
            sus.replace("\"sus\"\nkind", "\"a b\"\nkind"),
            "is not a part id",
        ),
        (sus.replace("kind = \"sus\"", "kind = \"umux\""), "umux"),
        (
            sus.replace("kind = \"sus\"", "kind = \"nasa-tlx\"\nsystem = \"x\""),
            "system",
        ),
        (format!("{sus}{intake}"), "`sus_3` is there twice"),
    ] {
        let parsed = parse("p", &with(&text));
        assert!(parsed.protocol.is_none(), "{text}");
        let shown = parsed.findings.render(false);
        assert!(shown.contains(expected), "{text}\n{shown}");
    }
}

#[test]
fn a_questionnaire_in_another_language_than_the_study_is_a_warning() {
    let warned = |text: &str| -> Vec<String> {
        let parsed = parse("p", text);
        let protocol = parsed.protocol.unwrap();
        let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
        let messages = faults.into_iter().map(|f| f.message);
        messages.filter(|m| m.contains("questionnaire")).collect()
    };
    let german = with(BOTH).replace(
        "[[questionnaires]]\nid = \"sus\"",
        "[text]\nlang = \"de\"\n[[questionnaires]]\nid = \"sus\"",
    );
    let expected = ["sus", "load"]
        .map(|id| format!("the questionnaire `{id}` is in English, and the study in `de`"));
    assert_eq!(warned(&german), expected);
    assert!(warned(&german.replace("\"de\"", "\"en-GB\"")).is_empty());
    let items: Vec<String> = (1..=10).map(|i| format!("\"Satz {i}\"")).collect();
    let items = format!(
        "id = \"sus\"\nlabels = [\"a\", \"b\"]\nitems = [{}]",
        items.join(", ")
    );
    assert_eq!(
        warned(&german.replace("id = \"sus\"", &items)),
        expected[1..]
    );
}

/// The highest answer to the fourth item of the Task Load Index says failure, and the others say load.
#[test]
fn the_labels_of_a_task_load_index_can_differ_by_item() {
    let warned = |text: &str| -> bool {
        let parsed = parse("p", text);
        let shown = parsed.findings.render(false);
        let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
        let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
        let about = |f: &Fault| f.message.contains("`load_performance` has the labels");
        faults.iter().any(about)
    };
    for kind in ["nasa-tlx", "nasa-tlx-weighted"] {
        let same = with(BOTH).replace("\"nasa-tlx\"", &format!("\"{kind}\""));
        assert!(warned(&same), "{kind}");
        let each = r#"["l", "h", "l", "h", "l", "h", "perfekt", "misslungen", "l", "h", "l", "h"]"#;
        let each = same.replace("[\"gering\", \"hoch\"]", each);
        assert!(!warned(&each), "{kind}");
        let outro = parse("p", &each).protocol.unwrap().outro;
        let labels = outro[14].kind.scale().labels();
        assert_eq!(labels["100"], "misslungen", "{kind}");
        assert!(!warned(
            &same.replace("labels = [\"gering\", \"hoch\"]", "")
        ));
    }
    let three = with(BOTH).replace("\"hoch\"]", "\"hoch\", \"x\"]");
    let shown = parse("p", &three).findings.render(false);
    assert!(
        shown.contains("has 3 texts, not 2 or, two for each item, 12"),
        "{shown}"
    );
}

const AFTER_EACH: &str = r#"
[[questionnaires]]
id = "load"
kind = "nasa-tlx"
after = "condition"
"#;

fn newer(questionnaires: &str) -> String {
    with(questionnaires).replace("study-protocol/1", "study-protocol/3")
}

const ONE: &str = r#"models = [{ id = "a", file = "a.toml" }]"#;
const TWO: &str = r#"models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }]"#;
const BLOCKED: &str = r#"repetitions = 1, order = "blocked""#;

#[test]
fn what_is_asked_after_each_condition_is_not_in_the_outro_and_is_an_outcome() {
    let text = newer(AFTER_EACH)
        .replace(ONE, TWO)
        .replace("repetitions = 1", "repetitions = 3");
    let parsed = parse("p", &text);
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    assert_eq!(protocol.outro.len(), 1);
    let ids: Vec<&str> = protocol.between().map(|q| q.id.as_str()).collect();
    assert_eq!((ids.len(), ids[0]), (6, "load_mental"));
    let own = &protocol.questionnaires[0];
    assert_eq!(own.after, Occasion::Condition);
    // Each of two realizations, in each of three blocks.
    assert_eq!(own.times(&protocol), 6);
    let [outcome] = protocol.outcomes.as_slice() else {
        panic!("{:?}", protocol.outcomes)
    };
    assert_eq!(outcome.id.as_str(), "load");
    assert_eq!(outcome.better, Some(BetterEnd::Lower));
    let scored = Scored {
        id: own.id.clone(),
        kind: Inventory::NasaTlx,
        own: None,
    };
    assert_eq!(outcome.measure, Measure::Questionnaire(scored));
}

#[test]
fn what_is_asked_after_each_block_is_no_outcome() {
    let text = newer(AFTER_EACH)
        .replace("\"condition\"", "\"block\"")
        .replace("repetitions = 1", "repetitions = 3");
    let protocol = parse("p", &text).protocol.unwrap();
    assert!(protocol.outcomes.is_empty());
    assert_eq!(protocol.questionnaires[0].times(&protocol), 3);
}

#[test]
fn nothing_is_asked_after_what_has_no_end() {
    let after = |word: &str| AFTER_EACH.replace("condition", word);
    let shuffled = |questionnaires: &str| {
        newer(questionnaires)
            .replace(ONE, TWO)
            .replace(BLOCKED, r#"repetitions = 2, order = "shuffled""#)
    };
    for (text, expected) in [
        (
            with(AFTER_EACH),
            "`questionnaires[0].after` needs the format `study-protocol/3`",
        ),
        (
            shuffled(AFTER_EACH),
            "after = \"condition\" has no meaning: order = \"shuffled\" mixes the repetitions of the realizations",
        ),
        (
            shuffled(AFTER_EACH),
            "order = \"blocked\" (or williams, latin-square, fixed) asks it in each block",
        ),
        (
            shuffled(&after("block")),
            "after = \"block\" has no meaning: its order has no blocks",
        ),
        (
            newer(&after("part")),
            "after = \"part\" needs [[parts]], and the study has none",
        ),
        (newer(&after("conditions")), "did you mean"),
        (
            newer(&AFTER_EACH.replace("\"load\"", "\"realism\"")),
            "`realism` is a question and an outcome",
        ),
    ] {
        let parsed = parse("p", &text);
        assert!(parsed.protocol.is_none(), "{text}");
        let shown = parsed.findings.render(false);
        assert!(shown.contains(expected), "{text}\n{shown}");
    }
    // Each realization once: each is over after its only trial.
    let once = shuffled(AFTER_EACH).replace("repetitions = 2", "repetitions = 1");
    assert!(parse("p", &once).protocol.is_some());
}

#[test]
fn subscales_are_compared_by_their_titles() {
    let weighted = r#"
[[questionnaires]]
id = "load"
kind = "nasa-tlx-weighted"
compare = "Was mehr?"
titles = ["a", "b", "c", "d", "e", "f"]
"#;
    let parsed = parse("p", &with(weighted));
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    assert_eq!(protocol.outro.len(), 1 + 21);
    let second = &protocol.outro[8];
    assert_eq!(second.id.as_str(), "load_pair_tm");
    assert_eq!(second.prompt, "Was mehr?");
    let QuestionKind::Rating(kinds::Rating { from, to, labels }) = &second.kind else {
        panic!()
    };
    assert_eq!((*from, *to), (1, 2));
    assert_eq!((labels[&1].as_str(), labels[&2].as_str()), ("c", "a"));
    // Those of Hart & Staveland (1988), unless the study has its own.
    let english = weighted.replace("titles = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\"]\n", "");
    let protocol = parse("p", &with(&english)).protocol.unwrap();
    let labels = protocol.outro[8].kind.scale().labels();
    assert_eq!(
        (labels["1"].as_str(), labels["2"].as_str()),
        ("temporal demand", "mental demand")
    );
    let few = weighted.replace(", \"f\"", "");
    let shown = parse("p", &with(&few)).findings.render(false);
    assert!(
        shown.contains("`questionnaires[0].titles` has 5 texts, not 6"),
        "{shown}"
    );
}

const ALONE: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "manual" }
analysis = { primary = "sus" }
[[questionnaires]]
id = "sus"
kind = "sus"
"#;

#[test]
fn a_study_can_consist_of_questionnaires() {
    let parsed = parse("p", ALONE);
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    assert!(protocol.only_asks());
    assert_eq!(protocol.outro.len(), 10);
    let question = "[[questions]]\nid = \"q\"\nkind = \"text\"\nprompt = \"?\"\n";
    for (text, expected) in [
        (
            ALONE.replace("primary = \"sus\"", "primary = \"susi\""),
            "there is no questionnaire `susi`",
        ),
        (
            ALONE.replace("participants = 4", "participants = 4, repetitions = 3"),
            "`design.repetitions` has no effect in a study that presents nothing",
        ),
        (
            format!("{ALONE}after = \"condition\"\n"),
            "after = \"condition\" needs realizations, and nothing is presented",
        ),
        (
            format!("{ALONE}[[outcomes]]\nid = \"time\"\nfrom = \"clock\"\n"),
            "outcomes are measured in trials, and the study has none",
        ),
        (format!("{ALONE}{question}"), "nothing to present"),
    ] {
        let parsed = parse("p", &text);
        assert!(parsed.protocol.is_none(), "{text}");
        let shown = parsed.findings.render(false);
        assert!(shown.contains(expected), "{text}\n{shown}");
    }
}

const OWN: &str = r#"
[[questionnaires]]
id = "touch"
kind = "own"
items = ["One.", "Two.", "Three."]
from = 0
to = 6
"#;

#[test]
fn a_questionnaire_of_the_studys_own_has_its_scale_and_its_scoring() {
    let more = "labels = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\"]\nreverse = [2]\nscales = [{ id = \"x\", items = [1, 3] }]\n";
    let parsed = parse("p", &newer(&format!("{OWN}{more}after = \"condition\"\n")));
    let shown = parsed.findings.render(false);
    let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
    let own = &protocol.questionnaires[0];
    let scoring = own.own.as_ref().unwrap();
    assert_eq!(scoring.counted, [1, 2, 3]);
    assert_eq!((scoring.times, scoring.plus), (1.0, 0.0));
    let ids: Vec<&str> = own.questions.iter().map(|q| q.id.as_str()).collect();
    assert_eq!(ids, ["touch_1", "touch_2", "touch_3"]);
    let QuestionKind::Rating(kinds::Rating { from, to, labels }) = &own.questions[1].kind else {
        panic!()
    };
    assert_eq!((*from, *to), (0, 6));
    assert_eq!((labels[&0].as_str(), labels[&6].as_str()), ("c", "d"));
    // Turned round, the second answer is 6.
    let given = [Some(6.0), Some(0.0), Some(6.0)];
    assert_eq!(own.scored().score(&given), Some(6.0));
    assert_eq!(protocol.outcomes[0].better, None);
}

#[test]
fn a_faulty_scoring_is_refused() {
    let with_key = |more: &str| newer(&format!("{OWN}{more}\n"));
    for (text, expected) in [
        (
            with(OWN),
            "`questionnaires[0].from` needs the format `study-protocol/3`",
        ),
        (
            with_key("reverse = [4]"),
            "there is no item 4: the questionnaire has 3",
        ),
        (
            with_key("scales = [{ id = \"x\", items = [1, 9] }]"),
            "there is no item 9",
        ),
        (
            with_key("labels = [\"a\", \"b\", \"c\"]"),
            "has 3 texts, not 2 or, two for each item, 6",
        ),
        (
            with_key("").replace("to = 6", "to = 0"),
            "0 to 0 is no scale of at most 101 points",
        ),
        (
            with_key("").replace("items = [\"One.\", \"Two.\", \"Three.\"]\n", ""),
            "has no `items`",
        ),
    ] {
        let parsed = parse("p", &text);
        assert!(parsed.protocol.is_none(), "{text}");
        let shown = parsed.findings.render(false);
        assert!(shown.contains(expected), "{text}\n{shown}");
    }
}
