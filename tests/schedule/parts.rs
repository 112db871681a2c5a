//! Orders of parts: a script written from `docs/schedule.md` makes the same ones, and they
//! never change.

use std::process::Command;
use study_plan::procedure::Rule;
use study_plan::protocol::file::parse;
use study_plan::protocol::{Interval, Protocol, Seat, Stimuli, Trial};
use study_plan::schedule::Planner;

/// A protocol with a part of tracks, `ID:METHOD:RULE:CATCH:EASY`, and one of pairs.
pub(crate) fn protocol(version: u32, tracks: &[&str], pairs: &str) -> Protocol {
    let mut text = format!(
        "format = \"study-protocol/3\"\n\
         [study]\nid = \"s\"\ntitle = \"s\"\nseed = 2007\n\
         [design]\nparticipants = 10\norder_version = {version}\n\
         [device]\nkind = \"simulated\"\nlimits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }}\n\
         [analysis]\nprimary = \"better\"\n\
         [[families]]\nid = \"friction\"\nfrom = \"a.toml\"\nvary = \"friction\"\nlevels = [0.1, 0.2, 0.4]\n"
    );
    for model in ["a", "b", "c", "d", "e"] {
        text += &format!("[[models]]\nid = \"{model}\"\nfile = \"{model}.toml\"\n");
    }
    text += &format!(
        "[[parts]]\nid = \"better\"\nkind = \"pairs\"\ntext = \"t\"\nprompt = \"?\"\n{pairs}\n"
    );
    if !tracks.is_empty() {
        let ids: Vec<String> = (tracks.iter())
            .map(|t| format!("\"{}\"", t.split(':').next().expect("an id")))
            .collect();
        text += &format!(
            "[[parts]]\nid = \"felt\"\nkind = \"discrimination\"\ntext = \"t\"\nprompt = \"?\"\ntracks = [{}]\n",
            ids.join(", ")
        );
    }
    for track in tracks {
        let fields: Vec<&str> = track.split(':').collect();
        let [id, method, rule, catch, easy] = fields[..] else {
            panic!("{track}");
        };
        let rule = match rule.strip_prefix('c') {
            Some(repetitions) => format!("\"constant\", repetitions = {repetitions}"),
            None => format!("\"quest+\", trials = {rule}"),
        };
        text += &format!(
            "[[tracks]]\nid = \"{id}\"\nmethod = \"{method}\"\nfamily = \"friction\"\nstandard = 0.0\n\
             procedure = {{ rule = {rule} }}\ncatch = {catch}\neasy = {easy}\n"
        );
    }
    let parsed = parse("protocol.toml", &text);
    let found = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{found}"))
}

pub(crate) const PAIRS: &str =
    "pairs = \"all\"\nrepetitions = 3\norder = \"blocked\"\ninterval_order = \"balanced\"";

const TRACKS: [&[&str]; 7] = [
    &["const:2ifc:c13:0:0.05"],
    &["up:2ifc:40:0:0.1", "down:2ifc:25:0:0"],
    &[
        "same:same-different:40:0.5:0",
        "too:same-different:20:0.3:0.1",
    ],
    &["x:abx:30:0:0"],
    &["odd:odd-one-out:50:0:0.2"],
    &["three:3ifc:25:0:0", "more:3ifc:40:0:0.3"],
    &["yes:yes-no:40:0.2:0.1"],
];

fn letters(intervals: &[Interval]) -> String {
    let letter = |interval: &Interval| match interval {
        Interval::Standard => 'S',
        Interval::Comparison => 'C',
    };
    intervals.iter().map(letter).collect()
}

/// What the script prints of a trial.
fn line(trial: &Trial) -> Option<String> {
    match &trial.stimuli {
        Stimuli::Track {
            track,
            intervals,
            easy,
        } => Some(format!("{track},{},{easy}", letters(intervals))),
        Stimuli::Pair { pair: [a, b] } => Some(format!("{a},{b}")),
        Stimuli::Set { set } => {
            let ids: Vec<&str> = set.iter().map(|id| id.as_str()).collect();
            Some(ids.join(" "))
        }
        _ => None,
    }
}

