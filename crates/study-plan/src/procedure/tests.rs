use super::*;

fn stream() -> Stream {
    Stream::new(1, &["track"])
}

fn ladder() -> Ladder {
    Ladder::new((0..=40).map(|i| f64::from(i) * 0.05).collect()).unwrap()
}

fn staircase() -> Staircase {
    Staircase {
        up: 1,
        down: 2,
        start: 1.0,
        steps: vec![0.2, 0.1],
        scale: Scale::Lin,
        step_up_factor: 1.0,
        min_level: None,
        max_level: None,
        initial_one_up_one_down: true,
        stop: Stop {
            reversals: 4,
            min_trials: 0,
            max_trials: 30,
        },
        estimate_last: 2,
    }
}

fn quest(trials: u32) -> QuestPlus {
    let mean = ladder().levels()[1..].to_vec();
    QuestPlus::psi(mean, vec![0.1, 0.2, 0.4], 0.5, 0.02, trials)
}

fn rules() -> [Rule; 3] {
    [
        Rule::Staircase(staircase()),
        Rule::QuestPlus(quest(25)),
        Rule::Constant(Constant {
            levels: vec![0.5, 1.0, 1.5],
            repetitions: 4,
        }),
    ]
}

/// A run with some wrong answers and two easy trials.
fn run(rule: &Rule) -> Vec<Recorded> {
    let ladder = ladder();
    let mut track = Track::new(rule, &ladder, &mut stream()).unwrap();
    let mut trials = Vec::new();
    while let Some(proposal) = track.next() {
        let n = trials.len();
        let easy = n == 3 || n == 8;
        let recorded = Recorded {
            proposed: (!easy).then_some(proposal.level),
            answer: Answer {
                presented: ladder.level(if easy { 40 } else { proposal.step }),
                positive: n % 3 != 1,
                easy,
            },
        };
        track.answer(&recorded.answer);
        trials.push(recorded);
    }
    trials
}

/// Watson (2017), example 1: the stimuli printed there, in dB.
#[test]
fn quest_plus_gives_the_published_sequence() {
    let db: Vec<f64> = (-40..=0).map(f64::from).collect();
    let parameters = vec![
        Parameter::new("threshold", db.clone()),
        Parameter::new("slope", vec![3.5]),
        Parameter::new("gamma", vec![0.5]),
        Parameter::new("lambda", vec![0.02]),
    ];
    let rule = Rule::QuestPlus(QuestPlus::new(Function::WeibullDb, parameters, 32));
    let printed = [
        -18, -22, -25, -28, -30, -22, -13, -15, -16, -18, -19, -20, -21, -22, -23, -19, -20, -20,
        -18, -18, -19, -17, -17, -18, -18, -18, -19, -19, -19, -19, -19, -19,
    ];
    let wrong = [4, 5, 14, 17, 20];
    let ladder = Ladder::new(db).unwrap();
    let mut track = Track::new(&rule, &ladder, &mut stream()).unwrap();
    for (n, level) in printed.into_iter().enumerate() {
        let presented = ladder.level(track.next().unwrap().step);
        assert_eq!(presented, f64::from(level), "trial {}", n + 1);
        track.answer(&Answer {
            presented,
            positive: !wrong.contains(&n),
            easy: false,
        });
    }
    let summary = track.summary();
    assert!(summary.ended && summary.finished && track.next().is_none());
    assert_eq!(summary.posterior[0].mode, -20.0);
    assert!((summary.estimate.unwrap() + 20.393_603_116_389_613).abs() < 1e-7);
}

#[test]
fn a_track_follows_from_its_answers() {
    for rule in rules() {
        let trials = run(&rule);
        assert!(trials.len() > 8);
        let answers: Vec<Answer> = trials.iter().map(|t| t.answer).collect();
        for (n, trial) in trials.iter().enumerate() {
            let next = next(&rule, &ladder(), &mut stream(), &answers[..n]).unwrap();
            if let Some(level) = trial.proposed {
                assert_eq!(next.unwrap().level, level);
            }
        }
        let text = serde_json::to_string(&rule).unwrap();
        assert_eq!(serde_json::from_str::<Rule>(&text).unwrap(), rule);
    }
}

