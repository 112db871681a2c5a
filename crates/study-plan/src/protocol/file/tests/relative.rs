//! Tracks that count their levels from the standard, and tracks of one condition.

use super::parts::{PARTS, good};
use crate::procedure::{Answer, Rule};
use crate::protocol::file::parse;
use crate::protocol::{Protocol, Relative, Seat};
use study_stats::psychometric::{Core, Spacing};

/// A family from 0.1 to 0.5 with two tracks on the standards 0.2 and 0.3.
fn text(of_first: &str, of_second: &str) -> String {
    // A level of the ladder, as it is counted.
    let start = match of_first {
        "" => 0.35,
        first if first.contains("fraction") => 0.5,
        _ => 0.15,
    };
    let staircase = format!(
        "{{ rule = \"staircase\", up = 1, down = 3, start = {start}, steps = [0.1], stop = {{ reversals = 8, max_trials = 80 }} }}"
    );
    let quest = "{ rule = \"quest+\", trials = 40 }";
    (PARTS.replace("study-protocol/2", "study-protocol/3"))
        .replace(
            "range = [1.0, 3.0]\nsteps = 41",
            "levels = [0.1, 0.2, 0.25, 0.3, 0.35, 0.5]",
        )
        .replace(
            "standard = 1.0\nprocedure = { rule = \"staircase\", up = 1, down = 3, start = 2.0, steps = [0.2], stop = { reversals = 8, max_trials = 80 } }",
            &format!("standard = 0.2\nprocedure = {staircase}\n{of_first}"),
        )
        .replace(
            &format!("standard = 1.0\nprocedure = {quest}"),
            &format!("standard = 0.3\nprocedure = {quest}\n{of_second}"),
        )
}

fn both(of_each: &str) -> Protocol {
    good(&text(of_each, of_each))
}

#[test]
fn only_levels_above_the_standard_are_presented() {
    let p = both("relative = \"increment\"");
    assert_eq!(p.ladder(&p.tracks[0]).levels(), [0.05, 0.1, 0.15, 0.3]);
    assert_eq!(p.ladder(&p.tracks[1]).levels(), [0.05, 0.2]);
    let model = |track: usize, step| p.comparison(&p.tracks[track], step).unwrap();
    // The realizations of the family are those of its whole ladder.
    assert_eq!(model(0, 0).as_str(), "damping.3");
    assert_eq!(model(1, 1).as_str(), "damping.6");
    assert_eq!(p.level_of(&model(1, 1)), Some(0.5));
    let p = both("relative = \"fraction\"");
    assert_eq!(p.ladder(&p.tracks[0]).levels(), [0.25, 0.5, 0.75, 1.5]);
    assert_eq!(p.tracks[0].counted_standard(), Some(0.0));
    assert_eq!(p.tracks[0].relative, Some(Relative::Fraction));
    // At no distance from the standard there is nothing to feel.
    assert_eq!(p.families[0].spacing, Spacing::Lin);
    assert_eq!(p.fit(&p.tracks[0]), (Spacing::Log, Core::Gumbel));
    let lin = "relative = \"increment\"\nfit = { scale = \"lin\" }";
    let p = both(lin);
    assert_eq!(p.fit(&p.tracks[0]), (Spacing::Lin, Core::Norm));
}

/// However often the answer is right, the level stays above the standard.
#[test]
fn a_staircase_ends_above_its_standard() {
    let p = both("relative = \"increment\"");
    let track = &p.tracks[0];
    assert!(matches!(&track.rule, Rule::Staircase(rule) if rule.min_level.is_none()));
    let mut running = p.start(track, Seat::Row(1)).unwrap();
    let ladder = p.ladder(track);
    let mut lowest = f64::INFINITY;
    for _ in 0..40 {
        let Some(next) = running.next() else { break };
        let presented = ladder.level(next.step);
        lowest = lowest.min(
            p.level_of(&p.comparison(track, next.step).unwrap())
                .unwrap(),
        );
        running.answer(&Answer {
            presented,
            positive: true,
            easy: false,
        });
    }
    assert_eq!(lowest, 0.25);
}