fn ours(protocol: &Protocol, part: &str, head: &str, kind: fn(u32) -> Seat) -> String {
    let planner = Planner::new(protocol, None).expect("a feasible design");
    let mut text = format!("kind,number,position,{head}\n");
    for number in 1..=4 {
        let seat = kind(number);
        let all = planner.plan(seat).expect("an order");
        let own = all
            .iter()
            .filter(|t| t.part.as_ref().is_some_and(|p| p.as_str() == part));
        for (position, trial) in (1..).zip(own) {
            let line = line(trial).expect("a trial of the part");
            text += &format!("{},{number},{position},{line}\n", seat.stream());
        }
    }
    text
}

/// `None` without Python.
pub(crate) fn theirs(arguments: &[String]) -> Option<String> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/schedule.py");
    if Command::new("python3").arg("--version").output().is_err() {
        return None;
    }
    let said = Command::new("python3")
        .args([script, "--seed", "2007", "--numbers", "1-4"])
        .args(arguments)
        .output()
        .expect("python3 runs");
    let errors = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(said.status.success(), "{errors}");
    Some(
        String::from_utf8(said.stdout)
            .expect("UTF-8")
            .replace("\r\n", "\n"),
    )
}

pub(crate) const KINDS: [fn(u32) -> Seat; 3] = [Seat::Row, Seat::Pilot, Seat::Simulated];

pub(crate) fn words(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|text| (*text).to_owned()).collect()
}

/// The practice of an identification that has a criterion, in rounds and independently.
#[test]
fn a_script_makes_the_same_practice() {
    for draw in ["rounds", "independent"] {
        let text = format!(
            "format = \"study-protocol/3\"\n[study]\nid = \"s\"\ntitle = \"s\"\nseed = 2007\n\
             [design]\nparticipants = 10\n[analysis]\nprimary = \"which\"\n\
             [device]\nkind = \"simulated\"\nlimits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }}\n\
             [[models]]\nid = \"a\"\nfile = \"a.toml\"\n[[models]]\nid = \"b\"\nfile = \"b.toml\"\n\
             [[models]]\nid = \"c\"\nfile = \"c.toml\"\n\
             [[parts]]\nid = \"which\"\nkind = \"identification\"\nprompt = \"?\"\nrepetitions = 1\n\
             answers = [{{ label = \"1\", models = [\"a\", \"b\"] }}, {{ label = \"2\", models = [\"c\"] }}]\n\
             practice = [\"c\", \"a\", \"b\"]\n\
             criterion = {{ correct = 3, of = 4, rounds = 5, draw = \"{draw}\" }}\n"
        );
        let parsed = parse("protocol.toml", &text);
        let found = parsed.findings.render(false);
        let protocol = parsed.protocol.unwrap_or_else(|| panic!("{found}"));
        let planner = Planner::new(&protocol, None).expect("a feasible design");
        for kind in KINDS {
            let mut ours = String::from("kind,number,position,model\n");
            for number in 1..=4 {
                let seat = kind(number);
                let all = planner.plan(seat).expect("an order");
                for trial in all.iter().filter(|t| t.practice) {
                    let model = trial.model().expect("a realization");
                    ours += &format!("{},{number},{},{model}\n", seat.stream(), trial.position);
                }
            }
            assert_eq!(ours.lines().count(), 1 + 4 * 15);
            let kind = kind(1).stream();
            let arguments = words(&[
                "--part",
                "which",
                "--practice",
                "c,a,b",
                "--rounds",
                "5",
                "--draw",
                draw,
                "--kind",
                kind,
            ]);
            let Some(theirs) = theirs(&arguments) else {
                println!("not compared: there is no python3");
                return;
            };
            assert_eq!(ours, theirs, "{draw} {kind}");
        }
    }
}

#[test]
fn a_script_makes_the_same_orders_of_tracks() {
    for version in [1, 2] {
        for tracks in TRACKS {
            let protocol = protocol(version, tracks, PAIRS);
            for kind in KINDS {
                let mut arguments = words(&["--part", "felt", "--order-version"]);
                arguments.extend([version.to_string(), "--kind".to_owned()]);
                arguments.push(kind(1).stream().to_owned());
                for track in tracks {
                    // 13 repetitions of 3 levels.
                    let track = track.replace(":c13:", ":39:");
                    arguments.extend(["--track".to_owned(), track]);
                }
                let ours = ours(&protocol, "felt", "track,intervals,easy", kind);
                let Some(theirs) = theirs(&arguments) else {
                    println!("not compared: there is no python3");
                    return;
                };
                assert_eq!(ours, theirs, "{version} {tracks:?}");
            }
        }
    }
}

