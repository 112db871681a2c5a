//! Parts of ranking.

use crate::protocol::file::parse;
use crate::protocol::{Answer, Protocol, Scale, Seat, Stimuli, Task};
use crate::schedule::{Trial, plan};
use std::collections::{BTreeMap, BTreeSet};

const RANKED: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 8 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "order" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }, { id = "c", file = "c.toml" }, { id = "d", file = "d.toml" }]

[[parts]]
id = "order"
kind = "ranking"
prompt = "Which rank has number {n}?"
first = "best"
last = "worst"
models = ["a", "b", "c", "d"]
exposure = { min_s = 1.5 }
repetitions = 3
practice = 2
"#;

fn read(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let faults = parsed.findings.render(false);
    assert!(parsed.findings.faults.is_empty(), "{faults}");
    parsed.protocol.unwrap()
}

fn faults(text: &str) -> String {
    let parsed = parse("p", text);
    assert!(parsed.protocol.is_none());
    parsed.findings.render(false)
}

fn trials(protocol: &Protocol, row: u32) -> Vec<Trial> {
    plan(protocol, None, Seat::Row(row)).unwrap()
}

fn set(trial: &Trial) -> String {
    match &trial.stimuli {
        Stimuli::Set { set } => set.iter().map(|m| m.as_str()).collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_realization_is_asked_its_rank() {
    let protocol = read(RANKED);
    let asked: Vec<(&str, &str)> = (protocol.questions.iter())
        .map(|q| (q.id.as_str(), q.prompt.as_str()))
        .collect();
    let expected = [
        ("order", "Which rank has number 1?"),
        ("order-2", "Which rank has number 2?"),
        ("order-3", "Which rank has number 3?"),
        ("order-4", "Which rank has number 4?"),
    ];
    assert_eq!(asked, expected);
    let part = &protocol.parts[0];
    let ids: Vec<&str> = part.asks.iter().map(|id| id.as_str()).collect();
    assert_eq!(ids, expected.map(|(id, _)| id));
    let last = &protocol.questions[3];
    let Scale::Levels { from, to, labels } = last.kind.scale() else {
        panic!()
    };
    assert_eq!(
        (from, to, labels[&1].as_str(), labels[&4].as_str()),
        (1, 4, "best", "worst")
    );
    assert!(last.accepts(&Answer::Rating(4)).is_ok());
    assert!(last.accepts(&Answer::Rating(5)).is_err());
    let Task::Ranking(own) = &part.task else {
        panic!()
    };
    assert!(!own.ties && own.asked(&part.asks).len() == 4);
    // A planned trial is the same after it was written to a journal.
    let all = trials(&protocol, 1);
    let text = serde_json::to_string(&all).unwrap();
    let again: Vec<Trial> = serde_json::from_str(&text).unwrap();
    assert_eq!(again, all);
}

/// What else a trial asks comes after the ranks; a rating part beside it asks none of them.
#[test]
fn other_questions_come_after_the_ranks() {
    let text = RANKED.replace("practice = 2", "practice = 2\nquestions = [\"why\"]")
        + r#"
[[parts]]
id = "rated"
kind = "rating"
repetitions = 1

[[questions]]
id = "realism"
prompt = "How realistic?"
kind = "rating"
from = 1
to = 7

[[questions]]
id = "why"
prompt = "Why?"
kind = "text"
"#;
    let protocol = read(&text);
    let asks = |part: usize| -> Vec<&str> {
        let ids = protocol.parts[part].asks.iter();
        ids.map(|id| id.as_str()).collect()
    };
    assert_eq!(asks(0), ["order", "order-2", "order-3", "order-4", "why"]);
    assert_eq!(asks(1), ["realism"]);
}

#[test]
fn every_trial_presents_all_realizations() {
    let protocol = read(RANKED);
    let mut orders = BTreeSet::new();
    for row in 1..=20 {
        let all = trials(&protocol, row);
        assert_eq!(all.len(), 2 + 3);
        for (n, trial) in all.iter().enumerate() {
            assert_eq!((trial.practice, trial.trial as usize), (n < 2, n + 1));
            let mut models: Vec<char> = set(trial).chars().collect();
            orders.insert(models.clone());
            models.sort_unstable();
            assert_eq!(models, ['a', 'b', 'c', 'd']);
        }
        let repetitions: Vec<u32> = all[2..].iter().map(|t| t.repetition).collect();
        assert_eq!(repetitions, [1, 2, 3]);
    }
    assert!(orders.len() > 15, "{}", orders.len());
    assert_eq!(trials(&protocol, 3), trials(&protocol, 3));
}

/// Over four rows of a Williams design each realization is at each place and after each other one equally often.
#[test]
fn a_williams_design_balances_the_places_in_a_trial() {
    let text = RANKED.replace("repetitions = 3", "repetitions = 1\norder = \"williams\"");
    let protocol = read(&text);
    let mut places: BTreeMap<(char, usize), u32> = BTreeMap::new();
    let mut after: BTreeMap<(char, char), u32> = BTreeMap::new();
    for row in 1..=4 {
        let all = trials(&protocol, row);
        let counted: Vec<char> = set(all.last().unwrap()).chars().collect();
        for (place, model) in counted.iter().enumerate() {
            *places.entry((*model, place)).or_default() += 1;
        }
        for two in counted.windows(2) {
            *after.entry((two[0], two[1])).or_default() += 1;
        }
    }
    assert_eq!((places.len(), after.len()), (16, 12));
    assert!(places.values().chain(after.values()).all(|n| *n == 1));
}

#[test]
fn a_wrong_ranking_says_what_is_wrong() {
    for (from, to, said) in [
        (
            "number {n}?",
            "it?",
            "does not say which realization it asks about",
        ),
        (
            "[\"a\", \"b\", \"c\", \"d\"]",
            "[\"a\"]",
            "2 to 9 realizations, not 1",
        ),
        ("\"c\", \"d\"]\nexp", "\"c\", \"x\"]\nexp", "`x`"),
        (
            "\"c\", \"d\"]\nexp",
            "\"c\", \"a\"]\nexp",
            "`a` is there twice",
        ),
        (
            "practice = 2",
            "order = \"shuffled\"",
            "each realization once",
        ),
        (
            "models = [\"a\", \"b\", \"c\", \"d\"]\nexp",
            "exp",
            "`models`",
        ),
        (
            "study-protocol/3",
            "study-protocol/2",
            "needs the format `study-protocol/3`",
        ),
    ] {
        assert_eq!(RANKED.matches(from).count(), 1, "{from}");
        let found = faults(&RANKED.replace(from, to));
        assert!(found.contains(said), "{said}:\n{found}");
    }
    let taken =
        format!("{RANKED}\n[[questions]]\nid = \"order-3\"\nprompt = \"?\"\nkind = \"text\"\n");
    assert!(faults(&taken).contains("order-3"));
}

/// Levels of a family are ranked as realizations are; a group has them all.
#[test]
fn levels_are_ranked() {
    let levels = RANKED.replace(
        "models = [\"a\", \"b\", \"c\", \"d\"]\nexp",
        "family = \"detent\"\nlevels = [2.0, 0.5]\nexp",
    ) + "\n[[families]]\nid = \"detent\"\nfrom = \"a.toml\"\nvary = \"detent\"\nlevels = [0.5, 1.0, 2.0]\n";
    let protocol = read(&levels);
    let Task::Ranking(own) = &protocol.parts[0].task else {
        panic!()
    };
    let ids: Vec<&str> = own.models.iter().map(|m| m.as_str()).collect();
    assert_eq!(ids, ["detent.3", "detent.1"]);
    assert_eq!(protocol.questions.len(), 2);
    for (from, to, said) in [
        ("[2.0, 0.5]", "[2.0]", "2 to 9 realizations, not 1"),
        ("[2.0, 0.5]", "[2.0, 0.6]", "0.6"),
        ("\nlevels = [2.0, 0.5]", "", "has a family without `levels`"),
        ("family = \"detent\"\n", "", "has `levels` without a family"),
        (
            "levels = [2.0, 0.5]",
            "models = [\"a\", \"b\"]",
            "has `models` and a family",
        ),
    ] {
        assert_eq!(levels.matches(from).count(), 1, "{from}");
        let found = faults(&levels.replace(from, to));
        assert!(found.contains(said), "{said}:\n{found}");
    }
    let groups =
        "\n[groups]\n[[groups.list]]\nid = \"x\"\nmodels = [\"a\"]\n[[groups.list]]\nid = \"y\"\n";
    let protocol = read(&format!("{levels}{groups}"));
    let of_x = protocol.of(&protocol.assignments()[0]);
    assert_eq!(of_x.parts, protocol.parts);
}

/// A group has all realizations of a ranking, or another part.
#[test]
fn a_group_ranks_all_realizations() {
    let groups = |models: &str| {
        format!(
            "{RANKED}\n[groups]\nassign = \"row\"\n[[groups.list]]\nid = \"x\"\nmodels = {models}\n[[groups.list]]\nid = \"y\"\n"
        )
    };
    let found = faults(&groups("[\"a\", \"b\"]"));
    assert!(
        found.contains("group `x` has 2 of the 4 realizations"),
        "{found}"
    );
    read(&groups("[\"a\", \"b\", \"c\", \"d\"]"));
}

/// Two participants with three realizations have one of six orders in common by chance.
#[test]
fn so_few_that_no_agreement_shows_are_warned_of() {
    let warned = |participants: &str, models: &str| -> Vec<String> {
        let text = RANKED
            .replace("participants = 8", participants)
            .replace("[\"a\", \"b\", \"c\", \"d\"]", models);
        let parsed = parse("p", &text);
        let protocol = parsed.protocol.unwrap();
        let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
        let own = faults.into_iter().map(|f| f.message);
        own.filter(|m| m.contains("`order`")).collect()
    };
    let three = "[\"a\", \"b\", \"c\"]";
    assert_eq!(
        warned("participants = 2", three),
        [
            "the part `order` has 2 participants who rank 3 realizations: even if all rank alike, p = .167"
        ]
    );
    let none: [&str; 0] = [];
    assert_eq!(warned("participants = 3", three), none);
    // One in 24.
    assert_eq!(
        warned("participants = 2", "[\"a\", \"b\", \"c\", \"d\"]"),
        none
    );
}

#[test]
fn one_order_for_everybody_is_warned_of() {
    let text = RANKED.replace("repetitions = 3", "repetitions = 3\norder = \"fixed\"");
    let parsed = parse("p", &text);
    let protocol = parsed.protocol.unwrap();
    let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
    let own = faults.iter().filter(|f| f.message.contains("same order"));
    assert_eq!(own.count(), 1);
}
