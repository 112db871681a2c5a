//! Trials with a correct answer, "yes" or "greater": their psychometric functions and
//! sensitivities.

use super::detection::{Detection, Task, detection};
use super::fits::{FitCell, FitSettings, psychometric};
use super::results::PartResults;
use std::collections::BTreeMap;
use study_stats::detection::Answers;
use study_stats::psychometric::{Core, Experiment, Level, Priors, Spacing};

/// How a trial is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Which of two intervals.
    TwoIntervals,
    /// Which of three intervals.
    ThreeIntervals,
    /// Which of three is odd.
    OddOneOut,
    /// Is X the first or the second?
    Abx,
    /// Same or different.
    SameDifferent,
    /// Yes or no.
    YesNo,
    /// Is the comparison greater than the standard?
    Comparison,
}

impl Asked {
    /// Names, as in `[[tracks]] method`.
    pub const NAMES: [(Self, &str); 7] = [
        (Self::TwoIntervals, "2ifc"),
        (Self::ThreeIntervals, "3ifc"),
        (Self::OddOneOut, "odd-one-out"),
        (Self::Abx, "abx"),
        (Self::SameDifferent, "same-different"),
        (Self::YesNo, "yes-no"),
        (Self::Comparison, "comparison"),
    ];

    /// The answers. The first one is that of which hits and false alarms are counted.
    pub fn answers(self) -> &'static [&'static str] {
        match self {
            Self::TwoIntervals | Self::Abx => &["first", "second"],
            Self::ThreeIntervals | Self::OddOneOut => &["first", "second", "third"],
            Self::SameDifferent => &["different", "same"],
            Self::YesNo => &["yes", "no"],
            Self::Comparison => &["greater", "smaller"],
        }
    }

    /// The experiment of a psychometric function; `None` if it has none.
    pub(super) fn experiment(self) -> Option<(Experiment, f64)> {
        let choice = |guess| Some((Experiment::ForcedChoice(guess), guess));
        match self {
            Self::TwoIntervals | Self::Abx => choice(0.5),
            Self::ThreeIntervals | Self::OddOneOut => choice(1.0 / 3.0),
            Self::SameDifferent => None,
            Self::YesNo => Some((Experiment::YesNo, 0.0)),
            Self::Comparison => Some((Experiment::Comparison, 0.0)),
        }
    }

    /// How its sensitivity is computed; `None` if it has none.
    fn task(self) -> Option<Task> {
        match self {
            Self::TwoIntervals => Some(Task::TwoAlternative),
            Self::ThreeIntervals => Some(Task::ForcedChoice(3)),
            Self::OddOneOut => Some(Task::Oddity),
            Self::Abx => Some(Task::Abx),
            Self::SameDifferent => Some(Task::SameDifferent),
            Self::YesNo => Some(Task::YesNo),
            Self::Comparison => None,
        }
    }
}

/// Trials of one participant that are alike.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialCount {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition, such as a track. Untrusted.
    pub condition: String,
    /// The level, if there is one.
    pub level: Option<f64>,
    /// Which of [`Asked::answers`] is correct, if one is and it is known. Of three answers
    /// it is not needed.
    pub target: Option<usize>,
    /// Positive answers: those that are correct, or where none is "yes" and "greater".
    pub positive: f64,
    /// Number of trials.
    pub trials: f64,
}

/// How the functions of trials are fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialSettings {
    /// Shape.
    pub core: Core,
    /// The scale of the levels.
    pub spacing: Spacing,
    /// λ of maximum likelihood.
    pub lambda: f64,
    /// The standard of a comparison.
    pub standard: Option<f64>,
    /// What is assumed before the answers, on the scale.
    pub priors: Priors,
    /// Simulated data sets for the p of the deviance; 0 for adaptive tracks.
    pub repeats: u32,
    /// Seed of those.
    pub seed: u64,
}

/// The largest λ where it is free in maximum likelihood (Wichmann & Hill 2001).
const MOST_LAPSES: f64 = 0.06;

type Cells<'a> = BTreeMap<(&'a str, &'a str), Vec<&'a TrialCount>>;

/// Psychometric functions of trials with levels, and sensitivities of conditions with one
/// level at most.
pub fn discrimination(
    asked: Asked,
    trials: &[TrialCount],
    settings: &TrialSettings,
) -> PartResults {
    let mut results = PartResults::undefined("");
    let mut cells = Cells::new();
    for trial in trials {
        let key = (trial.participant.as_str(), trial.condition.as_str());
        cells.entry(key).or_default().push(trial);
    }
    if let Some((experiment, gamma)) = asked.experiment() {
        let fits: Vec<FitCell> = (cells.iter())
            .map(|((participant, condition), trials)| FitCell {
                participant: (*participant).to_owned(),
                condition: (*condition).to_owned(),
                levels: trials.iter().filter_map(|t| level(asked, t)).collect(),
            })
            .filter(|cell| !cell.levels.is_empty())
            .collect();
        let settings = FitSettings {
            core: settings.core,
            spacing: settings.spacing,
            experiment,
            gamma,
            lambda: settings.lambda,
            lapse_most: Some(MOST_LAPSES),
            standard: settings.standard.filter(|_| asked == Asked::Comparison),
            priors: settings.priors,
            repeats: settings.repeats,
            seed: settings.seed,
        };
        let functions = psychometric(&fits, &settings);
        (results.psy, results.pooled) = (functions.psy, functions.pooled);
        results.over.psy_group = functions.psy_group;
    }
    if let Some(task) = asked.task() {
        let found: Vec<Detection> = (cells.iter())
            .filter(|(_, trials)| has_one_level(trials))
            .filter_map(|((participant, condition), trials)| {
                Some(Detection {
                    participant: (*participant).to_owned(),
                    condition: (*condition).to_owned(),
                    answers: answers(task, trials)?,
                    raw: false,
                })
            })
            .collect();
        results.sdt = detection(task, &found);
    }
    results
}

/// What counts for the function: catch trials do not.
pub(super) fn level(asked: Asked, trial: &TrialCount) -> Option<Level> {
    let has_catch = matches!(asked, Asked::YesNo | Asked::SameDifferent);
    let catch = has_catch && trial.target == Some(1);
    let level = trial.level.filter(|_| !catch)?;
    let positive = match (asked, trial.target) {
        // Of a comparison, "greater" is positive, whether or not it is correct.
        (Asked::Comparison, Some(1)) => trial.trials - trial.positive,
        _ => trial.positive,
    };
    Some(Level {
        level,
        positive,
        trials: trial.trials,
    })
}

/// Sensitivity over several levels has no meaning.
fn has_one_level(trials: &[&TrialCount]) -> bool {
    let signal = trials
        .iter()
        .filter(|t| t.target != Some(1) || t.level.is_none());
    let mut levels: Vec<f64> = signal.filter_map(|t| t.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    levels.len() < 2
}

/// Hits and false alarms; of a choice among several, correct answers.
fn answers(task: Task, trials: &[&TrialCount]) -> Option<Answers> {
    let mut answers = Answers {
        hits: 0.0,
        n_hits: 0.0,
        false_alarms: 0.0,
        n_false_alarms: 0.0,
    };
    for trial in trials {
        match (task, trial.target) {
            // Of a choice among several only right or wrong counts.
            (Task::ForcedChoice(_) | Task::Oddity, _) | (_, Some(0)) => {
                answers.hits += trial.positive;
                answers.n_hits += trial.trials;
            }
            (_, Some(_)) => {
                answers.false_alarms += trial.trials - trial.positive;
                answers.n_false_alarms += trial.trials;
            }
            (_, None) => return None,
        }
    }
    Some(answers)
}
