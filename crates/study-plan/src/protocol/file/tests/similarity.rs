//! Parts of similarity.

use crate::protocol::file::parse;
use crate::protocol::{Answer, Protocol, Scale, Seat, Similarity, Stimuli, Task};
use crate::schedule::{Trial, plan};
use std::collections::BTreeMap;
use study_base::text::ModelId;

const COMPARED: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 8 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "apart" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }, { id = "c", file = "c.toml" }, { id = "d", file = "d.toml" }]

[[parts]]
id = "apart"
kind = "similarity"
prompt = "How different?"
same = "alike"
different = "as different as can be"
exposure = { min_s = 1.5 }
repetitions = 2
identical = true
practice = 5
"#;

const FAMILY: &str = r#"
[[families]]
id = "detent"
from = "a.toml"
vary = "detent"
levels = [0.5, 1.0, 2.0]
"#;

fn read(text: &str) -> Protocol {
    let parsed = parse("p", text);
    let faults = parsed.findings.render(false);
    assert!(parsed.findings.faults.is_empty(), "{faults}");
    parsed.protocol.unwrap()
}

fn compared(protocol: &Protocol) -> &Similarity {
    match &protocol.parts[0].task {
        Task::Similarity(own) => own,
        other => panic!("{other:?}"),
    }
}

fn trials(protocol: &Protocol, row: u32) -> Vec<Trial> {
    plan(protocol, None, Seat::Row(row)).unwrap()
}

fn pair(trial: &Trial) -> [&str; 2] {
    match &trial.stimuli {
        Stimuli::Pair { pair } => [pair[0].as_str(), pair[1].as_str()],
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_pair_is_rated_on_a_scale_with_words_at_its_ends() {
    let protocol = read(COMPARED);
    let asked = &protocol.questions[0];
    let Scale::Interval { from, to, labels } = asked.kind.scale() else {
        panic!()
    };
    assert_eq!((from, to, labels["0"].as_str()), (0.0, 100.0, "alike"));
    assert_eq!(labels["100"], "as different as can be");
    assert!(asked.accepts(&Answer::Number(37.0)).is_ok());
    assert!(asked.accepts(&Answer::Number(101.0)).is_err());
    let own = compared(&protocol);
    assert_eq!((own.different.len(), own.pairs().pairs.len()), (6, 10));
    assert_eq!(protocol.parts[0].gap_s, 1.0);
    // A planned trial is the same after it was written to a journal.
    let all = trials(&protocol, 1);
    let text = serde_json::to_string(&all).unwrap();
    let again: Vec<Trial> = serde_json::from_str(&text).unwrap();
    assert_eq!(again, all);
    let without = COMPARED.replace("identical = true\npractice = 5\n", "");
    let own = read(&without);
    assert_eq!(trials(&own, 1).len(), 2 * 6);
}

/// With two repetitions everybody has both orders of each pair, with one two rows have; each realization meets itself as often.
#[test]
fn both_orders_of_each_pair_come_equally_often() {
    let count = |text: &str, rows: u32| {
        let protocol = read(text);
        let mut counts: BTreeMap<[String; 2], u32> = BTreeMap::new();
        for trial in (1..=rows).flat_map(|row| trials(&protocol, row)) {
            if !trial.practice {
                *counts.entry(pair(&trial).map(str::to_owned)).or_default() += 1;
            }
        }
        counts
    };
    let once = count(COMPARED, 1);
    assert_eq!(once.len(), 4 * 4);
    let expected = |[a, b]: &[String; 2]| if a == b { 2 } else { 1 };
    assert!(
        once.iter().all(|(pair, n)| *n == expected(pair)),
        "{once:?}"
    );
    let single = COMPARED.replace("repetitions = 2", "repetitions = 1");
    assert_eq!(count(&single, 2), once);
    // Which one comes first differs between the pairs, and between the rows.
    let firsts = |row: u32| -> Vec<bool> {
        let protocol = read(COMPARED);
        let own = trials(&protocol, row);
        let own = own.iter().filter(|t| !t.practice && t.repetition == 1);
        let mut pairs: Vec<[&str; 2]> = own.map(pair).filter(|[a, b]| a != b).collect();
        pairs.sort_by_key(|[a, b]| [*a.min(b), *a.max(b)]);
        pairs.iter().map(|[a, b]| a < b).collect()
    };
    let all: Vec<Vec<bool>> = (1..=16).map(firsts).collect();
    let share = all.iter().flatten().filter(|f| **f).count() as f64 / (16.0 * 6.0);
    assert!((0.3..0.7).contains(&share), "{share}");
    assert!(all.iter().any(|row| *row != all[0]));
    // Two rows have opposite orders.
    assert!(all[0].iter().zip(&all[1]).all(|(a, b)| a != b));
}

#[test]
fn practice_has_different_pairs_that_are_drawn_for_each_row() {
    let protocol = read(COMPARED);
    let practiced = |row: u32| -> Vec<[String; 2]> {
        let all = trials(&protocol, row);
        assert!(all[..5].iter().all(|t| t.practice && t.block == 0));
        assert!(all[5..].iter().all(|t| !t.practice));
        all[..5]
            .iter()
            .map(|t| pair(t).map(str::to_owned))
            .collect()
    };
    let first = practiced(1);
    let sorted = |[a, b]: &[String; 2]| [a.min(b).clone(), a.max(b).clone()];
    let mut seen: Vec<_> = first.iter().map(sorted).collect();
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), 5);
    assert!(seen.iter().all(|[a, b]| a != b));
    assert_ne!(practiced(2), first);
    assert_eq!(practiced(1), first);
    // More than there are pairs: each comes once before one comes again.
    let many = read(&COMPARED.replace("practice = 5", "practice = 8"));
    let all = trials(&many, 3);
    assert_eq!(all.iter().filter(|t| t.practice).count(), 8);
}

