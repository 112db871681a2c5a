//! Simulated tracks on a ladder of ratios, for the benches of thresholds.

use study_base::rng::Stream;
use study_plan::procedure::{
    Answer, Constant, Function, Ladder, Parameter, QuestPlus, Rule, Scale, Staircase, Stop, Track,
};
use study_stats::psychometric::Level;

/// One track: its answers, and the estimate at its end.
pub(crate) fn simulate(
    rule: &Rule,
    ladder: &Ladder,
    correct: impl Fn(f64) -> f64,
    stream: &mut Stream,
) -> (Vec<Answer>, Option<f64>) {
    let mut track = Track::new(rule, ladder, stream).expect("the rule is good");
    let mut answers = Vec::new();
    while let Some(proposal) = track.next() {
        let presented = ladder.level(proposal.step);
        let answer = Answer {
            presented,
            positive: stream.unit() < correct(presented),
            easy: false,
        };
        track.answer(&answer);
        answers.push(answer);
    }
    (answers, track.summary().estimate)
}

/// Levels with their counts.
pub(crate) fn levels(answers: &[Answer]) -> Vec<Level> {
    (answers.iter())
        .map(|a| Level {
            level: a.presented,
            positive: f64::from(u8::from(a.positive)),
            trials: 1.0,
        })
        .collect()
}

/// 30 levels from 0.02 to 0.6, as the templates of `study new` have.
pub(crate) fn ratio_ladder() -> Ladder {
    let level = |i: i32| 0.02 * f64::powf(30.0, f64::from(i) / 29.0);
    Ladder::new((0..30).map(level).collect()).expect("levels rise")
}

/// Rules with their names, as far as the answers allow them.
pub(crate) fn ratio_rules() -> Vec<(&'static str, Rule)> {
    let ladder = ratio_ladder();
    let quest = |trials| {
        let parameters = vec![
            Parameter::new("threshold", ladder.levels().to_vec()),
            Parameter::new("slope", vec![0.8, 1.3, 2.0, 3.0, 5.0, 8.0]),
            Parameter::new("gamma", vec![0.5]),
            Parameter::new("lambda", vec![0.01, 0.03, 0.06]),
        ];
        Rule::QuestPlus(QuestPlus::new(Function::Weibull, parameters, trials))
    };
    let staircase = |reversals, max_trials| {
        Rule::Staircase(Staircase {
            up: 1,
            down: 3,
            start: 0.5,
            steps: vec![0.2, 0.1],
            scale: Scale::Log,
            step_up_factor: 1.0,
            min_level: None,
            max_level: None,
            initial_one_up_one_down: true,
            stop: Stop {
                reversals,
                min_trials: 0,
                max_trials,
            },
            estimate_last: 6,
        })
    };
    let constant = Rule::Constant(Constant {
        levels: [4, 9, 14, 19, 24].map(|i| ladder.level(i)).to_vec(),
        repetitions: 20,
    });
    vec![
        ("1-up-3-down, 8 reversals", staircase(8, 60)),
        ("QUEST+, 40 trials", quest(40)),
        ("QUEST+, 100 trials", quest(100)),
        ("constant, 5 × 20", constant),
    ]
}

/// The rules of the grid, on the ladder of ratios.
pub(crate) fn grid_rules(trials: u32) -> Vec<(&'static str, Rule)> {
    let [_, quest, ..] = &ratio_rules()[..] else {
        return Vec::new();
    };
    let mut quest = quest.1.clone();
    if let Rule::QuestPlus(quest) = &mut quest {
        quest.trials = trials;
    }
    let mut staircase = ratio_rules().remove(0).1;
    if let Rule::Staircase(staircase) = &mut staircase {
        staircase.stop = Stop {
            reversals: trials,
            min_trials: trials,
            max_trials: trials,
        };
    }
    let ladder = ratio_ladder();
    let constant = Rule::Constant(Constant {
        levels: [1, 5, 9, 13, 17, 21, 25, 29]
            .map(|i| ladder.level(i))
            .to_vec(),
        repetitions: trials / 8,
    });
    vec![
        ("1-up-3-down", staircase),
        ("QUEST+", quest),
        ("constant", constant),
    ]
}