#[test]
fn a_script_makes_the_same_orders_of_pairs() {
    for version in [1, 2] {
        for (pairs, numbered) in [
            (
                "models = [\"a\", \"b\", \"c\"]\npairs = \"all\"",
                "a/b,a/c,b/c",
            ),
            (
                "models = [\"d\", \"a\", \"c\"]\npairs = \"adjacent\"",
                "d/a,a/c",
            ),
            (
                "models = [\"d\", \"a\", \"c\"]\npairs = \"versus:a\"",
                "a/d,a/c",
            ),
            ("pairs = [[\"c\", \"a\"], [\"a\", \"e\"]]", "c/a,a/e"),
        ] {
            for (repetitions, order, of_two) in [
                ("5", "blocked", "balanced"),
                ("2", "shuffled", "random"),
                ("4", "williams", "balanced"),
                ("1", "latin-square", "balanced"),
            ] {
                let rules = format!(
                    "{pairs}\nrepetitions = {repetitions}\norder = \"{order}\"\ninterval_order = \"{of_two}\""
                );
                let protocol = protocol(version, &[], &rules);
                for kind in KINDS {
                    let ours = ours(&protocol, "better", "first,second", kind);
                    let version = version.to_string();
                    let arguments = words(&[
                        "--part",
                        "better",
                        "--pairs",
                        numbered,
                        "--repetitions",
                        repetitions,
                        "--order",
                        order,
                        "--interval-order",
                        of_two,
                        "--order-version",
                        &version,
                        "--kind",
                        kind(1).stream(),
                    ]);
                    let Some(theirs) = theirs(&arguments) else {
                        println!("not compared: there is no python3");
                        return;
                    };
                    assert_eq!(ours, theirs, "{version} {rules}");
                }
            }
        }
    }
}

/// A part of similarity; `rules` are its keys.
pub(crate) fn similarity(version: u32, rules: &str) -> Protocol {
    let text = format!(
        "format = \"study-protocol/3\"\n[study]\nid = \"s\"\ntitle = \"s\"\nseed = 2007\n\
         [design]\nparticipants = 10\norder_version = {version}\n[analysis]\nprimary = \"apart\"\n\
         [device]\nkind = \"simulated\"\nlimits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }}\n\
         [[models]]\nid = \"a\"\nfile = \"a.toml\"\n[[models]]\nid = \"b\"\nfile = \"b.toml\"\n\
         [[models]]\nid = \"c\"\nfile = \"c.toml\"\n[[models]]\nid = \"d\"\nfile = \"d.toml\"\n\
         [[parts]]\nid = \"apart\"\nkind = \"similarity\"\nprompt = \"?\"\nsame = \"0\"\ndifferent = \"1\"\n{rules}\n"
    );
    let parsed = parse("protocol.toml", &text);
    let found = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{found}"))
}

/// Practice and pairs of a similarity, with and without identical ones; the version of the protocol does not matter.
#[test]
fn a_script_makes_the_same_orders_of_similarity() {
    for (version, rules, pairs, identical, practice, repetitions, order) in [
        (
            1,
            "identical = true",
            "a/b,a/c,a/d,b/c,b/d,c/d",
            "a,b,c,d",
            "8",
            "2",
            "blocked",
        ),
        (
            2,
            "models = [\"d\", \"b\", \"a\"]",
            "d/b,d/a,b/a",
            "",
            "2",
            "3",
            "shuffled",
        ),
        (
            2,
            "pairs = [[\"b\", \"a\"], [\"c\", \"a\"], [\"c\", \"d\"]]\nidentical = true",
            "b/a,c/a,c/d",
            "b,a,c,d",
            "0",
            "4",
            "williams",
        ),
    ] {
        let rules = format!(
            "{rules}\npractice = {practice}\nrepetitions = {repetitions}\norder = \"{order}\""
        );
        let protocol = similarity(version, &rules);
        for kind in KINDS {
            let ours = ours(&protocol, "apart", "first,second", kind);
            let mut arguments = words(&["--part", "apart", "--similarity", pairs]);
            arguments.extend(words(&["--practice-pairs", practice, "--order", order]));
            arguments.extend(words(&["--repetitions", repetitions]));
            arguments.extend(words(&["--kind", kind(1).stream()]));
            if !identical.is_empty() {
                arguments.extend(words(&["--identical", identical]));
            }
            let Some(theirs) = theirs(&arguments) else {
                println!("not compared: there is no python3");
                return;
            };
            assert_eq!(ours, theirs, "{rules}");
        }
    }
}

