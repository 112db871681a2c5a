//! Orders of parts of adjustment: the script of docs/schedule.md makes the same, and they never change.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{KINDS, theirs, words};
use study_plan::protocol::file::parse;
use study_plan::protocol::{Protocol, Seat, Stimuli};
use study_plan::schedule::Planner;

fn protocol() -> Protocol {
    let text = "format = \"study-protocol/3\"\n[study]\nid = \"s\"\ntitle = \"s\"\nseed = 2007\n\
         [design]\nparticipants = 10\n[analysis]\nprimary = \"equal\"\n\
         [device]\nkind = \"simulated\"\nlimits = { force_n = 12.0, velocity_mm_s = 1000.0 }\n\
         [[families]]\nid = \"f\"\nfrom = \"a.toml\"\nvary = \"b\"\nrange = [1.0, 3.0]\nsteps = 9\n\
         [[parts]]\nid = \"equal\"\nkind = \"adjustment\"\nprompt = \"?\"\nlower = \"-\"\nhigher = \"+\"\n\
         confirm = \"=\"\nfamily = \"f\"\nstart_below = [1.0, 1.25]\nstart_above = [2.75, 3.0]\n\
         repetitions = 3\npractice = 2\n";
    let parsed = parse("protocol.toml", text);
    let found = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{found}"))
}

fn starts(planner: &Planner, seat: Seat) -> Vec<String> {
    let trials = planner.plan(seat).unwrap();
    let start = |trial: study_plan::protocol::Trial| match trial.stimuli {
        Stimuli::Adjusted { start, .. } => start.to_string(),
        other => panic!("{other:?}"),
    };
    trials.into_iter().map(start).collect()
}

#[test]
fn a_script_makes_the_same_starts() {
    let protocol = protocol();
    let planner = Planner::new(&protocol, None).unwrap();
    for kind in KINDS {
        let mut ours = String::from("kind,number,position,start\n");
        for number in 1..=4 {
            let seat = kind(number);
            for (position, start) in (1..).zip(starts(&planner, seat)) {
                ours += &format!("{},{number},{position},{start}\n", seat.stream());
            }
        }
        let mut arguments = words(&["--part", "equal", "--adjustment", "f.1,f.2:f.8,f.9"]);
        arguments.extend(words(&["--repetitions", "3", "--practice-trials", "2"]));
        arguments.extend(words(&["--kind", kind(1).stream()]));
        let Some(theirs) = theirs(&arguments) else {
            println!("not compared: there is no python3");
            return;
        };
        assert_eq!(ours, theirs);
    }
}

/// Golden orders, two practice trials first; see `golden.rs`.
#[test]
fn starts_never_change() {
    let protocol = protocol();
    let planner = Planner::new(&protocol, None).unwrap();
    let shown = |row: u32| starts(&planner, Seat::Row(row)).join(" ").replace("f.", "");
    assert_eq!(shown(1), "1 9 2 9 8 1 9 2");
    assert_eq!(shown(2), "2 8 9 2 8 1 8 2");
}