#[test]
fn without_the_key_levels_are_those_of_the_family() {
    let p = both("");
    assert_eq!(p.tracks[0].relative, None);
    assert_eq!(p.ladder(&p.tracks[0]).levels().len(), 6);
    assert_eq!(p.comparison(&p.tracks[0], 0).unwrap().as_str(), "damping.1");
    let json = serde_json::to_value(&p.tracks[0]).unwrap();
    assert!(json.get("relative").is_none(), "{json}");
}

#[test]
fn what_cannot_be_counted_is_a_fault() {
    let messages = |text: &str| -> Vec<String> {
        let faults = parse("protocol.toml", text).findings.faults;
        faults.into_iter().map(|f| f.message).collect()
    };
    let relative = "relative = \"increment\"";
    assert_eq!(
        messages(&text(relative, relative).replace("standard = 0.3", "standard = 0.5")),
        ["no level of `damping` is above the standard 0.5"]
    );
    assert_eq!(
        messages(&text(relative, "")),
        ["the tracks of a part count levels alike, all of them with the same `relative` or none"]
    );
    let fraction = "relative = \"fraction\"";
    let at_0 = text(fraction, fraction).replace("standard = 0.2", "standard = 0.0");
    let at_0 = messages(&at_0);
    assert!(
        at_0.contains(&"there are no fractions of the standard 0".to_owned()),
        "{at_0:?}"
    );
    let older = text(relative, relative).replace("study-protocol/3", "study-protocol/2");
    assert_eq!(
        messages(&older),
        [
            "`tracks[0].relative` needs the format `study-protocol/3`",
            "`tracks[1].relative` needs the format `study-protocol/3`"
        ]
    );
    // A start that is a level of the family, but no increment.
    let start = text(relative, relative).replace("start = 0.15", "start = 0.45");
    assert_eq!(messages(&start).len(), 1);
}

/// Two tracks with these keys on the same standard.
fn of_one_standard(of_first: &str, of_second: &str) -> String {
    (PARTS.replace("study-protocol/2", "study-protocol/3"))
        .replace(
            "max_trials = 80 } }",
            &format!("max_trials = 80 }} }}\n{of_first}"),
        )
        .replace("trials = 40 }", &format!("trials = 40 }}\n{of_second}"))
}

#[test]
fn tracks_measure_one_condition_if_they_are_alike() {
    let condition = "condition = \"damping\"";
    let p = good(&of_one_standard(condition, condition));
    let names = |p: &Protocol| -> Vec<String> {
        let all = p.conditions(&p.parts[2]);
        all.iter()
            .map(|own| format!("{} {}", own[0].condition(), own.len()))
            .collect()
    };
    assert_eq!(names(&p), ["damping 2"]);
    assert_eq!(names(&good(&of_one_standard("", ""))), ["up 1", "quest 1"]);
    // It can be changed while a study runs.
    let print = |p: &Protocol| {
        crate::protocol::fingerprint::parts(p, &Default::default(), None).fingerprints()
    };
    let (one, two) = (print(&p), print(&good(&of_one_standard("", ""))));
    assert_eq!(one.stimulus, two.stimulus);
    assert_ne!(one.analysis, two.analysis);
    let messages = |text: &str| -> Vec<String> {
        let faults = parse("protocol.toml", text).findings.faults;
        faults.into_iter().map(|f| f.message).collect()
    };
    for (first, second, says) in [
        (
            condition.to_owned(),
            format!("{condition}\nfit = {{ lapse = 0.05 }}"),
            "the tracks `up` and `quest` measure the condition `damping`, and differ in fit",
        ),
        (String::new(), "condition = \"up\"".to_owned(), ""),
        (
            condition.to_owned(),
            "condition = \"up\"".to_owned(),
            "`up` is a track of another condition",
        ),
    ] {
        let found = messages(&of_one_standard(&first, &second));
        let expected: Vec<&str> = if says.is_empty() { vec![] } else { vec![says] };
        assert_eq!(found, expected);
    }
    let other =
        of_one_standard(condition, condition).replacen("standard = 1.0", "standard = 1.1", 1);
    assert_eq!(
        messages(&other),
        [
            "the tracks `up` and `quest` measure the condition `damping`, and differ in family or standard"
        ]
    );
}