#[test]
fn a_journal_that_its_rule_would_not_give_is_found() {
    for rule in rules() {
        let trials = run(&rule);
        let track = || Track::new(&rule, &ladder(), &mut stream()).unwrap();
        assert_eq!(verify(track(), &trials), Ok(()));
        let mut other = trials.clone();
        let proposed = other[5].proposed.unwrap();
        let changed = f64::from_bits(proposed.to_bits() + 1);
        other[5].proposed = Some(changed);
        assert_eq!(
            verify(track(), &other),
            Err(Mismatch::Proposed {
                trial: 6,
                recorded: changed,
                computed: proposed
            })
        );
        let mut other = trials.clone();
        other[5].answer.presented = 0.3;
        assert!(matches!(
            verify(track(), &other),
            Err(Mismatch::Presented { trial: 6, .. })
        ));
        let mut other = trials.clone();
        other.push(trials[0]);
        let trial = other.len();
        assert_eq!(verify(track(), &other), Err(Mismatch::Ended { trial }));
    }
    // a changed answer shows in the trials after it
    let rule = Rule::QuestPlus(quest(25));
    let mut trials = run(&rule);
    trials[4].answer.positive ^= true;
    let track = Track::new(&rule, &ladder(), &mut stream()).unwrap();
    assert!(matches!(
        verify(track, &trials),
        Err(Mismatch::Proposed { trial: 6, .. })
    ));
}

/// An easy trial moves no staircase and teaches QUEST+.
#[test]
fn easy_trials_only_teach_quest_plus() {
    // on the ladder and beside it
    for (rule, presented) in rules()
        .into_iter()
        .flat_map(|r| [(r.clone(), 2.0), (r, 1.99)])
    {
        let easy = Answer {
            presented,
            positive: false,
            easy: true,
        };
        let mut track = Track::new(&rule, &ladder(), &mut stream()).unwrap();
        let before = track.next();
        track.answer(&easy);
        assert_eq!(track.summary().trials, 0);
        match rule {
            Rule::QuestPlus(_) => assert!(track.next().unwrap().level > before.unwrap().level),
            _ => assert_eq!(track.next(), before),
        }
    }
}

/// Every level of a staircase is within the ladder and its own limits, however the answers
/// fall, and it stops at its largest number of trials without being finished.
#[test]
fn a_staircase_stays_on_its_ladder() {
    let whole = (None, None, 0.0..=2.0);
    let narrow = (Some(0.5), Some(1.5), 0.5..=1.5);
    for ((min_level, max_level, within), positive) in [&whole, &narrow]
        .into_iter()
        .flat_map(|limits| [true, false].map(|positive| (limits, positive)))
    {
        let rule = Rule::Staircase(Staircase {
            min_level: *min_level,
            max_level: *max_level,
            ..staircase()
        });
        let mut track = Track::new(&rule, &ladder(), &mut stream()).unwrap();
        let mut n = 0;
        while let Some(proposal) = track.next() {
            assert!(within.contains(&proposal.level));
            n += 1;
            track.answer(&Answer {
                presented: ladder().level(proposal.step),
                positive,
                easy: false,
            });
        }
        let summary = track.summary();
        assert_eq!((n, summary.trials, summary.ended), (30, 30, true));
        assert!(!summary.finished && summary.estimate.is_none() && summary.held > 3);
    }
}

/// García-Pérez (1998): the recommended steps and where they settle; Levitt (1971).
#[test]
fn targets_are_those_of_the_literature() {
    let target = |up, down, factor| {
        let rule = Staircase {
            up,
            down,
            step_up_factor: factor,
            ..staircase()
        };
        rule.target().unwrap()
    };
    for (down, ratio, expected) in [
        (1, 0.2845, 0.7785),
        (2, 0.5488, 0.8035),
        (3, 0.7393, 0.8315),
        (4, 0.8415, 0.8584),
    ] {
        assert!((target(1, down, 1.0 / ratio) - expected).abs() < 5e-5);
    }
    for (up, down, expected) in [
        (1, 2, 0.5f64.sqrt()),
        (1, 3, 0.7937),
        (2, 1, 0.2929),
        (3, 1, 0.2063),
    ] {
        assert!((target(up, down, 1.0) - expected).abs() < 5e-5);
    }
    assert_eq!(Staircase::factor_for(0.75), Some(3.0));
    assert!((target(1, 1, 3.0) - 0.75).abs() < 1e-15);
}

#[test]
fn a_step_up_is_longer_by_its_factor() {
    let rule = Rule::Staircase(Staircase {
        step_up_factor: 3.0,
        ..staircase()
    });
    let level = |positive| {
        let mut track = Track::new(&rule, &ladder(), &mut stream()).unwrap();
        track.answer(&Answer {
            presented: 1.0,
            positive,
            easy: false,
        });
        track.next().unwrap().level
    };
    assert!((level(true) - 0.8).abs() < 1e-12);
    assert!((level(false) - 1.6).abs() < 1e-12);
}