/// Golden orders, two pairs of practice first; see `golden.rs`.
#[test]
fn orders_of_similarity_never_change() {
    let protocol = similarity(
        2,
        "models = [\"a\", \"b\", \"c\"]\nidentical = true\npractice = 2\nrepetitions = 2",
    );
    let planner = Planner::new(&protocol, None).unwrap();
    let shown = |seat: Seat| {
        let trials = planner.plan(seat).unwrap();
        let lines: Vec<String> = trials.iter().filter_map(line).collect();
        lines.join(" ").replace(',', "")
    };
    assert_eq!(shown(Seat::Row(1)), SIMILARITY_1);
    assert_eq!(shown(Seat::Row(2)), SIMILARITY_2);
}

const SIMILARITY_1: &str = "cb ab cb bb aa ba ac cc aa bb ab ca bc cc";
const SIMILARITY_2: &str = "ca ba aa cc ab bb ca bc aa cc cb bb ba ac";

/// A part of ranking; `rules` are its keys.
fn ranking(version: u32, rules: &str) -> Protocol {
    let text = format!(
        "format = \"study-protocol/3\"\n[study]\nid = \"s\"\ntitle = \"s\"\nseed = 2007\n\
         [design]\nparticipants = 10\norder_version = {version}\n[analysis]\nprimary = \"order\"\n\
         [device]\nkind = \"simulated\"\nlimits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }}\n\
         [[models]]\nid = \"a\"\nfile = \"a.toml\"\n[[models]]\nid = \"b\"\nfile = \"b.toml\"\n\
         [[models]]\nid = \"c\"\nfile = \"c.toml\"\n[[models]]\nid = \"d\"\nfile = \"d.toml\"\n\
         [[parts]]\nid = \"order\"\nkind = \"ranking\"\nprompt = \"{{n}}?\"\nfirst = \"1\"\nlast = \"n\"\n{rules}\n"
    );
    let parsed = parse("protocol.toml", &text);
    let found = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{found}"))
}

/// Practice and trials of a ranking; the version of the protocol does not matter.
#[test]
fn a_script_makes_the_same_orders_of_rankings() {
    for (version, models, practice, repetitions, order) in [
        (1, "a,b,c,d", "2", "3", "blocked"),
        (2, "d,b,a", "0", "4", "williams"),
        (2, "c,a,b,d", "1", "5", "latin-square"),
        (1, "b,a", "1", "2", "fixed"),
    ] {
        let ids: Vec<String> = models.split(',').map(|id| format!("\"{id}\"")).collect();
        let rules = format!(
            "models = [{}]\npractice = {practice}\nrepetitions = {repetitions}\norder = \"{order}\"",
            ids.join(", ")
        );
        let protocol = ranking(version, &rules);
        for kind in KINDS {
            let ours = ours(&protocol, "order", "set", kind);
            let mut arguments = words(&["--part", "order", "--ranking", models]);
            arguments.extend(words(&["--practice-rankings", practice, "--order", order]));
            arguments.extend(words(&["--repetitions", repetitions]));
            arguments.extend(words(&["--kind", kind(1).stream()]));
            let Some(theirs) = theirs(&arguments) else {
                println!("not compared: there is no python3");
                return;
            };
            assert_eq!(ours, theirs, "{rules}");
        }
    }
}

/// Golden orders, one of practice first; see `golden.rs`.
#[test]
fn orders_of_rankings_never_change() {
    let rules = "models = [\"a\", \"b\", \"c\", \"d\"]\npractice = 1\nrepetitions = 2";
    let protocol = ranking(2, rules);
    let planner = Planner::new(&protocol, None).unwrap();
    let shown = |seat: Seat| {
        let trials = planner.plan(seat).unwrap();
        let lines = trials.iter().filter_map(line);
        let lines: Vec<String> = lines.map(|line| line.replace(' ', "")).collect();
        lines.join(" ")
    };
    assert_eq!(shown(Seat::Row(1)), RANKING_1);
    assert_eq!(shown(Seat::Row(2)), RANKING_2);
}

const RANKING_1: &str = "bcad adbc dcab";
const RANKING_2: &str = "cadb dabc cbda";

