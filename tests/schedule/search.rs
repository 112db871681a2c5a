//! The specification of searches is complete: a script written from `docs/search.md` alone proposes the same pairs.

use std::fs;
use std::process::Command;
use study_base::rng::Stream;
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Lattice, Preferred, Search, SearchRule};

/// Seed, steps, points that are not certified, first pairs, trials; how somebody answers.
type Case = (
    u64,
    &'static [usize],
    &'static [usize],
    u32,
    u32,
    fn(usize, [usize; 2]) -> usize,
);

const CASES: [Case; 4] = [
    (1, &[9], &[], 3, 14, |_, [low, _]| low),
    (2, &[4, 5], &[3, 4, 9], 6, 12, |trial, pair| pair[trial % 2]),
    (3, &[3, 3, 3], &[], 4, 12, |_, [low, high]| {
        if (low * 7 + 3) % 11 < (high * 7 + 3) % 11 {
            low
        } else {
            high
        }
    }),
    (4, &[2, 3, 2, 2], &[23], 10, 13, |_, [_, high]| high),
];

#[test]
fn a_script_written_from_the_document_proposes_the_same_pairs() {
    if Command::new("python3").arg("--version").output().is_err() {
        println!("not compared: there is no python3");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let words = [(Acquire::Challenger, "challenger"), (Acquire::Eubo, "eubo")];
    let all = CASES
        .iter()
        .flat_map(|case| words.map(|word| (*case, word)));
    for ((seed, steps, without, start, trials, answer), (acquire, word)) in all {
        let rule = SearchRule {
            choose: Choose::PreferenceGp { start, acquire },
            trials,
        };
        let first = Lattice::new(steps.to_vec(), |_| true).unwrap();
        let certified = |at: &[usize]| !without.contains(&first.point(at));
        let lattice = Lattice::new(steps.to_vec(), certified).unwrap();
        let mut stream = Stream::new(seed, &["search", "best", "row", "1"]);
        let mut search = Search::new(&rule, &lattice, &mut stream).unwrap();
        let (mut lines, mut answers) = (String::new(), String::new());
        let mut trial = 0;
        // The first point of the third pair, and of one that the model chose.
        let mut left_out: Vec<(usize, usize)> = Vec::new();
        while let Some(mut pair) = search.next() {
            if [2, start as usize + 1].contains(&trial) && search.can_leave_out(pair[0]) {
                left_out.push((pair[0], trial));
                search.leave_out(pair[0]);
                pair = search.next().unwrap();
            }
            trial += 1;
            lines += &format!("{trial},{},{}\n", pair[0], pair[1]);
            let preferred = answer(trial, pair);
            let other = pair[0] + pair[1] - preferred;
            answers += &format!("{preferred}\n");
            search.answer(&Preferred { preferred, other });
        }
        let file = folder.path().join("answers");
        fs::write(&file, answers).unwrap();
        let list = |numbers: &[usize]| {
            let words: Vec<String> = numbers.iter().map(ToString::to_string).collect();
            words.join(",")
        };
        let out: Vec<String> = (left_out.iter())
            .map(|(point, after)| format!("{point}@{after}"))
            .collect();
        let said = Command::new("python3")
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/search.py"))
            .args(["--seed", &seed.to_string(), "--stream", "search,best,row,1"])
            .args([
                "--steps",
                &list(steps),
                &format!("--without={}", list(without)),
            ])
            .args([
                "--start",
                &start.to_string(),
                "--trials",
                &trials.to_string(),
            ])
            .args(["--acquire", word, "--left-out", &out.join(",")])
            .arg("--answers")
            .arg(&file)
            .output()
            .unwrap();
        assert!(
            said.status.success(),
            "{}",
            String::from_utf8_lossy(&said.stderr)
        );
        let printed = String::from_utf8_lossy(&said.stdout);
        assert_eq!(printed, lines, "{steps:?} {word}");
    }
}
