//! The clauses of docs/devices.md, section 3: the documented example passes, and each change that
//! breaks one of them fails in that clause.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stderr, reason = "what is skipped is told")]

use study_device::process::check::{Checked, clauses};

fn example() -> Option<String> {
    let found = std::process::Command::new("python3")
        .arg("--version")
        .output();
    if found.is_err() {
        eprintln!("SKIPPED: python3 is not on this machine, no program was checked");
        return None;
    }
    Some(std::fs::read_to_string(crate::support::repository("docs/process_device.py")).unwrap())
}

fn checked(text: &str) -> Checked {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("controller.py");
    std::fs::write(&script, text).unwrap();
    let command = ["python3".to_owned(), script.display().to_string()];
    clauses(&command, &mut |_| ()).unwrap()
}

fn failed(checked: &Checked) -> Vec<(&'static str, String)> {
    let open = checked.verdicts.iter().filter(|v| !v.pass);
    open.map(|v| (v.clause, v.seen.clone())).collect()
}

/// What is broken, the clause that fails, and what is seen.
const BROKEN: [(&str, &str, &str, &str); 12] = [
    (
        "elif do == \"free\":",
        "elif do == \"limp\":",
        "free",
        "no `free` within 3.0 s",
    ),
    (
        "t, since = now - (since or now), None  # zero force",
        "t = now - (since or now)",
        "free",
        "the sample of `free` has 1.00 N",
    ),
    (
        "0.5 if since else 0)",
        "0)",
        "alive",
        "it does not say that it is limp (`fault`)",
    ),
    (
        "0.5 if since else 0)",
        "0.9 if since else 0)",
        "alive",
        "`fault` comes after",
    ),
    (
        "say(\"free\", load=load, sample=[0.0",
        "0 and (\"\", [0.0",
        "end",
        "it ends without `free`",
    ),
    (
        "elif do == \"start\" and table:",
        "elif do == \"start\":\n        table = table or kept",
        "latch",
        "1.00 N after a start without a load",
    ),
    (
        "max(-limit_n, min(limit_n, force))",
        "force",
        "limits",
        "1.00 N of at most 0.50 N",
    ),
    (
        " * (0.5 - 0.5 * math.cos(math.pi * min(t / 0.4, 1)))",
        "",
        "start",
        "the first sample, at 0.000 s, has 1.00 N",
    ),
    (
        "elif do == \"load\":",
        "elif do == \"load\" and table:\n        say(\"loaded\", load=load)\n    elif do == \"load\":",
        "load",
        "the force of the first one plays",
    ),
    (
        "        since = table = None  # zero force\n    elif",
        "    elif",
        "stop",
        "1.00 N after the outcome",
    ),
    (
        "    signal.setitimer",
        "    if do == \"future-command\": raise ValueError(do)\n    signal.setitimer",
        "unknown",
        "ValueError: future-command",
    ),
    (
        "watchdog_ms=500)",
        "watchdog_ms=500, stroke_mm=[0, 40])",
        "stroke",
        "it loads one from -1 to 41 mm",
    ),
];

#[test]
fn the_example_passes_every_clause_and_what_is_broken_fails_in_its_own() {
    let Some(example) = example() else { return };
    std::thread::scope(|scope| {
        let right = scope.spawn(|| checked(&example));
        let broken: Vec<_> = (BROKEN.iter())
            .map(|(from, to, clause, seen)| {
                let text = example.replacen(from, to, 1).replace(
                    "        table, limit_n, since = command",
                    "        kept = command[\"table\"]\n        table, limit_n, since = command",
                );
                assert!(example.contains(from), "{from}");
                (from, clause, seen, scope.spawn(move || checked(&text)))
            })
            .collect();
        let right = right.join().unwrap();
        assert_eq!(failed(&right), []);
        assert_eq!(right.verdicts.len(), 11);
        for (from, clause, seen, checked) in broken {
            let failed = failed(&checked.join().unwrap());
            let named = failed.iter().any(|(c, s)| c == clause && s.contains(seen));
            assert!(named, "{from}: {failed:?}");
        }
    });
}

/// The client library that laboratories begin with. `.ci/clients` also checks its rendering.
#[test]
fn the_python_client_passes_every_clause() {
    if example().is_none() {
        return;
    }
    let script = crate::support::repository("clients/python/examples/simulated.py");
    let checked = clauses(&["python3".to_owned(), script], &mut |_| ()).unwrap();
    assert_eq!(failed(&checked), []);
    let servo = checked.told.identity.servo.unwrap();
    assert_eq!((servo.servo_hz, servo.ramp_s), (1000.0, 0.4));
}

/// Version 1 confirms nothing; what it does can be seen in its samples.
#[test]
fn a_program_of_version_1_is_judged_by_its_samples() {
    let Some(example) = example() else { return };
    let old = (example.replace("study-process/2", "study-process/1"))
        .replace("elif do == \"free\":", "elif do == \"limp\":")
        .replace("say(\"free\"", "0 and say(\"free\"")
        .replace("say(\"outcome\"", "say(\"stopped\"");
    let deaf = old.replace("0.5 if since else 0)", "0)");
    let (old, deaf) = std::thread::scope(|scope| {
        let [old, deaf] = [old, deaf].map(|text| scope.spawn(move || checked(&text)));
        (old.join().unwrap(), deaf.join().unwrap())
    });
    assert!(old.told.is_version_1);
    assert_eq!(failed(&old), []);
    let failed = failed(&deaf);
    assert!(
        failed.iter().any(|(clause, _)| *clause == "alive"),
        "{failed:?}"
    );
}