#[test]
fn a_script_makes_the_same_levels_of_constant_stimuli() {
    let protocol = protocol(1, TRACKS[0], PAIRS);
    let track = &protocol.tracks[0];
    assert!(matches!(track.rule, Rule::Constant(_)));
    for kind in KINDS {
        let mut ours = String::from("kind,number,position,level\n");
        for number in 1..=4 {
            let mut running = protocol.start(track, kind(number)).unwrap();
            for position in 1..=39 {
                let level = running.next().unwrap().level;
                ours += &format!("{},{number},{position},{level}\n", kind(1).stream());
                running.answer(&study_plan::procedure::Answer {
                    presented: level,
                    positive: true,
                    easy: false,
                });
            }
            assert_eq!(running.next(), None);
        }
        let arguments = words(&[
            "--constant",
            "const:0.1,0.2,0.4:13",
            "--kind",
            kind(1).stream(),
        ]);
        let Some(theirs) = theirs(&arguments) else {
            println!("not compared: there is no python3");
            return;
        };
        assert_eq!(ours, theirs);
    }
}

/// Golden orders; see `golden.rs`.
#[test]
fn orders_of_parts_never_change() {
    let shown = |version, track: &str| {
        let protocol = protocol(version, &[track], PAIRS);
        let planner = Planner::new(&protocol, None).unwrap();
        let trials = planner.plan(Seat::Row(1)).unwrap();
        let lines: Vec<String> = trials.iter().filter_map(line).collect();
        let lines = lines.iter().map(|line| line.replace(",false", ""));
        let lines: Vec<String> = lines.map(|line| line.replace(",true", "*")).collect();
        lines.join(" ").replace("t,", "").replace(',', "")
    };
    let pairs = PAIRS_V1;
    assert_eq!(shown(1, "t:2ifc:12:0:0.1"), format!("{pairs} {TWO_V1}"));
    assert_eq!(shown(1, "t:yes-no:12:0.3:0"), format!("{pairs} {YES_V1}"));
    let pairs = PAIRS_V2;
    assert_eq!(shown(2, "t:2ifc:12:0:0.1"), format!("{pairs} {TWO_V2}"));
    assert_eq!(shown(2, "t:yes-no:12:0.3:0"), format!("{pairs} {YES_V2}"));
}

const PAIRS_V1: &str =
    "de db ce cb ab ad eb ac ae dc bd da ec ba ca ed cd bc be ea db ae eb de ab ce cb ac dc ad";
const TWO_V1: &str = "SC* SC SC CS CS SC CS SC CS SC CS SC CS";
const YES_V1: &str = "C C S S C C S C C C S C C C S C C";
const PAIRS_V2: &str =
    "ed db ce cb ab ad be ac ae cd bd da ec ba ca de dc bc eb ea db ea eb de ba ec cb ca cd da";
const TWO_V2: &str = "CS SC CS SC CS CS SC CS CS CS CS CS SC*";
const YES_V2: &str = "C S C C C S C S S S C C C S C S C C C";

/// A group with m0, m2, m4, m5 of a part of neighbors, in both versions.
#[test]
fn a_group_compares_the_neighbors_among_its_own_realizations_since_version_2() {
    let pairs = |version: u32| {
        let mut whole = protocol(
            version,
            &[],
            "pairs = \"adjacent\"\nrepetitions = 2\norder = \"blocked\"",
        );
        let models = ["a", "c", "d", "e"].map(|id| study_base::text::ModelId::new(id).unwrap());
        let id = study_base::text::PartId::new("own").unwrap();
        whole.groups = Some(study_plan::protocol::Groups {
            assign: study_plan::protocol::Assign::Given,
            list: vec![study_plan::protocol::GroupRules {
                id: id.clone(),
                share: 1,
                parts: None,
                models: Some(models.to_vec()),
            }],
        });
        let own = whole.of(&study_plan::protocol::Assigned {
            group: Some(id),
            ..Default::default()
        });
        let trials = Planner::new(&own, None)
            .unwrap()
            .plan(Seat::Row(1))
            .unwrap();
        let two = |trial: &Trial| {
            let line = line(trial)?;
            let mut two: Vec<&str> = line.split(',').collect();
            two.sort_unstable();
            Some(two.concat())
        };
        let pairs: std::collections::BTreeSet<String> = trials.iter().filter_map(two).collect();
        pairs.into_iter().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(pairs(1), "cd de");
    assert_eq!(pairs(2), "ac cd de");
}
