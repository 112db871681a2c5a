use super::*;

fn stream() -> Stream {
    Stream::new(5, &["search"])
}

fn square(steps: usize) -> Lattice {
    Lattice::new(vec![steps; 2], |_| true).unwrap()
}

fn rule(choose: Choose, trials: u32) -> SearchRule {
    SearchRule { choose, trials }
}

const fn model(acquire: Acquire) -> Choose {
    Choose::PreferenceGp { start: 4, acquire }
}

const MODELS: [Choose; 2] = [model(Acquire::Challenger), model(Acquire::Eubo)];
const MODEL: Choose = MODELS[0];

/// Prefers the point that is nearer to a place, without noise.
fn nearer(lattice: &Lattice, place: &[f64], pair: [usize; 2]) -> Preferred {
    let far = |point: usize| -> f64 {
        let at = lattice.coordinates(point);
        at.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let [a, b] = pair;
    let (preferred, other) = if far(b) < far(a) { (b, a) } else { (a, b) };
    Preferred { preferred, other }
}

fn run(rule: &SearchRule, lattice: &Lattice, place: &[f64]) -> Vec<RecordedPair> {
    let mut search = Search::new(rule, lattice, &mut stream()).unwrap();
    let mut trials = Vec::new();
    while let Some(pair) = search.next() {
        let answer = nearer(lattice, place, pair);
        search.answer(&answer);
        trials.push(RecordedPair {
            pair,
            preferred: Some(answer.preferred),
        });
    }
    trials
}

#[test]
fn a_search_finds_the_point_that_is_preferred() {
    let lattice = square(5);
    let places = [[0.75, 0.25], [0.0, 1.0], [0.5, 0.5]];
    let all = MODELS
        .iter()
        .flat_map(|model| places.map(|place| (*model, place)));
    for (model, place) in all {
        let mut search = Search::new(&rule(model, 30), &lattice, &mut stream()).unwrap();
        while let Some(pair) = search.next() {
            search.answer(&nearer(&lattice, &place, pair));
        }
        let best = search.best_point().unwrap();
        assert_eq!(lattice.coordinates(best), place);
        assert_eq!((search.answered(), search.next()), (30, None));
    }
}

/// The pairs of a search in which the lower point is always preferred: another program or machine that proposes others
/// is not this one. `docs/search.py` makes the same.
#[test]
fn pairs_are_the_same_everywhere() {
    let lattice = Lattice::new(vec![5, 4], |at| at[0] + at[1] < 7).unwrap();
    for (model, expected) in MODELS.iter().zip([CHALLENGES, EUBO]) {
        let mut search = Search::new(&rule(*model, 12), &lattice, &mut stream()).unwrap();
        let mut pairs = Vec::new();
        while let Some([preferred, other]) = search.next() {
            pairs.push((preferred, other));
            search.answer(&Preferred { preferred, other });
        }
        assert_eq!(pairs, expected);
    }
}

/// From `docs/search.py --seed 5 --stream search --steps 5,4 --without 19 --start 4 --trials 12`.
const CHALLENGES: [(usize, usize); 12] = [
    (0, 17),
    (7, 10),
    (12, 17),
    (2, 7),
    (2, 4),
    (2, 16),
    (1, 2),
    (1, 3),
    (1, 15),
    (0, 1),
    (0, 2),
    (0, 1),
];

/// The same with `--acquire eubo`.
const EUBO: [(usize, usize); 12] = [
    (0, 17),
    (7, 10),
    (12, 17),
    (2, 7),
    (0, 2),
    (0, 8),
    (0, 1),
    (0, 16),
    (0, 4),
    (0, 3),
    (0, 15),
    (0, 16),
];

#[test]
fn a_journal_that_its_rule_would_not_give_is_found() {
    let lattice = square(4);
    for choose in [MODELS[0], MODELS[1], Choose::Sobol, Choose::Random] {
        let rule = rule(choose, 9);
        let trials = run(&rule, &lattice, &[0.3, 0.9]);
        let search = || Search::new(&rule, &lattice, &mut stream()).unwrap();
        assert_eq!(verify_search(search(), &trials, &[]), Ok(()));
        let text = serde_json::to_string(&rule).unwrap();
        assert_eq!(serde_json::from_str::<SearchRule>(&text).unwrap(), rule);
        // a trial without an answer is repeated
        let mut declined = trials.clone();
        declined.insert(
            6,
            RecordedPair {
                preferred: None,
                ..trials[6]
            },
        );
        assert_eq!(verify_search(search(), &declined, &[]), Ok(()));
        let mut other = trials.clone();
        other[5].pair = [other[5].pair[0], other[5].pair[1] ^ 1];
        let found = verify_search(search(), &other, &[]);
        assert!(
            matches!(found, Err(SearchMismatch::Presented { trial: 6, .. })),
            "{found:?}"
        );
        let mut other = trials.clone();
        other[2].preferred = Some(99);
        let none = SearchMismatch::Preferred {
            trial: 3,
            preferred: 99,
        };
        assert_eq!(verify_search(search(), &other, &[]), Err(none));
        let mut other = trials.clone();
        other.push(trials[0]);
        let ended = SearchMismatch::Ended { trial: 10 };
        assert_eq!(verify_search(search(), &other, &[]), Err(ended));
    }
    // a changed answer shows in a trial after it
    let rule = rule(MODEL, 12);
    let mut trials = run(&rule, &lattice, &[0.3, 0.9]);
    let [a, b] = trials[3].pair;
    trials[3].preferred = trials[3].preferred.map(|p| a + b - p);
    let search = Search::new(&rule, &lattice, &mut stream()).unwrap();
    assert!(matches!(
        verify_search(search, &trials, &[]),
        Err(SearchMismatch::Presented { .. })
    ));
}

/// A search of which points are left out presents them no more, and is replayed from its journal.
#[test]
fn a_point_that_is_left_out_is_proposed_no_more() {
    let lattice = square(3);
    for choose in [MODELS[0], MODELS[1], Choose::Sobol, Choose::Random] {
        let rule = rule(choose, 12);
        let fresh = || Search::new(&rule, &lattice, &mut stream()).unwrap();
        let calm = run(&rule, &lattice, &[0.0, 1.0]);
        let (mut search, mut trials, mut left_out) = (fresh(), Vec::new(), Vec::new());
        while let Some(pair) = search.next() {
            assert!(
                left_out
                    .iter()
                    .all(|out: &LeftOut| !pair.contains(&out.point))
            );
            // The device plays neither the first point of the third pair nor that of the eighth.
            let after = trials.len();
            if [2, 7].contains(&after) && left_out.iter().all(|out| out.after < after) {
                search.leave_out(pair[0]);
                left_out.push(LeftOut {
                    point: pair[0],
                    after,
                });
                continue;
            }
            let answer = nearer(&lattice, &[0.0, 1.0], pair);
            search.answer(&answer);
            trials.push(RecordedPair {
                pair,
                preferred: Some(answer.preferred),
            });
        }
        assert_eq!((trials.len(), left_out.len()), (12, 2));
        assert_eq!(trials[..2], calm[..2]);
        assert!(
            trials[2..]
                .iter()
                .all(|t| !t.pair.contains(&left_out[0].point))
        );
        assert_eq!(verify_search(fresh(), &trials, &left_out), Ok(()));
        let without = verify_search(fresh(), &trials, &[]);
        let turned = SearchMismatch::Presented {
            trial: 3,
            recorded: trials[2].pair,
            computed: calm[2].pair,
        };
        assert_eq!(without, Err(turned));
        let mut again = fresh();
        again.replay(&trials[..9], &left_out);
        assert_eq!(again.next(), Some(trials[9].pair));
        assert!(
            !left_out
                .iter()
                .any(|out| again.best_point() == Some(out.point))
        );
    }
    // The last two stay.
    let mut search = Search::new(&rule(Choose::Sobol, 5), &square(2), &mut stream()).unwrap();
    (0..4).for_each(|point| search.leave_out(point));
    assert_eq!(search.next(), Some([2, 3]));
    assert!(!search.can_leave_out(2) && !search.can_leave_out(0));
}

/// Whatever is answered, no point outside the certificate is proposed.
#[test]
fn no_point_outside_the_certificate_is_proposed() {
    let shapes: [fn(&[usize]) -> bool; 3] = [
        |at| at[0] + at[1] < 3,
        |at| at[0] == 2,
        |at| at[0] * at[0] + at[1] * at[1] < 14 && at[1] != 1,
    ];
    for certified in shapes {
        let lattice = Lattice::new(vec![5, 5], certified).unwrap();
        for choose in [MODEL, Choose::Sobol, Choose::Random] {
            for adversary in 0..4usize {
                let rule = rule(choose, 14);
                let mut search = Search::new(&rule, &lattice, &mut stream()).unwrap();
                let mut n = 0;
                while let Some([a, b]) = search.next() {
                    assert!(a < b && lattice.is_certified(a) && lattice.is_certified(b));
                    let first = match adversary {
                        0 => true,
                        1 => false,
                        2 => n % 2 == 0,
                        _ => (a * 7 + b * 3) % 5 < 2,
                    };
                    let (preferred, other) = if first { (a, b) } else { (b, a) };
                    search.answer(&Preferred { preferred, other });
                    n += 1;
                }
                assert_eq!(n, 14);
            }
        }
    }
}

#[test]
fn random_pairs_are_uniform_and_even_ones_cover_the_space() {
    let lattice = square(2);
    let mut counts = [0; 6];
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let mut stream = stream();
    for _ in 0..6000 {
        let pair = random(&lattice, &mut stream);
        counts[pairs.iter().position(|p| *p == pair).unwrap()] += 1;
    }
    // four standard errors
    assert!(
        counts.iter().all(|n: &i32| (n - 1000).abs() < 116),
        "{counts:?}"
    );
    // Of 8 pairs in 4 × 4 cells, each quarter has points.
    let lattice = square(4);
    let pairs = even(&lattice, 8, &mut stream);
    for quarter in 0..4 {
        let within = |point: &usize| {
            let at = lattice.at(*point);
            at[0] / 2 * 2 + at[1] / 2 == quarter
        };
        assert!(pairs.iter().flatten().filter(|p| within(p)).count() >= 2);
    }
}

#[test]
fn a_lattice_counts_the_last_axis_fastest_and_knows_its_groups() {
    let lattice = Lattice::new(vec![2, 3, 4], |at| at[2] != 2).unwrap();
    assert_eq!((lattice.len(), lattice.certified().len()), (24, 18));
    for point in 0..24 {
        assert_eq!(lattice.point(&lattice.at(point)), point);
    }
    assert_eq!(lattice.at(23), [1, 2, 3]);
    assert_eq!(lattice.coordinates(17), [1.0, 0.5, 1.0 / 3.0]);
    let groups = lattice.groups();
    let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
    assert_eq!(sizes, [12, 6]);
    assert!(groups[1].iter().all(|point| lattice.at(*point)[2] == 3));
    let few = |steps: Vec<usize>| Lattice::new(steps, |_| true).unwrap_err().to_string();
    assert_eq!(few(vec![]), "the number of axes is 0; it must be 1 to 4");
    assert_eq!(
        few(vec![2; 5]),
        "the number of axes is 5; it must be 1 to 4"
    );
    assert_eq!(
        few(vec![3, 1]),
        "the number of steps of an axis is 1; it must be at least 2"
    );
    assert_eq!(
        few(vec![32, 32]),
        "the number of points is 1024; it must be at most 1000"
    );
    let none = Lattice::new(vec![3, 3], |_| false).unwrap_err();
    assert_eq!(
        none.to_string(),
        "the number of certified points is 0; it must be at least 2"
    );
}

#[test]
fn bad_rules_are_refused() {
    let error = |choose, trials| {
        let found = Search::new(&rule(choose, trials), &square(3), &mut stream());
        found.unwrap_err().to_string()
    };
    assert_eq!(error(Choose::Random, 0), "trials is 0; it must be 1 to 500");
    assert_eq!(
        error(Choose::Sobol, 501),
        "trials is 501; it must be 1 to 500"
    );
    assert_eq!(error(MODEL, 3), "start is 4; it must be at most `trials`");
}