#[test]
fn levels_of_a_family_are_compared() {
    let text = COMPARED.replace("prompt =", "family = \"detent\"\nprompt =");
    let text = format!("{text}{FAMILY}");
    let parsed = parse("p", &text);
    let protocol = parsed.protocol.unwrap();
    let models: Vec<&str> = compared(&protocol)
        .models
        .iter()
        .map(ModelId::as_str)
        .collect();
    assert_eq!(models, ["detent.1", "detent.2", "detent.3"]);
    let some = text.replace(
        "family = \"detent\"",
        "family = \"detent\"\nlevels = [2.0, 0.5]",
    );
    let protocol = parse("p", &some).protocol.unwrap();
    let models: Vec<&str> = compared(&protocol)
        .models
        .iter()
        .map(ModelId::as_str)
        .collect();
    assert_eq!(models, ["detent.3", "detent.1"]);
}

#[test]
fn what_is_wrong_with_a_part_is_said() {
    for (from, to, says) in [
        (
            "different = \"as different as can be\"\n",
            "",
            "[parts[0]] has no `different`",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\nmodels = [\"a\"]",
            "a pair needs two realizations",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\nmodels = [\"a\", \"e\"]",
            "there is no model `e`",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\nmodels = [\"a\", \"b\", \"a\"]",
            "`a` is there twice",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\nlevels = [1.0]",
            "`parts[0]` has `levels` without a family",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\npairs = [[\"a\", \"b\"], [\"c\", \"d\"]]",
            "no pairs connect `a` and `c`: they have no place in one map",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\npairs = \"adjacent\"",
            "`parts[0].pairs` has too few pairs for a map",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\npairs = [[\"a\", \"b\"], [\"b\", \"a\"]]",
            "the pair of `b` and `a` is there twice",
        ),
        (
            "repetitions = 2",
            "repetitions = 2\nmax_run = 1",
            "unknown key `max_run` in [parts[0]]",
        ),
        (
            "study-protocol/3",
            "study-protocol/2",
            "`parts[0].different` needs the format `study-protocol/3`",
        ),
    ] {
        let text = COMPARED.replace(from, to);
        assert_ne!(text, COMPARED, "{from}");
        let faults = parse("p", &text).findings.faults;
        let found: Vec<String> = faults.into_iter().map(|f| f.message).collect();
        assert_eq!(found[0], says, "{found:?}");
        assert_eq!(found.len(), 1, "{found:?}");
    }
}

#[test]
fn a_group_compares_its_own_realizations() {
    let groups = r#"
[groups]
[[groups.list]]
id = "all"
[[groups.list]]
id = "few"
models = ["a", "c", "d"]
"#;
    let protocol = read(&format!("{COMPARED}{groups}"));
    let few = protocol.assignments().remove(1);
    let own = protocol.of(&few);
    assert_eq!(compared(&own).different.len(), 3);
    let one = groups.replace("[\"a\", \"c\", \"d\"]", "[\"a\"]");
    let faults = parse("p", &format!("{COMPARED}{one}")).findings.faults;
    let nothing = "group `few` has nothing to do in part `apart`";
    assert!(faults.iter().any(|f| f.message == nothing), "{faults:?}");
}

fn warned(text: &str) -> Vec<String> {
    let parsed = parse("p", text);
    let protocol = parsed.protocol.unwrap();
    let faults = crate::protocol::check::warnings(&protocol, &parsed.spans, &[]);
    let own = faults.into_iter().map(|f| f.message);
    own.filter(|m| m.contains("`apart`")).collect()
}

#[test]
fn too_few_realizations_and_odd_repetitions_are_warnings() {
    assert_eq!(
        warned(COMPARED),
        ["the part `apart` has 4 realizations: a map of fewer than 6 has one dimension"]
    );
    let three = COMPARED.replace(
        "repetitions = 2",
        "repetitions = 2\nmodels = [\"a\", \"b\", \"c\"]",
    );
    assert_eq!(
        warned(&three),
        ["the part `apart` has 3 realizations: there is no map of fewer than 4"]
    );
    let odd = COMPARED.replace("repetitions = 2", "repetitions = 3");
    assert!(warned(&odd)[1].starts_with("`repetitions = 3`: nobody has both orders"));
    let levels: Vec<String> = (1..=31).map(|level| format!("{level}.0")).collect();
    let family = FAMILY.replace("0.5, 1.0, 2.0", &levels.join(", "));
    let many = COMPARED.replace("prompt =", "family = \"detent\"\nprompt =") + &family;
    assert_eq!(
        warned(&many),
        ["the part `apart` has 31 realizations: there is no map of more than 30"]
    );
}

/// Some pairs, which connect all realizations, are enough for a map.
#[test]
fn some_pairs_are_compared() {
    let list = "pairs = [[\"a\", \"b\"], [\"c\", \"b\"], [\"c\", \"d\"], [\"d\", \"a\"]]";
    let some = COMPARED.replace("repetitions = 2", &format!("repetitions = 2\n{list}"));
    let protocol = read(&some);
    let own = compared(&protocol);
    let models: Vec<&str> = own.models.iter().map(ModelId::as_str).collect();
    assert_eq!(models, ["a", "b", "c", "d"]);
    assert_eq!((own.different.len(), own.possible()), (4, 6));
    let all = trials(&protocol, 1);
    let felt = |practice: bool| {
        let own = all.iter().filter(|t| t.practice == practice).map(pair);
        let mut own: Vec<[&str; 2]> = own.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        own.sort_unstable();
        own
    };
    let (counted, different) = (
        felt(false),
        [["a", "b"], ["a", "d"], ["b", "c"], ["c", "d"]],
    );
    assert_eq!(counted.len(), 2 * (4 + 4));
    let unlike = counted.iter().filter(|[a, b]| a != b);
    let expected: Vec<_> = different.iter().flat_map(|pair| [pair, pair]).collect();
    assert_eq!(unlike.collect::<Vec<_>>(), expected);
    assert!(felt(true).iter().all(|pair| different.contains(pair)));
    assert_eq!(
        warned(&some)[1],
        "4 pairs of `apart` for 4 realizations: nearly any ratings of so few fit a plane"
    );
    let family = some.replace("prompt =", "family = \"detent\"\nprompt =") + FAMILY;
    let faults = parse("p", &family).findings.faults;
    assert_eq!(
        faults[0].message,
        "`parts[0]` has a family and a list of pairs"
    );
}

#[test]
fn groups_that_have_no_map_in_common_are_warned_of() {
    let groups = |one: &str, other: &str| {
        format!(
            "{COMPARED}[groups]\n[[groups.list]]\nid = \"one\"\nmodels = [{one}]\n[[groups.list]]\nid = \"other\"\nmodels = [{other}]\n"
        )
    };
    let apart = warned(&groups("\"a\", \"b\"", "\"c\", \"d\""));
    assert_eq!(
        apart[1],
        "no group connects `a` and `c` by pairs of `apart`: they have no place in one map"
    );
    let few = warned(&groups("\"a\", \"b\", \"c\"", "\"c\", \"d\""));
    assert!(
        few[1].starts_with("4 pairs of `apart` for 4 realizations"),
        "{few:?}"
    );
}