#[test]
fn the_ladder_takes_the_nearest_level() {
    let ladder = Ladder::new(vec![0.0, 1.0, 3.0]).unwrap();
    let steps = [-1.0, 0.4, 0.5, 0.6, 2.0, 2.1, 9.0].map(|x| ladder.nearest(x));
    assert_eq!(steps, [0, 0, 0, 1, 1, 2, 2]);
    assert!(Ladder::new(vec![1.0, 1.0]).is_err() && Ladder::new(vec![]).is_err());
    assert!(Ladder::new(vec![f64::NAN]).is_err());
}

#[test]
fn passes_take_every_unfinished_track_once() {
    let mut passes = Passes::new(3, None);
    let mut order = Vec::new();
    while let Some(track) = passes.next(|t| order.iter().filter(|o| **o == t).count() > 2 - t) {
        order.push(track);
    }
    assert_eq!(order, [0, 1, 2, 0, 1, 0]);
    // a shuffled pass does not depend on who has finished
    let orders = [[9, 9, 9], [9, 1, 9]].map(|most| {
        let mut passes = Passes::new(3, Some(stream()));
        let mut counts = [0; 3];
        let mut order = Vec::new();
        while let Some(track) = passes.next(|t| counts[t] >= most[t]) {
            counts[track] += 1;
            order.push(track);
        }
        order.retain(|t| *t != 1);
        order
    });
    assert_eq!(orders[0], orders[1]);
    assert_eq!(orders[0].len(), 18);
}

#[test]
fn constant_stimuli_come_equally_often_and_in_no_order() {
    let [.., rule] = rules();
    let presented: Vec<f64> = run(&rule).iter().filter_map(|t| t.proposed).collect();
    for pass in presented.chunks(3) {
        let mut sorted = pass.to_vec();
        sorted.sort_by(f64::total_cmp);
        assert_eq!(sorted, [0.5, 1.0, 1.5]);
    }
    assert_eq!(presented.len(), 12);
    assert!(presented.chunks(3).any(|pass| pass != &presented[..3]));
}

/// Precision ends a track between its fewest and its most trials.
#[test]
fn quest_plus_stops_when_it_is_precise() {
    let bounded = |sd| QuestPlus {
        min_trials: 5,
        sd_below: Some(sd),
        ..quest(60)
    };
    let trials = |rule| run(&Rule::QuestPlus(rule)).len();
    let early = trials(bounded(10.0));
    assert_eq!(early, 5 + 1);
    let later = trials(bounded(0.12));
    assert!(later > early && later < 62, "{later}");
    assert_eq!(trials(bounded(1e-9)), 62);
}

#[test]
fn bad_rules_are_refused() {
    let error = |rule: Rule| {
        Track::new(&rule, &ladder(), &mut stream())
            .unwrap_err()
            .to_string()
    };
    let stairs = |change: fn(&mut Staircase)| {
        let mut rule = staircase();
        change(&mut rule);
        error(Rule::Staircase(rule))
    };
    assert_eq!(stairs(|r| r.steps.clear()), "steps is empty");
    assert_eq!(
        stairs(|r| r.steps = vec![-1.0]),
        "a step is -1; it must be above 0"
    );
    assert_eq!(
        stairs(|r| r.start = 3.0),
        "start is 3; it must be within the limits and the ladder"
    );
    assert_eq!(
        stairs(|r| (r.scale, r.start) = (Scale::Log, 0.0)),
        "with a log or dB scale start must be above 0, and is 0"
    );
    let quest = |change: fn(&mut QuestPlus)| {
        let mut rule = quest(9);
        change(&mut rule);
        error(Rule::QuestPlus(rule))
    };
    assert!(quest(|r| drop(r.parameters.pop())).contains("lambda is no parameter"));
    assert!(quest(|r| r.parameters[3].values = vec![2.0]).contains("no probability"));
    assert!(quest(|r| r.parameters[0].prior = Some(vec![1.0])).contains("1 weights for 40"));
    assert!(quest(|r| r.parameters[1].prior = Some(vec![0.0; 3])).contains("not all 0"));
    assert!(
        quest(|r| r.parameters[1].values = (1..=300_000).map(f64::from).collect())
            .contains("more than 10000000 cells")
    );
    let constant = Rule::Constant(Constant {
        levels: vec![0.51],
        repetitions: 2,
    });
    assert_eq!(error(constant), "0.51 is not a level of the ladder, 0 to 2");
}
